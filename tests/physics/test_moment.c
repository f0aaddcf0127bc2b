/* test_moment.c: the potential of load.moment against quaternions. A strip that it winds up is a reference of
 * `drape validate`: end_moment. */
#include "support/scene.h"

#define MOMENT 0.3 /* [N m/m] */
#define SIDE   0.8 /* [m] */

/* The direction of the side x = SIDE as its triangle runs along it. */
static void side_direction(const drape_model *m, double e[3])
{
    for (int32_t i = 0; i < 3 * m->triangle_count; i++) {
        const int32_t a = m->triangle[i], b = m->triangle[i % 3 == 2 ? i - 2 : i + 1];
        if (m->rest[3 * a] < 0.999 * SIDE || m->rest[3 * b] < 0.999 * SIDE)
            continue;
        double length = 0;
        for (int k = 0; k < 3; k++) {
            e[k] = m->rest[3 * b + k] - m->rest[3 * a + k];
            length += e[k] * e[k];
        }
        for (int k = 0; k < 3; k++)
            e[k] /= sqrt(length);
        return;
    }
    ck_abort_msg("no side");
}

/* q: vector, scalar. */
static void turn(const double q[4], const double *x, double *out)
{
    const double a[3] = {q[1] * x[2] - q[2] * x[1] + q[3] * x[0], q[2] * x[0] - q[0] * x[2] + q[3] * x[1],
                         q[0] * x[1] - q[1] * x[0] + q[3] * x[2]};
    out[0] = x[0] + 2 * (q[1] * a[2] - q[2] * a[1]);
    out[1] = x[1] + 2 * (q[2] * a[0] - q[0] * a[2]);
    out[2] = x[2] + 2 * (q[0] * a[1] - q[1] * a[0]);
}

/* A sheet that is rotated about any axis by any angle below pi has the energy M L 2 atan2(q . e0, q_w) and
 * no other. Positions of size 1 and unit vectors of triangles of size 0.4 are exact up to a few roundings. */
TEST(the_potential_is_the_twist_of_the_quaternion)
{
    static const double axes[][3] = {{0, 0, 1},     {0, 0, -1},       {1, 0, 0},
                                     {0.6, 0, 0.8}, {0.3, -0.5, 0.7}, {-0.2, 0.9, 0.4}};
    static const double angles[] = {1e-6, 0.4, 1.5, 2.2, 3.1};
    scoped_scene s =
        scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 3, 'rows': 3, 'width': %g, "
                   "'height': %g, 'orientation': 'horizontal'}, 'material': {'young_modulus': 1, "
                   "'thickness': 1, 'areal_density': 1}, 'terms': [{'type': "
                   "'load.moment', 'edge': 'right', 'moment': %g}]}], 'gravity': [0, 0, 0], 'duration': 1}",
                   SIDE, SIDE, MOMENT);
    double e[3], x[27], v[27] = {0};
    ck_assert_int_eq(s.model->node_count, 9);
    side_direction(s.model, e);
    for (size_t i = 0; i < sizeof axes / sizeof *axes; i++)
        for (size_t j = 0; j < sizeof angles / sizeof *angles; j++) {
            const double *w = axes[i], norm = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]),
                         sine = sin(angles[j] / 2) / norm;
            const double q[4] = {sine * w[0], sine * w[1], sine * w[2], cos(angles[j] / 2)};
            for (int k = 0; k < 9; k++)
                turn(q, s.model->rest + 3 * k, x + 3 * k);
            ck_assert_int_eq(drape_sim_set_state(s.sim, 0, x, v), DRAPE_OK);
            const double twist = 2 * atan2(q[0] * e[0] + q[1] * e[1] + q[2] * e[2], q[3]);
            const drape_energy energy = drape_sim_account(s.sim);
            ck_assert_double_eq_tol(energy.gravity + energy.elastic, MOMENT * SIDE * twist,
                                    1e3 * DBL_EPSILON);
        }
}
