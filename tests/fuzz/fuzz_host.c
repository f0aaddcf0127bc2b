/*
 * fuzz_host.c: what a host does with a running sim, in any order: it advances it, also within a budget,
 * moves, pins, attaches, places, changes, saves and restores. The first byte chooses the scene, the second
 * the integrator, the third whether what is sent too fast is placed; then come the calls. One that is refused
 * leaves the state to the bit, and no query changes it. A sim that was made from a checkpoint goes along from
 * there: what is done to one is done to the other, with the same status and the same bits.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/finite.h"
#include "fuzz/fuzz.h"
#include "integrators/integrator.h"

#define MAX_MEMORY ((size_t)64 << 20)
#define MAX_CALLS  24
#define MAX_EVENTS 4
#define COUNT      3   /* of nodes that a call names, at most */
#define NUMBERS    9   /* that a call reads */
#define FAR        0.2 /* [m] about the size of the cloth */

/* ---- Scenes; apostrophes stand for quotation marks ---- */

#define SHEET                                                                                                \
    "{'name': 'a', 'mesh': {'grid': 'equilateral', 'edges': 3, 'edge_length': 0.06},"                        \
    "'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"                                 \
    "'terms': ['stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 1e-3}, 'drag.wind'],"     \
    "'pins': [{'name': 'left', 'corner': 'top-left'}, {'name': 'right', 'corner': 'top-right', 'track': "    \
    "[[0, [0, 0, 0]], [0.1, [0.02, 0, 0]]]}]}"
#define MEMBRANE                                                                                             \
    "{'name': 'b', 'mesh': {'grid': 'square', 'columns': 4, 'rows': 3, 'width': 0.15, 'height': 0.1, "       \
    "'transform': {'translate': [0, 0.03, 0]}},"                                                             \
    "'material': {'young_modulus': 2e4, 'poisson_ratio': 0.3, 'thickness': 1e-3, 'density': 300},"           \
    "'terms': ['stretch.cst', 'bend.midedge', 'limit.strain', {'type': 'damp.kelvin_voigt', 'beta': "        \
    "2e-3}]"
#define END ", 'gravity': [0, -9.81, 0], 'integrator': {'dt': 0.01}, 'duration': 1, 'frame_rate': 60}"

/* An octahedron, in the folder in which the target runs. */
#define BODY "fuzz_host_body.obj"
static const char body[] =
    "v 0.1 -0.06 0.05\nv 0.02 -0.06 0.05\nv 0.06 -0.02 0.05\nv 0.06 -0.1 0.05\nv 0.06 -0.06 0.09\n"
    "v 0.06 -0.06 0.01\nf 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";

