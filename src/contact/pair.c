/* pair.c: see pair.h. */
#include "contact/pair.h"

#include "base/vec3.h"

#include <math.h>
#include <string.h>

/* of |e1|^2 |e2|^2 at rest: sin^2 below which edges are mollified (Li et al. 2020) */
#define PARALLEL_WIDTH 1e-3
#define UNTANGLED      0.1 /* activation distance of pieces that rest in each other, in their shortest edge */

typedef void find_closest(double x[4][3], drape_closest *at);

/* By kind; NULL for a surface, which has a signed distance. */
static find_closest *const finders[] = {NULL, drape_closest_point_triangle, drape_closest_segments};

int drape_pair_points(const drape_pair *pair)
{
    return finders[pair->kind] ? 4 : 1;
}

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

/* The mollifier of edges 0 1 and 2 3 (Li et al. 2020, eq. 24), a function of q = |e1 x e2|^2: m = q/w (2 -
 * q/w) below w, 1 above. Sets mollified, m and dm. */
static void mollify(double x[4][3], double w, drape_gap *gap)
{
    const cross_square s = cross_square_of(x);
    const double y = s.q / w;
    gap->mollified = s.q < w;
    gap->m = gap->mollified ? y * (2 - y) : 1;
    for (int i = 0; gap->mollified && i < D; i++)
        gap->dm[i] = 2 * (1 - y) / w * dq_of(&s, i);
}

/* The second derivative of the mollifier, below w. */
static void mollify_twice(double x[4][3], double w, double ddm[D][D])
{
    const cross_square s = cross_square_of(x);
    const double dmdq = 2 * (1 - s.q / w) / w, ddmdq = -2 / (w * w);
    for (int i = 0; i < D; i++)
        for (int j = 0; j < D; j++)
            ddm[i][j] = dmdq * ddq_of(&s, i, j) + ddmdq * dq_of(&s, i) * dq_of(&s, j);
}

static void gather(const drape_pair *pair, int points, const double *from, double local[4][3])
{
    for (int a = 0; a < points; a++)
        memcpy(local[a], from + 3 * (size_t)pair->node[a], 3 * sizeof(double));
}

static double surface(const drape_pair *pair, const drape_configuration *at, double *normal,
                      double *curvature)
{
    return drape_collider_distance(drape_configuration_body(at, pair->collider), &at->pose[pair->collider],
                                   at->x + 3 * (size_t)pair->node[0], normal, curvature);
}

double drape_pair_gap_value(const drape_pair *pair, const drape_configuration *at)
{
    double x[4][3];
    drape_closest closest;
    if (!finders[pair->kind])
        return surface(pair, at, NULL, NULL);
    gather(pair, 4, at->x, x);
    finders[pair->kind](x, &closest);
    return closest.distance - pair->radius;
}

/* w of mollify, from the edges at rest. */
static double mollifier_width(const drape_pair *pair, const double *rest)
{
    double x[4][3], u[3], w[3];
    gather(pair, 4, rest, x);
    vec3_sub(x[1], x[0], u);
    vec3_sub(x[3], x[2], w);
    return PARALLEL_WIDTH * vec3_dot(u, u) * vec3_dot(w, w);
}

/* The largest coordinate. */
static double largest(double x[4][3])
{
    double most = 0;
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 3; k++)
            most = fmax(most, fabs(x[i][k]));
    return most;
}

/* The normal at a sharp feature at distance 0, where the closest points give no direction: across both pieces
 * and out of the collider. It does not change with the points. */
static void touching_normal(const drape_pair *pair, const drape_configuration *at, double x[4][3],
                            double normal[3])
{
    const drape_collider *collider = &at->model->colliders[pair->collider];
    const drape_collider_shape *shape = &collider->shape;
    double u[3], w[3], out[3], n[3];
    bool face = pair->kind == DRAPE_PAIR_TRIANGLE;
    vec3_sub(x[face ? 2 : 1], x[face ? 1 : 0], u);
    vec3_sub(x[3], x[face ? 1 : 2], w);
    vec3_cross(u, w, n);
    double length = vec3_norm(n);
    drape_pose_own(&at->pose[pair->collider], x[0], out);
    for (int32_t i = 0; i < shape->point_count; i++)
        vec3_add_scaled(-1.0 / shape->point_count, shape->point + 3 * (size_t)i, out);
    drape_pose_direction(&at->pose[pair->collider], out);
    bool cloth_first = pair->node[0] < at->model->node_count;
    double sign = (vec3_dot(n, out) < 0) == cloth_first ? -1 : 1;
    for (int k = 0; k < 3 && length > 0; k++)
        normal[k] = sign * n[k] / length;
}

