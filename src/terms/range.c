/* range.c: evaluates ranges of elements by functions for one element, or for several at once (extend.h). */
#include "terms/terms.h"

#include <math.h>
#include <string.h>

void drape_energy_range(const drape_elements *el, int32_t first, int32_t count, const double *x, double *e,
                        double *g, double *hess, drape_element_energy *one)
{
    int d = 3 * el->nodes;
    double local[DRAPE_MAX_ELEMENT_DOFS];
    for (int32_t i = 0; i < count; i++) {
        const int32_t *node = el->node + (size_t)(first + i) * (size_t)el->nodes;
        for (int k = 0; k < d; k++)
            local[k] = x[3 * (size_t)node[k / 3] + (size_t)(k % 3)];
        one(el, first + i, local, e ? e + i : NULL, g ? g + (size_t)i * (size_t)d : NULL,
            hess ? hess + (size_t)i * (size_t)(d * d) : NULL);
    }
}

/* The blocks above the diagonal are copies of those below. */
static void take_hessian(int d, const double *from, double *to)
{
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++)
            to[d * i + j] =
                i / 3 >= j / 3 ? from[DRAPE_LANES * (d * i + j)] : from[DRAPE_LANES * (d * j + i)];
}

void drape_measure_range(const drape_elements *el, int32_t first, int32_t count, const double *x,
                         const double *internal, double *q, double *dq, double *ddq,
                         drape_measure_lanes *lanes)
{
    const int d = 3 * el->nodes;
    double q4[DRAPE_LANES], dq4[DRAPE_LANES * DRAPE_MAX_ELEMENT_DOFS],
        ddq4[DRAPE_LANES * DRAPE_MAX_ELEMENT_DOFS * DRAPE_MAX_ELEMENT_DOFS];
    for (int32_t i = 0; i < count; i++) {
        const int l = i % DRAPE_LANES;
        if (l == 0) {
            int32_t element[DRAPE_LANES];
            drape_lanes_elements(first + i, first + count, element);
            lanes(el, element, x, internal, q4, dq ? dq4 : NULL, ddq ? ddq4 : NULL);
        }
        q[i] = q4[l];
        for (int k = 0; dq && k < d; k++)
            dq[(size_t)i * (size_t)d + (size_t)k] = dq4[DRAPE_LANES * k + l];
        if (ddq)
            take_hessian(d, ddq4 + l, ddq + (size_t)i * (size_t)(d * d));
    }
}

/* Adds weight times the derivatives of the part in lane l by its nodes to those of an element. */
static void add_part(const drape_elements *el, int32_t link, int l, const double *ds, const double *dds,
                     double *dq, double *ddq)
{
    const drape_parts *parts = el->parts;
    const uint8_t *place = parts->place + (size_t)link * (size_t)parts->nodes;
    const double weight = parts->weight[link];
    const int n = 3 * parts->nodes, d = 3 * el->nodes;
    for (int i = 0; i < n; i++) {
        const int row = 3 * place[i / 3] + i % 3;
        if (dq)
            dq[row] += weight * ds[DRAPE_LANES * i + l];
        for (int j = 0; ddq && j < n; j++)
            ddq[d * row + 3 * place[j / 3] + j % 3] +=
                weight * dds[DRAPE_LANES * (i / 3 >= j / 3 ? n * i + j : n * j + i) + l];
    }
}

void drape_part_range(const drape_elements *el, int32_t first, int32_t count, const double *x,
                      const double *internal, double *q, double *dq, double *ddq, drape_part_lanes *part)
{
    const drape_parts *parts = el->parts;
    const size_t d = 3 * (size_t)el->nodes;
    double s[DRAPE_LANES], ds[DRAPE_LANES * DRAPE_MAX_ELEMENT_DOFS],
        dds[DRAPE_LANES * DRAPE_MAX_ELEMENT_DOFS * DRAPE_MAX_ELEMENT_DOFS];
    if (dq)
        memset(dq, 0, (size_t)count * d * sizeof *dq);
    if (ddq)
        memset(ddq, 0, (size_t)count * d * d * sizeof *ddq);
    for (int32_t i = 0; i < count; i++) {
        const int32_t end = parts->first_link[first + i + 1];
        q[i] = 0;
        for (int32_t link = parts->first_link[first + i]; link < end; link += DRAPE_LANES) {
            int32_t number[DRAPE_LANES];
            for (int32_t l = 0; l < DRAPE_LANES; l++)
                number[l] = parts->part[link + l < end ? link + l : end - 1];
            part(el, number, x, internal, s, dq ? ds : NULL, ddq ? dds : NULL);
            for (int32_t l = 0; l < DRAPE_LANES && link + l < end; l++) {
                q[i] += parts->weight[link + l] * s[l];
                if (dq || ddq)
                    add_part(el, link + l, l, ds, dds, dq ? dq + (size_t)i * d : NULL,
                             ddq ? ddq + (size_t)i * d * d : NULL);
            }
        }
    }
}

/* Two loops, as compilers vectorize the second, which does not gather. */
void drape_pair_distance(const drape_elements *el, int32_t first, int32_t count, const double *x, double *l,
                         double *d)
{
    double *restrict dx = d, *restrict dy = d + count, *restrict dz = d + 2 * (size_t)count;
    const int32_t *node = el->node + 2 * (size_t)first;
    for (int32_t i = 0; i < count; i++) {
        const double *a = x + 3 * (size_t)node[2 * i], *b = x + 3 * (size_t)node[2 * i + 1];
        dx[i] = b[0] - a[0];
        dy[i] = b[1] - a[1];
        dz[i] = b[2] - a[2];
    }
    for (int32_t i = 0; i < count; i++)
        l[i] = sqrt(dx[i] * dx[i] + dy[i] * dy[i] + dz[i] * dz[i]);
}

drape_status drape_check_ratios(const drape_elements *el, const double *x, const double *before,
                                int32_t every, drape_ratio *ratio_of, drape_reason reason, const char *what,
                                drape_fault *fault)
{
    *fault = (drape_fault){drape_reason_name(reason), what, -1, INFINITY, DRAPE_MIN_RATIO};
    for (int32_t e = 0; e < el->count; e += every) {
        double ratio = ratio_of(el, e, x);
        if (!(ratio < fault->value))
            continue;
        if (ratio < fault->limit && before && !drape_fell(ratio, ratio_of(el, e, before)))
            continue;
        fault->value = ratio;
        fault->element = e;
    }
    return fault->value < fault->limit ? DRAPE_RETRY_DEGENERATE : DRAPE_OK;
}
