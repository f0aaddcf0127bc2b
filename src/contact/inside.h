/*
 * inside.h: the struct behind contact.h and what its files share: contact.c (memory, placing, the beginning of a
 * step), sums.c (forces, derivatives, what is coupled) and passage.c (ways, and the check of a step).
 */
#ifndef DRAPE_CONTACT_INSIDE_H
#define DRAPE_CONTACT_INSIDE_H

#include "contact/contact.h"

#define DRAPE_SLOTS 4 /* of the table of touches, for each that there is room for */

/* Friction as it was where the step began. */
typedef struct drape_lagged {
    drape_pair pair;
    drape_gap gap; /* points, c and normal */
    double lambda; /* [N] */
} drape_lagged;

struct drape_contact {
    drape_context *ctx;
    const drape_model *model;
    const drape_motion *motion; /* of its colliders */
    drape_search search;
    drape_contact_law law;     /* all but the distance and stiffness of a pair */
    double *x, *v;             /* (points x 3) where it was last placed */
    double *from, *to;         /* (points x 3) the ends of a way */
    double *searched;          /* (points x 3) positions of the last search */
    drape_collider_pose *pose; /* (collider_count) */
    drape_collider_pose *searched_pose, *start_pose;
    bool known;         /* there was a search */
    bool begun;         /* a step was: start is of it */
    double mean_edge;   /* [m] */
    double margin;      /* how far points may move before a new one [m] */
    double next_margin; /* of the next search */
    double aim;         /* of the way from `start`: so much further is the next search made */
    double moved;       /* how far one has, where it was last placed [m] */
    bool resting;       /* between steps: what is asked is a frame, an energy, a host's */
    bool strayed;       /* it made a search: the last of the steps, which they go on with, was this: */
    bool steps_known;
    double steps_margin;
    double *steps_searched; /* (points x 3) */
    drape_collider_pose *steps_pose;
    drape_pair *pairs; /* (count of room) candidates, surfaces too */
    int32_t count, room;
    bool listed; /* the touches are those of x, and of the colliders at listed_pose */
    drape_touch
        *touches; /* (touch_count of touch_room) what acts, the same pieces once with all their area */
    int32_t touch_count, touch_room;
    int32_t *slots; /* (DRAPE_SLOTS x touch_room) hashed by nodes: 1 + a touch, 0: free */
    drape_collider_pose *listed_pose;
    drape_lagged *lagged; /* (lagged_count of lagged_room) */
    int32_t lagged_count, lagged_room;
    int32_t *coupling; /* (coupling_count of coupling_room x 4) */
    int32_t coupling_count, coupling_room;
    double *start;      /* (points x 3) of the step */
    double *start_gaps; /* of surfaces: (node_count) the deepest that a node lay in any collider, at most 0 */
    double start_least; /* the smallest feature gap that a collider had, at most 0 [m] */
    double *on_collider; /* (collider_count x 3) */
    drape_status status; /* of the search */
    double seconds, search_seconds;
};

/* A list with room for one more than count, the contents kept; NULL: out of memory, and the list is as it was. */
void *drape_contact_grow(drape_context *ctx, void *list, int32_t count, int32_t *room, size_t size);

/* Colliders where they are at time t, with their mean velocity over span. */
void drape_contact_pose(drape_contact *c, double t, const double span[2]);

/* All points: nodes as given, points of colliders as posed. */
void drape_contact_fill(const drape_contact *c, const double *nodes, double *x);

/* The furthest that a point is from where the last search had it; INFINITY without any. x: (points x 3). */
double drape_contact_moved(const drape_contact *c, const double *x);

/* drape_contact_place without its clock. */
drape_status drape_contact_go(drape_contact *c, const drape_contact_at *at);

/* All points at x, colliders as posed. */
static inline drape_placed drape_contact_placed(const drape_contact *c, const double *x)
{
    return (drape_placed){.model = c->model, .x = x, .pose = c->pose};
}

/* Whether a candidate can come nearer than `gap` where no point is further than moved from the last search. */
static inline bool drape_contact_may(const drape_pair *pair, double moved, double gap)
{
    return pair->found - 2 * moved < gap;
}

/* The gap of what acts where it was last placed. */
void drape_contact_gap(const drape_contact *c, const drape_touch *touch, bool derivatives, drape_gap *gap);

drape_contact_law drape_contact_law_of(const drape_contact *c, const drape_pair *pair);

#endif
