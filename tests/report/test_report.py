#!/usr/bin/env python3
"""`drape report`: the contents of the page, and its behaviour in a browser. Output is TAP.

DRAPE_BUILD is the build folder; or: test_report.py PROGRAM. The tests with a browser need Debian's chromium, and are
skipped without it.
"""
import base64
import json
import os
import re
import select
import shutil
import struct
import subprocess
import sys
import zlib

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "cli"))
from program import LIMIT, PROGRAM, Skip, drape, good, read_npy, run_tests, text_of, write_json, write_text  # noqa: E402  pylint: disable=wrong-import-position

TRICK = "quotes \" and ' and </script><script>throw Error('markup')</script> <!-- and \u00e9"

SCENE = {
    "drape": 1, "description": TRICK,
    "cloth": [{"mesh": {"grid": "square", "columns": 9, "rows": 7, "width": 0.8, "height": 0.6},
               "material": {"young_modulus": 1e5, "thickness": 1e-3, "density": 200}, "terms": ["stretch.edge", "bend.hinge"],
               "pins": [{"corner": "top-left"}, {"corner": "top-right", "track": [[0, [0, 0, 0]], [0.3, [-0.2, 0.1, 0]]]}]}],
    "colliders": [{"type": "sphere", "center": [0.4, -0.3, -0.4], "radius": 0.15, "track": [[0, [0, 0, 0]], [0.5, [0, 0.1, 0]]]},
                  {"type": "plane", "point": [0, -0.8, 0], "normal": [0, 1, 0]},
                  {"type": "box", "center": [1.5, -0.7, 0], "size": [0.2, 0.2, 0.2], "rounding": 0.02},
                  {"type": "capsule", "a": [-0.5, -0.7, 0], "b": [-0.5, -0.5, 0.2], "radius": 0.05},
                  {"type": "cylinder", "a": [-0.5, -0.7, -0.8], "b": [-0.5, -0.4, -0.8], "radius": 0.05}],
    "integrator": {"dt": 0.02, "max_iterations": 7}, "duration": 0.5, "frame_rate": 40}


def refused(*args, code=2, says=""):
    result = drape(*args)
    assert result.returncode == code and result.stdout == "", result
    assert re.fullmatch(r"[^\n]+\n", result.stderr) and says in result.stderr, (says, result.stderr)


def make_run(*args, folder="out", scene=None):
    write_json("scene_of_test.json", scene or SCENE)
    good("run", "scene_of_test.json", "--out", folder, *args)


def read(path):
    return text_of(path)


def block(page, name):
    return re.search(rf'<script type="text/plain" id="{name}">(.*?)</script>', page, re.S).group(1)


def numbers(page, name, kind):
    data = base64.b64decode(block(page, name), validate=True)
    return struct.unpack(f"<{len(data) // struct.calcsize(kind)}{kind}", data)


# ---- The page


def test_contents():
    """the page has the positions of the run to half a step of 16 bits, its tables, summary and scene"""
    make_run()
    said = good("report", "out")
    assert re.fullmatch(r"report    out/report.html, [\d.]+ MB, 21 of 21 frames\n", said), said
    page = read("out/report.html")
    data = json.loads(block(page, "run"))
    (frames, nodes, _), positions = read_npy("out/positions.npy")
    field = data["fields"][0]
    levels = numbers(page, "positions", "H")
    assert (data["nodes"], data["frames"]["all"], len(levels)) == (nodes, frames, len(positions))
    for i, level in enumerate(levels):
        k = i % 3
        assert abs(field["low"][k] + field["step"][k] * level - positions[i]) <= 0.5001 * field["step"][k] + 1e-9, i
    assert max(field["step"]) < 2 / 65535  # 2 m wide
    assert max(numbers(page, "triangles", "I")) == nodes - 1 and len(numbers(page, "triangles", "I")) == 3 * data["triangles"]
    rows = read("out/steps.csv").splitlines()
    assert data["steps"]["rows"] == len(rows) - 1 == len(data["steps"]["columns"]["t"])
    assert 0 in data["steps"]["columns"]["accepted"], "some attempt is rejected in this scene"
    assert len(data["energies"]["columns"]["t_state"]) == frames == len(data["frames"]["times"])
    summary = json.loads(read("out/summary.json"))
    assert list(data["summary"]) == list(summary) and data["summary"]["hash"] == summary["hash"]
    assert all(abs(data["summary"]["energy"][name] - value) <= 1e-8 * abs(value) for name, value in summary["energy"].items())
    assert data["scene"] == read("out/scene.json") and json.loads(data["scene"])["description"] == TRICK
    assert len(data["colliders"]) == 5 and len(data["colliders"][0]["displacements"]) == frames
    assert data["pinned"] == [0, 8]


