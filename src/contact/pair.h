/*
 * pair.h: two pieces that may touch: a node and the smooth surface of a collider, a point and a triangle, or
 * two segments. Points are nodes of the cloth and, from node_count on, points of colliders.
 */
#ifndef DRAPE_CONTACT_PAIR_H
#define DRAPE_CONTACT_PAIR_H

#include "colliders/colliders.h"
#include "contact/closest.h"
#include "contact/force.h"

typedef enum drape_pair_kind {
    DRAPE_PAIR_SURFACE,  /* node 0 and the signed distance of the collider */
    DRAPE_PAIR_TRIANGLE, /* point 0 and triangle 1 2 3 */
    DRAPE_PAIR_SEGMENTS  /* 0 1 and 2 3 */
} drape_pair_kind;

typedef struct drape_pair {
    drape_pair_kind kind;
    int32_t node[4];
    int32_t collider; /* -1: cloth and cloth */
    double radius;    /* the gap is the distance less this [m] */
    double area;      /* that its force acts on [m2] */
    double distance;  /* activation distance [m] */
    double found;     /* the gap where it was found [m] */
} drape_pair;

/* All points at one instant. */
typedef struct drape_placed {
    const drape_model *model;
    const double *x;                 /* (points x 3) */
    const drape_collider_pose *pose; /* (collider_count) */
} drape_placed;

int drape_pair_points(const drape_pair *pair);
void drape_pair_gather(const drape_pair *pair, const double *from, double local[4][3]);
double drape_pair_gap_value(const drape_pair *pair, const drape_placed *at);

/* Whether the gap is seen at once to be above `gap`, from boxes around the pieces; most candidates are so. False says
 * nothing. */
bool drape_pair_is_apart(const drape_pair *pair, const drape_placed *at, double gap);

/* A pair at an instant at which it acts. */
typedef struct drape_touch {
    drape_pair pair; /* its first closest.points nodes have a part in it */
    double gap;      /* [m] */
    drape_closest closest;
    bool mollified;
    bool sharp; /* a feature of a collider that touches: normals do not turn there */
} drape_touch;

/* False where the gap is not below the activation distance. rest: (points x 3), for the width of the mollifier. */
bool drape_pair_touch(const drape_pair *pair, const drape_placed *at, const double *rest, drape_touch *touch);

/* Leaves out the nodes that have no part in it: pairs of large pieces are often those of smaller ones. */
void drape_touch_reduce(drape_touch *touch);

/* derivatives: dc, dn and ddm too. at: as in drape_pair_touch. */
void drape_touch_gap(const drape_touch *touch, const drape_placed *at, const double *rest, bool derivatives,
                     drape_gap *gap);

/* Both, of all four nodes; false as of drape_pair_touch, and then only the value is known. */
bool drape_pair_gap(const drape_pair *pair, const drape_placed *at, const double *rest, bool derivatives,
                    drape_gap *gap);

/* The largest fraction of the way from x to y, straight and for all points together, that a pair may go
 * without touching: additive continuous collision detection (Li et al. 2021, Codimensional IPC, algorithm
 * 1). It stops where keep of the gap at the start is left. At most `most`, which is looked no further than, and
 * which is given where the pair touches at the start (a collider: is within 1e-9 m of it). core: the radius counts as 0. */
double drape_pair_way(const drape_pair *pair, const double *x, const double *y, double keep, bool core,
                      double most);

#endif
