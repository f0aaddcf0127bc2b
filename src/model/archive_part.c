/* archive_part.c: see archive_part.h. */
#include "model/archive_part.h"

#include <string.h>

/* Numbers of items of which each rank has some: `width` numbers an item, all of item i together. */
typedef struct items {
    double *values;
    int32_t count, all;     /* items here, and in the whole model */
    const uint8_t *counted; /* (count) 1: this rank writes it */
    const int32_t *number;  /* (count) in the whole model */
} items;

static void archive_items(drape_archive *a, const drape_model *m, const items *of, int width)
{
    const drape_ranks *ranks = drape_model_ranks(m);
    const size_t size = (size_t)of->all * (size_t)width, w = (size_t)width;
    const bool needs = a->reading || ranks->rank == 0;
    double *whole = needs ? drape_alloc(a->ctx, size, sizeof *whole) : NULL;
    if (drape_ranks_any(ranks, needs && !whole)) {
        drape_archive_note(a, DRAPE_E_MEMORY);
        drape_free(a->ctx, whole);
        return;
    }
    if (!a->reading)
        ranks->gather(ranks, of->values, width, of->count, of->counted, of->number, whole);
    if (needs)
        drape_archive_doubles(a, whole, size);
    for (int32_t i = 0; drape_archive_has_read(a) && i < of->count; i++)
        memcpy(of->values + w * (size_t)i, whole + w * (size_t)of->number[i], w * sizeof *whole);
    drape_free(a->ctx, whole);
}

void drape_archive_nodes(drape_archive *a, const drape_model *m, double *nodes)
{
    const drape_part *part = m->part;
    if (!part) {
        drape_archive_doubles(a, nodes, 3 * (size_t)m->node_count);
        return;
    }
    archive_items(a, m, &(items){nodes, m->node_count, part->all_nodes, part->own, part->node}, 3);
}

/* `of` of each element, component by component; moves on. */
static void archive_elements(drape_archive *a, const drape_model *m, const drape_term *term, int64_t count,
                             double *values)
{
    const int32_t elements = term->elements.count,
                  all = drape_model_whole(m)->terms[term - m->terms].elements.count;
    for (int64_t k = 0; k < count; k++)
        archive_items(a, m, &(items){values + k * elements, elements, all, term->counted, term->element}, 1);
}

void drape_archive_internal(drape_archive *a, const drape_model *m, double *internal)
{
    if (!m->part) {
        drape_archive_doubles(a, internal, (size_t)m->internal_count);
        return;
    }
    for (int32_t i = 0; i < m->term_count; i++) {
        const drape_term *term = &m->terms[i];
        const bool parts = term->elements.parts;
        const int32_t pieces = drape_term_pieces(term).count,
                      all = drape_term_pieces(&m->part->whole->terms[i]).count;
        const items of = {internal + term->first_internal, pieces, all,
                          parts ? term->part_counted : term->counted, parts ? term->part : term->element};
        if (term->first_internal >= 0 && pieces + all > 0)
            archive_items(a, m, &of, term->ops->internal_count > 0 ? term->ops->internal_count : 1);
        if (term->sliders > 0)
            archive_elements(a, m, term, term->sliders, internal + term->first_slider);
        if (term->branch_count > 0) {
            drape_archive_double(a, internal + term->first_branch);
            archive_elements(a, m, term, 1 + term->branch_count, internal + term->first_branch + 1);
        }
    }
}
