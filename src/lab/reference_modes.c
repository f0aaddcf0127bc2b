/* reference_modes.c: eigenfrequencies and buckling loads by drape_sim_modes, and what follows buckling by
 * drape_sim_path. */
#include "drape/lab.h"
#include "lab/strip.h"

#include <gsl/gsl_sf_bessel.h>
#include <gsl/gsl_sf_ellint.h>
#include <math.h>
#include <stdio.h>

#define PI 3.14159265358979323846

/* ---- What is measured ---- */

/* The share of a mode in the motion of the whole scene along axis k: (sum m u_k)^2/(sum m u^2 sum m). A mode
 * that twists a strip, or bends it in its plane, has none. */
static double moves_along(const drape_reference_run *run, const drape_mode *mode, int k)
{
    const double *mass = drape_model_masses(run->model);
    double sum = 0, all = 0;
    for (size_t i = 0; i < (size_t)drape_model_node_count(run->model); i++) {
        sum += mass[i] * mode->shape[3 * i + (size_t)k];
        all += mass[i];
    }
    return sum * sum / (mode->mass * all);
}

/* omega [rad/s] of the number-th mode that moves the scene along an axis (below 0: of the number-th mode of
 * all). */
static drape_status find_omega(drape_reference_run *run, int number, int axis, int32_t count, double *omega)
{
    drape_modes_def def;
    drape_modes modes;
    drape_modes_def_init(&def, sizeof def);
    def.count = count;
    drape_status status = lab_advance(run);
    if (!status)
        status = drape_sim_modes(run->sim, &def, &modes);
    *omega = NAN;
    for (int32_t i = 0; !status && i < modes.count && number > 0; i++)
        if (axis < 0 || moves_along(run, &modes.modes[i], axis) > 1e-3) {
            number--;
            *omega = number == 0 ? sqrt(modes.modes[i].value) : NAN;
        }
    if (!status)
        drape_modes_free(&modes);
    return status;
}

/* ---- A strip clamped at one end ---- */

/* omega L^2 sqrt(rho/B) = beta^2, cos beta cosh beta = -1. */
static double beam(double mode)
{
    static const double beta[] = {1.8751040687119611, 4.6940911329741746, 7.8547574382376126};
    return beta[(int)mode - 1] * beta[(int)mode - 1];
}

static int beam_scene(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    (void)c;
    return STRIP_SCENE(text, .columns = 81, .rows = 4, .width = 0.02, .thickness = 0.004, .tolerance = 1e-11);
}

static drape_status measure_beam(drape_reference_run *run, double *value)
{
    drape_status status = find_omega(run, (int)run->parameter, 1, 12, value);
    *value *= sqrt(STRIP_DENSITY / STRIP_RIGIDITY);
    return status;
}

DRAPE_REFERENCE(beam_frequency, .entry.summary = "omega L^2 sqrt(rho/B) of a strip clamped at one end",
                .unit = "1", .parameter = "mode", DRAPE_CASES(1, 2, 3),
                .model = "stretch.cst, bend.midedge; irregular; modes",
                .entry.reference = "cos b cosh b = -1, omega = b^2; Euler-Bernoulli", .tolerance = 0.005,
                .expected = beam, .scene = beam_scene, .measure = measure_beam);

/* ---- A square plate clamped at one side ---- */

/* omega a^2 sqrt(rho/D) at nu = 0.3: Rayleigh-Ritz with x^2 times polynomials of degree 11 along, and of
 * degree 11 across. Beam functions gave Leissa the upper bounds 3.4917, 8.5246, 21.429, 27.331, 31.111. */
static double plate(double mode)
{
    static const double known[] = {3.47114, 8.50706, 21.28581, 27.19900, 30.95764};
    return known[(int)mode - 1];
}

static int plate_scene(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    (void)c;
    return STRIP_SCENE(text, .columns = 41, .rows = 41, .width = 1, .thickness = 0.004, .poisson = 0.3,
                       .tolerance = 1e-11);
}

static drape_status measure_plate(drape_reference_run *run, double *value)
{
    drape_status status = find_omega(run, (int)run->parameter, -1, 5, value);
    *value *= sqrt(STRIP_DENSITY * (1 - 0.09) / STRIP_RIGIDITY);
    return status;
}

DRAPE_REFERENCE(
    plate_frequency, .entry.summary = "omega a^2 sqrt(rho/D) of a square plate clamped at one side",
    .unit = "1", .parameter = "mode", DRAPE_CASES(1, 2, 3, 4, 5),
    .model = "stretch.cst, bend.midedge; irregular; modes",
    .entry.reference = "Rayleigh-Ritz with polynomials, nu = 0.3; Leissa 1973, The free vibration "
                       "of rectangular plates",
    .tolerance = 0.005, .expected = plate, .scene = plate_scene, .measure = measure_plate);

/* ---- A hanging chain ---- */

