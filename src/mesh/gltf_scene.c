/* gltf_scene.c: see gltf.h; interpolation as in appendix C of the specification. */
#include "mesh/gltf.h"

#include "base/elementary.h"
#include "base/rotation.h"
#include "base/search.h"
#include "base/vec3.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#define NEARLY_EQUAL 1e-6  /* [rad] below this, quaternions are interpolated linearly, to 1e-18 */
#define LEAST_TURN   1e-12 /* squared length of a quaternion that is a rotation */
#define FAIL         DRAPE_GLTF_FAIL

/* Places of a transform in drape_gltf_node.rest. */
enum { TRANSLATION = 0, ROTATION = 3, SCALE = 7 };

typedef enum interpolation { STEP, LINEAR, CUBIC } interpolation;

/* Keys of one property of a node; those of cubic splines have a tangent before and behind each value. */
struct drape_gltf_channel {
    int32_t node;
    int place; /* in rest; -1: the weights */
    interpolation kind;
    drape_gltf_array time;
    double *value; /* (keys x width, or keys x 3 x width) */
    int32_t width;
};

/* ---- Maps ---- */

void drape_gltf_map_point(const drape_gltf_map *map, const double x[3], double y[3])
{
    double sum[3] = {map->column[3][0], map->column[3][1], map->column[3][2]};
    for (int k = 0; k < 3; k++)
        vec3_add_scaled(x[k], map->column[k], sum);
    memcpy(y, sum, sizeof sum);
}

drape_gltf_map drape_gltf_map_product(const drape_gltf_map *a, const drape_gltf_map *b)
{
    drape_gltf_map out = {.column = {{0}}};
    for (int i = 0; i < 4; i++) {
        for (int k = 0; k < 3; k++)
            vec3_add_scaled(b->column[i][k], a->column[k], out.column[i]);
        vec3_add_scaled(i == 3, a->column[3], out.column[i]);
    }
    return out;
}

double drape_gltf_map_determinant(const drape_gltf_map *map)
{
    double cross[3];
    vec3_cross(map->column[0], map->column[1], cross);
    return vec3_dot(cross, map->column[2]);
}

drape_gltf_map drape_gltf_map_of(const double matrix[16])
{
    drape_gltf_map out;
    for (int i = 0; i < 4; i++)
        memcpy(out.column[i], matrix + 4 * i, sizeof out.column[i]);
    return out;
}

/* ---- Nodes ---- */

static double squared_length(const double *q)
{
    return q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
}

static void read_node(const drape_gltf_scene *s, int32_t index)
{
    drape_gltf *g = s->gltf;
    const json_t *object = drape_gltf_item(g, "nodes", index), *child;
    drape_gltf_node *n = &s->nodes[index];
    const char *owner = DRAPE_FORMAT("node %d", (int)index),
               *children = DRAPE_FORMAT("node %d: \"children\"", (int)index);
    size_t i;
    n->mesh = drape_gltf_index(g, owner, object, "mesh", drape_gltf_count(g, "meshes"));
    n->skin = drape_gltf_index(g, owner, object, "skin", drape_gltf_count(g, "skins"));
    double matrix[16] = {0};
    const double rest[10] = {0, 0, 0, 0, 0, 0, 1, 1, 1, 1};
    memcpy(n->rest, rest, sizeof rest);
    n->fixed = json_object_get(object, "matrix");
    if (n->fixed && (json_object_get(object, "translation") || json_object_get(object, "rotation") ||
                     json_object_get(object, "scale")))
        FAIL(g, "%s: it has \"matrix\" beside \"translation\", \"rotation\" or \"scale\"", owner);
    drape_gltf_numbers(g, owner, object, "matrix", 16, matrix);
    drape_gltf_numbers(g, owner, object, "translation", 3, n->rest + TRANSLATION);
    drape_gltf_numbers(g, owner, object, "rotation", 4, n->rest + ROTATION);
    drape_gltf_numbers(g, owner, object, "scale", 3, n->rest + SCALE);
    n->local = drape_gltf_map_of(matrix);
    if (!(squared_length(n->rest + ROTATION) > LEAST_TURN))
        FAIL(g, "%s: a rotation must not be 0", owner);
    /* As many weights as the first primitive of its mesh has morph targets; the node's own replace those of
     * the mesh. */
    const json_t *mesh = drape_gltf_item(g, "meshes", n->mesh),
                 *primitive = json_array_get(json_object_get(mesh, "primitives"), 0);
    const size_t count = json_array_size(json_object_get(primitive, "targets"));
    if (count > 0) {
        n->weight_count = (int32_t)count;
        n->weight = drape_gltf_take(g, count, sizeof *n->weight);
        n->now_weight = drape_gltf_take(g, count, sizeof *n->now_weight);
        if (!g->status) {
            drape_gltf_numbers(g, owner, mesh, "weights", count, n->weight);
            drape_gltf_numbers(g, owner, object, "weights", count, n->weight);
        }
    }
    json_array_foreach(json_object_get(object, "children"), i, child)
    {
        const int32_t number = drape_gltf_index_of(g, children, child, s->node_count);
        if (number < 0)
            return;
        if (s->nodes[number].parent >= 0)
            FAIL(g, "node %d is the child of nodes %d and %d", (int)number, (int)s->nodes[number].parent,
                 (int)index);
        s->nodes[number].parent = index;
    }
}

