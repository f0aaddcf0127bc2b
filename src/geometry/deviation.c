/* deviation.c: see deviation.h. */
#include "geometry/deviation.h"

#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "geometry/embed.h"

/* The triangle of a node is found from a point this share of the distance to the centroid of one of its own
 * triangles away, so that a node on a cut finds its own side of it. */
#define INWARD 1e-6

static drape_box rest_box(const drape_model *m, const drape_cloth *cloth)
{
    return drape_box_of(m->triangle + 3 * (size_t)cloth->first_triangle, 3 * cloth->mesh.triangle_count,
                        m->rest, 0);
}

static bool same_triangles(const drape_cloth *a, const drape_cloth *b)
{
    return a->mesh.node_count == b->mesh.node_count && a->mesh.triangle_count == b->mesh.triangle_count &&
           memcmp(a->mesh.triangle, b->mesh.triangle,
                  3 * (size_t)a->mesh.triangle_count * sizeof *a->mesh.triangle) == 0;
}

/* Binds the nodes of one cloth to the triangles of the same cloth of the other model, at rest. */
static drape_status bind_nodes(drape_deviation *d, int32_t c, drape_context *ctx, double *gap)
{
    const drape_model *m = d->model[d->of], *other = d->model[!d->of];
    const drape_cloth *cloth = &m->cloths[c], *in = &other->cloths[c];
    drape_arena arena = drape_arena_of(ctx);
    drape_bvh tree;
    drape_status status =
        drape_bvh_build(&arena, in->mesh.triangle_count, 3, other->triangle + 3 * (size_t)in->first_triangle,
                        other->rest, &tree);
    if (!status)
        drape_bvh_fit(&tree, other->rest);
    for (size_t i = 0; i < 3 * (size_t)cloth->mesh.triangle_count && !status; i++) {
        const int32_t *triangle = m->triangle + 3 * ((size_t)cloth->first_triangle + i / 3);
        const double *x = m->rest + 3 * (size_t)triangle[i % 3];
        drape_embedded *to = &d->counterparts[triangle[i % 3]];
        double inward[3];
        if (to->flat) /* bound from an earlier triangle */
            continue;
        for (size_t k = 0; k < 3; k++)
            inward[k] = (1 - INWARD) * x[k] +
                        INWARD / 3 *
                            (m->rest[3 * (size_t)triangle[0] + k] + m->rest[3 * (size_t)triangle[1] + k] +
                             m->rest[3 * (size_t)triangle[2] + k]);
        const drape_on_triangle found = drape_nearest_on(&tree, other->rest, inward, INFINITY);
        drape_embed_in(&tree, other->rest, NULL, x, found.triangle, found.distance, to);
        *gap = fmax(*gap, found.distance);
    }
    drape_arena_free(&arena);
    return status;
}

static drape_status prepare_cloth(drape_deviation *d, int32_t c, drape_context *ctx)
{
    const drape_model *m = d->model[d->of], *other = d->model[!d->of];
    const drape_cloth *cloth = &m->cloths[c], *in = &other->cloths[c];
    const drape_box box = rest_box(m, cloth), box_in = rest_box(other, in);
    const bool same = same_triangles(cloth, in);
    double edge = 0, gap = 0; /* the mean edge; how far the meshes are apart at rest [m] */
    if (strcmp(cloth->name, in->name) != 0)
        return drape_fail(ctx, DRAPE_E_ARGUMENT,
                          "cloth %d is \"%.60s\" in the first and \"%.60s\" in the second", (int)c,
                          d->model[0]->cloths[c].name, d->model[1]->cloths[c].name);
    d->cloths[c].diagonal = cloth->diagonal;
    for (int32_t e = 0; e < cloth->mesh.edge_count; e++)
        edge += cloth->mesh.edge_length[e] / cloth->mesh.edge_count;
    for (int k = 0; k < 3; k++) /* the other may reach further than any node of this one */
        gap = fmax(gap, fmax(fabs(box.low[k] - box_in.low[k]), fabs(box.high[k] - box_in.high[k])));
    for (int32_t i = 0; same && i < cloth->mesh.node_count; i++) {
        const int32_t node = in->first_node + i;
        double apart[3];
        vec3_sub(m->rest + 3 * (size_t)(cloth->first_node + i), other->rest + 3 * (size_t)node, apart);
        gap = fmax(gap, vec3_norm(apart));
        d->counterparts[cloth->first_node + i] =
            (drape_embedded){.node = {node, node, node}, .weights = {1}, .flat = true};
    }
    drape_status status = same ? DRAPE_OK : bind_nodes(d, c, ctx, &gap);
    d->material |= !same;
    d->gap = fmax(d->gap, gap);
    if (status || gap <= edge)
        return status;
    return drape_fail(
        ctx, DRAPE_E_ARGUMENT,
        "cloth \"%.60s\": at rest the meshes are %.3g m apart; those of one cloth are at most a mean "
        "edge apart, here %.3g m",
        cloth->name, gap, edge);
}

