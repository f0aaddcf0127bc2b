"""blender -b --python read_blender.py -- FOLDER: checks the mesh with its Mesh Cache at every frame, and the animation of the binary glTF.

Prints "read_blender: good" at its end. Written for Blender 3.4.
"""
import sys

import bpy
import numpy as np

folder = sys.argv[sys.argv.index("--") + 1]
x = np.load(folder + "/positions.npy")
RATE = 30  # frames per second of the run and of Blender's scene


def evaluated(thing):
    """The vertices of an object after its modifiers and shape keys, in the object's own axes."""
    mesh = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    found = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", found)
    return found.reshape(-1, 3)


def empty_scene():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = RATE
    bpy.context.scene.frame_start = 0


empty_scene()
bpy.ops.wm.obj_import(filepath=folder + "/positions.obj")
cloth, = bpy.context.scene.objects
assert len(cloth.data.vertices) == x.shape[1], len(cloth.data.vertices)
cache = cloth.modifiers.new("cache", "MESH_CACHE")
cache.cache_format = "PC2"
cache.filepath = folder + "/positions.pc2"
cache.frame_start = 0
for k in range(len(x)):
    bpy.context.scene.frame_set(k)
    assert (evaluated(cloth) == x[k].astype(np.float32)).all(), (k, np.abs(evaluated(cloth) - x[k]).max())

# The importer converts y up to z up. That of Debian 12 uses np.bool, which its numpy no longer has.
np.bool = bool
empty_scene()
bpy.ops.import_scene.gltf(filepath=folder + "/positions.glb")
cloth, = [thing for thing in bpy.context.scene.objects if thing.type == "MESH"]
assert len(cloth.data.vertices) == x.shape[1]
assert len(cloth.data.shape_keys.key_blocks) == len(x)
for k in range(len(x) - 1):  # the last one is between two of Blender's frames
    bpy.context.scene.frame_set(k)
    turned = np.stack([x[k][:, 0], -x[k][:, 2], x[k][:, 1]], axis=-1)
    # Rounding of base and displacement to float32, and of keys: times k / 30 in float32, times 30, are k to 1e-6 of a frame.
    error = np.abs(evaluated(cloth) - turned).max()
    assert error < 1e-5 * np.abs(x).max(), (k, error)
print("read_blender: good")
