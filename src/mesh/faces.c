/* faces.c: see faces.h. */
#include "mesh/faces.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/vec3.h"
#include "mesh/mesh.h"

#define MAX_EARS 256  /* corners of a polygon; cutting ears takes their square */
#define SHORTER  .998 /* ratio of squared lengths below which a diagonal is shorter than another */

drape_status drape_faces_allocate(drape_context *ctx, const drape_mesh_source *source, size_t nodes,
                                  size_t faces, size_t corners, size_t uvs, drape_mesh *mesh)
{
    const size_t triangles = corners > 2 * faces ? corners - 2 * faces : 0;
    if (uvs > 3 * (size_t)DRAPE_MAX_TRIANGLES)
        return drape_mesh_fail(ctx, source, 0, "%zu texture coordinates; at most %d are allowed", uvs,
                               3 * DRAPE_MAX_TRIANGLES);
    /* of faces that are still to be refused as too small there may be any number */
    if (triangles > DRAPE_MAX_TRIANGLES || corners > 3 * (size_t)DRAPE_MAX_TRIANGLES)
        return drape_mesh_fail(ctx, source, 0, "%zu triangles; at most %d are allowed", triangles,
                               DRAPE_MAX_TRIANGLES);
    DRAPE_TRY(drape_mesh_allocate(ctx, source, nodes, triangles, mesh));
    drape_arena *arena = &mesh->arena;
    drape_faces *f = &mesh->faces;
    f->first = drape_arena_take(arena, faces + 1, sizeof *f->first);
    f->node = drape_arena_take(arena, corners, sizeof *f->node);
    f->uv_of = drape_arena_take(arena, corners, sizeof *f->uv_of);
    f->uv = drape_arena_take(arena, uvs, 2 * sizeof *f->uv);
    f->material = drape_arena_take(arena, faces, sizeof *f->material);
    f->corner = drape_arena_take(arena, triangles, 3 * sizeof *f->corner);
    DRAPE_TRY(drape_arena_status(arena));
    f->count = (int32_t)faces;
    f->corner_count = (int32_t)corners;
    f->uv_count = (int32_t)uvs;
    memset(f->uv_of, -1, corners * sizeof *f->uv_of);
    memset(f->material, -1, faces * sizeof *f->material);
    return DRAPE_OK;
}

/* ---- Division into triangles ---- */

/* The polygon that is divided: its corners, as numbers among the corners of all faces. */
typedef struct polygon {
    const drape_mesh *mesh;
    int32_t *out;   /* the next triangle of faces.corner */
    int32_t corner; /* its first corner */
} polygon;

static const double *place(const polygon *p, int i)
{
    return p->mesh->x + 3 * (size_t)p->mesh->faces.node[p->corner + i];
}

static void put_triangle(polygon *p, int a, int b, int c)
{
    const int corners[3] = {a, b, c};
    for (int k = 0; k < 3; k++)
        *p->out++ = p->corner + corners[k];
}

static void normal_of(const polygon *p, int a, int b, int c, double normal[3])
{
    double ab[3], ac[3];
    vec3_sub(place(p, b), place(p, a), ab);
    vec3_sub(place(p, c), place(p, a), ac);
    vec3_cross(ab, ac, normal);
}

static double squared_distance(const polygon *p, int a, int b)
{
    double ab[3];
    vec3_sub(place(p, b), place(p, a), ab);
    return vec3_dot(ab, ab);
}

/* Whether the triangles beside the diagonal from corner a face the same side. */
static bool is_inside(const polygon *p, int a)
{
    double one[3], other[3];
    normal_of(p, a, a + 1, a + 2, one);
    normal_of(p, a, a + 2, (a + 3) % 4, other);
    return vec3_dot(one, other) > 0;
}

/* Whether the corners that remain, before i, i and after i, turn to the left about the normal. */
static bool turns_left(const polygon *p, const int *ring, int count, int i, const double *normal)
{
    double n[3];
    normal_of(p, ring[(i + count - 1) % count], ring[i], ring[(i + 1) % count], n);
    return vec3_dot(n, normal) > 0;
}

