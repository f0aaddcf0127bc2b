/*
 * test_spring.c: the terms spring.* and limit.strain against closed forms.
 *
 * Chains are vertical grids of 2 columns. Each column is a chain of structural springs; the springs between
 * them are neither stretched nor turned, since both move alike. The columns are 10 m apart, so that the
 * edges across, which are limited too, are not stretched by more than one per cent either.
 */
#include "drape/extend.h"
#include "support/scene.h"

#define CHAIN(mesh_rows, height)                                                                             \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'orientation': 'vertical', 'columns': 2,"            \
    "'width': 10, 'rows': " #mesh_rows ", 'height': " #height "},"                                           \
    "'pins': [{'row': 0}], 'material': {'young_modulus': 1, 'thickness': 1e-3, 'mass': 'uniform', "

/* ---- One spring ---- */

#define STIFFNESS 37.0 /* [N/m] */
#define NODE_MASS 0.25
#define SPEED     1.3
#define LENGTH    0.8

/* One node below each of two pinned ones, thrown downwards: along its spring q = l is linear, so m x'' + c
 * x' + k x = 0 exactly, at any amplitude below the length. */
static scene oscillator(double damping, const char *integrator)
{
    return scene_open(
        CHAIN(2, 0.8) "'total_mass': %g}, 'velocity': [0, %g, 0],"
                      "'terms': [{'type': 'spring.structural', 'stiffness': %g, 'damping': %.17g}]}],"
                      "'gravity': [0, 0, 0], 'integrator': {%s}, 'duration': 10}",
        4 * NODE_MASS, -SPEED, STIFFNESS, damping, integrator);
}

static double stretch(scene *s)
{
    return -scene_state(s)->x[3 * 2 + 1] - LENGTH;
}

/* Backward Euler, whose rate is a difference of lengths: v1 = (v0 - h w^2 x0)/(1 + h^2 w^2 + h c/m), x1 = x0
 * + h v1 exactly; and the dashpot takes c ((x1 - x0)/h)^2 h a step. A residual r moves x1 by r h^2/m at
 * most, and no step expands. */
TEST(backward_euler_takes_the_dashpot_in_step_form)
{
    const double c = 1.1, h = 0.03, tolerance = 1e-11, w2 = STIFFNESS / NODE_MASS;
    scoped_scene s = oscillator(c, "'dt': 0.03, 'tolerance': 1e-11");
    double x = 0, v = SPEED, diagnostic = 0, taken = 0;
    for (int n = 1; n <= 50; n++) {
        scene_advance(&s, n * h);
        v = (v - h * w2 * x) / (1 + h * h * w2 + h * c / NODE_MASS);
        x += h * v;
        taken += 2 * c * v * v * h; /* of both columns */
        diagnostic = fmax(diagnostic, fabs(stretch(&s) - x));
    }
    assert_below(diagnostic, 50 * h * h / NODE_MASS * (tolerance + force_noise(STIFFNESS + c / h, LENGTH)));
    /* relative to that of the first step, whose v has the same errors over h */
    assert_below(fabs(drape_sim_energy(s.sim).dissipated / taken - 1), 1e-9);
}

/* Implicit midpoint, whose rate is grad q . v: for a quadratic energy and a linear dashpot the energy and
 * the dissipation add up to the initial energy, up to the work of residuals of r over the path of the
 * nodes. */
TEST(midpoint_accounts_for_every_joule)
{
    const double tolerance = 1e-11;
    scoped_scene s = oscillator(1.1, "'method': 'midpoint', 'dt': 0.03, 'tolerance': 1e-11");
    const double start = 2 * 0.5 * NODE_MASS * SPEED * SPEED;
    double path = 0, before = 0;
    for (int n = 1; n <= 50; n++) {
        scene_advance(&s, n * 0.03);
        path += 2 * fabs(stretch(&s) - before);
        before = stretch(&s);
    }
    const drape_energy e = drape_sim_energy(s.sim);
    ck_assert_double_gt(e.dissipated, 0.9 * start);
    assert_below(fabs(e.kinetic + e.elastic + e.dissipated - start),
                 path * (tolerance + force_noise(STIFFNESS, LENGTH)) + 50 * 8 * DBL_EPSILON * start);
}

