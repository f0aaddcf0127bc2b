/* render_mesh.c: see render_mesh.h. The displacement along interpolated normals is that of surfaces of
 * several resolutions, as in Kobbelt et al. 1998, doi:10.1145/280814.280831, section 4. */
#include "model/render_mesh.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "model/model.h"

#define LEAST_WEIGHT 1e-9 /* less is rounding: the node carries nothing */

void drape_embedded_point(const drape_embedded *e, const double *x, const double *normals, double point[3])
{
    double n[3] = {0};
    memset(point, 0, 3 * sizeof *point);
    for (int a = 0; a < 3; a++)
        vec3_add_scaled(e->weights[a], x + 3 * (size_t)e->node[a], point);
    if (e->flat)
        vec3_triangle_normal(e->node, x, n);
    for (int a = 0; !e->flat && a < 3; a++)
        vec3_add_scaled(e->weights[a], normals + 3 * (size_t)e->node[a], n);
    vec3_add_scaled(e->height, n, point);
}

void drape_render_positions(const drape_model *model, int32_t cloth, const double *x, const double *normals,
                            double *positions)
{
    const drape_render_surface *s = &model->surface;
    for (int32_t c = cloth < 0 ? 0 : cloth; c < (cloth < 0 ? s->cloth_count : cloth + 1); c++) {
        const drape_render_cloth *from = &s->cloths[c];
        const size_t count = (size_t)from->mesh->node_count;
        if (!from->bound)
            memcpy(positions, x + 3 * (size_t)model->cloths[c].first_node, 3 * count * sizeof *x);
        for (size_t i = 0; from->bound && i < count; i++)
            drape_embedded_point(&from->bound[i], x, normals, positions + 3 * i);
        positions += 3 * count;
    }
}

void drape_render_values(const drape_model *model, const double *values, int width, double *out)
{
    const size_t w = (size_t)width;
    for (int32_t c = 0; c < model->surface.cloth_count; c++) {
        const drape_render_cloth *to = &model->surface.cloths[c];
        const size_t count = (size_t)to->mesh->node_count;
        if (!to->bound)
            memcpy(out, values + w * (size_t)model->cloths[c].first_node, w * count * sizeof *out);
        for (size_t i = 0; to->bound && i < count; i++) {
            /* within the triangle: extrapolation would give a speed or an energy that is nowhere */
            double weights[3], sum = 0;
            for (int a = 0; a < 3; a++)
                sum += weights[a] = fmax(to->bound[i].weights[a], 0);
            for (int a = 0; a < 3; a++)
                weights[a] /= sum;
            for (size_t k = 0; k < w; k++) {
                out[w * i + k] = 0;
                for (int a = 0; a < 3; a++)
                    out[w * i + k] += weights[a] * values[w * (size_t)to->bound[i].node[a] + k];
            }
        }
        out += w * count;
    }
}

void drape_render_triangles(const drape_model *model, int32_t *out)
{
    for (int32_t c = 0; c < model->surface.cloth_count; c++) {
        const drape_render_cloth *cloth = &model->surface.cloths[c];
        for (int32_t t = 0; t < cloth->mesh->triangle_count; t++)
            *out++ = cloth->bound ? cloth->bound[cloth->mesh->triangle[3 * (size_t)t]].triangle
                                  : model->cloths[c].first_triangle + t;
    }
}

void drape_render_pinned(const drape_model *model, uint8_t *out)
{
    for (int32_t c = 0; c < model->surface.cloth_count; c++) {
        const drape_render_cloth *cloth = &model->surface.cloths[c];
        for (int32_t i = 0; i < cloth->mesh->node_count; i++, out++) {
            *out = cloth->bound ? 1 : model->pinned[model->cloths[c].first_node + i];
            for (int a = 0; cloth->bound && a < 3; a++)
                *out = *out &&
                       (cloth->bound[i].weights[a] < LEAST_WEIGHT || model->pinned[cloth->bound[i].node[a]]);
        }
    }
}

drape_render_mesh drape_model_render_mesh(const drape_model *model, int32_t cloth)
{
    if (!model || cloth < -1 || cloth >= model->surface.cloth_count)
        return (drape_render_mesh){.triangles = NULL};
    const drape_render_surface *s = &model->surface;
    if (cloth < 0)
        return (drape_render_mesh){.vertex_count = s->node_count,
                                   .triangle_count = s->triangle_count,
                                   .triangles = s->triangle,
                                   .rest = s->rest};
    const drape_mesh *mesh = s->cloths[cloth].mesh;
    return (drape_render_mesh){.vertex_count = mesh->node_count,
                               .triangle_count = mesh->triangle_count,
                               .triangles = mesh->triangle,
                               .rest = mesh->x};
}

void drape_model_render_positions(const drape_model *model, int32_t cloth, const double *x,
                                  const double *normals, double *positions)
{
    if (model && cloth >= -1 && cloth < model->surface.cloth_count && x && normals && positions)
        drape_render_positions(model, cloth, x, normals, positions);
}
