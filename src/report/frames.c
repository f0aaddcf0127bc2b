/* frames.c: the frames of a page: which are kept, and their fields in 16 bits. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "base/vec3.h"
#include "report/data.h"

#define LEVELS 65535

/* ---- Fields of one frame ---- */

/* The mean of the larger principal strain of the triangles around a node, weighted by their areas at rest. */
static void find_strain(const drape_report_data *d)
{
    const drape_model *model = d->run->model;
    drape_model_strain(model, d->x, d->strain);
    memset(d->node_strain, 0, (size_t)model->node_count * sizeof *d->node_strain);
    for (int32_t c = 0; c < model->cloth_count; c++) {
        const drape_cloth *cloth = &model->cloths[c];
        for (int32_t i = 0; i < cloth->mesh.triangle_count; i++) {
            size_t t = (size_t)(cloth->first_triangle + i);
            for (int k = 0; k < 3; k++)
                d->node_strain[model->triangle[3 * t + (size_t)k]] +=
                    d->strain[2 * t] * cloth->mesh.triangle_area[i] / 3;
        }
    }
    for (int32_t i = 0; i < model->node_count; i++)
        d->node_strain[i] /= d->weight[i];
}

/* Centred differences of positions; one-sided at the ends of the run. */
static drape_status find_speed(const drape_report_data *d, int64_t frame)
{
    const drape_report_source *run = d->run;
    int64_t before = frame > 0 ? frame - 1 : 0, after = frame + 1 < run->record.frames ? frame + 1 : frame;
    double h = run->record.times[after] - run->record.times[before];
    drape_status status = drape_record_read(&run->record, before, d->other);
    if (!status)
        status = drape_record_read(&run->record, after, d->v);
    for (int32_t i = 0; !status && i < run->model->node_count; i++) {
        double way[3];
        vec3_sub(d->v + 3 * (size_t)i, d->other + 3 * (size_t)i, way);
        d->speed[i] = h > 0 ? vec3_norm(way) / h : 0;
    }
    return status;
}

static const double *values_of(const drape_report_data *d, int field)
{
    return field == 0 ? d->x : field == 1 ? d->node_strain : d->speed;
}

static drape_status load(const drape_report_data *d, int64_t frame)
{
    drape_status status = drape_heed(d->run->ctx);
    if (!status)
        status = drape_record_read(&d->run->record, frame, d->x);
    if (status)
        return status;
    find_strain(d);
    return find_speed(d, frame);
}

/* ---- Which frames, and ranges ---- */

/* 16 bits a number, and in base64 four thirds of that. */
static double bytes_a_frame(const drape_report_source *run)
{
    return 5 * 2 * 4.0 / 3 * run->model->node_count;
}

static drape_status choose_frames(drape_report_data *d, size_t most_bytes)
{
    int64_t all = d->run->record.frames;
    double room = floor((double)most_bytes / bytes_a_frame(d->run));
    d->kept = room < 2 ? 2 : room < (double)all ? (int64_t)room : all;
    d->kept = d->kept < all ? d->kept : all;
    d->frame = drape_alloc(d->run->ctx, (size_t)d->kept, sizeof *d->frame);
    if (!d->frame)
        return DRAPE_E_MEMORY;
    for (int64_t k = 0; k < d->kept; k++)
        d->frame[k] =
            d->kept == 1 ? 0 : (int64_t)floor((double)k * (double)(all - 1) / (double)(d->kept - 1) + 0.5);
    return DRAPE_OK;
}

static void widen(drape_report_field *field, const double *values, size_t count, double high[3])
{
    for (size_t i = 0; i < count; i++) {
        size_t k = i % (size_t)field->width;
        if (values[i] < field->low[k])
            field->low[k] = values[i];
        if (values[i] > high[k])
            high[k] = values[i];
    }
}

