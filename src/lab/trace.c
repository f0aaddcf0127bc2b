/* trace.c: see trace.h. */
#include "lab/trace.h"

#include "base/vec3.h"
#include "model/model.h"

#include <math.h>
#include <string.h>

drape_status lab_trace_create(drape_arena *arena, size_t size, int64_t room, lab_trace *trace)
{
    *trace = (lab_trace){.size = size, .room = room};
    trace->x = drape_arena_take(arena, size * (size_t)room, sizeof *trace->x);
    return trace->x ? DRAPE_OK : DRAPE_E_MEMORY;
}

void lab_trace_add(lab_trace *trace, const double *x)
{
    if (trace->frames < trace->room)
        memcpy(trace->x + trace->size * (size_t)trace->frames++, x, trace->size * sizeof *x);
}

const double *lab_trace_end(const lab_trace *trace)
{
    return trace->x + trace->size * (size_t)(trace->frames - 1);
}

double lab_distance(const drape_model *model, const double *a, const double *b)
{
    const uint8_t *pinned = drape_model_pinned(model);
    double sum = 0;
    int64_t nodes = 0;
    for (int32_t i = 0; i < drape_model_node_count(model); i++) {
        if (pinned[i])
            continue;
        double d[3];
        vec3_sub(a + 3 * (size_t)i, b + 3 * (size_t)i, d);
        sum += vec3_dot(d, d);
        nodes++;
    }
    return nodes ? sqrt(sum / (double)nodes) : 0;
}

double lab_correct_digits(const drape_model *model, const double *x, const double *y)
{
    const double *rest = drape_model_rest_positions(model);
    double largest = 0;
    for (size_t i = 0; i < 3 * (size_t)drape_model_node_count(model); i++)
        largest = fmax(largest, fabs(x[i] - y[i]) / (model->length + fabs(y[i] - rest[i])));
    return largest > 0 ? -log10(largest) : INFINITY;
}

drape_status lab_probe_create(drape_arena *arena, const drape_model *model, lab_probe *probe)
{
    const size_t count = (size_t)drape_model_node_count(model);
    *probe = (lab_probe){.count = count, .rest = drape_arena_take(arena, 3 * count, sizeof *probe->rest)};
    if (!probe->rest)
        return DRAPE_E_MEMORY;
    memcpy(probe->rest, drape_model_rest_positions(model), 3 * count * sizeof *probe->rest);
    return DRAPE_OK;
}

/* The barycentric coordinates of the projection of p on a triangle's plane. Returns the square of p's
 * distance from the triangle if they are all positive, more otherwise. */
static double place_in(const double *rest, const int32_t *triangle, const double *p, double *weights)
{
    const double *a = rest + 3 * (size_t)triangle[0];
    double u[3], v[3], w[3];
    vec3_sub(rest + 3 * (size_t)triangle[1], a, u);
    vec3_sub(rest + 3 * (size_t)triangle[2], a, v);
    vec3_sub(p, a, w);
    double uu = vec3_dot(u, u), uv = vec3_dot(u, v), vv = vec3_dot(v, v), wu = vec3_dot(w, u),
           wv = vec3_dot(w, v), det = uu * vv - uv * uv, outside = 0, off[3];
    weights[1] = (vv * wu - uv * wv) / det;
    weights[2] = (uu * wv - uv * wu) / det;
    weights[0] = 1 - weights[1] - weights[2];
    for (int k = 0; k < 3; k++)
        off[k] = w[k] - weights[1] * u[k] - weights[2] * v[k];
    for (int k = 0; k < 3; k++)
        outside = fmax(outside, -weights[k]);
    return vec3_dot(off, off) + outside * outside * (uu + vv);
}

void lab_probe_take(const lab_probe *probe, size_t i, const drape_model *model, const double *x,
                    double out[3])
{
    const double *rest = drape_model_rest_positions(model);
    const int32_t *triangles = drape_model_triangles(model), *home = triangles;
    double best = INFINITY, weights[3], chosen[3] = {0};
    for (int32_t t = 0; t < drape_model_triangle_count(model) && best > 0; t++) {
        const int32_t *triangle = triangles + 3 * (size_t)t;
        const double miss = place_in(rest, triangle, probe->rest + 3 * i, weights);
        if (!(miss < best))
            continue;
        best = miss;
        home = triangle;
        memcpy(chosen, weights, sizeof chosen);
    }
    for (size_t k = 0; k < 3; k++)
        out[k] = chosen[0] * x[3 * (size_t)home[0] + k] + chosen[1] * x[3 * (size_t)home[1] + k] +
                 chosen[2] * x[3 * (size_t)home[2] + k];
}
