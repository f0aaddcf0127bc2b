/* motion.c: see motion.h. */
#include "model/motion.h"

#include "base/finite.h"
#include "model/track.h"

#include <math.h>
#include <string.h>

/* ---- Creation ---- */

static size_t pinned_count(const drape_model *m)
{
    return (size_t)(m->node_count - m->free_count);
}

static void take_tracks(drape_motion *motion)
{
    const drape_model *m = motion->model;
    motion->moved_count = m->moved_count;
    for (int32_t i = 0; i < m->node_count; i++)
        motion->place[i] = -1;
    for (int32_t i = 0; i < m->moved_count; i++) {
        motion->moved_node[i] = m->moved_node[i];
        motion->moved_track[i] = m->moved_track[i];
        motion->place[m->moved_node[i]] = i;
    }
}

drape_status drape_motion_create(drape_arena *arena, const drape_model *model, drape_motion **out)
{
    const size_t pins = pinned_count(model);
    drape_motion *motion = *out = drape_arena_take(arena, 1, sizeof *motion);
    if (!motion)
        return DRAPE_E_MEMORY;
    motion->model = model;
    motion->moved_node = drape_arena_take(arena, pins, sizeof *motion->moved_node);
    motion->moved_track = drape_arena_take(arena, pins, sizeof *motion->moved_track);
    motion->place = drape_arena_take(arena, (size_t)model->node_count, sizeof *motion->place);
    motion->pin_path = drape_arena_take(arena, pins, sizeof *motion->pin_path);
    motion->collider_path =
        drape_arena_take(arena, (size_t)model->collider_count, sizeof *motion->collider_path);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    take_tracks(motion);
    return DRAPE_OK;
}

/* ---- Paths ---- */

/* Cubic Hermite interpolation at s = (t - t0)/(t1 - t0) of the path. */
static void path_displacement(const drape_path *w, double t, double x[3])
{
    if (t <= w->t[0] || t >= w->t[1]) {
        memcpy(x, w->x[t >= w->t[1]], 3 * sizeof *x);
        return;
    }
    double h = w->t[1] - w->t[0], s = (t - w->t[0]) / h;
    double rise = s * s * (3 - 2 * s), leave = s * (1 - s) * (1 - s), arrive = s * s * (s - 1);
    for (int k = 0; k < 3; k++)
        x[k] = w->x[0][k] + rise * (w->x[1][k] - w->x[0][k]) + h * (leave * w->v[0][k] + arrive * w->v[1][k]);
}

static void path_velocity(const drape_path *w, double t, double within, double v[3])
{
    memset(v, 0, 3 * sizeof *v);
    if (within < w->t[0] || within >= w->t[1])
        return;
    double h = w->t[1] - w->t[0], s = (t - w->t[0]) / h;
    for (int k = 0; k < 3; k++)
        v[k] = 6 * s * (1 - s) * (w->x[1][k] - w->x[0][k]) / h + (1 - s) * (1 - 3 * s) * w->v[0][k] +
               s * (3 * s - 2) * w->v[1][k];
}

static bool rests(const double v[3])
{
    return v[0] == 0 && v[1] == 0 && v[2] == 0;
}

/* ---- Tracks and paths ---- */

static void displacement_of(const drape_track *track, const drape_path *path, double t, double x[3])
{
    if (path->given)
        path_displacement(path, t, x);
    else if (track && track->key_count > 0)
        drape_track_displacement(track->keys, track->key_count, t, x);
    else
        memset(x, 0, 3 * sizeof *x);
}

static void velocity_of(const drape_track *track, const drape_path *path, double t, double within,
                        double v[3])
{
    if (path->given)
        path_velocity(path, t, within, v);
    else if (track && track->key_count > 0)
        drape_track_velocity(track->keys, track->key_count, within, v);
    else
        memset(v, 0, 3 * sizeof *v);
}

/* The end of a path is a kink unless it comes to rest there; its beginning is one unless it continues
 * smoothly. */
