/* fuzz.c: see fuzz.h. */
#define _XOPEN_SOURCE 700 /* setitimer */
#include "fuzz/fuzz.h"

#include <dirent.h>
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <unistd.h>

#include "base/clock.h"
#include "base/finite.h"
#include "mesh/mesh.h"
#include "model/scene.h"

#define MAX_MEMORY ((size_t)16 << 20)
/* [s] of CPU. Between two checks for cancellation are some passes over elements and contacts and a
 * factorization: milliseconds for the few nodes of a target, ten times as much under sanitizers on a busy
 * machine. */
#define SOON 5

void fuzz_die(const char *file, int line, const char *promise, const char *format, ...)
{
    va_list values;
    fprintf(stderr, "%s:%d: not so: %s: ", file, line, promise);
    va_start(values, format);
    vfprintf(stderr, format, values);
    va_end(values);
    fprintf(stderr, "\n");
    abort();
}

/* ---- Contexts ---- */

typedef struct memory_limit {
    size_t left;
    int64_t allocations;
} memory_limit;

/* In front of each allocation: its size, with the alignment of any type. */
#define FRONT 16

static void *take(void *user, size_t size)
{
    memory_limit *p = user;
    if (size > p->left)
        return NULL;
    unsigned char *piece = malloc(FRONT + size);
    if (!piece)
        return NULL;
    memcpy(piece, &size, sizeof size);
    p->left -= size;
    p->allocations++;
    return piece + FRONT;
}

static void give(void *user, void *memory)
{
    memory_limit *p = user;
    unsigned char *piece = (unsigned char *)memory - FRONT;
    size_t size;
    memcpy(&size, piece, sizeof size);
    p->left += size;
    p->allocations--;
    free(piece);
}

/* There is one context at a time. */
static memory_limit limit;

drape_context *fuzz_open(size_t max_bytes)
{
    drape_context *ctx = NULL;
    drape_context_def def;
    limit = (memory_limit){.left = max_bytes};
    drape_context_def_init(&def, sizeof def);
    def.allocate = take;
    def.release = give;
    def.allocator_user = &limit;
    FUZZ_REQUIRE(drape_context_create(&def, &ctx) == DRAPE_OK, "no context in %zu bytes", max_bytes);
    return ctx;
}

void fuzz_close(drape_context **ctx)
{
    drape_context_destroy(ctx);
    FUZZ_REQUIRE(limit.allocations == 0, "%lld allocations are left", (long long)limit.allocations);
}

void fuzz_check(const drape_context *ctx, drape_status status, const char *call)
{
    const char *message = drape_context_message(ctx);
    FUZZ_REQUIRE(status <= 0, "%s: %s", call, drape_status_name(status));
    FUZZ_REQUIRE(status == DRAPE_OK || (*message && !strchr(message, '\n')), "%s: %s: '%s'", call,
                 drape_status_name(status), message);
}

/* ---- Folders ---- */

static char folder[256];

void fuzz_remove(const char *path)
{
    char file[600];
    struct dirent *entry;
    DIR *dir = opendir(path);
    while (dir && (entry = readdir(dir))) {
        snprintf(file, sizeof file, "%s/%s", path, entry->d_name);
        unlink(file);
    }
    if (dir)
        closedir(dir);
    rmdir(path);
}

static void remove_folder(void)
{
    fuzz_remove(folder);
}

/* Where the next piece begins, or the end. */
static const uint8_t *next_piece(const uint8_t *at, const uint8_t *end)
{
    for (; end - at >= 4; at++)
        if (memcmp(at, "=== ", 4) == 0)
            return at;
    return end;
}

const char *fuzz_folder(const uint8_t *data, size_t size)
{
    const uint8_t *end = data + size;
    const char *base = getenv("TMPDIR");
    if (!*folder) {
        snprintf(folder, sizeof folder, "%s/drape-fuzz-%ld", base ? base : "/tmp", (long)getpid());
        atexit(remove_folder);
    }
    fuzz_remove(folder);
    FUZZ_REQUIRE(mkdir(folder, 0777) == 0, "%s", folder);
    for (const uint8_t *at = next_piece(data, end), *next; at < end; at = next) {
        char path[400], name[64] = "";
        next = next_piece(at + 4, end);
        const uint8_t *line = memchr(at, '\n', (size_t)(next - at));
        const size_t length = line ? (size_t)(line - at - 4) : 0;
        if (length == 0 || length >= sizeof name || memchr(at, '/', length + 4) || memchr(at, 0, length + 4))
            continue;
        memcpy(name, at + 4, length);
        snprintf(path, sizeof path, "%s/%s", folder, name);
        FILE *file = strcmp(name, ".") == 0 || strcmp(name, "..") == 0 ? NULL : fopen(path, "wb");
        if (!file)
            continue;
        FUZZ_REQUIRE(fwrite(line + 1, 1, (size_t)(next - line - 1), file) == (size_t)(next - line - 1), "%s",
                     path);
        fclose(file);
    }
    return folder;
}

