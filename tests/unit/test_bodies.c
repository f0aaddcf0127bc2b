/* test_bodies.c: colliders in frames: objects of their own, which are where the run has them. */
#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/rotation.h"
#include "io/recorder.h"
#include "support/folder.h"
#include "support/frames.h"
#include "support/scene.h"

#define RINGS  3
#define AROUND 6
#define POINTS FRAMES_BALL_POINTS(RINGS, AROUND)
#define FRAMES 5

/* What the test knows of the bodies: a sphere on a track, a box that turns, a floor, and a ball that grows
 * from a radius of .1 m to .14 m within .1 s and is displaced to x = -2. */
static double ball_radius(double t)
{
    return .1 + .04 * fmin(t / .1, 1);
}

static scene bodies_scene(const frames_folder *f, const char *up)
{
    static double x[2 * 3 * POINTS];
    static int triangle[3 * FRAMES_BALL_TRIANGLES(RINGS, AROUND)];
    frames_ball(RINGS, AROUND, x, triangle);
    for (int i = 0; i < 3 * POINTS; i++) {
        x[3 * POINTS + i] = .14 * x[i];
        x[i] *= .1;
    }
    char shape[32];
    snprintf(shape, sizeof shape, "(2, %d, 3)", POINTS);
    frames_obj(f, "ball.obj", POINTS, x, FRAMES_BALL_TRIANGLES(RINGS, AROUND), triangle);
    frames_npy(f, "ball.npy", shape, 2 * 3 * POINTS, x);
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 4, 'width': 0.2, 'height': "
        "0.2, "
        "'transform': {'translate': [0, 1, 0]}}, 'material': {'young_modulus': 1e4, 'thickness': 1e-3, "
        "'density': "
        "200}, 'terms': ['stretch.edge'], 'pins': [{'corner': 'top-left'}]}], 'colliders': [{'name': 'ball', "
        "'type': "
        "'sphere', 'center': [0, 0.2, 0], 'radius': 0.1, 'track': [[0, [1, 0, 0]], [0.1, [1, 0.2, 0]]]}, "
        "{'name': "
        "'crate \\\"A\\\"', 'type': 'box', 'center': [3, 0, 0], 'size': [0.3, 0.2, 0.1], 'turns': [{'time': "
        "0, "
        "'rotate': [0, 1, 0, 0]}, {'time': 0.1, 'rotate': [0, 1, 0, 90]}]}, {'type': 'plane', 'point': [0, "
        "-1, 0], "
        "'normal': [0, 1, 0]}, {'name': 'grows', 'type': 'animated_mesh', 'file': '%s/ball.npy', 'mesh': "
        "'%s/ball.obj', 'frame_rate': 10, 'track': [[0, [-2, 0, 0]]]}], 'integrator': {'dt': 0.01}, "
        "'duration': 0.1, "
        "'frame_rate': 40, 'output': {'up': '%s'}}",
        f->path, f->path, up);
}

static void record(scene *s, const frames_folder *f, const char *format)
{
    char out[100];
    snprintf(out, sizeof out, "%s/out", f->path);
    const drape_recorder_def def = {.folder = out, .formats = &format, .format_count = 1};
    drape_recorder *recorder = NULL;
    assert_ok(s->ctx, drape_recorder_create(s->ctx, s->sim, &def, &recorder));
    ck_assert_int_eq(drape_sim_advance(s->sim, .1), DRAPE_OK);
    ck_assert_int_eq(drape_recorder_finish(recorder), DRAPE_OK);
    ck_assert_int_eq(drape_recorder_done(recorder).frames, FRAMES);
    drape_recorder_destroy(&recorder);
}

static bool exists(const frames_folder *f, const char *name)
{
    char path[200];
    snprintf(path, sizeof path, "%s/out/%s", f->path, name);
    return access(path, F_OK) == 0;
}

static uint32_t word_at(const char *data, size_t at)
{
    const unsigned char *b = (const unsigned char *)data + at;
    return b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
}

