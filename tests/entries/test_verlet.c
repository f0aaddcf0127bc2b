/* test_verlet.c: the explicit integrator and its rules, with numbers small enough to check by hand. */
#include "support/scene.h"

#include "base/vec3.h"
#include "integrators/verlet.h"

/* Most grids here are chains along x: their rows are 1e3 m apart, and springs between rows have no effect,
 * unless the scene says otherwise. */
#define GRID     "{'grid': 'square', 'columns': %d, 'rows': %d, 'width': %g, 'height': %g}"
#define MATERIAL "'material': {'young_modulus': 1, 'thickness': 1, 'total_mass': %g, 'mass': 'uniform'}"

static drape_setting number(const char *name, double value)
{
    return (drape_setting){.name = name, .number = value};
}

static drape_setting word(const char *name, const char *text)
{
    return (drape_setting){.name = name, .text = text};
}

static void start(scene *s, const drape_setting *settings, size_t count, const char *controller, double dt)
{
    drape_sim_def def = sim_def();
    def.integrator = "verlet";
    def.integrator_settings = settings;
    def.integrator_setting_count = count;
    def.controller = controller;
    def.dt = dt;
    scene_start(s, &def);
}

/* ---- Time ---- */

static scene sheet(void)
{
    return scene_model(
        "{'drape': 1, 'cloth': [{'mesh': " GRID ", " MATERIAL
        ", 'terms': [{'type': 'spring.structural', 'stiffness': 30, 'damping': 0.05},"
        "{'type': 'spring.shear', 'stiffness': 20}, {'type': 'drag.viscous', 'coefficient': 0.1}],"
        "'velocity': [0.3, 0.1, -0.2], 'pins': [{'corner': 'top-left'}]}], 'duration': 1}",
        6, 5, 0.5, 0.4, 0.3);
}

/* The position form is CS184's x' = x + c (x - x_before) + a h^2 with x_before = x - h v at the start. Here
 * the same numbers are computed on positions only, with forces of the library. Rounding: positions of 1 m
 * have 1e-16, which the recurrence sums twice: 200^2/2 times that. */
TEST(the_position_form_is_the_recurrence_of_positions)
{
    const double h = 1e-3, c = 1 - 0.3 / 100;
    const int steps = 200;
    const drape_setting settings[] = {number("substeps", 1), word("form", "position"),
                                      number("damping", 0.3)};
    scoped_scene s = sheet();
    start(&s, settings, 3, "fixed", h);
    size_t n = 3 * (size_t)s.model->node_count;
    double *x = malloc(4 * n * sizeof *x), *before = x + n, *v = before + n, *g = v + n;
    ck_assert_ptr_nonnull(x);
    memcpy(x, drape_sim_positions(s.sim), n * sizeof *x);
    for (size_t i = 0; i < n; i++)
        before[i] = x[i] - h * drape_sim_velocities(s.sim)[i];
    for (int k = 0; k < steps; k++) {
        for (size_t i = 0; i < n; i++)
            v[i] = (x[i] - before[i]) / h;
        drape_system_force(s.sim->system, &(drape_point){.x = x, .v = v}, g);
        for (size_t i = 0; i < n; i++) {
            double next = x[i] + c * (x[i] - before[i]) - h * h * g[i] / s.model->mass[i / 3];
            if (s.model->pinned[i / 3])
                continue;
            before[i] = x[i];
            x[i] = next;
        }
    }
    scene_advance(&s, steps * h);
    for (size_t i = 0; i < n; i++)
        ck_assert_double_eq_tol(drape_sim_positions(s.sim)[i], x[i], 1e-11);
    free(x);
}

/* ---- Stability ---- */

/* A chain of n free nodes of mass m between springs k, pinned at one end and free at the other, doubled by
 * the second row that the grid needs: along x the eigenvalues of both are 2 k/m (1 - cos((2 j - 1) pi/(2 n
 * + 1))), the largest for j = n. Springs across the rows have no stiffness. With 30 products for 2 x 8 x 3
 * unknowns, Lanczos is accurate to 1e-6; the differences are accurate to 1e-6 too. */
