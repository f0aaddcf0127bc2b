/* overlay.c: see overlay.h. */
#include "render/overlay.h"

#include "render/images.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define VERTEX    9     /* floats: x y, u v, kind, r g b a */
#define TEXT_SIZE 11.5f /* pixels of a capital at 720 rows */
#define TICKS     7
#define NUMBER    40 /* width of a number of the legend as %.4g prints it, in pixels at 720 rows */
#define LEGEND    11 /* margin around the legend, in pixels at 720 rows */

enum { KIND_BOX, KIND_TEXT, KIND_RAMP };

const float drape_ink[4] = {0.13f, 0.14f, 0.16f, 1}, drape_faint[4] = {0.13f, 0.14f, 0.16f, 0.7f};

static const char *const vertex_source[] = {
    "layout(location = 0) in vec2 at;\n"
    "layout(location = 1) in vec2 uv;\n"
    "layout(location = 2) in float kind;\n"
    "layout(location = 3) in vec4 tint;\n"
    "uniform vec2 size;\n"
    "out vec2 place;\n"
    "out vec4 ink;\n"
    "flat out int what;\n"
    "void main() {\n"
    "    place = uv;\n"
    "    ink = tint;\n"
    "    what = int(kind + 0.5);\n"
    "    gl_Position = vec4(2.0 * at.x / size.x - 1.0, 1.0 - 2.0 * at.y / size.y, 0.0, 1.0);\n"
    "}\n",
    NULL};
static const char *const fragment_source[] = {
    "in vec2 place;\n"
    "in vec4 ink;\n"
    "flat in int what;\n"
    "uniform sampler2D letters, ramp;\n"
    "out vec4 colour;\n"
    "void main() {\n"
    "    float cover = texture(letters, place).r;\n"
    "    vec3 step = pow(texture(ramp, vec2(place.x, 0.5)).rgb, vec3(1.0 / 2.2));\n"
    "    colour = what == 1 ? vec4(ink.rgb, ink.a * cover) : what == 2 ? vec4(step, 1.0) : ink;\n"
    "}\n",
    NULL};

drape_status drape_overlay_create(drape_arena *arena, int width, int height, int fine, drape_overlay *overlay)
{
    static const int sizes[] = {2, 2, 1, 4, 0};
    *overlay = (drape_overlay){.width = width, .height = height};
    overlay->unit = fmaxf(0.75f * (float)fine, fminf((float)height / 720, (float)width / 960));
    overlay->quads =
        drape_arena_take(arena, (size_t)DRAPE_OVERLAY_QUADS * 6 * VERTEX, sizeof *overlay->quads);
    drape_status status = drape_font_create(arena, roundf(TEXT_SIZE * overlay->unit), &overlay->font);
    if (status || drape_arena_status(arena))
        return DRAPE_E_MEMORY;
    overlay->program = drape_gl_program(arena->ctx, "overlay", vertex_source, fragment_source);
    if (!overlay->program)
        return DRAPE_E_FILE;
    drape_gl_mesh_create(&overlay->mesh, sizes, false);
    overlay->ramp = drape_texture_ramp();
    overlay->letters =
        drape_gl_texture(GL_R8, overlay->font.cell_width * DRAPE_FONT_CELLS, overlay->font.cell_height,
                         GL_RED, GL_UNSIGNED_BYTE, overlay->font.alpha, GL_LINEAR, GL_REPEAT);
    return DRAPE_OK;
}

void drape_overlay_free(drape_overlay *overlay)
{
    if (overlay->program) {
        drape_gl_mesh_free(&overlay->mesh);
        glDeleteProgram(overlay->program);
        glDeleteTextures(1, &overlay->ramp);
        glDeleteTextures(1, &overlay->letters);
    }
    *overlay = (drape_overlay){.width = 0};
}

/* at and uv: left, top, right and bottom, in pixels and in texture coordinates. */
static void put_quad(drape_overlay *o, int kind, const float *at, const float *uv, const float *colour)
{
    static const int corner[6][2] = {{0, 1}, {2, 1}, {2, 3}, {0, 1}, {2, 3}, {0, 3}};
    if (o->count == DRAPE_OVERLAY_QUADS)
        return;
    float *to = o->quads + o->count++ * 6 * VERTEX;
    for (int i = 0; i < 6; i++, to += VERTEX) {
        to[0] = at[corner[i][0]];
        to[1] = at[corner[i][1]];
        to[2] = uv[corner[i][0]];
        to[3] = uv[corner[i][1]];
        to[4] = (float)kind;
        memcpy(to + 5, colour, 4 * sizeof *to);
    }
}

