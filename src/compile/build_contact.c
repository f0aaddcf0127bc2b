/* build_contact.c: the parameters of contact, from the scene's "contact", "self_contact" and "untangle", with
 * defaults derived from the scales of the scene. */
#include "base/elementary.h"
#include "base/vec3.h"
#include "compile/stages.h"
#include "model/track.h"

#include <math.h>

enum { IMPLICIT, LAGGED };
static const char *const frictions[] = {"implicit", "lagged", NULL};
static const char *const policies[] = {
    [DRAPE_NO_ROOM_AUTO] = "auto", [DRAPE_NO_ROOM_STOP] = "stop", [DRAPE_NO_ROOM_RELAX] = "relax", NULL};

const drape_param drape_contact_params[DRAPE_CONTACT_PARAM_COUNT] = {
    [DRAPE_CONTACT_DISTANCE] =
        DRAPE_NUMBER("distance", "m", DRAPE_DERIVED("the largest thickness of the cloths"), DRAPE_ABOVE(0),
                     1e3, "activation distance: cloth closer to a collider than this is pushed away"),
    [DRAPE_CONTACT_STIFFNESS] = DRAPE_NUMBER(
        "stiffness", "Pa",
        DRAPE_DERIVED(
            "the larger of areal density (2 gravity L + v^2) / distance, L the diagonal of the rest "
            "bounding box, v the largest speed of cloth, at the start or pinned, plus that of "
            "colliders; and E h / 1000 mean edges"),
        DRAPE_ABOVE(0), 1e15, "scale of the contact pressure at that distance"),
    [DRAPE_CONTACT_FRICTION_VELOCITY] =
        DRAPE_NUMBER("friction_velocity", "m/s", 1e-3, DRAPE_ABOVE(0), 1e3,
                     "sliding speed below which friction falls smoothly to zero"),
    [DRAPE_CONTACT_FRICTION] = DRAPE_CHOICE("friction", IMPLICIT, frictions,
                                            "implicit: of the normal force at the end of the step; lagged: "
                                            "at its start, which keeps matrices symmetric"),
    [DRAPE_CONTACT_NO_ROOM] = DRAPE_CHOICE("no_room", DRAPE_NO_ROOM_AUTO, policies,
                                           "where bodies leave cloth no room, stop: steps fail until the sim "
                                           "stops; relax: the bodies may enter the "
                                           "cloth there, which is reported, until there is room again; auto: "
                                           "relax in advances with a time budget"),
};

const drape_param drape_self_contact_params[DRAPE_SELF_PARAM_COUNT] = {
    [DRAPE_SELF_THICKNESS] = DRAPE_NUMBER("thickness", "m", DRAPE_REQUIRED, DRAPE_ABOVE(0), 1e3,
                                          "half the distance that layers of cloth are kept apart"),
    [DRAPE_SELF_FRICTION] = DRAPE_NUMBER("friction", "1", 0, 0, 1e3, "Coulomb's mu between layers of cloth"),
    [DRAPE_SELF_RESTITUTION] =
        DRAPE_NUMBER("restitution", "1", 0, 0, 1, "speed of rebound / speed of impact, of layers of cloth"),
};

static const char *const failures[] = {"stop", "continue", NULL};

const drape_param drape_untangle_params[DRAPE_UNTANGLE_PARAM_COUNT] = {
    [DRAPE_UNTANGLE_ON_FAILURE] =
        DRAPE_CHOICE("on_failure", 0, failures,
                     "stop: a run whose cloth does not come apart ends before its first step; continue: it "
                     "begins with what was reached, and a warning"),
};

/* Tables of one entry each. */
static const drape_entry contact_entry = {
    .name = "contact",
    .summary = "settings of contact with colliders and between layers of cloth",
    DRAPE_PARAMS(drape_contact_params)};
static const drape_entry self_contact_entry = {
    .name = "self_contact",
    .summary = "contact of cloth with cloth; without it cloth passes through itself",
    DRAPE_PARAMS(drape_self_contact_params)};
static const drape_entry untangle_entry = {
    .name = "untangle",
    .summary =
        "before the first step, cloth that begins through cloth or colliders is taken apart; without it "
        "such cloth begins as it is",
    DRAPE_PARAMS(drape_untangle_params)};

static const drape_entry *const untangle_entries[] = {&untangle_entry, NULL};
const drape_registry drape_untangle_registry = {
    "untangle", "untangles", "Untangling", "\"untangle\" of the scene", untangle_entries, NULL};
static const drape_entry *const contact_entries[] = {&contact_entry, NULL};
const drape_registry drape_contact_registry = {
    "contact", "contacts", "Contact", "\"contact\" of the scene", contact_entries, NULL};
static const drape_entry *const self_contact_entries[] = {&self_contact_entry, NULL};
const drape_registry drape_self_contact_registry = {"self-contact",       "self_contacts",
                                                    "Self-contact",       "\"self_contact\" of the scene",
                                                    self_contact_entries, NULL};

