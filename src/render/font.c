/*
 * font.c: see font.h. A glyph is its width and its strokes, each a list of points x y written as the digits 0
 * ... 9 a ... d: the base line is at y = 3, small letters end at 9, capitals at 12, descenders at 0. A stroke
 * that begins with ~ is a smooth curve through its points (Catmull & Rom 1974).
 */
#include "render/font.h"

#include <math.h>
#include <string.h>

#define CAPITAL  9.0f /* grid units above the base line */
#define TAIL     3.5f /* of a descender, below the base line */
#define HEAD     1.5f /* above a capital */
#define WIDEST   9.0f
#define GAP      2.4f  /* between letters */
#define PEN      0.62f /* half the width of a stroke */
#define PIECES   6     /* of a curve between two points */
#define MAX_LINE 200   /* points of a glyph */

typedef struct glyph {
    unsigned code;
    float width;
    const char *strokes;
} glyph;

#define ROUND "~395866543314061839"
#define LARGE "~3c5b696654331406091b3c"

/* Found by code; the first stands for all missing ones. */
static const glyph glyphs[] = {
    {0, 6, "030c6c6303"},
    {' ', 3, ""},
    {'!', 2, "1c16 1313"},
    {'"', 3, "0c0a 3c3a"},
    {'#', 6, "1b14 5b54 0969 0666"},
    {'%', 6, "036c ~1c2b1a0b1c ~5665544556"},
    {'\'', 2, "1c1a"},
    {'(', 3, "~2d0a0621"},
    {')', 3, "~0d2a2601"},
    {'*', 6, "3b37 1a58 5a18"},
    {'+', 6, "0767 3a34"},
    {',', 2, "1301"},
    {'-', 4, "0747"},
    {'.', 2, "1313"},
    {'/', 6, "026c"},
    {'0', 6, "~3c5b686754331407081b3c"},
    {'1', 5, "1a3c33 1353"},
    {'2', 6, "~0a1b3c5b6a5703 0363"},
    {'3', 6, "~0b3c5b5a4828 ~2848665433 04"},
    {'4', 6, "4c0666 4c43"},
    {'5', 6, "5c1c08 ~08395866543304"},
    {'6', 6, "~5b3c1a061433546658391806"},
    {'7', 6, "0c6c23"},
    {'8', 6, "~3c5b5938191b3c ~385766543314061738"},
    {'9', 6, "~143355695b3c1b0917365769"},
    {':', 2, "1414 1818"},
    {';', 2, "1301 1818"},
    {'<', 5, "5a0754"},
    {'=', 6, "0868 0565"},
    {'>', 5, "0a5704"},
    {'?', 5, "~0a1b3c5b5a3736 3333"},
    {'A', 6, "033c63 1656"},
    {'B', 6, "030c3c ~3c5b5938 0838 ~3857665433 3303"},
    {'C', 6, "~6a5b3c1b090614335465"},
    {'D', 6, "030c2c ~2c5b69665423 2303"},
    {'E', 5, "5c0c0353 0848"},
    {'F', 5, "5c0c03 0848"},
    {'G', 6, "~6a5b3c1b090614335465 656737"},
    {'H', 6, "0c03 6c63 0868"},
    {'I', 2, "1c13"},
    {'J', 4, "4c45 ~45342304"},
    {'K', 6, "0c03 6c06 2863"},
    {'L', 5, "0c0353"},
    {'M', 8, "030c468c83"},
    {'N', 6, "030c636c"},
    {'O', 6, LARGE},
    {'P', 6, "030c3c ~3c5b695837 3707"},
    {'Q', 6, LARGE " 4562"},
    {'R', 6, "030c3c ~3c5b695837 3707 3763"},
    {'S', 6, "~6a5b3c1b0a18576554331405"},
    {'T', 6, "0c6c 3c33"},
    {'U', 6, "0c06 ~0614335466 666c"},
    {'V', 6, "0c336c"},
    {'W', 8, "0c234a638c"},
    {'X', 6, "0c63 036c"},
    {'Y', 6, "0c386c 3833"},
    {'Z', 6, "0c6c0363"},
    {'[', 2, "2d0d0121"},
    {'\\', 6, "0c62"},
    {']', 2, "0d2d2101"},
    {'^', 6, "0a3c6a"},
    {'_', 6, "0262"},
    {'a', 6, ROUND " 6963"},
    {'b', 6, "0c03 " ROUND},
    {'c', 5, "~58391806143354"},
    {'d', 6, ROUND " 6c63"},
    {'e', 6, "0666 ~6658391806143354"},
    {'f', 4, "~4c3c2a29 2923 0949"},
    {'g', 6, ROUND " 6962 ~62513010"},
    {'h', 6, "0c03 ~0718395867 6763"},
    {'i', 2, "1913 1c1c"},
    {'j', 2, "2921 ~211000 2c2c"},
    {'k', 5, "0c03 5905 2753"},
    {'l', 2, "1c13"},
    {'m', 8, "0903 ~0718293947 4743 ~4758697987 8783"},
    {'n', 6, "0903 ~0718395867 6763"},
    {'o', 6, ROUND},
    {'p', 6, "0900 " ROUND},
    {'q', 6, ROUND " 6960"},
    {'r', 4, "0903 ~07183949"},
    {'s', 5, "~583918173655543304"},
    {'t', 4, "2b24 ~243343 0949"},
    {'u', 6, "0905 ~0514335465 6963"},
    {'v', 6, "093369"},
    {'w', 8, "0923486389"},
    {'x', 6, "0963 0369"},
    {'y', 6, "0933 6910"},
    {'z', 5, "09590353"},
    {'{', 3, "~3d2c2807 ~07162331"},
    {'|', 2, "1d11"},
    {'}', 3, "~0d1c1827 ~27161301"},
    {'~', 6, "~061737466768"},
    {0xb0, 3, "~1c2b1a0b1c"},
    {0xb2, 3, "~0b1c2b08 0828"},
    {0xb7, 2, "1717"},
    {0xd7, 6, "1955 1559"},
};
_Static_assert(sizeof glyphs / sizeof *glyphs <= DRAPE_FONT_CELLS, "the atlas has a cell for each glyph");

