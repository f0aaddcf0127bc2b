/*
 * soak.c: drives sims for long as a host does, frame after frame, t += 1/60, with pins and colliders moved
 * in each frame. It checks that memory does not grow, and that a second run has the same bits at every
 * mark, although it is saved and restored there. `soak [--steps N] [--minutes M] [CASE...]`: each case for
 * at least N steps (default: for a few seconds), or for M minutes. TAP on stdout.
 *
 * Measured at each mark, in bytes: what Drape's allocator has allocated, the heap that malloc has allocated
 * for all libraries, and the pages of the process (Anonymous of /proc/self/smaps_rollup, which counts them,
 * where other counters of Linux are off by up to 64 pages a thread). In the first marks a case warms up:
 * lists of contacts grow to the longest of the motion.
 */
#include <fcntl.h>
#include <inttypes.h>
#include <malloc.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "drape/drape.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define COUNTS_PAGES 0 /* sanitizers keep released memory */
#else
#define COUNTS_PAGES 1
#endif

#define FRAME     (1.0 / 60) /* [s] */
#define PERIOD    240        /* frames of the host's motion */
#define MAX_MARKS 65536
/* [bytes] A block of malloc may be larger than requested, as remainders below 32 bytes are not split off:
 * for some hundred blocks of a sim. A leak at each restore, of at least 16 bytes, is more than that after
 * 256 of them. */
#define HEAP_SLACK 4096
/* [bytes] malloc may split a block otherwise at some later time, and touch pages at its top that were not yet
 * used. They find what no malloc allocates, such as mappings: at least one page each. */
#define PAGE_SLACK  (128 << 10)
#define SHORT_MARKS 12 /* after the warm-up, by default */

/* ---- Cases ---- */

typedef struct soak {
    const char *name;
    const char *scene;  /* apostrophes stand for quotation marks */
    int mark;           /* frames from mark to mark */
    int warm;           /* marks of the warm-up */
    int pins[2];        /* nodes that the host moves together, back and forth by sway */
    double sway[3];     /* [m] */
    double collider[3]; /* [m] amplitude of collider 0, if there is one */
} soak;

#define CLOTH(columns, size, at, modulus)                                                                    \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': " columns ", 'rows': " columns            \
    ", 'width': " size ", 'height': " size ", 'transform': {'translate': " at "}},"                          \
    "'material': {'young_modulus': " modulus ", 'thickness': 1e-3, 'density': 200},"                         \
    "'terms': ['stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 2e-3}],"                  \
    "'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}]}],"

static const soak cases[] = {
    {.name = "verlet",
     .scene = CLOTH("3", "0.2", "[0, 0, 0]",
                    "1e4") "'integrator': {'method': 'verlet', 'dt': 0.0041666666666666666,"
                           "'substeps': 1}, 'duration': 1}",
     .mark = 100,
     .warm = 3,
     .pins = {0, 2},
     .sway = {0.05, 0, 0}},
    {.name = "be",
     .scene =
         CLOTH("3", "0.2", "[0, 0, 0]", "1e4") "'integrator': {'dt': 0.0041666666666666666}, 'duration': 1}",
     .mark = 100,
     .warm = 3,
     .pins = {0, 2},
     .sway = {0.05, 0, 0}},
    {.name = "contact",
     .scene = CLOTH("12", "0.4", "[-0.2, 0.12, 0.2]",
                    "1e5") "'colliders': [{'type': 'sphere', 'center': [0, 0, 0], "
                           "'radius': 0.1, 'friction': 0.3},"
                           "{'type': 'plane', 'point': [0, -0.12, 0], 'normal': [0, 1, "
                           "0], 'friction': 0.4}],"
                           "'self_contact': {'thickness': 3e-3, 'friction': 0.2}, "
                           "'contact': {'friction': 'lagged'},"
                           "'integrator': {'dt': 0.016666666666666666}, 'duration': 1}",
     .mark = 10,
     .warm = 48, /* two periods */
     .pins = {0, 11},
     .sway = {0.1, 0, 0.05},
     .collider = {0, 0.04, 0.1}},
};
enum { CASES = sizeof cases / sizeof *cases };

/* ---- Memory ---- */

typedef struct memory {
    int64_t own;   /* [bytes] taken by the context's allocator */
    int64_t heap;  /* [bytes] taken by malloc */
    int64_t pages; /* [bytes] of the process */
} memory;

static int64_t own;

#define FRONT 16 /* before each block: its size, and the alignment of any type */

static void *take(void *user, size_t size)
{
    unsigned char *piece = malloc(FRONT + size);
    (void)user;
    if (!piece)
        return NULL;
    memcpy(piece, &size, sizeof size);
    own += (int64_t)size;
    return piece + FRONT;
}

static void release(void *user, void *block)
{
    unsigned char *piece = (unsigned char *)block - FRONT;
    size_t size;
    (void)user;
    memcpy(&size, piece, sizeof size);
    own -= (int64_t)size;
    free(piece);
}

