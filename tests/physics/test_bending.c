/*
 * test_bending.c: the plate that the hinges of bend.hinge model.
 *
 * Let b (2 x 2) be the second derivatives of a small deflection. On the equilateral lattice with edge l it
 * opens the hinge along direction t, with n normal to it in the plane, by theta = sqrt(3)/2 l (b_nn -
 * b_tt/3). With k = (2/sqrt(3)) D the energy per area is 1/2 D sum (b_nn - b_tt/3)^2 over the three
 * directions, which is
 *     W = 1/2 D ((tr b)^2 - 8/3 det b):
 * an isotropic plate with nu = -1/3. The deflections of plates and strips are checked by the references of
 * `drape validate`: cantilever, end_load, plate_supported, plate_hinges.
 */
#include "mesh/mesh.h"
#include "support/scene.h"

#define MODULUS   1e3 /* [Pa]; soft and thick: rounding of the membrane is below the hinge forces */
#define THICKNESS 0.1
#define DENSITY   0.2 /* per area */

static const double rigidity =
    MODULUS * THICKNESS * THICKNESS * THICKNESS / (12 * (1 - 1.0 / 9)); /* D [N m] */

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
TEST(rolled_sheet_has_the_energy_of_the_plate)
{
    static const double angles[] = {0, 0.3, 0.5235987755982988, 1.1, 1.5707963267948966};
    scoped_scene s = flat_grid();
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
}

/* A paraboloid y = 1/2 X.bX so shallow that slopes are below 1e-3: all is linear except for their squares. */
TEST(double_curvature_has_the_energy_of_the_plate)
{
    static const double bends[][3] = {{1, 0, 0}, {1, 1, 0}, {1, -1, 0}, {0, 0, 1}, {0.613, -0.241, 0.377}};
    scoped_scene s = flat_grid();
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
}
