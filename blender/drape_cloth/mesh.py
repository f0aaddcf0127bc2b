"""Triangles, files and motions of meshes, for scenes of Drape. Nothing here needs Blender."""
from typing import List, Optional, Tuple

import numpy as np

RIGID = 1e-4
"""largest deviation of a motion from a rigid one, relative: Blender's matrices are in float32"""
THIN = 1e-9
"""altitude over longest edge below which a triangle has no area: the library refuses those below 1e-12, and a transform rounds"""


def split(polygons: List[Tuple[int, ...]], fans: np.ndarray, fan_of: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The triangles of polygons: triangles x 3 node numbers, in the order of the polygons.

    Quads are cut along the shorter diagonal. Those whose diagonals are about equal are cut like the fields of a chessboard, in turn along one and the
    other, since a sheet whose diagonals all run in one direction is stiffer along them. Other polygons are cut as Blender does: fans are its triangles and
    fan_of the number of the polygon of each."""
    is_quad = np.array([len(corners) == 4 for corners in polygons], bool)
    a, b, c, d = np.array([corners for corners in polygons if len(corners) == 4], int).reshape(-1, 4).T
    cuts = np.stack([a, b, c, a, c, d], 1).reshape(-1, 2, 3), np.stack([b, c, d, b, d, a], 1).reshape(-1, 2, 3)
    lengths = np.linalg.norm(x[a] - x[c], axis=1), np.linalg.norm(x[b] - x[d], axis=1)
    second = (lengths[1] < 0.99 * lengths[0]) | (lengths[1] < 1.01 * lengths[0]) & (_two_colours(polygons, len(x))[a] == 1)
    folded = [_folded(cut, x) for cut in cuts]
    second = np.where(folded[0] != folded[1], folded[0], second)  # a quad with a reentrant corner has one diagonal inside
    chosen = np.where(second[:, None, None], cuts[1], cuts[0]).reshape(-1, 3)
    other = ~is_quad[fan_of]
    order = np.argsort(np.concatenate([np.repeat(np.flatnonzero(is_quad), 2), fan_of[other]]), kind="stable")
    return np.concatenate([chosen, fans[other]])[order]


def _folded(pairs: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Of each of these pairs of triangles (pairs x 2 x 3 node numbers), whether they face different sides."""
    p, q, r = (x[pairs[:, :, k]] for k in range(3))
    normals = np.cross(q - p, r - p)
    return np.einsum("ij,ij->i", normals[:, 0], normals[:, 1]) <= 0


def _two_colours(polygons, count: int) -> np.ndarray:
    """0 and 1, different at the ends of edges wherever the mesh allows it."""
    beside: List[List[int]] = [[] for _ in range(count)]
    for corners in polygons:
        for a, b in zip(corners, corners[1:] + corners[:1]):
            beside[a].append(b)
            beside[b].append(a)
    colour = np.full(count, -1)
    for seed in range(count):
        if colour[seed] < 0:
            colour[seed], front = 0, [seed]
            for node in front:
                for other in beside[node]:
                    if colour[other] < 0:
                        colour[other] = 1 - colour[node]
                        front.append(other)
    return colour


def write_obj(path: str, x: np.ndarray, triangles: np.ndarray) -> None:
    """Nodes and triangles, with all digits."""
    with open(path, "w", encoding="ascii") as file:
        file.writelines(f"v {a!r} {b!r} {c!r}\n" for a, b, c in x.tolist())
        file.writelines(f"f {a} {b} {c}\n" for a, b, c in (triangles + 1).tolist())


def used(triangles: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """The nodes that triangles have, in ascending order, and the triangles with numbers among these."""
    nodes, numbers = np.unique(triangles, return_inverse=True)
    return nodes, numbers.reshape(-1, 3)


def without_area(x: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Whether the corners of each triangle lie on a line."""
    a, b, c = (x[triangles[:, k]] for k in range(3))
    longest = np.maximum.reduce([np.einsum("ij,ij->i", side, side) for side in (b - a, c - b, a - c)])
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) <= THIN * longest


def is_closed(triangles: np.ndarray) -> bool:
    """Every edge has two triangles, which run along it in opposite directions."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    there, count = np.unique(edges, axis=0, return_counts=True)
    back = np.unique(edges[:, ::-1], axis=0)
    return bool((count == 1).all()) and there.shape == back.shape and bool((there == back).all())


def outward(x: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The triangles of a closed mesh, turned so that they are counterclockwise seen from outside."""
    a, b, c = (x[triangles[:, k]] - x.mean(0) for k in range(3))
    return triangles if np.einsum("ij,ij->", a, np.cross(b, c)) >= 0 else triangles[:, ::-1]


def transformed(matrix: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The points after a 4 x 4 transform."""
    return x @ matrix[:3, :3].T + matrix[:3, 3]


def nearest_rotation(matrix: np.ndarray) -> np.ndarray:
    """The rotation nearest to a 3 x 3 matrix with positive determinant: its polar factor."""
    u, _, v = np.linalg.svd(matrix)
    return u @ v


def rigid_motion(matrices: np.ndarray) -> Optional[np.ndarray]:
    """Rotations (frames x 3 x 3) that lead from the first of these transforms (frames x 4 x 4) to each, or None if something else does."""
    first = np.linalg.inv(matrices[0, :3, :3])
    rotations = np.empty((len(matrices), 3, 3))
    for k, matrix in enumerate(matrices):
        linear = np.eye(3) if (matrix[:3, :3] == matrices[0, :3, :3]).all() else matrix[:3, :3] @ first
        if np.linalg.det(linear) <= 0:
            return None
        rotations[k] = nearest_rotation(linear) if (linear != np.eye(3)).any() else linear
        if np.abs(rotations[k] - linear).max() > RIGID:
            return None
    return rotations


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """[w, x, y, z] of a rotation, by its largest component (Shepperd 1978)."""
    m = rotation
    squares = np.array([1 + m[0, 0] + m[1, 1] + m[2, 2], 1 + m[0, 0] - m[1, 1] - m[2, 2], 1 - m[0, 0] + m[1, 1] - m[2, 2], 1 - m[0, 0] - m[1, 1] + m[2, 2]])
    a, b, c = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    d, e, f = m[1, 0] + m[0, 1], m[0, 2] + m[2, 0], m[2, 1] + m[1, 2]
    s = squares
    q = np.array([[s[0], a, b, c], [a, s[1], d, e], [b, d, s[2], f], [c, e, f, s[3]]][int(np.argmax(s))])
    return q / np.linalg.norm(q)


def axis_angle(rotation: np.ndarray) -> List[float]:
    """[x, y, z, angle in degrees] of a rotation."""
    q = quaternion(rotation)
    q = -q if q[0] < 0 else q
    length = float(np.linalg.norm(q[1:]))
    if length < 1e-12:
        return [1.0, 0.0, 0.0, 0.0]
    return [*(q[1:] / length).tolist(), float(np.degrees(2 * np.arctan2(length, q[0])))]