static const char *const scenes[] = {
    "{'drape': 1, 'cloth': [" SHEET "]" END,
    "{'drape': 1, 'cloth': [" SHEET "], 'events': [{'type': 'pin_force', 'pins': 'left', 'limit': 0.002, "
    "'action': 'release'}, {'type': 'height', 'height': -0.02, 'action': 'release', 'pins': 'right'}, "
    "{'type': 'energy', 'bound': 1e-5}]" END,
    "{'drape': 1, 'cloth': [" SHEET "], 'colliders': [{'name': 'ball', 'type': 'sphere', 'center': [0.05, "
    "-0.07, 0.05], 'radius': 0.06, 'friction': 0.3}, {'name': 'floor', 'type': 'plane', 'point': [0, -0.15, "
    "0], 'normal': [0, 1, 0]}], 'self_contact': {'thickness': 0.004}" END,
    "{'drape': 1, 'cloth': [" MEMBRANE "}], 'colliders': [{'name': 'box', 'type': 'box', 'center': [0.07, "
    "-0.04, 0.05], 'size': [0.08, 0.08, 0.08], 'friction': 0.5, 'track': [[0, [0, 0, 0]], [0.2, [0, 0.05, "
    "0]]]}, {'name': 'rod', 'type': 'capsule', 'a': [0, 0.1, 0.05], 'b': [0.15, 0.1, 0.05], 'radius': "
    "0.02}], 'contact': {'friction': 'lagged', 'no_room': 'relax'}" END,
    "{'drape': 1, 'cloth': [" MEMBRANE ", 'pins': [{'name': 'p', 'edge': 'left', 'attach': 'box'}]}, " SHEET
    "], 'colliders': [{'name': 'box', 'type': 'box', 'center': [-0.06, 0.03, 0.05], 'size': [0.08, 0.05, "
    "0.08]}], 'self_contact': {'thickness': 0.003}" END,
    "{'drape': 1, 'cloth': [" MEMBRANE "}, " SHEET "], 'seams': [{'name': 's', 'type': 'stitch', 'a': "
    "{'cloth': 'b', 'nodes': [0, 1]}, 'b': {'cloth': 'a', 'nodes': [2, 3]}}]" END,
    "{'drape': 1, 'cloth': [" MEMBRANE ", 'periodic': [{'from': {'edge': 'left'}, 'to': {'edge': 'right'}, "
    "'period': [0.16, 0, 0]}]}], 'colliders': [{'name': 'floor', 'type': 'plane', 'point': [0, -0.05, 0], "
    "'normal': [0, 1, 0]}]" END,
    "{'drape': 1, 'cloth': [" MEMBRANE
    ", 'pins': [{'name': 'p', 'edge': 'left', 'axis': [1, 0, 0]}, {'name': "
    "'q', 'edge': 'right', 'track': [[0, [0, 0, 0]], [0.1, [0.03, 0.01, 0]]]}]}]" END,
    "{'drape': 1, 'cloth': [" SHEET
    "], 'colliders': [{'name': 'body', 'type': 'animated_mesh', 'file': '" BODY
    "', 'friction': 0.3}], 'self_contact': {'thickness': 0.002}" END,
    "{'drape': 1, 'cloth': [" MEMBRANE ", 'velocity': [0.3, 1, 0]}, {'name': 'a', 'mesh': {'grid': 'square', "
    "'columns': 3, 'rows': 3, 'width': 0.1, 'height': 0.1, 'transform': {'translate': [0, 0.031, 0]}}, "
    "'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.cst', "
    "'bend.hinge', {'type': 'relax.maxwell', 'fraction_1': 0.3, 'time_1': 0.05}]}], 'self_contact': "
    "{'thickness': 0.002}, 'untangle': {}" END,
    "{'drape': 1, 'cloth': [{'name': 'a', 'mesh': {'grid': 'square', 'columns': 4, 'rows': 3, 'width': 0.15, "
    "'height': 0.1}, 'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200}, 'terms': "
    "['stretch.tension', 'bend.hinge', {'type': 'load.pressure', 'pressure': 3, 'history': 'ramp'}, {'type': "
    "'air.added_mass', 'span': 0.1}], 'pins': [{'edge': 'left', 'turns': [{'time': 0, 'rotate': [0, 0, 1, "
    "0]}, {'time': 0.3, 'rotate': [0, 0, 1, 60]}]}]}], 'histories': [{'name': 'ramp', 'times': [0, 0.1], "
    "'values': [0, 1]}]" END,
};

/* What drape_sim_change changes: a value of the scene, or another one. */
static const char *const changes[][3] = {
    {"/gravity", "[0, -9.81, 0]", "[3, -4, 1]"},
    {"/cloth/0/material/young_modulus", "2e4", "9e4"},
    {"/cloth/0/terms/3", "{\"type\": \"damp.kelvin_voigt\", \"beta\": 0.002}", "\"drag.wind\""},
    {"/cloth/0/pins", "[{\"nodes\": [1]}]", "[{\"nodes\": [0, 2]}]"},
    {"/colliders", "[]",
     "[{\"name\": \"ball\", \"type\": \"sphere\", \"center\": [0.05, -0.2, 0.05], \"radius\": 0.05}]"},
    {"/self_contact", "{\"thickness\": 0.002}", "{\"thickness\": 0.005}"},
};

