/* quantity.h: the results of a case that are numbers, by their names: the columns of results.csv that a map
 * or a curve can show. */
#ifndef DRAPE_LAB_QUANTITY_H
#define DRAPE_LAB_QUANTITY_H

#include "lab/lab.h"

typedef struct lab_quantity {
    drape_entry entry; /* name and meaning */
    const char *unit;  /* "": none */
} lab_quantity;

extern const drape_registry lab_quantity_registry;

/* Of an index in the registry. */
const lab_quantity *lab_quantity_at(int index);

#endif
