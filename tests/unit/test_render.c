/* test_render.c: all that is computed before drawing: surfaces, colours, letters, the camera, frames. */
#include "colliders/body.h"
#include "render/camera.h"
#include "render/font.h"
#include "render/images.h"
#include "render/shading.h"
#include "render/skin.h"
#include "support/scene.h"
#include "support/suite.h"

#include <math.h>
#include <string.h>

#define CLOTH                                                                                                \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 9, 'rows': 9, 'width': 1, 'height': "     \
    "1%s},"                                                                                                  \
    " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge']}],"   \
    " 'duration': 1%s}"

/* ---- Colliders ---- */

static const char colliders[] =
    ", 'colliders': [{'type': 'sphere', 'center': [0.1, 2, 0], 'radius': 0.3},"
    " {'type': 'capsule', 'a': [0, 3, 0], 'b': [0.4, 3.2, 0.1], 'radius': 0.1},"
    " {'type': 'box', 'center': [0, 5, 0], 'size': [0.5, 0.3, 0.7], 'rotate': [1, 2, 3, 30]},"
    " {'type': 'cylinder', 'a': [0, 7, 0], 'b': [0.3, 7.5, 0], 'radius': 0.2},"
    " {'type': 'plane', 'point': [0, -1, 0], 'normal': [0.1, 1, 0]}]";

/* Every point lies on the surface: Newton steps on the exact distance move it there, and then it is rounded
 * to a float of at most 8 m, 5e-7. Normals have length 1 and point outwards. */
TEST(bodies_lie_on_their_surface)
{
    scoped_scene h = scene_model(CLOTH, "", colliders);
    const drape_model *model = h.model;
    drape_arena arena = drape_arena_of(h.ctx);
    for (int32_t c = 0; c < model->collider_count; c++) {
        const drape_collider *collider = &model->colliders[c];
        drape_body body;
        double off = 0;
        ck_assert_int_eq(drape_body_create(&arena, collider, (const double[3]){0}, 4, &body), DRAPE_OK);
        ck_assert_int_eq(body.endless, strcmp(collider->ops->entry.name, "plane") == 0);
        ck_assert(body.vertex_count > 100 && body.vertex_count % 3 == 0);
        for (size_t i = 0; i < body.vertex_count; i++) {
            const float *v = body.vertex + 6 * i;
            const double x[3] = {v[0], v[1], v[2]};
            double d = collider->ops->distance(collider->values, &collider->shape, x, NULL, NULL);
            off = fmax(off, fabs(d));
            ck_assert(fabsf(drape_dot(v + 3, v + 3) - 1) < 1e-5f);
        }
        assert_below(off, 5e-7);
    }
    drape_arena_free(&arena);
}

/* A point of the surface is at the corner of a box of half lengths .25, .15, .35 without rotation, up to the
 * attraction by the mean, 1 in 100 of a cell of 0.7 m / 56. */
TEST(corners_of_a_box_are_sharp)
{
    scoped_scene h = scene_model(
        CLOTH, "", ", 'colliders': [{'type': 'box', 'center': [0, 0, 0], 'size': [0.5, 0.3, 0.7]}]");
    const drape_model *model = h.model;
    drape_arena arena = drape_arena_of(h.ctx);
    drape_body body;
    float nearest = 1;
    ck_assert_int_eq(drape_body_create(&arena, &model->colliders[0], (const double[3]){0}, 2, &body),
                     DRAPE_OK);
    for (size_t i = 0; i < body.vertex_count; i++) {
        const float *v = body.vertex + 6 * i;
        nearest = fminf(nearest, hypotf(hypotf(v[0] - 0.25f, v[1] - 0.15f), v[2] - 0.35f));
    }
    assert_below((double)nearest, 0.01 * 0.7 / 56);
    drape_arena_free(&arena);
}

/* On a sphere every normal is that of the sphere: it is taken a twentieth of a cell above, which changes
 * its direction by less than that over the radius times the angle of a face, 1e-3. On a box every normal is
 * that of one of its sides. */
