/*
 * test_checkpoint.c: a sim that is saved, and another one that is restored from the checkpoint and
 * continued, have the same bits as a sim that was never interrupted: for all integrators, Newton variants,
 * linear solvers and controllers, in scenes with everything that is kept from step to step.
 */
#include <inttypes.h>

#include "solvers/linear.h"
#include "support/bytes.h"
#include "support/sample.h"
#include "support/scene.h"

#define MIDDLE 0.08 /* [s] time of the checkpoint */
#define END    0.16

/* ---- Scenes ---- */

/* A sheet on a moving pin, with all kinds of terms. */
#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': %d, 'edge_length': 0.05},"             \
    " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"                                \
    " 'terms': ['stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 1e-3},"                  \
    " {'type': 'drag.viscous', 'coefficient': 0.05}%s],"                                                     \
    " 'pins': [{'corner': 'top-left'},"                                                                      \
    " {'corner': 'top-right', 'track': [[0, [0,0,0]], [0.05, [0,0.02,0]], [0.12, [-0.05,0,0]]]}]}],"         \
    " %s 'integrator': {'method': '%s', 'dt': 0.01%s}, 'controller': {'type': '%s'},"                        \
    " 'duration': 1, 'frame_rate': 330}"

/* A sheet that falls on a moving sphere, and on itself where it is folded over. */
#define OBSTACLES                                                                                            \
    "'colliders': [{'type': 'sphere', 'center': [0.1,-0.1,-0.08], 'radius': 0.07, 'friction': 0.3,"          \
    " 'track': [[0, [0,0,0]], [0.2, [0.02,0.03,0]]]},"                                                       \
    " {'type': 'box', 'center': [0.2,-0.1,-0.05], 'size': [0.08,0.08,0.08], 'friction': 0.2}],"              \
    " 'self_contact': {'thickness': 0.004, 'friction': 0.2}, "

/* Two sheets, the upper one falling on the lower one: contact between nodes that the pattern of the matrix
 * does not couple at the start. */
#define LAYERS                                                                                               \
    "{'drape': 1, 'cloth': [{'name': 'low', 'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'width': "   \
    "0.2,"                                                                                                   \
    " 'height': 0.2}, 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"                \
    " 'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'edge': 'left'}, {'edge': 'right'}]},"              \
    " {'name': 'high', 'mesh': {'grid': 'square', 'columns': 4, 'rows': 4, 'width': 0.13, 'height': 0.13,"   \
    " 'transform': {'translate': [0.03,0.03,-0.03]}},"                                                       \
    " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"                                \
    " 'terms': ['stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 1e-3}],"                 \
    " 'velocity': [0.1, 0, 0.1]}],"                                                                          \
    " 'self_contact': {'thickness': 0.004, 'friction': 0.3}, 'contact': {'friction': 'lagged'},"             \
    " 'integrator': {'method': '%s', 'dt': 0.01%s}, 'controller': {'type': '%s'}, 'duration': 1,"            \
    " 'frame_rate': 330}"

/* A sheet that is compressed and buckles: indefinite matrices, whose modification depends on the previous
 * one. */
#define BUCKLING                                                                                             \
    "{'drape': 1, 'cloth': [{'name': 'sheet', 'mesh': {'grid': 'square', 'columns': 8, 'rows': 5, 'width': " \
    "0.4,"                                                                                                   \
    " 'height': 0.2}, 'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'density': 200},"                \
    " 'terms': ['stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 1e-4}],"                 \
    " 'pins': [{'edge': 'left'}, {'edge': 'right', 'track': [[0, [0,0,0]], [0.16, [-0.1,0,0]]]}]}],"         \
    " 'integrator': {'method': '%s', 'dt': 0.01, 'linear_solver': '%s'}, 'controller': {'type': 'halving'}," \
    " 'duration': 1, 'frame_rate': 330}"

/* ---- What is compared ---- */

typedef struct watcher {
    uint64_t frames, attempts; /* hashes of all frames and attempts that were reported */
    int64_t save_at;           /* number of a frame; -1: none */
    bytes saved;
    uint64_t frames_saved, attempts_saved;
} watcher;

static uint64_t mix(uint64_t hash, const void *data, size_t size)
{
    const unsigned char *byte = data;
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ byte[i]) * UINT64_C(0x100000001b3);
    return hash;
}

