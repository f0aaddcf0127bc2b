/*
 * build_start.c: the shape in which a cloth starts, if it is not at rest, and its initial velocities.
 *
 * A fold about the line through p with the unit direction e turns what is beyond it, in the direction d
 * across e. With n = e x d, a node has the coordinates s along d and z along n, relative to p. A sheet at z
 * = 0 is rolled onto the cylinder of radius r whose axis is at s = 0, z = +-r, by its arc length r |angle|;
 * the rest of it goes on along the tangent. What is at z keeps its distance from the sheet.
 */
#include "base/elementary.h"
#include "base/pi.h"
#include "base/vec3.h"
#include "compile/stages.h"
#include "mesh/contents.h"
#include "mesh/npy_array.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#define SAME_MESH                                                                                            \
    "; remedy: move the vertices of that mesh and write it again, with vertices and faces in the same order"

#define RADIANS (DRAPE_PI / 180)

/* ---- Positions ---- */

static drape_status take_file(drape_model *model, const char *pointer, const char *folder,
                              const drape_start_def *def, const drape_mesh *whole, double *x)
{
    const drape_mesh *mesh = drape_mesh_given(whole);
    const char *place = DRAPE_FORMAT("%s/file", pointer);
    const drape_mesh_source source = {.pointer = place, .file = def->file};
    drape_mesh read = {0};
    drape_status status = drape_mesh_read(model->ctx, place, folder, def->file, &read);
    if (!status && (read.node_count != mesh->node_count || read.triangle_count != mesh->triangle_count))
        status = drape_mesh_fail(model->ctx, &source, 0,
                                 "%d nodes and %d triangles; the mesh of the cloth has %d and %d" SAME_MESH,
                                 (int)read.node_count, (int)read.triangle_count, (int)mesh->node_count,
                                 (int)mesh->triangle_count);
    const bool same = !status && drape_faces_same(&read, mesh);
    for (int32_t t = 0; !status && !same && t < mesh->triangle_count; t++) {
        const int32_t *a = read.triangle + 3 * (size_t)t, *b = mesh->triangle + 3 * (size_t)t;
        if (memcmp(a, b, 3 * sizeof *a) != 0)
            status = drape_mesh_fail(
                model->ctx, &source, 0,
                "triangle %d has the nodes %d %d %d; in the mesh of the cloth it has %d %d %d" SAME_MESH,
                (int)t, (int)a[0], (int)a[1], (int)a[2], (int)b[0], (int)b[1], (int)b[2]);
    }
    if (!status)
        memcpy(x, read.x, 3 * (size_t)mesh->node_count * sizeof *x);
    if (!status)
        drape_mesh_fill_middles(whole, x);
    drape_mesh_free(&read);
    return status;
}

/* An array of the host, of 3 numbers for each node. */
static drape_status take_array(drape_model *model, const char *pointer, const char *what, const double *from,
                               size_t given, bool has_file, const drape_mesh *whole, double *to)
{
    const drape_mesh *mesh = drape_mesh_given(whole);
    const size_t count = 3 * (size_t)mesh->node_count;
    if (has_file)
        return drape_refuse(model->ctx, pointer, "a file and an array of %s are given; at most one is", what);
    if (given != count)
        return drape_refuse(model->ctx, pointer,
                            "%zu numbers in %s; the cloth has %d nodes, so there are %zu", given, what,
                            (int)mesh->node_count, count);
    memcpy(to, from, count * sizeof *to);
    drape_mesh_fill_middles(whole, to);
    return DRAPE_OK;
}

/* The line, as e, d and n. */
static drape_status fold_frame(drape_model *model, const char *pointer, const drape_fold_def *def,
                               double frame[3][3])
{
    double *e = frame[0], *d = frame[1];
    const double length = vec3_norm(def->axis);
    if (!(length > 0 && isfinite(length)))
        return drape_fail_below(model->ctx, pointer, "axis", "%g %g %g has no direction", def->axis[0],
                                def->axis[1], def->axis[2]);
    for (int k = 0; k < 3; k++)
        e[k] = def->axis[k] / length;
    memcpy(d, def->side, 3 * sizeof *d);
    vec3_add_scaled(-vec3_dot(e, d), e, d);
    const double across = vec3_norm(d);
    if (!(across > 1e-9 * vec3_norm(def->side) && isfinite(across)))
        return drape_fail_below(model->ctx, pointer, "side",
                                "%g %g %g does not point away from the axis, %g %g %g", def->side[0],
                                def->side[1], def->side[2], def->axis[0], def->axis[1], def->axis[2]);
    for (int k = 0; k < 3; k++)
        d[k] /= across;
    vec3_cross(e, d, frame[2]);
    return DRAPE_OK;
}

