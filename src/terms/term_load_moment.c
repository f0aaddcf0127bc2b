/*
 * load.moment: a moment per length on boundary edges, about each edge as it was at rest: E = M L psi with the
 * rest length L and the twist psi of the edge's triangle about the direction e0 of the edge at rest. With q
 * the unit quaternion of the triangle's rotation, psi = 2 atan2(q . e0, q_w). By the unit vectors t, in the
 * triangle's plane from the edge to the apex, and n, the normal, and their values t0 and n0 at rest,
 *     S = n0.t - t0.n = 4 q_w (q . e0),  C = t0.t + n0.n = 2 (q_w^2 - (q . e0)^2),  psi = atan2(S, C).
 * It bends a strip to the curvature M/D at any angle. If the edge is also tilted by a small angle, the moment
 * turns by half that angle: a semitangential moment (Argyris, Dunne & Scharpf 1978, On large displacement -
 * small strain analysis of structures with rotational degrees of freedom), whose potential is unchanged by
 * the tilt to second order. A moment about the present edge is not: its work changes by M sin(2 psi) w^2/4
 * with a tilt w, which tips over a strip wound up by more than 3.7. psi is undefined if the triangle has
 * turned by pi about a direction across e0.
 *
 * The internal variable is the angle in the last accepted state: angles are taken on the branch nearest to
 * it.
 */
#include "base/elementary.h"
#include "base/vec3.h"
#include "terms/dihedral.h"
#include "terms/load_edges.h"
#include "terms/terms.h"

#include <math.h>
#include <string.h>

enum { LIST_MOMENT = DRAPE_LOAD_LIST_COUNT, LIST_HISTORY, LIST_RAMP, LIST_COUNT };
enum { PARAM_MOMENT = DRAPE_LOAD_COUNT };
enum { REST_MOMENT, REST_TANGENT, REST_NORMAL = 4, REST_COUNT = 7 }; /* M L [N m], t0, n0 */

static const drape_param params[LIST_COUNT] = {
    DRAPE_LOAD_PARAMS,
    [LIST_MOMENT] = DRAPE_NUMBER("moment", "N", DRAPE_REQUIRED, -1e12, 1e12,
                                 "moment per length of the edge [N m/m]; positive: it bends towards the side "
                                 "from which triangles turn counterclockwise"),
    [LIST_HISTORY] = DRAPE_TERM_HISTORY_PARAM,
    [LIST_RAMP] = DRAPE_TERM_RAMP_PARAM,
};

/* The edge in the orientation of its triangle, then the apex. */
static void corners(const drape_cloth_view *cloth, int32_t e, int32_t node[3])
{
    const int32_t t = cloth->edge_triangle[2 * (size_t)e];
    for (int k = 0; k < 3; k++)
        if (cloth->triangle_edge[3 * (size_t)t + (size_t)k] == e)
            for (int i = 0; i < 3; i++)
                node[i] = cloth->triangle[3 * (size_t)t + (size_t)((k + i) % 3)];
}

/* ---- Unit vectors of a triangle as functions of d = x1 - x0 and g = x2 - x0 ---- */

/* A vector a(d, g), its norm, and its derivatives by d and by g. */
typedef struct direction {
    double unit[3], norm, by[3][6];
} direction;

static void normalize(direction *v, const double a[3])
{
    v->norm = vec3_norm(a);
    for (int i = 0; i < 3; i++)
        v->unit[i] = a[i] / v->norm;
}

/* Along d x g. */
static void measure_normal(const double d[3], const double g[3], direction *n)
{
    double a[3];
    vec3_cross(d, g, a);
    normalize(n, a);
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3; /* a_i = d_j g_k - d_k g_j */
        n->by[i][i] = n->by[i][3 + i] = 0;
        n->by[i][j] = g[k];
        n->by[i][k] = -g[j];
        n->by[i][3 + j] = -d[k];
        n->by[i][3 + k] = d[j];
    }
}

/* Along (d x g) x d = g d.d - d d.g. */
static void measure_tangent(const double d[3], const double g[3], direction *t)
{
    const double dd = vec3_dot(d, d), dg = vec3_dot(d, g);
    double a[3];
    for (int i = 0; i < 3; i++)
        a[i] = g[i] * dd - d[i] * dg;
    normalize(t, a);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            t->by[i][j] = 2 * g[i] * d[j] - d[i] * g[j] - (i == j) * dg;
            t->by[i][3 + j] = (i == j) * dd - d[i] * d[j];
        }
}

