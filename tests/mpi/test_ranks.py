#!/usr/bin/env python3
"""test_ranks.py: `drape run` on several ranks of MPI: the results are those of one process within the tolerance of the solver, whatever the number
of ranks; what it cannot do is refused in one line; a rank that is killed ends the run, which any number of ranks resumes."""
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)) + "/../cli")
# pylint: disable=wrong-import-position
from program import LIMIT, PROGRAM, SOURCES, claim, equal, good, read_json, read_npy, run_tests, write_scene

# Open MPI: as root in a container, more ranks than cores, which yield while they wait; no shell on other hosts, no network.
ENVIRONMENT = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1", OMPI_MCA_rmaps_base_oversubscribe="1",
                   OMPI_MCA_hwloc_base_binding_policy="none", OMPI_MCA_mpi_yield_when_idle="1", OMPI_MCA_plm="isolated", OMPI_MCA_pml="ob1", OMPI_MCA_btl="self,vader",
                   OMPI_MCA_btl_vader_single_copy_mechanism="none", OMP_NUM_THREADS="1")
SIDE, H, TOLERANCE = 0.4, 0.01, 1e-9  # [m], [s], [N]
COLUMNS, DENSITY = 9, 0.2
LEAST_MASS = DENSITY * (SIDE / (COLUMNS - 1))**2 / 6  # [kg] of a corner with one triangle
DROP = {"mesh": {"grid": "square", "columns": COLUMNS, "rows": COLUMNS, "width": SIDE, "height": SIDE},
        "material": {"young_modulus": 1e5, "thickness": 1e-3, "areal_density": DENSITY},
        "terms": ["stretch.cst", "bend.hinge", {"type": "damp.kelvin_voigt", "beta": 0.002}]}
HUNG = dict(DROP, pins=[{"corner": "top-left"}, {"corner": "top-right"}])
CUBE = [(x, y, z) for x in (0.1, 0.3) for y in (-0.202, -0.002) for z in (-0.3, -0.1)]
FACES = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))


def launch(count, *args):
    return ["mpirun", "-n", str(count), PROGRAM, *args]


def ranks(count, *args):
    """The same as `good`, on that many ranks; 1: no launcher."""
    if count == 1:
        return good(*args)
    result = subprocess.run(launch(count, *args), capture_output=True, text=True, timeout=LIMIT, env=ENVIRONMENT, check=False)
    equal(result.returncode, 0, f"{count} ranks: {args}: {result.stdout} {result.stderr}")
    equal(result.stdout.count("status    ok"), 1, f"{count} ranks: {args}: what is printed: {result.stdout}")
    return result.stdout


def difference(one, other):
    """The largest between the positions of two runs [m]."""
    shape, a = read_npy(one + "/positions.npy")
    other_shape, b = read_npy(other + "/positions.npy")
    equal(other_shape, shape, "frames, nodes")
    return max(abs(x - y) for x, y in zip(a, b))


def compare(bound, *counts, args=()):
    """Runs scene.json on each number of ranks, and on one."""
    for count in (1, *counts):
        ranks(count, "run", "scene.json", "--out", f"out{count}", "--format", "npy", *args)
        if count == 1:
            continue
        equal(read_json(f"out{count}/summary.json")["ranks"], count, "ranks in summary.json")
        found = difference("out1", f"out{count}")
        print(f"# {count} ranks: {found:.3g} m, bound {bound:.3g} m")
        assert found <= bound, f"{count} ranks: {found} m from one; the bound is {bound} m"
        one, other = (read_json(f"out{number}/summary.json")["energy"] for number in (1, count))
        equal(one.keys(), other.keys(), "energies")
        for name in one:  # forces and momenta of the small sheets add up to less than 10 N and 10 kg/s m
            assert abs(one[name] - other[name]) <= 10 * bound, f"{count} ranks: {name}: {one[name]}, {other[name]}"


