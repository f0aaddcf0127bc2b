/*
 * first_order.h: solvers of SUNDIALS for systems of first order, from one state of the cloth to the next.
 *     y = (x, v) of the free nodes,  x' = v,  M v' = -g(x, v, t)
 *
 * A solver chooses order and step, predicts, tests errors and iterates. Each of its Newton corrections
 * solves, for some c_j = 1/(gamma h),
 *     [c_j I, -I; K, D + c_j M] (dx, dv) = (r1, r2),  K = dg/dx, D = dg/dv.
 * Eliminating dv = c_j dx - r1 leaves
 *     (K + c_j D + c_j^2 M) dx = r2 + (D + c_j M) r1:
 * the matrix of a backward Euler step of size 1/c_j, with the same pattern and the same linear solvers. The
 * solvers keep matrix and factors while c_j stays near the value that they were computed for; that is
 * most of their advantage over one factorisation for each iteration. sun_newton.h decides when the
 * iteration with old factors has converged, and damps one that fails.
 *
 * That iteration does not need an exact matrix either. The nonsymmetric parts are those of friction, whose
 * force follows the normal force, and of dashpots of strains that rotate. Both are small beside c_j^2 M and
 * c_j D at the step sizes at which they occur. If each off-diagonal pair is replaced by its mean, Cholesky
 * factors can be used: half of the time or less in most scenes with contact, for as many iterations. Where
 * much cloth slides, the iteration may fail with them: then some matrices are exact.
 *
 * Error weights are a length and a velocity, the same for every node: 1/atol_x and 1/atol_v. A relative
 * part would make the error depend on where the scene is.
 *
 * The motion of pins has kinks at the keys of their tracks, and where a host changes their paths: the
 * solver stops there and restarts.
 *
 * Here is what they share. An entry of the table holds a drape_first_order at the beginning of its state,
 * its parameters begin with those below, and a drape_first_order_solver calls its library.
 */
#ifndef DRAPE_INTEGRATORS_FIRST_ORDER_H
#define DRAPE_INTEGRATORS_FIRST_ORDER_H

#include "integrators/integrator.h"
#include "integrators/sun_newton.h"
#include "integrators/tolerance.h"
#include "solvers/sun_shell.h"

#include <nvector/nvector_serial.h>

/* The first parameters of every entry, in this order. */
enum {
    DRAPE_FIRST_ORDER_RTOL,
    DRAPE_FIRST_ORDER_ATOL_X,
    DRAPE_FIRST_ORDER_ATOL_V,
    DRAPE_FIRST_ORDER_ORDER, /* of the method, or the highest; each entry derives its default */
    DRAPE_FIRST_ORDER_MAX_STEP,
    DRAPE_FIRST_ORDER_MAX_STEPS,
    DRAPE_FIRST_ORDER_LINEAR_SOLVER,
    DRAPE_FIRST_ORDER_MATRIX,
    DRAPE_FIRST_ORDER_OWN /* the first of the entry's own */
};
#define DRAPE_FIRST_ORDER_MOST (DRAPE_FIRST_ORDER_OWN + 1) /* parameters of an entry */

/* The order is a parameter of the entry. */
#define DRAPE_FIRST_ORDER_PARAMS(order_param)                                                                \
    [DRAPE_FIRST_ORDER_RTOL] = DRAPE_RTOL_PARAM, [DRAPE_FIRST_ORDER_ATOL_X] = DRAPE_ATOL_X_PARAM,            \
    [DRAPE_FIRST_ORDER_ATOL_V] = DRAPE_ATOL_V_PARAM, [DRAPE_FIRST_ORDER_ORDER] = order_param,                \
    [DRAPE_FIRST_ORDER_MAX_STEP] = DRAPE_MAX_STEP_PARAM,                                                     \
    [DRAPE_FIRST_ORDER_MAX_STEPS] = DRAPE_MAX_STEPS_PARAM,                                                   \
    [DRAPE_FIRST_ORDER_LINEAR_SOLVER] =                                                                      \
        DRAPE_CHOICE("linear_solver", 0, drape_linears_names, "name of a linear solver",                     \
                     .aliases = drape_linears_aliases),                                                      \
    [DRAPE_FIRST_ORDER_MATRIX] = DRAPE_CHOICE(                                                               \
        "matrix", 0, drape_first_order_matrices,                                                             \
        "matrix of Newton's corrections; symmetric: the symmetric part of the exact one, which differs "     \
        "from it with friction and dashpots; auto: symmetric, and exact for a while if that fails")
