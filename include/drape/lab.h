/*
 * lab.h: experiments on a scene: work against accuracy, maps of stability, orders of convergence; and modes:
 * eigenfrequencies and buckling loads. They are a separate library, libdrape_lab, because their statistics
 * link GSL (GPL), and modes ARPACK-NG with LAPACK, and libdrape does not.
 *
 * An experiment is a list of cases, each of which is the scene with some values changed. The result of a case
 * is a line of JSON in the output folder. An interrupted run therefore resumes where it stopped, and shards
 * of a sweep that ran separately can be merged: the report needs only the lines.
 *
 * Threads: a call uses `jobs` threads of its own, each with its own context. progress is called by one thread
 * at a time, but not always by the same one.
 */
#ifndef DRAPE_LAB_H
#define DRAPE_LAB_H

#include "drape.h"

DRAPE_C_BEGIN

/* A value of the scene, as for drape_scene_set: a JSON pointer and a JSON text. Of /integrator/dt and
 * /integrator/rtol a tradeoff takes the values that it compares, "1/60,1/240". */
typedef struct drape_lab_setting {
    const char *pointer, *value; /* "/integrator/dt", "0.01" */
} drape_lab_setting;

/* Reports the progress of a sweep: done of total cases of this shard need no more work. total is 0 while the
 * reference solution is computed. seconds_left is NaN while it is unknown. */
typedef void drape_lab_progress(void *user, int64_t done, int64_t total, double seconds_left);

/* Returns whether to stop. If so, cases in progress are abandoned, and the results of finished cases are
 * kept. Called by all threads at any time, so it must be thread-safe. */
typedef bool drape_lab_cancel(void *user);

/* The definition of a run. Initialise with drape_lab_def_init. Strings need only live during the call. */
typedef struct drape_lab_def {
    size_t struct_size;                /* set by drape_lab_def_init */
    const char *scene;                 /* name of a scene file */
    const char *folder;                /* output folder; created if it does not exist */
    const drape_lab_setting *settings; /* applied to all cases */
    size_t setting_count;              /* length of settings */
    const char *const *integrators;    /* names of integrators; none: the default of the experiment */
    size_t integrator_count;           /* length of integrators */
    const char *const *axes;           /* stability: 1 to 3 axes of the form "/pointer=from:to:n" or
                                          "/pointer=from:to:nlog" */
    size_t axis_count;                 /* length of axes */
    int levels;                        /* converge: number of refinements, 3 to 12; default 6 */
    bool space;                        /* converge: refine the mesh, too */
    double strain_limit;               /* stability: a result in which an edge is strained by more counts as
                                          unphysical; default 0.2 */
    double case_seconds; /* [s] CPU time of a case, after which it is stopped as over budget; default 30 */
    int repeats;         /* tradeoff: runs per short case, of which the least CPU time counts; default 3 */
    int jobs;            /* threads, 1 to 256; default 1, because cases that run side by side slow each other
                            down */
    int shard, shards;   /* this shard runs the cases whose number is shard - 1 modulo shards; default 1 of
                            1 */
    double
        budget_seconds; /* tradeoff: [s] wall-clock time of the call, after which the cases that are left are
                              left out, the dearest ones; the reference takes at most half; default 0:
                              none is left out */
    drape_lab_progress *progress; /* NULL: no reports */
    drape_lab_cancel *cancel;     /* NULL: never */
    void *user;                   /* passed to progress and cancel */
    const char *const *scenes; /* ivp: names of scene files, each with a reference, the first that of `scene`;
                                     NULL: `scene` alone */
    size_t scene_count;        /* length of scenes */
    const char *const *results; /* stability: names of results that maps show in colours, and curves over a
                                   single axis, such as "energy_drift" or "iterations_per_step"; default:
                                   none, over a single axis "energy_drift" */
    size_t result_count;        /* length of results */
    int plan; /* > 0: run only so many cases, spread over all of them, and write what all of them will take,
                 into plan.json and the text of the outcome; default 0 */
} drape_lab_def;

/* Fills *def with the defaults. Pass the caller's sizeof(drape_lab_def) as struct_size. Nothing if def is
 * NULL. */
DRAPE_API void drape_lab_def_init(drape_lab_def *def, size_t struct_size);

/* The outcome of a run or a merge. */
typedef struct drape_lab_outcome {
    int64_t cases;    /* cases of the experiment */
    int64_t done;     /* cases that have a result by now */
    int64_t resumed;  /* those of them whose result was found in the folder */
    int64_t failed;   /* those of them that did not complete */
    int64_t left_out; /* cases without a result because the budget was used up; the text names them */
    int64_t rejected; /* steps that were rejected in all of them together */
    bool input;       /* a failure is due to the input, not to the output folder */
    char *text;       /* summary of the report, several lines; free it with drape_lab_outcome_free */
} drape_lab_outcome;

/* Frees the text of an outcome. The struct itself belongs to the caller. */
DRAPE_API void drape_lab_outcome_free(drape_lab_outcome *outcome);

