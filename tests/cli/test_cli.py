#!/usr/bin/env python3
"""The program `drape` as a user sees it: exit codes, messages, files. See program.py."""
import csv
import glob
import json
import math
import os
import pty
import re
import shutil
import signal
import struct
import subprocess
import sys
import time

from program import LIMIT, PROGRAM, SOURCES, Skip, drape, equal, good, read_json, read_npy, read_steps, refused, run_tests, scene, wait_for, without_warnings, write_json, write_scene, write_text



def verbs():
    """The verbs that this build of the program has."""
    found = re.findall(r"^  (\w+) ", good("help"), re.M)
    return [verb for verb in found if verb != "drape"]


# ---- Help and usage


def test_help():
    """help of the program and of every verb is on stdout with exit 0"""
    overview = good("--help")
    equal(good("help"), overview)
    equal(good(), overview)
    assert {"run", "report", "info", "check", "list", "render", "view"} <= set(verbs()), verbs()
    for verb in verbs():
        text = good(verb, "--help")
        assert text.startswith(f"usage: drape {verb} "), text
        equal(good("help", verb), text)
        equal(good(verb, "-h"), text)
        options = re.findall(r"^  (--\S+)(?: [^ ]+)? +(.*)$", text, re.M)
        assert all(len(words) > 8 for _, words in options) and "--help" in [option for option, _ in options], options
        for option, _ in options:  # the parser accepts every option of the help
            assert "there is no option" not in drape(verb, "missing.json", option).stderr, option
    version = good("--version")
    assert re.match(r"drape \d+\.\d+\.\d+\nreproducible: (yes|no: \S.*)\n", version), version
    assert re.search(r"^licence of libdrape: BSD-3-Clause; .*nothing under the GPL$", version, re.M), version
    linked = subprocess.run(["ldd", PROGRAM], capture_output=True, text=True, check=True).stdout
    gpl = "licence of the program: GPL-3.0-or-later"
    assert (gpl in version) == ("libgsl." in linked), version


def test_help_needs_no_scene():
    """--help is answered even if something else is wrong with the command line"""
    good("run", "--help", "a", "b", "c")


# Names of every kind, one letter wrong: arguments, the start of the line, choices, and the suggestion.
UNKNOWN = (
    (["rnu"], "drape: ", "validate", "run"),
    (["list", "integratorz"], "drape list: ", "shadings", "integrator"),
    (["validate", "catenari"], "drape validate: ", "cantilever", "catenary"),
    (["render", "scene.json", "--shade", "straim"], "drape render: ", "wireframe", "strain"),
    (["run", "scene.json", "--dration", "1"], "drape run: ", "`drape run --help` shows all", "--duration"),
    *(([verb, "scene.json", "--integrators", "newtonk", *more], f"drape {verb}: ", "be, bdf2", "newton_k")
      for verb, more in (("converge", []), ("tradeoff", []), ("stability", ["--axis", "/integrator/dt=1e-3:1e-2:2"]))),
    *(([verb, "scene.json", "--integrator", "newtonk"], "scene.json: set /integrator/method=newtonk: /integrator/method: ", "be, bdf2", "newton_k")
      for verb in ("run", "info", "check", "converge", "tradeoff")),
    *((["run", "scene.json", *args], f"scene.json: set {pointer}", choices, meant) for args, pointer, choices, meant in (
        (["--controller", "having"], "/controller/type=having: /controller/type: ", "fixed, halving", "halving"),
        (["--linear-solver", "kluu"], "/integrator/linear_solver=kluu: /integrator/linear_solver: ", "auto, klu", "klu"),
        (["--format", "opj"], "/output/formats=[\"opj\"]: /output/formats/0: ", "npy, obj", "obj"),
        (["--set", "/cloth/0/terms/-=streth"], "/cloth/0/terms/-=streth: /cloth/0/terms/", "stretch.edge, stretch.cst", "stretch.edge"),
        (["--set", '/colliders/-={"type":"spere"}'], '/colliders/-={"type":"spere"}: /colliders/0/type: ', "plane, sphere", "sphere"),
        (["--set", "/cloth/0/mesh/grid=squar"], "/cloth/0/mesh/grid=squar: /cloth/0/mesh/grid: ", "equilateral, square", "square"),
        (["--set", '/cloth/0/mesh={"file":"a.stl"}'], '/cloth/0/mesh={"file":"a.stl"}: /cloth/0/mesh/file: ', ".obj, .ply", None),
        (["--set", "/cloth/0/material/fabric=denim"], "/cloth/0/material/fabric=denim: /cloth/0/material/fabric: ", "none, feng2022_1", "wang2011_denim"),
        (["--set", "/integrator/globalization=lin_search"], "/integrator/globalization=lin_search: /integrator/globalization: ", "line_search, none", "line_search"),
        (["--set", "/integratr/dt=1"], "/integratr/dt=1: /integratr: ", "Known: drape", "integrator"),
        (["--set", "/integrator/dtt=1"], "/integrator/dtt=1: /integrator/dtt: ", "Known: dt, tolerance", "dt"),
        (["--set", "/cloth/0/pins/0/corner=top-lef"], "/cloth/0/pins/0/corner=top-lef: /cloth/0/pins/0/corner: ", "top-left, top-right", "top-left"))))


def test_unknown_names():
    """an unknown name of any kind is one line: where, the choices, and the name that was probably meant"""
    write_scene()
    for args, start, choices, meant in UNKNOWN:
        result = drape(*args)
        line = result.stderr
        equal((result.returncode, result.stdout, line.count("\n")), (2, "", 1), f"{args}: {line}")
        assert line.startswith(start) and choices in line, f"{args}: {line}"
        assert meant is None or f'did you mean "{meant}"?' in line, f"{args}: {line}"


def test_fractions():
    """a fraction is a number wherever one is read; a text that only resembles one is refused in one line"""
    write_scene()
    assert "10 accepted, 0 rejected; 0.005 to 0.005 s" in good("run", "scene.json", "--dt", "1/200", "--duration", "1/20", "--set", "/integrator/method=be")
    for args, says in ((["run", "--dt", "1/0"], '/integrator/dt: "1/0" is not allowed; dt is a number in (0, 1e6] s'),
                       (["run", "--dt", "a/b"], '/integrator/dt: "a/b" is not allowed'), (["run", "--duration", "1/"], '/duration: "1/" is not allowed'),
                       (["run", "--accuracy", "1/0"], '/accuracy: is "1/0"; it must be a length'), (["render", "--camera", "1/0,2"], "--camera"),
                       (["converge", "--case-seconds", "1/-2"], "--case-seconds \"1/-2\": must be a number above 0"),
                       (["tradeoff", "--budget", "1/0"], '--budget "1/0": must be minutes'),
                       (["stability", "--axis", "/integrator/dt=1/60:1/:3"], "three numbers are needed")):
        refused(args[0], "scene.json", *args[1:], says=says)


def test_wrong_usage():
    """wrong command lines are one line, exit 2, and write nothing"""
    write_scene()
    refused("rnu", says='did you mean "run"?')
    refused("help", "chekc", says='did you mean "check"?')
    refused("run", says="SCENE is missing")
    refused("run", "scene.json", "scene.json", says="one SCENE is allowed, 2 are given")
    refused("run", "scene.json", "--dration", "1", says='did you mean "--duration"?')
    refused("run", "scene.json", "--out", says="--out needs an argument")
    refused("run", "scene.json", "--out", "", says="--out")
    refused("run", "scene.json", "-x", says='no option "-x"')
    refused("info", "scene.json", "--json=1", says="takes no argument")
    refused("info", "scene.json", "--out", "x", says='no option "--out"')
    refused("run", "scene.json", "--threads", "none", says="1 to 256")
    refused("run", "scene.json", "--threads", "257", says="1 to 256")
    refused("run", "scene.json", "--set", "integrator.dt=1", says="/pointer=value")
    refused("run", "scene.json", "--set", "/integrator/dt", says="/pointer=value")
    refused("run", "scene.json", "--dt", "0.01", "--dt", "0.02", says="--dt is given twice")
    refused("info", "scene.json", "--json", "--json", says="--json is given twice")
    refused("list", "klo", says='did you mean "klu"?')
    refused("list", "terms", "--schema", says="--schema")


def test_wrong_scenes():
    """bad input is one line with place and pointer, exit 2, for every verb that takes a scene"""
    write_scene(duration=-1)
    for verb in "run", "info", "check":
        line = refused(verb, "scene.json", says="/duration: ")
        assert re.match(r"scene\.json:\d+:\d+: ", line), line
    refused("run", "missing.json", "--out", "out", says="missing.json")
    write_scene()
    refused("run", "scene.json", "--out", "out", "--set", "/cloth/0/terms/0=stretch.egde", says='did you mean "stretch.edge"?')
    refused("run", "scene.json", "--out", "out", "--dt", "-1", says="scene.json: set /integrator/dt=-1: /integrator/dt: ")
    refused("run", "scene.json", "--out", "out", "--dt", "fast", says="/integrator/dt")
    refused("run", "scene.json", "--out", "out", "--integrator", "eb", says="/integrator/method")
    refused("run", "scene.json", "--out", "out", "--controller", "halve", says="/controller/type")
    refused("run", "scene.json", "--out", "out", "--linear-solver", "kul", says='did you mean "klu"?')
    refused("run", "scene.json", "--out", "out", "--summary", "s.json", "--duration", "0", says="/duration")


