/* friction.c: see friction.h. */
#include "contact/friction.h"

#include "base/vec3.h"

#define D DRAPE_GAP_DOFS

/* u = sum c v and its tangential part; a = f/|u_t| and b with d(a u_t)/du_t = a I + b u_t u_t'. */
typedef struct slip {
    double u[3], tangent[3], a, b;
} slip;

static slip slip_of(const drape_gap *gap, const drape_contact_law *law, double v[4][3])
{
    slip s = {0};
    for (int i = 0; i < gap->closest.points; i++)
        vec3_add_scaled(gap->closest.c[i], v[i], s.u);
    double along = vec3_dot(s.u, gap->closest.normal);
    for (int k = 0; k < 3; k++)
        s.tangent[k] = s.u[k] - along * gap->closest.normal[k];
    double speed = vec3_norm(s.tangent), eps = law->velocity;
    s.a = drape_secant_of_speed(speed, eps);
    if (speed < eps)
        s.b = speed > 0 ? -1 / (eps * eps * speed) : 0;
    else
        s.b = -1 / (speed * speed * speed);
    return s;
}

/* d(a u_t) for a change du_t */
static void differentiate(const slip *s, const double *du, double *out)
{
    double along = s->b * vec3_dot(s->tangent, du);
    for (int k = 0; k < 3; k++)
        out[k] = s->a * du[k] + along * s->tangent[k];
}

static void project_out(const double *n, double *a)
{
    vec3_add_scaled(-vec3_dot(a, n), n, a);
}

void drape_friction_force(const drape_gap *gap, const drape_contact_law *law, double lambda, double v[4][3],
                          double *g, double *dgdv)
{
    int d = 3 * gap->closest.points;
    slip s = slip_of(gap, law, v);
    double scale = law->friction * lambda;
    for (int i = 0; i < d; i++)
        g[i] = gap->closest.c[i / 3] * scale * s.a * s.tangent[i % 3];
    for (int j = 0; dgdv && j < d; j++) {
        double du[3] = {0}, df[3];
        du[j % 3] = gap->closest.c[j / 3];
        project_out(gap->closest.normal, du);
        differentiate(&s, du, df);
        for (int i = 0; i < d; i++)
            dgdv[D * i + j] = gap->closest.c[i / 3] * scale * df[i % 3];
    }
}

void drape_friction_bound(const drape_gap *gap, const drape_contact_law *law, double lambda, double v[4][3],
                          double *dgdv)
{
    int d = 3 * gap->closest.points;
    double scale = law->friction * lambda * slip_of(gap, law, v).a;
    const double *n = gap->closest.normal;
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++)
            dgdv[D * i + j] = gap->closest.c[i / 3] * gap->closest.c[j / 3] * scale *
                              ((i % 3 == j % 3) - n[i % 3] * n[j % 3]);
}

/* With F = a u_t: dg_i = mu (c_i F dlambda + lambda F dc_i + c_i lambda dF), and
 * du_t = P du - (n.u) dn - n (u.dn),  du = sum v_i dc_i. */
void drape_friction_add_normal(const drape_gap *gap, const drape_contact_law *law, const double *dlambda,
                               double v[4][3], double *dg)
{
    const int d = 3 * gap->closest.points;
    const slip s = slip_of(gap, law, v);
    for (int i = 0; i < d; i++)
        for (int j = 0; j < d; j++)
            dg[D * i + j] += gap->closest.c[i / 3] * law->friction * s.a * s.tangent[i % 3] * dlambda[j];
}

void drape_friction_add_dgdx(const drape_gap *gap, const drape_gap_derivatives *derivatives,
                             const drape_contact_law *law, double lambda, double v[4][3], double *dg)
{
    int d = 3 * gap->closest.points;
    slip s = slip_of(gap, law, v);
    double normal_speed = vec3_dot(s.u, gap->closest.normal), scale = law->friction * lambda;
    for (int j = 0; j < d; j++) {
        double du[3] = {0}, dn[3], df[3];
        for (int i = 0; i < gap->closest.points; i++)
            vec3_add_scaled(derivatives->closest.c[i][j], v[i], du);
        for (int k = 0; k < 3; k++)
            dn[k] = derivatives->closest.normal[k][j];
        project_out(gap->closest.normal, du);
        vec3_add_scaled(-normal_speed, dn, du);
        vec3_add_scaled(-vec3_dot(s.u, dn), gap->closest.normal, du);
        differentiate(&s, du, df);
        for (int i = 0; i < d; i++)
            dg[D * i + j] += scale * (s.a * s.tangent[i % 3] * derivatives->closest.c[i / 3][j] +
                                      gap->closest.c[i / 3] * df[i % 3]);
    }
}
