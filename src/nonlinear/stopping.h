/*
 * stopping.h: when a solve is good enough. Every island is judged by itself, and keeps its place once it is
 * done; the solve ends when all are. An island is done by one of two rules (newton.c has the others, which
 * look at all islands together: rounding, and what an effort asks):
 *
 *     residual     no weighted component of F is above the bound
 *     local error  a correction p gains little beside the error that the step has even if its equation is
 *                  solved exactly:
 *                      -F . p <= theta^2 m_w sum m |e|^2    [J]
 *                  with the method's own local error e = C (d + p - q) [m], theta = DRAPE_LOCAL_ERROR_SHARE
 *
 * The equation is E'(d) = 0 for E = m_w/2 (d - p_0)' M (d - p_0) + V(d), with the inertial displacement p_0,
 * if its forces have a potential V. A correction by the exact Jacobian gains, of a quadratic E, half of
 * -F . p = x' E'' x, where x is the distance from d to the solution. Where V is convex along x that is at
 * least m_w |x|_M^2, |x|_M^2 = sum m |x|^2, so that |x|_M <= theta |e|_M already before the correction, and
 * in stiff directions far less. At rest both sides vanish, and the residual decides. For friction and
 * damping, which have no potential, this is a heuristic. Hairer & Wanner 1996, IV.8, end the iterations of
 * Radau IIA by the error of the step likewise; Deuflhard 2011, Newton Methods for Nonlinear Problems, 3.3,
 * measures by energy.
 *
 * Where pins move, much of d + p - q is not the method's error: a sheet goes where they take it, however
 * large the steps are. So e is, of each island, the less of that and of C (d + p - q - a), where a is the
 * mean displacement by which the moved pins of a node's cloth get ahead of their own q.
 *
 * The correction must not have been shortened, by contact or by the line search, and the energy must not have
 * fallen by more than the bound, either, by the trapezoidal rule -a (F(d) + F(d + a p)) . p / 2. A matrix
 * with positive parts, or an old one, is stiffer than J, and -F . p is less than what is left: then the same
 * must hold of the correction before. Predicted stress (stress_predictor.h) counts as exact: it becomes so.
 */
#ifndef DRAPE_NONLINEAR_STOPPING_H
#define DRAPE_NONLINEAR_STOPPING_H

#include "nonlinear/line_search.h"

/* theta: the coefficient of IDA's nonlinear convergence test, of its tolerance there (Hindmarsh 2005) */
#define DRAPE_LOCAL_ERROR_SHARE 0.33

/* What is known of an island in a solve. */
typedef struct drape_progress {
    bool done;
    double largest; /* [N] weighted component of F */
    double gain;    /* [J] -F . p of all of the last correction; NaN: there was none */
    bool small;     /* the second rule holds of it, but for the matrix */
    double own;     /* [J] m_w sum m |e|^2 */
} drape_progress;

typedef struct drape_stopping {
    drape_step_equation *equation;
    const drape_islands *islands;
    drape_progress *progress; /* (islands) */
    double *work;             /* (2 x islands) scratch [J] */
    double *weight;           /* free nodes: of their residual in norms */
    bool by_error;            /* the second rule counts; set by the caller */
    bool ended_by_error;      /* it was needed in this solve */
    bool strict;              /* it does not count in the rest of this solve; set by the caller, likewise */
} drape_stopping;

/* Errors: DRAPE_E_MEMORY. */
drape_status drape_stopping_init(drape_arena *arena, drape_step_equation *equation,
                                 const drape_islands *islands, drape_stopping *stopping);

/* Begins a solve, or begins again because the islands have changed. Nodes of islands that are done have no
 * weight in norms of F until drape_stopping_end. */
void drape_stopping_begin(drape_stopping *stopping);
void drape_stopping_end(drape_stopping *stopping);

/* After an evaluation of F: ends islands by their residual. Returns whether all are done, by any rule. */
bool drape_stopping_test_residual(drape_stopping *stopping, double bound);

/* After a search along a correction p, of which contact had left a fraction: ends islands by their local
 * error. exact: it is by the Jacobian. */
void drape_stopping_test_error(drape_stopping *stopping, const drape_length *lengths, const double *d,
                               const double *p, bool exact, double fraction);

/* At d, where F was evaluated last, of a correction p that is not made: takes it for the last one, by the
 * factors of which it is. */
void drape_stopping_estimate(drape_stopping *stopping, const double *d, const double *p);

/* Whether the last corrections of all islands gain little beside their local error. */
bool drape_stopping_is_small(const drape_stopping *stopping);

/* Leaves of that correction only the parts of islands where that is so; false if all of them are done. */
bool drape_stopping_keep_small(const drape_stopping *stopping, double *p);

/* Ends these by their local error. */
void drape_stopping_finish_small(drape_stopping *stopping);

/* -F . p of the last corrections of all islands [J]; false if there was none. */
bool drape_stopping_left(const drape_stopping *stopping, double *left);

#endif
