/*
 * test_realtime.c: the fixed-iteration step for real time, and the advance with a budget.
 *
 * Measured seconds are no basis for a test: budgets here are either never reached (an hour) or never kept
 * (a nanosecond); those in between are for the bench.
 */
#include "contact/contact_parts.h"
#include "support/bytes.h"
#include "support/scene.h"

#define PLENTY  3600.0 /* [s] */
#define NOTHING 1e-9

#define HUNG                                                                                                 \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 16, 'rows': 16, 'width': 1, 'height': "   \
    "1},"                                                                                                    \
    "'material': {'young_modulus': 968246, 'thickness': 1.0328e-3, 'areal_density': 0.2},"                   \
    "'terms': ['stretch.edge', 'bend.hinge' %s], 'pins': [{'corner': 'top-left'}, {'corner': "               \
    "'top-right'}]}],"                                                                                       \
    "'integrator': {'method': '%s' %s}, 'duration': 4}"

static double distance(const scene *a, const scene *b)
{
    const double *x = drape_sim_positions(a->sim), *y = drape_sim_positions(b->sim);
    double sum = 0;
    for (size_t i = 0; i < 3 * (size_t)a->model->node_count; i++)
        sum += (x[i] - y[i]) * (x[i] - y[i]);
    return sqrt(sum / a->model->node_count);
}

static drape_realtime advance(scene *s, double frame, double budget)
{
    drape_realtime report;
    assert_ok(s->ctx, drape_sim_advance_realtime(s->sim, frame, budget, &report));
    return report;
}

/* ---- The fixed-iteration step ---- */

#define NO_MORE ", 'error': 1" /* [m] iterations beyond the least are for larger errors only */

/* One and two iterations against the converged step, on a sheet that falls by half a metre. The errors of
 * one step are those of Newton's second iterate, quadratic in the guess's h^2 dv/2 ~ 1 mm, and of conjugate
 * gradients to a tenth; 2 % of the fall is a bound with room, the goal of the bench. Two are better by more
 * than half. */
TEST(few_iterations_are_near_the_converged_step)
{
    scoped_scene exact = scene_open(HUNG, "", "be", ", 'tolerance': 1e-7");
    scene_advance(&exact, 0.5);
    double errors[2];
    for (int k = 1; k <= 2; k++) {
        scoped_scene s = scene_open(HUNG, "", "newton_k", k == 1 ? NO_MORE : NO_MORE ", 'iterations': 2");
        scene_watch(&s);
        scene_advance(&s, 0.5);
        errors[k - 1] = distance(&exact, &s);
        ck_assert_int_eq(s.rejected, 0);
        drape_statistics work = drape_sim_statistics(s.sim);
        ck_assert_int_ge(work.newton_iterations, 30 * k);
        ck_assert_int_le(work.newton_iterations, 30 * k + 1);
        ck_assert_int_gt(work.linear_iterations, work.newton_iterations);
    }
    ck_assert_msg(errors[0] < 0.02 && errors[1] < 0.5 * errors[0], "%g m, %g m", errors[0], errors[1]);
}

/* With enough iterations and digits the step is backward Euler: both solve the same equations up to their
 * residuals, and a residual of 1e-9 N moves a node by h^2 F/m = 2.8e-4 x 1e-9/8e-4 m a step. */
TEST(with_many_iterations_the_step_is_backward_euler)
{
    scoped_scene exact = scene_open(HUNG, "", "be", ", 'tolerance': 1e-9");
    scoped_scene s = scene_open(HUNG, "", "newton_k", ", 'iterations': 40, 'tolerance': 1e-9");
    scene_watch(&s);
    scene_advance(&exact, 0.2);
    scene_advance(&s, 0.2);
    ck_assert_double_lt(s.residual, 1e-9);
    ck_assert_double_lt(distance(&exact, &s), 1e-7);
}

