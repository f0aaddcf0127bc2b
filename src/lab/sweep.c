/* sweep.c: see lab.h. */
#include "lab/lab.h"

#include "base/clock.h"
#include "base/json_read.h"
#include "io/export.h"

#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <string.h>

/* ---- Lines ---- */

static drape_status take_line(lab *l, const char *path, int64_t number, const char *text, int64_t *found)
{
    json_error_t fault;
    json_t *line = drape_json_read(text, strlen(text), JSON_REJECT_DUPLICATES, &fault);
    if (!line && json_error_code(&fault) == json_error_out_of_memory)
        return drape_fail_memory(l->ctx, strlen(text));
    drape_status status = lab_check_line(l, path, number, line, &fault);
    json_t **result = status ? NULL : &l->results[json_integer_value(json_object_get(line, "case"))];
    if (!result || *result) {
        json_decref(line);
        return status;
    }
    *result = line;
    ++*found;
    return DRAPE_OK;
}

drape_status lab_read_lines(lab *l, const char *folder, int64_t *found)
{
    DIR *entries = opendir(folder);
    if (!entries)
        return drape_file_fail(l->ctx, "read", folder, errno);
    drape_status status = DRAPE_OK;
    for (struct dirent *e = readdir(entries); e && !status; e = readdir(entries)) {
        char path[4096], *text;
        size_t size = strlen(e->d_name);
        int64_t n = 1;
        const size_t ending = strlen(".jsonl");
        if (strncmp(e->d_name, "cases", 5) != 0 || size < ending ||
            strcmp(e->d_name + size - ending, ".jsonl") != 0)
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

void lab_put_line(drape_file *file, const json_t *object)
{
    drape_json_put(file, object, JSON_COMPACT | JSON_REAL_PRECISION(17));
    drape_file_put_text(file, "\n");
}

drape_status lab_begin_lines(lab *l, const char *name, int shard, int shards, drape_file *file)
{
    drape_status status = drape_export_begin(l->ctx, l->out, name, file);
    for (size_t i = 0; !status && i < l->count; i++)
        if (l->results[i] && i % (size_t)shards == (size_t)(shard - 1))
            lab_put_line(file, l->results[i]);
    return status;
}

/* ---- Cases ---- */

/* The state that the threads of a sweep share. All but the flag is read and written under the lock. */
typedef struct sweep {
    lab *l;
    drape_file file;
    pthread_mutex_t lock;
    atomic_bool given_up;
    size_t *order;       /* the cases, those of low rank first; in l->arena */
    size_t count;        /* of these */
    size_t next;         /* in that order, the first case that no thread has taken yet */
    double deadline;     /* [s] wall: when the budget is used up; 0: never */
    int64_t done, total; /* of this shard */
    int64_t before;      /* done when it began */
    double start;        /* [s] wall */
    drape_status status; /* the first failure; its message is set on l->ctx */
} sweep;

/* Under the lock. */
static void stop(sweep *s, drape_status status)
{
    if (!s->status)
        s->status = status;
    atomic_store(&s->given_up, true);
}

/* Takes the next case that has no result. Returns l->count if there is none, the budget is used up, or a
 * thread failed. */
static size_t take_case(sweep *s)
{
    lab *l = s->l;
    pthread_mutex_lock(&s->lock);
    while (s->next < s->count && (!lab_is_ours(l, s->order[s->next]) || l->results[s->order[s->next]]))
        s->next++;
    const size_t mine =
        s->status || s->next >= s->count || (s->deadline > 0 && drape_clock_seconds() > s->deadline)
            ? l->count
            : s->order[s->next++];
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
    s->done++;
    lab_put_line(&s->file, result);
    drape_status status = drape_file_keep(&s->file);
    if (status)
        stop(s, status);
    const double wall = drape_clock_seconds() - s->start;
    const int64_t fresh = s->done - s->before;
    if (def->progress)
        def->progress(def->user, s->done, s->total, wall / (double)fresh * (double)(s->total - s->done));
}

lab_request lab_request_of(const lab *l, size_t index)
{
    lab_request request = {.def = l->def,
                           .identity = lab_text(l->about, "scene_hash"),
                           .identified = json_object_get(json_array_get(l->cases, 0), "settings"),
                           .settings = json_object_get(json_array_get(l->cases, index), "settings"),
                           .reference = &l->reference,
                           .reference_error = l->reference_error,
                           .probe = &l->probe,
                           .seconds = l->def->case_seconds,
                           .repeats = l->experiment->compares_costs ? l->def->repeats : 1};
    if (l->experiment->request)
        l->experiment->request(l, index, &request);
    return request;
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

void lab_cases_name(const lab *l, char name[64])
{
    if (l->def->shards > 1)
        snprintf(name, 64, "cases-%d-of-%d.jsonl", l->def->shard, l->def->shards);
    else
        snprintf(name, 64, "cases.jsonl");
}

drape_status lab_sweep(lab *l)
{
    char name[64];
    pthread_t threads[256];
    int started = 0;
    sweep s = {.l = l, .start = drape_clock_seconds()};
    s.deadline = l->def->budget_seconds > 0 ? l->start + l->def->budget_seconds : 0;
    s.order = drape_arena_take(&l->arena, l->count, sizeof *s.order);
    if (!s.order)
        return DRAPE_E_MEMORY;
    if (l->def->plan)
        s.count = lab_plan_sample(l, s.order);
    for (json_int_t rank = 0; !l->def->plan && s.count < l->count; rank++)
        for (size_t i = 0; i < l->count; i++)
            if (json_integer_value(json_object_get(json_array_get(l->cases, i), "rank")) == rank)
                s.order[s.count++] = i;
    lab_cases_name(l, name);
    pthread_mutex_init(&s.lock, NULL);
    atomic_init(&s.given_up, false);
    for (size_t k = 0; k < s.count; k++)
        if (lab_is_ours(l, s.order[k])) {
            s.total++;
            s.before += l->results[s.order[k]] != NULL;
        }
    s.done = s.before;
    s.status = lab_begin_lines(l, name, l->def->shard, l->def->shards, &s.file);
    if (!s.status)
        s.status = drape_file_publish(&s.file);
    if (!s.status && s.done < s.total) {
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
