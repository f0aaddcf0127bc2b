/*
 * test_contact_system.c: the Jacobian of the whole system with active contacts against differences of its
 * force, for all colliders, at rest and moving, with implicit and lagged friction, and for cloth on cloth.
 */
#include "assemble/check.h"
#include "contact/broad_phase.h"
#include "contact/law.h"
#include "entries/models.h"
#include "support/folder.h"
#include "support/sample.h"
#include "support/scene.h"

#include <unistd.h>

/* |x| + |y| + |z| <= 0.15 */
static const char octahedron[] = "v 0.15 0 0\nv -0.15 0 0\nv 0 0.15 0\nv 0 -0.15 0\nv 0 0 0.15\nv 0 0 -0.15\n"
                                 "f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";

/* Colliders, each with its top at the given height. */
static const struct setting {
    const char *collider, *text;
    double top; /* [m] */
} settings[] = {
    {"plane", "'type': 'plane', 'point': [0,0,0], 'normal': [0.003,1,0.005]", 0.0005},
    {"sphere", "'type': 'sphere', 'center': [0,0,0], 'radius': 0.1", 0.1},
    {"capsule", "'type': 'capsule', 'a': [-0.05,0,0], 'b': [0.05,0,0.03], 'radius': 0.06", 0.06},
    {"box", "'type': 'box', 'center': [0,0,0], 'size': [0.16,0.12,0.2], 'rotate': [0,0,1,4]", 0.0654},
    {"box", "'type': 'box', 'center': [0,0,0], 'size': [0.16,0.12,0.2], 'rounding': 0.03", 0.06},
    {"cylinder", "'type': 'cylinder', 'a': [0,0,-0.1], 'b': [0,0,0.1], 'radius': 0.08", 0.08},
    {"mesh", "'type': 'mesh', 'file': 'octahedron.obj'", 0.15},
    {"animated_mesh", "'type': 'animated_mesh', 'file': 'octahedron.obj', 'thickness': 0.01", 0.16},
};
#define SETTINGS (sizeof settings / sizeof *settings)

typedef struct probe {
    scene s;
    drape_system *system;
    drape_state at;
    drape_arena *arena;
    double *p, *x, *v, *g[2], *jp, *values;
} probe;

static double *take(probe *t, size_t n)
{
    double *out = drape_arena_take(t->arena, n, sizeof *out);
    ck_assert_ptr_nonnull(out);
    return out;
}

/* A crumpled sheet in motion, the last cloth lifted; the system has begun a step there. */
static probe open_probe(scene s, double lift, uint64_t seed)
{
    probe t = {.s = s};
    const size_t n = 3 * (size_t)s.model->node_count;
    const int32_t high = s.model->cloths[s.model->cloth_count - 1].first_node;
    t.arena = drape_arena_create(s.ctx);
    ck_assert_int_eq(drape_system_create(t.arena, s.model, 1, &t.system), DRAPE_OK);
    ck_assert_int_eq(drape_system_add_contact(t.system), DRAPE_OK);
    ck_assert_int_eq(drape_state_create(t.arena, s.model, &t.at), DRAPE_OK);
    double **arrays[] = {&t.p, &t.x, &t.v, &t.g[0], &t.g[1], &t.jp};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        *arrays[i] = take(&t, n);
    for (size_t i = 0; i < n; i++) {
        t.at.x[i] += (i % 3 == 1 && (int32_t)(i / 3) >= high ? lift : 0) + 1e-3 * random_number(&seed);
        t.at.v[i] = random_number(&seed) * (i % 6 < 3 ? 1e-3 : 0.1); /* some stick, some slide */
        t.p[i] = s.model->pinned[i / 3] ? 0 : random_number(&seed);
    }
    ck_assert_int_eq(drape_system_begin(t.system, &t.at), DRAPE_OK);
    return t;
}

static void close_probe(probe *t)
{
    drape_system_destroy(&t->system);
    drape_arena_destroy(&t->arena);
    scene_close(&t->s);
}

#define scoped_probe SCOPED(close_probe) probe

static void force_beside(probe *t, drape_point point, double s, double *g)
{
    for (size_t i = 0; i < 3 * (size_t)t->s.model->node_count; i++) {
        t->x[i] = point.x[i] + s * t->p[i];
        t->v[i] = point.v[i] + point.weight * s * t->p[i];
    }
    point.x = t->x;
    point.v = t->v;
    drape_system_force(t->system, &point, g);
}

