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
#define BLOCK        "<script type=\"text/plain\" id=\"%s\">"
#define BLOCK_END    "</script>\n"
#define MAX_ROWS     20000 /* of a table in the page */
#define SCENE_LIMIT  ((off_t)64 << 20)

/* ---- What the page shows: numbers and texts as JSON, frames as 16-bit integers in base64 ---- */

/* A quantity in all kept frames, a block of the page: the integer i stands for low + i step. The first ones
 * are at the nodes of the surface that frames show, which is a render mesh where a cloth has one; then follow
 * the points of each collider that deforms, in its own coordinates. */
typedef struct page_field {
    char name[24];
    const char *unit;
    int width;        /* numbers per node or point */
    size_t count;     /* numbers in a frame */
    int32_t collider; /* -1: none */
    double low[3], high[3], step[3];
} page_field;

#define FIELDS 3 /* positions, strain, speed */

typedef struct page {
    drape_context *ctx;
    drape_record record; /* frames and tables of the run */
    drape_model *model;  /* its scene, compiled again */
    char *scene_text;
    json_t *summary;             /* NULL: the run did not end */
    json_t *accuracy;            /* by `drape accuracy`; NULL: there is none */
    drape_arena arena;           /* of all arrays */
    int64_t kept;                /* frames in the page */
    int64_t *frame;              /* (kept) their numbers */
    double *x;                   /* (node_count x 3) positions in the loaded frame */
    double *before, *after;      /* (node_count x 3) positions in its neighbours */
    double *strain;              /* (triangle_count x 2) */
    double *node_strain, *speed; /* (node_count) */
    double *normals;             /* (node_count x 3); NULL, as the next: no cloth has a render mesh */
    double *shown[FIELDS];       /* the fields of the loaded frame at the nodes of the surface */
    page_field *fields;          /* (field_count) */
    int field_count;
    double *points; /* (of the largest collider that deforms x 3) in the loaded frame */
} page;

/* ---- What is read ---- */

static drape_status read_run(page *p, const char *folder)
{
    drape_context *ctx = p->ctx;
    char *scene;
    size_t size = 0;
    drape_status status = drape_record_scene(ctx, folder, &scene);
    if (!status)
        status = drape_file_read(ctx, scene, SCENE_LIMIT, &p->scene_text, &size);
    if (!status)
        status = drape_model_load(ctx, scene, &p->model);
    drape_free(ctx, scene);
    if (!status)
        status = drape_record_open(ctx, folder, p->model->node_count, &p->record);
    if (!status)
        status = drape_record_json(&p->record, DRAPE_SUMMARY_NAME, &p->summary);
    return status ? status : drape_record_json(&p->record, DRAPE_ACCURACY_NAME, &p->accuracy);
}

/* ---- Fields ---- */

static drape_status load(const page *p, int64_t frame)
{
    const drape_model *model = p->model;
    const drape_record *record = &p->record;
    const int64_t before = frame > 0 ? frame - 1 : 0, after = frame + 1 < record->frames ? frame + 1 : frame;
    const double h = record->times[after] - record->times[before];
    drape_status status = drape_check_cancel(p->ctx);
    if (!status)
        status = drape_record_read(record, frame, p->x);
    if (!status)
        status = drape_record_read(record, before, p->before);
    if (!status)
        status = drape_record_read(record, after, p->after);
    if (status)
        return status;
    drape_field_node_strain(model, p->x, p->strain, p->node_strain);
    /* speeds by central differences of positions; one-sided at the ends of the run */
    for (int32_t i = 0; i < model->node_count; i++) {
        double difference[3];
        vec3_sub(p->after + 3 * (size_t)i, p->before + 3 * (size_t)i, difference);
        p->speed[i] = h > 0 ? vec3_norm(difference) / h : 0;
    }
    if (!model->surface.bound)
        return DRAPE_OK;
    drape_model_normals(model, p->x, p->normals);
    drape_render_positions(model, -1, p->x, p->normals, p->shown[0]);
    drape_render_values(model, p->node_strain, 1, p->shown[1]);
    drape_render_values(model, p->speed, 1, p->shown[2]);
    return DRAPE_OK;
}

