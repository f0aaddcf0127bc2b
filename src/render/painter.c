/* painter.c: see painter.h. */
#include "render/painter.h"

#include "render/images.h"
#include "render/lighting.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define LAMP_AZIMUTH -14.0f /* [degrees], as a camera's; it does not move with the camera */
#define LAMP_HEIGHT  52.0f  /* [degrees] */
#define SHADOW_REACH 1.3f   /* half the width of the shadow map, in radii of the stage */
#define DEEP         5.0f   /* distance of the lamp, in radii of the stage */
#define RELIEF       0.016f /* height of displacements over the longer side of the largest cloth */
#define WIRE         1.25f  /* width of edges in pixels at 720 rows */
#define WIRE_SHARE   0.16f  /* largest width of edges over the mean edge as it appears */
#define PIN          11.0f  /* size of pinned nodes in pixels at 720 rows */
#define REFRACTED    0.45f  /* length of a refracted ray, in radii of the stage */
#define MAX_SHADINGS 64

static const float unturned[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};

/* ---- Sources ---- */

static const char surface_vertex[] =
    "layout(location = 0) in vec3 at_place;\n"
    "layout(location = 1) in vec3 at_normal;\n"
    "layout(location = 2) in vec3 at_tangent;\n"
    "layout(location = 3) in vec2 at_uv;\n"
    "layout(location = 4) in float at_value;\n"
    "layout(location = 5) in float at_piece;\n"
    "uniform mat4 view;\n"
    "uniform mat3 turn;\n"
    "uniform vec3 offset;\n"
    "uniform float relief, spread, grain; // grain: of the mesh that is drawn, in texture coordinates\n"
    "uniform sampler2D heights;\n"
    "out vec3 place, normal, tangent;\n"
    "out vec2 at;\n"
    "out float value, piece;\n"
    "void main() {\n"
    "    float level = relief > 0.0 ? log2(max(1.0, grain * float(textureSize(heights, 0).x))) : 0.0;\n"
    "    float rise = relief > 0.0 ? relief * textureLod(heights, at_uv, level).r : 0.0;\n"
    "    place = spread * (turn * at_place) + offset + rise * at_normal;\n"
    "    normal = turn * at_normal;\n"
    "    tangent = at_tangent;\n"
    "    at = at_uv;\n"
    "    value = at_value;\n"
    "    piece = at_piece;\n"
    "    gl_Position = view * vec4(place, 1.0);\n"
    "}\n";

/* Gathers what is known of the point, then computes its colour. */
static const char surface_main[] =
    "void main() {\n"
    "    Surface s;\n"
    "    s.p = place;\n"
    "    s.v = normalize(eye - place);\n"
    "    s.side = gl_FrontFacing ? 1.0 : -1.0;\n"
    "    vec3 n = normalize(normal) * s.side;\n"
    "    float away = dot(n, s.v); // a smooth normal may look away where its triangle does not\n"
    "    s.n = normalize(away < 0.02 ? n + (0.02 - away) * s.v : n);\n"
    "    s.t = normalize(tangent - dot(tangent, s.n) * s.n + 1e-9 * s.v);\n"
    "    s.at = at;\n"
    "    s.value = value;\n"
    "    s.piece = piece;\n"
    "    vec2 reached = lighting(place);\n"
    "    s.sun = mix(reached.x, 1.0, clear);\n"
    "    s.open = reached.y;\n"
    "    colour = vec4(encoded(shade(s)), 1.0);\n"
    "}\n";

static const char body_source[] = "vec3 shade(Surface s) {\n"
                                  "    vec3 h = normalize(light + s.v);\n"
                                  "    return vec3(0.44, 0.435, 0.43) * arriving(s) / PI * 1.45 + 0.05 * "
                                  "power(dot(s.n, h), 30.0) * s.sun + 0.06 * "
                                  "s.open * power(1.0 - dot(s.n, s.v), 4.0);\n"
                                  "}\n";

