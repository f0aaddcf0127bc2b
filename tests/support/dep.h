/*
 * dep.h: the scenes of the DEP report: a horizontal sheet of c edges a side that falls, pinned at four
 * inner nodes r (c + 1) + k, r and k of {c/3, 2 c/3}; edges 0.1 m, 10 g spread evenly over all nodes, E 1e5
 * Pa, thickness 1 mm.
 */
#ifndef DRAPE_TESTS_DEP_H
#define DRAPE_TESTS_DEP_H

#include "support/scene.h"

typedef struct dep_case {
    const char *name;
    int side; /* c */
    double dt, modulus;
    const char *stiffness;  /* of stretch.edge */
    const char *integrator; /* more settings, each after a comma */
} dep_case;

/* What the attempts of a run reported. */
typedef struct dep_log {
    int64_t attempts, accepted, rejected, unconverged;
    bool honest;    /* "converged" was reported if the residual is within the tolerance, and only then, or
                       "local_error" if a step was solved to that */
    bool converged; /* all accepted attempts */
} dep_log;

static inline drape_status dep_note(void *user, const drape_event *event)
{
    dep_log *log = user;
    const drape_attempt *a = event->attempt;
    if (event->kind != DRAPE_EVENT_ATTEMPT)
        return DRAPE_OK;
    const bool by_error = strcmp(a->reason, "local_error") == 0;
    const bool within = by_error || a->residual <= a->tolerance;
    const bool called = by_error || strcmp(a->reason, "converged") == 0;
    log->honest &= a->index == log->attempts && isfinite(a->t) && a->h > 0 && a->reason[0] != 0;
    log->honest &= a->status == DRAPE_OK ? within && called : a->status > 0 && !called;
    log->converged &= !a->accepted || (a->status == DRAPE_OK && within);
    log->attempts++;
    log->accepted += a->accepted;
    log->rejected += !a->accepted;
    log->unconverged += a->accepted && a->status != DRAPE_OK;
    return DRAPE_OK;
}

static inline scene dep_scene(const dep_case *c)
{
    const int a = c->side / 3, b = 2 * c->side / 3, n = c->side + 1;
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': %d, 'edge_length': 0.1},"
        "'material': {'young_modulus': %g, 'thickness': 1e-3, 'total_mass': 0.01, 'mass': 'uniform'},"
        "'terms': [{'type': 'stretch.edge', 'stiffness': '%s'}, {'type': 'bend.hinge',"
        "'stiffness': 'report'}],"
        "'pins': [{'nodes': [%d, %d, %d, %d]}]}],"
        "'gravity': [0, -9.81, 0], 'integrator': {'method': 'be', 'dt': %g%s}, 'duration': 3}",
        c->side, c->modulus, c->stiffness, a * n + a, a * n + b, b * n + a, b * n + b, c->dt, c->integrator);
}

/* Runs 3 s and checks the properties of a good run. */
static inline void dep_run(const dep_case *c)
{
    const double duration = 3;
    int64_t counted = 0, count = 0;
    dep_log log = {.honest = true, .converged = true};
    scoped_scene s = dep_scene(c);
    ck_assert_int_eq(drape_sim_observe(s.sim, dep_note, &log), DRAPE_OK);
    const drape_status status = drape_sim_advance(s.sim, duration);
    ck_assert_msg(status == DRAPE_OK, "%s: %s", c->name, drape_context_message(s.ctx));
    ck_assert(drape_sim_time(s.sim) == duration);

    const drape_statistics done = drape_sim_statistics(s.sim);
    printf("# %s: %lld accepted, %lld rejected, h from %g s, %lld iterations, strain %.3f to %.3f\n", c->name,
           (long long)done.steps_accepted, (long long)done.steps_rejected, done.h_min,
           (long long)done.newton_iterations, done.strain_min, done.strain_max);
    ck_assert_msg(log.honest && log.converged, "%s", c->name);
    ck_assert_int_eq(done.steps_accepted, log.accepted);
    ck_assert_int_eq(done.steps_rejected, log.rejected);
    for (int i = 0; drape_sim_reason(s.sim, i, &count); i++)
        counted += count;
    ck_assert_int_eq(counted, log.rejected);

    /* Each pin carries a quarter of 0.098 N on at least two springs of at least 0.87 N per unit of strain:
     * 1.4 % at rest, twice that under a sudden load, more when the hanging corners swing; the runs of the
     * report that failed had 10 to 4000. */
    ck_assert(done.strain_max < 0.2 && done.strain_min > -0.2);
    /* No node can be lower than its shortest path along edges to the nearest pin; NaN fails this too. */
    for (int32_t i = 0; i < s.model->node_count; i++)
        ck_assert(fabs(drape_sim_positions(s.sim)[3 * i + 1]) < 1.2 * 0.1 * c->side);
}

#endif
