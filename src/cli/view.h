/* view.h: a scene that can be changed while it runs, as `drape view` shows it. No window and no OpenGL
 * here. */
#ifndef DRAPE_CLI_VIEW_H
#define DRAPE_CLI_VIEW_H

#include "cli/cli.h"

#define VIEW_MOVABLES 64

/* Values that keys scale. */
typedef enum view_value { VIEW_STIFFNESS, VIEW_DAMPING, VIEW_GRAVITY, VIEW_SCALES } view_value;

/* A collider or a pin of the scene that keys can move. */
typedef struct view_movable {
    char pointer[64]; /* of its track */
    char name[64];
    double displacement[3]; /* [m] at the present time */
} view_movable;

typedef struct cli_view {
    const cli_command *command;
    cli_scene in;
    double factors[VIEW_SCALES]; /* on the values of the scene */
    view_movable movables[VIEW_MOVABLES];
    int movable_count, moved; /* moved: the one that keys move */
    int32_t dragged;          /* node on the drag spring; -1: none */
    double drag_target[3];    /* [m] of the drag spring */
    bool paused;
    int64_t iterations; /* of the last advance */
    double step_seconds;
    char message[200]; /* the last error, or "" */
} cli_view;

/* Loads the scene. CLI_GO_ON, or CLI_BAD_INPUT after the error was printed. cli_scene_free(&v->in) in any
 * case. */
int view_open(const cli_command *command, cli_view *v);

/* Advances by one frame, or one step. If the simulation fails it is paused, with a message. */
void view_advance(cli_view *v, bool one_step);

/* Back to the start, with all changes. */
void view_reset(cli_view *v);

/* Change the scene: true if the model is now a new one, in the same state. A change that the scene refuses
 * leaves everything as it was, with a message. */
bool view_scale(cli_view *v, view_value value, double factor);
bool view_scale_dt(cli_view *v, double factor);
bool view_next_integrator(cli_view *v, int step);
bool view_move(cli_view *v, const double by[3]); /* the chosen movable [m], over a tenth of a second */

/* Drags a node towards a point. node -1 releases it. */
void view_drag(cli_view *v, int32_t node, const double target[3]);

double view_dt(const cli_view *v);
const char *view_integrator(const cli_view *v);

#endif
