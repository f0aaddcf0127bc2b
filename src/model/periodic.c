/* periodic.c: see periodic.h. */
#include "model/periodic.h"

#include "base/vec3.h"

#include <assert.h>
#include <math.h>
#include <string.h>

/* The images of a node. */
typedef struct images {
    const int32_t *node; /* (count) */
    int32_t count;
} images;

static images images_in(const drape_model *m, int32_t set)
{
    const int32_t first = m->image_start[set];
    return (images){m->image + first, m->image_start[set + 1] - first};
}

static bool are_free(const drape_model *m, const images *of)
{
    return m->free_of_node[of->node[0]] >= 0;
}

/* ---- Vectors ---- */

/* row: of each node in v, free_of_node; NULL: its number. */
static void project(const drape_model *m, const int32_t *row, double *v)
{
    for (int32_t s = 0; s < m->image_set_count; s++) {
        const images of = images_in(m, s);
        double mean[3] = {0};
        if (!are_free(m, &of))
            continue;
        for (int32_t i = 0; i < of.count; i++)
            vec3_add_scaled(1.0 / of.count, v + 3 * (size_t)(row ? row[of.node[i]] : of.node[i]), mean);
        for (int32_t i = 0; i < of.count; i++)
            memcpy(v + 3 * (size_t)(row ? row[of.node[i]] : of.node[i]), mean, sizeof mean);
    }
}

void drape_periodic_project(const drape_model *m, double *nodes)
{
    project(m, NULL, nodes);
}

void drape_periodic_project_free(const drape_model *m, double *free_nodes)
{
    project(m, m->free_of_node, free_nodes);
}

void drape_periodic_hold(const drape_model *m, const double *x0, double *x)
{
    for (int32_t s = 0; s < m->image_set_count; s++) {
        const images of = images_in(m, s);
        double mean[3] = {0};
        for (int32_t i = 0; i < of.count; i++)
            for (size_t k = 0, at = 3 * (size_t)of.node[i]; k < 3; k++)
                mean[k] += (x[at + k] - x0[at + k]) / of.count;
        for (int32_t i = 0; are_free(m, &of) && i < of.count; i++)
            for (size_t k = 0, at = 3 * (size_t)of.node[i]; k < 3; k++)
                x[at + k] = x0[at + k] + mean[k];
    }
}

void drape_periodic_least(const drape_model *m, double *of_node)
{
    for (int32_t s = 0; s < m->image_set_count; s++) {
        const images of = images_in(m, s);
        double least = INFINITY;
        for (int32_t i = 0; i < of.count; i++)
            least = fmin(least, of_node[of.node[i]]);
        for (int32_t i = 0; i < of.count; i++)
            of_node[of.node[i]] = least;
    }
}

void drape_periodic_share(const drape_model *m, double *of_node)
{
    for (int32_t s = 0; s < m->image_set_count; s++) {
        const images of = images_in(m, s);
        double sum = 0;
        for (int32_t i = 0; i < of.count; i++)
            sum += of_node[of.node[i]];
        for (int32_t i = 0; i < of.count; i++)
            of_node[of.node[i]] = sum / of.count;
    }
}

/* ---- Matrices ---- */

static double *block_at(const drape_pattern *p, double *values, int32_t row, int32_t column, int64_t *stride)
{
    return drape_pattern_at(p, values, column, drape_pattern_find(p, row, column), stride);
}

/* The mean of blocks in one row, those of the images' columns or, transposed, in one column, those of their
 * rows. */
static void average_blocks(const drape_model *m, const drape_pattern *p, const images *of, int32_t other,
                           bool transposed, double *values)
{
    double mean[9] = {0};
    for (int pass = 0; pass < 2; pass++)
        for (int32_t i = 0; i < of->count; i++) {
            const int32_t own = m->free_of_node[of->node[i]];
            int64_t stride;
            double *block = transposed ? block_at(p, values, own, other, &stride)
                                       : block_at(p, values, other, own, &stride);
            for (int k = 0; k < 9; k++) {
                double *at = block + k / 3 * stride + k % 3;
                if (pass == 0)
                    mean[k] += *at / of->count;
                else
                    *at = mean[k];
            }
        }
}

void drape_periodic_project_matrix(const drape_model *m, const drape_pattern *p, double *values)
{
    for (int32_t s = 0; s < m->image_set_count; s++) {
        const images of = images_in(m, s);
        double scale = 0;
        if (!are_free(m, &of))
            continue;
        const int32_t first = m->free_of_node[of.node[0]];
        for (int32_t i = 0; i < of.count; i++) {
            const int32_t own = m->free_of_node[of.node[i]];
            int64_t stride;
            const double *diagonal = drape_pattern_at(p, values, own, p->diagonal[own], &stride);
            scale = fmax(scale, drape_pattern_largest(diagonal, stride));
            assert(p->block_start[own + 1] - p->block_start[own] ==
                   p->block_start[first + 1] - p->block_start[first]);
        }
        for (int32_t k = p->block_start[first]; k < p->block_start[first + 1]; k++)
            average_blocks(m, p, &of, p->block_row[k], false, values);
        for (int32_t k = p->block_start[first]; k < p->block_start[first + 1]; k++)
            average_blocks(m, p, &of, p->block_row[k], true, values);
        scale = scale > 0 ? scale : 1;
        for (int32_t k = 0; k < of.count * of.count; k++) { /* adds s (I - P), of the size of a block s */
            const int32_t i = of.node[k / of.count], j = of.node[k % of.count];
            int64_t stride;
            double *block = block_at(p, values, m->free_of_node[i], m->free_of_node[j], &stride);
            for (int c = 0; c < 3; c++)
                block[c * stride + c] += scale * ((i == j) - 1.0 / of.count);
        }
    }
}
