/* optional.h: a test program that runs only if an environment variable is set; otherwise it reports in TAP
 * that it is skipped, and why. */
#ifndef DRAPE_TESTS_OPTIONAL_H
#define DRAPE_TESTS_OPTIONAL_H

#include <stdio.h>

#include "support/suite.h"

#define SUITE_IF_SET(variable, why, name, ...)                                                               \
    int main(void)                                                                                           \
    {                                                                                                        \
        const TTest *const tests[] = {__VA_ARGS__};                                                          \
        if (!getenv(variable)) {                                                                             \
            puts("1..0 # SKIP " name ": set " variable ", " why);                                            \
            return 0;                                                                                        \
        }                                                                                                    \
        return run_suite(name, tests, sizeof tests / sizeof *tests);                                         \
    }

#endif
