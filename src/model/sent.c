/* sent.c: see sent.h. */
#include "model/sent.h"

#include "base/vec3.h"

#include <string.h>

/* Pins that go less far apart, in their mean displacement, go as one. */
#define SPREAD 0.5
/* In the length of the path: allowance for rounding in the sums of a host. */
#define SAME 1e-6

static bool is_sent(bool given, const double span[2], double t, double end)
{
    return given && span[0] == t && span[1] > t && span[1] <= end + SAME * (end - t);
}

bool drape_motion_sends_collider(const drape_motion *motion, int32_t collider, double t, double end)
{
    const drape_path *path = &motion->collider_path[collider];
    const drape_deformation *points = &motion->deformation[collider];
    return is_sent(path->given, path->t, t, end) || is_sent(points->given, points->t, t, end);
}

/* A moved pin: by a path of its own, or with its collider. */
static bool sends_pin(const drape_motion *motion, int32_t i, double t, double end)
{
    const drape_path *path = &motion->pin_path[i];
    const int32_t carrier = drape_motion_carrier(motion, i);
    return is_sent(path->given, path->t, t, end) ||
           (carrier >= 0 && drape_motion_sends_collider(motion, carrier, t, end));
}

bool drape_motion_sends(const drape_motion *motion, double t, double end)
{
    bool sends = false;
    for (int32_t i = 0; i < motion->moved_count && !sends; i++)
        sends = sends_pin(motion, i, t, end);
    for (int32_t c = 0; c < motion->model->collider_count && !sends; c++)
        sends = drape_motion_sends_collider(motion, c, t, end);
    return sends;
}

/* How far a pinned node goes from x. */
static void path_of(const drape_motion *motion, int32_t node, const double *x, double end, double path[3])
{
    drape_motion_place_pin(motion, node, end, path);
    vec3_add_scaled(-1, x + 3 * (size_t)node, path);
}

bool drape_motion_moves_as_one(const drape_motion *motion, int32_t first, int32_t count, const double *x,
                               double end, double common[3])
{
    int32_t pins = 0;
    double path[3], away[3];
    memset(common, 0, 3 * sizeof *common);
    for (int32_t node = first; node < first + count; node++) {
        if (!motion->model->pinned[node])
            continue;
        path_of(motion, node, x, end, path);
        vec3_add_scaled(1, path, common);
        pins++;
    }
    for (int k = 0; k < 3 && pins > 0; k++)
        common[k] /= pins;
    bool as_one = vec3_norm(common) > 0;
    for (int32_t node = first; as_one && node < first + count; node++) {
        if (!motion->model->pinned[node])
            continue;
        path_of(motion, node, x, end, path);
        vec3_sub(path, common, away);
        as_one = vec3_norm(away) <= SPREAD * vec3_norm(common);
    }
    return as_one;
}

bool drape_motion_sends_pins(const drape_motion *motion, double t, double end)
{
    bool sends = true;
    for (int32_t node = 0; node < motion->model->node_count && sends; node++)
        sends = !motion->model->pinned[node] ||
                (motion->place[node] >= 0 && sends_pin(motion, motion->place[node], t, end));
    return sends;
}

/* ---- Less of it ---- */

static void shorten_path(drape_path *path, const drape_sent_part *part)
{
    const double span = path->t[1] - path->t[0];
    double move[3], rest[3];
    vec3_sub(path->x[1], path->x[0], move);
    /* Whether a path is at constant speed: else the host gave its velocities, which are kept. */
    double off[3] = {-move[0], -move[1], -move[2]};
    vec3_add_scaled(span, path->v[0], off);
    const bool steady = memcmp(path->v[0], path->v[1], sizeof path->v[0]) == 0 &&
                        vec3_norm(off) <= SAME * (vec3_norm(move) + span * vec3_norm(path->v[0]));
    vec3_sub(move, part->common, rest);
    for (int k = 0; k < 3; k++)
        path->x[1][k] = path->x[0][k] + part->left[k] + part->share * rest[k];
    for (int k = 0; steady && k < 3; k++)
        path->v[0][k] = path->v[1][k] = (path->x[1][k] - path->x[0][k]) / span;
}

void drape_motion_shorten(drape_motion *motion, const drape_sent_part *part)
{
    for (int32_t i = 0; i < motion->moved_count; i++)
        if (is_sent(motion->pin_path[i].given, motion->pin_path[i].t, part->t, part->end))
            shorten_path(&motion->pin_path[i], part);
    for (int32_t c = 0; c < motion->model->collider_count; c++) {
        drape_path *path = &motion->collider_path[c];
        drape_deformation *points = &motion->deformation[c];
        if (is_sent(path->given, path->t, part->t, part->end)) {
            shorten_path(path, part);
            for (int k = 0; k < 3; k++) {
                motion->collider_turn[c].turn[k] *= part->share;
                motion->collider_turn[c].rate[0][k] *= part->share;
                motion->collider_turn[c].rate[1][k] *= part->share;
            }
        }
        if (!is_sent(points->given, points->t, part->t, part->end))
            continue;
        for (size_t i = 0; i < 3 * (size_t)points->frames->node_count; i++) {
            points->x[1][i] = points->x[0][i] + part->share * (points->x[1][i] - points->x[0][i]);
            points->v[0][i] *= part->share;
            points->v[1][i] *= part->share;
        }
    }
}
