/* system.c: see system.h. A block of elements is evaluated into a buffer (evaluate_*), then added to the
 * result (add_*). */
#include "assemble/system.h"

#include "sparse/project.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#ifdef _OPENMP
#include <omp.h>
#endif

#define BLOCK 32 /* elements evaluated at once: their Hessians (36 KiB for hinges) stay in the cache */
#define D     DRAPE_MAX_ELEMENT_DOFS

/* What a sum over a term is wanted for. */
typedef struct request {
    const drape_point *point;
    bool energy, hessian;
    bool conservative, dissipative; /* which parts of the forces */
    bool project;
    bool velocity; /* the Hessian wanted is dg/dv alone */
} request;

/* Results of a block, element-major with the d of its term, and scratch. */
typedef struct block_buffer {
    int32_t first, count;
    double energy[BLOCK], gradient[BLOCK * D], hessian[BLOCK * D * D];
    double q[BLOCK], dq[BLOCK * D], velocity[BLOCK * D * D];
    bool pairs; /* the result is pull instead: the force on the second node, the first has its */
    double c[BLOCK], pull[3 * BLOCK]; /* opposite; all x, all y, all z */
} block_buffer;
_Static_assert(BLOCK <= DRAPE_PAIR_BLOCK, "rows with pair take a block");

struct drape_system {
    drape_context *ctx;
    const drape_model *model;
    int threads;
    bool unconstrained;           /* terms that are a constraint are left out */
    block_buffer *buffers;        /* (threads) */
    drape_contact *contact;       /* NULL: none */
    const drape_pattern *pattern; /* the model's, or wider */
    drape_pattern wider;          /* with what contact couples */
    int32_t **blocks;    /* (term_count) as in the terms, for the wider one; NULL while there is none */
    drape_status status; /* of placing contact */
};

static void forget_wider(drape_system *system)
{
    for (int32_t i = 0; system->blocks && i < system->model->term_count; i++)
        drape_free(system->ctx, system->blocks[i]);
    drape_free(system->ctx, system->blocks);
    system->blocks = NULL;
    drape_pattern_free(system->ctx, &system->wider);
    system->pattern = &system->model->pattern;
}

drape_status drape_system_create(drape_context *ctx, const drape_model *model, int threads,
                                 drape_system **out)
{
    drape_system *system = drape_alloc(ctx, 1, sizeof *system);
    *out = system;
    if (!system)
        return DRAPE_E_MEMORY;
    *system = (drape_system){.ctx = ctx, .model = model, .threads = threads, .pattern = &model->pattern};
    system->buffers = drape_alloc(ctx, (size_t)threads, sizeof *system->buffers);
    if (!system->buffers)
        drape_system_destroy(out);
    return *out ? DRAPE_OK : DRAPE_E_MEMORY;
}

void drape_system_destroy(drape_system **system)
{
    if (!*system)
        return;
    drape_context *ctx = (*system)->ctx;
    drape_contact_destroy(&(*system)->contact);
    forget_wider(*system);
    drape_free(ctx, (*system)->buffers);
    drape_free(ctx, *system);
    *system = NULL;
}

void drape_system_leave_constraints(drape_system *system)
{
    system->unconstrained = true;
}

static bool is_left_out(const drape_system *system, const drape_term *term)
{
    return system->unconstrained && term->ops->constraint;
}

const drape_model *drape_system_model(const drape_system *system)
{
    return system->model;
}

size_t drape_system_bytes(const drape_system *system)
{
    return sizeof *system + (size_t)system->threads * sizeof *system->buffers +
           drape_contact_bytes(system->contact);
}

/* ---- Contact ---- */

drape_status drape_system_add_contact(drape_system *system)
{
    return drape_contact_create(system->ctx, system->model, &system->contact);
}

const drape_contact *drape_system_contact(const drape_system *system)
{
    return system->contact;
}

