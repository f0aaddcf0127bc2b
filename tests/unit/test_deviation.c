/* test_deviation.c: how far two motions are apart, beside values by hand. */
#include "geometry/deviation.h"
#include "support/scene.h"

#define CLOTH                                                                                                \
    "{'name': '%s', 'mesh': {'grid': 'square', 'columns': %d, 'rows': %d, 'width': 3, 'height': 4, "         \
    "'diagonals': '%s'}, 'terms': ['stretch.cst'],"                                                          \
    " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}}"
#define SHEET "{'drape': 1, 'duration': 1, 'cloth': [" CLOTH "]}"
#define TWO   "{'drape': 1, 'duration': 1, 'cloth': [" CLOTH ", " CLOTH "]}"

static scene sheet(int columns, int rows, const char *diagonals)
{
    return scene_model(SHEET, "sheet", columns, rows, diagonals);
}

static double *copy_of_rest(const scene *s)
{
    const size_t bytes = 3 * (size_t)s->model->node_count * sizeof(double);
    double *x = malloc(bytes);
    memcpy(x, s->model->rest, bytes);
    return x;
}

/* Moves each node by what a linear field gives at rest. */
static void deform(const scene *s, double *x, const double field[3][4])
{
    for (size_t i = 0; i < 3 * (size_t)s->model->node_count; i += 3)
        for (size_t k = 0; k < 3; k++) {
            x[i + k] = field[k][3];
            for (size_t j = 0; j < 3; j++)
                x[i + k] += field[k][j] * s->model->rest[i + j];
        }
}

/* Two cloths of four nodes, 3 m x 4 m: diagonals of 5 m. All numbers are exact in binary. */
TEST(values_by_hand)
{
    scene s = scene_model(TWO, "a", 2, 2, "parallel", "b", 2, 2, "parallel");
    drape_arena arena = drape_arena_of(s.ctx);
    drape_deviation d;
    double *x = copy_of_rest(&s), *y = copy_of_rest(&s);
    ck_assert_int_eq(drape_deviation_create(&arena, s.model, s.model, &d), DRAPE_OK);
    ck_assert(d.of == 0 && !d.material);
    ck_assert_double_eq(d.cloths[0].diagonal, 5);
    drape_deviation_add(&d, 0, x, y);
    for (int c = 0; c < 2; c++)
        ck_assert(d.cloths[c].largest.rms == 0 && d.cloths[c].largest.distance == 0);
    /* all nodes of the first cloth by (0.3, 0.4, 0) x 2: rms 1; of the second, one by 1.5: rms 1.5 / sqrt(4)
     * */
    for (size_t i = 0; i < 4; i++)
        y[3 * i + 2] += 1;
    y[3 * 6] += 1.5;
    drape_deviation_add(&d, 0.25, x, y);
    ck_assert_double_eq(d.cloths[0].now.rms, 1);
    ck_assert_double_eq(d.cloths[1].now.rms, 0.75);
    ck_assert_double_eq(d.distance[6], 1.5);
    ck_assert_int_eq(drape_deviation_worst(&d), 0);
    /* the rms of the first falls to 0.75, while one of its nodes is further than before: both are kept, each
     * with its own time */
    for (size_t i = 0; i < 4; i++)
        y[3 * i + 2] = x[3 * i + 2];
    y[3 * 2 + 1] += 1.5;
    drape_deviation_add(&d, 0.5, x, y);
    const drape_apart *first = &d.cloths[0].largest, *second = &d.cloths[1].largest;
    ck_assert(first->rms == 1 && first->rms_time == 0.25 && first->rms_frame == 1);
    ck_assert(first->distance == 1.5 && first->time == 0.5 && first->node == 2);
    ck_assert_mem_eq(first->place[0], x + 3 * 2, sizeof first->place[0]);
    ck_assert_mem_eq(first->place[1], y + 3 * 2, sizeof first->place[1]);
    /* equally far later: the first time counts */
    ck_assert(second->rms == 0.75 && second->rms_time == 0.25 && second->node == 6 && second->time == 0.25);
    ck_assert_int_eq(d.frames, 3);
    /* a measure of a frame again adds nothing */
    y[0] += 100;
    drape_deviation_measure(&d, 0.75, x, y);
    ck_assert(d.cloths[0].now.distance > 99 && d.cloths[0].largest.distance == 1.5 && d.frames == 3);
    free(x);
    free(y);
    drape_arena_free(&arena);
    scene_close(&s);
}

/* Linear fields are the same at material points of any mesh: sheets of other nodes or triangles, deformed
 * alike, are 0 apart, and those that a translation of 0.5 m separates are 0.5 m apart, at each node.
 * Tolerance: a sum of three products of numbers below 16, and weights that are right to the rounding of
 * positions over an edge of 0.1 m, 1e-14, times gradients below 16 over that edge's 3 m mesh; a node is
 * looked up 1e-6 of an edge off, but compared at itself. */
