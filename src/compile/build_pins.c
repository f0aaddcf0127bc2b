/* build_pins.c: which nodes are pinned, along which track; numbers the free nodes. Pinned nodes are
 * eliminated from the system. */
#include "base/vec3.h"
#include "compile/select.h"
#include "compile/stages.h"
#include "model/track.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define PARALLEL                                                                                             \
    1e-6 /* the part of a unit direction that lies along others, below which it adds nothing to them */

/* How pins with directions hold a node. */
typedef struct holding {
    int count;              /* of directions */
    double direction[3][3]; /* of length 1, at right angles */
    double normal[3][3];    /* of the pins, of length 1 */
    int32_t track[3];       /* of the pins; -1: fixed */
    int32_t pin[3];         /* numbers of the pins in the model */
} holding;

/* One pin under construction: its place in the scene, and the cloth that it pins. */
typedef struct pin_place {
    drape_model *model;
    const drape_cloth *cloth;
    const drape_pin_def *def;
    char pointer[128];
    int32_t track;          /* number of its track, -1: fixed */
    int32_t *track_of_node; /* (node_count) -1: fixed or free */
    uint8_t *clamped;       /* (node_count) 1: held by a pin that clamps */
    uint8_t *held;          /* (node_count) 1: held by this pin */
    int count;              /* of the directions in which this pin holds its nodes; 0: in all */
    double direction[2][3];
    holding *all; /* (node_count) by pins with directions */
} pin_place;

/* ---- Motions of nodes ---- */

/* Duals of the normals: dual[i] . normal[j] = 1 if i = j, else 0, spanning the same. Normals at right angles
 * are their own. */
static void find_duals(const holding *all, double dual[3][3])
{
    memcpy(dual, all->normal, sizeof all->normal);
    if (all->count == 1)
        return;
    for (int i = 0; i < all->count; i++) {
        const double *b = all->normal[(i + 1) % all->count];
        double own[3] = {all->normal[i][0], all->normal[i][1], all->normal[i][2]};
        if (all->count == 2)
            vec3_add_scaled(-vec3_dot(b, own), b, own);
        else
            vec3_cross(b, all->normal[(i + 2) % 3], own);
        const double scale = vec3_dot(own, all->normal[i]);
        for (int k = 0; k < 3; k++)
            dual[i][k] = own[k] / scale;
    }
}

static bool moves(const holding *all)
{
    bool found = false;
    for (int i = 0; i < all->count; i++)
        found = found || all->track[i] >= 0;
    return found;
}

/* The displacement along a track at a time; and the first key after it: INFINITY if there is none. */
static double displace_along(const drape_model *model, int32_t number, double t, double d[3])
{
    double next = INFINITY;
    memset(d, 0, 3 * sizeof *d);
    if (number < 0)
        return next;
    const drape_track *track = &model->tracks[number];
    drape_track_displacement(track->keys, track->key_count, t, d);
    const size_t after = (size_t)(drape_track_key_before(track->keys, track->key_count, t) + 1);
    return after < track->key_count ? track->keys[after].time : next;
}

/* The same of a node along all directions that are held, and of the keys of all tracks. */
static double displace(const drape_model *model, const holding *all, double t, double d[3])
{
    double next = INFINITY, dual[3][3], by[3];
    find_duals(all, dual);
    memset(d, 0, 3 * sizeof *d);
    for (int i = 0; i < all->count; i++) {
        next = fmin(next, displace_along(model, all->track[i], t, by));
        vec3_add_scaled(vec3_dot(all->normal[i], by), dual[i], d);
    }
    return next;
}

/* Whether a track moves a node along a direction, of length 1, as those do that hold it along this one. Both
 * are linear between keys. */
static bool moves_alike(const drape_model *model, const double *n, int32_t track, const holding *all)
{
    double apart = 0, size = 0, d[2][3];
    for (double t = -INFINITY; t < INFINITY;) {
        t = fmin(displace_along(model, track, t, d[0]), displace(model, all, t, d[1]));
        apart = fmax(apart, fabs(vec3_dot(n, d[0]) - vec3_dot(n, d[1])));
        size = fmax(size, fmax(vec3_norm(d[0]), vec3_norm(d[1])));
        model->ctx->work += 64; /* drape_check_cancel_after at the next node asks then */
    }
    return apart <= PARALLEL * size;
}

