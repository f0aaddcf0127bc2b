/* engine_output.c: see engine_output.h. */
#include "lab/engine_output.h"

#include "base/json_read.h"
#include "base/param.h"
#include "colliders/colliders.h"
#include "compile/compile.h"
#include "control/control.h"
#include "integrators/integrator.h"
#include "io/csv.h"
#include "io/export.h"
#include "mesh/mesh.h"
#include "model/scene.h"
#include "terms/terms.h"

#include <errno.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

/* ---- Files ---- */

drape_status lab_write_text(lab *l, const char *name, const char *text, size_t size)
{
    drape_file file = {0};
    drape_status status = drape_export_begin(l->ctx, l->out, name, &file);
    if (!status) {
        drape_file_put(&file, text, size);
        status = drape_file_finish(&file);
    }
    drape_file_destroy(&file);
    return status;
}

drape_status lab_read_text(drape_arena *arena, const char *folder, const char *name, char **text,
                           size_t *size)
{
    char path[4096], *bytes;
    snprintf(path, sizeof path, "%s%s%s", folder ? folder : "", folder ? "/" : "", name);
    drape_status status = drape_file_read(arena->ctx, path, DRAPE_MAX_TABLE, &bytes, size);
    *text = status ? NULL : drape_arena_take(arena, *size + 1, 1);
    if (*text)
        memcpy(*text, bytes, *size + 1);
    drape_free(arena->ctx, bytes);
    return status || *text ? status : DRAPE_E_MEMORY;
}

drape_status lab_write_json(lab *l, const char *name, json_t *object, size_t flags)
{
    errno = 0;
    char *text = object ? json_dumps(object, flags) : NULL;
    drape_status status = text && !drape_memory_ran_out()
                              ? lab_write_text(l, name, text, strlen(text))
                              : drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for %s", name);
    free(text);
    json_decref(object);
    return status;
}

drape_status lab_read_json(drape_arena *arena, const char *folder, const char *name, json_t **object)
{
    char *text;
    size_t size;
    json_error_t fault;
    drape_status status = lab_read_text(arena, folder, name, &text, &size);
    *object = status ? NULL : drape_json_read(text, size, JSON_REJECT_DUPLICATES, &fault);
    if (status || *object)
        return status;
    if (json_error_code(&fault) == json_error_out_of_memory)
        return drape_fail_memory(arena->ctx, size);
    return drape_fail(arena->ctx, DRAPE_E_PARSE, "%.400s%s%.400s:%d:%d: %.200s", folder ? folder : "",
                      folder ? "/" : "", name, fault.line, fault.column, fault.text);
}

void lab_put_line(drape_file *file, const json_t *object)
{
    drape_json_put(file, object, JSON_COMPACT | JSON_REAL_PRECISION(17));
    drape_file_put_text(file, "\n");
}

static void put_field(drape_file *file, const json_t *value)
{
    if (json_is_real(value))
        drape_file_print(file, ",%.10g", json_real_value(value));
    else if (json_is_integer(value))
        drape_csv_put_integer(file, json_integer_value(value));
    else
        drape_csv_put_text(file, json_string_value(value));
}

/* Adds the scalar members of an object to the columns. */
static void add_columns(json_t *columns, json_t *object)
{
    const char *key;
    json_t *value;
    json_object_foreach(object, key, value)
    {
        if (!json_is_object(value) && !json_is_array(value))
            json_object_set_new(columns, key, json_true());
    }
}

drape_status lab_write_csv(lab *l)
{
    drape_file file = {0};
    json_t *tags = json_object(), *columns = json_object(), *unused;
    const char *key;
    for (size_t i = 0; i < l->count; i++) {
        add_columns(tags, json_object_get(l->results[i], "tags"));
        add_columns(columns, l->results[i]);
    }
    json_object_del(columns, "case");
    drape_status status = tags && columns ? drape_export_begin(l->ctx, l->out, "results.csv", &file)
                                          : drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for results.csv");
    if (!status) {
        drape_file_put_text(&file, "case");
        json_object_foreach(tags, key, unused) drape_csv_put_text(&file, key);
        json_object_foreach(columns, key, unused) drape_csv_put_text(&file, key);
        for (size_t i = 0; i < l->count; i++) {
            const json_t *result = l->results[i];
            if (!result)
                continue;
            drape_file_print(&file, "\n%zu", i);
            json_object_foreach(tags, key, unused)
                put_field(&file, json_object_get(json_object_get(result, "tags"), key));
            json_object_foreach(columns, key, unused) put_field(&file, json_object_get(result, key));
        }
        drape_file_put_text(&file, "\n");
        status = drape_file_finish(&file);
    }
    drape_file_destroy(&file);
    json_decref(tags);
    json_decref(columns);
    return status;
}

