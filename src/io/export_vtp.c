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
#include <string.h>

#include "io/export.h"

#define FRAME_NAME "frame_" DRAPE_FRAME_DIGITS ".vtp"

#define PVD_NAME "frames.pvd"
#define PVD_SIZE 256 /* for an entry and the last line */

/* A collider that stays, and one that does not, in a frame. */
#define BODY_NAME       "collider_%" PRId32 ".vtp"
#define BODY_FRAME_NAME "collider_%" PRId32 "_%06" PRId64 ".vtp"

static const char pvd_begin[] = "<?xml version=\"1.0\"?>\n"
                                "<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n"
                                "<Collection>\n";
static const char pvd_end[] = "</Collection></VTKFile>\n";

typedef struct vtp_state {
    drape_file pvd;
    char *entries; /* (PVD_SIZE (1 + body_count)) of one frame */
} vtp_state;

/* ---- The collection ---- */

static bool changes(const drape_export_body *body)
{
    return body->moves || body->deforms;
}

static void format_body_name(const drape_export_def *def, int32_t number, int64_t frame, char name[64])
{
    if (changes(&def->bodies[number]))
        snprintf(name, 64, BODY_FRAME_NAME, number, frame);
    else
        snprintf(name, 64, BODY_NAME, number);
}

static size_t put_entry(vtp_state *vtp, size_t at, double time, int32_t part, const char *name)
{
    return at + (size_t)snprintf(vtp->entries + at, PVD_SIZE,
                                 "<DataSet timestep=\"%.17g\" part=\"%" PRId32 "\" file=\"%s\"/>\n", time,
                                 part, name);
}

/* On a full disk the last line is restored where it was: the file already has that space. */
static drape_status pvd_add(const drape_export_def *def, vtp_state *vtp, const drape_frame *frame)
{
    const off_t end = vtp->pvd.kept - (off_t)(sizeof pvd_end - 1);
    char name[64];
    size_t size = put_entry(vtp, 0, frame->time, 0, def->whole->path); /* the file that was begun last */
    for (int32_t b = 0; b < def->body_count; b++) {
        format_body_name(def, b, frame->index, name);
        size = put_entry(vtp, size, frame->time, b + 1, name);
    }
    memcpy(vtp->entries + size, pvd_end, sizeof pvd_end);
    drape_file_overwrite(&vtp->pvd, end, vtp->entries, size + sizeof pvd_end - 1);
    const drape_status status = drape_file_keep(&vtp->pvd);
    if (status)
        drape_file_overwrite(&vtp->pvd, end, pvd_end, sizeof pvd_end - 1);
    return status;
}

/* ---- Parts ---- */

/* One array of the appended data. */
typedef struct array {
    const char *type, *name;
    int components;
    size_t count, size; /* number of components of all tuples; bytes of a component */
    void (*put)(drape_file *file, const struct array *a);
    const void *from; /* what put writes; NULL: that follows from the rest */
    size_t step;      /* from one number in `from` to the next */
} array;

static void put_doubles(drape_file *file, const array *a)
{
    drape_file_put_doubles(file, a->from, a->count);
}

static void put_floats(drape_file *file, const array *a)
{
    const double *from = a->from;
    for (size_t i = 0; i < a->count; i++)
        drape_file_put_float(file, (float)from[i * a->step]);
}

static void put_bytes(drape_file *file, const array *a)
{
    drape_file_put(file, a->from, a->count);
}

/* Numbers, or one number for all (step 0). */
static void put_words(drape_file *file, const array *a)
{
    const int32_t *from = a->from;
    for (size_t i = 0; i < a->count; i++)
        drape_file_put_word(file, (uint32_t)from[i * a->step]);
}

/* The ends of the triangles in the list of corners. */
static void put_offsets(drape_file *file, const array *a)
{
    for (size_t i = 1; i <= a->count; i++)
        drape_file_put_word(file, 3 * (uint32_t)i);
}

