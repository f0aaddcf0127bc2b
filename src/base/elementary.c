/*
 * elementary.c: sums of two doubles ("double-double", Dekker 1971) carry the digits that one double would
 * lose; Muller et al. 2018, Handbook of Floating-Point Arithmetic, ch. 4, 11 and 14, has the operations, the
 * bounds of their errors and the reductions of arguments. Series are those of Taylor, long enough that what
 * they leave out is below 2^-60 of the result: none of these functions but log is called in inner loops.
 */
#include "base/elementary.h"
#include "base/lanes_atan2.h"
#include "base/pi.h"

#include <float.h>
#include <math.h>

typedef struct pair {
    double hi, lo; /* |lo| is at most half a unit in the last place of hi */
} pair;

#define COUNT(array) ((int)(sizeof(array) / sizeof *(array)))

/* a + b, for |a| >= |b| or a = 0 */
static inline pair sum_sorted(double a, double b)
{
    const double hi = a + b;
    return (pair){hi, b - (hi - a)};
}

static inline pair sum(double a, double b)
{
    const double hi = a + b, part = hi - a;
    return (pair){hi, (a - (hi - part)) + (b - part)};
}

/* The upper half of the digits, by Veltkamp's splitting. */
static inline double upper(double a)
{
    const double c = 134217729 * a; /* 2^27 + 1 */
    return c - (c - a);
}

/* a b */
static inline pair product(double a, double b)
{
    const double hi = a * b, a1 = upper(a), a2 = a - a1, b1 = upper(b), b2 = b - b1;
    return (pair){hi, ((a1 * b1 - hi) + a1 * b2 + a2 * b1) + a2 * b2};
}

/* a b and a + b of pairs: relative errors of some 2^-104, the sum if a and b have the same sign or |a| >= 2
 * |b|. */
static pair product_of_pairs(pair a, pair b)
{
    const pair p = product(a.hi, b.hi);
    return sum_sorted(p.hi, p.lo + (a.hi * b.lo + a.lo * b.hi));
}

static pair sum_of_pairs(pair a, pair b)
{
    const pair s = sum(a.hi, b.hi);
    return sum_sorted(s.hi, s.lo + (a.lo + b.lo));
}

/* c[0] + c[1] x + ... */
static inline double polynomial(const double *c, int count, double x)
{
    double value = c[count - 1];
    for (int i = count - 2; i >= 0; i--)
        value = c[i] + x * value;
    return value;
}

/* ---- Sine and cosine ---- */

/* pi/2 in three parts: products of the first two with integers below 2^10 are exact (Cody & Waite 1980,
 * Software Manual for the Elementary Functions). */
static const double half_pi[] = {0x1.921fb54442c00p+0, 0x1.18469898cc400p-44, 0x1.1701b839a2520p-88};

static const double sine_series[] = {
    -1.0 / 6,        1.0 / 120,        -1.0 / 5040,         1.0 / 362880,
    -1.0 / 39916800, 1.0 / 6227020800, -1.0 / 1307674368e3, 1.0 / 355687428096e3};
static const double cosine_series[] = {
    1.0 / 24,        -1.0 / 720,         1.0 / 40320,         -1.0 / 3628800,
    1.0 / 479001600, -1.0 / 87178291200, 1.0 / 20922789888e3, -1.0 / 6402373705728e3};

void drape_sin_cos(double angle, double *sine, double *cosine)
{
    if (!(fabs(angle) <= DRAPE_SIN_COS_MAX)) {
        *sine = *cosine = NAN;
        return;
    }
    /* angle = turns pi/2 + r, |r| <= pi/4 */
    const double turns = floor(angle * (2 / DRAPE_PI) + 0.5);
    pair r = sum(angle - turns * half_pi[0], -turns * half_pi[1]);
    r = sum_sorted(r.hi, r.lo - turns * half_pi[2]);

    const pair square = product(r.hi, r.hi);
    const double z = square.hi;
    const double s =
        r.hi + (r.hi * z * polynomial(sine_series, COUNT(sine_series), z) + r.lo * (1 - 0.5 * z));
    const pair falling = sum_sorted(1, -0.5 * z);
    const double c =
        falling.hi +
        (falling.lo +
         ((z * z * polynomial(cosine_series, COUNT(cosine_series), z) - 0.5 * square.lo) - r.hi * r.lo));
    const int quarter = (int)turns & 3;
    *sine = quarter == 0 ? s : quarter == 1 ? c : quarter == 2 ? -s : -c;
    *cosine = quarter == 0 ? c : quarter == 1 ? -s : quarter == 2 ? -c : s;
    if (angle == 0)
        *sine = angle; /* keeps the sign of zero */
}

