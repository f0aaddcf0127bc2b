#!/usr/bin/env python3
"""test_signals.py: SIGINT, SIGTERM and SIGHUP at any moment of any verb: one line, exit code 130, and whole files or none, unless the verb
had already completed. Output is TAP.

The moments are random; the seed is printed, and DRAPE_SEED=N sets it. A child is signalled once it catches signals, as /proc shows (Linux):
the program installs its handlers first.
"""
import json
import os
import random
import re
import resource
import shutil
import signal
import struct
import subprocess
import time

from program import PROGRAM, Skip, drape, equal, good, read_json, read_npy, read_steps, refused, run_tests, without_warnings, write_scene

LIMIT = 120  # [s] that a child may take to end
SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
SEED = int(os.environ.get("DRAPE_SEED", "1"))
chance = random.Random(SEED)


def large(**changes):
    """961 nodes in layers over a ball: the setup takes a noticeable share of the run."""
    changes.setdefault("duration", 0.05)
    return write_scene(
        mesh={"grid": "square", "columns": 31, "rows": 31, "width": 1, "height": 1},
        colliders=[{"type": "sphere", "center": [0.5, -0.3, 0.5], "radius": 0.25}], frame_rate=60,
        self_contact={"thickness": 1e-3}, **changes)


def catches(pid):
    try:
        with open(f"/proc/{pid}/status", encoding="ascii") as file:
            mask = int(re.search(r"^SigCgt:\s*(\w+)", file.read(), re.M).group(1), 16)
    except (OSError, AttributeError):
        return False
    return mask >> (signal.SIGHUP - 1) & 1  # the last signal that the program catches


def computed(pid):
    """CPU time [s] that a process has taken."""
    with open(f"/proc/{pid}/stat", encoding="utf-8") as file:
        return sum(map(int, file.read().rsplit(")", 1)[1].split()[11:13])) / os.sysconf("SC_CLK_TCK")


def struck(delay, one, *args, until=lambda pid: True, **options):
    """Runs a verb and signals it after a delay, and once `until` is true of its process. Returns exit code, stdout, stderr."""
    with subprocess.Popen([PROGRAM, *args], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                          **options) as child:
        end = time.monotonic() + LIMIT
        while child.poll() is None and not catches(child.pid) and time.monotonic() < end:
            time.sleep(0.0005)
        while child.poll() is None and not until(child.pid) and time.monotonic() < end:
            time.sleep(0.0005)
        time.sleep(delay)
        if child.poll() is None:
            child.send_signal(one)
        try:
            out, err = child.communicate(timeout=LIMIT)
        except subprocess.TimeoutExpired:
            child.kill()
            raise
    return child.returncode, out, without_warnings(err)


def steps_begin(_):
    """Whether the run that writes into "out" is about to make its first step."""
    return os.path.exists("out/steps.csv")