/* Runs "tradeoff", "stability", "converge" or "ivp" and writes cases.jsonl, experiment.json, results.csv,
 * figures (SVG and PDF) and report.html into the folder. A shard, whose folder other shards may share,
 * writes only experiment.json and cases-1-of-4.jsonl; the merge writes the rest. Existing results of the
 * same experiment are kept as they are; a tradeoff that is not a shard may have other cases each time. With
 * def->plan it runs a sample and writes plan.json, and no figures and page. Errors: DRAPE_E_ARGUMENT (no such
 * experiment, an invalid def, a setting that no case uses, a folder that holds another experiment, methods
 * compared on a scene with an accuracy), those of loading the scene,
 * DRAPE_E_FILE, DRAPE_E_SOLVER (the reference could not be computed: the folder is left as it was, but for
 * levels of the reference, with which the same call with a larger budget_seconds continues), DRAPE_E_MEMORY,
 * DRAPE_E_STOPPED (cancelled). */
DRAPE_API drape_status drape_lab_run(drape_context *ctx, const char *experiment, const drape_lab_def *def,
                                     drape_lab_outcome *outcome);

/* Merges the results of several folders into one and writes the report on them. Errors: DRAPE_E_FILE,
 * DRAPE_E_PARSE (a line that is not a result), DRAPE_E_ARGUMENT (folders of different experiments),
 * DRAPE_E_MEMORY. */
DRAPE_API drape_status drape_lab_merge(drape_context *ctx, const char *const *folders, size_t count,
                                       const char *folder, drape_lab_outcome *outcome);

/* ---- Modes ---- */

/* What kind of mode it is. */
typedef enum drape_mode_kind {
    DRAPE_MODE_VIBRATION, /* value > 0: it vibrates with omega = sqrt(value) */
    DRAPE_MODE_ZERO,      /* |value| is not more than its rounding error: a motion without stiffness, such as
                             those of a free sheet as a rigid body */
    DRAPE_MODE_UNSTABLE,  /* value < 0: it grows as exp(sqrt(-value) t) */
    DRAPE_MODE_BUCKLING   /* value is a load factor */
} drape_mode_kind;

/* The definition of a computation of modes. Initialise with drape_modes_def_init. */
typedef struct drape_modes_def {
    size_t struct_size; /* set by drape_modes_def_init */
    int32_t count;      /* modes to find, from 1 to one less than the degrees of freedom; default 6 */
    bool buckling;      /* buckling loads instead of frequencies; default false */
    double load_factor; /* buckling: the multiple of the scene's loads under which the present state is an
                           equilibrium, >= 0: 1 after a static step, 0 for a state without loads; default 1 */
} drape_modes_def;

/* Fills *def with the defaults. Pass the caller's sizeof(drape_modes_def) as struct_size. Nothing if def is
 * NULL. */
DRAPE_API void drape_modes_def_init(drape_modes_def *def, size_t struct_size);

/* A mode u: K u = value M u for vibrations, (K + (value - load_factor) K') u = 0 for buckling. */
typedef struct drape_mode {
    drape_mode_kind kind; /* what kind it is */
    double value;        /* omega^2 [1/s2], the square of the angular frequency; or the factor of the loads at
                             which the cloth buckles, 1 being the loads of the scene */
    double frequency;    /* sqrt(value)/(2 pi) [Hz]; 0 unless the mode vibrates */
    double mass;         /* u'M u [kg]: the modal mass for this scale of u */
    double residual;     /* |K u - value M u| over |K| |u| + |value| M |u|, in maximum norms with absolute
                             entries: near 1e-16 if u is an eigenvector to rounding; likewise for buckling */
    double error;        /* bound on the relative error of value: from the residual of the shifted and
                             inverted problem and from rounding of K; INFINITY for a mode without stiffness */
    const double *shape; /* u (node_count x 3), 0 on pinned nodes; its largest displacement of a node is 1 */
} drape_mode;

/* The modes of a state, in ascending order of value. Owned by the library, between drape_sim_modes and
 * drape_modes_free. */
typedef struct drape_modes {
    int32_t count;     /* modes found: those asked for */
    drape_mode *modes; /* (count) */
    int64_t below; /* eigenvalues below the last mode's, or up to it, by the signs of the pivots of L D L':
                          all of them are among the modes */
    double force;  /* [N] largest force on a free node at the load factor; in an equilibrium within the
                          tolerance of the step that found it */
    void *own;     /* of the library */
} drape_modes;

