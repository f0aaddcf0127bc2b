/* shape.c: the functions for making the shape of a collider: refusing values, and taking memory. */
#include "colliders/colliders.h"

#include <stdarg.h>
#include <stdio.h>

drape_status drape_shape_refuse(drape_collider_shape *shape, const char *parameter, const char *format, ...)
{
    char at[sizeof shape->builder->ctx->pointer], text[512];
    va_list args;
    locale_t old = drape_locale_enter();
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    drape_locale_leave(old);
    snprintf(at, sizeof at, "%s/%s", shape->builder->pointer, parameter);
    return drape_fail_at(shape->builder->ctx, DRAPE_E_ARGUMENT, at, "%s", text);
}

void *drape_shape_take(drape_collider_shape *shape, size_t count, size_t size)
{
    return drape_arena_take(shape->builder->arena, count, size);
}

drape_status drape_shape_reserve(drape_collider_shape *shape, int32_t points, int32_t segments,
                                 int32_t triangles)
{
    struct drape_shape_builder *builder = shape->builder;
    if (builder->reserved)
        return drape_fail_at(builder->ctx, DRAPE_E_ARGUMENT, builder->pointer,
                             "the shape announced its parts twice");
    if (points < 0 || segments < 0 || triangles < 0)
        return drape_fail_at(builder->ctx, DRAPE_E_ARGUMENT, builder->pointer,
                             "the shape announced %d points, %d segments, %d triangles; none may be negative",
                             (int)points, (int)segments, (int)triangles);
    builder->reserved = true;
    shape->point_count = points;
    shape->segment_count = segments;
    shape->triangle_count = triangles;
    shape->point = drape_shape_take(shape, (size_t)points, 3 * sizeof *shape->point);
    shape->segment = drape_shape_take(shape, (size_t)segments, 2 * sizeof *shape->segment);
    shape->triangle = drape_shape_take(shape, (size_t)triangles, 3 * sizeof *shape->triangle);
    return shape->point && shape->segment && shape->triangle ? DRAPE_OK : DRAPE_E_MEMORY;
}
