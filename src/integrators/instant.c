/* instant.c: see instant.h. */
#include "integrators/instant.h"

#include <math.h>

/* Within the span the velocity of anything that moves is that at any time, such as the middle. */
static double middle_of(const double span[2])
{
    return (span[0] + span[1]) / 2;
}

void drape_instant_place_pins(const drape_motion *motion, double t, const double span[2], double *x,
                              double *v)
{
    drape_motion_place_pins(motion, t, x);
    for (int32_t i = 0; i < motion->moved_count; i++)
        drape_motion_pin_velocity(motion, i, t, middle_of(span), v + 3 * (size_t)motion->moved_node[i]);
}

void drape_instant_diagnose(drape_system *system, const double *x, const double *internal, const double *g,
                            double *scratch, drape_step_info *info)
{
    const drape_model *m = drape_system_model(system);
    for (int64_t i = 0; i < 3 * (int64_t)m->free_count; i++)
        scratch[i] = g[3 * (int64_t)m->node_of_free[i / 3] + i % 3];
    info->diagnostic = drape_system_diagnose_dof(system, scratch, "force [N]", INFINITY);
    drape_system_check(system, x, NULL, internal, &info->reason, &info->diagnostic);
}

static double power_of_colliders(const drape_system *system, const drape_point *point)
{
    return drape_motion_collider_power(drape_system_motion(system), drape_system_on_colliders(system),
                                       point->t, middle_of(point->span));
}

double drape_instant_dissipation(drape_system *system, const drape_point *point, double time, double *g)
{
    const double work = drape_system_dissipation(system, point, time, g);
    return work + time * drape_ranks_sum(drape_model_ranks(drape_system_model(system)),
                                         power_of_colliders(system, point));
}

void drape_instant_driving(const drape_system *system, const drape_point *point, const double *g, double time,
                           double *work)
{
    const drape_motion *motion = drape_system_motion(system);
    double power = drape_system_support_power(system, NULL, middle_of(point->span));
    for (int32_t i = 0; i < motion->moved_count; i++)
        for (size_t k = 0, at = 3 * (size_t)motion->moved_node[i]; k < 3; k++)
            if (drape_model_owns(drape_system_model(system), motion->moved_node[i]))
                power += g[at + k] * point->v[at + k];
    work[DRAPE_BY_PINS] += time * power;
    work[DRAPE_BY_COLLIDERS] += time * power_of_colliders(system, point);
}
