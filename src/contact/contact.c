/* contact.c: see contact.h and inside.h. */
#include "contact/inside.h"

#include "base/clock.h"
#include "base/finite.h"
#include "base/vec3.h"

#include <math.h>
#include <string.h>

#define SEARCH_AHEAD 0.25 /* of a mean edge: how far points may move before a new search, at least */
#define MOST_AHEAD   0.4  /* and at most, */
#define STEPS_AHEAD  1.5  /* or as far as one went in so many steps like the last */
#define GOING_ON     1.0  /* of the last step's way: where points are searched at the beginning of one, */
#define GOING_BACK                                                                                           \
    -0.5 /* and of the way to a trial: half back to the beginning, as the next may start there. */
#define AIM_FAR    0.8 /* Of the margin: how far from where points are that may be */
#define FIRST_ROOM 64  /* of the list of candidates */

/* ---- Making and freeing ---- */

static double mean_edge(const drape_model *m)
{
    double sum = 0;
    for (int32_t e = 0; e < m->edge_count; e++)
        sum += m->edge_length[e];
    return sum / m->edge_count;
}

static bool take_arrays(drape_contact *c)
{
    size_t points = 3 * (size_t)c->search.points, colliders = (size_t)c->model->collider_count;
    c->x = drape_alloc(c->ctx, points, sizeof *c->x);
    c->v = drape_alloc(c->ctx, points, sizeof *c->v);
    c->from = drape_alloc(c->ctx, points, sizeof *c->from);
    c->to = drape_alloc(c->ctx, points, sizeof *c->to);
    c->searched = drape_alloc(c->ctx, points, sizeof *c->searched);
    c->start = drape_alloc(c->ctx, points, sizeof *c->start);
    c->start_gaps = drape_alloc(c->ctx, (size_t)c->model->node_count, sizeof *c->start_gaps);
    c->pose = drape_alloc(c->ctx, colliders, sizeof *c->pose);
    c->searched_pose = drape_alloc(c->ctx, colliders, sizeof *c->searched_pose);
    c->start_pose = drape_alloc(c->ctx, colliders, sizeof *c->start_pose);
    c->listed_pose = drape_alloc(c->ctx, colliders, sizeof *c->listed_pose);
    c->steps_pose = drape_alloc(c->ctx, colliders, sizeof *c->steps_pose);
    c->steps_searched = drape_alloc(c->ctx, 3 * (size_t)c->search.points, sizeof *c->steps_searched);
    c->on_collider = drape_alloc(c->ctx, 3 * colliders, sizeof *c->on_collider);
    return c->x && c->v && c->from && c->to && c->searched && c->start && c->start_gaps && c->pose &&
           c->searched_pose && c->start_pose && c->listed_pose && c->on_collider && c->steps_pose &&
           c->steps_searched;
}

drape_status drape_contact_create(drape_arena *arena, const drape_motion *motion, drape_contact **out)
{
    drape_context *ctx = arena->ctx;
    const drape_model *model = motion->model;
    *out = NULL;
    if (model->collider_count == 0 && !model->contact.self)
        return DRAPE_OK;
    drape_contact *c = drape_alloc(ctx, 1, sizeof *c);
    if (!c)
        return DRAPE_E_MEMORY;
    *c = (drape_contact){.ctx = ctx, .model = model, .motion = motion};
    c->law.velocity = model->contact.friction_velocity;
    drape_status status = drape_search_create(ctx, model, &c->search);
    if (!status && !take_arrays(c))
        status = DRAPE_E_MEMORY;
    c->mean_edge = mean_edge(model);
    c->margin = c->next_margin = SEARCH_AHEAD * c->mean_edge;
    *out = c;
    if (status)
        drape_contact_destroy(out);
    return status;
}

void drape_contact_destroy(drape_contact **contact)
{
    drape_contact *c = *contact;
    if (!c)
        return;
    void *arrays[] = {c->x,
                      c->v,
                      c->from,
                      c->to,
                      c->searched,
                      c->start,
                      c->start_gaps,
                      c->pose,
                      c->pairs,
                      c->lagged,
                      c->coupling,
                      c->on_collider,
                      c->searched_pose,
                      c->start_pose,
                      c->touches,
                      c->slots,
                      c->listed_pose,
                      c->steps_pose,
                      c->steps_searched};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        drape_free(c->ctx, arrays[i]);
    drape_search_destroy(&c->search);
    drape_free(c->ctx, c);
    *contact = NULL;
}

