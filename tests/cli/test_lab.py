#!/usr/bin/env python3
"""The experiments of the program: tradeoff, stability, converge, merge; and validate. See program.py."""
import csv
import glob
import math
import os
import re
import shlex
import shutil
import signal
import struct
import subprocess
import sys

import json

from figure import Figure
from program import PROGRAM, SOURCES, calls_of, claim, drape, equal, good, meddled, read_json, read_npy, refused, run_tests, scene, text_of, wait_for, write_json, write_scene, write_text

AXES = ["--axis", "/integrator/dt=1e-3:1e-1:3log", "--axis", "/cloth/0/material/young_modulus=1e4:1e6:2log"]


def lines(folder):
    """{case: result} of all lines of a folder, without values that differ between two runs."""
    results = {}
    for path in glob.glob(folder + "/cases*.jsonl"):
        with open(path, encoding="utf-8") as file:
            for line in file:
                result = json.loads(line)
                for key in ("cpu_s", "cpu_most_s", "wall_s", "case_cpu_s"):
                    del result[key]
                results[result["case"]] = result
    return results


def page_is_alone(path):
    """Checks that the page has pictures and loads nothing from elsewhere."""
    text = text_of(path)
    assert "<figure><img" in text, "no picture"
    equal(re.findall(r'(?:src|href)="(?!data:)[^"]*"', text), [], "what the page wants from elsewhere")
    return text


def distances(x, y):
    """Of each frame the RMS distance, the furthest node and its distance."""
    for a, b in zip(x, y):
        apart = [math.dist(a[i:i + 3], b[i:i + 3]) for i in range(0, len(a), 3)]
        yield math.sqrt(sum(d * d for d in apart) / len(apart)), apart.index(max(apart)), max(apart)


def test_tradeoff():
    """tradeoff opens with a method and its command, which runs that case; errors are the largest of all frames, with the worst node, where and when"""
    write_scene(duration=0.3)
    out = good("tradeoff", "scene.json", "--out", "t", "--duration", "1/5", "--set", "/description=it's short")
    results = lines("t")
    equal({result["tags"]["series"] for result in results.values()}, {"newton_k", "bdf2", "rosenbrock"}, "methods")
    assert out.startswith("For 1 % of the size (") and "RMS over the nodes of sheet at t=" in out, out
    assert re.search(r" takes [\d.]+ \([\d.]+ to [\d.]+\) times as much", out), out
    # The commands are pasted into a shell. Frames lie at k / 30 s, the reference has the end, too, which is the last one.
    size, references = 8 * 48, []
    for family in "rosenbrock", "radau":
        with open(f"t/reference-{family}.f64", "rb") as file:
            data = file.read()
        references.append([struct.unpack("<48d", data[i:i + size]) for i in range(0, len(data), size)])
    commands = re.findall(r"^    (drape run .*)$", out, re.M)
    assert commands and all("--integrator" in command for command in commands), out
    for k, command in enumerate(commands):
        printed = subprocess.run(command.replace("drape", shlex.quote(PROGRAM), 1) + f" --out r{k} --format npy", shell=True, capture_output=True, text=True, check=True).stdout
        words = shlex.split(command)
        level = float(words[-1].split("=")[-1]) if "rtol" in words[-1] else 1 / int(words[-1][2:])
        case, = (r for r in results.values() if r["tags"]["integrator"] == words[4] and abs(r["tags"]["value"] / level - 1) < 1e-12)
        assert f"{case['accepted']} accepted" in printed, (command, printed)
        (_, nodes, _), x = read_npy(f"r{k}/positions.npy")
        # The same bits as of the case, beside the reference that was chosen; sums of 48 squares are rounded.
        known = []
        for reference in references:
            found = list(distances([x[i:i + 3 * nodes] for i in range(0, len(x), 3 * nodes)], reference))
            far = max(found, key=lambda f: f[2])
            known.append((max(found)[0], far[2], found.index(max(found)) / 30, found.index(far) / 30, far[1]))
        keys = ("error_m", "worst_m", "error_t_s", "worst_t_s", "worst_node")
        assert any(all(abs(case[key] - value) <= 1e-12 for key, value in zip(keys, one)) for one in known), (case, known)
        assert case["error_cloth"] == "sheet" and abs(case["error"] * case["diagonal_m"] - case["error_m"]) < 1e-12, case
        # Without a difference of the families beyond their estimates, the error is the smaller one of these.
        assert case["reference_error"] >= min(read_json(f"t/reference-{family}.json")["error"] for family in ("rosenbrock", "radau")) * (1 - 1e-12), case
    # Order 1: from 1/60 s on each halving of dt takes the error to less than 0.7 of it.
    cases = sorted((r["tags"]["value"], r["error"]) for r in results.values() if r["tags"]["series"] == "newton_k")
    assert all(fine < 0.7 * coarse for (_, fine), (dt, coarse) in zip(cases, cases[1:]) if dt < 0.02), cases
    with open("t/results.csv", encoding="utf-8") as file:
        equal(len(file.read().splitlines()), len(results) + 1, "rows of results.csv")
    page = page_is_alone("t/report.html")
    # The sentence, its command, the figure, and only then the rest.
    places = [page.index(text) for text in ("<p>For 1 %", "<pre>drape run", "<figure><img", "The reference's error", "All cases")]
    equal(places, sorted(places), "order of the page")