TEST(bodies_are_round_or_crisp)
{
    scoped_scene h = scene_model(CLOTH, "",
                                 ", 'colliders': [{'type': 'sphere', 'center': [0, 1, 0], 'radius': 0.3},"
                                 " {'type': 'box', 'center': [0, 0, 0], 'size': [0.5, 0.3, 0.7]}]");
    const drape_model *model = h.model;
    drape_arena arena = drape_arena_of(h.ctx);
    for (int c = 0; c < 2; c++) {
        drape_body body;
        ck_assert_int_eq(drape_body_create(&arena, &model->colliders[c], (const double[3]){0}, 2, &body),
                         DRAPE_OK);
        for (size_t i = 0; i < body.vertex_count; i++) {
            const float *v = body.vertex + 6 * i, *n = v + 3, out[3] = {v[0], v[1] - 1, v[2]};
            float largest = fmaxf(fabsf(n[0]), fmaxf(fabsf(n[1]), fabsf(n[2])));
            if (c == 0)
                ck_assert(drape_dot(n, out) / sqrtf(drape_dot(out, out)) > 1 - 0.5e-6f);
            else
                ck_assert_msg(largest > 1 - 1e-5f, "%g %g %g", (double)n[0], (double)n[1], (double)n[2]);
        }
    }
    drape_arena_free(&arena);
}

/* ---- Cloth ---- */

/* Rows of nodes lie 2 mm above a plane in pairs, between rows 60 mm higher. Slopes of 60 mm over 125 mm are
 * those of the normals at the pairs by half; a curve between them would sink by about a quarter of that
 * times the edge, 7 mm, into the plane, and does so without a collider. With the plane no point is below
 * it. */
TEST(curved_cloth_clears_colliders)
{
    static const char *const planes[] = {
        "", ", 'colliders': [{'type': 'plane', 'point': [0, 0, 0], 'normal': [0, 1, 0]}]"};
    for (int c = 0; c < 2; c++) {
        drape_skin skin;
        scoped_scene h = scene_model(CLOTH, "", planes[c]);
        drape_arena arena = drape_arena_of(h.ctx);
        float x[3 * 81], lowest = 1;
        for (size_t i = 0; i < 81; i++) {
            x[3 * i] = (float)h.model->rest[3 * i];
            x[3 * i + 1] = i % 9 % 4 < 2 ? 0.002f : 0.062f;
            x[3 * i + 2] = (float)h.model->rest[3 * i + 2];
        }
        ck_assert_int_eq(drape_skin_create(&arena, h.model, &skin), DRAPE_OK);
        drape_skin_update(&skin, 0, x, NULL);
        for (size_t i = 0; i < skin.vertex_count; i++)
            lowest = fminf(lowest, skin.vertex[i].p[1]);
        if (c == 0)
            ck_assert_msg(lowest < -0.002f, "%g", (double)lowest);
        else
            ck_assert_msg(lowest > 0, "%g", (double)lowest);
        drape_arena_free(&arena);
    }
}

/* A flat sheet has 32 edges at its border. Its hem lies on both sides of it, no farther than its radius,
 * and not outside of it, up to the rounding of floats. */
TEST(hem_lies_inside_the_border)
{
    drape_skin skin;
    float x[3 * 81], above = 0, below = 0;
    scoped_scene h = scene_model(CLOTH, "", "");
    drape_arena arena = drape_arena_of(h.ctx);
    ck_assert_int_eq(drape_skin_create(&arena, h.model, &skin), DRAPE_OK);
    ck_assert_uint_eq(skin.border_count, 32);
    for (size_t i = 0; i < 3 * 81; i++)
        x[i] = (float)h.model->rest[i];
    drape_skin_update(&skin, 0, x, NULL);
    drape_skin_update_hem(&skin);
    for (size_t i = 0; i < skin.hem_count; i++) {
        const float *p = skin.hem[i].p;
        above = fmaxf(above, p[1] - x[1]);
        below = fmaxf(below, x[1] - p[1]);
        ck_assert(p[0] > -1e-6f && p[0] < 1 + 1e-6f && p[2] > -1 - 1e-6f && p[2] < 1e-6f);
        ck_assert(fabsf(drape_dot(skin.hem[i].n, skin.hem[i].n) - 1) < 1e-5f);
    }
    ck_assert(above > 0.8f * skin.hem_radius && above < 1.0001f * skin.hem_radius);
    ck_assert(below > 0.8f * skin.hem_radius && below < 1.0001f * skin.hem_radius);
    for (size_t i = 0; i < skin.hem_index_count; i++)
        ck_assert(skin.hem_index[i] < skin.hem_count);
    drape_arena_free(&arena);
}

/* Nodes on an eighth of a sphere of radius 1. Normals weighted by area are exact up to the square of an
 * edge's angle, below 0.16 rad; the points of curved patches are nearer to the sphere than flat triangles,
 * whose middles lie an eighth of that square inside. Nodes are drawn at their positions. */
