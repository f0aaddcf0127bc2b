/*
 * test_hashes.c: every example scene under every integrator, for three attempts: the bits of the state are
 * those of hashes.txt, where that is of this build, and in any build those of another process, of other
 * numbers of threads, of a sim that was stopped at each attempt or saved and restored between two, beside
 * others on the same thread and on another one.
 *
 * Meshes are made coarse, so that there is time for contact: where a scene has colliders or layers, the
 * attempts begin where `be` has brought it to after most of its duration, and it is looked that they act
 * there. With a sanitizer, which makes all ten times slower, every other scene is left out: box_edge,
 * crumple, flag, fold, hung_sheet, sphere_drape and verlet_100 stay, under every integrator.
 *
 * hashes.txt begins with the build that its bits belong to: they depend on the compiler, the solvers, and on
 * the C library and BLAS, which pick their functions by the processor. The name of the build has a hash of
 * what the C library's functions give, and the name of OpenBLAS's kernels. On another build the runs are
 * compared with those of a second process instead. `tools/hashes` writes the file anew: with
 * DRAPE_HASHES=FILE this program writes its own hashes there and tests nothing.
 */
#include <dirent.h>
#include <dlfcn.h>
#include <gnu/libc-version.h>
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

#define ATTEMPTS    3
#define FRAMES      2   /* what is advanced by, where it takes fewer attempts */
#define SHARE       0.7 /* of the duration, before */
#define LONGEST     2.0 /* [s] at most */
#define MOST_SCENES 64
#define MOST_ROWS   32
#define MOST_PREPARED                                                                                        \
    1000 /* nodes of a scene that is brought to its moment: one in the form of CS184 stays as large as it
            is */
#define MOST_NODES 200 /* grids of more are made of every other node, and again */
#define LINE       512

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define EVERY 2 /* of the scenes in their order */
#else
#define EVERY 1
#endif

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

/* BLAS picks its kernels by the processor, and those for triangular solves differ in a last digit where
 * products of matrices agree: so the kernels are named and not sampled. A BLAS that is not OpenBLAS has no
 * name for them. */
static const char *blas_kernels(void)
{
    typedef char *describe(void);
    describe *corename;
    void *program = dlopen(NULL, RTLD_NOW),
         *symbol = program ? dlsym(program, "openblas_get_corename") : NULL;
    if (!symbol)
        return "unnamed";
    memcpy(&corename, &symbol, sizeof corename);
    dlclose(program);
    return corename();
}

