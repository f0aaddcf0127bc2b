/* test_sequence.c: frames of a mesh from files: what is read, at which times, and the message of each
 * fault. */
#include "mesh/npy_array.h"
#include "mesh/sequence.h"
#include "model/deformation.h"
#include "support/frames.h"

#define COUNT(array) (sizeof(array) / sizeof *(array))

static const double square[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
static const int two[] = {0, 1, 2, 0, 2, 3};
/* The square, and itself two frames later, raised by 1 and 3. */
static const double raised[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1,
                                1, 1, 1, 0, 1, 1, 0, 0, 3, 1, 0, 3, 1, 1, 3, 0, 1, 3};

typedef struct reading {
    drape_context *ctx;
    drape_arena arena;
    drape_mesh mesh;
    drape_sequence frames;
    drape_status status;
} reading;

static reading read_it(const frames_folder *f, const drape_sequence_def *def)
{
    reading r = {.ctx = NULL};
    ck_assert_int_eq(drape_context_create(NULL, &r.ctx), DRAPE_OK);
    r.arena = drape_arena_of(r.ctx);
    r.status = drape_sequence_read(&r.arena, "/c", f->path, def, &r.mesh, &r.frames);
    if (!r.status)
        r.status = drape_sequence_validate(r.ctx, &(drape_mesh_source){.pointer = "/c", .file = def->file},
                                           &r.mesh, &r.frames);
    return r;
}

static void close_it(reading *r)
{
    drape_mesh_free(&r->mesh);
    drape_arena_free(&r->arena);
    drape_context_destroy(&r->ctx);
}

#define scoped_reading SCOPED(close_it) reading

static void assert_raised(const frames_folder *f, const drape_sequence_def *def, double first, double second)
{
    scoped_reading r = read_it(f, def);
    assert_ok(r.ctx, r.status);
    ck_assert_int_eq(r.frames.frame_count, 3);
    ck_assert_int_eq(r.frames.node_count, 4);
    ck_assert_int_eq(r.mesh.triangle_count, 2);
    for (size_t i = 0; i < COUNT(raised); i++)
        ck_assert_double_eq(r.frames.x[i], raised[i]);
    for (size_t i = 0; i < COUNT(square); i++)
        ck_assert_double_eq(r.mesh.x[i], raised[i]);
    ck_assert_double_eq(r.frames.time[0], first);
    ck_assert_double_eq(r.frames.time[1], second);
}

static void assert_fault(const frames_folder *f, const drape_sequence_def *def, const char *message)
{
    scoped_reading r = read_it(f, def);
    ck_assert_int_lt(r.status, 0);
    ck_assert_msg(strstr(drape_context_message(r.ctx), message), "%s", drape_context_message(r.ctx));
}

static void put_float(FILE *file, double x)
{
    const float number = (float)x;
    ck_assert_uint_eq(fwrite(&number, sizeof number, 1, file), 1);
}

static void write_pc2(const frames_folder *f, const char *name, int32_t points, int32_t samples, double step)
{
    FILE *file = frames_file(f, name);
    const int32_t version = 1;
    fwrite("POINTCACHE2", 1, 12, file);
    fwrite(&version, 4, 1, file);
    fwrite(&points, 4, 1, file);
    put_float(file, 10);
    put_float(file, step);
    fwrite(&samples, 4, 1, file);
    for (size_t i = 0; i < COUNT(raised); i++)
        put_float(file, raised[i]);
    ck_assert_int_eq(fclose(file), 0);
}

TEST(formats_give_the_same_frames)
{
    scoped_frames f = frames_folder_make();
    frames_obj(&f, "square.obj", 4, square, 2, two);
    frames_npy(&f, "a.npy", "(3, 4, 3)", COUNT(raised), raised);
    frames_npy(&f, "times.npy", "(3,)", 3, (const double[]){0, 0.5, 2});
    write_pc2(&f, "a.pc2", 4, 3, 0.5);
    for (int i = 0; i < 3; i++) {
        char name[32];
        snprintf(name, sizeof name, "a_%03d.obj", i + 1);
        frames_obj(&f, name, 4, raised + 12 * i, 2, two);
    }
    assert_raised(&f, &(drape_sequence_def){"a.npy", "square.obj", NULL, 10, 2}, 2, 2.1);
    assert_raised(&f, &(drape_sequence_def){"a.npy", "square.obj", "times.npy", 10, 2}, 2, 2.5);
    assert_raised(&f, &(drape_sequence_def){"a.pc2", "square.obj", NULL, 10, 2}, 3, 3.05);
    assert_raised(&f, &(drape_sequence_def){"a_%03d.obj", NULL, NULL, 10, 0}, 0, 0.1);
    /* the folder itself has the square first, which is the first frame once more */
    reading r = read_it(&f, &(drape_sequence_def){"./", NULL, NULL, 10, 0});
    assert_ok(r.ctx, r.status);
    ck_assert_int_eq(r.frames.frame_count, 4);
    ck_assert_double_eq(r.frames.x[12 + 2], 1);
    close_it(&r);
    r = read_it(&f, &(drape_sequence_def){"square.obj", NULL, NULL, 10, 0});
    assert_ok(r.ctx, r.status);
    ck_assert_int_eq(r.frames.frame_count, 1);
    close_it(&r);
}

TEST(faults_name_file_frame_and_value)
{
    scoped_frames f = frames_folder_make();
    double x[COUNT(raised)];
    frames_obj(&f, "square.obj", 4, square, 2, two);
    frames_obj(&f, "b_0.obj", 4, square, 2, two);
    frames_obj(&f, "b_1.obj", 4, square, 1, two);
    frames_obj(&f, "c_0.obj", 4, square, 2, two);
    frames_obj(&f, "c_1.obj", 3, square, 1, two);
    frames_npy(&f, "a.npy", "(3, 4, 3)", COUNT(raised), raised);
    frames_npy(&f, "five.npy", "(2, 5, 3)", 30, raised);
    frames_npy(&f, "flat.npy", "(12, 3)", COUNT(raised), raised);
    frames_npy(&f, "short.npy", "(4, 4, 3)", COUNT(raised), raised);
    frames_npy(&f, "none.npy", "(0, 4, 3)", 0, raised);
    frames_npy(&f, "times.npy", "(3,)", 3, (const double[]){0, 0.5, 0.5});
    frames_npy(&f, "late.npy", "(2,)", 2, (const double[]){0, 0.5});
    memcpy(x, raised, sizeof x);
    x[12 + 7] = NAN;
    frames_npy(&f, "nan.npy", "(3, 4, 3)", COUNT(raised), x);
    memcpy(x, raised, sizeof x);
    memcpy(x + 24, x + 27, 3 * sizeof *x);
    frames_npy(&f, "thin.npy", "(3, 4, 3)", COUNT(raised), x);
    write_pc2(&f, "a.pc2", 5, 3, 1);
    write_pc2(&f, "b.pc2", 4, 4, 1);
    write_pc2(&f, "c.pc2", 4, 3, 0);
    FILE *file = frames_file(&f, "text.npy");
    fprintf(file, "no array");
    fclose(file);
    const struct {
        const char *file, *mesh, *times, *message;
    } cases[] = {
        {"a.npy", NULL, NULL, "/c/mesh: a.npy has positions only"},
        {"b_%d.obj", "square.obj", NULL, "/c/mesh: b_%d.obj has its triangles itself"},
        {"a.abc", NULL, NULL, "/c/file: a.abc: unknown ending; known are .npy, .pc2, .obj, /, .glb"},
        {"gone.npy", "square.obj", NULL, "gone.npy: cannot be read: No such file"},
        {"a.npy", "gone.obj", NULL, "gone.obj: cannot be read: No such file"},
        {"five.npy", "square.obj", NULL, "five.npy: 5 nodes; the mesh has 4"},
        {"flat.npy", "square.obj", NULL, "flat.npy: 2 dimensions, 12 x 3 x 1; frames x nodes x 3 are needed"},
        {"short.npy", "square.obj", NULL, "short.npy: 288 bytes of numbers; (4, 4, 3) has 384"},
        {"none.npy", "square.obj", NULL, "none.npy: it has no frames"},
        {"text.npy", "square.obj", NULL, "text.npy: it is not an NPY file"},
        {"nan.npy", "square.obj", NULL, "nan.npy: frame 1: node 2 is at (1, nan, 1) m"},
        {"thin.npy", "square.obj", NULL, "thin.npy: frame 2: triangle 0 (nodes 0 1 2) is degenerate"},
        {"a.npy", "square.obj", "times.npy", "/c/times: times.npy: frame 2 is at 0.5 s; times must"},
        {"a.npy", "square.obj", "late.npy", "late.npy: 2 times in 1 dimensions; 3 times are needed"},
        {"a.pc2", "square.obj", NULL, "a.pc2: 5 points; the mesh has 4 nodes"},
        {"b.pc2", "square.obj", NULL, "b.pc2: 144 bytes of positions; 4 samples of 4 points have 192"},
        {"c.pc2", "square.obj", NULL, "c.pc2: its first frame is 10, its step 0 frames"},
        {"b_%d.obj", NULL, NULL, "b_1.obj: frame 1: its faces differ from those of the first frame"},
        {"c_%d.obj", NULL, NULL, "c_1.obj: frame 1: 3 nodes; the first frame has 4"},
        {"d_%d.obj", NULL, NULL, "d_%d.obj: there are no such OBJ files"},
        {"%d_%d.obj", NULL, NULL, "a sequence of OBJ files is a folder"},
        {"%s.obj", NULL, NULL, "a sequence of OBJ files is a folder"},
        {"gone/", NULL, NULL, "gone/: cannot be read: No such file"},
    };
    for (size_t i = 0; i < COUNT(cases); i++)
        assert_fault(&f, &(drape_sequence_def){cases[i].file, cases[i].mesh, cases[i].times, 10, 0},
                     cases[i].message);
}

/* Whatever a byte of the header is, and wherever the file ends, reading ends with a status. */
TEST(hostile_headers_are_refused)
{
    char bytes[] =
        "\x93NUMPY\x01\x00\x40\x00{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2, 1), }  \n"
        "12345678";
    const size_t size = sizeof bytes - 1;
    scoped_context *ctx = NULL;
    drape_npy_array array;
    const drape_mesh_source source = {"/c/file", "a.npy"};
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    bytes[8] = (char)(size - 8 - 10);
    ck_assert_int_eq(drape_npy_array_parse(ctx, &source, bytes, size, &array), DRAPE_OK);
    for (size_t length = 0; length < size; length++) {
        scoped_memory char *copy = malloc(length + 1);
        memcpy(copy, bytes, length);
        ck_assert_int_eq(drape_npy_array_parse(ctx, &source, copy, length, &array), DRAPE_E_PARSE);
    }
    for (size_t i = 0; i < size - 8; i++)
        for (int b = 0; b < 256; b += 5) {
            const char kept = bytes[i];
            bytes[i] = (char)b;
            if (drape_npy_array_parse(ctx, &source, bytes, size, &array) == DRAPE_OK)
                ck_assert_int_eq(array.shape[0] * array.shape[1] * array.shape[2] * array.item, 8);
            bytes[i] = kept;
        }
}

/* Linear between frames, at rest outside of them; a host's path replaces them and is a cubic, which continues
 * the velocity before it where it has one of its own at its end. */
TEST(points_between_frames_and_on_paths)
{
    double time[] = {1, 2, 4}, x[12], v[12], to[12], w[12];
    drape_sequence frames = {
        .frame_count = 3, .node_count = 4, .x = (double *)(uintptr_t)raised, .time = time};
    scoped_context *ctx = NULL;
    drape_deformation d;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    drape_arena arena = drape_arena_of(ctx);
    ck_assert_int_eq(drape_deformation_create(&arena, &frames, &d), DRAPE_OK);
    const double at[] = {0, 1, 1.25, 2, 3, 4, 5}, height[] = {0, 0, 0.25, 1, 2, 3, 3},
                 speed[] = {0, 1, 1, 1, 1, 0, 0};
    for (size_t i = 0; i < COUNT(at); i++) {
        drape_deformation_points(&d, at[i], x);
        drape_deformation_velocities(&d, at[i], at[i], v);
        ck_assert_double_eq(x[2], height[i]);
        ck_assert_double_eq(x[0], 0);
        ck_assert_double_eq(v[11], speed[i]);
    }
    ck_assert_double_eq(drape_deformation_next_kink(&d, 0, 9), 1);
    ck_assert_double_eq(drape_deformation_next_kink(&d, 2, 9), 4);
    ck_assert_double_eq(drape_deformation_next_kink(&d, 4, 9), 9);
    ck_assert(drape_deformation_at_kink(&d, 2) && !drape_deformation_at_kink(&d, 3));

    /* x = 1 at t = 1.25 + 0.5, at rest there: the slope 1 at 0.25 goes on */
    drape_deformation_points(&d, 1.25, to);
    for (int i = 0; i < 4; i++)
        to[3 * i + 2] = 1;
    memset(w, 0, sizeof w);
    drape_deformation_send(&d, 1.25, 0.5, to, NULL);
    drape_deformation_points(&d, 1.5, x);
    ck_assert_double_eq_tol(x[2], 0.625, 1e-15);
    drape_deformation_send(&d, 1.5, 0.5, to, w);
    drape_deformation_velocities(&d, 1.5, 1.5, v);
    ck_assert_double_eq_tol(v[2], 1.5, 1e-14); /* 0.75 m in 0.5 s */
    ck_assert(!drape_deformation_at_kink(&d, 1.5) && !drape_deformation_at_kink(&d, 2));
    const double h = 1e-5;
    double before[12], after[12];
    drape_deformation_points(&d, 1.7 - h, before);
    drape_deformation_points(&d, 1.7 + h, after);
    drape_deformation_velocities(&d, 1.7, 1.7, v);
    ck_assert_double_eq_tol(v[2], (after[2] - before[2]) / (2 * h), 1e-8); /* h^2 x''' / 6 and rounding */
    drape_deformation_points(&d, 9, x);
    ck_assert_double_eq(x[2], 1);
    drape_arena_free(&arena);
}
