/* test_events.c: events of user-defined functions, through the public header only. */
#include <math.h>
#include <string.h>

#include "drape/drape.h"
#include "support/bytes.h"
#include "support/suite.h"

/* Free fall of one small sheet from rest, under the method and with steps of 0.01 s. */
static const char text[] =
    "{\"drape\": 1, \"cloth\": [{\"name\": \"sheet\","
    " \"mesh\": {\"grid\": \"square\", \"columns\": 3, \"rows\": 3, \"width\": 0.2, \"height\": 0.2},"
    " \"material\": {\"young_modulus\": 1e5, \"thickness\": 1e-3, \"density\": 200},"
    " \"terms\": [\"stretch.cst\"]}], \"gravity\": [0, -10, 0],"
    " \"integrator\": {\"method\": \"midpoint\", \"dt\": 0.01}, \"duration\": 1}";

typedef struct seen {
    int roots;
    double time[8], y[8], v[8], value[8];
    int32_t event[8];
    int direction[8];
    const char *name;
} seen;

typedef struct fixture {
    drape_context *ctx;
    drape_model *model;
    drape_sim *sim;
    seen seen;
} fixture;

static drape_status note(void *user, const drape_event *event)
{
    seen *s = user;
    if (event->kind != DRAPE_EVENT_ROOT)
        return DRAPE_OK;
    ck_assert_int_lt(s->roots, 8);
    s->time[s->roots] = event->time;
    s->y[s->roots] = event->positions[1];
    s->v[s->roots] = event->velocities[1];
    s->value[s->roots] = event->value;
    s->event[s->roots] = event->event;
    s->direction[s->roots++] = event->direction;
    s->name = event->name;
    return DRAPE_OK;
}

static void open_fixture(fixture *f)
{
    drape_scene *scene = NULL;
    *f = (fixture){.sim = NULL};
    ck_assert_int_eq(drape_context_create(NULL, &f->ctx), DRAPE_OK);
    ck_assert_int_eq(drape_scene_parse(f->ctx, text, "s.json", &scene), DRAPE_OK);
    assert_ok(f->ctx, drape_scene_compile(scene, &f->model));
    drape_scene_destroy(&scene);
    ck_assert_int_eq(drape_sim_create(f->ctx, f->model, NULL, &f->sim), DRAPE_OK);
    ck_assert_int_eq(drape_sim_observe(f->sim, note, &f->seen), DRAPE_OK);
}

static void close_fixture(fixture *f)
{
    drape_sim_destroy(&f->sim);
    drape_model_destroy(&f->model);
    drape_context_destroy(&f->ctx);
}

#define scoped_fixture SCOPED(close_fixture) fixture

static drape_event_def def_of(const char *name, const char *direction, const char *action)
{
    drape_event_def def = event_def();
    def.name = name;
    def.direction = direction;
    def.action = action;
    return def;
}

static void add(fixture *f, const char *name, const char *direction, const char *action,
                drape_event_function *function, void *user)
{
    const drape_event_def def = def_of(name, direction, action);
    assert_ok(f->ctx, drape_sim_add_event(f->sim, &def, function, user));
}

/* f = t - the time of the user. */
static drape_status clock_of(void *user, double t, const double *x, const double *v, double *value)
{
    (void)x, (void)v;
    *value = t - *(const double *)user;
    return DRAPE_OK;
}

/* (t - a)(t - b) */
static drape_status twice(void *user, double t, const double *x, const double *v, double *value)
{
    const double *at = user;
    (void)x, (void)v;
    *value = (t - at[0]) * (t - at[1]);
    return DRAPE_OK;
}

/* The speed of node 0 downwards, less 2 m/s. */
static drape_status speed(void *user, double t, const double *x, const double *v, double *value)
{
    (void)user, (void)t, (void)x;
    *value = -v[1] - 2;
    return DRAPE_OK;
}

