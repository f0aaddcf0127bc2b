/*
 * test_work.c: the work of loads, wind and what moves, apart from dissipation, against closed forms, by every
 * integrator of motion. By construction the energies + dissipated + numerical - work is constant, which each
 * test checks to rounding; so a closed form of the work is one of the remainder, too.
 *
 * The steps are END/STEPS; those of methods with error control follow rtol 1e-6. A rule of order p leaves a
 * share of some units times STEPS^-p of the work: 4/STEPS by backward Euler, 4/STEPS^2 by the others.
 */
#include "support/resume.h"
#include "support/scene.h"

#define END   0.5 /* [s] */
#define STEPS 100
#define SHARE 4.0
#define MASS  (0.2 * 0.3 * 0.4) /* [kg] of the sheet, level, without gravity unless given */

#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'name': 'flag', 'mesh': {'grid': 'square', 'columns': 4, 'rows': 5, 'width': "  \
    "0.3, 'height': 0.4, 'orientation': 'horizontal'}, 'material': {'young_modulus': 1e4, 'thickness': "     \
    "1e-3, 'areal_density': 0.2%s}, 'terms': ['stretch.edge', %s]%s}], 'gravity': [0, %g, 0], "              \
    "'integrator': {'method': '%s'%s}, 'duration': 2}"

#define EVEN ", 'mass': 'uniform'" /* all nodes have the same mass, which forces on nodes accelerate as one */

static scene open_by(const drape_integrator_ops *method, const char *masses, const char *term,
                     const char *more, double gravity)
{
    char settings[120] = ", 'rtol': 1e-6";
    if (!method->own_steps)
        snprintf(settings, sizeof settings, ", 'dt': %.17g%s", END / STEPS,
                 strcmp(method->entry.name, "verlet") == 0 ? ", 'substeps': 8" : "");
    return scene_open(SHEET, masses, term, more, gravity, method->entry.name, settings);
}

/* The error of the work that a method may have, as a share. */
static double share_of(const drape_integrator_ops *method)
{
    return SHARE / (method->order == 1 && !method->own_steps ? STEPS : STEPS * STEPS);
}

static double work_of(drape_sim *sim, const char *name)
{
    double work;
    const char *found;
    for (int i = 0; (found = drape_sim_work(sim, i, &work)); i++)
        if (strcmp(found, name) == 0)
            return work;
    ck_abort_msg("nothing called \"%s\" does work", name);
}

static double all_work(drape_sim *sim)
{
    double work, sum = 0;
    for (int i = 0; drape_sim_work(sim, i, &work); i++)
        sum += work;
    return sum;
}

/* The balance from the energies at the start, to some roundings of its terms. */
static void check_balance(drape_sim *sim, const drape_energy *start)
{
    const drape_energy e = drape_sim_energy(sim);
    const double now = e.kinetic + e.elastic + e.gravity + e.contact + e.dissipated + e.numerical -
                       all_work(sim),
                 then = start->kinetic + start->elastic + start->gravity + start->contact,
                 size = e.kinetic + e.elastic + fabs(e.gravity) + fabs(then) + e.dissipated +
                        fabs(all_work(sim));
    ck_assert_double_eq_tol(now, then, 100 * STEPS * DBL_EPSILON * size);
}

#define FOR_ALL_METHODS(m)                                                                                   \
    for (int i_ = 0; (m = drape_integrators[i_]); i_++)                                                      \
        if (!m->steady_state)

/* A dead force F on each of the nodes, N in all, moves the sheet as one: W = N F d by the displacement d that
 * the run has, to rounding, whatever the method makes of it, and d = N F t^2/(2 m) by its order. Along the
 * ramp of T = END the force is F t/T, d' = v = N F t^2/(2 m T), and W = N F d' t ... = (N F)^2 T^2/(8 m). */
TEST(loads_do_force_times_path)
{
    const drape_integrator_ops *m;
    const double force = 20 * 0.01;
    FOR_ALL_METHODS(m)
    for (int ramp = 0; ramp < 2; ramp++) {
        char term[200];
        snprintf(term, sizeof term,
                 "{'type': 'load.point', 'force': [0, 0, 0.005]%s}, {'type': "
                 "'load.point', 'force': [0, 0, 0.005]%s}",
                 ramp ? ", 'ramp': 0.5" : "", ramp ? ", 'ramp': 0.5" : "");
        scoped_scene s = open_by(m, EVEN, term, "", 0);
        ck_assert_int_eq(s.model->node_count, 20);
        const drape_energy start = drape_sim_energy(s.sim);
        const double z = drape_sim_positions(s.sim)[2];
        scene_advance(&s, END);
        const double path = drape_sim_positions(s.sim)[2] - z, work = work_of(s.sim, "load.point of flag"),
                     expected = force * force * END * END / MASS / (ramp ? 8 : 2);
        printf("# %s: work %.9g J, closed form %.9g J\n", m->entry.name, 2 * work, expected);
        ck_assert_double_eq_tol(work, work_of(s.sim, "load.point of flag (2)"), 1e-12 * expected);
        if (!ramp)
            assert_below(fabs(2 * work - force * path), 1e-12 * expected);
        assert_below(fabs(2 * work - expected), share_of(m) * expected);
        ck_assert_double_eq(drape_sim_energy(s.sim).dissipated, 0);
        ck_assert_double_eq(drape_sim_energy(s.sim).gravity, 0);
        check_balance(s.sim, &start);
    }
}

/* A pressure on a free level sheet does p A d: it has no potential, and the force is constant, so that every
 * quadrature of it is exact. */
