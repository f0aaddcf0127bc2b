#!/usr/bin/env python3
"""test_signals.py: SIGINT, SIGTERM and SIGHUP at any moment of any verb: one line, exit code 130, and whole files or none. Output is TAP.

A moment is a call of the program: preload.c sends the signal in that call, so every signal hits, on any machine. The calls are random; the seed is
printed, and DRAPE_SEED=N sets it. Where a verb waits, or computes without such calls, /proc says so (Linux).
"""
import fcntl
import json
import os
import random
import re
import shutil
import signal
import struct
import subprocess
import termios

from program import (LIMIT, PROGRAM, Skip, calls_of, catches, counted, drape, equal, good, meddled, read_json, read_npy, read_steps, refused, run_tests, signalled, wait_for,
                     without_warnings, write_scene)

SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
SEED = int(os.environ.get("DRAPE_SEED", "1"))
chance = random.Random(SEED)


def touching(**changes):
    """16 nodes over a ball, which touch it and may touch each other."""
    return write_scene(colliders=[{"type": "sphere", "center": [0.1, -0.2, 0.1], "radius": 0.15}], frame_rate=60, self_contact={"thickness": 1e-3}, **changes)


def status(pid):
    """The fields of /proc/pid/stat from the state on."""
    with open(f"/proc/{pid}/stat", encoding="utf-8") as file:
        return file.read().rsplit(")", 1)[1].split()


def waits(pid):
    """Whether the main thread of a process that catches signals sleeps in a system call."""
    return catches(pid) and status(pid)[0] == "S"


def computed(pid):
    """CPU time [s] that a process has taken."""
    return sum(map(int, status(pid)[11:13])) / os.sysconf("SC_CLK_TCK")


def struck(one, until, *args, stdout=subprocess.PIPE):
    """Runs a verb and signals it once `until` is true of its process. Returns exit code, stdout, stderr."""
    with subprocess.Popen([PROGRAM, *args], stdin=subprocess.DEVNULL, stdout=stdout, stderr=subprocess.PIPE, text=True) as child:
        try:
            wait_for(lambda: until(child.pid), child)
            child.send_signal(one)
            out, err = child.communicate(timeout=LIMIT)
        finally:
            child.kill()
    return child.returncode, out, without_warnings(err)


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


def remove(path):
    if path and os.path.isdir(path):
        shutil.rmtree(path)


def strike(*args, out=None, moments=4, last=0.8):
    """Signals the verb as soon as it catches signals, and at random calls. Each time it is interrupted: after the share `last` of its calls it may
    have results, and complete."""
    remove(out)
    count = calls_of(*args)
    for k in range(moments):
        one, call = SIGNALS[k % len(SIGNALS)], chance.randint(2, int(last * count)) if k else 1
        what = f"{' '.join(args)}: {one.name} at call {call} of {count}"
        remove(out)
        result = meddled(*args, signal=int(one), call=call)
        assert result.returncode == 130 and re.fullmatch(r"[^\n]*interrupted[^\n]*\n", without_warnings(result.stderr)), f"{what}: {result}"
        check_files(".", what)
    print(f"# {args[0]}: {moments} of {moments} cut, in the first {int(last * count)} of {count} calls")


def test_run():
    """run, with files and checkpoints: interrupted at its beginning it leaves nothing; later, it resumes and ends as if it had not been interrupted"""
    touching()
    command = ["run", "scene.json", "--format", "npy,obj", "--checkpoint-every", "1", "--out"]
    result = meddled(*command, "out", signal=int(signal.SIGINT), call=1)
    equal((result.returncode, result.stderr, os.path.exists("out")), (130, "drape run: interrupted\n", False))
    strike(*command, "out", out="out", moments=12)
    equal(signalled(signal.SIGTERM, "frame_000002.obj", *command[2:-1]), 130)
    good(*command, "out", "--resume")
    good(*command, "whole")
    equal(read_npy("out/positions.npy"), read_npy("whole/positions.npy"), "positions")
    equal(read_steps("out"), read_steps("whole"), "steps")