static drape_status watch(void *user, const drape_event *event)
{
    watcher *w = user;
    size_t n = 3 * (size_t)drape_model_node_count(drape_sim_model(event->sim)) * sizeof(double);
    drape_energy energy = drape_sim_energy(event->sim);
    if (event->kind == DRAPE_EVENT_ATTEMPT) {
        const drape_attempt *a = event->attempt;
        w->attempts = mix(w->attempts, &a->index, sizeof a->index);
        w->attempts = mix(w->attempts, &a->h, sizeof a->h);
        w->attempts = mix(w->attempts, &a->iterations, sizeof a->iterations);
        w->attempts = mix(w->attempts, &a->residual, sizeof a->residual);
        w->attempts = mix(w->attempts, &energy, sizeof energy);
        return DRAPE_OK;
    }
    w->frames = mix(w->frames, &event->frame, sizeof event->frame);
    w->frames = mix(w->frames, event->positions, n);
    w->frames = mix(w->frames, event->velocities, n);
    if (event->frame == w->save_at) {
        w->saved = bytes_save(event->sim);
        w->frames_saved = w->frames;
        w->attempts_saved = w->attempts;
    }
    return DRAPE_OK;
}

static void same_counts(const drape_sim *a, const drape_sim *b, const char *what)
{
    drape_statistics s = drape_sim_statistics(a), r = drape_sim_statistics(b);
    ck_assert_msg(s.steps_accepted == r.steps_accepted && s.steps_rejected == r.steps_rejected &&
                      s.newton_iterations == r.newton_iterations && s.jacobians == r.jacobians &&
                      s.factorizations == r.factorizations && s.linear_iterations == r.linear_iterations &&
                      s.residuals == r.residuals && s.steps_above_error == r.steps_above_error &&
                      (s.error_max == r.error_max || isnan(s.error_max)) &&
                      (s.error_last == r.error_last || isnan(s.error_last)) && s.strain_max == r.strain_max &&
                      s.h_min == r.h_min,
                  "%s: counts differ", what);
    int64_t count, other;
    for (int i = 0; drape_sim_reason(a, i, &count); i++) {
        const char *reason = drape_sim_reason(b, i, &other);
        ck_assert_msg(reason && strcmp(reason, drape_sim_reason(a, i, &count)) == 0 && count == other,
                      "%s: reasons differ", what);
    }
}

static void same_end(drape_sim *a, drape_sim *b, const char *what)
{
    drape_energy e = drape_sim_energy(a), f = drape_sim_energy(b);
    ck_assert_msg(drape_sim_time(a) == drape_sim_time(b), "%s: times differ", what);
    ck_assert_msg(drape_sim_hash(a) == drape_sim_hash(b), "%s: bits differ", what);
    ck_assert_msg(memcmp(&e, &f, sizeof e) == 0, "%s: energies differ", what);
    same_counts(a, b, what);
}

/* Advances to t. A scene may fail before; then all sims of it must fail. */
static drape_status advance(drape_sim *sim, double t)
{
    return drape_sim_advance(sim, t);
}

static drape_sim *make_sim(scene *s, watcher *w)
{
    drape_sim *sim = NULL;
    assert_ok(s->ctx, drape_sim_create(s->ctx, s->model, NULL, &sim));
    if (w)
        ck_assert_int_eq(drape_sim_observe(sim, watch, w), DRAPE_OK);
    return sim;
}

/* Compares the contact forces of the present states, and the lagged friction, which depends on the step
 * before. */
static void same_contact(drape_sim *a, drape_sim *b, const char *what)
{
    size_t n = 3 * (size_t)drape_sim_model(a)->node_count;
    double *g[2] = {calloc(n, sizeof(double)), calloc(n, sizeof(double))};
    drape_sim *const sims[2] = {a, b};
    for (int i = 0; i < 2; i++) {
        const drape_state *at = drape_sim_state(sims[i]);
        const drape_point point = {
            .x = at->x, .v = at->v, .internal = at->internal, .t = at->t, .span = {at->t, at->t}};
        drape_system_contact_part(sims[i]->system, &point, true, g[i], NULL);
    }
    ck_assert_msg(memcmp(g[0], g[1], n * sizeof(double)) == 0, "%s: contact forces differ", what);
    free(g[0]);
    free(g[1]);
}

/* In two further sims, because a query of contact forces changes the next search: one is restored, the other
 * is advanced to the same time. */