/* ---- glTF ---- */

typedef struct glb {
    char *data;
    size_t size, binary;
    json_t *json;
} glb;

static json_t *item(const json_t *object, const char *list, json_int_t index)
{
    json_t *found = json_array_get(json_object_get(object, list), (size_t)index);
    ck_assert_msg(found != NULL, "%s has no item %d", list, (int)index);
    return found;
}

static json_int_t number(const json_t *object, const char *key)
{
    return json_integer_value(json_object_get(object, key)); /* 0 if it is missing, as in glTF */
}

/* The floats of an accessor, to be freed; count is that of its elements. */
static float *floats(const glb *g, json_int_t accessor, size_t width, size_t *count)
{
    const json_t *a = item(g->json, "accessors", accessor);
    const json_t *v = item(g->json, "bufferViews", number(a, "bufferView"));
    const size_t at = g->binary + (size_t)number(v, "byteOffset") + (size_t)number(a, "byteOffset");
    *count = (size_t)number(a, "count");
    ck_assert_uint_le((size_t)number(a, "byteOffset") + 4 * width * *count, (size_t)number(v, "byteLength"));
    ck_assert_uint_le(at + 4 * width * *count, g->size);
    float *values = malloc(4 * width * *count + 1);
    memcpy(values, g->data + at, 4 * width * *count); /* tests run on little endian machines */
    return values;
}

static const json_t *channel_of(const glb *g, size_t node, const char *path)
{
    const json_t *animation = item(g->json, "animations", 0);
    for (size_t c = 0; c < json_array_size(json_object_get(animation, "channels")); c++) {
        const json_t *channel = item(animation, "channels", (json_int_t)c);
        const json_t *target = json_object_get(channel, "target");
        if ((size_t)number(target, "node") == node &&
            strcmp(json_string_value(json_object_get(target, "path")), path) == 0)
            return item(animation, "samplers", number(channel, "sampler"));
    }
    return NULL;
}

/* Float32 has a relative error of 2^-24, positions below 4 m: 1e-6 m bounds the sum of a few. */
#define TOLERANCE 1e-6

static double box_distance(const double *x)
{
    const double half[3] = {.15, .1, .05};
    double most = -INFINITY;
    for (int k = 0; k < 3; k++)
        most = fmax(most, fabs(x[k] - (k == 0 ? 3 : 0)) - half[k]);
    return fabs(most);
}

