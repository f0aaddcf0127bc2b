/*
 * load.pressure: a pressure p that follows the surface: E = -p V with the volume
 *     V = 1/6 sum over triangles of X0 . (X1 x X2),  X = x - c,
 * between the cloth and the point c (Bufler 1984: such loads have a potential). Its gradient on a
 * node in the interior is -p/3 times the sum of the areas around it as vectors, whatever c is, and its
 * Hessian their exact derivative: the forces that are not symmetric in one triangle are so together. At the
 * boundary that holds if it is pinned, or lies in planes through c across which its nodes are held: the
 * cone from c over the boundary is then at rest, or slides in itself. At a free boundary the forces are
 * those on the cloth closed by that cone.
 */
#include "base/vec3.h"
#include "terms/load_edges.h"
#include "terms/terms.h"

#include <math.h>
#include <string.h>

#define CLOSED 1e-3 /* of the length of an edge: how far the edges of a closed tube may be apart */

enum { LIST_PRESSURE, LIST_POINT, LIST_HISTORY, LIST_RAMP, LIST_COUNT };
enum { PARAM_PRESSURE, PARAM_POINT };

static const drape_param params[LIST_COUNT] = {
    [LIST_PRESSURE] = DRAPE_NUMBER("pressure", "Pa", DRAPE_REQUIRED, -1e12, 1e12,
                                   "by which it is higher on the side from which triangles turn clockwise"),
    [LIST_POINT] = DRAPE_VECTOR("point", "m", 0, -1e9, 1e9,
                                "apex of the cone that closes the volume over the boundary: in the "
                                "planes of symmetry"),
    [LIST_HISTORY] = DRAPE_TERM_HISTORY_PARAM,
    [LIST_RAMP] = DRAPE_TERM_RAMP_PARAM,
};

/* Whether the cells of a cloth lie side by side: a periodic edge is not where its image starts, as it is in a
 * closed tube. The cones over both then do not cancel. */
static bool is_repeated(const drape_cloth_view *cloth)
{
    for (int32_t e = 0; cloth->edge_image && e < cloth->edge_count; e++) {
        double nearest = HUGE_VAL;
        for (int k = 0; cloth->edge_image[e] >= 0 && k < 2; k++) {
            double apart[3];
            vec3_sub(cloth->start + 3 * (size_t)cloth->edge[2 * (size_t)cloth->edge_image[e] + (size_t)k],
                     cloth->start + 3 * (size_t)cloth->edge[2 * (size_t)e], apart);
            nearest = fmin(nearest, vec3_norm(apart));
        }
        if (cloth->edge_image[e] >= 0 && nearest > CLOSED * cloth->edge_length[e])
            return true;
    }
    return false;
}

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    (void)values;
    DRAPE_TRY(drape_load_check_faces(cloth, builder));
    if (is_repeated(cloth))
        return drape_term_refuse(builder,
                                 "its volume ends at periodic edges that are apart, where its forces "
                                 "would be wrong: \"load.follower\" has the right ones");
    DRAPE_TRY(drape_term_reserve(builder, cloth->triangle_count, 0));
    for (int32_t t = 0; t < cloth->triangle_count; t++)
        drape_term_set(builder, t, cloth->triangle + 3 * (size_t)t, NULL);
    return DRAPE_OK;
}

/* h (9 x 9): the block of corner a and its next corner b is -s times the derivative of X_b x X_c by X_b, c
 * the third one, which is the cross product with X_c from the right. */
static void add_hessian(double s, double x[3][3], double *h)
{
    for (int a = 0; a < 3; a++) {
        const int b = (a + 1) % 3;
        const double *v = x[(a + 2) % 3];
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3; /* (X_b x v)_i = X_b,j v_k - X_b,k v_j */
            h[9 * (3 * a + i) + 3 * b + j] = h[9 * (3 * b + j) + 3 * a + i] = -s * v[k];
            h[9 * (3 * a + i) + 3 * b + k] = h[9 * (3 * b + k) + 3 * a + i] = s * v[j];
        }
    }
}

static void energy(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *internal, double *e, double *g, double *hess)
{
    const double s = el->params[PARAM_PRESSURE] / 6;
    (void)internal;
    for (int32_t i = 0; i < count; i++) {
        const int32_t *node = el->node + 3 * (size_t)(first + i);
        double at[3][3], cross[3][3];
        for (int a = 0; a < 3; a++)
            vec3_sub(x + 3 * (size_t)node[a], el->params + PARAM_POINT, at[a]);
        for (int a = 0; a < 3; a++)
            vec3_cross(at[(a + 1) % 3], at[(a + 2) % 3], cross[a]);
        if (e)
            e[i] = -s * vec3_dot(at[0], cross[0]);
        for (int k = 0; g && k < 9; k++)
            g[9 * (size_t)i + (size_t)k] = -s * cross[k / 3][k % 3];
        if (hess) {
            memset(hess + 81 * (size_t)i, 0, 81 * sizeof *hess);
            add_hessian(s, at, hess + 81 * (size_t)i);
        }
    }
}

const drape_term_ops drape_term_load_pressure = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "load.pressure",
              .summary = "a pressure that follows the surface: E = -p V with the volume under the cloth",
              .reference = "Bufler 1984, Pressure loaded structures under large deformations",
              DRAPE_PARAMS(params)},
    .element_name = "triangle",
    .nodes = 3,
    .external = true,
    .build = build,
    .energy = energy,
};
