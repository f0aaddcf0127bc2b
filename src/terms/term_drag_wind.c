/*
 * drag.wind: the pressure of a wind on every triangle. With m = (x1 - x0) x (x2 - x0), twice the
 * area times the normal n, and u = w - (v0 + v1 + v2)/3, the wind relative to the triangle,
 *     F = 1/2 rho C A |u.n| (u.n) n = rho C/4 |q| q m / |m|^2,   q = u . m,
 * a third of it on each node. So the wind acts along the normal only (Provot 1995, section 3.2, there linear
 * in u.n) and with the square of its speed, as on a flat plate (Hoerner 1965, Fluid-Dynamic Drag, 3: C = 1.17
 * for a square plate across the wind). There is no friction along the sheet and no lee: the wind also acts on
 * a layer behind another.
 *
 *     dF = rho C/4 [2 |q| m dq + |q| q dm - |q| q m d(|m|^2)/|m|^2] / |m|^2,  dq = u . dm + m . du
 * F is C1 in x and v; a triangle without area has no force. In air at rest F dissipates: -F . v = |q|^3 ...
 * >= 0.
 */
#include "base/vec3.h"
#include "terms/terms.h"

#include <math.h>
#include <string.h>

enum { PARAM_DENSITY, PARAM_COEFFICIENT, PARAM_WIND, LIST_HISTORY, LIST_RAMP, PARAM_COUNT };
enum { REST_FACTOR, REST_WIND, REST_COUNT = REST_WIND + 3 };
enum { D = 9 };

static const drape_param params[PARAM_COUNT] = {
    [PARAM_DENSITY] = DRAPE_NUMBER("density", "kg/m3", 1.225, 0, 1e6,
                                   "density of the medium: 1.225 is air at sea level and 15 degrees"),
    [PARAM_COEFFICIENT] = DRAPE_NUMBER("coefficient", "1", 1.17, 0, 1e6,
                                       "drag coefficient across the sheet: 1.17 is a square plate"),
    [PARAM_WIND] = DRAPE_VECTOR("wind", "m/s", 0, -1e6, 1e6, "velocity of the medium"),
    [LIST_HISTORY] = DRAPE_TEXT("history", "name of a history of the scene, by which the wind is multiplied",
                                .derived = "none: it is constant"),
    [LIST_RAMP] = DRAPE_NUMBER("ramp", "s", 0, 0, 1e9,
                               "in place of a history: the time in which the wind rises smoothly from 0; 0: "
                               "it does not"),
};

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    const double *wind = values + PARAM_WIND;
    double factor = 0.25 * values[PARAM_DENSITY] * values[PARAM_COEFFICIENT];
    drape_status status = drape_term_reserve(builder, cloth->triangle_count, REST_COUNT);
    for (int32_t i = 0; !status && i < cloth->triangle_count; i++)
        drape_term_set(builder, i, cloth->triangle + 3 * (size_t)i,
                       (const double[REST_COUNT]){factor, wind[0], wind[1], wind[2]});
    return status;
}

/* One triangle: its edges, m and |m|^2, u and q. */
typedef struct flow {
    double a[3], b[3], m[3], area2, u[3], q;
} flow;

static flow flow_of(const drape_elements *el, int32_t element, const double *x, const double *v)
{
    const int32_t *node = el->node + 3 * (size_t)element;
    const double *at[3], *moves[3];
    flow f;
    for (int i = 0; i < 3; i++) {
        at[i] = x + 3 * (size_t)node[i];
        moves[i] = v + 3 * (size_t)node[i];
    }
    vec3_sub(at[1], at[0], f.a);
    vec3_sub(at[2], at[0], f.b);
    vec3_cross(f.a, f.b, f.m);
    f.area2 = vec3_dot(f.m, f.m);
    for (int k = 0; k < 3; k++)
        f.u[k] = el->factor * el->rest[(size_t)(REST_WIND + k) * (size_t)el->count + (size_t)element] -
                 (moves[0][k] + moves[1][k] + moves[2][k]) / 3;
    f.q = vec3_dot(f.u, f.m);
    return f;
}

/* The derivative of m by coordinate k of node i; x0 enters through both edges. */
static void normal_derivative(const flow *f, int i, int k, double *dm)
{
    double unit[3] = {0}, edge[3];
    unit[k] = 1;
    if (i == 0)
        vec3_sub(f->b, f->a, edge);
    else
        memcpy(edge, i == 1 ? f->b : f->a, sizeof edge);
    if (i == 1)
        vec3_cross(unit, edge, dm);
    else
        vec3_cross(edge, unit, dm);
}

/* Every node has a third of the force: a column of the 9 x 9 matrix is three times -dF/3. */
static void set_column(double *matrix, int column, const double *dforce)
{
    for (int row = 0; row < D; row++)
        matrix[D * row + column] = -dforce[row % 3] / 3;
}

static void derive(const flow *f, double factor, double *dg_dx, double *dg_dv)
{
    double scale = factor * fabs(f->q) / f->area2;
    for (int column = 0; column < D; column++) {
        double dm[3], dforce[3];
        normal_derivative(f, column / 3, column % 3, dm);
        double dq = vec3_dot(f->u, dm), darea2 = 2 * vec3_dot(f->m, dm);
        for (int k = 0; k < 3; k++)
            dforce[k] = scale * (2 * f->m[k] * dq + f->q * (dm[k] - f->m[k] * darea2 / f->area2));
        if (dg_dx)
            set_column(dg_dx, column, dforce);
        for (int k = 0; k < 3; k++)
            dforce[k] = scale * 2 * f->m[k] * -f->m[column % 3] / 3;
        if (dg_dv)
            set_column(dg_dv, column, dforce);
    }
}

static void dissipation(const drape_elements *el, int32_t first, int32_t count, const double *x,
                        const double *v, double *g, double *dg_dx, double *dg_dv)
{
    for (int32_t i = 0; i < count; i++) {
        const flow f = flow_of(el, first + i, x, v);
        double factor = el->rest[first + i], *hx = dg_dx ? dg_dx + (size_t)(D * D) * (size_t)i : NULL,
               *hv = dg_dv ? dg_dv + (size_t)(D * D) * (size_t)i : NULL;
        bool has_area = f.area2 > 0;
        double pressure = has_area ? factor * fabs(f.q) * f.q / f.area2 : 0;
        for (int k = 0; k < D; k++)
            g[D * (size_t)i + (size_t)k] = -pressure * f.m[k % 3] / 3;
        if (has_area && (hx || hv)) {
            derive(&f, factor, hx, hv);
            continue;
        }
        if (hx)
            memset(hx, 0, D * D * sizeof *hx);
        if (hv)
            memset(hv, 0, D * D * sizeof *hv);
    }
}

const drape_term_ops drape_term_drag_wind = {
    .struct_size = sizeof(drape_term_ops),
    .entry =
        {.name = "drag.wind",
         .summary =
             "pressure of wind across every triangle: 1/2 rho C A |u.n| (u.n) n, u the wind relative to it",
         .reference = "Provot 1995, section 3.2; Hoerner 1965, Fluid-Dynamic Drag, chapter 3",
         DRAPE_PARAMS(params)},
    .element_name = "triangle",
    .nodes = 3,
    .build = build,
    .dissipation = dissipation,
    .dissipative = true,
    .in_medium = true,
};
