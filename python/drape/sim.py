"""Running simulations."""
import atexit
import ctypes
import math
import os
import _signal as signal  # the module signal turns numbers into enumerators and back at each call, which takes longer than the rest of it
import threading
import time
import weakref
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from . import _binding as c
from ._binding import (Attempt, ColliderMotion, Energy, EventKind, EventRecord, Realtime, Relaxed, SeamReport, Statistics, Status, Untangling, Warning)
from ._library import (ArgumentError, Context, Error, Handle, Stopped, encode, error_of, file_name, function_of, given_array, header, indices, instance, lib,
                       numbers, real, record, spread, whole)
from .scene import Model, Scene

if TYPE_CHECKING:
    from .runs import Page, Run

Which = Union[int, str]


class Frame(NamedTuple):
    """A frame of a run. Its arrays are its own."""

    index: int  # type: ignore[assignment]
    """its number, from 0"""
    time: float
    """[s]"""
    positions: np.ndarray
    """nodes x 3 [m], interpolated between the steps around it"""
    velocities: np.ndarray
    """nodes x 3 [m/s]"""


class Event(NamedTuple):
    """What an observer receives. positions and velocities show memory of the library that later frames overwrite: copy what is to be kept."""

    kind: EventKind
    """ATTEMPT, FRAME or ROOT"""
    sim: "Sim"
    time: float
    """[s] of a frame or a root; of an attempt, the time of the sim"""
    frame: int
    """FRAME: its number"""
    positions: Optional[np.ndarray]
    """FRAME, ROOT: nodes x 3 [m], read only"""
    velocities: Optional[np.ndarray]
    """FRAME, ROOT: nodes x 3 [m/s], read only"""
    attempt: Optional[Attempt]
    """ATTEMPT: the step that was judged"""
    name: str
    """ROOT: of the event of the scene"""
    value: float
    """ROOT: the quantity"""
    direction: int
    """ROOT: 1 upwards, -1 downwards"""


Observer = Callable[[Event], Any]
Wind = Callable[[float, np.ndarray], Union[np.ndarray, Tuple[np.ndarray, np.ndarray]]]


