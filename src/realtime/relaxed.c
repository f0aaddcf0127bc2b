/* relaxed.c: see relaxed.h. */
#include "realtime/relaxed.h"

#include "base/elementary.h"
#include "base/list.h"
#include "base/vec3.h"

#include <string.h>

#define DOUBLED 0.02 /* [s] in which the pressure on a node that has room doubles, and falls by half */

/* A ball around a shape: centre and radius, which is INFINITY if the shape may have no end, as a plane, or if
 * its points are inside of its surface. */
static void bound_of(const drape_collider_shape *shape, double out[4])
{
    double radius = shape->point_count > 0 && !shape->inscribed ? 0 : INFINITY, to[3];
    memset(out, 0, 3 * sizeof *out);
    for (int32_t i = 0; i < shape->point_count; i++)
        vec3_add_scaled(1.0 / shape->point_count, shape->point + 3 * (size_t)i, out);
    for (int32_t i = 0; i < shape->point_count; i++) {
        vec3_sub(shape->point + 3 * (size_t)i, out, to);
        radius = fmax(radius, vec3_norm(to));
    }
    out[3] = radius + shape->radius;
}

const double *drape_relaxed_bound_of(const drape_contact *c, int32_t collider)
{
    drape_relaxed_set *set = drape_relaxed_of(c);
    double *bound = set->bound + 4 * (size_t)collider;
    if (c->deformed[collider] && set->bound_t[collider] != c->body_t[collider]) {
        bound_of(&c->deformed[collider]->collider.shape, bound);
        set->bound_t[collider] = c->body_t[collider];
    }
    return bound;
}

/* ---- Queries ---- */

double drape_relaxed_distance(const drape_contact *c, int32_t collider, const double *x, double *normal)
{
    const drape_configuration now = {.model = c->model, .body = c->body};
    return drape_collider_distance(drape_configuration_body(&now, collider), &c->pose[collider], x, normal,
                                   NULL);
}

