#!/usr/bin/env python3
"""Files and names of strangers: what they say is data for every verb. See program.py and SECURITY.md."""
import glob
import json
import os
import re
import shutil
import signal
import sys

from figure import Figure
from program import LIMIT, SOURCES, calls_of, drape, equal, good, read_json, refused, run_tests, scene, stopped, text_of, write_json, write_scene, write_text

NAMES = {
    "newline": 'a\nsystem("touch RAN_CODE")\nb',
    "quotes": "it's \"quoted\"",
    "backquote": "`touch RAN_CODE`",
    "dollar": "$(touch RAN_CODE)",
    "pipe": "|touch RAN_CODE",
    "percent": "%n%s%100000d",
    "html": "<script>alert(1)<!--",
    "path": "../../escape",
    "escape": "\x1b[31mred\x1b]0;title\x07",
    "control": "b\u009bq\u202eq",
    "noncharacter": "a\ufffeb\U0010ffff",
    "long": "\u00e4" * 125,
}
# With each name the first group, and of the others every second one, so that each has half of the names; with DRAPE_ALL all.
VERBS = ((("check", "{scene}"), ("info", "{scene}"), ("info", "{scene}", "--json"), ("run", "{scene}", "--out", "{out}run"), ("report", "{out}run"), ("check", "{out}run"), ("compare", "{out}run", "{out}run", "--out", "{out}table.csv")),
         (("run", "{scene}", "--out", "{out}obj", "--format", "obj,vtp,gltf,usd"), ("render", "{out}run", "--out", "{out}picture.png")),
         (("run", "{scene}", "--set", "/integrator/method=static", "--out", "{out}static"), ("modes", "{scene}", "--count", "1")),
         (("stability", "{scene}", "--axis", "/integrator/dt=1e-3:1e-2:2log", "--integrators", "be", "--out", "{out}map"), ("merge", "{out}map", "--out", "{out}merged")),
         (("converge", "{scene}", "--levels", "3", "--integrators", "be", "--out", "{out}orders"),),
         (("stability", "{scene}", "--axis", "/integrator/{name}=1:2:2", "--out", "{out}axis"), ("run", "{scene}", "--set", "/cloth/0/{name}=1", "--out", "{out}key")))
TAKE_THEM = (("run", "report"), (), ("modes",), ("stability", "merge"), ("converge",), ())  # the verbs of a group that take every name
PAGES = ("run/report.html",), (), (), ("map/report.html",), ("orders/report.html",), ()
FIGURES = (), (), (), ("map/map.svg", "merged/map.svg"), ("orders/converge_dt.svg",), ()


def tree(*without):
    """The files below this folder, with size and time, but for folders of these names."""
    found = {}
    for folder, folders, files in os.walk("."):
        folders[:] = [one for one in folders if not any(one.startswith(name) for name in without)]
        for file in files:
            if any(file.startswith(name) for name in without):
                continue
            info = os.lstat(os.path.join(folder, file))
            found[os.path.join(folder, file)] = (info.st_size, info.st_mtime_ns)
    return found


def trap(folder):
    """A PATH on which each program that a shell or a plot would start leaves a trace instead."""
    os.makedirs(folder)
    for name in ("gnuplot", "sh", "touch", "env", "python3", "ffmpeg", "xdg-open", "rm", "cat"):
        write_text(f"{folder}/{name}", f"#!/bin/sh\n: >'{os.path.abspath('.')}/STARTED_{name}'\n")
        os.chmod(f"{folder}/{name}", 0o755)
    return os.path.abspath(folder)


def printable(text):
    return not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ufffe\uffff\U0010fffe\U0010ffff]", text)


def call(args, **options):
    """A call that works or is refused with one line, and prints nothing that a terminal obeys."""
    result = drape(*args, **options)
    assert result.returncode in ((0, 1, 2) if args[0] == "render" else (0, 2)), (args, result.returncode, result.stderr)
    assert printable(result.stdout) and printable(result.stderr), (args, result.stdout, result.stderr)
    if result.returncode:
        equal(len(re.sub(r"^warning: [^\n]+\n", "", result.stderr, flags=re.M).splitlines()), 1, f"lines of {args}: {result.stderr}")
    return result


