#!/usr/bin/env python3
"""test_usd.py: frames in the format `usd`, read by the grammar of .usda files (OpenUSD, textFileFormat), and compared with the positions in `npy`.

The parser here knows the part of the grammar that layers of meshes need, and nothing else: whatever is not in it is an error."""
import math
import os
import re
import signal
import struct

from program import SOURCES, equal, good, read_npy, refused, run_tests, scene, signalled, text_of, write_json, write_scene

TOKEN = re.compile(r"""\s+|\#[^\n]*|(?P<asset>@[^@\n]*@)|(?P<path></[\w/]*(?:\.[\w:]+)?>)|(?P<text>"(?:[^"\\\n]|\\.)*")
    |(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)|(?P<name>[A-Za-z_]\w*(?::\w+)*(?:\.(?:connect|timeSamples))?)|(?P<sign>[()\[\]{}=,:])""", re.X)

# What a value of each type is: how deep its tuples are nested, and with which lengths.
TYPES = {"token": "text", "string": "text", "bool": (), "int": (), "float": (), "double": (), "color3f": (3,), "float3": (3,), "point3f": (3,),
         "normal3f": (3,), "texCoord2f": (2,), "matrix4d": (4, 4)}
METADATA = {"defaultPrim", "doc", "framesPerSecond", "metersPerUnit", "startTimeCode", "endTimeCode", "timeCodesPerSecond", "upAxis", "interpolation"}


class Usda:
    """A layer: its metadata, and its prims by their paths, each {"type", "metadata", "attributes", "samples", "relations"}."""

    def __init__(self, text):
        assert text.startswith("#usda 1.0\n"), text[:20]
        self.tokens, self.at, at = [], 0, 0
        while at < len(text):
            match = TOKEN.match(text, at)
            assert match, f"no token: {text[at:at + 40]!r}"
            if match.lastgroup:
                self.tokens.append((match.lastgroup, match.group()))
            at = match.end()
        self.tokens.append(("end", ""))
        self.prims = {}
        self.metadata = self.parse_metadata()
        while self.tokens[self.at][0] != "end":
            self.parse_prim("")

    def take(self, kind, value=None):
        found = self.tokens[self.at]
        assert found[0] == kind and value in (None, found[1]), f"token {self.at}: {found}, not {kind} {value or ''}"
        self.at += 1
        return found[1]

    def next_is(self, value):
        return self.tokens[self.at][1] == value and self.tokens[self.at][0] != "text"

    def parse_list(self, opening, closing, item):
        """Items between commas; one may follow the last of them."""
        items = []
        self.take("sign", opening)
        while not self.next_is(closing):
            items.append(item())
            if not self.next_is(closing):
                self.take("sign", ",")
        self.take("sign", closing)
        return items

    def parse_tuple(self, lengths):
        if not lengths:
            return float(self.take("number"))
        items = self.parse_list("(", ")", lambda: self.parse_tuple(lengths[1:]))
        equal(len(items), lengths[0], "numbers of a tuple")
        return items

    def parse_value(self, kind, is_list):
        item = (lambda: self.take("text")[1:-1]) if TYPES[kind] == "text" else lambda: self.parse_tuple(TYPES[kind])
        return self.parse_list("[", "]", item) if is_list else item()

    def parse_metadata(self):
        found = {}
        if not self.next_is("("):
            return found
        self.take("sign", "(")
        while not self.next_is(")"):
            key = self.take("name")
            if key == "prepend":
                key = self.take("name")
                self.take("sign", "=")
                assert key in ("apiSchemas", "references"), key
                found[key] = self.take("asset") if key == "references" else self.parse_list("[", "]", lambda: self.take("text")[1:-1])
                continue
            assert key in METADATA, key
            self.take("sign", "=")
            kind, text = self.tokens[self.at]
            self.at += 1
            assert kind in ("text", "number"), (kind, text)
            found[key] = text[1:-1] if kind == "text" else float(text)
        self.take("sign", ")")
        return found

    def parse_prim(self, parent):
        self.take("name", "def")
        kind = "" if self.tokens[self.at][0] == "text" else self.take("name")
        name = self.take("text")[1:-1]
        assert re.fullmatch(r"[A-Za-z_]\w*", name), name
        path = f"{parent}/{name}"
        assert path not in self.prims, f"{path} is defined twice"
        prim = self.prims[path] = {"type": kind, "metadata": self.parse_metadata(), "attributes": {}, "samples": {}, "relations": {}}
        self.take("sign", "{")
        while not self.next_is("}"):
            if self.next_is("def"):
                self.parse_prim(path)
            else:
                self.parse_property(prim)
        self.take("sign", "}")

    def parse_property(self, prim):
        if self.next_is("rel"):
            self.take("name")
            name = self.take("name")
            self.take("sign", "=")
            prim["relations"][name] = self.take("path")[1:-1]
            return
        if self.next_is("uniform"):
            self.take("name")
        kind = self.take("name")
        assert kind in TYPES, kind
        is_list = self.next_is("[")
        if is_list:
            self.take("sign", "[")
            self.take("sign", "]")
        name = self.take("name")
        assert name not in prim["attributes"] and name not in prim["samples"], f"{name} twice"
        if not self.next_is("="):
            prim["attributes"][name] = None
            return
        self.take("sign", "=")
        if name.endswith(".connect"):
            prim["relations"][name] = self.take("path")[1:-1]
        elif name.endswith(".timeSamples"):
            self.take("sign", "{")
            samples = prim["samples"][name[:-len(".timeSamples")]] = {}
            while not self.next_is("}"):
                code = float(self.take("number"))
                assert not samples or code > max(samples), "time codes do not increase"
                self.take("sign", ":")
                samples[code] = self.parse_value(kind, is_list)
                self.take("sign", ",")
            self.take("sign", "}")
        else:
            prim["attributes"][name] = self.parse_value(kind, is_list)
            self.parse_metadata()


