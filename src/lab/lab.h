/*
 * lab.h: what the experiments share. An experiment plans cases, prepares what all of them are compared with,
 * and reports. Cases and results are JSON from the start, as in the files: a report is a function of
 * experiment.json and of the lines, so results of other machines or earlier runs need no exception.
 *
 *     experiment.json   {"experiment", "drape", "scene", "scene_hash", "settings", "arguments",
 *                        "cases": [case...]}, and "results": [names] of what its figures show, which does
 *                        not distinguish experiments
 *     case              {"tags": {names and values that identify it}, "settings": {pointer: value}}, and
 *                       "same_as": N if the integrator ignores all that distinguishes it from case N
 *     cases.jsonl       a result a line: {"case": N, "tags": {...}, "status": ..., what was measured}
 */
#ifndef DRAPE_LAB_LAB_H
#define DRAPE_LAB_LAB_H

#include "base/arena.h"
#include "base/registry.h"
#include "drape/lab.h"

#include "integrators/integrator.h"
#include "io/file.h"
#include "io/folder.h"
#include "io/json.h"
#include "lab/trace.h"

#include <jansson.h>
#include <stdio.h>

typedef struct lab lab;
struct lab_request;

typedef struct lab_experiment_ops {
    drape_entry entry;
    bool compares_costs; /* short cases are run several times, of which the cheapest counts */
    /* Adds cases (lab_add_case) and what else distinguishes the experiment to l->arguments. The integrators
     * of the def are known to exist and to have steps in time. Errors:
     * DRAPE_E_ARGUMENT, DRAPE_E_MEMORY and those of loading the scene. */
    drape_status (*plan)(lab *l);
    /* Faults in what prepare will run, found before there is a folder. NULL: it runs nothing. */
    drape_status (*check)(lab *l);
    /* Faults of an experiment.json that is merged, before there is a folder, which lab_check_about cannot
     * see. NULL: there are none. Errors: DRAPE_E_PARSE, DRAPE_E_ARGUMENT. */
    drape_status (*verify)(lab *l);
    /* Completes the request of a case: its scene and what it is compared with, if these are not those of
     * the def and of all cases. NULL: they are. */
    void (*request)(const lab *l, size_t index, struct lab_request *request);
    /* Makes l->reference or l->probe. NULL: there is nothing to prepare. */
    drape_status (*prepare)(lab *l);
    /* Writes figures, sentences (l->summary) and the body of the page (lab_page_*). All cases have
     * results; with `partial`, any of them may be missing. */
    drape_status (*report)(lab *l);
    bool partial; /* a def may have a budget, after which the cases with the highest ranks are left out */
    bool shows_results; /* a def may name results that the figures show */
} lab_experiment_ops;

extern const lab_experiment_ops *const lab_experiments[]; /* NULL-ended */
extern const drape_registry lab_experiment_registry;

struct lab {
    drape_context *ctx;
    drape_arena arena; /* of folder, the array of results, reference, probe */
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
    size_t count;              /* of cases */
    lab_trace reference;       /* the motion that cases are compared with; no frames: none */
    double reference_error;    /* [m] RMS at the end: its distance from the next less accurate one */
    double start;              /* [s] wall clock at the start of the run */
    void *own;                 /* of the experiment, in the arena */
    lab_probe probe;           /* where final positions are taken; no points: nowhere */
    FILE *summary;             /* sentences for the terminal and the head of the page, one a line */
    char *summary_text;        /* valid when summary is flushed or closed */
    size_t summary_size;
    FILE *page; /* the body of the page */
    char *page_text;
    size_t page_size;
};

/* Adds a case of rank 0. Takes the references of tags and settings. same_as < 0: none. */
drape_status lab_add_case(lab *l, json_t *tags, json_t *settings, int64_t same_as);

/* Sets the rank of the case that was added last: cases of low rank are run first. */
void lab_rank_case(lab *l, int rank);

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

#endif
