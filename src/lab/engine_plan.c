/*
 * engine_plan.c: see engine.h.
 *
 * The sample is a Weyl sequence of the golden ratio over the numbers of the cases: its first points are
 * spread as evenly as any number of points can be (Knuth, The Art of Computer Programming 3, 6.4), also over
 * each axis of a map, whose length a constant stride might divide.
 *
 * Costs differ most between integrators and scenes. So each of these is a stratum, whose total is the number
 * of its cases times the mean of its sample (Cochran, Sampling Techniques, 1977, 5.3); the strata of which
 * fewer than two cases are in the sample are one. The interval is Student's, and no total is less than what
 * the sample took.
 */
#include "lab/engine.h"

#include "lab/engine_output.h"
#include "lab/fit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#define GOLDEN     0.6180339887498949
#define MAX_STRATA 256
/* Memory that a result takes, over the length of its line: measured with lines of 0.75 KB, by the largest
 * memory of a sweep of 10 000 cases. */
#define MEMORY_OF_TEXT 5.0

/* ---- The sample ---- */

size_t lab_plan_sample(lab *l, size_t *cases)
{
    size_t ours = 0, count = 0;
    for (size_t i = 0; i < l->count; i++)
        if (lab_is_ours(l, i))
            cases[ours++] = i;
    size_t *order = drape_arena_take(&l->arena, l->count, sizeof *order);
    if (!order || (size_t)l->def->plan >= ours)
        return ours;
    for (size_t k = 0; count < (size_t)l->def->plan; k++) {
        size_t *at = &cases[(size_t)((double)ours * fmod(0.5 + (double)k * GOLDEN, 1))];
        if (*at == l->count) /* it is in the sample already */
            continue;
        order[count++] = *at;
        *at = l->count;
    }
    memcpy(cases, order, count * sizeof *cases);
    return count;
}

/* ---- Totals ---- */

/* Cases of one integrator and one scene; of the sample: number, sum and sum of squares of the CPU times. */
typedef struct stratum {
    const char *integrator, *scene;
    double cases, count, sum, squares;
} stratum;

static stratum *stratum_of(stratum *strata, size_t *count, const json_t *one)
{
    const char *integrator = lab_tag_text(one, "integrator"), *scene = lab_tag_text(one, "scene");
    for (size_t i = 0; i < *count; i++)
        if (strcmp(strata[i].integrator, integrator) == 0 && strcmp(strata[i].scene, scene) == 0)
            return &strata[i];
    if (*count == MAX_STRATA)
        return &strata[MAX_STRATA - 1];
    strata[*count] = (stratum){.integrator = integrator, .scene = scene};
    return &strata[(*count)++];
}

typedef struct total {
    double value, low, high; /* bounds of the 95 % confidence interval; NaN: the sample is too small */
} total;

/* strata (count + 1): the last one becomes that of those with a small sample. */
static total total_cpu(stratum *strata, size_t count)
{
    stratum *rest = &strata[count];
    double sum = 0, variance = 0, freedom = 0, spent = 0, sampled = 0;
    *rest = (stratum){.cases = 0};
    for (stratum *s = strata; s < rest; s++) {
        spent += s->sum;
        sampled += s->count;
        if (s->count >= 2)
            continue;
        rest->cases += s->cases;
        rest->count += s->count;
        rest->sum += s->sum;
        rest->squares += s->squares;
    }
    for (const stratum *s = strata; s <= rest; s++) { /* the total of each and its variance */
        if (s->count < 1 || (s < rest && s->count < 2))
            continue;
        const double mean = s->sum / s->count;
        const double spread = fmax(0, s->squares - s->count * mean * mean) / fmax(1, s->count - 1);
        sum += s->cases * mean;
        variance += s->cases * s->cases * (1 - s->count / s->cases) * spread / s->count;
        freedom += s->count - 1;
    }
    if (rest->count < 1 && rest->cases > 0) /* a stratum without a sample costs as the mean of all others */
        sum += rest->cases * spent / fmax(1, sampled);
    const double half = freedom >= 1 ? lab_student(freedom) * sqrt(variance) : NAN;
    return (total){sum, fmax(spent, sum - half), sum + half};
}

static double file_bytes(const lab *l, const char *name)
{
    char path[4200];
    struct stat info;
    snprintf(path, sizeof path, "%s/%s", l->folder, name);
    return stat(path, &info) ? 0 : (double)info.st_size;
}

/* ---- The plan ---- */