extern const char *const drape_first_order_matrices[];

#define DRAPE_FIRST_ORDER_TIGHT 1e-4 /* rtol below which the higher order is the default */

/* The part of an integrator that all have in common; the functions are declared below. */
#define DRAPE_FIRST_ORDER_OPS                                                                                \
    .own_steps = true, .gain = DRAPE_LOCAL_ERROR_GAIN, .smooth_forces = true,                                \
    .step = drape_first_order_step, .interpolate = drape_first_order_interpolate,                            \
    .interpolate_velocities = drape_first_order_interpolate_velocities,                                      \
    .restart = drape_first_order_restart, .work = drape_first_order_work,                                    \
    .archive = drape_first_order_archive, .bytes = drape_first_order_bytes,                                  \
    .destroy = drape_first_order_destroy

typedef struct drape_first_order drape_first_order;

/* A solver of SUNDIALS. Its functions may assume that there are free DOFs, except those that free. */
typedef struct drape_first_order_solver {
    const char *name;             /* for messages */
    size_t state_size;            /* of the state of the entry */
    int param_count;              /* of the entry */
    int loose_order, tight_order; /* defaults of the order: for rtol >= DRAPE_FIRST_ORDER_TIGHT, and below */
    /* Solves for a correction of Newton's iteration: drape_first_order_solve, or a function that calls
     * drape_first_order_solve_rhs. */
    int (*correct)(SUNLinearSolver, SUNMatrix, N_Vector, N_Vector, sunrealtype);
    /* Creates f->memory with all settings, from f->y and f->rate; attaches f->shell and f->newton. */
    bool (*create)(drape_first_order *f);
    void (*free)(void **memory);                   /* of the library */
    void (*destroy_vectors)(drape_first_order *f); /* of the entry; NULL: it has none */
    /* Restarts at t from y, y' in f->y, f->rate with a first step of h at most; 0: it chooses. */
    bool (*begin)(drape_first_order *f, double t, double h);
    /* One step towards end, at most to f->span[1], and how it ended. *t: where, y there in f->y. */
    drape_reason (*step)(drape_first_order *f, double end, double *t);
    int (*last_step)(void *memory, sunrealtype *h);
    int (*current_step)(void *memory, sunrealtype *h);
    int (*iterations)(void *memory, long *count);      /* of Newton, since `begin` */
    int (*errors)(drape_first_order *f, N_Vector out); /* local errors of the last step, per unknown */
    int (*dense)(drape_first_order *f, double t, N_Vector out); /* y within the last step */
    /* Its history. False: it cannot be read, and the solver must restart. */
    bool (*archive)(drape_first_order *f, drape_archive *a);
    void (*restart)(drape_first_order *f);      /* it must restart; NULL: nothing to forget */
    int (*vectors)(const drape_first_order *f); /* that the library holds, of 2 n numbers */
} drape_first_order_solver;

struct drape_first_order {
    const drape_first_order_solver *solver;
    drape_arena *arena;
    drape_system *system;
    const drape_model *model;
    const drape_motion *motion;
    double values[DRAPE_FIRST_ORDER_MOST];
    int64_t n; /* free DOFs; the system has 2 n unknowns */
    SUNContext sun;
    void *memory;                       /* of the library */
    N_Vector y, rate, weights, between; /* (x, v), (x', v'), absolute tolerances, dense output */
    drape_system_matrix *linear;        /* and D; NULL without free nodes */
    drape_sun_shell shell;              /* of the solve with it */
    drape_sun_newton newton;
    double *mass;             /* of the free DOFs */
    double *x, *v, *g;        /* nodes: where the residual was evaluated last; g there */
    double t;                 /* [s] when */
    double *fraction;         /* (node_count) scratch: that a retreat leaves of a prediction */
    const drape_ranks *ranks; /* the model's */
    double *with_copies[2];   /* (pattern.n) scratch of products of D, if there are ranks */
    double *reduced;          /* right-hand side of the reduced system (n) */
    double *dissipated;       /* nodes; NULL if nothing dissipates */

    /* The matrix, kept between steps. */
    double factored_cj;      /* c_j of the factors */
    bool symmetric;          /* the last matrix of the undamped iteration was the symmetric part */
    int64_t exact_remaining; /* exact matrices until the symmetric part is tried again, */
    int64_t exact_span;      /* of this many in a row */

