/*
 * mesh_distance.c: see mesh_distance.h.
 *
 * The nearest point is searched depth first in a tree of boxes, the nearer child first (Ericson 2005,
 * section 6.3; points of triangles: 5.1.5).
 *
 * x is outside if n . (x - c) > 0 for the angle-weighted pseudo-normal n of the face, edge or point that
 * contains the nearest point c (Baerentzen and Aanaes 2005, "Signed distance computation using the angle
 * weighted pseudonormal", theorem 1). This holds for every closed mesh without self-intersections. Where a
 * mesh intersects itself, the point is inside if the mesh winds around it at least once: the triangles that
 * a ray leaves the body through are more than those that it enters by (Jacobson et al. 2013, "Robust
 * inside-outside segmentation using generalized winding numbers", section 3).
 */
#include "geometry/mesh_distance.h"
#include "base/elementary.h"

#include "geometry/bvh.h"
#include "geometry/round.h"
#include "mesh/mesh.h"

#include <float.h>
#include <math.h>
#include <string.h>

struct drape_mesh_distance {
    drape_mesh_side side;
    drape_bvh boxes;      /* tree of boxes over the shape's triangles */
    int32_t *edge_of;     /* (triangle_count x 3) number of the segment between corners k and k + 1 */
    double *face_normal;  /* (triangle_count x 3) unit vectors */
    double *edge_normal;  /* (segment_count x 3) not normalised */
    double *point_normal; /* (point_count x 3) not normalised */
};

/* ---- Normals ---- */

static const double *corner(const drape_collider_shape *s, int32_t t, int k)
{
    return s->point + 3 * (size_t)s->triangle[3 * (size_t)t + (size_t)(k % 3)];
}

static double angle_between(const double *a, const double *b)
{
    double cross[3];
    vec3_cross(a, b, cross);
    return drape_atan2(vec3_norm(cross), vec3_dot(a, b));
}

drape_mesh_distance *drape_mesh_distance_create(drape_arena *arena, const drape_collider_shape *shape,
                                                drape_mesh_side side)
{
    const size_t triangles = (size_t)shape->triangle_count;
    drape_mesh_distance *mesh = drape_arena_take(arena, 1, sizeof *mesh);
    if (!mesh ||
        drape_bvh_build(arena, shape->triangle_count, 3, shape->triangle, shape->point, &mesh->boxes))
        return NULL;
    mesh->side = side;
    mesh->edge_of = drape_arena_take(arena, triangles, 3 * sizeof *mesh->edge_of);
    mesh->face_normal = drape_arena_take(arena, triangles, 3 * sizeof *mesh->face_normal);
    mesh->edge_normal = drape_arena_take(arena, (size_t)shape->segment_count, 3 * sizeof *mesh->edge_normal);
    mesh->point_normal = drape_arena_take(arena, (size_t)shape->point_count, 3 * sizeof *mesh->point_normal);
    if (drape_arena_status(arena))
        return NULL;
    for (size_t i = 0; i < 3 * triangles; i++) {
        const int32_t *n = shape->triangle + i - i % 3;
        mesh->edge_of[i] = drape_edge_between(shape->segment, shape->segment_count, n[i % 3], n[(i + 1) % 3]);
    }
    drape_mesh_distance_refit(mesh, shape);
    return mesh;
}

void drape_mesh_distance_refit(drape_mesh_distance *mesh, const drape_collider_shape *shape)
{
    drape_bvh_fit(&mesh->boxes, shape->point);
    memset(mesh->edge_normal, 0, 3 * (size_t)shape->segment_count * sizeof *mesh->edge_normal);
    memset(mesh->point_normal, 0, 3 * (size_t)shape->point_count * sizeof *mesh->point_normal);
    for (int32_t t = 0; t < shape->triangle_count; t++) {
        double *n = mesh->face_normal + 3 * (size_t)t, to_next[3], to_last[3];
        vec3_sub(corner(shape, t, 1), corner(shape, t, 0), to_next);
        vec3_sub(corner(shape, t, 2), corner(shape, t, 0), to_last);
        vec3_cross(to_next, to_last, n);
        double length = vec3_norm(n);
        for (int k = 0; k < 3; k++)
            n[k] = length > 0 ? n[k] / length : 0; /* between two frames a triangle may vanish */
        for (int k = 0; k < 3; k++) {
            size_t at = 3 * (size_t)t + (size_t)k;
            vec3_sub(corner(shape, t, k + 1), corner(shape, t, k), to_next);
            vec3_sub(corner(shape, t, k + 2), corner(shape, t, k), to_last);
            vec3_add_scaled(angle_between(to_next, to_last), n,
                            mesh->point_normal + 3 * (size_t)shape->triangle[at]);
            vec3_add_scaled(1, n, mesh->edge_normal + 3 * (size_t)mesh->edge_of[at]);
        }
    }
}

drape_mesh_side drape_mesh_distance_side(const drape_mesh_distance *mesh)
{
    return mesh->side;
}

/* ---- The nearest point ---- */

