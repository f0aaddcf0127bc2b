"""Tests of the add-on that Blender runs: see test_blender.py, which starts it. Each begins with the scene of a new file, a cube of 2 m, its camera and
its lamp. Written for Blender 3.4."""
import ctypes
import importlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from math import radians

import bpy
import numpy as np

FRAMES = 8
RATE = 24
PROGRAM = shutil.which("drape")
bpy.ops.preferences.addon_install(filepath=os.environ["ZIP"])
bpy.ops.preferences.addon_enable(module="drape_cloth")
operators, program, export, folders = (importlib.import_module("drape_cloth." + name) for name in ("operators", "program", "export", "folder"))


# ---- Scenes ----

def new_file(frames=FRAMES, name="test.blend"):
    """The factory scene, saved in the current folder."""
    bpy.ops.wm.read_factory_settings(use_empty=False)
    bpy.ops.preferences.addon_enable(module="drape_cloth")
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.render.fps = 1, frames, RATE
    bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath(name))
    return scene


def sheet(name="Tablecloth", side=8, size=3.0, z=1.05, **settings):
    """A square of quads with the role of a cloth, active; coarse and stiff, so that a bake takes a fraction of a second."""
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=side - 1, y_subdivisions=side - 1, size=size, location=(0, 0, z))
    thing = bpy.context.object
    thing.name = name
    thing.drape.role = "CLOTH"
    thing.drape.self_contact = False
    thing.drape.contact_distance = 0.02
    for key, value in settings.items():
        setattr(thing.drape, key, value)
    return thing


def collider(thing, **settings):
    thing.drape.role = "COLLIDER"
    for key, value in settings.items():
        setattr(thing.drape, key, value)
    return thing


def bake(thing, operator="bake"):
    """The folder of the bake, after a bake that must succeed."""
    bpy.context.view_layer.objects.active = thing
    assert getattr(bpy.ops.drape, operator)() == {"FINISHED"}
    return operators.folder_of(thing)


def refused(thing, operator="bake"):
    """The message of a bake that must fail."""
    bpy.context.view_layer.objects.active = thing
    try:
        getattr(bpy.ops.drape, operator)()
    except RuntimeError as error:  # Blender raises one for a report of an error
        return str(error)
    raise AssertionError("the bake succeeded")


def export_to(name, thing):
    """The warnings of an export into a folder."""
    with folders.Folder(os.path.abspath(name), operators.owner_of(thing)) as folder:
        return export.export(bpy.context, thing, folder)


# ---- Results ----

def scene_of(folder):
    with open(folder + "/scene.json", encoding="utf-8") as file:
        return json.load(file)


def positions(folder, run="run"):
    return np.load(f"{folder}/{run}/positions.npy")


def z_up(x):
    """Positions of Drape, y up, in the axes of Blender."""
    return np.stack([x[..., 0], -x[..., 2], x[..., 1]], -1)


def world(thing, frame):
    """The vertices of an object with its modifiers, in the world."""
    bpy.context.scene.frame_set(frame)
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    x = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", x)
    matrix = np.array(evaluated.matrix_world)
    evaluated.to_mesh_clear()
    return x.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]


def plays(thing, folder, unit=1.0):
    """Blender shows what Drape computed, but for the rounding of both to float32 (a unit is 1.2e-7) in the axes of the object and of the world."""
    x = z_up(positions(folder)) / unit
    for k, frame in enumerate(x):
        error = np.abs(world(thing, bpy.context.scene.frame_start + k) - frame).max()
        assert error < 2e-6 * max(1, np.abs(x).max()), (k, error)
    return x


def run_again(folder, name="again"):
    subprocess.run([PROGRAM, "run", "scene.json", "--out", name], cwd=folder, check=True, capture_output=True)
    return folder + "/" + name


def same_bytes(a, b):
    with open(a, "rb") as first, open(b, "rb") as second:
        assert first.read() == second.read(), (a, b)


def identity(thing):
    """What a bake must leave as it is: vertices, polygons, UVs and materials."""
    mesh = thing.data
    return ([tuple(v.co) for v in mesh.vertices], [tuple(p.vertices) for p in mesh.polygons], [p.material_index for p in mesh.polygons],
            [(layer.name, [tuple(d.uv) for d in layer.data]) for layer in mesh.uv_layers], [material.name for material in mesh.materials])


# ---- Tests ----

def test_table_cloth():
    """a cloth over the default cube: the bake has the bits of drape run, Mesh Cache plays it, and the mesh keeps quads, UVs and materials"""
    new_file()
    collider(bpy.data.objects["Cube"])
    cloth = sheet(quality="REALTIME", fabric="wang2011_tablecloth")
    cloth.data.materials.append(bpy.data.materials.new("Linen"))
    cloth.modifiers.new("Smoother", "SUBSURF")
    cloth.modifiers["Smoother"].show_viewport = False
    before = identity(cloth)
    folder = bake(cloth)
    assert folder == os.path.abspath("drape_Tablecloth"), folder
    assert identity(cloth) == before and len(cloth.data.uv_layers) == 1 and len(cloth.data.polygons[0].vertices) == 4
    assert [modifier.name for modifier in cloth.modifiers] == ["Drape", "Smoother"]
    x = plays(cloth, folder)
    assert len(x) == FRAMES and x[:, :, 2].min() < 1 and (x[-1][:, 2][np.abs(x[-1][:, :2]).max(1) < 0.9] > 1).all()
    again = run_again(folder)
    for name in "positions.npy", "steps.csv", "energy.csv":
        same_bytes(f"{folder}/run/{name}", f"{again}/{name}")
    with open(folder + "/cloth.pc2", "rb") as file:
        data = file.read()
    assert data[:32] == b"POINTCACHE2\0" + np.array([1, 64], "<i4").tobytes() + np.array([0, 1], "<f4").tobytes() + np.array([FRAMES], "<i4").tobytes()
    assert len(data) == 32 + 12 * 64 * FRAMES
    first = np.frombuffer(data, "<f4", 3 * 64, 32).reshape(-1, 3)
    assert (first == np.array([v.co for v in cloth.data.vertices], np.float32)).all()  # the transform and its inverse leave no trace in float32
    bpy.ops.drape.clear()
    assert [modifier.name for modifier in cloth.modifiers] == ["Smoother"] and os.path.exists(folder + "/cloth.pc2")