size_t drape_contact_bytes(const drape_contact *c)
{
    if (!c)
        return 0;
    size_t points = (size_t)c->search.points, nodes = (size_t)c->model->node_count,
           colliders = (size_t)c->model->collider_count;
    return sizeof *c + drape_search_bytes(&c->search) +
           (21 * points + nodes + 3 * colliders) * sizeof(double) + 5 * colliders * sizeof *c->pose +
           (size_t)c->room * sizeof *c->pairs +
           (size_t)c->touch_room * (sizeof *c->touches + DRAPE_SLOTS * sizeof *c->slots) +
           (size_t)c->lagged_room * sizeof *c->lagged + 4 * (size_t)c->coupling_room * sizeof *c->coupling;
}

double drape_contact_seconds(const drape_contact *c)
{
    return c ? c->seconds : 0;
}

double drape_contact_search_seconds(const drape_contact *c)
{
    return c ? c->search_seconds : 0;
}

/* A list with room for one more; it doubles. The contents are kept. */
void *drape_contact_grow(drape_context *ctx, void *list, int32_t count, int32_t *room, size_t size)
{
    if (count < *room)
        return list;
    int32_t wanted = *room > 0 ? 2 * *room : FIRST_ROOM;
    void *more = drape_alloc(ctx, (size_t)wanted, size);
    if (!more)
        return NULL;
    if (count > 0)
        memcpy(more, list, (size_t)count * size);
    drape_free(ctx, list);
    *room = wanted;
    return more;
}

/* ---- Placing ---- */

static void pose_at(const drape_motion *motion, int32_t collider, double t, const double span[2],
                    drape_collider_pose *pose)
{
    double before[3], after[3];
    memset(pose, 0, sizeof *pose);
    if (!drape_motion_moves_collider(motion, collider))
        return;
    drape_motion_collider(motion, collider, t, pose->displacement);
    if (!(span[1] > span[0]))
        return;
    drape_motion_collider(motion, collider, span[0], before);
    drape_motion_collider(motion, collider, span[1], after);
    for (int k = 0; k < 3; k++)
        pose->velocity[k] = (after[k] - before[k]) / (span[1] - span[0]);
}

void drape_contact_pose(drape_contact *c, double t, const double span[2])
{
    for (int32_t i = 0; i < c->model->collider_count; i++)
        pose_at(c->motion, i, t, span, &c->pose[i]);
}

/* Nodes as given, points of colliders as posed. */
void drape_contact_fill(const drape_contact *c, const double *nodes, double *x)
{
    size_t n = (size_t)c->model->node_count;
    memcpy(x, nodes, 3 * n * sizeof *x);
    for (size_t i = n; i < (size_t)c->search.points; i++) {
        const drape_collider_pose *pose = &c->pose[c->search.point_collider[i - n]];
        for (size_t k = 0; k < 3; k++)
            x[3 * i + k] = c->search.rest[3 * i + k] + pose->displacement[k];
    }
}

static void fill_velocities(const drape_contact *c, const double *nodes, double *v)
{
    size_t n = (size_t)c->model->node_count;
    if (nodes)
        memcpy(v, nodes, 3 * n * sizeof *v);
    else
        memset(v, 0, 3 * n * sizeof *v);
    for (size_t i = n; i < (size_t)c->search.points; i++)
        memcpy(v + 3 * i, c->pose[c->search.point_collider[i - n]].velocity, 3 * sizeof *v);
}

static double moved2(const double *a, const double *b)
{
    double d[3];
    vec3_sub(a, b, d);
    return vec3_dot(d, d);
}

/* The furthest that a point is from where the last search had it; INFINITY without any, and where a position is no
 * number. */
double drape_contact_moved(const drape_contact *c, const double *x)
{
    double most = 0;
    for (size_t i = 0; c->known && i < (size_t)c->search.points; i++) {
        const double moved = moved2(x + 3 * i, c->searched + 3 * i);
        if (isnan(moved))
            return INFINITY;
        most = moved > most ? moved : most;
    }
    for (int32_t i = 0; i < c->model->collider_count; i++)
        most = fmax(most, moved2(c->pose[i].displacement, c->searched_pose[i].displacement));
    return c->known ? sqrt(most) : INFINITY;
}

