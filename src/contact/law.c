/* law.c: see law.h. */
#include "contact/law.h"

#include "contact/barrier.h"

#define D DRAPE_GAP_DOFS

double drape_law_energy(const drape_gap *gap, const drape_contact_law *law)
{
    return gap->m * law->stiffness * law->distance * drape_barrier_at(gap->value / law->distance, law->low).b;
}

double drape_law_normal_force(const drape_gap *gap, const drape_contact_law *law)
{
    return -gap->m * law->stiffness * drape_barrier_at(gap->value / law->distance, law->low).db;
}

void drape_law_gradient(const drape_gap *gap, const drape_contact_law *law, double *g)
{
    const drape_barrier b = drape_barrier_at(gap->value / law->distance, law->low);
    const double e = law->stiffness * law->distance * b.b, de = law->stiffness * b.db;
    for (int i = 0; i < 3 * gap->closest.points; i++)
        g[i] = gap->m * de * (gap->closest.c[i / 3] * gap->closest.normal[i % 3]) +
               (gap->mollified ? e * gap->dm[i] : 0);
}

void drape_law_hessian(const drape_gap *gap, const drape_gap_derivatives *derivatives,
                       const drape_contact_law *law, double *h)
{
    const int d = 3 * gap->closest.points;
    const drape_barrier b = drape_barrier_at(gap->value / law->distance, law->low);
    const double m = gap->m, e = law->stiffness * law->distance * b.b, de = law->stiffness * b.db,
                 dde = law->stiffness / law->distance * b.ddb, *c = gap->closest.c, *n = gap->closest.normal;
    double dgap[D];
    for (int i = 0; i < d; i++)
        dgap[i] = c[i / 3] * n[i % 3];
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++) {
            double ddgap = c[i / 3] * derivatives->closest.normal[i % 3][j] +
                           derivatives->closest.c[i / 3][j] * n[i % 3];
            double sum = m * (dde * dgap[i] * dgap[j] + de * ddgap);
            if (gap->mollified)
                sum += de * (dgap[i] * gap->dm[j] + gap->dm[i] * dgap[j]) + e * derivatives->ddm[i][j];
            h[D * i + j] = sum;
        }
}

void drape_law_gauss_newton(const drape_gap *gap, const drape_contact_law *law, double *h)
{
    const int d = 3 * gap->closest.points;
    const double second = /* m K/d b'' */
        gap->m * law->stiffness / law->distance * drape_barrier_at(gap->value / law->distance, law->low).ddb;
    const double *c = gap->closest.c, *n = gap->closest.normal;
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++)
            h[D * i + j] = second * c[i / 3] * n[i % 3] * c[j / 3] * n[j % 3];
}
