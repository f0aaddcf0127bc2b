/*
 * untangler.h: takes sheets apart that pass through each other, themselves or colliders, before a run.
 *
 * Each sweep finds the curves in which sheets intersect, decides by the whole of each curve which part of
 * which sheet is on the wrong side (global intersection analysis: Baraff, Witkin & Kass 2003, Untangling
 * cloth), and moves the nodes of that part next to the curve through the other sheet, so that the curve gets
 * shorter until it vanishes. A curve that cuts no part off, because it ends inside of both sheets, is made
 * shorter along the gradient of its length (Volino & Magnenat-Thalmann 2006, Resolving surface collisions
 * through intersection contour minimization). Nodes in closed colliders are pushed out along the signed
 * distance. Then edge lengths and bends are restored, as far as the sides of all pairs that are near each
 * other allow (Mueller et al. 2007, Position based dynamics). No result depends on threads or on the
 * processor.
 */
#ifndef DRAPE_UNTANGLE_UNTANGLER_H
#define DRAPE_UNTANGLE_UNTANGLER_H

#include "model/motion.h"

#include <stdatomic.h>

typedef struct drape_untangle_limits {
    int sweeps; /* at most */
    double gap; /* wanted at the end, in activation distances, in (0, 1] */
} drape_untangle_limits;

typedef struct drape_untangle_outcome {
    int sweeps;              /* that were made */
    int64_t crossings;       /* of edges and triangles of sheets, that remain */
    int64_t sunk;            /* nodes and faces in closed colliders, that remain */
    double min_share;        /* the smallest gap in least gaps (contact/pair.h); INFINITY: nothing is near */
    double min_share_before; /* the same in the beginning */
} drape_untangle_outcome;

/* Whether nothing passes through anything, and all gaps are those of contact. */
static inline bool drape_untangle_is_clear(const drape_untangle_outcome *outcome)
{
    return outcome->crossings == 0 && outcome->sunk == 0 && outcome->min_share >= 1;
}

/* Moves the free nodes of x (node_count x 3), with pins and colliders at time t. If x is clear, it does not
 * change; if sweeps do not clear it, it becomes the best positions of all sweeps: those with the fewest
 * crossings. cancel: ends the search when it is raised; may be NULL. Errors: DRAPE_E_MEMORY,
 * DRAPE_E_STOPPED; then x is unchanged. */
drape_status drape_untangle(drape_context *ctx, const drape_motion *motion, double t,
                            const drape_untangle_limits *limits, const atomic_bool *cancel, double *x,
                            drape_untangle_outcome *outcome);

#endif
