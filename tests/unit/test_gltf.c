/* test_gltf.c: the animation of a GLB file: nodes, skins and morph targets move its points as the formulas
 * of the specification say; each fault has a message that names the part; whatever the bytes are, reading
 * ends. */
#include "mesh/sequence.h"
#include "support/frames.h"

#define COUNT(array) (sizeof(array) / sizeof *(array))

/* What is written: JSON, with ' for ", and the bytes of the buffer. */
typedef struct glb {
    char json[6000];
    char bytes[1024];
    size_t size;
} glb;

static void put_floats(glb *g, size_t count, const double *numbers)
{
    for (size_t i = 0; i < count; i++, g->size += 4) {
        const float number = (float)numbers[i];
        memcpy(g->bytes + g->size, &number, sizeof number);
    }
}

static void put_bytes(glb *g, size_t count, const unsigned char *bytes)
{
    memcpy(g->bytes + g->size, bytes, count);
    g->size += count;
}

static void put_word(char *to, size_t word)
{
    for (int b = 0; b < 4; b++)
        to[b] = (char)(word >> 8 * b);
}

/* Returns the size of the file; out: room for json, bytes and 32 more. */
static size_t pack(const glb *g, char *out)
{
    const size_t text = (strlen(g->json) + 3) / 4 * 4, bytes = (g->size + 3) / 4 * 4;
    memset(out, 0, 28 + text + bytes);
    memcpy(out, "glTF\2", 5);
    put_word(out + 8, 28 + text + bytes);
    put_word(out + 12, text);
    memcpy(out + 16, "JSON", 4);
    memset(out + 20, ' ', text);
    for (size_t i = 0; i < strlen(g->json); i++)
        out[20 + i] = (char)(g->json[i] == '\'' ? '"' : g->json[i]);
    put_word(out + 20 + text, bytes);
    memcpy(out + 24 + text, "BIN", 4);
    memcpy(out + 28 + text, g->bytes, g->size);
    return 28 + text + bytes;
}

static void write_bytes(const frames_folder *f, const char *bytes, size_t size)
{
    FILE *file = frames_file(f, "a.glb");
    ck_assert_uint_eq(fwrite(bytes, 1, size, file), size);
    ck_assert_int_eq(fclose(file), 0);
}

static void write_glb(const frames_folder *f, const glb *g)
{
    char bytes[sizeof *g + 64];
    const size_t size = pack(g, bytes);
    write_bytes(f, bytes, size);
}

/* A square of two triangles of their own points, twice as large; its node rises, that above turns. Node 2
 * is not in the scene. */
static glb make_square(void)
{
    static const double x[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 0, 0, 1, 1, 0, 0, 1, 0}, time[] = {1, 3},
                        rise[] = {0, 0, 0, 0, 0, 2}, turn[] = {0, 0, 0, 1, 0, 0, -0.5, -0.5};
    glb g = {.json =
                 "{'asset': {'version': '2.0'}, 'scene': 0, 'scenes': [{'nodes': [0]}],"
                 " 'nodes': [{'children': [1]}, {'mesh': 0, 'scale': [2, 2, 2]}, {'mesh': 0}],"
                 " 'meshes': [{'primitives': [{'attributes': {'POSITION': 0}}]}],"
                 " 'animations': [{'channels': ["
                 "  {'sampler': 0, 'target': {'node': 1, 'path': 'translation'}},"
                 "  {'sampler': 1, 'target': {'node': 0, 'path': 'rotation'}}],"
                 "  'samplers': [{'input': 1, 'output': 2}, {'input': 1, 'output': 3, 'interpolation': "
                 "'LINEAR'}]}],"
                 " 'accessors': [{'bufferView': 0, 'componentType': 5126, 'count': 6, 'type': 'VEC3'},"
                 "  {'bufferView': 0, 'byteOffset': 72, 'componentType': 5126, 'count': 2, 'type': 'SCALAR'},"
                 "  {'bufferView': 0, 'byteOffset': 80, 'componentType': 5126, 'count': 2, 'type': 'VEC3'},"
                 "  {'bufferView': 1, 'componentType': 5126, 'count': 2, 'type': 'VEC4'}],"
                 " 'bufferViews': [{'buffer': 0, 'byteLength': 104},"
                 "  {'buffer': 0, 'byteOffset': 104, 'byteLength': 32}],"
                 " 'buffers': [{'byteLength': 136}]}"};
    put_floats(&g, COUNT(x), x);
    put_floats(&g, COUNT(time), time);
    put_floats(&g, COUNT(rise), rise);
    put_floats(&g, COUNT(turn), turn);
    return g;
}