void drape_untangle_values(const drape_model_untangle *untangle, double values[DRAPE_UNTANGLE_PARAM_COUNT])
{
    values[DRAPE_UNTANGLE_ON_FAILURE] = untangle->goes_on;
}

void drape_contact_values(const drape_contact_def *contact, double values[DRAPE_CONTACT_PARAM_COUNT])
{
    values[DRAPE_CONTACT_DISTANCE] = contact->distance;
    values[DRAPE_CONTACT_STIFFNESS] = contact->stiffness;
    values[DRAPE_CONTACT_FRICTION_VELOCITY] = contact->friction_velocity;
    values[DRAPE_CONTACT_FRICTION] = contact->lagged ? LAGGED : IMPLICIT;
    values[DRAPE_CONTACT_NO_ROOM] = contact->no_room;
}

void drape_self_contact_values(const drape_contact_def *contact, double values[DRAPE_SELF_PARAM_COUNT])
{
    values[DRAPE_SELF_THICKNESS] = contact->self_thickness;
    values[DRAPE_SELF_FRICTION] = contact->self_friction;
    values[DRAPE_SELF_RESTITUTION] = contact->self_restitution;
}

static double norm(const double *a)
{
    return drape_hypot(drape_hypot(a[0], a[1]), a[2]);
}

static double track_speed(const drape_track *track)
{
    double most = 0;
    for (size_t k = 1; k < track->key_count; k++) {
        const drape_track_key *a = &track->keys[k - 1], *b = &track->keys[k];
        double move[3];
        for (int i = 0; i < 3; i++)
            move[i] = b->displacement[i] - a->displacement[i];
        most = fmax(most, norm(move) / (b->time - a->time));
    }
    return most;
}

/* Of the fastest point between two frames. */
static double frames_speed(const drape_sequence *frames)
{
    const size_t points = (size_t)frames->node_count;
    double most = 0;
    for (int32_t f = 1; f < frames->frame_count; f++) {
        const double *a = frames->x + 3 * points * (size_t)(f - 1), *b = a + 3 * points;
        double longest = 0;
        for (size_t i = 0; i < points; i++) {
            double move[3];
            vec3_sub(b + 3 * i, a + 3 * i, move);
            longest = fmax(longest, vec3_dot(move, move));
        }
        most = fmax(most, sqrt(longest) / (frames->time[f] - frames->time[f - 1]));
    }
    return most;
}

/* The largest speed at which the scene itself can move cloth against a collider. */
static double scene_speed(const drape_model *model)
{
    double cloth = 0, collider = 0;
    for (size_t i = 0; i < (size_t)model->node_count; i++)
        cloth = fmax(cloth, norm(model->velocity + 3 * i));
    for (int32_t t = 0; t < model->track_count; t++)
        cloth = fmax(cloth, track_speed(&model->tracks[t]));
    for (int32_t i = 0; i < model->moved_count; i++) {
        const drape_track *track = &model->tracks[model->moved_track[i]];
        double arm[3];
        vec3_sub(model->start + 3 * (size_t)model->moved_node[i], track->pivot, arm);
        if (track->turns.key_count > 0)
            cloth = fmax(cloth, track_speed(track) + drape_turns_fastest(&track->turns) * norm(arm));
    }
    for (int32_t i = 0; i < model->collider_count; i++) {
        const drape_collider *c = &model->colliders[i];
        collider = fmax(collider, track_speed(&c->track) + drape_turns_fastest(&c->turns) * c->radius +
                                      frames_speed(&c->frames));
    }
    return cloth + collider;
}

#define ACCURACY_SHARE 0.1 /* of the accuracy that is asked, which contact may take */

/* |g|; without gravity, L / s^2 */
static double fall_acceleration(const drape_model *model)
{
    const double g = norm(model->gravity);
    return g > 0 ? g : model->length;
}

/* sigma (2 |g| L + v^2) / d, with sigma the largest areal density and L the size of the scene. Up to the
 * distance zero, the barrier absorbs 6 d of this per area (contact/barrier.h), which is 12 times the energy
 * of the speed v and of a fall over L; cloth with more energy cannot be stopped. The weight of the cloth is
 * at most d / (2 L) of the stiffness, so that at rest it lies at nearly the distance d. */
static double stiffness_of_fall(const drape_model *model)
{
    double sigma = 0, v = scene_speed(model);
    for (int32_t c = 0; c < model->cloth_count; c++) {
        const drape_cloth *cloth = &model->cloths[c];
        double most = 0; /* of a node's mass, as a multiple of that of the material */
        for (int32_t i = 0; i < cloth->mesh.node_count; i++)
            most = fmax(most, cloth->node_mass[i] / cloth->material_mass[i]);
        sigma = fmax(sigma, most * cloth->material.areal_density);
    }
    return sigma * (2 * fall_acceleration(model) * model->length + v * v) / model->contact.distance;
}

/* A face of size a that is strained by e pulls its nodes against what it meets with a force of about E h
 * e a, on an area of about a^2: a pressure E h e / a. At a tenth of the activation distance the pressure
 * of the barrier is 12 times its scale (contact/barrier.h), so a scale of ELASTIC E h / a holds a strain
 * of 12 ELASTIC, a per cent, there, and larger ones nearer. */