static void keep_pair(drape_contact *c, const drape_pair *pair)
{
    drape_pair *pairs = drape_contact_grow(c->ctx, c->pairs, c->count, &c->room, sizeof *pairs);
    if (!pairs) {
        c->status = DRAPE_E_MEMORY;
        return;
    }
    c->pairs = pairs;
    c->pairs[c->count++] = *pair;
}

/* Layers of one sheet that lie near each other at rest are no contact: half that distance is theirs. */
static double activation(const drape_contact *c, const drape_pair *pair)
{
    if (pair->collider >= 0)
        return pair->distance;
    const drape_placed rest = drape_contact_placed(c, c->search.rest);
    if (drape_pair_is_apart(pair, &rest, 2 * pair->distance)) /* most of them, for less than the gap takes */
        return pair->distance;
    return fmin(pair->distance, 0.5 * drape_pair_gap_value(pair, &rest));
}

static void consider(void *user, const drape_pair *found)
{
    drape_contact *c = user;
    drape_pair pair = *found;
    const drape_placed now = drape_contact_placed(c, c->searched);
    if (c->status || drape_pair_is_apart(&pair, &now, pair.distance + 2 * c->margin))
        return;
    pair.found = drape_pair_gap_value(&pair, &now);
    if (pair.found - 2 * c->margin >= pair.distance)
        return;
    pair.distance = activation(c, &pair);
    if (pair.found - 2 * c->margin < pair.distance)
        keep_pair(c, &pair);
}

static void search_surfaces(drape_contact *c)
{
    for (int32_t k = 0; k < c->model->collider_count; k++)
        for (int32_t i = 0; c->model->colliders[k].ops->smooth && i < c->model->free_count; i++) {
            drape_pair pair = drape_search_surface(&c->search, c->model->node_of_free[i], k);
            consider(c, &pair);
        }
}

static double longest_way(const drape_contact *c, const double *x)
{
    double most = 0;
    for (size_t i = 0; i < (size_t)c->model->node_count; i++)
        most = fmax(most, moved2(x + 3 * i, c->start + 3 * i));
    return sqrt(most);
}

/* Not where points are, but where they will be, or may return to: what is found serves for as far before as after. */
static void aim(drape_contact *c)
{
    const double way = c->known ? longest_way(c, c->x) : 0, most = AIM_FAR * c->margin;
    const double share = fabs(c->aim) * way > most ? copysign(most / way, c->aim) : c->aim;
    memcpy(c->searched, c->x, 3 * (size_t)c->search.points * sizeof *c->x);
    for (size_t i = 0; way > 0 && i < 3 * (size_t)c->model->node_count; i++)
        c->searched[i] += share * (c->x[i] - c->start[i]);
}

static void remember_search(drape_contact *c)
{
    c->strayed = true;
    c->steps_known = c->known;
    c->steps_margin = c->margin;
    memcpy(c->steps_searched, c->searched, 3 * (size_t)c->search.points * sizeof *c->searched);
    memcpy(c->steps_pose, c->searched_pose, (size_t)c->model->collider_count * sizeof *c->searched_pose);
}

static drape_status search(drape_contact *c)
{
    double start = drape_clock_seconds();
    if (c->resting && !c->strayed)
        remember_search(c);
    c->count = 0;
    c->margin = c->next_margin;
    c->status = DRAPE_OK;
    aim(c);
    search_surfaces(c);
    drape_search_pairs(&c->search, c->searched, NULL, 2 * c->margin, consider, c);
    memcpy(c->searched_pose, c->pose, (size_t)c->model->collider_count * sizeof *c->pose);
    c->search_seconds += drape_clock_seconds() - start;
    c->known = c->status == DRAPE_OK;
    c->moved = drape_contact_moved(c, c->x);
    return c->status;
}

/* ---- What acts ---- */

/* One piece that stands for several: the areas add up. Points and edges have no more than three nodes; what has
 * four is itself alone, and so is what is more than its nodes. */
static bool is_shared(const drape_touch *touch)
{
    return touch->closest.points > 1 && touch->closest.points < 4 && !touch->mollified && !touch->sharp;
}

