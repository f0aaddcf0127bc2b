/* range.c: makes a range of elements out of a function for one (extend.h). */
#include "terms/terms.h"

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
