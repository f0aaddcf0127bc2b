#!/usr/bin/env python3
"""test_runs.py: finished runs, the verbs of the program, plots, and the examples. See package.py."""
import glob
import os
import shutil
import signal
import subprocess
import sys

from package import ENVIRONMENT, SOURCES, Skip, equal, raises, run_tests, sheet
import drape  # after package, which says where it is
import numpy as np


def columns(table):
    return {name: np.asarray(table[name]) for name in table.keys()}


def need(module):
    try:
        return __import__(module)
    except ImportError:
        raise Skip(f"no {module}") from None


def test_runs():
    """a run in memory has the bits, frames and tables of one by the program; saved and loaded, it is the same"""
    scene = drape.Scene(sheet())
    inside, outside = drape.run(scene), drape.run(scene, out="run")
    equal(inside.summary["hash"], outside.summary["hash"])
    assert isinstance(outside.positions, np.memmap) and np.array_equal(inside.positions, outside.positions)
    for name, column in columns(inside.energy).items():
        assert np.array_equal(column, columns(outside.energy)[name]), name
    for name, column in columns(inside.steps).items():
        other = columns(outside.steps)[name]
        assert np.array_equal(column, other, equal_nan=column.dtype.kind == "f"), name
    for key in ("status", "nodes", "dofs", "nnz", "frames", "time", "energy", "strain", "newton", "steps"):
        equal(inside.summary[key], outside.summary[key], key)
    again = drape.load(inside.save("saved").folder)
    for one, other in ((inside.energy, again.energy), (inside.steps, again.steps)):
        for name, column in columns(one).items():
            assert np.array_equal(column, columns(other)[name], equal_nan=column.dtype.kind == "f"), name
    assert np.array_equal(again.times, inside.times) and again.mesh(3).positions.shape == (36, 3)
    equal(drape.Model(again.scene).node_count, 36)


def test_accuracy():
    """a run by accuracy is made by the program, as an option or by the scene, and says what it reached"""
    for run in (drape.run(sheet(integrator={}), accuracy="5cm"), drape.run(sheet(accuracy="5cm"))):
        reached = run.summary["accuracy_of"]
        assert reached["runs"] >= 2 and 0 < reached["distance"] < 0.05, reached
        equal((run.summary["status"], len(run.positions)), ("ok", len(run.times)))
    raises(drape.ArgumentError, drape.run, sheet(accuracy="1 inch"), says="/accuracy")


def test_failures():
    """a run that fails has the status and the message; what the program refuses is an argument error"""
    stops = sheet(controller={"type": "fixed"}, integrator={"dt": 0.01, "max_iterations": 1, "tolerance": 1e-12})
    for call in (lambda: drape.run(stops, out="run"), lambda: drape.run(stops), lambda: drape.Sim(stops).record(), lambda: drape.Sim(stops).view()):
        run = raises(drape.SolverError, call, says="t=0").run
        equal((run.summary["status"], "t=0" in run.summary["message"], run.positions.shape), ("e_solver", True, (1, 36, 3)))
        assert not any(columns(run.steps)["accepted"])
    raises(drape.ArgumentError, drape.run, sheet(), {"/integrator/dt": -1}, out="other", says="/integrator/dt: -1 is not allowed")
    raises(drape.FileError, drape.load, "nowhere", says="scene.json")
    equal(os.path.exists("other"), False)
    raises(TypeError, drape.run, sheet(), "other", says="out=")
    open("a_file", "w", encoding="utf-8").close()
    raises(drape.FileError, drape.run, sheet(), out="a_file", says="a_file")
    raises(drape.FileError, drape.run(sheet(duration=0.02)).report, "none/x.html", says="none/x.html")


def test_special_files():
    """a pipe or a device in the folder of a run is refused: reading it might never end"""
    frames = len(drape.run(sheet(), out="special").times)
    for name in "scene.json", "energy.csv", "steps.csv", "positions.npy", "summary.json":
        os.rename("special/" + name, "aside")
        for make in os.mkfifo, lambda path: os.symlink("/dev/zero", path):
            make("special/" + name)
            raises(drape.FileError, drape.load, "special", says="scene.json" if name == "scene.json" else "not a regular file")
            os.remove("special/" + name)
        os.rename("aside", "special/" + name)
    equal(len(drape.load("special").times), frames)


