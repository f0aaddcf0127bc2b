/* cvode_log.c: see cvode_log.h. */
#include "integrators/cvode_log.h"

#include <cvode/cvode.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>

#define CAPACITY 32768 /* numbers: some thousand steps, after which CVODE begins again */
/* More than a step notes: with 10 failed tests of the error and 10 failed solves, some 20 attempts. */
#define RESERVE 1024
/* Setups of the matrix, among codes, which are whole numbers: with a matrix that was not bad, or bad. */
#define SETUP     0.5
#define BAD_SETUP 1.5

/* The log of the CVODE that is at work on this thread: its vectors have no place for a pointer to it. */
static _Thread_local drape_cvode_log *active;

static void put(drape_cvode_log *log, double value)
{
    if (log->count < CAPACITY)
        log->values[log->count++] = value;
}

static double take(drape_cvode_log *log)
{
    log->broken |= log->at >= log->count;
    return log->broken ? 0 : log->values[log->at++];
}

/* ---- Of vectors ---- */

static sunrealtype norm(N_Vector v, N_Vector weights)
{
    if (active && active->replaying)
        return take(active);
    const double value = N_VWrmsNorm_Serial(v, weights);
    if (active && !active->silent)
        put(active, value);
    return value;
}

static N_Vector clone(N_Vector like)
{
    N_Vector v = N_VClone_Serial(like);
    if (v && active && active->collecting && active->vector_count < DRAPE_CVODE_LOG_VECTORS) {
        N_VConst(0, v); /* no uninitialised memory gets into a checkpoint */
        active->vectors[active->vector_count++] = v;
    }
    return v;
}

static void destroy(N_Vector v)
{
    for (int i = 0; active && i < active->vector_count; i++)
        if (active->vectors[i] == v)
            active->vectors[i--] = active->vectors[--active->vector_count];
    N_VDestroy_Serial(v);
}

bool drape_cvode_log_create(drape_cvode_log *log, drape_arena *arena, N_Vector like)
{
    log->values = drape_arena_take(arena, CAPACITY, sizeof *log->values);
    like->ops->nvwrmsnorm = norm;
    like->ops->nvclone = clone;
    like->ops->nvdestroy = destroy;
    return log->values != NULL;
}

/* ---- Of the right-hand side and the nonlinear solver ---- */

int drape_cvode_log_code(drape_cvode_log *log, int code)
{
    if (log->replaying)
        return (int)take(log);
    if (!log->silent)
        put(log, code);
    return code;
}

static int note_setup(sunbooleantype bad, sunbooleantype *current, void *cvode)
{
    put(active, bad ? BAD_SETUP : SETUP);
    return active->setup(bad, current, cvode);
}

static int replay_solve(SUNNonlinearSolverContent_Newton content, void *cvode)
{
    double value = take(active);
    for (; value != floor(value); value = take(active))
        content->LSetup(value > 1, &content->jcur, cvode);
    return (int)value;
}

static int solve(SUNNonlinearSolver solver, N_Vector predicted, N_Vector y, N_Vector weights,
                 sunrealtype tolerance, int call_setup, void *cvode)
{
    drape_cvode_log *log = active;
    SUNNonlinearSolverContent_Newton content = solver->content;
    if (log->replaying)
        return replay_solve(content, cvode);
    log->silent = true;
    log->setup = content->LSetup;
    content->LSetup = note_setup;
    const int code = log->solve(solver, predicted, y, weights, tolerance, call_setup, cvode);
    content->LSetup = log->setup;
    log->silent = false;
    put(log, code);
    return code;
}

/* ---- Of calls ---- */

/* CVODE destroys the nonlinear solver that CVodeInit made, with a vector of it. */
bool drape_cvode_log_init(drape_cvode_log *log, void *cvode,
                          int (*rhs)(sunrealtype, N_Vector, N_Vector, void *), N_Vector y,
                          SUNNonlinearSolver solver)
{
    log->solve = solver->ops->solve;
    solver->ops->solve = solve;
    active = log;
    log->collecting = true;
    const bool good = !CVodeInit(cvode, rhs, 0, y) && !CVodeSetNonlinearSolver(cvode, solver);
    log->collecting = false;
    active = NULL;
    return good;
}

bool drape_cvode_log_begin(drape_cvode_log *log, void *cvode, double t, double h, N_Vector y)
{
    log->t = t;
    log->h = h;
    log->count = 0;
    return !CVodeReInit(cvode, t, y) && !CVodeSetInitStep(cvode, h);
}

/* Towards the stop: the end of an advance would be another number that CVODE reads. */
static int advance(drape_cvode_log *log, void *cvode, double stop, N_Vector y, double *t)
{
    active = log;
    const int code = CVodeSetStopTime(cvode, stop) ? CV_ILL_INPUT : CVode(cvode, stop, y, t, CV_ONE_STEP);
    active = NULL;
    return code;
}

int drape_cvode_log_step(drape_cvode_log *log, void *cvode, double stop, N_Vector y, double *t)
{
    put(log, stop);
    return advance(log, cvode, stop, y, t);
}

bool drape_cvode_log_is_full(const drape_cvode_log *log)
{
    return log->count > CAPACITY - RESERVE;
}

/* ---- Checkpoints ---- */

static bool replay(drape_cvode_log *log, void *cvode, N_Vector y)
{
    const int64_t count = log->count;
    double t;
    bool good = drape_cvode_log_begin(log, cvode, log->t, log->h, y);
    log->count = count;
    log->at = 0;
    log->broken = false;
    log->replaying = true;
    while (good && !log->broken && log->at < count)
        good = advance(log, cvode, take(log), y, &t) >= 0;
    log->replaying = false;
    return good && !log->broken;
}

void drape_cvode_log_archive(drape_cvode_log *log, void *cvode, N_Vector y, drape_archive *a)
{
    drape_archive_mark(a, "cvode");
    drape_archive_double(a, &log->t);
    drape_archive_double(a, &log->h);
    drape_archive_int64(a, &log->count);
    if (drape_archive_has_read(a) && (log->count < 0 || log->count > CAPACITY))
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has a log of CVODE with %lld numbers",
                           (long long)log->count);
    if (!drape_archive_good(a))
        return;
    drape_archive_doubles(a, log->values, (size_t)log->count);
    if (drape_archive_has_read(a) && log->count > 0 && !replay(log, cvode, y))
        drape_archive_fail(a, DRAPE_E_SOLVER, "CVODE cannot continue from the checkpoint");
    for (int i = 0; i < log->vector_count && log->count > 0; i++)
        drape_archive_doubles(a, N_VGetArrayPointer(log->vectors[i]), (size_t)N_VGetLength(log->vectors[i]));
}