/* The fixed-iteration step includes contact, friction, damping and drag: a damped sheet with drag falls
 * onto a sphere and stays on it. */
TEST(the_step_includes_contact_and_damping)
{
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 13, 'rows': 13, 'width': 0.6, "
        "'height': 0.6,"
        " 'orientation': 'horizontal'}, 'material': {'young_modulus': 1e5, 'thickness': 1e-3, "
        "'areal_density': 0.2},"
        " 'terms': ['stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 0.005},"
        " {'type': 'drag.viscous', 'coefficient': 0.1}]}],"
        " 'colliders': [{'type': 'sphere', 'center': [0.3, -0.25, -0.3], 'radius': 0.2, 'friction': 0.4}],"
        " 'integrator': {'method': 'newton_k', 'iterations': 4}, 'duration': 1}");
    scene_advance(&s, 1);
    const double *x = drape_sim_positions(s.sim);
    double lowest = INFINITY, near = INFINITY;
    for (int32_t i = 0; i < s.model->node_count; i++) {
        const double d[3] = {x[3 * i] - 0.3, x[3 * i + 1] + 0.25, x[3 * i + 2] + 0.3};
        near = fmin(near, sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]));
        lowest = fmin(lowest, x[3 * i + 1]);
    }
    ck_assert_double_gt(near, 0.2); /* no node is inside */
    ck_assert_double_lt(near, 0.21);
    ck_assert_double_gt(lowest, -1);
    ck_assert_double_lt(drape_sim_statistics(s.sim).strain_max, 0.2);
    ck_assert_double_gt(drape_sim_energy(s.sim).dissipated, 0);
}

/* A cloth in free fall beside one that lands on a ball: contact of the one must not hold back the other,
 * which falls by g h^2 n (n + 1)/2 in n steps of backward Euler. The solver leaves at most 1e-6 of a residual
 * that the forces of the impact dominate, at most 1e3 times the weight: 1e-3 of g h in the velocity of each
 * step, and 30^2/2 x 1e-3 g h^2 = 1.2 mm. If all of a correction were shortened alike, it would stay behind
 * by .16 m. */
TEST(contact_holds_back_only_what_it_touches)
{
    static const char *const cloth =
        "{'mesh': {'grid': 'square', 'columns': 9, 'rows': 9, 'width': 0.4, 'height': 0.4, 'orientation': "
        "'horizontal', 'transform': {'translate': [%g, %g, 0]}}, 'material': {'young_modulus': 1e6, "
        "'thickness': "
        "1e-3, 'areal_density': 0.2}, 'terms': ['stretch.edge', 'bend.hinge']}";
    char lands[512], falls[512];
    snprintf(lands, sizeof lands, cloth, 0., 0.1);
    snprintf(falls, sizeof falls, cloth, 2., 5.);
    scoped_scene s =
        scene_open("{'drape': 1, 'cloth': [%s, %s], 'colliders': [{'type': 'sphere', 'center': [0.2, -0.2, "
                   "-0.2], 'radius': 0.2}], 'contact': {'distance': 0.004}, 'integrator': {'method': "
                   "'newton_k'}, 'duration': 0.5}",
                   lands, falls);
    scene_advance(&s, 0.5);
    const double *x = drape_sim_positions(s.sim), h = 1 / 60.;
    for (int32_t i = s.model->node_count / 2; i < s.model->node_count; i++)
        ck_assert_double_eq_tol(x[3 * i + 1], 5 - 9.81 * h * h * 30 * 31 / 2, 2e-3);
}

/* ---- Budgets ---- */

/* A budget too small for any step: steps grow to the longest, with at most one a call; the debt stays below
 * that, and the rest is dropped. Then there is time again: within a few frames the level is full and the
 * debt 0. */
