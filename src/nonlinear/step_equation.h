/*
 * step_equation.h: the nonlinear equation of one implicit step, or of one stage of it. With the
 * displacement d of the free nodes from a base configuration,
 *     x = x_base + d,  v = v_base + w d
 *     F(d) = m_w M (d - p) + g(x, v) = 0       [N]
 *     J(d) = m_w M + dg/dx + w dg/dv           [N/m]
 * where g contains d/dt of the momenta P(x, v) that terms have, as a combination r P + const of P here and of
 * those of earlier states: with r = m_w/w, that by which M v' is a combination of M v.
 * An integrator is a choice of the base, the weights m_w and w, the inertial displacement p and the history
 * of strain rates. Backward Euler: m_w = 1/h^2, w = 1/h, p = h v0. The unknowns are displacements, not
 * positions, so that M (d - p) keeps its digits at small h wherever the scene is.
 *
 * Friction and damping have no energy to minimise. The merit of a step a p from d is therefore the work of
 * the residual along it, F(d + a p) . p: it is negative while the energy along p, if there is one, still
 * falls, and zero where that energy is smallest. A step is feasible if no two pieces pass through each
 * other on it.
 *
 * newton.h solves it.
 */
#ifndef DRAPE_NONLINEAR_STEP_EQUATION_H
#define DRAPE_NONLINEAR_STEP_EQUATION_H

#include "nonlinear/solve_report.h"

/* Arrays of nodes have 3 x node_count entries, arrays of free DOFs `dofs`. */
typedef struct drape_step_equation {
    drape_system *system;
    const drape_model *model;
    const drape_ranks *ranks; /* the model's: sums below are those of all ranks */
    size_t nodes, dofs;       /* entries of these arrays */
    double all_dofs;          /* of all ranks */
    double all_nodes;         /* likewise; free or not */

    /* The equation, which an integrator sets before a solve. */
    double *x_base, *v_base; /* nodes: at d = 0; pinned nodes as at the end of the step */
    double *inertia;         /* free DOFs: p [m] */
    double mass_weight;      /* m_w [1/s2] */
    /* free DOFs [m], and C: the local error of the method is about C (d - expected) or, of cloth that goes
     * where its pins take it, C (d - carried), whichever is less (stopping.h). NULL: of the first, there is
     * no estimate of it; of the second, no pin moves */
    const double *expected, *carried;
    double error_share;
    double *momentum;      /* nodes: added to g, the const of point.momentum [N]; NULL: no term has one */
    drape_point point;     /* w, history, internal variables, time; its x and v are those below */
    const double *x_start; /* nodes: the beginning of the step or stage; NULL: no stress prediction
                                (stress_predictor.h) */

    /* [m] largest coordinate by which moved pins are ahead of their motion at the start, which the guess
     * follows; 0: it need not follow them further (newton.c) */
    double pins_ahead;

    /* Where it was evaluated last: after a solve that returned a state, at the solution. */
    double *x, *v, *g; /* nodes: g(x, v) [N] */
    double *f;         /* free DOFs: F [N] */

    double *weight;      /* free nodes: of their residual in norms; 1 unless residual_bound.h sets others */
    double max_residual; /* a larger norm may ignore the load of a node; INFINITY unless residual_bound.h
                            sets another */
    double *probe;       /* nodes: scratch of drape_step_equation_rounding and _diagnose */
    bool has_contact;    /* steps have to be tested for what they pass through */
    double *x_ahead;     /* nodes: the end of a step that is tested, if there is contact */
    drape_work work;
} drape_step_equation;

typedef enum { DRAPE_NORM_MAX, DRAPE_NORM_L1, DRAPE_NORM_L2 } drape_norm;

/* Takes the arrays from the arena. Errors: DRAPE_E_MEMORY. */
drape_status drape_step_equation_init(drape_arena *arena, drape_system *system,
                                      drape_step_equation *equation);

/* The index of free DOF i in an array of nodes. */
static inline size_t drape_step_equation_at(const drape_step_equation *equation, size_t i)
{
    return 3 * (size_t)equation->model->node_of_free[i / 3] + i % 3;
}

/* Moves to d = 0. Pinned nodes keep these positions and velocities from then on. */
void drape_step_equation_begin(drape_step_equation *equation);

/* Moves to d without evaluating F. */
void drape_step_equation_move(drape_step_equation *equation, const double *d);

/* Moves to d and evaluates F; false if F is not finite. */
bool drape_step_equation_evaluate(drape_step_equation *equation, const double *d);