#define GRAVITY 9.81

static double chain(double mode)
{
    return gsl_sf_bessel_zero_J0((unsigned)mode) / 2 * sqrt(GRAVITY);
}

static int chain_scene(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    (void)c;
    return snprintf(
        text, DRAPE_LAB_TEXT,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 3, 'rows': 81, 'width': 0.025, "
        "'height': 1, 'orientation': 'vertical'},\n "
        "'material': {'young_modulus': 1e6, 'poisson_ratio': 0, 'thickness': 1e-3, 'areal_density': 0.1},\n "
        "'terms': ['stretch.cst'], 'pins': [{'edge': 'top'}]}],\n 'gravity': [0, %g, 0], "
        "'integrator': {'method': 'static', 'tolerance': 1e-9}, 'duration': 1}",
        -GRAVITY);
}

static drape_status measure_chain(drape_reference_run *run, double *value)
{
    return find_omega(run, (int)run->parameter, 2, 16, value);
}

DRAPE_REFERENCE(chain_modes, .entry.summary = "frequency of a hanging chain, as a mode", .unit = "rad/s",
                .parameter = "mode", DRAPE_CASES(1, 2, 3), .model = "stretch.cst; irregular; modes",
                .entry.reference = "omega_n = j_0n/2 sqrt(g/L); D. Bernoulli 1733", .tolerance = 0.005,
                .expected = chain, .scene = chain_scene, .measure = measure_chain);

/* ---- A square membrane held at all sides under tension ---- */

#define TENSION 1.0 /* [N/m] */
#define CELLS   32

/* Modes 2 and 3 are one eigenvalue, as those of 5 and 6. */
static double membrane(double mode)
{
    static const double sum[] = {2, 5, 5, 8, 10, 10};
    return PI * sqrt(sum[(int)mode - 1] * TENSION / STRIP_DENSITY);
}

/* Springs between neighbours, stretched from 9/10 of their distance 1/CELLS by the force TENSION/CELLS. */
static int membrane_scene(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    (void)c;
    return snprintf(
        text, DRAPE_LAB_TEXT,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': %d, 'rows': %d, 'width': 1, "
        "'height': 1, 'diagonals': 'parallel'},\n "
        "'material': {'young_modulus': 1, 'poisson_ratio': 0, 'thickness': 1e-3, "
        "'areal_density': %g},\n 'terms': [{'type': 'spring.structural', 'stiffness': %.17g, "
        "'rest_scale': 0.9}],\n 'pins': [{'edge': 'left'}, {'edge': 'right'}, {'edge': 'top'}, "
        "{'edge': 'bottom'}]}],\n 'gravity': [0, 0, 0], 'integrator': {'method': 'static'}, 'duration': 1}",
        CELLS + 1, CELLS + 1, STRIP_DENSITY, TENSION / 0.1);
}

static drape_status measure_membrane(drape_reference_run *run, double *value)
{
    return find_omega(run, (int)run->parameter, -1, 6, value);
}

DRAPE_REFERENCE(membrane_frequency, .entry.summary = "frequency of a square membrane", .unit = "rad/s",
                .parameter = "mode", DRAPE_CASES(1, 2, 3, 4, 5, 6),
                .model = "spring.structural; square; modes",
                .entry.reference = "omega = pi/a sqrt(T/rho (m^2 + n^2)); Rayleigh 1894, The theory of sound",
                .tolerance = 0.005, .expected = membrane, .scene = membrane_scene,
                .measure = measure_membrane);

/* ---- Euler's columns ---- */

/* P L^2/B of a strip clamped at one end: pi^2 (n - 1/2)^2. */
static double column(double mode)
{
    return PI * PI * (mode - 0.5) * (mode - 0.5);
}

/* The force at the free end is a hundredth of B/L^2, in the direction of the strip; it stays so. */
static int column_scene(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    (void)c;
    char terms[200];
    snprintf(terms, sizeof terms,
             "'bend.midedge', {'type': 'load.line', 'edge': 'right', 'force': [%.17g, 0, 0]}",
             -0.01 * STRIP_RIGIDITY);
    return STRIP_SCENE(text, .columns = 81, .rows = 4, .width = 0.02, .thickness = 0.004, .terms = terms,
                       .tolerance = 1e-12);
}

static drape_status measure_column(drape_reference_run *run, double *value)
{
    drape_modes_def def;
    drape_modes modes;
    drape_modes_def_init(&def, sizeof def);
    def.buckling = true;
    def.load_factor = 0;
    def.count = 3;
    drape_status status = drape_sim_modes(run->sim, &def, &modes);
    *value = status ? NAN : 0.01 * modes.modes[(int)run->parameter - 1].value;
    if (!status)
        drape_modes_free(&modes);
    return status;
}

