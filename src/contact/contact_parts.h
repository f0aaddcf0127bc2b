/*
 * contact_parts.h: the struct behind contact.h, and what its files share, in the order of these files
 * (contact.c has the list).
 */
#ifndef DRAPE_CONTACT_CONTACT_PARTS_H
#define DRAPE_CONTACT_CONTACT_PARTS_H

#include "colliders/deformed.h"
#include "contact/active.h"
#include "contact/contact.h"
#include "contact/friction.h"
#include "contact/predict.h"
#include "contact/restitution.h"

/* In mean edges: the candidates of a longer path may be too many to keep, and are searched at its end
 * alone. */
#define DRAPE_LONGEST_SEARCH 8.0

/* Of the activation distance: nodes that a collider reaches are put there. The force that accelerates cloth
 * of areal density sigma to a speed v within a step h is K b'(y), with K = sigma (2 g L + v^2)/d, so b'(y) =
 * v d/(h (2 g L + v^2)): y is 0.7 to 1 for what moves by d and less in a step. */
#define DRAPE_RESTING 0.8

/* A contact and its normal force at the beginning of the step. */
typedef struct drape_lagged {
    drape_active_contact contact;
    double force; /* [N] */
} drape_lagged;

/* How much stiffer contact is than the scene's stiffness, so that cloth that is pressed hard keeps its
 * distance. It changes between steps only. */
typedef struct drape_stiffening {
    double factor;      /* >= 1 */
    double largest_gap; /* of the smallest gaps of the steps since the last raise, in activation distances */
    double t;           /* [s] at the last step */
    double work;        /* [J] that changes have added to the contact energy, until it is taken */
} drape_stiffening;

struct drape_contact {
    drape_arena *arena;
    const atomic_bool *const *cancel; /* NULL: nothing is watched */
    const drape_model *model;
    const drape_ranks *ranks;   /* the model's */
    const drape_motion *motion; /* of its colliders */
    double mean_edge;           /* [m] */
    double dt;                  /* [s] nominal step, by which activation distances grow; 0: there is none */
    double longest_path; /* [m] of a collider in such a step so far; not archived: for a warning alone */
    drape_broad_phase broad;

    drape_candidates step_candidates;
    drape_candidates query_candidates; /* for queries between steps where step_candidates are not valid */
    bool between_steps;                /* evaluated for frames, energies or the user, not for a step */

    double *x, *v;             /* (points x 3) where contact is evaluated */
    drape_collider_pose *pose; /* (collider_count) */
    drape_active_set active;   /* at x, if it is listed */
    bool listed;
    bool out_of_memory; /* in a search of collision detection: the next update or check reports it */

    bool begun;                      /* a step has begun: */
    double start_t;                  /* [s] its beginning */
    double *start, *start_v;         /* (points x 3) */
    drape_collider_pose *start_pose; /* (collider_count) */
    drape_inside_pairs inside;       /* at its beginning */
    double *start_least;             /* (collider_count) the smallest gap with each collider at its beginning,
                                        at most 0 [m] */
    double *distance_before;         /* (collider_count) scratch: activation distances [m] */
    drape_stiffening stiffening;
    drape_exempt *exempt; /* NULL: all pairs are held. Set from outside, where it is archived */
    bool refused;         /* the last check since the step began failed for a pair: */
    drape_pair refusing;
    drape_lagged *lagged; /* (lagged_count of lagged_capacity) lagged friction */
    int32_t lagged_count, lagged_capacity;

    drape_predictions predicted, predicting; /* for the next Jacobian, and while they are made; not archived:
                                                empty when a step begins */
    double *from, *to;                       /* (points x 3) the ends of a displacement: ccd.c */
    double *before; /* (node_count) of_node of the last step fraction, if that was one of pairs: */
    bool has_before;
    bool *moved, *carried;          /* (points + collider_count), (node_count) scratch of sweep.c */
    drape_collider_pose *path_pose; /* (collider_count) */
    drape_collider_pose *kink_pose; /* (collider_count) */
    int32_t *coupling;              /* (coupling_count of coupling_capacity x 4) */
    int32_t coupling_count, coupling_capacity;
    double *own, *own_end; /* (largest point_count x 3) points of a collider that deforms, and elsewhere */
    double *on_point;      /* (points - node_count, x 3) [N] forces on points of colliders that deform */
    drape_deformed **deformed;   /* (collider_count) those that deform, else NULL */
    const drape_collider **body; /* (collider_count) of deformed */
    double *body_t;              /* [s] (collider_count) at which they are; not archived: NAN, they follow */
    drape_swing *swing;          /* (collider_count) from one end of a displacement to the other */
    drape_load *on_collider;     /* (collider_count) */
    double seconds, search_seconds;
};

/* ---- evaluation.c ---- */

/* Sets what rounding can change in the gaps of these positions (points x 3): all that contact compares gaps
 * with follows from the beginning of the step. */
void drape_contact_set_rounding(drape_contact *c, const double *x);

