/* path_bvh.c: see path_bvh.h. */
#include "geometry/path_bvh.h"

#include <math.h>
#include <string.h>

/* ---- Building ---- */

/* The children of a branch of the binary tree, each replaced by its own two unless it is a leaf. */
static int children_of(const drape_bvh *from, int32_t branch, int32_t child[LANES])
{
    int count = 0;
    const int32_t two[2] = {branch + 1, from->branches[branch].second};
    for (int i = 0; i < 2; i++) {
        const int32_t second = from->branches[two[i]].second;
        child[count++] = second > 0 ? two[i] + 1 : two[i];
        if (second > 0)
            child[count++] = second;
    }
    return count;
}

static int32_t count_branches(const drape_bvh *from, int32_t branch)
{
    int32_t child[LANES], count = 1;
    if (from->branches[branch].second == 0)
        return 1;
    for (int i = children_of(from, branch, child); i-- > 0;)
        if (from->branches[child[i]].second > 0)
            count += count_branches(from, child[i]);
    return count;
}

/* Stored in depth-first order: children come after their parent. */
static void merge(drape_path_bvh *bvh, const drape_bvh *from, int32_t branch)
{
    drape_path_branch *self = &bvh->branches[bvh->branch_count++];
    int32_t child[LANES] = {branch};
    const bool single = from->branches[branch].second == 0; /* a tree of one element */
    self->count = single ? 1 : children_of(from, branch, child);
    for (int i = 0; i < self->count; i++) {
        const bool leaf = from->branches[child[i]].second == 0;
        self->child[i] = leaf ? -1 - from->order[from->branches[child[i]].first] : bvh->branch_count;
        if (!leaf)
            merge(bvh, from, child[i]);
    }
}

drape_status drape_path_bvh_build(drape_arena *arena, int32_t count, int nodes, const int32_t *node,
                                  const double *x, drape_path_bvh *bvh)
{
    drape_arena temporary = drape_arena_of(arena->ctx);
    drape_bvh binary;
    *bvh = (drape_path_bvh){.count = count, .nodes = nodes, .node = node};
    if (count == 0)
        return DRAPE_OK;
    drape_status status = drape_bvh_build(&temporary, count, nodes, node, x, &binary);
    const size_t branches = status ? 0 : (size_t)count_branches(&binary, 0);
    bvh->branches = status ? NULL : drape_arena_take(arena, branches, sizeof *bvh->branches);
    bvh->place = status ? NULL : drape_arena_take(arena, (size_t)count, sizeof *bvh->place);
    bvh->order = status ? NULL : drape_arena_take(arena, (size_t)count, sizeof *bvh->order);
    const bool complete = bvh->branches && bvh->place && bvh->order;
    if (complete) {
        merge(bvh, &binary, 0);
        memcpy(bvh->order, binary.order, (size_t)count * sizeof *bvh->order);
    }
    for (int32_t e = 0; complete && e < count; e++)
        bvh->place[binary.order[e]] = e;
    drape_arena_free(&temporary);
    return complete ? DRAPE_OK : DRAPE_E_MEMORY;
}

/* ---- Refitting ---- */

/* Inline, since a query that finds nothing spends most of its time here. */
static inline drape_box box_of(const int32_t *node, int nodes, const double *x)
{
    drape_box box;
    for (int k = 0; k < 3; k++)
        box.low[k] = box.high[k] = x[3 * (size_t)node[0] + (size_t)k];
    for (int a = 1; a < nodes; a++)
        for (int k = 0; k < 3; k++) {
            const double at = x[3 * (size_t)node[a] + (size_t)k];
            box.low[k] = at < box.low[k] ? at : box.low[k];
            box.high[k] = at > box.high[k] ? at : box.high[k];
        }
    return box;
}

/* The box of a child at one end. */
static drape_box child_box(const drape_path_bvh *bvh, int32_t child, int end, const double *x,
                           const double *grow)
{
    if (child < 0) {
        const int32_t element = -1 - child;
        const int32_t *node = bvh->node + (size_t)element * (size_t)bvh->nodes;
        drape_box box = bvh->nodes == 2   ? box_of(node, 2, x) /* with loops of a known length */
                        : bvh->nodes == 3 ? box_of(node, 3, x)
                                          : box_of(node, bvh->nodes, x);
        for (int k = 0; grow && k < 3; k++) {
            box.low[k] -= grow[element];
            box.high[k] += grow[element];
        }
        return box;
    }
    const drape_path_branch *from = &bvh->branches[child];
    drape_box box;
    for (int k = 0; k < 3; k++) {
        box.low[k] = from->boxes.low[end][k][0];
        box.high[k] = from->boxes.high[end][k][0];
        for (int32_t l = 1; l < from->count; l++) {
            box.low[k] = from->boxes.low[end][k][l] < box.low[k] ? from->boxes.low[end][k][l] : box.low[k];
            box.high[k] =
                from->boxes.high[end][k][l] > box.high[k] ? from->boxes.high[end][k][l] : box.high[k];
        }
    }
    return box;
}

