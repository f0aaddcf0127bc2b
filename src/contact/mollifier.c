/* mollifier.c: see gap.h. */
#include "base/vec3.h"
#include "contact/gap.h"

#define D DRAPE_GAP_DOFS

/* q = |u|^2 |w|^2 - (u.w)^2 with u = x1 - x0, w = x3 - x2, and its derivatives by u and w. */
typedef struct cross_square {
    double q, du[3], dw[3], uu[3][3], uw[3][3], ww[3][3];
} cross_square;

static cross_square cross_square_of(double x[4][3])
{
    double u[3], w[3], c[3];
    cross_square s;
    vec3_sub(x[1], x[0], u);
    vec3_sub(x[3], x[2], w);
    double a = vec3_dot(u, u), e = vec3_dot(w, w), b = vec3_dot(u, w);
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

static double dq_of(const cross_square *s, int i)
{
    int p = i / 3, k = i % 3;
    return sign_of(p) * (p < 2 ? s->du[k] : s->dw[k]);
}

static double ddq_of(const cross_square *s, int i, int j)
{
    int p = i / 3, k = i % 3, r = j / 3, l = j % 3;
    double h = p < 2 ? (r < 2 ? s->uu[k][l] : s->uw[k][l]) : (r < 2 ? s->uw[l][k] : s->ww[k][l]);
    return sign_of(p) * sign_of(r) * h;
}

void drape_mollify(double x[4][3], double w, drape_gap *gap)
{
    const cross_square s = cross_square_of(x);
    const double y = s.q / w;
    gap->mollified = s.q < w;
    gap->m = gap->mollified ? y * (2 - y) : 1;
    for (int i = 0; gap->mollified && i < D; i++)
        gap->dm[i] = 2 * (1 - y) / w * dq_of(&s, i);
}

void drape_mollify_twice(double x[4][3], double w, double ddm[D][D])
{
    const cross_square s = cross_square_of(x);
    const double dmdq = 2 * (1 - s.q / w) / w, ddmdq = -2 / (w * w);
    for (int i = 0; i < D; i++)
        for (int j = 0; j < D; j++)
            ddm[i][j] = dmdq * ddq_of(&s, i, j) + ddmdq * dq_of(&s, i) * dq_of(&s, j);
}
