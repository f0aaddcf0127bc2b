/* skin.c: see skin.h. A point on an edge depends on the ends of that edge alone, so the triangles beside it
 * share it and no gap opens. */
#include "render/skin.h"

#include "base/vec3.h"
#include "colliders/colliders.h"
#include "render/camera.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define DRAWN_TRIANGLES 36000 /* about as many are drawn of a mesh that has fewer */
#define MAX_LEVEL       8
/* sine of the angle between edge and tangent plane at which a curve is half as round */
#define BULGE 0.35f
#define CLEARANCE                                                                                            \
    0.05f /* distance from colliders that curved triangles keep if flat ones do, in mean edges */
#define FLATTER    0.6f /* factor on the roundness of what comes nearer, and how often it is tried */
#define TRIES      6
#define HEM        0.0019f /* radius of a hem over the longest cloth's diagonal */
#define HEM_GRID   0.14f   /* the same over the mean edge, at most */
#define HEM_POINTS 4       /* around half of a hem */
#define PI         3.14159265f

/* ---- Numbering of edges and points ---- */

static size_t inner_points(int level)
{
    return (size_t)(level - 1) * (size_t)(level - 2) / 2;
}

/* Point (i, j) of triangle t: i steps from corner 0 to 1, j from corner 0 to 2. */
static uint32_t point_number(const drape_skin *s, int32_t t, int i, int j)
{
    const int32_t *corner = s->triangle + 3 * (size_t)t, *edge = s->triangle_edge + 3 * (size_t)t;
    int n = s->level, k = n - i - j, side = -1, along = 0;
    if (k == n || i == n || j == n)
        return (uint32_t)corner[k == n ? 0 : i == n ? 1 : 2];
    if (j == 0)
        side = 0, along = i;
    else if (k == 0)
        side = 1, along = j;
    else if (i == 0)
        side = 2, along = k;
    if (side >= 0) {
        int32_t e = edge[side] >= 0 ? edge[side] : -1 - edge[side];
        along = edge[side] >= 0 ? along : n - along;
        return (uint32_t)((size_t)s->node_count + (size_t)e * (size_t)(n - 1) + (size_t)(along - 1));
    }
    size_t before = 0; /* inner points of the rows below j */
    for (int row = 1; row < j; row++)
        before += (size_t)(n - 1 - row);
    return (uint32_t)((size_t)s->node_count + (size_t)s->edge_count * (size_t)(n - 1) +
                      (size_t)t * inner_points(n) + before + (size_t)(i - 1));
}

/* ---- Texture coordinates ---- */

/* Texture coordinates of a grid: rest distances along its first row, and across it. */
static void unroll_grid(const drape_mesh *mesh, float *uv)
{
    const double *origin = mesh->x, *right = mesh->x + 3 * (size_t)(mesh->columns - 1),
                 *last = mesh->x + 3 * (size_t)(mesh->rows - 1) * (size_t)mesh->columns;
    double u[3], v[3], low = INFINITY, high[2] = {0, 0};
    vec3_sub(right, origin, u);
    vec3_sub(last, origin, v);
    vec3_add_scaled(-vec3_dot(u, v) / vec3_dot(u, u), u, v);
    for (int32_t i = 0; i < mesh->node_count; i++) {
        double x[3];
        vec3_sub(mesh->x + 3 * (size_t)i, origin, x);
        uv[2 * i] = (float)(vec3_dot(x, u) / vec3_norm(u));
        uv[2 * i + 1] = (float)(vec3_dot(x, v) / vec3_norm(v));
        low = fmin(low, (double)uv[2 * i]);
        high[0] = fmax(high[0], (double)uv[2 * i]);
        high[1] = fmax(high[1], (double)uv[2 * i + 1]);
    }
    double longer = fmax(high[0] - low, high[1]);
    for (int32_t i = 0; i < mesh->node_count; i++) {
        uv[2 * i] = (float)(((double)uv[2 * i] - low) / longer);
        uv[2 * i + 1] = (float)((double)uv[2 * i + 1] / longer);
    }
}

