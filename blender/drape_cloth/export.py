"""From a scene of Blender to the folder of a bake: a scene file of Drape, and the meshes and motions that it reads."""
import json
import os
import re
import tempfile
from typing import Any, Dict, List, Optional, Tuple

import bpy
import numpy as np

from . import cache, mesh
from .folder import Folder, Problem
from .program import LOG, SCENE, vertices_file

MODIFIER = "Drape"
"""name of the Mesh Cache modifier of a cloth"""

SHAPES = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
"""types of objects that have a surface"""

KEEP_NODES = {"ARMATURE", "CAST", "CORRECTIVE_SMOOTH", "CURVE", "DATA_TRANSFER", "DISPLACE", "HOOK", "LAPLACIANDEFORM", "LAPLACIANSMOOTH", "LATTICE",
              "MESH_CACHE", "MESH_DEFORM", "NORMAL_EDIT", "SHRINKWRAP", "SIMPLE_DEFORM", "SMOOTH", "SURFACE_DEFORM", "UV_PROJECT", "UV_WARP",
              "VERTEX_WEIGHT_EDIT", "VERTEX_WEIGHT_MIX", "VERTEX_WEIGHT_PROXIMITY", "WARP", "WAVE", "WEIGHTED_NORMAL"}
"""modifiers that leave the vertices of a mesh their numbers"""


def modifier_of(thing):
    """The modifier that plays the bake of an object, or None. Another one may have its name, and Blender then adds a number to it."""
    return next((modifier for modifier in thing.modifiers if modifier.type == "MESH_CACHE" and re.fullmatch(MODIFIER + r"(\.\d+)?", modifier.name)), None)


def before_cloth(thing) -> int:
    """The number of modifiers at the head of the stack that deform the mesh before the cloth does: they move pins and give the shape in which it starts."""
    count, own = 0, modifier_of(thing)
    for modifier in thing.modifiers:
        if modifier == own or modifier.type not in KEEP_NODES:
            break
        count += 1
    return count


def steps_per_second(settings, rate: float) -> float:
    """Nominal steps per second of the chosen quality: a whole number in each frame."""
    at_least = {"REALTIME": 60, "DRAFT": 0, "STANDARD": 60, "FINE": 120}.get(settings.quality)
    return rate * (settings.steps if at_least is None else max(1, int(np.ceil(at_least / rate - 1e-9))))


def quality(settings, rate: float) -> Dict[str, Any]:
    """The scene's `accuracy`, or its `integrator`."""
    if settings.quality == "ACCURATE":
        return {"accuracy": f"{settings.accuracy:.6g}m"}
    if settings.quality == "EXACT":
        return {"integrator": {"method": "ida", "rtol": 1e-4}}
    method = {"REALTIME": "newton_k", "DRAFT": "be", "STANDARD": "be", "FINE": "trbdf2"}.get(settings.quality, settings.method)
    chosen = {"method": method, "dt": 1 / steps_per_second(settings, rate)}
    if settings.quality == "CUSTOM":
        chosen["rtol"] = settings.rtol
    return {"integrator": chosen}


def colliders_of(context, thing) -> List[Any]:
    """The objects that this cloth meets, by name."""
    within = thing.drape.colliders
    return sorted((other for other in (within.all_objects if within else context.scene.objects) if other.drape.role == "COLLIDER" and other != thing
                   and other.name in context.view_layer.objects and not other.hide_viewport), key=lambda other: other.name)


def simulated_of(context, thing):
    """The object that is simulated in place of a cloth."""
    other = thing.drape.simulated
    if other.type != "MESH":
        raise Problem(f"{other.name}: is of the type {other.type.title()}; only a mesh can be simulated for {thing.name}")
    if other.name not in context.view_layer.objects or other.hide_viewport:
        raise Problem(f"{other.name}: is disabled in viewports or not in this view layer, so it cannot be simulated for {thing.name}: hide it by the eye")
    if other in colliders_of(context, thing):
        raise Problem(f"{other.name}: is simulated for {thing.name}, so it cannot be one of its colliders")
    return other


