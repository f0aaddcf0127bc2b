/* approx_jacobian.c: see approx_jacobian.h. */
#include "nonlinear/approx_jacobian.h"

#include "base/clock.h"
#include "nonlinear/nonsymmetric.h"
#include "nonlinear/scalar_stiffness.h"
#include "solvers/linear.h"
#include "solvers/pcg.h"
#include "solvers/prolong.h"

#include <string.h>

/* Conjugate gradients in each iteration with friction. A sheet of 30 x 30 nodes on a ball with friction
 * 0.3 is 30 mm of 1 m from the converged run after 0.8 s with 0, 2, 3 or up to 60 iterations, for 1.7,
 * 2.5, 2.8 and 4.7 times the CPU of symmetric matrices, with which it is 52 mm off; one of 20 x 20 nodes
 * that is thrown on a slope, 378, 0, 0 and 1 mm, and 567 mm. */
#define INNER_ITERATIONS 2
#define INNER_TOLERANCE  0.3

/* The matrix on the coarse space. Its slots are the blocks of its pattern. */
typedef struct coarse_matrix {
    drape_prolong prolong;
    drape_pattern pattern;
    double *elastic, *damping, *mass; /* (slots) of the scalar stiffness */
    int64_t *pair_start; /* (pairs + 1) where the list of each pair begins: what it adds to which slots on
                            or below the diagonal */
    int32_t *slot;
    double *weight;
    double *sum;    /* (6 x slots) symmetric blocks */
    double *values; /* of the pattern */
    double *b, *x;
    const drape_linear_ops *linear;
    void *solver;
} coarse_matrix;

/* The nonzero blocks of R on or below the diagonal. */
typedef struct remainder_matrix {
    drape_arena arena; /* holds the arrays */
    double *values;    /* of the system's pattern; NULL: there is no R */
    int64_t version;   /* of that pattern */
    int32_t count;
    int32_t *row, *column; /* (lower blocks of the pattern) */
    double *block;         /* (9 x lower blocks) row by row; diagonal ones symmetric */
} remainder_matrix;

struct drape_approx_jacobian {
    drape_arena *arena;
    drape_system *system;
    const drape_model *model;
    int32_t nodes, pairs; /* number of free nodes; number of pairs of all terms of pairs */
    int32_t *pair;        /* (pairs x 2) free nodes; -1: pinned */
    double *h;            /* (6 x pairs) */
    drape_scalar_stiffness scalar;
    coarse_matrix coarse;
    bool coarse_due; /* its factors are not of this solve */
    bool has_friction;
    int most; /* iterations of conjugate gradients in a solution */
    remainder_matrix remainder;
    double *inverse; /* (6 x nodes) of the diagonal blocks */
    drape_pcg pcg;
    drape_nonsymmetric friction;
};

/* ---- What does not change with the state: pairs ---- */

static drape_status list_pairs(drape_approx_jacobian *s)
{
    const drape_model *m = s->model;
    for (int32_t t = 0; t < m->term_count; t++)
        s->pairs += m->terms[t].ops->pair ? m->terms[t].elements.count : 0;
    s->pair = drape_arena_take(s->arena, 2 * (size_t)s->pairs, sizeof *s->pair);
    s->h = drape_arena_take(s->arena, 6 * (size_t)s->pairs, sizeof *s->h);
    if (drape_arena_status(s->arena))
        return DRAPE_E_MEMORY;
    int32_t *to = s->pair;
    for (int32_t t = 0; t < m->term_count; t++) {
        const drape_term *term = &m->terms[t];
        int32_t ends = term->ops->pair ? 2 * term->elements.count : 0;
        for (int32_t i = 0; i < ends; i++)
            *to++ = m->free_of_node[term->elements.node[i]];
    }
    return DRAPE_OK;
}

/* ---- The coarse space, and what each pair adds to the matrix there ---- */

/* One of two passes over the edges of the mesh between free nodes: the first counts the neighbours of each
 * node in start[node + 2]; the second lists them from start[node + 1] on, which it advances to where the
 * list of the next node begins. */
