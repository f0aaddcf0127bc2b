/* test_schedule.c: the steps of fixed-step methods: counted times, halves that fill their interval, growth,
 * the shortened last step. */
#include "sim/schedule.h"

#include <float.h>

#include "models.h"
#include "support/suite.h"

/* Functions of the schedule with arguments for counted steps. */
static void begin(drape_schedule *s, double dt, double start)
{
    drape_schedule_init(s, DRAPE_STEPS_COUNTED, dt, start);
}

static void accept(drape_schedule *s, double t1)
{
    drape_schedule_accept(s, t1, NAN, true);
}

static void halve(drape_schedule *s, double h)
{
    drape_schedule_retry(s, h / 2);
}

TEST(times_are_counted)
{
    drape_schedule s;
    double t1, h;
    const double dt = 0.1; /* from the third on, a sum of 0.1 has another last digit */
    begin(&s, dt, 0);
    drape_schedule_aim(&s, 100);
    for (int k = 1; k <= 1000; k++) {
        ck_assert(drape_schedule_next(&s, &t1, &h));
        ck_assert_double_eq(t1, k * dt);
        ck_assert_double_eq(h, dt);
        accept(&s, t1);
    }
    ck_assert(!drape_schedule_next(&s, &t1, &h));
}

TEST(asking_changes_nothing)
{
    drape_schedule s;
    double t1, h, t2, h2;
    begin(&s, 0.25, 1);
    drape_schedule_aim(&s, 1.6);
    for (int k = 0; k < 3; k++) {
        ck_assert(drape_schedule_next(&s, &t1, &h));
        ck_assert(drape_schedule_next(&s, &t2, &h2));
        ck_assert(t1 == t2 && h == h2);
        accept(&s, t1);
    }
    ck_assert_double_eq(t1, 1.6);
    ck_assert_double_eq_tol(h, 0.1, 1e-15);
}

/* Nothing happens in a step so short that 1/h^2 overflows, also before the first one. */
TEST(a_step_is_not_too_short_to_be_computed)
{
    const drape_stepping all[] = {DRAPE_STEPS_COUNTED, DRAPE_STEPS_PROPOSED, DRAPE_STEPS_FREE};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        drape_schedule s;
        double t1, h;
        drape_schedule_init(&s, all[i], 0.01, 0);
        drape_schedule_aim(&s, 1e-300);
        ck_assert(!drape_schedule_next(&s, &t1, &h));
        drape_schedule_aim(&s, 1e-30);
        ck_assert(drape_schedule_next(&s, &t1, &h));
        ck_assert_double_eq(t1, 1e-30);
    }
}

/* Rejected once, then twice: halves and quarters of the same interval; then the size grows again. */
TEST(halves_fill_the_interval)
{
    static const struct {
        int halvings;
        double t1, h;
    } steps[] = {{1, 0.5, 0.5}, {2, 0.625, 0.125}, {0, 0.75, 0.125}, {0, 1, 0.25},
                 {0, 1.5, 0.5}, {0, 2, 0.5},       {0, 3, 1}};
    drape_schedule s;
    double t1, h;
    begin(&s, 1, 0);
    drape_schedule_aim(&s, 10);
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++) {
        for (int k = 0; k <= steps[i].halvings; k++) {
            if (k > 0)
                halve(&s, h);
            ck_assert(drape_schedule_next(&s, &t1, &h));
        }
        ck_assert_double_eq(t1, steps[i].t1);
        ck_assert_double_eq(h, steps[i].h);
        accept(&s, t1);
    }
}

/* Halved twice, parts stay as small as they are after steps that shall not grow, also in the next interval,
 * and grow after the first others that end where larger ones would. */
TEST(parts_grow_only_where_they_may)
{
    static const struct {
        double t1, h;
        bool grow;
    } steps[] = {{0.25, 0.25, false}, {0.5, 0.25, false}, {0.75, 0.25, true}, {1, 0.25, false},
                 {1.25, 0.25, false}, {1.5, 0.25, true},  {2, 0.5, false},    {2.5, 0.5, true},
                 {3, 0.5, true},      {4, 1, false}};
    drape_schedule s;
    double t1, h;
    begin(&s, 1, 0);
    drape_schedule_aim(&s, 10);
    ck_assert(drape_schedule_next(&s, &t1, &h));
    halve(&s, h);
    ck_assert(drape_schedule_next(&s, &t1, &h));
    halve(&s, h);
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++) {
        ck_assert(drape_schedule_next(&s, &t1, &h));
        ck_assert_double_eq(t1, steps[i].t1);
        ck_assert_double_eq(h, steps[i].h);
        drape_schedule_accept(&s, t1, NAN, steps[i].grow);
    }
}

