/* test_seams.c: seams: what they carry, how they close under every integrator, their derivatives, and terms
 * of a host between two cloths. */
#include "support/methods.h"
#include "support/scene.h"

#include "base/vec3.h"
#include "drape/extend.h"
#include "geometry/intersect.h"
#include "integrators/spectrum.h"
#include "support/bytes.h"

#define ROOM 256

/* Two panels of 0.2 m x 0.2 m, the upper one pinned at its upper edge. %g: the gap between them, the
 * integrator, and further keys. */
#define PANEL                                                                                                \
    "'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'width': 0.2, 'height': 0.2, 'orientation': "       \
    "'vertical', 'transform': {'translate': [0, %g, %g]}}, 'material': {'young_modulus': 1e5, "              \
    "'poisson_ratio': 0, 'thickness': 1e-3, 'areal_density': 0.2}, 'terms': ['stretch.cst', 'bend.hinge', "  \
    "{'type': 'damp.kelvin_voigt', 'beta': 5e-4}]"
#define PANELS                                                                                               \
    "{'drape': 1, 'cloth': [{'name': 'upper', " PANEL                                                        \
    ", 'pins': [{'edge': 'top'}]}, {'name': 'lower', " PANEL                                                 \
    "}], 'seams': [{'type': 'stitch', 'a': {'cloth': 'upper', 'edge': 'bottom'}, 'b': {'cloth': 'lower', "   \
    "'edge': 'top'}%s}], 'self_contact': {'thickness': 1e-3}, 'integrator': {%s}, 'duration': 2}"

#define WEIGHT (0.2 * 0.2 * 0.2 * 9.81) /* [N] of a panel */

static scene open_panels(double gap, double aside, const char *stitch, const char *integrator)
{
    return scene_open(PANELS, 0.5, 0.0, 0.3 - gap, aside, stitch, integrator);
}

/* ---- Forces ---- */

/* At rest a closed seam carries the weight of what hangs from it, and opens by what its threads give: the
 * forces on the lower panel balance up to the residuals of its 75 unknowns, of at most 1e-9 N each. */
TEST(carries_a_known_load)
{
    scoped_scene s =
        open_panels(0, 0, ", 'closing': 0, 'stiffness': 37", "'method': 'static', 'tolerance': 1e-9");
    drape_seam_report seam;
    scene_advance(&s, 2);
    ck_assert_int_eq(drape_sim_seam(s.sim, -1, NULL), 1);
    ck_assert_int_eq(drape_sim_seam(s.sim, 0, &seam), 1);
    ck_assert_str_eq(seam.name, "seam0");
    ck_assert_str_eq(seam.type, "stitch");
    ck_assert_int_eq(seam.pairs, 5);
    ck_assert_int_eq(seam.cloth[0], 0);
    ck_assert_int_eq(seam.cloth[1], 1);
    assert_below(fabs(seam.force[1] + WEIGHT), 75 * 1e-9);
    assert_below(fabs(seam.force[0]), 75 * 1e-9);
    assert_below(fabs(seam.force[2]), 75 * 1e-9);
    /* E = 1/2 k l^2: the forces have the magnitude k l; sums of five with rounding of coordinates up to
     * 0.5 m */
    assert_below(fabs(seam.tension - 5 * 37 * seam.gap_mean), 5 * 37 * 8 * DBL_EPSILON);
    assert_below(fabs(seam.tension_max - 37 * seam.gap_max), 37 * 8 * DBL_EPSILON);
    /* threads hang within 1 degree of the vertical: the sum of magnitudes is that of the vertical parts */
    assert_below(fabs(seam.gap_mean - WEIGHT / (5 * 37)), 2e-4 * WEIGHT / (5 * 37));
}

/* Before a seam begins to close, its threads are as long as the gap: the lower panel hangs on them from the
 * beginning. */
TEST(holds_before_it_closes)
{
    scoped_scene s = open_panels(0.05, 0, ", 'start': 10", "'dt': 0.01");
    drape_seam_report seam;
    scene_advance(&s, 1);
    drape_sim_seam(s.sim, 0, &seam);
    ck_assert_double_gt(seam.gap_mean, 0.05);
    ck_assert_double_lt(seam.gap_mean,
                        0.0504); /* by WEIGHT/(5 E h) = 1.6e-4, and a third of that for swings */
}

