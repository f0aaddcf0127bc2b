/* model.c: queries on a compiled scene. */
#include "model/model.h"

#include "base/elementary.h"
#include "base/rotation.h"
#include "base/vec3.h"
#include "model/track.h"

#include <math.h>

void drape_model_destroy(drape_model **model)
{
    if (!model || !*model)
        return;
    drape_model *m = *model;
    drape_context *ctx = m->ctx;
    for (int32_t c = 0; c < m->cloth_count && !m->base && !m->part; c++) {
        drape_mesh_free(&m->cloths[c].mesh);
        drape_mesh_free(&m->cloths[c].render_mesh);
    }
    drape_arena_free(&m->arena);
    drape_free(ctx, m);
    *model = NULL;
}

int32_t drape_model_node_count(const drape_model *model)
{
    return model ? model->part ? model->part->all_nodes : model->node_count : 0;
}

int32_t drape_model_triangle_count(const drape_model *model)
{
    return model ? model->triangle_count : 0;
}

int64_t drape_model_dof_count(const drape_model *model)
{
    return model ? 3 * (int64_t)drape_model_all_free(model) : 0;
}

int64_t drape_model_nonzero_count(const drape_model *model)
{
    return model ? model->part ? model->part->all_nonzeros : model->pattern.nonzeros : 0;
}

const int32_t *drape_model_triangles(const drape_model *model)
{
    return model ? model->triangle : NULL;
}

const double *drape_model_rest_positions(const drape_model *model)
{
    return model ? model->rest : NULL;
}

const double *drape_model_masses(const drape_model *model)
{
    return model ? model->mass : NULL;
}

const uint8_t *drape_model_pinned(const drape_model *model)
{
    return model ? model->pinned : NULL;
}

int32_t drape_model_cloth_count(const drape_model *model)
{
    return model ? model->cloth_count : 0;
}

drape_cloth_range drape_model_cloth(const drape_model *model, int32_t index)
{
    if (!model || index < 0 || index >= model->cloth_count)
        return (drape_cloth_range){.name = ""};
    const drape_cloth *cloth = &model->cloths[index];
    return (drape_cloth_range){.name = cloth->name,
                               .first_node = cloth->first_node,
                               .node_count = cloth->mesh.node_count,
                               .first_triangle = cloth->first_triangle,
                               .triangle_count = cloth->mesh.triangle_count};
}

int32_t drape_model_collider_count(const drape_model *model)
{
    return model ? model->collider_count : 0;
}

drape_collider_motion drape_model_collider(const drape_model *model, int32_t index, double t)
{
    if (!model || index < 0 || index >= model->collider_count)
        return (drape_collider_motion){.name = "", .type = ""};
    const drape_collider *collider = &model->colliders[index];
    drape_collider_motion motion = {.name = collider->name, .type = collider->ops->entry.name};
    drape_track_displacement(collider->track.keys, collider->track.key_count, t, motion.displacement);
    drape_track_velocity(collider->track.keys, collider->track.key_count, t, motion.velocity);
    return motion;
}

bool drape_model_collider_rotation(const drape_model *model, int32_t index, double t, double rotation[4],
                                   double angular_velocity[3], double pivot[3])
{
    double matrix[9];
    if (!model || index < 0 || index >= model->collider_count)
        return false;
    const drape_collider *collider = &model->colliders[index];
    drape_turns_rotation(&collider->turns, t, matrix);
    if (rotation)
        drape_rotation_quaternion(matrix, rotation);
    if (angular_velocity)
        drape_turns_velocity(&collider->turns, t, angular_velocity);
    if (pivot) {
        drape_track_displacement(collider->track.keys, collider->track.key_count, t, pivot);
        vec3_add_scaled(1, collider->pivot, pivot);
    }
    return true;
}

double drape_model_duration(const drape_model *model)
{
    return model ? model->duration : 0;
}

double drape_model_frame_rate(const drape_model *model)
{
    return model ? model->frame_rate : 0;
}

