/* report.c: see report.h. The page is page.html with its style and scripts, which embed.py puts together when
 * Drape is built; the data of the run go between its two parts. */
#include "report/report.h"

#include <errno.h>
#include <float.h>
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/arena.h"
#include "base/json_read.h"
#include "base/param.h"
#include "base/rotation.h"
#include "base/vec3.h"
#include "colliders/colliders.h"
#include "fields/fields.h"
#include "io/csv.h"
#include "io/export.h"
#include "io/json.h"
#include "io/record.h"
#include "io/summary.h"
#include "model/deformation.h"
#include "model/model.h"
#include "model/scene.h"
#include "model/track.h"
#include "report/page.h"

#define DEFAULT_NAME "report.html"
#define LEVELS       65535
#define MAX_ROWS     20000 /* of a table in the page */
#define SCENE_LIMIT  ((off_t)64 << 20)

/* ---- What the page shows: numbers and texts as JSON, frames as 16-bit integers in base64 ---- */

/* What a page is made from: the frames and tables of a run, its scene, compiled again, and its summary. */
typedef struct run_source {
    drape_context *ctx;
    drape_record record;
    drape_model *model;
    char *scene_text;
    json_t *summary; /* NULL: the run did not end */
} run_source;

/* A field at the nodes of the surface that frames show, which is a render mesh where a cloth has one, in all
 * kept frames: the integer i stands for low + i step. */
typedef struct page_field {
    const char *name, *unit;
    int width; /* numbers per node */
    double low[3], step[3];
} page_field;

#define FIELDS 3 /* positions, strain, speed */

/* The points of a collider that deforms, in its own coordinates, as such a field. */
typedef struct page_body {
    int32_t collider;
    char block[24]; /* the name of its block in the page */
    page_field field;
} page_body;

typedef struct page_data {
    const run_source *run;
    drape_arena arena;           /* of all arrays */
    int64_t kept;                /* frames in the page */
    int64_t *frame;              /* (kept) their numbers */
    double *x;                   /* (node_count x 3) positions in the loaded frame */
    double *before, *after;      /* (node_count x 3) positions in its neighbours */
    double *strain;              /* (triangle_count x 2) */
    double *node_strain, *speed; /* (node_count) */
    double *normals;             /* (node_count x 3); NULL, as the next: no cloth has a render mesh */
    double *shown[FIELDS];       /* the fields of the loaded frame at the nodes of the surface */
    page_field fields[FIELDS];
    page_body *bodies; /* (body_count) */
    int32_t body_count;
    double *points; /* (of the largest body x 3) in the loaded frame */
} page_data;

/* ---- What is read ---- */

static drape_status read_run(drape_context *ctx, const char *folder, run_source *source)
{
    char *scene, *text = NULL;
    size_t size = 0;
    json_error_t error = {0};
    *source = (run_source){.ctx = ctx};
    drape_status status = drape_record_scene(ctx, folder, &scene);
    if (!status)
        status = drape_file_read(ctx, scene, SCENE_LIMIT, &source->scene_text, &size);
    if (!status)
        status = drape_model_load(ctx, scene, &source->model);
    drape_free(ctx, scene);
    if (!status)
        status = drape_record_open(ctx, folder, source->model->node_count, &source->record);
    char *path = status ? NULL : drape_record_path(ctx, folder, "summary.json");
    if (status || !path)
        return status ? status : DRAPE_E_MEMORY;
    const int fd = drape_file_open(ctx, path);
    if (fd >= 0)
        status = drape_file_take(ctx, fd, path, SCENE_LIMIT, &text, &size);
    else if (errno != ENOENT) /* a run that was killed has none */
        status = DRAPE_E_FILE;
    if (text)
        source->summary = drape_json_read(text, size, 0, &error);
    if (text && !source->summary && json_error_code(&error) == json_error_out_of_memory)
        status = drape_fail_memory(ctx, size);
    drape_free(ctx, text);
    drape_free(ctx, path);
    return status;
}