/* Whether corner i can be cut: it turns left, and no corner that does not is in its triangle. */
static bool is_ear(const polygon *p, const int *ring, int count, int i, const double *normal)
{
    const int a = ring[(i + count - 1) % count], b = ring[i], c = ring[(i + 1) % count];
    const int side[3][2] = {{a, b}, {b, c}, {c, a}};
    const int32_t *node = p->mesh->faces.node + p->corner;
    if (!turns_left(p, ring, count, i, normal))
        return false;
    for (int j = 0; j < count; j++) {
        const int q = ring[j];
        /* polygons with holes have a slit along which nodes repeat */
        const bool repeats = node[q] == node[a] || node[q] == node[b] || node[q] == node[c];
        bool within = !repeats && !turns_left(p, ring, count, j, normal);
        for (int k = 0; within && k < 3; k++) {
            double n[3];
            normal_of(p, side[k][0], side[k][1], q, n);
            within = vec3_dot(n, normal) >= 0;
        }
        if (within)
            return false;
    }
    return true;
}

/* The ear with the shortest diagonal, the first of those that are alike; a corner that is no ear only if
 * none is, as in a polygon that crosses itself. */
static int choose_ear(const polygon *p, const int *ring, const bool *ear, int count)
{
    int best = 0;
    double least = INFINITY;
    for (int wanted = 1; wanted >= 0 && least == INFINITY; wanted--)
        for (int i = 0; i < count; i++) {
            const double d = squared_distance(p, ring[(i + count - 1) % count], ring[(i + 1) % count]);
            if (ear[i] == (wanted == 1) && (least == INFINITY ? d < INFINITY : d < SHORTER * least)) {
                best = i;
                least = d;
            }
        }
    return best;
}

/* Cutting an ear can make new ears of its two neighbours only: another corner is no ear because its triangle
 * contains a corner; then it also contains one that is not convex, and no cut removes that one. */
static void cut_ears(polygon *p, int count)
{
    int ring[MAX_EARS];
    bool ear[MAX_EARS];
    double normal[3];
    /* Newell's normal, twice the area (Sutherland, Sproull and Schumacker 1974, doi:10.1145/356625.356626) */
    memset(normal, 0, 3 * sizeof *normal);
    for (int i = 1; i + 1 < count; i++) {
        double one[3];
        normal_of(p, 0, i, i + 1, one);
        vec3_add_scaled(1, one, normal);
    }
    for (int i = 0; i < count; i++)
        ring[i] = i;
    for (int i = 0; i < count; i++)
        ear[i] = is_ear(p, ring, count, i, normal);
    for (; count > 3; count--) {
        const int i = choose_ear(p, ring, ear, count);
        put_triangle(p, ring[(i + count - 1) % count], ring[i], ring[(i + 1) % count]);
        memmove(ring + i, ring + i + 1, (size_t)(count - i - 1) * sizeof *ring);
        memmove(ear + i, ear + i + 1, (size_t)(count - i - 1) * sizeof *ear);
        const int left = count - 1, before = (i + left - 1) % left, after = i % left;
        ear[before] = is_ear(p, ring, left, before, normal);
        ear[after] = is_ear(p, ring, left, after, normal);
    }
    put_triangle(p, ring[0], ring[1], ring[2]);
}