/* ---- Closing ---- */

/* Two panels, 5 cm and 3 cm apart, are pulled together by every method; nothing passes through anything,
 * and in the end the seam carries the weight, but for the swings of methods that do not dissipate: by the
 * largest acceleration of the pull, 6 x 0.058 m/(0.5 s)^2 = 0.14 g, and by 3/2 (0.03/0.2)^2 = 0.03 of a
 * pendulum. The account of energy closes: what threads give when they are shortened is the work that
 * lifts the lower panel by the gap. Without it the energy would be off by that work, WEIGHT 0.05 m.
 * Methods differ by what they dissipate, and by their tolerance in positions, 1e-5 of the scene. */
static void close_by(const char *method)
{
    char integrator[96];
    snprintf(integrator, sizeof integrator, "'method': '%s', 'dt': 0.01, 'rtol': 1e-5", method);
    scoped_scene s = open_panels(0.05, 0.03, ", 'closing': 0.5", integrator);
    drape_intersections found;
    drape_seam_report seam;
    const drape_energy start = drape_sim_energy(s.sim);
    for (int i = 1; i <= 20; i++) {
        scene_advance(&s, 0.1 * i);
        ck_assert_int_eq(drape_find_intersections(s.ctx, s.model, drape_sim_positions(s.sim), &found),
                         DRAPE_OK);
        ck_assert_int_eq(found.count, 0);
    }
    const drape_energy end = drape_sim_energy(s.sim);
    drape_sim_seam(s.sim, 0, &seam);
    assert_below(seam.gap_max, 1e-3);
    assert_below(fabs(seam.force[1] + WEIGHT), 0.2 * WEIGHT);
    const double stored =
        end.kinetic + end.elastic + end.gravity - start.kinetic - start.elastic - start.gravity;
    printf("# %s: stored %g, dissipated %g, numerical %g J\n", method, stored, end.dissipated, end.numerical);
    /* work = stored + dissipated + numerical: of the lifting, and of what the swing dissipates */
    ck_assert_double_gt(stored + end.dissipated + end.numerical, 0.8 * stored);
    ck_assert_double_gt(end.numerical, -0.1 * WEIGHT * 0.05);
}

TEST(closes)
{
    for (size_t k = 0; k < METHODS; k++)
        close_by(methods[k]);
}

/* The fastest wave with a gap of 5 cm, of which threads still have 4 cm to go, or of a closed seam. */
static double fastest_wave(const char *stitch)
{
    scoped_scene s = open_panels(0.05, 0, stitch, "'method': 'verlet', 'dt': 1e-3");
    drape_spectrum *spectrum;
    drape_arena arena = drape_arena_of(s.ctx);
    double omega, damping;
    drape_state *state = scene_state(&s);
    for (int i = 25; i < 50; i++)
        state->x[3 * i + 1] += 0.01; /* threads are slack until they close */
    ck_assert_int_eq(drape_spectrum_create(&arena, s.sim->system, 20, &spectrum), DRAPE_OK);
    drape_spectrum_largest(spectrum, state, &omega, &damping);
    drape_arena_free(&arena);
    return omega;
}

/* The stable step of explicit integrators counts the stiffness that threads will have. */
TEST(stability_counts_slack_threads)
{
    const double slack = fastest_wave(", 'start': 10, 'stiffness': 2000"),
                 closed = fastest_wave(", 'closing': 0, 'stiffness': 2000"),
                 soft = fastest_wave(", 'start': 10, 'stiffness': 1e-3");
    ck_assert_double_eq(slack, closed);
    ck_assert_double_gt(closed, 2 * soft);
}

/* Pieces that have nodes of a seam are neighbours: contact does not push it open, thin as the gap is in
 * comparison with the distance of layers. */
TEST(is_not_in_contact)
{
    scoped_scene s = open_panels(0, 0, ", 'closing': 0", "'dt': 0.01");
    drape_seam_report seam;
    scene_advance(&s, 1);
    drape_sim_seam(s.sim, 0, &seam);
    ck_assert_double_lt(seam.gap_max, 0.5e-3);
    ck_assert_double_eq(drape_sim_energy(s.sim).contact, 0);
}

/* ---- Derivatives ---- */

