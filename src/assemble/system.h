/*
 * system.h: the forces of all terms and their derivatives, assembled. With
 *     g(x, v) = grad E + g_damp       [N], positive against the motion: M v' + g = 0
 *     J = dg/dx + w dg/dv             [N/m], w the weight of x in v
 * (v = w x + const in a step method, w = c_j in IDA) every time integrator is a choice of x, v, w and of a
 * mass term.
 *
 * Elements are evaluated in blocks, by several threads if there are any, and added in the order of elements:
 * the result has the same bits for any number of threads.
 */
#ifndef DRAPE_ASSEMBLE_SYSTEM_H
#define DRAPE_ASSEMBLE_SYSTEM_H

#include "assemble/state.h"

typedef struct drape_system drape_system;

/* Where the system is evaluated. */
typedef struct drape_point {
    const double *x, *v;    /* (node_count x 3) */
    const double *internal; /* (internal_count) of the last accepted state */
    double weight;          /* w [1/s]: v = w x + const, and q' = w q + history */
    const double *history;  /* (measure_count) [q/s]; NULL: q' = grad q . v, as in continuous time */
} drape_point;

/* Workspace for a model; threads >= 1. */
drape_status drape_system_create(drape_context *ctx, const drape_model *model, int threads,
                                 drape_system **out);
void drape_system_destroy(drape_system **system);

/* From here on what stands for a constraint has no part in forces, energies and checks: for integrators that keep
 * constraints by moving nodes. */
void drape_system_leave_constraints(drape_system *system);

const drape_model *drape_system_model(const drape_system *system);

/* g (node_count x 3) of all nodes, pinned ones too. */
void drape_system_force(drape_system *system, const drape_point *point, double *g);

/* values (pattern.nonzeros) = mass_weight M + J over the free nodes. project: element Hessians become
 * positive semidefinite. */
void drape_system_jacobian(drape_system *system, const drape_point *point, double mass_weight, bool project,
                           double *values);

/* values (pattern.nonzeros) = D = dg/dv over the free nodes, in continuous time. */
void drape_system_damping(drape_system *system, const drape_point *point, double *values);

/* The part of g that takes energy out: laws and terms that are dissipative. */
void drape_system_dissipation(drape_system *system, const drape_point *point, double *g);

/* Energies of the terms [J]. */
void drape_system_energy(drape_system *system, const drape_point *point, double *elastic, double *gravity);

/* q of all measures (measure_count). */
void drape_system_measures(drape_system *system, const drape_point *point, double *q);

/* One term alone, for checks and profiles: adds its g to g, its J to values; *energy gets its energy. Any of
 * the three may be NULL. */
void drape_system_term(drape_system *system, int32_t term, const drape_point *point, double *energy,
                       double *g, double *values);

/* Looks in all terms for an element that a step made degenerate: DRAPE_OK or DRAPE_RETRY_DEGENERATE, with the
 * worst filled in. x is the new state; before and internal are of the one before. before NULL: also those that
 * were degenerate already. */
drape_status drape_system_check(const drape_system *system, const double *x, const double *before,
                                const double *internal, const char **reason, drape_worst *worst);

/* Which node, and what it belongs to, for a message about a vector over free DOFs: the entry of largest
 * magnitude, or the first that is not finite. */
drape_worst drape_system_worst_dof(const drape_system *system, const double *free_vector, const char *what,
                                   double limit);

size_t drape_system_bytes(const drape_system *system);

#endif
