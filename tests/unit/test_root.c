/* test_root.c: the root finder: the interval that it promises, on which side its root is, and how many
 * evaluations it takes. */
#include "sim/root.h"

#include <float.h>
#include <math.h>

#include "support/suite.h"

typedef struct counted {
    double (*f)(double t);
    int calls, fails_at;
} counted;

static drape_status call(void *user, double t, double *value)
{
    counted *c = user;
    *value = c->f(t);
    return ++c->calls == c->fails_at ? DRAPE_E_FILE : DRAPE_OK;
}

static double line(double t)
{
    return 3 * t - 1;
}

static double parabola(double t)
{
    return 0.7 - 4.905 * t * t;
}

static double steep(double t)
{
    return t > 0.3 ? 1e-9 : -1e9;
}

/* Triple root: where chords stay at one end. */
static double flat(double t)
{
    return (t - 0.9) * (t - 0.9) * (t - 0.9);
}

static const struct {
    double (*f)(double t);
    double root;
} functions[] = {{line, 1 / 3.0}, {parabola, 0.37777178144788400}, {steep, 0.3}, {flat, 0.9}};

#define COUNT (sizeof functions / sizeof *functions)

/* Within the tolerance, on the side of the end, and with two evaluations more than bisection at most. */
TEST(roots_are_enclosed)
{
    static const double tolerances[] = {1e-3, 1e-10, 1e-14};
    for (size_t i = 0; i < COUNT; i++)
        for (size_t k = 0; k < 3; k++) {
            counted c = {.f = functions[i].f};
            double root;
            const double a = c.f(0), b = c.f(1);
            ck_assert_int_eq(drape_root_find(call, &c, 0, a, 1, b, tolerances[k], &root), DRAPE_OK);
            /* the root itself is rounded, and near a triple one f is 0 in some 1e-108 only */
            ck_assert_double_le(fabs(root - functions[i].root), tolerances[k] + 2 * DBL_EPSILON);
            ck_assert(c.f(root) == 0 || (c.f(root) > 0) == (b > 0));
            ck_assert_int_le(c.calls, (int)ceil(log2(1 / tolerances[k])) + 2);
        }
}

/* Smooth functions take far fewer evaluations than the 34 of bisection. */
TEST(smooth_functions_are_quick)
{
    counted c = {.f = parabola};
    double root;
    ck_assert_int_eq(drape_root_find(call, &c, 0, 0.7, 1, -4.205, 1e-10, &root), DRAPE_OK);
    ck_assert_int_le(c.calls, 12);
}

TEST(a_root_at_an_end_is_that_end)
{
    counted c = {.f = line};
    double root = 0;
    ck_assert_int_eq(drape_root_find(call, &c, 0, -1, 1 / 3.0, 0, 1e-12, &root), DRAPE_OK);
    ck_assert(root == 1 / 3.0 && c.calls == 0);
    /* f is 0 at the first end: what is sought is where it is no more */
    ck_assert_int_eq(drape_root_find(call, &c, 1 / 3.0, 0, 1, 2, 1e-12, &root), DRAPE_OK);
    ck_assert(root > 1 / 3.0 && root <= 1 / 3.0 + 1e-12);
}

TEST(a_failure_ends_the_search)
{
    counted c = {.f = parabola, .fails_at = 3};
    double root;
    ck_assert_int_eq(drape_root_find(call, &c, 0, 0.7, 1, -4.205, 1e-10, &root), DRAPE_E_FILE);
    ck_assert_int_eq(c.calls, 3);
}
