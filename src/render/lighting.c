/* lighting.c: see lighting.h. */
#include "render/lighting.h"

#define SHADOW       1024  /* texels along a side of the shadow map */
#define SHARE        2     /* pixels of the picture along a side of one here */
#define LAMP_SIZE    0.11f /* tangent of half the angle that the lamp is seen at */
#define WIDEST       0.14f /* largest half width of a penumbra, in radii of the stage */
#define NEAR_REACH   0.30f /* distance within which room light is held off, in radii of the stage */
#define WIDEST_REACH 0.16f /* the same in heights of the panel, at most */
#define SIDES(x)     #x
#define TEXT(x)      SIDES(x)
/* Lines of GLSL. */
#define PIXEL "    vec2 at = gl_FragCoord.xy / " TEXT(SHARE) ".0 - 0.5, low = floor(at), f = at - low;\n"
#define TEXEL "const float TEXEL = 1.0 / " TEXT(SHADOW) ".0;\n"

const char drape_lighting_seen_source[] = "in vec3 place, normal;\n"
                                          "uniform vec3 eye;\n"
                                          "layout(location = 0) out vec4 point;\n"
                                          "layout(location = 1) out vec4 facing;\n"
                                          "void main() {\n"
                                          "    vec3 n = normalize(normal), v = eye - place;\n"
                                          "    point = vec4(place, length(v));\n"
                                          "    facing = vec4(dot(n, v) < 0.0 ? -n : n, 0.0);\n"
                                          "}\n";

const char drape_lighting_lookup_source[] =
    "uniform sampler2D visible;\n"
    "// Between the four nearest pixels of the result, by how near they are and whether they show the same "
    "surface.\n"
    "vec2 lighting(vec3 place) {\n"
    "    float d = length(eye - place);\n" PIXEL "    ivec2 last = textureSize(visible, 0) - 1;\n"
    "    vec3 sum = vec3(0.0);\n"
    "    for (int i = 0; i < 4; i++) {\n"
    "        vec2 o = vec2(i & 1, i >> 1), b = mix(1.0 - f, f, o);\n"
    "        vec3 q = texelFetch(visible, clamp(ivec2(low + o), ivec2(0), last), 0).xyz;\n"
    "        float w = (b.x * b.y + 0.01) / (1e-4 + abs(q.z / d - 1.0));\n"
    "        sum += w * vec3(q.xy, 1.0);\n"
    "    }\n"
    "    return sum.xy / sum.z;\n"
    "}\n";

static const char screen_vertex[] =
    "void main() {\n"
    "    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);\n"
    "}\n";