/* Texture coordinates of other meshes: a projection along the shortest side of their bounding box. */
static void flatten(const drape_mesh *mesh, float *uv)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    int shortest = 0;
    for (size_t i = 0; i < 3 * (size_t)mesh->node_count; i++) {
        low[i % 3] = fmin(low[i % 3], mesh->x[i]);
        high[i % 3] = fmax(high[i % 3], mesh->x[i]);
    }
    for (int k = 1; k < 3; k++)
        if (high[k] - low[k] < high[shortest] - low[shortest])
            shortest = k;
    int u = (shortest + 1) % 3, v = (shortest + 2) % 3;
    double longer = fmax(high[u] - low[u], high[v] - low[v]);
    for (size_t i = 0; i < (size_t)mesh->node_count; i++) {
        uv[2 * i] = (float)((mesh->x[3 * i + (size_t)u] - low[u]) / longer);
        uv[2 * i + 1] = (float)((mesh->x[3 * i + (size_t)v] - low[v]) / longer);
    }
}

/* Reverses u (k = 0) or v (k = 1). */
static void reverse(const drape_mesh *mesh, float *uv, int k)
{
    float highest = 0;
    for (int32_t i = 0; i < mesh->node_count; i++)
        highest = fmaxf(highest, uv[2 * i + k]);
    for (int32_t i = 0; i < mesh->node_count; i++)
        uv[2 * i + k] = highest - uv[2 * i + k];
}