def test_accuracy():
    """a bake by accuracy is run until it is as near to the motion as asked, and plays; it is not resumed"""
    new_file()
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    cloth = sheet(quality="ACCURATE", accuracy=0.1, pin_group="rim", air=False)
    cloth.vertex_groups.new(name="rim").add(list(range(8)), 1, "REPLACE")
    folder = bake(cloth)
    assert len(plays(cloth, folder)) == FRAMES
    with open(folder + "/run/summary.json", encoding="utf-8") as file:
        reached = json.load(file)["accuracy_of"]
    assert reached["runs"] >= 2 and reached["distance"] < 0.1, reached
    assert "cannot be resumed" in refused(cloth, "resume")


def test_transform_and_unit():
    """a cloth that is turned, scaled unevenly and carried by a parent in a scene of centimetres plays in the world where Drape has it"""
    scene = new_file()
    scene.unit_settings.scale_length = 0.01
    scene.gravity = 0, 0, -981
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.ops.object.empty_add(location=(10, 20, 0), rotation=(0.1, 0.2, 0.3))
    parent = bpy.context.object
    cloth = sheet(size=2, quality="DRAFT", air=False)  # in air it would glide
    cloth.parent, cloth.location, cloth.rotation_euler, cloth.scale = parent, (1, 2, 50), (0.3, -0.2, 0.5), (20, 30, 1)
    parent.keyframe_insert("location", frame=1)
    parent.location.x = 60
    parent.keyframe_insert("location", frame=FRAMES)
    folder = bake(cloth)
    made = scene_of(folder)
    assert np.allclose(made["gravity"], [0, -9.81, 0]) and made["frame_rate"] == 24 and made["duration"] == 7 / 24, made
    x = plays(cloth, folder, unit=0.01)
    assert np.abs(x[-1].mean(0) - x[0].mean(0))[:2].max() < 1  # it is free: it falls, and does not follow the parent
    assert x[-1].mean(0)[2] < x[0].mean(0)[2] - 10  # [cm] in 0.29 s


def test_simulated_mesh():
    """a coarse mesh is simulated in place of the artist's, which follows it, keeps its faces, and may move and be scaled; messages name the one that is wrong"""
    new_file()
    collider(bpy.data.objects["Cube"])
    cage = sheet("Cage", side=7)
    cage.drape.role = "NONE"
    cage.vertex_groups.new(name="corner").add([0], 1, "REPLACE")
    cage.modifiers.new("Smoother", "SUBSURF")
    cage.hide_render = True
    cloth = sheet("Napkin", side=20, size=1, quality="REALTIME", pin_group="corner")
    cloth.drape.simulated, cloth.scale = cage, (2.9, 2.9, 1)
    cloth.location.z += 0.01
    cloth.data.materials.append(bpy.data.materials.new("Linen"))
    before = identity(cloth)
    folder = bake(cloth)
    coarse, fine = positions(folder), np.load(folder + "/run/render_positions.npy")
    assert coarse.shape == (FRAMES, 49, 3) and fine.shape == (FRAMES, 400, 3) and identity(cloth) == before
    assert scene_of(folder)["cloth"][0]["pins"][0]["nodes"] == [0] and (coarse[:, 0] == coarse[0, 0]).all()
    for k, x in enumerate(z_up(fine)):
        assert np.abs(world(cloth, 1 + k) - x).max() < 1e-5, k
    assert [modifier.name for modifier in cage.modifiers] == ["Smoother"] and cage.modifiers[0].show_viewport
    again = run_again(folder)
    for name in "positions.npy", "render_positions.npy":
        same_bytes(f"{folder}/run/{name}", f"{again}/{name}")
    cloth.drape.simulated_distance = 0.005
    assert "Napkin: /cloth/0/render_mesh/file: render.obj: vertex 0, at (" in refused(cloth)
    cloth.drape.simulated_distance = 0.02
    cage.drape.role = "COLLIDER"
    assert "Cage: is simulated for Napkin" in refused(cloth)
    cage.drape.role = "NONE"
    cage.hide_viewport = True
    assert "Cage: is disabled in viewports" in refused(cloth)
    cage.hide_viewport = False
    empty = bpy.data.objects.new("Nothing", None)
    bpy.context.scene.collection.objects.link(empty)
    cloth.drape.simulated = empty  # as a script may, past the list of the panel
    assert "Nothing: is of the type Empty; only a mesh can be simulated for Napkin" in refused(cloth)
    cloth.drape.simulated = cage
    cage.hide_set(True)
    assert (positions(bake(cloth)) == coarse).all()
    cage.hide_set(False)
    cage.data.vertices.add(1)
    assert "Cage: /cloth/0/mesh/file: cloth.obj: node 49" in refused(cloth)
    cloth.drape.simulated, cloth.drape.pin_group = None, ""
    folder = bake(cloth)
    assert positions(folder).shape == (FRAMES, 400, 3) and not os.path.exists(folder + "/run/render_positions.npy")
    plays(cloth, folder)


