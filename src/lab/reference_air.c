/* reference_air.c: sheets in air, by drag.wind and air.added_mass. */
#include "lab/sheet.h"

#include <math.h>

/* ---- Terminal velocity ----
 *
 * A sheet falls, 0.1 kg/m2 in air of 1.225 kg/m3: broadside by either law of the normal force, which agree
 * there, or edge-on, where there is friction only. It approaches sqrt(2 m g/(rho C)) as tanh(g t/V), up to
 * e^(-2 g t/V) < 1e-7 in the time that is computed, whatever the steps. */

enum { FALLS_SQUARE, FALLS_PLATE, FALLS_EDGE_ON };

static double coefficient_of(double how)
{
    return how < FALLS_PLATE ? 1.17 : how < FALLS_EDGE_ON ? 0.88 : 0.2;
}

static double terminal_expected(double how)
{
    return sqrt(2 * 0.1 * 9.81 / (1.225 * coefficient_of(how)));
}

static int terminal_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    const bool edge_on = c->parameter >= FALLS_EDGE_ON;
    return SHEET_TEXT(text, .columns = 5, .rows = 5, .width = 0.2, .height = 0.2,
                      .mesh = edge_on ? "'orientation': 'vertical'" : NULL, .young_modulus = 1e6,
                      .poisson_ratio = 0.3, .thickness = 0.001, .areal_density = 0.1,
                      .terms =
                          SHEET_FORMAT("'stretch.cst', 'bend.midedge', {'type': 'drag.wind', 'law': '%s', "
                                       "'%s': %g}",
                                       c->parameter < FALLS_PLATE ? "square" : "plate",
                                       edge_on ? "friction" : "coefficient", coefficient_of(c->parameter)),
                      .gravity = {0, -9.81, 0}, .integrator = "'method': 'trbdf2'", .dt = 0.01,
                      .tolerance = 1e-10, .duration = 4);
}

/* The mean speed downwards. */
static double speed(const drape_reference_run *run)
{
    return -lab_mean(run, drape_sim_velocities(run->sim), 1);
}

DRAPE_REFERENCE(terminal_velocity, .entry.summary = "speed at which a sheet falls in air", .unit = "m/s",
                .parameter = "0 broadside, square law, 1 plate law, 2 edge-on",
                DRAPE_CASES(FALLS_SQUARE, FALLS_PLATE, FALLS_EDGE_ON),
                .model = "stretch.cst, bend.midedge, drag.wind; irregular; trbdf2",
                .entry.reference = "sqrt(2 m g/(rho C)), m the mass per area", .tolerance = 0.001,
                .expected = terminal_expected, .scene = terminal_scene, .value = speed);

/* ---- Flutter ----
 *
 * A strip, hinged at both ends, in wind along it. At small angles the law "plate" is, with k = rho C (4 +
 * pi)/8,
 *     m w_tt + B w_xxxx + k U (U w_x + w_t) = 0,
 * the equation of a panel in supersonic flow by linear piston theory, whose first two modes coalesce at k U^2
 * L^3/B = 343.36 (Hedgepeth 1957; 343.356 by 40 sines). The damping k U w_t adds 0.02 % here, where it is
 * half of sqrt(B m)/L^2. The implicit midpoint rule is stable exactly where the equation is, at any step. The
 * law "square" has no such onset: its force is of second order in the angle. */

#define MASS    1.0 /* [kg/m2]; B = 1 N m, L = 1 m: the onset is at a frequency of 32 rad/s */
#define FLUTTER 343.356
#define KAPPA   (0.25 / FLUTTER) /* k [kg/m3]: k U = sqrt(k^2 U^2) = sqrt(k 343) = 0.5 at the onset */
#define SECONDS 8.0
#define START   1e-6 /* [m/s]: angles stay below 1e-3 until the strip is seen to flutter */
#define RIBBON                                                                                               \
    .columns = 41, .rows = 3, .width = 1, .height = 0.05, .young_modulus = 12 / (0.02 * 0.02 * 0.02),        \
    .thickness = 0.02, .dt = 0.01, .tolerance = 1e-12

static int flutter_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    return SHEET_TEXT(text, RIBBON, .areal_density = MASS,
                      .terms =
                          SHEET_FORMAT("'stretch.cst', 'bend.midedge', {'type': 'drag.wind', 'law': 'plate', "
                                       "'density': %.17g, 'coefficient': 1, 'wind': [%.17g, 0, 0]}",
                                       8 * KAPPA / (4 + DRAPE_PI), sqrt(c->load / KAPPA)),
                      .pins = "{'edge': 'left'}, {'edge': 'right', 'normal': [0, 1, 0]}",
                      .integrator = "'method': 'midpoint'", .duration = SECONDS);
}

