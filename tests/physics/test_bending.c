/*
 * test_bending.c: the plate that the hinges of bend.hinge model.
 *
 * Let b (2 x 2) be the second derivatives of a small deflection. On the equilateral lattice with edge l it
 * opens the hinge along direction t, with n normal to it in the plane, by theta = sqrt(3)/2 l (b_nn -
 * b_tt/3). With k = (2/sqrt(3)) D the energy per area is 1/2 D sum (b_nn - b_tt/3)^2 over the three
 * directions, which is
 *     W = 1/2 D ((tr b)^2 - 8/3 det b):
 * an isotropic plate with nu = -1/3. A free narrow strip has E I = (8/9) D w. The deflection of simply
 * supported plates with straight sides does not depend on nu.
 *
 * Statics here is backward Euler with a step of 1e6 s: the inertia M/h^2 is below 1e-12 of every stiffness,
 * so each step is a Newton solve of the equilibrium. Deflections are 1e-3 thicknesses, so the membrane,
 * whose part is (w/h)^2, adds 1e-6.
 */
#include "mesh/mesh.h"
#include "support/scene.h"

#define PI          3.14159265358979323846
#define STATIC_STEP 1e6
#define MAX_NODES   4000

/* ---- Meshes in memory ---- */

typedef struct sheet {
    double x[3 * MAX_NODES];
    int32_t triangle[6 * MAX_NODES], pinned[MAX_NODES];
    size_t nodes, triangles, pins;
} sheet;

static sheet mesh; /* one at a time: too large for a stack */

static void add_node(double x, double z, bool pin)
{
    ck_assert(mesh.nodes < MAX_NODES);
    if (pin)
        mesh.pinned[mesh.pins++] = (int32_t)mesh.nodes;
    double *at = mesh.x + 3 * mesh.nodes++;
    at[0] = x;
    at[1] = 0;
    at[2] = z;
}

static void add_triangle(int a, int b, int c)
{
    int32_t *t = mesh.triangle + 3 * mesh.triangles++;
    t[0] = a, t[1] = b, t[2] = c;
}

/*
 * A rectangle of `rows` rows (even) of equilateral triangles, `columns` edges along x, with straight sides:
 * every second row begins and ends with half a triangle. All of its rim is pinned.
 *     even row: A_0 ... A_n at 0, l ... n l;     odd row: B_0 ... B_n+1 at 0, l/2, 3l/2 ... n l
 */
static void make_plate(int columns, int rows, double l)
{
    int first = 0;
    memset(&mesh, 0, sizeof mesh);
    for (int r = 0; r <= rows; r++) {
        const int count = r % 2 ? columns + 2 : columns + 1;
        for (int i = 0; i < count; i++) {
            const double x = r % 2 ? (i == 0 ? 0 : i > columns ? columns : i - 0.5) : i;
            add_node(x * l, -r * sqrt(3.0) / 2 * l, r == 0 || r == rows || i == 0 || i == count - 1);
        }
    }
    for (int r = 0; r < rows; r++) {
        const int here = first, next = first + (r % 2 ? columns + 2 : columns + 1);
        const bool down = r % 2; /* the even row, A, is the next one */
        const int a = down ? next : here, b = down ? here : next;
        for (int i = 0; i < columns; i++)
            down ? add_triangle(b + i + 1, a + i + 1, a + i) : add_triangle(a + i, a + i + 1, b + i + 1);
        for (int i = 0; i <= columns; i++)
            down ? add_triangle(b + i, b + i + 1, a + i) : add_triangle(a + i, b + i + 1, b + i);
        first = next;
    }
}

