/* springs.h: the matrix of a square sheet of springs with bending and inertia, and the preconditioner of
 * large sheets for it. */
#ifndef DRAPE_TESTS_SPRINGS_H
#define DRAPE_TESTS_SPRINGS_H

#include "entries/models.h"
#include "solvers/multigrid.h"
#include "solvers/pcg.h"
#include "support/context.h"

#include <stdlib.h>

typedef struct sheet {
    drape_context *ctx;
    drape_arena *arena;
    drape_pattern p;
    double *values, *x;
    drape_multigrid *m;
} sheet;

static inline double *take(int64_t count)
{
    double *memory = calloc((size_t)count, sizeof *memory);
    ck_assert_ptr_nonnull(memory);
    return memory;
}

static inline void add_block(sheet *q, int32_t i, int32_t j, double k, const double n[3])
{
    int64_t stride;
    double *at = drape_pattern_at(&q->p, q->values, j, drape_pattern_find(&q->p, i, j), &stride);
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++)
            at[c * stride + r] += k * n[c] * n[r];
}

/* k times the square of n . (sum of weight x). */
static inline void add_energy(sheet *q, const int32_t *node, const double *weight, int count, double k,
                              const double n[3])
{
    for (int a = 0; a < count; a++)
        for (int b = 0; b < count; b++)
            add_block(q, node[a], node[b], k * weight[a] * weight[b], n);
}

/* The sheet of side x side nodes, 1 m, in the plane y = 0: springs of 1e3 N/m along the edges and diagonals,
 * second differences of deflection by a bending stiffness of 1e-4 N m, and the inertia 0.2 kg/m2 /
 * (1/60 s)^2. */
static inline sheet open_sheet(int32_t side)
{
    static const int32_t step[4][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};
    sheet q = {.ctx = make_context()};
    q.arena = drape_arena_create(q.ctx);
    const int32_t count = side * side;
    const double edge = 1.0 / (side - 1), up[3] = {0, 1, 0};
    int32_t *own = calloc((size_t)count, sizeof *own), *triples = calloc(6 * (size_t)count, sizeof *triples),
            used = 0;
    ck_assert(own && triples);
    for (int32_t i = 0; i < count; i++) {
        own[i] = i;
        for (int d = 0; d < 2; d++)
            if ((d ? i / side : i % side) + 2 < side)
                for (int32_t k = 0; k < 3; k++)
                    triples[used++] = i + k * (d ? side : 1);
    }
    int32_t *pairs = calloc(8 * (size_t)count, sizeof *pairs), ends = 0;
    for (int32_t i = 0; i < count; i++)
        for (int d = 0; d < 4; d++) {
            const int32_t c = i % side + step[d][0], r = i / side + step[d][1];
            if (c < 0 || c >= side || r < 0 || r >= side)
                continue;
            pairs[ends++] = i;
            pairs[ends++] = r * side + c;
        }
    const drape_coupling couplings[] = {{.count = used / 3, .nodes = 3, .node = triples},
                                        {.count = ends / 2, .nodes = 2, .node = pairs}};
    ck_assert_int_eq(drape_pattern_build(q.arena, count, own, couplings, 2, &q.p), DRAPE_OK);
    q.values = take(q.p.nonzeros);
    q.x = take(q.p.n);
    for (int32_t i = 0; i < count; i++) {
        q.x[3 * i] = edge * (i % side);
        q.x[3 * i + 2] = edge * (i / side);
        for (int c = 0; c < 3; c++)
            add_block(&q, i, i, 0.2 * edge * edge * 3600, (double[3]){c == 0, c == 1, c == 2});
    }
    for (int32_t k = 0; k < ends; k += 2) {
        double n[3] = {0}, length = 0;
        for (int c = 0; c < 3; c++)
            n[c] = q.x[3 * pairs[k + 1] + c] - q.x[3 * pairs[k] + c];
        length = sqrt(n[0] * n[0] + n[2] * n[2]);
        for (int c = 0; c < 3; c++)
            n[c] /= length;
        add_energy(&q, pairs + k, (double[2]){1, -1}, 2, 1e3, n);
    }
    for (int32_t k = 0; k < used; k += 3)
        add_energy(&q, triples + k, (double[3]){1, -2, 1}, 3, 1e-4 / (edge * edge), up);
    free(own);
    free(triples);
    free(pairs);
    ck_assert_int_eq(drape_multigrid_create(q.arena, &q.p, &q.m), DRAPE_OK);
    return q;
}

/* Turns it in space: by a rotation whose matrix has no zeros. */
static inline void turn_sheet(sheet *q)
{
    static const double R[3][3] = {
        {2. / 3, -1. / 3, 2. / 3}, {2. / 3, 2. / 3, -1. / 3}, {-1. / 3, 2. / 3, 2. / 3}};
    for (int32_t j = 0; j < q->p.block_count; j++) {
        const double *x = q->x + 3 * (size_t)j, at[3] = {x[0], x[1], x[2]};
        for (int c = 0; c < 3; c++)
            q->x[3 * j + c] = R[c][0] * at[0] + R[c][1] * at[1] + R[c][2] * at[2];
        for (int32_t k = q->p.block_start[j]; k < q->p.block_start[j + 1]; k++) {
            int64_t stride;
            double *a = drape_pattern_at(&q->p, q->values, j, k, &stride), turned[3][3] = {{0}};
            for (int c = 0; c < 9; c++)
                for (int r = 0; r < 9; r++)
                    turned[c / 3][r / 3] += R[c / 3][c % 3] * a[c % 3 * stride + r % 3] * R[r / 3][r % 3];
            for (int c = 0; c < 3; c++)
                memcpy(a + c * stride, turned[c], sizeof turned[c]);
        }
    }
}

static inline void close_sheet(sheet *q)
{
    free(q->values);
    free(q->x);
    drape_arena_destroy(&q->arena);
    drape_context_destroy(&q->ctx);
}

#define scoped_sheet SCOPED(close_sheet) sheet

static inline void factor(sheet *q)
{
    ck_assert_int_eq(drape_multigrid_factor(q->m, q->values, q->x), DRAPE_OK);
}

static inline void fill(double *x, int64_t n, uint64_t seed)
{
    for (int64_t i = 0; i < n; i++)
        x[i] = random_number(&seed);
}

static inline double dot(const double *a, const double *b, int64_t n)
{
    double sum = 0;
    for (int64_t i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

static inline void multiply(const void *owner, const double *x, double *y)
{
    drape_multigrid_multiply(((const sheet *)owner)->m, x, y);
}

static inline void precondition(const void *owner, const double *r, double *z)
{
    drape_multigrid_apply(((const sheet *)owner)->m, r, z);
}

#endif
