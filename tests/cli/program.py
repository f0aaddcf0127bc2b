"""What tests of the program `drape` share: calls of the program, scenes, readers of its files, and the loop over the tests of a file.

DRAPE_BUILD is the build folder, DRAPE_SOURCE the source folder; or: test_x.py PROGRAM [SOURCES]. A test is a function test_*; its
docstring is its name; with ONLY=PATTERN those run in whose names the pattern is found. Everything is written below a temporary folder. Output is TAP.
"""
import contextlib
import csv
import json
import os
import re
import resource
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import traceback

SOURCES = sys.argv[2] if len(sys.argv) > 2 else os.environ.get("DRAPE_SOURCE", os.path.dirname(__file__) + "/../..")
PROGRAM = os.path.abspath(sys.argv[1] if len(sys.argv) > 1 else os.environ["DRAPE_BUILD"] + "/drape")
SOURCES = os.path.abspath(SOURCES)
PRELOAD = os.path.dirname(PROGRAM) + "/tests/libpreload.so"
LIMIT = 300  # [s] for one call: sanitizers are slow


class Skip(Exception):
    pass


def scene(**changes):
    """Writes a scene of 16 nodes, one corner free to swing for 0.1 s: a run takes milliseconds."""
    cloth = {
        "name": "sheet",
        "mesh": {"grid": "equilateral", "edges": 3, "edge_length": 0.1},
        "material": {"young_modulus": 1e5, "thickness": 1e-3, "density": 200},
        "terms": ["stretch.edge", "bend.hinge", {"type": "damp.kelvin_voigt", "beta": 1e-3}],
        "pins": [{"corner": "top-left"}, {"corner": "top-right"}],
    }
    whole = {"drape": 1, "cloth": [cloth], "integrator": {"dt": 0.01}, "duration": 0.1, "frame_rate": 30}
    for key, value in changes.items():
        (cloth if key in cloth else whole)[key] = value
    return whole


def write_scene(**changes):
    with open("scene.json", "w", encoding="utf-8") as file:
        json.dump(scene(**changes), file, indent=1)
    return "scene.json"


def drape(*args, **options):
    return subprocess.run([PROGRAM, *args], capture_output=True, text=True, timeout=LIMIT, **options)


def equal(found, expected, what=""):
    assert found == expected, f"{what}: found {found!r}, expected {expected!r}"


def without_warnings(text):
    """What a call says on stderr besides warnings: the small scenes of the tests make few steps."""
    return re.sub(r"^warning: [^\n]+\n", "", text, flags=re.M)


def good(*args, **options):
    result = drape(*args, **options)
    equal((result.returncode, without_warnings(result.stderr)), (0, ""), " ".join(args))
    return result.stdout


def refused(*args, says="", **options):
    """Checks that a call ends with exit code 2, one line on stderr, nothing on stdout and no new file."""
    before = sorted(os.listdir("."))
    result = drape(*args, **options)
    equal(result.returncode, 2, " ".join(args) + ": " + result.stderr)
    equal(result.stdout, "", " ".join(args))
    assert re.fullmatch(r"[^\n]+\n", result.stderr), f"{args}: not one line: {result.stderr!r}"
    assert says in result.stderr, f"{args}: {says!r} is not in {result.stderr!r}"
    equal(sorted(os.listdir(".")), before, "files after " + " ".join(args))
    return result.stderr


def meddling(**how):
    """The environment of a call in which something goes wrong at a moment that is counted, not timed: preload.c says what, as signal=2, call=100."""
    env = {**os.environ, "LD_PRELOAD": PRELOAD, **{"DRAPE_" + key.upper(): str(value) for key, value in how.items()}}
    if "ASAN_OPTIONS" in env:
        env["ASAN_OPTIONS"] += ":verify_asan_link_order=0"
    return env


def meddled(*args, **how):
    return drape(*args, env=meddling(**how))


def counted():
    """What preload.c has counted: allocations, calls."""
    with open("count", encoding="ascii") as file:
        return [int(number) for number in file.read().split()]


def calls_of(*args):
    """How many calls of a good run of these arguments preload.c counts."""
    result = meddled(*args, count="count")
    equal((result.returncode, without_warnings(result.stderr)), (0, ""), " ".join(args))
    count = counted()[1]
    os.remove("count")
    return count


