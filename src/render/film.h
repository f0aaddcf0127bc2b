/* film.h: encodes pictures as a film, by ffmpeg as a child process that reads them from a pipe. The caller
 * has to ignore SIGPIPE: the death of ffmpeg is then reported as a failed write. */
#ifndef DRAPE_RENDER_FILM_H
#define DRAPE_RENDER_FILM_H

#include "io/file.h"

typedef struct drape_film drape_film;

/* Whether a file name has the ending of a film, in upper or lower case. */
bool drape_film_knows(const char *path);
const char *drape_film_ending(int index); /* ".mp4"; NULL past the last */

/* DRAPE_E_FILE if there is no ffmpeg to run. */
drape_status drape_film_check(drape_context *ctx);

/* Starts ffmpeg. The film gets its name when it is complete. rate: pictures per second. Errors: DRAPE_E_FILE,
 * DRAPE_E_MEMORY. */
drape_status drape_film_begin(drape_context *ctx, const char *path, int width, int height, double rate,
                              drape_film **out);

/* Adds a picture (width x height x 4). Errors: DRAPE_E_FILE (ffmpeg died; the message has its last line). */
drape_status drape_film_add(drape_film *film, const uint8_t *pixels);

/* Waits for ffmpeg to end and gives the film its name. *film becomes NULL. */
drape_status drape_film_end(drape_film **film);

/* Terminates ffmpeg and removes the file; *film becomes NULL, and may be NULL. */
void drape_film_abandon(drape_film **film);

#endif
