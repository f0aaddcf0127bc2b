/*
 * export_usd.c: folder/positions.usda, and folder/positions_1.usda, ...: OpenUSD as text. The stage has a
 * mesh for each cloth and each collider, below /run, with time samples: the positions of a cloth, or of a
 * collider that deforms, and the transformation of a rigid one that moves.
 *
 * A growing text can have one list of samples, at its end. positions.usda has that of the first cloth, and
 * all that does not change; what changes of the other objects is in files of their own, to which their prims
 * refer.
 *
 *     #usda 1.0 (metadata) def Xform "run" { ... def Mesh "cloth" { ... point3f[] points.timeSamples = {
 *     0: [(x, y, z), ...],
 *     TAIL                     closes all braces
 *
 * A frame is written after the tail, as a comment; then, after that, a tail of its own; then the first tail
 * and the sign of the comment become blanks. The file is complete up to a frame at any moment but between
 * the last two of these writes, when it has a tail too many. The end of the time and the extents, which bound
 * all frames so far, are numbers of a fixed width at the beginning.
 *
 * Format: Pixar, OpenUSD 24, UsdGeom and UsdShade schemas, and the grammar of .usda files.
 */
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "io/export.h"
#include "model/model.h"

#define FILE_NAME   "positions.usda"
#define PART_NAME   "positions_%" PRId32 ".usda"
#define MAX_CHANGES 256 /* objects that change: each is an open file */
#define NAME_SIZE   64
#define MATERIALS   "materials"
#define PLAIN       "cloth"
#define BINDING     "rel material:binding = </run/" MATERIALS "/%s>\n"

/* An extent, and the last time code, have this many characters whatever their values. */
#define EXTENT      "[(%15.8e, %15.8e, %15.8e), (%15.8e, %15.8e, %15.8e)]"
#define EXTENT_SIZE 128
#define CODE        "%-20.12g"
#define CODE_SIZE   32

/* What records overwrite (drape_file_declare), in the order in which it is declared: the last time code, the
 * tail, and the extent of what deforms. */
enum { END, TAIL, BOUNDS };

/* The tail of the object in positions.usda closes the samples, its mesh and /run; others have no /run. */
static const char tails[2][16] = {"}\n}\n}\n", "}\n}\n"};

/* A cloth or a collider. */
typedef struct object {
    const char *given_name;
    char name[NAME_SIZE];          /* the same as an identifier */
    const drape_mesh *mesh;        /* of a cloth; NULL: it is a collider */
    const drape_export_body *body; /* NULL: it is a cloth */
    bool deforms;                  /* its points change, not only its place */
    int32_t first_point, points;   /* of what deforms, among the positions of a frame */
    int32_t number;                /* of the file of what changes; 0: positions.usda, -1: nothing changes */
    drape_file file;
    double low[3], high[3]; /* [m] of all frames so far, of what deforms */
} object;

typedef struct material {
    const char *name; /* NULL: of faces that have none */
    char prim[NAME_SIZE];
} material;

typedef struct usd_state {
    const drape_export_def *def;
    object *object; /* (objects) cloths, then colliders */
    int32_t objects;
    material *material; /* (materials) */
    int32_t materials;
    double code; /* time code of the last frame */
} usd_state;

/* ---- Names ---- */

/* Whether a prim, of a material or an object, has that name already. */
static bool is_taken(const usd_state *usd, bool of_material, const char *name)
{
    bool found = !of_material && strcmp(name, MATERIALS) == 0;
    for (int32_t i = 0; i < (of_material ? usd->materials : usd->objects) && !found; i++)
        found = strcmp(of_material ? usd->material[i].prim : usd->object[i].name, name) == 0;
    return found;
}

/* The identifier of a name, with a number if it is taken. A name of a prim has letters, digits and
 * underscores, and begins with none of the digits. */
