/* test_forcing.c: how exactly an iterative linear solver computes the corrections of Newton's method. */
#include "support/scene.h"

#include <string.h>

#define SIDE  15
#define STEPS 6

typedef struct outcome {
    double x[3 * SIDE * SIDE];
    drape_statistics work;
} outcome;

static void run(const char *settings, outcome *out)
{
    scene s =
        scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': %d, 'rows': %d, 'width': "
                   "1, 'height': 1}, "
                   "'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'areal_density': 0.2}, "
                   "'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'corner': 'top-left'}, {'corner': "
                   "'top-right'}]}], "
                   "'integrator': {'method': 'be', 'dt': 0.015625, 'tolerance': 1e-8%s}, 'duration': 1}",
                   SIDE, SIDE, settings);
    scene_advance(&s, STEPS * 0.015625);
    memcpy(out->x, drape_sim_positions(s.sim), sizeof out->x);
    out->work = drape_sim_statistics(s.sim);
    scene_close(&s);
}

/* The solution of a step does not depend on how its corrections are solved. A residual of 1e-8 N moves a node
 * of m >= 0.2/196/6 kg by at most 1e-8 h^2/m = 1.5e-8 m in a step if nothing but inertia resisted it; in n
 * steps, whose errors are also ones of velocity, that is n (n + 1)/2 times as much, and twice for two runs:
 * 6e-7 m. */
START_TEST(the_solution_does_not_depend_on_it)
{
    static outcome direct, constant, forced;
    run("", &direct);
    run(", 'linear_solver': 'pcg'", &constant);
    run(", 'linear_solver': 'pcg', 'forcing': 'eisenstat_walker'", &forced);
    for (int i = 0; i < 3 * SIDE * SIDE; i++) {
        ck_assert_double_eq_tol(direct.x[i], constant.x[i], 6e-7);
        ck_assert_double_eq_tol(direct.x[i], forced.x[i], 6e-7);
    }
    /* 1e-2 is left of each residual by the constant; 0.5 of the first of a step, and less where the residual
     * has fallen: about as many iterations in all. */
    ck_assert_int_lt(2 * forced.work.linear_iterations, 3 * constant.work.linear_iterations);
}
END_TEST

SUITE("forcing", the_solution_does_not_depend_on_it)