/* The lattice of the grid "equilateral", `rows` long and `columns` edges wide. Rows 0 and 1 are pinned. */
static void make_strip(int columns, int rows, double l)
{
    const int side = columns + 1;
    memset(&mesh, 0, sizeof mesh);
    for (int r = 0; r <= rows; r++)
        for (int c = 0; c < side; c++)
            add_node((c + (r % 2 ? 0.5 : 0)) * l, -r * sqrt(3.0) / 2 * l, r < 2);
    for (int r = 0; r < rows; r++)
        for (int c = 0; c < columns; c++) {
            const int a = r * side + c, b = a + 1, d = a + side, e = d + 1;
            add_triangle(a, b, r % 2 ? e : d);
            add_triangle(r % 2 ? a : b, e, d);
        }
}

/* ---- Scenes ---- */

#define MODULUS   1e3 /* [Pa]; soft and thick: rounding of the membrane is below the hinge forces */
#define THICKNESS 0.1
#define DENSITY   0.2 /* per area */

static const double rigidity =
    MODULUS * THICKNESS * THICKNESS * THICKNESS / (12 * (1 - 1.0 / 9)); /* D [N m] */

/* The mesh under gravity; thin: thickness in metres, D as above. */
static scene load_mesh(double thickness, double gravity, double dt, double tolerance)
{
    const double modulus = MODULUS * pow(THICKNESS / thickness, 3);
    const drape_setting material[] = {
        {"young_modulus", modulus, NULL}, {"thickness", thickness, NULL}, {"areal_density", DENSITY, NULL}};
    const drape_setting integrator[] = {{"dt", dt, NULL}, {"tolerance", tolerance, NULL}};
    const drape_entry_def terms[] = {{"stretch.edge", NULL, 0}, {"bend.hinge", NULL, 0}};
    scene s = scene_empty();
    drape_cloth_def cloth;
    drape_scene_def def;
    drape_pin_def pin;
    drape_cloth_def_init(&cloth, sizeof cloth);
    drape_scene_def_init(&def, sizeof def);
    drape_pin_def_init(&pin, sizeof pin);
    pin.nodes = mesh.pinned;
    pin.node_count = mesh.pins;
    cloth.mesh.positions = mesh.x;
    cloth.mesh.node_count = mesh.nodes;
    cloth.mesh.triangles = mesh.triangle;
    cloth.mesh.triangle_count = mesh.triangles;
    cloth.material = material;
    cloth.material_count = 3;
    cloth.terms = terms;
    cloth.term_count = 2;
    cloth.pins = &pin;
    cloth.pin_count = 1;
    def.cloths = &cloth;
    def.cloth_count = 1;
    def.gravity[1] = -gravity;
    def.integrator = (drape_entry_def){"be", integrator, 2};
    def.frame_rate = 1e-9;
    ck_assert_msg(drape_model_create(s.ctx, &def, &s.model) == DRAPE_OK, "%s", drape_context_message(s.ctx));
    scene_start(&s, NULL);
    return s;
}

static double deepest(const scene *s)
{
    double y = 0;
    for (int32_t i = 0; i < s->model->node_count; i++)
        y = fmin(y, drape_sim_positions(s->sim)[3 * i + 1]);
    return -y;
}

/* ---- Energy of a bent sheet ---- */

#define GRID_EDGES 8
#define GRID_EDGE  0.1

/* Energy per area of the hinges: the mean of 1/2 k theta^2 over the hinges of each direction, with one of
 * each in the area of a node. *uneven: the largest relative spread of |theta| within a direction. */
