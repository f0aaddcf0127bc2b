#!/usr/bin/env python3
"""The test set of initial value problems: drape ivp. See program.py."""
import csv
import json
import math
import os
import shutil
import struct
import subprocess
import sys

from figure import Figure
from program import SOURCES, drape, equal, good, read_json, read_npy, refused, run_tests, write_scene, write_text

SET = SOURCES + "/examples/ivp"


def take_set(*names):
    """Copies scenes with what belongs to them."""
    for folder in ("set", "set/references", "set/horizons"):
        os.makedirs(folder, exist_ok=True)
    for name in names:
        shutil.copy(f"{SET}/{name}.json", "set")
        for kind, ending in (("references", "json"), ("references", "npy"), ("horizons", "json")):
            shutil.copy(f"{SET}/{kind}/{name}.{ending}", f"set/{kind}")


def scores(*args):
    """{"error_end": ...} of what score printed, and its rows."""
    lines = good("ivp", "score", *args).splitlines()
    values = {line.split()[0]: float(line.split()[1]) for line in lines if line.startswith(("error_", "mescd", "reference"))}
    return values, [[float(cell) for cell in line.split(",")] for line in lines[1:] if "," in line]


def write_npy(path, shape, numbers, kind="<f8", fortran=False, version=1):
    head = f"{{'descr': '{kind}', 'fortran_order': {fortran}, 'shape': {shape}, }}".ljust(117 if version == 1 else 115) + "\n"
    with open(path, "wb") as file:
        file.write(b"\x93NUMPY" + bytes((version, 0)) + struct.pack("<H" if version == 1 else "<I", len(head)) + head.encode())
        file.write(struct.pack(f"<{len(numbers)}{'f' if kind == '<f4' else 'd'}", *numbers))


def test_every_scene_has_its_reference():
    """every scene of the set has a reference that is its own, as accurate as promised, and a horizon beyond its duration"""
    scenes = sorted(name for name in os.listdir(SET) if name.endswith(".json"))
    assert len(scenes) >= 8, scenes
    for name in scenes:
        stem = name[:-5]
        values, rows = scores(f"{SET}/{name}", f"{SET}/references/{stem}.npy")
        equal([row[1] for row in rows] + [values["error_max"]], [0] * (len(rows) + 1), name)
        contact = "colliders" in open(f"{SET}/{name}", encoding="utf-8").read()
        assert values["reference_error"] <= (1e-5 if contact else 1e-8), (name, values)
        horizon = read_json(f"{SET}/horizons/{stem}.json")
        assert horizon["horizon_s"] is None or horizon["horizon_s"] >= rows[-1][0], name
        equal(horizon["scene_hash"], read_json(f"{SET}/references/{stem}.json")["scene_hash"], name)


def test_independent():
    """a program that shares no code with Drape, from the export of the first scene, is within 1e-8 of the size"""
    good("ivp", "export", SET + "/swing.json", "--out", "ex")
    subprocess.run([sys.executable, SET + "/check.py", "ex"], check=True, timeout=200)
    values, rows = scores(SET + "/swing.json", "ex/positions.npy")
    assert values["error_max"] < 1e-8 and values["mescd"] > 8, values
    # What was exported is what the reference began with: the start is the frame before its first.
    shape, _ = read_npy("ex/reference.npy")
    with open("ex/nodes.csv", encoding="utf-8") as file:
        nodes = list(csv.DictReader(file))
    equal((len(nodes), len(rows)), (shape[1], shape[0]), "nodes and times")
    equal(sum(row["pinned"] == "1" for row in nodes), 2, "pinned nodes")


