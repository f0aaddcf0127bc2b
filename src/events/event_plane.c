/* plane: n . x - offset of a node, of the lowest or highest node along n, or of the center of mass, with the
 * normal scaled to length 1. */
#include "events/events.h"

#include "base/elementary.h"

enum {
    PARAM_NORMAL = DRAPE_EVENT_NODES_COUNT,
    PARAM_OFFSET = PARAM_NORMAL + 1, /* in the list; each number of the normal is a value */
    PARAM_COUNT
};
enum { VALUE_OFFSET = PARAM_NORMAL + 3 };

static const drape_param params[PARAM_COUNT] = {
    DRAPE_EVENT_NODES,
    [PARAM_NORMAL] = DRAPE_VECTOR("normal", "1", DRAPE_REQUIRED, -1e9, 1e9,
                                  "normal n of the plane, of any length but 0; `lowest` is along it"),
    [PARAM_OFFSET] =
        DRAPE_NUMBER("offset", "m", 0, -1e9, 1e9, "n . x of the points of the plane, for n of length 1"),
};

/* Scales the normal once. */
static drape_status check(drape_context *ctx, const char *pointer, const drape_model *model,
                          drape_model_event *event)
{
    double *n = event->values + PARAM_NORMAL;
    const double length = drape_hypot(drape_hypot(n[0], n[1]), n[2]);
    const char *at = DRAPE_FORMAT("%s/normal", pointer);
    if (!(length > 0))
        return drape_refuse(ctx, at, "the normal is [0, 0, 0]; it must have a direction");
    for (int k = 0; k < 3; k++)
        n[k] /= length;
    return drape_event_check_node(ctx, pointer, model, event);
}

static double measure(const drape_event_point *p)
{
    return drape_event_position(p, p->event->values + PARAM_NORMAL);
}

const drape_event_ops drape_event_plane = {
    .entry = {.name = "plane",
              .summary = "a node, the lowest or highest node, or the center of mass crosses a plane",
              .reference = "n . x - offset = 0",
              DRAPE_PARAMS(params)},
    .bound = VALUE_OFFSET,
    .check = check,
    .measure = measure,
};
