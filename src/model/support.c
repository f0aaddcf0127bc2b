/* support.c: see support.h. */
#include "model/support.h"

#include "base/vec3.h"
#include "model/periodic.h"
#include "model/track.h"

#include <math.h>
#include <string.h>

/* The directions of a support as they are now; 0 if its node is pinned altogether. */
static int directions(const drape_motion *motion, const drape_support *support, double n[2][3])
{
    const drape_model *m = motion->model;
    if (m->free_of_node[support->node] < 0)
        return 0;
    const drape_placement *placed = &motion->cloth_placed[drape_model_cloth_of(m, support->node)];
    memcpy(n, support->direction, sizeof support->direction);
    for (int i = 0; placed->given && i < support->count; i++)
        drape_placement_turn(placed, n[i], n[i]);
    return support->count;
}

static void project(int count, double n[2][3], double *v)
{
    for (int i = 0; i < count; i++)
        vec3_add_scaled(-vec3_dot(n[i], v), n[i], v);
}

void drape_supports_project(const drape_motion *motion, double *nodes)
{
    const drape_model *m = motion->model;
    drape_periodic_project(m, nodes);
    for (int32_t i = 0; i < m->support_count; i++) {
        double n[2][3];
        project(directions(motion, &m->supports[i], n), n, nodes + 3 * (size_t)m->supports[i].node);
    }
}

void drape_supports_project_free(const drape_motion *motion, double *free_nodes)
{
    const drape_model *m = motion->model;
    drape_periodic_project_free(m, free_nodes);
    for (int32_t i = 0; i < m->support_count; i++) {
        double n[2][3];
        const int count = directions(motion, &m->supports[i], n);
        if (count > 0)
            project(count, n, free_nodes + 3 * (size_t)m->free_of_node[m->supports[i].node]);
    }
}

static bool has_track(const drape_support *support)
{
    for (int i = 0; i < support->count; i++)
        if (support->track[i] >= 0)
            return true;
    return false;
}

const drape_support *drape_support_of(const drape_model *m, int32_t node)
{
    int32_t low = 0, high = m->support_count;
    while (low < high) {
        const int32_t middle = low + (high - low) / 2;
        if (m->supports[middle].node < node)
            low = middle + 1;
        else
            high = middle;
    }
    return low < m->support_count && m->supports[low].node == node ? &m->supports[low] : NULL;
}

void drape_supports_stop(const drape_motion *motion, const drape_motion *before, const double *v0, double *v)
{
    const drape_model *m = motion->model;
    for (int32_t i = 0; i < m->support_count; i++) {
        const drape_support *now = &m->supports[i], *old = drape_support_of(before->model, now->node);
        const size_t at = 3 * (size_t)now->node;
        double n[2][3], had[2][3];
        const int count = directions(motion, now, n);
        const bool same =
            old && directions(before, old, had) == count && memcmp(n, had, (size_t)count * sizeof *n) == 0;
        const bool rests = same && !has_track(old) && memcmp(v + at, v0 + at, 3 * sizeof *v) == 0;
        if (!(same && has_track(now)) && !rests)
            project(count, n, v + at);
    }
}

/* Projects the three columns of a block, or its three rows. */
static void project_block(int count, double n[2][3], double *block, int64_t stride, bool rows)
{
    for (int k = 0; k < 3; k++) {
        double *at = block + (rows ? k : k * stride), v[3];
        const int64_t next = rows ? stride : 1;
        for (int r = 0; r < 3; r++)
            v[r] = at[r * next];
        project(count, n, v);
        for (int r = 0; r < 3; r++)
            at[r * next] = v[r];
    }
}

void drape_supports_project_matrix(const drape_motion *motion, const drape_pattern *pattern, double *values)
{
    const drape_model *m = motion->model;
    drape_periodic_project_matrix(m, pattern, values);
    for (int32_t i = 0; i < m->support_count; i++) {
        double n[2][3];
        const int count = directions(motion, &m->supports[i], n);
        const int32_t j = m->free_of_node[m->supports[i].node];
        int64_t stride;
        if (count == 0)
            continue;
        double *diagonal = drape_pattern_at(pattern, values, j, pattern->diagonal[j], &stride);
        const double largest = drape_pattern_largest(diagonal, stride), scale = largest > 0 ? largest : 1;
        for (int32_t k = pattern->block_start[j]; k < pattern->block_start[j + 1]; k++) {
            const int32_t row = pattern->block_row[k], mirrored = drape_pattern_find(pattern, j, row);
            double *block = drape_pattern_at(pattern, values, j, k, &stride);
            project_block(count, n, block, stride, true);
            block = drape_pattern_at(pattern, values, row, mirrored, &stride);
            project_block(count, n, block, stride, false);
        }
        diagonal = drape_pattern_at(pattern, values, j, pattern->diagonal[j], &stride);
        for (int d = 0; d < count; d++)
            for (int c = 0; c < 3; c++)
                vec3_add_scaled(scale * n[d][c], n[d], diagonal + c * stride);
    }
}

