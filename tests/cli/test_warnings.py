#!/usr/bin/env python3
"""The warnings of a run: on stderr, a line each, in summary.json, and in the report. See program.py and src/sim/warnings.c."""
import re
import sys

from program import SOURCES, drape, equal, good, read_json, run_tests, scene, text_of, write_scene, write_text

FINE = {"duration": 0.3, "integrator": {"dt": 0.01}}  # 30 steps


def warnings(*args, code=0):
    """{name: text} in the summary, after checking that stderr says the same."""
    result = drape("run", *args, "--summary", "s.json")
    equal(result.returncode, code, result.stderr)
    found = read_json("s.json")["warnings"]
    printed = re.findall(r"^warning: (.+)$", result.stderr, re.M)
    equal(sorted(printed), sorted(one["text"] for one in found), "stderr and summary")
    names = {one["name"]: one["text"] for one in found}
    equal(len(names), len(found), f"a warning is given once: {found}")
    return names


def test_none():
    """example scenes and a scene of the tests that are fine have no warning"""
    write_scene(**FINE)
    equal(warnings("scene.json"), {}, "the scene of the tests")
    for name in ("incline", "hung_sheet"):
        equal(warnings(f"{SOURCES}/examples/scenes/{name}.json", "--duration", "1"), {}, name)


def test_ignored_restitution():
    """verlet, whose rules of contact return nothing of an impact, says so if a collider asks for it; others do not"""
    ball = {"type": "sphere", "center": [0, -5, 0], "radius": 1, "restitution": 0.5}
    says = 'warning: "verlet" ignores restitution: '
    write_scene(**FINE, colliders=[ball])
    equal(drape("run", "scene.json", "--integrator", "verlet").stderr.count(says), 1)
    assert says not in drape("run", "scene.json").stderr
    write_scene(**FINE, colliders=[{**ball, "restitution": 0}])
    assert says not in drape("run", "scene.json", "--integrator", "verlet").stderr


def test_no_terms():
    """a cloth without terms has a warning that names it; user-visible terms of other cloths do not hide it"""
    write_scene(**FINE, terms=[])
    assert "/cloth/0: sheet has no \"terms\"" in warnings("scene.json")["no_terms"]
    whole = scene(**FINE)
    bare = {**whole["cloth"][0], "name": "bare", "terms": []}
    write_scene(**FINE, cloth=[whole["cloth"][0], bare])
    assert "/cloth/1: bare has no \"terms\"" in warnings("scene.json")["no_terms"]


def test_unused_curve():
    """a measured curve that no term of its cloth reads has a warning; that of a fabric, which nobody gave, has none"""
    def found(terms, **material):
        whole = scene(**FINE)
        write_scene(**FINE, cloth=[{**whole["cloth"][0], "terms": terms, "material": {**whole["cloth"][0]["material"], **material}}])
        return warnings("scene.json").get("unused_curve")
    curve = [[0.01, 20], [0.03, 90]]
    equal(found(["stretch.cst"], weft_curve=curve), "/cloth/0/material/weft_curve: no term of sheet reads it; stretch.curve does", "text")
    equal(found(["stretch.curve"], weft_curve=curve), None, "used")
    equal(found(["stretch.cst"], fabric="wang2011_denim"), None, "of a fabric")


def test_unused_clamp():
    """clamps that no term reads, or that have no edge, have a warning; those of bend.midedge have none"""
    def found(terms, pin):
        whole = scene(**FINE)
        write_scene(**FINE, cloth=[{**whole["cloth"][0], "mesh": {"grid": "square", "columns": 5, "rows": 3, "width": 0.4, "height": 0.2}, "terms": terms, "pins": [{**pin, "clamp": True}]}])
        return warnings("scene.json").get("unused_clamp")
    says = 'the pins "pin0" of sheet clamp '
    equal(found(["stretch.cst", "bend.hinge"], {"edge": "left"}), says + "its edges, and none of its terms reads that; bend.midedge does", "hinges")
    equal(found(["stretch.cst", "bend.midedge"], {"corner": "top-left"}), says + "no edge: both nodes of an edge must be pinned", "a corner")
    equal(found(["stretch.cst", "bend.midedge"], {"edge": "left"}), None, "used")


def test_unused_history():
    """a history of no load has a warning, also if it is that of a gravity of 0; one of gravity has none"""
    histories = [{"name": "course", "times": [0, 1], "values": [1, 2]}]
    says = '/histories/0: "course" is the history of no load, and changes nothing'
    write_scene(**FINE, histories=histories)
    equal(warnings("scene.json").get("unused_history"), says, "of none")
    write_scene(**FINE, histories=histories, gravity_history="course")
    equal(warnings("scene.json").get("unused_history"), None, "of gravity")
    write_scene(**FINE, histories=histories, gravity_history="course", gravity=[0, 0, 0])
    equal(warnings("scene.json").get("unused_history"), says, "of no gravity")


