/*
 * pair.h: two pieces that may come into contact, and the narrow phase: a node and the smooth surface of a
 * collider, a point and a triangle, or two segments. Points are the nodes of the cloth and, numbered from
 * node_count on, the points of colliders.
 */
#ifndef DRAPE_CONTACT_PAIR_H
#define DRAPE_CONTACT_PAIR_H

#include "colliders/colliders.h"
#include "contact/gap.h"

#include <math.h>

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

/* The least gap [m] that a pair may have at the end of a step: a share of its activation distance and, if
 * that is larger, of the coordinates, whose rounding would decide on which side a smaller gap is. Cloth
 * that is nearly as close as that at rest may approach to half of its activation distance. */
#define DRAPE_LEAST_GAP 1e-3 /* of the activation distance */
static inline double drape_pair_least_gap(const drape_pair *pair, double rounding)
{
    return fmin(fmax(DRAPE_LEAST_GAP * pair->distance, rounding), 0.5 * pair->distance);
}

/* A gap below this share of the rounding has no side that it could be kept on. It is far below the share of
 * the least gap that is kept on paths, so only pairs that begin there are exempt: not those that were
 * accepted, even if the rounding has become larger since. */
#define DRAPE_NO_SIDE 0.1
static inline bool drape_gap_has_side(double gap, double rounding)
{
    return gap >= DRAPE_NO_SIDE * rounding && gap > 0;
}

/* Half: of the least gap, or of a smaller one at the beginning of a step, that a path must keep; of what a
 * gap has above the least that is kept when a Newton iterate is cut short; and of the activation distance,
 * where a pair that comes from beyond it is stopped then: halved from afar, its gap would reach the
 * barrier only after many iterations, in which it holds up all other pairs. */
#define DRAPE_KEPT_GAP 0.5

/* A march along a path takes at once this share of what is certainly free, and ends within the rest of it.
 * After so many steps the fraction that it has reached is safe, even if it is not the largest. */
#define DRAPE_ADVANCE      0.9
#define DRAPE_MAX_ADVANCES 1000

/* How much of its gap a pair must keep on a path. */
typedef struct drape_keep {
    double rounding; /* [m] of gaps */
    double least;    /* share of the least gap, for a pair that begins above it, */
    double above;    /* and share of what its gap has more than that */
    double below;    /* share of the gap of a pair that begins below the least gap */
    double arrival; /* share of the activation distance to which a pair from beyond it may come; 0: `above` */
    bool core;      /* a pair that begins within its radius keeps its distance instead of its gap */
} drape_keep;

static inline double drape_keep_gap(const drape_keep *keep, double least, double gap, double distance)
{
    const double end = gap < least ? keep->below * gap : keep->least * least + keep->above * (gap - least);
    return keep->arrival > 0 && gap > distance ? fmin(end, fmax(keep->arrival * distance, least)) : end;
}

/* All points at one instant. */
typedef struct drape_configuration {
    const drape_model *model;
    const double *x;                 /* (points x 3) */
    const drape_collider_pose *pose; /* (collider_count) */
    const drape_collider *const
        *body; /* (collider_count) as they are now, of those that deform, else NULL; only
                                          for distances from these: NULL if none is asked for */
} drape_configuration;

/* The collider whose distance counts in a configuration. */
static inline const drape_collider *drape_configuration_body(const drape_configuration *at, int32_t collider)
{
    return at->body && at->body[collider] ? at->body[collider] : &at->model->colliders[collider];
}

int drape_pair_points(const drape_pair *pair);
double drape_pair_gap_value(const drape_pair *pair, const drape_configuration *at);

/* The activation distance of a pair of the broad phase. Layers of one sheet that are close together at rest
 * must not be in contact there: theirs is at most half of the rest distance. */
double drape_pair_activation_distance(const drape_pair *pair, const drape_configuration *rest);

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

/* The motion of colliders on a path, and the number of nodes, after which points are of colliders. */
typedef struct drape_swings {
    const drape_swing *of; /* (collider_count) */
    int32_t nodes;
} drape_swings;

/* Continuous collision detection: the largest step fraction on the straight path from x to y, the same
 * for all points, on which the pair keeps what it must of its gap (additive continuous collision
 * detection, Li et al. 2021, Codimensional IPC, algorithm 1). It does not search beyond `limit`, which it
 * returns at most. A pair whose gap at x has no side: `limit`. The points of a collider that turns, unless
 * swings is NULL, go on circles instead. */
double drape_pair_step_fraction(const drape_pair *pair, const double *x, const double *y,
                                const drape_swings *swings, const drape_keep *keep, double limit);

/* Lower bounds of the distance between the two pieces, cheaper than their closest points. */

/* Bounds the distance of the pieces, not surfaces, on their straight path from x to y, by the axes through
 * their centres at either end; y NULL: at x. May be negative. x, y: (points x 3). */
double drape_bound_by_axes(const drape_pair *pair, const double *x, const double *y);

/* Whether that bound is at least a distance > 0, without its square roots: of the pairs of a search most
 * are so far apart. */
bool drape_bound_is_apart(const drape_pair *pair, const double *x, const double *y, double distance);

/* Bounds how much the distance of the pieces changes between x and y: the sum of the largest moves of a point
 * of each, without their common motion. */
double drape_bound_change(const drape_pair *pair, const double *x, const double *y);

#endif
