/*
 * bend.hinge: a torsion spring along each inner edge, on the angle theta between its two triangles.
 *
 * Edge x0 x1, apices x2 x3, e = x1 - x0. For triangle t with apex a: unit normal n, along n1 = e x (x2 - x0)
 * for one and n2 = (x3 - x0) x e for the other; altitude H over e; foot s = (a - x0).e/|e|^2; and m the
 * in-plane unit vector from the edge to the apex.
 *     theta = atan2(ehat . (n2 x n1), n1 . n2), never acos, which loses all digits when flat
 *     gradient: g_a = n/H,  g_0 = -sum (1 - s_t) g_t,  g_1 = -sum s_t g_t
 * The Hessian follows by differentiating these, with the gradients of the barycentric coordinates:
 *     p_a = m/H,  p_0 = -(1 - s) m/H - ehat/|e|,  p_1 = -s m/H + ehat/|e|
 *     d g_a/d a  = -(p_a n' + n p_a')/H
 *     d g_a/d x0 = -(p_0 n' + n p_0')/H - n ehat'/(|e| H)
 *     d g_a/d x1 = -(p_1 n' + n p_1')/H + n ehat'/(|e| H)
 *     ds/da = ehat/|e|,  ds/dx0 = -((1 - s) e + H m)/|e|^2,  ds/dx1 = (-s e + H m)/|e|^2
 * Tamstorf & Grinspun 2013, Discrete bending forces and their Jacobians, has the same in closed form.
 *
 * E = 1/2 k (theta - theta0)^2.
 * consistent: k = D |e|^2/(A1 + A2), D = E h^3/(12 (1 - nu^2)). Its bending Poisson ratio is -1/3 on the
 *     equilateral lattice.
 * report: k = 2/sqrt(3) E h^3/12 on every hinge, as the DEP report and DisMech have it: no (1 - nu^2), right
 *     on equilateral meshes only.
 *
 * theta jumps by 2 pi where the hinge is folded onto itself. The internal variable is the angle of the last
 * accepted state; the angle is taken on the branch nearest to it, so energy and force go on smoothly through
 * pi.
 */
#include "base/vec3.h"
#include "terms/terms.h"

#include <math.h>
#include <string.h>

enum { PARAM_STIFFNESS, PARAM_REST, PARAM_MIN_ALTITUDE, PARAM_MAX_TURN, PARAM_COUNT };
enum { STIFFNESS_CONSISTENT, STIFFNESS_REPORT };
enum { REST_MESH, REST_FLAT };
enum { REST_K, REST_THETA0, REST_ALTITUDE1, REST_ALTITUDE2, REST_COUNT };

static const double pi = 3.14159265358979323846;

static const char *const stiffness_choices[] = {"consistent", "report", NULL};
static const char *const rest_choices[] = {"mesh", "flat", NULL};

static const drape_param params[PARAM_COUNT] = {
    [PARAM_STIFFNESS] =
        {.name = "stiffness",
         .kind = DRAPE_PARAM_CHOICE,
         .unit = "1",
         .default_value = STIFFNESS_CONSISTENT,
         .choices = stiffness_choices,
         .help = "consistent: k = D |e|^2/(A1 + A2); report: k = 2/sqrt(3) E h^3/12 on every hinge"},
    [PARAM_REST] = {.name = "rest",
                    .kind = DRAPE_PARAM_CHOICE,
                    .unit = "1",
                    .default_value = REST_MESH,
                    .choices = rest_choices,
                    .help = "rest angles: those of the mesh, or flat"},
    [PARAM_MIN_ALTITUDE] =
        {.name = "min_altitude",
         .kind = DRAPE_PARAM_NUMBER,
         .unit = "1",
         .default_value = 1e-6,
         .min = 0,
         .max = 1,
         .open_max = true,
         .help = "a step that takes an altitude over a hinge below this share of its rest value is rejected"},
    [PARAM_MAX_TURN] =
        {.name = "max_turn",
         .kind = DRAPE_PARAM_NUMBER,
         .unit = "rad",
         .default_value = 2.8,
         .min = 0,
         .max = 3.14159265358979,
         .open_min = true,
         .help = "a step that turns a hinge by more is rejected: near pi the branch of the angle is a guess"},
};

/* One triangle of a hinge: see the head of the file. */
typedef struct side {
    double n[3], m[3];
    double altitude, foot;
} side;

typedef struct hinge {
    double direction[3], length; /* ehat, |e| */
    side side[2];
    double theta; /* in (-pi, pi] */
} hinge;

static void measure_side(const double *origin, const double *apex, const double direction[3], double length,
                         double sign, side *s)
{
    double d[3], normal[3];
    vec3_sub(apex, origin, d);
    vec3_cross(direction, d, normal);
    s->altitude = vec3_norm(normal); /* |ehat x d| */
    s->foot = vec3_dot(d, direction) / length;
    for (int i = 0; i < 3; i++) {
        s->n[i] = sign * normal[i] / s->altitude;
        s->m[i] = (d[i] - s->foot * length * direction[i]) / s->altitude;
    }
}