TEST(omega_is_that_of_a_chain)
{
    const double k = 40, m = 0.01;
    scoped_scene s = scene_model("{'drape': 1, 'cloth': [{'mesh': " GRID ", " MATERIAL
                                 ", 'terms': [{'type': 'spring.structural', 'stiffness': %g}],"
                                 "'pins': [{'edge': 'left'}]}], 'gravity': [0, 0, 0], 'duration': 1}",
                                 9, 2, 0.8, 1e3, 18 * m, k);
    const drape_setting settings[] = {number("substeps", 4)};
    start(&s, settings, 1, "fixed", 0.01);
    drape_stability found;
    s.sim->chosen.integrator->stability(s.sim->integrator, drape_sim_state(s.sim), 0.01, &found);
    /* Across, two nodes on a spring between rows: only 2 k/m, below the chain's 4 k/m. */
    double omega = sqrt(2 * k / m * (1 - cos(15 * acos(-1) / 17)));
    printf("# omega %.8g, chain %.8g\n", found.omega, omega);
    ck_assert_double_eq_tol(found.omega / omega, 1, 1e-5);
    ck_assert_double_eq_tol(found.limit, 2 / omega, 1e-5 * 2 / omega);
    ck_assert_double_eq(found.substep, 0.0025);
    ck_assert_double_eq_tol(found.step, 4 * found.limit, 1e-12);
    ck_assert_double_eq(found.damping, 0);
}

/* A start off equilibrium by 1e-6 stays near it below the limit and grows above it, damped or not. */
TEST(steps_are_stable_only_below_the_limit)
{
    const char *const forms[] = {"position", "velocity"};
    for (int f = 0; f < 2; f++)
        for (int over = 0; over < 2; over++)
            for (double c = 0; c < 1; c += 0.5) {
                scoped_scene s =
                    scene_model("{'drape': 1, 'cloth': [{'mesh': " GRID ", " MATERIAL
                                ", 'terms': [{'type': 'spring.structural', 'stiffness': 40, 'damping': %g}],"
                                "'pins': [{'edge': 'left'}]}], 'gravity': [0, 0, 0], 'duration': 1}",
                                9, 2, 0.8, 1e3, 0.18, c);
                const drape_setting settings[] = {number("substeps", 1), word("form", forms[f]),
                                                  number("guard", 0)};
                start(&s, settings, 3, "fixed", 1);
                drape_stability found;
                s.sim->chosen.integrator->stability(s.sim->integrator, drape_sim_state(s.sim), 1, &found);
                drape_state *now = scene_state(&s);
                for (int32_t i = 0; i < s.model->node_count; i++)
                    now->x[3 * (size_t)i] += s.model->pinned[i] ? 0 : i % 2 ? 1e-6 : -1e-6;
                /* The velocity form has a larger limit if it is damped: 1.4 is above both. */
                double h = found.limit * (over ? 1.4 : 0.98);
                drape_status status = DRAPE_OK;
                for (int k = 1; k <= 400 && !status; k++)
                    status = drape_sim_advance(s.sim, k * h);
                ck_assert_msg(over ? status < 0 : status == 0, "%s, dashpots %g, %g of the limit: %s",
                              forms[f], c, h / found.limit, drape_context_message(s.ctx));
            }
}

/* ---- Moving nodes ---- */

/* Four points that fly past a plane at y = 0, which may move. */
static scene flyers(const char *colliders)
{
    return scene_model(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 2, 'rows': 2, 'width': 1, "
        "'height': 1, 'transform': {'translate': [0, 0.01, 0]}}, " MATERIAL
        ", 'velocity': [1, -2, 0]}], 'gravity': [0, 0, 0], 'colliders': [%s], 'duration': 1}",
        1.0, colliders);
}

