/*
 * place.c: cloth with its pins, and colliders, as a host places them elsewhere by a rigid motion. Nothing is
 * strained by it, so nothing is left to calm down. All is checked before anything changes. The new state is
 * built in the one that the next attempt would overwrite.
 */
#include "host/place.h"

#include "base/def.h"
#include "base/rotation.h"
#include "mesh/mesh.h"
#include "sim/rides.h"

#include <math.h>
#include <string.h>

/* The def has had these members since its first version. */
#define MIN_SIZE sizeof(drape_place_def)

void drape_place_def_init(drape_place_def *def, size_t struct_size)
{
    const drape_place_def defaults = {.struct_size = struct_size, .cloth_count = -1, .collider_count = -1};
    drape_def_fill(def, struct_size, &defaults, sizeof defaults);
}

/* ---- What is placed ---- */

static bool has(const drape_place_list *list, int32_t index)
{
    bool found = list->count < 0;
    for (int32_t i = 0; i < list->count && !found; i++)
        found = list->items[i] == index;
    return found;
}

static drape_status check_list(const drape_sim *sim, const char *what, const drape_place_list *list,
                               int32_t there)
{
    if (list->count < -1)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "drape_sim_place: %s_count = %d; it is -1, for all, or more", what,
                          (int)list->count);
    if (list->count > 0 && !list->items)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_place: %d %ss, but no list of them",
                          (int)list->count, what);
    for (int32_t i = 0; i < list->count; i++)
        if (list->items[i] < 0 || list->items[i] >= there)
            return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_place: %s %d; the model has %d", what,
                              (int)list->items[i], (int)there);
    return DRAPE_OK;
}

/* The same motion as one of the displacement of a collider's pivot. */
static drape_placement place_displacement(const drape_sim *sim, int32_t collider, const drape_placement *by)
{
    const double *pivot = sim->model->colliders[collider].pivot;
    drape_placement own = *by;
    double turned[3];
    if (drape_rotation_is_none(by->turn))
        return own;
    drape_placement_turn(by, pivot, turned);
    for (int k = 0; k < 3; k++)
        own.shift[k] += turned[k] - pivot[k];
    return own;
}

static bool is_far(const double *x)
{
    return !(fabs(x[0]) <= DRAPE_MOST && fabs(x[1]) <= DRAPE_MOST && fabs(x[2]) <= DRAPE_MOST);
}

static drape_status check_colliders(const drape_sim *sim, const drape_place_list *colliders,
                                    const drape_placement *by)
{
    for (int32_t c = 0; c < sim->model->collider_count; c++) {
        double at[3];
        if (!has(colliders, c))
            continue;
        const drape_placement own = place_displacement(sim, c, by);
        drape_motion_collider(drape_system_motion(sim->system), c, drape_sim_state(sim)->t, at);
        drape_placement_move(&own, at, at);
        if (is_far(at))
            return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_place: %s would be beyond %g m",
                              sim->model->colliders[c].name, DRAPE_MOST);
    }
    return DRAPE_OK;
}

static drape_status check_nodes(const drape_sim *sim, const drape_place_list *cloths,
                                const drape_placement *by)
{
    const drape_model *m = sim->model;
    const double *now = drape_sim_state(sim)->x;
    for (int32_t c = 0; c < m->cloth_count; c++) {
        const drape_cloth *cloth = &m->cloths[c];
        for (int32_t i = 0; has(cloths, c) && i < cloth->mesh.node_count; i++) {
            double x[3];
            drape_placement_move(by, now + 3 * (size_t)(cloth->first_node + i), x);
            if (is_far(x))
                return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                                  "drape_sim_place: node %d of %s would be beyond %g m", (int)i, cloth->name,
                                  DRAPE_MOST);
        }
    }
    return DRAPE_OK;
}

drape_status drape_sim_check_place(const drape_sim *sim, const drape_place_list *cloths,
                                   const drape_place_list *colliders, const drape_placement *by)
{
    const drape_status status = check_colliders(sim, colliders, by);
    return status ? status : check_nodes(sim, cloths, by);
}

/* ---- Placing ---- */

static void place_nodes(const drape_sim *sim, const drape_place_list *cloths, const drape_placement *by,
                        bool stop, drape_state *to)
{
    const drape_model *m = sim->model;
    const drape_state *now = drape_sim_state(sim);
    const size_t n = 3 * (size_t)m->node_count;
    to->t = now->t;
    memcpy(to->x, now->x, n * sizeof *to->x);
    memcpy(to->v, now->v, n * sizeof *to->v);
    memcpy(to->internal, now->internal, (size_t)m->internal_count * sizeof *to->internal);
    for (int32_t c = 0; c < m->cloth_count; c++) {
        const drape_cloth *cloth = &m->cloths[c];
        for (int32_t i = 0; has(cloths, c) && i < cloth->mesh.node_count; i++) {
            double *x = to->x + 3 * (size_t)(cloth->first_node + i),
                   *v = to->v + 3 * (size_t)(cloth->first_node + i);
            drape_placement_move(by, x, x);
            drape_placement_turn(by, v, v);
            if (stop)
                memset(v, 0, 3 * sizeof *v);
        }
    }
}