/* In the loaded frame, if the field is not of a collider. */
static const double *values_of(const page *p, int field, int64_t frame)
{
    const int32_t c = p->fields[field].collider;
    if (c < 0)
        return p->shown[field] ? p->shown[field] : field == 0 ? p->x : field == 1 ? p->node_strain : p->speed;
    drape_sequence_points(&p->model->colliders[c].frames, p->record.times[frame], p->points);
    return p->points;
}

static drape_status find_fields(page *p)
{
    static const page_field at_nodes[FIELDS] = {{"positions", "m", 3, 0, -1, {0}, {0}, {0}},
                                                {"strain", "1", 1, 0, -1, {0}, {0}, {0}},
                                                {"speed", "m/s", 1, 0, -1, {0}, {0}, {0}}};
    const drape_model *model = p->model;
    size_t most = 0;
    p->fields = drape_arena_take(&p->arena, FIELDS + (size_t)model->collider_count, sizeof *p->fields);
    if (!p->fields)
        return DRAPE_E_MEMORY;
    memcpy(p->fields, at_nodes, sizeof at_nodes);
    for (p->field_count = 0; p->field_count < FIELDS; p->field_count++) {
        page_field *f = &p->fields[p->field_count];
        f->count = (size_t)model->surface.node_count * (size_t)f->width;
    }
    for (int32_t i = 0; i < model->collider_count; i++) {
        const drape_collider *collider = &model->colliders[i];
        if (collider->frames.frame_count == 0)
            continue;
        page_field *f = &p->fields[p->field_count++];
        *f = (page_field){
            .unit = "m", .width = 3, .count = 3 * (size_t)collider->shape.point_count, .collider = i};
        snprintf(f->name, sizeof f->name, "body%d", (int)i);
        most = f->count > most ? f->count : most;
    }
    p->points = drape_arena_take(&p->arena, most, sizeof *p->points);
    return drape_arena_status(&p->arena);
}

static drape_status find_ranges(page *p)
{
    for (int64_t n = 0; n < p->kept; n++) {
        drape_status status = load(p, p->frame[n]);
        if (status)
            return status;
        for (int i = 0; i < p->field_count; i++) {
            page_field *f = &p->fields[i];
            const double *values = values_of(p, i, p->frame[n]);
            for (int k = 0; k < 3 && n == 0; k++) {
                f->low[k] = DBL_MAX;
                f->high[k] = -DBL_MAX;
            }
            for (size_t at = 0; at < f->count; at++) {
                const size_t k = at % (size_t)f->width;
                f->low[k] = values[at] < f->low[k] ? values[at] : f->low[k];
                f->high[k] = values[at] > f->high[k] ? values[at] : f->high[k];
            }
        }
    }
    for (int i = 0; i < p->field_count; i++)
        for (int k = 0; k < p->fields[i].width; k++)
            p->fields[i].step[k] = (p->fields[i].high[k] - p->fields[i].low[k]) / LEVELS;
    return DRAPE_OK;
}

/* Chooses frames that take at most max_bytes in the page, evenly, the first and the last among them, and
 * finds the ranges of the fields. */
