/* track.c: see track.h. */
#include "model/track.h"

/* Returns the last key at or before t; -1 if t is before the first. */
static int64_t key_before(const drape_track_key *keys, size_t key_count, double t)
{
    int64_t low = -1, high = (int64_t)key_count;
    while (high - low > 1) {
        int64_t middle = low + (high - low) / 2;
        if (keys[middle].time <= t)
            low = middle;
        else
            high = middle;
    }
    return low;
}

void drape_track_displacement(const drape_track_key *keys, size_t key_count, double t, double displacement[3])
{
    int64_t k = key_before(keys, key_count, t);
    int64_t a = k < 0 ? 0 : k, b = k + 1 < (int64_t)key_count ? k + 1 : a;
    double share = a == b ? 0 : (t - keys[a].time) / (keys[b].time - keys[a].time);
    for (int i = 0; i < 3; i++)
        displacement[i] =
            keys[a].displacement[i] + share * (keys[b].displacement[i] - keys[a].displacement[i]);
}

void drape_track_velocity(const drape_track_key *keys, size_t key_count, double t, double velocity[3])
{
    int64_t k = key_before(keys, key_count, t);
    bool inside = k >= 0 && k + 1 < (int64_t)key_count;
    for (int i = 0; i < 3; i++)
        velocity[i] = inside ? (keys[k + 1].displacement[i] - keys[k].displacement[i]) /
                                   (keys[k + 1].time - keys[k].time)
                             : 0;
}
