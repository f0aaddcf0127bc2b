/* test_follower.c: load.follower: its resultant on any cloth, the reactions of a rim, a strip with open
 * sides inflated to an arc, against closed forms; the same forces as load.pressure inside. */
#include "support/scene.h"

#define PRESSURE 50.0

/* The vector area of the triangles, which depends on their boundary only. */
static void area_of(const scene *s, const double *x, double area[3])
{
    memset(area, 0, 3 * sizeof *area);
    for (int32_t t = 0; t < s->model->triangle_count; t++) {
        const int32_t *n = s->model->triangle + 3 * t;
        double a[3], b[3];
        for (int k = 0; k < 3; k++) {
            a[k] = x[3 * n[1] + k] - x[3 * n[0] + k];
            b[k] = x[3 * n[2] + k] - x[3 * n[0] + k];
        }
        for (int k = 0; k < 3; k++)
            area[k] += (a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3]) / 2;
    }
}

/* The force of the term alone. */
static void force_of(const scene *s, double *g)
{
    drape_point point = {.x = drape_sim_positions(s->sim), .v = drape_sim_velocities(s->sim)};
    for (int32_t i = 0; i < s->model->term_count; i++)
        if (strncmp(s->model->terms[i].ops->entry.name, "load.", 5) == 0)
            drape_system_term(s->sim->system, i, &point, NULL, g, NULL);
}

#define CURVED                                                                                               \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 7, 'rows': 6, 'width': 1, 'height': "  \
    "0.8}, 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'areal_density': 0.2}, 'terms': "           \
    "['stretch.cst', {'type': '%s', 'pressure': 50}], 'start': {'folds': [{'point': [0.3, 0, 0], 'axis': "   \
    "[0, 0.2, 1], 'side': [1, 0, 0], 'angle': 150, 'radius': 0.15}]}}], 'duration': 1}"

/* On a bent cloth with open edges all forces add up to p times the vector area, to rounding of p A; and on
 * nodes inside they are those of load.pressure, to rounding of p |X|^2. */
TEST(the_resultant_is_pressure_times_area)
{
    scene s = scene_open(CURVED, "load.follower"), c = scene_open(CURVED, "load.pressure");
    double g[2][3 * 42] = {{0}}, area[3], sum[3] = {0};
    area_of(&s, drape_sim_positions(s.sim), area);
    force_of(&s, g[0]), force_of(&c, g[1]);
    for (int i = 0; i < 42; i++)
        for (int k = 0; k < 3; k++) {
            sum[k] -= g[0][3 * i + k];
            if (i / 7 > 0 && i / 7 < 5 && i % 7 > 0 && i % 7 < 6)
                ck_assert_double_eq_tol(g[0][3 * i + k], g[1][3 * i + k], 64 * DBL_EPSILON * PRESSURE);
        }
    for (int k = 0; k < 3; k++)
        ck_assert_double_eq_tol(sum[k], PRESSURE * area[k], 64 * DBL_EPSILON * PRESSURE);
    scene_close(&s), scene_close(&c);
}

/* A square membrane, pinned all round, carries the pressure on the area of its rim, 0.3 m x 0.3 m,
 * whatever its shape: to the residual of the nodes inside, 1e-9 N each here. load.pressure, with its apex
 * in the plane of the rim, leaves the rim a third of the pressure on the triangles at it: it does not. */
TEST(a_rim_carries_pressure_times_area)
{
    for (int k = 0; k < 2; k++) {
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 9, 'rows': 9, 'width': 0.3, "
            "'height': "
            "0.3}, 'material': {'young_modulus': 1e6, 'thickness': 1e-3, 'areal_density': 0.2}, 'terms': "
            "['stretch.cst', 'bend.midedge', {'type': '%s', 'pressure': 50}], 'pins': [{'edge': 'left'}, "
            "{'edge': "
            "'right'}, {'edge': 'top'}, {'edge': 'bottom'}]}], 'gravity': [0, 0, 0], 'integrator': "
            "{'method': "
            "'static', 'tolerance': 1e-9}, 'duration': 1}",
            k ? "load.pressure" : "load.follower");
        double r[3 * 81], sum[3] = {0}, size = 0;
        scene_advance(&s, 1);
        ck_assert_int_eq(drape_sim_reactions(s.sim, r), DRAPE_OK);
        for (int i = 0; i < 3 * 81; i++)
            sum[i % 3] += r[i];
        for (int i = 0; i < 3; i++)
            size += sum[i] * sum[i];
        printf("# %s: %.9g of %.9g N\n", k ? "load.pressure" : "load.follower", sqrt(size), PRESSURE * 0.09);
        if (k)
            ck_assert(sqrt(size) < 0.99 * PRESSURE * 0.09);
        else
            ck_assert_double_eq_tol(sqrt(size), PRESSURE * 0.09, 81e-9);
    }
}

/* A strip of length L between two pinned ends, its sides open, is inflated to an arc of radius R and half
 * angle a, stretched l = a/sin a: R = L/(2 sin a), and with Green's strain the tension E h (l^2 - 1)/2 l
 * is p R (nu = 0). Chords of n segments are shorter than the arc by (a/n)^2/6 of its excess; with 24 of
 * them and a = 0.6 that is 1e-4 of the height, and bending, over sqrt(D/N) = 2 mm at the ends, 1e-3: 0.3 %
 * in all. The sides are as high as the middle, to the same. */
TEST(a_strip_with_open_sides_is_an_arc)
{
    static const char *const methods[] = {"static", "be"};
    double low = 1e-3, high = 1.5;
    for (int k = 0; k < 100; k++) {
        const double a = (low + high) / 2, l = a / sin(a);
        *(1e3 * (l * l - 1) / 2 * l > PRESSURE / (2 * sin(a)) ? &high : &low) = a;
    }
    const double height = (1 - cos(low)) / (2 * sin(low));
    for (int m = 0; m < 2; m++) {
        scoped_scene s =
            scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 25, 'rows': 4, "
                       "'width': 1, 'height': "
                       "0.12}, 'material': {'young_modulus': 1e6, 'poisson_ratio': 0, 'thickness': "
                       "1e-3, 'areal_density': "
                       "0.2}, 'terms': ['stretch.cst', 'bend.midedge', {'type': 'load.follower', "
                       "'pressure': 50}], 'pins': "
                       "[{'edge': 'left'}, {'edge': 'right'}]}], 'gravity': [0, 0, 0], 'integrator': "
                       "{'method': '%s', 'dt': "
                       "0.05}, 'duration': 3}",
                       methods[m]);
        scene_advance(&s, 3);
        for (int row = 0; row < 4; row++) {
            const double *x = scene_state(&s)->x + 3 * (25 * row + 12);
            const double *rest = s.model->rest + 3 * (25 * row + 12);
            const double up = sqrt(pow(x[0] - rest[0], 2) + pow(x[1] - rest[1], 2) + pow(x[2] - rest[2], 2));
            printf("# %s, row %d: %.6g of %.6g m\n", methods[m], row, up, height);
            ck_assert_double_eq_tol(up, height, 3e-3 * height);
        }
    }
}
