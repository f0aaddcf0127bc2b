/*
 * field_strain.c: the largest principal strain of the sheet: of a triangle with edges e at rest and f now, each in
 * its own plane, F = [f1 f2] [e1 e2]^-1 has the largest singular value 1 + strain. A node has the mean of its
 * triangles, by their area at rest.
 */
#include "fields/fields.h"

#include "base/vec3.h"

#include <math.h>
#include <string.h>

/* Edges of a triangle in its plane: (l, 0) and (a, b). */
static void flatten(const double *x, const int32_t *node, double *l, double *a, double *b)
{
    double e1[3], e2[3];
    vec3_sub(x + 3 * (size_t)node[1], x + 3 * (size_t)node[0], e1);
    vec3_sub(x + 3 * (size_t)node[2], x + 3 * (size_t)node[0], e2);
    *l = vec3_norm(e1);
    *a = *l > 0 ? vec3_dot(e1, e2) / *l : 0;
    *b = sqrt(fmax(0, vec3_dot(e2, e2) - *a * *a));
}

/* The singular values of F = [p q; 0 r] are ((p + r)^2 + q^2)^1/2 and ((p - r)^2 + q^2)^1/2, their sum and
 * difference halved. */
static double largest_stretch(const double *rest, const double *x, const int32_t *node)
{
    double l, a, b, l0, a0, b0;
    flatten(rest, node, &l0, &a0, &b0);
    flatten(x, node, &l, &a, &b);
    double p = l / l0, q = (a - p * a0) / b0, r = b / b0;
    return 0.5 * (hypot(p + r, q) + hypot(p - r, q));
}

static drape_status measure(drape_sim *sim, const double *x, double *values)
{
    const drape_model *m = sim->model;
    memset(values, 0, (size_t)m->node_count * sizeof *values);
    for (int32_t c = 0; c < m->cloth_count; c++) {
        const drape_cloth *cloth = &m->cloths[c];
        for (int32_t t = 0; t < cloth->mesh.triangle_count; t++) {
            const int32_t *node = m->triangle + 3 * (size_t)(cloth->first_triangle + t);
            double strain = largest_stretch(m->rest, x, node) - 1;
            for (int k = 0; k < 3; k++)
                values[node[k]] += strain * cloth->mesh.triangle_area[t] / 3;
        }
        for (int32_t i = 0; i < cloth->mesh.node_count; i++)
            values[cloth->first_node + i] /= cloth->mesh.node_area[i];
    }
    return DRAPE_OK;
}

const drape_field_ops drape_field_strain = {
    .name = "strain",
    .unit = "1",
    .summary = "largest principal strain of the sheet",
    .shown = 100,
    .shown_unit = "%",
    .measure = measure,
};
