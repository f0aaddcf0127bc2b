/*
 * test_clock.c: the clock jumps forwards and backwards, as on a machine that sleeps or migrates, although
 * CLOCK_MONOTONIC should not. Steps have the same bits, a budget ends a call, no call hangs, and all reported
 * times are finite. This file replaces clock_gettime for the library.
 */
#define _GNU_SOURCE
#include "support/scene.h"

#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#define FRAME (1.0 / 60)

static const char hung[] =
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 6, 'rows': 6, 'width': 1, 'height': 1},"
    "'material': {'young_modulus': 968246, 'thickness': 1.0328e-3, 'areal_density': 0.2},"
    "'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}]}],"
    "'integrator': {'method': '%s'}, 'duration': 4}";

static const char *const integrators[] = {"newton_k", "be", "ida", "verlet"};
#define ROWS (sizeof integrators / sizeof *integrators)

static long jump_each, reads; /* jump_each: calls between two jumps; 0: none */
static double away;           /* [s] error of the clock */
static double tick; /* [s] by which it advances each time it is read, and by nothing else; 0: it runs */

int clock_gettime(clockid_t id, struct timespec *t)
{
    static const double jumps[] = {3600, -7200, 1e-3, -1e-3, 1e9, -1e9};
    int result = (int)syscall(SYS_clock_gettime, id, t);
    if (tick > 0) {
        const double now = tick * (double)++reads;
        *t = (struct timespec){.tv_sec = (time_t)now, .tv_nsec = (long)(1e9 * (now - floor(now)))};
    }
    if (jump_each && ++reads % jump_each == 0)
        away += jumps[reads / jump_each % (long)(sizeof jumps / sizeof *jumps)];
    if (jump_each)
        t->tv_sec += (time_t)away;
    return result;
}

static void jump(long each)
{
    jump_each = each;
    reads = 0;
    away = 0;
}

TEST(steps_do_not_depend_on_the_clock)
{
    for (size_t i = 0; i < ROWS; i++) {
        scoped_scene good = scene_open(hung, integrators[i]);
        scene_advance(&good, 20 * FRAME);
        jump(3);
        scoped_scene bad = scene_open(hung, integrators[i]);
        scene_advance(&bad, 20 * FRAME);
        ck_assert_int_gt(reads, 0); /* the clock was read */
        jump(0);
        ck_assert_uint_eq(drape_sim_hash(good.sim), drape_sim_hash(bad.sim));
        const drape_statistics s = drape_sim_statistics(bad.sim);
        ck_assert(isfinite(s.wall_steps) && isfinite(s.wall_residual) && isfinite(s.wall_factor));
    }
}

/* However much time the clock says is left, a call makes no more steps than the frame and the debt need at
 * the integrator's own step, and the state is finite. */
TEST(a_budget_on_a_jumping_clock_ends)
{
    for (size_t i = 0; i < ROWS; i++)
        for (long each = 1; each < 8; each++) {
            scoped_scene s = scene_open(hung, integrators[i]);
            double before = 0;
            jump(each);
            for (int k = 0; k < 20; k++) {
                drape_realtime report;
                drape_status status = drape_sim_advance_realtime(s.sim, FRAME, 1e-3, &report);
                ck_assert_msg(status == DRAPE_OK, "%s: %s", integrators[i], drape_context_message(s.ctx));
                ck_assert(report.time >= before && report.time <= (k + 1) * FRAME * (1 + 1e-9));
                ck_assert(isfinite(report.debt) && report.debt >= 0 && isfinite(report.seconds));
                ck_assert(isfinite(report.dropped_total) && report.dropped_total >= 0);
                before = report.time;
            }
            jump(0);
            ck_assert_int_eq(drape_sim_advance(s.sim, before + FRAME), DRAPE_OK);
            const double *x = drape_sim_positions(s.sim);
            for (size_t n = 0; n < 3 * (size_t)s.model->node_count; n++)
                ck_assert(isfinite(x[n]));
        }
}

/* Frames in a budget, on a clock that advances by a millisecond each time it is read and not otherwise, so
 * that a call takes the same time on any machine. newton_k would make 20 further iterations in each step for
 * an error that it never reaches, or as many as rounding allows. */
typedef struct timed {
    int64_t iterations, late;
    double longest; /* [s] of a call */
} timed;

static drape_status spend(void *user, const drape_event *event)
{
    const int64_t *milliseconds = user;
    reads += event->kind == DRAPE_EVENT_ATTEMPT ? (long)*milliseconds : 0;
    return DRAPE_OK;
}

/* ending: milliseconds that an observer takes after each attempt. */
static timed run_in(double budget, int64_t ending)
{
    scoped_scene s =
        scene_open(hung, "newton_k', 'error': 1e-15, 'tolerance': 1e-15, 'linear_solver': 'auto");
    timed out = {0};
    ck_assert_int_eq(drape_sim_observe(s.sim, spend, &ending), DRAPE_OK);
    tick = 1e-3;
    reads = 0;
    for (int k = 0; k < 20; k++) {
        drape_realtime report;
        ck_assert_int_eq(drape_sim_advance_realtime(s.sim, FRAME, budget, &report), DRAPE_OK);
        out.late += !report.kept;
        out.longest = fmax(out.longest, report.seconds);
    }
    tick = 0;
    out.iterations = drape_sim_statistics(s.sim).newton_iterations;
    return out;
}

/* In three quarters of the time that all iterations take, a call makes fewer than all and more than the
 * least, one a frame; what an iteration takes is known after the first frames, which alone may be late. */
TEST(further_iterations_end_in_time)
{
    const timed all = run_in(3600, 0), some = run_in(0.75 * all.longest, 0);
    printf("# %d iterations in %g s a frame at most; %d in %g s, %d late\n", (int)all.iterations, all.longest,
           (int)some.iterations, 0.75 * all.longest, (int)some.late);
    ck_assert(some.iterations < all.iterations && some.iterations > 20);
    ck_assert_int_le(some.late, 2);
}

/* An observer that takes 50 ms of the time leaves less for further iterations, and frames are not late for
 * it. */
TEST(the_end_of_a_step_has_its_time)
{
    const int64_t ending = 50;
    const timed all = run_in(3600, ending), some = run_in(0.75 * all.longest, ending);
    printf("# %d iterations in %g s a frame at most; %d in %g s, %d late\n", (int)all.iterations, all.longest,
           (int)some.iterations, 0.75 * all.longest, (int)some.late);
    ck_assert(some.iterations < all.iterations && some.iterations > 20);
    ck_assert_int_le(some.late, 2);
}
