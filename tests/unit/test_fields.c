/* test_fields.c: what frames have besides positions: energy density, velocity. */
#include "support/scene.h"

#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 7, 'rows': 5, 'width': 0.6, 'height': "   \
    "0.4,"                                                                                                   \
    " 'transform': {'rotate': [1, 2, 0.5, 37]}}, 'material': {'young_modulus': 1e5, 'thickness': 1e-3,"      \
    " 'density': 200}, 'terms': [%s], 'pins': [{'corner': 'top-left'}]}], 'gravity': [0, %g, 0],"            \
    " 'integrator': {'dt': 0.01, 'tolerance': 1e-9}, 'duration': 1, 'frame_rate': %g}"

/* Elements of two and of four nodes, a law, and a barrier. Sums of positive numbers in two orders: their
 * difference is at most the number of nodes times the rounding. */
TEST(energy_density_adds_up_to_the_elastic_energy)
{
    static const char *const terms[] = {
        "'stretch.edge'", "'stretch.edge', 'bend.hinge'",
        "{'type': 'spring.structural', 'stiffness': 500}, {'type': 'spring.bend', 'stiffness': 20}, "
        "{'type': 'drag.viscous', 'coefficient': 0.1}",
        "'stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 1e-3}, {'type': 'limit.strain', "
        "'limit': 0.1}"};
    for (int i = 0; i < 4; i++) {
        scoped_scene s = scene_open(SHEET, terms[i], -9.81, 60.0);
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
    }
}

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

TEST(frames_have_velocities)
{
    falling f = {0};
    scoped_scene s =
        scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 7, 'rows': 5, 'width': 0.6,"
                   " 'height': 0.4}, 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
                   " 'terms': []}], 'integrator': {'dt': 0.01, 'tolerance': 1e-12}, 'duration': 1,"
                   " 'frame_rate': %g}",
                   77.0);
    ck_assert_int_eq(drape_sim_observe(s.sim, check_fall, &f), DRAPE_OK);
    scene_advance(&s, 0.5);
    ck_assert_int_eq(f.frames, 39);
    ck_assert_int_gt(f.between, 30);
}
