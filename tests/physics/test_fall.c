/*
 * test_fall.c: exact properties of backward Euler for any forces within the sheet: these have no resultant
 * and no moment, and those of damping vanish in rigid motion.
 *
 * Bounds come from two sources: residuals r that the attempts report, and round-off of the forces
 * (force_noise).
 */
#include "support/scene.h"

#define EDGES     4
#define LENGTH    0.1
#define MODULUS   1e4
#define THICKNESS 1e-3
#define GRAVITY   9.81
#define STEP      0.01
#define BETA      0.013

static const double spring = 0.8660254037844386 * MODULUS * THICKNESS; /* of an inner edge [N/m] */

/* A free sheet with all kinds of internal forces. terms: more terms, each followed by a comma. */
static scene sheet(const char *terms, double gravity, const char *velocity)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': %d, 'edge_length': %g},"
        "'material': {'young_modulus': %g, 'thickness': %g, 'areal_density': 0.5},"
        "'terms': [%s 'stretch.edge', 'bend.hinge'], 'velocity': %s}],"
        "'gravity': [0, %.17g, 0], 'integrator': {'dt': %g, 'tolerance': 1e-12}, 'duration': 1}",
        EDGES, LENGTH, MODULUS, THICKNESS, terms, velocity, -gravity, STEP);
}

static const char damping[] = "{'type': 'damp.kelvin_voigt', 'beta': 0.013},";

/* Numbers in [-1, 1], the same in every run. */
static double wobble(size_t i)
{
    return sin(1.7 * (double)i + 0.3) * cos(0.9 * (double)(i * i % 101));
}

/* Moves nodes by up to a, and gives them velocities of up to b m/s, in all directions. */
static void shake(scene *s, double a, double b)
{
    drape_state *state = scene_state(s);
    for (size_t i = 0; i < 3 * (size_t)s->model->node_count; i++) {
        state->x[i] += a * wobble(i);
        state->v[i] += b * wobble(i + 1000);
    }
}

static void momentum(scene *s, double p[3])
{
    const drape_state *state = scene_state(s);
    memset(p, 0, 3 * sizeof *p);
    for (size_t i = 0; i < 3 * (size_t)s->model->node_count; i++)
        p[i % 3] += s->model->mass[i / 3] * state->v[i];
}

/* sum m a x v */
static void moment(const scene *s, const double *a, const double *v, double l[3])
{
    memset(l, 0, 3 * sizeof *l);
    for (size_t i = 0; i < (size_t)s->model->node_count; i++, a += 3, v += 3)
        for (int k = 0; k < 3; k++)
            l[k] += s->model->mass[i] * (a[(k + 1) % 3] * v[(k + 2) % 3] - a[(k + 2) % 3] * v[(k + 1) % 3]);
}

static double total_mass(const scene *s)
{
    double m = 0;
    for (int32_t i = 0; i < s->model->node_count; i++)
        m += s->model->mass[i];
    return m;
}

/* Rotates by `angle` about an axis without symmetry; out may be in. */
static void turn(size_t nodes, const double *in, double angle, double *out)
{
    const double u[3] = {2.0 / 7, 3.0 / 7, 6.0 / 7}, c = cos(angle), s = sin(angle);
    for (size_t i = 0; i < nodes; i++, in += 3, out += 3) {
        const double a[3] = {in[0], in[1], in[2]}, along = u[0] * a[0] + u[1] * a[1] + u[2] * a[2];
        for (int k = 0; k < 3; k++) {
            const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
            out[k] = c * a[k] + s * (u[k1] * a[k2] - u[k2] * a[k1]) + (1 - c) * along * u[k];
        }
    }
}

static double largest(const double *a, size_t n)
{
    double max = 0;
    for (size_t i = 0; i < n; i++)
        max = fmax(max, fabs(a[i]));
    return max;
}

/*
 * Damping forces at a rigidly rotated state of a bent and stretched sheet. Both forms of the rate are zero
 * up to round-off: v = omega x x in continuous time, and q(x1) = q(x0) between two rotated states in a
 * step. Bound: an edge's rate is wrong by the round-off of a velocity over L, a hinge's by the same times
 * |grad theta| <= 4/H, and the forces are beta k times |grad q| times that: springs 6 beta K, hinges 12 a
 * node, beta D-like k_b (4/H)^2, H >= L/2 here. The same speeds along the strain give forces of beta K v:
 * the last assertion shows that the test would detect them.
 */