/* ---- A chain that hangs ---- */

#define ROWS 9 /* nodes of a chain, the first held */

/* Spring j, from row j to j + 1, carries the weight below: (ROWS - 1 - j) m g. Its constant is k times the
 * mean of both ends' 1 + G (1 - row/ROWS). Residuals of at most r in every node shift a node by the sum
 * over the springs above it of (ROWS - 1) r/k. */
TEST(chain_hangs_with_its_gradient)
{
    static const double gradients[] = {0, 0.4, -0.9};
    const double k = 200, g = 9.81, m = 0.05, tolerance = 1e-10;
    for (size_t i = 0; i < sizeof gradients / sizeof *gradients; i++) {
        scoped_scene s = scene_open(
            CHAIN(9, 1.6) "'total_mass': %.17g},"
                          "'terms': [{'type': 'spring.structural', 'stiffness': 2000, 'factor': 0.1,"
                          "'gradient': %g}]}], 'gravity': [0, %g, 0],"
                          "'integrator': {'method': 'static', 'tolerance': %g}, 'duration': 1}",
            2 * ROWS * m, gradients[i], -g, tolerance);
        scene_advance(&s, 1);
        double y = 0, diagnostic = 0, least = INFINITY;
        for (int j = 0; j + 1 < ROWS; j++) {
            const double kj = k * (1 + gradients[i] * (1 - (j + 0.5) / ROWS));
            y -= 0.2 + (ROWS - 1 - j) * m * g / kj;
            least = fmin(least, kj);
            for (int column = 0; column < 2; column++)
                diagnostic = fmax(diagnostic, fabs(scene_state(&s)->x[3 * (2 * (j + 1) + column) + 1] - y));
        }
        assert_below(diagnostic, ROWS * (ROWS * tolerance + force_noise(k, 2)) / least);
    }
}

/* ---- Newton's third law ---- */

/* r rows and c columns: r (c - 1) + (r - 1) c structural, 2 (r - 1)(c - 1) shear, r (c - 2) + (r - 2) c
 * bend springs, each with its own length. The 14 502 springs of CS184's 50 x 50 points are these. */
TEST(springs_join_the_right_nodes)
{
    static const char *const kinds[] = {"spring.structural", "spring.shear", "spring.bend"};
    scoped_scene s =
        scene_model("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 50, 'rows': 50,"
                    "'width': 98, 'height': 49},"
                    "'material': {'young_modulus': 1, 'thickness': 1e-3, 'total_mass': 1},"
                    "'terms': [{'type': 'spring.structural', 'stiffness': 1},"
                    "{'type': 'spring.shear', 'stiffness': 1}, {'type': 'spring.bend', 'stiffness': 1, "
                    "'rest_scale': 0.5}]}],"
                    "'gravity': [0, 0, 0], 'duration': 1}");
    const double lengths[3][2] = {{2, 1}, {sqrt(5), sqrt(5)}, {0.5 * 4, 0.5 * 2}};
    int32_t total = 0;
    for (int t = 0; t < 3; t++) {
        const drape_elements *el = &s.model->terms[t].elements;
        ck_assert_str_eq(s.model->terms[t].ops->entry.name, kinds[t]);
        for (int32_t e = 0; e < el->count; e++) {
            const double length = el->rest[el->count + e];
            ck_assert(fabs(length - lengths[t][0]) < 1e-12 || fabs(length - lengths[t][1]) < 1e-12);
        }
        total += el->count;
    }
    ck_assert_int_eq(total, 14502);
    ck_assert(!s.model->has_dissipation && !s.model->has_laws); /* dashpots of 0 cost nothing */
}

/* ---- The strain limit ---- */

static double barrier_slope(double y)
{
    return -2 * y * log(1 - y) + y * y / (1 - y);
}

/* A node on a spring and a limit hangs where m g = k L s + K L w b'(y), s = onset + w y: for a chosen y,
 * the weight is set to match. A residual r moves it by r over a stiffness above k. */
