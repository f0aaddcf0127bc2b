/* validate.c: runs the cases of a reference. */
#include "lab/validate.h"

#include <gsl/gsl_errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define BISECTIONS 9 /* of a threshold: 1/512 of the interval that it is sought in */

static drape_status watch(void *user, const drape_event *event)
{
    const drape_reference_run *run = user;
    (void)event;
    return run->cancel && run->cancel(run->user) ? DRAPE_RETRY_REJECTED : DRAPE_OK;
}

drape_status drape_reference_open(drape_reference_run *run, const char *text)
{
    char json[DRAPE_LAB_TEXT];
    drape_scene *scene = NULL;
    snprintf(json, sizeof json, "%s", text);
    for (char *c = json; *c; c++)
        *c = *c == '\'' ? '"' : *c;
    drape_status status = drape_scene_parse(run->ctx, json, "reference", &scene);
    if (!status)
        status = drape_scene_compile(scene, &run->model);
    if (!status)
        status = drape_sim_create(run->ctx, run->model, NULL, &run->sim);
    if (!status)
        status = drape_sim_observe(run->sim, watch, run);
    drape_scene_destroy(&scene);
    return status;
}

void drape_reference_close(drape_reference_run *run)
{
    drape_sim_destroy(&run->sim);
    drape_model_destroy(&run->model);
}

/* What all simulations of a case share. */
typedef struct job {
    drape_context *ctx;
    const drape_reference *reference;
    double parameter;
    drape_validate_cancel *cancel;
    void *user;
} job;

static drape_status measure_at(const job *j, double load, double *value)
{
    char text[DRAPE_LAB_TEXT];
    drape_reference_run run = {
        .ctx = j->ctx, .parameter = j->parameter, .cancel = j->cancel, .user = j->user};
    j->reference->scene(j->parameter, load, text, sizeof text);
    drape_status status = drape_reference_open(&run, text);
    if (!status)
        status = j->reference->measure(&run, value);
    drape_reference_close(&run);
    return status;
}

/* Between a load at which the measure is 0 and one at which it is not. */
static drape_status search(const job *j, double expected, double *load)
{
    double low = j->reference->low * expected, high = j->reference->high * expected, value = 0;
    drape_status status = DRAPE_OK;
    for (int k = 0; !status && k < BISECTIONS; k++) {
        *load = (low + high) / 2;
        status = measure_at(j, *load, &value);
        if (value > 0)
            high = *load;
        else
            low = *load;
    }
    *load = (low + high) / 2;
    return status;
}

int drape_validate_runs(const drape_reference *reference)
{
    return reference->high > 0 ? BISECTIONS : 1;
}

static double cpu_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double held_to(const drape_reference *reference, const drape_validation *v)
{
    return reference->documented ? v->documented : v->expected;
}

void drape_validate_judge(const drape_reference *reference, drape_validation *v)
{
    gsl_set_error_handler_off(); /* its default ends the process */
    v->expected = reference->expected(v->parameter);
    v->documented = reference->documented ? reference->documented(v->parameter) : NAN;
    v->error = v->obtained / held_to(reference, v) - 1;
    v->verdict = *v->message                                 ? DRAPE_OUTCOME_STOPPED
                 : !(fabs(v->error) <= reference->tolerance) ? DRAPE_OUTCOME_FAIL
                 : reference->documented                     ? DRAPE_OUTCOME_DOCUMENTED
                                                             : DRAPE_OUTCOME_PASS;
}

drape_status drape_validate(drape_context *ctx, const drape_reference *reference, int index,
                            drape_validate_cancel *cancel, void *user, drape_validation *out)
{
    const double start = cpu_seconds();
    const job j = {ctx, reference, reference->parameters[index], cancel, user};
    *out = (drape_validation){.parameter = j.parameter, .obtained = NAN};
    drape_validate_judge(reference, out);
    drape_status status = reference->high > 0 ? search(&j, held_to(reference, out), &out->obtained)
                                              : measure_at(&j, 0, &out->obtained);
    out->seconds = cpu_seconds() - start;
    if (status && cancel && cancel(user))
        return drape_fail(ctx, DRAPE_E_STOPPED, "interrupted");
    if (status) {
        out->obtained = NAN;
        snprintf(out->message, sizeof out->message, "%s", drape_context_message(ctx));
    }
    drape_validate_judge(reference, out);
    return status == DRAPE_E_MEMORY ? status : DRAPE_OK;
}

const char *drape_outcome_name(drape_outcome verdict)
{
    static const char *const names[] = {[DRAPE_OUTCOME_PASS] = "pass",
                                        [DRAPE_OUTCOME_FAIL] = "FAIL",
                                        [DRAPE_OUTCOME_DOCUMENTED] = "model error",
                                        [DRAPE_OUTCOME_STOPPED] = "STOPPED"};
    return names[verdict];
}
