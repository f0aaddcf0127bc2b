/* figure.c: see figure.h. */
#include "lab/figure.h"

#include "lab/text.h"

#include <errno.h>
#include <math.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

/* Lengths [mm] unless they say otherwise. */
#define WIDTH       84.0 /* a column of a paper */
#define POINT       (25.4 / 72)
#define PIXEL       (25.4 / 96)
#define FONT        7.5  /* [pt] */
#define POWER       1.17 /* exponents, which gnuplot sets at 0.8 of the font, by this: 7 pt */
#define EM          (FONT * POINT)
#define PLOT_HEIGHT 52.0
#define RIGHT       3.0
#define TOP         2.5
#define TITLE       4.5 /* height of a title */
#define TICK        1.4 /* length of a tick, with the space after it */
#define LINE        3.6 /* of the legend */
#define SAMPLE      7.0 /* of a line or swatch in the legend, with the space after it */
#define GAP         3.0 /* between columns of the legend */
#define BAR         2.6 /* height of the scale of colours */
#define THICK       1.2 /* [pixel] of curves */

/* ---- Styles ---- */

/* Okabe and Ito 2008, without yellow, which is too pale for lines on white, and five colours found by a
 * search for those that differ most from these, from each other, from white and from the grey of reference
 * lines: by 26 or more in CIELAB, also as people with deuteranopia and protanopia see them (Machado et al.
 * 2009). */
static const int colours[] = {LAB_BLUE,   LAB_RED,  0x009e73, LAB_BLACK, LAB_ORANGE, 0x56b4e9,
                              LAB_PURPLE, 0x440099, 0x663311, 0x88bb66,  0x225555,   0x2255ee};
static const int points[] = {7, 5, 9, 13, 11, 15, 2}; /* gnuplot's filled markers; one less: the open one */

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

/* ---- Text ---- */

/* The width of a text [mm]: DejaVu Sans [em / 1000], the widest of the usual fonts without serifs. */
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
        sum += *text >= ' ' && *text <= '~' ? widths[*text - ' '] : 1000;
    return sum * 1e-3 * EM;
}

/* A text of gnuplot's: in it quotes are doubled. */
static void put_quoted(FILE *out, const char *text)
{
    fputc('\'', out);
    for (; *text; text++)
        fputs(*text == '\'' ? "''" : (char[]){*text, 0}, out);
    fputc('\'', out);
}

/* ---- Axes ---- */

static double ends_ratio(const lab_axis *a)
{
    return a->log ? log10(a->to / a->from) : a->to - a->from;
}

/* Powers of ten, at most about six; between them ticks without numbers. If there is at most one, 1, 2 and
 * 5 times such a power, or over less than a factor of 10 also 3 times, of 4 all multiples. */
static void put_log_ticks(const lab_axis *a, FILE *out)
{
    const int first = (int)floor(log10(a->from)), last = (int)ceil(log10(a->to));
    const int powers = (int)floor(log10(a->to) + 1e-9) - (int)ceil(log10(a->from) - 1e-9) + 1;
    const int stride = 1 + (powers - 1) / 6;
    const char *comma = "";
    for (int k = first; k <= last; k++)
        for (int digit = 1; digit < 10; digit++) {
            const double value = digit * pow(10, k);
            const bool numbered = powers > 1 ? digit == 1 && (k - first) % stride == 0
                                             : a->to < 4 * a->from || (digit == 3 && a->to < 10 * a->from) ||
                                                   digit == 1 || digit == 2 || digit == 5;
            if (value < a->from * (1 - 1e-9) || value > a->to * (1 + 1e-9))
                continue;
            if (numbered && powers > 1)
                fprintf(out, "%s'10^{/*%.2f %d}' %.9g", comma, POWER, k, value);
            else if (numbered)
                fprintf(out, "%s'%g' %.9g", comma, value, value);
            else
                fprintf(out, "%s'' %.9g 1", comma, value);
            comma = ", ";
        }
}

/* Multiples of 1, 2 or 5 times a power of ten, at most six. */
static void put_linear_ticks(const lab_axis *a, FILE *out)
{
    const double raw = (a->to - a->from) / 6, size = pow(10, floor(log10(raw)));
    const double step = raw <= size       ? size
                        : raw <= 2 * size ? 2 * size
                        : raw <= 5 * size ? 5 * size
                                          : 10 * size;
    const char *comma = "";
    for (double k = ceil(a->from / step - 1e-9); k * step <= a->to + 1e-9 * step; k++, comma = ", ")
        fprintf(out, "%s'%g' %.9g", comma, k * step + 0.0, k * step); /* not -0 */
}

