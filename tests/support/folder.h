/* folder.h: a temporary folder of a test's own, which is its working directory while it has one, and files
 * that are written or read as a whole. */
#ifndef DRAPE_TESTS_FOLDER_H
#define DRAPE_TESTS_FOLDER_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "support/suite.h"

static inline void folder_enter(void)
{
    char folder[] = "/tmp/drape-test-XXXXXX";
    ck_assert_ptr_nonnull(mkdtemp(folder));
    ck_assert_int_eq(chdir(folder), 0);
}

/* Removes the working directory, with what is in it. */
static inline void folder_leave(void)
{
    char folder[256], command[300];
    ck_assert_ptr_nonnull(getcwd(folder, sizeof folder));
    ck_assert_int_eq(strncmp(folder, "/tmp/drape-test-", 16), 0);
    snprintf(command, sizeof command, "rm -r '%s'", folder);
    ck_assert_int_eq(chdir("/") | system(command), 0);
}

static inline void folder_write(const char *name, const char *text)
{
    FILE *file = fopen(name, "w");
    ck_assert_msg(file != NULL, "cannot write %s", name);
    fputs(text, file);
    ck_assert_int_eq(fclose(file), 0);
}

/* The whole file, followed by a 0, to be freed. */
static inline char *file_read(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    ck_assert_msg(file != NULL, "%s is not there", path);
    ck_assert_int_eq(fseek(file, 0, SEEK_END), 0);
    *size = (size_t)ftell(file);
    char *data = malloc(*size + 1);
    ck_assert_ptr_nonnull(data);
    rewind(file);
    ck_assert_uint_eq(fread(data, 1, *size, file), *size);
    data[*size] = 0;
    fclose(file);
    return data;
}

#endif
