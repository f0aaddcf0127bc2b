/* disk.h: opens regular files and nothing else, so that no pipe or device in a folder makes the program wait,
 * and reads, writes and sums up their bytes. */
#ifndef DRAPE_IO_DISK_H
#define DRAPE_IO_DISK_H

#include <sys/stat.h>

#include "base/checksum.h"
#include "base/context.h"

#define DRAPE_MAX_TABLE ((off_t)1 << 32) /* [bytes] of a file with rows or lines that is read */

/* Sets the message `cannot DEED "PATH": strerror(error)`. Returns DRAPE_E_FILE; for ENOMEM DRAPE_E_MEMORY. */
drape_status drape_file_fail(drape_context *ctx, const char *deed, const char *path, int error);

/* Opens a regular file below the folder `dir`, a descriptor or AT_FDCWD. Returns -1 with errno, which is
 * EINVAL for anything else, such as a pipe or a device: opening it does not wait. */
int drape_open_regular(int dir, const char *path, int flags);

/* Opens a file of a run or an experiment for reading, as all readers do; a failure also sets the message. */
int drape_file_open(drape_context *ctx, const char *path);

/* Reads all of such a file, of at most `limit` bytes, and a 0 after it; *bytes, for drape_free, is NULL after
 * a failure. drape_file_take: from a descriptor, which it closes. Errors: DRAPE_E_FILE,
 * DRAPE_E_MEMORY. */
drape_status drape_file_read(drape_context *ctx, const char *path, off_t limit, char **bytes, size_t *size);
drape_status drape_file_take(drape_context *ctx, int fd, const char *path, off_t limit, char **bytes,
                             size_t *size);

/* Read and write bytes from an offset on; 0 or errno, which is EIO if the file ends before. */
int drape_read_at(int fd, void *to, size_t size, off_t offset);
int drape_write_at(int fd, off_t offset, const void *data, size_t size);

/* Bytes at an offset, which if it is < 0 is counted from the end. */
typedef struct drape_disk_bytes {
    int64_t offset, size;
    const unsigned char *bytes;
} drape_disk_bytes;

/* Where they are in a file of this size. */
off_t drape_disk_place(const drape_disk_bytes *b, off_t size);

/* The checksum of a file from `begin`, a multiple of 8, to `end`, if it had the bytes in `change`
 * (DRAPE_DISK_BYTES; NULL: none). Returns 0 or errno. */
#define DRAPE_DISK_BYTES 3
int drape_disk_sum(int fd, off_t begin, off_t end, const drape_disk_bytes *change, drape_checksum *sum);

/* Waits until the file is on the disk; one that cannot be synced, such as a pipe, has none. Returns 0 or
 * errno. */
int drape_disk_sync(int fd);

/* folder/name, to be freed by drape_free; NULL: out of memory. */
char *drape_disk_path(drape_context *ctx, const char *folder, const char *name);

/* Opens the folder that a path leads into. Returns -1 with errno. */
int drape_disk_open_parent(const char *path);

/* Whether a file at path is directly in a folder. */
bool drape_folder_has(const char *folder, const char *path);

/* Creates a folder and its missing parents, with the mode 0777 & ~umask. path is modified during the call.
 * Errors: DRAPE_E_FILE. */
drape_status drape_folder_make(drape_context *ctx, char *path);

#endif
