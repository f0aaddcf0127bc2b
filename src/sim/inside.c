/* inside.c: how much of the cloth is inside a collider, for scenes that start with cloth inside. */
#include "sim/sim.h"

#include "base/vec3.h"
#include "colliders/colliders.h"

#include <math.h>
#include <string.h>

#define ACROSS 6    /* parts of a side: 28 points of a face are tested */
#define TOUCH  1e-9 /* [m] a point less deep than this is not inside: contact allows it */

static double deepest_of(const drape_collider *collider, const drape_collider_pose *pose, const double *x,
                         const int32_t *node)
{
    double deepest = 0;
    for (int a = 0; a <= ACROSS; a++)
        for (int b = 0; a + b <= ACROSS; b++) {
            const double share[3] = {(double)(ACROSS - a - b) / ACROSS, (double)a / ACROSS,
                                     (double)b / ACROSS};
            double point[3] = {0, 0, 0};
            for (int k = 0; k < 3; k++)
                vec3_add_scaled(share[k], x + 3 * (size_t)node[k], point);
            deepest = fmax(deepest, -drape_collider_distance(collider, pose, point, NULL, NULL));
        }
    return deepest;
}

int32_t drape_sim_inside(const drape_sim *sim, int32_t collider, double *deepest)
{
    int32_t count = 0;
    double most = 0;
    if (!sim || collider < 0 || collider >= sim->model->collider_count)
        return -1;
    const drape_model *m = sim->model;
    const drape_collider_motion motion = drape_sim_collider(sim, collider);
    drape_collider_pose pose = {{0}, {0}};
    memcpy(pose.displacement, motion.displacement, sizeof pose.displacement);
    for (int32_t f = 0; f < m->triangle_count; f++) {
        double depth =
            deepest_of(&m->colliders[collider], &pose, drape_sim_positions(sim), m->triangle + 3 * (size_t)f);
        count += depth > TOUCH;
        most = fmax(most, depth);
    }
    if (deepest)
        *deepest = most;
    return count;
}
