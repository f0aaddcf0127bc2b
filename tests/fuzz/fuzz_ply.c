/* fuzz_ply.c: the bytes are a PLY file. */
#include "fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_mesh("ply", data, size);
    return 0;
}
