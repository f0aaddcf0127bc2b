/*
 * bend.hinge: a torsion spring along each inner edge, on the angle theta between its two triangles
 * (dihedral.h).
 *
 * E = 1/2 k (theta - theta0)^2.
 * consistent: k = D |e|^2/(A1 + A2), D = E h^3/(12 (1 - nu^2)). Its bending Poisson ratio is -1/3 on the
 *     equilateral lattice.
 * report: k = 2/sqrt(3) E h^3/12 on every hinge, as in the DEP report and in DisMech: without (1 - nu^2), and
 * correct on
 *     equilateral meshes only.
 *
 * At a periodic edge x3 is the apex on its other side, displaced by the period.
 *
 * theta jumps by 2 pi where the hinge is folded onto itself. The internal variable is the angle in the last
 * accepted state; the angle is taken on the branch nearest to it, so that energy and force are smooth through
 * pi.
 */
#include "base/lanes.h"
#include "base/reason.h"
#include "terms/dihedral.h"
#include "terms/patch.h"
#include "terms/terms.h"

#include <math.h>
#include <string.h>

enum { PARAM_STIFFNESS, PARAM_REST, PARAM_COUNT };
enum { STIFFNESS_CONSISTENT, STIFFNESS_REPORT };
enum { REST_MESH, REST_FLAT };
enum { REST_K, REST_THETA0, REST_ALTITUDE1, REST_ALTITUDE2, REST_COUNT };
enum { REST_SHIFT = REST_COUNT, REST_PERIODIC = REST_SHIFT + 3 }; /* displacement of x3 */

static const char *const stiffness_choices[] = {"consistent", "report", NULL};
static const char *const rest_choices[] = {"mesh", "flat", NULL};

static const drape_param params[PARAM_COUNT] = {
    [PARAM_STIFFNESS] = DRAPE_CHOICE(
        "stiffness", STIFFNESS_CONSISTENT, stiffness_choices,
        "consistent: that of a sheet of the material; report: that of the code of the DEP report, on "
        "edges too soft by the factor of one edge length"),
    [PARAM_REST] = DRAPE_CHOICE("rest", REST_MESH, rest_choices, "at rest: bent as the mesh, or flat"),
};

/* The hinges of LANES elements. */
LANES_INLINE void measure_hinges(const drape_elements *el, const int32_t element[LANES], const double *x,
                                 drape_dihedral_lanes *h)
{
    lanes corner[4][3];
    for (int a = 0; a < 4; a++) {
        int32_t node[LANES];
        for (int l = 0; l < LANES; l++)
            node[l] = el->node[4 * (size_t)element[l] + (size_t)a];
        lanes_gather(x, node, corner[a]);
    }
    for (int k = 0; el->rest_count == REST_PERIODIC && k < 3; k++)
        for (int l = 0; l < LANES; l++)
            corner[3][k][l] += drape_rest_of(el, REST_SHIFT + k, element[l]);
    drape_dihedral_measure(corner, h);
}

LANES_DISPATCH static void measure_lanes(const drape_elements *el, const int32_t *element, const double *x,
                                         const double *internal, double *q, double *dq, double *ddq)
{
    drape_dihedral_lanes h;
    measure_hinges(el, element, x, &h);
    for (int l = 0; l < LANES; l++)
        q[l] = drape_nearest_branch(h.theta[l], internal[element[l]]);
    if (dq)
        drape_dihedral_gradient(&h, dq);
    if (ddq)
        drape_dihedral_hessian(&h, ddq);
}

DRAPE_MEASURE_BY(measure_lanes)

/* Altitudes and angles of LANES hinges from `first` on; lanes beyond the end repeat the last one. */
typedef struct shapes {
    double altitude[2][LANES], theta[LANES];
} shapes;

LANES_DISPATCH static void measure_shapes(const drape_elements *el, int32_t first, const double *x, shapes *s)
{
    drape_dihedral_lanes h;
    int32_t element[LANES];
    drape_lanes_elements(first, el->count, element);
    measure_hinges(el, element, x, &h);
    lanes_store(s->altitude[0], h.side[0].altitude);
    lanes_store(s->altitude[1], h.side[1].altitude);
    lanes_store(s->theta, h.theta);
}

static void set_hinge(const drape_cloth_view *cloth, const double *values, int32_t element, int32_t edge,
                      const int32_t triangle[2], const int32_t node[4], const double at_rest[3],
                      const double shift[3], drape_term_builder *builder)
{
    double rest[REST_PERIODIC] = {0};
    shapes s;
    memcpy(rest + REST_SHIFT, at_rest, 3 * sizeof *rest);
    const drape_elements one = {
        .count = 1, .nodes = 4, .rest_count = REST_PERIODIC, .node = node, .rest = rest};
    measure_shapes(&one, 0, cloth->rest, &s);
    memcpy(rest + REST_SHIFT, shift, 3 * sizeof *rest);
    const drape_material *m = cloth->material;
    const double length = cloth->edge_length[edge], h = m->thickness;
    rest[REST_K] = values[PARAM_STIFFNESS] == STIFFNESS_REPORT
                       ? 2 / sqrt(3.0) * m->young_modulus * h * h * h / 12
                       : m->flexural_rigidity * length * length /
                             (cloth->triangle_area[triangle[0]] + cloth->triangle_area[triangle[1]]);
    rest[REST_THETA0] = values[PARAM_REST] == REST_FLAT ? 0 : s.theta[0];
    rest[REST_ALTITUDE1] = s.altitude[0][0];
    rest[REST_ALTITUDE2] = s.altitude[1][0];
    drape_term_set(builder, element, node, rest);
}

