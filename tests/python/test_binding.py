#!/usr/bin/env python3
"""test_binding.py: the declarations of the Python package are those of the headers. See package.py."""
import os
import re
import shutil
import subprocess
import sys

from package import BUILD, SOURCES, Skip, equal, run_tests

HEADERS = ["export.h", "drape.h", "extend.h"]


def read(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


def generated(folder):
    """The binding of the headers of a folder, and the file that checks it."""
    result = subprocess.run([sys.executable, SOURCES + "/python/generate.py", "binding.py", "check.c", *(f"{folder}/{name}" for name in HEADERS)],
                            capture_output=True, text=True, check=False)
    equal(result.returncode, 0, result.stderr)
    return read("binding.py"), read("check.c")


def compiles(include):
    """Whether check.c agrees with the headers of a folder. As in the build, an enumerator without a case is an error."""
    return subprocess.run(["cc", "-std=c11", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-I", include, "check.c"], capture_output=True, check=False).returncode == 0


def test_present():
    """the binding of the build is that of the headers, and agrees with them"""
    binding, check = generated(SOURCES + "/include/drape")
    equal(binding, read(BUILD + "/python/drape/_binding.py"))
    equal(check, read(BUILD + "/python/drape/binding_check.c"))
    assert compiles(SOURCES + "/include")


def test_changed_header():
    """every change of a header is noticed: a member, its type, an enumerator, its value, an argument, a result, a length"""
    shutil.copytree(SOURCES + "/include/drape", "include/drape")
    header = "include/drape/drape.h"
    text = read(header)
    generated("include/drape")
    assert compiles("include")
    changes = [("    double kinetic;", "    double kinetic, other;"), ("    double h_min, h_max;", "    float h_min, h_max;"),
               ("    int64_t unstable_modes;", "    uint64_t unstable_modes;"), ("    char text[400];", "    char text[401];"),
               ("    double point[3];  /* [m] of the cloth", "    float point[6];  /* [m] of the cloth"),
               ("    bool accepted;", "    int accepted;"), ("    double elastic;", "    double elastically;"),
               ("    DRAPE_E_STOPPED = -8 ", "    DRAPE_E_STOPPED = -8, DRAPE_E_OTHER = -9 "), ("DRAPE_E_SOLVER = -6", "DRAPE_E_SOLVER = -16"),
               ("drape_sim_advance(drape_sim *sim, double t_end)", "drape_sim_advance(drape_sim *sim, float t_end)"),
               ("DRAPE_API int32_t drape_sim_attached", "DRAPE_API int64_t drape_sim_attached"),
               ("DRAPE_API double drape_sim_time(const drape_sim *sim)", "DRAPE_API double drape_sim_time(drape_sim *sim)"),
               ("typedef drape_status drape_observer(void *user, const", "typedef drape_status drape_observer(void *user, int more, const")]
    for old, new in changes:
        equal(text.count(old), 1, old)
        with open(header, "w", encoding="utf-8") as file:
            file.write(text.replace(old, new))
        assert not compiles("include"), f"{new!r} is not noticed"


def test_whole():
    """every function that the library exports, and every struct and constant of the headers, is declared"""
    sys.path.insert(0, BUILD + "/python")
    from drape import _binding  # pylint: disable=import-outside-toplevel
    if not shutil.which("nm"):
        raise Skip("no nm")
    symbols = subprocess.run(["nm", "-D", "--defined-only", os.environ["DRAPE_LIBRARY"]], capture_output=True, text=True, check=True).stdout
    exported = set(re.findall(r" T (drape_\w+)", symbols))
    equal(exported, set(_binding.FUNCTIONS))
    text = "".join(re.sub(r"/\*.*?\*/", "", read(f"{SOURCES}/include/drape/{name}"), flags=re.S) for name in HEADERS)
    structs = set(re.findall(r"^typedef struct (\w+) \{", text, re.M))
    assert len(structs) > 40 and all(issubclass(getattr(_binding, name), _binding.Structure) for name in structs)
    constants = set(re.findall(r"\b(DRAPE_(?:OK|RETRY|E|EVENT|LOG|PARAM|QUERY)_?[A-Z_]*)\s*(?:=|,|\})", text))
    known = {f"DRAPE_{prefix}{member}" for kind, prefix in ((_binding.Status, ""), (_binding.EventKind, "EVENT_"), (_binding.LogLevel, "LOG_"), (_binding.ParamKind, "PARAM_"))
             for member in kind.__members__} | set(vars(_binding))
    equal(constants - known, set())


def test_documented():
    """functions, records and their members have the comments of the header"""
    sys.path.insert(0, BUILD + "/python")
    import drape  # pylint: disable=import-outside-toplevel
    assert "[J] of all nodes but pinned ones" in drape.Energy.kinetic.__doc__
    assert "Steps end at t0 + k dt" in drape.Sim.advance.__doc__ and "[s]" in drape.Sim.advance.__doc__
    for kind in (drape.Sim, drape.Scene, drape.Model, drape.Run, drape.Mesh):
        for name, member in vars(kind).items():
            assert name.startswith("_") or member.__doc__, f"{kind.__name__}.{name} is not documented"


if __name__ == "__main__":
    sys.exit(run_tests(globals()))