/* 0 if the system does not report it. */
static int64_t count_pages(void)
{
    static char text[4096];
    int fd = open("/proc/self/smaps_rollup", O_RDONLY | O_CLOEXEC);
    ssize_t n = fd >= 0 ? read(fd, text, sizeof text - 1) : -1;
    if (fd >= 0)
        close(fd);
    text[n > 0 ? n : 0] = 0;
    const char *line = strstr(text, "\nAnonymous:");
    return line && COUNTS_PAGES ? 1024 * strtoll(line + strlen("\nAnonymous:"), NULL, 10) : 0;
}

/* The bytes that malloc has allocated for all libraries; 0 if it does not report them. */
static int64_t count_heap(void)
{
#if COUNTS_PAGES && defined(__GLIBC__) && __GLIBC_PREREQ(2, 33)
    const struct mallinfo2 all = mallinfo2();
    return (int64_t)(all.uordblks + all.hblkhd);
#else
    return 0;
#endif
}

/* A sim that is destroyed and created repeatedly leaves gaps, which malloc reuses at some later time: then
 * the pages are no measure. */
static memory measure(bool restart)
{
    return (memory){.own = own, .heap = count_heap(), .pages = restart ? 0 : count_pages()};
}

static int64_t larger(int64_t a, int64_t b)
{
    return a > b ? a : b;
}

static void raise_to(memory *max, memory m)
{
    max->own = larger(max->own, m.own);
    max->heap = larger(max->heap, m.heap);
    max->pages = larger(max->pages, m.pages);
}

/* ---- One run ---- */

typedef struct mark {
    uint64_t hash;
    memory memory;
} mark;

typedef struct span {
    int64_t steps;  /* at least this number of steps, or */
    double seconds; /* this time by the clock, or */
    int marks;      /* this number of marks, or */
    bool brief;     /* some marks after the warm-up */
} span;

typedef struct result {
    int marks;
    int64_t frames, steps, rejected;
    double seconds;
    char failure[600]; /* "" for none */
} result;

static mark first[MAX_MARKS], second[MAX_MARKS];
static unsigned char *saved;
static size_t saved_size, saved_room;

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static drape_status keep(void *user, const void *bytes, size_t size)
{
    (void)user;
    if (saved_size + size > saved_room) {
        saved_room = 2 * (saved_size + size);
        saved = realloc(saved, saved_room);
        if (!saved)
            return DRAPE_E_MEMORY;
    }
    memcpy(saved + saved_size, bytes, size);
    saved_size += size;
    return DRAPE_OK;
}

static drape_status save_and_restore(drape_sim *sim)
{
    saved_size = 0;
    const drape_status status = drape_sim_save_to(sim, keep, NULL);
    return status ? status : drape_sim_restore_from(sim, saved, saved_size);
}

/* Moves pins and collider to their positions at the end of this frame: on a sine, counted within its
 * period. */
static drape_status move(const soak *c, drape_sim *sim, int64_t frame)
{
    const drape_model *model = drape_sim_model(sim);
    const double *rest = drape_model_rest_positions(model);
    const double phase = sin(2 * 3.141592653589793 * (double)((frame + 1) % PERIOD) / PERIOD);
    double to[6], displacement[3];
    int32_t nodes[2];
    for (int i = 0; i < 2; i++) {
        nodes[i] = c->pins[i];
        for (int k = 0; k < 3; k++)
            to[3 * i + k] = rest[3 * nodes[i] + k] + phase * c->sway[k];
    }
    drape_status status = drape_sim_move_pins(sim, 2, nodes, FRAME, to, NULL);
    for (int k = 0; k < 3; k++)
        displacement[k] = phase * c->collider[k];
    if (!status && drape_model_collider_count(model) > 0)
        status = drape_sim_move_collider(sim, 0, FRAME, displacement, NULL);
    return status;
}

static bool continues(const span *s, const result *r, double start)
{
    return r->marks < MAX_MARKS && (r->steps < s->steps || now() - start < s->seconds || r->marks < s->marks);
}

static drape_status one_mark(const soak *c, drape_sim *sim, bool restart, mark *marks, result *r)
{
    drape_status status = DRAPE_OK;
    for (int f = 0; f < c->mark && !status; f++, r->frames++) {
        status = move(c, sim, r->frames);
        status = status ? status : drape_sim_advance(sim, drape_sim_time(sim) + FRAME);
    }
    marks[r->marks++] = (mark){.hash = drape_sim_hash(sim), .memory = measure(restart)};
    status = status || !restart ? status : save_and_restore(sim);
    r->steps = drape_sim_statistics(sim).steps_accepted;
    r->rejected = drape_sim_statistics(sim).steps_rejected;
    return status;
}

static drape_status parse(drape_context *ctx, const soak *c, drape_scene **scene)
{
    char text[2048];
    snprintf(text, sizeof text, "%s", c->scene);
    for (char *at = text; *at; at++)
        *at = *at == '\'' ? '"' : *at;
    return drape_scene_parse(ctx, text, c->name, scene);
}