def test_pins():
    """vertices of a group are held from the threshold on, and move with the object; deforming modifiers before the cloth move them, too"""
    def held(cloth):
        """How far the pins of a bake are at most from where Blender has them without the cloth."""
        x = plays(cloth, bake(cloth))
        cloth.modifiers["Drape"].show_viewport = False
        expected = np.stack([world(cloth, k)[:8] for k in range(1, FRAMES + 1)])
        cloth.modifiers["Drape"].show_viewport = True
        bpy.context.scene.frame_set(1)
        return np.abs(x[:, :8] - expected).max()

    new_file()
    cloth = sheet(z=3, quality="DRAFT", pin_group="rim", pin_threshold=0.5)
    group = cloth.vertex_groups.new(name="rim")
    group.add(list(range(8)), 0.75, "REPLACE")
    group.add([63], 0.25, "REPLACE")
    folder = bake(cloth)
    assert scene_of(folder)["cloth"][0]["pins"] == [{"name": "pinned", "nodes": list(range(8))}]
    x = plays(cloth, folder)
    assert (x[:, :8] == x[0, :8]).all() and x[-1, 63, 2] < x[0, 63, 2] - 0.1

    cloth.keyframe_insert("rotation_euler", frame=1)
    cloth.rotation_euler.z = radians(30)
    cloth.keyframe_insert("rotation_euler", frame=FRAMES)
    assert held(cloth) < 1e-5
    pin, = scene_of(folder)["cloth"][0]["pins"]
    assert pin["nodes"] == list(range(8)) and len(pin["turns"]) == FRAMES and "track" not in pin

    bpy.ops.drape.clear()
    hooked = cloth.modifiers.new("Hook", "HOOK")  # carries node 3 up by 0.2 m
    bpy.ops.object.empty_add(location=(0, 0, 3))
    hook = bpy.context.object
    hooked.object, hooked.matrix_inverse = hook, hook.matrix_world.inverted() @ cloth.matrix_world
    hooked.vertex_indices_set([3])
    hook.keyframe_insert("location", frame=1)
    hook.location.z = 3.2
    hook.keyframe_insert("location", frame=FRAMES)
    bpy.context.scene.frame_set(1)
    bpy.ops.object.select_all(action="DESELECT")
    assert held(cloth) < 1e-5 and [modifier.name for modifier in cloth.modifiers] == ["Hook", "Drape"]
    x = z_up(positions(folder))
    assert abs(x[-1, 3, 2] - 3.2) < 1e-5 and np.abs(x[-1, 0] - x[0, 0])[:2].max() > 0.1

    cloth.drape.pin_threshold = 0.9
    assert "Tablecloth: no vertex of the group rim has a weight of 0.9" in refused(cloth)


def test_animated_collider():
    """a rigid collider moves along a track and turns as Blender moves it, and carries cloth along"""
    new_file()
    cube = collider(bpy.data.objects["Cube"], friction=0.5)
    cube.scale = 1, 1, 0.5
    cube.rotation_mode = "XYZ"
    cube.location.z = 0.5
    cube.keyframe_insert("location", frame=1)
    cube.keyframe_insert("rotation_euler", frame=1)
    cube.location = 0.2, 0.1, 0.9
    cube.rotation_euler = 0, 0, radians(40)
    cube.keyframe_insert("location", frame=FRAMES)
    cube.keyframe_insert("rotation_euler", frame=FRAMES)
    cloth = sheet(quality="REALTIME")
    for shape, kind in ("MESH", "mesh"), ("BOX", "box"):
        cube.drape.shape = shape
        folder = bake(cloth)
        made, = scene_of(folder)["colliders"]
        assert made["type"] == kind and made["name"] == "Cube" and made["friction"] == 0.5, made
        assert len(made["track"]) == len(made["turns"]) == FRAMES and made["turns"][0]["quaternion"] == [1, 0, 0, 0]
        pivot, corner = np.array(made["pivot"]), np.array([1, 1, 1])
        first = None
        for k, ((t, d), turn) in enumerate(zip(made["track"], made["turns"])):
            bpy.context.scene.frame_set(1 + k)
            place = np.array(cube.matrix_world) @ [*corner, 1]
            here = np.array([place[0], place[2], -place[1]])
            first = here if first is None else first
            w, *v = turn["quaternion"]
            arm = first - pivot
            turned = arm + 2 * np.cross(v, np.cross(v, arm) + w * arm) + pivot + d
            assert abs(t - k / RATE) < 1e-12 and np.abs(turned - here).max() < 1e-5, (k, turned, here)
        x = plays(cloth, folder)
        top = np.abs(x[-1][:, :2] - [0.2, 0.1]).max(1) < 0.5
        assert x[-1][top][:, 2].min() > 1.4, x[-1][top]  # lifted with the top of the cube, which is at 1.4 m now

    cube.drape.shape = "SPHERE"
    before = scene_of(operators.folder_of(cloth))
    assert "Cube: is scaled unevenly" in refused(cloth) and scene_of(operators.folder_of(cloth)) == before
    collider(bpy.data.objects["Cube"], shape="PLANE")
    made, = scene_of(bake(cloth))["colliders"]
    assert made["type"] == "plane" and np.allclose(made["normal"], [0, 1, 0]) and np.allclose(made["point"], [0, 0.5, 0])


def test_shapes():
    """a ball is a sphere of its size wherever it is, a mirrored mesh is turned outside, and an open one keeps cloth on its side"""
    new_file()
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.4, location=(0.3, -0.2, 0.5), scale=(1.5, 1.5, 1.5), segments=12, ring_count=6)
    ball = collider(bpy.context.object, shape="SPHERE")
    cloth = sheet(quality="REALTIME")
    made, = scene_of(bake(cloth))["colliders"]
    assert made["type"] == "sphere" and np.allclose(made["center"], [0.3, 0.5, 0.2]) and np.isclose(made["radius"], 0.6) and "track" not in made
    ball.drape.shape, ball.scale.x = "MESH", -1.5
    x = plays(cloth, bake(cloth))
    assert np.linalg.norm(x[-1] - [0.3, -0.2, 0.5], axis=-1).min() > 0.5  # within the edges of the coarse ball, and not inside
    bpy.data.objects.remove(ball)
    bpy.ops.mesh.primitive_plane_add(size=10, location=(0, 0, 1))
    collider(bpy.context.object, surface_thickness=0.01)
    folder = bake(cloth)
    made, = scene_of(folder)["colliders"]
    assert made["type"] == "animated_mesh" and made["open"] and len(np.load(folder + "/" + made["file"])) == 1
    x = plays(cloth, folder)
    assert 1.01 < x[-1][:, 2].min() < 1.05, x[-1][:, 2]