class Surface:
    """What an object is, frame by frame: its points in its own axes, and its transform into those of the scene."""

    def __init__(self, thing):
        self.thing, self.name = thing, thing.name
        self.local: List[np.ndarray] = []  # of a frame without change, the array of the first one
        self.matrices: List[np.ndarray] = []
        self.triangles: Optional[np.ndarray] = None
        self.shape = (0, 0)
        self.warning = ""

    def sample(self, depsgraph, axes: np.ndarray) -> None:
        if self.thing.type not in SHAPES:
            raise Problem(f"{self.name}: is of the type {self.thing.type.title()}, which has no surface: its role can only be None")
        evaluated = self.thing.evaluated_get(depsgraph)
        self.matrices.append(axes @ np.array(evaluated.matrix_world, float))
        if not _invertible(self.matrices[-1]):
            raise Problem(f"{self.name}: is scaled to nothing along an axis in frame {bpy.context.scene.frame_current}")
        try:
            surface = evaluated.to_mesh()
        except RuntimeError as error:
            raise Problem(f"{self.name}: has no surface") from error
        try:
            x = np.empty(3 * len(surface.vertices), np.float32)
            surface.vertices.foreach_get("co", x)
            x = x.reshape(-1, 3)
            shape = len(surface.vertices), len(surface.loops)
            if self.triangles is None:
                self.shape, self.triangles = shape, fans_of(surface)[0]
            elif shape != self.shape:
                raise Problem(f"{self.name}: has {shape[0]} vertices in frame {bpy.context.scene.frame_current}, and {self.shape[0]} in the first one: "
                              "the vertices of an object must keep their numbers while the cloth is baked")
        finally:
            evaluated.to_mesh_clear()
        self.local.append(self.local[0] if self.local and np.array_equal(x, self.local[0]) else x)

    def deforms(self) -> bool:
        return any(x is not self.local[0] for x in self.local)

    def points(self, frame: int) -> np.ndarray:
        """In the axes of the scene [m]."""
        return mesh.transformed(self.matrices[frame], self.local[frame].astype(float))


def _invertible(matrix: np.ndarray) -> bool:
    """Whether a 4 x 4 transform in metres keeps the dimensions of space."""
    return bool(np.isfinite(matrix).all()) and np.linalg.svd(matrix[:3, :3], compute_uv=False).min() >= 1e-9


def fans_of(surface) -> Tuple[np.ndarray, np.ndarray]:
    """The triangles that Blender cuts the polygons of a mesh into, and the polygon of each."""
    surface.calc_loop_triangles()
    fans, fan_of = np.empty(3 * len(surface.loop_triangles), np.int32), np.empty(len(surface.loop_triangles), np.int32)
    surface.loop_triangles.foreach_get("vertices", fans)
    surface.loop_triangles.foreach_get("polygon_index", fan_of)
    return fans.reshape(-1, 3), fan_of


class Course:
    """A vector that may change from frame to frame. Drape multiplies one of constant direction by a history, which is linear between the frames."""

    def __init__(self, name: str, about: str, samples: List[np.ndarray], times: np.ndarray):
        values = np.array(samples)
        largest = values[np.argmax(np.einsum("ij,ij->i", values, values))]
        self.vector, self.history, self.warning = values[0], None, ""
        if (values == values[0]).all():
            return
        factors = values @ largest / (largest @ largest)
        if np.abs(values - np.outer(factors, largest)).max() > mesh.RIGID * np.abs(largest).max():
            self.warning = f"the {about} changes its direction: the cloth feels that of the first frame throughout"
            return
        self.vector, self.history = largest, {"name": name, "times": times.tolist(), "values": factors.tolist()}


