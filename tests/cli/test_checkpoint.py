#!/usr/bin/env python3
"""test_checkpoint.py: `drape run --checkpoint-every` and `--resume`: runs that were killed, interrupted, or out of disk space resume and end
with the files of an undisturbed run; a checkpoint of another run is refused, and no file is touched."""
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys

from program import LIMIT, PROGRAM, SOURCES, drape, equal, good, read_json, read_npy, refused, run_tests, signalled, without_warnings, write_scene

ALL = "npy,obj,ply,vtp,pc2,glb,usd"


def contents(folder, but=("checkpoint.drape",)):
    """{name: hash} of all files; the summary without wall clock times."""
    found = {}
    for name in sorted(os.listdir(folder)):
        with open(f"{folder}/{name}", "rb") as file:
            data = file.read()
        if name == "summary.json":
            summary = json.loads(data)
            summary.pop("wall_s")
            data = json.dumps(summary).encode()
        if name not in but and name != "manifest.jsonl":  # it has the inodes of files
            found[name] = hashlib.sha256(data).hexdigest()
    return found


def same(one, other):
    a, b = contents(one), contents(other)
    different = sorted(name for name in a.keys() | b.keys() if a.get(name) != b.get(name))
    assert not different, f"{one} and {other} differ in {different}"


def stopped(kind):
    """A run with all formats that receives a signal after its first checkpoint. Returns the exit code."""
    return signalled(kind, "checkpoint.drape", "--format", ALL, "--checkpoint-every", "1")


def test_kills():
    """runs with several integrators and formats that are killed at random times and resumed end with the same bits"""
    command = [sys.executable, SOURCES + "/tools/kills", PROGRAM, "--kills", "12", "--folder", "kills",
               "--cases", "be,bdf2,midpoint,newton_k,ida,error"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, check=False)
    print("# " + result.stdout.strip().replace("\n", "\n# "))
    equal(result.returncode, 0, result.stdout + result.stderr)


def test_interrupted():
    """Ctrl-C leaves a checkpoint of the moment; the last frame of an interrupted run is not in the resumed one"""
    write_scene(duration=2, frame_rate=50, integrator={"dt": 0.0005})
    good("run", "scene.json", "--out", "whole", "--format", ALL)
    equal(stopped(signal.SIGINT), 130)
    part = read_json("out/summary.json")
    assert part["status"] == "e_stopped" and part["time"] < 2, part
    good("run", "scene.json", "--out", "out", "--format", ALL, "--resume", "--threads", "2")
    same("whole", "out")


def test_bodies():
    """the same for frames with colliders that move, deform and stay, and with a mesh of quadrilaterals, texture coordinates and materials"""
    scenes = SOURCES + "/examples/scenes/"
    with open("strip.obj", "w", encoding="utf-8") as file:
        print("mtllib a.mtl", *(f"v {i / 5} {j / 5} 0" for j in (0, 1) for i in range(6)), *(f"vt {i / 5} {j}" for j in (0, 1) for i in range(6)),
              *(f"usemtl m{i % 2}\nf {i}/{i} {i + 1}/{i + 1} {i + 7}/{i + 7} {i + 6}/{i % 2 * 6 + i}" for i in range(1, 6)), sep="\n", file=file)
    write_scene(duration=2, frame_rate=25, integrator={"dt": 0.002}, cloth=[{
        "mesh": {"file": "strip.obj"}, "pins": [{"nodes": [0, 1]}], "terms": ["stretch.edge"],
        "material": {"young_modulus": 1e4, "thickness": 1e-3, "density": 200}}], colliders=[
            {"type": "sphere", "center": [9, 0, 0], "radius": 0.1, "track": [[0, [0, 0, 0]], [2, [0, 1, 0]]]},
            {"type": "box", "center": [9, 3, 0], "size": [1, 1, 1], "turns": [{"time": 0, "rotate": [0, 1, 0, 0]}, {"time": 2, "rotate": [0, 1, 0, 720]}]},
            {"type": "plane", "point": [0, -9, 0], "normal": [0, 1, 0]},
            {"type": "animated_mesh", "file": scenes + "limb.npy", "mesh": scenes + "limb.obj", "frame_rate": 8, "track": [[0, [9, -5, 0]]]}])
    good("run", "scene.json", "--out", "whole", "--format", ALL)
    equal(stopped(signal.SIGINT), 130)
    assert read_json("out/summary.json")["time"] < 2
    good("run", "scene.json", "--out", "out", "--format", ALL, "--resume")
    same("whole", "out")