static double scale_of(const probe *t, const double *a)
{
    double max = 0;
    for (size_t i = 0; i < 3 * (size_t)t->s.model->node_count; i++)
        max = fmax(max, fabs(a[i]));
    return max;
}

/* Largest difference over the largest entry, for the best of some step sizes e. Barriers change over 1e-3 m:
 * with e = 1e-7 the truncation error is (e/1e-4)^2 = 1e-6 where gaps are a tenth of that, the rounding error
 * 1e-16 0.3/e/1e-4 = 3e-6. From one step size to the next, both change by a factor of 10 or more. */
static double error_of(probe *t, double weight, double time)
{
    const drape_model *m = t->s.model;
    const drape_point point = {.x = t->at.x,
                               .v = t->at.v,
                               .internal = t->at.internal,
                               .weight = weight,
                               .t = time,
                               .span = {time - 0.01, time}};
    bool changed;
    double best = INFINITY;
    ck_assert_int_eq(drape_system_extend_pattern(t->system, &point, &changed), DRAPE_OK);
    const drape_pattern *pattern = drape_system_pattern(t->system);
    t->values = take(t, (size_t)pattern->nonzeros);
    drape_system_jacobian(t->system, &point, 0, 0, t->values);
    memset(t->jp, 0, 3 * (size_t)m->node_count * sizeof *t->jp);
    for (int64_t j = 0; j < pattern->n; j++)
        for (int64_t k = pattern->column[j]; k < pattern->column[j + 1]; k++)
            t->jp[3 * m->node_of_free[drape_pattern_row(pattern, j, k) / 3] +
                  drape_pattern_row(pattern, j, k) % 3] +=
                t->values[k] * t->p[3 * m->node_of_free[j / 3] + j % 3];
    for (double e = 1e-6; e > 5e-10; e /= 10) {
        force_beside(t, point, e, t->g[0]);
        force_beside(t, point, -e, t->g[1]);
        for (size_t i = 0; i < 3 * (size_t)m->node_count; i++)
            t->g[0][i] = m->pinned[i / 3] ? 0 : (t->g[0][i] - t->g[1][i]) / (2 * e) - t->jp[i];
        best = fmin(best, scale_of(t, t->g[0]) / scale_of(t, t->jp));
    }
    return best;
}

/* Value (i, j) of a matrix; 0 outside of its pattern. */
static double value_at(const drape_pattern *p, const double *values, int64_t i, int64_t j)
{
    for (int64_t k = p->column[j]; k < p->column[j + 1]; k++)
        if (drape_pattern_row(p, j, k) == i)
            return values[k];
    return 0;
}

/* The matrix that Newton factors in place of J, here with a share of the positive parts: exactly symmetric; J
 * itself, up to rounding errors, where contact is declared symmetric or has all of the positive parts, and
 * another one where it is not, for cloth that slides. */
static void check_symmetrized(probe *t, const char *what, double weight, double time, double share)
{
    const drape_point point = {.x = t->at.x,
                               .v = t->at.v,
                               .internal = t->at.internal,
                               .weight = weight,
                               .t = time,
                               .span = {time - 0.01, time},
                               .contact = DRAPE_CONTACT_SYMMETRIC};
    const drape_pattern *p = drape_system_pattern(t->system);
    double *exact = take(t, (size_t)p->nonzeros), largest = 0, change = 0;
    drape_system_jacobian(t->system, &point, 0, share, exact);
    memcpy(t->values, exact, (size_t)p->nonzeros * sizeof *exact);
    drape_system_symmetrize(t->system, &point, share, t->values);
    for (int64_t j = 0; j < p->n; j++)
        for (int64_t k = p->column[j]; k < p->column[j + 1]; k++) {
            ck_assert_msg(t->values[k] == value_at(p, t->values, j, drape_pattern_row(p, j, k)), "%s", what);
            largest = fmax(largest, fabs(exact[k]));
            change = fmax(change, fabs(t->values[k] - exact[k]));
        }
    if (drape_system_is_symmetric(t->system) || share == 1)
        ck_assert_msg(change <= 1e-12 * largest, "%s: %g of %g", what, change, largest);
    else
        ck_assert_msg(change > 1e-9 * largest, "%s: %g of %g", what, change, largest);
}

/* A matrix with a share of the positive parts lies between those without and with all of them, contact
 * included: with rounding errors of sums of at most some hundred terms in each value. */