class Samples:
    """Everything that changes from frame to frame, from the first to the last frame of the scene."""

    def __init__(self, context, thing):
        scene = context.scene
        unit = scene.unit_settings.scale_length
        # Blender has z up, Drape y up: (x, y, z) becomes (x, z, -y), in metres.
        self.axes = unit * np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1 / unit]])
        self.shown = Surface(thing)
        self.cloth = Surface(simulated_of(context, thing)) if thing.drape.simulated else self.shown
        self.colliders = [Surface(other) for other in colliders_of(context, thing)]
        winds = [other for other in scene.objects if other.field and other.field.type == "WIND" and other.name in context.view_layer.objects
                 and not other.hide_viewport] if thing.drape.air else []
        rate = scene.render.fps / scene.render.fps_base
        self.rate, self.times = rate, np.arange(scene.frame_end - scene.frame_start + 1) / rate
        wind: List[np.ndarray] = []
        gravity: List[np.ndarray] = []
        hidden = [modifier for other in {thing, self.cloth.thing} for modifier in list(other.modifiers)[before_cloth(other):] if modifier.show_viewport]
        now = scene.frame_current, scene.frame_subframe
        try:
            for modifier in hidden:
                modifier.show_viewport = False
            for frame in range(scene.frame_start, scene.frame_end + 1):
                scene.frame_set(frame)
                depsgraph = context.evaluated_depsgraph_get()
                for surface in {self.shown, self.cloth, *self.colliders}:
                    surface.sample(depsgraph, self.axes)
                gravity.append(self.axes[:3, :3] @ np.array(scene.gravity) * scene.use_gravity)
                wind.append(sum((self._wind(other.evaluated_get(depsgraph)) for other in winds), np.zeros(3)))
        finally:
            for modifier in hidden:
                modifier.show_viewport = True
            scene.frame_set(now[0], subframe=now[1])
        self.gravity = Course("gravity", "gravity", gravity, self.times)
        self.wind = Course("wind", f"wind ({', '.join(other.name for other in winds)})", wind, self.times)

    def _wind(self, field) -> np.ndarray:
        """[m/s]: the strength of a field along its z axis."""
        z = self.axes[:3, :3] @ np.array(field.matrix_world, float)[:3, 2]
        length = np.linalg.norm(z)
        if not 0 < length < np.inf:
            raise Problem(f"{field.name}: is scaled to nothing along its z axis in frame {bpy.context.scene.frame_current}, so its wind has no direction")
        return field.field.strength * z / length


def _track(times: np.ndarray, d: np.ndarray) -> List[Any]:
    """Keys of a motion that is linear between frames: d is frames x 3."""
    return [[t, place] for t, place in zip(times.tolist(), d.tolist())]


def _pins(cloth: Surface, nodes: np.ndarray, times: np.ndarray) -> List[Dict[str, Any]]:
    """Nodes that stay, or move with a rigid object, as one pin; nodes that an armature, shape keys and the like move with a track for each motion."""
    if not len(nodes):
        return []
    rotations = None if cloth.deforms() else mesh.rigid_motion(np.array(cloth.matrices))
    if rotations is not None:
        return [{"name": "pinned", "nodes": nodes.tolist(), **_motion(cloth, rotations, times)}]
    motions: Dict[bytes, Tuple[List[int], np.ndarray]] = {}
    paths = np.stack([cloth.points(k)[nodes] for k in range(len(times))], 1)  # nodes x frames x 3
    for node, path in zip(nodes.tolist(), paths - paths[:, :1]):
        motions.setdefault(path.tobytes(), ([], path))[0].append(node)
    return [{"nodes": group, **({"track": _track(times, path)} if path.any() else {})} for group, path in motions.values()]


def pinned_nodes(thing, settings) -> np.ndarray:
    """Vertices whose weight in the group of pins is not below the threshold."""
    if not settings.pin_group:
        return np.empty(0, int)
    group = thing.vertex_groups.get(settings.pin_group)
    if group is None:
        raise Problem(f"{thing.name}: has no vertex group {settings.pin_group}")
    nodes = [vertex.index for vertex in thing.data.vertices
             if any(part.group == group.index and part.weight >= settings.pin_threshold for part in vertex.groups)]
    if not nodes:
        raise Problem(f"{thing.name}: no vertex of the group {group.name} has a weight of {settings.pin_threshold:g} or more")
    return np.array(nodes)


def _at_rest(surface: Surface) -> Tuple[np.ndarray, np.ndarray]:
    """The vertices of an object without its modifiers: in its own axes, and in those of the scene where it is in the first frame [m]."""
    data, matrix = surface.thing.data, surface.matrices[0]
    x = np.empty(3 * len(data.vertices), np.float32)
    data.vertices.foreach_get("co", x)
    local = x.reshape(-1, 3)
    if not data.polygons:
        raise Problem(f"{surface.name}: has no faces")
    if surface.shape[0] != len(local):
        raise Problem(f"{surface.name}: its mesh has {len(local)} vertices, and {surface.shape[0]} after the modifiers before the cloth")
    return local, mesh.transformed(matrix, local.astype(float))


def _render_mesh(samples: Samples, folder: str) -> Dict[str, Any]:
    """The mesh of the cloth that follows the simulated one, whose vertices keep their numbers."""
    distance = samples.shown.thing.drape.simulated_distance
    mesh.write_obj(os.path.join(folder, "render.obj"), _at_rest(samples.shown)[1], fans_of(samples.shown.thing.data)[0])
    return {"file": "render.obj", **({"max_distance": distance} if distance > 0 else {})}