def test_wrong_formats():
    """every verb refuses a wrong format before it writes anything"""
    write_scene(output={"formats": ["npy", "nyp"]})
    for verb in "run", "info", "check":
        line = refused(verb, "scene.json", says='/output/formats/1: there is no format "nyp"')
        assert re.match(r"scene\.json:\d+:\d+: ", line), line
    refused("run", "scene.json", "--out", "out", "--format", "npy,objj", says='did you mean "obj"?')
    refused("run", "scene.json", "--out", "out", "--format", "glb", "--frame-rate", "1e6", says="/output/formats/0: glb: 100003 frames of 16 nodes")
    good("run", "scene.json", "--out", "out", "--format", "npy")


# ---- Runs


def test_run_without_out():
    """without --out a run writes nothing but its results on stdout"""
    write_scene()
    text = good("run", "scene.json")
    assert re.search(r"^status +ok$", text, re.M), text
    assert re.search(r"^steps +10 accepted, 0 rejected", text, re.M), text
    equal(os.listdir("."), ["scene.json"])


def test_run_files():
    """frames, steps.csv and summary.json have what the scene asks for"""
    write_scene()
    good("run", "scene.json", "--out", "deep/er/out/", "--summary", "s.json", "--format", "npy,obj,ply,npy")
    shape, numbers = read_npy("deep/er/out/positions.npy")
    frames = 4  # t = 0, 1/30, 2/30, 3/30 = the end
    equal(shape, (frames, 16, 3))
    for ending in "obj", "ply":
        found = sorted(os.path.basename(path) for path in glob.glob("deep/er/out/frame_*"))
        equal([name for name in found if name.endswith(ending)], [f"frame_{i:06d}.{ending}" for i in range(frames)])
    equal(glob.glob("deep/er/out/**/*.npy", recursive=True), ["deep/er/out/positions.npy"])
    with open("deep/er/out/frame_000003.obj", encoding="ascii") as file:
        nodes = [[float(word) for word in line.split()[1:]] for line in file if line.startswith("v ")]
    equal([x for node in nodes for x in node], list(numbers[-48:]), "the last frame in both formats")
    summary = read_json("s.json")
    equal(read_json("deep/er/out/summary.json")["hash"], summary["hash"])
    equal((summary["status"], summary["message"], summary["frames"]), ("ok", "", frames))
    equal((summary["nodes"], summary["dofs"]), (16, 42))
    assert abs(summary["time"] - 0.1) < 1e-15
    rows = read_steps("deep/er/out")
    equal(len(rows), summary["steps"]["accepted"] + summary["steps"]["rejected"])
    equal([row["attempt"] for row in rows], [str(i) for i in range(len(rows))])
    equal(sum(int(row["iterations"]) for row in rows), summary["newton"]["iterations"])
    for row in rows:
        by_error = (row["reason"], row["tolerance"]) == ("local_error", "nan")
        assert (by_error or float(row["residual"]) <= float(row["tolerance"])) and row["accepted"] == "1", row
    with open("deep/er/out/energy.csv", encoding="ascii", newline="") as file:
        energies = list(csv.DictReader(file))
    equal([row["frame"] for row in energies], [str(i) for i in range(frames)])
    for key, value in summary["energy"].items():
        equal(float(energies[-1][key]), value, "the last row and the summary: " + key)


def test_work():
    """the work of pins, loads and wind is printed, in energy.csv and in the summary, by the names of the scene, and closes the balance"""
    write_scene(name='the "red", flag', terms=["stretch.edge", {"type": "drag.wind", "wind": [0, 0, 3]}, *({"type": "load.point", "force": [0, 0, f]} for f in (1e-3, 2e-3))],
                pins=[{"corner": "top-left", "track": [[0, [0, 0, 0]], [0.1, [0, 0.1, 0]]]}])
    text = good("run", "scene.json", "--summary", "s.json", "--out", "out", "--duration", "0.2", "--integrator", "ida")
    work = read_json("s.json")["work"]
    flag = ' of the "red", flag'
    equal(list(work), ["pins", "colliders", "host", "drag.wind" + flag, "load.point" + flag, "load.point" + flag + " (2)"])
    equal(re.findall(r"^work +(.*?) (\S+) J$", text, re.M), [(name, f"{value:.5g}") for name, value in work.items() if value])
    assert abs(work["load.point" + flag + " (2)"] - 2 * work["load.point" + flag]) < 1e-12, work
    with open("out/energy.csv", encoding="ascii", newline="") as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    for row in rows:
        assert abs(row["work"] - sum(row[name] for name in work)) < 1e-14
        assert abs(row["total"] + row["dissipated"] + row["numerical"] - row["work"] - rows[0]["total"]) < 1e-13, row
    equal({name: rows[-1][name] for name in work}, work, "the last row and the summary")


def test_realtime():
    """frames with a budget: times, misses and levels are reported, late frames are not failures, files as usual"""
    write_scene()
    for rate, integrator in (30, "newton_k"), (1e6, "newton_k"), (30, "be"):
        text = good("run", "scene.json", "--realtime", "--integrator", integrator, "--frame-rate", str(rate), "--duration",
                    "0.1" if rate < 1e6 else "2e-5", "--summary", "s.json", "--out", "out", "--format", "npy")
        report = re.search(r"^realtime +(\d+) frames of [^:]+: p50 (\S+), p95 (\S+), p99 (\S+), worst (\S+) ms; (\d+) missed$",
                         text, re.M)
        assert report, text
        times = [float(word) for word in report.group(2, 3, 4, 5)]
        equal(times, sorted(times))
        summary = read_json("s.json")
        realtime = summary["realtime"]
        equal((realtime["frames"], realtime["missed"]), (int(report.group(1)), int(report.group(6))))
        equal(realtime["full"] + realtime["fewer"] + realtime["larger"], realtime["frames"])
        assert abs(summary["time"] - (0.1 if rate < 1e6 else 2e-5)) < 1e-12, summary
        assert realtime["worst"] >= realtime["p50"] > 0 and realtime["dropped"] >= 0
        equal(realtime["still"], int(re.search(r"; (\d+) frames without a new state; ", text).group(1)))
        equal(realtime["still"] > 0, rate == 1e6)
        if rate == 1e6:  # no machine keeps up with a microsecond a frame: frames that make a step miss their budget, the others wait
            assert realtime["missed"] > 0 and realtime["larger"] > 0, realtime
        shape, _ = read_npy("out/positions.npy")
        assert shape[0] >= 2, shape
    assert "realtime" not in read_summary_without_budget()
    refused("run", "scene.json", "--realtime", "--integrator", "static", "--out", "none",
            says='--realtime: the integrator "static" makes no steps in time')


def chosen_by(*options, **changes):
    """Runs a scene in real time; returns the line that says what was chosen, and the integrator in the copy of the scene."""
    write_scene(**changes)
    text = good("run", "scene.json", "--realtime", "--duration", "0.1", "--frame-rate", "20", "--out", "chosen", *options)
    line = re.search(r"^chosen +(.*)$", text, re.M)
    assert line, text
    return line.group(1), read_json("chosen/scene.json")["integrator"]


def test_realtime_chooses():
    """--realtime takes newton_k, as many iterations as fit and the machine's threads, unless these are given; the copy of the scene has it"""
    line, integrator = chosen_by()
    found = re.fullmatch(r"threads 1: chosen, for 16 nodes and \d+ processors?; method newton_k: chosen, as none is named; "
                         r"iterations ([12]): chosen, as one takes \S+ ms of a frame of 50 ms in trial steps", line)
    assert found, line
    equal((integrator["method"], integrator["iterations"], integrator["dt"]), ("newton_k", int(found.group(1)), 0.01))
    # A frame of a microsecond has no time even for one.
    text = good("run", "scene.json", "--realtime", "--frame-rate", "1e6", "--duration", "2e-5")
    assert re.search("; iterations 1: chosen, as one takes .*; frames will be late$", text, re.M), text
    # What the scene or the command line gives stays.
    line, integrator = chosen_by(integrator={"dt": 0.01, "iterations": 3})
    assert line.endswith("; method newton_k: chosen, as none is named; iterations 3: given"), line
    equal(integrator["iterations"], 3)
    line, integrator = chosen_by("--set", "/integrator/iterations=5", "--threads", "1")
    equal((line, integrator["iterations"]), ("threads 1: given; method newton_k: chosen, as none is named; iterations 5: given", 5))
    line, integrator = chosen_by("--integrator", "newton_k")
    assert line.endswith("; method newton_k: given by the scene or an option; iterations 1: the default of the method"), line
    for options, changes in (((), {"integrator": {"method": "be", "dt": 0.01}}), (("--integrator", "be"), {}), (("--linear-solver", "klu"), {})):
        line, integrator = chosen_by(*options, **changes)
        assert line.endswith("; method be: given by the scene or an option; iterations: not a parameter of be"), line
        assert integrator.get("method", "be") == "be" and "iterations" not in integrator, integrator
    assert "chosen" not in good("run", "scene.json")


def test_linear_solver_acts():
    """a linear solver on the command line is refused if the integrator has none; in a scene it is ignored, and other integrators use it"""
    write_scene()
    for integrator in "newton_k", "verlet":
        refused("run", "scene.json", "--integrator", integrator, "--linear-solver", "klu", "--out", "none",
                says=f'--linear-solver "klu": the integrator "{integrator}" does not use it')
        good("run", "scene.json", "--integrator", integrator, "--set", "/integrator/linear_solver=klu", "--duration", "0.02")
    for integrator in "be", "ida", "static":
        good("run", "scene.json", "--integrator", integrator, "--linear-solver", "klu", "--duration", "0.02")


