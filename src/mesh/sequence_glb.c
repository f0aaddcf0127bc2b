/*
 * sequence_glb.c: the animation of a GLB file, glTF 2.0: all triangles that its scene shows, moved by
 * nodes, skins (linear blend skinning) and morph targets, sampled at the rate of the sequence. Exporters
 * split a point where its normal or texture has a seam: points that coincide in all frames become one, and
 * points without triangles are left out, so that a surface is as closed as it looks.
 */
#include "base/hash.h"
#include "base/vec3.h"
#include "mesh/gltf.h"
#include "mesh/sequence.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MODES        7      /* of primitives */
#define ENOUGH       1e-6   /* of a frame, by which the last may be behind the end of the animation */
#define MOST_FRAMES  1e15   /* for a conversion to int64; far more than are allowed */
#define POSE         32     /* operations for a node, a joint or a channel in a frame */
#define MAX_WORK     0x1p34 /* operations for all frames */
#define FAIL(r, ...) DRAPE_GLTF_FAIL(&(r)->gltf, __VA_ARGS__)

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
    bool mirrored;               /* its map turns it inside out: the order of corners is reversed */
    const double *x;             /* (count x 3) */
    const double **target;       /* (targets) each (count x 3); NULL: it moves nothing */
    int32_t targets, sets;       /* sets of four joints each */
    double **joint, **weight;    /* (sets) each (count x 4) */
} part;

typedef struct reader {
    const drape_sequence_source *source;
    drape_gltf gltf;
    drape_gltf_scene scene;
    skin *skins;
    part *parts;
    int32_t *corner; /* (triangle_count x 3) */
    int64_t part_count, part_capacity, point_count, triangle_count, triangle_capacity;
    double work; /* operations for a frame */
} reader;

/* ---- Skins ---- */

static void read_skin(reader *r, int32_t index)
{
    static const double none[16] = {[0] = 1, [5] = 1, [10] = 1, [15] = 1};
    drape_gltf *g = &r->gltf;
    const json_t *object = drape_gltf_item(g, "skins", index), *joints = json_object_get(object, "joints");
    skin *s = &r->skins[index];
    const char *owner = DRAPE_FORMAT("skin %d", (int)index);
    s->count = (int32_t)json_array_size(joints);
    if (s->count == 0)
        FAIL(r, "%s has no joints", owner);
    r->work += POSE * (double)s->count;
    s->joint = drape_gltf_take(g, (size_t)s->count, sizeof *s->joint);
    s->inverse = drape_gltf_take(g, (size_t)s->count, sizeof *s->inverse);
    s->now = drape_gltf_take(g, (size_t)s->count, sizeof *s->now);
    const double *inverse =
        DRAPE_GLTF_READ(g, owner, object, "inverseBindMatrices", "inverse bind matrices", 16, false, s->count)
            .value;
    if (inverse)
        drape_gltf_check_finite(g, owner, "inverse bind matrices", 16 * (size_t)s->count, inverse);
    for (int32_t k = 0; !g->status && k < s->count; k++) {
        s->inverse[k] = drape_gltf_map_of(inverse ? inverse + 16 * (size_t)k : none);
        s->joint[k] = drape_gltf_index_of(g, owner, json_array_get(joints, (size_t)k), r->scene.node_count);
    }
}

/* ---- Primitives ---- */

/* Joint or weight k of a point, of all of its sets. */
static double *influence(double *const *set, size_t point, int k)
{
    return &set[k / 4][4 * point + (size_t)(k % 4)];
}

