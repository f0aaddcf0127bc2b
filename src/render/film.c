/* film.c: see film.h. */
#include "render/film.h"

#include "io/export.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/wait.h>
#include <unistd.h>

#define PROGRAM    "ffmpeg"
#define MAX_ARGS   48
#define CHILD_FILE 9 /* descriptor of the film in the child: above those that the spawning dup2 use */
#define LAST_LINE  240
#define PROTOCOL   "file:"

extern char **environ;

/* ffmpeg's arguments for each kind of film, separated by blanks. The sides of a film have to be even. */
typedef struct kind {
    const char *ending, *args;
} kind;

#define EVEN "crop=trunc(iw/2)*2:trunc(ih/2)*2"
static const kind kinds[] = {
    {".mp4",
     "-vf " EVEN
     " -c:v libx264 -preset medium -crf 17 -pix_fmt yuv420p -colorspace bt709 -movflags +faststart -f mp4"},
    {".webm", "-vf " EVEN " -c:v libvpx-vp9 -crf 24 -b:v 0 -row-mt 1 -cpu-used 4 -pix_fmt yuv420p -f webm"},
    {".gif", "-filter_complex "
             "split[a][b];[a]palettegen=max_colors=192:stats_mode=full[p];"
             "[b][p]paletteuse=dither=bayer:bayer_scale=5:diff_mode=rectangle "
             "-loop 0 -f gif"},
    {".apng", "-plays 0 -pred mixed -f apng"},
};

struct drape_film {
    drape_context *ctx;
    drape_file file; /* the film: ffmpeg opens it again, by its descriptor */
    char output[40];
    pid_t child;
    int pipe, errors; /* to ffmpeg; a file without a name for its output */
    size_t bytes;     /* of a picture */
};

static const kind *kind_of(const char *path)
{
    size_t length = strlen(path);
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        size_t ending = strlen(kinds[i].ending);
        if (length > ending && strcasecmp(path + length - ending, kinds[i].ending) == 0)
            return &kinds[i];
    }
    return NULL;
}

bool drape_film_knows(const char *path)
{
    return kind_of(path) != NULL;
}

const char *drape_film_ending(int index)
{
    return (size_t)index < sizeof kinds / sizeof *kinds ? kinds[index].ending : NULL;
}

drape_status drape_film_check(drape_context *ctx)
{
    const char *list = getenv("PATH");
    char path[4096];
    for (const char *folder = list ? list : "/bin:/usr/bin"; *folder;) {
        int length = (int)strcspn(folder, ":");
        snprintf(path, sizeof path, "%.*s/" PROGRAM, length, folder);
        if (access(path, X_OK) == 0)
            return DRAPE_OK;
        folder += length + (folder[length] == ':');
    }
    return drape_fail(ctx, DRAPE_E_FILE,
                      "there is no " PROGRAM
                      " to make a film with: install it, or name a folder for pictures");
}

/* Splits text at blanks into arguments, in place. */
static int add_args(char *text, char **args, int count)
{
    for (char *arg = text; *arg && count < MAX_ARGS - 2;) {
        args[count++] = arg;
        arg += strcspn(arg, " ");
        if (*arg)
            *arg++ = 0;
    }
    return count;
}

static drape_status start(drape_film *film, int width, int height, double rate)
{
    char input[200], output[600], *args[MAX_ARGS] = {PROGRAM};
    int ends[2];
    snprintf(
        input, sizeof input,
        "-hide_banner -loglevel error -nostdin -y -f rawvideo -pix_fmt rgba -s %dx%d -r %.10g -i pipe:0 -an",
        width, height, rate);
    snprintf(output, sizeof output, "%s", kind_of(film->file.path)->args);
    snprintf(film->output, sizeof film->output, PROTOCOL "/proc/self/fd/%d", CHILD_FILE);
    args[add_args(output, args, add_args(input, args, 1))] = film->output;
    FILE *file = tmpfile();
    film->errors = file ? fcntl(fileno(file), F_DUPFD_CLOEXEC, 3) : -1;
    if (file)
        fclose(file);
    if (film->errors < 0 || pipe(ends) != 0)
        return drape_fail(film->ctx, DRAPE_E_FILE, "cannot make a pipe to " PROGRAM ": %s", strerror(errno));
    film->pipe = fcntl(ends[1], F_DUPFD_CLOEXEC, 3);
    close(ends[1]);
    fcntl(ends[0], F_SETFD, FD_CLOEXEC);
    /* The child reads the pipe as its standard input and writes both outputs into the file of errors. */
    const int copies[][2] = {{ends[0], STDIN_FILENO},
                             {film->errors, STDOUT_FILENO},
                             {film->errors, STDERR_FILENO},
                             {film->file.fd, CHILD_FILE}};
    posix_spawn_file_actions_t actions;
    int error = posix_spawn_file_actions_init(&actions);
    for (int i = 0; !error && i < 4; i++)
        error = posix_spawn_file_actions_adddup2(&actions, copies[i][0], copies[i][1]);
    if (!error)
        error = posix_spawnp(&film->child, PROGRAM, &actions, NULL, args, environ);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[0]);
    if (!error)
        return DRAPE_OK;
    film->child = 0;
    return drape_fail(film->ctx, DRAPE_E_FILE, "cannot start " PROGRAM ": %s", strerror(error));
}

