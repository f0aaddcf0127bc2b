/* units.h: the unit of a value of a scene, for the axis of a picture. */
#ifndef DRAPE_LAB_UNITS_H
#define DRAPE_LAB_UNITS_H

/* Of a value at a JSON pointer, as "Pa"; "" where it has none, or where entries disagree about it. */
const char *lab_unit(const char *pointer);

#endif
