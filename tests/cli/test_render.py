#!/usr/bin/env python3
"""`drape render` and `drape view`: checks of the pixels of pictures. Output is TAP.

DRAPE_BUILD is the build folder; or: test_render.py PROGRAM. A test is a function test_*; its docstring is its name. Tests are skipped if
the machine lacks what they need (an OpenGL driver, ffmpeg, Xvfb, numpy). With GOLDEN=write the golden pictures are written anew.
"""
import functools
import glob
import os
import shutil
import signal
import struct
import subprocess
import sys
import time
import zlib

from program import LIMIT, PROGRAM, Skip, catches, drape, equal, good, read_json, run_tests, write_json, write_text

try:
    import numpy
except ImportError:
    numpy = None

GOLDEN = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "golden", "render")
SIZE = (320, 200)


# ---- Scenes, calls, pictures


def write_scene(name="ball.json", **changes):
    """A cloth of 13 x 13 nodes that has just fallen on a ball."""
    cloth = {
        "mesh": {"grid": "square", "columns": 13, "rows": 13, "width": 1, "height": 1,
                 "transform": {"translate": [-0.5, 0.52, 0.5]}},
        "material": {"young_modulus": 1e4, "thickness": 1e-3, "density": 200},
        "terms": ["stretch.edge", "bend.hinge", {"type": "damp.kelvin_voigt", "beta": 0.01}],
    }
    whole = {"drape": 1, "cloth": [cloth], "gravity": [0, -9.81, 0],
             "colliders": [{"type": "sphere", "center": [0, 0.25, 0], "radius": 0.25, "friction": 0.3},
                           {"type": "plane", "point": [0, 0, 0], "normal": [0, 1, 0]}],
             "contact": {"distance": 0.01, "friction": "lagged"},
             "integrator": {"dt": 0.01, "tolerance": 1e-5}, "duration": 0.25, "frame_rate": 20}
    for key, value in changes.items():
        (cloth if key in cloth else whole)[key] = value
    for key in [key for key, value in whole.items() if value is None]:
        del whole[key]
    write_json(name, whole)
    return name


def one_line(result, code, says):
    equal(result.returncode, code, result.stderr)
    equal(result.stderr.count("\n"), 1, result.stderr)
    assert says in result.stderr, f"{says!r} is not in {result.stderr!r}"


def render(*args, out="x.png", size=SIZE):
    good("render", *args, "--out", out, "--size", f"{size[0]}x{size[1]}")
    return read_png(out)


def read_png(path):
    """(height, width, 3) of a PNG of 8 bits without a palette."""
    with open(path, "rb") as file:
        data = file.read()
    equal(data[:8], b"\x89PNG\r\n\x1a\n", path)
    at, packed = 8, b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", data[at + 8:at + 18])
        if kind == b"IDAT":
            packed += data[at + 8:at + 8 + length]
        at += 12 + length
    assert depth == 8 and colour in (2, 6), f"{path}: depth {depth}, colour type {colour}"
    step = 3 if colour == 2 else 4
    raw = numpy.frombuffer(zlib.decompress(packed), numpy.uint8).reshape(height, 1 + step * width)
    rows = numpy.zeros((height, step * width), numpy.uint8)
    for y in range(height):
        rows[y] = unfilter(raw[y, 0], raw[y, 1:], rows[y - 1] if y else numpy.zeros(step * width, numpy.uint8), step)
    return rows.reshape(height, width, step)[:, :, :3].astype(int)


def unfilter(kind, line, above, step):
    """One row of a PNG (its specification, 9.2)."""
    if kind == 0:
        return line
    if kind == 2:
        return line + above
    if kind == 1:
        return numpy.add.accumulate(line.reshape(-1, step), axis=0, dtype=numpy.uint8).reshape(-1)
    out = numpy.zeros(len(line), int)
    up = above.astype(int)
    for i, value in enumerate(line.astype(int)):
        a, b, c = (out[i - step] if i >= step else 0), up[i], (up[i - step] if i >= step else 0)
        if kind == 3:
            guess = (a + b) // 2
        else:
            p = a + b - c
            guess = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
        out[i] = (value + guess) & 255
    return out.astype(numpy.uint8)


def write_png(path, pixels):
    height, width, _ = pixels.shape
    rows = b"".join(b"\0" + pixels[y].astype(numpy.uint8).tobytes() for y in range(height))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
                   + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))


