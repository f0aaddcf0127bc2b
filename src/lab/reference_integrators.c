/* reference_integrators.c: the solutions of time integrators for free fall and for a linear oscillation, step
 * by step, and periods of pendulums. */
#include "lab/sheet.h"

#include <complex.h>
#include <gsl/gsl_sf_ellint.h>
#include <math.h>

/* ---- Free fall ---- */

#define TIME 0.5

/* In n steps of backward Euler a sheet falls by g h^2 n (n + 1)/2, exactly. */
static double fallen(double n)
{
    return GRAVITY * TIME * TIME * (n + 1) / n / 2;
}

static int fall_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    return SHEET_TEXT(text, .columns = 4, .rows = 4, .width = 1, .height = 1, .young_modulus = 1e4,
                      .poisson_ratio = 0.3, .thickness = 1e-3, .areal_density = 0.1,
                      .gravity = {0, -GRAVITY, 0}, .integrator = "'method': 'be'", .dt = TIME / c->parameter,
                      .tolerance = 1e-12, .duration = TIME);
}

/* The limit allows for Newton's tolerance and rounding. */
DRAPE_REFERENCE(free_fall, .entry.summary = "distance fallen in 0.5 s", .unit = "m", .parameter = "steps",
                DRAPE_CASES(10, 100), .model = "stretch.cst, bend.midedge; irregular; be",
                .entry.reference = "sum of backward Euler's steps", .tolerance = 1e-9, .expected = fallen,
                .scene = fall_scene, .value = lab_sinking);

/* ---- An oscillator ----
 *
 * Two nodes on an elastic sheet whose other side is fixed: k = E h w/L = 1 N/m, and half of the mass of 1 kg
 * moves, so omega^2 = 2. The sheet starts at rest length; at strains of 1e-5 it is linear to 1e-5. */

#define SPEED       1e-5 /* [m/s] at the start */
#define OMEGA       1.41421356237309504880
#define PHASE_STEPS 50

static drape_status advance(drape_reference_run *run, int steps)
{
    return drape_sim_advance(run->sim, drape_sim_time(run->sim) + steps * run->parameter / OMEGA);
}

static double energy(const drape_reference_run *run)
{
    const drape_energy e = drape_sim_energy(run->sim);
    return e.kinetic + e.elastic;
}

/* The factor of the amplitude in a step, from energies. Constants: how many steps come before, how many are
 * measured, and whether the factor is that of the energy. */
static drape_status measure_amplitude(drape_reference_run *run, double *value)
{
    const int from = (int)run->reference->constants[0];
    const int steps = (int)run->reference->constants[1];
    drape_status status = from ? advance(run, from) : DRAPE_OK;
    const double before = energy(run);
    if (!status)
        status = advance(run, steps);
    *value = pow(energy(run) / before, (run->reference->constants[2] > 0 ? 1 : 0.5) / steps);
    return status;
}

/* The angle of a step over omega h: every method that advances x and v by one matrix of determinant 1 has
 * x(n+1) + x(n-1) = 2 cos(angle) x(n). */
static drape_status measure_phase(drape_reference_run *run, double *value)
{
    const size_t at = 3 * 2 + 2; /* z of a free node */
    double x[3] = {0}, product = 0, square = 0;
    drape_status status = DRAPE_OK;
    for (int k = 0; !status && k < PHASE_STEPS; k++) {
        status = advance(run, 1);
        x[0] = x[1], x[1] = x[2];
        x[2] = drape_sim_positions(run->sim)[at] - drape_model_rest_positions(run->model)[at];
        if (k < 2)
            continue;
        product += x[1] * (x[0] + x[2]);
        square += x[1] * x[1];
    }
    *value = acos(product / (2 * square)) / run->parameter;
    return status;
}

#define SPRING(method)                                                                                       \
    .grid = "square", .columns = 2, .rows = 2, .width = 1, .height = 1, .young_modulus = 1, .thickness = 1,  \
    .areal_density = 1, .material = "'mass': 'uniform'", .terms = "'stretch.cst'",                           \
    .pins = "{'edge': 'top'}", .velocity = "0, 0, -1e-5", .integrator = "'method': " method,                 \
    .tolerance = 1e-15, .others = "'controller': {'type': 'fixed'}", .duration = 1000
