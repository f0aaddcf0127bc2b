/* test_dep_slow.c: the larger sheets on which the DEP report's program failed (see test_dep.c); takes
 * minutes. */
#include "support/dep.h"
#include "support/suite.h"

#define CASE(name, ...)                                                                                      \
    START_TEST(name)                                                                                         \
    {                                                                                                        \
        static const dep_case one = {#name, __VA_ARGS__, ""};                                                \
        dep_run(&one);                                                                                       \
    }                                                                                                        \
    END_TEST

CASE(side_22_consistent, 22, 0.01, 1e5, "consistent")
CASE(side_23, 23, 0.01, 1e5, "report")
CASE(side_26, 26, 0.01, 1e5, "report")
CASE(side_28, 28, 0.01, 1e5, "report")
CASE(side_30, 30, 0.01, 1e5, "report")

SUITE("dep_slow", side_22_consistent, side_23, side_26, side_28, side_30)
