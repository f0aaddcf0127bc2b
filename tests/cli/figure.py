"""A figure of the experiments, read back: its shapes from the SVG, where letters are shapes too, its text from the PDF beside it by pdftotext."""
import re
import subprocess
import xml.etree.ElementTree as tree

FONT_HEIGHT, ABOVE, BELOW = 1.164, 0.198, 0  # of DejaVu Sans [em]: of the boxes of pdftotext; of them, above the capitals and below p


def numbers(text):
    return [float(x) for x in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", text)]


def colour(style, key):
    """(r, g, b) of an SVG style; None: none."""
    found = re.search(rf"(?:^|[ ;]){key}:rgb\(([^)]*)\)", style)
    return found and tuple(round(2.55 * x) for x in numbers(found.group(1)))


class Text:
    """A line of text, the boxes that its words fill, and the size of its font [pt]."""

    def __init__(self, line):
        words = line.findall("{*}word")
        self.text = " ".join(word.text for word in words)
        self.boxes, self.size = [], 1000
        upright = float(line.get("xMax")) < 12 and float(line.get("yMax")) - float(line.get("yMin")) > 12  # of the y axis, read from below
        for word in words:
            left, top, right, bottom = (float(word.get(key)) for key in ("xMin", "yMin", "xMax", "yMax"))
            self.size = min(self.size, (right - left if upright else bottom - top) / FONT_HEIGHT)
            cut = ABOVE * self.size
            self.boxes.append((left + cut, top, right, bottom) if upright else (left, top + cut, right, bottom))

    def clear_of(self, other):
        return all(a[0] >= b[2] or b[0] >= a[2] or a[1] >= b[3] or b[1] >= a[3] for a in self.boxes for b in other.boxes)


def corners_of(path):
    """The corners of each piece of a path of absolute M, L, Z."""
    pieces = []
    for command, text in re.findall(r"([MLZ])([^MLZ]*)", path):
        point = tuple(numbers(text))
        if command == "M":
            pieces.append([point])
        elif command == "L":
            pieces[-1].append(point)
        else:
            pieces[-1].append(pieces[-1][0])
    return [piece for piece in pieces if len(piece) > 1]


class Figure:
    def __init__(self, path):
        self.lines, self.colours, self.markers = [], set(), []
        with open(path, encoding="utf-8") as file:
            root = tree.fromstring(file.read())
        self.width, self.height = numbers(root.get("viewBox"))[2:]
        page = subprocess.run(["pdftotext", "-bbox-layout", path[:-3] + "pdf", "-"], capture_output=True, check=True).stdout
        self.texts = [Text(line) for line in tree.fromstring(re.sub(rb"<!DOCTYPE[^>]*>", b"", page)).iter("{http://www.w3.org/1999/xhtml}line")]
        boxes = {clip.get("id"): clip.find("{*}path").get("d") for clip in root.iter("{http://www.w3.org/2000/svg}clipPath")}
        for child in root:
            if not child.tag.endswith("}defs"):
                self.read(child, boxes, (0, 0, self.width, self.height))

    def read(self, element, clips, clip):
        found = re.match(r"url\(#(.*)\)", element.get("clip-path", ""))
        if found:
            corners = corners_of(clips[found.group(1)])[0]
            clip = (min(x for x, _ in corners), min(y for _, y in corners), max(x for x, _ in corners), max(y for _, y in corners))
        if element.tag.endswith("}path"):
            self.shape(element, clip)
        for child in element:
            self.read(child, clips, clip)

    def shape(self, element, clip):
        style, pieces = element.get("style"), corners_of(element.get("d"))
        stroke, fill = colour(style, "stroke"), colour(style, "fill")
        self.colours |= {stroke, fill}
        xs, ys = zip(*(point for piece in pieces for point in piece))
        if max(xs) - min(xs) < 5 and max(ys) - min(ys) < 5 and (len(pieces) == 2 or pieces[0][0] == pieces[0][-1]):  # small, and a cross or closed
            shape = (len(pieces[0]), round(pieces[0][0][1] - pieces[0][1][1]), bool(fill))
            self.markers.append(((min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2, shape, stroke or fill))
        for piece in pieces:
            self.lines += [(a, b, stroke, clip) for a, b in zip(piece, piece[1:])]

    def legend(self):
        """{text: (colour, shapes of markers)} of the entries with a line: the line ends left of the text, at its height."""
        entries = {}
        for one in self.texts:
            left, top, _, bottom = one.boxes[0]
            middle = (top + bottom) / 2
            lines = [c for a, b, c, _ in self.lines if c and a[1] == b[1] and abs(a[1] - middle) < 2.5 and 0 < left - max(a[0], b[0]) < 6 and abs(a[0] - b[0]) > 11]
            if lines:
                entries[one.text] = (lines[0], {shape for x, y, shape, _ in self.markers if abs(y - middle) < 2.5 and 0 < left - x < 19})
        return entries

    def frame(self):
        """Left, top, right and bottom of the plot: the first rectangle of black lines."""
        xs = [x for a, b, stroke, _ in self.lines if stroke == (0, 0, 0) and a[1] == b[1] and abs(a[0] - b[0]) > 100 for x in (a[0], b[0])]
        ys = [y for a, b, stroke, _ in self.lines if stroke == (0, 0, 0) and a[0] == b[0] and abs(a[1] - b[1]) > 15 for y in (a[1], b[1])]
        return min(xs), min(ys), max(xs), max(ys)

    def has(self, text):
        return any(one.text == text for one in self.texts)
