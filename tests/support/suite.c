/* suite.c: the main function of all test programs. */
#include "support/suite.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#define MAX_TESTS 1024
#define MAX_FILES 128

static TTest *tests[MAX_TESTS];
static size_t count, prepared;
static struct {
    const char *file;
    void (*prepare)(void);
} before[MAX_FILES];

void suite_add(TTest *test)
{
    if (count == MAX_TESTS)
        abort();
    tests[count++] = test;
}

void suite_before(const char *file, void (*prepare)(void))
{
    if (prepared == MAX_FILES)
        abort();
    before[prepared].file = file;
    before[prepared++].prepare = prepare;
}

static void nothing(int number)
{
    (void)number;
}

void suite_skip(const char *test, const char *reason)
{
    for (size_t i = 0; reason && i < count; i++)
        if (strcmp(tests[i]->name, test) == 0) { /* a test of TAP whose name says SKIP is skipped */
            char *name = malloc(strlen(test) + strlen(reason) + sizeof " # SKIP ");
            if (!name)
                abort();
            sprintf(name, "%s # SKIP %s", test, reason);
            tests[i]->name = name;
            tests[i]->fn = nothing;
        }
}

/* Whether `file` is .../test_<name>.c; name NULL: every file is. */
static bool is_of(const char *file, const char *name)
{
    const char *base = strstr(file, "test_");
    const size_t length = name ? strlen(name) : 0;
    return !name || (base && strncmp(base + 5, name, length) == 0 && strcmp(base + 5 + length, ".c") == 0);
}

static int in_order(const void *a, const void *b)
{
    const TTest *first = *(TTest *const *)a, *second = *(TTest *const *)b;
    const int files = strcmp(first->file, second->file);
    return files ? files : (first->line > second->line) - (first->line < second->line);
}

int main(int argc, char **argv)
{
    const char *name = argc > 1 ? argv[1] : NULL;
    setenv("CK_TAP_LOG_FILE_NAME", "-", 1);
    Suite *suite = suite_create(name ? name : "all");
    for (size_t i = 0; i < prepared; i++)
        if (is_of(before[i].file, name))
            before[i].prepare();
    qsort(tests, count, sizeof *tests, in_order);
    for (size_t i = 0; i < count; i++) {
        if (!is_of(tests[i]->file, name))
            continue;
        TCase *one = tcase_create(tests[i]->name);
        tcase_set_timeout(one, 0); /* meson's timeout counts; a noisy machine must not fail a good test */
        tcase_add_test(one, tests[i]);
        suite_add_tcase(suite, one);
    }
    SRunner *runner = srunner_create(suite);
    srunner_set_fork_status(runner, getenv("CK_FORK") ? srunner_fork_status(runner) : CK_FORK);
    srunner_run_all(runner, CK_SILENT);
    const bool failed = srunner_ntests_run(runner) == 0 || srunner_ntests_failed(runner) != 0;
    srunner_free(runner);
    return failed;
}
