/*
 * test_static.c: equilibria of the integrator "static" against closed forms.
 *
 * Strips are the lattice of the grid "equilateral". Rows 0 and 1 are pinned, which clamps the strip at the
 * middle between them, so L_eff is half a row more than from row 1 to the tip. For a strip e edges wide,
 * the hinges of a row have E I = D w (8 e - 4)/(9 e - 4), 8/9 D w for a wide strip: see
 * tests/physics/test_bending.c, which derives that and the two bounds that are used here. The clamp keeps
 * the strip from curving across, so one width of it is stiffer by at most D w/EI - 1: the share of that in
 * the deflection is 1 - (1 - w/L)^4. The position of the clamp, and the half loaded row at the tip, are
 * uncertain by a quarter of a row, 4 (row/L)/4 of L^4.
 */
#include "drape/extend.h"
#include "support/scene.h"

#define MAX_NODES 1000

#define COLUMNS   4
#define EDGE      0.02
#define MODULUS   1e3 /* [Pa] for THICKNESS; thinner sheets have a larger one, and the same D */
#define THICKNESS 0.1
#define DENSITY   0.2 /* [kg/m2] */

static const double row_height = 0.8660254037844386 * EDGE;

typedef struct strip {
    double x[3 * MAX_NODES];
    int32_t triangle[6 * MAX_NODES], held[2][2 * MAX_NODES];
    size_t nodes, triangles, held_count[2];
    int columns, rows;
    drape_track_key key[2]; /* of the second list of pinned nodes; key_count of them */
    size_t key_count;
} strip;

/* The strip is `rows` edges long, horizontally along -z, or down, or up along y. */
enum { LEVEL, DOWN, UP };

static void make_strip(strip *s, int columns, int rows, double edge, int direction)
{
    const int side = columns + 1;
    memset(s, 0, sizeof *s);
    s->columns = columns;
    s->rows = rows;
    for (int r = 0; r <= rows; r++)
        for (int c = 0; c < side; c++) {
            const double along = r * sqrt(3.0) / 2 * edge;
            double *at = s->x + 3 * s->nodes++;
            at[0] = (c + (r % 2 ? 0.5 : 0)) * edge;
            at[1] = direction == LEVEL ? 0 : direction == UP ? along : -along;
            at[2] = direction == LEVEL ? -along : 0;
        }
    ck_assert(s->nodes <= MAX_NODES);
    for (int r = 0; r < rows; r++)
        for (int c = 0; c < columns; c++) {
            const int a = r * side + c, b = a + 1, d = a + side, e = d + 1;
            const int corner[6] = {a, b, r % 2 ? e : d, r % 2 ? a : b, e, d};
            for (int k = 0; k < 6; k++)
                s->triangle[3 * s->triangles + (size_t)k] = corner[k];
            s->triangles += 2;
        }
}

static void pin_row(strip *s, int list, int row)
{
    for (int c = 0; c <= s->columns; c++)
        s->held[list][s->held_count[list]++] = row * (s->columns + 1) + c;
}

typedef struct load {
    double modulus, thickness, gravity, tolerance;
    bool bending;
    const drape_term_ops *host; /* one more term */
} load;

