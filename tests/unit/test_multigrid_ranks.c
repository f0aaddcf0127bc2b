/* test_multigrid_ranks.c: the preconditioner of large sheets where ranks share the matrix: threads here, each
 * with the rows of its own nodes. */
#include "support/failing_allocator.h"
#include "support/springs.h"
#include "support/suite.h"
#include "support/threads_as_ranks.h"

#include <stdio.h>

/* ---- A sheet that ranks share ---- */

typedef struct shared {
    sheet whole;
    int32_t *owner, *number; /* (nodes) rank of each, and its number in the matrix of all ranks */
    const double *b;         /* of the system that is solved, or columns of an identity matrix if NULL */
    double *out;             /* A b; or the preconditioner as a dense matrix */
    int iterations, levels;
    int failures; /* ranks that noticed that the matrix is not definite */
    bool converged;
} shared;

/* The part of one rank. */
typedef struct piece {
    drape_context *ctx;
    drape_arena *arena;
    drape_pattern p;
    drape_ranks ranks;
    int32_t *node; /* (block columns) in the whole sheet */
    int64_t *block;
    double *values, *x;
    drape_multigrid *m;
} piece;

static void list_nodes(const shared *s, piece *q, int32_t *local)
{
    const drape_pattern *p = &s->whole.p;
    int32_t count = 0;
    for (int32_t i = 0; i < p->block_count; i++)
        local[i] = -1;
    for (int32_t i = 0; i < p->block_count; i++)
        if (s->owner[i] == q->ranks.rank) {
            q->node[count] = i;
            local[i] = count++;
        }
    q->ranks.own_blocks = count;
    for (int32_t n = 0; n < q->ranks.own_blocks; n++)
        for (int32_t k = p->block_start[q->node[n]]; k < p->block_start[q->node[n] + 1]; k++)
            if (local[p->block_row[k]] < 0) {
                q->node[count] = p->block_row[k];
                local[p->block_row[k]] = count++;
            }
    q->p.block_count = count;
    for (int32_t i = 0; i < count; i++)
        q->block[i] = s->number[q->node[i]];
}

/* Own rows and columns, and all that is coupled among their neighbours, as elements would. */
static void make_pattern(const shared *s, piece *q, const int32_t *local)
{
    const drape_pattern *p = &s->whole.p;
    const int32_t count = q->p.block_count;
    int32_t *pairs = calloc(200 * (size_t)count, sizeof *pairs), used = 0;
    ck_assert_ptr_nonnull(pairs);
    for (int32_t n = 0; n < q->ranks.own_blocks; n++) {
        const int32_t first = p->block_start[q->node[n]], end = p->block_start[q->node[n] + 1];
        for (int32_t k = first; k < end; k++)
            for (int32_t l = first; l < k; l++)
                if (drape_pattern_has(p, p->block_row[k], p->block_row[l]) && used < 200 * count) {
                    pairs[used++] = p->block_row[k];
                    pairs[used++] = p->block_row[l];
                }
    }
    const drape_coupling coupling = {.count = used / 2, .nodes = 2, .node = pairs};
    ck_assert_int_eq(drape_pattern_build(q->arena, count, local, &coupling, 1, &q->p), DRAPE_OK);
    free(pairs);
}

/* Blocks between copies are not complete in a part: they are nonsense here. */
static void copy_values(const shared *s, piece *q)
{
    double *from = s->whole.values;
    for (int32_t j = 0; j < q->p.block_count; j++)
        for (int32_t k = q->p.block_start[j]; k < q->p.block_start[j + 1]; k++) {
            const int32_t i = q->p.block_row[k], J = q->node[j];
            int64_t stride, whole;
            double *to = drape_pattern_at(&q->p, q->values, j, k, &stride);
            const int32_t at = drape_pattern_find(&s->whole.p, q->node[i], J);
            const double *block = drape_pattern_at(&s->whole.p, from, J, at, &whole);
            for (int c = 0; c < 3; c++)
                for (int r = 0; r < 3; r++)
                    to[c * stride + r] =
                        i < q->ranks.own_blocks || j < q->ranks.own_blocks ? block[c * whole + r] : 1e30;
        }
    for (int32_t i = 0; i < q->p.block_count; i++)
        memcpy(q->x + 3 * (size_t)i, s->whole.x + 3 * (size_t)q->node[i], 3 * sizeof *q->x);
}

