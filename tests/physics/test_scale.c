/*
 * test_scale.c: cloth of any size and weight moves as it should, by default settings: a sheet of
 * fine mesh that falls freely, and clamped strips that sag, from 1 mm to 100 m and from 1e-4 to 10 kg/m2, by
 * every integrator.
 *
 * Scenes are similar: lengths are in units of the size L, times of sqrt(L/g), and the stiffnesses follow the
 * weight. So each number below is the same for all of them up to rounding, unless an absolute constant acts.
 */
#include "integrators/integrator.h"
#include "support/scene.h"

#define G 9.81

static const double sizes[] = {1e-3, 1e-2, 1, 100}, densities[] = {1e-4, 1e-2, 10};
#define COUNT(a) ((int)(sizeof(a) / sizeof *(a)))

/* ---- Free fall ---- */

/* Backward Euler falls g h^2 k (k + 1)/2 in k steps, its variant with k iterations the same, bdf2, whose
 * first step is backward Euler, 3/8 g h^2 more than g t^2/2 less what its next steps take back. */
static double mean_fall(const scene *s)
{
    const double *x = drape_sim_positions(s->sim), *rest = drape_model_rest_positions(s->model);
    double sum = 0;
    for (int32_t i = 0; i < s->model->node_count; i++)
        sum += rest[3 * i + 1] - x[3 * i + 1];
    return sum / s->model->node_count;
}

/* ---- The handkerchief ---- */

TEST(a_fine_handkerchief_falls)
{
    const double t = 0.1, h = 0.01;
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 100, 'rows': 100, 'width': 0.1,"
        "'height': 0.1}, 'material': {'young_modulus': 1e6, 'thickness': 2e-4, 'areal_density': 0.05},"
        "'terms': ['stretch.edge', 'bend.hinge']}], 'integrator': {'method': 'newton_k', 'dt': %g},"
        "'duration': 1}",
        h);
    scene_advance(&s, t);
    ck_assert_msg(fabs(mean_fall(&s) / (G * t * (t + h) / 2) - 1) < 0.01, "fell %g m", mean_fall(&s));
}

/* ---- Clamped strips ---- */

/* Sag of the tip over the length of an elastica with weight w L^3/D = 3 that is clamped horizontally: from
 * th'' = -3 (1 - s) cos th, th(0) = th'(1) = 0, by the classical Runge-Kutta method and shooting, 2 000
 * steps. */
#define LOAD 3.0
#define SAG  0.3396483639528495

static double strip_sag(const scene *s, double size)
{
    const double *x = drape_sim_positions(s->sim), *rest = drape_model_rest_positions(s->model);
    double low = 0, high = -INFINITY, sum = 0;
    int count = 0;
    for (int32_t i = 0; i < s->model->node_count; i++) {
        low = fmin(low, rest[3 * i]);
        high = fmax(high, rest[3 * i]);
    }
    for (int32_t i = 0; i < s->model->node_count; i++)
        if (rest[3 * i] > high - 1e-6 * size) {
            sum += rest[3 * i + 1] - x[3 * i + 1];
            count++;
        }
    return sum / count / size;
}

/* rate: of a viscous drag [1/s]. */
static scene open_strip(double size, double density, double thinness, double rate, const char *integrator)
{
    const double thickness = thinness * size, d = density * G * size * size * size / LOAD;
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 20, 'rows': 3, 'width': %.17g,"
        "'height': %.17g, 'orientation': 'horizontal'}, 'material': {'young_modulus': %.17g,"
        "'poisson_ratio': 0, 'thickness': %.17g, 'areal_density': %.17g},"
        "'terms': ['stretch.cst', 'bend.midedge', {'type': 'drag.viscous', 'coefficient': %.17g}], 'pins': "
        "[{'edge': 'left', 'clamp': true}]}],"
        "'gravity': [0, %.17g, 0], 'integrator': {%s}, 'duration': 1}",
        size, 0.2 * size, 12 * d / (thickness * thickness * thickness), thickness, density, rate * density,
        -G, integrator);
}

/* The mesh of 20 x 3 nodes has a tip 0.24 % below the elastica's. */
TEST(strips_sag_in_equilibrium)
{
    for (int i = 0; i < COUNT(sizes); i++)
        for (int k = 0; k < COUNT(densities); k++) {
            scoped_scene s = open_strip(sizes[i], densities[k], 1e-3, 0, "'method': 'static'");
            scene_advance(&s, 1);
            const double sag = strip_sag(&s, sizes[i]);
            ck_assert_msg(fabs(sag / SAG - 1) < 0.01, "%g m, %g kg/m2: sags %g of its length, not %g",
                          sizes[i], densities[k], sag, SAG);
        }
}

/* ---- Residuals and loads ---- */

