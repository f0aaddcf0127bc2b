/*
 * test_self_search.c: the search of cloth with cloth, against a look at all pairs. On random paths of a
 * sheet, from hardly bent to crumpled, every pair that comes nearer than it asks for is found, whatever the
 * certificates of flat parts leave out; and where a sheet is nearly flat, they leave out nearly all.
 */
#include "contact/self_search.h"
#include "geometry/closest.h"
#include "support/scene.h"
#include "support/suite.h"

#include <math.h>
#include <string.h>

#define SAMPLES 16 /* points of a path at which a distance is computed: it is at least the smallest one */

/* Numbers in (-1, 1) that are the same on every machine. */
static double next_number(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(int64_t)(*seed >> 11) / (double)(1ll << 52) - 1;
}

/* Which pairs were found. */
typedef struct found {
    const drape_model *m;
    bool *face, *edge; /* (nodes x faces), (edges x edges) */
    int32_t count;
} found;

static void find_face(void *user, int32_t node, int32_t face)
{
    found *f = user;
    f->face[node * f->m->triangle_count + face] = true;
    f->count++;
}

static void find_edge(void *user, int32_t a, int32_t b)
{
    found *f = user;
    f->edge[a * f->m->edge_count + b] = f->edge[b * f->m->edge_count + a] = true;
    f->count++;
}

static double distance_at(const int32_t node[4], bool face, const double *x, const double *y, double t)
{
    double at[4][3];
    drape_closest closest;
    for (int a = 0; a < 4; a++)
        for (size_t k = 0; k < 3; k++)
            at[a][k] = (1 - t) * x[3 * (size_t)node[a] + k] + t * y[3 * (size_t)node[a] + k];
    (face ? drape_closest_point_triangle : drape_closest_segments)(at, &closest);
    return closest.distance;
}

/* Whether the pair comes so near that it must be found. */
static bool is_wanted(const drape_self_query *want, const drape_model *m, const int32_t node[4], bool face)
{
    const double rest = distance_at(node, face, m->rest, m->rest, 0),
                 near = fmin(want->reach, rest / 2 + want->slack);
    bool wanted = false;
    for (int i = 0; i < SAMPLES && !wanted; i++)
        wanted = distance_at(node, face, want->x, want->y ? want->y : want->x, i / (SAMPLES - 1.)) < near;
    return wanted;
}

static bool share(const int32_t node[4], int split)
{
    for (int a = 0; a < split; a++)
        for (int b = split; b < 4; b++)
            if (node[a] == node[b])
                return true;
    return false;
}

/* Returns the number of pairs that must be found; all were. */
static int32_t check_all(const drape_self_query *want, const found *f)
{
    const drape_model *m = f->m;
    int32_t wanted = 0;
    for (int32_t n = 0; n < m->node_count; n++)
        for (int32_t k = 0; k < m->triangle_count; k++) {
            const int32_t *t = m->triangle + 3 * (size_t)k, node[4] = {n, t[0], t[1], t[2]};
            if (share(node, 1) || !is_wanted(want, m, node, true))
                continue;
            wanted++;
            ck_assert_msg(f->face[n * m->triangle_count + k], "node %d and face %d were not found", n, k);
        }
    for (int32_t a = 0; a < m->edge_count; a++)
        for (int32_t b = a + 1; b < m->edge_count; b++) {
            const int32_t *e = m->edge + 2 * (size_t)a, *g = m->edge + 2 * (size_t)b,
                          node[4] = {e[0], e[1], g[0], g[1]};
            if (share(node, 2) || !is_wanted(want, m, node, false))
                continue;
            wanted++;
            ck_assert_msg(f->edge[a * m->edge_count + b], "edges %d and %d were not found", a, b);
        }
    return wanted;
}

