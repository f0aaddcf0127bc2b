/* info.h: what a scene models and what it costs, for `drape info`. */
#ifndef DRAPE_CLI_INFO_H
#define DRAPE_CLI_INFO_H

#include "cli/cli.h"

/* Makes an object of the scene that a command loaded, with described values (cli/form.h); derived: also
 * values of meshes and materials that follow from others. What the scene does not model has no key. NULL, or
 * errno is ENOMEM: memory ran out. Errors: DRAPE_E_MEMORY, DRAPE_E_SOLVER, DRAPE_E_STOPPED. */
drape_status cli_info_json(const cli_command *command, const cli_scene *in, bool derived, json_t **out);

#endif