def test_resume():
    """a run that is being resumed, interrupted again and again, ends with the same bits"""
    touching(duration=0.2)
    command = ["run", "scene.json", "--format", "npy", "--checkpoint-every", "1", "--out"]
    count = calls_of(*command, "whole")
    for k in range(5):  # they all hit: a run that is resumed repeats the setup
        result = meddled(*command, "out", "--resume", signal=int(SIGNALS[k % 3]), call=count * (k + 3) // 12 if k else 1)
        equal(result.returncode, 130, result.stderr)
        check_files(".", f"resume {k}")
    good(*command, "out", "--resume")
    equal(read_npy("out/positions.npy"), read_npy("whole/positions.npy"), "positions")


def test_static():
    """static has one step, which may take minutes: a signal ends it during the step"""
    write_scene(
        mesh={"grid": "irregular", "columns": 121, "rows": 6, "width": 1, "height": 0.04, "orientation": "horizontal"},
        material={"young_modulus": 1200, "poisson_ratio": 0, "thickness": 0.01, "areal_density": 0.1},
        terms=["stretch.cst", "bend.midedge", {"type": "load.moment", "edge": "right", "moment": 6.283e-4}],
        pins=[{"edge": "left", "clamp": True}], gravity=[0, 0, 0], integrator={"method": "static", "tolerance": 1e-11}, duration=1)
    command = "run", "scene.json", "--out", "out"
    count = calls_of(*command)
    shutil.rmtree("out")
    result = meddled(*command, signal=int(signal.SIGINT), call=count // 2, count="count")
    equal((result.returncode, without_warnings(result.stderr)), (130, "drape run: t=0: interrupted\n"))
    summary = read_json("out/summary.json")
    equal((summary["status"], summary["steps"]["accepted"]), ("e_stopped", 0))
    made = counted()[1]
    assert made < 0.9 * count, (made, count)  # a step that went on to its end would make all of them


def test_long_step():
    """a long step is cancelled by a signal; the run ends with the last accepted state"""
    write_scene(  # a step that takes minutes: so many passes over so many springs, to lengths that they can only come nearer to
        mesh={"grid": "square", "columns": 120, "rows": 120, "width": 1, "height": 1}, terms=[{"type": "spring.structural", "stiffness": 1000}],
        pins=[{"row": 0}], duration=10, frame_rate=1,
        integrator={"method": "verlet", "dt": 10, "substeps": 1, "strain_limit": 0, "strain_limit_iterations": 1000000})
    begun = []

    def computes(pid):  # within its first step, before which the files are there
        if os.path.exists("out/steps.csv"):
            begun.append(computed(pid))
        return begun and computed(pid) > begun[0] + 0.3
    code, _, err = struck(signal.SIGINT, computes, "run", "scene.json", "--out", "out")
    equal((code, err), (130, "drape run: t=0: interrupted\n"))
    equal(read_json("out/summary.json")["status"], "e_stopped")


def test_two_signals():
    """a second signal, of whatever kind, ends the program at once, as a kill does; the run can be made again in its folder"""
    touching()
    command = "run", "scene.json", "--out", "out"
    for second in SIGNALS:
        result = meddled(*command, signal=int(signal.SIGINT), file="steps.csv", again=int(second))
        equal((result.returncode, without_warnings(result.stderr), read_steps("out")), (-second, "", []))
        assert not os.path.exists("out/summary.json")
        good(*command)
        shutil.rmtree("out")


def test_reading():
    """waiting for a scene from a pipe that has no writer, or whose writer stops in the middle, can be interrupted"""
    os.mkfifo("pipe.json")
    for begun in False, True:
        for verb in "run", "info", "check":
            writer = os.open("pipe.json", os.O_RDWR) if begun else None
            if begun:
                os.write(writer, b'{"drape": 1, ')
            equal(struck(signal.SIGINT, lambda pid: waits(pid) and not (begun and unread(writer)), verb, "pipe.json"), (130, "", f"drape {verb}: interrupted\n"))
            if begun:
                os.close(writer)


def unread(pipe):
    """The number of bytes in a pipe."""
    return struct.unpack("i", fcntl.ioctl(pipe, termios.FIONREAD, b"\0\0\0\0"))[0]


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
        code, _, err = struck(signal.SIGINT, lambda pid: computed(pid) >= 1, "info", file)
        equal((code, err), (130, "drape info: interrupted\n"), file)
    write_glb("morph.glb", 4000, 900)
    refused("info", "morph.json", says="/colliders/0/file: morph.glb: 900001 frames")


def test_count():
    """the count of what passes through what at the end, which takes minutes for so many layers: the run has completed, and says that it did not count"""
    layer = ["v %.6f %.6f %.6f\n" % (x + k * 1e-4, 0.31 * x + 0.17 * z, z) for k in range(9000) for x, z in ((0, 0), (3, 0), (0, 3))]
    with open("layers.obj", "w", encoding="ascii") as file:
        file.writelines(layer + [f"f {3 * k + 1} {3 * k + 2} {3 * k + 3}\n" for k in range(9000)])
    write_scene(mesh={"file": "layers.obj"}, terms=["stretch.edge"], pins=[], integrator={"method": "verlet", "dt": 0.01}, duration=0.01)
    code, out, err = struck(signal.SIGINT, lambda _: os.path.exists("out/steps.csv") and read_steps("out"), "run", "scene.json", "--out", "out")
    equal((code, err), (130, "drape run: interrupted\n"))
    summary = read_json("out/summary.json")
    equal((summary["status"], summary["intersections"]), ("ok", None))
    assert "status    ok" in out, out


def test_waiting():
    """a pipe that nobody reads is left: results that wait for a reader"""
    write_scene(mesh={"grid": "square", "columns": 20, "rows": 20, "width": 1, "height": 1})
    for verb in ["list"], ["info", "scene.json", "--json"], ["run", "scene.json", "--threads", "1"]:
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
        code, _, err = struck(signal.SIGTERM, waits, *verb, stdout=writing)
        os.close(reading)
        os.close(writing)
        equal((code, err), (130, "drape: interrupted\n"), verb[0])


def test_asking():
    """info, check, report and compare: the page is whole or not there"""
    touching()
    strike("info", "scene.json", last=0.6)
    strike("info", "scene.json", "--json", last=0.6)
    strike("check", "scene.json")
    good("run", "scene.json", "--out", "run", "--format", "npy")
    strike("report", "run", "--out", "page.html")
    strike("compare", "run", "run", "--out", "table.csv")


def test_experiments():
    """tradeoff, stability, converge and validate"""
    if not re.search(r"^ +tradeoff ", good("--help"), re.M):
        raise Skip("this build has no experiments")
    write_scene(duration=0.1)
    strike("tradeoff", "scene.json", "--integrators", "be", "--repeats", "1", "--out", "lab", out="lab")
    strike("converge", "scene.json", "--integrators", "be", "--levels", "3", "--out", "lab", out="lab")
    strike("stability", "scene.json", "--integrators", "be", "--axis", "/integrator/dt=1e-3:1e-2:4log", "--axis",
           "/cloth/0/material/young_modulus=1e4:1e6:4log", "--out", "lab", out="lab", last=0.6)
    strike("validate", "free_fall", "--out", "lab", out="lab")


def test_render():
    """render, of a scene and of a run: a picture, a folder"""
    # An OpenGL driver is unloaded before the sanitizer looks for leaks, so its leaks have no names that could be suppressed.
    os.environ["ASAN_OPTIONS"] = "abort_on_error=1:detect_leaks=0"
    touching()
    if drape("render", "scene.json", "--out", "x.png", "--size", "64x48").returncode:
        raise Skip("there is no driver")
    good("run", "scene.json", "--out", "run", "--format", "npy")
    for source in "scene.json", "run":
        strike("render", source, "--out", "x.png", "--size", "160x100", last=0.4)
        strike("render", source, "--out", "frames", "--size", "160x100", out="frames")


print(f"# seed {SEED}", flush=True)
raise SystemExit(run_tests(globals()))
