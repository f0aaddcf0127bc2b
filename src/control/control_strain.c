/*
 * strain: halving that also rejects a step in which the cloth moves too far: an edge changes its length, or a
 * node moves, by more than a given fraction of the rest length. Such a step does not resolve the motion, even
 * if the solver converged.
 */
#include "base/reason.h"
#include "base/vec3.h"
#include "control/halve.h"

#include <math.h>

enum { PARAM_DT_MIN, PARAM_MAX_STRETCH, PARAM_MAX_MOVE, PARAM_COUNT };

static const drape_param params[PARAM_COUNT] = {
    [PARAM_DT_MIN] = DRAPE_DT_MIN_PARAM,
    [PARAM_MAX_STRETCH] =
        DRAPE_NUMBER("max_stretch", "1", 0.1, DRAPE_ABOVE(0), 1e6,
                     "largest change of an edge's length in one step, relative to its rest length"),
    [PARAM_MAX_MOVE] =
        DRAPE_NUMBER("max_move", "1", 10, DRAPE_ABOVE(0), 1e9,
                     "largest displacement of a node in one step, relative to its shortest edge"),
};

static double length_between(const double *x, const int32_t *node)
{
    double d[3];
    vec3_sub(x + 3 * (size_t)node[1], x + 3 * (size_t)node[0], d);
    return vec3_norm(d);
}

static double displacement(const drape_trial *trial, int32_t node)
{
    double d[3];
    vec3_sub(trial->out->x + 3 * (size_t)node, trial->in->x + 3 * (size_t)node, d);
    return vec3_norm(d);
}

/* Keeps the largest value of one kind; the caller sets limit and what. */
static void keep(drape_diagnostic *diagnostic, const int32_t *node, int count, double value)
{
    if (value <= diagnostic->value)
        return;
    diagnostic->value = value;
    for (int a = 0; a < count; a++)
        diagnostic->node[a] = node[a];
}

static bool too_far(const double *values, drape_trial *trial)
{
    const drape_model *m = trial->model;
    drape_diagnostic stretch = {
        .what = "change of edge length / rest length", .term = "", .element = -1, .node = {-1, -1, -1, -1}};
    drape_diagnostic move = {
        .what = "displacement of a node / edge length", .term = "", .element = -1, .node = {-1, -1, -1, -1}};
    stretch.limit = values[PARAM_MAX_STRETCH];
    move.limit = values[PARAM_MAX_MOVE];
    for (int32_t e = 0; e < m->edge_count; e++) {
        const int32_t *node = m->edge + 2 * (size_t)e;
        double rest = m->edge_length[e];
        keep(&stretch, node, 2,
             fabs(length_between(trial->out->x, node) - length_between(trial->in->x, node)) / rest);
        keep(&move, &node[0], 1, displacement(trial, node[0]) / rest);
        keep(&move, &node[1], 1, displacement(trial, node[1]) / rest);
    }
    bool stretched = stretch.value > stretch.limit, moved = move.value > move.limit;
    if (!stretched && !moved)
        return false;
    trial->info->reason = stretched ? DRAPE_REASON_STRETCH : DRAPE_REASON_MOVE;
    trial->info->diagnostic = stretched ? stretch : move;
    trial->info->diagnostic.cloth = drape_model_cloth_of(m, trial->info->diagnostic.node[0]);
    return true;
}

static drape_verdict judge(const double *values, drape_trial *trial)
{
    return drape_trial_failed(trial) || too_far(values, trial) ? drape_halve(values[PARAM_DT_MIN], trial)
                                                               : DRAPE_ACCEPT;
}

const drape_controller_ops drape_controller_strain = {
    .entry = {.name = "strain",
              .summary = "as halving; also rejects steps in which an edge stretches or a node moves too far",
              .reference = "-",
              DRAPE_PARAMS(params)},
    .max_attempts = 10000,
    .judge = judge,
};