static void pass_edges(const drape_model *m, int32_t *start, int32_t *neighbor)
{
    for (int32_t e = 0; e < m->edge_count; e++) {
        int32_t a = m->free_of_node[m->edge[2 * (size_t)e]], b = m->free_of_node[m->edge[2 * (size_t)e + 1]];
        if (a < 0 || b < 0)
            continue;
        if (neighbor) {
            neighbor[start[a + 1]++] = b;
            neighbor[start[b + 1]++] = a;
        } else {
            start[a + 2]++;
            start[b + 2]++;
        }
    }
}

static drape_status build_prolong(drape_approx_jacobian *s, drape_arena *scratch)
{
    const drape_model *m = s->model;
    int32_t *start = drape_arena_take(scratch, (size_t)s->nodes + 2, sizeof *start);
    int32_t *neighbor = drape_arena_take(scratch, 2 * (size_t)m->edge_count, sizeof *neighbor);
    if (drape_arena_status(scratch))
        return DRAPE_E_MEMORY;
    pass_edges(m, start, NULL);
    for (int32_t i = 1; i < s->nodes; i++)
        start[i + 1] += start[i];
    pass_edges(m, start, neighbor);
    const drape_graph graph = {.count = s->nodes, .start = start, .neighbor = neighbor};
    return drape_prolong_build(s->arena, &graph, drape_prolong_spacing(s->nodes), &s->coarse.prolong);
}

/* Couples the coarse functions that overlap on the model's pattern, in pairs. */
static drape_status build_coarse_pattern(drape_approx_jacobian *s, drape_arena *scratch)
{
    coarse_matrix *c = &s->coarse;
    const drape_pattern *p = &s->model->pattern;
    const drape_graph fine = {.count = p->block_count, .start = p->block_start, .neighbor = p->block_row};
    int32_t *start, *neighbor, count = 0;
    drape_status status = drape_prolong_meet(scratch, &c->prolong, &fine, &start, &neighbor);
    if (status)
        return status;
    int32_t *pairs = drape_arena_take(scratch, 2 * (size_t)start[c->prolong.coarse], sizeof *pairs);
    int32_t *own = drape_arena_take(scratch, (size_t)c->prolong.coarse, sizeof *own);
    if (drape_arena_status(scratch))
        return DRAPE_E_MEMORY;
    for (int32_t a = 0; a < c->prolong.coarse; a++) {
        own[a] = a;
        for (int32_t k = start[a]; k < start[a + 1]; k++)
            if (neighbor[k] < a) {
                pairs[2 * (size_t)count] = a;
                pairs[2 * (size_t)count++ + 1] = neighbor[k];
            }
    }
    const drape_coupling coupling = {.count = count, .nodes = 2, .node = pairs};
    return drape_pattern_build(s->arena, c->prolong.coarse, own, &coupling, 1, &c->pattern);
}

/* Adds entry k of the scalar stiffness, in row i, to P' C P. */
static void add_scalar(drape_approx_jacobian *s, int32_t i, int32_t k)
{
    coarse_matrix *c = &s->coarse;
    const drape_prolong *p = &c->prolong;
    const drape_scalar_stiffness *f = &s->scalar;
    for (int32_t a = p->start[i]; a < p->start[i + 1]; a++)
        for (int32_t b = p->start[f->column[k]]; b < p->start[f->column[k] + 1]; b++) {
            int32_t slot = drape_pattern_find(&c->pattern, p->column[a], p->column[b]);
            double w = p->weight[a] * p->weight[b];
            c->elastic[slot] += w * f->elastic[k];
            if (f->damping)
                c->damping[slot] += w * f->damping[k];
            if (k == f->diagonal[i])
                c->mass[slot] += w * s->model->mass[s->model->node_of_free[i]];
        }
}

/* The scalar stiffness on the coarse space: P' C P. */
static drape_status build_coarse_scalars(drape_approx_jacobian *s)
{
    coarse_matrix *c = &s->coarse;
    size_t slots = (size_t)c->pattern.block_start[c->pattern.block_count];
    c->elastic = drape_arena_take(s->arena, slots, sizeof *c->elastic);
    c->damping = drape_arena_take(s->arena, slots, sizeof *c->damping);
    c->mass = drape_arena_take(s->arena, slots, sizeof *c->mass);
    if (drape_arena_status(s->arena))
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < s->nodes; i++)
        for (int32_t k = s->scalar.start[i]; k < s->scalar.start[i + 1]; k++)
            add_scalar(s, i, k);
    return DRAPE_OK;
}