static double hinge_density(scene *s, double *uneven)
{
    const drape_state *state = scene_state(s);
    const drape_elements *el = &s->model->terms[0].elements;
    double theta[512], sum[3] = {0}, low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {0}, total = 0;
    int count[3] = {0};
    ck_assert_int_eq(el->nodes, 4);
    ck_assert(el->count <= 512);
    drape_system_measures(s->sim->system, &(drape_point){.x = state->x, .internal = state->internal}, theta);
    for (int32_t e = 0; e < el->count; e++) {
        const double *a = s->model->rest + 3 * el->node[4 * e], *b = s->model->rest + 3 * el->node[4 * e + 1];
        const double slope = (b[0] - a[0]) * (b[2] - a[2]);
        const int k = fabs(slope) < 1e-9 ? 0 : slope > 0 ? 1 : 2;
        const double energy = 0.5 * el->rest[e] * theta[e] * theta[e];
        sum[k] += energy;
        total += energy;
        count[k]++;
        low[k] = fmin(low[k], fabs(theta[e]));
        high[k] = fmax(high[k], fabs(theta[e]));
    }
    double elastic, gravity, density = 0, largest = fmax(high[0], fmax(high[1], high[2]));
    drape_system_energy(s->sim->system, &(drape_point){.x = state->x, .internal = state->internal}, &elastic,
                        &gravity);
    ck_assert_double_eq_tol(elastic, total, 1e-13 * total);
    *uneven = 0;
    for (int k = 0; k < 3; k++) {
        density += sum[k] / count[k] / (sqrt(3.0) / 2 * GRID_EDGE * GRID_EDGE);
        *uneven = fmax(*uneven, (high[k] - low[k]) / largest);
    }
    return density;
}

static scene flat_grid(void)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': %d, 'edge_length': %g},"
        "'material': {'young_modulus': %g, 'thickness': %g, 'areal_density': %g},"
        "'terms': ['bend.hinge']}], 'gravity': [0, 0, 0], 'duration': 1}",
        GRID_EDGES, GRID_EDGE, MODULUS, THICKNESS, DENSITY);
}

/* Wraps the flat sheet around a cylinder of curvature kappa whose axis makes `angle` with z. */
static void wrap(scene *s, double kappa, double angle)
{
    const double c = cos(angle), d = sin(angle);
    for (int32_t i = 0; i < s->model->node_count; i++) {
        const double *X = s->model->rest + 3 * i, along = c * X[0] + d * X[2], axis = c * X[2] - d * X[0];
        double *x = scene_state(s)->x + 3 * i;
        const double arc = sin(kappa * along) / kappa;
        x[0] = c * arc - d * axis;
        x[1] = (1 - cos(kappa * along)) / kappa;
        x[2] = d * arc + c * axis;
    }
}

/* Rolled up in any direction, a sheet has the energy 1/2 D kappa^2 per area. All hinges of a direction are
 * equal, since the screw motions of the cylinder map the wrapped lattice to itself. The error is that of
 * chords: for an arc s the height is wrong by the share (kappa s)^2/12 and the base by (kappa s)^2/6, s <=
 * l, so an angle by at most (kappa l)^2/4 of the largest, the energy by twice that; half the kappa l gives
 * a quarter of it. */
START_TEST(rolled_sheet_has_the_energy_of_the_plate)
{
    static const double angles[] = {0, 0.3, 0.5235987755982988, 1.1, 1.5707963267948966};
    scene s = flat_grid();
    for (size_t k = 0; k < sizeof angles / sizeof *angles; k++) {
        double error[2], uneven;
        for (int half = 0; half < 2; half++) {
            const double kappa = (half ? 0.05 : 0.1) / GRID_EDGE, exact = 0.5 * rigidity * kappa * kappa;
            wrap(&s, kappa, angles[k]);
            error[half] = fabs(hinge_density(&s, &uneven) / exact - 1);
            assert_below(error[half], 0.5 * kappa * kappa * GRID_EDGE * GRID_EDGE);
            /* DBL_EPSILON of coordinates of 1 m over l, against angles of 0.05 */
            assert_below(uneven, 1e-12);
        }
        /* Second order, with (kappa l)^2 = 1 % of fourth order added; for rolling along an edge it is
         * exact. */
        if (error[1] > 1e-9)
            ck_assert_double_eq_tol(error[0] / error[1], 4, 4 * 0.05);
    }
    scene_close(&s);
}
END_TEST

