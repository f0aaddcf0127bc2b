/* experiment.c: an experiment from its def to its report, and the merging of shards. */
#include "drape/lab.h"

#include "base/hash.h"
#include "integrators/integrator.h"
#include "io/file.h"
#include "lab/grid.h"
#include "lab/run.h"
#include "lab/sweep.h"
#include "lab/text.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define ABOUT "experiment.json"

void drape_lab_def_init(drape_lab_def *def, size_t struct_size)
{
    const drape_lab_def defaults = {.struct_size = struct_size,
                                    .levels = 6,
                                    .strain_limit = 0.2,
                                    .case_seconds = 30,
                                    .repeats = 3,
                                    .jobs = 1,
                                    .shard = 1,
                                    .shards = 1};
    memset(def, 0, struct_size);
    memcpy(def, &defaults, struct_size < sizeof defaults ? struct_size : sizeof defaults);
}

void drape_lab_outcome_free(drape_lab_outcome *outcome)
{
    free(outcome->text);
    *outcome = (drape_lab_outcome){0};
}

/* ---- What experiments read ---- */

static double number_of(const json_t *object, const char *key)
{
    const json_t *value = json_object_get(object, key);
    return json_is_number(value) ? json_number_value(value) : NAN;
}

static const char *word_of(const json_t *object, const char *key)
{
    const char *text = json_string_value(json_object_get(object, key));
    return text ? text : "";
}

double lab_number(const json_t *result, const char *key)
{
    return number_of(result, key);
}

const char *lab_word(const json_t *result, const char *key)
{
    return word_of(result, key);
}

double lab_tag_number(const json_t *result, const char *key)
{
    return number_of(json_object_get(result, "tags"), key);
}

const char *lab_tag_word(const json_t *result, const char *key)
{
    return word_of(json_object_get(result, "tags"), key);
}

bool lab_is_good(const json_t *result)
{
    return strcmp(lab_word(result, "status"), drape_status_name(DRAPE_OK)) == 0;
}

/* ---- Planning ---- */

drape_status lab_add_case(lab *l, json_t *tags, json_t *settings, int64_t same_as)
{
    json_t *one = json_pack("{s:o, s:o}", "tags", tags, "settings", settings);
    bool failed = !one || (same_as >= 0 && json_object_set_new(one, "same_as", json_integer(same_as))) ||
                  json_array_append_new(l->cases, one);
    return failed ? drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for the cases") : DRAPE_OK;
}

bool lab_wants_integrator(const lab *l, const char *name, bool fallback)
{
    for (size_t i = 0; i < l->def->integrator_count; i++)
        if (strcmp(l->def->integrators[i], name) == 0)
            return true;
    return l->def->integrator_count == 0 && fallback;
}

drape_status lab_check_integrators(const lab *l)
{
    for (size_t i = 0; i < l->def->integrator_count; i++) {
        const char *name = l->def->integrators[i];
        int k;
        drape_status status = drape_registry_choose(l->ctx, &drape_integrator_registry, "", name, &k);
        if (status)
            return status;
        if (drape_integrators[k]->timeless)
            return drape_fail(l->ctx, DRAPE_E_ARGUMENT,
                              "\"%s\" has no steps in time: %s needs integrators that have them", name,
                              l->experiment->entry.name);
    }
    return DRAPE_OK;
}

/* Of the scene's text: lines of a scene that was changed since are not of this experiment. */
static drape_status hash_scene(lab *l, char *digits, size_t size)
{
    char *text;
    size_t length;
    drape_status status = lab_read_text(l->ctx, NULL, l->def->scene, &text, &length);
    if (!status)
        snprintf(digits, size, "%016llx",
                 (unsigned long long)drape_hash_bytes(DRAPE_HASH_START, text, length));
    free(text);
    return status;
}

static json_t *settings_of(const drape_lab_def *def)
{
    json_t *array = json_array();
    for (size_t i = 0; i < def->setting_count; i++)
        json_array_append_new(array, json_pack("[s,s]", def->settings[i].pointer, def->settings[i].value));
    return array;
}

