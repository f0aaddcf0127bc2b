/*
 * test_colliders.c: all colliders: the distance against one found by brute force, normal and curvature
 * against differences, the features of the shape against the distance, and meshes that are not solids.
 */
#include "colliders/colliders.h"

#include "base/clock.h"
#include "base/rotation.h"
#include "base/vec3.h"
#include "entries/models.h"
#include "mesh/mesh.h"
#include "support/folder.h"
#include "support/scene.h"

#include <unistd.h>

#define SCENE                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 2, 'rows': 2, 'width': 1, 'height': 1},"  \
    "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}}],"                               \
    "'contact': {'distance': 0.01}, 'colliders': [%s], 'duration': 1}"

static scene with_collider(const char *text)
{
    scene s = scene_model(SCENE, text);
    ck_assert_int_eq(s.model->collider_count, 1);
    return s;
}

/* ---- Random points: xorshift (Marsaglia 2003) with a fixed seed, so that every run has the same ---- */

static uint64_t seed = UINT64_C(88172645463325252);

static double between(double low, double high)
{
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    return low + (high - low) * (double)(seed >> 11) / 9007199254740992.0;
}

/* ---- Meshes that the tests write ---- */

static const double cube_point[8][3] = {{-0.5, -0.5, -0.5}, {0.5, -0.5, -0.5}, {-0.5, 0.5, -0.5},
                                        {0.5, 0.5, -0.5},   {-0.5, -0.5, 0.5}, {0.5, -0.5, 0.5},
                                        {-0.5, 0.5, 0.5},   {0.5, 0.5, 0.5}};