/* The place of the first node that is not before this one. */
static int32_t place_of(const drape_relaxed_set *set, int32_t collider, int32_t node)
{
    int32_t low = 0, high = set->exempt.count;
    while (low < high) {
        const int32_t middle = low + (high - low) / 2;
        const drape_relaxed_node *at = &set->nodes[middle];
        if (at->collider < collider || (at->collider == collider && at->node < node))
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

drape_relaxed_node *drape_relaxed_find(const drape_relaxed_set *set, int32_t collider, int32_t node)
{
    if (set->exempt.count == 0 || node < 0 || node >= set->model->node_count || !set->of_node[node])
        return NULL;
    const int32_t at = place_of(set, collider, node);
    drape_relaxed_node *found = at < set->exempt.count ? &set->nodes[at] : NULL;
    return found && found->collider == collider && found->node == node ? found : NULL;
}

static double factor_of(const drape_relaxed_set *set, int32_t collider, const int32_t *node, int nodes)
{
    double factor = 0;
    for (int a = 0; a < nodes; a++) {
        const drape_relaxed_node *found = drape_relaxed_find(set, collider, node[a]);
        factor = found ? fmax(factor, found->factor) : factor;
    }
    return factor;
}

/* ---- The functions of exempt.h ---- */

static bool has(const drape_exempt *exempt, int32_t collider, const int32_t *node, int nodes)
{
    return factor_of((const drape_relaxed_set *)exempt, collider, node, nodes) > 0;
}

static bool has_pin(const drape_model *model, const int32_t *node, int nodes)
{
    bool found = false;
    for (int a = 0; a < nodes; a++)
        found = found || model->pinned[node[a]];
    return found;
}

/* A pair of cloth with cloth is relaxed if one piece has a relaxed node and the other one a pinned node. */
static double factor(const drape_exempt *exempt, const drape_pair *pair)
{
    const drape_relaxed_set *set = (const drape_relaxed_set *)exempt;
    if (pair->collider >= 0)
        return factor_of(set, pair->collider, pair->node, drape_pair_points(pair));
    const int split = drape_pair_split(pair->kind);
    const int32_t *one = pair->node, *other = pair->node + split;
    double largest = has_pin(set->model, other, 4 - split) ? factor_of(set, -1, one, split) : 0;
    if (has_pin(set->model, one, split))
        largest = fmax(largest, factor_of(set, -1, other, 4 - split));
    return largest;
}

/* Features of solid colliders do not act, since cloth may be on their wrong side, and neither do pairs of a
 * node that is pushed out along the direction of its patch. */
static bool acts(const drape_exempt *exempt, const drape_pair *pair)
{
    const drape_relaxed_set *set = (const drape_relaxed_set *)exempt;
    const int points = drape_pair_points(pair);
    bool goes = pair->collider >= 0 && points > 1 && set->solid[pair->collider];
    for (int a = 0; pair->collider >= 0 && a < points && !goes; a++) {
        const drape_relaxed_node *found = drape_relaxed_find(set, pair->collider, pair->node[a]);
        goes = found && drape_relaxed_goes_out(found);
    }
    return !goes;
}

drape_status drape_relaxed_create(drape_arena *arena, const drape_contact *contact, drape_relaxed_set **out)
{
    const drape_model *model = contact->model;
    const size_t nodes = (size_t)model->node_count, colliders = (size_t)model->collider_count;
    drape_relaxed_set *set = *out = drape_arena_take(arena, 1, sizeof *set);
    if (!set)
        return DRAPE_E_MEMORY;
    *set = (drape_relaxed_set){.exempt = {.factor = factor, .acts = acts, .has = has},
                               .arena = contact->arena,
                               .model = model,
                               .ahead_t = NAN};
    set->of_node = drape_arena_take(arena, nodes, sizeof *set->of_node);
    set->normal = drape_arena_take(arena, nodes, 3 * sizeof *set->normal);
    set->reach = drape_arena_take(arena, nodes, sizeof *set->reach);
    set->face = drape_arena_take(arena, (size_t)model->triangle_count, sizeof *set->face);
    set->parent = drape_arena_take(arena, nodes, sizeof *set->parent);
    set->patches = drape_arena_take(arena, nodes, sizeof *set->patches);
    set->pins = drape_arena_take(arena, colliders, sizeof *set->pins);
    set->bound = drape_arena_take(arena, colliders, 4 * sizeof *set->bound);
    set->bound_t = drape_arena_take(arena, colliders, sizeof *set->bound_t);
    set->solid = drape_arena_take(arena, colliders, sizeof *set->solid);
    set->logged = drape_arena_take(arena, colliders + 1, sizeof *set->logged);
    set->total = drape_arena_take(arena, colliders + 1, sizeof *set->total);
    static const drape_collider_pose rest = {.displacement = {0}};
    for (size_t i = 0; !drape_arena_status(arena) && i < colliders; i++) {
        bound_of(&model->colliders[i].shape, set->bound + 4 * i);
        set->bound_t[i] = NAN;
        /* Solid are shapes of points and segments without a radius, meshes, and shapes whose middle is deeper
         * than their radius, since they enclose more than what is within the radius of their features. */
        const drape_collider_shape *shape = &model->colliders[i].shape;
        set->solid[i] = shape->point_count > 0 &&
                        (!(shape->radius > 0) || !model->colliders[i].ops->smooth ||
                         drape_collider_distance(&model->colliders[i], &rest, set->bound + 4 * i, NULL,
                                                 NULL) < -(1 + DRAPE_SAME) * shape->radius);
    }
    return drape_arena_status(arena);
}

/* ---- Changes ---- */

drape_status drape_relaxed_add(drape_relaxed_set *set, int32_t collider, int32_t node, double t, double until,
                               int32_t *added)
{
    drape_relaxed_node *found = drape_relaxed_find(set, collider, node);
    if (set->counting) {
        *added += !found;
        return DRAPE_OK;
    }
    if (found) {
        found->blocked = true;
        found->until = fmax(found->until, until);
        return DRAPE_OK;
    }
    const int32_t at = place_of(set, collider, node), behind = set->exempt.count - at;
    const drape_relaxed_node new = {.collider = collider,
                                    .node = node,
                                    .since = t,
                                    .until = until,
                                    .gap = INFINITY,
                                    .factor = 1,
                                    .blocked = true,
                                    .fresh = true};
    if (!drape_list_append(set->arena, &set->nodes, &set->exempt.count, &set->capacity, &new, sizeof new))
        return DRAPE_E_MEMORY;
    memmove(set->nodes + at + 1, set->nodes + at, (size_t)behind * sizeof new);
    set->nodes[at] = new;
    set->of_node[node] = 1;
    (*added)++;
    return DRAPE_OK;
}

int32_t drape_relaxed_count(const drape_relaxed_set *set, int32_t collider)
{
    return place_of(set, collider + 1, 0) - place_of(set, collider, 0);
}

double drape_relaxed_since(const drape_relaxed_set *set, int32_t collider)
{
    double since = INFINITY;
    for (int32_t i = place_of(set, collider, 0); i < place_of(set, collider + 1, 0); i++)
        since = fmin(since, set->nodes[i].since);
    return since;
}

static void add_to_total(drape_relaxed_set *set, int32_t collider, double t)
{
    drape_relaxed_total *total = &set->total[collider >= 0 ? collider : set->model->collider_count];
    const int32_t first = place_of(set, collider, 0), count = drape_relaxed_count(set, collider);
    const double since = drape_relaxed_since(set, collider);
    if (count == 0)
        return;
    if (total->most == 0)
        total->first = since;
    for (int32_t i = first; i < first + count; i++)
        total->deepest = fmax(total->deepest, set->nodes[i].deepest);
    total->most = count > total->most ? count : total->most;
    total->seconds += t - fmin(fmax(set->t, since), t);
    total->last = t;
}

void drape_relaxed_update(drape_relaxed_set *set, double t, double max_factor)
{
    for (int32_t i = 0; i < set->exempt.count; i++)
        set->nodes[i].deepest = fmax(set->nodes[i].deepest, set->nodes[i].depth);
    if (t == set->t)
        return;
    const double step = fmax(t - set->t, 0),
                 change = set->exempt.count > 0 ? drape_pow(2, step / DOUBLED) : 1;
    for (int32_t i = 0; i < set->exempt.count; i++) {
        drape_relaxed_node *node = &set->nodes[i];
        node->fresh = false;
        node->factor =
            fmax(1, fmin(node->blocked ? node->factor / change : node->factor * change, max_factor));
    }
    for (int32_t i = -1; set->exempt.count > 0 && i < set->model->collider_count; i++)
        add_to_total(set, i, t);
    set->t = t;
}

int32_t drape_relaxed_remove(drape_relaxed_set *set, drape_relaxed_leaves *leaves, void *user)
{
    int32_t kept = 0;
    for (int32_t i = 0; i < set->exempt.count; i++)
        if (leaves(user, &set->nodes[i]))
            set->of_node[set->nodes[i].node] = 0;
        else
            set->nodes[kept++] = set->nodes[i];
    const int32_t removed = set->exempt.count - kept;
    set->exempt.count = kept;
    for (int32_t i = 0; i < kept; i++) /* a node may be relaxed for another collider still */
        set->of_node[set->nodes[i].node] = 1;
    return removed;
}

/* ---- Between sims ---- */

drape_status drape_relaxed_continue(drape_relaxed_set *to, const drape_relaxed_set *from,
                                    const int32_t *before)
{
    const int32_t colliders = to->model->collider_count, last = from->model->collider_count;
    drape_status status = DRAPE_OK;
    int32_t added = 0;
    to->t = from->t;
    for (int32_t c = 0; c <= colliders; c++) {
        const int32_t had = c < colliders ? before[c] : last;
        if (had < 0)
            continue;
        to->total[c] = from->total[had];
        to->logged[c] = from->logged[had];
    }
    for (int32_t i = 0; !status && i < from->exempt.count; i++) {
        drape_relaxed_node node = from->nodes[i];
        bool there = node.collider < 0;
        for (int32_t c = 0; c < colliders && !there; c++) {
            there = before[c] == node.collider;
            node.collider = there ? c : node.collider;
        }
        if (!there)
            continue;
        status = drape_relaxed_add(to, node.collider, node.node, node.since, node.until, &added);
        if (!status)
            *drape_relaxed_find(to, node.collider, node.node) = node;
    }
    return status;
}

void drape_relaxed_archive(drape_relaxed_set *set, drape_archive *a)
{
    int32_t count = set->exempt.count, added = 0;
    drape_archive_double(a, &set->t);
    for (int32_t i = 0; i <= set->model->collider_count; i++) {
        drape_relaxed_total *total = &set->total[i];
        drape_archive_int32(a, &total->most);
        drape_archive_double(a, &total->deepest);
        drape_archive_double(a, &total->first);
        drape_archive_double(a, &total->last);
        drape_archive_double(a, &total->seconds);
    }
    for (int32_t i = 0; i <= set->model->collider_count; i++)
        drape_archive_bool(a, &set->logged[i]);
    drape_archive_int32(a, &count);
    if (a->reading)
        set->exempt.count = 0;
    for (int32_t i = 0; i < count && drape_archive_good(a); i++) {
        drape_relaxed_node node = a->reading ? (drape_relaxed_node){0} : set->nodes[i];
        double *const values[] = {&node.since,  &node.until,   &node.depth,   &node.deepest, &node.gap,
                                  &node.factor, &node.exit[0], &node.exit[1], &node.exit[2], &node.height};
        drape_archive_int32(a, &node.collider);
        drape_archive_int32(a, &node.node);
        for (size_t k = 0; k < sizeof values / sizeof *values; k++)
            drape_archive_double(a, values[k]);
        drape_archive_bool(a, &node.blocked);
        drape_archive_bool(a, &node.fresh);
        drape_archive_bool(a, &node.exits);
        if (!a->reading || !drape_archive_good(a))
            continue;
        if (!(node.collider >= -1 && node.collider < set->model->collider_count && node.node >= 0 &&
              node.node < set->model->node_count && node.factor >= 1 && isfinite(node.factor) &&
              isfinite(node.height) && isfinite(node.exit[0] + node.exit[1] + node.exit[2])))
            drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint relaxes a node that is not there");
        else if (drape_relaxed_add(set, node.collider, node.node, node.since, node.until, &added))
            drape_archive_note(a, DRAPE_E_MEMORY);
        else
            *drape_relaxed_find(set, node.collider, node.node) = node;
    }
}
