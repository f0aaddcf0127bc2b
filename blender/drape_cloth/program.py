"""The program `drape`: where it is, what it offers, and a run of it in the background. Nothing here needs Blender."""
import contextlib
import ctypes
import json
import os
import re
import shutil
import signal
import subprocess
import threading
from typing import Callable, Dict, Iterator, List, NamedTuple, Optional, Tuple

import numpy as np

from .folder import Folder, Problem

SCENE = "scene.json"
"""the scene in the folder of a bake"""
RUN = "run"
"""the folder in it that `drape run` writes"""
LOG = "drape.log"
"""what `drape run` printed"""
CHECKPOINT_EVERY = 5
"""frames from one checkpoint to the next"""
INTERRUPTED = 130
"""exit code of a run that was asked to stop"""
MAX_ASIDE = 20
"""changed files that a bake sets aside at most: a run has fewer"""


def find(preferred: str = "") -> str:
    """The program: the preferred path, or the first `drape` of the PATH."""
    if preferred:
        if os.path.isfile(preferred) and os.access(preferred, os.X_OK):
            return preferred
        raise Problem(f"there is no program {preferred}: see the preferences of the add-on")
    found = shutil.which("drape")
    if not found:
        raise Problem("the program drape is not on the PATH: install it, or name it in the preferences of the add-on")
    return found


def environment() -> Dict[str, str]:
    """Numbers in the files of drape do not depend on the locale, but its messages should be those of the documentation."""
    return {**os.environ, "LC_ALL": "C.UTF-8"}