def test_energy_gained():
    """energy out of nothing has a warning, which another integrator does without"""
    path = SOURCES + "/examples/scenes/airbag.json"
    text = warnings(path, "--duration", "0.2", "--integrator", "midpoint")["energy_gained"]
    assert re.match(r"midpoint gained \d+\.\d+ J out of nothing, beside \d+\.\d+ J that went in: a smaller dt, or an integrator that damps", text), text
    assert "energy_gained" not in warnings(path, "--duration", "0.2", "--integrator", "trbdf2")


def test_few_steps():
    """a duration of fewer than 20 steps has a warning; 20 steps have none, nor have integrators that choose their steps"""
    for steps, there in ((19, True), (20, False)):
        write_scene(duration=steps * 0.01)
        found = warnings("scene.json")
        equal(list(found), ["few_steps"] if there else [], f"{steps} steps")
    assert "0.19 s is only 19 steps of dt = 0.01 s" in warnings("scene.json", "--duration", "0.19")["few_steps"]
    for own in (("--integrator", "ida"), ("--controller", "error"), ("--integrator", "verlet", "--set", "/integrator/substeps=0")):
        equal(warnings("scene.json", "--duration", "0.1", *own), {}, own)
    assert "few_steps" in warnings("scene.json", "--duration", "0.1", "--integrator", "verlet", "--set", "/integrator/substeps=50")


def test_large_mesh():
    """a mesh from a file that is more than 20 m across has a warning that names the file; its advice helps"""
    write_text("cape.obj", "v 0 0 0\nv 115 0 0\nv 0 3 0\nf 1 2 3\n")
    for transform, there in (({}, True), ({"scale": 0.01}, False)):
        write_scene(**FINE, mesh={"file": "cape.obj", "transform": transform}, pins=[])
        found = warnings("scene.json")
        equal(list(found), ["large_mesh"] if there else [], transform)
        if there:
            equal(found["large_mesh"], '/cloth/0/mesh: cape.obj is 115 m across: is it in centimetres? '
                  'A mesh in centimetres needs "transform": {"scale": 0.01}', "text")


def test_tolerance():
    """a tolerance that the load bounds is no warning: the bound that is used is printed"""
    write_scene(**{**FINE, "integrator": {"dt": 0.01, "tolerance": 1}})
    equal(drape("run", "scene.json").stderr, "", "stderr")


def test_inside():
    """free nodes inside a collider, and triangles that it pierces, have a warning that counts them; others have none"""
    # The whole sheet, a metre wide at most, is inside a ball of 100 m and never leaves it.
    ball = {"type": "sphere", "name": "ball", "center": [0, 0, 0], "radius": 100}
    write_scene(**FINE, colliders=[ball])
    result = drape("run", "scene.json", "--duration", "0.01", "--summary", "s.json")
    found = {one["name"]: one["text"] for one in read_json("s.json")["warnings"]}
    free = read_json("s.json")["dofs"] // 3
    for name, verb in (("starts_inside", "start"), ("ends_inside", "end")):
        assert f"/colliders/0: {free} free nodes of the cloth {verb} inside ball, up to " in found[name], found
    # Contact throws a sheet out of such a depth: the run fails, so only what was known before it is printed.
    assert f"warning: {found['starts_inside']}\n" in result.stderr, result.stderr
    write_scene(**FINE, colliders=[{**ball, "center": [0, -200, 0]}])
    equal(warnings("scene.json"), {}, "a ball far below")
    # The corner of a cube of 1 cm through a triangle of 0.1 m, between the nodes.
    cube = {"type": "box", "name": "cube", "center": [0.37, 1e-3 - 0.005 * 3 ** 0.5, -0.34], "size": 0.01, "rotate": [1, 0, -1, 54.735610317245346]}
    grid = {"grid": "square", "columns": 8, "rows": 8, "width": 0.7, "height": 0.7}
    write_scene(**FINE, mesh=grid, pins=[{"corner": "top-left"}], colliders=[cube])
    found = {one["name"]: one["text"] for one in (drape("run", "scene.json", "--duration", "0.01", "--summary", "s.json"), read_json("s.json"))[1]["warnings"]}
    equal(found["starts_inside"], "/colliders/0: 1 triangle of the cloth starts pierced by cube: move the cloth or the collider", "pierced")