/* Most pixels of a picture are ground, so its shader is cheap: it mixes light directly in sRGB. */
static const char ground_source[] =
    "uniform vec3 center;\n"
    "uniform float radius, solid;\n"
    "\n"
    "// Continues the wall towards the eye, so that no horizon is seen, and fades into it. Without a ground "
    "in the scene only the shadow is drawn.\n"
    "void main() {\n"
    "    vec3 c = wall(), far = (place - center) / radius;\n"
    "    float fade = 1.0 - smoothstep(1.3, 3.3, sqrt(dot(far, far))), facing = dot(normal, light) / "
    "max(light.y, 0.1);\n"
    "    if (fade > 0.0) {\n"
    "        vec2 reached = lighting(place);\n"
    "        float slope = 1.0 - smoothstep(0.97, 1.0, normal.y);\n"
    "        float sun = mix(reached.x, 1.0, clear) * clamp(facing, 0.0, 1.2), held = (1.0 - sun) * (0.45 + "
    "0.55 * max(normal.y, 0.0));\n"
    "        vec3 lit = c * mix(vec3(1.0), vec3(0.955, 0.95, 0.945), solid * (0.4 + 0.6 * slope));\n"
    "        lit *= 1.0 - held * vec3(0.50, 0.475, 0.435);\n"
    "        lit *= mix(vec3(0.56, 0.555, 0.57), vec3(1.0), reached.y);\n"
    "        c = mix(c, lit, fade);\n"
    "    }\n"
    "    colour = vec4(c, 1.0);\n"
    "}\n";

static const char wall_vertex[] =
    "void main() {\n"
    "    vec2 at = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);\n"
    "    gl_Position = vec4(at, 1.0, 1.0);\n"
    "}\n";
static const char wall_source[] =
    "uniform vec4 box;\n"
    "// A wall lit from above, in sRGB; noise of half a level avoids banding.\n"
    "vec3 wall() {\n"
    "    vec2 at = (gl_FragCoord.xy - box.xy) / box.zw * 2.0 - 1.0;\n"
    "    float up = 0.5 + 0.5 * at.y;\n"
    "    vec3 c = mix(vec3(0.925, 0.918, 0.908), vec3(0.845, 0.853, 0.865), up * up * (3.0 - 2.0 * up));\n"
    "    float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715)))) - 0.5;\n"
    "    return c - 0.035 * dot(at, at) * vec3(1.0, 0.98, 0.95) + noise / 255.0;\n"
    "}\n";
static const char wall_main[] = "out vec4 colour;\n"
                                "void main() { colour = vec4(wall(), 1.0); }\n";

/* A ribbon between two points, of constant width on the screen. */
static const char wire_vertex[] =
    "layout(location = 0) in vec3 from;\n"
    "layout(location = 1) in vec3 to;\n"
    "uniform mat4 view;\n"
    "uniform vec3 eye;\n"
    "uniform vec2 size;\n"
    "uniform float width;\n"
    "void main() {\n"
    "    vec4 a = view * vec4(from + 0.003 * (eye - from), 1.0), b = view * vec4(to + 0.003 * (eye - to), "
    "1.0);\n"
    "    vec2 along = (b.xy / b.w - a.xy / a.w) * size;\n"
    "    vec2 side = length(along) > 1e-6 ? normalize(vec2(-along.y, along.x)) : vec2(0.0);\n"
    "    vec4 p = gl_VertexID < 2 ? a : b;\n"
    "    p.xy += (gl_VertexID % 2 == 0 ? 1.0 : -1.0) * width * side / size * p.w;\n"
    "    gl_Position = p;\n"
    "}\n";
static const char wire_fragment[] = "out vec4 colour;\n"
                                    "uniform vec4 ink;\n"
                                    "void main() { colour = ink; }\n";

static const char pin_vertex[] = "layout(location = 0) in vec3 at;\n"
                                 "uniform mat4 view;\n"
                                 "uniform vec3 eye;\n"
                                 "uniform float width;\n"
                                 "void main() {\n"
                                 "    gl_Position = view * vec4(at + 0.006 * (eye - at), 1.0);\n"
                                 "    gl_PointSize = width;\n"
                                 "}\n";