/* Neither turns nor is carried by a collider. */
static bool only_displaces(const drape_model *model, int32_t track)
{
    return track < 0 || (model->tracks[track].key_count > 0 && model->tracks[track].turns.key_count == 0);
}

/* Whether two pins move the nodes that both hold in all directions alike. */
static bool tracks_agree(const drape_model *model, int32_t a, int32_t b)
{
    static const double axes[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    holding all = {.count = 3, .track = {b, b, b}};
    memcpy(all.normal, axes, sizeof axes);
    bool same = a == b || (only_displaces(model, a) && only_displaces(model, b));
    for (int k = 0; same && a != b && k < 3; k++)
        same = moves_alike(model, axes[k], a, &all);
    return same;
}

static drape_status refuse_motions(const drape_model *model, const char *at, int32_t node, const double *n,
                                   const drape_pin *other)
{
    return drape_refuse(model->ctx, at,
                        "node %d is held along (%g %g %g) by this pin and by \"%s\", which moves "
                        "differently",
                        (int)(node - model->cloths[other->cloth].first_node), n[0] + 0.0, n[1] + 0.0,
                        n[2] + 0.0, other->name); /* + 0.0: no -0 */
}

/* ---- Nodes of pins ---- */

/* Adds the part of a direction that the node's other directions do not hold: two planes that meet at a node
 * leave it a line, three leave it nothing. If they hold all of it, their pins must move alike along it. */
static drape_status add_direction(const pin_place *pin, const char *key, int32_t node,
                                  const double *direction, int32_t track)
{
    holding *all = &pin->all[node];
    double n[3] = {direction[0], direction[1], direction[2]};
    int other = -1;
    for (int i = 0; i < all->count; i++) {
        other = other < 0 && fabs(vec3_dot(all->normal[i], direction)) > PARALLEL ? i : other;
        vec3_add_scaled(-vec3_dot(all->direction[i], n), all->direction[i], n);
    }
    const double length = vec3_norm(n);
    if (other >= 0 && (all->count == 3 || !(length > PARALLEL))) {
        const char *at = DRAPE_FORMAT("%s/%s", pin->pointer, key);
        return moves_alike(pin->model, direction, track, all)
                   ? DRAPE_OK
                   : refuse_motions(pin->model, at, node, direction, &pin->model->pins[all->pin[other]]);
    }
    for (int k = 0; k < 3; k++)
        all->direction[all->count][k] = n[k] / length;
    memcpy(all->normal[all->count], direction, 3 * sizeof *direction);
    all->pin[all->count] = pin->model->pin_count - 1;
    all->track[all->count++] = track;
    return DRAPE_OK;
}

static drape_status take_node(void *user, const char *key, int32_t local)
{
    pin_place *pin = user;
    int32_t node = pin->cloth->first_node + local;
    DRAPE_TRY(drape_check_cancel_after(pin->model->ctx, 8));
    if (pin->count > 0) {
        for (int i = 0; i < pin->count && !pin->held[node]; i++)
            DRAPE_TRY(
                add_direction(pin, key, node, pin->direction[i], pin->def->key_count > 0 ? pin->track : -1));
        pin->clamped[node] |= pin->def->clamp;
        pin->held[node] = 1;
        return DRAPE_OK;
    }
    if (pin->model->pinned[node] && !tracks_agree(pin->model, pin->track_of_node[node], pin->track))
        return drape_fail_below(pin->model->ctx, pin->pointer, key,
                                "node %d is pinned twice, along different tracks or colliders", (int)local);
    if (!pin->model->pinned[node])
        pin->track_of_node[node] = pin->track;
    pin->model->pinned[node] = 1;
    pin->clamped[node] |= pin->def->clamp;
    pin->held[node] = 1;
    return DRAPE_OK;
}

/* A vector of the scene, of length 1; false if it is not given. */
static bool unit_vector(const double *given, double *unit)
{
    const double largest = fmax(fabs(given[0]), fmax(fabs(given[1]), fabs(given[2])));
    if (isnan(given[0]))
        return false;
    for (int k = 0; k < 3; k++)
        unit[k] = largest > 0 ? given[k] / largest : 0;
    const double length = vec3_norm(unit);
    for (int k = 0; k < 3 && length > 0; k++)
        unit[k] /= length;
    return true;
}

/* The directions in which the pin holds its nodes, if not in all. Along an axis of space they are exactly
 * the other two. */
static drape_status find_directions(pin_place *pin)
{
    const drape_pin_def *def = pin->def;
    double axis[3], *n = pin->direction[0];
    const bool normal = unit_vector(def->normal, n), line = unit_vector(def->axis, axis);
    drape_context *ctx = pin->model->ctx;
    pin->count = normal ? 1 : line ? 2 : 0;
    if (normal && line)
        return drape_fail_below(ctx, pin->pointer, "axis", "a pin has a normal or an axis, not both");
    if (pin->count > 0 && ((def->turn_count > 0 && !def->clamp) || def->attach))
        return drape_fail_below(
            ctx, pin->pointer, normal ? "normal" : "axis",
            "a pin that holds its nodes in some directions only may have a track, and turns with clamp, "
            "but no attach");
    if ((normal && vec3_norm(n) == 0) || (line && vec3_norm(axis) == 0))
        return drape_fail_below(ctx, pin->pointer, normal ? "normal" : "axis", "0 0 0 has no direction");
    if (!line)
        return DRAPE_OK;
    int least = 0;
    for (int k = 1; k < 3; k++)
        least = fabs(axis[k]) < fabs(axis[least]) ? k : least;
    memset(n, 0, 3 * sizeof *n);
    n[least] = 1;
    vec3_add_scaled(-axis[least], axis, n);
    unit_vector(n, n);
    vec3_cross(axis, n, pin->direction[1]);
    return DRAPE_OK;
}

static drape_status keep_track(pin_place *pin)
{
    drape_model *model = pin->model;
    drape_context *ctx = model->ctx;
    pin->track = -1;
    if (pin->def->turn_count == 0 && !isnan(pin->def->pivot[0]))
        return drape_fail_below(ctx, pin->pointer, "pivot",
                                "without turns there is nothing that turns about it");
    if (pin->def->attach && pin->def->key_count > 0)
        return drape_fail_below(ctx, pin->pointer, "attach",
                                "a pin is carried by a collider or moves along a track, not both");
    if (pin->def->turn_count > 0 && pin->def->attach)
        return drape_fail_below(ctx, pin->pointer, "turns",
                                "a pin is carried by a collider or turns about a pivot, not both");
    if (pin->def->attach)
        pin->track = model->track_count++; /* without keys: drape_compile_rides has its motion */
    if (pin->def->key_count == 0 && pin->def->turn_count == 0)
        return DRAPE_OK;
    pin->track = model->track_count++;
    drape_track *to = &model->tracks[pin->track];
    if (pin->def->key_count > 0)
        DRAPE_TRY(drape_compile_track(model, pin->pointer, pin->def->track, pin->def->key_count, to));
    if (pin->def->turn_count > 0)
        DRAPE_TRY(
            drape_compile_turns(model, pin->pointer, pin->def->turns, pin->def->turn_count, &to->turns));
    return DRAPE_OK;
}

/* Lists the nodes that the pin holds, and clears their marks for the next pin. */
static drape_status list_nodes(const pin_place *pin, drape_pin *to)
{
    const int32_t first = pin->cloth->first_node, count = pin->cloth->mesh.node_count;
    for (int32_t i = 0; i < count; i++)
        to->node_count += pin->held[first + i];
    to->node = drape_arena_take(&pin->model->arena, (size_t)to->node_count, sizeof *to->node);
    if (!to->node)
        return DRAPE_E_MEMORY;
    int32_t listed = 0;
    for (int32_t i = first; i < first + count; i++)
        if (pin->held[i])
            to->node[listed++] = i;
    memset(pin->held + first, 0, (size_t)count);
    return drape_check_cancel_after(pin->model->ctx, 8 * (size_t)count);
}

static drape_status pin_cloth(drape_model *model, const drape_scene_def *def, int32_t c, pin_place *pin)
{
    for (size_t p = 0; p < def->cloths[c].pin_count; p++) {
        drape_pin *to = &model->pins[model->pin_count++];
        to->cloth = c;
        to->clamps = def->cloths[c].pins[p].clamp;
        pin->cloth = &model->cloths[c];
        pin->def = &def->cloths[c].pins[p];
        snprintf(pin->pointer, sizeof pin->pointer, "/cloth/%d/pins/%zu", (int)c, p);
        DRAPE_TRY(drape_compile_name(model, pin->pointer, "pin", "pins of the cloth", pin->def->name,
                                     (int32_t)p, &to->name, sizeof *to));
        DRAPE_TRY(find_directions(pin));
        to->slides = pin->count > 0;
        DRAPE_TRY(keep_track(pin));
        to->turn = to->clamps && pin->def->turn_count > 0 ? pin->track : -1;
        if (to->turn >= 0)
            model->tracks[to->turn].clamps = true;
        DRAPE_TRY(drape_select_nodes(&(drape_selection){.ctx = model->ctx,
                                                        .pointer = pin->pointer,
                                                        .form = &drape_form_pin,
                                                        .mesh = &pin->cloth->mesh,
                                                        DRAPE_SELECTED_BY(pin->def),
                                                        .taken = pin->held + pin->cloth->first_node,
                                                        .take = take_node,
                                                        .user = pin}));
        DRAPE_TRY(list_nodes(pin, to));
        if (pin->track < 0)
            continue;
        double *pivot = model->tracks[pin->track].pivot;
        for (int32_t i = 0; i < to->node_count; i++)
            vec3_add_scaled(1.0 / to->node_count, model->start + 3 * (size_t)to->node[i], pivot);
        if (!isnan(pin->def->pivot[0]))
            memcpy(pivot, pin->def->pivot, 3 * sizeof *pivot);
    }
    return DRAPE_OK;
}

/* The track of a node that is held in three directions: linear between the keys of all its tracks. */
static drape_status join_tracks(drape_model *model, const holding *all, drape_track *track)
{
    double d[3];
    for (double t = displace(model, all, -INFINITY, d); t < INFINITY; t = displace(model, all, t, d))
        track->key_count++;
    track->keys = drape_arena_take(&model->arena, track->key_count, sizeof *track->keys);
    if (!track->keys)
        return DRAPE_E_MEMORY;
    double t = displace(model, all, -INFINITY, d);
    for (size_t k = 0; k < track->key_count; k++) {
        track->keys[k].time = t;
        t = displace(model, all, t, track->keys[k].displacement);
    }
    return drape_check_cancel_after(model->ctx, 128 * track->key_count);
}

/* The first pin that holds a node in all directions. */
static const drape_pin *full_pin_of(const drape_model *model, int32_t node)
{
    for (const drape_pin *pin = model->pins;; pin++)
        for (int32_t i = 0; !pin->slides && i < pin->node_count; i++)
            if (pin->node[i] == node)
                return pin;
}

/* A node may be held by a pin in all directions and by other pins along some: these pins must move alike, but
 * for a pin that turns or that a collider carries, whose motion counts alone. */
static drape_status check_both(const drape_model *model, const pin_place *pin)
{
    for (int32_t node = 0; node < model->node_count; node++) {
        const holding *all = &pin->all[node];
        const int32_t track = pin->track_of_node[node];
        DRAPE_TRY(drape_check_cancel_after(model->ctx, 8));
        if (!model->pinned[node] || !only_displaces(model, track))
            continue;
        for (int i = 0; i < all->count; i++) {
            const drape_pin *first = &model->pins[all->pin[i]];
            if (moves_alike(model, all->normal[i], track, all))
                continue;
            while (first > model->pins && first[-1].cloth == first->cloth)
                first--;
            const char *at = DRAPE_FORMAT("/cloth/%d/pins/%d", (int)first->cloth,
                                          (int)(&model->pins[all->pin[i]] - first));
            return refuse_motions(model, at, node, all->normal[i], full_pin_of(model, node));
        }
    }
    return DRAPE_OK;
}

/* Nodes that are held in three directions are pinned: with a track, if one of them moves. */
static drape_status pin_held(drape_model *model, const pin_place *pin)
{
    int32_t count = 0;
    for (int32_t i = 0; i < model->node_count; i++) {
        count += pin->all[i].count == 3 && !model->pinned[i] && moves(&pin->all[i]);
        if (pin->all[i].count == 3 && !moves(&pin->all[i]))
            model->pinned[i] = 1;
    }
    if (count == 0)
        return DRAPE_OK;
    const drape_track *before = model->tracks;
    model->tracks =
        drape_arena_take(&model->arena, (size_t)(model->track_count + count), sizeof *model->tracks);
    if (!model->tracks)
        return DRAPE_E_MEMORY;
    memcpy(model->tracks, before, (size_t)model->track_count * sizeof *before);
    for (int32_t i = 0; i < model->node_count; i++)
        if (pin->all[i].count == 3 && !model->pinned[i]) {
            model->pinned[i] = 1;
            pin->track_of_node[i] = model->track_count++;
            DRAPE_TRY(join_tracks(model, &pin->all[i], &model->tracks[pin->track_of_node[i]]));
        }
    return DRAPE_OK;
}

/* The other nodes that have directions are free nodes with supports, unless another pin holds them
 * altogether. */
static drape_status list_supports(drape_model *model, const pin_place *pin)
{
    for (int pass = 0; pass < 2; pass++) {
        int32_t count = 0;
        for (int32_t i = 0; i < model->node_count; i++) {
            const holding *all = &pin->all[i];
            if (all->count == 0 || model->pinned[i])
                continue;
            if (pass == 1) {
                drape_support *to = &model->supports[count];
                double dual[3][3];
                *to = (drape_support){.node = i, .count = all->count};
                memcpy(to->direction, all->direction, sizeof to->direction);
                memcpy(to->normal, all->normal, sizeof to->normal);
                memcpy(to->track, all->track, sizeof to->track);
                find_duals(all, dual);
                memcpy(to->dual, dual, sizeof to->dual);
                model->supports_move |= moves(all);
            }
            count++;
        }
        if (pass == 0)
            model->supports = drape_arena_take(&model->arena, (size_t)count, sizeof *model->supports);
        if (!model->supports)
            return DRAPE_E_MEMORY;
        model->support_count = count;
    }
    return DRAPE_OK;
}

/* Finds the edges that keep the direction of the sheet across them. */
static drape_status clamp_edges(drape_model *model, const uint8_t *clamped)
{
    for (int32_t c = 0; c < model->cloth_count; c++) {
        drape_cloth *cloth = &model->cloths[c];
        const uint8_t *of_node = clamped + cloth->first_node;
        cloth->edge_clamped =
            drape_arena_take(&model->arena, (size_t)cloth->mesh.edge_count, sizeof *cloth->edge_clamped);
        if (!cloth->edge_clamped)
            return DRAPE_E_MEMORY;
        for (int32_t e = 0; e < cloth->mesh.edge_count; e++) {
            const int32_t *end = cloth->mesh.edge + 2 * (size_t)e;
            cloth->edge_clamped[e] = of_node[end[0]] && of_node[end[1]];
        }
    }
    return DRAPE_OK;
}

enum { UNKNOWN = -2 }; /* the turns of an edge */

static drape_status refuse_turns(const drape_model *model, int32_t c, const int32_t *end)
{
    const char *at = DRAPE_FORMAT("/cloth/%d/pins", (int)c);
    return drape_refuse(model->ctx, at,
                        "pins that turn differently clamp the edge between nodes %d and %d; let one pin "
                        "clamp it",
                        (int)end[0], (int)end[1]);
}

/* Gives the edges between nodes of a pin that clamps its turns. held: (node_count) 0. */
static drape_status turn_edges_of(drape_model *model, const drape_pin *pin, uint8_t *held)
{
    const drape_cloth *cloth = &model->cloths[pin->cloth];
    const uint8_t *of_node = held + cloth->first_node;
    DRAPE_TRY(drape_check_cancel_after(model->ctx, 4 * (size_t)cloth->mesh.edge_count));
    for (int32_t i = 0; i < pin->node_count; i++)
        held[pin->node[i]] = 1;
    for (int32_t e = 0; e < cloth->mesh.edge_count; e++) {
        const int32_t *end = cloth->mesh.edge + 2 * (size_t)e;
        if (!of_node[end[0]] || !of_node[end[1]])
            continue;
        if (cloth->edge_turn[e] != UNKNOWN && cloth->edge_turn[e] != pin->turn)
            return refuse_turns(model, pin->cloth, end);
        cloth->edge_turn[e] = pin->turn;
    }
    for (int32_t i = 0; i < pin->node_count; i++)
        held[pin->node[i]] = 0;
    return DRAPE_OK;
}

/* Finds the turns that clamped edges follow. */
static drape_status turn_edges(drape_model *model, uint8_t *held)
{
    for (int32_t p = 0; p < model->pin_count; p++) {
        drape_cloth *cloth = &model->cloths[model->pins[p].cloth];
        if (model->pins[p].turn < 0 || cloth->edge_turn)
            continue;
        cloth->edge_turn =
            drape_arena_take(&model->arena, (size_t)cloth->mesh.edge_count, sizeof *cloth->edge_turn);
        if (!cloth->edge_turn)
            return DRAPE_E_MEMORY;
        for (int32_t e = 0; e < cloth->mesh.edge_count; e++)
            cloth->edge_turn[e] = UNKNOWN;
    }
    for (int32_t p = 0; p < model->pin_count; p++)
        if (model->pins[p].clamps && model->cloths[model->pins[p].cloth].edge_turn)
            DRAPE_TRY(turn_edges_of(model, &model->pins[p], held));
    for (int32_t c = 0; c < model->cloth_count; c++) {
        const drape_cloth *cloth = &model->cloths[c];
        for (int32_t e = 0; cloth->edge_turn && e < cloth->mesh.edge_count; e++)
            if (cloth->edge_clamped[e] && cloth->edge_turn[e] == UNKNOWN)
                return refuse_turns(model, c, cloth->mesh.edge + 2 * (size_t)e);
    }
    return DRAPE_OK;
}

drape_status drape_compile_number_nodes(drape_model *model, const int32_t *track_of_node)
{
    for (int32_t i = 0; i < model->node_count; i++) {
        model->free_of_node[i] = model->pinned[i] ? -1 : model->free_count++;
        model->moved_count += track_of_node[i] >= 0;
    }
    model->block_count = model->free_count;
    model->node_of_free =
        drape_arena_take(&model->arena, (size_t)model->free_count, sizeof *model->node_of_free);
    model->moved_node =
        drape_arena_take(&model->arena, (size_t)model->moved_count, sizeof *model->moved_node);
    model->moved_track =
        drape_arena_take(&model->arena, (size_t)model->moved_count, sizeof *model->moved_track);
    DRAPE_TRY(drape_arena_status(&model->arena));
    int32_t moved = 0;
    for (int32_t i = 0; i < model->node_count; i++) {
        if (model->free_of_node[i] >= 0)
            model->node_of_free[model->free_of_node[i]] = i;
        if (track_of_node[i] >= 0) {
            model->moved_node[moved] = i;
            model->moved_track[moved++] = track_of_node[i];
        }
    }
    return DRAPE_OK;
}

drape_status drape_compile_pins(drape_model *model, const drape_scene_def *def)
{
    size_t pin_count = 0, nodes = (size_t)model->node_count;
    for (size_t c = 0; c < def->cloth_count; c++)
        pin_count += def->cloths[c].pin_count;
    model->tracks = drape_arena_take(&model->arena, pin_count, sizeof *model->tracks);
    model->pins = drape_arena_take(&model->arena, pin_count, sizeof *model->pins);
    model->pinned = drape_arena_take(&model->arena, nodes, sizeof *model->pinned);
    model->free_of_node = drape_arena_take(&model->arena, nodes, sizeof *model->free_of_node);
    drape_arena *scratch = &model->scratch;
    pin_place pin = {.model = model,
                     .track_of_node = drape_arena_take(scratch, nodes, sizeof *pin.track_of_node),
                     .clamped = drape_arena_take(scratch, nodes, sizeof *pin.clamped),
                     .held = drape_arena_take(scratch, nodes, sizeof *pin.held),
                     .all = drape_arena_take(scratch, nodes, sizeof *pin.all)};
    DRAPE_TRY(drape_arena_status(&model->arena));
    DRAPE_TRY(drape_arena_status(scratch));
    memset(pin.track_of_node, 0xff, nodes * sizeof *pin.track_of_node); /* all -1 */
    for (int32_t c = 0; c < model->cloth_count; c++)
        DRAPE_TRY(pin_cloth(model, def, c, &pin));
    DRAPE_TRY(check_both(model, &pin));
    DRAPE_TRY(pin_held(model, &pin));
    DRAPE_TRY(list_supports(model, &pin));
    DRAPE_TRY(clamp_edges(model, pin.clamped));
    DRAPE_TRY(turn_edges(model, pin.held));
    return drape_compile_number_nodes(model, pin.track_of_node);
}
