/*
 * test_friction.c: Coulomb's law against closed forms. A sheet on a plane has the same pressure everywhere,
 * so it moves as one body: it sticks, creeps as the smoothing predicts, stops where the
 * integrator's own recurrence predicts, and is carried along by a moving collider. A strip over a post
 * shows exp(mu angle). The energy audit reports the work of friction and of moving colliders.
 */
#include "base/vec3.h"
#include "contact/barrier.h"
#include "contact/pair.h"
#include "support/scene.h"

#include <unistd.h>

#define GRAVITY 9.81
#define SIGMA   0.2   /* [kg/m2] */
#define WIDTH   0.3   /* [m] of the sheet */
#define HEIGHT  0.2   /* [m] */
#define EPS     1e-3  /* [m/s] friction_velocity, its default */
#define TOL     1e-10 /* [N] of Newton */
#define RTOL    1e-7  /* of ida */

typedef struct sliding {
    const char *method;
    double dt, mu, slope; /* [s], [1], tan of the plane's angle with the horizon; the plane falls along x */
    double velocity;      /* [m/s] down the slope at t = 0 */
    const char *contact, *collider; /* more settings, each after a comma */
} sliding;

/* The gap at which the barrier carries the weight: -K A b'(s) = m g cos a. It is the same for all nodes,
 * since both mass and contact area are proportional to the area. b' rises from -inf to 0 at s = 1. */
static double resting_gap(const drape_model *m, double g)
{
    const double wanted = SIGMA * g / m->contact.stiffness;
    double low = DRAPE_LEAST_GAP, high = 1;
    for (int i = 0; i < 200; i++) {
        const double s = (low + high) / 2;
        *(-drape_barrier_at(s, DRAPE_LEAST_GAP).db > wanted ? &low : &high) = s;
    }
    return low * m->contact.distance;
}

/* A sheet of 4 x 3 nodes on a plane through the origin, in the equilibrium of its gap. */
static scene open_sliding(const sliding *p)
{
    const double c = 1 / hypot(1, p->slope), s = p->slope * c, degrees = atan(p->slope) * 180 / acos(-1.0);
    scene on = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 3, 'width': %g, 'height': "
        "%g,"
        " 'transform': {'rotate': [0, 0, 1, %.17g]}}, 'velocity': [%.17g, %.17g, 0],"
        " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge']}],"
        " 'gravity': [0, %g, 0], 'contact': {'friction_velocity': %g%s},"
        " 'colliders': [{'type': 'plane', 'point': [0,0,0], 'normal': [%.17g, %.17g, 0], 'friction': %g,"
        " 'restitution': 1%s}],"
        " 'integrator': {'method': '%s', 'dt': %g, 'tolerance': %g, 'rtol': %g}, 'duration': 1}",
        WIDTH, HEIGHT, -degrees, p->velocity * c, -p->velocity * s, -GRAVITY, EPS,
        p->contact ? p->contact : "", s, c, p->mu, p->collider ? p->collider : "", p->method, p->dt, TOL,
        RTOL);
    const double gap = resting_gap(on.model, GRAVITY * c);
    drape_state *state = scene_state(&on);
    for (int32_t i = 0; i < on.model->node_count; i++) {
        state->x[3 * i] += gap * s;
        state->x[3 * i + 1] += gap * c;
    }
    drape_sim_reset_energy(on.sim);
    return on;
}

static double mass_of(const scene *s)
{
    double sum = 0;
    for (int32_t i = 0; i < s->model->node_count; i++)
        sum += s->model->mass[i];
    return sum;
}

/* The component of node i down the slope. */
static double along(const sliding *p, const double *of, int32_t i)
{
    const double c = 1 / hypot(1, p->slope);
    return (of[3 * i] - p->slope * of[3 * i + 1]) * c;
}

/* The mean over the nodes; asserts that no node differs from it by more than `spread`. */
static double mean_along(const sliding *p, const scene *s, const double *of, double spread)
{
    double mean = 0;
    const int32_t n = s->model->node_count;
    for (int32_t i = 0; i < n; i++)
        mean += along(p, of, i) / n;
    for (int32_t i = 0; i < n && spread < INFINITY; i++)
        ck_assert_msg(fabs(along(p, of, i) - mean) <= spread, "%s: node %d: %.12g, mean %.12g", p->method,
                      (int)i, along(p, of, i), mean);
    return mean;
}

static double slide_of(const sliding *p, scene *s, double t)
{
    const double before = mean_along(p, s, drape_sim_positions(s->sim), INFINITY);
    scene_advance(s, t);
    return mean_along(p, s, drape_sim_positions(s->sim), INFINITY) - before;
}

