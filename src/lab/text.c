/* text.c: see text.h. */
#include "lab/text.h"

#include "io/csv.h"

#include <errno.h>
#include <math.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>

extern char **environ;

/* ---- Files ---- */

static drape_status begin_file(lab *l, const char *name, drape_file *file)
{
    drape_status status = drape_file_create(l->ctx, strlen(l->folder) + strlen(name) + 1, file);
    if (status)
        return status;
    drape_file_name(file, "%s/%s", l->folder, name);
    return drape_file_begin(file);
}

drape_status lab_write_text(lab *l, const char *name, const char *text, size_t size)
{
    drape_file file = {0};
    drape_status status = begin_file(l, name, &file);
    if (!status) {
        drape_file_put(&file, text, size);
        status = drape_file_finish(&file);
    }
    drape_file_destroy(&file);
    return status;
}

drape_status lab_read_text(drape_context *ctx, const char *folder, const char *name, char **text,
                           size_t *size)
{
    char path[4096];
    *text = NULL;
    *size = 0;
    snprintf(path, sizeof path, "%s%s%s", folder ? folder : "", folder ? "/" : "", name);
    FILE *file = fopen(path, "r");
    if (!file)
        return drape_file_fail(ctx, "read", path, errno);
    FILE *memory = open_memstream(text, size);
    char part[8192];
    for (size_t n = 1; memory && n > 0;) {
        n = fread(part, 1, sizeof part, file);
        fwrite(part, 1, n, memory);
    }
    bool failed = ferror(file);
    fclose(file);
    if (!memory || fclose(memory))
        return drape_fail_memory(ctx, *size);
    return failed ? drape_file_fail(ctx, "read", path, EIO) : DRAPE_OK;
}

/* ---- CSV ---- */

static void put_field(drape_file *file, const json_t *value)
{
    if (json_is_real(value))
        drape_file_print(file, ",%.10g", json_real_value(value));
    else if (json_is_integer(value))
        drape_csv_put_integer(file, json_integer_value(value));
    else
        drape_csv_put_text(file, json_string_value(value));
}

/* The members of an object that are columns, in their order. */
static void put_fields(drape_file *file, json_t *columns, const json_t *object)
{
    const char *key;
    json_t *unused;
    json_object_foreach(columns, key, unused) put_field(file, json_object_get(object, key));
}

/* Adds the scalar members of an object to the columns. */
static void add_columns(json_t *columns, const json_t *object)
{
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)(uintptr_t)object, key, value) if (!json_is_object(value) &&
                                                                     !json_is_array(value) &&
                                                                     !json_object_get(columns, key))
        json_object_set_new(columns, key, json_true());
}

static void put_table(const lab *l, json_t *tags, json_t *columns, drape_file *file)
{
    const char *key;
    json_t *unused;
    drape_file_put_text(file, "case");
    json_object_foreach(tags, key, unused) drape_file_print(file, ",%s", key);
    json_object_foreach(columns, key, unused) drape_file_print(file, ",%s", key);
    for (size_t i = 0; i < l->count; i++) {
        if (!l->results[i])
            continue;
        drape_file_print(file, "\n%zu", i);
        put_fields(file, tags, json_object_get(l->results[i], "tags"));
        put_fields(file, columns, l->results[i]);
    }
    drape_file_put_text(file, "\n");
}

drape_status lab_write_csv(lab *l)
{
    drape_file file = {0};
    json_t *tags = json_object(), *columns = json_object();
    for (size_t i = 0; i < l->count; i++) {
        add_columns(tags, json_object_get(l->results[i], "tags"));
        add_columns(columns, l->results[i]);
    }
    json_object_del(columns, "case");
    drape_status status = tags && columns ? begin_file(l, "results.csv", &file)
                                          : drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for results.csv");
    if (!status) {
        put_table(l, tags, columns, &file);
        status = drape_file_finish(&file);
    }
    drape_file_destroy(&file);
    json_decref(tags);
    json_decref(columns);
    return status;
}

/* ---- Pictures ---- */

/* Runs a program and waits for it; 0 where it did its work. Its output goes nowhere. */
static int run_program(char *const *arguments)
{
    posix_spawn_file_actions_t actions;
    pid_t child;
    int code = -1;
    if (posix_spawn_file_actions_init(&actions))
        return -1;
    posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", 0, 0);
    posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", 1, 0);
    posix_spawn_file_actions_addopen(&actions, 2, "/dev/null", 1, 0);
    bool started = posix_spawnp(&child, arguments[0], &actions, NULL, arguments, environ) == 0;
    posix_spawn_file_actions_destroy(&actions);
    if (!started)
        return -1;
    while (waitpid(child, &code, 0) < 0)
        if (errno != EINTR)
            return -1;
    return WIFEXITED(code) ? WEXITSTATUS(code) : -1;
}