TEST(the_end_cuts_and_tiny_remainders_join)
{
    static const struct {
        double end, last;
        int steps;
    } cases[] = {{1, 0.25, 4},
                 {1.1, 0.1, 5},
                 {1 + 1e-11, 0.25 + 1e-11, 4}, /* a remainder below 1e-9 dt: the last step includes it */
                 {1 - 1e-11, 0.25 - 1e-11, 4}, /* or is shorter by it */
                 {1 + 1e-9, 1e-9, 5},          /* a remainder that is not below */
                 {0.25e-12, 0.25e-12, 1},      /* no step before it to join */
                 {0.1, 0.1, 1},
                 {0, 0, 0},
                 {-1, 0, 0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        drape_schedule s;
        double t1 = 0, h = 0;
        int steps = 0;
        begin(&s, 0.25, 0);
        drape_schedule_aim(&s, cases[i].end);
        for (; drape_schedule_next(&s, &t1, &h); steps++)
            accept(&s, t1);
        ck_assert_int_eq(steps, cases[i].steps);
        if (steps > 0) {
            ck_assert_double_eq(t1, cases[i].end);
            ck_assert_double_eq_tol(h, cases[i].last, 1e-15);
        }
    }
}

/* 60 advances of 1/60 s in steps of 1/120 s take the same steps as one of 1 s. */
TEST(advances_do_not_shift_the_count)
{
    drape_schedule s;
    double t1 = 0, h;
    int steps = 0;
    begin(&s, 1.0 / 120, 0);
    for (int frame = 1; frame <= 60; frame++) {
        drape_schedule_aim(&s, frame / 60.0);
        while (drape_schedule_next(&s, &t1, &h)) {
            steps++;
            ck_assert_double_eq_tol(t1, steps * (1.0 / 120), 2 * DBL_EPSILON);
            ck_assert_double_eq(h, 1.0 / 120);
            accept(&s, t1);
        }
    }
    ck_assert_int_eq(steps, 120);
}

TEST(an_interval_left_half_done_is_given_up)
{
    drape_schedule s;
    double t1, h;
    begin(&s, 1, 0);
    drape_schedule_aim(&s, 10);
    ck_assert(drape_schedule_next(&s, &t1, &h));
    halve(&s, h);
    ck_assert(drape_schedule_next(&s, &t1, &h));
    accept(&s, t1); /* at 0.5, where the advance ends */
    drape_schedule_aim(&s, 0.75);
    double sum = 0;
    while (drape_schedule_next(&s, &t1, &h)) {
        sum += h;
        accept(&s, t1);
    }
    ck_assert_double_eq(t1, 0.75);
    ck_assert_double_eq(sum, 0.25);
}

/* For any sequence of rejections and ends, times increase strictly, h is the difference of times up to
 * their rounding, an advance ends exactly at its end, the sizes add up, and no step is larger than dt (1 +
 * 1e-9). */
TEST(any_sequence_fills_the_time)
{
    for (uint64_t trial = 1; trial <= 1000; trial++) {
        uint64_t seed = trial * 1000003;
        double dt = exp(6 * random_number(&seed) - 4), start = 100 * fmax(0, random_number(&seed));
        double odds = 0.6 * random_number(&seed); /* of a rejection */
        drape_schedule s;
        double now = start, sum = 0;
        begin(&s, dt, start);
        for (int advance = 0; advance < 4; advance++) {
            double span = dt * 8 * fmax(0, random_number(&seed));
            if (advance % 2) /* a whole number of steps, and a remainder that may be tiny */
                span = dt * (floor(span / dt) + 1e-10 * random_number(&seed));
            double end = now + span, t1, h;
            bool stops = advance == 2 && random_number(&seed) > 0;
            int accepted = 0, rejected = 0;
            drape_schedule_aim(&s, end);
            while (drape_schedule_next(&s, &t1, &h)) {
                ck_assert_int_lt(rejected, 100000);
                ck_assert_double_gt(h, 0);
                ck_assert_double_le(h, dt * (1 + 1e-9));
                ck_assert_double_le(t1, fmax(end, now + 2e-9 * dt));
                if (s.level < 5 && now + h / 2 > now && random_number(&seed) < odds) {
                    halve(&s, h);
                    rejected++;
                    continue;
                }
                ck_assert_double_gt(t1, now);
                ck_assert_double_eq_tol(t1 - now, h, 2e-9 * dt + 8 * DBL_EPSILON * t1);
                sum += h;
                now = t1;
                accept(&s, t1);
                if (stops && ++accepted == 3) /* an observer stops the advance in the middle */
                    break;
            }
            ck_assert_msg(stops || now == end || end - now <= 1.1e-9 * dt, "at %.17g, not %.17g", now, end);
            ck_assert_double_eq_tol(sum, now - start, 1e-8 * dt + 1e-13 * now);
        }
    }
}

/* Proposed steps: no step exceeds the proposal (except by the last 1e-9), and no tiny one is left over. */
TEST(proposed_steps_reach_the_end)
{
    for (uint64_t trial = 1; trial <= 500; trial++) {
        uint64_t seed = trial * 7919;
        double t1, h, now = 0, sum = 0, limit = 0.1, end = 3 + random_number(&seed);
        drape_schedule s;
        drape_schedule_init(&s, DRAPE_STEPS_PROPOSED, limit, 0);
        drape_schedule_aim(&s, end);
        while (drape_schedule_next(&s, &t1, &h)) {
            ck_assert(h > 0 && h <= limit * (1 + 2e-9) && t1 > now && t1 <= end);
            ck_assert(h >= 0.4 * fmin(limit, end - now));
            bool refused = random_number(&seed) > 0.5;
            limit = refused ? h / 2 : 0.1 * exp(random_number(&seed));
            if (refused) {
                drape_schedule_retry(&s, limit);
                continue;
            }
            sum += h;
            now = t1;
            drape_schedule_accept(&s, t1, limit, true);
        }
        ck_assert_double_eq(now, end);
        ck_assert_double_eq_tol(sum, end, 1e-12);
    }
}

/* Whatever size a controller proposes after a rejection, the next step is smaller or there is none. */
TEST(no_step_is_tried_again_at_its_size)
{
    static const drape_stepping kinds[] = {DRAPE_STEPS_PROPOSED, DRAPE_STEPS_FREE};
    for (int k = 0; k < 2; k++) {
        drape_schedule s;
        double t1, h, tried;
        drape_schedule_init(&s, kinds[k], 0.25, 0);
        drape_schedule_aim(&s, 1);
        ck_assert(drape_schedule_next(&s, &t1, &tried));
        ck_assert(!drape_schedule_retry(&s, tried));
        ck_assert(!drape_schedule_retry(&s, 2 * tried));
        ck_assert(!drape_schedule_retry(&s, 0));
        ck_assert(!drape_schedule_retry(&s, NAN));
        ck_assert(drape_schedule_retry(&s, nextafter(tried, 0)));
        ck_assert(drape_schedule_next(&s, &t1, &h));
        ck_assert_double_lt(h, tried);
    }
}

/* A step that is to end elsewhere: it may also be longer than the one before, and be halved; counting
 * restarts at its end. */
TEST(a_cut_step_ends_at_its_end)
{
    drape_schedule s;
    double t1, h;
    begin(&s, 1, 0);
    drape_schedule_aim(&s, 10);
    ck_assert(drape_schedule_next(&s, &t1, &h));
    accept(&s, t1);
    ck_assert(drape_schedule_next(&s, &t1, &h));
    drape_schedule_cut(&s, 1.25);
    ck_assert(drape_schedule_next(&s, &t1, &h) && t1 == 1.25 && h == 0.25);
    drape_schedule_cut(&s, 1.5);
    ck_assert(drape_schedule_next(&s, &t1, &h) && t1 == 1.5 && h == 0.5);
    halve(&s, h);
    ck_assert(drape_schedule_next(&s, &t1, &h) && t1 == 1.25 && h == 0.25);
    accept(&s, t1);
    ck_assert(drape_schedule_next(&s, &t1, &h) && t1 == 1.5 && h == 0.25);
    accept(&s, t1);
    ck_assert(drape_schedule_next(&s, &t1, &h) && t1 == 2.5 && h == 1);
    drape_schedule_cut(&s, 1.75);
    drape_schedule_aim(&s, 5); /* another advance: the cut is forgotten */
    ck_assert(drape_schedule_next(&s, &t1, &h) && t1 == 2.5 && h == 1);
}

/* Steps that are proposed or free lead to the cut, and go on from there to the end. */
TEST(other_steps_lead_to_the_cut)
{
    static const drape_stepping kinds[] = {DRAPE_STEPS_PROPOSED, DRAPE_STEPS_FREE};
    for (int k = 0; k < 2; k++) {
        drape_schedule s;
        double t1, h;
        drape_schedule_init(&s, kinds[k], 1, 0);
        drape_schedule_aim(&s, 10);
        ck_assert(drape_schedule_next(&s, &t1, &h));
        drape_schedule_cut(&s, 0.25);
        ck_assert(drape_schedule_next(&s, &t1, &h) && t1 == 0.25 && h == 0.25);
        drape_schedule_accept(&s, 0.125, 0.125, true); /* an integrator may stop short of it */
        ck_assert(drape_schedule_next(&s, &t1, &h) && t1 == 0.25 && h == 0.125);
        drape_schedule_accept(&s, t1, 1, true);
        ck_assert(drape_schedule_next(&s, &t1, &h) && t1 == (k ? 10 : 1.25));
    }
}
