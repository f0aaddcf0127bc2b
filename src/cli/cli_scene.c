/* cli_scene.c: from a command line to a sim. All errors of the input are found here, before any verb writes a
 * file. */
#include "cli/cli.h"
#include "cli/cli_ranks.h"

#include "io/recorder.h"
#include "model/scene.h"

#include <stdio.h>
#include <sys/stat.h>

int cli_scene_load(const cli_command *command, const char *path, cli_scene *out)
{
    return cli_scene_load_with(command, path, NULL, NULL, out);
}

int cli_scene_load_with(const cli_command *command, const char *path, cli_choose *choose, void *user,
                        cli_scene *s)
{
    drape_sim_def def;
    *s = (cli_scene){.ctx = command->ctx};
    drape_sim_def_init(&def, sizeof def);
    def.threads = command->threads ? command->threads : 1;
    drape_status status = drape_scene_load(s->ctx, path, &s->scene);
    for (size_t i = 0; !status && i < command->setting_count; i++)
        status = drape_scene_set(s->scene, command->settings[i].pointer, command->settings[i].value);
    if (!status)
        status = drape_scene_compile(s->scene, &s->model);
    if (!status && choose)
        status = choose(user, s, &def);
    status = cli_ranks_share(status, s);
    if (!status) {
        status = drape_sim_create(s->ctx, s->model, &def, &s->sim);
        /* compiling a scene does not check the formats: only writers of frames know them */
        for (size_t i = 0; !status && i < s->model->format_count; i++) {
            char pointer[64];
            snprintf(pointer, sizeof pointer, "/output/formats/%zu", i);
            status = drape_recorder_check(s->ctx, s->sim, pointer, s->model->formats[i]);
        }
        if (status && *s->ctx->pointer) /* such as terms that the integrator of the scene does not take */
            drape_scene_locate_fault(s->scene);
    }
    if (cli_interrupted()) /* even if it came after the last check for it */
        return cli_report_interrupted(command->verb);
    return status ? cli_report(command, CLI_BAD_INPUT) : CLI_GO_ON;
}

bool cli_is_folder(const char *path)
{
    struct stat info;
    return stat(path, &info) == 0 && S_ISDIR(info.st_mode);
}

int cli_run_load(const cli_command *command, const char *folder, cli_scene *out, drape_record *run)
{
    char *path = NULL;
    if (command->setting_count > 0)
        return cli_misuse(command->verb,
                          "--%s changes a simulation, and %s is a finished run; give its scene, which is "
                          "simulated again: %s/scene.json",
                          command->settings[0].option, folder, folder);
    const drape_status found = drape_record_scene(command->ctx, folder, &path);
    int code = found == DRAPE_OK ? cli_scene_load(command, path, out)
               : found == DRAPE_E_MEMORY
                   ? cli_report(command, CLI_FAILED)
                   : cli_misuse(command->verb, "%s; `drape run SCENE --out DIR` writes one",
                                drape_context_message(command->ctx));
    drape_free(command->ctx, path);
    if (code == CLI_GO_ON && drape_record_open(command->ctx, folder, out->model->node_count, run))
        code = cli_report(command, CLI_BAD_INPUT);
    return code;
}

void cli_scene_free(cli_scene *scene)
{
    drape_sim_destroy(&scene->sim);
    drape_model_destroy(&scene->model);
    drape_model_destroy(&scene->whole);
    drape_scene_destroy(&scene->scene);
}