/* Roots first, then children of what is listed; what is never listed is its own ancestor. */
static void sort_nodes(drape_gltf_scene *s)
{
    int32_t listed = 0;
    for (int32_t i = 0; i < s->node_count; i++)
        if (s->nodes[i].parent < 0)
            s->order[listed++] = i;
    for (int32_t next = 0; next < listed; next++) {
        const json_t *child;
        size_t i;
        json_array_foreach(json_object_get(drape_gltf_item(s->gltf, "nodes", s->order[next]), "children"), i,
                           child)
        {
            s->order[listed++] = (int32_t)json_number_value(child);
        }
    }
    if (listed < s->node_count)
        FAIL(s->gltf, "a node is its own ancestor");
}

/* What the default scene shows, or, without scenes, all. */
static void mark_drawn(drape_gltf_scene *s)
{
    const int32_t scenes = drape_gltf_count(s->gltf, "scenes"),
                  shown = drape_gltf_index(s->gltf, "the file", s->gltf->root, "scene", scenes);
    const json_t *root;
    size_t k;
    for (int32_t i = 0; i < s->node_count; i++)
        s->nodes[i].drawn = scenes == 0;
    json_array_foreach(json_object_get(drape_gltf_item(s->gltf, "scenes", shown < 0 ? 0 : shown), "nodes"), k,
                       root)
    {
        const int32_t index = drape_gltf_index_of(s->gltf, "\"scenes\": a node", root, s->node_count);
        if (index < 0)
            return;
        s->nodes[index].drawn = true;
    }
    for (int32_t i = 0; i < s->node_count; i++) {
        drape_gltf_node *n = &s->nodes[s->order[i]];
        n->drawn = n->drawn || (n->parent >= 0 && s->nodes[n->parent].drawn);
    }
}

/* ---- The animation ---- */

static drape_status find_path(const drape_gltf_scene *s, const char *owner, const json_t *target,
                              drape_gltf_channel *c)
{
    static const struct {
        const char *name;
        int place, width;
    } paths[] = {
        {"translation", TRANSLATION, 3}, {"rotation", ROTATION, 4}, {"scale", SCALE, 3}, {"weights", -1, 0}};
    const char *path = json_string_value(json_object_get(target, "path"));
    const drape_gltf_node *node = &s->nodes[c->node];
    for (size_t i = 0; path && i < sizeof paths / sizeof *paths; i++) {
        if (strcmp(path, paths[i].name) != 0)
            continue;
        c->place = paths[i].place;
        c->width = c->place < 0 ? node->weight_count : paths[i].width;
        if (c->place >= 0 && node->fixed)
            FAIL(s->gltf, "%s: node %d has a \"matrix\": its %s cannot be animated", owner, (int)c->node,
                 path);
        return c->width > 0 ? s->gltf->status
                            : FAIL(s->gltf, "%s: node %d has no morph targets", owner, (int)c->node);
    }
    return FAIL(s->gltf, "%s: its path is %.30s; translation, rotation, scale or weights is needed", owner,
                path ? path : "missing");
}