static void name_build(char *text, size_t size)
{
    char build[LINE / 2];
    drape_sim_describe_build(build, sizeof build);
    snprintf(text, size, "%s, C library %s with functions %016" PRIx64 ", BLAS kernels %s", build,
             gnu_get_libc_version(), library_hash(), blas_kernels());
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

/* "/cloth/0/mesh/columns" gets every other of `nodes`. */
static drape_status halve(drape_scene *scene, int32_t cloth, const char *key, int32_t nodes)
{
    char pointer[64], text[16];
    snprintf(pointer, sizeof pointer, "/cloth/%d/mesh/%s", (int)cloth, key);
    snprintf(text, sizeof text, "%d", (int)(nodes + 1) / 2);
    return drape_scene_set(scene, pointer, text);
}

/* Makes the grids of more nodes coarser, once; whether there were any. Equilateral ones, which no contact is
 * in, stay. */
static bool make_coarser(drape_scene *scene, const drape_model *model)
{
    bool any = false;
    for (int32_t c = 0; c < model->cloth_count; c++) {
        const drape_cloth *cloth = &model->cloths[c];
        if (cloth->mesh.node_count <= MOST_NODES || strcmp(cloth->grid.type, "square") != 0)
            continue;
        any = true;
        REQUIRE(!halve(scene, c, "columns", cloth->mesh.columns) &&
                    !halve(scene, c, "rows", cloth->mesh.rows),
                "a grid has no columns or rows");
    }
    return any;
}

static drape_model *compile(drape_context *ctx, const char *name)
{
    char path[1024];
    const char *source = getenv("DRAPE_SOURCE");
    drape_scene *scene = NULL;
    drape_model *model = NULL;
    snprintf(path, sizeof path, "%.800s/examples/scenes/%.60s.json", source ? source : ".", name);
    drape_status status = drape_scene_load(ctx, path, &scene);
    for (int32_t before = INT32_MAX, now = 0; now < before;) { /* a scene of another form stays as it is */
        before = now > 0 ? now : before;
        drape_model_destroy(&model);
        status = status ? status : drape_scene_compile(scene, &model);
        REQUIRE(!status, "%s: %s", name, drape_context_message(ctx));
        now = make_coarser(scene, model) ? drape_model_node_count(model) : before;
    }
    drape_scene_destroy(&scene);
    return model;
}

/* ---- Where the attempts begin ---- */

/* A state in the middle of a scene that has contact, by `be` of one thread, and so of the same bits each
 * time; else the beginning. */
typedef struct moment {
    double t;
    double *x, *v;
    bool collider, self, friction; /* what acts */
} moment;

/* The model with some things left out: it shares its arrays. */
static drape_sim *sim_of(drape_context *ctx, const drape_model *model)
{
    drape_sim *sim = NULL;
    drape_sim_def def;
    drape_sim_def_init(&def, sizeof def);
    def.integrator = "be";
    REQUIRE(!drape_sim_create(ctx, model, &def, &sim), "%s", drape_context_message(ctx));
    return sim;
}

/* Forces of contact (node_count x 3) that the model has at a moment; its sum of squares. */
static double push(drape_context *ctx, const drape_model *model, const moment *m, bool friction,
                   double *forces)
{
    double sum = 0;
    drape_sim *sim = sim_of(ctx, model);
    REQUIRE(!drape_sim_set_state(sim, m->t, m->x, m->v), "%s", drape_context_message(ctx));
    const drape_state *now = drape_sim_state(sim);
    const drape_point point = {
        .x = now->x, .v = now->v, .internal = now->internal, .t = now->t, .span = {now->t, now->t}};
    REQUIRE(!drape_system_begin(sim->system, now), "%s", drape_context_message(ctx));
    drape_system_contact_part(sim->system, &point, friction, forces, NULL);
    for (size_t i = 0; i < 3 * (size_t)model->node_count; i++)
        sum += forces[i] * forces[i];
    drape_sim_destroy(&sim);
    return sum;
}

static void find_what_acts(drape_context *ctx, const drape_model *model, moment *m)
{
    const size_t n = 3 * (size_t)model->node_count;
    double *with = calloc(n, sizeof *with), *without = calloc(n, sizeof *without);
    drape_model colliders = *model, self = *model;
    colliders.contact.self = false;
    self.collider_count = 0;
    REQUIRE(with && without, "no memory");
    m->collider = model->collider_count > 0 && push(ctx, &colliders, m, false, with) > 0;
    m->self = model->contact.self && push(ctx, &self, m, false, with) > 0;
    push(ctx, model, m, true, with);
    push(ctx, model, m, false, without);
    m->friction = memcmp(with, without, n * sizeof *with) != 0;
    free(with);
    free(without);
}

static moment prepare(const char *scene, const drape_model *model)
{
    const size_t n = 3 * (size_t)drape_model_node_count(model);
    moment m = {.x = malloc(n * sizeof *m.x), .v = malloc(n * sizeof *m.v)};
    drape_context *ctx = NULL;
    REQUIRE(m.x && m.v && !drape_context_create(NULL, &ctx), "no memory");
    drape_sim *sim = sim_of(ctx, model);
    const bool meets = drape_model_node_count(model) <= MOST_PREPARED &&
                       (drape_model_collider_count(model) > 0 || model->contact.self);
    REQUIRE(!meets || !drape_sim_advance(sim, fmin(SHARE * drape_model_duration(model), LONGEST)), "%s: %s",
            scene, drape_context_message(ctx));
    m.t = drape_sim_time(sim);
    memcpy(m.x, drape_sim_positions(sim), n * sizeof *m.x);
    memcpy(m.v, drape_sim_velocities(sim), n * sizeof *m.v);
    drape_sim_destroy(&sim);
    if (meets)
        find_what_acts(ctx, model, &m);
    drape_context_destroy(&ctx);
    return m;
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

/* Statics ends after some steps of its flow, where each node is held but for twenty times the heaviest one's
 * weight: to the end it would take minutes for cloth that falls freely or flutters. */
static double loose_tolerance(const drape_model *model)
{
    double most = 0;
    for (int32_t i = 0; i < drape_model_node_count(model); i++)
        most = fmax(most, drape_model_masses(model)[i]);
    return 20 * 9.81 * most;
}

/* At d, which stays where it is. */
static void start(driven *d, const drape_model *model, const moment *from, const drape_integrator_ops *row,
                  int threads, bool each)
{
    const drape_setting loose = {.name = "tolerance", .number = loose_tolerance(model)};
    drape_sim_def def;
    *d = (driven){.left = ATTEMPTS, .each = each, .end = from->t + FRAMES / drape_model_frame_rate(model)};
    REQUIRE(!drape_context_create(NULL, &d->ctx), "no context");
    drape_sim_def_init(&def, sizeof def);
    def.integrator = row->entry.name;
    def.threads = threads;
    def.integrator_settings = &loose;
    def.integrator_setting_count = row->steady_state;
    d->status = drape_sim_create(d->ctx, model, &def, &d->sim);
    REQUIRE(d->status || (!drape_sim_set_state(d->sim, from->t, from->x, from->v) &&
                          !drape_sim_observe(d->sim, look, d)),
            "%s", drape_context_message(d->ctx));
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
static void save_and_restore(driven *d, const drape_model *model, const moment *from,
                             const drape_integrator_ops *row, int threads)
{
    const int left = d->left;
    bytes b = bytes_save(d->sim);
    drape_sim_destroy(&d->sim);
    drape_context_destroy(&d->ctx);
    start(d, model, from, row, threads, d->each);
    d->left = left;
    d->status = drape_sim_restore_from(d->sim, b.data, b.size);
    REQUIRE(!d->status, "%s", drape_context_message(d->ctx));
    free(b.data);
}

/* ---- All of them, plainly ---- */

/* A scene that is ready: its name, model, and where its attempts begin. */
typedef struct ready {
    const char *scene;
    const drape_model *model;
    const moment *from;
} ready;

static moment moments[MOST_SCENES]; /* made by the first who comes, before Check forks */

static void for_all(void (*visit)(const ready *s, const drape_integrator_ops *row))
{
    static char names[MOST_SCENES][64];
    char folder[900];
    const char *source = getenv("DRAPE_SOURCE");
    snprintf(folder, sizeof folder, "%.800s/examples/scenes", source ? source : ".");
    const int count = list_scenes(folder, names);
    for (int i = 0; i < count; i += EVERY) {
        drape_context *ctx = NULL;
        REQUIRE(!drape_context_create(NULL, &ctx), "no context");
        drape_model *model = compile(ctx, names[i]);
        if (!moments[i].x)
            moments[i] = prepare(names[i], model);
        const ready s = {names[i], model, &moments[i]};
        for (int k = 0; drape_integrators[k]; k++)
            visit(&s, drape_integrators[k]);
        drape_model_destroy(&model);
        drape_context_destroy(&ctx);
    }
}

static void fill(const ready *s, const drape_integrator_ops *row)
{
    driven d;
    REQUIRE(table_count < MOST_SCENES * MOST_ROWS, "more than %d rows", MOST_ROWS);
    start(&d, s->model, s->from, row, 1, false);
    go_on(&d);
    table[table_count++] = finish(&d, s->scene, row->entry.name);
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
            "# Bits of the states of the example scenes, %d attempts after their moment: scene, integrator, "
            "status, hash; "
            "by tools/hashes.\n"
            "build: %s\n",
            ATTEMPTS, build);
    for (int i = 0; i < table_count; i++)
        fprintf(file, "%s %s %s %016" PRIx64 "\n", table[i].scene, table[i].integrator,
                drape_status_name(table[i].status), table[i].hash);
    return fclose(file) != 0;
}

/* How many lines are not as here; the first of them is told. same_build: that of the file is this one, else 0
 * is returned. */
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
        if (EVERY > 1 && !g)
            continue;
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
    const ready *s;
    const drape_integrator_ops *row;
    golden plain, restored;
} pair;

/* Two sims in turns, attempt by attempt, with two threads and with three, one of which is another one after
 * its first attempt. */
static void *drive_two(void *user)
{
    pair *p = user;
    const ready *s = p->s;
    driven plain, restored;
    start(&plain, s->model, s->from, p->row, 2, true);
    start(&restored, s->model, s->from, p->row, 3, true);
    bool more = go_on(&restored);
    if (more)
        save_and_restore(&restored, s->model, s->from, p->row, 1);
    for (bool other = true; more || other;) {
        other = go_on(&plain);
        more = more && go_on(&restored);
    }
    p->plain = finish(&plain, s->scene, p->row->entry.name);
    p->restored = finish(&restored, s->scene, p->row->entry.name);
    return NULL;
}

static void check_same(const golden *g, const golden *expected, const char *what)
{
    ck_assert_msg(g->hash == expected->hash && g->status == expected->status,
                  "%s, %s, %s: %s %016" PRIx64 ", expected %s %016" PRIx64, g->scene, g->integrator, what,
                  drape_status_name(g->status), g->hash, drape_status_name(expected->status), expected->hash);
}

static void compare_at_once(const ready *s, const drape_integrator_ops *row)
{
    pthread_t thread;
    driven beside;
    pair p = {.s = s, .row = row};
    const golden *expected = find(s->scene, row->entry.name);
    ck_assert_ptr_nonnull(expected);
    ck_assert_int_eq(pthread_create(&thread, NULL, drive_two, &p), 0);
    start(&beside, s->model, s->from, row, 1, false);
    go_on(&beside);
    ck_assert_int_eq(pthread_join(thread, NULL), 0);
    const golden alone = finish(&beside, s->scene, row->entry.name);
    check_same(&p.plain, expected, "two threads, stopped at each attempt");
    check_same(&p.restored, expected, "three threads, saved, and restored with one");
    check_same(&alone, expected, "while others run");
}

START_TEST(sims_at_once_have_the_same_bits)
{
    for_all(compare_at_once);
}
END_TEST

/* What a scene has, acts at its moment: colliders in each scene that has some, friction and layers in
 * some. */
static int scenes_pushed, scenes_layered, scenes_rubbed;

static void count_what_acts(const ready *s, const drape_integrator_ops *row)
{
    if (row != drape_integrators[0])
        return;
    printf("# %s at %.3g s, %d nodes:%s%s%s\n", s->scene, s->from->t, (int)drape_model_node_count(s->model),
           s->from->collider ? " collider" : "", s->from->self ? " layers" : "",
           s->from->friction ? " friction" : "");
    const bool later = SHARE * drape_model_duration(s->model) > LONGEST; /* than what there is time for */
    ck_assert_msg(s->from->collider || later || drape_model_collider_count(s->model) == 0,
                  "%s: no collider touches the cloth", s->scene);
    scenes_pushed += s->from->collider;
    scenes_layered += s->from->self;
    scenes_rubbed += s->from->friction;
}

START_TEST(contact_acts)
{
    for_all(count_what_acts);
    ck_assert_int_ge(scenes_pushed, 7 / EVERY);
    ck_assert_int_ge(scenes_layered, 3 / EVERY);
    ck_assert_int_ge(scenes_rubbed, 6 / EVERY);
}
END_TEST

/* The table is made before Check forks, and once. */
int main(void)
{
    const TTest *const tests[] = {contact_acts, another_process_had_the_same_bits,
                                  sims_at_once_have_the_same_bits};
    const char *path = getenv("DRAPE_HASHES");
    for_all(fill);
    return path ? write_table(path) : run_suite("hashes", tests, sizeof tests / sizeof *tests);
}
