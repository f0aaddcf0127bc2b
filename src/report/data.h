/* data.h: what the page shows of a run: numbers and texts as JSON, frames as 16-bit integers in base64. */
#ifndef DRAPE_REPORT_DATA_H
#define DRAPE_REPORT_DATA_H

#include <jansson.h>

#include "base/arena.h"
#include "io/record.h"
#include "model/model.h"

/* What a page is made from: the frames and tables of a run, its scene, compiled again, and its summary. */
typedef struct drape_report_source {
    drape_context *ctx;
    drape_record record;
    drape_model *model;
    char *scene_text;
    json_t *summary; /* NULL: the run did not end */
} drape_report_source;

/* A field at the nodes of the surface that frames show, which is a render mesh where a cloth has one, in all
 * kept frames: the integer i stands for low + i step. */
typedef struct drape_report_field {
    const char *name, *unit;
    int width; /* numbers per node */
    double low[3], step[3];
} drape_report_field;

#define DRAPE_REPORT_FIELDS 3 /* positions, strain, speed */

/* The points of a collider that deforms, in its own coordinates, as such a field. */
typedef struct drape_report_body {
    int32_t collider;
    char block[24]; /* the name of its block in the page */
    drape_report_field field;
} drape_report_body;

typedef struct drape_report_data {
    const drape_report_source *run;
    drape_arena arena;                  /* of all arrays */
    int64_t kept;                       /* frames in the page */
    int64_t *frame;                     /* (kept) their numbers */
    double *x;                          /* (node_count x 3) positions in the loaded frame */
    double *before, *after;             /* (node_count x 3) positions in its neighbours */
    double *strain;                     /* (triangle_count x 2) */
    double *node_strain, *speed;        /* (node_count) */
    double *normals;                    /* (node_count x 3); NULL, as the next: no cloth has a render mesh */
    double *shown[DRAPE_REPORT_FIELDS]; /* the fields of the loaded frame at the nodes of the surface */
    drape_report_field fields[DRAPE_REPORT_FIELDS];
    drape_report_body *bodies; /* (body_count) */
    int32_t body_count;
    double *points; /* (of the largest body x 3) in the loaded frame */
} drape_report_data;

/* Chooses frames that take at most max_bytes in the page, evenly, the first and the last among them, and
 * finds the ranges of the fields. drape_arena_free(&data->arena) in any case. Errors: DRAPE_E_FILE,
 * DRAPE_E_MEMORY. */
drape_status drape_report_data_make(const drape_report_source *run, size_t max_bytes,
                                    drape_report_data *data);

/* Write parts of the page: the JSON, which contains no <; the kept frames of one field, or of one
 * body; the triangles. */
drape_status drape_report_put_json(const drape_report_data *data, drape_file *file);
drape_status drape_report_put_field(const drape_report_data *data, int field, drape_file *file);
drape_status drape_report_put_body(const drape_report_data *data, int32_t body, drape_file *file);
void drape_report_put_triangles(const drape_report_data *data, drape_file *file);

#endif
