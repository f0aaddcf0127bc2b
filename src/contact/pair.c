/* pair.c: see pair.h. */
#include "contact/pair.h"

#include "base/vec3.h"
#include "contact/closest.h"

#include <string.h>

#define PARALLEL_WIDTH                                                                                       \
    1e-3                   /* of |e1|^2 |e2|^2 at rest: sin^2 below which edges count less (Li et al. 2020) */
#define WAY_SHARE     0.9  /* of the way that is certainly free, taken at once */
#define MOST_ADVANCES 1000 /* then what was reached is safe, if not all there is */

typedef void find_closest(double x[4][3], drape_closest *at);

/* By kind; a surface has none. */
static find_closest *const finders[] = {NULL, drape_closest_point_triangle, drape_closest_segments};

int drape_pair_points(const drape_pair *pair)
{
    return finders[pair->kind] ? 4 : 1;
}

void drape_pair_gather(const drape_pair *pair, const double *from, double local[4][3])
{
    for (int a = 0; a < drape_pair_points(pair); a++)
        memcpy(local[a], from + 3 * (size_t)pair->node[a], 3 * sizeof(double));
}

static double surface(const drape_pair *pair, const drape_placed *at, double *normal, double *curvature)
{
    return drape_collider_distance(&at->model->colliders[pair->collider], &at->pose[pair->collider],
                                   at->x + 3 * (size_t)pair->node[0], normal, curvature);
}

double drape_pair_gap_value(const drape_pair *pair, const drape_placed *at)
{
    double x[4][3];
    drape_closest closest;
    if (!finders[pair->kind])
        return surface(pair, at, NULL, NULL);
    drape_pair_gather(pair, at->x, x);
    finders[pair->kind](x, &closest);
    return closest.distance - pair->radius;
}

/* w of drape_mollify: of the edges at rest. */
static double mollifier_width(const drape_pair *pair, const double *rest)
{
    double x[4][3], u[3], w[3];
    drape_pair_gather(pair, rest, x);
    vec3_sub(x[1], x[0], u);
    vec3_sub(x[3], x[2], w);
    return PARALLEL_WIDTH * vec3_dot(u, u) * vec3_dot(w, w);
}

static bool surface_gap(const drape_pair *pair, const drape_placed *at, bool derivatives, drape_gap *gap)
{
    double curvature[9];
    gap->points = 1;
    gap->c[0] = 1;
    gap->value = surface(pair, at, gap->normal, NULL);
    if (!(gap->value < pair->distance))
        return false;
    if (!derivatives)
        return true;
    surface(pair, at, NULL, curvature);
    memset(gap->dc, 0, sizeof gap->dc);
    for (int k = 0; k < 3; k++)
        for (int j = 0; j < 3; j++)
            gap->dn[k][j] = curvature[3 * k + j];
    return true;
}

bool drape_pair_gap(const drape_pair *pair, const drape_placed *at, const double *rest, bool derivatives,
                    drape_gap *gap)
{
    double x[4][3];
    drape_closest closest;
    drape_closest_slopes slopes;
    gap->mollified = false;
    if (!finders[pair->kind])
        return surface_gap(pair, at, derivatives, gap);
    drape_pair_gather(pair, at->x, x);
    finders[pair->kind](x, &closest);
    gap->value = closest.distance - pair->radius;
    if (!(gap->value < pair->distance))
        return false;
    gap->points = 4;
    memcpy(gap->c, closest.c, sizeof gap->c);
    memcpy(gap->normal, closest.normal, sizeof gap->normal);
    if (derivatives) {
        drape_closest_derive(x, &closest, &slopes);
        memcpy(gap->dc, slopes.c, sizeof gap->dc);
        memcpy(gap->dn, slopes.normal, sizeof gap->dn);
    }
    if (pair->kind == DRAPE_PAIR_SEGMENTS)
        drape_mollify(x, mollifier_width(pair, rest), derivatives, gap);
    return true;
}

/* ---- The way that is free ---- */

/* How fast the points of both pieces can come nearer to each other, over the whole way: what they have in
 * common does not matter. */
static double approach_speed(drape_pair_kind kind, double p[4][3])
{
    double mean[3] = {0}, first = 0, second = 0;
    int split = kind == DRAPE_PAIR_TRIANGLE ? 1 : 2;
    for (int a = 0; a < 4; a++)
        vec3_add_scaled(0.25, p[a], mean);
    for (int a = 0; a < 4; a++) {
        vec3_add_scaled(-1, mean, p[a]);
        double speed = vec3_norm(p[a]);
        if (a < split)
            first = fmax(first, speed);
        else
            second = fmax(second, speed);
    }
    return first + second;
}

static double gap_at(const drape_pair *pair, double x[4][3], double p[4][3], double t, double radius)
{
    double at[4][3];
    drape_closest closest;
    memcpy(at, x, sizeof at);
    for (int a = 0; a < 4; a++)
        vec3_add_scaled(t, p[a], at[a]);
    finders[pair->kind](at, &closest);
    return closest.distance - radius;
}

double drape_pair_way(const drape_pair *pair, const double *from, const double *to, double keep, bool core)
{
    double x[4][3], y[4][3], p[4][3], radius = core ? 0 : pair->radius, t = 0;
    drape_pair_gather(pair, from, x);
    drape_pair_gather(pair, to, y);
    for (int a = 0; a < 4; a++)
        vec3_sub(y[a], x[a], p[a]);
    double speed = approach_speed(pair->kind, p), gap = gap_at(pair, x, p, 0, radius), least = keep * gap;
    if (!(speed > 0) || !(gap > 0) || gap > speed)
        return 1;
    for (int i = 0; i < MOST_ADVANCES; i++) {
        t += WAY_SHARE * (gap - least) / speed;
        if (t >= 1)
            return 1;
        gap = gap_at(pair, x, p, t, radius);
        if (gap < least + (1 - WAY_SHARE) * least)
            return t;
    }
    return t;
}
