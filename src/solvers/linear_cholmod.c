/*
 * cholmod: supernodal Cholesky by CHOLMOD (Chen, Davis, Hager & Rajamanickam 2008) for a symmetric positive
 * definite matrix. The graph of blocks is ordered and analysed once, in create, nine times smaller than that
 * of the scalars; the factors' memory is taken there too. Nested dissection by METIS, which Debian has shared
 * only, saves a quarter of a factorisation at 10 000 nodes and nothing up to 529, for 1.6 times the analysis.
 *
 * Whether a matrix is symmetric is not asked of the caller but seen: each entry of the lower triangle is
 * compared with its mirror while it is copied. A matrix that is not symmetric (internal damping in continuous
 * time and friction have such a part), not positive definite, or singular to working precision goes to the
 * row that is the fastest for general matrices of this size, which solves it as it stands or tells that it
 * cannot; nothing is made symmetric that is not. That row's solver is made for the first such matrix: most
 * scenes have none, and its analysis would be up to half of create.
 */
#include "solvers/alone.h"
#include "solvers/linear.h"

#include "base/finite.h"

#include <amd.h>
#include <cholmod.h>
#include <math.h>
#include <omp.h>
#include <string.h>

typedef SuiteSparse_long index_t;

/* Round-off in a_ij, whose elements' parts are at most about sqrt(a_ii a_jj) each. Below it, a difference
 * between mirrored entries moves the solution as rounding the entries does. */
#define SYMMETRY  1e-13
#define MIN_RCOND 1e-15 /* below: singular to working precision; the general row decides */

extern const drape_linear_ops drape_linear_cholmod;

/* A triangle of the permuted matrix, as blocks or as scalars. */
typedef struct triangle {
    index_t *column, *row;
} triangle;

typedef struct cholmod_state {
    drape_context *ctx;
    const drape_pattern *pattern;
    cholmod_common common;
    bool started;               /* common is */
    index_t *order;             /* (blocks) the block column of the pattern that is eliminated k-th */
    triangle blocks;            /* lower, rows ascending */
    int32_t *source, *mirror;   /* (lower blocks) the pattern's block that each is, and the transposed one */
    triangle scalars;           /* lower */
    double *values;             /* of the scalars */
    double *diagonal;           /* (n) in the pattern's order */
    double *solution, *scratch; /* (n), (largest supernode) for solve */
    cholmod_factor *factor;
    const drape_linear_ops *general_row; /* for what has no Cholesky factors */
    void *general;                       /* its state; NULL before the first such matrix */
    bool by_general, factored;
    int64_t fallbacks;
} cholmod_state;

_Static_assert(sizeof(index_t) == sizeof(int64_t), "the pattern's indices are passed to CHOLMOD as they are");

static void destroy(void **state)
{
    cholmod_state *s = *state;
    if (!s)
        return;
    if (s->started) {
        cholmod_l_free_factor(&s->factor, &s->common);
        cholmod_l_finish(&s->common);
    }
    if (s->general)
        s->general_row->destroy(&s->general);
    void *all[] = {s->order,       s->blocks.column, s->blocks.row, s->source,   s->mirror, s->scalars.column,
                   s->scalars.row, s->values,        s->diagonal,   s->solution, s->scratch};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        drape_free(s->ctx, all[i]);
    drape_free(s->ctx, s);
    *state = NULL;
}

/* ---- Analysis ---- */

/* What only the analysis needs, over blocks but for scalar_*. */
typedef struct analysis {
    index_t *column, *row; /* the pattern, in CHOLMOD's indices */
    index_t *inverse, *parent, *post, *count, *first, *level;
    triangle upper, scalar_upper;
    index_t *scalar_parent;
} analysis;

static void free_analysis(drape_context *ctx, analysis *a)
{
    void *all[] = {a->column,
                   a->row,
                   a->inverse,
                   a->parent,
                   a->post,
                   a->count,
                   a->first,
                   a->level,
                   a->upper.column,
                   a->upper.row,
                   a->scalar_upper.column,
                   a->scalar_upper.row,
                   a->scalar_parent};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        drape_free(ctx, all[i]);
}

/* Blocks and scalars of one triangle, the diagonal in it. */
static size_t lower_blocks(const drape_pattern *p)
{
    return ((size_t)p->block_start[p->block_count] + (size_t)p->block_count) / 2;
}

static size_t lower_scalars(const drape_pattern *p)
{
    return ((size_t)p->nonzeros + (size_t)p->n) / 2;
}