def bound_of_steps(steps):
    """Both runs leave a residual of at most TOLERANCE in each step of backward Euler, so a displacement differs by at most
    delta = 2 TOLERANCE h^2 / m, as the matrix is at least M / h^2, and a velocity by delta / h, which the next steps carry on: after k steps
    delta (1 + 2 + ... + k). Ten times that, because motions that differ may part."""
    return 10 * 2 * TOLERANCE * H**2 / LEAST_MASS * steps * (steps + 1) / 2


def be(**more):
    return dict({"method": "be", "dt": H, "tolerance": TOLERANCE, "norm": "max"}, **more)


def test_be():
    """be: a hung sheet, of which one pin moves, on 2 and 3 ranks, by the direct and by the iterative solver"""
    pins = [{"corner": "top-left", "track": [[0, [0, 0, 0]], [0.1, [0.05, 0.02, 0]]]}, {"corner": "top-right"}]
    for solver in ("multifrontal", "pcg"):
        write_scene(cloth=[dict(HUNG, pins=pins)], integrator=be(linear_solver=solver), duration=0.1, frame_rate=50)
        for folder in ("out1", "out2", "out3"):
            shutil.rmtree(folder, ignore_errors=True)
        compare(bound_of_steps(10), 2, 3)


def test_terms():
    """cloths of different terms, so that a rank has no element of a term that others have: the ranks still agree on what is done next"""
    far = dict(HUNG, mesh=dict(HUNG["mesh"], transform={"translate": [3, 0, 0]}))
    for terms in (["stretch.cst"], []):
        write_scene(cloth=[dict(HUNG, terms=terms), far], integrator=be(), duration=0.05, frame_rate=50)
        for folder in ("out1", "out2", "out3"):
            shutil.rmtree(folder, ignore_errors=True)
        compare(bound_of_steps(5), 2, 3)


def test_iterations():
    """pcg on 2 and 3 ranks takes about as many iterations as on one, of Newton's method and linear ones, step after step; twice the same bits"""
    sheet = {"mesh": {"grid": "square", "columns": 30, "rows": 30, "width": 1, "height": 1},
             "material": {"young_modulus": 1e6, "thickness": 1e-3, "areal_density": DENSITY},
             "terms": ["stretch.edge", "bend.hinge", {"type": "damp.kelvin_voigt", "beta": 0.005}], "pins": HUNG["pins"]}
    write_scene(cloth=[sheet], integrator={"method": "be", "dt": 1 / 60, "linear_solver": "pcg"}, duration=0.2)
    work = []
    for count in 1, 2, 3, 3:
        shutil.rmtree("out", ignore_errors=True)
        ranks(count, "run", "scene.json", "--out", "out", "--format", "npy")
        with open("out/positions.npy", "rb") as file:
            work.append((read_json("out/summary.json")["newton"], file.read()))
    assert work[2][1] == work[3][1], "two runs on 3 ranks differ"
    for name in "iterations", "factorizations", "linear_iterations":  # other rounding, and other aggregates at a border: a few more or less
        found = [newton[name] for newton, _ in work]
        print(f"# {name}: {found}")
        assert max(found[1:]) <= 1.25 * found[0], f"{name} on 1, 2, 3 and 3 ranks: {found}"


def colliders():
    with open("cube.obj", "w", encoding="utf-8") as file:
        print(*("v %g %g %g" % point for point in CUBE), *("f %d %d %d %d" % face for face in FACES), sep="\n", file=file)
    top, middle = -0.002, [SIDE / 2, -0.102, -SIDE / 2]
    limb = SOURCES + "/examples/scenes/limb"
    return {
        "plane": {"point": [0, top, 0], "normal": [0.1, 1, 0]},
        "sphere": {"center": middle, "radius": 0.1, "track": [[0, [0, 0, 0]], [0.15, [0.03, 0, 0]]]},
        "capsule": {"a": [0.1, -0.052, -0.2], "b": [0.3, -0.052, -0.2], "radius": 0.05},
        "box": {"center": middle, "size": 0.2},
        "cylinder": {"a": [0.2, top, -0.2], "b": [0.2, -0.2, -0.2], "radius": 0.1},
        "mesh": {"file": "cube.obj"},
        "animated_mesh": {"file": limb + ".npy", "mesh": limb + ".obj", "frame_rate": 8, "track": [[0, [0.2, -0.06, -0.2]]]}}