/* The values of a rotation are VEC4, of others VEC3, of weights numbers, as many as targets for each key. */
static drape_status read_sampler(const drape_gltf_scene *s, const char *owner, const json_t *sampler,
                                 drape_gltf_channel *c)
{
    static const char *const names[] = {[STEP] = "STEP", [LINEAR] = "LINEAR", [CUBIC] = "CUBICSPLINE"};
    drape_gltf *g = s->gltf;
    const char *name = json_string_value(json_object_get(sampler, "interpolation"));
    for (c->kind = STEP; name && c->kind < CUBIC && strcmp(names[c->kind], name) != 0;)
        c->kind++;
    c->kind = name ? c->kind : LINEAR;
    if (name && strcmp(names[c->kind], name) != 0)
        return FAIL(g, "%s: its interpolation is %.30s; LINEAR, STEP or CUBICSPLINE is needed", owner, name);
    c->time =
        DRAPE_GLTF_READ(g, owner, sampler, .key = "input", .purpose = "times", .width = 1, .expected = -1);
    const int64_t keys = c->time.count * (c->kind == CUBIC ? 3 : 1);
    const drape_gltf_want want = {.key = "output",
                                  .purpose = "values of an animation",
                                  .width = c->place < 0 ? 1 : c->width,
                                  .expected = c->place < 0 ? keys * c->width : keys};
    c->value = drape_gltf_read(g, owner, sampler, &want).value;
    if (!c->time.value || !c->value)
        return FAIL(g, "%s: its sampler needs \"input\" and \"output\"", owner);
    for (int64_t k = 0; k < c->time.count; k++)
        if (!(fabs(c->time.value[k]) <= DRAPE_GLTF_LARGEST) ||
            (k > 0 && !(c->time.value[k] > c->time.value[k - 1])))
            return FAIL(g, "%s: key %" PRId64 " is at %g s; times must be within %g s and increase", owner, k,
                        c->time.value[k], DRAPE_GLTF_LARGEST);
    drape_gltf_check_finite(g, owner, "values", (size_t)(keys * c->width), c->value);
    return g->status;
}

/* Channels without a node are for extensions. */
static void read_channel(drape_gltf_scene *s, const json_t *animation, const json_t *object, int number)
{
    drape_gltf *g = s->gltf;
    const json_t *samplers = json_object_get(animation, "samplers");
    const size_t count = json_array_size(samplers);
    drape_gltf_channel *c = &s->channels[s->channel_count];
    const char *owner = DRAPE_FORMAT("animation 0, channel %d", number);
    const json_t *target = json_object_get(object, "target");
    c->node = drape_gltf_index(g, owner, target, "node", s->node_count);
    if (c->node < 0)
        return;
    const int32_t sampler =
        drape_gltf_index(g, owner, object, "sampler", count > INT32_MAX ? INT32_MAX : (int32_t)count);
    if (sampler < 0)
        FAIL(g, "%s has no sampler", owner);
    if (find_path(s, owner, target, c) ||
        read_sampler(s, owner, json_array_get(samplers, (size_t)sampler), c))
        return;
    const double first = c->time.value[0], last = c->time.value[c->time.count - 1];
    s->start = s->channel_count == 0 ? first : fmin(s->start, first);
    s->end = s->channel_count == 0 ? last : fmax(s->end, last);
    s->channel_count++;
}

void drape_gltf_scene_read(drape_gltf *g, drape_gltf_scene *s)
{
    *s = (drape_gltf_scene){.gltf = g, .node_count = drape_gltf_count(g, "nodes")};
    s->nodes = drape_gltf_take(g, (size_t)s->node_count, sizeof *s->nodes);
    s->order = drape_gltf_take(g, (size_t)s->node_count, sizeof *s->order);
    for (int32_t i = 0; !g->status && i < s->node_count; i++)
        s->nodes[i].parent = -1;
    for (int32_t i = 0; !g->status && i < s->node_count; i++)
        read_node(s, i);
    if (!g->status)
        sort_nodes(s);
    if (!g->status)
        mark_drawn(s);
    const json_t *animation = drape_gltf_item(g, "animations", 0),
                 *channels = json_object_get(animation, "channels"), *channel;
    size_t k;
    if (animation && json_array_size(channels) == 0)
        FAIL(g, "animation 0, which is the one that is read, has no channels");
    s->channels = drape_gltf_take(g, json_array_size(channels), sizeof *s->channels);
    json_array_foreach(channels, k, channel)
    {
        if (!g->status)
            read_channel(s, animation, channel, (int)k);
    }
}

/* ---- A pose ---- */