static void unroll(const drape_mesh *mesh, float *uv)
{
    if (mesh->rows > 0)
        unroll_grid(mesh, uv);
    else
        flatten(mesh, uv);
    /* Triangles run counterclockwise seen from the front. Unless they do so in the texture, it appears
     * mirrored. */
    double area = 0;
    for (size_t t = 0; t < (size_t)mesh->triangle_count; t++) {
        const float *a = uv + 2 * mesh->triangle[3 * t], *b = uv + 2 * mesh->triangle[3 * t + 1],
                    *c = uv + 2 * mesh->triangle[3 * t + 2];
        area += (double)((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
    }
    if (area < 0)
        reverse(mesh, uv, 1);
    /* If v falls with height at rest, by linear regression, the texture would stand on its head. */
    double n = mesh->node_count, y = 0, v = 0, product = 0, square = 0;
    for (int32_t i = 0; i < mesh->node_count; i++) {
        y += mesh->x[3 * i + 1] / n;
        v += (double)uv[2 * i + 1] / n;
    }
    for (int32_t i = 0; i < mesh->node_count; i++) {
        double above = mesh->x[3 * i + 1] - y, along = (double)uv[2 * i + 1] - v;
        product += above * along;
        square += above * above;
    }
    if (!(product < 0 && product * product > 1e-6 * square))
        return;
    reverse(mesh, uv, 0);
    reverse(mesh, uv, 1);
}

/* ---- The border ---- */

/* Lists the edges that belong to one triangle, and numbers the triangles of their hem. */
static drape_status create_hem(drape_arena *arena, drape_skin *s)
{
    const size_t ring = 2 * HEM_POINTS, sides = 3 * (size_t)s->triangle_count;
    drape_arena scratch = drape_arena_of(arena->ctx);
    int32_t *uses = drape_arena_take(&scratch, (size_t)s->edge_count, sizeof *uses);
    for (size_t i = 0; uses && i < sides; i++)
        ++uses[s->triangle_edge[i] >= 0 ? s->triangle_edge[i] : -1 - s->triangle_edge[i]];
    for (int32_t e = 0; uses && e < s->edge_count; e++)
        s->border_count += uses[e] == 1;
    const size_t pieces = s->border_count * (size_t)s->level;
    s->hem_count = s->border_count * (size_t)(s->level + 1) * ring;
    s->border = drape_arena_take(arena, 2 * s->border_count, sizeof *s->border);
    s->hem = drape_arena_take(arena, s->hem_count, sizeof *s->hem);
    s->hem_index = drape_arena_take(arena, pieces * 2 * (HEM_POINTS - 1) * 6, sizeof *s->hem_index);
    if (!uses || drape_arena_status(arena)) {
        drape_arena_free(&scratch);
        return DRAPE_E_MEMORY;
    }
    int32_t *border = s->border;
    uint32_t *to = s->hem_index;
    for (size_t i = 0; i < sides; i++)
        if (uses[s->triangle_edge[i] >= 0 ? s->triangle_edge[i] : -1 - s->triangle_edge[i]] == 1) {
            *border++ = (int32_t)(i / 3);
            *border++ = (int32_t)(i % 3);
        }
    drape_arena_free(&scratch);
    for (size_t e = 0; e < s->border_count; e++)
        for (size_t k = 0; k < (size_t)s->level * ring; k++) {
            uint32_t at = (uint32_t)(e * (size_t)(s->level + 1) * ring + k), next = at + (uint32_t)ring;
            if (k % HEM_POINTS == HEM_POINTS - 1)
                continue;
            const uint32_t corners[6] = {at, next, next + 1, at, next + 1, at + 1};
            memcpy(to, corners, sizeof corners);
            to += 6;
        }
    s->hem_index_count = (size_t)(to - s->hem_index);
    return DRAPE_OK;
}

static int compare_edges(const void *left, const void *right)
{
    const int32_t *a = left, *b = right;
    const int k = a[0] == b[0];
    return (a[k] > b[k]) - (a[k] < b[k]);
}

/* The edges of a surface that is not the simulated one, of which the model has them. */
static drape_status list_edges(drape_arena *arena, drape_skin *s)
{
    const size_t sides = 3 * (size_t)s->triangle_count;
    int32_t *edge = drape_arena_take(arena, sides, 2 * sizeof *edge);
    if (!edge)
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < sides; i++) {
        const int32_t a = s->triangle[i], b = s->triangle[i - i % 3 + (i + 1) % 3];
        edge[2 * i] = a < b ? a : b;
        edge[2 * i + 1] = a < b ? b : a;
    }
    qsort(edge, sides, 2 * sizeof *edge, compare_edges);
    for (size_t i = 0; i < sides; i++)
        if (i == 0 || compare_edges(edge + 2 * i, edge + 2 * i - 2) != 0) {
            memmove(edge + 2 * (size_t)s->edge_count, edge + 2 * i, 2 * sizeof *edge);
            s->edge_count++;
        }
    s->edges = edge;
    return DRAPE_OK;
}

drape_status drape_skin_create(drape_arena *arena, const drape_model *model, drape_skin *skin)
{
    const drape_render_surface *surface = &model->surface;
    const size_t nodes = (size_t)surface->node_count, triangles = (size_t)surface->triangle_count;
    const double pieces = sqrt(DRAWN_TRIANGLES / fmax(1, surface->triangle_count));
    const int level = (int)lround(fmin(fmax(pieces, 1), MAX_LEVEL));
    *skin = (drape_skin){.model = model,
                         .level = level,
                         .node_count = surface->node_count,
                         .triangle_count = surface->triangle_count,
                         .triangle = surface->triangle,
                         .edge_count = surface->bound ? 0 : model->edge_count,
                         .edges = model->edge};
    if (surface->bound && list_edges(arena, skin))
        return DRAPE_E_MEMORY;
    skin->vertex_count =
        nodes + (size_t)skin->edge_count * (size_t)(level - 1) + triangles * inner_points(level);
    skin->segment_count = (size_t)skin->edge_count * (size_t)level;
    skin->triangle_edge = drape_arena_take(arena, 3 * triangles, sizeof *skin->triangle_edge);
    skin->uv = drape_arena_take(arena, 2 * nodes, sizeof *skin->uv);
    skin->normal = drape_arena_take(arena, 3 * nodes, sizeof *skin->normal);
    skin->tangent = drape_arena_take(arena, 3 * nodes, sizeof *skin->tangent);
    skin->cloth = drape_arena_take(arena, nodes, sizeof *skin->cloth);
    skin->vertex = drape_arena_take(arena, skin->vertex_count, sizeof *skin->vertex);
    skin->index = drape_arena_take(arena, 3 * triangles * (size_t)(level * level), sizeof *skin->index);
    skin->segment = drape_arena_take(arena, 6 * skin->segment_count, sizeof *skin->segment);
    skin->gap = drape_arena_take(arena, nodes, sizeof *skin->gap);
    skin->roundness = drape_arena_take(arena, (size_t)skin->edge_count, sizeof *skin->roundness);
    skin->outward = drape_arena_take(arena, 3 * nodes, sizeof *skin->outward);
    double sum = 0;
    for (int32_t e = 0; e < skin->edge_count; e++) {
        double d[3];
        vec3_sub(surface->rest + 3 * (size_t)skin->edges[2 * (size_t)e + 1],
                 surface->rest + 3 * (size_t)skin->edges[2 * (size_t)e], d);
        sum += surface->bound ? vec3_norm(d) : model->edge_length[e];
    }
    skin->edge = (float)(sum / skin->edge_count);
    skin->hem_radius = fminf(HEM * (float)model->length, HEM_GRID * skin->edge);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < 3 * triangles; i++) {
        int32_t a = skin->triangle[i], b = skin->triangle[i - i % 3 + (i + 1) % 3];
        int32_t e = drape_edge_between(skin->edges, skin->edge_count, a, b);
        skin->triangle_edge[i] = a < b ? e : -1 - e;
    }
    /* The corners of the level^2 triangles that each triangle of the mesh is drawn as. */
    uint32_t *to = skin->index;
    for (int32_t t = 0; t < skin->triangle_count; t++)
        for (int j = 0; j < skin->level; j++)
            for (int i = 0; i + j < skin->level; i++) {
                *to++ = point_number(skin, t, i, j);
                *to++ = point_number(skin, t, i + 1, j);
                *to++ = point_number(skin, t, i, j + 1);
                if (i + j + 1 == skin->level)
                    continue;
                *to++ = point_number(skin, t, i + 1, j);
                *to++ = point_number(skin, t, i + 1, j + 1);
                *to++ = point_number(skin, t, i, j + 1);
            }
    skin->index_count = (size_t)(to - skin->index);
    for (int32_t c = 0, first = 0; c < surface->cloth_count; c++) {
        const drape_mesh *mesh = surface->cloths[c].mesh;
        unroll(mesh, skin->uv + 2 * (size_t)first);
        for (int32_t i = 0; i < mesh->node_count; i++)
            skin->cloth[first++] = (float)c;
    }
    return create_hem(arena, skin);
}

