/* window.h: a desktop window, by GLFW, and the input of its user. There can be one at a time. */
#ifndef DRAPE_RENDER_WINDOW_H
#define DRAPE_RENDER_WINDOW_H

#include "base/context.h"

typedef enum drape_input_kind {
    DRAPE_INPUT_KEY,     /* letter, or one of the keys below */
    DRAPE_INPUT_PRESS,   /* a button went down at x, y */
    DRAPE_INPUT_RELEASE, /* a button went up */
    DRAPE_INPUT_MOVE,    /* the pointer is at x, y */
    DRAPE_INPUT_SCROLL   /* the wheel turned by y notches */
} drape_input_kind;

enum {
    DRAPE_KEY_ESCAPE = 27,
    DRAPE_KEY_TAB = 9,
    DRAPE_KEY_LEFT = 256,
    DRAPE_KEY_RIGHT,
    DRAPE_KEY_UP,
    DRAPE_KEY_DOWN,
    DRAPE_KEY_PAGE_UP,
    DRAPE_KEY_PAGE_DOWN
};
enum { DRAPE_BUTTON_LEFT, DRAPE_BUTTON_RIGHT, DRAPE_BUTTON_MIDDLE };

typedef struct drape_input {
    drape_input_kind kind;
    int key;          /* KEY: the ASCII character printed on the key, letters in capitals, or DRAPE_KEY_* */
    int button;       /* PRESS, RELEASE */
    bool shift, ctrl; /* held */
    double x, y;      /* pixels of the picture from its upper left */
} drape_input;

typedef struct drape_window drape_window;

/* Opens a window and makes its OpenGL 3.3 context current. Errors: DRAPE_E_FILE (no display, no OpenGL),
 * DRAPE_E_MEMORY. */
drape_status drape_window_create(drape_context *ctx, const char *title, int width, int height,
                                 drape_window **out);
void drape_window_destroy(drape_window **window);

/* Collects the input since the last poll; if there is none, waits for up to `seconds`. */
void drape_window_poll(drape_window *window, double seconds);
bool drape_window_next(drape_window *window, drape_input *input); /* false: there is no more */
bool drape_window_closed(const drape_window *window);
void drape_window_size(const drape_window *window, int *width, int *height); /* of its picture [pixels] */
void drape_window_swap(drape_window *window);

#endif
