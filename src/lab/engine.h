/*
 * engine.h: what the experiments share. An experiment plans cases, prepares what all of them are compared
 * with, and reports. Cases and results are JSON from the start, as in the files: a report is a function of
 * experiment.json and of the lines, so results of other machines or earlier runs need no exception.
 *
 *     experiment.json   {"experiment", "drape", "scene", "scene_hash", "settings", "arguments",
 *                        "cases": [case...]}, and "results": [names] of what its figures show, which does
 *                        not distinguish experiments
 *     case              {"tags": {names and values that identify it}, "settings": {pointer: value}}, and
 *                       "same_as": N if the integrator ignores all that distinguishes it from case N
 *     cases.jsonl       a result a line: {"case": N, "tags": {...}, "status": ..., what was measured}
 */
#ifndef DRAPE_LAB_ENGINE_H
#define DRAPE_LAB_ENGINE_H

#include "base/arena.h"
#include "base/registry.h"
#include "drape/lab.h"

#include "integrators/integrator.h"
#include "io/file.h"
#include "io/folder.h"
#include "io/json.h"
#include "lab/trace.h"

#include <jansson.h>
#include <stdatomic.h>
#include <stdio.h>

typedef struct lab lab;

/* A case to simulate, and the measurements to make. */
typedef struct lab_request {
    const drape_lab_def *def;   /* scene, settings of all cases, cancel */
    const char *scene;          /* name of its file; NULL: the def's */
    const char *identity;       /* that the scene must have when the case is done (lab_identify) */
    const json_t *identified;   /* settings with which it has that identity; NULL: none */
    const json_t *settings;     /* {pointer: value} of the case; NULL: none */
    const lab_trace *reference; /* NULL or no frames: nothing to compare with */
    double reference_error;     /* estimate of its error: [m], or without `times` a share of the diagonal */
    const double *times;        /* (time_count) [s] at which steps end, and at which it is compared and
                                   recorded; NULL: at frames, which may lie within steps, and at the end,
                                   by geometry/deviation.h */
    size_t time_count;
    const int32_t
        *compared;     /* (cloths) so many nodes of each have their positions in the result; NULL: none */
    lab_trace *record; /* its frames and, last, its end; or its states at `times`; none of a run that
                                   did not complete. NULL: not recorded. Made in: */
    drape_arena *arena;
    double seconds;  /* CPU: a run that takes more is stopped */
    double deadline; /* [s] of the wall clock: a run that is not done by then is abandoned; 0: none */
    int repeats;     /* the least CPU time of so many counts */
    const atomic_bool *given_up; /* another thread failed; NULL: there is none */
} lab_request;

typedef struct lab_experiment_ops {
    drape_entry entry;
    bool compares_costs; /* short cases are run several times, of which the cheapest counts */
    /* Adds cases (lab_add_case) and what else distinguishes the experiment to l->arguments. The integrators
     * of the def are known to exist and to have steps in time. Errors:
     * DRAPE_E_ARGUMENT, DRAPE_E_MEMORY and those of loading the scene. */
    drape_status (*plan)(lab *l);
    /* Finds faults in what `prepare` will run, before there is a folder. NULL: `prepare` runs nothing. */
    drape_status (*check)(lab *l);
    /* Finds faults of the experiment.json of a merge that lab_check_about cannot see, before there is a
     * folder. NULL: there are none to look for. Errors: DRAPE_E_PARSE, DRAPE_E_ARGUMENT. */
    drape_status (*verify)(lab *l);
    /* Sets the scene of a case, and what the case is compared with, where the experiment has several scenes.
     * NULL: all cases are of the def's scene, and compared with l->reference. */
    void (*request)(const lab *l, size_t index, lab_request *request);
    /* Makes l->reference or l->compared. NULL: there is nothing to prepare. */
    drape_status (*prepare)(lab *l);
    /* Writes figures, sentences (l->summary) and the body of the page (lab_page_*). All cases have
     * results; with `partial`, any of them may be missing. */
    drape_status (*report)(lab *l);
    bool partial; /* a def may have a budget, after which the cases with the highest ranks are left out */
    bool shows_results; /* a def may name results that the figures show */
    /* The cases may be others at each call in the same folder, which keeps the lines of all; the scene
     * compiles without their settings. */
    bool grows;
} lab_experiment_ops;

extern const lab_experiment_ops *const lab_experiments[]; /* NULL-ended */
extern const drape_registry lab_experiment_registry;

