#!/usr/bin/env python3
"""Frames as other programs read them. Output is TAP.

DRAPE_BUILD is the build folder; or: test_formats.py PROGRAM. Each reader is a script beside this one, run by the program that it is for:
Debian's python3 (numpy, VTK), Blender, node (the Khronos validator of glTF). If one is not installed its tests are skipped, and say how to
get it. Readers print nothing if all is correct, otherwise the errors, with exit code 1.
"""
import json
import os
import shutil
import signal
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "cli"))
from program import LIMIT, PROGRAM, Skip, equal, run_tests, signalled, text_of, write_json  # noqa: E402  pylint: disable=wrong-import-position

PYTHON = "/usr/bin/python3"  # Debian's python3, for which its packages are made
FORMATS = "npy,obj,ply,vtp,pc2,glb,usd"

CLOTH = {"material": {"young_modulus": 1e4, "thickness": 1e-3, "density": 200}, "terms": ["stretch.edge", "bend.hinge"],
         "pins": [{"corner": "top-left"}], "velocity": [0.3, 0, -0.2]}
SCENE = {
    "drape": 1,
    "cloth": [{**CLOTH, "name": "first", "mesh": {"grid": "square", "columns": 7, "rows": 5, "width": 0.6, "height": 0.4}},
              {**CLOTH, "name": "second", "mesh": {"grid": "equilateral", "edges": 4, "edge_length": 0.1,
                                                   "transform": {"translate": [1, 0.5, 0]}}}],
    "integrator": {"dt": 0.01}, "duration": 0.25, "frame_rate": 30}


def need(there, what):
    if not there:
        raise Skip(what)


def reader(command, what, folder, *args):
    result = subprocess.run([*command, folder, *args], capture_output=True, text=True, timeout=LIMIT, check=False)
    if result.returncode == 77:
        raise Skip(what)
    said = result.stdout + result.stderr
    assert result.returncode == 0, f"{' '.join(command)}: {said}"
    return said


def read_numpy(folder, *args):
    reader([PYTHON, HERE + "/read_numpy.py"], "no numpy for " + PYTHON + ": apt-get install python3-numpy", folder, *args)


def read_vtk(folder, *args):
    reader([PYTHON, HERE + "/read_vtk.py"], "no VTK for " + PYTHON + ": apt-get install python3-vtk9", folder, *args)


def validate_gltf(folder):
    node = shutil.which("node")
    need(node, "no node: apt-get install nodejs npm")
    if "NODE_PATH" not in os.environ and shutil.which("npm"):
        os.environ["NODE_PATH"] = subprocess.run(["npm", "root", "-g"], capture_output=True, text=True, check=False).stdout.strip()
    reader([node, HERE + "/validate_gltf.js"], "no glTF validator: npm install -g gltf-validator, or NODE_PATH", folder)


def read_blender(folder, *args, script="read_blender.py"):
    blender = shutil.which("blender")
    need(blender, "no Blender: apt-get install blender")
    # Blender's Python looks for its library beside the first python3 on the path, which may be a different version.
    path = {**os.environ, "PATH": "/usr/bin:/bin:" + os.environ.get("PATH", "")}
    result = subprocess.run([blender, "-b", "--factory-startup", "--python-exit-code", "1", "--python", f"{HERE}/{script}",
                             "--", folder, *args], capture_output=True, text=True, timeout=LIMIT, check=False, env=path)
    said = result.stdout + result.stderr
    assert result.returncode == 0 and "read_blender: good" in said, said


def run(folder, *args, scene=None):
    write_json("scene.json", scene or SCENE)
    result = subprocess.run([PROGRAM, "run", "scene.json", "--out", folder, "--format", FORMATS, *args],
                            capture_output=True, text=True, timeout=LIMIT, check=False)
    assert result.returncode == 0, result.stderr
    with open(folder + "/summary.json", encoding="utf-8") as file:
        assert json.load(file)["frames"] == 9  # eight at k / 30 s, one at the end
    return folder


def test_numpy():
    """numpy: positions.npy, PLY, OBJ, PC2 and GLB have the same positions"""
    read_numpy(run("out"))


def test_vtk():
    """VTK: positions to the bit, times, velocities, strains and energies, and PLY and OBJ by its readers"""
    read_vtk(run("out"))


def test_gltf():
    """the Khronos validator finds no errors in the binary glTF"""
    validate_gltf(run("out"))


def test_blender():
    """Blender: the Mesh Cache moves the mesh as the run does, and the binary glTF plays"""
    read_blender(run("out"))


