/* scene.c: the scene object: a text, its JSON tree, and the values set in the tree since. */
#include "model/scene.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "base/json_read.h"
#include "model/scene_json.h"
#include "model/scene_text.h"

/* jansson counts in int, and its tree takes about ten times the size of the text. */
#define MAX_FILE   ((size_t)1 << 30)
#define FIRST_READ ((size_t)1 << 16)
#define MAX_NAME   300 /* length of a file name in messages */
#define MAX_NUMBER 80  /* length of a number that is set */
#define MAX_SHOWN  40  /* length of a value that is set, in messages */
#define LOAD_FLAGS                                                                                           \
    (JSON_REJECT_DUPLICATES | JSON_DECODE_INT_AS_REAL) /* integers beyond int64 are numbers, too */

/* A value set by drape_scene_set. */
typedef struct override {
    struct override *before;
    char *pointer; /* pointer to the value, with an index in place of an appending "-" */
    char *shown;   /* "set /integrator/dt=-1" */
} override;

struct drape_scene {
    drape_context *ctx;
    char *text;       /* the text as it was read */
    char *name;       /* name of the text in messages, one line */
    char *folder;     /* folder of mesh files; NULL: the working directory */
    json_t *root;     /* an object */
    json_t *ours;     /* root converted to our format, if it has another one: the source of the last defs */
    override *last;   /* the most recent override */
    drape_arena kept; /* holds name, folder and overrides */
    drape_arena defs; /* holds the arrays of the last drape_scene_to_def */
};

/* ---- Creation and destruction ---- */

void drape_scene_destroy(drape_scene **scene)
{
    if (!scene || !*scene)
        return;
    drape_scene *s = *scene;
    json_decref(s->root);
    json_decref(s->ours);
    drape_arena_free(&s->defs);
    drape_arena_free(&s->kept);
    drape_free(s->ctx, s->text);
    drape_free(s->ctx, s);
    *scene = NULL;
}

drape_context *drape_scene_context(drape_scene *scene)
{
    return scene->ctx;
}

static drape_status new_scene(drape_context *ctx, const char *name, drape_scene **out)
{
    drape_scene *scene = drape_alloc(ctx, 1, sizeof *scene);
    if (!scene)
        return DRAPE_E_MEMORY;
    scene->ctx = ctx;
    scene->kept = scene->defs = drape_arena_of(ctx);
    /* Messages are one line, and a place must leave room for the fault itself: of a long path only the
     * end is kept. */
    size_t length = strlen(name);
    char text[MAX_NAME + 4];
    const char *end = length > MAX_NAME ? name + length - MAX_NAME : name;
    while (end > name && ((unsigned char)*end & 0xC0) == 0x80)
        end++;
    snprintf(text, sizeof text, "%s%s", end > name ? "..." : "", end);
    drape_make_printable(text);
    scene->name = drape_arena_text(&scene->kept, text);
    if (!scene->name)
        drape_scene_destroy(&scene);
    *out = scene;
    return scene ? DRAPE_OK : DRAPE_E_MEMORY;
}

void drape_scene_print(drape_scene *scene, drape_text_sink *sink, void *user)
{
    locale_t old = drape_locale_enter();
    drape_json_print(scene->ours ? scene->ours : scene->root, sink, user);
    drape_locale_leave(old);
}

/* ---- Reading a file ---- */

static drape_status cannot_read(drape_scene *scene, const char *why)
{
    return drape_fail(scene->ctx, drape_memory_ran_out() ? DRAPE_E_MEMORY : DRAPE_E_FILE,
                      "%s: cannot read the scene: %s", scene->name, why);
}

/* Reads to the end of the file: the size of a pipe is known only then, and a file may grow while it is
 * read. A device may have no end: after a byte 0, which no scene has, reading ends, too. */
