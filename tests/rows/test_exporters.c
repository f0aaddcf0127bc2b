/* test_exporters.c: the table of frame formats; what they write is tested in unit/io. */
#include "io/export.h"

#include "models.h"
#include "support/suite.h"

START_TEST(rows_are_well_formed)
{
    int count = 0;
    for (; drape_exporters[count]; count++) {
        const drape_exporter_ops *ops = drape_exporters[count];
        check_row(ops->entry.name, ops->entry.summary, ops->entry.reference, false);
        ck_assert(ops->open && ops->write && ops->close);
        for (int i = 0; i < count; i++)
            ck_assert_str_ne(ops->entry.name, drape_exporters[i]->entry.name);
    }
    ck_assert_int_ge(count, 3);
}
END_TEST

START_TEST(every_row_is_found_by_its_name)
{
    drape_context *ctx = make_context();
    for (int i = 0; drape_exporters[i]; i++) {
        const drape_exporter_ops *found = NULL;
        ck_assert_int_eq(drape_exporter_find(ctx, "", drape_exporters[i]->entry.name, &found), DRAPE_OK);
        ck_assert_ptr_eq(found, drape_exporters[i]);
    }
    drape_context_destroy(&ctx);
}
END_TEST

START_TEST(others_are_refused_with_the_list)
{
    static const char *const names[] = {"", "npyy", "NPY", "npy ", "no such format"};
    drape_context *ctx = make_context();
    for (int k = 0; k < 5; k++) {
        const drape_exporter_ops *found = drape_exporters[0];
        ck_assert_int_eq(drape_exporter_find(ctx, "/output/formats/3", names[k], &found), DRAPE_E_ARGUMENT);
        ck_assert_ptr_null(found);
        const char *message = drape_context_message(ctx);
        check_line(message, "the message");
        ck_assert_ptr_eq(strstr(message, "/output/formats/3: "), message);
        for (int i = 0; drape_exporters[i]; i++)
            ck_assert_ptr_nonnull(strstr(message, drape_exporters[i]->entry.name));
        ck_assert_int_eq(!!strstr(message, "did you mean \"npy\"?"), k >= 1 && k <= 3 && k != 2);
    }
    drape_context_destroy(&ctx);
}
END_TEST

SUITE("exporters", rows_are_well_formed, every_row_is_found_by_its_name, others_are_refused_with_the_list)
