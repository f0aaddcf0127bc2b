"""Scenes and models."""
import copy
import ctypes
import json
import operator
import os
import re
import shutil
import tempfile
from typing import Any, Dict, Iterator, List, Mapping, Optional, Sequence, Union

import numpy as np

from . import _binding as c
from ._binding import CheckResult, ClothRange, ColliderMotion
from ._library import ArgumentError, Context, Handle, check_finite, encode, header, instance, lib, numbers, real, record, to_json, whole
from .mesh import Mesh
from .terms import Term


class Scene:
    """A scene, as docs/scene.md describes it: a dictionary whose values are also reached by JSON pointers.

        scene = drape.Scene("flag.json")            # a file; names of meshes in it are relative to its folder
        scene = drape.Scene({"drape": 1, ...})      # a dictionary; names of meshes are relative to the working directory
        scene["/integrator/dt"] = 1e-3              # as --set of the program: missing objects are made, "-" appends to a list
        del scene["/colliders/0"]

    `data` is the dictionary itself, and may be changed freely. numpy arrays and numbers may stand for lists and numbers, and a `drape.Mesh` for a mesh.
    Keys and values are checked when the scene is compiled."""

    def __init__(self, source: Union[str, os.PathLike, Mapping, "Scene", None] = None, /, **members: Any):
        self.path: Optional[str] = None
        self.data: Dict[str, Any]
        self._loaded: Any = None
        if isinstance(source, Scene):
            self.path, self.data, self._loaded = source.path, _copy(source.data), source._loaded
        elif isinstance(source, (str, os.PathLike)):
            self.path = os.path.abspath(os.fspath(source))
            context = Context()
            handle = ctypes.c_void_p()
            context.check(lib.drape_scene_load(context.address, encode(source), handle))  # the syntax, with the library's message
            lib.drape_scene_destroy(handle)
            self._loaded = _read(self.path)
            self.data = copy.deepcopy(self._loaded)
        elif source is None or isinstance(source, Mapping):
            self.data = _copy(dict({"drape": 1} if source is None else source))
        else:
            raise TypeError(f"a scene is a dictionary, the name of a file, or another scene, not {type(source).__name__}")
        self.data.update(members)

    # ---- A dictionary ----

    def _place(self, pointer: str, make: bool = False):
        """The object or list that a pointer leads into, and the key there."""
        if not isinstance(pointer, str) or not pointer.startswith("/"):
            raise KeyError(f"{pointer!r} is not a pointer: pointers begin with /")
        *path, last = [key.replace("~1", "/").replace("~0", "~") for key in pointer[1:].split("/")]
        place = self.data
        for key in path:
            if isinstance(place, Mesh):
                place = place.settings
            if isinstance(place, list):
                place = place[_index(place, key, pointer)]
            elif isinstance(place, dict):
                if make and key not in place:
                    place[key] = {}
                place = place[key]
            else:
                raise KeyError(f"{pointer}: {key!r} is in a {type(place).__name__}")
        return (place.settings if isinstance(place, Mesh) else place), last

    def __getitem__(self, pointer: str) -> Any:
        if isinstance(pointer, str) and not pointer.startswith("/"):
            return self.data[pointer]
        place, key = self._place(pointer)
        return place[_index(place, key, pointer) if isinstance(place, list) else key]

    def __setitem__(self, pointer: str, value: Any) -> None:
        if isinstance(pointer, str) and not pointer.startswith("/"):
            self.data[pointer] = value
            return
        place, key = self._place(pointer, True)
        if isinstance(place, list) and (key == "-" or key == str(len(place))):
            place.append(value)
        elif isinstance(place, (list, dict)):
            place[_index(place, key, pointer) if isinstance(place, list) else key] = value
        else:
            raise KeyError(f"{pointer}: leads into a {type(place).__name__}")

    def __delitem__(self, pointer: str) -> None:
        if isinstance(pointer, str) and not pointer.startswith("/"):
            del self.data[pointer]
            return
        place, key = self._place(pointer)
        del place[_index(place, key, pointer) if isinstance(place, list) else key]

    def __contains__(self, pointer: str) -> bool:
        try:
            self[pointer]
        except (KeyError, IndexError, TypeError):
            return False
        return True

    def __iter__(self) -> Iterator[str]:
        return iter(self.data)

    def __len__(self) -> int:
        return len(self.data)

    def get(self, pointer: str, default: Any = None) -> Any:
        """The value at a pointer, or a default."""
        return self[pointer] if pointer in self else default

    def update(self, values: Mapping) -> None:
        """Sets several values by their pointers."""
        for pointer, value in values.items():
            self[pointer] = value

    def copy(self) -> "Scene":
        """An independent copy."""
        return Scene(self)

    def __repr__(self) -> str:
        return f"Scene({self.path or self.data!r})"

    # ---- Files ----

    def write(self, path) -> None:
        """Writes the scene as a file. Names of meshes are made absolute, and meshes that are arrays become PLY files beside it."""
        folder, stem = os.path.split(os.path.splitext(os.path.abspath(path))[0])
        data = _plain(self.data, lambda number: os.path.join(folder, f"{stem}_mesh_{number}.ply"), os.path.dirname(self.path) if self.path else os.getcwd())
        with open(path, "w", encoding="utf-8") as file:
            file.write(to_json(data) + "\n")

    def compile(self) -> "Model":
        """Checks all keys and values, and makes a model. The error names the line, the pointer, the value and its range."""
        return Model(self)

    def _handle(self, context: Context):
        """The scene in the library, and what it needs until it is compiled: files of meshes."""
        handle = ctypes.c_void_p()
        folder: List[str] = []

        def name(number):
            if not folder:
                folder.append(tempfile.mkdtemp(prefix="drape-"))
            return os.path.join(folder[0], f"mesh_{number}.ply")

        try:
            data = _plain(self.data, name)
            if self.path and self._loaded is not None:
                context.check(lib.drape_scene_load(context.address, encode(self.path), handle))
                for pointer, value in _changes(_read(self.path), json.loads(to_json(data)), ""):
                    context.check(lib.drape_scene_set(handle, encode(pointer), None if value is _ABSENT else encode(json.dumps(value))))
            else:
                context.check(lib.drape_scene_parse(context.address, encode(to_json(data)), b"scene", handle))
        except BaseException:
            lib.drape_scene_destroy(handle)
            _remove(folder)
            raise
        return handle, folder


