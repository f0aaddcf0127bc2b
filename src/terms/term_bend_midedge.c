/*
 * bend.midedge: bending of every triangle, E = A/2 (K - K0)' C (K - K0), K = (K11, K22, 2 K12) its shape
 * operator with normals at the middles of its edges (midedge.h), C the law of orthotropic.h.
 *
 * C = sum k l l', so E = 1/2 sum k (q - q0)^2 with q = l . K = sum c theta over at most nine hinges. Each
 * square is an element: three per triangle, less one for each free edge. A hinge, which up to 24 squares
 * measure, is a part that they share. The nodes of an element are those of all hinges that the squares of its
 * triangle measure: six on lattices, otherwise up to twelve, followed by copies of the first.
 *
 * A clamped edge has a direction in space instead of a second triangle: x3 = (x0 + x1)/2 + r with r as at
 * rest, or turned with its pin. Such a hinge belongs to one triangle, and its fourth node is a copy of the
 * first.
 *
 * A hinge at a periodic edge, or beyond it, belongs to one triangle, too: its nodes on the other side of the
 * edge are displaced by the period.
 *
 * Hysteresis and creases are sliders (model/slider.h) on the squares. Friction between yarns, of KES-FB2's
 * moment HB = B friction per width: a slider of the limit HB that slips after a change of curvature by
 * friction_curvature, so that the loop of moment over curvature is 2 HB high. A crease: of the rigidity B the
 * share `hardening` stays elastic, and the rest yields at yield_curvature, so that a fold of the curvature K
 * springs back to (1 - hardening) (K - yield_curvature). Each square slides by itself, which is the moment
 * along warp and weft if they are not coupled.
 *
 * The internal variable of a part is its angle in the last accepted state: each angle is taken on the branch
 * nearest to it.
 */
#include "base/lanes.h"
#include "base/reason.h"
#include "base/vec3.h"
#include "terms/dihedral.h"
#include "terms/midedge.h"
#include "terms/orthotropic.h"
#include "terms/terms.h"

#include <math.h>
#include <string.h>

#define LEAST_STIFFNESS 1e-100 /* [N m] */

enum {
    PARAM_REST = DRAPE_ORTHOTROPIC_COUNT,
    PARAM_CURVATURE,
    PARAM_FRICTION = PARAM_CURVATURE + 3,
    PARAM_FRICTION_CURVATURE,
    PARAM_YIELD_CURVATURE,
    PARAM_HARDENING
};
enum {
    LIST_REST = DRAPE_ORTHOTROPIC_DIRECTION + 1,
    LIST_CURVATURE,
    LIST_FRICTION,
    LIST_FRICTION_CURVATURE,
    LIST_YIELD_CURVATURE,
    LIST_HARDENING,
    LIST_COUNT
};
enum { REST_MESH, REST_FLAT };
enum {
    REST_K,
    REST_Q0,
    REST_ALTITUDE, /* smallest of the triangle [m] */
    REST_COUNT
};
/* Rest data of a part: r, 0 if it is not clamped, if some edge is; and the displacements of its nodes, if
 * some edge is periodic. */
enum { PART_R, PART_SHIFT = 3, CLAMP_COUNT = PART_SHIFT, PART_COUNT = PART_SHIFT + 12 };

static const char *const rest_choices[] = {"mesh", "flat", NULL};