def read(folder, name="positions.usda"):
    with open(f"{folder}/{name}", encoding="utf-8") as file:
        return Usda(file.read())


def composed(folder):
    """The layer with what its references bring; opinions of the layer itself are stronger."""
    layer = read(folder)
    for prim in layer.prims.values():
        if "references" in prim["metadata"]:
            other = read(folder, prim["metadata"]["references"][1:-1])
            source = other.prims["/" + other.metadata["defaultPrim"]]
            for key in ("metersPerUnit", "upAxis", "timeCodesPerSecond"):
                equal(other.metadata[key], layer.metadata[key], key)
            prim["attributes"] = {**source["attributes"], **prim["attributes"]}
            prim["samples"] = {**source["samples"], **prim["samples"]}
    return layer


def single(x):
    return struct.unpack("<f", struct.pack("<f", x))[0]


def check_mesh(prim):
    """Counts and indices fit each other and the points, and the extent bounds these."""
    a, samples = prim["attributes"], prim["samples"].get("points", {})
    frames = samples or {0.0: a["points"]}
    points = {len(x) for x in frames.values()}
    equal(len(points), 1, "numbers of points")
    equal(sum(a["faceVertexCounts"]), len(a["faceVertexIndices"]), "corners")
    assert all(0 <= i < max(points) for i in a["faceVertexIndices"])
    equal(a["subdivisionScheme"], "none")
    low, high = a["extent"]
    for x in frames.values():
        for p in x:
            for k in range(3):  # the extent has 9 digits
                assert low[k] - 1e-7 * (1 + abs(low[k])) <= p[k] <= high[k] + 1e-7 * (1 + abs(high[k])), (p, low, high)


def write_tube(name):
    """4 x 3 quadrilaterals, whose texture coordinates have a seam, in two materials; and a triangle without coordinates and material."""
    with open(name, "w", encoding="utf-8") as file:
        for r in range(4):
            print(*(f"v {0.1 * x} {0.1 * r} {0.1 * z}" for x, z in ((1, 0), (0, 1), (-1, 0), (0, -1))), sep="\n", file=file)
        print(*(f"vt {s / 4} {r / 3}" for r in range(4) for s in range(5)), "v 0 -0.1 0", "f 17 2 1", sep="\n", file=file)
        for r in range(3):
            print("usemtl", ["light denim", "lining", "9\"oz"][r], file=file)
            for s in range(4):
                corners = [(r, s + 1), (r, s), (r + 1, s), (r + 1, s + 1)]
                print("f", *(f"{a * 4 + b % 4 + 1}/{a * 5 + b + 1}" for a, b in corners), file=file)