drape_status drape_system_begin(drape_system *system, const drape_state *in)
{
    system->status = DRAPE_OK;
    return system->contact ? drape_contact_begin(system->contact, in->x, in->v, in->t) : DRAPE_OK;
}

drape_status drape_system_status(const drape_system *system)
{
    return system->status;
}

const drape_pattern *drape_system_pattern(const drape_system *system)
{
    return system->pattern;
}

/* False where there is no contact, or no memory for it. */
static bool place_contact(drape_system *system, const drape_point *point)
{
    if (!system->contact)
        return false;
    drape_status status = drape_contact_place(
        system->contact,
        &(drape_contact_at){
            .x = point->x, .v = point->v, .t = point->t, .span = {point->span[0], point->span[1]}});
    if (status && !system->status)
        system->status = status;
    return status == DRAPE_OK;
}

/* The places of the terms in the wider pattern. */
static drape_status place_terms(drape_system *system)
{
    const drape_model *model = system->model;
    system->blocks = drape_alloc(system->ctx, (size_t)model->term_count, sizeof *system->blocks);
    if (!system->blocks)
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < model->term_count; i++) {
        if (!drape_term_couples(&model->terms[i]))
            continue;
        const drape_coupling coupling = drape_term_coupling(&model->terms[i]);
        system->blocks[i] =
            drape_alloc(system->ctx, (size_t)coupling.count * (size_t)(coupling.nodes * coupling.nodes),
                        sizeof **system->blocks);
        if (!system->blocks[i])
            return DRAPE_E_MEMORY;
        drape_pattern_place(&system->wider, model->free_of_node, &coupling, system->blocks[i]);
    }
    return DRAPE_OK;
}

static drape_status widen(drape_system *system)
{
    const drape_model *model = system->model;
    const int32_t *nodes = NULL;
    int32_t pairs = drape_contact_couplings(system->contact, &nodes);
    drape_coupling *couplings = drape_alloc(system->ctx, (size_t)model->term_count + 1, sizeof *couplings);
    int count = 0;
    if (pairs < 0 || !couplings) {
        drape_free(system->ctx, couplings);
        return DRAPE_E_MEMORY;
    }
    for (int32_t i = 0; i < model->term_count; i++)
        if (drape_term_couples(&model->terms[i]))
            couplings[count++] = drape_term_coupling(&model->terms[i]);
    couplings[count++] = (drape_coupling){.count = pairs, .nodes = 4, .node = nodes};
    forget_wider(system);
    drape_status status = drape_pattern_build(system->ctx, model->free_count, model->free_of_node, couplings,
                                              count, &system->wider);
    drape_free(system->ctx, couplings);
    if (!status)
        status = place_terms(system);
    if (status) /* the model's own again, which is another one than before, too */
        forget_wider(system);
    else
        system->pattern = &system->wider;
    return status;
}

drape_status drape_system_fit(drape_system *system, const drape_point *point, bool *changed)
{
    *changed = false;
    if (!place_contact(system, point))
        return system->status;
    if (drape_contact_fits(system->contact, system->pattern))
        return DRAPE_OK;
    *changed = true;
    return widen(system);
}

const double *drape_system_on_colliders(const drape_system *system)
{
    return system->contact ? drape_contact_on_colliders(system->contact) : NULL;
}

double drape_system_way(drape_system *system, const double *x, const double *y, double t)
{
    return system->contact ? drape_contact_way(system->contact, x, y, t) : 1;
}

bool drape_system_crosses(drape_system *system, const double *y, double t)
{
    return system->contact && drape_contact_crosses(system->contact, y, t);
}

drape_status drape_system_check_contact(drape_system *system, const double *x, double t, const char **reason,
                                        drape_worst *worst)
{
    return system->contact ? drape_contact_check(system->contact, x, t, reason, worst) : DRAPE_OK;
}

/* ---- Evaluating a block ---- */

/* Generalised force on one measure and its derivatives, summed over elasticity, its own dashpot and laws. */
typedef struct stress {
    double force, by_strain, by_rate, energy;
} stress;