/* Add to h the second derivatives by (d, g) of v . (d x g), and of v . (g d.d - d d.g). */
static void add_normal_second(const double v[3], double h[6][6])
{
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        h[j][3 + k] += v[i];
        h[k][3 + j] -= v[i];
        h[3 + k][j] += v[i];
        h[3 + j][k] -= v[i];
    }
}

static void add_tangent_second(const double d[3], const double g[3], const double v[3], double h[6][6])
{
    const double vd = vec3_dot(v, d), vg = vec3_dot(v, g);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const double mixed = 2 * d[i] * v[j] - v[i] * d[j] - (i == j) * vd;
            h[i][j] += 2 * (i == j) * vg - v[i] * g[j] - g[i] * v[j];
            h[i][3 + j] += mixed;
            h[3 + j][i] += mixed;
        }
}

/* The derivative of c . unit by a: c without its component along the unit vector, over the norm. */
static void across(const direction *v, const double c[3], double out[3])
{
    const double along = vec3_dot(c, v->unit);
    for (int i = 0; i < 3; i++)
        out[i] = (c[i] - along * v->unit[i]) / v->norm;
}

/* Adds to g the derivatives of c . unit. */
static void add_first(const direction *v, const double c[3], double g[6])
{
    double b[3];
    across(v, c, b);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 6; j++)
            g[j] += b[i] * v->by[i][j];
}

/* Adds to h the second derivatives of c . unit, without the part b . (second derivatives of a), where b is
 * given by across(). The second derivatives by a are -(u b' + b u' + (c.u) (I - u u')/|a|)/|a|. */
static void add_second(const direction *v, const double c[3], double h[6][6])
{
    double b[3], curvature[3][3];
    const double along = vec3_dot(c, v->unit) / v->norm;
    across(v, c, b);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            curvature[i][j] =
                -(v->unit[i] * b[j] + b[i] * v->unit[j] + along * ((i == j) - v->unit[i] * v->unit[j])) /
                v->norm;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 6; k++) {
            double sum = 0;
            for (int j = 0; j < 3; j++)
                sum += curvature[i][j] * v->by[j][k];
            for (int l = 0; l < 6; l++)
                h[l][k] += v->by[i][l] * sum;
        }
}

/* ---- The angle ---- */

/* The quantities that psi of an element is computed from. */
typedef struct twist {
    double d[3], g[3], t0[3], n0[3];
    direction t, n;
    double sine, cosine, square; /* S, C, S^2 + C^2 */
} twist;

static double measure_twist(const drape_elements *el, int32_t element, const double *x, twist *w)
{
    const int32_t *node = el->node + 3 * (size_t)element;
    vec3_triangle_sides(node, x, w->d, w->g);
    for (int i = 0; i < 3; i++) {
        w->t0[i] = drape_rest_of(el, REST_TANGENT + i, element);
        w->n0[i] = drape_rest_of(el, REST_NORMAL + i, element);
    }
    measure_normal(w->d, w->g, &w->n);
    measure_tangent(w->d, w->g, &w->t);
    w->sine = vec3_dot(w->n0, w->t.unit) - vec3_dot(w->t0, w->n.unit);
    w->cosine = vec3_dot(w->t0, w->t.unit) + vec3_dot(w->n0, w->n.unit);
    w->square = w->sine * w->sine + w->cosine * w->cosine;
    return drape_atan2(w->sine, w->cosine);
}

/* p and q such that p . t + q . n, with p and q constant, has the derivatives C S' - S C'. */
static void find_factors(const twist *w, double p[3], double q[3])
{
    for (int i = 0; i < 3; i++) {
        p[i] = w->cosine * w->n0[i] - w->sine * w->t0[i];
        q[i] = -w->cosine * w->t0[i] - w->sine * w->n0[i];
    }
}

/* Converts derivatives by (d, g) to derivatives by the nodes x0 x1 x2, times scale. */
static void to_nodes(double scale, const double by[6], double g[9])
{
    for (int i = 0; i < 3; i++) {
        g[i] = -scale * (by[i] + by[3 + i]);
        g[3 + i] = scale * by[i];
        g[6 + i] = scale * by[3 + i];
    }
}