static scene open_strip(const strip *mesh, const load *l)
{
    const drape_setting material[] = {{"young_modulus", l->modulus, NULL},
                                      {"thickness", l->thickness, NULL},
                                      {"areal_density", DENSITY, NULL}};
    const drape_setting integrator[] = {{"dt", 1, NULL}, {"tolerance", l->tolerance, NULL}};
    drape_entry_def terms[3] = {{"stretch.edge", NULL, 0}};
    drape_pin_def pins[2];
    drape_cloth_def cloth;
    drape_scene_def def;
    scene s = scene_empty();
    size_t count = 1, pin_count = 0;
    if (l->bending)
        terms[count++].type = "bend.hinge";
    if (l->host) {
        ck_assert_int_eq(drape_context_add_term(s.ctx, l->host), DRAPE_OK);
        terms[count++].type = l->host->entry.name;
    }
    drape_cloth_def_init(&cloth, sizeof cloth);
    drape_scene_def_init(&def, sizeof def);
    for (size_t k = 0; k < 2 && mesh->held_count[k] > 0; k++) {
        drape_pin_def_init(&pins[k], sizeof pins[k]);
        pins[k].nodes = mesh->held[k];
        pins[k].node_count = mesh->held_count[k];
        pins[k].track = k == 1 && mesh->key_count > 0 ? mesh->key : NULL;
        pins[k].key_count = k == 1 ? mesh->key_count : 0;
        pin_count++;
    }
    cloth.mesh.positions = mesh->x;
    cloth.mesh.node_count = mesh->nodes;
    cloth.mesh.triangles = mesh->triangle;
    cloth.mesh.triangle_count = mesh->triangles;
    cloth.material = material;
    cloth.material_count = 3;
    cloth.terms = terms;
    cloth.term_count = count;
    cloth.pins = pins;
    cloth.pin_count = pin_count;
    def.cloths = &cloth;
    def.cloth_count = 1;
    def.gravity[1] = -l->gravity;
    def.integrator = (drape_entry_def){"static", integrator, 2};
    ck_assert_msg(drape_model_create(s.ctx, &def, &s.model) == DRAPE_OK, "%s", drape_context_message(s.ctx));
    scene_start(&s, NULL);
    return s;
}

/*
 * Advances to 1 s, when the tracks have ended; the residual must be within the tolerance.
 */
static void settle(scene *s, double tolerance)
{
    scene_watch(s);
    scene_advance(s, 1);
    const drape_statistics done = drape_sim_statistics(s->sim);
    printf("# %lld iterations, residual %.3g N, %s, %lld unstable modes\n", (long long)done.newton_iterations,
           s->residual, done.stability_known ? "known" : "unknown", (long long)done.unstable_modes);
    ck_assert(s->residual <= tolerance && s->unconverged == 0);
}

static void check_stable(const scene *s)
{
    const drape_statistics done = drape_sim_statistics(s->sim);
    ck_assert(done.stability_known);
    ck_assert_int_eq(done.unstable_modes, 0);
}

static double row_mean(const scene *s, const strip *mesh, int row, int k)
{
    const double *x = drape_sim_positions(s->sim) + 3 * row * (mesh->columns + 1);
    double sum = 0;
    for (int i = 0; i <= mesh->columns; i++)
        sum += x[3 * i + k];
    return sum / (mesh->columns + 1);
}

/* ---- Cantilevers ---- */

#define ROWS 60

static double strip_length(void)
{
    return (ROWS - 0.5) * row_height;
}

static double strip_width(void)
{
    return COLUMNS * EDGE;
}

static double plate_rigidity(void)
{
    return MODULUS * pow(THICKNESS, 3) / (12 * (1 - 1.0 / 9)); /* the default poisson_ratio is 1/3 */
}

static double strip_rigidity(void)
{
    const double e = COLUMNS;
    return plate_rigidity() * EDGE * e * (8 * e - 4) / (9 * e - 4);
}

static double stiffening(void)
{
    return (plate_rigidity() * strip_width() / strip_rigidity() - 1) *
           (1 - pow(1 - strip_width() / strip_length(), 4));
}

#define ROW_SHARE (row_height / strip_length())

/*
 * Young's modulus of a sheet `thinner` times as thin with the same D. Its stretch by the weight,
 * rho g L/(E h) = G (h/L)^2/12, changes the length of the arc.
 */
static load strip_load(double thinner, double gravity, double tolerance)
{
    return (load){MODULUS * pow(thinner, 3), THICKNESS / thinner, gravity, tolerance, true, NULL};
}

/*
 * physics.md, section 3: drop over reach of the clamped elastica under its own weight. It grows at most in
 * proportion to G, and G falls with E I: the bounds of the deflection are those of H/W.
 */
