/* predict.c: see predict.h. */
#include "contact/predict.h"

#include "base/vec3.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define NEAR 0.1 /* relative difference of forces below which the Jacobian has the tangent */

drape_status drape_predictions_init(drape_arena *arena, int32_t points, drape_predictions *p)
{
    *p = (drape_predictions){.arena = arena};
    p->first = drape_arena_take(arena, (size_t)points, sizeof *p->first);
    for (int32_t i = 0; p->first && i < points; i++)
        p->first[i] = -1;
    return drape_arena_status(arena);
}

void drape_predictions_clear(drape_predictions *p)
{
    for (int32_t i = 0; i < p->count; i++)
        p->first[p->list[i].node[0]] = -1;
    p->count = 0;
}

drape_status drape_predictions_reserve(drape_predictions *p, int32_t capacity)
{
    if (capacity <= p->capacity)
        return DRAPE_OK;
    drape_predicted *list = drape_arena_resize(p->arena, p->list, (size_t)capacity, sizeof *list);
    if (!list)
        return DRAPE_E_MEMORY;
    p->list = list;
    p->capacity = capacity;
    return DRAPE_OK;
}

bool drape_predictions_add(drape_predictions *p, const drape_active_contact *contact, double force)
{
    if (p->count == p->capacity)
        return false;
    drape_predicted *to = &p->list[p->count];
    memcpy(to->node, contact->pair.node, sizeof to->node);
    to->collider = contact->pair.collider;
    to->force = force;
    to->weight = NAN;
    to->next = p->first[to->node[0]];
    p->first[to->node[0]] = p->count++;
    return true;
}

/* The prediction for a contact; NULL: there is none. */
static drape_predicted *find(const drape_predictions *p, const drape_active_contact *contact)
{
    for (int32_t i = p->count > 0 ? p->first[contact->pair.node[0]] : -1; i >= 0; i = p->list[i].next)
        if (p->list[i].collider == contact->pair.collider &&
            memcmp(p->list[i].node, contact->pair.node, sizeof p->list[i].node) == 0)
            return &p->list[i];
    return NULL;
}

double drape_predictions_stiffness(const drape_predictions *p, const drape_active_contact *contact,
                                   const drape_contact_law *law, double weight, double v[4][3])
{
    drape_predicted *of = find(p, contact);
    const size_t points = (size_t)contact->gap.closest.points;
    if (!of || isnan(of->force))
        return NAN;
    if (of->gap == contact->gap.value && of->m == contact->gap.m && of->weight == weight &&
        memcmp(of->v, v, points * sizeof *v) == 0)
        return of->secant;
    of->secant = drape_predicted_stiffness(&contact->gap, law, weight, v, of->force);
    of->gap = contact->gap.value;
    of->m = contact->gap.m;
    of->weight = weight;
    memcpy(of->v, v, points * sizeof *v);
    return of->secant;
}

/* The normal force if the gap has another value, and its rate the value that follows from the weight. */
static double force_at(const drape_gap *gap, const drape_contact_law *law, double weight, double v[4][3],
                       double value)
{
    drape_gap moved = *gap;
    double at[4][3];
    moved.value = value;
    memcpy(at, v, sizeof at);
    double squares = 0;
    for (int a = 0; a < gap->closest.points; a++)
        squares += gap->closest.c[a] * gap->closest.c[a];
    for (int a = 0; a < gap->closest.points; a++)
        vec3_add_scaled(weight * (value - gap->value) * gap->closest.c[a] / squares, gap->closest.normal,
                        at[a]);
    const drape_normal normal = drape_normal_at(&moved, law, at);
    return drape_normal_force(&normal);
}

/* The force falls with the gap, whose logarithm is bisected until half of the digits are known. The bounded
 * barrier of exempt cloth has no secant: it is near enough to linear. */
double drape_predicted_stiffness(const drape_gap *gap, const drape_contact_law *law, double weight,
                                 double v[4][3], double force)
{
    const double now = force_at(gap, law, weight, v, gap->value);
    double low = law->low * law->distance, high = law->distance;
    if (!(fabs(force - now) > NEAR * fmax(force, now)) || !(law->low > 0) || !(gap->value > low))
        return NAN;
    if (force > now)
        high = gap->value;
    else
        low = gap->value;
    while (high - low > sqrt(DBL_EPSILON) * high) {
        const double middle = sqrt(low * high);
        if (force_at(gap, law, weight, v, middle) > force)
            low = middle;
        else
            high = middle;
    }
    const double end = force > now ? low : high;
    return (force - now) / (gap->value - end);
}
