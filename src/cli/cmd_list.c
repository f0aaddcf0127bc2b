/* cmd_list.c: `drape list`: the keys of a scene and the tables of the library, as text, as Markdown, and as
 * the schema of a scene. */
#include "cli/cli.h"
#include "cli/schema.h"

#include "base/param.h"
#include "base/pi.h"
#include "base/reason.h"
#include "colliders/colliders.h"
#include "compile/compile.h"
#include "compile/fabrics.h"
#include "control/control.h"
#include "events/events.h"
#include "fields/fields.h"
#include "io/export.h"
#include "mesh/sequence.h"
#include "render/shading.h"
#include "solvers/linear.h"
#include "terms/terms.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define MAX_NAMES   256
#define MAX_OBJECTS 32
#define MAX_FABRICS 64

typedef struct list_request {
    cli_command command;
    bool markdown, schema;
} list_request;

#define SCENE_NAME  "scene" /* the keys of a scene, which are not in a table */
#define SCENE_TITLE "The scene file"

/* An object of a scene that has keys of its own. */
typedef struct cli_object {
    const drape_scene_object *form;
    char pointer[64]; /* "/cloth/N/mesh"; "" for the scene itself */
} cli_object;

/* How a table is printed; a function that is NULL prints nothing. */
typedef struct list_style {
    const char *scene; /* before its keys */
    void (*object)(const cli_object *object);
    void (*key)(const cli_object *objects, int count, int at, const drape_scene_key *key);
    void (*table)(const drape_registry *table);
    void (*entries_begin)(const drape_registry *table);
    void (*entry)(const drape_registry *table, const char *only, int at); /* only: as in print_table */
    void (*param)(const drape_param *param);
    void (*params)(const drape_registry *table, const char *only); /* all, after the entries; NULL: each entry
                                                                      has its own below it */
} list_style;

/* What a parameter, or a key of a scene, takes and has by default, in words; the unit has a place of its
 * own. */
typedef struct param_text {
    char takes[1024], value[256], unit[64];
} param_text;

static param_text text_of(const drape_param *param)
{
    param_text text;
    drape_param plain = *param;
    plain.unit = "1";
    drape_param_range_text(&plain, text.takes, sizeof text.takes);
    double value[DRAPE_PARAM_WIDEST];
    drape_param_default(param, value);
    drape_param_value_text(param, value, text.value, sizeof text.value);
    snprintf(text.unit, sizeof text.unit, "%s", strcmp(param->unit, "1") == 0 ? "" : param->unit);
    return text;
}

/* A key of which, with others, exactly one is given has no default. */
static param_text text_of_key(const cli_object *object, const drape_scene_key *key)
{
    param_text text = text_of(&key->param);
    drape_scene_key plain = *key;
    plain.param.unit = "1";
    drape_scene_takes_text(&plain, text.takes, sizeof text.takes);
    drape_scene_default_text(key, text.value, sizeof text.value);
    if (cli_is_one_of(object->form, key))
        *text.value = 0;
    return text;
}

/* ---- The tables and the objects of a scene ---- */

/* Adds an object and those inside it, in the order of their keys. Returns how many there are then. */
static int add_objects(cli_object *objects, int count, const drape_scene_object *form, const char *pointer)
{
    if (count == MAX_OBJECTS || form->key_count == 0)
        return count;
    cli_object *object = &objects[count++];
    object->form = form;
    snprintf(object->pointer, sizeof object->pointer, "%s", pointer);
    for (size_t i = 0; i < form->key_count; i++) {
        const drape_scene_key *key = &form->keys[i];
        const bool array = key->shape == DRAPE_SCENE_OBJECTS || key->shape == DRAPE_SCENE_ENTRIES;
        char inside[sizeof object->pointer];
        snprintf(inside, sizeof inside, "%.40s/%.18s%s", pointer, key->param.name, array ? "/N" : "");
        if (key->child)
            count = add_objects(objects, count, key->child, inside);
    }
    return count;
}