static const int cube_face[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                     {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};

static void print_face(FILE *file, const int *n)
{
    fprintf(file, "f %d %d %d\n", n[0] + 1, n[1] + 1, n[2] + 1);
}

static void write_cube(const char *path)
{
    FILE *file = fopen(path, "w");
    ck_assert_ptr_nonnull(file);
    for (int i = 0; i < 8; i++)
        fprintf(file, "v %.17g %.17g %.17g\n", cube_point[i][0], cube_point[i][1], cube_point[i][2]);
    for (int i = 0; i < 12; i++)
        print_face(file, cube_face[i]);
    fclose(file);
}

/* A globe: `rings` rings of 2 rings points between the poles; 4 rings (rings - 1) + 4 rings triangles.
 * dent: how much nearer to the center every other point lies, so that some points, edges and faces are
 * concave. */
static void write_globe(const char *path, int rings, double dent)
{
    const double pi = acos(-1.0);
    const int around = 2 * rings;
    FILE *file = fopen(path, "w");
    ck_assert_ptr_nonnull(file);
    fprintf(file, "v 0 1 0\nv 0 -1 0\n");
    for (int r = 0; r < rings; r++)
        for (int c = 0; c < around; c++) {
            double up = pi * (r + 1) / (rings + 1), turn = 2 * pi * c / around;
            double radius = (r + c) % 2 ? 1 - dent : 1;
            fprintf(file, "v %.17g %.17g %.17g\n", radius * sin(up) * cos(turn), radius * cos(up),
                    -radius * sin(up) * sin(turn));
        }
    for (int c = 0; c < around; c++) {
        const int next = (c + 1) % around, last = 2 + (rings - 1) * around;
        print_face(file, (int[]){0, 2 + c, 2 + next});
        print_face(file, (int[]){1, last + next, last + c});
        for (int r = 0; r + 1 < rings; r++) {
            const int a = 2 + r * around + c, b = 2 + r * around + next;
            print_face(file, (int[]){a, a + around, b + around});
            print_face(file, (int[]){a, b + around, b});
        }
    }
    fclose(file);
}

/* A wedge with its tip at 0. Its upper face is a fan of 30 triangles about the tip, its lower face a single
 * triangle. By a mean of normals that is not weighted by angles, the points below the tip would be inside. */
static void write_wedge(const char *path)
{
    enum { TOP = 1, SLICES = 30, LOW = TOP + SLICES + 1, HIGH = LOW + 1 };
    FILE *file = fopen(path, "w");
    ck_assert_ptr_nonnull(file);
    fprintf(file, "v 1 0 0\n");
    for (int i = 0; i <= SLICES; i++)
        fprintf(file, "v -1 0.1 %.17g\n", 2.0 * i / SLICES - 1);
    fprintf(file, "v -1 -0.1 -1\nv -1 -0.1 1\n");
    for (int i = TOP; i < TOP + SLICES; i++) {
        print_face(file, (int[]){0, i, i + 1});
        print_face(file, (int[]){LOW, i + 1, i});
    }
    print_face(file, (int[]){LOW, HIGH, TOP + SLICES});
    print_face(file, (int[]){0, HIGH, LOW});
    print_face(file, (int[]){0, LOW, TOP});
    print_face(file, (int[]){0, TOP + SLICES, HIGH});
    fclose(file);
}

/* A temporary folder for the files of a test, with the meshes that the variants below name. */
static void enter_folder(void)
{
    folder_enter();
    write_cube("cube.obj");
    write_globe("globe.obj", 7, 0.2);
    write_wedge("wedge.obj");
}

/* ---- The variants ---- */

/* Whether x is inside, by the definition of the body and not by its distance. Callers leave a margin for
 * round-off. */
typedef bool inside_function(const double *x);

static bool in_plane(const double *x)
{
    const double n[3] = {1, 2, -2}, from[3] = {x[0] - 0.1, x[1], x[2] - 0.2};
    return vec3_dot(n, from) < 0;
}

static double from_axis(const double *x, const double *a, const double *b, double *along)
{
    double u[3], from[3], across[3];
    vec3_sub(b, a, u);
    vec3_sub(x, a, from);
    vec3_cross(from, u, across);
    *along = vec3_dot(from, u) / vec3_dot(u, u);
    return vec3_norm(across) / vec3_norm(u);
}

static const double end_a[3] = {-0.3, 0.1, 0.2},
                    end_b[3] = {0.4, -0.2, 0.5}; /* |b - a| = sqrt 0.67 = 0.8185 */

static double from_point(const double *x, double a, double b, double c)
{
    const double from[3] = {x[0] - a, x[1] - b, x[2] - c};
    return vec3_norm(from);
}

static bool in_sphere(const double *x)
{
    return from_point(x, 0.1, -0.2, 0.3) < 0.7;
}

static bool in_capsule(const double *x)
{
    double along, away = from_axis(x, end_a, end_b, &along);
    return (along > 0 && along < 1 && away < 0.25) || from_point(x, end_a[0], end_a[1], end_a[2]) < 0.25 ||
           from_point(x, end_b[0], end_b[1], end_b[2]) < 0.25;
}

static bool in_cylinder(const double *x)
{
    double along;
    return from_axis(x, end_a, end_b, &along) < 0.3 && along > 0 && along < 1;
}

/* In the frame of the box: turned back by 30 degrees about z. */
static void to_box(const double *x, double *y)
{
    const double c = cos(acos(-1.0) / 6), s = 0.5, from[3] = {x[0] - 0.1, x[1], x[2] + 0.1};
    y[0] = c * from[0] + s * from[1];
    y[1] = -s * from[0] + c * from[1];
    y[2] = from[2];
}

static bool in_box(const double *x)
{
    double y[3];
    to_box(x, y);
    return fabs(y[0]) < 0.5 && fabs(y[1]) < 0.25 && fabs(y[2]) < 0.4;
}

/* Inside the box and not beyond the rounding: at most 0.1 from the box that is smaller by 0.1 on all
 * sides. */
static bool in_round_box(const double *x)
{
    const double half[3] = {0.4, 0.15, 0.3};
    double y[3], beyond[3];
    to_box(x, y);
    for (int k = 0; k < 3; k++)
        beyond[k] = fmax(fabs(y[k]) - half[k], 0);
    return vec3_norm(beyond) < 0.1;
}

static bool in_round_cylinder(const double *x)
{
    double along, away = from_axis(x, end_a, end_b, &along), length = sqrt(0.67);
    double over = fmax(fabs(along - 0.5) * length - (length / 2 - 0.1), 0), out = fmax(away - 0.2, 0);
    return over * over + out * out < 0.01;
}

static bool in_cube(const double *x)
{
    return fmax(fabs(x[0]), fmax(fabs(x[1]), fabs(x[2]))) < 0.5;
}

static bool in_post(const double *x)
{
    return fmax(fabs(x[0] - 0.1), fabs(x[2] + 0.1)) < 0.3 && fabs(x[1]) < 0.5;
}

static const struct variant {
    const char *collider, *text;
    inside_function *inside; /* NULL: decided by the winding number of the mesh */
} variants[] = {
    {"plane", "{'type': 'plane', 'point': [0.1, 0, 0.2], 'normal': [1, 2, -2]}", in_plane},
    {"sphere", "{'type': 'sphere', 'center': [0.1, -0.2, 0.3], 'radius': 0.7}", in_sphere},
    {"capsule", "{'type': 'capsule', 'a': [-0.3, 0.1, 0.2], 'b': [0.4, -0.2, 0.5], 'radius': 0.25}",
     in_capsule},
    {"box", "{'type': 'box', 'center': [0.1, 0, -0.1], 'size': [1, 0.5, 0.8], 'rotate': [0, 0, 2, 30]}",
     in_box},
    {"box",
     "{'type': 'box', 'center': [0.1, 0, -0.1], 'size': [1, 0.5, 0.8], 'rotate': [0, 0, 30], 'rounding': "
     "0.1}",
     in_round_box},
    {"box", "{'type': 'box', 'center': [0.1, 0, -0.1], 'size': [0.6, 1, 0.6]}", in_post},
    {"cylinder", "{'type': 'cylinder', 'a': [-0.3, 0.1, 0.2], 'b': [0.4, -0.2, 0.5], 'radius': 0.3}",
     in_cylinder},
    {"cylinder",
     "{'type': 'cylinder', 'a': [-0.3, 0.1, 0.2], 'b': [0.4, -0.2, 0.5], 'radius': 0.3, 'rounding': 0.1}",
     in_round_cylinder},
    {"mesh", "{'type': 'mesh', 'file': 'cube.obj'}", in_cube},
    {"mesh", "{'type': 'mesh', 'file': 'globe.obj', 'scale': [0.7, 0.5, 0.6], 'rotate': [20, 0, 30]}", NULL},
    {"mesh", "{'type': 'mesh', 'file': 'wedge.obj', 'scale': 0.7}", NULL},
    {"animated_mesh", "{'type': 'animated_mesh', 'file': 'cube.obj'}", in_cube},
    {"animated_mesh",
     "{'type': 'animated_mesh', 'file': 'globe.obj', 'scale': [0.7, 0.5, 0.6], 'rotate': [20, 0, 30]}", NULL},
    {"animated_mesh", "{'type': 'animated_mesh', 'file': 'wedge.obj', 'scale': 0.7}", NULL},
};
#define VARIANTS (sizeof variants / sizeof *variants)

typedef void visit(const drape_collider *collider, const struct variant *v);

static void each_variant(visit *one)
{
    enter_folder();
    for (size_t i = 0; i < VARIANTS; i++) {
        scoped_scene s = with_collider(variants[i].text);
        ck_assert_str_eq(s.model->colliders[0].ops->entry.name, variants[i].collider);
        one(&s.model->colliders[0], &variants[i]);
    }
    folder_leave();
}

static double distance_of(const drape_collider *c, const double *x, double *normal, double *curvature)
{
    return c->ops->distance(c->values, &c->shape, x, normal, curvature);
}

TEST(entries_are_well_formed)
{
    for (int i = 0; drape_colliders[i]; i++) {
        const drape_collider_ops *ops = drape_colliders[i];
        bool tried = false;
        ck_assert_uint_eq(ops->struct_size, sizeof *ops);
        ck_assert_ptr_eq(drape_collider_registry.entries[i], &ops->entry);
        ck_assert(ops->shape && ops->distance);
        for (size_t v = 0; v < VARIANTS; v++)
            tried = tried || strcmp(variants[v].collider, ops->entry.name) == 0;
        ck_assert_msg(tried, "no variant of %s is tested", ops->entry.name);
    }
}

/* ---- The distance against brute force ---- */

/* Solid angle of a triangle seen from x, over 4 pi (Van Oosterom and Strackee 1983, equation 8); their sum is
 * 1 inside of a closed surface, 0 outside. */
static double winding(const drape_collider_shape *s, const double *x)
{
    double sum = 0, r[3][3], cross[3];
    for (int32_t t = 0; t < s->triangle_count; t++) {
        for (int k = 0; k < 3; k++)
            vec3_sub(s->point + 3 * s->triangle[3 * t + k], x, r[k]);
        const double a = vec3_norm(r[0]), b = vec3_norm(r[1]), c = vec3_norm(r[2]);
        vec3_cross(r[1], r[2], cross);
        sum += 2 * atan2(vec3_dot(r[0], cross), a * b * c + vec3_dot(r[0], r[1]) * c +
                                                    vec3_dot(r[1], r[2]) * a + vec3_dot(r[2], r[0]) * b);
    }
    return sum / (4 * acos(-1.0));
}

static bool is_inside(const drape_collider *c, const struct variant *v, const double *x)
{
    return v->inside ? v->inside(x) : winding(&c->shape, x) > 0.5;
}

/* The sign is that of the body's definition. From x along -d n the surface is met exactly at the distance
 * |d|, and no point nearer than |d| is on the other side: so |d| is the distance from the surface. */
static void check_distance(const drape_collider *c, const struct variant *v)
{
    for (int i = 0; i < 3000; i++) {
        double x[3], n[3], foot[3], near[3], step[3];
        for (int k = 0; k < 3; k++)
            x[k] = between(-1.2, 1.2);
        const double d = distance_of(c, x, n, NULL);
        ck_assert_msg(fabs(d) < 1e-12 || (d < 0) == is_inside(c, v, x), "%s: sign at %g %g %g", v->text, x[0],
                      x[1], x[2]);
        ck_assert_double_eq_tol(vec3_norm(n), 1, 1e-14);
        memcpy(foot, x, sizeof foot);
        vec3_add_scaled(-d, n, foot);
        /* |x| and d are below 3: both, and the distance at the foot, are rounded by a few eps of that */
        ck_assert_msg(fabs(distance_of(c, foot, NULL, NULL)) < 1e-14, "%s: foot of %g %g %g is off by %g",
                      v->text, x[0], x[1], x[2], distance_of(c, foot, NULL, NULL));
        for (int trial = 0; trial < 20; trial++) {
            for (int k = 0; k < 3; k++)
                step[k] = between(-1, 1);
            memcpy(near, x, sizeof near);
            vec3_add_scaled(0.999 * fabs(d) / vec3_norm(step), step, near);
            ck_assert_msg(is_inside(c, v, near) == (d < 0), "%s: the surface is nearer than %g to %g %g %g",
                          v->text, d, x[0], x[1], x[2]);
        }
    }
}

TEST(distances_are_exact)
{
    each_variant(check_distance);
}

/* ---- Derivatives ---- */

/* Central differences of the distance and of the normal, with step h. Within a smooth piece their errors
 * are h^2/6 times the derivative two orders above. At a distance r from a point or an edge, that is at most
 * 9/r^3 for the normal and 3/r^2 for the distance; rounding adds about 1e-15/(r h). With h = 1e-5 and r >
 * 0.2: 1e-10/6 * 9/0.008 + 5e-10 = 2e-8. Places where a difference straddles two pieces are left out: there
 * the Hessians at its ends differ. */
#define STEP      1e-5
#define TOLERANCE 1e-7

typedef struct probe {
    double d, n[3], h[9];
} probe;

static probe probe_at(const drape_collider *c, const double *x, int axis, double shift)
{
    probe p;
    double y[3] = {x[0], x[1], x[2]};
    y[axis] += shift;
    p.d = distance_of(c, y, p.n, p.h);
    return p;
}

static double largest(const double *a, int count)
{
    double max = 0;
    for (int i = 0; i < count; i++)
        max = fmax(max, fabs(a[i]));
    return max;
}

/* Hessians within one piece differ by h times the third derivative: 1e-5 * 3/0.04 = 0.00075. */
static bool same_piece(const probe *a, const probe *b)
{
    for (int i = 0; i < 9; i++)
        if (fabs(a->h[i] - b->h[i]) > 0.002)
            return false;
    double across[3];
    vec3_sub(a->n, b->n, across);
    return vec3_norm(across) < 1e-3;
}

static void check_derivatives(const drape_collider *c, const struct variant *v)
{
    long tried = 0, compared = 0, curved = 0;
    while (compared < 20000 && tried++ < 1000000) {
        double x[3], h[9];
        for (int k = 0; k < 3; k++)
            x[k] = between(-1.2, 1.2);
        const probe here = probe_at(c, x, 0, 0);
        if (largest(here.h, 9) > 5) /* r < 0.2 */
            continue;
        for (int axis = 0; axis < 3; axis++) {
            const probe low = probe_at(c, x, axis, -STEP), high = probe_at(c, x, axis, STEP);
            if (!same_piece(&low, &here) || !same_piece(&here, &high))
                continue;
            ck_assert_msg(fabs((high.d - low.d) / (2 * STEP) - here.n[axis]) < TOLERANCE, "%s: normal",
                          v->text);
            for (int k = 0; k < 3; k++) {
                h[3 * k + axis] = (high.n[k] - low.n[k]) / (2 * STEP);
                ck_assert_msg(fabs(h[3 * k + axis] - here.h[3 * k + axis]) < TOLERANCE,
                              "%s: curvature %d %d at %g %g %g: %g, %g", v->text, k, axis, x[0], x[1], x[2],
                              h[3 * k + axis], here.h[3 * k + axis]);
            }
            compared++;
            curved += largest(here.h, 9) > 0.1;
        }
    }
    printf("# %s: %ld differences of %ld places, %ld of them curved\n", v->collider, compared, tried, curved);
    ck_assert_int_ge(compared, 20000);
    ck_assert(curved > 1000 || strcmp(v->collider, "plane") == 0);
}

TEST(derivatives_are_exact)
{
    each_variant(check_derivatives);
}

/* Outside, the normal of a smooth collider is continuous: between places 1e-7 apart and at least 0.05 off the
 * surface it turns by no more than 1e-7/0.05, past edges too. */
static void check_smooth(const drape_collider *c, const struct variant *v)
{
    if (!c->ops->smooth)
        return;
    for (int i = 0; i < 50000; i++) {
        double x[3], n[2][3], turn[3];
        for (int k = 0; k < 3; k++)
            x[k] = between(-1.2, 1.2);
        if (distance_of(c, x, n[0], NULL) < 0.05)
            continue;
        x[i % 3] += 1e-7;
        distance_of(c, x, n[1], NULL);
        vec3_sub(n[0], n[1], turn);
        ck_assert_msg(vec3_norm(turn) < 2.1e-6, "%s: the normal jumps at %g %g %g", v->text, x[0], x[1],
                      x[2]);
    }
}

TEST(normals_are_continuous_outside)
{
    each_variant(check_smooth);
}

/* Where the gradient is not unique: centers, axes, and the points and edges of the shape. */
static void check_everywhere(const drape_collider *c, const struct variant *v)
{
    double sum[3] = {0};
    const drape_collider_shape *s = &c->shape;
    for (int32_t i = 0; i <= s->point_count + s->segment_count; i++) {
        double x[3] = {0}, n[3], h[9];
        if (i < s->point_count)
            memcpy(x, s->point + 3 * i, sizeof x);
        else if (i < s->point_count + s->segment_count)
            for (int end = 0; end < 2; end++)
                vec3_add_scaled(0.5, s->point + 3 * s->segment[2 * (i - s->point_count) + end], x);
        else
            vec3_add_scaled(s->point_count ? 1.0 / s->point_count : 0, sum, x);
        if (i < s->point_count)
            vec3_add_scaled(1, x, sum);
        const double d = distance_of(c, x, n, h);
        ck_assert_msg(isfinite(d) && isfinite(largest(h, 9)), "%s: at feature %d", v->text, (int)i);
        ck_assert_double_eq_tol(vec3_norm(n), 1, 1e-12);
    }
}

TEST(the_distance_is_defined_everywhere)
{
    each_variant(check_everywhere);
}

/* ---- Shapes ---- */

/* Every point, segment and triangle, grown by the radius, touches the surface from inside: no part of it is
 * outside, and none is deeper than the tolerance of a polygon, a tenth of the distance of 0.01. Flat faces
 * have only their borders as features: the middle of a segment is as deep as the edges of the collider. */
static void check_shape(const drape_collider *c, const struct variant *v)
{
    const drape_collider_shape *s = &c->shape;
    const double deepest = 0.001 + 1e-14;
    ck_assert_ptr_null(s->builder);
    for (int32_t i = 0; i < s->point_count; i++)
        ck_assert_double_eq_tol(distance_of(c, s->point + 3 * i, NULL, NULL) + s->radius, 0, 1e-14);
    for (int32_t i = 0; i < s->segment_count; i++) {
        const int32_t *ends = s->segment + 2 * i;
        ck_assert(ends[0] != ends[1] && ends[0] >= 0 && ends[0] < s->point_count && ends[1] >= 0 &&
                  ends[1] < s->point_count);
        for (int j = 0; j <= 8; j++) {
            double x[3] = {0};
            vec3_add_scaled(1 - j / 8.0, s->point + 3 * ends[0], x);
            vec3_add_scaled(j / 8.0, s->point + 3 * ends[1], x);
            const double d = distance_of(c, x, NULL, NULL) + s->radius;
            ck_assert_msg(d < 1e-14 && d > -deepest, "%s: segment %d is at %g", v->text, (int)i, d);
        }
    }
    for (int32_t t = 0; t < s->triangle_count; t++) {
        double x[3] = {0};
        for (int k = 0; k < 3; k++)
            vec3_add_scaled(1.0 / 3, s->point + 3 * s->triangle[3 * t + k], x);
        ck_assert_double_eq_tol(distance_of(c, x, NULL, NULL), 0, 1e-14);
    }
}

TEST(shapes_lie_on_the_surface)
{
    each_variant(check_shape);
}

TEST(shapes_have_the_right_features)
{
    static const struct {
        const char *text;
        int32_t points, segments, triangles;
        double radius;
    } cases[] = {
        {"{'type': 'plane', 'point': [0, 0, 0], 'normal': [0, 1, 0]}", 0, 0, 0, 0},
        {"{'type': 'sphere', 'center': [0, 0, 0], 'radius': 0.5}", 1, 0, 0, 0.5},
        {"{'type': 'capsule', 'a': [0, 0, 0], 'b': [0, 1, 0], 'radius': 0.5}", 2, 1, 0, 0.5},
        {"{'type': 'box', 'center': [0, 0, 0], 'size': 1}", 8, 12, 0, 0},
        {"{'type': 'box', 'center': [0, 0, 0], 'size': 1, 'rounding': 0.1}", 8, 12, 0, 0.1},
        /* pi / acos(1 - 0.001/0.5) = 49.66 */
        {"{'type': 'cylinder', 'a': [0, 0, 0], 'b': [0, 1, 0], 'radius': 0.5}", 100, 150, 0, 0},
        /* pi / acos(1 - 0.001/0.4) = 44.42 */
        {"{'type': 'cylinder', 'a': [0, 0, 0], 'b': [0, 1, 0], 'radius': 0.5, 'rounding': 0.1}", 90, 135, 0,
         0.1},
        {"{'type': 'cylinder', 'a': [0, 0, 0], 'b': [0, 1, 0], 'radius': 0.0005}", 24, 36, 0, 0},
        {"{'type': 'cylinder', 'a': [0, 0, 0], 'b': [0, 1, 0], 'radius': 1e6}", 1024, 1536, 0, 0},
        {"{'type': 'mesh', 'file': 'cube.obj'}", 8, 18, 12, 0},
    };
    enter_folder();
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scoped_scene s = with_collider(cases[i].text);
        const drape_collider_shape *shape = &s.model->colliders[0].shape;
        ck_assert_msg(shape->point_count == cases[i].points && shape->segment_count == cases[i].segments &&
                          shape->triangle_count == cases[i].triangles && shape->radius == cases[i].radius,
                      "%s: %d points, %d segments, %d triangles, radius %g", cases[i].text,
                      (int)shape->point_count, (int)shape->segment_count, (int)shape->triangle_count,
                      shape->radius);
    }
    folder_leave();
}

