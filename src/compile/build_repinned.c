/* build_repinned.c: a model with other nodes pinned, or other masses. What depends on which nodes are free
 * is computed anew: their numbers, the pattern of the matrix, and the places of elements in it; and what
 * depends on masses: weights and the stiffness of contact. Everything else is shared. */
#include "compile/compile.h"
#include "compile/stages.h"
#include "model/periodic.h"

#include <string.h>

static drape_status number(drape_model *model, const uint8_t *pinned)
{
    const drape_model *base = model->base;
    const size_t nodes = (size_t)model->node_count;
    int32_t *track_of_node = drape_alloc(model->ctx, nodes, sizeof *track_of_node);
    model->pinned = drape_arena_take(&model->arena, nodes, sizeof *model->pinned);
    model->free_of_node = drape_arena_take(&model->arena, nodes, sizeof *model->free_of_node);
    model->free_count = model->moved_count = 0;
    drape_status status = track_of_node ? drape_arena_status(&model->arena) : DRAPE_E_MEMORY;
    if (!status) {
        for (size_t i = 0; i < nodes; i++)
            model->pinned[i] = pinned[i] != 0;
        for (int32_t i = 0; i < base->node_count; i++)
            track_of_node[i] = -1;
        for (int32_t i = 0; i < base->moved_count; i++)
            if (pinned[base->moved_node[i]])
                track_of_node[base->moved_node[i]] = base->moved_track[i];
        status = drape_compile_pinned_images(model);
        if (!status)
            status = drape_compile_number_nodes(model, track_of_node);
    }
    drape_free(model->ctx, track_of_node);
    return status;
}

/* mass (node_count) */
static drape_status weigh(drape_model *model, const double *mass)
{
    const size_t nodes = (size_t)model->node_count, cloths = (size_t)model->cloth_count;
    const drape_cloth *from = model->cloths;
    model->mass = drape_arena_take(&model->arena, nodes, sizeof *model->mass);
    model->cloths = drape_arena_take(&model->arena, cloths, sizeof *model->cloths);
    DRAPE_TRY(drape_arena_status(&model->arena));
    memcpy(model->mass, mass, nodes * sizeof *mass);
    drape_periodic_share(model, model->mass);
    for (size_t c = 0; c < cloths; c++) {
        model->cloths[c] = from[c];
        model->cloths[c].node_mass = model->mass + from[c].first_node;
    }
    DRAPE_TRY(drape_compile_weight(model));
    return drape_compile_contact_stiffness(model, NULL);
}

drape_status drape_compile_repinned(drape_context *ctx, const drape_model *base, const uint8_t *pinned,
                                    const double *mass, drape_model **out)
{
    drape_model *model = *out = drape_alloc(ctx, 1, sizeof *model);
    if (!model)
        return DRAPE_E_MEMORY;
    *model = *base;
    model->base = base;
    model->arena = drape_arena_of(ctx);
    model->ctx = ctx;
    model->terms = drape_arena_take(&model->arena, (size_t)model->term_count, sizeof *model->terms);
    drape_status status = drape_arena_status(&model->arena);
    for (int32_t i = 0; !status && i < model->term_count; i++) {
        drape_term *term = &model->terms[i];
        *term = base->terms[i];
        term->block = NULL;
        if (term->elements.parts)
            term->elements.parts = &term->parts;
    }
    if (!status)
        status = number(model, pinned ? pinned : base->pinned);
    if (!status && mass)
        status = weigh(model, mass);
    if (!status)
        status = drape_compile_pattern(model);
    if (status)
        drape_model_destroy(out);
    return status;
}