/* Whether the boxes around both pieces are farther apart than reach; false for numbers that are not
 * finite. */
static bool are_apart(drape_pair_kind kind, double x[4][3], double reach)
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        bool face = kind == DRAPE_PAIR_TRIANGLE;
        double low = x[0][k], high = low, other = x[1][k], low2 = face ? other : x[2][k], high2 = low2;
        if (face) {
            low2 = x[2][k] < low2 ? x[2][k] : low2;
            high2 = x[2][k] > high2 ? x[2][k] : high2;
        } else {
            low = other < low ? other : low;
            high = other > high ? other : high;
        }
        low2 = x[3][k] < low2 ? x[3][k] : low2;
        high2 = x[3][k] > high2 ? x[3][k] : high2;
        double between = low2 > high ? low2 - high : low > high2 ? low - high2 : 0;
        sum += between * between;
    }
    return sum > reach * reach;
}

bool drape_pair_is_apart(const drape_pair *pair, const drape_configuration *at, double gap)
{
    double x[4][3];
    if (!finders[pair->kind])
        return false;
    gather(pair, 4, at->x, x);
    return are_apart(pair->kind, x, gap + pair->radius);
}

/* A lower bound of the activation distance. Where a rest shape passes through itself or another one, half of
 * the distance at rest would be 0. So in a scene that is untangled two pieces of one sheet have at least a
 * share of the shortest of their edges, as neighbours have, and pieces of two sheets the whole distance. */
static double least_activation(const drape_pair *pair, const drape_configuration *rest)
{
    const drape_model *m = rest->model;
    const int split = drape_pair_split(pair->kind);
    double x[4][3], shortest = INFINITY, d[3];
    if (!m->untangle.given)
        return 0;
    if (drape_model_cloth_of(m, pair->node[0]) != drape_model_cloth_of(m, pair->node[3]))
        return pair->distance;
    gather(pair, 4, rest->x, x);
    for (int a = 0; a < 4; a++)
        for (int b = a + 1; b < 4; b++) {
            if ((a < split) != (b < split))
                continue;
            vec3_sub(x[a], x[b], d);
            shortest = fmin(shortest, vec3_norm(d));
        }
    return fmin(pair->distance, UNTANGLED * shortest);
}

double drape_pair_activation_distance(const drape_pair *pair, const drape_configuration *rest)
{
    if (pair->collider >= 0 || drape_pair_is_apart(pair, rest, 2 * pair->distance))
        return pair->distance;
    return fmin(pair->distance, fmax(0.5 * drape_pair_gap_value(pair, rest), least_activation(pair, rest)));
}

bool drape_pair_gap(const drape_pair *pair, const drape_configuration *at, const double *rest, drape_gap *gap)
{
    double x[4][3];
    gap->fixed_normal = gap->mollified = false;
    gap->m = 1;
    if (!finders[pair->kind]) {
        gap->closest = (drape_closest){.points = 1, .c = {1}};
        gap->value = surface(pair, at, NULL, NULL);
        if (!(gap->value < pair->distance))
            return false;
        surface(pair, at, gap->closest.normal, gap->curvature);
        return true;
    }
    gather(pair, 4, at->x, x);
    gap->value = INFINITY;
    if (are_apart(pair->kind, x, pair->distance + pair->radius))
        return false;
    finders[pair->kind](x, &gap->closest);
    gap->value = gap->closest.distance - pair->radius;
    if (!(gap->value < pair->distance))
        return false;
    gap->fixed_normal = pair->collider >= 0 && gap->closest.distance < DRAPE_CLOSEST_ROUNDING * largest(x);
    if (gap->fixed_normal)
        touching_normal(pair, at, x, gap->closest.normal);
    if (pair->kind == DRAPE_PAIR_SEGMENTS)
        mollify(x, mollifier_width(pair, rest), gap);
    return true;
}