static double next_kink_of(const drape_track *track, const drape_path *path, double t, double end)
{
    for (int i = 0; path->given && i < 2; i++)
        if (path->t[i] > t && path->t[i] < end && !(i == 0 ? path->smooth : rests(path->v[1])))
            end = path->t[i];
    for (size_t i = 0; !path->given && track && i < track->key_count; i++)
        if (track->keys[i].time > t && track->keys[i].time < end)
            end = track->keys[i].time;
    return end;
}

static bool at_kink_of(const drape_track *track, const drape_path *path, double t)
{
    if (path->given)
        return (t == path->t[0] && !path->smooth) || (t == path->t[1] && !rests(path->v[1]));
    for (size_t i = 0; track && i < track->key_count; i++)
        if (track->keys[i].time == t)
            return true;
    return false;
}

/* Writes the velocity that leads to the position at t. Returns whether it is known: it is not at a key of a
 * track, nor where the host replaces a path at the moment at which it began. */
static bool leading_velocity(const drape_track *track, const drape_path *path, double t, double v[3])
{
    if (path->given && (t == path->t[0] || t == path->t[1])) {
        memcpy(v, path->v[t == path->t[1]], 3 * sizeof *v);
        return t == path->t[1] || path->smooth;
    }
    velocity_of(track, path, t, t, v);
    return path->given || !track || track->key_count == 0;
}

static void send(const drape_track *track, drape_path *path, double t, double span, const double from[3],
                 const double to[3], const double *v)
{
    drape_path next = {.given = true, .t = {t, t + span}};
    memcpy(next.x[0], from, sizeof next.x[0]);
    memcpy(next.x[1], to, sizeof next.x[1]);
    next.smooth = leading_velocity(track, path, t, next.v[0]) && v;
    if (v)
        memcpy(next.v[1], v, sizeof next.v[1]);
    for (int k = 0; !v && k < 3; k++)
        next.v[0][k] = next.v[1][k] = (to[k] - from[k]) / span;
    *path = next;
}

/* ---- Pins ---- */

static const drape_track *pin_track(const drape_motion *motion, int32_t i)
{
    return motion->moved_track[i] >= 0 ? &motion->model->tracks[motion->moved_track[i]] : NULL;
}

/* Paths of pins hold positions, not displacements, so that a pin reaches exactly the position that the host
 * gave. */
static void place_pin(const drape_motion *motion, int32_t i, double t, double x[3])
{
    const double *rest = motion->model->rest + 3 * (size_t)motion->moved_node[i];
    displacement_of(pin_track(motion, i), &motion->pin_path[i], t, x);
    for (int k = 0; !motion->pin_path[i].given && k < 3; k++)
        x[k] = rest[k] + x[k];
}

void drape_motion_place_pins(const drape_motion *motion, double t, double *x)
{
    for (int32_t i = 0; i < motion->moved_count; i++)
        place_pin(motion, i, t, x + 3 * (size_t)motion->moved_node[i]);
}

void drape_motion_pin_velocity(const drape_motion *motion, int32_t i, double t, double within, double v[3])
{
    velocity_of(pin_track(motion, i), &motion->pin_path[i], t, within, v);
}

/* Returns the number of a pin among the moved ones, adding it to them if necessary. */
static int32_t find_place(drape_motion *motion, int32_t node)
{
    int32_t i = motion->place[node];
    if (i < 0) {
        i = motion->place[node] = motion->moved_count++;
        motion->moved_node[i] = node;
        motion->moved_track[i] = -1;
    }
    return i;
}

void drape_motion_send_pin(drape_motion *motion, int32_t node, double t, double span, const double x[3],
                           const double *v)
{
    int32_t i = find_place(motion, node);
    double from[3];
    place_pin(motion, i, t, from);
    send(pin_track(motion, i), &motion->pin_path[i], t, span, from, x, v);
}

void drape_motion_hold_pins(drape_motion *motion, const double *x)
{
    for (int32_t i = 0; i < motion->moved_count; i++) {
        drape_path *path = &motion->pin_path[i];
        if (!path->given)
            continue;
        *path = (drape_path){.given = true, .smooth = true};
        memcpy(path->x[0], x + 3 * (size_t)motion->moved_node[i], sizeof path->x[0]);
        memcpy(path->x[1], path->x[0], sizeof path->x[1]);
    }
}

