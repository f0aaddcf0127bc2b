/* term_parts.c: see term_parts.h. */
#include "assemble/term_parts.h"

#include "base/lanes.h"
#include "base/vec3.h"
#include "model/track.h"

#include <string.h>

#define NODES DRAPE_MAX_ELEMENT_NODES

drape_parts_work *drape_parts_create(drape_arena *arena, const drape_term *term)
{
    const drape_parts *p = term->elements.parts;
    if (!p)
        return NULL;
    const size_t parts = (size_t)p->count, elements = (size_t)term->elements.count,
                 numbers = parts * (size_t)p->nodes * LANES;
    drape_parts_work *w = drape_arena_take(arena, 1, sizeof *w);
    double *by_part = drape_arena_take(arena, 3 * parts, sizeof *by_part),
           *by_element = drape_arena_take(arena, 5 * elements, sizeof *by_element);
    if (!w || !by_part || !by_element)
        return NULL;
    *w = (drape_parts_work){.s = by_part, .rate = by_part + parts, .ahead = by_part + 2 * parts};
    w->force = by_element;
    w->of_ddq = by_element + elements;
    w->of_dq = by_element + 2 * elements;
    w->by_rate = by_element + 3 * elements;
    w->energy = by_element + 4 * elements;
    w->ds = drape_arena_take(arena, numbers, sizeof *w->ds);
    w->turn = drape_arena_take(arena, term->law_count > 0 || term->damping ? numbers : 0, sizeof *w->turn);
    return w;
}

/* ---- By part ---- */

/* The v of the nodes of a part (nodes x 3). */
static void gather(const drape_parts *p, int32_t part, const double *v, double *own)
{
    for (int a = 0; a < p->nodes; a++)
        memcpy(own + 3 * a, v + 3 * (size_t)p->node[(size_t)part * (size_t)p->nodes + (size_t)a],
               3 * sizeof *own);
}

/* ds . v with the v of its nodes. */
static double along(const drape_parts *p, const double *ds, const double *v)
{
    double sum = 0;
    for (int a = 0; a < p->nodes; a++)
        for (int k = 0; k < 3; k++)
            sum += ds[LANES * a + k] * v[3 * a + k];
    return sum;
}

/* The angular velocity w of the direction of a part. Nodes that turn with it do not change s: the
 * rate of s is that in a frame which turns, ds . (v - w x (x - x0)) for any x0, and not ds . v. */
static bool turns_at(const drape_elements *el, int32_t part, const drape_point *point, double w[3])
{
    const int32_t turn = el->parts->turn ? el->parts->turn[part] : -1;
    if (turn < 0 || !(point->turning || point->instant || point->span[0] < point->span[1]))
        return false;
    drape_turns_velocity(&el->tracks[turn].turns,
                         point->turning ? point->t : (point->span[0] + point->span[1]) / 2, w);
    return true;
}

/* v -= w x (x - x0) at the nodes of a part. */
static void leave_turn(const drape_parts *p, int32_t part, const double *x, const double w[3], double *v)
{
    double own[3 * NODES], arm[3], turning[3];
    gather(p, part, x, own);
    for (int a = 1; a < p->nodes; a++) {
        vec3_sub(own + 3 * a, own, arm);
        vec3_cross(w, arm, turning);
        vec3_add_scaled(-1, turning, v + 3 * a);
    }
}

/* dds v of the part in lane l. */
static void turn_of(const drape_parts *p, const double *dds, int l, const double *v, double *turn)
{
    const int n = 3 * p->nodes;
    for (int i = 0; i < n; i++) {
        double sum = 0;
        for (int j = 0; j < n; j++)
            sum += dds[LANES * (i / 3 >= j / 3 ? n * i + j : n * j + i) + l] * v[j];
        turn[LANES * (i / 3) + i % 3] = sum;
    }
}

/* The derivative by x of what leave_turn takes off the rate: w x ds. */
static void add_turned(const drape_parts *p, const double *ds, const double w[3], double *turn)
{
    double by[3];
    for (int a = 0; a < p->nodes; a++) {
        vec3_cross(w, ds + (ptrdiff_t)LANES * a, by);
        vec3_add_scaled(1, by, turn + (ptrdiff_t)LANES * a);
    }
}