void drape_model_place_pins(const drape_model *model, double t, double *x)
{
    for (int32_t i = 0; i < model->moved_count; i++) {
        const size_t at = 3 * (size_t)model->moved_node[i];
        drape_track_point(&model->tracks[model->moved_track[i]], model->start + at, t, x + at);
    }
    for (int32_t i = 0; model->supports_move && i < model->support_count; i++) {
        const drape_support *support = &model->supports[i];
        for (int d = 0; d < support->count; d++) {
            double by[3];
            if (support->track[d] < 0)
                continue;
            const drape_track *track = &model->tracks[support->track[d]];
            drape_track_displacement(track->keys, track->key_count, t, by);
            vec3_add_scaled(vec3_dot(support->normal[d], by), support->dual[d],
                            x + 3 * (size_t)support->node);
        }
    }
}

int drape_model_couplings(const drape_model *model, const bool *without, drape_coupling *couplings)
{
    bool features = false;
    int count = 0;
    for (int32_t i = 0; i < model->term_count; i++)
        if (drape_term_couples(&model->terms[i]) && !(without && without[i]))
            couplings[count++] = drape_term_coupling(&model->terms[i]);
    for (int32_t i = 0; i < model->collider_count; i++)
        features = features || model->colliders[i].shape.point_count > 0;
    if (features)
        couplings[count++] =
            (drape_coupling){.count = model->triangle_count, .nodes = 3, .node = model->triangle};
    if (model->image_coupled_count > 0)
        couplings[count++] =
            (drape_coupling){.count = model->image_coupled_count, .nodes = 2, .node = model->image_coupled};
    return count;
}

/* Principal strains of triangles. Let D = (x1 - x0, x2 - x0) be the edge vectors, and R the same at rest, in
 * a frame of the triangle whose first axis is its first edge. The deformation gradient is F = D R^-1 (3 x 2).
 * The principal stretches are the square roots of the eigenvalues of F'F, a symmetric 2 x 2 matrix. */
void drape_model_strain(const drape_model *model, const double *x, double *strain)
{
    if (!model || !x || !strain)
        return;
    for (const int32_t *n = model->triangle; n < model->triangle + 3 * (size_t)model->triangle_count;
         n += 3) {
        double a[3], b[3], normal[3], u[3], v[3], f[2][3];
        vec3_triangle_sides(n, model->rest, a, b);
        vec3_triangle_sides(n, x, u, v);
        vec3_cross(a, b, normal);
        /* R = (l, p; 0, h): b is p along the first edge and h across; R^-1 = (1/l, -p/(l h); 0, 1/h). */
        const double l = vec3_norm(a), p = vec3_dot(a, b) / l, h = vec3_norm(normal) / l;
        for (int k = 0; k < 3; k++) {
            f[0][k] = u[k] / l;
            f[1][k] = (v[k] - p * f[0][k]) / h;
        }
        const double c00 = vec3_dot(f[0], f[0]), c01 = vec3_dot(f[0], f[1]), c11 = vec3_dot(f[1], f[1]),
                     mean = 0.5 * (c00 + c11), spread = drape_hypot(0.5 * (c00 - c11), c01);
        *strain++ = sqrt(mean + spread) - 1;
        *strain++ = sqrt(fmax(0, mean - spread)) - 1;
    }
}

double drape_model_mean_edge(const drape_model *m)
{
    const drape_ranks *ranks = drape_model_ranks(m);
    double sum = 0, count = 0;
    for (int32_t e = 0; e < m->edge_count; e++)
        if (drape_model_owns(m, m->edge[2 * (size_t)e])) {
            sum += m->edge_length[e];
            count++;
        }
    return drape_ranks_sum(ranks, sum) / drape_ranks_sum(ranks, count);
}

int32_t drape_model_diagnosed(const drape_model *m, int32_t node, int32_t *number)
{
    int32_t c = 0;
    if (m->part) {
        while (c + 1 < m->cloth_count && m->part->cloth[c + 1] <= node)
            c++;
        *number = node - m->part->cloth[c];
    } else {
        c = drape_model_cloth_of(m, node);
        *number = node - m->cloths[c].first_node;
    }
    return c;
}

int32_t drape_model_cloth_of(const drape_model *model, int32_t node)
{
    int32_t c = 0;
    while (c + 1 < model->cloth_count && model->cloths[c + 1].first_node <= node)
        c++;
    return c;
}