TEST(the_level_degrades_and_recovers)
{
    scoped_scene s = scene_open(HUNG, "", "newton_k", "");
    const double frame = 1.0 / 60, longest = 4 * frame;
    double first = drape_sim_time(s.sim), dropped = 0;
    drape_realtime r = advance(&s, frame, PLENTY);
    ck_assert_str_eq(r.level, "full");
    for (int k = 0; k < 40; k++) {
        r = advance(&s, frame, NOTHING);
        dropped += r.dropped;
        ck_assert_int_le(r.attempts - r.rejected, 1);
        ck_assert_double_le(r.debt, longest * (1 + 1e-9));
        ck_assert_double_eq_tol(r.dropped_total, dropped, 1e-12);
        ck_assert_double_le(r.h, longest * (1 + 1e-9));
        ck_assert(k == 0 || strcmp(r.level, "larger steps") == 0);
        ck_assert(r.attempts == 0 || !r.kept);
    }
    ck_assert_double_eq_tol(drape_sim_time(s.sim) + r.debt + dropped - first, 41 * frame, 1e-9);
    ck_assert_int_le(drape_sim_statistics(s.sim).steps_accepted, 22); /* a step covers several frames */
    for (int k = 0; k < 6; k++)
        r = advance(&s, frame, PLENTY);
    ck_assert(strcmp(r.level, "full") == 0 && r.effort == 0 && r.debt == 0 && r.kept);
    ck_assert_double_le(r.h, frame * (1 + 1e-9));
    ck_assert_double_lt(drape_sim_statistics(s.sim).strain_max, 1);
}

/* A frame of 0.3 s is one that no step covers: of what is left, all but the longest step, 4/60 s, is dropped.
 * After one such frame in 0.1 s that is more than a tenth, after 3 s with none it is less. */
TEST(dropped_time_has_a_warning)
{
    scoped_scene s = scene_open(HUNG, "", "newton_k", "");
    for (int k = 0; k < 2; k++) {
        drape_warning w;
        bool warned = false;
        for (int i = 0; i < (k ? 180 : 6); i++)
            advance(&s, 1.0 / 60, PLENTY);
        if (k == 0)
            ck_assert_double_gt(advance(&s, 0.3, NOTHING).dropped, 0.1);
        for (int i = 0; drape_sim_warning(s.sim, i, &w); i++)
            warned |= strcmp(w.name, "time_dropped") == 0;
        ck_assert_msg(warned == (k == 0), "%d", k);
    }
}

/* A single frame that is owed does not delay the next ones: one slow step in a hundred. */
TEST(a_single_late_frame_is_made_up_for)
{
    scoped_scene s = scene_open(HUNG, "", "newton_k", "");
    for (int k = 0; k < 30; k++) {
        drape_realtime r = advance(&s, 1.0 / 60, k == 10 ? NOTHING : PLENTY);
        if (k > 12)
            ck_assert(r.debt == 0 && r.kept);
    }
    ck_assert_double_eq_tol(drape_sim_time(s.sim), 0.5, 1e-9);
}

/* Integrators that choose their own steps, and integrators without efforts, also complete the frame; a
 * plain advance continues with the scene's own steps. */
TEST(every_integrator_with_a_time_takes_frames)
{
    for (int i = 0; drape_integrators[i]; i++) {
        drape_realtime r;
        scoped_scene s = scene_model(HUNG, "", "be", ", 'tolerance': 1e-4");
        drape_sim_def def = sim_def();
        def.integrator = drape_integrators[i]->entry.name;
        scene_start(&s, &def);
        drape_status status = drape_sim_advance_realtime(s.sim, 0.02, PLENTY, &r);
        if (drape_integrators[i]->steady_state) {
            ck_assert_int_eq(status, DRAPE_E_ARGUMENT);
            ck_assert_ptr_nonnull(strstr(drape_context_message(s.ctx), "no steps in time"));
        } else {
            ck_assert_msg(status == DRAPE_OK, "%s: %s", def.integrator, drape_context_message(s.ctx));
            ck_assert_double_eq_tol(drape_sim_time(s.sim), 0.02, 1e-12);
            ck_assert(r.time == drape_sim_time(s.sim) && r.kept && r.attempts > 0 && r.h > 0);
            ck_assert_int_eq(isnan(r.residual), isnan(drape_sim_statistics(s.sim).tolerance));
            ck_assert_int_eq(drape_sim_advance(s.sim, 0.1), DRAPE_OK);
            ck_assert_double_eq(drape_sim_time(s.sim), 0.1);
        }
    }
}

