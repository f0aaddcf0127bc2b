/* field_strain.c: the largest principal strain of the sheet. A node has the mean over its triangles,
 * weighted by their rest areas. */
#include "fields/fields.h"

#include <string.h>

void drape_field_node_strain(const drape_model *m, const double *x, double *strain, double *values)
{
    drape_model_strain(m, x, strain);
    memset(values, 0, (size_t)m->node_count * sizeof *values);
    for (int32_t c = 0; c < m->cloth_count; c++) {
        const drape_cloth *cloth = &m->cloths[c];
        for (int32_t t = 0; t < cloth->mesh.triangle_count; t++) {
            const size_t at = (size_t)(cloth->first_triangle + t);
            for (int k = 0; k < 3; k++)
                values[m->triangle[3 * at + (size_t)k]] += strain[2 * at] * cloth->mesh.triangle_area[t] / 3;
        }
        for (int32_t i = 0; i < cloth->mesh.node_count; i++)
            values[cloth->first_node + i] /= cloth->mesh.node_area[i];
    }
}

static drape_status measure(drape_sim *sim, const double *x, double *values)
{
    double *strain = drape_alloc(sim->ctx, 2 * (size_t)sim->model->triangle_count, sizeof *strain);
    if (!strain)
        return DRAPE_E_MEMORY;
    drape_field_node_strain(sim->model, x, strain, values);
    drape_free(sim->ctx, strain);
    return DRAPE_OK;
}

const drape_field_ops drape_field_strain = {
    .entry = {.name = "strain", .summary = "largest principal strain of the sheet"},
    .unit = "1",
    .shown = 100,
    .shown_unit = "%",
    .measure = measure,
};