static const char *const methods[] = {"be",  "bdf2",       "midpoint", "trbdf2",
                                      "ida", "rosenbrock", "dirk",     "radau"};
#define METHODS (sizeof methods / sizeof *methods)

/* Whether a method bounds the errors of its steps, not residuals. */
static bool bounds_errors(const char *method)
{
    for (int i = 0; drape_integrators[i]; i++)
        if (strcmp(drape_integrators[i]->entry.name, method) == 0)
            return drape_integrators[i]->own_steps;
    return false;
}

/* It bounds the error of a step in a norm over 2 n unknowns: one of them may have all of it. */
static double error_velocity(const scene *s)
{
    return sqrt(2.0 * 3 * s->model->node_count) * RTOL * sqrt(GRAVITY * s->model->length);
}

/* ---- Sticking and sliding ---- */

/* At rest except for the creep, f(u/eps) = tan a/mu with f(y) = 2 y - y^2. The velocity converges to it as
 * exp(-t/tau), tau = eps/(2 mu g cos a (1 - y)) = 0.15 to 1.1 ms; 100 ms at 1 ms leave (1/(1 + h/tau))^100
 * with be, 0.55^100 with midpoint: nothing. A residual r is an error r/(m g cos a mu f'/eps) of the
 * velocity. */
TEST(sticks_but_for_its_creep)
{
    static const double shares[] = {0.5, 0.99};
    for (size_t k = 0; k < METHODS; k++)
        for (int i = 0; i < 4; i++) {
            const sliding p = {.method = methods[k],
                               .dt = 1e-3,
                               .mu = 0.5,
                               .slope = 0.5 * shares[i % 2],
                               .contact = i / 2 ? ", 'friction': 'lagged'" : ""};
            scoped_scene s = open_sliding(&p);
            const double y = 1 - sqrt(1 - p.slope / p.mu), weight = GRAVITY / hypot(1, p.slope);
            const double slope = scene_min_mass(&s) * weight * p.mu * 2 * (1 - y) / EPS;
            /* residuals also tilt the sheet and change its gap: an error of the normal force of the same
             * size */
            const double bound =
                bounds_errors(methods[k]) ? error_velocity(&s) : 4 * TOL / slope + 1e-9 * EPS;
            scene_advance(&s, 0.1);
            const double v = mean_along(&p, &s, drape_sim_velocities(s.sim), bound);
            printf("# %s, tan a / mu = %g%s: creep %.9g of %.9g m/s\n", p.method, p.slope / p.mu, p.contact,
                   v, y * EPS);
            assert_below(fabs(v - y * EPS), bound);
        }
}

/* ---- How far it slides ---- */

/* x_n of the integrators for x'' = -a from v0. be: v0 t - a h^2 n (n + 1)/2. bdf2 is exact on parabolas,
 * but its first step is be's: e_1 = -a h^2/2 and e_{n+1} = (4 e_n - e_{n-1})/3, so e_n = 3/2 e_1 (1 -
 * 3^-n). The others are exact on parabolas. */
static double slide_by_recurrence(const char *method, double v0, double a, double h, int n)
{
    const double t = n * h, exact = v0 * t - a * t * t / 2;
    if (strcmp(method, "be") == 0)
        return v0 * t - a * h * h * n * (n + 1) / 2;
    return strcmp(method, "bdf2") == 0 ? exact - 0.75 * a * h * h * (1 - pow(3, -n)) : exact;
}

TEST(slides_as_far_as_it_should)
{
    const int n = 25;
    for (size_t k = 0; k < METHODS; k++)
        for (int lagged = 0; lagged < 2; lagged++) {
            const sliding p = {.method = methods[k],
                               .dt = 0.01,
                               .mu = 0.3,
                               .velocity = 1,
                               .contact = lagged ? ", 'friction': 'lagged'" : ""};
            const double a = p.mu * GRAVITY, wanted = slide_by_recurrence(p.method, p.velocity, a, p.dt, n);
            scoped_scene s = open_sliding(&p);
            const double before = drape_sim_energy(s.sim).kinetic, m = mass_of(&s);
            const double got = slide_of(&p, &s, n * p.dt);
            const drape_energy e = drape_sim_energy(s.sim);
            const drape_statistics did = drape_sim_statistics(s.sim);
            printf("# %s%s: %.9g m of %.9g m, off by %.2g; dissipated %.9g J, numerical %.3g J\n", p.method,
                   p.contact, got, wanted, got / wanted - 1, e.dissipated, e.numerical);
            ck_assert(did.steps_rejected == 0 || bounds_errors(p.method));
            assert_below(fabs(got / wanted - 1), 1e-5);
            /* mu m g s: exact for step methods; ida integrates it by the trapezoidal rule, which is exact
             * for a constant force */
            assert_below(fabs(e.dissipated / (p.mu * m * GRAVITY * got) - 1), 1e-5);
            /* be itself loses m |dv|^2/2 a step, midpoint nothing */
            const double own = strcmp(p.method, "be") == 0 ? n * m * a * a * p.dt * p.dt / 2 : 0;
            if (k == 0 || strcmp(p.method, "midpoint") == 0)
                assert_below(fabs(e.numerical - own), 1e-6 * before);
        }
}

