#!/usr/bin/env python3
"""The figures of the experiments, as a column of a paper: 84 mm wide. See program.py and src/lab/figure.h.

Each figure is read back, its shapes from the SVG, where letters are shapes too, and its text from the PDF beside it, which has the same page and
its font embedded: text of at least 7 pt that touches no other text, no line, marker, area or edge of the page; colours of the palette; the same
colour and marker for an integrator everywhere."""
import glob
import math
import re
import shutil
import sys
import xml.etree.ElementTree as tree

from figure import Figure, Text
from program import Skip, equal, good, run_tests, text_of, write_scene, write_text

WIDTH_MM, LEAST_PT = 84, 7
# Okabe and Ito, Color Universal Design (2008), five more, black and white; the grey of the reference slopes.
METHODS = {(0, 114, 178), (213, 94, 0), (0, 158, 115), (0, 0, 0), (230, 159, 0), (86, 180, 233), (204, 121, 167),
           (0x44, 0, 0x99), (0x66, 0x33, 0x11), (0x88, 0xbb, 0x66), (0x22, 0x55, 0x55), (0x22, 0x55, 0xee)}
BLUES = {(0x4c, 0x9c, 0xcb), (0x93, 0xc4, 0xe2), (0xd3, 0xe6, 0xf3)}  # shades of the blue, for rejected steps
VERDICTS = BLUES | {(0, 114, 178), (255, 255, 255), (204, 121, 167), (230, 159, 0), (213, 94, 0), (0x4d, 0x4d, 0x4d)}
PALETTE = METHODS | VERDICTS | {(0x99, 0x99, 0x99)}
# The scale of results, from low to high, and the colours that stand beside it on a map.
SCALE = [(0x10, 0x20, 0x70), (0x1d, 0x3b, 0x77), (0x2e, 0x55, 0x7b), (0x44, 0x6e, 0x7d), (0x5e, 0x87, 0x7b), (0x7d, 0x9f, 0x75), (0x9f, 0xb7, 0x6b), (0xc5, 0xce, 0x5c),
         (0xf0, 0xe4, 0x42)]
BESIDE = {(230, 159, 0), (213, 94, 0), (0x4d, 0x4d, 0x4d)}
NAMES = {"be", "bdf2", "midpoint", "ida", "verlet", "trbdf2", "newton_k", "dirk", "rosenbrock", "radau"}


def on_scale(rgb):
    """Whether a colour lies between two neighbours of the scale, up to rounding."""
    for a, b in zip(SCALE, SCALE[1:]):
        along = sum((x - y) * (z - y) for x, y, z in zip(rgb, a, b)) / math.dist(a, b) ** 2
        if 0 <= along <= 1 and math.dist(rgb, [y + along * (z - y) for y, z in zip(a, b)]) < 2:
            return True
    return False


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


def check(path):
    """All that a figure must keep."""
    figure = Figure(path)
    assert abs(figure.width / 72 * 25.4 - WIDTH_MM) < 0.1, (path, figure.width)
    assert len(figure.texts) > 4, path
    for i, one in enumerate(figure.texts):
        what = f"{path}: \"{one.text}\" at {one.boxes}"
        assert one.size > LEAST_PT, f"{what}: {one.size:.2f} pt"
        for other in figure.texts[:i]:
            assert one.clear_of(other), f"{what}: touches \"{other.text}\" at {other.boxes}"
        for box in one.boxes:
            assert box[0] >= 0 and box[1] >= 0 and box[2] <= figure.width and box[3] <= figure.height, f"{what}: off the page"
            for a, b, _, clip in figure.lines:
                seen = (max(box[0], clip[0]), max(box[1], clip[1]), min(box[2], clip[2]), min(box[3], clip[3]))
                on_page = all(0 < x < w for point in (a, b) for x, w in zip(point, (figure.width, figure.height)))
                assert seen[0] >= seen[2] or seen[1] >= seen[3] or not on_page or not crosses(seen, a, b), f"{what}: touches the line {a} {b}"
    strange = {c for c in figure.colours - {None} - PALETTE if not on_scale(c)}
    assert not strange, f"{path}: {strange}"
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
    if not shutil.which("pdftotext"):
        raise Skip("pdftotext is not installed")
    write_scene(duration=0.3)
    good("tradeoff", "scene.json", "--out", "t", "--repeats", "1", "--case-seconds", "3", "--budget", "none")
    good("converge", "scene.json", "--levels", "4", "--space", "--out", "c")
    axis, modulus = ["--axis", "/integrator/dt=1e-3:1e-1:9log"], ["--axis", "/cloth/0/material/young_modulus=1e4:1e6:4log"]
    good("stability", "scene.json", *axis, *modulus, "--results", "energy_drift,iterations_per_step", "--out", "map")
    good("stability", "scene.json", *axis, "--integrators", ",".join(sorted(NAMES)), "--out", "row")
    good("stability", "scene.json", *modulus, "--axis", "/duration=0.1:0.5:3", "--axis", "/cloth/0/material/density=100:300:2", "--integrators", "be", "--out", "three")
    styles = {}
    paths = sorted(glob.glob("*/*.svg"))
    assert len(paths) >= 2 + 3 + 3 * 4 + 2 + 2, paths
    for path in paths:
        figure = check(path)
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
        assert slopes in [one.text for one in Figure(f"c/converge_{name}.svg").texts], name


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
    if not shutil.which("pdftotext"):
        raise Skip("pdftotext is not installed")
    write_scene(duration=0.3)
    good("converge", "scene.json", "--levels", "4", "--integrators", "be,bdf2", "--out", "c")
    check("c/converge_dt.svg")
    source = text_of("c/converge_dt.svg")
    left, top, right, bottom = next(one for one in Figure("c/converge_dt.svg").texts if one.text.startswith("be")).boxes[0]
    for old, new, why in (("</svg>", f'<path style="stroke:rgb(0%,0%,0%);" d="M {left} {bottom} L {right} {top}"/></svg>', "touches the line"),
                          ("83.529412%,36.862745%,0%", "75.294118%,22.352941%,16.862745%", "(192, 57, 43)")):
        assert old in source, old
        write_text("c/converge_dt.svg", source.replace(old, new))
        try:
            check("c/converge_dt.svg")
        except AssertionError as error:
            assert why in str(error), (why, error)
        else:
            raise AssertionError(f"nothing was found: {why}")
    line = '<line xmlns="x" xMin="20" yMin="20" xMax="40" yMax="{0}"><word xMin="20" yMin="20" xMax="40" yMax="{0}">be</word></line>'
    assert not Text(tree.fromstring(line.format(28))).clear_of(Text(tree.fromstring(line.format(29)))) and Text(tree.fromstring(line.format(28))).size < LEAST_PT


if __name__ == "__main__":
    sys.exit(run_tests(globals()))
