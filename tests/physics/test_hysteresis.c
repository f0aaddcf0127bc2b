/*
 * test_hysteresis.c: sliders of bend.midedge and stretch.curve: the loops of moment over curvature and of
 * force over the shear angle, what they dissipate, the fold that a crease keeps, and that every integrator
 * carries them.
 */
#include "support/resume.h"

#define COLUMNS  21
#define NODES    (5 * COLUMNS)
#define LENGTH   0.2  /* [m] along x */
#define WIDTH    0.04 /* [m] */
#define FRICTION 25.  /* [1/m] HB/B */
#define BEGINS   4.   /* [1/m] where yarns slip */
#define YIELD    30.  /* [1/m] */
#define HARDENS  0.2
#define STEP     1e-3 /* [1/m] of differences */
#define CORNER   (STEP * FRICTION / BEGINS / 4 * 1.01)

/* A strip along x of 20 x 4 cells, with these parameters of bend.midedge, pins and members of the scene. */
static scene strip(const char *bending, const char *pins, const char *members)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 21, 'rows': 5, 'width': %g, "
        "'height': %g}, 'material': {'young_modulus': 1e6, 'thickness': 5e-4, 'areal_density': "
        "0.15}, 'terms': ['stretch.cst', {'type': 'bend.midedge', 'poisson': 0%s}], 'pins': [%s]}], %s}",
        LENGTH, WIDTH, bending, pins, members);
}

#define AT_REST    "'gravity': [0, 0, 0], 'integrator': {'method': 'be', 'dt': 0.01}, 'duration': 1"
#define HYSTERESIS ", 'friction': 25, 'friction_curvature': 4"
#define CREASE     ", 'yield_curvature': 30, 'hardening': 0.2"

/* The positions of the strip on a cylinder: chords that are as long as at rest, each turned against the one
 * before by the curvature times its length; curvature 0 is flat. */
static void roll(const scene *s, double curvature, double *x)
{
    const double side = LENGTH / (COLUMNS - 1);
    for (size_t i = 0; i < NODES; i++) {
        x[3 * i] = x[3 * i + 1] = 0;
        x[3 * i + 2] = s->model->rest[3 * i + 2];
        for (size_t c = 0; c < i % COLUMNS; c++) {
            x[3 * i] += side * cos(curvature * side * ((double)c + 0.5));
            x[3 * i + 1] += side * sin(curvature * side * ((double)c + 0.5));
        }
    }
}

static void move(scene *s, const double *x)
{
    static const double still[3 * NODES];
    assert_ok(s->ctx, drape_sim_set_state(s->sim, drape_sim_time(s->sim), x, still));
}

/* The elastic energy, with what slides in it, of the positions x from the present state. */
static double energy_at(const scene *s, const double *x)
{
    static const double still[3 * NODES];
    return drape_sim_energy_of(s->sim, drape_sim_time(s->sim), x, still).elastic;
}

/* dE/dcurvature of the strip where it is rolled to. */
static double moment(const scene *s, double curvature)
{
    double low[3 * NODES], high[3 * NODES];
    roll(s, curvature - STEP, low);
    roll(s, curvature + STEP, high);
    return (energy_at(s, high) - energy_at(s, low)) / (2 * STEP);
}

/* The friction of one slider in units of curvature, and where it has slid. */
static double slide(double curvature, double *slid)
{
    const double k = FRICTION / BEGINS, force = k * (curvature - *slid);
    if (fabs(force) > FRICTION)
        *slid = curvature - copysign(BEGINS, force);
    return fmax(-FRICTION, fmin(FRICTION, force));
}

/* The moment of the strip is that of the elastic one plus the friction of a slider, in the same units, around
 * a loop: its height is 2 HB. Angles are exact, and the energy is quadratic but at the corners, where the
 * difference sees both sides: a quarter of the step times the stiffness of the slider. */
TEST(moments_go_around_the_loop)
{
    scene s = strip(HYSTERESIS, "", AT_REST), elastic = strip("", "", AT_REST);
    double x[3 * NODES], slid = 0, widest[2] = {0};
    for (int step = 1; step <= 50; step++) {
        const double curvature = step <= 10 ? step : step <= 30 ? 20 - step : step - 40;
        roll(&s, curvature, x);
        const double rigidity = moment(&elastic, 10) / 10, friction = slide(curvature, &slid);
        const double measured = (moment(&s, curvature) - moment(&elastic, curvature)) / rigidity;
        ck_assert_msg(fabs(measured - friction) < CORNER, "%g 1/m: %g, not %g", curvature, measured,
                      friction);
        widest[friction > 0] = fmax(widest[friction > 0], fabs(measured));
        move(&s, x);
    }
    assert_below(fabs(widest[0] + widest[1] - 2 * FRICTION), 2 * CORNER);
    scene_close(&s), scene_close(&elastic);
}