/* ---- The host ---- */

typedef struct checkpoint {
    fuzz_saved bytes; /* without data: there is none */
    uint64_t hash;
    int events; /* that the host had added */
    int changes;
} checkpoint;

typedef struct host {
    drape_context *ctx;
    drape_scene *scene;
    drape_model *model; /* of the sim, until the scene is changed */
    drape_sim *sim;
    drape_model *twin_model;
    drape_sim *twin; /* NULL: none */
    drape_sim_def def;
    checkpoint saved;
    int events, changes;
    bool windy, refused; /* refused: the scene is not that of the sim, as its last change was */
} host;

/* What a call is given, drawn once for both sims. */
typedef struct args {
    unsigned choice;
    int32_t node[COUNT], count, collider;
    double number[NUMBERS], seconds;
} args;

static drape_status make_scene(host *h, const char *apostrophes)
{
    char *text = strdup(apostrophes);
    FUZZ_REQUIRE(text, "no memory for %zu bytes", strlen(apostrophes));
    for (char *c = text; *c; c++)
        *c = *c == '\'' ? '"' : *c;
    drape_status status = drape_scene_parse(h->ctx, text, "host", &h->scene);
    free(text);
    if (!status)
        status = drape_scene_compile(h->scene, &h->model);
    fuzz_check(h->ctx, status, "the scene");
    FUZZ_REQUIRE(!status || status == DRAPE_E_MEMORY, "%s", drape_context_message(h->ctx));
    return status;
}

static void blow(void *user, double t, int32_t count, const double *x, double *wind, double *gradient)
{
    (void)user, (void)gradient;
    for (int32_t i = 0; i < 3 * count; i++)
        wind[i] = sin(20 * t + 10 * x[i]);
}

static drape_status lowest(void *user, double t, const double *positions, const double *velocities,
                           double *value)
{
    (void)user, (void)t, (void)velocities;
    *value = positions[1] + 0.01;
    return DRAPE_OK;
}

static drape_status add_event(host *h, drape_sim *sim, int number)
{
    static const char *const names[MAX_EVENTS] = {"one", "two", "three", "four"};
    drape_event_def def;
    drape_event_def_init(&def, sizeof def);
    def.name = names[number];
    def.action = number % 2 ? "stop" : "record";
    const drape_status status = drape_sim_add_event(sim, &def, lowest, NULL);
    fuzz_check(h->ctx, status, "drape_sim_add_event");
    return status;
}

static void drop_twin(host *h)
{
    drape_sim_destroy(&h->twin);
    drape_model_destroy(&h->twin_model);
}

/* ---- Calls that change the sim ---- */

typedef drape_status call_function(host *h, drape_sim *sim, const args *a);

static drape_status advance(host *h, drape_sim *sim, const args *a)
{
    (void)h;
    return drape_sim_advance(sim, drape_sim_time(sim) + a->seconds);
}

/* The budget never ends an iteration, so that the clock decides nothing. */
static drape_status advance_realtime(host *h, drape_sim *sim, const args *a)
{
    drape_realtime report;
    const drape_status status = drape_sim_advance_realtime(sim, a->seconds, 1e9, &report);
    FUZZ_REQUIRE(report.time == drape_sim_time(sim), "%s", drape_context_message(h->ctx));
    return status;
}

/* Free nodes are shaken. */
static drape_status set_state(host *h, drape_sim *sim, const args *a)
{
    const drape_model *m = drape_sim_model(sim);
    const size_t n = 3 * (size_t)drape_model_node_count(m);
    const double *x = drape_sim_positions(sim), *v = drape_sim_velocities(sim);
    double *copy = malloc(2 * n * sizeof *copy);
    FUZZ_REQUIRE(copy, "no memory for %zu numbers", 2 * n);
    for (size_t i = 0; i < n; i++) {
        const bool pinned = drape_model_pinned(m)[i / 3];
        copy[i] = x[i] + (pinned ? 0 : 0.02 * a->number[i % NUMBERS]);
        copy[n + i] = pinned ? v[i] : a->number[(i + 1) % NUMBERS] - v[i];
    }
    (void)h;
    const drape_status status =
        drape_sim_set_state(sim, a->choice % 4 ? drape_sim_time(sim) : 0, copy, copy + n);
    free(copy);
    return status;
}

