/* block.c: see block.h. */
#include "assemble/block.h"

#include "base/lanes.h"
#include "model/history.h"
#include "model/slider.h"
#include "sparse/project.h"

#define D DRAPE_MAX_ELEMENT_DOFS
#define N DRAPE_BLOCK

_Static_assert(LANES == DRAPE_LANES, "terms with lanes fill one vector");

/* ---- Forces on measures ---- */

static int law_count(const drape_term *term, const drape_request *want)
{
    return want->lossless ? term->own_law_count : term->law_count;
}

bool drape_block_has_rates(const drape_term *term, const drape_request *want)
{
    return law_count(term, want) > 0 || term->damping;
}

/* q' = w q + history: the rates of step methods. */
static void rates_of_history(const drape_term *term, const drape_request *want, drape_block *b)
{
    const double *history = want->point->history + term->first_measure + b->first;
    for (int32_t i = 0; i < b->count; i++)
        b->rate[i] = want->point->weight * b->q[i] + history[i];
}

/* Generalised forces on the measures, their derivatives and energies, from q and its rate. */
static void sum_stresses(const drape_term *term, const drape_request *want, drape_block *b)
{
    const drape_elements *el = &term->elements;
    const double *k = el->rest + b->first, *q0 = el->rest + (size_t)el->count + b->first;
    const double elastic = want->conservative;
    for (int32_t i = 0; i < b->count; i++) {
        b->strain[i] = b->q[i] - q0[i];
        b->by_strain[i] = elastic * k[i];
        b->force[i] = b->by_strain[i] * b->strain[i];
        b->energy[i] = 0.5 * b->force[i] * b->strain[i];
        b->by_rate[i] = 0;
    }
    /* Adds what the sliders of the term do. */
    for (int s = 0; want->conservative && s < term->sliders; s++) {
        const size_t first = (size_t)s * (size_t)term->elements.count + (size_t)b->first;
        const double *stiffness = term->slider_stiffness + first, *limit = term->slider_limit + first,
                     *slid = want->point->internal + term->first_slider + first;
        for (int32_t i = 0; i < b->count; i++) {
            const drape_slider_value v = drape_slider_at(stiffness[i], limit[i], b->strain[i] - slid[i]);
            b->force[i] += v.force;
            b->by_strain[i] += v.slope;
            b->energy[i] += v.energy;
        }
    }
    /* Adds what the Maxwell branches of the term do, at the time of the point after that of the last
     * accepted state. */
    const drape_point *point = want->point;
    for (int n = 0; want->conservative && n < term->branch_count; n++) {
        const drape_branch *branch = &term->branches[n];
        const double *kept = point->internal + term->first_branch, *before = kept + 1 + b->first,
                     *extension = before + (n + 1) * (int64_t)term->elements.count;
        const drape_decay decay =
            drape_decay_over(branch->time, point->relaxed ? INFINITY : point->t - kept[0]);
        for (int32_t i = 0; i < b->count; i++) {
            const double stiffness = branch->fraction * k[i], d = b->strain[i] - before[i], e0 = extension[i];
            b->force[i] += stiffness * drape_decay_extension(&decay, e0, d);
            b->by_strain[i] += stiffness * decay.follows;
            b->energy[i] += stiffness * (0.5 * decay.follows * d * d + decay.keeps * e0 * d +
                                         0.5 * decay.constant * e0 * e0);
        }
    }
    const double *c = want->dissipative && term->damping ? term->damping + b->first : NULL;
    for (int32_t i = 0; c && i < b->count; i++) {
        b->force[i] += c[i] * b->rate[i];
        b->by_rate[i] = c[i];
    }
    for (int i = 0; i < law_count(term, want); i++) {
        const drape_term *law = term->laws[i];
        if (law->ops->dissipative ? want->dissipative : want->conservative)
            law->ops->law(law->params, b->count, k, b->strain, b->rate, b->force, b->by_strain, b->by_rate,
                          b->energy);
    }
}