static stress stress_of(const drape_term *term, const request *want, int32_t e, double strain, double rate)
{
    double k = term->elements.rest[e];
    stress s = {0};
    if (want->conservative)
        s = (stress){.force = k * strain, .by_strain = k, .energy = 0.5 * k * strain * strain};
    if (want->dissipative && term->damping) {
        s.force += term->damping[e] * rate;
        s.by_rate = term->damping[e];
    }
    for (int i = 0; i < term->law_count; i++) {
        const drape_term *law = term->laws[i];
        stress one;
        if (law->ops->dissipative ? !want->dissipative : !want->conservative)
            continue;
        law->ops->law(law->params, k, strain, rate, &one.force, &one.by_strain, &one.by_rate, &one.energy);
        s.force += one.force;
        s.by_strain += one.by_strain;
        s.by_rate += one.by_rate;
        s.energy += one.energy;
    }
    return s;
}

static void gather(const drape_elements *el, int32_t element, const double *from, double *local)
{
    const int32_t *node = el->node + (size_t)element * (size_t)el->nodes;
    for (int a = 0; a < el->nodes; a++)
        memcpy(local + 3 * a, from + 3 * (size_t)node[a], 3 * sizeof *local);
}

/* dg/dv of one measure: df/dq' dq dq' */
static void measure_damping(int d, const stress *s, const double *dq, double *h)
{
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++)
            h[d * i + j] = s->by_rate * dq[i] * dq[j];
}

/* h, which holds the Hessian of q on entry, becomes
 *     H = f ddq + (df/dq + w df/dq') dq dq'                       step methods: q' = w q + history
 *     H = f ddq + df/dq dq dq' + df/dq' dq (ddq v + w dq)'        continuous time: q' = dq . v
 */
static void measure_hessian(int d, const drape_point *point, const stress *s, const double *dq,
                            const double *v, double *h)
{
    double along[D] = {0};
    if (!point->history && s->by_rate != 0)
        for (int i = 0; i < d; i++)
            for (int j = 0; j < d; j++)
                along[i] += s->by_rate * h[d * i + j] * v[j];
    double weight = s->by_strain + point->weight * s->by_rate;
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++)
            h[d * i + j] = s->force * h[d * i + j] + dq[i] * (weight * dq[j] + along[j]);
}

/* The positive semidefinite part of that which is known without eigenvalues: f ddq where the measure is convex
 * and pulls, and the Gauss-Newton part (Teran et al. 2005; Tamstorf & Grinspun 2013, 5). */
static void positive_measure_hessian(int d, const drape_point *point, const stress *s, bool convex,
                                     const double *dq, double *h)
{
    double weight = fmax(0, s->by_strain + point->weight * s->by_rate);
    double force = convex ? fmax(0, s->force) : 0;
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++)
            h[d * i + j] = force * h[d * i + j] + weight * dq[i] * dq[j];
}

static double dot(int d, const double *a, const double *b)
{
    double sum = 0;
    for (int i = 0; i < d; i++)
        sum += a[i] * b[i];
    return sum;
}

static void evaluate_measure(const drape_term *term, const request *want, block_buffer *b)
{
    const drape_elements *el = &term->elements;
    const drape_point *point = want->point;
    int d = 3 * el->nodes;
    const double *internal = term->first_internal >= 0 ? point->internal + term->first_internal : NULL;
    bool rates = term->law_count > 0 || term->damping;
    term->ops->measure(el, b->first, b->count, point->x, internal, b->q, b->dq,
                       want->hessian && !want->velocity ? b->hessian : NULL);
    for (int32_t i = 0; i < b->count; i++) {
        int32_t e = b->first + i;
        double strain = b->q[i] - el->rest[(size_t)el->count + (size_t)e], rate = 0, v[D];
        double *dq = b->dq + (size_t)i * (size_t)d;
        if (rates && point->history)
            rate = point->weight * b->q[i] + point->history[term->first_measure + e];
        else if (rates) {
            gather(el, e, point->v, v);
            rate = dot(d, dq, v);
        }
        stress s = stress_of(term, want, e, strain, rate);
        b->energy[i] = s.energy;
        for (int j = 0; j < d; j++)
            b->gradient[i * d + j] = s.force * dq[j];
        if (want->velocity)
            measure_damping(d, &s, dq, b->hessian + (size_t)i * (size_t)(d * d));
        else if (want->hessian && want->project)
            positive_measure_hessian(d, point, &s, term->ops->convex, dq,
                                     b->hessian + (size_t)i * (size_t)(d * d));
        else if (want->hessian)
            measure_hessian(d, point, &s, dq, v, b->hessian + (size_t)i * (size_t)(d * d));
    }
}

