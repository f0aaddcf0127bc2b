/*
 * engine.c: an experiment from its def to its report, and the merging of shards. Its cases are run by
 * several threads into a file of lines. A case that has a line is not run again; a line that a kill cut short
 * is dropped, and its case is run again.
 */
#include "drape/lab.h"

#include "base/clock.h"
#include "base/json_read.h"
#include "base/param.h"
#include "io/export.h"
#include "lab/engine.h"
#include "lab/engine_output.h"

#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define ABOUT "experiment.json"

void drape_lab_outcome_free(drape_lab_outcome *outcome)
{
    free(outcome->text);
    *outcome = (drape_lab_outcome){0};
}

/* ---- Lines ---- */

static bool ends_in(const char *name, const char *ending)
{
    const size_t length = strlen(name), end = strlen(ending);
    return length > end && strcmp(name + length - end, ending) == 0;
}

/* In a folder whose cases may change, gives a line the number that the case with its tags has now, or sets it
 * aside: it is kept for a call that asks for that case again. Takes the reference; NULL: it was set aside. */
static json_t *renumber(lab *l, json_t *line)
{
    json_t *tags = json_object_get(line, "tags"), *one;
    size_t i;
    if (!l->experiment->grows || !json_is_object(tags))
        return line;
    json_array_foreach(l->cases, i, one) if (json_equal(tags, json_object_get(one, "tags")))
    {
        json_object_set_new(line, "case", json_integer((json_int_t)i));
        return line;
    }
    json_array_append_new(l->others, line);
    return NULL;
}

/* Takes a line of a file as a result, if its case has none yet. */
static drape_status take_line(lab *l, const char *path, int64_t number, const char *text, int64_t *found)
{
    json_error_t fault;
    json_t *line = drape_json_read(text, strlen(text), JSON_REJECT_DUPLICATES, &fault);
    drape_status status =
        !line && json_error_code(&fault) == json_error_out_of_memory ? drape_fail_memory(l->ctx, strlen(text))
        : line && !(line = renumber(l, line))                        ? DRAPE_OK
                                              : lab_check_line(l, path, number, line, &fault);
    json_t **result = status || !line ? NULL : &l->results[json_integer_value(json_object_get(line, "case"))];
    if (result && !*result) {
        *result = json_incref(line);
        ++*found;
    }
    json_decref(line);
    return status;
}

/* Takes the results of all cases*.jsonl of a folder into l->results; those that are there already stay.
 * *found counts the new ones. */
static drape_status read_lines(lab *l, const char *folder, int64_t *found)
{
    DIR *entries = opendir(folder);
    if (!entries)
        return drape_file_fail(l->ctx, "read", folder, errno);
    drape_status status = DRAPE_OK;
    for (struct dirent *e = readdir(entries); e && !status; e = readdir(entries)) {
        char path[4096], *text;
        size_t size;
        int64_t n = 1;
        if (strncmp(e->d_name, "cases", 5) != 0 || !ends_in(e->d_name, ".jsonl"))
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, e->d_name);
        status = drape_file_read(l->ctx, path, DRAPE_MAX_TABLE, &text, &size);
        /* A last line without its end was cut short. */
        for (char *line = text, *end; !status && (end = strchr(line, '\n')); line = end + 1) {
            *end = 0;
            status = take_line(l, path, n++, line, found);
        }
        drape_free(l->ctx, text);
    }
    closedir(entries);
    return status;
}

/* Begins a file of the folder with the lines of a shard's results, not yet under its name. The caller
 * destroys it in any case. */
static drape_status begin_lines(lab *l, const char *name, int shard, int shards, drape_file *file)
{
    drape_status status = drape_export_begin(l->ctx, l->out, name, file);
    for (size_t i = 0; !status && i < l->count; i++)
        if (l->results[i] && i % (size_t)shards == (size_t)(shard - 1))
            lab_put_line(file, l->results[i]);
    for (size_t i = 0; !status && shard == 1 && i < json_array_size(l->others); i++)
        lab_put_line(file, json_array_get(l->others, i));
    return status;
}

