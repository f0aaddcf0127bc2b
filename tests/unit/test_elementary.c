/*
 * test_elementary.c: the functions of base/elementary.h against those of libquadmath, whose 113 digits leave
 * an error below 2^-58 of a unit in the last place of a double, over their whole range; their special values
 * against those that C demands; the lanes of atan2 against the function of one number.
 */
#include <float.h>
#include <math.h>
#include <quadmath.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "base/elementary.h"
#include "base/lanes_atan2.h"
#include "support/suite.h"

#define SAMPLES 60000 /* of each function and kind of argument; DRAPE_SAMPLES=N takes N */

/* elementary.h promises 1; the functions are made for 1/2, from the last rounding, plus what the operations
 * before it lose: a term of at most a twelfth of the result carries up to four roundings of up to 1/2 ulp of
 * a result that may be just above a power of two. */
#define BOUND 0.8
/* A denormal result is rounded twice. */
#define BOUND_DENORMAL 1.0

/* ---- Arguments ---- */

static uint64_t state;

static double uniform(double low, double high)
{
    state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return low + (high - low) * (double)(state >> 11) * 0x1p-53;
}

/* Either sign, all magnitudes between two powers of two alike. */
static double of_magnitude(int low, int high)
{
    return (uniform(-1, 1) < 0 ? -1 : 1) * ldexp(uniform(1, 2), (int)floor(uniform(low, high + 1)));
}

static int samples(void)
{
    const char *text = getenv("DRAPE_SAMPLES");
    return text ? atoi(text) : SAMPLES;
}

/* ---- Errors ---- */

typedef struct worst {
    double normal, denormal; /* largest error [ulp] */
    double x, y;             /* where it is */
} worst;

static void add(worst *w, double got, __float128 expected, double x, double y)
{
    const double nearest = (double)expected;
    if (fabsq(expected) > DBL_MAX || isinf(nearest)) {
        ck_assert_msg(got == nearest || fabs(got) == DBL_MAX, "%a of %a %a, beyond the largest", got, x, y);
        return;
    }
    int exponent;
    frexpq(expected, &exponent);
    const bool normal = exponent >= DBL_MIN_EXP;
    const double unit = ldexp(1, normal ? exponent - 53 : -1074),
                 error = (double)(fabsq(got - expected) / unit);
    ck_assert_msg(error <= (normal ? BOUND : BOUND_DENORMAL), "%a of %a %a: error %g ulp", got, x, y, error);
    if (normal && error > w->normal)
        w->normal = error, w->x = x, w->y = y;
    if (!normal)
        w->denormal = fmax(w->denormal, error);
}

static void report(const char *name, const worst *w)
{
    printf("# %s: largest error %.4f ulp, of %a %a; of denormal results %.4f\n", name, w->normal, w->x, w->y,
           w->denormal);
}

/* ---- Sine and cosine ---- */

static void add_angle(worst *w, double angle)
{
    double s, c, s_minus, c_minus;
    drape_sin_cos(angle, &s, &c);
    drape_sin_cos(-angle, &s_minus, &c_minus);
    ck_assert(s == -s_minus && c == c_minus);
    add(&w[0], s, sinq(angle), angle, 0);
    add(&w[1], c, cosq(angle), angle, 0);
}

TEST(sine_and_cosine)
{
    worst w[2] = {0};
    double s, c;
    for (int i = 0; i < samples(); i++) {
        add_angle(w, uniform(-4, 4));
        add_angle(w, uniform(-DRAPE_SIN_COS_MAX, DRAPE_SIN_COS_MAX));
        add_angle(w, of_magnitude(-1074, 9));
    }
    for (int k = 0; k <= 651; k++) { /* next to the zeros of both */
        const double near = k * 1.57079632679489661923;
        add_angle(w, nextafter(near, -1));
        add_angle(w, near);
        add_angle(w, nextafter(near, 2000));
    }
    report("sine", &w[0]);
    report("cosine", &w[1]);
    drape_sin_cos(-0.0, &s, &c);
    ck_assert(s == 0 && signbit(s) && c == 1);
    const double outside[] = {1025, -1025, DBL_MAX, INFINITY, -INFINITY, NAN};
    for (size_t i = 0; i < sizeof outside / sizeof *outside; i++) {
        drape_sin_cos(outside[i], &s, &c);
        ck_assert(isnan(s) && isnan(c));
    }
}

/* ---- Arc tangent ---- */

static double same_bits(double a, double b)
{
    return memcmp(&a, &b, sizeof a) == 0;
}

static const double special[] = {0,       -0.0,      1,          -1,       0.41421356237309504880,
                                 DBL_MIN, -DBL_MIN,  DBL_MAX,    -DBL_MAX, 3e-9,
                                 -4e11,   0x1p-1074, -0x1p-1074, INFINITY, -INFINITY,
                                 NAN};
enum { SPECIALS = sizeof special / sizeof *special };

LANES_DISPATCH static void four(const double *y, const double *x, double *angle)
{
    lanes_store(angle, lanes_atan2(lanes_load(y), lanes_load(x)));
}

