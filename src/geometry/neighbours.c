/*
 * neighbours.c: see neighbours.h.
 *
 * Points are sorted by bucket, then by number, where
 *     bucket = hash of a box's y and z + its number along x,
 * so that the boxes of a row along x are consecutive and can be searched as one range.
 *
 * The lists hold the points whose distance is less than the reach plus the moves of two points plus a skin.
 * They are valid until a point has moved by half of the skin, not counting the mean motion of all points. If
 * the lists become too long, as in a heap of points, each query searches the boxes instead: a point that has
 * not moved since the update is where it was sorted; one that has moved did so by at most share times the
 * reach, and a ball enlarged by that finds it in its old box.
 */
#include "geometry/neighbours.h"

#include "base/lanes.h"
#include "base/vec3.h"

#include <string.h>

#define SKIN 0.5 /* as a fraction of the reach */

drape_status drape_neighbours_create(drape_arena *arena, int32_t points, double reach, drape_neighbours *s)
{
    const size_t n = (size_t)points;
    *s = (drape_neighbours){.points = points, .reach = reach, .buckets = 64};
    while (s->buckets < 2 * points && s->buckets < 1 << 28)
        s->buckets *= 2;
    s->start = drape_arena_take(arena, (size_t)s->buckets + 1, sizeof *s->start);
    s->bucket = drape_arena_take(arena, n, sizeof *s->bucket);
    s->place = drape_arena_take(arena, n, sizeof *s->place);
    s->point = drape_arena_take(arena, n, sizeof *s->point);
    s->row = drape_arena_take(arena, n, sizeof *s->row);
    s->x = drape_arena_take(arena, 3 * n, sizeof *s->x);
    s->first = drape_arena_take(arena, n + 1, sizeof *s->first);
    s->cursor = drape_arena_take(arena, n, sizeof *s->cursor);
    s->near = drape_arena_take(arena, n * DRAPE_MEAN_NEIGHBOURS, sizeof *s->near);
    s->pair = drape_arena_take(arena, n * DRAPE_MEAN_NEIGHBOURS, sizeof *s->pair);
    s->x_listed = drape_arena_take(arena, 3 * n, sizeof *s->x_listed);
    return drape_arena_status(arena);
}

/* ---- Boxes ---- */

/* Computes floor(x per_box): the conversion truncates towards zero, and floor itself is a function call on
 * baseline x86-64. */
static int32_t box_number(double x, double per_box)
{
    double number = x * per_box;
    if (!(fabs(number) < INT32_MAX / 2)) /* points farther away share a box: box numbers have 32 bits */
        return 0;
    int32_t cut = (int32_t)number;
    return cut - (number < cut);
}

static void box_of(const drape_neighbours *s, const double *x, int32_t box[3])
{
    for (int k = 0; k < 3; k++)
        box[k] = box_number(x[k], s->per_box);
}

static int32_t bucket_of(const drape_neighbours *s, int32_t x, int32_t y, int32_t z)
{
    /* odd factors are bijections in y and in z */
    uint32_t row = (uint32_t)y * 0x9E3779B1u ^ (uint32_t)z * 0x85EBCA77u;
    return (int32_t)(((row ^ row >> 15) + (uint32_t)x) & (uint32_t)(s->buckets - 1));
}

/* Returns the row along x that contains a box. */
static uint64_t row_of(int32_t y, int32_t z)
{
    return (uint64_t)(uint32_t)y << 32 | (uint32_t)z;
}

static void sort_points(drape_neighbours *s, const double *x)
{
    memset(s->start, 0, ((size_t)s->buckets + 1) * sizeof *s->start);
    for (int32_t i = 0; i < s->points; i++) {
        int32_t box[3];
        box_of(s, x + 3 * (size_t)i, box);
        s->bucket[i] = bucket_of(s, box[0], box[1], box[2]);
        s->start[s->bucket[i] + 1]++;
    }
    for (int32_t b = 0; b < s->buckets; b++)
        s->start[b + 1] += s->start[b];
    for (int32_t i = s->points - 1; i >= 0;
         i--) { /* backwards: the ends of the buckets become their starts */
        int32_t box[3], at = --s->start[s->bucket[i] + 1];
        box_of(s, x + 3 * (size_t)i, box);
        s->place[i] = at;
        s->point[at] = i;
        s->row[at] = row_of(box[1], box[2]);
        memcpy(s->x + 3 * (size_t)at, x + 3 * (size_t)i, 3 * sizeof *x);
    }
    /* start[b + 1] is now where bucket b begins */
    memmove(s->start, s->start + 1, (size_t)s->buckets * sizeof *s->start);
    s->start[s->buckets] = s->points;
}

/* ---- Searching boxes ---- */

/* The search for points nearer to one point than the reach. */
typedef struct search {
    int32_t point;
    const double *x;
    double square_of_reach;
    int32_t low[3], high[3]; /* range of boxes to search */
    int32_t *found;
    int count; /* more than DRAPE_MAX_NEIGHBOURS: found is incomplete */
} search;