/* ---- Fields of one frame ---- */

static const double *values_of(const page_data *d, int field)
{
    return d->shown[field] ? d->shown[field] : field == 0 ? d->x : field == 1 ? d->node_strain : d->speed;
}

static drape_status load(const page_data *d, int64_t frame)
{
    const drape_model *model = d->run->model;
    const drape_record *record = &d->run->record;
    const int64_t before = frame > 0 ? frame - 1 : 0, after = frame + 1 < record->frames ? frame + 1 : frame;
    const double h = record->times[after] - record->times[before];
    drape_status status = drape_check_cancel(d->run->ctx);
    if (!status)
        status = drape_record_read(record, frame, d->x);
    if (!status)
        status = drape_record_read(record, before, d->before);
    if (!status)
        status = drape_record_read(record, after, d->after);
    if (status)
        return status;
    drape_field_node_strain(model, d->x, d->strain, d->node_strain);
    /* speeds by central differences of positions; one-sided at the ends of the run */
    for (int32_t i = 0; i < model->node_count; i++) {
        double difference[3];
        vec3_sub(d->after + 3 * (size_t)i, d->before + 3 * (size_t)i, difference);
        d->speed[i] = h > 0 ? vec3_norm(difference) / h : 0;
    }
    if (!model->surface.bound)
        return DRAPE_OK;
    drape_model_normals(model, d->x, d->normals);
    drape_render_positions(model, -1, d->x, d->normals, d->shown[0]);
    drape_render_values(model, d->node_strain, 1, d->shown[1]);
    drape_render_values(model, d->speed, 1, d->shown[2]);
    return DRAPE_OK;
}

/* ---- Colliders that deform ---- */

static const drape_collider *collider_of(const page_data *d, int32_t body)
{
    return &d->run->model->colliders[d->bodies[body].collider];
}

static size_t load_body(const page_data *d, int32_t body, int64_t frame)
{
    const drape_collider *collider = collider_of(d, body);
    drape_sequence_points(&collider->frames, d->run->record.times[frame], d->points);
    return 3 * (size_t)collider->shape.point_count;
}

static drape_status find_bodies(page_data *d)
{
    const drape_model *model = d->run->model;
    size_t most = 0;
    d->bodies = drape_arena_take(&d->arena, (size_t)model->collider_count, sizeof *d->bodies);
    for (int32_t i = 0; d->bodies && i < model->collider_count; i++) {
        page_body *body = &d->bodies[d->body_count];
        if (model->colliders[i].frames.frame_count == 0)
            continue;
        *body = (page_body){.collider = i, .field = {.name = body->block, .unit = "m", .width = 3}};
        snprintf(body->block, sizeof body->block, "body%d", (int)i);
        most = (size_t)fmax((double)most, model->colliders[i].shape.point_count);
        d->body_count++;
    }
    d->points = drape_arena_take(&d->arena, most, 3 * sizeof *d->points);
    return drape_arena_status(&d->arena);
}

/* ---- Which frames, and ranges ---- */

static drape_status choose_frames(page_data *d, size_t max_bytes)
{
    int64_t all = d->run->record.frames;
    double numbers = 5.0 * d->run->model->surface.node_count;
    for (int32_t b = 0; b < d->body_count; b++)
        numbers += 3.0 * collider_of(d, b)->shape.point_count;
    const double bytes = 2 * 4.0 / 3 * numbers; /* of a frame: 16 bits a number, in base64 */
    d->kept = (int64_t)fmin(fmax(floor((double)max_bytes / bytes), 2), (double)all);
    d->frame = drape_arena_take(&d->arena, (size_t)d->kept, sizeof *d->frame);
    if (!d->frame)
        return DRAPE_E_MEMORY;
    for (int64_t k = 0; k < d->kept; k++)
        d->frame[k] =
            d->kept == 1 ? 0 : (int64_t)floor((double)k * (double)(all - 1) / (double)(d->kept - 1) + 0.5);
    return DRAPE_OK;
}

