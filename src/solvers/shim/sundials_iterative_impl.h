/* sundials_iterative_impl.h: the one name that Debian's kinsol/kinsol_impl.h needs from a header of this name
 * that Debian leaves out: an opaque pointer. */
#ifndef DRAPE_SOLVERS_SHIM_SUNDIALS_ITERATIVE_IMPL_H
#define DRAPE_SOLVERS_SHIM_SUNDIALS_ITERATIVE_IMPL_H

typedef struct _SUNQRData *SUNQRData;

#endif
