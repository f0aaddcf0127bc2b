/* deformation.c: see deformation.h. */
#include "model/deformation.h"

#include "base/finite.h"
#include "base/search.h"
#include "model/track.h"

#include <string.h>

static size_t numbers_of(const drape_sequence *frames)
{
    return 3 * (size_t)frames->node_count;
}

drape_status drape_deformation_create(drape_arena *arena, const drape_sequence *frames,
                                      drape_deformation *out)
{
    *out = (drape_deformation){.frames = frames};
    for (int end = 0; frames->frame_count > 0 && end < 2; end++) {
        out->x[end] = drape_arena_take(arena, numbers_of(frames), sizeof(double));
        out->v[end] = drape_arena_take(arena, numbers_of(frames), sizeof(double));
        out->spare[end] = drape_arena_take(arena, numbers_of(frames), sizeof(double));
    }
    return drape_arena_status(arena);
}

bool drape_deformation_moves(const drape_deformation *d)
{
    return d->given || d->frames->frame_count > 1;
}

/* ---- Frames ---- */

/* The last frame at or before t; -1 if t is before the first. */
static int32_t frame_before(const drape_sequence *frames, double t)
{
    return (int32_t)drape_last_time(frames->time, sizeof *frames->time, frames->frame_count, t);
}

static const double *frame_at(const drape_sequence *frames, int32_t frame)
{
    return frames->x + (size_t)frame * numbers_of(frames);
}

/* Here and below: `count` of the numbers of the points, from the number `first` on. */
static void frame_points(const drape_sequence *frames, double t, size_t first, size_t count, double *x)
{
    const int32_t k = frame_before(frames, t), a = k < 0 ? 0 : k,
                  b = k >= 0 && k + 1 < frames->frame_count ? k + 1 : a;
    const double *from = frame_at(frames, a) + first, *to = frame_at(frames, b) + first,
                 share = a == b ? 0 : (t - frames->time[a]) / (frames->time[b] - frames->time[a]);
    for (size_t i = 0; i < count; i++)
        x[i] = from[i] + share * (to[i] - from[i]);
}

void drape_sequence_points(const drape_sequence *frames, double t, double *x)
{
    frame_points(frames, t, 0, numbers_of(frames), x);
}

/* ---- Paths of a host ---- */

void drape_cubic_values(const double times[2], const double *const x[2], const double *const v[2], double t,
                        size_t count, double *out)
{
    if (t <= times[0] || t >= times[1]) {
        memcpy(out, x[t >= times[1]], count * sizeof *out);
        return;
    }
    const double h = times[1] - times[0], s = (t - times[0]) / h;
    const double rise = s * s * (3 - 2 * s), leave = s * (1 - s) * (1 - s), arrive = s * s * (s - 1);
    for (size_t i = 0; i < count; i++)
        out[i] = x[0][i] + rise * (x[1][i] - x[0][i]) + h * (leave * v[0][i] + arrive * v[1][i]);
}

void drape_cubic_rates(const double times[2], const double *const x[2], const double *const v[2], double t,
                       double within, size_t count, double *out)
{
    if (within < times[0] || within >= times[1]) {
        memset(out, 0, count * sizeof *out);
        return;
    }
    const double h = times[1] - times[0], s = (t - times[0]) / h;
    for (size_t i = 0; i < count; i++)
        out[i] = 6 * s * (1 - s) * (x[1][i] - x[0][i]) / h + (1 - s) * (1 - 3 * s) * v[0][i] +
                 s * (3 * s - 2) * v[1][i];
}

static bool rests_at_end(const drape_deformation *d)
{
    for (size_t i = 0; i < numbers_of(d->frames); i++)
        if (d->v[1][i] != 0)
            return false;
    return true;
}

void drape_deformation_send(drape_deformation *d, double t, double span, const double *x, const double *v)
{
    const size_t count = numbers_of(d->frames);
    const bool ends = d->given && drape_has_arrived(d->t, t), begins = d->given && t == d->t[0];
    /* the velocities that lead here; unknown at a frame, and where a path is replaced at its beginning */
    const bool known = d->given ? ends || !begins || d->smooth : d->frames->frame_count == 1;
    drape_deformation_points(d, t, d->spare[0]);
    if (ends)
        memcpy(d->v[0], d->v[1], count * sizeof *d->v[0]);
    else if (!begins)
        drape_deformation_velocities(d, t, t,
                                     d->v[0]); /* number by number: each reads v[0] before it is set */
    memcpy(d->x[0], d->spare[0], count * sizeof *d->x[0]);
    for (size_t i = 0; !v && i < count; i++)
        d->v[0][i] = (x[i] - d->x[0][i]) / span;
    memcpy(d->v[1], v ? v : d->v[0], count * sizeof *d->v[1]);
    memcpy(d->x[1], x, count * sizeof *d->x[1]);
    d->smooth = known && v;
    d->given = true;
    d->t[0] = t;
    d->t[1] = t + span;
}

