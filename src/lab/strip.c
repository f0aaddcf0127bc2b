/* strip.c: see strip.h. */
#include "lab/strip.h"

#include <math.h>
#include <stdio.h>

int strip_scene(const strip *s, char text[DRAPE_LAB_TEXT])
{
    const double h = s->thickness, modulus = 12 * STRIP_RIGIDITY / (h * h * h);
    return snprintf(
        text, DRAPE_LAB_TEXT,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': %d, 'rows': %d, 'width': 1, "
        "'height': %.17g, 'orientation': '%s'},\n "
        "'material': {'young_modulus': %.17g, 'poisson_ratio': %.17g, 'thickness': %.17g, "
        "'areal_density': %.17g},\n "
        "'terms': ['stretch.cst', %s],\n 'pins': [{'edge': 'left', 'clamp': true}]}],\n "
        "'gravity': [%.17g, %.17g, %.17g], 'integrator': {'method': 'static', 'tolerance': %.3g}, "
        "'duration': 1}",
        s->columns, s->rows, s->width, s->upright ? "vertical" : "horizontal", modulus, s->poisson, h,
        STRIP_DENSITY, s->terms ? s->terms : "'bend.midedge'", s->gravity[0], s->gravity[1], s->gravity[2],
        s->tolerance);
}

double strip_gravity(double weight)
{
    return weight * STRIP_RIGIDITY / STRIP_DENSITY;
}

drape_status lab_advance(drape_reference_run *run)
{
    return drape_sim_advance(run->sim, drape_model_duration(run->model));
}

drape_status lab_tip(drape_reference_run *run, double tip[3])
{
    drape_status status = lab_advance(run);
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
    return status;
}

drape_status lab_sinking(drape_reference_run *run, double *value)
{
    double tip[3];
    drape_status status = lab_tip(run, tip);
    *value = -tip[1];
    return status;
}

drape_status lab_chord(drape_reference_run *run, double *value)
{
    double tip[3];
    drape_status status = lab_tip(run, tip);
    *value = atan2(-tip[1], tip[0]) * (180 / 3.14159265358979323846);
    return status;
}

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
