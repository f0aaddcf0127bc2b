/* eigen.c: see eigen.h. */
#include "lab/eigen.h"

#include <arpack.h>
#include <limits.h>
#include <pthread.h>
#include <stdbool.h>

#define TOLERANCE    1e-13 /* relative, of an eigenvalue, by ARPACK's own estimate */
#define MAX_RESTARTS 300
#define MIN_BASIS    20 /* vectors of the Krylov space; twice the wanted ones if that is more */
#define SPARE_BASIS  8

/* The routine itself: dseupd_c takes memory and does not check that there is some. The lengths of the texts
 * come last. */
void dseupd_(const a_int *vectors, const char *how, a_int *select, double *value, double *vector,
             const a_int *rows, const double *shift, const char *kind, const a_int *n, const char *which,
             const a_int *wanted, const double *tolerance, double *residual, const a_int *basis,
             double *krylov, const a_int *krylov_rows, a_int *parameters, a_int *pointers, double *work,
             double *work_small, const a_int *room, a_int *info, size_t how_length, size_t kind_length,
             size_t which_length);

/* ARPACK's routines have static variables. */
static pthread_mutex_t arpack_mutex = PTHREAD_MUTEX_INITIALIZER;

typedef struct search {
    const lab_operator *op;
    const lab_known *known;
    a_int n, wanted, basis;
    double *residual, *vectors, *work, *work_small, *values;
    a_int *select;
    bool *taken; /* (basis) this pair is among the results */
} search;

/* Takes the known vectors out of x, twice, because one pass leaves rounding errors of a large part. */
static void leave_known(const search *s, double *x)
{
    for (int pass = 0; pass < 2; pass++)
        for (int32_t k = 0; k < s->known->count; k++) {
            const double *u = s->known->vector + (int64_t)k * s->n,
                         *bu = s->known->product + (int64_t)k * s->n;
            double share = 0;
            for (int64_t i = 0; i < s->n; i++)
                share += bu[i] * x[i];
            for (int64_t i = 0; i < s->n; i++)
                x[i] -= share * u[i];
        }
}

/* Runs the reverse communication to its end. Mode 3 stands for any operator that is symmetric in B: ARPACK
 * itself only sees its products. */
static drape_status iterate(drape_context *ctx, search *s, a_int *parameters, a_int *pointers)
{
    a_int ido = 0, info = 1; /* info: the start vector is given */
    const a_int room = s->basis * (s->basis + 8);
    drape_status status = DRAPE_OK;
    while (!status) {
        dsaupd_c(&ido, "G", s->n, "LA", s->wanted, TOLERANCE, s->residual, s->basis, s->vectors, s->n,
                 parameters, pointers, s->work, s->work_small, room, &info);
        const double *x = s->work + pointers[0] - 1;
        double *y = s->work + pointers[1] - 1;
        if (ido == -1 || ido == 1) {
            status = s->op->apply(s->op->user, x, y);
            leave_known(s, y);
        } else if (ido == 2)
            s->op->inner(s->op->user, x, y);
        else
            break;
    }
    if (status)
        return status;
    /* 1: not all converged; 2: stopped by a criterion of an older version; 3: no shifts could be applied. */
    return info >= 0 ? DRAPE_OK
                     : drape_fail(ctx, DRAPE_E_SOLVER, "the eigensolver dsaupd of ARPACK failed: info = %d",
                                  (int)info);
}

/* The converged eigenvalues come in ascending order, those of the operator as 1/value + 0. */
static drape_status extract(drape_context *ctx, search *s, a_int *parameters, a_int *pointers, int32_t *found,
                            double *value, double *vector)
{
    const a_int vectors = 1, room = s->basis * (s->basis + 8);
    const double shift = 0, tolerance = TOLERANCE;
    a_int info = 0;
    *found = 0;
    if (parameters[4] == 0)
        return DRAPE_OK;
    dseupd_(&vectors, "A", s->select, s->values, s->vectors, &s->n, &shift, "G", &s->n, "LA", &s->wanted,
            &tolerance, s->residual, &s->basis, s->vectors, &s->n, parameters, pointers, s->work,
            s->work_small, &room, &info, 1, 1, 2);
    if (info != 0)
        return drape_fail(ctx, DRAPE_E_SOLVER, "the eigensolver dseupd of ARPACK failed: info = %d",
                          (int)info);
    const int32_t count = parameters[4] < s->wanted ? parameters[4] : s->wanted;
    for (; *found < count; ++*found) {
        int32_t best = -1;
        for (int32_t k = 0; k < count; k++)
            if (!s->taken[k] && (best < 0 || 1 / s->values[k] > 1 / s->values[best]))
                best = k;
        s->taken[best] = true;
        value[*found] = 1 / s->values[best];
        for (int64_t i = 0; i < s->n; i++)
            vector[(int64_t)*found * s->n + i] = s->vectors[(int64_t)best * s->n + i];
    }
    return DRAPE_OK;
}

void lab_noise(uint64_t seed, double *x, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
        x[i] = (double)(seed >> 11) / 4503599627370496.0 - 1;
    }
}

drape_status lab_eigen(drape_context *ctx, const lab_operator *op, const lab_known *known, int32_t wanted,
                       int32_t *found, double *value, double *vector)
{
    drape_arena arena = drape_arena_of(ctx);
    int64_t basis = 2 * (int64_t)wanted + SPARE_BASIS;
    basis = basis < MIN_BASIS ? MIN_BASIS : basis;
    basis = basis > op->n ? op->n : basis;
    search s = {.op = op, .known = known, .n = (a_int)op->n, .wanted = wanted, .basis = (a_int)basis};
    const size_t n = (size_t)op->n, m = (size_t)basis;
    a_int parameters[11] = {[0] = 1, [2] = MAX_RESTARTS, [3] = 1, [6] = 3}, pointers[14] = {0};
    *found = 0;
    if (op->n > INT_MAX / 4)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "ARPACK counts unknowns with 32 bits");
    s.residual = drape_arena_take(&arena, n, sizeof *s.residual);
    s.vectors = drape_arena_take(&arena, n * m, sizeof *s.vectors);
    s.work = drape_arena_take(&arena, 3 * n, sizeof *s.work);
    s.work_small = drape_arena_take(&arena, m * (m + 8), sizeof *s.work_small);
    s.values = drape_arena_take(&arena, m, sizeof *s.values);
    s.select = drape_arena_take(&arena, m, sizeof *s.select);
    s.taken = drape_arena_take(&arena, m, sizeof *s.taken);
    drape_status status = drape_arena_status(&arena);
    if (!status) {
        /* Each number of known vectors has another start vector: that of the last search may have lacked the
         * modes that it missed. */
        lab_noise(1 + (uint64_t)s.known->count, s.residual, n);
        leave_known(&s, s.residual);
        pthread_mutex_lock(&arpack_mutex);
        status = iterate(ctx, &s, parameters, pointers);
        if (!status)
            status = extract(ctx, &s, parameters, pointers, found, value, vector);
        pthread_mutex_unlock(&arpack_mutex);
    }
    drape_arena_free(&arena);
    return status;
}
