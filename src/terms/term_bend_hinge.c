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
#include "base/lanes.h"
#include "terms/terms.h"

#include <math.h>

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

/* One triangle of a hinge: see the head of the file. Four hinges at once. */
typedef struct side {
    lanes n[3], m[3];
    lanes gradient[3]; /* n/H */
    lanes altitude, per_altitude, foot;
} side;

typedef struct hinges {
    lanes direction[3], per_length; /* ehat, 1/|e| */
    side side[2];
    lanes theta; /* in (-pi, pi] */
} hinges;

LANES_INLINE void measure_side(const lanes origin[3], const lanes apex[3], const hinges *h, double sign,
                               side *s)
{
    lanes d[3], normal[3];
    for (int i = 0; i < 3; i++)
        d[i] = apex[i] - origin[i];
    lanes_cross(h->direction, d, normal);
    lanes along = lanes_dot(d, h->direction);
    s->altitude = lanes_sqrt(lanes_dot(normal, normal)); /* |ehat x d| */
    s->per_altitude = 1 / s->altitude;
    s->foot = along * h->per_length;
    for (int i = 0; i < 3; i++) {
        s->n[i] = sign * normal[i] * s->per_altitude;
        s->m[i] = (d[i] - along * h->direction[i]) * s->per_altitude;
        s->gradient[i] = s->n[i] * s->per_altitude;
    }
}

LANES_INLINE void measure_hinges(const drape_elements *el, const int32_t element[LANES], const double *x,
                                 hinges *h)
{
    lanes corner[4][3], cross[3];
    for (int a = 0; a < 4; a++) {
        int32_t node[LANES];
        for (int l = 0; l < LANES; l++)
            node[l] = el->node[4 * (size_t)element[l] + (size_t)a];
        lanes_gather(x, node, corner[a]);
    }
    for (int i = 0; i < 3; i++)
        h->direction[i] = corner[1][i] - corner[0][i];
    h->per_length = 1 / lanes_sqrt(lanes_dot(h->direction, h->direction));
    for (int i = 0; i < 3; i++)
        h->direction[i] *= h->per_length;
    measure_side(corner[0], corner[2], h, 1, &h->side[0]);
    measure_side(corner[0], corner[3], h, -1, &h->side[1]);
    lanes_cross(h->side[1].n, h->side[0].n, cross);
    lanes sine = lanes_dot(h->direction, cross), cosine = lanes_dot(h->side[0].n, h->side[1].n);
    for (int l = 0; l < LANES; l++)
        h->theta[l] = atan2(sine[l], cosine[l]);
}

/* The branch of theta that is nearest to reference. */
static inline double unwrap(double theta, double reference)
{
    return theta + 2 * pi * round((reference - theta) / (2 * pi));
}

/* dq: g_0 g_1 g_2 g_3 */
LANES_INLINE void gradient(const hinges *h, double *dq)
{
    const side *s = h->side;
    for (int i = 0; i < 3; i++) {
        lanes_store(dq + LANES * i, (s[0].foot - 1) * s[0].gradient[i] + (s[1].foot - 1) * s[1].gradient[i]);
        lanes_store(dq + LANES * (3 + i), -s[0].foot * s[0].gradient[i] - s[1].foot * s[1].gradient[i]);
        lanes_store(dq + LANES * (6 + i), s[0].gradient[i]);
        lanes_store(dq + LANES * (9 + i), s[1].gradient[i]);
    }
}

/* d g_a/d column = -(p n' + n p')/H + w n ehat'/(|e| H), at (i, j) */
LANES_INLINE lanes turn(const side *s, const lanes along[3], const lanes p[3], double w, int i, int j)
{
    return s->gradient[i] * (w * along[j] - p[j]) - p[i] * s->gradient[j];
}

/* p and the gradients of s at the three nodes of a side: x0, x1, apex. That of s at the apex is in no block on or
 * below the diagonal. */