/* The rotation between two others by the smaller angle, at constant speed (Shoemake 1985). */
static void interpolate_rotation(const double *a, const double *b, double s, double *out)
{
    const double dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3],
                 size[2] = {squared_length(a), squared_length(b)};
    double sine[3], cosine;
    const double length = sqrt(size[0] * size[1]), sign = dot < 0 ? -1 : 1;
    double across = 0, weight[2] = {1 - s, s * sign};
    for (int k = 0; k < 4; k++) {
        const double d = b[k] * sign / sqrt(size[1]) - a[k] / sqrt(size[0]);
        across += d * d;
    }
    /* |b - a| = 2 sin(angle/2), exact where the angle is small */
    const double angle = 2 * drape_atan2(sqrt(across) / 2, sqrt(fmax(0, 1 - across / 4)));
    if (length > 0 && angle > NEARLY_EQUAL) {
        drape_sin_cos(angle, &sine[0], &cosine);
        drape_sin_cos((1 - s) * angle, &sine[1], &cosine);
        drape_sin_cos(s * angle, &sine[2], &cosine);
        weight[0] = sine[1] / sine[0] / sqrt(size[0]);
        weight[1] = sign * sine[2] / sine[0] / sqrt(size[1]);
    }
    for (int k = 0; k < 4; k++)
        out[k] = weight[0] * a[k] + weight[1] * b[k];
}

/* Hermite splines (appendix C.5): value, tangent behind the first key, tangent before the second. */
static void interpolate_cubic(const drape_gltf_channel *c, int64_t key, double s, double h, double *out)
{
    const double *a = c->value + 3 * key * c->width, *b = a + 3 * (size_t)c->width;
    const double s2 = s * s, s3 = s2 * s;
    for (int32_t k = 0; k < c->width; k++) {
        const double p = a[c->width + k], m = a[2 * c->width + k], q = b[c->width + k], n = b[k];
        out[k] =
            (2 * s3 - 3 * s2 + 1) * p + h * (s3 - 2 * s2 + s) * m + (3 * s2 - 2 * s3) * q + h * (s3 - s2) * n;
    }
}

static void interpolate(const drape_gltf_channel *c, double t, double *out)
{
    const double *time = c->time.value;
    int64_t low = drape_last_time(time, sizeof *time, c->time.count, t);
    low = low < 0 ? 0 : low;
    const size_t each = (size_t)c->width * (c->kind == CUBIC ? 3 : 1),
                 shift = c->kind == CUBIC ? (size_t)c->width : 0;
    const double *a = c->value + (size_t)low * each + shift;
    const bool between = low + 1 < c->time.count && t > time[low] && c->kind != STEP;
    const double h = between ? time[low + 1] - time[low] : 1, s = between ? (t - time[low]) / h : 0;
    if (!between)
        memcpy(out, a, (size_t)c->width * sizeof *out);
    else if (c->kind == CUBIC)
        interpolate_cubic(c, low, s, h, out);
    else if (c->place == ROTATION)
        interpolate_rotation(a, a + each, s, out);
    else
        for (int32_t k = 0; k < c->width; k++)
            out[k] = a[k] + s * (a[each + (size_t)k] - a[k]);
}

void drape_gltf_scene_pose(drape_gltf_scene *s, double t)
{
    static const double no_rotation[4] = {0, 0, 0, 1};
    for (int32_t i = 0; i < s->node_count; i++) {
        drape_gltf_node *n = &s->nodes[i];
        memcpy(n->now, n->rest, sizeof n->now);
        if (n->weight_count > 0)
            memcpy(n->now_weight, n->weight, (size_t)n->weight_count * sizeof *n->weight);
    }
    for (int32_t i = 0; i < s->channel_count; i++) {
        const drape_gltf_channel *c = &s->channels[i];
        drape_gltf_node *n = &s->nodes[c->node];
        interpolate(c, t, c->place < 0 ? n->now_weight : n->now + c->place);
    }
    for (int32_t i = 0; i < s->node_count; i++) {
        drape_gltf_node *n = &s->nodes[s->order[i]];
        if (!(squared_length(n->now + ROTATION) > LEAST_TURN)) /* an animation lets it vanish */
            memcpy(n->now + ROTATION, no_rotation, sizeof no_rotation);
        if (!n->fixed) {
            const double *q = n->now + ROTATION, turned[4] = {q[3], q[0], q[1], q[2]};
            double R[9];
            drape_rotation_of_quaternion(turned, R);
            for (int k = 0; k < 9; k++)
                n->local.column[k % 3][k / 3] = R[k] * n->now[SCALE + k % 3];
            memcpy(n->local.column[3], n->now + TRANSLATION, sizeof n->local.column[3]);
        }
        n->world = n->parent < 0 ? n->local : drape_gltf_map_product(&s->nodes[n->parent].world, &n->local);
    }
}