/* ---- Cases ---- */

/* The state that the threads of a sweep share. All but the flag is read and written under the lock. */
typedef struct sweep {
    lab *l;
    drape_file file;
    pthread_mutex_t lock;
    atomic_bool given_up;
    size_t *order;        /* (count) the cases to run, those of low rank first; in l->arena */
    size_t count;         /* of these */
    size_t next;          /* in that order, the first case that no thread has taken yet */
    size_t fresh, before; /* cases of this shard that are done: in this sweep, before it */
    double deadline;      /* [s] wall: when the budget is used up; 0: never */
    double start;         /* [s] wall */
    drape_status status;  /* the first failure; its message is set on l->ctx */
} sweep;

/* Under the lock. */
static void stop(sweep *s, drape_status status)
{
    if (!s->status)
        s->status = status;
    atomic_store(&s->given_up, true);
}

/* Takes the next case. Returns l->count if there is none, the budget is used up, or a thread failed. */
static size_t take_case(sweep *s)
{
    pthread_mutex_lock(&s->lock);
    const bool late = s->deadline > 0 && drape_clock_seconds() > s->deadline;
    const size_t mine = s->status || s->next == s->count || late ? s->l->count : s->order[s->next++];
    pthread_mutex_unlock(&s->lock);
    return mine;
}

/* Completes a result, saves it as a line and reports progress. Under the lock. */
static void keep(sweep *s, size_t i, json_t *result)
{
    lab *l = s->l;
    const drape_lab_def *def = l->def;
    json_t *tags = json_deep_copy(json_object_get(json_array_get(l->cases, i), "tags"));
    const bool failed = json_object_set_new(result, "case", json_integer((json_int_t)i)) ||
                        json_object_set_new(result, "tags", tags);
    l->results[i] = result;
    if (failed) {
        stop(s, drape_fail_memory(l->ctx, 1));
        return;
    }
    s->fresh++;
    lab_put_line(&s->file, result);
    drape_status status = drape_file_keep(&s->file);
    if (status)
        stop(s, status);
    const double each = (drape_clock_seconds() - s->start) / (double)s->fresh;
    if (def->progress)
        def->progress(def->user, (int64_t)(s->before + s->fresh), (int64_t)(s->before + s->count),
                      each * (double)(s->count - s->fresh));
}

