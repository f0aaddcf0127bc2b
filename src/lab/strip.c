/* strip.c: see strip.h. */
#include "lab/strip.h"

#include <gsl/gsl_multifit.h>
#include <math.h>
#include <stdio.h>

int strip_scene(const strip *s, char *text, size_t size)
{
    const double h = s->thickness, modulus = 12 * STRIP_RIGIDITY / (h * h * h);
    return snprintf(text, size,
                    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': %d, 'rows': %d, "
                    "'width': 1, 'height': %.17g, "
                    "'orientation': '%s'},\n 'material': {'young_modulus': %.17g, 'poisson_ratio': %.17g, "
                    "'thickness': %.17g, "
                    "'areal_density': %.17g},\n 'terms': ['stretch.cst', %s%s],\n 'pins': [{'edge': 'left', "
                    "'clamp': true}]}],\n"
                    " 'gravity': [%.17g, %.17g, %.17g], 'integrator': {'method': 'static', 'tolerance': "
                    "%.3g}, 'duration': 1}",
                    s->columns, s->rows, s->width, s->orientation ? s->orientation : "horizontal", modulus,
                    s->poisson, h, STRIP_DENSITY, s->bend ? s->bend : "'bend.midedge'",
                    s->terms ? s->terms : "", s->gravity[0], s->gravity[1], s->gravity[2], s->tolerance);
}

double strip_gravity(double weight)
{
    return weight * STRIP_RIGIDITY / STRIP_DENSITY;
}

drape_status lab_advance(drape_reference_run *run)
{
    return drape_sim_advance(run->sim, drape_model_duration(run->model));
}

drape_status lab_settle(drape_reference_run *run, double *x)
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
    for (size_t i = 0; !status && i < 3 * (size_t)drape_model_node_count(run->model); i++)
        x[i] = drape_sim_positions(sim)[i];
    drape_sim_destroy(&sim);
    return status;
}

void lab_tip(const drape_reference_run *run, double tip[3])
{
    const double *rest = drape_model_rest_positions(run->model), *x = drape_sim_positions(run->sim);
    const int32_t nodes = drape_model_node_count(run->model);
    double farthest = -INFINITY;
    int count = 0;
    for (int32_t i = 0; i < nodes; i++)
        farthest = fmax(farthest, rest[3 * (size_t)i]);
    tip[0] = tip[1] = tip[2] = 0;
    for (int32_t i = 0; i < nodes; i++)
        if (rest[3 * (size_t)i] >= farthest - 1e-9) {
            for (int k = 0; k < 3; k++)
                tip[k] += x[3 * (size_t)i + (size_t)k];
            count++;
        }
    for (int k = 0; k < 3; k++)
        tip[k] /= count;
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

/* The distance within which a dozen nodes lie, give or take: the mean area of a node is that of the sheet
 * over them. */
static double neighbourhood(const drape_reference_run *run)
{
    const double *rest = drape_model_rest_positions(run->model);
    const int32_t nodes = drape_model_node_count(run->model);
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int32_t i = 0; i < nodes; i++)
        for (int k = 0; k < 2; k++) {
            low[k] = fmin(low[k], rest[3 * (size_t)i + 2 * (size_t)k]);
            high[k] = fmax(high[k], rest[3 * (size_t)i + 2 * (size_t)k]);
        }
    return 2 * sqrt((high[0] - low[0]) * (high[1] - low[1]) / nodes);
}

double lab_deflection(const drape_reference_run *run, double x, double z)
{
    enum { MOST = 64, TERMS = 6 };
    const double *rest = drape_model_rest_positions(run->model), *at = drape_sim_positions(run->sim);
    const double near = neighbourhood(run);
    size_t found[MOST], count = 0;
    for (int32_t i = 0; i < drape_model_node_count(run->model) && count < MOST; i++)
        if (hypot(rest[3 * (size_t)i] - x, rest[3 * (size_t)i + 2] - z) < near)
            found[count++] = (size_t)i;
    double value = NAN;
    gsl_matrix *powers = count < TERMS ? NULL : gsl_matrix_alloc(count, TERMS),
               *covariance = gsl_matrix_alloc(TERMS, TERMS);
    gsl_vector *y = count < TERMS ? NULL : gsl_vector_alloc(count), *fit = gsl_vector_alloc(TERMS);
    gsl_multifit_linear_workspace *work = count < TERMS ? NULL : gsl_multifit_linear_alloc(count, TERMS);
    for (size_t i = 0; powers && y && i < count; i++) {
        const double u = rest[3 * found[i]] - x, w = rest[3 * found[i] + 2] - z;
        const double row[TERMS] = {1, u, w, u * u, u * w, w * w};
        for (size_t k = 0; k < TERMS; k++)
            gsl_matrix_set(powers, i, k, row[k]);
        gsl_vector_set(y, i, -at[3 * found[i] + 1]);
    }
    double rest_of_squares;
    if (powers && y && fit && covariance && work &&
        gsl_multifit_linear(powers, y, fit, covariance, &rest_of_squares, work) == 0)
        value = gsl_vector_get(fit, 0);
    gsl_multifit_linear_free(work);
    gsl_vector_free(fit);
    gsl_vector_free(y);
    gsl_matrix_free(covariance);
    gsl_matrix_free(powers);
    return value;
}
