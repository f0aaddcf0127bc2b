/* orthotropic.c: see orthotropic.h. */
#include "terms/orthotropic.h"

#include "base/vec3.h"

#include <float.h>
#include <math.h>
#include <string.h>

void drape_orthotropic_law(const double *values, const drape_woven *measured, double strip, double poisson,
                           double c[9])
{
    const drape_woven isotropic = {strip, strip, NAN, poisson}, *of = measured ? measured : &isotropic;
    const double given[] = {values[DRAPE_ORTHOTROPIC_WARP], values[DRAPE_ORTHOTROPIC_WEFT],
                            values[DRAPE_ORTHOTROPIC_SHEAR], values[DRAPE_ORTHOTROPIC_POISSON]};
    const double warp = isnan(given[0]) ? of->warp : given[0], weft = isnan(given[1]) ? of->weft : given[1];
    const double shear = isnan(given[2]) ? of->shear : given[2],
                 nu = isnan(given[3]) ? of->poisson : given[3];
    const double mean = sqrt(warp * weft), law[9] = {warp / (1 - nu * nu),
                                                     nu * mean / (1 - nu * nu),
                                                     0,
                                                     nu * mean / (1 - nu * nu),
                                                     weft / (1 - nu * nu),
                                                     0,
                                                     0,
                                                     0,
                                                     isnan(shear) ? mean / (2 * (1 + nu)) : shear};
    memcpy(c, law, sizeof law);
}

/* The unit vector along the projection of a into the plane with unit normal n; false if half of its digits
 * are rounding errors. */
static bool project(const double a[3], const double n[3], double out[3])
{
    const double along = vec3_dot(a, n);
    for (int i = 0; i < 3; i++)
        out[i] = a[i] - along * n[i];
    const double length = vec3_norm(out);
    if (!(length > sqrt(DBL_EPSILON) * vec3_norm(a)))
        return false;
    for (int i = 0; i < 3; i++)
        out[i] /= length;
    return true;
}

bool drape_orthotropic_frame(const double *values, const drape_cloth_view *cloth, int32_t triangle,
                             const double c[9], double axes[6], double flat[6])
{
    const double *warp = values + DRAPE_ORTHOTROPIC_DIRECTION;
    const double x_axis[3] = {1, 0, 0};
    double a[3], b[3], n[3];
    vec3_triangle_sides(cloth->triangle + 3 * (size_t)triangle, cloth->rest, a, b);
    vec3_cross(a, b, n);
    const double twice_area = vec3_norm(n);
    for (int i = 0; i < 3; i++)
        n[i] /= twice_area;
    const bool isotropic = c[0] == c[4] && fabs(2 * c[8] - (c[0] - c[1])) <= 1e-12 * c[0];
    if (!project(vec3_norm(warp) > 0 ? warp : x_axis, n, axes)) {
        if (!isotropic)
            return false;
        project(a, n, axes);
    }
    vec3_cross(n, axes, axes + 3);
    for (int k = 0; k < 2; k++) {
        flat[k] = 0;
        flat[2 + k] = vec3_dot(a, axes + 3 * k);
        flat[4 + k] = vec3_dot(b, axes + 3 * k);
    }
    return true;
}

drape_status drape_orthotropic_refuse(drape_term_builder *builder, int32_t triangle)
{
    return drape_term_refuse(builder,
                             "the warp is perpendicular to triangle %d of the mesh; \"warp_direction\" is a "
                             "direction that lies in the sheet",
                             (int)triangle);
}

/* Cholesky decomposition with pivoting. */
void drape_orthotropic_squares(const double c[9], int rank, double k[3], double l[9])
{
    double rest[9];
    memcpy(rest, c, sizeof rest);
    for (int r = 0; r < rank; r++) {
        int p = 0;
        for (int i = 1; i < 3; i++)
            p = rest[4 * i] > rest[4 * p] ? i : p;
        k[r] = rest[4 * p];
        for (int i = 0; i < 3; i++)
            l[3 * r + i] = rest[3 * i + p] / k[r];
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                rest[3 * i + j] -= k[r] * l[3 * r + i] * l[3 * r + j];
    }
}

/* For one column after another: C - C f f' C/(f' C f). */
void drape_orthotropic_release(double c[9], const double *f, int count)
{
    for (int n = 0; n < count; n++) {
        double cf[3] = {0}, work = 0;
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++)
                cf[i] += c[3 * i + j] * f[3 * n + j];
            work += f[3 * n + i] * cf[i];
        }
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                c[3 * i + j] -= cf[i] * cf[j] / work;
    }
}
