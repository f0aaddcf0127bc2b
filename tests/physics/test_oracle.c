/*
 * test_oracle.c: the trajectory of the DEP report's own programs, step by step: py1.out.txt (the course's
 * Python) and cc1.out.txt (the report's C++), blocks "Time: t" and the position of node 3 in brackets after
 * the step with that label, the first one after the first step. These files belong to others and are not kept
 * here: they lie in the folder that DRAPE_ORACLE names, or in ../shared/data/dep, beside the sources.
 *
 * Tolerance: the two differ by 2.3e-8 m from each other, since the C++ has rest lengths in single
 * precision, and print 1e-8 m; a residual of 1e-10 N moves a node of 2.5e-3 kg by 4e-12 m a step, 5e-7 m
 * over 500 free steps and far less on a damped pendulum: 1e-7 m.
 */
#include <unistd.h>

#include "support/four_nodes.h"
#include "support/suite.h"

#define TOLERANCE 1e-7 /* [m] */

static void path_of(const char *file, char path[4096])
{
    const char *folder = getenv("DRAPE_ORACLE"), *source = getenv("DRAPE_SOURCE");
    if (folder)
        snprintf(path, 4096, "%s/%s", folder, file);
    else
        snprintf(path, 4096, "%s/../shared/data/dep/%s", source ? source : ".", file);
}

static void compare(const char *file)
{
    char path[4096], line[256];
    double t, y[3], worst = 0;
    int n = 0;
    path_of(file, path);
    FILE *in = fopen(path, "r");
    ck_assert_msg(in != NULL, "cannot read %s", path);
    scoped_scene s = four_nodes(1e-10, "");
    scene_watch(&s);
    while (fgets(line, sizeof line, in)) {
        if (sscanf(line, "Time: %lf", &t) == 1) {
            ck_assert_double_eq_tol(t, n * FOUR_NODES_STEP, 1e-6);
            scene_advance(&s, ++n * FOUR_NODES_STEP);
            continue;
        }
        const char *numbers = line + strspn(line, " [");
        if (sscanf(numbers, "%lf %lf %lf", &y[0], &y[1], &y[2]) != 3)
            continue;
        for (int k = 0; k < 3; k++)
            worst = fmax(worst, fabs(drape_sim_positions(s.sim)[9 + k] - y[k]));
    }
    fclose(in);
    printf("# %s: ", file);
    assert_below(worst, TOLERANCE);
    ck_assert_int_eq(n, FOUR_NODES_STEPS);
    ck_assert_int_eq(s.accepted, FOUR_NODES_STEPS);
    ck_assert_int_eq(s.unconverged, 0);
}

TEST(as_the_python_of_the_course)
{
    compare("py1.out.txt");
}

TEST(as_the_program_of_the_report)
{
    compare("cc1.out.txt");
}

BEFORE_TESTS
{
    char path[4096], reason[8192];
    path_of("", path);
    if (access(path, R_OK) == 0)
        return;
    snprintf(reason, sizeof reason, "there is no %s; DRAPE_ORACLE names another folder", path);
    suite_skip("as_the_python_of_the_course", reason);
    suite_skip("as_the_program_of_the_report", reason);
}
