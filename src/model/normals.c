/* normals.c: normals of nodes. The cross product of two edges of a triangle points along its normal and has
 * the length of twice its area, so the sum around a node is the area-weighted mean. */
#include "model/normals.h"
#include "base/vec3.h"
#include "model/model.h"

#include <string.h>

void drape_add_normals(const double *x, const int32_t *triangle, size_t count, double *normals)
{
    for (const int32_t *node = triangle; node < triangle + 3 * count; node += 3) {
        double m[3];
        vec3_triangle_area(node, x, m);
        for (int i = 0; i < 3; i++)
            vec3_add_scaled(1, m, normals + 3 * (size_t)node[i]);
    }
}

void drape_model_normals(const drape_model *model, const double *x, double *normals)
{
    if (!model || !x || !normals)
        return;
    memset(normals, 0, 3 * (size_t)model->node_count * sizeof *normals);
    drape_add_normals(x, model->triangle, (size_t)model->triangle_count, normals);
    for (size_t i = 0; i < (size_t)model->node_count; i++) {
        double *n = normals + 3 * i, length = vec3_norm(n);
        for (int k = 0; k < 3; k++)
            n[k] = length > 0 ? n[k] / length : 0;
    }
}
