/*
 * test_starved.c: bodies that a host moves on while steps take too long. Budgets here are never kept (a
 * nanosecond): each call makes one attempt, and drops the time that it does not make.
 */
#include "support/scene.h"
#include <stdlib.h>

#define PLENTY  3600.0 /* [s] */
#define NOTHING 1e-9
#define FRAME   0.2  /* [s] twelve nominal steps, of which a call makes at most four */
#define SPEED   1.0  /* [m/s] */
#define EXACT   1e-9 /* [m] rounding of some hundred positions of metres */

static drape_realtime advance(scene *s, double frame)
{
    drape_realtime report;
    assert_ok(s->ctx, drape_sim_advance_realtime(s->sim, frame, NOTHING, &report));
    return report;
}

static double largest_strain(const scene *s)
{
    const double *x = drape_sim_positions(s->sim);
    double largest = 0;
    for (int32_t e = 0; e < s->model->edge_count; e++) {
        const int32_t *n = s->model->edge + 2 * (size_t)e;
        double square = 0;
        for (size_t k = 0; k < 3; k++)
            square += pow(x[3 * (size_t)n[0] + k] - x[3 * (size_t)n[1] + k], 2);
        largest = fmax(largest, sqrt(square) / s->model->edge_length[e] - 1);
    }
    return largest;
}

#define FLAG                                                                                                 \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 9, 'rows': 9, 'width': 0.5, 'height': "   \
    "0.5, 'orientation': 'vertical'}, 'material': {'young_modulus': 968246, 'thickness': 1.0328e-3, "        \
    "'areal_density': 0.2}, 'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'row': 0}]}],"                \
    "'colliders': [{'type': 'sphere', 'center': [0, 0, 3], 'radius': 0.2}, {'type': 'sphere', 'center': "    \
    "[0, 0, -3], 'radius': 0.2}], 'integrator': {'method': 'newton_k'}, 'duration': 4}"

/* The host's frames are several times as long as the steps that are made of them. Pins that go at a steady
 * speed go at that speed in each step nevertheless: what was dropped, the whole cloth makes at once, with the
 * body that goes with the pins. The other body, which rests, stays. */
TEST(pins_take_the_cloth_along)
{
    scoped_scene s = scene_open(FLAG);
    double debt = 0, pins[27];
    int32_t row[9];
    for (int32_t i = 0; i < 9; i++)
        row[i] = i;
    for (int k = 1; k <= 20; k++) {
        const double to[3] = {SPEED * FRAME * k, 0, 0}, t = drape_sim_time(s.sim);
        double v[3], at[3];
        for (int i = 0; i < 9; i++) {
            memcpy(pins + 3 * (size_t)i, s.model->start + 3 * (size_t)i, 3 * sizeof *pins);
            pins[3 * i] += to[0];
        }
        ck_assert_int_eq(drape_sim_move_pins(s.sim, 9, row, FRAME + debt, pins, NULL), DRAPE_OK);
        ck_assert_int_eq(drape_sim_move_collider(s.sim, 0, FRAME + debt, to, NULL), DRAPE_OK);
        const drape_realtime r = advance(&s, FRAME);
        debt = r.debt;
        drape_motion_pin_velocity(drape_system_motion(s.sim->system), 0, t, t, v);
        ck_assert_double_eq_tol(v[0], SPEED, EXACT / FRAME);
        ck_assert_int_eq(r.attempts, 1);
        drape_motion_collider(drape_system_motion(s.sim->system), 0, drape_sim_time(s.sim), at);
        ck_assert_double_eq_tol(drape_sim_positions(s.sim)[0] - s.model->start[0], at[0], EXACT);
        /* what is owed, and what this frame dropped */
        ck_assert_double_eq_tol(to[0] - at[0], SPEED * (r.debt + r.dropped), EXACT);
        drape_motion_collider(drape_system_motion(s.sim->system), 1, drape_sim_time(s.sim), at);
        ck_assert_double_eq(at[0], 0);
    }
    ck_assert_double_lt(largest_strain(&s), 0.03);
}

/* A body that goes past cloth at rest goes at no more than one and a half times its speed (HURRY), and what
 * it is behind is reported; when there is time again it is where it is sent, after a while. */
