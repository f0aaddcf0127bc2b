/* transform.c: transforms a mesh: x' = R (s x) + t, with componentwise scale s, rotation R by an angle about
 * an axis, and translation t. */
#include "base/elementary.h"
#include "base/finite.h"
#include "base/pi.h"
#include "mesh/mesh.h"

#include <math.h>

#include "base/vec3.h"

drape_status drape_mesh_check_transform(drape_context *ctx, const char *pointer, const double scale[3],
                                        const double rotate[4], const double translate[3])
{
    if (!drape_all_finite(scale, 3) || scale[0] <= 0 || scale[1] <= 0 || scale[2] <= 0)
        return drape_fail_below(ctx, pointer, "transform/scale",
                                "%g %g %g; each must be finite and > 0, a mirror image would turn the mesh "
                                "inside out",
                                scale[0], scale[1], scale[2]);
    if (!drape_all_finite(rotate, 4))
        return drape_fail_below(ctx, pointer, "transform/rotate",
                                "%g %g %g %g; axis and angle must be finite", rotate[0], rotate[1], rotate[2],
                                rotate[3]);
    if (rotate[3] != 0 && rotate[0] == 0 && rotate[1] == 0 && rotate[2] == 0)
        return drape_fail_below(ctx, pointer, "transform/rotate",
                                "the axis of a rotation by %g degrees is 0 0 0; it must not be zero",
                                rotate[3]);
    if (!drape_all_finite(translate, 3))
        return drape_fail_below(ctx, pointer, "transform/translate", "%g %g %g; each must be finite",
                                translate[0], translate[1], translate[2]);
    return DRAPE_OK;
}

/* Exact for multiples of 90 degrees: in floating point cos(pi/2) is not 0 and would tilt a sheet
 * that is rotated upright. */
static void sine_and_cosine(double degrees, double *sine, double *cosine)
{
    const double turn = fmod(degrees, 360), quarters = round(turn / 90);
    const double rest = (turn - 90 * quarters) * (DRAPE_PI / 180);
    const int quarter = ((int)quarters + 4) % 4;
    double s, c;
    drape_sin_cos(rest, &s, &c);
    *sine = quarter % 2 ? c : s;
    *cosine = quarter % 2 ? s : c;
    if (quarter > 1)
        *sine = -*sine;
    if (quarter == 1 || quarter == 2)
        *cosine = -*cosine;
}

/* Rodrigues: R = cos a I + sin a [k]x + (1 - cos a) k k^T for a unit axis k. */
void drape_rotation_matrix(const double rotate[4], double matrix[3][3])
{
    double sine = 0, cosine = 1, k[3] = {0, 0, 0};
    const double largest = fmax(fabs(rotate[0]), fmax(fabs(rotate[1]), fabs(rotate[2])));
    if (largest > 0) { /* divide by the largest component first, so that no square under- or overflows */
        sine_and_cosine(rotate[3], &sine, &cosine);
        for (int i = 0; i < 3; i++)
            k[i] = rotate[i] / largest;
        const double length = vec3_norm(k);
        for (int i = 0; i < 3; i++)
            k[i] /= length;
    }
    const double cross[3][3] = {{0, -k[2], k[1]}, {k[2], 0, -k[0]}, {-k[1], k[0], 0}};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            matrix[i][j] = (i == j ? cosine : 0) + sine * cross[i][j] + (1 - cosine) * k[i] * k[j];
}

void drape_mesh_transform(drape_mesh *mesh, const double scale[3], const double rotate[4],
                          const double translate[3])
{
    double matrix[3][3];
    drape_rotation_matrix(rotate, matrix);
    for (int32_t node = 0; node < mesh->node_count; node++) {
        double *x = mesh->x + 3 * (size_t)node;
        const double scaled[3] = {scale[0] * x[0], scale[1] * x[1], scale[2] * x[2]};
        for (int i = 0; i < 3; i++)
            x[i] = vec3_dot(matrix[i], scaled) + translate[i];
    }
}