def test_tradeoff_in_steps():
    """another call in the same folder asks for other methods and values, and keeps the reference and the cases that are done"""
    write_scene()
    command = ["tradeoff", "scene.json", "--repeats", "1", "--out", "t"]
    good(*command, "--dt", "1/30,1/60,1/120", "--integrators", "newton_k,bdf2")
    first, references = text_of("t/cases.jsonl"), [text_of(name) for name in sorted(glob.glob("t/reference-*.json"))]
    equal(len(first.splitlines()), 6, "cases")
    # Fewer: nothing runs, and the lines of the others stay.
    out = good(*command, "--dt", "1/60", "--integrators", "bdf2")
    assert "1 of 1 cases done" in out and "newton_k" not in out, out
    equal(sorted(json.loads(line)["cpu_s"] for line in text_of("t/cases.jsonl").splitlines()), sorted(json.loads(line)["cpu_s"] for line in first.splitlines()), "lines")
    # More: only be and rosenbrock run.
    out = good(*command, "--dt", "1/30,1/60,1/120", "--set", "/integrator/rtol=1e-3,1e-4", "--integrators", "be,bdf2,newton_k,rosenbrock")
    equal([text_of(name) for name in sorted(glob.glob("t/reference-*.json"))], references, "reference")
    now, before = ([json.loads(line) for line in text.splitlines()] for text in (text_of("t/cases.jsonl"), first))
    equal(len(now), 11, "cases")
    for old in before:
        new, = (r for r in now if r["tags"] == old["tags"])
        equal({**new, "case": 0}, {**old, "case": 0}, "a case that was done")
    # In shards, which share a folder, cases do not change; neither does a scene.
    refused(*command, "--dt", "1/30", "--integrators", "be", "--shard", "1/2", says="holds another experiment")
    for shard in "1/2", "2/2":
        good(*command[:-1], "parts", "--dt", "1/30,1/60", "--integrators", "be,bdf2", "--shard", shard)
    assert "4 of 4 cases done; 0 of them" in good("merge", "parts", "--out", "whole") and page_is_alone("whole/report.html")
    write_scene(duration=0.2)
    refused(*command, "--dt", "1/30", "--integrators", "be", says="holds another experiment, or this one of another scene or version")
    for name, values in (("--dt", "1/0"), ("--dt", "1/60,"), ("--dt", "a/b"), ("--dt", "-1/60"), ("--dt", "1/60 1/30")):
        refused(*command[:-1], "n", f"{name}={values}", says=f'/integrator/dt = "{values}": must be numbers above 0, at most 1, separated by commas, such as')
    write_scene(accuracy="1mm")
    refused(*command[:-1], "n", says="scene.json: /accuracy: an accuracy chooses the method")


def test_stability():
    """stability separates clean from exploded cases at the explicit stability limit"""
    write_scene(duration=0.5)
    good("stability", "scene.json", *AXES, "--integrators", "be,verlet", "--out", "s")
    by_row = {}
    for result in lines("s").values():
        by_row.setdefault(result["tags"]["integrator"], []).append(result)
    equal(sorted(by_row), ["be", "verlet"], "rows")
    assert all(result["status"] == "ok" for result in by_row["be"]), by_row["be"]
    for result in by_row["verlet"]:
        dt, limit = result["tags"]["/integrator/dt"], result["explicit_limit_s"]
        if dt > 4 * limit or dt < 0.5 * limit:
            equal(result["status"] == "ok", dt < limit, f"verlet at dt {dt}, limit {limit}")
    assert any(result["status"] == "ok" for result in by_row["verlet"]), "none is below the limit"
    assert any(result["status"] != "ok" for result in by_row["verlet"]), "none is above the limit"
    assert "exploded" in page_is_alone("s/report.html")


def test_one_axis():
    """stability over a single axis draws all integrators in one figure, and does not call a run of a few steps stable"""
    write_scene(duration=0.3)
    out = good("stability", "scene.json", "--axis", "/integrator/dt=1e-3:3e-1:6log", "--integrators", "be,verlet", "--out", "s")
    steps = {r["tags"]["/integrator/dt"]: r["accepted"] for r in lines("s").values() if r["tags"]["integrator"] == "be"}
    few = sum(count < 20 for count in steps.values())
    assert 0 < few < 6 and 1 in steps.values(), steps
    assert f"be: {6 - few} none rejected, {few} fewer than 20 steps\n" in out, out
    assert Figure("s/map.svg").has("fewer than 20 steps")
    equal(sorted(glob.glob("s/map_*")), [], "maps")
    page_is_alone("s/report.html")


def test_results_in_figures():
    """figures of stability show any result by name: curves over one axis, maps over two; other results need no run"""
    write_scene(duration=0.3)
    one = ["stability", "scene.json", "--axis", "/integrator/dt=1e-3:3e-1:6log", "--integrators", "be,verlet", "--out", "s"]
    good(*one)
    equal(sorted(os.path.basename(path) for path in glob.glob("s/*.svg")), ["curve_energy_drift.svg", "map.svg"], "figures of one axis")
    # A curve for each method; open markers where it took fewer than 20 steps, a row of crosses for verlet where it exploded.
    figure, by_method = Figure("s/curve_energy_drift.svg"), {}
    for result in lines("s").values():
        by_method.setdefault(result["tags"]["integrator"], []).append(result)
    few = [r for r in by_method["be"] if r["accepted"] < 20]
    failed = [r for r in by_method["verlet"] if r["status"] != "ok"]
    assert few and failed and len(few) < 6 and len(failed) < 6, (few, failed)
    left, top, right, bottom = figure.frame()
    of_be = [(y, shape[2]) for x, y, shape, colour in figure.markers if colour == (0, 114, 178) and left <= x <= right and top <= y <= bottom]
    equal((len(of_be), sum(not filled for _, filled in of_be)), (6, len(few)), "markers of be, open ones")
    equal(sum(shape[0] == 2 for x, y, shape, _ in figure.markers if left <= x <= right and top <= y <= bottom), len(failed), "crosses")
    for text in ("fewer than 20 steps", "stopped or exploded"):
        assert figure.has(text), text
    heights = sorted(y for y, _ in of_be)
    drifts = sorted((math.log(abs(r["energy_drift"])) for r in by_method["be"]), reverse=True)
    for h, d in zip(heights, drifts):
        along = (h - heights[0]) / (heights[-1] - heights[0])
        assert abs(drifts[0] + along * (drifts[-1] - drifts[0]) - d) < 0.02, (heights, drifts)
    # Other results are drawn from the same lines.
    with open("s/cases.jsonl", encoding="utf-8") as file:
        before = sorted(file.read().splitlines())
    good(*one, "--results", "iterations_per_step,strain_max")
    with open("s/cases.jsonl", encoding="utf-8") as file:
        equal(sorted(file.read().splitlines()) == before, True, "the same lines, with their CPU times")
    equal(read_json("s/experiment.json")["results"], ["iterations_per_step", "strain_max"], "results of the experiment")
    assert os.path.exists("s/curve_strain_max.svg") and os.path.exists("s/curve_iterations_per_step.svg")
    # Over two axes, also of shards that are merged: one scale for all maps, hatches over what was too short to be judged.
    two = ["stability", "scene.json", *AXES, "--integrators", "be,verlet", "--results", "energy_drift"]
    for shard in ("1/2", "2/2"):
        good(*two, "--shard", shard, "--out", "parts")
    good("merge", "parts", "--out", "m")
    scales, hatched = set(), False
    for name in ("be", "verlet"):
        figure = Figure(f"m/map_{name}_energy_drift.svg")
        below = figure.frame()[3] + 30 # the numbers of the scale
        scales.add(tuple((one.text, round(one.boxes[0][0])) for one in figure.texts if one.boxes[0][1] > below and re.match("10-?\\d", one.text)))
        hatched |= any(a[0] != b[0] and a[1] != b[1] and stroke in ((0, 0, 0), (255, 255, 255)) for a, b, stroke, _ in figure.lines)
    equal((len(scales), hatched), (1, True), f"scales {scales}, hatches")
    refused("stability", "scene.json", *AXES, "--results", "energy_drif", "--out", "x", says='did you mean "energy_drift"')
    # Every name is a column of results.csv.
    names = refused("stability", "scene.json", *AXES, "--results", "?", "--out", "x", says="there are").split("there are ")[1]
    with open("m/results.csv", encoding="utf-8") as file:
        columns = file.readline().strip().split(",")
    missing = [name for name in re.findall(r"\w+", names) if name not in columns]
    equal(missing, [], f"columns {columns}")