static void one_step(scene *s, const char *rule, double x[3], double v[3])
{
    const drape_setting settings[] = {number("substeps", 1), word("form", "position"), word("contact", rule),
                                      number("guard", 0)};
    start(s, settings, 4, "fixed", 0.01);
    scene_advance(s, 0.01);
    memcpy(x, drape_sim_positions(s->sim), 3 * sizeof *x);
    memcpy(v, drape_sim_velocities(s->sim), 3 * sizeof *v);
    scene_close(s);
}

/* From (0, 0.01, 0) the displacement of 0.01 (1, -2, 0) meets the plane at half: t = (0.005, 0.0001, 0)
 * with the offset, and x = x0 + (1 - 0.25)(t - x0). */
TEST(a_plane_stops_as_in_cs184)
{
    double x[3], v[3];
    scene s = flyers("{'type': 'plane', 'point': [0, 0, 0], 'normal': [0, 3, 0], 'friction': 0.25}");
    one_step(&s, "cs184", x, v);
    ck_assert_double_eq_tol(x[0], 0.75 * 0.005, 1e-15);
    ck_assert_double_eq_tol(x[1], 0.01 + 0.75 * (0.0001 - 0.01), 1e-15);
    ck_assert_double_eq_tol(v[0], x[0] / 0.01, 1e-12);
    ck_assert_double_eq_tol(v[1], (x[1] - 0.01) / 0.01, 1e-12);
}

/* A plane that moves with the tangential velocity of the node does not drag it: the displacement relative
 * to the plane is straight down, and friction acts on that only. */
TEST(friction_is_against_the_moving_surface)
{
    double x[3], v[3];
    scene s = flyers("{'type': 'plane', 'point': [0, 0, 0], 'normal': [0, 1, 0], 'friction': 0.25, "
                     "'track': [[0, [0, 0, 0]], [1, [1, 0, 0]]]}");
    one_step(&s, "cs184", x, v);
    ck_assert_double_eq_tol(x[0], 0.01, 1e-15);
    ck_assert_double_eq_tol(x[1], 0.01 + 0.75 * (0.0001 - 0.01), 1e-15);
}

/* A sphere of radius 1 below the origin: the node at (0.01, -0.01) is moved onto it along the radius. */
TEST(a_sphere_pushes_along_its_radius)
{
    double x[3], v[3], from[2] = {0.01, 0.99}, length = sqrt(0.01 * 0.01 + 0.99 * 0.99);
    scene s = flyers("{'type': 'sphere', 'center': [0, -1, 0], 'radius': 1, 'friction': 0.5}");
    one_step(&s, "cs184", x, v);
    ck_assert_double_eq_tol(x[0], 0.5 * from[0] / length, 1e-15);
    ck_assert_double_eq_tol(x[1], 0.01 + 0.5 * (from[1] / length - 1 - 0.01), 1e-15);
    s = flyers("{'type': 'sphere', 'center': [0, -1, 0], 'radius': 1, 'friction': 0.5}");
    one_step(&s, "boson", x, v);
    /* Boson's push has no friction; here there is none either, as no force presses the node on. */
    ck_assert_double_eq_tol(x[0], from[0] / length, 1e-15);
    ck_assert_double_eq_tol(x[1], from[1] / length - 1, 1e-15);
}

TEST(a_floor_keeps_the_place_as_in_boson)
{
    double x[3], v[3];
    scene s = flyers("{'type': 'plane', 'point': [0, 0, 0], 'normal': [0, 1, 0], 'friction': 0.25}");
    one_step(&s, "boson", x, v);
    ck_assert(x[0] == 0 && x[1] == 0.01 && x[2] == 0 && v[0] == 0 && v[1] == 0);
}

/* F = (3, -8) on a floor: 3 - 0.25 x 8 = 1 remains along it, less 0.5 v, and nothing across. Of a force
 * straight down nothing remains, where Boson divides 0 by 0; a force upwards has no friction. */