/* The forces on measures where the nodes are displaced to, which changes the measures by `ahead`. */
static void write_stress(const drape_term *term, const drape_request *want, const drape_block *b,
                         const double *ahead)
{
    double *to = want->stress + term->first_measure + b->first;
    for (int32_t i = 0; i < b->count; i++)
        to[i] = b->force[i] + (b->by_strain[i] + want->point->weight * b->by_rate[i]) * ahead[i];
}

/* The weights of ddq and dq dq' in the Hessian. With positive_share, the positive semidefinite part is
 * taken without eigenvalues: f ddq only where the measure is convex and f > 0, and the Gauss-Newton part
 * (Teran et al. 2005; Tamstorf & Grinspun 2013, 5). A term that projects ddq itself (`positive`) keeps its
 * weight. */
static void weigh(const drape_term *term, const drape_request *want, drape_block *b)
{
    const bool convex = term->ops->convex, split = term->ops->positive;
    const double *force =
        want->point->stress ? want->point->stress + term->first_measure + b->first : b->force;
    for (int32_t i = 0; i < b->count; i++) {
        b->of_ddq[i] = force[i];
        b->of_dq[i] = b->by_strain[i] + want->point->weight * b->by_rate[i];
    }
    for (int32_t i = 0; want->positive_share > 0 && i < b->count; i++) {
        const double ddq = convex ? fmax(0, b->of_ddq[i]) : 0, dq = fmax(0, b->of_dq[i]);
        b->of_ddq[i] += split ? 0 : want->positive_share * (ddq - b->of_ddq[i]);
        b->of_dq[i] += want->positive_share * (dq - b->of_dq[i]);
    }
    for (int32_t i = 0; want->velocity && i < b->count; i++) {
        b->of_ddq[i] = 0;
        b->of_dq[i] = b->by_rate[i];
    }
}

/* Whether the Hessian has the part df/dq' dq (ddq v)', which is not symmetric. */
bool drape_block_is_nonsymmetric(const drape_term *term, const drape_request *want)
{
    return drape_block_has_rates(term, want) && want->dissipative && !want->point->history &&
           !want->velocity && !want->positive_share;
}

void drape_block_stress(const drape_term *term, const drape_request *want, drape_block *b,
                        const double *ahead)
{
    if (drape_block_has_rates(term, want) && want->point->history)
        rates_of_history(term, want, b);
    sum_stresses(term, want, b);
    if (want->stress)
        write_stress(term, want, b, ahead);
    if (want->hessian)
        weigh(term, want, b);
}

/* ---- Measures of pairs ---- */

/* The geometry of the pairs of one block: component k of pair i at [k][i]. */
typedef struct pairs {
    double d[3][N];        /* from the first node to the second */
    double approach[3][N]; /* v1 - v0, in continuous time */
} pairs;

/* rate = dq . v with the nodes' v; p->approach = v1 - v0. */
static void pairs_along(const drape_term *term, const double *v, const drape_block *b, pairs *p, double *rate)
{
    const int32_t *node = term->elements.node + 2 * (size_t)b->first;
    for (int r = 0; r < 3; r++)
        for (int32_t i = 0; i < b->count; i++)
            p->approach[r][i] =
                v[3 * (size_t)node[2 * i + 1] + (size_t)r] - v[3 * (size_t)node[2 * i] + (size_t)r];
    for (int32_t i = 0; i < b->count; i++)
        rate[i] = b->per_length[i] * (p->d[0][i] * p->approach[0][i] + p->d[1][i] * p->approach[1][i] +
                                      p->d[2][i] * p->approach[2][i]);
}

/* f P + w dq dq' = f c I + (w c^2 - f c/d.d) d d' */
LANES_DISPATCH static void pair_blocks(drape_block *b, const pairs *p)
{
    double isotropic[N], along[N];
    for (int i = 0; i < N; i++) {
        double c = b->per_length[i],
               square = p->d[0][i] * p->d[0][i] + p->d[1][i] * p->d[1][i] + p->d[2][i] * p->d[2][i];
        isotropic[i] = b->of_ddq[i] * c;
        along[i] = b->of_dq[i] * c * c - isotropic[i] / square;
    }
    for (int r = 0; r < 3; r++)
        for (int s = 0; s < 3; s++)
            for (int i = 0; i < N; i++)
                b->hessian[(3 * r + s) * N + i] =
                    along[i] * (p->d[r][i] * p->d[s][i]) + (r == s ? isotropic[i] : 0);
}

