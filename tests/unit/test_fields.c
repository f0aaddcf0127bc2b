/* test_fields.c: what frames have besides positions: strain, energy density, velocity. */
#include "support/scene.h"

#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 7, 'rows': 5, 'width': 0.6, 'height': "   \
    "0.4,"                                                                                                   \
    " 'transform': {'rotate': [1, 2, 0.5, 37]}}, 'material': {'young_modulus': 1e5, 'thickness': 1e-3,"      \
    " 'density': 200}, 'terms': [%s], 'pins': [{'corner': 'top-left'}]}], 'gravity': [0, %g, 0],"            \
    " 'integrator': {'dt': 0.01, 'tolerance': 1e-9}, 'duration': 1, 'frame_rate': %g}"

/* x = rest + G rest with a G of rank 3: the principal strains in the plane of the sheet follow from the
 * stretches of its two sides, which are orthogonal at rest. */
START_TEST(strain_is_that_of_the_deformation)
{
    const double G[3][3] = {{0.11, -0.23, 0.05}, {0.31, 0.07, -0.19}, {-0.13, 0.29, 0.17}};
    scene s = scene_model(SHEET, "'stretch.edge'", 0.0, 60.0);
    const double *rest = s.model->rest;
    int32_t nodes = s.model->node_count, triangles = s.model->triangle_count;
    double *x = calloc(3 * (size_t)nodes, sizeof *x), *strain = calloc(2 * (size_t)triangles, sizeof *strain);
    for (int32_t i = 0; i < nodes; i++)
        for (int r = 0; r < 3; r++) {
            x[3 * i + r] = rest[3 * i + r];
            for (int c = 0; c < 3; c++)
                x[3 * i + r] += G[r][c] * rest[3 * i + c];
        }
    drape_model_strain(s.model, x, strain);
    double along[2][3], c[3] = {0, 0, 0}; /* node 6 is the end of the first side, node 28 of the second */
    for (int k = 0; k < 3; k++) {
        along[0][k] = (x[3 * 6 + k] - x[k]) / 0.6;
        along[1][k] = (x[3 * 28 + k] - x[k]) / 0.4;
    }
    for (int k = 0; k < 3; k++) {
        c[0] += along[0][k] * along[0][k];
        c[1] += along[0][k] * along[1][k];
        c[2] += along[1][k] * along[1][k];
    }
    double spread = sqrt((c[0] - c[2]) * (c[0] - c[2]) / 4 + c[1] * c[1]);
    double largest = sqrt((c[0] + c[2]) / 2 + spread) - 1, least = sqrt((c[0] + c[2]) / 2 - spread) - 1;
    ck_assert(largest - least > 0.1);
    /* Edges are a sixth and a quarter of the sides: their rounding is larger by that, and by a few
     * operations. */
    for (int32_t t = 0; t < triangles; t++) {
        ck_assert_double_eq_tol(strain[2 * t], largest, 200 * DBL_EPSILON);
        ck_assert_double_eq_tol(strain[2 * t + 1], least, 200 * DBL_EPSILON);
    }
    drape_model_strain(s.model, rest, strain);
    for (int32_t t = 0; t < 2 * triangles; t++)
        ck_assert_double_eq_tol(strain[t], 0, 200 * DBL_EPSILON);
    free(x);
    free(strain);
    scene_close(&s);
}
END_TEST

/* Elements of two and of four nodes, a law, and a barrier. Sums of positive numbers in two orders: their
 * difference is at most the number of nodes times the rounding. */
START_TEST(energy_density_adds_up_to_the_elastic_energy)
{
    static const char *const terms[] = {
        "'stretch.edge'", "'stretch.edge', 'bend.hinge'",
        "{'type': 'spring.structural', 'stiffness': 500}, {'type': 'spring.bend', 'stiffness': 20}, "
        "{'type': 'drag.viscous', 'coefficient': 0.1}",
        "'stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 1e-3}, {'type': 'limit.strain', "
        "'limit': 0.1}"};
    for (int i = 0; i < 4; i++) {
        scene s = scene_open(SHEET, terms[i], -9.81, 60.0);
        double density[35], sum = 0;
        scene_advance(&s, 0.2);
        drape_sim_energy_density(s.sim, density);
        for (int k = 0; k < 35; k++) {
            ck_assert(density[k] >= 0);
            sum += density[k] * s.model->cloths[0].mesh.node_area[k];
        }
        double elastic = drape_sim_energy(s.sim).elastic;
        ck_assert(elastic > 0);
        ck_assert_double_eq_tol(sum, elastic, 100 * DBL_EPSILON * elastic);
        scene_close(&s);
    }
}
END_TEST

typedef struct falling {
    int frames, between;
} falling;

/* In free fall, the velocity of backward Euler is g t after every step, and so is its linear interpolation
 * between steps. */
static drape_status check_fall(void *user, const drape_event *event)
{
    falling *f = user;
    if (event->kind != DRAPE_EVENT_FRAME)
        return DRAPE_OK;
    f->frames++;
    f->between += event->positions != drape_sim_positions(event->sim);
    for (int32_t i = 0; i < drape_model_node_count(drape_sim_model(event->sim)); i++) {
        if (drape_model_pinned(drape_sim_model(event->sim))[i])
            continue;
        ck_assert_double_eq_tol(event->velocities[3 * i], 0, 1e-9);
        ck_assert_double_eq_tol(event->velocities[3 * i + 1], -9.81 * event->time, 1e-9);
        ck_assert_double_eq_tol(event->velocities[3 * i + 2], 0, 1e-9);
    }
    return DRAPE_OK;
}

START_TEST(frames_have_velocities)
{
    falling f = {0};
    scene s =
        scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 7, 'rows': 5, 'width': 0.6,"
                   " 'height': 0.4}, 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
                   " 'terms': []}], 'integrator': {'dt': 0.01, 'tolerance': 1e-12}, 'duration': 1,"
                   " 'frame_rate': %g}",
                   77.0);
    ck_assert_int_eq(drape_sim_observe(s.sim, check_fall, &f), DRAPE_OK);
    scene_advance(&s, 0.5);
    ck_assert_int_eq(f.frames, 39);
    ck_assert_int_gt(f.between, 30);
    scene_close(&s);
}
END_TEST

SUITE("fields", strain_is_that_of_the_deformation, energy_density_adds_up_to_the_elastic_energy,
      frames_have_velocities)