static const char find_source[] =
    "uniform sampler2D places, normals, depths;\n"
    "uniform mat4 lamp;\n"
    "uniform vec3 right, up, light;\n"
    "uniform float width, range, size, widest, reach, scale, widest_reach;\n"
    "uniform ivec4 panel; // left, bottom, right, top\n"
    "out vec4 found;\n" TEXEL "\n"
    "// Point i of n on a disc (Vogel 1979), turned.\n"
    "vec2 disc(int i, int n, float turn, float shift) {\n"
    "    float a = 2.39996323 * float(i) + turn;\n"
    "    return sqrt((float(i) + shift) / float(n)) * vec2(cos(a), sin(a));\n"
    "}\n"
    "\n"
    "// The visible part of the lamp. The mean depth of what holds its light off says how far the penumbra "
    "reaches.\n"
    "float sunlight(vec3 p, vec3 n, float turn, float shift) {\n"
    "    float facing = dot(n, light);\n"
    "    if (facing <= 0.0) return 0.0;\n"
    "    vec3 s = (lamp * vec4(p + n * width * TEXEL * (0.6 + 1.6 * (1.0 - facing)), 1.0)).xyz * 0.5 + 0.5;\n"
    "    if (any(lessThan(s, vec3(0.0))) || any(greaterThan(s, vec3(1.0)))) return 1.0;\n"
    "    vec2 slope = vec2(dot(n, right), dot(n, up)) / max(facing, 0.2) * width / range;\n"
    "    float bias = 0.7 * width * TEXEL / range, blocked = 0.0, count = 0.0;\n"
    "    for (int i = 0; i < 10; i++) {\n"
    "        vec2 o = widest / width * disc(i, 10, turn, shift);\n"
    "        float d = textureLod(depths, s.xy + o, 0.0).r, z = s.z + dot(slope, o) - bias * "
    "(1.0 + 0.3 * length(o) / TEXEL);\n"
    "        if (d < z) { blocked += d; count += 1.0; }\n"
    "    }\n"
    "    if (count == 0.0) return 1.0;\n"
    "    float away = (s.z - blocked / count) * range, r = clamp(size * away, 1.3 * width * "
    "TEXEL, widest) / width, lit = 0.0;\n"
    "    for (int i = 0; i < 12; i++) {\n"
    "        vec2 o = r * disc(i, 12, turn, shift);\n"
    "        float d = textureLod(depths, s.xy + o, 0.0).r, z = s.z + dot(slope, o) - bias * "
    "(1.0 + 0.3 * length(o) / TEXEL);\n"
    "        lit += d < z ? 0.0 : 1.0;\n"
    "    }\n"
    "    return lit / 12.0;\n"
    "}\n"
    "\n"
    "// The part of the room that is not hidden by points within reach.\n"
    "float open_part(vec4 p, vec3 n, float turn, float shift) {\n"
    "    float pixels = min(reach * scale / p.w, widest_reach), square = reach * reach, hidden = 0.0;\n"
    "    for (int i = 0; i < 14; i++) {\n"
    "        vec2 o = disc(i, 14, turn, shift);\n"
    "        vec4 q = texelFetch(places, clamp(ivec2(gl_FragCoord.xy + pixels * length(o) * o), "
    "panel.xy, panel.zw), 0);\n"
    "        vec3 v = q.xyz - p.xyz;\n"
    "        float vv = dot(v, v);\n"
    "        hidden += max(0.0, 1.0 - vv / square) * max(0.0, dot(v, n) * inversesqrt(vv + 1e-12) - 0.10);\n"
    "    }\n"
    "    return clamp(1.0 - 2.3 * hidden / 14.0, 0.0, 1.0);\n"
    "}\n"
    "\n"
    "void main() {\n"
    "    ivec2 at = ivec2(gl_FragCoord.xy);\n"
    "    vec4 p = texelFetch(places, at, 0);\n"
    "    vec3 n = texelFetch(normals, at, 0).xyz;\n"
    "    found = vec4(1.0, 1.0, p.w, 0.0);\n"
    "    if (p.w > 1e8) return;\n"
    "    int k = (at.x & 3) * 4 + (at.y & 3);\n"
    "    float turn = float((k * 7) & 15) * 0.39269908, shift = 0.1 + 0.05 * float((k * 11 + 5) & 15);\n"
    "    found.x = sunlight(p.xyz, n, turn, shift);\n"
    "    found.y = open_part(p, n, turn, shift);\n"
    "}\n";

static const char average_source[] =
    "uniform sampler2D raw, places, normals;\n"
    "uniform ivec4 panel;\n"
    "uniform float scale;\n"
    "out vec4 found;\n"
    "void main() {\n"
    "    ivec2 at = ivec2(gl_FragCoord.xy);\n"
    "    vec4 p = texelFetch(places, at, 0);\n"
    "    vec3 n = texelFetch(normals, at, 0).xyz, sum = vec3(0.0);\n"
    "    found = vec4(1.0, 1.0, p.w, 0.0);\n"
    "    if (p.w > 1e8) return;\n"
    "    float pixel = p.w / scale; // [m]\n"
    "    for (int i = 0; i < 16; i++) {\n"
    "        ivec2 to = clamp(at + ivec2((i & 3) - 1, (i >> 2) - 1), panel.xy, panel.zw);\n"
    "        float away = abs(dot(n, texelFetch(places, to, 0).xyz - p.xyz)) / pixel;\n"
    "        float w = max(1e-4, 1.0 - 0.4 * away);\n"
    "        sum += w * vec3(texelFetch(raw, to, 0).xy, 1.0);\n"
    "    }\n"
    "    found.xy = sum.xy / sum.z;\n"
    "}\n";