/* df/dq' dq (ddq v)', with ddq v = (-u, u), u = P (v1 - v0) */
static void add_nonsymmetric_pairs(drape_block *b, const pairs *p)
{
    for (int32_t i = 0; i < b->count; i++) {
        const double c = b->per_length[i], d[3] = {p->d[0][i], p->d[1][i], p->d[2][i]};
        const double radial = b->rate[i] / (c * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]));
        for (int s = 0; s < 3; s++) {
            double u = b->by_rate[i] * c * c * (p->approach[s][i] - radial * d[s]);
            for (int r = 0; r < 3; r++)
                b->hessian[(3 * r + s) * N + i] += d[r] * u;
        }
    }
}

/* Pairs have a special case: a tenth of the numbers of a gradient and Hessian, and loops without calls. */
static void evaluate_pairs(const drape_term *term, const drape_request *want, drape_block *b)
{
    pairs p;
    double *compact = b->scratch;
    term->ops->pair(&term->elements, b->first, b->count, want->point->x, b->q, compact, b->per_length);
    for (int r = 0; r < 3; r++)
        memcpy(p.d[r], compact + r * b->count, (size_t)b->count * sizeof *compact);
    if (drape_block_has_rates(term, want) && want->point->history)
        rates_of_history(term, want, b);
    else if (drape_block_has_rates(term, want))
        pairs_along(term, want->point->v, b, &p, b->rate);
    sum_stresses(term, want, b);
    if (want->stress) {
        double ahead[N] = {0};
        if (want->along)
            pairs_along(term, want->along, b, &p, ahead);
        write_stress(term, want, b, ahead);
    }
    for (int r = 0; r < 3; r++)
        for (int32_t i = 0; i < b->count; i++)
            b->gradient[r * N + i] = p.d[r][i] * (b->force[i] * b->per_length[i]);
    if (!want->hessian)
        return;
    for (int32_t i = b->count; i < N;
         i++) /* a last block that is not full: harmless numbers that nobody reads */
        b->per_length[i] = b->of_ddq[i] = b->of_dq[i] = 0, p.d[0][i] = p.d[1][i] = p.d[2][i] = 1;
    weigh(term, want, b);
    pair_blocks(b, &p);
    if (drape_block_is_nonsymmetric(term, want))
        add_nonsymmetric_pairs(b, &p);
}

/* ---- Other measures, interleaved in lanes ---- */

static void lay_out(int numbers, const double *from, int32_t count, double *to)
{
    for (int32_t i = 0; i < count; i++)
        for (int k = 0; k < numbers; k++)
            to[(i - i % LANES) * numbers + LANES * k + i % LANES] = from[i * numbers + k];
}

/* q, dq and, in b->hessian, ddq of the whole block. */
static void measure(const drape_term *term, const drape_request *want, drape_block *b)
{
    const drape_elements *el = &term->elements;
    const double *internal = drape_term_own(term, want->point->internal);
    const bool second = want->hessian && !want->velocity;
    const int d = 3 * el->nodes;
    if (!term->ops->lanes) {
        term->ops->measure(el, b->first, b->count, want->point->x, internal, b->q, b->gradient,
                           second ? b->scratch : NULL);
        lay_out(d, b->gradient, b->count, b->dq);
        if (second)
            lay_out(d * d, b->scratch, b->count, b->hessian);
        return;
    }
    for (int32_t i = 0; i < b->count; i += LANES) {
        int32_t element[LANES];
        for (int32_t l = 0; l < LANES; l++)
            element[l] = b->first + (i + l < b->count ? i + l : b->count - 1);
        term->ops->lanes(el, element, want->point->x, internal, b->q + i, b->dq + i * d,
                         second ? b->hessian + i * d * d : NULL);
    }
}

/* v of the nodes of element i. */
static void gather(const drape_elements *el, int32_t element, const double *v, double *local)
{
    const int32_t *node = el->node + (size_t)element * (size_t)el->nodes;
    for (int a = 0; a < el->nodes; a++)
        memcpy(local + 3 * a, v + 3 * (size_t)node[a], 3 * sizeof *local);
}

