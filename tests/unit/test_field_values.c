/* test_field_values.c: the fields of a moment at each node, against closed forms. */
#include "fields/fields.h"
#include "support/scene.h"
#include "support/suite.h"

#include <math.h>
#include <string.h>

static const char sheet[] = "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 6, 'rows': 4, "
                            "'width': 0.5, 'height': 0.3},"
                            " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
                            " 'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'nodes': [0]}]}],"
                            " 'gravity': [0, -9.81, 0], 'integrator': {'method': '%s', 'dt': 0.01, "
                            "'tolerance': 1e-6}, 'duration': 1%s}";

#define NODES 24

static double values[NODES];

static drape_status measure(scene *h, const char *name, const double *x)
{
    const int i = drape_registry_find(&drape_field_registry, NULL, name);
    ck_assert_msg(i >= 0, "there is no field %s", name);
    return drape_fields[i]->measure(h->sim, x, values);
}

/* Under x -> (1.04 x, 0.97 z), sheared and rotated, the largest principal strain is that of the matrix: for
 * F = R [a s; 0 b] it is ((a + b)^2 + s^2)^1/2 / 2 + ((a - b)^2 + s^2)^1/2 / 2 - 1 in every triangle, and
 * so at every node, up to the rounding of squares of numbers near 1. */
TEST(strain_of_a_homogeneous_stretch_is_exact)
{
    scoped_scene h = scene_open(sheet, "be", "");
    const double a = 1.04, b = 0.97, s = 0.03, turn = 0.7;
    double want = 0.5 * (hypot(a + b, s) + hypot(a - b, s)) - 1, x[3 * NODES], worst = 0;
    for (int i = 0; i < NODES; i++) {
        const double *r = h.model->rest + 3 * i;
        double u = a * r[0] + s * r[2], w = b * r[2];
        x[3 * i] = u;
        x[3 * i + 1] = 0.3 + sin(turn) * w;
        x[3 * i + 2] = cos(turn) * w;
    }
    ck_assert_int_eq(measure(&h, "strain", x), DRAPE_OK);
    for (int i = 0; i < NODES; i++)
        worst = fmax(worst, fabs(values[i] - want));
    assert_below(worst, 1e-14);
}

/* Density times area sums to the elastic energy of the sim, and no density is negative. Sums of 24 and of
 * some hundred positive numbers in two orders agree to 1e-13. */
TEST(energy_density_sums_to_the_energy)
{
    scoped_scene h = scene_open(sheet, "be", "");
    double sum = 0;
    ck_assert_int_eq(drape_sim_advance(h.sim, 0.2), DRAPE_OK);
    ck_assert_int_eq(measure(&h, "energy", drape_sim_positions(h.sim)), DRAPE_OK);
    for (int i = 0; i < NODES; i++) {
        ck_assert(values[i] >= 0);
        sum += values[i] * h.model->cloths[0].mesh.node_area[i];
    }
    double elastic = drape_sim_energy(h.sim).elastic;
    ck_assert(elastic > 1e-6);
    assert_below(fabs(sum - elastic), 1e-13 * elastic);
}

TEST(velocity_is_the_speed)
{
    scoped_scene h = scene_open(sheet, "be", "");
    ck_assert_int_eq(drape_sim_advance(h.sim, 0.1), DRAPE_OK);
    ck_assert_int_eq(measure(&h, "velocity", drape_sim_positions(h.sim)), DRAPE_OK);
    for (int i = 0; i < NODES; i++) {
        const double *v = drape_sim_velocities(h.sim) + 3 * i;
        ck_assert(fabs(values[i] - sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])) <= 1e-16 * values[i]);
    }
    ck_assert(values[0] == 0 && values[NODES - 1] > 0.1);
}

static drape_status keep_residual(void *user, const drape_event *event)
{
    if (event->kind == DRAPE_EVENT_ATTEMPT && event->attempt->accepted)
        *(double *)user = event->attempt->residual;
    return DRAPE_OK;
}

/* The step log has the largest component; a node's vector is between that and sqrt(3) of it. An integrator
 * that solves no equations reports that there is no residual. */
TEST(residual_is_that_of_the_last_step)
{
    scoped_scene h = scene_open(sheet, "be", "");
    double logged = -1, largest = 0;
    ck_assert_int_eq(drape_sim_observe(h.sim, keep_residual, &logged), DRAPE_OK);
    ck_assert_int_eq(measure(&h, "residual", drape_sim_positions(h.sim)), DRAPE_OK);
    ck_assert(values[5] == 0); /* there is no residual before the first step */
    ck_assert_int_eq(drape_sim_advance(h.sim, 0.05), DRAPE_OK);
    ck_assert_int_eq(measure(&h, "residual", drape_sim_positions(h.sim)), DRAPE_OK);
    for (int i = 0; i < NODES; i++)
        largest = fmax(largest, values[i]);
    ck_assert(logged > 0);
    ck_assert(largest >= logged * (1 - 1e-15) && largest <= sqrt(3) * logged * (1 + 1e-15));
    scene_close(&h);
    h = scene_open(sheet, "verlet", "");
    ck_assert_int_eq(measure(&h, "residual", drape_sim_positions(h.sim)), DRAPE_E_ARGUMENT);
    ck_assert_str_eq(drape_context_message(h.ctx),
                     "residual: the integrator \"verlet\" does not solve its steps by Newton's method");
}

/* The floor carries the sheet: contact forces on it are vertical, so their sizes add up to the weight of
 * the free nodes. The share that the pin takes by bending, and the motion left after 3 s, are below a
 * hundredth of it. */
TEST(contact_forces_carry_the_weight)
{
    scoped_scene h =
        scene_open(sheet, "be",
                   ", 'colliders': [{'type': 'plane', 'point': [0, -0.002, 0], 'normal': [0, 1, 0]}],"
                   " 'contact': {'distance': 0.005}");
    double force = 0, weight = 0;
    assert_ok(h.ctx, drape_sim_advance(h.sim, 3));
    ck_assert_int_eq(measure(&h, "contact", drape_sim_positions(h.sim)), DRAPE_OK);
    for (int i = 1; i < NODES; i++) { /* node 0 is pinned near the floor */
        force += values[i];
        weight += 9.81 * h.model->mass[i];
    }
    printf("# forces %.6g N, weight %.6g N\n", force, weight);
    ck_assert(force > 0.99 * weight && force < 1.01 * weight); /* the pin takes a share by bending */
    scene_close(&h);
    h = scene_open(sheet, "verlet",
                   ", 'colliders': [{'type': 'plane', 'point': [0, -1, 0], 'normal': [0, 1, 0]}]");
    ck_assert_int_eq(measure(&h, "contact", drape_sim_positions(h.sim)), DRAPE_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(drape_context_message(h.ctx), "resolves contact by moving nodes"));
}