TEST(limit_balances_its_load)
{
    static const double windows[] = {-0.5, 1e-3, 0.3, 0.7, 0.97, 0.989};
    const double k = 3, big_k = 90, limit = 0.2, onset = limit / 2, w = limit - onset, tolerance = 1e-8;
    for (size_t i = 0; i < sizeof windows / sizeof *windows; i++) {
        const double y = windows[i], strain = onset + w * y;
        const double load = k * LENGTH * strain + (y > 0 ? big_k * LENGTH * w * barrier_slope(y) : 0);
        scoped_scene s =
            scene_open(CHAIN(2, 0.8) "'total_mass': %g}, 'terms': [{'type': 'spring.structural',"
                                     "'stiffness': %g}, {'type': 'limit.strain', 'limit': %g,"
                                     "'stiffness': %g}]}], 'gravity': [0, %.17g, 0],"
                                     "'integrator': {'method': 'static', 'tolerance': %g}, 'duration': 1}",
                       4 * NODE_MASS, k, limit, big_k, -load / NODE_MASS, tolerance);
        scene_advance(&s, 1);
        assert_below(fabs(stretch(&s) - LENGTH * strain), (tolerance + force_noise(k, 1)) / k);
    }
}

/* b and its first two derivatives on both sides of the onset and of the cap, by the energy of one element:
 * they differ by no more than the next derivative, b''' <= 6 at the onset and about 2/cap^3 at the cap,
 * times the distance. */
TEST(limit_is_smooth_twice)
{
    scoped_scene s =
        scene_model(CHAIN(2, 1) "'total_mass': 1}, 'terms': [{'type': 'limit.strain', 'stiffness': 1,"
                                "'limit': 2}]}],"
                                "'gravity': [0, 0, 0], 'duration': 1}");
    const drape_term *term = &s.model->terms[0];
    static const double at[] = {0, 0.99};
    static const double third[] = {7, 3e6}; /* 2/cap^3 and lower powers of 1/cap */
    const double d = 1e-6;
    int32_t vertical = 0; /* an edge of length 1, from node 0 to 2 */
    while (term->elements.node[2 * vertical] != 0 || term->elements.node[2 * vertical + 1] != 2)
        vertical++;
    for (size_t i = 0; i < 2; i++) {
        double e[2], g[2][6], h[2][36];
        for (int side = 0; side < 2; side++) {
            double x[12] = {0};
            x[3 * 2 + 1] = -(2 + at[i] + (side ? d : -d)); /* y = l - 2 */
            term->ops->energy(&term->elements, vertical, 1, x, NULL, &e[side], g[side], h[side]);
        }
        const double curve = fabs(h[0][7]) + 2 * d * third[i];
        assert_below(fabs(e[1] - e[0] - 2 * d * g[0][1]), 2 * d * d * curve + 1e-15);
        assert_below(fabs(g[1][1] - g[0][1]), 2 * d * curve);
        assert_below(fabs(h[1][7] - h[0][7]), 2 * d * third[i]);
        ck_assert(i == 0 || h[0][7] > 100); /* the second derivatives compared are not 0 */
    }
}

/* CS184's pinned2 with 9 x 9 points: ks 5000, bend 0.2 ks, hanging by two corners, backward Euler at 1/30
 * s. */
static scene hung_sheet(double gravity, const char *limit)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 9, 'rows': 9, 'width': 1,"
        "'height': 1}, 'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}],"
        "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'total_mass': 150},"
        "'terms': [{'type': 'spring.structural', 'stiffness': 5000},"
        "{'type': 'spring.shear', 'stiffness': 5000},"
        "{'type': 'spring.bend', 'stiffness': 5000, 'factor': 0.2}%s]}],"
        "'gravity': [0, %g, 0], 'integrator': {'dt': 0.03333333333333333, 'tolerance': 1e-4},"
        "'duration': 2}",
        limit, gravity);
}

static double largest_strain(const scene *s, const drape_elements *pairs)
{
    const double *x = drape_sim_positions(s->sim);
    double max = -1;
    for (int32_t e = 0; e < pairs->count; e++) {
        const double *a = x + 3 * pairs->node[2 * e], *b = x + 3 * pairs->node[2 * e + 1];
        const double length = sqrt(pow(b[0] - a[0], 2) + pow(b[1] - a[1], 2) + pow(b[2] - a[2], 2));
        max = fmax(max, length / pairs->rest[pairs->count + e] - 1);
    }
    return max;
}

