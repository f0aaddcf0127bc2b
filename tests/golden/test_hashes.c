/*
 * test_hashes.c: every example scene, and those beside this file, with every integrator, for three
 * attempts. The bits of the state must be
 * those of hashes.txt, on every processor and with every build of the same libraries, and the same with other
 * numbers of threads, in a sim that is stopped at each attempt or saved and restored between two, and beside
 * other sims on the same thread and on another one.
 *
 * Meshes are made coarser, so that there is time for contact: if a scene has colliders or self-contact, the
 * attempts start from the state that `be` reaches after most of its duration, and the test checks that
 * there is contact in it. With a sanitizer, which makes all ten times slower, every other scene is left out.
 * The slow scenes, and half of the pairs of a scene and an integrator, are left to the suite `long`.
 * DRAPE_SCENES=A,B takes these, for a processor that is emulated.
 *
 * hashes.txt names the versions of the libraries with which it was written; with others, whose results may
 * have other bits, the comparison is skipped. `tools/hashes` writes the file: with DRAPE_HASHES=FILE this
 * program writes its own hashes there and tests nothing.
 */
#include <dirent.h>
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
#include "support/sample.h"
#include "support/suite.h"

#define ATTEMPTS     3
#define FRAMES       2   /* length of the advance, which may take fewer attempts */
#define SHARE        0.7 /* of the duration, before the attempts */
#define LONGEST      2.0 /* [s] upper bound of that time */
#define MAX_SCENES   64
#define MAX_METHODS  32
#define MAX_PREPARED 1000 /* nodes of a scene that is advanced first: CS184 scenes keep their size */
#define MAX_NODES    200  /* of larger grids every other node is used, and again */
#define LINE         512

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define EVERY 2
#else
#define EVERY 1
#endif

static const char *chosen; /* names of scenes between commas; NULL: all, or all but the slow ones */
static bool complete;      /* all of them, to be written to the file or for the suite `long` */

typedef struct golden {
    char scene[64];
    const char *integrator;
    drape_status status;
    uint64_t hash;
} golden;

static golden table[MAX_SCENES * MAX_METHODS];
static int table_count;

/* Check must not be called outside of tests, nor on another thread. */
#define REQUIRE(good, ...)                                                                                   \
    do {                                                                                                     \
        if (!(good)) {                                                                                       \
            fprintf(stderr, __VA_ARGS__);                                                                    \
            fputc('\n', stderr);                                                                             \
            exit(1);                                                                                         \
        }                                                                                                    \
    } while (0)

/* ---- Scenes ---- */

static int compare_names(const void *a, const void *b)
{
    return strcmp(a, b);
}

/* Where scenes are: those that users see, and those that have what these lack. */
static const char *const folders[] = {"examples/scenes", "tests/golden"};

static void path_of(const char *folder, const char *name, const char *ending, char path[1024])
{
    const char *source = getenv("DRAPE_SOURCE");
    snprintf(path, 1024, "%.800s/%s%s%.60s%s", source ? source : ".", folder, *name ? "/" : "", name, ending);
}

/* Adds the names of the scenes in a folder to those that there are. */
static int list_scenes(const char *folder, int count, char names[][64])
{
    char path[1024];
    path_of(folder, "", "", path);
    DIR *dir = opendir(path);
    REQUIRE(dir, "there is no %s", path);
    for (struct dirent *entry = readdir(dir); entry; entry = readdir(dir)) {
        const size_t length = strlen(entry->d_name);
        if (length < 6 || length > 60 || strcmp(entry->d_name + length - 5, ".json") != 0)
            continue;
        REQUIRE(count < MAX_SCENES, "more than %d scenes", MAX_SCENES);
        memcpy(names[count], entry->d_name, length - 5);
        names[count++][length - 5] = 0;
    }
    closedir(dir);
    qsort(names, (size_t)count, sizeof *names, compare_names);
    return count;
}

/* Scenes that take half of the time of all and have the forces of others; the suite `long` has them. */
static const char slow[] = "dress,twisted_cylinder";