START_TEST(heavy_cantilever_hangs_as_the_elastica)
{
    static const double table[][2] = {{1, 0.1245617664}, {10, 1.06680232}, {100, 5.888104623}};
    static strip mesh;
    for (size_t k = 0; k < 3; k++) {
        const double L = strip_length(), G = table[k][0];
        const double gravity = G * strip_rigidity() / (DENSITY * strip_width() * pow(L, 3));
        make_strip(&mesh, COLUMNS, ROWS, EDGE, LEVEL);
        pin_row(&mesh, 0, 0);
        pin_row(&mesh, 0, 1);
        const load l = strip_load(10, gravity, 1e-9);
        scene s = open_strip(&mesh, &l);
        settle(&s, 1e-9);
        check_stable(&s);
        const double reach = -row_mean(&s, &mesh, ROWS, 2) - 0.5 * row_height;
        const double ratio = -row_mean(&s, &mesh, ROWS, 1) / reach, excess = ratio / table[k][1] - 1;
        printf("# G %g: H/W %.6f, elastica %.6f\n", G, ratio, table[k][1]);
        assert_below(excess, ROW_SHARE);
        assert_below(-excess, stiffening() + ROW_SHARE);
        scene_close(&s);
    }
}
END_TEST

/* ---- The end-loaded cantilever ---- */

/* A dead load on the nodes of the last row, COLUMNS + 1 of them: E = -P y/(COLUMNS + 1), linear. */
static double end_load; /* [N], along y */

static drape_status build_load(const drape_cloth_view *cloth, const double *params,
                               drape_term_builder *builder)
{
    (void)params;
    drape_status status = drape_term_reserve(builder, COLUMNS + 1, 1);
    for (int32_t i = 0; !status && i <= COLUMNS; i++) {
        const int32_t node = cloth->node_count - 1 - i;
        const double share = end_load / (COLUMNS + 1);
        drape_term_set(builder, i, &node, &share);
    }
    return status;
}

static void one_load(const drape_elements *el, int32_t element, const double *x, double *e, double *g,
                     double *hess)
{
    (void)hess;
    if (e)
        *e = -el->rest[element] * x[1];
    if (g) {
        g[0] = g[2] = 0;
        g[1] = -el->rest[element];
    }
}

static void load_energy(const drape_elements *el, int32_t first, int32_t count, const double *x,
                        const double *internal, double *e, double *g, double *hess)
{
    (void)internal;
    drape_energy_range(el, first, count, x, e, g, hess, one_load);
}

static const drape_term_ops load_term = {
    .struct_size = sizeof(drape_term_ops),
    .entry = {.name = "host.load", .summary = "a constant force on the last row", .reference = "-"},
    .element_name = "node",
    .nodes = 1,
    .linear = true,
    .build = build_load,
    .energy = load_energy};

/*
 * physics.md: P L^2/EI = 1, 2, 4. The length is that to the last row, which carries the load. w/L grows at
 * most in proportion to P, u/L to P^2. The curvature is largest at the clamp, where the strip is stiffer:
 * of the deflection P L^3/3 the first width has the share 1 - (1 - w/L)^3, less than the bound at the top
 * of this file. The uncertain position of the clamp adds 3 (row/L)/4.
 */
START_TEST(end_loaded_cantilever_bends_as_the_elastica)
{
    static const double table[][3] = {
        {1, 0.05643324, 0.30172077}, {2, 0.16064172, 0.49345748}, {4, 0.32894124, 0.66996418}};
    static strip mesh;
    for (size_t k = 0; k < 3; k++) {
        const double L = strip_length();
        end_load = -table[k][0] * strip_rigidity() / (L * L);
        make_strip(&mesh, COLUMNS, ROWS, EDGE, LEVEL);
        pin_row(&mesh, 0, 0);
        pin_row(&mesh, 0, 1);
        load l = strip_load(10, 0, 1e-9);
        l.host = &load_term;
        scene s = open_strip(&mesh, &l);
        settle(&s, 1e-9);
        check_stable(&s);
        const double w = -row_mean(&s, &mesh, ROWS, 1) / L;
        const double u = 1 - (-row_mean(&s, &mesh, ROWS, 2) - 0.5 * row_height) / L;
        printf("# P L2/EI %g: w/L %.6f of %.6f, u/L %.6f of %.6f\n", table[k][0], w, table[k][2], u,
               table[k][1]);
        assert_below(w / table[k][2] - 1, ROW_SHARE);
        assert_below(1 - w / table[k][2], stiffening() + ROW_SHARE);
        assert_below(u / table[k][1] - 1, 2 * ROW_SHARE);
        assert_below(1 - u / table[k][1], 2 * (stiffening() + ROW_SHARE));
        scene_close(&s);
    }
}
END_TEST

/* ---- Chains ---- */

