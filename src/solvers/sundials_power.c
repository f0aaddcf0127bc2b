/*
 * sundials_power.c: SUNDIALS computes every power by its SUNRpowerR, which calls pow of the C library. The
 * linker replaces that function by the one here (--wrap=SUNRpowerR in src/meson.build, and in the files by
 * which hosts find the static library). A shared library of SUNDIALS keeps its own.
 */
#include "solvers/sundials_power.h"
#include "base/elementary.h"

#include <sundials/sundials_math.h>

sunrealtype __wrap_SUNRpowerR(sunrealtype base, sunrealtype exponent); /* the name that --wrap demands */

sunrealtype __wrap_SUNRpowerR(sunrealtype base, sunrealtype exponent)
{
    return base > 0 ? drape_pow(base, exponent) : 0; /* as sundials_math.h defines it */
}

bool drape_sundials_power_is_ours(void)
{
    /* volatile: the compiler assumes that different names are different functions, which --wrap changes */
    sunrealtype (*volatile linked)(sunrealtype, sunrealtype) = SUNRpowerR;
    return linked == __wrap_SUNRpowerR;
}
