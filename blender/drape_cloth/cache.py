"""The point cache that Blender's modifier Mesh Cache reads, made from the frames of a run. Nothing here needs Blender."""
import os
import struct

import numpy as np

from .folder import Folder, Problem
from .program import RUN

CACHE = "cloth.pc2"
"""the point cache in the folder of a bake"""
MATRICES = "to_local.npy"
"""frames x 4 x 4: from the axes of the scene of Drape to those of the object, which may move, in each frame"""


def write(folder: Folder) -> int:
    """Writes CACHE from the frames so far, and returns their number. A cache that is there is replaced at once, since Blender may be reading it.

    The format is PC2, version 1, with float32 and little-endian numbers (Autodesk 3ds Max SDK, Point Cache). The run has positions in the world; the
    modifier needs those in the object's own axes, whatever its transform in that frame."""
    try:
        shown = os.path.join(folder.path, RUN, "render_positions.npy")  # of a mesh that follows the simulated one
        x = np.load(shown if os.path.exists(shown) else os.path.join(folder.path, RUN, "positions.npy"), mmap_mode="r")
        to_local = np.load(os.path.join(folder.path, MATRICES))
    except (OSError, ValueError) as error:
        raise Problem(f"there are no frames in {folder.path}: {error}") from error
    frames, nodes = min(len(x), len(to_local)), x.shape[1]
    with folder.part(CACHE) as file:
        file.write(struct.pack("<12siiffi", b"POINTCACHE2\0", 1, nodes, 0.0, 1.0, frames))
        for positions, matrix in zip(x[:frames], to_local):
            file.write((positions @ matrix[:3, :3].T + matrix[:3, 3]).astype("<f4").tobytes())
    folder.publish(CACHE)
    return frames
