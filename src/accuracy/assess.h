/*
 * assess.h: how far a run is from the motion that its scene describes, in time and in space, and until when
 * that motion is predictable. The run is made again with a start that differs by a millionth of the size,
 * with finer steps, and on a finer mesh, and compared at every frame (geometry/deviation.h); the last two
 * only as far as the motion is predictable, since after that nothing is right or wrong.
 *
 * From a run with half of its steps or edges, a run of order p is away by 1 - 2^-p of its error. One
 * refinement does not show p: it is 2 at most, and 1 or less where contacts change, at pins of single nodes
 * and at folds. The estimate, sqrt(2) times the distance, is within a factor of 2 of the error for every p
 * from 0.63 on, and for a tenth of a tolerance, which leaves a tenth to a third of the error.
 */
#ifndef DRAPE_ACCURACY_ASSESS_H
#define DRAPE_ACCURACY_ASSESS_H

#include "sim/sim.h"

#define DRAPE_ASSESS_COST  12   /* times the CPU time of the run, that all runs take at most, */
#define DRAPE_ASSESS_LEAST 1.0  /* [s] or this much more than it */
#define DRAPE_ASSESS_START 1e-6 /* of a diagonal: six digits, as mesh files have */

enum { DRAPE_ASSESS_BY_START, DRAPE_ASSESS_BY_TIME, DRAPE_ASSESS_BY_MESH, DRAPE_ASSESS_RUNS };

typedef struct drape_assessment {
    char method[128]; /* of the run: "be, dt 0.0167" */
    double seconds;   /* CPU time of the run and, if its scene asks for an accuracy, of those before it */
    uint64_t hash;    /* of its end, as drape_sim_hash */
    double
        within; /* [1] of a diagonal: what is asked of the run, or 1e-2; further apart, motions have parted */
    double until; /* [s] until then the motion is predictable; the end of the run, if that is not known */
    /* What each other run shows: the error of the run by estimate or, of the start, how far they are apart.
     * It is known until its own time, NaN: for no time, and has `reached` the time above, or `why` says what
     * came in between. `seconds` are of CPU time. */
    drape_accuracy by[DRAPE_ASSESS_RUNS];
    char why[DRAPE_ASSESS_RUNS][DRAPE_MESSAGE_SIZE];
} drape_assessment;

/* Called before each run with its sim, to which observers may be added. number: which of the others it is,
 * -1: none. A status other than 0 ends all, and is returned. */
typedef drape_status drape_assess_prepare(void *user, drape_sim *sim, int number,
                                          const drape_assessment *so_far);

/* fine: the same scene with all meshes subdivided once more. def: threads and the like; its method is
 * replaced. The start of the model is another one during the call. Errors: DRAPE_E_ARGUMENT
 * (drape_accuracy_check_runs), DRAPE_E_STOPPED, DRAPE_E_MEMORY, those of the run itself and of prepare. */
drape_status drape_assess(drape_context *ctx, drape_model *model, const drape_model *fine,
                          const drape_sim_def *def, drape_assess_prepare *prepare, void *user,
                          drape_assessment *out);

#endif
