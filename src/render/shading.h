/*
 * shading.h: the shadings, which colour cloth. A shading is the constant drape_shading_<name> of
 * shade_<name>.c with a function `vec3 shade(Surface s)` in GLSL that returns linear RGB; shading.c has the
 * functions that all of them share.
 */
#ifndef DRAPE_RENDER_SHADING_H
#define DRAPE_RENDER_SHADING_H

#include "fields/fields.h"

/* Textures that a shading reads; they are made when a shading that reads them is first drawn. BEHIND is the
 * picture without cloth: cloth is then drawn last. */
enum {
    DRAPE_READS_PATTERN = 1,
    DRAPE_READS_HEIGHTS = 2,
    DRAPE_READS_ENVIRONMENT = 4,
    DRAPE_READS_BEHIND = 8
};

typedef struct drape_shading {
    drape_entry entry;
    const char *source;           /* GLSL */
    const drape_field_ops *field; /* shown in colours; NULL: none */
    int reads;                    /* sum of DRAPE_READS_* */
    bool wires;                   /* the edges of the mesh and the pinned nodes are drawn as well */
    bool displaced;               /* vertices are moved along their normals by the height map */
    float clear; /* share of the lamp's light that passes through, which lightens the shadow */
} drape_shading;

extern const drape_shading *const drape_shadings[]; /* NULL-ended */
extern const drape_registry drape_shading_registry;

/* GLSL that all surfaces share: the data of a point, light, shadow and surroundings. NULL-ended. */
extern const char *const drape_shading_prelude[];

/* The GLSL that colours fields. */
extern const char drape_shading_field_source[];

/* Defines the shading of the same name as a field. */
#define DRAPE_FIELD_SHADING(id)                                                                              \
    extern const drape_field_ops drape_field_##id;                                                           \
    const drape_shading drape_shading_##id = {                                                               \
        .entry = {.name = #id, .summary = "in colours with a legend: the field of this name"},               \
        .source = drape_shading_field_source,                                                                \
        .field = &drape_field_##id,                                                                          \
    }

#endif
