/* test_references.c: the references of `drape validate` that take a second or two; expected values
 * against digits from other sources; and that a reference can fail. `drape validate` runs all of
 * them. */
#include "compile/fabrics.h"
#include "lab/reference.h"
#include "lab/sheet.h"
#include "support/sample.h"
#include "support/suite.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const drape_reference *find(const char *name)
{
    for (int i = 0; drape_references[i]; i++)
        if (strcmp(drape_references[i]->entry.name, name) == 0)
            return drape_references[i];
    ck_abort_msg("there is no reference %s", name);
    return NULL;
}

static drape_validation run(const drape_reference *reference, int index)
{
    scoped_context *ctx = NULL;
    drape_validation v;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    ck_assert_int_eq(drape_validate(ctx, reference, index, NULL, NULL, &v), DRAPE_OK);
    return v;
}

/* Runs a case, by the name of its reference and its number, and checks the verdict. */
static void check(const char *name, int index, drape_outcome outcome)
{
    const drape_validation v = run(find(name), index);
    ck_assert_msg(v.verdict == outcome, "%s %g: %s, %.8g obtained, %.8g expected; %s", name, v.parameter,
                  drape_outcome_name(v.verdict), v.obtained, v.expected, v.message);
}

/* Digits from physics texts and from independent programs; all digits listed are correct. */
TEST(expected_values_are_those_of_other_sources)
{
    static const struct {
        const char *name;
        int index;
        double value, digits;
    } known[] = {{"cantilever", 2, 0.1245617664, 1e-10}, {"cantilever", 3, 1.06680232, 1e-8},
                 {"cantilever", 4, 5.888104623, 1e-9},   {"bending_length", 0, 41.487, 5e-4},
                 {"self_buckling", 0, 7.83735, 5e-6},    {"end_load", 0, 0.30172077, 1e-8},
                 {"end_load", 2, 0.66996418, 1e-8},      {"plate_supported", 0, 0.00406235, 5e-9},
                 {"catenary", 0, 0.29234380, 1e-8},      {"pendulum", 2, 1.7622037, 1e-7},
                 {"chain", 0, 3.766067, 1e-6},           {"oscillator_bdf2", 1, 0.990401, 5e-7},
                 {"mylar_balloon", 0, 0.7627, 6e-5},     {"mylar_balloon", 1, 0.599, 1e-4}};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
        const drape_reference *r = find(known[i].name);
        ck_assert_double_eq_tol(drape_reference_expected(r, known[i].index), known[i].value, known[i].digits);
    }
    /* q L^3 = 12.8538 sqrt(E I G J), where the root is B w sqrt(2/(1 + nu)); with hinges it is 19.79 D w. */
    ck_assert_double_eq_tol(drape_reference_expected(find("lateral_buckling"), 1) / sqrt(2), 12.8538, 5e-5);
    ck_assert_double_eq_tol(find("lateral_buckling_hinges")->documented[0], 19.79, 5e-3);
    /* A single strip of the overhang, clamped at one end, sinks by q l^4/(8 D), with l = 0.4 of the radius.
     * The ring is close to that. */
    ck_assert_double_eq_tol(drape_reference_expected(find("cusick_stiff"), 1), pow(0.4, 4) / 8,
                            0.25 * pow(0.4, 4) / 8);
}