static drape_status read_all(drape_scene *scene, FILE *file, size_t capacity, size_t *size)
{
    *size = 0;
    scene->text = drape_alloc(scene->ctx, capacity + 1, 1);
    drape_status status = scene->text ? DRAPE_OK : DRAPE_E_MEMORY;
    for (bool zero = false; !status && !zero && !feof(file);) {
        if (*size == capacity) {
            char *larger = drape_alloc(scene->ctx, 2 * capacity + 1, 1);
            if (!larger)
                return DRAPE_E_MEMORY;
            memcpy(larger, scene->text, *size);
            drape_free(scene->ctx, scene->text);
            scene->text = larger;
            capacity *= 2;
        }
        errno = 0;
        const size_t count = fread(scene->text + *size, 1, capacity - *size, file);
        zero = memchr(scene->text + *size, 0, count) != NULL;
        *size += count;
        if (ferror(file))
            status = cannot_read(scene, strerror(errno));
        else if (*size > MAX_FILE)
            status = cannot_read(scene, "it is larger than 1 GiB");
        else
            status = drape_check_cancel(scene->ctx);
    }
    if (!status)
        scene->text[*size] = 0;
    return status;
}

static drape_status read_file(drape_scene *scene, const char *path, size_t *size)
{
    struct stat info;
    FILE *file = fopen(path, "rb");
    if (!file)
        return cannot_read(scene, strerror(errno));
    drape_status status = DRAPE_OK;
    size_t capacity = FIRST_READ;
    if (fstat(fileno(file), &info) == 0) {
        if (S_ISDIR(info.st_mode))
            status = cannot_read(scene, "it is a folder");
        else if (S_ISREG(info.st_mode) && info.st_size > (off_t)MAX_FILE)
            status = cannot_read(scene, "it is larger than 1 GiB");
        else if (S_ISREG(info.st_mode))
            capacity = (size_t)info.st_size + 1; /* one more, so that the end is detected without growing */
    }
    if (!status)
        status = read_all(scene, file, capacity, size);
    fclose(file);
    return status;
}

/* ---- Parsing ---- */

static drape_status parse_fault(drape_scene *scene, size_t offset, const char *what)
{
    size_t line, column;
    drape_text_place(scene->text, offset, &line, &column);
    return drape_fail(scene->ctx, DRAPE_E_PARSE, "%s:%zu:%zu: %s", scene->name, line, column, what);
}

/* Reports jansson's message at the token that it is about. */
static drape_status syntax_fault(drape_scene *scene, json_error_t *error)
{
    size_t consumed = (size_t)error->position;
    bool at_end = strstr(error->text, "near end of file") != NULL;
    switch (json_error_code(error)) {
    case json_error_invalid_utf8:
        return parse_fault(scene, consumed,
                           DRAPE_FORMAT("byte 0x%02x is not UTF-8", (unsigned char)scene->text[consumed]));
    case json_error_null_character:
        return parse_fault(scene, drape_text_token(scene->text, consumed, false), "\\u0000 is not allowed");
    case json_error_stack_overflow:
        return parse_fault(scene, drape_text_token(scene->text, consumed, false), "nested too deeply");
    case json_error_out_of_memory:
        return drape_fail_memory(scene->ctx, consumed);
    default:
        break;
    }
    const char *text = error->text;
    if (strncmp(text, "'[' or ", 7) == 0) /* tokens that jansson accepts at the top level and a scene does
                                             not */
        text += 7;
    drape_text_mend_end(error->text);
    return parse_fault(scene, drape_text_token(scene->text, consumed, at_end), text);
}

static drape_status parse_text(drape_scene *scene, size_t size)
{
    const char *zero = memchr(scene->text, 0, size);
    if (zero)
        return parse_fault(scene, (size_t)(zero - scene->text), "byte 0x00 is not allowed in a scene");
    if (size > MAX_FILE)
        return drape_fail(scene->ctx, DRAPE_E_PARSE, "%s: the scene is larger than 1 GiB", scene->name);
    char *blanked = drape_copy_text(scene->ctx, scene->text);
    if (!blanked)
        return DRAPE_E_MEMORY;
    json_error_t error;
    size_t offset = 0;
    drape_status status = DRAPE_OK;
    if (!drape_text_blank_comments(blanked, &offset))
        status = parse_fault(scene, offset, "this comment is not closed");
    else if (blanked[strspn(blanked, " \t\r\n")] == 0)
        status = drape_fail(scene->ctx, DRAPE_E_PARSE, "%s: the scene is empty", scene->name);
    else if (!(scene->root = drape_json_read(blanked, size, LOAD_FLAGS, &error)))
        status = syntax_fault(scene, &error);
    else if (!json_is_object(scene->root)) {
        drape_text_find(scene->text, "", &offset);
        status = parse_fault(scene, offset, "a scene is an object, {...}");
    }
    drape_free(scene->ctx, blanked);
    return status;
}