/* The differences of coarse functions between the nodes of a pair; returns the number of functions. */
#define MAX_FUNCTIONS (2 * DRAPE_PROLONG_FUNCTIONS)
static int differences(const drape_approx_jacobian *s, int32_t pair, int32_t column[MAX_FUNCTIONS],
                       double difference[MAX_FUNCTIONS])
{
    const drape_prolong *p = &s->coarse.prolong;
    int count = 0;
    for (int end = 0; end < 2; end++) {
        int32_t node = s->pair[2 * (size_t)pair + (size_t)end];
        if (node < 0)
            continue;
        for (int32_t k = p->start[node]; k < p->start[node + 1]; k++) {
            int i = 0;
            while (i < count && column[i] != p->column[k])
                i++;
            if (i == count) {
                column[count] = p->column[k];
                difference[count++] = 0;
            }
            difference[i] += end ? -p->weight[k] : p->weight[k];
        }
    }
    return count;
}

/* Adds the entries of one pair to the coarse matrix, from entry `at` of the list on; returns the next entry.
 * Without store it only counts the entries. */
static int64_t add_pair(drape_approx_jacobian *s, int32_t pair, int64_t at, bool store)
{
    coarse_matrix *c = &s->coarse;
    int32_t column[MAX_FUNCTIONS];
    double difference[MAX_FUNCTIONS];
    int count = differences(s, pair, column, difference);
    for (int a = 0; a < count; a++)
        for (int b = 0; b < count; b++) {
            double w = difference[a] * difference[b];
            if (column[a] < column[b] || w == 0)
                continue;
            if (store) {
                c->slot[at] = drape_pattern_find(&c->pattern, column[a], column[b]);
                c->weight[at] = w;
            }
            at++;
        }
    return at;
}

static drape_status build_coarse_pairs(drape_approx_jacobian *s)
{
    coarse_matrix *c = &s->coarse;
    c->pair_start = drape_arena_take(s->arena, (size_t)s->pairs + 1, sizeof *c->pair_start);
    if (drape_arena_status(s->arena))
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < s->pairs; i++)
        c->pair_start[i + 1] = add_pair(s, i, c->pair_start[i], false);
    size_t total = (size_t)c->pair_start[s->pairs];
    c->slot = drape_arena_take(s->arena, total, sizeof *c->slot);
    c->weight = drape_arena_take(s->arena, total, sizeof *c->weight);
    if (drape_arena_status(s->arena))
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < s->pairs; i++)
        add_pair(s, i, c->pair_start[i], true);
    return DRAPE_OK;
}

static drape_status build_coarse(drape_approx_jacobian *s)
{
    coarse_matrix *c = &s->coarse;
    drape_arena scratch = drape_arena_of(s->arena->ctx);
    drape_status status = build_prolong(s, &scratch);
    if (!status)
        status = build_coarse_pattern(s, &scratch);
    drape_arena_free(&scratch);
    if (!status)
        status = build_coarse_scalars(s);
    if (!status)
        status = build_coarse_pairs(s);
    if (status)
        return status;
    size_t slots = (size_t)c->pattern.block_start[c->pattern.block_count], n = (size_t)c->pattern.n;
    c->sum = drape_arena_take(s->arena, 6 * slots, sizeof *c->sum);
    c->values = drape_arena_take(s->arena, (size_t)c->pattern.nonzeros, sizeof *c->values);
    c->b = drape_arena_take(s->arena, n, sizeof *c->b);
    c->x = drape_arena_take(s->arena, n, sizeof *c->x);
    c->linear = drape_linear_best(c->pattern.n);
    status = drape_arena_status(s->arena);
    return status ? status : c->linear->create(s->arena, &c->pattern, &c->solver);
}

/* ---- The remainder ---- */

/* Takes the arrays of R for the system's present pattern. */
static drape_status extend(drape_approx_jacobian *s)
{
    const drape_pattern *p = drape_system_pattern(s->system);
    remainder_matrix *r = &s->remainder;
    drape_arena_free(&r->arena);
    r->values = NULL;
    r->count = 0;
    r->version = drape_system_pattern_version(s->system);
    if (!drape_system_has_remainder(s->system))
        return DRAPE_OK;
    size_t lower = ((size_t)p->block_start[p->block_count] + (size_t)p->block_count) / 2;
    r->values = drape_arena_take(&r->arena, (size_t)p->nonzeros, sizeof *r->values);
    r->row = drape_arena_take(&r->arena, lower, sizeof *r->row);
    r->column = drape_arena_take(&r->arena, lower, sizeof *r->column);
    r->block = drape_arena_take(&r->arena, 9 * lower, sizeof *r->block);
    const drape_status status = drape_arena_status(&r->arena);
    r->version = status ? -1 : r->version;
    return status;
}