/* Forces on the measures of pairs, in b->q, which has their values on entry. */
static void pair_stresses(const drape_term *term, const request *want, block_buffer *b)
{
    const drape_elements *el = &term->elements;
    const drape_point *point = want->point;
    const double *k = el->rest + b->first, *q0 = el->rest + (size_t)el->count + b->first;
    if (term->law_count == 0 && !term->damping) {
        for (int32_t i = 0; i < b->count; i++)
            b->q[i] = k[i] * (b->q[i] - q0[i]);
        return;
    }
    for (int32_t i = 0; i < b->count; i++) {
        const int32_t *node = el->node + 2 * (size_t)(b->first + i);
        double rate = 0;
        if (point->history)
            rate = point->weight * b->q[i] + point->history[term->first_measure + b->first + i];
        else
            for (int r = 0; r < 3; r++)
                rate +=
                    b->c[i] * b->pull[r * b->count + i] *
                    (point->v[3 * (size_t)node[1] + (size_t)r] - point->v[3 * (size_t)node[0] + (size_t)r]);
        b->q[i] = stress_of(term, want, b->first + i, b->q[i] - q0[i], rate).force;
    }
}

/* Forces of a measure of pairs: half of the numbers of a gradient, and loops without calls. */
static void evaluate_pairs(const drape_term *term, const request *want, block_buffer *b)
{
    term->ops->pair(&term->elements, b->first, b->count, want->point->x, b->q, b->pull, b->c);
    pair_stresses(term, want, b);
    for (int32_t i = 0; i < b->count; i++)
        b->c[i] *= b->q[i];
    for (int r = 0; r < 3; r++)
        for (int32_t i = 0; i < b->count; i++)
            b->pull[r * b->count + i] *= b->c[i];
}

static void evaluate_energy(const drape_term *term, const request *want, block_buffer *b)
{
    const double *internal = term->first_internal >= 0 ? want->point->internal + term->first_internal : NULL;
    term->ops->energy(&term->elements, b->first, b->count, want->point->x, internal, b->energy, b->gradient,
                      want->hessian ? b->hessian : NULL);
}

static void evaluate_dissipation(const drape_term *term, const request *want, block_buffer *b)
{
    int d = 3 * term->elements.nodes;
    bool hessian = want->hessian;
    memset(b->energy, 0, (size_t)b->count * sizeof *b->energy);
    term->ops->dissipation(&term->elements, b->first, b->count, want->point->x, want->point->v, b->gradient,
                           hessian ? b->hessian : NULL, hessian ? b->velocity : NULL);
    for (int i = 0; hessian && i < b->count * d * d; i++)
        b->hessian[i] =
            want->velocity ? b->velocity[i] : b->hessian[i] + want->point->weight * b->velocity[i];
}

static void evaluate(const drape_term *term, const request *want, block_buffer *b)
{
    b->pairs = term->ops->pair && !want->hessian && !want->energy;
    if (b->pairs)
        evaluate_pairs(term, want, b);
    else if (term->ops->measure)
        evaluate_measure(term, want, b);
    else if (term->ops->energy)
        evaluate_energy(term, want, b);
    else
        evaluate_dissipation(term, want, b);
    int d = 3 * term->elements.nodes;
    bool given = term->ops->measure; /* as its positive part already */
    for (int32_t i = 0; want->hessian && want->project && !given && i < b->count; i++)
        drape_project(d, b->hessian + (size_t)i * (size_t)(d * d));
}