/* ---- The page ---- */

static void put_escaped(FILE *out, const char *text)
{
    for (; *text; text++)
        if (*text == '<')
            fputs("&lt;", out);
        else if (*text == '>')
            fputs("&gt;", out);
        else if (*text == '&')
            fputs("&amp;", out);
        else if (*text == '"')
            fputs("&quot;", out);
        else
            fputc(*text, out);
}

void lab_page_heading(lab *l, const char *text)
{
    fputs("<h2>", l->page);
    put_escaped(l->page, text);
    fputs("</h2>\n", l->page);
}

void lab_page_figure(lab *l, const char *svg, size_t size, const char *caption)
{
    static const char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const unsigned char *data = (const unsigned char *)svg;
    fputs("<figure><img alt=\"", l->page);
    put_escaped(l->page, caption);
    fputs("\" src=\"data:image/svg+xml;base64,", l->page);
    for (size_t i = 0; i < size; i += 3) {
        unsigned long bits = (unsigned long)data[i] << 16;
        bits |= i + 1 < size ? (unsigned long)data[i + 1] << 8 : 0;
        bits |= i + 2 < size ? data[i + 2] : 0;
        fputc(letters[bits >> 18 & 63], l->page);
        fputc(letters[bits >> 12 & 63], l->page);
        fputc(i + 1 < size ? letters[bits >> 6 & 63] : '=', l->page);
        fputc(i + 2 < size ? letters[bits & 63] : '=', l->page);
    }
    fputs("\"><figcaption>", l->page);
    put_escaped(l->page, caption);
    fputs("</figcaption></figure>\n", l->page);
}

/* A row of cells that tabs separate, whose number it returns; kind: the element of HTML that a cell is. */
static int put_row(const lab_table *t, const char *kind, char *cells)
{
    FILE *page = t->l->page, *markdown = t->markdown;
    int count = 0;
    fputs("<tr>", page);
    for (char *cell = cells, *end; cell; cell = end ? end + 1 : NULL, count++) {
        end = strchr(cell, '\t');
        if (end)
            *end = 0;
        fprintf(page, "<%s>", kind);
        put_escaped(page, cell);
        fprintf(page, "</%s>", kind);
        if (markdown)
            fputs(count ? " " : "| ", markdown);
        for (const char *at = cell; markdown && *at; at++)
            fputs(*at == '|' ? "\\|" : *at == '<' ? "&lt;" : (char[]){*at, 0}, markdown);
        if (markdown)
            fputs(" |", markdown);
    }
    fputs("</tr>\n", page);
    if (markdown)
        fputs("\n", markdown);
    return count;
}

void lab_table_begin(const lab_table *t, const char *title, const char *format, ...)
{
    char heads[2 * DRAPE_MESSAGE_SIZE];
    va_list values;
    va_start(values, format);
    vsnprintf(heads, sizeof heads, format, values);
    va_end(values);
    lab_page_heading(t->l, title);
    fputs("<table>", t->l->page);
    if (t->markdown)
        fprintf(t->markdown, "\n%s\n\n", title);
    const int count = put_row(t, "th", heads);
    for (int i = 0; t->markdown && i < count; i++)
        fputs(i ? "---|" : "|---|", t->markdown);
    if (t->markdown)
        fputs("\n", t->markdown);
}

void lab_table_row(const lab_table *t, const char *format, ...)
{
    char cells[8 * DRAPE_MESSAGE_SIZE];
    va_list values;
    va_start(values, format);
    vsnprintf(cells, sizeof cells, format, values);
    va_end(values);
    put_row(t, "td", cells);
}

void lab_table_end(const lab_table *t)
{
    fputs("</table>\n", t->l->page);
}

