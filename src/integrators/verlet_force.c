/*
 * verlet_force.c: the forces of a substep. Springs without dashpots and laws are summed here, in runs: elements
 * that follow one another join nodes that follow one another, as along the rows of a grid,
 *     g(b + i) += p, g(a + i) -= p with p = k (1 - L/l) (x(b + i) - x(a + i)), l = |x(b + i) - x(a + i)|
 * so that a run is a loop over arrays without indices, of which compilers make vectors. Linear terms have the
 * same forces at every x: they are taken once. The system sums what is left.
 */
#include "base/lanes.h"
#include "integrators/planes.h"
#include "integrators/verlet.h"

#include <math.h>
#include <string.h>

#define LONGEST  128 /* elements of a run: its forces stay in the cache */
#define SHORTEST 8   /* on the average: below it the system's way is as good */

typedef struct run {
    int32_t a, b, count;
    const double *k, *length; /* (count) */
} run;

struct drape_verlet_force {
    drape_context *ctx;
    drape_system *system;
    const drape_model *model;
    bool *taken; /* (term_count) */
    bool rest;   /* there are others */
    int32_t run_count;
    run *runs;
    double *x, *g, *constant; /* planes (3 x node_count) */
};

/* ---- Making ---- */

/* The end of the run that begins at an element. */
static int32_t run_end(const drape_elements *el, int32_t first)
{
    int32_t last = first;
    const int32_t *node = el->node;
    while (last + 1 < el->count && last + 1 - first < LONGEST && node[2 * last + 2] == node[2 * last] + 1 &&
           node[2 * last + 3] == node[2 * last + 1] + 1)
        last++;
    return last + 1;
}

/* Writes the runs of a term where there is a place for them. */
static int32_t find_runs(const drape_elements *el, run *out)
{
    int32_t count = 0;
    for (int32_t first = 0, end; first < el->count; first = end, count++) {
        end = run_end(el, first);
        if (out)
            out[count] = (run){.a = el->node[2 * (size_t)first],
                               .b = el->node[2 * (size_t)first + 1],
                               .count = end - first,
                               .k = el->rest + first,
                               .length = el->rest + el->count + first};
    }
    return count;
}

static bool has_runs(const drape_term *term)
{
    return term->ops->distance && term->law_count == 0 && !term->damping &&
           find_runs(&term->elements, NULL) <= term->elements.count / SHORTEST;
}

/* A law sums nothing of its own, and a constraint is kept by moving nodes. */
static bool is_summed(const drape_term *term)
{
    return !term->ops->law && !term->ops->constraint;
}

static drape_status create_runs(drape_verlet_force *f)
{
    const drape_model *m = f->model;
    for (int32_t i = 0; i < m->term_count; i++)
        if (has_runs(&m->terms[i])) {
            f->taken[i] = true;
            f->run_count += find_runs(&m->terms[i].elements, NULL);
        }
    f->runs = drape_alloc(f->ctx, (size_t)f->run_count, sizeof *f->runs);
    if (!f->runs)
        return DRAPE_E_MEMORY;
    int32_t count = 0;
    for (int32_t i = 0; i < m->term_count; i++)
        if (f->taken[i])
            count += find_runs(&m->terms[i].elements, f->runs + count);
    return DRAPE_OK;
}

/* The forces of the linear terms, which are taken then. The rest positions serve as well as any. */
static drape_status take_linear(drape_verlet_force *f)
{
    const drape_model *m = f->model;
    size_t nodes = 3 * (size_t)m->node_count;
    double *g = drape_alloc(f->ctx, nodes, sizeof *g), *v = drape_alloc(f->ctx, nodes, sizeof *v);
    bool *others = drape_alloc(f->ctx, (size_t)m->term_count, sizeof *others);
    bool enough = g && v && others;
    for (int32_t i = 0; enough && i < m->term_count; i++) {
        bool linear = m->terms[i].ops->linear;
        others[i] = !linear;
        f->taken[i] = f->taken[i] || linear;
        f->rest = f->rest || (is_summed(&m->terms[i]) && !f->taken[i]);
    }
    if (enough) {
        drape_system_force_without(f->system, &(drape_point){.x = m->rest, .v = v}, others, g);
        planes_from((size_t)m->node_count, g, f->constant);
    }
    drape_free(f->ctx, g);
    drape_free(f->ctx, v);
    drape_free(f->ctx, others);
    return enough ? DRAPE_OK : DRAPE_E_MEMORY;
}

drape_status drape_verlet_force_create(drape_context *ctx, drape_system *system, drape_verlet_force **out)
{
    const drape_model *m = drape_system_model(system);
    size_t nodes = 3 * (size_t)m->node_count;
    drape_verlet_force *f = drape_alloc(ctx, 1, sizeof *f);
    *out = f;
    if (!f)
        return DRAPE_E_MEMORY;
    *f = (drape_verlet_force){.ctx = ctx, .system = system, .model = m};
    f->taken = drape_alloc(ctx, (size_t)m->term_count, sizeof *f->taken);
    f->x = drape_alloc(ctx, nodes, sizeof *f->x);
    f->g = drape_alloc(ctx, nodes, sizeof *f->g);
    f->constant = drape_alloc(ctx, nodes, sizeof *f->constant);
    drape_status status = f->taken && f->x && f->g && f->constant ? DRAPE_OK : DRAPE_E_MEMORY;
    if (!status)
        status = create_runs(f);
    if (!status)
        status = take_linear(f);
    if (status)
        drape_verlet_force_destroy(out);
    return status;
}

void drape_verlet_force_destroy(drape_verlet_force **force)
{
    drape_verlet_force *f = *force;
    if (!f)
        return;
    drape_free(f->ctx, f->taken);
    drape_free(f->ctx, f->runs);
    drape_free(f->ctx, f->x);
    drape_free(f->ctx, f->g);
    drape_free(f->ctx, f->constant);
    drape_free(f->ctx, f);
    *force = NULL;
}

size_t drape_verlet_force_bytes(const drape_verlet_force *f)
{
    return sizeof *f + (size_t)f->model->term_count * sizeof *f->taken +
           (size_t)f->run_count * sizeof *f->runs + 9 * (size_t)f->model->node_count * sizeof(double);
}

/* ---- Summing ---- */

static inline void pull(const run *r, const double *restrict x, size_t n, double *restrict px,
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

/* In two loops: a run's second nodes may be first nodes of the same run. */
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
    double p[3][LONGEST];
    for (int32_t k = 0; k < count; k++) {
        pull(&runs[k], x, n, p[0], p[1], p[2]);
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
    if (f->rest) {
        drape_system_force_without(f->system, point, f->taken, g);
        planes_add_to(n, f->g, g);
    } else {
        planes_to(n, f->g, g);
        drape_system_add_loads(f->system, point->x, g);
    }
}
