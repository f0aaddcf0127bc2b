/* tables.h: the tables of the library, seen alike: rows with a name, a summary, a reference, parameters. */
#ifndef DRAPE_CLI_TABLES_H
#define DRAPE_CLI_TABLES_H

#include "drape/extend.h"

typedef struct cli_row {
    const char *name, *summary;
    const char *reference; /* NULL: none */
    const drape_param *params;
    int param_count;
    bool implied;   /* a term that scenes do not name */
    char text[256]; /* of a summary that is made of numbers */
} cli_row;

typedef struct cli_table {
    const char *name, *title;
    const char *place;                    /* in a scene, in words; NULL: not in scenes */
    bool (*row)(int index, cli_row *row); /* false: past the last */
} cli_table;

extern const cli_table cli_grids, cli_imports, cli_materials, cli_fabrics, cli_terms, cli_colliders,
    cli_self_contacts, cli_contacts, cli_integrators, cli_controllers, cli_linears, cli_exporters, cli_fields,
    cli_shadings;
/* The row of a shading; none where the program was built without drawing. */
bool cli_shading_row(int index, cli_row *row);

extern const cli_table *const cli_tables[]; /* all of them, NULL-ended */

#endif