void drape_overlay_box(drape_overlay *o, float x, float y, float width, float height, const float *colour)
{
    put_quad(o, KIND_BOX, (const float[]){x, y, x + width, y + height}, (const float[4]){0}, colour);
}

void drape_overlay_text(drape_overlay *o, float x, float y, drape_align align, const float *colour,
                        const char *text)
{
    const drape_font *font = &o->font;
    float advance, wide = (float)font->cell_width, tall = (float)font->cell_height;
    float width = align == DRAPE_LEFT ? 0 : drape_font_width(font, text);
    x = roundf(x - (align == DRAPE_MIDDLE ? width / 2 : width));
    y = roundf(y);
    for (int glyph; (glyph = drape_font_next(font, &text, &advance)) >= 0; x += advance) {
        float left = roundf(x) - font->origin[0], top = y - font->origin[1];
        const float at[] = {left, top, left + wide, top + tall};
        const float uv[] = {(float)glyph / DRAPE_FONT_CELLS, 0, (float)(glyph + 1) / DRAPE_FONT_CELLS, 1};
        put_quad(o, KIND_TEXT, at, uv, colour);
    }
}

void drape_overlay_legend(drape_overlay *o, float right, float bottom, float tall, const char *title,
                          double low, double high)
{
    float u = o->unit, wide = roundf(16 * u), gap = 7 * u;
    /* 1, 2 or 5 times a power of ten, such that at most TICKS steps fill the range, or as many as have
     * room. */
    double rough = (high - low) / fmin(TICKS, tall / (2.2 * o->font.height));
    double power = pow(10, floor(log10(rough))), s = rough / power;
    double step = power * (s <= 1 ? 1 : s <= 2 ? 2 : s <= 5 ? 5 : 10);
    char text[40];
    float widest = 0;
    for (double value = ceil(low / step) * step; value <= high + 1e-9 * step; value += step) {
        snprintf(text, sizeof text, "%.4g", fabs(value) < 1e-9 * step ? 0 : value);
        widest = fmaxf(widest, drape_font_width(&o->font, text));
    }
    float left = roundf(right - wide - gap - widest), top = roundf(bottom - tall), margin = LEGEND * u;
    float panel = fminf(left, right - drape_font_width(&o->font, title)) - margin;
    drape_overlay_box(o, panel, top - 32 * u - margin / 2, right + margin - panel,
                      tall + 32 * u + 1.5f * margin, (const float[]){1, 1, 1, 0.62f});
    for (int i = 0; i < 64; i++) { /* from below; each piece has one colour of the ramp */
        float s0 = (float)i / 64, s1 = (float)(i + 1) / 64;
        const float at[] = {left, bottom - s1 * tall, left + wide, bottom - s0 * tall};
        const float middle = (s0 + s1) / 2, uv[] = {middle, 0, middle, 1};
        put_quad(o, KIND_RAMP, at, uv, drape_ink);
    }
    for (double value = ceil(low / step) * step; value <= high + 1e-9 * step; value += step) {
        float y = roundf(bottom - (float)((value - low) / (high - low)) * tall);
        snprintf(text, sizeof text, "%.4g", fabs(value) < 1e-9 * step ? 0 : value);
        drape_overlay_box(o, left + wide, y - u / 2, 3 * u, u, drape_ink);
        drape_overlay_text(o, left + wide + gap, y + o->font.height / 2, DRAPE_LEFT, drape_ink, text);
    }
    drape_overlay_text(o, right, top - 14 * u, DRAPE_RIGHT, drape_ink, title);
}

float drape_overlay_legend_width(const drape_overlay *o, const char *title)
{
    return fmaxf(drape_font_width(&o->font, title), (16 + 7 + NUMBER) * o->unit) + 2 * LEGEND * o->unit;
}

void drape_overlay_draw(drape_overlay *o)
{
    glDisable(GL_DEPTH_TEST);
    glDisable(GL_CULL_FACE);
    glEnable(GL_BLEND);
    glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
    drape_gl_use(o->program, (const drape_gl_unit[]){{"letters", o->letters}, {"ramp", o->ramp}}, 2);
    drape_gl_set_vec2(o->program, "size", (float)o->width, (float)o->height);
    drape_gl_mesh_fill(&o->mesh, o->quads, 6 * o->count, true);
    glBindVertexArray(o->mesh.array);
    glDrawArrays(GL_TRIANGLES, 0, (GLsizei)(6 * o->count));
    glDisable(GL_BLEND);
    o->count = 0;
}