typedef enum feature_kind { FACE, EDGE, POINT } feature_kind;

typedef struct nearest {
    double squared; /* squared distance [m2] */
    double at[3];
    int32_t triangle;
    feature_kind kind;
    int which; /* EDGE: it runs from this corner to the next; POINT: this corner */
} nearest;

static void offer(nearest *best, const double *x, const double *at, int32_t t, feature_kind kind, int which)
{
    double from[3];
    vec3_sub(x, at, from);
    double squared = vec3_dot(from, from);
    if (squared < best->squared) {
        *best = (nearest){.squared = squared, .triangle = t, .kind = kind, .which = which};
        memcpy(best->at, at, sizeof best->at);
    }
}

/* Offers the point nearest to x on the edge from corner k. */
static void offer_edge(const drape_collider_shape *s, int32_t t, int k, const double *x, nearest *best)
{
    double along[3], from[3], at[3];
    const double *a = corner(s, t, k), *b = corner(s, t, k + 1);
    vec3_sub(b, a, along);
    vec3_sub(x, a, from);
    double share = vec3_dot(from, along) / vec3_dot(along, along);
    if (!(share > 0)) {
        offer(best, x, a, t, POINT, k);
    } else if (share >= 1) {
        offer(best, x, b, t, POINT, (k + 1) % 3);
    } else {
        memcpy(at, a, sizeof at);
        vec3_add_scaled(share, along, at);
        offer(best, x, at, t, EDGE, k);
    }
}

/* If x lies inside all three edges, the nearest point is its perpendicular projection; otherwise it is on an
 * edge that x lies outside of. */
static void offer_triangle(const drape_collider_shape *s, const drape_mesh_distance *mesh, int32_t t,
                           const double *x, nearest *best)
{
    const double *n = mesh->face_normal + 3 * (size_t)t;
    double along[3], from[3], outward[3], at[3];
    bool inside = true;
    for (int k = 0; k < 3; k++) {
        vec3_sub(corner(s, t, k + 1), corner(s, t, k), along);
        vec3_sub(x, corner(s, t, k), from);
        vec3_cross(along, n, outward);
        if (vec3_dot(outward, from) >= 0) {
            inside = false;
            offer_edge(s, t, k, x, best);
        }
    }
    if (inside) {
        memcpy(at, x, sizeof at);
        vec3_add_scaled(-vec3_dot(n, from), n, at);
        offer(best, x, at, t, FACE, 0);
    }
}

/* A branch that has not been visited yet. */
typedef struct pending {
    int32_t index;
    double squared; /* squared distance of its box */
} pending;

static pending pending_at(const drape_mesh_distance *mesh, int32_t index, const double *x)
{
    const drape_box *b = &mesh->boxes.branches[index].box;
    pending at = {.index = index};
    for (int k = 0; k < 3; k++) {
        const double below = b->low[k] - x[k], above = x[k] - b->high[k];
        const double beyond = below > 0 ? below : above > 0 ? above : 0; /* fmax may be a call */
        at.squared += beyond * beyond;
    }
    return at;
}

static nearest find_nearest(const drape_mesh_distance *mesh, const drape_collider_shape *s, const double *x)
{
    nearest best = {.squared = INFINITY};
    pending stack[DRAPE_BVH_DEPTH] = {{0, 0}};
    int height = 1;
    while (height > 0) {
        const pending next = stack[--height];
        const drape_bvh_branch *branch = &mesh->boxes.branches[next.index];
        if (next.squared >= best.squared)
            continue;
        if (branch->second == 0) {
            for (int32_t i = 0; i < branch->count; i++)
                offer_triangle(s, mesh, mesh->boxes.order[branch->first + i], x, &best);
            continue;
        }
        const pending one = pending_at(mesh, next.index + 1, x), other = pending_at(mesh, branch->second, x);
        bool one_is_near = one.squared <= other.squared;
        stack[height++] = one_is_near ? other : one;
        stack[height++] = one_is_near ? one : other;
    }
    return best;
}

/* ---- The distance ---- */

/* Returns the signed distance from an edge with the direction u, or from a point (u NULL). On the edge or
 * point itself the normal is the pseudo-normal. */
static double round_signed(const double *pseudo, const double *u, const double *from, double *normal,
                           double *curvature)
{
    double sign = vec3_dot(pseudo, from) < 0 ? -1 : 1, length = round_distance(from, u, normal, curvature);
    double pseudo_length = vec3_norm(pseudo);
    for (int k = 0; normal && k < 3; k++)
        normal[k] = length > 0 ? sign * normal[k] : pseudo[k] / pseudo_length;
    for (int i = 0; curvature && i < 9; i++)
        curvature[i] *= sign;
    return sign * length;
}

