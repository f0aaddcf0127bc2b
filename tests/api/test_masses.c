/* test_masses.c: nodes with masses of their own, from a scene or given to a running sim. */
#include <float.h>

#include "support/bytes.h"
#include "support/host.h"
#include "support/suite.h"

#define FRAME (1.0 / 64) /* [s], exact in binary */

#define TO_GROUND                                                                                            \
    "'integrator': {'dt': 0.0078125, 'tolerance': 1e-9, 'rtol': 1e-7}, 'frame_rate': 64, 'duration': 1}"
#define MATERIAL "'material': {'young_modulus': 1e4, 'thickness': 1e-3, 'density': 200}"
#define CLOTH                                                                                                \
    "'mesh': {'grid': 'square', 'columns': 5, 'rows': 4, 'width': 0.5, 'height': 0.375}, " MATERIAL          \
    ", 'terms': ['stretch.edge', 'bend.hinge']"

/* With contact, whose stiffness follows from masses. %s: more members of the cloth. */
#define ON_BALL                                                                                              \
    "{'drape': 1, 'cloth': [{" CLOTH ", 'pins': [{'corner': 'top-left'}]%s}], 'colliders': [{'type': "       \
    "'sphere', 'center': [0.25, -0.11, 0.15], 'radius': 0.1}], 'self_contact': {'thickness': "               \
    "0.004}, " TO_GROUND

static const double *masses_of(const host *h)
{
    return drape_model_masses(drape_sim_model(h->sim));
}

static void advance(const host *h, double seconds)
{
    good(h, drape_sim_advance(h->sim, drape_sim_time(h->sim) + seconds));
}

/* ---- Of a scene ---- */

/* Items apply in their order, to each selected node once; everything else has the mass of the material. */
TEST(masses_are_added_and_replaced)
{
    host plain = open_scene(ON_BALL, "");
    double of_material[20];
    memcpy(of_material, masses_of(&plain), sizeof of_material);
    close_scene(&plain);
    scoped_host h = open_scene(
        ON_BALL, ", 'masses': [{'edge': 'bottom', 'add': 0.002}, {'nodes': [15, 3, 3], 'add': 0.5}, "
                 "{'corner': 'bottom-right', 'mass': 0.125}, {'box': [[-1, -1, -0.01], [0.01, 1, 1]], "
                 "'add': 0.25}, {'row': 1, 'mass': 0.0625}]");
    const double *mass = masses_of(&h);
    for (int i = 0; i < 20; i++) {
        double expected = of_material[i];
        expected += i >= 15 ? 0.002 : 0;
        expected += i == 15 || i == 3 ? 0.5 : 0;
        expected = i == 19 ? 0.125 : expected;
        expected += i == 0 ? 0.25 : 0; /* the box holds one corner */
        expected = i >= 5 && i < 10 ? 0.0625 : expected;
        ck_assert_msg(mass[i] == expected, "node %d: %.17g for %.17g", i, mass[i], expected);
    }
}

/* The same from structs, and what these refuse. */
TEST(masses_from_structs)
{
    const double x[] = {0, 0, 0, 1, 0, 0, 0, 0, 1};
    const int32_t triangle[] = {0, 2, 1}, node = 1;
    const drape_setting material[] = {{.name = "young_modulus", .number = 1e4},
                                      {.name = "thickness", .number = 1e-3},
                                      {.name = "total_mass", .number = 0.3}};
    scoped_host h = empty_host();
    drape_scene_def scene = scene_def();
    drape_cloth_def cloth = cloth_def();
    drape_mass_def mass;
    drape_mass_def_init(&mass, sizeof mass);
    ck_assert(isnan(mass.add) && isnan(mass.mass));
    cloth.mesh.positions = x, cloth.mesh.node_count = 3;
    cloth.mesh.triangles = triangle, cloth.mesh.triangle_count = 1;
    cloth.material = material, cloth.material_count = 3;
    cloth.masses = &mass, cloth.mass_count = 1;
    scene.cloths = &cloth, scene.cloth_count = 1;
    mass.nodes = &node, mass.node_count = 1;
    says(&h, drape_model_create(h.ctx, &scene, &h.model), DRAPE_E_ARGUMENT,
         "/cloth/0/masses/0: exactly one of add, mass is needed; given: none");
    mass.add = mass.mass = 1;
    says(&h, drape_model_create(h.ctx, &scene, &h.model), DRAPE_E_ARGUMENT,
         "/cloth/0/masses/0: exactly one of add, mass is needed; given: both");
    mass.mass = NAN, mass.add = -1;
    says(&h, drape_model_create(h.ctx, &scene, &h.model), DRAPE_E_ARGUMENT, "/cloth/0/masses/0/add: -1");
    mass.add = 0.7;
    mass.struct_size = 8;
    says(&h, drape_model_create(h.ctx, &scene, &h.model), DRAPE_E_VERSION, "drape_mass_def_init");
    mass.struct_size = sizeof mass;
    good(&h, drape_model_create(h.ctx, &scene, &h.model));
    ck_assert_double_eq_tol(drape_model_masses(h.model)[0], 0.1, 1e-16);
    ck_assert_double_eq_tol(drape_model_masses(h.model)[1], 0.8, 1e-15);
}