static drape_status find_ranges(drape_report_data *d)
{
    static const drape_report_field fields[DRAPE_REPORT_FIELDS] = {
        {"positions", "m", 3, {0}, {0}}, {"strain", "1", 1, {0}, {0}}, {"speed", "m/s", 1, {0}, {0}}};
    double high[DRAPE_REPORT_FIELDS][3];
    size_t nodes = (size_t)d->run->model->node_count;
    memcpy(d->fields, fields, sizeof fields);
    for (int f = 0; f < DRAPE_REPORT_FIELDS; f++)
        for (int k = 0; k < 3; k++) {
            d->fields[f].low[k] = DBL_MAX;
            high[f][k] = -DBL_MAX;
        }
    for (int64_t k = 0; k < d->kept; k++) {
        drape_status status = load(d, d->frame[k]);
        if (status)
            return status;
        for (int f = 0; f < DRAPE_REPORT_FIELDS; f++)
            widen(&d->fields[f], values_of(d, f), nodes * (size_t)d->fields[f].width, high[f]);
    }
    for (int f = 0; f < DRAPE_REPORT_FIELDS; f++)
        for (int k = 0; k < d->fields[f].width; k++)
            d->fields[f].step[k] = (high[f][k] - d->fields[f].low[k]) / LEVELS;
    return DRAPE_OK;
}

static drape_status take_room(drape_report_data *d)
{
    drape_context *ctx = d->run->ctx;
    const drape_model *model = d->run->model;
    size_t nodes = (size_t)model->node_count;
    d->x = drape_alloc(ctx, 3 * nodes, sizeof *d->x);
    d->v = drape_alloc(ctx, 3 * nodes, sizeof *d->v);
    d->other = drape_alloc(ctx, 3 * nodes, sizeof *d->other);
    d->strain = drape_alloc(ctx, 2 * (size_t)model->triangle_count, sizeof *d->strain);
    d->weight = drape_alloc(ctx, nodes, sizeof *d->weight);
    d->node_strain = drape_alloc(ctx, nodes, sizeof *d->node_strain);
    d->speed = drape_alloc(ctx, nodes, sizeof *d->speed);
    if (!d->x || !d->v || !d->other || !d->strain || !d->weight || !d->node_strain || !d->speed)
        return DRAPE_E_MEMORY;
    for (int32_t c = 0; c < model->cloth_count; c++)
        memcpy(d->weight + model->cloths[c].first_node, model->cloths[c].mesh.node_area,
               (size_t)model->cloths[c].mesh.node_count * sizeof *d->weight);
    return DRAPE_OK;
}

drape_status drape_report_data_make(const drape_report_source *run, size_t most_bytes,
                                    drape_report_data *data)
{
    *data = (drape_report_data){.run = run};
    drape_status status = take_room(data);
    if (!status)
        status = choose_frames(data, most_bytes);
    return status ? status : find_ranges(data);
}

void drape_report_data_free(drape_report_data *data)
{
    drape_context *ctx = data->run ? data->run->ctx : NULL;
    void *const rooms[] = {data->frame,  data->x,      data->v,           data->other,
                           data->strain, data->weight, data->node_strain, data->speed};
    for (size_t i = 0; ctx && i < sizeof rooms / sizeof *rooms; i++)
        drape_free(ctx, rooms[i]);
    *data = (drape_report_data){.run = NULL};
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

static void end_group(encoder *e)
{
    if (e->count > 0)
        put_group(e);
}

/* ---- Into the page ---- */

static unsigned level_of(const drape_report_field *field, int k, double value)
{
    double level = field->step[k] > 0 ? floor((value - field->low[k]) / field->step[k] + 0.5) : 0;
    return level < 0 ? 0 : level > LEVELS ? LEVELS : (unsigned)level;
}

drape_status drape_report_put_field(const drape_report_data *data, int field, drape_file *file)
{
    const drape_report_field *f = &data->fields[field];
    encoder e = {.file = file};
    for (int64_t k = 0; k < data->kept; k++) {
        drape_status status = load(data, data->frame[k]);
        if (status)
            return status;
        const double *values = values_of(data, field);
        for (size_t i = 0; i < (size_t)data->run->model->node_count * (size_t)f->width; i++) {
            unsigned level = level_of(f, (int)(i % (size_t)f->width), values[i]);
            put_byte(&e, level);
            put_byte(&e, level >> 8);
        }
    }
    end_group(&e);
    return DRAPE_OK;
}

void drape_report_put_triangles(const drape_report_data *data, drape_file *file)
{
    const drape_model *model = data->run->model;
    encoder e = {.file = file};
    for (size_t i = 0; i < 3 * (size_t)model->triangle_count; i++)
        for (int b = 0; b < 4; b++)
            put_byte(&e, (uint32_t)model->triangle[i] >> 8 * b);
    end_group(&e);
}
