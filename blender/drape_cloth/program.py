"""The program `drape`: where it is, what it offers, and a run of it in the background. Nothing here needs Blender."""
import json
import os
import re
import shutil
import signal
import subprocess
from typing import Dict, List, Optional, Tuple

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


class Problem(Exception):
    """What keeps a cloth from being baked, in words for the user."""


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


class Bake:
    """`drape run` on the scene in a folder, in a process of its own. Frames appear in the folder `run`, with a checkpoint now and then, so that
    a run that is cancelled or killed can be resumed. resume: continue such a run, with the scene as it was."""

    def __init__(self, program: str, folder: str, frames: int, resume: bool = False, threads: int = 1):
        self.folder, self.frames = folder, frames
        command = [program, "run", SCENE, "--out", RUN, "--checkpoint-every", str(CHECKPOINT_EVERY), "--threads", str(threads)]
        self.cancelled = False
        self._frames = os.path.join(folder, RUN, "energy.csv")
        self._before = None if resume else self._written()
        with open(os.path.join(folder, LOG), "wb") as log:
            try:
                self._process = subprocess.Popen(command + ["--resume"] * resume, cwd=folder, stdin=subprocess.DEVNULL, stdout=log,
                                                 stderr=subprocess.STDOUT, env=environment())
            except OSError as error:
                raise Problem(f"{program} cannot be started: {error}") from error

    def running(self) -> bool:
        return self._process.poll() is None

    def wait(self) -> None:
        self._process.wait()

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
        with open(os.path.join(self.folder, LOG), encoding="utf-8", errors="replace") as file:
            return file.read()


class Names:
    """The objects of Blender that the parts of a scene were made from, for messages: cloth, what is simulated for it, and those of the colliders by number."""

    def __init__(self, cloth: str, simulated: str, colliders: List[str], files: Dict[str, str]):
        self.cloth, self.simulated, self.colliders, self.files = cloth, simulated, colliders, files

    @staticmethod
    def of(scene: dict, simulated: Optional[str] = None) -> "Names":
        """From the names that the scene gives them, and the files that it reads. simulated: the object that is simulated in place of the cloth."""
        colliders = [item["name"] for item in scene["colliders"]]
        files = {item[key]: item["name"] for item in scene["colliders"] for key in ("file", "mesh") if key in item}
        cloth = scene["cloth"][0]["name"]
        simulated = simulated if simulated and "render_mesh" in scene["cloth"][0] else cloth
        return Names(cloth, simulated, colliders, {scene["cloth"][0]["mesh"]["file"]: simulated, **files})

    def explain(self, message: str) -> str:
        """The message of the library, with the name of the object that it is about in place of line and column of the scene file."""
        message = re.sub(rf"^{re.escape(SCENE)}:\d+:\d+: ", "", message)
        place = re.search(r"/(cloth|colliders)/(\d+)\b", message)
        about = None
        if place:
            number = int(place.group(2))
            of_mesh = re.match(r"/(mesh|pins|start)\b", message[place.end():])
            about = (self.simulated if of_mesh else self.cloth) if place.group(1) == "cloth" else self.colliders[number] if number < len(self.colliders) else None
        else:
            about = next((name for file, name in self.files.items() if re.search(rf"(?<![\w.]){re.escape(file)}(?![\w.])", message)), None)
        return f"{about or self.cloth}: {message}"


def read_scene(folder: str) -> dict:
    """The scene of a bake."""
    try:
        with open(os.path.join(folder, SCENE), encoding="utf-8") as file:
            return json.load(file)
    except (OSError, ValueError) as error:
        raise Problem(f"there is no bake in {folder}: {error}") from error
