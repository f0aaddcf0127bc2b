/*
 * csv.c: see csv.h. A row is written by one system call, so that a killed run leaves whole rows. If an
 * attempt has no diagnostic, the worst_ fields are empty; worst_element is empty for a node.
 *
 * The energies of interpolated positions would be wrong: stretching is so stiff that an interpolation error
 * too small to be seen can have as much energy as the motion itself, and interpolated positions have no
 * consistent velocities. So a row of a frame contains the energies of an accepted state, and its time.
 */
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

void drape_csv_put_numbers(drape_file *file, size_t count, const double *values)
{
    for (size_t i = 0; i < count; i++)
        drape_csv_put_number(file, values[i]);
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

/* ---- The tables of a run ---- */

const char drape_steps_columns[] = "attempt,t,h,accepted,status,reason,iterations,residual,tolerance,"
                                   "kinetic,elastic,gravity,contact,dissipated,numerical,"
                                   "worst_what,worst_term,worst_element,worst_nodes,worst_value,worst_limit,"
                                   "error,left,events\n";
const char drape_energy_columns[] =
    "frame,t,t_state,kinetic,elastic,gravity,contact,dissipated,numerical,total,work";

static void put_energy(drape_file *file, const drape_energy *energy)
{
    const double parts[] = {energy->kinetic, energy->elastic,    energy->gravity,
                            energy->contact, energy->dissipated, energy->numerical};
    drape_csv_put_numbers(file, 6, parts);
}

drape_status drape_steps_write(drape_file *file, const drape_attempt *attempt, const drape_energy *energy,
                               const drape_event_set *events)
{
    const drape_diagnostic *worst = &attempt->diagnostic;
    const char *what = worst->what;
    drape_file_print(file, "%" PRId64, attempt->index);
    drape_csv_put_numbers(file, 2, (double[]){attempt->t, attempt->h});
    drape_csv_put_integer(file, attempt->accepted);
    drape_csv_put_text(file, drape_status_name(attempt->status));
    drape_csv_put_text(file, attempt->reason);
    drape_csv_put_integer(file, attempt->iterations);
    drape_csv_put_numbers(file, 2, (double[]){attempt->residual, attempt->tolerance});
    put_energy(file, energy);
    if (what && *what) {
        drape_csv_put_text(file, what);
        drape_csv_put_text(file, worst->term);
        if (worst->element >= 0)
            drape_csv_put_integer(file, worst->element);
        else
            drape_file_put_text(file, ",");
        drape_file_put_text(file, ",");
        for (int i = 0; i < 4 && worst->node[i] >= 0; i++)
            drape_file_print(file, "%s%" PRId32, i ? " " : "", worst->node[i]);
        drape_csv_put_numbers(file, 2, (double[]){worst->value, worst->limit});
    } else {
        drape_file_put_text(file, ",,,,,,");
    }
    drape_csv_put_numbers(file, 2, (double[]){attempt->error, attempt->left});
    /* "heavy@0.12126511814700001;down@0.239389200361": the events that are reported after the attempt */
    const int32_t first = events ? events->reported : 0, end = events ? events->pending_count : 0;
    drape_file_put_text(file, first < end ? ",\"" : ",");
    for (int32_t i = first; i < end; i++) {
        const drape_pending_root *p = &events->pending[i];
        drape_file_put_text(file, i > first ? ";" : "");
        drape_csv_put_quoted(file, events->watches[p->event].event->name);
        drape_file_print(file, "@%.17g", p->root.t);
    }
    drape_file_put_text(file, first < end ? "\"\n" : "\n");
    return drape_file_keep(file);
}

drape_status drape_energy_write(drape_file *file, int64_t frame, double t, double t_state,
                                const drape_energy *energy, drape_sim *sim)
{
    double work, sum = 0;
    for (int i = 0; drape_sim_work(sim, i, &work); i++)
        sum += work;
    drape_file_print(file, "%" PRId64, frame);
    drape_csv_put_numbers(file, 2, (double[]){t, t_state});
    put_energy(file, energy);
    drape_csv_put_number(file, energy->kinetic + energy->elastic + energy->gravity + energy->contact);
    drape_csv_put_number(file, sum);
    for (int i = 0; drape_sim_work(sim, i, &work); i++)
        drape_csv_put_number(file, work);
    drape_file_put_text(file, "\n");
    return drape_file_keep(file);
}
