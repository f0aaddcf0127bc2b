#!/usr/bin/env python3
"""`drape run --accuracy`: what a run says of itself, against a fine one. See program.py."""
import json

from program import drape, equal, good, read_json, read_npy, refused, run_tests, scene, text_of, write_json, write_text


def write_scene():
    write_json("scene.json", scene(mesh={"grid": "square", "columns": 6, "rows": 6, "width": 0.3, "height": 0.4}, duration=0.25, frame_rate=60))


def test_results():
    """the last of several runs fills the folder, is as near to a fine run as was asked, and says how near"""
    write_scene()
    good("run", "scene.json", "--out", "fine", "--integrator", "radau", "--set", "/integrator/rtol=1e-7", "--format", "npy")
    for text in ("2mm", "4e-3"):  # of a diagonal of 0.5 m
        printed = good("run", "scene.json", "--accuracy", text, "--out", "run", "--format", "npy")
        summary = read_json("run/summary.json")
        of = summary["accuracy_of"]
        assert 0 < summary["accuracy"] <= 4e-3 and of["reached"] and of["until"] == 0.25 and of["runs"] > 1, summary
        assert abs(of["distance"] - 0.5 * summary["accuracy"]) < 1e-12 and of["distance"] <= of["worst"]
        assert summary["wall_s"]["steps"] > of["earlier_runs_s"] > 0
        assert f"accuracy  {of['method']}, the last of {of['runs']} runs: " in printed, printed
        equal(read_npy("run/positions.npy")[0], (16, 36, 3))
        equal(read_json("run/scene.json")["accuracy"], text if text == "2mm" else 4e-3)
        good("compare", "run", "fine", "--within", text)
        steps = text_of("run/steps.csv").splitlines()
        equal(len(steps) - 1, summary["steps"]["accepted"] + summary["steps"]["rejected"])


def test_refusals():
    """what is no accuracy, or cannot be reached, is one line"""
    write_scene()
    for text in ("1 inch", "0", "-1mm", "1", "nan", "1e-2x"):
        refused("run", "scene.json", "--accuracy", text, says="/accuracy")
    refused("run", "scene.json", "--accuracy", "1e-12", says="below what double precision gives")
    refused("run", "scene.json", "--accuracy", "1mm", "--integrator", "verlet", says="\"verlet\" does not converge")
    for option in (("--dt", "1e-3"), ("--integrator", "be"), ("--set", "/controller/type=fixed")):
        refused("run", "scene.json", "--accuracy", "1mm", *option, says="leave it out")
    for option in (("--realtime",), ("--out", "run", "--resume"), ("--out", "run", "--checkpoint-every", "2")):
        refused("run", "scene.json", "--accuracy", "1mm", *option, says="is run several times")


def test_schema():
    """the schema takes what a scene may say, a number or a text"""
    key = json.loads(good("list", "--schema"))["properties"]["accuracy"]
    equal(sorted(form["type"] for form in key["anyOf"]), ["number", "string"])


def test_default():
    """a scene that says nothing of its integrator is run by the method for what it has; one setting, and it is backward Euler, as ever"""
    ball = {"type": "sphere", "center": [0, -9, 0], "radius": 0.1}
    for more, method, dt in (({}, "bdf2", "0.0167"), ({"colliders": [ball]}, "newton_k", "0.00833"), ({"self_contact": {"thickness": 0.001}}, "newton_k", "0.00833")):
        whole = scene(duration=0.05, **more)
        del whole["integrator"]
        write_json("default.json", whole)
        printed = good("run", "default.json", "--out", "default")
        assert f"method    {method}, dt {dt} s: the default with{'' if more else 'out'} contact" in printed, printed
        good("run", "default/scene.json", "--out", "again")
        equal(read_json("again/summary.json")["hash"], read_json("default/summary.json")["hash"])
        assert "\nmethod    be, dt 0.01 s\n" in good("run", "default.json", "--dt", "0.01")
        assert "\nmethod    midpoint, dt 0.0167 s\n" in good("run", "default.json", "--integrator", "midpoint")


def test_interrupted_by_a_full_disk():
    """a run that fails leaves one line and no claim"""
    write_scene()
    result = drape("run", "scene.json", "--accuracy", "1mm", "--summary", "/dev/full")
    equal(result.returncode, 1)


def within_two(estimate, true):
    """Within a factor of 2: sqrt(2) times the distance, for any order from 0.63 on (accuracy/assess.h)."""
    assert true / 2 < estimate < 2 * true, (estimate, true)


