/*
 * rung.h: what the rows share that step by a number of iterations and not to a tolerance: backward Euler (be.c),
 *     F(d) = M (d - h v0)/h^2 + g(x0 + d, d/h) = 0,
 * the guess, the residual, and the promise that no step is taken on faith: the residual of its end is evaluated and
 * reported, and where it has not fallen below that of the guess the step is refused.
 *
 * The guess: the nodes fly on, and a share s of the last change of velocity acts again,
 *     d = h v0 + s h^2 (v0 - v-1)/h0
 * s = 1/2 halves the error of one iteration on a swinging sheet; s = 1 feeds on its own noise and diverges.
 */
#ifndef DRAPE_INTEGRATORS_RUNG_H
#define DRAPE_INTEGRATORS_RUNG_H

#include "integrators/implicit.h"

typedef struct drape_rung {
    drape_implicit base;
    drape_point point;
    size_t nodes, dofs; /* numbers in arrays of nodes, of free DOFs */
    double *x, *v, *g;  /* nodes: where the residual was evaluated last, and g there */
    double *ahead;      /* nodes: where a way would lead; NULL without contact */
    double *f, *trial;  /* free DOFs: F there; scratch */
    double *past[2];    /* nodes: velocities at the start of the step before, and of the one before that */
    double past_time[2], past_end; /* [s] of these, and where the last attempt ended; NAN: there is none */
    double first;                  /* square of the guess's residual [N2] */
    drape_work work;
} drape_rung;

/* For rows that have it first in theirs: on failure what was taken is freed by drape_rung_free. */
drape_status drape_rung_init(drape_context *ctx, drape_system *system, drape_rung *rung);
void drape_rung_free(drape_rung *rung);
void drape_rung_restart(void *state, const drape_state *from);
void drape_rung_archive(drape_rung *rung, drape_archive *a); /* its past and its work */
size_t drape_rung_bytes(const drape_rung *rung);

/* Goes to the guess of a step; its residual is evaluated. */
drape_status drape_rung_begin(drape_rung *rung, const drape_state *in, double end, double h,
                              double extrapolation, drape_step_info *info);

/* F at d into rung->f; false if it is not finite. */
bool drape_rung_evaluate(drape_rung *rung, const double *d);

/* Shortens a way of the free nodes from x to what passes through nothing. */
void drape_rung_stay_free(drape_rung *rung, const double *x, double *way);

/* Largest component of the last residual [N]; whether it has fallen below that of the guess. */
double drape_rung_residual(const drape_rung *rung);
bool drape_rung_fell(const drape_rung *rung);

double drape_rung_dot(const double *a, const double *b, size_t n);

/* A status with its reason; of numbers that are not finite the element that collapsed, where there is one. */
drape_status drape_rung_fail(drape_rung *rung, drape_status status, const char *reason,
                             drape_step_info *info);

/* The step that ends where the residual was evaluated last, into out, or what became of it. */
drape_status drape_rung_finish(drape_rung *rung, drape_status status, const drape_state *in, drape_state *out,
                               double tolerance, drape_step_info *info);

#endif
