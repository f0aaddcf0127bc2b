/* layout.c: see layout.h. */
#include "render/layout.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define STRIP  0.25f /* largest share of the picture's width for the legend */
#define MARGIN 20    /* [pixels at 720 rows], as all below */
#define LINE   21    /* height of a line */
#define LEGEND 120   /* smallest height of the legend's ramp */
#define TAB    112   /* from the beginning of a line to the text after its tab */

static const float veil[4] = {1, 1, 1, 0.62f};

/* ---- Panels ---- */

static void legend_title(const drape_shading *shading, char *title, size_t size)
{
    snprintf(title, size, "%s [%s]", shading->field->entry.name, shading->field->shown_unit);
}

static int columns_of(int panel_count)
{
    return panel_count <= 3 ? panel_count : (int)ceil(sqrt(panel_count));
}

drape_rectangle drape_layout_inner(const drape_overlay *overlay, const drape_picture *picture, int panel)
{
    int count = picture->panel_count, columns = columns_of(count), rows = (count + columns - 1) / columns;
    int column = panel % columns, row = rows - 1 - panel / columns;
    int left = (int)picture->column, strip = 0; /* at the right, for the legend [pixels] */
    if (picture->shading->field) {
        char title[80];
        legend_title(picture->shading, title, sizeof title);
        float wide = drape_overlay_legend_width(overlay, title) + MARGIN * overlay->unit;
        strip = (int)fminf(wide, STRIP * (float)overlay->width);
    }
    int width = overlay->width - left - strip;
    drape_rectangle b = {.left = left + column * width / columns, .bottom = row * overlay->height / rows};
    b.width = left + (column + 1) * width / columns - b.left;
    b.height = (row + 1) * overlay->height / rows - b.bottom;
    return b;
}

drape_rectangle drape_layout_whole(const drape_overlay *overlay, const drape_picture *picture, int panel)
{
    drape_rectangle b = drape_layout_inner(overlay, picture, panel);
    int columns = columns_of(picture->panel_count), right = b.left + b.width;
    if (panel % columns == columns - 1)
        right = overlay->width;
    if (panel % columns == 0)
        b.left = 0;
    b.width = right - b.left;
    return b;
}

/* ---- Overlay ---- */

static void put_labels(drape_overlay *o, const drape_picture *picture)
{
    for (int i = 0; i < picture->panel_count; i++) {
        const drape_rectangle b = drape_layout_whole(o, picture, i);
        const char *label = picture->panels[i].label;
        float top = (float)(o->height - b.bottom - b.height), x = (float)b.left + MARGIN * o->unit;
        if (b.left > 0)
            drape_overlay_box(o, (float)b.left - o->unit, top, 2 * o->unit, (float)b.height,
                              (const float[]){1, 1, 1, 0.9f});
        if (!label)
            continue;
        drape_overlay_box(o, x - 9 * o->unit, top + 12 * o->unit,
                          drape_font_width(&o->font, label) + 18 * o->unit, 26 * o->unit, veil);
        drape_overlay_text(o, x, top + 30 * o->unit, DRAPE_LEFT, drape_ink, label);
    }
}

/* Puts text from x on, broken at blanks to end before `right`; returns the number of lines. A colour of NULL
 * only counts them. */
static int put_wrapped(drape_overlay *o, float x, float y, float right, const float *colour, const char *text)
{
    int lines = 0;
    while (*text || lines == 0) {
        char line[200] = "";
        size_t length = 0;
        for (size_t next = strcspn(text, " ");; next += 1 + strcspn(text + next + 1, " ")) {
            char more[sizeof line];
            snprintf(more, sizeof more, "%.*s", (int)next, text);
            if (length > 0 && x + drape_font_width(&o->font, more) > right)
                break;
            memcpy(line, more, sizeof line);
            length = next;
            if (!text[next])
                break;
        }
        if (colour)
            drape_overlay_text(o, x, y + (float)lines * LINE * o->unit, DRAPE_LEFT, colour, line);
        text += length;
        text += strspn(text, " ");
        lines++;
    }
    return lines;
}

/* The text before a tab is a name, put in a fainter colour, of the value after it. Returns the number of lines. */
static int put_lines(drape_overlay *o, const drape_picture *picture, bool put)
{
    float left = MARGIN * o->unit, right = picture->column > 0 ? picture->column : (float)o->width - left;
    int count = 0;
    for (int i = 0; picture->lines[i]; i++) {
        const char *text = picture->lines[i], *tab = strchr(text, '\t');
        float y = (30 + (float)count * LINE) * o->unit;
        char name[80];
        snprintf(name, sizeof name, "%.*s", tab ? (int)(tab - text) : 0, text);
        if (put && tab)
            drape_overlay_text(o, left, y, DRAPE_LEFT, drape_faint, name);
        count += put_wrapped(o, tab ? left + TAB * o->unit : left, y, right, put ? drape_ink : NULL,
                             tab ? tab + 1 : text);
    }
    return count;
}

void drape_layout_put(drape_overlay *overlay, const drape_picture *picture)
{
    const drape_field_ops *field = picture->shading->field;
    const float u = overlay->unit, width = (float)overlay->width, height = (float)overlay->height;
    if (field) {
        char title[80];
        legend_title(picture->shading, title, sizeof title);
        drape_overlay_legend(overlay, width - 22 * u, height - 26 * u,
                             fminf(fmaxf(0.36f * height, LEGEND * u), 0.6f * height), title,
                             field->shown * picture->low, field->shown * picture->high);
    }
    put_labels(overlay, picture);
    if (picture->lines && picture->lines[0]) { /* on a translucent ground, to be readable over cloth too */
        const float wide = picture->column > 0 ? picture->column : width;
        drape_overlay_box(overlay, 10 * u, 9 * u, wide - 4 * u,
                          ((float)put_lines(overlay, picture, false) * LINE + 12) * u, veil);
        put_lines(overlay, picture, true);
    }
    if (picture->caption)
        drape_overlay_text(overlay, MARGIN * u, height - 22 * u, DRAPE_LEFT, drape_faint, picture->caption);
}
