/* flat.c: see flat.h. */
#include "contact/flat.h"

#include "base/vec3.h"
#include "geometry/bvh.h"
#include "geometry/closest.h"

#include <stdlib.h>
#include <string.h>

typedef struct builder {
    const drape_clusters *clusters;
    const drape_model *model;
    drape_arena *temporary;
    double *plane; /* (node_count x 2) [m] in the plane of its sheet; sheets lie side by side */
    bool *flat;    /* (cloth_count) */
    drape_flat *out;
    int64_t windows; /* numbers in the lists so far */
} builder;

/* ---- The plane of a sheet ---- */

static int32_t end_of(const drape_model *m, int32_t cloth, bool triangles)
{
    const bool last = cloth + 1 == m->cloth_count;
    return triangles ? (last ? m->triangle_count : m->cloths[cloth + 1].first_triangle)
                     : (last ? m->node_count : m->cloths[cloth + 1].first_node);
}

static double twice_area(const double *a, const double *b, const double *c)
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static double length_of(double x, double y)
{
    return sqrt(x * x + y * y);
}

/* Axes of the plane, from the sum of the normals of faces; false if that is 0. */
static bool find_axes(const drape_model *m, int32_t cloth, const double *rest, double axis[3][3])
{
    double a[3], b[3], c[3], normal[3] = {0};
    for (int32_t f = m->cloths[cloth].first_triangle; f < end_of(m, cloth, true); f++) {
        const int32_t *n = m->triangle + 3 * (size_t)f;
        vec3_sub(rest + 3 * (size_t)n[1], rest + 3 * (size_t)n[0], a);
        vec3_sub(rest + 3 * (size_t)n[2], rest + 3 * (size_t)n[0], b);
        vec3_cross(a, b, c);
        vec3_add_scaled(1, c, normal);
    }
    const double length = vec3_norm(normal);
    if (!(length > 0))
        return false;
    int least = 0;
    for (int k = 0; k < 3; k++) {
        axis[2][k] = normal[k] / length;
        least = fabs(normal[k]) < fabs(normal[least]) ? k : least;
    }
    double other[3] = {0};
    other[least] = 1;
    vec3_cross(other, axis[2], axis[0]);
    const double size = vec3_norm(axis[0]);
    for (int k = 0; k < 3; k++)
        axis[0][k] /= size;
    vec3_cross(axis[2], axis[0], axis[1]);
    return true;
}

typedef struct place {
    double x[2];
} place;

static int compare_places(const void *a, const void *b)
{
    const double *p = ((const place *)a)->x, *q = ((const place *)b)->x;
    const int k = p[0] == q[0];
    return (p[k] > q[k]) - (p[k] < q[k]);
}

/* Area and perimeter of the convex hull (Andrew 1979, monotone chain). Sorts the places. hull: (2 count). */
static void measure_hull(place *places, int32_t count, place *hull, double *area, double *perimeter)
{
    int32_t size = 0;
    qsort(places, (size_t)count, sizeof *places, compare_places);
    for (int side = 0; side < 2; side++) {
        const int32_t start = size;
        for (int32_t i = 0; i < count; i++) {
            const place *next = &places[side ? count - 1 - i : i];
            while (size >= start + 2 && twice_area(hull[size - 2].x, hull[size - 1].x, next->x) <= 0)
                size--;
            hull[size++] = *next;
        }
        size--; /* the last one begins the other side */
    }
    *area = *perimeter = 0;
    for (int32_t i = 0; i < size; i++) {
        const double *a = hull[i].x, *b = hull[(i + 1) % size].x;
        *area += 0.5 * twice_area(hull[0].x, a, b);
        *perimeter += length_of(b[0] - a[0], b[1] - a[1]);
    }
}

/* Whether the faces cover their convex hull once: their area is that of the hull, and the length of their
 * boundary is its perimeter, but for rounding. */