/* ---- Colliders ---- */

bool drape_motion_moves_collider(const drape_motion *motion, int32_t collider)
{
    return motion->collider_path[collider].given || motion->model->colliders[collider].track.key_count > 0;
}

void drape_motion_collider(const drape_motion *motion, int32_t collider, double t, double displacement[3])
{
    displacement_of(&motion->model->colliders[collider].track, &motion->collider_path[collider], t,
                    displacement);
}

void drape_motion_collider_velocity(const drape_motion *motion, int32_t collider, double t, double within,
                                    double v[3])
{
    velocity_of(&motion->model->colliders[collider].track, &motion->collider_path[collider], t, within, v);
}

void drape_motion_send_collider(drape_motion *motion, int32_t collider, double t, double span,
                                const double x[3], const double *v)
{
    double from[3];
    drape_motion_collider(motion, collider, t, from);
    send(&motion->model->colliders[collider].track, &motion->collider_path[collider], t, span, from, x, v);
}

/* ---- Checkpoints ---- */

static bool is_path(const drape_path *path)
{
    bool good = isfinite(path->t[0]) && isfinite(path->t[1]) && path->t[0] <= path->t[1];
    for (int i = 0; i < 2; i++)
        good = good && drape_all_finite(path->x[i], 3) && drape_all_finite(path->v[i], 3);
    return good;
}

static void archive_path(drape_path *path, drape_archive *a)
{
    drape_archive_bool(a, &path->given);
    if (!path->given || !drape_archive_good(a))
        return;
    drape_archive_bool(a, &path->smooth);
    drape_archive_doubles(a, path->t, 2);
    for (int i = 0; i < 2; i++) {
        drape_archive_doubles(a, path->x[i], 3);
        drape_archive_doubles(a, path->v[i], 3);
    }
    if (drape_archive_has_read(a) && !is_path(path))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has an invalid path");
}

/* Pins with a track come first, in the model's order, then the others in the order in which the host moved
 * them. */
static void archive_place(drape_motion *motion, int32_t i, drape_archive *a)
{
    int32_t node = a->reading ? -1 : motion->moved_node[i];
    drape_archive_int32(a, &node);
    if (!drape_archive_has_read(a))
        return;
    bool good = node >= 0 && node < motion->model->node_count && motion->model->pinned[node] &&
                (i < motion->model->moved_count ? motion->place[node] == i : motion->place[node] < 0);
    if (good)
        find_place(motion, node);
    else
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint moves node %d, which is not pinned", (int)node);
}

void drape_motion_archive(drape_motion *motion, drape_archive *a)
{
    int32_t count = motion->moved_count;
    drape_archive_mark(a, "motion");
    drape_archive_int32(a, &count);
    if (drape_archive_good(a) &&
        (count < motion->model->moved_count || count > (int32_t)pinned_count(motion->model)))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint moves %d pins", (int)count);
    for (int32_t i = 0; i < count && drape_archive_good(a); i++) {
        archive_place(motion, i, a);
        if (drape_archive_good(a))
            archive_path(&motion->pin_path[i], a);
    }
    for (int32_t c = 0; c < motion->model->collider_count && drape_archive_good(a); c++)
        archive_path(&motion->collider_path[c], a);
}

/* ---- All pins and colliders ---- */

double drape_motion_next_kink(const drape_motion *motion, double t, double end)
{
    for (int32_t i = 0; i < motion->moved_count; i++)
        end = next_kink_of(pin_track(motion, i), &motion->pin_path[i], t, end);
    for (int32_t c = 0; c < motion->model->collider_count; c++)
        end = next_kink_of(&motion->model->colliders[c].track, &motion->collider_path[c], t, end);
    return end;
}

bool drape_motion_at_kink(const drape_motion *motion, double t)
{
    bool found = false;
    for (int32_t i = 0; !found && i < motion->moved_count; i++)
        found = at_kink_of(pin_track(motion, i), &motion->pin_path[i], t);
    for (int32_t c = 0; !found && c < motion->model->collider_count; c++)
        found = at_kink_of(&motion->model->colliders[c].track, &motion->collider_path[c], t);
    return found;
}
