/*
 * drag.wind: the pressure of a wind on every triangle. With m = (x1 - x0) x (x2 - x0), twice the
 * area times the normal n, and u = w - (v0 + v1 + v2)/3, the wind relative to the triangle,
 *     F = 1/2 rho C A |u.n| (u.n) n = rho C/4 |q| q m / |m|^2,   q = u . m,
 * a third of it on each node. So the wind acts along the normal only (Provot 1995, section 3.2, there linear
 * in u.n) and with the square of its speed, as on a flat plate (Hoerner 1965, Fluid-Dynamic Drag, 3: C = 1.17
 * for a square plate across the wind). There is no lee: the wind also acts on a layer behind another.
 *
 *     dF = rho C/4 [2 |q| m dq + |q| q dm - |q| q m d(|m|^2)/|m|^2] / |m|^2,  dq = u . dm + m . du
 *
 * That is the law "square": the force is proportional to the square of the sine of the angle of attack. The
 * law "plate" is that of a plate whose flow separates at both edges, of Kirchhoff and Rayleigh,
 *     C_N = C (4 + pi) sin a/(4 + pi sin a),
 * in which C is free: the free streamlines themselves have 2 pi/(4 + pi) = 0.88, without the suction behind
 * (Rayleigh 1876, On the resistance of fluids; Lamb 1932, Hydrodynamics, 77). With s = |u|, l = |m|,
 *     F = rho C/4 (4 + pi) s^2 q m/r,  r = 4 s l + pi |q|
 *
 * Friction acts along the sheet, on both sides together, with t = u - q m/l^2, the wind along it,
 *     F = rho c/4 l |t| t
 *
 * All are C1 in x and v; a triangle without area has no force. In air at rest they dissipate: -F . v >= 0.
 */
#include "base/elementary.h"
#include "base/pi.h"
#include "base/vec3.h"
#include "terms/terms.h"

#include <math.h>
#include <string.h>

enum { PARAM_DENSITY, PARAM_COEFFICIENT, PARAM_WIND, PARAM_LAW = PARAM_WIND + 3, PARAM_FRICTION };
enum { LIST_LAW = PARAM_WIND + 1, LIST_FRICTION, LIST_HISTORY, LIST_RAMP, LIST_COUNT };
enum { REST_FACTOR, REST_WIND, REST_FRICTION = REST_WIND + 3, REST_COUNT };
enum { SQUARE, PLATE };
enum { D = 9 };

static const char *const law_choices[] = {[SQUARE] = "square", [PLATE] = "plate", NULL};

/* As a list the wind is one entry; among the values it takes three. */
static const drape_param params[LIST_COUNT] = {
    [PARAM_DENSITY] = DRAPE_NUMBER("density", "kg/m3", 1.225, 0, 1e6,
                                   "density of the medium: 1.225 is air at sea level and 15 degrees"),
    [PARAM_COEFFICIENT] = DRAPE_NUMBER("coefficient", "1", 1.17, 0, 1e6,
                                       "drag coefficient across the sheet: 1.17 is a square plate"),
    [PARAM_WIND] = DRAPE_VECTOR("wind", "m/s", 0, -1e6, 1e6, "velocity of the medium"),
    [LIST_LAW] = DRAPE_CHOICE("law", SQUARE, law_choices,
                              "force by angle of attack a: sin^2 a, or (4 + pi) sin a/(4 + pi sin a)"),
    [LIST_FRICTION] = DRAPE_NUMBER("friction", "1", 0, 0, 1e6,
                                   "coefficient of friction along the sheet, of both sides together"),
    [LIST_HISTORY] = DRAPE_TERM_HISTORY_PARAM,
    [LIST_RAMP] = DRAPE_TERM_RAMP_PARAM,
};

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    const double *wind = values + PARAM_WIND;
    const double density = 0.25 * values[PARAM_DENSITY];
    double factor = density * values[PARAM_COEFFICIENT];
    if (values[PARAM_LAW] == PLATE)
        factor *= 4 + DRAPE_PI;
    DRAPE_TRY(drape_term_reserve(builder, cloth->triangle_count, REST_COUNT));
    for (int32_t i = 0; i < cloth->triangle_count; i++)
        drape_term_set(
            builder, i, cloth->triangle + 3 * (size_t)i,
            (const double[REST_COUNT]){factor, wind[0], wind[1], wind[2], density * values[PARAM_FRICTION]});
    return DRAPE_OK;
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

