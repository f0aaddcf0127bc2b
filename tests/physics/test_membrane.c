/*
 * test_membrane.c: the lattice of springs stretch.edge as a sheet.
 *
 * Every triangle owns half of each of its springs, and k = E h (A1 + A2), so the energy per area of a
 * homogeneous deformation is W = 1/2 E h sum q_i^2 over the three edge directions u_i, and
 * sum (u_i . S u_i)^2 = 3/8 (2 S:S + (tr S)^2): the plane-stress sheet with nu = 1/3.
 */
#include "support/scene.h"

#define EDGES     6
#define LENGTH    0.1  /* [m] of an edge */
#define MODULUS   1e6  /* [Pa] */
#define THICKNESS 1e-3 /* [m] */

static const double membrane = MODULUS * THICKNESS; /* E h [N/m] */

static scene sheet(const char *stiffness)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': %d, 'edge_length': %g},"
        "'material': {'young_modulus': %g, 'thickness': %g, 'areal_density': 0.2},"
        "'terms': [{'type': 'stretch.edge', 'stiffness': '%s'}]}],"
        "'gravity': [0, 0, 0], 'duration': 1}",
        EDGES, LENGTH, MODULUS, THICKNESS, stiffness);
}

/* x = F X: F (3 x 3), row-major. */
static void deform(scene *s, const double F[9])
{
    double *x = scene_state(s)->x;
    for (int32_t i = 0; i < s->model->node_count; i++)
        for (int r = 0; r < 3; r++) {
            const double *X = s->model->rest + 3 * (size_t)i;
            x[3 * (size_t)i + (size_t)r] = F[3 * r] * X[0] + F[3 * r + 1] * X[1] + F[3 * r + 2] * X[2];
        }
}

static void force(scene *s, double *g)
{
    const drape_state *state = scene_state(s);
    drape_system_force(s->sim->system, &(drape_point){.x = state->x, .v = state->v}, g);
}

static double elastic(scene *s)
{
    double energy, gravity;
    const drape_state *state = scene_state(s);
    drape_system_energy(s->sim->system, &(drape_point){.x = state->x, .v = state->v}, &energy, &gravity);
    return energy;
}

static int row_of(int32_t node)
{
    return (int)node / (EDGES + 1);
}

static int column_of(int32_t node)
{
    return (int)node % (EDGES + 1);
}

static bool on_boundary(int32_t node)
{
    return row_of(node) % EDGES == 0 || column_of(node) % EDGES == 0;
}

/* An inner node has six springs in three opposite pairs; an affine map keeps the pairs equal and opposite,
 * so the forces cancel at any stretch: at a strain of 1e-9, and at one of 100 %. */
TEST(interior_forces_vanish_under_any_affine_map)
{
    static const double gradient[9] = {0.731, 0.113, 0.412, -0.297, 0.531, 0.843, 0.613, -0.179, -0.921};
    static const double sizes[] = {1e-9, 1e-4, 0.13, 1.07};
    double g[3 * (EDGES + 1) * (EDGES + 1)], worst = 0;
    scoped_scene s = sheet("consistent");
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        double F[9];
        for (int i = 0; i < 9; i++)
            F[i] = (i % 4 == 0) + sizes[k] * gradient[i];
        deform(&s, F);
        force(&s, g);
        for (int32_t i = 0; i < s.model->node_count; i++)
            for (int c = 0; c < 3 && !on_boundary(i); c++)
                worst = fmax(worst, fabs(g[3 * i + c]));
    }
    /* Coordinates are below 2 (EDGES + 1) LENGTH. */
    assert_below(worst, force_noise(sqrt(3.0) / 2 * membrane, 2 * (EDGES + 1) * LENGTH));
}

/* The patch test as a solve: boundary nodes are pinned where the map moves them, and the inner ones find
 * their positions. A step of 1e6 s is statics: the inertia M/h^2 is 1e-18 of the stiffness. The stretch of
 * 5 to 12 % keeps every spring in tension, so the Hessian is at least that of the springs' along-edge parts
 * in the plane. */