def test_render_mesh():
    """the page shows the render mesh of a cloth, and counts the triangles of the simulated one"""
    cloth = {**SCENE["cloth"][0], "render_mesh": {"grid": "square", "columns": 15, "rows": 12, "width": 0.8, "height": 0.6}}
    make_run(scene={**SCENE, "cloth": [cloth]})
    good("report", "out")
    page = read("out/report.html")
    data = json.loads(block(page, "run"))
    (_, vertices, _), x = read_npy("out/render_positions.npy")
    levels, field = numbers(page, "positions", "H"), data["fields"][0]
    assert (data["nodes"], data["triangles"], data["simulated_triangles"], len(levels)) == (vertices, 2 * 14 * 11, 2 * 8 * 6, len(x))
    for i, level in enumerate(levels):
        assert abs(field["low"][i % 3] + field["step"][i % 3] * level - x[i]) < field["step"][i % 3] + 1e-9, i
    assert max(numbers(page, "triangles", "I")) == vertices - 1 and len(numbers(page, "triangles", "I")) == 3 * data["triangles"]
    assert data["pinned"] == [0, 14] and len(numbers(page, "strain", "H")) == len(x) // 3


def test_strain_and_speed():
    """strain and speed follow their definitions, computed here for one frame"""
    make_run()
    good("report", "out")
    page = read("out/report.html")
    data = json.loads(block(page, "run"))
    (frames, nodes, _), x = read_npy("out/positions.npy")
    speed, levels, k = data["fields"][2], numbers(page, "speed", "H"), 7
    for node in range(nodes):
        displacement = [x[(((k + 1) * nodes) + node) * 3 + i] - x[((k - 1) * nodes + node) * 3 + i] for i in range(3)]
        wanted = sum(w * w for w in displacement) ** 0.5 * 20  # centred differences at 40 frames a second
        assert abs(speed["low"][0] + speed["step"][0] * levels[k * nodes + node] - wanted) < speed["step"][0] + 1e-9
    strain = numbers(page, "strain", "H")
    field = data["fields"][1]
    assert all(abs(field["low"][0] + field["step"][0] * level) < 1e-6 + field["step"][0] for level in strain[:nodes]), "at rest"
    assert frames * nodes == len(strain) and field["low"][0] + 65535 * field["step"][0] > 1e-3


def test_one_file():
    """the page loads nothing from elsewhere, and a text in the scene cannot end its script element"""
    make_run()
    good("report", "out")
    page = read("out/report.html")
    assert "default-src 'none'" in page
    links = set(re.findall(r"""https?://[^\s"'<>)]+""", page))
    assert links <= {"http://www.w3.org/2000/svg"}, links
    assert not re.search(r"""<(link|img|iframe|script)[^>]*\s(src|href)=""", page)
    assert page.count("<script") == page.count("</script>") == 6
    assert page.count("throw Error(") == block(page, "run").count("throw Error(") == 1


def test_names():
    """no function or constant of one script replaces that of another: all share one scope"""
    make_run()
    good("report", "out")
    names = re.findall(r"^(?:function|const|class) +(\w+)", read("out/report.html"), re.M)
    assert "Player" in names and len(set(names)) == len(names), sorted(names)