def test_names():
    """names with quotes, newlines, code, HTML, paths and escapes, in every place where a name can stand, are only names"""
    environment = {**os.environ, "PATH": trap("traps"), "HOME": os.path.abspath("home")}
    os.mkdir("home")
    for number, (kind, name) in enumerate(NAMES.items()):
        groups = [k for k in range(len(VERBS)) if k == 0 or "DRAPE_ALL" in os.environ or (number + k) % 2 == 0]
        file = name.replace("/", "_")
        out = f"out_{file[:40]}_"
        temporary = os.path.abspath(f"tmp_{file}"[:200])
        os.makedirs(temporary)
        named = scene(name=name, colliders=[{"type": "sphere", "center": [0, -5, 0], "radius": 0.1, "name": name}])
        named["description"] = name
        write_json(file + ".json", named)
        before = tree("out_")
        done = [verb[0] for k in groups for verb in VERBS[k]
                if call([word.format(scene=file + ".json", out=out, name=name) for word in verb], env={**environment, "TMPDIR": temporary}).returncode == 0]
        equal(done[:3], ["check", "info", "info"], f"verbs that took {kind}")
        equal(set(done) >= {verb for k in groups for verb in TAKE_THEM[k]}, True, f"verbs that took {kind}: {done}")
        equal(tree("out_"), before, f"files outside the folders of {kind}")
        for page in (page for k in groups for page in PAGES[k]):
            text = text_of(out + page)
            assert name not in text or kind not in ("html", "newline"), (page, "unescaped")
        for figure in (figure for k in groups for figure in FIGURES[k]):
            assert len(Figure(out + figure).texts) > 4, figure
    equal(glob.glob("STARTED_*") + glob.glob("**/RAN_CODE", recursive=True), [], "programs that were started")


def test_ivp_names():
    """a scene of the test set with such a file name is run, scored and drawn, its name in the figures"""
    os.makedirs("set/references")
    environment = {**os.environ, "PATH": trap("traps")}
    for kind, name in NAMES.items():
        name = name.replace("/", "_")
        shutil.copy(SOURCES + "/examples/ivp/swing.json", f"set/{name}.json")
        for ending in ("json", "npy"):
            shutil.copy(f"{SOURCES}/examples/ivp/references/swing.{ending}", f"set/references/{name}.{ending}")
        before = tree("out")
        good("ivp", "run", f"set/{name}.json", "--integrators", "verlet", "--case-seconds", "1e-3", "--repeats", "1", "--out", f"out{kind}", env=environment)
        good("ivp", "export", f"set/{name}.json", "--out", f"out{kind}x", env=environment)
        assert call(["ivp", "score", f"set/{name}.json", f"set/references/{name}.npy"], env=environment).returncode == 0
        equal(tree("out"), before, f"files outside the folder of {kind}")
        assert "<script>" not in text_of(f"out{kind}/report.html"), kind
    equal(glob.glob("**/RAN_CODE", recursive=True) + glob.glob("STARTED*"), [], "code that ran")


def change(folder, out, edit):
    """A copy of an experiment in which edit has changed experiment.json and each line of cases.jsonl."""
    shutil.copytree(folder, out)
    about = read_json(out + "/experiment.json")
    with open(out + "/cases.jsonl", encoding="utf-8") as file:
        cases = [json.loads(line) for line in file]
    edit(about, cases)
    write_json(out + "/experiment.json", about)
    with open(out + "/cases.jsonl", "w", encoding="utf-8") as file:
        file.writelines(json.dumps(case) + "\n" for case in cases)
    return out


def tag(key, value):
    def edit(about, cases):
        for one in about["cases"] + cases:
            one["tags"][key] = value
    return edit