    /* Kept between steps. */
    const double *internal; /* of the last accepted state */
    const double *before;   /* its positions (nodes) */
    double span[2];         /* [s] interval without a kink in the motion of pins and colliders */
    double reached;         /* [s] time of the library's state; NAN: it must restart */
    double from;            /* [s] time at which the last successful step began; NAN: none */
    double *powers[2];      /* [W] of what does work (drape_system_work_count), then that of dissipation, at
                               the time reached; scratch */
    double second;          /* [s] beginning of the second of simulated time in which steps are counted */
    double size, speed;     /* [m], [m/s]: of the scene, by which time is measured */
    int64_t tiny;           /* tiny steps in a row: drape_step_moves */
    double limit;           /* [s] of the size of the next step, by the effort of the last one: of ida */
    int64_t matrices;       /* factored before the present step; not archived */
    int64_t steps;          /* attempted in that second, except those that end an advance */
    long counted;           /* Newton iterations of the library that `work` contains already */
    drape_work work;

    /* Why callbacks failed in this step; the libraries keep only the sign. */
    bool nonfinite, crossing; /* the last residual */
    bool crossed;             /* some residual; the last that did: */
    drape_reason crossing_reason;
    drape_diagnostic crossing_pair;
    drape_status failure; /* < 0: the pattern could not be extended */
};

/* ---- For a solver ---- */

/* Index of free DOF i in arrays of nodes. */
static inline size_t drape_first_order_at(const drape_first_order *f, int64_t i)
{
    return 3 * (size_t)f->model->node_of_free[i / 3] + (size_t)(i % 3);
}
/* g at (t, y), into f->g. */
void drape_first_order_force(drape_first_order *f, double t, const double *y);
/* To be called with what follows from that force, `out` (2 n). 0; > 0: not finite, or it crosses contact;
 * < 0: fatal. start: the time at which the evaluation began [s of drape_system_clock]. */
int drape_first_order_judge(drape_first_order *f, double t, const double *out, double start);
/* The largest step as SUNDIALS takes it: 0 stands for none [s]. */
static inline double drape_first_order_max_step(const drape_first_order *f)
{
    const double max = f->values[DRAPE_FIRST_ORDER_MAX_STEP];
    return max > 0 ? max : 0; /* none is NaN */
}
/* For newton.retreat: shortens a prediction node by node until nothing passes through anything on the path
 * to it from the beginning of the step. */
bool drape_first_order_retreat(void *f, N_Vector y);
/* The size of the next step over that of the last one, of so many stages, if the error allows it to be
 * `growth`: less if the last one needed many matrices besides those that were due. */
double drape_first_order_limit(const drape_first_order *f, int stages, int due, double growth);
/* y' = (v, -M^-1 g): a callback of ARKODE; user: the drape_first_order. */
int drape_first_order_rhs(sunrealtype t, N_Vector y, N_Vector rate, void *user);
/* Weighted root mean square of a vector: 1 is the tolerance. */
double drape_first_order_norm(const drape_first_order *f, N_Vector vector);
/* Assembles K + c_j D + c_j^2 M at (t, y), and D; of I - gamma J, c_j = 1/gamma. 0, or < 0: fatal. */
int drape_first_order_jacobian(drape_first_order *f, double t, double cj, const double *y);
/* Solves with (r1, r2) as above. Status of the linear solver. */
int drape_first_order_solve(SUNLinearSolver solver, SUNMatrix matrix, N_Vector out, N_Vector in,
                            sunrealtype tolerance);
/* Solves (I - gamma J) out = in for 1/gamma = c_j of the factors. */
int drape_first_order_solve_rhs(SUNLinearSolver solver, SUNMatrix matrix, N_Vector out, N_Vector in,
                                sunrealtype tolerance);

/* ---- For an entry of the table; `state` begins with a drape_first_order ---- */

/* Creates the state of an entry with the solver and its parameters. Errors: out of memory; it must be
 * destroyed after one, too. */
drape_status drape_first_order_create(const drape_first_order_solver *solver, drape_arena *arena,
                                      drape_system *system, const double *values, void **state);
drape_status drape_first_order_step(void *state, const drape_state *in, drape_state *out, double h,
                                    drape_step_info *info);
void drape_first_order_interpolate(void *state, double t, double *x);
void drape_first_order_interpolate_velocities(void *state, double t, double *v);
void drape_first_order_restart(void *state, const drape_state *from);
drape_work drape_first_order_work(const void *state);
void drape_first_order_archive(void *state, drape_archive *a);
size_t drape_first_order_bytes(const void *state);
void drape_first_order_destroy(void **state);

#endif
