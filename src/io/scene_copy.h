/* scene_copy.h: keeps the scene of a run beside its frames. */
#ifndef DRAPE_IO_SCENE_COPY_H
#define DRAPE_IO_SCENE_COPY_H

#include "io/folder.h"
#include "model/model.h"
#include "model/scene.h"

#define DRAPE_SCENE_COPY   "scene.json" /* its name in the folder of a run */
#define DRAPE_SCENE_MESHES "scene_mesh_*"

/* Called for each file that a scene names, with its path and the JSON pointer of its name. */
typedef drape_status drape_file_visit(void *user, const char *path, const char *pointer);

/* Visits the meshes of cloths and colliders and the files of starts of a scene, whose file is at `scene`;
 * "": in the working directory. Errors: those of visit, DRAPE_E_MEMORY. */
drape_status drape_scene_files(drape_context *ctx, const drape_model *model, const char *scene,
                               drape_file_visit *visit, void *user);

/* Whether the scene file at path is itself folder/scene.json, and so must not be overwritten. */
bool drape_scene_copy_is(const char *path, const char *folder);

/* Writes folder/scene.json, the scene as it was compiled, and copies of its files beside it,
 * scene_mesh_0.obj, scene_mesh_1.npy and so on, so that the folder can be moved and its scene compiled again.
 * path is the file of the scene, to which they are relative. A file that is not a regular file is not copied.
 * Afterwards the scene names the copies. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status drape_scene_copy(drape_context *ctx, drape_scene *scene, const drape_model *model,
                              const char *path, drape_folder *folder);

#endif
