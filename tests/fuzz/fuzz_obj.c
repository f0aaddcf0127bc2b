/* fuzz_obj.c: the bytes are an OBJ file. */
#include "fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_mesh("obj", data, size);
    return 0;
}
