/* validate.c: runs the cases of a reference. */
#include "lab/validate.h"

#include "base/clock.h"
#include "lab/sheet.h"

#include <gsl/gsl_errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define BISECTIONS 9 /* of a threshold: 1/512 of the interval that it is sought in */

double drape_reference_expected(const drape_reference *reference, double parameter)
{
    for (int i = 0; i < reference->known_count; i++)
        if (reference->known_count == 1 || reference->parameters[i] == parameter)
            return reference->known[i];
    return reference->expected ? reference->expected(parameter) : NAN;
}

int drape_reference_text(const drape_reference_case *c, char text[DRAPE_LAB_TEXT])
{
    const drape_reference *r = c->reference;
    const int length =
        r->scene ? r->scene(c, text) : lab_sheet_text(r->sheet, r->high > 0 ? c->load : c->parameter, text);
    for (char *at = strchr(text, '\''); at; at = strchr(at, '\''))
        *at = '"';
    return length;
}

static drape_status watch(void *user, const drape_event *event)
{
    const drape_reference_run *run = user;
    (void)event;
    return run->cancel && run->cancel(run->user) ? DRAPE_RETRY_REJECTED : DRAPE_OK;
}

/* Runs the scene of a load and measures. */
static drape_status measure_at(drape_reference_run *run, double load, double *value)
{
    const drape_reference *reference = run->reference;
    char json[DRAPE_LAB_TEXT];
    drape_scene *scene = NULL;
    drape_reference_text(&(drape_reference_case){reference, run->parameter, load}, json);
    drape_status status = drape_scene_parse(run->ctx, json, "reference", &scene);
    if (!status)
        status = drape_scene_compile(scene, &run->model);
    if (!status)
        status = drape_sim_create(run->ctx, run->model, NULL, &run->sim);
    if (!status)
        status = drape_sim_observe(run->sim, watch, run);
    if (!status)
        status = reference->measure ? reference->measure(run, value) : lab_advance(run);
    if (!status && reference->value)
        *value = reference->value(run);
    drape_scene_destroy(&scene);
    drape_sim_destroy(&run->sim);
    drape_model_destroy(&run->model);
    drape_arena_free(&run->arena);
    return status;
}

int drape_validate_runs(const drape_reference *reference)
{
    return reference->high > 0 ? BISECTIONS : 1;
}

void drape_validate_judge(const drape_reference *reference, drape_validation *v)
{
    gsl_set_error_handler_off(); /* the default handler ends the process */
    v->expected = drape_reference_expected(reference, v->parameter);
    v->documented = reference->documented ? reference->documented(v->parameter) : NAN;
    v->error = v->obtained / (reference->documented ? v->documented : v->expected) - 1;
    v->verdict = *v->message                                 ? DRAPE_OUTCOME_STOPPED
                 : !(fabs(v->error) <= reference->tolerance) ? DRAPE_OUTCOME_FAIL
                 : reference->documented                     ? DRAPE_OUTCOME_DOCUMENTED
                                                             : DRAPE_OUTCOME_PASS;
}

drape_status drape_validate(drape_context *ctx, const drape_reference *reference, int index,
                            drape_validate_cancel *cancel, void *user, drape_validation *out)
{
    const double start = drape_clock_cpu_seconds();
    drape_reference_run run = {.reference = reference,
                               .ctx = ctx,
                               .arena = drape_arena_of(ctx),
                               .parameter = reference->parameters[index],
                               .cancel = cancel,
                               .user = user};
    drape_status status = DRAPE_OK;
    *out = (drape_validation){.parameter = run.parameter, .obtained = NAN};
    drape_validate_judge(reference, out);
    if (reference->high > 0) {
        /* Bisects between a load at which the measure is 0 and one at which it is not. */
        const double about = reference->documented ? out->documented : out->expected;
        double low = reference->low * about, high = reference->high * about, value = 0;
        for (int k = 0; !status && k < BISECTIONS; k++) {
            out->obtained = (low + high) / 2;
            status = measure_at(&run, out->obtained, &value);
            *(value > 0 ? &high : &low) = out->obtained;
        }
        out->obtained = (low + high) / 2;
    } else
        status = measure_at(&run, 0, &out->obtained);
    out->seconds = drape_clock_cpu_seconds() - start;
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