/* Free fall: y = y0 - 5 t^2, v = -10 t, which the implicit midpoint rule follows exactly. */
TEST(a_function_is_located_and_reported)
{
    scoped_fixture f;
    open_fixture(&f);
    const double y0 = drape_sim_positions(f.sim)[1];
    add(&f, "speed", NULL, NULL, speed, NULL);
    ck_assert_int_eq(drape_sim_advance(f.sim, 0.5), DRAPE_OK);
    ck_assert_int_eq(f.seen.roots, 1);
    ck_assert_double_eq_tol(f.seen.time[0], 0.2, 1e-10);
    ck_assert_double_eq_tol(f.seen.y[0], y0 - 0.2, 1e-9); /* 1e-10 s at 2 m/s, and rounding */
    ck_assert_double_eq_tol(f.seen.v[0], -2, 1e-9);
    ck_assert_double_eq_tol(f.seen.value[0], 0, 1e-9);
    ck_assert(f.seen.event[0] == 0 && f.seen.direction[0] == 1 && strcmp(f.seen.name, "speed") == 0);
    drape_event_record record;
    ck_assert_int_eq(drape_sim_event(f.sim, 0, &record), 1);
    ck_assert(record.count == 1 && record.first == f.seen.time[0] && record.last == f.seen.time[0]);
    ck_assert(record.direction == 1 && strcmp(record.name, "speed") == 0);
    ck_assert_int_eq(drape_sim_stopped_by(f.sim), -1);
}

/* The steps end at k 0.01 s: the end of the tenth is 0.1 s to the last bit. */
TEST(a_root_at_the_end_of_a_step_counts_once)
{
    static const char *const actions[] = {"record", "stop"};
    for (int i = 0; i < 2; i++) {
        scoped_fixture f;
        double at = 10 * 0.01;
        open_fixture(&f);
        add(&f, "clock", NULL, actions[i], clock_of, &at);
        ck_assert_int_eq(drape_sim_advance(f.sim, 0.5), i ? DRAPE_E_STOPPED : DRAPE_OK);
        if (i) {
            ck_assert(drape_sim_time(f.sim) == at && drape_sim_stopped_by(f.sim) == 0);
            ck_assert_int_eq(drape_sim_statistics(f.sim).steps_rejected, 0);
            ck_assert_int_eq(drape_sim_advance(f.sim, 0.5), DRAPE_OK);
            ck_assert_int_eq(drape_sim_stopped_by(f.sim), -1);
        }
        ck_assert_int_eq(f.seen.roots, 1);
        ck_assert_double_eq_tol(f.seen.time[0], at, 1e-12);
    }
}

TEST(a_root_at_the_start_is_not_an_event)
{
    scoped_fixture f;
    double at = 0;
    open_fixture(&f);
    add(&f, "clock", NULL, "stop", clock_of, &at);
    ck_assert_int_eq(drape_sim_advance(f.sim, 0.05), DRAPE_OK);
    ck_assert_int_eq(f.seen.roots, 0);
}

/* Both roots lie between the same two of the evaluations that each step gets, 1/300 s apart. */
TEST(two_roots_in_a_step_are_found)
{
    scoped_fixture f;
    double at[2] = {0.1041, 0.1042};
    static const int32_t events[] = {0, 2, 0, 1};
    open_fixture(&f);
    add(&f, "both", "both", NULL, twice, at);
    add(&f, "up", "up", NULL, twice, at);
    add(&f, "down", "down", NULL, twice, at);
    ck_assert_int_eq(drape_sim_advance(f.sim, 0.2), DRAPE_OK);
    ck_assert_int_eq(f.seen.roots, 4);
    for (int i = 0; i < 4; i++) {
        ck_assert_double_eq_tol(f.seen.time[i], at[i / 2], 1e-12);
        ck_assert_int_eq(f.seen.direction[i], i < 2 ? -1 : 1);
        ck_assert_int_eq(f.seen.event[i], events[i]);
    }
}

/* Reports are in order of time, whatever the order of the events; those after a stop are for later, and at
 * the same time all that act do. */
TEST(events_are_in_order_of_time)
{
    scoped_fixture f;
    double late = 0.1047, early = 0.1011, stop = 0.1033;
    open_fixture(&f);
    add(&f, "late", NULL, NULL, clock_of, &late);
    add(&f, "stop", NULL, "stop", clock_of, &stop);
    add(&f, "early", NULL, NULL, clock_of, &early);
    add(&f, "also", NULL, "stop", clock_of, &stop);
    ck_assert_int_eq(drape_sim_advance(f.sim, 0.2), DRAPE_E_STOPPED);
    ck_assert_str_eq(drape_context_message(f.ctx), "t=0.1033: stopped by event \"stop\"");
    ck_assert_double_eq_tol(drape_sim_time(f.sim), stop, 1e-12);
    ck_assert_int_eq(f.seen.roots, 3);
    ck_assert(f.seen.event[0] == 2 && f.seen.event[1] == 1 && f.seen.event[2] == 3);
    ck_assert(f.seen.time[1] == drape_sim_time(f.sim) && f.seen.time[2] == drape_sim_time(f.sim));
    ck_assert_int_eq(drape_sim_stopped_by(f.sim), 1);
    ck_assert_int_eq(drape_sim_advance(f.sim, 0.2), DRAPE_OK);
    ck_assert(f.seen.roots == 4 && f.seen.event[3] == 0);
    ck_assert_double_eq_tol(f.seen.time[3], late, 1e-12);
}

