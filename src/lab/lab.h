/*
 * lab.h: what the experiments share. An experiment plans cases, prepares what all of them are
 * compared with, and reports. Cases and results are JSON from the start, as they are in the files: a report
 * is a function of experiment.json and of the lines, so what was run elsewhere or before needs no exception.
 *
 *     experiment.json   {"experiment", "drape", "scene", "scene_hash", "settings", "arguments", "cases": [case...]}
 *     case              {"tags": {what it is called}, "settings": {pointer: value}}, and "same_as": N where a
 *                       method ignores what distinguishes it from case N
 *     cases.jsonl       a result a line: {"case": N, "tags": {...}, "status": ..., what was measured}
 */
#ifndef DRAPE_LAB_LAB_H
#define DRAPE_LAB_LAB_H

#include "base/registry.h"
#include "drape/lab.h"
#include "lab/trace.h"

#include <jansson.h>
#include <stdio.h>

typedef struct lab lab;

typedef struct lab_experiment_ops {
    drape_entry entry;
    bool compares_costs; /* short cases are run several times, of which the cheapest counts */
    /* Adds cases (lab_add_case) and what else distinguishes the experiment to l->arguments. Errors:
     * DRAPE_E_ARGUMENT, DRAPE_E_MEMORY and those of loading the scene. */
    drape_status (*plan)(lab *l);
    /* Faults of what prepare will run, found before there is a folder. NULL: it runs nothing. */
    drape_status (*check)(lab *l);
    /* Makes l->reference or l->probe. NULL: there is nothing to prepare. */
    drape_status (*prepare)(lab *l);
    /* All cases have results: writes the CSV, pictures, and words (l->words) and figures (lab_page_*). */
    drape_status (*report)(lab *l);
} lab_experiment_ops;

extern const lab_experiment_ops *const lab_experiments[]; /* NULL-ended */
extern const drape_registry lab_experiment_registry;

struct lab {
    drape_context *ctx;
    const drape_lab_def *def;
    const lab_experiment_ops *experiment;
    char *folder;
    bool writing;              /* all that was given is read and good: a failure now is of the folder */
    bool claimed;              /* it had no experiment before */
    json_t *about;             /* experiment.json; owns: */
    json_t *cases, *arguments; /* borrowed from it */
    json_t **results;          /* one a case, NULL: not there yet */
    size_t count;              /* of cases */
    lab_trace reference;       /* what cases are compared with; no frames: nothing */
    double reference_error;    /* [m] RMS at the end, between it and a tighter one */
    lab_probe probe;           /* where final positions are taken; no points: nowhere */
    char *words_text;          /* of words, once it is closed */
    size_t words_size;
    FILE *words; /* lines for the terminal and the head of the page */
    char *page_text;
    size_t page_size;
    FILE *page; /* the body of the page */
};

/* Takes the references of tags and settings. same_as < 0: none. */
drape_status lab_add_case(lab *l, json_t *tags, json_t *settings, int64_t same_as);

/* A number or text of a case's result; NaN and "" where there is none. */
double lab_number(const json_t *result, const char *key);
const char *lab_word(const json_t *result, const char *key);
/* The same of its tags. */
double lab_tag_number(const json_t *result, const char *key);
const char *lab_tag_word(const json_t *result, const char *key);

bool lab_is_good(const json_t *result); /* it came to the end */

/* Whether the rows asked for contain it; where none were asked for, fallback. */
bool lab_wants_integrator(const lab *l, const char *name, bool fallback);

/* Faults of the def: an integrator that there is not, or that has no steps in time. */
drape_status lab_check_integrators(const lab *l);

#endif