/* The pieces of a glyph's strokes, two points each. */
typedef struct lines {
    float at[MAX_LINE][2][2];
    int count;
} lines;

static int digit(char c)
{
    return c >= 'a' ? c - 'a' + 10 : c - '0';
}

/* A stroke; smooth: by the curve through its points. */
static void add_stroke(lines *to, const float (*p)[2], int count, bool smooth)
{
    bool closed = count > 2 && memcmp(p[0], p[count - 1], sizeof *p) == 0;
    for (int i = 0; i + 1 < count; i++) {
        const float *a = i > 0 ? p[i - 1] : closed ? p[count - 2] : p[0], *b = p[i], *c = p[i + 1];
        const float *d = i + 2 < count ? p[i + 2] : closed ? p[1] : p[count - 1];
        float last[2], next[2];
        memcpy(last, b, sizeof last);
        for (int n = 1; n <= (smooth ? PIECES : 1) && to->count < MAX_LINE; n++) {
            const float s = smooth ? (float)n / PIECES : 1; /* between b and c */
            for (int k = 0; k < 2; k++)
                next[k] =
                    0.5f * (2 * b[k] + (c[k] - a[k]) * s + (2 * a[k] - 5 * b[k] + 4 * c[k] - d[k]) * s * s +
                            (3 * b[k] - a[k] - 3 * c[k] + d[k]) * s * s * s);
            memcpy(to->at[to->count][0], last, sizeof last);
            memcpy(to->at[to->count++][1], next, sizeof next);
            memcpy(last, next, sizeof last);
        }
    }
}