/* As a list the direction is one entry; among the values it takes three. */
static const drape_param params[LIST_COUNT] = {
    DRAPE_ORTHOTROPIC_PARAMS("N m", "of the material: its fabric, or E h^3/12", "twist",
                             "torsional rigidity: the curvature K12 stores 2 twist K12^2 per area"),
    [LIST_REST] = DRAPE_CHOICE("rest", REST_MESH, rest_choices, "at rest: bent as the mesh, or flat"),
    [LIST_CURVATURE] = DRAPE_VECTOR("curvature", "1/m", 0, -1e9, 1e9,
                                    "added to the rest curvature: along the warp, along the weft, twist; "
                                    "positive towards the side from which triangles turn counterclockwise",
                                    .numbers = "[k11, k22, k12]"),
    [LIST_FRICTION] =
        DRAPE_NUMBER("friction", "1/m", 0, 0, 1e9,
                     "friction between yarns: the curvature whose elastic moment it is as large "
                     "as, HB/B of a KES test; 0: none"),
    [LIST_FRICTION_CURVATURE] =
        DRAPE_NUMBER("friction_curvature", "1/m", DRAPE_DERIVED("required with friction"), 1e-9, 1e9,
                     "change of curvature at which yarns slip"),
    [LIST_YIELD_CURVATURE] = DRAPE_NUMBER("yield_curvature", "1/m", DRAPE_DERIVED("none: no creases"), 1e-9,
                                          1e9, "curvature beyond which bending leaves a crease"),
    [LIST_HARDENING] =
        DRAPE_NUMBER("hardening", "1", DRAPE_DERIVED("required with yield_curvature"), DRAPE_ABOVE(0),
                     DRAPE_BELOW(1), "rigidity beyond yield_curvature over that below"),
};

/* x3 of the parts that are clamped. Returns the lanes in which they are, as bits. */
LANES_INLINE int place_clamps(const drape_elements *el, const int32_t *part, lanes corner[4][3])
{
    const drape_parts *parts = el->parts;
    int clamped = 0;
    for (int l = 0; l < LANES; l++) {
        const double *r = parts->rest + part[l];
        const size_t next = (size_t)parts->count;
        if (r[0] == 0 && r[next] == 0 && r[2 * next] == 0)
            continue;
        double now[3] = {r[0], r[next], r[2 * next]};
        drape_elements_direction(el, part[l], now, now);
        clamped |= 1 << l;
        for (int i = 0; i < 3; i++)
            corner[3][i][l] = (corner[0][i][l] + corner[1][i][l]) / 2 + now[i];
    }
    return clamped;
}

LANES_INLINE void displace(const drape_parts *parts, const int32_t *part, lanes corner[4][3])
{
    for (int k = 0; k < 12; k++)
        for (int l = 0; l < LANES; l++)
            corner[k / 3][k % 3][l] +=
                parts->rest[(size_t)(PART_SHIFT + k) * (size_t)parts->count + (size_t)part[l]];
}

LANES_DISPATCH static void measure_angles(const drape_elements *el, const int32_t *part, const double *x,
                                          const double *internal, double *s, double *ds, double *dds)
{
    const drape_parts *parts = el->parts;
    drape_dihedral_lanes h;
    lanes corner[4][3];
    int clamped = 0;
    for (int a = 0; a < 4; a++) {
        int32_t node[LANES];
        for (int l = 0; l < LANES; l++)
            node[l] = parts->node[4 * (size_t)part[l] + (size_t)a];
        lanes_gather(x, node, corner[a]);
    }
    if (parts->rest_count == PART_COUNT)
        displace(parts, part, corner);
    if (parts->rest_count > 0)
        clamped = place_clamps(el, part, corner);
    drape_dihedral_measure(corner, &h);
    for (int l = 0; l < LANES; l++)
        s[l] = drape_nearest_branch(h.theta[l], internal[part[l]]);
    if (ds)
        drape_dihedral_gradient(&h, ds);
    if (dds)
        drape_dihedral_hessian(&h, dds);
    for (int l = 0; clamped && l < LANES; l++)
        if (clamped >> l & 1)
            drape_dihedral_tie(l, ds, dds);
}

static void measure(const drape_elements *el, int32_t first, int32_t count, const double *x,
                    const double *internal, double *q, double *dq, double *ddq)
{
    drape_part_range(el, first, count, x, internal, q, dq, ddq, measure_angles);
}

/* ---- Building ---- */

/* Whether a hinge of the patch is in one of its squares. */
static bool is_linked(const drape_midedge *patch, int h)
{
    for (int r = 0; r < patch->rank; r++)
        if (patch->c[r][h] != 0)
            return true;
    return false;
}