static void check_model(const drape_model *model, const char *term, int rows_of_term)
{
    static drape_check_result rows[ROOM];
    int32_t count = 0;
    for (unsigned seed = 1; seed <= 3; seed++) {
        int of_term = 0;
        ck_assert_int_eq(drape_model_check_derivatives(model, seed, rows, ROOM, &count), DRAPE_OK);
        ck_assert_int_lt(count, ROOM);
        for (int32_t i = 0; i < count; i++) {
            of_term += strcmp(rows[i].term, term) == 0;
            ck_assert_msg(rows[i].pass, "seed %u: %s of %s is off by %g", seed, rows[i].what, rows[i].term,
                          rows[i].error);
        }
        ck_assert_int_eq(of_term, rows_of_term);
    }
}

/* Gradient, Hessian, symmetry, net force and torque, before, while and after the seam closes. */
TEST(derivatives)
{
    scoped_scene s = open_panels(0.01, 0.02, ", 'start': -0.0, 'closing': 1", "'dt': 0.01");
    check_model(s.model, "stitch", 5);
    ck_assert_int_eq(drape_model_check_derivatives(NULL, 1, NULL, 0, NULL), DRAPE_E_ARGUMENT);
    int32_t count = 0;
    ck_assert_int_eq(drape_model_check_derivatives(s.model, 1, NULL, 0, &count), DRAPE_OK);
    ck_assert_int_gt(count, 5);
}

/* ---- Damping ---- */

/* Two panels as stiff as boards, one below the other on threads that stay 5 cm long, and dashpots beside
 * them. */
#define BOARD                                                                                                \
    "'mesh': {'grid': 'square', 'columns': 3, 'rows': 3, 'width': 0.2, 'height': 0.2, 'orientation': "       \
    "'vertical', 'transform': {'translate': [0, %g, 0]}}, 'material': {'young_modulus': 1e8, "               \
    "'poisson_ratio': 0, 'thickness': 1e-3, 'areal_density': 0.2}, 'terms': ['stretch.cst']"
#define SIDES "'a': {'cloth': 'upper', 'edge': 'bottom'}, 'b': {'cloth': 'lower', 'edge': 'top'}"
#define BOARDS                                                                                               \
    "{'drape': 1, 'cloth': [{'name': 'upper', " BOARD                                                        \
    ", 'pins': [{'box': [[-1, -1, -1], [1, 1, 1]]}]}, {'name': 'lower', " BOARD                              \
    "}], 'seams': [{'type': 'stitch', 'stiffness': 60, 'start': 10, " SIDES                                  \
    "}, {'type': 'dashpot', 'coefficient': %g, " SIDES                                                       \
    "}], 'integrator': {'method': 'dirk', 'dt': 0.001, 'rtol': 1e-7}, 'duration': 2}"

/* A board of the mass M that is let go hangs on n threads and dashpots: M e'' = F - n k e - n c e', e(0) =
 * e'(0) = 0, whose solution is known. A board gives by n k/(E h) = 1.8e-3 of what threads do, and its waves
 * take as much: 1 %. In the end half of the work of the weight is dissipated, 1/2 F^2/(n k). With (s/l)^2 =
 * 4e-8, the smoothing is not seen. */
TEST(dashpots_damp_threads)
{
    const double c = 0.1, n = 3, k = 60, M = 0.2 * 0.2 * 0.2, F = M * 9.81, decay = n * c / (2 * M),
                 omega = sqrt(n * k / M - decay * decay);
    scoped_scene s = scene_open(BOARDS, 0.5, 0.25, c);
    drape_seam_report seam;
    ck_assert_int_eq(drape_sim_seam(s.sim, -1, NULL), 2);
    double dissipated = 0;
    for (int i = 1; i <= 40; i++) {
        const double t = 0.005 * i,
                     e = F / (n * k) *
                         (1 - exp(-decay * t) * (cos(omega * t) + decay / omega * sin(omega * t)));
        scene_advance(&s, t);
        drape_sim_seam(s.sim, 0, &seam);
        assert_below(fabs(seam.gap_mean - 0.05 - e), 0.01 * F / (n * k));
        ck_assert_double_ge(drape_sim_energy(s.sim).dissipated, dissipated);
        dissipated = drape_sim_energy(s.sim).dissipated;
    }
    drape_sim_seam(s.sim, 1, &seam);
    ck_assert_str_eq(seam.type, "dashpot");
    scene_advance(&s, 0.8);
    assert_below(fabs(drape_sim_energy(s.sim).dissipated - F * F / (2 * n * k)), 0.01 * F * F / (2 * n * k));
}

