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

void drape_csv_put_quoted(drape_file *file, const char *text)
{
    for (; *text; text++)
        drape_file_put(file, *text == '"' ? "\"\"" : text, *text == '"' ? 2 : 1);
}

/* RFC 4180, section 2, items 6 and 7. */
void drape_csv_put_text(drape_file *file, const char *text)
{
    const char *quote = text && strpbrk(text, ",\"\r\n") ? "\"" : "";
    drape_file_print(file, ",%s", quote);
    if (*quote)
        drape_csv_put_quoted(file, text);
    else if (text)
        drape_file_put_text(file, text);
    drape_file_put_text(file, quote);
}

drape_status drape_csv_open(drape_context *ctx, drape_folder *folder, const char *name, const char *columns,
                            drape_file *file)
{
    drape_status status = drape_export_begin(ctx, folder, name, file);
    if (status)
        return status;
    drape_file_put_text(file, columns);
    return drape_file_publish(file);
}