static void extend_range(page_field *field, const double *values, size_t count, double high[3])
{
    for (size_t i = 0; i < count; i++) {
        size_t k = i % (size_t)field->width;
        if (values[i] < field->low[k])
            field->low[k] = values[i];
        if (values[i] > high[k])
            high[k] = values[i];
    }
}

static void end_range(page_field *field, const double high[3])
{
    for (int k = 0; k < field->width; k++)
        field->step[k] = (high[k] - field->low[k]) / LEVELS;
}

static drape_status find_ranges(page_data *d)
{
    static const page_field fields[FIELDS] = {
        {"positions", "m", 3, {0}, {0}}, {"strain", "1", 1, {0}, {0}}, {"speed", "m/s", 1, {0}, {0}}};
    static const double lowest[3] = {DBL_MAX, DBL_MAX, DBL_MAX}, highest[3] = {-DBL_MAX, -DBL_MAX, -DBL_MAX};
    double high[FIELDS][3];
    size_t nodes = (size_t)d->run->model->surface.node_count;
    memcpy(d->fields, fields, sizeof fields);
    for (int f = 0; f < FIELDS; f++) {
        memcpy(d->fields[f].low, lowest, sizeof lowest);
        memcpy(high[f], highest, sizeof highest);
    }
    for (int64_t k = 0; k < d->kept; k++) {
        drape_status status = load(d, d->frame[k]);
        if (status)
            return status;
        for (int f = 0; f < FIELDS; f++)
            extend_range(&d->fields[f], values_of(d, f), nodes * (size_t)d->fields[f].width, high[f]);
    }
    for (int f = 0; f < FIELDS; f++)
        end_range(&d->fields[f], high[f]);
    for (int32_t b = 0; b < d->body_count; b++) {
        page_field *field = &d->bodies[b].field;
        memcpy(field->low, lowest, sizeof lowest);
        memcpy(high[0], highest, sizeof highest);
        for (int64_t k = 0; k < d->kept; k++)
            extend_range(field, d->points, load_body(d, b, d->frame[k]), high[0]);
        end_range(field, high[0]);
    }
    return DRAPE_OK;
}

/* Chooses frames that take at most max_bytes in the page, evenly, the first and the last among them, and
 * finds the ranges of the fields. The arena is freed in any case. */
static drape_status make_data(const run_source *run, size_t max_bytes, page_data *data)
{
    const drape_model *model = run->model;
    const size_t nodes = (size_t)model->node_count;
    *data = (page_data){.run = run, .arena = drape_arena_of(run->ctx)};
    data->x = drape_arena_take(&data->arena, 3 * nodes, sizeof *data->x);
    data->before = drape_arena_take(&data->arena, 3 * nodes, sizeof *data->before);
    data->after = drape_arena_take(&data->arena, 3 * nodes, sizeof *data->after);
    data->strain = drape_arena_take(&data->arena, 2 * (size_t)model->triangle_count, sizeof *data->strain);
    data->node_strain = drape_arena_take(&data->arena, nodes, sizeof *data->node_strain);
    data->speed = drape_arena_take(&data->arena, nodes, sizeof *data->speed);
    if (model->surface.bound) {
        const size_t shown = (size_t)model->surface.node_count;
        data->normals = drape_arena_take(&data->arena, 3 * nodes, sizeof *data->normals);
        for (int f = 0; f < FIELDS; f++)
            data->shown[f] = drape_arena_take(&data->arena, (f == 0 ? 3 : 1) * shown, sizeof *data->shown[f]);
    }
    drape_status status = drape_arena_status(&data->arena);
    if (!status)
        status = find_bodies(data);
    if (!status)
        status = choose_frames(data, max_bytes);
    return status ? status : find_ranges(data);
}

