/*
 * verlet_limit.c: the limit of strains of CS184 and Provot (1995). The springs are visited one after the
 * other; a spring that is too long is shortened to its limit, by half at each end, or entirely at the free
 * end if the other is pinned. A pass also moves springs that it has already shortened, so one pass does not
 * reach the limit; CS184 makes only one. Passes are repeated until no spring is longer than the slack
 * allows, or their maximum number is reached.
 *
 * All springs take part, of any stiffness, in the order in which CS184 creates them: by their later node.
 *
 * Most springs are not too long. They are checked in patches: consecutive nodes whose springs lead to the
 * same differences of node numbers, as in the interior of a grid, so that the springs of one difference are
 * a loop over arrays without indices. A node none of whose springs is too long needs no further work,
 * unless a node of one of its springs moves before its turn in the sequence of springs. The springs of
 * other nodes, and those in no patch, are visited one after the other.
 */
#include "base/lanes.h"
#include "base/vec3.h"
#include "integrators/planes.h"
#include "integrators/verlet.h"

#include <math.h>
#include <string.h>

#define MAX_PATCH_NODES 16    /* few enough that most patches have no spring that is too long */
#define MIN_PATCH_NODES 4     /* smaller patches are not worth it */
#define MAX_STEPS       8     /* springs of a node */
#define SLACK           1.001 /* passes end where no length is more than this times the longest */

/* Springs first ... first + steps x nodes - 1, as many for each node: spring s of node `from` + i joins it
 * with from + i - back[s]. steps 0: any springs, `nodes` of them. */
struct drape_verlet_patch {
    int32_t first, nodes, steps, from;
    int32_t back[MAX_STEPS];
    int32_t reach; /* springs of a node may share a node with those of one up to this many nodes later */
};

static bool is_spring(const drape_term *term)
{
    return term->ops->measure && term->elements.nodes == 2;
}

static int32_t later(const int32_t *node)
{
    return node[0] > node[1] ? node[0] : node[1];
}

/* ---- Patches ---- */

static int32_t step_of(const drape_verlet_limit *l, int32_t spring)
{
    const int32_t *node = l->node + 2 * (size_t)spring;
    return node[0] > node[1] ? node[0] - node[1] : node[1] - node[0];
}

/* The number of springs of the node whose first spring is `first`. */
static int32_t count_steps(const drape_verlet_limit *l, int32_t first)
{
    int32_t end = first, node = later(l->node + 2 * (size_t)first);
    while (end < l->count && later(l->node + 2 * (size_t)end) == node)
        end++;
    return end - first;
}

static bool has_same_steps(const drape_verlet_limit *l, const drape_verlet_patch *p, int32_t first)
{
    if (first >= l->count || later(l->node + 2 * (size_t)first) != p->from + p->nodes ||
        count_steps(l, first) != p->steps)
        return false;
    for (int32_t s = 0; s < p->steps; s++)
        if (step_of(l, first + s) != p->back[s])
            return false;
    return true;
}

static drape_verlet_patch patch_at(const drape_verlet_limit *l, int32_t first)
{
    drape_verlet_patch p = {.first = first, .steps = count_steps(l, first), .nodes = 1};
    p.from = later(l->node + 2 * (size_t)first);
    if (p.steps > MAX_STEPS)
        return (drape_verlet_patch){.first = first, .nodes = p.steps};
    for (int32_t s = 0; s < p.steps; s++)
        p.back[s] = step_of(l, first + s);
    while (p.nodes < MAX_PATCH_NODES && has_same_steps(l, &p, first + p.steps * p.nodes))
        p.nodes++;
    if (p.nodes < MIN_PATCH_NODES)
        return (drape_verlet_patch){.first = first, .nodes = p.steps * p.nodes};
    /* The springs of node i of a patch have the nodes i and i - back[s]: to share one with those of an
     * earlier node j, i - j has to be a step or the difference of two. */
    for (int32_t s = 0; s < p.steps; s++)
        for (int32_t t = -1; t < p.steps; t++) {
            int32_t apart = p.back[s] - (t < 0 ? 0 : p.back[t]);
            if (apart < MAX_PATCH_NODES && apart > p.reach)
                p.reach = apart;
        }
    return p;
}

/* Returns the number of patches; writes them if out is not NULL. Adjacent ones without steps are one
 * patch. */
static int32_t find_patches(drape_verlet_limit *l, drape_verlet_patch *out)
{
    int32_t count = 0;
    bool open = false;
    for (int32_t first = 0; first < l->count;) {
        const drape_verlet_patch p = patch_at(l, first);
        first += p.nodes * (p.steps > 0 ? p.steps : 1);
        if (out && p.steps > 0) {
            /* Squares of a patch are in the order of steps, not of nodes: those that are compared in one
             * loop are neighbours. */
            for (int32_t s = 0; s < p.steps; s++)
                for (int32_t i = 0; i < p.nodes; i++) {
                    double longest = l->longest[p.first + i * p.steps + s];
                    l->square[p.first + s * p.nodes + i] = longest * longest;
                }
        }
        if (open && p.steps == 0) {
            if (out)
                out[count - 1].nodes += p.nodes;
            continue;
        }
        if (out)
            out[count] = p;
        open = p.steps == 0;
        count++;
    }
    return count;
}

/* ---- Creation ---- */