void drape_parts_measure(const drape_term *term, const drape_request *want, int32_t block, drape_block *b,
                         drape_parts_work *work)
{
    const drape_elements el = drape_term_elements(term, want->point->t + want->point->ahead);
    const drape_parts *p = el.parts;
    const int32_t first = block * DRAPE_BLOCK,
                  last = first + DRAPE_BLOCK < p->count ? first + DRAPE_BLOCK : p->count;
    const double *internal = drape_term_own(term, want->point->internal);
    const bool turns = want->hessian && drape_block_is_nonsymmetric(term, want);
    const bool rates = drape_block_has_rates(term, want) && !want->point->history && want->point->v;
    for (int32_t i = first; i < last; i += LANES) {
        int32_t number[LANES];
        double s[LANES], v[3 * NODES], w[3];
        for (int32_t l = 0; l < LANES; l++)
            number[l] = i + l < last ? i + l : last - 1;
        term->ops->part(&el, number, want->point->x, internal, s, b->dq, turns ? b->hessian : NULL);
        for (int32_t l = 0; l < LANES && i + l < last; l++) {
            const size_t at = (size_t)(i + l) * (size_t)p->nodes * LANES;
            double *ds = work->ds + at;
            work->s[i + l] = s[l];
            for (int k = 0; k < 3 * p->nodes; k++)
                ds[LANES * (k / 3) + k % 3] = b->dq[LANES * k + l];
            if (want->along) {
                gather(p, i + l, want->along, v);
                work->ahead[i + l] = along(p, ds, v);
            }
            if (!rates)
                continue;
            gather(p, i + l, want->point->v, v);
            const bool turned = turns_at(&el, i + l, want->point, w);
            if (turned)
                leave_turn(p, i + l, want->point->x, w, v);
            work->rate[i + l] = along(p, ds, v);
            if (turns)
                turn_of(p, b->hessian, l, v, work->turn + at);
            if (turns && turned)
                add_turned(p, ds, w, work->turn + at);
        }
    }
}

/* ---- By element ---- */

double drape_parts_combine(const drape_parts *p, int32_t element, const double *of_part)
{
    double sum = 0;
    for (int32_t i = p->first_link[element]; i < p->first_link[element + 1]; i++)
        sum += p->weight[i] * of_part[p->part[i]];
    return sum;
}

void drape_parts_stress(const drape_term *term, const drape_request *want, int32_t block, drape_block *b,
                        drape_parts_work *work)
{
    const drape_parts *p = term->elements.parts;
    const int32_t left = term->elements.count - block * DRAPE_BLOCK;
    const bool rates = drape_block_has_rates(term, want) && !want->point->history;
    double ahead[DRAPE_BLOCK] = {0};
    b->first = block * DRAPE_BLOCK;
    b->count = left < DRAPE_BLOCK ? left : DRAPE_BLOCK;
    for (int32_t i = 0; i < b->count; i++) {
        b->q[i] = drape_parts_combine(p, b->first + i, work->s);
        if (rates)
            b->rate[i] = drape_parts_combine(p, b->first + i, work->rate);
        if (want->along)
            ahead[i] = drape_parts_combine(p, b->first + i, work->ahead);
    }
    drape_block_stress(term, want, b, ahead);
    const size_t bytes = (size_t)b->count * sizeof(double);
    memcpy(work->force + b->first, b->force, bytes);
    memcpy(work->energy + b->first, b->energy, bytes);
    if (!want->hessian)
        return;
    memcpy(work->of_ddq + b->first, b->of_ddq, bytes);
    memcpy(work->of_dq + b->first, b->of_dq, bytes);
    memcpy(work->by_rate + b->first, b->by_rate, bytes);
}

/* ---- Sums over parts ---- */

/* The sum of an element quantity over the users of a part, each with its weight. */
static double gather_users(const drape_parts *p, int32_t part, const double *of_element)
{
    double sum = 0;
    for (int32_t k = p->first_user[part]; k < p->first_user[part + 1]; k++) {
        const int32_t link = p->user[k];
        sum += p->weight[link] * of_element[p->element[link]];
    }
    return sum;
}

double drape_parts_turning_power(const drape_term *term, const drape_point *point,
                                 const drape_parts_work *work)
{
    const drape_parts *p = &term->parts;
    double power = 0, w[3];
    for (int32_t i = 0; i < p->count; i++) {
        double v[3 * NODES] = {0};
        if (!turns_at(&term->elements, i, point, w))
            continue;
        leave_turn(p, i, point->x, w, v);
        power +=
            gather_users(p, i, work->force) * along(p, work->ds + (size_t)i * (size_t)p->nodes * LANES, v);
    }
    return power;
}

LANES_DISPATCH static void scale_hessians(int d, const double *weight, double *h)
{
    const lanes w = lanes_load(weight);
    for (int i = 0; i < d; i++)
        for (int j = 0; j < i - i % 3 + 3; j++)
            lanes_store(h + LANES * (d * i + j), w * lanes_load(h + LANES * (d * i + j)));
}

