/*
 * field_energy.c: the density of elastic energy. An element's is shared by its nodes, and a node's divided by its
 * area at rest.
 */
#include "fields/fields.h"

#include <string.h>

#define BLOCK 64 /* elements at once */
#define D     DRAPE_MAX_ELEMENT_DOFS

/* 1/2 k (q - q0)^2, and that of the laws that have one, where the sheet stands still. */
static double energy_of_measure(const drape_term *term, int32_t e, double q)
{
    const drape_elements *el = &term->elements;
    double k = el->rest[e], strain = q - el->rest[(size_t)el->count + (size_t)e],
           sum = k * strain * strain / 2;
    for (int i = 0; i < term->law_count; i++) {
        const drape_term *law = term->laws[i];
        double force, by_strain, by_rate, energy = 0;
        if (law->ops->dissipative)
            continue;
        law->ops->law(law->params, k, strain, 0, &force, &by_strain, &by_rate, &energy);
        sum += energy;
    }
    return sum;
}

static void evaluate(const drape_term *term, const double *x, const double *internal, int32_t first,
                     int32_t count, double *energy)
{
    double gradient[BLOCK * D];
    if (!term->ops->measure) {
        term->ops->energy(&term->elements, first, count, x, internal, energy, gradient, NULL);
        return;
    }
    term->ops->measure(&term->elements, first, count, x, internal, energy, NULL, NULL);
    for (int32_t i = 0; i < count; i++)
        energy[i] = energy_of_measure(term, first + i, energy[i]);
}

static void add_term(const drape_sim *sim, const drape_term *term, const double *x, double *values)
{
    const drape_elements *el = &term->elements;
    const double *internal =
        term->first_internal >= 0 ? drape_sim_state(sim)->internal + term->first_internal : NULL;
    for (int32_t first = 0; first < el->count; first += BLOCK) {
        int32_t count = el->count - first < BLOCK ? el->count - first : BLOCK;
        double energy[BLOCK];
        evaluate(term, x, internal, first, count, energy);
        for (int32_t i = 0; i < count * el->nodes; i++)
            values[el->node[(size_t)first * (size_t)el->nodes + (size_t)i]] +=
                energy[i / el->nodes] / el->nodes;
    }
}

static drape_status measure(drape_sim *sim, const double *x, double *values)
{
    const drape_model *m = sim->model;
    memset(values, 0, (size_t)m->node_count * sizeof *values);
    for (int32_t i = 0; i < m->term_count; i++) {
        const drape_term_ops *ops = m->terms[i].ops;
        if ((ops->measure || ops->energy) && !ops->potential_of_gravity)
            add_term(sim, &m->terms[i], x, values);
    }
    for (int32_t c = 0; c < m->cloth_count; c++)
        for (int32_t i = 0; i < m->cloths[c].mesh.node_count; i++)
            values[m->cloths[c].first_node + i] /= m->cloths[c].mesh.node_area[i];
    return DRAPE_OK;
}

const drape_field_ops drape_field_energy = {
    .name = "energy",
    .unit = "J/m2",
    .summary = "elastic energy of the sheet by its area",
    .shown = 1,
    .shown_unit = "J/m²",
    .measure = measure,
};
