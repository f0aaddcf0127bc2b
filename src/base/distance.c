/* distance.c: see distance.h. */
#include "base/distance.h"

#include "base/param.h"

#include <string.h>

bool drape_distance_read(const char *text, drape_distance *out)
{
    static const struct {
        const char *name;
        drape_distance one;
    } units[] = {{"m", {1, false}},     {"cm", {1e-2, false}}, {"mm", {1e-3, false}},
                 {"um", {1e-6, false}}, {"%", {1e-2, true}},   {"", {1, true}}};
    double number;
    const char *end = drape_number_read(text, &number), *unit = end ? end + strspn(end, " ") : NULL;
    for (size_t i = 0; end && i < sizeof units / sizeof *units; i++)
        if (strcmp(unit, units[i].name) == 0) {
            *out = (drape_distance){number * units[i].one.value, units[i].one.is_share};
            return out->value > 0 && out->value < (out->is_share ? 1 : 1e300);
        }
    return false;
}
