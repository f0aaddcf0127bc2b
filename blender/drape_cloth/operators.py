"""Baking, resuming, cancelling and clearing, as operators of Blender."""
import os
from typing import Dict, List

import bpy

from . import cache, export, program
from .properties import addon_preferences, find_program

running: Dict[str, program.Bake] = {}
"""bakes in progress, by the name of their object"""


def folder_of(thing) -> str:
    """Where the bake of a cloth is kept. A file that was not saved yet has its bakes in a temporary folder, which is removed with it."""
    named = thing.drape.folder
    if not named:
        named = "//drape_" + bpy.path.clean_name(thing.name)
    if named.startswith("//") and not bpy.data.filepath:
        return os.path.join(bpy.app.tempdir, named[2:])
    return os.path.normpath(bpy.path.abspath(named))


def attach(context, thing, folder: str, frames: int) -> None:
    """Sets the modifier that moves the mesh, behind those that deform it before the cloth does. The mesh itself stays as it is."""
    modifier = thing.modifiers.get(export.MODIFIER)
    if modifier is None or modifier.type != "MESH_CACHE":
        at = export.before_cloth(thing)
        modifier = thing.modifiers.new(export.MODIFIER, "MESH_CACHE")
        with context.temp_override(object=thing):
            bpy.ops.object.modifier_move_to_index(modifier=modifier.name, index=at)
        modifier = thing.modifiers[export.MODIFIER]
    path = os.path.join(folder, cache.CACHE)
    modifier.cache_format = "PC2"
    modifier.filepath = bpy.path.relpath(path) if bpy.data.filepath else path
    modifier.frame_start = context.scene.frame_start
    modifier.frame_scale = 1
    modifier.time_mode, modifier.play_mode, modifier.interpolation, modifier.deform_mode = "FRAME", "SCENE", "LINEAR", "OVERWRITE"
    modifier.forward_axis, modifier.up_axis, modifier.flip_axis = "POS_Y", "POS_Z", set()
    modifier.show_viewport = modifier.show_render = True
    thing.update_tag()
    context.scene.frame_set(context.scene.frame_current)


class Baking:
    """What baking and resuming share: from the start of the program to the cache. Scripts and Blender without a window wait for the end; in a window
    a timer looks after the process, and one may work on meanwhile."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        thing = context.object
        return thing is not None and thing.type == "MESH" and thing.mode == "OBJECT" and thing.drape.role == "CLOTH" and thing.name not in running

    def start(self, context) -> None:
        """Starts the program; raises a Problem."""
        thing = context.object
        self.cloth, self.folder = thing.name, folder_of(thing)
        self.simulated = thing.drape.simulated.name if thing.drape.simulated else None
        preferences = addon_preferences()
        path = find_program()
        for other in bpy.data.objects:
            if other != thing and other.type == "MESH" and other.drape.role == "CLOTH" and folder_of(other) == self.folder:
                raise program.Problem(f"{thing.name}: {other.name} has the same folder, {self.folder}: choose another one")
        frames, warnings = self.scene(context, thing, self.folder)
        for text in warnings:
            self.report({"WARNING"}, f"{thing.name}: {text}")
        self.bake = running[self.cloth] = program.Bake(path, self.folder, frames, self.resume, preferences.threads)

    def end(self, context) -> set:
        """After the end of the process: the frames so far are shown, whatever ended it."""
        del running[self.cloth]
        thing = context.scene.objects.get(self.cloth)
        done, failed = self.bake.done(), None
        try:
            names = program.Names.of(program.read_scene(self.folder), self.simulated)
            failed = self.bake.result(names)
            for text in self.bake.warnings(names):
                self.report({"WARNING"}, text)
            if done and thing:
                attach(context, thing, self.folder, cache.write(self.folder))
        except (program.Problem, OSError) as problem:
            failed = failed or str(problem)
        if failed:
            self.report({"ERROR"}, failed)
            return {"CANCELLED"}
        if not thing:
            self.report({"WARNING"}, f"{self.cloth}: there is no such object any more; its bake is in {self.folder}")
        elif self.bake.cancelled:
            self.report({"INFO"}, f"{self.cloth}: cancelled after {done} of {self.bake.frames} frames; Resume continues")
        else:
            self.report({"INFO"}, f"{self.cloth}: {done} frames")
        return {"FINISHED"}

    def execute(self, context):
        try:
            self.start(context)
        except (program.Problem, OSError) as problem:
            self.report({"ERROR"}, str(problem))
            return {"CANCELLED"}
        try:
            self.bake.wait()
        except KeyboardInterrupt:
            self.bake.cancel()
            self.bake.wait()
        return self.end(context)

    def invoke(self, context, _event):
        if bpy.app.background:
            return self.execute(context)
        try:
            self.start(context)
        except (program.Problem, OSError) as problem:
            self.report({"ERROR"}, str(problem))
            return {"CANCELLED"}
        self.shown = -1
        self.timer = context.window_manager.event_timer_add(0.25, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self.shown != self.bake.done():
            self.shown = self.bake.done()
            for window in context.window_manager.windows:
                for area in window.screen.areas:
                    if area.type == "PROPERTIES":
                        area.tag_redraw()
        if self.bake.running():
            return {"PASS_THROUGH"}
        context.window_manager.event_timer_remove(self.timer)
        return self.end(context)

    def cancel(self, context):
        """Blender is being closed, or another file opened."""
        running.pop(self.cloth, None)
        self.bake.kill()
        context.window_manager.event_timer_remove(self.timer)


class DRAPE_OT_bake(Baking, bpy.types.Operator):
    bl_idname = "drape.bake"
    bl_label = "Bake"
    bl_description = "Simulate the cloth over the frames of the scene, and play the result on the mesh"
    resume = False

    def scene(self, context, thing, folder: str) -> export.Exported:
        return export.export(context, thing, folder)


class DRAPE_OT_resume(Baking, bpy.types.Operator):
    bl_idname = "drape.resume"
    bl_label = "Resume"
    bl_description = "Continue a bake that was cancelled, with the scene as it was then; the result is that of a bake without interruption"
    resume = True

    def scene(self, context, thing, folder: str) -> export.Exported:
        made = program.read_scene(folder)
        return export.Exported(1 + round(made["duration"] * made["frame_rate"]), [])


class DRAPE_OT_cancel(bpy.types.Operator):
    bl_idname = "drape.cancel"
    bl_label = "Cancel"
    bl_description = "Stop after the step in progress. The frames so far are kept, and Resume continues"

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.name in running

    def execute(self, context):
        running[context.object.name].cancel()
        return {"FINISHED"}


class DRAPE_OT_clear(bpy.types.Operator):
    bl_idname = "drape.clear"
    bl_label = "Clear"
    bl_description = "Remove the modifier. The files of the bake stay in their folder"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        thing = context.object
        return thing is not None and export.MODIFIER in thing.modifiers and thing.name not in running

    def execute(self, context):
        context.object.modifiers.remove(context.object.modifiers[export.MODIFIER])
        return {"FINISHED"}


CLASSES: List[type] = [DRAPE_OT_bake, DRAPE_OT_resume, DRAPE_OT_cancel, DRAPE_OT_clear]