/* Adds the points from first to last that belong to the row, not to another row with the same hash, and are
 * near. Each point is written, and counted only if it is added: a branch here would be mispredicted half of
 * the time. */
static inline void search_range(const drape_neighbours *s, search *q, uint64_t row, int32_t first,
                                int32_t last)
{
    int count = q->count;
    for (int32_t at = first; at < last; at++) {
        double d[3];
        int32_t point = s->point[at];
        vec3_sub(q->x, s->x + 3 * (size_t)at, d);
        q->found[count < DRAPE_MAX_NEIGHBOURS ? count : DRAPE_MAX_NEIGHBOURS] = point;
        count += (vec3_dot(d, d) < q->square_of_reach) & (point != q->point) & (s->row[at] == row);
    }
    q->count = count;
}

int drape_neighbours_search(const drape_neighbours *s, int32_t point, const double *x,
                            int32_t found[DRAPE_MAX_NEIGHBOURS + 1])
{
    const double ball = s->reach * (1 + s->share);
    search q = {.point = point, .x = x, .square_of_reach = s->reach * s->reach, .found = found};
    for (int k = 0; k < 3; k++) {
        q.low[k] = box_number(x[k] - ball, s->per_box);
        q.high[k] = box_number(x[k] + ball, s->per_box);
    }
    for (int32_t y = q.low[1]; y <= q.high[1]; y++)
        for (int32_t z = q.low[2]; z <= q.high[2]; z++) {
            uint64_t row = row_of(y, z);
            int32_t first = bucket_of(s, q.low[0], y, z), last = first + (q.high[0] - q.low[0]) + 1;
            if (last <= s->buckets) {
                search_range(s, &q, row, s->start[first], s->start[last]);
                continue;
            }
            search_range(s, &q, row, s->start[first], s->start[s->buckets]);
            search_range(s, &q, row, 0, s->start[last - s->buckets]);
        }
    if (q.count > DRAPE_MAX_NEIGHBOURS)
        return -1;
    for (int i = 1; i < q.count; i++) {
        int32_t moved = found[i];
        int j = i;
        for (; j > 0 && found[j - 1] > moved; j--)
            found[j] = found[j - 1];
        found[j] = moved;
    }
    return q.count;
}

/* ---- Lists ---- */

/* The rows of boxes, relative to that of a point, in which the second point of a pair is searched; the rows
 * on the other side search for it from there. */
static const int32_t rows_ahead[][2] = {{0, 1}, {1, -1}, {1, 0}, {1, 1}};
enum { ROWS = sizeof rows_ahead / sizeof *rows_ahead };

/* The sorted points that may be near those of one box: those of the next box in its row, and of three boxes
 * in each of the rows ahead. A range that wraps around the table is split in two. */
typedef struct surroundings {
    int32_t bucket;
    uint64_t row;
    int count;
    struct {
        uint64_t row;
        int32_t first, last;
    } range[1 + 2 * ROWS];
} surroundings;

static void surround(const drape_neighbours *s, uint64_t row, int32_t bucket, int32_t buckets,
                     surroundings *a)
{
    int32_t end = bucket + buckets, cut = end < s->buckets ? end : s->buckets;
    a->range[a->count].row = row;
    a->range[a->count].first = s->start[bucket];
    a->range[a->count++].last = s->start[cut];
    if (end <= s->buckets)
        return;
    a->range[a->count].row = row;
    a->range[a->count].first = 0;
    a->range[a->count++].last = s->start[end - s->buckets];
}

/* Adds the pairs of a point with those from first to last; returns the new number of pairs. */
static inline int32_t pair_with(const drape_neighbours *s, int32_t at, uint64_t row, int32_t first,
                                int32_t last, double square_of_reach, int32_t count)
{
    const double *x = s->x + 3 * (size_t)at;
    for (int32_t other = first; other < last; other++) {
        double d[3];
        vec3_sub(x, s->x + 3 * (size_t)other, d);
        s->pair[2 * (size_t)count] = s->point[at];
        s->pair[2 * (size_t)count + 1] = s->point[other];
        count += (vec3_dot(d, d) < square_of_reach) & (s->row[other] == row);
    }
    return count;
}

/* Collects all pairs of points nearer than reach, which is the size of the boxes. Returns -1 if there are
 * more than the lists hold. */
