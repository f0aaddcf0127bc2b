/*
 * stretch.curve: a membrane of constant-strain triangles with measured curves of tension along warp and
 * weft and of shear. With F = sum x_a grad N_a and, at rest, the unit vectors a along the warp and b along
 * the weft, the strains are e1 = |F a| - 1, e2 = |F b| - 1 and, of the angle g by which warp and weft turn
 * against each other, s = sin g = F a . F b / (|F a| |F b|). The energy is the sum of three responses,
 *     E = A (W1(e1) + W2(e2) + W3(|s|)),
 * each the integral of its measured force (curve.h). So a strip with free sides has the force T1(e1) per
 * width at rest, and a sheared trellis, whose yarns keep their lengths, the force T3 per length along its
 * moved edge: the work of that edge is T3 d(sin g). (Volino, Magnenat-Thalmann & Faure 2009, A simple
 * approach to nonlinear tensile stiffness, have independent curves of Green's strains.) In compression W1 and
 * W2 go on with the stiffness at rest, W = T'(0) e^2/2.
 *
 * Friction between yarns that turn against each other, HG of KES-FB1, is a slider (model/slider.h) on s, an
 * element of its own without elasticity: its limit is HG A, and it slips after a turn by friction_angle.
 *
 * Each response is an element, three per triangle: warp, weft, shear. Its measure is q(e) for which the
 * energy is k/2 q^2, k = A T'(0), so that dampings of strain measures act on it, in proportion to the
 * stiffness.
 *
 * With p = F a, n = p/|p|: de1/dp = n, d2e1/dp2 = (I - n n')/|p|. With r = F b, m = r/|r|:
 *     ds/dp = (m - s n)/|p|, ds/dr = (n - s m)/|r|, d2s/dp2 = (3 s n n' - n m' - m n' - s I)/|p|^2,
 *     d2s/dpdr = (I - n n' - m m' + s n m')/(|p| |r|), d2s/dr2 as d2s/dp2.
 */
#include "base/elementary.h"
#include "base/pi.h"
#include "base/vec3.h"
#include "sparse/project.h"
#include "terms/curve.h"
#include "terms/orthotropic.h"
#include "terms/terms.h"

#include <math.h>
#include <string.h>

enum { PARAM_DIRECTION, PARAM_FRICTION = 3, PARAM_FRICTION_ANGLE };
enum { WARP, WEFT, SHEAR, FRICTION, RESPONSES }; /* without friction only three */
enum {
    REST_K,
    REST_Q0,
    REST_P1, /* F a, or F b of the weft: P1 (x1 - x0) + P2 (x2 - x0) */
    REST_P2,
    REST_R1, /* F b, of shear */
    REST_R2,
    REST_TABLE, /* where its curve is in the shared numbers */
    REST_AREA,
    REST_SHEAR, /* 1: of shear or its friction */
    REST_COUNT
};

static const drape_param params[] = {
    DRAPE_VECTOR("warp_direction", "1", 0, -1e9, 1e9, "direction of the warp at rest; 0 0 0: x"),
    DRAPE_NUMBER("shear_friction", "N/m", 0, 0, 1e9,
                 "friction between yarns in shear, a force per length: half of 2HG of a KES test; 0: none"),
    DRAPE_NUMBER("friction_angle", "degrees", DRAPE_DERIVED("required with shear_friction"), 1e-9, 89,
                 "change of the shear angle at which yarns slip"),
};

/* ---- Building ---- */

static double sine(double degrees)
{
    double s, c;
    drape_sin_cos(DRAPE_PI / 180 * degrees, &s, &c);
    return s;
}

/* Makes the tables of the three responses, one after another; those that were not measured are straight
 * lines. Writes where each begins. NULL: memory is out. */