def busy():
    """CPU time [s] of all children so far. Unlike the clock it does not depend on what else the machine does."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def check_files(folder, what):
    """Checks that there are no temporary files and that all others can be read."""
    for path, _, names in os.walk(folder):
        for name in names:
            full = os.path.join(path, name)
            assert not name.endswith(".part"), f"{what}: {full} is left"
            if name.endswith(".json"):
                read_json(full)
            elif name.endswith(".npy"):
                read_npy(full)
            elif name.endswith(".png"):
                with open(full, "rb") as file:
                    equal(file.read()[-8:-4], b"IEND", f"{what}: {full}")
            elif name.endswith(".html"):
                with open(full, "rb") as file:
                    assert file.read().rstrip().endswith(b"</html>"), f"{what}: {full}"


def check_end(code, err, what):
    """Whether the verb was interrupted."""
    if code == 0:
        equal(err, "", what)
        return False
    assert code == 130 and re.fullmatch(r"[^\n]*interrupted[^\n]*\n", err), f"{what}: {code}, {err!r}"
    return True


def strike(args, folder=None, moments=4):
    """Runs the verb once to measure its time, then signals it at its very beginning and at random moments. On a machine that is less busy than
    before it may complete before a random moment, and if it is short even before the beginning is noticed, which is tried again."""
    if folder:
        shutil.rmtree(folder, ignore_errors=True)
    start = time.monotonic()
    good(*args)
    whole = time.monotonic() - start
    cut = 0
    for k in range(moments):
        delay = chance.uniform(0, whole) if k else 0
        one = SIGNALS[k % len(SIGNALS)]
        what = f"{' '.join(args)}: {one.name} after {delay:.4f} s"
        for _ in range(1 if k else 5):
            if folder:
                shutil.rmtree(folder, ignore_errors=True)
            code, _, err = struck(delay, one, *args)
            was_cut = check_end(code, err, what)
            if was_cut:
                break
        assert was_cut or k, f"{what}: it was not interrupted"
        cut += was_cut
        check_files(".", what)
    print(f"# {args[0]}: {cut} of {moments} cut, within {whole:.2f} s")


def test_run():
    """run, with files and checkpoints: interrupted at its beginning it leaves nothing; later, it resumes and ends as if it had not been interrupted"""
    large()
    command = ["run", "scene.json", "--out", "out", "--format", "npy,obj", "--checkpoint-every", "1"]
    code, _, err = struck(0, signal.SIGINT, *command)
    equal((code, err, os.path.exists("out")), (130, "drape run: interrupted\n", False))
    strike(command, "out", moments=6)
    if not os.path.exists("out/summary.json") or read_json("out/summary.json")["status"] == "ok":
        code, _, err = struck(0.3, signal.SIGTERM, *command)
        check_end(code, err, "run")
    good(*command, "--resume")
    good(*command[:2], "--out", "whole", *command[4:])
    equal(read_npy("out/positions.npy"), read_npy("whole/positions.npy"), "positions")
    equal(read_steps("out"), read_steps("whole"), "steps")


def test_static():
    """static has one step, which may take minutes: a signal ends it during the step"""
    write_scene(
        mesh={"grid": "irregular", "columns": 241, "rows": 6, "width": 1, "height": 0.02, "orientation": "horizontal"},
        material={"young_modulus": 1200, "poisson_ratio": 0, "thickness": 0.01, "areal_density": 0.1},
        terms=["stretch.cst", "bend.midedge", {"type": "load.moment", "edge": "right", "moment": 6.283e-4}],
        pins=[{"edge": "left", "clamp": True}], gravity=[0, 0, 0], integrator={"method": "static", "tolerance": 1e-11}, duration=1)
    begun = busy()
    good("run", "scene.json", "--summary", "whole.json")
    whole, begun = busy() - begun, busy()
    code, _, err = struck(0, signal.SIGINT, "run", "scene.json", "--out", "out", until=steps_begin)
    took = busy() - begun
    equal((code, without_warnings(err)), (130, "drape run: t=0: interrupted\n"))
    assert took < 0.9 * whole, (took, whole)
    summary = read_json("out/summary.json")
    equal((summary["status"], summary["steps"]["accepted"]), ("e_stopped", 0))


def endless():
    """A step that takes minutes: so many passes over so many springs, to lengths that they can only come nearer to."""
    return write_scene(
        mesh={"grid": "square", "columns": 400, "rows": 400, "width": 1, "height": 1}, terms=[{"type": "spring.structural", "stiffness": 1000}],
        pins=[{"row": 0}], duration=10, frame_rate=1,
        integrator={"method": "verlet", "dt": 10, "substeps": 1, "strain_limit": 0, "strain_limit_iterations": 1000000})


def test_long_step():
    """a long step is cancelled by a signal; the run ends with the last accepted state"""
    endless()
    code, _, err = struck(0, signal.SIGINT, "run", "scene.json", "--out", "out", until=steps_begin)
    equal((code, without_warnings(err)), (130, "drape run: t=0: interrupted\n"))
    equal(read_json("out/summary.json")["status"], "e_stopped")


def test_two_signals():
    """a second signal, of whatever kind, ends the program at once, as a kill does; the run can be made again in its folder"""
    endless()
    for _ in range(5):  # the step is cancelled half a second after the first signal, which may be before the second
        with subprocess.Popen([PROGRAM, "run", "scene.json", "--out", "out"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as child:
            while child.poll() is None and not (catches(child.pid) and steps_begin(child.pid)):
                time.sleep(0.0005)
            child.send_signal(signal.SIGINT)
            while child.poll() is None and catches(child.pid):
                time.sleep(0.0005)
            child.send_signal(signal.SIGTERM)
            try:
                code = child.wait(LIMIT)
            finally:
                child.kill()
        equal(read_steps("out"), [])
        if code != 130:
            break
        shutil.rmtree("out")
    equal(code, -signal.SIGTERM)
    good("run", "scene.json", "--set", "/integrator/strain_limit_iterations=1", "--set", "/integrator/substeps=0", "--set", "/integrator/dt=0.001", "--duration", "0.001", "--out", "out")


def test_resume():
    """a run that is being resumed, interrupted again and again, ends with the same bits"""
    large(duration=0.2)
    command = ["run", "scene.json", "--format", "npy", "--checkpoint-every", "1", "--out"]
    start = time.monotonic()
    good(*command, "whole")
    whole = time.monotonic() - start
    for k in range(5):
        code, _, err = struck(chance.uniform(0, whole / 2), SIGNALS[k % 3], *command, "out", "--resume")
        check_end(code, err, f"resume {k}")
        check_files(".", f"resume {k}")
    good(*command, "out", "--resume")
    equal(read_npy("out/positions.npy"), read_npy("whole/positions.npy"), "positions")


def test_reading():
    """waiting for a scene from a pipe that has no writer, or whose writer stops in the middle, can be interrupted"""
    os.mkfifo("pipe.json")
    for begun in False, True:
        writer = os.open("pipe.json", os.O_RDWR) if begun else None
        if begun:
            os.write(writer, b'{"drape": 1, ')
        for verb in "run", "info", "check":
            code, out, err = struck(0.1, signal.SIGINT, verb, "pipe.json")
            equal((code, out, err), (130, "", f"drape {verb}: interrupted\n"))
        if begun:
            os.close(writer)


def write_glb(path, targets, seconds, copies=8):
    """A tetrahedron, several times, with morph targets of which each has the same displacements; their weights go from 0 to 1."""
    point = [c for _ in range(copies) for p in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)) for c in p]
    corner = [4 * k + c for k in range(copies) for c in (0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3)]
    data, views, accessors = b"", [], []
    for kind, form, component, values in (("VEC3", "f", 5126, point), ("SCALAR", "H", 5123, corner), ("VEC3", "f", 5126, [1e-3] * len(point)),
                                          ("SCALAR", "f", 5126, [0, seconds]), ("SCALAR", "f", 5126, [0] * targets + [1] * targets)):
        part = struct.pack(f"<{len(values)}{form}", *values)
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(part)})
        accessors.append({"bufferView": len(views) - 1, "componentType": component, "type": kind,
                          "count": len(values) // (3 if kind == "VEC3" else 1)})
        data += part + bytes(-len(part) % 4)
    text = json.dumps({
        "asset": {"version": "2.0"}, "buffers": [{"byteLength": len(data)}], "bufferViews": views, "accessors": accessors,
        "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "targets": [{"POSITION": 2}] * targets}]}],
        "animations": [{"samplers": [{"input": 3, "output": 4}], "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}],
    }, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    with open(path, "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data)) + struct.pack("<I4s", len(text), b"JSON") + text +
                   struct.pack("<I4s", len(data), b"BIN\0") + data)


def test_small_and_slow():
    """small files whose reading takes long: morph targets times frames, pins times nodes, keys of their tracks times nodes; and the bound of such"""
    body = {"type": "animated_mesh", "file": "morph.glb", "frame_rate": 1000, "open": True}
    write_glb("morph.glb", 4000, 130)
    write_scene(colliders=[body])
    os.rename("scene.json", "morph.json")
    sheet = {"grid": "square", "columns": 1000, "rows": 1000, "width": 1, "height": 1}
    everything = [[-9, -9, -9], [9, 9, 9]]
    write_scene(mesh=sheet, pins=[{"box": everything}] * 2000)
    os.rename("scene.json", "pins.json")
    write_scene(mesh=sheet, pins=[{"box": everything, "track": [[t, [0, 0, k]] for t in range(1000)]} for k in (0, 0)])
    os.rename("scene.json", "tracks.json")
    for file in "morph.json", "pins.json", "tracks.json":
        assert os.path.getsize(file) < 300000, file
        code, _, err = struck(0, signal.SIGINT, "info", file, until=lambda pid: computed(pid) >= 2)
        equal((code, err), (130, "drape info: interrupted\n"), file)
    write_glb("morph.glb", 4000, 900)
    refused("info", "morph.json", says="/colliders/0/file: morph.glb: 900001 frames")


def test_count():
    """the count of what passes through what at the end, which takes minutes for so many layers: the run has completed, and says that it did not count"""
    layer = ["v %.6f %.6f %.6f\n" % (x + k * 1e-4, 0.31 * x + 0.17 * z, z) for k in range(9000) for x, z in ((0, 0), (3, 0), (0, 3))]
    with open("layers.obj", "w", encoding="ascii") as file:
        file.writelines(layer + [f"f {3 * k + 1} {3 * k + 2} {3 * k + 3}\n" for k in range(9000)])
    write_scene(mesh={"file": "layers.obj"}, terms=["stretch.edge"], pins=[], integrator={"method": "verlet", "dt": 0.01}, duration=0.01)
    code, out, err = struck(0, signal.SIGINT, "run", "scene.json", "--out", "out", until=lambda pid: steps_begin(pid) and len(read_steps("out")) > 0)
    equal((code, without_warnings(err)), (130, "drape run: interrupted\n"))
    summary = read_json("out/summary.json")
    equal((summary["status"], summary["intersections"]), ("ok", None))
    assert "status    ok" in out, out


def wait_until_idle(child):
    """Until a second passes in which the process takes no CPU time."""
    end, before = time.monotonic() + LIMIT, None
    while child.poll() is None and time.monotonic() < end:
        with open(f"/proc/{child.pid}/stat", encoding="utf-8") as file:
            now = file.read().rsplit(")", 1)[1].split()[11:13]
        if now == before:
            return
        before = now
        time.sleep(1)


def test_waiting():
    """a pipe that nobody reads or writes is left: results that wait for a reader, a run whose files are pipes"""
    write_scene(mesh={"grid": "square", "columns": 20, "rows": 20, "width": 1, "height": 1})
    for verb in ["list"], ["info", "scene.json", "--json"], ["run", "scene.json"]:
        reading, writing = os.pipe()
        os.set_blocking(writing, False)
        try:  # full but for 100 bytes: a part of the results can be written
            while True:
                os.write(writing, bytes(4096))
        except BlockingIOError:
            pass
        os.read(reading, 4096)
        os.set_blocking(writing, True)
        os.write(writing, bytes(3996))
        with subprocess.Popen([PROGRAM, *verb], stdin=subprocess.DEVNULL, stdout=writing, stderr=subprocess.PIPE, text=True) as child:
            wait_until_idle(child)  # it has its results and waits
            equal(child.poll(), None, " ".join(verb) + " did not wait")
            child.send_signal(signal.SIGTERM)
            _, err = child.communicate(timeout=LIMIT)
        os.close(reading)
        os.close(writing)
        equal(child.returncode, 130, err)
        assert re.fullmatch(r"drape: interrupted\n", without_warnings(err)), (verb, err)
    good("run", "scene.json", "--out", "run", "--format", "npy")
    os.remove("run/positions.npy")
    os.mkfifo("run/positions.npy")
    code, _, err = struck(0.2, signal.SIGTERM, "report", "run", "--out", "page.html")
    assert code in (2, 130), (code, err)


def test_asking():
    """info and check"""
    large()
    strike(["info", "scene.json"])
    strike(["info", "scene.json", "--json"])
    strike(["check", "scene.json"])


def test_report():
    """report: the page is whole or not there"""
    large(duration=0.5, integrator={"method": "newton_k", "dt": 0.01})
    good("run", "scene.json", "--out", "run", "--format", "npy", "--frame-rate", "100")
    strike(["report", "run", "--out", "page.html"])


def test_experiments():
    """tradeoff, stability and converge"""
    if not re.search(r"^ +tradeoff ", good("--help"), re.M):
        raise Skip("this build has no experiments")
    write_scene(duration=0.1)
    strike(["tradeoff", "scene.json", "--integrators", "be", "--repeats", "1", "--out", "lab"], "lab")
    strike(["converge", "scene.json", "--integrators", "be", "--levels", "3", "--out", "lab"], "lab")
    strike(["stability", "scene.json", "--integrators", "be", "--axis", "/integrator/dt=1e-3:1e-2:4log", "--axis",
            "/cloth/0/material/young_modulus=1e4:1e6:4log", "--out", "lab"], "lab")


def test_validate():
    """validate"""
    if not re.search(r"^ +validate ", good("--help"), re.M):
        raise Skip("this build has no experiments")
    strike(["validate", "free_fall", "--out", "lab"], "lab")


def test_render():
    """render, of a scene and of a run: a picture, a folder"""
    # An OpenGL driver is unloaded before the sanitizer looks for leaks, so its leaks have no names that could be suppressed.
    os.environ["ASAN_OPTIONS"] = "abort_on_error=1:detect_leaks=0"
    large()
    if drape("render", "scene.json", "--out", "x.png", "--size", "64x48").returncode:
        raise Skip("there is no driver")
    good("run", "scene.json", "--out", "run", "--format", "npy")
    os.remove("x.png")
    for source in "scene.json", "run":
        strike(["render", source, "--out", "x.png", "--size", "320x200"])
        strike(["render", source, "--out", "frames", "--size", "320x200"], "frames")


print(f"# seed {SEED}", flush=True)
raise SystemExit(run_tests(globals()))