/* Computes the lowest modes about the present state of a sim, which is not changed: undamped vibrations about
 * it, K u = omega^2 M u, with the exact stiffness K = d2E/dx2 there, which contains the stress and the loads,
 * without pinned nodes, and with the masses M of the nodes; or the lowest loads at which it buckles, by
 * linear extrapolation of K along the equilibrium path through it, with K' = dK/dfactor, all loads of the
 * scene (terms that act from outside, such as gravity) being multiplied by one factor. The state should be
 * an equilibrium: see `force`. Friction holds nothing; contact that acts has its stiffness.
 *
 * Eigenvalues are found by ARPACK-NG with the inverse of K - shift M, and counted independently by the
 * inertia of a factorisation between the last mode and the next, so that none is missed, a repeated one
 * neither. Digits beyond `error` depend on the LAPACK of the machine.
 *
 * *out is empty after a failure. Errors: DRAPE_E_ARGUMENT (NULL, an invalid def, too many modes, no free
 * node, a stiffness that is not symmetric; for buckling: no load deforms the cloth, it is in contact, or
 * the state is unstable already), DRAPE_E_SOLVER (not all modes converged or were counted), DRAPE_E_STOPPED
 * (cancelled), DRAPE_E_MEMORY. Thread-safety: as the sim; of several calls at once, one at a time
 * searches. */
DRAPE_API drape_status drape_sim_modes(drape_sim *sim, const drape_modes_def *def, drape_modes *out);

/* Frees the modes and empties the struct, which belongs to the caller. NULL and an empty one are allowed. */
DRAPE_API void drape_modes_free(drape_modes *modes);

/* ---- Paths of equilibria ---- */

/* What lies between a point of a path and the one before it. */
typedef enum drape_path_event {
    DRAPE_PATH_REGULAR,     /* nothing */
    DRAPE_PATH_LIMIT,       /* a limit point: the factor has turned round */
    DRAPE_PATH_BIFURCATION, /* the number of unstable modes has changed, but the factor goes on */
    DRAPE_PATH_SWITCHED     /* nothing: it is the first point of a branch, and the one before is its origin */
} drape_path_event;

/* A point of a path: an equilibrium under the scene's loads times a factor. Valid during the call that it is
 * passed to. */
typedef struct drape_path_point {
    int64_t number;         /* from 0 */
    drape_path_event event; /* what lies before it */
    double factor;          /* of the loads */
    double arc;             /* [m] length of the path so far: root mean square over the masses of nodes */
    double elastic;         /* [J] elastic energy */
    double potential;       /* [J] potential of the loads at this factor */
    int64_t unstable;       /* modes in which it is unstable: negative pivots of K; -1: not known */
    int iterations;         /* of Newton's method */
    double residual;        /* [N] largest force that is left on a free node */
} drape_path_point;

/* Called at each point, which is then the state of the sim. Returns 0 to continue; > 0: the path ends here,
 * with DRAPE_OK; < 0: it ends with this status. It must not change the sim. */
typedef drape_status drape_path_observer(void *user, drape_sim *sim, const drape_path_point *point);

/* The definition of a path. Initialise with drape_path_def_init. */
typedef struct drape_path_def {
    size_t struct_size; /* set by drape_path_def_init */
    double from;    /* factor of the loads at the first point, which Newton's method finds from the present
                           state; default 0 */
    double to;      /* factor at which the path ends, once it has reached it; default 1 */
    double step;    /* first increment of the factor, > 0; default 0.05 */
    double max_arc; /* [m] longest step along the arc; 0: a fiftieth of the scene; default 0 */
    bool
        load_control; /* steps of the factor instead of the arc: it cannot pass limit points; default false */
    int branch; /* at the first bifurcation, 1 or -1: follow the branch to either side along the unstable
                           mode; 0: stay on the path, as with load_control; default 0 */
    int64_t max_points; /* after so many points the path ends with DRAPE_OK; default 1000 */
    double tolerance;   /* of the residual, in parts of the largest force on a node; default 1e-8 */
    drape_path_observer *observer; /* NULL: none */
    void *user;                    /* passed to the observer */
} drape_path_def;

/* Fills *def with the defaults. Pass the caller's sizeof(drape_path_def) as struct_size. Nothing if def is
 * NULL. */
DRAPE_API void drape_path_def_init(drape_path_def *def, size_t struct_size);

/* Follows a path of equilibria: all loads of the scene, that is its terms that act from outside, such as
 * gravity, are multiplied by one factor, which is one more unknown; pins are where they are at the time of
 * the state, and loads that vary in time have the value of that time, but at t = 0 the one that the scene
 * gives. Each step is a prediction along the tangent and Newton's method with the exact stiffness and a
 * constraint: corrections are normal to the step so far (Ramm 1981), so that the path may turn round at limit
 * points. A step that fails (no convergence, a degenerate element, a matrix that cannot be solved with) is
 * rejected and made again with half its length. Damping, velocities and the wind have no effect. The sim's
 * state becomes each point in turn, with velocities 0; at another factor than 1 it is no equilibrium of the
 * scene itself.
 *
 * Errors: DRAPE_E_ARGUMENT (NULL, an invalid def, no free node, a scene with colliders or self-contact,
 * loads that vanish or that rounding hides), DRAPE_E_STEP_TOO_SMALL (steps fail, however short),
 * DRAPE_E_SOLVER (the first point was not found, or the branch), DRAPE_E_STOPPED (cancelled),
 * DRAPE_E_MEMORY, those of the observer. After one the sim is at the last point that was reported. Thread-
 * safety: as the sim. */
DRAPE_API drape_status drape_sim_path(drape_sim *sim, const drape_path_def *def);

DRAPE_C_END

#endif