def need_pictures():
    if numpy is None:
        raise Skip("no numpy here")
    need_driver()


@functools.cache
def without_driver():
    """Why this build or machine draws nothing, or ""."""
    probe = drape("render", write_scene("probe.json", duration=0.01), "--out", "probe.png", "--size", "64x64")
    if probe.returncode == 2 and ("without drawing" in probe.stderr or "draw without a display" in probe.stderr):
        return probe.stderr.strip()
    equal(probe.returncode, 0, probe.stderr)
    return ""


def need_driver():
    if without_driver():
        raise Skip(without_driver())


def need(program):
    if not shutil.which(program):
        raise Skip(f"no {program} here")


def shadings():
    lines = good("list", "shadings").splitlines()[1:]
    return [line.split()[0] for line in lines if line.startswith("  ") and line[2] != " "]


# ---- Pictures


def test_shadings():
    """every shading draws the cloth as its golden picture has it; it differs from the floor, has light and shade, and no black pixels"""
    need_pictures()  # a mean difference of 2 of 255 is allowed: drivers may differ by rounding and at edges
    small = (160, 100)
    good("run", write_scene(), "--out", "ball", "--format", "npy")
    empty = render("ball", "--camera", "30,89.9,0.02", out="empty.png", size=small)  # from far above: only floor
    for shade in shadings():
        source = "ball.json" if shade == "residual" else "ball"
        image = render(source, "--shade", shade, out="a.png", size=small)
        equal(image.shape, (small[1], small[0], 3), shade)
        middle = (slice(45, 55), slice(75, 85))  # the camera frames the cloth: the middle of the picture is cloth
        assert abs(image[middle].mean(axis=(0, 1)) - empty.mean(axis=(0, 1))).max() > 8, f"{shade}: the middle looks like the floor"
        cloth = image[30:70, 50:110]
        assert cloth.sum(axis=2).min() > 24, f"{shade}: black at {cloth.sum(axis=2).min()}"
        assert cloth.std() > 6, f"{shade}: all of one colour"
        if shade in ("wireframe", "refraction", "pbr", "strain"):
            render(source, "--shade", shade, out="b.png", size=small)
            with open("a.png", "rb") as a, open("b.png", "rb") as b:
                assert a.read() == b.read(), f"{shade}: two pictures differ"
        if shade == "residual":  # a converged residual is rounding, which differs between machines
            continue
        path = os.path.join(GOLDEN, shade + ".png")
        if os.environ.get("GOLDEN") == "write":
            os.makedirs(GOLDEN, exist_ok=True)
            write_png(path, image)
        away = abs(image - read_png(path))
        assert away.mean() < 2, f"{shade}: {away.mean():.2f} of 255 in the mean, {away.max()} at most"


def test_run_and_scene():
    """a scene, its finished run, and the copy of the scene in the run give the same picture, byte for byte"""
    need_pictures()
    good("run", write_scene(), "--out", "ball", "--format", "npy", "--dt", "0.0125")
    render("ball", out="a.png")
    render("ball.json", "--dt", "0.0125", out="b.png")
    render("ball/scene.json", out="c.png")
    data = [open(name, "rb").read() for name in ("a.png", "b.png", "c.png")]
    assert data[0] == data[1] == data[2]


def test_render_mesh():
    """a render mesh is drawn in place of the simulated mesh: the same mesh gives the same picture, half of it a cloth half as wide"""
    need_pictures()
    whole = {"grid": "square", "columns": 13, "rows": 13, "width": 1, "height": 1, "transform": {"translate": [-0.5, 0.52, 0.5]}}
    half = {**whole, "columns": 20, "width": 0.5}
    pictures = []
    for name, mesh in ("plain", None), ("same", whole), ("half", half):
        scene = write_scene()
        if mesh:
            data = read_json(scene)
            data["cloth"][0]["render_mesh"] = mesh
            write_json(scene, data)
        good("run", scene, "--out", name)
        pictures.append(render(name, "--camera", "0,89.9", "--shade", "normals", out=name + ".png").astype(int))
    plain, same, half = pictures
    assert (abs(plain - same) > 8).mean() < 1e-3  # rounding of positions
    for image, wanted in (plain, 1), (half, 0.5):
        ys, xs = numpy.nonzero(image.max(axis=2) - image.min(axis=2) > 40)
        assert abs(numpy.ptp(xs) / numpy.ptp(ys) - wanted) < 0.15, (numpy.ptp(xs), numpy.ptp(ys))


