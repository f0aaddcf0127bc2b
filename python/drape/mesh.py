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
        if self.triangles.size and not 0 <= self.triangles.min() <= self.triangles.max() < len(self.positions):
            raise ArgumentError(f"triangles: has node {self.triangles.max()} of {len(self.positions)}, or a negative one")

    @classmethod
    def of(cls, mesh: Any, **settings: Any) -> "Mesh":
        """A mesh from another package: a dictionary or an object with `vertices` and `faces`, as trimesh has, or with `points` and `cells`, as meshio
        has; quadrangles and larger polygons of meshio's cells are divided into triangles from their first corner."""
        if isinstance(mesh, Mapping):
            get: Any = mesh.get
        else:
            def get(name):
                return getattr(mesh, name, None)
        if isinstance(mesh, cls):
            return mesh
        if get("vertices") is not None and get("faces") is not None:
            return cls(get("vertices"), _fans([get("faces")]), **settings)
        if get("points") is not None and get("cells") is not None:
            cells = get("cells")
            blocks: Any = cells.items() if isinstance(cells, Mapping) else [b if isinstance(b, tuple) else (b.type, b.data) for b in cells]
            faces = [data for kind, data in blocks if kind in ("triangle", "quad", "polygon")]
            return cls(get("points"), _fans(faces), **settings)
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
        check_finite(self.positions, "positions")
        if os.fspath(path).endswith(".obj"):
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


def _fans(blocks) -> np.ndarray:
    """Triangles of polygons; each block is an array of polygons, or a list of polygons of any length."""
    triangles = []
    for block in blocks:
        for polygon in block if not isinstance(block, np.ndarray) or block.ndim != 2 else []:
            triangles += [(polygon[0], polygon[k], polygon[k + 1]) for k in range(1, len(polygon) - 1)]
        if isinstance(block, np.ndarray) and block.ndim == 2:
            corners = block.shape[1]
            triangles += np.stack([block[:, [0, k, k + 1]] for k in range(1, corners - 1)], 1).reshape(-1, 3).tolist()
    return np.array(triangles, dtype=None if triangles else np.int32).reshape(-1, 3)
