/* reference_friction.c: friction of a sheet on a table. */
#include "lab/sheet.h"

#include <math.h>

/* A sheet on a plane with normal y. */
#define TABLE                                                                                                \
    .columns = 4, .rows = 3, .width = 0.3, .height = 0.2,                                                    \
    .mesh = "'transform': {'translate': [0, 0.0095, 0]}",                                                    \
    .material = "'young_modulus': 1e5, 'thickness': 1e-3, 'areal_density': 0.2", .tolerance = 1e-9

/* With friction @. */
#define CONTACT(velocity)                                                                                    \
    "'colliders': [{'type': 'plane', 'point': [0, 0, 0], 'normal': [0, 1, 0], 'friction': @}],\n "           \
    "'contact': {'distance': 0.01, 'friction_velocity': " velocity "}"

/* ---- The friction above which a sheet stays on a slope ---- */

/* The table is horizontal, and gravity is tilted. */

#define CREEP 1e-4 /* [m/s] friction_velocity: a sheet that stays creeps more slowly */

static double slope(double degrees)
{
    return tan(degrees * DEGREE);
}

static int slope_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    const double angle = c->parameter * DEGREE;
    return SHEET_TEXT(text, TABLE, .gravity = {GRAVITY * sin(angle), -GRAVITY * cos(angle), 0},
                      .others = CONTACT("1e-4" /* CREEP */), .factor = c->load,
                      .integrator = "'method': 'be'", .dt = 0.01);
}

/* Returns 1 if the sheet stays. With 1e-3 less friction than needed its speed after a second is 1e-3 g sin a,
 * at least 17 times CREEP. */
static double stays(const drape_reference_run *run)
{
    return lab_mean(run, drape_sim_velocities(run->sim), 0) < CREEP;
}

DRAPE_REFERENCE(friction_slope, .entry.summary = "friction above which a sheet stays on a slope", .unit = "1",
                .parameter = "degrees", DRAPE_CASES(10, 30),
                .model = "stretch.cst, bend.midedge; irregular; plane; be",
                .entry.reference = "mu = tan a; Coulomb 1785", .tolerance = 0.005, .expected = slope,
                .scene = slope_scene, .value = stays, .low = 0.9, .high = 1.1);

/* ---- A pushed sheet slides until friction has stopped it, after v0^2/(2 mu g) ----
 *
 * Below friction_velocity, 1e-3 of v0, friction is smoothed, which adds about (1e-3)^2 of the distance. At
 * the start the barrier of the table is in equilibrium with the weight. */

#define SPEED 1.0 /* [m/s] v0 */

static double stopping_distance(double mu)
{
    return SPEED * SPEED / (2 * mu * GRAVITY);
}

/* Advances twice as long as the sheet takes to stop. */
static drape_status measure_slide(drape_reference_run *run, double *value)
{
    const size_t n = 3 * (size_t)drape_model_node_count(run->model);
    double *v = drape_arena_take(&run->arena, n, sizeof *v);
    for (size_t i = 0; v && i < n; i += 3)
        v[i] = SPEED;
    drape_status status = v ? lab_settle(run, v) : DRAPE_E_MEMORY;
    const double before = lab_mean(run, drape_sim_positions(run->sim), 0);
    if (!status)
        status = drape_sim_advance(run->sim, 2 * SPEED / (run->parameter * GRAVITY));
    *value = lab_mean(run, drape_sim_positions(run->sim), 0) - before;
    return status;
}

DRAPE_REFERENCE(friction_slide, .entry.summary = "distance that a pushed sheet slides until it stops",
                .unit = "m", .parameter = "mu", DRAPE_CASES(0.1, 0.3, 0.8),
                .model = "stretch.cst, bend.midedge; irregular; plane; trbdf2",
                .entry.reference = "v0^2/(2 mu g)", .tolerance = 0.005, .expected = stopping_distance,
                .measure = measure_slide,
                SHEET(TABLE, .gravity = {0, -GRAVITY, 0}, .integrator = "'method': 'trbdf2'", .dt = 0.002,
                      .others = CONTACT("1e-3"), .factor = 1, .duration = 10));