/* A square on two joints, the second at x = 1, which turns about y after 1 s; the last point has a morph
 * target. */
static glb make_skin(void)
{
    static const double x[] = {0, 0, 0, 2, 0, 0, 2, 1, 0, 0, 1, 0},
                        bind[] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0,  0, 0, 1,
                                  1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 1},
                        time[] = {0, 1}, turn[] = {0, 0, 0, 1, 0, 0.5, 0, 0.5}, morph[] = {0, 0, 1, 0, 1, 0},
                        moved[] = {0, 0, 3};
    static const unsigned char joints[] = {0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0},
                               weights[] = {255, 0, 0, 0, 255, 0, 0, 0, 51, 204, 0, 0, 255, 0, 0, 0},
                               corners[] = {0, 1, 2, 0, 2, 3}, third[] = {3};
    glb g = {
        .json =
            "{'asset': {'version': '2.0'}, 'nodes': [{'children': [1]}, {'translation': [1, 0, 0]},"
            "  {'mesh': 0, 'skin': 0, 'translation': [5, 5, 5]}],"
            " 'meshes': [{'primitives': [{'attributes': {'POSITION': 0, 'JOINTS_0': 6, 'WEIGHTS_0': 7},"
            "  'indices': 8, 'targets': [{'POSITION': 5}]}]}],"
            " 'skins': [{'joints': [0, 1], 'inverseBindMatrices': 1}],"
            " 'animations': [{'channels': [{'sampler': 0, 'target': {'node': 1, 'path': 'rotation'}},"
            "   {'sampler': 1, 'target': {'node': 2, 'path': 'weights'}}],"
            "  'samplers': [{'input': 2, 'output': 3, 'interpolation': 'STEP'},"
            "   {'input': 2, 'output': 4, 'interpolation': 'CUBICSPLINE'}]}],"
            " 'accessors': [{'bufferView': 0, 'componentType': 5126, 'count': 4, 'type': 'VEC3'},"
            "  {'bufferView': 0, 'byteOffset': 48, 'componentType': 5126, 'count': 2, 'type': 'MAT4'},"
            "  {'bufferView': 0, 'byteOffset': 176, 'componentType': 5126, 'count': 2, 'type': 'SCALAR'},"
            "  {'bufferView': 0, 'byteOffset': 184, 'componentType': 5126, 'count': 2, 'type': 'VEC4'},"
            "  {'bufferView': 0, 'byteOffset': 216, 'componentType': 5126, 'count': 6, 'type': 'SCALAR'},"
            "  {'componentType': 5126, 'count': 4, 'type': 'VEC3', 'sparse': {'count': 1,"
            "   'indices': {'bufferView': 0, 'byteOffset': 290, 'componentType': 5121},"
            "   'values': {'bufferView': 0, 'byteOffset': 240}}},"
            "  {'bufferView': 0, 'byteOffset': 252, 'componentType': 5121, 'count': 4, 'type': 'VEC4'},"
            "  {'bufferView': 0, 'byteOffset': 268, 'componentType': 5121, 'normalized': true, 'count': 4,"
            "   'type': 'VEC4'},"
            "  {'bufferView': 0, 'byteOffset': 284, 'componentType': 5121, 'count': 6, 'type': 'SCALAR'}],"
            " 'bufferViews': [{'buffer': 0, 'byteLength': 291}], 'buffers': [{'byteLength': 291}]}"};
    put_floats(&g, COUNT(x), x);
    put_floats(&g, COUNT(bind), bind);
    put_floats(&g, COUNT(time), time);
    put_floats(&g, COUNT(turn), turn);
    put_floats(&g, COUNT(morph), morph);
    put_floats(&g, COUNT(moved), moved);
    put_bytes(&g, COUNT(joints), joints);
    put_bytes(&g, COUNT(weights), weights);
    put_bytes(&g, COUNT(corners), corners);
    put_bytes(&g, COUNT(third), third);
    return g;
}