static const char pin_fragment[] =
    "out vec4 colour;\n"
    "uniform float width;\n"
    "void main() {\n"
    "    float r = length(gl_PointCoord - 0.5) * width, rim = 0.5 * width - 0.5;\n"
    "    vec3 c = mix(vec3(0.0, 0.86, 0.92), vec3(0.0, 0.42, 0.47), smoothstep(0.70 * rim, 0.78 * rim, r));\n"
    "    colour = vec4(c, clamp(rim - r + 0.5, 0.0, 1.0));\n"
    "}\n";

static const char depth_fragment[] = "void main() {}\n";

struct drape_painter {
    drape_context *ctx;
    drape_arena arena; /* of the overlay */
    drape_canvas canvas;
    drape_overlay overlay;
    GLuint textures[3], ramp; /* that shadings read, in the order of DRAPE_READS_*; 0: not made yet */
    drape_lighting lighting;
    GLuint empty; /* vertex array without attributes */
    GLuint depth, seen, body, ground, wall, wire, pin;
    GLuint shadings[MAX_SHADINGS]; /* 0: not made yet */
    drape_gl_mesh floor;           /* a horizontal square with sides of 2 */
};

/* ---- Creation ---- */

static GLuint surface_program(drape_context *ctx, const char *name, const char *const *source)
{
    const char *const *p = drape_shading_prelude;
    return drape_gl_program(ctx, name, (const char *const[]){surface_vertex, NULL},
                            (const char *const[]){p[0], p[1], p[2], drape_lighting_lookup_source, source[0],
                                                  source[1], source[2], NULL});
}

static GLuint program(drape_context *ctx, const char *name, const char *vertex, const char *first,
                      const char *second)
{
    return drape_gl_program(ctx, name, (const char *const[]){vertex, NULL},
                            (const char *const[]){first, second, NULL});
}

drape_status drape_painter_create(drape_context *ctx, const drape_painter_def *def, drape_painter **out)
{
    static const int sizes[] = {3, 3, 0};
    static const float square[] = {-1, 0, 1, 0, 1, 0, 1, 0, 1,  0, 1, 0, 1,  0, -1, 0, 1, 0,
                                   -1, 0, 1, 0, 1, 0, 1, 0, -1, 0, 1, 0, -1, 0, -1, 0, 1, 0};
    static const char *const body[] = {body_source, surface_main, NULL};
    static const char *const ground[] = {wall_source, ground_source, NULL};
    const char *const paths[] = {def->pattern, def->heights, def->environment};
    drape_painter *p = *out = drape_alloc(ctx, 1, sizeof *p);
    if (!p)
        return DRAPE_E_MEMORY;
    p->ctx = ctx;
    p->arena = drape_arena_of(ctx);
    drape_status status = drape_canvas_create(ctx, def->width, def->height, &p->canvas);
    if (!status)
        status = drape_overlay_create(&p->arena, def->width, def->height, def->fine, &p->overlay);
    if (!status)
        status = drape_lighting_create(ctx, def->width, def->height, &p->lighting);
    for (int i = 0; i < 3 && !status; i++)
        if (paths[i])
            status = drape_texture(ctx, (drape_texture_kind)i, paths[i], &p->textures[i]);
    if (!status && !((p->depth = program(ctx, "depth", surface_vertex, depth_fragment, NULL)) &&
                     (p->seen = program(ctx, "seen", surface_vertex, drape_lighting_seen_source, NULL)) &&
                     (p->body = surface_program(ctx, "body", body)) &&
                     (p->ground = surface_program(ctx, "ground", ground)) &&
                     (p->wall = program(ctx, "wall", wall_vertex, wall_source, wall_main)) &&
                     (p->wire = program(ctx, "wire", wire_vertex, wire_fragment, NULL)) &&
                     (p->pin = program(ctx, "pin", pin_vertex, pin_fragment, NULL))))
        status = DRAPE_E_FILE;
    if (!status) {
        p->ramp = drape_texture_ramp();
        glGenVertexArrays(1, &p->empty);
        drape_gl_mesh_create(&p->floor, sizes, false);
        drape_gl_mesh_fill(&p->floor, square, 6, false);
        status = drape_gl_check(ctx, "set up drawing");
    }
    if (status)
        drape_painter_destroy(out);
    return status;
}

