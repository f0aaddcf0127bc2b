/* test_hinge.c: bend.hinge folded through pi and beyond, its rest angles, and the reports of collapsed
 * elements. */
#include <stdio.h>

#include "models.h"
#include "support/suite.h"

static const double pi = 3.14159265358979323846;

/* ---- One hinge ---- */

/* Edge 0 1 along x with apices 2 and 3, one on each side, 0.1 m away; folded by an angle at rest. */
typedef struct hinge {
    drape_context *ctx;
    drape_model *model;
    drape_system *system;
    drape_arena *arena;
    drape_state before, after;
    double k;
} hinge;

static void place_apex(double *x, double angle)
{
    x[9] = 0.05;
    x[10] = 0.1 * sin(angle);
    x[11] = -0.1 * cos(angle);
}

static hinge make_hinge(double rest_angle, const char *rest)
{
    static const int32_t triangles[] = {0, 1, 2, 1, 0, 3};
    double x[] = {0, 0, 0, 0.1, 0, 0, 0.05, 0, 0.1, 0, 0, 0};
    const drape_setting material[] = {
        {"young_modulus", 1e6, NULL}, {"thickness", 1e-3, NULL}, {"areal_density", 0.2, NULL}};
    const drape_setting setting = {"rest", 0, rest};
    const drape_entry_def term = {"bend.hinge", &setting, 1};
    drape_scene_def scene = scene_def();
    drape_cloth_def cloth = cloth_def();
    hinge h = {.ctx = make_context()};
    place_apex(x, rest_angle);
    cloth.mesh.positions = x;
    cloth.mesh.triangles = triangles;
    cloth.mesh.node_count = 4;
    cloth.mesh.triangle_count = 2;
    cloth.material = material;
    cloth.material_count = 3;
    cloth.terms = &term;
    cloth.term_count = 1;
    scene.cloths = &cloth;
    scene.cloth_count = 1;
    memset(scene.gravity, 0, sizeof scene.gravity);
    assert_ok(h.ctx, drape_model_create(h.ctx, &scene, &h.model));
    h.arena = drape_arena_create(h.ctx);
    h.system = make_system(h.arena, h.model, 1);
    ck_assert_int_eq(drape_state_create(h.arena, h.model, &h.before), DRAPE_OK);
    ck_assert_int_eq(drape_state_create(h.arena, h.model, &h.after), DRAPE_OK);
    h.k = h.model->terms[0].elements.rest[0];
    ck_assert_double_gt(h.k, 0);
    return h;
}

static void free_hinge(hinge *h)
{
    drape_system_destroy(&h->system);
    drape_arena_destroy(&h->arena);
    drape_model_destroy(&h->model);
    drape_context_destroy(&h->ctx);
}

/* Folds the hinge to an angle and accepts that state. */
static void accept_angle(hinge *h, double angle)
{
    place_apex(h->after.x, angle);
    drape_state_commit(h->model, &h->before, &h->after);
    memcpy(h->before.x, h->after.x, 12 * sizeof(double));
    memcpy(h->before.internal, h->after.internal, sizeof(double));
}

static double energy_at(hinge *h, double angle, double g[12])
{
    double energy, x[12];
    memcpy(x, h->before.x, sizeof x);
    place_apex(x, angle);
    memset(g, 0, 12 * sizeof *g);
    const drape_point point = {.x = x, .v = h->before.v, .internal = h->before.internal};
    drape_system_term(h->system, 0, &point, &energy, g, NULL);
    return energy;
}

/* The force on an apex is k (theta - theta0)/H, H = 0.1 m, perpendicular to its triangle; the energy is 1/2 k
 * (theta - theta0)^2. theta is the total angle of the fold, over any number of turns. */
static void check_fold(double rest, double sign, double turn)
{
    hinge h = make_hinge(rest, "mesh");
    for (int step = 1; step * 0.04 < turn; step++) {
        double g[12], angle = rest + sign * 0.04 * step, strain = angle - rest;
        double energy = energy_at(&h, angle, g), force = sqrt(g[9] * g[9] + g[10] * g[10] + g[11] * g[11]);
        ck_assert_double_eq_tol(energy, 0.5 * h.k * strain * strain, 1e-12 * h.k);
        ck_assert_double_eq_tol(force, h.k * fabs(strain) / 0.1, 1e-11 * h.k);
        /* against the fold: along d(apex)/d(angle) */
        ck_assert_double_gt(sign * (g[10] * cos(angle) + g[11] * sin(angle)), 0);
        accept_angle(&h, angle);
        ck_assert_double_eq_tol(fabs(h.before.internal[0]), fabs(angle), 1e-12);
    }
    free_hinge(&h);
}

