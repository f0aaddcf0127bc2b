/* sum.c: see sum.h. */
#include "assemble/sum.h"

#include "assemble/term_parts.h"

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
    bool unconstrained, lossless;
    drape_block *blocks;      /* (threads) */
    reach **reaches;          /* (term_count) of the blocks of each term's pieces; NULL: one thread */
    reach **patches;          /* (term_count) of the blocks of its patches; NULL: one thread */
    drape_parts_work **parts; /* (term_count) NULL: the term has no parts */
    bool has_parts;
};

/* The pieces of a term are its elements or, if it has parts, the parts; patches are put in blocks, too. */
static int32_t blocks_of(int32_t count)
{
    return (count + DRAPE_BLOCK - 1) / DRAPE_BLOCK;
}

static int32_t count_in(int32_t count, int32_t block)
{
    int32_t left = count - block * DRAPE_BLOCK;
    return left < DRAPE_BLOCK ? left : DRAPE_BLOCK;
}

static int32_t block_count(const drape_term *term)
{
    return blocks_of(drape_term_pieces(term).count);
}

/* ---- Creation ---- */

static reach *reaches_of(drape_arena *arena, const drape_coupling *pieces)
{
    reach *of = drape_arena_take(arena, (size_t)blocks_of(pieces->count), sizeof *of);
    for (int32_t k = 0; of && k < blocks_of(pieces->count); k++) {
        const int32_t *node = pieces->node + (size_t)k * DRAPE_BLOCK * (size_t)pieces->nodes;
        reach r = {node[0], node[0]};
        for (int32_t i = 1; i < count_in(pieces->count, k) * pieces->nodes; i++) {
            r.low = node[i] < r.low ? node[i] : r.low;
            r.high = node[i] > r.high ? node[i] : r.high;
        }
        of[k] = r;
    }
    return of;
}

drape_status drape_summer_create(drape_arena *arena, const drape_model *model, drape_pool *pool,
                                 drape_summer **out)
{
    drape_summer *s = *out = drape_arena_take(arena, 1, sizeof *s);
    if (!s)
        return DRAPE_E_MEMORY;
    *s = (drape_summer){.model = model, .pool = pool, .threads = drape_pool_threads(pool)};
    s->blocks = drape_arena_take(arena, (size_t)s->threads, sizeof *s->blocks);
    s->parts = drape_arena_take(arena, (size_t)s->model->term_count, sizeof *s->parts);
    for (int32_t i = 0; s->parts && i < s->model->term_count; i++) {
        s->parts[i] = drape_parts_create(arena, &s->model->terms[i]);
        s->has_parts = s->has_parts || s->parts[i];
    }
    if (s->threads > 1 && s->parts) {
        const size_t terms = (size_t)s->model->term_count;
        s->reaches = drape_arena_take(arena, terms, sizeof *s->reaches);
        s->patches = drape_arena_take(arena, terms, sizeof *s->patches);
        for (size_t i = 0; s->reaches && s->patches && i < terms; i++) {
            const drape_coupling pieces = drape_term_pieces(&s->model->terms[i]),
                                 patches = drape_term_patches(&s->model->terms[i]);
            s->reaches[i] = reaches_of(arena, &pieces);
            if (s->parts[i])
                s->patches[i] = reaches_of(arena, &patches);
        }
    }
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

void drape_summer_leave_losses(drape_summer *s)
{
    s->lossless = true;
}

static drape_request as_left(const drape_summer *s, const drape_request *want)
{
    drape_request left = *want;
    left.lossless = s->lossless;
    return left;
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

static void add_gradients(const drape_coupling *pieces, const drape_block *b, const share *own, double *g)
{
    const int n = pieces->nodes;
    for (int32_t i = 0; i < b->count; i++) {
        const int32_t *node = pieces->node + (size_t)(b->first + i) * (size_t)n;
        const double *from = b->gradient + drape_block_start(b, i, 3 * n);
        for (int a = 0; a < n; a++) {
            double *to = g + 3 * (size_t)node[a];
            for (int k = 0; owns(own, node[a]) && k < 3; k++)
                to[k] += from[b->stride * (3 * a + k)];
        }
    }
}

/* to(r, c) += sign from(r, c); the rows of `from` are `row` apart, its columns `column`. */
static inline void add_block(const double *from, int row, int column, double sign, double *to, int64_t stride)
{
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++)
            to[c * stride + r] += sign * from[row * r + column * c];
}

static inline drape_block_column column_of(const drape_sums *to, int32_t block_column)
{
    const drape_pattern *p = to->pattern;
    const int32_t first = p->block_start[block_column];
    return (drape_block_column){.start = to->values + 9 * (int64_t)first,
                                .stride = 3 * (int64_t)(p->block_start[block_column + 1] - first),
                                .first = first,
                                .wanted = true};
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
            const drape_block_column col = column_of(to, free);
            for (int r = 0; r < 2; r++)
                if (block[2 * r + c] >= 0)
                    add_block(b->hessian + i, 3 * DRAPE_BLOCK, DRAPE_BLOCK, r == c ? 1 : -1,
                              col.start + 3 * (block[2 * r + c] - col.first), col.stride);
        }
}

