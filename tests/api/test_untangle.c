/* test_untangle.c: untangling as a host and a scene ask for it: what it reports, refuses and leaves alone. */
#include "support/bytes.h"
#include "support/host.h"
#include "support/suite.h"

#define CLOTH(name, turn, shift)                                                                             \
    "{'name': '" name "', 'mesh': {'grid': 'square', 'columns': 7, 'rows': 7, 'width': 0.6, 'height': 0.6, " \
    "'transform': {'rotate': [" turn "], 'translate': [" shift "]}}, 'velocity': [0, 0, 0.1], 'material': "  \
    "{'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200}, 'terms': ['stretch.edge', 'bend.hinge']%s}"
/* Two sheets through each other at 30 degrees: more members of each, and of the scene. */
static const char tangled[] = "{'drape': 1, 'cloth': [" CLOTH("a", "0, 1, 0, 0", "-0.3, 0, 0.3") ", " //
    CLOTH("b", "0, 0, 1, 30", "-0.24, -0.14, 0.31") "], 'self_contact': {'thickness': 0.003}, %s "
                                                    "'integrator': {'method': 'be', 'dt': 0.0078125}, "
                                                    "'frame_rate': 64, 'duration': 1}";
/* All nodes: what they pass through they go on to pass through. */
#define PINNED ", 'pins': [{'box': [[-1, -1, -1], [1, 1, 1]]}]"

/* A scene that does not ask for it stays as it is until the host does, who learns what was done. */
TEST(a_host_untangles)
{
    scoped_host h = open_scene(tangled, "", "", "");
    drape_untangling u = {.sweeps = -1}, last;
    double moved[2], before[98 * 3];
    good(&h, drape_sim_advance(h.sim, 1.0 / 64));
    const int64_t pairs = drape_sim_intersections(h.sim, -1);
    ck_assert_int_gt(pairs, 10);
    ck_assert(!drape_sim_untangling(h.sim, &u, moved) && u.sweeps == -1);
    memcpy(before, drape_sim_positions(h.sim), sizeof before);
    double velocities[98 * 3];
    memcpy(velocities, drape_sim_velocities(h.sim), sizeof velocities);
    good(&h, drape_sim_untangle(h.sim, NULL, &u));
    ck_assert_int_eq(drape_sim_intersections(h.sim, -1), 0);
    ck_assert(u.clear && u.pairs_before == pairs && u.pairs == 0 && u.sweeps > 0 && u.cloths == 2);
    ck_assert(u.least_gap >= 1 && u.strain > 0 && u.seconds >= 0 && u.time == 1.0 / 64);
    ck_assert_mem_eq(drape_sim_velocities(h.sim), velocities, sizeof velocities);
    double longest = 0;
    for (int i = 0; i < 98; i++)
        longest = fmax(longest, distance(before + 3 * i, drape_sim_positions(h.sim) + 3 * i));
    /* hypot and the square root of a sum of squares differ by rounding */
    ck_assert_double_eq_tol(longest, u.displacement, 1e-15);
    ck_assert_double_eq_tol(distance(before + 3 * u.node, drape_sim_positions(h.sim) + 3 * u.node), longest,
                            1e-15);
    ck_assert(drape_sim_untangling(h.sim, &last, moved));
    ck_assert_mem_eq(&last, &u, sizeof u);
    ck_assert_double_eq(fmax(moved[0], moved[1]), u.displacement);
    good(&h, drape_sim_advance(h.sim, 0.25));
    ck_assert_int_eq(drape_sim_intersections(h.sim, -1), 0);
    /* what is clear already is left as it is, to the bit */
    const uint64_t hash = drape_sim_hash(h.sim);
    good(&h, drape_sim_untangle(h.sim, NULL, &u));
    ck_assert(u.clear && u.node == -1 && u.cloths == 0 && u.sweeps == 0 && drape_sim_hash(h.sim) == hash);
}

/* A scene is untangled before its first step and its first frame; by a budget as well. */
TEST(a_scene_untangles_before_its_first_step)
{
    for (int k = 0; k < 2; k++) {
        scoped_host h = open_scene(tangled, "", "", "'untangle': {},");
        drape_untangling u;
        ck_assert(!drape_sim_untangling(h.sim, &u, NULL));
        good(&h,
             k ? drape_sim_advance_realtime(h.sim, 1.0 / 64, 1e3, NULL) : drape_sim_advance(h.sim, 1.0 / 64));
        ck_assert(drape_sim_untangling(h.sim, &u, NULL) && u.clear && u.pairs_before > 10 && u.time == 0);
        good(&h, drape_sim_advance(h.sim, 0.125));
        ck_assert_int_eq(drape_sim_intersections(h.sim, -1), 0);
        ck_assert(drape_sim_untangling(h.sim, &u, NULL) && u.time == 0); /* once */
    }
}