/* A thread: runs cases until there is none left. */
static void *work(void *user)
{
    sweep *s = user;
    lab *l = s->l;
    drape_context *ctx = NULL;
    locale_t old = drape_locale_enter();
    if (drape_context_create(&l->ctx->def, &ctx)) {
        pthread_mutex_lock(&s->lock);
        stop(s, drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for a context"));
        pthread_mutex_unlock(&s->lock);
    }
    for (size_t i = ctx ? take_case(s) : l->count; i < l->count; i = take_case(s)) {
        json_t *result = NULL;
        const double start = drape_clock_thread_seconds();
        lab_request request = lab_request_of(l, i);
        request.deadline = s->deadline;
        request.given_up = &s->given_up;
        drape_status status = lab_run(ctx, &request, &result);
        if (!status && result)
            status = lab_check_identity(ctx, &request);
        if (result)
            json_object_set_new(result, "case_cpu_s", json_real(drape_clock_thread_seconds() - start));
        pthread_mutex_lock(&s->lock);
        if (!status && result)
            keep(s, i, result);
        else if (status &&
                 (status != DRAPE_E_STOPPED || !s->status)) /* else given up for an earlier failure */
            stop(s, drape_fail(l->ctx, status, "%s", drape_context_message(ctx)));
        if (status)
            json_decref(result);
        pthread_mutex_unlock(&s->lock);
    }
    drape_context_destroy(&ctx);
    drape_locale_leave(old);
    return NULL;
}

/* The name of the file of lines that this process writes. */
static void cases_name(const lab *l, char name[64])
{
    if (l->def->shards > 1)
        snprintf(name, 64, "cases-%d-of-%d.jsonl", l->def->shard, l->def->shards);
    else
        snprintf(name, 64, "cases.jsonl");
}

/* Runs the cases of this shard that have no result; each becomes a line as soon as it is done. */
static drape_status sweep_cases(lab *l)
{
    char name[64];
    pthread_t threads[256];
    int started = 0;
    sweep s = {.l = l, .start = drape_clock_seconds()};
    s.deadline = l->def->budget_seconds > 0 ? l->start + l->def->budget_seconds : 0;
    s.order = drape_arena_take(&l->arena, l->count, sizeof *s.order);
    if (!s.order)
        return DRAPE_E_MEMORY;
    size_t all = l->def->plan ? lab_plan_sample(l, s.order) : 0;
    for (json_int_t rank = 0, seen = 0; !l->def->plan && seen < (json_int_t)l->count; rank++)
        for (size_t i = 0; i < l->count; i++)
            if (json_integer_value(json_object_get(json_array_get(l->cases, i), "rank")) == rank) {
                seen++;
                if (lab_is_ours(l, i))
                    s.order[all++] = i;
            }
    for (size_t k = 0; k < all; k++)
        if (!l->results[s.order[k]])
            s.order[s.count++] = s.order[k];
    s.before = all - s.count;
    cases_name(l, name);
    pthread_mutex_init(&s.lock, NULL);
    atomic_init(&s.given_up, false);
    s.status = begin_lines(l, name, l->def->shard, l->def->shards, &s.file);
    if (!s.status)
        s.status = drape_file_publish(&s.file);
    if (!s.status && s.count > 0) {
        while (started < l->def->jobs && !pthread_create(&threads[started], NULL, work, &s))
            started++;
        if (started == 0)
            s.status = drape_fail(l->ctx, DRAPE_E_MEMORY, "no thread can be started");
        for (int i = 0; i < started; i++)
            pthread_join(threads[i], NULL);
    }
    drape_status closed = drape_file_close(&s.file);
    drape_file_destroy(&s.file);
    pthread_mutex_destroy(&s.lock);
    return s.status ? s.status : closed;
}

/* ---- Planning ---- */

static drape_status plan(lab *l)
{
    char digits[17];
    l->about = json_pack("{s:s, s:s, s:o, s:s, s:[], s:{}, s:[]}", "experiment", l->experiment->entry.name,
                         "drape", drape_version(), "scene", drape_json_text(l->def->scene), "scene_hash", "",
                         "settings", "arguments", "cases");
    json_t *settings = json_object_get(l->about, "settings");
    l->cases = json_object_get(l->about, "cases");
    l->arguments = json_object_get(l->about, "arguments");
    l->others = json_array();
    if (!l->cases || !l->others)
        return drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for an experiment");
    for (size_t i = 0; i < l->def->integrator_count; i++) {
        const char *name = l->def->integrators[i];
        int k;
        DRAPE_TRY(drape_registry_choose(l->ctx, &drape_integrator_registry, "", name, &k));
        if (drape_integrators[k]->steady_state)
            return drape_fail(l->ctx, DRAPE_E_ARGUMENT,
                              "\"%s\" has no steps in time: %s needs integrators that have them", name,
                              l->experiment->entry.name);
    }
    DRAPE_TRY(l->experiment->plan(l));
    for (size_t i = 0; i < l->def->setting_count; i++)
        if (json_array_append_new(settings,
                                  json_pack("[s,s]", l->def->settings[i].pointer, l->def->settings[i].value)))
            return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "the settings are not UTF-8, or there is no memory");
    json_object_set_new(l->arguments, "case_seconds", json_real(l->def->case_seconds));
    if (l->experiment->compares_costs)
        json_object_set_new(l->arguments, "repeats", json_integer(l->def->repeats));
    DRAPE_TRY(lab_check_about(l->ctx, "the plan", l->about));
    /* Lines of a scene that was changed since do not belong to this experiment. */
    const lab_request request = {.def = l->def, .identified = lab_identified(l)};
    DRAPE_TRY(lab_identify(l->ctx, &request, digits));
    return json_object_set_new(l->about, "scene_hash", json_string(digits))
               ? drape_fail_memory(l->ctx, sizeof digits)
               : DRAPE_OK;
}

