/* folder.c: see folder.h. renameat2, statx and flock are Linux's. */
#define _GNU_SOURCE
#include "io/folder.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include "base/arena.h"
#include "base/json_read.h"
#include "io/file.h"

#define PART_PREFIX  ".drape-%016" PRIx64 "-"
#define PREFIX_SIZE  (sizeof ".drape--" - 1 + 16)
#define HEAD_START   "{\"manifest\":1,"
#define HEAD_TOKEN   "\"token\":\"%016" PRIx64 "\"}"
#define HEAD_SIZE    200
#define VALUES_SIZE  80                           /* for the values of an entry */
#define LINE_SIZE    (20 + 6 * 255 + VALUES_SIZE) /* a name of 255 bytes, each escaped, and its values */
#define MAX_MANIFEST ((off_t)1 << 30)
#define ADVICE       "name another folder, or move the file away"

/* What a line of the manifest says. */
typedef struct entry {
    const char *name;
    size_t line; /* of the manifest */
    bool growing;
    uint64_t size, sum;   /* of a complete file */
    uint64_t inode, born; /* of a growing one */
} entry;

typedef struct input {
    dev_t device;
    ino_t inode;
} input;

struct drape_folder {
    drape_context *ctx;
    drape_arena arena, lines; /* lines: what was read of the manifest */
    char *path;
    int fd, manifest; /* -1: not open */
    bool shared, rehearses;
    bool torn; /* the last line of the manifest has no end */
    uint64_t token;
    int64_t parts;      /* temporary names so far */
    entry *entries;     /* (entry_count), by name; as they were when the manifest was read */
    size_t entry_count; /* a name may have several: what it is, and what it was about to become */
    uint64_t *tokens;   /* (token_count) of all processes that wrote here */
    size_t token_count;
    input *inputs;
    size_t input_count;
};

static drape_status fail(const drape_folder *f, const char *deed, const char *name, int error)
{
    char path[512];
    snprintf(path, sizeof path, "%.300s/%.200s", f->path, name);
    return drape_file_fail(f->ctx, deed, path, error);
}

static drape_status refuse(const drape_folder *f, const char *name, const char *why)
{
    return drape_fail(f->ctx, DRAPE_E_ARGUMENT, "\"%.300s/%.200s\" would be replaced, but %s; " ADVICE,
                      f->path, name, why);
}

/* ---- Opening ---- */

/* A folder without flock, as some network file systems are, is used without a lock. */
static drape_status lock(drape_folder *f)
{
    int code;
    do
        code = flock(f->fd, (f->shared ? LOCK_SH : LOCK_EX) | LOCK_NB);
    while (code && errno == EINTR);
    if (code && errno == EWOULDBLOCK)
        return drape_fail(
            f->ctx, DRAPE_E_ARGUMENT,
            "another process is writing into the folder \"%.500s\"; name another, or wait for it", f->path);
    if (code)
        drape_log(f->ctx, DRAPE_LOG_WARNING, "the folder \"%.500s\" cannot be locked", f->path);
    return DRAPE_OK;
}

int drape_folder_open_file(const drape_folder *f, const char *name, int flags)
{
    return drape_open_regular(f->fd, name, flags | O_NOFOLLOW);
}

int drape_folder_enter(char *path)
{
    char *slash = strrchr(path, '/');
    const bool root = slash == path;
    if (slash && !root)
        *slash = 0;
    int fd = open(!slash ? "." : root ? "/" : path, O_PATH | O_DIRECTORY | O_CLOEXEC);
    if (slash && !root)
        *slash = '/';
    return fd;
}

bool drape_folder_has(const char *folder, const char *path)
{
    struct stat a, b;
    char parent[4096];
    const char *slash = strrchr(path, '/');
    int length =
        snprintf(parent, sizeof parent, "%.*s%s", slash ? (int)(slash - path) : 0, path, slash ? "/" : ".");
    return length < (int)sizeof parent && stat(folder, &a) == 0 && stat(parent, &b) == 0 &&
           a.st_dev == b.st_dev && a.st_ino == b.st_ino;
}

