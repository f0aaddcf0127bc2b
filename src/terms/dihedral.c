/* dihedral.c: see dihedral.h. */
#include "terms/dihedral.h"

void drape_dihedral_tie(int lane, double *ds, double *dds)
{
    double h[144];
    for (int i = 0; ds && i < 6; i++)
        ds[LANES * i + lane] += ds[LANES * (9 + i % 3) + lane] / 2;
    for (int i = 9; ds && i < 12; i++)
        ds[LANES * i + lane] = 0;
    if (!dds)
        return;
    /* The full Hessian of the hinge in a lane, from its blocks on and below the diagonal. */
    for (int i = 0; i < 12; i++)
        for (int j = 0; j < i - i % 3 + 3; j++)
            h[12 * i + j] = h[12 * j + i] = dds[LANES * (12 * i + j) + lane];
    for (int i = 0; i < 12; i++)
        for (int j = 0; j < 6; j++)
            h[12 * i + j] += h[12 * i + 9 + j % 3] / 2;
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 9; j++)
            h[12 * i + j] += h[12 * (9 + i % 3) + j] / 2;
    for (int i = 0; i < 144; i++)
        dds[LANES * i + lane] = i < 108 && i % 12 < 9 ? h[i] : 0;
}

double drape_nearest_branch(double angle, double reference)
{
    static const double two_pi = 6.28318530717958647693;
    if (!isfinite(reference)) /* from a collapsed state set by the user */
        return angle;
    return angle + two_pi * round((reference - angle) / two_pi);
}