/* The force of the dashpots of BOARDS at velocities v: its sum and its torque, the sum of magnitudes, and
 * its power. */
static void measure_dashpots(const scene *s, const double *v, double net[6], double *size, double *power)
{
    const drape_state *now = drape_sim_state(s->sim);
    const drape_point point = {.x = now->x, .v = v, .internal = now->internal, .t = now->t};
    double g[3 * 18] = {0};
    ck_assert_int_eq(s->model->node_count, 18);
    drape_system_term(s->sim->system, s->model->seams[1].term, &point, NULL, g, NULL);
    memset(net, 0, 6 * sizeof *net);
    *size = *power = 0;
    for (int i = 0; i < 18; i++) {
        const double *x = now->x + 3 * (size_t)i, *f = g + 3 * i;
        double torque[3];
        vec3_cross(x, f, torque);
        for (int k = 0; k < 3; k++) {
            net[k] += f[k];
            net[3 + k] += torque[k];
            *size += fabs(f[k]);
            *power += f[k] * v[3 * i + k];
        }
    }
}

/* Derivatives are exact, also where the nodes meet. Net force and torque vanish, to 100 roundings; power is
 * taken by any motion, but for those of all as one body. */
TEST(dashpots_act_between_nodes)
{
    for (int i = 0; i < 2; i++) {
        scoped_scene s = scene_open(BOARDS, i ? 0.45 : 0.5, 0.25, 0.3);
        double v[3 * 18], net[6], size, power;
        check_model(s.model, "dashpot", 2);
        scene_advance(&s, 0.01); /* threads are taut */
        for (int k = 0; k < 3 * 18; k++)
            v[k] = sin(5.0 * k);
        measure_dashpots(&s, v, net, &size, &power);
        ck_assert(size > 0 && power > 0);
        for (int k = 0; k < 6; k++)
            assert_below(fabs(net[k]), 100 * DBL_EPSILON * size);
        const double full = size, w[3] = {1, -2, 0.5};
        for (int k = 0; k < 18; k++)
            vec3_cross(w, drape_sim_positions(s.sim) + 3 * (size_t)k, v + 3 * k);
        measure_dashpots(&s, v, net, &size, &power);
        assert_below(size, 100 * DBL_EPSILON * full);
    }
}

/* ---- A term of a host ---- */

/* E = 1/2 k |x0 - (x1 + x2)/2|^2: each node of side a is drawn to the middle of a node of side b and the next
 * one. k is what user points to. */
static drape_status button_build(const drape_seam_view *seam, const double *params,
                                 drape_term_builder *builder)
{
    const double rest = 0;
    (void)params;
    ck_assert_double_eq(*(double *)seam->user, 12.5);
    ck_assert_ptr_eq(seam->cloth[0]->user, seam->user);
    ck_assert_int_eq(seam->first_node[1], 25);
    drape_status status = drape_term_reserve(builder, seam->pair_count, 1);
    for (int32_t i = 0; !status && i < seam->pair_count; i++) {
        const int32_t *pair = seam->pair + 2 * i;
        ck_assert_int_lt(pair[1] - seam->first_node[1], seam->cloth[1]->node_count);
        drape_term_set(builder, i, (int32_t[]){pair[0], pair[1], pair[1] + 5}, &rest);
    }
    return status;
}

static void button(const drape_elements *el, int32_t element, const double *x, double *e, double *g,
                   double *hess)
{
    static const double weight[3] = {1, -0.5, -0.5};
    const double k = *(double *)el->user;
    (void)element;
    double d[3];
    for (int i = 0; i < 3; i++)
        d[i] = x[i] - (x[3 + i] + x[6 + i]) / 2;
    if (e)
        *e = 0.5 * k * vec3_dot(d, d);
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < 3; i++) {
            if (g)
                g[3 * a + i] = k * weight[a] * d[i];
            for (int b = 0; hess && b < 3; b++)
                for (int j = 0; j < 3; j++)
                    hess[9 * (3 * a + i) + 3 * b + j] = i == j ? k * weight[a] * weight[b] : 0;
        }
}