static drape_status plan(lab *l)
{
    char digits[17];
    drape_status status = hash_scene(l, digits, sizeof digits);
    if (status)
        return status;
    l->about = json_pack("{s:s, s:s, s:s, s:s, s:o, s:{}, s:[]}", "experiment", l->experiment->entry.name,
                         "drape", drape_version(), "scene", l->def->scene, "scene_hash", digits, "settings",
                         settings_of(l->def), "arguments", "cases");
    l->cases = json_object_get(l->about, "cases");
    l->arguments = json_object_get(l->about, "arguments");
    if (!l->cases || !l->arguments)
        return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "the settings are not UTF-8, or there is no memory");
    return l->experiment->plan(l);
}

/* ---- The folder ---- */

static drape_status parse_about(drape_context *ctx, const char *folder, json_t **about)
{
    char *text;
    size_t size;
    json_error_t fault;
    drape_status status = lab_read_text(ctx, folder, ABOUT, &text, &size);
    *about = status ? NULL : json_loadb(text, size, 0, &fault);
    free(text);
    if (!status && !*about)
        status = drape_fail(ctx, DRAPE_E_PARSE, "%.400s/" ABOUT ":%d:%d: %.200s", folder, fault.line,
                            fault.column, fault.text);
    return status;
}

/* Shards that begin at once in one folder all write the same: each under a name of its own, which then becomes the
 * file's at once, so that nobody reads half of it or misses it. */
static drape_status write_about(lab *l)
{
    char own[64], from[4200], to[4200];
    char *text = json_dumps(l->about, JSON_INDENT(1) | JSON_REAL_PRECISION(17));
    snprintf(own, sizeof own, "experiment-%d-of-%d.json", l->def->shard, l->def->shards);
    snprintf(from, sizeof from, "%s/%s", l->folder, own);
    snprintf(to, sizeof to, "%s/" ABOUT, l->folder);
    drape_status status = text ? lab_write_text(l, own, text, strlen(text))
                               : drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for " ABOUT);
    free(text);
    return !status && rename(from, to) ? drape_file_fail(l->ctx, "write", to, errno) : status;
}

/* A folder goes on with the experiment that it has, or is given this one. */
static drape_status claim_folder(lab *l)
{
    char path[4096];
    struct stat info;
    l->writing = true;
    drape_status status = drape_folder_make(l->ctx, l->folder);
    if (status)
        return status;
    snprintf(path, sizeof path, "%s/" ABOUT, l->folder);
    if (stat(path, &info) == 0) {
        json_t *there = NULL;
        l->writing = false;
        status = parse_about(l->ctx, l->folder, &there);
        if (!status && !json_equal(there, l->about))
            status = drape_fail(l->ctx, DRAPE_E_ARGUMENT,
                                "\"%.400s\" holds another experiment, or this one of another scene or "
                                "version; name another folder, or remove it",
                                l->folder);
        json_decref(there);
        l->writing = !status;
        return status;
    }
    l->claimed = true;
    return write_about(l);
}

/* Without a reference there will be no case: a folder that has nothing else is not left to an experiment that the next
 * attempt, with more time, is not. */
static void give_back(const lab *l)
{
    char path[4200];
    snprintf(path, sizeof path, "%s/" ABOUT, l->folder);
    remove(path);
    rmdir(l->folder); /* fails where there is anything in it */
}

/* The lines of before, and what cases are compared with. */
static drape_status prepare(lab *l, int64_t *resumed)
{
    l->writing = false;
    drape_status status = lab_read_lines(l, l->folder, resumed);
    l->writing = !status;
    if (!status && l->experiment->prepare)
        status = l->experiment->prepare(l);
    if (status && status != DRAPE_E_STOPPED && l->claimed)
        give_back(l);
    return status;
}

/* Whether a case is what it is without that value of the scene: it has one of its own there, or does not look. */
static bool is_indifferent(const json_t *one, const char *pointer)
{
    const json_t *settings = json_object_get(one, "settings");
    const char *method = json_string_value(json_object_get(settings, "/integrator/method"));
    const drape_integrator_ops *row = method ? lab_find_integrator(method) : NULL;
    return json_object_get(settings, pointer) || (row && lab_ignores(row, pointer));
}

