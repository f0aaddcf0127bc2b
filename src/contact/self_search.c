/* self_search.c: see self_search.h. */
#include "contact/self_search.h"

drape_status drape_self_search_create(drape_arena *arena, const drape_model *model, const double *rest,
                                      drape_self_search *out)
{
    *out = (drape_self_search){.search = 0};
    drape_status status = drape_clusters_create(arena, model, rest, &out->clusters);
    if (!status)
        status = drape_flat_create(arena, &out->clusters, rest, &out->flat);
    const drape_clusters *c = &out->clusters;
    out->flat.clusters = c;
    for (int kind = 0; kind < DRAPE_ELEMENT_KINDS; kind++)
        out->boxes[kind] = drape_arena_take(arena, (size_t)c->groups[kind], sizeof *out->boxes[kind]);
    out->fitted = drape_arena_take(arena, (size_t)c->count, sizeof *out->fitted);
    out->low = drape_arena_take(arena, (size_t)c->branch_count, sizeof *out->low);
    out->high = drape_arena_take(arena, (size_t)c->branch_count, sizeof *out->high);
    out->marked = drape_arena_take(arena, (size_t)c->branch_count, sizeof *out->marked);
    return status ? status : drape_arena_status(arena);
}

/* ---- Boxes ---- */

/* The box of a cluster at one end. */
static void fit_leaf(const drape_clusters *c, const drape_cluster *cluster, const double *x, double low[3],
                     double high[3])
{
    const int32_t *point = c->point + cluster->first_point;
    for (int k = 0; k < 3; k++)
        low[k] = high[k] = x[3 * (size_t)point[0] + (size_t)k];
    for (int32_t i = 1; i < cluster->points; i++)
        for (int k = 0; k < 3; k++) {
            const double at = x[3 * (size_t)point[i] + (size_t)k];
            low[k] = at < low[k] ? at : low[k];
            high[k] = at > high[k] ? at : high[k];
        }
}

static bool has_marked(const drape_clusters *c, const drape_cluster *cluster, const bool *marked)
{
    bool any = !marked;
    for (int32_t i = 0; !any && i < cluster->points; i++)
        any = marked[c->point[cluster->first_point + i]];
    return any;
}

/* A box that is apart from every other one. */
static void set_nowhere(drape_path_boxes *boxes, int lane, int end)
{
    for (int k = 0; k < 3; k++) {
        boxes->low[end][k][lane] = INFINITY;
        boxes->high[end][k][lane] = -INFINITY;
    }
}

static void set_box(drape_path_boxes *boxes, int lane, int end, const int32_t *node, int nodes,
                    const double *x)
{
    for (int k = 0; k < 3; k++) {
        double low = x[3 * (size_t)node[0] + (size_t)k], high = low;
        for (int a = 1; a < nodes; a++) {
            const double at = x[3 * (size_t)node[a] + (size_t)k];
            low = at < low ? at : low;
            high = at > high ? at : high;
        }
        boxes->low[end][k][lane] = low;
        boxes->high[end][k][lane] = high;
    }
}

static void fit_elements(drape_self_search *s, int32_t which, const drape_self_query *want)
{
    const drape_clusters *c = &s->clusters;
    const drape_cluster *cluster = &c->cluster[which];
    const double *const ends[2] = {want->x, want->y};
    if (s->fitted[which] == s->search)
        return;
    s->fitted[which] = s->search;
    for (int kind = 0; kind < DRAPE_ELEMENT_KINDS; kind++)
        for (int32_t i = 0; i < LANES * cluster->groups[kind]; i++) {
            const int32_t group = cluster->first_group[kind] + i / LANES,
                          *element = &c->element[kind][LANES * (size_t)group + (size_t)(i % LANES)], *node;
            const int nodes =
                *element >= 0 ? drape_element_nodes(c->model, (drape_element_kind)kind, element, &node) : 0;
            for (int end = 0; end < 2 && ends[end]; end++) {
                if (nodes > 0)
                    set_box(&s->boxes[kind][group], i % LANES, end, node, nodes, ends[end]);
                else
                    set_nowhere(&s->boxes[kind][group], i % LANES, end);
            }
        }
}

/* ---- Pairs of elements ---- */

/* Elements of one kind of a cluster. */
typedef struct members {
    const drape_path_boxes *boxes;
    const int32_t *element;
    int32_t groups;
    const double (*low)[3], (*high)[3]; /* the box of the cluster, by end */
} members;

static members members_of(const drape_self_search *s, int32_t leaf, drape_element_kind kind)
{
    const drape_cluster *cluster = &s->clusters.cluster[s->clusters.branches[leaf].cluster];
    const size_t first = (size_t)cluster->first_group[kind];
    return (members){.boxes = s->boxes[kind] + first,
                     .element = s->clusters.element[kind] + LANES * first,
                     .groups = cluster->groups[kind],
                     .low = (const double(*)[3])s->low[leaf],
                     .high = (const double(*)[3])s->high[leaf]};
}

/* Which of four elements are separated from a whole cluster, by an axis and by more than reach. */
LANES_INLINE lanes_mask apart_from_cluster(const drape_path_boxes *boxes, const members *from, double reach,
                                           int ends)
{
    drape_path_box box;
    for (int end = 0; end < ends; end++)
        for (int k = 0; k < 3; k++) {
            box.low[end][k] = from->low[end][k] - reach - (lanes){0};
            box.high[end][k] = from->high[end][k] + reach - (lanes){0};
        }
    return drape_path_boxes_apart(boxes, &box, ends);
}

