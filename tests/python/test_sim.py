#!/usr/bin/env python3
"""test_sim.py: scenes and sims in Python. See package.py."""
import copy
import gc
import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import weakref

from package import ENVIRONMENT, SOURCES, equal, raises, run_tests, sheet
import drape  # after package, which says where it is
import numpy as np

KIND = drape.EventKind


def moving(**changes):
    sim = drape.Sim(sheet(**changes))
    sim.advance(0.1)
    return sim


# ---- Scenes

def test_pointers():
    """a scene is a dictionary with pointers"""
    scene = drape.Scene(sheet())
    scene["/integrator/dt"] = 1e-3
    scene["/contact/distance"] = 2e-3  # an object that was not there
    scene["/colliders/-"] = {"type": "plane", "point": [0, -1, 0], "normal": [0, 1, 0]}
    scene["/cloth/0/material"]["density"] = np.float64(150)
    equal((scene["/integrator/dt"], scene["/colliders/1/type"], scene.get("/none", 3)), (1e-3, "plane", 3))
    assert "/cloth/0/name" in scene and "/cloth/1" not in scene
    model = scene.compile()
    equal(model.collider_count, 2)
    assert abs(model.masses.sum() - 150 * 1e-3 * 0.25) < 1e-12
    del scene["/colliders/1"]
    equal(drape.Model(scene).collider_count, 1)
    raises(KeyError, lambda: scene["/nothing/at/all"])
    raises(KeyError, lambda: scene[5], says="5 is not a pointer")
    assert 5 not in scene and scene.get(5) is None
    raises(IndexError, lambda: scene["/colliders/7"])
    other = scene.copy()
    other["/duration"] = 9
    equal(scene["/duration"], 0.2)


def test_files():
    """a scene from a file keeps its comments' lines in messages, its folder for meshes, and takes changes"""
    drape.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).write("triangle.ply")
    text = json.dumps(sheet(mesh={"file": "triangle.ply"}, pins=[{"nodes": [0]}]), indent=1)
    os.mkdir("there")
    os.rename("triangle.ply", "there/triangle.ply")
    with open("there/scene.json", "w", encoding="utf-8") as file:
        file.write('// "a" comment\n/* and /* another */' + text)
    scene = drape.Scene("there/scene.json")
    equal(drape.Model(scene).node_count, 3)
    scene["/cloth/0/material/density"] = -1
    raises(drape.ArgumentError, scene.compile, says="/cloth/0/material/density: -1 is not allowed")
    scene["/cloth/0/material/density"] = 200
    scene["/colliders"] = []
    scene.write("moved.json")
    equal(drape.Model("moved.json").node_count, 3)
    for name in sorted(os.listdir(SOURCES + "/examples/scenes")):
        if name.endswith(".json"):
            scene = drape.Scene(f"{SOURCES}/examples/scenes/{name}")  # all of them are read
            scene.write("moved.json")
    drape.Scene(SOURCES + "/examples/scenes/limb.json").write("limb.json")  # has a mesh that is animated by another file
    equal(drape.Model("limb.json").node_count, drape.Model(SOURCES + "/examples/scenes/limb.json").node_count)


def test_errors():
    """errors have the library's message and status, and are also Python's own kinds"""
    error = raises(drape.ArgumentError, drape.Sim, {"drape": 1}, says='"cloth" is missing')
    equal(error.status, drape.Status.E_ARGUMENT)
    assert isinstance(error, ValueError) and isinstance(error, drape.Error)
    raises(drape.FileError, drape.Scene, "none.json", says="none.json")
    raises(OSError, drape.Scene, "none.json")
    with open("broken.json", "w", encoding="utf-8") as file:
        file.write("{")
    raises(drape.ParseError, drape.Scene, "broken.json", says="broken.json:1:")
    raises(drape.ArgumentError, drape.Sim, sheet(), integrator="nothing", says="nothing")
    sim = drape.Sim(sheet(), controller="fixed", integrator_settings={"max_iterations": 1, "tolerance": 1e-12})
    raises(drape.StepError, sim.advance, 0.2)
    raises(drape.ArgumentError, sim.advance, float("nan"))
    raises(drape.ArgumentError, sim.push, np.zeros((3, 3)), says="36 x 3")


def test_not_finite():
    """a NaN or an infinity in an array, a mesh or a scene is refused with its place and value"""
    x, triangles = np.array([[0, 0, 0], [0.2, 0, 0], [0.2, 0, 0.2], [0, 0, 0.2]]), [[0, 2, 1], [0, 3, 2]]
    mesh = drape.Mesh(x, triangles)
    sim = drape.Sim(sheet(mesh=drape.Mesh(x, triangles), pins=[{"nodes": [0]}]))
    for value in float("nan"), float("inf"), float("-inf"):
        bad = x.copy()
        bad[2, 1] = value
        says = f"[2, 1]: {value} is not allowed"
        for call, argument, *given in ((drape.Mesh, "positions", bad, triangles), (sim.push, "forces", bad), (sim.closest, "points", bad), (sim.cast, "origins", bad, [0, 1, 0]),
                                        (sim.set_state, "positions", 0.0, bad, x), (sim.model.normals, "positions", bad),
                                       (drape.Embedding, "vertices", sim.model, bad)):
            raises(drape.ArgumentError, call, *given, says=argument + says)
        raises(drape.ArgumentError, sim.set_masses, [1, 2], [1, value], says=f"masses[1]: {value} is not allowed")
        scene = drape.Scene(sheet(mesh=mesh, pins=[{"nodes": [0]}]))
        scene["/cloth/0/velocity"] = [0, value, 0]
        raises(drape.ArgumentError, drape.Model, scene, says=f"/cloth/0/velocity/1: {value} is not allowed")
        scene["/cloth/0/velocity"] = np.array([0, value, 0])
        raises(drape.ArgumentError, drape.Model, scene, says=f"/cloth/0/velocity[1]: {value} is not allowed")
        del scene["/cloth/0/velocity"]
        mesh.positions[2, 1] = value
        raises(drape.ArgumentError, drape.Model, scene, says="/cloth/0/mesh: positions" + says)
        mesh.positions[2, 1] = 0
        scene["/cloth/0/render_mesh"] = drape.Mesh(x + [0, 0.01, 0], triangles)
        scene["/cloth/0/render_mesh"].positions[2, 1] = value
        raises(drape.ArgumentError, drape.Model, scene, says="/cloth/0/render_mesh: positions" + says)
    raises(drape.ArgumentError, drape.Embedding, sim.model, x * 1e50, says="vertices[1, 0]: 2e+49 is not allowed; it must be finite and fit into single precision")
    sim.advance(0.02)


