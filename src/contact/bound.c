/* bound.c: see bound.h. */
#include "contact/bound.h"

#include "base/vec3.h"

#include <math.h>

/* The number of points of the first piece; the second has the others. */
static int split_of(const drape_pair *pair)
{
    return pair->kind == DRAPE_PAIR_TRIANGLE ? 1 : 2;
}

/* The points, relative to the first one at x: coordinates may be large. */
static void gather(const drape_pair *pair, const double *x, const double *from, double local[4][3])
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

/* How far the first piece is ahead of the second along an axis, times the length of the axis. */
static double lead_along(int split, const double axis[3], double x[4][3])
{
    double first = INFINITY, second = -INFINITY;
    for (int a = 0; a < 4; a++) {
        const double at = vec3_dot(axis, x[a]);
        if (a < split)
            first = at < first ? at : first;
        else
            second = at > second ? at : second;
    }
    return first - second;
}

/* The same over a path with these ends (y NULL: there is one): the difference of two points along an axis is
 * linear on it, so it is least at an end. */
static double least_lead(int split, const double axis[3], double at[2][4][3], const double *y)
{
    const double first = lead_along(split, axis, at[0]), last = y ? lead_along(split, axis, at[1]) : first;
    return last < first ? last : first;
}

double drape_bound_by_axes(const drape_pair *pair, const double *x, const double *y)
{
    const int split = split_of(pair), ends = y ? 2 : 1;
    double at[2][4][3], axis[3], bound = -INFINITY;
    gather(pair, x, x, at[0]);
    if (y)
        gather(pair, x, y, at[1]);
    for (int end = 0; end < ends; end++) {
        axis_between(split, at[end], axis);
        const double least = least_lead(split, axis, at, y), length = vec3_norm(axis);
        if (length > 0 && least / length > bound)
            bound = least / length;
    }
    return bound;
}

bool drape_bound_is_apart(const drape_pair *pair, const double *x, const double *y, double distance)
{
    const int split = split_of(pair), ends = y ? 2 : 1;
    double at[2][4][3], axis[3];
    gather(pair, x, x, at[0]);
    if (y)
        gather(pair, x, y, at[1]);
    for (int end = 0; end < ends; end++) {
        axis_between(split, at[end], axis);
        const double least = least_lead(split, axis, at, y);
        if (least > 0 && least * least >= distance * distance * vec3_dot(axis, axis))
            return true;
    }
    return false;
}

double drape_bound_change(const drape_pair *pair, const double *x, const double *y)
{
    const int split = split_of(pair);
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
