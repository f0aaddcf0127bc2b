/* retired.c: see retired.h. */
#include "base/retired.h"

#include <string.h>

static const struct {
    const char *of, *name;
} retired[] = {
    /* made up for what the nonlinear solver now does by itself */
    {"integrator", "coarse_spacing"},
    {"integrator", "correction_tolerance"},
    {"integrator", "corrections"},
    {"integrator", "extrapolation"},
    {"integrator", "forcing"},
    {"integrator", "linear_tolerance"},
    {"integrator", "max_linear_iterations"},
    {"integrator", "newton"},
    {"integrator", "predictor"},
    {"integrator", "project"},
    {"integrator", "rescue_iterations"},
    /* of methods that are gone */
    {"integrator", "alpha"},
    {"integrator", "beta"},
    {"integrator", "family"},
    {"integrator", "gamma"},
    {"integrator", "rho_inf"},
    {"integrator", "stability_detection"},
    /* constants now, whose defaults served every scene */
    {"integrator", "max_speed"},
    {"integrator", "max_substeps"},
    {"integrator", "safety"},
    {"integrator", "strain_limit_tolerance"},
    {"controller", "dt_max"},
    {"controller", "every"},
    {"controller", "least_iterations"},
    {"controller", "max_attempts"},
    {"controller", "max_substeps"},
    {"controller", "most_iterations"},
    {"controller", "safety"},
    {"stretch.edge", "min_length"},
    {"stretch.cst", "min_area"},
    {"stretch.curve", "min_area"},
    {"stretch.patch", "min_area"},
    {"spring.structural", "min_length"},
    {"spring.shear", "min_length"},
    {"spring.bend", "min_length"},
    {"limit.strain", "cap"},
    {"limit.strain", "onset"},
    {"bend.hinge", "min_altitude"},
    {"bend.hinge", "max_turn"},
    {"bend.midedge", "min_altitude"},
    {"bend.midedge", "max_turn"},
    {"animated_mesh", "distance"},
    {"dashpot", "smoothing"},
    {"contact", "restitution_velocity"},
    {"untangle", "gap"},
    {"untangle", "sweeps"},
};

bool drape_retired(drape_context *ctx, const char *pointer, const char *of, const char *name)
{
    for (size_t i = 0; i < sizeof retired / sizeof *retired; i++)
        if (strcmp(retired[i].of, of) == 0 && strcmp(retired[i].name, name) == 0) {
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
        if (strcmp(retired[i].name, strrchr(pointer, '/') + 1) == 0 && may_be_in(pointer, retired[i].of))
            return true;
    return false;
}