static drape_status divide(drape_mesh *mesh)
{
    drape_faces *f = &mesh->faces;
    polygon p = {.mesh = mesh, .out = f->corner};
    for (int32_t i = 0; i < f->count; i++) {
        const int32_t count = f->first[i + 1] - f->first[i];
        DRAPE_TRY(drape_check_cancel_after(mesh->arena.ctx,
                                           16 * (size_t)(count <= MAX_EARS ? count * count : count)));
        p.corner = f->first[i];
        if (count == 4) {
            const bool inside[2] = {is_inside(&p, 0), is_inside(&p, 1)};
            const bool shorter = squared_distance(&p, 1, 3) < SHORTER * squared_distance(&p, 0, 2);
            if (inside[0] == inside[1] ? shorter : inside[1]) {
                put_triangle(&p, 0, 1, 3);
                put_triangle(&p, 1, 2, 3);
            } else {
                put_triangle(&p, 0, 1, 2);
                put_triangle(&p, 0, 2, 3);
            }
        } else if (count > 4 && count <= MAX_EARS)
            cut_ears(&p, (int)count);
        else
            for (int32_t k = 2; k < count; k++)
                put_triangle(&p, 0, (int)k - 1, (int)k);
    }
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++)
        mesh->triangle[i] = f->node[f->corner[i]];
    return DRAPE_OK;
}

/* ---- Texture coordinates ---- */

/* Whether they are numbers, also as floats, which most formats have. */
static bool are_numbers(const double uv[2])
{
    return fabs(uv[0]) <= FLT_MAX && fabs(uv[1]) <= FLT_MAX;
}

typedef struct numbered_uv {
    double uv[2];
    int32_t number;
} numbered_uv;

static int compare_uvs(const void *left, const void *right)
{
    const numbered_uv *a = left, *b = right;
    for (int k = 0; k < 2; k++)
        if (a->uv[k] != b->uv[k])
            return a->uv[k] < b->uv[k] ? -1 : 1;
    return (a->number > b->number) - (a->number < b->number);
}

/* Numbers equal pairs alike, and all in the order in which corners use them. */
static drape_status merge_uvs(drape_context *ctx, drape_faces *f)
{
    drape_arena scratch = drape_arena_of(ctx);
    const size_t count = (size_t)f->uv_count;
    numbered_uv *sorted = drape_arena_take(&scratch, count, sizeof *sorted);
    int32_t *same = drape_arena_take(&scratch, count, sizeof *same);
    int32_t *number = drape_arena_take(&scratch, count, sizeof *number), used = 0;
    size_t usable = 0;
    if (drape_arena_status(&scratch)) {
        drape_arena_free(&scratch);
        return DRAPE_E_MEMORY;
    }
    for (size_t i = 0; i < count; i++)
        if (are_numbers(f->uv + 2 * i))
            sorted[usable++] = (numbered_uv){{f->uv[2 * i], f->uv[2 * i + 1]}, (int32_t)i};
    qsort(sorted, usable, sizeof *sorted, compare_uvs);
    for (size_t i = 0; i < usable; i++) {
        const bool repeats =
            i > 0 && sorted[i].uv[0] == sorted[i - 1].uv[0] && sorted[i].uv[1] == sorted[i - 1].uv[1];
        same[sorted[i].number] = repeats ? same[sorted[i - 1].number] : sorted[i].number;
    }
    memset(number, -1, count * sizeof *number);
    for (int32_t c = 0; c < f->corner_count; c++)
        if (f->uv_of[c] >= 0) {
            int32_t *own = &number[same[f->uv_of[c]]];
            *own = *own < 0 ? used++ : *own;
            f->uv_of[c] = *own;
        }
    for (size_t i = 0; i < usable; i++)
        sorted[i].number = number[sorted[i].number];
    for (size_t i = 0; i < usable; i++)
        if (sorted[i].number >= 0)
            memcpy(f->uv + 2 * (size_t)sorted[i].number, sorted[i].uv, sizeof sorted[i].uv);
    f->uv_count = used;
    drape_arena_free(&scratch);
    return DRAPE_OK;
}

/* ---- All ---- */

