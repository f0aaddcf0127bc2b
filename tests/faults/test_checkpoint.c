/*
 * test_checkpoint.c: checkpoints that are truncated, damaged, of another scene, or written without disk
 * space, memory or a folder: each is refused with one line, and the sim continues as if nothing had happened.
 */
#include <errno.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/checksum.h"
#include "support/bytes.h"
#include "support/failing_allocator.h"
#include "support/scene.h"

#define MIDDLE 0.05
#define END    0.1

#define SHEET                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': %d, 'edge_length': 0.1},"              \
    " 'material': {'young_modulus': %g, 'thickness': 1e-3, 'density': 200},"                                 \
    " 'terms': ['stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 1e-3}],"                 \
    " 'pins': [{'corner': 'top-left'}]}],"                                                                   \
    " 'colliders': [{'type': 'sphere', 'center': [0.1,-0.12,-0.1], 'radius': 0.1, 'friction': 0.2}],"        \
    " 'self_contact': {'thickness': 0.01}, 'contact': {'friction': 'lagged'},"                               \
    " 'integrator': {'method': '%s', 'dt': %g%s}, 'controller': {'type': '%s'}, 'duration': 1,"              \
    " 'frame_rate': %d}"

static scene open_sheet(const char *integrator, const char *settings)
{
    return scene_open(SHEET, 2, 1e5, integrator, 0.01, settings, "halving", 60);
}

/* A sim in the middle of a run, which a refused restore must not change. */
typedef struct victim {
    scene s;
    bytes good;      /* a valid checkpoint of a sim like it, at MIDDLE */
    uint64_t before; /* hash of the state of s */
} victim;

static victim make_victim(const char *integrator, const char *settings)
{
    victim v = {.s = open_sheet(integrator, settings)};
    scene_advance(&v.s, MIDDLE);
    v.good = bytes_save(v.s.sim);
    drape_sim_destroy(&v.s.sim);
    scene_start(&v.s, NULL);
    scene_advance(&v.s, 0.02);
    v.before = drape_sim_hash(v.s.sim);
    return v;
}

static void refused(victim *v, drape_status status, const char *what)
{
    const char *message = drape_context_message(v->s.ctx);
    ck_assert_msg(status < 0, "%s: not refused", what);
    ck_assert_msg(*message && !strchr(message, '\n'), "%s: %s", what, message);
    ck_assert_msg(drape_sim_hash(v->s.sim) == v->before, "%s: the sim changed", what);
}

/* After all refusals it advances as an untouched sim does, and restores from the valid checkpoint. */
static void close_victim(victim *v, const char *integrator, const char *settings)
{
    scene other = open_sheet(integrator, settings);
    scene_advance(&other, 0.02);
    scene_advance(&other, END);
    scene_advance(&v->s, END);
    ck_assert_uint_eq(drape_sim_hash(v->s.sim), drape_sim_hash(other.sim));
    ck_assert_int_eq(drape_sim_restore_from(v->s.sim, v->good.data, v->good.size), DRAPE_OK);
    scene_advance(&v->s, END);
    scene_close(&other);
    other = open_sheet(integrator, settings);
    scene_advance(&other, MIDDLE);
    scene_advance(&other, END);
    ck_assert_uint_eq(drape_sim_hash(v->s.sim), drape_sim_hash(other.sim));
    scene_close(&other);
    scene_close(&v->s);
    free(v->good.data);
}

/* ---- Damage ---- */

TEST(cut_anywhere_it_is_refused)
{
    victim v = make_victim("be", "");
    for (size_t size = 0; size < v.good.size; size++) {
        drape_status status = drape_sim_restore_from(v.s.sim, v.good.data, size);
        ck_assert_int_eq(status, DRAPE_E_PARSE);
        refused(&v, status, "cut");
    }
    printf("# cut at each of %zu bytes\n", v.good.size);
    close_victim(&v, "be", "");
}

/* The checksum detects any changed byte: each is tried with one bit flipped. */
TEST(a_flipped_bit_is_refused)
{
    victim v = make_victim("bdf2", "");
    for (size_t at = 0; at < v.good.size; at++) {
        v.good.data[at] ^= (unsigned char)(1u << at * 5 % 8);
        drape_status status = drape_sim_restore_from(v.s.sim, v.good.data, v.good.size);
        ck_assert_int_eq(status, DRAPE_E_PARSE);
        refused(&v, status, "flipped");
        v.good.data[at] ^= (unsigned char)(1u << at * 5 % 8);
    }
    printf("# a bit flipped in each of %zu bytes\n", v.good.size);
    close_victim(&v, "bdf2", "");
}