static const char style[] =
    "body{font:16px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#1b1e23;"
    "background:#fff}h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem}"
    "figure{margin:1rem 0}figure "
    "img{width:min(100%,36rem);height:auto}figcaption{font-size:.85rem;color:#555}"
    ".summary p{margin:.3rem 0}table{border-collapse:collapse;font-size:.8rem;display:block;overflow-x:auto}"
    "td,th{padding:.15rem .6rem;text-align:right;border-bottom:1px solid #e3e5e8;white-space:nowrap}"
    "td:first-child,th:first-child{text-align:left}code,pre{font-size:.8rem}"
    "pre{background:#f5f6f7;padding:.7rem;overflow-x:auto}";

drape_status lab_write_page(lab *l, const char *title)
{
    char *text = NULL;
    size_t size = 0, lead = 0;
    fflush(l->summary);
    fflush(l->page);
    FILE *out = open_memstream(&text, &size);
    if (!out)
        return drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for report.html");
    fputs("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
          "content=\"width=device-width\"><title>",
          out);
    put_escaped(out, title);
    fprintf(out, "</title><style>%s</style></head>\n<body>\n<h1>", style);
    put_escaped(out, title);
    fputs("</h1>\n<div class=\"summary\">", out);
    for (const char *at = l->summary_text; *at;) { /* each line is a paragraph, an indented one a command */
        const bool command = *at == ' ';
        if (!command && at > l->summary_text && lead < l->lead_size) {
            fwrite(l->page_text, 1, l->lead_size, out);
            lead = l->lead_size;
        }
        const size_t length = strcspn(at, "\n");
        char *line = strndup(at, length);
        fputs(command ? "<pre>" : "<p>", out);
        put_escaped(out, line ? line + strspn(line, " ") : "");
        fputs(command ? "</pre>\n" : "</p>\n", out);
        free(line);
        at += length + (at[length] == '\n');
    }
    fputs("</div>\n", out);
    fwrite(l->page_text + lead, 1, l->page_size - lead, out);
    json_t *about = json_copy(l->about); /* what was run, to run it again */
    json_object_del(about, "cases");
    char *origin = json_dumps(about, JSON_INDENT(2));
    fputs("<h2>What was run</h2>\n<pre>", out);
    put_escaped(out, origin ? origin : "");
    fputs("</pre>\n</body></html>\n", out);
    free(origin);
    json_decref(about);
    drape_status status = fclose(out) ? drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for report.html")
                                      : lab_write_text(l, "report.html", text, size);
    free(text);
    return status;
}

/* ---- Units ----
 *
 * A pointer tells in which table a name is to be looked up, "/cloth/0/terms/2/stiffness" in that of the
 * terms, but not in which entry, which is in the scene. A name to which entries give different units has no
 * unit here. */

static const struct {
    const char *part; /* of the pointer */
    const drape_registry *registry;
} tables[] = {{"/mesh/", &drape_grid_registry},
              {"/material/", &drape_material_registry},
              {"/terms/", &drape_term_registry},
              {"/colliders/", &drape_collider_registry},
              {"/contact/", &drape_contact_registry},
              {"/self_contact/", &drape_self_contact_registry},
              {"/untangle/", &drape_untangle_registry},
              {"/integrator/", &drape_integrator_registry},
              {"/controller/", &drape_controller_registry}};

const char *lab_unit(const char *pointer)
{
    const drape_scene_key *key = drape_scene_key_at(pointer);
    const char *unit = NULL;
    const drape_entry *entry;
    size_t t = 0;
    if (key && key->shape == DRAPE_SCENE_VALUE)
        return strcmp(key->param.unit, "1") != 0 ? key->param.unit : "";
    while (t < sizeof tables / sizeof *tables && !strstr(pointer, tables[t].part))
        t++;
    if (t == sizeof tables / sizeof *tables)
        return "";
    for (int i = 0; (entry = drape_registry_entry(tables[t].registry, NULL, i)) != NULL; i++) {
        const int p = drape_param_find(entry->params, entry->param_count, strrchr(pointer, '/') + 1);
        if (p >= 0 && unit && strcmp(unit, entry->params[p].unit) != 0)
            return "";
        if (p >= 0)
            unit = entry->params[p].unit;
    }
    return unit && strcmp(unit, "1") != 0 ? unit : "";
}
