/*
 * sequence_glb.c: the animation of a GLB file, glTF 2.0: all triangles that its scene shows, moved by
 * nodes, skins (linear blend skinning) and morph targets, sampled at the rate of the sequence. Exporters
 * split a point where its normal or texture has a seam: points that coincide in all frames become one, and
 * points without triangles are left out, so that a surface is as closed as it looks.
 */
#include "base/hash.h"
#include "base/vec3.h"
#include "mesh/contents.h"
#include "mesh/gltf_scene.h"
#include "mesh/sequence.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TRIANGLES   4      /* the mode of a primitive */
#define MODES       7      /* of primitives */
#define ENOUGH      1e-6   /* of a frame, by which the last may be behind the end of the animation */
#define MOST_FRAMES 1e15   /* for a conversion to int64; far more than are allowed */
#define POSE        32     /* operations for a node, a joint or a channel in a frame */
#define MAX_WORK    0x1p34 /* operations for all frames */

/* The joints of a skin. */
typedef struct skin {
    int32_t count;
    int32_t *joint;          /* (count) nodes */
    drape_gltf_map *inverse; /* (count) from the mesh to the joint, as they were bound */
    drape_gltf_map *now;     /* (count) of the pose */
} skin;

/* A primitive at a node. */
typedef struct part {
    int32_t node, first, count;  /* its points, among all */
    int64_t triangle, triangles; /* its first, among all; their number */
    bool mirrored;               /* its map turns it inside out, so that its triangles are turned, too */
    const double *x;             /* (count x 3) */
    const double **target;       /* (targets) each (count x 3); NULL: it moves nothing */
    int32_t targets, sets;       /* sets of four joints each */
    double **joint, **weight;    /* (sets) each (count x 4) */
} part;

typedef struct reader {
    const drape_sequence_source *source;
    drape_arena arena; /* of what is read */
    drape_gltf gltf;
    drape_gltf_scene scene;
    skin *skins;
    part *parts;
    int32_t part_count, part_room;
    int32_t *corner; /* (triangle_count x 3) */
    int64_t point_count, triangle_count, triangle_room;
    double work; /* operations for a frame */
} reader;

#define FAIL(r, ...) drape_mesh_fail((r)->source->ctx, &(r)->source->file, 0, __VA_ARGS__)

/* ---- Skins ---- */

static drape_status read_skin(reader *r, int32_t index)
{
    const json_t *object = drape_gltf_item(&r->gltf, "skins", index),
                 *joints = json_object_get(object, "joints");
    skin *s = &r->skins[index];
    char owner[48];
    int32_t matrices;
    drape_gltf_array inverse = {.count = 0};
    snprintf(owner, sizeof owner, "skin %d", (int)index);
    s->count = (int32_t)json_array_size(joints);
    if (s->count == 0)
        return FAIL(r, "%s has no joints", owner);
    r->work += POSE * (double)s->count;
    s->joint = drape_arena_take(&r->arena, (size_t)s->count, sizeof *s->joint);
    s->inverse = drape_arena_take(&r->arena, (size_t)s->count, sizeof *s->inverse);
    s->now = drape_arena_take(&r->arena, (size_t)s->count, sizeof *s->now);
    drape_status status = drape_gltf_index(&r->gltf, owner, object, "inverseBindMatrices",
                                           drape_gltf_count(&r->gltf, "accessors"), &matrices);
    if (!s->joint || !s->inverse || !s->now)
        return DRAPE_E_MEMORY;
    if (!status && matrices >= 0)
        status =
            drape_gltf_read(&r->gltf, &r->arena, matrices,
                            &(drape_gltf_want){"inverse bind matrices", "MAT4", false, s->count}, &inverse);
    if (!status && inverse.value)
        status = drape_gltf_check_finite(&r->gltf, owner, "inverse bind matrices", 16 * (size_t)s->count,
                                         inverse.value);
    for (int32_t k = 0; !status && k < s->count; k++) {
        static const double none[16] = {[0] = 1, [5] = 1, [10] = 1, [15] = 1};
        s->inverse[k] = drape_gltf_map_of(inverse.value ? inverse.value + 16 * (size_t)k : none);
        status = drape_gltf_index_of(&r->gltf, owner, json_array_get(joints, (size_t)k), r->scene.node_count,
                                     &s->joint[k]);
    }
    return status;
}