/* ---- The manifest ---- */

static uint64_t hexadecimal(const json_t *line, const char *key)
{
    const char *text = json_string_value(json_object_get(line, key));
    return text ? strtoull(text, NULL, 16) : 0;
}

bool drape_folder_is_name(const char *name)
{
    return name && *name && !strchr(name, '/') && strcmp(name, ".") != 0 && strcmp(name, "..") != 0;
}

/* A line that cannot be read is left out: what it described is then not ours. */
static drape_status take_line(drape_folder *f, const char *text, size_t length)
{
    json_error_t error;
    json_t *line = drape_json_read(text, length, 0, &error);
    if (!line && json_error_code(&error) == json_error_out_of_memory)
        return drape_fail_memory(f->ctx, length);
    const char *name = json_string_value(json_object_get(line, "file"));
    if (json_object_get(line, "token"))
        f->tokens[f->token_count++] = hexadecimal(line, "token");
    if (drape_folder_is_name(name)) {
        entry *e = &f->entries[f->entry_count];
        *e = (entry){.name = drape_arena_text(&f->lines, name),
                     .line = f->entry_count,
                     .growing = json_object_get(line, "inode") != NULL,
                     .size = (uint64_t)json_integer_value(json_object_get(line, "size")),
                     .sum = hexadecimal(line, "checksum"),
                     .inode = hexadecimal(line, "inode"),
                     .born = hexadecimal(line, "born")};
        f->entry_count += e->name != NULL;
    }
    json_decref(line);
    return DRAPE_OK;
}

static int by_name(const void *a, const void *b)
{
    return strcmp(((const entry *)a)->name, ((const entry *)b)->name);
}

static drape_status take_lines(drape_folder *f, const char *text, size_t size)
{
    size_t lines = 0;
    for (size_t i = 0; i < size; i++)
        lines += text[i] == '\n';
    drape_arena_free(&f->lines);
    f->entry_count = f->token_count = 0;
    f->entries = drape_arena_take(&f->lines, lines, sizeof *f->entries);
    f->tokens = drape_arena_take(&f->lines, lines, sizeof *f->tokens);
    if (drape_arena_status(&f->lines))
        return DRAPE_E_MEMORY;
    drape_status status = DRAPE_OK;
    for (const char *at = text, *end; !status && (end = memchr(at, '\n', size - (size_t)(at - text)));
         at = end + 1)
        status = take_line(f, at, (size_t)(end - at));
    if (status)
        return status;
    f->torn = size > 0 && text[size - 1] != '\n';
    qsort(f->entries, f->entry_count, sizeof *f->entries, by_name);
    if (f->token_count == 0 && !f->shared)
        return drape_fail(f->ctx, DRAPE_E_ARGUMENT,
                          "\"%.500s/" DRAPE_MANIFEST_NAME "\" is not a manifest of Drape; " ADVICE, f->path);
    return drape_arena_status(&f->lines);
}

static drape_status read_manifest(drape_folder *f)
{
    char path[512], *text;
    size_t size;
    int fd = drape_folder_open_file(f, DRAPE_MANIFEST_NAME, O_RDONLY);
    snprintf(path, sizeof path, "%.480s/" DRAPE_MANIFEST_NAME, f->path);
    if (fd < 0 && errno == ENOENT)
        return DRAPE_OK;
    if (fd < 0)
        return errno == EINVAL ? refuse(f, DRAPE_MANIFEST_NAME, "it is not a regular file")
                               : fail(f, "read", DRAPE_MANIFEST_NAME, errno);
    drape_status status = drape_file_take(f->ctx, fd, path, MAX_MANIFEST, &text, &size);
    if (!status)
        status = take_lines(f, text, size);
    drape_free(f->ctx, text);
    return status;
}