static void check_friction(const char *floor, const double v[12], const double expected[12], double power)
{
    scoped_scene s = flyers(floor);
    drape_arena memory = drape_arena_of(s.ctx);
    drape_motion *motion = NULL;
    ck_assert_int_eq(drape_motion_create(&memory, s.model, &motion), DRAPE_OK);
    const drape_verlet_contact rule = {.model = s.model,
                                       .motion = motion,
                                       .rule = DRAPE_VERLET_BOSON,
                                       .friction_range = 0.5,
                                       .friction_drag = 0.5};
    const double x[12] = {0, 0.4, 0, 0, 0.4, 0, 0, 0.4, 0, 0, 0.6, 0};
    double g[12] = {-3, 8, 0, 0, 8, 0, -3, -8, 0, -3, 8, 0};
    ck_assert_double_eq_tol(drape_verlet_friction(&rule, 0, x, v, g), power, 1e-14);
    for (int i = 0; i < 12; i++)
        ck_assert_double_eq_tol(g[i], expected[i], 1e-14);
    drape_arena_free(&memory);
}

TEST(friction_on_forces_as_in_boson)
{
    const double v[12] = {0.2, 0.1, 0}, expected[12] = {-1 + 0.1, 0.05, 0, 0, 0, 0, -3, -8, 0, -3, 8, 0};
    check_friction("{'type': 'plane', 'point': [0, 0, 0], 'normal': [0, 1, 0], 'friction': 0.25}", v,
                   expected, 0);
}

/* A floor at (1, 0, 0) m/s drags nodes at rest with 0.5 N. The first has 1.5 N instead of 3, the second 0.5
 * instead of 0: the floor's power is -1.5 + 0.5 W. */
TEST(friction_of_a_moving_floor_has_power)
{
    const double v[12] = {0}, expected[12] = {-1.5, 0, 0, -0.5, 0, 0, -3, -8, 0, -3, 8, 0};
    check_friction("{'type': 'plane', 'point': [0, 0, 0], 'normal': [0, 1, 0], 'friction': 0.25, "
                   "'track': [[0, [0, 0, 0]], [1, [1, 0, 0]]]}",
                   v, expected, -1);
}

/* The energy account of a sheet at rest at y = 0 above a body that moves at once, after 0.1 s. */
static drape_energy account_above(const char *body, const char *form, const char *rule)
{
    scoped_scene s = scene_model(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'width': 0.2, "
        "'height': 0.2, 'orientation': 'horizontal', 'transform': {'translate': [-0.1, 0, 0.1]}}, "
        "'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge']}],"
        " 'colliders': [%s], 'duration': 1}",
        body);
    const drape_setting settings[] = {word("form", form), word("contact", rule), number("substeps", 10),
                                      number("surface_offset", 0), number("friction_drag", 0)};
    start(&s, settings, 5, "fixed", 0.01);
    scene_advance(&s, 0.1);
    const drape_energy e = drape_sim_energy(s.sim);
    return e;
}

/* A floor that rises at once at u = 2 m/s, in substeps of h = 1 ms, gives each node the impulse m u, and
 * then m g h in each substep. Its work, m u^2 + m g u t, is more than the energy of the sheet, of 8e-3 kg,
 * by m u^2/2, that of the impact without rebound. The velocity form ends with half a kick of gravity, m/2 (g
 * h/2)^2. Boson's friction carries the weight instead. Until this work was counted, the check of energies
 * took it for energy out of nothing and stopped the run. */
TEST(a_rising_floor_does_work)
{
    const char *const forms[] = {"position", "velocity"}, *const rules[] = {"cs184", "boson"};
    const double mass = 0.2 * 0.2 * 0.2, u = 2, kick = 9.81 * 1e-3 / 2;
    for (int i = 0; i < 4; i++) {
        const drape_energy e = account_above("{'type': 'plane', 'point': [0, 0, 0], 'normal': [0, 1, 0], "
                                             "'track': [[0, [0, 0, 0]], [1, [0, 2, 0]]]}",
                                             forms[i % 2], rules[i / 2]);
        printf("# %s, %s: numerical %.9g J of %.9g\n", forms[i % 2], rules[i / 2], e.numerical,
               mass * u * u / 2);
        assert_below(fabs(e.numerical - mass * u * u / 2), mass * kick * kick + 1e-12);
    }
}

