/* build_pattern.c: sparsity of the Jacobian from the elements that have a Hessian, and each element's place
 * in it. */
#include "compile/stages.h"

static bool has_sparsity(const drape_term *term)
{
    return !term->ops->law && !term->ops->linear && term->elements.count > 0;
}

static drape_status place_term(drape_model *model, drape_term *term)
{
    const drape_elements *el = &term->elements;
    size_t pairs = (size_t)(el->nodes * el->nodes);
    int32_t *block = drape_arena_take(&model->arena, model->ctx, (size_t)el->count * pairs, sizeof *block);
    if (!block)
        return DRAPE_E_MEMORY;
    term->block = block;
    for (int32_t e = 0; e < el->count; e++) {
        const int32_t *node = el->node + (size_t)e * (size_t)el->nodes;
        for (int a = 0; a < el->nodes; a++)
            for (int b = 0; b < el->nodes; b++)
                *block++ = drape_pattern_find(&model->pattern, model->free_of_node[node[a]],
                                              model->free_of_node[node[b]]);
    }
    return DRAPE_OK;
}

drape_status drape_compile_pattern(drape_model *model)
{
    drape_coupling *couplings = drape_alloc(model->ctx, (size_t)model->term_count, sizeof *couplings);
    if (!couplings)
        return DRAPE_E_MEMORY;
    int count = 0;
    for (int32_t i = 0; i < model->term_count; i++)
        if (has_sparsity(&model->terms[i])) {
            const drape_elements *el = &model->terms[i].elements;
            couplings[count++] = (drape_coupling){.count = el->count, .nodes = el->nodes, .node = el->node};
        }
    drape_status status = drape_pattern_build(model->ctx, model->free_count, model->free_of_node, couplings,
                                              count, &model->pattern);
    drape_free(model->ctx, couplings);
    for (int32_t i = 0; !status && i < model->term_count; i++)
        if (has_sparsity(&model->terms[i]))
            status = place_term(model, &model->terms[i]);
    return status;
}
