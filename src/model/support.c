/* support.c: see support.h. */
#include "model/support.h"

#include "base/vec3.h"

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
    for (int32_t i = 0; i < m->support_count; i++) {
        double n[2][3];
        project(directions(motion, &m->supports[i], n), n, nodes + 3 * (size_t)m->supports[i].node);
    }
}

void drape_supports_project_free(const drape_motion *motion, double *free_nodes)
{
    const drape_model *m = motion->model;
    for (int32_t i = 0; i < m->support_count; i++) {
        double n[2][3];
        const int count = directions(motion, &m->supports[i], n);
        if (count > 0)
            project(count, n, free_nodes + 3 * (size_t)m->free_of_node[m->supports[i].node]);
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

static double largest_entry(const double *block, int64_t stride)
{
    double largest = 0;
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++)
            largest = fmax(largest, fabs(block[c * stride + r]));
    return largest > 0 ? largest : 1;
}

void drape_supports_project_matrix(const drape_motion *motion, const drape_pattern *pattern, double *values)
{
    const drape_model *m = motion->model;
    for (int32_t i = 0; i < m->support_count; i++) {
        double n[2][3];
        const int count = directions(motion, &m->supports[i], n);
        const int32_t j = m->free_of_node[m->supports[i].node];
        int64_t stride;
        if (count == 0)
            continue;
        double *diagonal = drape_pattern_at(pattern, values, j, pattern->diagonal[j], &stride);
        const double scale = largest_entry(diagonal, stride);
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
    int32_t next = 0; /* supports are in the order of their nodes */
    for (int32_t f = 0; f < m->free_count; f++) {
        double *at = g + 3 * (size_t)m->node_of_free[f], n[2][3], across[3];
        while (next < m->support_count && m->supports[next].node < m->node_of_free[f])
            next++;
        if (next == m->support_count || m->supports[next].node != m->node_of_free[f]) {
            memset(at, 0, 3 * sizeof *at);
            continue;
        }
        memcpy(across, at, sizeof across);
        project(directions(motion, &m->supports[next], n), n, across);
        vec3_add_scaled(-1, across, at);
    }
}

void drape_supports_hold(const drape_motion *motion, const double *x0, double *x, double *v)
{
    const drape_model *m = motion->model;
    for (int32_t i = 0; i < m->support_count; i++) {
        const size_t at = 3 * (size_t)m->supports[i].node;
        double n[2][3], moved[3];
        const int count = directions(motion, &m->supports[i], n);
        for (int d = 0; d < count; d++) {
            vec3_sub(x + at, x0 + at, moved);
            vec3_add_scaled(-vec3_dot(n[d], moved), n[d], x + at);
        }
        project(count, n, v + at);
    }
}