static drape_status read_skins(reader *r)
{
    const int32_t count = drape_gltf_count(&r->gltf, "skins");
    drape_status status = DRAPE_OK;
    r->skins = drape_arena_take(&r->arena, (size_t)count, sizeof *r->skins);
    for (int32_t i = 0; r->skins && !status && i < count; i++)
        status = read_skin(r, i);
    return r->skins ? status : DRAPE_E_MEMORY;
}

/* ---- Primitives ---- */

/* One of the attributes of a primitive; NULL if it has none of this name. */
static drape_status read_attribute(reader *r, const char *owner, const json_t *attributes, const char *name,
                                   const drape_gltf_want *want, drape_gltf_array *out)
{
    int32_t accessor;
    const drape_status status = drape_gltf_index(&r->gltf, owner, attributes, name,
                                                 drape_gltf_count(&r->gltf, "accessors"), &accessor);
    *out = (drape_gltf_array){.count = 0};
    return status || accessor < 0 ? status : drape_gltf_read(&r->gltf, &r->arena, accessor, want, out);
}

/* Weights are scaled to a sum of 1. */
static drape_status check_influences(reader *r, const char *owner, const part *p)
{
    const int32_t joints = r->skins[r->scene.nodes[p->node].skin].count;
    for (size_t i = 0; i < (size_t)p->count; i++) {
        double sum = 0;
        for (int k = 0; k < 4 * p->sets; k++) {
            const double joint = p->joint[k / 4][4 * i + (size_t)(k % 4)],
                         w = p->weight[k / 4][4 * i + (size_t)(k % 4)];
            if (!(w >= 0 && w <= 1e9))
                return FAIL(r, "%s: point %zu: weight %g; weights must be finite and not negative", owner, i,
                            w);
            if (w > 0 && !(joint < joints))
                return FAIL(r, "%s: point %zu: joint %g; the skin has joints 0 to %d", owner, i, joint,
                            (int)joints - 1);
            sum += w;
        }
        if (!(sum > 0))
            return FAIL(r, "%s: point %zu has no weights", owner, i);
        for (int k = 0; k < 4 * p->sets; k++)
            p->weight[k / 4][4 * i + (size_t)(k % 4)] /= sum;
    }
    return DRAPE_OK;
}

/* How many attributes have a name that begins so. */
static int32_t count_sets(const json_t *attributes, const char *start)
{
    const char *name;
    json_t *value;
    int32_t count = 0;
    json_object_foreach((json_t *)attributes, name, value) count += strncmp(name, start, strlen(start)) == 0;
    return count;
}

/* Sets are numbered from 0 on without a gap. */
static drape_status read_influences(reader *r, const char *owner, const json_t *attributes, part *p)
{
    p->sets = count_sets(attributes, "JOINTS_");
    if (p->sets == 0)
        return FAIL(r, "%s: its node has a skin, and it has no JOINTS_0 and WEIGHTS_0", owner);
    if (count_sets(attributes, "WEIGHTS_") != p->sets)
        return FAIL(r, "%s: it has %d sets of joints, and %d of weights", owner, (int)p->sets,
                    (int)count_sets(attributes, "WEIGHTS_"));
    p->joint = drape_arena_take(&r->arena, (size_t)p->sets, sizeof *p->joint);
    p->weight = drape_arena_take(&r->arena, (size_t)p->sets, sizeof *p->weight);
    if (!p->joint || !p->weight)
        return DRAPE_E_MEMORY;
    for (int32_t k = 0; k < p->sets; k++) {
        drape_gltf_array joint, weight;
        char name[2][24];
        snprintf(name[0], sizeof name[0], "JOINTS_%d", (int)k);
        snprintf(name[1], sizeof name[1], "WEIGHTS_%d", (int)k);
        drape_status status = read_attribute(r, owner, attributes, name[0],
                                             &(drape_gltf_want){name[0], "VEC4", true, p->count}, &joint);
        if (!status)
            status = read_attribute(r, owner, attributes, name[1],
                                    &(drape_gltf_want){name[1], "VEC4", false, p->count}, &weight);
        if (!status && (!joint.value || !weight.value))
            status = FAIL(r, "%s: of %d sets of joints and weights it has no %s", owner, (int)p->sets,
                          joint.value ? name[1] : name[0]);
        if (status)
            return status;
        p->joint[k] = joint.value;
        p->weight[k] = weight.value;
    }
    return check_influences(r, owner, p);
}

