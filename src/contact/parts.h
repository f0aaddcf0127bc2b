/*
 * parts.h: the struct behind contact.h, and what its files share. contact.c: the configuration and its
 * active set; forces.c: forces and energy; jacobian.c: derivatives and their blocks in a pattern; ccd.c:
 * continuous collision detection; check.c: the end of a step; checkpoint.c: archives.
 */
#ifndef DRAPE_CONTACT_PARTS_H
#define DRAPE_CONTACT_PARTS_H

#include "contact/active.h"
#include "contact/contact.h"
#include "contact/friction.h"

#define DRAPE_KEEP_STEP 1e-3 /* of a gap: coming nearer than that within a step counts as a crossing */

/* A contact and its normal force at the beginning of the step. */
typedef struct drape_lagged {
    drape_active_contact contact;
    double lambda; /* [N] */
} drape_lagged;

struct drape_contact {
    drape_arena *arena;
    const drape_model *model;
    const drape_motion *motion; /* of its colliders */
    double mean_edge;           /* [m] */
    drape_broad_phase broad;

    drape_candidates step_candidates;  /* for steps, whose results depend on no other candidates */
    drape_candidates query_candidates; /* for queries between steps where step_candidates are not valid */
    double next_margin;                /* of the next search [m] */
    bool between_steps;                /* evaluated for frames, energies or the user, not for a step */

    double *x, *v;                  /* (points x 3) where contact is evaluated */
    drape_collider_pose *pose;      /* (collider_count) */
    drape_active_set active;        /* at x */
    const drape_candidates *listed; /* the candidates that the active set was listed from; NULL: it is not
                                       valid */
    double moved;                   /* farthest move of a point from their search [m] */

    bool begun;                      /* a step has begun: */
    double *start;                   /* (points x 3) its beginning */
    drape_collider_pose *start_pose; /* (collider_count) */
    double *start_gaps;   /* (node_count) smallest distance from the surfaces of colliders, at most 0 [m] */
    double start_least;   /* smallest gap of a feature of a collider, at most 0 [m] */
    drape_lagged *lagged; /* (lagged_count of lagged_room) lagged friction */
    int32_t lagged_count, lagged_room;

    double *of_node;                /* (node_count) while drape_contact_node_fractions runs; else NULL */
    double *from, *to;              /* (points x 3) the ends of a displacement: ccd.c */
    drape_collider_pose *path_pose; /* (collider_count) */
    int32_t *coupling;              /* (coupling_count of coupling_room x 4) */
    int32_t coupling_count, coupling_room;
    double *on_collider; /* (collider_count x 3) [N] */
    double seconds, search_seconds;
};

/* The poses of colliders at time t, with their mean velocity over span. pose: (collider_count). */
void drape_contact_poses(const drape_contact *c, double t, const double span[2], drape_collider_pose *pose);

/* Sets all points: the given nodes, and the points of colliders in their poses. x: (points x 3). */
void drape_contact_fill(const drape_contact *c, const double *nodes, const drape_collider_pose *pose,
                        double *x);

/* drape_contact_evaluate_at without its timing. A search, if necessary, is made at x + lead (x - start). */
drape_status drape_contact_update(drape_contact *c, const drape_contact_at *at, double lead);

/* The lead within a step. */
double drape_contact_lead(const drape_contact *c);

/* Compute lagged friction and the initial depths from the active set at the beginning of a step. */
drape_status drape_contact_lag(drape_contact *c);
void drape_contact_measure_start(drape_contact *c);

/* The candidates that are valid at a configuration, and how far points have moved since their search; NULL:
 * a search is needed. */
const drape_candidates *drape_contact_valid_candidates(const drape_contact *c, const drape_configuration *at,
                                                       double *moved);

/* The constants of a pair. */
drape_contact_law drape_contact_law_of(const drape_contact *c, const drape_pair *pair);

/* Velocities of the points of an active contact, relative to the collider if it is a surface. */
void drape_contact_velocities(const drape_contact *c, const drape_active_contact *contact, double v[4][3]);

/* The largest step fraction from x to y (points x 3) on which all pairs keep `keep` of their gap, and the
 * pair that limits it. Colliders are at pose; core: the radius counts as 0. */
double drape_contact_free_fraction(drape_contact *c, const double *x, const double *y,
                                   const drape_collider_pose *pose, double keep, bool core,
                                   drape_pair *limiting);

static inline drape_configuration drape_contact_configuration(const drape_contact *c)
{
    return (drape_configuration){.model = c->model, .x = c->x, .pose = c->pose};
}

#endif
