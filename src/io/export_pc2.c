/*
 * export_pc2.c: folder/positions.pc2 and positions.obj: a point cache and the mesh that it moves, for
 * Blender's Mesh Cache and similar programs. The mesh is the first frame, with all cloths as one object.
 *
 * PC2, version 1, little endian: "POINTCACHE2\0", int32 version, int32 points, float32 first frame, float32
 * step in frames, int32 samples; then for each sample float32 x y z of each point. The number of samples is
 * raised after a sample is written: at any moment the file contains what its header says.
 */
#include <inttypes.h>
#include <string.h>

#include "io/export.h"
#include "model/model.h"

#define FILE_NAME    "positions.pc2"
#define MESH_NAME    "positions.obj"
#define COUNT_OFFSET 28

typedef struct pc2_state {
    const drape_export_def *def;
    drape_file file;
} pc2_state;

static bool pc2_names(const char *name)
{
    return strcmp(name, FILE_NAME) == 0 || strcmp(name, MESH_NAME) == 0;
}

static drape_status pc2_open(drape_context *ctx, const drape_export_def *def, void *state)
{
    pc2_state *pc2 = state;
    pc2->def = def;
    drape_status status = drape_export_open(ctx, def, FILE_NAME, &pc2->file);
    if (status || def->resumes)
        return status;
    drape_file_put(&pc2->file, "POINTCACHE2", 12); /* with its terminating 0 */
    drape_file_put_word(&pc2->file, 1);
    drape_file_put_word(&pc2->file, (uint32_t)pc2->def->model->surface.node_count);
    drape_file_put_float(&pc2->file, 0);
    drape_file_put_float(&pc2->file, 1);
    drape_file_put_word(&pc2->file, 0);
    return drape_file_publish(&pc2->file);
}

static void format_count(int64_t samples, unsigned char bytes[4])
{
    for (int b = 0; b < 4; b++)
        bytes[b] = (unsigned char)((uint32_t)samples >> 8 * b);
}

static drape_status pc2_write(drape_context *ctx, void *state, const drape_frame *frame)
{
    pc2_state *pc2 = state;
    const size_t count = 3 * (size_t)pc2->def->model->surface.node_count;
    unsigned char bytes[4];
    (void)ctx;
    if (frame->index == 0) { /* the mesh */
        const drape_render_surface *surface = &pc2->def->model->surface;
        drape_obj obj = {.file = pc2->def->whole};
        drape_file_name(obj.file, MESH_NAME);
        drape_status status = drape_file_begin(obj.file);
        if (status)
            return status;
        drape_file_put_text(obj.file, "# the mesh that " FILE_NAME " moves\n");
        drape_obj_put_material_files(obj.file, surface);
        drape_file_put_text(obj.file, "o cloth\n");
        drape_obj_put_nodes(obj.file, frame->positions, surface->node_count);
        for (int32_t c = 0; c < surface->cloth_count; c++)
            drape_obj_put_faces(&obj, surface, c);
        status = drape_file_finish(obj.file);
        if (status)
            return status;
    }
    for (size_t i = 0; i < count; i++)
        drape_file_put_float(&pc2->file, (float)frame->positions[i]);
    format_count(frame->index + 1, bytes);
    return drape_export_count(&pc2->file, COUNT_OFFSET, bytes, sizeof bytes);
}

static drape_file *pc2_file(void *state, size_t number)
{
    return number == 0 ? &((pc2_state *)state)->file : NULL;
}

static drape_status pc2_cut(drape_context *ctx, void *state, int64_t frames)
{
    pc2_state *pc2 = state;
    unsigned char bytes[4];
    (void)ctx;
    format_count(frames, bytes);
    drape_status status = frames > 0 ? drape_folder_verify(pc2->def->folder, MESH_NAME) : DRAPE_OK;
    return status ? status : drape_file_overwrite(&pc2->file, COUNT_OFFSET, bytes, sizeof bytes);
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
    .open = pc2_open,
    .names = pc2_names,
    .write = pc2_write,
    .file = pc2_file,
    .cut = pc2_cut,
};