static piece open_piece(const drape_ranks *ranks, const shared *s)
{
    const size_t nodes = (size_t)s->whole.p.block_count;
    piece q = {.ctx = make_context(), .ranks = *ranks};
    q.arena = drape_arena_create(q.ctx);
    q.node = drape_arena_take(q.arena, nodes, sizeof *q.node);
    q.block = drape_arena_take(q.arena, nodes, sizeof *q.block);
    int32_t *local = calloc(nodes, sizeof *local);
    ck_assert(q.node && q.block && local);
    list_nodes(s, &q, local);
    make_pattern(s, &q, local);
    free(local);
    q.values = take(q.p.nonzeros);
    q.x = take(q.p.n);
    copy_values(s, &q);
    return q;
}

/* The pattern and the ranks must stay where they are, so not in open_piece. */
static bool factor_piece(piece *q, const drape_ranks *ranks)
{
    drape_ranks *own = (drape_ranks *)(uintptr_t)ranks;
    own->own_blocks = q->ranks.own_blocks;
    own->block = q->block;
    q->p.ranks = own;
    ck_assert_int_eq(drape_multigrid_create(q->arena, &q->p, &q->m), DRAPE_OK);
    return drape_multigrid_factor(q->m, q->values, q->x) == DRAPE_OK;
}

static void close_piece(piece *q)
{
    free(q->values);
    free(q->x);
    drape_arena_destroy(&q->arena);
    drape_context_destroy(&q->ctx);
}

#define scoped_piece SCOPED(close_piece) piece

/* Ranks of which each has a strip, or a random choice of the nodes, where all rows are at a border. The sheet
 * is turned, because sums of absolute values, unlike norms of blocks, are larger then. */
static shared share_sheet(int32_t side, int ranks, bool random)
{
    shared s = {.whole = open_sheet(side)};
    const int32_t nodes = side * side;
    uint64_t seed = 3;
    int32_t next = 0;
    turn_sheet(&s.whole);
    s.owner = calloc((size_t)nodes, sizeof *s.owner);
    s.number = calloc((size_t)nodes, sizeof *s.number);
    ck_assert(s.owner && s.number);
    for (int32_t i = 0; i < nodes; i++) {
        const int32_t drawn = (int32_t)((1 + random_number(&seed)) / 2 * ranks);
        s.owner[i] = !random ? i % side * ranks / side : drawn < ranks ? drawn : ranks - 1;
    }
    for (int32_t k = 0; k < ranks; k++)
        for (int32_t i = 0; i < nodes; i++)
            if (s.owner[i] == k)
                s.number[i] = next++;
    return s;
}

static void close_shared(shared *s)
{
    close_sheet(&s->whole);
    free(s->owner);
    free(s->number);
}

#define scoped_shared SCOPED(close_shared) shared

static void gather(const piece *q, const double *from, double *to)
{
    for (int32_t i = 0; i < q->ranks.own_blocks; i++)
        memcpy(to + 3 * (size_t)q->node[i], from + 3 * (size_t)i, 3 * sizeof *to);
}

static void scatter(const piece *q, const double *from, double *to)
{
    for (int32_t i = 0; i < q->ranks.own_blocks; i++)
        memcpy(to + 3 * (size_t)i, from + 3 * (size_t)q->node[i], 3 * sizeof *to);
}

/* ---- Tests ---- */

static void multiply_piece(const drape_ranks *ranks, void *user)
{
    shared *s = user;
    scoped_piece q = open_piece(ranks, s);
    scoped_memory double *x = take(q.p.n), *y = take(q.p.n);
    factor_piece(&q, ranks);
    scatter(&q, s->b, x);
    drape_multigrid_multiply(q.m, x, y);
    gather(&q, y, s->out);
}

/* To the rounding of sums of 13 blocks of 3 numbers, of which the terms are at most 1e5 N/m. */
TEST(the_product_is_that_of_the_whole_matrix)
{
    for (int random = 0; random < 2; random++) {
        scoped_shared s = share_sheet(20, 3, random);
        const int64_t n = s.whole.p.n;
        scoped_memory double *b = take(n), *whole = take(n);
        fill(b, n, 3);
        s.b = b;
        s.out = take(n);
        ck_assert(run_ranks(3, multiply_piece, &s));
        factor(&s.whole);
        drape_multigrid_multiply(s.whole.m, b, whole);
        for (int64_t i = 0; i < n; i++)
            ck_assert_double_eq_tol(s.out[i], whole[i], 1e-9);
        free(s.out);
    }
}