/* A fold of the curvature K springs back to (1 - hardening) (K - yield), in an equilibrium that is found to a
 * residual of 1e-10 N: 3e-6 rad here. */
TEST(creases_keep_their_fold)
{
    static const double folds[] = {20, 40, 60};
    for (size_t i = 0; i < sizeof folds / sizeof *folds; i++) {
        scoped_scene s =
            strip(CREASE, "{'edge': 'left', 'clamp': true}",
                  "'gravity': [0, 0, 0], 'integrator': {'method': 'static', 'tolerance': 1e-10}, "
                  "'duration': 1");
        double x[3 * NODES];
        roll(&s, folds[i], x);
        move(&s, x);
        scene_advance(&s, 1);
        const double *end = drape_sim_positions(s.sim), kept = fmax(0, folds[i] - YIELD);
        double turn = 0; /* from the first cell of the middle row to its last */
        for (size_t c = 1; c < COLUMNS - 1; c++) {
            const double *a = end + 3 * (2 * COLUMNS + c - 1), *b = a + 3, *d = b + 3;
            const double u[2] = {b[0] - a[0], b[1] - a[1]}, v[2] = {d[0] - b[0], d[1] - b[1]};
            turn += atan2(u[0] * v[1] - u[1] * v[0], u[0] * v[0] + u[1] * v[1]);
        }
        const double bent = LENGTH * (COLUMNS - 2) / (COLUMNS - 1);
        assert_below(fabs(turn - (1 - HARDENS) * kept * bent), 1e-4 * folds[i] * bent);
    }
}

/* ---- Shear ---- */

/* x += gamma z, all nodes: s = sin(atan gamma). */
static void shear(const scene *s, double sine, double *x)
{
    const double cosine = sqrt(1 - sine * sine);
    for (size_t i = 0; i < (size_t)s->model->node_count; i++) {
        const double *rest = s->model->rest + 3 * i;
        x[3 * i] = rest[0] + sine * rest[2];
        x[3 * i + 1] = 0;
        x[3 * i + 2] = cosine * rest[2];
    }
}

/* The force over the shear angle is that of the curve plus or minus HG. */
TEST(shear_goes_around_the_loop)
{
    const double stiffness = 30, friction = 1.5; /* [N/m] */
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 4, 'width': 0.1, "
        "'height': 0.1}, 'material': {'young_modulus': 1e6, 'thickness': 5e-4, 'areal_density': "
        "0.15, 'shear_curve': [[30, %.17g]]}, 'terms': [{'type': 'stretch.curve', "
        "'shear_friction': %g, 'friction_angle': 0.5}]}], " AT_REST "}",
        stiffness / 2, friction);
    double x[3 * 16], low[3 * 16], high[3 * 16];
    const double h = 1e-5, begins = sin(0.5 * acos(-1) / 180);
    double slid = 0;
    for (int step = 1; step <= 40; step++) {
        const double sine = 0.01 * (step <= 10 ? step : step <= 30 ? 20 - step : step - 40);
        shear(&s, sine, x), shear(&s, sine - h, low), shear(&s, sine + h, high);
        const double force = (energy_at(&s, high) - energy_at(&s, low)) / (2 * h * 0.01);
        if (fabs(sine - slid) > begins)
            slid = sine - copysign(begins, sine - slid);
        assert_below(fabs(force - stiffness * sine - friction * (sine - slid) / begins), 1e-6 * stiffness);
        move(&s, x);
    }
}

/* ---- In motion ---- */

#define FALL "'gravity': [0, -9.81, 0], 'integrator': %s, 'duration': 1"

static scene falling(const char *integrator)
{
    char members[256];
    snprintf(members, sizeof members, FALL, integrator);
    return strip(HYSTERESIS CREASE, "{'edge': 'left', 'clamp': true}", members);
}

/* What slides is dissipated, and nothing else is lost: methods whose own error is small agree on it, and keep
 * the balance to a per cent of it. The time is before the strip swings back. */
TEST(sliding_is_in_the_balance)
{
    static const char *const accurate[] = {"{'method': 'radau'}", "{'method': 'midpoint', 'dt': 0.002}",
                                           "{'method': 'verlet'}", "{'method': 'dirk'}"};
    double first = 0;
    for (size_t i = 0; i < sizeof accurate / sizeof *accurate; i++) {
        scoped_scene s = falling(accurate[i]);
        scene_advance(&s, 0.15);
        const drape_energy e = drape_sim_energy(s.sim);
        first = i == 0 ? e.dissipated : first;
        ck_assert_double_gt(e.dissipated, 0.02 * e.kinetic);
        assert_below(fabs(e.numerical), 0.02 * e.dissipated);
        assert_below(fabs(e.dissipated - first), 0.02 * first);
    }
}