static void sort_two(int32_t *a)
{
    int32_t least = a[0] < a[1] ? a[0] : a[1];
    a[1] += a[0] - least;
    a[0] = least;
}

/* Two points, or a point and then the ends of an edge, ascending. */
static void key_of(const drape_touch *touch, int32_t key[3])
{
    const int32_t *n = touch->pair.node;
    const double *c = touch->closest.c;
    if (touch->closest.points == 2) {
        const int32_t points[3] = {n[0], n[1], -1};
        memcpy(key, points, sizeof points);
        sort_two(key);
        return;
    }
    int positive = (c[0] > 0) + (c[1] > 0) + (c[2] > 0), alone = 0;
    while (alone < 2 && (c[alone] > 0) != (positive == 1))
        alone++;
    const int32_t nodes[3] = {n[alone], n[alone == 0], n[alone == 2 ? 1 : 2]};
    memcpy(key, nodes, sizeof nodes);
    sort_two(key + 1);
}

static bool is_same(const drape_touch *a, const drape_touch *b)
{
    int32_t key[3], other[3];
    if (a->pair.collider != b->pair.collider || a->pair.distance != b->pair.distance ||
        a->closest.points != b->closest.points)
        return false;
    key_of(a, key);
    key_of(b, other);
    return memcmp(key, other, sizeof key) == 0;
}

/* Where a touch is in the table, or its free place. */
static int32_t *slot_of(const drape_contact *c, const drape_touch *touch)
{
    int32_t key[3];
    key_of(touch, key);
    uint64_t hash = 0;
    for (int a = 0; a < 3; a++)
        hash = (hash ^ (uint32_t)key[a]) * 0x9e3779b97f4a7c15u;
    uint64_t size = DRAPE_SLOTS * (uint64_t)c->touch_room, at = (hash >> 20) % size;
    while (c->slots[at] > 0 && !is_same(touch, &c->touches[c->slots[at] - 1]))
        at = at + 1 < size ? at + 1 : 0;
    return &c->slots[at];
}

/* Room for one more, in the table too. */
static bool grow_touches(drape_contact *c)
{
    int32_t room = c->touch_room;
    drape_touch *touches = drape_contact_grow(c->ctx, c->touches, c->touch_count, &room, sizeof *touches);
    if (!touches)
        return false;
    c->touches = touches;
    if (room == c->touch_room)
        return true;
    int32_t *slots = drape_alloc(c->ctx, DRAPE_SLOTS * (size_t)room, sizeof *slots);
    if (!slots)
        return false;
    drape_free(c->ctx, c->slots);
    c->slots = slots;
    c->touch_room = room;
    for (int32_t i = 0; i < c->touch_count; i++)
        if (is_shared(&c->touches[i]))
            *slot_of(c, &c->touches[i]) = i + 1;
    return true;
}

static bool list_touch(drape_contact *c, const drape_touch *touch)
{
    if (!grow_touches(c))
        return false;
    int32_t *slot = is_shared(touch) ? slot_of(c, touch) : NULL;
    if (slot && *slot > 0) {
        c->touches[*slot - 1].pair.area += touch->pair.area;
        return true;
    }
    if (slot)
        *slot = c->touch_count + 1;
    c->touches[c->touch_count++] = *touch;
    return true;
}

static drape_status list_touches(drape_contact *c)
{
    const drape_placed now = drape_contact_placed(c, c->x);
    c->touch_count = 0;
    if (c->slots)
        memset(c->slots, 0, DRAPE_SLOTS * (size_t)c->touch_room * sizeof *c->slots);
    for (int32_t i = 0; i < c->count; i++) {
        const drape_pair *pair = &c->pairs[i];
        drape_touch touch;
        if (!drape_contact_may(pair, c->moved, pair->distance) ||
            !drape_pair_touch(pair, &now, c->search.rest, &touch))
            continue;
        drape_touch_reduce(&touch);
        if (!list_touch(c, &touch))
            return DRAPE_E_MEMORY;
    }
    memcpy(c->listed_pose, c->pose, (size_t)c->model->collider_count * sizeof *c->pose);
    c->listed = true;
    return DRAPE_OK;
}

