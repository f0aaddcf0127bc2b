/* contact.c: see contact.h. */
#include "contact/contact.h"

#include "base/clock.h"
#include "base/vec3.h"
#include "contact/depth.h"
#include "model/track.h"

#include <math.h>
#include <string.h>

#define D            12
#define SEARCH_AHEAD 0.25 /* of a mean edge: how far points may move before a new search */
#define KEEP_ITERATE 0.5  /* of a gap, where an iterate of Newton is cut short */
#define KEEP_STEP    1e-3 /* of a gap: coming nearer than that on the way of a step is taken for a crossing */
#define TOUCH        1e-9 /* [m] a piece may lie this deep in a collider */
#define MARCH_SHARE  0.9
#define MOST_MARCHES 10000 /* of a node along its way */
#define FIRST_ROOM   64    /* of the list of candidates */

/* Friction as it was where the step began. */
typedef struct lagged {
    drape_gap gap; /* c and normal; the derivatives are zero */
    int32_t node[4];
    int32_t collider;
    double lambda;
} lagged;

struct drape_contact {
    drape_context *ctx;
    const drape_model *model;
    drape_search search;
    drape_contact_law law;     /* all but the distance and stiffness of a pair */
    double *x, *v;             /* (points x 3) where it was last placed */
    double *y;                 /* (points x 3) the end of a way */
    double *searched;          /* (points x 3) positions of the last search */
    drape_collider_pose *pose; /* (collider_count) */
    drape_collider_pose *searched_pose, *start_pose;
    bool known;        /* there was a search */
    double margin;     /* how far points may move before a new one [m] */
    double moved;      /* how far one has, where it was last placed [m] */
    drape_pair *pairs; /* (count of room) candidates, surfaces too */
    int32_t count, room;
    lagged *lagged; /* (lagged_count of lagged_room) */
    int32_t lagged_count, lagged_room;
    int32_t *coupling; /* (coupling_room x 4) */
    int32_t coupling_room;
    double *start;      /* (points x 3) of the step */
    double *start_gaps; /* of surfaces: (node_count) the deepest that a node lay in any collider, at most 0 */
    double start_least; /* the smallest feature gap that a collider had, at most 0 [m] */
    double *on_collider; /* (collider_count x 3) */
    drape_status status; /* of the search */
    double seconds, search_seconds;
};

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
    c->y = drape_alloc(c->ctx, points, sizeof *c->y);
    c->searched = drape_alloc(c->ctx, points, sizeof *c->searched);
    c->start = drape_alloc(c->ctx, points, sizeof *c->start);
    c->start_gaps = drape_alloc(c->ctx, (size_t)c->model->node_count, sizeof *c->start_gaps);
    c->pose = drape_alloc(c->ctx, colliders, sizeof *c->pose);
    c->searched_pose = drape_alloc(c->ctx, colliders, sizeof *c->searched_pose);
    c->start_pose = drape_alloc(c->ctx, colliders, sizeof *c->start_pose);
    c->on_collider = drape_alloc(c->ctx, 3 * colliders, sizeof *c->on_collider);
    return c->x && c->v && c->y && c->searched && c->start && c->start_gaps && c->pose && c->searched_pose &&
           c->start_pose && c->on_collider;
}