drape_status lab_plot(lab *l, const char *name, const char *script, size_t size, bool *drawn)
{
    char file[256], path[4096];
    snprintf(file, sizeof file, "%s.gp", name);
    snprintf(path, sizeof path, "%s/%s", l->folder, file);
    char *const arguments[] = {(char[]){"gnuplot"}, path, NULL};
    drape_status status = lab_write_text(l, file, script, size);
    if (status)
        return status;
    *drawn = run_program(arguments) == 0;
    if (!*drawn)
        fprintf(l->words, "gnuplot is not there or failed on %s: this report is without pictures\n", path);
    return DRAPE_OK;
}

/* ---- The page ---- */

static void put_escaped(FILE *out, const char *text)
{
    for (; *text; text++)
        switch (*text) {
        case '<':
            fputs("&lt;", out);
            break;
        case '>':
            fputs("&gt;", out);
            break;
        case '&':
            fputs("&amp;", out);
            break;
        case '"':
            fputs("&quot;", out);
            break;
        default:
            fputc(*text, out);
        }
}

void lab_page_heading(lab *l, const char *text)
{
    fputs("<h2>", l->page);
    put_escaped(l->page, text);
    fputs("</h2>\n", l->page);
}

void lab_page_text(lab *l, const char *text)
{
    put_escaped(l->page, text);
}

static void put_base64(FILE *out, const unsigned char *data, size_t size)
{
    static const char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < size; i += 3) {
        unsigned long bits = (unsigned long)data[i] << 16;
        bits |= i + 1 < size ? (unsigned long)data[i + 1] << 8 : 0;
        bits |= i + 2 < size ? data[i + 2] : 0;
        fputc(letters[bits >> 18 & 63], out);
        fputc(letters[bits >> 12 & 63], out);
        fputc(i + 1 < size ? letters[bits >> 6 & 63] : '=', out);
        fputc(i + 2 < size ? letters[bits & 63] : '=', out);
    }
}

drape_status lab_page_picture(lab *l, const char *name, const char *caption)
{
    char *data;
    size_t size;
    drape_status status = lab_read_text(l->ctx, l->folder, name, &data, &size);
    if (!status) {
        fputs("<figure><img alt=\"", l->page);
        put_escaped(l->page, caption);
        fputs("\" src=\"data:image/svg+xml;base64,", l->page);
        put_base64(l->page, (unsigned char *)data, size);
        fputs("\"><figcaption>", l->page);
        put_escaped(l->page, caption);
        fputs("</figcaption></figure>\n", l->page);
    }
    free(data);
    return status;
}

static const char style[] =
    "body{font:16px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#1b1e23;"
    "background:#fff}h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem}"
    "figure{margin:1rem 0}figure img{max-width:100%;height:auto}figcaption{font-size:.85rem;color:#555}"
    ".words p{margin:.3rem 0}table{border-collapse:collapse;font-size:.8rem;display:block;overflow-x:auto}"
    "td,th{padding:.15rem .6rem;text-align:right;border-bottom:1px solid #e3e5e8;white-space:nowrap}"
    "td:first-child,th:first-child{text-align:left}code,pre{font-size:.8rem}"
    "pre{background:#f5f6f7;padding:.7rem;overflow-x:auto}";

/* Each line of the words is a paragraph. */
static void put_words(FILE *out, const char *words)
{
    fputs("<div class=\"words\">", out);
    while (*words) {
        size_t length = strcspn(words, "\n");
        char *line = strndup(words, length);
        fputs("<p>", out);
        put_escaped(out, line ? line : "");
        fputs("</p>\n", out);
        free(line);
        words += length + (words[length] == '\n');
    }
    fputs("</div>\n", out);
}

/* What was run, for whoever wants to run it again. */
static void put_origin(FILE *out, const lab *l)
{
    json_t *about = json_copy(l->about);
    json_object_del(about, "cases");
    char *text = json_dumps(about, JSON_INDENT(2));
    fputs("<h2>What was run</h2>\n<pre>", out);
    put_escaped(out, text ? text : "");
    fputs("</pre>\n", out);
    free(text);
    json_decref(about);
}

drape_status lab_write_page(lab *l, const char *title)
{
    char *text = NULL;
    size_t size = 0;
    fflush(l->words);
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
    fputs("</h1>\n", out);
    put_words(out, l->words_text);
    fwrite(l->page_text, 1, l->page_size, out);
    put_origin(out, l);
    fputs("</body></html>\n", out);
    if (fclose(out)) {
        free(text);
        return drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for report.html");
    }
    drape_status status = lab_write_text(l, "report.html", text, size);
    free(text);
    return status;
}
