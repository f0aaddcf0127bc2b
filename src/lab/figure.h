/*
 * figure.h: the figures of the experiments, as a column of a paper: 84 mm wide, text of 7 pt and more,
 * as SVG and as PDF with its font embedded by cairo. Where text stands is computed from the widths of its
 * characters, so that legends and labels touch nothing.
 *
 * Colours are those of Okabe and Ito, Color Universal Design (2008), and five more, which people with any
 * form of colour blindness tell apart. An integrator has the same colour and marker in every figure.
 */
#ifndef DRAPE_LAB_FIGURE_H
#define DRAPE_LAB_FIGURE_H

#include "lab/engine.h"

#define LAB_MAX_ENTRIES  64
#define LAB_MAX_VARIANTS 8  /* of the integrators of a figure */
#define LAB_SHADES       64 /* different colours of a scale */

/* Colours that are not those of an integrator. */
#define LAB_BLACK  0x000000
#define LAB_WHITE  0xffffff
#define LAB_GREY   0x999999
#define LAB_DARK   0x4d4d4d
#define LAB_BLUE   0x0072b2
#define LAB_ORANGE 0xe69f00
#define LAB_RED    0xd55e00
#define LAB_PURPLE 0xcc79a7

/* Markers that are not those of an integrator. */
#define LAB_PLUS_MARKER  1
#define LAB_CROSS_MARKER 2
#define LAB_OPEN_MARKER  6

typedef struct lab_style {
    int colour;
    int dash;  /* 1: solid; 0: no line, markers only */
    int point; /* a marker (put_marker); 0: none */
} lab_style;

/* The style of an integrator. Its variants, numbered from 0, have its colour, other dashes and open
 * markers. */
lab_style lab_style_of(const char *integrator, size_t variant);

/* An axis. Names replace the numbers, one for each integer from 0. */
typedef struct lab_axis {
    char label[128];
    double from, to; /* its ends */
    bool log;
    const char *const *names; /* NULL: numbers */
    int name_count;
} lab_axis;

/* Where a value stands, as a share of the axis: 0 at its low end, 1 at its high end, cut far beyond these;
 * and the value at a share. */
double lab_axis_share(const lab_axis *axis, double value);
double lab_axis_value(const lab_axis *axis, double share);

/* Moves the ends outwards by shares. */
void lab_axis_widen(lab_axis *axis, double below, double above);

typedef struct lab_entry {
    char text[96];
    lab_style style;
    bool swatch;  /* an area; otherwise a line with a marker */
    bool hatched; /* the area */
} lab_entry;

typedef struct lab_element {
    int kind;            /* of figure.c */
    size_t first, count; /* its values */
    lab_style style;
} lab_element;

/* A figure while it is made. */
typedef struct lab_figure {
    lab *l;
    char name[96];   /* of its files, without their endings */
    char title[160]; /* "": none */
    lab_axis axes[2];
    lab_axis scale;        /* of the colours of LAB_SCALED boxes, drawn below the frame; to <= from: none */
    double plot_height;    /* [mm] of the frame; default 52 */
    double *values;        /* (used) of all blocks of data; in the arena */
    size_t used, block;    /* block: the first value of the last one */
    lab_element *elements; /* (element_count) in the arena */
    int element_count;
    bool failed; /* out of memory */
    lab_entry legend[LAB_MAX_ENTRIES];
    int entries;
    lab_entry variants[LAB_MAX_VARIANTS]; /* last in the legend */
    int variant_count;
} lab_figure;

/* Begins the figure of that name; the caller sets the ends of its axes. Title and labels: NULL: none. Its
 * files are called as the name is, but for characters other than letters, digits and "-_.", and for long
 * names, where a hash tells names apart. */
void lab_figure_begin(lab *l, lab_figure *f, const char *name, const char *title, const char *x_label,
                      const char *y_label);

/* Begins a block of data, of which the functions below draw the last one; nothing without data. */
void lab_figure_data(lab_figure *f);

/* Adds a point or a box to the last block. NaN makes a gap in a curve. */
void lab_figure_point(lab_figure *f, double x, double y);
void lab_figure_box(lab_figure *f, double left, double right, double bottom, double top, double fill);

/* Points (x, y), joined by lines. text: in the legend; NULL: not there. Returns whether there are any. */
bool lab_figure_curve(lab_figure *f, lab_style style, const char *text);

/* The curve of a series of an integrator, "be" or "be, error control". In the legend variants share an
 * entry for what they have in common, "error control", in black: a name and a dash tell a series. */
bool lab_figure_series(lab_figure *f, const char *integrator, size_t variant, const char *name);

/* How boxes are drawn. */
typedef enum lab_fill {
    LAB_COLOURED, /* their fills are colours */
    LAB_SCALED,   /* shares of the scale: from 0, dark blue, to 1, yellow */
    LAB_HATCHED_BLACK,
    LAB_HATCHED_WHITE
} lab_fill;

void lab_figure_boxes(lab_figure *f, lab_fill fill);

/* A marker in the legend, without a line. */
void lab_figure_marker(lab_figure *f, lab_style style, const char *text);

/* A swatch in the legend; hatched in black or plain. */
void lab_figure_swatch(lab_figure *f, int colour, bool hatched, const char *text);

/* Makes both axes logarithmic and as long as the curves so far, with a margin; orders > 0: makes room below
 * the curves and draws reference lines of slopes 1 to orders there, 2 at most. */
void lab_figure_fit(lab_figure *f, int orders);

/* Writes name.svg and name.pdf, and adds the figure with its caption to the page. Without an element there
 * is no figure. Frees the memory. Errors: DRAPE_E_PARSE (values without a range), DRAPE_E_FILE,
 * DRAPE_E_MEMORY. */
drape_status lab_figure_end(lab *l, lab_figure *f, const char *caption);

#endif
