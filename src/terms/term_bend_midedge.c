/*
 * bend.midedge: bending of every triangle, E = A/2 (K - K0)' C (K - K0), K = (K11, K22, 2 K12) its shape
 * operator with normals at the middles of its edges (midedge.h), C the law of orthotropic.h.
 *
 * C = sum k l l', so E = 1/2 sum k (q - q0)^2 with q = l . K = sum c theta over at most nine hinges. Each
 * square is an element: three per triangle, less one for each free edge. Elements have 12 nodes, or 6 if no
 * triangle needs hinges other than its own, as on lattices. A hinge whose c is 0 is left out, and its nodes
 * are replaced by the first node.
 *
 * A clamped edge has a direction in space instead of a second triangle: x3 = (x0 + x1)/2 + r with r as at
 * rest.
 *
 * The internal variables are the nine angles in the last accepted state: each angle is taken on the branch
 * nearest to it.
 */
#include "base/reason.h"
#include "base/vec3.h"
#include "terms/dihedral.h"
#include "terms/midedge.h"
#include "terms/orthotropic.h"
#include "terms/terms.h"

#include <math.h>
#include <string.h>

enum {
    PARAM_REST = DRAPE_ORTHOTROPIC_COUNT,
    PARAM_CURVATURE,
    PARAM_MIN_ALTITUDE = PARAM_CURVATURE + 3,
    PARAM_MAX_TURN
};
enum {
    LIST_REST = DRAPE_ORTHOTROPIC_DIRECTION + 1,
    LIST_CURVATURE,
    LIST_MIN_ALTITUDE,
    LIST_MAX_TURN,
    LIST_COUNT
};
enum { REST_MESH, REST_FLAT };
enum {
    REST_K,
    REST_Q0,
    REST_ALTITUDE, /* smallest of the triangle [m] */
    REST_C,
    REST_COUNT = REST_C + MIDEDGE_HINGES,
    REST_CLAMP =
        REST_COUNT, /* r of each own edge, 0 if it is not clamped; only if some edge of the cloth is */
    REST_COUNT_CLAMPED = REST_CLAMP + 9
};

static const char *const rest_choices[] = {"mesh", "flat", NULL};

/* As a list the direction is one entry; among the values it takes three. */
static const drape_param params[LIST_COUNT] = {
    DRAPE_ORTHOTROPIC_PARAMS("N m", "of the material: its fabric, or E h^3/12", "twist",
                             "torsional rigidity: the curvature K12 stores 2 twist K12^2 per area"),
    [LIST_REST] = DRAPE_CHOICE("rest", REST_MESH, rest_choices, "rest curvature: that of the mesh, or flat"),
    [LIST_CURVATURE] = DRAPE_VECTOR("curvature", "1/m", 0, -1e9, 1e9,
                                    "added to the rest curvature: along the warp, along the weft, twist; "
                                    "positive towards the side from which triangles turn counterclockwise",
                                    .numbers = "[k11, k22, k12]"),
    [LIST_MIN_ALTITUDE] = DRAPE_NUMBER("min_altitude", "1", 1e-6, 0, DRAPE_BELOW(1),
                                       "a step that takes an altitude of a triangle below this fraction of "
                                       "its smallest one at rest is rejected"),
    [LIST_MAX_TURN] =
        DRAPE_NUMBER("max_turn", "rad", 2.8, DRAPE_ABOVE(0), 3.14159265358979,
                     "a step that turns a hinge by more is rejected: near pi its angle is ambiguous"),
};

/* r of an own edge; false if it is not clamped. */
static bool clamp_of(const drape_elements *el, int32_t element, int hinge, double r[3])
{
    if (el->rest_count == REST_COUNT || hinge > 2)
        return false;
    for (int i = 0; i < 3; i++)
        r[i] = drape_rest_of(el, REST_CLAMP + 3 * hinge + i, element);
    return vec3_dot(r, r) > 0;
}