/* ---- Arc tangent ---- */

void drape_atan2_scale(double *y, double *x)
{
    const double ay = fabs(*y), ax = fabs(*x), max = fmax(ay, ax), min = fmin(ay, ax);
    int exponent;
    if (isnan(ay) || isnan(ax)) {
        *y = *x = NAN;
    } else if (max == 0) {
        *x = copysign(1, *x);
    } else if (isinf(max)) {
        *y = copysign(isinf(ay) ? 1 : 0, *y);
        *x = copysign(isinf(ax) ? 1 : 0, *x);
    } else if (min / max < LANES_ATAN2_MIN) {
        *y /= max;
        *x /= max;
    } else {
        frexp(max, &exponent);
        *y = ldexp(*y, -exponent);
        *x = ldexp(*x, -exponent);
    }
}

double drape_atan2(double y, double x)
{
    const lanes of_y = {y, y, y, y}, of_x = {x, x, x, x};
    return lanes_atan2(of_y, of_x)[0];
}

/* ---- Length ---- */

/* The root is corrected by its residual (Borges 2020, Algorithm 1014: an improved algorithm for hypot(x, y)).
 */
double drape_hypot(double x, double y)
{
    double a = fmax(fabs(x), fabs(y)), b = fmin(fabs(x), fabs(y)), unit = 1;
    if (isinf(x) || isinf(y))
        return INFINITY;
    if (isnan(x) || isnan(y))
        return NAN;
    if (b <= 0x1p-60 * a)
        return a + b;
    if (a < 0x1p-350)
        unit = 0x1p-700;
    else if (a > 0x1p+400)
        unit = 0x1p+700;
    a /= unit, b /= unit;
    const double h = sqrt(a * a + b * b);
    const pair hh = product(h, h), aa = product(a, a), bb = product(b, b);
    const double residual = ((hh.hi - aa.hi) - bb.hi) + ((hh.lo - aa.lo) - bb.lo);
    return (h - residual / (2 * h)) * unit;
}

/* ---- Logarithms ---- */

/* ln 2 in two parts: products of the first one with integers below 2^11 are exact. */
static const double ln2[] = {0x1.62e42fefa3800p-1, 0x1.ef35793c76730p-45};

static const double root_half = 0.70710678118654752440;

/* log(1 + f) = 2 artanh s, s = f/(2 + f): the pair s for 1 + f in [sqrt(1/2), sqrt 2]. */
static inline pair artanh_argument(double f)
{
    const pair below = sum_sorted(2, f);
    const double s = f / below.hi;
    const pair back = product(s, below.hi);
    return (pair){s, (((f - back.hi) - back.lo) - s * below.lo) / below.hi};
}

/* k ln 2 + log(1 + f) + c, for a small c. */
static inline double log_sum(int k, double f, double c)
{
    static const double series[] = {2.0 / 3,  2.0 / 5,  2.0 / 7,  2.0 / 9,  2.0 / 11,
                                    2.0 / 13, 2.0 / 15, 2.0 / 17, 2.0 / 19, 2.0 / 21};
    const pair s = artanh_argument(f);
    const double z = s.hi * s.hi, rest = s.hi * z * polynomial(series, COUNT(series), z);
    const pair t = sum_sorted(k * ln2[0], 2 * s.hi);
    return t.hi + (t.lo + (k * ln2[1] + (2 * s.lo + rest) + c));
}

