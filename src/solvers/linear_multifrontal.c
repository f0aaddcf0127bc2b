/*
 * multifrontal: Cholesky factors of a symmetric positive definite matrix, front by front (Duff & Reid 1983;
 * Liu 1992, The multifrontal method for sparse matrix solution). A front is a dense matrix that consists of
 * a few columns of the matrix and all rows that fill in below them. It is assembled from the entries of its
 * columns and from the updates of its children; then its columns are factored; the Schur complement on its
 * rows is its update, which goes to its parent in the elimination tree.
 *
 * Fronts in different branches of the tree are independent: each branch is a task for one thread, and the
 * few large fronts at the top, which join the branches, are each shared by all threads. Every sum is added
 * in an order that depends on the pattern alone, so the bits do not depend on the number of threads. All
 * memory is taken in create.
 *
 * A matrix that is not symmetric positive definite goes to the fallback (fallback.h).
 */
#include "base/finite.h"
#include "base/lanes.h"
#include "solvers/elimination.h"
#include "solvers/fallback.h"
#include "solvers/tiles.h"

#include <math.h>
#include <string.h>

/* Relative rounding error in a_ij, to which elements contribute at most about sqrt(a_ii a_jj) each. A
 * smaller difference between mirrored entries moves the solution no more than rounding the entries does. */
#define SYMMETRY  1e-13
#define MIN_RCOND 1e-15 /* smaller: singular to working precision, so the fallback decides */
#define BRANCHES  24    /* a branch has at most this part of all work */
#define S         DRAPE_STRIP
#define A_STRIP   (DRAPE_STRIP / 3) /* blocks in a strip */
/* columns multiplied together: two strips of this length fit into the first-level cache */
#define CHUNK     (10 * DRAPE_STRIP)
#define ALIGNMENT 64

extern const drape_linear_ops drape_linear_multifrontal;

/* The size of a front, and where it is stored. Its panel holds its columns, its update what it passes to
 * its parent. */
typedef struct front {
    int32_t columns, rows; /* scalars: factored columns, and rows below them */
    int32_t column_strips, row_strips;
    int64_t panel, update;        /* where they begin in `panels` and `updates` */
    int32_t first_child, sibling; /* -1: none */
    int32_t branch;               /* -1: at the top */
    bool odd;                     /* its depth in the tree is odd */
} front;

typedef struct multifrontal {
    drape_arena *arena;
    const drape_pattern *pattern;
    drape_elimination e;
    front *fronts;                 /* (e.count) */
    int32_t *branch, branch_count; /* first and last front of each branch; children come before parents */
    int32_t *top, top_count;       /* the fronts in no branch, children first */
    int32_t *mirror;               /* (lower blocks, in the pattern's order) the transposed block of each */
    int32_t *source, *target; /* (lower blocks, in the order of elimination) the block of the pattern, and
                                 its position in the panel of its front */
    int32_t *target_start;    /* (e.n + 1) where each column begins in source and target */
    int32_t *in_panel,
        *in_update; /* (rows of all fronts) position of a row in the front's parent; see find_row_positions */
    double *panels, *updates; /* aligned for the tiles */
    double *inverse;          /* (n) of the diagonal of the factors */
    double *work;             /* (n) the solution, in the order of elimination */
    double *left;             /* (rows of all fronts x 3) see part */
    double *scratch;          /* (branches + 1, scratch_size) */
    int64_t panel_size, update_size;
    int32_t widest, tallest; /* of all fronts: most columns and most rows, in scalars of whole strips */
    double *diagonal;        /* (n) in the pattern's order */
    drape_pool *pool;        /* NULL: one thread */
    bool *failed;            /* (e.count) the front is not positive definite */
    const double *values;    /* of the matrix that is being factored */
    drape_fallback fallback;
    bool factored; /* by Cholesky or by the fallback */
} multifrontal;

/* ---- Storage of the fronts ---- */

/* Tiles on and below the diagonal, stored by columns of tiles. */
static int64_t update_tiles(const front *f)
{
    return (int64_t)f->row_strips * (f->row_strips + 1) / 2;
}

static int64_t tile_at(const front *f, int32_t row_strip, int32_t column_strip)
{
    const int64_t c = column_strip;
    return (c * f->row_strips - c * (c - 1) / 2 + row_strip - c) * DRAPE_TILE;
}