static drape_status read_targets(reader *r, const char *owner, const json_t *primitive, part *p)
{
    const json_t *targets = json_object_get(primitive, "targets");
    const int32_t weights = r->scene.nodes[p->node].weight_count;
    drape_status status = DRAPE_OK;
    if ((int32_t)json_array_size(targets) != weights)
        return FAIL(r, "%s: %zu morph targets; the first primitive of the mesh has %d", owner,
                    json_array_size(targets), (int)weights);
    p->targets = weights;
    p->target = drape_arena_take(&r->arena, (size_t)weights, sizeof *p->target);
    for (int32_t k = 0; p->target && !status && k < weights; k++) {
        drape_gltf_array moves;
        status =
            read_attribute(r, owner, json_array_get(targets, (size_t)k), "POSITION",
                           &(drape_gltf_want){"POSITION of a morph target", "VEC3", false, p->count}, &moves);
        p->target[k] = moves.value;
    }
    return p->target ? status : DRAPE_E_MEMORY;
}

static drape_status reserve_triangles(reader *r, int64_t more)
{
    if (r->triangle_count + more > DRAPE_MAX_TRIANGLES)
        return FAIL(r, "more than %d triangles", DRAPE_MAX_TRIANGLES);
    if (r->triangle_count + more <= r->triangle_room)
        return DRAPE_OK;
    r->triangle_room = 2 * r->triangle_room + more;
    int32_t *corner = drape_arena_resize(&r->arena, r->corner, (size_t)r->triangle_room, 3 * sizeof *corner);
    if (!corner)
        return DRAPE_E_MEMORY;
    r->corner = corner;
    return DRAPE_OK;
}

/* Without indices, each three points are a triangle. */
static drape_status read_triangles(reader *r, const char *owner, const json_t *primitive, const part *p)
{
    drape_gltf_array index;
    drape_status status = read_attribute(r, owner, primitive, "indices",
                                         &(drape_gltf_want){"indices", "SCALAR", true, -1}, &index);
    if (status)
        return status;
    const int64_t corners = index.value ? index.count : p->count;
    if (corners % 3 != 0)
        return FAIL(r, "%s: %lld corners of triangles; they must be a multiple of 3", owner,
                    (long long)corners);
    status = reserve_triangles(r, corners / 3);
    for (int64_t i = 0; !status && i < corners; i++) {
        const double at = index.value ? index.value[i] : (double)i;
        if (!(at < p->count))
            return FAIL(r, "%s: index %.0f; it has points 0 to %d", owner, at, (int)p->count - 1);
        r->corner[3 * r->triangle_count + i] = p->first + (int32_t)at;
    }
    r->triangle_count += status ? 0 : corners / 3;
    return status;
}

static drape_status read_primitive(reader *r, int32_t node, int32_t mesh, const json_t *primitive, int number)
{
    const json_t *attributes = json_object_get(primitive, "attributes");
    part p = {.node = node, .first = (int32_t)r->point_count, .triangle = r->triangle_count};
    int32_t mode;
    drape_gltf_array x;
    char owner[80];
    snprintf(owner, sizeof owner, "mesh %d, primitive %d", (int)mesh, number);
    drape_status status = drape_gltf_index(&r->gltf, owner, primitive, "mode", MODES, &mode);
    if (!status && mode > TRIANGLES)
        status =
            FAIL(r, "%s: its mode is %d; triangles, 4, are read, and no strips and fans", owner, (int)mode);
    if (status || (mode >= 0 && mode < TRIANGLES))
        return status; /* points and lines show no triangles */
    status = read_attribute(r, owner, attributes, "POSITION",
                            &(drape_gltf_want){"POSITION", "VEC3", false, -1}, &x);
    if (status)
        return status;
    if (!x.value)
        return FAIL(r, "%s has no POSITION", owner);
    if (r->point_count + x.count > DRAPE_MAX_NODES)
        return FAIL(r, "more than %d points", DRAPE_MAX_NODES);
    p.x = x.value;
    p.count = (int32_t)x.count;
    status = read_triangles(r, owner, primitive, &p);
    p.triangles = r->triangle_count - p.triangle;
    if (!status)
        status = read_targets(r, owner, primitive, &p);
    if (!status && r->scene.nodes[node].skin >= 0)
        status = read_influences(r, owner, attributes, &p);
    if (status)
        return status;
    if (r->part_count == r->part_room) {
        r->part_room = 2 * r->part_room + 8;
        part *parts = drape_arena_resize(&r->arena, r->parts, (size_t)r->part_room, sizeof *parts);
        if (!parts)
            return DRAPE_E_MEMORY;
        r->parts = parts;
    }
    r->parts[r->part_count++] = p;
    r->point_count += p.count;
    r->work += (double)p.count * (1.0 + p.targets + 4.0 * p.sets);
    return DRAPE_OK;
}