def test_colliders():
    """be: a sheet falls on a collider of each kind, which has friction; the sphere moves; by the iterative solver, too"""
    for kind, values in [*colliders().items(), ("sphere", dict(colliders()["sphere"], linear_solver="pcg"))]:
        solver = values.pop("linear_solver", "auto")
        write_scene(cloth=[DROP], integrator=be(linear_solver=solver), duration=0.1, frame_rate=50,
                    colliders=[dict(values, type=kind, friction=0.3)], contact={"distance": 0.004})
        for folder in ("out1", "out2", "out3"):
            shutil.rmtree(folder, ignore_errors=True)
        print(f"# {kind}, {solver}")
        compare(bound_of_steps(10), *((2, 3) if kind == "sphere" else (2,)))
        assert read_json("out2/summary.json")["energy"]["contact"] > 0, kind + ": nothing touches it"


def test_static():
    """static: the equilibrium of a hung sheet and whether it is stable; one that stands on its pins is not, in as many modes"""
    # The softest motion is the swing of the lightest node, of stiffness m g / L; both runs leave a residual of TOLERANCE.
    bound = 2 * TOLERANCE * SIDE / (LEAST_MASS * 9.81)
    for gravity, stable in (([0, -9.81, 0], True), ([0, 0, 9.81], False)):
        write_scene(cloth=[HUNG], integrator={"method": "static", "tolerance": TOLERANCE, "norm": "max"}, gravity=gravity, duration=1)
        for folder in ("out1", "out2", "out3"):
            shutil.rmtree(folder, ignore_errors=True)
        compare(bound, 2, 3)
        equal([read_json(f"out{count}/summary.json")["equilibrium"] for count in (1, 2, 3)], 3 * [read_json("out1/summary.json")["equilibrium"]])
        equal(read_json("out1/summary.json")["equilibrium"]["stable"], stable, f"gravity {gravity}")


def test_ida():
    """ida: a hung sheet, and one that falls on a sphere; by pcg, which hands the matrices with friction to the direct solver of the ranks"""
    rtol = 1e-6
    sphere = dict(colliders()["sphere"], type="sphere")
    for cloth, solver, balls in ((HUNG, "auto", []), (DROP, "auto", [sphere]), (DROP, "pcg", [dict(sphere, friction=0.3)])):
        write_scene(cloth=[cloth], integrator={"method": "ida", "rtol": rtol, "atol_x": rtol, "atol_v": rtol, "linear_solver": solver}, duration=0.05,
                    frame_rate=50, colliders=balls, contact={"distance": 0.004})
        for folder in ("out1", "out2", "out3"):
            shutil.rmtree(folder, ignore_errors=True)
        ranks(1, "run", "scene.json", "--out", "out1", "--format", "npy")
        # The error of a step is at most rtol |x| + atol; those of all steps, of both runs, may add up.
        steps = read_json("out1/summary.json")["steps"]["accepted"]
        shutil.rmtree("out1")
        compare(2 * steps * rtol * (1 + SIDE), 2, 3)


def test_frames():
    """frames of all formats are those of one process; the checksum of the one that ranks write together is in the manifest"""
    write_scene(cloth=[HUNG], integrator=be(), duration=0.05, frame_rate=50)
    for count in (1, 2):
        ranks(count, "run", "scene.json", "--out", f"out{count}", "--format", "npy,obj,vtp")
    assert difference("out1", "out2") <= bound_of_steps(5)
    equal(sorted(set(os.listdir("out2")) ^ set(os.listdir("out1"))), [], "files")
    with open("out2/manifest.jsonl", encoding="ascii") as file:
        line = [line for line in file if '"positions.npy"' in line and "checksum" in line][-1]
    claim("out2", "positions.npy")
    with open("out2/manifest.jsonl", encoding="ascii") as file:
        equal(line.replace(" ", ""), file.readlines()[-1].replace(" ", ""), "checksum of positions.npy")