static void check_contact(scene *s, const bytes *middle, const char *what)
{
    watcher one_watch = {.save_at = -1}, other_watch = {.save_at = -1};
    scoped_sim *one = make_sim(s, &one_watch), *other = make_sim(s, &other_watch);
    advance(one, MIDDLE);
    ck_assert_int_eq(drape_sim_restore_from(other, middle->data, middle->size), DRAPE_OK);
    same_contact(one, other, what);
}

/* One sim runs to the end and is saved at a frame within an advance and between two advances. Two others are
 * restored from these checkpoints; one of them has run before. */
static void check(scene *s, const char *what)
{
    watcher whole = {.save_at = 20}, from_frame = {.save_at = -1}, from_middle = {.save_at = -1};
    scoped_sim *sim = make_sim(s, &whole);
    drape_status first = advance(sim, MIDDLE);
    bytes middle = bytes_save(sim);
    check_contact(s, &middle, what);
    uint64_t frames = whole.frames, attempts = whole.attempts;
    drape_status second = first ? first : advance(sim, END);
    ck_assert_msg(whole.saved.size > 0 || first, "%s: no frame 20", what);

    drape_sim *other = make_sim(s, NULL);
    advance(other, 0.023); /* the restoration replaces this state */
    ck_assert_int_eq(drape_sim_observe(other, watch, &from_middle), DRAPE_OK);
    drape_status status = drape_sim_restore_from(other, middle.data, middle.size);
    ck_assert_msg(status == DRAPE_OK, "%s: %s", what, drape_context_message(s->ctx));
    from_middle.frames = frames;
    from_middle.attempts = attempts;
    ck_assert_int_eq(first ? first : advance(other, END), second);
    same_end(sim, other, what);
    ck_assert_msg(from_middle.frames == whole.frames, "%s: frames differ", what);
    ck_assert_msg(from_middle.attempts == whole.attempts, "%s: attempts differ", what);
    drape_sim_destroy(&other);

    if (whole.saved.size > 0) {
        from_frame.frames = whole.frames_saved;
        from_frame.attempts = whole.attempts_saved;
        other = make_sim(s, &from_frame);
        ck_assert_int_eq(drape_sim_restore_from(other, whole.saved.data, whole.saved.size), DRAPE_OK);
        if (drape_sim_time(other) < MIDDLE)
            ck_assert_int_eq(advance(other, MIDDLE), first);
        ck_assert_int_eq(first ? first : advance(other, END), second);
        same_end(sim, other, what);
        ck_assert_msg(from_frame.frames == whole.frames, "%s: frames differ after a frame", what);
        ck_assert_msg(from_frame.attempts == whole.attempts, "%s: attempts differ after a frame", what);
        drape_sim_destroy(&other);
    }
    drape_statistics counts = drape_sim_statistics(sim);
    printf("# %s: %lld steps, %lld rejected, %zu bytes, status %d\n", what, (long long)counts.steps_accepted,
           (long long)counts.steps_rejected, middle.size, (int)second);
    free(middle.data);
    free(whole.saved.data);
}

static void check_sheet(int edges, const char *terms, const char *more, const char *integrator,
                        const char *settings, const char *controller, const char *what)
{
    char name[200];
    snprintf(name, sizeof name, "%s, %s%s, %s", what, integrator, settings, controller);
    scoped_scene s = scene_model(SHEET, edges, terms, more, integrator, settings, controller);
    check(&s, name);
}

/* ---- Tests ---- */

/* All integrators get all settings: each ignores the parameters of the others. */
TEST(every_integrator_resumes)
{
    for (int i = 0; drape_integrators[i]; i++) {
        const char *name = drape_integrators[i]->entry.name;
        if (drape_integrators[i]->steady_state)
            continue;
        check_sheet(4, "", "", name, "", "halving", "sheet");
        check_sheet(4, "", OBSTACLES, name, "", "halving", "obstacles");
        check_sheet(4, ", {'type': 'limit.strain', 'limit': 0.1}", "", name, "", "halving", "limit");
    }
}

TEST(every_newton_variant_resumes)
{
    static const char *const settings[] = {", 'globalization': 'none'", ", 'globalization': 'line_search'",
                                           ", 'on_failure': 'accept', 'max_iterations': 1"};
    static const char *const methods[] = {"be", "bdf2", "trbdf2"};
    for (size_t i = 0; i < sizeof settings / sizeof *settings; i++)
        for (size_t k = 0; k < sizeof methods / sizeof *methods; k++) {
            if (!in_sample(i, k, 3))
                continue;
            check_sheet(4, "", "", methods[k], settings[i], "halving", "newton");
            check_sheet(4, "", OBSTACLES, methods[k], settings[i], "halving", "newton, obstacles");
        }
}