static bool is_convex(builder *b, int32_t cloth, double length)
{
    const drape_model *m = b->model;
    const int32_t first = m->cloths[cloth].first_node, end = end_of(m, cloth, false), count = end - first;
    place *places = drape_arena_take(b->temporary, (size_t)count, sizeof *places),
          *hull = drape_arena_take(b->temporary, 2 * (size_t)count + 2, sizeof *hull);
    double area = 0, perimeter = 0, hull_area, hull_perimeter;
    if (!places || !hull)
        return false;
    for (int32_t i = 0; i < count; i++)
        for (int k = 0; k < 2; k++)
            places[i].x[k] = b->plane[2 * (size_t)(first + i) + (size_t)k];
    measure_hull(places, count, hull, &hull_area, &hull_perimeter);
    for (int32_t f = m->cloths[cloth].first_triangle; f < end_of(m, cloth, true); f++) {
        const int32_t *n = m->triangle + 3 * (size_t)f;
        const double own = 0.5 * twice_area(b->plane + 2 * (size_t)n[0], b->plane + 2 * (size_t)n[1],
                                            b->plane + 2 * (size_t)n[2]);
        if (!(own > 0))
            return false;
        area += own;
    }
    for (int32_t e = 0; e < m->edge_count; e++) {
        const int32_t *n = m->edge + 2 * (size_t)e;
        const double *p = b->plane + 2 * (size_t)n[0], *q = b->plane + 2 * (size_t)n[1];
        if (drape_model_cloth_of(m, n[0]) == cloth && b->clusters->faces_of_edge[e] != 2)
            perimeter += length_of(q[0] - p[0], q[1] - p[1]);
    }
    return fabs(area - hull_area) <= DRAPE_CLOSEST_ROUNDING * length * length &&
           fabs(perimeter - hull_perimeter) <= DRAPE_CLOSEST_ROUNDING * length;
}

/* Places a sheet in its plane, beside the sheets before it. */
static void lay_flat(builder *b, int32_t cloth, const double *rest, double *beside)
{
    const drape_model *m = b->model;
    const int32_t first = m->cloths[cloth].first_node, end = end_of(m, cloth, false);
    double axis[3][3], low[3] = {0}, high[3] = {0}, d[3]; /* of the first node */
    if (end == first || !find_axes(m, cloth, rest, axis))
        return;
    for (int32_t i = first; i < end; i++) {
        vec3_sub(rest + 3 * (size_t)i, rest + 3 * (size_t)first, d);
        for (int k = 0; k < 3; k++) {
            const double at = vec3_dot(axis[k], d);
            low[k] = fmin(low[k], at);
            high[k] = fmax(high[k], at);
            if (k < 2)
                b->plane[2 * (size_t)i + (size_t)k] = at;
        }
    }
    const double length = length_of(high[0] - low[0], high[1] - low[1]);
    b->flat[cloth] = high[2] - low[2] <= DRAPE_CLOSEST_ROUNDING * length && is_convex(b, cloth, length);
    for (int32_t i = first; i < end; i++)
        b->plane[2 * (size_t)i] += *beside - low[0];
    *beside += high[0] - low[0] + m->length;
}

/* ---- Faces at rest ---- */

static void set_group(builder *b, int32_t which, int32_t group)
{
    drape_flat *s = b->out;
    const int32_t *face = b->clusters->element[DRAPE_ELEMENT_FACE] + LANES * (size_t)group;
    for (int l = 0; l < LANES; l++) {
        const int32_t own = face[l] >= 0 ? face[l] : face[0], *n = b->model->triangle + 3 * (size_t)own;
        const double *p[3];
        for (int a = 0; a < 3; a++)
            p[a] = b->plane + 2 * (size_t)n[a];
        const double twice = twice_area(p[0], p[1], p[2]),
                     inverse[4] = {(p[2][1] - p[0][1]) / twice, (p[0][0] - p[2][0]) / twice,
                                   (p[0][1] - p[1][1]) / twice, (p[1][0] - p[0][0]) / twice};
        for (int i = 0; i < 4; i++)
            s->inverse[(4 * (size_t)group + (size_t)i) * LANES + (size_t)l] = inverse[i];
        for (int a = 0; a < 3; a++) {
            const double *q = p[(a + 1) % 3], *r = p[(a + 2) % 3];
            s->height[which] = fmin(s->height[which], twice / length_of(r[0] - q[0], r[1] - q[1]));
        }
    }
}

/* ---- Branches at rest ---- */

static const drape_flat_area nothing = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}};

