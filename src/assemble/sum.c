/* sum.c: see sum.h. */
#include "assemble/sum.h"

#include <string.h>

/* The lowest and the highest node that a block of elements touches. */
typedef struct reach {
    int32_t low, high;
} reach;

/* The nodes first ... last - 1, which one task owns. */
typedef struct share {
    int32_t first, last;
} share;

struct drape_summer {
    const drape_model *model;
    drape_pool *pool; /* the system's; NULL: one thread */
    int threads;
    bool unconstrained;
    drape_block *blocks; /* (threads) */
    reach **reaches;     /* (term_count) of each term's blocks; NULL: one thread */
};

static int32_t block_count(const drape_term *term)
{
    return (term->elements.count + DRAPE_BLOCK - 1) / DRAPE_BLOCK;
}

static int32_t elements_in(const drape_term *term, int32_t block)
{
    int32_t left = term->elements.count - block * DRAPE_BLOCK;
    return left < DRAPE_BLOCK ? left : DRAPE_BLOCK;
}

/* ---- Creation ---- */

static reach reach_of(const drape_term *term, int32_t block)
{
    const drape_elements *el = &term->elements;
    const int32_t *node = el->node + (size_t)block * DRAPE_BLOCK * (size_t)el->nodes;
    reach r = {node[0], node[0]};
    for (int32_t i = 1; i < elements_in(term, block) * el->nodes; i++) {
        r.low = node[i] < r.low ? node[i] : r.low;
        r.high = node[i] > r.high ? node[i] : r.high;
    }
    return r;
}

static void find_reaches(drape_arena *arena, drape_summer *s)
{
    s->reaches = drape_arena_take(arena, (size_t)s->model->term_count, sizeof *s->reaches);
    for (int32_t i = 0; s->reaches && i < s->model->term_count; i++) {
        const drape_term *term = &s->model->terms[i];
        s->reaches[i] = drape_arena_take(arena, (size_t)block_count(term), sizeof **s->reaches);
        for (int32_t k = 0; s->reaches[i] && k < block_count(term); k++)
            s->reaches[i][k] = reach_of(term, k);
    }
}

drape_status drape_summer_create(drape_arena *arena, const drape_model *model, drape_pool *pool,
                                 drape_summer **out)
{
    drape_summer *s = *out = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    *s = (drape_summer){.model = model, .pool = pool, .threads = drape_pool_threads(pool)};
    s->blocks = drape_arena_take(arena, (size_t)s->threads, sizeof *s->blocks);
    if (s->threads > 1)
        find_reaches(arena, s);
    return drape_arena_status(arena);
}

void drape_summer_leave_constraints(drape_summer *s)
{
    s->unconstrained = true;
}

bool drape_summer_leaves(const drape_summer *s, const drape_term *term)
{
    return s->unconstrained && term->ops->constraint;
}

/* ---- Adding a block of elements ---- */

static bool owns(const share *own, int32_t node)
{
    return node >= own->first && node < own->last;
}

static void add_pulls(const drape_term *term, const drape_block *b, const share *own, double *g)
{
    const int32_t *node = term->elements.node + 2 * (size_t)b->first;
    for (int32_t i = 0; i < b->count; i++) {
        double *from = g + 3 * (size_t)node[2 * i], *to = g + 3 * (size_t)node[2 * i + 1];
        const bool owns_from = owns(own, node[2 * i]), owns_to = owns(own, node[2 * i + 1]);
        for (int k = 0; owns_from && k < 3; k++)
            from[k] -= b->gradient[k * DRAPE_BLOCK + i];
        for (int k = 0; owns_to && k < 3; k++)
            to[k] += b->gradient[k * DRAPE_BLOCK + i];
    }
}

static void add_gradients(const drape_term *term, const drape_block *b, const share *own, double *g)
{
    const int n = term->elements.nodes;
    for (int32_t i = 0; i < b->count; i++) {
        const int32_t *node = term->elements.node + (size_t)(b->first + i) * (size_t)n;
        const double *from = b->gradient + drape_block_start(b, i, 3 * n);
        for (int a = 0; a < n; a++) {
            double *to = g + 3 * (size_t)node[a];
            for (int k = 0; owns(own, node[a]) && k < 3; k++)
                to[k] += from[b->stride * (3 * a + k)];
        }
    }
}

