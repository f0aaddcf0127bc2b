/* motion.c: see motion.h. */
#include "model/motion.h"

#include "base/finite.h"
#include "base/rotation.h"
#include "base/vec3.h"
#include "model/history.h"
#include "model/ride.h"
#include "model/track.h"

#include <float.h>
#include <math.h>
#include <string.h>

/* ---- Creation ---- */

static size_t pinned_count(const drape_model *m)
{
    return (size_t)(m->node_count - m->block_count);
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
    motion->ride = drape_arena_take(arena, pins, sizeof *motion->ride);
    motion->collider_path =
        drape_arena_take(arena, (size_t)model->collider_count, sizeof *motion->collider_path);
    motion->collider_turn =
        drape_arena_take(arena, (size_t)model->collider_count, sizeof *motion->collider_turn);
    motion->cloth_placed = drape_arena_take(arena, (size_t)model->cloth_count, sizeof *motion->cloth_placed);
    motion->collider_placed =
        drape_arena_take(arena, (size_t)model->collider_count, sizeof *motion->collider_placed);
    motion->deformation = drape_arena_take(arena, (size_t)model->collider_count, sizeof *motion->deformation);
    for (int32_t i = 0; motion->deformation && i < model->collider_count; i++)
        if (drape_deformation_create(arena, &model->colliders[i].frames, &motion->deformation[i]))
            return DRAPE_E_MEMORY;
    DRAPE_TRY(drape_arena_status(arena));
    motion->moved_count = model->moved_count;
    for (int32_t i = 0; i < model->node_count; i++)
        motion->place[i] = -1;
    for (int32_t i = 0; i < model->moved_count; i++) {
        motion->moved_node[i] = model->moved_node[i];
        motion->moved_track[i] = model->moved_track[i];
        motion->ride[i] = model->ride ? model->ride[model->moved_node[i]] : drape_ride_none();
        motion->place[model->moved_node[i]] = i;
    }
    return DRAPE_OK;
}

/* ---- Paths ---- */

static void path_displacement(const drape_path *path, double t, double x[3])
{
    drape_cubic_values(path->t, (const double *const[]){path->x[0], path->x[1]},
                       (const double *const[]){path->v[0], path->v[1]}, t, 3, x);
}

static void path_velocity(const drape_path *path, double t, double within, double v[3])
{
    drape_cubic_rates(path->t, (const double *const[]){path->x[0], path->x[1]},
                      (const double *const[]){path->v[0], path->v[1]}, t, within, 3, v);
}

static bool rests(const double v[3])
{
    return v[0] == 0 && v[1] == 0 && v[2] == 0;
}

/* ---- Placements ---- */

void drape_placement_turn(const drape_placement *by, const double x[3], double y[3])
{
    drape_rotation_turn(by->turn, x, y);
}

void drape_placement_move(const drape_placement *by, const double x[3], double y[3])
{
    drape_placement_turn(by, x, y);
    vec3_add_scaled(1, by->shift, y);
}

/* placed = by after placed */
static void compose(const drape_placement *by, drape_placement *placed)
{
    drape_placement both = *by;
    both.given = true;
    if (placed->given) {
        drape_placement_move(by, placed->shift, both.shift);
        drape_rotation_product(by->turn, placed->turn, both.turn);
    }
    *placed = both;
}

static void place_path(const drape_placement *by, drape_path *path)
{
    for (int i = 0; path->given && i < 2; i++) {
        drape_placement_move(by, path->x[i], path->x[i]);
        drape_placement_turn(by, path->v[i], path->v[i]);
    }
}

/* ---- Courses: tracks or paths ---- */

/* The motion of one pin or collider. A path of a host goes before a ride, and a ride before a track. */
typedef struct course {
    const drape_motion *motion;
    const drape_ride *ride;   /* NULL: of a pin that no collider carries, or of a collider */
    const drape_track *track; /* NULL: none */
    const drape_path *path;
    const drape_turn_path *turn; /* of a collider; NULL: of a pin, whose track turns it */
    const drape_turns *turns;
    const drape_placement *placed;
    const double *start; /* of a pin; NULL: displacements are asked for */
} course;

static void pose_of(const drape_motion *motion, int32_t collider, double t, double within, bool rates,
                    drape_collider_pose *pose);

/* Paths of pins hold positions, not displacements, so that a pin reaches exactly the position that the host
 * gave. */