/* rate = dq . v with the nodes' v. */
static void measures_along(const drape_term *term, const double *nodes, const drape_block *b, double *rate)
{
    const int d = 3 * term->elements.nodes;
    for (int32_t i = 0; i < b->count; i++) {
        double v[D];
        const double *dq = b->dq + drape_block_start(b, i, d);
        gather(&term->elements, b->first + i, nodes, v);
        rate[i] = 0;
        for (int k = 0; k < d; k++)
            rate[i] += dq[LANES * k] * v[k];
    }
}

/* The blocks on and below the diagonal. */
LANES_DISPATCH static void measure_hessians(int d, drape_block *b)
{
    for (int32_t g = 0; g < b->count; g += LANES) {
        const double *dq = b->dq + g * d;
        double *h = b->hessian + g * d * d;
        lanes of_ddq = lanes_load(b->of_ddq + g), of_dq = lanes_load(b->of_dq + g);
        for (int i = 0; i < d; i++) {
            lanes dq_i = of_dq * lanes_load(dq + LANES * i);
            for (int j = 0; j < i - i % 3 + 3; j++) {
                double *at = h + LANES * (d * i + j);
                lanes_store(at, of_ddq * lanes_load(at) + dq_i * lanes_load(dq + LANES * j));
            }
        }
    }
}

LANES_DISPATCH static void velocity_hessians(int d, drape_block *b)
{
    for (int32_t g = 0; g < b->count; g += LANES)
        for (int i = 0; i < d; i++) {
            lanes dq_i = lanes_load(b->of_dq + g) * lanes_load(b->dq + g * d + LANES * i);
            for (int j = 0; j < i - i % 3 + 3; j++)
                lanes_store(b->hessian + g * d * d + LANES * (d * i + j),
                            dq_i * lanes_load(b->dq + g * d + LANES * j));
        }
}

/* The full Hessian of one element, including the nonsymmetric part. */
static void nonsymmetric_hessian(const drape_term *term, const drape_request *want, drape_block *b, int32_t i)
{
    const int d = 3 * term->elements.nodes;
    double *h = b->hessian + drape_block_start(b, i, d * d), v[D], along[D];
    const double *dq = b->dq + drape_block_start(b, i, d);
    gather(&term->elements, b->first + i, want->point->v, v);
    for (int r = 0; r < d; r++)
        for (int c = r - r % 3 + 3; c < d; c++)
            h[LANES * (d * r + c)] = h[LANES * (d * c + r)];
    for (int r = 0; r < d; r++) {
        along[r] = 0;
        for (int c = 0; c < d; c++)
            along[r] += b->by_rate[i] * h[LANES * (d * r + c)] * v[c];
    }
    for (int r = 0; r < d; r++)
        for (int c = 0; c < d; c++)
            h[LANES * (d * r + c)] = b->of_ddq[i] * h[LANES * (d * r + c)] +
                                     dq[LANES * r] * (b->of_dq[i] * dq[LANES * c] + along[c]);
}

static void hessians_of_measures(const drape_term *term, const drape_request *want, drape_block *b)
{
    const int d = 3 * term->elements.nodes;
    weigh(term, want, b);
    if (term->ops->positive && want->positive_share > 0 && !want->velocity) {
        /* Moves ddq in b->hessian by positive_share towards the part of it that is positive semidefinite
         * under the measure's force. */
        const drape_elements *el = &term->elements;
        const double *internal = drape_term_own(term, want->point->internal);
        const int size = 9 * el->nodes * el->nodes;
        term->ops->positive(el, b->first, b->count, want->point->x, internal, b->of_ddq, b->scratch);
        for (int32_t i = 0; i < b->count; i++) {
            double *h = b->hessian + drape_block_start(b, i, size);
            for (int k = 0; k < size; k++)
                h[LANES * k] += want->positive_share * (b->scratch[i * size + k] - h[LANES * k]);
        }
    }
    b->mirrored = !drape_block_is_nonsymmetric(term, want);
    if (want->velocity)
        velocity_hessians(d, b);
    else if (b->mirrored)
        measure_hessians(d, b);
    else
        for (int32_t i = 0; i < b->count; i++)
            nonsymmetric_hessian(term, want, b, i);
}