/* ---- Normals and tangents of the nodes ---- */

static void subtract(const float *a, const float *b, float *out)
{
    for (int k = 0; k < 3; k++)
        out[k] = a[k] - b[k];
}

static float distance(const float *a, const float *b)
{
    float difference[3];
    subtract(a, b, difference);
    return sqrtf(drape_dot(difference, difference));
}

/* Makes a unit tangent orthogonal to the normal. */
static void orthogonalize(const float *normal, float *tangent)
{
    float along = drape_dot(normal, tangent);
    for (int k = 0; k < 3; k++)
        tangent[k] -= along * normal[k];
    drape_normalize(tangent);
}

/* A triangle is added to the normals and tangents of its corners weighted by area: the cross product of two
 * sides has twice the area as its length. The tangent is the direction in which u grows, e1 dv2 - e2 dv1 over
 * the determinant of the texture coordinates, of which only the sign matters. */
static void update_nodes(drape_skin *s, const float *x, const float *values)
{
    memset(s->normal, 0, 3 * (size_t)s->node_count * sizeof *s->normal);
    memset(s->tangent, 0, 3 * (size_t)s->node_count * sizeof *s->tangent);
    for (size_t t = 0; t < (size_t)s->triangle_count; t++) {
        const int32_t *corner = s->triangle + 3 * t;
        const size_t a = (size_t)corner[0], b = (size_t)corner[1], c = (size_t)corner[2];
        const float *uv = s->uv + 2 * a, *uv1 = s->uv + 2 * b, *uv2 = s->uv + 2 * c;
        float e1[3], e2[3], normal[3], along[3];
        subtract(x + 3 * b, x + 3 * a, e1);
        subtract(x + 3 * c, x + 3 * a, e2);
        drape_cross(e1, e2, normal);
        float du1 = uv1[0] - uv[0], dv1 = uv1[1] - uv[1], du2 = uv2[0] - uv[0], dv2 = uv2[1] - uv[1];
        float sign = du1 * dv2 - du2 * dv1 < 0 ? -1.0f : 1.0f, area = sqrtf(drape_dot(normal, normal));
        for (int k = 0; k < 3; k++)
            along[k] = sign * (e1[k] * dv2 - e2[k] * dv1);
        drape_normalize(along);
        for (size_t i = 0; i < 9; i++) {
            s->normal[3 * (size_t)corner[i / 3] + i % 3] += normal[i % 3];
            s->tangent[3 * (size_t)corner[i / 3] + i % 3] += area * along[i % 3];
        }
    }
    for (size_t i = 0; i < (size_t)s->node_count; i++) {
        drape_skin_vertex *v = &s->vertex[i];
        drape_normalize(s->normal + 3 * i);
        orthogonalize(s->normal + 3 * i, s->tangent + 3 * i);
        memcpy(v->p, x + 3 * i, sizeof v->p);
        memcpy(v->n, s->normal + 3 * i, sizeof v->n);
        memcpy(v->t, s->tangent + 3 * i, sizeof v->t);
        memcpy(v->uv, s->uv + 2 * i, sizeof v->uv);
        v->value = values ? values[i] : 0;
        v->cloth = s->cloth[i];
    }
}