/* ---- Bytes ---- */

unsigned fuzz_byte(fuzz_bytes *bytes)
{
    return bytes->at < bytes->end ? *bytes->at++ : 0;
}

unsigned fuzz_below(fuzz_bytes *bytes, unsigned count)
{
    return count > 1 ? fuzz_byte(bytes) % count : 0;
}

double fuzz_between(fuzz_bytes *bytes, double low, double high)
{
    const unsigned upper = fuzz_byte(bytes);
    return low + (high - low) * (256 * upper + fuzz_byte(bytes)) / 65535.0;
}

double fuzz_magnitude(fuzz_bytes *bytes, double low, double high)
{
    return pow(10, fuzz_between(bytes, log10(low), log10(high)));
}

/* ---- Sims ---- */

typedef struct watch {
    uint64_t accepted; /* hash of the last accepted state */
    int attempts, max_attempts;
} watch;

void fuzz_check_finite(const drape_sim *sim, const char *when)
{
    const size_t n = 3 * (size_t)drape_model_node_count(drape_sim_model(sim));
    FUZZ_REQUIRE(isfinite(drape_sim_time(sim)) && drape_all_finite(drape_sim_positions(sim), n) &&
                     drape_all_finite(drape_sim_velocities(sim), n),
                 "%s, at t = %g", when, drape_sim_time(sim));
}

static void check_attempt(watch *w, const drape_event *event)
{
    const drape_attempt *a = event->attempt;
    const uint64_t hash = drape_sim_hash(event->sim);
    FUZZ_REQUIRE(a->reason && *a->reason, "attempt %lld", (long long)a->index);
    FUZZ_REQUIRE(a->accepted || hash == w->accepted, "attempt %lld was rejected (%s)", (long long)a->index,
                 a->reason);
    fuzz_check_finite(event->sim, a->reason);
    w->accepted = hash;
    w->attempts++;
}

static drape_status look(void *user, const drape_event *event)
{
    watch *w = user;
    if (event->kind == DRAPE_EVENT_ATTEMPT) {
        check_attempt(w, event);
        return w->attempts < w->max_attempts ? DRAPE_OK : 1;
    }
    const size_t n = 3 * (size_t)drape_model_node_count(drape_sim_model(event->sim));
    FUZZ_REQUIRE(drape_all_finite(event->positions, n) && drape_all_finite(event->velocities, n),
                 "frame %lld", (long long)event->frame);
    return DRAPE_OK;
}

/* The sim that advances, and the CPU time at which it was cancelled; 0: it was not. */
static drape_sim *volatile running;
static volatile double cancelled_at;

static void stop(int number)
{
    (void)number;
    drape_sim_cancel(running);
    cancelled_at = drape_clock_cpu_seconds(); /* clock_gettime may be called in a handler */
}

static void allow(drape_sim *sim, double seconds)
{
    const long whole = (long)seconds;
    const struct itimerval left = {
        .it_value = {.tv_sec = whole, .tv_usec = (long)(1e6 * (seconds - (double)whole))}};
    const struct sigaction action = {.sa_handler = stop};
    running = sim;
    cancelled_at = 0;
    sigaction(SIGVTALRM, &action, NULL);
    setitimer(ITIMER_VIRTUAL, &left, NULL);
}

/* Observers cannot be removed, so this is called once for each sim. */
drape_status fuzz_advance(drape_context *ctx, drape_sim *sim, double t, int attempts, double seconds)
{
    watch w = {.accepted = drape_sim_hash(sim), .max_attempts = attempts};
    fuzz_check_finite(sim, "before");
    FUZZ_REQUIRE(drape_sim_observe(sim, look, &w) == DRAPE_OK, "%s", drape_context_message(ctx));
    allow(sim, seconds);
    const drape_status status = drape_sim_advance(sim, t);
    const double delay = cancelled_at > 0 ? drape_clock_cpu_seconds() - cancelled_at : 0;
    allow(NULL, 0);
    FUZZ_REQUIRE(delay <= SOON, "a cancelled advance continued for %g s of CPU", delay);
    fuzz_check(ctx, status, "drape_sim_advance");
    fuzz_check_finite(sim, drape_status_name(status));
    FUZZ_REQUIRE(drape_sim_hash(sim) == w.accepted, "after %d attempts: %s: %s", w.attempts,
                 drape_status_name(status), drape_context_message(ctx));
    return status;
}

drape_status fuzz_keep(void *user, const void *piece, size_t size)
{
    fuzz_saved *s = user;
    if (s->size + size > s->room) {
        s->room = 2 * (s->size + size);
        s->data = realloc(s->data, s->room);
        FUZZ_REQUIRE(s->data, "no memory for %zu bytes", s->room);
    }
    memcpy(s->data + s->size, piece, size);
    s->size += size;
    return DRAPE_OK;
}

/* ---- Scenes ---- */

