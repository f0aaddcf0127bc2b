/*
 * lanes_atan2.h: atan2 of four lanes, with the bits of drape_atan2 in each.
 *
 * With q = min(|y|, |x|) / max(|y|, |x|), atan q = atan t for t = q up to tan(pi/8), and pi/4 + atan t for
 * t = (q - 1)/(q + 1) above; symmetries give the other octants, so that the result is k pi/4 +- atan t. The
 * error of the quotient t is computed from its remainder, which is exact (Dekker 1971, A floating-point
 * technique for extending the available precision; Muller et al. 2018, Handbook of Floating-Point Arithmetic,
 * ch. 4). atan t = t + t^3 A(t^2), where A interpolates the function at 12 Chebyshev nodes; its error is
 * below 2^-58 of t.
 */
#ifndef DRAPE_BASE_LANES_ATAN2_H
#define DRAPE_BASE_LANES_ATAN2_H

#include "base/lanes.h"

LANES_INLINE lanes lanes_select(lanes_mask mask, lanes yes, lanes no)
{
    return (lanes)((mask & (lanes_mask)yes) | (~mask & (lanes_mask)no));
}

LANES_INLINE bool lanes_any(lanes_mask mask)
{
    return (mask[0] | mask[1] | mask[2] | mask[3]) != 0;
}

LANES_INLINE lanes lanes_abs(lanes a)
{
    return (lanes)((lanes_mask)a & INT64_MAX);
}

/* The upper half of the digits, by Veltkamp's splitting; a up to 2^996. */
LANES_INLINE lanes lanes_upper(lanes a)
{
    const lanes c = 134217729 * a; /* 2^27 + 1 */
    return c - (c - a);
}

/* a b - product, for product = a * b rounded: exact if it does not underflow. */
LANES_INLINE lanes lanes_product_error(lanes a, lanes b, lanes product)
{
    const lanes a1 = lanes_upper(a), a2 = a - a1, b1 = lanes_upper(b), b2 = b - b1;
    return ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2;
}

/* A(z), z = t^2 */
LANES_INLINE lanes lanes_atan_series(lanes z)
{
    const lanes w = z * z;
    const lanes even =
        -0x1.5555555555555p-2 +
        w * (-0x1.249249248d7dcp-3 +
             w * (-0x1.745d165dc9713p-4 +
                  w * (-0x1.110e87b4357d2p-4 + w * (-0x1.ac7a5a79b3f26p-5 + w * -0x1.1b311bb48c215p-5))));
    const lanes odd =
        0x1.9999999999953p-3 +
        w * (0x1.c71c71c303dbbp-4 +
             w * (0x1.3b1392d519db1p-4 +
                  w * (0x1.e19a0bfa3eef9p-5 + w * (0x1.74dccfb93fff0p-5 + w * 0x1.0acd9e91a5a35p-6))));
    return even + z * odd;
}

#define LANES_ATAN2_MIN 0x1p-400 /* of the larger of |x| and |y|, and of their quotient, for its remainder */
#define LANES_ATAN2_MAX 0x1p+400

/* Replaces y and x by numbers of the same angle within the limits above; NaN stays. */
void drape_atan2_scale(double *y, double *x);

LANES_INLINE lanes lanes_atan2(lanes y, lanes x)
{
    const lanes zero = {0}, one = zero + 1;
    lanes ay = lanes_abs(y), ax = lanes_abs(x);
    lanes_mask steep = ay > ax;
    lanes max = lanes_select(steep, ay, ax), min = lanes_select(steep, ax, ay);
    if (lanes_any(~((max >= LANES_ATAN2_MIN) & (max <= LANES_ATAN2_MAX) & (min <= max)))) {
        for (int l = 0; l < LANES; l++) {
            double of_y = y[l], of_x = x[l];
            drape_atan2_scale(&of_y, &of_x);
            y[l] = of_y, x[l] = of_x;
        }
        ay = lanes_abs(y), ax = lanes_abs(x), steep = ay > ax;
        max = lanes_select(steep, ay, ax), min = lanes_select(steep, ax, ay);
    }
    const double tan_eighth = 0x1.a827999fcef32p-2; /* tan(pi/8) */
    const lanes_mask upper = min > tan_eighth * max, left = (lanes_mask)x < 0;

    /* t + t_low = (top + top_low) / (bottom + bottom_low) */
    const lanes top = lanes_select(upper, min - max, min), bottom = lanes_select(upper, min + max, max);
    const lanes top_low = lanes_select(upper, min - (top + max), zero);
    const lanes bottom_low = lanes_select(upper, min - (bottom - max), zero);
    const lanes t = top / bottom, product = t * bottom;
    const lanes remainder =
        (((top - product) - lanes_product_error(t, bottom, product)) + top_low) - t * bottom_low;
    const lanes t_low = lanes_select(lanes_abs(t) >= LANES_ATAN2_MIN, remainder / bottom, zero);

    /* The angle from the x axis is k pi/4 + sign atan t. */
    const lanes k_first = lanes_select(upper, one, zero), k_steep = lanes_select(steep, 2 - k_first, k_first);
    const lanes k = lanes_select(left, 4 - k_steep, k_steep);
    const lanes sign = lanes_select(steep ^ left, -one, one);
    const lanes z = t * t, base = k * 0x1.921fb54442d18p-1, base_low = k * 0x1.1a62633145c07p-55;
    const lanes sum = base + sign * t, sum_low = (base - sum) + sign * t;
    const lanes angle = sum + (sum_low + (base_low + sign * (t_low + t * z * lanes_atan_series(z))));
    return (lanes)((lanes_mask)angle | ((lanes_mask)y & INT64_MIN));
}

#endif
