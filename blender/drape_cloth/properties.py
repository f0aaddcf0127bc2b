"""What the user sets: on an object, and in the preferences of the add-on."""
import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from . import program

ROLES = [("NONE", "None", "Not part of a cloth simulation"),
         ("CLOTH", "Cloth", "The mesh is a piece of cloth; it is baked by itself, and falls onto the colliders"),
         ("COLLIDER", "Collider", "Cloth does not pass through this object, which may move and deform")]

QUALITIES = [("REALTIME", "Real Time", "newton_k, at least 60 steps a second: backward Euler by few iterations, checked but not converged. For previews"),
             ("DRAFT", "Draft", "Backward Euler, one step a frame: converged steps, motion much damped"),
             ("STANDARD", "Standard", "Backward Euler, at least 60 steps a second"),
             ("FINE", "Fine", "trbdf2, at least 120 steps a second: second order, the motion is not damped by the method"),
             ("EXACT", "Exact", "ida with rtol 1e-4: the step follows the error. Slow where cloth meets things"),
             ("ACCURATE", "By Accuracy", "Run again until the motion is as near as asked: method and steps are chosen. Cannot be resumed"),
             ("CUSTOM", "Custom", "Any method, with its steps or its tolerance")]

METHODS = [("be", "Backward Euler", "First order, robust"), ("bdf2", "BDF2", "Second order, two steps"), ("trbdf2", "TR-BDF2", "Second order, in one step"),
           ("midpoint", "Midpoint", "Second order, no damping: for soft cloth without contact"),
           ("newton_k", "Newton K", "Backward Euler by few iterations, for real time"), ("verlet", "Verlet", "Explicit; only for soft cloth, and with its own rules of contact"),
           ("ida", "IDA", "Variable order and step, by the tolerance"),
           ("dirk", "DIRK", "Runge-Kutta of order 3 or 5, step by the tolerance"), ("rosenbrock", "Rosenbrock", "Order 4, step by the tolerance"),
           ("radau", "Radau", "Order 5, step by the tolerance")]

BY_TOLERANCE = {"ida", "dirk", "rosenbrock", "radau"}
"""methods that choose their own steps"""


def addon_preferences():
    return bpy.context.preferences.addons[__package__].preferences


def find_program() -> str:
    return program.find(bpy.path.abspath(addon_preferences().program))


def search_fabrics(_self, _context, text):
    """Names with their descriptions that contain the text."""
    try:
        found = program.fabrics(find_program())
    except program.Problem:
        return []
    return [(name, about) for name, about in found if text.lower() in (name + " " + about).lower()]


class DRAPE_preferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    program: StringProperty(name="Program", subtype="FILE_PATH", description="The program drape; if this is empty, the first one of the PATH")
    threads: IntProperty(name="Threads", default=1, min=1, max=256, description="Threads of a bake. The result does not depend on them")

    def draw(self, _context):
        self.layout.prop(self, "program")
        self.layout.prop(self, "threads")
        try:
            self.layout.label(text="Found: " + find_program(), icon="CHECKMARK")
        except program.Problem as problem:
            self.layout.label(text=str(problem), icon="ERROR")


