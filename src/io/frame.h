/* frame.h: what a frame shows: the cloths as the surface that the scene draws (model/render_mesh.h), with
 * fields, and the colliders. */
#ifndef DRAPE_IO_FRAME_H
#define DRAPE_IO_FRAME_H

#include "base/arena.h"
#include "model/motion.h"

/* The surface of a collider, as an object of its own beside the cloth. Its vertices are in its own
 * coordinates, and are where its pose puts them in a frame; those of a collider that deforms are the points
 * of its shape, which each frame has. */
typedef struct drape_export_body {
    const char *name;
    bool deforms, moves; /* moves: its pose may differ from that of the first frame */
    int32_t vertex_count, triangle_count;
    float *vertex;       /* (vertex_count x 6) position [m] and normal; NULL if it deforms */
    int32_t *triangle;   /* (triangle_count x 3), counterclockwise from outside */
    int32_t first_point; /* of one that deforms: its first point among the positions of a frame */
} drape_export_body;

/* The number of points of all colliders that deform. */
int32_t drape_frame_points(const drape_model *model);

typedef struct drape_frame {
    int64_t index;           /* counts from 0 without gaps */
    double time;             /* [s] */
    const double *positions; /* of the nodes of the surface, then in formats that want bodies of the points of
                                the deforming ones (node_count + points x 3) [m] */
    const double *nodes;     /* of the nodes of the model (node_count x 3) [m], never rotated */
    /* For formats that want fields; otherwise NULL: */
    const double *velocities;     /* (node_count x 3) [m/s] */
    const double *strain;         /* (triangle_count x 2) as drape_model_strain */
    const double *energy_density; /* (node_count) [J/m2], of the state at or after the frame */
    const uint8_t *pinned;        /* (node_count) */
    /* For formats that want bodies; otherwise NULL: */
    const drape_collider_pose *poses; /* (body_count) */
} drape_frame;

/* The memory of one frame. */
typedef struct drape_frames {
    drape_frame frame, rotated; /* rotated: with z up */
    bool rotates;               /* the latter is wanted */
    /* As in the frame; positions and velocities of the rotated one follow: */
    double *positions, *velocities, *strain, *density;
    uint8_t *pinned;
    /* Of the nodes and triangles of the model; NULL if no fields are wanted, and without render meshes: */
    double *node_density, *triangle_strain, *normals;
    int32_t *triangle;          /* of the model, for each triangle of the surface */
    drape_export_body *bodies;  /* (body_count) the colliders, if they are wanted */
    drape_collider_pose *poses; /* of them; those of the rotated frame follow */
    int32_t body_count;
    size_t points; /* number of positions of a frame */
} drape_frames;

/* Takes the memory, and makes the surfaces of the colliders: an endless one, as a plane, is cut off at two
 * diagonals of the cloth at rest from the point nearest to its middle. Errors: DRAPE_E_MEMORY. */
drape_status drape_frames_create(drape_arena *arena, const drape_model *model, const drape_motion *motion,
                                 bool fields, bool bodies, bool rotates, drape_frames *out);

/* Sets the members of frame and rotated from frame.index, .time and .nodes, and, if fields are wanted, from
 * velocities and node_density. model: it has the pins of this time. */
void drape_frames_make(drape_frames *f, const drape_model *model, const drape_motion *motion,
                       const double *velocities);

#endif