static bool is_marked(const drape_path_bvh *bvh, int32_t child, const bool *marked)
{
    const int32_t *node = bvh->node + (size_t)(child < 0 ? -1 - child : 0) * (size_t)bvh->nodes;
    bool any = !marked;
    if (child >= 0)
        for (int32_t l = 0; l < bvh->branches[child].count; l++)
            any = any || bvh->branches[child].marked[l];
    for (int a = 0; child < 0 && !any && a < bvh->nodes; a++)
        any = marked[node[a]];
    return any;
}

/* Children are stored after their parent: going backwards refits them first. */
void drape_path_bvh_fit(drape_path_bvh *bvh, const double *x, const double *y, const bool *marked,
                        const double *grow)
{
    const double *const ends[2] = {x, y};
    for (int32_t i = bvh->branch_count - 1; i >= 0; i--) {
        drape_path_branch *branch = &bvh->branches[i];
        for (int32_t l = 0; l < branch->count; l++)
            branch->marked[l] = is_marked(bvh, branch->child[l], marked);
        for (int end = 0; end < 2 && ends[end]; end++)
            for (int32_t l = 0; l < branch->count; l++) {
                const drape_box box = child_box(bvh, branch->child[l], end, ends[end], grow);
                for (int k = 0; k < 3; k++) {
                    branch->boxes.low[end][k][l] = box.low[k];
                    branch->boxes.high[end][k][l] = box.high[k];
                }
            }
    }
}

/* ---- Queries ---- */

typedef struct query {
    drape_path_box box;
    int32_t marked; /* the least value of marked */
} query;

LANES_INLINE void traverse(const drape_path_bvh *bvh, const query *q, int ends, drape_bvh_visit *visit,
                           void *user)
{
    int32_t waiting[LANES * DRAPE_BVH_DEPTH];
    int count = 0;
    if (bvh->branch_count > 0)
        waiting[count++] = 0;
    while (count > 0) {
        const int32_t self = waiting[--count];
        if (self < 0) {
            visit(user, -1 - self);
            continue;
        }
        const drape_path_branch *branch = &bvh->branches[self];
        const lanes_mask apart = drape_path_boxes_apart(&branch->boxes, &q->box, ends);
        for (int l = LANES - 1; l >= 0; l--) { /* writes always, without a branch to mispredict */
            waiting[count] = branch->child[l];
            count += (apart[l] == 0) & (l < branch->count) & (branch->marked[l] >= q->marked);
        }
    }
}

LANES_DISPATCH static void traverse_points(const drape_path_bvh *bvh, const query *q, drape_bvh_visit *visit,
                                           void *user)
{
    traverse(bvh, q, 1, visit, user);
}

LANES_DISPATCH static void traverse_paths(const drape_path_bvh *bvh, const query *q, drape_bvh_visit *visit,
                                          void *user)
{
    traverse(bvh, q, 2, visit, user);
}

void drape_path_bvh_query(const drape_path_bvh *bvh, const drape_path_query *from, drape_bvh_visit *visit,
                          void *user)
{
    const double *const ends[2] = {from->x, from->y};
    query q = {.marked = from->only_marked};
    for (int end = 0; end < 2 && ends[end]; end++) {
        const drape_box box = box_of(from->node, from->nodes, ends[end]);
        for (int k = 0; k < 3; k++) {
            q.box.low[end][k] = box.low[k] - from->reach - (lanes){0};
            q.box.high[end][k] = box.high[k] + from->reach - (lanes){0};
        }
    }
    if (from->y)
        traverse_paths(bvh, &q, visit, user);
    else
        traverse_points(bvh, &q, visit, user);
}

/* ---- Without a tree ---- */