#define ELASTIC 1e-3
static double stiffness_of_strain(const drape_model *model)
{
    double membrane = 0, edges = 0;
    for (int32_t c = 0; c < model->cloth_count; c++) {
        const drape_cloth *cloth = &model->cloths[c];
        membrane = fmax(membrane, fmax(cloth->material.membrane_stiffness,
                                       fmax(cloth->tension.warp, cloth->tension.weft)));
    }
    for (int32_t e = 0; e < model->edge_count; e++)
        edges += model->edge_length[e];
    return ELASTIC * membrane * model->edge_count / edges;
}

/* Cloth that is pinched between bodies is pushed by both of them: their pressures balance across it, and
 * add up along it, where round bodies squeeze it out. A radius r of a lens between balls of radius R is
 * strained by about p r^2 / (R E h). With p = ELASTIC E h / a that is ELASTIC r^2 / (R a), one per cent
 * for ten edges; with p ten times the weight of the cloth, or of what stops it within L, E h would have to
 * be that small. */
#define WEIGHTS 10
static double relaxed_pressure(const drape_model *model)
{
    const double weight = stiffness_of_fall(model) * model->contact.distance / (2 * model->length);
    return fmin(model->contact.stiffness, fmax(WEIGHTS * weight, stiffness_of_strain(model)));
}

drape_status drape_compile_contact(drape_model *model, const drape_scene_def *def)
{
    static const drape_registry *const registries[] = {&drape_contact_registry, &drape_self_contact_registry,
                                                       &drape_untangle_registry};
    static const char *const names[] = {"contact", "self_contact", "untangle"};
    const drape_entry_def defs[] = {{.settings = def->contact, .setting_count = def->contact_count},
                                    {.settings = def->self_contact, .setting_count = def->self_contact_count},
                                    {.settings = def->untangle, .setting_count = def->untangle_count}};
    drape_choice *const choices[] = {&model->contact_choice, &model->self_choice, &model->untangle_choice};
    double all[3][DRAPE_MAX_PARAMS];
    for (int i = 0; i < 3; i++) {
        const char *pointer = DRAPE_FORMAT("/%s", names[i]);
        if (i == 0 || defs[i].settings) /* the others are off unless they are given */
            DRAPE_TRY(drape_params_resolve(model->ctx, pointer, registries[i]->entries[0], defs[i].settings,
                                           defs[i].setting_count, all[i]));
        DRAPE_TRY(drape_compile_choice(model, &defs[i], names[i], choices[i]));
    }
    drape_contact_def *contact = &model->contact;
    const double *values = all[0], distance = values[DRAPE_CONTACT_DISTANCE];
    contact->distance_given = !isnan(distance);
    contact->distance = isnan(distance) ? 0 : distance;
    for (int32_t c = 0; isnan(distance) && c < model->cloth_count; c++)
        contact->distance = fmax(contact->distance, model->cloths[c].material.thickness);
    if (isnan(distance) && model->accuracy.value > 0) /* nobody asks where cloth is within less */
        contact->distance =
            fmax(contact->distance,
                 ACCURACY_SHARE * drape_distance_of(&model->accuracy, drape_model_least_diagonal(model)));
    contact->stiffness = values[DRAPE_CONTACT_STIFFNESS];
    contact->stiffness_given = !isnan(contact->stiffness);
    contact->friction_velocity = values[DRAPE_CONTACT_FRICTION_VELOCITY];
    contact->lagged = values[DRAPE_CONTACT_FRICTION] == LAGGED;
    contact->no_room = (drape_no_room)values[DRAPE_CONTACT_NO_ROOM];
    /* The speed of a fall over the activation distance d: with restitution 0, cloth rises by at most d above
     * the height at which it meets a collider, and so by no more than the distance at which it rests. */
    contact->restitution_velocity = sqrt(2 * fall_acceleration(model) * contact->distance);
    if (def->self_contact) {
        contact->self = true;
        contact->self_thickness = all[1][DRAPE_SELF_THICKNESS];
        contact->self_friction = all[1][DRAPE_SELF_FRICTION];
        contact->self_restitution = all[1][DRAPE_SELF_RESTITUTION];
        if (contact->self_friction > 0 || contact->self_restitution < 1)
            model->has_dissipation = model->has_own_dissipation = true;
    }
    if (def->untangle)
        model->untangle =
            (drape_model_untangle){.given = true, .goes_on = all[2][DRAPE_UNTANGLE_ON_FAILURE] > 0};
    return DRAPE_OK;
}

drape_status drape_compile_contact_stiffness(drape_model *model, const drape_scene_def *def)
{
    (void)def;
    if (!model->contact.stiffness_given)
        model->contact.stiffness = fmax(stiffness_of_fall(model), stiffness_of_strain(model));
    model->contact.relaxed_pressure = relaxed_pressure(model);
    return DRAPE_OK;
}
