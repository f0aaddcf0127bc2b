/* offscreen.c: see offscreen.h. libepoxy ends the process if a library is missing, so the libraries are
 * looked for here before any call of epoxy. */
#include "render/offscreen.h"

#include <dlfcn.h>
#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <stdlib.h>
#include <string.h>

#define HINT "Debian's libegl1, libgl1 and libgl1-mesa-dri draw without a display"

struct drape_offscreen {
    drape_context *ctx;
    EGLDisplay display;
    EGLContext context;
};

/* Stays loaded: epoxy will need it. */
static bool have_library(const char *name)
{
    return dlopen(name, RTLD_LAZY | RTLD_GLOBAL) != NULL;
}

static drape_status open_all(drape_offscreen *o)
{
    const EGLenum platforms[] = {EGL_PLATFORM_SURFACELESS_MESA, EGL_PLATFORM_DEVICE_EXT};
    const char *const names[] = {"EGL_MESA_platform_surfaceless", "EGL_EXT_platform_device"};
    static const EGLint wanted[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT,
                                    EGL_NONE};
    static const EGLint version[] = {EGL_CONTEXT_MAJOR_VERSION,
                                     3,
                                     EGL_CONTEXT_MINOR_VERSION,
                                     3,
                                     EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                     EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                     EGL_NONE};
    EGLConfig config = NULL; /* EGL_NO_CONFIG_KHR: the context only draws into its own buffers */
    EGLint count = 0;
    bool opened = false;
    setenv("EGL_LOG_LEVEL", "fatal", 0); /* Mesa would report the drivers that it tries on stderr */
    if (!have_library("libEGL.so.1"))
        return drape_fail(o->ctx, DRAPE_E_FILE, "there is no libEGL.so.1 to draw with: " HINT);
    if (!have_library("libOpenGL.so.0") && !have_library("libGL.so.1"))
        return drape_fail(o->ctx, DRAPE_E_FILE, "there is no libGL.so.1 to draw with: " HINT);
    const char *extensions = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    for (int i = 0; extensions && !opened && i < 2; i++) {
        o->display = strstr(extensions, names[i])
                         ? eglGetPlatformDisplayEXT(platforms[i], EGL_DEFAULT_DISPLAY, NULL)
                         : EGL_NO_DISPLAY;
        opened = o->display != EGL_NO_DISPLAY && eglInitialize(o->display, NULL, NULL);
    }
    if (!opened) {
        o->display = EGL_NO_DISPLAY;
        return drape_fail(o->ctx, DRAPE_E_FILE, "EGL has no driver that draws without a display: " HINT);
    }
    if (eglBindAPI(EGL_OPENGL_API)) {
        eglChooseConfig(o->display, wanted, &config, 1, &count);
        o->context = eglCreateContext(o->display, count ? config : NULL, EGL_NO_CONTEXT, version);
    }
    if (o->context == EGL_NO_CONTEXT)
        return drape_fail(o->ctx, DRAPE_E_FILE, "EGL has no OpenGL 3.3 (error 0x%04x): " HINT,
                          (unsigned)eglGetError());
    if (!eglMakeCurrent(o->display, EGL_NO_SURFACE, EGL_NO_SURFACE, o->context))
        return drape_fail(o->ctx, DRAPE_E_FILE, "EGL cannot draw without a surface (error 0x%04x): " HINT,
                          (unsigned)eglGetError());
    return DRAPE_OK;
}

drape_status drape_offscreen_create(drape_context *ctx, drape_offscreen **out)
{
    drape_offscreen *o = *out = drape_alloc(ctx, 1, sizeof *o);
    if (!o)
        return DRAPE_E_MEMORY;
    *o = (drape_offscreen){.ctx = ctx, .display = EGL_NO_DISPLAY, .context = EGL_NO_CONTEXT};
    drape_status status = open_all(o);
    if (status)
        drape_offscreen_destroy(out);
    return status;
}

void drape_offscreen_destroy(drape_offscreen **offscreen)
{
    drape_offscreen *o = *offscreen;
    if (!o)
        return;
    if (o->context != EGL_NO_CONTEXT) {
        eglMakeCurrent(o->display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
        eglDestroyContext(o->display, o->context);
    }
    if (o->display != EGL_NO_DISPLAY)
        eglTerminate(o->display);
    drape_free(o->ctx, o);
    *offscreen = NULL;
}
