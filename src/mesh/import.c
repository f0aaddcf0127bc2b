/* import.c: passes a mesh file to the format that its extension names. */
#include "mesh/contents.h"
#include "mesh/mesh.h"

drape_status drape_mesh_read(drape_context *ctx, const char *pointer, const char *folder, const char *file,
                             drape_mesh *mesh)
{
    const drape_import_ops *import = NULL;
    char known[256] = "";
    for (int i = 0; !import && drape_imports[i]; i++) {
        if (drape_ends_in(file, drape_imports[i]->ending))
            import = drape_imports[i];
        drape_list_add(known, sizeof known, drape_imports[i]->ending);
    }
    if (!import)
        return drape_refuse(ctx, pointer, "%s: unknown ending; known are %s", file, known);

    const locale_t old = drape_locale_enter();
    const drape_mesh_source source = {.pointer = pointer, .file = file};
    drape_arena arena = drape_arena_of(ctx);
    drape_contents whole = {0};
    drape_status status = drape_contents_read(&arena, pointer, folder, file, &whole);
    if (!status)
        status = import->read(ctx, &source, whole.data, whole.size, mesh);
    drape_arena_free(&arena);
    drape_locale_leave(old);
    return status;
}

drape_status drape_mesh_from_file(drape_context *ctx, const char *pointer, const char *folder,
                                  const char *file, drape_mesh *mesh)
{
    const char *place = DRAPE_FORMAT("%s/file", pointer);
    return drape_mesh_read(ctx, place, folder, file, mesh);
}