static void choose_name(const usd_state *usd, bool of_material, const char *name, char out[NAME_SIZE])
{
    size_t used = 0;
    if (*name >= '0' && *name <= '9')
        out[used++] = '_';
    for (; *name && used < NAME_SIZE - 16; name++) {
        const bool good = (*name >= 'a' && *name <= 'z') || (*name >= 'A' && *name <= 'Z') ||
                          (*name >= '0' && *name <= '9') || *name == '_';
        out[used++] = good ? *name : '_';
    }
    if (used == 0)
        out[used++] = '_';
    out[used] = 0;
    for (int number = 1; is_taken(usd, of_material, out); number++)
        snprintf(out + used, NAME_SIZE - used, "_%d", number);
}

/* The number of a material; -1: there is no such material yet. */
static int32_t find_material(const usd_state *usd, const char *name)
{
    for (int32_t i = 0; i < usd->materials; i++) {
        const char *other = usd->material[i].name;
        if (name == other || (name && other && strcmp(name, other) == 0))
            return i;
    }
    return -1;
}

static void add_material(usd_state *usd, const char *name)
{
    material *m = &usd->material[usd->materials];
    if (find_material(usd, name) >= 0)
        return;
    choose_name(usd, true, name ? name : PLAIN, m->prim);
    m->name = name;
    usd->materials++;
}

/* ---- Opening ---- */

static drape_status usd_check(drape_context *ctx, const char *pointer, const drape_export_def *def)
{
    int32_t changes = def->model->cloth_count;
    for (int32_t i = 0; i < def->model->collider_count; i++) {
        const drape_collider *c = &def->model->colliders[i];
        changes += c->frames.frame_count > 0 || c->track.key_count > 0 || c->turns.key_count > 0;
    }
    if (changes <= MAX_CHANGES)
        return DRAPE_OK;
    return drape_fail_at(
        ctx, DRAPE_E_ARGUMENT, pointer,
        "usd: %d cloths and colliders that move, each of which is a file; at most %d are allowed: "
        "take another format",
        (int)changes, MAX_CHANGES);
}

static drape_status list_objects(usd_state *usd)
{
    const drape_render_surface *surface = &usd->def->model->surface;
    size_t materials = 1;
    usd->object = drape_arena_take(
        usd->def->arena, (size_t)surface->cloth_count + (size_t)usd->def->body_count, sizeof *usd->object);
    for (int32_t c = 0; c < surface->cloth_count; c++)
        materials += (size_t)surface->cloths[c].mesh->faces.material_count;
    usd->material = drape_arena_take(usd->def->arena, materials, sizeof *usd->material);
    if (!usd->object || !usd->material)
        return DRAPE_E_MEMORY;
    add_material(usd, NULL);
    int32_t files = 0;
    for (int32_t i = 0; i < surface->cloth_count + usd->def->body_count; i++) {
        object *o = &usd->object[i];
        const drape_render_cloth *cloth = i < surface->cloth_count ? &surface->cloths[i] : NULL;
        const drape_export_body *body = cloth ? NULL : &usd->def->bodies[i - surface->cloth_count];
        *o = (object){.given_name = cloth ? cloth->name : body->name,
                      .mesh = cloth ? cloth->mesh : NULL,
                      .body = body,
                      .deforms = cloth || body->deforms,
                      .first_point = cloth ? cloth->first_node : body->first_point,
                      .points = cloth ? cloth->mesh->node_count : body->vertex_count,
                      .number = cloth || body->deforms || body->moves ? files++ : -1,
                      .low = {DBL_MAX, DBL_MAX, DBL_MAX},
                      .high = {-DBL_MAX, -DBL_MAX, -DBL_MAX}};
        choose_name(usd, false, o->given_name, o->name);
        usd->objects++;
        for (int32_t m = 0; cloth && m < cloth->mesh->faces.material_count; m++)
            add_material(usd, cloth->mesh->faces.name[m]);
    }
    return DRAPE_OK;
}

