/*
 * spring.h: what the spring terms share: the pairs of nodes that they join, and the spring itself. With
 * l = |x1 - x0| and n = (x1 - x0)/l
 *     q = l,  E = 1/2 k (l - L)^2,  dashpot c l' = c (v1 - v0).n along n
 * The terms differ in their pairs only; they have the same parameters.
 */
#ifndef DRAPE_TERMS_SPRING_H
#define DRAPE_TERMS_SPRING_H

#include "terms/terms.h"

enum {
    DRAPE_SPRING_STIFFNESS,
    DRAPE_SPRING_FACTOR,
    DRAPE_SPRING_DAMPING,
    DRAPE_SPRING_GRADIENT,
    DRAPE_SPRING_REST_SCALE,
    DRAPE_SPRING_PARAM_COUNT
};
extern const drape_param drape_spring_params[DRAPE_SPRING_PARAM_COUNT];

/* What the constants of the terms have in common: of `entry`, and of the rest. */
#define DRAPE_SPRING_ENTRY                                                                                   \
    .reference = "Provot 1995, Deformation constraints in a mass-spring model to describe rigid cloth "      \
                 "behavior",                                                                                 \
    DRAPE_PARAMS(drape_spring_params)
#define DRAPE_SPRING_OPS                                                                                     \
    .element_name = "spring", .nodes = 2, .damped = true, .distance = true, .convex = true,                  \
    .measure = drape_spring_measure, .pair = drape_spring_pairs, .check = drape_spring_check

/* The offset from one node of a spring to the other, in rows (>= 0) and columns of a grid. */
typedef struct drape_spring_offset {
    int32_t rows, columns;
} drape_spring_offset;

/* All offsets, two for each kind: neighbours along rows and columns, diagonals of cells, and two steps along
 * rows and columns. A kind is the index of its first offset. */
enum { DRAPE_SPRING_STRUCTURAL = 0, DRAPE_SPRING_SHEAR = 2, DRAPE_SPRING_BEND = 4, DRAPE_SPRING_OFFSETS = 6 };
extern const drape_spring_offset drape_spring_offsets[DRAPE_SPRING_OFFSETS];

/* Pairs of nodes of one cloth: on a rectangular grid by offsets, for each offset in the order of nodes;
 * without offsets the edges of any mesh. */
typedef struct drape_spring_set {
    const drape_cloth_view *cloth;
    const drape_spring_offset *offset; /* (offset_count) */
    int offset_count;
} drape_spring_set;

/* Whether there are springs by offsets. */
static inline bool drape_spring_on_grid(const drape_cloth_view *cloth)
{
    return cloth->rectangular && cloth->node_count == cloth->given_count;
}

int32_t drape_spring_count(const drape_spring_set *set);
void drape_spring_pair(const drape_spring_set *set, int32_t spring, int32_t pair[2]);

/* Distance of two nodes at rest [m]. */
double drape_spring_rest_length(const drape_cloth_view *cloth, const int32_t pair[2]);

/* Builds the springs of a set, or of one kind of offsets; that one refuses meshes other than grids of
 * rectangles. */
drape_status drape_spring_build(const drape_spring_set *set, const double *values,
                                drape_term_builder *builder);
drape_status drape_spring_build_kind(const drape_cloth_view *cloth, int kind, const double *values,
                                     drape_term_builder *builder);

/* Functions of the terms: see drape_term_ops. */
void drape_spring_measure(const drape_elements *el, int32_t first, int32_t count, const double *x,
                          const double *internal, double *q, double *dq, double *ddq);
void drape_spring_pairs(const drape_elements *el, int32_t first, int32_t count, const double *x, double *q,
                        double *d, double *c);
drape_status drape_spring_check(const drape_elements *el, const double *x, const double *before,
                                const double *internal, drape_fault *fault);

#endif