static drape_flat_area cover(const drape_flat_area *a, const drape_flat_area *b)
{
    drape_flat_area both;
    for (int k = 0; k < 2; k++) {
        both.low[k] = fmin(a->low[k], b->low[k]);
        both.high[k] = fmax(a->high[k], b->high[k]);
    }
    return both;
}

static bool touch(const drape_flat_area *a, const drape_flat_area *b, double within)
{
    return a->low[0] <= b->high[0] + within && b->low[0] <= a->high[0] + within &&
           a->low[1] <= b->high[1] + within && b->low[1] <= a->high[1] + within;
}

static void set_leaf(builder *b, int32_t branch)
{
    const drape_clusters *c = b->clusters;
    const drape_cluster *cluster = &c->cluster[c->branches[branch].cluster];
    const bool flat = b->flat[cluster->cloth];
    drape_flat_area area = nothing;
    for (int32_t p = 0; flat && p < cluster->points; p++) {
        const double *at = b->plane + 2 * (size_t)c->point[cluster->first_point + p];
        area = cover(&area, &(drape_flat_area){{at[0], at[1]}, {at[0], at[1]}});
    }
    b->out->area[branch] = area;
    b->out->cloth[branch] = flat ? cluster->cloth : -1;
    b->out->leaves[branch] = 1;
}

/* ---- Pairs of branches ---- */

/* Lists the clusters that touch a rectangle, but for rounding. Returns their number; 0: they are too many. */
static int32_t list_window(const drape_flat *s, const drape_flat_area *within, int32_t *window)
{
    const drape_clusters *c = s->clusters;
    int32_t waiting[DRAPE_BVH_DEPTH], count = 0, left = 0;
    waiting[left++] = 0;
    while (left > 0) {
        const int32_t branch = waiting[--left], second = c->branches[branch].second;
        if (!touch(&s->area[branch], within, DRAPE_CLOSEST_ROUNDING * c->model->length))
            continue;
        if (second > 0) {
            waiting[left++] = second;
            waiting[left++] = branch + 1;
        } else if (count == DRAPE_FLAT_WINDOW) {
            return 0;
        } else {
            window[count++] = c->branches[branch].cluster;
        }
    }
    return count;
}

/* Lists the pairs from two branches on. As long as the lists are NULL, counts the pairs of each first branch
 * a in first_pair[a + 2], and the entries of the windows. */
static void find_pairs(builder *b, int32_t first, int32_t second)
{
    drape_flat *s = b->out;
    int32_t window[DRAPE_FLAT_WINDOW], next[4][2];
    if (!touch(&s->area[first], &s->area[second], DRAPE_CLOSEST_ROUNDING * b->model->length))
        return;
    const drape_flat_area both = cover(&s->area[first], &s->area[second]);
    const bool same = s->cloth[first] >= 0 && s->cloth[first] == s->cloth[second];
    const int32_t count = same && s->leaves[first] + s->leaves[second] <= 2 * DRAPE_FLAT_WINDOW
                              ? list_window(s, &both, window)
                              : 0;
    if (count > 0 && !s->other) {
        s->first_pair[first + 2]++;
        b->windows += 1 + count;
    } else if (count > 0) {
        const int32_t pair = s->first_pair[first + 1]++;
        s->other[pair] = second;
        s->at[pair] = b->windows;
        s->window[b->windows++] = count;
        memcpy(s->window + b->windows, window, (size_t)count * sizeof *window);
        b->windows += count;
    }
    const int descended = drape_clusters_descend(b->clusters, first, second, next);
    for (int i = 0; i < descended; i++)
        find_pairs(b, next[i][0], next[i][1]);
}

static void list_pairs(drape_arena *arena, builder *b)
{
    drape_flat *s = b->out;
    const int32_t branches = b->clusters->branch_count;
    s->first_pair = drape_arena_take(arena, (size_t)branches + 2, sizeof *s->first_pair);
    if (!s->first_pair || branches == 0)
        return;
    find_pairs(b, 0, 0);
    for (int32_t i = 0; i < branches; i++)
        s->first_pair[i + 2] += s->first_pair[i + 1];
    s->at = drape_arena_take(arena, (size_t)s->first_pair[branches + 1] + 1, sizeof *s->at);
    s->window = drape_arena_take(arena, (size_t)b->windows + 1, sizeof *s->window);
    s->other = drape_arena_take(arena, (size_t)s->first_pair[branches + 1] + 1, sizeof *s->other);
    b->windows = 0;
    if (s->at && s->window && s->other)
        find_pairs(b, 0, 0);
}