static void share_energies(const drape_term *term, const drape_block *b, double *node_energy)
{
    const int n = term->elements.nodes;
    for (int32_t i = 0; i < b->count; i++) {
        const int32_t *node = term->elements.node + (size_t)(b->first + i) * (size_t)n;
        for (int a = 0; a < n; a++)
            node_energy[node[a]] += b->energy[i] / n;
    }
}

/* to(r, c) += sign from(r, c); the rows of `from` are `row` apart, its columns `column`. */
static inline void add_block(const double *from, int row, int column, double sign, double *to, int64_t stride)
{
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++)
            to[c * stride + r] += sign * from[row * r + column * c];
}

/* A column of 3 x 3 blocks in the matrix. */
typedef struct column {
    double *start;
    int64_t stride;
    int32_t first; /* block */
} column;

static inline column column_of(const drape_sums *to, int32_t block_column)
{
    const drape_pattern *p = to->pattern;
    const int32_t first = p->block_start[block_column];
    return (column){.start = to->values + 9 * (int64_t)first,
                    .stride = 3 * (int64_t)(p->block_start[block_column + 1] - first),
                    .first = first};
}

static void add_pair_blocks(const drape_summer *s, const int32_t *block, const drape_term *term,
                            const drape_block *b, const share *own, const drape_sums *to)
{
    const int32_t *node = term->elements.node + 2 * (size_t)b->first;
    for (int32_t i = 0; i < b->count; i++, block += 4)
        for (int c = 0; c < 2; c++) {
            const int32_t at = node[2 * i + c], free = s->model->free_of_node[at];
            if (free < 0 || !owns(own, at))
                continue;
            const column col = column_of(to, free);
            for (int r = 0; r < 2; r++)
                if (block[2 * r + c] >= 0)
                    add_block(b->hessian + i, 3 * DRAPE_BLOCK, DRAPE_BLOCK, r == c ? 1 : -1,
                              col.start + 3 * (block[2 * r + c] - col.first), col.stride);
        }
}

static void add_hessian(const int32_t *block, int n, const drape_block *b, const double *h, int c,
                        const column *col)
{
    const int d = 3 * n, step = b->stride;
    for (int r = 0; r < n; r++) {
        if (block[n * r + c] < 0)
            continue;
        double *to = col->start + 3 * (block[n * r + c] - col->first);
        if (b->mirrored && r < c) /* the transpose of block (c, r) */
            add_block(h + 3 * step * (d * c + r), step, step * d, 1, to, col->stride);
        else
            add_block(h + 3 * step * (d * r + c), step * d, step, 1, to, col->stride);
    }
}

static void add_hessians(const drape_summer *s, const int32_t *block, const drape_term *term,
                         const drape_block *b, const share *own, const drape_sums *to)
{
    const int n = term->elements.nodes;
    for (int32_t i = 0; i < b->count; i++, block += n * n) {
        const int32_t *node = term->elements.node + (size_t)(b->first + i) * (size_t)n;
        const double *h = b->hessian + drape_block_start(b, i, 9 * n * n);
        for (int c = 0; c < n; c++) {
            const int32_t free = s->model->free_of_node[node[c]];
            if (free < 0 || !owns(own, node[c]))
                continue;
            const column col = column_of(to, free);
            add_hessian(block, n, b, h, c, &col);
        }
    }
}

static void add(const drape_summer *s, const drape_term *term, const drape_block *b, const share *own,
                const drape_sums *to)
{
    if (to->g && b->pairs)
        add_pulls(term, b, own, to->g);
    else if (to->g)
        add_gradients(term, b, own, to->g);
    if (!to->values)
        return;
    const size_t pairs = (size_t)(term->elements.nodes * term->elements.nodes);
    const int32_t *block =
        (to->blocks ? to->blocks[term - s->model->terms] : term->block) + (size_t)b->first * pairs;
    if (b->pairs)
        add_pair_blocks(s, block, term, b, own, to);
    else
        add_hessians(s, block, term, b, own, to);
}

/* ---- Sums ---- */

static bool contributes(const drape_summer *s, const drape_term *term, const drape_request *want,
                        const drape_sums *to)
{
    if (term->ops->law || drape_summer_leaves(s, term) || (to->values && !to->g && term->ops->linear))
        return false;
    if (term->ops->measure && want->remainder)
        return false;
    if (term->ops->measure)
        return want->conservative || term->law_count > 0 || term->damping;
    return term->ops->dissipation ? want->dissipative : want->conservative;
}