def test_deforming_collider():
    """a surface with shape keys gives its frames to Drape, and lifts cloth; so does another cloth that was baked before"""
    new_file()
    cube = collider(bpy.data.objects["Cube"])
    cube.shape_key_add(name="Basis")
    up = cube.shape_key_add(name="Up")
    for k, vertex in enumerate(cube.data.vertices):
        if vertex.co.z > 0:
            up.data[k].co.z = 1.3
    up.keyframe_insert("value", frame=1)
    up.value = 1
    up.keyframe_insert("value", frame=FRAMES)
    cloth = sheet(quality="REALTIME")
    folder = bake(cloth)
    made, = scene_of(folder)["colliders"]
    frames = np.load(folder + "/" + made["file"])
    assert made["type"] == "animated_mesh" and not made["open"] and made["frame_rate"] == RATE and frames.shape == (FRAMES, 8, 3)
    assert np.allclose(frames[:, :, 1].max(1)[[0, -1]], [1, 1.3])
    x = plays(cloth, folder)
    assert x[-1][np.abs(x[-1][:, :2]).max(1) < 0.9][:, 2].min() > 1.3

    collider(cloth)
    upper = sheet(name="Runner", side=6, size=1, z=1.2, quality="REALTIME")
    folder = bake(upper)
    made = scene_of(folder)["colliders"]
    assert [item["name"] for item in made] == ["Cube", "Tablecloth"] and made[1]["open"]
    assert np.abs(z_up(np.load(folder + "/" + made[1]["file"])) - x).max() < 2e-6
    assert plays(upper, folder)[-1][:, 2].min() > 1.3


def test_wind():
    """the force fields of the type Wind add up to the wind, in m/s along their z axes; it and gravity may change in time; without air there is none"""
    scene = new_file()
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.ops.object.effector_add(type="WIND", rotation=(0, radians(90), 0))
    bpy.context.object.field.strength = 5
    bpy.ops.object.effector_add(type="WIND", rotation=(radians(-90), 0, 0))
    bpy.context.object.field.strength = 2
    cloth = sheet(quality="DRAFT", pin_group="rim", areal_density=0.1)
    cloth.rotation_euler.y = radians(90)
    cloth.vertex_groups.new(name="rim").add([k for k in range(64) if k % 8 == 0], 1, "REPLACE")
    scene.frame_end = 2 * FRAMES
    folder = bake(cloth)
    wind, = [term for term in scene_of(folder)["cloth"][0]["terms"] if term["type"] == "drag.wind"]
    assert np.allclose(wind["wind"], [5, 0, -2], atol=1e-5) and np.isclose(wind["density"], 1.225), wind
    x = plays(cloth, folder)
    assert x[-1][:, 0].mean() > x[0][:, 0].mean() + 0.1, x[-1][:, 0].mean() - x[0][:, 0].mean()
    fields = [thing for thing in scene.objects if thing.field and thing.field.type == "WIND"]
    for thing in fields:
        thing.field.keyframe_insert("strength", frame=1)
        thing.field.strength *= -2
        thing.field.keyframe_insert("strength", frame=2 * FRAMES)
    scene.keyframe_insert("gravity", frame=1)
    scene.gravity = 0, 0, -2 * 9.81
    scene.keyframe_insert("gravity", frame=2 * FRAMES)
    made = scene_of(bake(cloth))
    wind, = [term for term in made["cloth"][0]["terms"] if term["type"] == "drag.wind"]
    assert np.allclose(wind["wind"], [-10, 0, 4], atol=1e-5) and wind["history"] == "wind" and made["gravity_history"] == "gravity"
    assert np.allclose(made["gravity"], [0, -2 * 9.81, 0])
    courses = {course["name"]: course for course in made["histories"]}
    assert np.allclose([courses["wind"]["values"][k] for k in (0, -1)], [-0.5, 1]) and np.allclose([courses["gravity"]["values"][k] for k in (0, -1)], [0.5, 1])
    assert np.allclose(courses["wind"]["times"], np.arange(2 * FRAMES) / RATE)
    assert plays(cloth, operators.folder_of(cloth))[-1][:, 0].mean() < x[-1][:, 0].mean()
    fields[0].keyframe_insert("rotation_euler", frame=1)
    fields[0].rotation_euler.z += 1
    fields[0].keyframe_insert("rotation_euler", frame=2 * FRAMES)
    warning, = export_to("other", cloth)
    assert warning.startswith("Tablecloth: the wind (") and "changes its direction: the cloth feels that of the first frame" in warning
    cloth.drape.air = False
    scene.use_gravity = False
    made = scene_of(bake(cloth))
    assert "histories" not in made and "gravity_history" not in made
    assert [term["type"] for term in made["cloth"][0]["terms"]] == ["stretch.cst", "bend.midedge", "damp.kelvin_voigt"] and made["gravity"] == [0, 0, 0]