/* The poses of colliders at time t, without velocities. pose: (collider_count). */
void drape_contact_poses(const drape_contact *c, double t, drape_collider_pose *pose);

/* Sets all points: the given nodes, which may be those of x, and the points of colliders in their poses. x:
 * (points x 3). */
void drape_contact_fill(const drape_contact *c, const double *nodes, const drape_collider_pose *pose,
                        double *x);

/* Lets the distances from colliders that deform be those of the times of these poses. Returns the body of a
 * configuration. */
const drape_collider *const *drape_contact_fit_bodies(const drape_contact *c,
                                                      const drape_collider_pose *pose);
void drape_contact_forget_bodies(drape_contact *c);

/* drape_contact_evaluate_at without its timing. */
drape_status drape_contact_update(drape_contact *c, const drape_contact_at *at);

/* Sets the velocities of nodes, and those of colliders at the instant t: at the beginning of a step, whose
 * size is not known yet. */
void drape_contact_set_instant(drape_contact *c, const double *v, double t);

/* The candidates that are valid on a path, and how far that is from theirs; NULL: a search is needed. */
const drape_candidates *drape_contact_valid_candidates(const drape_contact *c,
                                                       const drape_straight_path *path,
                                                       drape_distances *away);

/* Searches candidates on a path. NULL: out of memory. */
const drape_candidates *drape_contact_search(drape_contact *c, const drape_straight_path *path,
                                             drape_distances *away);

/* DRAPE_E_MEMORY, once, if collision detection was out of memory since the last call. */
drape_status drape_contact_take_failure(drape_contact *c);

/* Lists the active set of a configuration. Errors: DRAPE_E_MEMORY. */
drape_status drape_contact_list(drape_contact *c, const drape_configuration *at);

static inline drape_configuration drape_contact_configuration(const drape_contact *c)
{
    return (drape_configuration){.model = c->model, .x = c->x, .pose = c->pose};
}

/* ---- forces.c ---- */

/* The constants of a contact. */
drape_contact_law drape_contact_law_of(const drape_contact *c, const drape_active_contact *contact);

/* Whether a contact is with a feature of a collider that turns and has a surface at some distance from its
 * features; and that distance, along the normal of the contact. */
bool drape_contact_rolls(const drape_contact *c, const drape_active_contact *contact);
double drape_contact_arm(const drape_contact *c, const drape_active_contact *contact);

/* Velocities of the points of an active contact, relative to the collider if it is a surface; those of its
 * features with that of the surface around them. */
void drape_contact_velocities(const drape_contact *c, const drape_active_contact *contact, double v[4][3]);

/* ---- ccd.c ---- */

/* Whether a collider lets these nodes of one cloth in: it is ignored, or one of them is exempt. */
static inline bool drape_contact_lets_in(const drape_contact *c, int32_t collider, const int32_t *node,
                                         int nodes)
{
    return drape_model_ignores(c->model, collider, node[0]) ||
           drape_exempt_has(c->exempt, collider, node, nodes);
}

/* What a step must keep of gaps on its path. */
drape_keep drape_contact_keep_step(const drape_contact *c);

/* The largest step fraction from one configuration to another on which all pairs of features keep what they
 * must of their gaps, and the pair that limits it. Nodes move straight, and so do the points of colliders,
 * except those that turn by their swing (collider_count; NULL: none turns). of_node (node_count), unless
 * NULL, is lowered at each node to the smallest fraction of its pairs. of_surfaces, unless NULL, is set to
 * the smallest fraction of nodes and smooth surfaces, which must rest at c->path_pose; of_node then counts
 * these, too. before (node_count), unless NULL: pairs whose nodes all have 1 there are known to limit
 * nothing. cancel, unless NULL, ends the search when it is raised: then the result is negative. */
double drape_contact_free_fraction(drape_contact *c, const drape_straight_path *straight,
                                   const drape_swing *swing, const drape_keep *keep, double *of_node,
                                   double *of_surfaces, const double *before, const atomic_bool *cancel,
                                   drape_pair *limiting);

/* The same for the path of a node from x to y, and the smooth surface of a collider, which goes from one pose
 * to another, by its swing unless that is NULL. */
double drape_contact_march(const drape_contact *c, int32_t collider, const drape_collider_pose *from,
                           const drape_collider_pose *to, const drape_swing *swing, const double *x,
                           const double *y, const drape_keep *keep);

/* How far the points of a collider stray at most from straight paths [m] when it turns by an angle [rad]. */
double drape_contact_stray(const drape_collider *collider, double angle);

/* The least gap [m] between cloth and a collider. */
double drape_contact_least_gap(const drape_contact *c);

/* ---- contact.c ---- */

/* Computes lagged friction from the active set at the beginning of a step. */
drape_status drape_contact_lag(drape_contact *c);

/* Notes how deep cloth is in each collider at the beginning of a step, from the near pairs there. */
void drape_contact_measure_start(drape_contact *c);

#endif
