"""Triangle meshes as arrays, and the dictionaries of other packages."""
import os
from typing import Any, Mapping

import numpy as np

from ._library import ArgumentError, check_finite, numbers


class Mesh:
    """Triangles: positions (n x 3 [m]) and triangles (m x 3, from 0, counterclockwise seen from outside).

    It can stand in a scene wherever a mesh does: `scene["/cloth/0/mesh"] = drape.Mesh(positions, triangles)`. Members that a mesh of a scene may
    have besides are given by name: `transform={"scale": 0.01}`."""

    def __init__(self, positions, triangles, **settings: Any):
        self.positions = numbers(positions, "positions", -1, 3)
        self.triangles = numbers(triangles, "triangles", -1, 3, dtype=np.int32)
        self.settings = settings
        outside = np.argwhere((self.triangles < 0) | (self.triangles >= len(self.positions)))
        if len(outside):
            row, corner = outside[0].tolist()
            raise ArgumentError(f"triangles[{row}, {corner}]: there is no node {self.triangles[row, corner]}: there are {len(self.positions)}, from 0")

    @classmethod
    def of(cls, mesh: Any, **settings: Any) -> "Mesh":
        """A mesh from another package: a dictionary or an object with `vertices` and `faces`, as trimesh has, or with `points` and `cells`, as meshio
        has; quadrangles and larger polygons are divided into triangles from their first corner. Vertices and lines of meshio's cells are left out."""
        if isinstance(mesh, Mapping):
            get: Any = mesh.get
        else:
            def get(name):
                return getattr(mesh, name, None)
        if isinstance(mesh, cls):
            return mesh
        if get("vertices") is not None and get("faces") is not None:
            return cls(get("vertices"), _fans([("faces", get("faces"))]), **settings)
        if get("points") is not None and get("cells") is not None:
            cells = get("cells")
            blocks: Any = cells.items() if isinstance(cells, Mapping) else [b if isinstance(b, tuple) else (b.type, b.data) for b in cells]
            return cls(get("points"), _fans([(f"cells, {kind}", data) for kind, data in blocks if _is_face(kind)]), **settings)
        if get("positions") is not None and get("triangles") is not None:
            return cls(get("positions"), get("triangles"), **settings)
        raise ArgumentError("a mesh needs vertices and faces, points and cells, or positions and triangles")

    def to_trimesh(self) -> dict:
        """Arguments of trimesh.Trimesh: `trimesh.Trimesh(**mesh.to_trimesh(), process=False)`."""
        return {"vertices": self.positions, "faces": self.triangles}

    def to_meshio(self) -> dict:
        """Arguments of meshio.Mesh: `meshio.Mesh(**mesh.to_meshio())`."""
        return {"points": self.positions, "cells": [("triangle", self.triangles)]}

    def write(self, path) -> None:
        """Writes a PLY file (binary, double precision), or an OBJ file if the name ends in .obj, with all digits."""
        ending = os.path.splitext(os.fsdecode(path))[1].lower()
        if ending not in (".ply", ".obj"):
            raise ArgumentError(f"{os.fsdecode(path)!r}: a mesh is written as .ply or .obj")
        check_finite(self.positions, "positions")
        if ending == ".obj":
            with open(path, "w", encoding="ascii") as file:
                file.writelines("v %r %r %r\n" % tuple(x) for x in self.positions.tolist())
                file.writelines("f %d %d %d\n" % tuple(t) for t in (self.triangles + 1).tolist())
            return
        faces = np.empty(len(self.triangles), [("count", "u1"), ("corners", "<i4", 3)])
        faces["count"], faces["corners"] = 3, self.triangles
        head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(self.positions)}\nproperty double x\nproperty double y\nproperty double z\n"
                f"element face {len(self.triangles)}\nproperty list uchar int vertex_indices\nend_header\n")
        with open(path, "wb") as file:
            file.write(head.encode() + self.positions.astype("<f8").tobytes() + faces.tobytes())

    def __repr__(self) -> str:
        return f"Mesh({len(self.positions)} nodes, {len(self.triangles)} triangles)"


def _is_face(kind: str) -> bool:
    """Whether a block of meshio's cells has faces, or less, which is left out; what has other cells is no mesh of faces."""
    if kind == "vertex" or kind.startswith("line"):
        return False
    if kind in ("triangle", "quad") or kind.startswith("polygon"):
        return True
    raise ArgumentError(f"cells: has {kind}; faces are triangle, quad or polygon")


def _fans(blocks) -> np.ndarray:
    """Triangles of polygons; each block, with its name, is an array of polygons, or a list of polygons of any length."""
    triangles = []
    for name, block in blocks:
        flat = isinstance(block, np.ndarray) and block.ndim == 2
        for k, polygon in enumerate(block[:1] if flat else block):
            if np.ndim(polygon) != 1 or len(polygon) < 3:
                raise ArgumentError(f"{name}[{k}]: {np.asarray(polygon).tolist()} is not a face; it needs the numbers of at least 3 nodes")
        if flat:
            triangles += np.stack([block[:, [0, k, k + 1]] for k in range(1, block.shape[1] - 1)], 1).reshape(-1, 3).tolist() if len(block) else []
            continue
        for polygon in block:
            triangles += [(polygon[0], polygon[k], polygon[k + 1]) for k in range(1, len(polygon) - 1)]
    if not triangles:
        raise ArgumentError(f"{', '.join(name for name, _ in blocks) or 'cells'}: there are no faces")
    return np.array(triangles).reshape(-1, 3)
