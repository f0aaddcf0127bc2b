/* matrix.c: see matrix.h. */
#include "nonlinear/matrix.h"

#include "nonlinear/approx_jacobian.h"
#include "nonlinear/factored_jacobian.h"

drape_status drape_matrix_choose(drape_arena *arena, drape_system *system, double dt, drape_matrix *usual,
                                 drape_matrix *approximate)
{
    bool factored = false, only = true;
    drape_status status = drape_factored_jacobian_is_better(system, dt, &factored, &only);
    only |= !drape_system_contact(system);
    drape_matrix *of_pairs = factored ? approximate : usual;
    if (!status && factored) {
        usual->ops = &drape_factored_jacobian_ops;
        status = drape_factored_jacobian_create(arena, system, dt, (drape_factored_jacobian **)&usual->self);
    }
    if (status || (factored && only))
        return status;
    of_pairs->ops = &drape_approx_jacobian_ops;
    return drape_approx_jacobian_create(arena, system, (drape_approx_jacobian **)&of_pairs->self);
}
