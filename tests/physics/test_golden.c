/* test_golden.c: numbers that may not change by accident; golden/ says what they are and when they may. */
#include "golden/four_nodes.h"

#include "support/four_nodes.h"

#define TOLERANCE 1e-9 /* [m]: 100 times the difference between solvers, 1/100 of test_oracle.c */

static void compare(const char *settings)
{
    scoped_scene s = four_nodes(1e-12, settings);
    double worst = 0;
    for (size_t i = 0; i < sizeof golden_four_nodes / sizeof *golden_four_nodes; i++) {
        scene_advance(&s, golden_four_nodes[i].step * FOUR_NODES_STEP);
        for (int k = 0; k < 3; k++)
            worst = fmax(worst, fabs(drape_sim_positions(s.sim)[9 + k] - golden_four_nodes[i].x[k]));
    }
    assert_below(worst, TOLERANCE);
}

TEST(four_nodes_as_before)
{
    compare("");
}

TEST(four_nodes_by_other_solvers)
{
    compare(", 'linear_solver': 'dense'");
    compare(", 'globalization': 'line_search'");
}
