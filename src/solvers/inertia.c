/* inertia.c: see inertia.h. */
#include "solvers/inertia.h"

#include "base/finite.h"
#include "solvers/general.h"

drape_status drape_inertia(drape_context *ctx, const drape_pattern *p, const double *values,
                           const atomic_bool *const *cancel, int64_t *negative, bool *known)
{
    if (p->ranks)
        return p->ranks->inertia(ctx, p, values, negative, known);
    drape_arena arena = drape_arena_of(ctx);
    drape_fronts fronts;
    const bool finite = drape_all_finite(values, (size_t)p->nonzeros);
    *negative = 0;
    *known = false;
    drape_status status = finite ? drape_fronts_create(&arena, p, &fronts) : DRAPE_OK;
    if (!status && finite) {
        fronts.cancel = cancel;
        drape_general general = drape_general_of(&arena, &fronts);
        status = drape_general_inertia(&general, values, negative, known);
        drape_general_destroy(&general);
        drape_fronts_destroy(&fronts);
    }
    drape_arena_free(&arena);
    return status;
}