/* Three nodes in a line, 1 m apart; the first is pinned, the others are at 1.5 and 3.5. One pass: the
 * spring to the pin is cut to 1.1 m, all of it at its free end; then the next, 2.4 m long, loses 1.3 m in
 * equal halves. The pass leaves the first one too long, as in CS184; further passes do
 * not. */
TEST(strains_are_limited)
{
    for (int many = 0; many < 2; many++) {
        scoped_scene s = scene_model("{'drape': 1, 'cloth': [{'mesh': " GRID ", " MATERIAL
                                     ", 'terms': [{'type': 'spring.structural', 'stiffness': 0}],"
                                     "'pins': [{'nodes': [0, 3]}]}], 'gravity': [0, 0, 0], 'duration': 1}",
                                     3, 2, 2.0, 1e3, 6.0);
        drape_verlet_limit limit;
        drape_arena arena = drape_arena_of(s.ctx);
        ck_assert_int_eq(drape_verlet_limit_create(&arena, s.model, 0.1, many ? 1000 : 1, &limit), DRAPE_OK);
        ck_assert_int_eq(limit.count, 7);
        double x[18];
        memcpy(x, s.model->rest, sizeof x);
        x[3] = 1.5;
        x[6] = 3.5;
        drape_verlet_limit_lengths(&limit, x);
        if (many) {
            ck_assert_double_le(x[3], 1.1 * 1.001); /* SLACK of verlet_limit.c */
            ck_assert_double_le(x[6] - x[3], 1.1 * 1.001);
        } else {
            ck_assert_double_eq_tol(x[3], 1.1 + 0.65, 1e-12);
            ck_assert_double_eq_tol(x[6], 3.5 - 0.65, 1e-12);
        }
        ck_assert(x[0] == 0);
        drape_arena_free(&arena);
    }
}

/* 33 x 12 nodes, moved at random by up to `by`, with all kinds of springs. */
static scene shaken(double by, double *x)
{
    scene s = scene_model("{'drape': 1, 'cloth': [{'mesh': " GRID ", " MATERIAL
                          ", 'terms': [{'type': 'spring.structural', 'stiffness': 30, 'gradient': 0.4},"
                          "{'type': 'spring.shear', 'stiffness': 20, 'damping': 0.01},"
                          "{'type': 'spring.bend', 'stiffness': 10, 'rest_scale': 0.9},"
                          "{'type': 'drag.viscous', 'coefficient': 0.1}],"
                          "'pins': [{'corner': 'top-left'}, {'nodes': [200]}]}], 'duration': 1}",
                          33, 12, 3.2, 1.1, 0.3);
    uint64_t seed = 11;
    for (size_t i = 0; i < 3 * (size_t)s.model->node_count; i++) {
        seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
        x[i] = s.model->rest[i] + by * ((double)(seed >> 11) / 4503599627370496.0 - 1);
    }
    return s;
}

/* Limits one spring after the other, as the rule says. */
static void limit_by_hand(const drape_verlet_limit *l, double *x)
{
    for (int32_t i = 0; i < l->count; i++) {
        double *a = x + 3 * (size_t)l->node[2 * i], *b = x + 3 * (size_t)l->node[2 * i + 1], d[3];
        vec3_sub(b, a, d);
        double square = vec3_dot(d, d), by = 1 - l->longest[i] / sqrt(square);
        bool held = l->pinned[l->node[2 * i]], held1 = l->pinned[l->node[2 * i + 1]];
        if (!(square > l->longest[i] * l->longest[i]))
            continue;
        vec3_add_scaled((held ? 0 : held1 ? 1 : 0.5) * by, d, a);
        vec3_add_scaled(-(held1 ? 0 : held ? 1 : 0.5) * by, d, b);
    }
}