def test_former_linear_solvers():
    """scenes that name cholmod or umfpack run with multifrontal and the same results; a line says so"""
    write_scene()
    expected = good("run", "scene.json", "--linear-solver", "multifrontal")
    for name in "cholmod", "umfpack":
        result = drape("run", "scene.json", "--set", f'/integrator/linear_solver="{name}"')
        equal(result.returncode, 0, result.stderr)
        equal(result.stderr.splitlines(True)[0], f'warning: /integrator/linear_solver: "{name}" is a former name; "multifrontal" is used\n')
        equal(result.stdout.splitlines()[:-1], expected.splitlines()[:-1])  # the last line has times


def test_former_settings():
    """settings that have gone have no effect, and a line says so; other names are refused"""
    write_scene()
    expected = good("run", "scene.json")
    for name in ("integrator/alpha", "integrator/coarse_spacing", "integrator/corrections", "integrator/family", "integrator/predictor", "integrator/rescue_iterations",
                 "integrator/rho_inf", "integrator/stability_detection", "controller/max_attempts", "contact/restitution_velocity"):
        result = drape("run", "scene.json", "--set", f"/{name}=1")
        equal(result.returncode, 0, result.stderr)
        equal(result.stderr.splitlines(True)[0], f"warning: /{name}: has no effect any more\n")
        equal(result.stdout.splitlines()[:-1], expected.splitlines()[:-1])  # the last line has times
    refused("run", "scene.json", "--set", "/controller/project=1", says='unknown key "project"')
    refused("run", "scene.json", "--set", "/contact/sweeps=1", says='unknown key "sweeps"')
    write_scene(terms=[{"type": "stretch.edge", "min_length": 0.1}, {"type": "bend.hinge", "max_turn": 1}], untangle={"gap": 0.5})
    result = drape("run", "scene.json")
    equal((result.returncode, [line for line in result.stderr.splitlines() if "any more" in line]),
          (0, [f"warning: {at}: has no effect any more" for at in ("/untangle/gap", "/cloth/0/terms/0/min_length", "/cloth/0/terms/1/max_turn")]))


def test_former_methods():
    """a scene that names a method that has gone is run by another one, and one line says by which"""
    write_scene()
    for name, by in ("cvode", "ida"), ("generalized_alpha", "bdf2"):
        expected = drape("run", "scene.json", "--integrator", by)
        result = drape("run", "scene.json", "--integrator", name)
        equal(result.returncode, 0, result.stderr)
        equal(result.stderr, f'warning: /integrator/method: there is no "{name}" any more; "{by}" runs in its place\n' + expected.stderr)
        equal(result.stdout.splitlines()[:-1], expected.stdout.splitlines()[:-1])  # the last line has times
    result = drape("run", "scene.json", "--set", "/controller/type=iterations")
    equal(result.returncode, 0, result.stderr)
    assert 'warning: /controller/type: there is no "iterations" any more; "halving" runs in its place\n' in result.stderr, result.stderr
    refused("run", "scene.json", "--integrator", "cvod", says='there is no integrator "cvod"')


def read_summary_without_budget():
    good("run", "scene.json", "--summary", "s.json")
    return read_json("s.json")


def test_scene_copy():
    """the folder of a run has a copy of the scene as it was run, with its meshes, and running the copy gives the same bits"""
    os.makedirs("scenes/meshes")
    shutil.copy(SOURCES + "/examples/scenes/tube.obj", "scenes/meshes/tube.obj")
    write_text("scenes/meshes/wedge.obj", "v 0 -3 0\nv 1 -3 0\nv 0 -2 0\nv 0 -3 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    whole = scene(mesh={"file": "meshes/tube.obj"}, pins=[{"nodes": [0, 1]}], description='say "\u00e9" \\ \t',
                  colliders=[{"type": "mesh", "file": "meshes/wedge.obj"}])
    write_json("scenes/one.json", whole)
    good("run", "scenes/one.json", "--dt", "0.005", "--out", "a/b")
    kept = read_json("a/b/scene.json")
    equal(kept["integrator"], {"dt": 0.005})
    equal((kept["description"], kept["duration"]), (whole["description"], 0.1))
    equal((kept["cloth"][0]["mesh"]["file"], kept["colliders"][0]["file"]), ("scene_mesh_0.obj", "scene_mesh_1.obj"))
    shutil.rmtree("scenes")
    os.rename("a/b", "moved")
    good("run", "moved/scene.json", "--out", "again")
    equal(read_json("again/summary.json")["hash"], read_json("moved/summary.json")["hash"])
    equal(open("again/scene.json", "rb").read(), open("moved/scene.json", "rb").read())
    good("run", SOURCES + "/examples/scenes/cs184_pinned2.json", "--duration", "0.02", "--out", "cs184")
    equal(read_json("cs184/scene.json")["drape"], 1)
    good("run", "cs184/scene.json", "--out", "ours")
    equal(read_json("ours/summary.json")["hash"], read_json("cs184/summary.json")["hash"])


def test_start_copy():
    """the folder of a run that starts from files has copies of them: it is drawn, checked, resumed and run again where it was moved"""
    os.mkdir("scenes")
    nodes = 16
    write_scene(duration=0.05)
    good("run", "scene.json", "--out", "first", "--format", "obj,npy")
    shutil.copy(sorted(glob.glob("first/*.obj"))[-1], "scenes/bent.obj")
    values = struct.pack(f"<{3 * nodes}d", *(0.1 * (i % 5) for i in range(3 * nodes)))
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({nodes}, 3), }}".ljust(117) + "\n"
    with open("scenes/speed.npy", "wb") as file:
        file.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + values)
    whole = scene()
    whole["cloth"][0]["start"] = {"file": "bent.obj", "velocities": "speed.npy"}
    write_json("scenes/one.json", whole)
    good("run", "scenes/one.json", "--out", "a", "--checkpoint-every", "1")
    kept = read_json("a/scene.json")["cloth"][0]["start"]
    equal(kept, {"file": "scene_mesh_0.obj", "velocities": "scene_mesh_1.npy"})
    shutil.rmtree("scenes")
    os.rename("a", "moved")
    good("check", "moved/scene.json")
    good("run", "moved/scene.json", "--out", "again")
    equal(read_json("again/summary.json")["hash"], read_json("moved/summary.json")["hash"])
    good("run", "moved/scene.json", "--out", "moved", "--resume", "--checkpoint-every", "1")


def test_scene_in_the_folder():
    """a scene that is itself the scene.json of the output folder is never overwritten"""
    write_scene()
    before = open("scene.json", "rb").read()
    good("run", "scene.json", "--out", ".")
    equal(open("scene.json", "rb").read(), before)
    files = sorted(os.listdir("."))
    refused("run", "scene.json", "--out", "./", "--dt", "0.005", says="choose another folder")
    equal((open("scene.json", "rb").read(), sorted(os.listdir("."))), (before, files))


def test_last_frame():
    """the last frame is the end, even if no frame is due then"""
    write_scene(duration=0.05)
    good("run", "scene.json", "--out", "out", "--format", "npy")
    equal(read_npy("out/positions.npy")[0][0], 3)  # 0, 1/30, 0.05
    equal(read_json("out/summary.json")["frames"], 3)
    write_scene(duration=0.3, frame_rate=7)  # 0, 1/7, 2/7, 0.3
    good("run", "scene.json", "--out", "out", "--format", "npy")
    equal(read_npy("out/positions.npy")[0][0], 4)


def test_events():
    """events are printed and in the summary; a run that one stops has completed, with exit code 0 and the state of the event as last frame"""
    events = [{"name": "low", "type": "height", "height": -0.02, "action": "stop"}, {"type": "energy", "bound": 1e-4, "direction": "up"},
              {"name": "never", "type": "height", "height": -9}]
    write_scene(events=events)
    text = good("run", "scene.json", "--out", "out", "--format", "npy")
    assert re.search(r"^status +ok$", text, re.M) and re.search(r"^event +never: did not occur$", text, re.M), text
    summary = read_json("out/summary.json")
    low, fast, never = summary["events"]
    at = low["occurrences"][0]
    equal((low["name"], low["count"], at["direction"], at["time"]), ("low", 1, "down", summary["time"]))
    assert abs(at["value"] + 0.02) < 1e-9 and 0 < at["time"] < 0.1, at
    equal((fast["name"], fast["count"], fast["occurrences"][0]["direction"]), ("event1", 1, "up"))
    equal((never["count"], never["occurrences"]), (0, []))
    equal((summary["status"], summary["message"]), ("ok", f't={summary["time"]:.9g}: stopped by event "low"'))
    assert f'low: down at {at["time"]:.12g} s' in text and f'event1: up at {fast["occurrences"][0]["time"]:.12g} s' in text, text
    shape, numbers = read_npy("out/positions.npy")
    assert abs(min(numbers[-48:][1::3]) + 0.02) < 1e-9, "the last frame"
    rows = read_steps("out")
    repeated = [row for row in rows if row["reason"] == "event"]
    equal(len(repeated), summary["steps"]["reasons"]["event"])
    assert repeated and all(row["accepted"] == "0" for row in repeated)
    equal(shape[0], summary["frames"])
    # The rows have the same times, in the step in which they lie.
    found = {}
    for row in rows:
        for word in filter(None, row["events"].split(";")):
            name, time = word.rsplit("@", 1)
            found[name] = float(time)
            assert float(row["t"]) <= float(time) <= float(row["t"]) + float(row["h"]) * (1 + 1e-12) and row["accepted"] == "1", row
    equal(found, {"low": at["time"], "event1": fast["occurrences"][0]["time"]}, "events in steps.csv")
    # A name may have what a table needs quotes for.
    write_scene(events=[{"name": 'low, "so"', "type": "height", "height": -0.02}])
    good("run", "scene.json", "--out", "quoted")
    equal([row["events"].rsplit("@", 1)[0] for row in read_steps("quoted") if row["events"]], ['low, "so"'], "a name with quotes")