def test_meshes():
    """meshes come from arrays and from dictionaries of trimesh and meshio, and go there"""
    x, quads = [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]], [[0, 1, 2, 3]]
    for given in ({"vertices": x, "faces": [[0, 1, 2], [0, 2, 3]]}, {"points": x, "cells": [("quad", np.array(quads))]}, {"points": x, "cells": {"quad": quads}}):
        mesh = drape.Mesh.of(given)
        equal(mesh.triangles.tolist(), [[0, 1, 2], [0, 2, 3]])
    corners = drape.Mesh.of({"points": x, "cells": [("vertex", [[0]]), ("line", [[0, 1]]), ("triangle", [[0, 1, 2]]), ("polygon", [[0, 2, 3]])]})
    equal(corners.triangles.tolist(), [[0, 1, 2], [0, 2, 3]])
    for given, says in (({"points": x, "cells": [("tetra", [[0, 1, 2, 3]])]}, "cells: has tetra"), ({"points": x, "cells": [("triangle6", [[0] * 6])]}, "cells: has triangle6"),
                        ({"points": x, "cells": [("line", [[0, 1]])]}, "cells: there are no faces"), ({"vertices": x, "faces": []}, "faces: there are no faces"),
                        ({"vertices": x, "faces": [0, 1, 2]}, "faces[0]: 0 is not a face"), ({"vertices": x, "faces": [[0, 1, 2], [0, 1]]}, "faces[1]: [0, 1] is not a face"),
                        ({"vertices": x, "faces": np.array([[0, 1], [1, 2]])}, "faces[0]: [0, 1] is not a face"), ({"vertices": x, "faces": np.arange(3)}, "faces[0]: 0 is")):
        raises(drape.ArgumentError, drape.Mesh.of, given, says=says)
    raises(drape.ArgumentError, drape.Mesh, x, [[0, 1, 2], [0, 1, -1]], says="triangles[1, 2]: there is no node -1: there are 4, from 0")
    raises(drape.ArgumentError, drape.Mesh, x, [[0, 4, 2]], says="triangles[0, 1]: there is no node 4")
    for name, head in (("m.OBJ", b"v "), ("m.Ply", b"ply"), (b"m.obj", b"v ")):
        mesh.write(name)
        equal(open(name, "rb").read()[:len(head)], head)
    for name in "m.stl", "m", ".obj", "m.obj.bak":
        raises(drape.ArgumentError, mesh.write, name, says="is written as .ply or .obj")
    scene = drape.Scene(sheet(mesh=drape.Mesh(np.array(x) / 3, mesh.triangles, transform={"translate": [0, 1, 0]}), pins=[{"nodes": [0]}]))
    scene["/cloth/0/mesh/transform/scale"] = 2.0
    model = scene.compile()
    assert np.array_equal(model.rest_positions, 2 * (np.array(x) / 3) + [0, 1, 0])  # all digits, as the file has
    out = model.mesh(0)
    assert np.array_equal(drape.Mesh.of(out.to_trimesh()).positions, out.positions) and np.array_equal(drape.Mesh.of(out.to_meshio()).triangles, mesh.triangles)
    out.write("out.obj")
    assert np.array_equal(drape.Model(sheet(mesh={"file": "out.obj"}, pins=[{"nodes": [0]}])).rest_positions, out.positions)
    raises(drape.ArgumentError, drape.Mesh, x, [[0, 1, 9]])


# ---- Arrays

def test_views():
    """positions are the library's own memory, read only"""
    sim = moving()
    x = sim.positions
    equal((x.shape, x.dtype, x.flags.writeable, x.flags.owndata), ((36, 3), np.dtype(float), False, False))
    equal(x.ctypes.data, drape._library.lib.drape_sim_positions(sim._address))
    raises(ValueError, x.__setitem__, 0, 0)
    raises(ValueError, setattr, x.flags, "writeable", True)
    equal(sim.pinned.tolist(), drape.Model(sheet()).pinned.tolist())
    assert np.array_equal(sim.velocities, drape.Sim.velocities.fget(sim))


def test_views_outlive():
    """arrays stay valid when the sim goes: closed, collected, changed, or another one is put in its place"""
    def copies(sim):
        arrays = [sim.positions, sim.velocities[3:7], sim.masses, sim.model.rest_positions, sim.model.triangles]
        return arrays, [array.copy() for array in arrays]

    def churn():  # memory that was freed would be used again
        gc.collect()
        other = [moving() for _ in range(3)]
        del other
        gc.collect()

    for end in (lambda sim: sim.close(), lambda sim: None, lambda sim: sim.pin([7, 8]), lambda sim: sim.set_masses([3], 0.5), lambda sim: sim.change(sheet(gravity=[0, -1, 0])),
                lambda sim: sim.restore_checkpoint(sim.checkpoint()), lambda sim: sim.attach("ball", [20])):
        sim = moving()
        arrays, before = copies(sim)
        end(sim)
        del sim
        churn()
        for array, was in zip(arrays, before):
            assert np.array_equal(array, was)