/* Up to LANES hinges of an element: their numbers, their nodes (3 if clamped, else 4), and their angles with
 * derivatives by these nodes. */
typedef struct hinges {
    int count, number[LANES], nodes[LANES];
    double theta[LANES], g[12 * LANES], h[144 * LANES];
} hinges;

/* Gathers the corners of a hinge; returns the number of its nodes. */
static int corners_of(const drape_elements *el, int32_t element, int hinge, const double *x, double at[12])
{
    const int32_t *node = el->node + (size_t)element * (size_t)el->nodes;
    const int *local = drape_midedge_hinge[hinge];
    double r[3];
    const int nodes = clamp_of(el, element, hinge, r) ? 3 : 4;
    for (int a = 0; a < nodes; a++)
        memcpy(at + 3 * a, x + 3 * (size_t)node[local[a]], 3 * sizeof *at);
    for (int i = 0; nodes == 3 && i < 3; i++)
        at[9 + i] = (at[i] + at[3 + i]) / 2 + r[i];
    return nodes;
}

/* Measures hinges from number `from` on, leaving out those whose c is 0, with first and second derivatives if
 * wanted; returns the number to continue with. */
static int measure_hinges(const drape_elements *el, int32_t element, int from, const double *x, bool first,
                          bool second, hinges *s)
{
    double at[12 * LANES];
    s->count = 0;
    for (; from < MIDEDGE_HINGES && s->count < LANES; from++) {
        if (drape_rest_of(el, REST_C + from, element) == 0)
            continue;
        s->number[s->count] = from;
        s->nodes[s->count] = corners_of(el, element, from, x, at + 12 * s->count);
        s->count++;
    }
    if (s->count > 0)
        drape_dihedrals(s->count, at, s->theta, first ? s->g : NULL, second ? s->h : NULL);
    for (int i = 0; i < s->count; i++)
        if (s->nodes[i] == 3)
            drape_dihedral_tie(first ? s->g + 12 * i : NULL, second ? s->h + 144 * i : NULL);
    return from;
}

/* Adds c times the derivatives of hinge i. d: length of a gradient. */
static void add_hinge(const hinges *s, int i, double c, int d, double *dq, double *ddq)
{
    const int *local = drape_midedge_hinge[s->number[i]];
    for (int k = 0; dq && k < 3 * s->nodes[i]; k++)
        dq[3 * local[k / 3] + k % 3] += c * s->g[12 * i + k];
    for (int k = 0; ddq && k < 3 * s->nodes[i]; k++)
        for (int j = 0; j < 3 * s->nodes[i]; j++)
            ddq[d * (3 * local[k / 3] + k % 3) + 3 * local[j / 3] + j % 3] += c * s->h[144 * i + 12 * k + j];
}

static void measure_one(const drape_elements *el, int32_t element, const double *x, const double *before,
                        double *q, double *dq, double *ddq)
{
    const int d = 3 * el->nodes;
    hinges s;
    *q = 0;
    if (dq)
        memset(dq, 0, (size_t)d * sizeof *dq);
    if (ddq)
        memset(ddq, 0, (size_t)(d * d) * sizeof *ddq);
    for (int from = 0; from < MIDEDGE_HINGES;) {
        from = measure_hinges(el, element, from, x, dq != NULL, ddq != NULL, &s);
        for (int i = 0; i < s.count; i++) {
            const double c = drape_rest_of(el, REST_C + s.number[i], element);
            *q += c * drape_nearest_branch(s.theta[i], before[s.number[i]]);
            add_hinge(&s, i, c, d, dq, ddq);
        }
    }
}

static void measure(const drape_elements *el, int32_t first, int32_t count, const double *x,
                    const double *internal, double *q, double *dq, double *ddq)
{
    const size_t d = 3 * (size_t)el->nodes;
    for (int32_t i = 0; i < count; i++)
        measure_one(el, first + i, x, internal + MIDEDGE_HINGES * (size_t)(first + i), q + i,
                    dq ? dq + d * (size_t)i : NULL, ddq ? ddq + d * d * (size_t)i : NULL);
}

