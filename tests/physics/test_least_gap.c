/*
 * test_least_gap.c: how contact keeps its least gap: it becomes stiffer where gaps cannot shrink, pushes out
 * what begins inside, and rounding does not add up. That nothing passes through anything, whatever presses,
 * is tested by physics/press.
 */
#include "colliders/colliders.h"
#include "contact/barrier.h"
#include "contact/contact_parts.h"
#include "support/bytes.h"
#include "support/folder.h"
#include "support/scene.h"

#include <stdlib.h>

static const char tetrahedron[] = "v 0.3 -0.5 0\nv -0.15 -0.5 0.26\nv -0.15 -0.5 -0.26\nv 0.013 0 0.017\n"
                                  "f 1 2 3\nf 1 4 2\nf 2 4 3\nf 3 4 1\n";

#define MATERIAL "'material': {'young_modulus': %g, 'thickness': 1e-3, 'areal_density': 0.1}"
#define TERMS    "'terms': ['stretch.edge', 'bend.hinge', {'type': 'damp.kelvin_voigt', 'beta': 1e-3}"

/* The scene's integrator, with a step of dt unless it chooses its own. */
static const char *method_of(const char *name, double dt)
{
    static char text[100];
    snprintf(text, sizeof text, "'integrator': {'method': '%s', 'dt': %g}", name, dt);
    return text;
}

/* Contact becomes stiffer while the sheet is pulled over the tip. The energy which that adds to present
 * contacts is counted as work: the numerical dissipation of backward Euler never falls by more than a
 * thousandth of it. */
TEST(stiffening_is_work)
{
    folder_enter();
    folder_write("tip.obj", tetrahedron);
    scene s = scene_open("{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, "
                         "'width': 0.4, 'height': 0.4,"
                         " 'transform': {'translate': [-0.2, 0.01, 0.2]}}, 'pins': [{'nodes': [0, 1, 2, 3, "
                         "4, 20, 21, 22, 23, 24],"
                         " 'track': [[0, [0,0,0]], [1, [0,-0.1,0]]]}], " MATERIAL ", " TERMS
                         "]}], 'colliders': [{'type': 'mesh', 'file': 'tip.obj'}], 'contact': {'distance': "
                         "4e-3}, %s, 'duration': 1}",
                         2e8, method_of("be", 0.01));
    const struct drape_contact *contact = drape_system_contact(s.sim->system);
    double fall = 0, added = 0, factor = 1;
    int raised = 0;
    for (int k = 1; k <= 100; k++) {
        const drape_energy before = drape_sim_energy(s.sim);
        scene_advance(&s, 0.01 * k);
        const double now = contact->stiffening.factor;
        raised += now > factor;
        added = fmax(added, now > factor ? (now / factor - 1) * before.contact : 0);
        factor = now;
        fall = fmax(fall, before.numerical - drape_sim_energy(s.sim).numerical);
    }
    printf("# raised %d times, by up to %.3g J\n", raised, added);
    ck_assert_int_ge(raised, 2);
    assert_below(fall, 1e-3 * added);
    scene_close(&s);
    folder_leave();
}

/* A sheet that begins one activation distance deep in the ground is inside: the parabola pushes it out, and
 * it leaves with the energy b(-1) of that. Without gravity, and with restitution 1, midpoint conserves it up
 * to the change of b over a step, here less than a twentieth. Then no pair is inside any more. */
TEST(what_begins_inside_is_pushed_out_gently)
{
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 4, 'rows': 4, "
        "'width': 0.2, 'height': 0.2,"
        " 'transform': {'translate': [-0.1, -4e-3, 0.1]}}, " MATERIAL
        ", 'terms': ['stretch.edge']}], 'colliders': ["
        " {'type': 'plane', 'point': [0, 0, 0], 'normal': [0, 1, 0], 'restitution': 1}], 'contact': "
        "{'distance': 4e-3, 'stiffness': 10},"
        " 'gravity': [0, 0, 0], %s, 'duration': 1}",
        1e6, method_of("midpoint", 2e-4));
    const struct drape_contact *contact = drape_system_contact(s.sim->system);
    const double stored = 10 * 0.04 * 4e-3 * drape_barrier_at(-1, DRAPE_BARRIER_PARABOLA).b;
    double height = -4e-3;
    ck_assert_double_eq_tol(drape_sim_energy(s.sim).contact, stored, 1e-9 * stored);
    for (int k = 1; k <= 100; k++) {
        scene_advance(&s, 2e-4 * k);
        double lowest = INFINITY;
        for (int32_t i = 0; i < s.model->node_count; i++)
            lowest = fmin(lowest, drape_sim_state(s.sim)->x[3 * (size_t)i + 1]);
        ck_assert_double_ge(lowest, fmin(height, 4e-6));
        height = lowest;
        ck_assert(contact->inside.count == 16 || height > 0);
    }
    ck_assert_double_gt(height, 4e-3);
    ck_assert_int_eq(contact->inside.count, 0);
    ck_assert_double_eq_tol(drape_sim_energy(s.sim).kinetic, stored, 0.05 * stored);
}