/* Declares arrays of the list. In the data each follows those before it, after its size in 8 bytes. */
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

/* A mesh of triangles. The arrays of the list: points, point data (none: first_cell is 1), cell data, corners
 * of the cells, and where each cell ends in these. */
static void put_part(drape_file *file, double time, const array *list, int first_cell, int count,
                     const char *scalars)
{
    drape_file_print(
        file,
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" "
        "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData>\n<FieldData>\n"
        "<DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">%.17g"
        "</DataArray>\n</FieldData>\n",
        time);
    drape_file_print(file,
                     "<Piece NumberOfPoints=\"%zu\" NumberOfVerts=\"0\" NumberOfLines=\"0\" "
                     "NumberOfStrips=\"0\" NumberOfPolys=\"%zu\">\n<Points>\n",
                     list[0].count / 3, list[count - 1].count);
    put_declarations(file, list, 0, 1);
    drape_file_put_text(file, "</Points>\n");
    if (first_cell > 1) {
        drape_file_put_text(file, "<PointData Vectors=\"velocity\" Scalars=\"energy_density\">\n");
        put_declarations(file, list, 1, first_cell);
        drape_file_put_text(file, "</PointData>\n");
    }
    drape_file_print(file, "<CellData Scalars=\"%s\">\n", scalars);
    put_declarations(file, list, first_cell, count - 2);
    drape_file_put_text(file, "</CellData>\n<Polys>\n");
    put_declarations(file, list, count - 2, count);
    drape_file_put_text(file, "</Polys>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_");
    for (int i = 0; i < count; i++) {
        const uint64_t size = list[i].count * list[i].size;
        drape_file_put_word(file, (uint32_t)size);
        drape_file_put_word(file, (uint32_t)(size >> 32));
        list[i].put(file, &list[i]);
    }
    drape_file_put_text(file, "\n</AppendedData>\n</VTKFile>\n");
}

/* ---- The cloths ---- */

/* The mean over a triangle's nodes. */
typedef struct cell_densities {
    const int32_t *node;
    const double *density;
} cell_densities;

static void put_cell_densities(drape_file *file, const array *a)
{
    const cell_densities *of = a->from;
    const int32_t *node = of->node;
    for (size_t i = 0; i < a->count; i++, node += 3)
        drape_file_put_float(
            file, (float)((of->density[node[0]] + of->density[node[1]] + of->density[node[2]]) / 3));
}

static void put_cloths(drape_file *file, const array *a)
{
    const drape_render_surface *surface = a->from;
    for (int32_t c = 0; c < surface->cloth_count; c++)
        for (int32_t i = 0; i < surface->cloths[c].mesh->triangle_count; i++)
            drape_file_put_word(file, (uint32_t)c);
}

/* ---- Colliders ---- */

typedef struct body_points {
    const drape_frame *frame;
    const drape_export_body *body;
    const drape_collider_pose *pose;
} body_points;

static void put_body_points(drape_file *file, const array *a)
{
    const body_points *of = a->from;
    const drape_export_body *body = of->body;
    for (int32_t i = 0; i < body->vertex_count; i++) {
        double x[3];
        for (size_t k = 0; k < 3; k++)
            x[k] = body->deforms ? of->frame->positions[3 * (size_t)(body->first_point + i) + k]
                                 : (double)body->vertex[6 * (size_t)i + k];
        if (!body->deforms)
            drape_pose_point(of->pose, x, x);
        drape_file_put_doubles(file, x, 3);
    }
}