/* ---- Moving colliders ---- */

/* A plate that starts to move at U carries the sheet along: both have slid m U^2/(2 mu m g) on each other
 * when they have the same velocity, and then only the decay of the smoothing is left, at most 0.66 a step
 * with midpoint. The plate's work is m U^2, half of it heat. Midpoint's audit agrees except for the step in
 * which sliding ends, which may slide by an h too far or not far enough: (a h/U)^2. */
TEST(a_plate_carries_the_sheet)
{
    const double speed = 0.2, t = 0.1;
    for (size_t k = 0; k < METHODS; k++) {
        const sliding p = {.method = methods[k],
                           .dt = 1e-3,
                           .mu = 0.5,
                           .collider = ", 'track': [[0, [0,0,0]], [1, [0.2,0,0]]]"};
        scoped_scene s = open_sliding(&p);
        const double a = p.mu * GRAVITY, m = mass_of(&s), got = slide_of(&p, &s, t);
        const double v = mean_along(&p, &s, drape_sim_velocities(s.sim), 1e-6);
        const drape_energy e = drape_sim_energy(s.sim);
        const double kinetic = m * speed * speed / 2;
        printf("# %s: velocity %.9g, slid %.6g m, dissipated/(m U^2/2) = %.5g, numerical/ = %.3g\n", p.method,
               v, got, e.dissipated / kinetic, e.numerical / kinetic);
        assert_below(fabs(v - speed), bounds_errors(p.method) ? error_velocity(&s) : 1e-7);
        assert_below(fabs(got - (speed * t - speed * speed / (2 * a))), speed * p.dt + EPS * t);
        /* be and bdf2 use the velocity of the end of a step for the whole step: h/(U/a) more or less */
        const double share = a * p.dt / speed;
        assert_below(fabs(e.dissipated / kinetic - 1),
                     strcmp(p.method, "midpoint") == 0 ? 4 * share * share : 2 * share);
        if (strcmp(p.method, "midpoint") == 0)
            assert_below(fabs(e.numerical), 1e-6 * kinetic);
    }
}

/* A plate that rises at U under the sheet kicks it and does work on it: mostly m g U t. The numerical part
 * of midpoint is its error in the energy of the barrier, whose frequency w = 1e3/s gives (w h)^2/24 of the
 * kick's m (2 U)^2/2. */
TEST(a_rising_plate_does_work)
{
    for (size_t k = 0; k < METHODS; k++) {
        const double speed = 0.1, t = 0.1, h = 1e-4;
        const sliding p = {.method = methods[k],
                           .dt = h,
                           .mu = 0.5,
                           .collider = ", 'track': [[0, [0,0,0]], [1, [0,0.1,0]]]"};
        scoped_scene s = open_sliding(&p);
        const double m = mass_of(&s), start = drape_sim_energy(s.sim).gravity;
        scene_advance(&s, t);
        const drape_energy e = drape_sim_energy(s.sim);
        const double lifted = e.gravity - start, work = m * GRAVITY * speed * t;
        printf("# %s: lifted %.6g J of %.6g J, kinetic %.3g, numerical %.3g J\n", p.method, lifted, work,
               e.kinetic, e.numerical);
        const double kick = m * 4 * speed * speed / 2;
        if (strcmp(p.method, "midpoint") == 0)
            assert_below(fabs(e.numerical), 0.01 * kick);
        /* for all integrators the numerical loss is that of the kick */
        ck_assert_msg(e.numerical > -0.05 * kick && e.numerical < 1.05 * kick, "%s: %g J", p.method,
                      e.numerical);
        ck_assert(lifted > work - m * GRAVITY * 1e-4 && lifted < work + kick);
    }
}

/* ---- The capstan ---- */

#define POST    0.1  /* [m] radius */
#define TURNS   48   /* edges of the strip on the half circle */
#define LEG     16   /* edges of the strip that hang down on either side */
#define REACH   2e-4 /* [m] activation distance */
#define BROAD   0.01 /* [m] */
#define STATION (TURNS + 2 * LEG + 1)

