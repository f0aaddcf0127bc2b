/* reference_modes.c: eigenfrequencies and buckling loads by drape_sim_modes, and what follows buckling by
 * drape_sim_path. */
#include "lab/sheet.h"

#include <math.h>

#define SQRT_1000 31.622776601683793
#define SQRT_910  30.166206257996713

/* ---- Frequencies ---- */

/* A narrow strip clamped at one end. */
#define BEAM STRIP(0.004), .columns = 81, .rows = 4, .height = 0.02

DRAPE_REFERENCE(beam_frequency, .entry.summary = "omega L^2 sqrt(rho/B) of a strip clamped at one end",
                .unit = "1", .parameter = "mode", DRAPE_CASES(1, 2, 3),
                .model = "stretch.cst, bend.midedge; irregular; modes",
                .entry.reference = "cos b cosh b = -1, omega = b^2; Euler-Bernoulli", .tolerance = 0.005,
                DRAPE_KNOWN(3.5160152685001509, 22.034491564666773, 61.697214413549105),
                SHEET(BEAM, .tolerance = 1e-11), .measure = lab_omega,
                .constants = {2, 12, SQRT_1000 /* of rho/B */});

/* A square plate clamped at one side: omega a^2 sqrt(rho/D) at nu = 0.3, by Rayleigh-Ritz with x^2 times
 * polynomials of degree 11 along, and of degree 11 across. Beam functions gave Leissa the upper bounds
 * 3.4917, 8.5246, 21.429, 27.331, 31.111. */
DRAPE_REFERENCE(
    plate_frequency, .entry.summary = "omega a^2 sqrt(rho/D) of a square plate clamped at one side",
    .unit = "1", .parameter = "mode", DRAPE_CASES(1, 2, 3, 4, 5),
    .model = "stretch.cst, bend.midedge; irregular; modes",
    .entry.reference = "Rayleigh-Ritz with polynomials, nu = 0.3; Leissa 1973, The free vibration "
                       "of rectangular plates",
    .tolerance = 0.005, DRAPE_KNOWN(3.47114, 8.50706, 21.28581, 27.19900, 30.95764),
    SHEET(STRIP(0.004), .columns = 41, .rows = 41, .height = 1, .poisson_ratio = 0.3, .tolerance = 1e-11),
    .measure = lab_omega, .constants = {0, 5, SQRT_910 /* of rho (1 - nu^2)/B */});

/* A square membrane held at all sides under tension. Modes 2 and 3 are one eigenvalue, as those of 5 and
 * 6. */

/* The tension is 1 N/m: springs between neighbours are stretched from 9/10 of their distance of 1/32 by 1/32
 * N. m^2 + n^2 is 2, 5, 5, 8, 10 and 10. */
DRAPE_REFERENCE(membrane_frequency, .entry.summary = "frequency of a square membrane", .unit = "rad/s",
                .parameter = "mode", DRAPE_CASES(1, 2, 3, 4, 5, 6),
                .model = "spring.structural; square; modes",
                .entry.reference = "omega = pi/a sqrt(T/rho (m^2 + n^2)); Rayleigh 1894, The theory of sound",
                .tolerance = 0.005,
                DRAPE_KNOWN(14.049629462081453, 22.214414690791831, 22.214414690791831, 28.099258924162907,
                            31.415926535897931, 31.415926535897931),
                SHEET(.grid = "square", .columns = 33, .rows = 33, .width = 1, .height = 1,
                      .mesh = "'diagonals': 'parallel'", .young_modulus = 1, .thickness = 1e-3,
                      .areal_density = STRIP_DENSITY,
                      .terms = "{'type': 'spring.structural', 'stiffness': 10, 'rest_scale': 0.9}",
                      .pins = "{'edge': 'left'}, {'edge': 'right'}, {'edge': 'top'}, {'edge': 'bottom'}"),
                .measure = lab_omega, .constants = {0, 6, 1});

/* ---- Euler's columns ---- */

/* P L^2/B of a strip clamped at one end: pi^2 (n - 1/2)^2. */
static double column(double mode)
{
    return DRAPE_PI * DRAPE_PI * (mode - 0.5) * (mode - 0.5);
}