/* Points in space, and triangles; the cells know the number of their collider. */
static drape_status write_body(const drape_export_def *def, const drape_frame *frame, int32_t number)
{
    const drape_export_body *body = &def->bodies[number];
    const size_t cells = (size_t)body->triangle_count;
    const body_points points = {frame, body, &frame->poses[number]};
    const array list[] = {
        {"Float64", "Points", 3, 3 * (size_t)body->vertex_count, 8, put_body_points, &points, 1},
        {"Int32", "collider", 1, cells, 4, put_words, &number, 0},
        {"Int32", "connectivity", 1, 3 * cells, 4, put_words, body->triangle, 1},
        {"Int32", "offsets", 1, cells, 4, put_offsets, NULL, 0},
    };
    char name[64];
    format_body_name(def, number, frame->index, name);
    drape_file_name(def->whole, "%s", name);
    drape_status status = drape_file_begin(def->whole);
    if (status)
        return status;
    put_part(def->whole, frame->time, list, 1, 4, "collider");
    return drape_file_finish(def->whole);
}

/* ---- The format ---- */

static drape_status vtp_open(const drape_export_def *def, void *state)
{
    vtp_state *vtp = state;
    vtp->entries = drape_arena_take(def->arena, 1 + (size_t)def->body_count, PVD_SIZE);
    drape_status status = vtp->entries ? drape_export_open(def, PVD_NAME, &vtp->pvd) : DRAPE_E_MEMORY;
    if (status || def->resumes)
        return status;
    drape_file_put_text(&vtp->pvd, pvd_begin);
    drape_file_put_text(&vtp->pvd, pvd_end);
    drape_file_declare(&vtp->pvd, -(int64_t)(sizeof pvd_end - 1), sizeof pvd_end - 1);
    return drape_file_publish(&vtp->pvd);
}

static drape_status vtp_write(const drape_export_def *def, void *state, const drape_frame *frame)
{
    const drape_render_surface *surface = &def->model->surface;
    const size_t nodes = (size_t)surface->node_count, cells = (size_t)surface->triangle_count;
    const double *density = frame->energy_density;
    const cell_densities mean = {surface->triangle, density};
    const array list[] = {
        {"Float64", "Points", 3, 3 * nodes, 8, put_doubles, frame->positions, 1},
        {"Float32", "velocity", 3, 3 * nodes, 4, put_floats, frame->velocities, 1},
        {"Float32", "energy_density", 1, nodes, 4, put_floats, density, 1},
        {"UInt8", "pinned", 1, nodes, 1, put_bytes, frame->pinned, 1},
        {"Float32", "strain_max", 1, cells, 4, put_floats, frame->strain, 2},
        {"Float32", "strain_min", 1, cells, 4, put_floats, frame->strain + 1, 2},
        {"Float32", "energy_density", 1, cells, 4, put_cell_densities, &mean, 1},
        {"Int32", "cloth", 1, cells, 4, put_cloths, surface, 1},
        {"Int32", "connectivity", 1, 3 * cells, 4, put_words, surface->triangle, 1},
        {"Int32", "offsets", 1, cells, 4, put_offsets, NULL, 0},
    };
    drape_status status = DRAPE_OK;
    for (int32_t b = 0; b < def->body_count && !status; b++)
        if (changes(&def->bodies[b]) || frame->index == 0)
            status = write_body(def, frame, b);
    if (!status)
        status = drape_export_begin_frame(def, frame, FRAME_NAME);
    if (status)
        return status;
    put_part(def->whole, frame->time, list, 4, 10, "strain_max");
    status = drape_file_finish(def->whole);
    return status ? status : pvd_add(def, state, frame);
}

const drape_exporter_ops drape_exporter_vtp = {
    .entry = {.name = "vtp",
              .summary = "frame_000000.vtp ... and frames.pvd: VTK PolyData for each frame, float64, with "
                         "velocity, energy density and strain, the times of the frames, and colliders",
              .reference = "VTK User's Guide, 11th edition, section 19.3, XML file formats"},
    .state_size = sizeof(vtp_state),
    .wants_fields = true,
    .wants_bodies = true,
    .names = {FRAME_NAME, PVD_NAME, "collider_#.vtp", "collider_#_" DRAPE_FRAME_DIGITS ".vtp"},
    .open = vtp_open,
    .write = vtp_write,
};