def test_nothing_is_kept():
    """a sim without views is freed at once, and a view keeps its own block only"""
    sim = moving()
    memory, gone = sim._context.memory, weakref.ref(sim)
    x = sim.positions
    blocks = memory.blocks
    del sim
    assert gone() is None and len(blocks) <= 1, blocks  # without a collection; the block of the context goes with the view's
    assert np.isfinite(x).all()


def test_cycles_are_collected():
    """a wind, an event, an observer and a term that refer to what has the sim do not keep it"""
    class Lab:
        def __init__(self):
            term = drape.Term("my.weight", 1, self.elements, self.energy, external=True)
            self.sim = drape.Sim(drape.Model(sheet(terms=["stretch.edge", "drag.wind", "my.weight"]), terms=[term]))
            self.sim.set_wind(self.wind)
            self.sim.add_event("mine", self.event)
            self.sim.observe(self.observe)

        def wind(self, *_):
            return [self.sim.time * 0, 0, 1]

        def event(self, t, x, v):
            return x[0, 0] + 1 + 0 * len(self.sim.positions)

        def observe(self, _):
            assert self.sim.time >= 0

        def elements(self, cloth):
            return np.arange(len(cloth.rest))[:, None], cloth.node_mass[:, None]

        def energy(self, x, mass):
            return mass[:, 0] * x[:, 0, 1], mass[:, :, None] * [0, 1, 0], np.zeros((3, 3))

    gone = []
    for _ in range(3):
        lab = Lab()
        lab.sim.advance(0.02)
        gone += [weakref.ref(lab.sim), weakref.ref(lab.sim._context), weakref.ref(lab.sim.model._context)]
    del lab
    gc.collect()
    equal([ref() for ref in gone], [None] * len(gone))


def test_wind_goes():
    """a wind that is replaced is called no more, and the sim goes on with a wind whose function is held by nothing else"""
    sim, calls = drape.Sim(sheet()), []
    sim.set_wind(lambda t, x: calls.append(1) or [1, 0, 0])
    gc.collect()
    sim.advance(0.02)
    first = len(calls)
    sim.set_wind(lambda t, x: calls.append(2) or [0, 0, 0])
    sim.advance(0.04)
    assert 1 in calls[:first] and 2 in calls[first:] and 1 not in calls[first:]


def test_closing():
    """a sim is closed once; afterwards calls are refused"""
    with drape.Sim(sheet()) as sim:
        pass
    sim.close()
    for call in (lambda: sim.time, lambda: sim.positions, lambda: sim.advance(1), lambda: sim.energy, lambda: sim.pin([3])):
        raises(drape.ArgumentError, call, says="closed")
    sim.cancel()
    equal(repr(sim), "Sim(closed)")


def test_interpreter_ends():
    """the interpreter ends in order with sims, views and callbacks alive"""
    code = f"import drape, json\nsim = drape.Sim(json.loads({json.dumps(sheet())!r}))\nx = sim.positions\nsim.observe(print, drape.EventKind.ROOT)\n" \
           "sim.set_wind(lambda t, x: [1, 0, 0])\nsim.advance(0.05)\nf = sim.frames(0.2)\nnext(f)\n"
    result = subprocess.run([sys.executable, "-X", "dev", "-c", code], env=ENVIRONMENT, capture_output=True, text=True, check=False)
    equal((result.returncode, result.stdout, result.stderr), (0, "", ""))


def test_ends_while_advancing():
    """the interpreter ends in order while a daemon thread advances a sim, whether that ends at once, advances again, or waits in a callback"""
    code = """if True:
        import drape, json, sys, threading, time
        sim, started = drape.Sim(json.loads(sys.argv[1])), threading.Event()
        sim.set_wind(lambda t, x: [1, 0, 0])

        def work():
            while True:
                try:
                    sim.advance(1e6)
                except drape.Stopped:
                    if sys.argv[2] == "once":
                        return

        def observe(event):
            started.set()
            if sys.argv[2] == "waits":
                time.sleep(1e3)

        sim.observe(observe)
        if sys.argv[2] == "waits":
            drape.sim._PATIENCE = 0.1
        threading.Thread(target=work, daemon=True).start()
        started.wait()"""
    for kind in "once", "again", "waits":
        result = subprocess.run([sys.executable, "-c", code, json.dumps(sheet()), kind], env=ENVIRONMENT, capture_output=True, text=True, check=False, timeout=60)
        equal((result.returncode, result.stdout, result.stderr), (0, "", ""), kind)


def test_objects():
    """an object of another class is refused where its address would be taken, and a sim is not copied"""
    sim = drape.Sim(sheet())
    for what in (sim, None, sim.model._address, sheet()):
        raises(TypeError, drape.Embedding, what, [[0, 0, 0]], says="model: needs a drape.Model")
        raises(TypeError, drape.Model, sheet(), [what], says="terms: needs a drape.Term")
    for call in (lambda: drape.Sim(sim), lambda: drape.Model(sim), lambda: drape.Model(sim.model), lambda: sim.change(sim), lambda: drape.run(sim.model)):
        raises(TypeError, call, says="a scene is")
    for copied in (copy.copy, copy.deepcopy, pickle.dumps):
        raises(TypeError, copied, sim, says="restore_checkpoint")


# ---- Advancing

