/*
 * test_accuracy.c: drape_run_accurately: a run is as near to a fine one as it says and as was asked, whatever
 * method that takes; observers see all of the last run; what cannot be run so is refused.
 */
#include "geometry/deviation.h"
#include "support/scene.h"

#define FRAMES 25 /* of 0.4 s */

#define CLOTH                                                                                                \
    "'cloth': [{'mesh': {'grid': 'square', 'columns': 7, 'rows': 7, 'width': 0.5, 'height': 0.5, "           \
    "'orientation': 'horizontal'%s}, 'material': {'young_modulus': 1e5, 'thickness': 1e-3, "                 \
    "'areal_density': 0.2}, 'terms': ['stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': "  \
    "5e-3}]%s}], 'duration': 0.4"

static const struct {
    const char *name, *start, *rest;
} cases[] = {{"hung", "", ", 'pins': [{'corner': 'top-left'}, {'corner': 'top-right'}]"},
             {"falling", ", 'transform': {'translate': [0, 0.3, 0], 'rotate': [1, 0, 0, 20]}", ""}};

static scene open_case(int k, const char *more)
{
    return scene_model(
        "{'drape': 1, " CLOTH ", %s%s}", cases[k].start, cases[k].rest,
        k == 1 ? "'colliders': [{'type': 'plane', 'point': [0,0,0], 'normal': [0,1,0]}], " : "", more);
}

typedef struct seen {
    drape_sim *sim;
    int runs, frames;
    double x[FRAMES][147];
} seen;

static drape_status see(void *user, const drape_event *event)
{
    seen *s = user;
    if (event->kind != DRAPE_EVENT_FRAME)
        return DRAPE_OK;
    ck_assert_ptr_eq(event->sim, s->sim);
    ck_assert_int_eq(event->frame, s->frames);
    memcpy(s->x[s->frames++], event->positions, sizeof s->x[0]);
    return DRAPE_OK;
}

static drape_status prepare(void *user, drape_sim *sim, const drape_accuracy *before)
{
    seen *s = user;
    s->sim = sim;
    s->frames = 0;
    ck_assert_int_eq(before->runs, ++s->runs);
    return drape_sim_observe(sim, see, s);
}

static void run_finely(int k, seen *fine)
{
    scoped_scene s = open_case(k, "'integrator': {'method': 'radau', 'rtol': 1e-7}");
    fine->frames = 0;
    scene_start(&s, NULL);
    fine->sim = s.sim;
    assert_ok(s.ctx, drape_sim_observe(s.sim, see, fine));
    scene_advance(&s, 0.4);
}

/* The fine run is nearer to the motion than any that is asked for by three orders. The estimate is meant to
 * be rather too much than too little, and within a factor of 3 where it is not far below what was asked. */
TEST(runs_are_as_accurate_as_asked)
{
    static const double asked[] = {3e-2, 3e-3, 3e-4};
    for (int k = 0; k < 2; k++) {
        static seen fine, got;
        run_finely(k, &fine);
        for (int i = 0; i < 3; i++) {
            char accuracy[40];
            drape_accuracy report;
            drape_deviation apart;
            snprintf(accuracy, sizeof accuracy, "'accuracy': '%g'", asked[i]);
            scoped_scene s = open_case(k, accuracy);
            got.runs = got.frames = 0;
            assert_ok(s.ctx, drape_run_accurately(s.ctx, s.model, NULL, prepare, &got, &s.sim, &report));
            drape_arena arena = drape_arena_of(s.ctx);
            assert_ok(s.ctx, drape_deviation_create(&arena, s.model, s.model, &apart));
            for (int f = 0; f < FRAMES; f++)
                drape_deviation_add(&apart, f / 60.0, got.x[f], fine.x[f]);
            const double error = apart.cloths[0].largest.rms / apart.cloths[0].diagonal;
            printf("# %s, %g: off by %.2g, by its estimate %.2g, after %d runs, by %s\n", cases[k].name,
                   asked[i], error, report.error, (int)report.runs, report.method);
            ck_assert_int_eq(got.frames, FRAMES);
            ck_assert_int_eq(got.runs, report.runs);
            ck_assert_int_gt(report.runs, 1);
            ck_assert_ptr_eq(got.sim, s.sim);
            ck_assert(report.reached && report.until == 0.4 && report.asked == asked[i]);
            assert_below(report.error, asked[i] * (1 + 1e-12));
            assert_below(error, asked[i]);
            assert_below(error, 3 * report.error);
            ck_assert_double_eq_tol(report.distance, report.error * apart.cloths[0].diagonal, 1e-12);
            ck_assert(report.worst >= report.distance && report.node >= 0 && report.node < 49);
            drape_arena_free(&arena);
        }
    }
}

/* A length is asked of each cloth; one of half the diagonal is reached by the first two runs. */
TEST(a_length_is_a_share)
{
    drape_accuracy report;
    scoped_scene s = open_case(0, "'accuracy': '35.35533905932738 cm'");
    assert_ok(s.ctx, drape_run_accurately(s.ctx, s.model, NULL, NULL, NULL, &s.sim, &report));
    ck_assert_double_eq_tol(report.asked, 0.5, 1e-12);
    ck_assert_int_eq(report.runs, 2);
    ck_assert_double_eq(drape_sim_time(s.sim), 0.4);
}

static drape_status stop(void *user, drape_sim *sim, const drape_accuracy *before)
{
    (void)user, (void)sim, (void)before;
    return DRAPE_E_FILE;
}

TEST(what_cannot_be_run_so_is_refused)
{
    static const struct {
        const char *more, *says;
    } rows[] = {{"'frame_rate': 60", "asks for no accuracy"},
                {"'accuracy': 1e-9", "below what double precision gives"},
                {"'accuracy': '1e-4 um'", "below what double precision gives"},
                {"'accuracy': '1mm', 'integrator': {'method': 'verlet'}", "does not converge"},
                {"'accuracy': '1mm', 'integrator': {'method': 'static'}", "does not converge"}};
    drape_accuracy report;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        scoped_scene s = open_case(0, rows[i].more);
        ck_assert_int_eq(drape_run_accurately(s.ctx, s.model, NULL, NULL, NULL, &s.sim, &report),
                         DRAPE_E_ARGUMENT);
        ck_assert_msg(strstr(drape_context_message(s.ctx), rows[i].says), "%s", drape_context_message(s.ctx));
        ck_assert_ptr_null(s.sim);
    }
    scoped_scene s = open_case(0, "'accuracy': 0.01");
    ck_assert_int_eq(drape_run_accurately(s.ctx, s.model, NULL, stop, NULL, &s.sim, &report), DRAPE_E_FILE);
    ck_assert_int_eq(report.runs, 1);
}