static void measure_fronts(multifrontal *s)
{
    for (int32_t i = s->e.count - 1; i >= 0; i--) {
        front *f = &s->fronts[i];
        f->columns = 3 * drape_front_columns(&s->e, i);
        f->rows = 3 * drape_front_rows(&s->e, i);
        f->column_strips = (f->columns + S - 1) / S;
        f->row_strips = (f->rows + S - 1) / S;
        f->first_child = f->sibling = -1;
        const int32_t up = s->e.parent[i];
        if (up >= 0) {
            f->sibling = s->fronts[up].first_child;
            s->fronts[up].first_child = i;
        }
        s->widest = S * f->column_strips > s->widest ? S * f->column_strips : s->widest;
        s->tallest = S * f->row_strips > s->tallest ? S * f->row_strips : s->tallest;
    }
    for (int32_t i = 0; i < s->e.count; i++) {
        front *f = &s->fronts[i];
        f->panel = s->panel_size;
        s->panel_size += (int64_t)(f->column_strips + f->row_strips) * S * f->columns;
    }
}

/* Branches are the largest subtrees with at most 1 / BRANCHES of all work; the other fronts are the top. */
static void find_branches(multifrontal *s, double *work, int32_t *begin)
{
    const int32_t count = s->e.count;
    double total = 0;
    for (int32_t i = 0; i < count; i++) { /* work: of the subtree below i; begin: its first front */
        work[i] += s->e.work[i];
        total += s->e.work[i];
        begin[i] = s->fronts[i].first_child >= 0 ? begin[s->fronts[i].first_child] : i;
        if (s->e.parent[i] >= 0)
            work[s->e.parent[i]] += work[i];
    }
    for (int32_t i = 0; i < count; i++) {
        const int32_t up = s->e.parent[i];
        const bool small = work[i] <= total / BRANCHES;
        s->fronts[i].branch = -1;
        if (small && (up < 0 || work[up] > total / BRANCHES)) {
            for (int32_t k = begin[i]; k <= i; k++)
                s->fronts[k].branch = s->branch_count;
            s->branch[2 * s->branch_count] = begin[i];
            s->branch[2 * s->branch_count++ + 1] = i;
        } else if (!small)
            s->top[s->top_count++] = i;
    }
}

/* Updates of fronts of even depth lie on one stack, those of odd depth on another: while a front writes its
 * own update, those of its children are at the end of the other stack. Each branch has a pair of stacks,
 * and so has the top. */
typedef struct stacks {
    int64_t end[2], peak[2];
} stacks;

static void push_update(multifrontal *s, int32_t i, stacks *k)
{
    front *f = &s->fronts[i];
    for (int32_t c = f->first_child; c >= 0; c = s->fronts[c].sibling)
        if (s->fronts[c].branch == f->branch && s->fronts[c].update < k->end[!f->odd])
            k->end[!f->odd] = s->fronts[c].update; /* the first child's lies deepest */
    f->update = k->end[f->odd];
    k->end[f->odd] += update_tiles(f) * DRAPE_TILE;
    k->peak[f->odd] = k->end[f->odd] > k->peak[f->odd] ? k->end[f->odd] : k->peak[f->odd];
}

static void allocate_updates(multifrontal *s)
{
    for (int32_t i = s->e.count - 1; i >= 0; i--)
        s->fronts[i].odd = s->e.parent[i] >= 0 && !s->fronts[s->e.parent[i]].odd;
    for (int32_t b = 0; b <= s->branch_count; b++) {
        stacks k = {{0}};
        const bool at_top = b == s->branch_count;
        const int32_t begin = at_top ? 0 : s->branch[2 * b],
                      end = at_top ? s->top_count : s->branch[2 * b + 1] + 1;
        for (int32_t i = begin; i < end; i++)
            push_update(s, at_top ? s->top[i] : i, &k);
        for (int32_t i = begin; i < end; i++) {
            front *f = &s->fronts[at_top ? s->top[i] : i];
            f->update += s->update_size + (f->odd ? k.peak[0] : 0);
        }
        s->update_size += k.peak[0] + k.peak[1];
    }
}