static drape_status build(drape_approx_jacobian *s)
{
    drape_status status = list_pairs(s);
    if (!status) {
        /* Of all measures that are not of pairs. */
        drape_arena scratch = drape_arena_of(s->arena->ctx);
        bool *of = drape_arena_take(&scratch, (size_t)s->model->term_count, sizeof *of);
        status = drape_arena_status(&scratch);
        for (int32_t t = 0; !status && t < s->model->term_count; t++)
            of[t] = s->model->terms[t].ops->measure && !s->model->terms[t].ops->pair;
        if (!status)
            status = drape_scalar_stiffness_build(s->arena, s->system, of, &s->scalar);
        drape_arena_free(&scratch);
    }
    if (!status)
        status = build_coarse(s);
    return status ? status : extend(s);
}

/* ---- Symmetric 3 x 3 blocks: xx xy xz yy yz zz ---- */

static void multiply_block(const double *a, const double *x, double *y)
{
    y[0] = a[0] * x[0] + a[1] * x[1] + a[2] * x[2];
    y[1] = a[1] * x[0] + a[3] * x[1] + a[4] * x[2];
    y[2] = a[2] * x[0] + a[4] * x[1] + a[5] * x[2];
}

static void invert_block(double a[6])
{
    double inverse[6], xx = a[3] * a[5] - a[4] * a[4], xy = a[4] * a[2] - a[1] * a[5],
                       xz = a[1] * a[4] - a[3] * a[2];
    double scale = 1 / (a[0] * xx + a[1] * xy + a[2] * xz);
    inverse[0] = xx * scale;
    inverse[1] = xy * scale;
    inverse[2] = xz * scale;
    inverse[3] = (a[0] * a[5] - a[2] * a[2]) * scale;
    inverse[4] = (a[1] * a[2] - a[0] * a[4]) * scale;
    inverse[5] = (a[0] * a[3] - a[1] * a[1]) * scale;
    memcpy(a, inverse, sizeof inverse);
}

/* ---- y = A x ---- */

static void add_pairs(const drape_approx_jacobian *s, const double *x, double *y)
{
    static const double pinned[3] = {0, 0, 0};
    for (int32_t p = 0; p < s->pairs; p++) {
        int32_t i = s->pair[2 * (size_t)p], j = s->pair[2 * (size_t)p + 1];
        const double *a = i < 0 ? pinned : x + 3 * (size_t)i, *b = j < 0 ? pinned : x + 3 * (size_t)j;
        const double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
        double f[3];
        multiply_block(s->h + 6 * (size_t)p, d, f);
        if (i >= 0) {
            double *to = y + 3 * (size_t)i;
            to[0] += f[0], to[1] += f[1], to[2] += f[2];
        }
        if (j >= 0) {
            double *to = y + 3 * (size_t)j;
            to[0] -= f[0], to[1] -= f[1], to[2] -= f[2];
        }
    }
}

void drape_approx_jacobian_multiply(const drape_approx_jacobian *s, const double *x, double *y)
{
    const drape_scalar_stiffness *c = &s->scalar;
    for (int32_t i = 0; i < s->nodes; i++) {
        double sum[3] = {0};
        for (int32_t k = c->start[i]; k < c->start[i + 1]; k++) {
            const double *from = x + 3 * (size_t)c->column[k];
            for (int r = 0; r < 3; r++)
                sum[r] += c->sum[k] * from[r];
        }
        memcpy(y + 3 * (size_t)i, sum, sizeof sum);
    }
    add_pairs(s, x, y);
    const remainder_matrix *m = &s->remainder;
    for (int32_t k = 0; k < m->count; k++) {
        size_t i = 3 * (size_t)m->row[k], j = 3 * (size_t)m->column[k];
        const double *b = m->block + 9 * (size_t)k;
        for (size_t r = 0; r < 3; r++)
            for (size_t q = 0; q < 3; q++) {
                y[i + r] += b[3 * r + q] * x[j + q];
                if (i != j)
                    y[j + q] += b[3 * r + q] * x[i + r];
            }
    }
    drape_system_project_free(s->system, y);
}

