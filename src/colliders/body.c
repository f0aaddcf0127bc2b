/* body.c: see body.h. */
#include "colliders/body.h"

#include "base/vec3.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define CELLS        32   /* along the longest side of the box */
#define FLAT_CELLS   12   /* the same for an endless body */
#define FAR          1e4  /* distance in reaches from which the extent along an axis is measured */
#define ENDLESS      2.0  /* half the side of the box of an endless body, in reaches */
#define NORMAL_SHIFT 0.15 /* shift of a corner to the middle of its face, to find the side it is on */
#define NORMAL_RISE  0.05 /* height above the corner on that side where its normal is taken, in cells */
#define CREASE       0.8  /* cosine between two faces of a mesh above which their edge is drawn smooth */
#define MEAN_WEIGHT  1e-2 /* of the mean, for directions that the planes leave free */

typedef struct grid {
    const drape_collider *collider;
    drape_arena arena;
    double low[3], cell;
    int n[3];       /* corners */
    double *value;  /* (corners) signed distance */
    int32_t *point; /* (cells) number of the cell's point; -1 for none */
    double *points; /* (point_count x 3) */
    size_t point_count, point_capacity;
} grid;

static double distance(const drape_collider *c, const double *x, double *normal)
{
    return c->ops->distance(c->values, &c->shape, x, normal, NULL);
}

/* ---- The grid ---- */

static size_t corner_number(const grid *g, int i, int j, int k)
{
    return ((size_t)k * (size_t)g->n[1] + (size_t)j) * (size_t)g->n[0] + (size_t)i;
}

static void corner_at(const grid *g, int i, int j, int k, double *x)
{
    x[0] = g->low[0] + i * g->cell;
    x[1] = g->low[1] + j * g->cell;
    x[2] = g->low[2] + k * g->cell;
}

/* The box with a margin of somewhat more than a cell, so that no face of a body lies in a plane of the
 * grid. */
static drape_status make_grid(const drape_body *body, grid *g)
{
    double longest = 0, x[3];
    for (int k = 0; k < 3; k++)
        longest = fmax(longest, body->high[k] - body->low[k]);
    g->cell = longest / (body->endless ? FLAT_CELLS : CELLS);
    for (int k = 0; k < 3; k++) {
        double size = (body->high[k] - body->low[k]) / g->cell;
        g->n[k] = (int)ceil(size) + 4;
        g->low[k] = body->low[k] - (1.37 + (ceil(size) - size) / 2) * g->cell;
    }
    size_t corners = (size_t)g->n[0] * (size_t)g->n[1] * (size_t)g->n[2];
    g->value = drape_arena_take(&g->arena, corners, sizeof *g->value);
    g->point = drape_arena_take(&g->arena, corners, sizeof *g->point);
    for (int k = 0; k < g->n[2] && !g->arena.failed; k++)
        for (int j = 0; j < g->n[1]; j++)
            for (int i = 0; i < g->n[0]; i++) {
                corner_at(g, i, j, k, x);
                g->value[corner_number(g, i, j, k)] = distance(g->collider, x, NULL);
            }
    return drape_arena_status(&g->arena);
}

/* ---- A point in each cell that the surface passes through ---- */

/* The point with the least squared distances from the planes at the cuts, regularized towards the mean of the
 * cuts. */