static drape_status usd_open(const drape_export_def *def, void *state)
{
    usd_state *usd = state;
    usd->def = def;
    drape_status status = list_objects(usd);
    for (int32_t i = 0; i < usd->objects && !status; i++) {
        char name[NAME_SIZE];
        object *o = &usd->object[i];
        snprintf(name, sizeof name, o->number == 0 ? FILE_NAME : PART_NAME, o->number);
        if (o->number >= 0)
            status = drape_export_open(def, name, &o->file);
    }
    return status;
}

/* ---- What does not change ---- */

/* A name as the user gave it, in quotes. */
static void put_text(drape_file *file, const char *text)
{
    drape_file_put_text(file, "\"");
    for (; *text; text++) {
        if (*text == '"' || *text == '\\')
            drape_file_put_text(file, "\\");
        drape_file_put(file, (unsigned char)*text < ' ' ? "_" : text, 1);
    }
    drape_file_put_text(file, "\"");
}

static void put_numbers(drape_file *file, const char *attribute, const int32_t *numbers, size_t count)
{
    drape_file_print(file, "%s = [", attribute);
    for (size_t i = 0; i < count; i++)
        drape_file_print(file, "%s%" PRId32, i ? ", " : "", numbers[i]);
    drape_file_put_text(file, "]\n");
}

/* Puts the subset of the faces that have this material of the mesh. */
static void put_subset(usd_state *usd, drape_file *file, const drape_faces *faces, int32_t number)
{
    const material *m = &usd->material[find_material(usd, faces->name[number])];
    bool first = true;
    drape_file_print(file,
                     "def GeomSubset \"%s\" (\nprepend apiSchemas = [\"MaterialBindingAPI\"]\n)\n{\n"
                     "uniform token elementType = \"face\"\nuniform token familyName = \"materialBind\"\n"
                     "int[] indices = [",
                     m->prim);
    for (int32_t f = 0; f < faces->count; f++)
        if (faces->material[f] == number) {
            drape_file_print(file, "%s%" PRId32, first ? "" : ", ", f);
            first = false;
        }
    drape_file_put_text(file, "]\n");
    drape_file_print(file, BINDING, m->prim);
    drape_file_put_text(file, "}\n");
}

static void put_triangles(drape_file *file, const int32_t *triangle, int32_t count)
{
    drape_file_put_text(file, "int[] faceVertexCounts = [");
    for (int32_t i = 0; i < count; i++)
        drape_file_put_text(file, i ? ", 3" : "3");
    drape_file_put_text(file, "]\n");
    put_numbers(file, "int[] faceVertexIndices", triangle, 3 * (size_t)count);
}

static void put_cloth(usd_state *usd, drape_file *file, const object *o)
{
    const drape_mesh *mesh = o->mesh;
    const drape_faces *faces = &mesh->faces;
    drape_file_put_text(file, "uniform bool doubleSided = 1\n");
    drape_file_print(file, BINDING, usd->material[0].prim);
    if (faces->count == 0) {
        put_triangles(file, mesh->triangle, mesh->triangle_count);
        return;
    }
    drape_file_put_text(file, "int[] faceVertexCounts = [");
    for (int32_t f = 0; f < faces->count; f++)
        drape_file_print(file, "%s%" PRId32, f ? ", " : "", faces->first[f + 1] - faces->first[f]);
    drape_file_put_text(file, "]\n");
    put_numbers(file, "int[] faceVertexIndices", faces->node, (size_t)faces->corner_count);
    if (faces->uv_count > 0) {
        /* a corner without texture coordinates, beside others with some, has (0, 0), which is added */
        drape_file_put_text(file, "texCoord2f[] primvars:st = [");
        for (size_t i = 0; i < (size_t)faces->uv_count; i++)
            drape_file_print(file, "(%.9g, %.9g), ", (double)(float)faces->uv[2 * i],
                             (double)(float)faces->uv[2 * i + 1]);
        drape_file_put_text(file,
                            "(0, 0)] (\ninterpolation = \"faceVarying\"\n)\nint[] primvars:st:indices = [");
        for (int32_t c = 0; c < faces->corner_count; c++)
            drape_file_print(file, "%s%" PRId32, c ? ", " : "",
                             faces->uv_of[c] < 0 ? faces->uv_count : faces->uv_of[c]);
        drape_file_put_text(file, "]\n");
    }
    if (faces->material_count > 0)
        drape_file_put_text(file,
                            "uniform token subsetFamily:materialBind:familyType = \"nonOverlapping\"\n");
    for (int32_t m = 0; m < faces->material_count; m++)
        put_subset(usd, file, faces, m);
}