def signalled(one, name, *args):
    """A run of scene.json into the folder out that receives a signal once a file of that name is there. Returns the exit code."""
    shutil.rmtree("out", ignore_errors=True)
    return meddled("run", "scene.json", "--out", "out", *args, signal=int(one), file=name).returncode


@contextlib.contextmanager
def stopped(*args, **how):
    """A process of the program that has stopped itself (SIGSTOP) at a counted moment; it ends with the context."""
    with subprocess.Popen([PROGRAM, *args], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                          env=meddling(signal=int(signal.SIGSTOP), **how)) as child:
        try:
            assert os.WIFSTOPPED(os.waitpid(child.pid, os.WUNTRACED)[1]), f"{' '.join(args)}: it has ended"
            yield child
        finally:
            child.kill()


def catches(pid):
    """Whether a process catches SIGHUP, the last signal for which the program installs its handler."""
    with open(f"/proc/{pid}/status", encoding="ascii") as file:
        return int(re.search(r"^SigCgt:\s*(\w+)", file.read(), re.M).group(1), 16) >> (signal.SIGHUP - 1) & 1


def wait_for(condition, child):
    """Waits until a condition holds, which it must while the process still runs."""
    end = time.monotonic() + LIMIT
    while not condition():
        assert child.poll() is None, f"it has ended with {child.returncode}"
        assert time.monotonic() < end, f"{LIMIT} s have passed"
        time.sleep(0.002)


def text_of(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


def write_text(path, text):
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


def read_json(path):
    return json.loads(text_of(path))


def write_json(path, data):
    write_text(path, json.dumps(data))


def read_steps(folder):
    with open(folder + "/steps.csv", encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def read_npy(path):
    """The shape (frames, nodes, 3) and the numbers of a .npy file, read by the definition of the format."""
    with open(path, "rb") as file:
        data = file.read()
    equal(data[:8], b"\x93NUMPY\x01\x00", "magic and version")
    size = struct.unpack("<H", data[8:10])[0]
    equal((10 + size) % 64, 0, "alignment of the data")
    header = data[10:10 + size].decode("ascii")
    equal(re.search(r"'descr': '(.*?)'", header).group(1), "<f8", "type")
    equal(re.search(r"'fortran_order': (\w+)", header).group(1), "False", "order")
    shape = tuple(int(n) for n in re.search(r"'shape': \((.*?)\)", header).group(1).split(","))
    count = shape[0] * shape[1] * shape[2]
    equal(len(data) - 10 - size, 8 * count, "bytes of data")
    return shape, struct.unpack(f"<{count}d", data[10 + size:])


def claim(folder, name):
    """Describes a file in the manifest of its folder as Drape does (src/base/checksum.h), after a test has changed it."""
    with open(f"{folder}/{name}", "rb") as file:
        data = file.read()
    total, mask = 0, (1 << 64) - 1
    for k, (word,) in enumerate(struct.iter_unpack("<Q", data + bytes(-len(data) % 8))):
        z = (word + (k + 1) * 0x9e3779b97f4a7c15) & mask
        z = ((z ^ z >> 30) * 0xbf58476d1ce4e5b9) & mask
        z = ((z ^ z >> 27) * 0x94d049bb133111eb) & mask
        total += z ^ z >> 31
    with open(folder + "/manifest.jsonl", "a", encoding="ascii") as file:
        file.write(json.dumps({"file": name, "size": len(data), "checksum": f"{total & mask:016x}"}) + "\n")


def computed():
    """CPU time [s] of all processes so far that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def run_tests(module):
    only = os.environ.get("ONLY", "")
    tests = [test for name, test in module.items() if name.startswith("test_") and re.search(only, name)]
    print(f"1..{len(tests)}", flush=True)
    failed = 0
    for number, test in enumerate(tests, 1):
        words, begun = f"{number} - {test.__doc__}", computed()
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            os.chdir(folder)
            try:
                test()
                print("ok", words, flush=True)
            except Skip as reason:
                print("ok", words, "# SKIP", reason, flush=True)
            except Exception:  # pylint: disable=broad-except
                failed += 1
                print("not ok", words, flush=True)
                print("# " + traceback.format_exc().rstrip().replace("\n", "\n# "), flush=True)
            os.chdir("/")
        print(f"# {computed() - begun:.1f} s of CPU", flush=True)
    return failed > 0