def _cloth(thing, samples: Samples, folder: str) -> Dict[str, Any]:
    settings, cloth = thing.drape, samples.cloth
    local, rest = _at_rest(cloth)
    data = cloth.thing.data
    triangles = mesh.split([tuple(polygon.vertices) for polygon in data.polygons], *fans_of(data), rest)
    mesh.write_obj(os.path.join(folder, "cloth.obj"), rest, triangles)
    warp = samples.shown.matrices[0][:3, "XYZ".index(settings.warp)]
    warp = (warp / np.linalg.norm(warp)).tolist()
    material: Dict[str, Any] = {}
    if settings.fabric:
        material["fabric"] = settings.fabric
    else:
        material.update(young_modulus=settings.young_modulus, poisson_ratio=settings.poisson_ratio, thickness=settings.thickness)
    if not settings.fabric or settings.own_weight:
        material["areal_density"] = settings.areal_density
    terms: List[Any] = [{"type": "stretch.cst", "warp_direction": warp}, {"type": "bend.midedge", "warp_direction": warp}]
    if settings.damping > 0:
        terms.append({"type": "damp.kelvin_voigt", "beta": settings.damping})
    if settings.air:
        terms.append({"type": "drag.wind", "wind": samples.wind.vector.tolist(), "density": settings.air_density})
        if samples.wind.history:
            terms[-1]["history"] = samples.wind.history["name"]
    made = {"name": thing.name, "mesh": {"file": "cloth.obj"}, "material": material, "terms": terms, "pins": _pins(cloth, pinned_nodes(cloth.thing, settings), samples.times)}
    if not np.array_equal(cloth.local[0], local):
        mesh.write_obj(os.path.join(folder, "start.obj"), cloth.points(0), triangles)
        made["start"] = {"file": "start.obj"}
    if cloth is not samples.shown:
        made["render_mesh"] = _render_mesh(samples, folder)
    return made


def _motion(surface: Surface, rotations: np.ndarray, times: np.ndarray) -> Dict[str, Any]:
    """The motion of a rigid body, from its place in the first frame: it turns about the origin of the object, which moves along the track."""
    origins = np.array([matrix[:3, 3] for matrix in surface.matrices])
    motion: Dict[str, Any] = {}
    if (origins != origins[0]).any():
        motion["track"] = _track(times, origins - origins[0])
    if (rotations != rotations[0]).any():
        keys, last = [], np.array([1.0, 0, 0, 0])
        for time, rotation in zip(times.tolist(), rotations):
            q = mesh.quaternion(rotation)
            last = -q if q @ last < 0 else q  # of the two quaternions of a rotation that nearer to the one before: the shorter turn
            keys.append({"time": time, "quaternion": last.tolist()})
        motion.update(pivot=origins[0].tolist(), turns=keys)
    return motion


def _body(surface: Surface, settings) -> Optional[Dict[str, Any]]:
    """The exact shape that the object stands for, or None: its mesh is the shape."""
    matrix, x = surface.matrices[0], surface.local[0].astype(float)
    sizes = np.linalg.norm(matrix[:3, :3], axis=0)
    low, high = x.min(0), x.max(0)
    center = mesh.transformed(matrix, (low + high) / 2).tolist()
    if settings.shape == "SPHERE":
        if sizes.max() > (1 + mesh.RIGID) * sizes.min():
            raise Problem(f"{surface.name}: is scaled unevenly, so it is no sphere: choose the shape Mesh")
        return {"type": "sphere", "center": center, "radius": float((high - low).max() / 2 * sizes[0])}
    if settings.shape == "BOX":
        rotation = matrix[:3, :3] / sizes
        if np.abs(rotation.T @ rotation - np.eye(3)).max() > mesh.RIGID:
            raise Problem(f"{surface.name}: is sheared, so it is no box: choose the shape Mesh")
        if np.linalg.det(rotation) < 0:
            rotation[:, 0] *= -1  # a mirrored box is a box
        return {"type": "box", "center": center, "size": ((high - low) * sizes).tolist(), "rotate": mesh.axis_angle(mesh.nearest_rotation(rotation))}
    if settings.shape == "PLANE":
        normal = np.linalg.inv(matrix[:3, :3])[2]  # of the plane z = 0 of the object
        return {"type": "plane", "point": matrix[:3, 3].tolist(), "normal": (normal / np.linalg.norm(normal)).tolist()}
    return None