typedef struct text {
    char *data;
    size_t size, room;
} text;

static void append(void *user, const char *piece, size_t size)
{
    text *t = user;
    if (t->size + size + 1 > t->room) {
        t->room = 2 * (t->size + size + 1);
        t->data = realloc(t->data, t->room);
        FUZZ_REQUIRE(t->data, "no memory for a text of %zu bytes", t->room);
    }
    memcpy(t->data + t->size, piece, size);
    t->size += size;
    t->data[t->size] = 0;
}

static drape_status compile(drape_context *ctx, const char *data, drape_model **model, text *printed)
{
    drape_scene *scene = NULL;
    drape_status status = drape_scene_parse(ctx, data, "fuzz", &scene);
    fuzz_check(ctx, status, "drape_scene_parse");
    FUZZ_REQUIRE(!status == !!scene, "%s", drape_status_name(status));
    if (!status) {
        status = drape_scene_compile(scene, model);
        fuzz_check(ctx, status, "drape_scene_compile");
        FUZZ_REQUIRE(!status == !!*model, "%s", drape_status_name(status));
    }
    if (!status && printed)
        drape_scene_print(scene, append, printed);
    drape_scene_destroy(&scene);
    return status;
}

/* Checks that the printed text of the scene compiles to the same nodes, masses and unknowns. */
static void check_printed(drape_context *ctx, const drape_model *model, const char *printed)
{
    drape_model *again = NULL;
    const drape_status status = compile(ctx, printed, &again, NULL);
    if (status == DRAPE_E_MEMORY) /* there are two models now */
        return;
    FUZZ_REQUIRE(status == DRAPE_OK, "%s\n%s", drape_context_message(ctx), printed);
    FUZZ_REQUIRE(drape_model_node_count(again) == drape_model_node_count(model) &&
                     drape_model_dof_count(again) == drape_model_dof_count(model) &&
                     drape_model_collider_count(again) == drape_model_collider_count(model),
                 "printed, it is another scene:\n%s", printed);
    drape_model_destroy(&again);
}

drape_model *fuzz_scene(drape_context *ctx, const uint8_t *data, size_t size)
{
    text given = {0}, printed = {0};
    drape_model *model = NULL;
    append(&given, (const char *)data, size);
    if (compile(ctx, given.data, &model, &printed) == DRAPE_OK)
        check_printed(ctx, model, printed.data);
    free(given.data);
    free(printed.data);
    return model;
}

/* ---- Meshes ---- */

static const drape_import_ops *find_import(const char *name)
{
    const int i = drape_registry_find(&drape_import_registry, NULL, name);
    if (i < 0)
        fuzz_die(__FILE__, __LINE__, "a mesh format", "%s", name);
    return drape_imports[i];
}

static void check_corners(const drape_mesh *mesh)
{
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++)
        FUZZ_REQUIRE(mesh->triangle[i] >= 0 && mesh->triangle[i] < mesh->node_count, "corner %d of %d nodes",
                     mesh->triangle[i], mesh->node_count);
}

static void check_measures(const drape_mesh *mesh)
{
    for (int32_t i = 0; i < mesh->edge_count; i++)
        FUZZ_REQUIRE(mesh->edge_length[i] > 0 && isfinite(mesh->edge_length[i]), "edge %d is of length %g", i,
                     mesh->edge_length[i]);
    for (int32_t i = 0; i < mesh->triangle_count; i++)
        FUZZ_REQUIRE(mesh->triangle_area[i] > 0 && isfinite(mesh->triangle_area[i]),
                     "triangle %d is of area %g", i, mesh->triangle_area[i]);
}

void fuzz_mesh(const char *format, const uint8_t *data, size_t size)
{
    const drape_mesh_source source = {.pointer = "/cloth/0/mesh/file", .file = format};
    drape_context *ctx = fuzz_open(MAX_MEMORY);
    drape_mesh mesh = {0};
    char *ended = malloc(size + 1); /* an exact copy: a sanitizer detects reads past its end */
    FUZZ_REQUIRE(ended, "no memory for %zu bytes", size);
    if (size > 0)
        memcpy(ended, data, size);
    ended[size] = 0;
    drape_status status = find_import(format)->read(ctx, &source, ended, size, &mesh);
    fuzz_check(ctx, status, "read");
    if (!status) {
        check_corners(&mesh);
        status = drape_mesh_validate_positions(ctx, &source, &mesh);
    }
    status = status ? status : drape_mesh_validate_triangles(ctx, &source, &mesh);
    status = status ? status : drape_mesh_connect(ctx, &source, &mesh);
    status = status ? status : drape_mesh_validate_nodes(ctx, &source, &mesh);
    status = status ? status : drape_mesh_measure(&mesh);
    fuzz_check(ctx, status, "a stage of the mesh");
    if (!status)
        check_measures(&mesh);
    drape_mesh_free(&mesh);
    free(ended);
    fuzz_close(&ctx);
}
