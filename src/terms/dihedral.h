/*
 * dihedral.h: the angle between two triangles that share an edge, with its derivatives, for four hinges at
 * once.
 *
 * Edge x0 x1, apices x2 x3, e = x1 - x0. For the triangle t with apex a: unit normal n, along n1 = e x (x2 -
 * x0) for one and n2 = (x3 - x0) x e for the other; altitude H over e; foot s = (a - x0).e/|e|^2; and m, the
 * unit vector in the plane from the edge to the apex.
 *     theta = atan2(ehat . (n2 x n1), n1 . n2), never acos, which loses all digits near 0
 *     gradient: g_a = n/H,  g_0 = -sum (1 - s_t) g_t,  g_1 = -sum s_t g_t
 * The Hessian follows by differentiating these, with the gradients of the barycentric coordinates:
 *     p_a = m/H,  p_0 = -(1 - s) m/H - ehat/|e|,  p_1 = -s m/H + ehat/|e|
 *     d g_a/d a  = -(p_a n' + n p_a')/H
 *     d g_a/d x0 = -(p_0 n' + n p_0')/H - n ehat'/(|e| H)
 *     d g_a/d x1 = -(p_1 n' + n p_1')/H + n ehat'/(|e| H)
 *     ds/da = ehat/|e|,  ds/dx0 = -((1 - s) e + H m)/|e|^2,  ds/dx1 = (-s e + H m)/|e|^2
 * Tamstorf & Grinspun 2013, Discrete bending forces and their Jacobians, has the same in closed form.
 *
 * x2 is the apex on the left of the edge seen against the normal, x3 the one on its right. theta is in (-pi,
 * pi] and positive where x3 stands out along the normal: for a graph it is the jump of the slope across the
 * edge.
 */
#ifndef DRAPE_TERMS_DIHEDRAL_H
#define DRAPE_TERMS_DIHEDRAL_H

#include "base/lanes_atan2.h"

/* If x3 of the hinge in a lane is (x0 + x1)/2 plus a constant: makes the derivatives that the functions below
 * write, ds (12) and dds (12 x 12), those by x0, x1 and x2, with zeros for x3. Either may be NULL. */
void drape_dihedral_tie(int lane, double *ds, double *dds);

/* angle + 2 pi k for the integer k that brings it nearest to reference; the angle itself if reference is not
 * finite. */
double drape_nearest_branch(double angle, double reference);

/* ---- In lanes ---- */

/* One triangle of a hinge. */
typedef struct drape_dihedral_side {
    lanes n[3], m[3];
    lanes gradient[3]; /* n/H */
    lanes altitude, per_altitude, foot;
} drape_dihedral_side;

typedef struct drape_dihedral_lanes {
    lanes direction[3], per_length; /* ehat, 1/|e| */
    drape_dihedral_side side[2];
    lanes theta;
} drape_dihedral_lanes;

LANES_INLINE void drape_dihedral_measure_side(const lanes origin[3], const lanes apex[3],
                                              const drape_dihedral_lanes *h, double sign,
                                              drape_dihedral_side *s)
{
    lanes d[3], normal[3];
    for (int i = 0; i < 3; i++)
        d[i] = apex[i] - origin[i];
    lanes_cross(h->direction, d, normal);
    lanes along = lanes_dot(d, h->direction);
    s->altitude = lanes_sqrt(lanes_dot(normal, normal)); /* |ehat x d| */
    s->per_altitude = 1 / s->altitude;
    s->foot = along * h->per_length;
    for (int i = 0; i < 3; i++) {
        s->n[i] = sign * normal[i] * s->per_altitude;
        s->m[i] = (d[i] - along * h->direction[i]) * s->per_altitude;
        s->gradient[i] = s->n[i] * s->per_altitude;
    }
}

/* corner: x0 x1 x2 x3 */
LANES_INLINE void drape_dihedral_measure(lanes corner[4][3], drape_dihedral_lanes *h)
{
    lanes cross[3];
    for (int i = 0; i < 3; i++)
        h->direction[i] = corner[1][i] - corner[0][i];
    h->per_length = 1 / lanes_sqrt(lanes_dot(h->direction, h->direction));
    for (int i = 0; i < 3; i++)
        h->direction[i] *= h->per_length;
    drape_dihedral_measure_side(corner[0], corner[2], h, 1, &h->side[0]);
    drape_dihedral_measure_side(corner[0], corner[3], h, -1, &h->side[1]);
    lanes_cross(h->side[1].n, h->side[0].n, cross);
    const lanes sine = lanes_dot(h->direction, cross), cosine = lanes_dot(h->side[0].n, h->side[1].n);
    h->theta = lanes_atan2(sine, cosine);
}