static void add_hessian(const int32_t *block, int n, const drape_block *b, const double *h, int c,
                        const drape_block_column *col)
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

static void add_hessians(const drape_summer *s, const int32_t *block, const drape_coupling *pieces,
                         const drape_block *b, const share *own, const drape_sums *to)
{
    const int n = pieces->nodes;
    for (int32_t i = 0; i < b->count; i++, block += n * n) {
        const int32_t *node = pieces->node + (size_t)(b->first + i) * (size_t)n;
        const double *h = b->hessian + drape_block_start(b, i, 9 * n * n);
        for (int c = 0; c < n; c++) {
            const int32_t free = s->model->free_of_node[node[c]];
            if (free < 0 || !owns(own, node[c]))
                continue;
            const drape_block_column col = column_of(to, free);
            add_hessian(block, n, b, h, c, &col);
        }
    }
}

static const int32_t *slots_of(const drape_summer *s, const drape_term *term, const drape_sums *to)
{
    return to->blocks ? to->blocks[term - s->model->terms] : term->block;
}

static void add(const drape_summer *s, const drape_term *term, const drape_block *b, const share *own,
                const drape_sums *to)
{
    const drape_coupling pieces = drape_term_pieces(term);
    if (to->g && b->pairs)
        add_pulls(term, b, own, to->g);
    else if (to->g)
        add_gradients(&pieces, b, own, to->g);
    if (!to->values || b->flat)
        return;
    const int32_t *block = slots_of(s, term, to) + (size_t)b->first * (size_t)(pieces.nodes * pieces.nodes);
    if (b->pairs)
        add_pair_blocks(s, block, term, b, own, to);
    else
        add_hessians(s, block, &pieces, b, own, to);
}

/* Adds one block of patches to the matrix. */
static void add_patches(const drape_summer *s, const drape_term *term, const drape_request *want,
                        int32_t block, const share *own, const drape_sums *to)
{
    const drape_patches *p = &term->patches;
    const size_t n = (size_t)term->elements.nodes;
    const drape_parts_work *work = s->parts[term - s->model->terms];
    const int32_t *slots = slots_of(s, term, to) + drape_term_piece_places(term);
    const int32_t first = block * DRAPE_BLOCK, last = first + count_in(p->count, block);
    for (int32_t i = first; i < last; i++) {
        drape_block_column columns[DRAPE_MAX_ELEMENT_NODES];
        for (int a = 0; a < p->used[i]; a++) {
            const int32_t node = p->node[(size_t)i * n + (size_t)a], free = s->model->free_of_node[node];
            columns[a] =
                free >= 0 && owns(own, node) ? column_of(to, free) : (drape_block_column){.wanted = false};
        }
        drape_patch_add(term, want, work, i, slots + (size_t)i * n * n, columns);
    }
}

/* ---- Sums ---- */

static bool is_wanted(const drape_summer *s, int32_t number, const drape_request *want, const drape_sums *to)
{
    const drape_term *term = &s->model->terms[number];
    if ((want->without && want->without[number]) || term->ops->law || drape_summer_leaves(s, term) ||
        (to->values && !to->g && term->ops->linear))
        return false;
    if (want->momentum)
        return term->ops->kinetic;
    if (term->ops->measure && want->remainder)
        return false;
    if (term->ops->measure)
        return want->conservative || drape_block_has_rates(term, want);
    return term->ops->dissipation ? want->dissipative || (term->ops->kinetic && want->conservative)
                                  : want->conservative;
}

/* Evaluates one block of pieces. Of a term with parts, those were prepared. */
static void evaluate(const drape_summer *s, const drape_term *term, const drape_request *want, int32_t block,
                     drape_block *b)
{
    const drape_parts_work *work = s->parts[term - s->model->terms];
    b->first = block * DRAPE_BLOCK;
    b->count = count_in(drape_term_pieces(term).count, block);
    if (work)
        drape_parts_evaluate(term, want, work, b);
    else
        drape_block_evaluate(term, want, b);
}

