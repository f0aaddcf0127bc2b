/*
 * solids.h: how deep a triangle of cloth lies in a solid, computed independently of the library. For a
 * convex body of planes, and for all points within a radius of a segment, it is exact over the whole
 * triangle; for cylinders and rounded edges it is the maximum over many points of the triangle.
 */
#ifndef DRAPE_TESTS_SOLIDS_H
#define DRAPE_TESTS_SOLIDS_H

#include <math.h>
#include <stdbool.h>
#include <string.h>

#define SOLID_PLANES  8
#define SOLID_CORNERS (3 + SOLID_PLANES) /* of a triangle after all cuts */
#define SOLID_SAMPLES 8                  /* points along an edge of a triangle */

typedef struct solid {
    int planes; /* the body is where n . x <= d for all: n is 0 to 2, d is 3 */
    double plane[SOLID_PLANES][4];
    bool round; /* within `radius` of the segment a b */
    double a[3], b[3], radius;
    double (*depth)(
        const double *x); /* sampled, if not NULL: the depth of a point in the body, or in a part of it */
} solid;

static inline double solid_dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void solid_between(const double *a, const double *b, double t, double *out)
{
    for (int k = 0; k < 3; k++)
        out[k] = a[k] + t * (b[k] - a[k]);
}

/* Whether a part of the triangle is deeper than `depth` in all planes: the part that is left after
 * cutting. */
static inline bool solid_cuts(const solid *s, double x[3][3], double depth)
{
    double p[SOLID_CORNERS][3], q[SOLID_CORNERS][3];
    int count = 3;
    memcpy(p, x, 9 * sizeof(double));
    for (int k = 0; k < s->planes && count > 0; k++) {
        int kept = 0;
        for (int i = 0; i < count; i++) {
            const double *u = p[i], *w = p[(i + 1) % count], limit = s->plane[k][3] - depth;
            const double from = solid_dot(s->plane[k], u) - limit, to = solid_dot(s->plane[k], w) - limit;
            if (from < 0)
                memcpy(q[kept++], u, sizeof q[0]);
            if ((from < 0) != (to < 0))
                solid_between(u, w, from / (from - to), q[kept++]);
        }
        memcpy(p, q, sizeof p);
        count = kept;
    }
    return count > 0;
}

static inline double solid_point_segment(const double *p, const double *a, const double *b)
{
    double u[3], w[3], foot[3];
    for (int k = 0; k < 3; k++) {
        u[k] = b[k] - a[k];
        w[k] = p[k] - a[k];
    }
    const double square = solid_dot(u, u), t = square > 0 ? solid_dot(w, u) / square : 0;
    solid_between(a, b, fmin(fmax(t, 0), 1), foot);
    for (int k = 0; k < 3; k++)
        w[k] = p[k] - foot[k];
    return sqrt(solid_dot(w, w));
}

/* The squared distance is convex in both parameters: its minimum is where its slope is 0, or at an end. */
static inline double solid_segments(const double *a, const double *b, const double *c, const double *d)
{
    double u[3], w[3], r[3], p[3], q[3];
    double smallest = fmin(fmin(solid_point_segment(a, c, d), solid_point_segment(b, c, d)),
                           fmin(solid_point_segment(c, a, b), solid_point_segment(d, a, b)));
    for (int k = 0; k < 3; k++) {
        u[k] = b[k] - a[k];
        w[k] = d[k] - c[k];
        r[k] = c[k] - a[k];
    }
    const double uu = solid_dot(u, u), ww = solid_dot(w, w), uw = solid_dot(u, w), det = uu * ww - uw * uw;
    if (!(det > 1e-12 * uu * ww))
        return smallest;
    const double s = (ww * solid_dot(r, u) - uw * solid_dot(r, w)) / det,
                 t = (uw * solid_dot(r, u) - uu * solid_dot(r, w)) / det;
    if (s < 0 || s > 1 || t < 0 || t > 1)
        return smallest;
    solid_between(a, b, s, p);
    solid_between(c, d, t, q);
    for (int k = 0; k < 3; k++)
        p[k] -= q[k];
    return fmin(smallest, sqrt(solid_dot(p, p)));
}

static inline void solid_normal(double x[3][3], double *n)
{
    double u[3], w[3];
    for (int k = 0; k < 3; k++) {
        u[k] = x[1][k] - x[0][k];
        w[k] = x[2][k] - x[0][k];
    }
    for (int k = 0; k < 3; k++)
        n[k] = u[(k + 1) % 3] * w[(k + 2) % 3] - u[(k + 2) % 3] * w[(k + 1) % 3];
}

/* Whether the projection of p onto the triangle's plane lies in it. */
static inline bool solid_above(double x[3][3], const double *n, const double *p)
{
    for (int i = 0; i < 3; i++) {
        double side[3][3], m[3];
        memcpy(side[0], x[i], sizeof side[0]);
        memcpy(side[1], x[(i + 1) % 3], sizeof side[1]);
        memcpy(side[2], p, sizeof side[2]);
        solid_normal(side, m);
        if (solid_dot(m, n) < 0)
            return false;
    }
    return true;
}

static inline double solid_segment_triangle(const double *a, const double *b, double x[3][3])
{
    double n[3], smallest = INFINITY, p[3];
    solid_normal(x, n);
    const double length = sqrt(solid_dot(n, n)), base = solid_dot(n, x[0]), from = solid_dot(n, a) - base,
                 to = solid_dot(n, b) - base;
    for (int i = 0; i < 3; i++)
        smallest = fmin(smallest, solid_segments(a, b, x[i], x[(i + 1) % 3]));
    for (int end = 0; end < 2; end++) {
        const double away = (end ? to : from) / length, *x0 = end ? b : a;
        for (int k = 0; k < 3; k++)
            p[k] = x0[k] - away * n[k] / length;
        if (solid_above(x, n, p))
            smallest = fmin(smallest, fabs(away));
    }
    if (from * to < 0) {
        solid_between(a, b, from / (from - to), p);
        if (solid_above(x, n, p))
            return 0;
    }
    return smallest;
}

static inline double solid_sample(const solid *s, double x[3][3])
{
    double deepest = -INFINITY;
    for (int i = 0; i <= SOLID_SAMPLES; i++)
        for (int j = 0; i + j <= SOLID_SAMPLES; j++) {
            const double u = (double)i / SOLID_SAMPLES, w = (double)j / SOLID_SAMPLES;
            double p[3];
            for (int k = 0; k < 3; k++)
                p[k] = (1 - u - w) * x[0][k] + u * x[1][k] + w * x[2][k];
            deepest = fmax(deepest, s->depth(p));
        }
    return deepest;
}

/* [m]; below `limit` it need not be exact. */
static inline double solid_depth(const solid *s, double x[3][3], double limit)
{
    double depth = -INFINITY;
    if (s->round)
        depth = s->radius - solid_segment_triangle(s->a, s->b, x);
    if (s->depth)
        depth = fmax(depth, solid_sample(s, x));
    if (s->planes == 0 || !solid_cuts(s, x, limit))
        return depth;
    double low = limit, high = 1;
    for (int i = 0; i < 60; i++)
        *(solid_cuts(s, x, (low + high) / 2) ? &low : &high) = (low + high) / 2;
    return fmax(depth, low);
}

#endif