/* Sheets that cannot move stay entangled, and that is no success. */
TEST(what_stays_entangled_is_reported)
{
    scoped_host h = open_scene(tangled, PINNED, PINNED, "");
    const uint64_t hash = drape_sim_hash(h.sim);
    drape_untangle_def def;
    drape_untangling u;
    drape_warning w;
    bool warned = false;
    drape_untangle_def_init(&def, sizeof def);
    def.sweeps = 3;
    says(&h, drape_sim_untangle(h.sim, &def, &u), DRAPE_E_SOLVER, "did not come apart");
    says(&h, DRAPE_E_SOLVER, DRAPE_E_SOLVER, "first, edge ");
    ck_assert(!u.clear && u.pairs == u.pairs_before && u.pairs > 10);
    ck_assert_int_eq(u.pairs, drape_sim_intersections(h.sim, -1));
    ck_assert_uint_eq(drape_sim_hash(h.sim), hash);
    for (int i = 0; drape_sim_warning(h.sim, i, &w); i++)
        warned = warned || strcmp(w.name, "tangled") == 0;
    ck_assert(warned);
}

/* Where the sweeps are too few, the sim has what they reached with `keep`, else it is as before. */
TEST(what_was_reached_is_kept_if_wanted)
{
    int64_t least = INT64_MAX, most = 0; /* of the pairs that remained when it did not come apart */
    drape_status status = DRAPE_E_SOLVER;
    for (int sweeps = 1; status; sweeps++) {
        scoped_host h = open_scene(tangled, "", "", "");
        const uint64_t hash = drape_sim_hash(h.sim);
        drape_untangle_def def;
        drape_untangling u;
        drape_untangle_def_init(&def, sizeof def);
        def.sweeps = sweeps;
        status = drape_sim_untangle(h.sim, &def, &u);
        ck_assert(u.clear == (status == DRAPE_OK));
        if (status) {
            says(&h, status, DRAPE_E_SOLVER, "did not come apart");
            ck_assert_uint_eq(drape_sim_hash(h.sim), hash);
            def.keep = true;
            ck_assert_int_eq(drape_sim_untangle(h.sim, &def, &u), DRAPE_E_SOLVER);
            ck_assert(!u.clear && u.sweeps == sweeps && u.pairs == drape_sim_intersections(h.sim, -1));
            least = u.pairs < least ? u.pairs : least;
            most = u.pairs > most ? u.pairs : most;
        }
    }
    ck_assert(least < most); /* some reached a part */
}

/* A sheet in a body that pins in its middle, or at each corner, hold there: what is kept is in no count worse
 * than the start, and still cloth. */
TEST(what_is_kept_is_never_worse)
{
    for (int shape = 0; shape < 2; shape++)
        for (size_t k = 0; k < 2; k++) {
            scoped_host h = open_scene(
                "{'drape': 1, 'cloth': [" CLOTH(
                    "a", "0, 1, 0, 0", "-0.3, 0, 0.3") "], 'self_contact': {'thickness': 0.003}, "
                                                       "'colliders': [%s], 'integrator': "
                                                       "{'method': 'be', 'dt': 0.01}, 'duration': 1}",
                k ? ", 'pins': [{'corner': 'top-left'}, {'corner': 'bottom-right'}, {'corner': 'top-right'}, "
                    "{'corner': 'bottom-left'}]"
                  : ", 'pins': [{'box': [[-0.05, -1, -0.05], [0.05, 1, 0.05]]}]",
                shape ? "{'type': 'sphere', 'center': [0, 0, 0], 'radius': 0.6}"
                      : "{'type': 'box', 'center': [0, 0, 0], 'size': 1.2}");
            drape_untangle_def def;
            drape_untangling u;
            drape_untangle_def_init(&def, sizeof def);
            def.keep = true;
            def.sweeps = 60;
            says(&h, drape_sim_untangle(h.sim, &def, &u), DRAPE_E_SOLVER, "did not come apart");
            ck_assert(!u.clear && u.inside > 0 && u.inside <= u.inside_before && u.pairs <= u.pairs_before);
            ck_assert_int_eq(u.pairs, 0);
            ck_assert_double_le(u.strain, 0.25); /* SHARE of the bounds in untangle/untangler.c */
            const drape_energy e = drape_sim_energy(h.sim);
            ck_assert(isfinite(e.elastic) && isfinite(e.contact));
            good(&h, drape_sim_advance(h.sim, 0.01));
        }
}