def test_faces():
    """quadrilaterals, texture coordinates and materials of a mesh are in OBJ and binary glTF, for the validator and for Blender"""
    sides, rings = 4, 4
    with open("tube.obj", "w", encoding="utf-8") as file:
        print("mtllib tube.mtl", file=file)
        for r in range(rings):
            for x, z in ((1, 0), (0, 1), (-1, 0), (0, -1)):
                print("v", 0.1 * x, 0.1 * r, 0.1 * z, file=file)
        for r in range(rings):
            for s in range(sides + 1):
                print("vt", s / sides, r / (rings - 1), file=file)
        for r in range(rings - 1):
            print("usemtl", "lining" if r % 2 else "light denim", file=file)
            for s in range(sides):
                corners = [(r, s + 1), (r, s), (r + 1, s), (r + 1, s + 1)]
                print("f", *(f"{a * sides + b % sides + 1}/{a * (sides + 1) + b + 1}" for a, b in corners), file=file)
    scene = {**SCENE, "cloth": [{**CLOTH, "pins": [{"nodes": [0, 1]}], "mesh": {"file": "tube.obj"}}]}
    run("out", scene=scene)
    checked = 0
    for check in (lambda: validate_gltf("out"), lambda: read_blender("out", script="read_blender_faces.py")):
        try:
            check()
            checked += 1
        except Skip as reason:
            last = reason
    if not checked:
        raise last


def faces_of_obj(path):
    """The statements of materials, and the faces with node and texture coordinates of each corner."""
    with open(path, encoding="ascii") as file:
        lines = [line.split() for line in file]
    uvs = [(float(line[1]), float(line[2])) for line in lines if line[:1] == ["vt"]]
    corners = [[corner.split("/") for corner in line[1:]] for line in lines]
    return [line if line[0] == "usemtl" else [(node, uvs[int(uv) - 1]) for node, uv in corner]
            for line, corner in zip(lines, corners) if line[:1] in (["usemtl"], ["f"])]


def test_render_mesh():
    """a render mesh is in frames of every format in place of the simulated mesh, which stays in positions.npy, and keeps its quadrilaterals"""
    fine = {"grid": "square", "columns": 20, "rows": 12, "width": 0.6, "height": 0.4, "transform": {"translate": [0, 0.01, 0]}}
    shown = {**SCENE, "cloth": [{**SCENE["cloth"][0], "render_mesh": fine}, SCENE["cloth"][1]]}
    run("plain")
    run("out", scene=shown)
    for name in ("positions.npy", "energy.csv"):
        with open("plain/" + name, "rb") as a, open("out/" + name, "rb") as b:
            assert a.read() == b.read(), name
    with open("plain/summary.json", encoding="utf-8") as a, open("out/summary.json", encoding="utf-8") as b:
        assert json.load(a)["hash"] == json.load(b)["hash"]
    assert not os.path.exists("plain/render_positions.npy")
    read_numpy("out")
    read_numpy(run("turned", "--set", "/output/up=z", scene=shown), "z")
    for name in ("napkin.json", "napkin.obj"):
        shutil.copy(os.path.join(HERE, "../../examples/scenes", name), name)
    subprocess.run([PROGRAM, "run", "napkin.json", "--out", "napkin", "--format", "obj,usd,glb,npy", "--duration", "0.04"], check=True, capture_output=True)
    own, frame = faces_of_obj("napkin.obj"), faces_of_obj("napkin/frame_000002.obj")
    assert len(own) == 16 * 16 + 2 and own == frame
    text = text_of("napkin/positions.usda")
    assert text.count("def GeomSubset") == 2 and "primvars:st" in text
    try:
        validate_gltf("napkin")
    except Skip:
        pass
    try:
        read_vtk("out", "y", "shows", "plain")
    except Skip:
        pass


def test_z_up():
    """with z up frames are rotated, except those of npy and of glTF, which has y up by definition"""
    read_numpy(run("out", "--set", "/output/up=z"), "z")
    try:
        read_vtk("out", "z")
    except Skip:
        pass


def test_killed():
    """a killed run leaves readable files with all frames so far"""
    write_json("scene.json", SCENE)
    equal(signalled(signal.SIGKILL, "frame_000012.vtp", "--format", FORMATS, "--duration", "2"), -signal.SIGKILL)
    done = 0
    for check in (lambda: read_numpy("out", "y", "killed"), lambda: read_vtk("out", "y", "killed"), lambda: validate_gltf("out")):
        try:
            check()
            done += 1
        except Skip as reason:
            last = reason
    if not done:
        raise last


def test_full_disk():
    """a run on a full disk does too: no file is longer than 300 kB"""
    write_json("scene.json", SCENE)
    for one in FORMATS.split(","):
        result = subprocess.run(["/bin/sh", "-c", 'ulimit -f 600; exec "$0" "$@"', PROGRAM, "run", "scene.json", "--out", one, "--format",
                                 one, "--duration", "20"], capture_output=True, text=True, timeout=LIMIT, check=False)
        assert result.returncode == 1 and result.stderr.count("\n") == 1, (one, result.stderr)
        assert not any(name.endswith(".part") for name in os.listdir(one)), os.listdir(one)
    validate_gltf("glb")
    read_vtk("vtp", "y", "alone")



sys.exit(run_tests(globals()))