/* Replaces the first occurrence of a text. */
static void replace(glb *g, const char *from, const char *to)
{
    char rest[sizeof g->json];
    char *at = strstr(g->json, from);
    ck_assert_msg(at != NULL, "%s", from);
    strcpy(rest, at + strlen(from));
    snprintf(at, sizeof g->json - (size_t)(at - g->json), "%s%s", to, rest);
}

typedef struct reading {
    drape_context *ctx;
    drape_arena arena;
    drape_mesh mesh;
    drape_sequence frames;
    drape_status status;
} reading;

static reading read_it(const frames_folder *f, double rate)
{
    reading r = {.ctx = NULL};
    const drape_sequence_def def = {.file = "a.glb", .rate = rate, .start = 10};
    ck_assert_int_eq(drape_context_create(NULL, &r.ctx), DRAPE_OK);
    r.arena = drape_arena_of(r.ctx);
    r.status = drape_sequence_read(&r.arena, "/c", f->path, &def, &r.mesh, &r.frames);
    return r;
}

static void close_it(reading *r)
{
    drape_mesh_free(&r->mesh);
    drape_arena_free(&r->arena);
    drape_context_destroy(&r->ctx);
}

#define scoped_reading SCOPED(close_it) reading

static void assert_point(const reading *r, int frame, int node, double x, double y, double z)
{
    const double *at = r->frames.x + 3 * ((size_t)frame * (size_t)r->frames.node_count + (size_t)node);
    /* a few units of rounding of products of numbers up to 5; what is read is exact in float32 */
    ck_assert_double_eq_tol(at[0], x, 1e-14);
    ck_assert_double_eq_tol(at[1], y, 1e-14);
    ck_assert_double_eq_tol(at[2], z, 1e-14);
}

/* Points are 2 x, raised by t - 1, and turned about z by -90 degrees (t - 1)/2: the quaternion of the
 * second key has another sign and length, and between them the smaller angle counts. The six points of the
 * file are four. */
TEST(nodes_move)
{
    scoped_frames f = frames_folder_make();
    const glb g = make_square();
    write_glb(&f, &g);
    reading r = read_it(&f, 2);
    assert_ok(r.ctx, r.status);
    ck_assert_int_eq(r.frames.frame_count, 5);
    ck_assert_int_eq(r.mesh.node_count, 4);
    ck_assert_int_eq(r.mesh.triangle_count, 2);
    ck_assert_mem_eq(r.mesh.triangle, ((int32_t[]){0, 1, 2, 0, 2, 3}), 6 * sizeof(int32_t));
    for (int i = 0; i < 5; i++)
        ck_assert_double_eq(r.frames.time[i], 11 + 0.5 * i);
    const double half = sqrt(2);
    assert_point(&r, 0, 2, 2, 2, 0);
    assert_point(&r, 2, 1, half, half, 1);
    assert_point(&r, 2, 3, -half, half, 1);
    assert_point(&r, 4, 1, 0, 2, 2);
    assert_point(&r, 4, 2, -2, 2, 2);
    close_it(&r);
    glb still = g;
    replace(&still, "'animations'", "'extras'");
    write_glb(&f, &still);
    r = read_it(&f, 2);
    assert_ok(r.ctx, r.status);
    ck_assert_int_eq(r.frames.frame_count, 1);
    ck_assert_double_eq(r.frames.time[0], 10);
    assert_point(&r, 0, 2, 2, 2, 0);
    close_it(&r);
}

/* The node of a skinned mesh does not move it. At half of the spline the weight is 1/2 + 1/8 of the
 * tangent. */