def test_cancel_and_resume():
    """a bake that is cancelled keeps its frames, and resumes to the bits of one without interruption, though the scene has changed meanwhile"""
    scene = new_file(frames=120)
    collider(bpy.data.objects["Cube"])
    cloth = sheet(side=12, quality="STANDARD")

    def cancel():
        while not operators.running or operators.running[0].bake.done() < 12:
            time.sleep(0.01)
        operators.running[0].bake.cancel()

    thread = threading.Thread(target=cancel)
    thread.start()
    folder = bake(cloth)
    thread.join()
    assert not operators.running
    x = positions(folder)
    assert 12 <= len(x) < 120 and cloth.modifiers["Drape"], len(x)
    plays(cloth, folder)
    scene.frame_end = 20
    with open(folder + "/scene.json", encoding="utf-8") as file:
        text = file.read()
    text = text.replace('"duration": ' + str(119 / 24), '"duration": ' + str(29 / 24))  # to save time; another duration is another run, so begin it anew
    with open(folder + "/scene.json", "w", encoding="utf-8") as file:
        file.write(text)
    taken = folders.Folder(folder, operators.owner_of(cloth))
    taken.take()
    started = program.Bake(PROGRAM, taken, 30)
    while started.running() and started.done() < 9:
        time.sleep(0.01)
    started.kill()
    assert started.done() < 30
    assert bake(cloth, "resume") == folder and len(positions(folder)) == 30
    again = run_again(folder)
    for name in "positions.npy", "steps.csv", "energy.csv":
        same_bytes(f"{folder}/run/{name}", f"{again}/{name}")


def test_crash():
    """if the program ends in the middle of a bake, the frames so far are shown, and the bake resumes"""
    new_file(frames=60)
    cloth = sheet(side=12, pin_group="rim")
    cloth.vertex_groups.new(name="rim").add([0, 11], 1, "REPLACE")

    def crash():
        while not operators.running or operators.running[0].bake.done() < 12:
            time.sleep(0.01)
        operators.running[0].bake._process.kill()

    thread = threading.Thread(target=crash)
    thread.start()
    assert "Tablecloth: drape ended with -9" in refused(cloth)
    thread.join()
    folder = operators.folder_of(cloth)
    x = plays(cloth, folder)
    assert 12 <= len(x) < 60
    assert (z_up(positions(bake(cloth, "resume")))[:len(x)] == x).all() and len(positions(folder)) == 60


def test_errors():
    """what keeps a cloth from being baked is said with the name of the object, by the add-on or in the words of the library"""
    new_file()
    cube = collider(bpy.data.objects["Cube"])
    cloth = sheet(name="Blanket Ü")
    cloth.data.vertices.add(1)
    cloth.data.update()
    assert "Blanket Ü: /cloth/0/mesh/file: cloth.obj: node 64 belongs to no triangle" in refused(cloth)
    assert "Drape" not in cloth.modifiers and not operators.running
    bpy.data.objects.remove(cloth)
    cloth = sheet(fabric="sackcloth")
    assert "Tablecloth: /cloth/0/material/fabric: " in refused(cloth)
    cloth.drape.fabric = ""
    cube.data.clear_geometry()
    assert "Cube: has no faces" in refused(cloth)
    bpy.data.objects.remove(cube)
    folder = operators.folder_of(cloth)
    shutil.rmtree(folder)
    os.mkdir(folder)
    with open(folder + "/thesis.txt", "w", encoding="utf-8"):
        pass
    assert "has files of something else" in refused(cloth) and os.listdir(folder) == ["thesis.txt"]
    cloth.drape.folder = "//elsewhere/"
    other = sheet(name="Other", folder="//elsewhere")
    assert "Other: Tablecloth has the same folder, " in refused(other)
    bpy.data.objects.remove(other)
    bpy.context.scene.frame_end = 1
    assert "one frame only" in refused(cloth)
    bpy.context.scene.frame_end = FRAMES
    preferences = bpy.context.preferences.addons["drape_cloth"].preferences
    preferences.program = "/nowhere/drape"
    assert "there is no program /nowhere/drape" in refused(cloth)
    path, os.environ["PATH"], preferences.program = os.environ["PATH"], "/nowhere", ""
    assert "not on the PATH" in refused(cloth)
    os.environ["PATH"] = path
    preferences.program = PROGRAM
    assert bake(cloth) == os.path.abspath("elsewhere")
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    bpy.ops.preferences.addon_enable(module="drape_cloth")
    bpy.context.scene.frame_end = 3
    cloth = sheet()
    assert bake(cloth).startswith(bpy.app.tempdir)  # a file that was never saved