/* ---- Colliders ---- */

/* Distance of a point from the nearest collider at time t [m]; infinite without any. */
static float clearance(const drape_skin *s, double t, const float *p)
{
    const drape_model *m = s->model;
    double nearest = INFINITY;
    for (int32_t c = 0; c < m->collider_count; c++) {
        const drape_collider_pose pose = drape_collider_pose_at(&m->colliders[c], t);
        const double x[3] = {(double)p[0], (double)p[1], (double)p[2]};
        nearest = fmin(nearest, drape_collider_distance(s->collider ? s->collider[c] : &m->colliders[c],
                                                        &pose, x, NULL, NULL));
    }
    return (float)nearest;
}

/* Moves curved points towards the flat ones, all by the same share, until none of them cuts a collider.
 * Returns what remains of the difference, at most `roundness`. */
static float flatten_points(const drape_skin *s, double t, drape_skin_vertex *point, const float (*flat)[3],
                            size_t count, float roundness)
{
    float remains = roundness, curved[3];
    int tries = 0;
    for (size_t i = 0; i < count; i++)
        for (bool cut = true; cut && remains > 0;) {
            for (int k = 0; k < 3; k++)
                curved[k] = flat[i][k] + remains * (point[i].p[k] - flat[i][k]);
            float enough = CLEARANCE * s->edge, d = clearance(s, t, curved);
            cut = d < enough && d < clearance(s, t, flat[i]) - 1e-3f * enough;
            if (cut)
                remains = ++tries < TRIES ? FLATTER * remains : 0;
        }
    for (size_t i = 0; remains < 1 && i < count; i++)
        for (int k = 0; k < 3; k++)
            point[i].p[k] = flat[i][k] + remains * (point[i].p[k] - flat[i][k]);
    return remains;
}