/* A paraboloid y = 1/2 X.bX so shallow that slopes are below 1e-3: all is linear except for their squares. */
START_TEST(double_curvature_has_the_energy_of_the_plate)
{
    static const double bends[][3] = {{1, 0, 0}, {1, 1, 0}, {1, -1, 0}, {0, 0, 1}, {0.613, -0.241, 0.377}};
    scene s = flat_grid();
    for (size_t k = 0; k < sizeof bends / sizeof *bends; k++) {
        const double size = 5e-4, a = size * bends[k][0], b = size * bends[k][1], c = size * bends[k][2];
        const double exact = 0.5 * rigidity * ((a + b) * (a + b) - 8.0 / 3 * (a * b - c * c));
        double uneven, slope = 0;
        for (int32_t i = 0; i < s.model->node_count; i++) {
            const double *X = s.model->rest + 3 * i;
            scene_state(&s)->x[3 * i + 1] = 0.5 * (a * X[0] * X[0] + b * X[2] * X[2]) + c * X[0] * X[2];
            slope = fmax(slope, hypot(a * X[0] + c * X[2], b * X[2] + c * X[0]));
        }
        /* Normals and lengths are off by slope^2. theta is a difference of two slopes, each from an edge to
         * the apex of one triangle: both have the same slope to first order, so a few slope^2 of theta
         * remain. */
        assert_below(fabs(hinge_density(&s, &uneven) / exact - 1), 4 * slope * slope);
        assert_below(uneven, 4 * slope * slope);
    }
    scene_close(&s);
}
END_TEST

/* ---- Plates ---- */

/* Deflection in the middle of a simply supported rectangle a x b under q = 1, by Navier's double series,
 * for W = 1/2 (p (b_xx^2 + b_yy^2) + ...), in which a product of sines has p (m^4/a^4 + n^4/b^4) + r m^2
 * n^2/(a b)^2. */
static double navier(double a, double b, double p, double r)
{
    double sum = 0;
    for (int m = 1; m < 200; m += 2)
        for (int n = 1; n < 200; n += 2) {
            const double u = m / a * (m / a), v = n / b * (n / b), sign = (m + n) % 4 == 2 ? 1 : -1;
            sum += sign * 16 / (m * n * pow(PI, 6) * (p * (u * u + v * v) + r * u * v));
        }
    return sum;
}

/* w D/(q a^4) */
static double plate_deflection(scene *s, double q)
{
    scene_watch(s);
    scene_advance(s, 2 * STATIC_STEP);
    return deepest(s) * rigidity / q;
}

/*
 * A square plate supported on all sides. For a deflection sin sin, b_xy along the two sides that cut
 * triangles in half causes an error of first order: under a pure twist w = x y, x from the side, the half
 * triangle stays level, so the hinge to its whole neighbour opens as every other does, but has k = D
 * l^2/(A/2 + A), 4/3 of the others'. Its region is l/2 wide. The twist energy there is 1/2 D 8/3 (pi/a)^4
 * a/2 per unit width and side, of the total 1/2 D (pi/a)^4 a^2: the plate is stiffer by 2 x 8/3 x 1/2 x 1/3
 * x 1/2 l/a = 4 l/(9 a). Sides along rows lack only hinges that a twist does not open. All else is of
 * second order: the error of the lattice for sin sin is (pi l/a)^2 times coefficients of Taylor series,
 * below 1/2.
 */
START_TEST(simply_supported_square_plate)
{
    ck_assert_double_eq_tol(navier(1, 1, 1, 2), 0.00406235, 5e-9);
    for (int k = 1; k <= 2; k++) {
        const int columns = 13 * k, rows = 15 * k + k % 2; /* even number of rows; nearly square */
        const double l = 1.0 / columns, a = 1, b = rows * sqrt(3.0) / 2 * l, gravity = 1e-3;
        make_plate(columns, rows, l);
        scene s = load_mesh(THICKNESS, gravity, STATIC_STEP, 1e-11);
        const double ratio = plate_deflection(&s, DENSITY * gravity) / navier(a, b, 1, 2);
        assert_below(deepest(&s), 1e-3 * THICKNESS);
        assert_below(fabs(ratio - 1 + 4 * l / (9 * a)), 0.5 * pow(PI * l / a, 2));
        scene_close(&s);
    }
}
END_TEST