TEST(glb_has_colliders_that_move)
{
    scoped_frames f = frames_folder_make();
    scoped_scene s = bodies_scene(&f, "z"); /* which changes nothing here */
    record(&s, &f, "glb");
    glb g = {.data = file_read(frames_path(&f, "out/positions.glb"), &g.size)};
    json_error_t error;
    g.binary = 28 + (size_t)word_at(g.data, 12);
    g.json = json_loadb(g.data + 20, word_at(g.data, 12), JSON_REJECT_DUPLICATES, &error);
    ck_assert_msg(g.json != NULL, "%s", error.text);
    static const char *const names[] = {"cloth", "grows", "ball", "crate \"A\"", "collider2"};
    ck_assert_uint_eq(json_array_size(json_object_get(g.json, "nodes")), 5);
    for (size_t n = 0; n < 5; n++) {
        const json_t *node = item(g.json, "nodes", (json_int_t)n);
        ck_assert_str_eq(json_string_value(json_object_get(node, "name")), names[n]);
        ck_assert_int_eq(number(node, "mesh"), (json_int_t)n);
        ck_assert_int_eq(json_integer_value(item(item(g.json, "scenes", 0), "nodes", (json_int_t)n)),
                         (json_int_t)n);
        ck_assert(!channel_of(&g, n, "weights") == (n > 1));
        ck_assert(!channel_of(&g, n, "translation") == (n < 2 || n > 3));
        ck_assert(!channel_of(&g, n, "rotation") == (n < 2 || n > 3));
    }
    /* the surfaces, in the bodies' own coordinates, and where they are taken */
    for (size_t n = 2; n < 5; n++) {
        size_t count, corners;
        const json_t *primitive = item(item(g.json, "meshes", (json_int_t)n), "primitives", 0);
        scoped_memory float *x =
            floats(&g, number(json_object_get(primitive, "attributes"), "POSITION"), 3, &count);
        scoped_memory float *index = floats(&g, number(primitive, "indices"), 1, &corners);
        ck_assert_uint_ge(count, 4);
        for (size_t i = 0; i < count; i++) {
            const double p[3] = {(double)x[3 * i], (double)x[3 * i + 1], (double)x[3 * i + 2]};
            const double off = n == 2   ? fabs(hypot(hypot(p[0], p[1] - .2), p[2]) - .1)
                               : n == 3 ? box_distance(p)
                                        : fabs(p[1] + 1);
            ck_assert_msg(off < TOLERANCE, "%s: vertex %zu is %g m off", names[n], i, off);
        }
        for (size_t i = 0; i < corners; i++)
            ck_assert_uint_lt(word_at((const char *)index, 4 * i), count);
    }
    for (size_t n = 2; n < 4; n++) {
        size_t frames, same;
        scoped_memory float *times =
            floats(&g, number(channel_of(&g, n, "translation"), "input"), 1, &frames);
        scoped_memory float *moves = floats(&g, number(channel_of(&g, n, "translation"), "output"), 3, &same);
        ck_assert_uint_eq(frames, FRAMES);
        ck_assert_uint_eq(same, FRAMES);
        scoped_memory float *turns = floats(&g, number(channel_of(&g, n, "rotation"), "output"), 4, &same);
        ck_assert_uint_eq(same, FRAMES);
        for (size_t k = 0; k < FRAMES; k++) {
            const double t = (double)times[k], angle = n == 3 ? t / .1 * acos(0) : 0;
            const double q[4] = {(double)turns[4 * k + 3], (double)turns[4 * k], (double)turns[4 * k + 1],
                                 (double)turns[4 * k + 2]};
            double R[9];
            drape_rotation_of_quaternion(q, R);
            ck_assert_double_eq_tol(t, .025 * (double)k, TOLERANCE);
            ck_assert_double_eq_tol(R[0], cos(angle), TOLERANCE);
            ck_assert_double_eq_tol(R[2], sin(angle), TOLERANCE);
            ck_assert_double_eq_tol(R[4], 1, TOLERANCE);
            /* the box turns about its middle, (3, 0, 0), which stays */
            const double expected[3] = {n == 2 ? 1 : 3 - 3 * R[0], n == 2 ? 2 * t : 0,
                                        n == 2 ? 0 : -3 * R[6]};
            for (size_t i = 0; i < 3; i++)
                ck_assert_double_eq_tol((double)moves[3 * k + i], expected[i], 4 * TOLERANCE);
        }
    }
    /* the ball that grows: first frame and targets */
    const json_t *primitive = item(item(g.json, "meshes", 1), "primitives", 0);
    ck_assert_uint_eq(json_array_size(json_object_get(primitive, "targets")), FRAMES - 1);
    size_t count, same;
    float *x = floats(&g, number(json_object_get(primitive, "attributes"), "POSITION"), 3, &count);
    ck_assert_uint_eq(count, POINTS);
    for (int k = 0; k < FRAMES; k++) {
        scoped_memory float *d =
            k ? floats(&g, number(item(primitive, "targets", k - 1), "POSITION"), 3, &same) : NULL;
        for (size_t i = 0; i < count; i++) {
            double p[3];
            for (size_t c = 0; c < 3; c++)
                p[c] = (double)x[3 * i + c] + (d ? (double)d[3 * i + c] : 0) + (c == 0 ? 2 : 0);
            ck_assert_double_eq_tol(hypot(hypot(p[0], p[1]), p[2]), ball_radius(.025 * k), TOLERANCE);
        }
    }
    free(x);
    json_decref(g.json);
    free(g.data);
}