static void solve_piece(const drape_ranks *ranks, void *user)
{
    shared *s = user;
    scoped_piece q = open_piece(ranks, s);
    scoped_memory double *b = take(q.p.n), *x = take(q.p.n);
    const bool factored = factor_piece(&q, ranks);
    scatter(&q, s->b, b);
    const sheet own = {.m = q.m};
    drape_pcg pcg = drape_pcg_of(q.arena, 3 * (int64_t)q.ranks.own_blocks, &own, multiply, precondition);
    pcg.ranks = ranks;
    if (factored)
        drape_pcg_solve(&pcg, b, x, 1e-6, 200);
    if (ranks->rank == 0) {
        s->iterations = pcg.iterations;
        s->converged = factored && pcg.converged && pcg.definite;
        s->levels = drape_multigrid_levels(q.m);
    }
    const double failures = drape_ranks_sum(ranks, !factored);
    if (ranks->rank == 0)
        s->failures = (int)failures;
}

static int iterations_on(int ranks, int32_t side, bool random)
{
    scoped_shared s = share_sheet(side, ranks, random);
    double *b = take(s.whole.p.n);
    fill(b, s.whole.p.n, 7);
    s.b = b;
    ck_assert(run_ranks(ranks, solve_piece, &s));
    ck_assert(s.converged);
    ck_assert_int_ge(s.levels, 2);
    free(b);
    return s.iterations;
}

/* 12 or 13 on any number of ranks, 13 in one process; a fifth more and one is allowed. With sums of absolute
 * values in place of norms of blocks they are 52 on 2 ranks. One rank, with the code of several, has those of
 * one process. */
TEST(iterations_are_those_of_one_process)
{
    scoped_sheet q = open_sheet(120);
    scoped_memory double *b = take(q.p.n), *x = take(q.p.n);
    fill(b, q.p.n, 7);
    factor(&q);
    drape_pcg one = drape_pcg_of(q.arena, q.p.n, &q, multiply, precondition);
    drape_pcg_solve(&one, b, x, 1e-6, 200);
    for (int ranks = 1; ranks <= 6; ranks++) {
        const int found = iterations_on(ranks, 120, false);
        printf("# %d ranks: %d iterations, one process: %d\n", ranks, found, one.iterations);
        ck_assert_msg(found <= 1.2 * one.iterations + (ranks > 1), "%d ranks: %d for %d", ranks, found,
                      one.iterations);
    }
}

TEST(a_matrix_that_is_not_positive_definite_is_noticed_by_all)
{
    scoped_shared s = share_sheet(30, 3, false);
    int64_t stride;
    double *b = take(s.whole.p.n);
    *drape_pattern_at(&s.whole.p, s.whole.values, 100, s.whole.p.diagonal[100], &stride) = -1;
    s.b = b;
    ck_assert(run_ranks(3, solve_piece, &s));
    ck_assert_int_eq(s.failures, 3);
    free(b);
}

/* ---- Symmetry ---- */

static _Thread_local drape_exchange *columns;

static void fetch_columns(const drape_ranks *ranks, double *blocks)
{
    team_copy(ranks, columns, blocks, blocks + 3 * (size_t)ranks->own_blocks, 3 * sizeof *blocks);
}

static void judge_piece(const drape_ranks *ranks, void *user)
{
    shared *s = user;
    scoped_piece q = open_piece(ranks, s);
    const int32_t own = q.ranks.own_blocks, copies = q.p.block_count - own;
    drape_ranks *here = (drape_ranks *)(uintptr_t)ranks;
    int32_t *rank = drape_arena_take(q.arena, (size_t)copies, sizeof *rank),
            *place = drape_arena_take(q.arena, (size_t)copies, sizeof *place);
    ck_assert(rank && place);
    for (int32_t i = 0; i < copies; i++) {
        const int32_t node = q.node[own + i];
        rank[i] = s->owner[node];
        for (int32_t k = 0; k < node; k++)
            place[i] += s->owner[k] == rank[i];
    }
    here->own_blocks = own;
    here->fetch_blocks = fetch_columns;
    q.p.ranks = here;
    columns = team_plan(ranks, q.arena, copies, rank, place, 3 * sizeof(double));
    scoped_memory double *diagonal = take(q.p.n);
    const double symmetric = drape_ranks_sum(ranks, drape_pattern_is_symmetric(&q.p, q.values, diagonal));
    if (ranks->rank == 0)
        s->failures = ranks->count - (int)symmetric;
}

