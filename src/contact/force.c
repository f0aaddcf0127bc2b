/* force.c: see force.h. */
#include "contact/force.h"

#include "base/vec3.h"
#include "contact/barrier.h"

#include <string.h>

#define D 12

/* ---- The mollifier ---- */

/* q = |u|^2 |w|^2 - (u.w)^2 with u = x1 - x0, w = x3 - x2, and its derivatives by u and w. */
typedef struct cross_square {
    double q, du[3], dw[3], uu[3][3], uw[3][3], ww[3][3];
} cross_square;

static cross_square cross_square_of(const double *u, const double *w)
{
    double a = vec3_dot(u, u), e = vec3_dot(w, w), b = vec3_dot(u, w), c[3];
    cross_square s;
    vec3_cross(u, w, c);
    s.q = vec3_dot(c, c);
    for (int i = 0; i < 3; i++) {
        s.du[i] = 2 * (e * u[i] - b * w[i]);
        s.dw[i] = 2 * (a * w[i] - b * u[i]);
        for (int j = 0; j < 3; j++) {
            s.uu[i][j] = 2 * ((i == j ? e : 0) - w[i] * w[j]);
            s.ww[i][j] = 2 * ((i == j ? a : 0) - u[i] * u[j]);
            s.uw[i][j] = 2 * (2 * u[i] * w[j] - w[i] * u[j] - (i == j ? b : 0));
        }
    }
    return s;
}

static double sign_of(int point)
{
    return point % 2 ? 1 : -1; /* u = x1 - x0, w = x3 - x2 */
}

/* dq/dx and d2q/dx2 from those by u and w */
static void spread(const cross_square *s, double dq[D], double ddq[D][D])
{
    for (int i = 0; i < D; i++) {
        int p = i / 3, k = i % 3;
        dq[i] = sign_of(p) * (p < 2 ? s->du[k] : s->dw[k]);
        for (int j = 0; j < D; j++) {
            int r = j / 3, l = j % 3;
            double h = p < 2 ? (r < 2 ? s->uu[k][l] : s->uw[k][l]) : (r < 2 ? s->uw[l][k] : s->ww[k][l]);
            ddq[i][j] = sign_of(p) * sign_of(r) * h;
        }
    }
}

void drape_mollify(double x[4][3], double w, bool derivatives, drape_gap *gap)
{
    double u[3], v[3], dq[D], ddq[D][D];
    vec3_sub(x[1], x[0], u);
    vec3_sub(x[3], x[2], v);
    cross_square s = cross_square_of(u, v);
    gap->mollified = s.q < w;
    gap->m = 1;
    if (!gap->mollified)
        return;
    double y = s.q / w, slope = 2 * (1 - y) / w, bend = -2 / (w * w);
    gap->m = y * (2 - y);
    if (!derivatives)
        return;
    spread(&s, dq, ddq);
    for (int i = 0; i < D; i++) {
        gap->dm[i] = slope * dq[i];
        for (int j = 0; j < D; j++)
            gap->ddm[i][j] = slope * ddq[i][j] + bend * dq[i] * dq[j];
    }
}

/* ---- Normal force ---- */

static double mollifier(const drape_gap *gap)
{
    return gap->mollified ? gap->m : 1;
}

double drape_contact_energy(const drape_gap *gap, const drape_contact_law *law)
{
    return mollifier(gap) * law->stiffness * law->distance * drape_barrier_at(gap->value / law->distance).b;
}

double drape_contact_normal_force(const drape_gap *gap, const drape_contact_law *law)
{
    return -mollifier(gap) * law->stiffness * drape_barrier_at(gap->value / law->distance).db;
}

void drape_contact_normal(const drape_gap *gap, const drape_contact_law *law, double *g, double *h)
{
    int d = 3 * gap->points;
    drape_barrier b = drape_barrier_at(gap->value / law->distance);
    double m = mollifier(gap), e = law->stiffness * law->distance * b.b, de = law->stiffness * b.db,
           dde = law->stiffness / law->distance * b.ddb, dgap[D];
    for (int i = 0; i < d; i++) {
        dgap[i] = gap->c[i / 3] * gap->normal[i % 3];
        g[i] = m * de * dgap[i] + (gap->mollified ? e * gap->dm[i] : 0);
    }
    for (int i = 0; h && i < d; i++)
        for (int j = 0; j < d; j++) {
            double ddgap = gap->c[i / 3] * gap->dn[i % 3][j] + gap->dc[i / 3][j] * gap->normal[i % 3];
            double sum = m * (dde * dgap[i] * dgap[j] + de * ddgap);
            if (gap->mollified)
                sum += de * (dgap[i] * gap->dm[j] + gap->dm[i] * dgap[j]) + e * gap->ddm[i][j];
            h[D * i + j] = sum;
        }
}