static double *make_tables(const drape_cloth_view *cloth, drape_term_builder *builder, int32_t at[RESPONSES])
{
    const drape_woven *of = cloth->tension;
    const double strip = cloth->material->membrane_stiffness;
    const double straight[RESPONSES][2] = {
        {1, of ? of->warp : strip},
        {1, of ? of->weft : strip},
        {90, of ? of->shear : strip / (2 * (1 + cloth->material->poisson_ratio))},
        {90, 1}};
    drape_points curve[RESPONSES] = {cloth->warp_curve, cloth->weft_curve, cloth->shear_curve, {0}};
    int32_t size = 0;
    for (int k = 0; k < RESPONSES; k++) {
        if (curve[k].count == 0)
            curve[k] = (drape_points){1, straight[k]};
        at[k] = size;
        size += DRAPE_CURVE_SIZE(curve[k].count);
    }
    double *numbers = drape_term_share(builder, size);
    for (int k = 0; numbers && k < RESPONSES; k++)
        drape_curve_make(&curve[k], k >= SHEAR ? sine : NULL, numbers + at[k]);
    return numbers;
}

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    static const double woven[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}; /* any law that is not isotropic */
    const double friction = values[PARAM_FRICTION], slips_at = sine(values[PARAM_FRICTION_ANGLE]);
    const int responses = friction > 0 ? RESPONSES : FRICTION;
    double direction[DRAPE_ORTHOTROPIC_COUNT];
    int32_t at[RESPONSES];
    if (friction > 0 && isnan(slips_at))
        return drape_term_refuse(builder, "\"shear_friction\" = %g needs \"friction_angle\"", friction);
    if (!(friction > 0) && !isnan(slips_at))
        return drape_term_refuse(builder, "\"friction_angle\" = %g is given without \"shear_friction\"",
                                 values[PARAM_FRICTION_ANGLE]);
    if (cloth->triangle_count > INT32_MAX / responses)
        return drape_term_refuse(builder, "the mesh has %d triangles; at most %d", (int)cloth->triangle_count,
                                 INT32_MAX / responses);
    DRAPE_TRY(drape_term_reserve(builder, responses * cloth->triangle_count, REST_COUNT));
    if (friction > 0)
        DRAPE_TRY(drape_term_reserve_sliders(builder, 1));
    const double *table = make_tables(cloth, builder, at);
    if (!table)
        return DRAPE_E_MEMORY;
    memcpy(direction + DRAPE_ORTHOTROPIC_DIRECTION, values + PARAM_DIRECTION, 3 * sizeof *direction);
    for (int32_t t = 0; t < cloth->triangle_count; t++) {
        const int32_t *node = cloth->triangle + 3 * (size_t)t;
        const double area = cloth->triangle_area[t];
        double axes[6], flat[6];
        if (!drape_orthotropic_frame(direction, cloth, t, woven, axes, flat))
            return drape_orthotropic_refuse(builder, t);
        /* The gradients of N1 and N2: column k of F is sum B_n[k] (x_n - x0). */
        const double twice = flat[2] * flat[5] - flat[3] * flat[4];
        const double a[2] = {flat[5] / twice, -flat[3] / twice}, b[2] = {-flat[4] / twice, flat[2] / twice};
        for (int k = 0; k < responses; k++) {
            const double *p = k == WEFT ? b : a;
            drape_term_set(builder, responses * t + k, node,
                           (const double[REST_COUNT]){
                               [REST_K] = k == FRICTION ? 0 : area * drape_curve_stiffness(table + at[k]),
                               [REST_P1] = p[0],
                               [REST_P2] = p[1],
                               [REST_R1] = k >= SHEAR ? b[0] : 0,
                               [REST_R2] = k >= SHEAR ? b[1] : 0,
                               [REST_TABLE] = at[k],
                               [REST_AREA] = area,
                               [REST_SHEAR] = k >= SHEAR});
        }
        if (friction > 0)
            drape_term_set_slider(builder, 0, responses * t + FRICTION, area * friction / slips_at,
                                  area * friction);
    }
    return DRAPE_OK;
}

/* ---- The strain of a response ---- */

/* A strain with its first derivatives by p and r, and the blocks of its second ones: by p p, p r and r r. */
typedef struct strain {
    double value, by[2][3], block[3][9];
} strain;