/* The number of the hinge at an edge, by bisection. */
static int32_t hinge_at(const drape_cloth_view *cloth, int32_t edge)
{
    int32_t low = 0, high = cloth->hinge_count;
    while (high - low > 1) {
        const int32_t middle = low + (high - low) / 2;
        *(cloth->hinge_edge[middle] <= edge ? &low : &high) = middle;
    }
    return low;
}

static bool is_clamped(const drape_midedge *patch, int h)
{
    return h < 3 && patch->clamped[h];
}

/* Whether a hinge of a patch is a part of that patch alone, beside those of the cloth. */
static bool is_own(const drape_midedge *patch, int h)
{
    return is_clamped(patch, h) || (patch->shifted[h] && is_linked(patch, h));
}

/* The nodes of hinge h of a patch as those of a part; a clamped hinge has its edge, its apex and again the
 * first node of the edge. Returns the sign of its angle in the patch, which depends on the orientation of
 * the triangle. */
static int part_nodes(const drape_cloth_view *cloth, const drape_midedge *patch, int h, int32_t node[4])
{
    const int *local = drape_patch_hinge[h];
    if (is_own(patch, h)) {
        for (int a = 0; a < 4; a++)
            node[a] = patch->node[local[is_clamped(patch, h) ? a % 3 : a]];
        return 1;
    }
    memcpy(node, cloth->hinge + 4 * (size_t)hinge_at(cloth, patch->edge[h]), 4 * sizeof *node);
    return (patch->node[local[0]] == node[0]) != patch->turned[h] ? 1 : -1;
}

/* The nodes of the squares of a patch, without copies; returns their number. */
static int gather_nodes(const drape_cloth_view *cloth, const drape_midedge *patch,
                        int32_t node[MIDEDGE_NODES])
{
    int count = 3;
    memcpy(node, patch->node, 3 * sizeof *node);
    for (int h = 0; h < MIDEDGE_HINGES; h++) {
        int32_t of[4];
        if (!is_linked(patch, h))
            continue;
        part_nodes(cloth, patch, h, of);
        for (int a = 0; a < 4; a++) {
            int b = 0;
            while (b < count && node[b] != of[a])
                b++;
            if (b == count)
                node[count++] = of[a];
        }
    }
    return count;
}

/* Counts, and reserves elements and parts: the hinges of the cloth, then those of
 * single triangles. */
static drape_status reserve(const drape_cloth_view *cloth, const double *values, const double law[9],
                            drape_term_builder *builder)
{
    int64_t squares = 0, links = 0, parts = cloth->hinge_count;
    int most = 3; /* nodes per element */
    bool shifted = false;
    drape_midedge patch;
    for (int32_t t = 0; t < cloth->triangle_count; t++) {
        int32_t node[MIDEDGE_NODES];
        if (!drape_midedge_of(cloth, t, values, law, &patch))
            return drape_orthotropic_refuse(builder, t);
        const int nodes = gather_nodes(cloth, &patch, node);
        most = nodes > most ? nodes : most;
        squares += patch.rank;
        for (int h = 0; h < MIDEDGE_HINGES; h++) {
            parts += is_own(&patch, h);
            shifted = shifted || patch.shifted[h];
        }
        for (int r = 0; r < patch.rank; r++)
            for (int h = 0; h < MIDEDGE_HINGES; h++)
                links += patch.c[r][h] != 0;
        DRAPE_TRY(drape_term_check_cancel(builder, 4096));
    }
    if (links > INT32_MAX || parts > INT32_MAX)
        return drape_term_refuse(builder, "the mesh is too large: %.0f angles in elements; at most %d",
                                 (double)links, INT32_MAX);
    const bool own = parts > cloth->hinge_count;
    if (own)
        drape_term_anchor(builder);
    DRAPE_TRY(drape_term_reserve_nodes(builder, (int32_t)squares, most, REST_COUNT));
    return drape_term_reserve_parts(builder, (int32_t)parts, (int32_t)links,
                                    !own      ? 0
                                    : shifted ? PART_COUNT
                                              : CLAMP_COUNT);
}