static void parse_strokes(const char *text, lines *to)
{
    while (*text) {
        float p[MAX_LINE][2];
        int count = 0;
        bool smooth = *text == '~';
        for (text += smooth; text[0] && text[0] != ' ' && text[1]; text += 2) {
            p[count][0] = (float)digit(text[0]);
            p[count++][1] = (float)digit(text[1]) - 3;
        }
        add_stroke(to, (const float(*)[2])p, count, smooth);
        while (*text == ' ')
            text++;
    }
}

static void draw_glyph(drape_font *font, int index)
{
    float scale = font->height / CAPITAL, pen = fmaxf(PEN * scale, 0.55f);
    lines all = {.count = 0};
    parse_strokes(glyphs[index].strokes, &all);
    for (int j = 0; j < font->cell_height; j++)
        for (int i = 0; i < font->cell_width; i++) {
            float x = ((float)i + 0.5f - font->origin[0]) / scale,
                  y = (font->origin[1] - (float)j - 0.5f) / scale;
            float nearest = 1e9f;
            for (int l = 0; l < all.count; l++) {
                const float *a = all.at[l][0], *b = all.at[l][1];
                float dx = b[0] - a[0], dy = b[1] - a[1], length = dx * dx + dy * dy;
                float s = length > 0 ? ((x - a[0]) * dx + (y - a[1]) * dy) / length : 0;
                s = fminf(1, fmaxf(0, s));
                nearest = fminf(nearest, hypotf(x - a[0] - s * dx, y - a[1] - s * dy));
            }
            float cover = fminf(1, fmaxf(0, pen - nearest * scale + 0.5f));
            font->alpha[(size_t)j * (size_t)(font->cell_width * DRAPE_FONT_CELLS) +
                        (size_t)(index * font->cell_width + i)] = (uint8_t)lroundf(255 * cover);
        }
}

drape_status drape_font_create(drape_arena *arena, float height, drape_font *font)
{
    float scale = height / CAPITAL, margin = 2; /* whole pixels: a letter is drawn texel by texel */
    *font = (drape_font){.height = height};
    font->cell_width = (int)ceilf(WIDEST * scale + 2 * margin);
    font->cell_height = (int)ceilf((CAPITAL + TAIL + HEAD) * scale + 2 * margin);
    font->origin[0] = margin;
    font->origin[1] = ceilf((CAPITAL + HEAD) * scale + margin);
    font->alpha =
        drape_arena_take(arena, (size_t)font->cell_width * DRAPE_FONT_CELLS, (size_t)font->cell_height);
    if (!font->alpha)
        return DRAPE_E_MEMORY;
    for (size_t i = 0; i < sizeof glyphs / sizeof *glyphs; i++)
        draw_glyph(font, (int)i);
    return DRAPE_OK;
}

int drape_font_next(const drape_font *font, const char **text, float *advance)
{
    if (!**text)
        return -1;
    /* One character of UTF-8; a byte that belongs to no character stands for itself. */
    const unsigned char *c = (const unsigned char *)*text;
    int more = *c >= 0xf0 ? 3 : *c >= 0xe0 ? 2 : *c >= 0xc0 ? 1 : 0, found = 0, length = 1;
    unsigned code = more ? *c & (0x3fu >> more) : *c;
    for (; length <= more && (c[length] & 0xc0) == 0x80; length++)
        code = code << 6 | (c[length] & 0x3fu);
    *text += length;
    for (size_t i = 1; i < sizeof glyphs / sizeof *glyphs; i++)
        if (glyphs[i].code == code)
            found = (int)i;
    *advance = (glyphs[found].width + GAP) * font->height / CAPITAL;
    return found;
}

float drape_font_width(const drape_font *font, const char *text)
{
    float width = 0, advance;
    while (drape_font_next(font, &text, &advance) >= 0)
        width += advance;
    return width;
}
