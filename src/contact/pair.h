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

/* The number of points of the first piece of a pair of features; the second has the others. */
static inline int drape_pair_split(drape_pair_kind kind)
{
    return kind == DRAPE_PAIR_TRIANGLE ? 1 : 2;
}

/* The least gap [m] that a pair may have at the end of a step: a share of its activation distance or, if that
 * is larger, the rounding of gaps, which would decide on which side a smaller gap is. A pair whose activation
 * distance is nearly as small, because it is close at rest, may approach to half of that distance. */
#define DRAPE_LEAST_GAP 1e-3 /* of the activation distance */
static inline double drape_pair_least_gap(const drape_pair *pair, double rounding)
{
    return fmin(fmax(DRAPE_LEAST_GAP * pair->distance, rounding), 0.5 * pair->distance);
}

/* A gap below this share of the rounding has no side that it could be kept on. The share is far below that of
 * the least gap which is kept on paths: no step ends so near, even if the rounding has become larger since;
 * only where a run starts can there be such pairs. */
#define DRAPE_NO_SIDE 0.1
static inline bool drape_gap_has_side(double gap, double rounding)
{
    return gap >= DRAPE_NO_SIDE * rounding && gap > 0;
}

/* The share that is kept
 * - of the least gap, or of a smaller one at the beginning of a step, on every path;
 * - of what a gap has above the least one, where a Newton iterate is cut short;
 * - of the activation distance, where a pair that comes from beyond it is stopped: a gap that is halved from
 *   afar would reach the barrier only after many iterations, in which this pair cuts the steps of all
 *   others. */
#define DRAPE_KEPT_GAP 0.5

/* Each advance along a path (conservative advancement) is this share of the length that is certainly free,
 * and the search ends when the gap is within the rest of that share of its aim. After the maximum of advances
 * the fraction that was reached is safe, even if it is not the largest. */
#define DRAPE_ADVANCE      0.9
#define DRAPE_MAX_ADVANCES 1000

/* How much of its gap a pair must keep on a path. */
typedef struct drape_keep {
    double rounding; /* [m] of gaps */
    double least;    /* a pair that begins above the least gap keeps this share of the least gap, */
    double above;    /* and this share of what its gap has above that */
    double below;    /* share of the gap of a pair that begins below the least gap */
    double
        arrival; /* share of the activation distance to which a pair from beyond may come; 0: as by `above` */
    bool core;   /* a pair that begins within its radius keeps its distance instead of its gap */
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
        *body; /* (collider_count) the present shapes of those that deform, else NULL; may be
                                          NULL where no distance from these is asked for */
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

/* Continuous collision detection: the largest step fraction on the straight path from x to y, the same for
 * all points, on which the pair keeps what it must of its gap (additive continuous collision detection, Li et
 * al. 2021, Codimensional IPC, algorithm 1). The search ends at `limit`, the largest value that is returned,
 * also for a pair whose gap at x has no side. Points of a collider that turns go on circles if swings is not
 * NULL. */
double drape_pair_step_fraction(const drape_pair *pair, const double *x, const double *y,
                                const drape_swings *swings, const drape_keep *keep, double limit);

/* Lower bounds of the distance between the two pieces, cheaper than their closest points: */

/* The bound on the straight path from x to y (points x 3), from the axes through the centres of the pieces at
 * either end; y NULL: at x. May be negative. Not for surfaces. */
double drape_bound_by_axes(const drape_pair *pair, const double *x, const double *y);

/* Whether that bound is at least a distance > 0, without its square roots: for most pairs of a search it
 * is. */
bool drape_bound_is_apart(const drape_pair *pair, const double *x, const double *y, double distance);

/* An upper bound of the change of the distance between x and y: the sum of the largest moves of a point of
 * either piece, without their common motion. */
double drape_bound_change(const drape_pair *pair, const double *x, const double *y);

#endif