/* ---- VTK ---- */

/* The points of a file of PolyData, whose appended data begin with them; their number. */
static const double *vtp_points(const frames_folder *f, const char *name, size_t *count, char **data)
{
    size_t size;
    int points, polygons;
    char within[80];
    snprintf(within, sizeof within, "out/%s", name);
    *data = file_read(frames_path(f, within), &size);
    const char *piece = strstr(*data, "<Piece "), *appended = strstr(*data, "encoding=\"raw\">\n_");
    ck_assert(piece && appended);
    ck_assert_int_eq(sscanf(piece,
                            "<Piece NumberOfPoints=\"%d\" NumberOfVerts=\"0\" NumberOfLines=\"0\" "
                            "NumberOfStrips=\"0\" NumberOfPolys=\"%d\">",
                            &points, &polygons),
                     2);
    const size_t at = (size_t)(appended - *data) + strlen("encoding=\"raw\">\n_");
    ck_assert_uint_eq(word_at(*data, at), 24 * (size_t)points);
    ck_assert_uint_eq(word_at(*data, at + 8 + 24 * (size_t)points), 4 * (size_t)polygons);
    ck_assert_uint_eq(word_at(*data, at + 16 + 24 * (size_t)points + 4 * (size_t)polygons),
                      12 * (size_t)polygons);
    *count = (size_t)points;
    double *x = malloc(24 * (size_t)points);
    memcpy(x, *data + at + 8, 24 * (size_t)points);
    return x;
}

/* The collection has each collider as a part of each frame; with z up, (x, y, z) is at (x, -z, y). */
TEST(vtp_has_colliders_as_parts)
{
    scoped_frames f = frames_folder_make();
    scoped_scene s = bodies_scene(&f, "z");
    record(&s, &f, "vtp");
    size_t size, count;
    char *pvd = file_read(frames_path(&f, "out/frames.pvd"), &size), *data;
    for (int k = 0; k < FRAMES; k++) {
        for (int b = 0; b < 4; b++) {
            char name[64], entry[200];
            if (b == 2)
                snprintf(name, sizeof name, "collider_2.vtp");
            else
                snprintf(name, sizeof name, "collider_%d_%06d.vtp", b, k);
            snprintf(entry, sizeof entry, "part=\"%d\" file=\"%s\"/>", b + 1, name);
            ck_assert_msg(strstr(pvd, entry) != NULL, "%s", entry);
            scoped_memory double *x = (double *)vtp_points(&f, name, &count, &data);
            const double t = .025 * k, angle = t / .1 * acos(0);
            for (size_t i = 0; i < count; i++) {
                double *p = x + 3 * i;
                const double y[3] = {p[0], p[2], -p[1]}; /* with y up */
                double off = 0;
                if (b == 0)
                    off = hypot(hypot(y[0] - 1, y[1] - .2 - 2 * t), y[2]) - .1;
                if (b == 1)
                    off = box_distance((const double[]){3 + cos(angle) * (y[0] - 3) - sin(angle) * y[2], y[1],
                                                        sin(angle) * (y[0] - 3) + cos(angle) * y[2]});
                if (b == 2)
                    off = y[1] + 1;
                if (b == 3)
                    off = hypot(hypot(y[0] + 2, y[1]), y[2]) - ball_radius(t);
                ck_assert_msg(fabs(off) < TOLERANCE, "frame %d, collider %d, vertex %zu: %g m off", k, b, i,
                              off);
            }
            free(data);
        }
    }
    ck_assert(!exists(&f, "collider_2_000000.vtp"));
    free(pvd);
    scene_close(&s);
    /* a new run removes what this one has written */
    s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 4, 'width': 0.2, "
        "'height': 0.2}, 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200}}], "
        "'integrator': {'dt': 0.01}, 'duration': 0.1, 'frame_rate': 40}");
    record(&s, &f, "npy");
    ck_assert(!exists(&f, "collider_2.vtp") && !exists(&f, "collider_3_000001.vtp"));
}
