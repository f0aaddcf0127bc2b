/*
 * ida_full.h: IDA without Drape's reduction, to compare with: the full system of 2 n unknowns
 *     y = (x, v),  F = [x' - v ; M v' + g(x, v)],  dF/dy + c_j dF/dy' = [c_j I, -I ; K, D + c_j M],
 * in SUNDIALS' own sparse matrix, factored by SUNDIALS' own KLU. IDA is configured as in
 * src/integrators/ida.c, with the same test of convergence, so in exact arithmetic both take the same
 * steps. Pins must not move.
 *
 * SUNDIALS zeros a sparse matrix before every Jacobian, including its indices. The Jacobian here writes
 * every value and no index, so the matrix's function for zeroing is replaced by one that does nothing.
 */
#ifndef DRAPE_TESTS_IDA_FULL_H
#define DRAPE_TESTS_IDA_FULL_H

#include <ida/ida.h>
#include <nvector/nvector_serial.h>
#include <string.h>
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>

#include "assemble/system.h"
#include "integrators/sun_newton.h"
#include "solvers/sundials_compat.h"

/* As in ida.c. */
#define IDA_FULL_NEWTON_SHARE 0.1
#define IDA_FULL_CJ_CHANGE    0.1
#define IDA_FULL_FAILS        10

enum { IDA_FULL_AMD, IDA_FULL_COLAMD }; /* orderings of KLU */

typedef struct ida_full {
    drape_context *ctx;
    const drape_model *model;
    drape_system *system;
    drape_arena arena;
    drape_state now, next; /* the end of the last step; the point of the last evaluation of the residual */
    double *g, *k, *d;     /* nodes; K and D (nonzeros) */
    int64_t n;             /* free DOFs */
    SUNContext sun;
    void *ida;
    N_Vector y, rate, tolerances;
    SUNMatrix matrix;
    SUNLinearSolver solver;
    drape_sun_newton newton; /* the ida_full must stay at its address */
    long residuals, jacobians;
} ida_full;

static inline size_t ida_full_at(const ida_full *f, int64_t i)
{
    return 3 * (size_t)f->model->node_of_free[i / 3] + (size_t)(i % 3);
}

static inline double ida_full_mass(const ida_full *f, int64_t i)
{
    return f->model->mass[f->model->node_of_free[i / 3]];
}

static inline drape_point ida_full_place(ida_full *f, N_Vector vector)
{
    const double *y = N_VGetArrayPointer(vector);
    for (int64_t i = 0; i < f->n; i++) {
        f->next.x[ida_full_at(f, i)] = y[i];
        f->next.v[ida_full_at(f, i)] = y[f->n + i];
    }
    return (drape_point){.x = f->next.x, .v = f->next.v, .internal = f->now.internal};
}

static inline int ida_full_residual(sunrealtype t, N_Vector y, N_Vector rate, N_Vector out, void *user)
{
    (void)t;
    ida_full *f = user;
    const double *v = N_VGetArrayPointer(y) + f->n, *xp = N_VGetArrayPointer(rate), *vp = xp + f->n;
    double *r = N_VGetArrayPointer(out);
    const drape_point point = ida_full_place(f, y);
    drape_system_force(f->system, &point, f->g);
    for (int64_t i = 0; i < f->n; i++) {
        r[i] = xp[i] - v[i];
        r[f->n + i] = ida_full_mass(f, i) * vp[i] + f->g[ida_full_at(f, i)];
    }
    f->residuals++;
    return 0;
}

/* Column j: c_j at j, then K below. Column n + j: -1 at j, then D + c_j M below. */
static inline int ida_full_jacobian(sunrealtype t, sunrealtype cj, N_Vector y, N_Vector rate, N_Vector r,
                                    SUNMatrix matrix, void *user, N_Vector a, N_Vector b, N_Vector c)
{
    (void)t, (void)rate, (void)r, (void)a, (void)b, (void)c;
    ida_full *f = user;
    const drape_pattern *p = &f->model->pattern;
    const drape_point point = ida_full_place(f, y);
    double *to = SUNSparseMatrix_Data(matrix);
    drape_system_jacobian(f->system, &point, 0, 0, f->k);
    if (f->model->has_dissipation)
        drape_system_damping(f->system, &point, f->d);
    for (int64_t j = 0; j < p->n; j++) {
        *to++ = cj;
        for (int64_t k = p->column[j]; k < p->column[j + 1]; k++)
            *to++ = f->k[k];
    }
    for (int64_t j = 0; j < p->n; j++) {
        *to++ = -1;
        for (int64_t k = p->column[j]; k < p->column[j + 1]; k++)
            *to++ = f->d[k] + (drape_pattern_row(p, j, k) == j ? cj * ida_full_mass(f, j) : 0);
    }
    drape_sun_newton_forget(&f->newton);
    f->jacobians++;
    return 0;
}

static inline int ida_full_keep(SUNMatrix matrix)
{
    (void)matrix;
    return 0;
}

static inline void ida_full_pattern(ida_full *f)
{
    const drape_pattern *p = &f->model->pattern;
    sunindextype *column = SUNSparseMatrix_IndexPointers(f->matrix),
                 *row = SUNSparseMatrix_IndexValues(f->matrix), at = 0;
    for (int64_t j = 0; j < 2 * p->n; j++) {
        column[j] = at;
        row[at++] = j % p->n;
        for (int64_t k = p->column[j % p->n]; k < p->column[j % p->n + 1]; k++)
            row[at++] = p->n + drape_pattern_row(p, j % p->n, k);
    }
    column[2 * p->n] = at;
    f->matrix->ops->zero = ida_full_keep;
}

