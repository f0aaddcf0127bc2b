/* compile.h: compiles a scene to a model. Names are looked up only here. */
#ifndef DRAPE_COMPILE_COMPILE_H
#define DRAPE_COMPILE_COMPILE_H

#include "base/registry.h"
#include "model/model.h"

extern const drape_entry drape_material_entry; /* its parameters are those of a material */

/* The parameters of contact and of self-contact, in the order of their values in a model. */
enum {
    DRAPE_CONTACT_DISTANCE,
    DRAPE_CONTACT_STIFFNESS,
    DRAPE_CONTACT_FRICTION_VELOCITY,
    DRAPE_CONTACT_FRICTION,
    DRAPE_CONTACT_NO_ROOM,
    DRAPE_CONTACT_PARAM_COUNT
};
enum { DRAPE_SELF_THICKNESS, DRAPE_SELF_FRICTION, DRAPE_SELF_RESTITUTION, DRAPE_SELF_PARAM_COUNT };
enum { DRAPE_UNTANGLE_ON_FAILURE, DRAPE_UNTANGLE_PARAM_COUNT };
extern const drape_param drape_untangle_params[DRAPE_UNTANGLE_PARAM_COUNT];
extern const drape_param drape_contact_params[DRAPE_CONTACT_PARAM_COUNT];
extern const drape_param drape_self_contact_params[DRAPE_SELF_PARAM_COUNT];

/* Parameter lists that offer no choice of an implementation, as tables of one entry each. */
extern const drape_registry drape_material_registry, drape_contact_registry, drape_self_contact_registry,
    drape_untangle_registry;

void drape_contact_values(const drape_contact_def *contact, double values[DRAPE_CONTACT_PARAM_COUNT]);
void drape_untangle_values(const drape_model_untangle *untangle, double values[DRAPE_UNTANGLE_PARAM_COUNT]);
void drape_self_contact_values(const drape_contact_def *contact, double values[DRAPE_SELF_PARAM_COUNT]);

/* Converts a host's def of this or an older version to this version. Data that are not the host's live in the
 * arena. Errors: DRAPE_E_VERSION, DRAPE_E_MEMORY. */
drape_status drape_compile_read_def(drape_context *ctx, drape_arena *arena, const drape_scene_def *given,
                                    drape_scene_def *out);

/* Compiles a def to a model. Faults are reported at JSON pointers of the scene. Integrator and controller are
 * copied but not checked yet. */
drape_status drape_compile(drape_context *ctx, const drape_scene_def *def, drape_model **out);

/* The model in which the nodes that are marked in `pinned` (node_count) are pinned, and no others, and in
 * which nodes have the masses `mass` (node_count) [kg]; NULL: those of base. Nodes that base pins keep their
 * tracks; edges between nodes that it does not pin are not clamped. base must be compiled from a scene, and
 * outlive the result. Errors: DRAPE_E_MEMORY, DRAPE_E_STOPPED. */
drape_status drape_compile_repinned(drape_context *ctx, const drape_model *base, const uint8_t *pinned,
                                    const double *mass, drape_model **out);

/* Resolves an event of a host, whose function the caller has; its arrays are taken from the arena. Errors:
 * DRAPE_E_ARGUMENT, DRAPE_E_MEMORY. */
drape_status drape_compile_host_event(drape_context *ctx, drape_arena *arena, const drape_model *model,
                                      const drape_event_def *def, drape_model_event *to);

#endif