void drape_pair_derivatives(const drape_pair *pair, const drape_gap *gap, const drape_configuration *at,
                            const double *rest, drape_gap_derivatives *derivatives)
{
    double x[4][3];
    memset(&derivatives->closest, 0, sizeof derivatives->closest);
    if (pair->kind == DRAPE_PAIR_SURFACE) {
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < 3 * gap->closest.points; i++)
                derivatives->closest.normal[k][i] = gap->closest.c[i / 3] * gap->curvature[3 * k + i % 3];
        return;
    }
    gather(pair, gap->closest.points, at->x, x);
    if (!gap->fixed_normal)
        drape_closest_derive(x, &gap->closest, &derivatives->closest);
    if (gap->mollified)
        mollify_twice(x, mollifier_width(pair, rest), derivatives->ddm);
}

/* ---- Continuous collision detection ---- */

/* The points of a pair and their displacements. If its collider turns, they are seen from there: its own
 * points rest, and the others turn about it. */
typedef struct pair_path {
    double x[4][3], p[4][3];
    const drape_swing *swing; /* NULL: all move straight */
    bool rests[4];
} pair_path;

static double gap_at(const drape_pair *pair, const pair_path *path, double t, double radius, double normal[3])
{
    double at[4][3];
    drape_closest closest;
    memcpy(at, path->x, sizeof at);
    for (int a = 0; a < 4; a++) {
        if (!path->swing)
            vec3_add_scaled(t, path->p[a], at[a]);
        else
            drape_swing_own(path->swing, path->x[a], path->p[a], path->rests[a] ? 0 : t, at[a]);
    }
    finders[pair->kind](at, &closest);
    memcpy(normal, closest.normal, sizeof closest.normal);
    return closest.distance - radius;
}

/* By how much the first piece is ahead of the second along an axis on which the points of the pair have these
 * coordinates. */
static double lead_of(int split, const double at[4])
{
    double first = INFINITY, second = -INFINITY;
    for (int a = 0; a < 4; a++)
        if (a < split)
            first = at[a] < first ? at[a] : first;
        else
            second = at[a] > second ? at[a] : second;
    return first - second;
}

/* By how much the first piece is ahead of the second along a normal at a step fraction t. If the normal is
 * that of an earlier fraction, the pieces of a straight path are never nearer between the two fractions than
 * at one of them. */
static double lead_at(const drape_pair *pair, const pair_path *path, const double normal[3], double t)
{
    double at[4];
    for (int a = 0; a < 4; a++)
        at[a] = vec3_dot(normal, path->x[a]) + t * vec3_dot(normal, path->p[a]);
    return lead_of(drape_pair_split(pair->kind), at);
}

/* The largest rate, per step fraction, at which the two pieces can approach each other. The common part of
 * straight displacements is taken out of the path. */
static double approach_speed(const drape_pair *pair, pair_path *path)
{
    double mean[3] = {0}, largest[2] = {0};
    for (int a = 0; a < 4 && path->swing; a++)
        if (!path->rests[a])
            largest[0] = fmax(largest[0], drape_swing_speed(path->swing, path->x[a], path->p[a]));
    if (path->swing)
        return largest[0];
    for (int a = 0; a < 4; a++)
        vec3_add_scaled(0.25, path->p[a], mean);
    for (int a = 0; a < 4; a++) {
        const int second = a >= drape_pair_split(pair->kind);
        vec3_add_scaled(-1, mean, path->p[a]);
        largest[second] = fmax(largest[second], vec3_norm(path->p[a]));
    }
    return largest[0] + largest[1];
}

