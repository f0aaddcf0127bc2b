/*
 * orient.h: on which side of a plane a point lies, exactly. The sign is that of the real numbers that the
 * coordinates are, whatever the rounding, as long as each is 0 or of a magnitude between 1e-90 and 1e90.
 */
#ifndef DRAPE_GEOMETRY_ORIENT_H
#define DRAPE_GEOMETRY_ORIENT_H

/* The sign of the volume of the tetrahedron a b c d: 1 if a, b, c are counterclockwise seen from d, -1 if
 * clockwise, 0 if the four points lie in a plane. */
int drape_orient(const double *a, const double *b, const double *c, const double *d);

#endif