static void fit_point(const double (*cuts)[3], const double (*normals)[3], int count, double *x)
{
    double mean[3] = {0}, a[3][3] = {{0}}, b[3] = {0};
    for (int i = 0; i < count; i++)
        vec3_add_scaled(1.0 / count, cuts[i], mean);
    for (int k = 0; k < 3; k++)
        a[k][k] = MEAN_WEIGHT;
    for (int i = 0; i < count; i++) {
        double offset[3];
        vec3_sub(cuts[i], mean, offset);
        double d = vec3_dot(offset, normals[i]);
        for (int r = 0; r < 3; r++) {
            b[r] += d * normals[i][r];
            for (int s = 0; s < 3; s++)
                a[r][s] += normals[i][r] * normals[i][s];
        }
    }
    /* Cramer's rule for a move = b, with a symmetric positive definite. */
    double cofactor[3][3], determinant = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const int r = (i + 1) % 3, s = (i + 2) % 3, t = (j + 1) % 3, u = (j + 2) % 3;
            cofactor[i][j] = a[r][t] * a[s][u] - a[r][u] * a[s][t];
        }
    for (int j = 0; j < 3; j++)
        determinant += a[0][j] * cofactor[0][j];
    for (int i = 0; i < 3; i++) {
        double move = 0;
        for (int j = 0; j < 3; j++)
            move += cofactor[j][i] * b[j] / determinant;
        x[i] = mean[i] + move;
    }
}

/* Adds the tangent plane at the surface point nearest to each corner of the cell, if that point is in the
 * cell: an edge of the body may pass through a cell none of whose edges meets both of the edge's sides. */
static int add_nearest(const grid *g, const int *at, double (*cuts)[3], double (*normals)[3], int count)
{
    for (int corner = 0; corner < 8; corner++) {
        double x[3], normal[3], low[3];
        bool inside = true;
        corner_at(g, at[0], at[1], at[2], low);
        corner_at(g, at[0] + corner % 2, at[1] + corner / 2 % 2, at[2] + corner / 4, x);
        double d = distance(g->collider, x, normal);
        vec3_add_scaled(-d, normal, x);
        for (int k = 0; k < 3; k++)
            inside = inside && x[k] >= low[k] && x[k] <= low[k] + g->cell;
        if (!inside)
            continue;
        memcpy(cuts[count], x, sizeof x);
        memcpy(normals[count++], normal, sizeof normal);
    }
    return count;
}

/* Adds the tangent planes where the surface cuts the edges of the cell; returns their number. */
static int add_cuts(const grid *g, const int *at, double (*cuts)[3], double (*normals)[3])
{
    int count = 0;
    for (int edge = 0; edge < 12; edge++) {
        double a[3], b[3];
        int axis = edge / 4, from[3], to[3];
        memcpy(from, at, sizeof from);
        from[(axis + 1) % 3] += edge % 2;
        from[(axis + 2) % 3] += edge / 2 % 2;
        memcpy(to, from, sizeof to);
        to[axis]++;
        if ((g->value[corner_number(g, from[0], from[1], from[2])] < 0) ==
            (g->value[corner_number(g, to[0], to[1], to[2])] < 0))
            continue;
        corner_at(g, from[0], from[1], from[2], a);
        corner_at(g, to[0], to[1], to[2], b);
        /* by bisection to half a unit in the last place of the vertices, which are floats */
        double low = 0, high = 1, *x = cuts[count];
        const bool inside = distance(g->collider, a, NULL) < 0;
        while (high - low > FLT_EPSILON / 2) {
            const double s = (low + high) / 2;
            for (int k = 0; k < 3; k++)
                x[k] = a[k] + s * (b[k] - a[k]);
            *((distance(g->collider, x, NULL) < 0) == inside ? &low : &high) = s;
        }
        distance(g->collider, cuts[count], normals[count]);
        count++;
    }
    return count;
}

/* The point that fits the planes, moved onto the surface by Newton steps on the distance as long as they
 * bring it nearer: the least squares alone are inexact because of the regularization. */