/* Whether many, few or no springs are too long, patches of springs give the same bits as one spring after the
 * other. */
TEST(patches_are_one_spring_after_the_other)
{
    static const double moves[] = {0.001, 0.005, 0.01, 0.02, 0.05, 0.2};
    for (int k = 0; k < 6; k++) {
        double x[3 * 33 * 12], y[3 * 33 * 12];
        scoped_scene s = shaken(moves[k], x);
        drape_verlet_limit limit;
        drape_arena arena = drape_arena_of(s.ctx);
        ck_assert_int_eq(drape_verlet_limit_create(&arena, s.model, 0.1, 1, &limit), DRAPE_OK);
        for (int again = 0; again < 5; again++) {
            memcpy(y, x, sizeof x);
            drape_verlet_limit_lengths(&limit, x);
            limit_by_hand(&limit, y);
            ck_assert_msg(memcmp(x, y, sizeof x) == 0, "moved by %g, pass %d", moves[k], again);
        }
        drape_arena_free(&arena);
    }
}

/* Springs in runs, the weight once, and the other terms by the system: sums in another order than the
 * system's. A node has 12 springs of up to 3 N, so each of its sums is off by less than 50 roundings of
 * that. */
TEST(forces_are_those_of_the_system)
{
    double x[3 * 33 * 12], v[3 * 33 * 12], g[3 * 33 * 12], expected[3 * 33 * 12];
    scoped_scene s = shaken(0.05, x);
    const drape_setting settings[] = {number("substeps", 1)};
    start(&s, settings, 1, "fixed", 0.01);
    drape_verlet_force *force = NULL;
    drape_arena arena = drape_arena_of(s.ctx);
    for (size_t i = 0; i < sizeof v / sizeof *v; i++)
        v[i] = sin(3.1 * (double)i);
    ck_assert_int_eq(drape_verlet_force_create(&arena, s.sim->system, &force), DRAPE_OK);
    drape_verlet_force_sum(force, &(drape_point){.x = x, .v = v}, g);
    drape_system_force(s.sim->system, &(drape_point){.x = x, .v = v}, expected);
    for (size_t i = 0; i < sizeof g / sizeof *g; i++)
        ck_assert_double_eq_tol(g[i], expected[i], 50 * 3 * 2.3e-16);
    drape_arena_free(&arena);
}

/* ---- Cloth against cloth ---- */

/* Whether two points are in the same one of CS184's boxes, 3/14 m wide here. */
static bool share_a_box(const double *a, const double *b)
{
    for (int k = 0; k < 3; k++)
        if (floor(a[k] * 14 / 3) != floor(b[k] * 14 / 3))
            return false;
    return true;
}

/* The rule without lists: every point against every other, in the order of their numbers; own: only against
 * those in the same box at the positions before the first pass. */
static void push_by_hand(const drape_model *m, bool own, double share, double *x)
{
    double reach = 2 * m->contact.self_thickness, before[3 * 196];
    memcpy(before, x, sizeof before);
    for (int32_t i = 0; i < m->node_count; i++) {
        double sum[3] = {0};
        int count = 0;
        for (int32_t j = 0; j < m->node_count; j++) {
            double d[3];
            vec3_sub(x + 3 * (size_t)i, x + 3 * (size_t)j, d);
            double distance = vec3_norm(d);
            if (j == i || !(vec3_dot(d, d) < reach * reach) ||
                distance == 0) /* compared as squares in the library too */
                continue;
            if (own && !share_a_box(before + 3 * (size_t)i, before + 3 * (size_t)j))
                continue;
            vec3_add_scaled(reach / distance - 1, d, sum);
            count++;
        }
        if (count > 0 && !m->pinned[i])
            vec3_add_scaled(share / count, sum, x + 3 * (size_t)i);
    }
}