static void check_shares(probe *t, const char *what, double weight, double time)
{
    const double shares[] = {0, 1, 0.25};
    const drape_point point = {.x = t->at.x,
                               .v = t->at.v,
                               .internal = t->at.internal,
                               .weight = weight,
                               .t = time,
                               .span = {time - 0.01, time},
                               .contact = DRAPE_CONTACT_SYMMETRIC};
    const size_t nonzeros = (size_t)drape_system_pattern(t->system)->nonzeros;
    double *values[3], largest = 0, error = 0;
    for (int i = 0; i < 3; i++) {
        values[i] = take(t, nonzeros);
        drape_system_jacobian(t->system, &point, 0, shares[i], values[i]);
    }
    for (size_t k = 0; k < nonzeros; k++) {
        largest = fmax(largest, fmax(fabs(values[0][k]), fabs(values[1][k])));
        error = fmax(error, fabs(values[2][k] - (0.75 * values[0][k] + 0.25 * values[1][k])));
    }
    ck_assert_msg(error <= 1e-13 * largest, "%s: %g of %g", what, error, largest);
}

/* What the Gauss-Newton matrix leaves out, added to it, makes it J, up to rounding errors. */
static void check_remainder(probe *t, const char *what, double weight, double time)
{
    drape_point point = {.x = t->at.x,
                         .v = t->at.v,
                         .internal = t->at.internal,
                         .weight = weight,
                         .t = time,
                         .span = {time - 0.01, time}};
    const int64_t n = drape_system_pattern(t->system)->nonzeros;
    double *exact = take(t, (size_t)n), *rest = take(t, (size_t)n), largest = 0, error = 0;
    drape_system_jacobian(t->system, &point, 0, 0, exact);
    point.contact = DRAPE_CONTACT_GAUSS_NEWTON;
    drape_system_jacobian(t->system, &point, 0, 0, t->values);
    drape_system_contact_remainder(t->system, &point, rest);
    for (int64_t k = 0; k < n; k++) {
        largest = fmax(largest, fabs(exact[k]));
        error = fmax(error, fabs(t->values[k] + rest[k] - exact[k]));
    }
    ck_assert_msg(error <= 1e-11 * largest, "%s: %g of %g", what, error, largest);
}

static void check(probe *t, const char *what, double time)
{
    double gap;
    const double steps = error_of(t, 100, time);
    check_symmetrized(t, what, 100, time, 0);
    check_symmetrized(t, what, 100, time, 0.25);
    check_symmetrized(t, what, 100, time, 1);
    check_shares(t, what, 100, time);
    check_remainder(t, what, 100, time);
    const double still = error_of(t, 0, time);
    const drape_contact *contact = drape_system_contact(t->system);
    const int32_t active = drape_contact_active(contact, &gap);
    printf("# %.60s: %d active, least gap %.2g m; errors %.2g with w = 100, %.2g with w = 0\n", what,
           (int)active, gap, steps, still);
    ck_assert_msg(active >= 2, "%s: %d active", what, (int)active);
    assert_below(steps, 1e-5);
    assert_below(still, 1e-5);
}

TEST(every_collider)
{
    folder_enter();
    folder_write("octahedron.obj", octahedron);
    for (int i = 0; drape_colliders[i]; i++) {
        bool tried = false;
        for (size_t k = 0; k < SETTINGS; k++)
            tried = tried || strcmp(settings[k].collider, drape_colliders[i]->entry.name) == 0;
        ck_assert_msg(tried, "no setting of %s is tested", drape_colliders[i]->entry.name);
    }
    /* at the time of the test it has turned by 1.2 degrees, a millimetre or two at the cloth */
    static const char turns[] = ", 'turns': [{'time': 0, 'rotate': [0.3, 1, 0.2, 0]},"
                                " {'time': 1, 'rotate': [0.3, 1, 0.2, 60]}]";
    for (size_t i = 0; i < SETTINGS; i++)
        for (int k = 0; k < 6; k++) {
            scene s = scene_model(
                "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 9, 'rows': 9, 'width': 0.3,"
                " 'height': 0.3, 'transform': {'translate': [-0.147, 0, 0.155]}}, 'pins': [{'nodes': [3]}],"
                " 'material': {'young_modulus': 1e3, 'thickness': 1e-3, 'density': 200},"
                " 'terms': ['stretch.edge', 'bend.hinge']}],"
                " 'colliders': [{%s, 'friction': 0.4, 'track': [[0, [0,0,0]], [1, [%g,0,0]]]%s}],"
                " 'contact': {'distance': 4e-3, 'stiffness': 1e5, 'friction': '%s'}, 'duration': 1}",
                settings[i].text, k % 3 ? 0.05 : 0, k % 3 == 2 ? turns : "", k / 3 ? "lagged" : "implicit");
            scoped_probe t = open_probe(s, settings[i].top + 2e-3, 11 + i);
            check(&t, settings[i].text, 0.02);
        }
    folder_leave();
}

