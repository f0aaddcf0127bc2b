#!/usr/bin/env python3
"""test_faults.py: verbs that write, on a disk that is full after any number of bytes, and with a folder that cannot be made: either exit code 1
and one line that names the file, or the verb completes; files are whole or not there. For `drape run` see test_cli.py. Output is TAP.
"""
import os
import re
import resource
import shutil

from program import Skip, drape, equal, good, read_json, run_tests, text_of, without_warnings, write_scene, write_text

SIZES = 0, 1, 100, 700, 3000, 9000  # [bytes] largest size of a file: none, part of the first file, part of later ones


def on_full_disk(size, *args):
    """The program ignores SIGXFSZ, so a write is cut short and the next one fails, as on a full disk."""
    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
    return drape(*args, preexec_fn=limit)


def files_below(folder):
    return {os.path.join(path, name): os.path.getsize(os.path.join(path, name))
            for path, _, names in os.walk(folder) for name in names}


def fill(args, out, whole_of, sizes=SIZES):
    """whole_of: name -> whether that file is whole, for the files that exist."""
    failed = 0
    for size in sizes:
        for path in (out,) if isinstance(out, str) else out:
            shutil.rmtree(path, ignore_errors=True)
            if os.path.exists(path):
                os.remove(path)
        result = on_full_disk(size, *args)
        what = f"{' '.join(args)}, {size} bytes: {result.returncode}, {result.stderr!r}"
        if result.returncode:
            failed += 1
            equal(result.returncode, 1, what)
            assert re.fullmatch(r"[^\n]*\"[^\n]+\": File too large\n", without_warnings(result.stderr)), what
        for name in files_below("."):
            assert not name.endswith((".part", ".tmp")), f"{what}: {name} is left"
            whole_of(name, what)
    assert failed >= 2, f"{' '.join(args)}: {failed} failures"


def is_whole(name, what):
    with open(name, "rb") as file:
        data = file.read()
    if name.endswith(".png"):
        equal(data[-8:-4], b"IEND", f"{what}: {name}")
    elif name.endswith(".html"):
        assert data.rstrip().endswith(b"</html>"), f"{what}: {name}"
    elif name.endswith(".json"):
        read_json(name)
    elif name.endswith(".jsonl"):
        assert data == b"" or data.endswith(b"\n"), f"{what}: {name} ends within a line"


def test_report():
    """report, compare"""
    write_scene()
    good("run", "scene.json", "--out", "run", "--format", "npy")
    fill(["report", "run", "--out", "page.html"], "page.html", is_whole)
    fill(["compare", "run", "run", "--out", "table.csv"], "table.csv", is_whole)


def test_experiments():
    """tradeoff, stability, converge: saved lines are whole, and the same command resumes when there is space"""
    if not re.search(r"^ +tradeoff ", good("--help"), re.M):
        raise Skip("this build has no experiments")
    write_scene()
    for command in (["tradeoff", "scene.json", "--integrators", "be", "--repeats", "1"],
                    ["converge", "scene.json", "--integrators", "be", "--levels", "3"],
                    ["stability", "scene.json", "--integrators", "be", "--axis", "/integrator/dt=1e-3:1e-2:3log", "--axis",
                     "/cloth/0/material/young_modulus=1e4:1e6:3log"]):
        fill([*command, "--out", "lab"], "lab", is_whole)
        good(*command, "--out", "lab")


def test_validate():
    """validate --out"""
    if not re.search(r"^ +validate ", good("--help"), re.M):
        raise Skip("this build has no experiments")
    fill(["validate", "free_fall", "--out", "lab"], "lab", is_whole, (0, 1, 100))
    good("validate", "free_fall", "--out", "lab")


def test_render():
    """render: a picture, a folder of them"""
    write_scene()
    if drape("render", "scene.json", "--out", "x.png", "--size", "64x48").returncode:
        raise Skip("there is no driver")
    fill(["render", "scene.json", "--out", "x.png", "--size", "320x200"], "x.png", is_whole, (0, 1, 100, 700))
    fill(["render", "scene.json", "--out", "frames", "--size", "320x200"], "frames", is_whole, (0, 1, 100, 700))


def test_stack():
    """a stack that is too short is refused by every verb with one line; one of the least size is enough for all threads"""
    def limit(size):
        return lambda: resource.setrlimit(resource.RLIMIT_STACK, (size, resource.getrlimit(resource.RLIMIT_STACK)[1]))
    write_scene()
    for args in ["run", "scene.json"], ["stability", "scene.json", "--axis", "/integrator/dt=1e-3:1e-1:2log", "--out", "s"], ["--help"]:
        result = drape(*args, preexec_fn=limit(64 * 1024))
        equal((result.returncode, result.stdout, result.stderr),
              (1, "", "drape: the stack is limited to 64 KiB, by ulimit -s; at least 1024 KiB are needed\n"), " ".join(args))
    for args in ["run", "scene.json", "--threads", "2"], ["check", "scene.json"], ["modes", "scene.json"], ["stability", "scene.json", "--axis",
                 "/integrator/dt=1e-3:1e-1:2log", "--integrators", "be,radau,ida,dirk", "--out", "s"]:
        if args[0] == "run" or re.search(f"^ +{args[0]} ", good("--help"), re.M):
            result = drape(*args, preexec_fn=limit(1024 * 1024))
            equal((result.returncode, without_warnings(result.stderr)), (0, ""), " ".join(args))


def test_no_folder():
    """a file is where a folder should be"""
    write_scene()
    good("run", "scene.json", "--out", "run", "--format", "npy")
    write_text("file", "x")
    commands = [["run", "scene.json", "--out", "file/x"], ["report", "run", "--out", "file/x/page.html"],
                ["compare", "run", "run", "--out", "file/x/table.csv"]]
    if drape("render", "run", "--out", "x.png", "--size", "64x48").returncode == 0:
        commands += [["render", "run", "--out", "file/x.png"], ["render", "run", "--out", "file/x"]]
    for command in commands:
        result = drape(*command)
        assert re.fullmatch(r"[^\n]*file/x[^\n]*Not a directory\n", without_warnings(result.stderr)), (command, result.stderr)
        equal(result.returncode, 1, " ".join(command))
        equal(text_of("file"), "x")


raise SystemExit(run_tests(globals()))