static void measure_hinge(const drape_elements *el, int32_t element, const double *x, hinge *h)
{
    const int32_t *node = el->node + 4 * (size_t)element;
    const double *x0 = x + 3 * (size_t)node[0];
    double cross[3];
    vec3_sub(x + 3 * (size_t)node[1], x0, h->direction);
    h->length = vec3_norm(h->direction);
    for (int i = 0; i < 3; i++)
        h->direction[i] /= h->length;
    measure_side(x0, x + 3 * (size_t)node[2], h->direction, h->length, 1, &h->side[0]);
    measure_side(x0, x + 3 * (size_t)node[3], h->direction, h->length, -1, &h->side[1]);
    vec3_cross(h->side[1].n, h->side[0].n, cross);
    h->theta = atan2(vec3_dot(h->direction, cross), vec3_dot(h->side[0].n, h->side[1].n));
}

/* The branch of theta that is nearest to reference. */
static double unwrap(double theta, double reference)
{
    return theta + 2 * pi * round((reference - theta) / (2 * pi));
}

/* dq: g_0 g_1 g_2 g_3 */
static void gradient(const hinge *h, double *dq)
{
    for (int i = 0; i < 3; i++) {
        double g2 = h->side[0].n[i] / h->side[0].altitude, g3 = h->side[1].n[i] / h->side[1].altitude;
        dq[i] = -(1 - h->side[0].foot) * g2 - (1 - h->side[1].foot) * g3;
        dq[3 + i] = -h->side[0].foot * g2 - h->side[1].foot * g3;
        dq[6 + i] = g2;
        dq[9 + i] = g3;
    }
}

/* What one side adds to the rows of the Hessian for one column node: dg is d g_a / d column, ds is ds / d
 * column. */
static void add_rows(const side *s, const double dg[9], const double ds[3], int apex, int column, double *ddq)
{
    for (int i = 0; i < 3; i++) {
        double g = s->n[i] / s->altitude;
        for (int j = 0; j < 3; j++) {
            double a = dg[3 * i + j], b = g * ds[j];
            ddq[12 * i + 3 * column + j] += b - (1 - s->foot) * a;
            ddq[12 * (3 + i) + 3 * column + j] -= b + s->foot * a;
            ddq[12 * (3 * apex + i) + 3 * column + j] += a;
        }
    }
}

/* -(p n' + n p')/H + w n ehat'/(|e| H) */
static void normal_derivative(const side *s, const hinge *h, const double p[3], double w, double dg[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            dg[3 * i + j] =
                (w * s->n[i] * h->direction[j] / h->length - p[i] * s->n[j] - s->n[i] * p[j]) / s->altitude;
}

static void add_side(const hinge *h, const side *s, int apex, double *ddq)
{
    double p[3][3], ds[3][3]; /* columns x0, x1, apex */
    for (int i = 0; i < 3; i++) {
        double in_plane = s->m[i] / s->altitude, along = h->direction[i] / h->length;
        double rise = s->altitude * s->m[i] / (h->length * h->length);
        p[0][i] = -(1 - s->foot) * in_plane - along;
        p[1][i] = -s->foot * in_plane + along;
        p[2][i] = in_plane;
        ds[0][i] = -(1 - s->foot) * along - rise;
        ds[1][i] = -s->foot * along + rise;
        ds[2][i] = along;
    }
    const double weight[3] = {-1, 1, 0};
    for (int c = 0; c < 3; c++) {
        double dg[9];
        normal_derivative(s, h, p[c], weight[c], dg);
        add_rows(s, dg, ds[c], apex, c < 2 ? c : apex, ddq);
    }
}

static void measure(const drape_elements *el, int32_t first, int32_t count, const double *x,
                    const double *internal, double *q, double *dq, double *ddq)
{
    for (int32_t i = 0; i < count; i++) {
        hinge h;
        measure_hinge(el, first + i, x, &h);
        q[i] = unwrap(h.theta, internal[first + i]);
        if (dq)
            gradient(&h, dq + 12 * (size_t)i);
        if (ddq) {
            memset(ddq + 144 * (size_t)i, 0, 144 * sizeof *ddq);
            add_side(&h, &h.side[0], 2, ddq + 144 * (size_t)i);
            add_side(&h, &h.side[1], 3, ddq + 144 * (size_t)i);
        }
    }
}

static double element_stiffness(const drape_cloth_view *cloth, int32_t hinge_number, double choice)
{
    const drape_material *material = &cloth->material;
    if (choice == STIFFNESS_REPORT)
        return 2 / sqrt(3.0) * material->young_modulus * pow(material->thickness, 3) / 12;
    int32_t edge = cloth->hinge_edge[hinge_number];
    const int32_t *beside = cloth->edge_triangle + 2 * (size_t)edge;
    double length = cloth->edge_length[edge];
    return material->flexural_rigidity * length * length /
           (cloth->triangle_area[beside[0]] + cloth->triangle_area[beside[1]]);
}

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    drape_status status = drape_term_reserve(builder, cloth->hinge_count, REST_COUNT);
    const drape_elements at_rest = {.count = cloth->hinge_count, .nodes = 4, .node = cloth->hinge};
    for (int32_t i = 0; !status && i < cloth->hinge_count; i++) {
        hinge h;
        measure_hinge(&at_rest, i, cloth->rest, &h);
        double rest[REST_COUNT] = {[REST_K] = element_stiffness(cloth, i, values[PARAM_STIFFNESS]),
                                   [REST_THETA0] = values[PARAM_REST] == REST_FLAT ? 0 : h.theta,
                                   [REST_ALTITUDE1] = h.side[0].altitude,
                                   [REST_ALTITUDE2] = h.side[1].altitude};
        drape_term_set(builder, i, cloth->hinge + 4 * (size_t)i, rest);
    }
    return status;
}

