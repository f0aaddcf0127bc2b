/* suite.h: a test is TEST(name) { ... }, a function of Check. Tests register themselves; a program has those
 * of several files, and its argument names one: `mesh` for test_mesh.c. It speaks TAP to meson. */
#ifndef DRAPE_TESTS_SUITE_H
#define DRAPE_TESTS_SUITE_H

#include <check.h>
#include <stdlib.h>

#include "support/context.h"

void suite_add(TTest *test);

/* Called once before the tests of the file, in the process from which they fork. */
void suite_before(const char *file, void (*prepare)(void));

/* The test is reported as skipped; reason NULL: it runs. */
void suite_skip(const char *test, const char *reason);

#define TEST(name)                                                                                           \
    static void name(int);                                                                                   \
    __attribute__((constructor)) static void name##_is_added(void)                                           \
    {                                                                                                        \
        static TTest test = {#name, name, __FILE__, __LINE__};                                               \
        suite_add(&test);                                                                                    \
    }                                                                                                        \
    static void name(int number_ CK_ATTRIBUTE_UNUSED)

#define BEFORE_TESTS                                                                                         \
    static void before_tests(void);                                                                          \
    __attribute__((constructor)) static void before_tests_is_added(void)                                     \
    {                                                                                                        \
        suite_before(__FILE__, before_tests);                                                                \
    }                                                                                                        \
    static void before_tests(void)

#endif