/* A strip of two nodes across that hangs down on both sides of a post, at the distance REACH from it. */
static void write_strip(const char *path)
{
    FILE *file = fopen(path, "w");
    const double r = POST + REACH, pi = acos(-1.0), step = pi * r / TURNS;
    ck_assert_ptr_nonnull(file);
    for (int i = 0; i < STATION; i++)
        for (int side = 0; side < 2; side++) {
            const int k = i < LEG ? 0 : i > LEG + TURNS ? TURNS : i - LEG;
            const int below = i < LEG ? LEG - i : i > LEG + TURNS ? i - LEG - TURNS : 0;
            fprintf(file, "v %.17g %.17g %.17g\n", -r * cos(pi * k / TURNS),
                    r * sin(pi * k / TURNS) - step * below, (side - 0.5) * BROAD);
        }
    for (int i = 0; i + 1 < STATION; i++) {
        const int a = 2 * i + 1;
        if (i % 2)
            fprintf(file, "f %d %d %d\nf %d %d %d\n", a, a + 1, a + 3, a, a + 3, a + 2);
        else
            fprintf(file, "f %d %d %d\nf %d %d %d\n", a, a + 1, a + 2, a + 1, a + 3, a + 2);
    }
    fclose(file);
}

/* The force of the strip on two pins [N]. */
static double pull_at(scene *s, int32_t first)
{
    double g[3 * 2 * STATION];
    const drape_state *at = drape_sim_state(s->sim);
    const drape_point point = {.x = at->x, .v = at->v, .internal = at->internal, .t = at->t};
    drape_system_force(s->sim->system, &point, g);
    return g[3 * first + 1] + g[3 * first + 3 + 1];
}

/* The strip is pulled slowly at one end, and all of it slides towards that end, faster than eps. A node
 * that turns by 2 b = pi/48 between tensions at the angle b with its tangent has T2/T1 = (1 + mu tan b)/(1
 * - mu tan b), which is exp(2 mu b) except for a share 2 mu b (1 + mu^2) b^2/3: mu pi b^2 (1 + mu^2)/3 =
 * 4e-4 in all. At the ends of the arc a node turns by an angle between 0 and 2 b, on one side of its
 * normal: cos 2 b, 2 b^2 = 2e-3 each. The legs start REACH further out than the strip lies, an angle of
 * REACH/leg = 2e-3 each, times mu. Lagged friction is that of the pressures one step ago. These have grown
 * in proportion to the time, except for a tenth: by h/t. */
TEST(a_capstan_holds_by_its_angle)
{
    static const double mus[] = {0.1, 0.3, 0.5};
    char folder[] = "/tmp/drape-capstan-XXXXXX", path[64];
    ck_assert_ptr_nonnull(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/strip.obj", folder);
    write_strip(path);
    for (int i = 0; i < 6; i++) {
        const double mu = mus[i % 3], b = acos(-1.0) / TURNS / 2, leg = LEG * acos(-1.0) * POST / TURNS;
        scoped_scene s = scene_open(
            "{'drape': 1, 'cloth': [{'mesh': {'file': '%s'}, 'terms': ['stretch.edge'],"
            " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'areal_density': 0.01},"
            " 'pins': [{'nodes': [0, 1]}, {'nodes': [%d, %d], 'track': [[0, [0,0,0]], [1, [0,-0.04,0]]]}]}],"
            " 'gravity': [0,0,0], 'colliders': [{'type': 'cylinder', 'a': [0,0,-1], 'b': [0,0,1], 'radius': "
            "%g,"
            " 'friction': %g}], 'contact': {'distance': %g, 'stiffness': 2e3, 'friction_velocity': 1e-4,"
            " 'friction': '%s'}, 'integrator': {'dt': 0.01, 'tolerance': 1e-9}, 'duration': 1}",
            path, 2 * STATION - 2, 2 * STATION - 1, POST, mu, REACH, i / 3 ? "lagged" : "implicit");
        scene_advance(&s, 1);
        const double slack = pull_at(&s, 0), taut = pull_at(&s, 2 * STATION - 2),
                     wanted = exp(mu * acos(-1.0));
        printf("# mu %g: %.6g N against %.6g N, ratio %.6g of %.6g, %lld rejected\n", mu, taut, slack,
               taut / slack, wanted, (long long)drape_sim_statistics(s.sim).steps_rejected);
        assert_below(fabs(taut / slack / wanted - 1),
                     mu * acos(-1.0) * (b * b * (1 + mu * mu) / 3 + (i / 3 ? 1.1 * 0.01 : 0)) + 4 * b * b +
                         2 * mu * REACH / leg);
    }
    ck_assert_int_eq(unlink(path) + rmdir(folder), 0);
}