static drape_status lay_out_fronts(multifrontal *s)
{
    drape_arena scratch = drape_arena_of(s->arena->ctx);
    const size_t count = (size_t)s->e.count;
    double *work = drape_arena_take(&scratch, count, sizeof *work);
    int32_t *begin = drape_arena_take(&scratch, count, sizeof *begin);
    s->fronts = drape_arena_take(s->arena, count, sizeof *s->fronts);
    s->branch = drape_arena_take(s->arena, count, 2 * sizeof *s->branch);
    s->top = drape_arena_take(s->arena, count, sizeof *s->top);
    const bool good = !drape_arena_status(&scratch) && !drape_arena_status(s->arena);
    if (good) {
        measure_fronts(s);
        find_branches(s, work, begin);
        allocate_updates(s);
    }
    drape_arena_free(&scratch);
    return good ? DRAPE_OK : DRAPE_E_MEMORY;
}

/* ---- Positions of entries ---- */

/* The position of block (row, column), both in the order of elimination, in the panel of front i. */
static int64_t position_in_panel(const multifrontal *s, int32_t i, int32_t row, int32_t column)
{
    const front *f = &s->fronts[i];
    const int32_t columns = f->columns / 3, at = drape_front_find(&s->e, i, row);
    const int32_t strip = at < columns ? at / A_STRIP : f->column_strips + (at - columns) / A_STRIP;
    const int32_t within = at < columns ? at % A_STRIP : (at - columns) % A_STRIP;
    return ((int64_t)strip * f->columns + 3 * (int64_t)(column - s->e.first[i])) * S + 3 * within;
}

/* False if a panel is too large for 32-bit positions. */
static bool find_entry_positions(multifrontal *s)
{
    const drape_pattern *p = s->pattern;
    int32_t at = 0, *mirror = s->mirror;
    for (int32_t j = 0; j < p->block_count; j++)
        for (int32_t k = p->diagonal[j]; k < p->block_start[j + 1]; k++)
            *mirror++ = drape_pattern_find(p, j, p->block_row[k]);
    for (int32_t i = 0; i < s->e.count; i++)
        for (int32_t column = s->e.first[i]; column < s->e.first[i + 1]; column++) {
            const int32_t j = s->e.order[column];
            s->target_start[column] = at;
            for (int32_t k = p->block_start[j]; k < p->block_start[j + 1]; k++) {
                const int32_t row = s->e.place[p->block_row[k]];
                if (row < column)
                    continue;
                const int64_t target = position_in_panel(s, i, row, column);
                if (target > INT32_MAX)
                    return false;
                s->source[at] = k;
                s->target[at++] = (int32_t)target;
            }
        }
    s->target_start[s->e.n] = at;
    return true;
}

/* The position of each row of a front in its parent, counted from the beginning of a column: in the
 * parent's panel, and in its update, there from the tile of the first strip. in_update -1: the parent
 * factors the row. False if a panel is too large for 32-bit positions. */
static bool find_row_positions(multifrontal *s)
{
    for (int32_t i = 0; i < s->e.count; i++) {
        const front *up = s->e.parent[i] >= 0 ? &s->fronts[s->e.parent[i]] : NULL;
        for (int64_t k = s->e.row_start[i]; k < s->e.row_start[i + 1]; k++) {
            const int32_t columns = up->columns / 3, at = s->e.in_parent[k], below = at - columns;
            const int64_t strip = below < 0 ? at / A_STRIP : up->column_strips + below / A_STRIP;
            const int64_t place = strip * up->columns * S + 3 * ((below < 0 ? at : below) % A_STRIP);
            if (place > INT32_MAX)
                return false;
            s->in_panel[k] = (int32_t)place;
            s->in_update[k] = below < 0 ? -1 : below / A_STRIP * DRAPE_TILE + 3 * (below % A_STRIP);
        }
    }
    return true;
}

/* ---- Creation ---- */

