/* json.c: the numbers and texts of the page as JSON (io/json.h). */
#include <stdlib.h>
#include <string.h>

#include "base/param.h"
#include "base/rotation.h"
#include "colliders/colliders.h"
#include "io/json.h"
#include "model/track.h"
#include "report/data.h"

#define MAX_ROWS 20000 /* of a table in the page */

/* ---- Tables ---- */

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
static drape_status read_columns(const drape_report_source *run, const char *name, columns *c, json_t **out)
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
static json_t *shape(const drape_collider_shape *shape, const drape_report_body *body)
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

static json_t *collider(const drape_report_data *data, const drape_collider *c)
{
    json_t *object = json_pack("{s:o, s:o, s:o}", "type", drape_json_text(c->ops->entry.name), "name",
                               drape_json_text(c->name), "parameters", parameters(c));
    const drape_report_body *body = NULL;
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

static json_t *fields(const drape_report_data *data)
{
    json_t *array = json_array();
    for (int f = 0; f < DRAPE_REPORT_FIELDS; f++) {
        const drape_report_field *field = &data->fields[f];
        array = drape_json_append(array,
                                  json_pack("{s:s, s:s, s:o, s:o}", "name", field->name, "unit", field->unit,
                                            "low", drape_json_numbers(field->low, (size_t)field->width),
                                            "step", drape_json_numbers(field->step, (size_t)field->width)));
    }
    return array;
}

static json_t *frames(const drape_report_data *data)
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

drape_status drape_report_put_json(const drape_report_data *data, drape_file *file)
{
    const drape_report_source *run = data->run;
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
