/*
 * test_hashes.c: every example scene under every integrator, for two attempts: the bits of the state are those of hashes.txt, where
 * that is of this build, and in any build those of another process, of other numbers of threads, of a sim that was stopped at
 * each attempt or saved and restored between two, beside others on the same thread and on another one.
 *
 * hashes.txt begins with the build that it is of. Bits depend on the compiler and the solvers, and on the C library: it picks its
 * sines and logarithms by the processor, and they differ in a last digit. So the build's name has a hash of what these give.
 * OpenBLAS does the same with its products. `tools/hashes` writes the file anew: with DRAPE_HASHES=FILE this program writes its own hashes there and tests nothing.
 */
#include <dirent.h>
#include <dlfcn.h>
#include <inttypes.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/hash.h"
#include "integrators/integrator.h"
#include "sim/sim.h"
#include "support/bytes.h"
#include "support/suite.h"

#define ATTEMPTS    2
#define FRAMES      2 /* what is advanced by, where it takes fewer attempts */
#define MOST_SCENES 64
#define MOST_ROWS   32
#define MOST_SIDE   30 /* nodes; scenes with larger grids are made so small */
#define LINE        512

typedef struct golden {
    char scene[64];
    const char *integrator;
    drape_status status;
    uint64_t hash;
} golden;

static golden table[MOST_SCENES * MOST_ROWS];
static int table_count;

/* Outside of tests, and on another thread, Check cannot be told. */
#define REQUIRE(good, ...)                                                                                   \
    do {                                                                                                     \
        if (!(good)) {                                                                                       \
            fprintf(stderr, __VA_ARGS__);                                                                    \
            fputc('\n', stderr);                                                                             \
            exit(1);                                                                                         \
        }                                                                                                    \
    } while (0)

/* ---- The build ---- */

/* What of the C library the library calls, at arguments of all sizes. */
static uint64_t library_hash(void)
{
    uint64_t hash = DRAPE_HASH_START;
    for (int i = 1; i <= 4000; i++) {
        const double a = i * 0.000731, b = 1.37 * sin(i * 12.9898);
        const double all[] = {sin(9 * a), cos(9 * a),      tan(a),     acos(b / 1.4), asin(b / 1.4),
                              atan(b),    atan2(b, a - 1), exp(9 * b), expm1(b),      log(a),
                              log10(a),   log1p(a),        pow(a, b),  hypot(a, b),   cbrt(a),
                              exp2(b),    log2(a),         sinh(b),    cosh(b),       tanh(b)};
        hash = drape_hash_bytes(hash, all, sizeof all);
    }
    return hash;
}

typedef void multiply(const char *, const char *, const int *, const int *, const int *, const double *,
                      const double *, const int *, const double *, const int *, const double *, double *,
                      const int *);

/* What BLAS makes of a product, where there is one: OpenBLAS picks its kernels by the processor. */
static uint64_t blas_hash(void)
{
    enum { N = 96 };
    static double a[N * N], b[N * N], c[N * N];
    const int n = N;
    const double one = 1, zero = 0;
    void *program = dlopen(NULL, RTLD_NOW), *symbol = program ? dlsym(program, "dgemm_") : NULL;
    multiply *gemm;
    if (!symbol)
        return 0;
    memcpy(&gemm, &symbol, sizeof gemm);
    for (int i = 0; i < N * N; i++) {
        a[i] = (i * 37 % 101) / 101.0 - 0.5;
        b[i] = (i * 53 % 97) / 97.0 - 0.5;
    }
    gemm("N", "N", &n, &n, &n, &one, a, &n, b, &n, &zero, c, &n);
    dlclose(program);
    return drape_hash_bytes(DRAPE_HASH_START, c, sizeof c);
}

static void name_build(char *text, size_t size)
{
    char build[LINE / 2];
    drape_sim_describe_build(build, sizeof build);
    snprintf(text, size, "%s, functions of the C library %016" PRIx64 ", of BLAS %016" PRIx64, build,
             library_hash(), blas_hash());
}

/* ---- Scenes ---- */

static int compare_names(const void *a, const void *b)
{
    return strcmp(a, b);
}