static void multiply(const void *owner, const double *x, double *y)
{
    drape_approx_jacobian_multiply(owner, x, y);
}

/* z = D^-1 r + P A_c^-1 P' r. The coarse solve can only fail if numbers are not finite, and then its part
 * is left out. */
static void precondition(const void *owner, const double *r, double *z)
{
    const drape_approx_jacobian *s = owner;
    const coarse_matrix *c = &s->coarse;
    for (int32_t i = 0; i < s->nodes; i++)
        multiply_block(s->inverse + 6 * (size_t)i, r + 3 * (size_t)i, z + 3 * (size_t)i);
    drape_prolong_restrict(&c->prolong, r, c->b);
    if (c->linear->solve(c->solver, c->b, c->x) == DRAPE_OK)
        drape_prolong_add(&c->prolong, c->x, z);
    drape_system_project_free(s->system, z);
}

/* ---- Update ---- */

/* One block, row by row; false if it is zero. */
static bool read_block(const drape_pattern *p, double *values, int32_t column, int32_t block, double *to)
{
    int64_t stride;
    const double *a = drape_pattern_at(p, values, column, block, &stride);
    bool any = false;
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            to[3 * r + c] = a[c * stride + r];
            any = any || to[3 * r + c] != 0;
        }
    return any;
}

/* The same of (A + A')/2: friction makes blocks nonsymmetric. */
static bool read_symmetric(const drape_pattern *p, double *values, int32_t column, int32_t block, double *to)
{
    double one[9], mirror[9];
    const int32_t row = p->block_row[block];
    if (!read_block(p, values, column, block, one))
        return false;
    read_block(p, values, row, row == column ? block : drape_pattern_find(p, column, row), mirror);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++)
            to[3 * r + c] = (one[3 * r + c] + mirror[3 * c + r]) / 2;
    return true;
}

static drape_status evaluate_remainder(drape_approx_jacobian *s, const drape_point *point, bool friction)
{
    bool changed;
    s->friction.acts = false;
    if (!drape_system_has_remainder(s->system))
        return DRAPE_OK;
    drape_status status = drape_system_extend_pattern(s->system, point, &changed);
    if (!status && s->remainder.version != drape_system_pattern_version(s->system))
        status = extend(s);
    if (status)
        return status;
    drape_system_remainder(s->system, point, s->remainder.values);
    const drape_pattern *p = drape_system_pattern(s->system);
    remainder_matrix *m = &s->remainder;
    m->count = 0;
    for (int32_t j = 0; j < p->block_count; j++)
        for (int32_t k = p->diagonal[j]; k < p->block_start[j + 1]; k++) {
            if (!read_symmetric(p, m->values, j, k, m->block + 9 * (size_t)m->count))
                continue;
            m->row[m->count] = p->block_row[k];
            m->column[m->count++] = j;
        }
    return friction ? drape_nonsymmetric_update(&s->friction, point, NULL) : DRAPE_OK;
}

static void add_upper(drape_approx_jacobian *s, int32_t node, const double upper[6])
{
    for (size_t c = 0; c < 6; c++)
        s->inverse[6 * (size_t)node + c] += upper[c];
}

/* The diagonal blocks, inverted. */
static void invert_diagonal(drape_approx_jacobian *s)
{
    const remainder_matrix *m = &s->remainder;
    for (int32_t i = 0; i < s->nodes; i++) {
        double scalar = s->scalar.sum[s->scalar.diagonal[i]];
        memcpy(s->inverse + 6 * (size_t)i, (double[6]){scalar, 0, 0, scalar, 0, scalar}, 6 * sizeof(double));
    }
    for (int32_t p = 0; p < 2 * s->pairs; p++)
        if (s->pair[p] >= 0)
            add_upper(s, s->pair[p], s->h + 6 * (size_t)(p / 2));
    for (int32_t k = 0; k < m->count; k++) {
        const double *b = m->block + 9 * (size_t)k;
        if (m->row[k] == m->column[k])
            add_upper(s, m->row[k], (double[6]){b[0], b[1], b[2], b[4], b[5], b[8]});
    }
    for (int32_t i = 0; i < s->nodes; i++)
        invert_block(s->inverse + 6 * (size_t)i);
}

