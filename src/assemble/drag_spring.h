/* drag_spring.h: springs from nodes to points in space, by which a host drags cloth: E = k/2 |x - target|^2
 * each. */
#ifndef DRAPE_ASSEMBLE_DRAG_SPRING_H
#define DRAPE_ASSEMBLE_DRAG_SPRING_H

#include "model/model.h"

#define DRAPE_MAX_DRAG_SPRINGS 64

typedef struct drape_drag_spring {
    int32_t node;
    double stiffness; /* k [N/m], > 0 */
    double target[3]; /* [m] */
} drape_drag_spring;

typedef struct drape_drag_springs {
    int32_t count;
    drape_drag_spring spring[DRAPE_MAX_DRAG_SPRINGS];
} drape_drag_springs;

static inline double drape_drag_springs_energy(const drape_drag_springs *springs, const double *x)
{
    double sum = 0;
    for (int32_t i = 0; i < springs->count; i++) {
        const drape_drag_spring *spring = &springs->spring[i];
        for (int k = 0; k < 3; k++) {
            double d = x[3 * (size_t)spring->node + (size_t)k] - spring->target[k];
            sum += spring->stiffness * d * d / 2;
        }
    }
    return sum;
}

/* Adds the gradient of their energy to g (node_count x 3). */
static inline void drape_drag_springs_add_gradient(const drape_drag_springs *springs, const double *x,
                                                   double *g)
{
    for (int32_t i = 0; i < springs->count; i++) {
        const drape_drag_spring *spring = &springs->spring[i];
        for (size_t k = 0; k < 3; k++) {
            size_t at = 3 * (size_t)spring->node + k;
            g[at] += spring->stiffness * (x[at] - spring->target[k]);
        }
    }
}

/* Adds their Hessian to values in the pattern; their nodes are free. */
static inline void drape_drag_springs_add_hessian(const drape_drag_springs *springs, const drape_model *model,
                                                  const drape_pattern *pattern, double *values)
{
    for (int32_t i = 0; i < springs->count; i++) {
        int64_t stride;
        int32_t j = model->free_of_node[springs->spring[i].node];
        double *to = drape_pattern_at(pattern, values, j, pattern->diagonal[j], &stride);
        for (int c = 0; c < 3; c++)
            to[c * stride + c] += springs->spring[i].stiffness;
    }
}

#endif