#define OSCILLATOR(method)                                                                                   \
    .unit = "1", .parameter = "omega h", .tolerance = 1e-4, SHEET(SPRING(method), VARIED(dt, 1 / OMEGA))
#define AMPLITUDE(method)                                                                                    \
    OSCILLATOR(method), .entry.summary = "fraction of the amplitude that a step leaves",                     \
                        .measure = measure_amplitude
#define PHASE(method)                                                                                        \
    OSCILLATOR(method), .entry.summary = "angle of a step over omega h", .measure = measure_phase

/* Backward Euler leaves this factor of the energy in each step. */
static double euler(double angle)
{
    return 1 / (1 + angle * angle);
}

DRAPE_REFERENCE(oscillator, OSCILLATOR("'be'"), .entry.summary = "fraction of the energy that a step leaves",
                DRAPE_CASES(0.1, 0.5, 2), .model = "stretch.cst; square; be",
                .entry.reference = "1/(1 + omega^2 h^2), of 1/(1 - i omega h)", .expected = euler,
                .measure = measure_amplitude, .constants = {0, 20, 1});

/* On z' = i omega z the formula 3/2 z1 - 2 z0 + 1/2 z_ = i omega h z1 has the roots (2 +- sqrt(1 + 2 i omega
 * h))/(3 - 2 i omega h). The larger is the factor of the amplitude per step once the other has decayed, to
 * less than 0.35^15 after the steps that are not measured. */
static double bdf2(double angle)
{
    const double complex z = I * angle;
    return cabs((2 + csqrt(1 + 2 * z)) / (3 - 2 * z));
}

DRAPE_REFERENCE(oscillator_bdf2, AMPLITUDE("'bdf2'"), DRAPE_CASES(0.1, 0.5, 2),
                .model = "stretch.cst; square; bdf2",
                .entry.reference = "roots of (3/2 - i omega h) r^2 - 2 r + 1/2; .990401 at omega h = .5",
                .expected = bdf2, .constants = {15, 10});

/* The stability function on the imaginary axis: R = (a1 (1 + w)/(1 - w) - a0)/(1 - w) with w = gamma z/2,
 * gamma = 2 - sqrt(2), a1 = 1/(gamma (2 - gamma)), a0 = a1 - 1. */
static double trbdf2(double angle)
{
    const double gamma = 2 - sqrt(2), a1 = 1 / (gamma * (2 - gamma));
    const double complex w = I * angle * gamma / 2;
    return cabs((a1 * (1 + w) / (1 - w) - (a1 - 1)) / (1 - w));
}

DRAPE_REFERENCE(oscillator_trbdf2, AMPLITUDE("'trbdf2'"), DRAPE_CASES(0.1, 0.5, 2),
                .model = "stretch.cst; square; trbdf2",
                .entry.reference = "stability function; Bank et al. 1985, Hosea & Shampine 1996",
                .expected = trbdf2, .constants = {0, 20});

/* The implicit midpoint rule keeps the amplitude, and is slow: (1 + i w/2)/(1 - i w/2), w = omega h, turns by
 * 2 atan(w/2). */
static double midpoint(double angle)
{
    return 2 * atan(angle / 2) / angle;
}

DRAPE_REFERENCE(oscillator_midpoint, PHASE("'midpoint'"), DRAPE_CASES(0.1, 0.5, 2),
                .model = "stretch.cst; square; midpoint", .entry.reference = "2 atan(omega h/2)",
                .expected = midpoint);

/* Leapfrog keeps the amplitude below omega h = 2, and is fast: sin(angle/2) = omega h/2. */
static double verlet(double angle)
{
    return 2 * asin(angle / 2) / angle;
}

DRAPE_REFERENCE(oscillator_verlet, PHASE("'verlet', 'substeps': 1"), DRAPE_CASES(0.1, 0.5, 1),
                .model = "stretch.cst; square; verlet", .entry.reference = "2 asin(omega h/2)",
                .expected = verlet);

/* Variable order and steps: the velocity after one, or ten, and an eighth oscillations over that at the
 * start, which shows errors of amplitude and of phase. The tolerance is 1e-8 per step, relative to the
 * motion. */
static double turned(double turns)
{
    return cos(2 * DRAPE_PI * turns);
}