static int list_scenes(const char *folder, char names[][64])
{
    int count = 0;
    DIR *dir = opendir(folder);
    REQUIRE(dir, "there is no %s", folder);
    for (struct dirent *entry = readdir(dir); entry; entry = readdir(dir)) {
        const size_t length = strlen(entry->d_name);
        if (length < 6 || length > 60 || strcmp(entry->d_name + length - 5, ".json") != 0)
            continue;
        REQUIRE(count < MOST_SCENES, "more than %d scenes", MOST_SCENES);
        memcpy(names[count], entry->d_name, length - 5);
        names[count++][length - 5] = 0;
    }
    closedir(dir);
    qsort(names, (size_t)count, sizeof *names, compare_names);
    return count;
}

/* A grid of more nodes gets fewer; what its pins name must be there all the same. */
static drape_status make_small(drape_scene *scene)
{
    static const char *const sides[] = {"/cloth/0/mesh/columns", "/cloth/0/mesh/rows"};
    char most[16];
    drape_status status = DRAPE_OK;
    snprintf(most, sizeof most, "%d", MOST_SIDE);
    for (int i = 0; i < 2 && !status; i++)
        status = drape_scene_set(scene, sides[i], most);
    return status;
}

static drape_model *compile(drape_context *ctx, const char *name)
{
    char path[1024];
    const char *source = getenv("DRAPE_SOURCE");
    drape_scene *scene = NULL;
    drape_model *model = NULL;
    snprintf(path, sizeof path, "%.800s/examples/scenes/%.60s.json", source ? source : ".", name);
    drape_status status = drape_scene_load(ctx, path, &scene);
    status = status ? status : drape_scene_compile(scene, &model);
    if (!status && drape_model_node_count(model) > 4 * MOST_SIDE * MOST_SIDE) {
        drape_model_destroy(&model);
        status = make_small(scene);
        status = status ? status : drape_scene_compile(scene, &model);
    }
    REQUIRE(!status, "%s: %s", name, drape_context_message(ctx));
    drape_scene_destroy(&scene);
    return model;
}

/* ---- A sim that stops after each attempt, or after the last ---- */

typedef struct driven {
    drape_context *ctx;
    drape_sim *sim;
    double end;
    int left;  /* attempts */
    bool each; /* stops after each attempt */
    drape_status status;
} driven;

static drape_status look(void *user, const drape_event *event)
{
    driven *d = user;
    if (event->kind != DRAPE_EVENT_ATTEMPT)
        return DRAPE_OK;
    d->left--;
    return d->each || d->left == 0 ? 1 : DRAPE_OK;
}

/* Statics ends after some steps of its flow, where each node is held but for twenty times the heaviest one's weight: to the end
 * it would take minutes for cloth that falls freely or flutters. */
static double loose_tolerance(const drape_model *model)
{
    double most = 0;
    for (int32_t i = 0; i < drape_model_node_count(model); i++)
        most = fmax(most, drape_model_masses(model)[i]);
    return 20 * 9.81 * most;
}

/* At d, which stays where it is. */
static void start(driven *d, const drape_model *model, const drape_integrator_ops *row, int threads,
                  bool each)
{
    const drape_setting loose = {.name = "tolerance", .number = loose_tolerance(model)};
    drape_sim_def def;
    *d = (driven){.left = ATTEMPTS, .each = each, .end = FRAMES / drape_model_frame_rate(model)};
    REQUIRE(!drape_context_create(NULL, &d->ctx), "no context");
    drape_sim_def_init(&def, sizeof def);
    def.integrator = row->name;
    def.threads = threads;
    def.integrator_settings = &loose;
    def.integrator_setting_count = row->timeless;
    d->status = drape_sim_create(d->ctx, model, &def, &d->sim);
    REQUIRE(d->status || !drape_sim_observe(d->sim, look, d), "%s", drape_context_message(d->ctx));
}

/* Goes on to its next stop; false: there is none. */
static bool go_on(driven *d)
{
    if (!d->sim || d->left <= 0)
        return false;
    d->status = drape_sim_advance(d->sim, d->end);
    return d->status == DRAPE_E_STOPPED && d->left > 0;
}