TEST(skins_and_morph_targets_move)
{
    scoped_frames f = frames_folder_make();
    const glb g = make_skin();
    write_glb(&f, &g);
    reading r = read_it(&f, 2);
    assert_ok(r.ctx, r.status);
    ck_assert_int_eq(r.frames.frame_count, 3);
    ck_assert_int_eq(r.mesh.node_count, 4);
    assert_point(&r, 0, 1, 2, 0, 0);
    assert_point(&r, 0, 3, 0, 1, 0);
    assert_point(&r, 1, 1, 2, 0, 0);
    assert_point(&r, 1, 2, 2, 1, 0);
    assert_point(&r, 1, 3, 0, 1, 0.625 * 3);
    assert_point(&r, 2, 0, 0, 0, 0);
    assert_point(&r, 2, 1, 1, 0, -1);
    assert_point(&r, 2, 2, 0.2 * 2 + 0.8, 1, -0.8);
    assert_point(&r, 2, 3, 0, 1, 3);
    close_it(&r);
}

/* A node that mirrors its mesh turns the triangles, of a skin the joints that move it do; a node above
 * counts as well. Two mirrors are none, and a mirror that an animation makes is refused. */
TEST(mirrors_turn_triangles)
{
    static const int32_t as_given[] = {0, 1, 2, 0, 2, 3}, turned[] = {0, 2, 1, 0, 3, 2};
    static const struct {
        bool skin;
        const char *from, *to;
        const int32_t *triangle;
    } cases[] = {
        {false, "'scale': [2, 2, 2]", "'scale': [2, 2, -2]", turned},
        {false, "'scale': [2, 2, 2]", "'scale': [-2, 2, -2]", as_given},
        {false, "{'children': [1]}", "{'children': [1], 'scale': [-1, 1, 1]}", turned},
        {true, "{'children': [1]}", "{'children': [1], 'scale': [-1, 1, 1]}", turned},
        {true, "'translation': [5, 5, 5]", "'scale': [-1, 1, 1]", as_given},
    };
    scoped_frames f = frames_folder_make();
    for (size_t i = 0; i < COUNT(cases); i++) {
        glb g = cases[i].skin ? make_skin() : make_square();
        replace(&g, cases[i].from, cases[i].to);
        write_glb(&f, &g);
        scoped_reading r = read_it(&f, 2);
        assert_ok(r.ctx, r.status);
        ck_assert_int_eq(r.mesh.triangle_count, 2);
        ck_assert_mem_eq(r.mesh.triangle, cases[i].triangle, sizeof as_given);
    }
    glb g = make_square();
    replace(&g, "'path': 'translation'", "'path': 'scale'");
    const float mirror[] = {1, 1, 1, 1, 1, -1};
    memcpy(g.bytes + 80, mirror, sizeof mirror);
    write_glb(&f, &g);
    reading r = read_it(&f, 2);
    ck_assert_int_eq(r.status, DRAPE_E_PARSE);
    ck_assert_ptr_nonnull(
        strstr(drape_context_message(r.ctx), "frame 3: node 1 mirrors its mesh, and in frame 0"));
    close_it(&r);
}

/* Numbers of the buffer that are not finite are named. */
TEST(values_are_finite)
{
    static const struct {
        bool skin;
        size_t at;
        const char *message;
    } cases[] = {
        {false, 0, "frame 0: node 0 is at (nan, nan, nan) m; coordinates must be finite"},
        {true, 48 + 4 * 20, "skin 0: number 20 of its inverse bind matrices is nan; it must be finite"},
        {false, 76, "key 1 is at nan s; times must be within 1e+09 s"},
    };
    scoped_frames f = frames_folder_make();
    const float nan = NAN;
    for (size_t i = 0; i < COUNT(cases); i++) {
        glb g = cases[i].skin ? make_skin() : make_square();
        memcpy(g.bytes + cases[i].at, &nan, sizeof nan);
        write_glb(&f, &g);
        scoped_reading r = read_it(&f, 2);
        ck_assert_int_eq(r.status, DRAPE_E_PARSE);
        ck_assert_msg(strstr(drape_context_message(r.ctx), cases[i].message), "%s\nfor %s",
                      drape_context_message(r.ctx), cases[i].message);
    }
}

