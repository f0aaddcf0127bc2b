/*
 * air.added_mass: the inertia of the air that a sheet pushes aside. Beside a strip of span s, m_a = pi/4 rho
 * s per area moves along its normal n as the strip does, and none along it: the energy of motion is
 *     T = 1/2 sum A m_a (n . (v - w))^2 = sum m_a q^2/(4 l),   q = r . m, l = |m|,
 * over triangles of area A, with m = (x1 - x0) x (x2 - x0) = 2 A n and the wind r = w - (v0 + v1 + v2)/3
 * relative to them. Lagrange's d/dt dT/dv - dT/dx then is the force of slender-body theory (Lighthill 1960,
 * Note on the swimming of slender fish; 1971, Large-amplitude elongated-body theory; Candelier, Boyer &
 * Leroyer 2011): of small deflections y(x, t) in wind U along x,
 *     -m_a (d/dt + U d/dx)^2 y,
 * the inertia, a gyroscopic part and one like a compression m_a U^2. Because A is the present area, the force
 * inside the sheet is along its normal, as that of any pressure. At edges that the wind meets it is the lift
 * and the suction of a leading edge.
 *
 * Where the wind leaves the sheet, the air takes its momentum along into the wake. Without that, the sheet
 * would get it back at this edge, and with it all energy that it has given to the air. With the wind u along
 * the sheet outwards across the edge (conormal c) and b along its normal, Lighthill's force per length is
 *     f = m_a (u b n - 1/2 b^2 c) u^2/(u^2 + b^2),   u > 0.
 * The last factor is not his: it is 1 at small angles, for which the theory is, and makes the force
 * continuous where an edge turns along the wind. Of a flat sheet this leaves lift and induced drag of a wing
 * of low aspect ratio, pi/4 rho s^2 U^2 a and half of that times a at small angles of attack a (Jones 1946).
 * With the edge from xa to xb, counterclockwise, and k = (xb - xa) x m, L = |xb - xa|, z = r . k, where r and
 * q have the mean velocity of its ends, the force on the edge is
 *     F = m_a z^2/(z^2 + q^2 L^2) (z q m - q^2/2 k)/l^3.
 */
#include "base/pi.h"
#include "base/vec3.h"
#include "terms/terms.h"

#include <math.h>
#include <string.h>

enum { PARAM_SPAN, PARAM_COEFFICIENT, PARAM_DENSITY, PARAM_WIND, PARAM_WAKE = PARAM_WIND + 3 };
enum { LIST_WAKE = PARAM_WIND + 1, LIST_HISTORY, LIST_RAMP, LIST_COUNT };
enum { REST_MASS, REST_WIND, REST_EDGES = REST_WIND + 3, REST_COUNT }; /* m_a, w, 1 << k for edge k */
enum { D = 9 };

/* As a list the wind is one entry; among the values it takes three. */
static const drape_param params[LIST_COUNT] = {
    [PARAM_SPAN] = DRAPE_NUMBER("span", "m", DRAPE_REQUIRED, 0, 1e6,
                                "extent across the wind, or the smaller one: the air beside an area has the "
                                "mass coefficient density span"),
    [PARAM_COEFFICIENT] =
        DRAPE_NUMBER("coefficient", "1", DRAPE_PI / 4, 0, 1e6,
                     "mass of the air over that of density span^2 per length: pi/4 is a long "
                     "strip, 0.45 a square"),
    [PARAM_DENSITY] = DRAPE_NUMBER("density", "kg/m3", 1.225, 0, 1e6,
                                   "density of the medium: 1.225 is air at sea level and 15 degrees"),
    [PARAM_WIND] = DRAPE_VECTOR("wind", "m/s", 0, -1e6, 1e6, "velocity of the medium"),
    [LIST_WAKE] = DRAPE_BOOLEAN("wake", true, "air that leaves across an edge takes its momentum along"),
    [LIST_HISTORY] = DRAPE_TERM_HISTORY_PARAM,
    [LIST_RAMP] = DRAPE_TERM_RAMP_PARAM,
};

static drape_status build(const drape_cloth_view *cloth, const double *values, drape_term_builder *builder)
{
    const double mass = values[PARAM_COEFFICIENT] * values[PARAM_DENSITY] * values[PARAM_SPAN],
                 *wind = values + PARAM_WIND;
    DRAPE_TRY(drape_term_reserve(builder, cloth->triangle_count, REST_COUNT));
    for (int32_t i = 0; i < cloth->triangle_count; i++) {
        int edges = 0;
        for (int k = 0; values[PARAM_WAKE] != 0 && k < 3; k++)
            edges |= drape_on_boundary(cloth, cloth->triangle_edge[3 * (size_t)i + (size_t)k]) << k;
        drape_term_set(builder, i, cloth->triangle + 3 * (size_t)i,
                       (const double[REST_COUNT]){mass, wind[0], wind[1], wind[2], edges});
    }
    return DRAPE_OK;
}

