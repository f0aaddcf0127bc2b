"""blender -b --python read_blender_faces.py -- FOLDER: whether frames have the quadrilaterals, texture coordinates and materials of tube.obj.

Prints "read_blender: good" at its end. Written for Blender 3.4.
"""
import sys

import bpy
import numpy as np

folder = sys.argv[sys.argv.index("--") + 1]


def mesh_of(import_file):
    """The mesh that a file has, alone in an empty scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    import_file()
    thing, = [thing for thing in bpy.context.scene.objects if thing.type == "MESH"]
    return thing.data


def faces(mesh):
    """Each face as its material and the texture coordinates of its corners, from the least on, to a thousandth."""
    found = []
    for face in mesh.polygons:
        uv = [tuple(np.round(mesh.uv_layers[0].data[i].uv, 3)) for i in face.loop_indices]
        first = uv.index(min(uv))
        found.append((mesh.materials[face.material_index].name, uv[first:] + uv[:first]))
    return sorted(found)


artist = faces(mesh_of(lambda: bpy.ops.wm.obj_import(filepath=folder + "/../tube.obj")))
assert len(artist) == 12 and {len(uv) for _, uv in artist} == {4}
assert {name for name, _ in artist} == {"light denim", "lining"}
for name in ("frame_000003.obj", "positions.obj"):
    mesh = mesh_of(lambda name=name: bpy.ops.wm.obj_import(filepath=folder + "/" + name))
    assert len(mesh.vertices) == 16 and faces(mesh) == artist, (name, faces(mesh))

# glTF has triangles; two of them are a quadrilateral
np.bool = bool  # the importer of Debian 12 uses it, and its numpy no longer has it
triangles = faces(mesh_of(lambda: bpy.ops.import_scene.gltf(filepath=folder + "/positions.glb")))
assert len(triangles) == 24, len(triangles)
corners = {(name, corner) for name, uv in artist for corner in uv}
assert {(name, corner) for name, uv in triangles for corner in uv} == corners
print("read_blender: good")