/* With the default stiffness, which is derived from the weight at 9.8 m/s2, a hundredfold load keeps every
 * spring below 10 %; without the limit the sheet exceeds it at once. */
TEST(limit_holds_a_hundredfold_load)
{
    static const double loads[] = {-9.8, -980};
    char limit[128];
    for (size_t i = 0; i < sizeof loads / sizeof *loads; i++) {
        /* 150 kg 9.8 m/s2 over 0.05 and the mean length of the springs, some 0.16 m */
        snprintf(limit, sizeof limit, ", {'type': 'limit.strain', 'over': 'springs'%s}",
                 i ? ", 'stiffness': 183000" : "");
        scoped_scene s = hung_sheet(loads[i], limit), without = hung_sheet(loads[i], "");
        const drape_elements *pairs = &s.model->terms[3].elements;
        double max = 0, most_without = 0;
        for (int frame = 1; frame <= 60; frame++) {
            scene_advance(&s, frame / 30.0);
            max = fmax(max, largest_strain(&s, pairs));
        }
        for (int frame = 1; frame <= 20; frame++) {
            scene_advance(&without, frame / 30.0);
            most_without = fmax(most_without, largest_strain(&without, pairs));
        }
        printf("# strain %g without, %g with\n", most_without, max);
        assert_below(max, 0.1);
        ck_assert_double_gt(most_without, 0.1);
    }
}

/* If the load exceeds the force of the barrier below its limit, about 2/cap K L w, no state beyond the
 * limit is accepted: the steps become small, and the message gives the reason. */
TEST(overload_stops_with_the_reason)
{
    scoped_scene s =
        scene_open(CHAIN(2, 0.8) "'total_mass': 1}, 'terms': [{'type': 'limit.strain', 'stiffness': "
                                 "0.02}]}], 'gravity': [0, -9.8, 0], 'integrator': {'dt': 0.01},"
                                 "'controller': {'type': 'halving', 'dt_min': 1e-3}, 'duration': 2}");
    const drape_status status = drape_sim_advance(s.sim, 2);
    ck_assert_int_eq(status, DRAPE_E_STEP_TOO_SMALL);
    ck_assert_msg(strstr(drape_context_message(s.ctx), "strain of a limited edge"), "%s",
                  drape_context_message(s.ctx));
    ck_assert_double_le(largest_strain(&s, &s.model->terms[0].elements), 0.1);
}

/* ---- Degeneration ---- */

/* A spring of length 0 has no direction: the state is rejected and the spring named. Just above the bound
 * all is finite. */
TEST(collapsed_spring_is_named)
{
    scoped_scene s = oscillator(0.5, "'dt': 0.01");
    drape_state *state = scene_state(&s);
    drape_reason reason = DRAPE_REASON_CONVERGED;
    drape_diagnostic diagnostic;
    double g[12];
    memcpy(state->x + 6, state->x, 6 * sizeof *state->x);
    ck_assert_int_eq(drape_system_check(s.sim->system, state->x, NULL, NULL, &reason, &diagnostic),
                     DRAPE_RETRY_DEGENERATE);
    ck_assert_int_eq(reason, DRAPE_REASON_SPRING_COLLAPSE);
    ck_assert_str_eq(diagnostic.term, "spring.structural");
    ck_assert(diagnostic.node[0] == 0 && diagnostic.node[1] == 2);
    state->x[7] -= 1e-5;
    state->x[10] -= 1e-5;
    ck_assert_int_eq(drape_system_check(s.sim->system, state->x, NULL, NULL, &reason, &diagnostic), DRAPE_OK);
    drape_system_force(s.sim->system, &(drape_point){.x = state->x, .v = state->v}, g);
    for (int i = 0; i < 12; i++)
        ck_assert(isfinite(g[i]));
    /* The spring pushes down, the dashpot up; of numbers below 1, 1e-5 m are left. */
    assert_below(fabs(g[7] - STIFFNESS * (LENGTH - 1e-5) + 0.5 * SPEED) / g[7], 4 * DBL_EPSILON / 1e-5);
}