def test_texture():
    """seen from the front, a texture has the orientation of its file; from below it is mirrored"""
    need_pictures()
    picture = numpy.zeros((64, 64, 3), int)
    picture[:32, :32], picture[:32, 32:] = (255, 0, 0), (0, 255, 0)  # red, green above
    picture[32:, :32], picture[32:, 32:] = (0, 0, 255), (255, 255, 0)  # blue, yellow below
    write_png("quarters.png", picture)
    write_scene(colliders=None, contact=None)
    top = render("ball.json", "--frame", "0", "--texture", "quarters.png", "--shade", "texture", "--camera", "0,89.9")
    below = render("ball.json", "--frame", "0", "--texture", "quarters.png", "--shade", "texture", "--camera", "0,-89.9")

    def corners(image):
        return ["".join("RGB"[k] for k in range(3) if image[y, x, k] > 0.6 * image[y, x].max())
                for y, x in ((75, 135), (75, 185), (125, 135), (125, 185))]
    equal(corners(top), ["R", "G", "B", "RG"], "from above")
    equal(corners(below), ["B", "RG", "R", "G"], "from below, turned over its left to right axis")
    for turn in (0, 180):  # hanging cloth has its texture upright, whichever row is on top
        write_scene(colliders=None, contact=None,
                    mesh={"grid": "square", "columns": 13, "rows": 13, "width": 1, "height": 1, "orientation": "vertical",
                          "transform": {"rotate": [0, 0, 1, turn]}})
        seen = [corners(render("ball.json", "--frame", "0", "--texture", "quarters.png", "--shade", "texture", "--camera", f"{side},0"))
                for side in (0, 180)]
        assert ["R", "G", "B", "RG"] in seen and ["G", "R", "RG", "B"] in seen, f"hanging, turned by {turn}: {seen}"


def test_light():
    """the side towards the lamp is lit and the other is not, seen from the front and from the back"""
    need_pictures()
    write_scene(colliders=None, contact=None,
                mesh={"grid": "square", "columns": 13, "rows": 13, "width": 1, "height": 1, "orientation": "vertical"})
    light = [render("ball.json", "--frame", "0", "--camera", f"{azimuth},10")[80:120, 140:180].mean() for azimuth in (0, 180)]
    assert min(light) > 70, f"a face is not lit: {light}"


def test_lamp_stands():
    """the lamp does not move with the camera: a shadow to the right is to the left when seen from behind"""
    need_pictures()
    plane = {"type": "plane", "point": [0, 0, 0], "normal": [0, 1, 0]}
    write_scene(colliders=[plane])

    def shadow(azimuth):
        image = render("ball.json", "--frame", "0", "--camera", f"{azimuth},50,0.6")
        dark = (image.max(axis=2) < 160) & (image.max(axis=2) - image.min(axis=2) < 30)  # grey: no cloth
        assert dark.sum() > 500, "no shadow"
        return numpy.nonzero(dark)[1].mean() - SIZE[0] / 2
    sides = [shadow(azimuth) for azimuth in (76, 256)]  # the lamp, at -14 degrees, to the left and to the right
    assert sides[0] > 5 > -5 > sides[1], f"the shadow lies at {sides}"


def test_soft_shadow():
    """the shadow of a cloth high above the floor has a softer edge than that of one near it"""
    need_pictures()
    plane = {"type": "plane", "point": [0, 0, 0], "normal": [0, 1, 0]}

    def steepest(height):
        write_scene(colliders=[plane], mesh={"grid": "square", "columns": 13, "rows": 13, "width": 1, "height": 1,
                                             "transform": {"translate": [-0.5, height, 0.5]}})
        image = render("ball.json", "--frame", "0", "--shade", "normals", "--camera", "160,35,0.8")
        floor = image.max(axis=2) - image.min(axis=2) < 24  # grey: not the cloth, whose upper side is green
        for _ in range(2):  # nor pixels next to it
            floor[1:-1, 1:-1] = floor[1:-1, 1:-1] & floor[:-2, 1:-1] & floor[2:, 1:-1] & floor[1:-1, :-2] & floor[1:-1, 2:]
        steps = abs(numpy.diff(image.mean(axis=2), axis=0))[floor[1:] & floor[:-1]]
        return numpy.sort(steps)[-20:].mean()
    near, far = steepest(0.1), steepest(0.8)
    assert near > 1.5 * far > 0, f"the steepest edges of the shadow: {near:.1f} of 255 a pixel near the floor, {far:.1f} high above it"


