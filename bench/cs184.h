/*
 * cs184.h: the CS184 cloth simulator, written anew for `verlet` to be measured against: bench/cs184.cpp says
 * what of the original was kept. C and C++.
 */
#ifndef DRAPE_BENCH_CS184_H
#define DRAPE_BENCH_CS184_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cs184 cs184;

typedef struct cs184_scene {
    int side;                /* points of a row, and rows */
    double width, thickness; /* [m] */
    double mass;             /* of a point [kg] */
    double ks;               /* [N/m] */
    double damping;          /* [%] a substep */
    double gravity;          /* [m/s2] along y */
    double frame_rate;       /* [1/s] */
    int substeps;            /* of a frame */
    bool all_boxes; /* near points are looked for in all boxes in reach, not in a point's own alone */
} cs184_scene;

/* start: (side x side x 3), rows first; pinned: (side x side). Ends the program where there is no memory. */
cs184 *cs184_open(const cs184_scene *scene, const double *start, const bool *pinned);
void cs184_frame(cs184 *c);
void cs184_position(const cs184 *c, int point, double x[3]);
void cs184_close(cs184 *c);

#ifdef __cplusplus
}
#endif

#endif