/* Passes the scene to the caller, or frees it after a failure. */
static drape_status finish(drape_scene *scene, drape_status status, drape_scene **out)
{
    if (status)
        drape_scene_destroy(&scene);
    *out = scene;
    return status;
}

drape_status drape_scene_load(drape_context *ctx, const char *path, drape_scene **out)
{
    drape_scene *scene = NULL;
    size_t size = 0;
    if (out)
        *out = NULL;
    if (!ctx)
        return DRAPE_E_ARGUMENT;
    if (!path || !out)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "drape_scene_load: path and out are needed");
    locale_t old = drape_locale_enter();
    drape_status status = new_scene(ctx, path, &scene);
    const char *slash = strrchr(path, '/'); /* "a/b.json" -> "a", "/b.json" -> "/", "b.json" -> NULL */
    if (!status && slash) {
        scene->folder = drape_arena_text(&scene->kept, path);
        if (scene->folder)
            scene->folder[slash == path ? 1 : slash - path] = 0;
        status = drape_arena_status(&scene->kept);
    }
    if (!status)
        status = read_file(scene, path, &size);
    if (!status)
        status = parse_text(scene, size);
    drape_locale_leave(old);
    return finish(scene, status, out);
}

drape_status drape_scene_parse(drape_context *ctx, const char *text, const char *name, drape_scene **out)
{
    drape_scene *scene = NULL;
    if (out)
        *out = NULL;
    if (!ctx)
        return DRAPE_E_ARGUMENT;
    if (!text || !out)
        return drape_fail(ctx, DRAPE_E_ARGUMENT, "drape_scene_parse: text and out are needed");
    locale_t old = drape_locale_enter();
    drape_status status = new_scene(ctx, name ? name : "scene", &scene);
    if (!status) {
        scene->text = drape_copy_text(ctx, text);
        status = scene->text ? parse_text(scene, strlen(text)) : DRAPE_E_MEMORY;
    }
    drape_locale_leave(old);
    return finish(scene, status, out);
}

/* ---- Setting values ---- */

/* The place in the tree to which a pointer leads. */
typedef struct landing {
    json_t *container;            /* container of the last key, or of the first key that is missing */
    char key[DRAPE_POINTER_SIZE]; /* that key */
    const char *rest;             /* the remaining pointer after key */
    drape_pointer path;           /* the pointer up to the key, with an index in place of an appending "-" */
} landing;

static drape_status cannot_set(drape_scene *scene, const char *pointer, const char *at, const char *why)
{
    return drape_fail(scene->ctx, DRAPE_E_ARGUMENT, "cannot set %s: %s%s%s", pointer, *at ? at : "the scene",
                      *why ? " " : "", why);
}

/* Returns 1 if the text is UTF-8, 0 if it is not, -1 if memory is out: jansson returns NULL in both cases. */
static int is_utf8(const char *text)
{
    errno = 0;
    json_t *checked = json_string(text);
    json_decref(checked);
    return checked ? 1 : drape_memory_ran_out() ? -1 : 0;
}

static drape_status check_pointer(drape_scene *scene, const char *pointer)
{
    char key[DRAPE_POINTER_SIZE];
    const char *rest = pointer;
    int utf8 = is_utf8(pointer);
    if (utf8 < 0)
        return drape_fail_memory(scene->ctx, strlen(pointer));
    if (!utf8)
        return drape_fail(scene->ctx, DRAPE_E_ARGUMENT, "a JSON pointer is UTF-8, this one is not");
    if (strlen(pointer) >= DRAPE_POINTER_SIZE)
        return drape_fail(scene->ctx, DRAPE_E_ARGUMENT, "a JSON pointer of %zu bytes is too long; at most %d",
                          strlen(pointer), DRAPE_POINTER_SIZE - 1);
    while (*rest) {
        rest = drape_pointer_next(rest, key);
        if (!rest)
            return drape_fail(scene->ctx, DRAPE_E_ARGUMENT,
                              "\"%s\" is not a JSON pointer, as \"/integrator/dt\" is one%s", pointer,
                              *pointer == '/' ? "; in it ~ is written ~0" : "");
    }
    return DRAPE_OK;
}