static void button_energy(const drape_elements *el, int32_t first, int32_t count, const double *x,
                          const double *internal, double *e, double *g, double *hess)
{
    (void)internal;
    drape_energy_range(el, first, count, x, e, g, hess, button);
}

static double strength = 12.5;
static const drape_term_ops buttons = {.struct_size = sizeof(drape_term_ops),
                                       .entry = {.name = "host.buttons",
                                                 .summary = "buttons",
                                                 .reference = "Hooke 1678, De potentia restitutiva"},
                                       .element_name = "button",
                                       .nodes = 3,
                                       .convex = true,
                                       .build_seam = button_build,
                                       .energy = button_energy,
                                       .user = &strength};

static drape_status compile(drape_context *ctx, const char *type, int list, drape_model **model)
{
    drape_scene_def def = scene_def();
    drape_cloth_def cloths[2];
    drape_seam_def seam = seam_def();
    const int32_t nodes[] = {20, 21, 22}, far[] = {0, 1, 25};
    static const drape_setting settings[] = {{.name = "young_modulus", .number = 1e5},
                                             {.name = "thickness", .number = 1e-3},
                                             {.name = "density", .number = 200}};
    static const drape_setting grid[] = {{.name = "columns", .number = 5},
                                         {.name = "rows", .number = 5},
                                         {.name = "width", .number = 0.2},
                                         {.name = "height", .number = 0.2}};
    static const drape_entry_def terms[] = {{.type = "stretch.cst"}};
    for (int c = 0; c < 2; c++) {
        drape_cloth_def_init(&cloths[c], sizeof *cloths);
        cloths[c].mesh.grid = (drape_entry_def){"square", grid, 4};
        cloths[c].material = settings;
        cloths[c].material_count = 3;
        cloths[c].terms = terms;
        cloths[c].term_count = 1;
    }
    seam.entry.type = type;
    seam.a.cloth = "cloth0";
    seam.a.nodes = nodes;
    seam.b.cloth = "cloth1";
    seam.b.nodes = list ? far : (const int32_t[]){0, 1, 2};
    seam.a.node_count = seam.b.node_count = 3;
    def.cloths = cloths;
    def.cloth_count = 2;
    def.seams = &seam;
    def.seam_count = 1;
    return drape_model_create(ctx, &def, model);
}

/* The term has its user pointer everywhere, exact derivatives, and forces on both cloths, by structs
 * alone. */
TEST(term_of_a_host)
{
    scoped_scene s = scene_empty();
    drape_seam_report seam;
    ck_assert_int_eq(drape_context_add_term(s.ctx, &buttons), DRAPE_OK);
    ck_assert_int_eq(drape_context_add_term(s.ctx, &buttons), DRAPE_E_ARGUMENT);
    assert_ok(s.ctx, compile(s.ctx, "host.buttons", 0, &s.model));
    check_model(s.model, "host.buttons", 5);
    scene_start(&s, NULL);
    ck_assert_int_eq(drape_sim_seam(s.sim, 0, &seam), 1);
    ck_assert_str_eq(seam.type, "host.buttons");
    /* the rows of both sheets are at 0.2 - 0.05 i, upside down: 4 rows apart, and half of one */
    assert_below(fabs(seam.tension - 3 * 12.5 * 0.175), 1e-12);
}

/* What is wrong is refused where it is. */
TEST(refusals)
{
    scene s = scene_empty();
    drape_model *model = NULL;
    ck_assert_int_eq(compile(s.ctx, "stitch", 1, &model), DRAPE_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(drape_context_message(s.ctx),
                                 "/seams/0/b/nodes/2: node 25 is not in the mesh; its nodes are 0 to 24"));
    ck_assert_int_eq(compile(s.ctx, "host.buttons", 0, &model), DRAPE_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(drape_context_message(s.ctx),
                                 "/seams/0/type: there is no seam \"host.buttons\"; there are stitch"));
    ck_assert_int_eq(compile(s.ctx, NULL, 0, &model), DRAPE_E_ARGUMENT);
    drape_context_destroy(&s.ctx);
}