/* ---- Points on edges and in triangles ---- */

/* The inner control point, relative to a, of a curve from a to b that is orthogonal to the normal at a: a
 * third of b - a projected into the tangent plane. Where the mesh is folded more sharply than it resolves,
 * the curve would bulge into the next layer, so there it stays straight. */
static void control_point(const drape_skin_vertex *a, const drape_skin_vertex *b, float *out)
{
    subtract(b->p, a->p, out);
    float w = drape_dot(out, a->n), length = drape_dot(out, out),
          sharp = w * w / (BULGE * BULGE * length + 1e-30f);
    w /= 1 + sharp * sharp;
    for (int k = 0; k < 3; k++)
        out[k] = (out[k] - w * a->n[k]) / 3;
}

/* The normal in the middle of a curve: the mean of the normals at its ends, reflected at the plane between
 * them. */
static void middle_normal(const drape_skin_vertex *a, const drape_skin_vertex *b, float *out)
{
    float chord[3], sum[3];
    subtract(b->p, a->p, chord);
    for (int k = 0; k < 3; k++)
        sum[k] = a->n[k] + b->n[k];
    float length = drape_dot(chord, chord), w = length > 0 ? 2 * drape_dot(chord, sum) / length : 0;
    for (int k = 0; k < 3; k++)
        out[k] = sum[k] - w * chord[k];
    drape_normalize(out);
}

/* Interpolates tangent, texture coordinates and value linearly, with the weights w of the corners. */
static void blend(const drape_skin_vertex *const *corner, const float *w, int count, drape_skin_vertex *out)
{
    memset(out, 0, sizeof *out);
    for (int c = 0; c < count; c++) {
        for (int k = 0; k < 3; k++)
            out->t[k] += w[c] * corner[c]->t[k];
        for (int k = 0; k < 2; k++)
            out->uv[k] += w[c] * corner[c]->uv[k];
        out->value += w[c] * corner[c]->value;
    }
    out->cloth = corner[0]->cloth;
}

static void normalize(drape_skin_vertex *v)
{
    drape_normalize(v->n);
    orthogonalize(v->n, v->t);
}

static void update_edge(drape_skin *s, double t, int32_t e)
{
    float flat[MAX_LEVEL][3];
    const drape_skin_vertex *const ends[2] = {&s->vertex[s->edges[2 * (size_t)e]],
                                              &s->vertex[s->edges[2 * (size_t)e + 1]]};
    drape_skin_vertex *to = &s->vertex[(size_t)s->node_count + (size_t)e * (size_t)(s->level - 1)];
    float from_a[3], from_b[3], normal[3];
    control_point(ends[0], ends[1], from_a);
    control_point(ends[1], ends[0], from_b);
    middle_normal(ends[0], ends[1], normal);
    for (int i = 1; i < s->level; i++, to++) {
        float u = (float)i / (float)s->level, w = 1 - u;
        blend(ends, (float[]){w, u}, 2, to);
        for (int k = 0; k < 3; k++) {
            to->p[k] = w * w * w * ends[0]->p[k] + 3 * w * w * u * (ends[0]->p[k] + from_a[k]) +
                       3 * w * u * u * (ends[1]->p[k] + from_b[k]) + u * u * u * ends[1]->p[k];
            to->n[k] = w * w * ends[0]->n[k] + u * u * ends[1]->n[k] + w * u * normal[k];
            flat[i - 1][k] = w * ends[0]->p[k] + u * ends[1]->p[k];
        }
        normalize(to);
    }
    /* between the ends a curve bulges by less than its length */
    s->roundness[e] = 1;
    if (fminf(s->gap[s->edges[2 * (size_t)e]], s->gap[s->edges[2 * (size_t)e + 1]]) <
        distance(ends[0]->p, ends[1]->p))
        s->roundness[e] =
            flatten_points(s, t, to - (s->level - 1), (const float(*)[3])flat, (size_t)(s->level - 1), 1);
}

