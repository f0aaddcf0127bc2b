/*
 * export_vtp.c: folder/frame_000000.vtp, ...: one VTK XML file of PolyData for each frame, and
 * folder/frames.pvd, a collection that gives each frame its time. Positions are float64, fields float32,
 * appended raw, little endian. All cloths are in one mesh; an array of the cells says which cloth they
 * belong to. Each collider is a part of its own in the collection: its surface is in folder/collider_0.vtp
 * if it stays where it is, otherwise in folder/collider_0_000000.vtp, ... for each frame. Formats: VTK XML
 * file formats (VTK User's Guide, 11th ed., section 19.3), ParaView's collections of them.
 *
 * The collection always ends with the same line: a frame's entries are written over it, followed by that
 * line again, in one write.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "io/export.h"

#define PVD_NAME "frames.pvd"
#define PVD_ROOM 256 /* for an entry and the last line */

/* A collider that stays, and one that does not, in a frame. */
#define BODY_NAME       "collider_%" PRId32 ".vtp"
#define BODY_FRAME_NAME "collider_%" PRId32 "_%06" PRId64 ".vtp"

static const char pvd_begin[] = "<?xml version=\"1.0\"?>\n"
                                "<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n"
                                "<Collection>\n";
static const char pvd_end[] = "</Collection></VTKFile>\n";

typedef struct vtp_state {
    drape_frame_files frames;
    drape_file pvd;
    off_t entries_end; /* position in the collection */
    const drape_export_def *def;
    char *entries; /* (PVD_ROOM (1 + body_count)) of one frame */
} vtp_state;

/* ---- The collection ---- */

static drape_status pvd_open(drape_context *ctx, drape_folder *folder, vtp_state *vtp)
{
    drape_status status = drape_export_begin(ctx, folder, PVD_NAME, &vtp->pvd);
    if (status)
        return status;
    drape_file_put_text(&vtp->pvd, pvd_begin);
    drape_file_put_text(&vtp->pvd, pvd_end);
    vtp->entries_end = sizeof pvd_begin - 1;
    return drape_file_publish(&vtp->pvd);
}

static bool changes(const drape_export_body *body)
{
    return body->moves || body->deforms;
}

static size_t put_entry(vtp_state *vtp, size_t at, double time, int32_t part, const char *name)
{
    return at + (size_t)snprintf(vtp->entries + at, PVD_ROOM,
                                 "<DataSet timestep=\"%.17g\" part=\"%" PRId32 "\" file=\"%s\"/>\n", time,
                                 part, name);
}

/* On a full disk the last line is restored where it was: the file already has that room. */
static drape_status pvd_add(vtp_state *vtp, const drape_frame *frame)
{
    char name[64];
    snprintf(name, sizeof name, DRAPE_FRAME_NAME, frame->index, "vtp");
    size_t size = put_entry(vtp, 0, frame->time, 0, name);
    for (int32_t b = 0; b < vtp->def->body_count; b++) {
        if (changes(&vtp->def->bodies[b]))
            snprintf(name, sizeof name, BODY_FRAME_NAME, b, frame->index);
        else
            snprintf(name, sizeof name, BODY_NAME, b);
        size = put_entry(vtp, size, frame->time, b + 1, name);
    }
    const size_t end = size;
    memcpy(vtp->entries + size, pvd_end, sizeof pvd_end);
    size += sizeof pvd_end - 1;
    drape_status status = drape_file_overwrite(&vtp->pvd, vtp->entries_end, vtp->entries, size);
    if (!status) {
        vtp->entries_end += (off_t)end;
        return DRAPE_OK;
    }
    drape_file_restore(&vtp->pvd, vtp->entries_end, pvd_end, sizeof pvd_end - 1);
    return status;
}

/* ---- A frame ---- */

/* One array of the appended data. */
typedef struct array {
    const char *type, *name;
    int components;
    size_t count, size; /* number of components of all tuples; bytes of a component */
    void (*put)(drape_file *file, const drape_render_surface *surface, const drape_frame *frame);
} array;

static void put_positions(drape_file *file, const drape_render_surface *surface, const drape_frame *frame)
{
    drape_file_put_doubles(file, frame->positions, 3 * (size_t)surface->node_count);
}

static void put_floats(drape_file *file, const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        drape_file_put_float(file, (float)values[i]);
}

static void put_velocities(drape_file *file, const drape_render_surface *surface, const drape_frame *frame)
{
    put_floats(file, frame->velocities, 3 * (size_t)surface->node_count);
}

static void put_densities(drape_file *file, const drape_render_surface *surface, const drape_frame *frame)
{
    put_floats(file, frame->energy_density, (size_t)surface->node_count);
}

