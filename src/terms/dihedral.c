/*
 * dihedral.c: see dihedral.h. With e = x1 - x0, and for each triangle its apex a, unit normal n, altitude H
 * over e, foot s = (a - x0).e/|e|^2 and in-plane unit vector m from the edge to the apex:
 *     theta = atan2(ehat . (n2 x n1), n1 . n2)
 *     gradient: g_a = n/H,  g_0 = -sum (1 - s_t) g_t,  g_1 = -sum s_t g_t
 * and the Hessian by the derivatives of the barycentric coordinates p_a = m/H, p_0 = -(1 - s) m/H - ehat/|e|,
 * p_1 = -s m/H + ehat/|e|:
 *     d g_a/d k = -(p_k n' + n p_k')/H + w_k n ehat'/(|e| H),  w_0 = -1, w_1 = 1, w_a = 0
 *     ds/da = ehat/|e|,  ds/dx0 = -((1 - s) e + H m)/|e|^2,  ds/dx1 = (-s e + H m)/|e|^2
 * Tamstorf & Grinspun 2013, Discrete bending forces and their Jacobians, has the same in closed form.
 */
#include "terms/dihedral.h"

#include "base/vec3.h"

#include <math.h>
#include <string.h>

/* One triangle: see the head of the file. */
typedef struct side {
    double n[3], m[3], altitude, foot;
} side;

static side measure_side(const double *origin, const double *apex, const double direction[3], double length,
                         double sign)
{
    side s;
    double d[3], normal[3];
    vec3_sub(apex, origin, d);
    vec3_cross(direction, d, normal);
    s.altitude = vec3_norm(normal); /* |ehat x d| */
    s.foot = vec3_dot(d, direction) / length;
    for (int i = 0; i < 3; i++) {
        s.n[i] = sign * normal[i] / s.altitude;
        s.m[i] = (d[i] - s.foot * length * direction[i]) / s.altitude;
    }
    return s;
}

static void gradient(const side sides[2], double *g)
{
    for (int i = 0; i < 3; i++) {
        double g2 = sides[0].n[i] / sides[0].altitude, g3 = sides[1].n[i] / sides[1].altitude;
        g[i] = -(1 - sides[0].foot) * g2 - (1 - sides[1].foot) * g3;
        g[3 + i] = -sides[0].foot * g2 - sides[1].foot * g3;
        g[6 + i] = g2;
        g[9 + i] = g3;
    }
}

/* The columns of one node, number `column`, in the rows that one triangle gives. p, w, ds: of that node. */
static void add_columns(const side *s, const double direction[3], double length, const double p[3], double w,
                        const double ds[3], int apex, int column, double *h)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double a = (w * s->n[i] * direction[j] / length - p[i] * s->n[j] - s->n[i] * p[j]) / s->altitude;
            double b = s->n[i] / s->altitude * ds[j];
            h[12 * i + 3 * column + j] += b - (1 - s->foot) * a;
            h[12 * (3 + i) + 3 * column + j] -= b + s->foot * a;
            h[12 * (3 * apex + i) + 3 * column + j] += a;
        }
}

static void add_side(const side *s, const double direction[3], double length, int apex, double *h)
{
    double p[3][3], ds[3][3]; /* of x0, x1, the apex */
    for (int i = 0; i < 3; i++) {
        double in_plane = s->m[i] / s->altitude, along = direction[i] / length;
        double rise = s->altitude * s->m[i] / (length * length);
        p[0][i] = -(1 - s->foot) * in_plane - along;
        p[1][i] = -s->foot * in_plane + along;
        p[2][i] = in_plane;
        ds[0][i] = -(1 - s->foot) * along - rise;
        ds[1][i] = -s->foot * along + rise;
        ds[2][i] = along;
    }
    for (int c = 0; c < 3; c++)
        add_columns(s, direction, length, p[c], c == 0 ? -1 : c == 1, ds[c], apex, c < 2 ? c : apex, h);
}

double drape_dihedral(const double x[12], double *g, double *h)
{
    double direction[3], cross[3];
    vec3_sub(x + 3, x, direction);
    const double length = vec3_norm(direction);
    for (int i = 0; i < 3; i++)
        direction[i] /= length;
    const side sides[2] = {measure_side(x, x + 6, direction, length, 1),
                           measure_side(x, x + 9, direction, length, -1)};
    if (g)
        gradient(sides, g);
    if (h) {
        memset(h, 0, 144 * sizeof *h);
        add_side(&sides[0], direction, length, 2, h);
        add_side(&sides[1], direction, length, 3, h);
    }
    vec3_cross(sides[1].n, sides[0].n, cross);
    return atan2(vec3_dot(direction, cross), vec3_dot(sides[0].n, sides[1].n));
}

void drape_dihedral_tie(double *g, double *h)
{
    for (int i = 0; g && i < 6; i++)
        g[i] += g[9 + i % 3] / 2;
    for (int i = 0; h && i < 12; i++)
        for (int j = 0; j < 6; j++)
            h[12 * i + j] += h[12 * i + 9 + j % 3] / 2;
    for (int i = 0; h && i < 6; i++)
        for (int j = 0; j < 9; j++)
            h[12 * i + j] += h[12 * (9 + i % 3) + j] / 2;
}

double drape_nearest_branch(double angle, double reference)
{
    static const double two_pi = 6.28318530717958647693;
    return angle + two_pi * round((reference - angle) / two_pi);
}
