/* colliders.h: the table of colliders, and the points and the distance of a collider in a pose.
 *
 * A collider is the constant drape_collider_<name> of collider_<name>.c; its interface is drape/extend.h. */
#ifndef DRAPE_COLLIDERS_COLLIDERS_H
#define DRAPE_COLLIDERS_COLLIDERS_H

#include "model/model.h"

extern const drape_collider_ops *const drape_colliders[]; /* NULL-ended */
extern const drape_registry drape_collider_registry;

/* ---- Pose and distance ---- */

/* The pose of a collider on its tracks; at a key, velocities are those of the segment after it. */
drape_collider_pose drape_collider_pose_at(const drape_collider *collider, double t);

/* The position in space [m] and the velocity [m/s] of a point of its shape: all that follows the features of
 * colliders asks here. */
void drape_collider_point(const drape_collider *collider, const drape_collider_pose *pose, int32_t point,
                          double *x);
void drape_collider_point_velocity(const drape_collider *collider, const drape_collider_pose *pose,
                                   int32_t point, double *v);

/* Signed distance [m] of a point of space; normal (3) and curvature (3 x 3 [1/m]) as in drape_collider_ops,
 * but in space, NULL if they are not needed. */
double drape_collider_distance(const drape_collider *collider, const drape_collider_pose *pose,
                               const double *x, double *normal, double *curvature);

/* ---- Compiling a scene ---- */

struct drape_shape_builder {
    drape_context *ctx;
    drape_arena *arena;
    const char *pointer; /* of the collider: "/colliders/0" */
    const char *folder;  /* of relative files; NULL: the working directory */
    const drape_choice *choice;
    bool reserved;         /* the arrays of the shape have been taken */
    drape_sequence frames; /* of a collider that deforms (drape_collider.frames) */
};

/* Parameters that several colliders have. */
#define DRAPE_SHAPE_ROTATE_PARAM                                                                             \
    DRAPE_TURN(                                                                                              \
        "rotate", 0, -1e6, 1e6,                                                                              \
        "axis and angle, or a vector along the axis whose length is the angle; about the center of a "       \
        "box, or the origin")
#define DRAPE_SHAPE_ROUNDING_PARAM                                                                           \
    DRAPE_NUMBER("rounding", "m", 0, 0, 1e9,                                                                 \
                 "radius of its edges and corners, or rims, below half of its smallest extent; its size "    \
                 "includes them")
#define DRAPE_SHAPE_END_PARAMS                                                                               \
    DRAPE_VECTOR("a", "m", DRAPE_REQUIRED, -1e9, 1e9, "center of one of the ends, flat or a hemisphere"),    \
        DRAPE_VECTOR("b", "m", DRAPE_REQUIRED, -1e9, 1e9, "center of the other one")
#define DRAPE_SHAPE_TRANSFORM_PARAMS                                                                         \
    DRAPE_VECTOR("translate", "m", 0, -1e9, 1e9, "applied last"), DRAPE_SHAPE_ROTATE_PARAM,                  \
        DRAPE_VECTOR("scale", "1", 1, DRAPE_ABOVE(0), 1e9, "applied first; one number: in all directions",   \
                     .uniform = true)

/* The text that the scene gives a parameter; NULL: none. */
const char *drape_shape_text(const drape_collider_shape *shape, const char *parameter);

/* Checks a mesh as a surface, and finds its edges; closed: as that of a solid, with triangles
 * counterclockwise from outside. */
drape_status drape_shape_check_mesh(drape_context *ctx, const drape_mesh_source *source, bool closed,
                                    drape_mesh *mesh);

/* Whether the volume inside a closed mesh is positive. Errors: DRAPE_E_ARGUMENT. */
drape_status drape_shape_check_volume(drape_context *ctx, const drape_mesh_source *source,
                                      const drape_mesh *mesh);

/* Makes the nodes, edges and triangles of a mesh the parts of a shape. Errors: DRAPE_E_MEMORY. */
drape_status drape_shape_copy_mesh(const drape_mesh *mesh, drape_collider_shape *shape);

/* Resolves the parameters and makes the shape of a collider whose ops and choice are set; tolerance as in
 * drape_collider_ops. Errors are reported at pointer or below it. */
drape_status drape_collider_build(drape_context *ctx, drape_arena *arena, const char *pointer,
                                  const char *folder, double tolerance, drape_collider *collider);

#endif