void drape_contact_positive(const drape_gap *gap, const drape_contact_law *law, double *h)
{
    int d = 3 * gap->points;
    double bend =
        mollifier(gap) * law->stiffness / law->distance * drape_barrier_at(gap->value / law->distance).ddb;
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++)
            h[D * i + j] = bend * gap->c[i / 3] * gap->normal[i % 3] * gap->c[j / 3] * gap->normal[j % 3];
}

/* ---- Friction ---- */

/* u = sum c v and its tangential part; a = f/|u_t| and b with d(a u_t)/du_t = a I + b u_t u_t'. */
typedef struct slip {
    double u[3], tangent[3], a, b;
} slip;

static slip slip_of(const drape_gap *gap, const drape_contact_law *law, double v[4][3])
{
    slip s = {0};
    for (int i = 0; i < gap->points; i++)
        vec3_add_scaled(gap->c[i], v[i], s.u);
    double along = vec3_dot(s.u, gap->normal);
    for (int k = 0; k < 3; k++)
        s.tangent[k] = s.u[k] - along * gap->normal[k];
    double speed = vec3_norm(s.tangent), eps = law->velocity;
    if (speed < eps) {
        s.a = (2 - speed / eps) / eps;
        s.b = speed > 0 ? -1 / (eps * eps * speed) : 0;
    } else {
        s.a = 1 / speed;
        s.b = -1 / (speed * speed * speed);
    }
    return s;
}

/* d(a u_t) for a change du_t */
static void turn(const slip *s, const double *du, double *out)
{
    double along = s->b * vec3_dot(s->tangent, du);
    for (int k = 0; k < 3; k++)
        out[k] = s->a * du[k] + along * s->tangent[k];
}

static void project_out(const double *n, double *a)
{
    vec3_add_scaled(-vec3_dot(a, n), n, a);
}

void drape_contact_friction(const drape_gap *gap, const drape_contact_law *law, double lambda, double v[4][3],
                            double *g, double *dgdv)
{
    int d = 3 * gap->points;
    slip s = slip_of(gap, law, v);
    double scale = law->friction * lambda;
    for (int i = 0; i < d; i++)
        g[i] = gap->c[i / 3] * scale * s.a * s.tangent[i % 3];
    for (int j = 0; dgdv && j < d; j++) {
        double du[3] = {0}, df[3];
        du[j % 3] = gap->c[j / 3];
        project_out(gap->normal, du);
        turn(&s, du, df);
        for (int i = 0; i < d; i++)
            dgdv[D * i + j] = gap->c[i / 3] * scale * df[i % 3];
    }
}

void drape_contact_friction_bound(const drape_gap *gap, const drape_contact_law *law, double lambda,
                                  double v[4][3], double *dgdv)
{
    int d = 3 * gap->points;
    double scale = law->friction * lambda * slip_of(gap, law, v).a;
    const double *n = gap->normal;
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++)
            dgdv[D * i + j] =
                gap->c[i / 3] * gap->c[j / 3] * scale * ((i % 3 == j % 3) - n[i % 3] * n[j % 3]);
}

/* With F = a u_t: dg_i = mu (lambda F dc_i + c_i F dlambda + c_i lambda dF), and
 * du_t = P du - (n.u) dn - n (u.dn),  du = sum v_i dc_i. */
void drape_contact_friction_slope(const drape_gap *gap, const drape_contact_law *law, double v[4][3],
                                  double *dgdx)
{
    int d = 3 * gap->points;
    slip s = slip_of(gap, law, v);
    drape_barrier b = drape_barrier_at(gap->value / law->distance);
    double m = mollifier(gap), lambda = drape_contact_normal_force(gap, law),
           normal_speed = vec3_dot(s.u, gap->normal), mu = law->friction;
    for (int j = 0; j < d; j++) {
        double du[3] = {0}, dn[3], df[3];
        double dlambda = -m * law->stiffness / law->distance * b.ddb * gap->c[j / 3] * gap->normal[j % 3];
        if (gap->mollified)
            dlambda -= law->stiffness * b.db * gap->dm[j];
        for (int i = 0; i < gap->points; i++)
            vec3_add_scaled(gap->dc[i][j], v[i], du);
        for (int k = 0; k < 3; k++)
            dn[k] = gap->dn[k][j];
        project_out(gap->normal, du);
        vec3_add_scaled(-normal_speed, dn, du);
        vec3_add_scaled(-vec3_dot(s.u, dn), gap->normal, du);
        turn(&s, du, df);
        for (int i = 0; i < d; i++)
            dgdx[D * i + j] += mu * (lambda * s.a * s.tangent[i % 3] * gap->dc[i / 3][j] +
                                     gap->c[i / 3] * (dlambda * s.a * s.tangent[i % 3] + lambda * df[i % 3]));
    }
}