static void position_on(const course *c, double t, double x[3])
{
    if (c->path->given) {
        path_displacement(c->path, t, x);
        return;
    }
    if (c->ride) {
        const drape_collider *collider = &c->motion->model->colliders[c->ride->collider];
        drape_collider_pose pose;
        double corner[9];
        pose_of(c->motion, c->ride->collider, t, t, false, &pose);
        memcpy(x, c->ride->own, 3 * sizeof *x);
        if (c->ride->triangle >= 0) {
            drape_deformation_corners(&c->motion->deformation[c->ride->collider],
                                      collider->shape.triangle + 3 * (size_t)c->ride->triangle, t, corner);
            drape_ride_point(c->ride, corner, x);
        }
        drape_pose_point(&pose, x, x);
        return;
    }
    memset(x, 0, 3 * sizeof *x);
    if (c->start && c->track)
        drape_track_point(c->track, c->start, t, x);
    else if (c->start)
        memcpy(x, c->start, 3 * sizeof *x);
    else if (c->track && c->track->key_count > 0)
        drape_track_displacement(c->track->keys, c->track->key_count, t, x);
    if (c->placed->given)
        drape_placement_move(c->placed, x, x);
}

static void velocity_on(const course *c, double t, double within, double v[3])
{
    if (c->path->given) {
        path_velocity(c->path, t, within, v);
        return;
    }
    if (c->ride) {
        const drape_collider *collider = &c->motion->model->colliders[c->ride->collider];
        drape_collider_pose pose;
        double corner[9], rate[9], own[3], own_velocity[3] = {0};
        drape_motion_pose(c->motion, c->ride->collider, t, within, &pose);
        memcpy(own, c->ride->own, sizeof own);
        if (c->ride->triangle >= 0) {
            const int32_t *triangle = collider->shape.triangle + 3 * (size_t)c->ride->triangle;
            drape_deformation_corners(&c->motion->deformation[c->ride->collider], triangle, t, corner);
            drape_deformation_corner_velocities(&c->motion->deformation[c->ride->collider], triangle, t,
                                                within, rate);
            drape_ride_point(c->ride, corner, own);
            drape_ride_velocity(c->ride, corner, rate, own_velocity);
        }
        drape_pose_point_velocity(&pose, own, own_velocity, v);
        return;
    }
    memset(v, 0, 3 * sizeof *v);
    if (c->start && c->track)
        drape_track_point_velocity(c->track, c->start, t, within, v);
    else if (c->track && c->track->key_count > 0)
        drape_track_velocity(c->track->keys, c->track->key_count, within, v);
    if (c->placed->given)
        drape_placement_turn(c->placed, v, v);
}

/* The rotation vector of a path at time t, and its rate. */
static void turn_vector(const course *c, double t, double within, double turn[3], double rate[3])
{
    drape_path cubic = {.t = {c->path->t[0], c->path->t[1]}};
    memcpy(cubic.x[1], c->turn->turn, sizeof cubic.x[1]);
    memcpy(cubic.v, c->turn->rate, sizeof cubic.v);
    path_displacement(&cubic, t, turn);
    path_velocity(&cubic, t, within, rate);
}

static void rotation_on(const course *c, double t, double rotation[9])
{
    double turn[3], rate[3], further[9], track[9];
    if (c->path->given) {
        turn_vector(c, t, t, turn, rate);
        drape_rotation_exp(turn, further);
        drape_rotation_product(further, c->turn->from, rotation);
        return;
    }
    drape_turns_rotation(c->turns, t, rotation);
    if (!c->placed->given)
        return;
    memcpy(track, rotation, sizeof track);
    drape_rotation_product(c->placed->turn, track, rotation);
}

static void spin_on(const course *c, double t, double within, double w[3])
{
    double turn[3], rate[3];
    if (c->path->given) {
        turn_vector(c, t, within, turn, rate);
        drape_rotation_velocity(turn, rate, w);
        return;
    }
    drape_turns_velocity(c->turns, within, w);
    if (c->placed->given)
        drape_placement_turn(c->placed, w, w);
}

/* Looks for the first kink after t and before `end`, which it becomes, and for one at t. */
typedef struct kink_search {
    double t, end;
    bool at;
} kink_search;

static void meet_kink(kink_search *s, double time)
{
    s->at = s->at || time == s->t;
    if (time > s->t && time < s->end)
        s->end = time;
}

/* A path begins with a kink unless it continues the motion before it smoothly, and ends with one unless it
 * comes to rest. A ride has the kinks of its collider, and one where it begins. */
