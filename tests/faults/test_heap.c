/*
 * test_heap.c: from the second step on a step makes no heap call, neither in Drape nor in KINSOL or KLU; a
 * linear solver that uses the heap during a step releases it. All heap calls of the process are counted:
 * malloc and its family are defined here and call those of glibc.
 */
#include <errno.h>
#include <malloc.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "io/recorder.h"
#include "solvers/linear.h"
#include "support/methods.h"
#include "support/scene.h"

#if defined(__SANITIZE_ADDRESS__) || !defined(__GLIBC__)
#define COUNTS_HEAP 0 /* a sanitizer replaces the heap */
#else
#define COUNTS_HEAP 1

void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *memory, size_t size);
void *__libc_memalign(size_t alignment, size_t size);
void __libc_free(void *memory);
#endif

static volatile bool counting;
static volatile long calls, live; /* live: allocations not yet freed */

#if COUNTS_HEAP
static void count_call(long pieces)
{
    if (!counting)
        return;
    __atomic_add_fetch(&calls, 1, __ATOMIC_RELAXED);
    __atomic_add_fetch(&live, pieces, __ATOMIC_RELAXED);
}

void *malloc(size_t size)
{
    count_call(1);
    return __libc_malloc(size);
}

void *calloc(size_t count, size_t size)
{
    count_call(1);
    return __libc_calloc(count, size);
}

void *realloc(void *memory, size_t size)
{
    count_call(memory ? 0 : 1);
    return __libc_realloc(memory, size);
}

void *aligned_alloc(size_t alignment, size_t size)
{
    count_call(1);
    return __libc_memalign(alignment, size);
}

void *memalign(size_t alignment, size_t size)
{
    count_call(1);
    return __libc_memalign(alignment, size);
}

int posix_memalign(void **memory, size_t alignment, size_t size)
{
    count_call(1);
    *memory = __libc_memalign(alignment, size);
    return *memory ? 0 : ENOMEM;
}

void free(void *memory)
{
    if (memory)
        count_call(-1);
    __libc_free(memory);
}
#endif

static scene open_scene(const char *integrator, bool damped)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 4, 'edge_length': 0.05},"
        " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
        " 'terms': ['stretch.edge', 'bend.hinge'%s],"
        " 'pins': [{'corner': 'top-left'}, {'nodes': [4], 'track': [[0, [0,0,0]], [1, [0,0.1,0]]]}]}],"
        " 'integrator': {'dt': 0.01, %s}, 'duration': 1}",
        damped ? ", {'type': 'damp.kelvin_voigt', 'beta': 1e-3}, {'type': 'drag.viscous', "
                 "'coefficient': 0.1}"
               : "",
        integrator);
}

/* Heap calls within steps 2 to 50. */
static long count_steps(scene *s)
{
    drape_status status = drape_sim_advance(s->sim, 0.01);
    ck_assert_int_eq(status, DRAPE_OK);
    calls = live = 0;
    for (int k = 2; k <= 50 && !status; k++) {
        counting = true;
        status = drape_sim_advance(s->sim, 0.01 * k);
        drape_sim_energy(s->sim);
        counting = false;
    }
    assert_ok(s->ctx, status);
    ck_assert_int_ge(drape_sim_statistics(s->sim).steps_accepted, 50);
    return calls;
}

TEST(the_counter_counts)
{
    calls = live = 0;
    counting = true;
    void *volatile memory = malloc(100);
    memory = realloc(memory, 100000);
    free(memory);
    memory = calloc(10, 10);
    free(memory);
    memory = aligned_alloc(64, 128);
    counting = false;
    ck_assert_int_eq(calls, COUNTS_HEAP ? 6 : 0);
    ck_assert_int_eq(live, COUNTS_HEAP ? 1 : 0);
    free(memory);
}

/* A solver that falls back to another one keeps the analysis and factors of that one from the first fallback
 * on: 37 allocations with multifrontal, once. One leaked allocation per factorization would be at least
 * 49. */
#define FALLBACK_PIECES 40

static void check_heap(const drape_linear_ops *linear, int i)
{
    static const char *const globals[] = {"none", "line_search", "work"};
    char integrator[160];
    bool damped = i % 2;
    snprintf(integrator, sizeof integrator, "'linear_solver': '%s', 'globalization': '%s'",
             linear->entry.name, globals[i / 2 % 3]);
    scoped_scene s = open_scene(integrator, damped);
    long n = count_steps(&s);
    ck_assert_msg(live <= (linear->borrows_heap ? FALLBACK_PIECES : 0), "%s: %ld pieces kept in 49 steps",
                  integrator, live);
    ck_assert_msg(n == 0 || linear->borrows_heap, "%s%s: %ld heap calls in 49 steps", integrator,
                  damped ? ", damped" : "", n);
    if (n > 0 && i == 0)
        printf("# %s: %ld heap calls in %lld factorisations\n", linear->entry.name, n,
               (long long)drape_sim_statistics(s.sim).factorizations);
}

TEST(no_heap_call_from_the_second_step_on)
{
    for (int k = 0; drape_linears[k]; k++)
        for (int i = 0; i < 6; i++)
            check_heap(drape_linears[k], i);
}