/* A square grid with so many nodes a side under a triangle with so many edges a side. */
static scene two_cloths(int columns, int edges, const char *pins, bool lagged)
{
    return scene_model(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': %d, 'rows': %d, 'width': 0.3,"
        " 'height': 0.3}, 'material': {'young_modulus': 1e3, 'thickness': 1e-3, 'density': 200},"
        " 'terms': ['stretch.edge']}, {'mesh': {'grid': 'equilateral', 'edges': %d, 'edge_length': 0.07,"
        " 'transform': {'translate': [0.013, 0.03, -0.017]}}, 'pins': [%s],"
        " 'material': {'young_modulus': 1e3, 'thickness': 1e-3, 'density': 200}, 'terms': ['bend.hinge']}],"
        " 'self_contact': {'thickness': 2e-3, 'friction': 0.4},"
        " 'contact': {'stiffness': 1e5, 'friction': '%s'}, 'duration': 1}",
        columns, columns, edges, pins, lagged ? "lagged" : "implicit");
}

TEST(cloth_on_cloth)
{
    for (int k = 0; k < 2; k++) {
        scene s = two_cloths(6, 4, "{'nodes': [3]}", k);
        scoped_probe t = open_probe(s, -0.028, 17);
        check(&t, "cloth on cloth", 0.02);
    }
}

/* Layers that are as near as twice their least gap. Derivatives change over the gap of 8e-6 m there, so
 * with a difference over e = 1e-8 m the truncation error is (e/gap)^2 = 2e-6, the rounding error 1e-16
 * 0.3 / e = 3e-9. */
TEST(near_the_least_gap)
{
    for (int k = 0; k < 2; k++) {
        scene s = two_cloths(4, 3, "", k);
        double gap;
        scoped_probe t = open_probe(s, 0, 17);
        for (int32_t i = 0; i < s.model->node_count; i++) /* flat, one 8e-6 m above the other */
            t.at.x[3 * (size_t)i + 1] = i < s.model->cloths[1].first_node ? 0 : 8e-6;
        ck_assert_int_eq(drape_system_begin(t.system, &t.at), DRAPE_OK);
        check(&t, "near the least gap", 0.02);
        drape_contact_active(drape_system_contact(t.system), &gap);
        assert_below(gap, 9e-6);
    }
}

/* A flat sheet of 1 kg/m2 above a floor, with contact of 4 mm and 1e5 N/m. */
static probe open_flat(double height)
{
    scene s = scene_model(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'width': 0.3, 'height': "
        "0.3}, 'material': {'young_modulus': 1e3, 'thickness': 1e-3, 'areal_density': 1}, 'terms': []}],"
        " 'colliders': [{'type': 'plane', 'point': [0,0,0], 'normal': [0,1,0]}],"
        " 'contact': {'distance': 4e-3, 'stiffness': 1e5}, 'duration': 1}");
    probe t = open_probe(s, 0, 3);
    for (int32_t i = 0; i < 3 * s.model->node_count; i++) {
        t.at.x[i] = i % 3 == 1 ? height : s.model->rest[i];
        t.at.v[i] = 0;
    }
    ck_assert_int_eq(drape_system_begin(t.system, &t.at), DRAPE_OK);
    return t;
}

/* What is left of the gap by a correction that leads far beyond the floor. */
static double left_of(double gap)
{
    scoped_probe t = open_flat(gap);
    memcpy(t.x, t.at.x, 3 * (size_t)t.s.model->node_count * sizeof *t.x);
    for (int32_t i = 0; i < t.s.model->node_count; i++)
        t.x[3 * i + 1] -= 10 * gap;
    const double left = gap - 10 * gap * drape_system_step_fraction(t.system, t.at.x, t.x, 0.01, false, NULL);
    return left;
}