void drape_painter_destroy(drape_painter **painter)
{
    drape_painter *p = *painter;
    if (!p)
        return;
    const GLuint textures[] = {p->textures[0], p->textures[1], p->textures[2], p->ramp};
    const GLuint programs[] = {p->depth, p->seen, p->body, p->ground, p->wall, p->wire, p->pin};
    glDeleteTextures(sizeof textures / sizeof *textures, textures);
    for (size_t i = 0; i < sizeof programs / sizeof *programs; i++)
        glDeleteProgram(programs[i]);
    for (int i = 0; i < MAX_SHADINGS; i++)
        glDeleteProgram(p->shadings[i]);
    glDeleteVertexArrays(1, &p->empty);
    drape_lighting_free(&p->lighting);
    drape_gl_mesh_free(&p->floor);
    drape_overlay_free(&p->overlay);
    drape_arena_free(&p->arena);
    drape_canvas_free(&p->canvas);
    drape_free(p->ctx, p);
    *painter = NULL;
}

const drape_canvas *drape_painter_canvas(const drape_painter *painter)
{
    return &painter->canvas;
}

drape_overlay *drape_painter_overlay(drape_painter *painter)
{
    return &painter->overlay;
}

/* ---- Layout: the places of panels, legend and lines ---- */

#define STRIP  0.25f /* largest share of the picture's width for the legend */
#define MARGIN 20    /* [pixels at 720 rows], as all below */
#define LINE   21    /* height of a line */
#define LEGEND 120   /* smallest height of the legend's ramp */
#define TAB    112   /* from the beginning of a line to the text after its tab */

static const float veil[4] = {1, 1, 1, 0.62f};

/* In pixels from the lower left. */
typedef struct rectangle {
    int left, bottom, width, height;
} rectangle;

static void legend_title(const drape_shading *shading, char *title, size_t size)
{
    snprintf(title, size, "%s [%s]", shading->field->entry.name, shading->field->shown_unit);
}

static int columns_of(int panel_count)
{
    return panel_count <= 3 ? panel_count : (int)ceil(sqrt(panel_count));
}

/* The part of a panel that its camera frames, and the whole of it: at the sides of a picture the scene
 * continues beneath lines and legend. */
static rectangle inner_of(const drape_overlay *overlay, const drape_picture *picture, int panel)
{
    int count = picture->panel_count, columns = columns_of(count), rows = (count + columns - 1) / columns;
    int column = panel % columns, row = rows - 1 - panel / columns;
    int left = (int)picture->column, strip = 0; /* at the right, for the legend [pixels] */
    if (picture->shading->field) {
        char title[80];
        legend_title(picture->shading, title, sizeof title);
        float wide = drape_overlay_legend_width(overlay, title) + MARGIN * overlay->unit;
        strip = (int)fminf(wide, STRIP * (float)overlay->width);
    }
    int width = overlay->width - left - strip;
    rectangle b = {.left = left + column * width / columns, .bottom = row * overlay->height / rows};
    b.width = left + (column + 1) * width / columns - b.left;
    b.height = (row + 1) * overlay->height / rows - b.bottom;
    return b;
}

static rectangle whole_of(const drape_overlay *overlay, const drape_picture *picture, int panel)
{
    rectangle b = inner_of(overlay, picture, panel);
    int columns = columns_of(picture->panel_count), right = b.left + b.width;
    if (panel % columns == columns - 1)
        right = overlay->width;
    if (panel % columns == 0)
        b.left = 0;
    b.width = right - b.left;
    return b;
}

static void put_labels(drape_overlay *o, const drape_picture *picture)
{
    for (int i = 0; i < picture->panel_count; i++) {
        const rectangle b = whole_of(o, picture, i);
        const char *label = picture->panels[i].label;
        float top = (float)(o->height - b.bottom - b.height), x = (float)b.left + MARGIN * o->unit;
        if (b.left > 0)
            drape_overlay_box(o, (float)b.left - o->unit, top, 2 * o->unit, (float)b.height,
                              (const float[]){1, 1, 1, 0.9f});
        if (!label)
            continue;
        drape_overlay_box(o, x - 9 * o->unit, top + 12 * o->unit,
                          drape_font_width(&o->font, label) + 18 * o->unit, 26 * o->unit, veil);
        drape_overlay_text(o, x, top + 30 * o->unit, DRAPE_LEFT, drape_ink, label);
    }
}

