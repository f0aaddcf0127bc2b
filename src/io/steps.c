/*
 * steps.c: see steps.h. A row is written by one system call, so that a killed run leaves whole rows. If an
 * attempt has no diagnostic, the worst_ fields are empty; worst_element is empty for a node.
 */
#include "io/steps.h"

#include <inttypes.h>

#include "io/csv.h"

#define FILE_NAME DRAPE_STEPS_NAME

static const char columns[] = "attempt,t,h,accepted,status,reason,iterations,residual,tolerance,"
                              "kinetic,elastic,gravity,contact,dissipated,numerical,"
                              "worst_what,worst_term,worst_element,worst_nodes,worst_value,worst_limit,"
                              "error,left,events\n";

drape_status drape_steps_open(drape_context *ctx, drape_folder *folder, bool resumes, drape_file *file)
{
    return drape_csv_open(ctx, folder, FILE_NAME, columns, resumes, file);
}

static void put_energy(drape_file *file, const drape_energy *energy)
{
    drape_csv_put_number(file, energy->kinetic);
    drape_csv_put_number(file, energy->elastic);
    drape_csv_put_number(file, energy->gravity);
    drape_csv_put_number(file, energy->contact);
    drape_csv_put_number(file, energy->dissipated);
    drape_csv_put_number(file, energy->numerical);
}

static void put_nodes(drape_file *file, const int32_t node[4])
{
    drape_file_put_text(file, ",");
    for (int i = 0; i < 4 && node[i] >= 0; i++)
        drape_file_print(file, "%s%" PRId32, i ? " " : "", node[i]);
}

static void put_worst(drape_file *file, const drape_diagnostic *diagnostic)
{
    if (!diagnostic->what || !*diagnostic->what) {
        drape_file_put_text(file, ",,,,,,");
        return;
    }
    drape_csv_put_text(file, diagnostic->what);
    drape_csv_put_text(file, diagnostic->term);
    if (diagnostic->element >= 0)
        drape_csv_put_integer(file, diagnostic->element);
    else
        drape_file_put_text(file, ",");
    put_nodes(file, diagnostic->node);
    drape_csv_put_number(file, diagnostic->value);
    drape_csv_put_number(file, diagnostic->limit);
}

/* "heavy@0.12126511814700001;down@0.239389200361": the events that are reported after the attempt. */
static void put_events(drape_file *file, const drape_event_set *events)
{
    drape_file_put_text(file, ",");
    if (!events || events->reported >= events->pending_count)
        return;
    drape_file_put_text(file, "\"");
    for (int32_t i = events->reported; i < events->pending_count; i++) {
        const drape_pending_root *p = &events->pending[i];
        drape_file_put_text(file, i > events->reported ? ";" : "");
        for (const char *c = events->watches[p->event].event->name; *c; c++)
            drape_file_put_text(file, *c == '"' ? "\"\"" : (char[]){*c, 0});
        drape_file_print(file, "@%.17g", p->root.t);
    }
    drape_file_put_text(file, "\"");
}

drape_status drape_steps_write(drape_file *file, const drape_attempt *attempt, const drape_energy *energy,
                               const drape_event_set *events)
{
    drape_file_print(file, "%" PRId64, attempt->index);
    drape_csv_put_number(file, attempt->t);
    drape_csv_put_number(file, attempt->h);
    drape_csv_put_integer(file, attempt->accepted);
    drape_csv_put_text(file, drape_status_name(attempt->status));
    drape_csv_put_text(file, attempt->reason);
    drape_csv_put_integer(file, attempt->iterations);
    drape_csv_put_number(file, attempt->residual);
    drape_csv_put_number(file, attempt->tolerance);
    put_energy(file, energy);
    put_worst(file, &attempt->diagnostic);
    drape_csv_put_number(file, attempt->error);
    drape_csv_put_number(file, attempt->left);
    put_events(file, events);
    drape_file_put_text(file, "\n");
    return drape_file_keep(file);
}