TEST(faults_name_the_part)
{
    static const struct {
        bool skin;
        const char *from, *to, *message;
    } cases[] = {
        {false, "'count': 6", "'count': 9",
         "a.glb: accessor 0 (POSITION): 9 elements from byte 0 on; buffer view 0"},
        {false, "'count': 6", "'count': 5", "mesh 0, primitive 0: 5 corners of triangles"},
        {false, "'count': 6", "'count': 1e300",
         "accessor 0 (POSITION): \"count\": 1.0000000000000001e+300; it must be"},
        {false, "'count': 6", "'count': -1", "accessor 0 (POSITION): \"count\": -1; it must be"},
        {false, "'type': 'VEC3'", "'type': 'VEC2'",
         "accessor 0 (POSITION): its type is VEC2; VEC3 is needed"},
        {false, "5126", "5123", "accessor 0 (POSITION): its numbers have the type 5123; floats or"},
        {false, "'byteLength': 104", "'byteLength': 999",
         "buffer view 0: bytes 0 to 999; the buffer has 136"},
        {false, "'byteLength': 104", "'byteStride': 4, 'byteLength': 104",
         "its bytes or their stride are out of"},
        {false, "'buffers': [{", "'buffers': [{'uri': 'x.bin', ", "buffer view 0 is not in the binary chunk"},
        {false, "'POSITION': 0", "'POSITION': 4",
         "mesh 0, primitive 0: \"POSITION\": 4; it must be an integer from 0 to 3"},
        {false, "'POSITION': 0", "'NORMAL': 0", "mesh 0, primitive 0 has no POSITION"},
        {false, "{'attributes'", "{'mode': 5, 'attributes'", "its mode is 5; triangles, 4, are read"},
        {false, "{'attributes'", "{'mode': 1, 'attributes'", "its scene shows no triangles"},
        {false, "[{'nodes': [0]}]", "[{'nodes': [9]}]",
         "\"scenes\": a node: 9; it must be an integer from 0 to 2"},
        {false, "'nodes': [{", "'knots': [{",
         "\"scenes\": a node: 0; the file has nothing that it could refer to"},
        {false, "'children': [1]", "'children': [0]", "a node is its own ancestor"},
        {false, "'children': [1]", "'children': [1, 1]", "node 1 is the child of nodes 0 and 0"},
        {false, "'scale': [2, 2, 2]", "'scale': [2, 2]", "node 1: \"scale\" must have 3 numbers"},
        {false, "'scale': [2, 2, 2]", "'rotation': [0, 0, 0, 0]", "node 1: a rotation must not be 0"},
        {false, "'path': 'translation'", "'path': 'spin'", "animation 0, channel 0: its path is spin"},
        {false, "'path': 'translation'", "'path': 'weights'", "channel 0: node 1 has no morph targets"},
        {false, "'LINEAR'", "'EASE'", "channel 1: its interpolation is EASE; LINEAR, STEP or CUBICSPLINE"},
        {false, "'LINEAR'", "'CUBICSPLINE'", "accessor 3 (values of an animation): 2 elements; 6 are needed"},
        {false, "'byteOffset': 72", "'byteOffset': 76",
         "channel 0: key 1 is at 0 s; times must be within 1e+09 s and increase"},
        {false, "{'attributes'", "{'mode': '4', 'attributes'",
         "\"mode\": \"4\"; it must be an integer from 0 to 6"},
        {false, "'scale': [2, 2, 2]", "'matrix': [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]",
         "channel 0: node 1 has a \"matrix\": its translation cannot be animated"},
        {false, "'scale': [2, 2, 2]",
         "'matrix': [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], 'scale': [1, 1, 1]",
         "node 1: it has \"matrix\" beside \"translation\""},
        {false, "'animations': [", "'animations': [{'channels': []}, ",
         "animation 0, which is the one that is"},
        {false, "'scale': [2, 2, 2]", "'scale': [1e9, 1e9, 1e9]",
         "frame 1: node 2 is at (5.41196e+08, 1.30656e+09, 0.5) m"},
        {true, "'WEIGHTS_0': 7", "'WEIGHTS_0': 7, 'JOINTS_1': 6",
         "it has 2 sets of joints, and 1 of weights"},
        {true, "'JOINTS_0': 6", "'JOINTS_0': 6, 'WEIGHTS_2': 7, 'JOINTS_2': 6",
         "of 2 sets of joints and weights it has no JOINTS_1"},
        {false, "'asset'", "'extensionsRequired': ['KHR_draco_mesh_compression'], 'asset'",
         "it needs the extension KHR_draco_mesh_compression"},
        {false, "'asset'", "asset", "a.glb: its JSON, byte"},
        {true, "'JOINTS_0': 6, ", "", "mesh 0, primitive 0: its node has a skin, and it has no JOINTS_0"},
        {true, "'joints': [0, 1]", "'joints': [0, 7]", "skin 0: 7; it must be an integer from 0 to 2"},
        {true, "'joints': [0, 1], 'inverseBindMatrices': 1", "'joints': [0]",
         "point 1: joint 1; the skin has joints 0 to 0"},
        {true, "'joints': [0, 1]", "'joints': [0, 1, 1]",
         "accessor 1 (inverse bind matrices): 2 elements; 3 are"},
        {true, "'WEIGHTS_0': 7", "'WEIGHTS_0': 0", "accessor 0 (WEIGHTS_0): its type is VEC3"},
        {true, "'byteOffset': 268", "'byteOffset': 252", "mesh 0, primitive 0: point 0 has no weights"},
        {true, "'byteOffset': 290", "'byteOffset': 272",
         "accessor 5 (POSITION of a morph target), sparse: index 255"},
        {true, "'sparse': {'count': 1", "'sparse': {'count': 5",
         "sparse: \"count\": 5; it must be an integer from 0 to 4"},
        {true, "'byteOffset': 284", "'byteOffset': 285", "mesh 0, primitive 0: index"},
        {true, "'indices': 8", "'indices': 2",
         "accessor 2 (indices): its numbers have the type 5126; unsigned"},
    };
    scoped_frames f = frames_folder_make();
    for (size_t i = 0; i < COUNT(cases); i++) {
        glb g = cases[i].skin ? make_skin() : make_square();
        if (strstr(cases[i].to, "285"))
            g.bytes[290] = 9;
        replace(&g, cases[i].from, cases[i].to);
        write_glb(&f, &g);
        scoped_reading r = read_it(&f, 2);
        ck_assert_msg(r.status == DRAPE_E_PARSE, "%s: %d", cases[i].message, r.status);
        ck_assert_msg(strstr(drape_context_message(r.ctx), cases[i].message), "%s\nfor %s",
                      drape_context_message(r.ctx), cases[i].message);
    }
    glb g = make_square();
    write_glb(&f, &g);
    reading r = read_it(&f, 1e7); /* 2e7 frames */
    ck_assert_int_eq(r.status, DRAPE_E_PARSE);
    ck_assert_ptr_nonnull(
        strstr(drape_context_message(r.ctx), "20000001 frames of 6 nodes; at most 1000000"));
    close_it(&r);
}

/* Whatever a byte is, and wherever the file ends, reading ends with a status; under the sanitizers nothing
 * is read outside of it. */
TEST(hostile_bytes_are_read_or_refused)
{
    scoped_frames f = frames_folder_make();
    static const char values[] = {0, '9', '-', (char)255};
    for (int kind = 0; kind < 2; kind++) {
        const glb g = kind ? make_skin() : make_square();
        static char bytes[sizeof g + 64];
        const size_t size = pack(&g, bytes);
        for (size_t length = 0; length < size; length += 7) {
            write_bytes(&f, bytes, length);
            scoped_reading r = read_it(&f, 2);
            ck_assert_int_eq(r.status, DRAPE_E_PARSE);
        }
        for (size_t i = 0; i < size; i++) {
            const char kept = bytes[i];
            bytes[i] = values[i % COUNT(values)];
            write_bytes(&f, bytes, size);
            reading r = read_it(&f, 2);
            ck_assert(r.status == DRAPE_OK || r.status == DRAPE_E_PARSE);
            close_it(&r);
            bytes[i] = kept;
        }
    }
}