static bool allocate(cholmod_state *s, analysis *a)
{
    const drape_pattern *p = s->pattern;
    size_t blocks = (size_t)p->block_count, n = (size_t)p->n;
    struct {
        index_t **array;
        size_t count;
    } arrays[] = {{&s->order, blocks},
                  {&s->blocks.column, blocks + 1},
                  {&s->blocks.row, lower_blocks(p)},
                  {&s->scalars.column, n + 1},
                  {&s->scalars.row, lower_scalars(p)},
                  {&a->column, blocks + 1},
                  {&a->row, (size_t)p->block_start[blocks]},
                  {&a->inverse, blocks},
                  {&a->parent, blocks},
                  {&a->post, blocks},
                  {&a->count, blocks},
                  {&a->first, blocks},
                  {&a->level, blocks},
                  {&a->upper.column, blocks + 1},
                  {&a->upper.row, lower_blocks(p)},
                  {&a->scalar_upper.column, n + 1},
                  {&a->scalar_upper.row, lower_scalars(p)},
                  {&a->scalar_parent, n}};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        if (!(*arrays[i].array = drape_alloc(s->ctx, arrays[i].count, sizeof(index_t))))
            return false;
    s->source = drape_alloc(s->ctx, lower_blocks(p), sizeof *s->source);
    s->mirror = drape_alloc(s->ctx, lower_blocks(p), sizeof *s->mirror);
    s->values = drape_alloc(s->ctx, lower_scalars(p), sizeof *s->values);
    s->diagonal = drape_alloc(s->ctx, n, sizeof *s->diagonal);
    s->solution = drape_alloc(s->ctx, n, sizeof *s->solution);
    return s->source && s->mirror && s->values && s->diagonal && s->solution;
}

/* A triangle with this many entries as CHOLMOD's matrix; stype -1: lower, 1: upper. */
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

/* Counts to places: count[j] entries of column j become its start, which also goes to next[j]. */
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

/* The lower triangle of the permuted blocks. Its rows are walked in order, so they are ascending in each
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

/* Where the blocks below the diagonal lie in the pattern. */
static void find_sources(cholmod_state *s)
{
    for (index_t c = 0; c < s->pattern->block_count; c++)
        for (index_t k = s->blocks.column[c]; k < s->blocks.column[c + 1]; k++)
            s->source[k] =
                drape_pattern_find(s->pattern, (int32_t)s->order[s->blocks.row[k]], (int32_t)s->order[c]);
}

/* The pattern's blocks in CHOLMOD's indices. */
static void copy_pattern(const drape_pattern *p, analysis *a)
{
    for (index_t i = 0; i <= p->block_count; i++)
        a->column[i] = p->block_start[i];
    for (index_t i = 0; i < p->block_start[p->block_count]; i++)
        a->row[i] = p->block_row[i];
}

/* Minimum degree, then the elimination tree's own order, in which supernodes are contiguous. */
static bool order_blocks(cholmod_state *s, analysis *a)
{
    index_t n = s->pattern->block_count, *order = a->level;
    copy_pattern(s->pattern, a);
    if (amd_l_order(n, a->column, a->row, s->order, NULL, NULL) < AMD_OK || !permute(s, a) ||
        cholmod_l_postorder(a->parent, (size_t)n, NULL, a->post, &s->common) != n)
        return false;
    for (index_t k = 0; k < n; k++)
        order[k] = s->order[a->post[k]];
    memcpy(s->order, order, (size_t)n * sizeof *s->order);
    return permute(s, a);
}

/* Entries in each column of the factors. */
static bool count_columns(cholmod_state *s, analysis *a)
{
    index_t n = s->pattern->block_count;
    cholmod_sparse lower = as_matrix(&s->blocks, n, -1, NULL);
    for (index_t k = 0; k < n; k++)
        a->post[k] = k; /* it is in postorder already */
    return cholmod_l_rowcolcounts(&lower, NULL, 0, a->parent, a->post, NULL, a->count, a->first, a->level,
                                  &s->common);
}

/* Each block becomes nine scalars, one on the diagonal the six of its triangle. In the elimination tree the
 * three scalars of a block are a chain. */
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

/* The supernodes, and memory for the factors. */
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
    s->scratch = drape_alloc(s->ctx, s->factor->maxesize, sizeof *s->scratch);
    return s->scratch;
}

static drape_status analyse(cholmod_state *s, analysis *a)
{
    if (!allocate(s, a))
        return DRAPE_E_MEMORY;
    if (!cholmod_l_start(&s->common))
        return DRAPE_E_MEMORY;
    s->started = true;
    s->common.print = 0;
    s->common.quick_return_if_not_posdef = 1;
    if (!order_blocks(s, a) || !count_columns(s, a))
        return DRAPE_E_MEMORY;
    find_sources(s);
    expand(s, a);
    return find_supernodes(s, a) ? DRAPE_OK : DRAPE_E_MEMORY;
}

static drape_status create(drape_context *ctx, const drape_pattern *pattern, void **state)
{
    cholmod_state *s = drape_alloc(ctx, 1, sizeof *s);
    *state = s;
    if (!s)
        return DRAPE_E_MEMORY;
    s->ctx = ctx;
    s->pattern = pattern;
    s->general_row = drape_linear_general(pattern->n);
    analysis a = {0};
    drape_status status = analyse(s, &a);
    free_analysis(ctx, &a);
    if (status) {
        drape_fail(ctx, status, "out of memory: CHOLMOD cannot analyse the %lld x %lld Jacobian: status %d",
                   (long long)pattern->n, (long long)pattern->n, s->common.status);
        destroy(state);
    }
    return status;
}

