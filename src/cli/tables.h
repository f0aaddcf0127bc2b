/* tables.h: the tables that `drape list` shows. */
#ifndef DRAPE_CLI_TABLES_H
#define DRAPE_CLI_TABLES_H

#include "base/registry.h"

const drape_registry *const *cli_tables(void); /* NULL-ended */

#endif