typedef struct change {
    lanes p[3][3], foot[2][3];
} change;

LANES_INLINE void measure_change(const hinges *h, const side *s, const lanes along[3], change *c)
{
    for (int i = 0; i < 3; i++) {
        lanes in_plane = s->m[i] * s->per_altitude;
        lanes rise = s->altitude * s->m[i] * h->per_length * h->per_length;
        c->p[0][i] = (s->foot - 1) * in_plane - along[i];
        c->p[1][i] = along[i] - s->foot * in_plane;
        c->p[2][i] = in_plane;
        c->foot[0][i] = (s->foot - 1) * along[i] - rise;
        c->foot[1][i] = rise - s->foot * along[i];
    }
}

/* The blocks on and below the diagonal. Both sides add to those of the edge; there is none between the apices. */
LANES_INLINE void hessian(const hinges *h, double *ddq)
{
    lanes along[3];
    change side_change[2];
    for (int i = 0; i < 3; i++)
        along[i] = h->direction[i] * h->per_length;
    measure_change(h, &h->side[0], along, &side_change[0]);
    measure_change(h, &h->side[1], along, &side_change[1]);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            lanes of_00 = {0}, of_10 = {0}, of_11 = {0};
            for (int k = 0; k < 2; k++) {
                const side *s = &h->side[k];
                const int apex = 3 * (2 + k);
                lanes by_0 = turn(s, along, side_change[k].p[0], -1, i, j),
                      by_1 = turn(s, along, side_change[k].p[1], 1, i, j);
                lanes by_foot = s->gradient[i] * side_change[k].foot[0][j];
                of_00 += by_foot + (s->foot - 1) * by_0;
                of_10 -= by_foot + s->foot * by_0;
                of_11 -= s->gradient[i] * side_change[k].foot[1][j] + s->foot * by_1;
                lanes_store(ddq + LANES * (12 * (apex + i) + j), by_0);
                lanes_store(ddq + LANES * (12 * (apex + i) + 3 + j), by_1);
                lanes_store(ddq + LANES * (12 * (apex + i) + apex + j),
                            turn(s, along, side_change[k].p[2], 0, i, j));
            }
            lanes_store(ddq + LANES * (12 * i + j), of_00);
            lanes_store(ddq + LANES * (12 * (3 + i) + j), of_10);
            lanes_store(ddq + LANES * (12 * (3 + i) + 3 + j), of_11);
            lanes_store(ddq + LANES * (12 * (9 + i) + 6 + j), (lanes){0});
        }
}

LANES_DISPATCH static void measure_lanes(const drape_elements *el, const int32_t *element, const double *x,
                                         const double *internal, double *q, double *dq, double *ddq)
{
    hinges h;
    measure_hinges(el, element, x, &h);
    for (int l = 0; l < LANES; l++)
        q[l] = unwrap(h.theta[l], internal[element[l]]);
    if (dq)
        gradient(&h, dq);
    if (ddq)
        hessian(&h, ddq);
}