def test_released():
    """a pin that an event releases is gone, and the run goes on to its end"""
    write_scene(events=[{"name": "tears", "type": "pin_force", "limit": 0.02, "action": "release"}])
    text = good("run", "scene.json", "--out", "out", "--format", "npy", "--duration", "0.5")
    assert re.search(r"^event +tears: up at", text, re.M), text
    summary = read_json("out/summary.json")
    equal((summary["status"], summary["message"], summary["time"]), ("ok", "", 0.5))
    count = summary["nodes"]
    _, numbers = read_npy("out/positions.npy")
    assert max(numbers[-3 * count:][1::3]) < -0.05, "all nodes fall"


def test_settings():
    """--set and the short options change the scene, the last one wins, and the result is the same"""
    write_scene()
    def hash_of(*args):
        good("run", "scene.json", "--summary", "s.json", *args)
        return read_json("s.json")["hash"]
    plain = hash_of()
    equal(hash_of("--set", "/integrator/dt=0.005", "--dt", "0.01"), plain)
    fine = hash_of("--dt", "0.005")
    assert fine != plain
    equal(read_json("s.json")["steps"]["accepted"], 20)
    equal(hash_of("--set=/integrator/dt=0.005"), fine)
    equal(hash_of("--threads", "3"), plain)
    assert hash_of("--set", "/gravity=[0, 0, 0]") != plain
    hash_of("--set", "/integrator/linear_solver=dense")
    hash_of("--linear-solver", "dense", "--tolerance", "1e-9", "--controller", "fixed", "--integrator", "be")
    hash_of("--duration", "0.02", "--set", '/output={"formats": []}', "--format", "")
    equal(read_json("s.json")["steps"]["accepted"], 2)


def test_failure():
    """a run that fails ends with exit 1, one line, and the summary and frames so far"""
    write_scene(duration=1, integrator={"dt": 0.01, "max_iterations": 1, "tolerance": 1e-12})
    result = drape("run", "scene.json", "--out", "out", "--format", "npy", "--controller", "fixed")
    equal(result.returncode, 1, result.stderr)
    assert re.fullmatch(r"drape run: t=[^\n]+max_iterations[^\n]+\n", without_warnings(result.stderr)), result.stderr
    summary = read_json("out/summary.json")
    equal((summary["status"], "drape run: " + summary["message"] + "\n"), ("e_solver", without_warnings(result.stderr)))
    equal(summary["steps"]["reasons"], {"max_iterations": 1})
    equal(read_npy("out/positions.npy")[0][0], summary["frames"])
    assert re.search(r"^status +e_solver$", result.stdout, re.M), result.stdout
    write_scene(duration=1, integrator={"dt": 0.01, "max_iterations": 1, "tolerance": 1e-12, "globalization": "none"}, controller={"dt_min": 1e-3})
    result = drape("run", "scene.json", "--out", "out")
    equal((result.returncode, read_json("out/summary.json")["status"]), (1, "e_step_too_small"))
    assert all(row["accepted"] == "0" for row in read_steps("out")), "the last attempt failed, and all before it"


def test_undefined_energy():
    """the bending energy of a start that collapses elements is undefined, not a number"""
    write_scene(cloth=[{"mesh": {"grid": "square", "columns": 6, "rows": 6, "width": 0.5, "height": 0.5},
                        "material": {"young_modulus": 1e5, "thickness": 1e-3, "areal_density": 0.2},
                        "terms": ["stretch.cst", "bend.midedge"],
                        "pins": [{"edge": "left", "track": [[0, [0.1, 0, 0]]]}]}])
    result = drape("run", "scene.json", "--out", "collapsed")
    equal(result.returncode, 1, result.stderr)
    assert "area_collapse" in result.stderr, result.stderr
    assert "elastic undefined" in result.stdout and "nan" not in result.stdout, result.stdout


