/* scene_copy.h: keeps the scene of a run beside its frames. */
#ifndef DRAPE_IO_SCENE_COPY_H
#define DRAPE_IO_SCENE_COPY_H

#include "model/model.h"
#include "model/scene.h"

#define DRAPE_SCENE_COPY "scene.json" /* its name in the folder of a run */

/* Whether the scene file at path is itself folder/scene.json, and so must not be overwritten. */
bool drape_scene_copy_is(const char *path, const char *folder);

/* Writes folder/scene.json, the scene as it was compiled, and copies of its meshes beside it,
 * scene_mesh_0.obj and so on, so that the folder can be moved and its scene compiled again. path is the
 * file of the scene, to which its meshes are relative. A mesh that is not a regular file is not copied.
 * Afterwards the scene names the copies. Errors: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status drape_scene_copy(drape_context *ctx, drape_scene *scene, const drape_model *model,
                              const char *path, const char *folder);

#endif