/* Puts text from x on, broken at blanks to end before `right`; returns the number of lines. A colour of NULL
 * only counts them. */
static int put_wrapped(drape_overlay *o, float x, float y, float right, const float *colour, const char *text)
{
    int lines = 0;
    while (*text || lines == 0) {
        char line[200] = "";
        size_t length = 0;
        for (size_t next = strcspn(text, " ");; next += 1 + strcspn(text + next + 1, " ")) {
            char more[sizeof line];
            snprintf(more, sizeof more, "%.*s", (int)next, text);
            if (length > 0 && x + drape_font_width(&o->font, more) > right)
                break;
            memcpy(line, more, sizeof line);
            length = next;
            if (!text[next])
                break;
        }
        if (colour)
            drape_overlay_text(o, x, y + (float)lines * LINE * o->unit, DRAPE_LEFT, colour, line);
        text += length;
        text += strspn(text, " ");
        lines++;
    }
    return lines;
}

/* The text before a tab is a name, put in a fainter colour, of the value after it. Returns the number of
 * lines. */
static int put_lines(drape_overlay *o, const drape_picture *picture, bool put)
{
    float left = MARGIN * o->unit, right = picture->column > 0 ? picture->column : (float)o->width - left;
    int count = 0;
    for (int i = 0; picture->lines[i]; i++) {
        const char *text = picture->lines[i], *tab = strchr(text, '\t');
        float y = (30 + (float)count * LINE) * o->unit;
        char name[80];
        snprintf(name, sizeof name, "%.*s", tab ? (int)(tab - text) : 0, text);
        if (put && tab)
            drape_overlay_text(o, left, y, DRAPE_LEFT, drape_faint, name);
        count += put_wrapped(o, tab ? left + TAB * o->unit : left, y, right, put ? drape_ink : NULL,
                             tab ? tab + 1 : text);
    }
    return count;
}

/* ---- One panel ---- */

float drape_painter_aspect(const drape_painter *painter, const drape_picture *picture)
{
    const rectangle b = inner_of(&painter->overlay, picture, 0);
    return (float)b.width / (float)b.height;
}

drape_view drape_painter_view(const drape_painter *painter, const drape_picture *picture, int panel)
{
    const rectangle inner = inner_of(&painter->overlay, picture, panel);
    const rectangle whole = whole_of(&painter->overlay, picture, panel);
    float left = (float)(inner.left - whole.left), right = left + (float)inner.width;
    const float low[2] = {2 * left / (float)whole.width - 1, -1};
    const float high[2] = {2 * right / (float)whole.width - 1, 1};
    drape_view view = drape_camera_view(&picture->camera, (float)inner.width / (float)inner.height,
                                        picture->panels[panel].stage->radius);
    drape_view_widen(&view, low, high);
    return view;
}

/* The quantities common to everything drawn in a panel. */
typedef struct panel_view {
    drape_view view;
    drape_lighting_view light; /* of the lamp, and of the panel's place */
    float window[3];           /* direction to a window opposite it */
    bool first;                /* of the picture */
    float clear, reach;        /* of the shading; length of a refracted ray [m] */
    GLuint behind;             /* texture of the picture without cloth; 0: none */
} panel_view;

static void set_lamp(const drape_stage *stage, panel_view *v)
{
    const drape_camera camera = {.azimuth = LAMP_AZIMUTH, .elevation = LAMP_HEIGHT};
    drape_view lamp = drape_camera_view(&camera, 1, 1);
    drape_lighting_view *l = &v->light;
    float reach = stage->radius, near = 0.1f * reach, far = 4 * DEEP * reach, eye[3];
    memcpy(l->right, lamp.axes[0], sizeof l->right);
    memcpy(l->up, lamp.axes[1], sizeof l->up);
    memcpy(l->light, lamp.axes[2], sizeof l->light);
    memcpy(v->window, (const float[]){-l->light[0], 0.3f, -l->light[2]}, sizeof v->window);
    drape_normalize(v->window);
    for (int k = 0; k < 3; k++)
        eye[k] = stage->center[k] + DEEP * reach * l->light[k];
    drape_matrix look = drape_look((const float(*)[3])lamp.axes, eye);
    drape_matrix box = drape_orthographic(SHADOW_REACH * reach, near, far);
    l->lamp = drape_multiply(&box, &look);
    l->width = 2 * SHADOW_REACH * reach;
    l->range = far - near;
    l->radius = reach;
    l->scale = (float)l->panel_height / (2 * v->view.ty);
}