def test_stopped():
    """what ends a recording, an observer that stops or raises or Ctrl-C, comes out of it with the run up to there, which is the beginning of the whole one"""
    whole = drape.run(sheet())

    def ends(how):
        sim = drape.Sim(sheet())
        sim.observe(lambda event: how() if event.kind == drape.EventKind.FRAME and event.frame == 3 else None)
        return sim.record

    def fail():
        raise ZeroDivisionError

    for kind, how, message in ((drape.Stopped, lambda: True, "asked to stop"), (ZeroDivisionError, fail, "ZeroDivisionError"),
                               (KeyboardInterrupt, lambda: os.kill(os.getpid(), signal.SIGINT), "KeyboardInterrupt")):
        run = raises(kind, ends(how)).run
        equal((run.summary["status"], message in run.summary["message"]), ("e_stopped", True))
        count = len(run.times)
        assert count in (3, 4) and np.array_equal(run.positions, whole.positions[:count]) and len(columns(run.steps)["t"]) < len(columns(whole.steps)["t"])
    equal(raises(drape.ArgumentError, drape.Sim, {"drape": 1}).run, None)


def test_moved():
    """the folder of a saved run has its meshes, and can be moved; so can one that was loaded and saved again"""
    os.mkdir("meshes")
    drape.Model(sheet()).mesh(0).write("meshes/cloth.ply")
    x = np.array([[0.1, -0.3, -0.4], [0.4, -0.3, -0.4], [0.25, -0.3, -0.1], [0.25, -0.15, -0.3]])
    body = drape.Mesh(x, [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    scene = drape.Scene(sheet(mesh={"file": "meshes/cloth.ply"}, pins=[{"nodes": [0]}], colliders=[{"type": "mesh", "file": "meshes/body.obj"}], duration=0.02))
    body.write("meshes/body.obj")
    drape.run(scene).save("first")
    drape.run(drape.Scene(sheet(mesh=drape.Model(sheet()).mesh(0), pins=[{"nodes": [0]}], duration=0.02))).save("second")
    os.rename("first", "moved")
    os.rename("second", "there")
    shutil.rmtree("meshes")
    drape.load("moved").save("again")
    os.rename("moved", "elsewhere")
    for folder in "elsewhere", "there", "again":
        run = drape.load(folder)
        assert np.array_equal(run.mesh(-1).positions, run.positions[-1])
        assert "<html" in run.report().text
    equal(sorted(name for name in os.listdir("again") if name.startswith("scene")), ["scene.json", "scene_file_0.ply", "scene_file_1.obj"])


def test_changes():
    """values, meshes and options reach the program, and the scene of the caller stays as it is"""
    mesh = drape.Model(sheet()).mesh(0)
    scene = drape.Scene(sheet(mesh=mesh, pins=[{"nodes": [0]}]))
    run = drape.run(scene, {"/duration": 0.05, "/gravity": np.zeros(3)}, out="run", format=["npy", "obj"], frame_rate=100)
    equal((len(run.times), scene["/duration"], run.summary["nodes"]), (6, 0.2, 36))
    assert np.ptp(run.positions, axis=0).max() < 1e-12 and len(glob.glob("run/*.obj")) > 5
    equal(drape.load("run").model.node_count, 36)
    said = str(raises(drape.ArgumentError, drape.run, sheet(), {"/integrator/dt": -1}, says="/integrator/dt: -1"))
    assert "drape-" not in said, said
    scene.write("own.json")
    scene = drape.Scene("own.json")
    scene["/duration"] = -1
    said = str(raises(drape.ArgumentError, drape.info, scene, says="own.json: /duration"))
    assert "drape-" not in said, said


def test_render_mesh():
    """frames of a cloth with a render mesh: at rest where it was given, in a run as the program writes them, in a saved run as computed"""
    fine = drape.Model(sheet()).mesh(0)
    scene = drape.Scene(sheet())
    scene["/cloth/0/render_mesh"] = drape.Mesh(fine.positions + [0, 0.01, 0], fine.triangles, max_distance=0.02)
    model = drape.Model(scene)
    assert np.allclose(model.render_mesh(0).positions, fine.positions + [0, 0.01, 0], rtol=0, atol=1e-15)
    assert np.array_equal(model.render_mesh().triangles, fine.triangles)
    run = drape.run(scene, {"/duration": 0.05}, out="run")
    plain = drape.run(sheet(), {"/duration": 0.05}, out="plain")
    equal(run.summary["hash"], plain.summary["hash"])
    shown = run.render_mesh(2)
    assert np.array_equal(shown.positions, model.render_positions(run.positions[2])) and np.array_equal(shown.triangles, fine.triangles)
    assert np.array_equal(shown.positions, model.render_mesh(0, run.positions[2]).positions)
    assert 0.009 < np.linalg.norm(shown.positions - run.positions[2], axis=1).min() < 0.0101
    assert np.array_equal(plain.render_positions(2), plain.positions[2]) and not os.path.exists("plain/render_positions.npy")
    assert np.array_equal(drape.Sim(scene).record(0.05).render_positions(1), run.render_positions(1))
    for cloth in (1, -2, 10**20):
        raises(drape.ArgumentError, model.render_mesh, cloth, says="no cloth")
        raises(drape.ArgumentError, model.render_positions, model.rest_positions, cloth, says="no cloth")
    napkin = drape.Model(os.path.join(SOURCES, "examples/scenes/napkin.json"))  # of another size: its arrays lie elsewhere
    at_rest = napkin.render_positions(np.array(napkin.rest_positions))
    assert np.abs(at_rest - napkin.render_mesh().positions).max() < 1e-15  # sums of three products of numbers below 1
    scene["/cloth/0/render_mesh/max_distance"] = 0.005
    raises(drape.Error, drape.Model, scene, says="vertex 0, at (")


def test_report():
    """the report of a run is a page that notebooks show"""
    page = drape.Sim(sheet()).view(0.1)
    assert "<html" in page.text and page._repr_html_().startswith("<iframe srcdoc=")
    page.write("page.html")
    run = drape.run(sheet(), out="run")
    equal(run.report("other.html").path, os.path.abspath("other.html"))
    equal(sorted(glob.glob("run/*.html")), [])


def test_lab():
    """the experiments give the tables that they write"""
    if "tradeoff" not in subprocess.run([os.environ["DRAPE_PROGRAM"], "help"], capture_output=True, text=True, check=True).stdout:
        raise Skip("no experiments in this build")
    scene = sheet(colliders=[], duration=0.05)
    maps = columns(drape.stability(scene, {"/integrator/dt": (1e-3, 1e-2, "2log")}, integrators=["be", "verlet"], out="maps"))
    equal((len(maps["status"]), sorted(set(maps["integrator"])), set(maps["status"]) >= {"ok"}), (4, ["be", "verlet"], True))
    assert os.path.exists("maps/report.html")
    orders = columns(drape.converge(scene, integrators=["be"], levels=3))
    equal(orders["value"].tolist(), sorted(orders["value"], reverse=True))
    work = columns(drape.tradeoff(drape.Scene(scene), integrators=["be"], budget=0.1, set={"/duration": 0.02}))
    assert len(work["case"]) and work["reference_error"].dtype.kind == "f"
    cases = columns(drape.validate("oscillator"))
    equal(set(cases["verdict"]), {"pass"})
    assert np.all(abs(cases["error"]) < cases["tolerance"])
    raises(drape.ArgumentError, drape.stability, scene, {"/integrator/dt": "1:2"})
    equal(drape.info(scene)["nodes"], 36)
    assert "properties" in drape.schema()


def test_modes():
    """frequencies and paths of equilibria are tables"""
    verbs = subprocess.run([os.environ["DRAPE_PROGRAM"], "help"], capture_output=True, text=True, check=True).stdout
    if "  modes " not in verbs:
        raise Skip("no modes in this build")
    strip = sheet(mesh={"grid": "irregular", "columns": 21, "rows": 3, "width": 1, "height": 0.04}, pins=[{"edge": "left", "clamp": True}], colliders=[], gravity=[0, 0, 0],
                  material={"young_modulus": 1200, "poisson_ratio": 0, "thickness": 0.01, "areal_density": 0.1},
                  terms=["stretch.cst", "bend.midedge", {"type": "load.line", "edge": "right", "force": [-2.4674e-4, 0, 0]}], integrator={"method": "static"})
    found = columns(drape.modes(strip, count=3, state="start"))
    assert found["kind"].tolist() == ["vibration"] * 3 and np.all(np.diff(found["frequency"]) > 0)
    loads = columns(drape.modes(strip, count=1, state="start", buckling=True))
    assert abs(loads["value"][0] - 1) < 0.01  # Euler's load by the choice of the force; the mesh has 21 columns
    points = columns(drape.path(strip, to=0.5, nodes=[20], out="path"))
    assert points["factor"][-1] == 0.5 and "u20_x" in points and os.path.exists("path/path.csv")


def test_plots():
    """plots are drawn of runs, sims, meshes and tables"""
    need("matplotlib").use("agg")
    run = drape.run(sheet())
    ax = drape.plot.energy(run)
    assert np.array_equal(ax.lines[0].get_ydata(), columns(run.energy)["kinetic"]) and "[J]" in ax.get_ylabel()
    drape.plot.energy(run.energy, ["kinetic"], ax=ax)
    assert np.array_equal(drape.plot.energy(run.energy, "elastic").lines[0].get_ydata(), columns(run.energy)["elastic"])
    raises(TypeError, drape.plot.cloth, run.scene, says="has Scene")
    drape.plot.steps(run)
    sim = drape.Sim(sheet())
    for what in (run, sim, run.mesh(0)):
        drape.plot.cloth(what)
    drape.plot.cloth(sim, values=sim.strain[:, 0], label="strain [1]").figure.savefig("cloth.png")
    table = {"integrator": np.array(["be", "be", "verlet"]), "/integrator/dt": np.array([1e-3, 1e-2, 1e-2]), "E": np.array([1e4, 1e5, 1e5]),
             "status": np.array(["ok", "ok", "exploded"]), "rejected": np.array([0, 3, 0]), "error": np.array([1e-3, 1e-2, 1e-1])}
    drape.plot.stability(table, "/integrator/dt")
    drape.plot.stability(table, "/integrator/dt", "E", "verlet")
    drape.plot.converge(table, "/integrator/dt", "error").figure.savefig("orders.png")


def test_tables():
    """tables are data frames where pandas is installed"""
    pandas = need("pandas")
    run = drape.run(sheet())
    assert isinstance(run.energy, pandas.DataFrame) and abs(run.energy.total.iloc[0]) < 1


def test_examples():
    """each example runs, and prints what its comments promise"""
    programs = sorted(glob.glob(SOURCES + "/examples/python/*.py"))
    assert len(programs) >= 4
    skipped = []
    for program in programs:
        text = open(program, encoding="utf-8").read()
        if "drape.plot" in text or "matplotlib" in text:
            try:
                need("matplotlib")
            except Skip as reason:
                skipped.append(f"{os.path.basename(program)}: {reason}")
                continue
        shutil.copy(program, ".")
        result = subprocess.run([sys.executable, "-W", "error::DeprecationWarning:__main__", os.path.basename(program)], env=ENVIRONMENT, capture_output=True, text=True, check=False)
        equal(result.returncode, 0, program + ": " + result.stderr)
        for line in [line[len("# prints: "):] for line in text.splitlines() if line.startswith("# prints: ")]:
            assert line in result.stdout, f"{program}: {line!r} is not in {result.stdout!r}"
    if skipped:
        raise Skip("; ".join(skipped))


if __name__ == "__main__":
    sys.exit(run_tests(globals()))
