/*
 * pair.h: two pieces that may come into contact, and the narrow phase: a node and the smooth surface of a
 * collider, a point and a triangle, or two segments. Points are the nodes of the cloth and, numbered from
 * node_count on, the points of colliders.
 */
#ifndef DRAPE_CONTACT_PAIR_H
#define DRAPE_CONTACT_PAIR_H

#include "colliders/colliders.h"
#include "contact/gap.h"

typedef enum drape_pair_kind {
    DRAPE_PAIR_SURFACE,  /* node 0 and the signed distance of the collider */
    DRAPE_PAIR_TRIANGLE, /* point 0 and triangle 1 2 3 */
    DRAPE_PAIR_SEGMENTS  /* 0 1 and 2 3 */
} drape_pair_kind;

typedef struct drape_pair {
    drape_pair_kind kind;
    int32_t node[4];
    int32_t collider;     /* -1: cloth and cloth */
    double radius;        /* the gap is the distance less this [m] */
    double area;          /* area on which its force acts [m2] */
    double distance;      /* activation distance [m] */
    double gap_at_search; /* of a candidate [m] */
    int32_t rank[3];      /* by which candidates are sorted: stage of the search, piece, place of the other */
} drape_pair;

/* All points at one instant. */
typedef struct drape_configuration {
    const drape_model *model;
    const double *x;                 /* (points x 3) */
    const drape_collider_pose *pose; /* (collider_count) */
} drape_configuration;

int drape_pair_points(const drape_pair *pair);
double drape_pair_gap_value(const drape_pair *pair, const drape_configuration *at);

/* Whether the boxes around the pieces already show that the gap is larger than `gap`, as for most
 * candidates. */
bool drape_pair_is_apart(const drape_pair *pair, const drape_configuration *at, double gap);

/* Computes the geometry of the pair, with all four points. Returns false if the gap is not below the
 * activation distance: then only its value is set, INFINITY if the pieces are apart. rest: (points x 3),
 * for the width of the mollifier. */
bool drape_pair_gap(const drape_pair *pair, const drape_configuration *at, const double *rest,
                    drape_gap *gap);

/* Computes how the gap changes with the points. The nodes of the pair must be those of the points of the
 * gap. */
void drape_pair_derivatives(const drape_pair *pair, const drape_gap *gap, const drape_configuration *at,
                            const double *rest, drape_gap_derivatives *derivatives);

/* Continuous collision detection: the largest step fraction on the straight path from x to y, the same for
 * all points, without contact of the pair (additive continuous collision detection, Li et al. 2021,
 * Codimensional IPC, algorithm 1). It stops when `keep` of the initial gap is left. It does not search
 * beyond `limit`, which it returns at most, also for a pair in contact at the start (with a collider:
 * within 1e-9 m of it). core: the radius counts as 0. */
double drape_pair_step_fraction(const drape_pair *pair, const double *x, const double *y, double keep,
                                bool core, double limit);

#endif