static void set_box(GLuint program, const char *name, const panel_view *v)
{
    glUniform4f(glGetUniformLocation(program, name), (float)v->light.left, (float)v->light.bottom,
                (float)v->light.panel_width, (float)v->light.panel_height);
}

/* Sets the uniforms and textures that all programs of surfaces share. */
static void use_surface(const drape_painter *p, GLuint program, const panel_view *v, const drape_matrix *view)
{
    static const float nowhere[3] = {0};
    const drape_gl_unit units[] = {
        {"visible", p->lighting.result}, {"picture", p->textures[0]}, {"heights", p->textures[1]},
        {"environment", p->textures[2]}, {"ramp", p->ramp},           {"behind", v->behind}};
    drape_gl_use(program, units, sizeof units / sizeof *units);
    drape_gl_set_matrix(program, "view", view->m);
    drape_gl_set_vec3(program, "eye", v->view.eye);
    drape_gl_set_vec3(program, "light", v->light.light);
    drape_gl_set_vec3(program, "window", v->window);
    drape_gl_set_vec3(program, "offset", nowhere);
    drape_gl_set_matrix3(program, "turn", unturned);
    drape_gl_set_float(program, "clear", v->clear);
    drape_gl_set_float(program, "reach", v->reach);
    drape_gl_set_vec2(program, "pixels", (float)p->canvas.width, (float)p->canvas.height);
    set_box(program, "panel", v);
    drape_gl_set_float(program, "relief", 0);
    drape_gl_set_float(program, "spread", 1);
}

static void draw_bodies(const drape_stage *stage, GLuint program, bool endless)
{
    for (int32_t c = 0; c < stage->body_count; c++) {
        const drape_stage_body *body = &stage->bodies[c];
        if (body->shape.endless != endless)
            continue;
        drape_gl_set_vec3(program, "offset", body->offset);
        drape_gl_set_matrix3(program, "turn", body->turn);
        glBindVertexArray(body->mesh.array);
        glDrawArrays(GL_TRIANGLES, 0, (GLsizei)body->shape.vertex_count);
    }
}

/* The height map is filtered to the distance of the vertices: the mesh cannot show anything finer. */
static void draw_cloth(GLuint program, const drape_stage *stage, const drape_shading *shading)
{
    float side = (float)stage->model->length / 1.4142f;
    drape_gl_set_float(program, "relief", shading->displaced ? RELIEF * side : 0);
    drape_gl_set_float(program, "grain", stage->skin.edge / (float)stage->skin.level / side);
    glBindVertexArray(stage->cloth.array);
    glDrawElements(GL_TRIANGLES, stage->cloth.index_count, GL_UNSIGNED_INT, NULL);
    if (shading->wires)
        return;
    drape_gl_set_float(program, "relief", 0);
    glBindVertexArray(stage->hem.array);
    glDrawElements(GL_TRIANGLES, stage->hem.index_count, GL_UNSIGNED_INT, NULL);
}

/* Endless colliders; if there are none, a floor that shows the shadow. */
static void draw_ground(const drape_painter *p, const drape_stage *stage, GLuint program, const panel_view *v)
{
    use_surface(p, program, v, &v->view.matrix);
    drape_gl_set_vec3(program, "center", stage->center);
    drape_gl_set_float(program, "radius", stage->radius);
    drape_gl_set_float(program, "solid", stage->has_ground);
    set_box(program, "box", v);
    glEnable(GL_CULL_FACE);
    draw_bodies(stage, program, true);
    if (!stage->has_ground) {
        drape_gl_set_float(program, "spread", 3.5f * stage->radius);
        drape_gl_set_matrix3(program, "turn", unturned);
        drape_gl_set_vec3(program, "offset",
                          (const float[]){stage->center[0], stage->floor, stage->center[2]});
        glBindVertexArray(p->floor.array);
        glDrawArrays(GL_TRIANGLES, 0, 6);
    }
    glDisable(GL_CULL_FACE);
}