/* The largest residual of an accepted step. */
static drape_status note_residual(void *user, const drape_event *event)
{
    double *share = user;
    if (event->kind == DRAPE_EVENT_ATTEMPT && event->attempt->accepted)
        *share = fmax(*share, event->attempt->residual);
    return DRAPE_OK;
}

/* A tolerance in newtons that is far above the weight of the cloth is limited to 1 % of it: a tenth of a gram
 * sags although 1 N is tolerated. The strip's rounding error is some 1e-10 of its load, so every step
 * converges. */
TEST(no_tolerance_hides_the_load)
{
    for (int m = 0; drape_integrators[m]; m++) {
        const drape_integrator_ops *method = drape_integrators[m];
        char integrator[100];
        double largest = 0, mass = 0;
        if (!method->tolerance || method->set_cheap)
            continue;
        snprintf(integrator, sizeof integrator, "'method': '%s', 'tolerance': 1", method->entry.name);
        scoped_scene s = open_strip(0.1, 0.05, 0.05, 40, integrator);
        for (int32_t i = 0; i < s.model->free_count; i++)
            mass += s.model->mass[s.model->node_of_free[i]] / s.model->free_count;
        ck_assert_int_eq(drape_sim_observe(s.sim, note_residual, &largest), DRAPE_OK);
        scene_advance(&s, 1);
        const double tolerance = drape_sim_statistics(s.sim).tolerance, sag = strip_sag(&s, 0.1);
        ck_assert_double_eq_tol(tolerance, 0.01 * mass * G, 1e-12 * mass * G);
        ck_assert_double_le(largest, tolerance);
        /* the share of the load that is left without a reaction, and the 0.24 % of the mesh */
        ck_assert_msg(fabs(sag / SAG - 1) < 0.01 + 0.003, "%s: sags %g", method->entry.name, sag);
    }
}

/* A tolerance below the rounding error of the forces in a stiff strip, E h = 1e6 N/m: they cancel at rest,
 * and steps are accepted as soon as no iteration can gain, instead of being halved until the run stops. The
 * error is at most some 40 roundings of E h times 0.6 m, 40 x 1.1e-16 x 6e5 N. */
TEST(rounding_of_stiff_strips_is_accepted)
{
    static const char *const methods[] = {"be", "trbdf2", "static"};
    for (int m = 0; m < COUNT(methods); m++) {
        double largest = 0;
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 12, 'edge_length': 0.05},"
            "'material': {'young_modulus': 1e9, 'thickness': 1e-3, 'areal_density': 0.2},"
            "'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'nodes': [0, 1]}]}],"
            "'integrator': {'method': '%s', 'dt': 0.01, 'tolerance': 1e-13}, 'duration': 1}",
            methods[m]);
        ck_assert_int_eq(drape_sim_observe(s.sim, note_residual, &largest), DRAPE_OK);
        scene_watch(&s);
        scene_advance(&s, 0.2);
        ck_assert_msg(s.rejected == 0 && largest > 1e-13 && largest < 3e-9, "%s: %ld rejected, residual %g N",
                      methods[m], s.rejected, largest);
    }
}

/* An equilibrium that is not reached: with on_failure accept, the best state of the flow, which is not called
 * converged. */
TEST(statics_end_at_their_best)
{
    double last = INFINITY;
    for (int steps = 1; steps <= 4; steps++) {
        char integrator[120];
        double residual = 0;
        snprintf(integrator, sizeof integrator,
                 "'method': 'static', 'max_pseudo_steps': %d, 'on_failure': 'accept'", steps);
        scoped_scene s = open_strip(0.1, 0.05, 1e-3, 0, integrator);
        ck_assert_int_eq(drape_sim_observe(s.sim, note_residual, &residual), DRAPE_OK);
        scene_watch(&s);
        scene_advance(&s, 1);
        ck_assert_int_eq(s.unconverged, 1);
        ck_assert_double_gt(residual, drape_sim_statistics(s.sim).tolerance);
        ck_assert_double_le(residual, last);
        last = residual;
    }
}

/* Cloth that nothing holds falls, and has no equilibrium; far from its start all digits of its forces are
 * lost, which must not be taken for convergence. */
TEST(what_falls_has_no_equilibrium)
{
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 41, 'rows': 5, 'width': 0.01, "
        "'height': 0.001}, 'material': {'young_modulus': 3.924e8, 'poisson_ratio': 0, "
        "'thickness': 1e-5, 'areal_density': 0.01}, 'terms': ['stretch.cst', "
        "'bend.midedge']}], 'duration': 1, 'integrator': {'method': 'static'}}");
    ck_assert_int_eq(drape_sim_advance(s.sim, 1), DRAPE_E_SOLVER);
}
