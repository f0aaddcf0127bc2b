/* collider_animated_mesh.c: a triangle mesh whose points move from frame to frame, closed or open. As those
 * of collider_mesh.c, its triangles are in contact with the nodes of the cloth, instead of its distance,
 * which only says what is inside. */
#include "colliders/colliders.h"

#include "base/vec3.h"
#include "geometry/mesh_distance.h"

#include <stdio.h>
#include <string.h>

/* places of the values; a text has one, too */
enum {
    FRAMES_FILE,
    MESH_FILE,
    TIMES_FILE,
    FRAME_RATE,
    START,
    OPEN,
    THICKNESS,
    TRANSLATE,
    ROTATE = TRANSLATE + 3,
    SCALE = ROTATE + 3
};

static const drape_param params[] = {
    DRAPE_TEXT(
        "file",
        "the frames, relative to the scene: an NPY or PC2 file; a GLB file with an animation; a folder "
        "of OBJ files, with a / at its end, or their pattern, such as walk_%04d.obj; or one OBJ "
        "file, for a program that moves its points"),
    DRAPE_TEXT("mesh", "OBJ or PLY file of the triangles, for frames without, such as NPY and PC2",
               .derived = "the triangles of the frames"),
    DRAPE_TEXT("times", "NPY file of the time of each frame [s], which the start is added to",
               .derived = "the start and the frame rate"),
    DRAPE_NUMBER("frame_rate", "1/s", 30, DRAPE_ABOVE(0), 1e6,
                 "frames per second of simulated time; a GLB file is sampled at it"),
    DRAPE_NUMBER("start", "s", 0, -1e9, 1e9,
                 "time of the first frame, of a GLB file time 0 of its animation; before it and after the "
                 "last one, the mesh is at rest"),
    DRAPE_BOOLEAN("open", 0,
                  "the mesh has a boundary, or no inside: cloth is kept on the side on which it begins"),
    DRAPE_NUMBER(
        "thickness", "m", 0, 0, 1e3,
        "distance of the surface that cloth meets from the triangles, on both sides of an open mesh"),
    DRAPE_SHAPE_TRANSFORM_PARAMS,
};

/* Positions are checked before and after the transform: what is wrong in a file is reported there. */
static drape_status read_frames(const double *values, drape_collider_shape *shape, drape_mesh *mesh,
                                drape_sequence *frames)
{
    const struct drape_shape_builder *builder = shape->builder;
    const drape_sequence_def def = {.file = drape_shape_text(shape, "file"),
                                    .mesh = drape_shape_text(shape, "mesh"),
                                    .times = drape_shape_text(shape, "times"),
                                    .rate = values[FRAME_RATE],
                                    .start = values[START]};
    char at[sizeof builder->ctx->pointer];
    snprintf(at, sizeof at, "%s/file", builder->pointer);
    const drape_mesh_source file = {.pointer = at, .file = def.file},
                            first = {.pointer = at, .file = def.file, .part = "frame 0: "},
                            transformed = {.pointer = builder->pointer};
    drape_status status =
        drape_sequence_read(builder->arena, builder->pointer, builder->folder, &def, mesh, frames);
    if (!status)
        status = drape_mesh_validate_positions(builder->ctx, &first, mesh);
    if (!status)
        status = drape_shape_check_mesh(builder->ctx, &file, values[OPEN] == 0, mesh);
    if (!status)
        status = drape_sequence_validate(builder->ctx, &file, mesh, frames);
    for (int32_t f = 1; !status && values[OPEN] == 0 && f < frames->frame_count; f++) {
        /* a body that turned inside out between two frames would hold the cloth that is outside */
        char part[32];
        snprintf(part, sizeof part, "frame %d: ", (int)f);
        const drape_mesh_source source = {.pointer = at, .file = def.file, .part = part};
        drape_mesh frame = *mesh;
        frame.x = frames->x + 3 * (size_t)f * (size_t)mesh->node_count;
        status = drape_shape_check_volume(builder->ctx, &source, &frame);
    }
    if (status)
        return status;
    const double *turn = values + ROTATE, rotate[4] = {turn[0], turn[1], turn[2], vec3_norm(turn)};
    for (int32_t f = 0; f < frames->frame_count; f++) {
        drape_mesh frame = {.node_count = mesh->node_count,
                            .x = frames->x + 3 * (size_t)f * (size_t)mesh->node_count};
        drape_mesh_transform(&frame, values + SCALE, rotate, values + TRANSLATE);
    }
    memcpy(mesh->x, frames->x, 3 * (size_t)mesh->node_count * sizeof *mesh->x);
    return drape_sequence_validate(builder->ctx, &transformed, mesh, frames);
}

static drape_status make_shape(const double *values, double tolerance, drape_collider_shape *shape)
{
    drape_mesh mesh = {0};
    (void)tolerance;
    drape_status status = read_frames(values, shape, &mesh, &shape->builder->frames);
    if (!status)
        status = drape_shape_copy_mesh(&mesh, shape);
    drape_mesh_free(&mesh);
    if (status)
        return status;
    shape->radius = values[THICKNESS];
    shape->kept = drape_mesh_distance_create(shape->builder->arena, shape,
                                             values[OPEN] != 0 ? DRAPE_SIDE_NONE : DRAPE_SIDE_WINDING);
    return shape->kept ? DRAPE_OK : DRAPE_E_MEMORY;
}

static double distance(const double *values, const drape_collider_shape *shape, const double *x,
                       double *normal, double *curvature)
{
    return drape_mesh_distance_at(shape->kept, shape, x, normal, curvature) - values[THICKNESS];
}

const drape_collider_ops drape_collider_animated_mesh = {
    .struct_size = sizeof(drape_collider_ops),
    .entry = {.name = "animated_mesh",
              .summary = "a closed or open triangle mesh that moves from frame to frame, or that a program "
                         "moves",
              .reference = "Jacobson et al. 2013: the inside of closed meshes by winding numbers; Baerentzen "
                           "and Aanaes 2005: normals at edges and points",
              DRAPE_PARAMS(params)},
    .shape = make_shape,
    .distance = distance,
};
