/* sheet.c: see sheet.h. */
#include "lab/sheet.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* ---- The text ---- */

const char *lab_sheet_format(char text[400], const char *format, ...)
{
    va_list values;
    va_start(values, format);
    vsnprintf(text, 400, format, values);
    va_end(values);
    return text;
}

__attribute__((format(printf, 2, 3))) static void put(char *text, const char *format, ...)
{
    const size_t used = strlen(text);
    va_list values;
    va_start(values, format);
    vsnprintf(text + used, DRAPE_LAB_TEXT - used, format, values);
    va_end(values);
}

/* Members of an object that has some already; NULL: there are none. */
static void put_others(char *text, const char *members)
{
    if (members)
        put(text, ", %s", members);
}

int lab_sheet_text(const lab_sheet *sheet, double value, char text[DRAPE_LAB_TEXT])
{
    lab_sheet varied = *sheet;
    const lab_sheet *s = &varied;
    value *= sheet->factor;
    if (sheet->varied)
        memcpy((char *)&varied + sheet->varied, &value, sizeof value);
    *text = 0;
    put(text, "{'drape': 1, 'cloth': [{'mesh': {'grid': '%s'", s->grid ? s->grid : "irregular");
    if (s->columns > 0)
        put(text, ", 'columns': %d, 'rows': %d", s->columns, s->rows);
    if (s->width > 0)
        put(text, ", 'width': %.17g", s->width);
    if (s->height > 0)
        put(text, ", 'height': %.17g", s->height);
    put_others(text, s->mesh);
    put(text, "},\n 'material': {");
    if (s->young_modulus > 0)
        put(text,
            "'young_modulus': %.17g, 'poisson_ratio': %.17g, 'thickness': %.17g, 'areal_density': %.17g",
            s->young_modulus, s->poisson_ratio, s->thickness, s->areal_density);
    if (s->material)
        put(text, "%s%s", s->young_modulus > 0 ? ", " : "", s->material);
    put(text, "},\n 'terms': [%s]", s->terms ? s->terms : "'stretch.cst', 'bend.midedge'");
    if (s->pins)
        put(text, ",\n 'pins': [%s]", s->pins);
    if (s->velocity)
        put(text, ", 'velocity': [%s]", s->velocity);
    put(text, "}],\n 'gravity': [%.17g, %.17g, %.17g], 'integrator': {%s", s->gravity[0], s->gravity[1],
        s->gravity[2], s->integrator ? s->integrator : "'method': 'static'");
    if (s->dt > 0)
        put(text, ", 'dt': %.17g", s->dt);
    if (s->tolerance > 0)
        put(text, ", 'tolerance': %.3g", s->tolerance);
    put(text, "}");
    put_others(text, s->others);
    put(text, ", 'duration': %.17g}", s->duration > 0 ? s->duration : 1);
    char before[DRAPE_LAB_TEXT];
    snprintf(before, sizeof before, "%s", text);
    *text = 0; /* then with the value in place of each @ */
    for (const char *at = before; *at; at += *at == '@') {
        const size_t length = strcspn(at, "@");
        put(text, "%.*s", (int)length, at);
        at += length;
        if (*at)
            put(text, "%.17g", value);
    }
    return (int)strlen(text);
}

/* ---- Positions and forces ---- */

drape_status lab_advance(drape_reference_run *run)
{
    return drape_sim_advance(run->sim, drape_model_duration(run->model));
}

void lab_tip(const drape_reference_run *run, double tip[3])
{
    const double *rest = drape_model_rest_positions(run->model), *x = drape_sim_positions(run->sim);
    const size_t nodes = (size_t)drape_model_node_count(run->model);
    double farthest = -INFINITY;
    int count = 0;
    for (size_t i = 0; i < nodes; i++)
        farthest = fmax(farthest, rest[3 * i]);
    tip[0] = tip[1] = tip[2] = 0;
    for (size_t i = 0; i < nodes; i++)
        if (rest[3 * i] >= farthest - 1e-9) {
            for (size_t k = 0; k < 3; k++)
                tip[k] += x[3 * i + k];
            count++;
        }
    for (int k = 0; k < 3; k++)
        tip[k] /= count;
}