/* ---- Adding a block ---- */

/* Where sums go; NULL: not wanted. */
typedef struct sums {
    double *energy, *g, *values;
} sums;

static void add_pulls(const drape_elements *el, const block_buffer *b, double *g)
{
    const int32_t *node = el->node + 2 * (size_t)b->first;
    const double *px = b->pull, *py = px + b->count, *pz = py + b->count;
    for (int32_t i = 0; i < b->count; i++) {
        double *a = g + 3 * (size_t)node[2 * i], *c = g + 3 * (size_t)node[2 * i + 1];
        a[0] -= px[i];
        a[1] -= py[i];
        a[2] -= pz[i];
        c[0] += px[i];
        c[1] += py[i];
        c[2] += pz[i];
    }
}

static void add_gradients(const drape_elements *el, const block_buffer *b, double *g)
{
    for (int32_t i = 0; i < b->count; i++) {
        const int32_t *node = el->node + (size_t)(b->first + i) * (size_t)el->nodes;
        const double *from = b->gradient + (size_t)i * 3 * (size_t)el->nodes;
        for (int a = 0; a < el->nodes; a++)
            for (int k = 0; k < 3; k++)
                g[3 * (size_t)node[a] + (size_t)k] += from[3 * a + k];
    }
}

static void add_block(const double *from, int d, double *to, int64_t stride)
{
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++)
            to[c * stride + r] += from[d * r + c];
}

static void add_hessians(const drape_system *system, const drape_term *term, const block_buffer *b,
                         double *values)
{
    const drape_model *model = system->model;
    const drape_elements *el = &term->elements;
    const int32_t *blocks = system->blocks ? system->blocks[term - model->terms] : term->block;
    int n = el->nodes, d = 3 * n;
    for (int32_t i = 0; i < b->count; i++) {
        size_t e = (size_t)(b->first + i);
        const int32_t *node = el->node + e * (size_t)n, *block = blocks + e * (size_t)(n * n);
        const double *h = b->hessian + (size_t)i * (size_t)(d * d);
        for (int r = 0; r < n; r++)
            for (int c = 0; c < n; c++) {
                int64_t stride;
                if (block[n * r + c] < 0)
                    continue;
                double *to = drape_pattern_at(system->pattern, values, model->free_of_node[node[c]],
                                              block[n * r + c], &stride);
                add_block(h + 3 * (d * r + c), d, to, stride);
            }
    }
}

static void add(const drape_system *system, const drape_term *term, const block_buffer *b, const sums *to)
{
    for (int32_t i = 0; to->energy && i < b->count; i++)
        *to->energy += b->energy[i];
    if (to->g && b->pairs)
        add_pulls(&term->elements, b, to->g);
    else if (to->g)
        add_gradients(&term->elements, b, to->g);
    if (to->values)
        add_hessians(system, term, b, to->values);
}

/* ---- Sums over terms ---- */

static bool contributes(const drape_term *term, const request *want, const sums *to)
{
    if (term->ops->law || (to->values && !to->g && !to->energy && term->ops->linear))
        return false;
    if (term->ops->measure)
        return want->conservative || term->law_count > 0 || term->damping;
    return term->ops->dissipation ? want->dissipative : want->conservative;
}

static void evaluate_block(const drape_term *term, const request *want, int32_t k, block_buffer *b)
{
    int32_t left = term->elements.count - k * BLOCK;
    b->first = k * BLOCK;
    b->count = left < BLOCK ? left : BLOCK;
    evaluate(term, want, b);
}