def test_run_and_score():
    """a run of be has the error in results.csv that score gives its frames; orders are those of the methods"""
    take_set("swing")
    out = good("ivp", "run", "set/swing.json", "--integrators", "be,trbdf2", "--repeats", "1", "--out", "r")
    cases = read_json("r/experiment.json")["cases"]
    with open("r/results.csv", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["series"] == "be"]
    row = sorted(rows, key=lambda one: float(one["value"]))[-3]
    settings = cases[int(row["case"])]["settings"]
    changes = [word for key, value in settings.items() for word in ("--set", f"{key}={json.dumps(value)}")]
    good("run", "set/swing.json", *changes, "--out", "be")
    values, _ = scores("set/swing.json", "be/positions.npy")
    for key in ("error_end", "error_max", "mescd"):
        found = float(row[key])
        assert abs(values[key] / found - 1) < 1e-3, (key, values[key], found)  # score prints four digits and more
    # Newton's remainder follows the error: it falls with dt at least as fast as it.
    tolerances = {float(one["value"]): cases[int(one["case"])]["settings"]["/integrator/tolerance"] for one in rows}
    assert all(tolerances[dt] < tolerances[2 * dt] for dt in tolerances if 2 * dt in tolerances), tolerances
    orders = [line.split("|")[2:4] for line in out.splitlines() if line.startswith("| swing") and line.count("|") == 7]
    orders = {name.strip(): float(order) for name, order in orders if name.strip() in ("be", "trbdf2") and "." in order}
    assert abs(orders["be"] - 1) < 0.1 and abs(orders["trbdf2"] - 2) < 0.1, orders
    assert "report" in out and os.path.exists("r/tables.md"), out
    # The diagram of the energy has the drift of each run, those of runs that gained energy as open markers.
    with open("r/results.csv", encoding="utf-8") as file:
        drifts = [float(row["energy_drift"]) for row in csv.DictReader(file)]
    figure = Figure("r/swing_energy.svg")
    left, top, right, bottom = figure.frame()
    points = sorted(y for x, y, _, _ in figure.markers if left < x < right and top < y < bottom)
    equal(len(points), len(drifts), "points")
    wanted = sorted((math.log(abs(d)) for d in drifts), reverse=True)
    for y, drift in zip(points, wanted):
        along = (y - points[0]) / (points[-1] - points[0])
        assert abs(wanted[0] + along * (wanted[-1] - wanted[0]) - drift) < 0.02, (points, wanted)
    equal(figure.has("gained"), min(drifts) < 0, "an entry for gains")


def test_shards():
    """two shards, merged, have the cases and the table of scenes of one run; two scenes in one sweep"""
    take_set("swing", "slope")
    args = ["ivp", "run", "set/swing.json", "set/slope.json", "--integrators", "verlet,be", "--repeats", "1", "--case-seconds", "0.05"]
    for shard in ("1/2", "2/2"):
        good(*args, "--shard", shard, "--out", "parts")
    out = good("merge", "parts", "--out", "merged")
    lines = [json.loads(line) for line in open("merged/cases.jsonl", encoding="utf-8")]
    equal({line["tags"]["scene"] for line in lines}, {"swing", "slope"}, "scenes")
    # verlet moves nodes out of contact instead of solving the scene's equations: it is not compared there.
    equal({line["tags"]["scene"] for line in lines if line["tags"]["integrator"] == "verlet"}, {"swing"}, "scenes of verlet")
    assert "| slope |" in out and "over_budget" in out, out


def test_reference():
    """two families of methods agree on a small scene; a reference that is damaged or of another scene is refused"""
    write_scene(duration=0.1, frame_rate=20)
    good("ivp", "reference", "scene.json", "--case-seconds", "5")
    about = read_json("references/scene.json")
    families = {one["family"] for one in about["methods"] if one["distance"] is not None and one["distance"] <= 1e-8}
    assert len(families) >= 2 and about["error"] <= 1e-8, about
    equal(read_npy("references/scene.npy")[0], (2, 16, 3), "shape")
    assert "differs by 0 of" in good("ivp", "reference", "scene.json", "--case-seconds", "5", "--check")
    with open("references/scene.npy", "r+b") as file:
        file.seek(1000)
        file.write(b"x")
    refused("ivp", "score", "scene.json", "references/scene.npy", says="damaged")
    refused("ivp", "run", "scene.json", says="damaged")
    write_scene(duration=0.1, frame_rate=20, gravity=[0, -9.8, 0])
    refused("ivp", "score", "scene.json", "references/scene.npy", says="another version of the scene")
    out = good("ivp", "horizon", "scene.json")
    assert "horizon" in out and read_json("horizons/scene.json")["perturbation"] == 1e-10, out


