/* frames.c: the frames of a page: which are kept, and their fields as 16-bit integers. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/vec3.h"
#include "fields/fields.h"
#include "model/deformation.h"
#include "report/data.h"

#define LEVELS 65535

/* ---- Fields of one frame ---- */

static const double *values_of(const drape_report_data *d, int field)
{
    return d->shown[field] ? d->shown[field] : field == 0 ? d->x : field == 1 ? d->node_strain : d->speed;
}

static drape_status load(const drape_report_data *d, int64_t frame)
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

static const drape_collider *collider_of(const drape_report_data *d, int32_t body)
{
    return &d->run->model->colliders[d->bodies[body].collider];
}

static size_t load_body(const drape_report_data *d, int32_t body, int64_t frame)
{
    const drape_collider *collider = collider_of(d, body);
    drape_sequence_points(&collider->frames, d->run->record.times[frame], d->points);
    return 3 * (size_t)collider->shape.point_count;
}

static drape_status find_bodies(drape_report_data *d)
{
    const drape_model *model = d->run->model;
    size_t most = 0;
    d->bodies = drape_arena_take(&d->arena, (size_t)model->collider_count, sizeof *d->bodies);
    for (int32_t i = 0; d->bodies && i < model->collider_count; i++) {
        drape_report_body *body = &d->bodies[d->body_count];
        if (model->colliders[i].frames.frame_count == 0)
            continue;
        *body = (drape_report_body){.collider = i, .field = {.name = body->block, .unit = "m", .width = 3}};
        snprintf(body->block, sizeof body->block, "body%d", (int)i);
        most = (size_t)fmax((double)most, model->colliders[i].shape.point_count);
        d->body_count++;
    }
    d->points = drape_arena_take(&d->arena, most, 3 * sizeof *d->points);
    return drape_arena_status(&d->arena);
}

/* ---- Which frames, and ranges ---- */

static drape_status choose_frames(drape_report_data *d, size_t max_bytes)
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

static void extend_range(drape_report_field *field, const double *values, size_t count, double high[3])
{
    for (size_t i = 0; i < count; i++) {
        size_t k = i % (size_t)field->width;
        if (values[i] < field->low[k])
            field->low[k] = values[i];
        if (values[i] > high[k])
            high[k] = values[i];
    }
}

static void end_range(drape_report_field *field, const double high[3])
{
    for (int k = 0; k < field->width; k++)
        field->step[k] = (high[k] - field->low[k]) / LEVELS;
}

static drape_status find_ranges(drape_report_data *d)
{
    static const drape_report_field fields[DRAPE_REPORT_FIELDS] = {
        {"positions", "m", 3, {0}, {0}}, {"strain", "1", 1, {0}, {0}}, {"speed", "m/s", 1, {0}, {0}}};
    static const double lowest[3] = {DBL_MAX, DBL_MAX, DBL_MAX}, highest[3] = {-DBL_MAX, -DBL_MAX, -DBL_MAX};
    double high[DRAPE_REPORT_FIELDS][3];
    size_t nodes = (size_t)d->run->model->surface.node_count;
    memcpy(d->fields, fields, sizeof fields);
    for (int f = 0; f < DRAPE_REPORT_FIELDS; f++) {
        memcpy(d->fields[f].low, lowest, sizeof lowest);
        memcpy(high[f], highest, sizeof highest);
    }
    for (int64_t k = 0; k < d->kept; k++) {
        drape_status status = load(d, d->frame[k]);
        if (status)
            return status;
        for (int f = 0; f < DRAPE_REPORT_FIELDS; f++)
            extend_range(&d->fields[f], values_of(d, f), nodes * (size_t)d->fields[f].width, high[f]);
    }
    for (int f = 0; f < DRAPE_REPORT_FIELDS; f++)
        end_range(&d->fields[f], high[f]);
    for (int32_t b = 0; b < d->body_count; b++) {
        drape_report_field *field = &d->bodies[b].field;
        memcpy(field->low, lowest, sizeof lowest);
        memcpy(high[0], highest, sizeof highest);
        for (int64_t k = 0; k < d->kept; k++)
            extend_range(field, d->points, load_body(d, b, d->frame[k]), high[0]);
        end_range(field, high[0]);
    }
    return DRAPE_OK;
}

drape_status drape_report_data_make(const drape_report_source *run, size_t max_bytes, drape_report_data *data)
{
    const drape_model *model = run->model;
    const size_t nodes = (size_t)model->node_count;
    *data = (drape_report_data){.run = run, .arena = drape_arena_of(run->ctx)};
    data->x = drape_arena_take(&data->arena, 3 * nodes, sizeof *data->x);
    data->before = drape_arena_take(&data->arena, 3 * nodes, sizeof *data->before);
    data->after = drape_arena_take(&data->arena, 3 * nodes, sizeof *data->after);
    data->strain = drape_arena_take(&data->arena, 2 * (size_t)model->triangle_count, sizeof *data->strain);
    data->node_strain = drape_arena_take(&data->arena, nodes, sizeof *data->node_strain);
    data->speed = drape_arena_take(&data->arena, nodes, sizeof *data->speed);
    if (model->surface.bound) {
        const size_t shown = (size_t)model->surface.node_count;
        data->normals = drape_arena_take(&data->arena, 3 * nodes, sizeof *data->normals);
        for (int f = 0; f < DRAPE_REPORT_FIELDS; f++)
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

static void put_values(encoder *e, const drape_report_field *f, const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        const size_t k = i % (size_t)f->width;
        const double steps = f->step[k] > 0 ? floor((values[i] - f->low[k]) / f->step[k] + 0.5) : 0;
        const unsigned level = !(steps > 0) ? 0 : steps > LEVELS ? LEVELS : (unsigned)steps;
        put_byte(e, level);
        put_byte(e, level >> 8);
    }
}

drape_status drape_report_put_field(const drape_report_data *data, int field, drape_file *file)
{
    const drape_report_field *f = &data->fields[field];
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

drape_status drape_report_put_body(const drape_report_data *data, int32_t body, drape_file *file)
{
    encoder e = {.file = file};
    drape_status status = DRAPE_OK;
    for (int64_t k = 0; k < data->kept && !(status = drape_check_cancel(data->run->ctx)); k++)
        put_values(&e, &data->bodies[body].field, data->points, load_body(data, body, data->frame[k]));
    if (e.count > 0)
        put_group(&e);
    return status;
}

void drape_report_put_triangles(const drape_report_data *data, drape_file *file)
{
    const drape_render_surface *surface = &data->run->model->surface;
    encoder e = {.file = file};
    for (size_t i = 0; i < 3 * (size_t)surface->triangle_count; i++)
        for (int b = 0; b < 4; b++)
            put_byte(&e, (uint32_t)surface->triangle[i] >> 8 * b);
    if (e.count > 0)
        put_group(&e);
}
