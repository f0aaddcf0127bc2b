/* test_lab.c: the measures of experiments: fitted powers, distances. */
#include "lab/engine_output.h"
#include "lab/fit.h"
#include "lab/trace.h"
#include "support/suite.h"

#include <math.h>
#include <string.h>

static drape_model *sheet(drape_context *ctx, double columns, double rows)
{
    const drape_setting grid[] = {
        {"columns", columns, NULL}, {"rows", rows, NULL}, {"width", 2, NULL}, {"height", 1, NULL}};
    static const drape_setting material[] = {
        {"young_modulus", 1e5, NULL}, {"thickness", 1e-3, NULL}, {"density", 200, NULL}};
    static const int32_t pinned[] = {0};
    drape_pin_def pin = pin_def();
    drape_cloth_def cloth = cloth_def();
    drape_scene_def scene = scene_def();
    drape_model *model = NULL;
    pin.nodes = pinned;
    pin.node_count = 1;
    cloth.mesh.grid = (drape_entry_def){"square", grid, 4};
    cloth.material = material;
    cloth.material_count = 3;
    cloth.pins = &pin;
    cloth.pin_count = 1;
    scene.cloths = &cloth;
    scene.cloth_count = 1;
    ck_assert_int_eq(drape_model_create(ctx, &scene, &model), DRAPE_OK);
    return model;
}

/* y = 3 x^2 exactly: the slope is 2 up to rounding, with an uncertainty of 0. */
TEST(a_power_is_found_exactly)
{
    double x[6], y[6];
    for (int i = 0; i < 6; i++) {
        x[i] = ldexp(0.1, -i);
        y[i] = 3 * x[i] * x[i];
    }
    lab_line line = lab_fit_power(x, y, 6);
    ck_assert_double_eq_tol(line.slope, 2, 1e-12);
    ck_assert_double_eq_tol(exp(line.intercept), 3, 1e-11);
    ck_assert_double_eq_tol(line.high - line.low, 0, 1e-6);
}

/* Residuals of +d, -2d, +d in the logarithms, at abscissae -1, 0, 1 (times log 2), do not change the slope;
 * its standard error is sqrt(6 d^2/1 / (2 log(2)^2)), and Student's t for one degree of freedom at 97.5 %
 * is 12.7062. */
TEST(confidence_is_students)
{
    const double d = 1e-3, x[] = {0.5, 1, 2}, y[] = {0.5 * exp(d), exp(-2 * d), 2 * exp(d)};
    lab_line line = lab_fit_power(x, y, 3);
    double half = 12.706204736 * sqrt(6 * d * d / (2 * log(2) * log(2)));
    ck_assert_double_eq_tol(line.slope, 1, 1e-12);
    ck_assert_double_eq_tol(line.high - line.slope, half, 1e-8);
    ck_assert_double_eq_tol(line.slope - line.low, half, 1e-8);
    ck_assert(isnan(lab_fit_power(x, y, 2).low));
}

/* Pinned nodes do not count: if all free ones have moved by 5, the distance is 5. */
TEST(a_distance_is_of_the_free_nodes)
{
    scoped_context *ctx = make_context();
    scoped_model *model = sheet(ctx, 3, 3);
    double x[27] = {0}, y[27] = {0};
    for (int i = 1; i < 9; i++) {
        y[3 * i] = 3;
        y[3 * i + 2] = -4;
    }
    y[1] = 1e3; /* the pinned one */
    ck_assert_double_eq_tol(lab_distance(model, x, y), 5, 1e-14);
}

TEST(a_value_of_a_scene_has_its_unit)
{
    static const struct {
        const char *pointer, *unit;
    } known[] = {{"/integrator/dt", "s"},
                 {"/integrator/rtol", ""}, /* a plain number */
                 {"/integrator/max_order", ""},
                 {"/cloth/0/material/young_modulus", "Pa"},
                 {"/cloth/3/material/density", "kg/m3"},
                 {"/cloth/0/mesh/edge_length", "m"},
                 {"/cloth/0/mesh/columns", ""},
                 {"/cloth/0/terms/2/beta", "s"},
                 {"/cloth/0/terms/2/warp", ""}, /* N/m of stretch.cst, N m of bend.midedge */
                 {"/colliders/0/radius", "m"},
                 {"/contact/distance", "m"},
                 {"/self_contact/thickness", "m"},
                 {"/gravity/1", "m/s2"},
                 {"/controller/dt_min", "s"},
                 {"/nowhere/dt", ""}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        ck_assert_msg(strcmp(lab_unit(known[i].pointer), known[i].unit) == 0, "%s: \"%s\", not \"%s\"",
                      known[i].pointer, lab_unit(known[i].pointer), known[i].unit);
}
