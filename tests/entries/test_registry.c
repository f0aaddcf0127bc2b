/* test_registry.c: what all tables have in common: entries are well formed and are found by their names;
 * other names are refused with the list of those that exist. */
#include "base/registry.h"
#include "colliders/colliders.h"
#include "compile/compile.h"
#include "control/control.h"
#include "fields/fields.h"
#include "io/export.h"
#include "mesh/sequence.h"
#include "solvers/linear.h"
#include "terms/terms.h"

#include <stdio.h>
#include <string.h>

#include "models.h"
#include "support/suite.h"

static const struct {
    const drape_registry *registry;
    int at_least;    /* entries */
    bool dots;       /* in their names */
    bool references; /* all entries have one */
} tables[] = {{&drape_grid_registry, 4, false, false},         {&drape_import_registry, 2, false, false},
              {&drape_sequence_registry, 3, false, true},      {&drape_term_registry, 5, true, true},
              {&drape_collider_registry, 2, false, true},      {&drape_linear_registry, 2, false, true},
              {&drape_integrator_registry, 2, false, true},    {&drape_controller_registry, 2, false, true},
              {&drape_field_registry, 2, false, false},        {&drape_exporter_registry, 3, false, true},
              {&drape_material_registry, 1, false, false},     {&drape_contact_registry, 1, false, false},
              {&drape_self_contact_registry, 1, false, false}, {&drape_untangle_registry, 1, false, false}};
#define TABLES (sizeof tables / sizeof *tables)

TEST(entries_are_well_formed)
{
    for (size_t t = 0; t < TABLES; t++) {
        const drape_registry *registry = tables[t].registry;
        const int count = drape_registry_count(registry);
        ck_assert_int_ge(count, tables[t].at_least);
        check_line(registry->noun, "what an entry is");
        check_line(registry->title, "a title");
        check_line(registry->place, "a place");
        check_name(registry->key, false);
        for (int i = 0; i < count; i++) {
            const drape_entry *entry = registry->entries[i];
            check_name(entry->name, tables[t].dots);
            check_line(entry->summary, "a summary");
            if (tables[t].references)
                check_line(entry->reference, "a reference");
            check_params(entry->params, entry->param_count);
        }
    }
}

/* So no two entries have the same name. */
TEST(every_entry_is_found_by_its_name)
{
    scoped_context *ctx = make_context();
    for (size_t t = 0; t < TABLES; t++) {
        const drape_registry *registry = tables[t].registry;
        const int count = drape_registry_count(registry);
        for (int i = 0, found; i < count; i++) {
            ck_assert_ptr_eq(drape_registry_entry(registry, ctx, i), registry->entries[i]);
            ck_assert_int_eq(drape_registry_find(registry, NULL, registry->entries[i]->name), i);
            ck_assert_int_eq(drape_registry_choose(ctx, registry, "", registry->entries[i]->name, &found),
                             DRAPE_OK);
            ck_assert_int_eq(found, i);
        }
        ck_assert_ptr_null(drape_registry_entry(registry, ctx, count));
    }
}

static void refuse(drape_context *ctx, const drape_registry *registry, const char *name, const char *meant)
{
    char suggestion[128];
    int found = 7;
    ck_assert_int_eq(drape_registry_choose(ctx, registry, "/a/3", name, &found), DRAPE_E_ARGUMENT);
    ck_assert_int_eq(found, -1);
    const char *message = drape_context_message(ctx);
    check_line(message, "the message");
    ck_assert_ptr_eq(strstr(message, "/a/3: there is no "), message);
    ck_assert_ptr_nonnull(strstr(message, registry->noun));
    for (int i = 0; registry->entries[i]; i++)
        ck_assert_ptr_nonnull(strstr(message, registry->entries[i]->name));
    snprintf(suggestion, sizeof suggestion, "; did you mean \"%s\"?", meant ? meant : "");
    ck_assert_msg(!strstr(message, "did you mean") == !meant, "%s", message);
    ck_assert_msg(!meant || strstr(message, suggestion), "%s", message);
}

TEST(other_names_are_refused_with_the_list)
{
    scoped_context *ctx = make_context();
    for (size_t t = 0; t < TABLES; t++) {
        const drape_registry *registry = tables[t].registry;
        const char *first = registry->entries[0]->name;
        char other[64];
        refuse(ctx, registry, "", NULL);
        refuse(ctx, registry, "QQQQQQQQ", NULL);
        snprintf(other, sizeof other, "%sQ", first);
        refuse(ctx, registry, other, first);
        snprintf(other, sizeof other, "%s ", first);
        refuse(ctx, registry, other, first);
    }
    refuse(ctx, &drape_exporter_registry, "NPY", NULL);
}

TEST(user_defined_entries_stand_behind_the_others)
{
    scoped_context *ctx = make_context();
    drape_term_ops own = *drape_terms[0];
    const int count = drape_registry_count(&drape_term_registry);
    own.entry.name = "host.own";
    ck_assert_int_eq(drape_context_add_term(ctx, &own), DRAPE_OK);
    ck_assert_int_eq(drape_registry_find(&drape_term_registry, ctx, "host.own"), count);
    ck_assert_int_eq(drape_registry_find(&drape_term_registry, NULL, "host.own"), -1);
    ck_assert_int_eq(drape_registry_find(&drape_collider_registry, ctx, "host.own"), -1);
    ck_assert_str_eq(drape_registry_entry(&drape_term_registry, ctx, count)->name, "host.own");
    ck_assert_ptr_null(drape_registry_entry(&drape_term_registry, ctx, count + 1));
    refuse(ctx, &drape_term_registry, "host.owm", "host.own");
}
