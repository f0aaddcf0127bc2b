#!/usr/bin/env python3
"""test_folder.py: verbs replace and remove only files that Drape wrote, refuse all else with one line and exit code 2 before anything is
touched, and do not hang on pipes. Output is TAP.
"""
import hashlib
import json
import os
import re
import resource
import shutil
import signal
import socket
import subprocess

from program import PROGRAM, SOURCES, Skip, calls_of, drape, equal, good, meddled, read_json, refused, run_tests, scene, signalled, stopped, text_of, without_warnings, write_scene, write_text

LIMIT = 60  # [s]
MESH = SOURCES + "/tests/bad/good.obj"


def contents(folder):
    """What lies in a folder, without following links or opening pipes."""
    found = {}
    for name in sorted(os.listdir(folder)):
        path = f"{folder}/{name}"
        if os.path.islink(path):
            found[name] = "-> " + os.readlink(path)
        elif os.path.isfile(path):
            with open(path, "rb") as file:
                found[name] = hashlib.sha256(file.read()).hexdigest()
        else:
            found[name] = os.lstat(path).st_mode
    return found


def keeps(folder, *args, says):
    """A call is refused, and the folder stays as it is."""
    before = contents(folder)
    refused(*args, says=says)
    equal(contents(folder), before, " ".join(args))


def put(path, text="mine\n"):
    write_text(path, text)


def mesh_scene(path, mesh):
    """A scene whose cloth is a mesh, relative to the scene."""
    write_scene(mesh={"file": mesh}, pins=[{"nodes": [0]}])
    os.replace("scene.json", path)


RUN = ["run", "scene.json", "--out", "out", "--format"]


def test_names():
    """a file of the user's under any name that a run writes is refused, in every format, and stays"""
    write_scene()
    os.mkdir("out")
    for form, names in {"npy": ["positions.npy", "steps.csv", "energy.csv", "summary.json", "scene.json", "scene_mesh_0.obj",
                                "checkpoint.drape", "manifest.jsonl"],
                        "obj": ["frame_000000.obj", "frame_000003.obj", "frame_999999.obj"], "ply": ["frame_000001.ply"],
                        "vtp": ["frame_000000.vtp", "frames.pvd"], "pc2": ["positions.pc2", "positions.obj"],
                        "glb": ["positions.glb"]}.items():
        for name in names:
            put("out/" + name)
            keeps("out", *RUN, form, says=f'"out/{name}"')
            os.remove("out/" + name)
    for name in "frame_000000.obj", "positions.glb", "frame_1.npy", "note.txt":  # names that this run does not write
        put("out/" + name)
    good(*RUN, "npy")
    for name in "frame_000000.obj", "positions.glb", "frame_1.npy", "note.txt":
        equal(text_of("out/" + name), "mine\n", name)


def test_own_mesh():
    """a mesh that lies in the folder under the name of a frame is not removed, whoever wrote it"""
    os.mkdir("out")
    for name in "frame_000000.obj", "frame_000007.obj", "positions.obj":
        shutil.copy(MESH, "out/" + name)
        mesh_scene("scene.json", "out/" + name)
        keeps("out", *RUN, "obj,pc2", says=f'"out/{name}" would be replaced, but it is an input')
        os.remove("out/" + name)
    write_scene()
    good(*RUN, "obj")
    shutil.copy("scene.json", "first.json")
    mesh_scene("next.json", "out/frame_000003.obj")  # continues from the last frame of the run before
    for form in "npy", "obj":
        keeps("out", "run", "next.json", "--out", "out", "--format", form, says="it is an input")
    good("run", "next.json", "--out", "other", "--format", "npy")
    write_scene(colliders=[{"type": "mesh", "file": "out/frame_000002.obj"}])
    result = drape(*RUN, "npy")
    equal(result.returncode, 2, result.stderr)
    assert os.path.exists("out/frame_000002.obj")


def test_links():
    """links, pipes, sockets and folders under the name of an output are refused at once, and what a link leads to stays"""
    write_scene()
    put("mine")
    os.mkdir("out")
    for name in "steps.csv", "positions.npy", "summary.json", "scene.json", "checkpoint.drape", "manifest.jsonl":
        path = "out/" + name
        os.symlink("../mine", path)
        keeps("out", *RUN, "npy", says="not a regular file")
        os.remove(path)
        os.mkfifo(path)
        keeps("out", *RUN, "npy", says="not a regular file")
        os.remove(path)
        with socket.socket(socket.AF_UNIX) as one:
            one.bind(path)
            keeps("out", *RUN, "npy", says="not a regular file")
        os.remove(path)
        os.mkdir(path)
        keeps("out", *RUN, "npy", says="not a regular file")
        os.rmdir(path)
    equal(text_of("mine"), "mine\n")
    os.symlink("out", "link")  # the folder itself may be a link: the user named it
    good("run", "scene.json", "--out", "link", "--format", "npy")