class DRAPE_object(bpy.types.PropertyGroup):
    role: EnumProperty(name="Role", items=ROLES, default="NONE", description="What the object is for Drape")

    # The material of a cloth
    fabric: StringProperty(name="Fabric", search=search_fabrics, description="A measured fabric; empty: a sheet with the values below")
    young_modulus: FloatProperty(name="Stiffness", default=1e5, min=1, max=1e12, description="Young's modulus of the sheet [Pa]")
    poisson_ratio: FloatProperty(name="Poisson's Ratio", default=0.3, min=-0.9, max=0.5, description="Contraction across a pull")
    thickness: FloatProperty(name="Thickness", default=0.001, min=1e-6, soft_max=0.01, max=1, precision=5, step=0.01,
                             description="Thickness of the sheet [m]: it bends with its third power")
    own_weight: BoolProperty(name="Own Weight", description="The weight below instead of that of the fabric")
    areal_density: FloatProperty(name="Weight", default=0.2, min=1e-4, soft_max=2, max=1e4, precision=3, description="Mass per area [kg/m2]")
    warp: EnumProperty(name="Warp", items=[(axis, axis, f"Along the {axis} axis of the object") for axis in "XYZ"], default="X",
                       description="Direction of the warp of a woven fabric, in the axes of the object")
    damping: FloatProperty(name="Damping", default=0.001, min=0, soft_max=0.1, max=100, precision=4, step=0.1,
                           description="Inner damping [s]: damping stiffness over elastic stiffness")
    air: BoolProperty(name="Air", default=True, description="Drag of the air, and the wind of the force fields of the type Wind: their strength is a speed [m/s] along their z axis")
    air_density: FloatProperty(name="Density", default=1.225, min=0, max=1e4, precision=3, description="Density of the air [kg/m3]")

    # What is simulated in place of the mesh of a cloth
    simulated: PointerProperty(type=bpy.types.Object, name="Simulated Mesh", poll=lambda self, other: other.type == "MESH" and other != self.id_data,
                               description="A coarser mesh at the same place that is simulated; this one follows it. Empty: this mesh itself. Pins are vertices of the "
                               "simulated mesh")
    simulated_distance: FloatProperty(name="Max Distance", default=0, min=0, soft_max=0.1, max=1e6, precision=4, step=0.1,
                                      description="Largest distance of a vertex from the simulated mesh [m]; 0: the mean length of its edges")

    # Pins and contact of a cloth
    pin_group: StringProperty(name="Pins", description="Vertices of this group are held, or move with the object, its armature and its shape keys")
    pin_threshold: FloatProperty(name="From Weight", default=0.5, min=0, max=1, description="Vertices with at least this weight in the group are pins")
    colliders: PointerProperty(type=bpy.types.Collection, name="Colliders", description="Only colliders of this collection; empty: all of the scene")
    contact_distance: FloatProperty(name="Distance", default=0.005, min=0, soft_max=0.05, max=10, precision=4, step=0.1,
                                    description="Distance at which cloth comes to lie on colliders [m]; 0: the thickness of the cloth. Small ones take longer")
    self_contact: BoolProperty(name="Self-Contact", default=True, description="Cloth does not pass through itself")
    layer_distance: FloatProperty(name="Distance", default=0.004, min=1e-6, soft_max=0.05, max=10, precision=4, step=0.1, description="Distance of layers of cloth from each other [m]")
    layer_friction: FloatProperty(name="Friction", default=0.3, min=0, soft_max=1, max=1000, description="Coefficient of friction of cloth on cloth")
    untangle: BoolProperty(name="Untangle", description="Cloth that begins through itself or through colliders is taken apart before the first frame")

    # The bake of a cloth
    quality: EnumProperty(name="Quality", items=QUALITIES, default="STANDARD", description="How the motion is computed, from real time to exact")
    method: EnumProperty(name="Method", items=METHODS, default="be", description="Time integrator")
    steps: IntProperty(name="Steps per Frame", default=3, min=1, max=10000, description="Nominal steps in each frame; a step that fails is made again in smaller ones")
    rtol: FloatProperty(name="Tolerance", default=1e-3, min=1e-10, max=0.1, precision=6, description="Local error of a step, relative to the size of the scene")
    accuracy: FloatProperty(name="Accuracy", default=0.01, min=1e-6, soft_max=0.1, max=1e3, precision=4, step=0.1,
                            description="How far the cloth may be from the motion of its model [m], root mean square over its vertices in any frame")
    bake_id: StringProperty(options={"HIDDEN"}, description="Random, from the first bake on: folders of bakes know their cloth by it")
    folder: StringProperty(name="Folder", subtype="DIR_PATH", description="Folder of the bake; empty: drape_ and the name of the object, beside the file")

    # A collider
    shape: EnumProperty(name="Shape", default="MESH", description="What cloth meets", items=[
        ("MESH", "Mesh", "The surface of the object with its modifiers; it may deform"), ("BOX", "Box", "The bounding box of the object"),
        ("SPHERE", "Sphere", "The ball that the object's bounding box encloses"), ("PLANE", "Plane", "Everything below the plane z = 0 of the object, without bounds")])
    friction: FloatProperty(name="Friction", default=0.3, min=0, soft_max=1, max=1000, description="Coefficient of friction of cloth on this object")
    surface_thickness: FloatProperty(name="Thickness", default=0, min=0, soft_max=0.05, max=1000, precision=4, step=0.1,
                                     description="Distance of the surface that cloth meets from the faces of an open or deforming mesh [m]")


CLASSES = (DRAPE_preferences, DRAPE_object)