/* constants: the force at the free end in parts of B/L^2, in the direction of the strip; it stays so. */
static int column_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    return SHEET_TEXT(text, BEAM, .tolerance = 1e-12, .factor = -c->reference->constants[0] * STRIP_RIGIDITY,
                      .terms = "'stretch.cst', 'bend.midedge', "
                               "{'type': 'load.line', 'edge': 'right', 'force': [@, 0, 0]}");
}

/* The value of a mode, as it is in the state that the run has. */
static drape_status find_value(const drape_reference_run *run, bool buckling, int number, double *value)
{
    drape_modes_def def;
    drape_modes modes;
    drape_modes_def_init(&def, sizeof def);
    def.buckling = buckling;
    def.load_factor = 0;
    def.count = buckling ? 3 : 1;
    drape_status status = drape_sim_modes(run->sim, &def, &modes);
    *value = status ? NAN : modes.modes[number - 1].value;
    drape_modes_free(&modes);
    return status;
}

static drape_status measure_column(drape_reference_run *run, double *value)
{
    DRAPE_TRY(find_value(run, true, (int)run->parameter, value));
    *value *= run->reference->constants[0];
    return DRAPE_OK;
}

DRAPE_REFERENCE(euler_column, .entry.summary = "P L^2/B at which a strip clamped at one end buckles",
                .unit = "1", .parameter = "mode", DRAPE_CASES(1, 2, 3),
                .model = "stretch.cst, bend.midedge, load.line; irregular; modes",
                .entry.reference = "pi^2 (n - 1/2)^2; Euler 1744", .tolerance = 0.005, .expected = column,
                .scene = column_scene, .measure = measure_column, .constants = {0.01});

/* Above the threshold the lowest eigenvalue is below 0. */
static drape_status measure_clamped(drape_reference_run *run, double *value)
{
    DRAPE_TRY(lab_advance(run));
    DRAPE_TRY(find_value(run, false, 1, value));
    *value = -*value;
    return DRAPE_OK;
}

DRAPE_REFERENCE(euler_clamped, .entry.summary = "P L^2/B at which a strip clamped at both ends buckles",
                .unit = "1", DRAPE_CASES(0), .model = "stretch.cst, bend.midedge; irregular; modes",
                .entry.reference = "4 pi^2; Euler 1744", .tolerance = 0.005,
                DRAPE_KNOWN(4 * DRAPE_PI * DRAPE_PI), .measure = measure_clamped, .low = 0.9, .high = 1.1,
                /* P is E h times the share of the length by which an end is pushed in. */
                SHEET(FREE_STRIP(0.004), .columns = 81, .rows = 4, .height = 0.02, .tolerance = 1e-11,
                      .pins = "{'edge': 'left', 'clamp': true}, {'edge': 'right', 'clamp': true, "
                              "'track': [[0, [0, 0, 0]], [1, [@, 0, 0]]]}",
                      .factor = -0.004 * 0.004 / 12));

/* ---- Euler's column, bent ---- */

static drape_status measure_bent(drape_reference_run *run, double *value)
{
    drape_path_def def;
    drape_path_def_init(&def, sizeof def);
    def.to = run->parameter;
    def.branch = 1;
    DRAPE_TRY(drape_sim_path(run->sim, &def));
    const double *rest = drape_model_rest_positions(run->model), *x = drape_sim_positions(run->sim);
    *value = 0;
    for (size_t i = 0; i < (size_t)drape_model_node_count(run->model); i++)
        if (rest[3 * i] > 1 - 1e-9)
            *value = fmax(*value, fabs(x[3 * i + 1]));
    return DRAPE_OK;
}

DRAPE_REFERENCE(bent_column, .entry.summary = "w/L of the end of a strip that has buckled", .unit = "1",
                .parameter = "P/P_E", DRAPE_CASES(1.05, 1.2, 1.5),
                .model = "stretch.cst, bend.midedge, load.line; irregular; path",
                .entry.reference = "w/L = 2 k/K(k), P L^2/B = K(k)^2; Euler 1744", .tolerance = 0.005,
                DRAPE_KNOWN(0.37997960564706629, 0.64878361363058978, 0.7885758056925356),
                .scene = column_scene, .measure = measure_bent,
                .constants = {DRAPE_PI * DRAPE_PI / 4 /* at factor 1 the load is Euler's */});