/* ---- The matrix on the coarse space ---- */

/* Expands the blocks on and below the diagonal to the values of the pattern. */
static void expand_coarse(drape_approx_jacobian *s)
{
    static const int place[9] = {0, 1, 2, 1, 3, 4, 2, 4, 5};
    coarse_matrix *c = &s->coarse;
    const drape_pattern *p = &c->pattern;
    for (int32_t j = 0; j < p->block_count; j++)
        for (int32_t k = p->diagonal[j]; k < p->block_start[j + 1]; k++) {
            int64_t stride, mirrored;
            int32_t i = p->block_row[k];
            double *to = drape_pattern_at(p, c->values, j, k, &stride),
                   *mirror = drape_pattern_at(p, c->values, i, drape_pattern_find(p, j, i), &mirrored);
            for (int q = 0; q < 9; q++)
                to[q / 3 * stride + q % 3] = mirror[q / 3 * mirrored + q % 3] =
                    c->sum[6 * (size_t)k + (size_t)place[q]];
        }
}

static void add_coarse_block(drape_approx_jacobian *s, int32_t row, int32_t column, double w, const double *b,
                             bool transposed)
{
    coarse_matrix *c = &s->coarse;
    int64_t stride;
    if (!drape_pattern_has(&c->pattern, row, column))
        return; /* contact of distant cloth: a preconditioner can omit it */
    int32_t slot = drape_pattern_find(&c->pattern, row, column);
    double *to = drape_pattern_at(&c->pattern, c->values, column, slot, &stride);
    for (int r = 0; r < 3; r++)
        for (int q = 0; q < 3; q++)
            to[q * stride + r] += w * (transposed ? b[3 * q + r] : b[3 * r + q]);
}

/* Adds block k of R to the values: P' R P. */
static void add_coarse_blocks(drape_approx_jacobian *s, int32_t k)
{
    const drape_prolong *p = &s->coarse.prolong;
    const int32_t row = s->remainder.row[k], column = s->remainder.column[k];
    const double *b = s->remainder.block + 9 * (size_t)k;
    for (int32_t u = p->start[row]; u < p->start[row + 1]; u++)
        for (int32_t v = p->start[column]; v < p->start[column + 1]; v++) {
            double w = p->weight[u] * p->weight[v];
            add_coarse_block(s, p->column[u], p->column[v], w, b, false);
            if (row != column)
                add_coarse_block(s, p->column[v], p->column[u], w, b, true);
        }
}

/* Adds the pairs to the blocks. */
static void add_coarse_pairs(drape_approx_jacobian *s)
{
    coarse_matrix *c = &s->coarse;
    for (int32_t p = 0; p < s->pairs; p++) {
        const double *h = s->h + 6 * (size_t)p;
        for (int64_t k = c->pair_start[p]; k < c->pair_start[p + 1]; k++)
            for (int i = 0; i < 6; i++)
                c->sum[6 * (size_t)c->slot[k] + (size_t)i] += c->weight[k] * h[i];
    }
}

static drape_status factor_coarse(drape_approx_jacobian *s, drape_work *work)
{
    double start = drape_clock_seconds();
    coarse_matrix *c = &s->coarse;
    size_t slots = (size_t)c->pattern.block_start[c->pattern.block_count];
    for (size_t k = 0; k < slots; k++) {
        double scalar = c->elastic[k] + s->scalar.weight * c->damping[k] + s->scalar.mass_weight * c->mass[k];
        memcpy(c->sum + 6 * k, (double[6]){scalar, 0, 0, scalar, 0, scalar}, 6 * sizeof(double));
    }
    add_coarse_pairs(s);
    expand_coarse(s);
    for (int32_t k = 0; k < s->remainder.count; k++)
        add_coarse_blocks(s, k);
    drape_status status = c->linear->factor(c->solver, c->values);
    s->coarse_due = status != DRAPE_OK;
    work->factorizations++;
    work->factor_seconds += drape_clock_seconds() - start;
    return status;
}

/* The next matrix on the coarse space is that of the first matrix of a solve. Later ones keep its factors,
 * which only precondition. */