class Sim:
    """A simulation that runs: `drape.Sim(scene)`, where scene is a Scene, a Model, a dictionary or the name of a file.

    integrator, controller, their settings, dt [s], dt_min [s] and frame_rate [1/s] are those of the scene unless given. threads evaluate elements; the
    result does not depend on their number. realtime_step [s] and teleport_speed [m/s]: drape_sim_def in drape.h.

    One thread at a time uses a sim: others wait, except in cancel(). The interpreter is free for them while the sim advances. Ctrl-C ends an advance
    after the step in progress; the sim is then valid, in the last accepted state, as after every error."""

    def __init__(self, scene: Union[Scene, Model, Mapping, str, os.PathLike], /, *, integrator: Optional[str] = None, controller: Optional[str] = None,
                 integrator_settings: Mapping[str, Any] = {}, controller_settings: Mapping[str, Any] = {}, dt: float = 0.0, dt_min: float = 0.0,
                 frame_rate: float = 0.0, threads: int = 1, realtime_step: float = 0.0, teleport_speed: float = 0.0):
        self.model = scene if isinstance(scene, Model) else Model(scene)
        self._context = Context()
        self._lock = self._context.lock
        self._alive = threading.RLock()  # so that cancel(), which does not wait for the sim, does not meet close()
        definition = c.drape_sim_def()
        keep: List[Any] = []
        lib.drape_sim_def_init(definition, ctypes.sizeof(definition))
        definition.integrator, definition.controller = encode(integrator), encode(controller)
        definition.integrator_settings, definition.integrator_setting_count = _settings(integrator_settings, keep)
        definition.controller_settings, definition.controller_setting_count = _settings(controller_settings, keep)
        definition.dt, definition.dt_min, definition.frame_rate = real(dt, "dt"), real(dt_min, "dt_min"), real(frame_rate, "frame_rate")
        definition.realtime_step, definition.teleport_speed = real(realtime_step, "realtime_step"), real(teleport_speed, "teleport_speed")
        definition.threads = whole(threads, "threads")
        handle = ctypes.c_void_p()
        self._context.check(lib.drape_sim_create(self._context.address, self.model._address, definition, handle))
        self._needs: Dict[str, Any] = {"model": self.model._handle}  # must live as long as the sim of the library
        self._wind: Optional[Wind] = None
        self._events: List[Callable] = []
        self._handle = Handle(handle, lib.drape_sim_destroy, self._context, self._needs)
        self._address: Optional[int] = self._handle.address
        self._observers: List[Tuple[Observer, Tuple[EventKind, ...]]] = []
        self._pending: Optional[BaseException] = None  # raised in a callback, on its way to the caller
        self._advancing = self._wants_frame = False
        self._frame: Optional[Frame] = None
        self._interrupt = _Interrupt()
        self._shape = (self.model.node_count, 3)
        self._needs["observer"] = _observer(weakref.ref(self))
        self._call(lib.drape_sim_observe, self._needs["observer"], None)
        _SIMS.add(self)

    # ---- Life ----

    def close(self) -> None:
        """Frees the sim. Arrays that show its memory stay valid. A second call does nothing."""
        with self._lock:
            if self._advancing:
                raise ArgumentError("a callback must not close the sim that calls it")
            with self._alive:
                self._address = None
            self._handle.close()

    def __enter__(self) -> "Sim":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def __reduce_ex__(self, _: Any) -> Any:  # which copy and pickle call
        raise TypeError("a Sim cannot be copied or pickled: restore_checkpoint(sim.checkpoint()) of another Sim(sim.model) puts that into the same state")

    def __repr__(self) -> str:
        return f"Sim({self.model.node_count} nodes, t = {self.time:g} s)" if self._address else "Sim(closed)"

    def _open(self) -> int:
        if self._address is None:
            raise ArgumentError("the sim is closed")
        return self._address

    def _call(self, function, *arguments) -> None:
        """A function that returns a status."""
        with self._lock:
            try:
                status = function(self._open(), *arguments)
            except ctypes.ArgumentError as error:
                raise TypeError(f"{function.__name__}: {error}") from None
            self._raise_pending()
            if status:
                raise error_of(status, self._context.message())

    def _raise_pending(self) -> None:
        if self.model.terms and not self._advancing:
            self.model._raise_pending()
        if self._pending is not None and not self._advancing:
            error, self._pending = self._pending, None
            raise error

    def _array(self, function, shape, *arguments) -> np.ndarray:
        out = np.empty(shape)
        self._call(function, *arguments, out.ctypes.data)
        return out

    # ---- Advancing ----

    @header("drape_sim_advance")
    def advance(self, until: float) -> Optional[EventRecord]:
        """Makes steps up to the time `until` [s]. Returns None, or the event of the scene that stopped the run before."""
        return self._run(lib.drape_sim_advance, real(until, "until"))

    @header("drape_sim_advance_realtime")
    def advance_realtime(self, frame_dt: float, budget: float) -> Realtime:
        """Advances by frame_dt [s] of simulated time within a budget [s] of wall-clock time, and reports what that took."""
        report = c.drape_realtime()
        self._run(lib.drape_sim_advance_realtime, real(frame_dt, "frame_dt"), real(budget, "budget"), report)
        return record(report)

    def _run(self, function, *arguments) -> Optional[EventRecord]:
        with self._lock:
            if self._advancing:
                raise ArgumentError("a callback must not advance the sim that calls it")
            address = self._open()
            self._pending, self._advancing = None, True
            try:
                with _Interrupt() as self._interrupt:
                    status = function(address, *arguments)
            finally:
                self._advancing = False
            if self._interrupt.came:
                self._interrupt.pass_on()
            self._raise_pending()
            if status == Status.E_STOPPED and self._frame is not None:
                return None
            if status == Status.E_STOPPED and lib.drape_sim_stopped_by(address) >= 0:
                return self.events[lib.drape_sim_stopped_by(address)]
            if status:
                raise error_of(status, self._context.message())
            return None

    def frames(self, until: Optional[float] = None) -> Iterator[Frame]:
        """Advances to the time `until` [s] (default: the duration of the scene) and gives each frame on the way: `for frame in sim.frames(): ...`.
        Steps are those of advance(until), to the bit; at each frame the sim is in the accepted state at or after it."""
        end = self.model.duration if until is None else until
        while True:
            with self._lock:
                self._wants_frame, self._frame = True, None
                try:
                    self.advance(end)
                finally:
                    frame, self._wants_frame, self._frame = self._frame, False, None
            if frame is None:
                return
            yield frame

    def cancel(self) -> None:
        """Ends the running advance, or the next one, with the exception Stopped. May be called from any thread."""
        with self._alive:
            if self._address is not None:
                lib.drape_sim_cancel(self._address)

    @header("drape_sim_observe")
    def observe(self, observer: Observer, *kinds: EventKind) -> Observer:
        """Calls observer(event) within advances, for all events or those of these kinds. If it returns a true value, the advance ends with Stopped; an
        exception ends it and comes out of advance(). It may read the sim and save it, but not advance or change it. Also a decorator."""
        self._observers.append((function_of(observer, "observer"), kinds))
        return observer

    def unobserve(self, observer: Observer) -> None:
        """Removes an observer."""
        self._observers = [entry for entry in self._observers if entry[0] is not observer]

    # ---- State ----

    def _view(self, function) -> np.ndarray:
        with self._lock:
            return self._handle.view(function(self._open()), self._shape, np.float64)

    def _model_view(self, function, dtype) -> np.ndarray:
        """An array of the nodes of the present model: that of the scene, or one of the sim's own, after pins or masses have changed."""
        with self._lock:
            address = function(lib.drape_sim_model(self._open()))
            owner = self._handle if self._context.memory.lease(address) else self.model._handle
            return owner.view(address, self._shape[:1], dtype)

    @property
    def time(self) -> float:
        """[s] of the last accepted state."""
        with self._lock:
            return lib.drape_sim_time(self._open())

    @property
    def hash(self) -> int:
        """64-bit hash of the last accepted state: equal hashes, equal bits."""
        with self._lock:
            return lib.drape_sim_hash(self._open())

    @property
    def positions(self) -> np.ndarray:
        """[m] (nodes x 3) of the last accepted state: the library's own memory, read only. The array stays valid, but its numbers do not when the sim
        changes: `.copy()` what is to be kept."""
        return self._view(lib.drape_sim_positions)

    @property
    def velocities(self) -> np.ndarray:
        """[m/s] (nodes x 3) of the last accepted state; as positions."""
        return self._view(lib.drape_sim_velocities)

    @property
    def masses(self) -> np.ndarray:
        """[kg] of the nodes, read only, valid as positions."""
        return self._model_view(lib.drape_model_masses, np.float64)

    @property
    def pinned(self) -> np.ndarray:
        """Which nodes are pinned now (bool), read only, valid as positions."""
        return self._model_view(lib.drape_model_pinned, np.bool_)

    @header("drape_sim_set_state")
    def set_state(self, t: float, positions, velocities) -> None:
        """Goes on from time t [s], positions [m] and velocities [m/s] (nodes x 3)."""
        x, v = numbers(positions, "positions", *self._shape), numbers(velocities, "velocities", *self._shape)
        self._call(lib.drape_sim_set_state, real(t, "t"), x.ctypes.data, v.ctypes.data)

    def save(self, path) -> None:
        """Writes a checkpoint, from which a sim of the same scene continues with the same bits."""
        self._call(lib.drape_sim_save, file_name(path))

    def restore(self, path) -> None:
        """Restores a checkpoint."""
        self._call(lib.drape_sim_restore, file_name(path))

    def checkpoint(self) -> bytes:
        """A checkpoint as bytes."""
        parts: List[bytes] = []

        @c.drape_write
        def write(_, data, size):
            parts.append(ctypes.string_at(data, size))
            return 0

        self._call(lib.drape_sim_save_to, write, None)
        return b"".join(parts)

    def restore_checkpoint(self, data: Union[bytes, bytearray, memoryview]) -> None:
        """Restores a checkpoint from bytes."""
        try:
            data = memoryview(data).tobytes()
        except TypeError:
            raise TypeError(f"data: needs the bytes of a checkpoint, has {type(data).__name__}") from None
        self._call(lib.drape_sim_restore_from, ctypes.cast(ctypes.c_char_p(data), ctypes.c_void_p), len(data))

    # ---- Forces, energies, work ----

    @property
    @header("drape_sim_normals")
    def normals(self) -> np.ndarray:
        """Normals of the nodes (nodes x 3)."""
        out = np.empty(self._shape)
        with self._lock:
            lib.drape_sim_normals(self._open(), out.ctypes.data)
        return out

    @property
    @header("drape_sim_reactions")
    def reactions(self) -> np.ndarray:
        """[N] (nodes x 3): the forces of pins on pinned nodes."""
        return self._array(lib.drape_sim_reactions, self._shape)

    @property
    @header("drape_sim_contact_forces")
    def contact_forces(self) -> np.ndarray:
        """[N] (nodes x 3): contact and friction."""
        return self._array(lib.drape_sim_contact_forces, self._shape)

    @property
    @header("drape_sim_energy")
    def energy(self) -> Energy:
        """[J] kinetic, elastic, gravity, contact, dissipated, numerical."""
        with self._lock:
            energy = record(lib.drape_sim_energy(self._open()))
            self._raise_pending()
        return energy

    @property
    @header("drape_sim_work")
    def work(self) -> Dict[str, float]:
        """[J] done on the cloth by pins, colliders, the host, and each load and wind, such as "drag.wind of flag"."""
        work = ctypes.c_double()
        found: Dict[str, float] = {}
        with self._lock:
            index = 0
            while (name := lib.drape_sim_work(self._open(), index, ctypes.addressof(work))) is not None:
                found[name.decode()], index = work.value, index + 1
            self._raise_pending()
        return found

    @property
    @header("drape_sim_energy_density")
    def energy_density(self) -> np.ndarray:
        """[J/m2] elastic energy at the nodes."""
        out = np.empty(self._shape[0])
        with self._lock:
            lib.drape_sim_energy_density(self._open(), out.ctypes.data)
        return out

    @property
    def strain(self) -> np.ndarray:
        """Principal strains [1] of the triangles (triangles x 2), the larger first."""
        with self._lock:
            return self.model.strain(self.positions)

    @property
    def statistics(self) -> Statistics:
        """Counts of steps, iterations and factorizations, and wall-clock times [s], since the sim was created."""
        with self._lock:
            return record(lib.drape_sim_statistics(self._open()))

    @property
    def reasons(self) -> Dict[str, int]:
        """Why attempts were rejected, and how often."""
        count = ctypes.c_int64()
        found: Dict[str, int] = {}
        with self._lock:
            while (name := lib.drape_sim_reason(self._open(), len(found), ctypes.addressof(count))) is not None:
                found[name.decode()] = count.value
        return found

    @property
    @header("drape_sim_warning")
    def warnings(self) -> List[Warning]:
        """Doubts about the run so far, each with a name and a text that says which setting would help."""
        found: List[Warning] = []
        warning = c.drape_warning()
        with self._lock:
            while lib.drape_sim_warning(self._open(), len(found), warning):
                found.append(record(warning))
        return found

    # ---- Pins and masses ----

    @header("drape_sim_pin")
    def pin(self, nodes) -> None:
        """Pins nodes where they are. Nodes are numbers, or a mask of all nodes."""
        self._nodes(lib.drape_sim_pin, nodes)

    @header("drape_sim_pin")
    def unpin(self, nodes) -> None:
        """Lets pinned nodes go."""
        self._nodes(lib.drape_sim_unpin, nodes)

    def _indices(self, nodes) -> np.ndarray:
        return indices(nodes, "nodes", self._shape[0])

    def _nodes(self, function, nodes) -> None:
        nodes = self._indices(nodes)
        self._call(function, len(nodes), nodes.ctypes.data)

    @header("drape_sim_move_pins")
    def move_pins(self, nodes, positions, seconds: float, velocities=None) -> None:
        """Moves pinned nodes to positions (count x 3 [m]) within the next seconds [s] of simulated time, to arrive with velocities (count x 3 [m/s])."""
        nodes = self._indices(nodes)
        x = numbers(_rows(positions, "positions"), "positions", len(nodes), 3)
        v = None if velocities is None else numbers(_rows(velocities, "velocities"), "velocities", len(nodes), 3)
        self._call(lib.drape_sim_move_pins, len(nodes), nodes.ctypes.data, real(seconds, "seconds"), x.ctypes.data, None if v is None else v.ctypes.data)

    @header("drape_sim_attach")
    def attach(self, collider: Which, nodes, triangles=None) -> None:
        """Lets a collider carry nodes from where they are. triangles: those of a collider that deforms; None: the nearest."""
        nodes = self._indices(nodes)
        on = None if triangles is None else numbers(np.atleast_1d(given_array(triangles, "triangles")), "triangles", len(nodes), dtype=np.int32)
        with self._lock:
            self._call(lib.drape_sim_attach, self._collider(collider), len(nodes), nodes.ctypes.data, None if on is None else on.ctypes.data)

    @header("drape_sim_attach")
    def detach(self, nodes) -> None:
        """Lets go nodes that a collider carries."""
        self._nodes(lib.drape_sim_detach, nodes)

    def attached(self, node: int) -> int:
        """The number of the collider that carries a node; -1: none."""
        with self._lock:
            return lib.drape_sim_attached(self._open(), whole(node, "node"))

    @header("drape_sim_set_masses")
    def set_masses(self, nodes, masses) -> None:
        """Gives nodes other masses [kg]."""
        nodes = self._indices(nodes)
        m = spread(masses, "masses", len(nodes))
        self._call(lib.drape_sim_set_masses, len(nodes), nodes.ctypes.data, m.ctypes.data)

    # ---- Forces of the host ----

    @header("drape_sim_push")
    def push(self, forces) -> None:
        """Pushes nodes by forces (nodes x 3 [N]) until they are replaced; None: no more."""
        f = None if forces is None else numbers(forces, "forces", *self._shape)
        self._call(lib.drape_sim_push, None if f is None else f.ctypes.data)

    @header("drape_sim_set_drag_springs")
    def drag(self, nodes=(), targets=(), stiffness=0.0) -> None:
        """Drags nodes towards targets (count x 3 [m]) by springs of a stiffness [N/m]; without arguments: no more."""
        nodes = self._indices(nodes)
        x = numbers(_rows(targets, "targets"), "targets", len(nodes), 3)
        k = spread(stiffness, "stiffness", len(nodes))
        self._call(lib.drape_sim_set_drag_springs, len(nodes), nodes.ctypes.data, k.ctypes.data, x.ctypes.data)

    @property
    def drag_force(self) -> np.ndarray:
        """[N] (3): the sum of the forces of drag springs."""
        out = np.empty(3)
        with self._lock:
            lib.drape_sim_drag_spring_force(self._open(), out.ctypes.data)
        return out

    @header("drape_sim_set_wind", "drape_wind_field")
    def set_wind(self, wind: Optional[Wind]) -> None:
        """Sets the velocity of the air for drag terms: wind(t, x) returns velocities (count x 3 [m/s]) at the time t [s] and the points x (count x 3 [m]), or
        these and their gradient (count x 3 x 3 [1/s], d wind_i / d x_j), with which Newton's method converges as fast as without wind. A single vector
        stands for the same wind everywhere. None: still air. An exception in it ends the advance and comes out of it."""
        if wind is not None:
            function_of(wind, "wind")
        field: Any = c.drape_wind_field() if wind is None else _wind(weakref.ref(self))  # type: ignore[call-overload]
        with self._lock:
            self._call(lib.drape_sim_set_wind, field, None)
            self._needs["wind"], self._wind = field, wind

    # ---- Colliders ----

    def _collider(self, which: Which) -> int:
        return self.model.collider_index(which)

    def collider(self, which: Which = 0) -> ColliderMotion:
        """Where a collider is, by number or name: displacement [m] and velocity [m/s] of its pivot."""
        with self._lock:
            return record(lib.drape_sim_collider(self._open(), self._collider(which)))

    @header("drape_sim_collider_rotation")
    def collider_rotation(self, which: Which = 0) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Its rotation (quaternion w x y z), angular velocity [rad/s] and the place of its pivot [m]."""
        rotation, velocity, pivot = np.empty(4), np.empty(3), np.empty(3)
        with self._lock:
            lib.drape_sim_collider_rotation(self._open(), self._collider(which), rotation.ctypes.data, velocity.ctypes.data, pivot.ctypes.data)
        return rotation, velocity, pivot

    @header("drape_sim_move_collider", "drape_sim_move_collider_pose")
    def move_collider(self, which: Which, displacement, seconds: float, velocity=None, *, rotation=None, angular_velocity=None) -> None:
        """Moves a collider to a displacement [m] from where the scene has it within the next seconds [s], to arrive with a velocity [m/s]. rotation (a
        quaternion w x y z) turns it as well, to arrive with an angular velocity [rad/s]."""
        d = numbers(displacement, "displacement", 3)
        v = None if velocity is None else numbers(velocity, "velocity", 3)
        seconds = real(seconds, "seconds")
        at = None if v is None else v.ctypes.data
        if rotation is None:
            if angular_velocity is not None:
                raise ArgumentError("angular_velocity: needs a rotation")
            with self._lock:
                self._call(lib.drape_sim_move_collider, self._collider(which), seconds, d.ctypes.data, at)
            return
        q = numbers(rotation, "rotation", 4)
        w = None if angular_velocity is None else numbers(angular_velocity, "angular_velocity", 3)
        with self._lock:
            self._call(lib.drape_sim_move_collider_pose, self._collider(which), seconds, d.ctypes.data, q.ctypes.data, at,
                       None if w is None else w.ctypes.data)

    @header("drape_sim_deform_collider")
    def deform_collider(self, which: Which, positions, seconds: float, velocities=None) -> None:
        """Sends the points of an animated_mesh to positions (points x 3 [m]) within the next seconds [s], to arrive with velocities [m/s]."""
        x = numbers(positions, "positions", -1, 3)
        v = None if velocities is None else numbers(velocities, "velocities", len(x), 3)
        with self._lock:
            self._call(lib.drape_sim_deform_collider, self._collider(which), real(seconds, "seconds"), len(x), x.ctypes.data, None if v is None else v.ctypes.data)

    @header("drape_sim_collider_points")
    def collider_points(self, which: Which = 0) -> Tuple[np.ndarray, np.ndarray]:
        """Positions [m] and velocities [m/s] (points x 3) of a collider that deforms."""
        with self._lock:
            index = self._collider(which)
            count = max(0, lib.drape_model_collider_points(self.model._address, index))
            x, v = np.empty((count, 3)), np.empty((count, 3))
            self._call(lib.drape_sim_collider_points, index, x.ctypes.data, v.ctypes.data)
        return x, v

    @header("drape_sim_contact_forces")
    def collider_force(self, which: Which = 0) -> np.ndarray:
        """[N] (3): the force of the cloth on a collider."""
        with self._lock:
            return self._array(lib.drape_sim_collider_force, 3, self._collider(which))

    @header("drape_sim_contact_forces")
    def collider_torque(self, which: Which = 0, about=None) -> np.ndarray:
        """[N m] (3): the torque of the cloth on a collider, about a point [m] or its pivot."""
        point = None if about is None else numbers(about, "about", 3)
        with self._lock:
            return self._array(lib.drape_sim_collider_torque, 3, self._collider(which), None if point is None else point.ctypes.data)

    # ---- Placing, changing ----

    @header("drape_sim_place")
    def place(self, *, rotate: Sequence[float] = (), center: Sequence[float] = (0, 0, 0), translate: Sequence[float] = (0, 0, 0), cloths=None,
              colliders=None, stop: bool = False) -> None:
        """Places cloths and colliders (numbers, or names of colliders; default: all) elsewhere by a rigid motion: rotate (axis x y z and angle [degrees])
        about center [m], then translate [m]. stop: the cloth is at rest afterwards."""
        definition = c.drape_place_def()
        lib.drape_place_def_init(definition, ctypes.sizeof(definition))
        if len(rotate):
            definition.rotate[:] = numbers(rotate, "rotate", 4).tolist()
        definition.center[:], definition.translate[:] = numbers(center, "center", 3).tolist(), numbers(translate, "translate", 3).tolist()
        definition.stop = stop
        if cloths is not None:
            pieces = indices(cloths, "cloths", len(self.model.cloths))
            definition.cloths, definition.cloth_count = pieces.ctypes.data, len(pieces)
        with self._lock:
            if colliders is not None:
                bodies = np.array([self._collider(which) for which in np.atleast_1d(np.asarray(colliders, object))], np.int32)
                definition.colliders, definition.collider_count = bodies.ctypes.data, len(bodies)
            self._call(lib.drape_sim_place, definition)

    @header("drape_sim_change")
    def change(self, scene: Union[Scene, Model, Mapping]) -> None:
        """Goes on with another scene of the same meshes: other materials, terms, colliders, pins, gravity. `model` is then that of the new scene."""
        model = scene if isinstance(scene, Model) else Model(scene)
        with self._lock:
            self._call(lib.drape_sim_change_model, model._address)
            self.model, self._needs["model"] = model, model._handle

    @header("drape_sim_untangle")
    def untangle(self, *, sweeps: Optional[int] = None, gap: Optional[float] = None, keep: Optional[bool] = None) -> Untangling:
        """Takes apart cloth that passes through itself, other cloth or colliders, and reports what was found and done."""
        definition, report = c.drape_untangle_def(), c.drape_untangling()
        lib.drape_untangle_def_init(definition, ctypes.sizeof(definition))
        sweeps, gap = None if sweeps is None else whole(sweeps, "sweeps"), None if gap is None else real(gap, "gap")
        given = {name: value for name, value in (("sweeps", sweeps), ("gap", gap), ("keep", keep)) if value is not None}
        for name, value in given.items():
            setattr(definition, name, value)
        self._call(lib.drape_sim_untangle, definition if given else None, report)
        return record(report)

    @property
    def untangling(self) -> Optional[Untangling]:
        """The report of the last untangling, by the scene or by untangle(); None: there was none."""
        report = c.drape_untangling()
        with self._lock:
            return record(report) if lib.drape_sim_untangling(self._open(), report, None) else None

    # ---- Queries ----

    @header("drape_sim_closest")
    def closest(self, points, within: float = math.inf, *, cloth: bool = True, colliders: bool = True) -> np.ndarray:
        """The nearest places on cloth and colliders to points (count x 3 [m]): a structured array with `found`, `collider`, `triangle`, `distance` [m],
        `point` [m], `normal`, `weights`."""
        x = numbers(_rows(points, "points"), "points", -1, 3)
        hits = np.zeros(len(x), np.dtype(c.drape_hit))
        self._call(lib.drape_sim_closest, _what(cloth, colliders), len(x), x.ctypes.data, real(within, "within"), _pointer(hits, c.drape_hit))
        return hits

    @header("drape_sim_closest")
    def cast(self, origins, directions, length: float = 1e6, *, cloth: bool = True, colliders: bool = True) -> np.ndarray:
        """The first places that rays meet, from origins (count x 3 [m]) along directions (count x 3), up to a length [m]: an array as of closest()."""
        x = numbers(_rows(origins, "origins"), "origins", -1, 3)
        d = spread(directions, "directions", len(x), 3)
        hits = np.zeros(len(x), np.dtype(c.drape_hit))
        self._call(lib.drape_sim_cast, _what(cloth, colliders), len(x), x.ctypes.data, d.ctypes.data, real(length, "length"), _pointer(hits, c.drape_hit))
        return hits

    @property
    @header("drape_sim_contacts")
    def contacts(self) -> np.ndarray:
        """The contacts: a structured array with `collider`, `nodes`, `weights`, `point` [m], `normal`, `gap` [m], `force` [N], `normal_force` [N]."""
        count = ctypes.c_int32()
        with self._lock:
            self._call(lib.drape_sim_contacts, 0, None, ctypes.addressof(count))
            found = np.zeros(count.value, np.dtype(c.drape_contact_point))
            if len(found):
                self._call(lib.drape_sim_contacts, len(found), _pointer(found, c.drape_contact_point), ctypes.addressof(count))
        return found

    @header("drape_sim_inside")
    def inside(self, which: Which) -> Tuple[int, float]:
        """How many triangles of cloth reach into a collider, and how deep [m]."""
        deepest = ctypes.c_double()
        with self._lock:
            count = lib.drape_sim_inside(self._open(), self._collider(which), ctypes.addressof(deepest))
        return count, deepest.value

    @header("drape_sim_intersections")
    def intersections(self, which: Optional[Which] = None) -> int:
        """How many edges pass through triangles: of cloth and a collider or, by default, of the cloth itself."""
        with self._lock:
            return lib.drape_sim_intersections(self._open(), -1 if which is None else self._collider(which))

    @property
    @header("drape_sim_relaxed")
    def relaxed(self) -> List[Relaxed]:
        """Nodes that bodies leave no room."""
        with self._lock:
            return self._reports(lib.drape_sim_relaxed, c.drape_relaxed())

    @property
    @header("drape_sim_seam")
    def seams(self) -> List[SeamReport]:
        """The seams: gaps [m] and forces [N]."""
        with self._lock:
            return self._reports(lib.drape_sim_seam, c.drape_seam_report())

    def _reports(self, function, report) -> list:
        found = []
        for k in range(function(self._open(), -1, None)):
            function(self._open(), k, report)
            found.append(record(report))
        return found

    # ---- Events ----

    @property
    @header("drape_sim_event")
    def events(self) -> List[EventRecord]:
        """What is known about each event: how often, first and last time [s], value."""
        with self._lock:
            return self._reports(lib.drape_sim_event, c.drape_event_record())

    @header("drape_sim_add_event")
    def add_event(self, name: str, function: Callable[[float, np.ndarray, np.ndarray], float], *, direction: Optional[str] = None,
                  action: Optional[str] = None, once: bool = False, cloth: Optional[str] = None, pins: Optional[str] = None) -> None:
        """Adds an event: a root of function(t, positions, velocities), which is located within the step. direction: "up", "down" or "both"; action: "record",
        "stop" or "release"."""
        definition = c.drape_event_def()
        lib.drape_event_def_init(definition, ctypes.sizeof(definition))
        definition.name, definition.direction, definition.action, definition.once = encode(name), encode(direction), encode(action), once
        definition.cloth, definition.pins = encode(cloth), encode(pins)
        function_of(function, "function")
        with self._lock:
            callback = _event_function(weakref.ref(self), len(self._events))
            self._call(lib.drape_sim_add_event, definition, callback, None)
            self._needs.setdefault("events", []).append(callback)
            self._events.append(function)

    # ---- Whole runs ----

    def record(self, until: Optional[float] = None) -> "Run":
        """Advances to the time `until` [s] (default: the duration of the scene) and keeps frames, steps and energies. If that fails or is stopped, `run`
        of the exception is the run up to there."""
        from .runs import record_sim
        return record_sim(self, until)

    def view(self, until: Optional[float] = None) -> "Page":
        """Records the run until then, and shows the report of the program, with the cloth in motion, in a notebook."""
        return self.record(until).view()


class Embedding:
    """A mesh for rendering that the cloth carries: vertices (count x 3 [m], where the cloth is at rest), with normals or without."""

    @header("drape_embedding_create")
    def __init__(self, model: Model, vertices, normals=None, cloth: int = -1):
        """Fixes vertices to one cloth of a model, or to all."""
        instance(model, Model, "model")
        x = numbers(vertices, "vertices", -1, 3, dtype=np.float32)
        n = None if normals is None else numbers(normals, "normals", len(x), 3, dtype=np.float32)
        handle, context = ctypes.c_void_p(), Context()
        context.check(lib.drape_embedding_create(context.address, model._address, whole(cloth, "cloth"), len(x), x.ctypes.data, None if n is None else n.ctypes.data, handle))
        self._handle = Handle(handle, lib.drape_embedding_destroy, context)
        self._nodes, self._shape, self._normals = model.node_count, x.shape, n is not None

    def carry(self, positions) -> Tuple[np.ndarray, Optional[np.ndarray]]:
        """Vertices [m] and normals (count x 3, single precision) for nodes at positions (nodes x 3 [m])."""
        x = numbers(positions, "positions", self._nodes, 3)
        out = np.empty(self._shape, np.float32)
        normals = np.empty(self._shape, np.float32) if self._normals else None
        lib.drape_embedding_carry(self._handle.address, x.ctypes.data, out.ctypes.data, None if normals is None else normals.ctypes.data)
        return out, normals


# ---- Callbacks ----
#
# A callback keeps exceptions for the caller of the advance, as the library cannot pass them on. It refers to its sim weakly: the library's sim keeps the
# callback alive, and the Python object keeps the library's sim, and the functions that the callback calls, which may refer to the object.

def _observer(sim_of):
    def observe(_, pointer):
        sim = sim_of()
        if sim is None:
            return 0
        try:
            event = pointer.contents
            if sim._pending is not None:  # of the wind or an event
                return Status.E_STOPPED
            if sim.model.terms and any(term.failed for term in sim.model.terms):
                return Status.E_STOPPED
            if sim._observers:
                kind, public = event.kind, None
                for observer, kinds in sim._observers:
                    if kinds and kind not in kinds:
                        continue
                    public = public or _event_of(sim, event)
                    if observer(public):
                        raise Stopped(f"t={sim.time:.9g}: an observer asked to stop")
            if sim._wants_frame and event.kind == EventKind.FRAME:
                sim._frame = Frame(event.frame, event.time, _copy(event.positions, sim._shape), _copy(event.velocities, sim._shape))
                return 1
            if sim._interrupt.came:
                sim._interrupt.pass_on()
            return Status.OK
        except BaseException as error:
            sim._pending = error
            return Status.E_STOPPED

    return c.drape_observer(observe)


def _event_of(sim: Sim, event) -> Event:
    attempt = record(event.attempt.contents) if event.attempt else None
    x, v = (sim._handle.view(address, sim._shape, np.float64) if address else None for address in (event.positions, event.velocities))
    time = sim.time if attempt else event.time
    return Event(EventKind(event.kind), sim, time, event.frame, x, v, attempt, event.name.decode() if event.name else "", event.value, event.direction)


def _copy(address: int, shape) -> np.ndarray:
    out = np.empty(shape)
    ctypes.memmove(out.ctypes.data, address, out.nbytes)
    return out


def _wind(sim_of):
    def field(_, t, count, x, out, gradient):
        sim = sim_of()
        try:
            points = _copy(x, (count, 3))
            result = sim._wind(t, points)
            values, slope = result if isinstance(result, tuple) and len(result) == 2 else (result, None)
            values = _air(values, "the wind", points, 3)
            ctypes.memmove(out, values.ctypes.data, values.nbytes)
            if gradient and slope is not None:
                slope = _air(slope, "the gradient of the wind", points, 3, 3)
                ctypes.memmove(gradient, slope.ctypes.data, slope.nbytes)
        except BaseException as error:
            sim._pending = sim._pending or error
            ctypes.c_double.from_address(out).value = math.nan  # so that the attempt is rejected; then the observer ends the advance

    return c.drape_wind_field(field)


def _air(values, name: str, points: np.ndarray, *shape: int) -> np.ndarray:
    """What a wind returned for points. It is to blame for what is not finite, unless the points are those of an attempt that diverges."""
    if values is None:
        raise TypeError(f"{name}: the function returned None, needs {' x '.join(map(str, (len(points), *shape)))} numbers")
    air = spread(values, name, len(points), *shape, finite=False)
    if not np.isfinite(air).all():
        bad = np.flatnonzero(~np.isfinite(air.reshape(len(points), -1)).all(1) & np.isfinite(points).all(1))
        if len(bad):
            raise ArgumentError(f"{name}: is {air[bad[0]].tolist()} at point {bad[0]}, {points[bad[0]].tolist()}; it must be finite")
    return air


def _event_function(sim_of, index: int):
    def measure(_, t, x, v, value):
        sim = sim_of()
        try:
            ctypes.c_double.from_address(value).value = real(sim._events[index](t, _copy(x, sim._shape), _copy(v, sim._shape)), "what the function of an event returns")
            return 0
        except BaseException as error:
            sim._pending = error
            return Status.E_STOPPED

    return c.drape_event_function(measure)


# ---- The end of the interpreter ----

_SIMS: "weakref.WeakSet[Sim]" = weakref.WeakSet()
_PATIENCE = 10.0  # [s] for the steps in progress when the interpreter ends


@atexit.register
def _stop_all() -> None:
    """A daemon thread may still advance a sim, whose callbacks need the interpreter. Such sims are stopped after the step in progress, and their locks are kept,
    so that no further advance begins. A sim that does not stop in time is left as it is, with all that it needs."""
    running = [sim for sim in list(_SIMS) if not sim._lock.acquire(blocking=False)]
    for sim in running:
        sim.cancel()
    end = time.monotonic() + _PATIENCE
    for sim in running:
        if not sim._lock.acquire(timeout=max(0.0, end - time.monotonic())):
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(sim))


class _Interrupt:
    """While the main thread advances a sim, Ctrl-C is noted, and the observer calls the handler of the program. Otherwise its exception would be raised in one
    of the library's callbacks, before that can catch it, and be lost."""

    def __init__(self) -> None:
        self.came: Tuple[Any, ...] = ()
        self.before: Any = None
        self.handler: Any = None  # before or, if that is of an advance whose observer makes this one, the handler before that

    def __enter__(self) -> "_Interrupt":
        if threading.current_thread() is threading.main_thread() and callable(signal.getsignal(signal.SIGINT)):
            self.before = signal.signal(signal.SIGINT, self._note)
            outer = getattr(self.before, "__self__", None)
            self.handler = outer.handler if isinstance(outer, _Interrupt) else self.before
        return self

    def __exit__(self, *_: Any) -> None:
        if self.before is not None and signal.getsignal(signal.SIGINT) == self._note:  # which the handler may have replaced
            signal.signal(signal.SIGINT, self.before)

    def _note(self, *arguments: Any) -> None:
        self.came = arguments

    def pass_on(self) -> None:
        """Calls the handler: that of Python raises KeyboardInterrupt; after one that does not raise, the advance goes on."""
        came, self.came = self.came, ()
        self.handler(*came)


# ---- Values ----

def _settings(values: Mapping[str, Any], keep: list):
    """An array of drape_setting, and its length."""
    array = (c.drape_setting * len(values))()
    for setting, (name, value) in zip(array, values.items()):
        setting.name = encode(name)
        if isinstance(value, (bool, np.bool_)):
            setting.text = b"true" if value else b"false"
        elif isinstance(value, str):
            setting.text = encode(value)
        elif np.ndim(value):
            vector = numbers(value, name, -1)
            keep.append(vector)
            setting.vector, setting.vector_count = vector.ctypes.data, len(vector)
        else:
            setting.number = value
    keep.append(array)
    return array if len(array) else None, len(array)


def _rows(values, name: str) -> np.ndarray:
    """An array of rows, from rows or a single one."""
    given = given_array(values, name)
    return given.reshape(0, 3) if given.shape == (0,) else np.atleast_2d(given)


def _what(cloth: bool, colliders: bool) -> int:
    return cloth * c.DRAPE_QUERY_CLOTH + colliders * c.DRAPE_QUERY_COLLIDERS


def _pointer(array: np.ndarray, kind):
    return ctypes.cast(array.ctypes.data, ctypes.POINTER(kind))