TEST(patch_test_as_a_solve)
{
    static const double F[9] = {1.12, 0, 0.03, 0.2, 1, -0.1, 0.02, 0, 1.05};
    static drape_pin_def pins[4 * EDGES];
    static drape_track_key keys[4 * EDGES];
    static int32_t nodes[4 * EDGES];
    static const drape_setting grid[] = {{"edges", EDGES, NULL}, {"edge_length", LENGTH, NULL}};
    static const drape_setting material[] = {
        {"young_modulus", MODULUS, NULL}, {"thickness", THICKNESS, NULL}, {"areal_density", 0.2, NULL}};
    static const drape_setting integrator[] = {{"dt", 1e6, NULL}, {"tolerance", 1e-11, NULL}};
    static const drape_entry_def terms[] = {{"stretch.edge", NULL, 0}};
    scoped_scene rest = sheet("consistent"), s = scene_empty();
    drape_cloth_def cloth = cloth_def();
    drape_scene_def def = scene_def();
    size_t count = 0;
    deform(&rest, F);
    for (int32_t i = 0; i < rest.model->node_count; i++) {
        if (!on_boundary(i))
            continue;
        drape_pin_def_init(&pins[count], sizeof pins[count]);
        nodes[count] = i;
        for (size_t c = 0; c < 3; c++)
            keys[count].displacement[c] =
                scene_state(&rest)->x[3 * (size_t)i + c] - rest.model->rest[3 * (size_t)i + c];
        pins[count].nodes = &nodes[count];
        pins[count].node_count = 1;
        pins[count].track = &keys[count];
        pins[count].key_count = 1;
        count++;
    }
    cloth.mesh.grid = (drape_entry_def){"equilateral", grid, 2};
    cloth.material = material;
    cloth.material_count = 3;
    cloth.terms = terms;
    cloth.term_count = 1;
    cloth.pins = pins;
    cloth.pin_count = count;
    def.cloths = &cloth;
    def.cloth_count = 1;
    memset(def.gravity, 0, sizeof def.gravity);
    def.integrator = (drape_entry_def){"be", integrator, 2};
    def.frame_rate = 1e-6;
    assert_ok(s.ctx, drape_model_create(s.ctx, &def, &s.model));
    scene_start(&s, NULL);
    /* Start with the inner nodes displaced, out of the plane too. */
    for (int32_t i = 0; i < s.model->node_count; i++)
        for (int c = 0; c < 3 && !on_boundary(i); c++)
            scene_state(&s)->x[3 * (size_t)i + (size_t)c] =
                scene_state(&rest)->x[3 * (size_t)i + (size_t)c] + 1e-3 * sin(7 * i + 3 * c);
    scene_watch(&s);
    scene_advance(&s, 3e6);
    double worst = 0;
    for (size_t i = 0; i < 3 * (size_t)s.model->node_count; i++)
        worst = fmax(worst, fabs(scene_state(&s)->x[i] - scene_state(&rest)->x[i]));
    /* Error <= residual / smallest eigenvalue. Out of the plane every spring resists with K q/(1 + q), q >=
     * 0.04, which is the weakest stiffness; the membrane's lowest mode over EDGES cells has at least 2
     * (pi/EDGES)^2 of it. The residual of all DOFs adds up as sqrt(3 x 25 inner nodes). */
    const double weakest = sqrt(3.0) / 2 * membrane * 0.04 / 1.04 * 2 * pow(3.14159265 / EDGES, 2);
    const double noise = force_noise(sqrt(3.0) / 2 * membrane, 2 * (EDGES + 1) * LENGTH);
    assert_below(worst, sqrt(75) * (s.residual + noise) / weakest);
}

/* W = 1/2 E h/(1 - nu^2) ((1 - nu) S:S + nu (tr S)^2), nu = 1/3, S the symmetric displacement gradient. q
 * = u.Su + r with |r| <= |S|^2/2 (1 + |S|), so W is wrong by at most 3/2 E h |S|^3 (1 + 2 |S|); |S| <=
 * sqrt(S:S). */
TEST(energy_is_that_of_the_plane_stress_sheet)
{
    static const double strains[][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 0.5}, {0.631, -0.417, 0.283}};
    static const double sizes[] = {1e-2, 1e-3, 1e-4};
    scoped_scene s = sheet("consistent");
    const double area = 2 * EDGES * EDGES * sqrt(3.0) / 4 * LENGTH * LENGTH, nu = 1.0 / 3;
    for (size_t k = 0; k < sizeof strains / sizeof *strains; k++)
        for (size_t j = 0; j < sizeof sizes / sizeof *sizes; j++) {
            const double a = sizes[j] * strains[k][0], b = sizes[j] * strains[k][1],
                         c = sizes[j] * strains[k][2];
            deform(&s, (const double[9]){1 + a, 0, c, 0, 1, 0, c, 0, 1 + b});
            const double squared = a * a + b * b + 2 * c * c, size = sqrt(squared);
            const double sheet_energy =
                0.5 * membrane / (1 - nu * nu) * ((1 - nu) * squared + nu * (a + b) * (a + b)) * area;
            assert_below(fabs(elastic(&s) - sheet_energy),
                         1.5 * membrane * area * pow(size, 3) * (1 + 2 * size));
        }
}