/* ---- Building ---- */

/* Counts elements, their nodes and rest values, and reserves them. */
static drape_status reserve(const drape_cloth_view *cloth, const double *values, const double law[9],
                            drape_term_builder *builder)
{
    int64_t count = 0;
    bool wide = false, clamped = false;
    drape_midedge patch;
    for (int32_t t = 0; t < cloth->triangle_count; t++) {
        if (!drape_midedge_of(cloth, t, values, law, &patch))
            return drape_orthotropic_refuse(builder, t);
        count += patch.rank;
        wide = wide || patch.wide;
        clamped = clamped || patch.clamped[0] || patch.clamped[1] || patch.clamped[2];
    }
    if (count > INT32_MAX)
        return drape_term_refuse(builder, "the mesh is too large: %.0f elements; at most %d", (double)count,
                                 INT32_MAX);
    if (clamped)
        drape_term_anchor(builder);
    return drape_term_reserve_nodes(builder, (int32_t)count, wide ? MIDEDGE_NODES : MIDEDGE_NEAR,
                                    clamped ? REST_COUNT_CLAMPED : REST_COUNT);
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

/* r of clamped edges: in the plane of the triangle, from the middle of the edge away from it. */
static void set_clamps(const drape_cloth_view *cloth, const drape_midedge *patch, double *rest)
{
    for (int i = 0; i < 3; i++) {
        const double *a = cloth->rest + 3 * (size_t)patch->node[i],
                     *b = cloth->rest + 3 * (size_t)patch->node[(i + 1) % 3];
        const double *apex = cloth->rest + 3 * (size_t)patch->node[(i + 2) % 3];
        for (int k = 0; patch->clamped[i] && k < 3; k++)
            rest[3 * i + k] = (a[k] + b[k]) / 2 - apex[k];
    }
}

/* The nodes of the hinges of square r; for the others the first node. */
static void set_nodes(const drape_midedge *patch, int r, int32_t node[MIDEDGE_NODES])
{
    for (int a = 0; a < MIDEDGE_NODES; a++)
        node[a] = patch->node[a < 3 ? a : 0];
    for (int h = 0; h < MIDEDGE_HINGES; h++)
        for (int a = 0; patch->c[r][h] != 0 && a < 4; a++)
            if (patch->node[drape_midedge_hinge[h][a]] >= 0)
                node[drape_midedge_hinge[h][a]] = patch->node[drape_midedge_hinge[h][a]];
}

/* q at rest, by the function that steps use, so that a cloth at rest has no force to the last bit. */
static double rest_measure(const drape_cloth_view *cloth, const int32_t *node, const double *rest,
                           int rest_count)
{
    static const double flat[MIDEDGE_HINGES] = {0};
    const drape_elements one = {
        .count = 1, .nodes = MIDEDGE_NODES, .rest_count = rest_count, .node = node, .rest = rest};
    double q;
    measure_one(&one, 0, cloth->rest, flat, &q, NULL, NULL);
    return q;
}

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    const double *bend = values + PARAM_CURVATURE;
    double law[9];
    const drape_material *m = cloth->material;
    drape_orthotropic_law(values, cloth->bending,
                          m->flexural_rigidity * (1 - m->poisson_ratio * m->poisson_ratio), m->poisson_ratio,
                          law);
    drape_status status = reserve(cloth, values, law, builder);
    int32_t element = 0;
    for (int32_t t = 0; !status && t < cloth->triangle_count; t++) {
        drape_midedge patch;
        drape_midedge_of(cloth, t, values, law, &patch);
        const int32_t *n = patch.node;
        for (int r = 0; r < patch.rank; r++) {
            const double *l = patch.l + 3 * r;
            double rest[REST_COUNT_CLAMPED] = {0};
            int32_t node[MIDEDGE_NODES];
            rest[REST_K] = patch.k[r];
            rest[REST_ALTITUDE] = min_altitude(cloth->rest + 3 * (size_t)n[0], cloth->rest + 3 * (size_t)n[1],
                                               cloth->rest + 3 * (size_t)n[2]);
            memcpy(rest + REST_C, patch.c[r], sizeof patch.c[r]);
            set_clamps(cloth, &patch, rest + REST_CLAMP);
            set_nodes(&patch, r, node);
            if (values[PARAM_REST] == REST_MESH)
                rest[REST_Q0] = rest_measure(cloth, node, rest, REST_COUNT_CLAMPED);
            rest[REST_Q0] += l[0] * bend[0] + l[1] * bend[1] + 2 * l[2] * bend[2];
            drape_term_set(builder, element++, node, rest);
        }
    }
    return status;
}

