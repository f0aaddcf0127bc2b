/* tension.c: see tension.h. */
#include "terms/tension.h"

#include "base/elementary.h"
#include "base/pi.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

/* Strains this small are rounding errors: a sheet at rest counts as taut, and has its stiffness. Coordinates
 * are up to some hundred edges, and so are their rounding errors relative to an edge. */
#define ROUNDING (512 * DBL_EPSILON)

#define DIRECTIONS 16 /* in which the wrinkles are sought first, in half a turn */

/* ---- Strains and stresses of a plane ---- */

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* C e */
static void apply(const double c[9], const double e[3], double t[3])
{
    for (int i = 0; i < 3; i++)
        t[i] = dot(c + 3 * i, e);
}

/* The lower eigenvalue of a symmetric matrix from its trace, difference of the diagonal and off-diagonal. */
static double lower(double trace, double difference, double off)
{
    return (trace - drape_hypot(difference, 2 * off)) / 2;
}

/* ---- The direction of the wrinkles ---- */

/* Unit vectors m across the wrinkles and n along them, and what depends on them. */
typedef struct wrinkle {
    double m[2], n[2];
    double across[3], turned[3]; /* M = m m' and N = m n' + n m' as strains; N = dM/dangle */
    double c_across[3];          /* C M */
    double stiffness;            /* M' C M */
    double amount;               /* a, at which m' T m = 0 */
    double stress[3];            /* T */
    double shear;                /* m' T n = N' T/2: 0 at the minimum */
} wrinkle;

/* Of the direction m + u n of another one. */
static void wrinkle_at(const double c[9], const double t0[3], const wrinkle *from, double u, wrinkle *w)
{
    const double length = sqrt(1 + u * u);
    for (int i = 0; i < 2; i++)
        w->m[i] = (from->m[i] + u * from->n[i]) / length;
    w->n[0] = -w->m[1];
    w->n[1] = w->m[0];
    const double *m = w->m, *n = w->n;
    memcpy(w->across, (double[]){m[0] * m[0], m[1] * m[1], 2 * m[0] * m[1]}, sizeof w->across);
    memcpy(w->turned, (double[]){2 * m[0] * n[0], 2 * m[1] * n[1], 2 * (m[0] * n[1] + m[1] * n[0])},
           sizeof w->turned);
    apply(c, w->across, w->c_across);
    w->stiffness = dot(w->across, w->c_across);
    w->amount = -dot(w->across, t0) / w->stiffness;
    for (int i = 0; i < 3; i++)
        w->stress[i] = t0[i] + w->amount * w->c_across[i];
    w->shear = dot(w->turned, w->stress) / 2;
}

static double tension_along(const wrinkle *w)
{
    const double *n = w->n;
    return dot((double[]){n[0] * n[0], n[1] * n[1], 2 * n[0] * n[1]}, w->stress);
}

/* Newton's method for the direction in which the shear vanishes, between the neighbours of the first one;
 * the shear has the sign of the derivative of that quotient. */
static void find_direction(const double c[9], const double t0[3], wrinkle *w)
{
    /* The one of several directions with the lowest M' T0/sqrt(M' C M): the energy is lower by half the
     * square of its negative part, and the minimum lies between its neighbours. */
    wrinkle first;
    double m[2] = {1, 0}, lowest = INFINITY, sine, cosine;
    drape_sin_cos(DRAPE_PI / DIRECTIONS, &sine, &cosine);
    for (int i = 0; i < DIRECTIONS; i++) {
        const wrinkle from = {.m = {m[0], m[1]}};
        wrinkle_at(c, t0, &from, 0, w);
        const double value = -w->amount * sqrt(w->stiffness);
        if (value < lowest) {
            lowest = value;
            first = *w;
        }
        m[0] = cosine * from.m[0] - sine * from.m[1];
        m[1] = sine * from.m[0] + cosine * from.m[1];
    }
    double high = sine / cosine, low = -high, u = 0; /* tangents of the angle to the first one */
    *w = first;
    for (bool done = false; !done && w->shear != 0;) {
        double c_turned[3];
        apply(c, w->turned, c_turned);
        *(w->shear > 0 ? &high : &low) = u;
        const double mixed = dot(w->across, c_turned);
        /* d(2 shear)/dangle, the amount following the direction */
        const double slope = 2 * (tension_along(w) - dot(w->across, w->stress)) -
                             (2 * w->shear + w->amount * mixed) * mixed / w->stiffness +
                             w->amount * dot(w->turned, c_turned);
        const double newton = u - 2 * w->shear / slope * (1 + u * u);
        const double next = slope > 0 && newton > low && newton < high ? newton : (low + high) / 2;
        done = fabs(next - u) < DBL_EPSILON / 2 || !(next > low && next < high);
        u = next;
        wrinkle_at(c, t0, &first, u, w);
    }
}

/* ---- The law ---- */

static void wrinkled(const double c[9], const double e[3], const double t0[3], const wrinkle *w, double t,
                     drape_tension *out)
{
    double b[3], inverse[3];
    apply(c, w->turned, b);
    const double mixed = dot(w->turned, w->c_across), corner = dot(w->turned, b) + 2 * t / w->amount;
    const double determinant = w->stiffness * corner - mixed * mixed;
    inverse[0] = corner / determinant;
    inverse[1] = w->stiffness / determinant;
    inverse[2] = -mixed / determinant;
    out->state = DRAPE_WRINKLED;
    out->energy = 0.5 * (dot(e, t0) - w->amount * w->amount * w->stiffness);
    for (int i = 0; i < 3; i++) {
        out->stress[i] = w->stress[i];
        for (int j = 0; j < 3; j++)
            out->tangent[3 * i + j] = c[3 * i + j] - inverse[0] * w->c_across[i] * w->c_across[j] -
                                      inverse[1] * b[i] * b[j] -
                                      inverse[2] * (w->c_across[i] * b[j] + b[i] * w->c_across[j]);
    }
}

void drape_tension_relax(const double c[9], const double e[3], drape_tension *out)
{
    double t0[3];
    wrinkle w;
    apply(c, e, t0);
    if (lower(t0[0] + t0[1], t0[0] - t0[1], t0[2]) >= -ROUNDING * (c[0] + c[4])) {
        out->state = DRAPE_TAUT;
        out->energy = 0.5 * dot(e, t0);
        memcpy(out->stress, t0, sizeof out->stress);
        memcpy(out->tangent, c, sizeof out->tangent);
        return;
    }
    *out = (drape_tension){.state = DRAPE_SLACK};
    if (lower(-e[0] - e[1], e[0] - e[1], e[2] / 2) >= 0)
        return;
    find_direction(c, t0, &w);
    const double t = tension_along(&w);
    if (w.amount > 0 && t > 0) /* rounding may have it otherwise beside the slack state */
        wrinkled(c, e, t0, &w, t, out);
}