/* Whether a scene is one of the names between commas. */
static bool is_in(const char *names, const char *scene)
{
    const size_t length = strlen(scene);
    for (const char *at = names; at; at = strchr(at, ','), at = at ? at + 1 : NULL)
        if (strncmp(at, scene, length) == 0 && (at[length] == 0 || at[length] == ','))
            return true;
    return false;
}

static bool is_chosen(const char *scene)
{
    return chosen ? is_in(chosen, scene) : complete || !is_in(slow, scene);
}

/* Sets "/cloth/0/mesh/columns", or the key given, to every other of `nodes`. */
static drape_status halve(drape_scene *scene, int32_t cloth, const char *key, int32_t nodes)
{
    char pointer[64], text[16];
    snprintf(pointer, sizeof pointer, "/cloth/%d/mesh/%s", (int)cloth, key);
    snprintf(text, sizeof text, "%d", (int)(nodes + 1) / 2);
    return drape_scene_set(scene, pointer, text);
}

/* Makes the grids with more than MAX_NODES nodes coarser, once; returns whether there were any. Equilateral
 * grids, which are in no scene with contact, keep their size. */
static bool make_coarser(drape_scene *scene, const drape_model *model)
{
    bool any = false;
    for (int32_t c = 0; c < model->cloth_count; c++) {
        const drape_cloth *cloth = &model->cloths[c];
        if (cloth->mesh.node_count <= MAX_NODES || strcmp(cloth->grid.type, "square") != 0)
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
    scoped_parsed *scene = NULL;
    drape_model *model = NULL;
    path_of(folders[0], name, ".json", path);
    if (access(path, R_OK) != 0)
        path_of(folders[1], name, ".json", path);
    drape_status status = drape_scene_load(ctx, path, &scene);
    for (int32_t before = INT32_MAX, now = 0; now < before;) { /* a scene of another form keeps its size */
        before = now > 0 ? now : before;
        drape_model_destroy(&model);
        status = status ? status : drape_scene_compile(scene, &model);
        REQUIRE(!status, "%s: %s", name, drape_context_message(ctx));
        now = make_coarser(scene, model) ? drape_model_node_count(model) : before;
    }
    return model;
}

/* ---- The state before the attempts ---- */

/* A state in the middle of a scene that has contact, reached by `be` with one thread, and so with the same
 * bits each time; in other scenes the beginning. */
typedef struct moment {
    double t;
    double *x, *v;
    bool collider, self, friction; /* which contact forces act */
} moment;

/* Runs the model; copies of it may lack colliders or self-contact and share its arrays. */
static drape_sim *sim_of(drape_context *ctx, const drape_model *model)
{
    drape_sim *sim = NULL;
    drape_sim_def def = sim_def();
    def.integrator = "be";
    REQUIRE(!drape_sim_create(ctx, model, &def, &sim), "%s", drape_context_message(ctx));
    return sim;
}

/* The contact forces (node_count x 3) of the model at a moment; returns the sum of their squares. */
static double push(drape_context *ctx, const drape_model *model, const moment *m, bool friction,
                   double *forces)
{
    double sum = 0;
    scoped_sim *sim = sim_of(ctx, model);
    REQUIRE(!drape_sim_set_state(sim, m->t, m->x, m->v), "%s", drape_context_message(ctx));
    const drape_state *now = drape_sim_state(sim);
    const drape_point point = {
        .x = now->x, .v = now->v, .internal = now->internal, .t = now->t, .span = {now->t, now->t}};
    REQUIRE(!drape_system_begin(sim->system, now), "%s", drape_context_message(ctx));
    drape_system_contact_part(sim->system, &point, friction, forces, NULL);
    for (size_t i = 0; i < 3 * (size_t)model->node_count; i++)
        sum += forces[i] * forces[i];
    return sum;
}

static void find_contact(drape_context *ctx, const drape_model *model, moment *m)
{
    const size_t n = 3 * (size_t)model->node_count;
    scoped_memory double *with = calloc(n, sizeof *with), *without = calloc(n, sizeof *without);
    drape_model colliders = *model, self = *model;
    colliders.contact.self = false;
    self.collider_count = 0;
    REQUIRE(with && without, "no memory");
    m->collider = model->collider_count > 0 && push(ctx, &colliders, m, false, with) > 0;
    m->self = model->contact.self && push(ctx, &self, m, false, with) > 0;
    push(ctx, model, m, true, with);
    push(ctx, model, m, false, without);
    m->friction = memcmp(with, without, n * sizeof *with) != 0;
}

static moment prepare(const char *scene, const drape_model *model)
{
    const size_t n = 3 * (size_t)drape_model_node_count(model);
    moment m = {.x = malloc(n * sizeof *m.x), .v = malloc(n * sizeof *m.v)};
    scoped_context *ctx = NULL;
    REQUIRE(m.x && m.v && !drape_context_create(NULL, &ctx), "no memory");
    drape_sim *sim = sim_of(ctx, model);
    const bool meets = drape_model_node_count(model) <= MAX_PREPARED &&
                       (drape_model_collider_count(model) > 0 || model->contact.self);
    REQUIRE(!meets || !drape_sim_advance(sim, fmin(SHARE * drape_model_duration(model), LONGEST)), "%s: %s",
            scene, drape_context_message(ctx));
    m.t = drape_sim_time(sim);
    memcpy(m.x, drape_sim_positions(sim), n * sizeof *m.x);
    memcpy(m.v, drape_sim_velocities(sim), n * sizeof *m.v);
    drape_sim_destroy(&sim);
    if (meets)
        find_contact(ctx, model, &m);
    return m;
}

/* ---- A sim that stops after each attempt, or after the last one ---- */

typedef struct driven {
    drape_context *ctx;
    drape_sim *sim;
    double end;
    int left;  /* attempts left */
    bool each; /* stop after each attempt */
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

/* d must stay at its address. */
static void start(driven *d, const drape_model *model, const moment *from, const drape_integrator_ops *method,
                  int threads, bool each)
{
    /* Statics ends after some steps of its flow: cloth that falls freely or flutters has no equilibrium. */
    static const drape_setting some[] = {{.name = "max_pseudo_steps", .number = 8},
                                         {.name = "on_failure", .text = "accept"}};
    drape_sim_def def = sim_def();
    *d = (driven){.left = ATTEMPTS, .each = each, .end = from->t + FRAMES / drape_model_frame_rate(model)};
    REQUIRE(!drape_context_create(NULL, &d->ctx), "no context");
    def.integrator = method->entry.name;
    def.threads = threads;
    def.integrator_settings = some;
    def.integrator_setting_count = method->steady_state ? sizeof some / sizeof *some : 0;
    d->status = drape_sim_create(d->ctx, model, &def, &d->sim);
    REQUIRE(d->status || (!drape_sim_set_state(d->sim, from->t, from->x, from->v) &&
                          !drape_sim_observe(d->sim, look, d)),
            "%s", drape_context_message(d->ctx));
}

/* Advances to the next stop; returns whether there may be another one. */
static bool advance_to_stop(driven *d)
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

/* Replaces the sim by another one, restored from its checkpoint. */
static void save_and_restore(driven *d, const drape_model *model, const moment *from,
                             const drape_integrator_ops *method, int threads)
{
    const int left = d->left;
    scoped_bytes b = bytes_save(d->sim);
    drape_sim_destroy(&d->sim);
    drape_context_destroy(&d->ctx);
    start(d, model, from, method, threads, d->each);
    d->left = left;
    d->status = drape_sim_restore_from(d->sim, b.data, b.size);
    REQUIRE(!d->status, "%s", drape_context_message(d->ctx));
}

/* ---- All scenes and integrators ---- */

/* A scene that is prepared: its name, its model, and the state before its attempts. */
typedef struct ready {
    const char *scene;
    const drape_model *model;
    const moment *from;
    bool tabled, sampled; /* with the integrator that it is visited with: in the table; with other threads */
} ready;

static moment moments[MAX_SCENES]; /* made by the first call of for_all, before Check forks */

static void for_all(void (*visit)(const ready *s, const drape_integrator_ops *method))
{
    static char names[MAX_SCENES][64];
    int count = 0;
    for (size_t f = 0; f < sizeof folders / sizeof *folders; f++)
        count = list_scenes(folders[f], count, names);
    for (int i = 0; i < count; i += EVERY) {
        scoped_context *ctx = NULL;
        if (!is_chosen(names[i]))
            continue;
        REQUIRE(!drape_context_create(NULL, &ctx), "no context");
        scoped_model *model = compile(ctx, names[i]);
        if (!moments[i].x)
            moments[i] = prepare(names[i], model);
        for (int k = 0; drape_integrators[k]; k++) {
            const size_t row = (size_t)(i / EVERY), column = (size_t)k;
            const ready s = {names[i], model, &moments[i], chosen || complete || in_sample(row, column, 2),
                             in_sample(row, column, 8)};
            visit(&s, drape_integrators[k]);
        }
    }
}

static void fill(const ready *s, const drape_integrator_ops *method)
{
    driven d;
    if (!s->tabled)
        return;
    REQUIRE(table_count < MAX_SCENES * MAX_METHODS, "more than %d integrators", MAX_METHODS);
    start(&d, s->model, s->from, method, 1, false);
    advance_to_stop(&d);
    table[table_count++] = finish(&d, s->scene, method->entry.name);
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
    char libraries[LINE];
    FILE *file = fopen(path, "w");
    if (!file)
        return 1;
    drape_sim_describe_libraries(libraries, sizeof libraries);
    fprintf(file,
            "# Hashes of the states of the example scenes after %d attempts: scene, integrator, "
            "status, hash; "
            "by tools/hashes.\n"
            "libraries: %s\n",
            ATTEMPTS, libraries);
    for (int i = 0; i < table_count; i++)
        fprintf(file, "%s %s %s %016" PRIx64 "\n", table[i].scene, table[i].integrator,
                drape_status_name(table[i].status), table[i].hash);
    return fclose(file) != 0;
}

/* hashes.txt, after its first line; `libraries` receives the second one, "libraries: ..." of its writer. */
static FILE *open_table(char libraries[LINE])
{
    char path[1024];
    const char *source = getenv("DRAPE_SOURCE");
    snprintf(path, sizeof path, "%.800s/tests/golden/hashes.txt", source ? source : ".");
    FILE *file = fopen(path, "r");
    REQUIRE(file && fgets(libraries, LINE, file) && fgets(libraries, LINE, file), "%s cannot be read", path);
    libraries[strcspn(libraries, "\n")] = 0;
    return file;
}

/* NULL if the file was written with the libraries of this build; otherwise a reason that names both. */
static const char *other_libraries(void)
{
    static char reason[3 * LINE];
    char written[LINE], here[LINE], line[LINE + 16];
    fclose(open_table(written));
    drape_sim_describe_libraries(here, sizeof here);
    snprintf(line, sizeof line, "libraries: %s", here);
    if (strcmp(written, line) == 0)
        return NULL;
    snprintf(reason, sizeof reason, "hashes.txt is of %s; here are %s", written + strlen("libraries: "),
             here);
    return reason;
}

/* ---- The tests ---- */

TEST(the_file_has_the_same_bits)
{
    char line[LINE], scene[64], method[64], status[64];
    uint64_t hash;
    int lines = 0, wrong = 0;
    FILE *file = open_table(line);
    while (fgets(line, sizeof line, file)) {
        ck_assert_int_eq(sscanf(line, "%63s %63s %63s %" SCNx64, scene, method, status, &hash), 4);
        const golden *g = find(scene, method);
        if (!g && (EVERY > 1 || !complete))
            continue;
        lines++;
        if (g && g->hash == hash && strcmp(drape_status_name(g->status), status) == 0)
            continue;
        wrong++;
        printf("# %s %s: %s %016" PRIx64 " in the file, %s %016" PRIx64 " here\n", scene, method, status,
               hash, g ? drape_status_name(g->status) : "none", g ? g->hash : 0);
    }
    fclose(file);
    fflush(stdout); /* a failed assertion ends this process without it */
    ck_assert_msg(wrong == 0 && lines == table_count,
                  "%d of %d lines of hashes.txt differ, for %d runs; after an intended change of results run "
                  "tools/hashes",
                  wrong, lines, table_count);
}

typedef struct pair {
    const ready *s;
    const drape_integrator_ops *method;
    golden plain, restored;
} pair;

/* Two sims that advance in turns, attempt by attempt, with two and with three threads; the second one is
 * saved and restored after its first attempt. */
static void *drive_two(void *user)
{
    pair *p = user;
    const ready *s = p->s;
    driven plain, restored;
    start(&plain, s->model, s->from, p->method, 2, true);
    start(&restored, s->model, s->from, p->method, 3, true);
    bool more = advance_to_stop(&restored);
    if (more)
        save_and_restore(&restored, s->model, s->from, p->method, 1);
    for (bool other = true; more || other;) {
        other = advance_to_stop(&plain);
        more = more && advance_to_stop(&restored);
    }
    p->plain = finish(&plain, s->scene, p->method->entry.name);
    p->restored = finish(&restored, s->scene, p->method->entry.name);
    return NULL;
}

static void check_same(const golden *g, const golden *expected, const char *what)
{
    ck_assert_msg(g->hash == expected->hash && g->status == expected->status,
                  "%s, %s, %s: %s %016" PRIx64 ", expected %s %016" PRIx64, g->scene, g->integrator, what,
                  drape_status_name(g->status), g->hash, drape_status_name(expected->status), expected->hash);
}

static void compare_at_once(const ready *s, const drape_integrator_ops *method)
{
    if (!s->sampled)
        return;
    pthread_t thread;
    driven beside;
    pair p = {.s = s, .method = method};
    const golden *expected = find(s->scene, method->entry.name);
    ck_assert_ptr_nonnull(expected);
    ck_assert_int_eq(pthread_create(&thread, NULL, drive_two, &p), 0);
    start(&beside, s->model, s->from, method, 1, false);
    advance_to_stop(&beside);
    ck_assert_int_eq(pthread_join(thread, NULL), 0);
    const golden alone = finish(&beside, s->scene, method->entry.name);
    check_same(&p.plain, expected, "two threads, stopped at each attempt");
    check_same(&p.restored, expected, "three threads, saved, and restored with one");
    check_same(&alone, expected, "while others run");
}

TEST(sims_at_once_have_the_same_bits)
{
    for_all(compare_at_once);
}

/* The contact of a scene acts in the state before its attempts: colliders in each scene that has some,
 * friction and self-contact in some scenes. */
static int scenes_with_colliders, scenes_with_self_contact, scenes_with_friction;

static void count_contact(const ready *s, const drape_integrator_ops *method)
{
    if (method != drape_integrators[0])
        return;
    printf("# %s at %.3g s, %d nodes:%s%s%s\n", s->scene, s->from->t, (int)drape_model_node_count(s->model),
           s->from->collider ? " collider" : "", s->from->self ? " layers" : "",
           s->from->friction ? " friction" : "");
    const bool later = SHARE * drape_model_duration(s->model) >
                       LONGEST; /* its contact may begin later than the test has time for */
    ck_assert_msg(s->from->collider || later || drape_model_collider_count(s->model) == 0,
                  "%s: no collider touches the cloth", s->scene);
    scenes_with_colliders += s->from->collider;
    scenes_with_self_contact += s->from->self;
    scenes_with_friction += s->from->friction;
}

TEST(contact_acts)
{
    for_all(count_contact);
    ck_assert_int_ge(scenes_with_colliders, chosen ? 0 : 7 / EVERY);
    ck_assert_int_ge(scenes_with_self_contact, chosen ? 0 : 3 / EVERY);
    ck_assert_int_ge(scenes_with_friction, chosen ? 0 : 6 / EVERY);
}

/* The table is made once, before Check forks. */
BEFORE_TESTS
{
    const char *path = getenv("DRAPE_HASHES");
    chosen = getenv("DRAPE_SCENES");
    complete = path || complete_sweep();
    for_all(fill);
    REQUIRE(table_count > 0, "DRAPE_SCENES=%s: no such scene", chosen ? chosen : "");
    if (path)
        exit(write_table(path));
    suite_skip("the_file_has_the_same_bits", other_libraries());
}