/* ---- What is refused ---- */

static void refused(const char *text, const char *says)
{
    scoped_scene s = scene_empty();
    scoped_parsed *parsed = NULL;
    char whole[4096];
    snprintf(whole, sizeof whole, SCENE, text);
    quote(whole);
    ck_assert_int_eq(drape_scene_parse(s.ctx, whole, "s.json", &parsed), DRAPE_OK);
    ck_assert_msg(drape_scene_compile(parsed, &s.model) < 0, "accepted: %s", text);
    ck_assert_msg(strstr(drape_context_message(s.ctx), says), "%s\nsays \"%s\"\nnot \"%s\"", text,
                  drape_context_message(s.ctx), says);
}

/* Those of which the file is wrong are in tests/bad. */
TEST(a_mesh_that_is_too_far_is_refused)
{
    enter_folder();
    refused(
        "{'type': 'mesh', 'file': 'cube.obj', 'translate': [1e9, 0, 0]}",
        "/colliders/0: node 1 is at (1e+09, -0.5, -0.5) m; coordinates must be finite and within 1e+09 m");
    folder_leave();
}

/* ---- Where a collider is ---- */

TEST(poses_follow_the_track)
{
    scoped_scene s = with_collider("{'type': 'sphere', 'center': [1, 0, 0], 'radius': 0.5,"
                                   " 'track': [[1, [0, 0, 0]], [3, [0, 4, 0]], [4, [0, 4, 1]]]}");
    const drape_collider *c = &s.model->colliders[0];
    static const struct {
        double t, y, z, vy, vz;
    } cases[] = {{0, 0, 0, 0, 0}, {1.5, 1, 0, 2, 0}, {3.25, 4, 0.25, 0, 1}, {9, 4, 1, 0, 0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const drape_collider_pose pose = drape_collider_pose_at(c, cases[i].t);
        const drape_collider_motion motion = drape_model_collider(s.model, 0, cases[i].t);
        const double want[6] = {0, cases[i].y, cases[i].z, 0, cases[i].vy, cases[i].vz};
        for (int k = 0; k < 3; k++) {
            ck_assert_double_eq(pose.displacement[k], want[k]);
            ck_assert_double_eq(pose.velocity[k], want[3 + k]);
            ck_assert_double_eq(motion.displacement[k], want[k]);
            ck_assert_double_eq(motion.velocity[k], want[3 + k]);
        }
        double n[3];
        const double x[3] = {1, cases[i].y + 2, cases[i].z};
        ck_assert_double_eq(drape_collider_distance(c, &pose, x, n, NULL), 1.5);
        ck_assert_double_eq(n[1], 1);
    }
}

/* ---- Turning ---- */

#define RADIANS 0.017453292519943295

/* Where the pose at time t takes a point of the collider's own coordinates. */
static void point_at(const drape_collider *c, double t, const double *own, double *x)
{
    const drape_collider_pose pose = drape_collider_pose_at(c, t);
    drape_pose_point(&pose, own, x);
}

/* Keys about one axis, a piece of more than a turn; then quaternions. The rates are those of the keys, and
 * the velocity of a point is the rate of its place: by differences over 2e-6 s, to (3 rad/s)^3 1e-12/6 m
 * of the cubic, and rounding of 1e-16/1e-6 m/s. */
TEST(poses_follow_the_turns)
{
    scoped_scene s = with_collider(
        "{'type': 'box', 'center': [1, 0, 0], 'size': [0.2, 0.4, 0.6], 'pivot': [1, 0, 0.5],"
        " 'track': [[0, [0, 0, 0]], [4, [4, 0, 0]]], 'turns': [{'time': 1, 'rotate': [0, 0, 2, 0]},"
        " {'time': 3, 'rotate': [0, 0, 3, 450]}, {'time': 4, 'rotate': [0, 0, -1, -90]},"
        " {'time': 5, 'quaternion': [1, 0, 0, 1]}, {'time': 6, 'quaternion': [1, 1, 1, 1]},"
        " {'time': 7, 'rotate': [0, 1, 0, 20]}]}");
    const drape_collider *c = &s.model->colliders[0];
    static const struct {
        double t, degrees, rate; /* about z */
    } cases[] = {{0, 0, 0},         {1, 0, 225},      {1.5, 112.5, 225},
                 {2.5, 337.5, 225}, {3.5, 270, -360}, {4.5, 90, 0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        double x[3], q[4], w[3], pivot[3], angle = cases[i].degrees * RADIANS;
        const double own[3] = {1.5, 0, 0.5}, along = fmin(cases[i].t, 4);
        point_at(c, cases[i].t, own, x);
        ck_assert_double_eq_tol(x[0], 1 + along + 0.5 * cos(angle), 1e-14);
        ck_assert_double_eq_tol(x[1], 0.5 * sin(angle), 1e-14);
        ck_assert_double_eq_tol(x[2], 0.5, 1e-14);
        ck_assert(drape_model_collider_rotation(s.model, 0, cases[i].t, q, w, pivot));
        ck_assert_double_eq_tol(fabs(q[3]), fabs(sin(angle / 2)), 1e-14);
        ck_assert_double_eq_tol(w[2], cases[i].rate * RADIANS, 1e-13);
        ck_assert(w[0] == 0 && w[1] == 0 && pivot[0] == 1 + along && pivot[2] == 0.5);
    }
    for (double t = 0.1; t < 7; t += 0.17) {
        const drape_collider_pose pose = drape_collider_pose_at(c, t);
        const double own[3] = {0.3, -0.7, 0.4}, h = 1e-6;
        double before[3], now[3], after[3], v[3];
        point_at(c, t - h, own, before);
        point_at(c, t, own, now);
        point_at(c, t + h, own, after);
        drape_pose_velocity(&pose, now, v);
        for (int k = 0; k < 3; k++)
            ck_assert_double_eq_tol(v[k], (after[k] - before[k]) / (2 * h), 1e-8);
    }
}

/* In a turned pose the distance is that of the point in the collider's own coordinates, and its
 * derivatives in space are exact: that of the distance along a direction is normal . u, that of the normal
 * curvature u. Mean velocities take points from one pose to the other. */
static void check_turned(const drape_collider *c, const struct variant *v)
{
    drape_collider_pose pose = {.t = 0}, next = {.t = 1}, none = {.t = 0};
    double turn[2][9];
    const double h = 0.01, spins[2][3] = {{0.9, -1.4, 0.3}, {0.95, -1.3, 0.33}}, zero[3] = {0},
                 by[2][3] = {{0.2, 0.1, -0.3}, {0.21, 0.1, -0.31}}, pivot[3] = {0.1, 0.2, 0.3};
    for (int i = 0; i < 2; i++) {
        drape_rotation_exp(spins[i], turn[i]);
        drape_pose_about(i ? &next : &pose, pivot, turn[i], by[i], zero, zero);
    }
    drape_collider_pose moving = next;
    drape_pose_set_mean_velocities(&moving, &pose, &next, h);
    for (int i = 0; i < 50; i++) {
        const double own[3] = {between(-2, 2), between(-2, 2), between(-2, 2)},
                     u[3] = {between(-1, 1), between(-1, 1), between(-1, 1)};
        double x[3], y[3], n[3], m[3], k[9], at[3], velocity[3], l[3];
        drape_pose_point(&pose, own, x);
        const double d = drape_collider_distance(c, &pose, x, n, k);
        ck_assert_double_eq_tol(d, drape_collider_distance(c, &none, own, m, NULL), 1e-13);
        ck_assert_double_eq_tol(vec3_norm(n), 1, 1e-12);
        drape_pose_direction(&pose, m);
        for (int a = 0; a < 3; a++)
            ck_assert_double_eq_tol(n[a], m[a], 1e-6); /* rounding may choose another corner */
        memcpy(at, x, sizeof at);
        vec3_add_scaled(1e-6, u, at);
        const double changed = drape_collider_distance(c, &pose, at, l, NULL);
        bool smooth = true; /* not across an edge */
        for (int a = 0; a < 3; a++)
            smooth = smooth && fabs(l[a] - n[a] - 1e-6 * vec3_dot(k + 3 * a, u)) < 1e-9;
        ck_assert_msg(!smooth || fabs(changed - d - 1e-6 * vec3_dot(n, u)) < 1e-10, "%s", v->text);
        drape_pose_point(&next, own, y);
        drape_pose_velocity(&moving, y, velocity);
        for (int a = 0; a < 3; a++)
            ck_assert_double_eq_tol(x[a] + h * velocity[a], y[a], 1e-14);
    }
}

TEST(a_turned_pose_turns_the_distance)
{
    each_variant(check_turned);
}

/* From one pose to another: the ends are those of the poses, a point that is carried along rests, and no
 * point is faster than the bound: 100 places on each of 40 paths. */
TEST(swings_lead_from_pose_to_pose)
{
    for (int i = 0; i < 40; i++) {
        drape_collider_pose from = {.t = 0}, to = {.t = 1};
        const double pivot[3] = {between(-1, 1), between(-1, 1), between(-1, 1)}, zero[3] = {0};
        drape_swing swing;
        double own[3], before[3], move[3], x[3], y[3], turn[9], rate[3];
        for (int end = 0; end < 2; end++) {
            const double v[3] = {between(-1, 1), between(-1, 1), between(-1, 1)},
                         d[3] = {between(-1, 1), between(-1, 1), between(-1, 1)};
            drape_rotation_exp(v, turn);
            drape_rotation_log(turn, rate);
            for (int k = 0; k < 3; k++)
                ck_assert_double_eq_tol(rate[k], v[k], 1e-14);
            drape_pose_about(end ? &to : &from, pivot, turn, d, zero, zero);
        }
        drape_swing_between(&from, &to, pivot, &swing);
        for (int k = 0; k < 3; k++) {
            x[k] = between(-1, 1);
            move[k] = between(-1, 1);
            y[k] = x[k] + move[k];
        }
        drape_pose_own(&from, x, own);
        drape_swing_own(&swing, x, move, 0, before);
        for (int k = 0; k < 3; k++)
            ck_assert_double_eq_tol(before[k], own[k], 1e-14);
        const double speed = drape_swing_speed(&swing, x, move);
        for (int n = 1; n <= 100; n++) {
            double now[3], path[3];
            drape_swing_own(&swing, x, move, n / 100.0, now);
            vec3_sub(now, before, path);
            ck_assert_double_le(vec3_norm(path), speed / 100 * (1 + 1e-12));
            memcpy(before, now, sizeof now);
        }
        drape_pose_own(&to, y, own);
        for (int k = 0; k < 3; k++)
            ck_assert_double_eq_tol(before[k], own[k], 1e-14);
    }
}