/* The angle of the mesh at rest: theta0 unless the rest is flat, and then the branch nearest to flat. */
static void initial(const drape_elements *el, int32_t first, int32_t count, const double *x, double *after)
{
    for (int32_t i = first; i < first + count; i++) {
        hinge h;
        measure_hinge(el, i, x, &h);
        after[i] = unwrap(h.theta, el->rest[(size_t)REST_THETA0 * (size_t)el->count + (size_t)i]);
    }
}

static void commit(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *before, double *after)
{
    for (int32_t i = first; i < first + count; i++) {
        hinge h;
        measure_hinge(el, i, x, &h);
        after[i] = unwrap(h.theta, before[i]);
    }
}

static void keep_worst(drape_fault *worst, const char *reason, const char *what, int32_t element,
                       double value, double limit)
{
    *worst =
        (drape_fault){.reason = reason, .what = what, .element = element, .value = value, .limit = limit};
}

/* Altitude over that at rest. */
static double ratio_of(const drape_elements *el, int32_t element, const hinge *h, int s)
{
    return h->side[s].altitude / el->rest[(size_t)(REST_ALTITUDE1 + s) * (size_t)el->count + (size_t)element];
}

static bool altitude_fell(const drape_elements *el, int32_t element, const hinge *h, int s,
                          const double *before)
{
    hinge was;
    if (!before)
        return true;
    measure_hinge(el, element, before, &was);
    return drape_fell(ratio_of(el, element, h, s), ratio_of(el, element, &was, s));
}

/* The lowest altitude counts first: where a triangle has collapsed its angle means nothing. */
static drape_status check(const drape_elements *el, const double *x, const double *before,
                          const double *internal, drape_fault *fault)
{
    drape_fault altitude = {.element = -1, .value = INFINITY}, turn = {.element = -1, .value = -INFINITY};
    double min_altitude = el->params[PARAM_MIN_ALTITUDE], max_turn = el->params[PARAM_MAX_TURN];
    for (int32_t i = 0; i < el->count; i++) {
        hinge h;
        measure_hinge(el, i, x, &h);
        for (int s = 0; s < 2; s++) {
            double ratio = ratio_of(el, i, &h, s);
            if (ratio < altitude.value && (ratio >= min_altitude || altitude_fell(el, i, &h, s, before)))
                keep_worst(&altitude, "altitude_collapse", "altitude / rest altitude", i, ratio,
                           min_altitude);
        }
        double angle = fabs(unwrap(h.theta, internal[i]) - internal[i]);
        if (angle > turn.value)
            keep_worst(&turn, "hinge_branch", "turn of a hinge in one step [rad]", i, angle, max_turn);
    }
    if (altitude.value < min_altitude || el->count == 0) {
        *fault = altitude;
        return el->count == 0 ? DRAPE_OK : DRAPE_RETRY_DEGENERATE;
    }
    *fault = turn;
    return turn.value > max_turn ? DRAPE_RETRY_DEGENERATE : DRAPE_OK;
}

const drape_term_ops drape_term_bend_hinge = {
    .struct_size = sizeof(drape_term_ops),
    .name = "bend.hinge",
    .summary = "bending of every inner edge: E = 1/2 k (theta - theta0)^2",
    .reference = "Grinspun et al. 2003; Tamstorf & Grinspun 2013",
    .params = params,
    .param_count = PARAM_COUNT,
    .element_name = "hinge",
    .nodes = 4,
    .has_internal = true,
    .build = build,
    .measure = measure,
    .commit = commit,
    .initial = initial,
    .check = check,
};
