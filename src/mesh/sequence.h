/*
 * sequence.h: a mesh that moves: the positions of its nodes in frames, at times that increase. Formats are a
 * table; which of them reads a file follows from the ending of its name.
 */
#ifndef DRAPE_MESH_SEQUENCE_H
#define DRAPE_MESH_SEQUENCE_H

#include "mesh/contents.h"
#include "mesh/mesh.h"

/* What is read. */
typedef struct drape_sequence_def {
    const char *file;  /* of the frames */
    const char *mesh;  /* file of the triangles, for formats that have none; NULL: the frames have them */
    const char *times; /* NPY file of the time of each frame [s]; NULL: they follow from the rate */
    double rate;       /* frames per second [1/s] */
    double start;      /* [s] of the first frame */
} drape_sequence_def;

typedef struct drape_sequence {
    drape_arena *arena; /* holds the arrays */
    int32_t frame_count, node_count;
    double *x;    /* (frame_count x node_count x 3) [m] */
    double *time; /* (frame_count) [s] increasing */
    double first,
        step;    /* of a format with frame numbers: the number of the first frame, and the difference of
                           two numbers; 0 and 1 */
    double last; /* the number of the last frame, if it comes sooner after that before it; infinite */
} drape_sequence;

/* A file in the hands of its format. */
typedef struct drape_sequence_source {
    drape_context *ctx;
    drape_mesh_source file; /* for messages */
    const char *folder;     /* of relative names; NULL: the working directory */
    double rate;            /* [1/s] at which a format without frames of its own is sampled */
    drape_arena *scratch;   /* until it is read */
    drape_contents whole;   /* the bytes of the file, in scratch, unless the format has many files */
} drape_sequence_source;

/* A format. */
typedef struct drape_sequence_ops {
    drape_entry entry;
    const char *endings[3]; /* of names, NULL-terminated: ".npy", in any case */
    bool has_triangles;     /* it sets the nodes and triangles of the mesh; if not, they are set before */
    bool many_files;        /* it opens its files itself */
    /* Fills the frames, of as many nodes as the mesh has. */
    drape_status (*read)(const drape_sequence_source *source, drape_mesh *mesh, drape_sequence *out);
} drape_sequence_ops;
extern const drape_sequence_ops *const drape_sequences[]; /* NULL-terminated */
extern const drape_registry drape_sequence_registry;

/* Reads frames into the arena, and the triangles into *mesh, which started as all zeros and which
 * drape_mesh_free frees, on failure as well; its positions are those of the first frame. Faults are reported
 * at pointer/file, pointer/mesh and pointer/times, with frame, node and value. Errors: DRAPE_E_ARGUMENT,
 * DRAPE_E_FILE, DRAPE_E_PARSE, DRAPE_E_MEMORY, DRAPE_E_STOPPED (the context's cancel function). */
drape_status drape_sequence_read(drape_arena *arena, const char *pointer, const char *folder,
                                 const drape_sequence_def *def, drape_mesh *mesh, drape_sequence *out);

/* For formats: takes the arrays of that many frames of the nodes of the mesh. */
drape_status drape_sequence_allocate(const drape_sequence_source *source, const drape_mesh *mesh,
                                     int64_t frames, drape_sequence *out);

/* Whether all positions are finite and within 1e9 m, and no triangle of the mesh is degenerate in any
 * frame. */
drape_status drape_sequence_validate(drape_context *ctx, const drape_mesh_source *source,
                                     const drape_mesh *mesh, const drape_sequence *sequence);

#endif