static void sides(const drape_elements *el, int32_t element, const double *x, double d1[3], double d2[3])
{
    const int32_t *node = el->node + 3 * (size_t)element;
    vec3_triangle_sides(node, x, d1, d2);
}

/* The unit vector along w1 d1 + w2 d2; returns the length. A collapsed one has no direction: 0. */
static double column_of(const double w[2], const double d1[3], const double d2[3], double unit[3])
{
    for (int i = 0; i < 3; i++)
        unit[i] = w[0] * d1[i] + w[1] * d2[i];
    const double length = vec3_norm(unit);
    for (int i = 0; i < 3; i++)
        unit[i] = length > 0 ? unit[i] / length : 0;
    return length;
}

static bool is_shear(const drape_elements *el, int32_t element)
{
    return drape_rest_of(el, REST_SHEAR, element) != 0;
}

/* Writes w: by how much p (w[0]) and r (w[1]) change with each of the three corners. */
static void strain_of(const drape_elements *el, int32_t element, const double *x, strain *s, double w[2][3])
{
    double d1[3], d2[3], n[3], m[3];
    memset(s, 0, sizeof *s);
    for (int k = 0; k < 2; k++) {
        w[k][1] = drape_rest_of(el, k ? REST_R1 : REST_P1, element);
        w[k][2] = drape_rest_of(el, k ? REST_R2 : REST_P2, element);
        w[k][0] = -w[k][1] - w[k][2];
    }
    sides(el, element, x, d1, d2);
    const double p = column_of(w[0] + 1, d1, d2, n);
    if (is_shear(el, element)) {
        const double r = column_of(w[1] + 1, d1, d2, m);
        const double sine = vec3_dot(n, m), a = p > 0 ? 1 / p : 0, b = r > 0 ? 1 / r : 0;
        s->value = sine;
        for (int i = 0; i < 3; i++) {
            s->by[0][i] = a * (m[i] - sine * n[i]);
            s->by[1][i] = b * (n[i] - sine * m[i]);
            for (int j = 0; j < 3; j++) {
                const double same = i == j, nm = n[i] * m[j], mn = m[i] * n[j];
                s->block[0][3 * i + j] = a * a * (3 * sine * n[i] * n[j] - nm - mn - sine * same);
                s->block[1][3 * i + j] = a * b * (same - n[i] * n[j] - m[i] * m[j] + sine * nm);
                s->block[2][3 * i + j] = b * b * (3 * sine * m[i] * m[j] - nm - mn - sine * same);
            }
        }
    } else {
        s->value = p - 1;
        for (int i = 0; i < 3; i++) {
            s->by[0][i] = n[i];
            for (int j = 0; j < 3; j++)
                s->block[0][3 * i + j] = p > 0 ? ((i == j) - n[i] * n[j]) / p : 0;
        }
    }
}

/* The measure of a strain: in compression the strain itself; shear is odd. */
static drape_curve_measure_value measure_of(const drape_elements *el, int32_t element, double e)
{
    const double *table = el->shared + (int32_t)drape_rest_of(el, REST_TABLE, element);
    if (e >= 0)
        return drape_curve_measure(table, e);
    if (!is_shear(el, element))
        return (drape_curve_measure_value){e, 1, 0};
    const drape_curve_measure_value v = drape_curve_measure(table, -e);
    return (drape_curve_measure_value){-v.q, v.dq, -v.ddq};
}

static void gradient_of(const strain *s, double w[2][3], double *gradient)
{
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < 3; i++)
            gradient[3 * a + i] = w[0][a] * s->by[0][i] + w[1][a] * s->by[1][i];
}

/* out = scale * Hessian of the strain */
static void hessian_of(const strain *s, double w[2][3], double scale, double *out)
{
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    out[9 * (3 * a + i) + 3 * b + j] = scale * (w[0][a] * w[0][b] * s->block[0][3 * i + j] +
                                                                w[0][a] * w[1][b] * s->block[1][3 * i + j] +
                                                                w[1][a] * w[0][b] * s->block[1][3 * j + i] +
                                                                w[1][a] * w[1][b] * s->block[2][3 * i + j]);
}

