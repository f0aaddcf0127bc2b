/*
 * test_static.c: what the integrator "static" does where there is no equilibrium, and where contact couples
 * nodes. Its equilibria are checked against closed forms by the references of `drape validate`: cantilevers,
 * catenaries, hanging and buckling strips (lab/references).
 */
#include "support/scene.h"

TEST(a_free_sheet_has_no_equilibrium_and_ends)
{
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 5, 'edge_length': 0.02}, "
        "'material': {'young_modulus': 1e6, 'thickness': 0.01, 'areal_density': 0.2}, 'terms': "
        "['stretch.edge', 'bend.hinge']}], 'integrator': {'method': 'static', 'dt': 1, 'tolerance': 1e-9}, "
        "'duration': 1}");
    const double *x = drape_sim_positions(s.sim);
    const uint64_t before = drape_sim_hash(s.sim);
    scene_watch(&s);
    const drape_status status = drape_sim_advance(s.sim, 1);
    const drape_statistics done = drape_sim_statistics(s.sim);
    ck_assert_int_lt(status, 0);
    ck_assert_int_eq(s.accepted, 0);
    ck_assert(drape_sim_time(s.sim) == 0 && drape_sim_hash(s.sim) == before && isfinite(x[0]));
    ck_assert(!done.stability_known);
    ck_assert_msg(strncmp(drape_context_message(s.ctx), "t=0 h=1: ", 9) == 0, "%s",
                  drape_context_message(s.ctx));
    ck_assert_int_lt(done.newton_iterations, 50000);
}

/* A sheet that lies on another: the nodes that contact couples are not coupled in the model's pattern, but
 * must be in the Hessian. Each wrong sign would be a mode. */
TEST(one_sheet_lies_on_another)
{
    scoped_scene s = scene_open(
        "{'drape': 1, 'cloth': [{'name': 'low', 'mesh': {'grid': 'square', 'columns': 5, 'rows': 5, 'width': "
        "0.2,"
        " 'height': 0.2}, 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
        " 'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'edge': 'left'}, {'edge': 'right'}]},"
        " {'name': 'high', 'mesh': {'grid': 'square', 'columns': 4, 'rows': 4, 'width': 0.13, 'height': 0.13,"
        " 'transform': {'translate': [0.03,0.03,-0.03]}},"
        " 'material': {'young_modulus': 1e5, 'thickness': 1e-3, 'density': 200},"
        " 'terms': ['stretch.edge', 'bend.hinge'], 'pins': [{'edge': 'left'}]}],"
        " 'self_contact': {'thickness': 0.004}, 'integrator': {'method': 'static', 'dt': 0.01}, 'duration': "
        "1}");
    scene_advance(&s, 1);
    const drape_statistics found = drape_sim_statistics(s.sim);
    ck_assert(drape_sim_energy(s.sim).contact > 0);
    ck_assert(found.stability_known);
    ck_assert_int_eq(found.unstable_modes, 0);
}