/* The control net of a triangle: two points on each side, one inside, and the normals at the middles of its
 * sides. */
typedef struct patch {
    const drape_skin_vertex *corner[3];
    float side[3][2][3]; /* from corner k towards k + 1: near k, near k + 1 */
    float inside[3], normal[3][3];
} patch;

/* The point with the weights w of the corners. */
static void update_inner(const patch *p, const float *w, drape_skin_vertex *to)
{
    blend(p->corner, w, 3, to);
    for (int i = 0; i < 3; i++) {
        float x = 6 * w[0] * w[1] * w[2] * p->inside[i], n = 0;
        for (int k = 0; k < 3; k++) {
            float a = w[k], b = w[(k + 1) % 3];
            x += a * a * a * p->corner[k]->p[i] + 3 * a * a * b * p->side[k][0][i] +
                 3 * a * b * b * p->side[k][1][i];
            n += a * a * p->corner[k]->n[i] + a * b * p->normal[k][i];
        }
        to->p[i] = x;
        to->n[i] = n;
    }
    normalize(to);
}

/* The inner points, as round as the straightest of the sides. They are numbered one after the other. */
static void update_triangle(drape_skin *s, double t, int32_t triangle)
{
    patch p;
    float n = (float)s->level, flat[MAX_LEVEL * MAX_LEVEL][3], nearest = INFINITY, longest = 0, roundness = 1;
    size_t count = 0;
    drape_skin_vertex *first = &s->vertex[point_number(s, triangle, 1, 1)];
    for (int k = 0; k < 3; k++)
        p.corner[k] = &s->vertex[s->triangle[3 * (size_t)triangle + (size_t)k]];
    for (int k = 0; k < 3; k++) {
        const drape_skin_vertex *a = p.corner[k], *b = p.corner[(k + 1) % 3];
        control_point(a, b, p.side[k][0]);
        control_point(b, a, p.side[k][1]);
        for (int i = 0; i < 3; i++) {
            p.side[k][0][i] += a->p[i];
            p.side[k][1][i] += b->p[i];
        }
        middle_normal(a, b, p.normal[k]);
    }
    for (int i = 0; i < 3; i++) {
        float sum = 0, corners = 0;
        for (int k = 0; k < 3; k++) {
            sum += p.side[k][0][i] + p.side[k][1][i];
            corners += p.corner[k]->p[i];
        }
        p.inside[i] = sum / 4 - corners / 6; /* E + (E - V) / 2 */
    }
    for (int j = 1; j < s->level; j++)
        for (int i = 1; i + j < s->level; i++, count++) {
            const float w[3] = {(n - (float)i - (float)j) / n, (float)i / n, (float)j / n};
            update_inner(&p, w, first + count);
            for (int k = 0; k < 3; k++)
                flat[count][k] =
                    w[0] * p.corner[0]->p[k] + w[1] * p.corner[1]->p[k] + w[2] * p.corner[2]->p[k];
        }
    for (int k = 0; k < 3; k++) {
        int32_t e = s->triangle_edge[3 * (size_t)triangle + (size_t)k];
        nearest = fminf(nearest, s->gap[s->triangle[3 * (size_t)triangle + (size_t)k]]);
        longest = fmaxf(longest, distance(p.corner[k]->p, p.corner[(k + 1) % 3]->p));
        roundness = fminf(roundness, s->roundness[e >= 0 ? e : -1 - e]);
    }
    if (nearest < longest)
        flatten_points(s, t, first, (const float(*)[3])flat, count, roundness);
}

void drape_skin_update(drape_skin *skin, double t, const float *positions, const float *values)
{
    update_nodes(skin, positions, values);
    for (int32_t i = 0; i < skin->node_count; i++)
        skin->gap[i] = clearance(skin, t, skin->vertex[i].p);
    for (int32_t e = 0; skin->level > 1 && e < skin->edge_count; e++)
        update_edge(skin, t, e);
    for (int32_t k = 0; skin->level > 2 && k < skin->triangle_count; k++)
        update_triangle(skin, t, k);
}