static void evaluate_measures(const drape_term *term, const drape_request *want, drape_block *b)
{
    const int d = 3 * term->elements.nodes;
    b->stride = LANES;
    measure(term, want, b);
    if (drape_block_has_rates(term, want) && want->point->history)
        rates_of_history(term, want, b);
    else if (drape_block_has_rates(term, want))
        measures_along(term, want->point->v, b, b->rate);
    sum_stresses(term, want, b);
    if (want->stress) {
        double ahead[N] = {0};
        if (want->along)
            measures_along(term, want->along, b, ahead);
        write_stress(term, want, b, ahead);
    }
    for (int32_t g = 0; g < b->count; g += LANES)
        for (int k = 0; k < d; k++)
            for (int l = 0; l < LANES; l++)
                b->gradient[g * d + LANES * k + l] = b->force[g + l] * b->dq[g * d + LANES * k + l];
    if (want->hessian)
        hessians_of_measures(term, want, b);
}

/* ---- Energies and dissipations, element by element ---- */

/* The elements as energies see them. */
static drape_elements elements_at(const drape_term *term, const drape_point *point)
{
    drape_elements el = drape_term_elements(term, point->t);
    const bool full = point->full && term->ops->external;
    el.progress = full || point->done ? 1 : drape_term_progress(term, point->t) + point->progressed;
    if (term->history)
        el.factor = full          ? 1
                    : point->done ? drape_history_largest(term->history)
                                  : drape_history_factor(term->history, point->t);
    return el;
}

static void scale(double factor, double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        values[i] *= factor;
}

/* The energy and the forces of an external load are those that the term computes times the factor of its
 * history. */
static void scale_load(const drape_elements *el, const drape_request *want, drape_block *b)
{
    const size_t count = (size_t)b->count, d = 3 * (size_t)el->nodes;
    scale(el->factor, b->energy, count);
    scale(el->factor, b->gradient, count * d);
    if (want->hessian)
        scale(el->factor, b->hessian, count * d * d);
}

/* h -= dg/dv W: the wind at an element's nodes changes as they move. */
static void carry_wind(const drape_term *term, const double *gradient, const double *dg_dv, int32_t element,
                       double *h)
{
    const drape_elements *el = &term->elements;
    const int32_t *node = el->node + (size_t)element * (size_t)el->nodes;
    const int d = 3 * el->nodes;
    for (int row = 0; row < d; row++)
        for (int a = 0; a < el->nodes; a++) {
            const double *w = gradient + 9 * (size_t)node[a], *by = dg_dv + d * row + 3 * a;
            for (int c = 0; c < 3; c++)
                h[d * row + 3 * a + c] -= by[0] * w[c] + by[1] * w[3 + c] + by[2] * w[6 + c];
        }
}