/* One triangle: m_a, the edges opposite its nodes, m, |m|, r and q; or a change of it. */
typedef struct flow {
    double mass, opposite[3][3], m[3], l, r[3], q;
} flow;

static flow flow_of(const drape_elements *el, int32_t element, const double *x, const double *v)
{
    const int32_t *node = el->node + 3 * (size_t)element;
    flow f = {.mass = drape_rest_of(el, REST_MASS, element)};
    for (int i = 0; i < 3; i++)
        vec3_sub(x + 3 * (size_t)node[(i + 2) % 3], x + 3 * (size_t)node[(i + 1) % 3], f.opposite[i]);
    vec3_cross(f.opposite[2], f.opposite[0], f.m);
    f.l = vec3_norm(f.m);
    for (int k = 0; k < 3; k++) {
        f.r[k] = el->factor * drape_rest_of(el, REST_WIND + k, element);
        for (int i = 0; i < 3; i++)
            f.r[k] -= v[3 * (size_t)node[i] + (size_t)k] / 3;
    }
    f.q = vec3_dot(f.r, f.m);
    return f;
}

/* The change with coordinate k of node i: dm = unit x opposite[i]. */
static flow by_place(const flow *f, int i, int k)
{
    double unit[3] = {0};
    flow d = {0};
    unit[k] = 1;
    vec3_cross(f->opposite[i], unit, d.m);
    d.opposite[(i + 1) % 3][k] = 1;
    d.opposite[(i + 2) % 3][k] = -1;
    d.l = vec3_dot(f->m, d.m) / f->l;
    d.q = vec3_dot(f->r, d.m);
    return d;
}

/* xx, vx and vv of one triangle, from dT/dm = g. */
static void second_derivatives(const flow *f, const double g[3], double *xx, double *vx, double *vv)
{
    for (int column = 0; column < D; column++) {
        const flow d = by_place(f, column / 3, column % 3);
        double dg[3], dp[3], a[3], b[3];
        const double l3 = f->l * f->l * f->l;
        for (int k = 0; k < 3; k++) {
            dg[k] = f->mass *
                    ((d.q * f->r[k] + f->q * d.r[k] - f->q * f->r[k] * d.l / f->l) / (2 * f->l) -
                     f->q * (2 * d.q * f->m[k] + f->q * d.m[k] - 3 * f->q * f->m[k] * d.l / f->l) / (4 * l3));
            dp[k] = -f->mass / 6 * (d.q * f->m[k] + f->q * d.m[k] - f->q * f->m[k] * d.l / f->l) / f->l;
        }
        for (int i = 0; i < 3; i++) {
            vec3_cross(d.opposite[i], g, a);
            vec3_cross(f->opposite[i], dg, b);
            for (int k = 0; k < 3; k++) {
                const int at = D * (3 * i + k) + column;
                xx[at] = -a[k] - b[k];
                vx[at] = dp[k];
                vv[at] = f->mass / 18 * f->m[k] * f->m[column % 3] / f->l;
            }
        }
    }
}

static double *item(double *array, int32_t i, int numbers)
{
    return array ? array + (size_t)i * (size_t)numbers : NULL;
}

static void clear(double *array, int32_t count, int numbers)
{
    if (array)
        memset(array, 0, (size_t)count * (size_t)numbers * sizeof *array);
}

static void kinetic(const drape_elements *el, int32_t first, int32_t count, const double *x, const double *v,
                    const drape_kinetic *out)
{
    clear(out->t, count, 1);
    clear(out->by_x, count, D);
    clear(out->by_v, count, D);
    clear(out->xx, count, D * D);
    clear(out->vx, count, D * D);
    clear(out->vv, count, D * D);
    for (int32_t i = 0; i < count; i++) {
        const flow f = flow_of(el, first + i, x, v);
        double *by_x = item(out->by_x, i, D), *by_v = item(out->by_v, i, D);
        if (!(f.l > 0))
            continue;
        if (out->t)
            out->t[i] = f.mass * f.q * f.q / (4 * f.l);
        double g[3], p[3], moment[3];
        /* g = dT/dm, whose vector product with the opposite edge is dT/dx of a node; the momentum of each */
        for (int k = 0; k < 3; k++) {
            g[k] = f.mass * f.q * (f.r[k] / (2 * f.l) - f.q * f.m[k] / (4 * f.l * f.l * f.l));
            p[k] = -f.mass / 6 * f.q * f.m[k] / f.l;
        }
        for (int a = 0; a < 3; a++) {
            vec3_cross(f.opposite[a], g, moment);
            for (int k = 0; by_x && k < 3; k++)
                by_x[3 * a + k] = -moment[k];
            for (int k = 0; by_v && k < 3; k++)
                by_v[3 * a + k] = p[k];
        }
        if (out->xx)
            second_derivatives(&f, g, item(out->xx, i, D * D), item(out->vx, i, D * D),
                               item(out->vv, i, D * D));
    }
}

/* ---- The wake ---- */