def own_lines(words):
    """Those of drape, besides what the launcher says of an exit code, and lines "[library] ..." of it, as in a container without /sys."""
    return [line for line in words.split("-----")[0].splitlines() if line and not line.startswith("[")]


def refused(count, *args, says):
    """Exit code 2 and one line of drape; no file is written."""
    before = sorted(os.listdir("."))
    result = subprocess.run(launch(count, *args), capture_output=True, text=True, timeout=LIMIT, env=ENVIRONMENT, check=False)
    equal(result.returncode, 2, f"{args}: {result.stderr}")
    equal(result.stdout.strip(), "", f"{args}: standard output")
    own = own_lines(result.stderr)
    equal(len(own), 1, f"{args}: lines in {result.stderr}")
    assert says in own[0], f"{args}: {says!r} is not in {own[0]!r}"
    equal(sorted(os.listdir(".")), before, f"files after {args}")


def test_refusals():
    """what a run on several ranks cannot have is refused in one line"""
    cases = (({"self_contact": {"thickness": 0.002}}, "/self_contact: a run on several ranks cannot have self-contact"),
             ({"integrator": {"method": "verlet"}}, 'a run on several ranks cannot use "verlet"'),
             ({"integrator": {"method": "newton_k"}}, 'a run on several ranks cannot use "newton_k"'),
             ({"controller": {"type": "strain"}}, 'a run on several ranks cannot use "strain"'),
             ({"events": [{"type": "energy", "bound": 1e-9}]}, "/events: a run on several ranks cannot have events"),
             ({"duration": -1}, "/duration"))
    for changes, says in cases:
        write_scene(**changes)
        refused(2, "run", "scene.json", "--out", "out", says=says)
    write_scene()
    refused(2, "run", "scene.json", "--realtime", says="a run on several ranks has no time budget")
    refused(17, "run", "scene.json", says="there are 14 free nodes for 17 ranks")


def apart(*commands, says, code):
    """Each command, of arguments and a folder, is a rank of one run, which ends with one line that says this."""
    words = ["mpirun"]
    for number, (folder, args) in enumerate(commands):
        words += ([":"] if number else []) + ["-n", "1", "-wdir", os.path.abspath(folder), PROGRAM, *args]
    result = subprocess.run(words, capture_output=True, text=True, timeout=LIMIT, env=ENVIRONMENT, check=False)
    equal(result.returncode, code, f"exit code: {result.stdout} {result.stderr}")
    lines = own_lines(result.stderr)
    equal(len(lines), 1, f"lines: {result.stderr}")
    assert says in lines[0], lines[0]


def test_other_input():
    """ranks whose scenes or options differ, or of which one has no scene, end with one line, and do not wait for each other"""
    os.makedirs("other")
    write_scene(cloth=[HUNG], integrator=be(), duration=0.1, frame_rate=100)
    shutil.copy("scene.json", "other")
    run = ("run", "scene.json")
    apart((".", run), (".", (*run, "--out", "out")), says="the same options", code=2)
    for option, value in (("dt", "0.005"), ("tolerance", "1e-6"), ("integrator", "ida"), ("linear-solver", "pcg")):
        apart((".", run), (".", (*run, "--" + option, value)), says="the same scene", code=2)
    for change in ({"duration": 0.2}, {"cloth": [DROP]}, {"cloth": [dict(HUNG, mesh=dict(DROP["mesh"], columns=7))]}):
        os.chdir("other")
        write_scene(**{"cloth": [HUNG], "integrator": be(), "duration": 0.1, "frame_rate": 100, **change})
        os.chdir("..")
        apart((".", run), ("other", run), says="the same scene", code=2)
    os.remove("other/scene.json")
    apart((".", run), ("other", run), says="cannot read the scene", code=2)