/* Whether it stands there already: forces, energy and derivatives are often asked at one point. */
static bool stands(const drape_contact *c, const double *x)
{
    for (int32_t i = 0; i < c->model->collider_count; i++)
        if (moved2(c->pose[i].displacement, c->listed_pose[i].displacement) != 0)
            return false;
    return c->listed && memcmp(x, c->x, 3 * (size_t)c->model->node_count * sizeof *x) == 0;
}

drape_status drape_contact_go(drape_contact *c, const drape_contact_at *at)
{
    drape_contact_pose(c, at->t, at->span);
    fill_velocities(c, at->v, c->v);
    if (stands(c, at->x))
        return DRAPE_OK;
    c->listed = false;
    drape_contact_fill(c, at->x, c->x);
    c->moved = drape_contact_moved(c, c->x);
    drape_status status = c->moved > c->margin ? search(c) : DRAPE_OK;
    return status ? status : list_touches(c);
}

drape_status drape_contact_place(drape_contact *c, const drape_contact_at *at)
{
    double start = drape_clock_seconds();
    drape_status status = drape_contact_go(c, at);
    c->seconds += drape_clock_seconds() - start;
    return status;
}

/* ---- The beginning of a step ---- */

static bool keep_lagged(drape_contact *c, const drape_touch *touch, const drape_contact_law *law)
{
    drape_lagged *list =
        drape_contact_grow(c->ctx, c->lagged, c->lagged_count, &c->lagged_room, sizeof *list);
    if (!list)
        return false;
    c->lagged = list;
    drape_lagged *l = &c->lagged[c->lagged_count++];
    l->pair = touch->pair;
    drape_contact_gap(c, touch, false, &l->gap);
    l->lambda = drape_contact_normal_force(&l->gap, law);
    return true;
}

static drape_status lag(drape_contact *c)
{
    c->lagged_count = 0;
    for (int32_t i = 0; c->model->contact.lagged && i < c->touch_count; i++) {
        drape_contact_law law = drape_contact_law_of(c, &c->touches[i].pair);
        if (law.friction > 0 && !keep_lagged(c, &c->touches[i], &law))
            return DRAPE_E_MEMORY;
    }
    return DRAPE_OK;
}

/* How deep things lie in colliders already. */
static void measure_start(drape_contact *c)
{
    memset(c->start_gaps, 0, (size_t)c->model->node_count * sizeof *c->start_gaps);
    c->start_least = 0;
    for (int32_t i = 0; i < c->touch_count; i++) {
        const drape_touch *touch = &c->touches[i];
        if (touch->pair.collider < 0)
            continue;
        double *least = touch->closest.points == 1 ? &c->start_gaps[touch->pair.node[0]] : &c->start_least;
        *least = fmin(*least, touch->gap);
    }
}

/* Candidates as a search at these positions finds them. */
static drape_status search_at(drape_contact *c, const double *x, const drape_collider_pose *pose,
                              double margin)
{
    memcpy(c->x, x, 3 * (size_t)c->search.points * sizeof *x);
    memcpy(c->pose, pose, (size_t)c->model->collider_count * sizeof *pose);
    c->next_margin = margin;
    c->aim = 0; /* they are aimed already */
    return search(c);
}

/* Back to the search of the steps. */
static drape_status return_search(drape_contact *c)
{
    const bool strayed = c->strayed;
    c->resting = c->strayed = false;
    if (!strayed)
        return DRAPE_OK;
    c->listed = false;
    c->known = c->steps_known;
    return c->known ? search_at(c, c->steps_searched, c->steps_pose, c->steps_margin) : DRAPE_OK;
}

void drape_contact_rest(drape_contact *c)
{
    c->resting = true;
}

/* A fast sheet is searched with a wider margin and ahead of itself, once in a step or two and not at every trial. x: the
 * nodes at the end of the last step, whose beginning is still known. */
static void look_ahead(drape_contact *c, const double *x)
{
    const double way = c->known ? longest_way(c, x) : 0;
    c->next_margin = fmin(fmax(SEARCH_AHEAD * c->mean_edge, STEPS_AHEAD * way), MOST_AHEAD * c->mean_edge);
    c->aim = GOING_ON;
}