/* Large enough for solvers that pass small matrices to another solver: 7 edges are 186 unknowns. */
TEST(every_linear_solver_resumes)
{
    static const char *const methods[] = {"be", "ida", "dirk"};
    for (int i = 0; drape_linears[i]; i++)
        for (size_t k = 0; k < sizeof methods / sizeof *methods; k++) {
            char settings[100];
            snprintf(settings, sizeof settings, ", 'linear_solver': '%s'", drape_linears[i]->entry.name);
            if (k > 0 && !in_sample((size_t)i, k, 3))
                continue;
            check_sheet(7, "", OBSTACLES, methods[k], settings, "halving", "solver");
            check_sheet(3, "", "", methods[k], settings, "halving", "solver");
        }
}

TEST(every_controller_resumes)
{
    for (int i = 0; drape_controllers[i]; i++)
        for (int k = 0; drape_integrators[k]; k++) {
            if (drape_integrators[k]->steady_state ||
                (drape_integrators[k]->own_steps && drape_controllers[i]->own_steps))
                continue;
            check_sheet(3, "", "", drape_integrators[k]->entry.name, "", drape_controllers[i]->entry.name,
                        "controller");
        }
}

TEST(cloth_on_cloth_resumes)
{
    for (int i = 0; drape_integrators[i]; i++) {
        const char *name = drape_integrators[i]->entry.name;
        static const char *const settings[] = {"", ", 'linear_solver': 'klu'"};
        for (size_t k = 0; !drape_integrators[i]->steady_state && k < 2; k++) {
            if (!in_sample((size_t)i, k, 2))
                continue;
            char what[100];
            snprintf(what, sizeof what, "layers, %s%s", name, settings[k]);
            scoped_scene s = scene_model(LAYERS, name, settings[k], "halving");
            check(&s, what);
        }
    }
}

/* A node on a drag spring, a user-defined start, frames with a budget that is never reached. */
TEST(what_a_host_did_is_restored)
{
    for (int i = 0; drape_integrators[i]; i++) {
        const char *name = drape_integrators[i]->entry.name;
        if (drape_integrators[i]->steady_state)
            continue;
        scoped_scene s = scene_model(SHEET, 4, "", OBSTACLES, name, "", "halving");
        scoped_sim *one = make_sim(&s, NULL), *other = make_sim(&s, NULL);
        const double target[3] = {0.1, 0.05, 0.1};
        ck_assert_int_eq(advance(one, MIDDLE), DRAPE_OK);
        ck_assert_int_eq(drape_sim_set_state(one, 0.05, drape_sim_positions(one), drape_sim_velocities(one)),
                         DRAPE_E_ARGUMENT); /* the pin was elsewhere at the checkpoint */
        ck_assert_int_eq(
            drape_sim_set_state(one, MIDDLE, drape_sim_positions(one), drape_sim_velocities(one)), DRAPE_OK);
        ck_assert_int_eq(drape_sim_set_drag_spring(one, 7, 0.5, target), DRAPE_OK);
        ck_assert_int_eq(drape_sim_advance_realtime(one, 0.017, 1e9, NULL), DRAPE_OK);
        scoped_bytes saved = bytes_save(one), again = bytes_save(one);
        ck_assert_uint_eq(saved.size, again.size);
        ck_assert_mem_eq(saved.data, again.data, saved.size);
        ck_assert_int_eq(drape_sim_restore_from(other, saved.data, saved.size), DRAPE_OK);
        const drape_statistics was = drape_sim_statistics(one), is = drape_sim_statistics(other);
        ck_assert_mem_eq(&was, &is, offsetof(drape_statistics, stability_known)); /* the seconds too */
        double force[2][3];
        drape_sim_drag_spring_force(one, force[0]);
        drape_sim_drag_spring_force(other, force[1]);
        ck_assert_mem_eq(force[0], force[1], sizeof *force);
        ck_assert(force[0][0] != 0);
        for (int k = 0; k < 2; k++) {
            drape_sim *sim = k ? other : one;
            ck_assert_int_eq(drape_sim_advance_realtime(sim, 0.021, 1e9, NULL), DRAPE_OK);
            ck_assert_int_eq(advance(sim, END), DRAPE_OK);
        }
        same_end(one, other, name);
    }
}