static double *take_aligned(drape_arena *arena, int64_t count)
{
    const uintptr_t at =
        (uintptr_t)drape_arena_take(arena, (size_t)count + ALIGNMENT / sizeof(double), sizeof(double));
    return (double *)((at + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT);
}

/* The number of doubles of scratch for one branch, or for the top. */
static int64_t scratch_size(const multifrontal *s)
{
    return 5 * (int64_t)s->widest + s->tallest;
}

static drape_status create(drape_arena *arena, const drape_pattern *pattern, void **state)
{
    multifrontal *s = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    s->arena = arena;
    s->pattern = pattern;
    s->fallback = drape_fallback_of(arena, pattern);
    drape_status status = drape_elimination_create(arena, pattern, &s->e);
    if (!status)
        status = lay_out_fronts(s);
    if (status)
        return status;
    const size_t n = (size_t)pattern->n, lower = ((size_t)pattern->nonzeros / 9 + n / 3) / 2,
                 rows = (size_t)s->e.row_start[s->e.count];
    s->source = drape_arena_take(arena, lower, sizeof *s->source);
    s->mirror = drape_arena_take(arena, lower, sizeof *s->mirror);
    s->target = drape_arena_take(arena, lower, sizeof *s->target);
    s->target_start = drape_arena_take(arena, n / 3 + 1, sizeof *s->target_start);
    s->diagonal = drape_arena_take(arena, n, sizeof *s->diagonal);
    s->inverse = drape_arena_take(arena, n, sizeof *s->inverse);
    s->work = drape_arena_take(arena, n, sizeof *s->work);
    s->failed = drape_arena_take(arena, (size_t)s->e.count, sizeof *s->failed);
    s->scratch =
        drape_arena_take(arena, (size_t)(s->branch_count + 1), (size_t)scratch_size(s) * sizeof *s->scratch);
    s->left = drape_arena_take(arena, rows, 3 * sizeof *s->left);
    s->in_panel = drape_arena_take(arena, rows, sizeof *s->in_panel);
    s->in_update = drape_arena_take(arena, rows, sizeof *s->in_update);
    s->panels = take_aligned(arena, s->panel_size);
    s->updates = take_aligned(arena, s->update_size);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    if (!find_entry_positions(s) || !find_row_positions(s))
        return drape_fail(arena->ctx, DRAPE_E_SOLVER, "the factors have a front of more than 2^31 entries");
    *state = s;
    return DRAPE_OK;
}

static void destroy(void **state)
{
    multifrontal *s = *state;
    drape_fallback_destroy(&s->fallback);
}

static void use_threads(void *state, drape_pool *pool)
{
    ((multifrontal *)state)->pool = pool;
}

/* ---- Values ---- */

/* Properties checked before a matrix is factored. */
typedef struct properties {
    bool finite, positive, symmetric; /* positive: its diagonal is positive */
} properties;

static bool copy_diagonal(multifrontal *s)
{
    const drape_pattern *p = s->pattern;
    bool positive = true;
    for (int32_t j = 0; j < p->block_count; j++) {
        int64_t stride;
        const double *at = drape_pattern_at(p, (double *)(uintptr_t)s->values, j, p->diagonal[j], &stride);
        for (int c = 0; c < 3; c++) {
            s->diagonal[3 * j + c] = at[c * stride + c];
            positive &= s->diagonal[3 * j + c] > 0;
        }
    }
    return positive;
}

/* Whether block k of column j is the transpose of the block `mirrored`, up to rounding errors. */
static bool is_mirrored(const multifrontal *s, int32_t j, int32_t k, int32_t mirrored)
{
    const drape_pattern *p = s->pattern;
    const int32_t i = p->block_row[k];
    int64_t stride, mirror_stride;
    double *values = (double *)(uintptr_t)s->values;
    const double *block = drape_pattern_at(p, values, j, k, &stride),
                 *mirror = drape_pattern_at(p, values, i, mirrored, &mirror_stride);
    bool same = true, symmetric = true;
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++)
            same &= block[c * stride + r] == mirror[r * mirror_stride + c];
    for (int e = 0; !same && e < 9; e++) {
        const int c = e / 3, r = e % 3;
        const double difference = block[c * stride + r] - mirror[r * mirror_stride + c];
        symmetric &=
            difference * difference <= SYMMETRY * SYMMETRY * s->diagonal[3 * i + r] * s->diagonal[3 * j + c];
    }
    return symmetric;
}

/* Visits the matrix column by column, as it is stored: in a well-numbered mesh a mirrored block is never
 * far from its block. */
