/* offscreen.h: an OpenGL 3.3 context without a display, by EGL. Mesa draws on the processor if there is no
 * GPU. */
#ifndef DRAPE_RENDER_OFFSCREEN_H
#define DRAPE_RENDER_OFFSCREEN_H

#include "base/context.h"

typedef struct drape_offscreen drape_offscreen;

/* Makes a context and makes it current in this thread. Errors: DRAPE_E_FILE (no EGL, no driver; the message
 * says what to install), DRAPE_E_MEMORY. */
drape_status drape_offscreen_create(drape_context *ctx, drape_offscreen **out);
void drape_offscreen_destroy(drape_offscreen **offscreen);

#endif
