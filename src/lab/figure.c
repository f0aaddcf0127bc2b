/* figure.c: see figure.h. */
#include "lab/figure.h"

#include "base/hash.h"
#include "base/pi.h"
#include "lab/engine_output.h"

#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <ctype.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Lengths [mm], and places from the lower left corner of the page. */
#define WIDTH       84.0 /* a column of a paper */
#define POINT       (25.4 / 72)
#define EM          (7.5 * POINT)
#define PLOT_HEIGHT 52.0
#define RIGHT       3.0
#define TOP         2.5
#define TITLE       4.5  /* height of a title */
#define TICK        1.4  /* length of a tick, with the space after it */
#define LINE        3.6  /* of the legend */
#define SAMPLE      7.0  /* of a line or swatch in the legend, with the space after it */
#define GAP         3.0  /* between columns of the legend */
#define BAR         2.6  /* height of the scale of colours */
#define THICK       0.32 /* curves */
#define THIN        0.16 /* frame and ticks */
#define WIDEST_NAME 34.0 /* of a tick */
#define FAR         1e4
#define HATCHING    1.5 /* between the lines of a hatch, along the axes */
#define HAIR        0.03

/* ---- Styles ---- */

/* Okabe and Ito 2008, without yellow, which is too pale for lines on white, and five colours found by a
 * search for those that differ most from these, from each other, from white and from the grey of reference
 * lines: by 26 or more in CIELAB, also as people with deuteranopia and protanopia see them (Machado et al.
 * 2009). */
static const int colours[] = {LAB_BLUE,   LAB_RED,  0x009e73, LAB_BLACK, LAB_ORANGE, 0x56b4e9,
                              LAB_PURPLE, 0x440099, 0x663311, 0x88bb66,  0x225555,   0x2255ee};
static const int points[] = {7,  5,  9, 13,
                             11, 15, 2}; /* filled markers (put_marker); one less: the open one */

lab_style lab_style_of(const char *integrator, size_t variant)
{
    const int colour_count = sizeof colours / sizeof *colours, point_count = sizeof points / sizeof *points;
    int k = 0;
    for (int i = 0; drape_integrators[i] && strcmp(drape_integrators[i]->entry.name, integrator) != 0; i++)
        k += !drape_integrators[i]->steady_state;
    return (lab_style){colours[k % colour_count], 1 + (int)variant % 5,
                       points[(k + k / point_count) % point_count] - (variant > 0)};
}

/* From dark blue to the yellow of Okabe and Ito: lightness rises evenly, by 9 of CIELAB a colour, so that
 * the order of values is seen without hues and in print without colours, too. The colours of verdicts that
 * stand on the same map (orange, red, dark grey) differ from all of it by more than 15, for people with
 * deuteranopia and protanopia as well. */
static const int scale_colours[] = {0x102070, 0x1d3b77, 0x2e557b, 0x446e7d, 0x5e877b,
                                    0x7d9f75, 0x9fb76b, 0xc5ce5c, 0xf0e442};

/* ---- The page ---- */

/* The width of a text [mm]: DejaVu Sans [em / 1000], the widest of the usual fonts without serifs; other
 * characters are counted as 1 em. */
static double text_width(const char *text)
{
    static const short widths[] = {
        318, 401, 460, 838, 636, 950, 780, 275, 390, 390, 500, 838, 318, 361,  318, 337, 636, 636, 636,
        636, 636, 636, 636, 636, 636, 636, 337, 337, 838, 838, 838, 531, 1000, 684, 686, 698, 770, 632,
        575, 775, 752, 295, 295, 656, 557, 863, 748, 787, 603, 787, 695, 635,  611, 732, 684, 989, 685,
        611, 685, 390, 337, 390, 838, 500, 500, 613, 635, 550, 635, 615, 352,  635, 634, 278, 278, 579,
        278, 974, 634, 612, 635, 635, 411, 521, 392, 634, 592, 818, 592, 592,  525, 636, 337, 636, 838};
    double sum = 0;
    for (; *text; text++)
        if ((*text & 0xc0) != 0x80) /* not within a character of UTF-8 */
            sum += *text >= ' ' && *text <= '~' ? widths[*text - ' '] : 1000;
    return sum * 1e-3 * EM;
}