/* Who sets dt for a tradeoff expects runs at that dt, and gets a grid of dt: told, not ignored. */
static drape_status check_settings(lab *l)
{
    for (size_t i = 0; i < l->def->setting_count; i++) {
        const char *pointer = l->def->settings[i].pointer;
        bool idle = true;
        for (size_t k = 0; idle && k < json_array_size(l->cases); k++)
            idle = is_indifferent(json_array_get(l->cases, k), pointer);
        if (idle || strncmp(pointer, "/output", strlen("/output")) == 0)
            return drape_fail(l->ctx, DRAPE_E_ARGUMENT,
                              "%.100s = %.60s has no effect: no case of this %s takes it from the scene",
                              pointer, l->def->settings[i].value, l->experiment->entry.name);
    }
    return DRAPE_OK;
}

/* A scene that does not compile is told before there is a folder, which would then hold an experiment that nobody
 * wants: the scene itself where it is prepared, and the first case of every series. Maps try their own corners. */
static drape_status try_scene(lab *l)
{
    const char *before = "";
    drape_status status = l->experiment->prepare ? lab_try(l->ctx, l->def, NULL) : DRAPE_OK;
    if (!status && l->experiment->check)
        status = l->experiment->check(l);
    for (size_t i = 0; !status && i < json_array_size(l->cases); i++) {
        const json_t *one = json_array_get(l->cases, i);
        const char *series = lab_tag_word(one, "series");
        if (strcmp(series, before) != 0)
            status = lab_try(l->ctx, l->def, json_object_get(one, "settings"));
        before = series;
    }
    return status;
}

static drape_status make_results(lab *l)
{
    l->count = json_array_size(l->cases);
    l->results = drape_alloc(l->ctx, l->count, sizeof *l->results);
    return l->results ? DRAPE_OK : DRAPE_E_MEMORY;
}

/* ---- Reporting ---- */

static void count_results(const lab *l, drape_lab_outcome *outcome)
{
    outcome->cases = (int64_t)l->count;
    for (size_t i = 0; i < l->count; i++) {
        if (!l->results[i])
            continue;
        outcome->done++;
        outcome->failed += !lab_is_good(l->results[i]);
        outcome->rejected += (int64_t)lab_number(l->results[i], "rejected");
    }
}

static drape_status write_report(lab *l)
{
    char title[512];
    drape_status status = l->experiment->report(l);
    snprintf(title, sizeof title, "drape %s: %s", l->experiment->entry.name, word_of(l->about, "scene"));
    if (!status)
        status = lab_write_page(l, title);
    fprintf(l->words, "report    %s/report.html\n", l->folder);
    return status;
}

/* Shards leave it to the merge: several at once in one folder would write the same files. */
static drape_status report(lab *l, drape_lab_outcome *outcome)
{
    lab_copy_same(l);
    count_results(l, outcome);
    fprintf(
        l->words,
        "%lld of %lld cases done; %lld of them did not come to the end; %lld steps were rejected in all\n",
        (long long)outcome->done, (long long)outcome->cases, (long long)outcome->failed,
        (long long)outcome->rejected);
    const bool shard = l->def->shards > 1;
    drape_status status = shard ? DRAPE_OK : lab_write_csv(l);
    if (!status && !shard && outcome->done == outcome->cases)
        return write_report(l);
    fprintf(l->words, "the report is made when all cases are done: other shards, `drape merge`\n");
    return status;
}

/* ---- From end to end ---- */

static drape_status begin(drape_context *ctx, const drape_lab_def *def, const char *folder, lab *l)
{
    *l = (lab){.ctx = ctx, .def = def};
    l->folder = drape_copy_text(ctx, folder);
    l->words = open_memstream(&l->words_text, &l->words_size);
    l->page = open_memstream(&l->page_text, &l->page_size);
    return l->folder && l->words && l->page ? DRAPE_OK : drape_fail(ctx, DRAPE_E_MEMORY, "no memory");
}

/* The words go to the outcome. */
static void end(lab *l, drape_lab_outcome *outcome)
{
    if (l->words)
        fclose(l->words);
    if (l->page)
        fclose(l->page);
    free(l->page_text);
    outcome->text = l->words_text;
    outcome->input = !l->writing;
    for (size_t i = 0; l->results && i < l->count; i++)
        json_decref(l->results[i]);
    drape_free(l->ctx, l->results);
    drape_free(l->ctx, l->folder);
    json_decref(l->about);
    lab_trace_free(&l->reference);
    lab_probe_free(&l->probe);
}

