/* tracks.c: checks and copies the track of a pin or a collider. */
#include "compile/stages.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const char *fault_of(const drape_track_key *keys, size_t k)
{
    bool finite = isfinite(keys[k].time);
    for (int i = 0; i < 3; i++)
        finite = finite && fabs(keys[k].displacement[i]) <= 1e9;
    if (!finite)
        return "time and displacement must be finite, the displacement within 1e9 m";
    if (k > 0 && !(keys[k].time > keys[k - 1].time))
        return "times must increase from key to key";
    return NULL;
}

drape_status drape_compile_track(drape_model *model, const char *pointer, const drape_track_key *keys,
                                 size_t key_count, drape_track *track)
{
    for (size_t k = 0; k < key_count; k++) {
        char at[192];
        snprintf(at, sizeof at, "%s/track/%zu", pointer, k);
        const char *fault = fault_of(keys, k);
        if (fault)
            return drape_fail_at(model->ctx, DRAPE_E_ARGUMENT, at, "%s", fault);
    }
    track->keys = drape_arena_take(&model->arena, key_count, sizeof *track->keys);
    if (!track->keys)
        return DRAPE_E_MEMORY;
    memcpy(track->keys, keys, key_count * sizeof *track->keys);
    track->key_count = key_count;
    return DRAPE_OK;
}
