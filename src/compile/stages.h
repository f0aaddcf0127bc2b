/* stages.h: the stages of drape_compile, one file each. All take the model under construction and report
 * faults at JSON pointers. */
#ifndef DRAPE_COMPILE_STAGES_H
#define DRAPE_COMPILE_STAGES_H

#include "base/param.h"
#include "compile/compile.h"

/* Names number `index` of a list as the scene does or, without a name there, by its kind: "pin3". name: the
 * member of its struct, each of `size` bytes. Refuses the name of one before it; many: what they are. */
drape_status drape_compile_name(drape_model *model, const char *pointer, const char *kind, const char *many,
                                const char *given, int32_t index, char **name, size_t size);

/* Checks a def along the keys of a scene: required arrays are not NULL, all values are in range. */
drape_status drape_compile_check_def(drape_context *ctx, const drape_scene_def *def);

/* Resolves the material of a cloth whose mesh is complete, and lumps its mass. pointer: "/cloth/0". */
drape_status drape_compile_material(drape_model *model, const char *pointer, const drape_cloth_def *def,
                                    drape_cloth *cloth);

/* Applies the masses of its nodes, after the material. pointer: "/cloth/0". */
drape_status drape_compile_masses(drape_model *model, const char *pointer, const drape_cloth_def *def,
                                  drape_cloth *cloth);

/* Reads the render meshes and binds them to the meshes at rest, after these. */
drape_status drape_compile_render_meshes(drape_model *model, const drape_scene_def *def);

/* Computes where all cloths start and their initial velocities, after the meshes and masses. */
drape_status drape_compile_start(drape_model *model, const drape_scene_def *def);

/* Pairs the nodes of periodic edges, puts them where they start and shares their masses, after the start. */
drape_status drape_compile_periodic(drape_model *model, const drape_scene_def *def);

/* Checks that what a scene with periodic edges has besides them keeps the period, and lists the nodes that
 * are coupled because their images are, after the terms. def is not used. */
drape_status drape_compile_images(drape_model *model, const drape_scene_def *def);

/* Checks that all images of a node are pinned or none is. */
drape_status drape_compile_pinned_images(const drape_model *model);

/* Marks the pinned nodes of all cloths, numbers the free ones, and stores the tracks. */
drape_status drape_compile_pins(drape_model *model, const drape_scene_def *def);

/* Numbers the free nodes of a model in order, and lists the moved ones. track_of_node (node_count): -1: fixed
 * or free. */
drape_status drape_compile_number_nodes(drape_model *model, const int32_t *track_of_node);

/* Checks a track of one or more keys and copies it. pointer: that of its pin or collider. */
drape_status drape_compile_track(drape_model *model, const char *pointer, const drape_track_key *keys,
                                 size_t key_count, drape_track *track);
drape_status drape_compile_turns(drape_model *model, const char *pointer, const drape_turn_key *keys,
                                 size_t key_count, drape_turns *turns);

/* Copies a choice of the scene; a type that is NULL is replaced by the fallback. */
drape_status drape_compile_choice(drape_model *model, const drape_entry_def *def, const char *fallback,
                                  drape_choice *choice);

/* Resolves contact and self-contact, after the materials. */
drape_status drape_compile_contact(drape_model *model, const drape_scene_def *def);

/* The default of contact's stiffness, after the colliders, whose tracks it depends on. def is not used. */
drape_status drape_compile_contact_stiffness(drape_model *model, const drape_scene_def *def);

/* Copies the function table that a host gives for a term or collider, which begins with its struct_size: at
 * least `least` bytes, and at most `size`. Errors: DRAPE_E_ARGUMENT, DRAPE_E_VERSION. */
drape_status drape_compile_take_ops(drape_context *ctx, const char *what, const void *given, size_t least,
                                    void *own, size_t size);

/* Builds the colliders, after contact. */
drape_status drape_compile_colliders(drape_model *model, const drape_scene_def *def);

/* Finds where colliders carry pins, after both. */
drape_status drape_compile_rides(drape_model *model, const drape_scene_def *def);

/* Resolves which cloths touch which colliders and cloths, after these. */
drape_status drape_compile_ignored(drape_model *model, const drape_scene_def *def);

/* Resolves the events, after the pins. */
drape_status drape_compile_events(drape_model *model, const drape_scene_def *def);

/* Finds the nodes that seams join, before the terms. */
drape_status drape_compile_seams(drape_model *model, const drape_scene_def *def);

/* Checks and copies the histories, before the terms. */
drape_status drape_compile_histories(drape_model *model, const drape_scene_def *def);

/* Finds the history of a term whose elements are built, if its parameters, def, name one or a ramp. pointer:
 * that of the term. */
#define DRAPE_HISTORY_PARAM "history"
drape_status drape_compile_history_of(drape_model *model, const char *pointer, const drape_entry_def *def,
                                      drape_term *term);

/* Gives a term the history of this name. pointer: that of the name. */
drape_status drape_compile_history_named(drape_model *model, const char *pointer, const char *name,
                                         drape_term *term);

/* Builds the terms of all cloths and seams and assigns indices to measures and internal variables. */
drape_status drape_compile_terms(drape_model *model, const drape_scene_def *def);

/* Assigns the indices of the internal variables of a term in a state, and of its measures in the list of all
 * measures. */
void drape_compile_number_elements(drape_model *model, drape_term *term);

/* Builds the terms of the scene's gravity anew, for cloths whose masses have changed. */
drape_status drape_compile_weight(drape_model *model);

/* Builds the pattern of the Jacobian from all terms and contact with colliders, and finds the block of each
 * node pair of each element. */
drape_status drape_compile_pattern(drape_model *model);

#endif