#define ABOVE_A_BOX                                                                                          \
    "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 3, 'rows': 3, 'width': 0.1, 'height': "   \
    "0.1, 'transform': {'translate': [-0.05, 0.01, 0.05]}}, " MATERIAL ", 'terms': ['stretch.edge']}], "     \
    "'colliders': [{'type': 'box', 'center': [0, -0.1, 0], 'size': 0.2}], 'contact': {'distance': 4e-3}, "   \
    "'duration': 1}"

/* A sheet at 1.5 least gaps above a box: gaps cannot halve any more, and a step from there may be rejected
 * again and again, so contact becomes twice as stiff with every attempt. */
TEST(stiffness_rises_where_gaps_cannot_shrink)
{
    scoped_scene s = scene_open(ABOVE_A_BOX, 1e6);
    drape_state *at = scene_state(&s);
    const struct drape_contact *contact = drape_system_contact(s.sim->system);
    for (size_t i = 1; i < 3 * (size_t)s.model->node_count; i += 3)
        at->x[i] = 1.5 * drape_contact_least_gap(contact);
    for (int k = 1; k <= 5; k++) {
        ck_assert_int_eq(drape_system_begin(s.sim->system, at), DRAPE_OK);
        ck_assert_double_eq(contact->stiffening.factor, 1 << k);
        drape_system_end_step(s.sim->system);
    }
}

/* A sheet that begins a few units of rounding above a box, below the least gap, may get nearer in each step
 * by rounding: not through the surface of the box, however many steps there are. */
TEST(rounding_does_not_add_up)
{
    scoped_scene s = scene_open(ABOVE_A_BOX, 1e6);
    drape_state *at = scene_state(&s);
    const double rounding = drape_system_contact(s.sim->system)->broad.rounding;
    const size_t n = 3 * (size_t)s.model->node_count;
    double next[27], lowest = INFINITY;
    int accepted = 0;
    ck_assert_uint_eq(n, 27);
    for (size_t i = 1; i < n; i += 3)
        at->x[i] = 5 * rounding;
    for (int k = 0; k < 200; k++) {
        drape_reason reason;
        drape_diagnostic diagnostic;
        ck_assert_int_eq(drape_system_begin(s.sim->system, at), DRAPE_OK);
        memcpy(next, at->x, sizeof next);
        for (size_t i = 1; i < n; i += 3)
            next[i] -= 0.09 * rounding;
        if (drape_system_check_contact(s.sim->system, next, at->t, &reason, &diagnostic) == DRAPE_OK) {
            memcpy(at->x, next, sizeof next);
            accepted++;
        }
        drape_system_end_step(s.sim->system);
    }
    for (size_t i = 1; i < n; i += 3)
        lowest = fmin(lowest, at->x[i]);
    printf("# %d of 200 steps accepted, the lowest node is at %.3g m\n", accepted, lowest);
    ck_assert_int_ge(accepted, 10);
    ck_assert_double_gt(lowest, 0);
}

/* A run that continues from a checkpoint has the bits of one that did not stop, while contact is stiffer
 * than the scene says, and while cloth is inside. */
TEST(a_checkpoint_keeps_it)
{
    folder_enter();
    folder_write("tip.obj", tetrahedron);
    for (int inside = 0; inside < 2; inside++) {
        uint64_t hash[2];
        scene s[2];
        for (int k = 0; k < 2; k++)
            s[k] = scene_open(
                "{'drape': 1, 'cloth': [{'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'width': 0.4, "
                "'height': 0.4,"
                " 'transform': {'translate': [-0.2, %g, 0.2]}}, 'pins': [{'nodes': [0, 1, 2, 3, 4, 20, 21, "
                "22, 23, 24],"
                " 'track': [[0, [0,0,0]], [1, [0,-0.1,0]]]}], " MATERIAL ", " TERMS "]}], 'colliders': ["
                " {'type': 'mesh', 'file': 'tip.obj'}], 'contact': {'distance': 4e-3}, %s, 'duration': 1}",
                inside ? 2e-6 : 0.01, 2e8, method_of("be", 0.01));
        const double half = inside ? 0.01 : 0.5, end = inside ? 0.1 : 0.7;
        scene_advance(&s[0], half);
        const struct drape_contact *contact = drape_system_contact(s[0].sim->system);
        ck_assert(inside ? contact->inside.count > 0 : contact->stiffening.factor > 1);
        bytes saved = bytes_save(s[0].sim);
        ck_assert_int_eq(drape_sim_restore_from(s[1].sim, saved.data, saved.size), DRAPE_OK);
        free(saved.data);
        for (int k = 0; k < 2; k++) {
            scene_advance(&s[k], end);
            hash[k] = drape_sim_hash(s[k].sim);
            scene_close(&s[k]);
        }
        ck_assert_uint_eq(hash[0], hash[1]);
    }
    folder_leave();
}