static bool touches(const reach *reaches, int32_t block, const share *own)
{
    return !reaches || (reaches[block].high >= own->first && reaches[block].low < own->last);
}

/* Sums for the nodes of one share, over all blocks of pieces and patches that touch them. */
static void add_share(drape_summer *s, const drape_request *want, const drape_sums *to, int thread)
{
    const int64_t nodes = s->model->node_count;
    const share own = {(int32_t)(nodes * thread / s->threads), (int32_t)(nodes * (thread + 1) / s->threads)};
    drape_block *b = &s->blocks[thread];
    if (to->g)
        memset(to->g + 3 * (size_t)own.first, 0, 3 * (size_t)(own.last - own.first) * sizeof *to->g);
    for (int32_t node = own.first; to->values && node < own.last; node++)
        if (s->model->free_of_node[node] >= 0) {
            const drape_block_column col = column_of(to, s->model->free_of_node[node]);
            memset(col.start, 0, 3 * (size_t)col.stride * sizeof *col.start);
        }
    for (int32_t i = 0; i < s->model->term_count; i++) {
        const drape_term *term = &s->model->terms[i];
        if (!is_wanted(s, i, want, to))
            continue;
        for (int32_t k = 0; k < block_count(term); k++) {
            if (!touches(s->reaches ? s->reaches[i] : NULL, k, &own))
                continue;
            evaluate(s, term, want, k, b);
            add(s, term, b, &own, to);
        }
        for (int32_t k = 0; to->values && k < blocks_of(term->patches.count); k++)
            if (touches(s->patches ? s->patches[i] : NULL, k, &own))
                add_patches(s, term, want, k, &own, to);
    }
}

/* Arguments of the tasks. */
typedef struct order {
    drape_summer *summer;
    const drape_request *want;
    const drape_sums *to; /* NULL: only stresses are wanted */
} order;

/* Calls run for one share of the blocks of count items of each term with parts that is wanted. */
typedef void drape_parts_stage(const drape_term *term, const drape_request *want, int32_t block,
                               drape_block *b, drape_parts_work *work);

static void run_stage(const order *o, int64_t thread, bool of_parts, drape_parts_stage *run)
{
    drape_summer *s = o->summer;
    for (int32_t i = 0; i < s->model->term_count; i++) {
        const drape_term *term = &s->model->terms[i];
        if (!s->parts[i] || (o->to && !is_wanted(s, i, o->want, o->to)))
            continue;
        const int64_t blocks = blocks_of(of_parts ? term->parts.count : term->elements.count);
        for (int64_t k = blocks * thread / s->threads; k < blocks * (thread + 1) / s->threads; k++)
            run(term, o->want, (int32_t)k, &s->blocks[thread], s->parts[i]);
    }
}

static void measure_task(void *user, int64_t thread)
{
    run_stage(user, thread, true, drape_parts_measure);
}

static void forces_task(void *user, int64_t thread)
{
    run_stage(user, thread, false, drape_parts_stress);
}

/* All parts, then the forces on all their elements. */
static void prepare_parts(drape_summer *s, order *o)
{
    if (!s->has_parts)
        return;
    drape_parallel(s->pool, s->threads, measure_task, o);
    drape_parallel(s->pool, s->threads, forces_task, o);
}

/* The same for one term, on the calling thread. */
static void prepare_term(drape_summer *s, const drape_term *term, const drape_request *want)
{
    drape_parts_work *work = s->parts[term - s->model->terms];
    for (int32_t k = 0; work && k < blocks_of(term->parts.count); k++)
        drape_parts_measure(term, want, k, &s->blocks[0], work);
    for (int32_t k = 0; work && k < blocks_of(term->elements.count); k++)
        drape_parts_stress(term, want, k, &s->blocks[0], work);
}

static void add_task(void *user, int64_t thread)
{
    const order *o = user;
    add_share(o->summer, o->want, o->to, (int)thread);
}

/* The shares are tasks of the pool, not threads: the pool may have fewer threads than there are shares. */
void drape_summer_add(drape_summer *s, const drape_request *want, const drape_sums *to)
{
    const drape_request left = as_left(s, want);
    order o = {s, &left, to};
    prepare_parts(s, &o);
    drape_parallel(s->pool, s->threads, add_task, &o);
}