static void put_pinned(drape_file *file, const drape_render_surface *surface, const drape_frame *frame)
{
    drape_file_put(file, frame->pinned, (size_t)surface->node_count);
}

static void put_triangles(drape_file *file, const drape_render_surface *surface, const drape_frame *frame)
{
    const int32_t *node = surface->triangle;
    (void)frame;
    for (size_t i = 0; i < 3 * (size_t)surface->triangle_count; i++)
        drape_file_put_word(file, (uint32_t)node[i]);
}

static void put_offsets(drape_file *file, const drape_render_surface *surface, const drape_frame *frame)
{
    (void)frame;
    for (int32_t i = 1; i <= surface->triangle_count; i++)
        drape_file_put_word(file, 3 * (uint32_t)i);
}

static void put_strains(drape_file *file, const drape_frame *frame, int which, int32_t count)
{
    for (int32_t i = 0; i < count; i++)
        drape_file_put_float(file, (float)frame->strain[2 * (size_t)i + (size_t)which]);
}

static void put_largest_strains(drape_file *file, const drape_render_surface *surface,
                                const drape_frame *frame)
{
    put_strains(file, frame, 0, surface->triangle_count);
}

static void put_least_strains(drape_file *file, const drape_render_surface *surface, const drape_frame *frame)
{
    put_strains(file, frame, 1, surface->triangle_count);
}

/* The mean over a triangle's nodes. */
static void put_cell_densities(drape_file *file, const drape_render_surface *surface,
                               const drape_frame *frame)
{
    const int32_t *node = surface->triangle;
    const double *density = frame->energy_density;
    for (int32_t i = 0; i < surface->triangle_count; i++, node += 3)
        drape_file_put_float(file, (float)((density[node[0]] + density[node[1]] + density[node[2]]) / 3));
}

static void put_cloths(drape_file *file, const drape_render_surface *surface, const drape_frame *frame)
{
    (void)frame;
    for (int32_t c = 0; c < surface->cloth_count; c++)
        for (int32_t i = 0; i < surface->cloths[c].mesh->triangle_count; i++)
            drape_file_put_word(file, (uint32_t)c);
}

enum { POINTS, CELL_FIELDS = 4, CORNERS = 8, ARRAY_COUNT = 10 };

/* The arrays in the order of the appended data: points, point data, cell data, corners of the cells. */
static void list_arrays(const drape_render_surface *surface, array list[ARRAY_COUNT])
{
    size_t nodes = (size_t)surface->node_count, cells = (size_t)surface->triangle_count;
    const array all[ARRAY_COUNT] = {
        {"Float64", "Points", 3, 3 * nodes, 8, put_positions},
        {"Float32", "velocity", 3, 3 * nodes, 4, put_velocities},
        {"Float32", "energy_density", 1, nodes, 4, put_densities},
        {"UInt8", "pinned", 1, nodes, 1, put_pinned},
        {"Float32", "strain_max", 1, cells, 4, put_largest_strains},
        {"Float32", "strain_min", 1, cells, 4, put_least_strains},
        {"Float32", "energy_density", 1, cells, 4, put_cell_densities},
        {"Int32", "cloth", 1, cells, 4, put_cloths},
        {"Int32", "connectivity", 1, 3 * cells, 4, put_triangles},
        {"Int32", "offsets", 1, cells, 4, put_offsets},
    };
    memcpy(list, all, sizeof all);
}

/* Declares the arrays first ... end - 1. In the data each follows those before it, after its size in 8
 * bytes. */
static void put_declarations(drape_file *file, const array *list, int first, int end)
{
    uint64_t offset = 0;
    for (int i = 0; i < end; i++) {
        if (i >= first)
            drape_file_print(
                file,
                "<DataArray type=\"%s\" Name=\"%s\" NumberOfComponents=\"%d\" format=\"appended\" "
                "offset=\"%" PRIu64 "\"/>\n",
                list[i].type, list[i].name, list[i].components, offset);
        offset += 8 + list[i].count * list[i].size;
    }
}

static void put_time(drape_file *file, const drape_frame *frame)
{
    drape_file_print(
        file,
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" "
        "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData>\n<FieldData>\n"
        "<DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">%.17g"
        "</DataArray>\n</FieldData>\n",
        frame->time);
}

static void put_piece(drape_file *file, int32_t points, int32_t polygons)
{
    drape_file_print(file,
                     "<Piece NumberOfPoints=\"%" PRId32 "\" NumberOfVerts=\"0\" NumberOfLines=\"0\" "
                     "NumberOfStrips=\"0\" NumberOfPolys=\"%" PRId32 "\">\n<Points>\n",
                     points, polygons);
}