/* The hinges of the cloth, then one at each pair of periodic edges. */
static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    const double none[3] = {0};
    int32_t count = cloth->hinge_count;
    for (int32_t e = 0; cloth->edge_image && e < cloth->edge_count; e++)
        count += cloth->edge_image[e] > e;
    const bool periodic = count > cloth->hinge_count;
    DRAPE_TRY(drape_term_reserve(builder, count, periodic ? REST_PERIODIC : REST_COUNT));
    if (periodic)
        drape_term_anchor(builder);
    for (int32_t i = 0; i < cloth->hinge_count; i++) {
        const int32_t edge = cloth->hinge_edge[i];
        set_hinge(cloth, values, i, edge, cloth->edge_triangle + 2 * (size_t)edge,
                  cloth->hinge + 4 * (size_t)i, none, none, builder);
    }
    for (int32_t e = 0, i = cloth->hinge_count; i < count; e++) {
        if (cloth->edge_image[e] <= e)
            continue;
        const int32_t *end = cloth->edge + 2 * (size_t)e, triangle = cloth->edge_triangle[2 * (size_t)e],
                      *corner = cloth->triangle + 3 * (size_t)triangle;
        const drape_beyond other = drape_beyond_edge(cloth, triangle, e, end[0], end[1]);
        const int32_t node[4] = {end[0], end[1], corner[0] + corner[1] + corner[2] - end[0] - end[1],
                                 other.apex};
        set_hinge(cloth, values, i++, e, (const int32_t[]){triangle, other.triangle}, node, other.at_rest,
                  other.shift, builder);
    }
    return DRAPE_OK;
}

/* after: the angle at x, on the branch nearest to before. */
static void commit(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *before, double *after)
{
    shapes s;
    for (int32_t i = first; i < first + count; i++) {
        int l = (i - first) % LANES;
        if (l == 0)
            measure_shapes(el, i, x, &s);
        after[i] = drape_nearest_branch(s.theta[l], before[i]);
    }
}

/* The angle on the branch nearest to theta0. */
static void initial(const drape_elements *el, int32_t first, int32_t count, const double *x, double *after)
{
    commit(el, first, count, x, el->rest + (size_t)REST_THETA0 * (size_t)el->count, after);
}

/* Altitude k over its rest value, of the hinge in a lane. */
static double ratio_of(const drape_elements *el, int32_t element, const shapes *s, int lane, int k)
{
    return s->altitude[k][lane] / drape_rest_of(el, REST_ALTITUDE1 + k, element);
}

static bool altitude_fell(const drape_elements *el, int32_t element, double ratio, int k,
                          const double *before)
{
    shapes was;
    if (!before)
        return true;
    measure_shapes(el, element, before, &was);
    return drape_fell(ratio, ratio_of(el, element, &was, 0, k));
}

/* A collapsed altitude is reported first: the angle of a collapsed triangle is meaningless. */
static drape_status check(const drape_elements *el, const double *x, const double *before,
                          const double *internal, drape_fault *fault)
{
    drape_fault low = {drape_reason_name(DRAPE_REASON_ALTITUDE_COLLAPSE), "altitude / rest altitude", -1,
                       INFINITY, DRAPE_MIN_RATIO};
    drape_fault turned = {drape_reason_name(DRAPE_REASON_HINGE_BRANCH), "turn of a hinge in one step [rad]",
                          -1, -INFINITY, DRAPE_MAX_TURN};
    shapes s;
    for (int32_t i = 0; i < el->count; i++) {
        int l = i % LANES;
        if (l == 0)
            measure_shapes(el, i, x, &s);
        for (int k = 0; k < 2; k++) {
            double ratio = ratio_of(el, i, &s, l, k);
            if (ratio < low.value && (ratio >= low.limit || altitude_fell(el, i, ratio, k, before))) {
                low.value = ratio;
                low.element = i;
            }
        }
        double angle = fabs(drape_nearest_branch(s.theta[l], internal[i]) - internal[i]);
        if (angle > turned.value) {
            turned.value = angle;
            turned.element = i;
        }
    }
    *fault = low.value < low.limit ? low : turned;
    return low.value < low.limit || turned.value > turned.limit ? DRAPE_RETRY_DEGENERATE : DRAPE_OK;
}

const drape_term_ops drape_term_bend_hinge = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "bend.hinge",
              .summary = "bending of every inner edge: E = 1/2 k (theta - theta0)^2",
              .reference = "Grinspun et al. 2003; Tamstorf & Grinspun 2013",
              DRAPE_PARAMS(params)},
    .element_name = "hinge",
    .nodes = 4,
    .has_internal = true,
    .build = build,
    .measure = measure,
    .lanes = measure_lanes,
    .commit = commit,
    .initial = initial,
    .check = check,
    .periodic = true,
};