static properties inspect(multifrontal *s)
{
    const drape_pattern *p = s->pattern;
    const int32_t *mirror = s->mirror;
    properties of = {.finite = drape_all_finite(s->values, (size_t)p->nonzeros), .symmetric = true};
    of.positive = of.finite && copy_diagonal(s);
    for (int32_t j = 0; of.positive && j < p->block_count; j++)
        for (int32_t k = p->diagonal[j]; k < p->block_start[j + 1]; k++)
            of.symmetric &= is_mirrored(s, j, k, *mirror++);
    return of;
}

/* ---- One front ---- */

static void copy_entries(const multifrontal *s, int32_t at, int32_t column, double *panel)
{
    int64_t stride;
    const double *from = drape_pattern_at(s->pattern, (double *)(uintptr_t)s->values, s->e.order[column],
                                          s->source[at], &stride);
    double *to = panel + s->target[at];
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++)
            to[S * c + r] = from[c * stride + r];
}

typedef double couple __attribute__((vector_size(2 * sizeof(double))));

/* Adds a block of a child's update to a block of its parent; both lie in strips. */
static inline void add_block(const double *from, double *to)
{
    for (int c = 0; c < 3; c++, from += S, to += S) {
        couple a, b;
        memcpy(&a, from, sizeof a);
        memcpy(&b, to, sizeof b);
        b += a;
        memcpy(to, &b, sizeof b);
        to[2] += from[2];
    }
}

/* A front being factored, as seen by the tasks that share the work. */
typedef struct job {
    multifrontal *s;
    int32_t index;
    const front *f;
    double *panel, *update;
    drape_pool *pool; /* NULL: one thread, in a branch */
} job;

/* The update of a child from its block column `first` on: argument of add_child_column. */
typedef struct child_job {
    const job *to;
    int32_t child, first;
} child_job;

/* The columns being factored: argument of finish_strip. */
typedef struct strip_job {
    const job *of;
    int32_t first, width;
} strip_job;

/* Adds a block column of a child's update to its parent. */
static void add_child_column(void *user, int64_t task)
{
    const child_job *from_child = user;
    const job *w = from_child->to;
    const multifrontal *s = w->s;
    const front *f = w->f, *c = &s->fronts[from_child->child];
    const int64_t start = s->e.row_start[from_child->child];
    const int32_t k = from_child->first + (int32_t)task, blocks = c->rows / 3;
    const int32_t column = s->e.in_parent[start + k], below = column - f->columns / 3;
    const int32_t *place = (below < 0 ? s->in_panel : s->in_update) + start;
    const double *from = s->updates + c->update + tile_at(c, 0, k / A_STRIP) + 3 * (k % A_STRIP) * S;
    double *to = below < 0 ? w->panel + 3 * (int64_t)column * S
                           : w->update + tile_at(f, 0, below / A_STRIP) + 3 * (below % A_STRIP) * S;
    for (int32_t r = k; r < blocks; r++)
        add_block(from + r / A_STRIP * DRAPE_TILE + 3 * (r % A_STRIP), to + place[r]);
}

