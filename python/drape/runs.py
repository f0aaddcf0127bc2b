"""Finished runs, and the program that makes them."""
import contextlib
import csv
import errno
import html
import json
import math
import os
import re
import shutil
import subprocess
import tempfile
from typing import Any, Callable, Dict, List, Mapping, Optional, Sequence, Union

import numpy as np

from ._binding import Energy, EventKind, Status
from ._library import ArgumentError, Error, FileError, ParseError, error_of, lib, program, to_json
from .mesh import Mesh
from .scene import _FILES, Model, Scene
from .sim import Sim

Table = Any  # a pandas.DataFrame or, without pandas, a dictionary of arrays

_STEPS = ("attempt", "t", "h", "accepted", "status", "reason", "iterations", "residual", "tolerance", "error", "left")
_ENERGY = ("frame", "t", "t_state", "kinetic", "elastic", "gravity", "contact", "total", "dissipated", "numerical", "work")


def table(columns: Mapping[str, Any]) -> Table:
    """Columns as a pandas.DataFrame, or as a dictionary of arrays where pandas is not installed."""
    arrays = {name: column if isinstance(column, np.ndarray) else _values(column) for name, column in columns.items()}
    try:
        import pandas
    except ImportError:
        return arrays
    return pandas.DataFrame(arrays)


def _regular(path):
    """The path of a file of a run, unless a pipe or a device has its name: reading that might never end."""
    if os.path.exists(path) and not os.path.isfile(path):
        raise FileError(f'cannot read "{path}": it is not a regular file')
    return path


def read_csv(path) -> Table:
    """A table that Drape wrote. Columns of numbers are arrays of float64 or, if all are whole, int64; others have texts."""
    with open(_regular(path), newline="", encoding="utf-8") as file:
        reader = csv.reader(file)
        names: List[str] = next(reader, [])
        rows = [row for row in reader if len(row) == len(names)]  # a run that was killed may have left half a line
    return table({name: _column([row[k] for row in rows]) for k, name in enumerate(names)})


def _values(column: Sequence) -> np.ndarray:
    """Numbers, of which None is nan; else texts."""
    numeric = all(item is None or isinstance(item, (int, float, np.number)) for item in column) and any(item is not None for item in column)
    return np.array([math.nan if item is None else item for item in column]) if numeric else np.array(column, dtype=object)


def _column(texts: List[str]) -> np.ndarray:
    for kind in (np.int64, np.float64) if any(texts) else ():
        try:
            return np.array([text or "nan" for text in texts] if kind is np.float64 else texts, dtype=kind)
        except (ValueError, OverflowError):
            pass
    return np.array(texts, dtype=object)