def test_short_runs_are_hatched():
    """runs of fewer than 20 steps are hatched, whatever else is said of them; those over budget are named with the budget"""
    write_scene(duration=0.3)
    good("stability", "scene.json", "--axis", "/integrator/dt=1e-3:3e-1:6log", "--axis", "/cloth/0/material/young_modulus=1e2:1e5:2log",
         "--integrators", "be", "--strain-limit", "1e-6", "--out", "s")
    figure, found = Figure("s/map_be.svg"), lines("s").values()
    assert all(r["strain_max"] > 1e-6 for r in found), found
    short = {r["tags"]["/integrator/dt"] for r in found if r["accepted"] < 20}
    assert short and figure.has("unphysical strain") and figure.has("fewer than 20 steps")
    # The boxes that are hatched begin where the first of these cells does, half a step below its dt.
    left, _, right, bottom = figure.frame()
    hatch = min(x for a, b, stroke, _ in figure.lines if stroke == (0, 0, 0) and a[0] != b[0] and a[1] != b[1] and a[1] < bottom for x in (a[0], b[0]))
    wanted = left + (right - left) * math.log(min(short) / 1e-3, 300) * 5 / 6
    assert abs(hatch - wanted) < 0.1, (hatch, wanted)
    write_scene(duration=1000)
    good("stability", "scene.json", "--axis", "/cloth/0/material/density=100:200:2", "--integrators", "be", "--case-seconds", "0.05", "--out", "late")
    assert Figure("late/map.svg").has("over budget (0.05 s)")


def test_curves_without_values():
    """curves of runs without values are drawn as markers that say why, and each integrator is in the legend"""
    write_scene(duration=0.1)
    axis = ("--axis", "/integrator/dt=1e-3:1e-2:3log")
    for name, reason, options in (("explicit_limit_s", "no value", ("--results", "explicit_limit_s")),
                                  ("energy_drift", "over budget (1e-09 s)", ("--results", "energy_drift", "--case-seconds", "1e-9"))):
        good("stability", "scene.json", *axis, "--integrators", "be,bdf2", *options, "--out", name)
        figure = Figure(f"{name}/curve_{name}.svg")
        for text in (reason, "be", "bdf2"):
            assert figure.has(text), (text, [one.text for one in figure.texts])
        assert not any(one.boxes[0][2] < figure.frame()[0] and re.search(r"\d", one.text) for one in figure.texts), "no numbers"


