/*
 * cholmod: supernodal Cholesky factorisation by CHOLMOD (Chen, Davis, Hager & Rajamanickam 2008) of a
 * symmetric positive definite matrix. The graph of 3 x 3 blocks, nine times smaller than that of the
 * scalars, is ordered and analysed once, in create; the memory of the factors is taken there, too. Nested
 * dissection by METIS, which Debian has as a shared library only, saves a quarter of a factorisation at 10
 * 000 nodes and nothing up to 529, for 1.6 times the analysis.
 *
 * Callers do not say whether a matrix is symmetric: each entry of the lower triangle is compared with its
 * mirror while it is copied. A matrix that is not symmetric (internal damping in continuous time and
 * friction have such a part), not positive definite, or singular to working precision goes to the fallback
 * (fallback.h); no matrix is symmetrised.
 */
#include "solvers/fallback.h"
#include "solvers/library_lock.h"

#include "base/finite.h"

#include <amd.h>
#include <cholmod.h>
#include <math.h>
#include <omp.h>
#include <string.h>

typedef SuiteSparse_long index_t;

/* Relative rounding error in a_ij, to which elements contribute at most about sqrt(a_ii a_jj) each. A
 * smaller difference between mirrored entries moves the solution no more than rounding the entries does. */
#define SYMMETRY  1e-13
#define MIN_RCOND 1e-15 /* smaller: singular to working precision, so the fallback decides */

extern const drape_linear_ops drape_linear_cholmod;

/* A triangle of the permuted matrix, of blocks or of scalars. */
typedef struct triangle {
    index_t *column, *row;
} triangle;

typedef struct cholmod_state {
    drape_arena *arena;
    const drape_pattern *pattern;
    cholmod_common common;
    index_t *order;             /* (blocks) the block column of the pattern that is eliminated k-th */
    triangle blocks;            /* lower, rows ascending */
    int32_t *source, *mirror;   /* (lower blocks) the block of the pattern that each one is a copy of, and
                                   its mirror */
    triangle scalars;           /* lower */
    double *values;             /* of `scalars` */
    double *diagonal;           /* (n) in the pattern's order */
    double *solution, *scratch; /* (n), (largest supernode) for solve */
    cholmod_factor *factor;
    drape_fallback fallback;
    bool factored; /* by Cholesky or by the fallback */
} cholmod_state;

_Static_assert(sizeof(index_t) == sizeof(int64_t), "the pattern's indices are passed to CHOLMOD as they are");

/* ---- Analysis ---- */

/* Workspace of the analysis; over blocks, except for scalar_*. */
typedef struct analysis {
    index_t *column, *row; /* the pattern, with CHOLMOD's integers */
    index_t *inverse, *parent, *post, *count, *first, *level;
    triangle upper, scalar_upper;
    index_t *scalar_parent;
} analysis;

static index_t *take_indices(drape_arena *arena, size_t count)
{
    return drape_arena_take(arena, count, sizeof(index_t));
}

static drape_status allocate(cholmod_state *s, analysis *a, drape_arena *scratch)
{
    const drape_pattern *p = s->pattern;
    const size_t blocks = (size_t)p->block_count, n = (size_t)p->n;
    /* entries of one triangle, including the diagonal */
    const size_t lower_blocks = ((size_t)p->block_start[blocks] + blocks) / 2,
                 lower_scalars = ((size_t)p->nonzeros + n) / 2;
    s->order = take_indices(s->arena, blocks);
    s->blocks.column = take_indices(s->arena, blocks + 1);
    s->blocks.row = take_indices(s->arena, lower_blocks);
    s->scalars.column = take_indices(s->arena, n + 1);
    s->scalars.row = take_indices(s->arena, lower_scalars);
    s->source = drape_arena_take(s->arena, lower_blocks, sizeof *s->source);
    s->mirror = drape_arena_take(s->arena, lower_blocks, sizeof *s->mirror);
    s->values = drape_arena_take(s->arena, lower_scalars, sizeof *s->values);
    s->diagonal = drape_arena_take(s->arena, n, sizeof *s->diagonal);
    s->solution = drape_arena_take(s->arena, n, sizeof *s->solution);
    a->column = take_indices(scratch, blocks + 1);
    a->row = take_indices(scratch, (size_t)p->block_start[blocks]);
    a->upper.column = take_indices(scratch, blocks + 1);
    a->upper.row = take_indices(scratch, lower_blocks);
    a->scalar_upper.column = take_indices(scratch, n + 1);
    a->scalar_upper.row = take_indices(scratch, lower_scalars);
    a->scalar_parent = take_indices(scratch, n);
    index_t **const of_blocks[] = {&a->inverse, &a->parent, &a->post, &a->count, &a->first, &a->level};
    for (size_t i = 0; i < sizeof of_blocks / sizeof *of_blocks; i++)
        *of_blocks[i] = take_indices(scratch, blocks);
    return drape_arena_status(s->arena) ? DRAPE_E_MEMORY : drape_arena_status(scratch);
}