/* Weights are scaled to a sum of 1. */
static drape_status check_influences(reader *r, const char *owner, const part *p)
{
    const int32_t joints = r->skins[r->scene.nodes[p->node].skin].count;
    for (size_t i = 0; i < (size_t)p->count; i++) {
        double sum = 0;
        for (int k = 0; k < 4 * p->sets; k++) {
            const double joint = *influence(p->joint, i, k), w = *influence(p->weight, i, k);
            if (!(w >= 0 && w <= DRAPE_GLTF_LARGEST))
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
            *influence(p->weight, i, k) /= sum;
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
static void read_influences(reader *r, const char *owner, const json_t *attributes, part *p)
{
    drape_gltf *g = &r->gltf;
    const int32_t weights = count_sets(attributes, "WEIGHTS_");
    p->sets = count_sets(attributes, "JOINTS_");
    if (p->sets == 0)
        FAIL(r, "%s: its node has a skin, and it has no JOINTS_0 and WEIGHTS_0", owner);
    if (weights != p->sets)
        FAIL(r, "%s: it has %d sets of joints, and %d of weights", owner, (int)p->sets, (int)weights);
    p->joint = drape_gltf_take(g, (size_t)p->sets, sizeof *p->joint);
    p->weight = drape_gltf_take(g, (size_t)p->sets, sizeof *p->weight);
    for (int32_t k = 0; !g->status && k < p->sets; k++) {
        char name[2][24];
        snprintf(name[0], sizeof name[0], "JOINTS_%d", (int)k);
        snprintf(name[1], sizeof name[1], "WEIGHTS_%d", (int)k);
        p->joint[k] = DRAPE_GLTF_READ(g, owner, attributes, name[0], NULL, 4, true, p->count).value;
        p->weight[k] = DRAPE_GLTF_READ(g, owner, attributes, name[1], NULL, 4, false, p->count).value;
        if (!p->joint[k] || !p->weight[k])
            FAIL(r, "%s: of %d sets of joints and weights it has no %s", owner, (int)p->sets,
                 name[p->joint[k] != NULL]);
    }
    if (!g->status)
        check_influences(r, owner, p);
}

/* Items with memory for as many as needed, and the new capacity; NULL after a failure. */
static void *grow(reader *r, void *items, int64_t needed, int64_t *capacity, size_t size)
{
    if (r->gltf.status || needed <= *capacity)
        return items;
    *capacity = *capacity + needed;
    void *grown = drape_arena_resize(r->gltf.arena, items, (size_t)*capacity, size);
    if (!grown)
        r->gltf.status = DRAPE_E_MEMORY;
    return grown ? grown : items;
}

/* Without indices, each three points are a triangle. */
static drape_status read_triangles(reader *r, const char *owner, const json_t *primitive, part *p)
{
    const drape_gltf_array index = DRAPE_GLTF_READ(&r->gltf, owner, primitive, "indices", NULL, 1, true, -1);
    const int64_t corners = index.value ? index.count : p->count;
    p->triangles = corners / 3;
    if (corners % 3 != 0)
        FAIL(r, "%s: %lld corners of triangles; they must be a multiple of 3", owner, (long long)corners);
    if (r->triangle_count + p->triangles > DRAPE_MAX_TRIANGLES)
        FAIL(r, "more than %d triangles", DRAPE_MAX_TRIANGLES);
    r->corner =
        grow(r, r->corner, r->triangle_count + p->triangles, &r->triangle_capacity, 3 * sizeof *r->corner);
    for (int64_t i = 0; !r->gltf.status && i < corners; i++) {
        const double at = index.value ? index.value[i] : (double)i;
        if (!(at < p->count))
            return FAIL(r, "%s: index %.0f; it has points 0 to %d", owner, at, (int)p->count - 1);
        r->corner[3 * r->triangle_count + i] = p->first + (int32_t)at;
    }
    return r->gltf.status;
}

static drape_status read_primitive(reader *r, int32_t node, int32_t mesh, const json_t *primitive, int number)
{
    drape_gltf *g = &r->gltf;
    const json_t *attributes = json_object_get(primitive, "attributes");
    part p = {.node = node, .first = (int32_t)r->point_count, .triangle = r->triangle_count};
    const char *owner = DRAPE_FORMAT("mesh %d, primitive %d", (int)mesh, number);
    const int32_t mode = drape_gltf_index(g, owner, primitive, "mode", MODES);
    if (mode > DRAPE_GLTF_TRIANGLES)
        FAIL(r, "%s: its mode is %d; triangles, 4, are read, and no strips and fans", owner, (int)mode);
    if (mode >= 0 && mode < DRAPE_GLTF_TRIANGLES)
        return g->status; /* points and lines show no triangles */
    const drape_gltf_array x = DRAPE_GLTF_READ(g, owner, attributes, "POSITION", NULL, 3, false, -1);
    if (!x.value)
        return FAIL(r, "%s has no POSITION", owner);
    if (r->point_count + x.count > DRAPE_MAX_NODES)
        return FAIL(r, "more than %d points", DRAPE_MAX_NODES);
    p.x = x.value;
    p.count = (int32_t)x.count;
    read_triangles(r, owner, primitive, &p);
    const json_t *targets = json_object_get(primitive, "targets");
    p.targets = r->scene.nodes[p.node].weight_count;
    if (json_array_size(targets) != (size_t)p.targets)
        FAIL(r, "%s: %zu morph targets; the first primitive of the mesh has %d", owner,
             json_array_size(targets), (int)p.targets);
    p.target = drape_gltf_take(&r->gltf, (size_t)p.targets, sizeof *p.target);
    for (int32_t k = 0; !r->gltf.status && k < p.targets; k++)
        p.target[k] = DRAPE_GLTF_READ(&r->gltf, owner, json_array_get(targets, (size_t)k), "POSITION",
                                      "POSITION of a morph target", 3, false, p.count)
                          .value;
    if (r->scene.nodes[node].skin >= 0)
        read_influences(r, owner, attributes, &p);
    r->parts = grow(r, r->parts, r->part_count + 1, &r->part_capacity, sizeof *r->parts);
    if (g->status)
        return g->status;
    r->parts[r->part_count++] = p;
    r->triangle_count += p.triangles;
    r->point_count += p.count;
    r->work += (double)p.count * (1.0 + p.targets + 4.0 * p.sets);
    return DRAPE_OK;
}

static void read_parts(reader *r)
{
    for (int32_t i = 0; !r->gltf.status && i < r->scene.node_count; i++) {
        const drape_gltf_node *node = &r->scene.nodes[i];
        const json_t *mesh = drape_gltf_item(&r->gltf, "meshes", node->mesh), *primitive;
        size_t k;
        json_array_foreach(json_object_get(mesh, "primitives"), k, primitive)
        {
            if (node->drawn && !r->gltf.status)
                read_primitive(r, i, node->mesh, primitive, (int)k);
        }
    }
    if (r->triangle_count == 0)
        FAIL(r, "its scene shows no triangles");
}

/* ---- Frames ---- */

/* The map of joint k of a point, and its weight; NULL if that is 0: then the joint is any number. */
static const drape_gltf_map *joint_of(const reader *r, const part *p, size_t point, int k, double *weight)
{
    *weight = *influence(p->weight, point, k);
    return *weight > 0 ? &r->skins[r->scene.nodes[p->node].skin].now[(int32_t)*influence(p->joint, point, k)]
                       : NULL;
}

/* The node of a skinned mesh does not move it. */
static void place_point(const reader *r, const part *p, size_t point, double *out)
{
    const drape_gltf_node *node = &r->scene.nodes[p->node];
    double x[3] = {p->x[3 * point], p->x[3 * point + 1], p->x[3 * point + 2]}, y[3], sum[3] = {0}, weight;
    for (int32_t k = 0; k < p->targets; k++)
        for (size_t axis = 0; p->target[k] && node->now_weight[k] != 0 && axis < 3; axis++)
            x[axis] += node->now_weight[k] * p->target[k][3 * point + axis];
    if (p->sets == 0)
        drape_gltf_map_point(&node->world, x, sum);
    for (int k = 0; k < 4 * p->sets; k++) {
        const drape_gltf_map *map = joint_of(r, p, point, k, &weight);
        if (!map)
            continue;
        drape_gltf_map_point(map, x, y);
        vec3_add_scaled(weight, y, sum);
    }
    for (int axis = 0; axis < 3; axis++)
        out[axis] = sum[axis] + 0.0; /* no -0, so that equal points have equal bytes */
}

/* Whether the map of a part mirrors it. A part with a skin has a map for each point; the first one counts. */
static bool is_mirrored(const reader *r, const part *p)
{
    const drape_gltf_node *node = &r->scene.nodes[p->node];
    drape_gltf_map map = {.column = {{0}}};
    double weight;
    if (p->sets == 0)
        return drape_gltf_map_determinant(&node->world) < 0;
    for (int k = 0; k < 4 * p->sets; k++) {
        const drape_gltf_map *of = joint_of(r, p, 0, k, &weight);
        for (int i = 0; of && i < 3; i++)
            vec3_add_scaled(weight, of->column[i], map.column[i]);
    }
    return drape_gltf_map_determinant(&map) < 0;
}

/* Where a map mirrors, the order of the corners is reversed (section 3.7.4), so that their outside stays the
 * same. That must hold in all frames: triangles do not change between them. */
static drape_status check_mirrors(reader *r, int32_t frame, drape_mesh *mesh)
{
    for (int64_t k = 0; k < r->part_count; k++) {
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
    DRAPE_TRY(drape_mesh_allocate(r->source->ctx, &r->source->file, (size_t)r->point_count,
                                  (size_t)r->triangle_count, mesh));
    DRAPE_TRY(drape_sequence_allocate(r->source, mesh, (int64_t)frames, out));
    out->first = scene->start * rate;
    out->last = scene->end * rate;
    memcpy(mesh->triangle, r->corner, 3 * (size_t)r->triangle_count * sizeof *mesh->triangle);
    for (int32_t f = 0; f < out->frame_count; f++) {
        double *x = out->x + 3 * (size_t)f * (size_t)mesh->node_count;
        const double t = fmin(scene->start + f / rate, scene->end);
        drape_gltf_scene_pose(&r->scene, t);
        for (int32_t i = 0; i < drape_gltf_count(&r->gltf, "skins"); i++)
            for (int32_t k = 0; k < r->skins[i].count; k++)
                r->skins[i].now[k] = drape_gltf_map_product(&r->scene.nodes[r->skins[i].joint[k]].world,
                                                            &r->skins[i].inverse[k]);
        DRAPE_TRY(drape_check_cancel_after(r->source->ctx, (size_t)work));
        DRAPE_TRY(check_mirrors(r, f, mesh));
        for (int64_t k = 0; k < r->part_count; k++)
            for (int32_t i = 0; i < r->parts[k].count; i++)
                place_point(r, &r->parts[k], (size_t)i, x + 3 * (size_t)(r->parts[k].first + i));
        const drape_mesh frame = {.node_count = mesh->node_count, .x = x};
        const char *text = DRAPE_FORMAT("frame %d: ", (int)f);
        const drape_mesh_source source = {
            .pointer = r->source->file.pointer, .file = r->source->file.file, .part = text};
        DRAPE_TRY(drape_mesh_validate_positions(r->source->ctx, &source, &frame));
    }
    return DRAPE_OK;
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

/* Sets to[i] to the first point that moves as i does. */
static drape_status find_same(drape_arena *arena, const drape_sequence *frames, int32_t *to)
{
    const size_t points = (size_t)frames->node_count, count = points * (size_t)frames->frame_count;
    track *tracks = drape_arena_take(arena, points, sizeof *tracks), *first = tracks, *t = tracks;
    DRAPE_TRY(drape_arena_status(arena));
    for (size_t i = 0; i < points; i++)
        tracks[i] = (track){DRAPE_HASH_START, (int32_t)i};
    for (size_t i = 0; i < count; i++) {
        tracks[i % points].hash =
            drape_hash_bytes(tracks[i % points].hash, frames->x + 3 * i, 3 * sizeof *frames->x);
        DRAPE_TRY(drape_check_cancel_after(arena->ctx, 8));
    }
    qsort(tracks, points, sizeof *tracks, compare_tracks);
    for (; t < tracks + points; t++) {
        bool same = first->hash == t->hash;
        for (int32_t f = 0; same && f < frames->frame_count; f++) {
            const double *x = frames->x + 3 * (size_t)f * points;
            same = memcmp(x + 3 * (size_t)first->point, x + 3 * (size_t)t->point, 3 * sizeof *x) == 0;
        }
        first = same ? first : t;
        to[t->point] = first->point;
        DRAPE_TRY(drape_check_cancel_after(arena->ctx, (size_t)frames->frame_count));
    }
    return DRAPE_OK;
}

static drape_status weld(reader *r, drape_mesh *mesh, drape_sequence *frames)
{
    int32_t *number = drape_gltf_take(&r->gltf, (size_t)mesh->node_count, sizeof *number);
    DRAPE_TRY(number ? find_same(r->gltf.arena, frames, number) : r->gltf.status);
    /* Triangles that have lost a side, as at the pole of a sphere, are left out. */
    int32_t kept = 0;
    for (int32_t t = 0; t < mesh->triangle_count; t++) {
        const int32_t *n = mesh->triangle + 3 * (size_t)t;
        const int32_t a = number[n[0]], b = number[n[1]], c = number[n[2]];
        if (a == b || b == c || c == a)
            continue;
        mesh->triangle[3 * (size_t)kept] = a;
        mesh->triangle[3 * (size_t)kept + 1] = b;
        mesh->triangle[3 * (size_t)kept++ + 2] = c;
    }
    mesh->triangle_count = kept;
    /* Numbers the points that have triangles anew, in their order, which lets frames be packed in place. */
    const size_t before = (size_t)mesh->node_count;
    int32_t points = 0;
    memset(number, -1, before * sizeof *number);
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++)
        number[mesh->triangle[i]] = 0;
    for (size_t i = 0; i < before; i++)
        if (number[i] == 0)
            number[i] = points++;
    for (size_t i = 0; i < 3 * (size_t)mesh->triangle_count; i++)
        mesh->triangle[i] = number[mesh->triangle[i]];
    size_t to = 0;
    for (size_t f = 0; f < (size_t)frames->frame_count; f++)
        for (size_t i = 0; i < before; i++)
            if (number[i] >= 0)
                memmove(frames->x + 3 * to++, frames->x + 3 * (f * before + i), 3 * sizeof *frames->x);
    mesh->node_count = frames->node_count = points;
    return mesh->triangle_count > 0 ? DRAPE_OK : FAIL(r, "all its triangles are degenerate");
}

static drape_status read_glb(const drape_sequence_source *source, drape_mesh *mesh, drape_sequence *out)
{
    reader r = {.source = source, .gltf = {.arena = source->scratch, .file = &source->file}};
    drape_gltf_open(&r.gltf, source->whole.data, source->whole.size);
    drape_gltf_scene_read(&r.gltf, &r.scene);
    const int32_t count = drape_gltf_count(&r.gltf, "skins");
    r.skins = drape_gltf_take(&r.gltf, (size_t)count, sizeof *r.skins);
    for (int32_t i = 0; !r.gltf.status && i < count; i++)
        read_skin(&r, i);
    read_parts(&r);
    drape_status status = r.gltf.status ? r.gltf.status : sample(&r, mesh, out);
    if (!status)
        status = weld(&r, mesh, out);
    drape_gltf_close(&r.gltf);
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
