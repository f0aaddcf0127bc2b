/*
 * distortion.c: finds the most distorted element, for the message of a failure that names only a node. If a
 * solve stagnates or a matrix is singular, the cause is most often an element that lost its shape: its
 * forces are quotients of lengths that are almost 0. It is searched for once, when a run ends, in the final
 * state.
 */
#include "base/vec3.h"
#include "sim/sim.h"

#include <math.h>
#include <stdio.h>

/* reported: an edge or altitude that changed from its rest length by more than this factor */
#define BADLY 10.0

typedef struct distortion {
    double size; /* the ratio or its inverse, whichever is larger */
    double ratio;
    const char *what, *of;
    const int32_t *node;
    int nodes;
} distortion;

static void keep(distortion *worst, distortion d)
{
    d.size = fmax(d.ratio, 1 / d.ratio);
    if (d.size > worst->size)
        *worst = d;
}

static double distance(const double *x, int32_t a, int32_t b)
{
    double d[3];
    vec3_sub(x + 3 * (size_t)b, x + 3 * (size_t)a, d);
    return vec3_norm(d);
}

/* The smallest of the triangle's altitudes: the one over its longest edge. */
static double altitude(const double *x, const int32_t *node)
{
    const double *a = x + 3 * (size_t)node[0];
    double u[3], w[3], normal[3];
    vec3_sub(x + 3 * (size_t)node[1], a, u);
    vec3_sub(x + 3 * (size_t)node[2], a, w);
    vec3_cross(u, w, normal);
    return vec3_norm(normal) / fmax(fmax(vec3_norm(u), vec3_norm(w)), distance(x, node[1], node[2]));
}

static distortion find(const drape_model *m, const double *x)
{
    distortion worst = {.size = 0};
    for (int32_t e = 0; e < m->edge_count; e++) {
        const int32_t *node = m->edge + 2 * (size_t)e;
        double ratio = distance(x, node[0], node[1]) / m->edge_length[e];
        keep(&worst, (distortion){0, ratio, "edge", "length", node, 2});
    }
    for (int32_t t = 0; t < m->triangle_count; t++) {
        const int32_t *node = m->triangle + 3 * (size_t)t;
        double ratio = altitude(x, node) / altitude(m->rest, node);
        keep(&worst, (distortion){0, ratio, "triangle", "altitude", node, 3});
    }
    return worst;
}

void drape_sim_describe_distortion(const drape_sim *sim, char *text, size_t size)
{
    const drape_model *m = sim->model;
    distortion d = find(m, drape_sim_state(sim)->x);
    *text = 0;
    if (!(d.size > BADLY))
        return;
    const drape_cloth *cloth = &m->cloths[drape_model_cloth_of(m, d.node[0])];
    char third[16] = "";
    if (d.nodes == 3)
        snprintf(third, sizeof third, " %d", (int)(d.node[2] - cloth->first_node));
    snprintf(text, size, "; most distorted: %s (nodes %d %d%s of %s): %s / rest %s = %.4g", d.what,
             (int)(d.node[0] - cloth->first_node), (int)(d.node[1] - cloth->first_node), third, cloth->name,
             d.of, d.of, d.ratio);
}