/* Parses a number in forms that people write and JSON does not allow: ".5", "-.5", "+5", "5." and these with
 * an exponent, and fractions of numbers, "1/240". Returns NULL if the text is not a number. */
static json_t *loose_number(const char *text, json_error_t *error)
{
    char number[MAX_NUMBER + 3];
    double quotient;
    const char *rest = strchr(text, '/') ? drape_number_read(text, &quotient) : NULL;
    if (rest && *rest == 0)
        return json_real(quotient);
    const size_t digits = strspn(text, "+-"), length = strlen(text);
    if (length > MAX_NUMBER || digits > 1 || strspn(text + digits, "0123456789.eE+-") + digits != length)
        return NULL;
    const char *point = strchr(text, '.');
    size_t n = 0;
    for (const char *c = text + (*text == '+'); *c; c++) {
        if (c == point && c == text + digits)
            number[n++] = '0';
        number[n++] = *c;
        if (c == point && !isdigit((unsigned char)c[1])) {
            if (c == text + digits)
                return NULL;
            number[n++] = '0';
        }
    }
    number[n] = 0;
    return drape_json_read(number, n, LOAD_FLAGS | JSON_DECODE_ANY, error);
}

/* Parses a text as a JSON value, or takes it as a string. */
static drape_status parse_value(drape_scene *scene, const char *text, json_t **value)
{
    json_error_t error;
    *value = drape_json_read(text, strlen(text), LOAD_FLAGS | JSON_DECODE_ANY, &error);
    if (*value)
        return DRAPE_OK;
    int utf8 = is_utf8(text);
    if (utf8 == 0)
        return drape_fail(scene->ctx, DRAPE_E_ARGUMENT, "a value is UTF-8, this one is not");
    if (json_error_code(&error) != json_error_out_of_memory)
        *value = loose_number(text, &error);
    if (!*value && json_error_code(&error) != json_error_out_of_memory)
        *value = json_string(text);
    return *value ? DRAPE_OK : drape_fail_memory(scene->ctx, strlen(text));
}

/* What the last key of a pointer names in its container; *child stays NULL for a new member, and for "-". */
static drape_status find_child(drape_scene *scene, const char *pointer, const landing *at, json_t **child)
{
    const bool array = json_is_array(at->container);
    size_t index;
    *child = NULL;
    if (json_is_object(at->container))
        *child = json_object_get(at->container, at->key);
    if (json_is_object(at->container) || (array && strcmp(at->key, "-") == 0))
        return DRAPE_OK;
    if (array && !drape_pointer_index(at->key, &index))
        return cannot_set(scene, pointer, at->path.text,
                          "is an array: its elements have numbers, \"-\" appends");
    *child = json_array_get(at->container, array ? index : 0);
    if (*child)
        return DRAPE_OK;
    return cannot_set(
        scene, pointer, at->path.text,
        array ? DRAPE_FORMAT("is an array of %zu; \"-\" appends", json_array_size(at->container))
              : DRAPE_FORMAT("is %s, not an object or array", DRAPE_JSON_DESCRIBE(at->container)));
}

/* Follows a non-empty pointer as far as it exists in the tree; changes nothing. */
static drape_status land(drape_scene *scene, const char *pointer, landing *at)
{
    json_t *child = scene->root;
    at->rest = pointer;
    do {
        at->container = child;
        at->rest = drape_pointer_next(at->rest, at->key);
        DRAPE_TRY(find_child(scene, pointer, at, &child));
        if (json_is_array(at->container) && strcmp(at->key, "-") == 0)
            drape_pointer_push_index(&at->path, json_array_size(at->container));
        else
            drape_pointer_push(&at->path, at->key);
    } while (child && *at->rest);
    return DRAPE_OK;
}

/* Puts a value, whose reference it takes over, into a container. Returns -1 if memory is out. */
static int put(json_t *container, const char *key, json_t *value)
{
    size_t index;
    if (json_is_object(container))
        return json_object_set_new(container, key, value);
    return drape_pointer_index(key, &index) ? json_array_set_new(container, index, value)
                                            : json_array_append_new(container, value);
}

