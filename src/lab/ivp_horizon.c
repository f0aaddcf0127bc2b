/*
 * ivp_horizon.c: how fast a small perturbation of the start grows. The method is explicit where it solves
 * the equations of the scene at bearable cost, because its steps are a smooth function of the state: there
 * is no iteration whose remainder would be taken for growth. Else it is trbdf2, solved to rounding.
 */
#include "lab/ivp.h"
#include "lab/lab.h"

#include <math.h>

#define PERTURBATION 1e-10 /* of the size */
#define LIMIT        1e4   /* growth that ends the horizon */
#define DIRECTIONS   3     /* random perturbations, of which the one that grows most counts */
#define BEYOND       2     /* times the duration that is measured */
#define SAMPLES      60
#define STEPS        32    /* in an interval, of the implicit method */
#define MOST_STEPS   40000 /* of the explicit method */

/* x + an offset of the free nodes, whose root mean square is PERTURBATION. */
static void perturb(const lab_ivp *s, int direction, double *x)
{
    const uint8_t *pinned = drape_model_pinned(s->model);
    const int32_t count = drape_model_node_count(s->model);
    double squares = 0;
    int32_t nodes = 0;
    for (int pass = 0; pass < 2; pass++) {
        uint64_t seed = (uint64_t)direction << 32;
        const double scale = pass ? PERTURBATION * s->size / sqrt(squares / nodes) : 0;
        for (int32_t i = 0; i < count; i++) {
            nodes += !pass && !pinned[i];
            for (size_t k = 0; k < 3; k++) {
                /* SplitMix64 (Steele, Lea, Flood 2014), as a number in [-1, 1). */
                uint64_t z = seed += UINT64_C(0x9e3779b97f4a7c15);
                z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
                z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
                const double d = ldexp((double)((z ^ z >> 31) >> 11), -52) - 1;
                squares += pinned[i] || pass ? 0 : d * d;
                x[3 * (size_t)i + k] += pinned[i] ? 0 : scale * d;
            }
        }
    }
}

/* The motion from the start, perturbed in a direction or, 0, not. */
static drape_status start(const lab_ivp *s, const drape_model *model, int direction, double *x,
                          drape_sim **sim)
{
    const size_t size = 3 * (size_t)drape_model_node_count(model);
    drape_status status = drape_sim_create(s->arena->ctx, model, NULL, sim);
    if (status)
        return status;
    for (size_t i = 0; i < size; i++)
        x[i] = drape_sim_positions(*sim)[i];
    if (direction)
        perturb(s, direction, x);
    return drape_sim_set_state(*sim, 0, x, drape_sim_velocities(*sim));
}

/* Growth at each sample, the largest of the directions. Returns how many samples all runs reached. */
static drape_status measure(const lab_ivp *s, const drape_model *model, const double *t, double *growth,
                            size_t *reached)
{
    const size_t size = 3 * (size_t)drape_model_node_count(model);
    double *x = drape_arena_take(s->arena, size, sizeof *x);
    drape_sim *sims[DIRECTIONS + 1] = {NULL};
    drape_status status = x ? DRAPE_OK : DRAPE_E_MEMORY;
    for (int d = 0; !status && d <= DIRECTIONS; d++)
        status = start(s, model, d, x, &sims[d]);
    bool running = !status;
    for (*reached = 0; running && *reached < SAMPLES; *reached += running) {
        for (int d = 0; running && d <= DIRECTIONS; d++) {
            if (s->cancel && s->cancel(NULL))
                status = drape_fail(s->arena->ctx, DRAPE_E_STOPPED, "interrupted");
            running = !status && !drape_sim_advance(sims[d], t[*reached]);
            if (running && d)
                growth[*reached] = fmax(growth[*reached], lab_distance(model, drape_sim_positions(sims[0]),
                                                                       drape_sim_positions(sims[d])) /
                                                              (PERTURBATION * s->size));
        }
    }
    for (int d = 0; d <= DIRECTIONS; d++)
        drape_sim_destroy(&sims[d]);
    return status;
}

/* The method that measures, with steps that are the same in all runs. */
static drape_status choose_method(const lab_ivp *s, json_t **settings)
{
    const drape_integrator_ops *verlet = lab_find_integrator("verlet");
    double dt = s->interval / STEPS;
    drape_status status = lab_ivp_admits(s, verlet) ? lab_ivp_dt(s, verlet, STEPS, &dt) : DRAPE_OK;
    const bool is_explicit =
        lab_ivp_admits(s, verlet) && BEYOND * drape_model_duration(s->model) < MOST_STEPS * dt;
    *settings = json_pack("{s:s, s:f}", "/integrator/method", is_explicit ? "verlet" : "trbdf2",
                          "/integrator/dt", is_explicit ? dt : s->interval / STEPS);
    if (is_explicit)
        json_object_set_new(*settings, "/integrator/substeps", json_integer(1));
    else
        json_object_set_new(*settings, "/integrator/tolerance", json_real(lab_ivp_least_tolerance(s)));
    return status;
}

/* The last time before the growth passes the limit; INFINITY: it does not. */
static double find_horizon(const double *t, const double *growth, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (!(growth[i] < LIMIT))
            return i ? t[i - 1] : 0;
    return INFINITY;
}

drape_status lab_ivp_horizon(const lab_ivp *s, bool *within, FILE *out)
{
    double t[SAMPLES], growth[SAMPLES] = {0}, largest = 0;
    const double duration = drape_model_duration(s->model);
    size_t count = 0;
    drape_model *model = NULL;
    json_t *settings;
    drape_status status = choose_method(s, &settings);
    for (int i = 0; i < SAMPLES; i++)
        t[i] = BEYOND * duration * (i + 1) / SAMPLES;
    if (!status)
        status = lab_ivp_load(s, settings, &model);
    if (!status)
        status = measure(s, model, t, growth, &count);
    for (size_t i = 0; i < count && t[i] <= duration * (1 + 1e-9); i++)
        largest = fmax(largest, growth[i]);
    const double horizon = find_horizon(t, growth, count);
    *within =
        !status && count > 0 && t[count - 1] >= duration * (1 - 1e-9) && horizon >= duration * (1 - 1e-9);
    if (!status) {
        const char *path = lab_ivp_file(s, "horizons", "json");
        json_t *about = lab_ivp_provenance(s);
        about = drape_json_with(about, "settings", json_deep_copy(settings));
        about = drape_json_with(about, "perturbation", json_real(PERTURBATION));
        about = drape_json_with(about, "limit", json_real(LIMIT));
        about = drape_json_with(about, "horizon_s", drape_json_number(horizon)); /* null: beyond t_s */
        about = drape_json_with(about, "t_s", drape_json_numbers(t, count));
        about = drape_json_with(about, "growth", drape_json_numbers(growth, count));
        status = path ? lab_ivp_write_json(s, path, about) : DRAPE_E_MEMORY;
        json_decref(about);
    }
    if (!status && isfinite(horizon))
        fprintf(out, "horizon   %.4g s: a perturbation of %.0e of the size grows %.0e-fold\n", horizon,
                PERTURBATION, LIMIT);
    else if (!status)
        fprintf(out,
                "horizon   beyond %.4g s: a perturbation of %.0e of the size grows less than %.0e-fold\n",
                count ? t[count - 1] : 0, PERTURBATION, LIMIT);
    if (!status)
        fprintf(out, "duration  %.4g s: within it, the perturbation grows %.3g-fold\n", duration, largest);
    json_decref(settings);
    drape_model_destroy(&model);
    return status;
}