def test_other_files():
    """a rank that finds another file at the path of the frames, as on a machine with a file system of its own, neither writes to it nor calls the run ok"""
    os.makedirs("other")
    write_scene(cloth=[HUNG], integrator=be(), duration=0.1, frame_rate=100)
    shutil.copy("scene.json", "other")
    run = ("run", "scene.json", "--out", "out", "--format", "npy")
    os.chdir("other")
    good(*run)
    os.chdir("..")
    before = open("other/out/positions.npy", "rb").read()
    apart((".", run), ("other", run), says='cannot write "out/positions.npy"', code=1)
    equal(open("other/out/positions.npy", "rb").read(), before, "the other file")


def test_stability():
    """`static` tells whether an equilibrium is stable where one process does, also after it is resumed, and not where friction and wind may act"""
    wind = dict(HUNG, terms=["stretch.cst", "bend.hinge", {"type": "drag.wind", "wind": [1, 0, -1.5]}])
    plane = {"type": "plane", "point": [0, -9, 0], "normal": [0, 1, 0], "friction": 0.3}
    for cloth, colliders_there, known in ((HUNG, [], True), (wind, [plane], False)):
        write_scene(cloth=[cloth], colliders=colliders_there, integrator={"method": "static", "tolerance": 1e-8, "norm": "max"}, duration=1, frame_rate=1)
        for count in (1, 2, 3):
            run = ("run", "scene.json", "--out", f"out{known}{count}", "--checkpoint-every", "1")
            for more in ((), ("--resume",)):
                ranks(count, *run, *more)
                equal("equilibrium" in read_json(f"out{known}{count}/summary.json"), known, f"{count} ranks {more}: whether the stability is known")


def runs(process):
    """Whether it is there; not what is left of it until its parent, or that of an orphan, asks for its exit code."""
    try:
        with open(f"/proc/{process}/stat", encoding="ascii") as file:
            return file.read().rpartition(")")[2].split()[0] not in "ZX"
    except FileNotFoundError:
        return False


def has_frames(count):
    try:
        return os.path.getsize("out/positions.npy") >= 128 + count * 24 * COLUMNS**2  # after the header
    except FileNotFoundError:
        return False


def started(count, *args):
    """A run of several ranks of which one is killed by SIGKILL after ten frames. Returns the launcher's exit code and words."""
    with subprocess.Popen(launch(count, "run", "scene.json", "--checkpoint-every", "1", *args), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          text=True, env=ENVIRONMENT) as process:
        end = time.monotonic() + LIMIT
        while not (has_frames(10) and os.path.exists("out/checkpoint.drape")) and time.monotonic() < end and process.poll() is None:
            time.sleep(0.01)
        with open(f"/proc/{process.pid}/task/{process.pid}/children", encoding="ascii") as file:
            children = [int(child) for child in file.read().split()]
        equal(len(children), count, "processes of the launcher")
        os.kill(children[-1], signal.SIGKILL)
        _, words = process.communicate(timeout=LIMIT)
    while any(runs(child) for child in children): # the launcher does not wait for those that it ends
        assert time.monotonic() < end, f"of {children} some are still there"
        time.sleep(0.01)
    return process.returncode, words


