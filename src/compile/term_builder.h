/* term_builder.h: what a term's build function fills; its public functions are in drape/extend.h. */
#ifndef DRAPE_COMPILE_TERM_BUILDER_H
#define DRAPE_COMPILE_TERM_BUILDER_H

#include "compile/stages.h"

struct drape_term_builder {
    drape_model *model;
    drape_term *term;
    const char *pointer;
    int32_t first_node;               /* added to the numbers that the term sets */
    int32_t owned[2], owned_count[2]; /* ranges of nodes that elements may have; the second one of a seam */
    bool reserved;                    /* the term has announced its elements */
    int32_t *node; /* the arrays of elements.node and elements.rest, writable; node -1: not set yet */
    double *rest;
    bool strayed; /* the term set an element, a part or a link outside the range that it announced */
    bool reserved_parts;
    int32_t *part_node, *part_turn, *link_element, *link_part; /* the arrays of parts, writable */
    double *part_rest, *link_weight;
    int32_t links; /* made so far */
};

/* Checks the parts and links, leaves out parts without a link, and finds places, users and patches. Does
 * nothing for a term without parts. Errors: DRAPE_E_MEMORY, DRAPE_E_ARGUMENT. */
drape_status drape_term_finish_parts(drape_term_builder *builder);

#endif