/* ---- Factors ---- */

/* False where one is not positive: then the matrix is not positive definite. */
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

/* Copies one block below or on the diagonal to its three columns; false where it differs from its mirror. */
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

/* The lower triangle, permuted; false where the matrix is not symmetric. */
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

/* Debian's CHOLMOD starts four threads of OpenMP whatever the environment says; how many threads there are
 * is for the host to say. */
static bool factor_lower(cholmod_state *s)
{
    cholmod_sparse lower = as_matrix(&s->scalars, s->pattern->n, -1, s->values);
    double shift[2] = {0, 0};
    int levels = omp_get_max_active_levels();
    omp_set_max_active_levels(0);
    drape_alone_begin();
    bool done = cholmod_l_super_numeric(&lower, NULL, shift, s->factor, &s->common);
    drape_alone_end();
    omp_set_max_active_levels(levels);
    return done && s->common.status == CHOLMOD_OK && s->factor->minor == s->factor->n &&
           cholmod_l_rcond(s->factor, &s->common) > MIN_RCOND;
}

/* Cholesky factors are tried for each symmetric matrix: leaving attempts out after failures saved 2 or 3 of the
 * 52 that failed in the 512 matrices of a folding sheet, and gave definite matrices to the slower row. */
static drape_status factor_general(cholmod_state *s, const double *values)
{
    drape_status status = DRAPE_OK;
    s->fallbacks++;
    if (!s->general)
        status = s->general_row->create(s->ctx, s->pattern, &s->general);
    if (!status)
        status = s->general_row->factor(s->general, values);
    s->factored = s->by_general = !status;
    return status;
}

static drape_status factor_any(cholmod_state *s, const double *values, bool definite)
{
    s->factored = s->by_general = false;
    if (!drape_all_finite(values, (size_t)s->pattern->nonzeros))
        return DRAPE_RETRY_LINEAR;
    bool positive = read_diagonal(s, values), symmetric = positive && copy_values(s, values);
    s->factored = symmetric && factor_lower(s);
    if (s->factored)
        return DRAPE_OK;
    return definite && (symmetric || !positive) ? DRAPE_RETRY_LINEAR : factor_general(s, values);
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
    if (s->by_general)
        return s->general_row->solve(s->general, b, x);
    for (size_t j = 0; j < n; j++)
        s->solution[j] = b[3 * s->order[j / 3] + (index_t)(j % 3)];
    cholmod_dense solution = as_vector(s->solution, n), scratch = as_vector(s->scratch, s->factor->maxesize);
    drape_alone_begin();
    bool done = cholmod_l_super_lsolve(s->factor, &solution, &scratch, &s->common) &&
                cholmod_l_super_ltsolve(s->factor, &solution, &scratch, &s->common);
    drape_alone_end();
    if (!done)
        return DRAPE_RETRY_LINEAR;
    for (size_t j = 0; j < n; j++)
        x[3 * s->order[j / 3] + (index_t)(j % 3)] = s->solution[j];
    return drape_all_finite(x, n) ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}

static void archive(void *state, drape_archive *a, const double *values)
{
    cholmod_state *s = state;
    drape_archive_int64(a, &s->fallbacks);
    drape_archive_bool(a, &s->by_general);
    drape_archive_bool(a, &s->factored);
    drape_linear_archive_general(s->general_row, s->ctx, s->pattern, &s->general, a,
                                 s->by_general ? values : NULL);
    if (drape_archive_is_reading(a) && values && s->factored && !s->by_general &&
        factor_any(s, values, false))
        drape_archive_fail(a, DRAPE_E_SOLVER, "a matrix of the checkpoint has no Cholesky factors here");
}

static size_t bytes(const void *state)
{
    const cholmod_state *s = state;
    const drape_pattern *p = s->pattern;
    size_t blocks = (size_t)p->block_count, n = (size_t)p->n;
    size_t indices = 2 * blocks + 1 + lower_blocks(p) + n + 1 + lower_scalars(p);
    size_t doubles = lower_scalars(p) + 2 * n + s->factor->maxesize;
    return sizeof *s + indices * sizeof(index_t) + doubles * sizeof(double) +
           2 * lower_blocks(p) * sizeof(int32_t) + s->common.memory_inuse +
           (s->general ? s->general_row->bytes(s->general) : 0);
}

static void report(const void *state, drape_linear_report *out)
{
    const cholmod_state *s = state;
    *out = (drape_linear_report){.row = &drape_linear_cholmod,
                                 .fallbacks = s->fallbacks,
                                 .fallback = s->general ? s->general_row : NULL};
}

const drape_linear_ops drape_linear_cholmod = {
    .entry = {.name = "cholmod",
              .summary =
                  "supernodal Cholesky with a symbolic factor kept for good; what is not symmetric positive "
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