typedef struct watched {
    const scene *s;
    double dissipated; /* of all accepted steps, from where sliders were and are */
    double *slid;      /* in the last accepted state */
    int rejected;
} watched;

/* Sliders are where they were until a step is accepted; then what they lose is their limit times the path. */
static drape_status follow(void *user, const drape_event *event)
{
    watched *w = user;
    const drape_term *bending = &w->s->model->terms[1];
    const size_t count = (size_t)bending->sliders * (size_t)bending->elements.count;
    const double *now = drape_sim_state(w->s->sim)->internal + bending->first_slider;
    if (event->kind != DRAPE_EVENT_ATTEMPT)
        return DRAPE_OK;
    if (!event->attempt->accepted) {
        w->rejected++;
        ck_assert_mem_eq(now, w->slid, count * sizeof *now);
        return DRAPE_OK;
    }
    for (size_t i = 0; i < count; i++)
        w->dissipated += bending->slider_limit[i] * fabs(now[i] - w->slid[i]);
    memcpy(w->slid, now, count * sizeof *now);
    return DRAPE_OK;
}

TEST(rejected_steps_move_no_slider)
{
    scoped_scene s = strip(HYSTERESIS CREASE, "{'edge': 'left', 'clamp': true}",
                           "'integrator': {'method': 'be', 'dt': 0.02}, 'controller': {'type': 'strain', "
                           "'max_move': 0.2}, 'duration': 1");
    const drape_term *bending = &s.model->terms[1];
    const size_t count = (size_t)bending->sliders * (size_t)bending->elements.count;
    watched w = {.s = &s, .slid = calloc(count, sizeof *w.slid)};
    ck_assert_ptr_nonnull(w.slid);
    ck_assert_int_eq(bending->sliders, 2);
    ck_assert_int_eq(drape_sim_observe(s.sim, follow, &w), DRAPE_OK);
    scene_advance(&s, 0.2);
    ck_assert_int_gt(w.rejected, 0);
    ck_assert_double_gt(w.dissipated, 0);
    /* sums in another order, of up to a thousand numbers a step */
    assert_below(fabs(drape_sim_energy(s.sim).dissipated - w.dissipated), 1e-12 * w.dissipated);
    free(w.slid);
}

/* A run that goes on from a checkpoint has the bits of one that was not interrupted. */
TEST(checkpoints_keep_sliders)
{
    static const char *const methods[] = {"{'method': 'be', 'dt': 0.01}",
                                          "{'method': 'bdf2', 'dt': 0.01}",
                                          "{'method': 'trbdf2', 'dt': 0.01}",
                                          "{'method': 'newton_k', 'dt': 0.01}",
                                          "{'method': 'ida'}",
                                          "{'method': 'verlet'}",
                                          "{'method': 'static'}"};
    for (size_t i = 0; i < sizeof methods / sizeof *methods; i++)
        scene_resumes(falling(methods[i]), falling(methods[i]), 0.06, 0.1, methods[i]);
}

/* Another model of the same cloth goes on with the sliders of the one before. */
TEST(a_new_model_keeps_sliders)
{
    scene s = falling("{'method': 'be', 'dt': 0.01}"), other = falling("{'method': 'be', 'dt': 0.01}");
    const drape_term *bending = &s.model->terms[1];
    const size_t size = (size_t)drape_term_slider_count(bending) * sizeof(double);
    scene_advance(&s, 0.1);
    double *slid = malloc(size);
    ck_assert_ptr_nonnull(slid);
    memcpy(slid, drape_sim_state(s.sim)->internal + bending->first_slider, size);
    other.model->gravity[1] = -1;
    ck_assert_int_eq(drape_sim_change_model(s.sim, other.model), DRAPE_OK);
    ck_assert_mem_eq(drape_sim_state(s.sim)->internal + other.model->terms[1].first_slider, slid, size);
    free(slid);
    scene_close(&s), scene_close(&other);
}

/* Every derivative, at a random state in which most sliders slip. */
TEST(derivatives_agree_with_differences)
{
    scoped_scene s =
        scene_model("{'drape': 1, 'cloth': [{'mesh': {'grid': 'irregular', 'columns': 5, 'rows': 5, 'width': "
                    "0.2, 'height': 0.2}, 'material': {'young_modulus': 1e5, 'thickness': 1e-3, "
                    "'areal_density': 0.2}, 'terms': [{'type': 'stretch.curve', 'shear_friction': 2, "
                    "'friction_angle': 1}, {'type': 'bend.midedge', 'poisson': 0" HYSTERESIS CREASE
                    "}]}], 'duration': 1}");
    scene_check_derivatives(&s);
}
