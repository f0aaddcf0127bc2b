/* test_drag_spring.c: the spring by which a host drags a node. */
#include "sim/sim.h"
#include "support/scene.h"
#include "support/suite.h"

#include <math.h>
#include <string.h>

#define STIFFNESS 37.5

static const double target[3] = {0.4, 0.3, -0.2};

/* 16 nodes without pins and gravity; its format arguments are more keys and the method of the integrator. */
static const char sheet[] =
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 3, 'edge_length': 0.1},"
    " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
    " 'terms': ['stretch.edge', 'bend.hinge']%s}],"
    " 'gravity': [0, 0, 0], 'integrator': {'method': '%s', 'dt': 0.002, 'tolerance': 1e-10}, 'duration': 1}";

/* The spring adds k (x - target) to g of its node and k to the diagonal of its block, and nothing
 * elsewhere. Both are differences of sums that are equal except for one addition, so they are exact up to
 * the rounding of the larger sum. */
TEST(force_and_jacobian_are_those_of_a_spring)
{
    scoped_scene h = scene_open(sheet, "", "be");
    const drape_pattern *pattern = drape_system_pattern(h.sim->system);
    const drape_state *s = drape_sim_state(h.sim);
    const drape_point point = {.x = s->x, .v = s->v, .internal = s->internal};
    double *values[2], *g[2], largest = 0;
    for (int i = 0; i < 2; i++) {
        values[i] = calloc((size_t)pattern->nonzeros, sizeof **values);
        g[i] = calloc(3 * 16, sizeof **g);
        if (i)
            ck_assert_int_eq(drape_sim_set_drag_spring(h.sim, 7, STIFFNESS, target), DRAPE_OK);
        drape_system_jacobian(h.sim->system, &point, 1, 0, values[i]);
        drape_system_force(h.sim->system, &point, g[i]);
    }
    int64_t stride;
    int32_t j = h.model->free_of_node[7];
    double *block = drape_pattern_at(pattern, values[1], j, pattern->diagonal[j], &stride);
    for (int c = 0; c < 3; c++)
        block[c * stride + c] -= STIFFNESS;
    for (int64_t i = 0; i < pattern->nonzeros; i++) {
        largest = fmax(largest, fabs(values[0][i]));
        ck_assert(fabs(values[1][i] - values[0][i]) <= 4e-16 * (fabs(values[0][i]) + STIFFNESS));
    }
    ck_assert(largest > 0);
    for (size_t i = 0; i < 48; i++) {
        double want = i / 3 == 7 ? STIFFNESS * (s->x[i] - target[i % 3]) : 0;
        ck_assert(fabs(g[1][i] - g[0][i] - want) <= 4e-16 * (fabs(g[0][i]) + fabs(want)));
    }
    for (int i = 0; i < 2; i++) {
        free(values[i]);
        free(g[i]);
    }
}

/* Setting the spring is work of the host: the numerical loss does not change, and the elastic energy
 * changes by that of the spring, up to the rounding of a few joules. */
TEST(its_work_is_accounted)
{
    scoped_scene h = scene_open(sheet, "", "be");
    const double nowhere[3] = {0};
    double far = 0;
    for (int k = 0; k < 3; k++)
        far += pow(h.model->rest[3 * 5 + k] - target[k], 2);
    drape_energy before = drape_sim_energy(h.sim);
    ck_assert_int_eq(drape_sim_set_drag_spring(h.sim, 5, STIFFNESS, target), DRAPE_OK);
    drape_energy set = drape_sim_energy(h.sim);
    assert_below(fabs(set.elastic - before.elastic - STIFFNESS * far / 2), 1e-14);
    assert_below(fabs(set.numerical - before.numerical), 1e-14);
    ck_assert_int_eq(drape_sim_advance(h.sim, 0.02), DRAPE_OK);
    drape_energy moved = drape_sim_energy(h.sim);
    ck_assert_int_eq(drape_sim_set_drag_spring(h.sim, 5, 0, nowhere), DRAPE_OK);
    drape_energy gone = drape_sim_energy(h.sim);
    ck_assert(gone.elastic < moved.elastic);
    assert_below(fabs(gone.numerical - moved.numerical), 1e-14);
}

/* Several springs add k (x - target) each to g of their nodes, two on one node both, and the sum of the
 * forces is what drape_sim_drag_spring_force returns. A list of one is the spring of
 * drape_sim_set_drag_spring, to the bit of a step; an empty list leaves none. */
TEST(several_springs_add_up)
{
    scoped_scene h = scene_open(sheet, "", "be"), one = scene_open(sheet, "", "be");
    const int32_t nodes[] = {7, 3, 7, 12, 5};
    const double stiffness[] = {37.5, 12, 8.25, 100, 0},
                 targets[] = {0.4, 0.3, -0.2, 0, 0, 1, -1, 2, 0.5, 0.1, 0.1, 0.1, 9, 9, 9};
    const drape_state *s = drape_sim_state(h.sim);
    const drape_point point = {.x = s->x, .v = s->v, .internal = s->internal};
    double g[2][48], want[48] = {0}, force[3], sum[3] = {0};
    drape_system_force(h.sim->system, &point, g[0]);
    ck_assert_int_eq(drape_sim_set_drag_springs(h.sim, 5, nodes, stiffness, targets), DRAPE_OK);
    drape_system_force(h.sim->system, &point, g[1]);
    for (int i = 0; i < 5; i++)
        for (int k = 0; k < 3; k++) {
            const double f = stiffness[i] * (s->x[3 * nodes[i] + k] - targets[3 * i + k]);
            want[3 * nodes[i] + k] += f;
            sum[k] -= f;
        }
    for (int i = 0; i < 48; i++)
        ck_assert_double_eq_tol(g[1][i] - g[0][i], want[i], 1e-15 * (fabs(g[0][i]) + 100));
    drape_sim_drag_spring_force(h.sim, force);
    for (int k = 0; k < 3; k++)
        ck_assert_double_eq_tol(force[k], sum[k], 1e-13);
    ck_assert_int_eq(drape_sim_set_drag_springs(h.sim, 1, nodes, stiffness, targets), DRAPE_OK);
    ck_assert_int_eq(drape_sim_set_drag_spring(one.sim, nodes[0], stiffness[0], targets), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(h.sim, 0.004) | drape_sim_advance(one.sim, 0.004), DRAPE_OK);
    ck_assert(drape_sim_hash(h.sim) == drape_sim_hash(one.sim));
    const int32_t none[] = {7, 16};
    ck_assert_int_eq(drape_sim_set_drag_springs(h.sim, 2, none, stiffness, targets), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(drape_sim_set_drag_springs(h.sim, 65, nodes, stiffness, targets), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(drape_sim_set_drag_springs(h.sim, 1, nodes, NULL, targets), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(drape_sim_set_drag_springs(NULL, 0, NULL, NULL, NULL), DRAPE_E_ARGUMENT);
    drape_sim_drag_spring_force(h.sim, force);
    ck_assert_double_ne(force[0], 0); /* the refused lists left the spring */
    ck_assert_int_eq(drape_sim_set_drag_springs(h.sim, 0, NULL, NULL, NULL), DRAPE_OK);
    drape_sim_drag_spring_force(h.sim, force);
    ck_assert_double_eq(force[0], 0);
}