/* A page: cairo has points from the upper left corner. Text is data for it, which nothing interprets. */
typedef struct page {
    cairo_t *cairo;
    double height;
} page;

static double across(double x)
{
    return x / POINT;
}

static double down(const page *p, double y)
{
    return (p->height - y) / POINT;
}

static void set_colour(const page *p, int colour)
{
    cairo_set_source_rgb(p->cairo, (colour >> 16 & 255) / 255.0, (colour >> 8 & 255) / 255.0,
                         (colour & 255) / 255.0);
}

/* Lines through points x, y; NaN is a gap. */
static void put_line(const page *p, const double *xy, size_t count, int colour, double width, int dash)
{
    static const double dashes[][6] = {{3, 2.6}, {1, 2}, {4.5, 1.8, 1, 1.8}, {4.5, 1.5, 1, 1.5, 1, 1.5}};
    static const int pieces[] = {2, 2, 4, 6};
    const int kind = dash < 2 || dash > 5 ? -1 : dash - 2;
    for (size_t i = 0; i < count; i++)
        if (i == 0 || isnan(xy[2 * i - 2]))
            cairo_move_to(p->cairo, across(xy[2 * i]), down(p, xy[2 * i + 1]));
        else if (!isnan(xy[2 * i]))
            cairo_line_to(p->cairo, across(xy[2 * i]), down(p, xy[2 * i + 1]));
    set_colour(p, colour);
    cairo_set_line_width(p->cairo, across(width));
    cairo_set_dash(p->cairo, kind < 0 ? NULL : dashes[kind], kind < 0 ? 0 : pieces[kind], 0);
    cairo_stroke(p->cairo);
}

static void put_box(const page *p, double left, double bottom, double right, double top, int colour)
{
    cairo_rectangle(p->cairo, across(left), down(p, top), across(right - left), across(top - bottom));
    set_colour(p, colour);
    cairo_fill(p->cairo);
}

/* Lines x - y = a multiple of the distance, so that the hatches of neighbouring boxes join. */
static void put_hatch(const page *p, double left, double bottom, double right, double top, int colour)
{
    for (double k = ceil((left - top) / HATCHING); k * HATCHING < right - bottom; k++) {
        const double offset = k * HATCHING, from = fmax(left, bottom + offset),
                     to = fmin(right, top + offset);
        if (to > from)
            put_line(p, (double[]){from, from - offset, to, to - offset}, 2, colour, THICK, 1);
    }
}

/* A marker, by its number: 1 plus, 2 cross; 4 square, 6 circle, 8 and 10 triangles, 12 diamond, 14
 * pentagon, and the next number of each for the filled one. */
static void put_marker(const page *p, double x, double y, lab_style s)
{
    static const struct {
        int corners;
        double turn; /* of the first one */
    } shapes[] = {{4, DRAPE_PI / 4},  {20, 0},           {3, DRAPE_PI / 2},
                  {3, -DRAPE_PI / 2}, {4, DRAPE_PI / 2}, {5, DRAPE_PI / 2}};
    const double r = s.dash ? 0.4 : 0.55, q = s.point == 1 ? 0 : r; /* larger where no line shows the place */
    if (s.point < 4) {
        put_line(p, (double[]){x - r, y - q, x + r, y + q, NAN, NAN, x - q, y + r, x + q, y - r}, 5, s.colour,
                 THIN, 1);
        return;
    }
    const int corners = shapes[s.point / 2 - 2].corners;
    for (int i = 0; i < corners; i++) {
        const double angle = shapes[s.point / 2 - 2].turn + 2 * DRAPE_PI * i / corners;
        const double size = corners > 5 ? r : 1.35 * r; /* areas alike */
        (i ? cairo_line_to : cairo_move_to)(p->cairo, across(x + size * cos(angle)),
                                            down(p, y + size * sin(angle)));
    }
    cairo_close_path(p->cairo);
    set_colour(p, s.colour);
    cairo_set_line_width(p->cairo, across(THIN));
    cairo_set_dash(p->cairo, NULL, 0, 0);
    (s.point % 2 ? cairo_fill : cairo_stroke)(p->cairo);
}