def test_ambient_occlusion():
    """the floor is darker at the foot of a cloth that stands on it, on the side of the lamp, where no shadow falls"""
    need_pictures()
    write_scene(colliders=[{"type": "plane", "point": [0, 0, 0], "normal": [0, 1, 0]}],
                mesh={"grid": "square", "columns": 13, "rows": 13, "width": 1, "height": 1, "orientation": "vertical",
                      "transform": {"translate": [-0.5, 1.01, 0]}})
    image = render("ball.json", "--frame", "0", "--shade", "normals", "--camera", "0,40,0.6")
    column = image[:, 155:165].mean(axis=1)
    cloth = numpy.nonzero(column.max(axis=1) - column.min(axis=1) > 40)[0]  # the normals are blue, the floor is grey
    foot = column[cloth.max() + 3:cloth.max() + 8].mean()
    away = column[-12:].mean()
    assert foot + 10 < away < 256, f"the floor is {foot:.0f} at the foot and {away:.0f} away from it"


def test_colliders_are_hidden():
    """a box below a wavy cloth is not seen through it: flat triangles clear it by 4 mm, curves that continue the slopes of the waves would cut it"""
    need_pictures()
    count, low, high = 17, 0.004, 0.08
    heights = [low if i % 4 < 2 else high for i in range(count)]
    xs = [1.4 * i / (count - 1) - 0.7 for i in range(count)]
    with open("waves.obj", "w", encoding="utf-8") as file:
        for j in range(count):
            for i in range(count):
                file.write(f"v {xs[i]} {heights[i]} {-xs[j]}\n")
        for j in range(count - 1):
            for i in range(count - 1):
                a = j * count + i + 1
                file.write(f"f {a} {a + 1} {a + count + 1}\nf {a} {a + count + 1} {a + count}\n")
    write_png("red.png", numpy.full((8, 8, 3), (220, 30, 30)))
    write_scene(mesh={"file": "waves.obj"}, colliders=[{"type": "box", "center": [0, -0.2, 0], "size": [1, 0.4, 1]}])
    for camera in ("0,89.9", "0,60", "90,70"):
        image = render("ball.json", "--frame", "0", "--shade", "texture", "--texture", "red.png", "--camera", camera)
        middle = image[70:130, 120:200]  # cloth covers the box there
        seen = (middle[:, :, 0] < 1.5 * middle[:, :, 2]).sum()
        equal(seen, 0, f"--camera {camera}: pixels of the box in front of the cloth")


def test_turntable():
    """a turntable begins at --camera, turns by equal angles and would come back after its last frame"""
    need_pictures()
    write_scene(colliders=None, contact=None, gravity=[0, 0, 0])  # nothing moves: only the camera does

    def frames(azimuth):
        good("render", "ball.json", "--turntable", "--camera", f"{azimuth},24", "--out", "turn", "--size", "160x100")
        return [read_png(f"turn/frame_{k:05}.png")[:70] for k in range(6)]  # above the time in the corner
    begun, later = frames(32), frames(92)
    for k in range(6):
        assert abs(begun[k] - begun[(k + 1) % 6]).mean() > 1, f"frames {k} and {k + 1} are the same"
        assert abs(begun[(k + 1) % 6] - later[k]).mean() < 0.2, f"frame {k} of a turntable that begins 60 degrees later"


def test_glass():
    """refraction shows the ball behind the cloth, and not only the room"""
    need_pictures()
    write_scene()
    with_ball = render("ball.json", "--frame", "0", "--shade", "refraction", "--camera", "0,89.9,2")
    write_scene(colliders=[{"type": "plane", "point": [0, 0, 0], "normal": [0, 1, 0]}])
    without = render("ball.json", "--frame", "0", "--shade", "refraction", "--camera", "0,89.9,2")
    assert abs(with_ball - without)[130:165, 130:190].mean() > 15, "the ball is not seen"  # beside the shadow, which is as grey as the ball


