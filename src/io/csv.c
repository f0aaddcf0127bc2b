/* csv.c: see csv.h. */
#include "io/csv.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "io/export.h"

void drape_csv_put_integer(drape_file *file, int64_t value)
{
    drape_file_print(file, ",%" PRId64, value);
}

/* A NaN is written without its sign, which has no meaning. */
void drape_csv_put_number(drape_file *file, double value)
{
    if (isnan(value))
        drape_file_put_text(file, ",nan");
    else
        drape_file_print(file, ",%.17g", value);
}

/* RFC 4180, section 2, items 6 and 7. */
void drape_csv_put_text(drape_file *file, const char *text)
{
    drape_file_put_text(file, ",");
    if (!text)
        return;
    if (!strpbrk(text, ",\"\r\n")) {
        drape_file_put_text(file, text);
        return;
    }
    drape_file_put_text(file, "\"");
    for (; *text; text++)
        drape_file_put(file, *text == '"' ? "\"\"" : text, *text == '"' ? 2 : 1);
    drape_file_put_text(file, "\"");
}

drape_status drape_csv_open(drape_context *ctx, drape_folder *folder, const char *name, const char *columns,
                            bool resumes, drape_file *file)
{
    if (resumes)
        return drape_export_reopen(ctx, folder, name, file);
    drape_status status = drape_export_begin(ctx, folder, name, file);
    if (status)
        return status;
    drape_file_put_text(file, columns);
    return drape_file_publish(file);
}
