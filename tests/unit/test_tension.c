/* test_tension.c: the relaxed law of a membrane that wrinkles, for isotropic and very anisotropic sheets: the
 * conditions of the minimum, its derivatives, and the closed form of an isotropic sheet. */
#include "support/suite.h"
#include "terms/tension.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

enum { LAWS = 400, STRAINS = 60 };

static uint64_t seed = 20041;

static double uniform(double low, double high)
{
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return low + (high - low) * (double)(seed >> 11) / 9007199254740992.0;
}

/* Stiffnesses over four orders of magnitude, any Poisson's ratio that is allowed. */
static void any_law(double c[9])
{
    const double nu = uniform(-0.95, 0.95);
    memset(c, 0, 9 * sizeof *c);
    c[0] = pow(10, uniform(-2, 2));
    c[4] = pow(10, uniform(-2, 2));
    c[1] = c[3] = nu * sqrt(c[0] * c[4]);
    c[8] = sqrt(c[0] * c[4]) * pow(10, uniform(-2, 1));
}

static void any_strain(double e[3])
{
    const double size = pow(10, uniform(-6, 0));
    for (int i = 0; i < 3; i++)
        e[i] = size * uniform(-1, 1);
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* C^-1 t */
static void compliance(const double c[9], const double t[3], double e[3])
{
    const double determinant = c[0] * c[4] - c[1] * c[1];
    e[0] = (c[4] * t[0] - c[1] * t[1]) / determinant;
    e[1] = (c[0] * t[1] - c[1] * t[0]) / determinant;
    e[2] = t[2] / c[8];
}

/* The lower eigenvalue of the matrix (a, o; o, b), over the size of its entries. */
static double lowest(double a, double b, double o)
{
    return ((a + b) - hypot(a - b, 2 * o)) / 2 / (fabs(a) + fabs(b) + fabs(o) + 1e-300);
}

/* These conditions are sufficient, as the problem is convex: T and s = C^-1 T - e positive semidefinite, and
 * T : s = 0; the energy is that of C^-1 T. The bounds are rounding times the condition of C, which is 1e4 at
 * most beside Poisson's ratio: 1e-16 1e4/(1 - .95^2) = 1e-11. */
TEST(the_stress_is_that_of_the_minimum)
{
    int of[3] = {0};
    for (int k = 0; k < LAWS; k++) {
        double c[9], e[3], elastic[3];
        any_law(c);
        for (int i = 0; i < STRAINS; i++) {
            drape_tension r;
            any_strain(e);
            drape_tension_relax(c, e, &r);
            compliance(c, r.stress, elastic);
            const double s[3] = {elastic[0] - e[0], elastic[1] - e[1], elastic[2] - e[2]};
            const double size = fmax(fabs(e[0]), fmax(fabs(e[1]), fabs(e[2]))) + 1e-300;
            const double scale = size * (c[0] + c[4] + c[8]);
            ck_assert_double_ge(lowest(r.stress[0], r.stress[1], r.stress[2]) *
                                    fabs(r.stress[0] + r.stress[1]),
                                -1e-11 * scale);
            ck_assert_double_ge((s[0] + s[1] - hypot(s[0] - s[1], s[2])) / 2, -1e-9 * size);
            ck_assert_double_le(fabs(dot(r.stress, s)), 1e-11 * scale * size);
            ck_assert_double_eq_tol(r.energy, 0.5 * dot(r.stress, elastic), 1e-11 * scale * size);
            of[r.state]++;
        }
    }
    for (int k = 0; k < 3; k++)
        ck_assert_int_ge(of[k], LAWS);
}

/* Central differences with a step d of 1e-6 of the strain: their error is d^2 times the third derivative,
 * some 1e-12 over the square of the distance from another state, and rounding 1e-16/1e-6 times the condition
 * of the law. States with another one within 3 % of the strain are left out: the second derivative jumps. */
TEST(its_derivatives_are_exact)
{
    int compared = 0;
    for (int k = 0; k < LAWS; k++) {
        double c[9], e[3];
        any_law(c);
        for (int i = 0; i < STRAINS; i++) {
            drape_tension r, near[2];
            bool same = true;
            any_strain(e);
            drape_tension_relax(c, e, &r);
            const double size = fmax(fabs(e[0]), fmax(fabs(e[1]), fabs(e[2])));
            for (int j = 0; j < 3; j++)
                for (int sign = -1; sign <= 1; sign += 2) {
                    double at[3] = {e[0], e[1], e[2]};
                    at[j] += sign * 3e-2 * size;
                    drape_tension_relax(c, at, near);
                    same = same && near->state == r.state;
                }
            for (int j = 0; same && j < 3; j++) {
                const double d = 1e-6 * size, scale = c[0] + c[4] + c[8];
                for (int sign = 0; sign < 2; sign++) {
                    double at[3] = {e[0], e[1], e[2]};
                    at[j] += sign ? d : -d;
                    drape_tension_relax(c, at, near + sign);
                }
                ck_assert_double_eq_tol((near[1].energy - near[0].energy) / (2 * d), r.stress[j],
                                        1e-7 * scale * size);
                for (int l = 0; l < 3; l++)
                    ck_assert_double_eq_tol((near[1].stress[l] - near[0].stress[l]) / (2 * d),
                                            r.tangent[3 * l + j], 1e-6 * scale);
                compared++;
            }
        }
    }
    ck_assert_int_ge(compared, LAWS * STRAINS);
}

/* E h in tension along 1 alone: of the strain e1, with e2 below -nu e1, T11 = E h e1. */
TEST(an_isotropic_sheet_wrinkles_under_uniaxial_tension)
{
    const double nu = 0.3, a = 1 / (1 - nu * nu);
    const double c[9] = {a, nu * a, 0, nu * a, a, 0, 0, 0, (1 - nu) / 2 * a};
    drape_tension r;
    drape_tension_relax(c, (double[]){0.01, -0.0031, 0}, &r);
    ck_assert_int_eq(r.state, DRAPE_WRINKLED);
    ck_assert_double_eq_tol(r.stress[0], 0.01, 1e-16);
    ck_assert_double_eq_tol(fabs(r.stress[1]) + fabs(r.stress[2]), 0, 1e-16);
    drape_tension_relax(c, (double[]){0.01, -0.0029, 0}, &r);
    ck_assert_int_eq(r.state, DRAPE_TAUT);
    drape_tension_relax(c, (double[]){-0.01, -0.0029, 0}, &r);
    ck_assert_int_eq(r.state, DRAPE_SLACK);
    ck_assert_double_eq(r.energy, 0);
    drape_tension_relax(c, (double[]){0, 0, 0}, &r);
    ck_assert_int_eq(r.state, DRAPE_TAUT); /* a sheet at rest has its stiffness */
}