static void put_xml(drape_file *file, const drape_render_surface *surface, const drape_frame *frame,
                    const array *list)
{
    put_time(file, frame);
    put_piece(file, surface->node_count, surface->triangle_count);
    put_declarations(file, list, POINTS, POINTS + 1);
    drape_file_put_text(file, "</Points>\n<PointData Vectors=\"velocity\" Scalars=\"energy_density\">\n");
    put_declarations(file, list, POINTS + 1, CELL_FIELDS);
    drape_file_put_text(file, "</PointData>\n<CellData Scalars=\"strain_max\">\n");
    put_declarations(file, list, CELL_FIELDS, CORNERS);
    drape_file_put_text(file, "</CellData>\n<Polys>\n");
    put_declarations(file, list, CORNERS, ARRAY_COUNT);
    drape_file_put_text(file, "</Polys>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_");
}

static void put_size(drape_file *file, uint64_t size)
{
    drape_file_put_word(file, (uint32_t)size);
    drape_file_put_word(file, (uint32_t)(size >> 32));
}

static void put_data(drape_file *file, const drape_render_surface *surface, const drape_frame *frame,
                     const array *list)
{
    for (int i = 0; i < ARRAY_COUNT; i++) {
        put_size(file, list[i].count * list[i].size);
        list[i].put(file, surface, frame);
    }
    drape_file_put_text(file, "\n</AppendedData>\n</VTKFile>\n");
}

/* ---- Colliders ---- */

/* Points in space, and triangles; the cells know the number of their collider. */
static void put_body(drape_file *file, const drape_frame *frame, const drape_export_body *body,
                     int32_t number)
{
    const array list[] = {{"Float64", "Points", 3, 3 * (size_t)body->vertex_count, 8, NULL},
                          {"Int32", "collider", 1, (size_t)body->triangle_count, 4, NULL},
                          {"Int32", "connectivity", 1, 3 * (size_t)body->triangle_count, 4, NULL},
                          {"Int32", "offsets", 1, (size_t)body->triangle_count, 4, NULL}};
    put_time(file, frame);
    put_piece(file, body->vertex_count, body->triangle_count);
    put_declarations(file, list, 0, 1);
    drape_file_put_text(file, "</Points>\n<CellData Scalars=\"collider\">\n");
    put_declarations(file, list, 1, 2);
    drape_file_put_text(file, "</CellData>\n<Polys>\n");
    put_declarations(file, list, 2, 4);
    drape_file_put_text(file, "</Polys>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_");

    put_size(file, list[0].count * list[0].size);
    for (int32_t i = 0; i < body->vertex_count; i++) {
        double x[3];
        drape_export_body_vertex(frame, body, number, i, x);
        drape_file_put_doubles(file, x, 3);
    }
    put_size(file, list[1].count * list[1].size);
    for (int32_t i = 0; i < body->triangle_count; i++)
        drape_file_put_word(file, (uint32_t)number);
    put_size(file, list[2].count * list[2].size);
    for (size_t i = 0; i < list[2].count; i++)
        drape_file_put_word(file, (uint32_t)body->triangle[i]);
    put_size(file, list[3].count * list[3].size);
    for (int32_t i = 1; i <= body->triangle_count; i++)
        drape_file_put_word(file, 3 * (uint32_t)i);
    drape_file_put_text(file, "\n</AppendedData>\n</VTKFile>\n");
}

static drape_status write_bodies(vtp_state *vtp, const drape_frame *frame)
{
    drape_file *file = &vtp->frames.file;
    drape_status status = DRAPE_OK;
    for (int32_t b = 0; b < vtp->def->body_count && !status; b++) {
        const drape_export_body *body = &vtp->def->bodies[b];
        if (!changes(body) && frame->index > 0)
            continue;
        if (changes(body))
            drape_file_name(file, BODY_FRAME_NAME, b, frame->index);
        else
            drape_file_name(file, BODY_NAME, b);
        status = drape_file_begin(file);
        if (status)
            return status;
        put_body(file, frame, body, b);
        status = drape_file_finish(file);
    }
    return status;
}

/* Whether a file is one of a collider. *frame: that it is of; 0 if the collider stays. */
static bool body_names(const char *name, int64_t *frame)
{
    static const char word[] = "collider_";
    if (strncmp(name, word, sizeof word - 1) != 0)
        return false;
    const char *number = name + sizeof word - 1, *rest = number + strspn(number, "0123456789");
    *frame = 0;
    if (rest == number || *rest != '_')
        return rest > number && strcmp(rest, ".vtp") == 0;
    const size_t digits = strspn(rest + 1, "0123456789");
    *frame = (int64_t)strtoll(rest + 1, NULL, 10);
    return digits >= DRAPE_FRAME_DIGITS && strcmp(rest + 1 + digits, ".vtp") == 0;
}