def test_legend_has_its_place():
    """the legend lies beside the framed part of the panels: there is no cloth behind its numbers"""
    need_pictures()
    good("run", write_scene(), "--out", "ball", "--format", "npy")
    for runs in (["ball"], ["--compare", "ball", "ball", "ball"]):
        image = render(*runs, "--shade", "strain", "--range", "0,1000", out="legend.png", size=(960, 200))
        beside = image[:, 873:893]  # within the legend, left of its ramp; cloth at the low end of the ramp is violet, even behind a translucent ground
        violet = (beside[:, :, 0] + beside[:, :, 2]) / 2 - beside[:, :, 1]
        assert violet.max() < 12, f"{len(runs)} operands: cloth lies below the legend"


def test_legend():
    """the picture of a field has a ramp, with the range that was asked for"""
    need_pictures()
    good("run", write_scene(), "--out", "ball", "--format", "npy")
    low = render("ball", "--shade", "strain", "--range", "0,1000", out="low.png", size=(640, 400))
    high = render("ball", "--shade", "strain", "--range", "-1000,0", out="high.png", size=(640, 400))
    bar = low[250:380, 560:620]
    assert (abs(bar - high[250:380, 560:620]).max(axis=2) > 40).any(), "the numbers of the legend do not change"
    assert low[180:200, 310:330].mean() + 60 < high[180:200, 310:330].mean(), "low is dark, high is light"


# ---- Films and folders


def frames_of(path):
    out = subprocess.run(["ffprobe", "-v", "error", "-count_frames", "-show_entries", "stream=width,height,nb_read_frames",
                          "-of", "csv=p=0", path], capture_output=True, text=True, timeout=LIMIT, check=True).stdout
    return tuple(int(n) for n in out.strip().split(",")[:3])


def rate_of(path):
    return subprocess.run(["ffprobe", "-v", "error", "-show_entries", "stream=r_frame_rate", "-of", "csv=p=0", path],
                          capture_output=True, text=True, timeout=LIMIT, check=True).stdout.strip()


def test_films():
    """films have every Nth frame of the run, at even sizes if the format needs that"""
    need_pictures()
    need("ffmpeg")
    need("ffprobe")
    good("run", write_scene(), "--out", "ball", "--format", "npy")
    good("render", "ball", "--out", "a.mp4", "--size", "161x101")
    equal(frames_of("a.mp4"), (160, 100, 6), "mp4")
    equal(rate_of("a.mp4"), "20/1", "20 frames a second")
    good("render", "ball", "--out", "b.mp4", "--size", "64x64", "--every", "2", "--slow", "5")
    equal(rate_of("b.mp4"), "2/1", "every other frame, five times slower")
    good("render", "ball", "--out", "a.gif", "--size", "161x101", "--every", "2")
    equal(frames_of("a.gif"), (161, 101, 3), "gif")
    good("render", "ball.json", "--out", "a.webm", "--size", "160x100")
    equal(frames_of("a.webm"), (160, 100, 6), "webm")
    good("render", "ball", "--out", "a.apng", "--size", "161x101", "--every", "3")
    equal(frames_of("a.apng"), (161, 101, 2), "apng")
    equal([name for name in os.listdir(".") if name.endswith(".part")], [], "leftovers")


def test_folder():
    """a folder gets a picture for each frame; the pictures differ; those of an earlier run are removed, other files are not"""
    need_pictures()
    good("render", write_scene(), "--out", "frames", "--size", "160x100")
    equal(sorted(os.listdir("frames")), [f"frame_{k:05}.png" for k in range(6)] + ["manifest.jsonl"])
    assert (read_png("frames/frame_00000.png") != read_png("frames/frame_00005.png")).any()
    others = ["frame_000000.obj", "frame_0001.png", "frames.png", "my_frame_00001.png"]
    for name in others:
        write_text("frames/" + name, "mine")
    good("render", "ball.json", "--out", "frames", "--size", "160x100", "--every", "2")  # as from a longer run: 0, 2, 4
    equal(sorted(os.listdir("frames")), sorted(others + ["manifest.jsonl"] + [f"frame_{k:05}.png" for k in range(3)]))


