/*
 * test_loss.c: the loss of measured fabrics. A strip of a fabric, clamped at one end and as long as makes its
 * first frequency that of the fabric, L = c, vibrates freely without gravity: it loses what the loss factor
 * says, exp(-2 pi eta n) in n cycles, and nothing with "damping": "none". A scene's own losses replace that
 * of the fabric, and verlet leaves it out.
 */
#include "base/pi.h"
#include "compile/fabrics.h"
#include "support/scene.h"

#define ROOT   1.8751040687 /* first root of cosh x cos x = -1 */
#define CYCLES 3
#define STEPS  100 /* a cycle */

static const drape_fabric *find(const char *name)
{
    const drape_fabric *f = drape_fabrics;
    while (f->name && strcmp(f->name, name) != 0)
        f++;
    ck_assert_ptr_nonnull(f->name);
    return f;
}

/* The first mode of a cantilever at s = x/L. */
static double mode(double s)
{
    const double a = ROOT * s, ratio = (cosh(ROOT) + cos(ROOT)) / (sinh(ROOT) + sin(ROOT));
    return cosh(a) - cos(a) - ratio * (sinh(a) - sin(a));
}

/* The energy left after CYCLES of a strip along the warp with the loss factor eta, as a share of that at the
 * start. *dissipated: the share that went by the account. */
static double ring(const drape_fabric *f, const char *damping, double eta, double *dissipated)
{
    const double length = cbrt(f->bending.warp / (f->areal_density * 9.80665)),
                 omega = sqrt(f->bending.warp / f->areal_density) * pow(ROOT / length, 2),
                 period = 2 * DRAPE_PI / (omega * sqrt(1 - eta * eta / 4));
    scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 41, 'rows': 5, 'width': %.17g,"
        " 'height': %.17g}, 'material': {'fabric': '%s'%s}, 'terms': ['stretch.cst', 'bend.midedge'],"
        " 'pins': [{'edge': 'left', 'clamp': true}]}], 'gravity': [0, 0, 0], 'duration': 9,"
        " 'integrator': {'method': 'midpoint', 'dt': %.17g, 'tolerance': 1e-12}}",
        length, length / 10, f->name, damping, period / STEPS);
    const int32_t nodes = drape_model_node_count(s.model);
    const double *x = drape_model_rest_positions(s.model);
    double *v = calloc(3 * (size_t)nodes, sizeof *v), left = INFINITY;
    ck_assert_ptr_nonnull(v);
    for (int32_t i = 0; i < nodes; i++)
        left = fmin(left, x[3 * i]);
    for (int32_t i = 0; i < nodes; i++) /* the normal is y; the end moves by 0.1 % of the length */
        v[3 * i + 1] = 5e-4 * length * omega * mode((x[3 * i] - left) / length);
    ck_assert_int_eq(drape_sim_set_state(s.sim, 0, x, v), DRAPE_OK);
    free(v);
    const drape_energy start = drape_sim_energy(s.sim);
    scene_advance(&s, CYCLES * period);
    const drape_energy end = drape_sim_energy(s.sim);
    scene_close(&s);
    *dissipated = end.dissipated / start.kinetic;
    return (end.kinetic + end.elastic) / start.kinetic;
}

/* The first frequency of the strip is right to delta, 0.5 % (beam_frequency of `drape validate`). The rate of
 * Kelvin-Voigt damping is beta omega^2/2, so eta is off by twice that; and the last cycle ends by CYCLES
 * delta off, where the energy is off its mean course by eta/2 sin 2 omega t: once more delta. */
TEST(a_strip_loses_what_the_fabric_says)
{
    static const char *const names[] = {"matsudaira2015_wool", "matsudaira2015_broad", "feng2022_18",
                                        "wang2011_tshirt"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        double dissipated;
        const drape_fabric *f = find(names[i]);
        drape_fabric along =
            *f; /* eta is that of the mean of warp and weft, and the strip is along the warp */
        along.bending.weft = along.bending.warp;
        const double share = drape_fabric_frequency(&along) / drape_fabric_frequency(f),
                     eta = share * drape_fabric_loss(f), left = ring(f, "", eta, &dissipated),
                     found = -log(left) / (2 * DRAPE_PI * CYCLES) * sqrt(1 - eta * eta / 4);
        ck_assert_msg(fabs(found / eta - 1) < 3 * 0.005, "%s: a loss factor of %g, not %g", names[i], found,
                      eta);
        ck_assert_double_eq_tol(left + dissipated, 1, 1e-3); /* midpoint: (omega h)^2/4 */
    }
}

/* midpoint conserves quadratic energies; that of bending is quartic in the tip's 0.1 %. */
TEST(an_elastic_sheet_loses_nothing)
{
    double dissipated;
    ck_assert_double_eq_tol(ring(find("matsudaira2015_wool"), ", 'damping': 'none'", 0, &dissipated), 1,
                            1e-5);
    ck_assert_double_eq(dissipated, 0);
}

/* The loss factors of published loops, 4/pi HB/(250 B + HB) of B and 2HB in gf cm2/cm and gf cm/cm; of others
 * the median of these. Frequencies of strips of one to three centimetres. */
