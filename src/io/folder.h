/*
 * folder.h: a folder that receives the files of a run, of pictures or of an experiment, and the rule for it:
 * Drape replaces and removes only files that it wrote.
 *
 * The folder has a manifest, manifest.jsonl, a line of JSON for each file that was written into it: name,
 * size and checksum. A line is appended before the file gets its name, so that a killed process leaves no
 * file that the manifest does not have. A file is Drape's if its name is in the manifest and its bytes are
 * those that the manifest describes; a file that was still growing when a process was killed is known by
 * its inode and its time of birth instead. All else in the folder is somebody else's, whatever its name is.
 *
 * Files are reached from the descriptor of the folder. They are written under temporary names, which have
 * the inode of the folder and a random number, and get their names by a rename that replaces nothing but a
 * file of ours. Links are not followed, and nothing but regular files is opened.
 *
 * The folder is locked (flock on its descriptor) while it is open, so a lock ends with its process.
 */
#ifndef DRAPE_IO_FOLDER_H
#define DRAPE_IO_FOLDER_H

#include "io/disk.h"

#define DRAPE_MANIFEST_NAME "manifest.jsonl"
#define DRAPE_FILE_PART     ".part" /* suffix of temporary names */
#define DRAPE_PART_SIZE     64      /* for a temporary name */

typedef struct drape_folder drape_folder;

/* Whether a writer may write a file of this name. */
typedef bool drape_folder_claim(const void *user, const char *name);

/* One of the single name in `user`. */
bool drape_folder_is_named(const void *user, const char *name);

/* Whether a name is of a pattern, in which n signs # in a row stand for n digits or more, and a * at the end
 * for anything. *number: the last of these numbers (NULL: it is not needed). */
bool drape_folder_matches(const char *pattern, const char *name, int64_t *number);

/* Makes the folder and its missing parents, locks it and reads its manifest. shared: other processes may
 * write other files into it at the same time, if they open it as shared too. Errors: DRAPE_E_ARGUMENT (it
 * is locked, or it has a manifest of another format), DRAPE_E_FILE, DRAPE_E_MEMORY. */
drape_status drape_folder_open(drape_context *ctx, const char *path, bool shared, drape_folder **out);
void drape_folder_close(drape_folder **folder); /* *folder may be NULL */

/* The same, and removes the manifest, and the folder if there is nothing else in it. */
void drape_folder_discard(drape_folder **folder);

/* Whether a name, which may come from a file of somebody else, is that of an entry of a folder: not a path
 * that leads out of it. Every file of a folder is begun under such a name (drape_file_begin). */
bool drape_folder_is_name(const char *name);

const char *drape_folder_path(const drape_folder *folder); /* without a slash at its end */
int drape_folder_descriptor(const drape_folder *folder);

/* Declares the file at path, if there is one, an input, which must be neither replaced nor removed. Errors:
 * DRAPE_E_MEMORY. */
drape_status drape_folder_protect(drape_folder *folder, const char *path);

/* Refuses, before anything is touched, if a file of a name that `writes` claims is not ours, or one that
 * `clears` claims is an input. Errors: DRAPE_E_ARGUMENT, with the name of the file; DRAPE_E_FILE. */
drape_status drape_folder_check(drape_folder *folder, drape_folder_claim *writes, drape_folder_claim *clears,
                                const void *user);

/* Begins to write: removes those of our files that `clears` claims (NULL: none) and temporary files of
 * killed processes, and begins a manifest with the files that remain. Errors: DRAPE_E_FILE. */
drape_status drape_folder_begin(drape_folder *folder, drape_folder_claim *clears, const void *user);

/* Removes those of our files that are claimed. Errors: DRAPE_E_FILE. */
drape_status drape_folder_remove(drape_folder *folder, drape_folder_claim *claim, const void *user);

/* Checks before drape_folder_begin, when a run is resumed, that all files of the manifest have the bytes that
 * it describes. Files that were still growing when a process was killed are left out: what they must be is
 * known elsewhere. A file that is missing is a fault if `needed` claims it. Errors: DRAPE_E_PARSE. */
drape_status drape_folder_verify(drape_folder *folder, drape_folder_claim *needed, const void *user);

/* Whether the manifest has a file of this name. */
bool drape_folder_wrote(const drape_folder *folder, const char *name);

/* ---- For io/file.c ---- */

/* Set the message of a failure: `cannot DEED "FOLDER/NAME": strerror(error)`, as drape_file_fail does; or
 * that a file cannot be continued because it is damaged, with DRAPE_E_PARSE. */
drape_status drape_folder_fail(const drape_folder *folder, const char *deed, const char *name, int error);
drape_status drape_folder_damaged(const drape_folder *folder, const char *name, const char *how);

/* A temporary name with a random number. */
void drape_folder_part(const drape_folder *folder, uint64_t number, char part[DRAPE_PART_SIZE]);

/* Adds a line for a file: complete, with its checksum; or (sum NULL) growing, with the identity of its
 * descriptor. durable: the line is on the disk when this returns. Errors: DRAPE_E_FILE. */
drape_status drape_folder_note(drape_folder *folder, const char *name, const drape_checksum *sum, int fd,
                               bool durable);

/* Renames a temporary file. last: the file that this process wrote under the name before, which it may
 * replace. Errors: DRAPE_E_FILE; then the temporary file is still there. */
drape_status drape_folder_publish(drape_folder *folder, const char *part, const char *name,
                                  const struct stat *last);

/* Waits until manifest and names are on the disk. Errors: DRAPE_E_FILE. */
drape_status drape_folder_sync(drape_folder *folder);

#endif