/* The summaries of fabrics are made from numbers, so list_tables fills in the entries: the published values,
 * as drape_fabric has them, and derived ones in place of those not published. */
static const drape_entry *fabrics[MAX_FABRICS + 1];
static const drape_registry fabric_registry = {
    "fabric", "fabrics", "Measured fabrics", "\"fabric\" of a material", fabrics, NULL};

static const drape_registry *const tables[] = {&drape_grid_registry,       &drape_import_registry,
                                               &drape_material_registry,   &fabric_registry,
                                               &drape_term_registry,       &drape_collider_registry,
                                               &drape_sequence_registry,   &drape_event_registry,
                                               &drape_seam_registry,       &drape_self_contact_registry,
                                               &drape_contact_registry,    &drape_untangle_registry,
                                               &drape_integrator_registry, &drape_controller_registry,
                                               &drape_linear_registry,     &drape_exporter_registry,
                                               &drape_reason_registry,     &drape_field_registry,
                                               &drape_shading_registry,    NULL};

static const drape_registry *const *list_tables(void)
{
    static char summaries[MAX_FABRICS][256];
    static drape_entry entries[MAX_FABRICS];
    for (int i = 0; i < MAX_FABRICS && drape_fabrics[i + 1].name; i++) { /* the first fabric is "none" */
        const drape_fabric *f = &drape_fabrics[i + 1];
        drape_woven tension, bending;
        drape_fabric_tension(f, &tension);
        drape_fabric_bending(f, &bending);
        const size_t size = sizeof summaries[i];
        char *text = summaries[i];
        int used = snprintf(text, size, "%s: %.4g kg/m2", f->what, f->areal_density);
        used += snprintf(text + used, size - (size_t)used,
                         isnan(f->tension.warp) ? "" : "; tension %.4g, %.4g N/m, shear %.3g N/m",
                         tension.warp, tension.weft, tension.shear);
        used += snprintf(text + used, size - (size_t)used, "; bending %.3g, %.3g, twist %.3g uN m",
                         1e6 * bending.warp, 1e6 * bending.weft, 1e6 * bending.shear);
        used += snprintf(text + used, size - (size_t)used, "; loss factor %.2g at %.2g Hz",
                         drape_fabric_loss(f), drape_fabric_frequency(f) / (2 * DRAPE_PI));
        snprintf(text + used, size - (size_t)used, isnan(f->drape) ? "" : "; drape coefficient %.3g",
                 f->drape);
        entries[i] = (drape_entry){.name = f->name, .summary = summaries[i], .reference = f->source};
        fabrics[i] = &entries[i];
    }
    return tables;
}

/* ---- As text ---- */

static bool is_shown(const drape_entry *entry, const char *only)
{
    return !only || strcmp(only, entry->name) == 0;
}

/* "": it has none. */
static const char *reference_of(const drape_entry *entry)
{
    return entry->reference && strcmp(entry->reference, "-") != 0 ? entry->reference : "";
}

static void text_object(const cli_object *object)
{
    char one_of[256];
    drape_scene_one_of_text(object->form, one_of, sizeof one_of);
    printf("\n  %-20s %s%s%s\n", object->form->name, *object->pointer ? object->pointer : "at the top",
           *one_of ? "; " : "", one_of);
}

static void print_param(const char *name, const char *help, const param_text *text, const char *prefix)
{
    printf("    %-18s %s\n    %-18s %s%s%s%s%s%s\n", name, help, "", text->takes, *text->unit ? " " : "",
           text->unit, *text->value ? "; " : "", *text->value ? prefix : "", text->value);
}

static void text_key(const cli_object *objects, int count, int at, const drape_scene_key *key)
{
    (void)count;
    param_text text = text_of_key(&objects[at], key);
    drape_scene_takes_text(key, text.takes, sizeof text.takes); /* the unit included */
    *text.unit = 0;
    print_param(key->param.name, key->param.help, &text,
                drape_param_is_required(&key->param) ? "" : "default ");
}