static void put_axis(const lab_axis *a, const char *name, FILE *out)
{
    fprintf(out, "set %srange [%.9g:%.9g]\n", name, a->from, a->to);
    if (a->log)
        fprintf(out, "set logscale %s\n", name);
    fprintf(out, "set %stics (", name);
    for (int i = 0; i < a->name_count; i++) {
        fputs(i ? ", " : "", out);
        put_quoted(out, a->names[i]);
        fprintf(out, " %d", i);
    }
    if (a->name_count == 0 && a->log)
        put_log_ticks(a, out);
    else if (a->name_count == 0)
        put_linear_ticks(a, out);
    fprintf(out, ")%s\n", a->name_count > 0 ? " noenhanced" : "");
}

/* The room that the numbers or names of the y axis need. */
static double ticks_width(const lab_axis *a)
{
    double widest = text_width(a->log ? "10-10" : "0.0005");
    for (int i = 0; i < a->name_count; i++)
        widest = fmax(i ? widest : 0, text_width(a->names[i]));
    return widest;
}

void lab_figure_fit(lab_figure *f, const double *xy, size_t count, int orders)
{
    lab_axis *x = &f->axes[0], *y = &f->axes[1];
    const double margin = 0.04;
    x->log = y->log = true;
    x->from = y->from = INFINITY;
    x->to = y->to = 0;
    for (size_t i = 0; i < count; i++) {
        x->from = fmin(x->from, xy[2 * i]);
        x->to = fmax(x->to, xy[2 * i]);
        y->from = fmin(y->from, xy[2 * i + 1]);
        y->to = fmax(y->to, xy[2 * i + 1]);
    }
    /* A single value is given a decade. */
    for (lab_axis *a = x; a <= y; a++) {
        const double widen = a->to > a->from ? pow(a->to / a->from, margin) : sqrt(10);
        a->from /= widen;
        a->to *= widen;
    }
    if (orders == 0)
        return;
    /* The lines of orders 1 and 2 begin at (left, low); their ends, and the numbers at these, are 4 mm
     * apart. */
    const double span = fmax(0.15 * ends_ratio(x), 4 / f->plot_height * ends_ratio(y));
    const double right = x->to * pow(10, -0.07 * ends_ratio(x)), left = right * pow(10, -span);
    double top = INFINITY;
    for (size_t i = 0; i < count; i++) /* a point to the left counts, too: from there a line may come down */
        top = xy[2 * i] > left / 2.5 ? fmin(top, xy[2 * i + 1]) : top;
    const double space = pow(10, 3.5 / f->plot_height * ends_ratio(y));
    const double low = top / space * pow(10, -orders * span);
    y->from = fmin(y->from, low / space);
    for (int order = 1; order <= orders; order++) {
        const double end = low * pow(10, order * span);
        const int block = lab_figure_data(f);
        fprintf(f->script, "%.9g %.9g\n%.9g %.9g\n", left, low, right, end);
        lab_figure_data_end(f);
        lab_figure_curve(f, block, (lab_style){LAB_GREY, 2, 0},
                         order > 1     ? NULL
                         : orders == 1 ? "slope 1"
                                       : "slopes 1 and 2");
        fprintf(f->script, "set label '%d' at first %.9g,%.9g offset 0.4,0 left\n", order, right, end);
    }
}

/* ---- Elements ---- */

drape_status lab_figure_begin(lab *l, lab_figure *f, const char *name)
{
    *f = (lab_figure){.plot_height = PLOT_HEIGHT};
    snprintf(f->name, sizeof f->name, "%s", name);
    f->script = open_memstream(&f->text, &f->size);
    f->plot = open_memstream(&f->plot_text, &f->plot_size);
    if (f->script && f->plot)
        return DRAPE_OK;
    if (f->script)
        fclose(f->script);
    free(f->text);
    return drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for a figure");
}

int lab_figure_data(lab_figure *f)
{
    fprintf(f->script, "$d%d << EOD\n", f->blocks);
    return f->blocks++;
}

void lab_figure_data_end(lab_figure *f)
{
    fputs("EOD\n", f->script);
}

static void add_element(lab_figure *f, int block)
{
    fprintf(f->plot, "%s$d%d ", f->elements++ ? ", " : "plot ", block);
}

static void add_entry(lab_figure *f, const lab_entry *entry)
{
    if (f->entries < LAB_MAX_ENTRIES)
        f->legend[f->entries++] = *entry;
}

/* gnuplot's SVG joins neighbouring arrows of one width and colour and gives all of them the dashes of the
 * first: each kind of dashes has a width of its own. */