static drape_status measure_velocity(drape_reference_run *run, double *value)
{
    DRAPE_TRY(drape_sim_advance(run->sim, 2 * DRAPE_PI * run->parameter / OMEGA));
    *value = drape_sim_velocities(run->sim)[3 * 2 + 2] / -SPEED;
    return DRAPE_OK;
}

DRAPE_REFERENCE(oscillator_ida, .entry.summary = "velocity over that at the start", .unit = "1",
                .parameter = "turns", DRAPE_CASES(1.125, 10.125),
                .model = "stretch.cst; square; ida, order 5", .entry.reference = "cos(2 pi turns)",
                .tolerance = 1e-3, .expected = turned, .measure = measure_velocity,
                SHEET(SPRING("'ida', 'rtol': 1e-8, 'max_order': 5, 'atol_x': 1e-13, 'atol_v': 1e-13"),
                      .dt = 1 / OMEGA));

/* ---- Pendulums ----
 *
 * The period of two nodes on a stiff sheet that hangs from an axis and is released at an angle. Steps are
 * 1/400 of the period of small swings; the sheet stretches by less than 1e-4. */

#define STEPS 400
#define STEP  0.0050151667017766174 /* [s] 2 pi/sqrt(g)/STEPS */

static double swing(double degrees)
{
    return 2 / DRAPE_PI * gsl_sf_ellint_Kcomp(sin(degrees * DRAPE_PI / 360), GSL_PREC_DOUBLE);
}

/* Half a period passes from the first to the second crossing of the vertical. */
static drape_status measure_period(drape_reference_run *run, double *value)
{
    const size_t at = 3 * 2 + 2; /* z of the first node of the lower row */
    double z = drape_sim_positions(run->sim)[at], crossing[2] = {NAN, NAN};
    drape_status status = DRAPE_OK;
    for (int k = 1, found = 0; !status && found < 2 && k < 4 * STEPS; k++) {
        const double before = z;
        status = drape_sim_advance(run->sim, k * STEP);
        z = drape_sim_positions(run->sim)[at];
        if (before * z < 0)
            crossing[found++] = k - 1 + before / (before - z);
    }
    *value = 2 * (crossing[1] - crossing[0]) / STEPS;
    return status;
}

#define PENDULUM(method)                                                                                     \
    .entry.summary = "period over that of small swings", .unit = "1", .parameter = "degrees",                \
    DRAPE_CASES(30, 90, 150), .entry.reference = "T/T0 = 2/pi K(sin(a/2))", .tolerance = 0.001,              \
    .expected = swing, .measure = measure_period,                                                            \
    SHEET(.grid = "square", .columns = 2, .rows = 2, .width = 1, .height = 1, .factor = 1,                   \
          .mesh = "'orientation': 'vertical', 'transform': {'rotate': [1, 0, 0, @]}", .young_modulus = 1e7,  \
          .thickness = 1e-2, .areal_density = 0.1, .material = "'mass': 'uniform'",                          \
          .pins = "{'edge': 'top'}", .gravity = {0, -GRAVITY, 0}, .integrator = "'method': " method,         \
          .dt = STEP, .others = "'controller': {'type': 'fixed'}", .duration = 10)

/* Slow by (2 pi/400)^2/12 = 2e-5 at small swings. */
DRAPE_REFERENCE(pendulum, PENDULUM("'midpoint', 'tolerance': 1e-9"),
                .model = "stretch.cst, bend.midedge; square; midpoint");

/* Slow by (2 pi/400)^2/3 = 8e-5 at small swings. */
DRAPE_REFERENCE(pendulum_bdf2, PENDULUM("'bdf2', 'tolerance': 1e-9"),
                .model = "stretch.cst, bend.midedge; square; bdf2");

/* The error is a fraction of that of bdf2. */
DRAPE_REFERENCE(pendulum_trbdf2, PENDULUM("'trbdf2', 'tolerance': 1e-9"),
                .model = "stretch.cst, bend.midedge; square; trbdf2");

/* ida chooses its steps; dt is the interval of observation. */
DRAPE_REFERENCE(pendulum_ida, PENDULUM("'ida', 'rtol': 1e-6, 'max_order': 5"),
                .model = "stretch.cst, bend.midedge; square; ida, order 5");