typedef enum anchor { START, MIDDLE, END, UPRIGHT /* the middle, read from below */ } anchor;

/* A text, centred in height at y, and an exponent behind it (NULL: none). A text that is longer than the
 * width for it ends with dots. */
static void put_text(const page *p, double x, double y, anchor at, const char *text, double room,
                     const char *exponent)
{
    static const double shares[] = {0, 0.5, 1, 0.5};
    char cut[200];
    snprintf(cut, sizeof cut, "%.190s", text);
    drape_make_printable(cut);
    for (size_t end = strlen(cut); end > 0 && text_width(cut) > room; snprintf(cut + end, 4, "..."))
        while (--end > 0 && (cut[end] & 0xc0) == 0x80)
            continue;
    json_t *valid = drape_json_text(cut); /* cut within a character, it was not UTF-8 */
    const char *shown = valid ? json_string_value(valid) : "";
    cairo_text_extents_t first, second = {0};
    if (exponent)
        cairo_text_extents(p->cairo, exponent, &second);
    cairo_text_extents(p->cairo, shown, &first);
    cairo_save(p->cairo);
    set_colour(p, LAB_BLACK);
    cairo_translate(p->cairo, across(x), down(p, y));
    cairo_rotate(p->cairo, at == UPRIGHT ? -DRAPE_PI / 2 : 0);
    cairo_move_to(p->cairo, -shares[at] * (first.x_advance + second.x_advance), across(0.36 * EM));
    cairo_show_text(p->cairo, shown);
    cairo_rel_move_to(p->cairo, 0, across(-0.45 * EM));
    if (exponent)
        cairo_show_text(p->cairo, exponent);
    cairo_new_path(p->cairo);
    cairo_restore(p->cairo);
    json_decref(valid);
}

/* ---- Axes ---- */

static double ends_ratio(const lab_axis *a)
{
    return a->log ? log10(a->to) - log10(a->from) : a->to - a->from;
}

double lab_axis_share(const lab_axis *a, double value)
{
    const double share = (a->log ? log10(value) - log10(a->from) : value - a->from) / ends_ratio(a);
    return isnan(share) ? NAN : fmin(FAR, fmax(-FAR, share));
}

double lab_axis_value(const lab_axis *a, double share)
{
    return a->log ? a->from * pow(a->to / a->from, share) : a->from + share * (a->to - a->from);
}

void lab_axis_widen(lab_axis *a, double below, double above)
{
    const lab_axis before = *a;
    a->from = lab_axis_value(&before, -below);
    a->to = lab_axis_value(&before, 1 + above);
}

/* Whether the ends can be drawn: values of a file may be so large or small that they have no range. */
static bool has_range(const lab_axis *a)
{
    return isfinite(a->from) && isfinite(ends_ratio(a)) && ends_ratio(a) > 0 && (!a->log || a->from > 0);
}

/* An axis on a page: its low end, and its length to the right or up. Ticks stand outside. */
typedef struct ruler {
    const page *p;
    const lab_axis *axis;
    double x, y, length;
    bool upright;
} ruler;

/* power: of ten, whose exponent is the text. */
static void put_tick(const ruler *r, double value, const char *text, bool power)
{
    const double at = r->length * lab_axis_share(r->axis, value), size = *text ? 1 : 0.5;
    const double x = r->x + (r->upright ? 0 : at), y = r->y + (r->upright ? at : 0);
    if (r->axis->name_count == 0)
        put_line(r->p, (double[]){x, y, x - r->upright * size, y - !r->upright * size}, 2, LAB_BLACK, THIN,
                 1);
    if (*text)
        put_text(r->p, x - r->upright * TICK, y - !r->upright * (TICK + 0.85 * EM), r->upright ? END : MIDDLE,
                 power ? "10" : text, WIDEST_NAME, power ? text : NULL);
}