def test_frames():
    """iteration over frames makes the steps of one advance, to the bit, with every integrator that has a history"""
    for integrator in ("be", "bdf2", "ida", "verlet"):
        straight = drape.Sim(sheet(), integrator=integrator)
        straight.advance(0.2)
        sim = drape.Sim(sheet(), integrator=integrator)
        frames = list(sim.frames())
        equal([f.index for f in frames], list(range(7)))
        assert np.allclose([f.time for f in frames], np.arange(7) / 30)
        assert not np.array_equal(frames[3].positions, frames[4].positions)  # each has its own arrays
        equal((sim.hash, sim.time), (straight.hash, 0.2), integrator)


def test_observers():
    """observers are called for their kinds, in order, and may stop the advance"""
    sim, calls = drape.Sim(sheet()), []
    sim.observe(lambda event: calls.append(("frame", event.frame, event.positions.shape)), KIND.FRAME)
    sim.observe(lambda event: calls.append(("step", event.attempt.index, event.attempt.status)), KIND.ATTEMPT)
    sim.advance(0.02)
    equal(calls, [("frame", 0, (36, 3)), ("step", 0, 0), ("step", 1, 0)])

    @sim.observe
    def stop(event):
        return event.kind == KIND.ATTEMPT and event.attempt.index >= 4

    error = raises(drape.Stopped, sim.advance, 0.2)
    equal((error.status, round(sim.time, 6)), (drape.Status.E_STOPPED, 0.05))
    sim.unobserve(stop)
    sim.advance(0.2)
    straight = drape.Sim(sheet())
    straight.advance(0.2)
    equal(sim.hash, straight.hash)


def test_exceptions():
    """an exception in an observer, a wind or an event comes out of advance, and the sim goes on as if nothing had happened"""
    straight = drape.Sim(sheet())
    straight.advance(0.2)

    class Mine(Exception):
        pass

    def fail(*_):
        raise Mine("from inside")

    sim = drape.Sim(sheet())
    sim.observe(fail, KIND.FRAME)
    error = raises(Mine, sim.advance, 0.2, says="from inside")
    assert any(frame.name == "fail" for frame in __import__("traceback").extract_tb(error.__traceback__))
    sim.unobserve(fail)
    sim.advance(0.2)
    equal(sim.hash, straight.hash)
    sim = drape.Sim(sheet())
    sim.advance(0.04)
    before = sim.hash
    sim.set_wind(fail)
    raises(Mine, sim.advance, 0.2)
    raises(Mine, lambda: sim.reactions)  # forces need the wind, too
    sim.set_wind(None)
    equal(sim.hash, before)
    sim.advance(0.2)  # with other steps, as after any rejected attempt
    assert abs(sim.positions - straight.positions).max() < 0.05
    for integrator in ("verlet", "ida", "newton_k", "radau"):
        other = drape.Sim(sheet(), integrator=integrator)
        other.set_wind(fail)
        raises(Mine, other.advance, 0.2)
        equal(other.time, 0)
        other.set_wind(None)
        other.advance(0.05)
    other = drape.Sim(sheet())
    other.add_event("mine", fail)
    raises(Mine, other.advance, 0.2)
    equal(other.time, 0)


def test_inside_callbacks():
    """an observer may read and save, but not advance, change or close the sim"""
    sim, found = drape.Sim(sheet()), []

    def observe(event):
        if event.kind == KIND.FRAME and event.frame == 2:
            found.append((sim.energy, sim.reactions, sim.checkpoint()))
            for call in (lambda: sim.advance(1), sim.close, lambda: sim.pin([5]), lambda: list(sim.frames(1)), lambda: sim.push(None)):
                raises(drape.ArgumentError, call)

    sim.observe(observe)
    sim.advance(0.2)
    equal(len(found), 1)
    other = drape.Sim(sheet())
    other.restore_checkpoint(found[0][2])
    other.advance(0.2)
    equal(other.hash, sim.hash)


def test_threads():
    """sims of one model run in threads, the interpreter is free meanwhile, and a sim that is in use is waited for"""
    model = drape.Model(sheet())
    sims = [drape.Sim(model) for _ in range(4)]
    threads = [threading.Thread(target=sim.advance, args=(0.2,)) for sim in sims + sims]  # each of them twice
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    equal(len({sim.hash for sim in sims}), 1)
    sim, running = drape.Sim(model), threading.Event()
    sim.observe(lambda event: running.set())
    outcome = []

    def forever():
        try:
            sim.advance(1e6)
        except drape.Stopped as error:
            outcome.append(error.status)

    thread = threading.Thread(target=forever)
    thread.start()
    running.wait()  # this thread runs while the other one advances
    sim.cancel()
    thread.join()
    equal(outcome, [drape.Status.E_STOPPED])


def test_reads_wait():
    """what reads a sim waits for another thread's advance, too; only cancel() does not"""
    sim, held, go_on = drape.Sim(sheet()), threading.Event(), threading.Event()

    def hold(_):
        held.set()
        go_on.wait()

    sim.observe(hold, KIND.FRAME)
    reads = {name: lambda name=name: getattr(sim, name) for name in ("time", "hash", "positions", "velocities", "masses", "pinned", "strain", "drag_force")}
    reads.update(attached=lambda: sim.attached(0), collider_points=lambda: sim.collider("ball"), force=lambda: sim.collider_force("ball"), repr=lambda: repr(sim))
    advancing = threading.Thread(target=sim.advance, args=(0.03,))
    advancing.start()
    held.wait()
    found = {}

    def read(name, function):
        found[name] = function()

    threads = [threading.Thread(target=read, args=item) for item in reads.items()]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(0.02)  # none returns meanwhile, however long one waits
    during = list(found)
    go_on.set()
    for thread in [advancing, *threads]:
        thread.join()
    equal((during, set(found)), ([], set(reads)))
    equal(found["time"], 0.03)