TEST(bytes_behind_the_end_are_refused)
{
    victim v = make_victim("be", "");
    unsigned char *more = malloc(2 * v.good.size);
    memcpy(more, v.good.data, v.good.size);
    memcpy(more + v.good.size, v.good.data, v.good.size);
    refused(&v, drape_sim_restore_from(v.s.sim, more, v.good.size + 1), "one more");
    refused(&v, drape_sim_restore_from(v.s.sim, more, 2 * v.good.size), "twice");
    refused(&v, drape_sim_restore_from(v.s.sim, "", 0), "nothing");
    refused(&v, drape_sim_restore_from(v.s.sim, NULL, 100), "NULL");
    free(more);
    close_victim(&v, "be", "");
}

static void seal(unsigned char *data, size_t size)
{
    uint64_t sum = drape_checksum_bytes(0, data, size - sizeof sum);
    memcpy(data + size - sizeof sum, &sum, sizeof sum);
}

static drape_status stop_soon(void *user, const drape_event *event)
{
    int *left = user;
    (void)event;
    return --*left < 0 ? DRAPE_E_STOPPED : DRAPE_OK;
}

/* Changed bytes under a valid checksum, as no disk but a person might make them. Nothing crashes, and a
 * refused checkpoint changes nothing. */
static void forge(const char *integrator, const char *settings, uint64_t seed)
{
    victim v = make_victim(integrator, settings);
    unsigned char *copy = malloc(v.good.size);
    int refusals = 0, tries = 400;
    for (int k = 0; k < tries; k++) {
        memcpy(copy, v.good.data, v.good.size);
        for (int i = 0; i < 1 + k % 3; i++) {
            seed = seed * UINT64_C(6364136223846793005) + 1442695040888963407u;
            size_t at = 12 + (seed >> 33) % (v.good.size - 28);
            static const unsigned char values[] = {0, 0xff, 0x7f, 0x80, 1};
            memset(copy + at, values[(seed >> 20) % 5],
                   (size_t)(1 + (seed >> 24) % 8) < v.good.size - 16 - at ? 1 + (seed >> 24) % 8 : 1);
        }
        seal(copy, v.good.size);
        scoped_sim *sim = NULL;
        int left = 3;
        ck_assert_int_eq(drape_sim_create(v.s.ctx, v.s.model, NULL, &sim), DRAPE_OK);
        ck_assert_int_eq(drape_sim_observe(sim, stop_soon, &left), DRAPE_OK);
        uint64_t before = drape_sim_hash(sim);
        if (drape_sim_restore_from(sim, copy, v.good.size)) {
            ck_assert_uint_eq(drape_sim_hash(sim), before);
            refusals++;
        } else
            drape_sim_advance(sim, END);
    }
    printf("# %s%s: %d of %d forged ones refused\n", integrator, settings, refusals, tries);
    free(copy);
    close_victim(&v, integrator, settings);
}

TEST(forged_ones_crash_nothing)
{
    for (size_t i = 0; drape_integrators[i]; i++)
        if (!drape_integrators[i]->steady_state)
            forge(drape_integrators[i]->entry.name, "", i + 1);
    forge("be", ", 'linear_solver': 'klu'", 99);
}

/* ---- Of another scene ---- */

static void other_is_refused(victim *v, scene other, drape_status expected, const char *word)
{
    drape_status status = drape_sim_restore_from(other.sim, v->good.data, v->good.size);
    const char *message = drape_context_message(other.ctx);
    ck_assert_msg(status == expected, "%s: %d", word, (int)status);
    ck_assert_msg(strstr(message, word) && !strchr(message, '\n'), "%s: %s", word, message);
    ck_assert(drape_sim_time(other.sim) == 0);
    scene_advance(&other, 0.03);
    scene_close(&other);
}

