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
    drape_file file, mesh;
    int32_t samples; /* complete samples in the file */
} pc2_state;

static bool pc2_names(const char *name)
{
    return strcmp(name, FILE_NAME) == 0 || strcmp(name, MESH_NAME) == 0;
}

static void put_header(pc2_state *pc2)
{
    drape_file_put(&pc2->file, "POINTCACHE2", 12); /* with its terminating 0 */
    drape_file_put_word(&pc2->file, 1);
    drape_file_put_word(&pc2->file, (uint32_t)pc2->def->model->surface.node_count);
    drape_file_put_float(&pc2->file, 0);
    drape_file_put_float(&pc2->file, 1);
    drape_file_put_word(&pc2->file, 0);
}

static drape_status pc2_open(drape_context *ctx, const drape_export_def *def, void *state)
{
    pc2_state *pc2 = state;
    pc2->def = def;
    drape_status status = drape_export_begin(ctx, def->folder, FILE_NAME, &pc2->file);
    if (status)
        return status;
    put_header(pc2);
    status = drape_file_publish(&pc2->file);
    if (!status)
        status = drape_export_begin(ctx, def->folder, MESH_NAME, &pc2->mesh);
    pc2->mesh.durable = def->durable;
    return status;
}

static drape_status write_mesh(pc2_state *pc2, const drape_frame *frame)
{
    const drape_render_surface *surface = &pc2->def->model->surface;
    drape_obj obj = {.file = &pc2->mesh};
    drape_file_put_text(&pc2->mesh, "# the mesh that " FILE_NAME " moves\n");
    drape_obj_put_material_files(&pc2->mesh, surface);
    drape_file_put_text(&pc2->mesh, "o cloth\n");
    drape_obj_put_nodes(&pc2->mesh, frame->positions, surface->node_count);
    for (int32_t c = 0; c < surface->cloth_count; c++)
        drape_obj_put_faces(&obj, surface, c);
    return drape_file_finish(&pc2->mesh);
}

static drape_status write_count(pc2_state *pc2, int32_t samples)
{
    unsigned char bytes[4];
    for (int b = 0; b < 4; b++)
        bytes[b] = (unsigned char)((uint32_t)samples >> 8 * b);
    return drape_file_overwrite(&pc2->file, COUNT_OFFSET, bytes, sizeof bytes);
}

static drape_status pc2_write(drape_context *ctx, void *state, const drape_frame *frame)
{
    pc2_state *pc2 = state;
    off_t before = pc2->file.kept;
    size_t count = 3 * (size_t)pc2->def->model->surface.node_count;
    (void)ctx;
    drape_status status = frame->index == 0 ? write_mesh(pc2, frame) : DRAPE_OK;
    for (size_t i = 0; !status && i < count; i++)
        drape_file_put_float(&pc2->file, (float)frame->positions[i]);
    if (!status)
        status = drape_file_keep(&pc2->file);
    if (status)
        return status;
    status = write_count(pc2, pc2->samples + 1);
    if (status)
        drape_file_cut(&pc2->file, before);
    else
        pc2->samples++;
    return status;
}

static void pc2_archive(void *state, drape_archive *a)
{
    pc2_state *pc2 = state;
    drape_archive_int32(a, &pc2->samples);
    drape_export_archive_file(a, &pc2->file);
}

static drape_status pc2_resume(drape_context *ctx, const drape_export_def *def, void *state, int64_t frames,
                               drape_archive *a)
{
    pc2_state *pc2 = state;
    pc2->def = def;
    pc2_archive(pc2, a);
    if (drape_archive_good(a) && pc2->samples != frames)
        drape_archive_fail(a, DRAPE_E_PARSE,
                           "the checkpoint has %lld frames and another number in " FILE_NAME,
                           (long long)frames);
    drape_status status = a->status ? a->status : drape_folder_verify(def->folder, MESH_NAME);
    return status ? status : drape_export_reopen(ctx, def->folder, FILE_NAME, &pc2->file);
}

/* First lowers the count: at any moment the file contains at least what its header says. */
static drape_status pc2_cut(drape_context *ctx, void *state, int64_t frames)
{
    pc2_state *pc2 = state;
    (void)ctx, (void)frames;
    drape_status status = write_count(pc2, pc2->samples);
    return status ? status : drape_file_trim(&pc2->file);
}

static drape_status pc2_sync(void *state)
{
    return drape_file_sync(&((pc2_state *)state)->file);
}

static drape_status pc2_close(drape_context *ctx, void *state)
{
    pc2_state *pc2 = state;
    (void)ctx;
    drape_status status = drape_file_close(&pc2->file);
    drape_file_destroy(&pc2->file);
    drape_file_destroy(&pc2->mesh);
    return status;
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
    .archive = pc2_archive,
    .resume = pc2_resume,
    .cut = pc2_cut,
    .sync = pc2_sync,
    .close = pc2_close,
};
