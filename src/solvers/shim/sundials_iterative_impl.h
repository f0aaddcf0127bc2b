/* sundials_iterative_impl.h: Debian's kinsol/kinsol_impl.h includes a header of this name that Debian does
 * not install. It needs only one name from it, an opaque pointer. */
#ifndef DRAPE_SOLVERS_SHIM_SUNDIALS_ITERATIVE_IMPL_H
#define DRAPE_SOLVERS_SHIM_SUNDIALS_ITERATIVE_IMPL_H

typedef struct _SUNQRData *SUNQRData;

#endif