class Run:
    """A finished run: `drape.load("run/")`, `drape.run(scene)`, or `sim.record()`.

    times [s] and positions (frames x nodes x 3 [m]) are those of the frames; `steps` has a row for each attempted step, `energy` [J] one for each frame
    (docs/output.md); `summary` is a dictionary, `scene` the scene, and `model` its model."""

    def __init__(self, scene: Scene, positions: Optional[np.ndarray], steps: Table, energy: Table, summary: Dict[str, Any], folder: Optional[str] = None,
                 model: Optional[Model] = None):
        self.scene, self.positions, self.steps, self.energy, self.summary, self.folder = scene, positions, steps, energy, summary, folder
        self._model = model
        self._temporary: Optional[tempfile.TemporaryDirectory] = None

    @property
    def model(self) -> Model:
        """The compiled scene."""
        if self._model is None:
            self._model = Model(self.scene)
        return self._model

    @property
    def times(self) -> np.ndarray:
        """[s] of the frames."""
        return np.asarray(self.energy["t"], float)

    def mesh(self, frame: int = -1, cloth: Optional[int] = None) -> Mesh:
        """The cloth in a frame."""
        if self.positions is None:
            raise FileError(f"{self}: has no positions.npy")
        return self.model.mesh(cloth, np.array(self.positions[frame]))

    def render_positions(self, frame: int = -1) -> np.ndarray:
        """Positions of the vertices of render_mesh in a frame [m]: of `render_positions.npy` or, if the run has none, computed from the positions."""
        path = os.path.join(self.folder, "render_positions.npy") if self.folder else ""
        if os.path.exists(path):
            return np.array(np.load(_regular(path), mmap_mode="r")[frame])
        if self.positions is None:
            raise FileError(f"{self}: has no positions.npy")
        return self.model.render_positions(np.array(self.positions[frame]))

    def render_mesh(self, frame: int = -1) -> Mesh:
        """What frames show: the render meshes of the scene in a frame, of all cloths."""
        return Mesh(self.render_positions(frame), self.model.render_mesh().triangles)

    def save(self, folder) -> "Run":
        """Writes a run that was recorded in memory into a new folder, from which drape.load and the program read it. The folder has copies of the meshes
        that the scene names, as one of `drape run` has, so it can be moved; frames of an animated mesh in several files stay where they are."""
        if self.positions is None:
            raise FileError(f"{self}: has no positions.npy")
        os.makedirs(folder)
        self.scene.write(os.path.join(folder, "scene.json"))
        _bring_files(folder)
        np.save(os.path.join(folder, "positions.npy"), np.ascontiguousarray(self.positions, "<f8"))
        for name, columns in (("steps", self.steps), ("energy", self.energy)):
            with open(os.path.join(folder, f"{name}.csv"), "w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file, lineterminator="\n")
                names = list(columns)
                writer.writerow(names)
                writer.writerows(zip(*(_texts(np.asarray(columns[key])) for key in names)))
        with open(os.path.join(folder, "summary.json"), "w", encoding="utf-8") as file:
            file.write(to_json(self.summary) + "\n")
        self.folder = os.path.abspath(folder)
        return self

    def report(self, path=None) -> "Page":
        """The report of the program: a page with the cloth in motion beside plots of energies and steps."""
        folder = self.folder
        if folder is None:
            self._temporary = self._temporary or tempfile.TemporaryDirectory(prefix="drape-")
            folder = os.path.join(self._temporary.name, "run")
            if not os.path.exists(folder):
                self.save(folder)
                self.folder = None
        out = os.path.abspath(path) if path else tempfile.mkstemp(prefix="drape-", suffix=".html")[1]
        try:
            call("report", folder, "--out", out)
            with open(out, encoding="utf-8") as file:
                return Page(file.read(), out if path else None)
        finally:
            if not path:
                os.unlink(out)

    def view(self) -> "Page":
        """The report, shown in a notebook."""
        return self.report()

    def __repr__(self) -> str:
        return f"Run({len(self.times)} frames{', ' + self.folder if self.folder else ''})"


class Page:
    """A page of HTML. A notebook shows it; elsewhere, write it to a file."""

    def __init__(self, text: str, path: Optional[str] = None, height: int = 640):
        self.text, self.path, self.height = text, path, height

    def _repr_html_(self) -> str:
        return f'<iframe srcdoc="{html.escape(self.text)}" width="100%" height="{self.height}" style="border:0" allowfullscreen></iframe>'

    def write(self, path) -> None:
        """Writes the page into a file, for a browser."""
        with open(path, "w", encoding="utf-8") as file:
            file.write(self.text)

    def __repr__(self) -> str:
        return f"Page({self.path or f'{len(self.text)} characters'})"


def load(folder) -> Run:
    """A finished run, or one in progress, from the folder that `drape run --out` wrote. Positions are mapped into memory, not read."""
    folder = os.path.abspath(folder)
    if not os.path.isfile(os.path.join(folder, "scene.json")):
        raise FileError(f'"{folder}" is not the folder of a run: it has no scene.json')
    positions, summary = os.path.join(folder, "positions.npy"), {}
    if os.path.exists(os.path.join(folder, "summary.json")):
        with open(_regular(os.path.join(folder, "summary.json")), encoding="utf-8") as file:
            summary = json.load(file)
    return Run(Scene(os.path.join(folder, "scene.json")), np.load(_regular(positions), mmap_mode="r") if os.path.exists(positions) else None,
               read_csv(os.path.join(folder, "steps.csv")), read_csv(os.path.join(folder, "energy.csv")), summary, folder)


def run(scene: Union[Scene, Mapping, str, os.PathLike], values: Optional[Mapping[str, Any]] = None, *, out=None, **options: Any) -> Run:
    """Runs a scene for its duration. values: changes of the scene by pointers, as {"/integrator/dt": 1e-3}.

    Without `out` the frames are kept in memory, and options are those of drape.Sim. With it, the program `drape run` writes a folder, and options are its
    options (`drape run --help`), such as checkpoint_every=10, resume=True or format="npy,glb"; without a format, frames are written as npy.

    accuracy="1mm", as an option or in the scene, always is a run of the program, without `out` in a temporary folder that goes with the Run; its
    summary["accuracy_of"] says what was reached (docs/accuracy.md).

    A run that fails or is stopped raises an exception in both cases, and `run` of the exception is the run up to there."""
    scene = Scene(scene)
    if not isinstance(values, (Mapping, type(None))):
        raise TypeError(f"values: needs a dictionary of pointers and values, has {type(values).__name__}; a folder is given by out=")
    scene.update(values or {})
    if out is None and ("accuracy" in options or scene.get("/accuracy") is not None):
        folder = tempfile.TemporaryDirectory(prefix="drape-")  # pylint: disable=consider-using-with
        result = run(scene, out=os.path.join(folder.name, "run"), **options)
        result._temporary = folder
        return result
    if out is None:
        return Sim(scene, **options).record()
    if "format" not in options and "npy" not in (scene.get("/output/formats") or []):
        options["format"] = ",".join([*(scene.get("/output/formats") or []), "npy"])
    with SceneFile(scene) as path:
        try:
            call("run", path, "--out", os.fspath(out), *arguments(options), folder=out)
        except (ArgumentError, ParseError):  # before the first step
            raise
        except BaseException as error:
            _attach(error, lambda: load(out))
            raise
    return load(out)


def _attach(error: BaseException, run_of: Callable[[], Run]) -> None:
    """Gives an exception the run that it has ended; where that cannot be had, the exception matters more than why."""
    error.run = None  # type: ignore[attr-defined]
    with contextlib.suppress(Exception):
        error.run = run_of()  # type: ignore[attr-defined]


def _bring_files(folder) -> None:
    """Copies the files that scene.json names into its folder, and names them there. What is several files is not copied."""
    path = os.path.join(folder, "scene.json")
    there: Dict[str, str] = {}

    def bring(item, key=None):
        if isinstance(item, dict):
            return {name: bring(part, name) for name, part in item.items()}
        if isinstance(item, list):
            return [bring(part) for part in item]
        if key not in _FILES or not isinstance(item, str) or not os.path.isfile(item):
            return item
        if os.path.realpath(os.path.dirname(item)) == os.path.realpath(folder):
            return os.path.basename(item)
        if item not in there:
            ending = re.search(r"\.[0-9A-Za-z]{1,14}\Z", item)
            there[item] = f"scene_file_{len(there)}{ending[0] if ending else ''}"
            shutil.copyfile(item, os.path.join(folder, there[item]))
        return there[item]

    with open(path, encoding="utf-8") as file:
        data = bring(json.load(file))
    with open(path, "w", encoding="utf-8") as file:
        file.write(to_json(data) + "\n")


def record_sim(sim: Sim, until: Optional[float]) -> Run:
    """Advances a sim and keeps its frames, steps and energies in memory. An exception that ends the advance has the run up to there."""
    steps: Dict[str, list] = {name: [] for name in _STEPS}
    energies: Dict[str, list] = {name: [] for name in _ENERGY}
    frames: List[np.ndarray] = []

    def observe(event):
        if event.kind == EventKind.ATTEMPT:
            a = event.attempt
            row = (a.index, a.t, a.h, int(a.accepted), _name(a.status), a.reason, a.iterations, a.residual, a.tolerance, a.error, a.left)
            for name, value in zip(_STEPS, row):
                steps[name].append(value)
        elif event.kind == EventKind.FRAME:
            e, work = sim.energy, sim.work
            total = e.kinetic + e.elastic + e.gravity + e.contact
            row = (event.frame, event.time, sim.time, e.kinetic, e.elastic, e.gravity, e.contact, total, e.dissipated, e.numerical, sum(work.values()))
            for name, value in (*zip(_ENERGY, row), *work.items()):
                energies.setdefault(name, []).append(value)
            frames.append(event.positions.copy())

    def run_so_far(status: Status, message: str) -> Run:
        positions = np.array(frames).reshape(len(frames), sim.model.node_count, 3)
        return Run(sim.model.scene.copy(), positions, table(steps), table(energies), _summary(sim, len(frames), status, message), model=sim.model)

    sim.observe(observe)
    try:
        stopped = sim.advance(sim.model.duration if until is None else until)
    except BaseException as error:
        status = error.status if isinstance(error, Error) else Status.E_STOPPED
        _attach(error, lambda: run_so_far(status, str(error) or type(error).__name__))
        raise
    finally:
        sim.unobserve(observe)
    return run_so_far(Status.OK, f"stopped by the event {stopped.name}" if stopped else "")


def _summary(sim: Sim, frames: int, status: Status, message: str) -> Dict[str, Any]:
    s, e = sim.statistics, sim.energy
    return {"status": _name(status), "message": message, "version": lib.drape_version().decode(), "nodes": sim.model.node_count,
            "dofs": sim.model.dof_count, "nnz": sim.model.nonzero_count, "frames": frames, "time": sim.time,
            "steps": {"accepted": s.steps_accepted, "rejected": s.steps_rejected, "unconverged": s.steps_unconverged, "held": s.steps_held,
                      "h_min": s.h_min, "h_max": s.h_max, "reasons": sim.reasons},
            "newton": {"iterations": s.newton_iterations, "jacobians": s.jacobians, "factorizations": s.factorizations,
                       "linear_iterations": s.linear_iterations, "residuals": s.residuals},
            "energy": e._asdict(), "work": sim.work, "strain": {"min": s.strain_min, "max": s.strain_max},
            "warnings": [w._asdict() for w in sim.warnings], "hash": f"{sim.hash:016x}"}


# ---- The program ----

class SceneFile:
    """A scene as a file for the program: its own, if it has not been changed, else one that is removed afterwards, and that errors do not name."""

    def __init__(self, scene: Union[Scene, Mapping, str, os.PathLike]):
        self.scene = scene if isinstance(scene, Scene) else Scene(scene)
        self.folder: Optional[tempfile.TemporaryDirectory] = None

    def __enter__(self) -> str:
        if self.scene.path and self.scene.data == self.scene._loaded:
            return self.scene.path
        self.folder = tempfile.TemporaryDirectory(prefix="drape-")
        path = os.path.join(self.folder.name, "scene.json")
        self.scene.write(path)
        return path

    def __exit__(self, _kind: Any, error: Any, _trace: Any) -> None:
        if not self.folder:
            return
        if isinstance(error, Error):
            written = re.escape(os.path.join(self.folder.name, "scene.json"))
            error.args = (re.sub(written + r"(:\d+)*", lambda _: self.scene.path or "scene", str(error)), *error.args[1:])
        self.folder.cleanup()


def arguments(options: Mapping[str, Any]) -> List[str]:
    """Options of the program: checkpoint_every=10 is --checkpoint-every 10, resume=True is --resume, a list is joined by commas, and set={pointer: value}
    and axis={pointer: "from:to:n"} become one option each."""
    result: List[str] = []
    for name, value in options.items():
        flag = "--" + name.replace("_", "-")
        if isinstance(value, Mapping):
            for pointer, item in value.items():
                text = ":".join(str(part) for part in item) if isinstance(item, tuple) else item if isinstance(item, str) else to_json(item)
                result += [flag, f"{pointer}={text}"]
        elif value is True:
            result += [flag]
        elif value is not None and value is not False:
            result += [flag, ",".join(map(str, value)) if isinstance(value, (list, tuple)) else os.fspath(value) if isinstance(value, os.PathLike) else str(value)]
    return result


def call(*command: str, folder=None, accept: Sequence[int] = (0,)) -> str:
    """Runs the program and returns what it prints. If it fails, its message is raised, with the status of the run in a folder."""
    process = subprocess.Popen([program(), *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True)
    try:
        output, errors = process.communicate()
    except BaseException:  # Ctrl-C reaches the program, too, which ends in order
        process.terminate()
        process.wait()
        raise
    if process.returncode in accept:
        return output
    status = {2: Status.E_ARGUMENT, 130: Status.E_STOPPED}.get(process.returncode, Status.E_SOLVER)
    summary = os.path.join(folder, "summary.json") if folder else ""
    if process.returncode == 1 and os.path.exists(summary):
        with open(_regular(summary), encoding="utf-8") as file:
            name = json.load(file).get("status", "").upper()
        status = Status.__members__.get(name, status)
    lines = [line for line in errors.splitlines() if line.strip()] or output.splitlines()[-1:]
    if lines and lines[-1].rpartition(": ")[2] in _OF_THE_SYSTEM:
        status = Status.E_FILE
    raise error_of(status, "\n".join(lines[-3:]) or f"drape {command[0]} ended with {process.returncode}")


_OF_THE_SYSTEM = {os.strerror(number) for number in errno.errorcode}  # ends of messages about files


def _name(status: int) -> str:
    return lib.drape_status_name(status).decode()


def _texts(column: np.ndarray) -> List[str]:
    """Numbers with all digits."""
    return [repr(value) if isinstance(value, float) else str(value) for value in column.tolist()]
