/* folder.c: see folder.h. statx and flock are Linux's. */
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
#include <unistd.h>

#include "base/arena.h"
#include "base/json_read.h"

#define VALUES_SIZE  80                           /* for the values of a line */
#define LINE_SIZE    (20 + 6 * 255 + VALUES_SIZE) /* a name of 255 bytes, each escaped, and its values */
#define MAX_MANIFEST ((off_t)1 << 30)
#define ADVICE       "name another folder, or move the file away"

struct drape_folder {
    drape_context *ctx;
    drape_arena arena;
    char *path;
    int fd, manifest; /* -1: not open */
    bool shared;
    bool known;          /* there is a manifest */
    bool torn;           /* its last line has no end */
    json_t *lines;       /* {name: [line, ...]} of the manifest when it was read: what a file is, and what it
                                was about to become */
    struct stat *inputs; /* (input_count) */
    size_t input_count;
};

drape_status drape_folder_fail(const drape_folder *f, const char *deed, const char *name, int error)
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

bool drape_folder_is_name(const char *name)
{
    return name && *name && !strchr(name, '/') && strcmp(name, ".") != 0 && strcmp(name, "..") != 0;
}

bool drape_folder_is_named(const void *user, const char *name)
{
    return strcmp(user, name) == 0;
}

bool drape_folder_matches(const char *pattern, const char *name, int64_t *number)
{
    while (*pattern && *pattern != '*') {
        const size_t least = strspn(pattern, "#"), digits = strspn(name, "0123456789");
        if (least > 0 ? digits < least : *pattern != *name)
            return false;
        if (least > 0 && number)
            *number = (int64_t)strtoll(name, NULL, 10);
        pattern += least > 0 ? least : 1;
        name += least > 0 ? digits : 1;
    }
    return *pattern || !*name;
}

/* A line that cannot be read is left out: what it described is then not ours. The manifest of a folder that
 * several processes share may be empty: one of them is about to begin it. */
static drape_status read_manifest(drape_folder *f)
{
    char path[512], *text;
    size_t size;
    const int fd = drape_open_regular(f->fd, DRAPE_MANIFEST_NAME, O_RDONLY | O_NOFOLLOW);
    if (fd < 0 && errno == ENOENT)
        return DRAPE_OK;
    if (fd < 0)
        return errno == EINVAL ? refuse(f, DRAPE_MANIFEST_NAME, "it is not a regular file")
                               : drape_folder_fail(f, "read", DRAPE_MANIFEST_NAME, errno);
    snprintf(path, sizeof path, "%.480s/" DRAPE_MANIFEST_NAME, f->path);
    drape_status status = drape_file_take(f->ctx, fd, path, MAX_MANIFEST, &text, &size);
    json_decref(f->lines);
    f->lines = json_object();
    f->torn = !status && size > 0 && text[size - 1] != '\n';
    char *end;
    for (char *at = text; !status && (end = memchr(at, '\n', size - (size_t)(at - text))); at = end + 1) {
        json_error_t error;
        json_t *line = drape_json_read(at, (size_t)(end - at), 0, &error);
        const char *name = json_string_value(json_object_get(line, "file"));
        bool failed = !line && json_error_code(&error) == json_error_out_of_memory;
        f->known = f->known || json_object_get(line, "manifest");
        if (drape_folder_is_name(name)) {
            json_t *lines = json_object_get(f->lines, name);
            failed = (!lines && json_object_set_new(f->lines, name, lines = json_array())) ||
                     json_array_append(lines, line);
        }
        json_decref(line);
        status = failed ? drape_fail_memory(f->ctx, (size_t)(end - at)) : DRAPE_OK;
    }
    drape_free(f->ctx, text);
    if (status || f->known || (size == 0 && f->shared))
        return status;
    return drape_fail(f->ctx, DRAPE_E_ARGUMENT, "\"%.500s\" is not a manifest of Drape; " ADVICE, path);
}