TEST(losses_are_those_published)
{
    ck_assert_double_eq_tol(drape_fabric_loss(find("matsudaira2015_wool")),
                            4 / DRAPE_PI * 0.0165 / (2.5 * 0.067 + 0.0165), 1e-12);
    ck_assert_double_eq_tol(drape_fabric_loss(find("matsudaira2015_faille")),
                            4 / DRAPE_PI * 0.0035 / (2.5 * 0.019 + 0.0035), 1e-12);
    ck_assert_double_eq(drape_fabric_loss(find("wang2011_denim")), 0.1);
    const double median = (drape_fabric_loss(find("matsudaira2015_wool")) +
                           drape_fabric_loss(find("matsudaira2015_tropical"))) /
                          2;
    ck_assert_double_eq_tol(drape_fabric_loss(find("feng2022_1")), median, 0.002);
    for (const drape_fabric *f = drape_fabrics + 1; f->name; f++) {
        const double hertz = drape_fabric_frequency(f) / (2 * DRAPE_PI);
        ck_assert(hertz > 9 && hertz < 20 && drape_fabric_loss(f) > 0.05 && drape_fabric_loss(f) < 0.3);
    }
}

/* The retardation time that acts on a cloth; 0: none. */
static double time_of(const char *material, const char *terms)
{
    scene s =
        scene_model("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 3, 'rows': 3, 'width': 1,"
                    " 'height': 1}, 'material': {%s}, 'terms': [%s]}], 'duration': 1}",
                    material, terms);
    double time = 0;
    for (int32_t i = 0; i < s.model->term_count; i++)
        if (s.model->terms[i].ops->from_fabric)
            time += s.model->terms[i].params[0];
    ck_assert(s.model->has_dissipation == (time > 0) || strchr(terms, '{'));
    scene_close(&s);
    return time;
}

#define WOOL "'fabric': 'matsudaira2015_wool'"

TEST(own_losses_replace_that_of_a_fabric)
{
    const drape_fabric *wool = find("matsudaira2015_wool");
    const double time = drape_fabric_loss(wool) / drape_fabric_frequency(wool);
    ck_assert(time > 1e-3 && time < 2e-3);
    ck_assert_double_eq(time_of(WOOL, "'stretch.edge', 'bend.hinge'"), time);
    ck_assert_double_eq(time_of(WOOL ", 'damping': 'fabric'", "'stretch.cst', 'bend.midedge'"), time);
    /* air is not of the fabric, springs without dashpots lose nothing, and a given stiffness is no loss */
    ck_assert_double_eq(time_of(WOOL, "'stretch.cst', {'type': 'drag.viscous', 'coefficient': 1}"), time);
    ck_assert_double_eq(time_of(WOOL, "{'type': 'spring.structural', 'stiffness': 20}"), time);
    ck_assert_double_eq(time_of(WOOL ", 'young_modulus': 1e5, 'thickness': 1e-3", "'stretch.cst'"), time);
    ck_assert_double_eq(time_of(WOOL, "'stretch.cst', {'type': 'damp.kelvin_voigt', 'beta': 0.25}"), 0.25);
    ck_assert_double_eq(
        time_of(WOOL, "'stretch.cst', {'type': 'relax.maxwell', 'fraction_1': 0.2, 'time_1': 1}"), 0);
    ck_assert_double_eq(time_of(WOOL, "{'type': 'spring.structural', 'stiffness': 20, 'damping': 0.1}"), 0);
    ck_assert_double_eq(time_of(WOOL, "'stretch.cst', {'type': 'bend.midedge', 'poisson': 0, 'friction': 25,"
                                      " 'friction_curvature': 4}"),
                        0);
    ck_assert_double_eq(time_of(WOOL ", 'damping': 'none'", "'stretch.cst', 'bend.midedge'"), 0);
    ck_assert_double_eq(time_of(WOOL, ""), 0); /* nothing to act on */
    ck_assert_double_eq(time_of("'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200", "'stretch.cst'"),
                        0);
}

/* The energy that a falling sheet dissipates under verlet, and in *position a number of where it ends. */
static double dissipated_by_verlet(const char *material, const char *terms, double *position)
{
    scene s =
        scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 7, 'rows': 7, 'width': 0.2,"
                   " 'height': 0.2}, 'material': {%s}, 'terms': [%s], 'pins': [{'corner': 'top-left'}]}],"
                   " 'duration': 1, 'integrator': {'method': 'verlet'}}",
                   material, terms);
    scene_advance(&s, 0.1);
    const double dissipated = drape_sim_energy(s.sim).dissipated;
    *position = 0;
    for (int i = 0; i < 3 * 49; i++)
        *position += (i + 1) * drape_sim_positions(s.sim)[i];
    scene_close(&s);
    return dissipated;
}

/* The same bits as of an elastic sheet, with air and without; a law that the scene names acts. */
TEST(verlet_leaves_the_loss_of_a_fabric)
{
    static const char *const terms[] = {
        "'stretch.edge', 'bend.hinge'", "'stretch.cst', 'bend.midedge'",
        "'stretch.cst', 'bend.midedge', {'type': 'drag.viscous', 'coefficient': 0.1}"};
    double elastic, fabric;
    for (int i = 0; i < 3; i++) {
        const double lost = dissipated_by_verlet(WOOL ", 'damping': 'none'", terms[i], &elastic);
        ck_assert((i == 2) == (lost > 0));
        ck_assert_double_eq(dissipated_by_verlet(WOOL, terms[i], &fabric), lost);
        ck_assert_double_eq(fabric, elastic);
    }
    ck_assert(dissipated_by_verlet(WOOL, "'stretch.edge', {'type': 'damp.kelvin_voigt', 'beta': 1e-5}",
                                   &fabric) > 0);
}