def test_small():
    """with less room, frames are left out evenly; the first and the last are kept"""
    make_run("--frame-rate", "4000", "--duration", "0.5")
    said = good("report", "out", "--megabytes", "1", "--out", "small.html")
    kept, frames = (int(n) for n in re.search(r"(\d+) of (\d+) frames", said).groups())
    assert frames == 2001 and 1000 < kept < 1200 and os.path.getsize("small.html") < 2.2e6, said
    data = json.loads(block(read("small.html"), "run"))
    chosen = data["frames"]["numbers"]
    assert chosen[0] == 0 and chosen[-1] == 2000 and len(chosen) == kept
    assert {b - a for a, b in zip(chosen, chosen[1:])} <= {1, 2}


def test_unfinished():
    """a killed run has a report, without a summary and with at most one frame more than rows"""
    make_run()
    os.remove("out/summary.json")
    rows = read("out/energy.csv").splitlines(keepends=True)
    write_text("out/energy.csv", "".join(rows[:-1]) + rows[-1][:10])
    assert "20 of 20 frames" in good("report", "out/")
    assert json.loads(block(read("out/report.html"), "run"))["summary"] is None


def test_refused():
    """a folder that is not a run is one line, exit 2, and no page"""
    make_run()
    refused("report", says="RUN is missing")
    refused("report", "nowhere", says="no scene.json")
    refused("report", "out", "--megabytes", "0", says="1 to 2000")
    refused("report", "out", "--out", "nowhere/x.html", code=1, says="nowhere/x.html")
    for name, text, says in (("scene.json", "{", "scene.json:1"), ("positions.npy", "x", "not an array"), ("energy.csv", "a,b\n", 'no column "t"'),
                             ("steps.csv", "a,b\n", 'no column "t"'), ("energy.csv", read("out/energy.csv").splitlines()[0] + "\n", "no row")):
        shutil.rmtree("bad", ignore_errors=True)
        shutil.copytree("out", "bad")
        write_text("bad/" + name, text)
        refused("report", "bad", says=says)
        assert not any(name.startswith("report") for name in os.listdir("bad")), os.listdir("bad")
    os.remove("bad/positions.npy")
    refused("report", "bad", says="writes it with the frame format npy")
    shutil.rmtree("bad")
    shutil.copytree("out", "bad")
    with open("bad/positions.npy", "rb+") as file:
        file.truncate(2000)
    refused("report", "bad", says="less data")
    scene = json.loads(read("out/scene.json"))
    scene["cloth"][0]["mesh"]["rows"] = 8
    write_json("bad/scene.json", scene)
    refused("report", "bad", says="63 nodes, the scene of the folder has 72")


# A tetrahedron that stretches to the right from 0.1 s to 0.3 s, in three frames.
TETRAHEDRON = [(0, -0.6, 0), (0.2, -0.6, 0), (0, -0.4, 0), (0, -0.6, -0.2)]
STRETCHES = [0, 0.2, 0.1]


def stretched(amount):
    return [(x + (amount if i == 1 else 0), y, z) for i, (x, y, z) in enumerate(TETRAHEDRON)]


def make_deforming_run():
    for frame, amount in enumerate(STRETCHES):
        with open(f"body_{frame}.obj", "w", encoding="ascii") as file:
            file.writelines("v %g %g %g\n" % p for p in stretched(amount))
            file.write("f 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\n")
    body = {"type": "animated_mesh", "file": "body_%d.obj", "frame_rate": 10, "start": 0.1}
    write_json("scene_of_test.json", {**SCENE, "colliders": [SCENE["colliders"][1], body]})
    good("run", "scene_of_test.json", "--out", "out")
    good("report", "out")


def test_deforming():
    """the page has the points of a collider that deforms at every kept frame, to half a step of 16 bits"""
    make_deforming_run()
    page = read("out/report.html")
    data = json.loads(block(page, "run"))
    shape = data["colliders"][1]["shape"]
    levels, times = numbers(page, shape["block"], "H"), data["frames"]["times"]
    assert len(levels) == 12 * len(times) == 12 * 21 and shape["count"] == 4 and len(shape["triangles"]) == 12
    assert "shape" not in data["colliders"][0]
    for f, time in enumerate(times):
        s = min(max((time - 0.1) * 10, 0), 2)
        a = min(int(s), 1)
        wanted = [c for p in stretched(STRETCHES[a] + (s - a) * (STRETCHES[a + 1] - STRETCHES[a])) for c in p]
        for i, value in enumerate(wanted):
            k, level = i % 3, levels[12 * f + i]
            assert abs(shape["low"][k] + shape["step"][k] * level - value) <= 0.5001 * shape["step"][k] + 1e-9, (f, i)


