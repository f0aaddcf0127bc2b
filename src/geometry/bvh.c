/* bvh.c: see bvh.h. */
#include "geometry/bvh.h"

#include <math.h>
#include <string.h>

#define LEAF 1 /* elements per leaf */

/* ---- Building ---- */

typedef struct entry {
    double middle[3]; /* the sum of the positions of the element's nodes */
    int32_t element;
} entry;

typedef struct builder {
    drape_bvh *bvh;
    entry *entries;
} builder;

static bool is_before(const entry *a, const entry *b, int axis)
{
    if (a->middle[axis] != b->middle[axis])
        return a->middle[axis] < b->middle[axis];
    return a->element < b->element;
}

static void swap(entry *a, entry *b)
{
    const entry kept = *a;
    *a = *b;
    *b = kept;
}

/* Brings the first `half` entries along the axis to the front, in any order (Hoare 1961, Algorithm 65: Find).
 * As no two entries are equal, which these are does not depend on how they are found. The pivot is the median
 * of three, so entries that are in order already take linear time. */
static void bring_first_half(entry *entries, int32_t count, int32_t half, int axis)
{
    int32_t low = 0, high = count - 1;
    while (low < high) {
        entry *a = entries + low, *b = entries + low + (high - low) / 2, *c = entries + high;
        if (is_before(b, a, axis))
            swap(a, b);
        if (is_before(c, b, axis)) {
            swap(b, c);
            if (is_before(b, a, axis))
                swap(a, b);
        }
        const entry pivot = *b;
        int32_t i = low, j = high;
        while (i <= j) {
            while (is_before(&entries[i], &pivot, axis))
                i++;
            while (is_before(&pivot, &entries[j], axis))
                j--;
            if (i <= j)
                swap(&entries[i++], &entries[j--]);
        }
        if (half <= j)
            high = j;
        else if (half >= i)
            low = i;
        else
            return;
    }
}

static int longest_axis(const entry *entries, int32_t count)
{
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    int axis = 0;
    for (int32_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            const double at = entries[i].middle[k];
            low[k] = at < low[k] ? at : low[k];
            high[k] = at > high[k] ? at : high[k];
        }
    for (int k = 1; k < 3; k++)
        if (high[k] - low[k] > high[axis] - low[axis])
            axis = k;
    return axis;
}

/* Branches are stored in depth-first order: the first child of branch i is i + 1. */
static void split(builder *b, int32_t first, int32_t count)
{
    int32_t self = b->bvh->branch_count++;
    drape_bvh_branch *branch = &b->bvh->branches[self];
    branch->first = first;
    branch->count = count;
    if (count <= LEAF)
        return;
    entry *entries = b->entries + first;
    bring_first_half(entries, count, count / 2, longest_axis(entries, count));
    split(b, first, count / 2);
    branch->second = b->bvh->branch_count;
    split(b, first + count / 2, count - count / 2);
}

drape_status drape_bvh_build(drape_arena *arena, int32_t count, int nodes, const int32_t *node,
                             const double *x, drape_bvh *bvh)
{
    *bvh = (drape_bvh){.count = count, .nodes = nodes, .node = node};
    if (count == 0)
        return DRAPE_OK;
    bvh->order = drape_arena_take(arena, (size_t)count, sizeof *bvh->order);
    bvh->branches = drape_arena_take(arena, 2 * (size_t)count, sizeof *bvh->branches);
    builder b = {.bvh = bvh, .entries = drape_alloc(arena->ctx, (size_t)count, sizeof *b.entries)};
    if (!b.entries || !bvh->order || !bvh->branches) {
        drape_free(arena->ctx, b.entries);
        return DRAPE_E_MEMORY;
    }
    for (int32_t e = 0; e < count; e++) {
        b.entries[e].element = e;
        for (int a = 0; a < nodes; a++)
            for (int k = 0; k < 3; k++)
                b.entries[e].middle[k] +=
                    x[3 * (size_t)node[(size_t)e * (size_t)nodes + (size_t)a] + (size_t)k];
    }
    split(&b, 0, count);
    for (int32_t e = 0; e < count; e++)
        bvh->order[e] = b.entries[e].element;
    drape_free(arena->ctx, b.entries);
    return DRAPE_OK;
}

/* ---- Refitting ---- */

static void include(drape_box *box, const double *x)
{
    for (int k = 0; k < 3; k++) {
        box->low[k] = x[k] < box->low[k] ? x[k] : box->low[k];
        box->high[k] = x[k] > box->high[k] ? x[k] : box->high[k];
    }
}

static void cover(drape_box *box, const int32_t *node, int nodes, const double *x)
{
    for (int a = 0; a < nodes; a++)
        include(box, x + 3 * (size_t)node[a]);
}

static const drape_box empty_box = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};

drape_box drape_box_of(const int32_t *node, int nodes, const double *x, double reach)
{
    drape_box box = empty_box;
    cover(&box, node, nodes, x);
    for (int k = 0; k < 3; k++) {
        box.low[k] -= reach;
        box.high[k] += reach;
    }
    return box;
}

/* Children are stored after their parent: going backwards refits them first. */
void drape_bvh_fit(drape_bvh *bvh, const double *x)
{
    for (int32_t i = bvh->branch_count - 1; i >= 0; i--) {
        drape_bvh_branch *branch = &bvh->branches[i];
        branch->box = empty_box;
        if (branch->second > 0) {
            const drape_box *children[] = {&bvh->branches[i + 1].box, &bvh->branches[branch->second].box};
            for (int c = 0; c < 2; c++) {
                include(&branch->box, children[c]->low);
                include(&branch->box, children[c]->high);
            }
            continue;
        }
        for (int32_t e = branch->first; e < branch->first + branch->count; e++)
            cover(&branch->box, bvh->node + (size_t)bvh->order[e] * (size_t)bvh->nodes, bvh->nodes, x);
    }
}

/* ---- Queries ---- */

static bool meet(const drape_box *a, const drape_box *b)
{
    return a->low[0] <= b->high[0] && b->low[0] <= a->high[0] && a->low[1] <= b->high[1] &&
           b->low[1] <= a->high[1] && a->low[2] <= b->high[2] && b->low[2] <= a->high[2];
}

void drape_bvh_query(const drape_bvh *bvh, const drape_box *box, drape_bvh_visit *visit, void *user)
{
    int32_t waiting[DRAPE_BVH_DEPTH];
    int count = 0;
    if (bvh->branch_count > 0)
        waiting[count++] = 0;
    while (count > 0) {
        int32_t self = waiting[--count];
        const drape_bvh_branch *branch = &bvh->branches[self];
        if (!meet(&branch->box, box))
            continue;
        if (branch->second > 0) {
            waiting[count++] = branch->second;
            waiting[count++] = self + 1;
            continue;
        }
        for (int32_t e = branch->first; e < branch->first + branch->count; e++)
            visit(user, bvh->order[e]);
    }
}
