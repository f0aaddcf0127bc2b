/*
 * test_oscillator.c: one node as an exact oscillator. The centre of a hexagon of springs of constant K =
 * sqrt(3)/2 E h, pinned at the six corners, moves in the plane with stiffness K sum u u' = 3 K in every
 * direction. The lattice is symmetric about the centre, so the energy is even: there is no cubic term, and
 * with amplitude a = e L the motion is linear up to e^2.
 *
 * The centre is at the origin, so that its position keeps its digits. Strains, of size e, are known to 4
 * DBL_EPSILON, and residuals to r in forces of size 3 K a: relative errors of a step are
 * e^2 + 4 DBL_EPSILON/e + r/(3 K a).
 */
#include "support/scene.h"

#define LENGTH    0.1
#define MODULUS   1e6
#define THICKNESS 1e-3
#define STEPS     20

static const double stiffness = 3 * 0.8660254037844386 * MODULUS * THICKNESS; /* 3 K [N/m] */
enum { CENTRE = 4 };

/* Not yet watched, because a watched scene must stay at its address. */
static scene hexagon(double dt, double speed, double tolerance, const char *terms)
{
    const double centre[3] = {1.5 * LENGTH, 0, -0.8660254037844386 * LENGTH};
    return scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 2, 'edge_length': %g,"
                      "'transform': {'translate': [%.17g, 0, %.17g]}},"
                      "'material': {'young_modulus': %g, 'thickness': %g, 'areal_density': 0.2},"
                      "'terms': [%s 'stretch.edge'], 'velocity': [%.17g, 0, %.17g],"
                      "'pins': [{'nodes': [0, 1, 2, 3, 5, 6, 7, 8]}]}],"
                      "'gravity': [0, 0, 0], 'integrator': {'dt': %.17g, 'tolerance': %g}, 'duration': 1}",
                      LENGTH, -centre[0], -centre[2], MODULUS, THICKNESS, terms, 0.8 * speed, 0.6 * speed, dt,
                      tolerance);
}

static double mass(void)
{
    return 0.2 * sqrt(3.0) / 2 * LENGTH * LENGTH; /* a node of the lattice */
}

static double step_error(const scene *s, double amplitude)
{
    const double e = amplitude / LENGTH;
    const double noise = force_noise(stiffness / 3, LENGTH);
    return e * e + 4 * DBL_EPSILON / e + (s->residual + noise) / (stiffness * amplitude);
}

/* With a dashpot beside every spring, m a = -3 K (x + beta v): (x, v)_{n+1} = A (x, v)_n with
 *     v1 = (v0 - h w^2 x0)/c,   x1 = x0 + h v1,   c = 1 + h w^2 (h + beta),
 *     A = [1 - h^2 w^2/c, h/c; -h w^2/c, 1/c].
 * det A = 1/c, but the energy does not shrink by the same factor at all phases, so states are compared. */
TEST(damped_oscillator_follows_its_amplification_matrix)
{
    const double w = sqrt(stiffness / mass()), amplitude = 1e-5 * LENGTH;
    static const double phases[] = {0.1, 0.5, 2}; /* w h */
    static const double ratios[] = {0.3, 2.5};    /* w beta; above 2 it is overdamped */
    for (size_t k = 0; k < sizeof phases / sizeof *phases; k++)
        for (size_t j = 0; j < sizeof ratios / sizeof *ratios; j++) {
            char term[96];
            const double h = phases[k] / w, beta = ratios[j] / w;
            snprintf(term, sizeof term, "{'type': 'damp.kelvin_voigt', 'beta': %.17g},", beta);
            /* dashpots multiply the rounding of forces, 1e-13 N, by 1 + beta/h, up to 26 */
            scoped_scene s = hexagon(h, amplitude * w, 1e-11, term);
            scene_watch(&s);
            double x = 0, v = amplitude * w, worst = 0;
            for (int n = 1; n <= STEPS; n++) {
                scene_advance(&s, n * h);
                v = (v - h * w * w * x) / (1 + h * w * w * (h + beta));
                x += h * v;
                const double *now = scene_state(&s)->x + 3 * CENTRE;
                worst = fmax(worst, hypot(now[0] - 0.8 * x, now[2] - 0.6 * x) / amplitude);
                worst = fmax(worst, fabs(now[1]) / amplitude);
            }
            ck_assert_int_eq(s.accepted, STEPS); /* all of size h */
            /* Errors of steps add up, since A does not expand the energy norm; dashpots multiply forces by
             * up to 1 + beta/h. They are relative to the amplitude at the start. */
            assert_below(worst, STEPS * (1 + beta / h) * step_error(&s, amplitude));
        }
}