def test_changed():
    """files of an earlier run are replaced; one that was changed since, or put there by somebody else, is not"""
    write_scene()
    good(*RUN, "npy,obj,vtp,pc2,glb,ply,usd")
    good(*RUN, "npy,obj")
    assert not os.path.exists("out/positions.glb") and not os.path.exists("out/frames.pvd")
    for name in "frame_000001.obj", "steps.csv", "scene.json", "positions.npy":
        with open("out/" + name, "rb") as file:
            data = file.read()
        with open("out/" + name, "r+b") as file:
            file.seek(len(data) // 2)
            file.write(bytes([data[len(data) // 2] ^ 1]))
        keeps("out", *RUN, "npy,obj", says=f'"out/{name}" would be replaced, but it has changed since Drape wrote it')
        with open("out/" + name, "wb") as file:
            file.write(data)
        shutil.copy("out/" + name, "copy")  # another file with the same bytes is as good
        os.replace("copy", "out/" + name)
    good(*RUN, "npy,obj")
    shutil.copytree("out", "moved")
    good("run", "scene.json", "--out", "moved", "--format", "npy")
    os.remove("out/manifest.jsonl")
    keeps("out", *RUN, "npy", says="Drape did not write it")


def test_kill():
    """after a kill at any moment the folder is known: a new run replaces everything, without temporary files"""
    write_scene()
    command = *RUN, "npy,obj,vtp,glb,pc2,usd", "--checkpoint-every", "2"
    count = calls_of(*command)
    for k in range(24):
        result = meddled(*command, signal=int(signal.SIGKILL), call=1 + count * k // 24)
        equal(result.returncode, -signal.SIGKILL, result.stderr)
    good(*RUN, "npy,ply")
    equal([name for name in os.listdir("out") if name.startswith(".") or name.endswith(".obj")], [])


def test_temporary_files():
    """the temporary files of a killed run, which have the inode of the folder in their names, are removed, in a new folder, too; others stay"""
    write_scene()
    os.mkdir("out")
    inode = os.stat("out").st_ino
    lost = [f".drape-{inode:016x}-{digit * 16}.part" for digit in "0a"]
    others = [".drape-" + "1" * 16 + "-0.part", f".drape-{inode + 1:016x}-{'a' * 16}.part", f".drape-{inode:016x}-{'g' * 16}.part",
              f".drape-{inode:016x}-{'a' * 17}.part", f".drape-{inode:016x}-{'a' * 16}.part.mine"]
    for text in "", "of the user":
        for name in lost + others:
            put("out/" + name, text)
        good(*RUN, "npy")
        equal({name for name in os.listdir("out") if name.startswith(".")}, set(others))


def test_lock():
    """a second run into a folder is refused while the first one writes; a killed run leaves no lock"""
    write_scene()
    with stopped(*RUN, "npy,obj", file="frame_000001.obj"):
        for command in [*RUN, "npy"], [*RUN, "obj", "--resume"], ["report", "out"]:
            result = drape(*command)
            equal((result.returncode, result.stdout), (2, ""), result.stderr)
            assert "another process is writing into the folder" in result.stderr, result.stderr
    good(*RUN, "npy")


def test_summary():
    """--summary replaces no input, no file of the run and no link; a pipe that nobody reads is an error at once"""
    mesh_scene("scene.json", "mesh.obj")
    shutil.copy(MESH, "mesh.obj")
    os.link("scene.json", "other.json")
    os.symlink("scene.json", "link.json")
    os.symlink("nothing", "dangling.json")
    for name, says in {"scene.json": "it is an input", "./scene.json": "it is an input", "mesh.obj": "it is an input",
                       "other.json": "it is an input", "link.json": "it is an input", "dangling.json": "link to nothing"}.items():
        keeps(".", "run", "scene.json", "--summary", name, says=says)
    put("target")
    os.symlink("target", "to_target")
    keeps(".", "run", "scene.json", "--summary", "to_target", says="is a link")
    result = drape("run", "scene.json", "--out", "out", "--summary", "out/steps.csv")  # the folder is made
    equal((result.returncode, "in the folder of --out" in result.stderr), (2, True), result.stderr)
    keeps("out", "run", "scene.json", "--out", "out", "--summary", "out/positions.npy", says="in the folder of --out")
    os.mkfifo("pipe")
    equal(drape("run", "scene.json", "--summary", "pipe").returncode, 1)
    good("run", "scene.json", "--summary", "target")
    equal(read_json("target")["status"], "ok")
    whole = good("run", "scene.json", "--summary", "/dev/stdout")
    assert '"status": "ok"' in whole, whole


def test_resume():
    """--resume names the file that was damaged since the checkpoint, and changes nothing"""
    write_scene(duration=2)
    options = ["--format", "npy,obj,vtp,pc2,glb,ply,usd", "--checkpoint-every", "1"]
    command = ["run", "scene.json", "--out", "out", *options]
    equal(signalled(signal.SIGKILL, "frame_000009.obj", *options), -signal.SIGKILL)
    shutil.copytree("out", "kept", symlinks=True)
    for name in ("frame_000001.obj", "frame_000002.vtp", "frame_000003.ply", "positions.obj", "positions.npy", "positions.pc2",
                 "positions.glb", "frames.pvd", "steps.csv", "energy.csv"):
        with open("out/" + name, "r+b") as file:
            place = {"energy.csv": 100, "positions.glb": -2000}.get(name, 150)  # in frames: the head of .glb comes from the checkpoint
            file.seek(place, os.SEEK_END if place < 0 else os.SEEK_SET)
            byte = file.read(1)
            file.seek(-1, os.SEEK_CUR)
            file.write(bytes([byte[0] ^ 4]))
        keeps("out", *command, "--resume", says=f'cannot continue "out/{name}": it is damaged')
        with open("kept/" + name, "rb") as good_one, open("out/" + name, "r+b") as file:
            file.write(good_one.read())
    os.rename("out/frame_000004.obj", "away")
    keeps("out", *command, "--resume", says='cannot continue "out/frame_000004.obj"')
    os.rename("away", "out/frame_000004.obj")
    put("out/frame_000999.obj")
    keeps("out", *command, "--resume", says='"out/frame_000999.obj" would be replaced')
    os.remove("out/frame_000999.obj")
    good(*command, "--resume")
    good("run", "scene.json", "--out", "whole", "--format", "npy,obj,vtp,pc2,glb,ply,usd")
    resumed, whole = contents("out"), contents("whole")
    for name in "manifest.jsonl", "summary.json", "checkpoint.drape":
        resumed.pop(name)
        whole.pop(name, None)
    equal(resumed, whole)


def test_planted():
    """a file that appears under the name of a frame during the run is not replaced: exit 1, one line"""
    write_scene()
    with stopped(*RUN, "obj", file="frame_000001.obj") as child:
        put("out/frame_000003.obj")
        child.send_signal(signal.SIGCONT)
        _, errors = child.communicate(timeout=LIMIT)
    equal(child.returncode, 1, errors)
    assert re.fullmatch(r'drape run: cannot write "out/frame_000003.obj": a file of that name has appeared that Drape did not write\n', without_warnings(errors)), errors
    equal(text_of("out/frame_000003.obj"), "mine\n")


def test_report():
    """report: the page in the folder of the run is refused if it is somebody else's; --out replaces no file of the run"""
    write_scene()
    good(*RUN, "npy")
    put("out/report.html")
    keeps("out", "report", "out", says='"out/report.html"')
    os.remove("out/report.html")
    good("report", "out")
    good("report", "out")
    for name in "positions.npy", "scene.json", "steps.csv":
        keeps("out", "report", "out", "--out", "out/" + name, says="it is an input")


def npy(path, rows):
    """An array of doubles, rows x 3, all 0."""
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({rows}, 3), }}".ljust(117) + "\n"
    with open(path, "wb") as file:
        file.write(b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + bytes(24 * rows))


def test_endings():
    """the copies of files that a scene names have safe names, whatever theirs are, and the folder is one that the next run replaces"""
    os.mkdir("a.b")
    for name, copy in (("./vel", "scene_mesh_0"), ("a.b/vel", "scene_mesh_0"), ('v.a"b', "scene_mesh_0"), ("v.\\", "scene_mesh_0"), ("v.\x1b[0m\n", "scene_mesh_0"),
                       ("v.\u00e4", "scene_mesh_0"), ("v.", "scene_mesh_0"), ("v." + 15 * "x", "scene_mesh_0"), ("v.x.NPY", "scene_mesh_0.NPY")):
        npy(name, 16)
        whole = scene()
        whole["cloth"][0]["start"] = {"velocities": name}
        put("scene.json", json.dumps(whole))
        good(*RUN[:4])
        equal(read_json("out/scene.json")["cloth"][0]["start"]["velocities"], copy, name)
        assert os.path.exists("out/" + copy), (name, os.listdir("out"))
        good(*RUN[:4])
        good("run", "out/scene.json")


def test_special_files():
    """a pipe or a device in place of a file of a run or an experiment is refused with one line: nothing waits, or reads without end"""
    write_scene()
    good(*RUN[:4], "--checkpoint-every", "1")
    calls = [["report", "out"], ["check", "out"], ["run", "scene.json", "--resume", "--out", "out"], ["compare", "out", "out"]]
    if re.search(r"^ +render +RUN", good("--help"), re.M):
        calls.append(["render", "out", "--frame", "1", "--out", "x.png"])
    reads = {"scene.json": calls, "energy.csv": calls, "positions.npy": calls, "steps.csv": [calls[0], calls[2]], "summary.json": [calls[0], calls[2], calls[3]],
             "checkpoint.drape": [calls[2]], "manifest.jsonl": [calls[0], calls[2]]}
    for name, readers in reads.items():
        os.rename("out/" + name, "aside")
        for make in os.mkfifo, lambda path: os.symlink("/dev/zero", path):
            make("out/" + name)
            for args in readers:
                refused(*args, says="no scene.json that can be read" if name == "scene.json" and args[0] != "run" else "not a regular file")
            os.remove("out/" + name)
        os.rename("aside", "out/" + name)
    if re.search(r"^ +merge ", good("--help"), re.M):
        good("converge", "scene.json", "--integrators", "be", "--levels", "3", "--out", "lab")
        for name in "cases.jsonl", "experiment.json":
            os.rename("lab/" + name, "aside")
            os.mkfifo("lab/" + name)
            refused("merge", "lab", "--out", "merged", says=f'cannot read "lab/{name}"')
            os.remove("lab/" + name)
            os.rename("aside", "lab/" + name)


def test_devices():
    """a scene may come from a pipe; a device that has no end is refused at its first byte"""
    write_scene()
    with open("scene.json", "rb") as file:
        equal(subprocess.run([PROGRAM, "info", "/dev/stdin"], input=file.read(), capture_output=True, timeout=LIMIT).returncode, 0, "a pipe")
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    refused("info", "/dev/zero", says="/dev/zero:1:1: byte 0x00 is not allowed in a scene")
    used = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    assert used < 1, f"{used} s: it was read further"


def test_experiments():
    """the folders of experiments and of validate"""
    if not re.search(r"^ +tradeoff ", good("--help"), re.M):
        raise Skip("this build has no experiments")
    write_scene()
    os.mkdir("lab")
    command = ["converge", "scene.json", "--integrators", "be", "--levels", "3", "--out", "lab"]
    for name in "experiment.json", "cases.jsonl", "results.csv", "report.html", "x.svg":
        put("lab/" + name)
        keeps("lab", *command, says=f'"lab/{name}"')
        os.remove("lab/" + name)
    os.symlink("../scene.json", "lab/cases.jsonl")
    keeps("lab", *command, says='"lab/cases.jsonl"')
    os.remove("lab/cases.jsonl")
    put("lab/notes.txt")
    good(*command)
    good(*command)
    put("lab/results.csv")
    keeps("lab", *command, says="it has changed since Drape wrote it")
    os.mkdir("scenes")
    put("scenes/free_fall_0.json")
    keeps("scenes", "validate", "free_fall", "--scenes", "scenes", says='"scenes/free_fall_0.json"')


def test_render():
    """render: pictures in a folder, and inputs that a picture would replace"""
    write_scene()
    os.environ["ASAN_OPTIONS"] = "abort_on_error=1:detect_leaks=0"  # an OpenGL driver is unloaded before leaks are looked for
    if drape("render", "scene.json", "--out", "x.png", "--size", "64x48").returncode:
        raise Skip("there is no driver")
    size = "--size", "64x48"
    keeps(".", "render", "scene.json", "--shade", "texture", "--texture", "x.png", "--out", "x.png", *size, says="it is an input")
    os.symlink("x.png", "y.png")
    keeps(".", "render", "scene.json", "--out", "y.png", *size, says="is a link")
    os.mkdir("pictures")
    put("pictures/frame_00001.png")
    keeps("pictures", "render", "scene.json", "--out", "pictures", *size, says='"pictures/frame_00001.png"')
    os.remove("pictures/frame_00001.png")
    good("render", "scene.json", "--out", "pictures", *size)
    good("render", "scene.json", "--out", "pictures", "--every", "2", *size)
    equal(sorted(os.listdir("pictures")), ["frame_00000.png", "frame_00001.png", "manifest.jsonl"])
    if not shutil.which("ffmpeg"):
        return
    put("x.mp4.part")
    os.symlink("x.png", "z.mp4")
    keeps(".", "render", "scene.json", "--out", "z.mp4", *size, says="is a link")
    good("render", "scene.json", "--out", "x.mp4", *size)
    equal(text_of("x.mp4.part"), "mine\n")
    assert os.path.getsize("x.mp4") > 500


raise SystemExit(run_tests(globals()))
