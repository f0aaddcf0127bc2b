/* grid.h: settings of rows, as a case takes them. */
#ifndef DRAPE_LAB_GRID_H
#define DRAPE_LAB_GRID_H

#include "integrators/integrator.h"
#include "lab/lab.h"

/* Whether a parameter list has that name. */
bool lab_has_param(const drape_param *params, int count, const char *name);

/* The row of that name; NULL: there is none. */
const drape_integrator_ops *lab_find_integrator(const char *name);

/* Whether a row ignores a pointer that an axis or a setting changes: "/integrator/..." that is no parameter of it. */
bool lab_ignores(const drape_integrator_ops *row, const char *pointer);

#endif
