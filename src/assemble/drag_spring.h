/* drag_spring.h: a spring from a node to a point in space, by which a host drags cloth: E = k/2 |x -
 * target|^2. */
#ifndef DRAPE_ASSEMBLE_DRAG_SPRING_H
#define DRAPE_ASSEMBLE_DRAG_SPRING_H

#include "model/model.h"

typedef struct drape_drag_spring {
    int32_t node;
    double stiffness; /* k [N/m]; 0: no spring */
    double target[3]; /* [m] */
} drape_drag_spring;

static inline double drape_drag_spring_energy(const drape_drag_spring *spring, const double *x)
{
    double sum = 0;
    for (int k = 0; spring->stiffness > 0 && k < 3; k++) {
        double d = x[3 * (size_t)spring->node + (size_t)k] - spring->target[k];
        sum += spring->stiffness * d * d / 2;
    }
    return sum;
}

/* Adds the gradient of the spring's energy to g (node_count x 3). */
static inline void drape_drag_spring_add_gradient(const drape_drag_spring *spring, const double *x, double *g)
{
    for (size_t k = 0; spring->stiffness > 0 && k < 3; k++) {
        size_t at = 3 * (size_t)spring->node + k;
        g[at] += spring->stiffness * (x[at] - spring->target[k]);
    }
}

/* Adds the spring's Hessian to values in the pattern; its node is free. */
static inline void drape_drag_spring_add_hessian(const drape_drag_spring *spring, const drape_model *model,
                                                 const drape_pattern *pattern, double *values)
{
    if (!(spring->stiffness > 0))
        return;
    int64_t stride;
    int32_t j = model->free_of_node[spring->node];
    double *to = drape_pattern_at(pattern, values, j, pattern->diagonal[j], &stride);
    for (int c = 0; c < 3; c++)
        to[c * stride + c] += spring->stiffness;
}

#endif