drape_status drape_faces_complete(drape_context *ctx, drape_mesh *mesh)
{
    drape_faces *f = &mesh->faces;
    const drape_status status = divide(mesh);
    if (status)
        return status;
    /* A face has texture coordinates at all corners or at none. */
    bool has_uvs = false;
    for (int32_t i = 0; i < f->count; i++) {
        bool all = true;
        for (int32_t c = f->first[i]; c < f->first[i + 1]; c++) {
            const double *uv = f->uv_of[c] < 0 ? NULL : f->uv + 2 * (size_t)f->uv_of[c];
            all = all && uv && are_numbers(uv);
        }
        for (int32_t c = f->first[i]; c < f->first[i + 1] && !all; c++)
            f->uv_of[c] = -1;
        has_uvs = has_uvs || all;
    }
    if (!has_uvs && f->material_count == 0 && f->count == mesh->triangle_count) {
        void *const arrays[] = {f->first,    f->node, f->uv_of,         f->uv,
                                f->material, f->name, f->material_file, f->corner};
        for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
            drape_arena_release(&mesh->arena, arrays[i]);
        *f = (drape_faces){0};
        return DRAPE_OK;
    }
    if (has_uvs)
        return merge_uvs(ctx, f);
    f->uv_count = 0;
    return DRAPE_OK;
}

bool drape_faces_same(const drape_mesh *a, const drape_mesh *b)
{
    const drape_faces *f = &a->faces, *g = &b->faces;
    if (a->node_count != b->node_count || a->triangle_count != b->triangle_count)
        return false;
    if (memcmp(a->triangle, b->triangle, 3 * (size_t)a->triangle_count * sizeof *a->triangle) == 0)
        return true;
    return f->count > 0 && f->count == g->count && f->corner_count == g->corner_count &&
           memcmp(f->first, g->first, (size_t)f->count * sizeof *f->first) == 0 &&
           memcmp(f->node, g->node, (size_t)f->corner_count * sizeof *f->node) == 0;
}

/* ---- Vertices ---- */

drape_status drape_faces_vertices(drape_arena *arena, const drape_mesh *mesh, drape_vertices *vertices)
{
    const drape_faces *f = &mesh->faces;
    const int32_t corners = 3 * mesh->triangle_count;
    const size_t capacity = (size_t)(f->uv_count > 0 ? corners : mesh->node_count);
    *vertices = (drape_vertices){.node = drape_arena_take(arena, capacity, sizeof *vertices->node),
                                 .uv = drape_arena_take(arena, capacity, sizeof *vertices->uv),
                                 .at = drape_arena_take(arena, (size_t)corners, sizeof *vertices->at)};
    DRAPE_TRY(drape_arena_status(arena));
    if (f->uv_count == 0) {
        vertices->count = mesh->node_count;
        for (int32_t i = 0; i < mesh->node_count; i++) {
            vertices->node[i] = i;
            vertices->uv[i] = -1;
        }
        memcpy(vertices->at, mesh->triangle, (size_t)corners * sizeof *vertices->at);
        return DRAPE_OK;
    }
    drape_arena scratch = drape_arena_of(arena->ctx);
    int32_t *key = drape_arena_take(&scratch, (size_t)corners, 2 * sizeof *key);
    for (int32_t c = 0; key && c < corners; c++) {
        key[2 * (size_t)c] = mesh->triangle[c];
        key[2 * (size_t)c + 1] = f->uv_of[f->corner[c]] + 1;
    }
    const int32_t limit = mesh->node_count > f->uv_count ? mesh->node_count : f->uv_count + 1;
    const int32_t *order = key ? drape_order_by_keys(&scratch, key, 2, corners, limit) : NULL;
    for (int32_t i = 0; order && i < corners; i++) {
        const int32_t *own = key + 2 * (size_t)order[i], *last = i ? key + 2 * (size_t)order[i - 1] : NULL;
        if (!last || own[0] != last[0] || own[1] != last[1]) {
            vertices->node[vertices->count] = own[0];
            vertices->uv[vertices->count++] = own[1] - 1;
        }
        vertices->at[order[i]] = vertices->count - 1;
    }
    drape_arena_free(&scratch);
    return order ? DRAPE_OK : DRAPE_E_MEMORY;
}
