/*
 * ivp_reference.c: the reference of a scene. Each family of methods is refined until it changes no more, or
 * its time is used up; of those of fixed steps the results of successive dt are extrapolated to dt = 0
 * (Richardson 1911; Hairer, Norsett & Wanner 1993, II.9). The reference is that of the family with the
 * smallest change at its last refinement, and its error the distance to the nearest result of another
 * family.
 */
#include "base/clock.h"

#include "base/hash.h"
#include "io/npy.h"
#include "lab/ivp.h"
#include "lab/lab.h"

#include <math.h>
#include <string.h>

#define MAX_LEVELS   10
#define ENOUGH       1e-2 /* of the goal: no further refinement */
#define GROWTH       1.7  /* expected cost of a level over that of the one before, at least */
#define SMOOTH_GOAL  1e-8 /* of the size: families agree to this, */
#define CONTACT_GOAL 1e-5 /* or with contact to this */
#define COARSEST     8    /* steps in an interval at the first level of fixed steps */

/* Methods that have nothing in common but the equations: of different names. A method that the build does not
 * have is left out. */
typedef struct family {
    const char *name, *method;
    double rtol, ratio; /* the first and how it falls; methods of fixed steps: 0, and dt is halved */
    const char *also;   /* a parameter of the method that is set; NULL: none */
    int also_value;
    int stride; /* of the exponents of dt in the error: 2 for a symmetric method */
} family;

static const family families[] = {
    {"Radau", "radau", 1e-6, 0.1, NULL, 0, 1},      {"BDF", "ida", 1e-8, 0.1, "max_order", 5, 1},
    {"SDIRK", "dirk", 1e-6, 0.1, "order", 5, 1},    {"SDIRK", "trbdf2", 0, 0.5, NULL, 0, 1},
    {"Verlet", "verlet", 0, 0.5, "substeps", 1, 2},
};
#define FAMILIES ((int)(sizeof families / sizeof *families))

/* What a family reached. */
typedef struct attempt {
    const family *family;
    lab_trace columns[MAX_LEVELS]; /* of the last level: extrapolated so many times */
    lab_trace best;
    int count, column;   /* levels; the column that is best */
    double knob, change; /* of the last level; the change of best at it, relative to the size */
    double spent;        /* [s] CPU */
    char ended_by[160];
} attempt;

/* ---- Levels ---- */

static json_t *settings_of(const lab_ivp *s, const family *f, double knob)
{
    const drape_entry *entry = &lab_find_integrator(f->method)->entry;
    char pointer[64];
    json_t *settings = json_pack("{s:s, s:f}", "/integrator/method", f->method,
                                 f->rtol > 0 ? "/integrator/rtol" : "/integrator/dt", knob);
    snprintf(pointer, sizeof pointer, "/integrator/%s", f->also ? f->also : "");
    if (f->also && lab_has_param(entry, f->also))
        json_object_set_new(settings, pointer, json_integer(f->also_value));
    if (lab_has_param(entry, "tolerance"))
        json_object_set_new(settings, "/integrator/tolerance", json_real(lab_ivp_least_tolerance(s)));
    return settings;
}

/* Row i of the table of Neville and Aitken from row i - 1, which it replaces: column k + 1 removes the error
 * of the exponent order + k stride. Sets which column changed the least, and by how much. */
static drape_status extrapolate(const lab_ivp *s, attempt *a, lab_trace next)
{
    const int order = lab_find_integrator(a->family->method)->order;
    const int last = a->family->rtol > 0 ? 0 : a->count; /* own steps: nothing is extrapolated */
    const size_t size = next.size * (size_t)next.frames;
    a->change = INFINITY;
    for (int k = 0; k <= last; k++) {
        lab_trace before = a->columns[k];
        const double change = before.frames ? lab_ivp_distance(s, &next, &before) : INFINITY;
        a->columns[k] = next;
        if (change < a->change) {
            a->change = change;
            a->column = k;
        }
        if (k == last || k + 1 == MAX_LEVELS) {
            drape_arena_release(s->arena, before.x);
            break;
        }
        drape_status status = lab_trace_create(s->arena, next.size, next.frames, &next);
        if (status)
            return status;
        next.frames = next.room;
        const double divisor = pow(2, order + k * a->family->stride) - 1;
        for (size_t i = 0; i < size; i++)
            next.x[i] = a->columns[k].x[i] + (a->columns[k].x[i] - before.x[i]) / divisor;
        drape_arena_release(s->arena, before.x);
    }
    a->best = a->columns[a->column];
    return DRAPE_OK;
}