/* Powers of ten, at most about six; between them ticks without numbers, unless powers are left out. If
 * there is at most one, 1, 2 and 5 times such a power, or over less than a factor of 10 also 3 times, of 4
 * all multiples. */
static void put_log_ticks(const ruler *r)
{
    const lab_axis *a = r->axis;
    const int first = (int)floor(log10(a->from)), last = (int)ceil(log10(a->to));
    const int powers = (int)floor(log10(a->to) + 1e-9) - (int)ceil(log10(a->from) - 1e-9) + 1;
    const int stride = 1 + (powers - 1) / 6;
    for (int k = first; k <= last; k++)
        for (int digit = 1; digit < (stride > 2 ? 2 : 10); digit++) {
            const double value = digit * pow(10, k);
            const bool numbered = powers > 1 ? digit == 1 && (k - first) % stride == 0
                                             : a->to < 4 * a->from || (digit == 3 && a->to < 10 * a->from) ||
                                                   digit == 1 || digit == 2 || digit == 5;
            char text[32] = "";
            if (value < a->from * (1 - 1e-9) || value > a->to * (1 + 1e-9))
                continue;
            if (numbered && powers > 1)
                snprintf(text, sizeof text, "%d", k);
            else if (numbered)
                snprintf(text, sizeof text, "%g", value);
            put_tick(r, value, text, numbered && powers > 1);
        }
}

/* Multiples of 1, 2 or 5 times a power of ten, at most seven. */
static void put_linear_ticks(const ruler *r)
{
    const lab_axis *a = r->axis;
    const double raw = (a->to - a->from) / 6, size = pow(10, floor(log10(raw)));
    const double step = raw <= size       ? size
                        : raw <= 2 * size ? 2 * size
                        : raw <= 5 * size ? 5 * size
                                          : 10 * size;
    const double first = ceil(a->from / step - 1e-9);
    for (int i = 0; i < 7 && (first + i) * step <= a->to + 1e-9 * step; i++) {
        char text[32];
        snprintf(text, sizeof text, "%g", (first + i) * step + 0.0); /* not -0 */
        put_tick(r, (first + i) * step, text, false);
    }
}

static void put_axis(const page *p, const lab_axis *a, double x, double y, double length, bool upright)
{
    const ruler r = {p, a, x, y, length, upright};
    for (int i = 0; i < a->name_count; i++)
        put_tick(&r, i, a->names[i], false);
    if (a->name_count == 0 && a->log)
        put_log_ticks(&r);
    else if (a->name_count == 0)
        put_linear_ticks(&r);
}

/* ---- Elements ---- */

/* Kinds of elements, in the order of the page's layers for the same block. */
enum { CURVE, ORDER /* the number at the end of a line of that order */, BOXES /* + lab_fill */ };

/* Room for one more of `count` members; NULL: out of memory, which the end of the figure reports. */
static void *grow(lab_figure *f, void *memory, size_t count, size_t size)
{
    void *grown = memory;
    if ((count & (count - 1)) == 0) /* 0 or a power of two */
        grown = drape_arena_resize(&f->l->arena, memory, count ? 2 * count : 1, size);
    f->failed |= !grown;
    return f->failed ? NULL : grown;
}

void lab_figure_begin(lab *l, lab_figure *f, const char *name, const char *title, const char *x_label,
                      const char *y_label)
{
    *f = (lab_figure){.l = l, .plot_height = PLOT_HEIGHT};
    snprintf(f->title, sizeof f->title, "%s", title ? title : "");
    snprintf(f->axes[0].label, sizeof f->axes[0].label, "%s", x_label ? x_label : "");
    snprintf(f->axes[1].label, sizeof f->axes[1].label, "%s", y_label ? y_label : "");
    snprintf(f->name, sizeof f->name - 17, "%s", name);
    for (char *at = f->name; *at; at++)
        if ((unsigned char)*at > 127 || (!isalnum(*at) && (at == f->name || !strchr("-_.", *at))))
            *at = '_';
    if (strcmp(f->name, name) != 0) { /* another name could become the same */
        const size_t end = strlen(f->name);
        snprintf(f->name + end, sizeof f->name - end, "_%016llx",
                 (unsigned long long)drape_hash_bytes(DRAPE_HASH_START, name, strlen(name)));
    }
}

