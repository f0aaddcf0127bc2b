/* read_seams.c: what seams carry. */
#include "base/vec3.h"
#include "sim/sim.h"

#include <math.h>
#include <string.h>

int32_t drape_sim_seam(drape_sim *sim, int32_t index, drape_seam_report *out)
{
    const int32_t count = sim ? sim->model->seam_count : 0;
    if (!out || index < 0 || index >= count)
        return count;
    const drape_model *m = sim->model;
    const drape_model_seam *seam = &m->seams[index];
    const drape_state *now = drape_sim_state(sim);
    const drape_point point = {.x = now->x, .v = now->v, .internal = now->internal, .t = now->t};
    *out = (drape_seam_report){.name = seam->name,
                               .type = m->terms[seam->term].ops->entry.name,
                               .cloth = {seam->cloth[0], seam->cloth[1]},
                               .pairs = seam->pair_count,
                               .node = -1};
    memset(sim->query_scratch, 0, 3 * (size_t)m->node_count * sizeof *sim->query_scratch);
    drape_system_term(sim->system, seam->term, &point, NULL, sim->query_scratch, NULL);
    for (int32_t i = 0; i < seam->pair_count; i++) {
        const int32_t *node = seam->pair + 2 * (size_t)i;
        double d[3];
        vec3_sub(now->x + 3 * (size_t)node[1], now->x + 3 * (size_t)node[0], d);
        const double gap = vec3_norm(d);
        out->gap_mean += gap / seam->pair_count;
        out->gap_max = fmax(out->gap_max, gap);
    }
    /* the force of the seam's term, with the sign of a gradient */
    for (int32_t i = 0; i < seam->pair_count; i++) {
        const int32_t node = seam->pair[2 * (size_t)i];
        const double *on = sim->query_scratch + 3 * (size_t)node, size = vec3_norm(on);
        vec3_add_scaled(-1, on, out->force);
        out->tension += size;
        if (i == 0 || size > out->tension_max) {
            out->tension_max = size;
            out->node = node;
        }
    }
    return count;
}