#ifdef _OPENMP
/* Blocks are evaluated by whoever is free next and added in order. */
static void sum_in_parallel(drape_system *system, const drape_term *term, const request *want, const sums *to,
                            int32_t blocks)
{
#pragma omp parallel for ordered schedule(static, 1) num_threads(system->threads)
    for (int32_t k = 0; k < blocks; k++) {
        block_buffer *b = &system->buffers[omp_get_thread_num()];
        evaluate_block(term, want, k, b);
#pragma omp ordered
        add(system, term, b, to);
    }
}
#endif

/* One thread takes a plain loop: a parallel region of one thread costs libgomp a heap call. */
static void sum_term(drape_system *system, const drape_term *term, const request *want, const sums *to)
{
    int32_t blocks = (term->elements.count + BLOCK - 1) / BLOCK;
#ifdef _OPENMP
    if (system->threads > 1 && blocks > 1) {
        sum_in_parallel(system, term, want, to, blocks);
        return;
    }
#endif
    for (int32_t k = 0; k < blocks; k++) {
        evaluate_block(term, want, k, &system->buffers[0]);
        add(system, term, &system->buffers[0], to);
    }
}

static void sum_terms(drape_system *system, const request *want, const sums *to)
{
    for (int32_t i = 0; i < system->model->term_count; i++)
        if (!is_left_out(system, &system->model->terms[i]) && contributes(&system->model->terms[i], want, to))
            sum_term(system, &system->model->terms[i], want, to);
}

void drape_system_force(drape_system *system, const drape_point *point, double *g)
{
    memset(g, 0, 3 * (size_t)system->model->node_count * sizeof *g);
    sum_terms(system, &(request){.point = point, .conservative = true, .dissipative = true}, &(sums){.g = g});
    if (place_contact(system, point))
        drape_contact_add_forces(system->contact, true, true, g);
}

void drape_system_dissipation(drape_system *system, const drape_point *point, double *g)
{
    memset(g, 0, 3 * (size_t)system->model->node_count * sizeof *g);
    sum_terms(system, &(request){.point = point, .dissipative = true}, &(sums){.g = g});
    if (place_contact(system, point))
        drape_contact_add_forces(system->contact, false, true, g);
}

static void add_masses(const drape_system *system, double mass_weight, double *values)
{
    const drape_model *model = system->model;
    const drape_pattern *pattern = system->pattern;
    for (int32_t j = 0; j < model->free_count; j++) {
        int64_t stride;
        double *to = drape_pattern_at(pattern, values, j, pattern->diagonal[j], &stride);
        for (int c = 0; c < 3; c++)
            to[c * stride + c] += mass_weight * model->mass[model->node_of_free[j]];
    }
}

void drape_system_jacobian(drape_system *system, const drape_point *point, double mass_weight, bool project,
                           double *values)
{
    const request want = {
        .point = point, .hessian = true, .conservative = true, .dissipative = true, .project = project};
    memset(values, 0, (size_t)system->pattern->nonzeros * sizeof *values);
    sum_terms(system, &want, &(sums){.values = values});
    if (place_contact(system, point))
        drape_contact_add_jacobian(system->contact, point->weight, false, project, system->pattern, values);
    add_masses(system, mass_weight, values);
}

void drape_system_damping(drape_system *system, const drape_point *point, double *values)
{
    const request want = {.point = point, .hessian = true, .velocity = true, .dissipative = true};
    memset(values, 0, (size_t)system->pattern->nonzeros * sizeof *values);
    sum_terms(system, &want, &(sums){.values = values});
    if (place_contact(system, point))
        drape_contact_add_jacobian(system->contact, 0, true, false, system->pattern, values);
}

double drape_system_contact_energy(drape_system *system, const drape_point *point)
{
    return place_contact(system, point) ? drape_contact_potential(system->contact) : 0;
}

void drape_system_contact_part(drape_system *system, const drape_point *point, bool friction, double *g,
                               double *values)
{
    if (g)
        memset(g, 0, 3 * (size_t)system->model->node_count * sizeof *g);
    if (values)
        memset(values, 0, (size_t)system->pattern->nonzeros * sizeof *values);
    if (!place_contact(system, point))
        return;
    if (g)
        drape_contact_add_forces(system->contact, true, friction, g);
    if (values)
        drape_contact_add_jacobian(system->contact, point->weight, false, false, system->pattern, values);
}