void drape_parts_evaluate(const drape_term *term, const drape_request *want, const drape_parts_work *work,
                          drape_block *b)
{
    const drape_elements el = drape_term_elements(term, want->point->t + want->point->ahead);
    const drape_parts *p = el.parts;
    const int d = 3 * p->nodes;
    const double *internal = drape_term_own(term, want->point->internal);
    b->pairs = false;
    b->mirrored = true;
    b->stride = LANES;
    for (int32_t i = 0; i < b->count; i++) {
        const double force = gather_users(p, b->first + i, work->force);
        const double *ds = work->ds + (size_t)(b->first + i) * (size_t)p->nodes * LANES;
        double *g = b->gradient + drape_block_start(b, i, d);
        for (int k = 0; k < d; k++)
            g[LANES * k] = force * ds[LANES * (k / 3) + k % 3];
    }
    b->flat = true;
    if (!want->hessian || want->velocity)
        return;
    memset(b->of_ddq, 0, sizeof b->of_ddq);
    for (int32_t i = 0; i < b->count; i++) {
        b->of_ddq[i] = gather_users(p, b->first + i, work->of_ddq);
        b->flat = b->flat && b->of_ddq[i] == 0;
    }
    for (int32_t i = 0; !b->flat && i < b->count; i += LANES) {
        int32_t number[LANES];
        for (int32_t l = 0; l < LANES; l++)
            number[l] = b->first + (i + l < b->count ? i + l : b->count - 1);
        term->ops->part(&el, number, want->point->x, internal, b->q + i, NULL, b->hessian + i * d * d);
        scale_hessians(d, b->of_ddq + i, b->hessian + i * d * d);
    }
}

/* ---- Sums over patches ---- */

/* of (used nodes x LANES) = sum c of_part over the parts of an element. */
LANES_INLINE void combine_gradients(const drape_parts *p, int32_t element, int used, const double *of_part,
                                    lanes *of)
{
    for (int a = 0; a < used; a++)
        of[a] = (lanes){0};
    for (int32_t i = p->first_link[element]; i < p->first_link[element + 1]; i++) {
        const double *from = of_part + (size_t)p->part[i] * (size_t)p->nodes * LANES;
        const uint8_t *place = p->place + (size_t)i * (size_t)p->nodes;
        for (int a = 0; a < p->nodes; a++)
            of[place[a]] += p->weight[i] * lanes_load(from + LANES * a);
    }
}

/* to(r, c) += from[c][r], or its transpose */
LANES_INLINE void add_columns(const lanes from[3], double *to, int64_t stride)
{
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++)
            to[c * stride + r] += from[c][r];
}

LANES_INLINE void add_rows(const lanes from[3], double *to, int64_t stride)
{
    for (int c = 0; c < 3; c++)
        for (int r = 0; r < 3; r++)
            to[c * stride + r] += from[r][c];
}

/* dq (elements x NODES), and the vectors `by` in dq by'. Each pair of nodes is computed once if by is a
 * multiple of dq: H(r, c) is the transpose of H(c, r). */
LANES_INLINE void add_products(int elements, int used, int n, bool symmetric, const lanes *dq,
                               const lanes *by, const int32_t *block, const drape_block_column *columns)
{
    for (int c = 0; c < used; c++)
        for (int r = symmetric ? c : 0; r < used; r++) {
            const int32_t at = block[n * r + c], mirror = block[n * c + r];
            const bool other = symmetric && r != c && columns[r].wanted;
            lanes h[3] = {{0}};
            if (at < 0 || !(columns[c].wanted || other))
                continue;
            for (int e = 0; e < elements; e++)
                for (int k = 0; k < 3; k++)
                    h[k] += dq[NODES * e + r] * by[NODES * e + c][k];
            if (symmetric && r == c)
                for (int k = 0; k < 3; k++)
                    for (int i = 0; i < k; i++)
                        h[k][i] = h[i][k];
            if (columns[c].wanted)
                add_columns(h, columns[c].start + 3 * (at - columns[c].first), columns[c].stride);
            if (other)
                add_rows(h, columns[r].start + 3 * (mirror - columns[r].first), columns[r].stride);
        }
}

/* The elements first ... last - 1, at most MOST at a time. */
enum { MOST = 4 };
LANES_DISPATCH static void add_elements(const drape_term *term, const drape_parts_work *work, int32_t first,
                                        int32_t last, int used, bool nonsymmetric, const int32_t *block,
                                        const drape_block_column *columns)
{
    const drape_elements *el = &term->elements;
    lanes dq[MOST * NODES], by[MOST * NODES];
    for (int32_t e = first; e < last; e++) {
        lanes *own = dq + NODES * (e - first), *of = by + NODES * (e - first);
        combine_gradients(el->parts, e, used, work->ds, own);
        if (nonsymmetric)
            combine_gradients(el->parts, e, used, work->turn, of);
        for (int a = 0; a < used; a++)
            of[a] = work->of_dq[e] * own[a] + (nonsymmetric ? work->by_rate[e] * of[a] : (lanes){0});
    }
    add_products(last - first, used, el->nodes, !nonsymmetric, dq, by, block, columns);
}

void drape_patch_add(const drape_term *term, const drape_request *want, const drape_parts_work *work,
                     int32_t patch, const int32_t *block, const drape_block_column *columns)
{
    const drape_patches *patches = &term->patches;
    const int32_t end = patches->first[patch + 1];
    const bool nonsymmetric = drape_block_is_nonsymmetric(term, want);
    for (int32_t e = patches->first[patch]; e < end; e += MOST)
        add_elements(term, work, e, e + MOST < end ? e + MOST : end, patches->used[patch], nonsymmetric,
                     block, columns);
}