def interrupt(signals, *args):
    """Signals a run when its step log has begun to fill. Returns the exit code and stderr."""
    with subprocess.Popen([PROGRAM, "run", "scene.json", "--out", "out", *args],
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        wait_for(lambda: os.path.exists("out/steps.csv") and len(read_steps("out")) >= 3, process)
        for one in signals:
            process.send_signal(one)
        out, err = process.communicate(timeout=LIMIT)
    return process.returncode, out, without_warnings(err)


def test_interrupt():
    """Ctrl-C ends after the step with exit 130, frames and summary kept"""
    for one in signal.SIGINT, signal.SIGTERM:
        shutil.rmtree("out", ignore_errors=True)
        write_scene(duration=1e5)
        code, out, err = interrupt([one], "--format", "npy", "--frame-rate", "100", "--summary", "s.json")
        equal(code, 130, err)
        assert re.fullmatch(r"drape run: t=\S+: interrupted\n", err), err
        assert re.search(r"^status +e_stopped$", out, re.M), out
        summary = read_json("out/summary.json")
        equal((summary["status"], read_json("s.json")["status"]), ("e_stopped", "e_stopped"))
        shape, _ = read_npy("out/positions.npy")
        equal(shape[0], summary["frames"])
        assert shape[0] >= 3, shape
        equal(len(read_steps("out")), summary["steps"]["accepted"] + summary["steps"]["rejected"])


def test_interrupt_in_background():
    """a background job of a shell script can be interrupted"""
    write_scene(duration=1e5)
    script = """"$0" run scene.json --out out --format npy >/dev/null & drape=$!
        until [ -s out/steps.csv ]; do sleep 0.02; done; kill -INT $drape; wait $drape"""
    result = subprocess.run(["/bin/sh", "-c", script, PROGRAM], stderr=subprocess.PIPE, text=True, timeout=LIMIT)
    equal(result.returncode, 130, result.stderr)
    equal(read_json("out/summary.json")["status"], "e_stopped")


def test_lost_output():
    """results that cannot be written are exit 1"""
    if not os.path.exists("/dev/full"):
        raise Skip("there is no /dev/full")
    write_scene()
    for args in (["run", "scene.json"], ["info", "scene.json"], ["info", "scene.json", "--json"],
                 ["check", "scene.json"], ["list"], ["list", "--schema"], ["--help"]):
        with open("/dev/full", "w", encoding="ascii") as full:
            result = subprocess.run([PROGRAM, *args], stdout=full, stderr=subprocess.PIPE, text=True, timeout=LIMIT)
        equal(result.returncode, 1, " ".join(args))
        assert re.fullmatch(r"drape: cannot write to the standard output[^\n]*\n", without_warnings(result.stderr)), result.stderr


def test_closed_output():
    """a closed stdout is an error, and results do not end up in a file"""
    write_scene()
    script = 'exec "$0" run scene.json --out out --format npy >&-'
    result = subprocess.run(["/bin/sh", "-c", script, PROGRAM], stderr=subprocess.PIPE, text=True, timeout=LIMIT)
    equal(result.returncode, 1, result.stderr)
    equal(read_npy("out/positions.npy")[0], (4, 16, 3))
    for name in os.listdir("out"):
        with open("out/" + name, "rb") as file:
            assert b"newton  " not in file.read(), name


def test_unwritable():
    """output that cannot be written is exit 1 and one line"""
    write_scene()
    with open("taken", "w", encoding="ascii"):
        pass
    for args in (["--out", "taken"], ["--summary", "nowhere/s.json"], ["--out", "o", "--summary", "nowhere/s.json"]):
        result = drape("run", "scene.json", *args)
        equal(result.returncode, 1, " ".join(args))
        assert re.fullmatch(r"[^\n]+\n", without_warnings(result.stderr)), result.stderr
    equal(read_json("o/summary.json")["status"], "ok", "the run itself was good")
    result = drape("run", "scene.json", "--out", "taken", "--summary", "s.json")
    equal((result.returncode, read_json("s.json")["status"]), (1, "e_file"))


def limited(*args):
    """With files of at most 20 blocks of 512 bytes."""
    return subprocess.run(["/bin/sh", "-c", 'ulimit -f 20; exec "$0" "$@"', PROGRAM, *args],
                          capture_output=True, text=True, timeout=LIMIT, check=False)


def test_full():
    """output that fails in the middle is exit 1; earlier frames are whole"""
    write_scene(duration=5)
    result = limited("run", "scene.json", "--out", "out", "--format", "npy")
    equal(result.returncode, 1, result.stderr)
    assert re.fullmatch(r"[^\n]+\n", without_warnings(result.stderr)), result.stderr
    summary = read_json("out/summary.json")
    equal(summary["status"], "e_file")
    shape, _ = read_npy("out/positions.npy")
    assert shape[0] >= summary["frames"] > 1, (shape, summary["frames"])


def test_closed_pipe():
    """a reader that leaves, as head does, is no error of any verb that prints"""
    write_scene()
    os.mkdir("empty")
    for args in (["list"], ["info", "scene.json"], ["info", "scene.json", "--json"], ["check", "scene.json"], ["run", "scene.json"], ["--help"],
                 ["--version"], ["run", "--help"], ["run", "scene.json", "--out", "out"]):
        reading, writing = os.pipe()
        os.close(reading)
        result = subprocess.run([PROGRAM, *args], stdout=writing, stderr=subprocess.PIPE, text=True, timeout=LIMIT, check=False)
        os.close(writing)
        equal((result.returncode, without_warnings(result.stderr)), (0, ""), " ".join(args))
    equal(read_json("out/summary.json")["status"], "ok", "the run itself")


def test_names():
    """control characters and marks of direction in names reach no terminal, in results and in messages; other UTF-8 does"""
    evil = "a\x1b[31m\x07\r\n\u009b2J\u202eb \u00e4\u20ac"
    bad = re.compile("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
    write_scene(name=evil, colliders=[{"type": "sphere", "center": [0, -0.5, 0], "radius": 0.1, "name": evil}])
    os.rename("scene.json", evil.replace("\n", "") + ".json")
    name = evil.replace("\n", "") + ".json"
    for args in (["info", name], ["run", name, "--out", "out" + name], ["check", name], ["run", "no" + name], ["info", name, "--" + evil],
                 ["run", name, "--summary", "no/" + name], ["report", "no" + name], ["list", evil], [evil], ["run", name, "--integrator", evil],
                 ["run", name, "--format", evil], ["run", name, "--set", "/cloth/0/terms=[\"" + "x\\u001b[0m" + "\"]"]):
        result = drape(*args)
        text = result.stdout + result.stderr
        assert not bad.search(text), (args, bad.search(text), text)
        assert result.returncode in (0, 1, 2), (args, text)
    assert "b \u00e4\u20ac" in good("info", name)
    write_scene(pins=[{"corner": "top-left", "name": evil, "clamp": True}], histories=[{"name": evil, "times": [0, 1], "values": [1, 1]}])
    result = drape("run", "scene.json")
    assert len(re.findall("^warning: .*b \u00e4\u20ac", result.stderr, re.M)) == 2 and not bad.search(result.stderr), result.stderr
    text = good("info", "scene.json", "--json")
    assert not bad.search(text), text
    equal(json.loads(text)["cloths"][0]["pins"][0]["name"], evil, "a name in JSON")
    # stray bytes, an encoding too long for its character, half of a pair of UTF-16, and what is beyond the last character
    for odd in b"\xff", b"\x80", b"\xe2\x82", b"\xc0\xaf", b"\xed\xa0\x80", b"\xf4\x90\x80\x80", b"\xf8\x88\x80\x80\x80":
        result = subprocess.run([PROGRAM, b"info", b"no" + odd + b".json"], capture_output=True, timeout=LIMIT)
        shown = "no" + len(odd) * "?" + ".json: cannot read the scene: No such file or directory"
        assert shown in result.stderr.decode(), (odd, result.stderr)


def test_old_summary():
    """a new run removes the summary of an earlier one when it starts"""
    write_scene()
    good("run", "scene.json", "--out", "out")
    assert os.path.exists("out/summary.json")
    os.remove("out/steps.csv")  # interrupt waits for a new one
    write_scene(duration=1e5)
    code, _, _ = interrupt([signal.SIGKILL])
    equal(code, -signal.SIGKILL)
    assert not os.path.exists("out/summary.json")


def terminal(*args):
    """What a run prints if stderr is a terminal."""
    master, slave = pty.openpty()
    with subprocess.Popen([PROGRAM, *args], stdout=subprocess.DEVNULL, stderr=slave, env={"NO_COLOR": "1"}) as process:
        os.close(slave)
        shown = b""
        try:
            while chunk := os.read(master, 4096):
                shown += chunk
        except OSError:  # the other end was closed
            pass
        code = process.wait(timeout=LIMIT)
    os.close(master)
    return code, shown.decode()


def test_progress():
    """progress is drawn on a terminal, at most ten times a second, without colours, and cleared"""
    write_scene(duration=1)
    start = time.monotonic()
    code, shown = terminal("run", "scene.json")
    seconds = time.monotonic() - start
    equal(code, 0, shown)
    drawn = re.findall(r"\[[#.]+\]", shown)
    assert 1 <= len(drawn) <= 2 + 10 * seconds, (len(drawn), seconds)
    for word in "real time", "ETA", "rejected":
        assert word in shown, shown
    # After it is cleared there is only the warning that backward Euler dissipates this small sheet's energy.
    assert "\x1b" not in shown and re.search(r"\r +\r(warning: [^\r\n]+\r\n)?$", shown), repr(shown)


# ---- info, check, list


def test_info():
    """info shows what is modelled: values, defaults, ignored keys, costs"""
    write_scene(integrator={"dt": 0.01, "linear_solver": "dense"})
    text = good("info", "scene.json")
    for word in ("young_modulus", "100000 Pa", "membrane_stiffness", "flexural", "dt_min", "(default)", "corner", "dense"):
        assert (word in text) == (word != "corner"), word
    assert re.search(r"^  dt +0\.01 s$", text, re.M), text
    found = json.loads(good("info", "scene.json", "--json"))
    equal((found["nodes"], found["dofs"], found["frames"]), (16, 42, 4))
    material = found["cloths"][0]["material"]
    assert abs(material["membrane_stiffness"] - 100) < 1e-9
    assert abs(material["flexural_rigidity"] / (1e5 * 1e-9 / 12 / (1 - 1 / 9)) - 1) < 1e-12
    terms = {term["name"]: term for term in found["terms"]}
    equal(list(terms), ["stretch.edge", "bend.hinge", "damp.kelvin_voigt", "gravity"])
    equal((terms["stretch.edge"]["elements"], terms["bend.hinge"]["elements"]), (33, 21))
    equal(terms["damp.kelvin_voigt"]["acts_on"], 54)
    equal(terms["gravity"]["nonzeros"], 0)
    equal(terms["bend.hinge"]["nonzeros"], found["nnz"])
    assert found["integrator"]["parameters"]["tolerance"] == {"value": "3e-4 of the load of each node", "unit": "N", "default": True}
    weight = 9.81 * found["cloths"][0]["mass"] / found["nodes"]
    assert 1e-4 < found["tolerance"] / weight < 1e-3 # 3e-4 of the load of a free node
    assert found["integrator"]["parameters"]["dt"]["default"] is False
    assert found["iteration"]["factored"] and found["iteration"]["factor_s"] > 0
    equal(found["bytes"]["total"], sum(v for k, v in found["bytes"].items() if k not in ("total", "a_node")))


def test_info_names_nothing_absent():
    """info of a scene without bending does not say hinge"""
    write_scene(terms=["stretch.edge"])
    for args in ([], ["--json"]):
        assert "hinge" not in good("info", "scene.json", *args).lower()
    write_scene()
    assert "hinge" in good("info", "scene.json")


def test_info_of_odd_scenes():
    """info and check work on scenes without terms, without gravity, without free nodes, and with several cloths"""
    for changes in ({"terms": []}, {"terms": [], "gravity": [0, 0, 0]}, {"pins": [{"box": [[-9, -9, -9], [9, 9, 9]]}]},
                    {"cloth": [scene(name=name)["cloth"][0] for name in ("a", "b")]},
                    {"pins": [{"row": 0, "track": [[0, [0, 0, 0]], [1, [0, 1, 0]]]}]}):
        write_scene(**changes)
        for verb in "info", "check", "run":
            good(verb, "scene.json")
        json.loads(good("info", "scene.json", "--json"))


def test_check():
    """check compares every term and the assembled Jacobian"""
    write_scene(terms=["stretch.edge", "bend.hinge", {"type": "damp.kelvin_voigt", "beta": 1e-3},
                       {"type": "drag.viscous", "coefficient": 1}])
    text = good("check", "scene.json")
    for word in "stretch.edge", "bend.hinge", "damp.kelvin_voigt", "drag.viscous", "gravity", "assembled":
        assert re.search(rf"^{word} .* ok$", text, re.M), text
    assert re.search(r"^\d+ passed, 0 failed$", text, re.M), text
    assert good("check", "scene.json", "--seed", "2") != text


def test_check_run():
    """check of a run counts, in each frame, what passes through the cloth, with colliders where they are at that time"""
    # A sheet of pinned nodes, 0.3 m from the origin towards +x and -z; the corner of a small cube sticks 1 mm through one triangle of it, 0.06 m
    # across, where no sample of that triangle is; within two frames it goes down by 0.04 m, and is through no longer from the first of these on.
    cube = {"type": "box", "name": "cube", "center": [0.11, 1e-3 - 0.005 * 3 ** 0.5, -0.105], "size": 0.01,
            "rotate": [1, 0, -1, math.degrees(math.acos(3 ** -0.5))], "track": [[0, [0, 0, 0]], [0.02, [0, -0.04, 0]]]}
    grid = {"grid": "square", "columns": 6, "rows": 6, "width": 0.3, "height": 0.3}
    write_scene(mesh=grid, pins=[{"box": [[-1, -1, -1], [1, 1, 1]]}], colliders=[cube], duration=0.05, frame_rate=100)
    good("run", "scene.json", "--out", "out", "--format", "npy")
    result = drape("check", "out")
    equal(result.returncode, 1, result.stderr)
    first, last = result.stdout.splitlines()
    assert re.match(r"frame 0, t=0: 1 triangles reach into cube, up to 0\.000577 m deep; 3 edge-face intersections$", first), first
    assert last.startswith("6 frames, 1 with intersections; the most in frame 0;"), last
    equal(read_json("out/summary.json")["inside"][0], {"triangles": 0, "deepest": 0, "intersections": 0}, "at the end")
    good("run", "scene.json", "--out", "clear", "--format", "npy", "--set", "/colliders/0/center=[0.11, -0.1, -0.105]")
    equal(good("check", "clear"), "6 frames, 0 with intersections\n", "a cube below")
    # Two sheets that cross each other.
    whole = scene(mesh=grid, pins=[{"box": [[-1, -1, -1], [1, 1, 1]]}], duration=0.05, frame_rate=100)
    turned = {**whole["cloth"][0], "name": "turned", "mesh": {**grid, "transform": {"rotate": [1, 0, 0, 50], "translate": [0.01, -0.093, -0.02]}}}
    write_scene(cloth=[whole["cloth"][0], turned], duration=0.05, frame_rate=100)
    text = good("run", "scene.json", "--out", "two", "--format", "npy")
    count = int(re.search(r"^crossed +(\d+) edge-face intersections of the cloth with itself$", text, re.M).group(1))
    equal(read_json("two/summary.json")["intersections"], count, "in the summary")
    result = drape("check", "two")
    equal(result.returncode, 1, result.stderr)
    equal(len(re.findall(rf"^frame \d, t=0\.?\d*: {count} edge-face intersections of the cloth with itself; the first: edge ", result.stdout, re.M)), 6, result.stdout)
    with open("clear/positions.npy", "r+b") as file:
        file.seek(-8, os.SEEK_END)
        file.write(struct.pack("<d", math.nan))
    result = drape("check", "clear")
    equal(result.returncode, 1, result)
    assert "frame 5 has a position that is not finite" in result.stderr, result
    refused("check", "out", "--dt", "0.1", says="finished run")
    refused("check", "out", "--seed", "3", says="finished run")
    os.mkdir("empty")
    refused("check", "empty", says="empty")


def test_scene_of_springs():
    """the scene in docs/springs.md is checked, described and run, below its strain limit"""
    with open(os.path.join(SOURCES, "docs", "springs.md"), encoding="utf-8") as file:
        block = re.search(r"^```json\n(.*?)^```", file.read(), re.S | re.M).group(1)
    write_text("scene.json", block)
    text = good("info", "scene.json")
    for count, word in (480, "structural"), (450, "shear"), (448, "bend"):
        assert re.search(rf"^  spring\.{word} +cloth0 +{count} ", text, re.M), text
        assert re.search(rf"^  spring\.{word}\n(    .*\n)*    element +spring\n(    .*\n)*    stiffness +20 N/m\n", text, re.M), text
    assert re.search(r"^  limit\.strain +cloth0 +1378 ", text, re.M), text
    assert re.search(r"^  limit\.strain\n(    .*\n)*    limit +[0-9.]+", text, re.M), text
    text = good("check", "scene.json")
    for word in r"spring\.structural", r"spring\.shear", r"spring\.bend", r"limit\.strain", "assembled":
        assert re.search(rf"^{word} .* ok$", text, re.M), text
    good("run", "scene.json", "--out", "springs", "--duration", "0.5")
    summary = read_json("springs/summary.json")
    assert 0.05 < summary["strain"]["max"] < 0.1 and summary["energy"]["dissipated"] > 0, summary


def test_list():
    """list shows every entry, one table or one entry; every line of a Markdown table has the same number of cells"""
    text = good("list")
    for word in ("equilateral", "stretch.edge", "be", "halving", "klu", "dense", "npy", "young_modulus", "required"):
        assert word in text, word
    assert "klu" not in good("list", "terms") and "bend.hinge" in good("list", "terms")
    assert "stretch.edge" not in good("list", "bend.hinge")
    rows = [line for line in good("list", "--markdown").splitlines() if line.startswith("|")]
    assert len(rows) > 40, rows
    for line in rows:
        assert line.replace("\\|", "").count("|") in (4, 6, 7), line


def test_list_of_keys():
    """list shows the keys of a scene, object by object, with the values that each takes; every key of the schema is there"""
    text = good("list", "scene")
    for part in (r"\n  cloth +/cloth/N\n", r"\n  mesh +/cloth/N/mesh; exactly one of grid, file\n", r"\n    duration +simulated time\n"
                 r" +a number in \(0, 1e9\] s; required\n", r"one of: top-left, top-right", r"\n    row +a row of a grid, from 0, by ascending column\n +an integer in \[0, 2147483647\]\n"):
        assert re.search(part, text), (part, text)
    equal(re.findall(r"^  (\S+)", good("list", "pin"), re.M), ["pin"])
    assert text == good("list")[:len(text)]
    refused("list", "clot", says='did you mean "cloth"?')
    refused("list", "NOSUCH", says='there is no table or entry "NOSUCH"; the tables are scene, ')
    shown = set(re.findall(r"^\| `[^|]*` \| `([^`]*)`", good("list", "--markdown"), re.M))
    for row in [row.split(" ... ") for row in shown if " ... " in row]:  # fraction_2 ... fraction_4
        first, last = (int(name[-1]) for name in row)
        shown |= {f"{row[0][:-1]}{n}" for n in range(first, last + 1)}
    wanted = set()

    def collect(part):
        for key, value in part.get("properties", {}).items():
            wanted.add(key)
            collect(value)
        for value in [*filter(None, [part.get("items")]), *part.get("anyOf", [])]:
            collect(value)
    collect(json.loads(good("list", "--schema")))
    assert len(wanted) > 100 and wanted <= shown, wanted - shown


def test_every_key_is_everywhere():
    """every key of a scene is in list, schema and info, with the same default"""
    def forms(part):
        return [part] + [form for one in part.get("anyOf", []) for form in forms(one)]

    def schema_of(part, pointer):
        for step in pointer.strip("/").split("/"):
            part = part["items"] if step == "N" else next(form["properties"][step] for form in forms(part) if step in form.get("properties", {}))
        return part

    write_scene(colliders=[{"type": "plane", "point": [0, 0, 0], "normal": [0, 1, 0]}], events=[{"type": "height", "height": -1}])
    schema, found, seen = json.loads(good("list", "--schema")), json.loads(good("info", "scene.json", "--json")), set()
    objects = {"/": found, "/output": found, "/cloth/N": found["cloths"][0], "/cloth/N/mesh/transform": found["cloths"][0]["mesh"]["transform"],
               "/colliders/N": found["colliders"][0], "/events/N": found["events"][0]}
    table = good("list", "--markdown").split("\n### ")[0]
    rows = re.findall(r"^\| (`/.*?`) \| `(.*?)` \|(.*?) \|(.*?) \|(.*?) \| (.*) \|$", table, re.M)
    assert len(rows) > 80, rows
    for place, name, unit, default, takes, what in [(one, *row[1:]) for row in rows for one in re.findall(r"`(.*?)`", row[0])]:
        entry = schema_of(schema, f"{place}/{name}")
        assert takes and what, (place, name)
        assert "const" in entry or (what in entry["description"] and unit.strip() in entry["description"]), (place, name, entry)
        if "default" not in entry:
            continue
        usual = entry["default"]
        if usual == ["npy"]:  # a list of one text
            usual = usual[0]
        equal(default.strip(' "') if isinstance(usual, str) else json.loads(default), usual, (place, name))
        if place in objects:
            seen.add(name)
            assert name in objects[place], (place, name)
    assert {"gravity", "frame_rate", "friction", "translate", "up", "formats", "velocity", "action", "once"} <= seen, seen


def test_info_of_pins():
    """info shows every pin with its nodes and what carries it, masses and the start, with each key that a scene may give them"""
    pins = [{"nodes": [0, 1], "attach": "rigid", "clamp": True}, {"nodes": [2], "attach": "soft"}, {"nodes": [3], "attach": "soft", "triangle": 1},
            {"nodes": [4], "normal": [0, 1, 0]}, {"nodes": [5], "axis": [1, 0, 0]},
            {"nodes": [6, 7], "name": "wheel", "track": [[0, [0, 0, 0]], [1, [0, 0, 1]]],
             "turns": [{"time": 0, "rotate": [0, 1, 0, 0]}, {"time": 1, "quaternion": [0.8, 0, 0.6, 0]}]}]
    masses = [{"corner": "top-left", "add": 0.01}, {"box": [[-9, -9, -9], [9, 9, 9]], "mass": 0.5}, {"nodes": [15], "add": 1}]
    start = {"folds": [{"point": [0.2, 0, 0], "axis": [0, 0, 1], "side": [1, 0, 0], "radius": 0.02}], "spin": [0, 1, 0]}
    rest = [[0, -5, 0], [1, -5, 0], [0, -5, 1], [0, -6, 0]]
    faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    write_text("soft.obj", "".join("v {} {} {}\n".format(*x) for x in rest) + "".join("f {} {} {}\n".format(*(i + 1 for i in f)) for f in faces))
    head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (2, 4, 3), }".ljust(117) + b"\n"
    with open("soft.npy", "wb") as file:
        file.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + 2 * struct.pack("<12d", *(c for x in rest for c in x)))
    cloth = scene(pins=pins)["cloth"]
    cloth[0].update(masses=masses, start=start)
    write_scene(cloth=cloth, colliders=[
        {"type": "box", "name": "rigid", "center": [0, 5, 0], "size": 0.05},
        {"type": "animated_mesh", "name": "soft", "file": "soft.npy", "mesh": "soft.obj", "frame_rate": 10}])
    found = json.loads(good("info", "scene.json", "--json"))["cloths"][0]
    shown = {pin["name"]: pin for pin in found["pins"]}
    equal(list(shown), ["pin0", "pin1", "pin2", "pin3", "pin4", "wheel"])
    equal((shown["pin0"]["nodes"], shown["pin0"]["attach"], shown["pin0"]["clamp"], "triangles" in shown["pin0"]), ([0, 1], "rigid", True, False))
    assert shown["pin1"]["attach"] == "soft" and 0 <= shown["pin1"]["triangles"][0] < 4, shown["pin1"]
    equal(shown["pin2"]["triangles"], [1])
    equal((shown["pin3"]["normal"], shown["pin4"]["axis"]), ([0, 1, 0], [1, 0, 0]))
    equal((shown["wheel"]["track"], shown["wheel"]["turns"], len(shown["wheel"]["pivot"])), (pins[-1]["track"], pins[-1]["turns"], 3))
    equal(found["masses"], masses)
    equal((found["start"]["spin"], found["start"]["folds"]), ([0, 1, 0], [{**start["folds"][0], "angle": 180}]))
    words = good("info", "scene.json")
    for part in (r"\n      pin2\n(        .*\n)*        attach +soft\n(        .*\n)*        triangles +\[1\]\n",
                 r"\n      wheel\n(        .*\n)*        turns +\[\{time 0 s, .*0\.8", r"\n        pivot +\[.*\] m\n",
                 r"\n    masses +\[\{corner top-left, add 0\.01 kg\}, ", r"\n    start\n(      .*\n)*      spin +\[0, 1, 0\] rad/s\n"):
        assert re.search(part, words), (part, words)
    write_scene(pins=[])
    found = json.loads(good("info", "scene.json", "--json"))["cloths"][0]
    assert not {"pins", "masses", "start"} & set(found), found