/* Explicit substeps with everything that moves nodes, and lists of near points that are rebuilt. */
TEST(no_heap_call_of_verlet)
{
    static const char *const forms[] = {"position", "velocity"};
    for (int i = 0; i < 4; i++) {
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 9, 'rows': 8, 'width': 0.8, "
            "'height': 0.7,"
            " 'transform': {'translate': [0, 0.3, 0]}},"
            " 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'areal_density': 0.2},"
            " 'terms': ['stretch.edge', {'type': 'drag.viscous', 'coefficient': 0.1}],"
            " 'pins': [{'corner': 'top-left', 'track': [[0, [0,0,0]], [1, [0,0.1,0]]]}]}],"
            " 'colliders': [{'type': 'sphere', 'center': [0.4,0,-0.3], 'radius': 0.2, 'friction': 0.3}],"
            " 'self_contact': {'thickness': 0.03},"
            " 'integrator': {'method': 'verlet', 'dt': 0.01, 'form': '%s', 'substeps': %d, 'strain_limit': "
            "0.1},"
            " 'controller': {'type': '%s'}, 'duration': 1}",
            forms[i & 1], i & 2 ? 0 : 20, i & 2 ? "halving" : "stable");
        ck_assert_int_eq(count_steps(&s), 0);
    }
}

/* Rejected steps make no heap calls either. */
TEST(no_heap_call_in_rejected_steps)
{
    scoped_scene s = open_scene("'max_iterations': 2, 'globalization': 'none'", true);
    long n = count_steps(&s);
    ck_assert_int_gt(drape_sim_statistics(s.sim).steps_rejected, 50);
    ck_assert_int_eq(n, 0);
}

/* With colliders: after the lists of contacts have grown, here in an earlier part of the run, nothing is
 * allocated. */
TEST(no_heap_call_in_contact)
{
    for (size_t k = 0; k < METHODS; k++) {
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 6, 'rows': 6, 'width': 0.3, "
            "'height': 0.3,"
            " 'transform': {'translate': [-0.14, 0.11, 0.16]}}, 'terms': ['stretch.edge', 'bend.hinge'],"
            " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}}],"
            " 'colliders': [{'type': 'sphere', 'center': [0,0,0], 'radius': 0.1, 'friction': 0.3}, {'type': "
            "'box',"
            " 'center': [0.1,-0.1,0], 'size': [0.1,0.3,0.1]}, {'type': 'plane', 'point': [0,-0.1,0], "
            "'normal':"
            " [0,1,0]}], 'contact': {'distance': 4e-3, 'friction': '%s'},"
            " 'integrator': {'method': '%s', 'dt': 0.01, 'linear_solver': 'klu'}, 'duration': 1}",
            k % 2 ? "lagged" : "implicit", methods[k]);
        const size_t n = 3 * (size_t)s.model->node_count;
        double *x = malloc(n * sizeof *x), *v = calloc(n, sizeof *v), gap;
        memcpy(x, drape_sim_positions(s.sim), n * sizeof *x);
        for (int fall = 0; fall < 2; fall++) { /* the second one begins with the stiffness of the first */
            scene_advance(&s, 0.15);
            ck_assert_int_gt(drape_contact_active(drape_system_contact(s.sim->system), &gap), 0);
            ck_assert_int_eq(drape_sim_set_state(s.sim, 0, x, v), DRAPE_OK);
        }
        calls = live = 0;
        counting = true;
        drape_status status = drape_sim_advance(s.sim, 0.15);
        counting = false;
        ck_assert_int_eq(status, DRAPE_OK);
        ck_assert_msg(calls == 0, "%s: %ld heap calls", methods[k], calls);
        free(x);
        free(v);
    }
}

/* Frames, step log and checkpoints are written through buffers allocated earlier. */
TEST(no_heap_call_for_output)
{
    static const char *const formats[] = {"npy", "obj", "ply", "vtp", "pc2", "glb"};
    static const char *const integrators[] = {"be", "ida", "bdf2"};
    for (int k = 0; k < 6; k++) {
        char folder[] = "/tmp/drape-heap-XXXXXX", command[64], integrator[100];
        ck_assert_ptr_nonnull(mkdtemp(folder));
        snprintf(integrator, sizeof integrator, "'method': '%s', 'linear_solver': 'klu'", integrators[k / 2]);
        scene s = open_scene(integrator, true);
        drape_recorder *recorder = NULL;
        const drape_recorder_def def = {.folder = folder,
                                        .formats = formats,
                                        .format_count = 6,
                                        .checkpoints = k % 2,
                                        .checkpoint_every = k % 2 ? 2 : 0};
        ck_assert_int_eq(drape_recorder_create(s.ctx, s.sim, &def, &recorder), DRAPE_OK);
        ck_assert_int_eq(count_steps(&s), 0);
        ck_assert_int_gt(drape_recorder_done(recorder).frames, 25);
        drape_recorder_destroy(&recorder);
        scene_close(&s);
        snprintf(command, sizeof command, "rm -rf %s", folder);
        ck_assert_int_eq(system(command), 0);
    }
}

/* The same with several threads; the calls of the context's allocator are counted too. */
static long own_calls;

static void *own_allocate(void *user, size_t size)
{
    (void)user;
    own_calls++;
    return malloc(size);
}

static void own_release(void *user, void *memory)
{
    (void)user;
    own_calls++;
    free(memory);
}

TEST(no_heap_call_of_threads)
{
    scoped_scene s = open_scene("'linear_solver': 'klu'", true);
    drape_context_def def = context_def();
    drape_sim_def two = sim_def();
    scoped_context *ctx = NULL;
    scoped_sim *sim = NULL;
    def.allocate = own_allocate;
    def.release = own_release;
    ck_assert_int_eq(drape_context_create(&def, &ctx), DRAPE_OK);
    two.threads = 2;
    ck_assert_int_eq(drape_sim_create(ctx, s.model, &two, &sim), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(sim, 0.01), DRAPE_OK);
    own_calls = calls = 0;
    counting = true;
    drape_status status = drape_sim_advance(sim, 0.5);
    counting = false;
    ck_assert_int_eq(status, DRAPE_OK);
    ck_assert_int_eq(calls, 0);
    ck_assert_int_eq(own_calls, 0);
}