def test_no_checkpoint_and_finished():
    """--resume without a checkpoint starts a run, and leaves a finished run as it is"""
    write_scene(colliders=[{"type": "plane", "point": [0, -0.02, 0], "normal": [0, 1, 0]}])
    good("run", "scene.json", "--out", "whole", "--format", ALL)
    text = good("run", "scene.json", "--out", "out", "--format", ALL, "--resume", "--checkpoint-every", "2")
    same("whole", "out")
    with open("out/summary.json", "rb") as file:
        summary = file.read()
    before = {name: os.stat("out/" + name).st_mtime_ns for name in os.listdir("out") if name not in ("summary.json", "manifest.jsonl")}
    for _ in range(2):
        equal(good("run", "scene.json", "--out", "out", "--format", ALL, "--resume"), text, "results")
        with open("out/summary.json", "rb") as file:
            equal(file.read(), summary, "the summary")
    equal({name: os.stat("out/" + name).st_mtime_ns for name in os.listdir("out") if name not in ("summary.json", "manifest.jsonl")}, before)
    os.remove("out/summary.json")
    good("run", "out/scene.json", "--out", "out", "--resume")
    with open("out/summary.json", "rb") as file:
        equal(file.read(), summary, "the summary that was lost")


def test_events():
    """a run with events that was interrupted stops at the same event, after the same release, and leaves the same files; a finished one stays as it is"""
    write_scene(duration=2, frame_rate=50, integrator={"dt": 0.0005},
                events=[{"type": "pin_force", "limit": 0.02, "action": "release", "pins": "pin1"}, {"type": "height", "height": -0.25, "action": "stop"}])
    good("run", "scene.json", "--out", "whole", "--format", ALL)
    message = read_json("whole/summary.json")["message"]
    assert "stopped by event" in message, message
    equal(stopped(signal.SIGINT), 130)
    for _ in range(2):
        good("run", "scene.json", "--out", "out", "--format", ALL, "--resume")
        same("whole", "out")


def pinned_nodes(path):
    """The nodes that a .vtp file says are pinned."""
    with open(path, "rb") as file:
        data = file.read()
    offset = int(re.search(rb'Name="pinned" NumberOfComponents="1" format="appended" offset="(\d+)"', data).group(1))
    begin = data.index(b"\n_") + 2 + offset
    size = int.from_bytes(data[begin:begin + 8], "little")
    return [node for node, pinned in enumerate(data[begin + 8:begin + 8 + size]) if pinned]


def test_two_releases():
    """a run that was interrupted between two releases of pins has, when resumed, the same files, and frames say which nodes are pinned at their time"""
    write_scene(duration=0.6, frame_rate=50, integrator={"dt": 0.0005}, pins=[{"name": name, "corner": f"top-{name}"} for name in ("left", "right")],
                events=[{"type": "height", "height": height, "action": "release", "pins": name} for name, height in (("right", -0.2605), ("left", -0.27))])
    good("run", "scene.json", "--out", "whole", "--format", ALL)
    first, second = (event["occurrences"][0]["time"] for event in read_json("whole/summary.json")["events"])
    assert 0.2 < first < 0.3 < second < 0.5, (first, second)
    nodes = pinned_nodes("whole/frame_000000.vtp")
    equal(len(nodes), 2)
    for frame in range(31):
        equal(pinned_nodes(f"whole/frame_{frame:06}.vtp"), nodes[:(frame / 50 <= first) + (frame / 50 <= second)], f"frame {frame}")
    equal(signalled(signal.SIGINT, f"frame_{int(50 * first) + 1:06}.vtp", "--format", ALL, "--checkpoint-every", "1"), 130)
    assert first < read_json("out/summary.json")["time"] < second, "it was not interrupted between the events"
    good("run", "scene.json", "--out", "out", "--format", ALL, "--resume")
    same("whole", "out")


def test_without_output_formats():
    """runs without frames, an equilibrium, and a new run, which removes the checkpoint of the run before it"""
    write_scene(integrator={"method": "static"})
    for name in "whole", "out":
        good("run", "scene.json", "--out", name, "--format", "", *(["--checkpoint-every", "1"] if name == "out" else []))
    same("whole", "out")
    good("run", "scene.json", "--out", "out", "--format", "", "--resume")
    same("whole", "out")
    good("run", "scene.json", "--out", "out", "--format", "npy")
    assert not os.path.exists("out/checkpoint.drape")