static void place_motion(drape_sim *sim, const drape_place_list *cloths, const drape_place_list *colliders,
                         const drape_placement *by)
{
    drape_motion *motion = drape_system_steer(sim->system);
    for (int32_t c = 0; c < sim->model->cloth_count; c++)
        if (has(cloths, c))
            drape_motion_place_cloth(motion, c, by);
    for (int32_t c = 0; c < sim->model->collider_count; c++) {
        const drape_placement own = place_displacement(sim, c, by);
        if (has(colliders, c))
            drape_motion_place_collider(motion, c, &own);
    }
}

drape_status drape_sim_place_parts(drape_sim *sim, const drape_place_list *cloths,
                                   const drape_place_list *colliders, const drape_placement *by, bool stop)
{
    drape_state *next = &sim->states[sim->next];
    const drape_status status = drape_sim_check_place(sim, cloths, colliders, by);
    if (status)
        return status;
    const drape_energy before = drape_sim_account(sim);
    place_nodes(sim, cloths, by, stop, next);
    /* Springs by which a host drags nodes go with them. */
    drape_drag_springs springs = *drape_system_drag_springs(sim->system);
    for (int32_t i = 0; i < springs.count; i++)
        if (has(cloths, drape_model_cloth_of(sim->model, springs.spring[i].node)))
            drape_placement_move(by, springs.spring[i].target, springs.spring[i].target);
    drape_system_set_drag_springs(sim->system, &springs);
    place_motion(sim, cloths, colliders, by);
    sim->next = sim->now;
    sim->now = (int)(next - sim->states);
    drape_sim_forget_past(sim);
    drape_sim_shift_energy(sim, &before, DRAPE_BY_HOST);
    return DRAPE_OK;
}

/* ---- For hosts ---- */

static drape_status read_def(const drape_sim *sim, const drape_place_def *given, drape_place_def *def)
{
    drape_place_def_init(def, sizeof *def);
    if (!given)
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT, "drape_sim_place: the def is NULL");
    if (!drape_def_fits(given->struct_size, MIN_SIZE, sizeof *def))
        return drape_fail(
            sim->ctx, DRAPE_E_VERSION,
            "the place def was not initialised by drape_place_def_init of this version: struct_size %zu",
            given->struct_size);
    memcpy(def, given, given->struct_size);
    if (def->rotate[3] != 0 && def->rotate[0] == 0 && def->rotate[1] == 0 && def->rotate[2] == 0)
        return drape_fail(
            sim->ctx, DRAPE_E_ARGUMENT,
            "drape_sim_place: the axis of a rotation by %g degrees is 0 0 0; it must not be zero",
            def->rotate[3]);
    if (!isfinite(def->rotate[3]) || is_far(def->rotate) || is_far(def->center) || is_far(def->translate))
        return drape_fail(sim->ctx, DRAPE_E_ARGUMENT,
                          "drape_sim_place: rotation, center and translation must be finite, and within %g",
                          DRAPE_MOST);
    return DRAPE_OK;
}

/* R (x - c) + c + t. Without a rotation c cancels exactly. */
static drape_placement placement_of(const drape_place_def *def)
{
    drape_placement by = {.given = true};
    double matrix[3][3], turned[3];
    drape_rotation_matrix(def->rotate, matrix);
    memcpy(by.turn, matrix, sizeof by.turn);
    drape_placement_turn(&by, def->center, turned);
    for (int k = 0; k < 3; k++)
        by.shift[k] = def->translate[k] + (def->center[k] - turned[k]);
    return by;
}

drape_status drape_sim_place(drape_sim *sim, const drape_place_def *given)
{
    drape_place_def def;
    drape_status status = drape_sim_guard(sim, "drape_sim_place");
    if (!status)
        status = read_def(sim, given, &def);
    if (status)
        return status;
    const drape_place_list cloths = {def.cloths, def.cloth_count},
                           colliders = {def.colliders, def.collider_count};
    const drape_placement by = placement_of(&def);
    status = check_list(sim, "cloth", &cloths, sim->model->cloth_count);
    if (!status)
        status = check_list(sim, "collider", &colliders, sim->model->collider_count);
    if (!status)
        status = drape_sim_place_parts(sim, &cloths, &colliders, &by, def.stop);
    if (!status) {
        /* Pins whose cloth was placed without the collider that carries them, or that without them, stay
         * where they are, so that nothing is strained, and ride on from there. */
        const drape_motion *motion = drape_system_motion(sim->system);
        for (int32_t i = 0; i < motion->moved_count; i++) {
            const int32_t on = drape_motion_carrier(motion, i), node = motion->moved_node[i];
            if (on >= 0 && has(&colliders, on) != has(&cloths, drape_model_cloth_of(sim->model, node)))
                drape_sim_ride_on(sim, node);
        }
    }
    return status;
}