/* All cases in the suite `long`, else those that take no more than a second or two. */
TEST(references_pass)
{
    for (int r = 0; complete_sweep() && drape_references[r]; r++)
        for (int i = 0; i < drape_references[r]->case_count; i++)
            check(drape_references[r]->entry.name, i,
                  drape_references[r]->documented ? DRAPE_OUTCOME_DOCUMENTED : DRAPE_OUTCOME_PASS);
    if (complete_sweep())
        return;
    enum { ALL = -1 };
    static const struct {
        const char *name;
        int index;
    } quick[] = {{"cantilever", 2},        {"rest_curvature", 0},      {"end_moment", 1},
                 {"rolled_strip", 3},      {"self_buckling", 0},       {"pendulum", 1},
                 {"free_fall", 0},         {"oscillator", 1},          {"oscillator_bdf2", 1},
                 {"oscillator_trbdf2", 2}, {"oscillator_midpoint", 1}, {"oscillator_verlet", 2},
                 {"oscillator_ida", 1},    {"pendulum_bdf2", 1},       {"pendulum_trbdf2", 1},
                 {"pendulum_ida", 2},      {"friction_slide", 1},      {"friction_slope", 0},
                 {"cusick_stiff", 0},      {"hinged_roof", 4},         {"hinged_roof_limit", 1},
                 {"airbag_square", 0},     {"terminal_velocity", 1},   {"inflated_sphere", 1},
                 {"mylar_balloon", 1},     {"curve_tension", ALL},     {"roller_tension", ALL},
                 {"curve_shear", ALL},     {"stress_relaxation", ALL}, {"creep", ALL},
                 {"beam_frequency", ALL},  {"chain_modes", ALL},       {"membrane_frequency", ALL},
                 {"euler_column", ALL}};
    for (size_t r = 0; r < sizeof quick / sizeof *quick; r++)
        for (int i = 0; i < find(quick[r].name)->case_count; i++)
            if (quick[r].index == ALL || quick[r].index == i)
                check(quick[r].name, i, DRAPE_OUTCOME_PASS);
}

/* All fabrics of the table, so that a new one is checked as well: in the sample, each by one or two of the
 * tests. */
TEST(every_fabric_gives_back_its_published_values)
{
    static const char *const tests[] = {"fabric", "fabric_weft", "fabric_tension", "fabric_shear", "hanging"};
    int fabrics = 0;
    while (drape_fabrics[fabrics + 1].name)
        fabrics++;
    for (size_t t = 0; t < sizeof tests / sizeof *tests; t++) {
        ck_assert_int_eq(find(tests[t])->case_count, fabrics);
        for (int i = 0; i < fabrics; i++) {
            ck_assert_double_eq(find(tests[t])->parameters[i], i + 1);
            if (in_sample(t, (size_t)i, 3))
                check(tests[t], i, DRAPE_OUTCOME_PASS);
        }
    }
    const drape_reference *draped = find("cusick_measured");
    for (int i = 0; i < draped->case_count; i++)
        ck_assert(drape_reference_expected(draped, i) > 0 && drape_reference_expected(draped, i) < 1);
}

/* The stiffnesses that terms get from a fabric: published numbers, and substitutes for those not
 * published. */
TEST(a_fabric_has_what_was_published)
{
    const drape_fabric *jeans = NULL, *feng = &drape_fabrics[1];
    drape_woven tension, bending;
    for (int i = 1; drape_fabrics[i].name; i++) {
        const drape_fabric *f = &drape_fabrics[i];
        ck_assert(*f->what && *f->source && f->areal_density > 0.01 && f->areal_density < 1);
        ck_assert(f->bending.warp > 1e-7 && f->bending.warp < 1e-3 && f->bending.weft > 1e-7 &&
                  f->bending.weft < 1e-3);
        drape_fabric_tension(f, &tension);
        drape_fabric_bending(f, &bending);
        ck_assert(tension.warp > 0 && tension.weft > 0 && tension.shear > 0 && fabs(tension.poisson) < 1);
        ck_assert(bending.shear > 0 && bending.poisson == 0);
        jeans = strcmp(f->name, "wang2011_denim") == 0 ? f : jeans;
    }
    ck_assert_ptr_nonnull(jeans);
    drape_fabric_tension(jeans, &tension);
    drape_fabric_bending(jeans, &bending);
    /* C12^2 = nu^2 C11 C22; the stiffness of a strip is C11 - C12^2/C22. */
    ck_assert_double_eq_tol(tension.warp, 2 * (1013.88629 - 10.234077 * 10.234077 / 205.352005), 1e-9);
    ck_assert_double_eq_tol(tension.poisson, 10.234077 / sqrt(205.352005 * 1013.88629), 1e-12);
    ck_assert_double_eq_tol(tension.shear, 53.387184, 1e-12);
    ck_assert_double_eq_tol(bending.warp, 64.196457e-6 / 4, 1e-15);
    ck_assert_double_eq_tol(4 / jeans->bending.diagonal,
                            1 / bending.warp + 1 / bending.weft + 1 / bending.shear, 1e-6);
    /* At 1/6 the stiffness of the last line of the file: c = 1051.55712 along v, a stress of c (l^2 - 1). */
    double warp[2 * DRAPE_FABRIC_POINTS], weft[2 * DRAPE_FABRIC_POINTS];
    ck_assert(drape_fabric_curves(jeans, warp, weft));
    const double l = 7. / 6, free_sides = 1 - 10.234077 * 10.234077 / (205.352005 * 1013.88629);
    ck_assert_double_eq_tol(warp[2 * DRAPE_FABRIC_POINTS - 2], l - 1, 1e-15);
    ck_assert_double_eq_tol(warp[2 * DRAPE_FABRIC_POINTS - 1], free_sides * 1051.55712 * l * (l * l - 1),
                            1e-9);
    ck_assert_double_eq_tol(weft[2 * DRAPE_FABRIC_POINTS - 1], free_sides * 232.027634 * l * (l * l - 1),
                            1e-9);
    ck_assert(!drape_fabric_curves(feng, warp, weft));
    drape_fabric_tension(feng, &tension);
    ck_assert_double_eq(tension.warp, 1e4);
    ck_assert_double_eq(tension.shear, 34.4);
    ck_assert_double_eq(tension.poisson, 0);
}