static void begin(void *matrix, bool friction, int most)
{
    drape_approx_jacobian *s = matrix;
    s->coarse_due = true;
    s->has_friction = friction;
    s->most = most;
}

static drape_status assemble(void *matrix, const drape_point *point, double mass_weight, bool positive,
                             drape_work *work)
{
    drape_approx_jacobian *s = matrix;
    const double start = drape_system_clock(s->system);
    (void)positive; /* it always is */
    drape_status status = evaluate_remainder(s, point, s->has_friction);
    if (!status) {
        drape_scalar_stiffness_weigh(&s->scalar, point->weight, mass_weight);
        double *to = s->h;
        for (int32_t t = 0; t < s->model->term_count; t++) {
            const drape_term *term = &s->model->terms[t];
            if (!term->ops->pair)
                continue;
            drape_system_pairs(s->system, t, point, to);
            to += 6 * (size_t)term->elements.count;
        }
        invert_diagonal(s);
    }
    work->jacobians++;
    work->jacobian_seconds += drape_system_clock(s->system) - start;
    return status;
}

static drape_status factor(void *matrix, bool definite, drape_work *work)
{
    drape_approx_jacobian *s = matrix;
    (void)definite;
    return s->coarse_due ? factor_coarse(s, work) : DRAPE_OK;
}

static void solve_symmetric(void *owner, const double *b, double *x)
{
    drape_approx_jacobian *s = owner;
    drape_pcg_solve(&s->pcg, b, x, INNER_TOLERANCE, INNER_ITERATIONS);
}

static drape_status solve(void *matrix, const double *b, double tolerance, double *x, bool *definite,
                          drape_work *work)
{
    drape_approx_jacobian *s = matrix;
    const double start = drape_clock_seconds();
    int iterations = 1;
    if (!drape_nonsymmetric_solve(&s->friction, b, x, &iterations)) {
        drape_pcg_solve(&s->pcg, b, x, tolerance, s->most);
        iterations = s->pcg.iterations;
    }
    *definite = true;
    work->linear_iterations += iterations;
    work->solve_seconds += drape_clock_seconds() - start;
    return DRAPE_OK;
}

/* ---- Creation and destruction ---- */

drape_status drape_approx_jacobian_create(drape_arena *arena, drape_system *system,
                                          drape_approx_jacobian **out)
{
    drape_approx_jacobian *s = *out = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    s->arena = arena;
    s->remainder.arena = drape_arena_within(arena);
    s->system = system;
    s->model = drape_system_model(system);
    s->nodes = s->model->free_count;
    begin(s, true, DRAPE_LINEAR_ITERATIONS);
    const size_t n = 3 * (size_t)s->nodes;
    s->inverse = drape_arena_take(arena, 2 * n, sizeof *s->inverse);
    s->pcg = drape_pcg_of(arena, (int64_t)n, s, multiply, precondition);
    drape_status status =
        drape_nonsymmetric_init(arena, system, false, s, multiply, solve_symmetric, &s->friction);
    if (!status)
        status = build(s);
    return status ? status : drape_arena_status(arena);
}

static void destroy(void *matrix)
{
    drape_approx_jacobian *s = matrix;
    if (!s)
        return;
    drape_linear_destroy(s->coarse.linear, &s->coarse.solver);
    drape_arena_free(&s->remainder.arena);
    drape_nonsymmetric_free(&s->friction);
}

/* Each solve begins with a new matrix, so the factors themselves are not archived, only the state that later
 * ones depend on. */
static void archive(void *matrix, drape_archive *a)
{
    drape_approx_jacobian *s = matrix;
    drape_archive_mark(a, "approximate jacobian");
    if (drape_archive_has_read(a))
        drape_archive_note(a, extend(s));
    drape_linear_archive(s->coarse.linear, s->coarse.solver, a, NULL);
}

static size_t bytes(const void *matrix)
{
    const drape_approx_jacobian *s = matrix;
    return s->coarse.linear ? drape_linear_bytes(s->coarse.linear, s->coarse.solver) : 0;
}

const drape_matrix_ops drape_approx_jacobian_ops = {.begin = begin,
                                                    .assemble = assemble,
                                                    .factor = factor,
                                                    .solve = solve,
                                                    .archive = archive,
                                                    .bytes = bytes,
                                                    .destroy = destroy};