# ---- In a browser


class Browser:
    """A page in a headless chromium, controlled through pipes (the DevTools protocol; messages end with a zero byte)."""

    def __init__(self, path, width=1200, height=900):
        program = shutil.which("chromium")
        if not program:
            raise Skip("no chromium: apt-get install chromium")
        theirs, self.to = os.pipe()
        self.back, writes = os.pipe()

        def place():  # the browser reads from 3 and writes to 4
            read, write = os.dup(theirs), os.dup(writes)
            os.dup2(read, 3)
            os.dup2(write, 4)
        self.log = open("chromium.log", "w", encoding="utf-8")
        self.process = subprocess.Popen([program, "--headless=new", "--no-sandbox", "--hide-scrollbars", "--use-angle=swiftshader",
                                         "--enable-unsafe-swiftshader", "--no-first-run", "--user-data-dir=" + os.path.abspath("profile"),
                                         f"--window-size={width},{height}", "--remote-debugging-pipe", "about:blank"],
                                        stdout=self.log, stderr=self.log, preexec_fn=place, close_fds=False)
        os.close(theirs)
        os.close(writes)
        self.buffer, self.count, self.session, self.complaints, self.events = b"", 0, None, [], []
        target = next(one for one in self.ask("Target.getTargets")["targetInfos"] if one["type"] == "page")["targetId"]
        self.session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in "Page", "Runtime", "Log":
            self.ask(domain + ".enable")
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        self.ask("Page.navigate", url=path)
        while "Page.loadEventFired" not in self.events:
            self.hear()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait(timeout=LIMIT)
        os.close(self.to)
        os.close(self.back)
        self.log.close()

    def hear(self):
        while b"\0" not in self.buffer:
            ready, _, _ = select.select([self.back], [], [], 60)
            chunk = os.read(self.back, 1 << 20) if ready else b""
            assert chunk, "chromium does not answer: " + read("chromium.log")[-2000:]
            self.buffer += chunk
        message, _, self.buffer = self.buffer.partition(b"\0")
        message = json.loads(message)
        method, what = message.get("method", ""), message.get("params", {})
        self.events.append(method)
        if method == "Runtime.exceptionThrown" or (method == "Log.entryAdded" and what["entry"]["level"] in ("error", "warning")) or (
                method == "Runtime.consoleAPICalled"):
            self.complaints.append(json.dumps(what)[:600])
        return message

    def ask(self, method, **what):
        self.count += 1
        message = {"id": self.count, "method": method, "params": what, **({"sessionId": self.session} if self.session else {})}
        os.write(self.to, json.dumps(message).encode() + b"\0")
        while (answer := self.hear()).get("id") != self.count:
            pass
        assert "error" not in answer, (method, answer["error"])
        return answer["result"]

    def evaluate(self, text):
        answer = self.ask("Runtime.evaluate", expression=text, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def settle(self, frames=3):
        """Waits until the page has drawn this many more times."""
        self.evaluate(f"new Promise((done) => {{ let n = {frames}; const next = () => (n-- ? requestAnimationFrame(next) : done()); next(); }})")

    def press(self, key):
        text = {"text": key} if len(key) == 1 else {}
        self.ask("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        self.ask("Input.dispatchKeyEvent", type="keyUp", key=key)
        self.settle()

    def mouse(self, kind, x, y, **more):
        self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)
        self.settle()

    def shot(self):
        with open("shot.png", "wb") as file:
            file.write(base64.b64decode(self.ask("Page.captureScreenshot", format="png")["data"]))
        return png("shot.png")[1]


def address(name, fragment=""):
    return "file://" + os.path.abspath(name) + ("#" + fragment if fragment else "")


def png(path):
    """Width and rows of RGB of a PNG with 8 bits and no interlace, read by the definition of the format."""
    with open(path, "rb") as file:
        data = file.read()
    at, packed = 8, b""
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        if kind == b"IHDR":
            width, height, depth, color, _, _, interlace = struct.unpack(">IIBBBBB", data[at + 8:at + 21])
            assert depth == 8 and interlace == 0 and color in (2, 6)
        elif kind == b"IDAT":
            packed += data[at + 8:at + 8 + size]
        at += 12 + size
    bpp = 3 if color == 2 else 4
    raw, rows, before = zlib.decompress(packed), [], bytearray(width * bpp)
    for r in range(height):
        start = r * (1 + width * bpp)
        kind, line = raw[start], bytearray(raw[start + 1:start + 1 + width * bpp])
        for i in range(width * bpp):
            a, b, c = (line[i - bpp] if i >= bpp else 0), before[i], (before[i - bpp] if i >= bpp else 0)
            if kind == 1:
                line[i] = (line[i] + a) & 255
            elif kind == 2:
                line[i] = (line[i] + b) & 255
            elif kind == 3:
                line[i] = (line[i] + (a + b) // 2) & 255
            elif kind == 4:
                p = a + b - c
                near = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
                line[i] = (line[i] + near) & 255
        rows.append([tuple(line[i:i + 3]) for i in range(0, width * bpp, bpp)])
        before = line
    return width, rows


def red(rows):
    """Pixels in the colours of the cloth's two sides, in the left half, where the view is."""
    return {(r, c) for r, row in enumerate(rows) for c, (x, y, z) in enumerate(row[:600]) if 100 < r < 600 and x > 1.5 * z + 20 and x > y + 20}


LOOK = """({ time: state.time, shown: element('time').textContent, scrub: Number(element('scrub').value), playing: state.playing,
  shade: state.shade, edges: state.edges, legend: !element('legend').hidden, kinetic: document.querySelector('.series output').textContent,
  cursors: [...document.querySelectorAll('.cursor')].map((line) => Number(line.getAttribute('x1'))) })"""


def test_drawn():
    """the view shows the moving cloth, also coloured by strain; the page works as a local file, and its console has no messages"""
    make_run()
    good("report", "out")
    with Browser(address("out/report.html", "t=0.1")) as page:
        page.settle()
        assert page.evaluate("state.time") == 0.1
        first = red(page.shot())
        page.evaluate("location.hash = 't=0.4'")
        page.settle()
        later = red(page.shot())
        assert len(first) > 1000 and len(later) > 1000, (len(first), len(later))
        assert len(first ^ later) > 500, "the cloth has moved"
        page.evaluate("location.hash = 't=0.4&shade=strain&edges=1'")
        page.settle()
        strained = page.shot()
        assert len(red(strained)) < 0.3 * len(later), "another colour map"
        assert len({strained[r][c] for r, c in later}) > 100, "shades of strain"
        assert not page.complaints, page.complaints


def test_deforming_drawn():
    """the view shows the points of a collider that deforms where they are at the time"""
    make_deforming_run()
    corner = "player.colliders[1].moving.positions[3]"
    with Browser(address("out/report.html", "t=0.05")) as page:
        page.settle()
        shape = json.loads(block(read("out/report.html"), "run"))["colliders"][1]["shape"]
        first, shots = page.evaluate(corner), [page.shot()]
        page.evaluate("location.hash = 't=0.2'")
        page.settle()
        assert abs(first - 0.2) < shape["step"][0] and abs(page.evaluate(corner) - 0.4) < shape["step"][0]
        shots.append(page.shot())
        page.evaluate("location.hash = 't=0.25'")
        page.settle()
        assert abs(page.evaluate(corner) - 0.35) < 2 * shape["step"][0], "between two frames"
        changed = [(r, c) for r in range(100, 600) for c in range(600) if shots[0][r][c] != shots[1][r][c]]
        assert len(changed) > 500, len(changed)
        assert not page.complaints, page.complaints


def test_moves():
    """keys, plots and the mouse move the time and the view; the cursor of every plot follows"""
    make_run()
    good("report", "out")
    with Browser(address("out/report.html")) as page:
        page.settle()
        opened = page.evaluate(LOOK)
        assert opened["time"] == 0.5 and opened["shown"].endswith("frame 20 of 20"), opened
        page.press("Home")
        start = page.evaluate(LOOK)
        assert start["time"] == 0 and start["shown"] == "0.000 s, frame 0 of 20" and len(start["cursors"]) == 4, start
        for _ in range(5):
            page.press("ArrowRight")
        five = page.evaluate(LOOK)
        page.press("ArrowLeft")
        four = page.evaluate(LOOK)
        page.press("End")
        end = page.evaluate(LOOK)
        assert abs(five["time"] - 5 / 40) < 1e-9 and abs(four["time"] - 4 / 40) < 1e-9 and five["kinetic"] != start["kinetic"]
        assert abs(end["time"] - 0.5) < 1e-9 and abs(end["scrub"] - 0.5) < 1e-6 and end["shown"].endswith("frame 20 of 20")
        for one, other in ((start, four), (four, five), (five, end)):
            assert all(a < b for a, b in zip(one["cursors"], other["cursors"])), (one, other)
        page.press("2")
        page.press("e")
        strain = page.evaluate(LOOK)
        assert (strain["shade"], strain["legend"], strain["edges"]) == ("strain", True, True), strain

        # Slowly: on a busy machine ten frames at full speed pass the end and start again.
        page.evaluate("element('rate').value = '0.1'; element('rate').dispatchEvent(new Event('change'))")
        page.press("Home")
        page.press(" ")
        page.settle(5)
        playing = page.evaluate(LOOK)
        assert playing["playing"] and playing["time"] > 0 and playing["cursors"][0] > start["cursors"][0], playing
        page.press(" ")
        paused = page.evaluate(LOOK)
        page.settle(5)
        assert not paused["playing"] and page.evaluate("state.time") == paused["time"]

        left, top, width = page.evaluate("(({ left, top, width }) => [left, top, width])(document.querySelector('.plots svg').getBoundingClientRect())")
        page.mouse("mousePressed", left + 62 + (width - 72) / 2, top + 50, button="left", buttons=1, clickCount=1)
        assert abs(page.evaluate("state.time") - 0.25) < 0.01
        page.mouse("mouseMoved", left + 62 + 0.8 * (width - 72), top + 50, button="left", buttons=1)
        page.mouse("mouseReleased", left + 62 + 0.8 * (width - 72), top + 50, button="left")
        assert abs(page.evaluate("state.time") - 0.4) < 0.01

        eye = page.evaluate("player.eye()")
        page.mouse("mousePressed", 300, 350, button="left", buttons=1, clickCount=1)
        page.mouse("mouseMoved", 380, 370, button="left", buttons=1)
        page.mouse("mouseReleased", 380, 370, button="left")
        turned = page.evaluate("player.eye()")
        page.mouse("mouseWheel", 300, 350, deltaX=0, deltaY=300)
        assert sum((a - b) ** 2 for a, b in zip(eye, turned)) ** 0.5 > 0.1
        assert page.evaluate("player.distance") > 1.2 * page.evaluate("3 * player.bounds.radius")
        page.press("r")
        assert max(abs(a - b) for a, b in zip(eye, page.evaluate("player.eye()"))) < 1e-9
        assert page.evaluate("element('description').textContent") == TRICK and page.evaluate("element('status').textContent") == "done"
        assert page.evaluate("document.querySelectorAll('figure').length") == 4
        assert not page.complaints, page.complaints


def test_no_view():
    """without WebGL 2 the page says so, and its plots work"""
    make_run()
    good("report", "out")
    write_text("bare.html", read("out/report.html").replace("<body>", "<body><script>HTMLCanvasElement.prototype.getContext = () => null</script>"))
    with Browser(address("bare.html")) as page:
        page.press("End")
        assert not page.evaluate("element('no-view').hidden") and page.evaluate("state.time") == 0.5
        assert all("WebGL" in complaint for complaint in page.complaints) and len(page.complaints) == 1, page.complaints



sys.exit(run_tests(globals()))