/* The first block row of a child's update that its parent does not factor. */
static int32_t first_row_not_factored(const multifrontal *s, int32_t child)
{
    const int32_t *place = s->in_update + s->e.row_start[child];
    int32_t low = 0, high = s->fronts[child].rows / 3;
    while (low < high) {
        const int32_t middle = low + (high - low) / 2;
        if (place[middle] < 0)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* Adds those columns of the children's updates that are factored in this front, or the others. */
static void add_children(const job *w, bool factored)
{
    const multifrontal *s = w->s;
    for (int32_t child = w->f->first_child; child >= 0; child = s->fronts[child].sibling) {
        const int32_t middle = first_row_not_factored(s, child), all = s->fronts[child].rows / 3;
        child_job columns = {.to = w, .child = child, .first = factored ? 0 : middle};
        drape_parallel(w->pool, factored ? middle : all - middle, add_child_column, &columns);
    }
}

static void assemble(const job *w)
{
    const multifrontal *s = w->s;
    const front *f = w->f;
    memset(w->panel, 0,
           (size_t)(f->column_strips + f->row_strips) * S * (size_t)f->columns * sizeof *w->panel);
    for (int32_t column = s->e.first[w->index]; column < s->e.first[w->index + 1]; column++)
        for (int32_t at = s->target_start[column]; at < s->target_start[column + 1]; at++)
            copy_entries(s, at, column, w->panel);
    add_children(w, true);
}

static double *strip_of(const job *w, int64_t strip)
{
    return w->panel + strip * S * w->f->columns;
}

/* Finishes the columns being factored in one strip below their diagonal tile: subtracts the products with
 * the earlier columns, then divides by the diagonal tile. */
static void finish_strip(void *user, int64_t task)
{
    const strip_job *strips = user;
    const job *w = strips->of;
    const int32_t diagonal = strips->first / S;
    const int64_t strip = diagonal + 1 + task;
    double *to = strip_of(w, strip) + S * strips->first;
    drape_tile_multiply(strip_of(w, strip), strip_of(w, diagonal), strips->first, strips->width, false, to);
    drape_tile_divide(strips->width, strip_of(w, diagonal) + S * strips->first,
                      w->s->inverse + 3 * w->s->e.first[w->index] + strips->first, to);
}

static bool factor_columns(const job *w)
{
    const front *f = w->f;
    for (int32_t first = 0; first < f->columns; first += S) {
        const int32_t diagonal = first / S, width = f->columns - first < S ? f->columns - first : S;
        double *tile = strip_of(w, diagonal) + S * first;
        drape_tile_multiply(strip_of(w, diagonal), strip_of(w, diagonal), first, width, false, tile);
        if (!drape_tile_factor(width, tile, w->s->inverse + 3 * w->s->e.first[w->index] + first))
            return false;
        strip_job strips = {.of = w, .first = first, .width = width};
        drape_parallel(w->pool, f->column_strips + f->row_strips - diagonal - 1, finish_strip, &strips);
    }
    return true;
}

/* Computes one column of tiles of the update, over chunks of the factored columns. */
static void compute_update_column(void *user, int64_t task)
{
    const job *w = user;
    const front *f = w->f;
    const int32_t c = (int32_t)task;
    for (int32_t p = 0; p < f->columns; p += CHUNK) {
        const int depth = f->columns - p < CHUNK ? f->columns - p : CHUNK;
        for (int32_t r = c; r < f->row_strips; r++)
            drape_tile_multiply(strip_of(w, f->column_strips + r) + S * p,
                                strip_of(w, f->column_strips + c) + S * p, depth, S, p == 0,
                                w->update + tile_at(f, r, c));
    }
}

static void factor_front(multifrontal *s, int32_t i, drape_pool *pool)
{
    const front *f = &s->fronts[i];
    job w = {.s = s,
             .index = i,
             .f = f,
             .panel = s->panels + f->panel,
             .update = s->updates + f->update,
             .pool = pool};
    assemble(&w);
    s->failed[i] = !factor_columns(&w);
    if (s->failed[i])
        return;
    drape_parallel(pool, f->row_strips, compute_update_column, &w);
    add_children(&w, false);
}

/* ---- All fronts ---- */

static void factor_branch(void *user, int64_t task)
{
    multifrontal *s = user;
    for (int32_t i = s->branch[2 * task]; i <= s->branch[2 * task + 1]; i++) {
        factor_front(s, i, NULL);
        if (s->failed[i])
            return;
    }
}

/* The ratio of the extreme pivots is a lower bound of the condition number. */
static bool is_well_conditioned(const multifrontal *s)
{
    double low = INFINITY, high = 0;
    for (int64_t k = 0; k < s->pattern->n; k++) {
        low = fmin(low, s->inverse[k]);
        high = fmax(high, s->inverse[k]);
    }
    return s->pattern->n == 0 || (low / high) * (low / high) > MIN_RCOND;
}

static bool factor_cholesky(multifrontal *s)
{
    memset(s->failed, 0, (size_t)s->e.count * sizeof *s->failed);
    drape_parallel(s->pool, s->branch_count, factor_branch, s);
    for (int32_t i = 0; i < s->e.count; i++)
        if (s->failed[i])
            return false;
    for (int32_t k = 0; k < s->top_count; k++) {
        factor_front(s, s->top[k], s->pool);
        if (s->failed[s->top[k]])
            return false;
    }
    return is_well_conditioned(s);
}

static drape_status factor_any(multifrontal *s, const double *values, bool definite)
{
    s->fallback.active = s->factored = false;
    s->values = values;
    const properties of = inspect(s);
    if (!of.finite)
        return DRAPE_RETRY_LINEAR;
    s->factored = of.positive && of.symmetric && factor_cholesky(s);
    if (s->factored)
        return DRAPE_OK;
    if (definite && of.symmetric)
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

/* ---- Solution ---- */

/* A front and the parts of the solution that it works on. */
typedef struct part {
    const front *f;
    const double *panel, *inverse;
    const int32_t *row;   /* (f->rows / 3) */
    double *left;         /* (f->rows) what it passes to its parent */
    double *x, *y, *sums; /* of its columns; of its rows; four partial sums for each column */
} part;

/* The scratch belongs to the front's branch, or to the top. */
static part part_of(multifrontal *s, int32_t i)
{
    const front *f = &s->fronts[i];
    const int32_t place = f->branch < 0 ? s->branch_count : f->branch;
    double *x = s->scratch + (int64_t)place * scratch_size(s), *y = x + s->widest, *sums = y + s->tallest;
    memset(x, 0, (size_t)S * (size_t)f->column_strips * sizeof *x);
    memcpy(x, s->work + 3 * s->e.first[i], (size_t)f->columns * sizeof *x);
    memset(y, 0, (size_t)S * (size_t)f->row_strips * sizeof *y);
    return (part){.f = f,
                  .panel = s->panels + f->panel,
                  .inverse = s->inverse + 3 * s->e.first[i],
                  .row = s->e.row + s->e.row_start[i],
                  .left = s->left + 3 * s->e.row_start[i],
                  .x = x,
                  .y = y,
                  .sums = sums};
}

/* A strip from column p on. */
static const double *strip_from(const part *w, int64_t strip, int32_t p)
{
    return w->panel + (strip * w->f->columns + p) * S;
}

/* Adds what the children passed on to the front's columns and rows. */
static void add_from_children(const multifrontal *s, const part *w)
{
    const int32_t columns = w->f->columns / 3;
    for (int32_t child = w->f->first_child; child >= 0; child = s->fronts[child].sibling)
        for (int64_t k = s->e.row_start[child]; k < s->e.row_start[child + 1]; k++) {
            const int32_t at = s->e.in_parent[k];
            double *to = at < columns ? w->x + 3 * at : w->y + 3 * (at - columns);
            for (int c = 0; c < 3; c++)
                to[c] += s->left[3 * k + c];
        }
}

static void solve_forward(multifrontal *s, int32_t i)
{
    const part w = part_of(s, i);
    const front *f = w.f;
    add_from_children(s, &w);
    for (int32_t d = 0; d < f->column_strips; d++) {
        const int32_t first = S * d, width = f->columns - first < S ? f->columns - first : S;
        const double *tile = strip_from(&w, d, first);
        double *x = w.x + first;
        for (int p = 0; p < width; p++) {
            x[p] *= w.inverse[first + p];
            for (int q = p + 1; q < width; q++)
                x[q] -= tile[S * p + q] * x[p];
        }
        for (int32_t t = d + 1; t < f->column_strips; t++)
            drape_strip_times(width, strip_from(&w, t, first), x, w.x + S * t);
    }
    memcpy(s->work + 3 * s->e.first[i], w.x, (size_t)f->columns * sizeof *w.x);
    for (int32_t t = 0; t < f->row_strips; t++)
        drape_strip_times(f->columns, strip_from(&w, f->column_strips + t, 0), w.x, w.y + S * t);
    memcpy(w.left, w.y, (size_t)f->rows * sizeof *w.y);
}

static void solve_backward(multifrontal *s, int32_t i)
{
    const part w = part_of(s, i);
    const front *f = w.f;
    for (int32_t k = 0; k < f->rows; k++)
        w.y[k] = s->work[3 * w.row[k / 3] + k % 3];
    memset(w.sums, 0, (size_t)LANES * (size_t)f->columns * sizeof *w.sums);
    for (int32_t t = 0; t < f->row_strips; t++)
        drape_strip_transposed_times(f->columns, strip_from(&w, f->column_strips + t, 0), w.y + S * t,
                                     w.sums);
    for (int32_t d = f->column_strips - 1; d >= 0; d--) {
        const int32_t first = S * d, width = f->columns - first < S ? f->columns - first : S;
        const double *tile = strip_from(&w, d, first), *sums = w.sums + LANES * first;
        double *x = w.x + first;
        for (int32_t t = d + 1; t < f->column_strips; t++)
            drape_strip_transposed_times(width, strip_from(&w, t, first), w.x + S * t,
                                         w.sums + LANES * first);
        for (int p = width - 1; p >= 0; p--) {
            x[p] -= (sums[LANES * p] + sums[LANES * p + 1]) + (sums[LANES * p + 2] + sums[LANES * p + 3]);
            for (int q = p + 1; q < width; q++)
                x[p] -= tile[S * p + q] * x[q];
            x[p] *= w.inverse[first + p];
        }
    }
    memcpy(s->work + 3 * s->e.first[i], w.x, (size_t)f->columns * sizeof *w.x);
}

static void forward_branch(void *user, int64_t task)
{
    multifrontal *s = user;
    for (int32_t i = s->branch[2 * task]; i <= s->branch[2 * task + 1]; i++)
        solve_forward(s, i);
}

static void backward_branch(void *user, int64_t task)
{
    multifrontal *s = user;
    for (int32_t i = s->branch[2 * task + 1]; i >= s->branch[2 * task]; i--)
        solve_backward(s, i);
}

static drape_status solve(void *state, const double *b, double *x)
{
    multifrontal *s = state;
    const size_t n = (size_t)s->pattern->n;
    if (!s->factored)
        return DRAPE_RETRY_LINEAR;
    if (s->fallback.active)
        return s->fallback.ops->solve(s->fallback.solver, b, x);
    for (int32_t k = 0; k < s->e.n; k++)
        memcpy(s->work + 3 * (size_t)k, b + 3 * (size_t)s->e.order[k], 3 * sizeof *b);
    drape_parallel(s->pool, s->branch_count, forward_branch, s);
    for (int32_t k = 0; k < s->top_count; k++)
        solve_forward(s, s->top[k]);
    for (int32_t k = s->top_count - 1; k >= 0; k--)
        solve_backward(s, s->top[k]);
    drape_parallel(s->pool, s->branch_count, backward_branch, s);
    for (int32_t k = 0; k < s->e.n; k++)
        memcpy(x + 3 * (size_t)s->e.order[k], s->work + 3 * (size_t)k, 3 * sizeof *x);
    return drape_all_finite(x, n) ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}

/* ---- Checkpoints and reports ---- */

static void archive(void *state, drape_archive *a, const double *values)
{
    multifrontal *s = state;
    drape_fallback_archive(&s->fallback, &s->factored, a, values);
    if (drape_archive_has_read(a) && values && s->factored && !s->fallback.active &&
        factor_any(s, values, false))
        drape_archive_fail(a, DRAPE_E_SOLVER, "a matrix of the checkpoint has no Cholesky factors here");
}

static size_t bytes(const void *state)
{
    return drape_fallback_bytes(&((const multifrontal *)state)->fallback);
}

static void report(const void *state, drape_linear_report *out)
{
    *out = drape_fallback_report(&((const multifrontal *)state)->fallback, &drape_linear_multifrontal);
}

const drape_linear_ops drape_linear_multifrontal = {
    .entry = {.name = "multifrontal",
              .summary = "Drape's own multifrontal Cholesky, with the same bits for any number of threads; a "
                         "matrix that is not symmetric positive definite goes to umfpack or klu, by size",
              .reference = "Duff & Reid 1983; Liu 1992, The multifrontal method for sparse matrix solution"},
    .best_from = 100,     /* a third of klu's time at 400 unknowns */
    .borrows_heap = true, /* by the fallback, at the first matrix that needs it */
    .create = create,
    .use_threads = use_threads,
    .factor = factor,
    .factor_definite = factor_definite,
    .solve = solve,
    .archive = archive,
    .destroy = destroy,
    .bytes = bytes,
    .report = report,
};