drape_status drape_verlet_limit_create(drape_arena *arena, const drape_model *m, double limit, int passes,
                                       drape_verlet_limit *out)
{
    int32_t *start = drape_arena_take(arena, (size_t)m->node_count + 1, sizeof *start);
    *out = (drape_verlet_limit){.pinned = m->pinned, .node_count = m->node_count, .passes = passes};
    if (!start)
        return DRAPE_E_MEMORY;
    /* where the springs begin whose later node is each node */
    for (int32_t i = 0; i < m->term_count; i++) {
        const drape_elements *el = &m->terms[i].elements;
        for (int32_t e = 0; is_spring(&m->terms[i]) && e < el->count; e++)
            start[later(el->node + 2 * (size_t)e) + 1]++;
    }
    for (int32_t i = 0; i < m->node_count; i++)
        start[i + 1] += start[i];
    out->count = start[m->node_count];
    out->node = drape_arena_take(arena, 2 * (size_t)out->count, sizeof *out->node);
    out->longest = drape_arena_take(arena, (size_t)out->count, sizeof *out->longest);
    out->square = drape_arena_take(arena, (size_t)out->count, sizeof *out->square);
    out->x = drape_arena_take(arena, 3 * (size_t)m->node_count, sizeof *out->x);
    if (drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    for (int32_t i = 0; i < m->term_count; i++) {
        const drape_elements *el = &m->terms[i].elements;
        for (int32_t e = 0; is_spring(&m->terms[i]) && e < el->count; e++) {
            const int32_t *node = el->node + 2 * (size_t)e;
            const size_t at = (size_t)start[later(node)]++;
            double d[3];
            memcpy(out->node + 2 * at, node, 2 * sizeof *node);
            vec3_sub(m->rest + 3 * (size_t)node[1], m->rest + 3 * (size_t)node[0], d);
            out->longest[at] = (1 + limit) * vec3_norm(d);
        }
    }
    drape_arena_release(arena, start);
    out->patch_count = find_patches(out, NULL);
    out->patch = drape_arena_take(arena, (size_t)out->patch_count, sizeof *out->patch);
    if (!out->patch)
        return DRAPE_E_MEMORY;
    find_patches(out, out->patch);
    return DRAPE_OK;
}

/* ---- Passes ---- */

/* One spring after the other. worst: the largest square of length/longest so far; returns the new one. *moved
 * is set if a spring was too long. */
static double limit_each(const drape_verlet_limit *l, int32_t first, int32_t count, double worst, bool *moved)
{
    const double *x = l->x, *y = x + l->node_count, *z = y + l->node_count;
    for (int32_t i = first; i < first + count; i++) {
        const int32_t *node = l->node + 2 * (size_t)i, a = node[0], b = node[1];
        double d[3] = {x[b] - x[a], y[b] - y[a], z[b] - z[a]}, longest = l->longest[i];
        double square = vec3_dot(d, d);
        if (!(square > longest * longest))
            continue;
        worst = fmax(worst, l->pinned[a] && l->pinned[b] ? 0 : square / (longest * longest));
        *moved = true;
        const bool pinned0 = l->pinned[a], pinned1 = l->pinned[b];
        const double share0 = pinned0 ? 0 : 0.5 * (1 + pinned1), share1 = pinned1 ? 0 : 0.5 * (1 + pinned0),
                     by = 1 - longest / sqrt(square);
        for (size_t k = 0; k < 3; k++) {
            double *to = l->x + k * (size_t)l->node_count;
            to[a] += share0 * by * d[k];
            to[b] -= share1 * by * d[k];
        }
    }
    return worst;
}

/* excess: for each node, the most by which the square of the length of one of its springs exceeds its
 * limit; 0 if none does. Returns whether some excess is positive. */
LANES_DISPATCH static bool find_excess(const drape_verlet_limit *l, const drape_verlet_patch *p,
                                       double excess[MAX_PATCH_NODES])
{
    const double *x = l->x + p->from, *y = x + l->node_count, *z = y + l->node_count;
    double largest = 0;
    memset(excess, 0, MAX_PATCH_NODES * sizeof *excess);
    for (int32_t s = 0; s < p->steps; s++) {
        const double *bx = x - p->back[s], *by = y - p->back[s], *bz = z - p->back[s];
        const double *square = l->square + p->first + s * p->nodes;
        for (int32_t i = 0; i < p->nodes; i++) {
            double dx = bx[i] - x[i], dy = by[i] - y[i], dz = bz[i] - z[i];
            double over = dx * dx + dy * dy + dz * dz - square[i];
            excess[i] = over > excess[i] ? over : excess[i];
        }
    }
    for (int32_t i = 0; i < MAX_PATCH_NODES; i++)
        largest = excess[i] > largest ? excess[i] : largest;
    return largest > 0;
}

static double limit_patch(const drape_verlet_limit *l, const drape_verlet_patch *p, double worst)
{
    double excess[MAX_PATCH_NODES];
    int32_t unknown = 0; /* the excess of nodes before this one is outdated: a spring was shortened */
    if (!find_excess(l, p, excess))
        return worst;
    for (int32_t i = 0; i < p->nodes; i++) {
        bool moved = false;
        if (excess[i] > 0 || i < unknown)
            worst = limit_each(l, p->first + i * p->steps, p->steps, worst, &moved);
        if (moved)
            unknown = i + p->reach + 1;
    }
    return worst;
}

/* Returns the largest square of length/longest that it found. */
static double pass(const drape_verlet_limit *l)
{
    double worst = 0;
    for (int32_t k = 0; k < l->patch_count; k++) {
        const drape_verlet_patch *p = &l->patch[k];
        bool moved;
        worst = p->steps > 0 ? limit_patch(l, p, worst) : limit_each(l, p->first, p->nodes, worst, &moved);
    }
    return worst;
}

void drape_verlet_limit_lengths(const drape_verlet_limit *l, double *x)
{
    planes_from((size_t)l->node_count, x, l->x);
    for (int k = 0; k < l->passes && pass(l) > SLACK * SLACK; k++)
        if (l->cancel && atomic_load(l->cancel))
            break;
    planes_to((size_t)l->node_count, l->x, x);
}
