/* schema.h: the form of a scene as a JSON Schema, draft 2020-12, from the tables that the reader uses. */
#ifndef DRAPE_CLI_SCHEMA_H
#define DRAPE_CLI_SCHEMA_H

#include <jansson.h>

json_t *cli_schema(void); /* a new reference; NULL: out of memory */

#endif
