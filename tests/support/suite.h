/* suite.h: a test program is START_TEST functions of Check and one line SUITE("name", test_a, test_b). It
 * speaks TAP to meson. */
#ifndef DRAPE_TESTS_SUITE_H
#define DRAPE_TESTS_SUITE_H

#include <check.h>
#include <stdlib.h>

static int run_suite(const char *name, const TTest *const *tests, size_t count)
{
    setenv("CK_TAP_LOG_FILE_NAME", "-", 1);
    Suite *suite = suite_create(name);
    for (size_t i = 0; i < count; i++) {
        TCase *one = tcase_create(tests[i]->name);
        tcase_set_timeout(one, 0); /* meson's timeout counts; a noisy machine must not fail a good test */
        tcase_add_test(one, tests[i]);
        suite_add_tcase(suite, one);
    }
    SRunner *runner = srunner_create(suite);
    srunner_set_fork_status(runner, getenv("CK_FORK") ? srunner_fork_status(runner) : CK_FORK);
    srunner_run_all(runner, CK_SILENT);
    int failed = srunner_ntests_failed(runner);
    srunner_free(runner);
    return failed != 0;
}

#define SUITE(name, ...)                                                                                     \
    int main(void)                                                                                           \
    {                                                                                                        \
        const TTest *const tests[] = {__VA_ARGS__};                                                          \
        return run_suite(name, tests, sizeof tests / sizeof *tests);                                         \
    }

#endif