static double min_altitude(const double *x0, const double *x1, const double *x2)
{
    double a[3], b[3], c[3], n[3];
    vec3_sub(x1, x0, a);
    vec3_sub(x2, x0, b);
    vec3_sub(x2, x1, c);
    vec3_cross(a, b, n);
    return vec3_norm(n) / sqrt(fmax(vec3_dot(a, a), fmax(vec3_dot(b, b), vec3_dot(c, c))));
}

/* Sets the parts of a patch: their numbers, signs and angles at rest. next: the number of the next part
 * that no other patch has set. */
static void set_parts(const drape_cloth_view *cloth, const drape_midedge *patch, int32_t *next,
                      drape_term_builder *builder, int32_t part[MIDEDGE_HINGES], int sign[MIDEDGE_HINGES],
                      double theta[MIDEDGE_HINGES])
{
    for (int h = 0; h < MIDEDGE_HINGES; h++) {
        const bool clamped = is_clamped(patch, h);
        int32_t node[4];
        double rest[PART_COUNT] = {0};
        part[h] = -1;
        if (is_own(patch, h))
            part[h] = (*next)++;
        if (!is_linked(patch, h))
            continue;
        sign[h] = part_nodes(cloth, patch, h, node);
        if (clamped) {
            /* r of a clamped edge: in the plane of the triangle, across the edge and away from the apex.
             * An edge that is held in a plane may turn in it: a part of r along the edge would then come
             * to lie across the sheet. */
            double *r = rest + PART_R;
            const double *a = cloth->rest + 3 * (size_t)patch->node[h],
                         *b = cloth->rest + 3 * (size_t)patch->node[(h + 1) % 3];
            const double *apex = cloth->rest + 3 * (size_t)patch->node[(h + 2) % 3];
            double edge[3];
            vec3_sub(b, a, edge);
            vec3_sub(a, apex, r);
            vec3_add_scaled(-vec3_dot(r, edge) / vec3_dot(edge, edge), edge, r);
        } else if (!patch->shifted[h])
            part[h] = hinge_at(cloth, patch->edge[h]);
        for (int k = 0; !clamped && k < 4; k++)
            memcpy(rest + PART_SHIFT + 3 * k, patch->at_rest[drape_patch_hinge[h][k]], 3 * sizeof *rest);
        /* The angle of a part at rest, by the function that steps use, so that a cloth at rest has no
         * force to the last bit. */
        static const int32_t same[LANES] = {0};
        static const double flat = 0;
        const drape_parts one = {
            .count = 1, .nodes = 4, .rest_count = PART_COUNT, .node = node, .rest = rest};
        const drape_elements el = {.parts = &one};
        double s[LANES];
        measure_angles(&el, same, cloth->rest, &flat, s, NULL, NULL);
        theta[h] = s[0];
        for (int k = 0; !clamped && k < 4; k++)
            memcpy(rest + PART_SHIFT + 3 * k, patch->shift[drape_patch_hinge[h][k]], 3 * sizeof *rest);
        drape_term_set_part(builder, part[h], node, rest);
        if (clamped && cloth->edge_turn)
            drape_term_turn_part(builder, part[h], cloth->edge_turn[patch->edge[h]]);
    }
}

/* The sliders of a square for each unit of its stiffness, and the share of that which is elastic. */
typedef struct hysteresis {
    int count;
    double stiffness[2], limit[2], elastic;
} hysteresis;

