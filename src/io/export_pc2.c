/*
 * export_pc2.c: folder/positions.pc2 and positions.obj: a point cache and the mesh that it moves, for
 * Blender's Mesh Cache and similar programs. The mesh is the first frame, with all cloths as one object.
 *
 * PC2, version 1, little endian: "POINTCACHE2\0", int32 version, int32 points, float32 first frame, float32
 * step in frames, int32 samples; then for each sample float32 x y z of each point. The number of samples is
 * raised after a sample is written: at any moment the file contains what its header says.
 */
#include "io/export.h"
#include "model/model.h"

#define FILE_NAME    "positions.pc2"
#define MESH_NAME    "positions.obj"
#define COUNT_OFFSET 28

typedef struct pc2_state {
    drape_file file;
} pc2_state;

static drape_status pc2_open(const drape_export_def *def, void *state)
{
    drape_file *file = &((pc2_state *)state)->file;
    drape_status status = drape_export_open(def, FILE_NAME, file);
    if (status || def->resumes)
        return status;
    drape_file_put(file, "POINTCACHE2", 12); /* with its terminating 0 */
    drape_file_put_word(file, 1);
    drape_file_put_word(file, (uint32_t)def->model->surface.node_count);
    drape_file_put_float(file, 0);
    drape_file_put_float(file, 1);
    drape_file_put_word(file, 0);
    drape_file_declare(file, COUNT_OFFSET, 4);
    return drape_file_publish(file);
}

static drape_status write_mesh(const drape_export_def *def, const double *positions)
{
    const drape_render_surface *surface = &def->model->surface;
    drape_obj obj = {.file = def->whole};
    drape_file_name(obj.file, MESH_NAME);
    drape_status status = drape_file_begin(obj.file);
    if (status)
        return status;
    drape_file_put_text(obj.file, "# the mesh that " FILE_NAME " moves\n");
    drape_obj_put_material_files(obj.file, surface);
    drape_file_put_text(obj.file, "o cloth\n");
    drape_obj_put_nodes(obj.file, positions, surface->node_count);
    for (int32_t c = 0; c < surface->cloth_count; c++)
        drape_obj_put_faces(&obj, surface, c);
    return drape_file_finish(obj.file);
}

static drape_status pc2_write(const drape_export_def *def, void *state, const drape_frame *frame)
{
    drape_file *file = &((pc2_state *)state)->file;
    const size_t count = 3 * (size_t)def->model->surface.node_count;
    drape_status status = frame->index == 0 ? write_mesh(def, frame->positions) : DRAPE_OK;
    if (status)
        return status;
    for (size_t i = 0; i < count; i++)
        drape_file_put_float(file, (float)frame->positions[i]);
    drape_file_overwrite_word(file, COUNT_OFFSET, (uint32_t)(frame->index + 1));
    return drape_file_keep(file);
}

const drape_exporter_ops drape_exporter_pc2 = {
    .entry = {.name = "pc2",
              .summary =
                  "positions.pc2 and positions.obj: a point cache, float32, and its mesh, for Blender's Mesh "
                  "Cache; valid "
                  "after every frame",
              .reference =
                  "PC2 format version 1, Autodesk 3ds Max SDK, Point Cache; Blender, MOD_meshcache_pc2.c"},
    .state_size = sizeof(pc2_state),
    .names = {FILE_NAME, MESH_NAME},
    .open = pc2_open,
    .write = pc2_write,
};