/* The wind relative to the edge opposite a node, in place of that relative to the triangle. */
static flow flow_at_edge(const drape_elements *el, int32_t element, const double *v, int opposite, flow f)
{
    const int32_t *node = el->node + 3 * (size_t)element;
    for (int k = 0; k < 3; k++)
        f.r[k] = el->factor * drape_rest_of(el, REST_WIND + k, element) -
                 (v[3 * (size_t)node[(opposite + 1) % 3] + (size_t)k] +
                  v[3 * (size_t)node[(opposite + 2) % 3] + (size_t)k]) /
                     2;
    f.q = vec3_dot(f.r, f.m);
    return f;
}

/* The force on the edge opposite a node; false: there is none. */
static bool edge_force(const flow *f, int opposite, double force[3])
{
    const double *e = f->opposite[opposite], length2 = vec3_dot(e, e), l3 = f->l * f->l * f->l;
    double k[3];
    vec3_cross(e, f->m, k);
    const double z = vec3_dot(f->r, k);
    if (!(z > 0))
        return false;
    const double share = z * z / (z * z + f->q * f->q * length2);
    for (int i = 0; i < 3; i++)
        force[i] = f->mass * share * (z * f->q * f->m[i] - f->q * f->q / 2 * k[i]) / l3;
    return true;
}

static void edge_force_change(const flow *f, int opposite, const flow *d, double change[3])
{
    const double *e = f->opposite[opposite], *de = d->opposite[opposite], length2 = vec3_dot(e, e),
                 l3 = f->l * f->l * f->l;
    double k[3], dk[3], dk2[3];
    vec3_cross(e, f->m, k);
    vec3_cross(de, f->m, dk);
    vec3_cross(e, d->m, dk2);
    vec3_add_scaled(1, dk2, dk);
    const double z = vec3_dot(f->r, k), dz = vec3_dot(d->r, k) + vec3_dot(f->r, dk),
                 sum = z * z + f->q * f->q * length2, share = z * z / sum,
                 dsum = 2 * (z * dz + f->q * d->q * length2 + f->q * f->q * vec3_dot(e, de)),
                 dshare = (2 * z * dz - share * dsum) / sum - 3 * share * d->l / f->l;
    for (int i = 0; i < 3; i++)
        change[i] = f->mass / l3 *
                    (dshare * (z * f->q * f->m[i] - f->q * f->q / 2 * k[i]) +
                     share * ((dz * f->q + z * d->q) * f->m[i] + z * f->q * d->m[i] - f->q * d->q * k[i] -
                              f->q * f->q / 2 * dk[i]));
}

/* Subtracts half of a force from the rows of both nodes of an edge. */
static void put(const double force[3], int opposite, int stride, double *to)
{
    for (int a = 0; a < 3; a++)
        for (int k = 0; a != opposite && k < 3; k++)
            to[stride * (3 * a + k)] -= force[k] / 2;
}

static void dissipation(const drape_elements *el, int32_t first, int32_t count, const double *x,
                        const double *v, double *g, double *dg_dx, double *dg_dv)
{
    clear(g, count, D);
    clear(dg_dx, count, D * D);
    clear(dg_dv, count, D * D);
    for (int32_t i = 0; i < count; i++) {
        const int edges = (int)drape_rest_of(el, REST_EDGES, first + i);
        if (edges == 0)
            continue;
        const flow centre = flow_of(el, first + i, x, v);
        for (int k = 0; centre.l > 0 && k < 3; k++) {
            const int opposite = (k + 2) % 3; /* of the edge from corner k to the next */
            const flow f = flow_at_edge(el, first + i, v, opposite, centre);
            double force[3];
            if (!(edges & 1 << k) || !edge_force(&f, opposite, force))
                continue;
            put(force, opposite, 1, item(g, i, D));
            for (int column = 0; dg_dx && column < D; column++) {
                const flow d = by_place(&f, column / 3, column % 3);
                edge_force_change(&f, opposite, &d, force);
                put(force, opposite, D, item(dg_dx, i, D * D) + column);
            }
            for (int column = 0; dg_dv && column < D; column++) {
                const double share = column / 3 == opposite ? 0 : 0.5; /* of the mean of both ends */
                flow d = {.q = -share * f.m[column % 3]};
                d.r[column % 3] = -share;
                edge_force_change(&f, opposite, &d, force);
                put(force, opposite, D, item(dg_dv, i, D * D) + column);
            }
        }
    }
}

const drape_term_ops drape_term_air_added_mass = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "air.added_mass",
              .summary = "inertia of the air that moves along the normal of the sheet with it, T = 1/2 A m_a "
                         "(u.n)^2 with u the wind relative to each triangle, and of the wake",
              .reference =
                  "Lighthill 1971, Large-amplitude elongated-body theory of fish locomotion; Candelier, "
                  "Boyer & Leroyer 2011; Jones 1946",
              DRAPE_PARAMS(params)},
    .element_name = "triangle",
    .nodes = 3,
    .build = build,
    .dissipation = dissipation,
    .dissipative = true,
    .in_medium = true,
    .kinetic = kinetic,
};
