/* fallback.c: see fallback.h. */
#include "solvers/fallback.h"

extern const drape_linear_ops drape_linear_multifrontal;

drape_fallback drape_fallback_of(drape_arena *arena, const drape_pattern *pattern)
{
    return (drape_fallback){.ops = pattern->ranks ? pattern->ranks->direct : &drape_linear_multifrontal,
                            .pattern = pattern,
                            .arena = drape_arena_within(arena)};
}

void drape_fallback_destroy(drape_fallback *f)
{
    drape_linear_destroy(f->ops, &f->solver);
    drape_arena_free(&f->arena);
}

void drape_fallback_use_threads(drape_fallback *f, drape_pool *pool)
{
    f->pool = pool;
    if (f->solver && f->ops->use_threads)
        f->ops->use_threads(f->solver, pool);
}

void drape_fallback_watch(drape_fallback *f, const atomic_bool *const *cancel)
{
    f->cancel = cancel;
    if (f->solver && f->ops->watch)
        f->ops->watch(f->solver, cancel);
}

static drape_status create(drape_fallback *f)
{
    drape_status status = f->ops->create(&f->arena, f->pattern, &f->solver);
    if (status) {
        drape_fallback_destroy(f);
        return status;
    }
    drape_fallback_use_threads(f, f->pool);
    drape_fallback_watch(f, f->cancel);
    return status;
}

drape_status drape_fallback_factor(drape_fallback *f, const double *values)
{
    f->count++;
    drape_status status = f->solver ? DRAPE_OK : create(f);
    if (!status)
        status = f->ops->factor(f->solver, values);
    f->active = !status;
    return status;
}

void drape_fallback_archive(drape_fallback *f, bool *factored, drape_archive *a, const double *values)
{
    bool there = f->solver != NULL;
    drape_archive_int64(a, &f->count);
    drape_archive_bool(a, &f->active);
    drape_archive_bool(a, factored);
    drape_archive_bool(a, &there);
    if (drape_archive_has_read(a) && there && !f->solver)
        drape_archive_note(a, create(f));
    if (drape_archive_good(a) && there)
        drape_linear_archive(f->ops, f->solver, a, f->active ? values : NULL);
}

drape_linear_report drape_fallback_report(const drape_fallback *f, const drape_linear_ops *owner)
{
    return (drape_linear_report){.ops = owner, .fallbacks = f->count, .fallback = f->solver ? f->ops : NULL};
}

size_t drape_fallback_bytes(const drape_fallback *f)
{
    return f->solver ? drape_linear_bytes(f->ops, f->solver) : 0;
}
