/* closest.c: see closest.h. */
#include "geometry/closest.h"

#include "base/vec3.h"

#include <stdbool.h>
#include <string.h>

/* sin^2 of the angle below which segments count as parallel: an end point of one is then as near as any other
 * point */
#define PARALLEL 1e-12

static double clamp01(double t)
{
    return t < 0 ? 0 : t > 1 ? 1 : t;
}

/* p = sum c x, computed from differences of points, because coordinates may be large. */
static void measure(double x[4][3], drape_closest *at)
{
    double p[3] = {0};
    for (int i = 1; i < 4; i++) {
        double e[3];
        vec3_sub(x[i], x[0], e);
        vec3_add_scaled(at->c[i], e, p); /* the weights sum to 0 */
    }
    at->distance = vec3_norm(p);
    double scale = at->distance > 0 ? 1 / at->distance : 0;
    for (int k = 0; k < 3; k++)
        at->normal[k] = scale * p[k];
}

/* ---- Point and triangle ---- */

static void on_vertex(int a, drape_closest *at)
{
    at->params = 0;
    at->c[a] = -1;
}

static void on_edge(int a, int b, double t, drape_closest *at)
{
    at->params = 1;
    at->c[a] = -(1 - t);
    at->c[b] = -t;
    at->dcdt[0][a] = 1;
    at->dcdt[0][b] = -1;
}

static void on_face(double v, double w, drape_closest *at)
{
    at->params = 2;
    at->c[1] = -(1 - v - w);
    at->c[2] = -v;
    at->c[3] = -w;
    at->dcdt[0][1] = at->dcdt[1][1] = 1;
    at->dcdt[0][2] = at->dcdt[1][3] = -1;
}

void drape_closest_point_triangle(double x[4][3], drape_closest *at)
{
    *at = (drape_closest){.points = 4, .c = {1}};
    double ab[3], ac[3], ap[3], bp[3], cp[3];
    vec3_sub(x[2], x[1], ab);
    vec3_sub(x[3], x[1], ac);
    vec3_sub(x[0], x[1], ap);
    vec3_sub(x[0], x[2], bp);
    vec3_sub(x[0], x[3], cp);
    double d1 = vec3_dot(ab, ap), d2 = vec3_dot(ac, ap), d3 = vec3_dot(ab, bp), d4 = vec3_dot(ac, bp),
           d5 = vec3_dot(ab, cp), d6 = vec3_dot(ac, cp);
    double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    if (d1 <= 0 && d2 <= 0)
        on_vertex(1, at);
    else if (d3 >= 0 && d4 <= d3)
        on_vertex(2, at);
    else if (d6 >= 0 && d5 <= d6)
        on_vertex(3, at);
    else if (vc <= 0 && d1 >= 0 && d3 <= 0)
        on_edge(1, 2, d1 / (d1 - d3), at);
    else if (vb <= 0 && d2 >= 0 && d6 <= 0)
        on_edge(1, 3, d2 / (d2 - d6), at);
    else if (va <= 0 && d4 >= d3 && d5 >= d6)
        on_edge(2, 3, (d4 - d3) / ((d4 - d3) + (d5 - d6)), at);
    else
        on_face(vb / (va + vb + vc), vc / (va + vb + vc), at);
    measure(x, at);
}

/* ---- Two segments ---- */

/* The parameters s and t are free unless they are at an end. */
static void between(double s, double t, bool s_moves, bool t_moves, drape_closest *at)
{
    const double c[4] = {1 - s, s, -(1 - t), -t};
    memcpy(at->c, c, sizeof c);
    if (s_moves) {
        at->dcdt[at->params][0] = -1;
        at->dcdt[at->params++][1] = 1;
    }
    if (t_moves) {
        at->dcdt[at->params][2] = 1;
        at->dcdt[at->params++][3] = -1;
    }
}

/* Returns the parameter of the point of a segment that is nearest to a given point. */
static double nearest(double along, double length2)
{
    return length2 > 0 ? clamp01(along / length2) : 0;
}

void drape_closest_segments(double x[4][3], drape_closest *at)
{
    *at = (drape_closest){.points = 4};
    double u[3], w[3], r[3];
    vec3_sub(x[1], x[0], u);
    vec3_sub(x[3], x[2], w);
    vec3_sub(x[0], x[2], r);
    double a = vec3_dot(u, u), e = vec3_dot(w, w), b = vec3_dot(u, w), c = vec3_dot(u, r), f = vec3_dot(w, r),
           area2 = a * e - b * b;
    bool parallel = !(area2 > PARALLEL * a * e);
    double s = parallel ? 0 : clamp01((b * f - c * e) / area2), t = nearest(b * s + f, e);
    s = nearest(b * t - c, a);
    between(s, t, s > 0 && s < 1 && !(parallel && t > 0 && t < 1), t > 0 && t < 1, at);
    measure(x, at);
}

void drape_closest_reduce(drape_closest *at, int which[4])
{
    int kept = 0;
    for (int i = 0; i < at->points; i++) {
        if (at->c[i] == 0 && at->dcdt[0][i] == 0 && at->dcdt[1][i] == 0)
            continue;
        which[kept] = i;
        at->c[kept] = at->c[i];
        at->dcdt[0][kept] = at->dcdt[0][i];
        at->dcdt[1][kept++] = at->dcdt[1][i];
    }
    at->points = kept;
}

/* ---- Derivatives ---- */

void drape_closest_derive(double x[4][3], const drape_closest *at, drape_closest_derivatives *derivatives)
{
    double t[2][3] = {{0}}, shift[2][12] = {{0}}, scale = at->distance > 0 ? 1 / at->distance : 0;
    memset(derivatives, 0, sizeof *derivatives);
    for (int k = 0; k < at->params; k++)
        for (int i = 1; i < at->points; i++) {
            double e[3];
            vec3_sub(x[i], x[0], e);
            vec3_add_scaled(at->dcdt[k][i], e, t[k]);
        }
    const double a = vec3_dot(t[0], t[0]), b = vec3_dot(t[0], t[1]), c = vec3_dot(t[1], t[1]);
    double inverse[2][2] = {{0}}; /* of G = T . T */
    if (at->params == 1)
        inverse[0][0] = 1 / a;
    else if (at->params == 2) {
        const double det = a * c - b * b;
        inverse[0][0] = c / det;
        inverse[1][1] = a / det;
        inverse[0][1] = inverse[1][0] = -b / det;
    }
    for (int k = 0; k < at->params; k++) /* dt/dx */
        for (int l = 0; l < at->params; l++)
            for (int i = 0; i < 3 * at->points; i++)
                shift[k][i] -= inverse[k][l] * (at->dcdt[l][i / 3] * at->distance * at->normal[i % 3] +
                                                at->c[i / 3] * t[l][i % 3]);
    for (int i = 0; i < 3 * at->points; i++) {
        double dp[3] = {0}, along = 0;
        dp[i % 3] = at->c[i / 3];
        for (int k = 0; k < at->params; k++) {
            vec3_add_scaled(shift[k][i], t[k], dp);
            for (int j = 0; j < at->points; j++)
                derivatives->c[j][i] += at->dcdt[k][j] * shift[k][i];
        }
        along = vec3_dot(dp, at->normal);
        for (int k = 0; k < 3; k++)
            derivatives->normal[k][i] = scale * (dp[k] - along * at->normal[k]);
    }
}