def test_misuse():
    """numbers of nodes do not wrap, and no number is cut; wrong types are Python's TypeError, everything else is a drape.Error"""
    sim = drape.Sim(sheet(pins=[]))
    for nodes in ([2**32], [2**32 + 5], np.array([2**63 + 3], np.uint64), [10**30], [-2**31 - 1], [1.5], ["a"]):
        raises(drape.ArgumentError, sim.pin, nodes, says="nodes: ")
        raises(drape.ArgumentError, sim.drag, nodes, [[0, 0, 0]], 1.0, says="nodes: ")
    assert not sim.pinned.any()
    for call in (lambda: sim.attached(2**32), lambda: sim.place(cloths=[2**40]), lambda: sim.attach("ball", [3], triangles=[0.5]),
                 lambda: sim.untangle(sweeps=2**32 + 3), lambda: drape.Sim(sheet(), threads=2**32 + 1), lambda: drape.Embedding(sim.model, [[0, 0, 0]], cloth=2**32),
                 lambda: drape.Mesh(np.eye(3), [[0, 1, 2**32 + 2]]), lambda: drape.Mesh(np.eye(3), [[0, 1, 1.5]]), lambda: sim.move_collider(2**32, [0, 0, 0], 1),
                 lambda: drape.Mesh.of({"vertices": np.eye(3), "faces": np.array([[0, 1, 2**32 + 2]])}), lambda: sim.push("a"), lambda: sim.push([[1, 2], [3]]),
                 lambda: sim.place(rotate=[1, 2]), lambda: sim.place(center=["a", 0, 0]), lambda: sim.set_masses([1], [10**400]), lambda: drape.Sim(sheet(), threads=1.5),
                 lambda: sim.move_collider(0.5, [0, 0, 0], 1), lambda: sim.untangle(sweeps=1.5), lambda: sim.attached(1.5)):
        raises(drape.ArgumentError, call)
    for call in (lambda: sim.advance("1"), lambda: sim.advance(None), lambda: sim.advance_realtime("1", 1), lambda: sim.set_state("a", sim.positions, sim.velocities),
                 lambda: sim.push(sim.positions * 1j), lambda: sim.restore(3), lambda: sim.restore_checkpoint("text"),
                 lambda: sim.move_collider(0, [0, 0, 0], "1"), lambda: sim.closest([[0, 0, 0]], within="far"), lambda: sim.set_wind("north"), lambda: sim.observe(3),
                 lambda: sim.add_event("name", 3), lambda: drape.Sim(3), lambda: drape.Sim([1]), lambda: drape.Sim(sheet(), integrator=3),
                 lambda: drape.Sim(sheet(), dt="a"), lambda: sim.model.collider("ball", "now"),
                 lambda: sim.model.check_derivatives(seed="a"), lambda: sim.untangle(sweeps="many")):
        raises(TypeError, call)
    for call in (lambda: drape.Mesh(np.eye(3), [[0, 1, 2]]).write("none/x.ply"), lambda: drape.Scene(sheet()).write("none/x.json"), lambda: sim.save("none/x")):
        raises(OSError, call)
    equal(sim.time, 0)
    sim.advance(0.02)


def test_messages():
    """what is refused is named, with what it has and what it needs; no mask of another length, no text with NUL, nothing converted before its shape is known"""
    sim = drape.Sim(sheet())
    for kind, says, call in (
            (TypeError, "dt: needs a number, has the text 'x'", lambda: drape.Sim(sheet(), dt="x")),
            (TypeError, "until: needs a number, has NoneType", lambda: sim.advance(None)),
            (TypeError, "seconds: needs a number", lambda: sim.move_pins([0], [[0, 0, 0]], "a")),
            (drape.ArgumentError, "masses: has shape (3,), needs 2, or one for all", lambda: sim.set_masses([5, 6], [1, 2, 3])),
            (drape.ArgumentError, "stiffness: has shape (3,), needs 2", lambda: sim.drag([5, 6], np.zeros((2, 3)), [1, 2, 3])),
            (drape.ArgumentError, "targets: has shape (1, 4), needs 1 x 3", lambda: sim.drag([5], [1, 2, 3, 4], 1)),
            (TypeError, "forces: needs numbers, has None", lambda: sim.push([[0, 0, None]] * 36)),
            (drape.ArgumentError, "positions: needs numbers, has the text '1'", lambda: drape.Mesh([["1", "2", "3"]], [])),
            (drape.ArgumentError, "the name of the file is empty", lambda: sim.save("")),
            (drape.ArgumentError, "the name of the file is empty", lambda: sim.restore("")),
            (drape.ArgumentError, "NUL", lambda: sim.save("nul\0x")),
            (drape.ArgumentError, "NUL", lambda: sim.save(b"nul\0x")),
            (drape.ArgumentError, "NUL", lambda: drape.Scene("a\0b")),
            (drape.ArgumentError, "NUL", lambda: drape.Sim(sheet(), integrator="be\0x")),
            (TypeError, "data: needs the bytes of a checkpoint, has str", lambda: sim.restore_checkpoint("text")),
            (drape.ArgumentError, "node: needs a whole number, has 1.5", lambda: sim.attached(1.5)),
            (drape.ArgumentError, "forces: has shape (1000000000, 3), needs 36 x 3", lambda: sim.push(np.broadcast_to(1., (10**9, 3))))):
        raises(kind, call, says=says)
    for mask in [True, False, True], [True] * 37, np.ones((6, 6), bool), True:
        raises(drape.ArgumentError, sim.pin, np.array(mask), says="nodes: a mask of shape")
    raises(drape.ArgumentError, sim.place, cloths=[True, False], says="cloths: a mask of shape (2,), needs 1")
    assert not os.path.exists("nul")
    sim.pin(np.arange(36) == 7)
    equal(np.flatnonzero(sim.pinned).tolist(), [0, 5, 7])