TEST(bodies_do_not_catch_up_at_once)
{
    scoped_scene s = scene_open(FLAG);
    double debt = 0, most = 0;
    for (int k = 1; k <= 60; k++) {
        const double to[3] = {0, SPEED * FRAME * k, 0}, t = drape_sim_time(s.sim);
        double v[3], at[3];
        ck_assert_int_eq(drape_sim_move_collider(s.sim, 0, FRAME + debt, to, NULL), DRAPE_OK);
        drape_realtime r;
        ck_assert_int_eq(drape_sim_advance_realtime(s.sim, FRAME, k <= 5 ? NOTHING : PLENTY, &r), DRAPE_OK);
        debt = r.debt;
        drape_motion_collider_velocity(drape_system_motion(s.sim->system), 0, t, t, v);
        ck_assert_double_le(v[1], 1.5 * SPEED + EXACT / FRAME);
        drape_motion_collider(drape_system_motion(s.sim->system), 0, drape_sim_time(s.sim), at);
        ck_assert_double_eq_tol(to[1] - at[1], SPEED * (r.debt + r.behind), EXACT);
        most = fmax(most, r.behind);
        ck_assert_double_eq(drape_sim_positions(s.sim)[0], s.model->start[0]);
    }
    ck_assert_double_gt(most, FRAME);
    ck_assert_double_eq_tol(debt, 0, EXACT);
}

#define PLATE                                                                                                \
    "{'name': '%s', 'mesh': {'grid': 'square', 'columns': 6, 'rows': 6, 'width': 0.2, 'height': 0.2,"        \
    " 'orientation': 'vertical', 'transform': {'translate': [-0.1, 0.35, %g], 'rotate': [%g, 1, 0, 40]}}, "  \
    "'material': "                                                                                           \
    "{'young_modulus': 1e6, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge'], 'pins': "         \
    "[{'box': [[-1,-1,-1], [1,1,1]], 'track': [[0.1, [0,0,0]], [0.3, [0,0,%g]], [0.6, [0,0,%g]],"            \
    " [0.8, [0,0,0]]]}]}"

/* Pinned plates that close upon free cloth and each other pass through both. That is reported as long as it
 * is so, and never by a call that is accurate. */
TEST(crossings_are_reported)
{
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'name': 'sheet', 'mesh': {'grid': 'square', 'columns': 13, 'rows': 13,"
        " 'width': 0.5, 'height': 0.5, 'orientation': 'vertical', 'transform': {'translate':"
        " [-0.25, 0.5, 0]}}, 'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'density': 200},"
        " 'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}]}"
        ", " PLATE ", " PLATE "],"
        " 'self_contact': {'thickness': 0.002}, 'contact': {'friction': 'lagged'},"
        " 'integrator': {'method': 'newton_k', 'dt': 0.0166666666666666667}, 'duration': 3}",
        "back", -0.06, 0.3, 0.07, 0.07, "front", 0.06, 0.8, -0.07, -0.07);
    int crossed = 0;
    for (int k = 1; k <= 84; k++) {
        drape_realtime r;
        ck_assert_int_eq(drape_sim_advance_realtime(s.sim, 1. / 60, PLENTY, &r), DRAPE_OK);
        ck_assert_int_eq((int)r.crossings, (int)drape_sim_intersections(s.sim, -1));
        ck_assert(r.crossings == 0 || !r.accurate);
        crossed += r.crossings > 0;
    }
    ck_assert_int_gt(crossed, 0);
    bool warned = false;
    drape_warning warning;
    for (int i = 0; !warned && drape_sim_warning(s.sim, i, &warning); i++)
        warned = strcmp(warning.name, "crossings") == 0;
    ck_assert(warned);
}

#define SHEET                                                                                                \
    "{'name': '%s', 'mesh': {'grid': 'square', 'columns': 9, 'rows': 9, 'width': 0.4, 'height': 0.4,"        \
    " 'orientation': 'horizontal', 'transform': {'translate': [%g, %g, %g], 'rotate': [%s]}}, 'material': "  \
    "{'young_modulus': 1e6, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge', 'bend.hinge']}"

/* A sheet that begins across a corner of another one: contact would keep both so. */
TEST(crossings_are_taken_apart)
{
    scoped_scene s =
        scene_open("{'drape': 1, 'cloth': [" SHEET ", " SHEET "], 'self_contact': {'thickness': 0.004},"
                   "'colliders': [{'type': 'plane', 'point': [0, 0, 0], 'normal': [0, 1, 0]}],"
                   "'integrator': {'method': 'newton_k'}, 'duration': 3}",
                   "low", 0., 0.02, 0., "0, 1, 0, 0", "high", 0.13, 0.1, 0.09, "1, 0, 0.3, -20");
    drape_realtime r = {.crossings = 0};
    ck_assert_int_gt((int)drape_sim_intersections(s.sim, -1), 0);
    for (int k = 1; k <= 60; k++) {
        ck_assert_int_eq(drape_sim_advance_realtime(s.sim, 1. / 60, PLENTY, &r), DRAPE_OK);
        ck_assert_int_eq((int)r.crossings, (int)drape_sim_intersections(s.sim, -1));
    }
    ck_assert_int_eq((int)r.crossings, 0);
}