def mesh_object(name, points, faces):
    """An object of these vertices and faces, active."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], faces)
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    return thing


def test_places_and_numbers():
    """messages have places in the axes of Blender, and the numbers of the vertices of colliders, too, which may have loose ones"""
    new_file()
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    cloth = mesh_object("Rag", [(0, 2, 1), (1, 2, 1), (3, 2, 1), (1, 3, 1)], [(0, 1, 2), (0, 2, 3)])
    cloth.drape.role = "CLOTH"
    assert "; remedy: move node 1, at (1, 2, 1) m, off the line" in refused(cloth)
    cloth.data.vertices[1].co.y = 1
    rock = collider(mesh_object("Rock", [(9, 9, 9), (0, 0, 0), (0, 0, -1), (0, 1, -1), (1, 0, -1), (-1, 0, -1)], [(2, 3, 1), (3, 2, 4), (2, 3, 5)]))
    said = refused(cloth)
    assert "Rock: " in said and "edge 2 3 is shared by triangles 0, 1 and 2;" in said and "between (0, 0, -1) and (0, 1, -1) m" in said, said
    rock.data.clear_geometry()
    rock.data.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    folder = bake(cloth)
    assert not [name for name in os.listdir(folder) if name.endswith("_vertices.npy")]
    numbers = np.array([4, 7, 9])
    assert program.renumbered("triangle 2 (nodes 0 1 2): nodes 1 and 2, at node 0, edge 0 8", numbers) == "triangle 2 (nodes 4 7 9): nodes 7 and 9, at node 4, edge 4 8"
    assert program.z_up("at (1.5, -2e-07, 3) and (0 1 -0)") == "at (1.5, -3, -2e-07) and (0, 0, 1)"


def test_refusals():
    """what Blender allows and a bake does not is said in words before the bake, not by a traceback or after it"""
    scene = new_file()
    cube = collider(bpy.data.objects["Cube"])
    cloth = sheet(quality="REALTIME")
    for shape in "MESH", "BOX", "SPHERE", "PLANE":
        cube.drape.shape, cube.scale.z = shape, 0
        assert "Cube: is scaled to nothing along an axis in frame 1" in refused(cloth), shape
    cube.drape.shape = "MESH"
    for thing in cube, cloth:
        for scale, frame in (1, 1), (0, 3), (1, FRAMES):
            thing.scale.z = scale
            thing.keyframe_insert("scale", frame=frame)
        scene.frame_set(1)
        assert f"{thing.name}: is scaled to nothing along an axis in frame 3" in refused(cloth)
        thing.animation_data_clear()
        thing.scale.z = 1
    bpy.ops.object.empty_add()
    for thing in bpy.context.object, bpy.data.objects["Light"]:
        thing.drape.role = "COLLIDER"
        assert f"{thing.name}: is of the type {thing.type.title()}, which has no surface" in refused(cloth)
        thing.drape.role = "NONE"
    bpy.ops.object.effector_add(type="WIND")
    wind = bpy.context.object
    wind.scale = 0, 0, 0
    assert f"{wind.name}: is scaled to nothing along its z axis in frame 1, so its wind has no direction" in refused(cloth)
    bpy.data.objects.remove(wind)

    folder = bake(cloth)
    bpy.ops.drape.clear()
    other = cloth.modifiers.new("Drape", "SUBSURF")
    bake(cloth)
    assert [(modifier.name, modifier.type) for modifier in cloth.modifiers] == [("Drape.001", "MESH_CACHE"), ("Drape", "SUBSURF")]
    other.show_viewport = False
    plays(cloth, folder)
    bake(cloth)
    assert len(cloth.modifiers) == 2
    bpy.ops.drape.clear()
    assert list(cloth.modifiers) == [other]
    cloth.modifiers.remove(other)

    bpy.context.view_layer.objects.active = cloth
    for text in '{"a": 1}', "[1]", "{", '{"cloth": [], "colliders": []}', '{"cloth": [{"name": "x", "mesh": {"file": "y"}}], "colliders": [], "duration": NaN, "frame_rate": 1}':
        with open(folder + "/scene.json", "w", encoding="utf-8") as file:
            file.write(text)
        try:
            bpy.ops.drape.resume()
            raise AssertionError("resumed")
        except RuntimeError as error:
            assert "scene.json is not the scene of a bake" in str(error) and "Traceback" not in str(error), error


def test_linked():
    """a linked cloth is refused before the bake; a library override bakes, unless the bake would come before modifiers of the library"""
    new_file()
    cloth = sheet(quality="REALTIME", folder="//linked")
    bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath("library.blend"))
    cloth.modifiers.new("Smoother", "SUBSURF")
    bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath("smooth.blend"))
    for library in "library", "smooth":
        new_file()
        with bpy.data.libraries.load(os.path.abspath(library + ".blend"), link=True) as (_, to):
            to.objects = ["Tablecloth"]
        linked, = to.objects
        bpy.context.collection.objects.link(linked)
        said = refused(linked)
        assert f"Tablecloth: is linked from {os.path.abspath(library)}.blend" in said and not os.path.exists("linked"), said
        own = linked.override_create(remap_local_usages=True)
        if library == "library":
            plays(own, bake(own))
            shutil.rmtree("linked")
        else:
            assert "Tablecloth: has modifiers from its library" in refused(own) and not os.path.exists("linked")


def test_text():
    """text is a collider, flat or thick, though Blender gives it triangles without area; a closed mesh that has such is open there, which the bake says"""
    new_file()
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.ops.object.text_add(location=(-1, -0.2, 1))
    text = collider(bpy.context.object, surface_thickness=0.01)
    cloth = sheet(z=1.2, quality="REALTIME")
    for extrude in 0, 0.1:
        text.data.extrude = extrude
        x = plays(cloth, bake(cloth))
        assert x[-1][:, 2].max() > 1 + extrude  # some of it lies on the letters
    bpy.data.objects.remove(text)
    cut = collider(mesh_object("Cut", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0.5, 0, 0)], [(0, 2, 1), (0, 4, 3), (4, 1, 3), (1, 2, 3), (2, 0, 3), (0, 1, 4)]))
    warning, = export_to("other", cloth)
    assert warning == "Cut: 1 triangles without area are left out, and the surface is open there: merge vertices by distance", warning
    assert scene_of("other")["colliders"][0]["open"]
    cut.data.clear_geometry()
    cut.data.from_pydata([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [], [(0, 1, 2)])
    assert "Cut: its faces have no area" in refused(cloth)


def test_changed_files():
    """files of an earlier bake that were damaged do not block a new one, which keeps them; Resume says what is wrong"""
    new_file()
    cloth = sheet(quality="REALTIME", z=2)
    folder = bake(cloth)
    x = positions(folder)
    for damage in "", "x" * 100:
        for name in "positions.npy", "energy.csv":
            with open(f"{folder}/run/{name}", "w", encoding="utf-8") as file:
                file.write(damage)
        try:
            bake(cloth, "resume")
            raise AssertionError("resumed")
        except RuntimeError as error:
            assert "Tablecloth: drape run: cannot continue" in str(error) and "it is damaged" in str(error), error
        assert (positions(bake(cloth)) == x).all()
    changed = sorted(name for name in os.listdir(folder + "/run") if ".changed" in name)
    assert changed == [f"{name}.changed{number}" for name in ("energy.csv", "positions.npy") for number in ("", 1)], changed


def users_files(folder):
    """What a folder has of the user: the bytes of files, and links."""
    return {name: os.readlink(path) if os.path.islink(path) else open(path, encoding="utf-8").read()
            for name in os.listdir(folder) for path in [folder + "/" + name] if os.path.islink(path) or os.path.isfile(path)}


def test_users_files():
    """a folder of the user is refused as it is; files that the user changed or put into a bake's folder keep their bytes, and links are not followed"""
    new_file(frames=3)
    cloth = sheet(quality="REALTIME", z=2, folder="//mine")
    os.mkdir("mine")
    for name in "mine/scene.json", "mine/cloth.obj", "mine/collider_0.obj", "letter.txt":
        with open(name, "w", encoding="utf-8") as file:
            file.write("of the user")
    os.symlink("../letter.txt", "mine/drape.log")
    before = users_files("mine")
    for operator in "bake", "resume":
        assert "has files of something else" in refused(cloth, operator) and users_files("mine") == before
    cloth.drape.folder = ""
    folder = bake(cloth)
    x = positions(folder)
    os.rename(folder + "/run", "elsewhere")
    os.symlink("../elsewhere", folder + "/run")
    left = os.listdir("elsewhere")
    assert "Tablecloth: there is no folder run in" in refused(cloth, "resume") and os.listdir("elsewhere") == left
    links = "drape.log", "cloth.pc2", "scene.json", "to_local.npy", "collider_0.obj"
    for name in links:
        if os.path.exists(folder + "/" + name):
            os.remove(folder + "/" + name)
        os.symlink("../letter.txt", folder + "/" + name)
    with open(folder + "/cloth.obj", "a", encoding="utf-8") as file:
        file.write("# of the user")
    collider(bpy.data.objects["Cube"])
    assert len(positions(bake(cloth))) == len(x)
    assert {os.readlink(f"{folder}/{name}.changed") for name in links} == {"../letter.txt"} and os.readlink(folder + "/run.changed") == "../elsewhere"
    assert os.listdir("elsewhere") == left and not os.path.islink(folder + "/run") and not [name for name in os.listdir(folder) if name.endswith(".part")]
    with open("letter.txt", encoding="utf-8") as letter, open(folder + "/cloth.obj.changed", encoding="utf-8") as mesh:
        assert letter.read() == "of the user" and mesh.read().endswith("# of the user")
    count = len(os.listdir(folder))
    plays(cloth, bake(cloth))
    assert len(os.listdir(folder)) == count, os.listdir(folder)  # nothing else was changed


