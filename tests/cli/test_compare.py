#!/usr/bin/env python3
"""`drape compare`: how far two runs are apart. See program.py."""
import csv
import json
import math
import os
import shutil
import struct

from program import Skip, drape, equal, good, read_json, read_npy, refused, run_tests, scene

HEADER = 128  # bytes before the numbers of positions.npy
SHEET = {"grid": "square", "width": 0.3, "height": 0.4}  # its diagonal is 0.5 m


def run(folder, mesh=None, **changes):
    """A run of 0.1 s of a sheet of 5 x 5 nodes with frames at 0, 1/30, 2/30, 3/30 s."""
    with open("scene.json", "w", encoding="utf-8") as file:
        json.dump(scene(mesh={**SHEET, "columns": 5, "rows": 5, **(mesh or {})}, **changes), file)
    good("run", "scene.json", "--out", folder)


def copy(folder, to, changes=()):
    """A copy of a run in which numbers of positions.npy are others: (frame, node, coordinate, by)."""
    shutil.copytree(folder, to)
    nodes = read_npy(folder + "/positions.npy")[0][1]
    with open(to + "/positions.npy", "r+b") as file:
        for frame, node, axis, by in changes:
            place = HEADER + 8 * (3 * (frame * nodes + node) + axis)
            file.seek(place)
            value = struct.unpack("<d", file.read(8))[0]
            file.seek(place)
            file.write(struct.pack("<d", value + by))


def compared(*args, code=0):
    result = drape("compare", *args, "--json")
    equal(result.returncode, code, result.stderr)
    return json.loads(result.stdout)


def near(found, expected):
    """Of sums of 25 squares and differences of positions below 1 m: a hundred roundings."""
    assert abs(found - expected) <= 100 * 2**-53, (found, expected)