/* Distance with the sign of the pseudo-normal. */
static double distance_by_normal(const drape_mesh_distance *mesh, const drape_collider_shape *shape,
                                 const double *x, double *normal, double *curvature)
{
    const nearest found = find_nearest(mesh, shape, x);
    size_t place = 3 * (size_t)found.triangle + (size_t)found.which;
    double from[3], u[3];
    if (found.kind == FACE) {
        vec3_sub(x, corner(shape, found.triangle, 0), from);
        const double *n = mesh->face_normal + 3 * (size_t)found.triangle;
        if (normal)
            memcpy(normal, n, 3 * sizeof *normal);
        if (curvature)
            memset(curvature, 0, 9 * sizeof *curvature);
        return vec3_dot(from, n);
    }
    vec3_sub(x, found.at, from);
    if (found.kind == POINT)
        return round_signed(mesh->point_normal + 3 * (size_t)shape->triangle[place], NULL, from, normal,
                            curvature);
    vec3_sub(corner(shape, found.triangle, found.which + 1), corner(shape, found.triangle, found.which), u);
    double length = vec3_norm(u);
    for (int k = 0; k < 3; k++)
        u[k] /= length;
    return round_signed(mesh->edge_normal + 3 * (size_t)mesh->edge_of[place], u, from, normal, curvature);
}

/* ---- The side ---- */

/* A ray from a point along +x, and the number of times by which it leaves more often than it enters. */
typedef struct ray {
    const drape_collider_shape *shape;
    const double *from;
    int winding;
} ray;

/* The side of the line from corner a to corner b, seen along x, on which the ray is: positive, negative, or 0
 * if the line is seen as a point. A ray that meets the line counts as moved a little along y and far less
 * along z, so that it passes through exactly one of the triangles around an edge or a point. Both triangles
 * of an edge compute the same number with opposite signs. */
static double side_of_line(const ray *r, int32_t a, int32_t b)
{
    const bool ordered = a < b;
    const double *p = r->shape->point + 3 * (size_t)(ordered ? a : b),
                 *q = r->shape->point + 3 * (size_t)(ordered ? b : a);
    const double y = q[1] - p[1], z = q[2] - p[2];
    double side = y * (r->from[2] - p[2]) - z * (r->from[1] - p[1]);
    if (side == 0)
        side = z != 0 ? copysign(DBL_MIN, -z) : y != 0 ? copysign(DBL_MIN, y) : 0;
    return ordered ? side : -side;
}

static void cross(void *user, int32_t triangle)
{
    ray *r = user;
    const int32_t *n = r->shape->triangle + 3 * (size_t)triangle;
    double side[3], sum = 0, x = 0;
    for (int k = 0; k < 3; k++) {
        side[k] = side_of_line(r, n[(k + 1) % 3], n[(k + 2) % 3]);
        sum += side[k];
        x += side[k] * (r->shape->point[3 * (size_t)n[k]] - r->from[0]);
    }
    const bool above = side[0] > 0 && side[1] > 0 && side[2] > 0,
               below = side[0] < 0 && side[1] < 0 && side[2] < 0;
    if ((above && x > 0) || (below && x < 0))
        r->winding += sum > 0 ? 1 : -1;
}

/* Whether a closed mesh winds around a point. */
static bool winds_around(const drape_mesh_distance *mesh, const drape_collider_shape *shape, const double *x)
{
    ray r = {.shape = shape, .from = x};
    const drape_box box = {.low = {x[0], x[1], x[2]}, .high = {INFINITY, x[1], x[2]}};
    drape_bvh_query(&mesh->boxes, &box, cross, &r);
    return r.winding > 0;
}

double drape_mesh_distance_at(const drape_mesh_distance *mesh, const drape_collider_shape *shape,
                              const double *x, double *normal, double *curvature)
{
    const double d = distance_by_normal(mesh, shape, x, normal, curvature);
    if (mesh->side == DRAPE_SIDE_NORMAL ||
        (d < 0) == (mesh->side == DRAPE_SIDE_WINDING && winds_around(mesh, shape, x)))
        return d;
    for (int k = 0; normal && k < 3; k++)
        normal[k] = -normal[k];
    for (int i = 0; curvature && i < 9; i++)
        curvature[i] = -curvature[i];
    return -d;
}

void drape_mesh_distance_nearest(const drape_mesh_distance *mesh, const drape_collider_shape *shape,
                                 const double *x, int32_t *triangle, double weight[3])
{
    const nearest found = find_nearest(mesh, shape, x);
    double side[3][3], to[3], n[3], part[3], sum = 0;
    *triangle = found.triangle;
    for (int k = 0; k < 3; k++)
        vec3_sub(corner(shape, found.triangle, k + 1), corner(shape, found.triangle, k), side[k]);
    vec3_cross(side[0], side[1], n);
    for (int k = 0; k < 3; k++) { /* the area opposite to a corner */
        vec3_sub(found.at, corner(shape, found.triangle, k + 1), to);
        vec3_cross(side[(k + 1) % 3], to, part);
        weight[k] = fmax(vec3_dot(part, n), 0);
        sum += weight[k];
    }
    for (int k = 0; k < 3; k++)
        weight[k] = sum > 0 ? weight[k] / sum : 1.0 / 3;
}