def test_bad_input():
    """wrong input of drape ivp is refused with one line"""
    take_set("swing")
    shape, numbers = read_npy("set/references/swing.npy")
    write_npy("short.npy", (shape[0] - 1, *shape[1:]), numbers[:(shape[0] - 1) * shape[1] * 3])
    write_npy("cut.npy", shape, numbers[:-1])
    write_npy("nan.npy", shape, (float("nan"), *numbers[1:]))
    write_npy("huge.npy", shape, (*numbers[:242], 1e200, *numbers[243:]))
    write_text("text.npy", "no array")
    write_scene(duration=0.1, frame_rate=33)
    refused("ivp", "walk", "set/swing.json", says="must be one of run, horizon, reference, score, export")
    refused("ivp", "score", "set/swing.json", says="usage: drape ivp score SCENE POSITIONS.npy")
    refused("ivp", "run", says="usage: drape ivp run SCENE...")
    refused("ivp", "export", "set/swing.json", says="--out is missing")
    write_scene(duration=0.1, frame_rate=20, events=[{"type": "height", "height": -0.1, "action": "stop"}])
    refused("ivp", "reference", "scene.json", says='/events/0/action: must be "record"')
    write_scene(duration=0.1, frame_rate=33)
    for name, other in (("four", (6, 81, 3, 1)), ("flat", (6 * 81 * 3,)), ("rows", (6, 243)), ("turned", (3, 81, 6)), ("empty", ()), ("large", (2 ** 62, 81, 3)),
                        ("many", (6, 81, 3, 1, 1, 1, 1, 1, 1)), ("minus", (-6, 81, 3))):
        write_npy(name + ".npy", other, numbers)
    write_npy("single.npy", shape, numbers, kind="<f4")
    write_npy("big.npy", shape, numbers, kind=">f8")
    write_npy("fortran.npy", shape, numbers, fortran=True)
    right = "; it must be (6, 81, 3), frames x nodes x (x, y, z), a frame every 0.05 s, or one more with the start"
    for name, says in (("short", "its shape is (5, 81, 3); it must be (6, 81, 3)"), ("cut", "not as long as its header says: 11656 bytes instead of 11664"),
                       ("nan", "frame 0, at 0.05 s, node 0: nan is not a finite number"), ("huge", "frame 0, at 0.05 s, node 80: 1e+200 is too large for a root mean square"),
                       ("text", "its header cannot be read"),
                       ("four", "its shape is (6, 81, 3, 1)" + right), ("flat", "its shape is (1458,)" + right), ("rows", "its shape is (6, 243)" + right),
                       ("turned", "its shape is (3, 81, 6)" + right), ("empty", "its shape is ()" + right), ("large", "its shape is (4611686018427387904, 81, 3)" + right),
                       ("many", "its header cannot be read"), ("minus", "its header cannot be read"), ("single", "its numbers are '<f4'"), ("big", "its numbers are '>f8'"),
                       ("fortran", "Fortran order")):
        refused("ivp", "score", "set/swing.json", name + ".npy", says=says)
    refused("ivp", "score", "set/swing.json", "none.npy", says="cannot read")
    refused("ivp", "horizon", "scene.json", says="must be a whole number")
    refused("ivp", "run", "set/none.json", says="cannot read")
    refused("ivp", "run", "set/swing.json", "set/swing.json", says="two scenes have the name")
    refused("ivp", "run", "set/swing.json", "--integrators", "static", says="has no steps in time")
    os.remove("set/references/swing.npy")
    refused("ivp", "run", "set/swing.json", says="cannot read")
    # A start before the frames is allowed: drape run writes it.
    take_set("swing")
    write_npy("more.npy", (shape[0] + 1, *shape[1:]), (*[0.0] * (shape[1] * 3), *numbers))
    equal(scores("set/swing.json", "more.npy")[0]["error_max"], 0, "error of the reference with a start")
    equal(drape("ivp", "--help").returncode, 0, "help")
    # Version 2 of the format has a longer length; numpy writes it for long headers.
    write_npy("two.npy", shape, numbers, version=2)
    equal(scores("set/swing.json", "two.npy")[0]["error_max"], 0, "error of the reference in version 2")


def test_score_as_json():
    """score --json has the numbers of the text, with the scene that they are of"""
    take_set("swing")
    shape, numbers = read_npy("set/references/swing.npy")
    write_npy("off.npy", shape, [x + 1e-3 * (i % 3 == 0) for i, x in enumerate(numbers)])
    values, rows = scores("set/swing.json", "off.npy")
    found = json.loads(good("ivp", "score", "set/swing.json", "off.npy", "--json"))
    equal((found["scene"], found["scene_hash"], found["resolved"]), ("swing", read_json("set/references/swing.json")["scene_hash"], True), "scene")
    equal(len(found["times_s"]), shape[0], "times")
    for key in ("error_end", "error_max", "mescd", "reference_error"):
        assert abs(values[key] / found[key] - 1) < 0.05, key  # the text has two digits and more
    # Every node is off by 1 mm: so are the mean and the largest, whatever the time. Pinned nodes are not counted in the mean.
    for k, row in enumerate(rows):
        for name, column in (("error", 1), ("error_largest", 2)):
            assert abs(found[name][k] * found["size_m"] - 1e-3) < 1e-12 and abs(row[column] / found[name][k] - 1) < 1e-5, (name, k)
    found = json.loads(good("ivp", "score", "set/swing.json", "set/references/swing.npy", "--json"))
    equal((found["error_max"], found["mescd"], found["resolved"]), (0, None, False), "of the reference itself")
    refused("ivp", "horizon", "set/swing.json", "--json", says="--json has no effect")


sys.exit(run_tests(globals()))