/* Points are in the collider's own coordinates, with its normals. */
static void put_rigid(drape_file *file, const drape_export_body *body)
{
    float low[3] = {FLT_MAX, FLT_MAX, FLT_MAX}, high[3] = {-FLT_MAX, -FLT_MAX, -FLT_MAX};
    for (size_t part = 0; part < 6; part += 3) {
        drape_file_put_text(file, part ? "normal3f[] normals = [" : "point3f[] points = [");
        for (size_t i = 0; i < (size_t)body->vertex_count; i++) {
            const float *p = body->vertex + 6 * i + part;
            for (int k = 0; k < 3 && part == 0; k++) {
                low[k] = fminf(low[k], p[k]);
                high[k] = fmaxf(high[k], p[k]);
            }
            drape_file_print(file, "%s(%.9g, %.9g, %.9g)", i ? ", " : "", (double)p[0], (double)p[1],
                             (double)p[2]);
        }
        drape_file_put_text(file, part ? "] (\ninterpolation = \"vertex\"\n)\n" : "]\n");
    }
    drape_file_print(file, "float3[] extent = [(%.9g, %.9g, %.9g), (%.9g, %.9g, %.9g)]\n", (double)low[0],
                     (double)low[1], (double)low[2], (double)high[0], (double)high[1], (double)high[2]);
}

