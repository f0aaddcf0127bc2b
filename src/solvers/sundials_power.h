/* sundials_power.h: the powers by which IDA and KINSOL choose steps, orders and tolerances. */
#ifndef DRAPE_SOLVERS_SUNDIALS_POWER_H
#define DRAPE_SOLVERS_SUNDIALS_POWER_H

#include <stdbool.h>

/* Whether they are those of base/elementary.h; false: of the C library, as in a build with the shared
 * libraries of SUNDIALS, or in a program that links the static library without its linker option. */
bool drape_sundials_power_is_ours(void);

#endif