TEST(of_another_model_or_choice_it_is_refused)
{
    victim v = make_victim("be", "");
    const drape_status wrong = DRAPE_E_ARGUMENT;
    other_is_refused(&v, scene_open(SHEET, 3, 1e5, "be", 0.01, "", "halving", 60), wrong, "number of nodes");
    other_is_refused(&v, scene_open(SHEET, 2, 1.001e5, "be", 0.01, "", "halving", 60), wrong,
                     "another model");
    other_is_refused(&v, scene_open(SHEET, 2, 1e5, "bdf2", 0.01, "", "halving", 60), wrong,
                     "integrator \"be\"");
    other_is_refused(&v, scene_open(SHEET, 2, 1e5, "be", 0.011, "", "halving", 60), wrong, "other settings");
    other_is_refused(&v, scene_open(SHEET, 2, 1e5, "be", 0.01, ", 'tolerance': 1e-5", "halving", 60), wrong,
                     "other settings");
    other_is_refused(&v, scene_open(SHEET, 2, 1e5, "be", 0.01, "", "fixed", 60), wrong,
                     "controller \"halving\"");
    other_is_refused(&v, scene_open(SHEET, 2, 1e5, "be", 0.01, "", "halving", 61), wrong, "other settings");
    close_victim(&v, "be", "");
}

static size_t find(const bytes *b, const char *text)
{
    size_t length = strlen(text), at = 0;
    while (at + length <= b->size && memcmp(b->data + at, text, length) != 0)
        at++;
    ck_assert_uint_lt(at + length, b->size);
    return at;
}

TEST(of_another_version_or_build_it_is_refused)
{
    victim v = make_victim("be", "");
    size_t version = find(&v.good, "Drape ") + 6, arithmetic = find(&v.good, "arithmetic ") + 11,
           solvers = find(&v.good, " klu") + 1, format = 8;
    const size_t places[] = {version, arithmetic, solvers, format};
    for (int i = 0; i < 4; i++) {
        v.good.data[places[i]]++;
        seal(v.good.data, v.good.size);
        drape_status status = drape_sim_restore_from(v.s.sim, v.good.data, v.good.size);
        ck_assert_int_eq(status, DRAPE_E_VERSION);
        refused(&v, status, "another version");
        ck_assert_msg(strstr(drape_context_message(v.s.ctx), i < 3 ? "another build" : "format 3"), "%s",
                      drape_context_message(v.s.ctx));
        v.good.data[places[i]]--;
        seal(v.good.data, v.good.size);
    }
    close_victim(&v, "be", "");
}

/* ---- Memory ---- */

/* Each allocation of restoring, and of saving to a file, fails once. */
TEST(without_memory_it_is_as_before)
{
    const char *const settings = ", 'linear_solver': 'pcg'";
    char path[] = "/tmp/drape-memory-XXXXXX";
    int fd = mkstemp(path);
    ck_assert_int_ge(fd, 0);
    close(fd);
    victim v = make_victim("be", settings);
    long restores = 0, saves = 0;
    for (long n = 1, done = 0; !done; n++) {
        failing_allocator memory = {0};
        drape_context *ctx = failing_context(&memory);
        drape_sim *sim = NULL;
        ck_assert_int_eq(drape_sim_create(ctx, v.s.model, NULL, &sim), DRAPE_OK);
        ck_assert_int_eq(drape_sim_advance(sim, 0.02), DRAPE_OK);
        uint64_t before = drape_sim_hash(sim);
        memory.fail_at = memory.calls + n;
        drape_status saved = drape_sim_save(sim, path);
        ck_assert(saved == DRAPE_OK || saved == DRAPE_E_MEMORY);
        saves += saved != DRAPE_OK;
        memory.fail_at = memory.calls + n;
        drape_status status = drape_sim_restore_from(sim, v.good.data, v.good.size);
        done = status == DRAPE_OK;
        restores += !done;
        memory.fail_at = 0;
        ck_assert_msg(done || (status == DRAPE_E_MEMORY && drape_sim_hash(sim) == before),
                      "allocation %ld: %d, %s", n, (int)status, drape_context_message(ctx));
        ck_assert_int_eq(drape_sim_advance(sim, END), DRAPE_OK);
        drape_sim_destroy(&sim);
        drape_context_destroy(&ctx);
        ck_assert_int_eq(memory.live, 0);
    }
    printf("# %ld allocations of a restoration failed, %ld of a save\n", restores, saves);
    ck_assert_int_gt(restores, 50);
    ck_assert_int_ge(saves, 1);
    unlink(path);
    close_victim(&v, "be", settings);
}

/* ---- Disks ---- */

static off_t size_of(const char *path)
{
    struct stat info;
    return stat(path, &info) ? -1 : info.st_size;
}

