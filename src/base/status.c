/* status.c: names of statuses and the version. */
#include "drape/drape.h"

#define TEXT(x)                     #x
#define DOTTED(major, minor, patch) TEXT(major) "." TEXT(minor) "." TEXT(patch)

const char *drape_version(void)
{
    return DOTTED(DRAPE_VERSION_MAJOR, DRAPE_VERSION_MINOR, DRAPE_VERSION_PATCH);
}

/* The numbers of errors are negative. */
static const char *const good[] = {
    [DRAPE_OK] = "ok",
    [DRAPE_RETRY_NONLINEAR] = "retry_nonlinear",
    [DRAPE_RETRY_LINEAR] = "retry_linear",
    [DRAPE_RETRY_NONFINITE] = "retry_nonfinite",
    [DRAPE_RETRY_DEGENERATE] = "retry_degenerate",
    [DRAPE_RETRY_REJECTED] = "retry_rejected",
};
static const char *const errors[] = {
    [0] = "unknown",
    [-DRAPE_E_ARGUMENT] = "e_argument",
    [-DRAPE_E_MEMORY] = "e_memory",
    [-DRAPE_E_FILE] = "e_file",
    [-DRAPE_E_PARSE] = "e_parse",
    [-DRAPE_E_STEP_TOO_SMALL] = "e_step_too_small",
    [-DRAPE_E_SOLVER] = "e_solver",
    [-DRAPE_E_VERSION] = "e_version",
    [-DRAPE_E_STOPPED] = "e_stopped",
};

const char *drape_status_name(drape_status status)
{
    const int number = status, last_good = sizeof good / sizeof *good, last = sizeof errors / sizeof *errors;
    if (number >= 0)
        return number < last_good ? good[number] : errors[0];
    return number > -last ? errors[-number] : errors[0];
}
