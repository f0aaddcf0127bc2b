/* pair.c: see pair.h. */
#include "contact/pair.h"

#include "base/vec3.h"
#include "contact/closest.h"

#include <math.h>
#include <string.h>

#define PARALLEL_WIDTH                                                                                       \
    1e-3                   /* of |e1|^2 |e2|^2 at rest: sin^2 below which edges count less (Li et al. 2020) */
#define TOUCHING      1e-9 /* [m] nearer than that, positions do not say which side is which */
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

/* A sharp feature that touches has no direction of its own: it has that across both pieces, out of the collider.
 * Normals do not turn there. */
static void touching_normal(const drape_pair *pair, const drape_placed *at, double x[4][3], double normal[3])
{
    const drape_collider *collider = &at->model->colliders[pair->collider];
    const drape_collider_shape *shape = &collider->shape;
    double u[3], w[3], out[3], n[3];
    bool face = pair->kind == DRAPE_PAIR_TRIANGLE;
    vec3_sub(x[face ? 2 : 1], x[face ? 1 : 0], u);
    vec3_sub(x[3], x[face ? 1 : 2], w);
    vec3_cross(u, w, n);
    double length = vec3_norm(n);
    for (int k = 0; k < 3; k++)
        out[k] = x[0][k] - at->pose[pair->collider].displacement[k];
    for (int32_t i = 0; i < shape->point_count; i++)
        vec3_add_scaled(-1.0 / shape->point_count, shape->point + 3 * (size_t)i, out);
    bool cloth_first = pair->node[0] < at->model->node_count;
    double sign = (vec3_dot(n, out) < 0) == cloth_first ? -1 : 1;
    for (int k = 0; k < 3 && length > 0; k++)
        normal[k] = sign * n[k] / length;
}

/* Whether the boxes around both pieces are further apart than reach; false for numbers that are none. */
static bool are_apart(drape_pair_kind kind, double x[4][3], double reach)
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        bool face = kind == DRAPE_PAIR_TRIANGLE;
        double low = x[0][k], high = low, other = x[1][k], least = face ? other : x[2][k], most = least;
        if (face) {
            least = x[2][k] < least ? x[2][k] : least;
            most = x[2][k] > most ? x[2][k] : most;
        } else {
            low = other < low ? other : low;
            high = other > high ? other : high;
        }
        least = x[3][k] < least ? x[3][k] : least;
        most = x[3][k] > most ? x[3][k] : most;
        double between = least > high ? least - high : low > most ? low - most : 0;
        sum += between * between;
    }
    return sum > reach * reach;
}

bool drape_pair_is_apart(const drape_pair *pair, const drape_placed *at, double gap)
{
    double x[4][3];
    if (!finders[pair->kind])
        return false;
    drape_pair_gather(pair, at->x, x);
    return are_apart(pair->kind, x, gap + pair->radius);
}

static bool touch_surface(const drape_pair *pair, const drape_placed *at, drape_touch *touch)
{
    touch->gap = surface(pair, at, touch->closest.normal, NULL);
    touch->closest.points = 1;
    touch->closest.c[0] = 1;
    return touch->gap < pair->distance;
}

bool drape_pair_touch(const drape_pair *pair, const drape_placed *at, const double *rest, drape_touch *touch)
{
    double x[4][3];
    drape_gap gap;
    touch->pair = *pair;
    touch->mollified = touch->sharp = false;
    if (!finders[pair->kind])
        return touch_surface(pair, at, touch);
    drape_pair_gather(pair, at->x, x);
    touch->gap = INFINITY;
    if (are_apart(pair->kind, x, pair->distance + pair->radius))
        return false;
    finders[pair->kind](x, &touch->closest);
    touch->gap = touch->closest.distance - pair->radius;
    if (!(touch->gap < pair->distance))
        return false;
    touch->sharp = pair->collider >= 0 && touch->closest.distance < TOUCHING;
    if (touch->sharp)
        touching_normal(pair, at, x, touch->closest.normal);
    if (pair->kind == DRAPE_PAIR_SEGMENTS) {
        drape_mollify(x, mollifier_width(pair, rest), false, &gap);
        touch->mollified = gap.mollified;
    }
    return true;
}

void drape_touch_reduce(drape_touch *touch)
{
    int which[4], points = touch->closest.points;
    if (points < 4 || touch->mollified || touch->sharp)
        return;
    drape_closest_reduce(&touch->closest, which);
    for (int a = 0; a < touch->closest.points; a++)
        touch->pair.node[a] = touch->pair.node[which[a]];
    for (int a = touch->closest.points; a < 4; a++)
        touch->pair.node[a] = -1;
}

static void surface_slopes(const drape_touch *touch, const drape_placed *at, drape_gap *gap)
{
    double curvature[9];
    surface(&touch->pair, at, NULL, curvature);
    memset(gap->dc, 0, sizeof gap->dc);
    for (int k = 0; k < 3; k++)
        memcpy(gap->dn[k], curvature + 3 * k, 3 * sizeof *curvature);
}

void drape_touch_gap(const drape_touch *touch, const drape_placed *at, const double *rest, bool derivatives,
                     drape_gap *gap)
{
    double x[4][3];
    drape_closest_slopes slopes = {0};
    gap->points = touch->closest.points;
    gap->value = touch->gap;
    gap->mollified = touch->mollified;
    memcpy(gap->c, touch->closest.c, sizeof gap->c);
    memcpy(gap->normal, touch->closest.normal, sizeof gap->normal);
    if (gap->points == 1 && derivatives)
        surface_slopes(touch, at, gap);
    if (gap->points == 1 || (!derivatives && !gap->mollified))
        return;
    for (int a = 0; a < gap->points; a++)
        memcpy(x[a], at->x + 3 * (size_t)touch->pair.node[a], sizeof x[a]);
    if (derivatives && !touch->sharp)
        drape_closest_derive(x, &touch->closest, &slopes);
    memcpy(gap->dc, slopes.c, sizeof gap->dc);
    memcpy(gap->dn, slopes.normal, sizeof gap->dn);
    if (gap->mollified)
        drape_mollify(x, mollifier_width(&touch->pair, rest), true, gap);
}

bool drape_pair_gap(const drape_pair *pair, const drape_placed *at, const double *rest, bool derivatives,
                    drape_gap *gap)
{
    drape_touch touch;
    if (!drape_pair_touch(pair, at, rest, &touch)) {
        *gap = (drape_gap){.points = touch.closest.points, .value = touch.gap};
        return false;
    }
    drape_touch_gap(&touch, at, rest, derivatives, gap);
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

double drape_pair_way(const drape_pair *pair, const double *from, const double *to, double keep, bool core,
                      double most)
{
    double x[4][3], y[4][3], p[4][3], radius = core ? 0 : pair->radius, t = 0;
    drape_pair_gather(pair, from, x);
    drape_pair_gather(pair, to, y);
    for (int a = 0; a < 4; a++)
        vec3_sub(y[a], x[a], p[a]);
    double speed = approach_speed(pair->kind, p), gap = gap_at(pair, x, p, 0, radius), least = keep * gap;
    if (!(speed > 0) || !(gap > (pair->collider >= 0 ? TOUCHING : 0)) || gap > speed)
        return most;
    for (int i = 0; i < MOST_ADVANCES; i++) {
        t += WAY_SHARE * (gap - least) / speed;
        if (t >= most)
            return most;
        gap = gap_at(pair, x, p, t, radius);
        if (gap < least + (1 - WAY_SHARE) * least)
            return t;
    }
    return t;
}