/* ---- A running sim ---- */

/* Masses given by a call go on as the same masses from a scene: weights, inertia, the stiffness of contact;
 * to the bit for the methods of one step, and so do all in a sim that is restored. */
TEST(a_call_does_what_a_scene_does)
{
    for (int i = 0; i < METHODS; i++) {
        scoped_host a = open_scene(ON_BALL, ""),
                    b = open_scene(
                        ON_BALL,
                        ", 'masses': [{'nodes': [7, 12], 'mass': 0.01}, {'nodes': [19], 'mass': 0.05}]");
        const int32_t nodes[] = {7, 12, 19};
        const double heavy[] = {0.01, 0.01, 0.05};
        drape_sim_def def = sim_def();
        def.integrator = methods[i];
        def.dt = strcmp(methods[i], "verlet") == 0 ? FRAME / 64 : FRAME / 2;
        drape_sim_destroy(&a.sim);
        drape_sim_destroy(&b.sim);
        good(&a, drape_sim_create(a.ctx, a.model, &def, &a.sim));
        good(&b, drape_sim_create(b.ctx, b.model, &def, &b.sim));
        good(&a, drape_sim_set_masses(a.sim, 3, nodes, heavy));
        ck_assert_mem_eq(masses_of(&a), masses_of(&b), 20 * sizeof(double));
        ck_assert_double_eq(drape_sim_energy(a.sim).gravity, drape_sim_energy(b.sim).gravity);
        advance(&a, 6 * FRAME);
        advance(&b, 6 * FRAME);
        ck_assert_msg(drape_sim_hash(a.sim) == drape_sim_hash(b.sim), "%s", methods[i]);
        scoped_bytes kept = bytes_save(a.sim);
        advance(&a, 2 * FRAME);
        const uint64_t hash = drape_sim_hash(a.sim);
        drape_sim_destroy(&a.sim);
        good(&a, drape_sim_create(a.ctx, a.model, &def, &a.sim));
        good(&a, drape_sim_restore_from(a.sim, kept.data, kept.size));
        ck_assert_mem_eq(masses_of(&a), masses_of(&b), 20 * sizeof(double));
        advance(&a, 2 * FRAME);
        ck_assert_msg(drape_sim_hash(a.sim) == hash, "%s", methods[i]);
    }
}

/* A flying sheet keeps its velocities to the bit; from then on its momentum is that of the new masses. The
 * kinetic energy that the masses bring counts as given by the host. The residual bound of 1e-9 N on 20 nodes
 * for 1/8 s. */
TEST(velocities_stay_and_momentum_follows)
{
    scoped_host h = open_scene("{'drape': 1, 'gravity': [0, 0, 0], 'cloth': [{" CLOTH
                               ", 'velocity': [1, 2, 0.5]}], " TO_GROUND);
    const int32_t nodes[] = {3, 11};
    const double masses[] = {0.03, 0.2};
    double v[60], p[3] = {0}, q[3] = {0}, kinetic = 0;
    advance(&h, 4 * FRAME);
    memcpy(v, drape_sim_velocities(h.sim), sizeof v);
    const double numerical = drape_sim_energy(h.sim).numerical;
    good(&h, drape_sim_set_masses(h.sim, 2, nodes, masses));
    ck_assert_mem_eq(v, drape_sim_velocities(h.sim), sizeof v);
    for (int i = 0; i < 60; i++) {
        p[i % 3] += masses_of(&h)[i / 3] * v[i];
        kinetic += masses_of(&h)[i / 3] * v[i] * v[i] / 2;
    }
    ck_assert_double_eq_tol(drape_sim_energy(h.sim).kinetic, kinetic, 1e-13);
    ck_assert_double_eq_tol(drape_sim_energy(h.sim).numerical, numerical, 1e-14);
    advance(&h, 8 * FRAME);
    for (int i = 0; i < 60; i++)
        q[i % 3] += masses_of(&h)[i / 3] * drape_sim_velocities(h.sim)[i];
    for (int k = 0; k < 3; k++)
        ck_assert_double_eq_tol(q[k], p[k], 20 * 1e-9 / 8);
}

/* Each allocation fails once: the sim is as it was, nothing leaks, and then the masses change. */
TEST(masses_without_memory)
{
    scoped_host h = open_scene(ON_BALL, "");
    const int32_t node = 12;
    const double mass = 0.1;
    advance(&h, 4 * FRAME);
    const uint64_t hash = drape_sim_hash(h.sim);
    drape_status status = DRAPE_E_MEMORY;
    for (long n = 1; status; n++) {
        h.memory->fail_at = h.memory->calls + n;
        status = drape_sim_set_masses(h.sim, 1, &node, &mass);
        h.memory->fail_at = 0;
        ck_assert(!status || status == DRAPE_E_MEMORY);
        ck_assert(drape_sim_hash(h.sim) == hash);
        ck_assert_int_eq(masses_of(&h)[node] == mass, status == DRAPE_OK);
        ck_assert_int_lt(n, 5000);
    }
    advance(&h, 2 * FRAME);
}