void drape_supports_keep_reactions(const drape_motion *motion, double *g)
{
    const drape_model *m = motion->model;
    for (int32_t f = 0; f < m->free_count; f++) {
        const int32_t node = m->node_of_free[f];
        double *at = g + 3 * (size_t)node, n[2][3], across[3];
        const drape_support *support = drape_support_of(m, node);
        if (drape_periodic_has(m, node))
            continue;
        if (!support) {
            memset(at, 0, 3 * sizeof *at);
            continue;
        }
        memcpy(across, at, sizeof across);
        project(directions(motion, support, n), n, across);
        vec3_add_scaled(-1, across, at);
    }
    for (int32_t s = 0; s < m->image_set_count; s++) {
        /* What the images of a node do not have in common, and what supports of theirs take from that. */
        const int32_t *node = m->image + m->image_start[s], count = m->image_start[s + 1] - m->image_start[s];
        const drape_support *support = drape_support_of(m, node[0]);
        double n[2][3], mean[3] = {0};
        if (m->free_of_node[node[0]] < 0)
            continue;
        for (int32_t i = 0; i < count; i++)
            vec3_add_scaled(1.0 / count, g + 3 * (size_t)node[i], mean);
        if (support)
            project(directions(motion, support, n), n, mean);
        for (int32_t i = 0; i < count; i++)
            vec3_add_scaled(-1, mean, g + 3 * (size_t)node[i]);
    }
}

/* ---- Supports that move ---- */

typedef struct change {
    double from, to; /* [s]; from -INFINITY: the whole of u(to) */
    bool rate;       /* u' between them, not u(to) - u(from) */
} change;

/* sum dual (normal . what the track has); false if the support does not move. */
static bool moves_by(const drape_motion *motion, const drape_support *support, const change *by, double u[3])
{
    const drape_model *m = motion->model;
    bool moves = false;
    memset(u, 0, 3 * sizeof *u);
    for (int i = 0; i < support->count && m->free_of_node[support->node] >= 0; i++) {
        double d[3], before[3];
        if (support->track[i] < 0)
            continue;
        const drape_track *track = &m->tracks[support->track[i]];
        if (by->rate)
            drape_track_velocity(track->keys, track->key_count, (by->from + by->to) / 2, d);
        else
            drape_track_displacement(track->keys, track->key_count, by->to, d);
        if (!by->rate && by->from > -INFINITY) {
            drape_track_displacement(track->keys, track->key_count, by->from, before);
            vec3_add_scaled(-1, before, d);
        }
        vec3_add_scaled(vec3_dot(support->normal[i], d), support->dual[i], u);
        moves = true;
    }
    const drape_placement *placed = &motion->cloth_placed[drape_model_cloth_of(m, support->node)];
    if (moves && placed->given)
        drape_placement_turn(placed, u, u);
    return moves;
}

/* sum of w . u over all supports that move, or y += scale u at them. */
static double visit(const drape_motion *motion, const change *by, const double *w, double scale, double *y)
{
    const drape_model *m = motion->model;
    double sum = 0, u[3];
    for (int32_t i = 0; m->supports_move && i < m->support_count; i++) {
        const size_t at = 3 * (size_t)m->supports[i].node;
        if (!moves_by(motion, &m->supports[i], by, u))
            continue;
        if (w)
            sum += vec3_dot(w + at, u);
        if (y)
            vec3_add_scaled(scale, u, y + at);
    }
    return sum;
}

void drape_supports_displace(const drape_motion *motion, double t, double sign, double *x)
{
    visit(motion, &(change){.from = -INFINITY, .to = t}, NULL, sign, x);
}

void drape_supports_add_velocity(const drape_motion *motion, const double span[2], bool instant, double *v)
{
    if (span[1] > span[0])
        visit(motion, &(change){.from = span[0], .to = span[1], .rate = instant}, NULL,
              instant ? 1 : 1 / (span[1] - span[0]), v);
}

double drape_supports_work(const drape_motion *motion, const double *g, double t0, double t1)
{
    return visit(motion, &(change){.from = t0, .to = t1}, g, 0, NULL);
}

double drape_supports_power(const drape_motion *motion, const double *g, double t)
{
    return visit(motion, &(change){.from = t, .to = t, .rate = true}, g, 0, NULL);
}

double drape_supports_kinetic(const drape_motion *motion, const double *v)
{
    const drape_model *m = motion->model;
    double energy = 0;
    for (int32_t i = 0; m->supports_move && i < m->support_count; i++) {
        double n[2][3];
        const int32_t node = m->supports[i].node;
        const int count = directions(motion, &m->supports[i], n);
        for (int d = 0; d < count; d++) {
            const double along = vec3_dot(n[d], v + 3 * (size_t)node);
            energy += 0.5 * m->mass[node] * along * along;
        }
    }
    return energy;
}

void drape_supports_hold(const drape_motion *motion, double t0, const double *x0, double t1, double *x)
{
    const drape_model *m = motion->model;
    for (int32_t i = 0; i < m->support_count; i++) {
        const size_t at = 3 * (size_t)m->supports[i].node;
        double n[2][3], moved[3], u[3];
        const int count = directions(motion, &m->supports[i], n);
        const bool moves = moves_by(motion, &m->supports[i], &(change){.from = t0, .to = t1}, u);
        for (int d = 0; d < count; d++) {
            vec3_sub(x + at, x0 + at, moved);
            if (moves)
                vec3_add_scaled(-1, u, moved);
            vec3_add_scaled(-vec3_dot(n[d], moved), n[d], x + at);
        }
    }
    drape_periodic_hold(m, x0, x);
}

void drape_supports_hold_velocity(const drape_motion *motion, const double span[2], bool instant, double *v)
{
    drape_supports_project(motion, v);
    drape_supports_add_velocity(motion, span, instant, v);
}