void lab_figure_data(lab_figure *f)
{
    f->block = f->used;
}

static void put_values(lab_figure *f, const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        double *grown = grow(f, f->values, f->used, sizeof *grown);
        if (!grown)
            return;
        f->values = grown;
        f->values[f->used++] = values[i];
    }
}

void lab_figure_point(lab_figure *f, double x, double y)
{
    put_values(f, (double[]){x, y}, 2);
}

void lab_figure_box(lab_figure *f, double left, double right, double bottom, double top, double fill)
{
    put_values(f, (double[]){left, right, bottom, top, fill}, 5);
}

/* Of the last block; not without data. */
static bool add_element(lab_figure *f, int kind, lab_style style)
{
    if (f->failed || f->used == f->block)
        return false;
    lab_element *elements = grow(f, f->elements, (size_t)f->element_count, sizeof *elements);
    if (!elements)
        return false;
    f->elements = elements;
    f->elements[f->element_count++] = (lab_element){kind, f->block, f->used - f->block, style};
    return true;
}

static void add_entry(lab_figure *f, lab_entry entry, const char *text)
{
    const bool full = f->entries == LAB_MAX_ENTRIES;
    if (!full)
        f->legend[f->entries++] = entry;
    snprintf(f->legend[f->entries - 1].text, sizeof entry.text, "%s", full ? "and others" : text);
}

bool lab_figure_curve(lab_figure *f, lab_style style, const char *text)
{
    const bool there = add_element(f, CURVE, style);
    if (there && text)
        lab_figure_marker(f, style, text);
    return there;
}

static bool is_in(const lab_entry *entries, int count, const char *text, size_t length)
{
    for (int i = 0; i < count; i++)
        if (strncmp(entries[i].text, text, length) == 0 &&
            (entries[i].text[length] == 0 || entries[i].text[length] == ','))
            return true;
    return false;
}

bool lab_figure_series(lab_figure *f, const char *integrator, size_t variant, const char *name)
{
    const lab_style style = lab_style_of(integrator, variant);
    const char *comma = strchr(name, ',');
    if (variant == 0 || !comma || !is_in(f->legend, f->entries, integrator, strlen(integrator)))
        return lab_figure_curve(f, style, name);
    if (!lab_figure_curve(f, style, NULL))
        return false;
    const char *what = comma + 1 + strspn(comma + 1, " ");
    if (f->variant_count == LAB_MAX_VARIANTS || is_in(f->variants, f->variant_count, what, strlen(what)))
        return true;
    lab_entry *entry = &f->variants[f->variant_count++];
    *entry = (lab_entry){.style = {LAB_BLACK, style.dash, LAB_OPEN_MARKER}};
    snprintf(entry->text, sizeof entry->text, "%s", what);
    return true;
}

void lab_figure_boxes(lab_figure *f, lab_fill fill)
{
    add_element(f, BOXES + (int)fill,
                (lab_style){.colour = fill == LAB_HATCHED_WHITE ? LAB_WHITE : LAB_BLACK});
}

/* The lowest of all points of curves to the right of `left`. Widens axes to contain all points; NULL: does
 * not. */
static double lowest_point(const lab_figure *f, double left, lab_axis axes[2])
{
    double lowest = INFINITY;
    for (int e = 0; e < f->element_count; e++) {
        const double *xy = f->values + f->elements[e].first, *end = xy + f->elements[e].count;
        for (; xy < end; xy += 2) {
            lowest = xy[0] > left ? fmin(lowest, xy[1]) : lowest;
            for (int k = 0; axes && k < 2; k++) {
                axes[k].from = fmin(axes[k].from, xy[k]);
                axes[k].to = fmax(axes[k].to, xy[k]);
            }
        }
    }
    return lowest;
}