static void draw_bounded(const drape_painter *p, const drape_stage *stage, GLuint program,
                         const panel_view *v)
{
    use_surface(p, program, v, &v->view.matrix);
    glEnable(GL_CULL_FACE);
    draw_bodies(stage, program, false);
    glDisable(GL_CULL_FACE);
}

/* Finds the light that reaches what is seen, with cloth or without. The floor casts no shadow. */
static void light_panel(const drape_painter *p, const drape_stage *stage, const drape_shading *shading,
                        const panel_view *v, bool with_cloth)
{
    drape_lighting_begin_shadow(&p->lighting);
    use_surface(p, p->depth, v, &v->light.lamp);
    draw_bodies(stage, p->depth, false);
    drape_gl_set_vec3(p->depth, "offset", (const float[3]){0});
    drape_gl_set_matrix3(p->depth, "turn", unturned);
    draw_cloth(p->depth, stage, shading);
    drape_lighting_begin_seen(&p->lighting, &v->light);
    if (with_cloth) {
        use_surface(p, p->seen, v, &v->view.matrix);
        draw_cloth(p->seen, stage, shading);
    }
    draw_bounded(p, stage, p->seen, v);
    draw_ground(p, stage, p->seen, v);
    drape_lighting_find(&p->lighting, &v->light);
}

static void use_canvas(const drape_painter *p, const panel_view *v)
{
    glBindFramebuffer(GL_FRAMEBUFFER, p->canvas.many);
    glViewport(v->light.left, v->light.bottom, v->light.panel_width, v->light.panel_height);
}

static void draw_wires(const drape_painter *p, const drape_stage *stage, const drape_camera *camera,
                       const panel_view *v)
{
    /* the mean edge in pixels at the camera's distance */
    float edge = stage->skin.edge / (2 * camera->distance * v->view.ty) * (float)v->light.panel_height;
    float width = fminf(WIRE * p->overlay.unit, WIRE_SHARE * edge);
    const float thin = fminf(1, width); /* lines thinner than a pixel are drawn fainter */
    glEnable(GL_BLEND);
    glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
    glUseProgram(p->wire);
    drape_gl_set_matrix(p->wire, "view", v->view.matrix.m);
    drape_gl_set_vec3(p->wire, "eye", v->view.eye);
    drape_gl_set_vec2(p->wire, "size", (float)v->light.panel_width, (float)v->light.panel_height);
    drape_gl_set_float(p->wire, "width", fmaxf(1, width));
    glUniform4f(glGetUniformLocation(p->wire, "ink"), 0.80f, 0.11f, 0.10f, thin);
    glBindVertexArray(stage->wires.array);
    glDrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, (GLsizei)stage->wire_count);
    glEnable(GL_PROGRAM_POINT_SIZE);
    glUseProgram(p->pin);
    drape_gl_set_matrix(p->pin, "view", v->view.matrix.m);
    drape_gl_set_vec3(p->pin, "eye", v->view.eye);
    drape_gl_set_float(p->pin, "width", PIN * p->overlay.unit);
    glBindVertexArray(stage->pins.array);
    glDrawArrays(GL_POINTS, 0, (GLsizei)stage->pin_count);
    glDisable(GL_BLEND);
}

static void draw_shaded(drape_painter *p, const drape_picture *picture, const drape_stage *stage,
                        GLuint program, const panel_view *v)
{
    use_surface(p, program, v, &v->view.matrix);
    drape_gl_set_vec2(program, "range", (float)picture->low, (float)picture->high);
    draw_cloth(program, stage, picture->shading);
}

