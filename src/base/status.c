/* status.c: names of statuses and the version. */
#include "drape/drape.h"

#define TEXT(x)                     #x
#define DOTTED(major, minor, patch) TEXT(major) "." TEXT(minor) "." TEXT(patch)

const char *drape_version(void)
{
    return DOTTED(DRAPE_VERSION_MAJOR, DRAPE_VERSION_MINOR, DRAPE_VERSION_PATCH);
}

const char *drape_status_name(drape_status status)
{
    switch (status) {
    case DRAPE_OK:
        return "ok";
    case DRAPE_RETRY_NONLINEAR:
        return "retry_nonlinear";
    case DRAPE_RETRY_LINEAR:
        return "retry_linear";
    case DRAPE_RETRY_NONFINITE:
        return "retry_nonfinite";
    case DRAPE_RETRY_DEGENERATE:
        return "retry_degenerate";
    case DRAPE_RETRY_REJECTED:
        return "retry_rejected";
    case DRAPE_E_ARGUMENT:
        return "e_argument";
    case DRAPE_E_MEMORY:
        return "e_memory";
    case DRAPE_E_FILE:
        return "e_file";
    case DRAPE_E_PARSE:
        return "e_parse";
    case DRAPE_E_STEP_TOO_SMALL:
        return "e_step_too_small";
    case DRAPE_E_SOLVER:
        return "e_solver";
    case DRAPE_E_VERSION:
        return "e_version";
    case DRAPE_E_STOPPED:
        return "e_stopped";
    }
    return "unknown";
}
