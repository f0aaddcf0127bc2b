/* main.c: the program `drape`: finds the verb, reads its command line, runs it, and checks that its output
 * was written. */
#include "cli/cli.h"
#include "sim/reproducible.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#define MIN_STACK (1 << 20) /* [bytes] of each thread; Drape takes up to a quarter, libraries the rest */

static const drape_verb *find_verb(const char *name)
{
    const int i = drape_registry_find(&drape_verb_registry, NULL, name);
    return i < 0 ? NULL : drape_verbs[i];
}

static int unknown_verb(const char *name)
{
    char text[DRAPE_UNKNOWN_SIZE];
    drape_registry_unknown(&drape_verb_registry, NULL, name, text);
    drape_make_printable(text);
    fprintf(stderr, "drape: %s\n", text);
    return CLI_BAD_INPUT;
}

/* `drape help`, `drape help VERB` */
static int help(int argc, char **argv)
{
    const drape_verb *verb = argc > 2 ? find_verb(argv[2]) : NULL;
    if (argc > 2 && !verb)
        return unknown_verb(argv[2]);
    if (verb) {
        cli_print_help(verb);
        return CLI_DONE;
    }
    puts("drape: a cloth simulator\n\nusage: drape VERB [arguments]\n");
    char operand[64];
    for (int i = 0; drape_verbs[i]; i++) {
        cli_operand_text(drape_verbs[i], operand, sizeof operand);
        printf("  %-10s %-15s %s\n", drape_verbs[i]->entry.name, operand, drape_verbs[i]->entry.summary);
    }
    puts("\n  drape VERB --help   show the arguments of a verb\n"
         "  drape --version     show the version, and whether results have the same bits on any processor\n\n"
         "Exit codes: 0 done, 1 the simulation, a check or the output failed, 2 bad input, 130 interrupted.");
    return CLI_DONE;
}

static int version(int argc, char **argv)
{
    (void)argc, (void)argv;
    char why[320];
    const bool reproducible = drape_reproducible(why, sizeof why);
    printf("drape %s\nreproducible: %s%s\n", drape_version(), reproducible ? "yes" : "no: ", why);
    printf("licence of libdrape: " DRAPE_LIBRARY_LICENCE "\n");
    printf("licence of the program: " DRAPE_PROGRAM_LICENCE "\n");
    return CLI_DONE;
}

/* A warning that is the same as the one before, as when a scene is read for several purposes, is printed
 * once. */
static void print_warning(void *user, drape_log_level level, const char *message)
{
    static char last[400];
    (void)user;
    if (level != DRAPE_LOG_WARNING || strncmp(message, last, sizeof last - 1) == 0)
        return;
    snprintf(last, sizeof last, "%s", message);
    fprintf(stderr, "warning: %s\n", message);
}

/* Scenes, models and sims of the context stop if the program is interrupted. */
static drape_status create_context(drape_context **out)
{
    drape_context_def def;
    drape_context_def_init(&def, sizeof def);
    def.cancel = cli_interrupted_by;
    def.log = print_warning;
    return drape_context_create(&def, out);
}

static int run(int argc, char **argv)
{
    static const struct {
        const char *word;
        int (*run)(int argc, char **argv);
    } words[] = {
        {"help", help}, {"--help", help}, {"-h", help}, {"--version", version}, {"version", version}};
    if (argc < 2)
        return help(argc, argv);
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (strcmp(argv[1], words[i].word) == 0)
            return words[i].run(argc, argv);
    const drape_verb *verb = find_verb(argv[1]);
    if (!verb)
        return unknown_verb(argv[1]);
    drape_context *ctx = NULL;
    drape_status status = create_context(&ctx);
    drape_arena arena = drape_arena_of(ctx);
    cli_command *request = status ? NULL : drape_arena_take(&arena, 1, verb->request_size);
    int code = CLI_FAILED;
    if (request) {
        request->arena = &arena;
        request->ctx = ctx;
        code = cli_parse(verb, argc - 1, argv + 1, request);
        if (code == CLI_GO_ON)
            code = verb->run(request);
        drape_arena_free(&arena);
    } else {
        cli_misuse(verb->entry.name, "out of memory");
    }
    drape_context_destroy(&ctx);
    return code;
}

/* Results that could not be written are a failure, whatever the verb returned, unless whoever reads the
 * standard output has closed it, as `head` does: nobody misses the rest. */
static int finish_output(int code)
{
    struct pollfd out = {.fd = STDOUT_FILENO, .events = POLLOUT};
    bool lost = ferror(stdout);
    errno = 0;
    lost = fflush(stdout) != 0 || lost;
    if (!lost || errno == EPIPE || (poll(&out, 1, 0) == 1 && out.revents & POLLERR))
        return code;
    if (cli_interrupted())
        return code == CLI_INTERRUPTED ? code : cli_report_interrupted("");
    fprintf(stderr, "drape: cannot write to the standard output%s%s\n", errno ? ": " : "",
            errno ? strerror(errno) : "");
    return code == CLI_DONE ? CLI_FAILED : code;
}

int main(int argc, char **argv)
{
    static const int modes[] = {O_WRONLY, O_RDONLY, O_RDONLY};
    const struct sigaction ignore = {.sa_handler = SIG_IGN};
    struct rlimit stack;
    /* If the program is started with a standard descriptor closed, a file that is opened later would become,
     * say, the standard output. The substitutes that are opened here fail on use, as the closed descriptor
     * does. */
    for (int fd = 0; fd < 3; fd++)
        if (fcntl(fd, F_GETFD) < 0 && open("/dev/null", modes[fd]) < 0)
            break;
    if (getrlimit(RLIMIT_STACK, &stack) == 0 && stack.rlim_cur < MIN_STACK) {
        fprintf(stderr, "drape: the stack is limited to %llu KiB, by ulimit -s; at least %d KiB are needed\n",
                (unsigned long long)stack.rlim_cur / 1024, MIN_STACK / 1024);
        return CLI_FAILED;
    }
    sigaction(SIGPIPE, &ignore, NULL); /* a closed pipe or a full quota must not end the program: */
    sigaction(SIGXFSZ, &ignore, NULL); /* writes are checked */
    cli_catch_signals();
    return finish_output(run(argc, argv));
}