static drape_status hysteresis_of(const double *values, const double law[9], drape_term_builder *builder,
                                  hysteresis *out)
{
    const double friction = values[PARAM_FRICTION], begins = values[PARAM_FRICTION_CURVATURE],
                 yield = values[PARAM_YIELD_CURVATURE], hardening = values[PARAM_HARDENING];
    *out = (hysteresis){.elastic = 1};
    if (friction > 0 && isnan(begins))
        return drape_term_refuse(builder, "\"friction\" = %g needs \"friction_curvature\"", friction);
    if (!(friction > 0) && !isnan(begins))
        return drape_term_refuse(builder, "\"friction_curvature\" = %g is given without \"friction\"",
                                 begins);
    if (isnan(yield) != isnan(hardening))
        return drape_term_refuse(builder, "\"%s\" is given without \"%s\"",
                                 isnan(yield) ? "hardening" : "yield_curvature",
                                 isnan(yield) ? "yield_curvature" : "hardening");
    if ((friction > 0 || !isnan(yield)) && law[1] != 0)
        return drape_term_refuse(
            builder, "\"%s\" needs \"poisson\" 0: warp and weft slide independently of each other",
            friction > 0 ? "friction" : "yield_curvature");
    if (friction > 0) {
        out->stiffness[out->count] = friction / begins;
        out->limit[out->count++] = friction;
    }
    if (!isnan(yield)) {
        out->elastic = hardening;
        out->stiffness[out->count] = 1 - hardening;
        out->limit[out->count++] = (1 - hardening) * yield;
    }
    return DRAPE_OK;
}

/* Whether warp and weft are known on a triangle: yarns slide along them, even if the law has no direction. */
static bool has_warp(const drape_cloth_view *cloth, const double *values, int32_t triangle)
{
    static const double woven[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}; /* any law that is not isotropic */
    double axes[6], flat[6];
    return drape_orthotropic_frame(values, cloth, triangle, woven, axes, flat);
}

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    const double *bend = values + PARAM_CURVATURE;
    double law[9];
    const drape_material *m = cloth->material;
    drape_orthotropic_law(values, cloth->bending,
                          m->flexural_rigidity * (1 - m->poisson_ratio * m->poisson_ratio), m->poisson_ratio,
                          law);
    hysteresis slides;
    /* The squares of a patch are found from products of stiffnesses, which must not underflow. */
    for (int i = 0; i < 3; i++)
        if (!(law[4 * i] >= LEAST_STIFFNESS))
            return drape_term_refuse(builder,
                                     "a bending stiffness of %g N m is too small to be computed with; it is "
                                     "at least %g N m",
                                     law[4 * i], LEAST_STIFFNESS);
    DRAPE_TRY(hysteresis_of(values, law, builder, &slides));
    DRAPE_TRY(reserve(cloth, values, law, builder));
    if (slides.count > 0)
        DRAPE_TRY(drape_term_reserve_sliders(builder, slides.count));
    int32_t element = 0, next = cloth->hinge_count;
    for (int32_t t = 0; t < cloth->triangle_count; t++) {
        drape_midedge patch;
        int32_t part[MIDEDGE_HINGES], node[MIDEDGE_NODES];
        int sign[MIDEDGE_HINGES];
        double theta[MIDEDGE_HINGES];
        if (slides.count > 0 && !has_warp(cloth, values, t))
            return drape_orthotropic_refuse(builder, t);
        drape_midedge_of(cloth, t, values, law, &patch);
        set_parts(cloth, &patch, &next, builder, part, sign, theta);
        for (int a = gather_nodes(cloth, &patch, node); a < MIDEDGE_NODES; a++)
            node[a] = node[0];
        for (int r = 0; r < patch.rank; r++, element++) {
            const double *l = patch.l + 3 * r;
            double rest[REST_COUNT] = {[REST_K] = slides.elastic * patch.k[r]};
            rest[REST_ALTITUDE] =
                min_altitude(cloth->rest + 3 * (size_t)node[0], cloth->rest + 3 * (size_t)node[1],
                             cloth->rest + 3 * (size_t)node[2]);
            for (int h = 0; h < MIDEDGE_HINGES; h++) {
                if (patch.c[r][h] == 0)
                    continue;
                const double weight = sign[h] * patch.c[r][h];
                drape_term_link(builder, element, part[h], weight);
                if (values[PARAM_REST] == REST_MESH)
                    rest[REST_Q0] += weight * theta[h];
            }
            rest[REST_Q0] += l[0] * bend[0] + l[1] * bend[1] + 2 * l[2] * bend[2];
            drape_term_set(builder, element, node, rest);
            for (int s = 0; s < slides.count; s++)
                drape_term_set_slider(builder, s, element, slides.stiffness[s] * patch.k[r],
                                      slides.limit[s] * patch.k[r]);
        }
        DRAPE_TRY(drape_term_check_cancel(builder, 4096));
    }
    return DRAPE_OK;
}

