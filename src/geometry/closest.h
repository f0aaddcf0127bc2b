/*
 * closest.h: the closest points of two pieces of four points in all (point and triangle, or two segments),
 * and how they move with the points.
 *     p = sum c_i x_i,  gap = |p| - radius,  n = p / |p|
 * with c the barycentric weights of the closest points of both pieces, negative on the second. Where the
 * closest points lie inside a face or an edge, c depends on parameters t with p . dp/dt = 0, so
 *     d gap / dx_i = c_i n,   dt/dx_i = -G^-1 (dc_i/dt p + c_i T),   T = dp/dt,  G = T . T
 * and from these the derivatives of c and n, in one form for every kind of pair.
 */
#ifndef DRAPE_GEOMETRY_CLOSEST_H
#define DRAPE_GEOMETRY_CLOSEST_H

typedef struct drape_closest {
    int points;         /* 4, fewer after drape_closest_reduce */
    int params;         /* number of parameters t: 2 in a face or between two edges, 0 between two points */
    double c[4];        /* of points 0 1 2 3 */
    double slope[2][4]; /* dc/dt */
    double distance;    /* |p| [m] */
    double normal[3];   /* n; 0 where the pieces touch */
} drape_closest;

/* Derivatives, column 3 i + k of coordinate k of point i. */
typedef struct drape_closest_slopes {
    double c[4][12];      /* dc/dx [1/m] */
    double normal[3][12]; /* dn/dx [1/m] */
} drape_closest_slopes;

/* Point 0 and the triangle 1 2 3 (Ericson 2005, 5.1.5). x: four points. */
void drape_closest_point_triangle(double x[4][3], drape_closest *at);

/* Segments 0 1 and 2 3 (Ericson 2005, 5.1.9). */
void drape_closest_segments(double x[4][3], drape_closest *at);

/* Removes the points without weight, as the far end of an edge that is closest at its other end. which: the
 * former number of each point that stays. */
void drape_closest_reduce(drape_closest *at, int which[4]);

void drape_closest_derive(double x[4][3], const drape_closest *at, drape_closest_slopes *slopes);

#endif