def test_endings():
    """the ending of a name may be in upper or lower case; a folder has no ending, or a slash at its end, or exists already"""
    need_pictures()
    render(write_scene(), out="x.PNG")
    good("render", "ball.json", "--out", "v1.2/", "--size", "64x64", "--every", "5")
    good("render", "ball.json", "--out", "v1.2", "--size", "64x64", "--every", "5")
    good("render", "ball.json", "--out", "../" + os.path.basename(os.getcwd()) + "/.hidden", "--size", "64x64", "--every", "5")
    equal(os.listdir("v1.2"), os.listdir(".hidden"), "folders")


def test_compare():
    """runs are drawn side by side with one camera, at the same times"""
    need_pictures()
    write_scene()
    good("run", "ball.json", "--out", "be", "--format", "npy")
    good("run", "ball.json", "--out", "fine", "--format", "npy", "--dt", "0.005", "--frame-rate", "40")
    both = render("--compare", "be", "be", size=(320, 120))
    left, right = both[30:, :158], both[30:, 160:318]  # below the labels
    assert (abs(left[:, 2:] - right[:, 2:]) > 3).mean() < 0.01, "the same run twice is not the same panel"
    good("render", "--compare", "be", "fine", "--out", "both", "--size", "320x120")
    equal(len(glob.glob("both/*.png")), 6, "the frames of the first")
    one_line(drape("render", "be", "fine", "--out", "x.png"), 2, "--compare")


# ---- Failures


def test_refused():
    """wrong command lines and folders are one line and exit 2, and write nothing"""
    need_pictures()
    good("run", write_scene(), "--out", "ball", "--format", "npy")
    os.mkdir("empty")
    before = sorted(os.listdir("."))
    cases = [(["ball.json"], "--out is missing"),
             (["ball.json", "--out", "x.png", "--shade", "difuse"], 'did you mean "diffuse"'),
             (["ball.json", "--out", "x.png", "--size", "10x10"], "16 to 8192"),
             (["ball.json", "--out", "x.png", "--size", "100"], "WIDTHxHEIGHT"),
             (["ball.json", "--out", "x.png", "--camera", "1"], "azimuth,elevation"),
             (["ball.json", "--out", "x.png", "--camera", "1,91"], "-90 to 90"),
             (["ball.json", "--out", "x.png", "--frame", "-1"], "--frame"),
             (["ball.json", "--out", "frames", "--frame", "1"], "--frame is for a picture"),
             (["ball.json", "--out", "x.png", "--range", "0,1"], "shows no field"),
             (["ball.json", "--out", "x.png", "--shade", "strain", "--range", "1,0"], "low,high"),
             (["ball.json", "--out", "x.png", "--shade", "texture", "--texture", "none.png"], "none.png"),
             (["ball.json", "--out", "x.png", "--shade", "texture", "--texture", "ball.json"], "as a PNG"),
             (["ball.json", "--out", "x.png", "--texture", "x.png"], '"linen" does not use it; these do: texture'),
             (["ball.json", "--out", "x.png", "--shade", "texture", "--height", "x.png"], "these do: bump, displacement, pbr"),
             (["ball.json", "--out", "x.png", "--shade", "strain", "--environment", "x.png"], "mirror, refraction, pbr"),
             (["ball.json", "--out", "x.bmp"], 'there is no ".bmp"; .png is a picture, .mp4, .webm, .gif, .apng are films'),
             (["ball.json", "--out", "./a.b/x.jpeg"], 'there is no ".jpeg"'),
             (["ball.json", "--out", "x.PNG", "--every", "2"], "--every is for films"),
             (["ball.json", "--out", "frames", "--slow", "2"], "--slow is for films"),
             (["ball.json", "--out", "x.png", "--turntable"], "--turntable is for films"),
             (["ball.json", "--out", "x.png", "--fine", "5"], "--fine"),
             (["ball.json", "--out", "x.png", "--out", "y.png"], "--out is given twice"),
             (["ball.json", "--out", "x.png", "--dt", "0.01", "--dt", "0.02"], "--dt is given twice"),
             (["ball", "--out", "x.png", "--dt", "0.01"], "--dt changes a simulation, and ball is a finished run"),
             (["ball.json", "ball", "--compare", "--out", "x.png", "--set", "/duration=1"], "--set changes a simulation, and ball is a finished run"),
             (["empty", "--out", "x.png"], "scene.json"),
             (["none.json", "--out", "x.png"], "none.json")]
    for args, says in cases:
        one_line(drape("render", *args), 2, says)
    equal(sorted(os.listdir(".")), before, "files")