/* Refuses settings that no case takes from the scene: a user who sets dt for a tradeoff expects runs at that
 * dt, but would get a grid of dt. A case ignores a setting for which it has its own value or which its
 * integrator ignores. */
static drape_status check_settings(lab *l)
{
    for (size_t i = 0; i < l->def->setting_count; i++) {
        const char *pointer = l->def->settings[i].pointer;
        bool unused = true;
        for (size_t k = 0; unused && k < json_array_size(l->cases); k++) {
            const json_t *own = json_object_get(json_array_get(l->cases, k), "settings");
            const drape_integrator_ops *integrator = lab_find_integrator(lab_text(own, "/integrator/method"));
            unused = json_object_get(own, pointer) || (integrator && lab_ignores(integrator, pointer));
        }
        if (unused || strncmp(pointer, "/output", strlen("/output")) == 0)
            return drape_fail(l->ctx, DRAPE_E_ARGUMENT,
                              "%.100s = %.60s has no effect: no case of this %s takes it from the scene",
                              pointer, l->def->settings[i].value, l->experiment->entry.name);
    }
    return DRAPE_OK;
}

/* Reports a scene that does not compile before there is a folder, which would then hold an unwanted
 * experiment. The scene itself is tried if the experiment prepares something with it, and the first case of
 * every series; maps try their own corners in `plan`. */
static drape_status try_scene(lab *l)
{
    const char *before = "";
    if (l->experiment->prepare)
        DRAPE_TRY(lab_load(l->ctx, &(lab_request){.def = l->def}, NULL));
    if (l->experiment->check)
        DRAPE_TRY(l->experiment->check(l));
    for (size_t i = 0; i < json_array_size(l->cases); i++) {
        const json_t *one = json_array_get(l->cases, i);
        const char *series = lab_tag_text(one, "series");
        if (strcmp(series, before) != 0) {
            const lab_request request = lab_request_of(l, i);
            DRAPE_TRY(lab_load(l->ctx, &request, NULL));
        }
        before = series;
    }
    return DRAPE_OK;
}

static drape_status make_results(lab *l)
{
    l->count = json_array_size(l->cases);
    l->results = drape_arena_take(&l->arena, l->count, sizeof *l->results);
    return l->results ? DRAPE_OK : DRAPE_E_MEMORY;
}

/* ---- The folder ---- */

static drape_status parse_about(lab *l, const char *folder, json_t **about)
{
    char path[500];
    drape_status status = lab_read_json(&l->arena, folder, ABOUT, about);
    snprintf(path, sizeof path, "%.450s/" ABOUT, folder);
    return status ? status : lab_check_about(l->ctx, path, *about);
}

/* Whether the cases are the same, or may differ; what the figures show may. */
static bool is_same(const json_t *a, const json_t *b, bool of_cases)
{
    json_t *x = json_copy((json_t *)(uintptr_t)a), *y = json_copy((json_t *)(uintptr_t)b);
    json_object_del(x, "results");
    json_object_del(y, "results");
    if (!of_cases)
        json_object_del(x, "cases");
    if (!of_cases)
        json_object_del(y, "cases");
    const bool same = json_equal(x, y);
    json_decref(x);
    json_decref(y);
    return same;
}

/* The files that an experiment writes. */
static bool writes(const void *user, const char *name)
{
    char cases[64];
    cases_name(user, cases);
    return strcmp(name, ABOUT) == 0 || strcmp(name, cases) == 0 || strcmp(name, "results.csv") == 0 ||
           strcmp(name, "report.html") == 0 || strncmp(name, "reference", 9) == 0 || ends_in(name, ".svg") ||
           ends_in(name, ".pdf") || strcmp(name, "tables.md") == 0 || strcmp(name, "plan.json") == 0;
}

/* Writes the experiment into the folder, or resumes it if the folder has it. Shards that begin in one folder
 * at the same time write the same content. */