def test_bad_answers():
    """a wind, an event or a term that returns nothing, or a wind that is not finite, is what the message is about"""
    for kind, says, wind in ((TypeError, "the wind: the function returned None, needs 36 x 3 numbers", lambda t, x: None),
                             (drape.ArgumentError, "the wind: is [nan, 0.0, 0.0] at point 3, [", lambda t, x: np.where(np.arange(36)[:, None] == 3, [np.nan, 0, 0], 0)),
                             (drape.ArgumentError, "the gradient of the wind: is ", lambda t, x: (np.zeros(3), np.full((3, 3), np.inf))),
                             (drape.ArgumentError, "the wind: has shape (4,), needs 36 x 3, or one for all", lambda t, x: [1, 2, 3, 4])):
        sim = drape.Sim(sheet())
        sim.set_wind(wind)
        raises(kind, sim.advance, 0.1, says=says)
        sim.set_wind(lambda t, x: (1, 0, 0))  # a vector, not a wind and its gradient
        sim.advance(0.02)
    sim = drape.Sim(sheet())
    sim.add_event("mine", lambda *_: None)
    raises(TypeError, sim.advance, 0.1, says="what the function of an event returns: needs a number, has NoneType")
    for kind, says, energy in ((TypeError, "my.weight: the energy function returned NoneType", lambda x, rest: None),
                               (TypeError, "my.weight: gradients: needs numbers, has None", lambda x, rest: (0.0, None, np.zeros((3, 3)))),
                               (drape.ArgumentError, "my.weight: energies: has shape (3,), needs ", lambda x, rest: ([1, 2, 3], 0.0, 0.0))):
        model = drape.Model(sheet(terms=["my.weight"]), [drape.Term("my.weight", 1, lambda cloth: np.arange(36)[:, None], energy)])
        raises(kind, lambda model=model: drape.Sim(model).advance(0.1), says=says)
    attempts = []

    def grows(x, mass):  # not finite in the third attempt, as an energy may be in a state that a diverging iteration reaches
        bad = np.nan if len(attempts) == 2 else 1
        return mass[:, 0] * x[:, 0, 1] * bad, mass[:, :, None] * [0, bad, 0], np.zeros((3, 3))

    model = drape.Model(sheet(terms=["stretch.edge", "my.weight"]),
                        [drape.Term("my.weight", 1, lambda cloth: (np.arange(len(cloth.rest))[:, None], cloth.node_mass[:, None]), grows, external=True)])
    sim = drape.Sim(model)
    sim.observe(lambda event: attempts.append(event.attempt.accepted), KIND.ATTEMPT)
    sim.advance(0.1)
    equal((attempts[2], sim.time), (0, 0.1))


def test_callbacks_in_threads():
    """a wind and a term in Python are called from the threads of a sim, with the same result"""
    hashes = set()
    for threads in (1, 3):
        term = drape.Term("my.weight", 1, lambda cloth: (np.arange(len(cloth.rest))[:, None], cloth.node_mass[:, None]),
                          lambda x, mass: (mass[:, 0] * x[:, 0, 1], mass[:, :, None] * [0, 1, 0], np.zeros((3, 3))), external=True)
        sim = drape.Sim(drape.Model(sheet(terms=["stretch.edge", "drag.wind", "my.weight"]), terms=[term]), threads=threads)
        sim.set_wind(lambda t, x: np.sin(x + t))
        sim.advance(0.1)
        hashes.add(sim.hash)
    equal(len(hashes), 1)


def test_interrupt():
    """Ctrl-C ends an advance with KeyboardInterrupt; the sim goes on afterwards, and the handler is as before"""
    before, sim = signal.getsignal(signal.SIGINT), drape.Sim(sheet())
    sim.observe(lambda event: os.kill(os.getpid(), signal.SIGINT) if event.kind == KIND.ATTEMPT and event.attempt.index == 5 else None)
    raises(KeyboardInterrupt, sim.advance, 0.2)
    assert signal.getsignal(signal.SIGINT) is before and sim.time < 0.1
    sim.advance(0.2)
    straight = drape.Sim(sheet())
    straight.advance(0.2)
    equal(sim.hash, straight.hash)
    try:  # after a handler that does not raise, the advance goes on; in an advance within an observer, as well
        calls = []
        signal.signal(signal.SIGINT, lambda *given: calls.append(given))
        outer, inner = drape.Sim(sheet()), drape.Sim(sheet())
        outer.observe(lambda event: inner.advance(0.2) if event.kind == KIND.FRAME and event.frame == 2 else None)
        inner.observe(lambda event: os.kill(os.getpid(), signal.SIGINT) if event.kind == KIND.ATTEMPT and event.attempt.index == 5 else None)
        outer.advance(0.2)
        equal((outer.hash, inner.hash, len(calls)), (straight.hash, straight.hash, 1))
        signal.signal(signal.SIGINT, before)
        outer, inner = drape.Sim(sheet()), drape.Sim(sheet())
        inner.observe(lambda event: os.kill(os.getpid(), signal.SIGINT) if event.kind == KIND.ATTEMPT and event.attempt.index == 5 else None)
        outer.observe(lambda event: inner.advance(0.2))
        raises(KeyboardInterrupt, outer.advance, 0.2)
        assert inner.time < 0.1 and outer.time < 0.1 and signal.getsignal(signal.SIGINT) is before
    finally:
        signal.signal(signal.SIGINT, before)