DRAPE_REFERENCE(euler_column, .entry.summary = "P L^2/B at which a strip clamped at one end buckles",
                .unit = "1", .parameter = "mode", DRAPE_CASES(1, 2, 3),
                .model = "stretch.cst, bend.midedge, load.line; irregular; modes",
                .entry.reference = "pi^2 (n - 1/2)^2; Euler 1744", .tolerance = 0.005, .expected = column,
                .scene = column_scene, .measure = measure_column);

/* P L^2/B of a strip clamped at both ends, one of which is pushed in: 4 pi^2. P is E h times the share of the
 * length by which it is pushed, so that this is load h^2/(12 L^2). */
static double clamped(double unused)
{
    (void)unused;
    return 4 * PI * PI;
}

#define CLAMPED_THICKNESS 0.004

static int clamped_scene(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    const double h = CLAMPED_THICKNESS;
    return snprintf(
        text, DRAPE_LAB_TEXT,
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 81, 'rows': 4, 'width': 1, "
        "'height': 0.02, 'orientation': 'horizontal'},\n "
        "'material': {'young_modulus': %.17g, 'poisson_ratio': 0, 'thickness': %g, 'areal_density': %g},\n "
        "'terms': ['stretch.cst', 'bend.midedge'],\n 'pins': [{'edge': 'left', 'clamp': true}, {'edge': "
        "'right', 'clamp': true, 'track': [[0, [0, 0, 0]], [1, [%.17g, 0, 0]]]}]}],\n 'gravity': [0, 0, 0], "
        "'integrator': {'method': 'static', 'tolerance': 1e-11}, 'duration': 1}",
        12 * STRIP_RIGIDITY / (h * h * h), h, STRIP_DENSITY, -c->load * h * h / 12);
}

/* Above the threshold the lowest eigenvalue is below 0. */
static drape_status measure_clamped(drape_reference_run *run, double *value)
{
    drape_modes_def def;
    drape_modes modes;
    drape_modes_def_init(&def, sizeof def);
    def.count = 1;
    drape_status status = lab_advance(run);
    if (!status)
        status = drape_sim_modes(run->sim, &def, &modes);
    *value = status ? NAN : -modes.modes[0].value;
    if (!status)
        drape_modes_free(&modes);
    return status;
}

DRAPE_REFERENCE(euler_clamped, .entry.summary = "P L^2/B at which a strip clamped at both ends buckles",
                .unit = "1", DRAPE_CASES(0), .model = "stretch.cst, bend.midedge; irregular; modes",
                .entry.reference = "4 pi^2; Euler 1744", .tolerance = 0.005, .expected = clamped,
                .scene = clamped_scene, .measure = measure_clamped, .low = 0.9, .high = 1.1);

/* ---- Euler's column, bent ---- */

/* w/L of the end at P/P_E: P L^2/B = K(k)^2 and w/L = 2 k/K(k). */
static double bent(double load)
{
    double low = 0, high = 0.99;
    for (int i = 0; i < 60; i++) {
        const double k = (low + high) / 2, complete = gsl_sf_ellint_Kcomp(k, GSL_PREC_DOUBLE);
        *(4 * complete * complete / (PI * PI) < load ? &low : &high) = k;
    }
    return 2 * low / gsl_sf_ellint_Kcomp(low, GSL_PREC_DOUBLE);
}

/* At factor 1 the load is Euler's. */
static int bent_scene(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    (void)c;
    char terms[200];
    snprintf(terms, sizeof terms,
             "'bend.midedge', {'type': 'load.line', 'edge': 'right', 'force': [%.17g, 0, 0]}",
             -PI * PI / 4 * STRIP_RIGIDITY);
    return STRIP_SCENE(text, .columns = 81, .rows = 4, .width = 0.02, .thickness = 0.004, .terms = terms,
                       .tolerance = 1e-12);
}

static drape_status measure_bent(drape_reference_run *run, double *value)
{
    drape_path_def def;
    drape_path_def_init(&def, sizeof def);
    def.to = run->parameter;
    def.branch = 1;
    drape_status status = drape_sim_path(run->sim, &def);
    const double *rest = drape_model_rest_positions(run->model), *x = drape_sim_positions(run->sim);
    *value = 0;
    for (size_t i = 0; i < (size_t)drape_model_node_count(run->model); i++)
        if (rest[3 * i] > 1 - 1e-9)
            *value = fmax(*value, fabs(x[3 * i + 1]));
    return status;
}

DRAPE_REFERENCE(bent_column, .entry.summary = "w/L of the end of a strip that has buckled", .unit = "1",
                .parameter = "P/P_E", DRAPE_CASES(1.05, 1.2, 1.5),
                .model = "stretch.cst, bend.midedge, load.line; irregular; path",
                .entry.reference = "w/L = 2 k/K(k), P L^2/B = K(k)^2; Euler 1744", .tolerance = 0.005,
                .expected = bent, .scene = bent_scene, .measure = measure_bent);