void lab_figure_fit(lab_figure *f, int orders)
{
    lab_axis *x = &f->axes[0], *y = &f->axes[1];
    const double margin = 0.04;
    if (f->element_count == 0)
        return;
    x->log = y->log = true;
    x->from = y->from = INFINITY;
    x->to = y->to = 0;
    lowest_point(f, 0, f->axes);
    /* A single value is given a decade. */
    for (lab_axis *a = x; a <= y; a++) {
        const double widen = a->to > a->from ? pow(a->to / a->from, margin) : sqrt(10);
        a->from = fmax(a->from / widen, DBL_MIN);
        a->to = fmin(a->to * widen, DBL_MAX);
    }
    if (orders == 0)
        return;
    /* The lines of orders 1 and 2 begin at (left, low); their ends, and the numbers at these, are 4 mm
     * apart. */
    const double span = fmax(0.15 * ends_ratio(x), 4 / f->plot_height * ends_ratio(y));
    const double right = x->to * pow(10, -0.07 * ends_ratio(x)), left = right * pow(10, -span);
    /* A point to the left counts, too: from there a line may come down. */
    const double top = lowest_point(f, left / 2.5, NULL);
    const double space = pow(10, 3.5 / f->plot_height * ends_ratio(y));
    const double low = top / space * pow(10, -orders * span);
    y->from = fmin(y->from, low / space);
    for (int order = 1; order <= orders; order++) {
        const double end = low * pow(10, order * span);
        lab_figure_data(f);
        lab_figure_point(f, left, low);
        lab_figure_point(f, right, end);
        lab_figure_curve(f, (lab_style){LAB_GREY, 2, 0},
                         order > 1     ? NULL
                         : orders == 1 ? "slope 1"
                                       : "slopes 1 and 2");
        add_element(f, ORDER, (lab_style){.point = order});
    }
}

void lab_figure_marker(lab_figure *f, lab_style style, const char *text)
{
    add_entry(f, (lab_entry){.style = style}, text);
}

void lab_figure_swatch(lab_figure *f, int colour, bool hatched, const char *text)
{
    add_entry(f, (lab_entry){.style = {.colour = colour}, .swatch = true, .hatched = hatched}, text);
}

/* ---- Drawing ---- */

/* The frame and the legend below it. */
typedef struct layout {
    double left, bottom, height; /* of the frame: its corner; of the whole */
    double scale;                /* bottom of the bar of the scale */
    double legend;               /* height of the legend */
    double column;               /* width */
    int columns, rows;
} layout;

static bool has_scale(const lab_figure *f)
{
    return f->scale.to > f->scale.from;
}

static void put_legend(const lab_figure *f, const layout *at, const page *p)
{
    for (int i = 0; i < f->entries; i++) {
        const lab_entry *e = &f->legend[i];
        const double x = 1 + at->column * (i / at->rows), end = x + SAMPLE - 1.2,
                     y = 1 + LINE * (at->rows - 1 - i % at->rows) + 0.5 * LINE;
        if (e->swatch) {
            put_box(p, x, y - 0.9, end, y + 0.9, e->style.colour);
            if (e->hatched)
                put_hatch(p, x, y - 0.9, end, y + 0.9, LAB_BLACK);
        } else if (e->style.dash)
            put_line(p, (double[]){x, y, end, y}, 2, e->style.colour, THICK, e->style.dash);
        if (!e->swatch && e->style.point)
            put_marker(p, 0.5 * (x + end), y, e->style);
        put_text(p, x + SAMPLE, y, START, e->text, WIDTH - x - SAMPLE, NULL);
    }
}

static int scale_colour(double share)
{
    const int count = sizeof scale_colours / sizeof *scale_colours;
    const double place = fmin(1, fmax(0, share)) * (count - 1);
    const int k = (int)fmin(count - 2, floor(place));
    int colour = 0;
    for (int shift = 0; shift <= 16; shift += 8) {
        const int low = scale_colours[k] >> shift & 255, high = scale_colours[k + 1] >> shift & 255;
        colour |= (int)lround(low + (place - k) * (high - low)) << shift;
    }
    return colour;
}

static void put_frame(const page *p, double left, double bottom, double right, double top)
{
    put_line(p, (double[]){left, bottom, right, bottom, right, top, left, top, left, bottom, right, bottom},
             6, LAB_BLACK, THIN, 1);
}