static drape_status find(lab *l, const char *name)
{
    int i;
    drape_status status = drape_registry_choose(l->ctx, &lab_experiment_registry, "", name, &i);
    if (!status)
        l->experiment = lab_experiments[i];
    return status;
}

static drape_status check_def(drape_context *ctx, const drape_lab_def *def)
{
    if (!def || def->struct_size != sizeof *def)
        return drape_fail(ctx, DRAPE_E_VERSION, "the def was not initialised by drape_lab_def_init");
    if (!def->scene || !def->folder || !*def->folder)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "an experiment needs a scene and a folder");
    if (def->shards < 1 || def->shard < 1 || def->shard > def->shards)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "shard %d of %d: it is 1 to the number of shards",
                          def->shard, def->shards);
    if (def->jobs < 1 || def->jobs > 256)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "jobs = %d; it is 1 to 256", def->jobs);
    if (!(def->case_seconds > 0) || def->repeats < 1 || !(def->strain_limit > 0))
        return drape_fail(ctx, DRAPE_E_ARGUMENT,
                          "case_seconds, repeats and strain_limit are more than 0: %g, %d, %g",
                          def->case_seconds, def->repeats, def->strain_limit);
    return DRAPE_OK;
}

drape_status drape_lab_run(drape_context *ctx, const char *experiment, const drape_lab_def *def,
                           drape_lab_outcome *outcome)
{
    lab l;
    *outcome = (drape_lab_outcome){0};
    drape_status status = check_def(ctx, def);
    outcome->input = status;
    if (status)
        return status;
    locale_t old = drape_locale_enter();
    status = begin(ctx, def, def->folder, &l);
    if (!status)
        status = find(&l, experiment);
    if (!status)
        status = plan(&l);
    if (!status)
        status = try_scene(&l);
    if (!status)
        status = check_settings(&l);
    if (!status)
        status = make_results(&l);
    if (!status)
        status = claim_folder(&l);
    if (!status)
        status = prepare(&l, &outcome->resumed);
    if (!status)
        status = lab_sweep(&l);
    if (!status)
        status = report(&l, outcome);
    end(&l, outcome);
    drape_locale_leave(old);
    return status;
}

static drape_status read_folders(lab *l, const char *const *folders, size_t count, drape_lab_outcome *outcome)
{
    drape_status status = parse_about(l->ctx, folders[0], &l->about);
    if (status)
        return status;
    l->cases = json_object_get(l->about, "cases");
    l->arguments = json_object_get(l->about, "arguments");
    if (find(l, word_of(l->about, "experiment")) || !json_is_array(l->cases))
        return drape_fail(l->ctx, DRAPE_E_PARSE, "%.400s/" ABOUT ": it is no experiment", folders[0]);
    status = make_results(l);
    for (size_t i = 0; !status && i < count; i++) {
        json_t *about = NULL;
        status = parse_about(l->ctx, folders[i], &about);
        if (!status && !json_equal(about, l->about))
            status =
                drape_fail(l->ctx, DRAPE_E_ARGUMENT, "\"%.300s\" and \"%.300s\" hold different experiments",
                           folders[0], folders[i]);
        json_decref(about);
        if (!status)
            status = lab_read_lines(l, folders[i], &outcome->resumed);
    }
    return status;
}

drape_status drape_lab_merge(drape_context *ctx, const char *const *folders, size_t count, const char *folder,
                             drape_lab_outcome *outcome)
{
    drape_lab_def def;
    lab l;
    *outcome = (drape_lab_outcome){.input = true};
    if (count < 1 || !folder || !*folder)
        return drape_fail(ctx, DRAPE_E_ARGUMENT,
                          "a merge needs folders with results, and one for the report");
    drape_lab_def_init(&def, sizeof def);
    locale_t old = drape_locale_enter();
    drape_status status = begin(ctx, &def, folder, &l);
    if (!status)
        status = read_folders(&l, folders, count, outcome);
    if (!status)
        status = claim_folder(&l);
    if (!status)
        status = lab_write_lines(&l, "cases.jsonl");
    if (!status)
        status = report(&l, outcome);
    end(&l, outcome);
    drape_locale_leave(old);
    return status;
}