/* Shortens a step p from the last point to its largest feasible fraction, which it returns. */
double drape_step_equation_make_feasible(drape_step_equation *equation, double *p);

/* Shortens it at the nodes of pieces that would meet, and only there: cloth that is far from contact is not
 * held back by the pair that is nearest. A shorter path of some nodes may lead others into contact, so this
 * is repeated. False if it is still not feasible after the last pass. fraction: (node_count), scratch. */
bool drape_step_equation_shorten_nodes(drape_step_equation *equation, double *p, double *fraction);

/* Predicts the normal forces of contact at the end of a correction p from the last point, for the next
 * Jacobians (drape_contact_predict); NULL: forgets them. */
void drape_step_equation_predict_contact(drape_step_equation *equation, const double *p);

/* Whether a track or a path moves a pin in this step. */
bool drape_step_equation_pins_move(const drape_step_equation *equation);

/* d by which all free nodes follow the mean displacement of the moved pins in the step. */
void drape_step_equation_follow_pins(const drape_step_equation *s, double *d);

/* Moves to the start of the step, pins too, and sets f (free DOFs) to F there plus its derivative by the
 * positions of pins times their displacement, a difference: then -J^-1 f is the displacement that the
 * linearized equation gives. zero (free DOFs) becomes 0. */
void drape_step_equation_pull(drape_step_equation *equation, double *zero, double *f);

/* The weighted norm of F. */
double drape_step_equation_norm(const drape_step_equation *equation, drape_norm norm);

/* The same norm of the rounding errors of F at d, where it was evaluated last: how
 * much g changes if x and v are shifted by their own rounding errors, and that of the inertia. Forces that
 * cancel count in full. */
double drape_step_equation_rounding(drape_step_equation *equation, const double *d, drape_norm norm);

/* Whether the norm of F, evaluated last at d, is no larger than that. *rounding: the last estimate of this
 * solve, INFINITY before the first; a norm that is far above it is not compared with a new one, which would
 * cost an evaluation of F. NaN: F is not finite near d. */
bool drape_step_equation_is_rounding(drape_step_equation *equation, const double *d, drape_norm norm,
                                     double *rounding);

/* Multiple of DBL_EPSILON within which errors of a computed force are taken as rounding. */
#define DRAPE_ROUNDINGS 4

/* Changes each number of n, three a node, by DBL_EPSILON times the largest of its node, up or down. */
void drape_step_equation_shift(double *nodes, size_t n);

/* |M^-1 F| / m_w, RMS over all nodes [m]: the distance to the solution if nothing but inertia resisted F, and
 * for forces with a convex potential more than it. *left: F' M^-1 F / m_w [J] likewise; may be NULL. */
double drape_step_equation_inertial_error(const drape_step_equation *equation, double *left);

/* Adds m_w m |C (d - q)|^2 of free DOF i [J], which counts for the local error, for both q: expected and
 * carried. Nothing without an estimate. */
static inline void drape_step_equation_add_own_error(const drape_step_equation *equation, size_t i, double d,
                                                     double sum[2])
{
    if (!equation->expected)
        return;
    const double weight =
                     equation->mass_weight * equation->model->mass[drape_step_equation_at(equation, i) / 3],
                 error = equation->error_share * (d - equation->expected[i]),
                 other = equation->carried ? equation->error_share * (d - equation->carried[i]) : error;
    sum[0] += weight * error * error;
    sum[1] += weight * other * other;
}

/* Its sum, the local error by the measure of stopping.h; NaN without an estimate. */
double drape_step_equation_local_error(const drape_step_equation *equation, const double *d);

/* Describes the free node with the largest weighted residual. */
drape_diagnostic drape_step_equation_diagnose(const drape_step_equation *equation, double tolerance);

/* For numbers that are not finite: returns DRAPE_RETRY_DEGENERATE and reports the element that collapsed,
 * if there is one; otherwise returns status. */
drape_status drape_step_equation_find_cause(const drape_step_equation *equation, drape_status status,
                                            drape_solve_report *report);

/* a . b over the free DOFs. */
static inline double drape_step_equation_dot(const drape_step_equation *equation, const double *a,
                                             const double *b)
{
    double sum = 0;
    for (size_t i = 0; i < equation->dofs; i++)
        sum += a[i] * b[i];
    return drape_ranks_sum(equation->ranks, sum);
}

/* Whether all numbers (free DOFs) are finite. */
bool drape_step_equation_is_finite(const drape_step_equation *equation, const double *a);

#endif