/* Where a point of the axes is on the page. */
static void place(const lab_figure *f, const layout *at, double x, double y, double out[2])
{
    out[0] = at->left + (WIDTH - RIGHT - at->left) * lab_axis_share(&f->axes[0], x);
    out[1] = at->bottom + f->plot_height * lab_axis_share(&f->axes[1], y);
}

static void draw_element(const lab_figure *f, const layout *at, const lab_element *e, const page *p)
{
    const double *data = f->values + e->first;
    const size_t count = e->count;
    double low[2], high[2], *xy;
    switch (e->kind) {
    case CURVE:
        xy = drape_arena_take(&f->l->arena, count, sizeof *xy);
        for (size_t i = 0; xy && i < count; i += 2)
            place(f, at, data[i], data[i + 1], xy + i);
        if (xy && e->style.dash)
            put_line(p, xy, count / 2, e->style.colour, THICK, e->style.dash);
        for (size_t i = 0; xy && e->style.point && i < count; i += 2)
            if (!isnan(xy[i]) && !isnan(xy[i + 1]))
                put_marker(p, xy[i], xy[i + 1], e->style);
        drape_arena_release(&f->l->arena, xy);
        break;
    case ORDER:
        place(f, at, data[count - 2], data[count - 1], high);
        put_text(p, high[0] + 1, high[1], START, e->style.point == 1 ? "1" : "2", EM, NULL);
        break;
    default:
        for (size_t k = 0; k < count; k += 5) {
            place(f, at, data[k], data[k + 2], low);
            place(f, at, data[k + 1], data[k + 3], high);
            if (e->kind >= BOXES + LAB_HATCHED_BLACK)
                put_hatch(p, low[0], low[1], high[0], high[1], e->style.colour);
            else /* a hair larger, under its neighbours: no gaps */
                put_box(p, low[0], low[1], high[0] + HAIR, high[1] + HAIR,
                        e->kind == BOXES + LAB_COLOURED ? (int)data[k + 4] : scale_colour(data[k + 4]));
        }
    }
}

