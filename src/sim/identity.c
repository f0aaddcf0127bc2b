/*
 * identity.c: identifies what a checkpoint belongs to. Two models are the same if they have the same
 * numbers after compile, however their scenes were written: names, comments, files, frame formats and the
 * run's duration do not count. A member of drape_model that results depend on must be hashed here, itself or
 * by what is computed from it; tests/entries/test_identity.c tries every key of a scene. Two builds are the
 * same if they have the same solvers and compiler, and compute the same bits (sim/reproducible.h).
 */
#include "sim/identity.h"

#include "base/hash.h"
#include "sim/reproducible.h"
#include "sim/sim.h"
#include "solvers/linear.h"
#include "solvers/sundials_compat.h"
#include "solvers/sundials_power.h"

#include <inttypes.h>
#include <klu.h>
#include <stdio.h>
#include <string.h>

#ifdef DRAPE_METIS
#define METIS " metis"
#else
#define METIS ""
#endif

/* ---- The model ---- */

static uint64_t add(uint64_t hash, const void *data, size_t size)
{
    return size > 0 ? drape_hash_bytes(hash, data, size) : hash;
}

static uint64_t add_integer(uint64_t hash, int64_t value)
{
    return add(hash, &value, sizeof value);
}

static uint64_t add_doubles(uint64_t hash, const double *values, size_t count)
{
    return add(hash, values, count * sizeof *values);
}

static uint64_t add_text(uint64_t hash, const char *text)
{
    return add(hash, text, strlen(text) + 1);
}

static uint64_t add_turns(uint64_t hash, const drape_turns *turns)
{
    hash = add_integer(hash, (int64_t)turns->key_count);
    for (size_t k = 0; k < turns->key_count; k++) {
        const drape_turn *turn = &turns->keys[k];
        hash = add_doubles(hash, &turn->time, 1);
        hash = add_doubles(hash, turn->rotation, 9);
        hash = add_doubles(hash, turn->axis, 3);
        hash = add_doubles(hash, &turn->degrees, 1);
    }
    return hash;
}

static uint64_t add_track(uint64_t hash, const drape_track *track)
{
    hash = add_integer(hash, (int64_t)track->key_count);
    for (size_t k = 0; k < track->key_count; k++) {
        hash = add_doubles(hash, &track->keys[k].time, 1);
        hash = add_doubles(hash, track->keys[k].displacement, 3);
    }
    if (track->turns.key_count > 0)
        hash = add_doubles(add_turns(hash, &track->turns), track->pivot, 3);
    return hash;
}

static uint64_t add_term(uint64_t hash, const drape_term *term)
{
    const drape_elements *el = &term->elements;
    const int64_t sizes[] = {term->cloth, el->count, el->nodes, el->rest_count, term->law_count};
    size_t count = (size_t)el->count;
    hash = add_text(hash, term->ops->entry.name);
    hash = add(hash, sizes, sizeof sizes);
    hash = add_doubles(hash, term->params, DRAPE_MAX_PARAMS);
    hash = add(hash, el->node, count * (size_t)el->nodes * sizeof *el->node);
    hash = add_doubles(hash, el->rest, count * (size_t)el->rest_count);
    hash = add_doubles(hash, el->shared, (size_t)el->shared_count);
    hash = add_doubles(hash, term->slider_stiffness, (size_t)drape_term_slider_count(term));
    hash = add_doubles(hash, term->slider_limit, (size_t)drape_term_slider_count(term));
    for (int i = 0; i < term->branch_count; i++)
        hash = add_doubles(add_doubles(hash, &term->branches[i].fraction, 1), &term->branches[i].time, 1);
    if (el->parts) {
        const drape_parts *p = el->parts;
        const int64_t counts[] = {p->count, p->nodes, p->rest_count, p->link_count};
        const size_t links = (size_t)p->link_count;
        hash = add(hash, counts, sizeof counts);
        hash = add(hash, p->node, (size_t)p->count * (size_t)p->nodes * sizeof *p->node);
        hash = add_doubles(hash, p->rest, (size_t)p->count * (size_t)p->rest_count);
        hash = add(hash, p->element, links * sizeof *p->element);
        hash = add(hash, p->part, links * sizeof *p->part);
        hash = add_doubles(hash, p->weight, links);
    }
    if (term->history) {
        const drape_history *history = term->history;
        const size_t keys = history->key_count;
        hash = add_integer(hash, (int64_t)keys);
        hash = add_doubles(hash, history->time, keys);
        hash = add_doubles(hash, history->value, keys);
        hash = add_doubles(hash, history->slope, history->slope ? keys : 0);
    }
    return add_doubles(hash, term->damping, term->damping ? count : 0);
}