def bodies_scene(up="y", **changes):
    write_tube("tube.obj")
    scenes = SOURCES + "/examples/scenes/"
    cloth = {"material": {"young_modulus": 1e4, "thickness": 1e-3, "density": 200}, "terms": ["stretch.edge"]}
    whole = scene(output={"up": up}, **changes)
    whole["cloth"] = [{**cloth, "name": "a tube", "mesh": {"file": "tube.obj"}, "pins": [{"nodes": [0, 1]}]},
                      {**cloth, "name": "a_tube", "mesh": {"grid": "square", "columns": 3, "rows": 3, "width": 0.1, "height": 0.1},
                       "pins": [{"corner": "top-left"}]}]
    whole["colliders"] = [
        {"name": "materials", "type": "sphere", "center": [9, 0, 0], "radius": 0.1, "track": [[0, [0, 0, 0]], [0.1, [0, 1, 0]]]},
        {"type": "box", "center": [9, 3, 0], "size": [1, 2, 3], "turns": [{"time": 0, "rotate": [0, 0, 1, 0]}, {"time": 0.1, "rotate": [0, 0, 1, 90]}]},
        {"type": "plane", "point": [0, -9, 0], "normal": [0, 1, 0]},
        {"type": "animated_mesh", "file": scenes + "limb.npy", "mesh": scenes + "limb.obj", "frame_rate": 8, "track": [[0, [9, -5, 0]]]}]
    write_json("scene.json", whole)


def test_cloth():
    """points are those of npy in float32, polygons, texture coordinates and materials those of the mesh file"""
    bodies_scene()
    good("run", "scene.json", "--out", "out", "--format", "usd,npy")
    (frames, nodes, _), numbers = read_npy("out/positions.npy")
    layer = composed("out")
    equal({key: layer.metadata[key] for key in ("defaultPrim", "metersPerUnit", "upAxis", "timeCodesPerSecond", "startTimeCode", "endTimeCode")},
          {"defaultPrim": "run", "metersPerUnit": 1, "upAxis": "Y", "timeCodesPerSecond": 30, "startTimeCode": 0, "endTimeCode": 3})
    first = 0
    for path in ("/run/a_tube", "/run/a_tube_1"):
        prim = layer.prims[path]
        check_mesh(prim)
        samples = prim["samples"]["points"]
        equal(list(samples), [float(k) for k in range(frames)], "time codes")
        for k, x in enumerate(samples.values()):
            for i, p in enumerate(x):
                for c in range(3):
                    at = ((k * nodes) + first + i) * 3 + c
                    equal(single(p[c]), single(numbers[at]), f"{path}, frame {k}, point {i}")
        first += len(x)
    equal(first, nodes)
    tube = layer.prims["/run/a_tube"]
    a = tube["attributes"]
    equal(tube["metadata"]["doc"], "a tube")
    equal(a["faceVertexCounts"], [3] + 12 * [4])
    equal(a["faceVertexIndices"][:7], [16, 1, 0, 1, 0, 4, 5])
    uvs = [a["primvars:st"][int(i)] for i in a["primvars:st:indices"]]
    equal(len(uvs), 3 + 48)
    equal(uvs[:3], 3 * [[0, 0]])
    for corner, uv in enumerate(uvs[3:]):
        r, s, k = corner // 16, corner // 4 % 4, corner % 4
        expected = [(s + (k in (0, 3))) / 4, (r + (k > 1)) / 3]
        assert max(abs(x - y) for x, y in zip(uv, expected)) < 1e-7, (corner, uv, expected)
    faces = {}
    for path, prim in layer.prims.items():
        if prim["type"] == "GeomSubset":
            equal((prim["attributes"]["elementType"], prim["attributes"]["familyName"]), ("face", "materialBind"))
            faces[path] = prim["attributes"]["indices"]
            equal(layer.prims[prim["relations"]["material:binding"]]["type"], "Material")
    equal(faces, {f"/run/a_tube/{name}": [1 + 4 * r + s for s in range(4)] for r, name in enumerate(["light_denim", "lining", "_9_oz"])})
    equal(layer.prims["/run/materials/_9_oz"]["metadata"]["doc"], '9\\"oz')
    for prim in layer.prims.values():
        if prim["type"] == "Material":
            shader, output = prim["relations"]["outputs:surface.connect"].split(".")
            assert layer.prims[shader]["attributes"]["info:id"] == "UsdPreviewSurface" and output in layer.prims[shader]["attributes"]


def place(point, matrix):
    return [sum(row[k] * x for row, x in zip(matrix, [*point, 1])) for k in range(3)]


