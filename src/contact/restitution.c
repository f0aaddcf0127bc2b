/* restitution.c: see restitution.h. */
#include "contact/restitution.h"

#include "base/vec3.h"
#include "contact/barrier.h"

#include <math.h>

#define D DRAPE_GAP_DOFS

drape_normal drape_normal_at(const drape_gap *gap, const drape_contact_law *law, double v[4][3])
{
    drape_normal normal = {.lambda = drape_law_normal_force(gap, law)};
    const double eps = law->restitution_velocity, kappa = law->damping;
    double u = 0;
    if (!(kappa > 0))
        return normal;
    for (int i = 0; i < gap->closest.points; i++)
        u += gap->closest.c[i] * vec3_dot(gap->closest.normal, v[i]);
    const double speed = fabs(u);
    normal.secant = kappa * drape_secant_of_speed(speed, eps);
    normal.share = speed < eps ? normal.secant * u : copysign(kappa, u);
    normal.slope = speed < eps ? kappa * 2 * (1 - speed / eps) / eps : 0;
    return normal;
}

/* The second derivative of the gap. */
static double second(const drape_gap *gap, const drape_gap_derivatives *derivatives, int i, int j)
{
    return gap->closest.c[i / 3] * derivatives->closest.normal[i % 3][j] +
           derivatives->closest.c[i / 3][j] * gap->closest.normal[i % 3];
}

void drape_normal_derive(const drape_gap *gap, const drape_gap_derivatives *derivatives,
                         const drape_contact_law *law, double v[4][3], drape_normal_derivatives *out)
{
    const drape_barrier b = drape_barrier_at(gap->value / law->distance, law->low);
    const int d = 3 * gap->closest.points;
    for (int j = 0; j < d; j++) {
        out->lambda[j] = -gap->m * law->stiffness / law->distance * b.ddb * gap->closest.c[j / 3] *
                         gap->closest.normal[j % 3];
        if (gap->mollified)
            out->lambda[j] -= law->stiffness * b.db * gap->dm[j];
        out->rate[j] = 0;
        for (int i = 0; law->damping > 0 && i < d; i++)
            out->rate[j] += v[i / 3][i % 3] * second(gap, derivatives, i, j);
    }
}

void drape_normal_by_v(const drape_gap *gap, const drape_normal *normal, double weight, double *dn)
{
    for (int j = 0; j < 3 * gap->closest.points; j++)
        dn[j] = -weight * normal->lambda * normal->slope * gap->closest.c[j / 3] * gap->closest.normal[j % 3];
}

void drape_normal_add_by_x(const drape_gap *gap, const drape_normal *normal,
                           const drape_normal_derivatives *derivatives, double *dn)
{
    for (int j = 0; j < 3 * gap->closest.points; j++)
        dn[j] += (1 - normal->share) * derivatives->lambda[j] -
                 normal->lambda * normal->slope * derivatives->rate[j];
}

void drape_restitution_force(const drape_gap *gap, const drape_normal *normal, double *g)
{
    for (int i = 0; i < 3 * gap->closest.points; i++)
        g[i] = normal->lambda * normal->share * gap->closest.c[i / 3] * gap->closest.normal[i % 3];
}

void drape_restitution_add_dgdv(const drape_gap *gap, const drape_normal *normal, double slope, double *h)
{
    const double *c = gap->closest.c, *n = gap->closest.normal, scale = slope * normal->lambda;
    const int d = 3 * gap->closest.points;
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++)
            h[D * i + j] += scale * c[i / 3] * n[i % 3] * c[j / 3] * n[j % 3];
}

/* With the gap s: d(lambda kappa f ds/dx) = ds/dx (kappa f dlambda + lambda slope du) + lambda kappa f
 * d2s/dx2 */
void drape_restitution_add_dgdx(const drape_gap *gap, const drape_gap_derivatives *derivatives,
                                const drape_normal *normal, const drape_normal_derivatives *by_x, double *h)
{
    const int d = 3 * gap->closest.points;
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++) {
            const double change =
                normal->share * by_x->lambda[j] + normal->lambda * normal->slope * by_x->rate[j];
            h[D * i + j] += gap->closest.c[i / 3] * gap->closest.normal[i % 3] * change +
                            normal->lambda * normal->share * second(gap, derivatives, i, j);
        }
}
