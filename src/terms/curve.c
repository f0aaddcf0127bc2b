/* curve.c: see curve.h. A table begins with the number of pieces; then come those of each, from the strain
 * s0 on: s0, the energy there, and c0 ... c3 of T = c0 + c1 d + c2 d^2 + c3 d^3, d = s - s0. The last piece
 * is the tangent beyond the last point. */
#include "terms/curve.h"

#include <math.h>

enum { START, ENERGY, C0, C1, C2, C3, PIECE };

static const double *piece_at(const double *table, double s)
{
    const int32_t last = (int32_t)table[0] - 1;
    int32_t low = 0, high = last;
    while (low < high) {
        const int32_t middle = (low + high + 1) / 2;
        if (s < table[1 + PIECE * middle + START])
            high = middle - 1;
        else
            low = middle;
    }
    return table + 1 + PIECE * low;
}

static double energy_in(const double *p, double d)
{
    return p[ENERGY] + d * (p[C0] + d * (p[C1] / 2 + d * (p[C2] / 3 + d * (p[C3] / 4))));
}

/* The slope at the end of a chord of length h0, beside one of h1: that of the parabola through the three
 * points, within bounds. */
static double end_slope(double h0, double h1, double chord0, double chord1)
{
    const double parabola = ((2 * h0 + h1) * chord0 - h0 * chord1) / (h0 + h1);
    return fmin(fmax(parabola, chord0 / 3), 3 * chord0);
}

/* Point number i > 0, counted from the origin, which is point 0. */
static void point_at(const drape_points *points, double (*strain_of)(double), int32_t i, double *s, double *f)
{
    *s = strain_of ? strain_of(points->point[2 * i - 2]) : points->point[2 * i - 2];
    *f = points->point[2 * i - 1];
}

void drape_curve_make(const drape_points *points, double (*strain_of)(double), double *table)
{
    const int32_t count = points->count;
    double s0 = 0, f0 = 0, s1, f1, s2, f2; /* at the beginning of the piece, its end, the end of the next */
    double before = 0, h0 = 0, chord0 = 0; /* slope at the beginning; of the chord before */
    double *p = table + 1;
    table[0] = count + 1;
    for (int32_t i = 0; i < count; i++, p += PIECE) {
        point_at(points, strain_of, i + 1, &s1, &f1);
        const double h = s1 - s0, chord = (f1 - f0) / h;
        double after = chord; /* of a single point */
        if (i + 1 < count) {
            point_at(points, strain_of, i + 2, &s2, &f2);
            const double h1 = s2 - s1, chord1 = (f2 - f1) / h1, w0 = 2 * h1 + h, w1 = h1 + 2 * h;
            after = (w0 + w1) / (w0 / chord + w1 / chord1);
            if (i == 0)
                before = end_slope(h, h1, chord, chord1);
        } else if (i > 0) {
            after = end_slope(h, h0, chord, chord0);
        } else {
            before = chord;
        }
        p[START] = s0;
        p[ENERGY] = i ? energy_in(p - PIECE, s0 - p[START - PIECE]) : 0;
        p[C0] = f0;
        p[C1] = before;
        p[C2] = (3 * chord - 2 * before - after) / h;
        p[C3] = (before + after - 2 * chord) / (h * h);
        before = after, h0 = h, chord0 = chord, s0 = s1, f0 = f1;
    }
    p[START] = s0;
    p[ENERGY] = energy_in(p - PIECE, s0 - p[START - PIECE]);
    p[C0] = f0;
    p[C1] = before;
    p[C2] = p[C3] = 0;
}

double drape_curve_stiffness(const double *table)
{
    return table[1 + C1];
}

drape_curve_value drape_curve_at(const double *table, double s)
{
    const double *p = piece_at(table, s), d = s - p[START];
    return (drape_curve_value){.energy = energy_in(p, d),
                               .force = p[C0] + d * (p[C1] + d * (p[C2] + d * p[C3])),
                               .slope = p[C1] + d * (2 * p[C2] + d * 3 * p[C3])};
}

/* With the stiffness k: in the first piece q = s sqrt(r), r = 1 + 2 c2/(3 k) s + c3/(2 k) s^2, which has no
 * quotient of small numbers; in the others q = sqrt(2 energy/k), q' = T/(k q), q'' = (T'/k - q'^2)/q. */
drape_curve_measure_value drape_curve_measure(const double *table, double s)
{
    const double k = drape_curve_stiffness(table), *p = piece_at(table, s);
    if (p == table + 1) {
        const double a = 2 * p[C2] / (3 * k), b = p[C3] / (2 * k);
        const double r = 1 + s * (a + s * b), dr = a + 2 * b * s, root = sqrt(r), half = dr / (2 * root);
        return (drape_curve_measure_value){s * root, root + s * half,
                                           2 * half + s * (b - half * half) / root};
    }
    const drape_curve_value v = drape_curve_at(table, s);
    const double q = sqrt(2 * v.energy / k), dq = v.force / (k * q);
    return (drape_curve_measure_value){q, dq, (v.slope / k - dq * dq) / q};
}
