/*
 * verlet_force.c: the forces of a substep. Springs without dashpots and laws are summed here, in runs:
 * consecutive elements that join consecutive nodes, as along the rows of a grid,
 *     g(b + i) += p, g(a + i) -= p with p = k (1 - L/l) (x(b + i) - x(a + i)), l = |x(b + i) - x(a + i)|
 * so that a run is a loop over arrays without indices, which compilers vectorise. The forces of linear terms
 * do not depend on x and are computed once. The system sums all other terms.
 */
#include "base/lanes.h"
#include "integrators/planes.h"
#include "integrators/verlet.h"

#include <math.h>
#include <string.h>

#define MAX_RUN  128 /* elements of a run: its forces stay in the cache */
#define MEAN_RUN 8   /* the mean length from which runs are faster than the system's sum */

typedef struct run {
    int32_t a, b, count;
    const double *k, *length; /* (count) */
} run;

struct drape_verlet_force {
    drape_system *system;
    const drape_model *model;
    bool *summed;  /* (term_count) here */
    bool has_rest; /* some terms are summed by the system */
    int32_t run_count;
    run *runs;
    double *x, *g, *constant; /* planes (3 x node_count) */
};

/* ---- Creation ---- */

/* Returns the number of runs of a term; writes them if out is not NULL. */
static int32_t find_runs(const drape_elements *el, run *out)
{
    int32_t count = 0;
    for (int32_t first = 0, end; first < el->count; first = end, count++) {
        /* The end of the run that begins at an element. */
        int32_t last = first;
        const int32_t *node = el->node;
        while (last + 1 < el->count && last + 1 - first < MAX_RUN &&
               node[2 * last + 2] == node[2 * last] + 1 && node[2 * last + 3] == node[2 * last + 1] + 1)
            last++;
        end = last + 1;
        if (out)
            out[count] = (run){.a = el->node[2 * (size_t)first],
                               .b = el->node[2 * (size_t)first + 1],
                               .count = end - first,
                               .k = el->rest + first,
                               .length = el->rest + el->count + first};
    }
    return count;
}

static drape_status create_runs(drape_arena *arena, drape_verlet_force *f)
{
    const drape_model *m = f->model;
    for (int32_t i = 0; i < m->term_count; i++) {
        const drape_term *term = &m->terms[i];
        f->summed[i] = term->ops->distance && term->own_law_count == 0 && !term->damping &&
                       term->sliders == 0 &&
                       find_runs(&term->elements, NULL) <= term->elements.count / MEAN_RUN;
        f->run_count += f->summed[i] ? find_runs(&term->elements, NULL) : 0;
    }
    f->runs = drape_arena_take(arena, (size_t)f->run_count, sizeof *f->runs);
    if (!f->runs)
        return DRAPE_E_MEMORY;
    int32_t count = 0;
    for (int32_t i = 0; i < m->term_count; i++)
        if (f->summed[i])
            count += find_runs(&m->terms[i].elements, f->runs + count);
    return DRAPE_OK;
}

/* The forces of the linear terms, at the rest positions: any others would do. */
static drape_status sum_linear(drape_context *ctx, drape_verlet_force *f)
{
    const drape_model *m = f->model;
    const size_t nodes = 3 * (size_t)m->node_count;
    drape_arena arena = drape_arena_of(ctx);
    double *g = drape_arena_take(&arena, nodes, sizeof *g), *v = drape_arena_take(&arena, nodes, sizeof *v);
    bool *others = drape_arena_take(&arena, (size_t)m->term_count, sizeof *others);
    const drape_status status = drape_arena_status(&arena);
    for (int32_t i = 0; !status && i < m->term_count; i++) {
        others[i] = !m->terms[i].ops->linear || drape_term_changes(&m->terms[i]);
        f->summed[i] = f->summed[i] || !others[i];
        /* A law adds no forces of its own, and constraints are kept by moving nodes. */
        f->has_rest = f->has_rest || (!m->terms[i].ops->law && !m->terms[i].ops->constraint && !f->summed[i]);
    }
    if (!status) {
        drape_system_sum_forces(f->system, &(drape_point){.x = m->rest, .v = v}, others, g);
        planes_from((size_t)m->node_count, g, f->constant);
    }
    drape_arena_free(&arena);
    return status;
}

drape_status drape_verlet_force_create(drape_arena *arena, drape_system *system, drape_verlet_force **out)
{
    const drape_model *m = drape_system_model(system);
    const size_t nodes = 3 * (size_t)m->node_count;
    drape_verlet_force *f = *out = drape_arena_take(arena, 1, sizeof *f);
    if (!f)
        return DRAPE_E_MEMORY;
    *f = (drape_verlet_force){.system = system, .model = m};
    f->summed = drape_arena_take(arena, (size_t)m->term_count, sizeof *f->summed);
    f->x = drape_arena_take(arena, nodes, sizeof *f->x);
    f->g = drape_arena_take(arena, nodes, sizeof *f->g);
    f->constant = drape_arena_take(arena, nodes, sizeof *f->constant);
    drape_status status = drape_arena_status(arena);
    if (!status)
        status = create_runs(arena, f);
    return status ? status : sum_linear(arena->ctx, f);
}

/* ---- Sums ---- */

static inline void spring_forces(const run *r, const double *restrict x, size_t n, double *restrict px,
                                 double *restrict py, double *restrict pz)
{
    const double *ax = x + r->a, *ay = ax + n, *az = ay + n, *bx = x + r->b, *by = bx + n, *bz = by + n;
    for (int32_t i = 0; i < r->count; i++) {
        double dx = bx[i] - ax[i], dy = by[i] - ay[i], dz = bz[i] - az[i];
        double l = sqrt(dx * dx + dy * dy + dz * dz), w = r->k[i] * (1 - r->length[i] / l);
        px[i] = w * dx;
        py[i] = w * dy;
        pz[i] = w * dz;
    }
}

/* In two loops: the second nodes of a run may be first nodes of the same run. */
static inline void add_opposite(const run *r, const double *restrict p, double *g)
{
    double *restrict a = g + r->a;
    for (int32_t i = 0; i < r->count; i++)
        a[i] -= p[i];
    double *restrict b = g + r->b;
    for (int32_t i = 0; i < r->count; i++)
        b[i] += p[i];
}

LANES_DISPATCH static void sum_runs(const run *runs, int32_t count, const double *x, size_t n, double *g)
{
    double p[3][MAX_RUN];
    for (int32_t k = 0; k < count; k++) {
        spring_forces(&runs[k], x, n, p[0], p[1], p[2]);
        for (size_t c = 0; c < 3; c++)
            add_opposite(&runs[k], p[c], g + c * n);
    }
}

void drape_verlet_force_sum(drape_verlet_force *f, const drape_point *point, double *g)
{
    size_t n = (size_t)f->model->node_count;
    memcpy(f->g, f->constant, 3 * n * sizeof *f->g);
    if (f->run_count > 0) {
        planes_from(n, point->x, f->x);
        sum_runs(f->runs, f->run_count, f->x, n, f->g);
    }
    if (f->has_rest) {
        drape_system_sum_forces(f->system, point, f->summed, g);
        planes_add_to(n, f->g, g);
    } else {
        planes_to(n, f->g, g);
        drape_system_add_loads(f->system, point->x, g);
    }
    drape_system_project_forces(f->system, g);
}