/* ---- Internal variables ---- */

/* The angles on the branches nearest to before; 0 for hinges that are left out. */
static void update_angles(const drape_elements *el, int32_t element, const double *x, const double *before,
                          double *after)
{
    hinges s;
    memset(after, 0, MIDEDGE_HINGES * sizeof *after);
    for (int from = 0; from < MIDEDGE_HINGES;) {
        from = measure_hinges(el, element, from, x, false, false, &s);
        for (int i = 0; i < s.count; i++)
            after[s.number[i]] = drape_nearest_branch(s.theta[i], before[s.number[i]]);
    }
}

static void initial(const drape_elements *el, int32_t first, int32_t count, const double *x, double *after)
{
    static const double flat[MIDEDGE_HINGES] = {0};
    for (int32_t e = first; e < first + count; e++)
        update_angles(el, e, x, flat, after + MIDEDGE_HINGES * (size_t)e);
}

static void commit(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *before, double *after)
{
    for (int32_t e = first; e < first + count; e++)
        update_angles(el, e, x, before + MIDEDGE_HINGES * (size_t)e, after + MIDEDGE_HINGES * (size_t)e);
}

/* ---- Checking ---- */

static double altitude_ratio(const drape_elements *el, int32_t element, const double *x)
{
    const int32_t *n = el->node + (size_t)element * (size_t)el->nodes;
    return min_altitude(x + 3 * (size_t)n[0], x + 3 * (size_t)n[1], x + 3 * (size_t)n[2]) /
           drape_rest_of(el, REST_ALTITUDE, element);
}

static double largest_turn(const drape_elements *el, int32_t element, const double *x, const double *before)
{
    double after[MIDEDGE_HINGES], turn = 0;
    update_angles(el, element, x, before, after);
    for (int k = 0; k < MIDEDGE_HINGES; k++)
        if (after[k] != 0)
            turn = fmax(turn, fabs(after[k] - before[k]));
    return turn;
}

/* A collapsed altitude is reported first: the angles of a collapsed triangle are meaningless. */
static drape_status check(const drape_elements *el, const double *x, const double *before,
                          const double *internal, drape_fault *fault)
{
    drape_fault low = {drape_reason_name(DRAPE_REASON_ALTITUDE_COLLAPSE), "altitude / smallest rest altitude",
                       -1, INFINITY, el->params[PARAM_MIN_ALTITUDE]};
    drape_fault turned = {drape_reason_name(DRAPE_REASON_HINGE_BRANCH), "turn of a hinge in one step [rad]",
                          -1, 0, el->params[PARAM_MAX_TURN]};
    for (int32_t e = 0; e < el->count; e++) {
        const double ratio = altitude_ratio(el, e, x),
                     turn = largest_turn(el, e, x, internal + MIDEDGE_HINGES * (size_t)e);
        if (ratio < low.value &&
            (ratio >= low.limit || !before || drape_fell(ratio, altitude_ratio(el, e, before)))) {
            low.value = ratio;
            low.element = e;
        }
        if (turn > turned.value) {
            turned.value = turn;
            turned.element = e;
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
    .internal_count = MIDEDGE_HINGES,
    .build = build,
    .measure = measure,
    .commit = commit,
    .initial = initial,
    .check = check,
};