def test_plan():
    """a plan runs a part of the cases, spread over all, and scales their costs up by integrator; the whole run keeps them"""
    write_scene()
    command = ["stability", "scene.json", "--axis", "/integrator/dt=1e-3:1e-1:20log", "--axis", "/cloth/0/material/young_modulus=1e4:1e6:10log",
               "--integrators", "be,verlet", "--out", "s"]
    out = good(*command, "--plan", "40")
    assert "plan      from 40 of 400 cases" in out and "report" not in out, out
    sample = lines("s")
    equal(len(sample), 40, "cases that were run")
    # Spread evenly: half of them are of each integrator up to one, no more than 4 in any of 20 equal parts of the numbers, which would have 2 each.
    equal(abs(sum(r["tags"]["integrator"] == "be" for r in sample.values()) - 20) <= 1, True, "cases of be")
    equal(max(sum(i // 20 == part for i in sample) for part in range(20)) <= 4, True, sorted(sample))
    # Costs that are known give totals that are known, without an interval as they do not scatter: 200 x 2 s + 200 x 1/4 s.
    with open("s/cases.jsonl", encoding="utf-8") as file:
        cases = [json.loads(line) for line in file]
    for case in cases:
        case["case_cpu_s"] = 2 if case["tags"]["integrator"] == "be" else 0.25
    write_text("s/cases.jsonl", "".join(json.dumps(case) + "\n" for case in cases))
    claim("s", "cases.jsonl")
    good(*command, "--plan", "40", "--jobs", "1")
    plan = read_json("s/plan.json")
    for key, value in (("cases", 400), ("sampled", 40), ("cpu_s", 450), ("cpu_low_s", 450), ("cpu_high_s", 450), ("elapsed_s", 450), ("jobs", 1)):
        assert abs(plan[key] / value - 1) < 1e-5, (key, plan)
    equal(lines("s"), sample, "the sample of a second plan")
    # The whole run continues, and is as large as was planned: lines differ by the digits of their numbers.
    good(*command)
    found = lines("s")
    equal(len(found), 400, "cases of the whole run")
    equal({i: found[i] for i in sample}, sample, "cases of the plan")
    size = sum(os.path.getsize("s/" + name) for name in ("experiment.json", "cases.jsonl", "results.csv"))
    assert abs(plan["disk_bytes"] / size - 1) < 0.1, (plan, size)
    # So says a plan in the folder of the whole run, which has more cases than the sample.
    good(*command, "--plan", "40")
    assert abs(read_json("s/plan.json")["disk_bytes"] / size - 1) < 0.1, (read_json("s/plan.json"), size)
    assert plan["memory_bytes"] > 1e6, plan
    # A plan of more cases than there are runs all; other experiments have plans, too.
    out = good("converge", "scene.json", "--integrators", "be", "--levels", "3", "--plan", "100", "--out", "c")
    assert "plan      from 3 of 3 cases" in out and not os.path.exists("c/report.html"), out
    out = good("tradeoff", "scene.json", "--integrators", "be,ida", "--plan", "4", "--shard", "1/2", "--out", "t")
    assert "plan      from 4 of " in out, out
    refused("converge", "scene.json", "--plan", "0", "--out", "d", says="--plan")


def test_message_over_budget():
    """a case that takes more than its CPU time says so"""
    write_scene(duration=1000)
    out = good("stability", "scene.json", "--axis", "/cloth/0/material/density=100:200:2", "--integrators", "be", "--case-seconds", "0.05", "--out", "s")
    for result in lines("s").values():
        equal(result["status"], "over_budget", "status")
        assert re.fullmatch(r"t=\S+: its budget of 0.05 s of CPU time was used up", result["message"]), result["message"]
    assert "be: 2 over budget" in out, out


def test_budget():
    """tradeoff runs cheap cases first, names those that its budget leaves out, whose cells are blank, and continues with them"""
    write_scene(duration=0.3)
    command = ["tradeoff", "scene.json", "--integrators", "be,verlet,trbdf2", "--repeats", "1", "--out", "t"]
    good(*command, "--budget", "none")
    everything = lines("t")
    order = [json.loads(line)["tags"] for line in text_of("t/cases.jsonl").splitlines()]
    equal(len(order), 3 * 7, "cases")
    # The coarse steps of each integrator come before the fine ones, explicit ones after the others.
    equal([(tags["series"], round(1 / tags["value"])) for tags in order[:9]],
          [("be", 30), ("be", 60), ("trbdf2", 30), ("trbdf2", 60), ("verlet", 30), ("verlet", 60), ("be", 120), ("trbdf2", 120), ("verlet", 120)], "order")
    # A budget that ends after the reference: the rest is named and the report is made.
    os.mkdir("b")
    for name in ("manifest.jsonl", "experiment.json", "reference-radau.json", "reference-radau.f64", "reference-rosenbrock.json", "reference-rosenbrock.f64"):
        shutil.copy("t/" + name, "b/" + name)
    with open("t/cases.jsonl", encoding="utf-8") as file, open("b/cases.jsonl", "w", encoding="utf-8") as part:
        part.writelines(file.readlines()[:9])
    claim("b", "cases.jsonl")
    out = good(*command[:-1], "b", "--budget", "1e-7")
    assert out.startswith("For 1 % of the size"), out
    assert "9 of 21 cases done" in out and "12 of 21 cases were left out, as the budget of 1e-07 minutes" in out, out
    assert "be (4 of 7), verlet (4 of 7), trbdf2 (4 of 7)" in out and "report    b/report.html" in out, out
    page = page_is_alone("b/report.html")
    rows = [re.findall("<td>([^<]*)</td>", row) for row in re.findall("<tr>(.*?)</tr>", page.split("All cases")[1])]
    equal([set(row[3:]) for row in rows if row and row[2] == "not run"], 12 * [{""}], "cells of what was not run")
    equal(len(lines("b")), 9, "cases that ran")
    good(*command[:-1], "b", "--budget", "none")
    equal(lines("b"), everything, "results after the rest has run")
    refused("tradeoff", "scene.json", "--budget", "0", "--out", "n", says="--budget \"0\": must be minutes, above 0, or none")


def test_axis_completes_the_scene():
    """a scene may lack a value that an axis gives it"""
    whole = scene()
    del whole["cloth"][0]["material"]["density"]
    write_json("scene.json", whole)
    command = ["stability", "scene.json", "--axis", "/cloth/0/material/density=100:200:2", "--integrators", "be", "--out", "s"]
    good(*command)
    good(*command)
    equal([r["status"] for r in lines("s").values()], ["ok", "ok"], "cases")


def test_ignored_axis():
    """an integrator that ignores an axis runs once along it"""
    write_scene()
    good("stability", "scene.json", *AXES, "--integrators", "ida", "--out", "s")
    equal(len(lines("s")), 2, "cases that were run")
    with open("s/results.csv", encoding="utf-8") as file:
        equal(len(file.read().splitlines()), 7, "rows of results.csv")


def test_converge():
    """converge finds the orders of the integrators"""
    write_scene(duration=0.3)
    out = good("converge", "scene.json", "--integrators", "be,bdf2,trbdf2", "--levels", "7", "--out", "c")
    orders = dict(re.findall(r"^(\w+): order .*, ([\d.]+) at the last refinement", out, re.M))
    # At the last of 7 refinements (dt 1/3840 s) the next term of the error is about dt / 0.01 s of the leading one.
    for integrator, order in (("be", 1), ("bdf2", 2), ("trbdf2", 2)):
        assert abs(float(orders[integrator]) - order) < 0.1, out
    page_is_alone("c/report.html")
    # ida chooses its order with rtol: no line is fitted across that, for any limit of the order.
    out = good("converge", "scene.json", "--integrators", "ida", "--levels", "5", "--out", "ida")
    equal(re.findall(r"^(ida.*): no order, as it chooses its order", out, re.M), ["ida, order 2", "ida, order 5"], "series")
    out = good("converge", "scene.json", "--integrators", "ida", "--levels", "4", "--set", "/integrator/max_order=3", "--out", "three")
    equal(re.findall(r"^(ida.*): no order", out, re.M), ["ida"], "series at an order that the user chose")
    # The order of dirk depends on rtol, too, unless it is given.
    out = good("converge", "scene.json", "--integrators", "dirk", "--levels", "5", "--out", "dirk")
    assert re.search(r"^dirk: no order, as it chooses its order.* a value of /integrator/order fixes it", out, re.M), out
    assert os.path.exists("dirk/converge_rtol.svg")
    out = good("converge", "scene.json", "--integrators", "dirk", "--levels", "4", "--set", "/integrator/order=3", "--out", "fixed")
    assert re.search(r"^dirk: change proportional to rtol", out, re.M), out
    # A method of one order has a slope over rtol, which is not called an order.
    out = good("converge", "scene.json", "--integrators", "rosenbrock", "--levels", "5", "--out", "ros")
    assert re.search(r"^rosenbrock: change proportional to rtol\^[\d.]+ \(95 % confidence", out, re.M) and "order" not in out, out
    # Unless they are fixed, verlet takes as many substeps as its stability limit needs, and dt does not refine them.
    out = good("converge", "scene.json", "--integrators", "verlet", "--levels", "4", "--out", "v")
    assert "verlet: no order, as it chooses its own substeps" in out, out
    out = good("converge", "scene.json", "--integrators", "verlet", "--levels", "4", "--set", "/integrator/substeps=64", "--out", "w")
    assert re.search(r"^verlet: order (1\.9|2)", out, re.M), out
    out = good("converge", "scene.json", "--integrators", "verlet", "--levels", "4", "--set", "/integrator/substeps=1", "--out", "x")
    assert "steps were rejected and cut, so dt was not halved everywhere" in out, out
    # Within a second folds grow and the refinements do not converge: the output says so, and only then.
    for duration, uncertain in ((0.3, False), (1, True)):
        write_scene(duration=duration)
        out = good("converge", "scene.json", "--integrators", "midpoint", "--levels", "6", "--out", f"i{duration}")
        equal("the order is not determined" in out, uncertain, out)


def test_one_order_is_fitted():
    """converge fits a line through the finest refinements of one order, and says how many; a merge of changed lines shows it"""
    write_scene(duration=0.3)
    command = ["converge", "scene.json", "--integrators", "be", "--levels", "7", "--out", "c"]
    good(*command)
    # The ends of the runs are replaced: they move by 4^-k from dt 1/60/2^k on for k < 3, then by 2^-k.
    moves = [1, 1 / 4, 1 / 16, 1 / 32, 1 / 64, 1 / 128]
    with open("c/cases.jsonl", encoding="utf-8") as file:
        cases = [json.loads(line) for line in file]
    for case in cases:
        at = sum(moves[:case["case"]])
        case["positions"] = [at] * len(case["positions"])
    write_text("c/cases.jsonl", "".join(json.dumps(case) + "\n" for case in cases))
    claim("c", "cases.jsonl")
    out = good(*command)
    assert "be: order 1 in dt" in out and "of the last 4 of 6 refinements, as the order of the others is another one" in out, out
    figure = Figure("c/converge_dt.svg")
    left, top, right, bottom = figure.frame()
    on_plot = [shape[2] for x, y, shape, _ in figure.markers if left < x < right and top < y < bottom]
    equal((on_plot.count(True), on_plot.count(False)), (4, 2), "fitted and other refinements")
    assert figure.has("be (1.00)") and figure.has("not fitted"), [one.text for one in figure.texts]


def test_converge_in_space():
    """converge subdivides meshes of any kind"""
    write_text("sheet.obj", "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n")
    for more, sizes in ({}, [16, 49, 169]), ({"mesh": {"file": "sheet.obj"}, "pins": [{"nodes": [0, 1]}]}, [3, 6, 15]):
        write_scene(**more)
        out = good("converge", "scene.json", "--integrators", "be", "--levels", "3", "--space", "--out", f"c{len(more)}")
        assert re.search(r"^space: order", out, re.M), out
        equal(sorted(r["nodes"] for r in lines(f"c{len(more)}").values() if r["tags"]["series"] == "space"), sizes, "nodes")


def test_shards():
    """merged shards give the result of a single run"""
    write_scene()
    command = ["stability", "scene.json", *AXES, "--integrators", "be,bdf2,verlet"]
    good(*command, "--out", "whole")
    for i in (1, 2, 3):
        out = good(*command, "--shard", f"{i}/3", "--out", f"part{i}")
    assert "once all cases are done" in out, out
    equal(sorted(os.listdir("part1")), ["cases-1-of-3.jsonl", "experiment.json", "manifest.jsonl"], "what a shard writes: others may write beside it")
    missing = drape("merge", "part1", "part3", "--out", "some")
    equal(missing.returncode, 1, "exit code of a merge that lacks cases")
    assert "12 of 18" in missing.stdout, missing.stdout
    good("merge", "part1", "part2", "part3", "--out", "merged")
    equal(lines("merged"), lines("whole"), "results")
    page_is_alone("merged/report.html")


def merged_is(whole, folder, merged):
    """Checks that the lines and the table of the shards are those of a single run."""
    good("merge", folder, "--out", merged)
    equal(lines(merged), lines(whole), "results of " + folder)
    numbers = ("cpu_s", "cpu_most_s", "wall_s", "case_cpu_s")
    tables = []
    for name in (merged, whole):
        with open(name + "/results.csv", encoding="utf-8", newline="") as file:
            tables.append([{k: v for k, v in row.items() if k not in numbers} for row in csv.DictReader(file)])
    equal(tables[0], tables[1], "results.csv of " + folder)


def test_recipes():
    """the recipes for GNU parallel, xargs, Snakemake and a Slurm array give the result of a single run"""
    write_scene()
    command = ["stability", "scene.json", *AXES, "--integrators", "be,verlet"]
    recipes = SOURCES + "/examples/sweep/"
    good(*command, "--out", "whole")
    if shutil.which("parallel"):
        subprocess.run([recipes + "parallel", "5", PROGRAM, *command, "--out", "by_parallel"], check=True, capture_output=True)
        equal(len(glob.glob("by_parallel/cases-*-of-5.jsonl")), 5, "shards")
        merged_is("whole", "by_parallel", "merged_parallel")
    if shutil.which("snakemake"):
        subprocess.run(["snakemake", "-q", "-s", recipes + "Snakefile", "--cores", "2", "--config", "shards=3", "out=by_snakemake",
                        "command=" + shlex.join([PROGRAM, *command])], check=True, capture_output=True)
        merged_is("whole", "by_snakemake", "merged_snakemake")
    os.mkdir("bin")  # all programs that the recipe needs, except parallel
    for name in ("bash", "seq", "nproc", "xargs", "sed"):
        os.symlink(shutil.which(name), "bin/" + name)
    subprocess.run([recipes + "parallel", "5", PROGRAM, *command, "--out", "by_xargs"], check=True, capture_output=True,
                   env={**os.environ, "PATH": os.path.abspath("bin")})
    merged_is("whole", "by_xargs", "merged_xargs")
    # The variable that Slurm sets in each task of an array; tasks run in any order.
    for task in (3, 1, 2):
        subprocess.run(["bash", recipes + "array.sbatch", PROGRAM, *command, "--out", "by_array"], check=True, capture_output=True,
                       env={**os.environ, "SLURM_ARRAY_TASK_ID": str(task), "SLURM_ARRAY_TASK_COUNT": "3", "SLURM_CPUS_PER_TASK": "2"})
    merged_is("whole", "by_array", "merged_array")


def test_validate_goes_on():
    """validate --out keeps its cases and resumes after Ctrl-C"""
    good("validate", "--scenes", "scenes")
    cases = len(os.listdir("scenes")) - 1  # but for the manifest
    with subprocess.Popen([PROGRAM, "validate", "--out", "v"], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as child:
        wait_for(lambda: os.path.exists("v/cases.jsonl") and lines_there("v"), child)
        child.send_signal(signal.SIGINT)
        table, message = (text.decode() for text in child.communicate())
    equal(child.returncode, 130, "exit code")
    kept = [json.loads(line) for line in lines_there("v")]
    equal(message, f"interrupted: {len(kept)} of {cases} cases are done; the same command resumes\n", "message")
    assert table.count("pass") == len(kept) + 1, table  # and "passed" in the last line
    # Saved lines are used: a changed line shows in the table, a line of an unknown case is ignored.
    kept[0]["obtained"] = 2 * kept[0]["expected"]
    write_text("v/cases.jsonl", json.dumps(kept[0]) + "\n" + json.dumps({**kept[0], "scene_hash": "0"}) + "\n{\"name")
    claim("v", "cases.jsonl")
    result = drape("validate", "cantilever", "--json", "--out", "v") if kept[0]["name"] == "cantilever" else None
    rows = json.loads(result.stdout)
    equal((rows[0]["verdict"], result.returncode), ("fail", 1), "a line that is wrong")
    equal(rows[0]["cpu_s"], kept[0]["cpu_s"], "it was not run again")
    equal([row["verdict"] for row in rows[1:]], ["pass"] * (len(rows) - 1), "the others")


def test_reference_goes_on():
    """the reference of tradeoff is saved level by level: a run that was killed does not repeat them"""
    write_scene(duration=0.3)
    command = ["tradeoff", "scene.json", "--integrators", "be", "--repeats", "1", "--out", "t"]
    equal(meddled(*command, signal=int(signal.SIGKILL), file="reference-rosenbrock.json").returncode, -signal.SIGKILL)
    # A saved level is used unchanged: if its error is small enough there are no further levels.
    about = read_json("t/reference-rosenbrock.json")
    about["error"] = 1e-12
    write_json("t/reference-rosenbrock.json", about)
    claim("t", "reference-rosenbrock.json")
    good(*command)
    equal(read_json("t/reference-rosenbrock.json"), about, "the reference")
    # The other family shows that it is not that good.
    errors = {result["reference_error"] for result in lines("t").values()}
    assert len(errors) == 1 and min(errors) > 1e-9, errors


def without_reference(*limit, named):
    """a tradeoff that the limit leaves without a reference names it, and writes nothing; returns its command"""
    command = ["tradeoff", "scene.json", "--integrators", "be", "--repeats", "1", "--out", "t"]
    result = drape(*command, *limit)
    equal(result.returncode, 1, "exit code")
    assert f"completed 0 ({named}" in result.stderr and "What helps: a larger budget_seconds" in result.stderr, result.stderr
    assert not os.path.exists("t"), os.listdir("t")
    return command


def test_reference_over_budget():
    """a budget that ends before there is a reference is named, and the runs so far stay for a larger one"""
    write_scene()
    command = without_reference("--budget", "1e-7", named="half of budget_seconds = 6e-06")
    # A folder with one run: that of a whole call becomes the first one of rosenbrock.
    good(*command, "--budget", "none")
    about = read_json("t/reference-rosenbrock.json")
    about.update(error=None, levels=1, rtol=1e-3)
    write_json("t/reference-rosenbrock.json", about)
    for name in os.listdir("t"):
        if name not in ("manifest.jsonl", "reference-rosenbrock.json", "reference-rosenbrock.f64"):
            os.remove("t/" + name)
    claim("t", "reference-rosenbrock.json")
    result = drape(*command, "--budget", "1e-7")
    equal(result.returncode, 1, "exit code")
    assert "rosenbrock completed 1 (half of budget_seconds" in result.stderr and "The runs are kept" in result.stderr, result.stderr
    assert os.path.exists("t/reference-rosenbrock.json") and os.path.exists("t/experiment.json"), os.listdir("t")
    good(*command, "--budget", "none")
    assert read_json("t/reference-rosenbrock.json")["levels"] >= 2, "the runs went on"


def test_resume():
    """a sweep that is killed or interrupted resumes where it stopped, and ends with the same results"""
    write_scene(duration=0.3)
    command = ["stability", "scene.json", "--axis", "/integrator/dt=1e-3:1e-2:8log", "--axis",
               "/cloth/0/material/young_modulus=1e4:1e6:8log", "--integrators", "be", "--jobs", "1"]
    count, there = calls_of(*command, "--out", "whole"), 0
    for end, code, says in (signal.SIGKILL, -signal.SIGKILL, ""), (signal.SIGINT, 130, f"drape {command[0]}: interrupted\n"):
        result = meddled(*command, "--out", "part", signal=int(end), call=count // 3)
        equal((result.returncode, result.stderr), (code, says))
        assert len(lines_there("part")) > there + 3, "cases that were kept"
        there = len(lines_there("part"))
    good(*command, "--out", "part")
    equal(lines("part"), lines("whole"), "results")


def lines_there(folder):
    """The whole lines of a file that may be growing."""
    with open(folder + "/cases.jsonl", encoding="utf-8") as file:
        return [line for line in file if line.endswith("\n")]


def test_torn_line():
    """a case whose line was cut short runs again; a line that is not a result is reported"""
    write_scene()
    command = ["stability", "scene.json", *AXES, "--integrators", "be", "--out", "s"]
    good(*command)
    whole = lines("s")
    text = text_of("s/cases.jsonl")
    write_text("s/cases.jsonl", text[:-40])
    claim("s", "cases.jsonl")
    good(*command)
    equal(lines("s"), whole, "results")
    write_text("s/cases.jsonl", "{\n" + text)
    claim("s", "cases.jsonl")
    result = drape(*command)
    equal((result.returncode, result.stdout), (2, ""), result.stderr)
    assert "cases.jsonl:1: not a result" in result.stderr, result.stderr


def test_other_experiment():
    """a folder with another experiment is left alone"""
    write_scene()
    good("stability", "scene.json", *AXES, "--integrators", "be", "--out", "s")
    before = text_of("s/experiment.json")
    refused("stability", "scene.json", *AXES, "--integrators", "bdf2", "--out", "s", says="another experiment")
    write_scene(duration=0.2)
    refused("stability", "scene.json", *AXES, "--integrators", "be", "--out", "s", says="another experiment")
    equal(text_of("s/experiment.json"), before, "experiment.json")


def test_wrong_words():
    """wrong axes, integrators, shards, folders: one line each, nothing written"""
    write_scene()
    two = ["--axis", "/integrator/dt=1e-3:1e-2:2log"]
    refused("stability", "scene.json", "--out", "s", says="1 to 3 axes")
    for axis, says in (("dt=1:2:3", "a pointer is needed"), ("/integrator/dt=1:2", "three numbers"), ("/integrator/dt=1:2:3lin", "only log may follow the count"),
                       ("/integrator/dt=0:2:3log", "positive"), ("/integrator/dt=1:1:3", "different"), ("/integrator/dt=1:2:1", "2 to 1024"),
                       ("/integrator/linear_tolerance=1e-3:1e-1:3log", "has no effect any more"), ("/cloth/0/terms/0/min_length=0.1:0.2:2", "has no effect any more")):
        refused("stability", "scene.json", *two, "--axis", axis, "--out", "s", says=says)
    refused("stability", "scene.json", *two, "--axis", "/integrator/dt=1e-4:1e-3:3", "--out", "s", says="/integrator/dt\" is given twice")
    refused("stability", "scene.json", *two, "--axis", "/cloth/0/mesh/edges=2.5:7.5:3", "--out", "s", says="edges\": its value 1 would be 2.5")
    refused("stability", "scene.json", *two, "--axis", "/integrator/max_order=1.5:4.5:3", "--out", "s", says="max_order\": its value 1 would be 1.5")
    refused("stability", "scene.json", *two, "--integrators", "verlet", "--axis", "/integrator/strain_limit_iterations=1:4:3", "--out", "s", says="2.5 is not allowed")
    refused("stability", "scene.json", *two, "--axis", "/integrator/tolerancee=1:2:2", "--out", "s", says="tolerancee")
    refused("stability", "scene.json", *two, "--axis", "/cloth/0/material/density=-1:2:2", "--out", "s", says="density")
    refused("tradeoff", "scene.json", "--integrators", "bee", "--out", "s", says="did you mean")
    for verb in (["tradeoff"], ["converge"], ["stability", *AXES]):
        refused(*verb, "scene.json", "--integrators", "be,static", "--out", "s", says="no steps in time")
    refused("tradeoff", "scene.json", "--shard", "3/2", "--out", "s", says="--shard")
    refused("tradeoff", "scene.json", "--case-seconds", "0", "--out", "s", says="above 0")
    refused("tradeoff", "nowhere.json", "--out", "s", says="nowhere.json")
    for what, says in (("/cloth/0/material/density=-1", "density"), ("/duration=0", "duration"), ("/nope=1", "nope"), ("/cloth/0/mesh/edges=0", "edges")):
        for verb in ("tradeoff", "converge"):
            refused(verb, "scene.json", "--integrators", "be", "--set", what, "--out", "s", says=says)
    refused("tradeoff", "scene.json", "--controller", "error", "--out", "s", says="error")
    refused("tradeoff", "scene.json", "--integrators", "be", "--controller", "error", "--out", "s", says="error")
    for levels in ("0", "2", "13", "x"):
        refused("converge", "scene.json", "--levels", levels, "--out", "s", says="3 to 12")
    refused("merge", "nowhere", "--out", "s", says="nowhere")
    refused("merge", "--out", "s", says="DIR")


def test_settings_without_effect():
    """a setting that no case uses is refused, not ignored; one that some cases use takes effect"""
    write_scene()
    for verb, option in ((["tradeoff"], ["--integrator", "ida"]), (["tradeoff"], ["--format", "obj"]),
                         (["converge"], ["--dt", "0.01"]),
                         (["stability", *AXES], ["--dt", "0.01"]), (["stability", *AXES], ["--integrator", "be"]),
                         (["stability", *AXES], ["--set", "/cloth/0/material/young_modulus=1e5"]),
                         (["stability", *AXES, "--integrators", "ida"], ["--tolerance", "1e-3"])):
        refused(*verb, "scene.json", *option, "--out", "s", says="has no effect")
        assert not os.path.exists("s"), (verb, option)
    refused("tradeoff", "scene.json", "--threads", "2", "--out", "s", says="--jobs")
    out = good("converge", "scene.json", "--integrators", "be", "--levels", "3", "--tolerance", "1e-3", "--out", "t")
    assert "be: order" in out, out


def test_folder_that_cannot_be_made():
    """an --out that cannot be created is one line and exit code 1 in every verb, with correct input"""
    write_scene()
    good("run", "scene.json", "--out", "run")
    write_text("file", "a file\n")
    verbs = [["run", "scene.json"], ["report", "run"], ["tradeoff", "scene.json"], ["stability", "scene.json", *AXES],
             ["converge", "scene.json"], ["validate", "free_fall"]]
    for verb in verbs:
        result = drape(*verb, "--out", "file/x")
        equal(result.returncode, 1, " ".join(verb))
        assert re.fullmatch(r"[^\n]*file/x[^\n]*Not a directory\n", result.stderr), (verb, result.stderr)
    equal(drape("validate", "free_fall", "--scenes", "file/x").returncode, 1, "validate --scenes")
    equal(drape("run", "scene.json", "--summary", "file/x").returncode, 1, "run --summary")
    good("stability", "scene.json", *AXES, "--integrators", "be", "--out", "s")
    equal(drape("merge", "s", "--out", "file/x").returncode, 1, "merge")


PLATE = """{"drape": 1, "cloth": [{"mesh": {"grid": "square", "columns": 7, "rows": 7, "width": 1, "height": 1},
  "material": {"young_modulus": 1e7, "poisson_ratio": 0.3, "thickness": 0.004, "areal_density": 1},
  "terms": ["stretch.cst", "bend.midedge", {"type": "load.line", "edge": "right", "force": [-0.01, 0, 0]}],
  "pins": [{"edge": "left", "clamp": true}]}],
  "gravity": [0, 0, 0], "integrator": {"method": "static"}, "duration": 1}"""


def test_modes():
    """modes prints a table or JSON, and writes modes.csv with frames of each mode that render draws"""
    write_text("plate.json", PLATE)
    printed = json.loads(good("modes", "plate.json", "--json", "--state", "start"))
    equal([m["kind"] for m in printed["modes"]], ["vibration"] * 6, "kinds")
    out = good("modes", "plate.json", "--state", "start", "--count", "3", "--frames", "4", "--amplitude", "0.1", "--out", "m")
    equal(len(out.splitlines()), 5, "lines of the table")
    with open("m/modes.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    equal([row["first_frame"] for row in rows], ["0", "4", "8"], "first frames")
    for row, mode in zip(rows, printed["modes"]):
        assert abs(float(row["frequency"]) / mode["frequency"] - 1) < 1e-6, (row, mode)
        assert float(row["error"]) < 1e-4 and float(row["residual"]) < 1e-6, row
    with open("m/energy.csv", encoding="utf-8") as file:
        energy = [float(row["elastic"]) for row in csv.DictReader(file)]
    equal(len(energy), 12, "frames")
    # At rest the first and the third frame of a mode are the state itself; a quarter of a period later it is bent by 0.1 m.
    assert energy[0] == 0 and abs(energy[2]) < 1e-9 * energy[1] and energy[1] > 0 and energy[3] > 0, energy
    buckling = json.loads(good("modes", "plate.json", "--state", "start", "--buckling", "--count", "2", "--json"))["modes"]
    assert 0 < buckling[0]["value"] < buckling[1]["value"] and buckling[0]["kind"] == "buckling", buckling
    refused("modes", "plate.json", "--state", "middle")
    refused("modes", "plate.json", "--state", "start", "--count", "200")
    write_text("slack.json", PLATE.replace('"bend.midedge", ', ""))
    result = drape("modes", "slack.json", "--state", "start", "--out", "n")
    equal((result.returncode, os.path.exists("n")), (1, False), "modes without stiffness")
    # The free nodes of 4 x 3 have 9 motions across the sheet, none of which has stiffness: any six of them would be arbitrary. Those of 3 x 3 have six.
    for columns, expected in ((4, (1, 0, True)), (3, (0, 6, False))):
        result = drape("modes", "slack.json", "--state", "start", "--set", f"/cloth/0/mesh/columns={columns}", "--set", "/cloth/0/mesh/rows=3")
        equal((result.returncode, len(re.findall(r"\d  zero ", result.stdout)), "cannot be separated" in result.stderr),
              expected, result.stderr)


def test_path():
    """path prints a line and writes a row and a frame for each point; a branch needs one factor more"""
    with open("column.json", "w", encoding="utf-8") as file:
        file.write(PLATE.replace('"columns": 7, "rows": 7, "width": 1, "height": 1', '"columns": 17, "rows": 3, "width": 1, "height": 0.1')
                   .replace("[-0.01, 0, 0]", "[-0.12, 0, 0]"))
    out = good("path", "column.json", "--to", "2", "--branch", "-", "--node", "16", "--out", "p")
    with open("p/path.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    equal(len(out.splitlines()), len(rows) + 1, "lines")
    equal([row["point"] for row in rows], [str(i) for i in range(len(rows))], "points")
    equal((float(rows[0]["factor"]), float(rows[-1]["factor"])), (0, 2), "factors")
    equal([row["event"] for row in rows if row["event"]], ["branch"], "events")
    equal({row["unstable"] for row in rows}, {"0"}, "unstable modes")
    assert abs(float(rows[-1]["u16_z"])) + abs(float(rows[-1]["u16_y"])) > 0.3, rows[-1]
    with open("p/energy.csv", encoding="utf-8") as file:
        equal(len(list(csv.DictReader(file))), len(rows), "frames")
    straight = good("path", "column.json", "--to", "2", "--points", "40")
    assert "bifurcation" in straight, straight
    hung = good("path", "column.json", "--state", "static", "--to", "1.5")
    equal([hung.splitlines()[i].split()[1] for i in (1, -1)], ["1", "1.5"], "factors from an equilibrium")
    for wrong in (["--from", "1"], ["--to", "x"], ["--branch", "2"], ["--node", "51"], ["--state", "middle"],
                  ["--branch", "+", "--load-control"], ["--node", "3", "--node", "3"], ["--set", "/cloth/0/terms/2/force=[-1e-30, 0, 0]"]):
        refused("path", "column.json", *wrong)
    # A load that rises in time has its full value, whatever it is when the scene begins.
    point = ["--set", '/cloth/0/terms/2={"type": "load.point", "node": 33, "force": [0, 0, -1e-4]}', "--points", "3"]
    now, later = (good("path", "column.json", *point, *ramp) for ramp in ([], ["--set", "/cloth/0/terms/2/ramp=3"]))
    equal(later, now, "a load with a ramp")
    now, later = (good("modes", "column.json", *point[:2], "--set", "/cloth/0/terms/2/force=[-1e-3, 0, 0]", "--state", "start", "--buckling",
                       "--count", "1", *ramp) for ramp in ([], ["--set", "/cloth/0/terms/2/ramp=3"]))
    equal(later, now, "buckling under a load with a ramp")


def test_no_reference():
    """a tradeoff whose reference does not complete leaves no folder behind"""
    write_scene()
    command = without_reference("--budget", "1e-7", named="half of budget_seconds")
    os.mkdir("t")
    write_text("t/mine", "kept\n")
    equal(drape(*command, "--budget", "1e-7").returncode, 1, "exit code")
    equal(os.listdir("t"), ["mine"], "what was there before")
    good(*command)


def test_map_is_labelled():
    """axes of a map have units, and rejections, if any, have a scale"""
    write_scene()
    good("stability", "scene.json", *AXES, "--integrators", "be,verlet", "--out", "s")
    figure = Figure("s/map_verlet.svg")
    assert figure.has("dt [s]") and figure.has("young_modulus [Pa]"), [one.text for one in figure.texts]
    assert not any("1/10" in one.text for one in figure.texts), "rejections in the legend of a map without any"
    # The lines are changed to have rejections: the report is made from the lines alone.
    text = text_of("s/cases.jsonl")
    write_text("s/cases.jsonl", text.replace('"rejected":0', '"rejected":3'))
    claim("s", "cases.jsonl")
    good("stability", "scene.json", *AXES, "--integrators", "be,verlet", "--out", "s")
    figure = Figure("s/map_be.svg")
    # 3 rejected in 100 steps; those of 10 steps and of 1 are too short.
    for text, there in (("none rejected", False), ("up to 1/100 rejected", False), ("up to 1/10 rejected", True), ("over 1/10 rejected", False),
                        ("fewer than 20 steps", True)):
        equal(figure.has(text), there, text)


def test_over_budget():
    """cases that take too long are named with the reason, and their cells are blank"""
    write_scene(duration=2)
    out = good("tradeoff", "scene.json", "--integrators", "be", "--case-seconds", "0.05", "--out", "t", "--repeats", "1")
    late = [r for r in lines("t").values() if r["status"] == "over_budget"]
    assert late and not any("error" in r for r in late), late
    for r in late:
        assert f"be, dt 1/{1 / r['tags']['value']:.4g} s (over_budget: {r['message']})" in out, out
    page = page_is_alone("t/report.html").split("All cases")[1]
    rows = [re.findall("<td>([^<]*)</td>", row) for row in re.findall("<tr>(.*?)</tr>", page)]
    equal([set(row[3:]) for row in rows if row and row[2] == "over_budget"], len(late) * [{""}], "cells")


sys.exit(run_tests(globals()))