/* Positions of a sheet bent by waves of this height [m], with noise. */
static void bend(const drape_model *m, uint64_t *seed, double height, double noise, double *x)
{
    const double phase = 3 * next_number(seed), turn = 3 * next_number(seed), shift = next_number(seed);
    for (int32_t i = 0; i < m->node_count; i++) {
        const double *rest = m->rest + 3 * (size_t)i, u = rest[0], w = rest[2],
                     up = height * sin(40 * u + 25 * w + phase);
        double *to = x + 3 * (size_t)i;
        to[0] = shift + u * cos(turn) - up * sin(turn) + noise * next_number(seed);
        to[1] = u * sin(turn) + up * cos(turn) + noise * next_number(seed);
        to[2] = w + noise * next_number(seed);
    }
}

static const struct {
    double height, noise; /* [m] */
} shapes[] = {{0, 1e-4}, {0.004, 5e-4}, {0.02, 1e-3}, {0.06, 2e-3}, {0.02, 0.01}};

/* flat: of a flat sheet hardly a pair is looked at. */
static void search_all(const char *mesh, bool flat)
{
    scoped_scene s = scene_model(
        "{'drape': 1, 'cloth': [{'mesh': {%s}, 'terms': ['stretch.edge'], 'material': "
        "{'young_modulus': 1e6, 'poisson_ratio': 0.3, 'thickness': 1e-3, 'areal_density': 0.2}}], "
        "'self_contact': {'thickness': 0.004}, 'duration': 1}",
        mesh);
    const drape_model *m = s.model;
    drape_arena arena = drape_arena_of(s.ctx);
    drape_self_search search;
    uint64_t seed = 5;
    int32_t wanted = 0;
    ck_assert_int_eq(drape_self_search_create(&arena, m, m->rest, &search), DRAPE_OK);
    double *x = drape_arena_take(&arena, 3 * (size_t)m->node_count, sizeof *x),
           *y = drape_arena_take(&arena, 3 * (size_t)m->node_count, sizeof *y);
    found f = {.m = m};
    const size_t faces = (size_t)m->node_count * (size_t)m->triangle_count,
                 edges = (size_t)m->edge_count * (size_t)m->edge_count;
    f.face = drape_arena_take(&arena, faces, sizeof *f.face);
    f.edge = drape_arena_take(&arena, edges, sizeof *f.edge);
    for (size_t i = 0; i < 2 * sizeof shapes / sizeof *shapes; i++) {
        const size_t first = i / 2;
        const bool half = i % 2; /* neighbours may come as near as half of their distance at rest */
        bend(m, &seed, shapes[first].height, shapes[first].noise, x);
        memcpy(y, x, 3 * (size_t)m->node_count * sizeof *y);
        for (int32_t k = 0; k < 3 * m->node_count; k++)
            y[k] += (k % 3 == 0 ? 0.1 : 0) + shapes[first].noise * next_number(&seed);
        const drape_self_query want = {
            .x = x, .y = first % 2 ? NULL : y, .reach = 0.012, .slack = half ? 0.003 : INFINITY};
        memset(f.face, 0, faces * sizeof *f.face);
        memset(f.edge, 0, edges * sizeof *f.edge);
        f.count = 0;
        drape_self_search_pairs(&search, &want, find_face, find_edge, &f);
        wanted += check_all(&want, &f);
        /* Pieces without a common node are at least 14 mm apart at rest, and 0.95 times that on the path:
         * more than the 7 + 3 mm that are asked for. So clusters that touch are left out with all of
         * their pairs, of which there are more than ten to each edge; what remains is where the boxes of
         * others are near. */
        if (flat && first == 0 && half)
            ck_assert_int_lt(f.count, m->edge_count / 2);
    }
    ck_assert_int_gt(wanted, 500);
    drape_arena_free(&arena);
}

TEST(test_square)
{
    search_all("'grid': 'square', 'columns': 12, 'rows': 12, 'width': 0.22, 'height': 0.22", true);
}

TEST(test_irregular)
{
    search_all("'grid': 'irregular', 'columns': 12, 'rows': 12, 'width': 0.22, 'height': 0.22", false);
}

/* Lines between points at rest may leave the cloth, so nothing is certified. */
TEST(test_not_convex)
{
    search_all("'grid': 'annulus', 'rows': 5, 'columns': 24, 'inner_radius': 0.05, 'outer_radius': 0.15",
               false);
}