static void meet_kinks(const course *c, kink_search *s)
{
    const drape_path *path = c->path;
    if (path->given) {
        if (!path->smooth)
            meet_kink(s, path->t[0]);
        if (!(rests(c->path->v[1]) && (!c->turn || rests(c->turn->rate[1]))))
            meet_kink(s, path->t[1]);
    } else if (c->ride) {
        s->at = s->at || c->ride->since == s->t;
    } else {
        for (size_t i = 0; c->track && i < c->track->key_count; i++)
            meet_kink(s, c->track->keys[i].time);
        for (size_t i = 0; c->turns && i < c->turns->key_count; i++)
            meet_kink(s, c->turns->keys[i].time);
    }
}

/* Writes the velocity that leads to the position at t. Returns whether it is known: it is not at a key of a
 * track, nor where the host replaces a path at the moment at which it began. */
static bool leading_velocity(const course *c, double t, double v[3])
{
    const drape_path *path = c->path;
    if (path->given && (t == path->t[0] || drape_has_arrived(path->t, t))) {
        memcpy(v, path->v[drape_has_arrived(path->t, t)], 3 * sizeof *v);
        return drape_has_arrived(path->t, t) || path->smooth;
    }
    if (!path->given && c->ride) { /* on the motion of its collider before t */
        velocity_on(c, t, t > 0 ? t * (1 - DBL_EPSILON) : -1, v);
        return false;
    }
    velocity_on(c, t, t, v);
    return path->given || !c->track || !drape_track_moves(c->track);
}

/* The same for the angular velocity. */
static bool leading_spin(const course *c, double t, double w[3])
{
    const drape_path *path = c->path;
    double turn[3], rate[3];
    if (!path->given || !drape_has_arrived(path->t, t)) {
        spin_on(c, t, t, w);
        return path->given ? t != path->t[0] || path->smooth : c->turns->key_count == 0;
    }
    turn_vector(c, path->t[1], path->t[0], turn, rate);
    drape_rotation_velocity(turn, rate, w);
    return true;
}

/* The path from the position at t to another one. */
static drape_path path_to(const course *c, double t, double span, const double to[3], const double *v)
{
    drape_path next = {.given = true, .t = {t, t + span}};
    position_on(c, t, next.x[0]);
    memcpy(next.x[1], to, sizeof next.x[1]);
    next.smooth = leading_velocity(c, t, next.v[0]) && v;
    if (v)
        memcpy(next.v[1], v, sizeof next.v[1]);
    for (int k = 0; !v && k < 3; k++)
        next.v[0][k] = next.v[1][k] = (to[k] - next.x[0][k]) / span;
    return next;
}

/* The rotation from that at t to another one. *smooth is cleared if it does not go on as before. */
static drape_turn_path turn_to(const course *c, double t, double span, const double *rotation,
                               const double *w, bool *smooth)
{
    drape_turn_path next = {.turn = {0}};
    double between[9], before[3];
    rotation_on(c, t, next.from);
    const bool known = leading_spin(c, t, before);
    if (!rotation) {
        *smooth = *smooth && known && rests(before);
        return next;
    }
    drape_rotation_between(rotation, next.from, between);
    drape_rotation_log(between, next.turn);
    if (w) {
        *smooth = *smooth && known;
        memcpy(next.rate[0], before, sizeof before);
        drape_rotation_rate(next.turn, w, next.rate[1]);
    }
    for (int i = 0; !w && i < 6; i++)
        next.rate[i / 3][i % 3] = next.turn[i % 3] / span;
    return next;
}

/* ---- Pins ---- */

static course pin_course(const drape_motion *motion, int32_t i)
{
    const drape_model *m = motion->model;
    const int32_t node = motion->moved_node[i];
    return (course){.motion = motion,
                    .ride = motion->ride[i].collider >= 0 ? &motion->ride[i] : NULL,
                    .track = motion->moved_track[i] >= 0 ? &m->tracks[motion->moved_track[i]] : NULL,
                    .turns = motion->moved_track[i] >= 0 ? &m->tracks[motion->moved_track[i]].turns : NULL,
                    .path = &motion->pin_path[i],
                    .placed = &motion->cloth_placed[drape_model_cloth_of(m, node)],
                    .start = m->start + 3 * (size_t)node};
}

void drape_motion_place_pins(const drape_motion *motion, double t, double *x)
{
    for (int32_t i = 0; i < motion->moved_count; i++) {
        const course c = pin_course(motion, i);
        position_on(&c, t, x + 3 * (size_t)motion->moved_node[i]);
    }
}

