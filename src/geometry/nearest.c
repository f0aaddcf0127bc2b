/* nearest.c: see nearest.h. */
#include "geometry/nearest.h"

#include "base/vec3.h"
#include "geometry/closest.h"

#include <math.h>
#include <string.h>

/* What is searched, and the best place so far. */
typedef struct search {
    const drape_bvh *tree;
    const double *x;
    const double *from, *direction; /* direction NULL: the nearest place to a point */
    drape_on_triangle best;
} search;

static void keep(search *s, int32_t triangle, double distance, const double weights[3])
{
    if (!(distance < s->best.distance) &&
        !(distance == s->best.distance && (s->best.triangle < 0 || triangle < s->best.triangle)))
        return;
    s->best = (drape_on_triangle){.triangle = triangle, .distance = distance};
    memcpy(s->best.weights, weights, sizeof s->best.weights);
}

static void look_near(search *s, int32_t triangle)
{
    const int32_t *node = s->tree->node + 3 * (size_t)triangle;
    double points[4][3], weights[3];
    drape_closest at;
    memcpy(points[0], s->from, sizeof points[0]);
    for (int a = 0; a < 3; a++)
        memcpy(points[a + 1], s->x + 3 * (size_t)node[a], sizeof points[0]);
    drape_closest_point_triangle(points, &at);
    for (int a = 0; a < 3; a++)
        weights[a] = -at.c[a + 1];
    keep(s, triangle, at.distance, weights);
}

/* Möller & Trumbore (1997), Fast, minimum storage ray-triangle intersection, J. Graphics Tools 2. A ray
 * through a side meets both triangles of that side. */
static void look_along(search *s, int32_t triangle)
{
    const int32_t *node = s->tree->node + 3 * (size_t)triangle;
    const double *a = s->x + 3 * (size_t)node[0];
    double u[3], v[3], p[3], q[3], from[3];
    vec3_sub(s->x + 3 * (size_t)node[1], a, u);
    vec3_sub(s->x + 3 * (size_t)node[2], a, v);
    vec3_cross(s->direction, v, p);
    const double determinant = vec3_dot(u, p);
    if (determinant == 0)
        return;
    vec3_sub(s->from, a, from);
    vec3_cross(from, u, q);
    const double b = vec3_dot(from, p) / determinant, c = vec3_dot(s->direction, q) / determinant,
                 t = vec3_dot(v, q) / determinant;
    const double weights[3] = {1 - b - c, b, c};
    if (b >= 0 && c >= 0 && b + c <= 1 && t >= 0)
        keep(s, triangle, t, weights);
}

/* A lower bound of the distance of everything in a box. */
static double distance_of(const search *s, const drape_box *box)
{
    double sum = 0, enter = 0, leave = INFINITY;
    for (int k = 0; k < 3 && !s->direction; k++) {
        const double below = box->low[k] - s->from[k], above = s->from[k] - box->high[k];
        const double away = below > 0 ? below : above > 0 ? above : 0;
        sum += away * away;
    }
    if (!s->direction)
        return sqrt(sum);
    for (int k = 0; k < 3; k++) {
        const double low = box->low[k] - s->from[k], high = box->high[k] - s->from[k], d = s->direction[k];
        if (d == 0 && (low > 0 || high < 0))
            return INFINITY;
        if (d != 0) {
            enter = fmax(enter, fmin(low / d, high / d));
            leave = fmin(leave, fmax(low / d, high / d));
        }
    }
    return enter <= leave ? enter : INFINITY;
}

static void look_into(search *s, int32_t at)
{
    const drape_bvh_branch *branch = &s->tree->branches[at];
    if (branch->second == 0) {
        for (int32_t i = branch->first; i < branch->first + branch->count; i++)
            (s->direction ? look_along : look_near)(s, s->tree->order[i]);
        return;
    }
    const int32_t child[2] = {at + 1, branch->second};
    const double bound[2] = {distance_of(s, &s->tree->branches[child[0]].box),
                             distance_of(s, &s->tree->branches[child[1]].box)};
    const int nearer = bound[1] < bound[0];
    for (int i = 0; i < 2; i++) {
        const int c = i == 0 ? nearer : !nearer;
        if (bound[c] < INFINITY && bound[c] * (1 - DRAPE_CLOSEST_ROUNDING) <= s->best.distance)
            look_into(s, child[c]);
    }
}

static drape_on_triangle find(search *s)
{
    if (s->tree->count > 0)
        look_into(s, 0);
    return s->best;
}

drape_on_triangle drape_nearest_on(const drape_bvh *tree, const double *x, const double point[3],
                                   double within)
{
    search s = {.tree = tree, .x = x, .from = point, .best = {.triangle = -1, .distance = within}};
    return find(&s);
}

drape_on_triangle drape_first_on_ray(const drape_bvh *tree, const double *x, const double origin[3],
                                     const double direction[3], double length)
{
    search s = {.tree = tree,
                .x = x,
                .from = origin,
                .direction = direction,
                .best = {.triangle = -1, .distance = length}};
    return find(&s);
}