double lab_rise(const drape_reference_run *run)
{
    double tip[3];
    lab_tip(run, tip);
    return tip[1];
}

double lab_sinking(const drape_reference_run *run)
{
    return -lab_rise(run);
}

double lab_chord(const drape_reference_run *run)
{
    double tip[3];
    lab_tip(run, tip);
    return atan2(-tip[1], tip[0]) * (180 / DRAPE_PI);
}

double lab_mean(const drape_reference_run *run, const double *values, size_t k)
{
    const size_t nodes = (size_t)drape_model_node_count(run->model);
    double sum = 0;
    for (size_t i = 0; i < nodes; i++)
        sum += values[3 * i + k];
    return sum / (double)nodes;
}

double lab_displacement(const drape_reference_run *run)
{
    const double *pair = run->reference->constants + 2 * run->index;
    const size_t at = 3 * (size_t)pair[0] + (size_t)fabs(pair[1]) - 1;
    const double moved = drape_sim_positions(run->sim)[at] - drape_model_rest_positions(run->model)[at];
    return pair[1] < 0 ? -moved : moved;
}

drape_status lab_pull(drape_reference_run *run, size_t k, double at, double force[3])
{
    const size_t nodes = (size_t)drape_model_node_count(run->model);
    const double *rest = drape_model_rest_positions(run->model);
    double *reactions = drape_arena_take(&run->arena, 3 * nodes, sizeof *reactions);
    const drape_status status = reactions ? drape_sim_reactions(run->sim, reactions) : DRAPE_E_MEMORY;
    memset(force, 0, 3 * sizeof *force);
    for (size_t i = 0; !status && i < nodes; i++)
        for (size_t c = 0; c < 3 && fabs(rest[3 * i + k] - at) < 1e-9; c++)
            force[c] += reactions[3 * i + c];
    return status;
}

/* ---- Equilibria and modes ---- */

drape_status lab_settle(drape_reference_run *run, const double *v)
{
    drape_sim_def def;
    drape_sim *sim = NULL;
    const double t = drape_sim_time(run->sim);
    drape_sim_def_init(&def, sizeof def);
    def.integrator = "static";
    drape_status status = drape_sim_create(run->ctx, run->model, &def, &sim);
    if (!status)
        status = drape_sim_set_state(sim, t, drape_sim_positions(run->sim), drape_sim_velocities(run->sim));
    if (!status)
        status = drape_sim_advance(sim, t + 1);
    if (!status)
        status = drape_sim_set_state(run->sim, t, drape_sim_positions(sim), v);
    drape_sim_destroy(&sim);
    return status;
}

drape_status lab_unstable_modes(drape_reference_run *run, double *value)
{
    drape_status status = lab_advance(run);
    const drape_statistics statistics = drape_sim_statistics(run->sim);
    *value = (double)statistics.unstable_modes;
    if (!status && !statistics.stability_known)
        return drape_fail(run->ctx, DRAPE_E_SOLVER, "the signs of the eigenvalues are not known");
    return status;
}

drape_status lab_omega(drape_reference_run *run, double *value)
{
    const double *constants = run->reference->constants;
    int number = (int)run->parameter;
    drape_modes_def def;
    drape_modes modes = {0};
    drape_modes_def_init(&def, sizeof def);
    def.count = (int32_t)constants[1];
    drape_status status = lab_advance(run);
    if (!status)
        status = drape_sim_modes(run->sim, &def, &modes);
    *value = NAN;
    for (const drape_mode *mode = modes.modes; mode < modes.modes + modes.count && number > 0; mode++) {
        /* Its share in the motion of the whole scene along axis k: (sum m u_k)^2/(sum m u^2 sum m). A mode
         * that twists a strip, or bends it in its plane, has none. */
        const double *mass = drape_model_masses(run->model);
        double sum = 0, all = 0;
        for (size_t i = 0; constants[0] && i < (size_t)drape_model_node_count(run->model); i++) {
            sum += mass[i] * mode->shape[3 * i + (size_t)constants[0] - 1];
            all += mass[i];
        }
        if (constants[0] && !(sum * sum / (mode->mass * all) > 1e-3))
            continue;
        number--;
        *value = number == 0 ? constants[2] * sqrt(mode->value) : NAN;
    }
    drape_modes_free(&modes);
    return status;
}
