/* frames.h: for tests with colliders that deform: files of triangles and of frames, in a folder of their
 * own. */
#ifndef DRAPE_TESTS_FRAMES_H
#define DRAPE_TESTS_FRAMES_H

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "support/suite.h"

typedef struct frames_folder {
    char path[64];
} frames_folder;

static inline frames_folder frames_folder_make(void)
{
    frames_folder f = {"/tmp/drape_frames_XXXXXX"};
    ck_assert_ptr_nonnull(mkdtemp(f.path));
    return f;
}

static inline void frames_folder_remove(const frames_folder *f)
{
    char command[100];
    snprintf(command, sizeof command, "rm -r %s", f->path);
    ck_assert_int_eq(system(command), 0);
}

#define scoped_frames SCOPED(frames_folder_remove) frames_folder

/* The path of a file in the folder, until the next call. */
static inline const char *frames_path(const frames_folder *f, const char *name)
{
    static char path[200];
    snprintf(path, sizeof path, "%s/%s", f->path, name);
    return path;
}

static inline FILE *frames_file(const frames_folder *f, const char *name)
{
    FILE *file = fopen(frames_path(f, name), "wb");
    ck_assert_ptr_nonnull(file);
    return file;
}

static inline void frames_obj(const frames_folder *f, const char *name, int points, const double *x,
                              int triangles, const int *triangle)
{
    FILE *file = frames_file(f, name);
    for (int i = 0; i < points; i++)
        fprintf(file, "v %.17g %.17g %.17g\n", x[3 * i], x[3 * i + 1], x[3 * i + 2]);
    for (int t = 0; t < triangles; t++)
        fprintf(file, "f %d %d %d\n", triangle[3 * t] + 1, triangle[3 * t + 1] + 1, triangle[3 * t + 2] + 1);
    ck_assert_int_eq(fclose(file), 0);
}

/* NPY, float64, with the given shape: "(2, 4, 3)"; of little-endian machines. */
static inline void frames_npy(const frames_folder *f, const char *name, const char *shape, size_t count,
                              const double *numbers)
{
    char header[128];
    FILE *file = frames_file(f, name);
    const int length =
        snprintf(header, sizeof header, "{'descr': '<f8', 'fortran_order': False, 'shape': %s, }\n", shape);
    const unsigned char start[10] = {0x93, 'N', 'U', 'M', 'P', 'Y', 1, 0, (unsigned char)length, 0};
    ck_assert_uint_eq(fwrite(start, 1, sizeof start, file), sizeof start);
    ck_assert_uint_eq(fwrite(header, 1, (size_t)length, file), (size_t)length);
    ck_assert_uint_eq(fwrite(numbers, sizeof *numbers, count, file), count);
    ck_assert_int_eq(fclose(file), 0);
}

/* A ball of radius 1 about the origin: two poles and `rings` rings of `around` points. */
static inline void frames_ball(int rings, int around, double *x, int *triangle)
{
    const double pi = 3.14159265358979323846;
    const int last = 1 + rings * around;
    int t = 0, i = 3;
    x[0] = x[2] = x[3 * last] = x[3 * last + 2] = 0;
    x[1] = 1;
    x[3 * last + 1] = -1;
    for (int r = 0; r < rings; r++)
        for (int k = 0; k < around; k++) {
            const double a = pi * (r + 1) / (rings + 1), b = 2 * pi * k / around;
            x[i++] = sin(a) * cos(b);
            x[i++] = cos(a);
            x[i++] = sin(a) * sin(b);
        }
    for (int k = 0; k < around; k++) {
        const int next = (k + 1) % around, low = last - around;
        const int ends[6] = {0, 1 + next, 1 + k, last, low + k, low + next};
        memcpy(triangle + t, ends, sizeof ends);
        t += 6;
        for (int r = 0; r + 1 < rings; r++) {
            const int a = 1 + r * around + k, b = 1 + r * around + next;
            const int two[6] = {a, b, a + around, b, b + around, a + around};
            memcpy(triangle + t, two, sizeof two);
            t += 6;
        }
    }
}
#define FRAMES_BALL_POINTS(rings, around)    (2 + (rings) * (around))
#define FRAMES_BALL_TRIANGLES(rings, around) (2 * (rings) * (around))

#endif