static void measure(const drape_elements *el, int32_t first, int32_t count, const double *x,
                    const double *internal, double *q, double *dq, double *ddq)
{
    drape_measure_range(el, first, count, x, internal, q, dq, ddq, measure_lanes);
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

/* Altitudes and angles of the hinges from `first` on; lanes beyond the last repeat it. */
typedef struct shapes {
    double altitude[2][LANES], theta[LANES];
} shapes;

LANES_DISPATCH static void measure_shapes(const drape_elements *el, int32_t first, const double *x, shapes *s)
{
    hinges h;
    int32_t element[LANES];
    drape_lanes_elements(first, el->count, element);
    measure_hinges(el, element, x, &h);
    lanes_store(s->altitude[0], h.side[0].altitude);
    lanes_store(s->altitude[1], h.side[1].altitude);
    lanes_store(s->theta, h.theta);
}

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    drape_status status = drape_term_reserve(builder, cloth->hinge_count, REST_COUNT);
    const drape_elements at_rest = {.count = cloth->hinge_count, .nodes = 4, .node = cloth->hinge};
    shapes s;
    for (int32_t i = 0; !status && i < cloth->hinge_count; i++) {
        int l = i % LANES;
        if (l == 0)
            measure_shapes(&at_rest, i, cloth->rest, &s);
        double rest[REST_COUNT] = {[REST_K] = element_stiffness(cloth, i, values[PARAM_STIFFNESS]),
                                   [REST_THETA0] = values[PARAM_REST] == REST_FLAT ? 0 : s.theta[l],
                                   [REST_ALTITUDE1] = s.altitude[0][l],
                                   [REST_ALTITUDE2] = s.altitude[1][l]};
        drape_term_set(builder, i, cloth->hinge + 4 * (size_t)i, rest);
    }
    return status;
}

/* after = the angle at x, on the branch nearest to that of before. */
static void follow(const drape_elements *el, int32_t first, int32_t count, const double *x,
                   const double *before, double *after)
{
    shapes s;
    for (int32_t i = first; i < first + count; i++) {
        int l = (i - first) % LANES;
        if (l == 0)
            measure_shapes(el, i, x, &s);
        after[i] = unwrap(s.theta[l], before[i]);
    }
}

/* The angle of the mesh at rest: theta0 unless the rest is flat, and then the branch nearest to flat. */
static void initial(const drape_elements *el, int32_t first, int32_t count, const double *x, double *after)
{
    follow(el, first, count, x, el->rest + (size_t)REST_THETA0 * (size_t)el->count, after);
}

static void keep_worst(drape_fault *worst, const char *reason, const char *what, int32_t element,
                       double value, double limit)
{
    *worst =
        (drape_fault){.reason = reason, .what = what, .element = element, .value = value, .limit = limit};
}

/* Altitude over that at rest, of the hinge in a lane. */
static double ratio_of(const drape_elements *el, int32_t element, const shapes *s, int lane, int k)
{
    return s->altitude[k][lane] /
           el->rest[(size_t)(REST_ALTITUDE1 + k) * (size_t)el->count + (size_t)element];
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

/* The lowest altitude counts first: where a triangle has collapsed its angle means nothing. */
static drape_status check(const drape_elements *el, const double *x, const double *before,
                          const double *internal, drape_fault *fault)
{
    drape_fault altitude = {.element = -1, .value = INFINITY}, turned = {.element = -1, .value = -INFINITY};
    double min_altitude = el->params[PARAM_MIN_ALTITUDE], max_turn = el->params[PARAM_MAX_TURN];
    shapes s;
    for (int32_t i = 0; i < el->count; i++) {
        int l = i % LANES;
        if (l == 0)
            measure_shapes(el, i, x, &s);
        for (int k = 0; k < 2; k++) {
            double ratio = ratio_of(el, i, &s, l, k);
            if (ratio < altitude.value && (ratio >= min_altitude || altitude_fell(el, i, ratio, k, before)))
                keep_worst(&altitude, "altitude_collapse", "altitude / rest altitude", i, ratio,
                           min_altitude);
        }
        double angle = fabs(unwrap(s.theta[l], internal[i]) - internal[i]);
        if (angle > turned.value)
            keep_worst(&turned, "hinge_branch", "turn of a hinge in one step [rad]", i, angle, max_turn);
    }
    if (altitude.value < min_altitude || el->count == 0) {
        *fault = altitude;
        return el->count == 0 ? DRAPE_OK : DRAPE_RETRY_DEGENERATE;
    }
    *fault = turned;
    return turned.value > max_turn ? DRAPE_RETRY_DEGENERATE : DRAPE_OK;
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
    .lanes = measure_lanes,
    .commit = follow,
    .initial = initial,
    .check = check,
};
