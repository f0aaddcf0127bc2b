/* build_tracks.c: checks and copies the track of a pin or a collider, and the rotation of a collider. */
#include "compile/stages.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/pi.h"
#include "base/rotation.h"
#include "base/vec3.h"
#include "model/motion.h"
#include "model/track.h"

drape_status drape_compile_track(drape_model *model, const char *pointer, const drape_track_key *keys,
                                 size_t key_count, drape_track *track)
{
    for (size_t k = 0; k < key_count; k++) {
        bool finite = isfinite(keys[k].time);
        for (int i = 0; i < 3; i++)
            finite = finite && fabs(keys[k].displacement[i]) <= DRAPE_MOST;
        const char *key = DRAPE_FORMAT("track/%zu", k);
        if (!finite)
            return drape_fail_below(model->ctx, pointer, key,
                                    "time and displacement must be finite, the displacement within 1e9 m");
        if (k > 0 && !(keys[k].time > keys[k - 1].time))
            return drape_fail_below(model->ctx, pointer, key, "times must increase from key to key");
    }
    track->keys = drape_arena_take(&model->arena, key_count, sizeof *track->keys);
    if (!track->keys)
        return DRAPE_E_MEMORY;
    memcpy(track->keys, keys, key_count * sizeof *track->keys);
    track->key_count = key_count;
    return DRAPE_OK;
}

/* ---- Rotations ---- */

static bool is_zero(const double *values, int count)
{
    bool zero = true;
    for (int i = 0; i < count; i++)
        zero = zero && values[i] == 0;
    return zero;
}

/* Divides by the largest component first, so that no square under- or overflows. */
static void normalise(double *v, int count)
{
    double largest = 0, squares = 0;
    for (int i = 0; i < count; i++)
        largest = fmax(largest, fabs(v[i]));
    for (int i = 0; i < count; i++) {
        v[i] /= largest;
        squares += v[i] * v[i];
    }
    for (int i = 0; i < count; i++)
        v[i] /= sqrt(squares);
}

/* Whether both keys turn about one axis, to which a key without an angle is indifferent. Writes the axis and
 * the difference of the angles. */
static bool share_axis(const drape_turn_key *a, const drape_turn_key *b, double axis[3], double *degrees)
{
    const drape_turn_key *from = a->rotate[3] != 0 ? a : b, *other = from == a ? b : a;
    double second[3], across[3];
    if (!is_zero(a->quaternion, 4) || !is_zero(b->quaternion, 4) || from->rotate[3] == 0)
        return false;
    memcpy(axis, from->rotate, 3 * sizeof *axis);
    normalise(axis, 3);
    memcpy(second, other->rotate[3] != 0 ? other->rotate : axis, sizeof second);
    normalise(second, 3);
    vec3_cross(axis, second, across);
    const double sign = vec3_dot(axis, second) < 0 ? -1 : 1;
    const double of_a = a->rotate[3] * (from == a ? 1 : sign), of_b = b->rotate[3] * (from == a ? sign : 1);
    *degrees = of_b - of_a;
    return vec3_norm(across) < 1e-9;
}

drape_status drape_compile_turns(drape_model *model, const char *pointer, const drape_turn_key *keys,
                                 size_t key_count, drape_turns *turns)
{
    for (size_t k = 0; k < key_count; k++) {
        const double *q = keys[k].quaternion, *rotate = keys[k].rotate;
        char key[40];
        bool finite = isfinite(keys[k].time);
        for (int i = 0; i < 4; i++)
            finite = finite && fabs(rotate[i]) <= DRAPE_MOST && fabs(q[i]) <= DRAPE_MOST;
        snprintf(key, sizeof key, "turns/%zu", k);
        if (!finite)
            return drape_fail_below(model->ctx, pointer, key,
                                    "time, rotate and quaternion must be finite, and within 1e9");
        if (k > 0 && !(keys[k].time > keys[k - 1].time))
            return drape_fail_below(model->ctx, pointer, key, "times must increase from key to key");
        if (is_zero(q, 4) && rotate[3] != 0 && is_zero(rotate, 3))
            return drape_fail_below(model->ctx, pointer, key, "the axis of a rotation must not be 0 0 0");
    }
    turns->keys = drape_arena_take(&model->arena, key_count, sizeof *turns->keys);
    if (!turns->keys)
        return DRAPE_E_MEMORY;
    turns->key_count = key_count;
    for (size_t k = 0; k < key_count; k++) {
        double q[4], matrix[3][3];
        turns->keys[k].time = keys[k].time;
        memcpy(q, keys[k].quaternion, sizeof q);
        if (is_zero(q, 4)) {
            drape_rotation_matrix(keys[k].rotate, matrix);
            memcpy(turns->keys[k].rotation, matrix, sizeof matrix);
        } else {
            normalise(q, 4);
            drape_rotation_of_quaternion(q, turns->keys[k].rotation);
        }
    }
    for (size_t k = 0; k + 1 < key_count; k++) { /* the steady turn from one key to the next */
        drape_turn *turn = &turns->keys[k];
        double between[9], vector[3];
        if (share_axis(&keys[k], &keys[k + 1], turn->axis, &turn->degrees))
            continue;
        drape_rotation_between(turn[1].rotation, turn->rotation, between);
        drape_rotation_log(between, vector);
        turn->degrees = vec3_norm(vector) * (180 / DRAPE_PI);
        memcpy(turn->axis, vector, sizeof turn->axis);
        if (turn->degrees > 0)
            normalise(turn->axis, 3);
    }
    if (drape_turns_fastest(turns) > DRAPE_MAX_SPIN)
        return drape_fail_below(model->ctx, pointer, "turns",
                                "%.6g rad/s is not allowed; colliders and pins turn by at most %g rad/s",
                                drape_turns_fastest(turns), DRAPE_MAX_SPIN);
    return DRAPE_OK;
}