def test_no_driver():
    """without an EGL driver, drawing is one line and exit 2, and the program still runs scenes"""
    need_pictures()
    env = {**os.environ, "__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent", "__EGL_VENDOR_LIBRARY_DIRS": "/nonexistent"}
    one_line(drape("render", write_scene(), "--out", "x.png", env=env), 2, "libgl1-mesa-dri")
    assert not os.path.exists("x.png")
    good("run", "ball.json", "--duration", "0.02", env=env)


def test_no_ffmpeg():
    """without ffmpeg a film is one line and exit 2; if ffmpeg dies: one line with its last message, exit 1, no file"""
    need_pictures()
    os.mkdir("bin")
    one_line(drape("render", write_scene(), "--out", "x.mp4", env={**os.environ, "PATH": os.path.abspath("bin")}), 2, "ffmpeg")
    for script, says in (("echo first; echo 'no such codec' >&2; exit 3", "no such codec"), ("exit 4", "exit code 4"),
                         ("kill -9 $$", "signal 9")):
        write_text("bin/ffmpeg", "#!/bin/sh\n" + script + "\n")
        os.chmod("bin/ffmpeg", 0o755)
        path = os.path.abspath("bin") + ":" + os.environ["PATH"]
        one_line(drape("render", "ball.json", "--out", "x.mp4", env={**os.environ, "PATH": path}), 1, says)
    equal([name for name in os.listdir(".") if name.startswith("x.")], [], "files")


def test_broken_run():
    """a run with truncated frames, or with those of another scene, is refused with a message"""
    need_pictures()
    good("run", write_scene(), "--out", "ball", "--format", "npy")
    size = os.path.getsize("ball/positions.npy")
    with open("ball/positions.npy", "r+b") as file:
        file.truncate(size - 100)
    one_line(drape("render", "ball", "--out", "x.png"), 2, "less data than its header says")
    os.remove("ball/positions.npy")
    one_line(drape("render", "ball", "--out", "x.png"), 2, "frame format npy")
    write_scene(mesh={"grid": "square", "columns": 3, "rows": 3, "width": 1, "height": 1}, colliders=None, contact=None)
    good("run", "ball.json", "--out", "small", "--format", "npy")
    shutil.copy("small/positions.npy", "ball/positions.npy")
    one_line(drape("render", "ball", "--out", "x.png"), 2, "it has 9 nodes, the scene of the folder has 169")
    os.remove("small/energy.csv")
    one_line(drape("render", "small", "--out", "x.png"), 2, "energy.csv")
    one_line(drape("report", "small"), 2, "energy.csv")


# ---- The window


class Screen:
    """A virtual display whose picture is a file (Xvfb)."""

    def __enter__(self):
        need("Xvfb")
        need("xdotool")
        read, write = os.pipe()
        self.server = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", "640x480x24", "-fbdir", "."],
                                       pass_fds=[write], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as file:
            number = file.readline().strip()
        if not number:
            raise Skip("Xvfb does not start")
        self.env = {**os.environ, "DISPLAY": ":" + number}
        return self

    def __exit__(self, *_):
        self.server.terminate()
        self.server.wait()

    def do(self, *words):
        subprocess.run(["xdotool", *words], env=self.env, check=True, timeout=LIMIT, capture_output=True)

    def look(self):
        """The picture (480, 640, 3), from the format of xwd: 25 numbers, a name, colours of 12 bytes, rows of blue, green, red, 0."""
        with open("Xvfb_screen0", "rb") as file:
            data = file.read()
        head = struct.unpack(">25I", data[:100])
        at, width, height, stride = head[0] + 12 * head[19], head[4], head[5], head[12]
        rows = numpy.frombuffer(data, numpy.uint8, stride * height, at).reshape(height, stride)
        return rows[:, :4 * width].reshape(height, width, 4)[:, :, 2::-1].astype(int)

    def wait(self, what, condition, still=False):
        """The first picture of which a condition is true, and which, if it is to be still, is also the next one."""
        end, before = time.monotonic() + float(os.environ.get("WAIT", LIMIT)), None
        while time.monotonic() < end:
            image = self.look()
            if condition(image) and (not still or before is not None and (image == before).all()):
                return image
            before = image
            time.sleep(0.1)
        write_png("last.png", image)
        if os.environ.get("KEEP"):
            shutil.copy("last.png", os.environ["KEEP"])
        raise AssertionError(f"after {LIMIT} s: {what}")