def furthest(first, second):
    return max(frame["share"] for frame in json.loads(good("compare", first, second, "--json"))["cloth"][0]["frames"])


def test_verdict():
    """errors in time and by the mesh are within a factor of 2 of those beside fine runs; the report shows the lines, of this run only"""
    write_scene()
    good("run", "scene.json", "--out", "run")
    good("run", "scene.json", "--out", "fine", "--dt", "0.0005")
    good("run", "scene.json", "--out", "finer_mesh", "--set", "/cloth/0/mesh/subdivide=3")
    of = json.loads(good("accuracy", "scene.json", "--json"))
    within_two(of["time"]["error"], furthest("run", "fine"))
    within_two(of["mesh"]["error"], furthest("run", "finer_mesh"))
    assert of["start"]["error"] < 1e-3 and of["predictable_until"] == 0.25, of
    for line in (of["time"], of["mesh"], of["start"]):
        assert line["reached"] and line["until"] == 0.25 and line["error"] * 0.5 - line["distance"] < 1e-12 <= line["worst"], line
    equal(of["hash"], read_json("run/summary.json")["hash"])
    text = good("accuracy", "scene.json")
    assert text.startswith("cost  four runs, at most 12 times the CPU time of the first"), text
    equal([line.split()[0] for line in text.splitlines()], ["cost", "cost", "time", "mesh", "start", "cost"])
    write_json("run/accuracy.json", of)
    good("report", "run")
    assert of["mesh"]["text"].replace("<", "\\u003c") in text_of("run/report.html")


def test_verdict_of_any_mesh():
    """a mesh from a file with a hole, and a scene that asks for an accuracy, whose method is the one that reaches it"""
    ring = "".join(f"v {x} 0 {z}\n" for x, z in ((0, 0), (3, 0), (3, 3), (0, 3), (1, 1), (2, 1), (2, 2), (1, 2)))
    write_text("ring.obj", ring + "".join(f"f {a} {b} {c}\n" for a, b, c in ((1, 5, 2), (2, 5, 6), (2, 6, 3), (3, 6, 7), (3, 7, 4), (4, 7, 8), (4, 8, 1), (1, 8, 5))))
    write_json("scene.json", scene(mesh={"file": "ring.obj", "transform": {"scale": 0.1}}, pins=[{"nodes": [0, 1]}], integrator={}, accuracy="2%", duration=0.2))
    of = json.loads(good("accuracy", "scene.json", "--json"))
    assert of["within"] == 0.02 and of["time"]["error"] < 0.02 < of["mesh"]["error"] and not of["method"].startswith("be"), of


def test_no_verdict():
    """what has no verdict is one line; a run that fails on the finer mesh leaves the other lines, and exit code 1"""
    write_scene()
    for method in ("verlet", "static"):
        refused("accuracy", "scene.json", "--integrator", method, says="does not converge to the motion")
    write_json("stops.json", scene(events=[{"type": "height", "height": -0.1, "action": "stop"}]))
    refused("accuracy", "stops.json", says="no common end")
    write_json("springs.json", scene(mesh={"grid": "square", "columns": 3, "rows": 3, "width": 1, "height": 1}, terms=[{"type": "spring.structural", "stiffness": 100}]))
    refused("accuracy", "springs.json", says="is not to be subdivided")
    result = drape("accuracy", "scene.json", "--duration", "0.01")
    equal((result.returncode, result.stdout.count("not known: no frame but the start")), (1, 3))
    write_json("fails.json", scene(mesh={"grid": "square", "columns": 7, "rows": 7, "width": 0.3, "height": 0.3}, pins=[{"edge": "top"}], terms=["stretch.cst", "bend.midedge"],
                                   material={"fabric": "wang2011_tablecloth"}, controller={"type": "fixed"}, integrator={"max_iterations": 3}, duration=0.3))
    result = drape("accuracy", "fails.json", "--json")
    equal((result.returncode, result.stderr.count("accuracy:")), (1, 0))
    of = json.loads(result.stdout)
    assert of["time"]["reached"] and not of["mesh"]["reached"] and of["mesh"]["error"] is None and "max_iterations" in of["mesh"]["text"], of
    result = drape("accuracy", "fails.json", "--set", "/integrator/max_iterations=1")
    equal((result.returncode, "\ntime" in result.stdout, result.stderr.count("max_iterations")), (1, False, 1))


if __name__ == "__main__":
    raise SystemExit(run_tests(globals()))
