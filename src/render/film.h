/* film.h: pictures to a film, by ffmpeg as a child process that reads them from a pipe. SIGPIPE is ignored by
 * whoever uses it: an ffmpeg that dies is an error of a write. */
#ifndef DRAPE_RENDER_FILM_H
#define DRAPE_RENDER_FILM_H

#include "base/context.h"

typedef struct drape_film drape_film;

/* Whether a name ends as one of the films, in letters of any size. */
bool drape_film_knows(const char *path);
const char *drape_film_ending(int index); /* ".mp4"; NULL past the last */

/* DRAPE_E_FILE where there is no ffmpeg to run. */
drape_status drape_film_check(drape_context *ctx);

/* Starts ffmpeg. The film gets its name when it is whole. rate: pictures a second. Errors: DRAPE_E_FILE,
 * DRAPE_E_MEMORY. */
drape_status drape_film_begin(drape_context *ctx, const char *path, int width, int height, double rate,
                              drape_film **out);

/* Adds a picture (width x height x 4). Errors: DRAPE_E_FILE: ffmpeg died; the message has its last line. */
drape_status drape_film_add(drape_film *film, const uint8_t *pixels);

/* Waits for ffmpeg to end and names the film. *film is NULL then. */
drape_status drape_film_end(drape_film **film);

/* Ends ffmpeg and leaves no file; NULL is fine. */
void drape_film_abandon(drape_film **film);

#endif
