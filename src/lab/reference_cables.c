/* reference_cables.c: heavy strips that hardly resist bending: a catenary, and a hanging chain. */
#include "lab/sheet.h"

#include <gsl/gsl_sf_bessel.h>
#include <math.h>

/* ---- The sag of a strip of length 1.2 m between ends 1 m apart ---- */

/* The right end starts at 1.2 m and is moved to 1 m. */

static drape_status measure_sag(drape_reference_run *run, double *value)
{
    const size_t nodes = (size_t)drape_model_node_count(run->model);
    double *v = drape_arena_take(&run->arena, 3 * nodes, sizeof *v);
    DRAPE_TRY(v ? lab_advance(run) : DRAPE_E_MEMORY);
    DRAPE_TRY(lab_settle(run, v));
    *value = 0;
    for (size_t i = 0; i < nodes; i++)
        *value = fmax(*value, -drape_sim_positions(run->sim)[3 * i + 1]);
    return DRAPE_OK;
}

DRAPE_REFERENCE(catenary, .entry.summary = "sag of 1.2 m over a span of 1 m", .unit = "m", DRAPE_CASES(0),
                .model = "stretch.cst, bend.midedge; irregular",
                .entry.reference = "2 a sinh(s/(2 a)) = L, sag a (cosh(s/(2 a)) - 1)", .tolerance = 0.001,
                DRAPE_KNOWN(0.29234379760092882), .measure = measure_sag,
                SHEET(.columns = 61, .rows = 3, .width = 1.2, .height = 0.04, .young_modulus = 1e7,
                      .thickness = 1e-3, .areal_density = 0.1,
                      .terms = "'stretch.cst', {'type': 'bend.midedge', 'warp': 1e-6, 'weft': 1e-6}",
                      .pins = "{'edge': 'left'}, "
                              "{'edge': 'right', 'track': [[0, [0, 0, 0]], [1, [-0.2, 0, 0]]]}",
                      .gravity = {0, -GRAVITY, 0}, .integrator = "'method': 'be'", .dt = 0.02,
                      .tolerance = 1e-5, .duration = 1.6));

/* ---- Frequencies of a hanging chain of 1 m ----
 *
 * The strip starts from equilibrium with the velocity of a mode; the zero crossings of the mode's amplitude
 * give the time of two periods. Steps are 1/200 of a period: the implicit midpoint rule is slow by (2
 * pi/200)^2/12 = 8e-5. The strip is 0.05 % longer than at rest. */

#define STEPS 200  /* of a period */
#define SPEED 1e-2 /* [m/s] of the free end */
#define CHAIN                                                                                                \
    .columns = 3, .rows = 81, .width = 0.025, .height = 1, .mesh = "'orientation': 'vertical'",              \
    .young_modulus = 1e6, .thickness = 1e-3, .areal_density = 0.1, .terms = "'stretch.cst'",                 \
    .pins = "{'edge': 'top'}", .gravity = {0, -GRAVITY, 0}

/* omega [rad/s]: u = J0(2 omega sqrt(s/g)), s from the free end */
static double frequency(double mode)
{
    return gsl_sf_bessel_zero_J0((unsigned)mode) / 2 * sqrt(GRAVITY);
}

static double step_size(double mode)
{
    return 2 * DRAPE_PI / frequency(mode) / STEPS;
}

static int chain_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    return SHEET_TEXT(text, CHAIN, .integrator = "'method': 'midpoint'", .dt = step_size(c->parameter),
                      .tolerance = 1e-10, .others = "'controller': {'type': 'fixed'}");
}

static drape_status measure_frequency(drape_reference_run *run, double *value)
{
    const size_t n = 3 * (size_t)drape_model_node_count(run->model);
    const double *rest = drape_model_rest_positions(run->model), dt = step_size(run->parameter);
    const double zero = gsl_sf_bessel_zero_J0((unsigned)run->parameter);
    double *v = drape_arena_take(&run->arena, n, sizeof *v), now = 0, crossing = 0;
    int found = 0;
    for (size_t i = 0; v && i < n; i += 3)
        v[i + 2] = SPEED * (rest[i + 1] < 0 ? gsl_sf_bessel_J0(zero * sqrt(fmax(0, 1 + rest[i + 1]))) : 0);
    drape_status status = v ? lab_settle(run, v) : DRAPE_E_MEMORY;
    for (int k = 1; !status && found < 4 && k < 4 * STEPS; k++) {
        const double before = now;
        status = drape_sim_advance(run->sim, k * dt);
        /* The amplitude of a mode: other modes are orthogonal to it in the mass matrix. */
        const double *mass = drape_model_masses(run->model), *x = drape_sim_positions(run->sim);
        now = 0;
        for (size_t i = 0; i < (size_t)drape_model_node_count(run->model); i++)
            now += mass[i] * v[3 * i + 2] * x[3 * i + 2];
        if (before * now < 0) {
            crossing = (k - 1 + before / (before - now)) * dt;
            found++;
        }
    }
    *value = found == 4 ? 4 * DRAPE_PI / crossing : NAN; /* four crossings after the start: two periods */
    return status;
}

DRAPE_REFERENCE(chain, .entry.summary = "frequency of a hanging chain", .unit = "rad/s", .parameter = "mode",
                DRAPE_CASES(1, 2, 3), .model = "stretch.cst; irregular; midpoint",
                .entry.reference = "omega_n = j_0n/2 sqrt(g/L); D. Bernoulli 1733", .tolerance = 0.005,
                .expected = frequency, .scene = chain_scene, .measure = measure_frequency);

/* The same by drape_sim_modes, of those that move the chain along z. */
DRAPE_REFERENCE(chain_modes, .entry.summary = "frequency of a hanging chain, as a mode", .unit = "rad/s",
                .parameter = "mode", DRAPE_CASES(1, 2, 3), .model = "stretch.cst; irregular; modes",
                .entry.reference = "omega_n = j_0n/2 sqrt(g/L); D. Bernoulli 1733", .tolerance = 0.005,
                .expected = frequency, SHEET(CHAIN, .tolerance = 1e-9), .measure = lab_omega,
                .constants = {3, 16, 1});
