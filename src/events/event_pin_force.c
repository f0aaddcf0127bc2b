/* pin_force: the force of pins on their nodes minus a limit. */
#include "events/events.h"

#include "base/vec3.h"

enum { PARAM_OF, PARAM_LIMIT, PARAM_COUNT };

enum { SUM, LARGEST };
static const char *const sums[] = {"sum", "largest", NULL};

static const drape_param params[PARAM_COUNT] = {
    [PARAM_OF] =
        DRAPE_CHOICE("of", 0, sums, "length of the sum of the forces, or the largest force on one node"),
    [PARAM_LIMIT] = DRAPE_NUMBER("limit", "N", DRAPE_REQUIRED, 0, 1e18, "force that is passed"),
};

static double measure(const drape_event_point *p)
{
    double sum[3] = {0}, largest = 0;
    for (int32_t i = 0; i < p->event->pinned_count; i++) {
        const double *force = p->reactions + 3 * (size_t)p->event->pinned[i];
        vec3_add_scaled(1, force, sum);
        largest = fmax(largest, vec3_norm(force));
    }
    return (int)p->event->values[PARAM_OF] == SUM ? vec3_norm(sum) : largest;
}

const drape_event_ops drape_event_pin_force = {
    .entry = {.name = "pin_force",
              .summary = "the force of pins on the cloth passes a limit",
              .reference = "|f| - limit = 0, f as of drape_sim_reactions",
              DRAPE_PARAMS(params)},
    .bound = PARAM_LIMIT,
    .needs_reactions = true,
    .needs_pins = true,
    .measure = measure,
};
