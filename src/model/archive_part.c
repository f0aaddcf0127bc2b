/* archive_part.c: see archive_part.h. */
#include "model/archive_part.h"

#include <string.h>

/* values: of the rows, which are written or read. */
static void archive_rows(drape_archive *a, const drape_rows *rows, double *values)
{
    const size_t width = (size_t)rows->width, item = width * sizeof *values;
    if (!a->reading) {
        drape_archive_rows(a, rows, item * (size_t)rows->all);
        return;
    }
    const unsigned char *whole = drape_archive_next(a, item * (size_t)rows->all);
    for (int32_t i = 0; whole && i < rows->count; i++)
        memcpy(values + width * (size_t)i, whole + item * (size_t)rows->number[i], item);
}

void drape_archive_nodes(drape_archive *a, const drape_model *m, double *nodes)
{
    const drape_part *part = m->part;
    drape_archive_align(a);
    if (!part) {
        drape_archive_doubles(a, nodes, 3 * (size_t)m->node_count);
        return;
    }
    archive_rows(a, &(drape_rows){nodes, 3, m->node_count, part->all_nodes, part->own, part->node}, nodes);
}

/* `count` numbers of each element, component by component. */
static void archive_elements(drape_archive *a, const drape_model *m, const drape_term *term, int64_t count,
                             double *values)
{
    const int32_t elements = term->elements.count,
                  all = drape_model_whole(m)->terms[term - m->terms].elements.count;
    for (int64_t k = 0; k < count; k++, values += elements)
        archive_rows(a, &(drape_rows){values, 1, elements, all, term->counted, term->element}, values);
}

void drape_archive_internal(drape_archive *a, const drape_model *m, double *internal)
{
    drape_archive_align(a);
    if (!m->part) {
        drape_archive_doubles(a, internal, (size_t)m->internal_count);
        return;
    }
    for (int32_t i = 0; i < m->term_count; i++) {
        const drape_term *term = &m->terms[i];
        const bool parts = term->elements.parts;
        const int32_t pieces = drape_term_pieces(term).count,
                      all = drape_term_pieces(&m->part->whole->terms[i]).count;
        double *values = term->first_internal >= 0 ? internal + term->first_internal : NULL;
        const drape_rows rows = {values,
                                 term->ops->internal_count > 0 ? term->ops->internal_count : 1,
                                 pieces,
                                 all,
                                 parts ? term->part_counted : term->counted,
                                 parts ? term->part : term->element};
        if (values && all > 0)
            archive_rows(a, &rows, values);
        if (term->sliders > 0)
            archive_elements(a, m, term, term->sliders, internal + term->first_slider);
        if (term->branch_count > 0) {
            drape_archive_double(a, internal + term->first_branch);
            archive_elements(a, m, term, 1 + term->branch_count, internal + term->first_branch + 1);
        }
    }
}