/* Writes the stresses of one share of the blocks of each term without parts. */
static void stress_task(void *user, int64_t thread)
{
    const order *o = user;
    drape_summer *s = o->summer;
    for (int32_t i = 0; i < s->model->term_count; i++) {
        const drape_term *term = &s->model->terms[i];
        const int64_t blocks = term->ops->measure && !s->parts[i] ? block_count(term) : 0;
        for (int64_t k = blocks * thread / s->threads; k < blocks * (thread + 1) / s->threads; k++)
            evaluate(s, term, o->want, (int32_t)k, &s->blocks[thread]);
    }
}

void drape_summer_stress(drape_summer *s, const drape_request *want)
{
    const drape_request left = as_left(s, want);
    order o = {.summer = s, .want = &left};
    prepare_parts(s, &o);
    drape_parallel(s->pool, s->threads, stress_task, &o);
}

/* Whether the energy of an element counts here, or on another rank. */
static bool is_counted(const drape_term *term, int32_t piece)
{
    return !term->counted || term->counted[piece];
}

void drape_summer_add_term(drape_summer *s, const drape_term *term, const drape_request *asked,
                           const drape_sums *to, double *energy)
{
    const drape_request left = as_left(s, asked), *want = &left;
    const share all = {0, s->model->node_count};
    const drape_parts_work *work = s->parts[term - s->model->terms];
    const drape_patches *p = &term->patches;
    const int32_t n = term->elements.nodes, *node = term->elements.node;
    double sum = 0;
    prepare_term(s, term, want);
    for (int32_t k = 0; (!work || to->g || to->values) && k < block_count(term); k++) {
        evaluate(s, term, want, k, &s->blocks[0]);
        add(s, term, &s->blocks[0], &all, to);
        for (int32_t i = 0; to->node_energy && !work && i < s->blocks[0].count; i++)
            for (int a = 0; a < n; a++)
                to->node_energy[node[(size_t)n * (size_t)(s->blocks[0].first + i) + (size_t)a]] +=
                    s->blocks[0].energy[i] / n;
        for (int32_t i = 0; energy && !work && i < s->blocks[0].count; i++)
            if (is_counted(term, s->blocks[0].first + i))
                sum += s->blocks[0].energy[i];
    }
    for (int32_t k = 0; to->values && k < blocks_of(term->patches.count); k++)
        add_patches(s, term, want, k, &all, to);
    for (int32_t i = 0; to->node_energy && work && i < p->count;
         i++) /* the first `used` nodes of a patch are all */
        for (int32_t e = p->first[i]; e < p->first[i + 1]; e++)
            for (int a = 0; a < p->used[i]; a++)
                to->node_energy[p->node[(size_t)i * (size_t)n + (size_t)a]] += work->energy[e] / p->used[i];
    for (int32_t e = 0; energy && work && e < term->elements.count; e++)
        if (is_counted(term, e))
            sum += work->energy[e];
    if (energy)
        *energy = sum;
}

double drape_summer_turning_power(drape_summer *s, const drape_term *term, const drape_request *want)
{
    const drape_request left = as_left(s, want);
    prepare_term(s, term, &left);
    return drape_parts_turning_power(term, want->point, s->parts[term - s->model->terms]);
}

void drape_summer_measure(drape_summer *s, const drape_term *term, const drape_point *point, double *q)
{
    const drape_request want = {.point = point, .conservative = true};
    drape_parts_work *work = s->parts[term - s->model->terms];
    const double *internal = drape_term_own(term, point->internal);
    if (!work) {
        term->ops->measure(&term->elements, 0, term->elements.count, point->x, internal, q, NULL, NULL);
        return;
    }
    for (int32_t k = 0; k < blocks_of(term->parts.count); k++)
        drape_parts_measure(term, &want, k, &s->blocks[0], work);
    for (int32_t e = 0; e < term->elements.count; e++)
        q[e] = drape_parts_combine(&term->parts, e, work->s);
}

void drape_summer_pairs(drape_summer *s, const drape_term *term, const drape_request *want, double *h)
{
    static const int upper[6] = {0, 1, 2, 4, 5, 8};
    drape_block *b = &s->blocks[0];
    for (int32_t k = 0; k < block_count(term); k++) {
        evaluate(s, term, want, k, b);
        for (int32_t i = 0; i < b->count; i++)
            for (int u = 0; u < 6; u++)
                h[6 * (size_t)(b->first + i) + (size_t)u] = b->hessian[upper[u] * DRAPE_BLOCK + i];
    }
}