static inline void ida_full_close(ida_full *f)
{
    if (f->ida)
        IDAFree(&f->ida);
    drape_sun_newton_free(&f->newton);
    if (f->solver)
        SUNLinSolFree(f->solver);
    if (f->matrix)
        SUNMatDestroy(f->matrix);
    N_Vector vectors[] = {f->y, f->rate, f->tolerances};
    for (size_t i = 0; i < sizeof vectors / sizeof *vectors; i++)
        if (vectors[i])
            N_VDestroy(vectors[i]);
    if (f->sun)
        SUNContext_Free(&f->sun);
    drape_free(f->ctx, f->g);
    drape_free(f->ctx, f->k);
    drape_free(f->ctx, f->d);
    drape_system_destroy(&f->system);
    drape_arena_free(&f->arena);
    *f = (ida_full){0};
}

static inline bool ida_full_arrays(ida_full *f)
{
    const size_t nonzeros = (size_t)f->model->pattern.nonzeros;
    f->arena = drape_arena_of(f->ctx);
    f->g = drape_alloc(f->ctx, 3 * (size_t)f->model->node_count, sizeof(double));
    f->k = drape_alloc(f->ctx, nonzeros, sizeof(double));
    f->d = drape_alloc(f->ctx, nonzeros, sizeof(double));
    return f->g && f->k && f->d && !drape_system_create(&f->arena, f->model, 1, &f->system) &&
           !drape_state_create(&f->arena, f->model, &f->now) &&
           !drape_state_create(&f->arena, f->model, &f->next);
}

/* x' = v, v' = -M^-1 g at the start; the tolerances. */
static inline void ida_full_start(ida_full *f, double atol_x, double atol_v)
{
    double *y = N_VGetArrayPointer(f->y), *rate = N_VGetArrayPointer(f->rate),
           *tolerance = N_VGetArrayPointer(f->tolerances);
    for (int64_t i = 0; i < f->n; i++) {
        y[i] = f->now.x[ida_full_at(f, i)];
        y[f->n + i] = rate[i] = f->now.v[ida_full_at(f, i)];
        tolerance[i] = atol_x;
        tolerance[f->n + i] = atol_v;
    }
    const drape_point point = ida_full_place(f, f->y);
    drape_system_force(f->system, &point, f->g);
    f->residuals++;
    for (int64_t i = 0; i < f->n; i++)
        rate[f->n + i] = -f->g[ida_full_at(f, i)] / ida_full_mass(f, i);
}

static inline bool ida_full_configure(ida_full *f, int max_order, int ordering)
{
    return !SUNLinSol_KLUSetOrdering(f->solver, ordering) &&
           !IDAInit(f->ida, ida_full_residual, 0, f->y, f->rate) && !IDASetUserData(f->ida, f) &&
           !IDASVtolerances(f->ida, 0, f->tolerances) && !IDASetLinearSolver(f->ida, f->solver, f->matrix) &&
           drape_sun_newton_create(&f->newton, f->y, 2 * f->n, NULL, f->sun) &&
           !IDASetNonlinearSolver(f->ida, f->newton.solver) && drape_sun_newton_set_test(&f->newton) &&
           !IDASetJacFn(f->ida, ida_full_jacobian) && !IDASetMaxOrd(f->ida, max_order) &&
           !IDASetMaxErrTestFails(f->ida, IDA_FULL_FAILS) && !IDASetMaxConvFails(f->ida, IDA_FULL_FAILS) &&
           !IDASetNonlinConvCoef(f->ida, IDA_FULL_NEWTON_SHARE) &&
           !IDASetDeltaCjLSetup(f->ida, IDA_FULL_CJ_CHANGE);
}

/* From the model's initial state. False if a part cannot be created. */
static inline bool ida_full_open(ida_full *f, drape_context *ctx, const drape_model *model, double atol_x,
                                 double atol_v, int max_order, int ordering)
{
    *f = (ida_full){.ctx = ctx, .model = model, .n = 3 * (int64_t)model->free_count};
    bool good = model->moved_count == 0 && ida_full_arrays(f) && !drape_sundials_create(&f->sun);
    if (good) {
        const sunindextype n = 2 * f->n, nonzeros = n + 2 * model->pattern.nonzeros;
        f->y = N_VNew_Serial(n, f->sun);
        f->rate = N_VNew_Serial(n, f->sun);
        f->tolerances = N_VNew_Serial(n, f->sun);
        f->matrix = SUNSparseMatrix(n, n, nonzeros, CSC_MAT, f->sun);
        f->ida = IDACreate(f->sun);
        good = f->y && f->rate && f->tolerances && f->matrix && f->ida;
    }
    if (good) {
        ida_full_pattern(f);
        ida_full_start(f, atol_x, atol_v);
        f->solver = SUNLinSol_KLU(f->y, f->matrix, f->sun);
        good = f->solver && ida_full_configure(f, max_order, ordering);
    }
    if (!good)
        ida_full_close(f);
    return good;
}

/* One step towards end, which it may reach but not pass. Returns the code of IDASolve. */
static inline int ida_full_step(ida_full *f, double end)
{
    double t;
    int code = IDASetStopTime(f->ida, end);
    if (!code)
        code = IDASolve(f->ida, end, &t, f->y, f->rate, IDA_ONE_STEP);
    if (code < 0)
        return code;
    ida_full_place(f, f->y);
    f->next.t = t;
    drape_state_commit(f->model, &f->now, &f->next);
    const drape_state before = f->now;
    f->now = f->next;
    f->next = before;
    return code;
}

#endif
