"""Experiments: the verbs of the program that run a scene many times (docs/lab.md). They return results.csv as a table: a pandas.DataFrame or, without
pandas, a dictionary of arrays. With `out`, the folder keeps cases, figures and report, and the same call continues it; without, they are removed."""
import json
import os
import tempfile
from typing import Any, List, Mapping, Optional, Sequence, Union

from .runs import SceneFile, Table, arguments, call, read_csv, table
from .scene import Scene

AnyScene = Union[Scene, Mapping, str, os.PathLike]


def _experiment(verb: str, scene: AnyScene, out, options: Mapping[str, Any], name: str = "results.csv", more: Sequence[str] = ()) -> Table:
    with tempfile.TemporaryDirectory(prefix="drape-") as folder, SceneFile(scene) as path:
        out = os.path.join(folder, "out") if out is None else os.fspath(out)
        call(verb, path, "--out", out, *arguments(options), *more)
        return read_csv(os.path.join(out, name))


def tradeoff(scene: AnyScene, *, out=None, **options: Any) -> Table:
    """Cost and accuracy of integrators against a precise reference. Options are those of `drape tradeoff --help`: integrators=["be", "ida"], jobs=2,
    budget=1 (minutes), duration=0.2 [s], set={"/integrator/tolerance": 1e-8} ..."""
    return _experiment("tradeoff", scene, out, options)


def stability(scene: AnyScene, axis: Mapping[str, Union[str, tuple]], *, out=None, **options: Any) -> Table:
    """Where runs complete, reject steps, stop or explode, over one to three axes: axis={"/integrator/dt": "1e-3:1e-1:9log"}, or a tuple (1e-3, 1e-1, "9log").
    Options are those of `drape stability --help`."""
    return _experiment("stability", scene, out, {"axis": axis, **options})


def converge(scene: AnyScene, *, out=None, **options: Any) -> Table:
    """Orders of convergence in time and, with space=True, of the mesh. Options are those of `drape converge --help`."""
    return _experiment("converge", scene, out, options)


def modes(scene: AnyScene, *, out=None, **options: Any) -> Table:
    """Eigenfrequencies about a state of the scene or, with buckling=True, buckling loads: a row for each mode. Options are those of `drape modes --help`:
    count=10, state="end" ..."""
    return _experiment("modes", scene, out, options, "modes.csv")


def path(scene: AnyScene, *, out=None, nodes: Sequence[int] = (), **options: Any) -> Table:
    """The path of equilibria as all loads grow: a row for each point, with the displacements of these nodes. Options are those of `drape path --help`:
    to=1.2, branch="+" ..."""
    return _experiment("path", scene, out, options, "path.csv", [text for node in nodes for text in ("--node", str(node))])


def validate(reference: Union[str, Sequence[str], None] = None) -> Table:
    """Runs the physical references (docs/validate.md), or some of them by name: a row for each case, with the values obtained and expected."""
    names: List[Optional[str]] = [None] if reference is None else [reference] if isinstance(reference, str) else list(reference)
    cases = []
    for name in names:
        cases += json.loads(call("validate", *([name] if name else []), "--json", accept=(0, 1)))
    keys = list(dict.fromkeys(key for case in cases for key in case))
    return table({key: [case.get(key) for case in cases] for key in keys})


def info(scene: AnyScene, **options: Any) -> dict:
    """What a scene models, every parameter with its value, and what each part costs, as `drape info --json`."""
    with SceneFile(scene) as path:
        return json.loads(call("info", path, "--json", *arguments(options)))


def schema() -> dict:
    """The JSON Schema of a scene."""
    return json.loads(call("list", "--schema"))