static uint64_t add_collider(uint64_t hash, const drape_collider *collider)
{
    const drape_collider_shape *s = &collider->shape;
    const int64_t sizes[] = {s->point_count, s->segment_count, s->triangle_count, s->inscribed};
    hash = add_text(hash, collider->ops->entry.name);
    hash = add_doubles(hash, collider->values, DRAPE_MAX_PARAMS);
    hash = add(hash, sizes, sizeof sizes);
    hash = add_doubles(hash, s->point, 3 * (size_t)s->point_count);
    hash = add(hash, s->segment, 2 * (size_t)s->segment_count * sizeof *s->segment);
    hash = add(hash, s->triangle, 3 * (size_t)s->triangle_count * sizeof *s->triangle);
    hash = add_doubles(hash, &s->radius, 1);
    hash = add_doubles(hash, &s->distance, 1);
    hash = add_doubles(hash, collider->frames.time, (size_t)collider->frames.frame_count);
    hash = add_doubles(hash, collider->frames.x,
                       3 * (size_t)collider->frames.frame_count * (size_t)collider->frames.node_count);
    hash = add_doubles(hash, &collider->friction, 1);
    hash = add_doubles(hash, &collider->restitution, 1);
    hash = add_track(hash, &collider->track);
    hash = add_turns(hash, &collider->turns);
    return add_doubles(hash, collider->pivot, 3);
}

static uint64_t add_contact(uint64_t hash, const drape_contact_def *c)
{
    const double values[] = {c->distance,
                             c->stiffness,
                             c->friction_velocity,
                             c->lagged,
                             c->self,
                             c->self_thickness,
                             c->self_friction,
                             c->self_restitution,
                             c->restitution_velocity,
                             c->no_room,
                             c->relaxed_pressure};
    return add_doubles(hash, values, sizeof values / sizeof *values);
}

static uint64_t add_nodes(uint64_t hash, const drape_model *m)
{
    size_t nodes = (size_t)m->node_count;
    hash = add_doubles(hash, m->rest, 3 * nodes);
    hash = add_doubles(hash, m->start, m->start == m->rest ? 0 : 3 * nodes);
    hash = add_doubles(hash, m->velocity, 3 * nodes);
    hash = add_doubles(hash, m->mass, nodes);
    hash = add(hash, m->triangle, 3 * (size_t)m->triangle_count * sizeof *m->triangle);
    hash = add_doubles(hash, m->edge_length, (size_t)m->edge_count);
    hash = add(hash, m->pinned, nodes);
    hash = add(hash, m->moved_node, (size_t)m->moved_count * sizeof *m->moved_node);
    hash = add(hash, m->moved_track, (size_t)m->moved_count * sizeof *m->moved_track);
    for (int32_t i = 0; i < m->support_count; i++) {
        const int64_t held[] = {m->supports[i].node, m->supports[i].count};
        hash = add(hash, held, sizeof held);
        hash = add_doubles(hash, m->supports[i].direction[0], 6);
        hash = add(hash, m->supports[i].track, sizeof m->supports[i].track);
        hash = add_doubles(hash, m->supports[i].dual[0], 6);
    }
    if (m->image_set_count > 0) {
        const size_t sets = (size_t)m->image_set_count;
        hash = add(hash, m->image_start, (sets + 1) * sizeof *m->image_start);
        hash = add(hash, m->image, (size_t)m->image_start[sets] * sizeof *m->image);
    }
    for (size_t i = 0; m->ride && i < nodes; i++) {
        const int64_t on[] = {m->ride[i].collider, m->ride[i].triangle};
        hash = add(hash, on, sizeof on);
        hash = add_doubles(hash, m->ride[i].own, 3);
        hash = add_doubles(hash, &m->ride[i].offset, 1);
    }
    return hash;
}

uint64_t drape_model_identity(const drape_model *m)
{
    if (m->part)
        return m->part->hash;
    const int64_t sizes[] = {m->cloth_count, m->term_count,  m->node_count,     m->triangle_count,
                             m->edge_count,  m->moved_count, m->collider_count, m->internal_count};
    uint64_t hash = add(DRAPE_HASH_START, sizes, sizeof sizes);
    hash = add_nodes(hash, m);
    for (int32_t i = 0; i < m->track_count; i++)
        hash = add_track(hash, &m->tracks[i]);
    for (int32_t i = 0; i < m->term_count; i++)
        hash = add_term(hash, &m->terms[i]);
    if (m->sewn)
        hash = add(hash, m->sewn, (size_t)m->node_count * sizeof *m->sewn);
    for (int32_t i = 0; i < m->collider_count; i++)
        hash = add_collider(hash, &m->colliders[i]);
    for (int32_t i = 0; i < m->event_count; i++) {
        const drape_model_event *event = &m->events[i];
        const int64_t numbers[] = {event->cloth, event->pinned_count, event->direction, event->action,
                                   event->once};
        hash = add_text(hash, event->ops->entry.name);
        hash = add(hash, numbers, sizeof numbers);
        hash = add(hash, event->pinned, (size_t)event->pinned_count * sizeof *event->pinned);
        hash = add_doubles(hash, event->values, DRAPE_MAX_PARAMS);
    }
    if (m->ignored)
        hash = add(hash, m->ignored, (size_t)(m->collider_count + m->cloth_count) * (size_t)m->cloth_count);
    const double values[] = {m->untangle.given, m->untangle.goes_on};
    hash = add_doubles(hash, values, sizeof values / sizeof *values);
    return add_contact(add_doubles(hash, m->gravity, 3), &m->contact);
}