static drape_status make_data(page *p, size_t max_bytes)
{
    const drape_model *model = p->model;
    const size_t nodes = (size_t)model->node_count, shown = (size_t)model->surface.node_count;
    const int64_t all = p->record.frames;
    p->x = drape_arena_take(&p->arena, 3 * nodes, sizeof *p->x);
    p->before = drape_arena_take(&p->arena, 3 * nodes, sizeof *p->before);
    p->after = drape_arena_take(&p->arena, 3 * nodes, sizeof *p->after);
    p->strain = drape_arena_take(&p->arena, 2 * (size_t)model->triangle_count, sizeof *p->strain);
    p->node_strain = drape_arena_take(&p->arena, nodes, sizeof *p->node_strain);
    p->speed = drape_arena_take(&p->arena, nodes, sizeof *p->speed);
    if (model->surface.bound)
        p->normals = drape_arena_take(&p->arena, 3 * nodes, sizeof *p->normals);
    for (int f = 0; f < FIELDS && model->surface.bound; f++)
        p->shown[f] = drape_arena_take(&p->arena, (f == 0 ? 3 : 1) * shown, sizeof *p->shown[f]);
    drape_status status = find_fields(p);
    double numbers = 0;
    for (int f = 0; f < p->field_count; f++)
        numbers += (double)p->fields[f].count;
    const double bytes = 2 * 4.0 / 3 * numbers; /* of a frame: 16 bits a number, in base64 */
    p->kept = (int64_t)fmin(fmax(floor((double)max_bytes / bytes), 2), (double)all);
    p->frame = status ? NULL : drape_arena_take(&p->arena, (size_t)p->kept, sizeof *p->frame);
    if (!p->frame)
        return DRAPE_E_MEMORY;
    for (int64_t k = 0; k < p->kept; k++)
        p->frame[k] =
            p->kept == 1 ? 0 : (int64_t)floor((double)k * (double)(all - 1) / (double)(p->kept - 1) + 0.5);
    return find_ranges(p);
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

/* The block of a field. */
static drape_status put_field(const page *p, int field, drape_file *file)
{
    const page_field *f = &p->fields[field];
    encoder e = {.file = file};
    drape_status status = DRAPE_OK;
    drape_file_print(file, BLOCK, f->name);
    for (int64_t n = 0; n < p->kept && !status; n++) {
        status = f->collider < 0 ? load(p, p->frame[n]) : drape_check_cancel(p->ctx);
        const double *values = status ? NULL : values_of(p, field, p->frame[n]);
        for (size_t i = 0; values && i < f->count; i++) {
            const size_t k = i % (size_t)f->width;
            const double steps = f->step[k] > 0 ? floor((values[i] - f->low[k]) / f->step[k] + 0.5) : 0;
            const unsigned level = !(steps > 0) ? 0 : steps > LEVELS ? LEVELS : (unsigned)steps;
            put_byte(&e, level);
            put_byte(&e, level >> 8);
        }
    }
    if (e.count > 0)
        put_group(&e);
    drape_file_put_text(file, BLOCK_END);
    return status;
}

static void put_triangles(const page *p, drape_file *file)
{
    const drape_render_surface *surface = &p->model->surface;
    encoder e = {.file = file};
    drape_file_print(file, BLOCK, "triangles");
    for (size_t i = 0; i < 3 * (size_t)surface->triangle_count; i++)
        for (int b = 0; b < 4; b++)
            put_byte(&e, (uint32_t)surface->triangle[i] >> 8 * b);
    if (e.count > 0)
        put_group(&e);
    drape_file_put_text(file, BLOCK_END);
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
static drape_status read_columns(const page *p, const char *name, columns *c, json_t **out)
{
    int64_t rows = 0;
    drape_status status = drape_record_rows(&p->record, name, c->names, c->count, count_row, NULL, &rows);
    if (status)
        return status;
    c->every = rows / MAX_ROWS + 1;
    for (size_t i = 0; i < c->count; i++)
        c->arrays[i] = json_array();
    status = drape_record_rows(&p->record, name, c->names, c->count, take_row, c, &rows);
    json_t *object = json_object();
    for (size_t i = 0; i < c->count; i++)
        object = drape_json_with(object, c->names[i], c->arrays[i]);
    *out = json_pack("{s:I, s:I, s:o}", "rows", (json_int_t)rows, "every", (json_int_t)c->every, "columns",
                     object);
    return status;
}

/* ---- Scene ---- */

static json_t *collider(const page *p, int32_t number)
{
    const drape_collider *c = &p->model->colliders[number];
    const page_field *points = NULL;
    for (int i = 0; i < p->field_count; i++)
        points = p->fields[i].collider == number ? &p->fields[i] : points;
    const drape_entry *entry = &c->ops->entry;
    const drape_collider_shape *shape = &c->shape;
    json_t *parameters = json_object();
    for (int i = 0; i < entry->param_count; i++) {
        const double *value = c->values + drape_param_place(entry->params, i);
        const int width = drape_param_width(&entry->params[i]);
        parameters =
            drape_json_with(parameters, entry->params[i].name,
                            width > 1 ? drape_json_numbers(value, (size_t)width) : drape_json_number(*value));
    }
    json_t *object = json_pack("{s:o, s:o, s:o}", "type", drape_json_text(entry->name), "name",
                               drape_json_text(c->name), "parameters", parameters);
    /* The triangles, if it has some; the page draws other types by their parameters. The points of one that
     * deforms are in a block of their own. */
    if (shape->triangle_count > 0) {
        json_t *corners = json_array();
        for (size_t i = 0; i < 3 * (size_t)shape->triangle_count; i++)
            corners = drape_json_append(corners, json_integer(shape->triangle[i]));
        json_t *triangles =
            points ? json_pack("{s:s, s:i, s:o, s:o, s:o}", "block", points->name, "count",
                               (int)shape->point_count, "low", drape_json_numbers(points->low, 3), "step",
                               drape_json_numbers(points->step, 3), "triangles", corners)
                   : json_pack("{s:o, s:o}", "points",
                               drape_json_numbers(shape->point, 3 * (size_t)shape->point_count), "triangles",
                               corners);
        object = drape_json_with(object, "shape", triangles);
    }
    if (c->track.key_count == 0 && c->turns.key_count == 0)
        return object;
    json_t *displacements = json_array(), *rotations = json_array();
    for (int64_t k = 0; k < p->kept; k++) {
        const double t = p->record.times[p->frame[k]];
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

static drape_status put_json(const page *p, drape_file *file)
{
    static const char *const step_names[] = {"t",        "h",         "accepted", "iterations",
                                             "residual", "tolerance", "reason"};
    const char *energy_names[DRAPE_MOST_COLUMNS] = {"t_state", "kinetic",    "elastic",   "gravity",
                                                    "contact", "dissipated", "numerical", "total"};
    const char *name;
    json_t *work;
    int seen = 0;
    const drape_model *model = p->model;
    const drape_record *record = &p->record;
    columns of_steps = {.names = step_names, .count = 7, .text_from = 6, .keep = 2},
            of_energies = {.names = energy_names, .count = 8, .text_from = DRAPE_MOST_COLUMNS, .keep = -1};
    json_t *steps = NULL, *energies = NULL, *pinned = json_array(), *colliders = json_array(),
           *times = json_array(), *numbers = json_array(), *fields = json_array();
    drape_arena scratch = drape_arena_of(p->ctx);
    uint8_t *is_pinned = drape_arena_take(&scratch, (size_t)model->surface.node_count, sizeof *is_pinned);
    drape_status status = is_pinned ? read_columns(p, DRAPE_STEPS_NAME, &of_steps, &steps) : DRAPE_E_MEMORY;
    json_object_foreach(json_object_get(p->summary, "work"), name,
                        work) if (json_number_value(work) != 0 && seen++ < DRAPE_MOST_COLUMNS - 8)
        energy_names[of_energies.count++] = name;
    if (!status)
        status = read_columns(p, DRAPE_ENERGY_NAME, &of_energies, &energies);
    if (is_pinned)
        drape_render_pinned(model, is_pinned);
    for (int32_t i = 0; is_pinned && i < model->surface.node_count; i++)
        if (is_pinned[i])
            pinned = drape_json_append(pinned, json_integer(i));
    drape_arena_free(&scratch);
    for (int32_t i = 0; i < model->collider_count; i++)
        colliders = drape_json_append(colliders, collider(p, i));
    for (int64_t k = 0; k < p->kept; k++) {
        times = drape_json_append(times, drape_json_number(record->times[p->frame[k]]));
        numbers = drape_json_append(numbers, json_integer((json_int_t)p->frame[k]));
    }
    for (const page_field *f = p->fields; f < p->fields + FIELDS; f++)
        fields = drape_json_append(fields, json_pack("{s:s, s:s, s:o, s:o}", "name", f->name, "unit", f->unit,
                                                     "low", drape_json_numbers(f->low, (size_t)f->width),
                                                     "step", drape_json_numbers(f->step, (size_t)f->width)));
    const char *slash = strrchr(record->folder, '/');
    json_t *json = json_pack(
        "{s:s, s:o, s:o, s:o, s:o, s:i, s:i, s:i, s:o, s:o, s:o, s:{s:I, s:o, s:o}, s:o, s:o, s:o}",
        "version", drape_version(), "name", drape_json_text(slash && slash[1] ? slash + 1 : record->folder),
        "scene", drape_json_text(p->scene_text), "summary",
        p->summary ? json_incref(p->summary) : json_null(), "accuracy",
        p->accuracy ? json_incref(p->accuracy) : json_null(), "nodes", (int)model->surface.node_count,
        "triangles", (int)model->surface.triangle_count, "simulated_triangles", (int)model->triangle_count,
        "length", drape_json_number(model->length), "pinned", pinned, "colliders", colliders, "frames", "all",
        (json_int_t)record->frames, "times", times, "numbers", numbers, "fields", fields, "steps", steps,
        "energies", energies);
    drape_file_print(file, BLOCK, "run");
    if (!status &&
        (!json || json_dump_callback(json, put_escaped, file, JSON_COMPACT | JSON_REAL_PRECISION(9))))
        status = drape_fail_memory(p->ctx, 1);
    drape_file_put_text(file, BLOCK_END);
    json_decref(json);
    return status;
}

/* ---- The page ---- */

/* A page that was not named goes into the folder of the run. One that was must not be a file of the run. */
static drape_status create_file(drape_context *ctx, const drape_report_def *def, drape_folder **folder,
                                drape_file *file)
{
    drape_status status = DRAPE_OK;
    if (def->out) {
        status = drape_record_protect(ctx, def->run, def->out);
        return status ? status : drape_export_begin(ctx, NULL, def->out, file);
    }
    status = drape_folder_open(ctx, def->run, false, folder);
    if (!status)
        status = drape_folder_check(*folder, drape_folder_is_named, NULL, DEFAULT_NAME);
    if (!status)
        status = drape_folder_begin(*folder, NULL, NULL);
    return status ? status : drape_export_begin(ctx, *folder, DEFAULT_NAME, file);
}

/* Reads all of the run before the file is created. */
drape_status drape_report_write(drape_context *ctx, const drape_report_def *def, drape_report_result *result,
                                bool *input)
{
    page p = {.ctx = ctx, .arena = drape_arena_of(ctx)};
    drape_folder *folder = NULL;
    drape_file file = {0};
    *input = true;
    *result = (drape_report_result){.frames = 0};
    int length = def->out ? snprintf(result->path, sizeof result->path, "%s", def->out)
                          : snprintf(result->path, sizeof result->path, "%s/" DEFAULT_NAME, def->run);
    if (length >= (int)sizeof result->path)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "the name of the page is longer than %zu bytes",
                          sizeof result->path - 1);
    locale_t old = drape_locale_enter();
    drape_status status = read_run(&p, def->run);
    if (!status)
        status = make_data(&p, def->max_bytes);
    result->frames = p.record.frames;
    result->kept = p.kept;
    if (!status) {
        status = create_file(ctx, def, &folder, &file);
        *input = status == DRAPE_E_ARGUMENT;
    }
    if (!status) {
        drape_file_put(&file, drape_page_head, drape_page_head_size);
        status = put_json(&p, &file);
        put_triangles(&p, &file);
        for (int f = 0; !status && f < p.field_count; f++)
            status = put_field(&p, f, &file);
        drape_file_put(&file, drape_page_tail, drape_page_tail_size);
        *input = status == DRAPE_E_PARSE || status == DRAPE_E_FILE;
    }
    if (!status)
        status = drape_file_finish(&file);
    result->bytes = (int64_t)file.size;
    drape_file_destroy(&file);
    drape_folder_close(&folder);
    drape_record_close(&p.record);
    json_decref(p.summary);
    json_decref(p.accuracy);
    drape_model_destroy(&p.model);
    drape_free(ctx, p.scene_text);
    drape_arena_free(&p.arena);
    drape_locale_leave(old);
    return status;
}