/* An axis separates an element if all of its points are on the same side. */
void drape_path_bvh_scan(const drape_path_bvh *bvh, const drape_path_query *from,
                         const drape_path_elements *among, const bool *marked, uint8_t *side,
                         drape_bvh_visit *visit, void *user)
{
    /* On which sides of the query a point is at both ends: bit 2 k is above along axis k, 2 k + 1 below. */
    const double *const x = from->x, *const y = from->y ? from->y : from->x;
    const drape_box first = box_of(from->node, from->nodes, x), last = box_of(from->node, from->nodes, y);
    for (int32_t p = 0; p < among->points; p++) {
        const size_t i = (size_t)among->point[p];
        unsigned int sides = 0;
        for (size_t k = 0; k < 3; k++) {
            const unsigned int above = (unsigned int)(x[3 * i + k] > first.high[k] + from->reach) &
                                       (unsigned int)(y[3 * i + k] > last.high[k] + from->reach),
                               below = (unsigned int)(x[3 * i + k] < first.low[k] - from->reach) &
                                       (unsigned int)(y[3 * i + k] < last.low[k] - from->reach);
            sides |= (above | below << 1) << 2 * k;
        }
        side[i] = (uint8_t)sides;
    }
    for (int32_t i = 0; i < among->elements; i++) {
        const int32_t e = among->element[i], *node = bvh->node + (size_t)e * (size_t)bvh->nodes;
        unsigned int common = side[node[0]];
        for (int a = 1; a < bvh->nodes; a++)
            common &= side[node[a]];
        if (common == 0 && (!from->only_marked || is_marked(bvh, -1 - e, marked)))
            visit(user, e);
    }
}

/* ---- Two trees ---- */

/* A test that is to be made: of one child, or of all children, of a branch of one tree, against all children
 * of a branch of the other tree. */
typedef struct meeting {
    int32_t branch[2];
    int32_t lane; /* of the child; -1: all */
    int32_t from; /* the tree of the child */
} meeting;

/* Each test leads to at most LANES^2 others, one level deeper in one tree. */
#define MEETINGS (LANES * LANES * DRAPE_BVH_DEPTH)

/* Tests one child, or all, of a branch against all children of the other branch. A branch that meets
 * itself has each pair of its children once. */
LANES_INLINE int32_t meet(const drape_path_bvh *const tree[2], const meeting *at, double reach, int ends,
                          bool itself, meeting *next, drape_path_bvh_meet *visit, void *user)
{
    const int own = at->from, other = !own;
    const drape_path_branch *from = &tree[own]->branches[at->branch[own]],
                            *to = &tree[other]->branches[at->branch[other]];
    const int32_t first = at->lane < 0 ? 0 : at->lane, last = at->lane < 0 ? from->count - 1 : at->lane;
    int32_t count = 0;
    for (int32_t i = first; i <= last; i++) {
        drape_path_box box;
        drape_path_box_of(&from->boxes, i, reach, ends, &box);
        const lanes_mask apart = drape_path_boxes_apart(&to->boxes, &box, ends);
        if (apart[0] & apart[1] & apart[2] & apart[3])
            continue;
        for (int32_t l = itself ? i : 0; l < to->count; l++) {
            const int32_t child[2] = {from->child[i], to->child[l]};
            if (apart[l] != 0 || !(from->marked[i] | to->marked[l]))
                continue;
            if (child[0] < 0 && child[1] < 0) {
                if (!itself || i != l)
                    visit(user, -1 - child[own], -1 - child[other]);
                continue;
            }
            meeting *into = &next[count++];
            *into = (meeting){.lane = -1};
            into->branch[own] = child[0] < 0 ? at->branch[own] : child[0];
            into->branch[other] = child[1] < 0 ? at->branch[other] : child[1];
            if (child[0] < 0 || child[1] < 0) {
                into->lane = child[0] < 0 ? i : l;
                into->from = child[0] < 0 ? own : other;
            }
        }
    }
    return count;
}

LANES_INLINE void join(const drape_path_bvh *const tree[2], double reach, int ends,
                       drape_path_bvh_meet *visit, void *user)
{
    meeting waiting[MEETINGS];
    int32_t count = 0;
    if (tree[0]->branch_count > 0 && tree[1]->branch_count > 0)
        waiting[count++] = (meeting){.lane = -1};
    while (count > 0) {
        const meeting at = waiting[--count];
        const bool itself = tree[0] == tree[1] && at.lane < 0 && at.branch[0] == at.branch[1];
        count += meet(tree, &at, reach, ends, itself, waiting + count, visit, user);
    }
}

LANES_DISPATCH static void join_points(const drape_path_bvh *const tree[2], double reach,
                                       drape_path_bvh_meet *visit, void *user)
{
    join(tree, reach, 1, visit, user);
}

LANES_DISPATCH static void join_paths(const drape_path_bvh *const tree[2], double reach,
                                      drape_path_bvh_meet *visit, void *user)
{
    join(tree, reach, 2, visit, user);
}

void drape_path_bvh_join(const drape_path_bvh *a, const drape_path_bvh *b, bool moves, double reach,
                         drape_path_bvh_meet *visit, void *user)
{
    const drape_path_bvh *const tree[2] = {a, b};
    if (moves)
        join_paths(tree, reach, visit, user);
    else
        join_points(tree, reach, visit, user);
}
