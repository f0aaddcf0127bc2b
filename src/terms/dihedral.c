/* dihedral.c: see dihedral.h. */
#include "terms/dihedral.h"

/* Coordinate k of the hinge in lane l is x[LANES k + l]. */
LANES_DISPATCH static void evaluate(const double *x, double *theta, double *g, double *h)
{
    lanes corner[4][3];
    drape_dihedral_lanes d;
    for (int k = 0; k < 12; k++)
        corner[k / 3][k % 3] = lanes_load(x + LANES * k);
    drape_dihedral_measure(corner, &d);
    lanes_store(theta, d.theta);
    if (g)
        drape_dihedral_gradient(&d, g);
    if (h)
        drape_dihedral_hessian(&d, h);
}

/* Copies h from one lane and fills in the blocks above the diagonal. */
static void take_hessian(const double *from, double *h)
{
    for (int i = 0; i < 12; i++)
        for (int j = 0; j < i - i % 3 + 3; j++)
            h[12 * i + j] = h[12 * j + i] = from[LANES * (12 * i + j)];
}

void drape_dihedrals(int count, const double *x, double *theta, double *g, double *h)
{
    double side_by_side[12 * LANES], angle[LANES], gradient[12 * LANES], hessian[144 * LANES];
    for (int k = 0; k < 12; k++)
        for (int l = 0; l < LANES; l++)
            side_by_side[LANES * k + l] = x[12 * (l < count ? l : 0) + k];
    evaluate(side_by_side, angle, g ? gradient : NULL, h ? hessian : NULL);
    for (int l = 0; l < count; l++) {
        theta[l] = angle[l];
        for (int k = 0; g && k < 12; k++)
            g[12 * l + k] = gradient[LANES * k + l];
        if (h)
            take_hessian(hessian + l, h + 144 * l);
    }
}

void drape_dihedral_tie(double *g, double *h)
{
    for (int i = 0; g && i < 6; i++)
        g[i] += g[9 + i % 3] / 2;
    for (int i = 0; h && i < 12; i++)
        for (int j = 0; j < 6; j++)
            h[12 * i + j] += h[12 * i + 9 + j % 3] / 2;
    for (int i = 0; h && i < 6; i++)
        for (int j = 0; j < 9; j++)
            h[12 * i + j] += h[12 * (9 + i % 3) + j] / 2;
}

double drape_nearest_branch(double angle, double reference)
{
    static const double two_pi = 6.28318530717958647693;
    if (!isfinite(reference)) /* from a collapsed state set by the user */
        return angle;
    return angle + two_pi * round((reference - angle) / two_pi);
}