static drape_status read_parts(reader *r)
{
    drape_status status = DRAPE_OK;
    for (int32_t i = 0; !status && i < r->scene.node_count; i++) {
        const drape_gltf_node *node = &r->scene.nodes[i];
        const json_t *primitive;
        size_t k;
        if (!node->drawn || node->mesh < 0)
            continue;
        json_array_foreach(json_object_get(drape_gltf_item(&r->gltf, "meshes", node->mesh), "primitives"), k,
                           primitive)
        {
            if (!status)
                status = read_primitive(r, i, node->mesh, primitive, (int)k);
        }
    }
    return status || r->triangle_count > 0 ? status : FAIL(r, "its scene shows no triangles");
}

/* ---- Frames ---- */

static void pose(reader *r, double t)
{
    drape_gltf_scene_pose(&r->scene, t);
    for (int32_t i = 0; i < drape_gltf_count(&r->gltf, "skins"); i++)
        for (int32_t k = 0; k < r->skins[i].count; k++)
            r->skins[i].now[k] =
                drape_gltf_map_product(&r->scene.nodes[r->skins[i].joint[k]].world, &r->skins[i].inverse[k]);
}

/* The node of a skinned mesh does not move it. */
static void place_point(const reader *r, const part *p, size_t point, double *out)
{
    const drape_gltf_node *node = &r->scene.nodes[p->node];
    double x[3] = {p->x[3 * point], p->x[3 * point + 1], p->x[3 * point + 2]}, y[3], sum[3] = {0};
    for (int32_t k = 0; k < p->targets; k++)
        for (size_t axis = 0; p->target[k] && node->now_weight[k] != 0 && axis < 3; axis++)
            x[axis] += node->now_weight[k] * p->target[k][3 * point + axis];
    if (p->sets == 0)
        drape_gltf_map_point(&node->world, x, sum);
    for (int k = 0; k < 4 * p->sets; k++) {
        const double weight = p->weight[k / 4][4 * point + (size_t)(k % 4)];
        if (!(weight > 0))
            continue;
        drape_gltf_map_point(&r->skins[node->skin].now[(int32_t)p->joint[k / 4][4 * point + (size_t)(k % 4)]],
                             x, y);
        for (int axis = 0; axis < 3; axis++)
            sum[axis] += weight * y[axis];
    }
    for (int axis = 0; axis < 3; axis++)
        out[axis] = sum[axis] + 0.0; /* no -0, so that equal points have equal bytes */
}

/* Whether the map of a part mirrors it; of one with a skin, that of its first point. */
static bool is_mirrored(const reader *r, const part *p)
{
    const drape_gltf_node *node = &r->scene.nodes[p->node];
    drape_gltf_map map = {.column = {{0}}};
    if (p->sets == 0)
        return drape_gltf_map_determinant(&node->world) < 0;
    for (int k = 0; k < 4 * p->sets; k++) {
        const double weight = p->weight[k / 4][k % 4];
        for (int i = 0; weight > 0 && i < 3; i++)
            vec3_add_scaled(weight, r->skins[node->skin].now[(int32_t)p->joint[k / 4][k % 4]].column[i],
                            map.column[i]);
    }
    return drape_gltf_map_determinant(&map) < 0;
}

/* Where a map mirrors, the order of the corners is reversed (section 3.7.4), so that their outside stays the
 * same. That must hold in all frames: triangles do not change between them. */
