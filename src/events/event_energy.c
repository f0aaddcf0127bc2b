/* energy: an energy of the whole scene minus a bound. */
#include "events/events.h"

enum { PARAM_OF, PARAM_BOUND, PARAM_COUNT };

enum { KINETIC, ELASTIC, GRAVITY, CONTACT };
static const char *const energies[] = {"kinetic", "elastic", "gravity", "contact", "total", NULL};

static const drape_param params[PARAM_COUNT] = {
    [PARAM_OF] = DRAPE_CHOICE("of", 0, energies,
                              "energy that is measured, over all cloths; total: the sum of the four others"),
    [PARAM_BOUND] = DRAPE_NUMBER("bound", "J", DRAPE_REQUIRED, -1e18, 1e18, "energy that is passed"),
};

static double measure(const drape_event_point *p)
{
    const double parts[] = {[KINETIC] = p->energy->kinetic,
                            [ELASTIC] = p->energy->elastic,
                            [GRAVITY] = p->energy->gravity,
                            [CONTACT] = p->energy->contact};
    const int of = (int)p->event->values[PARAM_OF];
    return of <= CONTACT ? parts[of] : parts[KINETIC] + parts[ELASTIC] + parts[GRAVITY] + parts[CONTACT];
}

const drape_event_ops drape_event_energy = {
    .entry = {.name = "energy",
              .summary = "an energy of the scene passes a bound",
              .reference = "E - bound = 0",
              DRAPE_PARAMS(params)},
    .bound = PARAM_BOUND,
    .needs_energy = true,
    .measure = measure,
};