static drape_status make_point(grid *g, int i, int j, int k)
{
    double cuts[20][3], normals[20][3], x[3], normal[3];
    const int at[3] = {i, j, k};
    int count = add_cuts(g, at, cuts, normals);
    g->point[corner_number(g, i, j, k)] = count ? (int32_t)g->point_count : -1;
    if (!count)
        return DRAPE_OK;
    count = add_nearest(g, at, cuts, normals, count);
    fit_point((const double(*)[3])cuts, (const double(*)[3])normals, count, x);
    double d = distance(g->collider, x, normal);
    for (double before = INFINITY; fabs(d) < before; d = distance(g->collider, x, normal)) {
        vec3_add_scaled(-d, normal, x);
        before = fabs(d);
    }
    if (g->point_count == g->point_capacity) {
        g->point_capacity = g->point_capacity ? 2 * g->point_capacity : 1024;
        g->points = drape_arena_resize(&g->arena, g->points, g->point_capacity, sizeof x);
        if (!g->points)
            return DRAPE_E_MEMORY;
    }
    memcpy(g->points + 3 * g->point_count++, x, sizeof x);
    return DRAPE_OK;
}

/* ---- Faces: one for each edge of the grid that is cut ---- */

/* The normal of a corner of a face is that of the distance a little above the corner, on the side of the
 * face: on a round body it is the normal of the body, at an edge that of the side on which the face lies. The
 * direction to that side is the normal a little towards the middle of the face. */
static void put_triangle(const grid *g, const int32_t *corner, drape_body *body)
{
    double middle[3] = {0}, normal[3], x[3];
    for (int c = 0; c < 3; c++)
        vec3_add_scaled(1.0 / 3, g->points + 3 * (size_t)corner[c], middle);
    for (int c = 0; c < 3; c++) {
        const double *p = g->points + 3 * (size_t)corner[c];
        float *to = body->vertex + 6 * body->vertex_count++;
        for (int k = 0; k < 3; k++)
            x[k] = p[k] + NORMAL_SHIFT * (middle[k] - p[k]);
        distance(g->collider, x, normal);
        for (int k = 0; k < 3; k++)
            x[k] = p[k] + NORMAL_RISE * g->cell * normal[k];
        distance(g->collider, x, normal);
        for (int k = 0; k < 3; k++) {
            to[k] = (float)p[k];
            to[3 + k] = (float)normal[k];
        }
    }
}

/* Puts the face of the edge from corner (i, j, k) along axis: it joins the points of the four cells around
 * the edge, counterclockwise seen from outside. */
