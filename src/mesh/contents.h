/* contents.h: reads a whole file into memory. */
#ifndef DRAPE_MESH_CONTENTS_H
#define DRAPE_MESH_CONTENTS_H

#include "base/arena.h"

typedef struct drape_contents {
    char *data; /* size bytes, then a 0 byte */
    size_t size;
} drape_contents;

/* Returns folder/file, or file alone if it is absolute or there is no folder; NULL with a message if memory
 * is out. */
char *drape_contents_path(drape_arena *arena, const char *folder, const char *file);

/* Reads a regular file of less than 2 GiB, whose path is made of folder and file as above, into memory of the
 * arena. Errors, at the pointer: DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status drape_contents_read(drape_arena *arena, const char *pointer, const char *folder,
                                 const char *file, drape_contents *contents);

#endif