static void add_square(double scale, const double *gradient, double *out)
{
    for (int i = 0; i < 9; i++)
        for (int j = 0; j < 9; j++)
            out[9 * i + j] += scale * (gradient[i] * gradient[j]);
}

static void measure(const drape_elements *el, int32_t first, int32_t count, const double *x,
                    const double *internal, double *q, double *dq, double *ddq)
{
    (void)internal;
    for (int32_t e = 0; e < count; e++) {
        strain s;
        double w[2][3], gradient[9];
        strain_of(el, first + e, x, &s, w);
        const drape_curve_measure_value v = measure_of(el, first + e, s.value);
        q[e] = v.q;
        gradient_of(&s, w, gradient);
        for (int i = 0; dq && i < 9; i++)
            dq[9 * e + i] = v.dq * gradient[i];
        if (ddq) {
            hessian_of(&s, w, v.dq, ddq + 81 * (size_t)e);
            add_square(v.ddq, gradient, ddq + 81 * (size_t)e);
        }
    }
}

/* f ddq = f q'' g g' + f q' H, g and H the derivatives of the strain. The Gauss-Newton part k q'^2 g g' is
 * added to it, so that the first term may be as negative as that: of f = k q it never is more, for the energy
 * is convex. The second is positive semidefinite for a tension, negative for a compression, and has both
 * parts for shear. */
static void positive(const drape_elements *el, int32_t first, int32_t count, const double *x,
                     const double *internal, const double *force, double *ddq)
{
    (void)internal;
    for (int32_t e = 0; e < count; e++) {
        strain s;
        double w[2][3], gradient[9], *out = ddq + 81 * (size_t)e;
        const double f = force[e], k = drape_rest_of(el, REST_K, first + e);
        strain_of(el, first + e, x, &s, w);
        const drape_curve_measure_value v = measure_of(el, first + e, s.value);
        gradient_of(&s, w, gradient);
        hessian_of(&s, w, f > 0 || is_shear(el, first + e) ? v.dq : 0, out);
        if (is_shear(el, first + e)) {
            for (int i = 0; f < 0 && i < 81; i++)
                out[i] = -out[i];
            drape_project(9, out);
            for (int i = 0; f < 0 && i < 81; i++)
                out[i] = -out[i];
        }
        add_square(f * v.ddq < -k * v.dq * v.dq ? -k * v.dq * v.dq / f : v.ddq, gradient, out);
    }
}

/* ---- Degenerate triangles ---- */

/* Area over rest area. */
static double ratio_of(const drape_elements *el, int32_t element, const double *x)
{
    double d1[3], d2[3], normal[3];
    sides(el, element, x, d1, d2);
    vec3_cross(d1, d2, normal);
    return vec3_norm(normal) / 2 / drape_rest_of(el, REST_AREA, element);
}

static drape_status check(const drape_elements *el, const double *x, const double *before,
                          const double *internal, drape_fault *fault)
{
    (void)internal;
    const int32_t every = el->params[PARAM_FRICTION] > 0 ? RESPONSES : FRICTION; /* of one triangle */
    return drape_check_ratios(el, x, before, every, ratio_of, DRAPE_REASON_AREA_COLLAPSE, "area / rest area",
                              fault);
}

const drape_term_ops drape_term_stretch_curve = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "stretch.curve",
              .summary = "stretching and shear of every triangle by curves of the material: warp_curve, "
                         "weft_curve, shear_curve",
              .reference = "Volino, Magnenat-Thalmann & Faure 2009; Fritsch & Butland 1984",
              DRAPE_PARAMS(params)},
    .element_name = "response",
    .nodes = 3,
    .build = build,
    .measure = measure,
    .positive = positive,
    .check = check,
    .takes_curves = true,
};
