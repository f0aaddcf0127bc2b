/*
 * cvode_log.h: the history of CVODE, for checkpoints. No function of CVODE writes or reads it, and the
 * header that declares it is not installed.
 *
 * CVODE is deterministic. Its decisions depend on the times that it is given, on norms of vectors, on the
 * results of the right-hand side and of the nonlinear solver, and on nothing else. All of these are
 * noted, a few numbers a step. Another CVODE that takes the same steps and is given the same numbers, in
 * place of computing anything, makes the same decisions; then its vectors receive the contents of the
 * first one's.
 */
#ifndef DRAPE_INTEGRATORS_CVODE_LOG_H
#define DRAPE_INTEGRATORS_CVODE_LOG_H

#include "base/archive.h"
#include "base/arena.h"

#include <sundials/sundials_nonlinearsolver.h>
#include <sundials/sundials_nvector.h>

#include <stdbool.h>

#define DRAPE_CVODE_LOG_VECTORS 24 /* more than CVodeInit takes */

typedef struct drape_cvode_log {
    double *values; /* what was noted since CVODE began */
    int64_t count, at;
    double t, h;     /* where CVODE began, and its first step */
    bool replaying;  /* values are returned, from `at` on */
    bool collecting; /* vectors that are cloned are CVODE's */
    bool silent;     /* within the nonlinear solver nothing is noted but setups of the matrix */
    bool broken;     /* a replay asked for more than there is */
    N_Vector vectors[DRAPE_CVODE_LOG_VECTORS]; /* of CVODE */
    int vector_count;
    int (*solve)(SUNNonlinearSolver, N_Vector, N_Vector, N_Vector, sunrealtype, int, void *);
    int (*setup)(sunbooleantype, sunbooleantype *, void *);
} drape_cvode_log;

/* Takes memory, and makes vectors cloned from `like` part of the log. False: out of memory. */
bool drape_cvode_log_create(drape_cvode_log *log, drape_arena *arena, N_Vector like);

/* CVodeInit and CVodeSetNonlinearSolver, with a solver that is SUNDIALS' Newton or derived from it. False
 * if refused. */
bool drape_cvode_log_init(drape_cvode_log *log, void *cvode,
                          int (*rhs)(sunrealtype, N_Vector, N_Vector, void *), N_Vector y,
                          SUNNonlinearSolver solver);

/* CVodeReInit and CVodeSetInitStep: forgets everything. False if refused. */
bool drape_cvode_log_begin(drape_cvode_log *log, void *cvode, double t, double h, N_Vector y);

/* One step of CVODE, which ends at `stop` at the latest. Returns CVode's code. */
int drape_cvode_log_step(drape_cvode_log *log, void *cvode, double stop, N_Vector y, double *t);

/* To be returned by the right-hand side instead of its code, or, while replaying, instead of any work. */
int drape_cvode_log_code(drape_cvode_log *log, int code);

/* Whether there is no room for another step: CVODE must begin again. */
bool drape_cvode_log_is_full(const drape_cvode_log *log);

/* Archives the log and the vectors; when reading, replays it first, with y as scratch. CVODE must have
 * all its settings and must not have made a step. */
void drape_cvode_log_archive(drape_cvode_log *log, void *cvode, N_Vector y, drape_archive *a);

#endif