drape_status drape_flat_create(drape_arena *arena, const drape_clusters *clusters, const double *rest,
                               drape_flat *out)
{
    const drape_model *m = clusters->model;
    const size_t count = (size_t)clusters->count, groups = (size_t)clusters->groups[DRAPE_ELEMENT_FACE];
    drape_arena temporary = drape_arena_of(arena->ctx);
    builder b = {.clusters = clusters, .model = m, .temporary = &temporary, .out = out};
    double beside = 0;
    *out = (drape_flat){.clusters = clusters};
    b.plane = drape_arena_take(&temporary, (size_t)m->node_count, 2 * sizeof *b.plane);
    b.flat = drape_arena_take(&temporary, (size_t)m->cloth_count, sizeof *b.flat);
    out->inverse = drape_arena_take(arena, groups, 4 * LANES * sizeof *out->inverse);
    out->height = drape_arena_take(arena, count, sizeof *out->height);
    out->area = drape_arena_take(arena, (size_t)clusters->branch_count, sizeof *out->area);
    out->cloth = drape_arena_take(arena, (size_t)clusters->branch_count, sizeof *out->cloth);
    out->leaves = drape_arena_take(arena, (size_t)clusters->branch_count, sizeof *out->leaves);
    out->gradients = drape_arena_take(arena, groups, sizeof *out->gradients);
    out->sum = drape_arena_take(arena, count, sizeof *out->sum);
    out->fitted = drape_arena_take(arena, count, sizeof *out->fitted);
    const bool complete = !drape_arena_status(arena) && !drape_arena_status(&temporary);
    for (int32_t i = 0; complete && i < m->cloth_count; i++)
        lay_flat(&b, i, rest, &beside);
    if (complete) {
        for (int32_t i = 0; i < clusters->count; i++) {
            const drape_cluster *cluster = &clusters->cluster[i];
            out->height[i] = INFINITY;
            for (int32_t g = 0; b.flat[cluster->cloth] && g < cluster->groups[DRAPE_ELEMENT_FACE]; g++)
                set_group(&b, i, cluster->first_group[DRAPE_ELEMENT_FACE] + g);
        }
        for (int32_t i = clusters->branch_count - 1; i >= 0; i--) {
            const int32_t first = i + 1, second = clusters->branches[i].second;
            if (second == 0) {
                set_leaf(&b, i);
                continue;
            }
            out->area[i] = cover(&out->area[first], &out->area[second]);
            out->cloth[i] = out->cloth[first] == out->cloth[second] ? out->cloth[first] : -1;
            out->leaves[i] = out->leaves[first] + out->leaves[second];
        }
        list_pairs(arena, &b);
    }
    const drape_status status = drape_arena_status(&temporary);
    drape_arena_free(&temporary);
    return status ? status : drape_arena_status(arena);
}

/* ---- Gradients ---- */

LANES_DISPATCH static void fit_cluster(drape_flat *s, int32_t which, const double *x, const double *y)
{
    const drape_cluster *cluster = &s->clusters->cluster[which];
    const double *const ends[2] = {x, y ? y : x};
    lanes sum[2][3] = {{{0}}};
    for (int32_t i = 0; i < cluster->groups[DRAPE_ELEMENT_FACE]; i++) {
        const int32_t group = cluster->first_group[DRAPE_ELEMENT_FACE] + i,
                      *face = s->clusters->element[DRAPE_ELEMENT_FACE] + LANES * (size_t)group;
        const double *inverse = s->inverse + 4 * (size_t)group * LANES;
        int32_t node[3][LANES];
        for (int l = 0; l < LANES; l++)
            for (int a = 0; a < 3; a++)
                node[a][l] =
                    s->clusters->model->triangle[3 * (size_t)(face[l] >= 0 ? face[l] : face[0]) + (size_t)a];
        for (int end = 0; end < 2; end++) {
            lanes at[3][3] = {{{0}}};
            for (int a = 0; a < 3; a++)
                lanes_gather(ends[end], node[a], at[a]);
            for (int column = 0; column < 2; column++)
                for (int k = 0; k < 3; k++) {
                    const lanes f = (at[1][k] - at[0][k]) * lanes_load(inverse + column * LANES) +
                                    (at[2][k] - at[0][k]) * lanes_load(inverse + (2 + column) * LANES);
                    lanes_store(s->gradients[group].of[end][column][k], f);
                    sum[column][k] += f;
                }
        }
    }
    for (int column = 0; column < 2; column++)
        for (int k = 0; k < 3; k++)
            s->sum[which][column][k] =
                sum[column][k][0] + sum[column][k][1] + sum[column][k][2] + sum[column][k][3];
}

