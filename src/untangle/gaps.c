/*
 * gaps.c: the pairs that are near each other, as contact finds them. Each keeps its side, and gets the gap
 * that is wanted, unless one of its pieces is to pass the sheet of the other piece.
 */
#include "untangle/workspace.h"

#include "base/list.h"

#include <string.h>

#define REACH 1.2 /* strides beyond the wanted gap within which pairs are kept apart */

/* Whether some node of one piece passes the sheet of the other. */
static bool is_passing(const drape_untangler *u, const drape_pair *pair)
{
    const int split = drape_pair_split(pair->kind);
    const int32_t sheet[2] = {u->sheets.of_point[pair->node[0]], u->sheets.of_point[pair->node[3]]};
    for (int a = 0; a < 4; a++)
        if (drape_untangle_passes(u, pair->node[a], sheet[a < split]))
            return true;
    return false;
}

/* Whether a pair is of a closed collider and of cloth inside it, which has no side to be kept on by features
 * of the collider. */
static bool is_sunk(const drape_untangler *u, const drape_pair *pair)
{
    for (int a = 0; pair->collider >= 0 && !u->open[pair->collider] && a < 4; a++)
        if (pair->node[a] < u->model->node_count && u->sunk[pair->node[a]])
            return true;
    return false;
}

static void normal_at(const drape_untangler *u, int32_t node, double n[3])
{
    const drape_sheets *s = &u->sheets;
    memset(n, 0, 3 * sizeof *n);
    for (int32_t a = s->edges.first[node]; a < s->edges.first[node + 1]; a++)
        for (int k = 0; k < 2; k++) {
            const int32_t face = s->edge_triangle[2 * (size_t)s->edges.element[a] + (size_t)k];
            double own[3];
            if (face < 0)
                continue;
            vec3_triangle_area(s->triangle + 3 * (size_t)face, u->x, own);
            vec3_add_scaled(1, own, n);
        }
}

static void list_pair(void *user, const drape_pair *pair)
{
    drape_untangler *u = user;
    if (!drape_list_append(u->arena, &u->close_pairs, &u->pair_count, &u->pair_capacity, pair, sizeof *pair))
        u->out_of_memory = true;
}

/* Measures the gap of a pair, which is near if the gap is less than the reach beyond the wanted one, and adds
 * its bound. */
static void keep_gap(drape_untangler *u, const drape_pair *found, double reach)
{
    const drape_configuration rest = {.model = u->model, .x = u->broad.rest, .pose = u->pose};
    drape_pair pair = *found;
    double x[4][3];
    drape_closest closest;
    pair.distance = drape_pair_activation_distance(found, &rest);
    if (is_passing(u, &pair) || is_sunk(u, &pair))
        return;
    for (int a = 0; a < 4; a++)
        memcpy(x[a], u->x + 3 * (size_t)pair.node[a], sizeof x[a]);
    if (pair.kind == DRAPE_PAIR_TRIANGLE)
        drape_closest_point_triangle(x, &closest);
    else
        drape_closest_segments(x, &closest);
    const double gap = closest.distance - pair.radius, wanted = drape_untangle_wanted(u, pair.distance),
                 least = drape_pair_least_gap(&pair, u->broad.rounding);
    if (gap >= wanted + reach)
        return;
    if (least > 0)
        u->min_share = fmin(u->min_share, gap / least);
    if (wanted > 0)
        u->min_wanted = fmin(u->min_wanted, gap / wanted);
    if (closest.distance < DRAPE_NO_SIDE * u->broad.rounding) {
        /* Pieces at distance 0, such as layers that begin in one plane: the sheet with the higher number goes
         * to the side to which the normal of the other one points. */
        double *n = closest.normal;
        const int split = drape_pair_split(pair.kind);
        const bool first = pair.node[0] < pair.node[3];
        memset(n, 0, 3 * sizeof *n);
        for (int a = first ? 0 : split; a < (first ? split : 4); a++) {
            double own[3];
            normal_at(u, pair.node[a], own);
            vec3_add_scaled(first ? -1 : 1, own, n);
        }
        const double length = vec3_norm(n);
        for (int k = 0; k < 3; k++)
            n[k] = length > 0 ? n[k] / length : k == 1;
    }
    drape_half_space bound = {.bound = wanted + pair.radius};
    memcpy(bound.node, pair.node, sizeof bound.node);
    memcpy(bound.c, closest.c, sizeof bound.c);
    memcpy(bound.normal, closest.normal, sizeof bound.normal);
    drape_untangle_bound(u, &bound);
}

drape_status drape_untangle_gaps(drape_untangler *u)
{
    const double reach = REACH * drape_untangle_stride(u);
    const drape_broad_query want = {.x = u->x, .pose = {u->pose, u->pose}, .reach = reach};
    u->pair_count = 0;
    drape_broad_phase_pairs(&u->broad, &want, list_pair, u);
    if (u->out_of_memory || drape_sort_pairs(&u->sorter, u->close_pairs, u->pair_count))
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < u->pair_count; i++)
        keep_gap(u, &u->close_pairs[i], reach);
    return u->out_of_memory ? DRAPE_E_MEMORY : DRAPE_OK;
}
