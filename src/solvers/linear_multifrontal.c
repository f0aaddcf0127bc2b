/*
 * multifrontal: Cholesky factors of a symmetric positive definite matrix, front by front (Duff & Reid 1983; Liu
 * 1992, The multifrontal method for sparse matrix solution). A front is a dense matrix: the entries of its columns
 * and what its children left on them are added up, its columns are factored, and what that leaves on its rows goes
 * to its parent. Fronts in different branches do not know of each other: branches go to threads, and the few large
 * fronts that join them are shared by all. Every sum runs in an order that the pattern alone decides: the bits do not
 * depend on the number of threads. All memory is taken in create.
 *
 * What is not symmetric positive definite goes to the row that is the fastest for general matrices of this size, as it
 * stands; that row's solver is made for the first such matrix.
 */
#include "solvers/linear.h"

#include "base/finite.h"
#include "base/lanes.h"
#include "solvers/elimination.h"
#include "solvers/tiles.h"

#include <math.h>
#include <string.h>

/* Round-off in a_ij, whose elements' parts are at most about sqrt(a_ii a_jj) each. Below it, a difference
 * between mirrored entries moves the solution as rounding the entries does. */
#define SYMMETRY  1e-13
#define MIN_RCOND 1e-15 /* below: singular to working precision; the general row decides */
#define BRANCHES  24    /* no branch for one thread is more than this part of all work */
#define S         DRAPE_STRIP
#define A_STRIP   (DRAPE_STRIP / 3) /* blocks */
#define CHUNK     (10 * DRAPE_STRIP) /* columns multiplied at once: two strips of it fit into the nearest cache */
#define ALIGNMENT 64

extern const drape_linear_ops drape_linear_multifrontal;

/* One front's place. */
typedef struct front {
    int32_t columns, rows; /* scalars: factored, and below them */
    int32_t column_strips, row_strips;
    int64_t panel, update;        /* where its columns, and what it leaves, begin */
    int32_t first_child, sibling; /* -1: none */
    int32_t branch;               /* -1: at the top */
    bool odd;                     /* its depth is */
} front;

typedef struct multifrontal {
    drape_context *ctx;
    const drape_pattern *pattern;
    drape_elimination e;
    front *fronts;                 /* (e.count) */
    int32_t *branch, branch_count; /* first and last front of each, for one thread; the most work first */
    int32_t *top, top_count;       /* the other fronts, children first */
    int32_t *mirror;               /* (lower blocks, as the pattern has them) the transposed one of each */
    int32_t *source, *target; /* (lower blocks, in the order of elimination) the pattern's block that each is,
                                       and where it goes, from the begin of its front's panel */
    int32_t *target_start;    /* (e.n + 1) of each column */
    int32_t *in_panel,
        *in_update; /* (rows of all fronts) where a row lies in its front's parent; see place_rows */
    double *panels, *updates, *inverse, *work, *scratch, *left; /* left: (rows of all fronts, 3) see part */
    void *memory[2];                                            /* of panels and updates, before alignment */
    int64_t panel_size, update_size;
    int32_t widest, tallest; /* scalars, of all fronts, in whole strips */
    double *diagonal;        /* (n) in the pattern's order */
    drape_crew *crew;        /* NULL: one thread */
    const double *values;    /* while it factors */
    bool *failed;            /* (e.count) */
    const drape_linear_ops *general_row;
    void *general; /* its state; NULL before the first matrix that it gets */
    bool by_general, factored;
    int64_t fallbacks;
} multifrontal;

static void destroy(void **state)
{
    multifrontal *s = *state;
    if (!s)
        return;
    if (s->general)
        s->general_row->destroy(&s->general);
    drape_elimination_free(s->ctx, &s->e);
    void *all[] = {s->fronts,       s->branch,    s->top,       s->source,   s->mirror, s->target,
                   s->target_start, s->in_panel,  s->in_update, s->inverse,  s->work,   s->scratch,
                   s->left,         s->memory[0], s->memory[1], s->diagonal, s->failed};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        drape_free(s->ctx, all[i]);
    drape_free(s->ctx, s);
    *state = NULL;
}