static void put_hessian(const twist *w, double scale, double *hess)
{
    double h[6][6] = {{0}}, rows[6][9], column[6], full[9];
    /* Adds C S'' - S C'' to h, by (d, g). */
    double p[3], q[3], b[3];
    find_factors(w, p, q);
    add_second(&w->t, p, h);
    across(&w->t, p, b);
    add_tangent_second(w->d, w->g, b, h);
    add_second(&w->n, q, h);
    across(&w->n, q, b);
    add_normal_second(b, h);
    /* Adds (2 S C (C' C'^T - S' S'^T) + (S^2 - C^2) (S' C'^T + C' S'^T))/(S^2 + C^2) to h, by (d, g). */
    const double same = 2 * w->sine * w->cosine / w->square,
                 mixed = (w->sine * w->sine - w->cosine * w->cosine) / w->square,
                 back[3] = {-w->t0[0], -w->t0[1], -w->t0[2]};
    double by_sine[6] = {0}, by_cosine[6] = {0};
    add_first(&w->t, w->n0, by_sine);
    add_first(&w->n, back, by_sine);
    add_first(&w->t, w->t0, by_cosine);
    add_first(&w->n, w->n0, by_cosine);
    for (int k = 0; k < 6; k++)
        for (int l = 0; l < 6; l++)
            h[k][l] += same * (by_cosine[k] * by_cosine[l] - by_sine[k] * by_sine[l]) +
                       mixed * (by_sine[k] * by_cosine[l] + by_cosine[k] * by_sine[l]);
    for (int k = 0; k < 6; k++)
        to_nodes(scale / w->square, h[k], rows[k]);
    for (int l = 0; l < 9; l++) {
        for (int k = 0; k < 6; k++)
            column[k] = rows[k][l];
        to_nodes(1, column, full);
        for (int k = 0; k < 9; k++)
            hess[9 * k + l] = full[k];
    }
}

/* ---- The term ---- */

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    int32_t count, next = 0;
    DRAPE_TRY(drape_load_check_faces(cloth, builder));
    DRAPE_TRY(drape_load_count(cloth, values, builder, &count));
    DRAPE_TRY(drape_term_reserve(builder, count, REST_COUNT));
    for (int32_t e = 0; e < cloth->edge_count; e++) {
        int32_t node[3];
        double rest[REST_COUNT] = {values[PARAM_MOMENT] * cloth->edge_length[e]}, d[3], g[3];
        direction t, n;
        if (!drape_load_takes(cloth, values, e))
            continue;
        corners(cloth, e, node);
        vec3_triangle_sides(node, cloth->rest, d, g);
        measure_tangent(d, g, &t);
        measure_normal(d, g, &n);
        memcpy(rest + REST_TANGENT, t.unit, sizeof t.unit);
        memcpy(rest + REST_NORMAL, n.unit, sizeof n.unit);
        drape_term_set(builder, next++, node, rest);
    }
    return DRAPE_OK;
}

static void energy(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *internal, double *e, double *g, double *hess)
{
    for (int32_t i = 0; i < count; i++) {
        const double moment = drape_rest_of(el, REST_MOMENT, first + i);
        twist w;
        const double psi = measure_twist(el, first + i, x, &w);
        if (e)
            e[i] = moment * drape_nearest_branch(psi, internal[first + i]);
        if (g) {
            double p[3], q[3], by[6] = {0};
            find_factors(&w, p, q);
            add_first(&w.t, p, by);
            add_first(&w.n, q, by);
            to_nodes(moment / w.square, by, g + 9 * (size_t)i);
        }
        if (hess)
            put_hessian(&w, moment, hess + 81 * (size_t)i);
    }
}

static void initial(const drape_elements *el, int32_t first, int32_t count, const double *x, double *after)
{
    twist w;
    for (int32_t i = first; i < first + count; i++)
        after[i] = measure_twist(el, i, x, &w);
}

static void commit(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *before, double *after)
{
    twist w;
    for (int32_t i = first; i < first + count; i++)
        after[i] = drape_nearest_branch(measure_twist(el, i, x, &w), before[i]);
}

const drape_term_ops drape_term_load_moment = {
    .struct_size = sizeof(drape_term_ops),
    .entry =
        {.name = "load.moment",
         .summary =
             "a moment per length on edges of the boundary, about each edge at rest: bends a strip to M/D",
         .reference = "Argyris, Dunne & Scharpf 1978, semitangential moment: work on the twist of the "
                      "triangle at the edge",
         DRAPE_PARAMS(params)},
    .element_name = "edge",
    .nodes = 3,
    .has_internal = true,
    .external = true,
    .build = build,
    .energy = energy,
    .initial = initial,
    .commit = commit,
};