drape_status drape_deviation_create(drape_arena *arena, const drape_model *first, const drape_model *second,
                                    drape_deviation *d)
{
    *d = (drape_deviation){.model = {first, second}, .of = second->node_count < first->node_count};
    const size_t nodes = (size_t)d->model[d->of]->node_count;
    if (first->cloth_count != second->cloth_count)
        return drape_fail(arena->ctx, DRAPE_E_ARGUMENT, "the first has %d cloths, the second %d",
                          (int)first->cloth_count, (int)second->cloth_count);
    d->counterparts = drape_arena_take(arena, nodes, sizeof *d->counterparts);
    d->distance = drape_arena_take(arena, nodes, sizeof *d->distance);
    d->cloths = drape_arena_take(arena, (size_t)first->cloth_count, sizeof *d->cloths);
    drape_status status = d->counterparts && d->distance && d->cloths ? DRAPE_OK : DRAPE_E_MEMORY;
    for (int32_t c = 0; c < first->cloth_count && !status; c++)
        status = prepare_cloth(d, c, arena->ctx);
    return status;
}

void drape_deviation_restart(drape_deviation *d)
{
    d->frames = 0;
    for (int32_t c = 0; c < d->model[0]->cloth_count; c++)
        d->cloths[c].largest = (drape_apart){.node = d->model[d->of]->cloths[c].first_node};
}

void drape_deviation_measure(drape_deviation *d, double t, const double *x, const double *y)
{
    const double *const motion[2] = {x, y};
    const drape_model *m = d->model[d->of];
    for (int32_t c = 0; c < m->cloth_count; c++) {
        const size_t first = (size_t)m->cloths[c].first_node, count = (size_t)m->cloths[c].mesh.node_count;
        drape_apart *now = &d->cloths[c].now;
        double sum = 0;
        *now = (drape_apart){.rms_time = t, .time = t, .rms_frame = d->frames, .distance = -1};
        for (size_t i = first; i < first + count; i++) {
            double place[2][3], apart[3];
            memcpy(place[d->of], motion[d->of] + 3 * i, sizeof place[0]);
            drape_embedded_point(&d->counterparts[i], motion[!d->of], NULL, place[!d->of]);
            vec3_sub(place[0], place[1], apart);
            sum += vec3_dot(apart, apart);
            d->distance[i] = vec3_norm(apart);
            if (d->distance[i] > now->distance) {
                now->distance = d->distance[i];
                now->node = (int32_t)i;
                memcpy(now->place, place, sizeof place);
            }
        }
        now->rms = sqrt(sum / (double)count);
    }
}

void drape_deviation_add(drape_deviation *d, double t, const double *x, const double *y)
{
    drape_deviation_measure(d, t, x, y);
    for (int32_t c = 0; c < d->model[0]->cloth_count; c++) {
        const drape_apart *now = &d->cloths[c].now;
        drape_apart *largest = &d->cloths[c].largest, before = *largest;
        if (d->frames == 0 || now->distance > before.distance)
            *largest = *now;
        const drape_apart *rms = d->frames == 0 || now->rms > before.rms ? now : &before;
        largest->rms = rms->rms;
        largest->rms_time = rms->rms_time;
        largest->rms_frame = rms->rms_frame;
    }
    d->frames++;
}

int32_t drape_deviation_worst(const drape_deviation *d)
{
    int32_t worst = 0;
    for (int32_t c = 1; c < d->model[0]->cloth_count; c++)
        if (d->cloths[c].largest.rms * d->cloths[worst].diagonal >
            d->cloths[worst].largest.rms * d->cloths[c].diagonal)
            worst = c;
    return worst;
}
