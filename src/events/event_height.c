/* height: y - height of a node, of the lowest or highest node, or of the center of mass. */
#include "events/events.h"

enum { PARAM_HEIGHT = DRAPE_EVENT_NODES_COUNT, PARAM_COUNT };

static const drape_param params[PARAM_COUNT] = {
    DRAPE_EVENT_NODES,
    [PARAM_HEIGHT] = DRAPE_NUMBER("height", "m", DRAPE_REQUIRED, -1e9, 1e9, "y that is crossed"),
};

static double measure(const drape_event_point *p)
{
    return drape_event_position(p, (const double[3]){0, 1, 0});
}

const drape_event_ops drape_event_height = {
    .entry = {.name = "height",
              .summary = "a node, the lowest or highest node, or the center of mass crosses a height",
              .reference = "y - height = 0",
              DRAPE_PARAMS(params)},
    .bound = PARAM_HEIGHT,
    .check = drape_event_check_node,
    .measure = measure,
};
