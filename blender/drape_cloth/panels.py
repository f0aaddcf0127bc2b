"""The panels, in the physics tab of the properties editor."""
import os

import bpy

from . import export, operators, program
from .properties import BY_TOLERANCE


class Panel:
    bl_space_type, bl_region_type, bl_context = "PROPERTIES", "WINDOW", "physics"
    role = "CLOTH"

    @classmethod
    def poll(cls, context):
        thing = context.object
        return thing is not None and thing.type == "MESH" and thing.drape.role == cls.role

    def columns(self):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        return layout


class DRAPE_PT_drape(Panel, bpy.types.Panel):
    bl_idname, bl_label = "DRAPE_PT_drape", "Drape"

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type in export.SHAPES

    def draw(self, context):
        thing, layout = context.object, self.columns()
        row = self.layout.row()
        row.use_property_split = False
        for role in ("NONE", "CLOTH", "COLLIDER") if thing.type == "MESH" else ("NONE", "COLLIDER"):
            row.prop_enum(thing.drape, "role", role)
        if thing.drape.role == "COLLIDER":
            layout.prop(thing.drape, "shape")
            layout.prop(thing.drape, "friction")
            if thing.drape.shape == "MESH":
                layout.prop(thing.drape, "surface_thickness")
        elif thing.drape.role == "CLOTH":
            self.draw_bake(context, thing, layout)

    def draw_bake(self, context, thing, layout):
        run = operators.bake_of(thing)
        if run:
            bake = run.bake
            layout.label(text=f"Frame {bake.done()} of {bake.frames}", icon="TIME")
            layout.operator("drape.cancel", icon="X")
            return
        layout.prop(thing.drape, "simulated")
        if thing.drape.simulated:
            layout.prop(thing.drape, "simulated_distance")
        layout.prop(thing.drape, "quality")
        if thing.drape.quality == "CUSTOM":
            layout.prop(thing.drape, "method")
            layout.prop(thing.drape, "rtol" if thing.drape.method in BY_TOLERANCE else "steps")
        if thing.drape.quality == "ACCURATE":
            layout.prop(thing.drape, "accuracy")
        layout.prop(thing.drape, "folder")
        row = layout.row(align=True)
        row.operator("drape.bake", icon="PHYSICS")
        part = row.row(align=True)
        part.enabled = os.path.exists(os.path.join(operators.folder_of(thing), program.RUN, "checkpoint.drape"))
        part.operator("drape.resume", icon="PLAY")
        row.operator("drape.clear", text="", icon="TRASH")


class DRAPE_PT_material(Panel, bpy.types.Panel):
    bl_parent_id, bl_label = "DRAPE_PT_drape", "Fabric"

    def draw(self, context):
        settings, layout = context.object.drape, self.columns()
        layout.prop(settings, "fabric", icon="MATCLOTH")
        if settings.fabric:
            layout.prop(settings, "own_weight")
        else:
            layout.prop(settings, "young_modulus")
            layout.prop(settings, "poisson_ratio")
            layout.prop(settings, "thickness")
        if settings.own_weight or not settings.fabric:
            layout.prop(settings, "areal_density")
        layout.prop(settings, "warp", expand=True)
        layout.prop(settings, "damping")
        layout.prop(settings, "air")
        if settings.air:
            layout.prop(settings, "air_density")


class DRAPE_PT_contact(Panel, bpy.types.Panel):
    bl_parent_id, bl_label = "DRAPE_PT_drape", "Pins and Contact"

    def draw(self, context):
        thing, layout = context.object, self.columns()
        settings = thing.drape
        layout.prop_search(settings, "pin_group", settings.simulated or thing, "vertex_groups")
        if settings.pin_group:
            layout.prop(settings, "pin_threshold", slider=True)
        layout.prop(settings, "colliders")
        layout.prop(settings, "contact_distance")
        layout.prop(settings, "self_contact")
        if settings.self_contact:
            layout.prop(settings, "layer_distance")
            layout.prop(settings, "layer_friction")
        layout.prop(settings, "untangle")


CLASSES = (DRAPE_PT_drape, DRAPE_PT_material, DRAPE_PT_contact)