/* on_failure of a scene: its run ends before the first step, again and again, or goes on with a warning. */
TEST(a_scene_says_what_happens_on_failure)
{
    scoped_host h = open_scene(tangled, PINNED, PINNED, "'untangle': {},");
    for (int k = 0; k < 2; k++) {
        says(&h, drape_sim_advance(h.sim, 0.125), DRAPE_E_SOLVER, "did not come apart");
        ck_assert_double_eq(drape_sim_time(h.sim), 0);
    }
    close_scene(&h);
    h = open_scene(tangled, PINNED, PINNED, "'untangle': {'on_failure': 'continue'},");
    drape_warning w;
    bool warned = false;
    good(&h, drape_sim_advance(h.sim, 0.125));
    for (int i = 0; drape_sim_warning(h.sim, i, &w); i++)
        warned = warned || strcmp(w.name, "tangled") == 0;
    ck_assert(warned);
}

/* What the scene lets pass is not taken apart. */
TEST(what_is_ignored_stays)
{
    scoped_host h = open_scene(tangled, ", 'ignore': ['b']", "", "");
    const uint64_t hash = drape_sim_hash(h.sim);
    drape_untangling u;
    good(&h, drape_sim_untangle(h.sim, NULL, &u));
    ck_assert(u.clear && u.pairs_before == 0 && u.node == -1 && drape_sim_hash(h.sim) == hash);
}

static drape_status untangle_within(void *user, const drape_event *event)
{
    *(drape_status *)user = drape_sim_untangle(event->sim, NULL, NULL);
    return DRAPE_OK;
}

TEST(wrong_calls_are_refused)
{
    scoped_host h = open_scene(tangled, "", "", "");
    const uint64_t hash = drape_sim_hash(h.sim);
    drape_untangle_def def = {.struct_size = 3};
    drape_status within = DRAPE_OK;
    ck_assert_int_eq(drape_sim_untangle(NULL, NULL, NULL), DRAPE_E_ARGUMENT);
    ck_assert(!drape_sim_untangling(NULL, NULL, NULL));
    drape_untangle_def_init(NULL, sizeof def);
    says(&h, drape_sim_untangle(h.sim, &def, NULL), DRAPE_E_VERSION, "drape_untangle_def_init");
    drape_untangle_def_init(&def, sizeof def);
    def.sweeps = 0;
    says(&h, drape_sim_untangle(h.sim, &def, NULL), DRAPE_E_ARGUMENT, "sweeps = 0; it is 1 to ");
    def.sweeps = 5;
    def.gap = NAN;
    says(&h, drape_sim_untangle(h.sim, &def, NULL), DRAPE_E_ARGUMENT, "gap = nan; it is in [0.01, 1]");
    drape_sim_cancel(h.sim);
    says(&h, drape_sim_untangle(h.sim, NULL, NULL), DRAPE_E_STOPPED, "cancelled");
    ck_assert_uint_eq(drape_sim_hash(h.sim), hash);
    good(&h, drape_sim_observe(h.sim, untangle_within, &within));
    good(&h, drape_sim_advance(h.sim, 1.0 / 64));
    ck_assert_int_eq(within, DRAPE_E_ARGUMENT);
}

/* A run that is saved before and after its start was untangled goes on with the same bits. */
TEST(checkpoints_know_it)
{
    scoped_host h = open_scene(tangled, "", "", "'untangle': {},");
    scoped_bytes before = bytes_save(h.sim);
    good(&h, drape_sim_advance(h.sim, 0.0625));
    scoped_bytes after = bytes_save(h.sim);
    drape_untangling u, saved;
    ck_assert(drape_sim_untangling(h.sim, &saved, NULL));
    good(&h, drape_sim_advance(h.sim, 0.125));
    const bytes *const from[] = {&before, &after};
    for (int k = 0; k < 2; k++) {
        scoped_host r = open_scene(tangled, "", "", "'untangle': {},");
        good(&r, drape_sim_restore_from(r.sim, from[k]->data, from[k]->size));
        ck_assert(drape_sim_untangling(r.sim, &u, NULL) == (k == 1));
        good(&r, drape_sim_advance(r.sim, 0.0625));
        good(&r, drape_sim_advance(r.sim, 0.125));
        ck_assert(drape_sim_untangling(r.sim, &u, NULL) && u.pairs_before == saved.pairs_before);
        ck_assert_double_eq(u.displacement, saved.displacement);
        ck_assert_uint_eq(drape_sim_hash(r.sim), drape_sim_hash(h.sim));
    }
}