TEST(folds_through_pi_smoothly)
{
    check_fold(0, 1, 3 * pi);
    check_fold(0, -1, 3 * pi);
    check_fold(0.7, 1, 2.5 * pi);
    check_fold(0.7, -1, 2.5 * pi);
}

/* A trial that is not accepted does not change the internal variable. */
TEST(only_accepted_states_count)
{
    hinge h = make_hinge(0, "mesh");
    double g[12], before = energy_at(&h, 0.5, g);
    energy_at(&h, 3.1, g);
    energy_at(&h, -3.1, g);
    ck_assert_double_eq(energy_at(&h, 0.5, g), before);
    free_hinge(&h);
}

TEST(rest_angles_of_the_mesh_or_flat)
{
    double g[12];
    for (double angle = -2.8; angle < 3; angle += 0.7) {
        hinge mesh = make_hinge(angle, "mesh"), flat = make_hinge(angle, "flat");
        ck_assert_double_eq_tol(energy_at(&mesh, angle, g), 0, 1e-28);
        ck_assert_double_eq_tol(energy_at(&flat, angle, g), 0.5 * flat.k * angle * angle, 1e-12 * flat.k);
        ck_assert_double_eq_tol(energy_at(&flat, 0, g), 0, 1e-28);
        ck_assert_double_eq_tol(energy_at(&mesh, 0, g), 0.5 * mesh.k * angle * angle, 1e-12 * mesh.k);
        free_hinge(&mesh);
        free_hinge(&flat);
    }
}

/* ---- Collapse ---- */

static bool has_nodes(const drape_diagnostic *diagnostic, const int32_t *nodes, int count)
{
    for (int i = 0; i < 4; i++)
        if (diagnostic->node[i] != (i < count ? nodes[i] : -1))
            return false;
    return true;
}

typedef struct sheet {
    drape_context *ctx;
    drape_model *model;
    drape_system *system;
    drape_arena *arena;
    drape_state state;
} sheet;

static sheet make_sheet(const char *term)
{
    const drape_entry_def def = {.type = term};
    sheet s = {.ctx = make_context()};
    s.model = make_model(s.ctx, &(model_def){.mesh = MESH_CURVED, .terms = &def, .term_count = 1});
    s.arena = drape_arena_create(s.ctx);
    s.system = make_system(s.arena, s.model, 1);
    ck_assert_int_eq(drape_state_create(s.arena, s.model, &s.state), DRAPE_OK);
    return s;
}

static void free_sheet(sheet *s)
{
    drape_system_destroy(&s->system);
    drape_arena_destroy(&s->arena);
    drape_model_destroy(&s->model);
    drape_context_destroy(&s->ctx);
}

/* Moves node a towards the line from p to q; `share` of its distance remains. */
static void flatten(double *x, const int32_t *node, double share)
{
    const double *p = x + 3 * node[0], *q = x + 3 * node[1];
    double *a = x + 3 * node[2], along = 0, length = 0;
    for (int k = 0; k < 3; k++) {
        along += (a[k] - p[k]) * (q[k] - p[k]);
        length += (q[k] - p[k]) * (q[k] - p[k]);
    }
    for (int k = 0; k < 3; k++) {
        double foot = p[k] + along / length * (q[k] - p[k]);
        a[k] = foot + share * (a[k] - foot);
    }
}

/* Collapses the altitudes of every hinge in turn; the element reported has that altitude, or one that the
 * same move flattened more. */