static double square_grid_ratio(int cells, const char *diagonals)
{
    const double gravity = 1e-3;
    scene s =
        scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': %d, 'rows': %d, 'width': 1,"
                   "'height': 1, 'diagonals': '%s'}, 'material': {'young_modulus': %g, 'thickness': %g, "
                   "'areal_density': %g},"
                   "'terms': ['stretch.edge', 'bend.hinge'],"
                   "'pins': [{'edge': 'top'}, {'edge': 'bottom'}, {'edge': 'left'}, {'edge': 'right'}]}],"
                   "'gravity': [0, %g, 0], 'frame_rate': 1e-9, 'duration': 1,"
                   "'integrator': {'dt': 1e6, 'tolerance': 1e-11}}",
                   cells + 1, cells + 1, diagonals, MODULUS, THICKNESS, DENSITY, -gravity);
    const double ratio = plate_deflection(&s, DENSITY * gravity) / navier(1, 1, 1, 2);
    scene_close(&s);
    return ratio;
}

/*
 * Right triangles are not an isotropic plate, however fine the mesh. Alternating diagonals have two kinds
 * of node, one of which may be displaced by eta s^2; hinges open by s (b_xx - 2 eta), s (b_yy - 2 eta) and
 * sqrt(2) s (+-b_xy + 2 eta), and with the eta of least energy, tr b/12,
 *     W = 1/2 D (5/6 (b_xx^2 + b_yy^2) - 1/3 b_xx b_yy + 4 b_xy^2),
 * whose simply supported plate has a Navier series with 5/6 (m^4 + n^4) + 11/3 m^2 n^2. The grid converges
 * to that and not to the isotropic plate; the rim cuts no triangle, so the error is of second order as
 * above.
 */
START_TEST(alternating_right_triangles_converge_to_another_plate)
{
    const double limit = navier(1, 1, 5.0 / 6, 11.0 / 3) / navier(1, 1, 1, 2);
    ck_assert_double_eq_tol(limit, 0.744, 0.002); /* a quarter too stiff */
    for (int cells = 12; cells <= 24; cells *= 2)
        assert_below(fabs(square_grid_ratio(cells, "alternating") - limit), 0.5 * pow(PI / cells, 2));
}
END_TEST

/*
 * Parallel diagonals: W = 1/2 D (b_xx^2 + b_yy^2 + 6 b_xy^2 +- 2 b_xy tr b). The term with the sign couples
 * bending and twist and only adds compliance to that of sines alone, 1 x (m^4 + n^4) + 6 m^2 n^2: a lower
 * bound of .50 on the deflection. There is no closed form for it; this test checks the gap stated in
 * physics.md, .555 of the plate at 160 rows, within s/a.
 */
START_TEST(parallel_right_triangles_are_half_as_soft)
{
    const double least = navier(1, 1, 1, 6) / navier(1, 1, 1, 2);
    ck_assert_double_eq_tol(least, 0.50, 0.01);
    for (int cells = 12; cells <= 24; cells *= 2) {
        const double ratio = square_grid_ratio(cells, "parallel");
        assert_below(least - ratio, 0);
        assert_below(fabs(ratio - 0.555), 1.0 / cells);
    }
}
END_TEST

/* ---- Cantilevers ---- */

#define STRIP_COLUMNS 4
#define STRIP_ROWS    60
#define STRIP_EDGE    0.02

static double strip_length(void)
{
    return (STRIP_ROWS - 0.5) * sqrt(3.0) / 2 * STRIP_EDGE;
}

/*
 * A strip clamped horizontally under its own weight. E I of e edges: a bending kappa opens the e level
 * hinges of a row by kappa - c/3 and the 2 e - 1 slanted ones by 2/3 c (times sqrt(3)/2 l), c the curvature
 * across; the c of least energy gives E I = D e l (8 e - 4)/(9 e - 4), 8/9 D w for a wide one. Two pinned
 * rows clamp it at their middle.
 *
 * The clamp enforces c = 0, so up to one width w from it the strip is between that and D w: the deflection
 * is smaller by at most (D w/EI - 1) times the share of the first width, 1 - (1 - w/L)^4. The position of
 * the clamp, and the half loaded row at the tip, are uncertain by one row: of L^4, 4 row/L at most. They
 * are symmetric about the middle of a row to leading order, which leaves a quarter of it.
 */
