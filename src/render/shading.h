/*
 * shading.h: how cloth is coloured: the entries of one table. A shading is the constant drape_shading_<name> of
 * shade_<name>.c: a function `vec3 shade(Surface s)` in GLSL, in linear RGB, over what shading.c gives to all.
 */
#ifndef DRAPE_RENDER_SHADING_H
#define DRAPE_RENDER_SHADING_H

#include "fields/fields.h"

/* Textures that a shading reads: made when the first that does is drawn. Behind is the picture without cloth: cloth is
 * drawn last then. */
enum {
    DRAPE_READS_PATTERN = 1,
    DRAPE_READS_HEIGHTS = 2,
    DRAPE_READS_ENVIRONMENT = 4,
    DRAPE_READS_BEHIND = 8
};

typedef struct drape_shading {
    drape_entry entry;
    const char *source;           /* GLSL */
    const drape_field_ops *field; /* what is shown in colours; NULL: none */
    int reads;                    /* sum of DRAPE_READS_* */
    bool wires;                   /* the mesh's edges and the pinned nodes are drawn, too */
    bool displaced;               /* points are moved along their normals by the height map */
    float clear;                  /* share of the lamp's light that goes through: shadows are lighter */
} drape_shading;

extern const drape_shading *const drape_shadings[]; /* NULL-ended */
extern const drape_registry drape_shading_registry;

/* GLSL that all surfaces share: what is known of a point, light, shadow, the world around. NULL-ended. */
extern const char *const drape_shading_prelude[];

/* How fields are coloured. */
extern const char drape_shading_field_source[];

#endif
