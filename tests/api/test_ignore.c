/* test_ignore.c: cloth that passes through the colliders and cloths that the scene says. */
#include "support/bytes.h"
#include "support/host.h"
#include "support/suite.h"

/* Two sheets, one above the other, over a floor; more members of each, and of the floor. */
static const char two[] =
    "{'drape': 1, 'cloth': [{'name': 'upper', 'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'width': "
    "0.4, "
    "'height': 0.4, 'transform': {'translate': [0, 0.1, 0]}}, 'material': {'young_modulus': 1e4, "
    "'thickness': "
    "1e-3, 'density': 200}, 'terms': ['stretch.edge', 'bend.hinge']%s}, {'name': 'lower', 'mesh': {'grid': "
    "'square', 'columns': 5, 'rows': 5, 'width': 0.4, 'height': 0.4, 'transform': {'translate': [0.013, "
    "0.05, "
    "0.007]}}, 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200}, 'terms': "
    "['stretch.edge', "
    "'bend.hinge']%s}], 'colliders': [{'type': 'plane', 'name': 'floor', 'point': [0, 0, 0], 'normal': [0, "
    "1, "
    "0]%s}, {'type': 'box', 'name': 'table', 'center': [0.2, -0.1, -0.2], 'size': [0.6, 0.24, 0.6]%s}], "
    "'self_contact': {'thickness': %s}, 'integrator': {'method': '%s', 'dt': %s, 'tolerance': 1e-9}, "
    "'frame_rate': 64, 'duration': 1}";

/* The lowest nodes of both cloths. */
static void lowest(const host *h, double low[2])
{
    for (int c = 0; c < 2; c++) {
        low[c] = INFINITY;
        for (int i = 0; i < 25; i++)
            low[c] = fmin(low[c], drape_sim_positions(h->sim)[3 * (25 * c + i) + 1]);
    }
}

/* From 0.1 m and 0.05 m, after 0.4 s: a sheet that falls freely has fallen 0.78 m; the table, at 0.02 m,
 * holds what touches it, and the floor, at 0, what does not touch the table. Verlet's rules cannot take
 * whole sheets that land flat on the floor or on each other: it has those on the table, and thin ones. */
TEST(cloth_passes_through_what_it_ignores)
{
    static const struct {
        const char *upper, *lower, *floor, *table;
        double upper_at, lower_at; /* NAN: it falls freely */
    } cases[] = {
        {"", "", "", "", 0.02, 0.02},
        {", 'ignore': ['table']", "", "", "", 0, 0.02},
        {", 'ignore': ['table', 'floor', 'lower']", "", "", "", NAN, 0.02},
        {"", ", 'ignore': ['floor', 'table', 'upper', 'lower']", "", "", 0.02, NAN},
        {"", "", "", ", 'enabled': false", 0, 0},
        {"", "", ", 'enabled': false", ", 'enabled': false", NAN, NAN},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        for (int m = 0; m < 2 - (cases[i].upper_at == 0 || cases[i].lower_at == 0); m++) {
            scoped_host h = open_scene(two, cases[i].upper, cases[i].lower, cases[i].floor, cases[i].table,
                                       m ? "0.0002" : "0.005", m ? "verlet" : "be", m ? "0.0002" : "0.008");
            double low[2];
            const drape_status status = drape_sim_advance(h.sim, 0.4);
            ck_assert_msg(!status, "case %zu, %s: %s", i, m ? "verlet" : "be", drape_context_message(h.ctx));
            lowest(&h, low);
            const double at[2] = {cases[i].upper_at, cases[i].lower_at};
            for (int c = 0; c < 2; c++)
                if (isnan(at[c]))
                    ck_assert_msg(low[c] < -0.6, "case %zu, %s, cloth %d: %g m", i, m ? "verlet" : "be", c,
                                  low[c]);
                else
                    ck_assert_msg(low[c] > at[c] - 1e-3 && low[c] < 0.1, "case %zu, %s, cloth %d: %g m", i,
                                  m ? "verlet" : "be", c, low[c]);
        }
}

/* Where cloth is in what it ignores, it does not count as inside. */
TEST(what_is_ignored_is_not_reported)
{
    scoped_host h =
        open_scene(two, ", 'ignore': ['table', 'floor', 'lower']", "", "", "", "0.005", "be", "0.008");
    good(&h, drape_sim_advance(h.sim, 0.15)); /* amid both */
    ck_assert_int_eq(drape_sim_inside(h.sim, 0, NULL), 0);
    ck_assert_int_eq(drape_sim_inside(h.sim, 1, NULL), 0);
    ck_assert_int_eq((int)drape_sim_intersections(h.sim, -1), 0);
    for (int i = 0; i < 4; i++) {
        drape_warning warning;
        if (drape_sim_warning(h.sim, i, &warning))
            ck_assert_msg(strstr(warning.text, "inside") == NULL, "%s", warning.text);
    }
}

/* A collider that is switched off and on again in a running sim. */
TEST(a_collider_is_switched)
{
    host h = open_scene(two, "", "", "", "", "0.005", "be", "0.008");
    char text[4096];
    drape_scene *scene = NULL;
    double low[2];
    snprintf(text, sizeof text, two, "", "", "", ", 'enabled': false", "0.005", "be", "0.008");
    quote(text);
    good(&h, drape_sim_advance(h.sim, 0.3));
    good(&h, drape_scene_parse(h.ctx, text, "s.json", &scene));
    good(&h, drape_sim_change(h.sim, scene));
    good(&h, drape_sim_advance(h.sim, 0.5));
    lowest(&h, low);
    ck_assert(low[1] < 0.01 && low[1] > 0); /* on the floor */
    good(&h, drape_scene_set(scene, "/colliders/1/enabled", "true"));
    good(&h, drape_sim_change(h.sim, scene));
    ck_assert_int_gt(drape_sim_inside(h.sim, 1, NULL), 0);
    good(&h, drape_sim_advance(h.sim, 1.2)); /* pushed out again */
    ck_assert_int_eq(drape_sim_inside(h.sim, 1, NULL), 0);
    lowest(&h, low);
    ck_assert_double_gt(low[1], 0.02);
    drape_scene_destroy(&scene);
    close_scene(&h);
}

TEST(unknown_names)
{
    scoped_host h = empty_host();
    char text[4096];
    scoped_parsed *scene = NULL;
    snprintf(text, sizeof text, two, ", 'ignore': ['floor', 'chair']", "", "", "", "0.005", "be", "0.008");
    quote(text);
    ck_assert_int_eq(drape_scene_parse(h.ctx, text, "s.json", &scene), DRAPE_OK);
    says(&h, drape_scene_compile(scene, &h.model), DRAPE_E_ARGUMENT,
         "/cloth/0/ignore/1: there is no collider and no cloth \"chair\"");
}