void drape_system_energy(drape_system *system, const drape_point *point, double *elastic, double *gravity)
{
    const request want = {.point = point, .energy = true, .conservative = true};
    *elastic = *gravity = 0;
    for (int32_t i = 0; i < system->model->term_count; i++) {
        const drape_term *term = &system->model->terms[i];
        const sums to = {.energy = term->ops->potential_of_gravity ? gravity : elastic};
        if (!is_left_out(system, term) && contributes(term, &want, &to))
            sum_term(system, term, &want, &to);
    }
}

void drape_system_term(drape_system *system, int32_t term, const drape_point *point, double *energy,
                       double *g, double *values)
{
    const drape_term *t = &system->model->terms[term];
    const request want = {
        .point = point, .energy = energy, .hessian = values, .conservative = true, .dissipative = true};
    const sums to = {.energy = energy, .g = g, .values = t->block ? values : NULL};
    if (energy)
        *energy = 0;
    if (!t->ops->law && !is_left_out(system, t))
        sum_term(system, t, &want, &to);
}

void drape_system_measures(drape_system *system, const drape_point *point, double *q)
{
    for (int32_t i = 0; i < system->model->term_count; i++) {
        const drape_term *term = &system->model->terms[i];
        if (!term->ops->measure)
            continue;
        const double *internal = term->first_internal >= 0 ? point->internal + term->first_internal : NULL;
        term->ops->measure(&term->elements, 0, term->elements.count, point->x, internal,
                           q + term->first_measure, NULL, NULL);
    }
}

/* ---- Finding what is wrong ---- */

static drape_worst worst_element(const drape_term *term, const drape_fault *fault)
{
    const drape_elements *el = &term->elements;
    drape_worst worst = {.what = fault->what,
                         .term = term->ops->name,
                         .element = fault->element,
                         .node = {-1, -1, -1, -1},
                         .cloth = term->cloth,
                         .value = fault->value,
                         .limit = fault->limit};
    for (int a = 0; fault->element >= 0 && a < el->nodes && a < 4; a++)
        worst.node[a] = el->node[(size_t)fault->element * (size_t)el->nodes + (size_t)a];
    return worst;
}

drape_status drape_system_check(const drape_system *system, const double *x, const double *before,
                                const double *internal, const char **reason, drape_worst *worst)
{
    for (int32_t i = 0; i < system->model->term_count; i++) {
        const drape_term *term = &system->model->terms[i];
        drape_fault fault;
        if (!term->ops->check || is_left_out(system, term))
            continue;
        const double *own = term->first_internal >= 0 ? internal + term->first_internal : NULL;
        drape_status status = term->ops->check(&term->elements, x, before, own, &fault);
        if (status) {
            *reason = fault.reason;
            *worst = worst_element(term, &fault);
            return status;
        }
    }
    return DRAPE_OK;
}

drape_worst drape_system_worst_dof(const drape_system *system, const double *free_vector, const char *what,
                                   double limit)
{
    const drape_model *model = system->model;
    int64_t worst = 0;
    for (int64_t i = 0; i < 3 * (int64_t)model->free_count; i++) {
        if (!isfinite(free_vector[i])) {
            worst = i;
            break;
        }
        if (fabs(free_vector[i]) > fabs(free_vector[worst]))
            worst = i;
    }
    int32_t node = model->free_count > 0 ? model->node_of_free[worst / 3] : -1;
    return (drape_worst){.what = what,
                         .term = "",
                         .element = -1,
                         .node = {node, -1, -1, -1},
                         .cloth = node >= 0 ? drape_model_cloth_of(model, node) : -1,
                         .value = model->free_count > 0 ? fabs(free_vector[worst]) : 0,
                         .limit = limit};
}