struct lab {
    drape_context *ctx;
    drape_arena arena; /* of folder, the array of results, reference */
    const drape_lab_def *def;
    drape_lab_outcome *outcome; /* the caller's */
    const lab_experiment_ops *experiment;
    char *folder;
    drape_folder *out;  /* the same, open; NULL before its experiment is there */
    bool input_is_good; /* all input has been read and checked: a failure now is of the output folder */
    bool claimed;       /* the folder had no experiment before */
    bool resumable;     /* what prepare saved is worth keeping although it failed */
    json_t *about;      /* experiment.json; owned, and owns: */
    json_t *cases, *arguments; /* borrowed from it */
    json_t **results;          /* one a case, owned; NULL: not there yet */
    json_t *others;            /* lines of the folder of cases that this call did not ask for; owned */
    size_t count;              /* of cases */
    lab_trace reference;       /* the motion that cases are compared with; no frames: none */
    double reference_error;    /* estimate of the largest RMS error of its frames, a share of the diagonal */
    double start;              /* [s] wall clock at the start of the run */
    void *own;                 /* of the experiment, in the arena */
    int32_t *compared;         /* in the arena; of requests */
    FILE *summary;             /* sentences for the terminal and the head of the page, one a line */
    char *summary_text;        /* valid when summary is flushed or closed */
    size_t summary_size;
    FILE *page; /* the body of the page */
    char *page_text;
    size_t page_size, lead_size; /* lead: what comes right after the first sentence */
};

/* ---- engine_json.c: cases and results as JSON ---- */

/* Adds a case of rank 0. Takes the references of tags and settings. same_as < 0: none. */
drape_status lab_add_case(lab *l, json_t *tags, json_t *settings, int64_t same_as);

/* Whether a case is run by this shard: it is its own, and not the same as another one. */
bool lab_is_ours(const lab *l, size_t i);

/* The settings with which the scene of the experiment is identified (lab_request): those of its first case,
 * unless cases may be added before that. */
const json_t *lab_identified(const lab *l);

/* What a case asks for: its settings, and what all cases of the experiment, or it alone, are compared
 * with. */
lab_request lab_request_of(const lab *l, size_t index);

/* A number or text of an object; NaN and "" where there is none. */
double lab_number(const json_t *object, const char *key);
const char *lab_text(const json_t *object, const char *key);
/* The same for its tags. */
double lab_tag_number(const json_t *result, const char *key);
const char *lab_tag_text(const json_t *result, const char *key);

bool lab_is_good(const json_t *result); /* whether there is a result and the run completed */

const drape_integrator_ops *lab_find_integrator(const char *name); /* NULL: there is none */

/* Whether the integrators that the def names include this one; fallback if it names none. */
bool lab_wants_integrator(const lab *l, const char *name, bool fallback);

bool lab_has_param(const drape_entry *entry, const char *name);

/* Whether an integrator ignores the value at a pointer: "/integrator/..." that is not one of its
 * parameters. */
bool lab_ignores(const drape_integrator_ops *integrator, const char *pointer);

/* ---- engine_run.c: a case, the scene with its settings, simulated and measured ---- */

/* The scene with its settings, and its model; model NULL: only whether it compiles. Errors: as of
 * drape_scene_load and drape_scene_compile; *scene is to be destroyed in any case. */
drape_status lab_load_scene(drape_context *ctx, const lab_request *request, drape_scene **scene);
drape_status lab_load(drape_context *ctx, const lab_request *request, drape_model **model);

/* A hash as digits. */
void lab_digits(uint64_t hash, char digits[17]);

/* The identity of a scene and of all files that it names, as digits: a hash of its text and of these
 * files, and of the compiled model where there are any. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status lab_hash_scene(drape_context *ctx, const char *path, const drape_model *model, char digits[17]);

/* The identity of the scene of a request as its files are now, with the settings `identified`: those of one
 * case stand for all cases, since a scene may lack what the cases set. Errors: those of loading. */
drape_status lab_identify(drape_context *ctx, const lab_request *request, char digits[17]);

/* Whether the scene still has the identity of the request. Errors: those of loading, DRAPE_E_ARGUMENT (it has
 * another one). */
drape_status lab_check_identity(drape_context *ctx, const lab_request *request);

/* Runs it. *result: what was measured, to be freed by the caller; a simulation that stops is a result.
 * NULL: the deadline passed before it was done. Errors: those of loading, DRAPE_E_MEMORY, DRAPE_E_STOPPED
 * (cancelled). */
drape_status lab_run(drape_context *ctx, const lab_request *request, json_t **result);

/* ---- engine_plan.c: what a sweep will take, from a sample of its cases ---- */

/* The cases of this shard that are run for a plan of def->plan cases, spread evenly over all of them, in the
 * order in which they are to be run: at most def->plan, and the same ones in every call. cases: room for
 * l->count. Returns their number. */
size_t lab_plan_sample(lab *l, size_t *cases);

/* Writes plan.json, and its sentences into the summary. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status lab_write_plan(lab *l);

/* ---- engine_schema.c: checks of experiment.json and cases.jsonl, which any program may have written ---- */

/* Checks the content of experiment.json; file: its path, for the message. From then on its members have
 * the types above, tags and names no control characters, same_as is an earlier case that has a result
 * of its own, and the cases of a series stand side by side. Errors: DRAPE_E_PARSE, DRAPE_E_MEMORY. */
drape_status lab_check_about(drape_context *ctx, const char *file, json_t *about);

/* The same for a line of cases.jsonl beside the cases of the experiment; fault: why line is NULL. */
drape_status lab_check_line(const lab *l, const char *file, int64_t number, json_t *line,
                            const json_error_t *fault);

#endif
