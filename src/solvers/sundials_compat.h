/* sundials_compat.h: the only file that handles the differences between SUNDIALS 6 and 7. */
#ifndef DRAPE_SOLVERS_SUNDIALS_COMPAT_H
#define DRAPE_SOLVERS_SUNDIALS_COMPAT_H

#include "solvers/reserve.h"

#include <stdint.h>
#include <sundials/sundials_config.h>
#include <sundials/sundials_context.h>
#include <sundials/sundials_types.h>

#if SUNDIALS_VERSION_MAJOR < 6
#error "Drape needs SUNDIALS 6 or later"
#endif

_Static_assert(sizeof(sunindextype) == sizeof(int64_t), "Drape needs SUNDIALS with 64-bit indices");

#if SUNDIALS_VERSION_MAJOR >= 7
#include <sundials/sundials_errors.h>
static inline void drape_sundials_quiet(int line, const char *function, const char *file, const char *message,
                                        SUNErrCode code, void *data, SUNContext context)
{
    (void)line, (void)function, (void)file, (void)message, (void)code, (void)data, (void)context;
}
static inline int drape_sundials_create(SUNContext *out)
{
    int code = SUNContext_Create(SUN_COMM_NULL, out);
    if (!code) {
        SUNContext_ClearErrHandlers(*out);
        SUNContext_PushErrHandler(*out, drape_sundials_quiet, NULL);
    }
    return code;
}
#define DRAPE_KINSOL_QUIET(kin) ((void)0)
#define DRAPE_IDA_QUIET(ida)    ((void)0)
#define DRAPE_ARKODE_QUIET(ark) ((void)0)
#else
static inline int drape_sundials_create(SUNContext *out)
{
    return SUNContext_Create(NULL, out);
}
static inline void drape_sundials_quiet(int code, const char *module, const char *function, char *message,
                                        void *data)
{
    (void)code, (void)module, (void)function, (void)message, (void)data;
}
#define DRAPE_KINSOL_QUIET(kin) KINSetErrHandlerFn(kin, drape_sundials_quiet, NULL)
#define DRAPE_IDA_QUIET(ida)    IDASetErrHandlerFn(ida, drape_sundials_quiet, NULL)
#define DRAPE_ARKODE_QUIET(ark) ARKStepSetErrHandlerFn(ark, drape_sundials_quiet, NULL)
#endif

/* A SUNDIALS context that prints nothing: failures are read from return codes. Errors: DRAPE_E_MEMORY. */
static inline drape_status drape_sundials_context(drape_context *ctx, SUNContext *out)
{
    drape_reserve reserve = {.used = false};
    drape_status status = drape_reserve_open(&reserve, ctx, 0);
    if (!status && drape_sundials_create(out))
        status = drape_fail_memory(ctx, sizeof *out);
    return drape_reserve_close(&reserve, ctx, status);
}

#endif