TEST(pressure_without_a_potential_does_force_times_path)
{
    const drape_integrator_ops *m;
    FOR_ALL_METHODS(m)
    {
        scoped_scene s = open_by(m, "", "{'type': 'load.follower', 'pressure': 2}", "", 0);
        const drape_energy start = drape_sim_energy(s.sim);
        const double y = drape_sim_positions(s.sim)[1];
        scene_advance(&s, END);
        const double work = work_of(s.sim, "load.follower of flag"),
                     expected = 2 * 0.12 * fabs(drape_sim_positions(s.sim)[1] - y);
        ck_assert_double_gt(expected, 0);
        /* verlet and the trapezoid sum powers at the ends of steps, of a velocity that is linear in time;
         * residuals and errors within rtol move nodes against each other */
        assert_below(fabs(work - expected), 1e-6 * expected);
        ck_assert_double_eq(drape_sim_energy(s.sim).dissipated, 0);
        check_balance(s.sim, &start);
    }
}

/* What is at rest is done no work on, however strong the wind. */
TEST(wind_does_no_work_on_pinned_cloth)
{
    const drape_integrator_ops *m;
    FOR_ALL_METHODS(m)
    {
        scoped_scene s = open_by(m, "", "{'type': 'drag.wind', 'wind': [3, 2, 1]}",
                                 ", 'pins': [{'box': [[-1, -1, -1], [1, 1, 1]]}]", 0);
        scene_advance(&s, END);
        ck_assert_double_eq(work_of(s.sim, "drag.wind of flag"), 0);
        ck_assert_double_eq(drape_sim_energy(s.sim).dissipated, 0);
    }
}

/* A level sheet falls from rest in still air: with k = rho C/(2 sigma) and U = sqrt(g/k), v = U tanh(g t/U)
 * and the drop is ln cosh(g t/U)/k. The air takes m g drop - m v^2/2, which is dissipated; the rates are up
 * to 2 k U = 12/s, twelve times 1/END, in the second derivative of the power. In a wind w across the sheet,
 * without weight, u = w - v = w/(1 + k w t), and the wind does m v^2/2 and dissipates nothing. */
TEST(still_air_dissipates_and_wind_does_work)
{
    const drape_integrator_ops *m;
    const double k = 1.225 * 1.17 / (2 * 0.2), speed = sqrt(9.81 / k), x = 9.81 * END / speed;
    FOR_ALL_METHODS(m)
    for (int wind = 0; wind < 2; wind++) {
        scoped_scene s = open_by(m, "", wind ? "{'type': 'drag.wind', 'wind': [0, 2, 0]}" : "'drag.wind'", "",
                                 wind ? 0 : -9.81);
        const drape_energy start = drape_sim_energy(s.sim);
        scene_advance(&s, END);
        const double v = wind ? 2 - 2 / (1 + 2 * k * END) : speed * tanh(x),
                     air = MASS * (wind ? 0 : 9.81 * log(cosh(x)) / k) - MASS * v * v / 2;
        const drape_energy e = drape_sim_energy(s.sim);
        const double work = work_of(s.sim, "drag.wind of flag");
        printf("# %s: air took %.9g J, dissipated %.9g J, work %.9g J\n", m->entry.name, air, e.dissipated,
               work);
        ck_assert_double_eq(wind ? e.dissipated : work, 0);
        assert_below(fabs((wind ? -work : e.dissipated) - air), 12 * share_of(m) * fabs(air));
        check_balance(s.sim, &start);
    }
}

/* A sheet hangs by two corners in a light wind, which lifts it. Nothing is dissipated, nor warned of:
 * backward Euler takes a fifth of what the wind gave, and most of what is left beside what was lifted. */
TEST(a_light_wind_is_no_doubt)
{
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'name': 'flag', 'mesh': {'grid': 'square', 'columns': 8, 'rows': 8, "
        "'width': "
        "0.5, 'height': 0.7, 'orientation': 'vertical'}, 'material': {'young_modulus': 1e5, 'thickness': "
        "5e-4, 'areal_density': 0.2}, 'terms': ['stretch.cst', 'bend.hinge', {'type': 'drag.wind', 'wind': "
        "[0.3, 0, 2]}], 'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}]}], 'duration': 3}");
    const drape_energy start = drape_sim_energy(s.sim);
    drape_warning w;
    scene_advance(&s, 3);
    const drape_energy e = drape_sim_energy(s.sim);
    const double work = work_of(s.sim, "drag.wind of flag");
    ck_assert_double_gt(e.gravity, start.gravity);
    ck_assert_double_gt(e.numerical, 0.5 * (work - (e.gravity - start.gravity)));
    ck_assert_double_eq(e.dissipated, 0);
    ck_assert_double_eq_tol(drape_sim_energy_received(s.sim), work, 1e-12 * work);
    ck_assert_msg(!drape_sim_warning(s.sim, 0, &w), "%s", w.text);
    check_balance(s.sim, &start);
}

/* Works are part of a checkpoint, and those of the present step of multistep methods. */
TEST(works_resume_with_their_bits)
{
    const drape_integrator_ops *m;
    FOR_ALL_METHODS(m)
    {
        const char *terms = "{'type': 'drag.wind', 'wind': [1, 2, 0]}, {'type': 'load.point', 'force': [0, "
                            "0, 0.01], 'ramp': 0.3}",
                   *pins = ", 'pins': [{'edge': 'left', 'track': [[0, [0, 0, 0]], [0.4, [0, 0.1, 0]]]}]";
        scene_resumes(open_by(m, "", terms, pins, -9.81), open_by(m, "", terms, pins, -9.81), 0.2, 0.3,
                      m->entry.name);
    }
}