static drape_status check_mirrors(reader *r, int32_t frame, drape_mesh *mesh)
{
    for (int32_t k = 0; k < r->part_count; k++) {
        part *p = &r->parts[k];
        const bool mirrored = is_mirrored(r, p);
        if (frame > 0 && mirrored != p->mirrored)
            return FAIL(r, "frame %d: node %d %s its mesh, and in frame 0 it %s", (int)frame, (int)p->node,
                        mirrored ? "mirrors" : "does not mirror", mirrored ? "does not" : "does");
        p->mirrored = mirrored;
        for (int64_t t = p->triangle; frame == 0 && mirrored && t < p->triangle + p->triangles; t++) {
            int32_t *corner = mesh->triangle + 3 * t;
            const int32_t second = corner[1];
            corner[1] = corner[2];
            corner[2] = second;
        }
    }
    return DRAPE_OK;
}

static drape_status sample(reader *r, drape_mesh *mesh, drape_sequence *out)
{
    const drape_gltf_scene *scene = &r->scene;
    const double rate = r->source->rate,
                 frames = fmin(ceil((scene->end - scene->start) * rate - ENOUGH) + 1, MOST_FRAMES);
    const double work = r->work + POSE * ((double)scene->node_count + scene->channel_count);
    if (frames * work > MAX_WORK)
        return FAIL(r,
                    "%.0f frames of %.3g points, joints and morph targets are more than %.3g; lower the rate",
                    frames, work, MAX_WORK);
    drape_status status = drape_mesh_allocate(r->source->ctx, &r->source->file, (size_t)r->point_count,
                                              (size_t)r->triangle_count, mesh);
    if (!status)
        status = drape_sequence_allocate(r->source, mesh, (int64_t)frames, out);
    if (status)
        return status;
    out->first = scene->start * rate;
    out->last = scene->end * rate;
    memcpy(mesh->triangle, r->corner, 3 * (size_t)r->triangle_count * sizeof *mesh->triangle);
    for (int32_t f = 0; !status && f < out->frame_count; f++) {
        double *x = out->x + 3 * (size_t)f * (size_t)mesh->node_count;
        pose(r, fmin(scene->start + f / rate, scene->end));
        status = drape_check_cancel_after(r->source->ctx, (size_t)work);
        status = status ? status : check_mirrors(r, f, mesh);
        for (int32_t k = 0; k < r->part_count && !status; k++)
            for (int32_t i = 0; i < r->parts[k].count; i++)
                place_point(r, &r->parts[k], (size_t)i, x + 3 * (size_t)(r->parts[k].first + i));
        const drape_mesh frame = {.node_count = mesh->node_count, .x = x};
        char text[32];
        snprintf(text, sizeof text, "frame %d: ", (int)f);
        const drape_mesh_source source = {
            .pointer = r->source->file.pointer, .file = r->source->file.file, .part = text};
        if (!status)
            status = drape_mesh_validate_positions(r->source->ctx, &source, &frame);
    }
    return status;
}

/* ---- Points that are one ---- */

/* A point, with a hash of all its frames. */
typedef struct track {
    uint64_t hash;
    int32_t point;
} track;

static int compare_tracks(const void *left, const void *right)
{
    const track *a = left, *b = right;
    return a->hash != b->hash ? (a->hash > b->hash ? 1 : -1) : (a->point > b->point) - (a->point < b->point);
}

static bool are_same(const drape_sequence *frames, const track *a, const track *b)
{
    bool same = a->hash == b->hash;
    for (int32_t f = 0; same && f < frames->frame_count; f++) {
        const double *x = frames->x + 3 * (size_t)f * (size_t)frames->node_count;
        same = memcmp(x + 3 * (size_t)a->point, x + 3 * (size_t)b->point, 3 * sizeof *x) == 0;
    }
    return same;
}

/* Sets to[i] to the first point that moves as i does. */
static drape_status find_same(drape_arena *arena, const drape_sequence *frames, int32_t *to)
{
    const size_t points = (size_t)frames->node_count, count = points * (size_t)frames->frame_count;
    track *tracks = drape_arena_take(arena, points, sizeof *tracks), *first = tracks, *t = tracks;
    drape_status status = drape_arena_status(arena);
    for (size_t i = 0; !status && i < points; i++)
        tracks[i] = (track){DRAPE_HASH_START, (int32_t)i};
    for (size_t i = 0; !status && i < count; i++) {
        tracks[i % points].hash =
            drape_hash_bytes(tracks[i % points].hash, frames->x + 3 * i, 3 * sizeof *frames->x);
        status = drape_check_cancel_after(arena->ctx, 8);
    }
    if (!status)
        qsort(tracks, points, sizeof *tracks, compare_tracks);
    for (; !status && t < tracks + points; t++) {
        first = are_same(frames, first, t) ? first : t;
        to[t->point] = first->point;
        status = drape_check_cancel_after(arena->ctx, (size_t)frames->frame_count);
    }
    return status;
}