/* dq: g_0 g_1 g_2 g_3 */
LANES_INLINE void drape_dihedral_gradient(const drape_dihedral_lanes *h, double *dq)
{
    const drape_dihedral_side *s = h->side;
    for (int i = 0; i < 3; i++) {
        lanes_store(dq + LANES * i, (s[0].foot - 1) * s[0].gradient[i] + (s[1].foot - 1) * s[1].gradient[i]);
        lanes_store(dq + LANES * (3 + i), -s[0].foot * s[0].gradient[i] - s[1].foot * s[1].gradient[i]);
        lanes_store(dq + LANES * (6 + i), s[0].gradient[i]);
        lanes_store(dq + LANES * (9 + i), s[1].gradient[i]);
    }
}

/* d g_a/d column = -(p n' + n p')/H + w n ehat'/(|e| H), at (i, j) */
LANES_INLINE lanes drape_dihedral_turn(const drape_dihedral_side *s, const lanes along[3], const lanes p[3],
                                       double w, int i, int j)
{
    return s->gradient[i] * (w * along[j] - p[j]) - p[i] * s->gradient[j];
}

/* p and the gradients of s by the nodes of a side: x0, x1, apex. The gradient of s by the apex is not needed
 * for the blocks on and below the diagonal. */
typedef struct drape_dihedral_change {
    lanes p[3][3], foot[2][3];
} drape_dihedral_change;

LANES_INLINE void drape_dihedral_measure_change(const drape_dihedral_lanes *h, const drape_dihedral_side *s,
                                                const lanes along[3], drape_dihedral_change *c)
{
    for (int i = 0; i < 3; i++) {
        lanes in_plane = s->m[i] * s->per_altitude;
        lanes rise = s->altitude * s->m[i] * h->per_length * h->per_length;
        c->p[0][i] = (s->foot - 1) * in_plane - along[i];
        c->p[1][i] = along[i] - s->foot * in_plane;
        c->p[2][i] = in_plane;
        c->foot[0][i] = (s->foot - 1) * along[i] - rise;
        c->foot[1][i] = rise - s->foot * along[i];
    }
}

/* The blocks on and below the diagonal. Both sides add to those of the edge; the one between the apices is
 * 0. */
LANES_INLINE void drape_dihedral_hessian(const drape_dihedral_lanes *h, double *ddq)
{
    lanes along[3];
    drape_dihedral_change change[2];
    for (int i = 0; i < 3; i++)
        along[i] = h->direction[i] * h->per_length;
    drape_dihedral_measure_change(h, &h->side[0], along, &change[0]);
    drape_dihedral_measure_change(h, &h->side[1], along, &change[1]);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            lanes of_00 = {0}, of_10 = {0}, of_11 = {0};
            for (int k = 0; k < 2; k++) {
                const drape_dihedral_side *s = &h->side[k];
                const int apex = 3 * (2 + k);
                lanes by_0 = drape_dihedral_turn(s, along, change[k].p[0], -1, i, j),
                      by_1 = drape_dihedral_turn(s, along, change[k].p[1], 1, i, j);
                lanes by_foot = s->gradient[i] * change[k].foot[0][j];
                of_00 += by_foot + (s->foot - 1) * by_0;
                of_10 -= by_foot + s->foot * by_0;
                of_11 -= s->gradient[i] * change[k].foot[1][j] + s->foot * by_1;
                lanes_store(ddq + LANES * (12 * (apex + i) + j), by_0);
                lanes_store(ddq + LANES * (12 * (apex + i) + 3 + j), by_1);
                lanes_store(ddq + LANES * (12 * (apex + i) + apex + j),
                            drape_dihedral_turn(s, along, change[k].p[2], 0, i, j));
            }
            lanes_store(ddq + LANES * (12 * i + j), of_00);
            lanes_store(ddq + LANES * (12 * (3 + i) + j), of_10);
            lanes_store(ddq + LANES * (12 * (3 + i) + 3 + j), of_11);
            lanes_store(ddq + LANES * (12 * (9 + i) + 6 + j), (lanes){0});
        }
}

#endif