/*
 * A strip one edge wide of N rows, 1.2 m long, without bending, pinned at its ends, which a track has moved
 * to a distance of 1 m. The row edges of a lattice lie across, the slanted ones zigzag along; as the
 * symmetry of the load keeps rows parallel, the strip is a chain whose links are the rows. A chain of N
 * links with its mass in the joints differs from the catenary by second order in 1/N: a parabola's chord
 * polygon lies inside by sag/N^2 at the lowest point, and the half links at the ends carry no weight, 1/N^2
 * again, so at most 4/N^2 of the sag. The stretch eps = T/(E h w) lengthens the chain; d sag/d length is
 * below 1 (sag .29, length 1.2: at span 1, 0.86), so it adds eps 1.2.
 */
START_TEST(a_strip_hung_by_its_ends_is_a_catenary)
{
    enum { LINKS = 60 };
    static strip mesh;
    const double length = 1.2, edge = length / (LINKS * sqrt(3.0) / 2), stiff = 1e5; /* [N/m] E h */
    make_strip(&mesh, 1, LINKS, edge, LEVEL);
    pin_row(&mesh, 0, 0);
    pin_row(&mesh, 1, LINKS);
    mesh.key[0] = (drape_track_key){0, {0, 0, 0}};
    mesh.key[1] = (drape_track_key){1, {0, 0, length - 1}};
    mesh.key_count = 2;
    const load l = {stiff / 1e-4, 1e-4, 9.81, 1e-9, false, NULL};
    scene s = open_strip(&mesh, &l);
    settle(&s, 1e-9);
    const double sag = -row_mean(&s, &mesh, LINKS / 2, 1);
    const double tension = DENSITY * 9.81 * length; /* more than the tension of the catenary, per width */
    printf("# sag %.6f m, catenary .292344\n", sag);
    assert_below(fabs(sag - 0.29234380), 4.0 / (LINKS * LINKS) * 0.29234380 + length * tension / stiff);
    scene_close(&s);
}
END_TEST

/*
 * A strip that hangs by its upper row, in small strain: u(L) = rho g L^2/(2 E h) where it is free to
 * narrow. The lattice is the constant-strain sheet of nu = 1/3, whose stress is linear along the strip; the
 * stretch of a gap between rows is that at its middle, and the sum of these is exactly the integral of a
 * linear function. Only sides and ends cause errors. The pinned row keeps its width, so up to one width
 * from it the lattice is stiffer by at most 1/(1 - nu^2) - 1 = 1/8; that width has at most 2 w/L of the
 * elongation. The sides are zigzags: the outermost half column of the e + 1/2 of a row has springs on one
 * side only, so between 0 and 1/(e + 1/2) of the width carries nothing.
 */
START_TEST(a_hanging_strip_is_longer_by_its_weight)
{
    enum { WIDE = 16, LONG = 55 };
    static strip mesh;
    const double L = LONG * row_height, E = 1e5, h = 1e-3, gravity = 1e-3 * 9.81;
    make_strip(&mesh, WIDE, LONG, EDGE, DOWN);
    pin_row(&mesh, 0, 0);
    const load l = {E, h, gravity, 1e-12, true, NULL};
    scene s = open_strip(&mesh, &l);
    settle(&s, 1e-12);
    check_stable(&s);
    const double exact = DENSITY * gravity * L * L / (2 * E * h), u = -row_mean(&s, &mesh, LONG, 1) - L;
    printf("# elongation %.6g m, rho g L2/(2 E h) %.6g m, ratio %.4f\n", u, exact, u / exact);
    assert_below(u / exact - 1, 1.0 / WIDE);
    assert_below(1 - u / exact, 1.0 / 8 * 2 * WIDE * EDGE / L);
    scene_close(&s);
}
END_TEST

/* ---- Stability ---- */

/*
 * A strip that stands on its clamped foot buckles under its own weight at G = 7.83735 (Greenhill). By
 * Rayleigh's quotient the foot, which cannot curve across, raises that by at most the stiffening, 4 %, and
 * the position of the clamp, uncertain by a quarter of a row, changes L^3 by 3 (row/L)/4 = 1.3 %: 0.9 and
 * 1.1 lie outside. A flat strip is an equilibrium on both sides, as bending and stretching in the plane do
 * not couple to first order; above, one mode is unstable (the second has G = 55.98).
 */