/* Limits files to this many bytes: a write is short, then the next one fails. */
static drape_status save_within(drape_sim *sim, const char *path, rlim_t most)
{
    struct rlimit old;
    getrlimit(RLIMIT_FSIZE, &old);
    setrlimit(RLIMIT_FSIZE, &(struct rlimit){most, old.rlim_max});
    drape_status status = drape_sim_save(sim, path);
    setrlimit(RLIMIT_FSIZE, &old);
    return status;
}

TEST(a_full_disk_leaves_the_one_before)
{
    char folder[] = "/tmp/drape-full-XXXXXX", path[64], part[80];
    ck_assert_ptr_nonnull(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/checkpoint", folder);
    snprintf(part, sizeof part, "%s.part", path);
    signal(SIGXFSZ, SIG_IGN);
    victim v = make_victim("be", "");
    ck_assert_int_eq(drape_sim_save(v.s.sim, path), DRAPE_OK);
    off_t whole = size_of(path);
    scene_advance(&v.s, 0.03);
    v.before = drape_sim_hash(v.s.sim);
    long tries = 0;
    for (rlim_t most = 0; most < (rlim_t)whole; most += 97, tries++) {
        drape_status status = save_within(v.s.sim, path, most);
        ck_assert_int_eq(status, DRAPE_E_FILE);
        refused(&v, status, "a full disk");
        ck_assert_int_eq(size_of(path), whole);
        ck_assert_int_eq(size_of(part), -1);
    }
    printf("# %ld disks full between 0 and %lld bytes\n", tries, (long long)whole);
    scene other = open_sheet("be", "");
    ck_assert_int_eq(drape_sim_restore(other.sim, path), DRAPE_OK); /* the previous one */
    ck_assert(drape_sim_time(other.sim) == 0.02);
    ck_assert_int_eq(drape_sim_save(v.s.sim, path), DRAPE_OK);
    ck_assert_int_eq(drape_sim_restore(other.sim, path), DRAPE_OK);
    ck_assert(drape_sim_time(other.sim) == drape_sim_time(v.s.sim));
    unlink(path);
    rmdir(folder);
    scene_close(&other);
    close_victim(&v, "be", "");
}

TEST(no_folder_no_file_no_right)
{
    victim v = make_victim("be", "");
    refused(&v, drape_sim_save(v.s.sim, "/no/such/folder/checkpoint"), "no folder");
    refused(&v, drape_sim_save(v.s.sim, "/proc/checkpoint"), "no right");
    refused(&v, drape_sim_save(v.s.sim, "/dev/full"), "no room");
    refused(&v, drape_sim_save(v.s.sim, "/tmp"), "a folder");
    refused(&v, drape_sim_save(v.s.sim, ""), "no name");
    refused(&v, drape_sim_save(v.s.sim, NULL), "NULL");
    refused(&v, drape_sim_restore(v.s.sim, "/no/such/folder/checkpoint"), "no file");
    refused(&v, drape_sim_restore(v.s.sim, "/tmp"), "a folder");
    refused(&v, drape_sim_restore(v.s.sim, "/dev/null"), "a device");
    refused(&v, drape_sim_restore(v.s.sim, "/proc/self/stat"), "another file");
    ck_assert_int_eq(drape_sim_save(NULL, "x"), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(drape_sim_restore(NULL, "x"), DRAPE_E_ARGUMENT);
    close_victim(&v, "be", "");
}

/* A host that cannot store the bytes refuses, at each of its calls in turn. */
typedef struct picky {
    long calls, fail_at;
} picky;

static drape_status refuse_bytes(void *user, const void *data, size_t size)
{
    picky *p = user;
    (void)data, (void)size;
    return ++p->calls == p->fail_at ? DRAPE_E_STOPPED : DRAPE_OK;
}

TEST(a_writer_that_fails_is_believed)
{
    victim v = make_victim("be", "");
    picky counter = {0};
    ck_assert_int_eq(drape_sim_save_to(v.s.sim, refuse_bytes, &counter), DRAPE_OK);
    for (long n = 1; n <= counter.calls; n++) {
        picky one = {.fail_at = n};
        ck_assert_int_eq(drape_sim_save_to(v.s.sim, refuse_bytes, &one), DRAPE_E_STOPPED);
        ck_assert_int_eq(one.calls, n);
        ck_assert_uint_eq(drape_sim_hash(v.s.sim), v.before);
    }
    ck_assert_int_eq(drape_sim_save_to(v.s.sim, NULL, NULL), DRAPE_E_ARGUMENT);
    close_victim(&v, "be", "");
}