static bool is_late_body(const void *user, const char *name)
{
    int64_t frame;
    return body_names(name, &frame) && frame >= *(const int64_t *)user;
}

static bool vtp_names(const char *name)
{
    int64_t frame;
    return strcmp(name, PVD_NAME) == 0 || body_names(name, &frame) ||
           drape_frame_files_name(name, DRAPE_FRAME_DIGITS, "vtp", NULL);
}

static drape_status allocate(const drape_export_def *def, vtp_state *vtp)
{
    vtp->def = def;
    vtp->entries = drape_arena_take(def->arena, 1 + (size_t)def->body_count, PVD_ROOM);
    return vtp->entries ? DRAPE_OK : DRAPE_E_MEMORY;
}

static drape_status vtp_open(drape_context *ctx, const drape_export_def *def, void *state)
{
    vtp_state *vtp = state;
    drape_status status = allocate(def, vtp);
    if (!status)
        status = drape_frame_files_open(ctx, def, "vtp", &vtp->frames);
    return status ? status : pvd_open(ctx, def->folder, vtp);
}

static drape_status vtp_write(drape_context *ctx, void *state, const drape_frame *frame)
{
    vtp_state *vtp = state;
    const drape_render_surface *surface = vtp->frames.surface;
    array list[ARRAY_COUNT];
    (void)ctx;
    list_arrays(surface, list);
    drape_status status = write_bodies(vtp, frame);
    if (!status)
        status = drape_frame_files_begin(&vtp->frames, frame->index);
    if (status)
        return status;
    put_xml(&vtp->frames.file, surface, frame, list);
    put_data(&vtp->frames.file, surface, frame, list);
    status = drape_frame_files_end(&vtp->frames);
    return status ? status : pvd_add(vtp, frame);
}

static void vtp_archive(void *state, drape_archive *a)
{
    vtp_state *vtp = state;
    int64_t end = vtp->entries_end;
    drape_export_archive_file(a, &vtp->pvd);
    drape_archive_int64(a, &end);
    vtp->entries_end = (off_t)end;
}

static drape_status vtp_resume(drape_context *ctx, const drape_export_def *def, void *state, int64_t frames,
                               drape_archive *a)
{
    vtp_state *vtp = state;
    vtp_archive(vtp, a);
    drape_status status = a->status ? a->status : allocate(def, vtp);
    if (!status)
        status = drape_frame_files_resume(ctx, def, "vtp", frames, &vtp->frames);
    return status ? status : drape_export_reopen(ctx, def->folder, PVD_NAME, &vtp->pvd);
}

/* Writes the last line over the entries to be removed, then trims: at any moment the collection is
 * complete. */
static drape_status vtp_cut(drape_context *ctx, void *state, int64_t frames)
{
    vtp_state *vtp = state;
    drape_status status = drape_file_overwrite(&vtp->pvd, vtp->entries_end, pvd_end, sizeof pvd_end - 1);
    if (!status)
        status = drape_file_trim(&vtp->pvd);
    if (!status)
        status = drape_folder_remove(vtp->frames.folder, is_late_body, &frames);
    return status ? status : drape_frame_files_cut(ctx, &vtp->frames, frames);
}

static drape_status vtp_sync(void *state)
{
    return drape_file_sync(&((vtp_state *)state)->pvd);
}

static drape_status vtp_close(drape_context *ctx, void *state)
{
    vtp_state *vtp = state;
    const drape_status status = drape_file_close(&vtp->pvd);
    drape_file_destroy(&vtp->pvd);
    drape_frame_files_close(ctx, &vtp->frames);
    return status;
}

const drape_exporter_ops drape_exporter_vtp = {
    .entry = {.name = "vtp",
              .summary = "frame_000000.vtp ... and frames.pvd: VTK PolyData for each frame, float64, with "
                         "velocity, energy density and strain, the times of the frames, and colliders",
              .reference = "VTK User's Guide, 11th edition, section 19.3, XML file formats"},
    .state_size = sizeof(vtp_state),
    .wants_fields = true,
    .wants_bodies = true,
    .open = vtp_open,
    .names = vtp_names,
    .write = vtp_write,
    .archive = vtp_archive,
    .resume = vtp_resume,
    .cut = vtp_cut,
    .sync = vtp_sync,
    .close = vtp_close,
};