/* Wraps a value, whose reference it takes over, in the containers that the keys of `rest` name, from the
 * inside out: "-" makes an array with one element, other keys make objects with one member. Returns NULL if
 * memory is out. */
static json_t *wrap(const char *rest, json_t *value)
{
    char left[DRAPE_POINTER_SIZE], key[DRAPE_POINTER_SIZE];
    snprintf(left, sizeof left, "%s", rest);
    for (char *slash; value && (slash = strrchr(left, '/')); *slash = 0) {
        drape_pointer_next(slash, key);
        json_t *container = strcmp(key, "-") == 0 ? json_array() : json_object();
        if (!container)
            json_decref(value);
        else if (put(container, key, value)) {
            json_decref(container);
            container = NULL;
        }
        value = container;
    }
    return value;
}

/* Records a value that is about to be set; text NULL: removed. */
static drape_status new_override(drape_scene *scene, const char *path, const char *pointer, const char *text,
                                 override **out)
{
    char some[MAX_SHOWN + 1], shown[MAX_SHOWN + DRAPE_POINTER_SIZE + 16];
    snprintf(some, sizeof some, "%s", text ? text : "");
    drape_text_mend_end(some);
    if (text)
        snprintf(shown, sizeof shown, "set %s=%s%s", pointer, some, strlen(some) < strlen(text) ? "..." : "");
    else
        snprintf(shown, sizeof shown, "removed %s", pointer);
    drape_make_printable(shown);
    override *o = drape_arena_take(&scene->kept, 1, sizeof *o);
    if (!o || !(o->pointer = drape_arena_text(&scene->kept, path)) ||
        !(o->shown = drape_arena_text(&scene->kept, shown)))
        return DRAPE_E_MEMORY;
    o->before = scene->last;
    *out = o;
    return DRAPE_OK;
}

/* Everything that can fail, except for memory, comes before the first change. */
static drape_status set_value(drape_scene *scene, const char *pointer, const char *text)
{
    landing at = {.container = NULL};
    override *o = NULL;
    json_t *value = NULL;
    DRAPE_TRY(check_pointer(scene, pointer));
    if (*pointer)
        DRAPE_TRY(land(scene, pointer, &at));
    for (const char *rest = at.rest; rest && *rest;) { /* keys that do not exist yet are part of the place */
        char key[DRAPE_POINTER_SIZE];
        rest = drape_pointer_next(rest, key);
        drape_pointer_push(&at.path, strcmp(key, "-") == 0 ? "0" : key);
    }
    DRAPE_TRY(new_override(scene, at.path.text, pointer, text, &o));
    DRAPE_TRY(parse_value(scene, text, &value));
    if (*pointer) {
        value = wrap(at.rest, value);
        if (!value || put(at.container, at.key, value))
            return drape_fail_memory(scene->ctx, 1);
    } else if (json_is_object(value)) {
        json_decref(scene->root);
        scene->root = value;
    } else {
        json_decref(value);
        return drape_fail(scene->ctx, DRAPE_E_ARGUMENT, "the whole scene can only be set to an object");
    }
    scene->last = o;
    return DRAPE_OK;
}

/* The elements of an array behind a removed one are no longer where the text has them: the whole array counts
 * as changed. */
static drape_status remove_value(drape_scene *scene, const char *pointer)
{
    landing at = {.container = NULL};
    json_t *value = NULL;
    override *o = NULL;
    size_t index;
    DRAPE_TRY(check_pointer(scene, pointer));
    if (!*pointer)
        return drape_fail(scene->ctx, DRAPE_E_ARGUMENT, "the whole scene cannot be removed");
    DRAPE_TRY(land(scene, pointer, &at));
    DRAPE_TRY(find_child(scene, pointer, &at, &value));
    if (!value || *at.rest)
        return drape_fail(scene->ctx, DRAPE_E_ARGUMENT, "cannot remove %s: there is none", pointer);
    if (json_is_array(at.container))
        *strrchr(at.path.text, '/') = 0;
    DRAPE_TRY(new_override(scene, at.path.text, pointer, NULL, &o));
    if (json_is_array(at.container) && drape_pointer_index(at.key, &index))
        json_array_remove(at.container, index);
    else
        json_object_del(at.container, at.key);
    scene->last = o;
    return DRAPE_OK;
}