TEST(hinges_show_their_model_error)
{
    check("plate_hinges", 0, DRAPE_OUTCOME_DOCUMENTED);
    check("lateral_buckling_hinges", 0, DRAPE_OUTCOME_DOCUMENTED);
}

static double one_per_cent_off(double parameter)
{
    return 1.01 * find("rest_curvature")->expected(parameter);
}

static int broken_scene(const drape_reference_run *c, char text[DRAPE_LAB_TEXT])
{
    (void)c;
    return snprintf(text, DRAPE_LAB_TEXT, "{'drape': 1}");
}

TEST(references_can_fail)
{
    drape_reference wrong = *find("rest_curvature");
    wrong.expected = one_per_cent_off;
    ck_assert_int_eq(run(&wrong, 0).verdict, DRAPE_OUTCOME_FAIL);
    wrong.scene = broken_scene;
    const drape_validation v = run(&wrong, 0);
    ck_assert_int_eq(v.verdict, DRAPE_OUTCOME_STOPPED);
    ck_assert_ptr_nonnull(strstr(v.message, "cloth"));
    ck_assert(isnan(v.obtained));
}

static bool at_once(void *user)
{
    (void)user;
    return true;
}

TEST(a_case_can_be_cancelled)
{
    scoped_context *ctx = NULL;
    drape_validation v;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    ck_assert_int_eq(drape_validate(ctx, find("pendulum"), 0, at_once, NULL, &v), DRAPE_E_STOPPED);
}

TEST(references_are_complete)
{
    scoped_context *ctx = NULL;
    int count = 0;
    ck_assert_int_eq(drape_context_create(NULL, &ctx), DRAPE_OK);
    for (; drape_references[count]; count++) {
        const drape_reference *r = drape_references[count];
        char text[DRAPE_LAB_TEXT];
        ck_assert(r->entry.name && r->entry.summary && r->unit && r->model && r->entry.reference &&
                  !r->measure != !r->value && r->tolerance > 0);
        ck_assert(r->case_count > 0 && (r->case_count == 1 || r->parameter));
        ck_assert(!r->expected == !!r->known && !r->scene == !!r->sheet);
        ck_assert(!r->known || r->known_count == 1 || r->known_count == r->case_count);
        for (int i = 0; i < r->case_count; i++) {
            ck_assert(isfinite(drape_reference_expected(r, i)));
            scoped_parsed *scene = NULL;
            ck_assert_int_gt(drape_reference_text(r, i, 1, text), 0);
            ck_assert_msg(!drape_scene_parse(ctx, text, "reference", &scene), "%s: %s", r->entry.name,
                          drape_context_message(ctx)); /* one that is cut short is not JSON */
        }
    }
    ck_assert_int_ge(count, 12);
}