/* A triangle with this many columns as a matrix of CHOLMOD; stype -1: lower, 1: upper. */
static cholmod_sparse as_matrix(const triangle *t, index_t n, int stype, double *values)
{
    return (cholmod_sparse){.nrow = (size_t)n,
                            .ncol = (size_t)n,
                            .nzmax = (size_t)t->column[n],
                            .p = t->column,
                            .i = t->row,
                            .x = values,
                            .stype = stype,
                            .itype = CHOLMOD_LONG,
                            .xtype = values ? CHOLMOD_REAL : CHOLMOD_PATTERN,
                            .dtype = CHOLMOD_DOUBLE,
                            .sorted = 1,
                            .packed = 1};
}

/* Turns counts into starts: count[j] entries of column j become the place where they begin, which is also
 * copied to next[j]. */
static void start_columns(index_t *column, index_t *next, index_t n)
{
    index_t at = 0;
    for (index_t j = 0; j < n; j++) {
        index_t count = column[j];
        column[j] = next[j] = at;
        at += count;
    }
    column[n] = at;
}

/* The lower triangle of the permuted blocks. Its rows are visited in order, so they are ascending in each
 * column; a row of it is a column of the pattern, whose block is the mirror. */
static void permute_lower(cholmod_state *s, analysis *a)
{
    const drape_pattern *p = s->pattern;
    index_t n = p->block_count, *next = a->first;
    for (index_t k = 0; k < n; k++)
        a->inverse[s->order[k]] = k;
    memset(s->blocks.column, 0, (size_t)(n + 1) * sizeof *s->blocks.column);
    for (index_t j = 0; j < n; j++)
        for (index_t k = a->column[j]; k < a->column[j + 1]; k++)
            s->blocks.column[a->inverse[a->row[k]]] += a->inverse[a->row[k]] <= a->inverse[j];
    start_columns(s->blocks.column, next, n);
    for (index_t row = 0; row < n; row++)
        for (index_t k = a->column[s->order[row]]; k < a->column[s->order[row] + 1]; k++) {
            index_t column = a->inverse[a->row[k]];
            if (column > row)
                continue;
            s->mirror[next[column]] = (int32_t)k;
            s->blocks.row[next[column]++] = row;
        }
}

static void transpose_lower(cholmod_state *s, analysis *a)
{
    index_t n = s->pattern->block_count, *next = a->first;
    memset(a->upper.column, 0, (size_t)(n + 1) * sizeof *a->upper.column);
    for (index_t k = 0; k < s->blocks.column[n]; k++)
        a->upper.column[s->blocks.row[k]]++;
    start_columns(a->upper.column, next, n);
    for (index_t j = 0; j < n; j++)
        for (index_t k = s->blocks.column[j]; k < s->blocks.column[j + 1]; k++)
            a->upper.row[next[s->blocks.row[k]]++] = j;
}

/* Both triangles in the present order, and the elimination tree. */
static bool permute(cholmod_state *s, analysis *a)
{
    permute_lower(s, a);
    transpose_lower(s, a);
    cholmod_sparse upper = as_matrix(&a->upper, s->pattern->block_count, 1, NULL);
    return cholmod_l_etree(&upper, a->parent, &s->common);
}