/* ---- Internal variables ---- */

/* The angles on the branches nearest to before; the arrays may be the same. */
static void commit(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *before, double *after)
{
    for (int32_t i = first; i < first + count; i += LANES) {
        int32_t part[LANES];
        double s[LANES];
        drape_lanes_elements(i, first + count, part);
        measure_angles(el, part, x, before, s, NULL, NULL);
        for (int l = 0; l < LANES; l++)
            after[part[l]] = s[l];
    }
}

static void initial(const drape_elements *el, int32_t first, int32_t count, const double *x, double *after)
{
    memset(after + first, 0, (size_t)count * sizeof *after);
    commit(el, first, count, x, after, after);
}

/* ---- Checking ---- */

static double altitude_ratio(const drape_elements *el, int32_t element, const double *x)
{
    const int32_t *n = el->node + (size_t)element * (size_t)el->nodes;
    return min_altitude(x + 3 * (size_t)n[0], x + 3 * (size_t)n[1], x + 3 * (size_t)n[2]) /
           drape_rest_of(el, REST_ALTITUDE, element);
}

/* A collapsed altitude is reported first: the angles of a collapsed triangle are meaningless. */
static drape_status check(const drape_elements *el, const double *x, const double *before,
                          const double *internal, drape_fault *fault)
{
    drape_fault low = {drape_reason_name(DRAPE_REASON_ALTITUDE_COLLAPSE), "altitude / smallest rest altitude",
                       -1, INFINITY, DRAPE_MIN_RATIO};
    drape_fault turned = {drape_reason_name(DRAPE_REASON_HINGE_BRANCH), "turn of a hinge in one step [rad]",
                          -1, 0, DRAPE_MAX_TURN};
    for (int32_t e = 0; e < el->count; e++) {
        const int32_t *n = el->node + (size_t)e * (size_t)el->nodes;
        if (e > 0 &&
            memcmp(n, n - el->nodes, 3 * sizeof *n) == 0) /* squares of a triangle follow each other */
            continue;
        const double ratio = altitude_ratio(el, e, x);
        if (ratio < low.value &&
            (ratio >= low.limit || !before || drape_fell(ratio, altitude_ratio(el, e, before)))) {
            low.value = ratio;
            low.element = e;
        }
    }
    const drape_parts *parts = el->parts;
    for (int32_t i = 0; i < parts->count; i += LANES) {
        int32_t part[LANES];
        double s[LANES];
        drape_lanes_elements(i, parts->count, part);
        measure_angles(el, part, x, internal, s, NULL, NULL);
        for (int l = 0; l < LANES; l++) {
            const double turn = fabs(s[l] - internal[part[l]]);
            if (turn > turned.value) {
                turned.value = turn;
                turned.element = parts->element[parts->user[parts->first_user[part[l]]]];
            }
        }
    }
    *fault = low.value < low.limit ? low : turned;
    return low.value < low.limit || turned.value > turned.limit ? DRAPE_RETRY_DEGENERATE : DRAPE_OK;
}

const drape_term_ops drape_term_bend_midedge = {
    .struct_size = sizeof(drape_term_ops),
    .entry =
        {.name = "bend.midedge",
         .summary =
             "bending of every triangle, a plate with the true Poisson ratio on any mesh: E = A/2 (K - "
             "K0)'C(K - K0)",
         .reference =
             "Grinspun, Gingold, Reisman & Zorin 2006, section 4, with edge normals computed from the nodes",
         DRAPE_PARAMS(params)},
    .element_name = "square",
    .nodes = MIDEDGE_NODES,
    .has_internal = true,
    .part_nodes = 4,
    .build = build,
    .measure = measure,
    .part = measure_angles,
    .commit = commit,
    .initial = initial,
    .check = check,
    .periodic = true,
    .takes_clamps = true,
};
