/* exact_jacobian.c: see exact_jacobian.h. */
#include "nonlinear/exact_jacobian.h"

struct drape_exact_jacobian {
    drape_system *system;
    drape_sun_linear *linear;
    int64_t version;                             /* of the pattern */
    bool contact_unsymmetric, terms_unsymmetric; /* the Jacobian of contact, of the terms may be */
};

drape_status drape_exact_jacobian_create(drape_arena *arena, drape_system *system, SUNContext sun,
                                         const drape_linear_ops *linear, bool near,
                                         drape_exact_jacobian **out)
{
    drape_exact_jacobian *s = *out = drape_arena_take(arena, 1, sizeof *s);
    if (drape_ranks_agree_memory(drape_model_ranks(drape_system_model(system)), arena->ctx, s))
        return DRAPE_E_MEMORY;
    s->system = system;
    s->version = drape_system_pattern_version(system);
    s->contact_unsymmetric = !drape_system_is_symmetric(system);
    s->terms_unsymmetric = !drape_system_has_symmetric_terms(system);
    drape_status status =
        drape_sun_linear_create(arena, sun, linear, drape_system_pattern(system), drape_system_pool(system),
                                drape_system_cancel_flag(system), &s->linear);
    /* By the symmetric matrix. Without friction, a flag of 13 x 13 nodes takes a quarter and three quarters
     * more iterations with 1e-4 and 1e-3 than with 1e-5, others as many, and the least CPU with 1e-4. */
    if (!status && near && (s->contact_unsymmetric || s->terms_unsymmetric))
        status = drape_sun_linear_use_near(s->linear, s->contact_unsymmetric ? DRAPE_LINEAR_TOLERANCE
                                                                             : DRAPE_LINEAR_TIGHT);
    return status;
}

static void destroy(void *matrix)
{
    drape_exact_jacobian *s = matrix;
    if (s)
        drape_sun_linear_destroy(&s->linear);
}

/* Contact may couple new nodes: then the linear solver is created again. */
static drape_status extend_pattern(drape_exact_jacobian *s, const drape_point *point)
{
    bool changed;
    drape_status status = drape_system_extend_pattern(s->system, point, &changed);
    s->linear->stale |= s->version != drape_system_pattern_version(s->system);
    if (!status && s->linear->stale)
        status = drape_sun_linear_extend_pattern(s->linear, drape_system_pattern(s->system));
    if (!status)
        s->version = drape_system_pattern_version(s->system);
    return status;
}

static drape_status assemble(void *matrix, const drape_point *at, double mass_weight, bool positive,
                             drape_work *work)
{
    drape_exact_jacobian *s = matrix;
    const double share = positive ? 1 : 0;
    const double before = drape_system_clock(s->system) - s->linear->factor_seconds; /* without an analysis */
    drape_point point = *at;
    drape_status status = extend_pattern(s, at);
    if (status)
        return status;
    point.contact = DRAPE_CONTACT_SYMMETRIC;
    drape_sun_linear_set_positions(s->linear, point.x, drape_system_model(s->system)->node_of_free);
    drape_system_jacobian(s->system, &point, mass_weight, share, s->linear->values);
    drape_sun_linear_forget_exact(s->linear);
    if (s->linear->near && (s->terms_unsymmetric || (s->contact_unsymmetric && share < 1))) {
        drape_sun_linear_keep_exact(s->linear);
        point.stress = NULL;
        drape_system_symmetrize(s->system, &point, share, s->linear->values);
    }
    work->jacobians++;
    work->jacobian_seconds += drape_system_clock(s->system) - s->linear->factor_seconds - before;
    return DRAPE_OK;
}

static drape_status factor(void *matrix, bool definite, drape_work *work)
{
    drape_exact_jacobian *s = matrix;
    const drape_status status = drape_sun_linear_factor(s->linear, definite);
    *work = drape_work_with_linear(*work, s->linear);
    return status;
}

static drape_status solve(void *matrix, const double *b, double tolerance, double *x, bool *definite,
                          drape_work *work)
{
    drape_exact_jacobian *s = matrix;
    s->linear->tolerance = tolerance;
    *definite = true;
    const drape_status status = drape_sun_linear_solve(s->linear, b, x);
    *work = drape_work_with_linear(*work, s->linear);
    return status;
}

drape_status drape_exact_jacobian_at(drape_exact_jacobian *s, const drape_point *point, double mass_weight,
                                     const drape_pattern **pattern, const double **values)
{
    drape_status status = extend_pattern(s, point);
    if (status)
        return status;
    drape_system_jacobian(s->system, point, mass_weight, 0, s->linear->values);
    *pattern = drape_system_pattern(s->system);
    *values = s->linear->values;
    return DRAPE_OK;
}

static void archive(void *matrix, drape_archive *a)
{
    drape_exact_jacobian *s = matrix;
    if (drape_archive_has_read(a))
        drape_archive_note(a, drape_sun_linear_ensure_pattern(s->linear, drape_system_pattern(s->system)));
    if (drape_archive_has_read(a))
        s->version = drape_system_pattern_version(s->system);
    s->linear->stale |= s->version != drape_system_pattern_version(s->system);
    drape_sun_linear_archive(s->linear, a, false);
}

static size_t bytes(const void *matrix)
{
    return drape_sun_linear_bytes(((const drape_exact_jacobian *)matrix)->linear);
}

const drape_matrix_ops drape_exact_jacobian_ops = {.exact = true,
                                                   .direct = true,
                                                   .assemble = assemble,
                                                   .factor = factor,
                                                   .solve = solve,
                                                   .archive = archive,
                                                   .bytes = bytes,
                                                   .destroy = destroy};