def test_merge():
    """an experiment of a stranger is merged, or refused with one line that says where it is wrong"""
    write_scene()
    axis = ("--axis", "/integrator/dt=1e-3:1e-2:3log")
    good("stability", "scene.json", *axis, "--integrators", "be,verlet", "--out", "map")
    good("converge", "scene.json", "--levels", "3", "--integrators", "be,bdf2", "--out", "orders")
    os.makedirs("set/references")
    for name in ("swing.json", "references/swing.json", "references/swing.npy"):
        shutil.copy(f"{SOURCES}/examples/ivp/{name}", f"set/{name}")
    good("ivp", "run", "set/swing.json", "--integrators", "be", "--case-seconds", "0.2", "--repeats", "1", "--out", "ivp")
    environment = {**os.environ, "PATH": trap("traps")}

    def moved(about, cases):  # the first case again, after the others
        about["cases"].append(about["cases"][0])
        cases.append({**cases[0], "case": len(about["cases"]) - 1})

    faults = (("map", tag("integrator", 'be\nsystem("touch RAN_CODE")\n'), "/cases/0"), ("map", tag("integrator", 7), "/cases/0: Expected string"),
              ("map", lambda about, cases: about["cases"][0].update(same_as=10**9), "/cases/0/same_as"), ("map", lambda about, cases: about["cases"][1].update(same_as=-1), "/cases/1/same_as"),
              ("map", lambda about, cases: about["cases"][2].update(same_as=2), "/cases/2/same_as"), ("map", lambda about, cases: about["cases"].pop(), "whole map"),
              ("map", tag("/integrator/dt", 0.5), "place on the axes"), ("map", lambda about, cases: about.pop("cases"), "cases"),
              ("map", lambda about, cases: about["arguments"].update(axes=[1]), "axes"), ("map", lambda about, cases: about["arguments"].update(axes=["/x=1:1e300:2000000000"]), "axis"),
              ("map", lambda about, cases: cases[1].pop("rejected"), "cases.jsonl:2"), ("map", lambda about, cases: cases[1].update(case=99), "cases.jsonl:2"),
              ("map", lambda about, cases: cases[1].update(case=-1), "cases.jsonl:2"), ("map", lambda about, cases: about.update(results=["energy"]), "energy"),
              ("map", lambda about, cases: cases[0].update(strain_max=[]), "strain_max"), ("map", tag("series", {}), "/cases/0"),
              ("map", lambda about, cases: (about.update(cases=[]), cases.clear()), "there is none"),
              ("ivp", lambda about, cases: about["arguments"].update(scenes=about["arguments"]["scenes"] * 300), "more than 256"),
              ("orders", moved, "side by side"), ("ivp", lambda about, cases: about["arguments"]["scenes"][0].update(name="a\x1b[31m"), "/arguments/scenes/0/name"),
              ("ivp", lambda about, cases: about["arguments"]["scenes"][0].update(t_s=["x"]), "t_s"))
    for number, (folder, edit, says) in enumerate(faults):
        if edit == faults[5][1]:  # the case has a result
            change(folder, f"in{number}", lambda about, cases: (about["cases"].pop(), cases.pop()))
        else:
            change(folder, f"in{number}", edit)
        refused("merge", f"in{number}", "--out", "X", says=says, env=environment)
    good("merge", change("map", "in_message", lambda about, cases: cases[0].update(message="x" * 1000)), "--out", "out_message")
    before = tree("out", "in")
    for kind, name in NAMES.items():
        def rename(about, cases, name=name):
            about["arguments"]["scenes"][0]["name"] = name
            tag("scene", name)(about, cases)
        change("ivp", f"in_{kind}", rename)
        result = call(["merge", f"in_{kind}", "--out", f"out_{kind}"], env=environment)
        if result.returncode:
            assert not printable(name) or "\n" in name, (kind, result.stderr)
            continue
        drawn = [one.text for path in glob.glob(f"out_{kind}/*.svg") for one in Figure(path).texts]
        wanted = re.sub(r"\s", "", name)[:40]
        assert any(re.sub(r"\s", "", text).startswith(wanted[:20]) for text in drawn), (kind, drawn)
        equal([path for path in glob.glob(f"out_{kind}/*") if not re.fullmatch(r"[\w.-]+", os.path.basename(path))], [], "names of files")
    before_now = tree("out", "in")
    equal(before_now, before, "files outside the folders")
    equal(glob.glob("**/RAN_CODE", recursive=True) + glob.glob("STARTED*"), [], "code that ran")


