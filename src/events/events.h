/*
 * events.h: the table of event functions. An event occurs at a root of f(t, x, v) = q - bound, where q is the
 * quantity that its entry measures and the bound is one of the entry's parameters. An event function is the
 * constant drape_event_<name> of event_<name>.c. It depends on nothing but what it is given here, so that it
 * can be evaluated at any time within a step (sim/event_set.h).
 */
#ifndef DRAPE_EVENTS_EVENTS_H
#define DRAPE_EVENTS_EVENTS_H

#include "model/model.h"

/* A moment at which an event function is evaluated. */
typedef struct drape_event_point {
    const drape_model *model;
    const drape_model_event *event; /* with the values of its parameters */
    const double *x, *v;            /* (node_count x 3) [m], [m/s] */
    const drape_energy *energy;     /* `dissipated` and `numerical` are 0; NULL unless needs_energy */
    const double *reactions; /* (node_count x 3) [N] of pins on their nodes, as of drape_sim_reactions; NULL
                                unless needs_reactions */
} drape_event_point;

struct drape_event_ops {
    drape_entry entry; /* its unit is that of the bound */
    int bound;         /* the index of the bound among the values of the parameters */
    bool needs_energy, needs_reactions;
    bool needs_pins; /* it is about pins: there must be some */
    /* Checks the values of the event against the model, and may set some. NULL: nothing to check. Errors are
     * reported at or below the pointer: DRAPE_E_ARGUMENT. */
    drape_status (*check)(drape_context *ctx, const char *pointer, const drape_model *model,
                          drape_model_event *event);
    double (*measure)(const drape_event_point *point);
};

extern const drape_event_ops *const drape_events[]; /* NULL-ended */
extern const drape_registry drape_event_registry;

/* ---- Which nodes a position is measured at ---- */

/* The parameters and their places among the values: of a list that begins with DRAPE_EVENT_NODES. */
enum { DRAPE_EVENT_OF, DRAPE_EVENT_NODE, DRAPE_EVENT_NODES_COUNT };

extern const char *const drape_event_nodes[];

#define DRAPE_EVENT_NODES                                                                                    \
    [DRAPE_EVENT_OF] = DRAPE_CHOICE("of", 0, drape_event_nodes,                                              \
                                    "measure the lowest or the highest node, or the center of mass"),        \
    [DRAPE_EVENT_NODE] = DRAPE_INTEGER("node", "1", DRAPE_DERIVED("none: as `of` says"), 0, INT32_MAX,       \
                                       "number of one node of the cloth, to be measured alone")

/* Whether the node, if there is one, is in the cloth, of which there is then exactly one. */
drape_status drape_event_check_node(drape_context *ctx, const char *pointer, const drape_model *model,
                                    drape_model_event *event);

/* The position along a direction of length 1 [m]: of the one node, or of the nodes of the event's cloths. */
double drape_event_position(const drape_event_point *point, const double direction[3]);

#endif