static drape_status place(host *h, drape_sim *sim, const args *a)
{
    drape_place_def def;
    (void)h;
    drape_place_def_init(&def, sizeof def);
    memcpy(def.rotate, a->number, sizeof def.rotate);
    def.rotate[3] *= 500;
    memcpy(def.translate, a->number + 4, sizeof def.translate);
    memcpy(def.center, a->number + 6, sizeof def.center);
    const int32_t first = 0;
    if (a->choice & 1) {
        def.cloths = &first;
        def.cloth_count = a->choice & 8 ? 0 : 1;
    }
    if (a->choice & 2)
        def.collider_count = 0;
    def.stop = a->choice & 4;
    return drape_sim_place(sim, &def);
}

static drape_status untangle(host *h, drape_sim *sim, const args *a)
{
    drape_untangle_def def;
    drape_untangling report;
    (void)h;
    drape_untangle_def_init(&def, sizeof def);
    def.sweeps = 1 + (int)a->choice % 20;
    def.keep = a->choice & 1;
    return drape_sim_untangle(sim, &def, &report);
}

static drape_status pin(host *h, drape_sim *sim, const args *a)
{
    (void)h;
    return drape_sim_pin(sim, a->count, a->node);
}

static drape_status unpin(host *h, drape_sim *sim, const args *a)
{
    (void)h;
    return drape_sim_unpin(sim, a->count, a->node);
}

static drape_status set_masses(host *h, drape_sim *sim, const args *a)
{
    double mass[COUNT];
    (void)h;
    for (int i = 0; i < COUNT; i++)
        mass[i] = 2e-3 * fabs(a->number[i]);
    return drape_sim_set_masses(sim, a->count, a->node, mass);
}

static drape_status attach(host *h, drape_sim *sim, const args *a)
{
    (void)h;
    return drape_sim_attach(sim, a->collider, a->count, a->node, NULL);
}

/* The nodes of a call or, in place of each, the first one from there on that is pinned, or attached. */
static const int32_t *held(const drape_sim *sim, const args *a, bool attached, int32_t node[COUNT])
{
    const drape_model *m = drape_sim_model(sim);
    const int32_t count = drape_model_node_count(m);
    for (int i = 0; i < COUNT; i++) {
        int32_t j = a->node[i];
        while (j < count && !(attached ? drape_sim_attached(sim, j) >= 0 : drape_model_pinned(m)[j]))
            j++;
        node[i] = j < count ? j : a->node[i];
    }
    return node;
}

static drape_status detach(host *h, drape_sim *sim, const args *a)
{
    int32_t node[COUNT];
    (void)h;
    return drape_sim_detach(sim, a->count, held(sim, a, true, node));
}

static drape_status drag(host *h, drape_sim *sim, const args *a)
{
    double stiffness[COUNT];
    (void)h;
    for (int i = 0; i < COUNT; i++)
        stiffness[i] = 100 * fabs(a->number[i]);
    return a->choice % 4 ? drape_sim_set_drag_springs(sim, a->count, a->node, stiffness, a->number)
                         : drape_sim_set_drag_spring(sim, a->node[0], 0, a->number);
}

static drape_status move_pins(host *h, drape_sim *sim, const args *a)
{
    double at[3 * COUNT];
    int32_t node[COUNT];
    const int32_t count = drape_model_node_count(drape_sim_model(sim));
    (void)h;
    held(sim, a, false, node);
    for (int i = 0; i < 3 * COUNT; i++)
        at[i] = a->number[i] + (node[i / 3] < count ? drape_sim_positions(sim)[3 * node[i / 3] + i % 3] : 0);
    return drape_sim_move_pins(sim, a->count, node, a->seconds, at, a->choice & 1 ? a->number : NULL);
}