void drape_motion_place_fixed(const drape_motion *motion, int32_t node, double x[3])
{
    const drape_path none = {.given = false};
    const course c = {.path = &none,
                      .placed = &motion->cloth_placed[drape_model_cloth_of(motion->model, node)],
                      .start = motion->model->start + 3 * (size_t)node};
    position_on(&c, 0, x);
}

void drape_motion_pin_velocity(const drape_motion *motion, int32_t i, double t, double within, double v[3])
{
    const course c = pin_course(motion, i);
    velocity_on(&c, t, within, v);
}

void drape_motion_pin_arrival(const drape_motion *motion, int32_t node, double t, double v[3])
{
    memset(v, 0, 3 * sizeof *v);
    if (motion->place[node] < 0)
        return;
    const course c = pin_course(motion, motion->place[node]);
    if (!leading_velocity(&c, t, v))
        memset(v, 0, 3 * sizeof *v);
}

/* Returns the number of a pin among the moved ones, adding it to them if necessary. */
static int32_t find_place(drape_motion *motion, int32_t node)
{
    int32_t i = motion->place[node];
    if (i < 0) {
        i = motion->place[node] = motion->moved_count++;
        motion->moved_node[i] = node;
        motion->moved_track[i] = -1;
        motion->ride[i] = drape_ride_none();
    }
    return i;
}

void drape_motion_send_pin(drape_motion *motion, int32_t node, double t, double span, const double x[3],
                           const double *v)
{
    const int32_t i = find_place(motion, node);
    const course c = pin_course(motion, i);
    motion->pin_path[i] = path_to(&c, t, span, x, v);
}

/* ---- Pins that colliders carry ---- */

int32_t drape_motion_carrier(const drape_motion *motion, int32_t i)
{
    return motion->pin_path[i].given ? -1 : motion->ride[i].collider;
}

void drape_motion_ride_from(const drape_motion *motion, int32_t collider, int32_t triangle, double t,
                            const double x[3], drape_ride *ride)
{
    const drape_collider *on = &motion->model->colliders[collider];
    drape_collider_pose pose;
    double corner[9];
    *ride = drape_ride_none();
    ride->collider = collider;
    pose_of(motion, collider, t, t, false, &pose);
    drape_pose_own(&pose, x, ride->own);
    if (on->frames.frame_count == 0)
        return;
    ride->triangle = triangle;
    drape_deformation_corners(&motion->deformation[collider], on->shape.triangle + 3 * (size_t)triangle, t,
                              corner);
    double own[3] = {ride->own[0], ride->own[1], ride->own[2]};
    drape_ride_fix(ride, corner, own);
}

void drape_motion_take_ride(drape_motion *motion, int32_t node, const drape_ride *ride)
{
    const int32_t i = find_place(motion, node);
    motion->pin_path[i].given = false;
    motion->ride[i] = *ride;
}

void drape_motion_place_cloth(drape_motion *motion, int32_t cloth, const drape_placement *by)
{
    compose(by, &motion->cloth_placed[cloth]);
    for (int32_t i = 0; i < motion->moved_count; i++)
        if (drape_model_cloth_of(motion->model, motion->moved_node[i]) == cloth)
            place_path(by, &motion->pin_path[i]);
}

void drape_motion_place_pin(const drape_motion *motion, int32_t node, double t, double x[3])
{
    if (motion->place[node] < 0) {
        drape_motion_place_fixed(motion, node, x);
        return;
    }
    const course c = pin_course(motion, motion->place[node]);
    position_on(&c, t, x);
}

static drape_path resting_at(const double x[3])
{
    drape_path path = {.given = true, .smooth = true};
    memcpy(path.x[0], x, sizeof path.x[0]);
    memcpy(path.x[1], x, sizeof path.x[1]);
    return path;
}

void drape_motion_hold_pin(drape_motion *motion, int32_t node, const double x[3])
{
    motion->pin_path[find_place(motion, node)] = resting_at(x);
}

void drape_motion_hold_pins(drape_motion *motion, const double *x)
{
    for (int32_t i = 0; i < motion->moved_count; i++)
        if (motion->pin_path[i].given)
            motion->pin_path[i] = resting_at(x + 3 * (size_t)motion->moved_node[i]);
}

/* ---- Colliders ---- */

static course collider_course(const drape_motion *motion, int32_t collider)
{
    return (course){.track = &motion->model->colliders[collider].track,
                    .path = &motion->collider_path[collider],
                    .turn = &motion->collider_turn[collider],
                    .turns = &motion->model->colliders[collider].turns,
                    .placed = &motion->collider_placed[collider]};
}