/* ---- Either ---- */

static void points_from(const drape_deformation *d, double t, size_t first, size_t count, double *x)
{
    if (d->given)
        drape_cubic_values(d->t, (const double *const[]){d->x[0] + first, d->x[1] + first},
                           (const double *const[]){d->v[0] + first, d->v[1] + first}, t, count, x);
    else
        frame_points(d->frames, t, first, count, x);
}

static void velocities_from(const drape_deformation *d, double t, double within, size_t first, size_t count,
                            double *v)
{
    if (d->given) {
        drape_cubic_rates(d->t, (const double *const[]){d->x[0] + first, d->x[1] + first},
                          (const double *const[]){d->v[0] + first, d->v[1] + first}, t, within, count, v);
        return;
    }
    const int32_t k = frame_before(d->frames, within);
    memset(v, 0, count * sizeof *v);
    if (k < 0 || k + 1 >= d->frames->frame_count)
        return;
    const double *from = frame_at(d->frames, k) + first, *to = frame_at(d->frames, k + 1) + first,
                 span = d->frames->time[k + 1] - d->frames->time[k];
    for (size_t i = 0; i < count; i++)
        v[i] = (to[i] - from[i]) / span;
}

void drape_deformation_points(const drape_deformation *d, double t, double *x)
{
    points_from(d, t, 0, numbers_of(d->frames), x);
}

void drape_deformation_velocities(const drape_deformation *d, double t, double within, double *v)
{
    velocities_from(d, t, within, 0, numbers_of(d->frames), v);
}

void drape_deformation_corners(const drape_deformation *d, const int32_t *triangle, double t, double x[9])
{
    for (int i = 0; i < 3; i++)
        points_from(d, t, 3 * (size_t)triangle[i], 3, x + 3 * i);
}

void drape_deformation_corner_velocities(const drape_deformation *d, const int32_t *triangle, double t,
                                         double within, double v[9])
{
    for (int i = 0; i < 3; i++)
        velocities_from(d, t, within, 3 * (size_t)triangle[i], 3, v + 3 * i);
}

double drape_deformation_next_kink(const drape_deformation *d, double t, double end)
{
    for (int i = 0; d->given && i < 2; i++)
        if (d->t[i] > t && d->t[i] < end && !(i == 0 ? d->smooth : rests_at_end(d)))
            end = d->t[i];
    if (d->given || d->frames->frame_count < 2)
        return end;
    const int32_t next = frame_before(d->frames, t) + 1;
    return next < d->frames->frame_count && d->frames->time[next] < end ? d->frames->time[next] : end;
}

bool drape_deformation_at_kink(const drape_deformation *d, double t)
{
    if (d->given)
        return (t == d->t[0] && !d->smooth) || (t == d->t[1] && !rests_at_end(d));
    const int32_t k = d->frames->frame_count > 1 ? frame_before(d->frames, t) : -1;
    return k >= 0 && d->frames->time[k] == t;
}

void drape_deformation_copy(drape_deformation *d, const drape_deformation *from)
{
    const size_t count = from->given && d->frames->frame_count > 0 ? numbers_of(d->frames) : 0;
    d->given = count > 0;
    d->smooth = from->smooth;
    for (int end = 0; end < 2 && d->given; end++) {
        d->t[end] = from->t[end];
        memcpy(d->x[end], from->x[end], count * sizeof *d->x[end]);
        memcpy(d->v[end], from->v[end], count * sizeof *d->v[end]);
    }
}

void drape_deformation_archive(drape_deformation *d, drape_archive *a)
{
    const size_t count = numbers_of(d->frames);
    if (d->frames->frame_count == 0)
        return;
    drape_archive_bool(a, &d->given);
    if (!d->given || !drape_archive_good(a))
        return;
    drape_archive_bool(a, &d->smooth);
    drape_archive_doubles(a, d->t, 2);
    for (int end = 0; end < 2; end++) {
        drape_archive_doubles(a, d->x[end], count);
        drape_archive_doubles(a, d->v[end], count);
    }
    if (!drape_archive_has_read(a))
        return;
    bool good = drape_all_finite(d->t, 2) && d->t[0] <= d->t[1];
    for (int end = 0; end < 2; end++)
        good = good && drape_all_finite(d->x[end], count) && drape_all_finite(d->v[end], count);
    if (!good)
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has an invalid path of a collider's points");
}