static golden finish(driven *d, const char *scene, const char *integrator)
{
    golden g = {.integrator = integrator, .status = d->status, .hash = d->sim ? drape_sim_hash(d->sim) : 0};
    snprintf(g.scene, sizeof g.scene, "%s", scene);
    drape_sim_destroy(&d->sim);
    drape_context_destroy(&d->ctx);
    return g;
}

/* Another sim goes on where it is. */
static void save_and_restore(driven *d, const drape_model *model, const drape_integrator_ops *row,
                             int threads)
{
    const int left = d->left;
    bytes b = bytes_save(d->sim);
    drape_sim_destroy(&d->sim);
    drape_context_destroy(&d->ctx);
    start(d, model, row, threads, d->each);
    d->left = left;
    d->status = drape_sim_restore_from(d->sim, b.data, b.size);
    REQUIRE(!d->status, "%s", drape_context_message(d->ctx));
    free(b.data);
}

/* ---- All of them, plainly ---- */

static void for_all(void (*visit)(const char *scene, const drape_model *model,
                                  const drape_integrator_ops *row))
{
    static char names[MOST_SCENES][64];
    char folder[900];
    const char *source = getenv("DRAPE_SOURCE");
    snprintf(folder, sizeof folder, "%.800s/examples/scenes", source ? source : ".");
    const int count = list_scenes(folder, names);
    for (int i = 0; i < count; i++) {
        drape_context *ctx = NULL;
        REQUIRE(!drape_context_create(NULL, &ctx), "no context");
        drape_model *model = compile(ctx, names[i]);
        for (int k = 0; drape_integrators[k]; k++)
            visit(names[i], model, drape_integrators[k]);
        drape_model_destroy(&model);
        drape_context_destroy(&ctx);
    }
}

static void fill(const char *scene, const drape_model *model, const drape_integrator_ops *row)
{
    driven d;
    REQUIRE(table_count < MOST_SCENES * MOST_ROWS, "more than %d rows", MOST_ROWS);
    start(&d, model, row, 1, false);
    go_on(&d);
    table[table_count++] = finish(&d, scene, row->name);
}

static const golden *find(const char *scene, const char *integrator)
{
    for (int i = 0; i < table_count; i++)
        if (strcmp(table[i].scene, scene) == 0 && strcmp(table[i].integrator, integrator) == 0)
            return &table[i];
    return NULL;
}

/* ---- The file ---- */

static int write_table(const char *path)
{
    char build[LINE];
    FILE *file = fopen(path, "w");
    if (!file)
        return 1;
    name_build(build, sizeof build);
    fprintf(file,
            "# Bits of the states of the example scenes after %d attempts: scene, integrator, status, hash; "
            "by tools/hashes.\n"
            "build: %s\n",
            ATTEMPTS, build);
    for (int i = 0; i < table_count; i++)
        fprintf(file, "%s %s %s %016" PRIx64 "\n", table[i].scene, table[i].integrator,
                drape_status_name(table[i].status), table[i].hash);
    return fclose(file) != 0;
}

/* How many lines are not as here; the first of them is told. same_build: that of the file is this one, else 0 is returned. */
static int compare_file(const char *path, bool *same_build, char *told, size_t size)
{
    char line[LINE], build[LINE], here[LINE + 16], scene[64], row[64], status[64];
    uint64_t hash;
    int lines = 0, wrong = 0;
    FILE *file = fopen(path, "r");
    ck_assert_msg(file && fgets(line, sizeof line, file) && fgets(line, sizeof line, file), "%s", path);
    name_build(build, sizeof build);
    snprintf(here, sizeof here, "build: %s\n", build);
    *same_build = strcmp(line, here) == 0;
    snprintf(told, size, "%s", line);
    while (*same_build && fgets(line, sizeof line, file)) {
        ck_assert_int_eq(sscanf(line, "%63s %63s %63s %" SCNx64, scene, row, status, &hash), 4);
        const golden *g = find(scene, row);
        lines++;
        if (g && g->hash == hash && strcmp(drape_status_name(g->status), status) == 0)
            continue;
        if (wrong++ == 0)
            snprintf(told, size, "%s %s: %s %016" PRIx64 " there, %s %016" PRIx64 " here", scene, row, status,
                     hash, g ? drape_status_name(g->status) : "none", g ? g->hash : 0);
    }
    fclose(file);
    return *same_build && lines != table_count ? wrong + abs(lines - table_count) : wrong;
}

