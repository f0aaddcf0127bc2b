/*
 * bench.h: what benchmarks share: models from scene texts in which apostrophes stand for quotation marks,
 * sims, errors that end the program, and CSV files.
 */
#ifndef DRAPE_BENCH_BENCH_H
#define DRAPE_BENCH_BENCH_H

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/utsname.h>

#include "base/clock.h"
#include "sim/sim.h"

__attribute__((format(printf, 2, 3), noreturn)) static inline void bench_fail(drape_context *ctx,
                                                                              const char *format, ...)
{
    va_list values;
    va_start(values, format);
    vfprintf(stderr, format, values);
    va_end(values);
    fprintf(stderr, ": %s\n", drape_context_message(ctx));
    exit(1);
}

static inline drape_context *bench_context(void)
{
    drape_context *ctx = NULL;
    if (drape_context_create(NULL, &ctx)) {
        fputs("out of memory for a context\n", stderr);
        exit(1);
    }
    return ctx;
}

__attribute__((format(printf, 2, 3))) static inline drape_model *bench_model(drape_context *ctx,
                                                                             const char *format, ...)
{
    char text[4096];
    drape_scene *scene = NULL;
    drape_model *model = NULL;
    va_list values;
    va_start(values, format);
    vsnprintf(text, sizeof text, format, values);
    va_end(values);
    for (char *c = text; *c; c++)
        if (*c == '\'')
            *c = '"';
    drape_status status = drape_scene_parse(ctx, text, "bench", &scene);
    if (!status)
        status = drape_scene_compile(scene, &model);
    drape_scene_destroy(&scene);
    if (status)
        bench_fail(ctx, "the scene");
    return model;
}

static inline size_t bench_count(const drape_setting *settings)
{
    size_t count = 0;
    while (settings && settings[count].name)
        count++;
    return count;
}

/* A sim of the model. The last setting of an array has no name; NULL: no settings. */
static inline drape_sim *bench_sim(drape_context *ctx, const drape_model *model, const char *integrator,
                                   const drape_setting *settings, const char *controller,
                                   const drape_setting *controller_settings)
{
    drape_sim_def def;
    drape_sim *sim = NULL;
    drape_sim_def_init(&def, sizeof def);
    def.integrator = integrator;
    def.integrator_settings = settings;
    def.integrator_setting_count = bench_count(settings);
    def.controller = controller;
    def.controller_settings = controller_settings;
    def.controller_setting_count = bench_count(controller_settings);
    if (drape_sim_create(ctx, model, &def, &sim))
        bench_fail(ctx, "%s", integrator ? integrator : "the scene's integrator");
    return sim;
}

/* Prints the usage: on stdout for --help, which is no failure, on stderr for a wrong argument. Returns the
 * exit code. */
static inline int bench_usage(const char *argument, const char *text)
{
    bool asked = strcmp(argument, "--help") == 0;
    fputs(text, asked ? stdout : stderr);
    return asked ? 0 : 2;
}

/* Opens a CSV file whose rows begin with machine, commit, compiler and build. NULL if name is NULL. */
static inline FILE *bench_csv(const char *name, const char *columns)
{
    FILE *csv = name ? fopen(name, "w") : NULL;
    if (name && !csv) {
        perror(name);
        exit(1);
    }
    if (csv)
        fprintf(csv, "machine,commit,compiler,build,%s\n", columns);
    return csv;
}

/* The name of the processor as Linux has it, without commas; "unknown" on other systems. */
static inline void bench_processor(char *name, size_t size)
{
    char line[256];
    FILE *info = fopen("/proc/cpuinfo", "r");
    snprintf(name, size, "unknown");
    while (info && fgets(line, sizeof line, info))
        if (strncmp(line, "model name", 10) == 0 && strchr(line, ':')) {
            snprintf(name, size, "%.60s", strchr(line, ':') + 2);
            name[strcspn(name, "\n")] = 0;
            break;
        }
    if (info)
        fclose(info);
    for (char *c = name; (c = strchr(c, ','));)
        *c = ' ';
}

static inline void bench_csv_row(FILE *csv)
{
    struct utsname machine;
    char processor[64];
    const char *commit = getenv("BENCH_COMMIT");
    uname(&machine);
    bench_processor(processor, sizeof processor);
    fprintf(csv, "%s %s %s,%s,%s,%s,", processor, machine.sysname, machine.machine,
            commit ? commit : "unknown", BENCH_COMPILER, BENCH_OPTIONS);
}

/* For qsort, by increasing size. */
static inline int bench_compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

#endif
