/* fuzz_run.c: the bytes are the files of the folder of a finished run, of which a report is written; and the
 * folder is taken for another run, which may replace only what its manifest describes. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fuzz/fuzz.h"
#include "io/folder.h"
#include "report/report.h"

static bool any(const void *user, const char *name)
{
    (void)user;
    return *name != 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char out[400];
    bool input;
    drape_report_result result;
    drape_folder *taken = NULL;
    const char *folder = fuzz_folder(data, size);
    drape_context *ctx = fuzz_open((size_t)1 << 28);
    snprintf(out, sizeof out, "%s.html", folder);
    drape_status status = drape_report_write(ctx, &(drape_report_def){folder, out, 1 << 20}, &result, &input);
    fuzz_check(ctx, status, "drape_report_write");
    status = drape_folder_open(ctx, folder, false, &taken);
    if (!status)
        status = drape_folder_check(taken, any, any, NULL);
    if (!status)
        status = drape_folder_begin(taken, any, NULL);
    fuzz_check(ctx, status, "drape_folder_begin");
    drape_folder_close(&taken);
    fuzz_close(&ctx);
    unlink(out);
    return 0;
}
