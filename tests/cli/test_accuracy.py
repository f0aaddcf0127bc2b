#!/usr/bin/env python3
"""`drape run --accuracy`: what a run says of itself, against a fine one. See program.py."""
import json

from program import drape, equal, good, read_json, read_npy, refused, run_tests, scene, text_of, write_json


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


if __name__ == "__main__":
    raise SystemExit(run_tests(globals()))