bool drape_motion_shifts_collider(const drape_motion *motion, int32_t collider)
{
    const course c = collider_course(motion, collider);
    return c.path->given || c.placed->given || c.track->key_count > 0;
}

bool drape_motion_moves_collider(const drape_motion *motion, int32_t collider)
{
    return drape_motion_shifts_collider(motion, collider) ||
           motion->model->colliders[collider].turns.key_count > 0 || drape_motion_deforms(motion, collider);
}

bool drape_motion_turns_collider(const drape_motion *motion, int32_t collider)
{
    const course c = collider_course(motion, collider);
    if (c.path->given)
        return !(rests(c.turn->turn) && rests(c.turn->rate[0]) && rests(c.turn->rate[1]));
    return c.turns->key_count > 0;
}

void drape_motion_collider(const drape_motion *motion, int32_t collider, double t, double displacement[3])
{
    const course c = collider_course(motion, collider);
    position_on(&c, t, displacement);
}

void drape_motion_collider_velocity(const drape_motion *motion, int32_t collider, double t, double within,
                                    double v[3])
{
    const course c = collider_course(motion, collider);
    velocity_on(&c, t, within, v);
}

void drape_motion_rotation(const drape_motion *motion, int32_t collider, double t, double rotation[9])
{
    const course c = collider_course(motion, collider);
    rotation_on(&c, t, rotation);
}

void drape_motion_spin(const drape_motion *motion, int32_t collider, double t, double within, double w[3])
{
    const course c = collider_course(motion, collider);
    spin_on(&c, t, within, w);
}

static void pose_of(const drape_motion *motion, int32_t collider, double t, double within, bool rates,
                    drape_collider_pose *pose)
{
    const course c = collider_course(motion, collider);
    double displacement[3], v[3] = {0}, rotation[9], w[3] = {0};
    *pose = (drape_collider_pose){.t = t};
    if (!drape_motion_moves_collider(motion, collider))
        return;
    position_on(&c, t, displacement);
    rotation_on(&c, t, rotation);
    if (rates) {
        velocity_on(&c, t, within, v);
        spin_on(&c, t, within, w);
    }
    drape_pose_about(pose, motion->model->colliders[collider].pivot, rotation, displacement, v, w);
}

void drape_motion_pose(const drape_motion *motion, int32_t collider, double t, double within,
                       drape_collider_pose *pose)
{
    pose_of(motion, collider, t, within, true, pose);
}

void drape_motion_mean_pose(const drape_motion *motion, int32_t collider, double t, const double span[2],
                            drape_collider_pose *pose)
{
    static const double zero[9];
    drape_collider_pose from, to;
    drape_motion_pose(motion, collider, t, t, pose);
    memset(pose->velocity, 0, sizeof pose->velocity);
    drape_pose_set_gradient(pose, zero);
    if (!(span[1] > span[0]) || !drape_motion_moves_collider(motion, collider))
        return;
    drape_motion_pose(motion, collider, span[0], span[0], &from);
    drape_motion_pose(motion, collider, span[1], span[1], &to);
    drape_pose_set_mean_velocities(pose, &from, &to, span[1] - span[0]);
}

/* The rate of the rotation vector v of a path is a parabola: it stays in the hull of the control points of
 * its Bezier form. |w| <= |dv/dt|, since w is a mean of rotated dv/dt. */
double drape_motion_fastest_spin(const drape_motion *motion, int32_t collider, double t0, double t1)
{
    const course c = collider_course(motion, collider);
    const drape_path *path = c.path;
    if (!path->given)
        return drape_turns_fastest(c.turns);
    if (t1 <= path->t[0] || t0 >= path->t[1])
        return 0;
    const double h = path->t[1] - path->t[0];
    double control[3], fastest = 0;
    for (int k = 0; k < 3; k++)
        control[k] = 3 * c.turn->turn[k] / h - c.turn->rate[0][k] - c.turn->rate[1][k];
    fastest = fmax(vec3_norm(c.turn->rate[0]), vec3_norm(c.turn->rate[1]));
    return fmax(fastest, vec3_norm(control));
}

/* Writes where the points of a collider with frames are in space. */
static void place_points(const drape_motion *motion, int32_t collider, double t, double *x)
{
    const int32_t points = motion->deformation[collider].frames->node_count;
    drape_collider_pose pose;
    drape_motion_pose(motion, collider, t, t, &pose);
    drape_motion_points(motion, collider, t, x);
    for (int32_t p = 0; p < points; p++)
        drape_pose_point(&pose, x + 3 * (size_t)p, x + 3 * (size_t)p);
}

