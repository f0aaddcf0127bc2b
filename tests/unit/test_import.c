/* test_import.c: OBJ and PLY: what is read, the message of each fault, truncated and hostile data, files. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "mesh/mesh.h"
#include "support/failing_allocator.h"
#include "support/suite.h"

#define COUNT(array) (sizeof(array) / sizeof *(array))

extern const drape_import_ops drape_import_obj, drape_import_ply;

static const drape_mesh_source obj_source = {"/m/file", "bad.obj"}, ply_source = {"/m/file", "bad.ply"};

/* Reads from a copy of exactly size + 1 bytes, so that AddressSanitizer detects a read beyond it. */
static drape_status read_bytes(drape_context *ctx, const drape_import_ops *import, const void *data,
                               size_t size, drape_mesh *mesh)
{
    scoped_memory char *copy = malloc(size + 1);
    memcpy(copy, data, size);
    copy[size] = 0;
    *mesh = (drape_mesh){0};
    const drape_mesh_source *source = import == &drape_import_obj ? &obj_source : &ply_source;
    const drape_status status = import->read(ctx, source, copy, size, mesh);
    return status;
}

static void assert_read(const drape_import_ops *import, const void *data, size_t size, int32_t nodes,
                        const double *x, int32_t triangles, const int32_t *triangle)
{
    scoped_context *ctx = make_context();
    drape_mesh mesh;
    assert_ok(ctx, read_bytes(ctx, import, data, size, &mesh));
    ck_assert_int_eq(mesh.node_count, nodes);
    ck_assert_int_eq(mesh.triangle_count, triangles);
    for (int32_t i = 0; i < 3 * nodes; i++)
        ck_assert_double_eq(mesh.x[i], x[i]);
    for (int32_t i = 0; i < 3 * triangles; i++)
        ck_assert_int_eq(mesh.triangle[i], triangle[i]);
    drape_mesh_free(&mesh);
}

static void assert_refused(const drape_import_ops *import, const void *data, size_t size, const char *message)
{
    scoped_context *ctx = make_context();
    drape_mesh mesh;
    ck_assert_int_eq(read_bytes(ctx, import, data, size, &mesh), DRAPE_E_PARSE);
    ck_assert_str_eq(drape_context_message(ctx), message);
    drape_mesh_free(&mesh);
}

static void obj_refused(const char *text, const char *message)
{
    assert_refused(&drape_import_obj, text, strlen(text), message);
}

static void ply_refused(const char *text, const char *message)
{
    assert_refused(&drape_import_ply, text, strlen(text), message);
}