/* ---- The tests ---- */

/* The file, or where that is of another build one that another process writes. */
static int compare_process(char *told, size_t size)
{
    char path[] = "/tmp/drape-hashes-XXXXXX", command[128];
    bool same;
    const int fd = mkstemp(path);
    ck_assert_int_ge(fd, 0);
    close(fd);
    snprintf(command, sizeof command, "DRAPE_HASHES='%s' /proc/%ld/exe", path, (long)getpid());
    ck_assert_int_eq(system(command), 0);
    const int wrong = compare_file(path, &same, told, size);
    ck_assert(same);
    unlink(path);
    return wrong;
}

START_TEST(another_process_had_the_same_bits)
{
    char path[1024], told[LINE];
    const char *source = getenv("DRAPE_SOURCE");
    bool same;
    snprintf(path, sizeof path, "%.800s/tests/golden/hashes.txt", source ? source : ".");
    int wrong = compare_file(path, &same, told, sizeof told);
    if (!same) {
        printf("# hashes.txt is of another build: this one's runs are compared with each other. %s", told);
        wrong = compare_process(told, sizeof told);
    }
    ck_assert_msg(wrong == 0,
                  "%d of %d lines are not so, such as %s; where results were meant to change, tools/hashes",
                  wrong, table_count, told);
}
END_TEST

typedef struct pair {
    const drape_model *model;
    const drape_integrator_ops *row;
    const char *scene;
    golden plain, restored;
} pair;

/* Two sims in turns, attempt by attempt, with two threads and with three, one of which is another one after its first attempt. */
static void *drive_two(void *user)
{
    pair *p = user;
    driven plain, restored;
    start(&plain, p->model, p->row, 2, true);
    start(&restored, p->model, p->row, 3, true);
    bool more = go_on(&restored);
    if (more)
        save_and_restore(&restored, p->model, p->row, 1);
    for (bool other = true; more || other;) {
        other = go_on(&plain);
        more = more && go_on(&restored);
    }
    p->plain = finish(&plain, p->scene, p->row->name);
    p->restored = finish(&restored, p->scene, p->row->name);
    return NULL;
}

static void check_same(const golden *g, const golden *expected, const char *what)
{
    ck_assert_msg(g->hash == expected->hash && g->status == expected->status,
                  "%s, %s, %s: %s %016" PRIx64 ", expected %s %016" PRIx64, g->scene, g->integrator, what,
                  drape_status_name(g->status), g->hash, drape_status_name(expected->status), expected->hash);
}

static void compare_at_once(const char *scene, const drape_model *model, const drape_integrator_ops *row)
{
    pthread_t thread;
    driven beside;
    pair p = {.model = model, .row = row, .scene = scene};
    const golden *expected = find(scene, row->name);
    ck_assert_ptr_nonnull(expected);
    ck_assert_int_eq(pthread_create(&thread, NULL, drive_two, &p), 0);
    start(&beside, model, row, 1, false);
    go_on(&beside);
    ck_assert_int_eq(pthread_join(thread, NULL), 0);
    const golden alone = finish(&beside, scene, row->name);
    check_same(&p.plain, expected, "two threads, stopped at each attempt");
    check_same(&p.restored, expected, "three threads, saved, and restored with one");
    check_same(&alone, expected, "while others run");
}

START_TEST(sims_at_once_have_the_same_bits)
{
    for_all(compare_at_once);
}
END_TEST

/* The table is made before Check forks, and once. */
int main(void)
{
    const TTest *const tests[] = {another_process_had_the_same_bits, sims_at_once_have_the_same_bits};
    const char *path = getenv("DRAPE_HASHES");
    for_all(fill);
    return path ? write_table(path) : run_suite("hashes", tests, sizeof tests / sizeof *tests);
}
