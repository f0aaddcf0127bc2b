/*
 * lab.h: experiments on a scene: work against accuracy, maps of stability, orders of convergence. They are a
 * separate library, libdrape_lab, because their statistics link GSL (GPL) and libdrape does not.
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

/* A value of the scene, as for drape_scene_set: a JSON pointer and a JSON text. */
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
    int repeats;         /* tradeoff: runs per case, of which the smallest CPU time counts; default 3 */
    int jobs;            /* threads, 1 to 256; default 1, because cases that run side by side slow each other
                            down */
    int shard, shards;   /* this shard runs the cases whose number is shard - 1 modulo shards; default 1 of
                            1 */
    double
        budget_seconds; /* tradeoff: [s] wall-clock time of the call, after which the cases that are left are
                              left out, the least telling ones; the reference takes at most half; default 0:
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
 * same experiment are kept as they are. With def->plan it runs a sample and writes plan.json, and no figures
 * and page. Errors: DRAPE_E_ARGUMENT (no such experiment, an invalid def, a
 * setting that no case uses, a folder that holds another experiment), those of loading the scene,
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

DRAPE_C_END

#endif