drape_status drape_contact_create(drape_context *ctx, const drape_model *model, drape_contact **out)
{
    *out = NULL;
    if (model->collider_count == 0 && !model->contact.self)
        return DRAPE_OK;
    drape_contact *c = drape_alloc(ctx, 1, sizeof *c);
    if (!c)
        return DRAPE_E_MEMORY;
    *c = (drape_contact){.ctx = ctx, .model = model};
    c->law.velocity = model->contact.friction_velocity;
    drape_status status = drape_search_create(ctx, model, &c->search);
    if (!status && !take_arrays(c))
        status = DRAPE_E_MEMORY;
    c->margin = SEARCH_AHEAD * mean_edge(model);
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
    void *arrays[] = {c->x,         c->v,     c->y,      c->searched, c->start,       c->start_gaps,
                      c->pose,      c->pairs, c->lagged, c->coupling, c->on_collider, c->searched_pose,
                      c->start_pose};
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
    return sizeof *c + drape_search_bytes(&c->search) + 15 * (size_t)c->search.points * sizeof(double) +
           (size_t)c->room * sizeof *c->pairs + (size_t)c->lagged_room * sizeof *c->lagged +
           4 * (size_t)c->coupling_room * sizeof *c->coupling;
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
static void *grow(drape_context *ctx, void *list, int32_t count, int32_t *room, size_t size)
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

static void pose_at(const drape_collider *collider, double t, const double span[2], drape_collider_pose *pose)
{
    double before[3], after[3];
    memset(pose, 0, sizeof *pose);
    if (collider->track.key_count == 0)
        return;
    drape_track_displacement(collider->track.keys, collider->track.key_count, t, pose->displacement);
    if (!(span[1] > span[0]))
        return;
    drape_track_displacement(collider->track.keys, collider->track.key_count, span[0], before);
    drape_track_displacement(collider->track.keys, collider->track.key_count, span[1], after);
    for (int k = 0; k < 3; k++)
        pose->velocity[k] = (after[k] - before[k]) / (span[1] - span[0]);
}

static void pose_colliders(drape_contact *c, double t, const double span[2])
{
    for (int32_t i = 0; i < c->model->collider_count; i++)
        pose_at(&c->model->colliders[i], t, span, &c->pose[i]);
}

/* Nodes as given, points of colliders as posed. */
static void fill_points(const drape_contact *c, const double *nodes, double *x)
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

/* The furthest that a point is from where the last search had it; INFINITY without any. */
static double moved_since_search(const drape_contact *c, const double *x)
{
    double most = 0;
    for (size_t i = 0; c->known && i < (size_t)c->search.points; i++)
        most = fmax(most, moved2(x + 3 * i, c->searched + 3 * i));
    for (int32_t i = 0; i < c->model->collider_count; i++)
        most = fmax(most, moved2(c->pose[i].displacement, c->searched_pose[i].displacement));
    return c->known ? sqrt(most) : INFINITY;
}

static drape_placed placed(const drape_contact *c, const double *x)
{
    return (drape_placed){.model = c->model, .x = x, .pose = c->pose};
}

static void keep_pair(drape_contact *c, const drape_pair *pair)
{
    drape_pair *pairs = grow(c->ctx, c->pairs, c->count, &c->room, sizeof *pairs);
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
    const drape_placed rest = placed(c, c->search.rest);
    return fmin(pair->distance, 0.5 * drape_pair_gap_value(pair, &rest));
}

static void consider(void *user, const drape_pair *found)
{
    drape_contact *c = user;
    drape_pair pair = *found;
    const drape_placed now = placed(c, c->x);
    pair.found = drape_pair_gap_value(&pair, &now);
    if (pair.found - 2 * c->margin >= pair.distance || c->status)
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

static drape_status search(drape_contact *c)
{
    double start = drape_clock_seconds();
    c->count = 0;
    c->status = DRAPE_OK;
    search_surfaces(c);
    drape_search_pairs(&c->search, c->x, NULL, 2 * c->margin, consider, c);
    memcpy(c->searched, c->x, 3 * (size_t)c->search.points * sizeof *c->x);
    memcpy(c->searched_pose, c->pose, (size_t)c->model->collider_count * sizeof *c->pose);
    c->moved = 0;
    c->search_seconds += drape_clock_seconds() - start;
    c->known = c->status == DRAPE_OK;
    return c->status;
}

static drape_status place(drape_contact *c, const double *x, const double *v, double t, const double span[2])
{
    pose_colliders(c, t, span);
    fill_points(c, x, c->x);
    fill_velocities(c, v, c->v);
    c->moved = moved_since_search(c, c->x);
    return c->moved > c->margin ? search(c) : DRAPE_OK;
}

drape_status drape_contact_place(drape_contact *c, const drape_contact_at *at)
{
    double start = drape_clock_seconds();
    drape_status status = place(c, at->x, at->v, at->t, at->span);
    c->seconds += drape_clock_seconds() - start;
    return status;
}

/* ---- Forces ---- */

/* Pairs with a shorter activation distance take up the same energy. */
static drape_contact_law law_of(const drape_contact *c, const drape_pair *pair)
{
    drape_contact_law law = c->law;
    law.distance = pair->distance;
    law.stiffness = c->model->contact.stiffness * pair->area * (c->model->contact.distance / pair->distance);
    law.friction =
        pair->collider >= 0 ? c->model->colliders[pair->collider].friction : c->model->contact.self_friction;
    return law;
}

/* Velocities relative to the collider whose surface it is: only those have a point fewer. */
static void gather_velocities(const drape_contact *c, const drape_pair *pair, double v[4][3])
{
    drape_pair_gather(pair, c->v, v);
    if (drape_pair_points(pair) == 1)
        vec3_sub(v[0], c->pose[pair->collider].velocity, v[0]);
}

static void scatter(drape_contact *c, const int32_t *node, int points, int32_t collider, const double *from,
                    double *g)
{
    for (int a = 0; a < points; a++)
        for (int k = 0; k < 3 && node[a] < c->model->node_count; k++) {
            g[3 * (size_t)node[a] + (size_t)k] += from[3 * a + k];
            if (collider >= 0)
                c->on_collider[3 * (size_t)collider + (size_t)k] -= from[3 * a + k];
        }
}

/* Most candidates do not act, and that is known from how far points have moved since they were found. */
static bool may_act(const drape_contact *c, const drape_pair *pair)
{
    return pair->found - 2 * c->moved < pair->distance;
}

static bool acts(const drape_contact *c, const drape_pair *pair, bool derivatives, drape_gap *gap)
{
    const drape_placed now = placed(c, c->x);
    return may_act(c, pair) && drape_pair_gap(pair, &now, c->search.rest, derivatives, gap);
}

static void add_pair(drape_contact *c, const drape_pair *pair, bool normal, bool friction, double *g)
{
    drape_gap gap;
    double local[D], v[4][3];
    if (!acts(c, pair, normal, &gap))
        return;
    drape_contact_law law = law_of(c, pair);
    if (normal) {
        drape_contact_normal(&gap, &law, local, NULL);
        scatter(c, pair->node, gap.points, pair->collider, local, g);
    }
    if (!friction || c->model->contact.lagged || !(law.friction > 0))
        return;
    gather_velocities(c, pair, v);
    drape_contact_friction(&gap, &law, drape_contact_normal_force(&gap, &law), v, local, NULL);
    scatter(c, pair->node, gap.points, pair->collider, local, g);
}

static drape_pair pair_of_lagged(const lagged *l)
{
    return (drape_pair){.distance = 1,
                        .kind = l->gap.points == 1 ? DRAPE_PAIR_SURFACE : DRAPE_PAIR_TRIANGLE,
                        .node = {l->node[0], l->node[1], l->node[2], l->node[3]},
                        .collider = l->collider};
}

static void friction_of_lagged(drape_contact *c, const lagged *l, double *g, double *dgdv)
{
    double v[4][3];
    drape_pair pair = pair_of_lagged(l);
    drape_contact_law law = law_of(c, &pair);
    gather_velocities(c, &pair, v);
    drape_contact_friction(&l->gap, &law, l->lambda, v, g, dgdv);
}

void drape_contact_add_forces(drape_contact *c, bool normal, bool friction, double *g)
{
    double start = drape_clock_seconds(), local[D];
    memset(c->on_collider, 0, 3 * (size_t)c->model->collider_count * sizeof *c->on_collider);
    for (int32_t i = 0; i < c->count; i++)
        add_pair(c, &c->pairs[i], normal, friction, g);
    for (int32_t i = 0; friction && i < c->lagged_count; i++) {
        const lagged *l = &c->lagged[i];
        friction_of_lagged(c, l, local, NULL);
        scatter(c, l->node, l->gap.points, l->collider, local, g);
    }
    c->seconds += drape_clock_seconds() - start;
}

const double *drape_contact_on_colliders(const drape_contact *c)
{
    return c->on_collider;
}

double drape_contact_potential(drape_contact *c)
{
    double sum = 0;
    for (int32_t i = 0; i < c->count; i++) {
        drape_gap gap;
        if (!acts(c, &c->pairs[i], false, &gap))
            continue;
        drape_contact_law law = law_of(c, &c->pairs[i]);
        sum += drape_contact_energy(&gap, &law);
    }
    return sum;
}

int32_t drape_contact_active(drape_contact *c, double *least_gap)
{
    int32_t active = 0;
    *least_gap = INFINITY;
    for (int32_t i = 0; i < c->count; i++) {
        drape_gap gap;
        if (!acts(c, &c->pairs[i], false, &gap))
            continue;
        active++;
        *least_gap = fmin(*least_gap, gap.value);
    }
    return active;
}

/* ---- Jacobian ---- */

static int32_t free_of(const drape_model *m, int32_t point)
{
    return point >= 0 && point < m->node_count ? m->free_of_node[point] : -1;
}

static void add_blocks(const drape_contact *c, const int32_t *node, int points, const double *h,
                       const drape_pattern *pattern, double *values)
{
    for (int s = 0; s < points; s++)
        for (int r = 0; r < points; r++) {
            int32_t column = free_of(c->model, node[s]), row = free_of(c->model, node[r]);
            int64_t stride;
            if (column < 0 || row < 0)
                continue;
            double *to =
                drape_pattern_at(pattern, values, column, drape_pattern_find(pattern, row, column), &stride);
            for (int k = 0; k < 3; k++)
                for (int i = 0; i < 3; i++)
                    to[k * stride + i] += h[D * (3 * r + i) + 3 * s + k];
        }
}

static void add_weighted(double weight, const double *from, double *h)
{
    for (int i = 0; i < D * D; i++)
        h[i] += weight * from[i];
}

/* dg/dx + weight dg/dv of one pair, or dg/dv alone. */
static void pair_jacobian(drape_contact *c, const drape_pair *pair, const drape_gap *gap, double weight,
                          bool velocity_only, bool positive, double *h)
{
    drape_contact_law law = law_of(c, pair);
    double v[4][3], g[D], dgdv[D * D] = {0};
    memset(h, 0, D * D * sizeof *h);
    if (!velocity_only && positive)
        drape_contact_positive(gap, &law, h);
    else if (!velocity_only)
        drape_contact_normal(gap, &law, g, h);
    if (c->model->contact.lagged || !(law.friction > 0))
        return;
    gather_velocities(c, pair, v);
    drape_contact_friction(gap, &law, drape_contact_normal_force(gap, &law), v, g, dgdv);
    add_weighted(velocity_only ? 1 : weight, dgdv, h);
    if (!velocity_only)
        drape_contact_friction_slope(gap, &law, v, h);
}

void drape_contact_add_jacobian(drape_contact *c, double weight, bool velocity_only, bool positive,
                                const drape_pattern *pattern, double *values)
{
    double start = drape_clock_seconds(), h[D * D], g[D];
    for (int32_t i = 0; i < c->count; i++) {
        const drape_pair *pair = &c->pairs[i];
        drape_gap gap;
        if (!acts(c, pair, true, &gap))
            continue;
        pair_jacobian(c, pair, &gap, weight, velocity_only, positive, h);
        add_blocks(c, pair->node, gap.points, h, pattern, values);
    }
    for (int32_t i = 0; i < c->lagged_count; i++) {
        const lagged *l = &c->lagged[i];
        double dgdv[D * D] = {0};
        friction_of_lagged(c, l, g, dgdv);
        memset(h, 0, sizeof h);
        add_weighted(velocity_only ? 1 : weight, dgdv, h);
        add_blocks(c, l->node, l->gap.points, h, pattern, values);
    }
    c->seconds += drape_clock_seconds() - start;
}

static bool has_places(const drape_contact *c, const int32_t *node, int points, const drape_pattern *pattern)
{
    for (int s = 0; s < points; s++)
        for (int r = 0; r < points; r++) {
            int32_t column = free_of(c->model, node[s]), row = free_of(c->model, node[r]);
            if (column >= 0 && row >= 0 && !drape_pattern_has(pattern, row, column))
                return false;
        }
    return true;
}

bool drape_contact_fits(drape_contact *c, const drape_pattern *pattern)
{
    const drape_placed now = placed(c, c->x);
    for (int32_t i = 0; i < c->count; i++)
        if (c->pairs[i].collider < 0 && may_act(c, &c->pairs[i]) &&
            drape_pair_gap_value(&c->pairs[i], &now) < c->pairs[i].distance &&
            !has_places(c, c->pairs[i].node, 4, pattern))
            return false;
    for (int32_t i = 0; i < c->lagged_count; i++)
        if (c->lagged[i].collider < 0 && !has_places(c, c->lagged[i].node, 4, pattern))
            return false;
    return true;
}

static bool list_coupling(drape_contact *c, int32_t count, const int32_t *node)
{
    int32_t *coupling = grow(c->ctx, c->coupling, count, &c->coupling_room, 4 * sizeof *coupling);
    if (!coupling)
        return false;
    c->coupling = coupling;
    memcpy(c->coupling + 4 * (size_t)count, node, 4 * sizeof *node);
    return true;
}

int32_t drape_contact_couplings(drape_contact *c, const int32_t **nodes)
{
    int32_t count = 0;
    for (int32_t i = 0; i < c->count; i++)
        if (c->pairs[i].collider < 0) {
            if (!list_coupling(c, count, c->pairs[i].node))
                return -1;
            count++;
        }
    for (int32_t i = 0; i < c->lagged_count; i++)
        if (c->lagged[i].collider < 0) {
            if (!list_coupling(c, count, c->lagged[i].node))
                return -1;
            count++;
        }
    *nodes = c->coupling;
    return count;
}

/* ---- The beginning of a step ---- */

static bool keep_lagged(drape_contact *c, const drape_pair *pair, const drape_gap *gap, double lambda)
{
    lagged *list = grow(c->ctx, c->lagged, c->lagged_count, &c->lagged_room, sizeof *list);
    if (!list)
        return false;
    c->lagged = list;
    lagged *l = &c->lagged[c->lagged_count++];
    *l = (lagged){.gap = *gap, .collider = pair->collider, .lambda = lambda};
    memcpy(l->node, pair->node, sizeof l->node);
    return true;
}

static drape_status lag(drape_contact *c)
{
    c->lagged_count = 0;
    for (int32_t i = 0; c->model->contact.lagged && i < c->count; i++) {
        drape_gap gap;
        if (!acts(c, &c->pairs[i], false, &gap))
            continue;
        drape_contact_law law = law_of(c, &c->pairs[i]);
        if (law.friction > 0 && !keep_lagged(c, &c->pairs[i], &gap, drape_contact_normal_force(&gap, &law)))
            return DRAPE_E_MEMORY;
    }
    return DRAPE_OK;
}

/* How deep things lie in colliders already. */
static void measure_start(drape_contact *c)
{
    const drape_placed now = placed(c, c->x);
    memset(c->start_gaps, 0, (size_t)c->model->node_count * sizeof *c->start_gaps);
    c->start_least = 0;
    for (int32_t i = 0; i < c->count; i++) {
        const drape_pair *pair = &c->pairs[i];
        if (pair->collider < 0)
            continue;
        double gap = drape_pair_gap_value(pair, &now);
        if (drape_pair_points(pair) == 1)
            c->start_gaps[pair->node[0]] = fmin(c->start_gaps[pair->node[0]], gap);
        else
            c->start_least = fmin(c->start_least, gap);
    }
}

drape_status drape_contact_begin(drape_contact *c, const double *x, const double *v, double t)
{
    double start = drape_clock_seconds();
    const double span[2] = {t, t};
    drape_status status = place(c, x, v, t, span);
    if (!status)
        status = lag(c);
    if (!status) {
        measure_start(c);
        memcpy(c->start, c->x, 3 * (size_t)c->search.points * sizeof *c->x);
        memcpy(c->start_pose, c->pose, (size_t)c->model->collider_count * sizeof *c->pose);
    }
    c->seconds += drape_clock_seconds() - start;
    return status;
}

/* ---- Ways ---- */

/* The pairs that a way might bring together. */
typedef struct journey {
    drape_contact *contact;
    const double *x, *y; /* (points x 3) */
    double keep, way;
    bool core;
    drape_pair worst;
} journey;

static void follow(void *user, const drape_pair *pair)
{
    journey *j = user;
    double way = drape_pair_way(pair, j->x, j->y, j->keep, j->core);
    if (way < j->way) {
        j->way = way;
        j->worst = *pair;
    }
}

/* Straight ways: where both ends are near the last search, what is between is. */
static void travel(drape_contact *c, journey *j)
{
    if (moved_since_search(c, j->x) > c->margin || moved_since_search(c, j->y) > c->margin) {
        double start = drape_clock_seconds();
        drape_search_pairs(&c->search, j->x, j->y, -c->search.most_distance, follow, j);
        c->search_seconds += drape_clock_seconds() - start;
        return;
    }
    for (int32_t i = 0; i < c->count; i++)
        if (drape_pair_points(&c->pairs[i]) > 1)
            follow(j, &c->pairs[i]);
}

/* The same for nodes and surfaces: marching by the distance, which no way can outrun, until keep of the gap is
 * left. 1 from inside. */
static double march(const drape_contact *c, int32_t collider, const double *x, const double *y, double keep)
{
    const drape_collider *of = &c->model->colliders[collider];
    const drape_collider_pose *pose = &c->pose[collider];
    double gap = drape_collider_distance(of, pose, x, NULL, NULL), least = keep * gap, t = 0, p[3], at[3];
    vec3_sub(y, x, p);
    double length = vec3_norm(p);
    for (int i = 0; gap > least && length > gap - least && i < MOST_MARCHES; i++) {
        t += MARCH_SHARE * (gap - least) / length;
        if (t >= 1)
            return 1;
        memcpy(at, x, sizeof at);
        vec3_add_scaled(t, p, at);
        gap = drape_collider_distance(of, pose, at, NULL, NULL);
        if (gap < least + (1 - MARCH_SHARE) * least)
            return t;
    }
    return 1;
}

static double march_all(const drape_contact *c, const double *x, const double *y, double keep)
{
    double way = 1;
    for (int32_t k = 0; k < c->model->collider_count; k++)
        for (int32_t i = 0; c->model->colliders[k].ops->smooth && i < c->model->free_count; i++) {
            size_t at = 3 * (size_t)c->model->node_of_free[i];
            way = fmin(way, march(c, k, x + at, y + at, keep));
        }
    return way;
}

double drape_contact_way(drape_contact *c, const double *x, const double *y, double t)
{
    double start = drape_clock_seconds();
    const double span[2] = {t, t};
    pose_colliders(c, t, span);
    fill_points(c, x, c->x);
    fill_points(c, y, c->y);
    journey j = {.contact = c, .x = c->x, .y = c->y, .keep = KEEP_ITERATE, .way = 1};
    travel(c, &j);
    double share = fmin(j.way, march_all(c, x, y, KEEP_ITERATE));
    c->seconds += drape_clock_seconds() - start;
    return share;
}

bool drape_contact_crosses(drape_contact *c, const double *y, double t)
{
    double start = drape_clock_seconds();
    const double span[2] = {t, t};
    pose_colliders(c, t, span);
    fill_points(c, y, c->y);
    journey j = {.contact = c, .x = c->start, .y = c->y, .keep = KEEP_STEP, .way = 1, .core = true};
    travel(c, &j);
    c->seconds += drape_clock_seconds() - start;
    return j.way < 1;
}

/* ---- The end of a step ---- */

static drape_worst worst_of(const drape_contact *c, const drape_pair *pair, const char *what, double value,
                            double limit)
{
    drape_worst worst = {.what = what,
                         .term =
                             pair->collider >= 0 ? c->model->colliders[pair->collider].name : "self_contact",
                         .element = pair->collider >= 0 ? pair->collider : 0,
                         .node = {-1, -1, -1, -1},
                         .cloth = -1,
                         .value = value,
                         .limit = limit};
    int count = 0;
    for (int a = 0; a < drape_pair_points(pair); a++)
        if (pair->node[a] < c->model->node_count)
            worst.node[count++] = pair->node[a];
    worst.cloth = drape_model_cloth_of(c->model, worst.node[0]);
    return worst;
}

/* A node may be where it was too deep before, but no deeper. */
static double allowed(const drape_contact *c, const drape_pair *pair)
{
    double before = drape_pair_points(pair) == 1 ? c->start_gaps[pair->node[0]] : c->start_least;
    return fmin(before, -TOUCH);
}

static drape_status check_depth(drape_contact *c, const char **reason, drape_worst *worst)
{
    const drape_placed now = placed(c, c->x);
    double most = 0;
    for (int32_t i = 0; i < c->count; i++) {
        if (c->pairs[i].collider < 0)
            continue;
        double gap = drape_pair_gap_value(&c->pairs[i], &now), least = allowed(c, &c->pairs[i]);
        if (gap >= least || least - gap < most)
            continue;
        most = least - gap;
        *worst = worst_of(c, &c->pairs[i], "gap [m]", gap, least);
    }
    *reason = most > 0 ? "penetration" : *reason;
    return most > 0 ? DRAPE_RETRY_REJECTED : DRAPE_OK;
}

/* Depth of an edge (two nodes) or a face (three) of cloth, now or where the step began. */
static double depth_of(const drape_contact *c, int32_t collider, const int32_t *node, int nodes, bool start)
{
    const drape_collider *of = &c->model->colliders[collider];
    const drape_collider_pose *pose = start ? &c->start_pose[collider] : &c->pose[collider];
    const double *x = start ? c->start : c->x, *corner[3], enough = start ? INFINITY : -TOUCH;
    for (int a = 0; a < nodes; a++)
        corner[a] = x + 3 * (size_t)node[a];
    return nodes == 2 ? drape_depth_edge(of, pose, corner[0], corner[1], enough)
                      : drape_depth_face(of, pose, corner, enough);
}

/* Pieces of cloth against the curved surface of a shape that lies inside of it. As deep as it was before a piece
 * may be. */
static drape_status check_inscribed(drape_contact *c, const int32_t *node, int nodes, int32_t count,
                                    const char **reason, drape_worst *worst)
{
    const drape_model *m = c->model;
    for (int32_t k = 0; k < m->collider_count; k++)
        for (int32_t i = 0; m->colliders[k].shape.inscribed && i < count; i++) {
            const int32_t *n = node + (size_t)i * (size_t)nodes;
            double depth = depth_of(c, k, n, nodes, false), least;
            if (depth >= -TOUCH || depth >= (least = fmin(depth_of(c, k, n, nodes, true), -TOUCH)))
                continue;
            drape_pair pair = {.kind = DRAPE_PAIR_SEGMENTS, .node = {n[0], n[1], -1, -1}, .collider = k};
            pair.node[2] = nodes > 2 ? n[2] : -1;
            *reason = "penetration";
            *worst = worst_of(c, &pair, "gap [m]", depth, least);
            return DRAPE_RETRY_REJECTED;
        }
    return DRAPE_OK;
}

static drape_status check_way(drape_contact *c, const char **reason, drape_worst *worst)
{
    journey j = {.contact = c, .x = c->start, .y = c->x, .keep = KEEP_STEP, .way = 1, .core = true};
    travel(c, &j);
    if (j.way >= 1)
        return DRAPE_OK;
    *reason = "collision";
    *worst = worst_of(c, &j.worst, "fraction of the step before passing through", j.way, 1);
    return DRAPE_RETRY_REJECTED;
}

/* Whether a node on its straight way dips into the surface although both ends are outside: marching by the
 * distance, which no way can outrun. x, y: in the collider's own coordinates. */
static bool dips(const drape_collider *collider, const double *x, const double *y)
{
    double p[3], at[3], t = 0,
                        before = collider->ops->distance(collider->values, &collider->shape, x, NULL, NULL),
                        after = collider->ops->distance(collider->values, &collider->shape, y, NULL, NULL);
    vec3_sub(y, x, p);
    double length = vec3_norm(p);
    if (before <= 0 || after <= 0 || length < before + after)
        return false;
    for (int i = 0; i < MOST_MARCHES && t < 1; i++) {
        memcpy(at, x, sizeof at);
        vec3_add_scaled(t, p, at);
        double gap = collider->ops->distance(collider->values, &collider->shape, at, NULL, NULL);
        if (gap < -TOUCH)
            return true;
        t += fmax(gap, TOUCH) / length;
    }
    return false;
}

static drape_status check_surfaces(drape_contact *c, const char **reason, drape_worst *worst)
{
    for (int32_t k = 0; k < c->model->collider_count; k++)
        for (int32_t i = 0; c->model->colliders[k].ops->smooth && i < c->model->free_count; i++) {
            size_t node = (size_t)c->model->node_of_free[i];
            double x[3], y[3];
            vec3_sub(c->start + 3 * node, c->start_pose[k].displacement, x);
            vec3_sub(c->x + 3 * node, c->pose[k].displacement, y);
            if (!dips(&c->model->colliders[k], x, y))
                continue;
            drape_pair pair = drape_search_surface(&c->search, (int32_t)node, k);
            *reason = "collision";
            *worst = worst_of(c, &pair, "node through collider", 1, 0);
            return DRAPE_RETRY_REJECTED;
        }
    return DRAPE_OK;
}

drape_status drape_contact_check(drape_contact *c, const double *x, double t, const char **reason,
                                 drape_worst *worst)
{
    double start = drape_clock_seconds();
    const double span[2] = {t, t};
    drape_status status = place(c, x, NULL, t, span);
    if (!status)
        status = check_depth(c, reason, worst);
    if (!status)
        status = check_surfaces(c, reason, worst);
    if (!status)
        status = check_inscribed(c, c->model->edge, 2, c->model->edge_count, reason, worst);
    if (!status)
        status = check_inscribed(c, c->model->triangle, 3, c->model->triangle_count, reason, worst);
    if (!status)
        status = check_way(c, reason, worst);
    c->seconds += drape_clock_seconds() - start;
    return status;
}