def reds(image):
    return (image[:, :, 0] > 90) & (image[:, :, 0] > 1.4 * image[:, :, 2])  # terracotta


def test_view():
    """a window starts paused, runs, steps, drags a node, changes integrator, step and shading, and quits"""
    need_pictures()
    write_scene(colliders=None, contact=None, duration=5, frame_rate=60, pins=[{"corner": "top-left"}, {"corner": "top-right"}])
    scene = read_json("ball.json")
    scene["cloth"][0]["pins"] = [{"corner": "top-left"}, {"corner": "top-right"}]
    scene.pop("pins", None)
    write_json("ball.json", scene)
    with Screen() as screen:
        view = subprocess.Popen([PROGRAM, "view", "ball.json", "--size", "640x480", "--shade", "diffuse"], env=screen.env, text=True,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        try:
            def shown(image):
                return reds(image).sum() > 4000
            first = screen.wait("no cloth is seen", shown, still=True)
            lower = slice(300, 460)  # below the text of the state
            screen.do("key", "h", "key", "h")  # first the list of keys, then nothing
            screen.wait("H does not hide the state, or something is left at the upper left",
                        lambda image: (image[20:160, 20:200] != first[20:160, 20:200]).any(axis=2).mean() > 0.5 and
                        image[20:120, 20:150].std(axis=(0, 1)).max() < 8)
            screen.do("key", "h")
            screen.wait("it moves though it is paused", lambda image: (image[lower] == first[lower]).all())
            screen.do("key", "n", "key", "n")
            screen.wait("a step changes nothing", lambda image: (image != first).any())
            screen.do("key", "space")
            moved = screen.wait("it does not run", lambda image: (image[lower] != first[lower]).mean() > 0.02)
            screen.do("key", "i", "key", "d", "key", "k", "key", "g", "key", "p")
            ys, xs = numpy.nonzero(reds(screen.wait("P does not pause", shown, still=True)))
            x, y = int(numpy.median(xs)), int(numpy.median(ys))
            screen.do("mousemove", str(x), str(y), "mousedown", "1", "mousemove", str(x + 12), str(y - 12), "mousemove",
                      str(x + 60), str(y - 60))
            blue = screen.wait("no spring is seen",
                               lambda image: (image[:, :, 2] - image[:, :, 0] > 60).sum() > 20)
            screen.do("mouseup", "1", "key", "s")
            screen.do("mousemove", "600", "440", "mousedown", "1", "mousemove", "560", "430", "mouseup", "1")
            assert moved.shape == blue.shape
            screen.do("key", "Escape")
            out, err = view.communicate(timeout=LIMIT)
        finally:
            if view.poll() is None:
                view.send_signal(signal.SIGKILL)
                view.wait()
    equal((view.returncode, err), (0, ""), "view")
    for part in ("bdf2", "dt = 0.00666667 s", "shade linen", "stiffness x 0.6667", "gravity x 0.6667"):
        assert part in out, f"{part!r} is not in {out!r}"
    assert not out.startswith("t = 0 s"), out


def test_view_interrupted():
    """Ctrl-C ends a window with one line: before it is open, paused, and while the sim runs"""
    need_pictures()
    write_scene(duration=5, frame_rate=60)
    with Screen() as screen:
        def begun(_):
            return catches(view.pid)

        def drawn(image):
            return (image != before).any()
        for option, until in ([], begun), ([], drawn), (["--running"], drawn):
            before = screen.look()
            with subprocess.Popen([PROGRAM, "view", "ball.json", "--size", "320x240", *option], env=screen.env, text=True, stdout=subprocess.PIPE,
                                  stderr=subprocess.PIPE) as view:
                try:
                    screen.wait(f"it is not {until.__name__}", until)
                    view.send_signal(signal.SIGINT)
                    _, err = view.communicate(timeout=LIMIT)
                finally:
                    view.kill()
            equal((view.returncode, err), (130, "drape view: interrupted\n"), f"{option}, {until.__name__}")


def test_no_display():
    """without a display, view is one line and exit 2"""
    need_pictures()
    env = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    result = subprocess.run([PROGRAM, "view", write_scene()], capture_output=True, text=True, timeout=LIMIT, env=env)
    one_line(result, 2, "there is no display")



if __name__ == "__main__":
    sys.exit(run_tests(globals()))