/* USD multiplies rows by matrices: the transposed rotation, then the translation. */
static void put_matrix(drape_file *file, const drape_collider_pose *pose)
{
    static const double none[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    const double *R = pose->turned ? pose->turn : none, *d = pose->displacement;
    drape_file_print(file,
                     "((%.17g, %.17g, %.17g, 0), (%.17g, %.17g, %.17g, 0), (%.17g, %.17g, %.17g, 0), "
                     "(%.17g, %.17g, %.17g, 1))",
                     R[0], R[3], R[6], R[1], R[4], R[7], R[2], R[5], R[8], d[0], d[1], d[2]);
}

/* The order of transformations, which stands beside the transformation, also if that is in a file of its own.
 */
static const char order[] = "uniform token[] xformOpOrder = [\"xformOp:transform\"]\n";

/* ---- What changes ---- */

/* Extends the bounds of what deforms by the points of a frame. */
static void extend(object *o, const drape_frame *frame)
{
    const double *x = frame->positions + 3 * (size_t)o->first_point;
    for (int32_t i = 0; o->deforms && i < 3 * o->points; i++) {
        o->low[i % 3] = fmin(o->low[i % 3], (double)(float)x[i]);
        o->high[i % 3] = fmax(o->high[i % 3], (double)(float)x[i]);
    }
}

static const drape_collider_pose *pose_of(const usd_state *usd, const object *o, const drape_frame *frame)
{
    return &frame->poses[o->body - usd->def->bodies];
}

/* The sample of a frame: in one line, which may be a comment. */
static void put_sample(usd_state *usd, object *o, const drape_frame *frame)
{
    drape_file *file = &o->file;
    const double *x = frame->positions + 3 * (size_t)o->first_point;
    drape_file_print(file, "%.12g: ", usd->code);
    if (!o->deforms)
        put_matrix(file, pose_of(usd, o, frame));
    for (int32_t i = 0; o->deforms && i < o->points; i++, x += 3)
        drape_file_print(file, "%s(%.9g, %.9g, %.9g)", i ? ", " : "[", (double)(float)x[0],
                         (double)(float)x[1], (double)(float)x[2]);
    drape_file_put_text(file, o->deforms ? "],\n" : ",\n");
}

static void format_extent(const object *o, char text[EXTENT_SIZE])
{
    snprintf(text, EXTENT_SIZE, EXTENT, o->low[0], o->low[1], o->low[2], o->high[0], o->high[1], o->high[2]);
}

/* Where the samples begin; before it the extent of what deforms. */
static void put_samples(usd_state *usd, object *o, const drape_frame *frame)
{
    const char *tail = tails[o->number > 0];
    drape_file_declare(&o->file, -(int64_t)strlen(tail), strlen(tail));
    if (o->deforms) {
        char extent[EXTENT_SIZE];
        extend(o, frame);
        format_extent(o, extent);
        drape_file_put_text(&o->file, "float3[] extent = ");
        drape_file_declare(&o->file, drape_file_end(&o->file), strlen(extent));
        drape_file_put_text(&o->file, extent);
        drape_file_put_text(&o->file, "\npoint3f[] points.timeSamples = {\n");
    } else {
        drape_file_put_text(&o->file, order);
        drape_file_put_text(&o->file, "matrix4d xformOp:transform.timeSamples = {\n");
    }
    put_sample(usd, o, frame);
    drape_file_put_text(&o->file, tail);
}

static void put_metadata(usd_state *usd, object *o, const char *prim)
{
    char code[CODE_SIZE];
    drape_file *file = &o->file;
    drape_file_print(file,
                     "#usda 1.0\n(\ndefaultPrim = \"%s\"\ndoc = \"Drape %s\"\nframesPerSecond = %.17g\n"
                     "metersPerUnit = 1\nstartTimeCode = 0\ntimeCodesPerSecond = %.17g\nupAxis = \"%s\"\n"
                     "endTimeCode = ",
                     prim, drape_version(), usd->def->frame_rate, usd->def->frame_rate,
                     usd->def->model->z_up ? "Z" : "Y");
    snprintf(code, sizeof code, CODE, usd->code);
    drape_file_declare(file, drape_file_end(file), strlen(code));
    drape_file_put_text(file, code);
    drape_file_put_text(file, "\n)\n\n");
}

static void begin_mesh(usd_state *usd, drape_file *file, const object *o)
{
    const drape_export_body *body = o->body;
    drape_file_print(file, "def Mesh \"%s\" (\ndoc = ", o->name);
    put_text(file, o->given_name);
    if (!body)
        drape_file_put_text(file, "\nprepend apiSchemas = [\"MaterialBindingAPI\"]");
    if (o->number > 0)
        drape_file_print(file, "\nprepend references = @./" PART_NAME "@", o->number);
    drape_file_put_text(file, "\n)\n{\nuniform token subdivisionScheme = \"none\"\n");
    if (!body) {
        put_cloth(usd, file, o);
        return;
    }
    put_triangles(file, body->triangle, body->triangle_count);
    if (body->deforms)
        return;
    put_rigid(file, body);
}

/* All of the stage but the samples of other files. */
static void put_stage(usd_state *usd, const drape_frame *frame)
{
    object *first = &usd->object[0];
    drape_file *file = &first->file;
    put_metadata(usd, first, "run");
    drape_file_put_text(file, "def Xform \"run\"\n{\ndef Scope \"" MATERIALS "\"\n{\n");
    for (int32_t i = 0; i < usd->materials; i++) {
        const material *m = &usd->material[i];
        drape_file_print(file, "def Material \"%s\" (\ndoc = ", m->prim);
        put_text(file, m->name ? m->name : PLAIN);
        drape_file_print(file,
                         "\n)\n{\ntoken outputs:surface.connect = </run/" MATERIALS
                         "/%s/shader.outputs:surface>\n"
                         "def Shader \"shader\"\n{\nuniform token info:id = \"UsdPreviewSurface\"\n"
                         "color3f inputs:diffuseColor = %s\nfloat inputs:roughness = 0.85\n"
                         "token outputs:surface\n}\n}\n",
                         m->prim, m->name ? "(0.8, 0.8, 0.8)" : "(0.55, 0.16, 0.13)");
    }
    drape_file_put_text(file, "}\n");
    for (int32_t i = 1; i < usd->objects; i++) {
        const object *o = &usd->object[i];
        begin_mesh(usd, file, o);
        if (o->number < 0) {
            drape_file_put_text(file, order);
            drape_file_put_text(file, "matrix4d xformOp:transform = ");
            put_matrix(file, pose_of(usd, o, frame));
            drape_file_put_text(file, "\n");
        }
        drape_file_put_text(file, "}\n");
    }
    begin_mesh(usd, file, first);
    put_samples(usd, first, frame);
}

/* Bounds first: they may be larger than what is there, but not smaller. Blanks take the place of the tail
 * before and of the sign of the comment. */
static drape_status write_next(usd_state *usd, object *o, const drape_frame *frame)
{
    static const char blanks[] = "                ";
    char extent[EXTENT_SIZE], code[CODE_SIZE];
    const char *tail = tails[o->number > 0];
    const size_t length = strlen(tail);
    const off_t before = o->file.kept;
    extend(o, frame);
    format_extent(o, extent);
    if (o->deforms)
        drape_file_overwrite(&o->file, o->file.change[BOUNDS].offset, extent, strlen(extent));
    snprintf(code, sizeof code, CODE, usd->code);
    drape_file_overwrite(&o->file, o->file.change[END].offset, code, strlen(code));
    drape_file_put_text(&o->file, "#");
    put_sample(usd, o, frame);
    drape_file_put_text(&o->file, tail);
    drape_file_overwrite(&o->file, before - (off_t)length, blanks, length + 1);
    return drape_file_keep(&o->file);
}

/* positions.usda appears last: it refers to the others. */
static drape_status usd_write(const drape_export_def *def, void *state, const drape_frame *frame)
{
    usd_state *usd = state;
    drape_status status = DRAPE_OK;
    /* frames between have whole numbers; that at the end of a run may not */
    const double code = frame->time * def->frame_rate, whole = floor(code + .5);
    usd->code = fabs(code - whole) < 1e-6 ? whole : code;
    for (int32_t i = usd->objects - 1; i >= 0 && !status; i--) {
        object *o = &usd->object[i];
        if (o->number < 0)
            continue;
        if (frame->index > 0) {
            status = write_next(usd, o, frame);
            continue;
        }
        if (i == 0) {
            put_stage(usd, frame);
        } else {
            put_metadata(usd, o, "mesh");
            drape_file_put_text(&o->file, "def \"mesh\"\n{\n"); /* no type: alone it is not one to be drawn */
            put_samples(usd, o, frame);
        }
        status = drape_file_publish(&o->file);
    }
    return status;
}

/* ---- Checkpoints ---- */

static void usd_archive(void *state, drape_archive *a)
{
    usd_state *usd = state;
    drape_archive_same(a, "the number of objects in " FILE_NAME, usd->objects);
    drape_archive_double(a, &usd->code);
    for (int32_t i = 0; i < usd->objects && !a->status; i++) {
        object *o = &usd->object[i];
        drape_archive_same(a, "whether an object of " FILE_NAME " changes", o->number >= 0);
        if (o->number < 0 || a->status)
            continue;
        drape_archive_bytes(a, o->low, sizeof o->low);
        drape_archive_bytes(a, o->high, sizeof o->high);
    }
}

const drape_exporter_ops drape_exporter_usd = {
    .entry = {.name = "usd",
              .summary =
                  "positions.usda: OpenUSD with time samples, a mesh for each cloth and collider, polygons, "
                  "texture coordinates and materials, float32; of a second and further objects that change, "
                  "in positions_1.usda ...",
              .reference = "Pixar, OpenUSD 24: UsdGeom, UsdShade"},
    .state_size = sizeof(usd_state),
    .wants_bodies = true,
    .check = usd_check,
    .names = {FILE_NAME, "positions_#.usda"},
    .open = usd_open,
    .write = usd_write,
    .archive = usd_archive,
};