/* Advances; returns the largest deflection of the states that are passed. */
static double largest_until(drape_reference_run *run, double end, drape_status *status)
{
    const int32_t nodes = drape_model_node_count(run->model);
    double largest = 0;
    for (double t = drape_sim_time(run->sim); !*status && t < end - 1e-6; t += 0.02) {
        *status = drape_sim_advance(run->sim, t + 0.02);
        for (int32_t i = 0; i < nodes; i++)
            largest = fmax(largest, fabs(drape_sim_positions(run->sim)[3 * (size_t)i + 1]));
    }
    return largest;
}

/* Returns 1 if deflections grow from the second quarter of the time to the last, or thousandfold before.
 * Below the onset they beat, with a period of a second, and decay, by e^-1 between these. */
static drape_status measure_flutter(drape_reference_run *run, double *value)
{
    const size_t n = 3 * (size_t)drape_model_node_count(run->model);
    const double *x = drape_sim_positions(run->sim), end = drape_model_duration(run->model);
    double *v = drape_arena_take(&run->arena, n, sizeof *v);
    for (size_t i = 0; v && i < n; i += 3)
        v[i + 1] = START * (sin(DRAPE_PI * x[i]) + sin(2 * DRAPE_PI * x[i]));
    drape_status status = v ? lab_settle(run, v) : DRAPE_E_MEMORY;
    const double first = largest_until(run, end / 4, &status), second = largest_until(run, end / 2, &status);
    *value = second > 1000 * first;
    if (status || *value > 0)
        return status;
    const double third = largest_until(run, 3 * end / 4, &status);
    *value = third > 1000 * first || (largest_until(run, end, &status) > second);
    return status;
}

DRAPE_REFERENCE(strip_flutter,
                .entry.summary = "k U^2 L^3/B at which a hinged strip flutters in wind along it", .unit = "1",
                DRAPE_CASES(0),
                .model = "stretch.cst, bend.midedge, drag.wind with the law plate; irregular; midpoint",
                .entry.reference = "Hedgepeth 1957, Flutter of rectangular simply supported panels at high "
                                   "supersonic speeds: 343.36, by linear piston theory, to which the law is "
                                   "equal at small angles",
                .tolerance = 0.01, DRAPE_KNOWN(FLUTTER), .scene = flutter_scene, .measure = measure_flutter,
                .low = 0.85, .high = 1.15);

/* ---- Flutter of a flag ----
 *
 * A ribbon in wind along it, clamped at its upstream edge, free downstream. In slender-body theory
 *     m w_tt + m_a (d/dt + U d/dx)^2 w - (T w_x)_x + B w_xxxx = 0,
 * with w_xx = w_xxx = 0 at the free end, where the wake takes the momentum of the air. It is the equation of
 * a pipe that conveys m_a per area (Lemaitre, Hemon & de Langre 2005; Paidoussis 1998), whose onsets u = U L
 * sqrt(m_a/B) depend on b = m_a/(m + m_a) and, for one that hangs, g = (m + m_a) g L^3/B, the weight of both
 * (here it is that of the sheet). Those at g = 0 are by a Galerkin method with 14 polynomials, which has the
 * published 6.15 and 5.62 of two that hang to all their digits. Here L, B, and m + m_a are 1. */

static const struct {
    double mass_ratio, weight, seconds;
} flags[] = {{0.2, 0, 12}, {0.5, 0, 6}, {2.03e-3, 42.4, 20}};

static int flag_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    const int which = (int)c->parameter;
    const double b = flags[which].mass_ratio;
    return SHEET_TEXT(text, RIBBON, .areal_density = 1 - b,
                      .terms = SHEET_FORMAT("'stretch.cst', 'bend.midedge', {'type': 'air.added_mass', "
                                            "'span': 0.05, 'density': %.17g, 'wind': [%.17g, 0, 0]}",
                                            b / (0.05 * DRAPE_PI / 4), c->load / sqrt(b)),
                      .pins = "{'edge': 'left', 'clamp': true}",
                      .gravity = {flags[which].weight / (1 - b), 0, 0}, .integrator = "'method': 'trbdf2'",
                      .duration = flags[which].seconds);
}

DRAPE_REFERENCE(flag_flutter, .entry.summary = "U L sqrt(m_a/B) at which a ribbon flutters in wind along it",
                .unit = "1", .parameter = "0 m_a/(m + m_a) 0.2, 1 0.5, 2 hanging, 0.00203",
                DRAPE_CASES(0, 1, 2), .model = "stretch.cst, bend.midedge, air.added_mass; irregular; trbdf2",
                .entry.reference = "slender-body theory, the equation of pipes that convey fluid: Paidoussis "
                                   "1970, Dynamics of tubular cantilevers conveying fluid: 5.62 hanging",
                .tolerance = 0.01, DRAPE_KNOWN(5.5914, 9.3224, 5.62), .scene = flag_scene,
                .measure = measure_flutter, .low = 0.9, .high = 1.1);