static drape_status claim_folder(lab *l)
{
    char path[4200];
    l->input_is_good = true;
    /* Shards may write into one folder at the same time. */
    drape_status status = drape_folder_open(l->ctx, l->folder, l->def->shards > 1, &l->out);
    if (!status && l->def->scene)
        status = drape_folder_protect(l->out, l->def->scene);
    if (!status)
        status = drape_folder_check(l->out, writes, writes, l);
    l->input_is_good = status != DRAPE_E_ARGUMENT;
    if (status)
        return status;
    snprintf(path, sizeof path, "%s/" ABOUT, l->folder);
    l->claimed = access(path, F_OK) != 0;
    bool changed = l->claimed;
    if (!l->claimed) {
        json_t *there = NULL;
        status = parse_about(l, l->folder, &there);
        if (!status && !is_same(there, l->about, !l->experiment->grows || l->def->shards > 1))
            status = drape_fail(l->ctx, DRAPE_E_ARGUMENT,
                                "\"%.400s\" holds another experiment, or this one of another scene or "
                                "version; name another folder, or remove it",
                                l->folder);
        changed = !status && !json_equal(there, l->about);
        json_decref(there);
        l->input_is_good = !status;
    }
    if (!status)
        status = drape_folder_begin(l->out, NULL, NULL);
    return status || !changed
               ? status
               : lab_write_json(l, ABOUT, json_incref(l->about), JSON_INDENT(1) | JSON_REAL_PRECISION(17));
}

/* Reads earlier results, and makes the reference that cases are compared with. */
static drape_status prepare(lab *l)
{
    l->input_is_good = false;
    drape_status status = read_lines(l, l->folder, &l->outcome->resumed);
    l->input_is_good = !status;
    if (!status && l->experiment->prepare)
        status = l->experiment->prepare(l);
    const bool useless = status && status != DRAPE_E_STOPPED && !l->resumable; /* no case will run */
    if (useless && l->claimed) {
        char message[DRAPE_MESSAGE_SIZE];
        snprintf(message, sizeof message, "%s", drape_context_message(l->ctx));
        drape_folder_remove(l->out, drape_folder_is_named, ABOUT);
        drape_folder_discard(&l->out);
        drape_context_set_message(l->ctx, "%s", message);
    }
    return status;
}

/* ---- Reporting ---- */

/* The group in which a case that was left out is counted: its scene, or its series where there is only one
 * scene. */
static const char *group_of(const json_t *one)
{
    const char *scene = lab_tag_text(one, "scene");
    return *scene ? scene : lab_tag_text(one, "series");
}

/* Writes which cases have no result because the budget was used up, by group. */
static void list_left_out(lab *l)
{
    const char *comma = " ";
    fprintf(l->summary,
            "%lld of %zu cases were left out, as the budget of %.3g minutes was used up; the same command "
            "continues with them. Left out:",
            (long long)l->outcome->left_out, l->count, l->def->budget_seconds / 60);
    for (size_t i = 0, end; i < l->count; i = end) {
        const char *series = group_of(json_array_get(l->cases, i));
        int64_t missing = 0;
        for (end = i; end < l->count && strcmp(group_of(json_array_get(l->cases, end)), series) == 0; end++)
            missing += !l->results[end];
        if (missing > 0) {
            fprintf(l->summary, "%s%s (%lld of %zu)", comma, series, (long long)missing, end - i);
            comma = ", ";
        }
    }
    fprintf(l->summary, ".\n");
}

/* The cases of which there are results, and the rest. */
static void count_cases(lab *l)
{
    const drape_lab_outcome *outcome = l->outcome;
    fprintf(l->summary,
            "%lld of %lld cases done; %lld of them did not complete; %lld steps were rejected in all\n",
            (long long)outcome->done, (long long)outcome->cases, (long long)outcome->failed,
            (long long)outcome->rejected);
    if (outcome->left_out)
        list_left_out(l);
}

