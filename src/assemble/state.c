/* state.c: see state.h. */
#include "assemble/state.h"

#include "base/hash.h"

#include <string.h>

drape_status drape_state_create(drape_arena *arena, const drape_model *model, drape_state *state)
{
    size_t n = 3 * (size_t)model->node_count;
    state->t = 0;
    state->x = drape_arena_take(arena, n, sizeof *state->x);
    state->v = drape_arena_take(arena, n, sizeof *state->v);
    state->internal = drape_arena_take(arena, (size_t)model->internal_count, sizeof *state->internal);
    if (!state->x || !state->v || !state->internal)
        return DRAPE_E_MEMORY;
    memcpy(state->x, model->start, n * sizeof *state->x);
    memcpy(state->v, model->velocity, n * sizeof *state->v);
    drape_model_place_pins(model, 0, state->x);
    for (int32_t i = 0; i < model->term_count; i++) {
        const drape_term *term = &model->terms[i];
        if (term->ops->initial)
            term->ops->initial(&term->elements, 0, drape_term_pieces(term).count, model->start,
                               state->internal + term->first_internal);
    }
    return DRAPE_OK;
}

void drape_state_commit(const drape_model *model, const drape_state *before, drape_state *after)
{
    for (int32_t i = 0; i < model->term_count; i++) {
        const drape_term *term = &model->terms[i];
        if (term->ops->commit)
            term->ops->commit(&term->elements, 0, drape_term_pieces(term).count, after->x,
                              before->internal + term->first_internal,
                              after->internal + term->first_internal);
    }
}

uint64_t drape_state_hash(const drape_model *model, const drape_state *state)
{
    size_t n = 3 * (size_t)model->node_count * sizeof(double);
    uint64_t hash = drape_hash_bytes(DRAPE_HASH_START, &state->t, sizeof state->t);
    hash = drape_hash_bytes(hash, state->x, n);
    hash = drape_hash_bytes(hash, state->v, n);
    return drape_hash_bytes(hash, state->internal, (size_t)model->internal_count * sizeof(double));
}