TEST(a_collapsed_altitude_is_reported)
{
    sheet s = make_sheet("bend.hinge");
    const drape_elements *el = &s.model->terms[0].elements;
    int own = 0;
    for (int32_t e = 0; e < el->count; e++) {
        drape_reason reason = DRAPE_REASON_CONVERGED;
        drape_diagnostic diagnostic = {.what = ""};
        double kept[3 * IRREGULAR_NODES];
        memcpy(kept, s.state.x, sizeof kept);
        ck_assert_int_eq(
            drape_system_check(s.system, s.state.x, NULL, s.state.internal, &reason, &diagnostic), DRAPE_OK);
        flatten(s.state.x, el->node + 4 * e, 1e-8);
        ck_assert_int_eq(
            drape_system_check(s.system, s.state.x, NULL, s.state.internal, &reason, &diagnostic),
            DRAPE_RETRY_DEGENERATE);
        ck_assert_int_eq(reason, DRAPE_REASON_ALTITUDE_COLLAPSE);
        ck_assert_str_eq(diagnostic.term, "bend.hinge");
        ck_assert_str_eq(diagnostic.what, "altitude / rest altitude");
        ck_assert_int_eq(diagnostic.cloth, 0);
        ck_assert_double_eq(diagnostic.limit, 1e-6);
        ck_assert_double_eq_tol(diagnostic.value, 1e-8, 0.2e-8);
        ck_assert(diagnostic.element >= 0 && diagnostic.element < el->count);
        ck_assert(has_nodes(&diagnostic, el->node + 4 * diagnostic.element, 4));
        own += diagnostic.element == e;
        memcpy(s.state.x, kept, sizeof kept);
    }
    ck_assert_int_gt(own, el->count / 3);
    free_sheet(&s);
}

TEST(a_collapsed_edge_is_reported)
{
    sheet s = make_sheet("stretch.edge");
    const drape_elements *el = &s.model->terms[0].elements;
    for (int32_t e = 0; e < el->count; e++) {
        const int32_t *node = el->node + 2 * e;
        drape_reason reason = DRAPE_REASON_CONVERGED;
        drape_diagnostic diagnostic = {.what = ""};
        double kept[3 * IRREGULAR_NODES];
        memcpy(kept, s.state.x, sizeof kept);
        for (int k = 0; k < 3; k++)
            s.state.x[3 * node[0] + k] +=
                (1 - 1e-7) * (s.state.x[3 * node[1] + k] - s.state.x[3 * node[0] + k]);
        ck_assert_int_eq(
            drape_system_check(s.system, s.state.x, NULL, s.state.internal, &reason, &diagnostic),
            DRAPE_RETRY_DEGENERATE);
        ck_assert_int_eq(reason, DRAPE_REASON_EDGE_COLLAPSE);
        ck_assert_str_eq(diagnostic.term, "stretch.edge");
        ck_assert_str_eq(diagnostic.what, "edge length / rest length");
        ck_assert_int_eq(diagnostic.element, e);
        ck_assert(has_nodes(&diagnostic, node, 2));
        ck_assert_double_eq_tol(diagnostic.value, 1e-7, 1e-12);
        ck_assert_double_eq(diagnostic.limit, 1e-6);
        memcpy(s.state.x, kept, sizeof kept);
    }
    free_sheet(&s);
}

/* Steps of the first element from 1e-7 of its rest shape to a share of it. */
static void check_below_limit(const char *term, void (*squeeze)(double *x, const int32_t *node, double share))
{
    sheet s = make_sheet(term);
    const int32_t *node = s.model->terms[0].elements.node;
    drape_reason reason = DRAPE_REASON_CONVERGED;
    drape_diagnostic diagnostic = {.what = ""};
    double rest[3 * IRREGULAR_NODES], before[3 * IRREGULAR_NODES];
    memcpy(rest, s.state.x, sizeof rest);
    memcpy(before, rest, sizeof before);
    squeeze(before, node, 1e-7);
    static const struct {
        double share; /* of the rest shape, after the step from 1e-7 */
        drape_status status;
    } steps[] = {{1e-7, DRAPE_OK}, /* unchanged */
                 {2e-7, DRAPE_OK}, /* grows, but stays below the limit */
                 {1, DRAPE_OK},
                 {0.9e-7, DRAPE_RETRY_DEGENERATE}};
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++) {
        memcpy(s.state.x, rest, sizeof rest);
        squeeze(s.state.x, node, steps[i].share);
        drape_status status =
            drape_system_check(s.system, s.state.x, before, s.state.internal, &reason, &diagnostic);
        ck_assert_msg(status == steps[i].status, "%s, to %g of rest: %s", term, steps[i].share,
                      drape_status_name(status));
        if (steps[i].share < 1)
            ck_assert_int_eq(
                drape_system_check(s.system, s.state.x, NULL, s.state.internal, &reason, &diagnostic),
                DRAPE_RETRY_DEGENERATE);
    }
    free_sheet(&s);
}