def test_killed():
    """a rank that is killed ends the run, which other numbers of ranks resume; one process, too"""
    duration, steps = 0.6, 60
    write_scene(cloth=[DROP], integrator=be(), duration=duration, frame_rate=100,
                colliders=[dict(colliders()["sphere"], type="sphere", friction=0.3)], contact={"distance": 0.004})
    code, words = started(2, "--out", "out", "--format", "npy")
    assert code != 0 and "signal 9" in words, f"exit code {code}: {words}"
    assert not os.path.exists("out/summary.json"), "a killed run has a summary"
    with open("out/positions.npy", "rb") as file:
        data = file.read()
    frames = int(re.search(rb"'shape': \((\d+),", data).group(1))
    assert 9 <= frames < steps, frames
    assert has_frames(frames), "the header counts frames that are not there"
    shutil.copytree("out", "alone")
    ranks(1, "run", "scene.json", "--out", "whole", "--format", "npy")
    ranks(3, "run", "scene.json", "--out", "out", "--format", "npy", "--resume")
    ranks(1, "run", "scene.json", "--out", "alone", "--format", "npy", "--resume")
    for folder in ("out", "alone"):
        found = difference("whole", folder)
        print(f"# {folder}, resumed at {frames} of {steps} frames: {found:.3g} m")
        assert found <= bound_of_steps(steps), f"{folder}: {found} m from a run of one process"
        equal(read_json(folder + "/summary.json")["time"], duration, "time")


def test_one_process():
    """a checkpoint of one process is refused by several ranks"""
    write_scene(cloth=[HUNG], integrator=be(), duration=0.1, frame_rate=50)
    ranks(1, "run", "scene.json", "--out", "out", "--checkpoint-every", "1")
    refused(2, "run", "scene.json", "--out", "out", "--resume", says="checkpoint")


def checkpoint(folder):
    with open(folder + "/checkpoint.drape", "rb") as file:
        return file.read()


def temporary(folder):
    return {name for name in os.listdir(folder) if name.endswith(".part")}


def test_bytes():
    """checkpoints of 1, 2, 3 and 4 ranks have the same states, bit for bit; those of several ranks are the same files but for sums and wall times"""
    fold = {"folds": [{"point": [0.2, 0, -0.2], "axis": [1, 0, 0.3], "side": [0, 0, -1], "angle": 70}], "spin": [1, 2, 3]}
    relaxes = {"type": "relax.maxwell", "fraction_1": 0.3, "time_1": 0.1, "fraction_2": 0.2, "time_2": 1}
    far = dict(HUNG["mesh"], transform={"translate": [3, 0, 0]})
    cloths = [dict(HUNG, terms=["stretch.cst", "bend.midedge", relaxes], start=fold), dict(HUNG, terms=["stretch.edge", "bend.hinge"], mesh=far, start=fold)]
    # The first step fails, as it takes more than one iteration, so the checkpoint is that of the start, which ranks do not round.
    write_scene(cloth=cloths, integrator=be(max_iterations=1), controller={"type": "fixed"}, duration=0.1, frame_rate=50)
    found = {}
    for count in 1, 2, 3, 4:
        args = ("run", "scene.json", "--out", f"out{count}", "--format", "npy", "--checkpoint-every", "1")
        result = subprocess.run(launch(count, *args) if count > 1 else [PROGRAM, *args], capture_output=True, text=True, timeout=LIMIT, env=ENVIRONMENT, check=False)
        equal(result.returncode, 1, f"{count} ranks: {result.stderr}")
        found[count] = checkpoint(f"out{count}")
    with open("out1/positions.npy", "rb") as file:
        positions = file.read()[128:]
    equal(len(positions), 24 * 2 * COLUMNS**2, "bytes of a frame")
    states = {}
    for count, data in found.items():
        begin, end = data.index(positions), data.index(b"schedule")
        equal(begin % 8, 0, f"{count} ranks: the place of the positions")
        states[count] = data[begin:end]
        equal(states[count], states[1], f"{count} ranks: states")
        if count > 2:
            equal(len(data), len(found[2]), f"{count} ranks: bytes")
            differing = sum(data[i:i + 8] != found[2][i:i + 8] for i in range(0, len(data), 8))
            # The energies at the start and the error of their sum, and what wall times there are, which are not aligned and so have up to two words
            # each; the checksum of energy.csv, of which the last digits may differ; that of the checkpoint.
            assert differing <= 2 * 20, f"{count} ranks: {differing} words differ"
    assert len(states[1]) > 2 * len(positions) + 8 * 500, f"{len(states[1])} bytes of states: where are the internal variables?"