static void put_face(const grid *g, int i, int j, int k, int axis, drape_body *body)
{
    static const int around[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    int next[3] = {i, j, k};
    int32_t corner[4];
    next[axis]++;
    bool leaves = g->value[corner_number(g, i, j, k)] < 0;
    if (leaves == (g->value[corner_number(g, next[0], next[1], next[2])] < 0))
        return;
    for (int c = 0; c < 4; c++) {
        int cell[3] = {i, j, k};
        const int *back = around[leaves ? c : 3 - c];
        cell[(axis + 1) % 3] -= 1 - back[0];
        cell[(axis + 2) % 3] -= 1 - back[1];
        if (cell[0] < 0 || cell[1] < 0 || cell[2] < 0)
            return;
        corner[c] = g->point[corner_number(g, cell[0], cell[1], cell[2])];
        if (corner[c] < 0)
            return;
    }
    put_triangle(g, (const int32_t[]){corner[0], corner[1], corner[2]}, body);
    put_triangle(g, (const int32_t[]){corner[0], corner[2], corner[3]}, body);
}

static drape_status contour(drape_arena *arena, const drape_collider *collider, drape_body *body)
{
    grid g = {.collider = collider, .arena = drape_arena_of(arena->ctx)};
    drape_status status = make_grid(body, &g);
    for (int k = 0; k + 1 < g.n[2]; k++)
        for (int j = 0; j + 1 < g.n[1]; j++)
            for (int i = 0; i + 1 < g.n[0] && !status; i++)
                status = make_point(&g, i, j, k);
    /* a point has at most 12 faces around it, and a face 4 points: 3 faces, 6 triangles a point */
    if (!status &&
        !(body->vertex = drape_arena_take(arena, 6 * 18 * (g.point_count + 1), sizeof *body->vertex)))
        status = DRAPE_E_MEMORY;
    for (int k = 0; k + 1 < g.n[2]; k++)
        for (int j = 0; j + 1 < g.n[1]; j++)
            for (int i = 0; i + 1 < g.n[0]; i++)
                for (int axis = 0; axis < 3 && !status; axis++)
                    put_face(&g, i, j, k, axis, body);
    drape_arena_free(&g.arena);
    return status;
}

/* ---- Colliders that have triangles ---- */

void drape_body_follow(const drape_collider_shape *shape, drape_body *body)
{
    size_t count = 3 * (size_t)shape->triangle_count;
    for (size_t i = 0; i < count; i += 3) {
        double e1[3], e2[3], normal[3];
        const double *p[3];
        for (size_t c = 0; c < 3; c++)
            p[c] = shape->point + 3 * (size_t)shape->triangle[i + c];
        vec3_sub(p[1], p[0], e1);
        vec3_sub(p[2], p[0], e2);
        vec3_cross(e1, e2, normal);
        double length = vec3_norm(normal);
        for (size_t c = 0; c < 3; c++)
            for (size_t k = 0; k < 3; k++) {
                body->vertex[6 * (i + c) + k] = (float)p[c][k];
                body->vertex[6 * (i + c) + 3 + k] = (float)(length > 0 ? normal[k] / length : 0);
            }
    }
    body->vertex_count = count;
    /* A corner gets the mean normal of the triangles at its point, weighted by area, if its own normal
     * differs little from the mean; otherwise the edge stays sharp. */
    double *sum = body->sum;
    memset(sum, 0, 3 * (size_t)shape->point_count * sizeof *sum);
    for (size_t i = 0; i < body->vertex_count; i++) {
        const float *corner = body->vertex + 6 * (i - i % 3);
        double e1[3], e2[3], normal[3];
        for (int k = 0; k < 3; k++) {
            e1[k] = (double)(corner[6 + k] - corner[k]);
            e2[k] = (double)(corner[12 + k] - corner[k]);
        }
        vec3_cross(e1, e2, normal);
        vec3_add_scaled(1, normal, sum + 3 * (size_t)shape->triangle[i]);
    }
    for (size_t i = 0; i < body->vertex_count; i++) {
        float *normal = body->vertex + 6 * i + 3;
        const double *mean = sum + 3 * (size_t)shape->triangle[i];
        double length = vec3_norm(mean), along = 0;
        for (int k = 0; k < 3; k++)
            along += mean[k] * (double)normal[k];
        for (int k = 0; k < 3 && along > CREASE * length; k++)
            normal[k] = (float)(mean[k] / length);
    }
}

drape_status drape_body_create(drape_arena *arena, const drape_collider *collider, const double center[3],
                               double reach, drape_body *body)
{
    *body = (drape_body){.endless = false};
    /* The extent along each axis: from very far away the surface is nearly a plane across that axis. */
    for (int k = 0; k < 3; k++)
        for (int sign = -1; sign <= 1; sign += 2) {
            double x[3] = {center[0], center[1], center[2]};
            x[k] += sign * FAR * reach;
            double extent = FAR * reach - distance(collider, x, NULL);
            body->endless |= extent > FAR * reach / 2;
            *(sign > 0 ? &body->high[k] : &body->low[k]) = center[k] + sign * extent;
        }
    for (int k = 0; body->endless && k < 3; k++) {
        body->low[k] = center[k] - ENDLESS * reach;
        body->high[k] = center[k] + ENDLESS * reach;
    }
    const drape_collider_shape *shape = &collider->shape;
    if (shape->triangle_count == 0)
        return contour(arena, collider, body);
    body->vertex = drape_arena_take(arena, 18 * (size_t)shape->triangle_count, sizeof *body->vertex);
    body->sum = drape_arena_take(arena, (size_t)shape->point_count, 3 * sizeof *body->sum);
    if (!body->vertex || !body->sum)
        return DRAPE_E_MEMORY;
    drape_body_follow(shape, body);
    return DRAPE_OK;
}