/* ---- Where fronts lie ---- */

/* Tiles on and below the diagonal, columns of tiles one after another. */
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

/* Branches: the largest subtrees whose work is no more than a share of all. The rest is the top. */
static drape_status find_branches(multifrontal *s)
{
    const int32_t count = s->e.count;
    double total = 0, *work = drape_alloc(s->ctx, (size_t)count, sizeof *work); /* of subtrees */
    int32_t *begin = drape_alloc(s->ctx, (size_t)count, sizeof *begin);         /* their first fronts */
    s->branch = drape_alloc(s->ctx, (size_t)count, 2 * sizeof *s->branch);
    s->top = drape_alloc(s->ctx, (size_t)count, sizeof *s->top);
    const bool good = work && begin && s->branch && s->top;
    for (int32_t i = 0; good && i < count; i++) {
        work[i] += s->e.work[i];
        total += s->e.work[i];
        begin[i] = s->fronts[i].first_child >= 0 ? begin[s->fronts[i].first_child] : i;
        if (s->e.parent[i] >= 0)
            work[s->e.parent[i]] += work[i];
    }
    for (int32_t i = 0; good && i < count; i++) {
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
    drape_free(s->ctx, work);
    drape_free(s->ctx, begin);
    return good ? DRAPE_OK : DRAPE_E_MEMORY;
}

/* What fronts of even depth leave lies on one stack, of odd depth on another: when a front is made, its children's
 * is on top of the other one. Each branch has two stacks, and the top has. */
typedef struct stacks {
    int64_t end[2], peak[2];
} stacks;

static void push_update(multifrontal *s, int32_t i, stacks *k)
{
    front *f = &s->fronts[i];
    for (int32_t c = f->first_child; c >= 0; c = s->fronts[c].sibling)
        if (s->fronts[c].branch == f->branch && s->fronts[c].update < k->end[!f->odd])
            k->end[!f->odd] = s->fronts[c].update; /* the first of them lies deepest */
    f->update = k->end[f->odd];
    k->end[f->odd] += update_tiles(f) * DRAPE_TILE;
    k->peak[f->odd] = k->end[f->odd] > k->peak[f->odd] ? k->end[f->odd] : k->peak[f->odd];
}

static void place_updates(multifrontal *s)
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

/* ---- Where entries go ---- */

/* The place of block (row, column), counted in the order of elimination, from the begin of its front's panel. */
static int64_t place_in_panel(const multifrontal *s, int32_t i, int32_t row, int32_t column)
{
    const front *f = &s->fronts[i];
    const int32_t columns = f->columns / 3, at = drape_front_find(&s->e, i, row);
    const int32_t strip = at < columns ? at / A_STRIP : f->column_strips + (at - columns) / A_STRIP;
    const int32_t within = at < columns ? at % A_STRIP : (at - columns) % A_STRIP;
    return ((int64_t)strip * f->columns + 3 * (int64_t)(column - s->e.first[i])) * S + 3 * within;
}

static void find_mirrors(multifrontal *s)
{
    const drape_pattern *p = s->pattern;
    int32_t *mirror = s->mirror;
    for (int32_t j = 0; j < p->block_count; j++)
        for (int32_t k = p->diagonal[j]; k < p->block_start[j + 1]; k++)
            *mirror++ = drape_pattern_find(p, j, p->block_row[k]);
}

static bool place_entries(multifrontal *s)
{
    const drape_pattern *p = s->pattern;
    int32_t at = 0;
    find_mirrors(s);
    for (int32_t i = 0; i < s->e.count; i++)
        for (int32_t column = s->e.first[i]; column < s->e.first[i + 1]; column++) {
            const int32_t j = s->e.order[column];
            s->target_start[column] = at;
            for (int32_t k = p->block_start[j]; k < p->block_start[j + 1]; k++) {
                const int32_t row = s->e.place[p->block_row[k]];
                if (row < column)
                    continue;
                const int64_t target = place_in_panel(s, i, row, column);
                if (target > INT32_MAX)
                    return false;
                s->source[at] = k;
                s->target[at++] = (int32_t)target;
            }
        }
    s->target_start[s->e.n] = at;
    return true;
}

/* Rows of strips, from the begin of a column: of panels, and of what fronts leave, the latter from where the tile
 * of the first strip would be. -1: the row is factored in the parent. */
static bool place_rows(multifrontal *s)
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

/* ---- Making ---- */

static double *take_aligned(multifrontal *s, int which, int64_t count)
{
    s->memory[which] = drape_alloc(s->ctx, (size_t)count + ALIGNMENT / sizeof(double), sizeof(double));
    const uintptr_t at = (uintptr_t)s->memory[which];
    return at ? (double *)((at + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT) : NULL;
}

/* Doubles of scratch of one branch, or the top. */
static int64_t scratch_size(const multifrontal *s)
{
    return 5 * (int64_t)s->widest + s->tallest;
}

static bool allocate(multifrontal *s)
{
    const drape_pattern *p = s->pattern;
    const size_t n = (size_t)p->n, lower = ((size_t)p->nonzeros / 9 + n / 3) / 2;
    s->source = drape_alloc(s->ctx, lower, sizeof *s->source);
    s->mirror = drape_alloc(s->ctx, lower, sizeof *s->mirror);
    s->target = drape_alloc(s->ctx, lower, sizeof *s->target);
    s->target_start = drape_alloc(s->ctx, n / 3 + 1, sizeof *s->target_start);
    s->diagonal = drape_alloc(s->ctx, n, sizeof *s->diagonal);
    s->inverse = drape_alloc(s->ctx, n, sizeof *s->inverse);
    s->work = drape_alloc(s->ctx, n, sizeof *s->work);
    s->failed = drape_alloc(s->ctx, (size_t)s->e.count, sizeof *s->failed);
    s->scratch =
        drape_alloc(s->ctx, (size_t)(s->branch_count + 1), (size_t)scratch_size(s) * sizeof *s->scratch);
    s->left = drape_alloc(s->ctx, (size_t)s->e.row_start[s->e.count], 3 * sizeof *s->left);
    s->in_panel = drape_alloc(s->ctx, (size_t)s->e.row_start[s->e.count], sizeof *s->in_panel);
    s->in_update = drape_alloc(s->ctx, (size_t)s->e.row_start[s->e.count], sizeof *s->in_update);
    s->panels = take_aligned(s, 0, s->panel_size);
    s->updates = take_aligned(s, 1, s->update_size);
    return s->source && s->mirror && s->target && s->target_start && s->diagonal && s->inverse && s->work &&
           s->failed && s->scratch && s->left && s->in_panel && s->in_update && s->panels && s->updates;
}

static drape_status analyse(multifrontal *s)
{
    drape_status status = drape_elimination_create(s->ctx, s->pattern, &s->e);
    if (status)
        return status;
    s->fronts = drape_alloc(s->ctx, (size_t)s->e.count, sizeof *s->fronts);
    if (!s->fronts)
        return DRAPE_E_MEMORY;
    measure_fronts(s);
    status = find_branches(s);
    if (status)
        return status;
    place_updates(s);
    if (!allocate(s))
        return DRAPE_E_MEMORY;
    return place_entries(s) && place_rows(s)
               ? DRAPE_OK
               : drape_fail(s->ctx, DRAPE_E_SOLVER, "the factors have a front of more than 2^31 entries");
}

static drape_status create(drape_context *ctx, const drape_pattern *pattern, void **state)
{
    multifrontal *s = drape_alloc(ctx, 1, sizeof *s);
    *state = s;
    if (!s)
        return DRAPE_E_MEMORY;
    *s = (multifrontal){.ctx = ctx, .pattern = pattern};
    s->general_row = drape_linear_general(pattern->n);
    drape_status status = analyse(s);
    if (status)
        destroy(state);
    return status;
}

static void use_threads(void *state, drape_crew *crew)
{
    ((multifrontal *)state)->crew = crew;
}

/* ---- One front ---- */

static void copy_block(const multifrontal *s, int32_t at, int32_t column, double *panel)
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

/* Adds a block of what a child left; both lie in strips. */
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

/* What a front is made of, for rounds dealt out to threads. */
typedef struct job {
    multifrontal *s;
    int32_t index;
    const front *f;
    double *panel, *update;
    int32_t first, width; /* of the columns that are factored now; the first that is added of a child */
    int32_t child;
    drape_crew *crew; /* NULL: this thread alone, in a branch */
} job;

/* A column of blocks of what a child left, into its front. */
static void add_child_column(void *user, int64_t round)
{
    const job *w = user;
    const multifrontal *s = w->s;
    const front *f = w->f, *c = &s->fronts[w->child];
    const int64_t start = s->e.row_start[w->child];
    const int32_t k = w->first + (int32_t)round, blocks = c->rows / 3;
    const int32_t column = s->e.in_parent[start + k], below = column - f->columns / 3;
    const int32_t *place = (below < 0 ? s->in_panel : s->in_update) + start;
    const double *from = s->updates + c->update + tile_at(c, 0, k / A_STRIP) + 3 * (k % A_STRIP) * S;
    double *to = below < 0 ? w->panel + 3 * (int64_t)column * S
                           : w->update + tile_at(f, 0, below / A_STRIP) + 3 * (below % A_STRIP) * S;
    for (int32_t r = k; r < blocks; r++)
        add_block(from + r / A_STRIP * DRAPE_TILE + 3 * (r % A_STRIP), to + place[r]);
}

/* The first of a child's rows that is not factored in its parent. */
static int32_t first_row_left(const multifrontal *s, int32_t child)
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

/* What children left on the columns that are factored here, or on the rows. */
static void add_children(job *w, bool on_rows)
{
    for (w->child = w->f->first_child; w->child >= 0; w->child = w->s->fronts[w->child].sibling) {
        const int32_t middle = first_row_left(w->s, w->child), all = w->s->fronts[w->child].rows / 3;
        w->first = on_rows ? middle : 0;
        drape_parallel(w->crew, on_rows ? all - middle : middle, add_child_column, w);
    }
}

static void assemble(job *w)
{
    const multifrontal *s = w->s;
    const front *f = w->f;
    memset(w->panel, 0,
           (size_t)(f->column_strips + f->row_strips) * S * (size_t)f->columns * sizeof *w->panel);
    for (int32_t column = s->e.first[w->index]; column < s->e.first[w->index + 1]; column++)
        for (int32_t at = s->target_start[column]; at < s->target_start[column + 1]; at++)
            copy_block(s, at, column, w->panel);
    add_children(w, false);
}

static double *strip_of(const job *w, int64_t strip)
{
    return w->panel + strip * S * w->f->columns;
}

/* The columns that are factored now, of one strip below their diagonal: products with those before them, then
 * division. */
static void finish_strip(void *user, int64_t round)
{
    const job *w = user;
    const int32_t diagonal = w->first / S;
    const int64_t strip = diagonal + 1 + round;
    double *to = strip_of(w, strip) + S * w->first;
    drape_tile_multiply(strip_of(w, strip), strip_of(w, diagonal), w->first, w->width, false, to);
    drape_tile_divide(w->width, strip_of(w, diagonal) + S * w->first,
                      w->s->inverse + 3 * w->s->e.first[w->index] + w->first, to);
}

static bool factor_columns(job *w)
{
    const front *f = w->f;
    for (w->first = 0; w->first < f->columns; w->first += S) {
        const int32_t diagonal = w->first / S;
        double *tile = strip_of(w, diagonal) + S * w->first;
        w->width = f->columns - w->first < S ? f->columns - w->first : S;
        drape_tile_multiply(strip_of(w, diagonal), strip_of(w, diagonal), w->first, w->width, false, tile);
        if (!drape_tile_factor(w->width, tile, w->s->inverse + 3 * w->s->e.first[w->index] + w->first))
            return false;
        drape_parallel(w->crew, f->column_strips + f->row_strips - diagonal - 1, finish_strip, w);
    }
    return true;
}

/* The tiles of one column of strips of what the front leaves, a chunk of columns at a time. */
static void leave_column(void *user, int64_t round)
{
    const job *w = user;
    const front *f = w->f;
    const int32_t c = (int32_t)round;
    for (int32_t p = 0; p < f->columns; p += CHUNK) {
        const int depth = f->columns - p < CHUNK ? f->columns - p : CHUNK;
        for (int32_t r = c; r < f->row_strips; r++)
            drape_tile_multiply(strip_of(w, f->column_strips + r) + S * p,
                                strip_of(w, f->column_strips + c) + S * p, depth, S, p == 0,
                                w->update + tile_at(f, r, c));
    }
}

static void make_front(multifrontal *s, int32_t i, drape_crew *crew)
{
    const front *f = &s->fronts[i];
    job w = {.s = s,
             .index = i,
             .f = f,
             .panel = s->panels + f->panel,
             .update = s->updates + f->update,
             .crew = crew};
    assemble(&w);
    s->failed[i] = !factor_columns(&w);
    if (s->failed[i])
        return;
    drape_parallel(crew, f->row_strips, leave_column, &w);
    add_children(&w, true);
}

/* ---- Factors ---- */

static void make_branch(void *user, int64_t round)
{
    multifrontal *s = user;
    for (int32_t i = s->branch[2 * round]; i <= s->branch[2 * round + 1]; i++) {
        make_front(s, i, NULL);
        if (s->failed[i])
            return;
    }
}

/* What is seen of a matrix before it is factored. */
typedef struct looks {
    bool finite, positive, symmetric; /* positive: its diagonal is */
} looks;

static void look_at_diagonal(multifrontal *s, looks *seen)
{
    const drape_pattern *p = s->pattern;
    for (int32_t j = 0; j < p->block_count; j++) {
        int64_t stride;
        const double *at = drape_pattern_at(p, (double *)(uintptr_t)s->values, j, p->diagonal[j], &stride);
        for (int c = 0; c < 3; c++) {
            s->diagonal[3 * j + c] = at[c * stride + c];
            seen->positive &= s->diagonal[3 * j + c] > 0;
        }
    }
}

/* Whether block k, at row i of column j, is what its mirror is. */
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

/* Column by column, as the values lie: a mirror is never far from its block in a mesh that is numbered well. */
static looks look_at(multifrontal *s)
{
    const drape_pattern *p = s->pattern;
    looks seen = {
        .finite = drape_all_finite(s->values, (size_t)p->nonzeros), .positive = true, .symmetric = true};
    const int32_t *mirror = s->mirror;
    if (seen.finite)
        look_at_diagonal(s, &seen);
    for (int32_t j = 0; seen.finite && seen.positive && j < p->block_count; j++)
        for (int32_t k = p->diagonal[j]; k < p->block_start[j + 1]; k++)
            seen.symmetric &= is_mirrored(s, j, k, *mirror++);
    return seen;
}

/* The ratio of the extreme pivots bounds the condition from below. */
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
    drape_parallel(s->crew, s->branch_count, make_branch, s);
    for (int32_t i = 0; i < s->e.count; i++)
        if (s->failed[i])
            return false;
    for (int32_t k = 0; k < s->top_count; k++) {
        make_front(s, s->top[k], s->crew);
        if (s->failed[s->top[k]])
            return false;
    }
    return is_well_conditioned(s);
}

static drape_status factor_general(multifrontal *s, const double *values)
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

static drape_status factor_any(multifrontal *s, const double *values, bool definite)
{
    s->factored = s->by_general = false;
    s->values = values;
    const looks seen = look_at(s);
    if (!seen.finite)
        return DRAPE_RETRY_LINEAR;
    s->factored = seen.positive && seen.symmetric && factor_cholesky(s);
    if (s->factored)
        return DRAPE_OK;
    return definite && seen.symmetric ? DRAPE_RETRY_LINEAR : factor_general(s, values);
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

/* A front and the parts of the solution that it works on. */
typedef struct part {
    const front *f;
    const double *panel, *inverse;
    const int32_t *row;   /* (f->rows / 3) */
    double *left;         /* (f->rows) what it leaves to its parent */
    double *x, *y, *sums; /* of its columns, of its rows, four sums a column */
} part;

/* Scratch is a branch's own, or the top's. */
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

/* Columns p ... of a strip. */
static const double *strip_from(const part *w, int64_t strip, int32_t p)
{
    return w->panel + (strip * w->f->columns + p) * S;
}

/* What children left, on columns and rows. */
static void take_from_children(const multifrontal *s, const part *w)
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
    take_from_children(s, &w);
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

static void forward_branch(void *user, int64_t round)
{
    multifrontal *s = user;
    for (int32_t i = s->branch[2 * round]; i <= s->branch[2 * round + 1]; i++)
        solve_forward(s, i);
}

static void backward_branch(void *user, int64_t round)
{
    multifrontal *s = user;
    for (int32_t i = s->branch[2 * round + 1]; i >= s->branch[2 * round]; i--)
        solve_backward(s, i);
}

static drape_status solve(void *state, const double *b, double *x)
{
    multifrontal *s = state;
    const size_t n = (size_t)s->pattern->n;
    if (!s->factored)
        return DRAPE_RETRY_LINEAR;
    if (s->by_general)
        return s->general_row->solve(s->general, b, x);
    for (int32_t k = 0; k < s->e.n; k++)
        memcpy(s->work + 3 * (size_t)k, b + 3 * (size_t)s->e.order[k], 3 * sizeof *b);
    drape_parallel(s->crew, s->branch_count, forward_branch, s);
    for (int32_t k = 0; k < s->top_count; k++)
        solve_forward(s, s->top[k]);
    for (int32_t k = s->top_count - 1; k >= 0; k--)
        solve_backward(s, s->top[k]);
    drape_parallel(s->crew, s->branch_count, backward_branch, s);
    for (int32_t k = 0; k < s->e.n; k++)
        memcpy(x + 3 * (size_t)s->e.order[k], s->work + 3 * (size_t)k, 3 * sizeof *x);
    return drape_all_finite(x, n) ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}

static void archive(void *state, drape_archive *a, const double *values)
{
    multifrontal *s = state;
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
    const multifrontal *s = state;
    const size_t n = (size_t)s->pattern->n, blocks = n / 3,
                 lower = ((size_t)s->pattern->nonzeros / 9 + blocks) / 2;
    const size_t rows = (size_t)s->e.row_start[s->e.count];
    size_t doubles = (size_t)s->panel_size + (size_t)s->update_size + 3 * n + 3 * rows +
                     (size_t)((s->branch_count + 1) * scratch_size(s));
    return sizeof *s + doubles * sizeof(double) + (size_t)s->e.count * (sizeof(front) + 40) +
           (3 * lower + 4 * blocks + 4 * rows) * sizeof(int32_t) +
           (s->general ? s->general_row->bytes(s->general) : 0);
}

static void report(const void *state, drape_linear_report *out)
{
    const multifrontal *s = state;
    *out = (drape_linear_report){.row = &drape_linear_multifrontal,
                                 .fallbacks = s->fallbacks,
                                 .fallback = s->general ? s->general_row : NULL};
}

const drape_linear_ops drape_linear_multifrontal = {
    .entry = {.name = "multifrontal",
              .summary = "multifrontal Cholesky of our own, the same bits with any number of threads; what "
                         "is not symmetric "
                         "positive definite goes to umfpack or klu, by size",
              .reference = "Duff & Reid 1983; Liu 1992, The multifrontal method for sparse matrix solution"},
    .best_from = 100,     /* a third of klu's time at 400 unknowns */
    .borrows_heap = true, /* that of the general row, at the first matrix for it */
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
