#!/usr/bin/env python3
"""test_shortage.py: verbs in which one allocation fails, of Drape or of a library. Either exit code 1 and one line of message, or all that the
verb prints and writes is as without the failure. The suite takes some of the allocations, DRAPE_ALL all of them.
Output is TAP.
"""
import os
import re
import shutil
import subprocess

from program import LIMIT, PROGRAM, Skip, counted, equal, good, meddling, run_tests, without_warnings, write_scene

SAMPLE = 40  # allocations of one command
# Words and their order, without what differs from one call to the next: numbers, which are times, "-" for a time too short to be measured, and checksums.
NUMBERS = re.compile(rb"\b[0-9a-f]{16,}\b|[-+]?\b[0-9]+(\.[0-9]+)?(e[-+]?[0-9]+)?\b")


def words(data):
    return re.sub(rb"[ #]+", b" ", re.sub(rb" -(?= )", b" ", NUMBERS.sub(b"#", data)))


def call(args, number, out):
    for path in out:
        shutil.rmtree(path, ignore_errors=True)
        if os.path.exists(path):
            os.remove(path)
    env = meddling(fail=number, count="" if number else "count")
    return subprocess.run([PROGRAM, *args], capture_output=True, timeout=LIMIT, env=env)


def written(out):
    """Contents of the files below out, but the manifest, whose lines are checksums."""
    names = [path for path in out if os.path.isfile(path)]
    names += [os.path.join(path, name) for top in out for path, _, files in os.walk(top) for name in files if name != "manifest.jsonl"]
    contents = {}
    for name in names:
        with open(name, "rb") as file:
            contents[name] = words(file.read()) if name.endswith((".json", ".csv", ".html")) else file.read()
    return contents


def check(*args, out=("out",)):
    """Another part of the allocations for each command: a stride that no loop of the program has."""
    whole = call(args, 0, out)
    equal(whole.returncode, 0, f"{args}: {whole.stderr}")
    files = written(out)
    count = counted()[0]
    stride = 1 if os.environ.get("DRAPE_ALL") else max(1, count // SAMPLE)
    first = 1 + sum(map(ord, "".join(args))) % stride
    failed = 0
    for number in range(first, count + 1, stride):
        result = call(args, number, out)
        what = f"{' '.join(args)}, allocation {number} of {count}: {result.returncode}, {result.stderr!r}"
        if result.returncode:
            failed += 1
            equal(result.returncode, 1, what)
            line = without_warnings(result.stderr.decode())
            assert re.fullmatch(r"[^\n]*([Mm]emory)[^\n]*\n", line), what
        else:
            equal(words(result.stdout), words(whole.stdout), what)
            equal(without_warnings(result.stderr.decode()), without_warnings(whole.stderr.decode()), what)
            equal(written(out), files, what)
    assert count < 10 or failed > 0, f"{' '.join(args)}: nothing failed"


def test_integrators():
    """run: every family of solvers"""
    body = {"type": "sphere", "center": [0, -0.5, 0], "radius": 0.1}
    for method in ("be", "ida", "dirk", "newton_k", "verlet", "radau", "rosenbrock"):
        integrator = {"method": method} if method in ("ida", "dirk", "radau", "rosenbrock") else {"method": method, "dt": 0.01}
        write_scene(integrator=integrator, duration=0.02, colliders=[body], contact={"distance": 0.01})
        check("run", "scene.json", "--out", "out", "--format", "obj")


def test_formats():
    """run: every format"""
    write_scene(duration=0.02)
    check("run", "scene.json", "--out", "out", "--format", "npy,obj,ply,vtp,pc2,glb,usd")


def test_static():
    """run: an equilibrium"""
    write_scene(integrator={"method": "static"})
    check("run", "scene.json", "--out", "out", "--format", "npy")


def test_reading():
    """check, info, list"""
    write_scene()
    for args in (["check", "scene.json"], ["info", "scene.json"], ["info", "scene.json", "--json"], ["info", "scene.json", "--set", "/duration=+.5"],
                 ["list"], ["list", "--schema"], ["--help"], ["--version"]):
        check(*args)


def test_report():
    """report, compare"""
    write_scene()
    good("run", "scene.json", "--out", "run", "--format", "npy")
    check("report", "run", "--out", "page.html", out=("page.html",))
    write_scene(mesh={"grid": "equilateral", "edges": 4, "edge_length": 0.075})
    good("run", "scene.json", "--out", "other", "--format", "npy")
    check("compare", "run", "other", "--out", "table.csv", out=("table.csv",))
    check("compare", "run", "run", "--json")


def test_lab():
    """validate, modes, path"""
    if not re.search(r"^ +validate ", good("--help"), re.M):
        raise Skip("this build has no experiments")
    write_scene()
    for args in (["validate", "free_fall", "--json"], ["modes", "scene.json"], ["modes", "scene.json", "--json"], ["modes", "scene.json", "--out", "out"]):
        check(*args)


raise SystemExit(run_tests(globals()))