/* Orders by minimum degree, then by the postorder of the elimination tree, in which supernodes are
 * contiguous. */
static bool order_blocks(cholmod_state *s, analysis *a)
{
    const drape_pattern *p = s->pattern;
    index_t n = p->block_count, *order = a->level;
    for (index_t i = 0; i <= n; i++)
        a->column[i] = p->block_start[i];
    for (index_t i = 0; i < p->block_start[n]; i++)
        a->row[i] = p->block_row[i];
    if (amd_l_order(n, a->column, a->row, s->order, NULL, NULL) < AMD_OK || !permute(s, a) ||
        cholmod_l_postorder(a->parent, (size_t)n, NULL, a->post, &s->common) != n)
        return false;
    for (index_t k = 0; k < n; k++)
        order[k] = s->order[a->post[k]];
    memcpy(s->order, order, (size_t)n * sizeof *s->order);
    return permute(s, a);
}

/* Counts the entries in each column of the factors. */
static bool count_columns(cholmod_state *s, analysis *a)
{
    index_t n = s->pattern->block_count;
    cholmod_sparse lower = as_matrix(&s->blocks, n, -1, NULL);
    for (index_t k = 0; k < n; k++)
        a->post[k] = k; /* the order is a postorder already */
    return cholmod_l_rowcolcounts(&lower, NULL, 0, a->parent, a->post, NULL, a->count, a->first, a->level,
                                  &s->common);
}

/* Expands each block to nine scalars, a diagonal block to the six of its lower triangle. In the elimination
 * tree the three scalars of a block column form a chain. */
static void expand(cholmod_state *s, analysis *a)
{
    index_t low = 0, up = 0;
    for (index_t j = 0; j < s->pattern->n; j++) {
        index_t block = j / 3, c = j % 3;
        s->scalars.column[j] = low;
        for (index_t k = s->blocks.column[block]; k < s->blocks.column[block + 1]; k++)
            for (index_t r = s->blocks.row[k] == block ? c : 0; r < 3; r++)
                s->scalars.row[low++] = 3 * s->blocks.row[k] + r;
        a->scalar_upper.column[j] = up;
        for (index_t k = a->upper.column[block]; k < a->upper.column[block + 1]; k++)
            for (index_t r = 0; r < (a->upper.row[k] == block ? c + 1 : 3); r++)
                a->scalar_upper.row[up++] = 3 * a->upper.row[k] + r;
        a->scalar_parent[j] = c < 2 ? j + 1 : a->parent[block] < 0 ? -1 : 3 * a->parent[block];
    }
    s->scalars.column[s->pattern->n] = low;
    a->scalar_upper.column[s->pattern->n] = up;
}

/* Finds the supernodes and takes the memory of the factors. */
static bool find_supernodes(cholmod_state *s, analysis *a)
{
    index_t n = s->pattern->n;
    cholmod_sparse upper = as_matrix(&a->scalar_upper, n, 1, NULL);
    s->factor = cholmod_l_allocate_factor((size_t)n, &s->common);
    if (!s->factor)
        return false;
    for (index_t j = 0; j < n; j++)
        ((index_t *)s->factor->ColCount)[j] = 3 * a->count[j / 3] - j % 3;
    if (!cholmod_l_super_symbolic(&upper, NULL, a->scalar_parent, s->factor, &s->common) ||
        !cholmod_l_change_factor(CHOLMOD_REAL, 1, 1, 1, 1, s->factor, &s->common))
        return false;
    s->scratch = drape_arena_take(s->arena, s->factor->maxesize, sizeof *s->scratch);
    return s->scratch;
}

static bool analyse(cholmod_state *s, analysis *a)
{
    if (!order_blocks(s, a) || !count_columns(s, a))
        return false;
    for (index_t c = 0; c < s->pattern->block_count; c++)
        for (index_t k = s->blocks.column[c]; k < s->blocks.column[c + 1]; k++)
            s->source[k] =
                drape_pattern_find(s->pattern, (int32_t)s->order[s->blocks.row[k]], (int32_t)s->order[c]);
    expand(s, a);
    return find_supernodes(s, a);
}