class Model:
    """A compiled scene: rest geometry, masses, elements. It does not change; sims in several threads may share one. terms: those of Python (drape.Term)."""

    def __init__(self, scene: Union[Scene, Mapping, str, os.PathLike], terms: Sequence[Term] = ()):
        self.scene = scene if isinstance(scene, Scene) else Scene(scene)
        self.terms = tuple(instance(term, Term, "terms") for term in terms)
        self._context = Context()
        for term in self.terms:
            term.register(self._context)
        source, folder = self.scene._handle(self._context)
        model = ctypes.c_void_p()
        try:
            status = lib.drape_scene_compile(source, model)
            self._raise_pending()
            self._context.check(status)
        finally:
            lib.drape_scene_destroy(source)
            _remove(folder)
        self._handle = Handle(model, lib.drape_model_destroy, self._context)
        self._address = self._handle.address
        self._colliders: Optional[List[str]] = None  # their names, once they are asked for

    def _raise_pending(self) -> None:
        for term in self.terms:
            term.raise_pending()

    @property
    def node_count(self) -> int:
        """Nodes of all cloths."""
        return lib.drape_model_node_count(self._address)

    @property
    def triangle_count(self) -> int:
        """Triangles of all cloths."""
        return lib.drape_model_triangle_count(self._address)

    @property
    def dof_count(self) -> int:
        """Unknowns: 3 a free node."""
        return lib.drape_model_dof_count(self._address)

    @property
    def nonzero_count(self) -> int:
        """Nonzeros of the full Jacobian."""
        return lib.drape_model_nonzero_count(self._address)

    @property
    def duration(self) -> float:
        """[s] of the scene."""
        return lib.drape_model_duration(self._address)

    @property
    def frame_rate(self) -> float:
        """[1/s] of the scene."""
        return lib.drape_model_frame_rate(self._address)

    @property
    def triangles(self) -> np.ndarray:
        """Node numbers (triangles x 3), read only, without a copy."""
        return self._handle.view(lib.drape_model_triangles(self._address), (self.triangle_count, 3), np.int32)

    @property
    def rest_positions(self) -> np.ndarray:
        """[m] (nodes x 3), read only, without a copy."""
        return self._handle.view(lib.drape_model_rest_positions(self._address), (self.node_count, 3), np.float64)

    @property
    def masses(self) -> np.ndarray:
        """[kg] lumped at the nodes, read only, without a copy."""
        return self._handle.view(lib.drape_model_masses(self._address), (self.node_count,), np.float64)

    @property
    def pinned(self) -> np.ndarray:
        """Which nodes are pinned (bool), read only, without a copy."""
        return self._handle.view(lib.drape_model_pinned(self._address), (self.node_count,), np.bool_)

    @property
    def cloths(self) -> List[ClothRange]:
        """The pieces of cloth: their names and their ranges of nodes and triangles."""
        return [record(lib.drape_model_cloth(self._address, k)) for k in range(lib.drape_model_cloth_count(self._address))]

    @property
    def collider_count(self) -> int:
        """Number of colliders."""
        return lib.drape_model_collider_count(self._address)

    def collider(self, which: Union[int, str], t: float = 0.0) -> ColliderMotion:
        """A collider by number or name, and where its track has it at time t [s]."""
        return record(lib.drape_model_collider(self._address, self.collider_index(which), real(t, "t")))

    def collider_index(self, which: Union[int, str]) -> int:
        """The number of a collider that is given by number or name."""
        if self._colliders is None:
            self._colliders = [lib.drape_model_collider(self._address, k, 0.0).name.decode() for k in range(self.collider_count)]
        names = self._colliders
        if isinstance(which, str) and which in names:
            return names.index(which)
        if isinstance(which, str) or not 0 <= whole(which, "collider") < len(names):
            raise ArgumentError(f"no collider {which!r}: there are {', '.join(names) or 'none'}")
        return operator.index(which)

    @header("drape_model_strain")
    def strain(self, positions) -> np.ndarray:
        """Principal strains [1] (triangles x 2) at positions (nodes x 3 [m])."""
        x = numbers(positions, "positions", self.node_count, 3)
        out = np.empty((self.triangle_count, 2))
        lib.drape_model_strain(self._address, x.ctypes.data, out.ctypes.data)
        return out

    @header("drape_model_normals")
    def normals(self, positions) -> np.ndarray:
        """Normals (nodes x 3) at positions (nodes x 3 [m])."""
        x = numbers(positions, "positions", self.node_count, 3)
        out = np.empty((self.node_count, 3))
        lib.drape_model_normals(self._address, x.ctypes.data, out.ctypes.data)
        return out

    @header("drape_model_check_derivatives")
    def check_derivatives(self, seed: int = 1) -> List[CheckResult]:
        """Compares every analytic derivative with differences, as `drape check` does."""
        count = ctypes.c_int32()
        with self._context.lock:
            results = (c.drape_check_result * 256)()
            status = lib.drape_model_check_derivatives(self._address, operator.index(seed), results, 256, ctypes.addressof(count))
            self._raise_pending()
            self._context.check(status)
        return [record(result) for result in results[:min(count.value, 256)]]

    def mesh(self, cloth: Optional[int] = None, positions=None) -> Mesh:
        """One cloth, or all of them, as a mesh: at rest, or at positions (nodes x 3 [m])."""
        x = self.rest_positions if positions is None else numbers(positions, "positions", self.node_count, 3)
        if cloth is None:
            return Mesh(x, self.triangles)
        piece = self.cloths[cloth]
        triangles = self.triangles[piece.first_triangle:piece.first_triangle + piece.triangle_count] - piece.first_node
        return Mesh(x[piece.first_node:piece.first_node + piece.node_count], triangles)

    @header("drape_model_render_mesh")
    def render_mesh(self, cloth: Optional[int] = None, positions=None) -> Mesh:
        """The mesh that frames show of one cloth, or of all of them: the render_mesh of the scene, or the simulated mesh of a cloth without one. At rest, or for
        nodes at positions (nodes x 3 [m]). Polygons are divided into triangles."""
        mesh = lib.drape_model_render_mesh(self._address, self._which(cloth))
        triangles = self._handle.view(mesh.triangles, (mesh.triangle_count, 3), np.int32)
        if positions is None:
            return Mesh(self._handle.view(mesh.rest, (mesh.vertex_count, 3), np.float64), triangles)
        return Mesh(self.render_positions(positions, cloth), triangles)

    @header("drape_model_render_positions")
    def render_positions(self, positions, cloth: Optional[int] = None) -> np.ndarray:
        """Positions (vertices x 3 [m]) of render_mesh for nodes at positions (nodes x 3 [m]), as frames have them."""
        which = self._which(cloth)
        x = numbers(positions, "positions", self.node_count, 3)
        normals = self.normals(x)
        out = np.empty((lib.drape_model_render_mesh(self._address, which).vertex_count, 3))
        lib.drape_model_render_positions(self._address, which, x.ctypes.data, normals.ctypes.data, out.ctypes.data)
        return out

    def _which(self, cloth: Optional[int]) -> int:
        """The number of a cloth for the library, which has -1 for all of them."""
        if cloth is None:
            return -1
        if not 0 <= operator.index(cloth) < len(self.cloths):
            raise ArgumentError(f"no cloth {cloth}: there are {len(self.cloths)}")
        return operator.index(cloth)

    def __repr__(self) -> str:
        return f"Model({self.node_count} nodes, {self.triangle_count} triangles)"


