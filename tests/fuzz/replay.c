/* replay.c: `fuzz_<target> FOLDER` without libFuzzer: runs the target on each file of a folder, in order of
 * their names. It prints each name first, so that a crash can be assigned. Output is TAP. */
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>

#include "fuzz/fuzz.h"

/* Exactly size bytes, so that a sanitizer detects reads past them. NULL: the file cannot be read. */
static uint8_t *read_open(FILE *file, size_t *size)
{
    if (fseek(file, 0, SEEK_END) != 0)
        return NULL;
    const long length = ftell(file);
    rewind(file);
    *size = length > 0 ? (size_t)length : 0;
    uint8_t *data = malloc(*size ? *size : 1);
    if (data && fread(data, 1, *size, file) != *size) {
        free(data);
        return NULL;
    }
    return data;
}

static uint8_t *read_file(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    if (!file)
        return NULL;
    uint8_t *data = read_open(file, size);
    fclose(file);
    return data;
}

static int is_seed(const struct dirent *entry)
{
    return entry->d_name[0] != '.';
}

/* Returns 1 if the file could not be read. */
static int try_file(int number, const char *folder, const char *name)
{
    char path[4096];
    size_t size = 0;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    uint8_t *data = read_file(path, &size);
    printf("# %s, %zu bytes\n", name, size);
    fflush(stdout);
    if (data)
        LLVMFuzzerTestOneInput(data, size);
    printf("%sok %d - %s\n", data ? "" : "not ", number, name);
    free(data);
    return !data;
}

int main(int count, char **values)
{
    struct dirent **entries = NULL;
    const int files = count == 2 ? scandir(values[1], &entries, is_seed, alphasort) : -1;
    int failed = files <= 0;
    if (files <= 0)
        fprintf(stderr, "%s FOLDER: there are no files\n", values[0]);
    else
        printf("1..%d\n", files);
    for (int i = 0; i < files; i++) {
        failed += try_file(i + 1, values[1], entries[i]->d_name);
        free(entries[i]);
    }
    free(entries);
    return failed > 0;
}