def test_values():
    """the verdict, JSON and the table have the distances that two runs were given"""
    run("a")
    copy("a", "b", [(1, 7, 0, 0.03), (1, 7, 2, 0.04), (2, 3, 1, 0.06), (2, 9, 1, -0.03), (2, 11, 1, 0.06)])
    rms = [0, 0.05 / 5, math.sqrt(0.06**2 * 2 + 0.03**2) / 5, 0]  # of 25 nodes
    furthest = [(0, 0), (7, 0.05), (3, 0.06), (0, 0)]  # of equal ones the first
    times = [0, 1 / 30, 2 / 30, 0.1]
    shape, x = read_npy("a/positions.npy")
    equal(shape, (4, 25, 3))
    whole = compared("a", "b", "--out", "table.csv")
    cloth, = whole["cloth"]
    near(cloth["diagonal"], 0.5)
    with open("table.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    equal((len(rows), len(cloth["frames"])), (4, 4))
    for i, (frame, row) in enumerate(zip(cloth["frames"], rows)):
        near(frame["t"], times[i])
        near(frame["rms"], rms[i])
        near(frame["share"], rms[i] / 0.5)
        near(frame["distance"], furthest[i][1])
        equal(frame["node"], furthest[i][0])
        equal(frame["a"], list(x[3 * (25 * i + frame["node"]):][:3]))
        equal([float(row[key]) for key in ("t", "rms", "share", "distance", "node")], [frame[key] for key in ("t", "rms", "share", "distance", "node")])
        equal([float(row[f"{axis}_{of}"]) for of in "ab" for axis in "xyz"], frame["a"] + frame["b"])
        equal(row["cloth"], "sheet")
    largest = cloth["largest"]
    near(largest["b"][1] - largest["a"][1], 0.06)
    equal((largest["rms"], largest["rms_t"], largest["node"], largest["t"]), (cloth["frames"][2]["rms"], times[2], 3, times[2]))
    equal([whole[of][key] for of in "ab" for key in ("run", "nodes", "frames", "end", "completed")], ["a", 25, 4, 0.1, True, "b", 25, 4, 0.1, True])
    equal((whole["nodes_of"], whole["material_coordinates"], whole["gap"]), ("a", False, 0))
    first, second, *more = good("compare", "a/", "b").split("\n")
    assert first.startswith("sheet: RMS 18 mm, 3.6 % of its diagonal of 500 mm, at t=0.0666667 s; worst node 3: 60 mm at t=0.0666667 s, at ("), first
    equal((second, more), ("4 frames from t=0 s to 0.1 s, of 4 in a/ and 4 in b", [""]))
    assert good("compare", "a", "a").startswith("sheet: all nodes at the same places\n")


def test_within():
    """--within: exit code 1 if runs are further apart, in every unit; a run that is not complete, or goes on, is not within anything"""
    run("a")
    copy("a", "b", [(1, 7, 0, 0.05)])  # RMS 10 mm, .02 of the diagonal
    for bound in "10.1mm", "10.1 mm", "1.01cm", "0.0101 m", "1.01e-2m", "10100um", "2.02e-2", "2.02%", ".5 m":
        good("compare", "a", "b", "--within", bound)
    for bound in "9.9mm", "0.99 cm", "9.9e-3m", "9900 um", "1.98e-2", "1.98 %", "1e-300":
        result = drape("compare", "a", "b", "--within", bound)
        equal((result.returncode, result.stdout.count("\n")), (1, 2), bound)
        assert result.stderr.startswith(f"drape compare: --within {bound}: sheet is 10 mm apart (RMS) at t=0.0333333 s, more than "), result.stderr
    for bound in "0", "-1mm", "1", "100%", "1 inch", "1mm ", "mm", "", "nan", "inf m", "1e-400", "1e400m", "0x", "1,5mm":
        refused("compare", "a", "b", f"--within={bound}", says="--within ")
    os.rename("b/summary.json", "summary.json")
    equal(compared("a", "b", "--within", "90%", code=1)["b"]["completed"], False)
    assert "\nb may be incomplete: it has no summary.json" in good("compare", "a", "b")
    summary = read_json("summary.json")
    with open("b/summary.json", "w", encoding="utf-8") as file:
        json.dump({**summary, "status": "e_step_too_small", "message": "t=0.05 h=1e-9: too small"}, file)
    assert "\nb did not complete: t=0.05 h=1e-9: too small; its last frame is at t=0.1 s" in good("compare", "a", "b")
    equal(drape("compare", "a", "b", "--within", "90%").returncode, 1)
    run("short", duration=1 / 15)
    assert "3 frames from t=0 s to 0.0666667 s, of 3 in short and 4 in a" in good("compare", "short", "a")
    result = drape("compare", "short", "a", "--within", "90%")
    equal((result.returncode, result.stderr), (1, "drape compare: --within: a is compared until t=0.0666667 s only, and goes on until t=0.1 s\n"))


def test_times():
    """frames are compared at the times that both runs have"""
    run("a")
    run("b", frame_rate=90)
    cloth, = compared("a", "b")["cloth"]
    equal([frame["rms"] for frame in cloth["frames"]], [0] * 4)  # frames do not change the steps
    run("c", frame_rate=40, duration=0.09)
    says = refused("compare", "a", "c", says="a/energy.csv, c/energy.csv: no frame but the first is at a time of both")
    assert "the first run has 4 until t=0.1 s, the second 5 until t=0.09 s" in says, says


def test_meshes():
    """meshes of other triangles are compared by material points: 0 apart at the start, by the same numbers in both directions"""
    run("a")
    run("fine", {"columns": 9, "rows": 9})
    run("other", {"diagonals": "parallel"})
    for fine in "fine", "other":
        forth, back = compared("a", fine), compared(fine, "a")
        frames, reverse = forth["cloth"][0]["frames"], back["cloth"][0]["frames"]
        # weights of the triangle of the same corner are exact; its height has a rounding of the mesh, 1e-17 m
        assert frames[0]["distance"] < 1e-16 and frames[3]["rms"] > 1e-5, frames
        if fine == "fine":
            equal((forth["nodes_of"], back["nodes_of"]), ("a", "b"))
            equal([(frame["rms"], frame["node"], frame["a"], frame["b"]) for frame in frames],
                  [(frame["rms"], frame["node"], frame["b"], frame["a"]) for frame in reverse])
        assert forth["material_coordinates"], fine
    assert "\nthe meshes differ: compared are the 25 nodes of a\n" in good("compare", "fine", "a")
    # node r 5 + c of the coarse mesh is node 2 r 9 + 2 c of the fine one
    last, (_, x), (_, y) = frames_of("a", "fine"), read_npy("a/positions.npy"), read_npy("fine/positions.npy")
    squares = [(x[3 * (75 + 5 * r + c) + k] - y[3 * (243 + 18 * r + 2 * c) + k])**2 for r in range(5) for c in range(5) for k in range(3)]
    near(last[3]["rms"], math.sqrt(sum(squares) / 25))
    run("wide", {"width": 0.32})
    assert "\nat rest the meshes are up to 20 mm apart\n" in good("compare", "a", "wide")
    run("large", {"width": 0.4})
    refused("compare", "a", "large", says='a/scene.json, large/scene.json: cloth "sheet": at rest the meshes are 0.1 m apart')
    run("renamed", name="flag")
    refused("compare", "a", "renamed", says='cloth 0 is "sheet" in the first and "flag" in the second')
    with open("scene.json", encoding="utf-8") as file:
        two = json.load(file)
    two["cloth"] *= 2
    two["cloth"][1] = {**two["cloth"][1], "name": "second"}
    with open("two.json", "w", encoding="utf-8") as file:
        json.dump(two, file)
    good("run", "two.json", "--out", "two")
    refused("compare", "two", "a", says="two/scene.json, a/scene.json: the first has 2 cloths, the second 1")
    copy("two", "moved", [(1, 30, 0, 0.1)])  # node 5 of the second cloth
    equal(good("compare", "two", "moved").split(" at t=")[:2], ["flag: all nodes at the same places\nsecond: RMS 20 mm, 4 % of its diagonal of 500 mm,",
                                                                "0.0333333 s; worst node 30: 100 mm"])


def frames_of(*runs):
    return compared(*runs)["cloth"][0]["frames"]


def test_refused():
    """what is no run, or broken, is refused with one line, and writes nothing"""
    run("a")
    copy("a", "nan", [(2, 5, 1, math.nan)])
    copy("a", "short")
    os.truncate("short/positions.npy", HEADER + 24 * 25 * 3 + 7)
    copy("a", "table")
    with open("table/energy.csv", "w", encoding="utf-8") as file:
        file.write("frame,t\n0,0\n1,nan\n")
    copy("a", "json")
    with open("json/summary.json", "w", encoding="utf-8") as file:
        file.write("{")
    os.mkdir("empty")
    for args, says in ((("a",), "one run is given, a; two are compared"),
                       (("a", "a", "a"), "at most 2 arguments"),
                       (("a", "empty"), '"empty" is not the folder of a run'),
                       (("scene.json", "a"), '"scene.json" is not the folder of a run'),
                       (("nowhere", "a"), '"nowhere" is not the folder of a run'),
                       (("a", "nan"), '"nan/positions.npy": frame 2 has a position that is not finite'),
                       (("a", "short"), '"short/positions.npy": it has no frame, or less data than its header says'),
                       (("a", "table"), '"table": energy.csv has no time in row 2'),
                       (("a", "a", "--out", "a/energy.csv"), '"a/energy.csv" would be replaced'),
                       (("a", "a", "--image", "x.jpg"), '--image "x.jpg": '),
                       (("a", "a", "--dt", "1"), "no option")):
        refused("compare", *args, says=says)
    refused("compare", "a", "nan", "--out", "table.csv", says="not finite")
    assert "may be incomplete" in good("compare", "a", "json")
    result = drape("compare", "a", "a", "--out", "nowhere/x.csv")
    equal((result.returncode, result.stdout), (1, ""), result.stderr)


def test_picture():
    """--image draws the distances; a build that does not draw says so in one line"""
    run("a")
    copy("a", "b", [(1, 7, 0, 0.03)])
    for other, name in ("a", "same.png"), ("b", "apart.png"):
        result = drape("compare", "a", other, "--image", name)
        if result.returncode and not os.path.exists(name):
            equal((result.stdout, result.stderr.count("\n")), ("", 1), result.stderr)
            raise Skip(result.stderr.strip())
        equal((result.returncode, result.stdout.count("\n"), result.stderr), (0, 2, ""))
    data = [open(name, "rb").read() for name in ("same.png", "apart.png")]
    for picture in data:
        equal((picture[:8], picture[12:16], struct.unpack(">II", picture[16:24])), (b"\x89PNG\r\n\x1a\n", b"IHDR", (1280, 720)))
    assert data[0] != data[1]
    assert compared("a", "b", "--image", "again.png")["nodes_of"] == "a"  # nothing else on stdout


if __name__ == "__main__":
    raise SystemExit(run_tests(globals()))
