/* fuzz_experiment.c: the bytes are the files of the folder of an experiment, which is merged into another:
 * it is refused with one line, or makes a report, and nothing is written but into the other folder. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "drape/lab.h"
#include "fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char out[400];
    drape_lab_outcome outcome;
    const char *folder = fuzz_folder(data, size);
    drape_context *ctx = fuzz_open((size_t)1 << 28);
    snprintf(out, sizeof out, "%s-out", folder);
    const drape_status status = drape_lab_merge(ctx, &folder, 1, out, &outcome);
    fuzz_check(ctx, status, "drape_lab_merge");
    for (const char *at = outcome.text; at && *at; at++)
        FUZZ_REQUIRE((unsigned char)*at >= ' ' || *at == '\n', "a control character in the summary: %d", *at);
    drape_lab_outcome_free(&outcome);
    fuzz_close(&ctx);
    fuzz_remove(out);
    return 0;
}