TEST(cloth_is_drawn_round_through_its_nodes)
{
    drape_skin skin;
    scoped_scene h = scene_model(CLOTH, "", "");
    drape_arena arena = drape_arena_of(h.ctx);
    const drape_model *model = h.model;
    float x[3 * 81];
    for (size_t i = 0; i < 81; i++) {
        double u = model->rest[3 * i] - 0.5, w = model->rest[3 * i + 2] + 0.5, y = sqrt(1 - u * u - w * w);
        x[3 * i] = (float)u;
        x[3 * i + 1] = (float)y;
        x[3 * i + 2] = (float)w;
    }
    ck_assert_int_eq(drape_skin_create(&arena, model, &skin), DRAPE_OK);
    ck_assert_int_ge(skin.level, 4);
    drape_skin_update(&skin, 0, x, NULL);
    double off_normal = 0, off_sphere = 0;
    for (size_t i = 0; i < skin.vertex_count; i++) {
        const drape_skin_vertex *v = &skin.vertex[i];
        float square = drape_dot(v->p, v->p), inner = fmaxf(fabsf(v->p[0]), fabsf(v->p[2]));
        if (i < 81)
            ck_assert(memcmp(v->p, x + 3 * i, sizeof v->p) == 0);
        ck_assert(fabsf(drape_dot(v->t, v->n)) < 1e-5f && v->t[0] > 0.5f);
        if (inner > 0.37f) /* at the rim a normal has triangles on one side only */
            continue;
        off_normal = fmax(off_normal, acos(fmin(1, (double)(drape_dot(v->p, v->n) / sqrtf(square)))));
        off_sphere = fmax(off_sphere, fabs(sqrt((double)square) - 1));
    }
    assert_below(off_normal, 0.16 * 0.16);
    assert_below(off_sphere, 0.16 * 0.16 / 8 / 2);
    for (size_t i = 0; i < skin.index_count; i++)
        ck_assert(skin.index[i] < skin.vertex_count);
    drape_arena_free(&arena);
}

/* Every triangle has the orientation of its mesh: the normal by its corners is on the side of the smooth
 * one. On a flat sheet the texture is as long as wide, with u along x and v away from the first row; seen
 * from the front it is not mirrored. */
TEST(texture_is_not_mirrored)
{
    static const char *const orientations[] = {"", ", 'orientation': 'vertical'"};
    for (int o = 0; o < 2; o++) {
        drape_skin skin;
        float x[3 * 81];
        scoped_scene h = scene_model(CLOTH, orientations[o], "");
        drape_arena arena = drape_arena_of(h.ctx);
        const drape_model *model = h.model;
        ck_assert_int_eq(drape_skin_create(&arena, model, &skin), DRAPE_OK);
        for (size_t i = 0; i < 3 * 81; i++)
            x[i] = (float)model->rest[i];
        drape_skin_update(&skin, 0, x, NULL);
        for (size_t i = 0; i < skin.index_count; i += 3) {
            const drape_skin_vertex *a = &skin.vertex[skin.index[i]], *b = &skin.vertex[skin.index[i + 1]],
                                    *c = &skin.vertex[skin.index[i + 2]];
            float area =
                (b->uv[0] - a->uv[0]) * (c->uv[1] - a->uv[1]) - (b->uv[1] - a->uv[1]) * (c->uv[0] - a->uv[0]);
            float e1[3], e2[3], n[3];
            for (int k = 0; k < 3; k++) {
                e1[k] = b->p[k] - a->p[k];
                e2[k] = c->p[k] - a->p[k];
            }
            drape_cross(e1, e2, n);
            ck_assert(area > 0 && drape_dot(n, a->n) > 0);
        }
        drape_arena_free(&arena);
    }
}

/* ---- Colours, letters, camera ---- */

/* Lightness in OKLab is close to the cube root of luminance (the weights of its L are all positive and sum
 * to 1). It rises in each of 256 steps, and each half of the ramp has half of the rise, to a tenth. */
TEST(ramp_is_even_in_lightness)
{
    double last = -1, middle = 0, first = 0;
    for (int i = 0; i < 256; i++) {
        float c[3];
        drape_ramp(i / 255.0, c);
        double l =
            cbrt(0.4122214708 * (double)c[0] + 0.5363325363 * (double)c[1] + 0.0514459929 * (double)c[2]);
        double m =
            cbrt(0.2119034982 * (double)c[0] + 0.6806995451 * (double)c[1] + 0.1073969566 * (double)c[2]);
        double s =
            cbrt(0.0883024619 * (double)c[0] + 0.2817188376 * (double)c[1] + 0.6299787005 * (double)c[2]);
        double lightness = 0.2104542553 * l + 0.7936177850 * m - 0.0040720468 * s;
        ck_assert_msg(lightness > last, "%d: %g after %g", i, lightness, last);
        last = lightness;
        first = i == 0 ? lightness : first;
        middle = i == 127 ? lightness : middle;
    }
    ck_assert(fabs((middle - first) / (last - first) - 0.5) < 0.05);
}