/* From beyond the activation distance a correction arrives at half of it at once, however far it comes from;
 * within it, half of the gap is left. A path is cut up to a fifth of that before. */
TEST(a_correction_arrives_from_beyond_the_distance)
{
    for (double gap = 0.01; gap < 1; gap *= 3)
        ck_assert_double_eq_tol(left_of(gap), 2.2e-3, 0.2e-3 * (1 + 1e-9));
    ck_assert_double_eq_tol(left_of(3e-3), 1.65e-3, 0.15e-3 * (1 + 1e-9));
}

/* The sum of J p over the nodes, along y. */
static double stiffness_along(probe *t, const double *p)
{
    const drape_model *m = t->s.model;
    const drape_point point = {
        .x = t->at.x, .v = t->at.v, .internal = t->at.internal, .t = 0.01, .span = {0, 0.01}};
    const drape_pattern *pattern = drape_system_pattern(t->system);
    double sum = 0;
    drape_system_force(t->system, &point, t->g[0]);
    t->values = take(t, (size_t)pattern->nonzeros);
    drape_system_jacobian(t->system, &point, 0, 0, t->values);
    for (int64_t j = 0; j < pattern->n; j++)
        for (int64_t k = pattern->column[j]; k < pattern->column[j + 1]; k++)
            sum += drape_pattern_row(pattern, j, k) % 3 == 1
                       ? t->values[k] * p[3 * m->node_of_free[j / 3] + j % 3]
                       : 0;
    return sum;
}

/* A correction by which the sheet, 3 mm above the floor, would pass it meets the inertia of its mass M at
 * least: by Newton's tangent k it has the force N + k p, and M / h^2 (p - 3 mm) is added where it goes
 * beyond. The next Jacobian leads to the gap with that force, which is positive: its secant is stiffer than
 * the tangent, and the correction that it allows under that force ends before the floor. Without a
 * correction, and after predictions are forgotten, the Jacobian has the bits of the tangent. */
TEST(the_jacobian_has_the_predicted_forces)
{
    const double gap = 3e-3, h = 0.01;
    scoped_probe t = open_flat(gap);
    const int32_t n = t.s.model->node_count;
    double *down = take(&t, 3 * (size_t)n), *none = take(&t, 3 * (size_t)n), before = 0;
    for (int32_t i = 0; i < n; i++)
        down[3 * i + 1] = -5e-3;
    const double tangent = stiffness_along(&t, down);
    for (int32_t i = 0; i < n; i++)
        before -= t.g[0][3 * i + 1];
    drape_system_predict_contact(t.system, none, 0, 1 / (h * h));
    ck_assert_double_eq(stiffness_along(&t, down), tangent);
    drape_system_predict_contact(t.system, down, 0, 1 / (h * h));
    const double secant = stiffness_along(&t, down), inertia = 0.3 * 0.3 / (h * h) * (5e-3 - gap);
    const double force = before - tangent + inertia; /* both stiffnesses times -5 mm */
    printf("# force %g, then %g N; stiffness %g, then %g N/m\n", before, force, tangent / -5e-3,
           secant / -5e-3);
    ck_assert_double_lt(secant, 1.5 * tangent);
    ck_assert_double_gt((force - before) / (secant / -5e-3), 0.2 * gap);
    ck_assert_double_lt((force - before) / (secant / -5e-3), gap);
    drape_system_predict_contact(t.system, NULL, 0, 0);
    ck_assert_double_eq(stiffness_along(&t, down), tangent);
}

/* Whoever cancels need not wait until all pairs have been looked at: nothing moves, which is always safe. */
TEST(a_cancelled_search_moves_nothing)
{
    scoped_probe t = open_flat(3e-3);
    const size_t nodes = (size_t)t.s.model->node_count;
    atomic_bool cancel = false;
    scoped_memory double *fraction = calloc(nodes, sizeof *fraction);
    ck_assert_ptr_nonnull(fraction);
    for (size_t i = 0; i < 3 * nodes; i++)
        t.x[i] = t.at.x[i] - (i % 3 == 1 ? 1e-3 : 0);
    drape_system_watch(t.system, &cancel);
    ck_assert_double_gt(drape_system_step_fraction(t.system, t.at.x, t.x, 0.01, false, fraction), 0);
    atomic_store(&cancel, true);
    ck_assert_double_eq(drape_system_step_fraction(t.system, t.at.x, t.x, 0.01, false, NULL), 0);
    ck_assert_double_eq(drape_system_step_fraction(t.system, t.at.x, t.x, 0.01, false, fraction), 0);
    for (size_t i = 0; i < nodes; i++)
        ck_assert_double_eq(fraction[i], 0);
    atomic_store(&cancel, false);
    ck_assert_double_gt(drape_system_step_fraction(t.system, t.at.x, t.x, 0.01, false, NULL), 0);
}