static void destroy(void **state)
{
    cholmod_state *s = *state;
    cholmod_l_free_factor(&s->factor, &s->common);
    cholmod_l_finish(&s->common);
    drape_fallback_destroy(&s->fallback);
}

static drape_status create(drape_arena *arena, const drape_pattern *pattern, void **state)
{
    cholmod_state *s = drape_arena_take(arena, 1, sizeof *s);
    if (!s || !cholmod_l_start(&s->common))
        return DRAPE_E_MEMORY;
    s->arena = arena;
    s->pattern = pattern;
    s->fallback = drape_fallback_of(arena, pattern);
    s->common.print = 0;
    s->common.quick_return_if_not_posdef = 1;
    analysis a = {0};
    drape_arena scratch = drape_arena_of(arena->ctx);
    const bool good = !allocate(s, &a, &scratch) && analyse(s, &a);
    drape_arena_free(&scratch);
    if (good) {
        *state = s;
        return DRAPE_OK;
    }
    const int code = s->common.status;
    destroy(&(void *){s});
    return drape_fail(arena->ctx, DRAPE_E_MEMORY,
                      "out of memory: CHOLMOD cannot analyse the %lld x %lld Jacobian: status %d",
                      (long long)pattern->n, (long long)pattern->n, code);
}

/* ---- Factors ---- */

/* False if an entry is not positive: then the matrix is not positive definite. */
static bool read_diagonal(cholmod_state *s, const double *values)
{
    const drape_pattern *p = s->pattern;
    for (int32_t j = 0; j < p->block_count; j++) {
        int64_t stride;
        const double *at = drape_pattern_at(p, (double *)(uintptr_t)values, j, p->diagonal[j], &stride);
        for (int c = 0; c < 3; c++) {
            s->diagonal[3 * j + c] = at[c * stride + c];
            if (!(s->diagonal[3 * j + c] > 0))
                return false;
        }
    }
    return true;
}

/* Copies one block on or below the diagonal to its three columns; false if it differs from its mirror. */
static bool copy_block(cholmod_state *s, const double *values, index_t k, index_t column, double *to[3])
{
    const drape_pattern *p = s->pattern;
    int32_t j = (int32_t)s->order[column], i = (int32_t)s->order[s->blocks.row[k]];
    int64_t stride, mirror_stride;
    const double *at = drape_pattern_at(p, (double *)(uintptr_t)values, j, s->source[k], &stride),
                 *mirror = drape_pattern_at(p, (double *)(uintptr_t)values, i, s->mirror[k], &mirror_stride);
    bool symmetric = true;
    for (int c = 0; c < 3; c++)
        for (int r = i == j ? c : 0; r < 3; r++) {
            double a = at[c * stride + r], difference = a - mirror[r * mirror_stride + c];
            *to[c]++ = a;
            symmetric = symmetric && difference * difference <= SYMMETRY * SYMMETRY * s->diagonal[3 * i + r] *
                                                                    s->diagonal[3 * j + c];
        }
    return symmetric;
}

/* Copies the permuted lower triangle; false if the matrix is not symmetric. */
static bool copy_values(cholmod_state *s, const double *values)
{
    for (index_t column = 0; column < s->pattern->block_count; column++) {
        double *to[3];
        for (int c = 0; c < 3; c++)
            to[c] = s->values + s->scalars.column[3 * column + c];
        for (index_t k = s->blocks.column[column]; k < s->blocks.column[column + 1]; k++)
            if (!copy_block(s, values, k, column, to))
                return false;
    }
    return true;
}

/* Debian's CHOLMOD starts four OpenMP threads whatever the environment says; the number of threads is for
 * the host to choose. */
static bool factor_lower(cholmod_state *s)
{
    cholmod_sparse lower = as_matrix(&s->scalars, s->pattern->n, -1, s->values);
    double shift[2] = {0, 0};
    int levels = omp_get_max_active_levels();
    omp_set_max_active_levels(0);
    drape_library_lock();
    bool done = cholmod_l_super_numeric(&lower, NULL, shift, s->factor, &s->common);
    drape_library_unlock();
    omp_set_max_active_levels(levels);
    return done && s->common.status == CHOLMOD_OK && s->factor->minor == s->factor->n &&
           cholmod_l_rcond(s->factor, &s->common) > MIN_RCOND;
}