def test_damaged_when_finished():
    """--resume of a finished run names a file that was damaged or removed, and changes nothing"""
    write_scene(duration=0.2)
    run = ["run", "scene.json", "--out", "out", "--format", "npy,obj", "--checkpoint-every", "2"]
    good(*run)
    for name in ("positions.npy", "frame_000003.obj", "steps.csv", "scene.json"):
        with open(f"out/{name}", "rb") as file:
            kept = file.read()
        with open(f"out/{name}", "r+b") as file:
            file.seek(len(kept) // 2)
            file.write(b"\0")
        refused(*run, "--resume", says=name)
        os.remove(f"out/{name}")
        refused(*run, "--resume", says=name)
        with open(f"out/{name}", "wb") as file:
            file.write(kept)
        good(*run, "--resume")


def test_refused():
    """a checkpoint of another scene, damaged, or beside other files: exit 2, one line, and nothing is touched"""
    write_scene(duration=1, integrator={"dt": 0.0005})
    equal(stopped(signal.SIGKILL), -signal.SIGKILL)
    shutil.copytree("out", "kept", ignore=shutil.ignore_patterns("*.part"))  # which have the inode of the folder in their names
    run = ["run", "scene.json", "--out", "out", "--resume"]

    def broken(says, *args, formats=ALL, change=lambda: None):
        change()
        before = contents("out", but=())
        refused(*run, "--format", formats, *args, says=says)
        equal(contents("out", but=()), before, f"files after {says!r}")
        shutil.rmtree("out")
        shutil.copytree("kept", "out")

    def edit(name, position, data=None):
        with open("out/" + name, "r+b") as file:
            if data is None:
                file.truncate(position)
            else:
                file.seek(position)
                file.write(data)

    refused("run", "scene.json", "--resume", says="--out")
    refused("run", "scene.json", "--checkpoint-every", "5", says="--out")
    refused("run", "scene.json", "--checkpoint-every", "0", "--out", "x", says="1 to")
    refused("run", "scene.json", "--resume", "--realtime", "--out", "x", says="--realtime")
    broken("another model", "--set", "/gravity=[0,-9,0]")
    broken("other settings", "--dt", "0.002")
    broken("integrator", "--integrator", "bdf2")
    broken("run of 1 s", "--duration", "2")
    broken("formats", formats="npy")
    broken("frames in", formats=ALL.replace("npy,obj", "obj,npy"))
    broken("z up", "--set", "/output/up=z")
    broken("damaged", change=lambda: edit("checkpoint.drape", 1000, b"?"))
    broken("damaged", change=lambda: edit("checkpoint.drape", 1000))
    broken("not a Drape checkpoint", change=lambda: edit("checkpoint.drape", 0))
    broken("not a Drape checkpoint", change=lambda: shutil.copy("scene.json", "out/checkpoint.drape"))
    broken("positions.npy", change=lambda: edit("positions.npy", 200))
    broken("steps.csv", change=lambda: edit("steps.csv", 20))
    broken("energy.csv", change=lambda: os.remove("out/energy.csv"))
    broken("positions.glb", change=lambda: os.remove("out/positions.glb"))
    broken("frame_000000.obj", change=lambda: os.remove("out/frame_000000.obj"))
    broken("positions.pc2", change=lambda: os.truncate("out/positions.pc2", 40))
    broken("frames.pvd", change=lambda: os.remove("out/frames.pvd"))
    good("run", "scene.json", "--out", "whole", "--format", ALL)
    good(*run, "--format", ALL)
    same("whole", "out")


def test_full():
    """a full disk ends the run; the last checkpoint is valid, and the run resumes from it"""
    write_scene(duration=5)
    good("run", "scene.json", "--out", "whole", "--format", "npy")
    for blocks in 20, 30, 35:
        script = f'ulimit -f {blocks}; exec "$0" run scene.json --out out --format npy --checkpoint-every 3'
        result = subprocess.run(["/bin/sh", "-c", script, PROGRAM], capture_output=True, text=True, timeout=LIMIT, check=False)
        equal(result.returncode, 1, result.stderr)
        equal(read_json("out/summary.json")["status"], "e_file")
        assert read_npy("out/positions.npy")[0][0] > 1
        good("run", "scene.json", "--out", "out", "--format", "npy", "--resume")
        same("whole", "out")
        shutil.rmtree("out")


def test_a_later_failure():
    """a run that fails after a checkpoint fails again with the same message when it is resumed"""
    write_scene(duration=1, integrator={"dt": 0.01, "max_iterations": 4}, controller={"type": "fixed"},
                pins=[{"corner": "top-left"}, {"corner": "top-right", "track": [[0, [0, 0, 0]], [0.3, [0, 0, 0]], [0.31, [0, 5, 0]]]}])
    found = [drape("run", "scene.json", "--out", "out", "--checkpoint-every", "2")]
    first = contents("out")
    found.append(drape("run", "scene.json", "--out", "out", "--resume"))
    equal([result.returncode for result in found], [1, 1], found[0].stderr)
    equal(*(without_warnings(result.stderr) for result in found))  # the second begins with those that apply to its checkpoint
    equal(contents("out"), first)


if __name__ == "__main__":
    sys.exit(run_tests(globals()))