static void shorten(double *x, const int32_t *node, double share)
{
    for (int k = 0; k < 3; k++)
        x[3 * node[0] + k] = x[3 * node[1] + k] + share * (x[3 * node[0] + k] - x[3 * node[1] + k]);
}

/* If a value was below its limit before the step, it may stay or grow, so that a crumpled start can be
 * left; it must not fall. */
TEST(what_was_degenerate_must_not_become_worse)
{
    check_below_limit("stretch.edge", shorten);
    check_below_limit("bend.hinge", flatten);
}

/* A fold by more than 2.8 in one step cannot be distinguished from one in the opposite direction. */
TEST(a_turn_that_is_too_large_is_reported)
{
    hinge h = make_hinge(0, "mesh");
    drape_reason reason = DRAPE_REASON_CONVERGED;
    drape_diagnostic diagnostic = {.what = ""};
    place_apex(h.after.x, 2.7);
    ck_assert_int_eq(
        drape_system_check(h.system, h.after.x, h.before.x, h.before.internal, &reason, &diagnostic),
        DRAPE_OK);
    place_apex(h.after.x, 2.9);
    ck_assert_int_eq(
        drape_system_check(h.system, h.after.x, h.before.x, h.before.internal, &reason, &diagnostic),
        DRAPE_RETRY_DEGENERATE);
    ck_assert_int_eq(reason, DRAPE_REASON_HINGE_BRANCH);
    ck_assert_double_eq_tol(diagnostic.value, 2.9, 1e-12);
    ck_assert_double_eq(diagnostic.limit, 2.8);
    accept_angle(&h, 1); /* from 1 to 2.9: a fold by 1.9 */
    ck_assert_int_eq(
        drape_system_check(h.system, h.after.x, h.before.x, h.before.internal, &reason, &diagnostic),
        DRAPE_OK);
    place_apex(h.after.x, 2.9);
    ck_assert_int_eq(
        drape_system_check(h.system, h.after.x, h.before.x, h.before.internal, &reason, &diagnostic),
        DRAPE_OK);
    free_hinge(&h);
}

/* In a sim: a pinned corner is driven onto its neighbour, and the message names the element. */
TEST(the_message_names_the_element)
{
    static const drape_track_key track[] = {{0, {0, 0, 0}}, {1, {0.1, 0, 0}}}; /* node 0 to where node 1 is */
    static const int32_t zero = 0, one = 1;
    const drape_setting material[] = {
        {"young_modulus", 1e3, NULL}, {"thickness", 1e-3, NULL}, {"areal_density", 0.2, NULL}};
    const drape_setting grid[] = {{"edges", 2, NULL}, {"edge_length", 0.1, NULL}};
    const drape_entry_def term = {.type = "stretch.edge"};
    scoped_context *ctx = make_context();
    drape_scene_def scene = scene_def();
    drape_cloth_def cloth = cloth_def();
    drape_pin_def pins[2];
    scoped_model *model = NULL;
    scoped_sim *sim = NULL;
    int64_t count = 0;
    for (int i = 0; i < 2; i++) {
        drape_pin_def_init(&pins[i], sizeof pins[i]);
        pins[i].nodes = i ? &one : &zero;
        pins[i].node_count = 1;
    }
    pins[0].track = track;
    pins[0].key_count = 2;
    cloth.name = "towel";
    cloth.mesh.grid = (drape_entry_def){"equilateral", grid, 2};
    cloth.material = material;
    cloth.material_count = 3;
    cloth.terms = &term;
    cloth.term_count = 1;
    cloth.pins = pins;
    cloth.pin_count = 2;
    scene.cloths = &cloth;
    scene.cloth_count = 1;
    assert_ok(ctx, drape_model_create(ctx, &scene, &model));
    ck_assert_int_eq(drape_sim_create(ctx, model, NULL, &sim), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(sim, 2), DRAPE_E_STEP_TOO_SMALL);
    const char *message = drape_context_message(ctx);
    ck_assert_msg(strstr(message, "edge_collapse") && strstr(message, "nodes 0 1 of towel") &&
                      strstr(message, "limit 1e-06") && strncmp(message, "t=0.99", 6) == 0,
                  "%s", message);
    ck_assert_str_eq(drape_sim_reason(sim, 0, &count), "edge_collapse");
    ck_assert_int_eq(count, drape_sim_statistics(sim).steps_rejected);
    ck_assert_double_lt(drape_sim_time(sim), 1);
}
