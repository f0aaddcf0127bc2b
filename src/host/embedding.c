/* embedding.c: a mesh for rendering that the cloth carries (geometry/embed.h): in the frame of its triangle a
 * vertex does not move. */
#include "base/vec3.h"
#include "geometry/embed.h"
#include "model/model.h"

#include <math.h>

typedef struct fixture {
    drape_embedded vertex; /* flat */
    double normal[3];      /* its products with the sides of the triangle at its first corner, and n */
} fixture;

struct drape_embedding {
    drape_context *ctx;
    drape_arena arena;
    int32_t count;
    bool has_normals;
    fixture *fixtures; /* (count) */
};

/* The sides u and v of a triangle at its first corner, and its normal. */
typedef struct frame {
    double u[3], v[3], n[3];
} frame;

static frame frame_of(const int32_t *node, const double *x)
{
    frame f;
    vec3_sub(x + 3 * (size_t)node[1], x + 3 * (size_t)node[0], f.u);
    vec3_sub(x + 3 * (size_t)node[2], x + 3 * (size_t)node[0], f.v);
    vec3_triangle_normal(node, x, f.n);
    return f;
}

static void products(const frame *f, const double *d, double by[3])
{
    by[0] = vec3_dot(d, f->u);
    by[1] = vec3_dot(d, f->v);
    by[2] = vec3_dot(d, f->n);
}

static void to_double(const float *from, double to[3])
{
    for (int k = 0; k < 3; k++)
        to[k] = (double)from[k];
}

static void fix(const drape_bvh *tree, const double *rest, const float *vertex, const float *normal,
                fixture *to)
{
    double point[3], direction[3];
    to_double(vertex, point);
    drape_embed(tree, rest, NULL, point, &to->vertex);
    if (!normal)
        return;
    const frame f = frame_of(to->vertex.node, rest);
    to_double(normal, direction);
    products(&f, direction, to->normal);
}

static drape_status check(drape_context *ctx, const drape_model *model, int32_t cloth, int32_t count,
                          const float *vertices, const float *normals)
{
    if (!model || count < 1 || !vertices)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "drape_embedding_create: no model or no vertices");
    if (cloth < -1 || cloth >= model->cloth_count)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "drape_embedding_create: cloth %d; the model has %d",
                          (int)cloth, (int)model->cloth_count);
    for (size_t i = 0; i < 3 * (size_t)count; i++)
        if (!isfinite(vertices[i]) || (normals && !isfinite(normals[i])))
            return drape_fail(ctx, DRAPE_E_ARGUMENT,
                              "drape_embedding_create: vertex %zu or its normal is not finite", i / 3);
    return DRAPE_OK;
}

static drape_status fix_all(drape_embedding *e, const drape_model *m, int32_t cloth, const float *vertices,
                            const float *normals)
{
    drape_arena scratch = drape_arena_of(e->ctx);
    const int32_t first = cloth < 0 ? 0 : m->cloths[cloth].first_triangle,
                  count = cloth < 0 ? m->triangle_count : m->cloths[cloth].mesh.triangle_count;
    drape_bvh tree;
    drape_status status =
        drape_bvh_build(&scratch, count, 3, m->triangle + 3 * (size_t)first, m->rest, &tree);
    if (!status)
        drape_bvh_fit(&tree, m->rest);
    for (int32_t i = 0; !status && i < e->count; i++)
        fix(&tree, m->rest, vertices + 3 * (size_t)i, normals ? normals + 3 * (size_t)i : NULL,
            &e->fixtures[i]);
    drape_arena_free(&scratch);
    return status;
}

drape_status drape_embedding_create(drape_context *ctx, const drape_model *model, int32_t cloth,
                                    int32_t count, const float *vertices, const float *normals,
                                    drape_embedding **out)
{
    if (out)
        *out = NULL;
    if (!ctx)
        return DRAPE_E_ARGUMENT;
    if (!out)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "drape_embedding_create: out is NULL");
    drape_status status = check(ctx, model, cloth, count, vertices, normals);
    if (status)
        return status;
    drape_embedding *e = *out = drape_alloc(ctx, 1, sizeof *e);
    if (!e)
        return DRAPE_E_MEMORY;
    *e = (drape_embedding){
        .ctx = ctx, .arena = drape_arena_of(ctx), .count = count, .has_normals = normals != NULL};
    e->fixtures = drape_arena_take(&e->arena, (size_t)count, sizeof *e->fixtures);
    status = e->fixtures ? fix_all(e, model, cloth, vertices, normals) : DRAPE_E_MEMORY;
    if (status)
        drape_embedding_destroy(out);
    return status;
}

/* A normal keeps its products with what is tangent to the surface. */
static void carry_normal(const fixture *at, const frame *f, float normal[3])
{
    double n[3] = {0};
    /* The d = a u + b v + h n that has these products. */
    const double uu = vec3_dot(f->u, f->u), uv = vec3_dot(f->u, f->v), vv = vec3_dot(f->v, f->v),
                 area = uu * vv - uv * uv;
    const double a = area > 0 ? (vv * at->normal[0] - uv * at->normal[1]) / area : 0,
                 b = area > 0 ? (uu * at->normal[1] - uv * at->normal[0]) / area : 0;
    vec3_add_scaled(a, f->u, n);
    vec3_add_scaled(b, f->v, n);
    vec3_add_scaled(at->normal[2], f->n, n);
    const double length = vec3_norm(n);
    for (int k = 0; k < 3; k++)
        normal[k] = (float)(length > 0 ? n[k] / length : 0);
}

void drape_embedding_carry(const drape_embedding *e, const double *x, float *vertices, float *normals)
{
    for (int32_t i = 0; e && x && i < e->count; i++) {
        const fixture *at = &e->fixtures[i];
        double point[3];
        drape_embedded_point(&at->vertex, x, NULL, point);
        for (size_t k = 0; vertices && k < 3; k++)
            vertices[3 * (size_t)i + k] = (float)point[k];
        if (normals && e->has_normals) {
            const frame f = frame_of(at->vertex.node, x);
            carry_normal(at, &f, normals + 3 * (size_t)i);
        }
    }
}

void drape_embedding_destroy(drape_embedding **embedding)
{
    if (!embedding || !*embedding)
        return;
    drape_arena_free(&(*embedding)->arena);
    drape_free((*embedding)->ctx, *embedding);
    *embedding = NULL;
}