static void put_style(FILE *out, lab_style s)
{
    if (s.dash == 0)
        fprintf(out, "lw %.2f lc rgb '#%06x'", THICK, (unsigned)s.colour);
    else
        fprintf(out, "lw %.2f dt %d lc rgb '#%06x'", THICK + 0.01 * (s.dash - 1), s.dash, (unsigned)s.colour);
}

/* Markers without a line are larger: nothing else shows where they are. */
static double point_size(lab_style s)
{
    return s.dash ? 0.35 : 0.5;
}

void lab_figure_curve(lab_figure *f, int block, lab_style style, const char *text)
{
    add_element(f, block);
    fputs(style.dash == 0 ? "with points " : style.point ? "with linespoints " : "with lines ", f->plot);
    put_style(f->plot, style);
    if (style.point)
        fprintf(f->plot, " pt %d ps %.2f", style.point, point_size(style));
    if (!text)
        return;
    lab_entry entry = {.style = style};
    snprintf(entry.text, sizeof entry.text, "%s", text);
    add_entry(f, &entry);
}

static bool is_in(const lab_entry *entries, int count, const char *text, size_t length)
{
    for (int i = 0; i < count; i++)
        if (strncmp(entries[i].text, text, length) == 0 &&
            (entries[i].text[length] == 0 || entries[i].text[length] == ','))
            return true;
    return false;
}

void lab_figure_series(lab_figure *f, int block, const char *integrator, size_t variant, const char *name)
{
    const lab_style style = lab_style_of(integrator, variant);
    const char *comma = strchr(name, ',');
    if (variant == 0 || !comma || !is_in(f->legend, f->entries, integrator, strlen(integrator))) {
        lab_figure_curve(f, block, style, name);
        return;
    }
    lab_figure_curve(f, block, style, NULL);
    const char *what = comma + 2;
    if (f->variant_count == LAB_MAX_VARIANTS || is_in(f->variants, f->variant_count, what, strlen(what)))
        return;
    lab_entry *entry = &f->variants[f->variant_count++];
    *entry = (lab_entry){.style = {LAB_BLACK, style.dash, LAB_OPEN_MARKER}};
    snprintf(entry->text, sizeof entry->text, "%s", what);
}

void lab_figure_boxes(lab_figure *f, int block)
{
    add_element(f, block);
    fputs("using 1:2:3:4:5:6:7 with boxxyerror fs solid 1 noborder lc rgb variable", f->plot);
}

void lab_figure_values(lab_figure *f, int block)
{
    add_element(f, block);
    fputs("using 1:2:3:4:5:6:7 with boxxyerror fs solid 1 noborder lc palette", f->plot);
}

void lab_figure_hatch(lab_figure *f, int block, int colour)
{
    add_element(f, block);
    fprintf(f->plot, "using 1:2:3:4:5:6 with boxxyerror fs transparent pattern 5 noborder lc rgb '#%06x'",
            (unsigned)colour);
}

void lab_figure_marker(lab_figure *f, lab_style style, const char *text)
{
    lab_entry entry = {.style = style};
    snprintf(entry.text, sizeof entry.text, "%s", text);
    add_entry(f, &entry);
}

void lab_figure_swatch(lab_figure *f, int colour, bool hatched, const char *text)
{
    lab_entry entry = {.style = {.colour = colour}, .swatch = true, .hatched = hatched};
    snprintf(entry.text, sizeof entry.text, "%s", text);
    add_entry(f, &entry);
}

/* ---- Layout ---- */

/* The frame and the legend below it: as many columns as fit. */
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

static layout lay_out(const lab_figure *f)
{
    double widest = 0;
    for (int i = 0; i < f->entries; i++)
        widest = fmax(widest, text_width(f->legend[i].text));
    layout at = {.column = SAMPLE + widest + GAP};
    at.columns = (int)fmax(1, fmin(f->entries, floor((WIDTH - 2 + GAP) / at.column)));
    at.rows = (f->entries + at.columns - 1) / at.columns;
    at.left = (*f->axes[1].label ? EM + 1.5 : 1) + ticks_width(&f->axes[1]) + TICK + 1;
    at.legend = LINE * at.rows + 1;
    at.scale = at.legend + EM + 1 + 1.5 * EM + TICK;
    at.bottom =
        TICK + 1.5 * EM + (*f->axes[0].label ? EM + 1 : 0) + (has_scale(f) ? at.scale + BAR : at.legend);
    at.height = at.bottom + f->plot_height + TOP + (*f->title ? TITLE : 0);
    return at;
}

static void put_label(FILE *out, const layout *at, double x, double y, const char *text, const char *how)
{
    fputs("set label ", out);
    put_quoted(out, text);
    fprintf(out, " at screen %.5f,%.5f %s noenhanced\n", x / WIDTH, y / at->height, how);
}