def _ask(program: str, *arguments: str) -> str:
    try:
        done = subprocess.run([program, *arguments], capture_output=True, text=True, encoding="utf-8", errors="replace", timeout=60,
                              env=environment(), stdin=subprocess.DEVNULL, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise Problem(f"{program} does not answer: {error}") from error
    if done.returncode:
        raise Problem(done.stderr.strip() or f"{program} {' '.join(arguments)} ended with {done.returncode}")
    return done.stdout


_fabrics: Dict[Tuple[str, float], List[Tuple[str, str]]] = {}


def fabrics(program: str) -> List[Tuple[str, str]]:
    """Name and description of each measured fabric, as this program has them."""
    key = (program, os.path.getmtime(program))
    if key not in _fabrics:
        rows = re.findall(r"^\| `(\w+)` \| (.*?) \| .* \|$", _ask(program, "list", "fabrics", "--markdown"), re.M)
        _fabrics[key] = rows
    return _fabrics[key]


@contextlib.contextmanager
def interrupts(call: Callable[[], None]) -> Iterator[None]:
    """Calls this function at Ctrl-C. Without a window Blender takes the signal by a handler of its own, which Python neither sees nor can put back."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    get, put = ctypes.pythonapi.PyOS_getsig, ctypes.pythonapi.PyOS_setsig
    get.restype = put.restype = ctypes.c_void_p
    get.argtypes, put.argtypes = [ctypes.c_int], [ctypes.c_int, ctypes.c_void_p]
    of_process, of_python = get(signal.SIGINT), signal.signal(signal.SIGINT, lambda *_: call())
    try:
        yield
    finally:
        if of_python is not None:
            signal.signal(signal.SIGINT, of_python)
        put(signal.SIGINT, of_process)


def by_accuracy(folder: str) -> bool:
    """Whether the scene in the folder of a bake asks for an accuracy: its run is repeated, so it has no checkpoints."""
    with open(os.path.join(folder, SCENE), encoding="utf-8") as file:
        return "accuracy" in json.load(file)


class Bake:
    """`drape run` on the scene in a folder that was taken, in a process of its own. Frames appear in the folder `run`, with a checkpoint now and then, so that
    a run that is cancelled or killed can be resumed. resume: continue such a run, with the scene as it was.

    A file of an earlier run that was changed since, which the program refuses to replace, is set aside under another name, and the run starts again."""

    def __init__(self, program: str, folder: Folder, frames: int, resume: bool = False, threads: int = 1):
        self.folder, self.frames = folder, frames
        self._command = [program, "run", SCENE, "--out", RUN, "--threads", str(threads)] + ["--resume"] * resume
        if not by_accuracy(folder.path):
            self._command += ["--checkpoint-every", str(CHECKPOINT_EVERY)]
        elif resume:
            raise Problem(f"{folder.owner.name}: a bake by accuracy is run several times, and cannot be resumed: bake it again")
        self.cancelled, self._resume = False, resume
        self._restarts = 0
        self._frames = os.path.join(folder.path, RUN, "energy.csv")
        if folder.is_directory(RUN) is False and not resume:
            folder.set_aside(RUN)
        if not folder.is_directory(RUN) and resume:
            raise Problem(f"{folder.owner.name}: there is no folder {RUN} in {folder.path}, so there is nothing to resume")
        self._before = None if resume else self._written()
        self._start()

    def _start(self) -> None:
        try:
            self._log = self.folder.part(LOG)
            self._process = subprocess.Popen(self._command, cwd=self.folder.path, stdin=subprocess.DEVNULL, stdout=self._log, stderr=subprocess.STDOUT, env=environment())
        except OSError as error:
            raise Problem(f"{self._command[0]} cannot be started: {error}") from error

    def running(self) -> bool:
        return self._process.poll() is None or not self.cancelled and not self._resume and self._set_aside()

    def wait(self) -> None:
        while self.running():
            self._process.wait()

    def _set_aside(self) -> bool:
        """After the end: whether a changed file stopped the run, and no longer does."""
        refused = re.search(rf'"({RUN}/[^"/]+)" (?:would be replaced, but|is not a manifest)', self.log()) if self._process.returncode else None
        if not refused or self._restarts == MAX_ASIDE:
            return False
        try:
            self.folder.set_aside(refused.group(1))
        except OSError:
            return False  # the program's message remains
        self._restarts += 1
        self._start()
        return True

    def done(self) -> int:
        """Frames that are finished. Each has a line in energy.csv, which also has a line of titles."""
        if self._written() in (None, self._before):
            return 0
        try:
            with open(self._frames, "rb") as file:
                return max(file.read().count(b"\n") - 1, 0)
        except OSError:
            return 0

    def _written(self) -> Optional[int]:
        """When energy.csv was written [ns]: that of an earlier bake stays until drape has read the scene."""
        try:
            return os.stat(self._frames).st_mtime_ns
        except OSError:
            return None

    def cancel(self) -> None:
        """Asks the run to stop after the step in progress. The frames so far stay, and a checkpoint from which it can be resumed."""
        self.cancelled = True
        if self.running():
            self._process.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """Ends the run at once: Blender is being closed. It can be resumed from its last checkpoint."""
        self.cancelled = True
        if self.running():
            self._process.kill()
        self._process.wait()
        with contextlib.suppress(OSError):
            self.close()

    def result(self, names: "Names") -> Optional[str]:
        """After the end: None if the run completed or was cancelled, else what went wrong."""
        code = self._process.returncode
        if code == 0 or self.cancelled and code in (INTERRUPTED, -signal.SIGTERM, -signal.SIGKILL):
            return None
        said = [line for line in self.log().splitlines() if line.strip() and not line.startswith("warning: ")]
        return names.explain(said[-1] if said else f"drape ended with {code}")

    def warnings(self, names: "Names") -> List[str]:
        """What the program found unusual about the run."""
        return [names.explain(line[len("warning: "):]) for line in self.log().splitlines() if line.startswith("warning: ")]

    def log(self) -> str:
        """What the program printed so far. It goes on writing at the end of the file."""
        fd = self._log.fileno()
        return os.pread(fd, os.fstat(fd).st_size, 0).decode("utf-8", "replace")

    def close(self) -> None:
        """After the end: the folder is free for other bakes."""
        try:
            self.folder.publish(LOG)
        finally:
            self._log.close()
            self.folder.close()


class Part(NamedTuple):
    """What a part of a scene was made from."""
    name: str  # of the object
    vertices: Optional[np.ndarray] = None  # of the object, by the number of the node; None: nodes have the numbers of vertices


class Names:
    """The objects of Blender that the parts of a scene were made from, for messages: cloth, what is simulated for it, and those of the colliders by number."""

    def __init__(self, cloth: str, simulated: str, colliders: List[Part], files: Dict[str, Part]):
        self.cloth, self.simulated, self.colliders, self.files = Part(cloth), Part(simulated), colliders, files

    def explain(self, message: str) -> str:
        """The message of the library as it is true in Blender: with the name of the object that it is about in place of line and column of the scene file,
        the numbers of its vertices, and places in the axes of Blender."""
        message = re.sub(rf"^{re.escape(SCENE)}:\d+:\d+: ", "", message)
        place = re.search(r"/(cloth|colliders)/(\d+)\b", message)
        about = None
        if place:
            number = int(place.group(2))
            of_mesh = re.match(r"/(mesh|pins|start)\b", message[place.end():])
            about = (self.simulated if of_mesh else self.cloth) if place.group(1) == "cloth" else self.colliders[number] if number < len(self.colliders) else None
        else:
            about = next((part for file, part in self.files.items() if re.search(rf"(?<![\w.]){re.escape(file)}(?![\w.])", message)), None)
        about = about or self.cloth
        return f"{about.name}: {z_up(renumbered(message, about.vertices))}"


def renumbered(message: str, vertices: Optional[np.ndarray]) -> str:
    """The message with vertices[i] in place of node i."""
    def number(match):
        node = int(match.group())
        return str(vertices[node]) if node < len(vertices) else match.group()

    if vertices is None:
        return message
    return re.sub(r"\b(?:nodes?|edge|vertex) \d+(?:,? (?:and )?\d+)*", lambda phrase: re.sub(r"\d+", number, phrase.group()), message)


def z_up(message: str) -> str:
    """The message with its places, which have y up, in the axes of Blender: (x, y, z) becomes (x, -z, y)."""
    def turned(match):
        x, y, z = match.groups()
        return f"({x}, {z[1:] if z[0] == '-' else z if float(z) == 0 else '-' + z}, {y})"

    real = r"(-?\d[\d.]*(?:e[-+]?\d+)?)"
    return re.sub(rf"\({real},? {real},? {real}\)", turned, message)


class Exported(NamedTuple):
    """A scene that an export wrote, as it is read again."""
    frames: int
    names: Names


def vertices_file(mesh: str) -> str:
    """Name of the file beside the mesh of a collider that has the number of the vertex of each of its nodes, if they differ."""
    return os.path.splitext(mesh)[0] + "_vertices.npy"


def read(folder: str, simulated: Optional[str] = None) -> Exported:
    """The scene in the folder of a bake. simulated: the object that is simulated in place of the cloth."""
    def part(item):
        path = os.path.join(folder, vertices_file(item["mesh" if "mesh" in item else "file"])) if "file" in item else ""
        return Part(item["name"], np.load(path) if os.path.exists(path) else None)

    try:
        with open(os.path.join(folder, SCENE), encoding="utf-8") as file:
            scene = json.load(file)
        cloth = scene["cloth"][0]
        colliders = [part(item) for item in scene["colliders"]]
        files = {item[key]: made for item, made in zip(scene["colliders"], colliders) for key in ("file", "mesh") if key in item}
        simulated = simulated if simulated and "render_mesh" in cloth else cloth["name"]
        return Exported(1 + round(scene["duration"] * scene["frame_rate"]), Names(cloth["name"], simulated, colliders, {cloth["mesh"]["file"]: Part(simulated), **files}))
    except OSError as error:
        raise Problem(f"there is no bake in {folder}: {error}") from error
    except (ValueError, ArithmeticError, EOFError) as error:
        raise Problem(f"{os.path.join(folder, SCENE)} is not the scene of a bake: {error}") from error
    except (LookupError, TypeError, AttributeError) as error:
        raise Problem(f"{os.path.join(folder, SCENE)} is not the scene of a bake") from error