/* A force on the whole triangle that wind exerts, and its derivatives: by a change dm of m, and by a change
 * of the velocity of one node along axis k. The triangle has an area. */
typedef struct air_force {
    void (*force)(const flow *f, double factor, double out[3]);
    void (*by_normal)(const flow *f, double factor, const double dm[3], double out[3]);
    void (*by_velocity)(const flow *f, double factor, int k, double out[3]);
} air_force;

static void square(const flow *f, double factor, double out[3])
{
    const double pressure = factor * fabs(f->q) * f->q / f->area2;
    for (int k = 0; k < 3; k++)
        out[k] = pressure * f->m[k];
}

static void square_by_normal(const flow *f, double factor, const double dm[3], double out[3])
{
    const double scale = factor * fabs(f->q) / f->area2, dq = vec3_dot(f->u, dm),
                 darea2 = 2 * vec3_dot(f->m, dm);
    for (int k = 0; k < 3; k++)
        out[k] = scale * (2 * f->m[k] * dq + f->q * (dm[k] - f->m[k] * darea2 / f->area2));
}

static void square_by_velocity(const flow *f, double factor, int k, double out[3])
{
    const double scale = factor * fabs(f->q) / f->area2;
    for (int i = 0; i < 3; i++)
        out[i] = scale * 2 * f->m[i] * -f->m[k] / 3;
}

static double sign(double a)
{
    return (a > 0) - (a < 0);
}

static void plate(const flow *f, double factor, double out[3])
{
    const double speed2 = vec3_dot(f->u, f->u), r = 4 * sqrt(speed2 * f->area2) + DRAPE_PI * fabs(f->q);
    for (int k = 0; k < 3; k++)
        out[k] = r > 0 ? factor * speed2 * f->q * f->m[k] / r : 0;
}

/* With the changes of q, s^2 and r. */
static void plate_change(const flow *f, double factor, double dq, double dspeed2, double dr,
                         const double dm[3], double out[3])
{
    const double speed2 = vec3_dot(f->u, f->u), r = 4 * sqrt(speed2 * f->area2) + DRAPE_PI * fabs(f->q);
    for (int k = 0; k < 3; k++)
        out[k] = r > 0 ? factor *
                             (dspeed2 * f->q * f->m[k] + speed2 * dq * f->m[k] + speed2 * f->q * dm[k] -
                              speed2 * f->q * f->m[k] * dr / r) /
                             r
                       : 0;
}

static void plate_by_normal(const flow *f, double factor, const double dm[3], double out[3])
{
    const double dq = vec3_dot(f->u, dm), speed = vec3_norm(f->u);
    plate_change(f, factor, dq, 0,
                 4 * speed * vec3_dot(f->m, dm) / sqrt(f->area2) + DRAPE_PI * sign(f->q) * dq, dm, out);
}

static void plate_by_velocity(const flow *f, double factor, int k, double out[3])
{
    const double dq = -f->m[k] / 3, dspeed2 = -2 * f->u[k] / 3, speed = vec3_norm(f->u);
    const double dspeed = speed > 0 ? dspeed2 / (2 * speed) : 0;
    plate_change(f, factor, dq, dspeed2, 4 * dspeed * sqrt(f->area2) + DRAPE_PI * sign(f->q) * dq,
                 (const double[3]){0}, out);
}

/* The wind along the sheet. */
static void tangential(const flow *f, double t[3])
{
    for (int k = 0; k < 3; k++)
        t[k] = f->u[k] - f->q * f->m[k] / f->area2;
}

static void friction(const flow *f, double factor, double out[3])
{
    double t[3];
    tangential(f, t);
    const double scale = factor * sqrt(f->area2) * vec3_norm(t);
    for (int k = 0; k < 3; k++)
        out[k] = scale * t[k];
}

