/* track.c: see track.h. */
#include "model/track.h"

#include "base/pi.h"
#include "base/rotation.h"
#include "base/search.h"
#include "base/vec3.h"
#include "mesh/mesh.h"

#include <string.h>

int64_t drape_track_key_before(const drape_track_key *keys, size_t key_count, double t)
{
    return drape_last_time(keys, sizeof *keys, (int64_t)key_count, t);
}

void drape_track_displacement(const drape_track_key *keys, size_t key_count, double t, double displacement[3])
{
    int64_t k = drape_track_key_before(keys, key_count, t);
    if (key_count == 0) {
        memset(displacement, 0, 3 * sizeof *displacement);
        return;
    }
    int64_t a = k < 0 ? 0 : k, b = k + 1 < (int64_t)key_count ? k + 1 : a;
    double share = a == b ? 0 : (t - keys[a].time) / (keys[b].time - keys[a].time);
    for (int i = 0; i < 3; i++)
        displacement[i] =
            keys[a].displacement[i] + share * (keys[b].displacement[i] - keys[a].displacement[i]);
}

void drape_track_velocity(const drape_track_key *keys, size_t key_count, double t, double velocity[3])
{
    int64_t k = drape_track_key_before(keys, key_count, t);
    bool inside = k >= 0 && k + 1 < (int64_t)key_count;
    for (int i = 0; i < 3; i++)
        velocity[i] = inside ? (keys[k + 1].displacement[i] - keys[k].displacement[i]) /
                                   (keys[k + 1].time - keys[k].time)
                             : 0;
}

/* ---- Rotations ---- */

/* Returns the last key at or before t, at least the first, and how much of the time to the next has gone. */
static const drape_turn *turn_before(const drape_turns *turns, double t, double *share)
{
    const int64_t k = drape_last_time(&turns->keys->time, sizeof *turns->keys, (int64_t)turns->key_count, t);
    const drape_turn *key = turns->keys + (k < 0 ? 0 : k), *last = turns->keys + turns->key_count - 1;
    *share = key < last && t > key->time ? (t - key->time) / (key[1].time - key->time) : 0;
    return key;
}

void drape_turns_rotation(const drape_turns *turns, double t, double rotation[9])
{
    static const double none[9] = DRAPE_NO_ROTATION;
    double share, matrix[3][3], further[9];
    memcpy(rotation, none, sizeof none);
    if (turns->key_count == 0)
        return;
    const drape_turn *key = turn_before(turns, t, &share);
    if (share == 0 || key->degrees == 0) {
        memcpy(rotation, key->rotation, sizeof key->rotation);
        return;
    }
    drape_rotation_matrix((const double[]){key->axis[0], key->axis[1], key->axis[2], share * key->degrees},
                          matrix);
    memcpy(further, matrix, sizeof further);
    drape_rotation_product(further, key->rotation, rotation);
}

void drape_turns_velocity(const drape_turns *turns, double t, double velocity[3])
{
    double share;
    memset(velocity, 0, 3 * sizeof *velocity);
    if (turns->key_count == 0 || t < turns->keys->time)
        return;
    const drape_turn *key = turn_before(turns, t, &share);
    if (key < turns->keys + turns->key_count - 1)
        vec3_add_scaled(key->degrees * (DRAPE_PI / 180) / (key[1].time - key->time), key->axis, velocity);
}

void drape_elements_direction(const drape_elements *el, int32_t part, const double rest[3],
                              double direction[3])
{
    const int32_t turn = el->parts->turn ? el->parts->turn[part] : -1;
    double rotation[9];
    memmove(direction, rest, 3 * sizeof *direction);
    if (turn < 0)
        return;
    drape_turns_rotation(&el->tracks[turn].turns, el->t, rotation);
    drape_rotation_turn(rotation, direction, direction);
}

/* ---- Pins ---- */

bool drape_track_moves(const drape_track *track)
{
    return track->key_count > 0 || track->turns.key_count > 0;
}

/* A pin without turns gets the bits of start + displacement. */
void drape_track_point(const drape_track *track, const double start[3], double t, double x[3])
{
    double displacement[3], rotation[9], arm[3];
    drape_track_displacement(track->keys, track->key_count, t, displacement);
    for (int i = 0; i < 3; i++)
        x[i] = start[i] + displacement[i];
    if (track->turns.key_count == 0)
        return;
    drape_turns_rotation(&track->turns, t, rotation);
    if (drape_rotation_is_none(rotation))
        return;
    vec3_sub(start, track->pivot, arm);
    drape_rotation_turn(rotation, arm, arm);
    for (int i = 0; i < 3; i++)
        x[i] = track->pivot[i] + arm[i] + displacement[i];
}

void drape_track_point_velocity(const drape_track *track, const double start[3], double t, double within,
                                double v[3])
{
    double rotation[9], arm[3], w[3], turning[3];
    memset(v, 0, 3 * sizeof *v);
    if (track->key_count > 0)
        drape_track_velocity(track->keys, track->key_count, within, v);
    if (track->turns.key_count == 0)
        return;
    drape_turns_rotation(&track->turns, t, rotation);
    drape_turns_velocity(&track->turns, within, w);
    vec3_sub(start, track->pivot, arm);
    drape_rotation_turn(rotation, arm, arm);
    vec3_cross(w, arm, turning);
    vec3_add_scaled(1, turning, v);
}

double drape_turns_fastest(const drape_turns *turns)
{
    double fastest = 0;
    for (size_t k = 0; k + 1 < turns->key_count; k++)
        fastest = fmax(fastest, fabs(turns->keys[k].degrees) * (DRAPE_PI / 180) /
                                    (turns->keys[k + 1].time - turns->keys[k].time));
    return fastest;
}