/* Cloth first, as what it hides is not shaded then; unless it is transparent. */
static void draw_scene(drape_painter *p, const drape_picture *picture, const drape_stage *stage,
                       GLuint program, panel_view *v)
{
    const drape_shading *shading = picture->shading;
    bool transparent = shading->reads & DRAPE_READS_BEHIND;
    light_panel(p, stage, shading, v, !transparent);
    if (v->first) /* after the light: leaving a cleared canvas would store and load it */
        drape_canvas_begin(&p->canvas);
    use_canvas(p, v);
    if (!transparent)
        draw_shaded(p, picture, stage, program, v);
    draw_bounded(p, stage, p->body, v);
    draw_ground(p, stage, p->ground, v);
    /* The background, wherever nothing else was drawn. */
    glUseProgram(p->wall);
    set_box(p->wall, "box", v);
    glBindVertexArray(p->empty);
    glDepthFunc(GL_LEQUAL);
    glDrawArrays(GL_TRIANGLES, 0, 3);
    if (!transparent)
        return;
    v->behind = drape_canvas_copy(&p->canvas);
    light_panel(p, stage, shading, v, true);
    use_canvas(p, v);
    draw_shaded(p, picture, stage, program, v);
}

static drape_status draw_panel(drape_painter *p, const drape_picture *picture, int index)
{
    const drape_panel *panel = &picture->panels[index];
    const drape_shading *shading = picture->shading;
    drape_stage *stage = panel->stage;
    int number = 0;
    while (number + 1 < MAX_SHADINGS && drape_shadings[number] && drape_shadings[number] != shading)
        number++;
    if (!p->shadings[number]) /* compiled when it is first used, as drivers are slow at it */
        p->shadings[number] = surface_program(p->ctx, shading->entry.name,
                                              (const char *const[]){shading->source, surface_main, NULL});
    GLuint program = p->shadings[number];
    const rectangle whole = whole_of(&p->overlay, picture, index);
    panel_view v = {.light = {.left = whole.left,
                              .bottom = whole.bottom,
                              .panel_width = whole.width,
                              .panel_height = whole.height},
                    .first = index == 0,
                    .clear = shading->clear,
                    .reach = REFRACTED * stage->radius};
    drape_status status = program ? DRAPE_OK : DRAPE_E_FILE;
    for (int i = 0; i < 3 && !status; i++)
        if (shading->reads & 1 << i && !p->textures[i])
            status = drape_texture(p->ctx, (drape_texture_kind)i, NULL, &p->textures[i]);
    if (status)
        return status;
    v.view = drape_painter_view(p, picture, index);
    set_lamp(stage, &v);
    drape_stage_set(stage, &panel->moment, shading->wires);
    draw_scene(p, picture, stage, program, &v);
    if (shading->wires)
        draw_wires(p, stage, &picture->camera, &v);
    return DRAPE_OK;
}

/* ---- The picture ---- */

drape_status drape_painter_draw(drape_painter *painter, const drape_picture *picture)
{
    drape_status status = DRAPE_OK;
    glDisable(GL_SCISSOR_TEST);
    for (int i = 0; i < picture->panel_count && !status; i++)
        status = draw_panel(painter, picture, i);
    if (status)
        return status;
    glViewport(0, 0, painter->canvas.width, painter->canvas.height);
    const drape_field_ops *field = picture->shading->field;
    drape_overlay *o = &painter->overlay;
    const float u = o->unit, width = (float)o->width, height = (float)o->height;
    if (field) {
        char title[80];
        legend_title(picture->shading, title, sizeof title);
        drape_overlay_legend(o, width - 22 * u, height - 26 * u,
                             fminf(fmaxf(0.36f * height, LEGEND * u), 0.6f * height), title,
                             field->shown * picture->low, field->shown * picture->high);
    }
    put_labels(o, picture);
    if (picture->lines && picture->lines[0]) { /* on a translucent ground, to be readable over cloth too */
        const float wide = picture->column > 0 ? picture->column : width;
        drape_overlay_box(o, 10 * u, 9 * u, wide - 4 * u,
                          ((float)put_lines(o, picture, false) * LINE + 12) * u, veil);
        put_lines(o, picture, true);
    }
    if (picture->caption)
        drape_overlay_text(o, MARGIN * u, height - 22 * u, DRAPE_LEFT, drape_faint, picture->caption);
    drape_overlay_draw(o);
    glFlush(); /* the driver draws while the caller goes on */
    return drape_gl_check(painter->ctx, "draw a picture");
}
