#!/usr/bin/env python3
"""The figures of the experiments, as a column of a paper: 84 mm wide. See program.py and src/lab/figure.h.

Each SVG is read back: text of at least 7 pt that touches no other text, no line, marker, area or edge of the page; colours of the palette; the
same colour and marker for an integrator everywhere. Beside it lies a PDF of the same width with its font embedded."""
import glob
import math
import re
import shutil
import sys
import xml.etree.ElementTree as tree

from program import Skip, equal, good, run_tests, write_scene

WIDTH_MM, LEAST_PT = 84, 7
# Okabe and Ito, Color Universal Design (2008), five more, black and white; the greys of gnuplot's text and of the reference slopes.
METHODS = {(0, 114, 178), (213, 94, 0), (0, 158, 115), (0, 0, 0), (230, 159, 0), (86, 180, 233), (204, 121, 167),
           (0x44, 0, 0x99), (0x66, 0x33, 0x11), (0x88, 0xbb, 0x66), (0x22, 0x55, 0x55), (0x22, 0x55, 0xee)}
BLUES = {(0x4c, 0x9c, 0xcb), (0x93, 0xc4, 0xe2), (0xd3, 0xe6, 0xf3)}  # shades of the blue, for rejected steps
VERDICTS = BLUES | {(0, 114, 178), (255, 255, 255), (204, 121, 167), (230, 159, 0), (213, 94, 0), (0x4d, 0x4d, 0x4d)}
PALETTE = METHODS | VERDICTS | {(0x99, 0x99, 0x99)}
# The scale of results, from low to high, and the colours that stand beside it on a map.
SCALE = [(0x10, 0x20, 0x70), (0x1d, 0x3b, 0x77), (0x2e, 0x55, 0x7b), (0x44, 0x6e, 0x7d), (0x5e, 0x87, 0x7b), (0x7d, 0x9f, 0x75), (0x9f, 0xb7, 0x6b), (0xc5, 0xce, 0x5c),
         (0xf0, 0xe4, 0x42)]
BESIDE = {(230, 159, 0), (213, 94, 0), (0x4d, 0x4d, 0x4d)}
# Widths of characters 32 to 126 of DejaVu Sans [em / 1000], the widest of the usual fonts without serifs.
WIDTHS = [318, 401, 460, 838, 636, 950, 780, 275, 390, 390, 500, 838, 318, 361, 318, 337, 636, 636, 636, 636, 636, 636, 636, 636, 636, 636,
          337, 337, 838, 838, 838, 531, 1000, 684, 686, 698, 770, 632, 575, 775, 752, 295, 295, 656, 557, 863, 748, 787, 603, 787, 695, 635,
          611, 732, 684, 989, 685, 611, 685, 390, 337, 390, 838, 500, 500, 613, 635, 550, 635, 615, 352, 635, 634, 278, 278, 579, 278, 974,
          634, 612, 635, 635, 411, 521, 392, 634, 592, 818, 592, 592, 525, 636, 337, 636, 838]
ASCENT, DESCENT = 0.73, 0.24  # of capitals and of p, in em: DejaVu Sans
NAMES = {"be", "bdf2", "midpoint", "ida", "verlet", "trbdf2", "newton_k", "cvode", "dirk", "rosenbrock", "generalized_alpha", "radau"}


def on_scale(rgb):
    """Whether a colour lies between two neighbours of the scale, up to rounding."""
    for a, b in zip(SCALE, SCALE[1:]):
        along = sum((x - y) * (z - y) for x, y, z in zip(rgb, a, b)) / math.dist(a, b) ** 2
        if 0 <= along <= 1 and math.dist(rgb, [y + along * (z - y) for y, z in zip(a, b)]) < 2:
            return True
    return False