/* The distance to the nearest result of a family of another name. */
static double disagreement(const lab_ivp *s, const attempt *attempts, int count, const attempt *best)
{
    double least = INFINITY;
    for (int i = 0; best && i < count; i++)
        if (attempts[i].count > 1 && strcmp(attempts[i].family->name, best->family->name) != 0)
            least = fmin(least, lab_ivp_distance(s, &attempts[i].best, &best->best));
    return least;
}

static double goal_of(const lab_ivp *s)
{
    return s->contact ? CONTACT_GOAL : SMOOTH_GOAL;
}

/* Refines the last of the attempts until it changes no more, agrees with an earlier one of another family, or
 * its next level, which is expected to take GROWTH times the last one, would exceed its time. */
static drape_status refine(const lab_ivp *s, double seconds, const attempt *attempts, attempt *a)
{
    const int before = (int)(a - attempts);
    double took = 0;
    const family *f = a->family;
    drape_status status = DRAPE_OK;
    const double start = drape_clock_thread_seconds();
    double knob = f->rtol;
    if (!(knob > 0))
        status = lab_ivp_dt(s, lab_find_integrator(f->method), COARSEST, &knob);
    a->change = INFINITY;
    for (; !status && !*a->ended_by && a->count < MAX_LEVELS; knob *= f->ratio) {
        json_t *result = NULL;
        lab_trace trace;
        if (a->change < ENOUGH * goal_of(s) ||
            (a->count > 1 && disagreement(s, attempts, before, a) < ENOUGH * goal_of(s)))
            break;
        if (f->rtol > 0 && knob < 0.99e-12)
            break; /* the least that parameters allow */
        if (GROWTH * took > seconds - a->spent) {
            snprintf(a->ended_by, sizeof a->ended_by, "the next level would take too long");
            break;
        }
        status = lab_ivp_run(s, settings_of(s, f, knob), seconds - a->spent, &trace, &result);
        took = drape_clock_thread_seconds() - start - a->spent;
        a->spent += took;
        if (!status && trace.frames) {
            status = extrapolate(s, a, trace);
            a->knob = knob;
            a->count++;
        } else if (!status)
            snprintf(a->ended_by, sizeof a->ended_by, "%s", lab_text(result, "message"));
        json_decref(result);
    }
    return status;
}

/* ---- The choice ---- */

static drape_status store(const lab_ivp *s, const attempt *attempts, int count, const attempt *best,
                          double error)
{
    char header[DRAPE_NPY_HEADER], digits[17];
    const size_t size = best->best.size * (size_t)best->best.frames * sizeof(double);
    const char *data = lab_ivp_file(s, "references", "npy"), *path = lab_ivp_file(s, "references", "json");
    if (!data || !path)
        return DRAPE_E_MEMORY;
    drape_npy_put_header(best->best.frames, drape_model_node_count(s->model), header);
    const uint64_t hash = drape_hash_bytes(DRAPE_HASH_START, header, sizeof header);
    lab_digits(drape_hash_bytes(hash, best->best.x, size), digits);
    json_t *about = lab_ivp_provenance(s);
    about = drape_json_with(about, "times_s", drape_json_numbers(s->times, s->time_count));
    about = drape_json_with(about, "error", json_real(error));
    about = drape_json_with(about, "method", json_string(best->family->method));
    about = drape_json_with(about, "data_hash", json_string(digits));
    json_t *methods = json_array();
    for (int i = 0; i < count; i++) {
        const attempt *a = &attempts[i];
        methods = drape_json_append(
            methods,
            json_pack("{s:s, s:s, s:s, s:f, s:i, s:i, s:o, s:o}", "family", a->family->name, "method",
                      a->family->method, "knob", a->family->rtol > 0 ? "rtol" : "dt_s", "value", a->knob,
                      "levels", a->count, "extrapolated", a->column, "change", drape_json_number(a->change),
                      "distance",
                      drape_json_number(a->count ? lab_ivp_distance(s, &a->best, &best->best) : NAN)));
    }
    about = drape_json_with(about, "methods", methods);
    drape_status status = lab_ivp_write(s, data, header, sizeof header, best->best.x, size);
    if (!status)
        status = lab_ivp_write_json(s, path, about);
    json_decref(about);
    return status;
}