TEST(once_is_once)
{
    scoped_fixture f;
    double at[2] = {0.103, 0.111};
    open_fixture(&f);
    drape_event_def def = def_of("once", NULL, NULL);
    def.once = true;
    ck_assert_int_eq(drape_sim_add_event(f.sim, &def, twice, at), DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(f.sim, 0.2), DRAPE_OK);
    ck_assert_int_eq(f.seen.roots, 1);
    ck_assert_double_eq_tol(f.seen.time[0], at[0], 1e-12);
}

/* ---- Functions that fail ---- */

typedef struct failing {
    drape_status status;
    double value, from;
    drape_context *says;
} failing;

static drape_status refuse_at(void *user, double t, const double *x, const double *v, double *value)
{
    const failing *f = user;
    (void)x, (void)v;
    *value = t < f->from ? 1 : f->value;
    if (t >= f->from && f->says)
        drape_context_set_message(f->says, "the host said so");
    return t < f->from ? DRAPE_OK : f->status;
}

/* The state is the last accepted one, to the last bit, and a later advance goes on if the function does. */
TEST(a_failing_function_ends_the_advance)
{
    static const struct {
        drape_status status;
        double value;
        drape_status returned;
        const char *message;
    } cases[] = {
        {DRAPE_E_FILE, 1, DRAPE_E_FILE, "t=0.1: the function of event \"fails\" returned e_file"},
        {DRAPE_RETRY_LINEAR, 1, DRAPE_E_STOPPED,
         "t=0.1: the function of event \"fails\" returned retry_linear"},
        {DRAPE_OK, NAN, DRAPE_E_ARGUMENT, "t=0.1: the function of event \"fails\" is nan"},
        {DRAPE_OK, INFINITY, DRAPE_E_ARGUMENT, "t=0.1: the function of event \"fails\" is inf"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scoped_fixture f, plain;
        failing user = {.status = cases[i].status, .value = cases[i].value, .from = 0.0999999};
        open_fixture(&f);
        open_fixture(&plain);
        add(&f, "fails", NULL, NULL, refuse_at, &user);
        ck_assert_int_eq(drape_sim_advance(f.sim, 0.2), cases[i].returned);
        ck_assert_str_eq(drape_context_message(f.ctx), cases[i].message);
        ck_assert_int_eq(drape_sim_advance(plain.sim, 9 * 0.01), DRAPE_OK);
        ck_assert(drape_sim_hash(f.sim) == drape_sim_hash(plain.sim));
        user.from = INFINITY;
        ck_assert_int_eq(drape_sim_advance(f.sim, 0.2), DRAPE_OK);
        ck_assert_int_eq(drape_sim_advance(plain.sim, 0.2), DRAPE_OK);
        ck_assert(drape_sim_hash(f.sim) == drape_sim_hash(plain.sim));
    }
}

TEST(the_message_of_a_function_is_kept)
{
    scoped_fixture f;
    failing user = {.status = DRAPE_E_FILE, .from = 0.05};
    open_fixture(&f);
    user.says = f.ctx;
    add(&f, "fails", NULL, NULL, refuse_at, &user);
    ck_assert_int_eq(drape_sim_advance(f.sim, 0.2), DRAPE_E_FILE);
    ck_assert_str_eq(drape_context_message(f.ctx), "the host said so");
}

TEST(wrong_events_are_refused)
{
    scoped_fixture f;
    double at = 0.1;
    open_fixture(&f);
    add(&f, "clock", NULL, NULL, clock_of, &at);
    drape_event_def def = def_of("clock", NULL, NULL);
    ck_assert_int_eq(drape_sim_add_event(f.sim, &def, clock_of, &at), DRAPE_E_ARGUMENT);
    ck_assert_str_eq(drape_context_message(f.ctx),
                     "drape_sim_add_event: there is an event of the name \"clock\"");
    def = def_of("a@b", NULL, NULL);
    ck_assert_int_eq(drape_sim_add_event(f.sim, &def, clock_of, &at), DRAPE_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(drape_context_message(f.ctx), "/event/name: the name of an event has no"));
    def = def_of("a", "sideways", NULL);
    ck_assert_int_eq(drape_sim_add_event(f.sim, &def, clock_of, &at), DRAPE_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(drape_context_message(f.ctx), "/event/direction: \"sideways\""));
    def = def_of("a", NULL, "explode");
    ck_assert_int_eq(drape_sim_add_event(f.sim, &def, clock_of, &at), DRAPE_E_ARGUMENT);
    def = def_of("a", NULL, NULL);
    def.cloth = "curtain";
    ck_assert_int_eq(drape_sim_add_event(f.sim, &def, clock_of, &at), DRAPE_E_ARGUMENT);
    def = def_of("a", NULL, NULL);
    def.entry.type = "height";
    ck_assert_int_eq(drape_sim_add_event(f.sim, &def, clock_of, &at), DRAPE_E_ARGUMENT);
    def = def_of(NULL, NULL, NULL);
    ck_assert_int_eq(drape_sim_add_event(f.sim, &def, clock_of, &at), DRAPE_E_ARGUMENT);
    def = def_of("a", NULL, NULL);
    ck_assert_int_eq(drape_sim_add_event(f.sim, &def, NULL, &at), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(drape_sim_add_event(f.sim, NULL, clock_of, &at), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(drape_sim_add_event(NULL, &def, clock_of, &at), DRAPE_E_ARGUMENT);
    def.struct_size = 0;
    ck_assert_int_eq(drape_sim_add_event(f.sim, &def, clock_of, &at), DRAPE_E_VERSION);
    ck_assert_int_eq(drape_sim_event(f.sim, 0, NULL), 1);
    ck_assert_int_eq(drape_sim_event(NULL, 0, NULL), 0);
}

/* A restored sim keeps the functions of its host, and needs as many events as the saved one had. */
TEST(a_checkpoint_needs_the_same_events)
{
    scoped_fixture f, other;
    double at = 0.1;
    open_fixture(&f);
    open_fixture(&other);
    add(&f, "clock", NULL, NULL, clock_of, &at);
    ck_assert_int_eq(drape_sim_advance(f.sim, 0.15), DRAPE_OK);
    scoped_bytes saved = bytes_save(f.sim);
    ck_assert_int_eq(drape_sim_restore_from(other.sim, saved.data, saved.size), DRAPE_E_ARGUMENT);
    add(&other, "clock", NULL, NULL, clock_of, &at);
    assert_ok(other.ctx, drape_sim_restore_from(other.sim, saved.data, saved.size));
    drape_event_record record;
    ck_assert_int_eq(drape_sim_event(other.sim, 0, &record), 1);
    ck_assert(record.count == 1 && record.first == f.seen.time[0]);
    ck_assert_int_eq(drape_sim_advance(other.sim, 0.2), DRAPE_OK);
    ck_assert_int_eq(other.seen.roots, 0);
}

/* A state that is set is a beginning: there is no root between it and the state before. */
TEST(a_state_that_is_set_has_no_root_before_it)
{
    scoped_fixture f;
    double at = 0.1;
    open_fixture(&f);
    add(&f, "clock", NULL, NULL, clock_of, &at);
    ck_assert_int_eq(drape_sim_advance(f.sim, 0.05), DRAPE_OK);
    ck_assert_int_eq(drape_sim_set_state(f.sim, 0.2, drape_sim_positions(f.sim), drape_sim_velocities(f.sim)),
                     DRAPE_OK);
    ck_assert_int_eq(drape_sim_advance(f.sim, 0.3), DRAPE_OK);
    ck_assert_int_eq(f.seen.roots, 0);
}

/* Even without a budget a call ends at the event, since the location of a root is not left to the next. */
TEST(a_stop_ends_a_call_with_a_budget)
{
    scoped_fixture f;
    double at = 0.1033;
    drape_realtime report;
    drape_status status = DRAPE_OK;
    open_fixture(&f);
    add(&f, "clock", NULL, "stop", clock_of, &at);
    for (int k = 0; k < 20 && !status; k++)
        status = drape_sim_advance_realtime(f.sim, 1 / 60.0, 0, &report);
    ck_assert_int_eq(status, DRAPE_E_STOPPED);
    ck_assert_double_eq_tol(report.time, at, 1e-11);
    ck_assert_int_eq(drape_sim_stopped_by(f.sim), 0);
    ck_assert_int_eq(drape_sim_advance_realtime(f.sim, 1 / 60.0, 1, &report), DRAPE_OK);
    ck_assert_int_eq(f.seen.roots, 1);
}