/* Multiplies the scalar row and column of a component of a node; the sheet must be symmetric. */
static void scale_component(sheet *q, int32_t node, int component, double by)
{
    for (int32_t k = q->p.block_start[node]; k < q->p.block_start[node + 1]; k++) {
        const int32_t other = q->p.block_row[k];
        int64_t stride, mirrored;
        double *a = drape_pattern_at(&q->p, q->values, node, k, &stride),
               *b = drape_pattern_at(&q->p, q->values, other, drape_pattern_find(&q->p, node, other),
                                     &mirrored);
        for (int i = 0; i < 3; i++) {
            a[component * stride + i] *= by;
            b[i * mirrored + component] *= by;
        }
    }
}

/* A component of a node of which row and column are 1e-6 of the others', and one entry 1 + 1e-8 times its
 * mirror image: a fault of symmetry, though it is 1e-14 of the largest entries of its block. Between two
 * nodes of a rank, and between nodes of two. */
TEST(a_small_part_that_is_not_symmetric_is_found_by_all)
{
    const int32_t side = 12;
    for (int32_t column = 4; column < 8; column += 3) {
        scoped_shared s = share_sheet(side, 3, false);
        sheet *q = &s.whole;
        const int32_t node = 5 * side + column, other = node + 1;
        int64_t stride;
        ck_assert(column == 4 || s.owner[node] != s.owner[other]);
        drape_pattern_symmetrize(&q->p, q->values);
        scale_component(q, node, 2, 1e-6);
        ck_assert(run_ranks(3, judge_piece, &s));
        ck_assert_int_eq(s.failures, 0);
        double *block =
            drape_pattern_at(&q->p, q->values, node, drape_pattern_find(&q->p, other, node), &stride);
        ck_assert_double_gt(fabs(block[2 * stride]), 0);
        block[2 * stride] *= 1 + 1e-8;
        ck_assert(run_ranks(3, judge_piece, &s));
        ck_assert_int_eq(s.failures, 3);
    }
}

/* ---- Memory ---- */

typedef struct shortage {
    shared *shared;
    int rank;     /* it alone is out of memory */
    long fail_at; /* at this allocation of the preconditioner */
    int failures; /* ranks that noticed */
    bool reached; /* there was such an allocation */
} shortage;

static void create_piece(const drape_ranks *ranks, void *user)
{
    shortage *s = user;
    failing_allocator memory = {0};
    piece q = open_piece(ranks, s->shared);
    drape_ranks *own = (drape_ranks *)(uintptr_t)ranks;
    scoped_context *ctx = failing_context(&memory);
    scoped_arena *arena = drape_arena_create(ctx);
    own->own_blocks = q.ranks.own_blocks;
    own->block = q.block;
    q.p.ranks = own;
    memory.fail_at = ranks->rank == s->rank ? memory.calls + s->fail_at : 0;
    const drape_status status = drape_multigrid_create(arena, &q.p, &q.m);
    const double failures = drape_ranks_sum(ranks, status == DRAPE_E_MEMORY),
                 said = drape_ranks_sum(ranks, *drape_context_message(ctx) != 0);
    if (ranks->rank == s->rank) {
        s->failures = failures == said ? (int)failures : -1;
        s->reached = memory.calls >= memory.fail_at;
    }
    close_piece(&q);
}

/* Each allocation fails on one rank, first or not: all return the failure, with a message, and none waits for
 * ever. There are four levels here, of which ranks share three. */
TEST(a_rank_that_alone_is_out_of_memory_leaves_none_waiting)
{
    scoped_shared split = share_sheet(40, 3, false);
    for (int rank = 0; rank < 3; rank += 2) {
        shortage s = {.shared = &split, .rank = rank, .fail_at = 1};
        for (bool more = true; more; s.fail_at++) {
            ck_assert(run_ranks(3, create_piece, &s));
            more = s.reached;
            ck_assert_msg(s.failures == (more ? 3 : 0), "allocation %ld: %d ranks", s.fail_at, s.failures);
        }
        printf("# rank %d: %ld allocations\n", rank, s.fail_at - 2);
        ck_assert_int_gt(s.fail_at, 100);
    }
}
