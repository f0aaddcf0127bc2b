/* dihedral.h: the angle between two triangles that share an edge, with its derivatives, of four points. */
#ifndef DRAPE_TERMS_DIHEDRAL_H
#define DRAPE_TERMS_DIHEDRAL_H

/* x: x0 x1 the edge, x2 the apex on its left seen against the normal, x3 the one on its right. The angle in
 * (-pi, pi] is positive where x3 stands out along the normal: for a graph it is the jump of the slope across
 * the edge. g (12), h (12 x 12, symmetric); NULL: not wanted. */
double drape_dihedral(const double x[12], double *g, double *h);

/* Where x3 is (x0 + x1)/2 + a constant: its derivatives go to x0 and x1, by halves; the first 9 of g and h (9
 * x 9 of 12 x 12) are right then. */
void drape_dihedral_tie(double *g, double *h);

/* The branch of an angle, known up to 2 pi, that is nearest to reference. */
double drape_nearest_branch(double angle, double reference);

#endif
