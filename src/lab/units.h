/* units.h: the unit of a value of a scene, for the axis of a picture. */
#ifndef DRAPE_LAB_UNITS_H
#define DRAPE_LAB_UNITS_H

/* The unit at a JSON pointer, as "Pa"; "" where it has none, or where it depends on what else the scene says. */
const char *lab_unit(const char *pointer);

#endif