double drape_pair_step_fraction(const drape_pair *pair, const double *from, const double *to,
                                const drape_swings *swings, const drape_keep *keep, double limit)
{
    const bool turns = swings && pair->collider >= 0 && swings->of[pair->collider].turns;
    pair_path path = {.swing = turns ? &swings->of[pair->collider] : NULL};
    double y[4][3], radius = pair->radius, t = 0;
    gather(pair, 4, from, path.x);
    gather(pair, 4, to, y);
    for (int a = 0; a < 4; a++) {
        vec3_sub(y[a], path.x[a], path.p[a]);
        path.rests[a] = turns && pair->node[a] >= swings->nodes;
    }
    const double speed = approach_speed(pair, &path), least = drape_pair_least_gap(pair, keep->rounding);
    double normal[3], gap = gap_at(pair, &path, 0, radius, normal);
    if (keep->core && !drape_gap_has_side(gap, keep->rounding)) {
        gap += radius;
        radius = 0;
    }
    if (!(speed > 0) || !drape_gap_has_side(gap, keep->rounding) || gap - least > speed)
        return limit;
    const double end = drape_keep_gap(keep, least, gap, pair->distance),
                 slack = (1 - DRAPE_ADVANCE) * fmin(end, gap - end);
    for (int i = 0; i < DRAPE_MAX_ADVANCES; i++) {
        t += DRAPE_ADVANCE * (gap - end) / speed;
        if (t >= limit || (!path.swing && lead_at(pair, &path, normal, limit) - radius > end + slack))
            return limit;
        gap = gap_at(pair, &path, t, radius, normal);
        if (gap <= end + slack)
            return t;
    }
    return t;
}

/* ---- Bounds ---- */

/* The points, relative to the first one at x: coordinates may be large. */
static void gather_relative(const drape_pair *pair, const double *x, const double *from, double local[4][3])
{
    for (int a = 0; a < 4; a++)
        vec3_sub(from + 3 * (size_t)pair->node[a], x + 3 * (size_t)pair->node[0], local[a]);
}

/* From the centre of the second piece to that of the first. */
static void axis_between(int split, double x[4][3], double axis[3])
{
    for (int k = 0; k < 3; k++)
        axis[k] = split == 1 ? x[0][k] - (x[1][k] + x[2][k] + x[3][k]) / 3
                             : 0.5 * ((x[0][k] + x[1][k]) - (x[2][k] + x[3][k]));
}

/* The least lead along an axis, times the length of the axis, on a path with these ends: the difference of
 * two points along an axis is linear on the path, so it is least at an end. */
static double least_lead(int split, const double axis[3], double x[2][4][3], int ends)
{
    double least = INFINITY, at[4];
    for (int end = 0; end < ends; end++) {
        for (int a = 0; a < 4; a++)
            at[a] = vec3_dot(axis, x[end][a]);
        const double lead = lead_of(split, at);
        least = lead < least ? lead : least;
    }
    return least;
}

double drape_bound_by_axes(const drape_pair *pair, const double *x, const double *y)
{
    const int split = drape_pair_split(pair->kind), ends = y ? 2 : 1;
    double at[2][4][3], axis[3], bound = -INFINITY;
    gather_relative(pair, x, x, at[0]);
    if (y)
        gather_relative(pair, x, y, at[1]);
    for (int end = 0; end < ends; end++) {
        axis_between(split, at[end], axis);
        const double least = least_lead(split, axis, at, ends), length = vec3_norm(axis);
        if (length > 0 && least / length > bound)
            bound = least / length;
    }
    return bound;
}

bool drape_bound_is_apart(const drape_pair *pair, const double *x, const double *y, double distance)
{
    const int split = drape_pair_split(pair->kind), ends = y ? 2 : 1;
    double at[2][4][3], axis[3];
    gather_relative(pair, x, x, at[0]);
    if (y)
        gather_relative(pair, x, y, at[1]);
    for (int end = 0; end < ends; end++) {
        axis_between(split, at[end], axis);
        const double least = least_lead(split, axis, at, ends);
        if (least > 0 && least * least >= distance * distance * vec3_dot(axis, axis))
            return true;
    }
    return false;
}

double drape_bound_change(const drape_pair *pair, const double *x, const double *y)
{
    const int split = drape_pair_split(pair->kind);
    double move[4][3], mean[3] = {0}, largest[2] = {0};
    for (int a = 0; a < 4; a++) {
        const size_t at = 3 * (size_t)pair->node[a];
        vec3_sub(y + at, x + at, move[a]);
        vec3_add_scaled(0.25, move[a], mean);
    }
    for (int a = 0; a < 4; a++) {
        vec3_sub(move[a], mean, move[a]);
        const double square = vec3_dot(move[a], move[a]);
        largest[a >= split] = fmax(largest[a >= split], square);
    }
    return sqrt(largest[0]) + sqrt(largest[1]);
}