double drape_motion_collider_work(const drape_motion *motion, const drape_load *load, double t0, double t1)
{
    double work = 0;
    for (int32_t c = 0; load && c < motion->model->collider_count; c++) {
        const drape_deformation *d = &motion->deformation[c];
        drape_collider_pose before, after;
        if (!drape_motion_moves_collider(motion, c))
            continue;
        if (load[c].on_points) {
            double on_points = 0;
            place_points(motion, c, t0, d->spare[0]);
            place_points(motion, c, t1, d->spare[1]);
            for (size_t i = 0; i < 3 * (size_t)d->frames->node_count; i++)
                on_points += load[c].on_points[i] * (d->spare[1][i] - d->spare[0][i]);
            work += on_points;
            continue;
        }
        drape_motion_pose(motion, c, t0, t0, &before);
        drape_motion_pose(motion, c, t1, t1, &after);
        drape_load_add_work(&load[c], &before, &after, &work);
    }
    return work;
}

double drape_motion_collider_power(const drape_motion *motion, const drape_load *load, double t,
                                   double within)
{
    double power = 0;
    for (int32_t c = 0; load && c < motion->model->collider_count; c++) {
        const drape_deformation *d = &motion->deformation[c];
        drape_collider_pose pose;
        drape_motion_pose(motion, c, t, within, &pose);
        if (!load[c].on_points) {
            drape_load_add_power(&load[c], &pose, &power);
            continue;
        }
        double v[3], on_points = 0;
        drape_motion_points(motion, c, t, d->spare[0]);
        drape_motion_point_velocities(motion, c, t, within, d->spare[1]);
        for (size_t p = 0; p < (size_t)d->frames->node_count; p++) {
            drape_pose_point_velocity(&pose, d->spare[0] + 3 * p, d->spare[1] + 3 * p, v);
            on_points += vec3_dot(load[c].on_points + 3 * p, v);
        }
        power += on_points;
    }
    return power;
}

void drape_motion_collider_arrival(const drape_motion *motion, int32_t collider, double t, double v[3],
                                   double w[3])
{
    const course c = collider_course(motion, collider);
    if (!leading_velocity(&c, t, v))
        memset(v, 0, 3 * sizeof *v);
    if (!leading_spin(&c, t, w))
        memset(w, 0, 3 * sizeof *w);
}

void drape_motion_send_collider(drape_motion *motion, int32_t collider, double t, double span,
                                const double x[3], const double *v, const double *rotation, const double *w)
{
    const course c = collider_course(motion, collider);
    drape_path path = path_to(&c, t, span, x, v);
    motion->collider_turn[collider] = turn_to(&c, t, span, rotation, v ? w : NULL, &path.smooth);
    motion->collider_path[collider] = path;
}

void drape_motion_place_collider(drape_motion *motion, int32_t collider, const drape_placement *by)
{
    drape_turn_path *turn = &motion->collider_turn[collider];
    double from[9];
    compose(by, &motion->collider_placed[collider]);
    place_path(by, &motion->collider_path[collider]);
    memcpy(from, turn->from, sizeof from);
    drape_rotation_product(by->turn, from, turn->from);
    drape_placement_turn(by, turn->turn, turn->turn);
    for (int i = 0; i < 2; i++)
        drape_placement_turn(by, turn->rate[i], turn->rate[i]);
}

/* ---- Another motion ---- */

/* A path begins anew at time t: the motion up to there is forgotten, that from there on is the same but for
 * the poses between the ends of a turn. */
static void cut_path(const course *c, double t, drape_path *path, drape_turn_path *turn)
{
    drape_path rest = *path;
    drape_turn_path after = *turn;
    double end[9], between[9], spin[2][3];
    rest.t[0] = t;
    rest.smooth = true;
    path_displacement(path, t, rest.x[0]);
    path_velocity(path, t, t, rest.v[0]);
    rotation_on(c, t, after.from);
    rotation_on(c, path->t[1], end);
    spin_on(c, t, t, spin[0]);
    drape_rotation_velocity(turn->turn, turn->rate[1], spin[1]);
    drape_rotation_between(end, after.from, between);
    drape_rotation_log(between, after.turn);
    memcpy(after.rate[0], spin[0], sizeof after.rate[0]);
    drape_rotation_rate(after.turn, spin[1], after.rate[1]);
    *path = rest;
    *turn = after;
}