static void draw_page(const lab_figure *f, const layout *at, const page *p)
{
    const double left = at->left, right = WIDTH - RIGHT, low = at->bottom, high = low + f->plot_height;
    cairo_select_font_face(p->cairo, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(p->cairo, across(EM));
    put_box(p, 0, 0, WIDTH, at->height, LAB_WHITE);
    cairo_save(p->cairo);
    cairo_rectangle(p->cairo, across(left), down(p, high), across(right - left), across(high - low));
    cairo_clip(p->cairo);
    for (int i = 0; i < f->element_count; i++)
        draw_element(f, at, &f->elements[i], p);
    cairo_restore(p->cairo);
    put_frame(p, left, low, right, high);
    put_axis(p, &f->axes[0], left, low, right - left, false);
    put_axis(p, &f->axes[1], left, low, high - low, true);
    put_text(p, 0.5 * (left + right), (has_scale(f) ? at->scale + BAR : at->legend) + 0.6 * EM, MIDDLE,
             f->axes[0].label, WIDTH, NULL);
    if (has_scale(f)) {
        /* The bar of colours, with numbers and label below it. */
        for (int k = 0; k < LAB_SHADES; k++) /* each to the end of the bar: no gaps */
            put_box(p, left + (right - left) * k / LAB_SHADES, at->scale, right, at->scale + BAR,
                    scale_colour((k + 0.5) / LAB_SHADES));
        put_frame(p, left, at->scale, right, at->scale + BAR);
        put_axis(p, &f->scale, left, at->scale, right - left, false);
        put_text(p, left + 0.5 * (right - left), at->legend + 0.6 * EM, MIDDLE, f->scale.label, WIDTH, NULL);
    }
    put_text(p, 0.7 * EM, 0.5 * (low + high), UPRIGHT, f->axes[1].label, at->height, NULL);
    put_text(p, 0.5 * (left + right), high + 0.5 * TITLE, MIDDLE, f->title, right - left, NULL);
    put_legend(f, at, p);
}

static cairo_status_t put_bytes(void *out, const unsigned char *data, unsigned size)
{
    return fwrite(data, 1, size, out) == size ? CAIRO_STATUS_SUCCESS : CAIRO_STATUS_WRITE_ERROR;
}

/* Writes the figure as a file of one kind. caption: the page gets it, too; NULL: it does not. */
static drape_status write_figure(lab *l, const lab_figure *f, const char *ending, const char *caption,
                                 cairo_surface_t *make(cairo_write_func_t, void *, double, double))
{
    double widest = 0; /* text of the legend, which has as many columns as fit */
    for (int i = 0; i < f->entries; i++)
        widest = fmax(widest, fmin(WIDTH - 2 - SAMPLE, text_width(f->legend[i].text)));
    layout at = {.column = SAMPLE + widest + GAP};
    at.columns = (int)fmax(1, fmin(f->entries, floor((WIDTH - 2 + GAP) / at.column)));
    at.rows = (f->entries + at.columns - 1) / at.columns;
    double ticks = text_width(f->axes[1].log ? "10-10" : "0.0005"); /* numbers or names of the y axis */
    for (int i = 0; i < f->axes[1].name_count; i++)
        ticks = fmax(i ? ticks : 0, text_width(f->axes[1].names[i]));
    at.left = (*f->axes[1].label ? EM + 1.5 : 1) + fmin(ticks, WIDEST_NAME) + TICK + 1;
    at.legend = LINE * at.rows + 1;
    at.scale = at.legend + EM + 1 + 1.5 * EM + TICK;
    at.bottom =
        TICK + 1.5 * EM + (*f->axes[0].label ? EM + 1 : 0) + (has_scale(f) ? at.scale + BAR : at.legend);
    at.height = at.bottom + f->plot_height + TOP + (*f->title ? TITLE : 0);
    char name[sizeof f->name + 4], *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    if (!out)
        return drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for a figure");
    cairo_surface_t *surface = make(put_bytes, out, across(WIDTH), across(at.height));
    const page p = {cairo_create(surface), at.height};
    draw_page(f, &at, &p);
    cairo_surface_finish(surface);
    const cairo_status_t fault =
        cairo_status(p.cairo) ? cairo_status(p.cairo) : cairo_surface_status(surface);
    cairo_destroy(p.cairo);
    cairo_surface_destroy(surface);
    snprintf(name, sizeof name, "%s%s", f->name, ending);
    const bool no_memory =
        fclose(out) || fault == CAIRO_STATUS_NO_MEMORY || fault == CAIRO_STATUS_WRITE_ERROR;
    drape_status status = no_memory ? drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for the figure %s", name)
                          : fault   ? drape_fail(l->ctx, DRAPE_E_PARSE, "the figure %s cannot be drawn: %s",
                                                 name, cairo_status_to_string(fault))
                                    : lab_write_text(l, name, text, size);
    if (!status && caption)
        lab_page_figure(l, text, size, caption);
    free(text);
    return status;
}

drape_status lab_figure_end(lab *l, lab_figure *f, const char *caption)
{
    for (int i = 0; i < f->variant_count; i++)
        add_entry(f, f->variants[i], f->variants[i].text);
    drape_status status = f->failed ? DRAPE_E_MEMORY : drape_check_cancel(l->ctx);
    const bool empty = status || f->element_count == 0;
    if (!empty &&
        !(has_range(&f->axes[0]) && has_range(&f->axes[1]) && (!has_scale(f) || has_range(&f->scale))))
        status = drape_fail(l->ctx, DRAPE_E_PARSE,
                            "the figure %s cannot be drawn: its values, %g to %g and %g to %g, have no range",
                            f->name, f->axes[0].from, f->axes[0].to, f->axes[1].from, f->axes[1].to);
    if (!status && !empty)
        status = write_figure(l, f, ".svg", caption, cairo_svg_surface_create_for_stream);
    if (!status && !empty)
        status = write_figure(l, f, ".pdf", NULL, cairo_pdf_surface_create_for_stream);
    drape_arena_release(&l->arena, f->values);
    drape_arena_release(&l->arena, f->elements);
    return status;
}