# ---- Values of a scene ----

_ABSENT = object()
_FILES = ("file", "mesh", "times", "velocities")  # keys whose texts are names of files


def _read(path: str):
    """The value of a scene file, whose syntax the library has checked: JSON with comments."""
    with open(path, encoding="utf-8-sig") as file:
        return json.loads(re.sub(r'"(?:\\.|[^"\\])*"|//[^\n]*|/\*.*?\*/', lambda match: match[0] if match[0].startswith('"') else " ", file.read(), flags=re.S))


def _copy(value):
    """A copy of the objects and lists; meshes and arrays are shared."""
    if isinstance(value, Mapping):
        return {key: _copy(item) for key, item in value.items()}
    return [_copy(item) for item in value] if isinstance(value, (list, tuple)) else value


def _index(place: list, key: str, pointer: str) -> int:
    if not key.isdigit() or int(key) >= len(place):
        raise IndexError(f"{pointer}: no element {key} in a list of {len(place)}")
    return int(key)


def _escaped(name) -> str:
    """A key in a JSON pointer."""
    return str(name).replace("~", "~0").replace("/", "~1")


def _plain(value, mesh_name, folder: Optional[str] = None):
    """A scene without Mesh objects, which are written to files of these names. folder: relative names of files are made absolute against it."""
    written: List[str] = []

    def plain(item, at="", key=None):
        if isinstance(item, Mesh):
            path = mesh_name(len(written))
            check_finite(item.positions, f"{at}: positions")
            item.write(path)
            written.append(path)
            return {**plain(item.settings, at), "file": path}
        if isinstance(item, Mapping):
            return {name: plain(part, f"{at}/{_escaped(name)}", name) for name, part in item.items()}
        if isinstance(item, (list, tuple)):
            return [plain(part, f"{at}/{k}") for k, part in enumerate(item)]
        if isinstance(item, (float, np.floating, np.ndarray)):
            check_finite(np.asarray(item), at)  # JSON has no NaN and no infinity
        if folder and key in _FILES and isinstance(item, str) and not os.path.isabs(item):
            return os.path.join(folder, item)
        return item

    return plain(value)


def _changes(old, new, pointer):
    """What leads from one value to another: pointers and values, so that lines of messages about the rest stay those of the file."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted(old.keys() | new.keys()):
            place = f"{pointer}/{_escaped(key)}"
            if key not in new:
                yield place, _ABSENT
            elif key not in old:
                yield place, new[key]
            else:
                yield from _changes(old[key], new[key], place)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for k, (a, b) in enumerate(zip(old, new)):
            yield from _changes(a, b, f"{pointer}/{k}")
    elif old != new or type(old) is not type(new):
        yield pointer, new


def _remove(folder: list) -> None:
    for path in folder:
        shutil.rmtree(path, ignore_errors=True)