static int32_t collect_pairs(drape_neighbours *s, double reach)
{
    const int32_t capacity = s->points * (DRAPE_MEAN_NEIGHBOURS / 2);
    int32_t count = 0;
    surroundings a = {.bucket = -1};
    for (int32_t at = 0; at < s->points; at++) {
        int32_t bucket = s->bucket[s->point[at]];
        if (bucket != a.bucket || s->row[at] != a.row) {
            int32_t box[3];
            box_of(s, s->x + 3 * (size_t)at, box);
            a.bucket = bucket_of(s, box[0], box[1], box[2]);
            a.row = s->row[at];
            a.count = 0;
            surround(s, a.row, bucket_of(s, box[0] + 1, box[1], box[2]), 1, &a);
            for (int k = 0; k < ROWS; k++) {
                int32_t y = box[1] + rows_ahead[k][0], z = box[2] + rows_ahead[k][1];
                surround(s, row_of(y, z), bucket_of(s, box[0] - 1, y, z), 3, &a);
            }
        }
        int32_t last = s->start[bucket + 1], candidates = last - at;
        for (int k = 0; k < a.count; k++)
            candidates += a.range[k].last - a.range[k].first;
        if (candidates > capacity - count) /* pair_with writes every pair, and counts those that are near */
            return -1;
        count = pair_with(s, at, a.row, at + 1, last, reach * reach, count);
        for (int k = 0; k < a.count; k++)
            count = pair_with(s, at, a.range[k].row, a.range[k].first, a.range[k].last, reach * reach, count);
    }
    return count;
}

/* Turns pairs into a list for every point, in ascending order: first into unordered lists, in near; then each
 * point in turn is appended to the lists of all points in its own list. Returns false if a list is too
 * long. */
static bool spread_pairs(drape_neighbours *s, int32_t count)
{
    int32_t total = 0, *sorted = s->pair;
    memset(s->cursor, 0, (size_t)s->points * sizeof *s->cursor);
    for (int32_t p = 0; p < 2 * count; p++)
        s->cursor[s->pair[p]]++;
    for (int32_t i = 0; i < s->points; i++) {
        int32_t own = s->cursor[i];
        if (own > DRAPE_MAX_NEIGHBOURS)
            return false;
        s->first[i] = s->cursor[i] = total;
        total += own;
    }
    s->first[s->points] = total;
    for (int32_t p = 0; p < count; p++) {
        int32_t i = s->pair[2 * p], j = s->pair[2 * p + 1];
        s->near[s->cursor[i]++] = j;
        s->near[s->cursor[j]++] = i;
    }
    memcpy(s->cursor, s->first, (size_t)s->points * sizeof *s->cursor);
    for (int32_t i = 0; i < s->points; i++)
        for (int32_t k = s->first[i]; k < s->first[i + 1]; k++)
            sorted[s->cursor[s->near[k]]++] = i;
    s->pair = s->near;
    s->near = sorted;
    return true;
}

/* ---- Validity of the lists ---- */

/* Sums x - x0 over all points, in LANES partial sums. */
static inline void sum_moves(size_t n, const double *restrict x, const double *restrict x0, double sum[3])
{
    double lane[3 * LANES] = {0};
    size_t whole = n - n % LANES;
    for (size_t i = 0; i < 3 * whole; i += 3 * LANES)
        for (size_t k = 0; k < 3 * LANES; k++)
            lane[k] += x[i + k] - x0[i + k];
    for (size_t i = 3 * whole; i < 3 * n; i++)
        lane[i % 3] += x[i] - x0[i];
    for (size_t k = 0; k < 3; k++)
        sum[k] = lane[k] + lane[3 + k] + lane[6 + k] + lane[9 + k];
}

static inline double square_of_move(const double *x, const double *x0, const double mean[3])
{
    double a = x[0] - x0[0] - mean[0], b = x[1] - x0[1] - mean[1], c = x[2] - x0[2] - mean[2];
    return a * a + b * b + c * c;
}

/* Returns the largest distance that a point has moved from x0 to x, relative to the mean of all points;
 * infinity if a number is not finite. */
LANES_DISPATCH static double farthest_moved(size_t n, const double *restrict x, const double *restrict x0)
{
    double mean[3], lane[LANES] = {0}, square;
    size_t whole = n - n % LANES;
    sum_moves(n, x, x0, mean);
    for (int k = 0; k < 3; k++)
        mean[k] /= (double)n;
    if (!isfinite(mean[0] + mean[1] + mean[2]))
        return INFINITY;
    for (size_t i = 0; i < whole; i += LANES)
        for (size_t k = 0; k < LANES; k++) {
            square = square_of_move(x + 3 * (i + k), x0 + 3 * (i + k), mean);
            lane[k] = square > lane[k] ? square : lane[k];
        }
    for (size_t i = whole; i < n; i++) {
        square = square_of_move(x + 3 * i, x0 + 3 * i, mean);
        lane[0] = square > lane[0] ? square : lane[0];
    }
    return sqrt(fmax(fmax(lane[0], lane[1]), fmax(lane[2], lane[3])));
}

void drape_neighbours_update(drape_neighbours *s, double share, const double *x)
{
    const double reach = s->reach * (1 + 2 * share + SKIN);
    s->share = share;
    if (s->listed && share <= s->listed_share &&
        farthest_moved((size_t)s->points, x, s->x_listed) <= 0.5 * SKIN * s->reach)
        return;
    s->per_box = 1 / reach;
    sort_points(s, x);
    const int32_t pairs = collect_pairs(s, reach);
    s->listed = pairs >= 0 && spread_pairs(s, pairs);
    s->listed_share = share;
    memcpy(s->x_listed, x, 3 * (size_t)s->points * sizeof *x);
}