/* A folder without flock, as some network file systems are, is used without a lock. */
drape_status drape_folder_open(drape_context *ctx, const char *path, bool shared, drape_folder **out)
{
    int code;
    drape_folder *f = *out = drape_alloc(ctx, 1, sizeof *f);
    if (!f)
        return DRAPE_E_MEMORY;
    *f = (drape_folder){.ctx = ctx, .arena = drape_arena_of(ctx), .fd = -1, .manifest = -1, .shared = shared};
    f->path = drape_arena_text(&f->arena, path);
    for (size_t n = f->path ? strlen(f->path) : 0; n > 1 && f->path[n - 1] == '/'; n--)
        f->path[n - 1] = 0;
    drape_status status = f->path ? drape_folder_make(ctx, f->path) : DRAPE_E_MEMORY;
    if (!status) {
        f->fd = open(f->path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
        status = f->fd < 0 ? drape_file_fail(ctx, "open the folder", f->path, errno) : DRAPE_OK;
    }
    if (!status) {
        do
            code = flock(f->fd, (shared ? LOCK_SH : LOCK_EX) | LOCK_NB);
        while (code && errno == EINTR);
        if (code && errno == EWOULDBLOCK)
            status = drape_fail(
                ctx, DRAPE_E_ARGUMENT,
                "another process is writing into the folder \"%.500s\"; name another, or wait for it",
                f->path);
        else if (code)
            drape_log(ctx, DRAPE_LOG_WARNING, "the folder \"%.500s\" cannot be locked", f->path);
    }
    if (!status)
        status = read_manifest(f);
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
    json_decref(f->lines);
    drape_arena_free(&f->arena);
    drape_free(f->ctx, f);
    *folder = NULL;
}

void drape_folder_discard(drape_folder **folder)
{
    drape_folder *f = *folder;
    if (!f->shared)
        unlinkat(f->fd, DRAPE_MANIFEST_NAME, 0);
    rmdir(f->path);
    drape_folder_close(folder);
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

/* Inode and time of birth; a file system that does not keep the latter gives 0. */
static bool find_birth(int fd, uint64_t birth[2])
{
    struct statx info;
    if (statx(fd, "", AT_EMPTY_PATH, STATX_INO | STATX_BTIME, &info))
        return false;
    birth[0] = info.stx_ino;
    birth[1] = info.stx_mask & STATX_BTIME
                   ? (uint64_t)info.stx_btime.tv_sec * 1000000000u + info.stx_btime.tv_nsec
                   : 0;
    return true;
}

static uint64_t number_of(const json_t *line, const char *key)
{
    const json_t *value = json_object_get(line, key);
    return json_is_string(value) ? strtoull(json_string_value(value), NULL, 16)
                                 : (uint64_t)json_integer_value(value);
}

static bool is_growing(const json_t *line)
{
    return json_object_get(line, "inode") != NULL;
}

/* Whether the open file is one that the lines of its name describe. A file does not grow any more once it is
 * complete. */
static bool is_described(const json_t *lines, int fd, const struct stat *info)
{
    uint64_t birth[2];
    drape_checksum content = {0};
    bool complete = false;
    if (!find_birth(fd, birth))
        return false;
    for (size_t i = json_array_size(lines); i-- > 0;) {
        const json_t *line = json_array_get(lines, i);
        if (is_growing(line)) {
            if (!complete && number_of(line, "inode") == birth[0] && number_of(line, "born") == birth[1])
                return true;
            continue;
        }
        complete = true;
        if (number_of(line, "size") != (uint64_t)info->st_size)
            continue;
        if (content.size == 0 && drape_disk_sum(fd, 0, info->st_size, NULL, &content))
            return false;
        if (number_of(line, "checksum") == content.sum)
            return true;
    }
    return false;
}

/* NULL: the file is ours, or does not exist. Otherwise why it is not. The manifest is read again if this
 * process, or one that shares the folder, may have added to it. *info: of the file. */
static const char *why_not_ours(drape_folder *f, const char *name, struct stat *info)
{
    for (bool again = f->manifest >= 0 || f->shared;; again = false) {
        const json_t *lines = json_object_get(f->lines, name);
        const int fd = drape_open_regular(f->fd, name, O_RDONLY | O_NOFOLLOW);
        if (fd < 0)
            return errno == ENOENT   ? NULL
                   : errno == EINVAL ? "it is not a regular file"
                                     : "it cannot be read";
        const bool ours = lines && fstat(fd, info) == 0 && is_described(lines, fd, info);
        close(fd);
        if (ours)
            return NULL;
        if (!again || read_manifest(f))
            return lines ? "it has changed since Drape wrote it" : "Drape did not write it";
    }
}

static bool same_file(const struct stat *a, const struct stat *b)
{
    return a->st_dev == b->st_dev && a->st_ino == b->st_ino;
}

drape_status drape_folder_protect(drape_folder *f, const char *path)
{
    struct stat info;
    if (stat(path, &info))
        return DRAPE_OK;
    struct stat *grown = drape_arena_resize(&f->arena, f->inputs, f->input_count + 1, sizeof *grown);
    if (!grown)
        return DRAPE_E_MEMORY;
    f->inputs = grown;
    f->inputs[f->input_count++] = info;
    return DRAPE_OK;
}

static bool is_input(const drape_folder *f, const struct stat *info)
{
    for (size_t i = 0; i < f->input_count; i++)
        if (same_file(&f->inputs[i], info))
            return true;
    return false;
}

/* ---- All files of the folder ---- */

typedef struct claims {
    drape_folder_claim *writes, *clears;
    const void *user;
} claims;

typedef drape_status visit(drape_folder *f, const char *name, const claims *c);

static drape_status visit_files(drape_folder *f, visit *each, const claims *c)
{
    int fd = openat(f->fd, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    DIR *dir = fd < 0 ? NULL : fdopendir(fd);
    drape_status status = DRAPE_OK;
    struct dirent *file;
    while (dir && (errno = 0, !status) && (file = readdir(dir)))
        if (drape_folder_is_name(file->d_name))
            status = each(f, file->d_name, c);
    if (!status && errno)
        status = drape_file_fail(f->ctx, "read the folder", f->path, errno);
    if (dir)
        closedir(dir);
    return status;
}

static drape_status check_one(drape_folder *f, const char *name, const claims *c)
{
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
    return visit_files(f, check_one, &(claims){writes, clears, user});
}

static drape_status unlink_one(drape_folder *f, const char *name)
{
    return unlinkat(f->fd, name, 0) && errno != ENOENT
               ? drape_folder_fail(f, "remove the old file", name, errno)
               : DRAPE_OK;
}

static drape_status remove_one(drape_folder *f, const char *name, const claims *c)
{
    struct stat info = {0};
    const bool goes = c->clears(c->user, name) && !why_not_ours(f, name, &info) && !is_input(f, &info);
    return goes ? unlink_one(f, name) : DRAPE_OK;
}

drape_status drape_folder_remove(drape_folder *f, drape_folder_claim *claim, const void *user)
{
    return visit_files(f, remove_one, &(claims){NULL, claim, user});
}

/* The beginning of the names of temporary files, by which the next process knows those of a killed one. */
static int put_prefix(const drape_folder *f, char part[DRAPE_PART_SIZE])
{
    struct stat info = {0};
    fstat(f->fd, &info);
    return snprintf(part, DRAPE_PART_SIZE, ".drape-%016jx-", (uintmax_t)info.st_ino);
}

void drape_folder_part(const drape_folder *f, uint64_t number, char part[DRAPE_PART_SIZE])
{
    const int used = put_prefix(f, part);
    snprintf(part + used, DRAPE_PART_SIZE - (size_t)used, "%016" PRIx64 DRAPE_FILE_PART, number);
}

static drape_status remove_part(drape_folder *f, const char *name, const claims *c)
{
    char prefix[DRAPE_PART_SIZE];
    const size_t length = (size_t)put_prefix(f, prefix);
    (void)c;
    const bool part = strncmp(name, prefix, length) == 0 && strspn(name + length, "0123456789abcdef") == 16 &&
                      strcmp(name + length + 16, DRAPE_FILE_PART) == 0;
    return part ? unlink_one(f, name) : DRAPE_OK;
}

/* ---- The manifest ---- */

/* Each line is one write, since processes that share a folder add to one manifest. The piece of a line that
 * does not fit on the disk is taken back, unless others may have written after it: then readers leave it out,
 * and the next line begins after its end. */
static drape_status add_line(drape_folder *f, const char *line, bool durable)
{
    char text[LINE_SIZE + 2];
    struct stat info;
    ssize_t n;
    const int length = snprintf(text, sizeof text, "%s%s\n", f->torn ? "\n" : "", line);
    do
        n = write(f->manifest, text, (size_t)length);
    while (n < 0 && errno == EINTR);
    int error = n == length ? 0 : n < 0 ? errno : EFBIG;
    if (error && n > 0)
        f->torn = f->shared || fstat(f->manifest, &info) || ftruncate(f->manifest, info.st_size - n);
    else if (!error)
        f->torn = false;
    if (!error && durable && fdatasync(f->manifest) && errno != EINVAL)
        error = errno;
    return error ? drape_folder_fail(f, "write", DRAPE_MANIFEST_NAME, error) : DRAPE_OK;
}

/* The name as a string of JSON, as RFC 8259 in section 7 demands. first, second: size and checksum, or
 * inode and time of birth. */
static drape_status add_file(drape_folder *f, const char *name, bool growing, uint64_t first, uint64_t second,
                             bool durable)
{
    char line[LINE_SIZE];
    size_t n = (size_t)snprintf(line, sizeof line, "{\"file\":\"");
    for (const char *c = name; *c && n < LINE_SIZE - VALUES_SIZE; c++)
        n += (size_t)snprintf(line + n, sizeof line - n,
                              (unsigned char)*c < ' ' ? "\\u%04x"
                              : strchr("\"\\", *c)    ? "\\%c"
                                                      : "%c",
                              *c);
    snprintf(line + n, sizeof line - n,
             growing ? "\",\"inode\":\"%" PRIx64 "\",\"born\":\"%" PRIx64 "\"}"
                     : "\",\"size\":%" PRIu64 ",\"checksum\":\"%016" PRIx64 "\"}",
             first, second);
    return add_line(f, line, durable);
}

drape_status drape_folder_note(drape_folder *f, const char *name, const drape_checksum *sum, int fd,
                               bool durable)
{
    uint64_t birth[2];
    if (sum)
        return add_file(f, name, false, sum->size, sum->sum, durable);
    return find_birth(fd, birth) ? add_file(f, name, true, birth[0], birth[1], durable)
                                 : drape_folder_fail(f, "write", name, errno);
}

/* The lines of files that still exist, of any name. */
static drape_status add_known(drape_folder *f)
{
    const char *name;
    json_t *lines, *line;
    size_t i;
    struct stat info;
    drape_status status = DRAPE_OK;
    json_object_foreach(f->lines, name, lines)
    {
        if (fstatat(f->fd, name, &info, AT_SYMLINK_NOFOLLOW))
            continue;
        json_array_foreach(lines, i, line)
        {
            const bool growing = is_growing(line);
            if (!status)
                status = add_file(f, name, growing, number_of(line, growing ? "inode" : "size"),
                                  number_of(line, growing ? "born" : "checksum"), false);
        }
    }
    return status;
}

/* Renames a file to a name that no other has, in one call. A file system without links is looked at first. */
static int rename_new(const drape_folder *f, const char *part, const char *name)
{
    struct stat info;
    if (linkat(f->fd, part, f->fd, name, 0) == 0)
        return unlinkat(f->fd, part, 0);
    if (errno != EEXIST && fstatat(f->fd, name, &info, AT_SYMLINK_NOFOLLOW))
        return renameat(f->fd, part, f->fd, name);
    errno = EEXIST;
    return -1;
}

/* A manifest that is shared is continued, and temporary files there may be in use. Otherwise a new manifest
 * takes the place of the old one when it is complete. */
drape_status drape_folder_begin(drape_folder *f, drape_folder_claim *clears, const void *user)
{
    const int flags = O_RDWR | O_CREAT | O_APPEND | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC;
    char name[DRAPE_PART_SIZE] = DRAPE_MANIFEST_NAME, head[LINE_SIZE];
    drape_status status = clears ? drape_folder_remove(f, clears, user) : DRAPE_OK;
    if (!status && !f->shared)
        status = visit_files(f, remove_part, NULL);
    if (status)
        return status;
    if (!f->shared)
        drape_folder_part(f, 0, name);
    f->torn = f->torn && f->shared;
    f->manifest = openat(f->fd, name, f->shared ? flags : flags | O_EXCL, (mode_t)0666);
    if (f->manifest < 0)
        return drape_folder_fail(f, "write", DRAPE_MANIFEST_NAME, errno);
    snprintf(head, sizeof head, "{\"manifest\":1,\"drape\":\"%.100s\"}", drape_version());
    status = add_line(f, head, false);
    if (f->shared)
        return status;
    if (!status)
        status = add_known(f);
    if (!status && f->known && fdatasync(f->manifest) && errno != EINVAL) /* the old one is lost */
        status = drape_folder_fail(f, "write", DRAPE_MANIFEST_NAME, errno);
    if (!status && (f->known ? renameat(f->fd, name, f->fd, DRAPE_MANIFEST_NAME)
                             : rename_new(f, name, DRAPE_MANIFEST_NAME)))
        status = drape_folder_fail(f, "write", DRAPE_MANIFEST_NAME, errno);
    if (status)
        unlinkat(f->fd, name, 0);
    return status;
}

drape_status drape_folder_publish(drape_folder *f, const char *part, const char *name,
                                  const struct stat *last)
{
    struct stat there = {0};
    if (rename_new(f, part, name) == 0)
        return DRAPE_OK;
    if (errno != EEXIST)
        return drape_folder_fail(f, "write", name, errno);
    const bool same = fstatat(f->fd, name, &there, AT_SYMLINK_NOFOLLOW) == 0 && same_file(last, &there);
    if ((same || !why_not_ours(f, name, &there)) && !is_input(f, &there))
        return renameat(f->fd, part, f->fd, name) ? drape_folder_fail(f, "write", name, errno) : DRAPE_OK;
    return drape_fail(
        f->ctx, DRAPE_E_FILE,
        "cannot write \"%.300s/%.200s\": a file of that name has appeared that Drape did not write", f->path,
        name);
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

/* ---- Resuming ---- */

bool drape_folder_wrote(const drape_folder *f, const char *name)
{
    return json_object_get(f->lines, name) != NULL;
}

drape_status drape_folder_damaged(const drape_folder *f, const char *name, const char *how)
{
    return drape_fail(f->ctx, DRAPE_E_PARSE, "cannot continue \"%.300s/%.200s\": it is damaged: %s", f->path,
                      name, how);
}

drape_status drape_folder_verify(drape_folder *f, drape_folder_claim *needed, const void *user)
{
    const char *name;
    json_t *lines;
    struct stat info;
    json_object_foreach(f->lines, name, lines)
    {
        const bool missing = fstatat(f->fd, name, &info, AT_SYMLINK_NOFOLLOW) != 0;
        const bool grows = is_growing(json_array_get(lines, json_array_size(lines) - 1));
        const char *why = missing && needed(user, name) ? "it is missing"
                          : missing || grows            ? NULL
                                                        : why_not_ours(f, name, &info);
        if (why)
            return drape_folder_damaged(f, name, why);
    }
    return DRAPE_OK;
}