/* A state with NaN has no effect on later ones: the next evaluation is as before it. */
TEST(nan_is_forgotten)
{
    scene s = scene_model(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 6, 'rows': 6, 'width': 0.3, 'height': "
        "0.3},"
        " 'material': {'young_modulus': 1e3, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge']}],"
        " 'self_contact': {'thickness': 2e-3}, 'contact': {'distance': 4e-3}, 'colliders': ["
        " {'type': 'box', 'center': [0.1,-0.1,-0.1], 'size': [0.2,0.2,0.2], 'friction': 0.4},"
        " {'type': 'sphere', 'center': [0.1,-0.1,-0.1], 'radius': 0.1, 'friction': 0.4}], 'duration': 1}");
    scoped_probe t = open_probe(s, 2e-3, 3);
    const size_t n = 3 * (size_t)s.model->node_count;
    drape_point point = {.x = t.at.x, .v = t.at.v, .internal = t.at.internal, .t = 0.01, .span = {0, 0.01}};
    double gap;
    drape_system_force(t.system, &point, t.g[0]);
    ck_assert_int_gt(drape_contact_active(drape_system_contact(t.system), &gap), 0);
    for (size_t broken = 0; broken < n; broken += 7) {
        drape_reason reason = DRAPE_REASON_CONVERGED;
        drape_diagnostic diagnostic;
        memcpy(t.x, t.at.x, n * sizeof *t.x);
        t.x[broken] = broken % 2 ? NAN : INFINITY;
        point.x = t.x;
        drape_system_force(t.system, &point, t.g[1]);
        drape_system_step_fraction(t.system, t.at.x, t.x, 0.01, false, NULL);
        drape_system_crosses(t.system, t.x, 0.01, &reason, &diagnostic);
        drape_system_check_contact(t.system, t.x, 0.01, &reason, &diagnostic);
        point.x = t.at.x;
        drape_system_force(t.system, &point, t.g[1]);
        ck_assert_int_eq(memcmp(t.g[0], t.g[1], n * sizeof *t.g[0]), 0);
    }
    ck_assert_int_eq(drape_system_status(t.system), DRAPE_OK);
}

/* `drape check` compares contact forces in scenes with contact, and only there. */
TEST(only_scenes_with_contact_have_it_checked)
{
    static const char *const more[] = {
        "", ", 'colliders': [{'type': 'box', 'center': [0,-1,0], 'size': [0.2,0.2,0.2], 'friction': 0.4}]",
        ", 'self_contact': {'thickness': 2e-3, 'friction': 0.2}, 'contact': {'friction': 'lagged'}"};
    static drape_check_result found[DRAPE_MAX_CHECK_RESULTS];
    for (int k = 0; k < 3; k++) {
        scoped_scene s =
            scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 7, 'rows': 7, "
                       "'width': 0.3, 'height':"
                       " 0.3}, 'material': {'young_modulus': 1e3, 'thickness': 1e-3, 'density': 200},"
                       " 'terms': ['stretch.edge']}]%s, 'duration': 1}",
                       more[k]);
        int count = 0, contact = 0, self = 0;
        ck_assert_int_eq(drape_check_derivatives(s.ctx, s.sim->system, 1, found, &count), DRAPE_OK);
        for (int i = 0; i < count; i++) {
            ck_assert_msg(found[i].pass, "%s %s: %g", found[i].term, found[i].what, found[i].error);
            contact += strcmp(found[i].term, "contact") == 0 && found[i].error > 0;
            self += strcmp(found[i].term, "self_contact") == 0 && found[i].error > 0;
        }
        ck_assert_int_eq(contact, k == 1 ? 2 : 0);
        ck_assert_int_eq(self, k == 2 ? 2 : 0);
    }
}

/* Without colliders and self-contact, contact takes no time and no memory. The time of contact is separate
 * from the other parts of a step, not within them: the sum of all parts is at most the time of the steps,
 * up to the rounding of sums. */