static void put_swatch(FILE *out, double left, double bottom, double right, double top, const char *fill,
                       int colour)
{
    fprintf(out,
            "set object rectangle from screen %.5f,%.5f to screen %.5f,%.5f fs %s noborder fc rgb '#%06x'\n",
            left, bottom, right, top, fill, (unsigned)colour);
}

static void put_legend(const lab_figure *f, const layout *at, FILE *out)
{
    for (int i = 0; i < f->entries; i++) {
        const lab_entry *e = &f->legend[i];
        const double x = 1 + at->column * (i / at->rows),
                     y = 1 + LINE * (at->rows - 1 - i % at->rows) + 0.5 * LINE;
        const double from = x / WIDTH, to = (x + SAMPLE - 1.2) / WIDTH, middle = y / at->height;
        if (e->swatch) {
            put_swatch(out, from, (y - 0.9) / at->height, to, (y + 0.9) / at->height, "solid 1",
                       e->style.colour);
            if (e->hatched)
                put_swatch(out, from, (y - 0.9) / at->height, to, (y + 0.9) / at->height,
                           "transparent pattern 5", LAB_BLACK);
        } else if (e->style.dash) {
            fprintf(out, "set arrow from screen %.5f,%.5f to screen %.5f,%.5f nohead ", from, middle, to,
                    middle);
            put_style(out, e->style);
            fputc('\n', out);
        }
        if (!e->swatch && e->style.point)
            fprintf(out, "set label '' at screen %.5f,%.5f point pt %d ps %.2f lw %.2g lc rgb '#%06x'\n",
                    (from + to) / 2, middle, e->style.point, point_size(e->style), THICK,
                    (unsigned)e->style.colour);
        put_label(out, at, x + SAMPLE, y, e->text, "left");
    }
}

/* The bar of colours, with numbers and label below it. */
static void put_scale(const lab_figure *f, const layout *at, FILE *out)
{
    const int count = sizeof scale_colours / sizeof *scale_colours;
    fputs("set palette defined (", out);
    for (int i = 0; i < count; i++)
        fprintf(out, "%s%d '#%06x'", i ? ", " : "", i, (unsigned)scale_colours[i]);
    fprintf(out,
            ") maxcolors %d\nset colorbox horizontal user origin screen %.5f,%.5f size screen %.5f,%.5f\n",
            LAB_SHADES, at->left / WIDTH, at->scale / at->height, 1 - (RIGHT + at->left) / WIDTH,
            BAR / at->height);
    put_axis(&f->scale, "cb", out);
    fputs("set cbtics scale 0.5,0.25 offset 0,0.3\n", out);
    put_label(out, at, 0.5 * (at->left + WIDTH - RIGHT), at->legend + 0.6 * EM, f->scale.label, "center");
}

static void put_script(const lab_figure *f, FILE *out)
{
    const layout at = lay_out(f);
    const double top = at.bottom + f->plot_height;
    fprintf(out,
            "# gnuplot %s.gp\nset lmargin at screen %.5f\nset rmargin at screen %.5f\nset bmargin at screen "
            "%.5f\n"
            "set tmargin at screen %.5f\nunset key\nset border 15 lw 0.6\n"
            "set tics out nomirror scale 0.5,0.25\nset xtics offset 0,0.3\nset ytics offset 0.6,0\n",
            f->name, at.left / WIDTH, 1 - RIGHT / WIDTH, at.bottom / at.height, top / at.height);
    put_axis(&f->axes[0], "x", out);
    put_axis(&f->axes[1], "y", out);
    put_label(out, &at, 0.5 * (at.left + WIDTH - RIGHT),
              (has_scale(f) ? at.scale + BAR : at.legend) + 0.6 * EM, f->axes[0].label, "center");
    if (has_scale(f))
        put_scale(f, &at, out);
    put_label(out, &at, 0.7 * EM, 0.5 * (at.bottom + top), f->axes[1].label, "center rotate by 90");
    put_label(out, &at, 0.5 * (at.left + WIDTH - RIGHT), top + 0.5 * TITLE, f->title, "center");
    put_legend(f, &at, out);
    fputs(f->text, out);
    fprintf(out,
            "set terminal svg size %.0f,%.0f dynamic font 'sans-serif,%.4g' background '#ffffff' name '%s'\n",
            WIDTH / PIXEL, at.height / PIXEL, FONT * POINT / PIXEL, f->name);
    fprintf(out, "set output '%s.svg'\n%s\n", f->name, f->plot_text);
    fprintf(out,
            "set terminal pdfcairo size %.4gcm,%.4gcm font 'Sans,%.4g' fontscale %.4g\nset output "
            "'%s.pdf'\nreplot\n",
            WIDTH / 10, at.height / 10, FONT, PIXEL / POINT, f->name); /* Pango's points are pixels */
}