def test_owner():
    """two files with an object of the same name do not share a bake; a file finds its own after it was moved, or was not saved, and a copy does not get that of the original"""
    new_file(frames=3, name="a.blend")
    folder = bake(sheet(quality="REALTIME"))
    before = scene_of(folder), positions(folder)

    def untouched(of="a.blend"):
        for operator in "bake", "resume":
            assert f"drape_Tablecloth has the bake of Tablecloth of {of}: name another one" in refused(bpy.data.objects["Tablecloth"], operator)
        assert scene_of(folder) == before[0] and (positions(folder) == before[1]).all()

    new_file(frames=3, name="b.blend")
    cloth = sheet(quality="REALTIME", z=2)
    untouched()
    cloth.drape.folder = "//other"
    assert bake(cloth) == os.path.abspath("other")
    bpy.ops.wm.open_mainfile(filepath="a.blend")  # as it was saved before the bake
    cloth = sheet(quality="REALTIME")
    assert (positions(bake(cloth, "resume")) == before[1]).all() and cloth.drape.bake_id
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath("copy.blend"))
    untouched()
    os.rename("a.blend", "moved.blend")
    bpy.ops.wm.open_mainfile(filepath="moved.blend")
    bake(bpy.data.objects["Tablecloth"])
    before = scene_of(folder), positions(folder)
    bpy.ops.wm.open_mainfile(filepath="copy.blend")
    untouched("moved.blend")
    os.mkdir("project")
    for name in "moved.blend", "drape_Tablecloth":
        os.rename(name, "project/" + name)
    bpy.ops.wm.open_mainfile(filepath="project/moved.blend")
    cloth = bpy.data.objects["Tablecloth"]
    assert bake(cloth, "resume") == os.path.abspath("project/drape_Tablecloth")
    bpy.ops.object.select_all(action="DESELECT")
    cloth.select_set(True)
    bpy.ops.object.duplicate()
    copy = bpy.context.object
    assert copy.drape.bake_id == cloth.drape.bake_id and bake(copy) == os.path.abspath("project/drape_Tablecloth.001")
    bake(cloth)
    cloth.name, copy.name = "First", "Tablecloth"
    assert bake(cloth) == os.path.abspath("project/drape_First")
    for _ in range(2):  # files that were never saved
        bpy.ops.wm.read_homefile(use_factory_startup=True)
        bpy.ops.preferences.addon_enable(module="drape_cloth")
        bpy.context.scene.frame_end = 3
        cloth = sheet(quality="REALTIME")
        folder = bake(cloth)
        cloth.drape.bake_id = ""  # as after an undo
        assert bake(cloth) == folder and folder.startswith(bpy.app.tempdir)


def test_names():
    """whatever the name of an object is, its bake is in one folder beside the file, and what is said about it is one line"""
    new_file(frames=2)
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    cloth = sheet(side=4, quality="REALTIME")
    for name in "Täch", "Tüch", "a\nb", "q\"'`$(touch x)`", "../up", "..", "\x1b[31mred", "ü" * 31, "/" * 63, "%s", "scene.json: 3":
        cloth.name = name
        before = set(os.listdir("."))
        folder = bake(cloth)
        assert cloth.name == name and os.path.dirname(folder) == os.getcwd() and set(os.listdir(".")) - before == {os.path.basename(folder)}, (name, folder)
        plays(cloth, folder)
        assert bake(cloth, "resume") == folder
        cloth.drape.fabric = "sackcloth"
        said = refused(cloth).strip()
        assert said.startswith("Error: " + folders.one_line(name) + ": /cloth/0/material/fabric") and said.isprintable(), said
        cloth.drape.fabric = ""