/* ---- The hem ---- */

/* A ring of the hem around a point of the border: its upper half as part of the front, and its lower one as
 * part of the back. */
static drape_skin_vertex *put_ring(const drape_skin *s, const drape_skin_vertex *point, const float *outward,
                                   drape_skin_vertex *to)
{
    const float r = s->hem_radius;
    float out[3] = {outward[0], outward[1], outward[2]};
    orthogonalize(point->n, out);
    for (int half = 1; half >= -1; half -= 2)
        for (int i = 0; i < HEM_POINTS; i++, to++) {
            float angle = PI * (float)i / (HEM_POINTS - 1), c = cosf(angle), h = (float)half * sinf(angle);
            *to = *point;
            for (int k = 0; k < 3; k++) {
                float direction = c * out[k] + h * point->n[k];
                to->p[k] = point->p[k] + r * (direction - out[k]);
                to->n[k] = (float)half * direction;
            }
        }
    return to;
}

void drape_skin_update_hem(drape_skin *skin)
{
    const int n = skin->level;
    drape_skin_vertex *to = skin->hem;
    memset(skin->outward, 0, 3 * (size_t)skin->node_count * sizeof *skin->outward);
    /* The direction out of each side, T x n with T along it, is added to that of its ends. */
    for (size_t i = 0; i < skin->border_count; i++) {
        const int32_t *corner = skin->triangle + 3 * (size_t)skin->border[2 * i],
                      side = skin->border[2 * i + 1];
        const size_t from = (size_t)corner[side], to_node = (size_t)corner[(side + 1) % 3];
        const drape_skin_vertex *a = &skin->vertex[from], *b = &skin->vertex[to_node];
        float along[3], normal[3], out[3];
        subtract(b->p, a->p, along);
        for (int k = 0; k < 3; k++)
            normal[k] = a->n[k] + b->n[k];
        drape_cross(along, normal, out);
        drape_normalize(out);
        for (size_t k = 0; k < 3; k++) {
            skin->outward[3 * from + k] += out[k];
            skin->outward[3 * to_node + k] += out[k];
        }
    }
    for (size_t i = 0; i < skin->border_count; i++) {
        const int32_t t = skin->border[2 * i], side = skin->border[2 * i + 1];
        const int32_t *corner = skin->triangle + 3 * (size_t)t;
        const float *a = skin->outward + 3 * (size_t)corner[side],
                    *b = skin->outward + 3 * (size_t)corner[(side + 1) % 3];
        for (int k = 0; k <= n; k++) {
            float u = (float)k / (float)n, out[3];
            for (int c = 0; c < 3; c++)
                out[c] = (1 - u) * a[c] + u * b[c];
            uint32_t at = side == 0   ? point_number(skin, t, k, 0)
                          : side == 1 ? point_number(skin, t, n - k, k)
                                      : point_number(skin, t, 0, n - k);
            to = put_ring(skin, &skin->vertex[at], out, to);
        }
    }
}

void drape_skin_update_segments(drape_skin *skin)
{
    float *to = skin->segment;
    for (int32_t e = 0; e < skin->edge_count; e++) {
        const drape_skin_vertex *last = &skin->vertex[skin->edges[2 * (size_t)e]];
        for (int i = 1; i <= skin->level; i++, to += 6) {
            const drape_skin_vertex *next =
                i == skin->level ? &skin->vertex[skin->edges[2 * (size_t)e + 1]]
                                 : &skin->vertex[(size_t)skin->node_count +
                                                 (size_t)e * (size_t)(skin->level - 1) + (size_t)(i - 1)];
            memcpy(to, last->p, sizeof last->p);
            memcpy(to + 3, next->p, sizeof next->p);
            last = next;
        }
    }
}
