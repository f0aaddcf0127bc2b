/* collider_mesh.c: the solid inside of a closed triangle mesh. The normal of its distance jumps at edges, so
 * cloth nodes are in contact with its triangles instead of its distance function. */
#include "colliders/colliders.h"

#include "geometry/mesh_distance.h"

#include <math.h>

/* places of the values */
enum { FILE_NAME = 0, TRANSLATE = 1, ROTATE = 4, SCALE = 7, PARAM_COUNT = 4 };

static const drape_param params[PARAM_COUNT] = {
    DRAPE_TEXT("file", "OBJ or PLY file, relative to the scene: a closed mesh, its triangles "
                       "counterclockwise seen from outside"),
    DRAPE_SHAPE_TRANSFORM_PARAMS,
};

static drape_status make_shape(const double *values, double tolerance, drape_collider_shape *shape)
{
    (void)tolerance;
    drape_status status =
        drape_shape_read_mesh(shape, "file", values + SCALE, values + ROTATE, values + TRANSLATE);
    if (status)
        return status;
    shape->kept = drape_mesh_distance_create(shape->builder->arena, shape, DRAPE_SIDE_NORMAL);
    return shape->kept ? DRAPE_OK : DRAPE_E_MEMORY;
}

static double distance(const double *values, const drape_collider_shape *shape, const double *x,
                       double *normal, double *curvature)
{
    (void)values;
    return drape_mesh_distance_at(shape->kept, shape, x, normal, curvature);
}

const drape_collider_ops drape_collider_mesh = {
    .struct_size = sizeof(drape_collider_ops),
    .entry = {.name = "mesh",
              .summary = "the solid inside of a closed triangle mesh",
              .reference = "Baerentzen and Aanaes 2005: signed distance by angle-weighted pseudo-normals",
              DRAPE_PARAMS(params)},
    .shape = make_shape,
    .distance = distance,
};