typedef struct plan {
    size_t cases, sampled; /* of this shard; of these */
    total cpu;             /* [s] of all of them */
    double elapsed;        /* [s] on so many free cores as there are jobs */
    int jobs;
    double memory, disk; /* [bytes] */
} plan;

static plan make_plan(const lab *l, const size_t *sample, size_t sampled)
{
    stratum strata[MAX_STRATA + 1];
    size_t count = 0;
    double lines = 0, rows = 0;
    plan p = {.sampled = 0, .jobs = l->def->jobs};
    for (size_t i = 0; i < l->count; i++) {
        rows += l->results[i] != NULL;
        if (!lab_is_ours(l, i))
            continue;
        stratum_of(strata, &count, json_array_get(l->cases, i))->cases++;
        p.cases++;
    }
    for (size_t k = 0; k < sampled; k++) {
        const json_t *r = l->results[sample[k]];
        if (!r) /* left out: the budget was used up */
            continue;
        stratum *s = stratum_of(strata, &count, r);
        const double cpu = lab_number(r, "case_cpu_s");
        char *text = json_dumps(r, JSON_COMPACT | JSON_REAL_PRECISION(17));
        lines += text ? (double)strlen(text) + 1 : 0;
        free(text);
        s->count++;
        s->sum += cpu;
        s->squares += cpu * cpu;
        p.sampled++;
    }
    const double n = (double)p.cases, part = fmax(1, (double)p.sampled);
    const long cores = sysconf(_SC_NPROCESSORS_ONLN);
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    p.cpu = total_cpu(strata, count);
    p.elapsed = p.cpu.value / fmax(1, fmin(p.jobs, (double)cores));
    p.memory = 1024.0 * (double)usage.ru_maxrss + MEMORY_OF_TEXT * lines * (n / part - 1);
    /* The table will have a row for each case, also for those that are the same as another; now it has one
     * for each that is stored, which may be more than the sample. */
    const double shards = l->def->shards;
    p.disk = file_bytes(l, "experiment.json") + lines * n / part +
             (shards > 1 ? 0 : file_bytes(l, "results.csv") * (double)l->count / fmax(1, rows));
    return p;
}

/* "3.2 hours" */
static void time_text(double s, char text[32])
{
    if (s < 120)
        snprintf(text, 32, "%.3g s", s);
    else if (s < 7200)
        snprintf(text, 32, "%.3g minutes", s / 60);
    else if (s < 172800)
        snprintf(text, 32, "%.3g hours", s / 3600);
    else
        snprintf(text, 32, "%.3g days", s / 86400);
}

drape_status lab_write_plan(lab *l)
{
    char cpu[32], low[32], high[32], elapsed[32];
    size_t *sample = drape_arena_take(&l->arena, l->count, sizeof *sample);
    if (!sample)
        return DRAPE_E_MEMORY;
    const plan p = make_plan(l, sample, lab_plan_sample(l, sample));
    time_text(p.cpu.value, cpu);
    time_text(p.cpu.low, low);
    time_text(p.cpu.high, high);
    time_text(p.elapsed, elapsed);
    fprintf(l->summary, "plan      from %zu of %zu cases that are to be run: %s of CPU", p.sampled, p.cases,
            p.sampled ? cpu : "unknown");
    if (!isnan(p.cpu.high))
        fprintf(l->summary, " (95 %% confidence %s to %s)", low, high);
    fprintf(l->summary, ", %s with %d at a time on free cores\n", p.sampled ? elapsed : "unknown", p.jobs);
    fprintf(l->summary,
            "          %.3g MB of memory, %.3g MB on disk besides figures and page\n"
            "          the same command without --plan keeps these cases and runs the others\n",
            1e-6 * p.memory, 1e-6 * p.disk);
    const struct {
        const char *key;
        double value;
    } reals[] = {{"cpu_s", p.cpu.value},   {"cpu_low_s", p.cpu.low},   {"cpu_high_s", p.cpu.high},
                 {"elapsed_s", p.elapsed}, {"memory_bytes", p.memory}, {"disk_bytes", p.disk}};
    json_t *all = json_pack("{s:I, s:I, s:i}", "cases", (json_int_t)p.cases, "sampled", (json_int_t)p.sampled,
                            "jobs", p.jobs);
    for (size_t i = 0; i < sizeof reals / sizeof *reals; i++)
        json_object_set_new(all, reals[i].key, drape_json_number(reals[i].value));
    return lab_write_json(l, "plan.json", all, JSON_INDENT(1) | JSON_REAL_PRECISION(6));
}