def test_colliders():
    """each collider is a mesh that is where the run has it, in time samples of its transformation or of its points, also with z up"""
    for up in "y", "z":
        bodies_scene(up)
        good("run", "scene.json", "--out", up, "--format", "usd")
        layer = composed(up)
        equal(layer.metadata["upAxis"], up.upper())
        upright = (lambda p: p) if up == "y" else lambda p: [p[0], p[2], -p[1]]
        bodies = {name: layer.prims["/run/" + name] for name in ("materials_1", "collider1", "collider2", "collider3")}
        for prim in bodies.values():
            equal(prim["type"], "Mesh")
            check_mesh(prim)
            assert set(prim["attributes"]["faceVertexCounts"]) == {3}
        for name in "materials_1", "collider1":
            samples = bodies[name]["samples"]["xformOp:transform"]
            equal((bodies[name]["attributes"]["xformOpOrder"], len(samples)), (["xformOp:transform"], 4))
            for code, matrix in samples.items():
                for p in bodies[name]["attributes"]["points"]:
                    x = upright(place(p, matrix))
                    off = math.dist(x, [9, 10 * code / 30, 0]) - 0.1
                    if name == "collider1":  # turned back about its middle
                        c, s = math.cos(code / 3 * math.pi / 2), math.sin(code / 3 * math.pi / 2)
                        dx, dy = x[0] - 9, x[1] - 3
                        off = max(abs(c * dx + s * dy) - 0.5, abs(c * dy - s * dx) - 1, abs(x[2]) - 1.5)
                    assert abs(off) < 4e-6, (up, name, code, off)  # float32 up to 10 m: 1e-6
        plane = bodies["collider2"]
        assert not plane["samples"]
        for p in plane["attributes"]["points"]:
            assert abs(upright(place(p, plane["attributes"]["xformOp:transform"]))[1] + 9) < 4e-6
        limb = list(bodies["collider3"]["samples"]["points"].values())
        assert len(limb) == 4 and limb[0] != limb[3] and "xformOpOrder" not in bodies["collider3"]["attributes"]
        middle = upright([sum(p[k] for p in limb[0]) / len(limb[0]) for k in range(3)])
        assert math.dist(middle, [9, -5, 0]) < 3, middle


def test_last_frame():
    """a run that ends between two frames has a last time code that is not whole; bounds are of all frames"""
    write_scene(duration=0.11, frame_rate=20, gravity=[0, 90, 0])
    good("run", "scene.json", "--out", "out", "--format", "usd")
    layer = composed("out")
    samples = layer.prims["/run/sheet"]["samples"]["points"]
    equal(list(samples), [0, 1, 2, 2.2])
    equal(layer.metadata["endTimeCode"], 2.2)
    check_mesh(layer.prims["/run/sheet"])
    assert not os.path.exists("out/positions_1.usda")


def test_killed():
    """a run that is killed leaves a stage with all frames so far, and one with too many files is refused"""
    bodies_scene(duration=1, frame_rate=1000, integrator={"dt": 0.001})
    equal(signalled(signal.SIGKILL, "frame_000030.obj", "--format", "usd,npy,obj"), -signal.SIGKILL)
    layer = composed("out")
    samples = layer.prims["/run/a_tube"]["samples"]["points"]
    assert len(samples) > 3 and abs(len(samples) - read_npy_frames("out")) <= 1
    assert layer.metadata["endTimeCode"] >= max(samples)
    write_scene(colliders=[{"name": f"c{i}", "type": "sphere", "center": [i, 9, 0], "radius": 0.1, "track": [[0, [0, 0, 0]], [1, [0, 1, 0]]]} for i in range(256)])
    refused("run", "scene.json", "--out", "many", "--format", "usd", says="/output/formats/0: usd: 257 cloths and colliders that move")


def read_npy_frames(folder):
    with open(folder + "/positions.npy", "rb") as file:
        return int(re.search(rb"'shape': \((\d+),", file.read(128)).group(1))


def test_grammar_is_strict():
    """the parser of this test finds what is wrong in a file: braces, commas, tuples, names and paths"""
    bodies_scene()
    good("run", "scene.json", "--out", "out", "--format", "usd")
    text = text_of("out/positions.usda")
    Usda(text)
    changes = [("#usda 1.0", "#usda"), ("def Xform \"run\"\n{", "def Xform \"run\"\n"), ("2: [(", "2 [("), ("def Scope", "define Scope"),
               ("2: [(", "0: [("), ("), (", ") ("), ("upAxis", "up"), ("</run/materials/cloth>", "<run/materials/cloth"), ("\"light_denim\"", "\"light denim\""),
               ("int[] faceVertexCounts = [", "int[] faceVertexCounts = "), ("matrix4d xformOp:transform = ((", "matrix4d xformOp:transform = (")]
    for old, new in changes:
        assert old in text, old
        try:
            Usda(text.replace(old, new, 1))
        except AssertionError:
            continue
        raise AssertionError(f"{new!r} for {old!r} was not found")
    for end in range(len(text) - 2, len(text) - 8, -2):
        try:
            Usda(text[:end])
        except AssertionError:
            continue
        raise AssertionError("a file without its end was not found")


run_tests(globals())
