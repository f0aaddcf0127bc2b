/* state.c: see state.h. */
#include "assemble/state.h"

#include "base/hash.h"
#include "model/slider.h"

#include <math.h>
#include <string.h>

/* The strains q - q0 of a range of at most DRAPE_PAIR_BLOCK elements. */
static void strains_of(const drape_term *term, int32_t first, int32_t count, double t, const double *x,
                       const double *internal, double *strain)
{
    const drape_elements el = drape_term_elements(term, t);
    const double *q0 = el.rest + (size_t)el.count + first;
    term->ops->measure(&el, first, count, x, drape_term_own(term, internal), strain, NULL, NULL);
    for (int32_t i = 0; i < count; i++)
        strain[i] -= q0[i];
}

static void all_strains_of(const drape_term *term, double t, const double *x, const double *internal,
                           double *strain)
{
    const int32_t elements = term->elements.count;
    for (int32_t e = 0; e < elements; e += DRAPE_PAIR_BLOCK)
        strains_of(term, e, elements - e < DRAPE_PAIR_BLOCK ? elements - e : DRAPE_PAIR_BLOCK, t, x, internal,
                   strain + e);
}

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
        const drape_elements el = drape_term_elements(term, 0);
        if (term->ops->initial)
            term->ops->initial(&el, 0, drape_term_pieces(term).count, model->start,
                               state->internal + term->first_internal);
        double *slid = state->internal + term->first_slider;
        const size_t elements = (size_t)term->elements.count;
        if (term->sliders > 0)
            all_strains_of(term, 0, model->start, state->internal, slid);
        for (int s = 1; s < term->sliders; s++)
            memcpy(slid + (size_t)s * elements, slid, elements * sizeof *slid);
        if (term->branch_count > 0) /* at the time 0, and without extensions */
            all_strains_of(term, 0, model->start, state->internal, state->internal + term->first_branch + 1);
    }
    return DRAPE_OK;
}

void drape_state_commit(const drape_model *model, const drape_state *before, drape_state *after)
{
    for (int32_t i = 0; i < model->term_count; i++) {
        const drape_term *term = &model->terms[i];
        const drape_elements el = drape_term_elements(term, after->t);
        if (term->ops->commit)
            term->ops->commit(&el, 0, drape_term_pieces(term).count, after->x,
                              before->internal + term->first_internal,
                              after->internal + term->first_internal);
    }
}

static double slide_term(const drape_term *term, const drape_state *before, drape_state *after)
{
    const int32_t elements = term->elements.count;
    double dissipated = 0;
    for (int32_t e = 0; e < elements; e += DRAPE_PAIR_BLOCK) {
        const int32_t count = elements - e < DRAPE_PAIR_BLOCK ? elements - e : DRAPE_PAIR_BLOCK;
        double strain[DRAPE_PAIR_BLOCK];
        strains_of(term, e, count, after->t, after->x, after->internal, strain);
        for (int s = 0; s < term->sliders; s++) {
            const size_t first = (size_t)s * (size_t)elements + (size_t)e;
            const double *from = before->internal + term->first_slider + first;
            double *to = after->internal + term->first_slider + first;
            for (int32_t i = 0; i < count; i++) {
                const double limit = term->slider_limit[first + (size_t)i];
                const double slip =
                    drape_slider_slip(term->slider_stiffness[first + (size_t)i], limit, strain[i] - from[i]);
                if (!term->counted || term->counted[e + i])
                    dissipated += limit * fabs(slip);
                to[i] = from[i] + slip;
            }
        }
    }
    return dissipated;
}

static double relax_term(const drape_term *term, const drape_state *before, bool relaxed, drape_state *after)
{
    const int32_t elements = term->elements.count;
    const double *k = term->elements.rest, *from = before->internal + term->first_branch;
    double dissipated = 0, *to = after->internal + term->first_branch;
    to[0] = after->t;
    all_strains_of(term, after->t, after->x, after->internal, to + 1);
    for (int n = 0; n < term->branch_count; n++) {
        const drape_branch *branch = &term->branches[n];
        const drape_decay decay = drape_decay_over(branch->time, relaxed ? INFINITY : after->t - from[0]);
        const int64_t first = 1 + (n + 1) * (int64_t)elements;
        for (int32_t e = 0; e < elements; e++) {
            const double d = to[1 + e] - from[1 + e], e0 = from[first + e];
            if (!term->counted || term->counted[e])
                dissipated += branch->fraction * k[e] * drape_decay_loss(&decay, e0, d);
            to[first + e] = drape_decay_extension(&decay, e0, d);
        }
    }
    return dissipated;
}

double drape_state_relax(const drape_model *model, const drape_state *before, bool relaxed,
                         drape_state *after)
{
    double dissipated = 0;
    for (int32_t i = 0; i < model->term_count; i++) {
        if (model->terms[i].sliders > 0)
            dissipated += slide_term(&model->terms[i], before, after);
        if (model->terms[i].branch_count > 0)
            dissipated += relax_term(&model->terms[i], before, relaxed, after);
    }
    return drape_ranks_sum(drape_model_ranks(model), dissipated);
}

uint64_t drape_state_hash(const drape_model *model, const drape_state *state)
{
    size_t n = 3 * (size_t)model->node_count * sizeof(double);
    uint64_t hash = drape_hash_bytes(DRAPE_HASH_START, &state->t, sizeof state->t);
    hash = drape_hash_bytes(hash, state->x, n);
    hash = drape_hash_bytes(hash, state->v, n);
    return drape_hash_bytes(hash, state->internal, (size_t)model->internal_count * sizeof(double));
}