TEST(material_points)
{
    static const double one[3][4] = {{1, 0.5, 0, 1}, {-0.5, 2, 1, 3}, {0.25, 0.125, 1, 0}};
    static const double other[3][4] = {{1, 0.5, 0, 1}, {-0.5, 2, 1, 3.5}, {0.25, 0.125, 1, 0}};
    static const struct {
        int columns, rows;
        const char *diagonals;
        bool fewer;
    } meshes[] = {{3, 3, "alternating", true}, {4, 6, "alternating", true},    {8, 8, "parallel", false},
                  {21, 29, "parallel", false}, {22, 31, "alternating", false}, {9, 5, "parallel", true}};
    for (int i = 0; i < 6; i++)
        for (int swap = 0; swap < 2; swap++) {
            scene s[2] = {sheet(8, 8, "alternating"),
                          sheet(meshes[i].columns, meshes[i].rows, meshes[i].diagonals)};
            const scene *a = &s[swap], *b = &s[!swap];
            drape_arena arena = drape_arena_of(a->ctx);
            drape_deviation d;
            double *x = copy_of_rest(a), *y = copy_of_rest(b);
            ck_assert_int_eq(drape_deviation_create(&arena, a->model, b->model, &d), DRAPE_OK);
            ck_assert(d.material);
            ck_assert_int_eq(d.model[d.of]->node_count,
                             meshes[i].fewer ? s[1].model->node_count : s[0].model->node_count);
            ck_assert_double_eq(d.cloths[0].diagonal, 5);
            deform(a, x, one);
            deform(b, y, one);
            drape_deviation_add(&d, 0, x, y);
            ck_assert_double_lt(d.cloths[0].largest.distance, 1e-12);
            deform(b, y, other);
            drape_deviation_add(&d, 1, x, y);
            ck_assert_double_eq_tol(d.cloths[0].largest.rms, 0.5, 1e-12);
            const drape_apart *most = &d.cloths[0].largest;
            ck_assert_double_eq_tol(most->place[1][1] - most->place[0][1], 0.5, 1e-12);
            free(x);
            free(y);
            drape_arena_free(&arena);
            scene_close(&s[0]);
            scene_close(&s[1]);
        }
}

/* A ring that is cut along a radius: the nodes of both sides of the cut are at the same places at rest, and
 * each has to find its own side. The ring opens to a spiral, 1 m over its angle. The other mesh has twice the
 * cells, so that all nodes of the coarse one are nodes of it; tolerance as above. */
TEST(sides_of_a_cut)
{
#define RING                                                                                                 \
    "{'drape': 1, 'duration': 1, 'cloth': [{'mesh': {'grid': 'revolution', 'columns': %d, 'rows': %d, "      \
    "'top_radius': 1, 'bottom_radius': 2}, 'terms': ['stretch.cst'],"                                        \
    " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}}]}"
    scene coarse = scene_model(RING, 13, 4), fine = scene_model(RING, 25, 7);
    const scene *both[2] = {&coarse, &fine};
    double *x[2];
    drape_arena arena = drape_arena_of(coarse.ctx);
    drape_deviation d;
    for (int k = 0; k < 2; k++) {
        const int columns = both[k]->model->cloths[0].mesh.columns;
        double *rest = both[k]->model->rest;
        for (int i = columns - 1; i < both[k]->model->node_count;
             i += columns) /* without the rounding of 360 degrees */
            memcpy(rest + 3 * i, rest + 3 * (i - columns + 1), 3 * sizeof *rest);
        x[k] = copy_of_rest(both[k]);
        for (int i = 0; i < both[k]->model->node_count; i++)
            x[k][3 * i + 1] += (double)(i % columns) / (columns - 1);
    }
    ck_assert_int_eq(drape_deviation_create(&arena, coarse.model, fine.model, &d), DRAPE_OK);
    drape_deviation_add(&d, 0, x[0], x[1]);
    ck_assert_double_lt(d.cloths[0].largest.distance, 1e-12);
    free(x[0]);
    free(x[1]);
    drape_arena_free(&arena);
    scene_close(&coarse);
    scene_close(&fine);
}

TEST(refusals)
{
    static const struct {
        const char *names[2];
        int columns;
        double width;
        const char *says;
    } cases[] = {
        {{"a", "b"}, 2, 1, "the first has 1 cloths, the second 2"},
        {{"skirt", NULL}, 2, 1, "cloth 0 is \"sheet\" in the first and \"skirt\" in the second"},
        {{"sheet", NULL}, 4, 1.7, "at rest the meshes are 2.1 m apart; those of one cloth are at most"},
        {{"sheet", NULL}, 5, 1.7, "at rest the meshes are 2.1 m apart"},
    };
    scene s = sheet(4, 4, "parallel");
    for (int i = 0; i < 4; i++) {
        scene other =
            cases[i].names[1]
                ? scene_model(TWO, "a", 2, 2, "parallel", "b", 2, 2, "parallel")
                : scene_model("{'drape': 1, 'duration': 1, 'cloth': [{'name': '%s', 'mesh': {'grid': "
                              "'square', 'columns': %d, 'rows': 4, 'width': 3, 'height': 4, "
                              "'transform': {'scale': [%g, 1, 1]}}, 'terms': ['stretch.cst'], 'material': "
                              "{'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}}]}",
                              cases[i].names[0], cases[i].columns, cases[i].width);
        drape_arena arena = drape_arena_of(s.ctx);
        drape_deviation d;
        ck_assert_int_eq(drape_deviation_create(&arena, s.model, other.model, &d), DRAPE_E_ARGUMENT);
        ck_assert_msg(strstr(drape_context_message(s.ctx), cases[i].says), "%s",
                      drape_context_message(s.ctx));
        drape_arena_free(&arena);
        scene_close(&other);
    }
    scene_close(&s);
}