def test_info_of_contact():
    """info shows colliders and contact if they are modelled, and how many nodes start inside"""
    write_scene()
    for words in good("info", "scene.json"), good("info", "scene.json", "--json"):
        assert "collider" not in words and "contact" not in words, words
    write_scene(colliders=[{"type": "plane", "name": "floor", "point": [0, 0, 0], "normal": [0, 3, 0], "friction": 0.5},
                           {"type": "box", "center": [0, 0, 0], "size": 0.05, "track": [[0, [0, 0, 0]], [2, [0, 1, 0]]]},
                           {"type": "mesh", "file": "tetrahedron.obj", "translate": [0, 5, 0]}],
                self_contact={"thickness": 0.002}, contact={"friction_velocity": 0.01}, histories=[{"name": "pull", "times": [0, 1], "values": [0, 0.5]}])
    write_text("tetrahedron.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 4 3\nf 1 2 4\nf 2 3 4\n")
    words = good("info", "scene.json")
    for part in (r"\ncolliders\n  floor\n    type +plane\n", r"  normal +\[0, 3, 0\]\n", r"  friction +0\.5\n", r"\n  collider1\n    type +box\n",
                 r"  size +\[0\.05, 0\.05, 0\.05\] m\n", r"  track +\[\[0, \[0, 0, 0\]\], \[2, \[0, 1, 0\]\]\]\n", r"  file +tetrahedron\.obj\n",
                 r"\n    nodes_inside +1\n", r"\nhistories\n  pull\n    times +\[0, 1\]\n", r"\ncontact\n +distance +0\.001 m \(default\)", r"thickness +0\.002 m\n"):
        assert re.search(part, words), (part, words)
    found = json.loads(good("info", "scene.json", "--json"))
    floor, box, mesh = found["colliders"]
    equal((floor["name"], floor["type"], floor["friction"], floor["nodes_inside"]), ("floor", "plane", 0.5, 0))
    equal(floor["parameters"]["normal"], {"value": [0, 3, 0], "unit": "1", "default": False})
    equal((box["name"], box["points"], box["segments"], box["nodes_inside"]), ("collider1", 8, 12, 1))
    equal(box["track"], [[0, [0, 0, 0]], [2, [0, 1, 0]]])
    equal((mesh["parameters"]["file"]["value"], mesh["triangles"]), ("tetrahedron.obj", 4))
    equal(mesh["parameters"]["scale"], {"value": [1, 1, 1], "unit": "1", "default": True})
    # 2 times 0.2 kg/m2 times 9.81 m/s2 times the diagonal of 0.35 m by 3 rows of sqrt(3)/2 0.1 m, over 1e-3 m
    assert abs(found["contact"]["stiffness"]["value"] - 0.2 * (2 * 9.81 * 0.19 ** 0.5 + 0.5 ** 2) / 1e-3) < 1e-6, found["contact"]
    equal((found["contact"]["distance"]["default"], found["contact"]["friction"]["value"]), (True, "implicit"))
    equal(found["self_contact"], {"thickness": {"value": 0.002, "unit": "m", "default": False},
                                  "friction": {"value": 0, "unit": "1", "default": True},
                                  "restitution": {"value": 0, "unit": "1", "default": True}})
    found = json.loads(good("info", "scene.json", "--json", "--integrator", "verlet"))  # verlet moves nodes instead of applying contact forces
    equal(("contact" in found, list(found["self_contact"])), (False, ["thickness"]))