/* ---- Contact ---- */

/* A hung sheet whose edges are 67 mm, and a ball of 0.2 m before it. */
#define STRUCK                                                                                               \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 16, 'rows': 16, 'width': 1, 'height': "   \
    "1, "                                                                                                    \
    "'orientation': 'vertical'}, 'material': {'young_modulus': 968246, 'thickness': 1.0328e-3, "             \
    "'areal_density': 0.2}, 'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'corner': 'top-left'}, "      \
    "{'corner': 'top-right'}]}], 'colliders': [{'type': 'sphere', 'center': [0.5, -0.6, 0.4], 'radius': "    \
    "0.2}], %s 'integrator': {'method': '%s'}, 'duration': 4}"

/* Sends the ball through the place of the sheet at 2 m/s, frame by frame. Returns the largest distance at
 * which contact acted. */
static double strike(scene *s, int frames, double budget)
{
    double distance = 0, debt = 0;
    for (int k = 1; k <= frames; k++) {
        const double to[3] = {0, 0, -2.0 * k / 60};
        ck_assert_int_eq(drape_sim_move_collider(s->sim, 0, 1.0 / 60 + debt, to, NULL), DRAPE_OK);
        const drape_realtime r = advance(s, 1.0 / 60, budget);
        debt = r.debt;
        s->rejected += r.rejected;
        distance = fmax(distance, drape_system_contact(s->sim->system)->broad.distance[0]);
    }
    return distance;
}

/* The ball moves by 33 mm a step, 32 times the thickness of the cloth. The distance, between half of that and
 * all of it, is 2^5 thicknesses. When the ball rests, the sheet swings past it at less than 0.5 m/s in the
 * mean, 8 mm a step, and the distance falls to at most twice that. */
TEST(a_fast_body_is_served_by_the_default_distance)
{
    scoped_scene s = scene_open(STRUCK, "", "newton_k");
    s.rejected = 0;
    const double distance = strike(&s, 24, PLENTY), path = 2.0 / 60;
    ck_assert_double_ge(distance, 0.5 * path);
    ck_assert_double_le(distance, path);
    ck_assert_int_le(s.rejected, 0);
    ck_assert_int_eq(drape_sim_inside(s.sim, 0, NULL), 0);
    for (int k = 0; k < 30; k++)
        advance(&s, 1.0 / 60, PLENTY);
    ck_assert_double_le(drape_system_contact(s.sim->system)->broad.distance[0], 2 * 0.5 / 60);
}

/* A sheet falls on a ball, with time for one iteration a step. The energy that the residuals put in is taken
 * back as far as it is motion, and never counted as dissipated: neither what the cloth gains nor what is
 * dissipated beyond what it has lost is more than its fall of 0.2 m to the ball gave it. */
TEST(starved_steps_make_no_energy)
{
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 17, 'rows': 17, 'width': 1, "
        "'height': 1, 'orientation': 'horizontal', 'transform': {'translate': [-0.5, 0.2, "
        "0.5]}}, 'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'areal_density': 0.2}, "
        "'terms': ['stretch.edge', 'bend.hinge'%s]}], 'colliders': [{'type': 'sphere', "
        "'center': [0, -0.2, 0], 'radius': 0.2, 'friction': 0.3}], 'integrator': {'method': "
        "'newton_k'}, 'duration': 4}",
        "");
    const double given = 0.2 * 9.81 * 0.2; /* [J] */
    double lost = 0, gained = 0;
    for (int k = 0; k < 90; k++) {
        advance(&s, 1.0 / 60, NOTHING);
        const drape_energy e = drape_sim_energy(s.sim);
        gained = fmax(gained, lost - e.numerical - e.dissipated);
        lost = fmax(lost, e.numerical + e.dissipated);
        assert_below(e.dissipated, e.numerical + e.dissipated + given);
    }
    assert_below(gained, given);
}