/* ---- Base64 (RFC 4648, section 4) ---- */

typedef struct encoder {
    drape_file *file;
    uint32_t bits;
    int count; /* bytes in bits */
} encoder;

static void put_group(encoder *e)
{
    static const char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    char group[4] = {'=', '=', '=', '='};
    uint32_t bits = e->bits << 8 * (3 - e->count);
    for (int i = 0; i <= e->count; i++)
        group[i] = letters[bits >> (18 - 6 * i) & 63];
    drape_file_put(e->file, group, sizeof group);
    e->bits = 0;
    e->count = 0;
}

static void put_byte(encoder *e, unsigned byte)
{
    e->bits = e->bits << 8 | (byte & 255);
    if (++e->count == 3)
        put_group(e);
}

/* ---- Into the page ---- */

static void put_values(encoder *e, const page_field *f, const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        const size_t k = i % (size_t)f->width;
        const double steps = f->step[k] > 0 ? floor((values[i] - f->low[k]) / f->step[k] + 0.5) : 0;
        const unsigned level = !(steps > 0) ? 0 : steps > LEVELS ? LEVELS : (unsigned)steps;
        put_byte(e, level);
        put_byte(e, level >> 8);
    }
}

static drape_status put_field(const page_data *data, int field, drape_file *file)
{
    const page_field *f = &data->fields[field];
    encoder e = {.file = file};
    for (int64_t k = 0; k < data->kept; k++) {
        drape_status status = load(data, data->frame[k]);
        if (status)
            return status;
        put_values(&e, f, values_of(data, field),
                   (size_t)data->run->model->surface.node_count * (size_t)f->width);
    }
    if (e.count > 0)
        put_group(&e);
    return DRAPE_OK;
}

static drape_status put_body(const page_data *data, int32_t body, drape_file *file)
{
    encoder e = {.file = file};
    drape_status status = DRAPE_OK;
    for (int64_t k = 0; k < data->kept && !(status = drape_check_cancel(data->run->ctx)); k++)
        put_values(&e, &data->bodies[body].field, data->points, load_body(data, body, data->frame[k]));
    if (e.count > 0)
        put_group(&e);
    return status;
}

static void put_triangles(const page_data *data, drape_file *file)
{
    const drape_render_surface *surface = &data->run->model->surface;
    encoder e = {.file = file};
    for (size_t i = 0; i < 3 * (size_t)surface->triangle_count; i++)
        for (int b = 0; b < 4; b++)
            put_byte(&e, (uint32_t)surface->triangle[i] >> 8 * b);
    if (e.count > 0)
        put_group(&e);
}

/* ---- Tables, as JSON (io/json.h) ---- */

/* Columns of a table. */
typedef struct columns {
    const char *const *names;
    size_t count;
    size_t text_from; /* columns from here on are texts, the others numbers */
    int64_t every;    /* every n-th row is taken, and each row whose column `keep` is "0" */
    int keep;         /* -1: none */
    json_t *arrays[DRAPE_MOST_COLUMNS];
} columns;

static void count_row(void *user, int64_t row, char *const *cells)
{
    (void)user, (void)row, (void)cells;
}

static void take_row(void *user, int64_t row, char *const *cells)
{
    columns *c = user;
    if (row % c->every && !(c->keep >= 0 && strcmp(cells[c->keep], "0") == 0))
        return;
    for (size_t i = 0; i < c->count; i++)
        c->arrays[i] =
            drape_json_append(c->arrays[i], i < c->text_from ? drape_json_number(strtod(cells[i], NULL))
                                                             : drape_json_text(cells[i]));
}

