/* shading.c: see shading.h. */
#include "render/shading.h"

#include <string.h>

static const char inputs[] =
    "in vec3 place, normal, tangent;\n"
    "in vec2 at;\n"
    "in float value, piece;\n"
    "in vec4 shadow_at;\n"
    "out vec4 colour;\n"
    "uniform vec3 eye, light, window, front, back; // light, window: directions to them\n"
    "uniform vec2 range;\n"
    "uniform float relief, soft, texel_depth, clear, reach;\n"
    "uniform mat4 view;\n"
    "uniform vec4 panel;  // left, bottom, width, height, in pixels\n"
    "uniform vec2 pixels; // of the whole picture\n"
    "uniform sampler2DShadow shadow_map;\n"
    "uniform sampler2D picture, heights, environment, ramp, behind;\n"
    "const float PI = 3.14159265;\n"
    "\n"
    "struct Surface {\n"
    "    vec3 p, n, t, v;    // point, normal on the eye's side, tangent along u, direction to the eye\n"
    "    vec2 at;            // texture coordinates\n"
    "    float value, piece; // of the field; number of the cloth\n"
    "    float sun;          // how much of the lamp reaches it\n"
    "    float side;         // 1: the front is seen, -1: the back\n"
    "};\n";

static const char lights[] =
    "// The visible part of the lamp: four samples around the point, each interpolated between four texels.\n"
    "float sunlight(vec4 q, float facing) {\n"
    "    vec3 s = q.xyz * 0.5 + 0.5;\n"
    "    if (facing <= 0.0) return 0.0;\n"
    "    s.z -= texel_depth * (1.0 + 3.5 * min(sqrt(1.0 - facing * facing) / facing, 12.0));\n"
    "    if (any(lessThan(s, vec3(0.0))) || any(greaterThan(s, vec3(1.0)))) return 1.0;\n"
    "    vec2 a = soft * vec2(0.94, 0.34), b = soft * vec2(-0.34, 0.94);\n"
    "    float lit = 0.25 * (texture(shadow_map, vec3(s.xy + a, s.z)) + texture(shadow_map, vec3(s.xy - a, "
    "s.z)) +\n"
    "                        texture(shadow_map, vec3(s.xy + b, s.z)) + texture(shadow_map, vec3(s.xy - b, "
    "s.z)));\n"
    "    return mix(lit, 1.0, clear);\n"
    "}\n"
    "\n"
    "const vec3 LAMP = vec3(2.60, 2.46, 2.28);\n"
    "vec3 ambient(vec3 n) {\n"
    "    return mix(vec3(0.40, 0.37, 0.35), vec3(0.74, 0.80, 0.90), 0.5 + 0.5 * n.y) * 0.56;\n"
    "}\n"
    "\n"
    "// Light of the room and of a window opposite the lamp. Both stand still, so from every side some cloth "
    "is lit.\n"
    "vec3 room(vec3 n) { return ambient(n) + vec3(0.72, 0.80, 0.92) * max(0.0, dot(n, window)); }\n"
    "\n"
    "// Light that arrives at a matt surface: from the lamp, the room, and a little from the eye.\n"
    "vec3 arriving(Surface s, vec3 n) {\n"
    "    return LAMP * s.sun * max(0.0, dot(n, light)) + room(n) + 0.16 * max(0.0, dot(n, s.v));\n"
    "}\n"
    "vec3 arriving(Surface s) { return arriving(s, s.n); }\n"
    "\n"
    "// The base colour, different for each cloth.\n"
    "vec3 tint(Surface s) {\n"
    "    vec3 c = s.side > 0.0 ? front : back;\n"
    "    float k = mod(s.piece, 3.0);\n"
    "    return k < 0.5 ? c : k < 1.5 ? c.zyx : c.yzx;\n"
    "}\n";

static const char surroundings[] =
    "// The surroundings in a direction; blur: 0 to 1.\n"
    "vec3 world(vec3 d, float blur) {\n"
    "    vec2 u = vec2(atan(d.x, d.z) / (2.0 * PI) + 0.5, asin(clamp(d.y, -1.0, 1.0)) / PI + 0.5);\n"
    "    return textureLod(environment, u, blur * 6.5).rgb;\n"
    "}\n"
    "\n"
    "// The picture without cloth where a point is seen.\n"
    "vec3 seen_at(vec3 p) {\n"
    "    vec4 q = view * vec4(p, 1.0);\n"
    "    vec2 at = panel.xy + clamp(q.xy / q.w * 0.5 + 0.5, 0.002, 0.998) * panel.zw;\n"
    "    vec3 c = textureLod(behind, at / pixels, 0.0).rgb;\n"
    "    return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(0.04045, c));\n"
    "}\n"
    "\n"
    "// The normal of the relief in the height map, from its slopes along the tangents. They are taken over "
    "at least\n"
    "// a pixel: finer details would flicker.\n"
    "vec3 bumped(Surface s, float height) {\n"
    "    vec2 d = vec2(max(1.0 / 1024.0, 0.6 * max(length(dFdx(s.at)), length(dFdy(s.at)))), 0.0);\n"
    "    float du = texture(heights, s.at + d).r - texture(heights, s.at - d).r;\n"
    "    float dv = texture(heights, s.at + d.yx).r - texture(heights, s.at - d.yx).r;\n"
    "    vec3 across = cross(s.n, s.t) * s.side;\n"
    "    return normalize(s.n - s.side * height / (2.0 * d.x) * (du * s.t + dv * across));\n"
    "}\n"
    "\n"
    "// The square of a roughness, increased by the spread of normals within a pixel (Tokuyoshi & Kaplanyan "
    "2019).\n"
    "float widened(float a2, vec3 n) {\n"
    "    vec3 x = dFdx(n), y = dFdy(n);\n"
    "    return min(1.0, a2 + min(0.5 * (dot(x, x) + dot(y, y)), 0.36));\n"
    "}\n"
    "\n"
    "// From linear RGB to sRGB (IEC 61966-2-1).\n"
    "vec3 encoded(vec3 c) {\n"
    "    c = clamp(c, 0.0, 1.0);\n"
    "    return mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c));\n"
    "}\n"
    "\n"
    "float power(float x, float k) { return pow(max(x, 0.0), k); }\n"
    "float schlick(float cosine, float f0) { return f0 + (1.0 - f0) * power(1.0 - cosine, 5.0); }\n";

const char *const drape_shading_prelude[] = {inputs, lights, surroundings, NULL};

/* The colours have to be readable, so light changes them little. */
const char drape_shading_field_source[] =
    "vec3 shade(Surface s) {\n"
    "    float x = clamp((s.value - range.x) / (range.y - range.x), 0.0, 1.0);\n"
    "    vec3 c = texture(ramp, vec2(x * 255.0 / 256.0 + 0.5 / 256.0, 0.5)).rgb;\n"
    "    float form = 0.70 + 0.22 * max(0.0, dot(s.n, s.v)) + 0.16 * s.sun * max(0.0, dot(s.n, light));\n"
    "    return c * min(form, 1.06);\n"
    "}\n";

const drape_shading *drape_shading_find(const char *name)
{
    for (int i = 0; drape_shadings[i]; i++)
        if (strcmp(drape_shadings[i]->name, name) == 0)
            return drape_shadings[i];
    return NULL;
}
