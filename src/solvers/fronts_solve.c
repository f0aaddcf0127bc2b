/* fronts_solve.c: solves with the factors in the panels of the fronts: from the branches to the top, and
 * back. What a front passes to its parent is in `left`. */
#include "base/lanes.h"
#include "solvers/fronts.h"

#include <string.h>

#define S DRAPE_STRIP

/* A front and the parts of the solution that it works on. */
typedef struct part {
    const drape_front *f;
    int32_t at; /* its first column, counted over all fronts */
    const double *panel[DRAPE_HALVES];
    const int32_t *row;   /* (f->rows / 3) */
    double *left;         /* (f->rows) what it passes to its parent */
    double *x, *y, *sums; /* of its columns; of its rows; four partial sums for each column */
} part;

/* All fronts are solved with the same factors: argument of the tasks. */
typedef struct solve_job {
    drape_fronts *s;
    const drape_front_solver *solver;
} solve_job;

/* The scratch belongs to the front's branch, or to the top. */
static part part_of(drape_fronts *s, int32_t i)
{
    const drape_front *f = &s->front[i];
    const int32_t place = f->branch < 0 ? s->branch_count : f->branch;
    double *x = s->scratch + (int64_t)place * drape_fronts_scratch(s), *y = x + s->widest,
           *sums = y + s->tallest;
    memset(x, 0, (size_t)S * (size_t)f->column_strips * sizeof *x);
    memcpy(x, s->work + 3 * s->e.first[i], (size_t)f->columns * sizeof *x);
    memset(y, 0, (size_t)S * (size_t)f->row_strips * sizeof *y);
    return (part){.f = f,
                  .at = 3 * s->e.first[i],
                  .panel = {s->panels[DRAPE_LOWER] + f->panel,
                            s->panels[DRAPE_UPPER] ? s->panels[DRAPE_UPPER] + f->panel : NULL},
                  .row = s->e.row + s->e.row_start[i],
                  .left = s->left + 3 * s->e.row_start[i],
                  .x = x,
                  .y = y,
                  .sums = sums};
}

/* A strip from column p on. */
static const double *strip_from(const part *w, drape_half half, int64_t strip, int32_t p)
{
    return w->panel[half] + (strip * w->f->columns + p) * S;
}

static drape_front_tile_solve tile_of(const part *w, int32_t strip)
{
    const int32_t first = S * strip, rest = w->f->columns - first;
    return (drape_front_tile_solve){.at = w->at + first,
                                    .width = rest < S ? rest : S,
                                    .tile = strip_from(w, DRAPE_LOWER, strip, first),
                                    .x = w->x + first};
}

static void solve_forward(const solve_job *job, int32_t i)
{
    drape_fronts *s = job->s;
    const part w = part_of(s, i);
    const drape_front *f = w.f;
    /* Adds what the children passed on to the front's columns and rows. */
    const int32_t columns = w.f->columns / 3;
    for (int32_t child = w.f->first_child; child >= 0; child = s->front[child].sibling)
        for (int64_t k = s->e.row_start[child]; k < s->e.row_start[child + 1]; k++) {
            const int32_t at = s->e.in_parent[k];
            double *to = at < columns ? w.x + 3 * at : w.y + 3 * (at - columns);
            for (int c = 0; c < 3; c++)
                to[c] += s->left[3 * k + c];
        }
    for (int32_t d = 0; d < f->column_strips; d++) {
        const drape_front_tile_solve t = tile_of(&w, d);
        if (job->solver->forward)
            job->solver->forward(&t, job->solver->user);
        for (int32_t k = d + 1; k < f->column_strips; k++)
            drape_strip_times(t.width, strip_from(&w, DRAPE_LOWER, k, S * d), t.x, w.x + S * k);
    }
    memcpy(s->work + w.at, w.x, (size_t)f->columns * sizeof *w.x);
    for (int32_t k = 0; k < f->row_strips; k++)
        drape_strip_times(f->columns, strip_from(&w, DRAPE_LOWER, f->column_strips + k, 0), w.x, w.y + S * k);
    memcpy(w.left, w.y, (size_t)f->rows * sizeof *w.y);
}

static void solve_backward(const solve_job *job, int32_t i)
{
    drape_fronts *s = job->s;
    const part w = part_of(s, i);
    const drape_front *f = w.f;
    const drape_half back = job->solver->back;
    for (int32_t k = 0; k < f->rows; k++)
        w.y[k] = s->work[3 * w.row[k / 3] + k % 3];
    memset(w.sums, 0, (size_t)LANES * (size_t)f->columns * sizeof *w.sums);
    for (int32_t k = 0; k < f->row_strips; k++)
        drape_strip_transposed_times(f->columns, strip_from(&w, back, f->column_strips + k, 0), w.y + S * k,
                                     w.sums);
    for (int32_t d = f->column_strips - 1; d >= 0; d--) {
        const drape_front_tile_solve t = tile_of(&w, d);
        const double *sums = w.sums + LANES * S * d;
        for (int32_t k = d + 1; k < f->column_strips; k++)
            drape_strip_transposed_times(t.width, strip_from(&w, back, k, S * d), w.x + S * k,
                                         w.sums + LANES * S * d);
        for (int p = 0; p < t.width; p++)
            t.x[p] -= (sums[LANES * p] + sums[LANES * p + 1]) + (sums[LANES * p + 2] + sums[LANES * p + 3]);
        job->solver->backward(&t, job->solver->user);
    }
    memcpy(s->work + w.at, w.x, (size_t)f->columns * sizeof *w.x);
}

static void forward_branch(void *user, int64_t task)
{
    const solve_job *job = user;
    const int32_t *branch = job->s->branch + 2 * task;
    for (int32_t i = branch[0]; i <= branch[1]; i++)
        solve_forward(job, i);
}

static void backward_branch(void *user, int64_t task)
{
    const solve_job *job = user;
    const int32_t *branch = job->s->branch + 2 * task;
    for (int32_t i = branch[1]; i >= branch[0]; i--)
        solve_backward(job, i);
}

void drape_fronts_solve(drape_fronts *s, const drape_front_solver *solver, const double *b, double *x)
{
    solve_job job = {s, solver};
    for (int32_t k = 0; k < s->e.n; k++)
        memcpy(s->work + 3 * (size_t)k, b + 3 * (size_t)s->e.order[k], 3 * sizeof *b);
    drape_parallel(s->pool, s->branch_count, forward_branch, &job);
    for (int32_t k = 0; k < s->top_count; k++)
        solve_forward(&job, s->top[k]);
    for (int32_t k = s->top_count - 1; k >= 0; k--)
        solve_backward(&job, s->top[k]);
    drape_parallel(s->pool, s->branch_count, backward_branch, &job);
    for (int32_t k = 0; k < s->e.n; k++)
        memcpy(x + 3 * (size_t)s->e.order[k], s->work + 3 * (size_t)k, 3 * sizeof *x);
}