/* Whether the symmetric part of A^T F has no eigenvalue below c on some groups of faces. */
LANES_DISPATCH static bool is_stretched(const drape_gradients *gradients, int32_t groups, double frame[2][3],
                                        double c)
{
    for (int32_t g = 0; g < groups; g++)
        for (int end = 0; end < 2; end++) {
            lanes product[2][2];
            for (int i = 0; i < 2; i++)
                for (int j = 0; j < 2; j++)
                    product[i][j] = frame[i][0] * lanes_load(gradients[g].of[end][j][0]) +
                                    frame[i][1] * lanes_load(gradients[g].of[end][j][1]) +
                                    frame[i][2] * lanes_load(gradients[g].of[end][j][2]);
            const lanes mean = 0.5 * (product[0][0] + product[1][1]) - c,
                        shear = 0.5 * (product[0][1] + product[1][0]),
                        unlike = 0.5 * (product[0][0] - product[1][1]);
            const lanes_mask holds = (mean >= 0) & (mean * mean >= shear * shear + unlike * unlike);
            if (!(holds[0] & holds[1] & holds[2] & holds[3]))
                return false;
        }
    return true;
}

/* ---- Apart ---- */

static int32_t find_pair(const drape_flat *s, int32_t a, int32_t b)
{
    for (int32_t i = s->first_pair[a]; i < s->first_pair[a + 1]; i++)
        if (s->other[i] == b)
            return i;
    return -1;
}

bool drape_flat_keeps_apart(drape_flat *s, int32_t a, int32_t b, const drape_flat_query *want)
{
    const int32_t pair = find_pair(s, a, b);
    double sum[2][3] = {{0}}, frame[2][3], height = INFINITY;
    if (pair < 0)
        return false;
    const int32_t count = s->window[s->at[pair]], *window = s->window + s->at[pair] + 1;
    for (int32_t i = 0; i < count; i++) {
        const int32_t which = window[i];
        if (s->fitted[which] != want->search)
            fit_cluster(s, which, want->x, want->y);
        s->fitted[which] = want->search;
        height = fmin(height, s->height[which]);
        for (int column = 0; column < 2; column++)
            vec3_add_scaled(1, s->sum[which][column], sum[column]);
    }
    /* The bound c for pieces that are at least `height` apart at rest. If they must keep half of their
     * distance at rest, c must be at least one half, so that it holds for pieces that are farther apart,
     * too. */
    const double half = 0.5 * height + want->slack;
    const double wanted = (fmin(want->reach, half) + want->rounding) / height;
    const double share = half < want->reach ? fmax(wanted, 0.5) : wanted;
    /* A has orthonormal columns near those of the sum of the gradients. */
    double plus[3], minus[3];
    const double first = vec3_norm(sum[0]), second = vec3_norm(sum[1]);
    for (int k = 0; k < 3; k++) {
        plus[k] = sum[0][k] / first + sum[1][k] / second;
        minus[k] = sum[0][k] / first - sum[1][k] / second;
    }
    const double p = sqrt(2) * vec3_norm(plus), m = sqrt(2) * vec3_norm(minus);
    for (int k = 0; k < 3; k++) {
        frame[0][k] = plus[k] / p + minus[k] / m;
        frame[1][k] = plus[k] / p - minus[k] / m;
    }
    bool apart = first > 0 && second > 0 && p > 0 && m > 0;
    for (int32_t i = 0; apart && i < count; i++) {
        const drape_cluster *cluster = &s->clusters->cluster[window[i]];
        apart = is_stretched(s->gradients + cluster->first_group[DRAPE_ELEMENT_FACE],
                             cluster->groups[DRAPE_ELEMENT_FACE], frame, share);
    }
    return apart;
}