static result run(const soak *c, const span *s, bool restart, mark *marks)
{
    drape_context_def def;
    drape_context *ctx = NULL;
    drape_scene *scene = NULL;
    drape_model *model = NULL;
    drape_sim *sim = NULL;
    result r = {0};
    const double start = now();
    drape_context_def_init(&def, sizeof def);
    def.allocate = take;
    def.release = release;
    drape_status status = drape_context_create(&def, &ctx);
    status = status ? status : parse(ctx, c, &scene);
    status = status ? status : drape_scene_compile(scene, &model);
    status = status ? status : drape_sim_create(ctx, model, NULL, &sim);
    while (!status && continues(s, &r, start))
        status = one_mark(c, sim, restart, marks, &r);
    if (status)
        snprintf(r.failure, sizeof r.failure, "%s: %s", drape_status_name(status),
                 drape_context_message(ctx));
    r.seconds = now() - start;
    drape_sim_destroy(&sim);
    drape_model_destroy(&model);
    drape_scene_destroy(&scene);
    drape_context_destroy(&ctx);
    return r;
}

/* ---- The judgement ---- */

static memory growth(const mark *marks, int count, int warming, memory *warm)
{
    memory max = {0};
    *warm = (memory){0};
    for (int i = 0; i < count; i++)
        raise_to(i < warming ? warm : &max, marks[i].memory);
    return (memory){.own = larger(max.own - warm->own, 0),
                    .heap = larger(max.heap - warm->heap, 0),
                    .pages = larger(max.pages - warm->pages, 0)};
}

static int different(int count)
{
    for (int i = 0; i < count; i++)
        if (first[i].hash != second[i].hash)
            return i;
    return count;
}

/* Prints the result of a run; returns whether it is good. */
static bool print_result(int number, const soak *c, const result *r, const mark *marks, const result *before)
{
    memory warm;
    const memory grown = growth(marks, r->marks, c->warm, &warm);
    const int same = before ? different(r->marks) : r->marks;
    const bool good = !*r->failure && own == 0 && grown.own == 0 && grown.heap <= HEAP_SLACK &&
                      grown.pages <= PAGE_SLACK && same == r->marks;
    printf("%s %d - %s%s: %" PRId64 " steps (%" PRId64 " rejected) in %" PRId64
           " frames, %.0f s; hash %016" PRIx64 " at the last of %d marks; %" PRId64
           " B of its own, grown by %" PRId64 " B, left %" PRId64 " B; %" PRId64
           " B of heap, grown by %" PRId64 " B; %" PRId64 " B of pages, grown by %" PRId64 " B\n",
           good ? "ok" : "not ok", number, c->name, before ? " again, restored at each mark" : "", r->steps,
           r->rejected, r->frames, r->seconds, marks[r->marks - 1].hash, r->marks, warm.own, grown.own, own,
           warm.heap, grown.heap, warm.pages, grown.pages);
    if (*r->failure)
        printf("# %s\n", r->failure);
    if (same < r->marks)
        printf("# mark %d: hash %016" PRIx64 ", and %016" PRIx64 " at first\n", same, second[same].hash,
               first[same].hash);
    fflush(stdout);
    return good;
}

static bool try_case(int number, const soak *c, const span *s)
{
    const span brief = {.marks = c->warm + SHORT_MARKS};
    const result one = run(c, s->brief ? &brief : s, false, first);
    bool good = print_result(2 * number + 1, c, &one, first, NULL);
    const result two = run(c, &(span){.marks = one.marks}, true, second);
    return print_result(2 * number + 2, c, &two, second, &one) && good;
}

/* ---- The program ---- */

static bool chosen(const soak *c, int count, char **names)
{
    for (int i = 0; i < count; i++)
        if (strcmp(names[i], c->name) == 0)
            return true;
    return count == 0;
}

int main(int argc, char **argv)
{
    span s = {0};
    int i = 1, number = 0, failed = 0;
    for (; i + 1 < argc && strncmp(argv[i], "--", 2) == 0; i += 2) {
        if (strcmp(argv[i], "--steps") == 0)
            s.steps = strtoll(argv[i + 1], NULL, 10);
        else if (strcmp(argv[i], "--minutes") == 0)
            s.seconds = 60 * strtod(argv[i + 1], NULL);
        else
            break;
    }
    if (i < argc && argv[i][0] == '-')
        return fprintf(stderr, "soak [--steps N] [--minutes M] [CASE...]\n"), 2;
    if (s.steps <= 0 && !(s.seconds > 0))
        s.brief = true;
    setvbuf(stdout, NULL, _IOLBF, 1 << 12);
    memset(first, 0, sizeof first); /* touches all pages before anything is measured */
    memset(second, 0, sizeof second);
    for (int k = 0; k < CASES; k++)
        number += chosen(&cases[k], argc - i, argv + i);
    printf("1..%d\n", 2 * number);
    number = 0;
    for (int k = 0; k < CASES; k++)
        if (chosen(&cases[k], argc - i, argv + i))
            failed += !try_case(number++, &cases[k], &s);
    free(saved);
    return failed > 0;
}