/* With the rotation R about the pivot p' in place of p, a displacement d' = d + p - p' - R (p - p') is that
 * of the same pose; by = p - p'. */
static void shift_by_pivot(const double R[9], const double by[3], double d[3])
{
    double turned[3];
    drape_rotation_turn(R, by, turned);
    for (int k = 0; k < 3; k++)
        d[k] += by[k] - turned[k];
}

static void repivot_path(const double by[3], drape_path *path, const drape_turn_path *turn)
{
    for (int end = 0; end < 2; end++) {
        static const double zero[3];
        double further[9], R[9], turned[3], w[3], moves[3];
        drape_rotation_exp(end ? turn->turn : zero, further);
        drape_rotation_product(further, turn->from, R);
        drape_rotation_velocity(end ? turn->turn : zero, turn->rate[end], w);
        drape_rotation_turn(R, by, turned);
        vec3_cross(w, turned, moves);
        shift_by_pivot(R, by, path->x[end]);
        vec3_add_scaled(-1, moves, path->v[end]);
    }
}

/* The pose in space and its velocities at t, and those at the end of a path, are those about the former
 * pivot. A pivot that no scene gives is the middle of the shape and moves with it. */
static void keep_pose(drape_motion *motion, int32_t collider, const drape_collider *before, double t)
{
    const drape_collider *now = &motion->model->colliders[collider];
    drape_path *path = &motion->collider_path[collider];
    drape_placement *placed = &motion->collider_placed[collider];
    const course c = collider_course(motion, collider);
    double by[3], R[9];
    vec3_sub(before->pivot, now->pivot, by);
    if (rests(by) || !(before->pivot_given || now->pivot_given))
        return;
    if (path->given) {
        if (t > path->t[0] && t < path->t[1])
            cut_path(&c, t, path, &motion->collider_turn[collider]);
        repivot_path(by, path, &motion->collider_turn[collider]);
        return;
    }
    rotation_on(&c, t, R);
    if (drape_rotation_is_none(R))
        return;
    if (!placed->given)
        *placed = (drape_placement){.given = true, .turn = DRAPE_NO_ROTATION};
    shift_by_pivot(R, by, placed->shift);
}

void drape_motion_copy(drape_motion *motion, const drape_motion *from, const int32_t *before, double t)
{
    const drape_model *m = motion->model;
    for (int32_t i = 0; i < from->moved_count; i++)
        if (m->pinned[from->moved_node[i]])
            motion->pin_path[find_place(motion, from->moved_node[i])] = from->pin_path[i];
    for (int32_t c = 0; c < m->collider_count; c++) {
        if (before[c] < 0)
            continue;
        motion->collider_path[c] = from->collider_path[before[c]];
        motion->collider_turn[c] = from->collider_turn[before[c]];
        motion->collider_placed[c] = from->collider_placed[before[c]];
        const drape_collider_shape *now = &m->colliders[c].shape,
                                   *old = &from->model->colliders[before[c]].shape;
        if (now->point_count == old->point_count &&
            (now->point_count == 0 ||
             memcmp(now->point, old->point, 3 * (size_t)now->point_count * sizeof *now->point) == 0))
            drape_deformation_copy(&motion->deformation[c], &from->deformation[before[c]]);
        keep_pose(motion, c, &from->model->colliders[before[c]], t);
    }
    memcpy(motion->cloth_placed, from->cloth_placed, (size_t)m->cloth_count * sizeof *motion->cloth_placed);
}

/* ---- Checkpoints ---- */

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
    bool good = isfinite(path->t[0]) && isfinite(path->t[1]) && path->t[0] <= path->t[1];
    for (int i = 0; i < 2; i++)
        good = good && drape_all_finite(path->x[i], 3) && drape_all_finite(path->v[i], 3);
    if (drape_archive_has_read(a) && !good)
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has an invalid path");
}

static bool is_ride(const drape_motion *motion, const drape_ride *ride)
{
    const drape_model *m = motion->model;
    if (ride->collider < 0 || ride->collider >= m->collider_count)
        return ride->collider == -1 && ride->triangle == -1;
    const drape_collider *on = &m->colliders[ride->collider];
    const int32_t triangles = on->frames.frame_count > 0 ? on->shape.triangle_count : 0;
    return drape_all_finite(ride->own, 3) && isfinite(ride->offset) && !isinf(ride->since) &&
           (triangles > 0 ? ride->triangle >= 0 && ride->triangle < triangles : ride->triangle == -1);
}

