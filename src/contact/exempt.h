/*
 * exempt.h: pairs that contact does not hold. A module outside (realtime/room.h) says which. Exempt pairs
 * have the bounded barrier (barrier.h), which pushes out with no more than the scene's pressure; they limit
 * no step, and are not checked.
 */
#ifndef DRAPE_CONTACT_EXEMPT_H
#define DRAPE_CONTACT_EXEMPT_H

#include "contact/contact.h"
#include "contact/pair.h"

typedef struct drape_exempt {
    int32_t count; /* exempt nodes of the cloth; 0: all pairs are held, and no function is called */
    /* The factor of the pressure on a pair; 0: it is held. */
    double (*factor)(const struct drape_exempt *exempt, const drape_pair *pair);
    /* Whether an exempt pair is pushed apart; if not, `add` makes contacts of its nodes with the surface. */
    bool (*acts)(const struct drape_exempt *exempt, const drape_pair *pair);
    /* Whether any of these nodes is exempt at a collider; -1 stands for no node. */
    bool (*has)(const struct drape_exempt *exempt, int32_t collider, const int32_t *node, int nodes);
    /* Adds the contacts of exempt nodes that are not those of pairs to the active set of a configuration.
     * Errors: DRAPE_E_MEMORY. */
    drape_status (*add)(drape_contact *contact, const drape_configuration *at);
    /* Called when a step begins, where contact has been updated. It may change what is exempt, and then
     * updates contact again. Errors: DRAPE_E_MEMORY. */
    drape_status (*begin)(drape_contact *contact, const drape_contact_at *at);
} drape_exempt;

/* exempt NULL: no pair is exempt. */
static inline double drape_exempt_factor(const drape_exempt *exempt, const drape_pair *pair)
{
    return exempt && exempt->count > 0 ? exempt->factor(exempt, pair) : 0;
}

static inline bool drape_exempt_has(const drape_exempt *exempt, int32_t collider, const int32_t *node,
                                    int nodes)
{
    return exempt && exempt->count > 0 && exempt->has(exempt, collider, node, nodes);
}

#endif
