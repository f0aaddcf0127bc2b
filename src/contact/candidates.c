/* candidates.c: see candidates.h. */
#include "contact/candidates.h"

#include "base/vec3.h"
#include "contact/list.h"

#include <string.h>

drape_status drape_candidates_create(drape_arena *arena, drape_broad_phase *broad, drape_candidates *out)
{
    *out = (drape_candidates){.arena = arena, .broad = broad};
    out->x = drape_arena_take(arena, 3 * (size_t)broad->points, sizeof *out->x);
    out->pose = drape_arena_take(arena, (size_t)broad->model->collider_count, sizeof *out->pose);
    return out->x && out->pose ? DRAPE_OK : DRAPE_E_MEMORY;
}

/* A search in progress. */
typedef struct search {
    drape_candidates *candidates;
    drape_configuration at;
    drape_status status;
} search;

/* Layers of one sheet that are close together at rest must not be in contact there: their activation
 * distance is at most half of the rest distance. */
double drape_candidates_distance(const drape_broad_phase *broad, const drape_pair *pair)
{
    const drape_configuration rest = {.model = broad->model, .x = broad->rest};
    if (pair->collider >= 0 || drape_pair_is_apart(pair, &rest, 2 * pair->distance))
        return pair->distance;
    return fmin(pair->distance, 0.5 * drape_pair_gap_value(pair, &rest));
}

static void add(drape_candidates *c, const drape_pair *pair, drape_status *status)
{
    drape_pair *pairs = drape_list_grow(c->arena, c->pairs, c->count, &c->room, sizeof *pairs);
    if (!pairs) {
        *status = DRAPE_E_MEMORY;
        return;
    }
    c->pairs = pairs;
    c->pairs[c->count++] = *pair;
}

static void consider(void *user, const drape_pair *found)
{
    search *s = user;
    const double reach = 2 * s->candidates->margin;
    drape_pair pair = *found;
    if (s->status || drape_pair_is_apart(&pair, &s->at, pair.distance + reach))
        return;
    pair.gap_at_search = drape_pair_gap_value(&pair, &s->at);
    if (pair.gap_at_search - reach >= pair.distance)
        return;
    pair.distance = drape_candidates_distance(s->candidates->broad, &pair);
    if (pair.gap_at_search - reach < pair.distance)
        add(s->candidates, &pair, &s->status);
}

drape_status drape_candidates_search(drape_candidates *c, const drape_configuration *at, double margin)
{
    const drape_model *m = c->broad->model;
    search s = {.candidates = c, .at = {.model = m, .x = c->x, .pose = c->pose}};
    memmove(c->x, at->x, 3 * (size_t)c->broad->points * sizeof *c->x);
    memmove(c->pose, at->pose, (size_t)m->collider_count * sizeof *c->pose);
    c->margin = margin;
    c->count = 0;
    for (int32_t k = 0; k < m->collider_count; k++) {
        if (!m->colliders[k].ops->smooth)
            continue;
        for (int32_t i = 0; i < m->free_count; i++) {
            const drape_pair pair = drape_broad_phase_surface(c->broad, m->node_of_free[i], k);
            consider(&s, &pair);
        }
    }
    drape_broad_phase_pairs(c->broad, c->x, NULL, 2 * margin, consider, &s);
    c->known = s.status == DRAPE_OK;
    return s.status;
}

static double square_of_move(const double *a, const double *b)
{
    double d[3];
    vec3_sub(a, b, d);
    return vec3_dot(d, d);
}

double drape_candidates_moved(const drape_candidates *c, const drape_configuration *at)
{
    double largest = 0;
    if (!c->known)
        return INFINITY;
    for (size_t i = 0; i < (size_t)c->broad->points; i++) {
        const double moved = square_of_move(at->x + 3 * i, c->x + 3 * i);
        if (isnan(moved))
            return INFINITY;
        largest = moved > largest ? moved : largest;
    }
    for (int32_t i = 0; i < c->broad->model->collider_count; i++)
        largest = fmax(largest, square_of_move(at->pose[i].displacement, c->pose[i].displacement));
    return sqrt(largest);
}