def test_saving():
    """a checkpoint continues with the same bits, from a file and from bytes"""
    sim = moving()
    sim.save("checkpoint")
    data = sim.checkpoint()
    sim.advance(0.2)
    for restore, source in (("restore", "checkpoint"), ("restore_checkpoint", data), ("restore_checkpoint", bytearray(data)), ("restore_checkpoint", memoryview(data))):
        other = drape.Sim(sheet())
        getattr(other, restore)(source)
        equal(round(other.time, 9), 0.1)
        other.advance(0.2)
        equal(other.hash, sim.hash)
    raises(drape.ParseError, other.restore_checkpoint, data[:50])
    x, v = sim.positions.copy(), sim.velocities.copy()
    other = drape.Sim(sheet())
    other.set_state(0.2, x, v)
    assert np.array_equal(other.positions, x)


# ---- What a host does and reads

def test_reading():
    """energies, forces, statistics and queries have the shapes and the sums that they must have"""
    sim = drape.Sim(sheet(duration=2))
    sim.advance(1.0)
    energy, statistics = sim.energy, sim.statistics
    equal(list(sim.work)[:3], ["pins", "colliders", "host"])
    assert abs(sum(energy) - sum(drape.Sim(sheet(duration=2)).energy) - sum(sim.work.values())) < 1e-12 * abs(energy.gravity)
    assert energy.kinetic > 0 and energy.dissipated >= 0 and statistics.steps_accepted == 100 and sim.reasons == {}
    free = ~sim.pinned
    assert not sim.reactions[free].any() and sim.reactions[~free].any()
    equal([array.shape for array in (sim.normals, sim.contact_forces, sim.energy_density, sim.strain)], [(36, 3), (36, 3), (36,), (50, 2)])
    contacts = sim.contacts
    assert len(contacts) and np.allclose(contacts["force"].sum(0), -sim.collider_force("ball"), atol=1e-12)
    assert np.allclose(sim.contact_forces.sum(0), -sim.collider_force(0), atol=1e-9)
    hit = sim.closest([[0.25, -0.12, -0.25]], cloth=False)
    assert hit["found"][0] and abs(hit["distance"][0] + 0.1) < 1e-12 and hit["collider"][0] == 0
    ray = sim.cast([[0.25, 1, -0.25]], [0, -1, 0], colliders=False)
    assert ray["found"][0] and ray["triangle"][0] >= 0 and abs(ray["weights"][0].sum() - 1) < 1e-9
    equal((sim.inside("ball")[0], sim.intersections(), sim.relaxed, sim.seams, sim.events, sim.untangling), (0, 0, [], [], [], None))
    equal((sim.model.cloths[0].name, sim.model.collider("ball").type), ("sheet", "sphere"))
    raises(drape.ArgumentError, sim.collider, "cube", says="ball")
    report = sim.advance_realtime(1 / 60, 10)
    assert report.kept and report.level == "full" and report.attempts >= 1
    equal([w.name for w in drape.Sim(sheet(duration=0.02)).warnings], ["few_steps"])


def test_moving():
    """pins, masses, pushes, drags, colliders and placements do what they say"""
    sim = moving()
    sim.pin([35])
    here = sim.positions[35].copy()
    sim.move_pins(35, here + [0, 0.1, 0], 0.05)
    sim.advance(0.2)
    assert np.allclose(sim.positions[35], here + [0, 0.1, 0], atol=1e-12)
    sim.unpin([35])
    sim.set_masses([35], 0.25)
    equal(sim.masses[35], 0.25)
    sim.push(np.tile([0, 0.1, 0], (36, 1)))
    sim.push(None)
    sim.drag([10, 11], np.zeros((2, 3)), 5.0)
    assert np.allclose(sim.drag_force, -5 * sim.positions[[10, 11]].sum(0))
    sim.drag()
    sim.move_collider("ball", [0, -0.5, 0], 0.05, rotation=[1, 0, 0, 0])
    sim.advance(0.3)
    assert np.allclose(sim.collider("ball").displacement, [0, -0.5, 0])
    equal(sim.collider_rotation()[0].tolist(), [1, 0, 0, 0])
    sim.attach("ball", [5])
    equal((sim.attached(5), sim.attached(6)), (0, -1))
    sim.detach([5])
    x = sim.positions.copy()
    sim.place(translate=[1, 0, 0], rotate=[0, 1, 0, 90], stop=True)
    assert np.allclose(sim.positions, x @ np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]]) + [1, 0, 0], atol=1e-12) and not sim.velocities.any()
    sim.change(sheet(gravity=[0, 0, 0], colliders=[]))
    equal(sim.model.collider_count, 0)
    assert sim.untangle().clear


def test_deforming():
    """the points of a collider that deforms are sent and read"""
    corners = np.array([[0.1, -0.3, -0.4], [0.4, -0.3, -0.4], [0.25, -0.3, -0.1], [0.25, -0.15, -0.3]])
    drape.Mesh(corners, [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]]).write("body.obj")
    sim = drape.Sim(sheet(colliders=[{"type": "animated_mesh", "name": "body", "file": "body.obj"}], contact={"distance": 0.01}))
    sent = corners + [0, -0.1, 0]
    sim.deform_collider("body", sent, 0.1)
    sim.advance(0.05)
    x, v = sim.collider_points("body")
    assert np.allclose(x, (corners + sent) / 2) and np.allclose(v, [0, -1, 0])
    sim.advance(0.1)
    assert np.allclose(sim.collider_points("body")[0], sent, atol=1e-12)
    raises(drape.ArgumentError, sim.deform_collider, "body", sent[:3], 0.1)