/* Triangles that have lost a side, as at the pole of a sphere, are left out. */
static void weld_triangles(drape_mesh *mesh, const int32_t *to)
{
    int32_t kept = 0;
    for (int32_t t = 0; t < mesh->triangle_count; t++) {
        const int32_t *n = mesh->triangle + 3 * (size_t)t;
        const int32_t a = to[n[0]], b = to[n[1]], c = to[n[2]];
        if (a == b || b == c || c == a)
            continue;
        mesh->triangle[3 * (size_t)kept] = a;
        mesh->triangle[3 * (size_t)kept + 1] = b;
        mesh->triangle[3 * (size_t)kept++ + 2] = c;
    }
    mesh->triangle_count = kept;
}

/* Numbers the points that have triangles anew, in their order, which lets frames be packed in place. */
static void drop_points(drape_mesh *mesh, drape_sequence *frames, int32_t *number)
{
    const size_t before = (size_t)mesh->node_count;
    int32_t kept = 0;
    memset(number, -1, before * sizeof *number);
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++)
        number[mesh->triangle[i]] = 0;
    for (size_t i = 0; i < before; i++)
        if (number[i] == 0)
            number[i] = kept++;
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++)
        mesh->triangle[i] = number[mesh->triangle[i]];
    size_t to = 0;
    for (size_t f = 0; f < (size_t)frames->frame_count; f++)
        for (size_t i = 0; i < before; i++)
            if (number[i] >= 0)
                memmove(frames->x + 3 * to++, frames->x + 3 * (f * before + i), 3 * sizeof *frames->x);
    mesh->node_count = frames->node_count = kept;
}

static drape_status weld(reader *r, drape_mesh *mesh, drape_sequence *frames)
{
    int32_t *number = drape_arena_take(&r->arena, (size_t)mesh->node_count, sizeof *number);
    const drape_status status = number ? find_same(&r->arena, frames, number) : DRAPE_E_MEMORY;
    if (status)
        return status;
    weld_triangles(mesh, number);
    drop_points(mesh, frames, number);
    return mesh->triangle_count > 0 ? DRAPE_OK : FAIL(r, "all its triangles are degenerate");
}

static drape_status read_all(reader *r, const char *data, size_t size, drape_mesh *mesh, drape_sequence *out)
{
    drape_status status = drape_gltf_open(r->source->ctx, &r->source->file, data, size, &r->gltf);
    if (!status)
        status = drape_gltf_scene_read(&r->gltf, &r->arena, &r->scene);
    if (!status)
        status = read_skins(r);
    if (!status)
        status = read_parts(r);
    if (!status)
        status = sample(r, mesh, out);
    if (!status)
        status = weld(r, mesh, out);
    drape_gltf_close(&r->gltf);
    return status;
}

static drape_status read_glb(const drape_sequence_source *source, drape_mesh *mesh, drape_sequence *out)
{
    reader r = {.source = source, .arena = drape_arena_of(source->ctx)};
    drape_contents whole = {0};
    drape_status status =
        drape_contents_read(&r.arena, source->file.pointer, source->folder, source->file.file, &whole);
    if (!status)
        status = read_all(&r, whole.data, whole.size, mesh, out);
    drape_arena_free(&r.arena);
    return status;
}

const drape_sequence_ops drape_sequence_glb = {
    .entry =
        {.name = "glb",
         .summary =
             "the first animation of a glTF 2.0 binary, by nodes, skins and morph targets, sampled at the "
             "frame rate; all triangles of its scene",
         .reference = "glTF 2.0 specification, Khronos Group 2021; Magnenat-Thalmann et al. 1988: skinning"},
    .endings = {".glb"},
    .has_triangles = true,
    .read = read_glb,
};
