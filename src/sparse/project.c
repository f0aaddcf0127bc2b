/*
 * project.c: eigenvalues by cyclic Jacobi rotations (Golub & Van Loan, Matrix Computations, 8.5), then
 * negative ones set to zero. For 6 x 6 and 12 x 12 matrices Jacobi is as fast as LAPACK, needs no heap and no
 * library, and gives the same bits everywhere.
 */
#include "sparse/project.h"

#include "drape/extend.h"

#include <math.h>
#include <string.h>

#define MAX_SWEEPS 30 /* convergence is quadratic: 6 to 8 sweeps are typical */

static double off_diagonal(int n, const double *a)
{
    double sum = 0;
    for (int i = 0; i < n; i++)
        for (int j = i + 1; j < n; j++)
            sum += a[n * i + j] * a[n * i + j];
    return 2 * sum;
}

static double squared_norm(int n, const double *a)
{
    double sum = 0;
    for (int i = 0; i < n * n; i++)
        sum += a[i] * a[i];
    return sum;
}

/* Cosine and sine of the rotation that makes a(p, q) zero. */
static void rotation(double app, double aqq, double apq, double *c, double *s)
{
    double tau = (aqq - app) / (2 * apq);
    double t = (tau >= 0 ? 1.0 : -1.0) / (fabs(tau) + sqrt(1 + tau * tau));
    *c = 1 / sqrt(1 + t * t);
    *s = t * *c;
}

/* Columns p and q of m (n x n): [mp mq] = [mp mq] [c s; -s c]. */
static void rotate_columns(int n, double *m, int p, int q, double c, double s)
{
    for (int i = 0; i < n; i++) {
        double mp = m[n * i + p], mq = m[n * i + q];
        m[n * i + p] = c * mp - s * mq;
        m[n * i + q] = s * mp + c * mq;
    }
}

static void rotate_rows(int n, double *m, int p, int q, double c, double s)
{
    for (int i = 0; i < n; i++) {
        double mp = m[n * p + i], mq = m[n * q + i];
        m[n * p + i] = c * mp - s * mq;
        m[n * q + i] = s * mp + c * mq;
    }
}

void drape_diagonalise(int n, double *a, double *v)
{
    double small = 1e-30 * squared_norm(n, a); /* 1e-15 relative to the norm */
    for (int i = 0; i < n * n; i++)
        v[i] = i % (n + 1) == 0;
    for (int sweep = 0; sweep < MAX_SWEEPS && off_diagonal(n, a) > small; sweep++)
        for (int p = 0; p < n; p++)
            for (int q = p + 1; q < n; q++) {
                double c, s;
                if (a[n * p + q] == 0)
                    continue;
                rotation(a[n * p + p], a[n * q + q], a[n * p + q], &c, &s);
                rotate_columns(n, a, p, q, c, s);
                rotate_rows(n, a, p, q, c, s);
                rotate_columns(n, v, p, q, c, s);
            }
}

void drape_project(int n, double *a)
{
    double d[DRAPE_MAX_ELEMENT_DOFS * DRAPE_MAX_ELEMENT_DOFS],
        v[DRAPE_MAX_ELEMENT_DOFS * DRAPE_MAX_ELEMENT_DOFS];
    memcpy(d, a, (size_t)(n * n) * sizeof *a);
    drape_diagonalise(n, d, v);
    for (int k = 0; k < n; k++) {
        double negative = d[(n + 1) * k];
        if (!(negative < 0))
            continue;
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++)
                a[n * i + j] -= negative * v[n * i + k] * v[n * j + k];
    }
}
