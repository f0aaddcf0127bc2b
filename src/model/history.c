/* history.c: see history.h. */
#include "model/history.h"

#include "base/search.h"

#include <math.h>

#define LEAST 1e-6 /* of the largest factor */

/* Returns the number of keys at or before t. */
static size_t keys_until(const drape_history *h, double t)
{
    return (size_t)(drape_last_time(h->time, sizeof *h->time, (int64_t)h->key_count, t) + 1);
}

double drape_history_factor(const drape_history *h, double t)
{
    const size_t next = h ? keys_until(h, t) : 0;
    if (!h)
        return 1;
    if (next == 0 || next == h->key_count)
        return h->value[next == 0 ? 0 : next - 1];
    const double length = h->time[next] - h->time[next - 1], s = (t - h->time[next - 1]) / length,
                 from = h->value[next - 1], change = h->value[next] - from;
    if (!h->slope)
        return from + s * change;
    /* Hermite's cubic, in parts of the interval */
    return from + s * s * (3 - 2 * s) * change +
           length * s * (1 - s) * ((1 - s) * h->slope[next - 1] - s * h->slope[next]);
}

/* Neither kind goes beyond its keys. */
double drape_history_largest(const drape_history *h)
{
    double largest = h ? h->value[0] : 1;
    for (size_t k = 1; h && k < h->key_count; k++)
        largest = fabs(h->value[k]) > fabs(largest) ? h->value[k] : largest;
    return largest;
}

double drape_history_least(const drape_history *h)
{
    const double largest = fabs(drape_history_largest(h));
    double least = largest;
    for (size_t k = 0; h && k < h->key_count; k++)
        if (h->value[k] != 0)
            least = fmin(least, fabs(h->value[k]));
    return fmax(least, LEAST * largest);
}

/* The first and second derivatives at both ends of the piece that begins at a key; of the constant before the
 * first and after the last they are 0. */
static void derivatives(const drape_history *h, size_t key, double first[2], double second[2])
{
    first[0] = first[1] = second[0] = second[1] = 0;
    if (key + 1 >= h->key_count)
        return;
    const double length = h->time[key + 1] - h->time[key],
                 secant = (h->value[key + 1] - h->value[key]) / length;
    first[0] = first[1] = secant;
    if (!h->slope)
        return;
    first[0] = h->slope[key];
    first[1] = h->slope[key + 1];
    second[0] = (6 * secant - 4 * first[0] - 2 * first[1]) / length;
    second[1] = (2 * first[0] + 4 * first[1] - 6 * secant) / length;
}

double drape_history_next_kink(const drape_history *h, double t, double end)
{
    for (size_t k = keys_until(h, t); k < h->key_count && h->time[k] < end; k++) {
        double first[2][2] = {{0}}, second[2][2] = {{0}};
        if (k > 0)
            derivatives(h, k - 1, first[0], second[0]);
        derivatives(h, k, first[1], second[1]);
        if (first[0][1] != first[1][0] || second[0][1] != second[1][0])
            return h->time[k];
    }
    return end;
}

void drape_history_slopes(size_t key_count, const double *time, const double *value, double *slope)
{
    slope[0] = slope[key_count - 1] = 0;
    for (size_t k = 1; k + 1 < key_count; k++) {
        const double before = time[k] - time[k - 1], after = time[k + 1] - time[k],
                     rise = (value[k] - value[k - 1]) / before, next = (value[k + 1] - value[k]) / after,
                     w = 2 * after + before, u = after + 2 * before;
        const bool turns = !((rise > 0 && next > 0) || (rise < 0 && next < 0));
        slope[k] = turns ? 0 : (w + u) / (w / rise + u / next);
    }
}
