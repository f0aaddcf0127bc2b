/* validate.c: runs the cases of a reference. */
#include "lab/validate.h"

#include <gsl/gsl_errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define BISECTIONS 9 /* of a threshold: 1/512 of the interval that it is sought in */

drape_status drape_lab_open(drape_context *ctx, const char *text, drape_lab_run *run)
{
    char json[DRAPE_LAB_TEXT];
    drape_scene *scene = NULL;
    *run = (drape_lab_run){.ctx = ctx};
    snprintf(json, sizeof json, "%s", text);
    for (char *c = json; *c; c++)
        *c = *c == '\'' ? '"' : *c;
    drape_status status = drape_scene_parse(ctx, json, "reference", &scene);
    if (!status)
        status = drape_scene_compile(scene, &run->model);
    if (!status)
        status = drape_sim_create(ctx, run->model, NULL, &run->sim);
    drape_scene_destroy(&scene);
    return status;
}

void drape_lab_close(drape_lab_run *run)
{
    drape_sim_destroy(&run->sim);
    drape_model_destroy(&run->model);
}

static drape_status measure_at(drape_context *ctx, const drape_reference *reference, double parameter,
                               double load, double *value)
{
    char text[DRAPE_LAB_TEXT];
    drape_lab_run run;
    reference->scene(parameter, load, text, sizeof text);
    drape_status status = drape_lab_open(ctx, text, &run);
    run.parameter = parameter;
    if (!status)
        status = reference->measure(&run, value);
    drape_lab_close(&run);
    return status;
}

/* Between a load at which the measure is 0 and one at which it is not. */
static drape_status search(drape_context *ctx, const drape_reference *reference, double parameter,
                           double expected, double *load)
{
    double low = reference->low * expected, high = reference->high * expected, value = 0;
    drape_status status = DRAPE_OK;
    for (int k = 0; !status && k < BISECTIONS; k++) {
        *load = (low + high) / 2;
        status = measure_at(ctx, reference, parameter, *load, &value);
        if (value > 0)
            high = *load;
        else
            low = *load;
    }
    *load = (low + high) / 2;
    return status;
}

static double cpu_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

drape_status drape_validate(drape_context *ctx, const drape_reference *reference, int index,
                            drape_validation *out)
{
    const double parameter = reference->parameters[index], start = cpu_seconds();
    gsl_set_error_handler_off(); /* its default ends the process */
    *out = (drape_validation){.parameter = parameter, .obtained = NAN, .error = NAN, .documented = NAN};
    out->expected = reference->expected(parameter);
    if (reference->documented)
        out->documented = reference->documented(parameter);
    const double held_to = reference->documented ? out->documented : out->expected;
    drape_status status = reference->high > 0 ? search(ctx, reference, parameter, held_to, &out->obtained)
                                              : measure_at(ctx, reference, parameter, 0, &out->obtained);
    out->seconds = cpu_seconds() - start;
    if (status) {
        out->obtained = NAN;
        out->verdict = DRAPE_OUTCOME_STOPPED;
        snprintf(out->message, sizeof out->message, "%s", drape_context_message(ctx));
        return status == DRAPE_E_MEMORY ? status : DRAPE_OK;
    }
    out->error = out->obtained / held_to - 1;
    out->verdict = !(fabs(out->error) <= reference->tolerance) ? DRAPE_OUTCOME_FAIL
                   : reference->documented                     ? DRAPE_OUTCOME_DOCUMENTED
                                                               : DRAPE_OUTCOME_PASS;
    return DRAPE_OK;
}

const char *drape_outcome_name(drape_outcome verdict)
{
    static const char *const names[] = {[DRAPE_OUTCOME_PASS] = "pass",
                                        [DRAPE_OUTCOME_FAIL] = "FAIL",
                                        [DRAPE_OUTCOME_DOCUMENTED] = "model error",
                                        [DRAPE_OUTCOME_STOPPED] = "STOPPED"};
    return names[verdict];
}