/* An equilibrium also reports whether it is stable. */
TEST(an_equilibrium_resumes)
{
    scoped_scene s = scene_model(SHEET, 3, "", "", "static", "", "halving");
    scoped_sim *one = make_sim(&s, NULL), *other = make_sim(&s, NULL);
    ck_assert_int_eq(advance(one, MIDDLE), DRAPE_OK);
    scoped_bytes saved = bytes_save(one);
    ck_assert_int_eq(drape_sim_restore_from(other, saved.data, saved.size), DRAPE_OK);
    ck_assert(drape_sim_statistics(other).stability_known);
    same_end(one, other, "equilibrium");
    ck_assert_int_eq(advance(one, END), DRAPE_OK);
    ck_assert_int_eq(advance(other, END), DRAPE_OK);
    same_end(one, other, "equilibrium");
}

TEST(a_sheet_that_buckles_resumes)
{
    static const char *const methods[] = {"be", "bdf2", "midpoint", "trbdf2"};
    for (size_t i = 0; i < sizeof methods / sizeof *methods; i++)
        for (int k = 0; drape_linears[k]; k++) {
            char what[100];
            snprintf(what, sizeof what, "buckling, %s, %s", methods[i], drape_linears[k]->entry.name);
            scoped_scene s = scene_model(BUCKLING, methods[i], drape_linears[k]->entry.name);
            check(&s, what);
        }
}

/* A wind that oscillates. */
static void blow(void *user, double t, int32_t count, const double *x, double *wind, double *gradient)
{
    (void)user, (void)x, (void)gradient;
    for (int32_t i = 0; i < count; i++)
        wind[3 * i + 2] = 2 * sin(40 * t);
}

/* Pins that the host moves, one of them fixed by the scene; a collider; forces; a wind, which is set again on
 * the sim that is restored. The checkpoint is taken while they move; after the restoration the motions can
 * still be cancelled. */
TEST(what_a_host_moves_is_restored)
{
    for (int i = 0; drape_integrators[i]; i++) {
        const char *name = drape_integrators[i]->entry.name;
        if (drape_integrators[i]->steady_state)
            continue;
        scoped_scene s = scene_model(SHEET, 4, "", OBSTACLES, name, "", "halving");
        size_t n = 3 * (size_t)s.model->node_count;
        scoped_memory double *push = calloc(n, sizeof *push);
        scoped_sim *one = make_sim(&s, NULL), *other = make_sim(&s, NULL);
        const int32_t pins[] = {0, 4};
        const double to[6] = {0.01, 0.01, 0.02, 0.19, 0.02, 0}, away[3] = {0.02, -0.01, 0};
        push[3 * 12 + 1] = 0.01;
        ck_assert(s.model->pinned[pins[0]] && s.model->pinned[pins[1]]);
        ck_assert_int_eq(drape_sim_set_wind(one, blow, NULL), DRAPE_OK);
        ck_assert_int_eq(drape_sim_set_wind(other, blow, NULL), DRAPE_OK);
        ck_assert_int_eq(advance(one, 0.03), DRAPE_OK);
        ck_assert_int_eq(drape_sim_move_pins(one, 2, pins, 0.08, to, NULL), DRAPE_OK);
        ck_assert_int_eq(drape_sim_move_collider(one, 0, 0.07, away, away), DRAPE_OK);
        ck_assert_int_eq(drape_sim_push(one, push), DRAPE_OK);
        ck_assert_int_eq(advance(one, MIDDLE), DRAPE_OK);
        scoped_bytes saved = bytes_save(one);
        drape_status status = drape_sim_restore_from(other, saved.data, saved.size);
        ck_assert_msg(status == DRAPE_OK, "%s: %s", name, drape_context_message(s.ctx));
        same_contact(one, other, name);
        drape_sim_cancel(other);
        ck_assert_int_eq(advance(other, END), DRAPE_E_STOPPED);
        drape_status first = advance(one, END);
        ck_assert_int_eq(advance(other, END), first);
        ck_assert_msg(drape_sim_hash(one) == drape_sim_hash(other), "%s: bits differ", name);
        const double *x = drape_sim_positions(other) + 3 * pins[0];
        ck_assert_msg(first || (x[0] == to[0] && x[2] == to[2]), "%s: the pin is at %g %g %g", name, x[0],
                      x[1], x[2]);
    }
}