static void archive_placement(drape_placement *placed, drape_archive *a)
{
    drape_archive_bool(a, &placed->given);
    if (!placed->given || !drape_archive_good(a))
        return;
    drape_archive_doubles(a, placed->turn, 9);
    drape_archive_doubles(a, placed->shift, 3);
    if (drape_archive_has_read(a) &&
        !(drape_all_finite(placed->turn, 9) && drape_all_finite(placed->shift, 3)))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has a placement that is not finite");
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
        /* Pins with a track come first, in the model's order, then the others in the order in which the
         * host moved them. */
        int32_t node = a->reading ? -1 : motion->moved_node[i];
        drape_archive_int32(a, &node);
        if (drape_archive_has_read(a)) {
            bool good = node >= 0 && node < motion->model->node_count && motion->model->pinned[node] &&
                        (i < motion->model->moved_count ? motion->place[node] == i : motion->place[node] < 0);
            if (good)
                find_place(motion, node);
            else
                drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint moves node %d, which is not pinned",
                                   (int)node);
        }
        if (drape_archive_good(a))
            archive_path(&motion->pin_path[i], a);
        if (drape_archive_good(a)) {
            drape_ride *ride = &motion->ride[i];
            drape_archive_int32(a, &ride->collider);
            drape_archive_int32(a, &ride->triangle);
            if (ride->collider >= 0) {
                drape_archive_doubles(a, ride->own, 3);
                drape_archive_doubles(a, &ride->offset, 1);
                drape_archive_bool(a, &ride->given);
                drape_archive_doubles(a, &ride->since, 1);
            }
            if (drape_archive_has_read(a) && !is_ride(motion, ride)) {
                *ride = drape_ride_none();
                drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has an invalid pin on a collider");
            }
        }
    }
    for (int32_t c = 0; c < motion->model->collider_count && drape_archive_good(a); c++) {
        archive_path(&motion->collider_path[c], a);
        if (motion->collider_path[c].given && drape_archive_good(a)) {
            drape_turn_path *turn = &motion->collider_turn[c];
            drape_archive_doubles(a, turn->from, 9);
            drape_archive_doubles(a, turn->turn, 3);
            for (int i = 0; i < 2; i++)
                drape_archive_doubles(a, turn->rate[i], 3);
            if (drape_archive_has_read(a) &&
                !(drape_all_finite(turn->from, 9) && drape_all_finite(turn->turn, 3) &&
                  drape_all_finite(turn->rate[0], 3) && drape_all_finite(turn->rate[1], 3)))
                drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has a rotation that is not finite");
        }
        archive_placement(&motion->collider_placed[c], a);
        drape_deformation_archive(&motion->deformation[c], a);
    }
    for (int32_t c = 0; c < motion->model->cloth_count && drape_archive_good(a); c++)
        archive_placement(&motion->cloth_placed[c], a);
}

/* ---- All pins and colliders ---- */

/* All but those of histories. */
static kink_search find_kinks(const drape_motion *motion, double t, double end)
{
    static const drape_path none;
    const drape_model *m = motion->model;
    kink_search s = {.t = t, .end = end};
    for (int32_t i = 0; i < motion->moved_count; i++) {
        const course c = pin_course(motion, i);
        meet_kinks(&c, &s);
    }
    for (int32_t i = 0; i < m->collider_count; i++) {
        const course c = collider_course(motion, i);
        meet_kinks(&c, &s);
        s.end = drape_deformation_next_kink(&motion->deformation[i], t, s.end);
        s.at = s.at || drape_deformation_at_kink(&motion->deformation[i], t);
    }
    for (int32_t i = 0; i < m->support_count; i++)
        for (int d = 0; d < m->supports[i].count; d++) {
            const int32_t track = m->supports[i].track[d];
            meet_kinks(&(course){.path = &none, .track = track >= 0 ? &m->tracks[track] : NULL}, &s);
        }
    for (int32_t i = 0; i < m->track_count; i++) /* turns that clamped edges follow */
        meet_kinks(&(course){.path = &none, .turns = m->tracks[i].clamps ? &m->tracks[i].turns : NULL}, &s);
    return s;
}

double drape_motion_next_kink(const drape_motion *motion, double t, double end)
{
    end = find_kinks(motion, t, end).end;
    for (int32_t i = 0; i < motion->model->history_count; i++)
        if (motion->model->histories[i].used)
            end = drape_history_next_kink(&motion->model->histories[i], t, end);
    return end;
}

bool drape_motion_at_kink(const drape_motion *motion, double t)
{
    return find_kinks(motion, t, t).at;
}
