/*
 * steps.c: see steps.h. CSV as of RFC 4180, but with lines that end in \n alone, as the tools of a Unix
 * expect.
 *
 * A row is one write to the system, so that a killed run leaves whole rows. Numbers have 17 digits. Where an
 * attempt has nothing worst to name, the worst_ fields are empty; worst_element is empty for a node.
 */
#include "io/steps.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#define FILE_NAME "steps.csv"

static const char columns[] = "attempt,t,h,accepted,status,reason,iterations,residual,tolerance,"
                              "kinetic,elastic,gravity,contact,dissipated,numerical,"
                              "worst_what,worst_term,worst_element,worst_nodes,worst_value,worst_limit\n";

drape_status drape_steps_open(drape_context *ctx, const char *folder, drape_file *file)
{
    drape_status status = drape_file_create(ctx, strlen(folder) + sizeof FILE_NAME, file);
    if (status)
        return status;
    drape_file_name(file, "%s/" FILE_NAME, folder);
    status = drape_file_begin(file);
    if (status)
        return status;
    drape_file_put_text(file, columns);
    return drape_file_publish(file);
}

/* The fields of a row after the first each begin with their comma. */
static void put_integer(drape_file *file, int64_t value)
{
    drape_file_print(file, ",%" PRId64, value);
}

/* The sign of a NaN says nothing. */
static void put_number(drape_file *file, double value)
{
    if (isnan(value))
        drape_file_put_text(file, ",nan");
    else
        drape_file_print(file, ",%.17g", value);
}

/* RFC 4180, section 2, items 6 and 7. */
static void put_text(drape_file *file, const char *text)
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

static void put_energy(drape_file *file, const drape_energy *energy)
{
    put_number(file, energy->kinetic);
    put_number(file, energy->elastic);
    put_number(file, energy->gravity);
    put_number(file, energy->contact);
    put_number(file, energy->dissipated);
    put_number(file, energy->numerical);
}

static void put_nodes(drape_file *file, const int32_t node[4])
{
    drape_file_put_text(file, ",");
    for (int i = 0; i < 4 && node[i] >= 0; i++)
        drape_file_print(file, "%s%" PRId32, i ? " " : "", node[i]);
}

static void put_worst(drape_file *file, const drape_worst *worst)
{
    if (!worst->what || !*worst->what) {
        drape_file_put_text(file, ",,,,,,");
        return;
    }
    put_text(file, worst->what);
    put_text(file, worst->term);
    if (worst->element >= 0)
        put_integer(file, worst->element);
    else
        drape_file_put_text(file, ",");
    put_nodes(file, worst->node);
    put_number(file, worst->value);
    put_number(file, worst->limit);
}

drape_status drape_steps_write(drape_file *file, const drape_attempt *attempt, const drape_energy *energy)
{
    drape_file_print(file, "%" PRId64, attempt->index);
    put_number(file, attempt->t);
    put_number(file, attempt->h);
    put_integer(file, attempt->accepted);
    put_text(file, drape_status_name(attempt->status));
    put_text(file, attempt->reason);
    put_integer(file, attempt->iterations);
    put_number(file, attempt->residual);
    put_number(file, attempt->tolerance);
    put_energy(file, energy);
    put_worst(file, &attempt->worst);
    drape_file_put_text(file, "\n");
    return drape_file_keep(file);
}