static drape_status move_collider(host *h, drape_sim *sim, const args *a)
{
    (void)h;
    return drape_sim_move_collider(sim, a->collider, a->seconds, a->number,
                                   a->choice & 1 ? a->number + 3 : NULL);
}

static drape_status move_collider_pose(host *h, drape_sim *sim, const args *a)
{
    double q[4] = {1, a->number[3], a->number[4], a->number[5]};
    const double length = sqrt(1 + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    (void)h;
    for (int k = 0; k < 4; k++)
        q[k] /= length;
    const bool arrives = a->choice & 1;
    return drape_sim_move_collider_pose(sim, a->collider, a->seconds, a->number, q,
                                        arrives ? a->number + 3 : NULL, arrives ? a->number + 6 : NULL);
}

/* Each point of a collider that deforms goes elsewhere by a part of the numbers. */
static drape_status deform_collider(host *h, drape_sim *sim, const args *a)
{
    const int32_t points = drape_model_collider_points(drape_sim_model(sim), a->collider);
    double *at = malloc((points > 0 ? (size_t)points : 1) * 3 * sizeof *at);
    FUZZ_REQUIRE(at, "no memory for %d points", points);
    if (points > 0)
        fuzz_check(h->ctx, drape_sim_collider_points(sim, a->collider, at, NULL),
                   "drape_sim_collider_points");
    for (int32_t i = 0; i < 3 * points; i++)
        at[i] += 0.1 * a->number[(i + i / 3) % NUMBERS];
    const drape_status status = drape_sim_deform_collider(sim, a->collider, a->seconds, points, at, NULL);
    free(at);
    return status;
}

static drape_status push(host *h, drape_sim *sim, const args *a)
{
    const size_t n = 3 * (size_t)drape_model_node_count(drape_sim_model(sim));
    double *force = malloc(n * sizeof *force);
    FUZZ_REQUIRE(force, "no memory for %zu numbers", n);
    for (size_t i = 0; i < n; i++)
        force[i] = 0.01 * a->number[i % NUMBERS];
    (void)h;
    const drape_status status = drape_sim_push(sim, a->choice % 3 ? force : NULL);
    free(force);
    return status;
}

static drape_status set_wind(host *h, drape_sim *sim, const args *a)
{
    const bool windy = a->choice % 3;
    const drape_status status = drape_sim_set_wind(sim, windy ? blow : NULL, NULL);
    if (!status)
        h->windy = windy;
    return status;
}

static drape_status cancel(host *h, drape_sim *sim, const args *a)
{
    (void)h, (void)a;
    drape_sim_cancel(sim);
    const drape_status status = drape_sim_advance(sim, drape_sim_time(sim) + 1);
    FUZZ_REQUIRE(status == DRAPE_E_STOPPED, "%s", drape_status_name(status));
    return DRAPE_OK;
}

static drape_status change(host *h, drape_sim *sim, const args *a)
{
    (void)a;
    return drape_sim_change(sim, h->scene);
}

/* `advances`: the state may have gone on when the status says that something was refused. */
static const struct {
    const char *name;
    call_function *make;
    bool advances;
} calls[] = {
    {"advance", advance, true},
    {"advance_realtime", advance_realtime, true},
    {"set_state", set_state, false},
    {"place", place, false},
    {"untangle", untangle, true},
    {"pin", pin, false},
    {"unpin", unpin, false},
    {"set_masses", set_masses, false},
    {"attach", attach, false},
    {"detach", detach, false},
    {"drag", drag, false},
    {"move_pins", move_pins, false},
    {"move_collider", move_collider, false},
    {"move_collider_pose", move_collider_pose, false},
    {"push", push, false},
    {"set_wind", set_wind, false},
    {"cancel", cancel, true},
    {"deform_collider", deform_collider, false},
    {"change", change, false},
};
#define CALLS (sizeof calls / sizeof *calls)

static drape_status do_once(host *h, drape_sim *sim, unsigned k, const args *a)
{
    const uint64_t before = drape_sim_hash(sim);
    const drape_status status = calls[k].make(h, sim, a);
    fuzz_check(h->ctx, status, calls[k].name);
    FUZZ_REQUIRE(!status || calls[k].advances || drape_sim_hash(sim) == before, "%s: %s", calls[k].name,
                 drape_context_message(h->ctx));
    fuzz_check_finite(sim, calls[k].name);
    return status;
}

static drape_status do_both(host *h, unsigned k, const args *a)
{
    const drape_status status = do_once(h, h->sim, k, a);
    if (!h->twin)
        return status;
    const drape_status again = do_once(h, h->twin, k, a);
    if (status == DRAPE_E_MEMORY || again == DRAPE_E_MEMORY) {
        drop_twin(h);
        return status;
    }
    FUZZ_REQUIRE(again == status, "%s: %s and %s: %s", calls[k].name, drape_status_name(status),
                 drape_status_name(again), drape_context_message(h->ctx));
    FUZZ_REQUIRE(drape_sim_hash(h->twin) == drape_sim_hash(h->sim),
                 "%s: the restored sim differs at t = %.17g and %.17g", calls[k].name, drape_sim_time(h->sim),
                 drape_sim_time(h->twin));
    return status;
}

static void change_scene(host *h, const args *a)
{
    const unsigned which = a->choice % (2 * sizeof changes / sizeof *changes), k = which / 2;
    const char *pointer = changes[k][0];
    fuzz_check(h->ctx, drape_scene_set(h->scene, pointer, changes[k][1 + which % 2]), "drape_scene_set");
    h->refused = do_both(h, CALLS - 1, a) != DRAPE_OK;
    if (!h->refused) {
        h->changes++;
        drape_model_destroy(&h->model); /* it may be freed */
    }
}

/* ---- Checkpoints ---- */

/* Another sim of the same scene, which does from now on what the sim does. */
static void make_twin(host *h)
{
    drop_twin(h);
    drape_status status = drape_scene_compile(h->scene, &h->twin_model);
    if (!status)
        status = drape_sim_create(h->ctx, h->twin_model, &h->def, &h->twin);
    for (int i = 0; i < h->events && !status; i++)
        status = add_event(h, h->twin, i);
    if (h->windy && !status && drape_sim_set_wind(h->twin, blow, NULL)) { /* nothing feels it now */
        drop_twin(h);
        return;
    }
    if (!status)
        status = drape_sim_restore_from(h->twin, h->saved.bytes.data, h->saved.bytes.size);
    fuzz_check(h->ctx, status, "drape_sim_restore_from");
    FUZZ_REQUIRE(!status || status == DRAPE_E_MEMORY, "%s", drape_context_message(h->ctx));
    if (status)
        drop_twin(h);
    else
        FUZZ_REQUIRE(drape_sim_hash(h->twin) == h->saved.hash, "t = %g", drape_sim_time(h->twin));
}

static void save(host *h, bool with_twin)
{
    h->saved.bytes.size = 0;
    h->saved.hash = drape_sim_hash(h->sim);
    h->saved.events = h->events;
    h->saved.changes = h->changes;
    const drape_status status = drape_sim_save_to(h->sim, fuzz_keep, &h->saved.bytes);
    FUZZ_REQUIRE(status == DRAPE_OK, "%s", drape_context_message(h->ctx));
    FUZZ_REQUIRE(drape_sim_hash(h->sim) == h->saved.hash, "saving changed the sim");
    if (with_twin && !h->refused)
        make_twin(h);
}

static void restore(host *h)
{
    if (!h->saved.bytes.data)
        return;
    const uint64_t before = drape_sim_hash(h->sim);
    const drape_status status = drape_sim_restore_from(h->sim, h->saved.bytes.data, h->saved.bytes.size);
    fuzz_check(h->ctx, status, "drape_sim_restore_from");
    const bool same = h->saved.changes == h->changes && h->saved.events == h->events;
    FUZZ_REQUIRE(!status || !same || status == DRAPE_E_MEMORY, "%s", drape_context_message(h->ctx));
    FUZZ_REQUIRE(drape_sim_hash(h->sim) == (status ? before : h->saved.hash), "%s",
                 drape_status_name(status));
    if (h->twin && same && !status && !h->refused)
        make_twin(h);
    else
        drop_twin(h);
}

/* ---- What can be read ---- */

static void read_forces(drape_sim *sim, double *array, size_t n, const args *a)
{
    double three[3];
    drape_contact_point contacts[COUNT];
    int32_t count;
    if (drape_sim_reactions(sim, array) == DRAPE_OK)
        FUZZ_REQUIRE(drape_all_finite(array, n), "reactions");
    if (drape_sim_contact_forces(sim, array) == DRAPE_OK)
        FUZZ_REQUIRE(drape_all_finite(array, n), "contact forces");
    if (drape_sim_collider_force(sim, a->collider, three) == DRAPE_OK)
        FUZZ_REQUIRE(drape_all_finite(three, 3), "force on %d", a->collider);
    if (drape_sim_collider_torque(sim, a->collider, a->choice & 1 ? a->number : NULL, three) == DRAPE_OK)
        FUZZ_REQUIRE(drape_all_finite(three, 3), "torque on %d", a->collider);
    if (drape_sim_contacts(sim, a->count, contacts, &count) == DRAPE_OK)
        for (int32_t i = 0; i < count && i < a->count; i++)
            FUZZ_REQUIRE(drape_all_finite(contacts[i].force, 3), "contact %d", i);
    drape_sim_drag_spring_force(sim, three);
    FUZZ_REQUIRE(drape_all_finite(three, 3), "drag spring");
}

static drape_energy query(host *h, drape_sim *sim, const args *a)
{
    drape_hit hits[COUNT];
    drape_warning warning;
    double deepest;
    const size_t n = 3 * (size_t)drape_model_node_count(drape_sim_model(sim));
    const uint64_t before = drape_sim_hash(sim);
    double *array = malloc(n * sizeof *array);
    FUZZ_REQUIRE(array, "no memory for %zu numbers", n);
    read_forces(sim, array, n, a);
    drape_sim_normals(sim, array);
    drape_sim_energy_density(sim, array);
    FUZZ_REQUIRE(drape_all_finite(array, n / 3), "energy density");
    const drape_energy energy = drape_sim_energy(sim);
    FUZZ_REQUIRE(drape_all_finite((const double *)&energy, sizeof energy / sizeof(double)), "energies");
    drape_status status = drape_sim_closest(sim, 1 + (int)a->choice % 3, a->count, a->number, FAR, hits);
    fuzz_check(h->ctx, status, "drape_sim_closest");
    status = drape_sim_cast(sim, 1 + (int)a->choice % 3, 1, a->number, a->number + 3, FAR, hits);
    fuzz_check(h->ctx, status, "drape_sim_cast");
    drape_sim_inside(sim, a->collider, &deepest);
    drape_sim_intersections(sim, a->collider - 1);
    drape_sim_seam(sim, 0, &(drape_seam_report){0});
    drape_sim_collider_rotation(sim, a->collider, array, NULL, NULL);
    drape_sim_relaxed(sim, 0, &(drape_relaxed){0});
    for (int i = 0; drape_sim_warning(sim, i, &warning); i++)
        FUZZ_REQUIRE(*warning.text && !strchr(warning.text, '\n'), "%s", warning.name);
    for (int32_t i = 0; i < drape_sim_event(sim, i, &(drape_event_record){0}); i++)
        ;
    free(array);
    FUZZ_REQUIRE(drape_sim_hash(sim) == before, "a query changed the sim");
    return energy;
}

static void query_both(host *h, const args *a)
{
    const drape_energy energy = query(h, h->sim, a);
    if (!h->twin)
        return;
    const drape_energy other = query(h, h->twin, a);
    FUZZ_REQUIRE(memcmp(&energy, &other, sizeof energy) == 0,
                 "contact %.17g and %.17g, numerical %.17g and %.17g J", energy.contact, other.contact,
                 energy.numerical, other.numerical);
}

/* ---- The run ---- */

/* Numbers of nodes and colliders may be one too large. */
static args draw(const host *h, fuzz_bytes *in)
{
    const drape_model *m = drape_sim_model(h->sim);
    const int32_t nodes = drape_model_node_count(m), colliders = drape_model_collider_count(m);
    args a = {.choice = fuzz_byte(in), .count = 1 + (int32_t)fuzz_below(in, COUNT)};
    for (int i = 0; i < COUNT; i++)
        a.node[i] = (int32_t)fuzz_below(in, (unsigned)nodes + 1);
    a.collider = (int32_t)fuzz_below(in, (unsigned)colliders + 1);
    a.seconds = fuzz_magnitude(in, 1e-3, 0.06);
    const unsigned seed = fuzz_byte(in);
    const double size = fuzz_magnitude(in, 1e-3, FAR);
    for (unsigned i = 0; i < NUMBERS; i++) /* a few bytes a call, not twenty */
        a.number[i] = size * sin(1.7 * (seed + 1) * (i + 1));
    return a;
}

static void run(host *h, fuzz_bytes *in)
{
    for (int i = 0; i < MAX_CALLS && in->at < in->end; i++) {
        const unsigned what = fuzz_below(in, CALLS + 8);
        const args a = draw(h, in);
        if (what < CALLS - 1)
            do_both(h, what, &a);
        else if (what == CALLS - 1)
            change_scene(h, &a);
        else if (what == CALLS)
            save(h, true);
        else if (what == CALLS + 1)
            save(h, false);
        else if (what == CALLS + 2)
            restore(h);
        else if (what == CALLS + 3 && h->events < MAX_EVENTS && add_event(h, h->sim, h->events) == DRAPE_OK) {
            drop_twin(h);
            h->events++;
        } else if (what == CALLS + 4) { /* starved: the clock decides what is done */
            drop_twin(h);
            fuzz_check(h->ctx, drape_sim_advance_realtime(h->sim, a.seconds, 1e-4 * (a.choice % 2), NULL),
                       "drape_sim_advance_realtime");
            fuzz_check_finite(h->sim, "a starved frame");
        } else if (what == CALLS + 5)
            query_both(h, &a);
        else
            do_both(h, 0, &a);
    }
}

static void write_body(void)
{
    FILE *file = fopen(BODY, "w");
    FUZZ_REQUIRE(file && fputs(body, file) >= 0 && fclose(file) == 0, BODY);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_bytes in = {.at = data, .end = data + size};
    host h = {.ctx = fuzz_open(MAX_MEMORY)};
    unsigned integrators = 0;
    while (drape_integrators[integrators])
        integrators++;
    const char *scene = scenes[fuzz_below(&in, sizeof scenes / sizeof *scenes)];
    drape_sim_def_init(&h.def, sizeof h.def);
    h.def.integrator = drape_integrators[fuzz_below(&in, integrators)]->entry.name;
    h.def.teleport_speed = fuzz_below(&in, 4) ? 0 : 3;
    write_body();
    if (make_scene(&h, scene) == DRAPE_OK) {
        const drape_status status = drape_sim_create(h.ctx, h.model, &h.def, &h.sim);
        fuzz_check(h.ctx, status, "drape_sim_create");
        if (!status)
            run(&h, &in);
    }
    drop_twin(&h);
    drape_sim_destroy(&h.sim);
    drape_model_destroy(&h.model);
    drape_scene_destroy(&h.scene);
    free(h.saved.bytes.data);
    fuzz_close(&h.ctx);
    remove(BODY);
    return 0;
}