/* The unit square with its corners in order, and its fan. */
static const double corners[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
static const int32_t fan[] = {0, 1, 2, 0, 2, 3};

static void obj_is_square(const char *text)
{
    assert_read(&drape_import_obj, text, strlen(text), 4, corners, 2, fan);
}

static void ply_is_square(const char *text)
{
    assert_read(&drape_import_ply, text, strlen(text), 4, corners, 2, fan);
}

#define SQUARE "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"

TEST(obj_corners_of_every_form)
{
    obj_is_square(SQUARE "f 1 2 3\nf 1 3 4\n");
    obj_is_square(SQUARE "f 1 2 3 4\n");
    obj_is_square(SQUARE "f 1/5 2/6 3/7 4/-8");
    obj_is_square(SQUARE "f 1//9 2//9 3//9 4//9");
    obj_is_square(SQUARE "f 1/1/1 2/1/1 3/1/1 4/1/1");
    obj_is_square(SQUARE "f 1/ 2/1/ 3// 4");
    obj_is_square(SQUARE "f -4 -3 -2 -1\n");
    obj_is_square(SQUARE "f -4/1 2 -2//3 +4\n");
    obj_is_square("f 1 2 3 4\n" SQUARE); /* a face before its nodes */
    obj_is_square("v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\nv 0 1 0\nf 1 -2 -1\n");
}

TEST(obj_lines_of_every_form)
{
    obj_is_square("v 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nv 0 1 0\r\nf 1 2 3 4\r\n");
    obj_is_square("v 0 0 0\rv 1 0 0\rv 1 1 0\rv 0 1 0\rf 1 2 3 4");
    obj_is_square("\xEF\xBB\xBFv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4");
    obj_is_square("\n\n  v\t0  0 0 \n\nv 1 0 0\nv 1 1 0\n v 0 1 0\n  f 1 2 3 4  \n\n");
    obj_is_square("v 0 \\\n 0 0\nv 1 0 0\nv 1\\\r\n 1 0\nv 0 1 0\nf 1 2 \\\n3\\\n 4 \n");
    obj_is_square("v 0 0 0 1\nv 1 0 0 1 0.5 0.5 0.5\nv 1 1 0 red\nv 0 1 0 # last\nf 1 2 3 4 #no corner\n");
    obj_is_square("# v 9 9 9 \\\nv 0 0 0\nmtllib a b.mtl\no sheet\nv 1 0 0\nvt 0 0\nvn 0 0 1\nvp 1\n"
                  "g a b\nv 1 1 0\ns off\nusemtl cloth\nv 0 1 0\nl 1 2\np 1\nf 1 2 3 \\\n\\\n4\n");
}

TEST(obj_numbers_of_every_form)
{
    static const double x[] = {1e-3, -2.5, 0.25, 3e8, .5, -0.0, 12345678.9012345, 4, 1e-320};
    static const int32_t triangle[] = {0, 1, 2};
    const char *text = "v 1e-3 -2.5 +.25\nv 3E+8 .5 -0\nv 12345678.9012345 4. 1e-320\nf 1 2 3\n";
    assert_read(&drape_import_obj, text, strlen(text), 3, x, 1, triangle);
}

TEST(obj_faults)
{
    obj_refused("v 0 0\n", "/m/file: bad.obj:1: a node with 2 coordinates; it needs x, y and z");
    obj_refused("\n\nv\n", "/m/file: bad.obj:3: a node with 0 coordinates; it needs x, y and z");
    obj_refused("v 0 0 # 0\n", "/m/file: bad.obj:1: a node with 2 coordinates; it needs x, y and z");
    obj_refused("v 0 \\\n up 0\n", "/m/file: bad.obj:2: y of a node is \"up\"; it must be a finite number");
    obj_refused("v 0 0 1.5x\n", "/m/file: bad.obj:1: z of a node is \"1.5x\"; it must be a finite number");
    obj_refused("v nan 0 0\n", "/m/file: bad.obj:1: x of a node is \"nan\"; it must be a finite number");
    obj_refused("v 0 -inf 0\n", "/m/file: bad.obj:1: y of a node is \"-inf\"; it must be a finite number");
    obj_refused("v 0 0 1e999\n", "/m/file: bad.obj:1: z of a node is \"1e999\"; it must be a finite number");
    obj_refused("v 0,5 0 0\n", "/m/file: bad.obj:1: x of a node is \"0,5\"; it must be a finite number");
    obj_refused(SQUARE "f 1 2\n", "/m/file: bad.obj:5: a face with 2 corners; it needs at least 3");
    obj_refused(SQUARE "f\n", "/m/file: bad.obj:5: a face with 0 corners; it needs at least 3");
    obj_refused(SQUARE "f 1 2 5\n", "/m/file: bad.obj:5: there is no node 5; range is 1 to 4");
    obj_refused(SQUARE "f 1 0 3\n", "/m/file: bad.obj:5: there is no node 0; range is 1 to 4");
    obj_refused(SQUARE "f -5 2 3\n", "/m/file: bad.obj:5: there is no node -5; range is -4 to -1");
    obj_refused("v 0 0 0\nf -2 1 1\n" SQUARE, "/m/file: bad.obj:2: there is no node -2; range is -1 to -1");
    obj_refused("f -1 1 1\n" SQUARE, "/m/file: bad.obj:1: there is no node -1: none was defined");
    obj_refused("f 1 2 3\n", "/m/file: bad.obj:1: there is no node 1: none was defined");
    obj_refused(
        SQUARE "f 1 2 99999999999999999999\n",
        "/m/file: bad.obj:5: a corner is \"99999999999999999999\"; it must be v, v/vt, v//vn or v/vt/vn");
    obj_refused(SQUARE "f 1 2 922337203685477580\n",
                "/m/file: bad.obj:5: there is no node 922337203685477580; range is 1 to 4");
    static const char *const wrong[] = {"1.0", "x", "/1", "1/a", "1/2/3/4", "1/2/b", "-", "+", "--1", "1e0"};
    for (size_t i = 0; i < COUNT(wrong); i++) {
        char text[100], message[200];
        snprintf(text, sizeof text, SQUARE "f 1 2 %s\n", wrong[i]);
        snprintf(message, sizeof message,
                 "/m/file: bad.obj:5: a corner is \"%s\"; it must be v, v/vt, v//vn or v/vt/vn", wrong[i]);
        obj_refused(text, message);
    }
}

#define VERTICES    "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
#define FACES       "element face 2\nproperty list uchar int vertex_indices\n"
#define ASCII       "ply\nformat ascii 1.0\n"
#define SQUARE_ROWS "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"

TEST(ply_ascii)
{
    ply_is_square(ASCII VERTICES FACES "end_header\n" SQUARE_ROWS "3 0 1 2\n3 0 2 3\n");
    ply_is_square(ASCII VERTICES FACES "end_header\n" SQUARE_ROWS
                                       "3 0 1 2\n3 0 2 3"); /* no newline at the end */
    ply_is_square(ASCII VERTICES
                  "element face 1\nproperty list uint8 uint32 vertex_index\nend_header\n" SQUARE_ROWS
                  "4 0 1 2 3\n");
    ply_is_square(
        "ply\r\nformat ascii 1.0\r\ncomment made by hand\r\nobj_info nothing\r\nelement vertex 4\r\n"
        "property int x\r\nproperty char y\r\nproperty double z\r\nelement face 2\r\n"
        "property list int int vertex_indices\r\nend_header\r\n0 0 0\r\n1 0 0\r\n1 1 0\r\n0 1 0\r\n"
        "3 0 1 2\r\n3 0 2 3\r\n");
    /* faces first, other elements and properties between, empty lines */
    ply_is_square(
        "ply\ncomment x\nformat ascii 1.0\nelement camera 1\nproperty float f\nproperty list uchar "
        "float k\nelement nothing 7\nelement face 1\nproperty uchar red\n"
        "property list uchar short vertex_indices\nproperty list uchar float texcoord\n"
        "element vertex 4\nproperty float nx\nproperty float64 z\nproperty float y\nproperty float x\n"
        "property uchar alpha\nelement edge 1\nproperty int a\nend_header\n"
        "0.5 3 1 2 3\n\n\n255 4 0 1 2 3 2 .1 .2\n9 0 0 0 1\n9 0 0 1 1\n\n9 0 1 1 1\n9 0 1 0 1\n5\n");
}

TEST(ply_header_faults)
{
    ply_refused("", "/m/file: bad.ply:1: the first line must be \"ply\"");
    ply_refused("plY\n", "/m/file: bad.ply:1: the first line must be \"ply\"");
    ply_refused("ply\n", "/m/file: bad.ply:2: the header has no end_header");
    ply_refused("ply\nend_header\n", "/m/file: bad.ply:2: the header has no format");
    ply_refused("ply\nformat\n", "/m/file: bad.ply:2: the line ends before the name of the format");
    ply_refused("ply\nformat ascii\n", "/m/file: bad.ply:2: the line ends before the version of the format");
    ply_refused("ply\nformat text 1.0\n", "/m/file: bad.ply:2: format \"text\"; it must be one of: ascii, "
                                          "binary_little_endian, binary_big_endian");
    ply_refused("ply\nformat ascii 2.0\n",
                "/m/file: bad.ply:2: version \"2.0\" of the format; it must be 1.0");
    ply_refused(ASCII "elephant vertex 3\n", "/m/file: bad.ply:3: unknown keyword \"elephant\"");
    ply_refused(ASCII "element\n", "/m/file: bad.ply:3: the line ends before the name of the element");
    ply_refused(ASCII "element vertex\n",
                "/m/file: bad.ply:3: the line ends before the count of the element");
    ply_refused(ASCII "element vertex -1\n",
                "/m/file: bad.ply:3: count \"-1\"; it must be a whole number from 0");
    ply_refused(ASCII "element vertex 1e3\n",
                "/m/file: bad.ply:3: count \"1e3\"; it must be a whole number from 0");
    ply_refused(ASCII "element vertex 99999999999999999999\n",
                "/m/file: bad.ply:3: count \"99999999999999999999\"; it must be a whole number from 0");
    ply_refused(ASCII "element vertex 1\nelement vertex 1\n",
                "/m/file: bad.ply:4: element vertex is defined twice");
    ply_refused(ASCII "property float x\n", "/m/file: bad.ply:3: a property before the first element");
    ply_refused(ASCII "element vertex 1\nproperty\n",
                "/m/file: bad.ply:4: the line ends before the type of the property");
    ply_refused(ASCII "element vertex 1\nproperty float\n",
                "/m/file: bad.ply:4: the line ends before the name of the property");
    ply_refused(ASCII "element vertex 1\nproperty half x\n", "/m/file: bad.ply:4: unknown type \"half\"");
    ply_refused(ASCII "element face 1\nproperty list\n",
                "/m/file: bad.ply:4: the line ends before the type of the list's count");
    ply_refused(ASCII "element face 1\nproperty list uchar\n",
                "/m/file: bad.ply:4: the line ends before the type of the list's values");
    ply_refused(ASCII "element face 1\nproperty list float int vertex_indices\n",
                "/m/file: bad.ply:4: the count of a list is float; it must be an integer type");
    ply_refused(ASCII "element face 1\nproperty list uchar float32 vertex_indices\n",
                "/m/file: bad.ply:4: vertex_indices are float; they must be of an integer type");
    ply_refused(ASCII "element vertex 1\nproperty float x\nproperty float x\n",
                "/m/file: bad.ply:5: property x is defined twice");
    ply_refused(ASCII FACES "property list uchar int vertex_index\n",
                "/m/file: bad.ply:5: property vertex_index is defined twice");
    ply_refused(ASCII VERTICES "end_header\n", "/m/file: bad.ply:7: the header has no element face");
    ply_refused(ASCII FACES "end_header\n", "/m/file: bad.ply:5: the header has no element vertex");
    ply_refused(ASCII VERTICES "element face 1\nproperty int vertex_indices\nend_header\n",
                "/m/file: bad.ply:9: element face has no list vertex_indices");
    ply_refused(ASCII FACES "element vertex 1\nproperty float x\nproperty list uchar float y\nend_header\n",
                "/m/file: bad.ply:8: element vertex has no property y");
}

TEST(ply_header_limits)
{
    char text[20000];
    size_t used = (size_t)snprintf(text, sizeof text, ASCII);
    for (int i = 0; i < 33; i++)
        used += (size_t)snprintf(text + used, sizeof text - used, "element e%d 0\n", i);
    ply_refused(text, "/m/file: bad.ply:35: more than 32 elements");
    used = (size_t)snprintf(text, sizeof text, ASCII "element vertex 1\n");
    for (int i = 0; i < 257; i++)
        used += (size_t)snprintf(text + used, sizeof text - used, "property float p%d\n", i);
    ply_refused(text, "/m/file: bad.ply:260: more than 256 properties");
}

TEST(ply_ascii_data_faults)
{
    ply_refused(ASCII VERTICES FACES "end_header\n0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n",
                "/m/file: bad.ply:10: the line ends before all values of its vertex");
    ply_refused(ASCII VERTICES FACES "end_header\n0 0 0\n1 0 0 5\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n",
                "/m/file: bad.ply:11: \"5\" after the last value of its vertex");
    ply_refused(ASCII VERTICES FACES "end_header\n0 0 0\n1 zero 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n",
                "/m/file: bad.ply:11: value \"zero\"; it must be a finite number");
    ply_refused(ASCII VERTICES FACES "end_header\n0 0 0\n1 inf 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n",
                "/m/file: bad.ply:11: value \"inf\"; it must be a finite number");
    ply_refused(ASCII VERTICES FACES "end_header\n" SQUARE_ROWS "3 0 1 2\n3 0 2 4\n",
                "/m/file: bad.ply:15: there is no vertex 4; there are 4, counted from 0");
    ply_refused(ASCII VERTICES FACES "end_header\n" SQUARE_ROWS "3 0 1 2\n3 0 -2 3\n",
                "/m/file: bad.ply:15: there is no vertex -2; there are 4, counted from 0");
    ply_refused(ASCII VERTICES FACES "end_header\n" SQUARE_ROWS "3 0 1 2\n3 0 2 1.5\n",
                "/m/file: bad.ply:15: there is no vertex 1.5; there are 4, counted from 0");
    ply_refused(ASCII VERTICES FACES "end_header\n" SQUARE_ROWS "3 0 1 2\n2 0 1\n",
                "/m/file: bad.ply:15: a face with 2 corners; it needs at least 3");
    ply_refused(ASCII VERTICES FACES "end_header\n" SQUARE_ROWS "3 0 1 2\n4 0 1 2\n",
                "/m/file: bad.ply:15: the line ends before all values of its face");
    ply_refused(ASCII VERTICES FACES "end_header\n" SQUARE_ROWS "3 0 1 2\n-3 0 1 2\n",
                "/m/file: bad.ply:15: a list of -3 values; it must be a whole number from 0");
    ply_refused(ASCII VERTICES FACES "end_header\n" SQUARE_ROWS "3 0 1 2\n3.5 0 1 2\n",
                "/m/file: bad.ply:15: a list of 3.5 values; it must be a whole number from 0");
    ply_refused(ASCII VERTICES FACES "end_header\n" SQUARE_ROWS "3 0 1 2\n1e300 0 1 2\n",
                "/m/file: bad.ply:15: a list of 1e+300 values; it must be a whole number from 0");
    ply_refused(ASCII VERTICES FACES "end_header\n" SQUARE_ROWS "4000000000 0 1 2\n3 0 1 2\n",
                "/m/file: bad.ply:14: the line ends before all values of its face");
    ply_refused(ASCII VERTICES FACES "end_header\n" SQUARE_ROWS "3 0 1 2\n",
                "/m/file: bad.ply:15: the file ends before face 1 of 2");
}

TEST(ply_counts_beyond_the_file_take_no_memory)
{
    failing_allocator memory = {0};
    drape_context *ctx = failing_context(&memory);
    drape_mesh mesh;
    const char *text =
        ASCII "element vertex 200000000\nproperty float x\nproperty float y\nproperty float z\n" FACES
              "end_header\n" SQUARE_ROWS "3 0 1 2\n3 0 2 3\n";
    ck_assert_int_eq(read_bytes(ctx, &drape_import_ply, text, strlen(text), &mesh), DRAPE_E_PARSE);
    ck_assert_str_eq(drape_context_message(ctx),
                     "/m/file: bad.ply:3: 200000000 items of vertex; the 40 bytes "
                     "after the header hold at most 6");
    text = ASCII "element nothing 9000000000000000000\nelement x 9000000000000000000\nproperty list uchar "
                 "double y\n" VERTICES FACES "end_header\n" SQUARE_ROWS "3 0 1 2\n3 0 2 3\n";
    ck_assert_int_eq(read_bytes(ctx, &drape_import_ply, text, strlen(text), &mesh), DRAPE_E_PARSE);
    ck_assert_str_eq(drape_context_message(ctx), "/m/file: bad.ply:4: 9000000000000000000 items of x; the 40 "
                                                 "bytes after the header hold at most 20");
    ck_assert_int_eq(memory.calls, 0);
    drape_context_destroy(&ctx);
    ck_assert_int_eq(memory.live, 0);
}

typedef struct bytes {
    unsigned char data[2000];
    size_t size;
    bool big_endian;
} bytes;

static void put_text(bytes *out, const char *text)
{
    memcpy(out->data + out->size, text, strlen(text));
    out->size += strlen(text);
}

static void put_bits(bytes *out, uint64_t bits, size_t size)
{
    for (size_t i = 0; i < size; i++)
        out->data[out->size + (out->big_endian ? size - 1 - i : i)] = (unsigned char)(bits >> 8 * i);
    out->size += size;
}

static void put_float(bytes *out, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    put_bits(out, bits, 4);
}

static void put_double(bytes *out, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    put_bits(out, bits, 8);
}

/* Every type, lists that are skipped before and after the data, an element between; the unit square. */
static bytes binary_square(bool big_endian, const char *line_end)
{
    bytes out = {.big_endian = big_endian};
    const char *lines[] = {"ply",
                           big_endian ? "format binary_big_endian 1.0" : "format binary_little_endian 1.0",
                           "element vertex 4",
                           "property list ushort short skipped",
                           "property float x",
                           "property double y",
                           "property char z",
                           "property uchar red",
                           "element other 2",
                           "property list char double values",
                           "element face 1",
                           "property uint flags",
                           "property list int ushort vertex_index",
                           "end_header"};
    for (size_t i = 0; i < COUNT(lines); i++) {
        put_text(&out, lines[i]);
        put_text(&out, line_end);
    }
    for (int i = 0; i < 4; i++) {
        put_bits(&out, (uint64_t)i, 2);
        for (int k = 0; k < i; k++)
            put_bits(&out, 0xBEEF, 2);
        put_float(&out, (float)corners[3 * i]);
        put_double(&out, corners[3 * i + 1]);
        put_bits(&out, 0, 1);
        put_bits(&out, '\n', 1);
    }
    put_bits(&out, 0, 1);
    put_bits(&out, 1, 1);
    put_double(&out, 1.5);
    put_bits(&out, 7, 4);
    put_bits(&out, 4, 4);
    for (unsigned i = 0; i < 4; i++)
        put_bits(&out, i, 2);
    return out;
}

TEST(ply_binary)
{
    static const char *const line_ends[] = {"\n", "\r\n"};
    for (int i = 0; i < 4; i++) {
        const bytes data = binary_square(i / 2, line_ends[i % 2]);
        assert_read(&drape_import_ply, data.data, data.size, 4, corners, 2, fan);
    }
}

TEST(ply_binary_integers_keep_their_sign)
{
    static const char *const names[] = {"char", "uchar", "short", "ushort", "int", "uint"};
    static const size_t sizes[] = {1, 1, 2, 2, 4, 4};
    static const double all_ones[] = {-1, 255, -1, 65535, -1, 4294967295.0};
    static const double top_bit[] = {-128, 128, -32768, 32768, -2147483648.0, 2147483648.0};
    for (size_t i = 0; i < COUNT(names); i++) {
        bytes out = {.big_endian = i % 2};
        char header[300];
        snprintf(header, sizeof header,
                 "ply\nformat %s 1.0\nelement vertex 1\nproperty %s x\nproperty %s y\nproperty float z\n"
                 "element face 0\nproperty list uchar int vertex_indices\nend_header\n",
                 out.big_endian ? "binary_big_endian" : "binary_little_endian", names[i], names[i]);
        put_text(&out, header);
        put_bits(&out, UINT64_MAX, sizes[i]);
        put_bits(&out, UINT64_C(1) << (8 * sizes[i] - 1), sizes[i]);
        put_float(&out, -0.375f);
        const double x[] = {all_ones[i], top_bit[i], -0.375};
        assert_read(&drape_import_ply, out.data, out.size, 1, x, 0, NULL);
    }
}

static bytes small_binary(void)
{
    bytes out = {.size = 0};
    put_text(&out, "ply\nformat binary_little_endian 1.0\n" VERTICES FACES "end_header\n");
    for (int i = 0; i < 12; i++)
        put_float(&out, (float)corners[i]);
    for (int t = 0; t < 2; t++) {
        put_bits(&out, 3, 1);
        for (int k = 0; k < 3; k++)
            put_bits(&out, (uint64_t)fan[3 * t + k], 4);
    }
    return out;
}

TEST(ply_binary_faults)
{
    bytes data = small_binary();
    assert_read(&drape_import_ply, data.data, data.size, 4, corners, 2, fan);
    assert_refused(&drape_import_ply, data.data, data.size - 1,
                   "/m/file: bad.ply: face 1: the data end within it");
    data.data[data.size - 13] = 2;
    assert_refused(&drape_import_ply, data.data, data.size,
                   "/m/file: bad.ply: face 1: a face with 2 corners; it needs at least 3");
    data.data[data.size - 13] = 200;
    assert_refused(&drape_import_ply, data.data, data.size,
                   "/m/file: bad.ply: face 1: the data end within it");
    data.data[data.size - 13] = 3;
    data.data[data.size - 1] = 0x80;
    assert_refused(&drape_import_ply, data.data, data.size,
                   "/m/file: bad.ply: face 1: there is no vertex -2147483645; there are 4, counted from 0");
    data = small_binary();
    assert_refused(&drape_import_ply, data.data, data.size - 40,
                   "/m/file: bad.ply:3: 4 items of vertex; the 34 bytes after the header hold at most 2");
}

static const char rich_obj[] =
    "# sheet\nv 0 0 0\nv 1 0 0 \\\n 1\nv 1 1 0\r\nv 0 1 0\nvt 0 0\nf 1/1/1 2//2 -2 "
    "4\nf 1 2 3\n";

/* Every byte is replaced by several critical ones: the file is read and validated, or refused; it never
 * crashes and never takes much memory. */
static void change_every_byte(const drape_import_ops *import, const void *data, size_t size)
{
    static const char replacements[] = {0, '\n', '\r', ' ', '-', '9', '/', '\\', '#', 'e', (char)0xFF, 1};
    scoped_memory char *copy = malloc(size);
    for (size_t at = 0; at < size; at++)
        for (size_t k = 0; k < sizeof replacements; k++) {
            failing_allocator memory = {0};
            drape_context *ctx = failing_context(&memory);
            drape_mesh mesh;
            memcpy(copy, data, size);
            copy[at] = replacements[k];
            drape_status status = read_bytes(ctx, import, copy, size, &mesh);
            const drape_mesh_source *source = import == &drape_import_obj ? &obj_source : &ply_source;
            if (!status)
                status = drape_mesh_validate_positions(ctx, source, &mesh);
            if (!status)
                status = drape_mesh_validate_triangles(ctx, source, &mesh);
            if (!status)
                status = drape_mesh_connect(ctx, source, &mesh);
            if (!status)
                status = drape_mesh_validate_nodes(ctx, source, &mesh);
            ck_assert(status == DRAPE_OK || status == DRAPE_E_PARSE);
            ck_assert_uint_lt(memory.largest, 100000);
            drape_mesh_free(&mesh);
            drape_context_destroy(&ctx);
            ck_assert_int_eq(memory.live, 0);
        }
}

TEST(every_byte_changed)
{
    static const char text[] = ASCII VERTICES FACES "end_header\n" SQUARE_ROWS "3 0 1 2\n3 0 2 3\n";
    const bytes binary = binary_square(false, "\n"), small = small_binary();
    change_every_byte(&drape_import_obj, rich_obj, sizeof rich_obj - 1);
    change_every_byte(&drape_import_ply, text, sizeof text - 1);
    change_every_byte(&drape_import_ply, binary.data, binary.size);
    change_every_byte(&drape_import_ply, small.data, small.size);
}

typedef struct folder {
    char path[64];
} folder;

static folder new_folder(void)
{
    folder f = {"/tmp/drape_import_XXXXXX"};
    ck_assert_ptr_nonnull(mkdtemp(f.path));
    return f;
}

static void write_file(const folder *f, const char *name, const void *data, size_t size)
{
    char path[200];
    snprintf(path, sizeof path, "%s/%s", f->path, name);
    FILE *file = fopen(path, "wb");
    ck_assert_ptr_nonnull(file);
    ck_assert_uint_eq(fwrite(data, 1, size, file), size);
    ck_assert_int_eq(fclose(file), 0);
}

static void remove_file(const folder *f, const char *name)
{
    char path[200];
    snprintf(path, sizeof path, "%s/%s", f->path, name);
    ck_assert_int_eq(remove(path), 0);
}

static drape_mesh_def file_def(const char *file)
{
    return (drape_mesh_def){.file = file, .scale = {1, 1, 1}};
}

static drape_status make_file(drape_context *ctx, const folder *f, const char *name, drape_mesh *mesh)
{
    const drape_mesh_def def = file_def(name);
    return drape_mesh_make(ctx, "/m", &def, f->path, mesh);
}

TEST(files_by_ending_relative_and_absolute)
{
    const folder f = new_folder();
    const char *obj = SQUARE "f 1 2 3 4\n";
    const bytes ply = small_binary();
    scoped_context *ctx = make_context();
    write_file(&f, "a.obj", obj, strlen(obj));
    write_file(&f, "b.x.PLY", ply.data, ply.size);
    char absolute[200];
    snprintf(absolute, sizeof absolute, "%s/a.obj", f.path);
    const char *const names[] = {"a.obj", "b.x.PLY", "./a.obj", absolute};
    for (size_t i = 0; i < COUNT(names); i++) {
        drape_mesh mesh;
        assert_ok(ctx, make_file(ctx, &f, names[i], &mesh));
        ck_assert_int_eq(mesh.hinge_count, 1);
        ck_assert_int_eq(mesh.rows, 0);
        drape_mesh_free(&mesh);
    }
    const drape_mesh_def def = file_def(absolute);
    drape_mesh mesh;
    ck_assert_int_eq(drape_mesh_make(ctx, "/m", &def, NULL, &mesh), DRAPE_OK);
    drape_mesh_free(&mesh);
    remove_file(&f, "a.obj");
    remove_file(&f, "b.x.PLY");
    rmdir(f.path);
}

static void file_refused(const folder *f, const char *name, drape_status status, const char *message)
{
    scoped_context *ctx = make_context();
    drape_mesh mesh;
    ck_assert_int_eq(make_file(ctx, f, name, &mesh), status);
    ck_assert_str_eq(drape_context_message(ctx), message);
    ck_assert_ptr_null(mesh.x);
}

TEST(file_faults)
{
    const folder f = new_folder();
    char message[300], path[200];
    file_refused(&f, "a.stl", DRAPE_E_ARGUMENT, "/m/file: a.stl: unknown ending; known are .obj, .ply");
    file_refused(&f, "", DRAPE_E_ARGUMENT, "/m/file: : unknown ending; known are .obj, .ply");
    file_refused(&f, "obj", DRAPE_E_ARGUMENT, "/m/file: obj: unknown ending; known are .obj, .ply");
    snprintf(message, sizeof message, "/m/file: %s/no.obj: cannot be read: No such file or directory",
             f.path);
    file_refused(&f, "no.obj", DRAPE_E_FILE, message);
    snprintf(path, sizeof path, "%s/folder.ply", f.path);
    ck_assert_int_eq(mkdir(path, 0700), 0);
    snprintf(message, sizeof message, "/m/file: %s: cannot be read: Is a directory", path);
    file_refused(&f, "folder.ply", DRAPE_E_FILE, message);
    rmdir(path);
    snprintf(path, sizeof path, "%s/pipe.ply", f.path);
    ck_assert_int_eq(mkfifo(path, 0600), 0);
    snprintf(message, sizeof message, "/m/file: %s: cannot be read: Not a regular file", path);
    file_refused(&f, "pipe.ply", DRAPE_E_FILE, message);
    remove_file(&f, "pipe.ply");
    write_file(&f, "large.obj", "", 0);
    snprintf(path, sizeof path, "%s/large.obj", f.path);
    if (truncate(path, INT64_C(1) << 31) == 0) { /* a hole: takes no space on the disk */
        snprintf(message, sizeof message, "/m/file: %s: has 2147483648 bytes; at most 2147483647 can be read",
                 path);
        file_refused(&f, "large.obj", DRAPE_E_FILE, message);
    }
    remove_file(&f, "large.obj");
    rmdir(f.path);
}

TEST(content_faults_name_the_file)
{
    const folder f = new_folder();
    static const struct {
        const char *content, *message;
    } cases[] = {
        {"", "/m/file: bad.obj: the mesh has no nodes"},
        {SQUARE, "/m/file: bad.obj: the mesh has no triangles"},
        {SQUARE "f 1 2 3 4\nf 3 4 3\n",
         "/m/file: bad.obj:6: a face with corners at 2 nodes; it needs at least 3; remedy: delete it"},
        {SQUARE "f 1 2 3\n", "/m/file: bad.obj: node 3 belongs to no triangle; remedy: delete loose "
                             "vertices, of which there is 1"},
        {SQUARE "f 1 2 3\nf 4 1 3\nf 3 1 2\n",
         "/m/file: bad.obj: triangles 0 and 2 have the same nodes 0 1 2; remedy: delete one of them"},
        {SQUARE "v 2e9 0 0\nf 1 2 5 3\n",
         "/m/file: bad.obj: node 4 is at (2e+09, 0, 0) m; coordinates must be "
         "finite and within 1e+09 m"},
        {SQUARE "f 1 2 3 9\n", "/m/file: bad.obj:5: there is no node 9; range is 1 to 4"},
    };
    for (size_t i = 0; i < COUNT(cases); i++) {
        write_file(&f, "bad.obj", cases[i].content, strlen(cases[i].content));
        file_refused(&f, "bad.obj", DRAPE_E_PARSE, cases[i].message);
    }
    remove_file(&f, "bad.obj");
    rmdir(f.path);
}

static void fail_every_allocation(const folder *f, const char *name)
{
    drape_status status = DRAPE_E_MEMORY;
    int failures = -1;
    for (long n = 1; status; n++, failures++) {
        failing_allocator memory = {.fail_at = n};
        drape_context *ctx = failing_context(&memory);
        drape_mesh mesh;
        status = make_file(ctx, f, name, &mesh);
        ck_assert(status == DRAPE_OK || status == DRAPE_E_MEMORY);
        ck_assert(status == DRAPE_OK || mesh.x == NULL);
        drape_mesh_free(&mesh);
        drape_context_destroy(&ctx);
        ck_assert_int_eq(memory.live, 0);
    }
    ck_assert_int_ge(failures, 17);
}

TEST(every_failed_allocation_is_reported_and_none_leaks)
{
    const folder f = new_folder();
    const bytes ply = small_binary();
    write_file(&f, "a.obj", rich_obj, sizeof rich_obj - 1 - strlen("f 1 2 3\n"));
    write_file(&f, "a.ply", ply.data, ply.size);
    fail_every_allocation(&f, "a.obj");
    fail_every_allocation(&f, "a.ply");
    remove_file(&f, "a.obj");
    remove_file(&f, "a.ply");
    rmdir(f.path);
}
