/* settings.c: "contact" and "self_contact" of a scene, as tables of one entry each. */
#include "compile/compile.h"

static const drape_entry contact = {.name = "contact",
                                    .summary =
                                        "settings of contact with colliders and between layers of cloth",
                                    DRAPE_PARAMS(drape_contact_params)};
static const drape_entry self_contact = {
    .name = "self_contact",
    .summary = "contact of cloth with cloth; without it cloth passes through itself",
    DRAPE_PARAMS(drape_self_contact_params)};

const drape_registry drape_contact_registry = {
    "contact", "contacts", "Contact", "\"contact\" of the scene", (const drape_entry *[]){&contact, NULL},
    NULL};
const drape_registry drape_self_contact_registry = {"self-contact",
                                                    "self_contacts",
                                                    "Self-contact",
                                                    "\"self_contact\" of the scene",
                                                    (const drape_entry *[]){&self_contact, NULL},
                                                    NULL};
