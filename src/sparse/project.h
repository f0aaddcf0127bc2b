/* project.h: the positive semidefinite matrix nearest to a symmetric one (in the Frobenius norm), for element
 * Hessians. */
#ifndef DRAPE_SPARSE_PROJECT_H
#define DRAPE_SPARSE_PROJECT_H

/* Replaces a (n x n, symmetric, n <= DRAPE_MAX_ELEMENT_DOFS) by V max(Lambda, 0) V'. */
void drape_project(int n, double *a);

/* Makes a symmetric matrix of the same sizes diagonal; v (n x n) receives its eigenvectors as columns. */
void drape_diagonalise(int n, double *a, double *v);

#endif