LANES_INLINE void meet_one(const members *a, int32_t i, const members *b, bool same, double reach, int ends,
                           drape_self_meet *visit, void *user)
{
    drape_path_box box;
    drape_path_box_of(&a->boxes[i / LANES], i % LANES, reach, ends, &box);
    for (int32_t g = same ? i / LANES : 0; g < b->groups; g++) {
        const lanes_mask apart = drape_path_boxes_apart(&b->boxes[g], &box, ends);
        if (apart[0] & apart[1] & apart[2] & apart[3])
            continue;
        for (int l = 0; l < LANES; l++)
            if (apart[l] == 0 && (!same || LANES * g + l > i))
                visit(user, a->element[i], b->element[LANES * g + l]);
    }
}

LANES_INLINE void meet_members(const members *a, const members *b, bool same, double reach, int ends,
                               drape_self_meet *visit, void *user)
{
    for (int32_t g = 0; g < a->groups; g++) {
        const lanes_mask apart = apart_from_cluster(&a->boxes[g], b, reach, ends);
        for (int l = 0; l < LANES; l++)
            if (apart[l] == 0)
                meet_one(a, LANES * g + l, b, same, reach, ends, visit, user);
    }
}

LANES_DISPATCH static void meet_at(const members *a, const members *b, bool same, double reach,
                                   drape_self_meet *visit, void *user)
{
    meet_members(a, b, same, reach, 1, visit, user);
}

LANES_DISPATCH static void meet_on_path(const members *a, const members *b, bool same, double reach,
                                        drape_self_meet *visit, void *user)
{
    meet_members(a, b, same, reach, 2, visit, user);
}

/* ---- Pairs of clusters ---- */

typedef struct traversal {
    drape_self_search *search;
    const drape_self_query *want;
    drape_flat_query flat;
    drape_self_meet *face, *edge;
    void *user;
} traversal;

static void meet_kinds(const traversal *t, int32_t a, drape_element_kind first, int32_t b,
                       drape_element_kind second, drape_self_meet *visit)
{
    const members of_a = members_of(t->search, a, first), of_b = members_of(t->search, b, second);
    const bool same = a == b && first == second;
    if (t->want->y)
        meet_on_path(&of_a, &of_b, same, t->want->reach, visit, t->user);
    else
        meet_at(&of_a, &of_b, same, t->want->reach, visit, t->user);
}

static bool are_apart(const traversal *t, int32_t a, int32_t b)
{
    const drape_self_search *s = t->search;
    const double reach = t->want->reach;
    const int last = t->want->y ? 1 : 0;
    bool apart = false;
    for (int k = 0; k < 3; k++) {
        const bool above = s->low[a][0][k] > s->high[b][0][k] + reach &&
                           s->low[a][last][k] > s->high[b][last][k] + reach,
                   below = s->high[a][0][k] < s->low[b][0][k] - reach &&
                           s->high[a][last][k] < s->low[b][last][k] - reach;
        apart = apart || above || below;
    }
    return apart;
}

static void meet(const traversal *t, int32_t a, int32_t b)
{
    int32_t next[4][2];
    if (!(t->search->marked[a] || t->search->marked[b]) || (a != b && are_apart(t, a, b)) ||
        drape_flat_keeps_apart(&t->search->flat, a, b, &t->flat))
        return;
    const int count = drape_clusters_descend(&t->search->clusters, a, b, next);
    if (count == 0) {
        /* Two leaves. */
        const drape_cluster_branch *branches = t->search->clusters.branches;
        fit_elements(t->search, branches[a].cluster, t->want);
        fit_elements(t->search, branches[b].cluster, t->want);
        meet_kinds(t, a, DRAPE_ELEMENT_NODE, b, DRAPE_ELEMENT_FACE, t->face);
        if (a != b)
            meet_kinds(t, b, DRAPE_ELEMENT_NODE, a, DRAPE_ELEMENT_FACE, t->face);
        meet_kinds(t, a, DRAPE_ELEMENT_EDGE, b, DRAPE_ELEMENT_EDGE, t->edge);
    }
    for (int i = 0; i < count; i++)
        meet(t, next[i][0], next[i][1]);
}

void drape_self_search_pairs(drape_self_search *s, const drape_self_query *want, drape_self_meet *face,
                             drape_self_meet *edge, void *user)
{
    if (s->clusters.count == 0)
        return;
    s->search++;
    const traversal t = {.search = s,
                         .want = want,
                         .flat = {.x = want->x,
                                  .y = want->y,
                                  .reach = want->reach,
                                  .slack = want->slack,
                                  .rounding = want->rounding,
                                  .search = s->search},
                         .face = face,
                         .edge = edge,
                         .user = user};
    const drape_clusters *c = &s->clusters;
    const double *const ends[2] = {want->x, want->y};
    for (int32_t i = c->branch_count - 1; i >= 0; i--) {
        const int32_t a = i + 1, b = c->branches[i].second;
        const drape_cluster *cluster = &c->cluster[c->branches[i].cluster];
        s->marked[i] = b > 0 ? s->marked[a] || s->marked[b] : has_marked(c, cluster, want->marked);
        for (int end = 0; end < 2 && ends[end]; end++) {
            double *low = s->low[i][end], *high = s->high[i][end];
            if (b == 0)
                fit_leaf(c, cluster, ends[end], low, high);
            for (int k = 0; b > 0 && k < 3; k++) {
                low[k] = s->low[a][end][k] < s->low[b][end][k] ? s->low[a][end][k] : s->low[b][end][k];
                high[k] = s->high[a][end][k] > s->high[b][end][k] ? s->high[a][end][k] : s->high[b][end][k];
            }
        }
    }
    meet(&t, 0, 0);
}
