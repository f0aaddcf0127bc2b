/*
 * stitch: a thread from each node of one side to that of the other, of which no more than r(t) is left:
 *     E = 1/2 k max(0, l - r)^2,    r = gap (1 - progress).
 * It pulls and never pushes, so that E is convex in every state and, once r is 0, E = 1/2 k d.d is smooth
 * where the nodes meet. A seam of the type `dashpot` damps it.
 */
#include "terms/terms.h"

#include <math.h>
#include <string.h>

enum { STIFFNESS, START, CLOSING };
enum { REST_STIFFNESS, REST_GAP, REST_COUNT };

static const drape_param params[] = {
    DRAPE_NUMBER("stiffness", "N/m",
                 DRAPE_DERIVED("E h of the stiffer sheet: as stiff as the row of triangles beside it"),
                 DRAPE_ABOVE(0), 1e12, "k of the thread of each pair of nodes"),
    DRAPE_NUMBER("start", "s", 0, 0, 1e9, "the seam begins to close; before, threads are as long as the gap"),
    DRAPE_NUMBER("closing", "s", 1, 0, 1e9,
                 "how long it closes until threads have length 0; 0: it is closed from the beginning"),
};

static double stiffness_of(const drape_cloth_view *cloth)
{
    const double woven = cloth->tension ? fmax(cloth->tension->warp, cloth->tension->weft) : 0;
    return fmax(cloth->material->membrane_stiffness, woven);
}

static drape_status build(const drape_seam_view *seam, const double *values, drape_term_builder *builder)
{
    const double sheets = fmax(stiffness_of(seam->cloth[0]), stiffness_of(seam->cloth[1])),
                 k = isnan(values[STIFFNESS]) ? sheets : values[STIFFNESS];
    if (!(k > 0))
        return drape_term_refuse(builder, "neither sheet has a membrane stiffness: give a \"stiffness\"");
    if (values[CLOSING] == 0 && values[START] > 0)
        return drape_term_refuse(builder,
                                 "with \"closing\": 0 the seam is closed from the beginning: \"start\" "
                                 "must be 0");
    drape_term_timed(builder, values[START], values[START] + values[CLOSING]);
    DRAPE_TRY(drape_term_reserve(builder, seam->pair_count, REST_COUNT));
    for (int32_t i = 0; i < seam->pair_count; i++) {
        const int32_t *node = seam->pair + 2 * (size_t)i;
        double d[3];
        vec3_sub(seam->cloth[1]->rest + 3 * (size_t)(node[1] - seam->first_node[1]),
                 seam->cloth[0]->rest + 3 * (size_t)(node[0] - seam->first_node[0]), d);
        const double rest[REST_COUNT] = {[REST_STIFFNESS] = k, [REST_GAP] = vec3_norm(d)};
        drape_term_set(builder, i, node, rest);
        drape_term_sew(builder, node[0], node[1]);
    }
    return DRAPE_OK;
}

static void stitch(const drape_elements *el, int32_t element, const double *x, double *e, double *g,
                   double *hess)
{
    const double k = drape_rest_of(el, REST_STIFFNESS, element),
                 r = drape_rest_of(el, REST_GAP, element) * (1 - el->progress);
    double d[3];
    vec3_sub(x + 3, x, d);
    const double l = vec3_norm(d);
    const bool taut = l > r;
    const double slack = taut && r > 0 ? r / l : 0, pull = taut ? k * (1 - slack) : 0;
    if (e)
        *e = taut ? 0.5 * k * (l - r) * (l - r) : 0;
    for (int i = 0; g && i < 3; i++) {
        g[i] = -pull * d[i];
        g[3 + i] = pull * d[i];
    }
    double h[9]; /* k ((1 - r/l) I + r/l n n') */
    for (int i = 0; hess && i < 9; i++)
        h[i] = (slack > 0 ? k * slack * (d[i / 3] / l) * (d[i % 3] / l) : 0) + (i % 4 == 0 ? pull : 0);
    if (hess)
        drape_pair_block(h, hess);
}

DRAPE_ENERGY_BY(stitch)

const drape_term_ops drape_seam_stitch = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "stitch",
              .summary =
                  "threads that pull the nodes of both sides together and hold them: E = 1/2 k max(0, l "
                  "- r(t))^2",
              .reference = "Provot 1995, Deformation constraints in a mass-spring model to describe rigid "
                           "cloth behavior: a spring, here slack below its length, which shrinks to 0",
              DRAPE_PARAMS(params)},
    .element_name = "stitch",
    .nodes = 2,
    .convex = true,
    .build_seam = build,
    .energy = energy,
};