drape_status drape_film_begin(drape_context *ctx, const char *path, int width, int height, double rate,
                              drape_film **out)
{
    drape_film *film = *out = drape_alloc(ctx, 1, sizeof *film);
    if (!film)
        return DRAPE_E_MEMORY;
    *film = (drape_film){.ctx = ctx, .pipe = -1, .errors = -1, .bytes = 4 * (size_t)width * (size_t)height};
    drape_status status = drape_export_begin(ctx, NULL, path, &film->file);
    if (!status)
        status = start(film, width, height, rate);
    if (status)
        drape_film_abandon(out);
    return status;
}

/* The last line that ffmpeg wrote, or how it ended. */
static void last_line(const drape_film *film, int result, char *text, size_t size)
{
    char tail[LAST_LINE + 1] = "";
    off_t length = lseek(film->errors, 0, SEEK_END), from = length > LAST_LINE ? length - LAST_LINE : 0;
    ssize_t got = length > 0 ? pread(film->errors, tail, LAST_LINE, from) : 0;
    while (got > 0 && (tail[got - 1] == '\n' || tail[got - 1] == ' '))
        got--;
    tail[got > 0 ? got : 0] = 0;
    const char *line = strrchr(tail, '\n');
    if (got > 0)
        snprintf(text, size, "%s", line ? line + 1 : tail);
    else if (WIFSIGNALED(result))
        snprintf(text, size, "it was ended by signal %d", WTERMSIG(result));
    else
        snprintf(text, size, "it ended with exit code %d", WEXITSTATUS(result));
}

static int wait_for(drape_film *film)
{
    int result = 0;
    if (film->pipe >= 0)
        close(film->pipe);
    film->pipe = -1;
    while (film->child > 0 && waitpid(film->child, &result, 0) < 0 && errno == EINTR)
        ;
    film->child = 0;
    return result;
}

drape_status drape_film_add(drape_film *film, const uint8_t *pixels)
{
    for (size_t done = 0; done < film->bytes;) {
        ssize_t wrote = write(film->pipe, pixels + done, film->bytes - done);
        if (wrote < 0 && errno != EINTR) {
            char text[LAST_LINE + 40];
            last_line(film, wait_for(film), text, sizeof text);
            return drape_fail(film->ctx, DRAPE_E_FILE, "%s: " PROGRAM " gave up: %s", film->file.path, text);
        }
        done += wrote > 0 ? (size_t)wrote : 0;
    }
    return DRAPE_OK;
}

static void release(drape_film **out)
{
    drape_film *film = *out;
    if (film->errors >= 0)
        close(film->errors);
    drape_file_destroy(&film->file);
    drape_free(film->ctx, film);
    *out = NULL;
}

drape_status drape_film_end(drape_film **out)
{
    drape_film *film = *out;
    char text[LAST_LINE + 40];
    int result = wait_for(film);
    drape_status status = DRAPE_OK;
    if (!WIFEXITED(result) || WEXITSTATUS(result) != 0) {
        last_line(film, result, text, sizeof text);
        status = drape_fail(film->ctx, DRAPE_E_FILE, "%s: " PROGRAM " failed: %s", film->file.path, text);
    } else {
        status = drape_file_finish(&film->file);
    }
    release(out);
    return status;
}

void drape_film_abandon(drape_film **out)
{
    if (!out || !*out)
        return;
    if ((*out)->child > 0)
        kill((*out)->child, SIGTERM);
    wait_for(*out);
    release(out);
}