static drape_statistics stand(double factor)
{
    static strip mesh;
    const double L = strip_length(), G = 7.83735 * factor;
    const double gravity = G * strip_rigidity() / (DENSITY * strip_width() * pow(L, 3));
    make_strip(&mesh, COLUMNS, ROWS, EDGE, UP);
    pin_row(&mesh, 0, 0);
    pin_row(&mesh, 0, 1);
    const load l = strip_load(10, gravity, 1e-9);
    scene s = open_strip(&mesh, &l);
    settle(&s, 1e-9);
    const drape_statistics done = drape_sim_statistics(s.sim);
    double bent = 0;
    for (int32_t i = 0; i < s.model->node_count; i++)
        bent = fmax(bent, fabs(drape_sim_positions(s.sim)[3 * i + 2]));
    printf("# G %g: deflection %.3g m\n", G, bent);
    ck_assert(done.stability_known);
    assert_below(bent, 1e-6 * L);
    scene_close(&s);
    return done;
}

START_TEST(a_standing_strip_is_unstable_above_greenhills_weight)
{
    ck_assert_int_eq(stand(0.9).unstable_modes, 0);
    ck_assert_int_eq(stand(1.1).unstable_modes, 1);
}
END_TEST

/* ---- No equilibrium ---- */

START_TEST(a_free_sheet_has_no_equilibrium_and_ends)
{
    static strip mesh;
    make_strip(&mesh, COLUMNS, 6, EDGE, LEVEL);
    const load l = strip_load(10, 9.81, 1e-9);
    scene s = open_strip(&mesh, &l);
    const double *x = drape_sim_positions(s.sim);
    const uint64_t before = drape_sim_hash(s.sim);
    scene_watch(&s);
    const drape_status status = drape_sim_advance(s.sim, 1);
    const drape_statistics done = drape_sim_statistics(s.sim);
    printf("# %s after %lld iterations, %ld attempts: %s\n", drape_status_name(status),
           (long long)done.newton_iterations, s.rejected, drape_context_message(s.ctx));
    ck_assert_int_lt(status, 0);
    ck_assert_int_eq(s.accepted, 0);
    ck_assert(drape_sim_time(s.sim) == 0 && drape_sim_hash(s.sim) == before && isfinite(x[0]));
    ck_assert(!done.stability_known);
    ck_assert_msg(strncmp(drape_context_message(s.ctx), "t=0 h=1: ", 9) == 0, "%s",
                  drape_context_message(s.ctx));
    ck_assert_int_lt(done.newton_iterations, 50000);
    scene_close(&s);
}
END_TEST

/* A sheet that lies on another: the nodes that contact couples are not coupled in the model's pattern, but
 * must be in the Hessian. Each wrong sign would be a mode. */
START_TEST(one_sheet_lies_on_another)
{
    scene s = scene_open(
        "{'drape': 1, 'cloth': [{'name': 'low', 'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'width': "
        "0.2,"
        " 'height': 0.2}, 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
        " 'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'edge': 'left'}, {'edge': 'right'}]},"
        " {'name': 'high', 'mesh': {'grid': 'square', 'columns': 4, 'rows': 4, 'width': 0.13, 'height': 0.13,"
        " 'transform': {'translate': [0.03,0.03,-0.03]}},"
        " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
        " 'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'edge': 'left'}]}],"
        " 'self_contact': {'thickness': 0.004}, 'integrator': {'method': 'static', 'dt': 0.01}, 'duration': "
        "1}");
    scene_advance(&s, 1);
    const drape_statistics found = drape_sim_statistics(s.sim);
    ck_assert(drape_sim_energy(s.sim).contact > 0);
    ck_assert(found.stability_known);
    ck_assert_int_eq(found.unstable_modes, 0);
    scene_close(&s);
}
END_TEST

SUITE("static", one_sheet_lies_on_another, heavy_cantilever_hangs_as_the_elastica,
      end_loaded_cantilever_bends_as_the_elastica, a_strip_hung_by_its_ends_is_a_catenary,
      a_hanging_strip_is_longer_by_its_weight, a_standing_strip_is_unstable_above_greenhills_weight,
      a_free_sheet_has_no_equilibrium_and_ends)
