/* four_nodes.h: the smallest sheet of the DEP report: two triangles, nodes 0 to 2 pinned, node 3 falls
 * around the hinge. */
#ifndef DRAPE_TESTS_FOUR_NODES_H
#define DRAPE_TESTS_FOUR_NODES_H

#include "support/scene.h"

#define FOUR_NODES_STEPS 500
#define FOUR_NODES_STEP  0.01 /* [s] */

/* tolerance: of the largest component [N]; more: settings of the integrator, each after a comma */
static inline scene four_nodes(double tolerance, const char *more)
{
    return scene_open(
        "{'drape': 1, 'cloth': [{'mesh': {'grid': 'equilateral', 'edges': 1, 'edge_length': 0.1},"
        "'material': {'young_modulus': 1e7, 'thickness': 1e-3, 'total_mass': 0.01, 'mass': 'uniform'},"
        "'terms': [{'type': 'stretch.edge', 'stiffness': 'report'}, {'type': 'bend.hinge',"
        "'stiffness': 'report'}],"
        "'pins': [{'nodes': [0, 1, 2]}]}],"
        "'gravity': [0, -9.81, 0], 'integrator': {'method': 'be', 'dt': %g, 'tolerance': %g%s},"
        "'duration': 5}",
        FOUR_NODES_STEP, tolerance, more);
}

#endif
