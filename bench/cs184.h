/*
 * cs184.h: the CS184 cloth simulator, written anew as the reference of the benchmark `verlet`.
 * bench/cs184.cpp says what it keeps of the original. For C and C++.
 */
#ifndef DRAPE_BENCH_CS184_H
#define DRAPE_BENCH_CS184_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cs184 cs184;

typedef struct cs184_scene {
    int side;                /* points in a row, and number of rows */
    double width, thickness; /* [m] */
    double mass;             /* [kg] of one point */
    double ks;               /* [N/m] */
    double damping;          /* [%] per substep */
    double gravity;          /* [m/s2] along y */
    double frame_rate;       /* [1/s] */
    int substeps;            /* per frame */
    bool all_boxes; /* look for near points in all boxes within reach, not only in a point's own box */
} cs184_scene;

/* start: (side x side x 3) positions, row by row; pinned: (side x side). Ends the program if out of
 * memory. */
cs184 *cs184_open(const cs184_scene *scene, const double *start, const bool *pinned);
void cs184_frame(cs184 *c);
void cs184_position(const cs184 *c, int point, double x[3]);
void cs184_close(cs184 *c);

#ifdef __cplusplus
}
#endif

#endif
