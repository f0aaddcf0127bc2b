/* view.h: a scene that is open to changes while it runs: what `drape view` shows. No window and no OpenGL here. */
#ifndef DRAPE_CLI_VIEW_H
#define DRAPE_CLI_VIEW_H

#include "cli/cli.h"

#define VIEW_MOVABLES 64

/* A collider, or the pins of one line of the scene. */
typedef struct view_movable {
    char pointer[64]; /* of its track */
    char name[64];
    double displacement[3]; /* [m] that it has, or is on its way to */
} view_movable;

typedef struct cli_view {
    const cli_command *command;
    cli_scene in;
    double stiffness, damping, gravity; /* factors on what the scene says */
    double dt;                          /* [s]; 0: the scene's */
    int integrator;                     /* index of its row; -1: the scene's */
    view_movable movables[VIEW_MOVABLES];
    int movable_count, moved; /* moved: the one that is moved by keys */
    int32_t pulled;           /* node; -1: none */
    double pull[3];           /* [m] target */
    bool paused;
    int64_t iterations; /* of the last advance */
    double step_seconds;
    char message[200]; /* the last fault, or "" */
} cli_view;

/* Loads the scene. CLI_GO_ON, or CLI_BAD_INPUT after the fault was printed. view_free in any case. */
int view_open(const cli_command *command, cli_view *v);
void view_free(cli_view *v);

/* One frame, or one step. A simulation that stops is paused, with a message. */
void view_advance(cli_view *v, bool one_step);

/* The start again, with all that was changed. */
void view_reset(cli_view *v);

/* Changes of what is simulated: true if the model is another one now, in the same state. A change that the scene does
 * not take leaves all as it was, with a message. */
bool view_scale_stiffness(cli_view *v, double factor);
bool view_scale_damping(cli_view *v, double factor);
bool view_scale_gravity(cli_view *v, double factor);
bool view_scale_dt(cli_view *v, double factor);
bool view_next_integrator(cli_view *v, int step);
bool view_move(cli_view *v, const double way[3]); /* the chosen movable [m], over a tenth of a second */

/* Drags a node to a point. node -1 lets go. */
void view_pull(cli_view *v, int32_t node, const double target[3]);

double view_dt(const cli_view *v);
const char *view_integrator(const cli_view *v);

#endif
