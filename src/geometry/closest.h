/*
 * closest.h: the closest points of two primitives with four points in total (point and triangle, or two
 * segments), and their derivatives with respect to the points.
 *     p = sum c_i x_i,  gap = |p| - radius,  n = p / |p|
 * Here c are the barycentric weights of the closest points of both primitives, negative on the second. If the
 * closest points lie inside a face or an edge, c depends on parameters t with p . dp/dt = 0, so
 *     d gap / dx_i = c_i n,   dt/dx_i = -G^-1 (dc_i/dt p + c_i T),   T = dp/dt,  G = T . T
 * and from these follow the derivatives of c and n, in the same form for every kind of pair.
 */
#ifndef DRAPE_GEOMETRY_CLOSEST_H
#define DRAPE_GEOMETRY_CLOSEST_H

#include <float.h>

/* A distance below this share of the largest coordinate may be rounding: closest points and their distance
 * have errors of some hundred units in the last place; the rest is a margin for what is computed from
 * them. */
#define DRAPE_CLOSEST_ROUNDING (1e4 * DBL_EPSILON)

typedef struct drape_closest {
    int points;  /* 4, or fewer after drape_closest_reduce */
    int params;  /* number of parameters t: 2 inside a face or between two edges, 0 between two points */
    double c[4]; /* weights of points 0 1 2 3 */
    double dcdt[2][4]; /* dc/dt */
    double distance;   /* |p| [m] */
    double normal[3];  /* n; 0 where the primitives touch */
} drape_closest;

/* Derivatives: column 3 i + k is for coordinate k of point i. */
typedef struct drape_closest_derivatives {
    double c[4][12];      /* dc/dx [1/m] */
    double normal[3][12]; /* dn/dx [1/m] */
} drape_closest_derivatives;

/* Point 0 and the triangle 1 2 3 (Ericson 2005, 5.1.5). x: the four points. */
void drape_closest_point_triangle(double x[4][3], drape_closest *at);

/* The segments 0 1 and 2 3 (Ericson 2005, 5.1.9). */
void drape_closest_segments(double x[4][3], drape_closest *at);

/* Removes points without weight, such as the far end of an edge whose closest point is its other end. which:
 * the former number of each remaining point. */
void drape_closest_reduce(drape_closest *at, int which[4]);

void drape_closest_derive(double x[4][3], const drape_closest *at, drape_closest_derivatives *derivatives);

#endif
