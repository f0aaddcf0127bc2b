/* elements_of.h: the elements, edges or faces, that have each point. */
#ifndef DRAPE_CONTACT_ELEMENTS_OF_H
#define DRAPE_CONTACT_ELEMENTS_OF_H

#include "base/arena.h"

typedef struct drape_elements_of {
    int32_t *first;   /* (points + 1) where those of a point begin */
    int32_t *element; /* in rising order */
} drape_elements_of;

/* Takes memory for as many elements of this size, and lists those in `point` (count x size). */
drape_status drape_elements_of_create(drape_arena *arena, int32_t count, int size, const int32_t *point,
                                      int32_t points, drape_elements_of *out);

/* The edge, of (edges x 2), between two points; -1: none. */
int32_t drape_elements_of_edge(const drape_elements_of *edges, const int32_t *edge, int32_t a, int32_t b);

#endif