static drape_status set_up(drape_folder *f, const char *path)
{
    f->arena = f->lines = drape_arena_of(f->ctx);
    f->path = drape_arena_text(&f->arena, path);
    if (!f->path)
        return DRAPE_E_MEMORY;
    for (size_t n = strlen(f->path); n > 1 && f->path[n - 1] == '/'; n--)
        f->path[n - 1] = 0;
    drape_status status = drape_folder_make(f->ctx, f->path);
    if (status)
        return status;
    f->fd = open(f->path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (f->fd < 0)
        return drape_file_fail(f->ctx, "open the folder", f->path, errno);
    if (getrandom(&f->token, sizeof f->token, 0) != (ssize_t)sizeof f->token)
        return drape_file_fail(f->ctx, "take a random number for", f->path, errno);
    status = lock(f);
    return status ? status : read_manifest(f);
}

drape_status drape_folder_open(drape_context *ctx, const char *path, bool shared, drape_folder **out)
{
    drape_folder *f = *out = drape_alloc(ctx, 1, sizeof *f);
    if (!f)
        return DRAPE_E_MEMORY;
    *f = (drape_folder){.ctx = ctx, .fd = -1, .manifest = -1, .shared = shared};
    drape_status status = set_up(f, path);
    if (status)
        drape_folder_close(out);
    return status;
}

void drape_folder_close(drape_folder **folder)
{
    drape_folder *f = *folder;
    if (!f)
        return;
    if (f->manifest >= 0)
        close(f->manifest);
    if (f->fd >= 0)
        close(f->fd);
    drape_arena_free(&f->lines);
    drape_arena_free(&f->arena);
    drape_free(f->ctx, f);
    *folder = NULL;
}

const char *drape_folder_path(const drape_folder *folder)
{
    return folder->path;
}

int drape_folder_descriptor(const drape_folder *folder)
{
    return folder->fd;
}

/* ---- What is ours ---- */

static bool checksum_of(int fd, uint64_t *size, uint64_t *sum)
{
    unsigned char bytes[16384];
    drape_checksum c = {0};
    ssize_t count;
    while ((count = read(fd, bytes, sizeof bytes)) != 0 && (count > 0 || errno == EINTR))
        if (count > 0)
            drape_checksum_add(&c, bytes, (size_t)count);
    *size = c.size;
    *sum = c.sum;
    return count == 0;
}

/* Inode and time of birth; a file system that does not keep the latter gives 0. */
static bool identity_of(int fd, uint64_t *inode, uint64_t *born)
{
    struct statx info;
    if (statx(fd, "", AT_EMPTY_PATH, STATX_INO | STATX_BTIME, &info))
        return false;
    *inode = info.stx_ino;
    *born = info.stx_mask & STATX_BTIME
                ? (uint64_t)info.stx_btime.tv_sec * 1000000000u + info.stx_btime.tv_nsec
                : 0;
    return true;
}

/* Whether the open file is one that the entries of its name describe. A file does not grow any more once it
 * is complete. */
static bool is_described(const drape_folder *f, const entry *first, int fd)
{
    uint64_t size = 0, sum = 0, inode = 0, born = 0;
    struct stat info;
    bool summed = false;
    size_t complete = 0;
    if (fstat(fd, &info) || !identity_of(fd, &inode, &born))
        return false;
    for (const entry *e = first; e < f->entries + f->entry_count && strcmp(e->name, first->name) == 0; e++)
        complete = !e->growing && e->line > complete ? e->line : complete;
    for (const entry *e = first; e < f->entries + f->entry_count && strcmp(e->name, first->name) == 0; e++) {
        if (e->growing && e->line >= complete && e->inode == inode && e->born == born)
            return true;
        if (e->growing || e->size != (uint64_t)info.st_size)
            continue;
        if (!summed && !checksum_of(fd, &size, &sum))
            return false;
        summed = true;
        if (e->size == size && e->sum == sum)
            return true;
    }
    return false;
}

static const entry *find(const drape_folder *f, const char *name)
{
    size_t low = 0, high = f->entry_count;
    while (low < high) {
        size_t middle = (low + high) / 2;
        if (strcmp(f->entries[middle].name, name) < 0)
            low = middle + 1;
        else
            high = middle;
    }
    return low < f->entry_count && strcmp(f->entries[low].name, name) == 0 ? &f->entries[low] : NULL;
}

/* NULL: the file is ours, or does not exist. Otherwise why it is not. *info: of the file. */
static const char *why_not_described(const drape_folder *f, const char *name, struct stat *info)
{
    const entry *e = find(f, name);
    const int fd = drape_folder_open_file(f, name, O_RDONLY);
    if (fd < 0)
        return errno == ENOENT ? NULL : errno == EINVAL ? "it is not a regular file" : "it cannot be read";
    const bool ours = e && fstat(fd, info) == 0 && is_described(f, e, fd);
    close(fd);
    return ours ? NULL : e ? "it has changed since Drape wrote it" : "Drape did not write it";
}

/* The same after all that this process, and others that share the folder, have written meanwhile. */
static const char *why_not_ours(drape_folder *f, const char *name, struct stat *info)
{
    const char *why = why_not_described(f, name, info);
    if (!why || (f->manifest < 0 && !f->shared) || read_manifest(f))
        return why;
    return why_not_described(f, name, info);
}

drape_status drape_folder_protect(drape_folder *f, const char *path)
{
    struct stat info;
    if (stat(path, &info))
        return DRAPE_OK;
    input *grown = drape_arena_resize(&f->arena, f->inputs, f->input_count + 1, sizeof *grown);
    if (!grown)
        return DRAPE_E_MEMORY;
    f->inputs = grown;
    f->inputs[f->input_count++] = (input){info.st_dev, info.st_ino};
    return DRAPE_OK;
}

static bool is_input(const drape_folder *f, const struct stat *info)
{
    for (size_t i = 0; i < f->input_count; i++)
        if (f->inputs[i].device == info->st_dev && f->inputs[i].inode == info->st_ino)
            return true;
    return false;
}

/* ---- All files of the folder ---- */

typedef drape_status visit(drape_folder *f, const char *name, const void *user);

static drape_status visit_files(drape_folder *f, visit *each, const void *user)
{
    int fd = openat(f->fd, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    DIR *dir = fd < 0 ? NULL : fdopendir(fd);
    if (!dir)
        return drape_file_fail(f->ctx, "read the folder", f->path, errno);
    drape_status status = DRAPE_OK;
    struct dirent *file;
    while (errno = 0, !status && (file = readdir(dir)))
        if (drape_folder_is_name(file->d_name))
            status = each(f, file->d_name, user);
    if (!status && errno)
        status = drape_file_fail(f->ctx, "read the folder", f->path, errno);
    closedir(dir);
    return status;
}

typedef struct claims {
    drape_folder_claim *writes, *clears;
    const void *user;
} claims;

static drape_status check_one(drape_folder *f, const char *name, const void *user)
{
    const claims *c = user;
    const bool writes = c->writes(c->user, name), clears = c->clears && c->clears(c->user, name);
    struct stat info;
    if (!writes && !clears)
        return DRAPE_OK;
    if (fstatat(f->fd, name, &info, AT_SYMLINK_NOFOLLOW) == 0 && is_input(f, &info))
        return refuse(f, name, "it is an input");
    const char *why = writes ? why_not_ours(f, name, &info) : NULL;
    return why ? refuse(f, name, why) : DRAPE_OK;
}

drape_status drape_folder_check(drape_folder *f, drape_folder_claim *writes, drape_folder_claim *clears,
                                const void *user)
{
    const claims c = {writes, clears, user};
    return visit_files(f, check_one, &c);
}

static bool is_part(const drape_folder *f, const char *name)
{
    char prefix[DRAPE_PART_SIZE];
    for (size_t i = 0; i < f->token_count; i++) {
        snprintf(prefix, sizeof prefix, PART_PREFIX, f->tokens[i]);
        if (strncmp(name, prefix, PREFIX_SIZE) == 0)
            return true;
    }
    return false;
}

/* Whether it is a manifest that a run which was killed had not put into its place yet, so that its token
 * stands nowhere else: empty, or its head has the token of its name. */
static bool is_lost_manifest(const drape_folder *f, const char *name)
{
    uint64_t token;
    char part[DRAPE_PART_SIZE], head[HEAD_SIZE], end[64];
    if (sscanf(name, ".drape-%16" SCNx64, &token) != 1)
        return false;
    snprintf(part, sizeof part, PART_PREFIX "0" DRAPE_FILE_PART, token);
    const int fd = strcmp(name, part) == 0 ? drape_folder_open_file(f, name, O_RDONLY) : -1;
    if (fd < 0)
        return false;
    const ssize_t count = read(fd, head, sizeof head - 1);
    close(fd);
    head[count > 0 ? count : 0] = 0;
    snprintf(end, sizeof end, HEAD_TOKEN "\n", token);
    return count == 0 || (strncmp(head, HEAD_START, strlen(HEAD_START)) == 0 && strstr(head, end));
}

static drape_status remove_one(drape_folder *f, const char *name, const void *user)
{
    const claims *c = user;
    struct stat info;
    const bool part = c->writes == NULL && !f->shared && (is_part(f, name) || is_lost_manifest(f, name));
    if (!part && !(c->clears && c->clears(c->user, name)))
        return DRAPE_OK;
    if (!part && (why_not_ours(f, name, &info) || is_input(f, &info)))
        return DRAPE_OK;
    return unlinkat(f->fd, name, 0) && errno != ENOENT ? fail(f, "remove the old file", name, errno)
                                                       : DRAPE_OK;
}

drape_status drape_folder_remove(drape_folder *f, drape_folder_claim *claim, const void *user)
{
    const claims c = {claim, claim, user};
    return visit_files(f, f->rehearses ? check_one : remove_one, &c);
}

/* ---- Writing the manifest ---- */

static drape_status append(drape_folder *f, const char *text, size_t length, bool durable)
{
    ssize_t n;
    do
        n = write(f->manifest, text, length);
    while (n < 0 && errno == EINTR);
    int error = n == (ssize_t)length ? 0 : n < 0 ? errno : EFBIG;
    if (n > 0 &&
        error) { /* the disk is full: the line that does not fit is taken back, if no other follows it */
        struct stat info;
        f->torn = f->shared || fstat(f->manifest, &info) || ftruncate(f->manifest, info.st_size - n);
    }
    if (!error && durable && fdatasync(f->manifest) && errno != EINVAL)
        error = errno;
    return error ? fail(f, "write", DRAPE_MANIFEST_NAME, error) : DRAPE_OK;
}

static drape_status add_line(drape_folder *f, const char *line, bool durable)
{
    char text[LINE_SIZE + 2];
    int length = snprintf(text, sizeof text, "%s%s\n", f->torn ? "\n" : "", line);
    f->torn = false;
    return append(f, text, (size_t)length, durable);
}

/* The name as a string of JSON, as RFC 8259 in section 7 demands. */
static drape_status add_entry(drape_folder *f, const entry *e, bool durable)
{
    char line[LINE_SIZE];
    size_t n = (size_t)snprintf(line, sizeof line, "{\"file\":\"");
    for (const char *c = e->name; *c && n < LINE_SIZE - VALUES_SIZE; c++)
        n += (size_t)snprintf(line + n, sizeof line - n,
                              (unsigned char)*c < ' ' ? "\\u%04x"
                              : strchr("\"\\", *c)    ? "\\%c"
                                                      : "%c",
                              *c);
    if (e->growing)
        snprintf(line + n, sizeof line - n, "\",\"inode\":\"%" PRIx64 "\",\"born\":\"%" PRIx64 "\"}",
                 e->inode, e->born);
    else
        snprintf(line + n, sizeof line - n, "\",\"size\":%" PRIu64 ",\"checksum\":\"%016" PRIx64 "\"}",
                 e->size, e->sum);
    return add_line(f, line, durable);
}

drape_status drape_folder_note(drape_folder *f, const char *name, const drape_checksum *sum, bool durable)
{
    return add_entry(f, &(entry){.name = name, .size = sum->size, .sum = sum->sum}, durable);
}

drape_status drape_folder_note_growing(drape_folder *f, const char *name, int fd, bool durable)
{
    entry e = {.name = name, .growing = true};
    return identity_of(fd, &e.inode, &e.born) ? add_entry(f, &e, durable) : fail(f, "write", name, errno);
}

static drape_status put_head(drape_folder *f)
{
    char line[HEAD_SIZE];
    snprintf(line, sizeof line, HEAD_START "\"drape\":\"%.100s\"," HEAD_TOKEN, drape_version(), f->token);
    return add_line(f, line, false);
}

/* Entries of files that still exist, of any name. */
static drape_status put_entries(drape_folder *f)
{
    drape_status status = DRAPE_OK;
    struct stat info;
    for (size_t i = 0; i < f->entry_count && !status; i++)
        if (fstatat(f->fd, f->entries[i].name, &info, AT_SYMLINK_NOFOLLOW) == 0)
            status = add_entry(f, &f->entries[i], false);
    return status;
}

static int rename_new(int fd, const char *part, const char *name);

/* A new manifest takes the place of the old one, if there was one, when it is complete. */
static drape_status replace_manifest(drape_folder *f)
{
    char part[DRAPE_PART_SIZE];
    drape_folder_part(f, part);
    f->manifest =
        openat(f->fd, part, O_RDWR | O_CREAT | O_EXCL | O_APPEND | O_NOFOLLOW | O_CLOEXEC, (mode_t)0666);
    if (f->manifest < 0)
        return fail(f, "write", DRAPE_MANIFEST_NAME, errno);
    f->torn = false;
    drape_status status = put_head(f);
    if (!status)
        status = put_entries(f);
    if (!status && (f->token_count ? renameat(f->fd, part, f->fd, DRAPE_MANIFEST_NAME)
                                   : rename_new(f->fd, part, DRAPE_MANIFEST_NAME)))
        status = fail(f, "write", DRAPE_MANIFEST_NAME, errno);
    if (status)
        unlinkat(f->fd, part, 0);
    return status;
}

/* Processes that share a folder add lines to one manifest; each line is one write. */
static drape_status continue_manifest(drape_folder *f)
{
    f->manifest = openat(f->fd, DRAPE_MANIFEST_NAME,
                         O_RDWR | O_CREAT | O_APPEND | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, (mode_t)0666);
    return f->manifest < 0 ? fail(f, "write", DRAPE_MANIFEST_NAME, errno) : put_head(f);
}

drape_status drape_folder_begin(drape_folder *f, drape_folder_claim *clears, const void *user)
{
    const claims c = {NULL, clears, user};
    drape_status status = visit_files(f, remove_one, &c);
    if (status)
        return status;
    return clears || (!f->shared && f->token_count == 0) ? replace_manifest(f) : continue_manifest(f);
}

/* ---- Names ---- */

void drape_folder_part(drape_folder *f, char part[DRAPE_PART_SIZE])
{
    snprintf(part, DRAPE_PART_SIZE, PART_PREFIX "%" PRId64 DRAPE_FILE_PART, f->token, f->parts++);
}

/* The same without replacing, on file systems that cannot do so in one call: a link, or else a look first. */
static int rename_new_slowly(int fd, const char *part, const char *name)
{
    struct stat info;
    if (linkat(fd, part, fd, name, 0) == 0)
        return unlinkat(fd, part, 0);
    if (errno == EEXIST)
        return -1;
    if (fstatat(fd, name, &info, AT_SYMLINK_NOFOLLOW) == 0) {
        errno = EEXIST;
        return -1;
    }
    return renameat(fd, part, fd, name);
}

static int rename_new(int fd, const char *part, const char *name)
{
    if (renameat2(fd, part, fd, name, RENAME_NOREPLACE) == 0)
        return 0;
    return errno == EINVAL || errno == ENOSYS ? rename_new_slowly(fd, part, name) : -1;
}

static bool same_file(const struct stat *a, const struct stat *b)
{
    return a->st_dev == b->st_dev && a->st_ino == b->st_ino;
}

/* Exchanges both files and removes the old one, if it is `known`; otherwise exchanges them back. */
static int rename_over(int fd, const char *part, const char *name, const struct stat *known)
{
    struct stat info;
    if (renameat2(fd, part, fd, name, RENAME_EXCHANGE))
        return (errno == EINVAL || errno == ENOSYS) && fstatat(fd, name, &info, AT_SYMLINK_NOFOLLOW) == 0 &&
                       same_file(&info, known)
                   ? renameat(fd, part, fd, name)
                   : -1;
    if (fstatat(fd, part, &info, AT_SYMLINK_NOFOLLOW) == 0 && same_file(&info, known))
        return unlinkat(fd, part, 0);
    renameat2(fd, part, fd, name, RENAME_EXCHANGE);
    errno = EEXIST;
    return -1;
}

drape_status drape_folder_publish(drape_folder *f, const char *part, const char *name,
                                  const struct stat *last)
{
    struct stat there;
    if (rename_new(f->fd, part, name) == 0)
        return DRAPE_OK;
    const bool exists = errno == EEXIST;
    if (!exists)
        return fail(f, "write", name, errno);
    const bool same =
        last && fstatat(f->fd, name, &there, AT_SYMLINK_NOFOLLOW) == 0 && same_file(last, &there);
    const char *why = same ? NULL : why_not_ours(f, name, &there);
    if (!why && !is_input(f, &there) && rename_over(f->fd, part, name, &there) == 0)
        return DRAPE_OK;
    return drape_fail(
        f->ctx, DRAPE_E_FILE,
        "cannot write \"%.300s/%.200s\": a file of that name has appeared that Drape did not write", f->path,
        name);
}

/* ---- Resuming ---- */

drape_status drape_folder_verify(drape_folder *f, const char *name)
{
    struct stat info;
    const int fd = drape_folder_open_file(f, name, O_RDONLY);
    if (fd >= 0)
        close(fd);
    else if (errno != EINVAL)
        return fail(f, "continue", name, errno);
    const char *why = why_not_ours(f, name, &info);
    return why ? drape_fail(f->ctx, DRAPE_E_PARSE, "cannot continue \"%.300s/%.200s\": it is damaged: %s",
                            f->path, name, why)
               : DRAPE_OK;
}

drape_status drape_folder_verify_all(drape_folder *f, bool complete, const char *except)
{
    drape_status status = DRAPE_OK;
    for (size_t i = 0, next; i < f->entry_count && !status; i = next) {
        const char *name = f->entries[i].name;
        bool growing = false;
        struct stat info;
        for (next = i; next < f->entry_count && strcmp(f->entries[next].name, name) == 0; next++)
            growing |= f->entries[next].growing;
        const bool there = fstatat(f->fd, name, &info, AT_SYMLINK_NOFOLLOW) == 0;
        const bool needed = complete && strcmp(name, except) != 0;
        if (!is_part(f, name) && (complete || !growing) && (there || needed))
            status = drape_folder_verify(f, name);
    }
    return status;
}

void drape_folder_rehearse(drape_folder *folder, bool on)
{
    folder->rehearses = on;
}

void drape_folder_discard(drape_folder **folder)
{
    drape_folder *f = *folder;
    if (!f->shared)
        unlinkat(f->fd, DRAPE_MANIFEST_NAME, 0);
    rmdir(f->path);
    drape_folder_close(folder);
}

bool drape_folder_rehearses(const drape_folder *folder)
{
    return folder->rehearses;
}

drape_status drape_folder_sync(drape_folder *f)
{
    int error = 0;
    if (fdatasync(f->manifest) && errno != EINVAL)
        error = errno;
    if (fsync(f->fd) && errno != EINVAL && !error)
        error = errno;
    return error ? drape_file_fail(f->ctx, "write the folder", f->path, error) : DRAPE_OK;
}