/* {"rows": number in the file, "every": n, "columns": {name: [...]}} */
static drape_status read_columns(const run_source *run, const char *name, columns *c, json_t **out)
{
    int64_t rows = 0;
    drape_status status = drape_record_rows(&run->record, name, c->names, c->count, count_row, NULL, &rows);
    if (status)
        return status;
    c->every = rows / MAX_ROWS + 1;
    for (size_t i = 0; i < c->count; i++)
        c->arrays[i] = json_array();
    status = drape_record_rows(&run->record, name, c->names, c->count, take_row, c, &rows);
    json_t *object = json_object();
    for (size_t i = 0; i < c->count; i++)
        object = drape_json_with(object, c->names[i], c->arrays[i]);
    *out = json_pack("{s:I, s:I, s:o}", "rows", (json_int_t)rows, "every", (json_int_t)c->every, "columns",
                     object);
    return status;
}

/* ---- Scene ---- */

static json_t *parameters(const drape_collider *collider)
{
    json_t *object = json_object();
    for (int i = 0; i < collider->ops->entry.param_count; i++) {
        const drape_param *param = &collider->ops->entry.params[i];
        const double *value = collider->values + drape_param_place(collider->ops->entry.params, i);
        object = drape_json_with(object, param->name,
                                 drape_param_width(param) > 1
                                     ? drape_json_numbers(value, (size_t)drape_param_width(param))
                                     : drape_json_number(*value));
    }
    return object;
}

/* The triangles of a collider, if it has some; the page draws other types by their parameters. The points
 * of one that deforms are in a block of their own. */
static json_t *shape(const drape_collider_shape *shape, const page_body *body)
{
    json_t *corners = json_array();
    for (size_t i = 0; i < 3 * (size_t)shape->triangle_count; i++)
        corners = drape_json_append(corners, json_integer(shape->triangle[i]));
    if (body)
        return json_pack("{s:s, s:i, s:o, s:o, s:o}", "block", body->block, "count", (int)shape->point_count,
                         "low", drape_json_numbers(body->field.low, 3), "step",
                         drape_json_numbers(body->field.step, 3), "triangles", corners);
    return json_pack("{s:o, s:o}", "points", drape_json_numbers(shape->point, 3 * (size_t)shape->point_count),
                     "triangles", corners);
}

static json_t *collider(const page_data *data, const drape_collider *c)
{
    json_t *object = json_pack("{s:o, s:o, s:o}", "type", drape_json_text(c->ops->entry.name), "name",
                               drape_json_text(c->name), "parameters", parameters(c));
    const page_body *body = NULL;
    for (int32_t b = 0; b < data->body_count; b++)
        if (&data->run->model->colliders[data->bodies[b].collider] == c)
            body = &data->bodies[b];
    if (c->shape.triangle_count > 0)
        object = drape_json_with(object, "shape", shape(&c->shape, body));
    if (c->track.key_count == 0 && c->turns.key_count == 0)
        return object;
    json_t *displacements = json_array(), *rotations = json_array();
    for (int64_t k = 0; k < data->kept; k++) {
        const double t = data->run->record.times[data->frame[k]];
        double displacement[3], matrix[9], q[4];
        drape_track_displacement(c->track.keys, c->track.key_count, t, displacement);
        drape_turns_rotation(&c->turns, t, matrix);
        drape_rotation_quaternion(matrix, q);
        displacements = drape_json_append(displacements, drape_json_numbers(displacement, 3));
        rotations = drape_json_append(rotations, drape_json_numbers((double[]){q[1], q[2], q[3], q[0]}, 4));
    }
    object = drape_json_with(object, "displacements", displacements);
    if (c->turns.key_count == 0) {
        json_decref(rotations);
        return object;
    }
    object = drape_json_with(object, "rotations", rotations);
    return drape_json_with(object, "pivot", drape_json_numbers(c->pivot, 3));
}

/* NULL: no memory. */
static json_t *pinned(drape_context *ctx, const drape_model *model)
{
    drape_arena scratch = drape_arena_of(ctx);
    uint8_t *is_pinned = drape_arena_take(&scratch, (size_t)model->surface.node_count, sizeof *is_pinned);
    json_t *array = is_pinned ? json_array() : NULL;
    if (is_pinned)
        drape_render_pinned(model, is_pinned);
    for (int32_t i = 0; is_pinned && i < model->surface.node_count; i++)
        if (is_pinned[i])
            array = drape_json_append(array, json_integer(i));
    drape_arena_free(&scratch);
    return array;
}