static double strip_rigidity(void)
{
    const double e = STRIP_COLUMNS;
    return rigidity * STRIP_EDGE * e * (8 * e - 4) / (9 * e - 4);
}

static double strip_stiffening(void)
{
    const double wide = STRIP_COLUMNS * STRIP_EDGE;
    return (rigidity * wide / strip_rigidity() - 1) * (1 - pow(1 - wide / strip_length(), 4));
}

/* Mean of coordinate k over the last row. */
static double tip(const scene *s, int k)
{
    const double *x = drape_sim_positions(s->sim) + 3 * (mesh.nodes - STRIP_COLUMNS - 1);
    double sum = 0;
    for (int i = 0; i <= STRIP_COLUMNS; i++)
        sum += x[3 * i + k];
    return sum / (STRIP_COLUMNS + 1);
}

#define ROW_SHARE (sqrt(3.0) / 2 * STRIP_EDGE / strip_length())

START_TEST(narrow_cantilever_in_small_deflection)
{
    const double L = strip_length(), wide = STRIP_COLUMNS * STRIP_EDGE, gravity = 1e-4;
    make_strip(STRIP_COLUMNS, STRIP_ROWS, STRIP_EDGE);
    scene s = load_mesh(THICKNESS, gravity, STATIC_STEP, 1e-12);
    scene_advance(&s, 2 * STATIC_STEP);
    const double exact = DENSITY * gravity * wide * pow(L, 4) / (8 * strip_rigidity());
    const double excess = -tip(&s, 1) / exact - 1;
    ck_assert(-tip(&s, 1) < 1e-2 * L);
    assert_below(excess, ROW_SHARE);
    assert_below(-excess, strip_stiffening() + ROW_SHARE);
    scene_close(&s);
}
END_TEST

/* theta'' + G (1 - s) cos theta = 0, G = rho g w L^3/EI = 10: drop over reach 1.06680232. It grows at most
 * in proportion to G, and so falls at most in inverse proportion to E I: the bounds are those above. The
 * thin sheet stretches by rho g L/(E h) = G (h/L)^2/12, 1e-4. Steps of 1 s, long compared with the slowest
 * swing, end at rest: no kinetic energy is left. */
START_TEST(heavy_cantilever)
{
    const double L = strip_length(), wide = STRIP_COLUMNS * STRIP_EDGE, G = 10;
    const double gravity = G * strip_rigidity() / (DENSITY * wide * pow(L, 3));
    make_strip(STRIP_COLUMNS, STRIP_ROWS, STRIP_EDGE);
    scene s = load_mesh(0.01, gravity, 1, 1e-9);
    scene_watch(&s);
    scene_advance(&s, 100);
    const drape_energy energy = drape_sim_energy(s.sim);
    assert_below(energy.kinetic, 1e-12 * energy.elastic);
    ck_assert_int_eq(s.unconverged, 0);
    /* The clamp is half a row before row 1, which is at z = -(one row). */
    const double reach = -tip(&s, 2) - 0.5 * sqrt(3.0) / 2 * STRIP_EDGE;
    const double excess = -tip(&s, 1) / reach / 1.06680232 - 1;
    assert_below(excess, ROW_SHARE);
    assert_below(-excess, strip_stiffening() + ROW_SHARE);
    scene_close(&s);
}
END_TEST

SUITE("bending", rolled_sheet_has_the_energy_of_the_plate, double_curvature_has_the_energy_of_the_plate,
      simply_supported_square_plate, alternating_right_triangles_converge_to_another_plate,
      parallel_right_triangles_are_half_as_soft, narrow_cantilever_in_small_deflection, heavy_cantilever)
