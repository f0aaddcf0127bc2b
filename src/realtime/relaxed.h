/*
 * relaxed.h: the cloth that bodies leave no room: relaxed nodes, each with the collider whose surface does
 * not hold it for the time being. A pair is relaxed if one of its nodes of cloth is relaxed for its collider.
 * Relaxed pairs are exempt (contact/exempt.h): the bounded barrier pushes them out with no more than the
 * scene's pressure, and they are not checked. A node that has room again is pushed more and more, until its
 * gap is as large as contact allows.
 */
#ifndef DRAPE_REALTIME_RELAXED_H
#define DRAPE_REALTIME_RELAXED_H

#include "base/archive.h"
#include "contact/contact_parts.h"

typedef struct drape_relaxed_node {
    int32_t collider; /* -1: pinned pieces of cloth */
    int32_t node;
    double since;          /* [s] */
    double until;          /* [s] it is not held again before this time */
    double depth, deepest; /* [m] >= 0, at the beginning of the last step; the largest since it was relaxed */
    double gap;            /* [m] smallest gap of its pairs at that time; INFINITY: none is active */
    double factor;         /* of the pressure, >= 1 */
    bool blocked;          /* it had no room at the end of the last step that was tested */
    bool fresh;            /* no step was accepted since it was relaxed */
    bool exits;            /* it is in a patch that comes out along one direction (exit.h): */
    double exit[3], height; /* in the coordinates of the collider: the direction, and its end along it [m] */
} drape_relaxed_node;

/* Whether a node is pushed along the direction of its patch: not while it is blocked. */
static inline bool drape_relaxed_goes_out(const drape_relaxed_node *node)
{
    return node->exits && !node->blocked;
}

/* What is summed over the faces of a patch that comes out along one direction (exit.h). */
typedef struct drape_relaxed_patch {
    double normal[3], area; /* [m2] sums of area and normal, and of area */
    double cost[2];         /* [m3] sums of area and the paths out against and along the normal */
    double kept[3];         /* [m2] sum of area and the directions of nodes that were in patches before */
    double height;          /* [m] of the end of the longest path, along the direction in space */
} drape_relaxed_patch;

/* What became of the cloth at one collider so far. */
typedef struct drape_relaxed_total {
    int32_t most;                /* the largest number of nodes at a time; 0: there were none */
    double deepest;              /* [m] */
    double first, last, seconds; /* [s] the first and the last moment, and how long in all */
} drape_relaxed_total;

typedef struct drape_relaxed_set {
    drape_exempt exempt; /* what contact asks; its count is that of the nodes */
    drape_arena *arena;
    const drape_model *model;
    drape_relaxed_node *nodes; /* (exempt.count of capacity) by increasing collider and node */
    int32_t capacity;
    uint8_t *of_node;             /* (node_count) whether it is among them, for any collider */
    double *normal;               /* (node_count x 3) scratch */
    double *reach;                /* (node_count) scratch */
    bool *pins;                   /* (collider_count) scratch */
    uint8_t *face;                /* (triangle_count) scratch of exit.c, */
    int32_t *parent;              /* (node_count) this, too, */
    drape_relaxed_patch *patches; /* (node_count) and this */
    double *bound;   /* (collider_count x 4) centre at rest and radius around a collider, INFINITY: none; */
    double *bound_t; /* (collider_count) [s] of those that deform. Not archived: they follow the bodies */
    bool *solid; /* (collider_count) its features enclose a volume. Inside of it they would push cloth to the
                    side that it is on; only the distance from the whole collider leads out */
    drape_relaxed_total *total; /* (collider_count + 1) the last one: of pinned pieces of cloth */
    double t;                   /* [s] of the last update */
    double ahead_t; /* [s] the end of the step that begins next; NAN: unknown. Set before each step */
    bool may_relax; /* set with ahead_t: cloth without room at that time may be relaxed */
    bool *logged;   /* (collider_count + 1) the last message was that cloth is relaxed there */
    bool counting; /* during drape_room_lacks: nodes that would be relaxed are counted, and nothing changes */
} drape_relaxed_set;

/* In an arena; what grows later is in that of contact. Errors: DRAPE_E_MEMORY. */
drape_status drape_relaxed_create(drape_arena *arena, const drape_contact *contact, drape_relaxed_set **out);

/* The set of a contact for which drape_room_open was called. */
static inline drape_relaxed_set *drape_relaxed_of(const drape_contact *contact)
{
    return (drape_relaxed_set *)contact->exempt;
}

/* The ball around a collider in its present shape: centre and radius. */
const double *drape_relaxed_bound_of(const drape_contact *contact, int32_t collider);

/* The distance [m] of a point from a collider, where contact is evaluated. normal (3) may be NULL. */
double drape_relaxed_distance(const drape_contact *contact, int32_t collider, const double *x,
                              double *normal);

/* NULL: the node is held. */
drape_relaxed_node *drape_relaxed_find(const drape_relaxed_set *set, int32_t collider, int32_t node);

/* Relaxes a node from time t on, at least until `until`, and notes that it is blocked. *added is raised by 1
 * if the node was not relaxed. Errors: DRAPE_E_MEMORY. */
drape_status drape_relaxed_add(drape_relaxed_set *set, int32_t collider, int32_t node, double t, double until,
                               int32_t *added);

/* Takes account of the time from the last update to t: raises the pressure on nodes with room, up to
 * max_factor, lowers it on the others, and adds to the totals. Nothing if t is the time of the last
 * update. */
void drape_relaxed_update(drape_relaxed_set *set, double t, double max_factor);

/* The number of nodes that are relaxed for a collider. */
int32_t drape_relaxed_count(const drape_relaxed_set *set, int32_t collider);

/* When the first of these nodes was relaxed [s]; INFINITY: there are none. */
double drape_relaxed_since(const drape_relaxed_set *set, int32_t collider);

/* Removes the nodes for which `leaves` is true. Returns their number. */
typedef bool drape_relaxed_leaves(void *user, const drape_relaxed_node *node);
int32_t drape_relaxed_remove(drape_relaxed_set *set, drape_relaxed_leaves *leaves, void *user);

/* Copies the relaxed nodes and the totals from a set of the same cloth. before (collider_count): the number
 * that each collider has there; -1: it is new. Errors: DRAPE_E_MEMORY. */
drape_status drape_relaxed_continue(drape_relaxed_set *to, const drape_relaxed_set *from,
                                    const int32_t *before);

void drape_relaxed_archive(drape_relaxed_set *set, drape_archive *a);

#endif