/* ---- The choices ---- */

/* Parameters that nobody set may be NaN, with the same bits everywhere. */
static uint64_t choices_hash(const drape_sim *sim)
{
    const drape_chosen *c = &sim->chosen;
    const drape_param *of_integrator = c->integrator->entry.params,
                      *of_controller = c->controller->entry.params;
    uint64_t hash = add_doubles(DRAPE_HASH_START, &sim->frame_rate, 1);
    hash = add_doubles(hash, c->integrator_values,
                       (size_t)drape_param_place(of_integrator, c->integrator->entry.param_count));
    return add_doubles(hash, c->controller_values,
                       (size_t)drape_param_place(of_controller, c->controller->entry.param_count));
}

/* ---- The build ---- */

void drape_sim_describe_libraries(char *text, size_t size)
{
    size_t used = (size_t)snprintf(text, size, "SUNDIALS %s%s, KLU %d.%d.%d%s, solvers", SUNDIALS_VERSION,
                                   drape_sundials_power_is_ours() ? "" : " shared", KLU_MAIN_VERSION,
                                   KLU_SUB_VERSION, KLU_SUBSUB_VERSION, METIS);
    for (int i = 0; drape_linears_names[i] && used < size; i++)
        used += (size_t)snprintf(text + used, size - used, " %s", drape_linears_names[i]);
}

static void archive_name(drape_archive *a, const char *what, const char *name)
{
    char there[DRAPE_ARCHIVE_TEXT];
    snprintf(there, sizeof there, "%s", name);
    drape_archive_text(a, there, sizeof there);
    if (drape_archive_good(a) && strcmp(there, name) != 0)
        drape_archive_fail(a, DRAPE_E_ARGUMENT, "the checkpoint is of the %s \"%.60s\"; here it is \"%s\"",
                           what, there, name);
}

static void archive_hash(drape_archive *a, const char *what, uint64_t hash)
{
    uint64_t there = hash;
    drape_archive_bytes(a, &there, sizeof there);
    if (drape_archive_good(a) && there != hash)
        drape_archive_fail(a, DRAPE_E_ARGUMENT,
                           "the checkpoint is of %s: %016" PRIx64 " there, %016" PRIx64 " here", what, there,
                           hash);
}

void drape_sim_archive_identity(drape_sim *sim, drape_archive *a)
{
    const drape_model *m = drape_sim_base_model(sim);
    if (!sim->identity_known) {
        sim->model_hash = drape_model_identity(m);
        sim->choices_hash = choices_hash(sim);
        sim->identity_known = true;
    }
    /* With "ranks", several ranks share the model; any number of them can read it then. */
    char kind[DRAPE_ARCHIVE_TEXT];
    snprintf(kind, sizeof kind, m->part ? "ranks" : "identity");
    drape_archive_text(a, kind, sizeof kind);
    a->by_ranks = strcmp(kind, "ranks") == 0;
    if (drape_archive_good(a) && !a->by_ranks && strcmp(kind, "identity") != 0)
        drape_archive_fail(a, DRAPE_E_PARSE, "the checkpoint has \"%s\" where \"identity\" is expected",
                           kind);
    if (drape_archive_good(a) && m->part && !a->by_ranks)
        drape_archive_fail(
            a, DRAPE_E_ARGUMENT,
            "the checkpoint is of a run of one process, which remembers what several ranks cannot");
    char here[DRAPE_ARCHIVE_TEXT], there[DRAPE_ARCHIVE_TEXT];
    char libraries[DRAPE_ARCHIVE_TEXT / 2];
    drape_sim_describe_libraries(libraries, sizeof libraries);
    snprintf(here, sizeof here, "Drape %s, arithmetic %016" PRIx64 ", compiler %s, %s", drape_version(),
             drape_arithmetic_hash(), __VERSION__, libraries);
    memcpy(there, here, sizeof there);
    drape_archive_text(a, there, sizeof there);
    if (drape_archive_good(a) && strcmp(there, here) != 0)
        drape_archive_fail(a, DRAPE_E_VERSION, "the checkpoint is of another build (%.150s); this is %.150s",
                           there, here);
    archive_name(a, "integrator", sim->chosen.integrator->entry.name);
    archive_name(a, "controller", sim->chosen.controller->entry.name);
    drape_archive_same(a, "the number of nodes", drape_model_node_count(m));
    drape_archive_same(a, "the number of free nodes", drape_model_all_free(m));
    archive_hash(a, "another model", sim->model_hash);
    archive_hash(a, "other settings of integrator, controller or frame rate", sim->choices_hash);
}