def test_interrupt():
    """Ctrl-C, which Blender takes for itself, ends the bake and the script, and the bake can be resumed"""
    new_file(frames=120)
    cloth = sheet(side=12, pin_group="rim")
    cloth.vertex_groups.new(name="rim").add([0, 11], 1, "REPLACE")
    handler = ctypes.pythonapi.PyOS_getsig
    handler.restype = ctypes.c_void_p
    before = handler(signal.SIGINT)

    def interrupt():
        while not operators.running or operators.running[0].bake.done() < 12:
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    said = refused(cloth)
    thread.join()
    assert "Tablecloth: interrupted after " in said and "Resume continues" in said and not operators.running, said
    assert handler(signal.SIGINT) == before
    assert 12 <= len(plays(cloth, operators.folder_of(cloth))) < 120
    assert len(positions(bake(cloth, "resume"))) == 120


def test_choices():
    """every fabric, quality and method that the add-on offers is one of the program, and bakes"""
    new_file(frames=2)
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    settings = importlib.import_module("drape_cloth.properties")
    names = [name for name, _ in program.fabrics(PROGRAM)]
    assert len(names) > 10 and "wang2011_denim" in names and settings.search_fabrics(None, None, "denim")[0][0] == "wang2011_denim"
    cloth = sheet(side=4)
    listed = subprocess.run([PROGRAM, "list", "integrators", "--markdown"], capture_output=True, text=True, check=True).stdout
    for name, *_ in settings.METHODS:
        assert f"| `{name}` |" in listed, name
    for quality, *_ in settings.QUALITIES:
        cloth.drape.quality = quality
        for method in [item[0] for item in settings.METHODS] if quality == "CUSTOM" else ["be"]:
            cloth.drape.method = method
            made = scene_of(bake(cloth))
            assert len(positions(operators.folder_of(cloth))) == 2
            assert quality != "CUSTOM" or made["integrator"]["method"] == method
            assert ("accuracy" in made) == (quality == "ACCURATE") != ("integrator" in made)
    cloth.drape.quality = "REALTIME"
    for name in names:
        cloth.drape.fabric = name
        assert scene_of(bake(cloth))["cloth"][0]["material"] == {"fabric": name}


def test_page():
    """the script of docs/blender.md bakes its table cloth; here it has fewer nodes and frames"""
    new_file()
    with open(os.environ["DRAPE_SOURCE"] + "/docs/blender.md", encoding="utf-8") as file:
        script, = re.findall(r"```python\n(.*?)```", file.read(), re.S)
    for old, new in ("=30", "=8"), ("frame_end = 50", "frame_end = 4"), ("/tmp/table.blend", os.path.abspath("table.blend")):
        assert old in script, old
        script = script.replace(old, new)
    exec(compile(script, "docs/blender.md", "exec"), {})  # pylint: disable=exec-used
    bpy.ops.wm.open_mainfile(filepath="table.blend")
    cloth = bpy.data.objects["Grid"]
    assert len(plays(cloth, operators.folder_of(cloth))) == 4 and cloth.drape.fabric == "wang2011_tablecloth"
    assert cloth.modifiers["Drape"].filepath == "//drape_Grid/cloth.pc2", cloth.modifiers["Drape"].filepath


def test_quads():
    """quads are cut along alternating diagonals, the shorter one or the one inside; other polygons as Blender cuts them; nodes keep their numbers"""
    mesh = importlib.import_module("drape_cloth.mesh")
    none = np.empty((0, 3), int), np.empty(0, int)
    grid = np.array([[x, y, 0] for y in range(3) for x in range(3)], float)
    quads = [(0, 1, 4, 3), (1, 2, 5, 4), (3, 4, 7, 6), (4, 5, 8, 7)]
    cut = mesh.split(quads, *none, grid)
    diagonals = [set(map(int, first)) & set(map(int, second)) for first, second in zip(cut[::2], cut[1::2])]
    assert diagonals == [{0, 4}, {2, 4}, {4, 6}, {4, 8}], diagonals
    assert np.isclose(sum(np.cross(grid[b] - grid[a], grid[c] - grid[a])[2] / 2 for a, b, c in cut), 4)
    long = np.array([[0, 0, 0], [1, 0, 0], [3, 1, 0], [0, 1, 0]], float)
    assert [0, 1, 3] in np.sort(mesh.split([(0, 1, 2, 3)], *none, long)).tolist()
    dart = np.array([[0, 0, 0], [2, -1, 0], [0.5, 0, 0], [2, 1, 0]], float)  # its diagonal from 1 to 3 is outside
    assert [0, 1, 2] in np.sort(mesh.split([(0, 1, 2, 3)], *none, dart)).tolist()
    five = mesh.split([(0, 1, 2, 3), (4, 5, 6, 7, 8)], np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [4, 7, 8]]), np.array([0, 0, 1, 1, 1]), grid)
    assert len(five) == 5 and five[2:].tolist() == [[4, 5, 6], [4, 6, 7], [4, 7, 8]]


def main():
    tests = [(name, test) for name, test in globals().items() if name.startswith("test_") and name.endswith(os.environ.get("ONLY", ""))]
    failed = 0
    with open(os.environ["TAP"], "w", encoding="utf-8", buffering=1) as tap:
        print(f"1..{len(tests)}", file=tap)
        for number, (_, test) in enumerate(tests, 1):
            with tempfile.TemporaryDirectory() as folder:
                os.chdir(folder)
                try:
                    test()
                    print(f"ok {number} - {test.__doc__}", file=tap)
                except Exception:  # pylint: disable=broad-except
                    failed += 1
                    print(f"not ok {number} - {test.__doc__}", file=tap)
                    print("# " + traceback.format_exc().rstrip().replace("\n", "\n# "), file=tap)
                os.chdir("/")
    return failed > 0


sys.exit(main())