def _with_area(surface: Surface, rigid: bool) -> np.ndarray:
    """The triangles of a collider but those that have no area in any frame, as text objects have: cloth meets the others there."""
    none = mesh.without_area(surface.points(0), surface.triangles)
    for frame in range(1, 1 if rigid else len(surface.local)):
        none[none] = mesh.without_area(surface.points(frame), surface.triangles[none])
    triangles = surface.triangles[~none]
    if not len(triangles):
        raise Problem(f"{surface.name}: its faces have no area")
    if none.any() and mesh.is_closed(surface.triangles) and not mesh.is_closed(triangles):
        surface.warning = f"{none.sum()} triangles without area are left out, and the surface is open there: merge vertices by distance"
    return triangles


def _collider(number: int, surface: Surface, folder: str, samples: Samples) -> Dict[str, Any]:
    settings, times = surface.thing.drape, samples.times
    common = {"name": surface.name, "friction": settings.friction}
    if settings.shape != "PLANE" and not len(surface.triangles):
        raise Problem(f"{surface.name}: has no faces")
    rotations = None if surface.deforms() else mesh.rigid_motion(np.array(surface.matrices))
    body = _body(surface, settings)
    if body:
        if rotations is None:
            raise Problem(f"{surface.name}: deforms, so it is no {body['type']}: choose the shape Mesh")
        return {**body, **common, **_motion(surface, rotations, times)}
    nodes, triangles = mesh.used(_with_area(surface, rotations is not None))
    closed = mesh.is_closed(triangles)
    first = surface.points(0)[nodes]
    if closed:
        triangles = mesh.outward(first, triangles)
    obj, npy = f"collider_{number}.obj", f"collider_{number}.npy"
    mesh.write_obj(os.path.join(folder, obj), first, triangles)
    if len(nodes) != surface.shape[0]:
        np.save(os.path.join(folder, vertices_file(obj)), nodes)
    if closed and rotations is not None:
        return {"type": "mesh", "file": obj, **common, **_motion(surface, rotations, times)}
    moves = rotations is None or any((matrix != surface.matrices[0]).any() for matrix in surface.matrices)
    np.save(os.path.join(folder, npy), np.stack([surface.points(k)[nodes] for k in range(len(times) if moves else 1)]))
    return {"type": "animated_mesh", "file": npy, "mesh": obj, "frame_rate": samples.rate, "open": not closed, "thickness": settings.surface_thickness, **common}


def export(context, thing, folder: Folder) -> List[str]:
    """Takes the folder and writes the bake of a cloth, ready to be run by `drape run scene.json --out run` in it. It is left as it is if something is wrong. Returns warnings."""
    scene = context.scene
    if scene.frame_end <= scene.frame_start:
        raise Problem("the scene has one frame only: set its end")
    samples = Samples(context, thing)
    with tempfile.TemporaryDirectory() as made:
        _write(thing, samples, made)
        folder.take()
        folder.fill(made, keep=(LOG, cache.CACHE))
    return [f"{thing.name}: {course.warning}" for course in (samples.gravity, samples.wind) if course.warning] + [
        f"{surface.name}: {surface.warning}" for surface in samples.colliders if surface.warning]


def _write(thing, samples: Samples, folder: str) -> None:
    settings = thing.drape
    made: Dict[str, Any] = {
        "drape": 1,
        "description": f"{thing.name}, of {bpy.path.basename(bpy.data.filepath) or 'a file without a name'}",
        "cloth": [_cloth(thing, samples, folder)],
        "gravity": samples.gravity.vector.tolist(),
        "colliders": [_collider(number, surface, folder, samples) for number, surface in enumerate(samples.colliders)],
        "contact": {"distance": settings.contact_distance} if settings.contact_distance > 0 else {},
        **quality(settings, samples.rate),
        "duration": samples.times[-1],
        "frame_rate": samples.rate,
        "output": {"formats": ["npy"]}}
    histories = [course.history for course in (samples.gravity, samples.wind) if course.history]
    if histories:
        made["histories"] = histories
    if samples.gravity.history:
        made["gravity_history"] = samples.gravity.history["name"]
    if settings.self_contact:
        made["self_contact"] = {"thickness": settings.layer_distance / 2, "friction": settings.layer_friction}
    if settings.untangle:
        made["untangle"] = {}
    np.save(os.path.join(folder, cache.MATRICES), np.linalg.inv(np.array(samples.shown.matrices)))
    with open(os.path.join(folder, SCENE), "w", encoding="utf-8", errors="replace") as file:  # old files have names that are not UTF-8
        file.write("{" + ",\n ".join(f"{json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}" for key, value in made.items()) + "}\n")