static void evaluate(const drape_term *term, const drape_request *want, int32_t block, drape_block *b)
{
    b->first = block * DRAPE_BLOCK;
    b->count = elements_in(term, block);
    drape_block_evaluate(term, want, b);
}

static void clear(const drape_summer *s, const share *own, const drape_sums *to)
{
    if (to->g)
        memset(to->g + 3 * (size_t)own->first, 0, 3 * (size_t)(own->last - own->first) * sizeof *to->g);
    for (int32_t node = own->first; to->values && node < own->last; node++)
        if (s->model->free_of_node[node] >= 0) {
            const column col = column_of(to, s->model->free_of_node[node]);
            memset(col.start, 0, 3 * (size_t)col.stride * sizeof *col.start);
        }
}

/* Sums for the nodes of one share, over all blocks of elements that touch them. */
static void add_share(drape_summer *s, const drape_request *want, const drape_sums *to, int thread)
{
    const int64_t nodes = s->model->node_count;
    const share own = {(int32_t)(nodes * thread / s->threads), (int32_t)(nodes * (thread + 1) / s->threads)};
    drape_block *b = &s->blocks[thread];
    clear(s, &own, to);
    for (int32_t i = 0; i < s->model->term_count; i++) {
        const drape_term *term = &s->model->terms[i];
        const reach *reaches = s->reaches ? s->reaches[i] : NULL;
        const bool wanted = !(want->without && want->without[i]) && contributes(s, term, want, to);
        const int32_t blocks = wanted ? block_count(term) : 0;
        for (int32_t k = 0; k < blocks; k++) {
            if (reaches && (reaches[k].high < own.first || reaches[k].low >= own.last))
                continue;
            evaluate(term, want, k, b);
            add(s, term, b, &own, to);
        }
    }
}

/* Writes the stresses of one share of the blocks of each term. */
static void stress_of_share(drape_summer *s, const drape_request *want, int thread)
{
    for (int32_t i = 0; i < s->model->term_count; i++) {
        const drape_term *term = &s->model->terms[i];
        const int64_t blocks = term->ops->measure ? block_count(term) : 0;
        for (int64_t k = blocks * thread / s->threads; k < blocks * (thread + 1) / s->threads; k++)
            evaluate(term, want, (int32_t)k, &s->blocks[thread]);
    }
}

/* Arguments of the tasks. */
typedef struct order {
    drape_summer *summer;
    const drape_request *want;
    const drape_sums *to;
} order;

static void add_task(void *user, int64_t thread)
{
    const order *o = user;
    add_share(o->summer, o->want, o->to, (int)thread);
}

/* The shares are tasks of the pool, not threads: the pool may have fewer threads than there are shares. */
void drape_summer_add(drape_summer *s, const drape_request *want, const drape_sums *to)
{
    drape_parallel(s->pool, s->threads, add_task, &(order){s, want, to});
}

static void stress_task(void *user, int64_t thread)
{
    const order *o = user;
    stress_of_share(o->summer, o->want, (int)thread);
}

void drape_summer_stress(drape_summer *s, const drape_request *want)
{
    drape_parallel(s->pool, s->threads, stress_task, &(order){.summer = s, .want = want});
}

void drape_summer_add_term(drape_summer *s, const drape_term *term, const drape_request *want,
                           const drape_sums *to, double *energy)
{
    const share all = {0, s->model->node_count};
    double sum = 0;
    for (int32_t k = 0; k < block_count(term); k++) {
        evaluate(term, want, k, &s->blocks[0]);
        add(s, term, &s->blocks[0], &all, to);
        if (to->node_energy)
            share_energies(term, &s->blocks[0], to->node_energy);
        for (int32_t i = 0; energy && i < s->blocks[0].count; i++)
            sum += s->blocks[0].energy[i];
    }
    if (energy)
        *energy = sum;
}

void drape_summer_pairs(drape_summer *s, const drape_term *term, const drape_request *want, double *h)
{
    static const int upper[6] = {0, 1, 2, 4, 5, 8};
    drape_block *b = &s->blocks[0];
    for (int32_t k = 0; k < block_count(term); k++) {
        evaluate(term, want, k, b);
        for (int32_t i = 0; i < b->count; i++)
            for (int u = 0; u < 6; u++)
                h[6 * (size_t)(b->first + i) + (size_t)u] = b->hessian[upper[u] * DRAPE_BLOCK + i];
    }
}
