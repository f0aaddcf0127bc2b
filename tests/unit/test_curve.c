/* test_curve.c: the spline through measured points: it increases where they do, its energy is convex and the
 * integral of its force, and the measure that stands for it has the right derivatives. */
#include "terms/curve.h"

#include <math.h>
#include <stdint.h>

#include "support/suite.h"

#define MOST 12

/* In [0, 1): xorshift64*. */
static double random_share(uint64_t *seed)
{
    *seed ^= *seed >> 12;
    *seed ^= *seed << 25;
    *seed ^= *seed >> 27;
    return (double)((*seed * UINT64_C(2685821657736338717)) >> 11) / 9007199254740992.0;
}

/* Points whose distances along both axes differ by up to a factor of ten thousand. */
static drape_points draw(uint64_t *seed, double *point)
{
    drape_points points = {1 + (int32_t)(MOST * random_share(seed)), point};
    double s = 0, f = 0;
    for (int32_t i = 0; i < points.count; i++) {
        point[2 * i] = s += 0.01 * pow(10, 4 * random_share(seed) - 3);
        point[2 * i + 1] = f += 50 * pow(10, 4 * random_share(seed) - 3);
    }
    return points;
}

static void for_many(void (*check)(const drape_points *points, const double *table))
{
    uint64_t seed = 20;
    for (int trial = 0; trial < 300; trial++) {
        double point[2 * MOST + 2], table[DRAPE_CURVE_SIZE(MOST + 1)];
        const drape_points points = draw(&seed, point);
        drape_curve_make(&points, NULL, table);
        check(&points, table);
    }
}

/* On both sides of a point the cubics agree with it up to rounding: that of forces over the length h of a
 * piece, and of strains times the slope's own change, at most about force/h^2. */
static void check_points(const drape_points *points, const double *table)
{
    const double last = points->point[2 * points->count - 1];
    for (int32_t i = 0; i < points->count; i++) {
        const double s = points->point[2 * i], f = points->point[2 * i + 1];
        const drape_curve_value at = drape_curve_at(table, s),
                                before = drape_curve_at(table, s * (1 - 1e-15));
        ck_assert_double_eq(at.force, f);
        ck_assert_double_le(fabs(before.force - f), 1e-10 * last);
        ck_assert_double_le(fabs(before.energy - at.energy), 1e-10 * last * s);
        const double h = s - (i ? points->point[2 * i - 2] : 0);
        ck_assert_double_le(fabs(before.slope - at.slope), 1e-13 * last / h * (1 + s / h));
    }
    const drape_curve_value zero = drape_curve_at(table, 0);
    ck_assert_double_eq(zero.energy, 0);
    ck_assert_double_eq(zero.force, 0);
    ck_assert_double_eq(zero.slope, drape_curve_stiffness(table));
}

TEST(it_goes_through_its_points)
{
    for_many(check_points);
}

/* The slope is positive everywhere, and Simpson's rule, which is exact for cubics, gives the energy. */
static void check_convex(const drape_points *points, const double *table)
{
    for (int32_t i = 0; i <= points->count; i++) {
        const double s0 = i ? points->point[2 * i - 2] : 0,
                     s1 = i < points->count ? points->point[2 * i] : 3 * s0;
        for (int k = 0; k < 50; k++) {
            const double a = s0 + k * (s1 - s0) / 50, b = s0 + (k + 0.999) * (s1 - s0) / 50;
            const drape_curve_value from = drape_curve_at(table, a),
                                    middle = drape_curve_at(table, (a + b) / 2),
                                    to = drape_curve_at(table, b);
            ck_assert_msg(middle.slope > 0 && to.slope > 0, "piece %d of %d", (int)i, (int)points->count);
            const double work = (b - a) * (from.force + 4 * middle.force + to.force) / 6;
            ck_assert_double_le(fabs(to.energy - from.energy - work), 1e-12 * to.energy);
        }
    }
}

TEST(its_energy_is_convex)
{
    for_many(check_convex);
}

/* Central differences of step h have an error of about (h/s)^2, s the distance to the nearest point; near a
 * point the second derivative of the force jumps. */
static void check_measure(const drape_points *points, const double *table)
{
    for (int32_t i = 0; i <= points->count; i++) {
        const double s0 = i ? points->point[2 * i - 2] : 0,
                     s1 = i < points->count ? points->point[2 * i] : 2 * s0;
        const double s = s0 + 0.37 * (s1 - s0), h = 1e-4 * (s1 - s0);
        const drape_curve_measure_value a = drape_curve_measure(table, s - h),
                                        m = drape_curve_measure(table, s),
                                        b = drape_curve_measure(table, s + h);
        const drape_curve_value v = drape_curve_at(table, s);
        const double k = drape_curve_stiffness(table), size = fmax(fabs(m.ddq), m.dq / (s1 - s0));
        ck_assert_double_le(fabs(k * m.q * m.q / 2 - v.energy), 1e-12 * v.energy);
        ck_assert_double_le(fabs(k * m.q * m.dq - v.force), 1e-9 * v.force);
        ck_assert_double_le(fabs(k * m.dq * m.dq + k * m.q * m.ddq - v.slope),
                            1e-9 * (v.slope + k * m.dq * m.dq));
        ck_assert_double_le(fabs((b.q - a.q) / (2 * h) - m.dq), 1e-5 * m.dq);
        ck_assert_double_le(fabs((b.dq - a.dq) / (2 * h) - m.ddq), 1e-5 * size);
    }
    const drape_curve_measure_value zero = drape_curve_measure(table, 0);
    ck_assert_double_eq(zero.q, 0);
    ck_assert_double_eq(zero.dq, 1);
}

TEST(its_measure_has_the_energy_and_its_derivatives)
{
    for_many(check_measure);
}

static double half(double s)
{
    return s / 2;
}

TEST(straight_lines_are_exact)
{
    const double point[] = {0.01, 3, 0.02, 6, 0.05, 15};
    double table[DRAPE_CURVE_SIZE(3)];
    for (int32_t count = 1; count <= 3; count++) {
        drape_curve_make(&(drape_points){count, point}, half,
                         table); /* the strains are half of those given */
        for (double s = 0; s < 0.1; s += 0.0037) {
            const drape_curve_value v = drape_curve_at(table, s);
            ck_assert_double_eq_tol(v.force, 600 * s, 1e-11);
            ck_assert_double_eq_tol(v.energy, 300 * s * s, 1e-13);
            ck_assert_double_eq_tol(v.slope, 600, 1e-9);
            ck_assert_double_eq_tol(drape_curve_measure(table, s).q, s, 1e-14);
        }
    }
}
