/* export.h: frame formats. Each is an entry of one table; the recorder drives all of them alike. */
#ifndef DRAPE_IO_EXPORT_H
#define DRAPE_IO_EXPORT_H

#include "base/archive.h"
#include "base/registry.h"
#include "io/file.h"
#include "io/frame.h"

/* The target of the frames, known before the first one. It is valid until close. */
typedef struct drape_export_def {
    drape_context *ctx;
    drape_arena *arena; /* holds the memory that open takes */
    const drape_model *model;
    drape_folder *folder;
    double frame_rate;    /* [1/s] */
    int64_t most_frames;  /* frames that a run of the scene's duration writes, including the one at its end */
    bool durable;         /* a checkpoint may claim that each frame is on the disk */
    bool resumes;         /* an earlier run is continued */
    drape_file *whole;    /* for files that are written at once, one after the other */
    drape_file **growing; /* the list of the files that grow, in the order in which they were opened */
    const drape_export_body *bodies; /* (body_count) of formats that want them: the colliders */
    int32_t body_count;
} drape_export_def;

/*
 * A format. The recorder zeroes state_size bytes, calls open once, write for each frame, and close once if
 * open succeeded, even after a failure of write. All are called in the C locale. Only open may take memory.
 * After a failure, the frames before it are complete and readable.
 */
typedef struct drape_exporter_ops {
    drape_entry entry; /* summary: which files it writes; reference: definition of the format */
    size_t state_size;
    bool wants_fields, wants_bodies;
    bool y_up; /* the format has y up: its frames are never rotated */
    const char
        *names[5]; /* NULL-ended: patterns of the names of its files (drape_folder_matches); files of one
                             frame have DRAPE_FRAME_DIGITS for its number */

    /* Optional: refuses a run that the format cannot hold, reported at `pointer`, before anything is
     * written. def->folder is NULL. Errors: DRAPE_E_ARGUMENT. */
    drape_status (*check)(drape_context *ctx, const char *pointer, const drape_export_def *def);

    /* Optional: takes the memory, and begins the files that grow, by drape_export_open: the recorder then
     * archives, resumes, syncs and closes them. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
    drape_status (*open)(const drape_export_def *def, void *state);

    /* Errors: DRAPE_E_FILE. */
    drape_status (*write)(const drape_export_def *def, void *state, const drape_frame *frame);

    /* Optional, in place of write where ranks share the model (base/ranks.h) and frames show its nodes:
     * they append the positions of the nodes to this file together. settle, called then: the errno with
     * which they failed, 0: none; sum: what that adds to the checksum of the file. Errors: DRAPE_E_FILE. */
    drape_file *(*shared)(void *state);
    drape_status (*settle)(void *state, int error, uint64_t sum);

    /* Optional: archives what the format needs to know of the frames so far, besides its files. */
    void (*archive)(void *state, drape_archive *a);

    /* Optional: writes the end of the files that grow. Errors: DRAPE_E_FILE. */
    drape_status (*close)(const drape_export_def *def, void *state);
} drape_exporter_ops;
extern const drape_exporter_ops *const drape_exporters[]; /* NULL-ended */
extern const drape_registry drape_exporter_registry;

/* Whether a format writes a file of this name. */
bool drape_export_names(const drape_exporter_ops *ops, const char *name);

/* The frame of which a file is, by its name; -1: it is not a file of one frame. */
int64_t drape_export_frame_of(const drape_exporter_ops *ops, const char *name);

/* ---- Files ---- */

/* Takes the memory for a file and begins it: of a folder, or (NULL) at a path that the user named; call
 * drape_file_destroy in any case. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status drape_export_begin(drape_context *ctx, drape_folder *folder, const char *name, drape_file *file);

/* The same for a file that grows, which joins the list of the def. It is not begun where a run is
 * continued. */
drape_status drape_export_open(const drape_export_def *def, const char *name, drape_file *file);

#define DRAPE_FRAME_DIGITS "######"
#define DRAPE_FRAME_NAME   64 /* bytes of the name of a frame's file */

/* The name of the file of a frame, by a pattern with DRAPE_FRAME_DIGITS. */
void drape_export_frame_name(const char *pattern, int64_t frame, char *name, size_t size);

/* Begins def->whole as the file of a frame, by such a pattern; end it by drape_file_finish. Errors:
 * DRAPE_E_FILE. */
drape_status drape_export_begin_frame(const drape_export_def *def, const drape_frame *frame,
                                      const char *pattern);

/* ---- Pieces of OBJ ---- */

/* The name of the material of faces that have none, in files in which others have one. */
#define DRAPE_NO_MATERIAL "cloth"

/* What has been written to an OBJ file. */
typedef struct drape_obj {
    drape_file *file;
    int32_t uvs;          /* number of texture coordinates */
    const char *material; /* of the next face; NULL: none was named */
} drape_obj;

/* A statement with a name. Control characters, such as line breaks, are replaced: names contain any. */
void drape_obj_put_name(drape_file *file, const char *statement, const char *name);
/* `mtllib file` of all cloths, each file once. */
void drape_obj_put_material_files(drape_file *file, const drape_render_surface *surface);
/* `v x y z` of nodes, with 17 digits; `f a b c` of triangles, whose array counts nodes from 0. */
void drape_obj_put_nodes(drape_file *file, const double *x, int32_t count);
void drape_obj_put_triangles(drape_file *file, const int32_t *triangle, int32_t count);
/* The faces of a cloth as its file had them, with `vt u v` and `usemtl name`; its triangles if it has no
 * such faces. Nodes are counted from 1 over all cloths. */
void drape_obj_put_faces(drape_obj *obj, const drape_render_surface *surface, int32_t cloth);

#endif