static json_t *fields(const page_data *data)
{
    json_t *array = json_array();
    for (int f = 0; f < FIELDS; f++) {
        const page_field *field = &data->fields[f];
        array = drape_json_append(array,
                                  json_pack("{s:s, s:s, s:o, s:o}", "name", field->name, "unit", field->unit,
                                            "low", drape_json_numbers(field->low, (size_t)field->width),
                                            "step", drape_json_numbers(field->step, (size_t)field->width)));
    }
    return array;
}

static json_t *frames(const page_data *data)
{
    json_t *times = json_array(), *kept = json_array();
    for (int64_t k = 0; k < data->kept; k++) {
        times = drape_json_append(times, drape_json_number(data->run->record.times[data->frame[k]]));
        kept = drape_json_append(kept, json_integer((json_int_t)data->frame[k]));
    }
    return json_pack("{s:I, s:o, s:o}", "all", (json_int_t)data->run->record.frames, "times", times,
                     "numbers", kept);
}

/* ---- All of it ---- */

/* Escapes <, which JSON only has within strings: the text must not contain the end of its script element. */
static int put_escaped(const char *bytes, size_t size, void *file)
{
    size_t from = 0;
    for (size_t i = 0; i < size; i++)
        if (bytes[i] == '<') {
            drape_file_put(file, bytes + from, i - from);
            drape_file_put_text(file, "\\u003c");
            from = i + 1;
        }
    drape_file_put(file, bytes + from, size - from);
    return 0;
}

static drape_status put_json(const page_data *data, drape_file *file)
{
    const run_source *run = data->run;
    static const char *const step_names[] = {"t",        "h",         "accepted", "iterations",
                                             "residual", "tolerance", "reason"};
    static const char *const energy_names[] = {"t_state", "kinetic",    "elastic",   "gravity",
                                               "contact", "dissipated", "numerical", "total"};
    columns of_steps = {.names = step_names, .count = 7, .text_from = 6, .keep = 2},
            of_energies = {.names = energy_names, .count = 8, .text_from = 8, .keep = -1};
    json_t *steps = NULL, *energies = NULL;
    drape_status status = read_columns(run, "steps.csv", &of_steps, &steps);
    if (!status)
        status = read_columns(run, "energy.csv", &of_energies, &energies);
    const char *slash = strrchr(run->record.folder, '/');
    json_t *colliders = json_array();
    for (int32_t i = 0; i < run->model->collider_count; i++)
        colliders = drape_json_append(colliders, collider(data, &run->model->colliders[i]));
    json_t *json = json_pack(
        "{s:s, s:o, s:o, s:o, s:i, s:i, s:i, s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "version", drape_version(),
        "name", drape_json_text(slash && slash[1] ? slash + 1 : run->record.folder), "scene",
        drape_json_text(run->scene_text), "summary", run->summary ? json_incref(run->summary) : json_null(),
        "nodes", (int)run->model->surface.node_count, "triangles", (int)run->model->surface.triangle_count,
        "simulated_triangles", (int)run->model->triangle_count, "length",
        drape_json_number(run->model->length), "pinned", pinned(run->ctx, run->model), "colliders", colliders,
        "frames", frames(data), "fields", fields(data), "steps", steps, "energies", energies);
    if (!status &&
        (!json || json_dump_callback(json, put_escaped, file, JSON_COMPACT | JSON_REAL_PRECISION(9))))
        status = drape_fail_memory(run->ctx, 1);
    json_decref(json);
    return status;
}

/* ---- The page ---- */