static void text_table(const drape_registry *table)
{
    printf("%s (%s)%s%s\n", table->title, table->key, *table->place ? ": " : "", table->place);
}

static void text_entry(const drape_registry *table, const char *only, int at)
{
    (void)only;
    const drape_entry *entry = table->entries[at];
    printf("\n  %-20s %s\n", entry->name, entry->summary);
    if (*reference_of(entry))
        printf("  %-20s [%s]\n", "", reference_of(entry));
}

static void text_param(const drape_param *param)
{
    const param_text text = text_of(param);
    print_param(param->name, param->help, &text, isnan(param->default_value) ? "" : "default ");
}

/* ---- As Markdown ---- */

/* A cell of a table, with the characters escaped that would end it. */
static void cell(const char *text)
{
    fputs(" ", stdout);
    for (; *text; text++) {
        if (*text == '|')
            fputc('\\', stdout);
        fputc(*text, stdout);
    }
    fputs(" |", stdout);
}

static void names_cell(const char *const *names, int count)
{
    fputs(" ", stdout);
    for (int i = 0; i < count; i++)
        printf("%s`%s`", i ? ", " : "", names[i]);
    fputs(" |", stdout);
}

static void markdown_cells(const char *const *of, int count, const char *name, const char *help,
                           const param_text *text)
{
    fputs("|", stdout);
    names_cell(of, count);
    names_cell(&name, 1);
    cell(text->unit);
    cell(text->value);
    cell(text->takes);
    cell(help);
    fputc('\n', stdout);
}

/* The length of a name without its number: numbered parameters of one meaning, fraction_1 and so on, have one
 * row. */
static int stem(const char *name)
{
    const int length = (int)strcspn(name, "123456789");
    return length > 0 && name[length - 1] == '_' ? length : (int)strlen(name);
}

static bool is_same_row(const drape_param *a, const param_text *x, const drape_param *b, const param_text *y)
{
    const size_t length = (size_t)stem(a->name);
    return stem(b->name) == (int)length && strncmp(a->name, b->name, length) == 0 &&
           strcmp(a->help, b->help) == 0 && strcmp(x->takes, y->takes) == 0 &&
           strcmp(x->value, y->value) == 0 && strcmp(x->unit, y->unit) == 0;
}

/* The help of a key that stands for others names them, as a reader may see only its row of the table. */
static param_text text_of_row(const cli_object *object, const drape_scene_key *key)
{
    param_text text = text_of_key(object, key);
    const size_t length = strlen(text.takes);
    if (cli_is_one_of(object->form, key)) {
        snprintf(text.takes + length, sizeof text.takes - length, "; ");
        drape_scene_one_of_text(object->form, text.takes + length + 2, sizeof text.takes - length - 2);
    }
    return text;
}

/* One line for all objects that have the same key, at the first of them. */
static void markdown_key(const cli_object *objects, int count, int first, const drape_scene_key *key)
{
    const char *places[MAX_OBJECTS];
    int place_count = 0;
    const param_text text = text_of_row(&objects[first], key);
    for (int i = 0; i < count; i++) {
        const drape_scene_object *form = objects[i].form;
        bool same = false;
        for (size_t k = 0; k < form->key_count && !same; k++) {
            const param_text its = text_of_row(&objects[i], &form->keys[k]);
            same = is_same_row(&key->param, &text, &form->keys[k].param, &its);
        }
        if (same && i < first)
            return;
        if (same)
            places[place_count++] = *objects[i].pointer ? objects[i].pointer : "/";
    }
    markdown_cells(places, place_count, key->param.name, key->param.help, &text);
}

static void markdown_table(const drape_registry *table)
{
    printf("### %s\n", table->title);
    if (*table->place)
        printf("\nWhere: %s.\n", table->place);
}