static scene crumpled(double size, double thickness, double *x)
{
    scene s = scene_model("{'drape': 1, 'cloth': [{'mesh': " GRID ", " MATERIAL
                          ", 'pins': [{'nodes': [7]}]}], 'self_contact': {'thickness': %g}, 'duration': 1}",
                          14, 14, 1.0, 1.0, 1.0, thickness);
    uint64_t seed = 7;
    for (size_t i = 0; i < 3 * 196; i++) {
        seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
        x[i] = size * ((double)(seed >> 11) / 4503599627370496.0 - 1);
    }
    return s;
}

/* Boxes and lists find the same pairs as a comparison of all points with all, to the bit: from a heap in
 * which each point is near all others, more than lists hold, to points far apart; also when earlier lists
 * are used again. */
static void check_against_the_rule(double size, bool own, double share)
{
    double x[3 * 196], y[3 * 196];
    scoped_scene s = crumpled(size, 0.02, x);
    drape_verlet_self self;
    drape_arena arena = drape_arena_of(s.ctx);
    ck_assert_int_eq(drape_verlet_self_create(&arena, s.model, own, &self), DRAPE_OK);
    for (int again = 0; again < 30; again++) {
        memcpy(y, x, sizeof x);
        drape_verlet_self_push(&self, share, x);
        push_by_hand(s.model, own, share, y);
        double worst = 0;
        for (int i = 0; i < 3 * 196; i++)
            worst = fmax(worst, fabs(x[i] - y[i]));
        ck_assert_msg(worst == 0, "size %g, own %d, push %d: off by %g", size, own, again, worst);
        for (int i = 0; i < 3 * 196; i++)
            x[i] += 1e-3 * sin(0.7 * i + again);
    }
    drape_arena_free(&arena);
}

TEST(boxes_find_all_pairs)
{
    static const double sizes[] = {0.02, 0.08, 0.15, 0.3, 1, 50};
    for (int k = 0; k < 6; k++)
        for (int own = 0; own < 2; own++) {
            check_against_the_rule(sizes[k], own, 1.0 / 30);
            check_against_the_rule(sizes[k], own, 1);
        }
}

/* CS184's own boxes miss a pair across a face and find one inside a box. The boxes are 3 x 1/14 wide. */
TEST(own_boxes_miss_what_cs184_misses)
{
    double x[3 * 196], face = 3.0 / 14;
    scoped_scene s = crumpled(50, 0.02, x);
    const double pairs[] = {face - 0.005, 0.05, 0.05, face + 0.005, 0.05, 0.05,
                            0.05,         0.05, 0.05, 0.06,         0.05, 0.05};
    memcpy(x + 30, pairs, sizeof pairs);
    double before[3 * 196];
    memcpy(before, x, sizeof x);
    drape_verlet_self self;
    drape_arena arena = drape_arena_of(s.ctx);
    ck_assert_int_eq(drape_verlet_self_create(&arena, s.model, true, &self), DRAPE_OK);
    drape_verlet_self_push(&self, 1, x);
    ck_assert(memcmp(x + 30, before + 30, 6 * sizeof *x) == 0);
    ck_assert_double_eq_tol(x[36], 0.05 - 0.03, 1e-12);
    drape_arena_free(&arena);
}

/* Pushes, which may take hours in a heap of many points, end at once when the step is cancelled. */
TEST(a_cancelled_push_moves_nothing)
{
    double x[3 * 196], before[3 * 196];
    scoped_scene s = crumpled(0.02, 0.02, x);
    const atomic_bool raised = true;
    drape_verlet_self self;
    drape_arena arena = drape_arena_of(s.ctx);
    ck_assert_int_eq(drape_verlet_self_create(&arena, s.model, false, &self), DRAPE_OK);
    memcpy(before, x, sizeof x);
    self.cancel = &raised;
    drape_verlet_self_push(&self, 1, x);
    ck_assert(memcmp(x, before, sizeof x) == 0);
    self.cancel = NULL;
    drape_verlet_self_push(&self, 1, x);
    ck_assert(memcmp(x, before, sizeof x) != 0);
    drape_arena_free(&arena);
}