/* Shards leave the report to the merge: several at once in one folder would write the same files. */
static drape_status report(lab *l)
{
    drape_lab_outcome *outcome = l->outcome;
    char title[512];
    const bool shard = l->def->shards > 1;
    outcome->cases = (int64_t)l->count;
    for (size_t i = 0; i < l->count; i++) {
        json_t *one = json_array_get(l->cases, i), *same = json_object_get(one, "same_as");
        json_t *source = same ? l->results[json_integer_value(same)] : NULL;
        if (source && !l->results[i]) {
            l->results[i] = json_copy(source);
            json_object_set_new(l->results[i], "case", json_integer((json_int_t)i));
            json_object_set(l->results[i], "tags", json_object_get(one, "tags"));
        }
        if (l->results[i]) {
            outcome->done++;
            outcome->failed += !lab_is_good(l->results[i]);
            outcome->rejected += json_integer_value(json_object_get(l->results[i], "rejected"));
        }
    }
    drape_status status = shard ? DRAPE_OK : lab_write_csv(l);
    const bool plans = !status && l->def->plan > 0;
    if (!status && !shard && !plans && l->def->budget_seconds > 0)
        outcome->left_out = outcome->cases - outcome->done;
    const bool whole = !status && !shard && outcome->done + outcome->left_out == outcome->cases;
    if (whole && !plans)
        status = l->experiment->report(l);
    count_cases(l);
    if (plans)
        return lab_write_plan(l);
    if (!whole) {
        fprintf(l->summary,
                "the report is made once all cases are done: run the other shards, or `drape merge`\n");
        return status;
    }
    snprintf(title, sizeof title, "drape %s: %.400s", l->experiment->entry.name, lab_text(l->about, "scene"));
    drape_make_printable(title);
    if (!status)
        status = lab_write_page(l, title);
    char path[512];
    snprintf(path, sizeof path, "%.490s/report.html", l->folder);
    drape_make_printable(path);
    fprintf(l->summary, "report    %s\n", path);
    return status;
}

/* ---- From end to end ---- */

static drape_status begin(drape_context *ctx, const drape_lab_def *def, const char *folder,
                          drape_lab_outcome *outcome, lab *l)
{
    *l = (lab){.ctx = ctx,
               .def = def,
               .outcome = outcome,
               .arena = drape_arena_of(ctx),
               .start = drape_clock_seconds()};
    l->folder = drape_arena_text(&l->arena, folder);
    l->summary = open_memstream(&l->summary_text, &l->summary_size);
    l->page = open_memstream(&l->page_text, &l->page_size);
    return l->folder && l->summary && l->page ? DRAPE_OK : drape_fail(ctx, DRAPE_E_MEMORY, "no memory");
}

/* The outcome takes over the summary, which is for a terminal. */
static void end(lab *l)
{
    if (l->summary)
        fclose(l->summary);
    for (char *line = l->summary_text, *stop; line; line = stop ? stop + 1 : NULL) {
        if ((stop = strchr(line, '\n')))
            *stop = 0;
        drape_make_printable(line);
        if (stop)
            *stop = '\n';
    }
    if (l->page)
        fclose(l->page);
    free(l->page_text);
    l->outcome->text = l->summary_text;
    l->outcome->input = !l->input_is_good;
    for (size_t i = 0; l->results && i < l->count; i++)
        json_decref(l->results[i]);
    json_decref(l->about);
    json_decref(l->others);
    drape_folder_close(&l->out);
    drape_arena_free(&l->arena);
}

static drape_status find(lab *l, const char *name)
{
    int i;
    DRAPE_TRY(drape_registry_choose(l->ctx, &lab_experiment_registry, "", name, &i));
    l->experiment = lab_experiments[i];
    if (l->def->budget_seconds > 0 && !l->experiment->partial)
        return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "budget_seconds = %g: %s needs all of its cases",
                          l->def->budget_seconds, name);
    if (l->def->result_count > 0 && !l->experiment->shows_results)
        return drape_fail(l->ctx, DRAPE_E_ARGUMENT, "results: the figures of %s show the same ones always",
                          name);
    return DRAPE_OK;
}

