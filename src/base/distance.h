/* distance.h: distances that people write, such as "1mm", "0.5 cm", "1%" or "1e-2". */
#ifndef DRAPE_BASE_DISTANCE_H
#define DRAPE_BASE_DISTANCE_H

#include <stdbool.h>

typedef struct drape_distance {
    double value;  /* [m], or [1] of a size */
    bool is_share; /* it has no unit, or % */
} drape_distance;

/* [m] of something of this size [m]. */
static inline double drape_distance_of(const drape_distance *distance, double size)
{
    return distance->value * (distance->is_share ? size : 1);
}

/* What is read, for messages. */
#define DRAPE_DISTANCE_FORM                                                                                  \
    "a length above 0 in m, cm, mm or um, such as 1mm, or a share of a cloth's diagonal, above 0 and below " \
    "1, such as 1e-2 or 1%"

/* Reads all of a text; false: it is no such text. */
bool drape_distance_read(const char *text, drape_distance *out);

#endif