/* With the changes of t and l. */
static void friction_change(const flow *f, double factor, const double dt[3], double dl, double out[3])
{
    double t[3];
    tangential(f, t);
    const double speed = vec3_norm(t), l = sqrt(f->area2), along = speed > 0 ? vec3_dot(t, dt) / speed : 0;
    for (int k = 0; k < 3; k++)
        out[k] = factor * (l * (speed * dt[k] + along * t[k]) + dl * speed * t[k]);
}

static void friction_by_normal(const flow *f, double factor, const double dm[3], double out[3])
{
    const double dq = vec3_dot(f->u, dm), darea2 = 2 * vec3_dot(f->m, dm);
    double dt[3];
    for (int k = 0; k < 3; k++)
        dt[k] = -(dq * f->m[k] + f->q * (dm[k] - f->m[k] * darea2 / f->area2)) / f->area2;
    friction_change(f, factor, dt, darea2 / (2 * sqrt(f->area2)), out);
}

static void friction_by_velocity(const flow *f, double factor, int k, double out[3])
{
    double dt[3];
    for (int i = 0; i < 3; i++)
        dt[i] = (f->m[k] * f->m[i] / f->area2 - (i == k)) / 3;
    friction_change(f, factor, dt, 0, out);
}

static const air_force laws[] = {[SQUARE] = {square, square_by_normal, square_by_velocity},
                                 [PLATE] = {plate, plate_by_normal, plate_by_velocity}};
static const air_force skin = {friction, friction_by_normal, friction_by_velocity};

/* Every node has a third of the force: adds a column of a 9 x 9 matrix, -dF/3 for each node. */
static void add_column(double *matrix, int column, const double *dforce)
{
    for (int row = 0; row < D; row++)
        matrix[D * row + column] -= dforce[row % 3] / 3;
}

/* Adds a force and its derivatives. */
static void add_force(const air_force *force, const flow *f, double factor, double *g, double *dg_dx,
                      double *dg_dv)
{
    double of[3];
    force->force(f, factor, of);
    for (int k = 0; k < D; k++)
        g[k] -= of[k % 3] / 3;
    for (int column = 0; column < D; column++) {
        double dm[3];
        if (dg_dx) {
            normal_derivative(f, column / 3, column % 3, dm);
            force->by_normal(f, factor, dm, of);
            add_column(dg_dx, column, of);
        }
        if (dg_dv) {
            force->by_velocity(f, factor, column % 3, of);
            add_column(dg_dv, column, of);
        }
    }
}

static void dissipation(const drape_elements *el, int32_t first, int32_t count, const double *x,
                        const double *v, double *g, double *dg_dx, double *dg_dv)
{
    const air_force *law = &laws[(int)el->params[PARAM_LAW]];
    memset(g, 0, (size_t)count * D * sizeof *g);
    if (dg_dx)
        memset(dg_dx, 0, (size_t)count * D * D * sizeof *dg_dx);
    if (dg_dv)
        memset(dg_dv, 0, (size_t)count * D * D * sizeof *dg_dv);
    for (int32_t i = 0; i < count; i++) {
        const flow f = flow_of(el, first + i, x, v);
        double *hx = dg_dx ? dg_dx + (size_t)(D * D) * (size_t)i : NULL,
               *hv = dg_dv ? dg_dv + (size_t)(D * D) * (size_t)i : NULL;
        const double rub = drape_rest_of(el, REST_FRICTION, first + i);
        if (!(f.area2 > 0))
            continue;
        add_force(law, &f, el->rest[first + i], g + D * (size_t)i, hx, hv);
        if (rub > 0)
            add_force(&skin, &f, rub, g + D * (size_t)i, hx, hv);
    }
}

const drape_term_ops drape_term_drag_wind = {
    .struct_size = sizeof(drape_term_ops),
    .entry =
        {.name = "drag.wind",
         .summary =
             "pressure of wind on every triangle, 1/2 rho C A |u.n| (u.n) n with u the wind relative to it, "
             "or as on a plate with separated flow; friction along it",
         .reference = "Provot 1995, section 3.2; Hoerner 1965, Fluid-Dynamic Drag, chapter 3; Rayleigh 1876",
         DRAPE_PARAMS(params)},
    .element_name = "triangle",
    .nodes = 3,
    .build = build,
    .dissipation = dissipation,
    .dissipative = true,
    .in_medium = true,
};