drape_status drape_contact_begin(drape_contact *c, const double *x, const double *v, double t)
{
    double start = drape_clock_seconds();
    drape_status status = return_search(c);
    look_ahead(c, x);
    if (!status)
        status = drape_contact_go(c, &(drape_contact_at){.x = x, .v = v, .t = t, .span = {t, t}});
    c->aim = GOING_BACK;
    if (!status)
        status = lag(c);
    if (!status) {
        measure_start(c);
        c->begun = true;
        memcpy(c->start, c->x, 3 * (size_t)c->search.points * sizeof *c->x);
        memcpy(c->start_pose, c->pose, (size_t)c->model->collider_count * sizeof *c->pose);
    }
    c->seconds += drape_clock_seconds() - start;
    return status;
}

/* ---- In a checkpoint ---- */

/* What acted where the step began follows from the positions alone: a search there finds it. */
static drape_status begin_again(drape_contact *c, double margin)
{
    drape_status status = search_at(c, c->start, c->start_pose, margin);
    if (!status)
        status = list_touches(c);
    if (!status)
        status = lag(c);
    if (!status)
        measure_start(c);
    return status;
}

/* Which candidates there are, and so what a pattern is made for, follows from where the last search was: c->to and
 * c->listed_pose. */
static drape_status recall(drape_contact *c, double margin, double next_margin, bool known)
{
    const double next_aim = c->aim;
    drape_status status = c->begun ? begin_again(c, margin) : DRAPE_OK;
    if (!status && known)
        status = search_at(c, c->to, c->listed_pose, margin);
    c->known = known;
    c->aim = c->begun ? GOING_BACK : 0;
    c->listed = false;
    c->margin = margin;
    c->next_margin = next_margin;
    c->aim = next_aim;
    c->resting = c->begun;
    return status;
}

static void archive_couplings(drape_contact *c, drape_archive *a)
{
    int32_t count = c->coupling_count;
    drape_archive_int32(a, &count);
    if (a->reading)
        c->coupling_count = 0;
    for (int32_t i = 0; i < count && drape_archive_good(a); i++) {
        int32_t *list = drape_contact_grow(c->ctx, c->coupling, i, &c->coupling_room, 4 * sizeof *list);
        if (!list) {
            drape_archive_note(a, DRAPE_E_MEMORY);
            return;
        }
        c->coupling = list;
        drape_archive_bytes(a, list + 4 * (size_t)i, 4 * sizeof *list);
        for (size_t k = 0; k < 4 && drape_archive_good(a); k++)
            if (list[4 * (size_t)i + k] < 0 || list[4 * (size_t)i + k] >= c->model->node_count)
                drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint couples a node that is not there");
        c->coupling_count = i + 1;
    }
}

/* A search wants numbers. */
static bool is_sound(const drape_contact *c, double margin, double next_margin)
{
    size_t n = 3 * (size_t)c->search.points;
    return isfinite(c->aim) && drape_all_finite(c->to, n) && drape_all_finite(c->start, n) && margin >= 0 &&
           margin <= c->model->length && next_margin >= 0 && next_margin <= c->model->length;
}

void drape_contact_archive(drape_contact *c, drape_archive *a)
{
    size_t points = 3 * (size_t)c->search.points, poses = 6 * (size_t)c->model->collider_count;
    double margin = c->strayed ? c->steps_margin : c->margin, next_margin = c->next_margin,
           seconds[2] = {c->seconds, c->search_seconds};
    bool known = c->strayed ? c->steps_known : c->known;
    double *searched = c->strayed ? c->steps_searched : c->searched;
    drape_collider_pose *pose = c->strayed ? c->steps_pose : c->searched_pose;
    drape_archive_mark(a, "contact");
    drape_archive_bool(a, &known);
    drape_archive_bool(a, &c->begun);
    drape_archive_double(a, &margin);
    drape_archive_double(a, &next_margin);
    drape_archive_double(a, &c->aim);
    drape_archive_doubles(a, a->reading ? c->to : searched, points);
    drape_archive_doubles(a, (a->reading ? c->listed_pose : pose)->displacement, poses);
    drape_archive_doubles(a, c->start, points);
    drape_archive_doubles(a, c->start_pose->displacement, poses);
    archive_couplings(c, a);
    drape_archive_doubles(a, seconds, 2);
    if (!drape_archive_is_reading(a))
        return;
    if (!is_sound(c, margin, next_margin))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has positions that are no numbers");
    else
        drape_archive_note(a, recall(c, margin, next_margin, known));
    c->seconds = seconds[0];
    c->search_seconds = seconds[1];
}