def test_bad_checkpoints():
    """a checkpoint that was cut or changed, also in the rows of a single rank, or is of an older format, is refused, in one line, and stays as it is"""
    write_scene(cloth=[DROP], integrator=be(), duration=0.1, frame_rate=50)
    ranks(2, "run", "scene.json", "--out", "out", "--checkpoint-every", "1")
    good_one = checkpoint("out")
    begin, end = good_one.index(b"states") + 64, good_one.index(b"schedule")
    rows = [begin + k * (end - begin) // 5 for k in range(5)]
    first, second = (8 * (place // 8) for place in rows[1:3])
    changed = [bytes([*good_one[:place], good_one[place] ^ 16, *good_one[place + 1:]]) for place in rows]
    changed.append(good_one[:first] + good_one[second:second + 8] + good_one[first + 8:second] + good_one[first:first + 8] + good_one[second + 8:])
    changed += [good_one[:len(good_one) // 2], good_one[:-8]]
    for data, says in [*((data, "the checkpoint is damaged: its checksum is wrong") for data in changed),
                       (good_one[:8] + bytes([1]) + good_one[9:], "the checkpoint has format 1; this build reads format 3")]:
        assert data != good_one
        with open("out/checkpoint.drape", "wb") as file:
            file.write(data)
        refused(3, "run", "scene.json", "--out", "out", "--resume", says=says)
        equal(checkpoint("out"), data, "the checkpoint")


def fails(command, says, code=1):
    """A run of several ranks that ends with that exit code, one line of drape, the checkpoint that was there before and no temporary file."""
    before, parts = checkpoint("out"), temporary("out")  # the latter of a run that was killed
    result = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, env=ENVIRONMENT, check=False)
    equal(result.returncode, code, result.stderr)
    own = own_lines(result.stderr)
    equal(len(own), 1, f"lines in {result.stderr}")
    assert says in own[0], f"{says!r} is not in {own[0]!r}"
    equal(checkpoint("out"), before, "the checkpoint")
    assert temporary("out") <= parts, f"temporary files: {temporary('out')}"


def test_one_rank_cannot_write():
    """a rank that does not reach the new checkpoint, which others do: all end with one line, and the checkpoint before stays"""
    write_scene(cloth=[DROP], integrator=be(), duration=0.6, frame_rate=100)
    started(2, "--out", "out", "--format", "npy,obj")
    os.mkdir("elsewhere")
    shutil.copy("scene.json", "elsewhere")
    args = [PROGRAM, "run", "scene.json", "--out", "out", "--format", "npy,obj", "--resume", "--checkpoint-every", "1"]
    fails(["mpirun", "-n", "1", *args, ":", "-n", "1", "-wdir", os.path.abspath("elsewhere"), *args], 'cannot read "out/checkpoint.drape", which another rank can', 2)
    shutil.copytree("out", "elsewhere/out")
    os.remove("elsewhere/out/positions.npy")
    os.link("out/positions.npy", "elsewhere/out/positions.npy") # the frames are those of the run
    for alone in (1, 2):  # the last rank of 2, the middle one of 3
        there = [":", "-n", "1", *args] if alone == 2 else []
        fails(["mpirun", "-n", "1", *args, ":", "-n", "1", "-wdir", os.path.abspath("elsewhere"), *args, *there], 'cannot write "out/checkpoint.drape": No such file or directory')
    ranks(3, *args[1:])
    equal(read_json("out/summary.json")["time"], 0.6, "time")


def fill_disk(count, limited, limit):
    """Runs on that many ranks, of which some may not write beyond that many bytes of a file any more when the first checkpoint is there. Returns the exit
    code and the words of the program."""
    shutil.rmtree("out", ignore_errors=True)
    with subprocess.Popen(launch(count, "run", "scene.json", "--out", "out", "--checkpoint-every", "1"), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                          env=ENVIRONMENT) as process:
        end = time.monotonic() + LIMIT
        while not os.path.exists("out/checkpoint.drape") and time.monotonic() < end and process.poll() is None:
            time.sleep(0.01)
        with open(f"/proc/{process.pid}/task/{process.pid}/children", encoding="ascii") as file:
            children = [int(child) for child in file.read().split()]
        equal(len(children), count, "processes of the launcher")
        for child in limited:
            resource.prlimit(children[child], resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
        _, words = process.communicate(timeout=LIMIT)
    return process.returncode, own_lines(words)


def test_disk_full():
    """the disk is full for one rank or all, at a frame or a checkpoint: the run ends with one line, and the checkpoint before is whole and resumed"""
    relaxes = {"type": "relax.maxwell", "fraction_1": 0.3, "time_1": 0.1, "fraction_2": 0.2, "time_2": 1}
    sheet = dict(HUNG, mesh=dict(DROP["mesh"], columns=30, rows=30), terms=["stretch.edge", "bend.hinge", relaxes])
    write_scene(cloth=[sheet], integrator=be(tolerance=1e-6), duration=0.5, frame_rate=100)
    # A frame has 22 kB, so there is room for four, and a checkpoint has 185 kB; or there is room for one frame.
    for limited, limit, name in (([0], 100000, "checkpoint.drape"), ([2], 100000, "checkpoint.drape"), ([0, 1, 2], 100000, "checkpoint.drape"), ([1], 30000, "positions.npy")):
        code, words = fill_disk(3, limited, limit)
        equal(code, 1, f"{limited}: {words}")
        equal(len(words), 1, f"{limited}: lines")
        assert f'cannot write "out/{name}": File too large' in words[0], words[0]
        equal(temporary("out"), set(), "temporary files")
        assert len(checkpoint("out")) > 150000, "the checkpoint is not larger than the limit"
    ranks(2, "run", "scene.json", "--out", "out", "--checkpoint-every", "10", "--resume")


def test_memory():
    """each allocation of a part, a sim and some steps fails on one rank: all end with that status, and none waits for ever"""
    sphere = dict(colliders()["sphere"], type="sphere", friction=0.3)
    falls = {"cloth": [DROP], "duration": 0.04, "frame_rate": 50, "colliders": [sphere], "contact": {"distance": 0.004}}
    cases = (("pcg", dict(falls, integrator=be(linear_solver="pcg"))), ("multifrontal", dict(falls, integrator=be())),
             ("ida", dict(falls, integrator={"method": "ida", "rtol": 1e-4, "linear_solver": "pcg"})),
             ("static", {"cloth": [HUNG], "integrator": {"method": "static"}, "duration": 1}))
    program = os.path.join(os.path.dirname(PROGRAM), "tests", "test_mpi_shortage")
    for name, case in cases:
        write_scene(**case)
        for count, rank in ((2, 1), (3, 0)):
            result = subprocess.run(["mpirun", "-n", str(count), program, "scene.json", str(rank), "1", "1"], capture_output=True, text=True, timeout=LIMIT, env=ENVIRONMENT,
                                    check=False)
            equal(result.returncode, 0, f"{name}, rank {rank} of {count}: {result.stdout} {result.stderr}")
            failures = int(re.search(r"(\d+) failures", result.stdout).group(1))
            print(f"# {name}, rank {rank} of {count}: {failures} failures")
            assert failures >= 100, f"{name}: {result.stdout}"


if __name__ == "__main__":
    if os.environ.get("DRAPE_MPI") != "1":
        print("1..0 # SKIP this build has no MPI (-Dmpi=enabled)")
        sys.exit(0)
    if not shutil.which("mpirun"):
        print("1..0 # SKIP mpirun is missing")
        sys.exit(0)
    sys.exit(run_tests(dict(globals())))
