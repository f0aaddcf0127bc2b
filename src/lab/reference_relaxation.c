/* reference_relaxation.c: stress relaxation and creep of relax.maxwell, in a strip without lateral
 * contraction that is strained alike everywhere. */
#include "lab/sheet.h"

#include <math.h>

#define SIDE 0.1 /* [m] */

/* The strip along x. */
#define PULLED                                                                                               \
    .columns = 5, .rows = 5, .width = SIDE, .height = SIDE, .young_modulus = 1e6, .thickness = 1e-3,         \
    .areal_density = 0.1, .integrator = "'method': 'be'"

/* A state at the time 0 in which the strip was stretched at once. */
static drape_status stretch(drape_reference_run *run, double strain)
{
    const size_t n = 3 * (size_t)drape_model_node_count(run->model);
    const double *rest = drape_model_rest_positions(run->model);
    double *x = drape_arena_take(&run->arena, n, sizeof *x), *v = drape_arena_take(&run->arena, n, sizeof *v);
    for (size_t i = 0; x && i < n; i++)
        x[i] = rest[i] * (i % 3 == 0 ? 1 + strain : 1);
    return x && v ? drape_sim_set_state(run->sim, 0, x, v) : DRAPE_E_MEMORY;
}

/* ---- Relaxation at constant strain ---- */

static const double fractions[] = {0.3, 0.2, 0.1}, times[] = {0.1, 1, 10}; /* [1], [s] */
enum { BRANCHES = sizeof times / sizeof *times };

static double prony(double t)
{
    double f = 1;
    for (int i = 0; i < BRANCHES; i++)
        f -= fractions[i] * (1 - exp(-t / times[i]));
    return f;
}

#define HELD 0.02

/* Forty steps: the recurrence is exact in any. */
static int held(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    return SHEET_TEXT(text, PULLED,
                      .terms = "'stretch.cst', {'type': 'relax.maxwell', 'fraction_1': 0.3, 'time_1': 0.1,\n "
                               "'fraction_2': 0.2, 'time_2': 1, 'fraction_3': 0.1, 'time_3': 10}",
                      .pins = SHEET_FORMAT("{'edge': 'left'}, "
                                           "{'edge': 'right', 'track': [[0, [%.17g, 0, 0]]]}",
                                           HELD * SIDE),
                      .dt = c->parameter / 40, .duration = c->parameter);
}

static drape_status measure_relaxation(drape_reference_run *run, double *value)
{
    double before[3] = {0}, after[3] = {0};
    DRAPE_TRY(stretch(run, HELD));
    DRAPE_TRY(lab_pull(run, 0, SIDE, before));
    DRAPE_TRY(lab_advance(run));
    DRAPE_TRY(lab_pull(run, 0, SIDE, after));
    *value = after[0] / before[0];
    return DRAPE_OK;
}

DRAPE_REFERENCE(stress_relaxation, .entry.summary = "force of a strip held stretched, over that at once",
                .unit = "1",
                .entry.reference = "Prony series of a generalised Maxwell solid; Simo & Hughes 1998, 10.3",
                .parameter = "s", DRAPE_CASES(0.05, 0.2, 1, 5, 50),
                .model = "stretch.cst, relax.maxwell; irregular; be", .tolerance = 1e-3, .expected = prony,
                .scene = held, .measure = measure_relaxation);

/* ---- Creep under a constant load ---- */

#define RELAXING 0.4
#define TIME     0.5  /* [s] */
#define STRAIN   1e-5 /* at the start: strains are those of Green, which are linear to this */

/* The standard linear solid at constant stress, with the stiffness 1 at once. */
static double compliance(double t)
{
    const double lasting = 1 - RELAXING;
    return (1 - RELAXING * exp(-lasting * t / TIME)) / lasting;
}

/* Steps of TIME/50 take the strain as straight between their ends, which is off by less than 1e-4. */
static drape_status measure_creep(drape_reference_run *run, double *value)
{
    double tip[3];
    DRAPE_TRY(stretch(run, STRAIN));
    DRAPE_TRY(lab_advance(run));
    lab_tip(run, tip);
    *value = (tip[0] - SIDE) / (STRAIN * SIDE);
    return DRAPE_OK;
}

DRAPE_REFERENCE(
    creep, .entry.summary = "lengthening of a strip under a constant load, over that at once", .unit = "1",
    .entry.reference = "standard linear solid at constant stress; Simo & Hughes 1998, 10.3", .parameter = "s",
    DRAPE_CASES(0.1, 0.5, 2, 10), .model = "stretch.cst, relax.maxwell; irregular; be", .tolerance = 1e-3,
    .expected = compliance, .measure = measure_creep,
    SHEET(PULLED, .pins = "{'edge': 'left'}", .dt = TIME / 50, .tolerance = 1e-12,
          .terms = "'stretch.cst', {'type': 'relax.maxwell', 'fraction_1': 0.4, 'time_1': 0.5},\n "
                   "{'type': 'load.line', 'edge': 'right', 'force': [0.01, 0, 0]}",
          VARIED(duration, 1)));