/* Each lane beside other ones, as atan2 of the C library's special values and of quadmath's. */
TEST(arc_tangent)
{
    worst w = {0};
    for (int i = 0; i < samples(); i++) {
        double y[LANES], x[LANES], angle[LANES];
        for (int l = 0; l < LANES; l++) {
            const int kind = (i + l) % 4;
            y[l] = kind == 0   ? uniform(-1, 1)
                   : kind == 3 ? special[(i / 4) % SPECIALS]
                               : of_magnitude(-12, 3);
            x[l] = kind == 0 ? uniform(-1, 1) : kind == 2 ? of_magnitude(-1074, 1023) : of_magnitude(-3, 12);
            if (kind == 2 && i % 3 == 0)
                y[l] = of_magnitude(-1074, 1023);
        }
        four(y, x, angle);
        for (int l = 0; l < LANES; l++) {
            ck_assert(same_bits(angle[l], drape_atan2(y[l], x[l])) || isnan(y[l]));
            if (!isnan(y[l]))
                add(&w, angle[l], atan2q(y[l], x[l]), y[l], x[l]);
        }
    }
    report("atan2", &w);
    for (int i = 0; i < SPECIALS; i++)
        for (int k = 0; k < SPECIALS; k++) {
            const double got = drape_atan2(special[i], special[k]);
            const __float128 expected = atan2q(special[i], special[k]);
            if (isnanq(expected)) {
                ck_assert(isnan(got));
                continue;
            }
            add(&w, got, expected, special[i], special[k]);
            ck_assert_int_eq(signbit(got) != 0, signbit(special[i]) != 0);
        }
}

/* ---- Length ---- */

TEST(length)
{
    worst w = {0};
    for (int i = 0; i < samples(); i++) {
        const double x = uniform(-1, 1), y = uniform(-1, 1), far = of_magnitude(-1074, 1023),
                     near = far * uniform(-2, 2), other = of_magnitude(-70, 70);
        add(&w, drape_hypot(x, y), hypotq(x, y), x, y);
        add(&w, drape_hypot(x, other), hypotq(x, other), x, other);
        add(&w, drape_hypot(far, near), hypotq(far, near), far, near);
    }
    report("hypot", &w);
    for (int i = 0; i < SPECIALS; i++)
        for (int k = 0; k < SPECIALS; k++) {
            const double got = drape_hypot(special[i], special[k]), expected = hypot(special[i], special[k]);
            ck_assert(got == expected || (isnan(got) && isnan(expected)) ||
                      fabs(got - expected) <= 2 * DBL_EPSILON * expected);
        }
    ck_assert(drape_hypot(3, -4) == 5 && drape_hypot(-3e300, 4e300) == 5e300);
}

/* ---- Logarithms ---- */

TEST(logarithms)
{
    worst w[2] = {0};
    for (int i = 0; i < samples(); i++) {
        const double all = fabs(of_magnitude(-1074, 1023)), one = 1 + of_magnitude(-53, -2),
                     gap = uniform(0.05, 1), y = uniform(-1, 1), little = of_magnitude(-1074, -1);
        add(&w[0], drape_ln(all), logq(all), all, 0);
        add(&w[0], drape_ln(one), logq(one), one, 0);
        add(&w[0], drape_ln(gap), logq(gap), gap, 0);
        add(&w[1], drape_ln1p(all), log1pq(all), all, 0);
        add(&w[1], drape_ln1p(y), log1pq(y), y, 0);
        add(&w[1], drape_ln1p(little), log1pq(little), little, 0);
    }
    report("log", &w[0]);
    report("log1p", &w[1]);
    ck_assert(drape_ln(1) == 0 && !signbit(drape_ln(1)) && drape_ln(INFINITY) == INFINITY);
    ck_assert(drape_ln(0) == -INFINITY && drape_ln(-0.0) == -INFINITY);
    ck_assert(isnan(drape_ln(-1)) && isnan(drape_ln(NAN)) && isnan(drape_ln(-INFINITY)));
    ck_assert(drape_ln1p(-1) == -INFINITY && drape_ln1p(INFINITY) == INFINITY);
    ck_assert(isnan(drape_ln1p(-2)) && isnan(drape_ln1p(NAN)));
    ck_assert(drape_ln1p(0) == 0 && signbit(drape_ln1p(-0.0)));
}

/* ---- Powers ---- */

TEST(powers)
{
    worst w = {0};
    for (int i = 0; i < samples(); i++) {
        const double x = fabs(of_magnitude(-1074, 1023)), y = of_magnitude(-12, 10),
                     one = 1 + uniform(-0.3, 0.4), long_y = uniform(-2500, 2500), root = -1.0 / (1 + i % 7),
                     some = uniform(0, 10);
        add(&w, drape_pow(x, y), powq(x, y), x, y);
        add(&w, drape_pow(one, long_y), powq(one, long_y), one, long_y);
        add(&w, drape_pow(some, root), powq(some, root), some, root);
    }
    report("pow", &w);
    static const double of_zero[] = {0, 0.3, 1, 1.5, DBL_MAX, INFINITY, NAN},
                        exponent[] = {0, -0.0, 1, -1, 2, 1e-300, -1e300, INFINITY, -INFINITY, NAN};
    for (size_t i = 0; i < sizeof of_zero / sizeof *of_zero; i++)
        for (size_t k = 0; k < sizeof exponent / sizeof *exponent; k++) {
            const double got = drape_pow(of_zero[i], exponent[k]), expected = pow(of_zero[i], exponent[k]);
            ck_assert_msg(got == expected || (isnan(got) && isnan(expected)) ||
                              fabs(got - expected) <= DBL_EPSILON * expected,
                          "%g^%g = %g, not %g", of_zero[i], exponent[k], got, expected);
        }
    for (int i = 1; i < 30; i++) /* what a double holds is exact */
        ck_assert(drape_pow(i, 3) == i * i * i && drape_pow(2, -i) == ldexp(1, -i) &&
                  drape_pow(i * i, 0.5) == i);
    ck_assert(isnan(drape_pow(-1, 2)) && isnan(drape_pow(-0.5, 0.5)));
}