TEST(scenes_without_contact_pay_nothing)
{
    for (size_t k = 0; drape_integrators[k / 2]; k++) {
        const char *method = drape_integrators[k / 2]->entry.name;
        const bool there = k % 2;
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 6, 'rows': 6, 'width': 0.3, "
            "'height':"
            " 0.3}, 'material': {'young_modulus': 1e3, 'thickness': 1e-3, 'density': 200},"
            " 'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'row': 0}]}]%s,"
            " 'integrator': {'method': '%s', 'dt': 0.01, 'substeps': 100}, 'duration': 1}",
            there ? ", 'colliders': [{'type': 'plane', 'point': [0,-1,0], 'normal': [0,1,0]}]" : "", method);
        scene_advance(&s, 0.02);
        const drape_statistics d = drape_sim_statistics(s.sim);
        const double seconds = d.wall_contact;
        ck_assert(d.wall_residual >= 0 && d.wall_jacobian >= 0);
        ck_assert(d.wall_residual + d.wall_jacobian + d.wall_factor + d.wall_solve + seconds <=
                  (1 + 1e-9) * d.wall_steps);
        ck_assert_msg(there ? seconds > 0 : seconds == 0, "%s: %g s", method, seconds);
        ck_assert(there || !drape_system_contact(s.sim->system));
    }
}

#define LAYER                                                                                                \
    "{'mesh': {'grid': 'square', 'columns': 6, 'rows': 6, 'width': 0.3, 'height': 0.3, 'transform': "        \
    "{'translate': [0, %g, 0]}}, 'material': {'young_modulus': 1e3, 'thickness': 1e-3, 'density': 200}, "    \
    "'terms': ['stretch.edge', 'bend.hinge']}"

/* Bytes allocated by a context and not yet released; each block begins with its size. An empty array has one
 * byte, which no account includes. */
static size_t allocated;

static void *count_allocation(void *user, size_t size)
{
    (void)user;
    size_t *piece = malloc(size + 2 * sizeof *piece);
    if (!piece)
        return NULL;
    *piece = size > 1 ? size : 0;
    allocated += *piece;
    return piece + 2;
}

static void count_release(void *user, void *memory)
{
    (void)user;
    scoped_memory size_t *piece = (size_t *)memory - 2;
    allocated -= *piece;
}

/* A system reports its memory to the byte: contact with its lists as they have grown, and the extended
 * pattern. */
TEST(all_bytes_are_counted)
{
    scoped_scene s = scene_model(
        "{'drape': 1, 'cloth': [" LAYER ", " LAYER "], 'self_contact': {'thickness': 2e-3, 'friction': 0.2},"
        " 'contact': {'distance': 4e-3, 'friction': 'lagged'}, 'colliders': ["
        " {'type': 'box', 'center': [0.1,-0.1,-0.1], 'size': [0.2,0.2,0.2], 'friction': 0.4},"
        " {'type': 'plane', 'point': [0,-1,0], 'normal': [0,1,0]}], 'duration': 1}",
        0.0, 0.1);
    const drape_context_def def = s.ctx->def;
    drape_system *system = NULL;
    drape_arena arena = drape_arena_of(s.ctx), own = drape_arena_of(s.ctx);
    drape_state at;
    bool changed;
    ck_assert_int_eq(drape_state_create(&arena, s.model, &at), DRAPE_OK);
    for (int32_t i = s.model->cloths[1].first_node; i < s.model->node_count; i++)
        at.x[3 * (size_t)i + 1] = 2e-3;
    s.ctx->def.allocate = count_allocation;
    s.ctx->def.release = count_release;
    ck_assert_int_eq(drape_system_create(&own, s.model, 1, &system), DRAPE_OK);
    ck_assert_int_eq(drape_system_add_contact(system), DRAPE_OK);
    ck_assert_uint_eq(own.bytes, allocated);
    const size_t before = allocated;
    const drape_point point = {.x = at.x, .v = at.v, .internal = at.internal};
    ck_assert_int_eq(drape_system_begin(system, &at), DRAPE_OK);
    ck_assert_int_eq(drape_system_extend_pattern(system, &point, &changed), DRAPE_OK);
    ck_assert(changed);
    ck_assert_uint_gt(allocated, before);
    ck_assert_uint_eq(own.bytes, allocated);
    drape_system_destroy(&system);
    drape_arena_free(&own);
    ck_assert_uint_eq(allocated, 0);
    s.ctx->def = def;
    drape_arena_free(&arena);
}

