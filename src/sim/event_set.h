/*
 * event_set.h: events, the roots of functions of the state, located within accepted steps. docs/scene.md has
 * what a user sees of them.
 *
 * After each attempt that the controller accepts, and before it is accepted, every event function is
 * evaluated on the dense output of the step (sim/dense.h). A root of an event that is only recorded is
 * located there, and the step stays as it is. At the first root of an event that acts, one that stops the run
 * or releases pins, the step ends: in the dense output of an integrator that has its own (step.c), and
 * otherwise the step is made again with another end: until the end is a root of the function of
 * the state that the integrator itself computes, to within EVENT_TOLERANCE. So the run is that of a host that
 * knew the time and advanced to it.
 */
#ifndef DRAPE_SIM_EVENT_SET_H
#define DRAPE_SIM_EVENT_SET_H

#include "base/archive.h"
#include "events/events.h"

struct drape_state;

#define DRAPE_EVENT_SAMPLES 4  /* evaluations in each step: both ends, and thirds */
#define DRAPE_EVENT_TIMES   32 /* the first roots of an event whose times are kept */

typedef struct drape_event_root {
    double t;      /* [s] */
    double value;  /* of the quantity, in the unit of its bound */
    int direction; /* 1: up; -1: down */
} drape_event_root;

/* An event as a sim looks out for it. */
typedef struct drape_watch {
    const drape_model_event *event;
    drape_event_function *function; /* of a host; NULL: the event has ops */
    void *user;
    drape_event_def def; /* of the host, with texts of the sim */
    bool known;          /* there is a `before` */
    double before;       /* f in the present state */
    int side;            /* the sign of f, after the roots so far; 0: it has been 0 since it was known */
    int64_t count;       /* roots that were events */
    drape_event_root first[DRAPE_EVENT_TIMES], last; /* of these */
    /* Of the attempt that is examined, and not archived: */
    double sample[DRAPE_EVENT_SAMPLES];
    int side_after;
    int64_t found;
} drape_watch;

/* A root that was found, and waits to be reported and acted on. */
typedef struct drape_pending_root {
    int32_t event;
    drape_event_root root;
} drape_pending_root;

/* The step that is repeated to end at the root of an event that acts. */
typedef struct drape_event_search {
    int32_t event;                /* -1: none */
    double from;                  /* [s] at which the step begins */
    double target;                /* [s] at which it shall end */
    double low, high;             /* [s] ends of the step that were tried, before and after the root */
    double low_value, high_value; /* f at these ends */
    int moved;                    /* the end that was tried last: 1: high; -1: low; 0: none */
    int64_t tries;
} drape_event_search;

typedef struct drape_events {
    drape_watch *watches; /* (count) those of the model, then those of the host */
    int32_t count;
    double *reactions; /* (node_count x 3); NULL: no event needs them */
    drape_event_search search;
    drape_pending_root *pending; /* (pending_count), in order of time */
    int32_t pending_count, pending_room, reported;
    int32_t
        stopped_by; /* the event that ended the last advance; -1: none. Not archived: it is about a call */
} drape_event_set;

/* What is to be done with an attempt that the controller accepted. */
typedef enum drape_event_verdict {
    DRAPE_EVENTS_PASS,   /* it is accepted; pending events have occurred within it or at its end */
    DRAPE_EVENTS_REPEAT, /* it is repeated with another end, which the schedule has */
    DRAPE_EVENTS_NOW,    /* it is given up: an event that acts has occurred in the present state */
    DRAPE_EVENTS_FAIL    /* an event function failed, with the message set */
} drape_event_verdict;

struct drape_sim;

/* The events of the model. Errors: DRAPE_E_MEMORY. */
drape_status drape_events_create(struct drape_sim *sim);

/* Adds those that a host added to another sim. Errors: DRAPE_E_MEMORY. */
drape_status drape_events_copy(struct drape_sim *sim, const struct drape_sim *from);

/* The quantities of events have changed without a step: no root lies there. Pending roots stay. */
void drape_events_forget(struct drape_sim *sim);

/* The state is another one: no root lies between it and the states before. */
void drape_events_reset(struct drape_sim *sim);

/* Examines an attempt from the present state to `next`, which ended contact's step. On FAIL, *status. */
drape_event_verdict drape_events_examine(struct drape_sim *sim, const struct drape_state *next,
                                         drape_status *status);

/* The attempt was accepted: what was examined is now the past. */
void drape_events_commit(struct drape_sim *sim);

/* Notifies the observers of pending roots that they do not know; the rest is for the next call if one of them
 * stops the run. */
drape_status drape_events_report(struct drape_sim *sim);

/* Performs the actions of pending roots, which are then over: pins are released, then the advance stops.
 * Errors: DRAPE_E_STOPPED, with its message; those of drape_sim_repin, after which they are still
 * pending. */
drape_status drape_events_act(struct drape_sim *sim);

/* Reports and performs what a stopped advance left over. */
drape_status drape_events_resume(struct drape_sim *sim);

/* Takes what another sim knows about the events that both have. */
void drape_events_continue(struct drape_sim *sim, const struct drape_sim *from);

void drape_events_archive(struct drape_sim *sim, drape_archive *a);

#endif