static void begin_block(drape_file *file, const char *id)
{
    drape_file_print(file, "<script type=\"text/plain\" id=\"%s\">", id);
}

static void end_block(drape_file *file)
{
    drape_file_put_text(file, "</script>\n");
}

static drape_status put_page(const page_data *data, drape_file *file)
{
    drape_file_put(file, drape_page_head, drape_page_head_size);
    begin_block(file, "run");
    drape_status status = put_json(data, file);
    end_block(file);
    begin_block(file, "triangles");
    put_triangles(data, file);
    end_block(file);
    for (int f = 0; !status && f < FIELDS; f++) {
        begin_block(file, data->fields[f].name);
        status = put_field(data, f, file);
        end_block(file);
    }
    for (int32_t b = 0; !status && b < data->body_count; b++) {
        begin_block(file, data->bodies[b].block);
        status = put_body(data, b, file);
        end_block(file);
    }
    drape_file_put(file, drape_page_tail, drape_page_tail_size);
    return status;
}

/* A page that was not named goes into the folder of the run. One that was must not be a file of the run. */
static drape_status create_file(const run_source *run, const drape_report_def *def, drape_folder **folder,
                                drape_file *file)
{
    static const char *const inputs[] = {"scene.json", "positions.npy", DRAPE_ENERGY_NAME, DRAPE_STEPS_NAME,
                                         DRAPE_SUMMARY_NAME};
    drape_status status = DRAPE_OK;
    if (def->out) {
        for (size_t i = 0; i < sizeof inputs / sizeof *inputs && !status; i++) {
            char path[4096];
            snprintf(path, sizeof path, "%s/%s", def->run, inputs[i]);
            status = drape_file_check_named(run->ctx, def->out, path);
        }
        return status ? status : drape_export_begin(run->ctx, NULL, def->out, file);
    }
    status = drape_folder_open(run->ctx, def->run, false, folder);
    if (!status)
        status = drape_folder_check(*folder, drape_folder_is_named, NULL, DEFAULT_NAME);
    if (!status)
        status = drape_folder_begin(*folder, NULL, NULL);
    return status ? status : drape_export_begin(run->ctx, *folder, DEFAULT_NAME, file);
}

/* Reads all of the run before the file is created. */
static drape_status write_page(const run_source *run, const drape_report_def *def,
                               drape_report_result *result, bool *input)
{
    drape_folder *folder = NULL;
    page_data data;
    drape_file file = {0};
    drape_status status = make_data(run, def->max_bytes, &data);
    result->frames = run->record.frames;
    result->kept = data.kept;
    if (!status) {
        status = create_file(run, def, &folder, &file);
        *input = status == DRAPE_E_ARGUMENT;
    }
    if (!status) {
        status = put_page(&data, &file);
        *input = status == DRAPE_E_PARSE || status == DRAPE_E_FILE;
    }
    if (!status)
        status = drape_file_finish(&file);
    result->bytes = (int64_t)file.size;
    drape_file_destroy(&file);
    drape_folder_close(&folder);
    drape_arena_free(&data.arena);
    return status;
}

drape_status drape_report_write(drape_context *ctx, const drape_report_def *def, drape_report_result *result,
                                bool *input)
{
    run_source run;
    *input = true;
    *result = (drape_report_result){.frames = 0};
    int length = def->out ? snprintf(result->path, sizeof result->path, "%s", def->out)
                          : snprintf(result->path, sizeof result->path, "%s/" DEFAULT_NAME, def->run);
    if (length >= (int)sizeof result->path)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "the name of the page is longer than %zu bytes",
                          sizeof result->path - 1);
    locale_t old = drape_locale_enter();
    drape_status status = read_run(ctx, def->run, &run);
    if (!status)
        status = write_page(&run, def, result, input);
    drape_record_close(&run.record);
    json_decref(run.summary);
    drape_model_destroy(&run.model);
    drape_free(ctx, run.scene_text);
    drape_locale_leave(old);
    return status;
}