TEST(turning_cloth_does_not_feel_its_damping)
{
    enum { NODES = (EDGES + 1) * (EDGES + 1) };
    scoped_scene s = sheet(damping, 0, "[0, 0, 0]");
    double bent[3 * NODES], x0[3 * NODES], x1[3 * NODES], v[3 * NODES], g[3 * NODES], history[256];
    const double omega = 5, speed = omega * 1.0; /* nodes are within 1 m of the axis */
    const double bending = 2 / sqrt(3.0) * MODULUS * pow(THICKNESS, 3) / 12 * 9 / 8;
    const double stiff = 6 * spring + 12 * bending * pow(4 / (LENGTH / 2), 2);
    const drape_state *state = scene_state(&s);
    ck_assert(s.model->measure_count <= 256 && s.model->node_count == NODES);
    shake(&s, 0.15 * LENGTH, 0);
    memcpy(bent, state->x, sizeof bent);
    turn(NODES, bent, 0.7, x0);
    /* v = d/dt of the rotation: a further quarter turn of the part normal to the axis */
    const double u[3] = {2.0 / 7, 3.0 / 7, 6.0 / 7};
    for (int i = 0; i < NODES; i++)
        for (int k = 0; k < 3; k++) {
            const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
            v[3 * i + k] = omega * (u[k1] * x0[3 * i + k2] - u[k2] * x0[3 * i + k1]) + wobble((size_t)k);
        }
    drape_system_dissipation(s.sim->system, &(drape_point){.x = x0, .v = v, .internal = state->internal}, 0,
                             g);
    assert_below(largest(g, 3 * NODES), BETA * stiff * 16 * DBL_EPSILON * (speed + 1));

    turn(NODES, bent, 0.7 + omega * STEP, x1);
    drape_system_measures(s.sim->system, &(drape_point){.x = x0, .internal = state->internal}, history);
    for (int64_t i = 0; i < s.model->measure_count; i++)
        history[i] /= -STEP;
    const drape_point step = {
        .x = x1, .v = v, .internal = state->internal, .weight = 1 / STEP, .history = history};
    drape_system_dissipation(s.sim->system, &step, 0, g);
    assert_below(largest(g, 3 * NODES), BETA * stiff * 16 * DBL_EPSILON * 1.0 / STEP);

    for (int i = 0; i < 3 * NODES; i++)
        v[i] = i % 3 == 0 ? omega * x0[i] : 0; /* a stretching */
    drape_system_dissipation(s.sim->system, &(drape_point){.x = x0, .v = v, .internal = state->internal}, 0,
                             g);
    ck_assert(largest(g, 3 * NODES) > 0.1 * BETA * spring * omega * LENGTH);
}

/* P' = sum of residuals: besides M g t, n steps change the momentum by at most n h nodes r in each
 * direction. */
TEST(linear_momentum_is_conserved)
{
    const int steps = 40;
    scoped_scene s = sheet(damping, GRAVITY, "[0.3, -0.2, 0.1]");
    double before[3], after[3];
    shake(&s, 0.1 * LENGTH, 1);
    scene_watch(&s);
    momentum(&s, before);
    scene_advance(&s, steps * STEP);
    momentum(&s, after);
    before[1] -= total_mass(&s) * GRAVITY * steps * STEP;
    const double r = s.residual + (1 + BETA / STEP) * force_noise(spring, 1.5);
    for (int k = 0; k < 3; k++)
        assert_below(fabs(after[k] - before[k]), s.accepted * STEP * s.model->node_count * r);
}

/* L1 = L0 + h sum m v1 x v0, since x1 x v1 = x1 x v0 + x1 x (v1 - v0), x1 = x0 + h v1, and internal forces
 * have no moment about any point. Residuals add h sum x1 x r: 2 h size nodes r. */
TEST(angular_momentum_of_backward_euler)
{
    const int steps = 40;
    scoped_scene s = sheet(damping, 0, "[0.3, -0.2, 0.1]");
    enum { NODES = (EDGES + 1) * (EDGES + 1) };
    double v0[3 * NODES], l0[3], l1[3], cross[3], worst = 0, change = 0;
    shake(&s, 0.1 * LENGTH, 1);
    scene_watch(&s);
    for (int n = 1; n <= steps; n++) {
        memcpy(v0, scene_state(&s)->v, sizeof v0);
        moment(&s, scene_state(&s)->x, v0, l0);
        scene_advance(&s, n * STEP);
        moment(&s, scene_state(&s)->x, scene_state(&s)->v, l1);
        moment(&s, scene_state(&s)->v, v0, cross);
        for (int k = 0; k < 3; k++) {
            worst = fmax(worst, fabs(l1[k] - l0[k] - STEP * cross[k]));
            change = fmax(change, fabs(l1[k] - l0[k]));
        }
    }
    ck_assert_int_eq(s.accepted, steps); /* h is STEP throughout */
    const double r = s.residual + (1 + BETA / STEP) * force_noise(spring, 1.5);
    assert_below(worst, 2 * STEP * 1.5 * NODES * r);
    ck_assert(change > 1e3 * worst); /* it is not conserved: the term matters */
}
