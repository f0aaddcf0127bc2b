/*
 * Golden numbers: node 3 of the four-node sheet of the DEP report (support/four_nodes.h), positions in
 * metres after the n-th of 500 steps of backward Euler of 0.01 s, residuals below 1e-12 N. They were
 * computed by Drape on 64-bit x86 and agree to 1.5e-8 m at every step with the report's own program and
 * with the course's Python (physics/test_oracle.c). Different linear solvers and variants of Newton change
 * them by 1e-11.
 *
 * They may change when the meaning of backward Euler, of the "report" stiffnesses, of the grid or of
 * gravity does: then the oracle must be run again, and the change is listed in the changelog under "results
 * changed". They may not change with a solver, a compiler, an ordering or a rewrite of a term.
 */
static const struct {
    int step;
    double x[3];
} golden_four_nodes[] = {
    {1, {0.14999532850402761, -0.00097593032014960676, -0.086599843288986678}},
    {50, {0.14057493312313876, -0.042053372789341577, -0.081160975479957792}},
    {100, {0.12937372325598567, -0.059670400106586363, -0.07469395394790744}},
    {250, {0.11348862614442537, -0.074348519654789544, -0.065522688854444788}},
    {500, {0.11052546732435126, -0.076289814647902021, -0.063811908312023366}},
};