# ---- The schema


def validator():
    try:
        from jsonschema import Draft202012Validator  # pylint: disable=import-outside-toplevel
    except ImportError as error:
        raise Skip("python3-jsonschema is not here") from error
    schema = json.loads(good("list", "--schema"))
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def variants():
    """Scenes, each with whether the schema and the reader accept it."""
    yield True, scene()
    yield True, scene(description="a remark", gravity=[0, 0, 0], controller={"type": "fixed"}, output={"formats": ["ply"]})
    yield True, scene(mesh={"grid": "square", "columns": 3, "rows": 4, "width": 1, "height": 1, "orientation": "vertical",
                            "transform": {"scale": 2, "rotate": [0, 1, 0, 90], "translate": [0, 0, 1]}})
    yield True, scene(pins=[{"nodes": [0, 3]}, {"row": 1}, {"edge": "top"}, {"box": [[0, 0, 0], [1, 1, 1]]},
                            {"nodes": [15], "track": [[0, [0, 0, 0]], [1, [0, 1, 0]]]}])
    yield True, scene(integrator={"method": "be", "norm": "l2", "max_iterations": 6})
    ball = {"type": "sphere", "center": [0, -5, 0], "radius": 1}
    for more in ({}, {"friction": 0}, {"friction": 1000, "name": "b", "track": [[0, [0, 0, 0]], [1, [0, 1, 0]]]}):
        yield True, scene(colliders=[{**ball, **more}])
    for more in ({"radius": 0}, {"radius": "1"}, {"center": [0, 0]}, {"center": 0}, {"center": [0, "0", 0]}, {"center": [0, 0, 1e10]},
                 {"friction": -1}, {"friction": 1001}, {"name": ""}, {"type": "shpere"}, {"size": 1}, {"track": [[0, [0, 0]]]}):
        yield False, scene(colliders=[{**ball, **more}])
    box = {"type": "box", "center": [0, -5, 0], "size": [1, 2, 3]}
    for more in ({}, {"size": 2}, {"rotate": [0, 90, 0]}, {"rotate": [0, 1, 0, 90], "rounding": 0.1}):
        yield True, scene(colliders=[{**box, **more}])
    for more in ({"size": 0}, {"size": [1, 2]}, {"size": [1, 0, 1]}, {"rotate": 90}, {"rotate": [0, 90]}, {"rounding": -1}):
        yield False, scene(colliders=[{**box, **more}])
    yield True, scene(colliders=[{"type": "plane", "point": [0, -1, 0], "normal": [0, 2, 0]},
                                 {"type": "capsule", "a": [0, -5, 0], "b": [0, -6, 0], "radius": 0.1},
                                 {"type": "cylinder", "a": [0, -5, 0], "b": [0, -6, 0], "radius": 0.1}])
    yield False, scene(colliders=["plane"])
    yield False, scene(colliders=[{"type": "plane", "point": [0, -1, 0]}])
    yield False, scene(colliders=[{"type": "mesh"}])
    yield False, scene(colliders=[{"type": "mesh", "file": ""}])
    yield True, scene(self_contact={"thickness": 0.001, "friction": 0.2}, contact={"stiffness": 10, "friction": "lagged"})
    yield True, scene(contact={})
    yield False, scene(self_contact={})
    yield False, scene(self_contact={"thickness": 0})
    yield False, scene(contact={"distance": 0})
    yield False, scene(contact={"friction": 0.5})
    fall = {"type": "height", "height": -1}
    for more in ({}, {"name": "a", "cloth": "sheet", "direction": "up", "action": "stop", "once": True}, {"action": "release", "pins": "pin0"}, {"node": 3}):
        yield True, scene(events=[{**fall, **more}])
    yield True, scene(events=[{"type": "plane", "normal": [0, 2, 0]}, {"type": "energy", "of": "total", "bound": 0}, {"type": "pin_force", "limit": 1}])
    for more in ({"height": "1"}, {"type": "heigth"}, {"action": "explode"}, {"direction": 1}, {"once": "maybe"}, {"bound": 1}, {"name": ""}, {"node": 1.5}):
        yield False, scene(events=[{**fall, **more}])
    yield False, scene(events=[{"type": "pin_force"}])
    yield False, scene(events=fall)
    yield False, scene(drape=2)
    yield False, scene(duration=0)
    yield False, scene(duration="5")
    yield False, scene(gravty=[0, 0, 0])
    yield False, scene(gravity=[0, 0])
    yield False, scene(cloth=[])
    yield False, scene(terms=["stretch.egde"])
    yield False, scene(terms=["damp.kelvin_voigt", "stretch.edge"])
    yield False, scene(terms=["gravity"])
    line = {"type": "load.line", "edge": "bottom", "force": [0, -1, 0]}
    moment = {"type": "load.moment", "edge": "bottom", "moment": 1e-3}
    square = {"grid": "square", "columns": 3, "rows": 4, "width": 1, "height": 1}
    yield True, scene(mesh=square, terms=["stretch.cst", "bend.midedge", line, moment])
    yield False, scene(mesh=square, terms=["stretch.cst", {**line, "moment": 1}])
    yield False, scene(mesh=square, terms=["stretch.cst", {**moment, "force": [0, 0, 1]}])
    yield False, scene(terms=[{"type": "stretch.edge", "stiffness": "soft"}])
    yield False, scene(terms=[{"type": "stretch.edge", "max_turn": 1}])
    yield False, scene(mesh={"grid": "equilateral", "edges": 3})
    yield False, scene(mesh={"grid": "equilateral", "edges": 3.5, "edge_length": 0.1})
    yield False, scene(mesh={"grid": "equilateral", "edges": 3, "edge_length": 0.1, "rows": 2})
    yield False, scene(mesh={"file": "x.obj", "edges": 3})
    yield False, scene(mesh={"transform": {}})
    yield False, scene(material={"thickness": 1e-3, "density": 200})
    yield False, scene(material={"young_modulus": 1e5, "thickness": 1e-3})
    yield False, scene(material={"young_modulus": 1e5, "thickness": 1e-3, "density": 1, "total_mass": 1})
    yield False, scene(material={"young_modulus": 1e5, "poisson_ratio": -1, "thickness": 1e-3, "density": 200})
    fabric = {"fabric": "wang2011_denim"}
    stiff = {"young_modulus": 1e5, "thickness": 1e-3}
    for more in ({}, {"damping": "none"}, {"damping": "fabric"}, stiff, {"areal_density": 0.3}, {**stiff, "density": 200}, {"poisson_ratio": 0.1}, {"mass": "uniform"}):
        yield True, scene(material={**fabric, **more})
    for more in ({"young_modulus": 1e5}, {"thickness": 1e-3}, {"areal_density": 0.3, "total_mass": 1}, {"fabric": "denim"}, {"fabric": "none"}, {"damping": "no"}, {"damping": 0.1}):
        yield False, scene(material={**fabric, **more})
    yield True, scene(material={**stiff, "fabric": "none", "density": 200})
    yield False, scene(material={**stiff, "fabric": "none"})
    yield False, scene(pins=[{"nodes": [0], "row": 1}])
    yield False, scene(pins=[{"track": [[0, [0, 0, 0]]]}])
    yield False, scene(pins=[{"nodes": []}])
    yield False, scene(pins=[{"corner": "top"}])
    yield False, scene(pins=[{"box": [[0, 0, 0]]}])
    yield False, scene(integrator={"dt": 0})
    yield False, scene(integrator={"method": "eb"})
    yield False, scene(integrator={"max_iterations": 1.5})
    yield False, scene(controller={"type": "halving", "dt": 1})
    yield False, scene(output={"formats": ["npz"]})
    yield True, scene(output={"formats": ["vtp", "pc2", "glb"], "up": "z"})
    yield False, scene(output={"up": "x"})
    yield False, scene(output={"format": ["npy"]})