def test_names_of_files():
    """a figure whose name would leave the folder, or that is another one's when cut, is its own file within it"""
    write_scene()
    os.mkdir("files")
    write_text("files/keep_energy.svg", "mine")
    os.makedirs("set/references")
    for name in ("swing.json", "references/swing.json", "references/swing.npy"):
        shutil.copy(f"{SOURCES}/examples/ivp/{name}", f"set/{name}")
    good("ivp", "run", "set/swing.json", "--integrators", "be", "--case-seconds", "0.2", "--repeats", "1", "--out", "ivp")

    def two(about, cases):
        names = ["../files/keep", "x" * 90 + "1", "x" * 90 + "2"] + [f"scene {k}" for k in range(30)] # more than there are dashes and colours
        scenes, all_cases, all_lines = [], [], []
        for k, name in enumerate(names):
            scenes.append({**about["arguments"]["scenes"][0], "name": name, "t_s": [0.1, 0.2], "growth": [1, 2]})
            for one in about["cases"]:
                all_cases.append({**one, "tags": {**one["tags"], "scene": name}})
            for line in cases:
                all_lines.append({**line, "case": line["case"] + k * len(about["cases"]), "tags": {**line["tags"], "scene": name}})
        about["arguments"]["scenes"], about["cases"], cases[:] = scenes, all_cases, all_lines
    change("ivp", "in", two)
    good("merge", "in", "--out", "out")
    equal(text_of("files/keep_energy.svg"), "mine", "a file of the user")
    equal(sorted(os.listdir("files")), ["keep_energy.svg"], "files beside the folder")
    equal(len(glob.glob("out/*_cpu*.svg")) + len(glob.glob("out/x*.svg")) >= 3, True, os.listdir("out"))


def test_names_of_work():
    """loads whose names would be equal have names of their own in every table; a long name is whole, one of two lines is one column"""
    load = {"type": "load.point", "node": 4, "force": [0, 1e-3, 0]}
    cloth = {"mesh": {"grid": "equilateral", "edges": 3, "edge_length": 0.1}, "material": {"young_modulus": 1e5, "thickness": 1e-3, "density": 200}, "pins": [{"nodes": [0]}]}
    names = ["flag", "flag (2)", "a\nb", "\u00e4" * 200 + "1", "\u00e4" * 200 + "2"]
    write_json("works.json", {"drape": 1, "cloth": [{**cloth, "name": name, "terms": ["stretch.edge", load] + [load] * (name == "flag")} for name in names], "duration": 0.05})
    good("run", "works.json", "--out", "works")
    work = read_json("works/summary.json")["work"]
    equal(len(work), 3 + 6)
    with open("works/energy.csv", encoding="utf-8") as file:
        columns = file.readline().rstrip("\n").split(",")
    equal(columns[-9:], list(work))
    good("report", "works", "--out", "works.html")


def test_changed_mesh():
    """an experiment goes on only with the meshes that it began with, in one folder, in shards, and while it runs"""
    def mesh(count):
        with open("sheet.new", "w", encoding="ascii") as file:
            for k in range(count * count):
                file.write(f"v {k % count / (count - 1)} 0.8 {k // count / (count - 1)}\n")
            for k in range(count * count):
                if k % count < count - 1 and k < count * (count - 1):
                    file.write(f"f {k + 1} {k + 1 + count} {k + 2 + count}\nf {k + 1} {k + 2 + count} {k + 2}\n")
        os.replace("sheet.new", "sheet.obj")
    mesh(3)
    write_scene(mesh={"file": "sheet.obj"}, pins=[{"nodes": [0, 1]}])
    command = ["stability", "scene.json", "--axis", "/integrator/dt=1e-3:1e-2:4log", "--integrators", "be"]
    for shard in ("1/2", "2/2"):
        mesh(3 if shard == "1/2" else 9)
        good(*command, "--shard", shard, "--out", "part" + shard[0])
    refused("merge", "part1", "part2", "--out", "both", says="different experiments")
    refused(*command, "--shard", "1/2", "--out", "part1", says="holds another experiment")
    for name in ("tradeoff", "converge"):
        mesh(3)
        repeated = [name, "scene.json", "--integrators", "be", "--case-seconds", "1", "--out", name] + ["--repeats", "1"] * (name == "tradeoff")
        good(*repeated)
        mesh(9)
        refused(*repeated, says="holds another experiment")
    mesh(3)
    good(*command, "--out", "again")
    running = *command[:3], "/integrator/dt=1e-4:1e-2:20log", *command[4:], "--jobs", "1", "--out", "running"
    count = calls_of(*running)
    shutil.rmtree("running")
    with stopped(*running, call=count // 2) as process:  # while it runs
        mesh(9)
        process.send_signal(signal.SIGCONT)
        said = process.communicate(timeout=LIMIT)[1]
    equal(process.returncode, 1, said)
    assert "was changed while the experiment runs" in said, said
    with open("running/cases.jsonl", encoding="utf-8") as file:
        equal({json.loads(line)["nodes"] for line in file}, {9}, "nodes of the cases that are kept")


sys.exit(run_tests(globals()))