/* Entries whose keys stand at one place of the scene need no table of names. */
static void markdown_entries_begin(const drape_registry *table)
{
    if (table->entries[1])
        puts("\n| name | what | reference |\n|---|---|---|");
    else
        printf("\n`%s`: %s.\n", table->entries[0]->name, table->entries[0]->summary);
}

/* One line for all entries that have the same description, at the first of them. */
static void markdown_entry(const drape_registry *table, const char *only, int at)
{
    const drape_entry *entry = table->entries[at];
    const char *names[MAX_NAMES];
    int count = 0;
    for (int i = 0; table->entries[i] && count < MAX_NAMES; i++)
        if (is_shown(table->entries[i], only) && strcmp(table->entries[i]->summary, entry->summary) == 0 &&
            strcmp(reference_of(table->entries[i]), reference_of(entry)) == 0) {
            if (i < at)
                return;
            names[count++] = table->entries[i]->name;
        }
    if (!table->entries[1])
        return;
    fputs("|", stdout);
    names_cell(names, count);
    cell(entry->summary);
    cell(reference_of(entry));
    fputc('\n', stdout);
}

static bool is_same_param(const drape_param *a, const drape_param *b)
{
    const param_text x = text_of(a), y = text_of(b);
    return is_same_row(a, &x, b, &y);
}

/* The first such parameter of an entry; NULL: it has none. */
static const drape_param *same_param(const drape_entry *entry, const drape_param *param)
{
    for (int p = 0; p < entry->param_count; p++)
        if (is_same_param(&entry->params[p], param))
            return &entry->params[p];
    return NULL;
}

/* One line for all entries that have the same parameter, at the first of them. */
static void markdown_param(const drape_registry *table, const char *only, int first, const drape_param *param)
{
    const char *names[MAX_NAMES];
    int count = 0;
    const drape_entry *entry;
    for (int i = 0; (entry = table->entries[i]) != NULL && count < MAX_NAMES; i++)
        if (is_shown(entry, only) && same_param(entry, param)) {
            if (i < first || (i == first && same_param(entry, param) != param))
                return;
            names[count++] = entry->name;
        }
    const param_text text = text_of(param);
    const drape_param *last = param;
    for (int p = 0; p < table->entries[first]->param_count; p++)
        if (is_same_param(&table->entries[first]->params[p], param))
            last = &table->entries[first]->params[p];
    char all[128];
    snprintf(all, sizeof all, "%s ... %s", param->name, last->name);
    markdown_cells(names, count, last == param ? param->name : all, param->help, &text);
}

static void markdown_params(const drape_registry *table, const char *only)
{
    bool begun = false;
    const drape_entry *entry;
    for (int i = 0; (entry = table->entries[i]) != NULL; i++)
        for (int p = 0; is_shown(entry, only) && p < entry->param_count; p++) {
            if (!begun)
                puts("\n| of | parameter | unit | default | range | what |\n|---|---|---|---|---|---|");
            begun = true;
            markdown_param(table, only, i, &entry->params[p]);
        }
}

static const list_style text_style = {.scene = SCENE_TITLE " (" SCENE_NAME
                                                           "): its keys, object by object; N counts from 0",
                                      .object = text_object,
                                      .key = text_key,
                                      .table = text_table,
                                      .entry = text_entry,
                                      .param = text_param};
static const list_style markdown_style = {
    .scene = "### " SCENE_TITLE "\n\n| in | key | unit | default | takes | what |\n|---|---|---|---|---|---|",
    .key = markdown_key,
    .table = markdown_table,
    .entries_begin = markdown_entries_begin,
    .entry = markdown_entry,
    .params = markdown_params};

/* ---- What is printed ---- */

/* only: the name of one entry; NULL: all. */
static void print_table(const list_style *style, const drape_registry *table, const char *only)
{
    const drape_entry *entry;
    style->table(table);
    if (style->entries_begin)
        style->entries_begin(table);
    for (int i = 0; (entry = table->entries[i]) != NULL; i++)
        if (is_shown(entry, only)) {
            style->entry(table, only, i);
            for (int p = 0; !style->params && p < entry->param_count; p++)
                style->param(&entry->params[p]);
        }
    if (style->params)
        style->params(table, only);
}

