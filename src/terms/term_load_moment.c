/*
 * load.moment: a moment per length on edges of the boundary, about each edge: E = M L theta, theta the angle
 * from the triangle to the direction r in space that it had at rest, as of a hinge whose second apex is (x0 +
 * x1)/2 + r, and L the length at rest. It bends a strip to the curvature M/D, however far: M follows the
 * edge, and since it has a potential its Hessian is symmetric. Where the edge turns in its own plane the
 * moment is about where it is.
 *
 * The internal variable is the angle of the last accepted state: the next is on the branch nearest to it.
 */
#include "base/vec3.h"
#include "terms/dihedral.h"
#include "terms/load.h"
#include "terms/terms.h"

#include <math.h>
#include <string.h>

enum { LIST_MOMENT = DRAPE_LOAD_LIST_COUNT, LIST_COUNT };
enum { PARAM_MOMENT = DRAPE_LOAD_COUNT };
enum { REST_MOMENT, REST_X, REST_Y, REST_Z, REST_COUNT }; /* M L [N m], r [m] */

static const drape_param params[LIST_COUNT] = {
    DRAPE_LOAD_PARAMS,
    [LIST_MOMENT] =
        {.name = "moment",
         .kind = DRAPE_PARAM_NUMBER,
         .unit = "N",
         .default_value = NAN,
         .min = -1e12,
         .max = 1e12,
         .help = "moment per length of the edge [N m/m]; positive: it bends towards the side from which "
                 "triangles turn counterclockwise"},
};

/* The edge as its triangle turns, then the apex. */
static void corners(const drape_cloth_view *cloth, int32_t e, int32_t node[3])
{
    const int32_t t = cloth->edge_triangle[2 * (size_t)e];
    for (int k = 0; k < 3; k++)
        if (cloth->triangle_edge[3 * (size_t)t + (size_t)k] == e)
            for (int i = 0; i < 3; i++)
                node[i] = cloth->triangle[3 * (size_t)t + (size_t)((k + i) % 3)];
}

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    int32_t count, next = 0;
    drape_status status = drape_load_count(cloth, values, builder, &count);
    if (!status)
        status = drape_term_reserve(builder, count, REST_COUNT);
    for (int32_t e = 0; !status && e < cloth->edge_count; e++) {
        int32_t node[3];
        double rest[REST_COUNT] = {values[PARAM_MOMENT] * cloth->edge_length[e]};
        if (!drape_load_takes(cloth, values, e))
            continue;
        corners(cloth, e, node);
        const double *a = cloth->rest + 3 * (size_t)node[0], *b = cloth->rest + 3 * (size_t)node[1];
        for (int k = 0; k < 3; k++)
            rest[REST_X + k] = (a[k] + b[k]) / 2 - cloth->rest[3 * (size_t)node[2] + (size_t)k];
        drape_term_set(builder, next++, node, rest);
    }
    return status;
}

static double rest_of(const drape_elements *el, int item, int32_t element)
{
    return el->rest[(size_t)item * (size_t)el->count + (size_t)element];
}

/* theta, with derivatives by the three nodes: those by the second apex go to x0 and x1, by halves. */
static double angle(const drape_elements *el, int32_t element, const double *x, double g[12], double h[144])
{
    const int32_t *node = el->node + 3 * (size_t)element;
    double at[12], theta;
    for (int a = 0; a < 3; a++)
        memcpy(at + 3 * a, x + 3 * (size_t)node[a], 3 * sizeof *at);
    for (int i = 0; i < 3; i++)
        at[9 + i] = (at[i] + at[3 + i]) / 2 + rest_of(el, REST_X + i, element);
    drape_dihedrals(1, at, &theta, g, h);
    drape_dihedral_tie(g, h);
    return theta;
}

static void energy(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *internal, double *e, double *g, double *hess)
{
    for (int32_t i = 0; i < count; i++) {
        const double moment = rest_of(el, REST_MOMENT, first + i);
        double dq[12], ddq[144];
        const double theta = angle(el, first + i, x, g ? dq : NULL, hess ? ddq : NULL);
        if (e)
            e[i] = moment * drape_nearest_branch(theta, internal[first + i]);
        for (int k = 0; g && k < 9; k++)
            g[9 * (size_t)i + (size_t)k] = moment * dq[k];
        for (int k = 0; hess && k < 81; k++)
            hess[81 * (size_t)i + (size_t)k] = moment * ddq[12 * (k / 9) + k % 9];
    }
}

static void initial(const drape_elements *el, int32_t first, int32_t count, const double *x, double *after)
{
    for (int32_t i = first; i < first + count; i++)
        after[i] = angle(el, i, x, NULL, NULL);
}

static void commit(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *before, double *after)
{
    for (int32_t i = first; i < first + count; i++)
        after[i] = drape_nearest_branch(angle(el, i, x, NULL, NULL), before[i]);
}

const drape_term_ops drape_term_load_moment = {
    .struct_size = sizeof(drape_term_ops),
    .name = "load.moment",
    .summary = "a moment per length on edges of the boundary, about each edge: bends a strip to M/D",
    .reference = "work of a couple on the angle of the triangle at the edge",
    .params = params,
    .param_count = LIST_COUNT,
    .element_name = "edge",
    .nodes = 3,
    .has_internal = true,
    .potential_of_gravity = true,
    .build = build,
    .energy = energy,
    .initial = initial,
    .commit = commit,
};