drape_status lab_ivp_reference(lab_ivp *s, double seconds, bool check, FILE *out)
{
    attempt attempts[FAMILIES];
    int count = 0;
    bool agreed = false;
    drape_status status = DRAPE_OK;
    memset(attempts, 0, sizeof attempts);
    for (int i = 0; !status && i < FAMILIES && !agreed; i++) {
        const drape_integrator_ops *integrator = lab_find_integrator(families[i].method);
        attempt *a = &attempts[count];
        if (!integrator || !lab_ivp_admits(s, integrator))
            continue;
        a->family = &families[i];
        status = refine(s, seconds, attempts, a);
        agreed = !status && a->count > 1 && disagreement(s, attempts, count, a) < ENOUGH * goal_of(s);
        count++;
        if (!status)
            fprintf(out,
                    "%-9s %d levels to %s %.3g, extrapolated %d times: the last changed it by %.2g of the "
                    "size; %.3g s%s%s\n",
                    a->family->method, a->count, a->family->rtol > 0 ? "rtol" : "dt", a->knob, a->column,
                    a->change, a->spent, *a->ended_by ? "; ended by: " : "", a->ended_by);
    }
    if (status)
        return status;
    const attempt *best = NULL;
    for (int i = 0; i < count; i++)
        if (attempts[i].count > 1 && (!best || attempts[i].change < best->change))
            best = &attempts[i];
    const double error = disagreement(s, attempts, count, best), goal = goal_of(s);
    if (!isfinite(error))
        return drape_fail(s->arena->ctx, DRAPE_E_SOLVER,
                          "%.300s: no reference: no two families of methods completed two levels; more CPU "
                          "seconds help",
                          s->path);
    if (!(error <= goal))
        return drape_fail(
            s->arena->ctx, DRAPE_E_SOLVER,
            "%.300s: no reference: its families of methods agree to %.2g of the size; they must to %.0e",
            s->path, error, goal);
    fprintf(out, "reference %s, agrees with another family to %.2g of the size\n", best->family->method,
            error);
    if (!check)
        return store(s, attempts, count, best, error);
    status = lab_ivp_read_reference(s);
    if (status)
        return status;
    const double distance = lab_ivp_distance(s, &s->reference, &best->best), allowed = s->error + error;
    fprintf(out, "stored    differs by %.2g of the size; its error is %.2g\n", distance, s->error);
    return distance <= allowed
               ? DRAPE_OK
               : drape_fail(s->arena->ctx, DRAPE_E_SOLVER,
                            "%.300s: the stored reference differs by %.2g of the size from the "
                            "one computed now; both errors together are %.2g",
                            s->path, distance, allowed);
}

/* ---- How fast a small perturbation of the start grows ----
 *
 * The method is explicit where it solves the equations of the scene at bearable cost, because its steps are a smooth
 * function of the state: there is no iteration whose remainder would be taken for growth. Else it is trbdf2, solved
 * to rounding. */

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

/* Growth at each sample, the largest of the directions. Returns how many samples all runs reached. */
static drape_status measure(const lab_ivp *s, const drape_model *model, const double *t, double *growth,
                            size_t *reached)
{
    const size_t size = 3 * (size_t)drape_model_node_count(model);
    double *x = drape_arena_take(s->arena, size, sizeof *x);
    drape_sim *sims[DIRECTIONS + 1] = {NULL};
    drape_status status = x ? DRAPE_OK : DRAPE_E_MEMORY;
    for (int d = 0; !status && d <= DIRECTIONS; d++) { /* the first one is not perturbed */
        status = drape_sim_create(s->arena->ctx, model, NULL, &sims[d]);
        if (status)
            break;
        memcpy(x, drape_sim_positions(sims[d]), size * sizeof *x);
        if (d)
            perturb(s, d, x);
        status = drape_sim_set_state(sims[d], 0, x, drape_sim_velocities(sims[d]));
    }
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

drape_status lab_ivp_horizon(const lab_ivp *s, bool *within, FILE *out)
{
    double t[SAMPLES], growth[SAMPLES] = {0}, largest = 0, horizon = INFINITY;
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
    for (size_t i = count; i-- > 0;)
        if (!(growth[i] < LIMIT)) /* the last time before the growth passes the limit */
            horizon = i ? t[i - 1] : 0;
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