def numbers(text):
    return [float(x) for x in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", text)]


def colour(text):
    """(r, g, b) of an attribute; None: none, or that of the element around."""
    names = {"black": (0, 0, 0), "none": None, "currentColor": None}
    if text is None or text in names:
        return names.get(text)
    if text.startswith("url"):  # a hatch, whose lines are in the definitions
        return None
    if text.startswith("#"):
        return tuple(int(text[i:i + 2], 16) for i in (1, 3, 5))
    return tuple(int(x) for x in numbers(text))


class Text:
    """A text and the box that it fills."""

    def __init__(self, group):
        self.text, x, top, bottom, shift, self.sizes = "", 0, 0, 0, 0, []
        size = float(group.get("font-size"))
        element = group.find("{*}text")
        for run in [element, *element]:
            shift += numbers(run.get("dy", "0"))[0]
            font = float(run.get("font-size", size))
            if not run.text or not run.text.strip():
                continue
            self.sizes.append(font)
            self.text += run.text
            x += sum(WIDTHS[ord(c) - 32] for c in run.text) * 1e-3 * font
            top, bottom = min(top, shift - ASCENT * font), max(bottom, shift + DESCENT * font)
        left = {"start": 0, "middle": -x / 2, "end": -x}[group.get("text-anchor")]
        place = numbers(group.get("transform"))
        if len(place) == 3:  # rotate(-90)
            self.box = (place[0] + top, place[1] - left - x, place[0] + bottom, place[1] - left)
        else:
            self.box = (place[0] + left, place[1] + top, place[0] + left + x, place[1] + bottom)


def segments_of(path):
    """Straight pieces of a path of absolute M, L, Z and relative h, v, l."""
    here = start = (0, 0)
    for command, text in re.findall(r"([MLZzhvl])([^MLZzhvl]*)", path):
        values = numbers(text)
        if command in "Zz":
            yield here, start
            here = start
            continue
        step = {"h": 1, "v": 1}.get(command, 2)
        for i in range(0, len(values), step):
            there = {"h": lambda v: (here[0] + v[0], here[1]), "v": lambda v: (here[0], here[1] + v[0]), "l": lambda v: (here[0] + v[0], here[1] + v[1])
                     }.get(command, tuple)(values[i:i + step])
            if command == "M" and i == 0:
                start = there
            else:
                yield here, there
            here = there


class Figure:
    def __init__(self, source):
        self.texts, self.lines, self.colours, self.markers = [], [], set(), []
        root = tree.fromstring(source)
        self.width, self.height = numbers(root.get("viewBox"))[2:]
        self.read(root, None)

    def read(self, element, inherited):
        tag = element.tag.split("}")[1]
        if tag in ("defs", "title", "desc"):
            return
        own = colour(element.get("color")) or inherited
        if tag == "g" and element.get("font-size"):
            if "".join(element.itertext()).strip():
                self.texts.append(Text(element))
            self.colours.add(colour(element.get("fill")))
            return
        drawn = [colour(element.get(key)) for key in ("stroke", "fill", "color") if tag in ("path", "polygon", "use", "rect")]
        self.colours |= {c for c in drawn if c}
        if tag == "path":
            self.lines += [(a, b, colour(element.get("stroke")) or own) for a, b in segments_of(element.get("d"))]
        elif tag == "polygon":
            points = numbers(element.get("points"))
            corners = list(zip(points[::2], points[1::2]))
            self.lines += [(a, b, colour(element.get("fill")) or own) for a, b in zip(corners, corners[1:] + corners[:1])]
        elif tag == "use":
            x, y, size = numbers(element.get("transform"))[:3]
            kind = int(element.get("{http://www.w3.org/1999/xlink}href")[5:])
            self.markers.append((x, y, size, kind, colour(element.get("color"))))
            self.lines.append(((x - size, y - size), (x + size, y + size), None))
        for child in element:
            self.read(child, own)

    def legend(self):
        """{text: (colour, markers)} of the entries with a line: the line ends left of the text, at its height."""
        entries = {}
        for one in self.texts:
            left, top, _, bottom = one.box
            middle = (top + bottom) / 2
            lines = [c for a, b, c in self.lines if c and a[1] == b[1] and abs(a[1] - middle) < 3 and -1 < left - max(a[0], b[0]) < 8 and abs(a[0] - b[0]) > 15]
            if lines:
                marks = {kind for x, y, _, kind, _ in self.markers if abs(y - middle) < 3 and 0 < left - x < 25}
                entries[one.text] = (lines[0], marks)
        return entries


def crosses(box, a, b):
    """Whether a segment meets the inside of a box: clipping by Liang and Barsky."""
    low, high = 0.0, 1.0
    for k in (0, 1):
        d = b[k] - a[k]
        if d == 0:
            if not box[k] < a[k] < box[k + 2]:
                return False
            continue
        ends = sorted(((box[k] - a[k]) / d, (box[k + 2] - a[k]) / d))
        low, high = max(low, ends[0]), min(high, ends[1])
    return low < high


def check(source, name):
    """All that a figure must keep."""
    figure = Figure(source)
    point = WIDTH_MM / 25.4 * 72 / figure.width  # of a unit of the SVG
    assert len(figure.texts) > 4, name
    for i, one in enumerate(figure.texts):
        what = f"{name}: \"{one.text}\" at {one.box}"
        assert min(one.sizes) * point >= LEAST_PT, f"{what}: {min(one.sizes) * point:.2f} pt"
        assert one.box[0] >= 0 and one.box[1] >= 0 and one.box[2] <= figure.width and one.box[3] <= figure.height, f"{what}: off the page"
        for other in figure.texts[:i]:
            a, b = one.box, other.box
            assert a[0] >= b[2] or b[0] >= a[2] or a[1] >= b[3] or b[1] >= a[3], f"{what}: touches \"{other.text}\" at {b}"
        for a, b, _ in figure.lines:
            assert not crosses(one.box, a, b), f"{what}: touches the line {a} {b}"
    strange = {c for c in figure.colours - {None} - PALETTE if not on_scale(c)}
    assert not strange, f"{name}: {strange}"
    return figure


def check_pdf(path):
    with open(path, "rb") as file:
        data = file.read()
    box = re.search(rb"/MediaBox \[\s*([\d. ]+)\]", data)
    assert box and b"/FontFile" in data, f"{path}: no page, or no embedded font"
    width = float(box.group(1).split()[2]) / 72 * 25.4
    assert abs(width - WIDTH_MM) < 0.5, f"{path}: {width} mm"


def lab_of(rgb, blind):
    """CIELAB (D65) of a colour in sRGB, as deuteranopes see it: G. M. Machado et al. 2009, severity 1."""
    linear = [c / 255 / 12.92 if c <= 10 else ((c / 255 + 0.055) / 1.055) ** 2.4 for c in rgb]
    if blind:
        rows = ((0.367322, 0.860646, -0.227968), (0.280085, 0.672501, 0.047413), (-0.011820, 0.042940, 0.968881))
        linear = [min(1, max(0, sum(a * b for a, b in zip(row, linear)))) for row in rows]
    rows = ((0.4124564, 0.3575761, 0.1804375), (0.2126729, 0.7151522, 0.0721750), (0.0193339, 0.1191920, 0.9503041))
    xyz = [sum(a * b for a, b in zip(row, linear)) / white for row, white in zip(rows, (0.95047, 1, 1.08883))]
    x, y, z = [t ** (1 / 3) if t > 0.008856 else 7.787 * t + 16 / 116 for t in xyz]
    return 116 * y - 16, 500 * (x - y), 200 * (y - z)


def nearest(colours, blind):
    """The smallest difference of two of the colours."""
    listed = sorted(colours)
    return min((math.dist(lab_of(a, blind), lab_of(b, blind)), a, b) for i, a in enumerate(listed) for b in listed[:i])


def test_figures():
    """figures of all experiments are readable at 84 mm, touch nothing with their text, and lie beside a PDF"""
    if not shutil.which("gnuplot"):
        raise Skip("gnuplot is not installed")
    write_scene(duration=0.3)
    good("tradeoff", "scene.json", "--out", "t", "--repeats", "1", "--case-seconds", "3", "--budget", "none")
    good("converge", "scene.json", "--levels", "4", "--space", "--out", "c")
    axis, modulus = ["--axis", "/integrator/dt=1e-3:1e-1:9log"], ["--axis", "/cloth/0/material/young_modulus=1e4:1e6:4log"]
    good("stability", "scene.json", *axis, *modulus, "--results", "energy_drift,iterations_per_step", "--out", "map")
    good("stability", "scene.json", *axis, "--integrators", ",".join(sorted(NAMES)), "--out", "row")
    good("stability", "scene.json", *modulus, "--axis", "/duration=0.1:0.5:3", "--axis", "/cloth/0/material/density=100:300:2", "--integrators", "be", "--out", "three")
    styles = {}
    paths = sorted(glob.glob("*/*.svg"))
    assert len(paths) >= 4 + 3 + 3 * 4 + 2 + 2, paths
    for path in paths:
        with open(path, encoding="utf-8") as file:
            figure = check(file.read(), path)
        check_pdf(path[:-3] + "pdf")
        for text, (line, marks) in figure.legend().items():
            method = re.split(r"[, ]", text)[0]
            if method in NAMES and (text == "ida, order 2" or "," not in text):
                styles.setdefault(method, set()).add((line, tuple(marks)))
    equal(set(styles), NAMES, "integrators with a line in a legend")
    for method, found in styles.items():
        equal(len(found), 1, f"styles of {method}: {found}")
    equal(len({style for found in styles.values() for style in found}), len(NAMES), "different styles")
    equal(len({line for found in styles.values() for line, _ in found}), len(NAMES), "different colours")
    # Reference slopes: orders over dt and edges, proportion over a tolerance.
    for name, slopes in (("dt", "slopes 1 and 2"), ("edge", "slopes 1 and 2"), ("rtol", "slope 1")):
        with open(f"c/converge_{name}.svg", encoding="utf-8") as file:
            assert f">{slopes}<" in file.read(), name


def test_colours():
    """the colours of integrators, and those of maps, differ for people with deuteranopia too"""
    # About 2.3 is just noticeable (Mahy et al. 1994); 10 is seen at a glance. Red against green of the same lightness falls below.
    for colours in (METHODS, VERDICTS, set(SCALE), {SCALE[0], SCALE[-1]} | BESIDE):
        for blind in (False, True):
            distance, a, b = nearest(colours, blind)
            assert distance > 10, f"{a} and {b}: {distance:.1f}, deuteranopia: {blind}"
    # Colours beside the scale differ from all of it, and its lightness rises.
    for blind in (False, True):
        lightness = [lab_of(c, blind)[0] for c in SCALE]
        assert all(b - a > 5 for a, b in zip(lightness, lightness[1:])), lightness
        assert min(math.dist(lab_of(a, blind), lab_of(b, blind)) for a in SCALE for b in BESIDE) > 10
    assert nearest({(0x1a, 0x7f, 0x5a), (0xc0, 0x39, 0x2b)}, False)[0] > 60 > 35 > nearest({(0x1a, 0x7f, 0x5a), (0xc0, 0x39, 0x2b)}, True)[0], "the check itself"


def test_the_check():
    """the check of a figure finds text that touches, is small, or leaves the page, and colours that are not of the palette"""
    if not shutil.which("gnuplot"):
        raise Skip("gnuplot is not installed")
    write_scene(duration=0.3)
    good("converge", "scene.json", "--levels", "4", "--integrators", "be,bdf2", "--out", "c")
    with open("c/converge_dt.svg", encoding="utf-8") as file:
        source = file.read()
    figure = check(source, "sound")
    place = re.search(r'translate\(([\d.]+),([\d.]+)\)"[^>]*>\s*<text>(?:<tspan[^>]*>)?be[ <]', source)
    x, y = place.group(1), place.group(2)
    curve = figure.markers[0]
    for old, new, why in ((f"translate({x},{y})", f"translate({x},{float(y) + 14})", "touches \""), (f"translate({x},{y})", f"translate({curve[0]},{curve[1]})", "touches the line"),
                          (f"translate({x},{y})", f"translate(312,{y})", "off the page"), ('font-size="10.00"', 'font-size="9.00"', " pt"), ("213,  94,   0", "192, 57, 43", "(192, 57, 43)")):
        assert old in source, old
        try:
            check(source.replace(old, new), "changed")
        except AssertionError as error:
            assert why in str(error), (why, error)
        else:
            raise AssertionError(f"nothing was found: {why}")


if __name__ == "__main__":
    sys.exit(run_tests(globals()))
