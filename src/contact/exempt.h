/*
 * exempt.h: pairs that contact does not hold, for whoever says so from outside (realtime/room.h): they have
 * the bounded barrier (barrier.h), which pushes out with a pressure of no more than the scene's, limit no
 * step, and are not checked.
 */
#ifndef DRAPE_CONTACT_EXEMPT_H
#define DRAPE_CONTACT_EXEMPT_H

#include "contact/contact.h"
#include "contact/pair.h"

typedef struct drape_exempt {
    int32_t count; /* exempt nodes of the cloth; 0: all pairs are held, and no question is asked */
    /* The factor of the pressure on a pair; 0: it is held. */
    double (*factor)(const struct drape_exempt *exempt, const drape_pair *pair);
    /* Whether a pair that is exempt acts itself; if not, its nodes have contacts of `add`. */
    bool (*acts)(const struct drape_exempt *exempt, const drape_pair *pair);
    /* Whether any of these nodes is exempt at a collider; -1 stands for no node. */
    bool (*has)(const struct drape_exempt *exempt, int32_t collider, const int32_t *node, int nodes);
    /* Adds the contacts of exempt nodes that no pair stands for, to the active set of a configuration.
     * Errors: DRAPE_E_MEMORY. */
    drape_status (*add)(drape_contact *contact, const drape_configuration *at);
    /* A step begins, at a point where contact has been updated: what is exempt may change, after which this
     * updates it again. Errors: DRAPE_E_MEMORY. */
    drape_status (*begin)(drape_contact *contact, const drape_contact_at *at);
} drape_exempt;

/* exempt NULL: nobody says anything. */
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
