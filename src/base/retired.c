/* retired.c: see retired.h. */
#include "base/retired.h"

#include <string.h>

#define MAX_NAMES 12

/* NULL-ended, if they are fewer */
static const struct {
    const char *of, *names[MAX_NAMES];
} retired[] = {
    /* made up for what the nonlinear solver now does by itself */
    {"integrator",
     {"coarse_spacing", "correction_tolerance", "corrections", "extrapolation", "forcing", "linear_tolerance",
      "max_linear_iterations", "newton", "predictor", "project", "rescue_iterations"}},
    /* of methods that are gone */
    {"integrator", {"alpha", "beta", "family", "gamma", "rho_inf", "stability_detection"}},
    /* constants now, whose defaults served every scene */
    {"integrator", {"max_speed", "max_substeps", "safety", "strain_limit_tolerance"}},
    {"controller",
     {"dt_max", "every", "least_iterations", "max_attempts", "max_substeps", "most_iterations", "safety"}},
    /* of methods that have it no more: the mode of the DEP report is that of be, and of static */
    {"bdf2", {"on_failure"}},
    {"midpoint", {"on_failure"}},
    {"trbdf2", {"on_failure"}},
    {"stretch.edge", {"min_length"}},
    {"stretch.cst", {"min_area"}},
    {"stretch.curve", {"min_area"}},
    {"stretch.patch", {"min_area"}},
    {"spring.structural", {"min_length"}},
    {"spring.shear", {"min_length"}},
    {"spring.bend", {"min_length"}},
    {"limit.strain", {"cap", "onset"}},
    {"bend.hinge", {"min_altitude", "max_turn"}},
    {"bend.midedge", {"min_altitude", "max_turn"}},
    {"animated_mesh", {"distance"}},
    {"dashpot", {"smoothing"}},
    {"contact", {"restitution_velocity"}},
    {"untangle", {"gap", "sweeps"}},
};

static bool has(size_t i, const char *name)
{
    for (int k = 0; k < MAX_NAMES && retired[i].names[k]; k++)
        if (strcmp(retired[i].names[k], name) == 0)
            return true;
    return false;
}

bool drape_retired(drape_context *ctx, const char *pointer, const char *of, const char *name)
{
    for (size_t i = 0; i < sizeof retired / sizeof *retired; i++)
        if (strcmp(retired[i].of, of) == 0 && has(i, name)) {
            if (ctx)
                drape_log(ctx, DRAPE_LOG_WARNING, "%s: has no effect any more", pointer);
            return true;
        }
    return false;
}

/* The other entries that have settings are in arrays, and named beside them. */
static bool may_be_in(const char *pointer, const char *of)
{
    static const char *const alone[] = {"integrator", "controller", "contact", "untangle"};
    for (size_t i = 0; i < sizeof alone / sizeof *alone; i++) {
        const size_t length = strlen(alone[i]);
        const bool here = strncmp(pointer + 1, alone[i], length) == 0 && pointer[1 + length] == '/';
        if (here || strcmp(of, alone[i]) == 0)
            return here && strcmp(of, alone[i]) == 0;
    }
    return true;
}

bool drape_is_retired(const char *pointer)
{
    for (size_t i = 0; i < sizeof retired / sizeof *retired; i++)
        if (has(i, strrchr(pointer, '/') + 1) && may_be_in(pointer, retired[i].of))
            return true;
    return false;
}
