/* newton_params.c: the parameters of integrators that use Newton's method. */
#include "nonlinear/newton.h"

const char *const drape_newton_norms[] = {
    [DRAPE_NORM_MAX] = "max", [DRAPE_NORM_L1] = "l1", [DRAPE_NORM_L2] = "l2", NULL};
const char *const drape_newton_failures[] = {"reject", "accept", NULL};
const char *const drape_newton_globalizations[] = {"line_search", "none", "work", "auto", NULL};

const drape_param drape_newton_params[DRAPE_NEWTON_PARAM_COUNT] = {DRAPE_NEWTON_PARAMS};
