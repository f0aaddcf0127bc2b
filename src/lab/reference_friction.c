/* reference_friction.c: friction of a sheet on a table. */
#include "lab/strip.h"

#include <math.h>
#include <stdio.h>

#define GRAVITY 9.81
#define DEGREE  (3.14159265358979323846 / 180)

/* A sheet on a plane with normal y; gravity, distance and friction, velocity, integrator and duration
 * follow. */
#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 4, 'rows': 3, 'width': 0.3, "          \
    "'height': 0.2,\n 'transform': {'translate': [0, 0.0095, 0]}},\n "                                       \
    "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'areal_density': 0.2}, "                          \
    "'terms': ['stretch.cst', 'bend.midedge']}],\n "                                                         \
    "'gravity': [%.17g, %.17g, 0], 'colliders': [{'type': 'plane', 'point': [0, 0, 0], "                     \
    "'normal': [0, 1, 0], 'friction': %.17g}],\n "

/* ---- The friction above which a sheet stays on a slope ---- */

/* The table is horizontal, and gravity is tilted. */

#define CREEP 1e-4 /* [m/s] friction_velocity: a sheet that stays creeps more slowly */

static double slope(double degrees)
{
    return tan(degrees * DEGREE);
}

static int slope_scene(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    return snprintf(text, DRAPE_LAB_TEXT,
                    SHEET "'contact': {'distance': 0.01, 'friction_velocity': %g},\n "
                          "'integrator': {'method': 'be', 'dt': 0.01, 'tolerance': 1e-9}, 'duration': 1}",
                    GRAVITY * sin(c->parameter * DEGREE), -GRAVITY * cos(c->parameter * DEGREE), c->load,
                    CREEP);
}

/* Returns 1 if the sheet stays. With 1e-3 less friction than needed its speed after a second is 1e-3 g sin a,
 * at least 17 times CREEP. */
static drape_status measure_stays(drape_reference_run *run, double *value)
{
    const int32_t nodes = drape_model_node_count(run->model);
    double speed = 0;
    drape_status status = lab_advance(run);
    for (int32_t i = 0; i < nodes; i++)
        speed += drape_sim_velocities(run->sim)[3 * (size_t)i] / nodes;
    *value = speed < CREEP;
    return status;
}

DRAPE_REFERENCE(friction_slope, .entry.summary = "friction above which a sheet stays on a slope", .unit = "1",
                .parameter = "degrees", DRAPE_CASES(10, 30),
                .model = "stretch.cst, bend.midedge; irregular; plane; be",
                .entry.reference = "mu = tan a; Coulomb 1785", .tolerance = 0.005, .expected = slope,
                .scene = slope_scene, .measure = measure_stays, .low = 0.9, .high = 1.1);

/* ---- A pushed sheet slides until friction has stopped it, after v0^2/(2 mu g) ----
 *
 * Below friction_velocity, 1e-3 of v0, friction is smoothed, which adds about (1e-3)^2 of the distance. At
 * the start the barrier of the table is in equilibrium with the weight. */

#define SPEED 1.0 /* [m/s] v0 */

static double stopping_distance(double mu)
{
    return SPEED * SPEED / (2 * mu * GRAVITY);
}

static int slide_scene(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    return snprintf(text, DRAPE_LAB_TEXT,
                    SHEET "'contact': {'distance': 0.01, 'friction_velocity': 1e-3},\n "
                          "'integrator': {'method': 'trbdf2', 'dt': 0.002, 'tolerance': 1e-9}, "
                          "'duration': 10}",
                    0.0, -GRAVITY, c->parameter);
}

static double mean_x(const drape_reference_run *run)
{
    const int32_t nodes = drape_model_node_count(run->model);
    double sum = 0;
    for (int32_t i = 0; i < nodes; i++)
        sum += drape_sim_positions(run->sim)[3 * (size_t)i];
    return sum / nodes;
}

/* Advances twice as long as the sheet takes to stop. */
static drape_status measure_slide(drape_reference_run *run, double *value)
{
    const size_t n = 3 * (size_t)drape_model_node_count(run->model);
    double *v = drape_arena_take(&run->arena, n, sizeof *v);
    for (size_t i = 0; v && i < n; i += 3)
        v[i] = SPEED;
    drape_status status = v ? lab_settle(run, v) : DRAPE_E_MEMORY;
    const double before = mean_x(run);
    if (!status)
        status = drape_sim_advance(run->sim, 2 * SPEED / (run->parameter * GRAVITY));
    *value = mean_x(run) - before;
    return status;
}

DRAPE_REFERENCE(friction_slide, .entry.summary = "distance that a pushed sheet slides until it stops",
                .unit = "m", .parameter = "mu", DRAPE_CASES(0.1, 0.3, 0.8),
                .model = "stretch.cst, bend.midedge; irregular; plane; trbdf2",
                .entry.reference = "v0^2/(2 mu g)", .tolerance = 0.005, .expected = stopping_distance,
                .scene = slide_scene, .measure = measure_slide);