def test_schema_and_reader():
    """the schema and the reader agree on right and wrong scenes"""
    schema = validator()
    for right, one in variants():
        equal(schema.is_valid(one), right, "schema: " + json.dumps(one))
        write_json("scene.json", one)
        result = drape("info", "scene.json")
        equal(result.returncode, 0 if right else 2, json.dumps(one) + result.stderr)


def test_fabric():
    """a fabric is a whole material: woven terms take its measured stiffnesses, other terms those of an isotropic sheet with the mean stiffnesses"""
    rows = good("list", "fabrics")
    names = re.findall(r"^  (\w+) ", rows, re.M)
    assert {"wang2011_denim", "feng2022_1", "matsudaira2015_wool"} <= set(names) and "none" not in names, names
    equal(rows.count("["), len(names), "sources")
    for name in names:
        write_scene(material={"fabric": name}, terms=["stretch.cst", "bend.midedge"])
        good("run", "scene.json")
        write_scene(material={"fabric": name})
        found = json.loads(good("info", "scene.json", "--json"))["cloths"][0]["material"]
        equal(found["fabric"], name, "fabric")
        # E h and E h^3/12 are the means over warp and weft; D = B/(1 - nu^2) with the nu of the lattice, 1/3.
        assert abs(found["young_modulus"] * found["thickness"] / found["membrane_stiffness"] - 1) < 1e-9, found
        assert 1e-5 < found["thickness"] < 2e-3, found
    write_scene(material={"fabric": "wang2011_pants"})
    found = json.loads(good("info", "scene.json", "--json"))["cloths"][0]["material"]
    equal(found["tension"]["shear"], 104.759674, "what stretch.cst takes")
    assert re.search(r"\n      tension\n(        .*\n)*        shear +104\.759674 N/m\n", good("info", "scene.json"))
    assert abs(found["areal_density"] - 0.22) < 1e-12 and abs(found["flexural_rigidity"] / (125.409805e-6 / 4 * 9 / 8) - 1) < 1e-6, found
    write_scene(material={"fabric": "wang2011_pants", "damping": "nothing"})
    refused("info", "scene.json", says='"nothing" is not allowed; damping is one of: fabric, none')
    write_scene(material={"fabric": "wang2011_pants", "thickness": 1e-3})
    refused("info", "scene.json", says="/cloth/0/material: \"young_modulus\" is missing")


def test_dissipation():
    """check lists what dissipates, and warns of cloth that only the method damps; a fabric has its loss unless the scene says otherwise"""

    def losses(integrator=None, extra=None, **changes):
        write_scene(**{"integrator": integrator or {"dt": 0.01}, **(extra or {}), **changes})
        result = drape("check", "scene.json")
        equal(result.returncode, 0, result.stderr)
        lines = result.stdout.split("dissipates           by\n")[1].splitlines()
        return {line[:21].strip(): line[21:] for line in lines}, result.stderr

    woven = {"terms": ["stretch.cst", "bend.midedge"]}
    pants = {"fabric": "wang2011_pants"}
    found, said = losses(material=pants, **woven)
    equal((found, said), ({"sheet": "damp.kelvin_voigt of its fabric, beta 0.00142 s", "be": "what its steps do not resolve"}, ""), "a fabric")
    found, said = losses(material={**pants, "damping": "none"}, **woven)
    equal(found["sheet"], "nothing", "an elastic sheet")
    equal(said.count("warning: /cloth/0: only the method, be, damps the waves of sheet, so how long they last depends on its steps"), 1, said)
    found, said = losses({"method": "midpoint", "dt": 0.01}, material={**pants, "damping": "none"}, **woven)
    equal(list(found), ["sheet"], "midpoint")
    equal(said.count("warning: /cloth/0: nothing damps the waves of sheet, so they last"), 1, said)
    for damping, count in ((0, 1), (0.2, 2)):
        found, said = losses({"method": "verlet", "dt": 0.01, "damping": damping}, material={**pants, "damping": "none"}, **woven)
        equal((len(found), "the method, verlet," in said), (count, damping > 0), said)
    found, said = losses({"method": "verlet", "dt": 0.01}, material=pants, **woven)
    equal(found, {"sheet": "nothing: verlet leaves out damp.kelvin_voigt of its fabric"}, "verlet")
    equal(said.count("so they last; damp.kelvin_voigt, or the loss of its fabric under an implicit method, does"), 1, said)
    found, said = losses({"method": "static"}, material={**pants, "damping": "none"}, **woven)
    equal((found, said), ({"sheet": "nothing"}, ""), "nothing moves")
    own = ["stretch.curve", {"type": "bend.midedge", "poisson": 0, "friction": 20, "friction_curvature": 4}, {"type": "drag.viscous", "coefficient": 0.1}]
    ball = {"type": "sphere", "center": [0, -1, 0], "radius": 0.3, "friction": 0.3, "restitution": 1}
    found, said = losses(material=pants, terms=own, extra={"colliders": [ball], "self_contact": {"thickness": 1e-3}})
    equal(found, {"sheet": "bend.midedge, drag.viscous", "contact": "friction, impacts", "be": "what its steps do not resolve"}, "own losses")
    equal(said, "", "own losses")
    found, said = losses(terms=["stretch.cst", {"type": "relax.maxwell", "fraction_1": 0.1, "time_1": 1}])
    equal((found["sheet"], said), ("relax.maxwell", ""), "relaxation")


def test_cs184():
    """a scene of CS184 runs unchanged, and with another integrator from the command line"""
    pinned = json.loads(re.sub(r"//[^\n]*", "", open(SOURCES + "/examples/scenes/cs184_pinned2.json", encoding="utf-8").read()))
    pinned["cloth"].update(num_width_points=12, num_height_points=12, pinned=[[0, 0], [11, 0]])
    write_json("pinned.json", pinned)
    good("run", "pinned.json", "--duration", "0.2", "--out", "out")
    equal(read_json("out/summary.json")["steps"]["accepted"], 18)
    found = json.loads(good("info", "pinned.json", "--json"))
    equal(found["integrator"]["type"], "verlet")
    stability = found["stability"]
    assert abs(stability["substep"] - 1 / 2700) < 1e-12 and 0 < stability["share"] < 1, stability
    assert abs(stability["limit"] * stability["omega"] / 2 - 1) < 0.01, stability
    good("run", "pinned.json", "--duration", "0.1", "--integrator", "be", "--dt", "0.02", "--out", "be")
    assert "stability" not in json.loads(good("info", "pinned.json", "--integrator", "be", "--json"))
    equal(read_json("be/summary.json")["steps"]["accepted"], 5)


def test_schema_and_examples():
    """the schema accepts every example in the format of Drape, and describes every value"""
    schema = validator()
    paths = sorted(glob.glob(SOURCES + "/examples/scenes/*.json"))
    for path in paths:
        with open(path, encoding="utf-8") as file:
            text = re.sub(r'("(?:\\.|[^"\\])*")|//[^\n]*|/\*.*?\*/', lambda m: m.group(1) or " ", file.read(), flags=re.S)
        scene = json.loads(text)
        if "drape" in scene:  # scenes of other programs have other formats
            equal([error.message for error in schema.iter_errors(scene)], [], path)
        good("info", path)
    def walk(node):
        for name, value in node.get("properties", {}).items():
            assert "description" in value or "allOf" in value, name
            walk(value)
        for value in node.get("anyOf", []) + ([node["items"]] if isinstance(node.get("items"), dict) else []):
            walk(value)
    walk(schema.schema)


sys.exit(run_tests(globals()))
