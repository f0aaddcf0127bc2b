/* settings.c: "contact", "self_contact" and "untangle" of a scene, as tables of one entry each. */
#include "compile/compile.h"

static const drape_entry contact = {.name = "contact",
                                    .summary =
                                        "settings of contact with colliders and between layers of cloth",
                                    DRAPE_PARAMS(drape_contact_params)};
static const drape_entry self_contact = {
    .name = "self_contact",
    .summary = "contact of cloth with cloth; without it cloth passes through itself",
    DRAPE_PARAMS(drape_self_contact_params)};
static const drape_entry untangle = {
    .name = "untangle",
    .summary = "before the first step, cloth that begins through cloth or colliders is taken apart; without it "
               "such cloth begins as it is",
    DRAPE_PARAMS(drape_untangle_params)};

const drape_registry drape_untangle_registry = {"untangle",
                                                "untangles",
                                                "Untangling",
                                                "\"untangle\" of the scene",
                                                (const drape_entry *[]){&untangle, NULL},
                                                NULL};
const drape_registry drape_contact_registry = {
    "contact", "contacts", "Contact", "\"contact\" of the scene", (const drape_entry *[]){&contact, NULL},
    NULL};
const drape_registry drape_self_contact_registry = {"self-contact",
                                                    "self_contacts",
                                                    "Self-contact",
                                                    "\"self_contact\" of the scene",
                                                    (const drape_entry *[]){&self_contact, NULL},
                                                    NULL};
