"""Drape in Blender: a mesh as cloth, baked by the program `drape`, played by the modifier Mesh Cache. docs/blender.md explains its use.

    folder.py      the folder of a bake: whose it is, and which of its files may be replaced
    program.py     the program, a run of it, and its messages
    mesh.py        triangles, mesh files and rigid motions
    export.py      from a scene of Blender to a scene file of Drape
    cache.py       from the frames of a run to a point cache
    properties.py, operators.py, panels.py    what the user sees
"""
import bpy
from bpy.props import PointerProperty

from . import operators, panels, properties

bl_info = {
    "name": "Drape",
    "author": "the authors of Drape",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "Properties > Physics > Drape",
    "description": "Cloth of measured fabrics, from real time to exact, with contact that nothing passes through",
    "category": "Physics",
}

CLASSES = (*properties.CLASSES, *operators.CLASSES, *panels.CLASSES)


def register():
    for kind in CLASSES:
        bpy.utils.register_class(kind)
    for handlers, function in operators.HANDLERS:
        handlers.append(function)
    operators.after_load()
    bpy.types.Object.drape = PointerProperty(type=properties.DRAPE_object)


def unregister():
    for one in operators.running:
        one.bake.kill()
    operators.running.clear()
    for handlers, function in operators.HANDLERS:
        handlers.remove(function)
    del bpy.types.Object.drape
    for kind in reversed(CLASSES):
        bpy.utils.unregister_class(kind)