def test_dissipation():
    """an integrator that took more than half of the energy has a warning whose advice helps"""
    # A sheet that swings by a corner, without damping: within 1 s backward Euler takes most of what gravity gives, at dt = 1/50 s.
    write_scene(duration=1, integrator={"dt": 0.02}, terms=["stretch.edge", "bend.hinge"], pins=[{"corner": "top-left"}])
    text = warnings("scene.json")["numerical_dissipation"]
    energy = read_json("s.json")["energy"]
    share, taken, received = re.search(r"be dissipated (\d+) % of the energy that went in, (\S+) of (\S+) J", text).groups()
    # Nothing dissipates but the integrator, the sheet starts at rest and unstrained: what went in is the fall.
    equal(f"{energy['numerical']:.3g}", taken, "numerical")
    equal(f"{energy['kinetic'] + energy['elastic'] + energy['numerical']:.3g}", received, "received")
    assert int(share) > 50, text
    # Under a controller that chooses the steps, dt is not what makes them smaller.
    loose = ("--controller", "error", *(f"--set=/controller/{key}=1" for key in ("rtol", "atol_x", "atol_v")))
    assert ": a smaller rtol of the controller, or an integrator" in warnings("scene.json", *loose)["numerical_dissipation"]
    for advice in (("--dt", "0.002"), ("--integrator", "bdf2"), ("--integrator", "trbdf2"), ("--integrator", "ida"), ("--integrator", "midpoint", "--dt", "0.002")):
        equal(warnings("scene.json", *advice), {}, advice)


def test_dissipation_of_error_control():
    """an integrator that bounds its error has the warning where a stiff sheet lost more than a twentieth, and not where rtol resolves it"""
    grid = {"grid": "square", "columns": 9, "rows": 9, "width": 1, "height": 1}
    corners = [{"corner": "top-left"}, {"corner": "top-right"}]
    for stiffness in (1e6, 1e14):
        material = {"young_modulus": stiffness, "thickness": 1e-3, "density": 200}
        write_scene(duration=0.5, mesh=grid, material=material, terms=["stretch.edge"], pins=corners, integrator={"method": "ida"})
        found = warnings("scene.json")
        energy = read_json("s.json")["energy"]
        share = energy["numerical"] / (energy["kinetic"] + energy["elastic"] + energy["numerical"])
        equal("numerical_dissipation" in found, share > 0.05, f"{stiffness}: {share}")
        equal(share > 0.05, stiffness > 1e9, f"{stiffness}: {share}")
    assert re.match(r"ida dissipated \d+ % of the energy that went in, \S+ of \S+ J: a smaller rtol dissipates less", found["numerical_dissipation"]), found


def test_at_rest():
    """a sheet that does not move has no warning about energy"""
    write_scene(**FINE, gravity=[0, 0, 0])
    equal(warnings("scene.json"), {}, "at rest")


def test_slow_contact():
    """contact that takes most of the time, and longer than the motion lasts, has a warning; a scene without contact never has it"""
    path = SOURCES + "/examples/scenes/crumple.json"
    found = warnings(path, "--duration", "0.25")
    wall = read_json("s.json")["wall_s"]
    slow = wall["contact"] > 0.5 * wall["steps"] and wall["contact"] > 0.25  # not with sanitizers, which slow other stages more
    equal("slow_contact" in found, slow, str(wall))
    text = found.get("slow_contact", "")
    assert not slow or re.match(r"contact takes [5-9]\d % of the time of the steps, \S+ s for 0.25 s of motion: it takes less with no \"self_contact\" if layers never meet, "
                    r"or a coarser mesh; \"newton_k\" takes less time and is far less accurate", text), text
    write_scene(**FINE)
    assert "slow_contact" not in warnings("scene.json")


def test_many_iterations():
    """steps that take more than ten Newton iterations on average have a warning"""
    def found(*args):
        return warnings("scene.json", *args).get("many_iterations")
    ball = {"type": "sphere", "center": [0.5, -0.35, -0.5], "radius": 0.3}
    cloth = {"mesh": {"grid": "square", "columns": 12, "rows": 12, "width": 1, "height": 1}, "terms": ["stretch.edge", "bend.hinge"],
             "material": {"young_modulus": 1e8, "thickness": 2e-4, "areal_density": 0.1}}
    write_scene(cloth=[cloth], colliders=[ball], duration=0.5, integrator={"method": "be", "dt": 1 / 60, "tolerance": 1e-6})
    text = found()
    summary = read_json("s.json")
    a_step = summary["newton"]["iterations"] / (summary["steps"]["accepted"] + summary["steps"]["rejected"])
    assert a_step > 10, f"the scene of this test takes {a_step} iterations an attempt"
    equal(text, f"be took {a_step:.3g} Newton iterations an attempt, as where cloth buckles: a smaller dt "
          "is more accurate there and often takes hardly longer", "text")
    equal(found("--integrator", "newton_k"), None, "a method that does not converge its steps")
    write_scene(cloth=[cloth], duration=0.5, integrator={"method": "be", "dt": 1 / 60})
    equal(found(), None, "cloth that falls freely")


def test_report():
    """the report of a run has its warnings"""
    write_scene()
    good("run", "scene.json", "--out", "r")
    good("report", "r")
    assert "few_steps" in text_of("r/report.html")


if __name__ == "__main__":
    sys.exit(run_tests(globals()))