/* A ball that is far from the sheet when it begins to move has the whole distance after one step. */
TEST(the_distance_is_there_before_the_body)
{
    scoped_scene s = scene_open(STRUCK, "", "newton_k");
    ck_assert_double_ge(strike(&s, 1, PLENTY), 0.5 * 2.0 / 60);
}

/* Where the scene gives a distance, it stays; where the ball moves by more than five of it in a step, there
 * is a warning. */
TEST(a_distance_that_is_given_is_kept)
{
    static const double given[] = {0.001, 0.03};
    for (int i = 0; i < 2; i++) {
        char contact[64];
        drape_warning warning;
        bool warned = false;
        snprintf(contact, sizeof contact, "'contact': {'distance': %g},", given[i]);
        scoped_scene s = scene_open(STRUCK, contact, "newton_k");
        ck_assert_double_eq(strike(&s, 5, PLENTY), given[i]);
        for (int k = 0; drape_sim_warning(s.sim, k, &warning); k++)
            warned = warned || strcmp(warning.name, "contact_distance") == 0;
        ck_assert_int_eq(warned, i == 0);
    }
}

/* Without time for anything a call makes one attempt. Rejected ones halve the step from call to call, until
 * one is accepted. */
TEST(a_rejected_step_is_retried_by_the_next_call)
{
    scoped_scene s = scene_open(STRUCK, "'contact': {'distance': 1e-4},", "newton_k");
    int rejected = 0;
    for (int k = 1; k <= 60; k++) {
        const double to[3] = {0, 0, k % 2 ? -0.8 : 0};
        ck_assert_int_eq(drape_sim_move_collider(s.sim, 0, 1.0 / 60, to, NULL), DRAPE_OK);
        const drape_realtime r = advance(&s, 1.0 / 60, NOTHING);
        ck_assert_int_le(r.attempts, 1);
        rejected += r.rejected;
    }
    ck_assert_int_gt(rejected, 0);
    ck_assert_double_gt(drape_sim_time(s.sim), 0);
}

/* Time is dropped, and steps are not longer than dt. */
TEST(steps_in_contact_are_not_longer_than_dt)
{
    scoped_scene s = scene_open(STRUCK, "", "newton_k");
    int touching = 0;
    strike(&s, 12, PLENTY);
    for (int k = 13; k < 24; k++) {
        double gap;
        const bool touches = drape_contact_active(drape_system_contact(s.sim->system), &gap) > 0;
        const double to[3] = {0, 0, -2.0 * k / 60};
        ck_assert_int_eq(drape_sim_move_collider(s.sim, 0, 1.0 / 60, to, NULL), DRAPE_OK);
        const drape_realtime r = advance(&s, 1.0 / 60, NOTHING);
        touching += touches;
        ck_assert(!touches || (r.attempts == 1 && r.h <= (1 + 1e-9) / 60 && r.debt <= (1 + 1e-9) / 60));
    }
    ck_assert_int_gt(touching, 5);
}

/* A strip is folded up beside its pinned row, 12 mm from it, and the pins go through that place: 30 mm in a
 * step, in which free nodes that keep still are passed. All of the cloth follows them instead, in a step that
 * is not rejected, and the fold stays on its side. */