bool drape_scene_gives(const drape_scene *scene, const char *pointer)
{
    const json_t *at = scene->ours ? scene->ours : scene->root;
    char key[DRAPE_POINTER_SIZE];
    while (at && pointer && *pointer) {
        size_t index;
        pointer = drape_pointer_next(pointer, key);
        at = json_is_array(at) ? (drape_pointer_index(key, &index) ? json_array_get(at, index) : NULL)
                               : json_object_get(at, key);
    }
    return at && pointer;
}

drape_status drape_scene_set(drape_scene *scene, const char *pointer, const char *value)
{
    if (!scene)
        return DRAPE_E_ARGUMENT;
    if (!pointer)
        return drape_fail(scene->ctx, DRAPE_E_ARGUMENT, "drape_scene_set: a pointer is needed");
    locale_t old = drape_locale_enter();
    drape_arena_free(&scene->defs); /* earlier defs point to values that may be freed */
    drape_status status = value ? set_value(scene, pointer, value) : remove_value(scene, pointer);
    drape_locale_leave(old);
    return status;
}

/* ---- Defs and faults ---- */

drape_status drape_scene_to_def(drape_scene *scene, drape_scene_def *def)
{
    locale_t old = drape_locale_enter();
    drape_arena_free(&scene->defs);
    drape_status status = DRAPE_OK;
    json_decref(scene->ours);
    scene->ours = NULL;
    if (drape_scene_is_cs184(scene->root))
        status = drape_scene_from_cs184(scene->ctx, scene->root, &scene->ours);
    if (!status)
        status = drape_scene_read(scene->ctx, &scene->defs, scene->ours ? scene->ours : scene->root, def);
    def->folder = scene->folder;
    drape_locale_leave(old);
    if (status)
        drape_scene_locate_fault(scene);
    return status;
}

/* Whether a pointer names the same value as the other one, or an object or array around that value. */
static bool leads_to(const char *pointer, const char *other)
{
    size_t length = strlen(pointer);
    return strncmp(pointer, other, length) == 0 && (other[length] == 0 || other[length] == '/');
}

/* Returns the latest override inside the part of a pointer that the text does not contain. */
static const override *override_beside(const drape_scene *scene, const char *pointer)
{
    char missing[DRAPE_POINTER_SIZE];
    size_t offset;
    snprintf(missing, sizeof missing, "%s", pointer);
    for (char *slash; (slash = strrchr(missing, '/'));) {
        *slash = 0;
        if (drape_text_find(scene->text, missing, &offset)) {
            *slash = '/';
            break;
        }
    }
    const override *o = scene->last;
    while (o && !leads_to(missing, o->pointer))
        o = o->before;
    return o;
}

void drape_scene_locate_fault(drape_scene *scene)
{
    drape_context *ctx = scene->ctx;
    char place[DRAPE_MESSAGE_SIZE / 2];
    locale_t old = drape_locale_enter();
    /* The place of a value is that where it was set last, or else its place in the text. For a value that
     * is in neither, it is the override that set something beside it or, as the value is missing, its
     * nearest ancestor in the text. */
    const size_t size = sizeof place;
    size_t offset, line, column;
    const override *o = scene->last;
    while (o && !leads_to(o->pointer, ctx->pointer))
        o = o->before;
    bool found = drape_text_find(scene->text, ctx->pointer, &offset);
    if (!o && !found)
        o = override_beside(scene, ctx->pointer);
    drape_text_place(scene->text, offset, &line, &column);
    if (!*ctx->pointer)
        snprintf(place, size, "%s", scene->name);
    else if (o)
        snprintf(place, size, "%s: %s", scene->name, o->shown);
    else
        snprintf(place, size, "%s:%zu:%zu", scene->name, line, column);
    int used = snprintf(ctx->message, sizeof ctx->message, "%s: %s%s", place, ctx->pointer,
                        *ctx->pointer ? ": " : "");
    snprintf(ctx->message + used, sizeof ctx->message - (size_t)used, "%s", ctx->text);
    drape_text_mend_end(ctx->message);
    drape_locale_leave(old);
}