static void evaluate_dissipations(const drape_term *term, const drape_request *want, drape_block *b)
{
    const int d = 3 * term->elements.nodes;
    const bool hessian = want->hessian, wind = want->against && term->ops->in_medium;
    const drape_elements el = elements_at(term, want->point);
    const double *v = wind ? want->against : want->point->v;
    const size_t numbers = (size_t)b->count * (size_t)d;
    memset(b->energy, 0, (size_t)b->count * sizeof *b->energy);
    if (want->dissipative)
        term->ops->dissipation(&el, b->first, b->count, want->point->x, v, b->gradient,
                               hessian ? b->hessian : NULL, hessian ? b->scratch : NULL);
    else {
        memset(b->gradient, 0, numbers * sizeof *b->gradient);
        for (size_t i = 0; hessian && i < numbers * (size_t)d; i++)
            b->hessian[i] = b->scratch[i] = 0;
    }
    for (int32_t i = 0; term->ops->kinetic && want->conservative && i < b->count; i++) {
        const size_t at = (size_t)i * (size_t)(d * d);
        /* Adds r dT/dv - dT/dx of one element to its force, and the derivatives by x and v to dg_dx and
         * dg_dv (d x d), unless they are NULL. In a step w = r: what r T_vx - w T_xv adds is
         * antisymmetric, and the positive semidefinite part is w r T_vv. */
        double *g = b->gradient + (size_t)i * (size_t)d, *dg_dx = hessian ? b->hessian + at : NULL,
               *dg_dv = hessian ? b->scratch + at : NULL;
        const drape_point *point = want->point;
        const double r = point->momentum, exact = 1 - want->positive_share;
        double by_x[D], by_v[D], xx[D * D], vx[D * D], vv[D * D];
        term->ops->kinetic(&el, b->first + i, 1, point->x, v,
                           &(drape_kinetic){.by_x = by_x,
                                            .by_v = by_v,
                                            .xx = dg_dx ? xx : NULL,
                                            .vx = dg_dx ? vx : NULL,
                                            .vv = dg_dx ? vv : NULL});
        for (int k = 0; k < d; k++)
            g[k] += r * by_v[k] - by_x[k];
        for (int k = 0; dg_dx && k < d; k++)
            for (int j = 0; j < d; j++) {
                dg_dx[d * k + j] += r * vx[d * k + j] - exact * xx[d * k + j];
                dg_dv[d * k + j] += r * vv[d * k + j] - vx[d * j + k];
            }
    }
    for (int32_t i = 0; wind && hessian && !want->velocity && i < b->count; i++)
        carry_wind(term, want->wind_gradient, b->scratch + (size_t)i * (size_t)(d * d), b->first + i,
                   b->hessian + (size_t)i * (size_t)(d * d));
    if (term->history && term->ops->external)
        scale_load(&el, want, b);
    for (int i = 0; hessian && i < b->count * d * d; i++)
        b->hessian[i] = want->velocity ? b->scratch[i] : b->hessian[i] + want->point->weight * b->scratch[i];
}

void drape_block_evaluate(const drape_term *term, const drape_request *want, drape_block *b)
{
    b->pairs = term->ops->pair;
    b->mirrored = b->flat = false;
    b->stride = 1;
    if (term->ops->pair)
        evaluate_pairs(term, want, b);
    else if (term->ops->measure)
        evaluate_measures(term, want, b);
    else if (term->ops->energy) {
        const drape_elements el = elements_at(term, want->point);
        const double *internal = drape_term_own(term, want->point->internal);
        term->ops->energy(&el, b->first, b->count, want->point->x, internal, b->energy, b->gradient,
                          want->hessian ? b->hessian : NULL);
        if (term->history && term->ops->external)
            scale_load(&el, want, b);
    } else if (want->momentum) {
        /* The energies of motion and their momenta. */
        const drape_elements el = elements_at(term, want->point);
        const double *v = want->against && term->ops->in_medium ? want->against : want->point->v;
        term->ops->kinetic(&el, b->first, b->count, want->point->x, v,
                           &(drape_kinetic){.t = b->energy, .by_v = b->gradient});
    } else
        evaluate_dissipations(term, want, b);
    const int d = 3 * term->elements.nodes;
    /* Of measures the positive part is taken already, and convex energies are their own. Drag has none: it is
     * not symmetric, and much of what neighbouring triangles add cancels. Positive parts would not, and would
     * hold light cloth fast. */
    const bool given = term->ops->measure || term->ops->in_medium || term->ops->convex;
    for (int32_t i = 0; want->hessian && want->positive_share > 0 && !given && i < b->count; i++) {
        /* Of a matrix that is not symmetric, the symmetric part is made positive semidefinite. */
        double *h = b->hessian + (size_t)i * (size_t)(d * d);
        double *positive = b->scratch;
        for (int k = 0; k < d; k++)
            for (int j = 0; j < d; j++)
                positive[d * k + j] = (h[d * k + j] + h[d * j + k]) / 2;
        drape_project(d, positive);
        for (int k = 0; k < d; k++)
            for (int j = 0; j <= k; j++) {
                const double change =
                    want->positive_share * (positive[d * k + j] - (h[d * k + j] + h[d * j + k]) / 2);
                h[d * k + j] += change;
                h[d * j + k] += k == j ? 0 : change;
            }
    }
}