def test_seams():
    """seams report what they join and carry"""
    scene = drape.Scene(sheet(colliders=[]))
    other = json.loads(json.dumps(scene["/cloth/0"]))
    other.update(name="other", pins=[])
    other["mesh"]["transform"] = {"translate": [0, 0, -0.55]}
    scene["/cloth/-"] = other
    scene["/seams"] = [{"type": "stitch", "closing": 0.05, "a": {"cloth": "sheet", "edge": "bottom"}, "b": {"cloth": "other", "edge": "top"}}]
    sim = drape.Sim(scene)
    sim.advance(0.1)
    (seam,) = sim.seams
    equal((seam.name, seam.type, seam.cloth, seam.pairs), ("seam0", "stitch", (0, 1), 6))
    assert seam.gap_max < 0.05 and seam.tension > 0
    equal([piece.name for piece in sim.model.cloths], ["sheet", "other"])
    equal(sim.model.mesh(1).triangles.min(), 0)


def test_wind():
    """a wind from Python is the wind of a term, and a gradient of zero is none"""
    wind = np.array([0.5, 1.0, -2.0])
    steady = sheet(terms=["stretch.edge", {"type": "drag.wind", "wind": wind.tolist()}])
    scenes = (steady, None), (sheet(terms=["stretch.edge", "drag.wind"]), wind), (sheet(terms=["stretch.edge", "drag.wind"]), (np.tile(wind, (36, 1)), np.zeros((3, 3))))
    states = []
    for scene, air in scenes:
        sim = drape.Sim(scene)
        if air is not None:
            sim.set_wind(lambda t, x, air=air: air)
        sim.advance(0.1)
        states.append(sim.positions)
    assert np.array_equal(states[1], states[2])
    assert abs(states[0] - states[1]).max() < 1e-14  # the two winds are added in another order: some roundings of numbers below 1, over ten steps


def test_events():
    """events of the scene and of Python are located, and stop a run"""
    scene = drape.Scene(sheet())
    scene["/events"] = [{"type": "height", "of": "lowest", "height": -0.02, "name": "low", "action": "stop"}]
    sim = drape.Sim(scene)
    sim.add_event("mine", lambda t, x, v: x[:, 1].min() + 0.01)
    seen = []
    sim.observe(lambda event: seen.append(event.name), KIND.ROOT)
    record = sim.advance(0.2)
    equal((record.name, seen), ("low", ["mine", "low"]))
    assert abs(sim.positions[:, 1].min() + 0.02) < 1e-9 and sim.time == record.last
    assert sim.events[1].name == "mine" and sim.events[1].count == 1 and sim.events[1].first < record.first
    equal(sim.advance(0.2), None)


def test_embedding():
    """a render mesh is carried by the cloth"""
    model = drape.Model(sheet())
    vertices = model.rest_positions.astype(np.float32)
    embedding = drape.Embedding(model, vertices, model.normals(model.rest_positions))
    sim = drape.Sim(model)
    sim.advance(0.1)
    x, normals = embedding.carry(sim.positions)
    assert np.allclose(x, sim.positions, atol=1e-6) and np.allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
    assert all(result.pass_ for result in model.check_derivatives())


def test_terms():
    """an energy in Python moves the cloth as the same energy of the library does; its derivatives are checked; its exceptions come out"""
    def springs(cloth):
        a, b = cloth.rest[cloth.edges[:, 0]], cloth.rest[cloth.edges[:, 1]]
        return cloth.edges, np.linalg.norm(b - a, axis=1)[:, None]

    def energy(x, rest):  # k/2 (l - L)^2 of every edge
        k, d = 20.0, x[:, 1] - x[:, 0]
        length = np.linalg.norm(d, axis=1)
        u, s = d / length[:, None], length - rest[:, 0]
        outer = u[:, :, None] * u[:, None, :]
        block = k * (outer + (s / length)[:, None, None] * (np.eye(3) - outer))
        force = (k * s)[:, None] * u
        return k / 2 * s * s, np.stack([-force, force], 1), np.block([[block, -block], [-block, block]])

    scene = sheet(terms=["my.springs"])
    model = drape.Model(scene, terms=[drape.Term("my.springs", 2, springs, energy, element_name="edge")])
    results = model.check_derivatives()
    assert len(results) >= 2 and all(result.pass_ for result in results), results
    sim, same = drape.Sim(model), drape.Sim(sheet(terms=[{"type": "spring.structural", "stiffness": 20.0}], mesh=model.mesh(0), pins=[{"nodes": [0, 5]}]))
    sim.advance(0.1)
    same.advance(0.1)
    # Both solve each step to a residual of some 1e-6 N, for nodes of 1e-3 kg: 1e-6 * h^2 / m = 1e-7 m a step, 10 steps.
    assert abs(sim.positions - same.positions).max() < 1e-5, abs(sim.positions - same.positions).max()

    class Mine(Exception):
        pass

    def fail(*_):
        raise Mine("from a term")

    raises(Mine, drape.Model, scene, terms=[drape.Term("my.springs", 2, fail, energy)])
    raises(drape.ArgumentError, drape.Model, scene, terms=[drape.Term("my.springs", 2, lambda cloth: cloth.triangles, energy)], says="n x 2")
    broken = drape.Term("my.springs", 2, springs, energy)
    sim = drape.Sim(drape.Model(scene, terms=[broken]))
    sim.advance(0.05)
    broken.energy = fail
    raises(Mine, sim.advance, 0.1)
    broken.energy = energy
    sim.advance(0.1)


if __name__ == "__main__":
    sys.exit(run_tests(globals()))