/* ---- Buffers ---- */

static GLuint texture(GLenum format, int width, int height, GLenum pixels, GLenum kind, GLenum attachment)
{
    const GLuint name =
        drape_gl_texture(format, width, height, pixels, kind, NULL, GL_NEAREST, GL_CLAMP_TO_EDGE);
    glFramebufferTexture2D(GL_FRAMEBUFFER, attachment, GL_TEXTURE_2D, name, 0);
    return name;
}

drape_status drape_lighting_create(drape_context *ctx, int width, int height, drape_lighting *v)
{
    const char *const vertex[] = {screen_vertex, NULL};
    *v = (drape_lighting){.width = (width + SHARE - 1) / SHARE, .height = (height + SHARE - 1) / SHARE};
    const int w = v->width, h = v->height;
    v->shadow_buffer = drape_gl_framebuffer();
    v->shadow = texture(GL_DEPTH_COMPONENT24, SHADOW, SHADOW, GL_DEPTH_COMPONENT, GL_UNSIGNED_INT,
                        GL_DEPTH_ATTACHMENT);
    glDrawBuffer(GL_NONE);
    glReadBuffer(GL_NONE);
    v->seen = drape_gl_framebuffer();
    v->place = texture(GL_RGBA32F, w, h, GL_RGBA, GL_FLOAT, GL_COLOR_ATTACHMENT0);
    v->normal = texture(GL_RGBA16F, w, h, GL_RGBA, GL_FLOAT, GL_COLOR_ATTACHMENT1);
    v->depth = drape_gl_buffer(0, GL_DEPTH_COMPONENT24, w, h, GL_DEPTH_ATTACHMENT);
    glDrawBuffers(2, (const GLenum[]){GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1});
    bool complete = glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    v->raw_buffer = drape_gl_framebuffer();
    v->raw = texture(GL_RGBA32F, w, h, GL_RGBA, GL_FLOAT, GL_COLOR_ATTACHMENT0);
    complete = complete && glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    v->result_buffer = drape_gl_framebuffer();
    v->result = texture(GL_RGBA32F, w, h, GL_RGBA, GL_FLOAT, GL_COLOR_ATTACHMENT0);
    complete = complete && glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    glGenVertexArrays(1, &v->empty);
    drape_status status = drape_gl_check(ctx, "make the buffers of light");
    if (!status && !complete)
        status = drape_fail(ctx, DRAPE_E_FILE, "OpenGL cannot draw into textures of floats");
    if (!status &&
        (!(v->find = drape_gl_program(ctx, "light", vertex, (const char *const[]){find_source, NULL})) ||
         !(v->average =
               drape_gl_program(ctx, "average", vertex, (const char *const[]){average_source, NULL}))))
        status = DRAPE_E_FILE;
    if (status)
        drape_lighting_free(v);
    return status;
}

void drape_lighting_free(drape_lighting *v)
{
    if (!v->width)
        return;
    const GLuint textures[] = {v->shadow, v->place, v->normal, v->raw, v->result};
    const GLuint buffers[] = {v->shadow_buffer, v->seen, v->raw_buffer, v->result_buffer};
    glDeleteTextures(sizeof textures / sizeof *textures, textures);
    glDeleteFramebuffers(sizeof buffers / sizeof *buffers, buffers);
    glDeleteRenderbuffers(1, &v->depth);
    glDeleteProgram(v->find);
    glDeleteProgram(v->average);
    glDeleteVertexArrays(1, &v->empty);
    *v = (drape_lighting){.width = 0};
}