/* only: the name of one object; NULL: all. Returns how many were printed. */
static int print_scene(const list_style *style, const char *only)
{
    cli_object objects[MAX_OBJECTS];
    const int all = add_objects(objects, 0, &drape_form_scene, "");
    int count = 0;
    for (int i = 0; i < all; i++)
        if (!only || strcmp(only, objects[i].form->name) == 0)
            objects[count++] = objects[i];
    if (count > 0)
        puts(style->scene);
    for (int i = 0; i < count; i++) {
        if (style->object)
            style->object(&objects[i]);
        for (size_t k = 0; k < objects[i].form->key_count; k++)
            style->key(objects, count, i, &objects[i].form->keys[k]);
    }
    return count;
}

static int unknown_name(const char *name)
{
    const char *names[MAX_NAMES];
    size_t count = 0;
    const drape_registry *const *all = list_tables();
    cli_object objects[MAX_OBJECTS];
    const int object_count = add_objects(objects, 0, &drape_form_scene, "");
    for (int i = 0; i < object_count; i++)
        names[count++] = objects[i].form->name;
    for (int t = 0; all[t] && count < MAX_NAMES; t++) {
        names[count++] = all[t]->key;
        for (int i = 0; all[t]->entries[i] && count < MAX_NAMES; i++)
            names[count++] = all[t]->entries[i]->name;
    }
    const char *meant = drape_did_you_mean(name, names, count);
    char known[512] = SCENE_NAME;
    size_t used = strlen(known);
    for (int t = 0; all[t] && used < sizeof known; t++)
        used += (size_t)snprintf(known + used, sizeof known - used, ", %s", all[t]->key);
    return cli_misuse("list", "there is no table or entry \"%.60s\"; the tables are %s%s%s%s", name, known,
                      DRAPE_DID_YOU_MEAN(meant));
}

/* name: of a table, of an entry or of an object of a scene; NULL: all tables, the keys of a scene first. */
static int print_tables(const list_style *style, const char *name)
{
    const bool keys = name && strcmp(name, SCENE_NAME) == 0;
    int printed = print_scene(style, keys ? NULL : name);
    for (const drape_registry *const *t = list_tables(); *t; t++) {
        const drape_registry *table = *t;
        bool whole = !name || strcmp(name, table->key) == 0;
        if (!whole && drape_registry_find(table, NULL, name) < 0)
            continue;
        if (printed++)
            fputc('\n', stdout);
        print_table(style, table, whole ? NULL : name);
    }
    return printed ? CLI_DONE : unknown_name(name);
}

static int print_request(const void *command)
{
    const list_request *request = command;
    if (request->schema && (request->command.operand || request->markdown))
        return cli_misuse("list", "--schema takes no name: it prints the schema of a whole scene");
    errno = 0;
    if (request->schema)
        return cli_print_json(&request->command, cli_schema(), JSON_INDENT(2) | JSON_REAL_PRECISION(15));
    return print_tables(request->markdown ? &markdown_style : &text_style, request->command.operand);
}

static const cli_option options[] = {
    {"markdown", CLI_FLAG, NULL, "print Markdown tables", offsetof(list_request, markdown)},
    {"schema", CLI_FLAG, NULL, "print the JSON Schema of a scene", offsetof(list_request, schema)},
};

const drape_verb drape_verb_list = {
    .entry = {.name = "list",
              .summary = "show the keys of a scene and all that it can choose from, with units and defaults"},
    .operand = "TABLE|ENTRY",
    .operand_optional = true,
    .details = "Prints the keys of a scene and all that it can choose from, or one table, or one entry. The "
               "table\n`scene` has the keys of all objects of a scene; the name of an object, such as `pin`, "
               "shows its keys.",
    CLI_OPTIONS(options, list_request),
    .run = print_request,
};