/* ---- gnuplot ---- */

/* Runs a program and waits for it; returns its exit code, -1 where it did not run. Its output is
 * discarded. */
static int run_program(char *const *arguments)
{
    posix_spawn_file_actions_t actions;
    pid_t child;
    int code = -1;
    if (posix_spawn_file_actions_init(&actions))
        return -1;
    posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", 0, 0);
    posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", 1, 0);
    posix_spawn_file_actions_addopen(&actions, 2, "/dev/null", 1, 0);
    bool started = posix_spawnp(&child, arguments[0], &actions, NULL, arguments, environ) == 0;
    posix_spawn_file_actions_destroy(&actions);
    if (!started)
        return -1;
    while (waitpid(child, &code, 0) < 0)
        if (errno != EINTR)
            return -1;
    return WIFEXITED(code) ? WEXITSTATUS(code) : -1;
}

/* A folder for one figure, outside the folder of the experiment, where gnuplot must open nothing
 * (io/folder.h): it has name.gp, and then name.svg and name.pdf. */
typedef struct scratch {
    char folder[160];
    char names[3][104]; /* script, SVG, PDF */
} scratch;

static bool scratch_open(scratch *s, const char *name, const char *script, size_t size)
{
    const char *const endings[3] = {"gp", "svg", "pdf"}, *base = getenv("TMPDIR");
    char path[272];
    for (int i = 0; i < 3; i++)
        snprintf(s->names[i], sizeof s->names[i], "%s.%s", name, endings[i]);
    snprintf(s->folder, sizeof s->folder, "%s/drape-XXXXXX", base && strlen(base) < 128 ? base : "/tmp");
    if (!mkdtemp(s->folder))
        return false;
    snprintf(path, sizeof path, "%s/%s", s->folder, s->names[0]);
    FILE *file = fopen(path, "w");
    const bool written = file && fwrite(script, 1, size, file) == size;
    return file && fclose(file) == 0 && written;
}

static void scratch_remove(const scratch *s)
{
    char path[272];
    for (int i = 0; i < 3; i++) {
        snprintf(path, sizeof path, "%s/%s", s->folder, s->names[i]);
        unlink(path);
    }
    rmdir(s->folder);
}

/* Runs gnuplot in the folder, and copies what it drew into the folder of the experiment. */
static drape_status scratch_draw(scratch *s, lab *l, bool *drawn)
{
    char go[176];
    snprintf(go, sizeof go, "cd '%s'", s->folder);
    char *const arguments[] = {(char[]){"gnuplot"}, (char[]){"-e"}, go, s->names[0], NULL};
    drape_status status = DRAPE_OK;
    *drawn = run_program(arguments) == 0;
    for (int i = 1; *drawn && !status && i < 3; i++) {
        char *text = NULL;
        size_t size = 0;
        status = lab_read_text(&l->arena, s->folder, s->names[i], &text, &size);
        if (!status)
            status = lab_write_text(l, s->names[i], text, size);
        drape_arena_release(&l->arena, text);
    }
    return status;
}

static drape_status draw(lab *l, const lab_figure *f, const char *caption)
{
    char *text = NULL;
    size_t size = 0;
    scratch s = {.folder = ""};
    bool drawn = false;
    FILE *out = open_memstream(&text, &size);
    if (!out)
        return drape_fail(l->ctx, DRAPE_E_MEMORY, "no memory for a figure");
    put_script(f, out);
    fclose(out);
    const bool ready = scratch_open(&s, f->name, text, size);
    drape_status status = lab_write_text(l, s.names[0], text, size);
    free(text);
    if (!status && ready)
        status = scratch_draw(&s, l, &drawn);
    if (*s.folder)
        scratch_remove(&s);
    if (status || drawn)
        return status ? status : lab_page_figure(l, f->name, caption);
    fprintf(l->summary, "gnuplot is missing or failed on %s: this report has no figures\n", s.names[0]);
    return DRAPE_OK;
}

drape_status lab_figure_end(lab *l, lab_figure *f, const char *caption)
{
    fclose(f->script);
    fclose(f->plot);
    for (int i = 0; i < f->variant_count; i++)
        add_entry(f, &f->variants[i]);
    drape_status status = f->elements > 0 ? draw(l, f, caption) : DRAPE_OK;
    free(f->text);
    free(f->plot_text);
    return status;
}