/* Every printable ASCII character has strokes within its cell; an unknown one is a box. */
TEST(letters_are_all_there)
{
    scoped_context *ctx = NULL;
    drape_font font;
    char text[] = "x";
    const char *units = "²·°×", *unknown = "€";
    float advance;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    drape_arena arena = drape_arena_of(ctx);
    for (float height = 8; height < 40;
         height += 0.7f) { /* letters begin at whole pixels: no neighbour shows */
        ck_assert_int_eq(drape_font_create(&arena, height, &font), DRAPE_OK);
        ck_assert(font.origin[0] == floorf(font.origin[0]) && font.origin[1] == floorf(font.origin[1]));
    }
    ck_assert_int_eq(drape_font_create(&arena, 12, &font), DRAPE_OK);
    for (char c = 33; c < 127; c++) {
        if (strchr("$&@`", c))
            continue; /* no unit and no name of Drape has these */
        const char *at = text;
        text[0] = c;
        int glyph = drape_font_next(&font, &at, &advance), ink = 0;
        ck_assert_msg(glyph > 0, "%c", c);
        for (int j = 0; j < font.cell_height; j++)
            for (int i = 0; i < font.cell_width; i++)
                ink += font.alpha[j * font.cell_width * DRAPE_FONT_CELLS + glyph * font.cell_width + i];
        ck_assert_msg(ink > 255, "%c", c);
    }
    for (int i = 0; i < 4; i++)
        ck_assert_int_gt(drape_font_next(&font, &units, &advance), 0);
    ck_assert_int_eq(drape_font_next(&font, &unknown, &advance), 0);
    ck_assert_int_eq(drape_font_next(&font, &unknown, &advance), -1);
    drape_arena_free(&arena);
}

/* All points are in the picture, and the outermost ones are at the margin of 1/1.12 on two sides, up to
 * rounding. */
TEST(camera_frames_all_points)
{
    const float points[][3] = {{0, 0, 0}, {1, 0.2f, 0}, {0.3f, -2, 0.5f}, {-0.7f, 0.4f, 1.5f}};
    const float nowhere[3] = {0};
    for (int azimuth = -170; azimuth < 180; azimuth += 35)
        for (int elevation = -80; elevation <= 80; elevation += 40) {
            drape_framing f = drape_framing_begin((float)azimuth, (float)elevation, 1.6f);
            drape_framing_add(&f, points[0], 4, nowhere);
            drape_camera camera = drape_framing_end(&f, (float)azimuth, (float)elevation, 1);
            drape_view view = drape_camera_view(&camera, 1.6f, 2);
            float out[2] = {0, 0}, deep = -1;
            for (int i = 0; i < 4; i++) {
                float q[4];
                for (int r = 0; r < 4; r++)
                    q[r] = view.matrix.m[r] * points[i][0] + view.matrix.m[4 + r] * points[i][1] +
                           view.matrix.m[8 + r] * points[i][2] + view.matrix.m[12 + r];
                ck_assert(q[3] > 0);
                deep = fmaxf(deep, fabsf(q[2] / q[3]));
                for (int k = 0; k < 2; k++)
                    out[k] = fmaxf(out[k], fabsf(q[k] / q[3]));
            }
            ck_assert(deep < 1);
            ck_assert_msg(fabsf(fmaxf(out[0], out[1]) - 1 / 1.12f) < 1e-4f, "%d %d: %g %g", azimuth,
                          elevation, (double)out[0], (double)out[1]);
        }
}

TEST(shadings_are_found_by_name)
{
    for (int i = 0; drape_shadings[i]; i++) {
        ck_assert_int_eq(drape_registry_find(&drape_shading_registry, NULL, drape_shadings[i]->entry.name),
                         i);
        ck_assert(drape_shadings[i]->entry.summary &&
                  strstr(drape_shadings[i]->source, "vec3 shade(Surface s)"));
    }
    ck_assert_int_eq(drape_registry_find(&drape_shading_registry, NULL, "lambert"), -1);
}