static drape_status fold(drape_model *model, const char *pointer, const drape_fold_def *def,
                         int32_t node_count, double *x)
{
    double frame[3][3], matrix[3][3];
    DRAPE_TRY(fold_frame(model, pointer, def, frame));
    const double *d = frame[1], *n = frame[2], sign = def->angle < 0 ? -1 : 1;
    const double rolled = def->radius * fabs(def->angle) * RADIANS; /* arc length */
    bool beyond = false;
    drape_rotation_matrix((const double[]){0, 0, 1, def->angle}, matrix);
    for (int32_t i = 0; i < node_count; i++) {
        double *at = x + 3 * (size_t)i, from[3];
        vec3_sub(at, def->point, from);
        const double s = vec3_dot(from, d), z = vec3_dot(from, n), above = z - sign * def->radius;
        const double further = fmax(s - rolled, 0);
        double sine = matrix[1][0], cosine = matrix[0][0];
        if (!(s > 0))
            continue;
        beyond = true;
        if (s < rolled)
            drape_sin_cos(sign * s / def->radius, &sine, &cosine);
        vec3_add_scaled(further * cosine - above * sine - s, d, at);
        vec3_add_scaled(sign * def->radius + further * sine + above * cosine - z, n, at);
    }
    if (!beyond)
        return drape_refuse(model->ctx, pointer,
                            "no node of the cloth lies beyond the line, on the side (%g %g %g): nothing is "
                            "folded",
                            def->side[0], def->side[1], def->side[2]);
    return DRAPE_OK;
}

static drape_status place_nodes(drape_model *model, const char *pointer, const char *folder,
                                const drape_start_def *def, const drape_mesh *mesh, double *x)
{
    drape_mesh moved = {.node_count = mesh->node_count,
                        .triangle_count = mesh->triangle_count,
                        .triangle = mesh->triangle,
                        .x = x};
    const drape_mesh_source source = {.pointer = pointer};
    DRAPE_TRY(drape_mesh_check_transform(model->ctx, pointer, def->scale, def->rotate, def->translate));
    if (def->file)
        DRAPE_TRY(take_file(model, pointer, folder, def, mesh, x));
    if (def->positions)
        DRAPE_TRY(
            take_array(model, pointer, "positions", def->positions, def->position_count, def->file, mesh, x));
    DRAPE_TRY(drape_mesh_validate_positions(model->ctx, &source, &moved));
    for (size_t i = 0; i < def->fold_count; i++) {
        const char *place = DRAPE_FORMAT("%s/folds/%zu", pointer, i);
        DRAPE_TRY(fold(model, place, &def->folds[i], mesh->node_count, x));
    }
    drape_mesh_transform(&moved, def->scale, def->rotate, def->translate);
    DRAPE_TRY(drape_mesh_validate_positions(model->ctx, &source, &moved));
    return drape_mesh_validate_shapes(model->ctx, &source, &moved);
}

/* ---- Velocities ---- */

static drape_status read_velocities(drape_model *model, const char *pointer, const char *folder,
                                    const drape_start_def *def, const drape_mesh *whole, double *v)
{
    const drape_mesh *mesh = drape_mesh_given(whole);
    const char *place = DRAPE_FORMAT("%s/velocities", pointer);
    const drape_mesh_source source = {.pointer = place, .file = def->velocity_file};
    drape_contents contents = {0};
    drape_npy_array array = {0};
    DRAPE_TRY(drape_contents_read(&model->scratch, place, folder, def->velocity_file, &contents));
    DRAPE_TRY(drape_npy_array_parse(model->ctx, &source, contents.data, contents.size, &array));
    if (array.dimensions != 2 || array.shape[0] != mesh->node_count || array.shape[1] != 3)
        return drape_mesh_fail(model->ctx, &source, 0,
                               "an array of %" PRId64 " x %" PRId64 " x %" PRId64
                               "; nodes x 3, %d x 3, is needed",
                               array.shape[0], array.shape[1], array.shape[2], (int)mesh->node_count);
    for (size_t i = 0; i < 3 * (size_t)mesh->node_count; i++)
        v[i] = drape_npy_array_at(&array, i);
    drape_mesh_fill_middles(whole, v);
    return DRAPE_OK;
}