/* ---- Drawing ---- */

void drape_lighting_begin_shadow(const drape_lighting *v)
{
    glBindFramebuffer(GL_FRAMEBUFFER, v->shadow_buffer);
    glViewport(0, 0, SHADOW, SHADOW);
    glDisable(GL_SCISSOR_TEST);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_LESS);
    glDepthMask(GL_TRUE);
    glClear(GL_DEPTH_BUFFER_BIT);
}

/* The panel in pixels of the buffers: left, bottom, right, top. */
static void set_panel(const drape_lighting_view *view, const drape_lighting *v, int *panel)
{
    panel[0] = view->left / SHARE;
    panel[1] = view->bottom / SHARE;
    panel[2] = (view->left + view->panel_width + SHARE - 1) / SHARE - 1;
    panel[3] = (view->bottom + view->panel_height + SHARE - 1) / SHARE - 1;
    panel[2] = panel[2] < v->width ? panel[2] : v->width - 1;
    panel[3] = panel[3] < v->height ? panel[3] : v->height - 1;
}

static void clip(const int *panel)
{
    glViewport(panel[0], panel[1], panel[2] - panel[0] + 1, panel[3] - panel[1] + 1);
    glScissor(panel[0], panel[1], panel[2] - panel[0] + 1, panel[3] - panel[1] + 1);
    glEnable(GL_SCISSOR_TEST);
}

void drape_lighting_begin_seen(const drape_lighting *v, const drape_lighting_view *view)
{
    int panel[4];
    glBindFramebuffer(GL_FRAMEBUFFER, v->seen);
    set_panel(view, v, panel);
    clip(panel);
    glEnable(GL_DEPTH_TEST);
    glDepthMask(GL_TRUE);
    glClearBufferfv(GL_COLOR, 0, (const float[]){0, 0, 0, 1e9f});
    glClearBufferfv(GL_COLOR, 1, (const float[]){0, 0, 0, 0});
    glClear(GL_DEPTH_BUFFER_BIT);
}

void drape_lighting_find(const drape_lighting *v, const drape_lighting_view *view)
{
    const drape_gl_unit find[] = {{"places", v->place}, {"normals", v->normal}, {"depths", v->shadow}},
                        average[] = {{"places", v->place}, {"normals", v->normal}, {"raw", v->raw}};
    const float scale = view->scale / SHARE;
    int panel[4];
    set_panel(view, v, panel);
    glBindVertexArray(v->empty);
    glDisable(GL_DEPTH_TEST);
    glBindFramebuffer(GL_FRAMEBUFFER, v->raw_buffer);
    clip(panel);
    drape_gl_use(v->find, find, 3);
    glUniform4iv(glGetUniformLocation(v->find, "panel"), 1, panel);
    drape_gl_set_matrix(v->find, "lamp", view->lamp.m);
    drape_gl_set_vec3(v->find, "right", view->right);
    drape_gl_set_vec3(v->find, "up", view->up);
    drape_gl_set_vec3(v->find, "light", view->light);
    drape_gl_set_float(v->find, "width", view->width);
    drape_gl_set_float(v->find, "range", view->range);
    drape_gl_set_float(v->find, "size", LAMP_SIZE);
    drape_gl_set_float(v->find, "widest", WIDEST * view->radius);
    drape_gl_set_float(v->find, "reach", NEAR_REACH * view->radius);
    drape_gl_set_float(v->find, "scale", scale);
    drape_gl_set_float(v->find, "widest_reach", WIDEST_REACH * (float)(panel[3] - panel[1] + 1));
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glBindFramebuffer(GL_FRAMEBUFFER, v->result_buffer);
    drape_gl_use(v->average, average, 3);
    glUniform4iv(glGetUniformLocation(v->average, "panel"), 1, panel);
    drape_gl_set_float(v->average, "scale", scale);
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glEnable(GL_DEPTH_TEST);
    glDisable(GL_SCISSOR_TEST);
}
