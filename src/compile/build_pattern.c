/* build_pattern.c: the sparsity of the Jacobian from the elements that have a Hessian and from contact with
 * colliders, and the place of each element in it. */
#include "compile/stages.h"

drape_status drape_compile_pattern(drape_model *model)
{
    drape_coupling *couplings = drape_alloc(model->ctx, (size_t)model->term_count + 2, sizeof *couplings);
    if (!couplings)
        return DRAPE_E_MEMORY;
    const int count = drape_model_couplings(model, NULL, couplings);
    const size_t before = model->arena.bytes;
    drape_status status = drape_pattern_build(&model->arena, model->block_count, model->free_of_node,
                                              couplings, count, &model->pattern);
    model->pattern_bytes = model->arena.bytes - before;
    model->pattern.ranks = drape_model_ranks(model);
    drape_free(model->ctx, couplings);
    for (int32_t i = 0; !status && i < model->term_count; i++) {
        drape_term *term = &model->terms[i];
        status = drape_check_cancel(model->ctx);
        if (status || !drape_term_couples(term))
            continue;
        term->block = drape_arena_take(&model->arena, drape_term_places(term), sizeof *term->block);
        if (!term->block)
            return DRAPE_E_MEMORY;
        drape_term_place(term, &model->pattern, model->free_of_node, term->block);
    }
    return status;
}
