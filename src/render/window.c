/* window.c: see window.h. */
#include "render/window.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <string.h>

#define MAX_INPUTS 256 /* between two polls; more are dropped */

struct drape_window {
    drape_context *ctx;
    GLFWwindow *handle;
    drape_input inputs[MAX_INPUTS];
    int count, taken;
    bool ready;  /* GLFW is initialized */
    double x, y; /* of the pointer, from events: a query would give where it has moved since */
};

static void put(GLFWwindow *handle, drape_input input)
{
    drape_window *w = glfwGetWindowUserPointer(handle);
    int width, height, pixels, rows;
    if (w->count == MAX_INPUTS)
        return;
    glfwGetWindowSize(handle, &width, &height);
    glfwGetFramebufferSize(handle, &pixels, &rows);
    if (input.kind != DRAPE_INPUT_SCROLL) {
        input.x = width > 0 ? w->x * pixels / width : w->x;
        input.y = height > 0 ? w->y * rows / height : w->y;
    }
    w->inputs[w->count++] = input;
}

static bool is_held(GLFWwindow *handle, int left, int right)
{
    return glfwGetKey(handle, left) == GLFW_PRESS || glfwGetKey(handle, right) == GLFW_PRESS;
}

/* Letters are those printed on the key, for any keyboard layout. */
static void on_key(GLFWwindow *handle, int key, int scancode, int action, int mods)
{
    static const int keys[][2] = {
        {GLFW_KEY_ESCAPE, DRAPE_KEY_ESCAPE},   {GLFW_KEY_TAB, DRAPE_KEY_TAB},
        {GLFW_KEY_LEFT, DRAPE_KEY_LEFT},       {GLFW_KEY_RIGHT, DRAPE_KEY_RIGHT},
        {GLFW_KEY_UP, DRAPE_KEY_UP},           {GLFW_KEY_DOWN, DRAPE_KEY_DOWN},
        {GLFW_KEY_PAGE_UP, DRAPE_KEY_PAGE_UP}, {GLFW_KEY_PAGE_DOWN, DRAPE_KEY_PAGE_DOWN}};
    const char *name = glfwGetKeyName(key, scancode);
    int code = key < 128 ? key : 0;
    if (action == GLFW_RELEASE)
        return;
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        code = keys[i][0] == key ? keys[i][1] : code;
    if (name && name[0] && !name[1])
        code = name[0] >= 'a' && name[0] <= 'z' ? name[0] - 'a' + 'A' : name[0];
    put(handle, (drape_input){.kind = DRAPE_INPUT_KEY,
                              .key = code,
                              .shift = mods & GLFW_MOD_SHIFT,
                              .ctrl = mods & GLFW_MOD_CONTROL});
}

static void on_button(GLFWwindow *handle, int button, int action, int mods)
{
    put(handle, (drape_input){.kind = action == GLFW_PRESS ? DRAPE_INPUT_PRESS : DRAPE_INPUT_RELEASE,
                              .button = button,
                              .shift = mods & GLFW_MOD_SHIFT,
                              .ctrl = mods & GLFW_MOD_CONTROL});
}

static void on_move(GLFWwindow *handle, double x, double y)
{
    drape_window *w = glfwGetWindowUserPointer(handle);
    w->x = x;
    w->y = y;
    put(handle, (drape_input){.kind = DRAPE_INPUT_MOVE,
                              .shift = is_held(handle, GLFW_KEY_LEFT_SHIFT, GLFW_KEY_RIGHT_SHIFT),
                              .ctrl = is_held(handle, GLFW_KEY_LEFT_CONTROL, GLFW_KEY_RIGHT_CONTROL)});
}

static void on_scroll(GLFWwindow *handle, double x, double y)
{
    (void)x;
    put(handle, (drape_input){.kind = DRAPE_INPUT_SCROLL, .y = y});
}

drape_status drape_window_create(drape_context *ctx, const char *title, int width, int height,
                                 drape_window **out)
{
    drape_window *w = *out = drape_alloc(ctx, 1, sizeof *w);
    if (!w)
        return DRAPE_E_MEMORY;
    w->ctx = ctx;
    w->ready = glfwInit();
    if (w->ready) {
        glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
        glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
        glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
        glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
        w->handle = glfwCreateWindow(width, height, title, NULL, NULL);
    }
    if (!w->handle) {
        const char *why = NULL;
        glfwGetError(&why);
        drape_status status =
            drape_fail(ctx, DRAPE_E_FILE, "%s: %s; drape render draws without a display",
                       w->ready ? "no window with OpenGL 3.3" : "there is no display for a window",
                       why ? why : "GLFW does not say why");
        drape_window_destroy(out);
        return status;
    }
    glfwMakeContextCurrent(w->handle);
    glfwSwapInterval(1);
    glfwSetWindowUserPointer(w->handle, w);
    glfwSetKeyCallback(w->handle, on_key);
    glfwGetCursorPos(w->handle, &w->x, &w->y);
    glfwSetMouseButtonCallback(w->handle, on_button);
    glfwSetCursorPosCallback(w->handle, on_move);
    glfwSetScrollCallback(w->handle, on_scroll);
    return DRAPE_OK;
}

void drape_window_destroy(drape_window **window)
{
    drape_window *w = *window;
    if (!w)
        return;
    if (w->handle)
        glfwDestroyWindow(w->handle);
    if (w->ready)
        glfwTerminate();
    drape_free(w->ctx, w);
    *window = NULL;
}

void drape_window_poll(drape_window *window, double seconds)
{
    window->count = window->taken = 0;
    if (seconds > 0)
        glfwWaitEventsTimeout(seconds);
    else
        glfwPollEvents();
}

bool drape_window_next(drape_window *window, drape_input *input)
{
    if (window->taken == window->count)
        return false;
    *input = window->inputs[window->taken++];
    return true;
}

bool drape_window_closed(const drape_window *window)
{
    return glfwWindowShouldClose(window->handle);
}

void drape_window_size(const drape_window *window, int *width, int *height)
{
    glfwGetFramebufferSize(window->handle, width, height);
}

void drape_window_swap(drape_window *window)
{
    glfwSwapBuffers(window->handle);
}
