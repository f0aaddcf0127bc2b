/*
 * dense.c: dense output. A step of size h gives x and v at both of its ends, up to the error of the method,
 * O(h^p) for order p. Between them, positions are the cubic Hermite polynomial of these four vectors, whose
 * error is h^4/384 |x''''|: no more than the error of any method of an order up to 4. For those of order 1
 * and 2, velocities are linear between both ends, with an error of h^2/8 |v''|: of their own order, too. The
 * slope of the positions would contain the overshoot of steps that do not resolve the motion. From order 3
 * on velocities are that slope, with an error of O(h^3). A method of a higher order has dense output of its
 * own.
 */
#include "sim/dense.h"

#include "model/support.h"

#include <string.h>

#define SLOPE_ORDER 3 /* methods of this order and above have the slope of the positions as velocities */

static void hermite(const drape_state *a, const drape_state *b, double t, size_t n, double *x)
{
    double h = b->t - a->t, s = (t - a->t) / h;
    double h00 = (1 + 2 * s) * (1 - s) * (1 - s), h10 = s * (1 - s) * (1 - s);
    double h01 = s * s * (3 - 2 * s), h11 = s * s * (s - 1);
    for (size_t i = 0; i < n; i++)
        x[i] = h00 * a->x[i] + h10 * h * a->v[i] + h01 * b->x[i] + h11 * h * b->v[i];
}

static void hermite_slope(const drape_state *a, const drape_state *b, double t, size_t n, double *v)
{
    double h = b->t - a->t, s = (t - a->t) / h;
    double d01 = 6 * s * (1 - s) / h, d10 = (1 - s) * (1 - 3 * s), d11 = s * (3 * s - 2);
    for (size_t i = 0; i < n; i++)
        v[i] = d01 * (b->x[i] - a->x[i]) + d10 * a->v[i] + d11 * b->v[i];
}

static void linear(const drape_state *a, const drape_state *b, double t, size_t n, double *v)
{
    double s = (t - a->t) / (b->t - a->t);
    for (size_t i = 0; i < n; i++)
        v[i] = (1 - s) * a->v[i] + s * b->v[i];
}

void drape_sim_dense_positions(drape_sim *sim, const drape_state *from, const drape_state *to, double t,
                               double *x)
{
    const size_t n = 3 * (size_t)sim->model->node_count;
    if (sim->chosen.integrator->interpolate) {
        memcpy(x, to->x, n * sizeof *x);
        sim->chosen.integrator->interpolate(sim->integrator, t, x);
        if (sim->model->supports_move)
            drape_supports_hold(drape_system_motion(sim->system), from->t, from->x, t, x);
        return;
    }
    hermite(from, to, t, n, x);
    if (sim->model->supports_move)
        drape_supports_hold(drape_system_motion(sim->system), from->t, from->x, t, x);
    drape_motion_place_pins(drape_system_motion(sim->system), t, x);
}

void drape_sim_dense_velocities(drape_sim *sim, const drape_state *from, const drape_state *to, double t,
                                double *v)
{
    const drape_integrator_ops *integrator = sim->chosen.integrator;
    const size_t n = 3 * (size_t)sim->model->node_count;
    (integrator->order >= SLOPE_ORDER ? hermite_slope : linear)(from, to, t, n, v);
    if (!integrator->interpolate_velocities)
        return;
    integrator->interpolate_velocities(sim->integrator, t, v);
    if (sim->model->supports_move)
        drape_supports_hold_velocity(drape_system_motion(sim->system), (const double[]){from->t, to->t}, true,
                                     v);
}