/* The energy, pair by pair, without merging. */
typedef struct pairwise {
    const drape_model *model;
    const drape_broad_phase *broad;
    const double *x;
    double energy;
    int acting;
} pairwise;

static void add_energy(void *user, const drape_pair *found)
{
    pairwise *w = user;
    drape_pair pair = *found;
    drape_gap gap;
    const drape_configuration rest = {.model = w->model, .x = w->broad->rest},
                              now = {.model = w->model, .x = w->x};
    pair.distance = fmin(pair.distance, 0.5 * drape_pair_gap_value(&pair, &rest));
    if (!drape_pair_gap(&pair, &now, w->broad->rest, &gap))
        return;
    const drape_contact_law law = {.distance = pair.distance,
                                   .low = DRAPE_LEAST_GAP,
                                   .stiffness = w->model->contact.stiffness * pair.area *
                                                w->model->contact.distance / pair.distance};
    w->energy += drape_law_energy(&gap, &law);
    w->acting++;
}

/* An active contact that several pairs share is counted once, with the area of all. The sum of energies is
 * that of all pairs, up to the rounding of some hundred positive numbers, and there are fewer contacts than
 * pairs. */
TEST(active_contacts_are_all_pairs)
{
    scene s = scene_model("{'drape': 1, 'cloth': [" LAYER ", " LAYER "], 'self_contact': {'thickness': 2e-2},"
                          " 'contact': {'distance': 4e-3}, 'duration': 1}",
                          0.0, 0.1);
    scoped_probe t = open_probe(s, -0.08, 5);
    const drape_point point = {.x = t.at.x, .v = t.at.v, .internal = t.at.internal};
    drape_broad_phase broad;
    drape_arena arena = drape_arena_of(s.ctx);
    double gap;
    ck_assert_int_eq(drape_broad_phase_create(&arena, s.model, &broad), DRAPE_OK);
    pairwise w = {.model = s.model, .broad = &broad, .x = t.at.x};
    drape_broad_phase_pairs(&broad, &(drape_broad_query){.x = t.at.x}, add_energy, &w);
    const double merged = drape_system_contact_energy(t.system, &point);
    const int32_t contacts = drape_contact_active(drape_system_contact(t.system), &gap);
    printf("# %d pairs are %d active contacts: %.17g J, %.17g J\n", w.acting, (int)contacts, w.energy,
           merged);
    ck_assert_int_gt(2 * w.acting, 3 * contacts);
    ck_assert_double_gt(merged, 0);
    assert_below(fabs(merged / w.energy - 1), 1e-13);
    drape_arena_free(&arena);
}

/* A query between steps, for frames or for forces that a host reads, may make contact search at another
 * state. */
static void query(drape_sim *sim)
{
    const size_t n = 3 * (size_t)sim->model->node_count;
    const drape_state *now = drape_sim_state(sim);
    double *x = malloc(n * sizeof *x);
    ck_assert_ptr_nonnull(x);
    for (size_t i = 0; i < n; i++)
        x[i] = now->x[i] + 0.03;
    drape_system_contact_energy(sim->system,
                                &(drape_point){.x = x, .v = now->v, .t = now->t, .span = {0, now->t}});
    free(x);
}

static uint64_t collapse(bool watched)
{
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 9, 'rows': 15, 'width': 0.3, "
        "'height': 0.5, 'orientation': 'vertical', 'noise': 1e-3, "
        "'transform': {'rotate': [1, 0, 0, 8], 'translate': [0, 0.51, 0]}},"
        "'material': {'young_modulus': 1e5, 'thickness': 2e-3, 'density': 150}, 'terms': "
        "['stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 0.005}]}],"
        "'colliders': [{'type': 'plane', 'point': [0, 0, 0], 'normal': [0, 1, 0], 'friction': 0.5}],"
        "'contact': {'distance': 0.01}, 'self_contact': {'thickness': 0.004, 'friction': 0.3},"
        "'integrator': {'method': 'be', 'dt': 0.02, 'tolerance': 1e-5}, 'duration': 1}");
    for (int k = 1; k <= 18; k++) {
        scene_advance(&s, 0.02 * k);
        if (watched)
            query(s.sim);
    }
    const uint64_t hash = drape_sim_hash(s.sim);
    return hash;
}

TEST(queries_change_nothing)
{
    ck_assert(collapse(true) == collapse(false));
}