/* A Cholesky factorisation is tried for each symmetric matrix: skipping attempts after failures saved 2 or
 * 3 of the 52 failed ones for the 512 matrices of a folding sheet, and gave positive definite matrices to
 * the slower fallback. */
static drape_status factor_any(cholmod_state *s, const double *values, bool definite)
{
    s->fallback.active = s->factored = false;
    if (!drape_all_finite(values, (size_t)s->pattern->nonzeros))
        return DRAPE_RETRY_LINEAR;
    bool positive = read_diagonal(s, values), symmetric = positive && copy_values(s, values);
    s->factored = symmetric && factor_lower(s);
    if (s->factored)
        return DRAPE_OK;
    if (definite && (symmetric || !positive))
        return DRAPE_RETRY_LINEAR;
    drape_status status = drape_fallback_factor(&s->fallback, values);
    s->factored = !status;
    return status;
}

static drape_status factor(void *state, const double *values)
{
    return factor_any(state, values, false);
}

static drape_status factor_definite(void *state, const double *values)
{
    return factor_any(state, values, true);
}

/* ---- Solutions ---- */

static cholmod_dense as_vector(double *values, size_t rows)
{
    return (cholmod_dense){.nrow = rows,
                           .ncol = 1,
                           .nzmax = rows,
                           .d = rows,
                           .x = values,
                           .xtype = CHOLMOD_REAL,
                           .dtype = CHOLMOD_DOUBLE};
}

static drape_status solve(void *state, const double *b, double *x)
{
    cholmod_state *s = state;
    size_t n = (size_t)s->pattern->n;
    if (!s->factored)
        return DRAPE_RETRY_LINEAR;
    if (s->fallback.active)
        return s->fallback.ops->solve(s->fallback.solver, b, x);
    for (size_t j = 0; j < n; j++)
        s->solution[j] = b[3 * s->order[j / 3] + (index_t)(j % 3)];
    cholmod_dense solution = as_vector(s->solution, n), scratch = as_vector(s->scratch, s->factor->maxesize);
    drape_library_lock();
    bool done = cholmod_l_super_lsolve(s->factor, &solution, &scratch, &s->common) &&
                cholmod_l_super_ltsolve(s->factor, &solution, &scratch, &s->common);
    drape_library_unlock();
    if (!done)
        return DRAPE_RETRY_LINEAR;
    for (size_t j = 0; j < n; j++)
        x[3 * s->order[j / 3] + (index_t)(j % 3)] = s->solution[j];
    return drape_all_finite(x, n) ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}

static void archive(void *state, drape_archive *a, const double *values)
{
    cholmod_state *s = state;
    drape_fallback_archive(&s->fallback, &s->factored, a, values);
    if (drape_archive_has_read(a) && values && s->factored && !s->fallback.active &&
        factor_any(s, values, false))
        drape_archive_fail(a, DRAPE_E_SOLVER, "a matrix of the checkpoint has no Cholesky factors here");
}

static size_t bytes(const void *state)
{
    const cholmod_state *s = state;
    return s->common.memory_inuse + drape_fallback_bytes(&s->fallback);
}

static void report(const void *state, drape_linear_report *out)
{
    *out = drape_fallback_report(&((const cholmod_state *)state)->fallback, &drape_linear_cholmod);
}

const drape_linear_ops drape_linear_cholmod = {
    .entry = {.name = "cholmod",
              .summary = "supernodal Cholesky, analysed once; a matrix that is not symmetric positive "
                         "definite goes to umfpack or klu, by size",
              .reference = "Chen, Davis, Hager & Rajamanickam 2008, Algorithm 887: CHOLMOD"},
    .borrows_heap = true, /* the update of the largest supernode, and what OpenMP needs for a loop */
    .create = create,
    .factor = factor,
    .factor_definite = factor_definite,
    .solve = solve,
    .archive = archive,
    .destroy = destroy,
    .bytes = bytes,
    .report = report,
};