static drape_status check_def(drape_context *ctx, const drape_lab_def *def)
{
    if (!def || def->struct_size != sizeof *def)
        return drape_fail(ctx, DRAPE_E_VERSION, "the def was not initialised by drape_lab_def_init");
    if (!def->scene || !def->folder || !*def->folder)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "an experiment needs a scene and a folder");
    if (def->shards < 1 || def->shard < 1 || def->shard > def->shards)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "shard %d of %d: must be 1 to the number of shards",
                          def->shard, def->shards);
    if (def->jobs < 1 || def->jobs > 256)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "jobs = %d; must be 1 to 256", def->jobs);
    if (!(def->budget_seconds >= 0))
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "budget_seconds = %g; must be 0 (none) or more",
                          def->budget_seconds);
    if (def->plan < 0)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "plan = %d; must be 0 (none) or more", def->plan);
    if (!(def->case_seconds > 0) || def->repeats < 1 || !(def->strain_limit > 0))
        return drape_fail(ctx, DRAPE_E_ARGUMENT,
                          "case_seconds, repeats and strain_limit must be above 0: %g, %d, %g",
                          def->case_seconds, def->repeats, def->strain_limit);
    return DRAPE_OK;
}

drape_status drape_lab_run(drape_context *ctx, const char *experiment, const drape_lab_def *def,
                           drape_lab_outcome *outcome)
{
    static drape_status (*const stages[])(lab *) = {plan,         try_scene, check_settings, make_results,
                                                    claim_folder, prepare,   sweep_cases,    report};
    lab l;
    if (!outcome)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "an experiment needs an outcome");
    *outcome = (drape_lab_outcome){0};
    drape_status status = check_def(ctx, def);
    outcome->input = status;
    if (status)
        return status;
    locale_t old = drape_locale_enter();
    status = begin(ctx, def, def->folder, outcome, &l);
    if (!status)
        status = find(&l, experiment);
    for (size_t i = 0; !status && i < sizeof stages / sizeof *stages; i++)
        status = stages[i](&l);
    end(&l);
    drape_locale_leave(old);
    return status;
}

drape_status drape_lab_merge(drape_context *ctx, const char *const *folders, size_t count, const char *folder,
                             drape_lab_outcome *outcome)
{
    drape_lab_def def;
    lab l;
    drape_file file = {0};
    if (outcome)
        *outcome = (drape_lab_outcome){.input = true};
    if (!outcome || !folders || count < 1 || !folder || !*folder)
        return drape_fail(ctx, DRAPE_E_ARGUMENT,
                          "a merge needs folders with results, one for the report, and an outcome");
    drape_lab_def_init(&def, sizeof def);
    locale_t old = drape_locale_enter();
    drape_status status = begin(ctx, &def, folder, outcome, &l);
    if (!status)
        status = parse_about(&l, folders[0], &l.about);
    l.cases = json_object_get(l.about, "cases");
    l.arguments = json_object_get(l.about, "arguments");
    l.others = json_array();
    if (!status)
        status = find(&l, lab_text(l.about, "experiment"));
    if (!status)
        status = make_results(&l);
    if (!status && l.experiment->verify)
        status = l.experiment->verify(&l);
    for (size_t i = 0; !status && i < count; i++) {
        json_t *about = NULL;
        status = parse_about(&l, folders[i], &about);
        if (!status && !is_same(about, l.about, true))
            status = drape_fail(ctx, DRAPE_E_ARGUMENT, "\"%.300s\" and \"%.300s\" hold different experiments",
                                folders[0], folders[i]);
        json_decref(about);
        if (!status)
            status = read_lines(&l, folders[i], &outcome->resumed);
    }
    if (!status)
        status = claim_folder(&l);
    if (!status)
        status = begin_lines(&l, "cases.jsonl", 1, 1, &file);
    if (!status)
        status = drape_file_finish(&file);
    if (!status)
        status = report(&l);
    drape_file_destroy(&file);
    end(&l);
    drape_locale_leave(old);
    return status;
}