static drape_status add_velocities(drape_model *model, const char *pointer, const char *folder,
                                   const drape_start_def *def, const drape_cloth *cloth, const double *x,
                                   double *v)
{
    const drape_mesh *mesh = &cloth->mesh;
    const size_t count = 3 * (size_t)mesh->node_count;
    double *own = drape_arena_take(&model->scratch, count, sizeof *own);
    if (!own)
        return DRAPE_E_MEMORY;
    if (def->velocity_file)
        DRAPE_TRY(read_velocities(model, pointer, folder, def, mesh, own));
    if (def->velocities)
        DRAPE_TRY(take_array(model, pointer, "velocities", def->velocities, def->velocity_count,
                             def->velocity_file, mesh, own));
    double pivot[3] = {0}, mass = 0;
    for (int32_t i = 0; i < mesh->node_count; i++) {
        vec3_add_scaled(cloth->node_mass[i], x + 3 * (size_t)i, pivot);
        mass += cloth->node_mass[i];
    }
    for (int k = 0; k < 3; k++)
        pivot[k] = isnan(def->pivot[0]) ? pivot[k] / mass : def->pivot[k];
    for (int32_t i = 0; i < mesh->node_count; i++) {
        double arm[3], turning[3];
        vec3_sub(x + 3 * (size_t)i, pivot, arm);
        vec3_cross(def->spin, arm, turning);
        for (int k = 0; k < 3; k++) {
            const double further = own[3 * (size_t)i + (size_t)k] + turning[k];
            if (!(fabs(further) <= DRAPE_MOST))
                return drape_refuse(model->ctx, pointer,
                                    "the velocity of node %d is %g m/s; it is in [-1e9, 1e9]", (int)i,
                                    further);
            v[3 * (size_t)i + (size_t)k] += further;
        }
    }
    return DRAPE_OK;
}

/* ---- All cloths ---- */

static bool moves_nodes(const drape_start_def *def)
{
    bool moves = def->file || def->positions || def->fold_count > 0 || def->rotate[3] != 0;
    for (int k = 0; k < 3; k++)
        moves = moves || def->scale[k] != 1 || def->translate[k] != 0;
    return moves;
}

drape_status drape_compile_start(drape_model *model, const drape_scene_def *def)
{
    const size_t size = 3 * (size_t)model->node_count * sizeof *model->start;
    bool moves = false;
    model->start = model->rest;
    for (size_t c = 0; c < def->cloth_count; c++)
        moves = moves || moves_nodes(&def->cloths[c].start);
    if (moves) {
        model->start = drape_arena_take(&model->arena, 1, size);
        if (!model->start)
            return DRAPE_E_MEMORY;
        memcpy(model->start, model->rest, size);
    }
    for (size_t c = 0; c < def->cloth_count; c++) {
        const drape_start_def *from = &def->cloths[c].start;
        drape_cloth *cloth = &model->cloths[c];
        double *x = model->start + 3 * (size_t)cloth->first_node;
        const char *pointer = DRAPE_FORMAT("/cloth/%zu/start", c);
        if (from->file)
            cloth->start_file = drape_arena_text(&model->arena, from->file);
        if (from->velocity_file)
            cloth->velocity_file = drape_arena_text(&model->arena, from->velocity_file);
        DRAPE_TRY(drape_arena_status(&model->arena));
        if (moves_nodes(from))
            DRAPE_TRY(place_nodes(model, pointer, def->folder, from, &cloth->mesh, x));
        if (from->velocity_file || from->velocities || vec3_norm(from->spin) > 0)
            DRAPE_TRY(add_velocities(model, pointer, def->folder, from, cloth, x,
                                     model->velocity + 3 * (size_t)cloth->first_node));
    }
    return DRAPE_OK;
}