TEST(pins_do_not_pass_through_cloth)
{
    static const char text[] =
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 8, 'width': 0.2, 'height': "
        "0.28, 'orientation': 'vertical'}, 'material': {'young_modulus': 968246, 'thickness': 1.0328e-3, "
        "'areal_density': 0.2}, 'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'row': 0}]}],"
        "'self_contact': {'thickness': 0.004}, 'integrator': {'method': 'newton_k'}, 'duration': 4}";
    scoped_scene s = scene_open(text);
    const int32_t n = s.model->node_count;
    double x[3 * 40], pins[15], still[3 * 40] = {0};
    int32_t rows[5];
    ck_assert_int_eq(n, 40);
    memcpy(x, drape_sim_positions(s.sim), sizeof x);
    const double side = x[2] + 0.012;
    for (int32_t i = 15; i < n; i++) { /* from the fourth row on it goes up */
        x[3 * i + 1] = x[3 * (i % 5) + 1] - 0.08 + 0.04 * (i / 5 - 2);
        x[3 * i + 2] = side;
    }
    ck_assert_int_eq(drape_sim_set_state(s.sim, 0, x, still), DRAPE_OK);
    for (int i = 0; i < 5; i++) {
        rows[i] = i;
        memcpy(pins + 3 * i, x + 3 * (size_t)i, 3 * sizeof *x);
        pins[3 * i + 2] += 0.03;
    }
    ck_assert_int_eq(drape_sim_move_pins(s.sim, 5, rows, 1. / 60, pins, NULL), DRAPE_OK);
    const drape_realtime r = advance(&s, 1. / 60, PLENTY);
    ck_assert_int_eq(r.attempts, 1);
    ck_assert_int_eq(r.rejected, 0);
    ck_assert_int_eq((int)drape_sim_intersections(s.sim, -1), 0);
    const double *at = drape_sim_positions(s.sim);
    for (int i = 0; i < 5; i++)
        ck_assert_double_gt(at[3 * (20 + i) + 2], at[3 * i + 2]);
}

#define LAYER                                                                                                \
    "{'mesh': {'grid': 'square', 'columns': 9, 'rows': 9, 'width': 0.5, 'height': 0.5, 'orientation': "      \
    "'horizontal', 'transform': {'translate': [-0.25, %g, 0.25]}}, 'material': {'young_modulus': 968246, "   \
    "'thickness': 1.0328e-3, 'areal_density': 0.2}, 'terms': ['stretch.edge', 'bend.hinge'] %s}"

/* A ball that goes as far in a step as four layers are thick takes the upper ones along with the lowest one,
 * which it pushes, also where pins move. With that alone, through the others, 37 attempts were rejected for
 * nine steps of dt; so may be the impact, which twenty iterations do not solve. */
static void push_layers(const char *pins)
{
    scoped_scene s =
        scene_open("{'drape': 1, 'cloth': [" LAYER ", " LAYER ", " LAYER "], 'self_contact': {'thickness': "
                   "0.002}, 'colliders': [{'type': 'sphere', 'center': [0, -0.12, 0], 'radius': 0.1,"
                   "'track': [[0, [0, 0, 0]], [0.5, [0, 1, 0]]]}],"
                   "'integrator': {'method': 'newton_k'}, 'duration': 1}",
                   0., pins, 0.008, pins, 0.016, pins);
    scene_watch(&s);
    scene_advance(&s, 0.15);
    ck_assert_int_le((int)s.rejected, 2);
    ck_assert_int_le((int)s.accepted, 11);
    ck_assert_int_eq((int)drape_sim_intersections(s.sim, -1), 0);
    const double *x = drape_sim_positions(s.sim);
    for (size_t i = 0; i < (size_t)s.model->node_count; i++)
        ck_assert_double_ge(hypot(hypot(x[3 * i], x[3 * i + 1] + 0.12 - 0.3), x[3 * i + 2]), 0.1);
}

TEST(a_ball_takes_all_layers_along)
{
    push_layers("");
    push_layers(", 'pins': [{'row': 0, 'track': [[0, [0, 0, 0]], [0.5, [0, 0.2, 0]]]}]");
}
