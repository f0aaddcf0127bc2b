/*
 * line_search.h: how far a correction p of a step equation is taken from d. Friction and damping have no
 * energy to minimise, so the search looks at the work of the residual along p, F(d + a p) . p: it is negative
 * while the energy along p, if there is one, still falls, and zero where that is smallest. A length a is
 * taken where that work is in magnitude at most half of its value at a = 0; it is found by doubling and
 * bisection. This is the line search of Matthies & Strang 1979. Each island has a length of its own, or, with
 * contact, all have one: that p is feasible says nothing of paths whose parts end at different times.
 */
#ifndef DRAPE_NONLINEAR_LINE_SEARCH_H
#define DRAPE_NONLINEAR_LINE_SEARCH_H

#include "nonlinear/islands.h"
#include "nonlinear/step_equation.h"

/* What a search finds for an island. */
typedef struct drape_length {
    double length;     /* a */
    double start, end; /* [J] work of the residual along p: at a = 0, and where it was evaluated last */
    double low, high;  /* lengths before and beyond the minimum, as far as they are known */
    bool found;
} drape_length;

#define DRAPE_LENGTH_TRIALS 8 /* of a search */

/* start: the work at a = 0, where a = 1 is tried first. */
drape_length drape_length_begin(double start);

/* After a trial of its length, with `end` set: whether it is found, else the next one. lengthens: lengths
 * above 1 are tried, too. */
void drape_length_judge(drape_length *length, bool lengthens);

typedef struct drape_line_search {
    drape_step_equation *equation;
    const drape_islands *islands;
    drape_length *lengths;    /* (islands) of the last search */
    double *trial;            /* free DOFs: where the equation was evaluated last */
    bool evaluated;           /* it was at d + a p, with the lengths found, and F is finite there */
    double shortest, longest; /* of the lengths found */
} drape_line_search;

/* Has room for as many islands as there are free nodes. Errors: DRAPE_E_MEMORY. */
drape_status drape_line_search_init(drape_arena *arena, drape_step_equation *equation,
                                    const drape_islands *islands, drape_line_search *search);

/* Searches along p (free DOFs) from d + before (NULL: d), where the equation was evaluated last. A matrix
 * with positive parts is far too stiff along unstable directions: its corrections are lengthened until the
 * work is small enough, because otherwise a buckling sheet takes a hundred of them. longest: the largest
 * length that is tried, 1 for others, which are taken whole if they stop short of the minimum; with contact,
 * longer ones only where that is feasible. p becomes the step to take, a p. */
void drape_line_search_along(drape_line_search *search, const double *d, const double *before, double longest,
                             double *p);

/* Whether the equation was evaluated at d by the last search, so that its F there is known. */
bool drape_line_search_knows(const drape_line_search *search, const double *d);

#endif