/* x = 2^k m, m in [sqrt(1/2), sqrt 2); x > 0 and finite. Returns m. */
static inline double split_exponent(double x, int *k)
{
    uint64_t bits;
    *k = -1022;
    if (x < DBL_MIN) {
        x *= 0x1p+54;
        *k -= 54;
    }
    memcpy(&bits, &x, sizeof bits);
    *k += (int)(bits >> 52);
    bits = (bits & (((uint64_t)1 << 52) - 1)) | (uint64_t)1022 << 52; /* in [1/2, 1) */
    memcpy(&x, &bits, sizeof x);
    const bool low = x < root_half;
    *k -= low;
    return low ? 2 * x : x;
}

double drape_ln(double x)
{
    int k;
    if (!(x > 0 && x <= DBL_MAX))
        return x == 0 ? -INFINITY : x > 0 ? x : NAN;
    const double m = split_exponent(x, &k);
    return log_sum(k, m - 1, 0);
}

double drape_ln1p(double x)
{
    int k;
    if (!(x > -1 && x <= DBL_MAX))
        return x == -1 ? -INFINITY : x > 0 ? x : NAN;
    if (fabs(x) < 0x1p-54)
        return x;
    if (x >= root_half - 1 && x <= 2 * root_half - 1)
        return log_sum(0, x, 0);
    const pair u = sum(1, x);
    const double m = split_exponent(u.hi, &k);
    return log_sum(k, m - 1, u.lo / u.hi);
}

/* ---- Powers ---- */

/* log x to some 2^-68 of its value, which the exponents up to 2^10 of pow need; x > 0 and finite. */
static pair log_of(double x)
{
    static const double series[] = {1.0 / 7,  1.0 / 9,  1.0 / 11, 1.0 / 13, 1.0 / 15,
                                    1.0 / 17, 1.0 / 19, 1.0 / 21, 1.0 / 23, 1.0 / 25};
    static const pair third = {0x1.5555555555555p-2, 0x1.5555555555555p-56},
                      fifth = {0x1.999999999999ap-3, -0x1.999999999999ap-57};
    int k;
    const pair s = artanh_argument(split_exponent(x, &k) - 1), z = product_of_pairs(s, s);
    const pair rest = {z.hi * polynomial(series, COUNT(series), z.hi), 0};
    pair q = sum_of_pairs(third, product_of_pairs(z, sum_of_pairs(fifth, rest)));
    q = sum_of_pairs((pair){1, 0}, product_of_pairs(z, q));
    q = product_of_pairs((pair){2 * s.hi, 2 * s.lo}, q);
    return sum_of_pairs(sum(k * ln2[0], k * ln2[1]), q);
}

/* e^x for |x| <= 2^20 */
static double exp_of(pair x)
{
    static const double series[] = {1.0 / 2,          1.0 / 6,        1.0 / 24,        1.0 / 120,
                                    1.0 / 720,        1.0 / 5040,     1.0 / 40320,     1.0 / 362880,
                                    1.0 / 3628800,    1.0 / 39916800, 1.0 / 479001600, 1.0 / 6227020800,
                                    1.0 / 87178291200};
    if (fabs(x.hi) > 800)
        return x.hi > 0 ? INFINITY : 0;
    const double n = floor(x.hi * (1 / 0.69314718055994530942) + 0.5);
    pair r = sum(x.hi - n * ln2[0], -n * ln2[1]);
    r = sum_sorted(r.hi, r.lo + x.lo);
    const pair one = sum_sorted(1, r.hi);
    const double rest = r.hi * r.hi * polynomial(series, COUNT(series), r.hi) + r.lo * (1 + r.hi);
    return ldexp(one.hi + (one.lo + rest), (int)n);
}

double drape_pow(double x, double y)
{
    if (y == 0 || x == 1)
        return 1;
    if (!(x >= 0) || isnan(y))
        return NAN;
    if (x == 0 || isinf(x))
        return (x == 0) == (y < 0) ? INFINITY : 0;
    y = fmin(fmax(y, -0x1p+64), 0x1p+64); /* beyond, every x but 1 gives 0 or infinity */
    const pair log_x = log_of(x), p = product(y, log_x.hi);
    return exp_of(sum_sorted(p.hi, p.lo + y * log_x.lo));
}
