/*
 * shortage.c: each allocation of a part of a model, of its sim and of two steps fails on one rank, the others
 * having memory: all ranks return the same status, with a message, and none waits for ever. A program of its
 * own, because `drape` has no allocator that fails: test_ranks.py launches it.
 *
 *     mpirun -n 3 test_mpi_shortage SCENE RANK FIRST EVERY
 *
 * From the allocation FIRST on, one of EVERY many fails. An attempt that takes too long ends the program.
 */
#include <mpi.h>
#include <signal.h>
#include <stdio.h>
#include <unistd.h>

#include "mpi/mpi.h"
#include "support/failing_allocator.h"

#define SECONDS 20

static volatile sig_atomic_t attempt;

static void give_up(int signal)
{
    char text[64];
    const int length = snprintf(text, sizeof text, "# allocation %d: some wait for ever\n", (int)attempt);
    (void)signal;
    if (write(STDOUT_FILENO, text, (size_t)length) != length)
        _exit(4);
    _exit(3);
}

/* Begins at an allocation after the compilation, which takes place before the ranks meet. */
static drape_status run(drape_mpi *mpi, drape_context *ctx, failing_allocator *memory, const char *path,
                        long fail_at)
{
    drape_scene *scene = NULL;
    drape_model *whole = NULL, *part = NULL;
    drape_sim *sim = NULL;
    drape_status status = drape_scene_load(ctx, path, &scene);
    if (!status)
        status = drape_scene_compile(scene, &whole);
    if (!status) {
        memory->fail_at = fail_at > 0 ? memory->calls + fail_at : 0;
        status = drape_mpi_share(mpi, whole, &part);
    }
    if (!status)
        status = drape_sim_create(ctx, part, NULL, &sim);
    if (!status)
        status = drape_sim_advance(sim, drape_model_duration(part));
    drape_sim_destroy(&sim);
    drape_model_destroy(&part);
    drape_model_destroy(&whole);
    drape_scene_destroy(&scene);
    return status;
}

/* Whether all ranks have the same status; *reached: there was such an allocation on the rank that has it
 * fail. */
static bool try_one(drape_mpi *mpi, const char *path, bool fails, long fail_at, bool *reached, bool *failed)
{
    char message[DRAPE_MESSAGE_SIZE];
    failing_allocator memory = {0};
    drape_context *ctx = failing_context(&memory);
    const int status = run(mpi, ctx, &memory, path, fails ? fail_at : 0);
    int here[3] = {status, -status, memory.fail_at > 0 && memory.calls >= memory.fail_at}, there[3];
    snprintf(message, sizeof message, "%s", status ? drape_context_message(ctx) : "");
    drape_context_destroy(&ctx);
    MPI_Allreduce(here, there, 3, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
    *reached = there[2];
    *failed = status != DRAPE_OK;
    const bool same = there[0] == -there[1], said = status == DRAPE_OK || *message,
               right = status == DRAPE_OK || status == DRAPE_E_MEMORY;
    if (same && said && right && memory.live == 0)
        return true;
    printf("# allocation %ld, rank %d: %s, \"%s\", %ld not released\n", fail_at, drape_mpi_rank(mpi),
           drape_status_name(status), message, memory.live);
    return false;
}

int main(int argc, char **argv)
{
    drape_context *ctx = NULL;
    drape_mpi *mpi = NULL;
    bool right = argc == 5, reached = true, failed;
    long failures = 0, n = argc == 5 ? atol(argv[3]) : 1;
    setvbuf(stdout, NULL, _IOLBF, 0);
    signal(SIGALRM, give_up);
    if (!right || drape_context_create(NULL, &ctx) || drape_mpi_begin(ctx, &mpi) || !mpi)
        return 2;
    for (; reached; n += atol(argv[4])) {
        attempt = (sig_atomic_t)n;
        alarm(SECONDS);
        right = try_one(mpi, argv[1], drape_mpi_rank(mpi) == atoi(argv[2]), n, &reached, &failed) && right;
        failures += failed;
    }
    alarm(0);
    if (drape_mpi_rank(mpi) == 0)
        printf("# rank %s: %ld allocations, %ld failures\n", argv[2], n, failures);
    drape_mpi_end(&mpi);
    drape_context_destroy(&ctx);
    return right ? 0 : 1;
}
