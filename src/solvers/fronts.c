/* fronts.c: see fronts.h. */
#include "solvers/fronts.h"

#include <string.h>

#define BRANCHES  24 /* a branch has at most this part of all work */
#define S         DRAPE_STRIP
#define A_STRIP   (DRAPE_STRIP / 3) /* blocks in a strip */
#define ALIGNMENT 64

/* ---- Storage of the fronts ---- */

/* Branches are the largest subtrees with at most 1 / BRANCHES of all work; the other fronts are the top. */
static void find_branches(drape_fronts *s, double *work, int32_t *begin)
{
    const int32_t count = s->e.count;
    double total = 0;
    for (int32_t i = 0; i < count; i++) { /* work: of the subtree below i; begin: its first drape_front */
        work[i] += s->e.work[i];
        total += s->e.work[i];
        begin[i] = s->front[i].first_child >= 0 ? begin[s->front[i].first_child] : i;
        if (s->e.parent[i] >= 0)
            work[s->e.parent[i]] += work[i];
    }
    for (int32_t i = 0; i < count; i++) {
        const int32_t up = s->e.parent[i];
        const bool small = work[i] <= total / BRANCHES;
        s->front[i].branch = -1;
        if (small && (up < 0 || work[up] > total / BRANCHES)) {
            for (int32_t k = begin[i]; k <= i; k++)
                s->front[k].branch = s->branch_count;
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

static void push_update(drape_fronts *s, int32_t i, stacks *k)
{
    drape_front *f = &s->front[i];
    for (int32_t c = f->first_child; c >= 0; c = s->front[c].sibling)
        if (s->front[c].branch == f->branch && s->front[c].update < k->end[!f->odd])
            k->end[!f->odd] = s->front[c].update; /* the first child's lies deepest */
    f->update = k->end[f->odd];
    k->end[f->odd] += ((int64_t)f->row_strips * (f->row_strips + 1) / 2) * DRAPE_TILE;
    k->peak[f->odd] = k->end[f->odd] > k->peak[f->odd] ? k->end[f->odd] : k->peak[f->odd];
}

static void allocate_updates(drape_fronts *s)
{
    for (int32_t i = s->e.count - 1; i >= 0; i--)
        s->front[i].odd = s->e.parent[i] >= 0 && !s->front[s->e.parent[i]].odd;
    for (int32_t b = 0; b <= s->branch_count; b++) {
        stacks k = {{0}};
        const bool at_top = b == s->branch_count;
        const int32_t begin = at_top ? 0 : s->branch[2 * b],
                      end = at_top ? s->top_count : s->branch[2 * b + 1] + 1;
        for (int32_t i = begin; i < end; i++)
            push_update(s, at_top ? s->top[i] : i, &k);
        for (int32_t i = begin; i < end; i++) {
            drape_front *f = &s->front[at_top ? s->top[i] : i];
            f->update += s->update_size + (f->odd ? k.peak[0] : 0);
        }
        s->update_size += k.peak[0] + k.peak[1];
    }
}

/* ---- Positions of entries ---- */

/* The position of block (row, column), both in the order of elimination, in the panel of front i. */
static int64_t position_in_panel(const drape_fronts *s, int32_t i, int32_t row, int32_t column)
{
    const drape_front *f = &s->front[i];
    const int32_t columns = f->columns / 3, at = drape_front_find(&s->e, i, row);
    const int32_t strip = at < columns ? at / A_STRIP : f->column_strips + (at - columns) / A_STRIP;
    const int32_t within = at < columns ? at % A_STRIP : (at - columns) % A_STRIP;
    return ((int64_t)strip * f->columns + 3 * (int64_t)(column - s->e.first[i])) * S + 3 * within;
}

/* False if a panel is too large for 32-bit positions. */
static bool find_entry_positions(drape_fronts *s)
{
    const drape_pattern *p = s->pattern;
    int32_t at = 0;
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
                s->source[DRAPE_LOWER][at] = k;
                s->target[at++] = (int32_t)target;
            }
        }
    s->target_start[s->e.n] = at;
    return true;
}

/* Sets in_panel and in_update. False if a panel is too large for 32-bit positions. */
static bool find_row_positions(drape_fronts *s)
{
    for (int32_t i = 0; i < s->e.count; i++) {
        const drape_front *up = s->e.parent[i] >= 0 ? &s->front[s->e.parent[i]] : NULL;
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

/* Blocks on and below the diagonal. */
static size_t lower_blocks(const drape_pattern *p)
{
    return ((size_t)p->nonzeros / 9 + (size_t)p->block_count) / 2;
}

static double *take_aligned(drape_arena *arena, int64_t count)
{
    const uintptr_t at =
        (uintptr_t)drape_arena_take(arena, (size_t)count + ALIGNMENT / sizeof(double), sizeof(double));
    return (double *)((at + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT);
}

int64_t drape_fronts_scratch(const drape_fronts *s)
{
    return 5 * (int64_t)s->widest + s->tallest;
}

static drape_status lay_out(drape_arena *arena, drape_fronts *s)
{
    const drape_pattern *pattern = s->pattern;
    drape_arena scratch = drape_arena_of(arena->ctx);
    const size_t count = (size_t)s->e.count;
    double *work = drape_arena_take(&scratch, count, sizeof *work);
    int32_t *begin = drape_arena_take(&scratch, count, sizeof *begin);
    s->front = drape_arena_take(arena, count, sizeof *s->front);
    s->branch = drape_arena_take(arena, count, 2 * sizeof *s->branch);
    s->top = drape_arena_take(arena, count, sizeof *s->top);
    const bool good = !drape_arena_status(&scratch) && !drape_arena_status(arena);
    if (good) {
        for (int32_t i = s->e.count - 1; i >= 0; i--) {
            drape_front *f = &s->front[i];
            f->columns = 3 * drape_front_columns(&s->e, i);
            f->rows = 3 * drape_front_rows(&s->e, i);
            f->column_strips = (f->columns + S - 1) / S;
            f->row_strips = (f->rows + S - 1) / S;
            f->first_child = f->sibling = -1;
            const int32_t up = s->e.parent[i];
            if (up >= 0) {
                f->sibling = s->front[up].first_child;
                s->front[up].first_child = i;
            }
            s->widest = S * f->column_strips > s->widest ? S * f->column_strips : s->widest;
            s->tallest = S * f->row_strips > s->tallest ? S * f->row_strips : s->tallest;
        }
        for (int32_t i = 0; i < s->e.count; i++) {
            drape_front *f = &s->front[i];
            f->panel = s->panel_size;
            s->panel_size += (int64_t)(f->column_strips + f->row_strips) * S * f->columns;
        }
        find_branches(s, work, begin);
        allocate_updates(s);
    }
    drape_arena_free(&scratch);
    if (!good)
        return DRAPE_E_MEMORY;
    const size_t n = (size_t)pattern->n, rows = (size_t)s->e.row_start[s->e.count];
    s->source[DRAPE_LOWER] = drape_arena_take(arena, lower_blocks(pattern), sizeof **s->source);
    s->target = drape_arena_take(arena, lower_blocks(pattern), sizeof *s->target);
    s->target_start = drape_arena_take(arena, n / 3 + 1, sizeof *s->target_start);
    s->work = drape_arena_take(arena, n, sizeof *s->work);
    s->failed = drape_arena_take(arena, (size_t)s->e.count, sizeof *s->failed);
    s->scratch = drape_arena_take(arena, (size_t)(s->branch_count + 1),
                                  (size_t)drape_fronts_scratch(s) * sizeof *s->scratch);
    s->left = drape_arena_take(arena, rows, 3 * sizeof *s->left);
    s->in_panel = drape_arena_take(arena, rows, sizeof *s->in_panel);
    s->in_update = drape_arena_take(arena, rows, sizeof *s->in_update);
    s->panels[DRAPE_LOWER] = take_aligned(arena, s->panel_size);
    s->updates[DRAPE_LOWER] = take_aligned(arena, s->update_size);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    if (!find_entry_positions(s) || !find_row_positions(s))
        return drape_fail(arena->ctx, DRAPE_E_SOLVER, "the factors have a front of more than 2^31 entries");
    return DRAPE_OK;
}

drape_status drape_fronts_create(drape_arena *arena, const drape_pattern *pattern, drape_fronts *s)
{
    *s = (drape_fronts){.pattern = pattern};
    drape_status status = drape_elimination_share(arena->ctx, pattern, &s->shared);
    if (status)
        return status;
    s->e = *drape_elimination_of(s->shared);
    status = lay_out(arena, s);
    if (status)
        drape_fronts_destroy(s);
    return status;
}

void drape_fronts_destroy(drape_fronts *s)
{
    drape_elimination_release(&s->shared);
}

drape_status drape_fronts_take_upper_panels(drape_arena *arena, drape_fronts *s)
{
    double *panels = take_aligned(arena, s->panel_size);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    s->panels[DRAPE_UPPER] = panels;
    return DRAPE_OK;
}

drape_status drape_fronts_take_upper_updates(drape_arena *arena, drape_fronts *s)
{
    int32_t *mirrored = drape_arena_take(arena, lower_blocks(s->pattern), sizeof *mirrored);
    double *updates = take_aligned(arena, s->update_size);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    /* Each block of `source` has row i and column j of the pattern: finds the one with row j and column i. */
    const drape_pattern *p = s->pattern;
    for (int32_t column = 0; column < s->e.n; column++)
        for (int32_t at = s->target_start[column]; at < s->target_start[column + 1]; at++)
            mirrored[at] =
                drape_pattern_find(p, s->e.order[column], p->block_row[s->source[DRAPE_LOWER][at]]);
    s->source[DRAPE_UPPER] = mirrored;
    s->updates[DRAPE_UPPER] = updates;
    return DRAPE_OK;
}

/* ---- One front ---- */

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

/* The update of a child from its block column `first` on: argument of add_child_column. */
typedef struct child_job {
    const drape_front_job *to;
    drape_half half;
    int32_t child, first;
} child_job;

/* Adds a block column of a child's update to its parent. */
static void add_child_column(void *user, int64_t task)
{
    const child_job *from_child = user;
    const drape_front_job *w = from_child->to;
    const drape_fronts *s = w->s;
    const drape_front *f = w->f, *c = &s->front[from_child->child];
    const int64_t start = s->e.row_start[from_child->child];
    const int32_t k = from_child->first + (int32_t)task, blocks = c->rows / 3;
    const int32_t column = s->e.in_parent[start + k], below = column - f->columns / 3;
    const int32_t *place = (below < 0 ? s->in_panel : s->in_update) + start;
    const double *from = s->updates[from_child->half] + c->update + drape_front_tile_at(c, 0, k / A_STRIP) +
                         3 * (k % A_STRIP) * S;
    double *to = below < 0 ? w->panel[from_child->half] + 3 * (int64_t)column * S
                           : w->update[from_child->half] + drape_front_tile_at(f, 0, below / A_STRIP) +
                                 3 * (below % A_STRIP) * S;
    for (int32_t r = k; r < blocks; r++)
        add_block(from + r / A_STRIP * DRAPE_TILE + 3 * (r % A_STRIP), to + place[r]);
}

/* Adds those columns of the children's updates that are factored in this front, or the others. */
static void add_children(const drape_front_job *w, drape_half half, bool factored)
{
    const drape_fronts *s = w->s;
    for (int32_t child = w->f->first_child; child >= 0; child = s->front[child].sibling) {
        /* The first block row of a child's update that its parent does not factor. */
        const int32_t *place = s->in_update + s->e.row_start[child];
        int32_t low = 0, high = s->front[child].rows / 3;
        while (low < high) {
            const int32_t middle = low + (high - low) / 2;
            if (place[middle] < 0)
                low = middle + 1;
            else
                high = middle;
        }
        const int32_t middle = low, all = s->front[child].rows / 3;
        child_job columns = {.to = w, .half = half, .child = child, .first = factored ? 0 : middle};
        drape_parallel(w->pool, factored ? middle : all - middle, add_child_column, &columns);
    }
}

/* Copies a block of the lower triangle, or the transpose of the block mirrored to it. */
static inline void copy_block(const drape_fronts *s, drape_half half, int32_t at, int32_t column, double *to)
{
    const drape_pattern *p = s->pattern;
    double *values = (double *)(uintptr_t)s->values;
    int64_t stride;
    if (half == DRAPE_LOWER) {
        const double *from =
            drape_pattern_at(p, values, s->e.order[column], s->source[DRAPE_LOWER][at], &stride);
        for (int c = 0; c < 3; c++)
            for (int r = 0; r < 3; r++)
                to[S * c + r] = from[c * stride + r];
    } else {
        const double *from = drape_pattern_at(p, values, p->block_row[s->source[DRAPE_LOWER][at]],
                                              s->source[DRAPE_UPPER][at], &stride);
        for (int c = 0; c < 3; c++)
            for (int r = 0; r < 3; r++)
                to[S * c + r] = from[r * stride + c];
    }
}

void drape_front_assemble(const drape_front_job *w, drape_half half)
{
    const drape_fronts *s = w->s;
    const drape_front *f = w->f;
    memset(w->panel[half], 0,
           (size_t)(f->column_strips + f->row_strips) * S * (size_t)f->columns * sizeof **w->panel);
    for (int32_t column = s->e.first[w->index]; column < s->e.first[w->index + 1]; column++)
        for (int32_t at = s->target_start[column]; at < s->target_start[column + 1]; at++)
            copy_block(s, half, at, column, w->panel[half] + s->target[at]);
    add_children(w, half, true);
}

void drape_front_extend_add(const drape_front_job *w, drape_half half)
{
    add_children(w, half, false);
}

/* ---- All fronts ---- */

typedef struct traversal {
    drape_fronts *s;
    drape_front_factor *factor;
    void *user;
} traversal;

bool drape_fronts_cancelled(const drape_fronts *s)
{
    return s->cancel && *s->cancel && atomic_load(*s->cancel);
}

static bool factor_front(const traversal *t, int32_t i, drape_pool *pool)
{
    drape_fronts *s = t->s;
    const drape_front *f = &s->front[i];
    drape_front_job w = {.s = s, .index = i, .f = f, .pool = pool, .user = t->user};
    for (int half = 0; half < DRAPE_HALVES; half++) {
        w.panel[half] = s->panels[half] ? s->panels[half] + f->panel : NULL;
        w.update[half] = s->updates[half] ? s->updates[half] + f->update : NULL;
    }
    s->failed[i] = drape_fronts_cancelled(s) || !t->factor(&w);
    return !s->failed[i];
}

static void factor_branch(void *user, int64_t task)
{
    const traversal *t = user;
    const int32_t *branch = t->s->branch + 2 * task;
    for (int32_t i = branch[0]; i <= branch[1]; i++)
        if (!factor_front(t, i, NULL))
            return;
}

drape_status drape_fronts_factor(drape_fronts *s, drape_front_factor *factor, void *user)
{
    traversal t = {s, factor, user};
    bool good = true;
    memset(s->failed, 0, (size_t)s->e.count * sizeof *s->failed);
    drape_parallel(s->pool, s->branch_count, factor_branch, &t);
    for (int32_t i = 0; i < s->e.count; i++)
        good &= !s->failed[i];
    for (int32_t k = 0; good && k < s->top_count; k++)
        good = factor_front(&t, s->top[k], s->pool);
    if (drape_fronts_cancelled(s))
        return DRAPE_E_STOPPED;
    return good ? DRAPE_OK : DRAPE_RETRY_LINEAR;
}
