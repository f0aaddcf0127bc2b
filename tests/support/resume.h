/* resume.h: that a run goes on from a checkpoint with the bits of one that was not interrupted. */
#ifndef DRAPE_TESTS_RESUME_H
#define DRAPE_TESTS_RESUME_H

#include "support/bytes.h"
#include "support/scene.h"

/* Advances `straight` to the time of the checkpoint and to the end, and `again`, a sim of the same scene,
 * from that checkpoint to the end. Both are closed. what: names the case in a failure. */
static inline void scene_resumes(scene straight, scene again, double checkpoint, double end, const char *what)
{
    scene_advance(&straight, checkpoint);
    bytes saved = bytes_save(straight.sim);
    scene_advance(&straight, end);
    ck_assert_int_eq(drape_sim_restore_from(again.sim, saved.data, saved.size), DRAPE_OK);
    scene_advance(&again, end);
    ck_assert_msg(drape_state_hash(straight.model, drape_sim_state(straight.sim)) ==
                      drape_state_hash(again.model, drape_sim_state(again.sim)),
                  "%s", what);
    ck_assert_double_eq(drape_sim_energy(straight.sim).dissipated, drape_sim_energy(again.sim).dissipated);
    double works[2];
    for (int i = 0; drape_sim_work(straight.sim, i, &works[0]); i++) {
        ck_assert_ptr_nonnull(drape_sim_work(again.sim, i, &works[1]));
        ck_assert_double_eq(works[0], works[1]);
    }
    free(saved.data);
    scene_close(&straight), scene_close(&again);
}

#endif
