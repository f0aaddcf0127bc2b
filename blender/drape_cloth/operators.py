"""Baking, resuming, cancelling and clearing, as operators of Blender."""
import contextlib
import os
from typing import List, Optional

import bpy
from bpy.app.handlers import persistent

from . import cache, export, program
from .folder import Folder, Owner, Problem, file_name, one_line
from .properties import addon_preferences, find_program


class Running:
    """A bake in progress, and its cloth, which may be renamed or deleted meanwhile."""

    def __init__(self, thing, bake: program.Bake, frame_start: int):
        self.bake, self.frame_start = bake, frame_start
        self.first_name = self.name = thing.name
        self._thing = thing

    def thing(self):
        """The cloth, or None if it is in no scene any more."""
        try:
            self.name = self._thing.name
            return self._thing if self._thing.users_scene else None
        except ReferenceError:
            return None

    def find(self) -> None:
        """After an undo, which may have made the object anew."""
        found = (bpy.data.objects.get(name) for name in (self.name, self.first_name))
        self._thing = next((thing for thing in found if thing and thing.type == "MESH" and thing.drape.role == "CLOTH"), self._thing)


running: List[Running] = []
"""bakes in progress"""


def bake_of(thing) -> Optional[Running]:
    """The bake of this object that is in progress."""
    return next((one for one in running if one.thing() == thing), None) if thing else None


@persistent
def before_undo(*_) -> None:
    """The names by which the objects are found again."""
    for one in running:
        one.thing()


@persistent
def after_undo(*_) -> None:
    for one in running:
        if one.thing() is None:
            one.find()


_file = 0  # that is open, by number


@persistent
def after_load(*_) -> None:
    """Another file is open: the bakes of the one before, if it was never saved, are not its own."""
    global _file  # pylint: disable=global-statement
    _file += 1


HANDLERS = [(bpy.app.handlers.load_post, after_load), (bpy.app.handlers.undo_pre, before_undo), (bpy.app.handlers.redo_pre, before_undo),
            (bpy.app.handlers.undo_post, after_undo), (bpy.app.handlers.redo_post, after_undo)]


def unsaved_folder() -> str:
    """The folder of the bakes of a file that was not saved yet. Blender removes it when it ends."""
    return os.path.join(bpy.app.tempdir, f"unsaved_{_file}")


def folder_of(thing) -> str:
    """Where the bake of a cloth is kept."""
    named = thing.drape.folder
    if not named:
        named = "//drape_" + file_name(thing.name)
    if named.startswith("//") and not bpy.data.filepath:
        return os.path.join(unsaved_folder(), named[2:])
    return os.path.abspath(bpy.path.abspath(named))  # a file that a script opened may have a relative path


def owner_of(thing) -> Owner:
    """The cloth as the owner of its bake."""
    others = (other.drape.bake_id for other in bpy.data.objects if other != thing and not other.library)
    return Owner(bpy.data.filepath or unsaved_folder(), thing.name, thing.drape.bake_id, frozenset(others) - {""})


def check_modifiers(thing) -> None:
    """Raises a Problem if the modifier could not be set after the bake."""
    if thing.library:
        raise Problem(f"{thing.name}: is linked from {thing.library.filepath}, so its modifiers cannot be changed here: make it local, or a library override")
    if export.modifier_of(thing) is None and any(modifier.is_override_data for modifier in list(thing.modifiers)[export.before_cloth(thing):]):
        raise Problem(f"{thing.name}: has modifiers from its library, which a bake cannot be put before: make the object local")


def attach(context, thing, folder: str, frame_start: int) -> None:
    """Sets the modifier that moves the mesh, behind those that deform it before the cloth does. The mesh itself stays as it is."""
    modifier = export.modifier_of(thing)
    if modifier is None:
        at = export.before_cloth(thing)
        name = thing.modifiers.new(export.MODIFIER, "MESH_CACHE").name
        with context.temp_override(object=thing):
            bpy.ops.object.modifier_move_to_index(modifier=name, index=at)
        modifier = thing.modifiers[name]
    path = os.path.join(folder, cache.CACHE)
    modifier.cache_format = "PC2"
    modifier.filepath = bpy.path.relpath(path) if bpy.data.filepath else path
    modifier.frame_start = frame_start
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
    bake, interrupted = None, False

    @classmethod
    def poll(cls, context):
        thing = context.object
        return thing is not None and thing.type == "MESH" and thing.mode == "OBJECT" and thing.drape.role == "CLOTH" and not bake_of(thing)

    def start(self, context) -> None:
        """Starts the program; raises a Problem."""
        thing, folder = context.object, folder_of(context.object)
        preferences = addon_preferences()
        path = find_program()
        check_modifiers(thing)
        for one in list(running):
            if os.path.realpath(one.bake.folder.path) == os.path.realpath(folder):
                if one.thing() is None:
                    running.remove(one)
                    one.bake.cancel()
                    one.bake.wait()
                    one.bake.close()
                    continue
                raise Problem(f"{thing.name}: {one.name} is being baked into the same folder, {folder}: cancel that bake, or choose another folder")
        for other in bpy.data.objects:
            if other != thing and other.type == "MESH" and not other.library and other.drape.role == "CLOTH" and folder_of(other) == folder:
                raise Problem(f"{thing.name}: {other.name} has the same folder, {folder}: choose another one")
        with contextlib.ExitStack() as after_failure:
            owned = after_failure.enter_context(Folder(folder, owner_of(thing)))
            after_failure.callback(self.say_aside, thing.name, owned)
            self.prepare(context, thing, owned)
            thing.drape.bake_id = owned.id
            frames, self.names = program.read(folder, thing.drape.simulated.name if thing.drape.simulated else None)
            self.bake = program.Bake(path, owned, frames, self.resume, preferences.threads)
            after_failure.pop_all()  # `end` closes the folder
        self.run = Running(thing, self.bake, context.scene.frame_start)
        running.append(self.run)

    def say(self, kind: str, text: str) -> None:
        self.report({kind}, one_line(text))

    def say_aside(self, name: str, folder: Folder) -> None:
        """Reports the files of the user that got another name."""
        for text in folder.aside:
            self.say("WARNING", f"{name}: {text}")

    def end(self, context) -> set:
        """After the end of the process: the frames so far are shown, whatever ended it."""
        running.remove(self.run)
        thing, name, folder = self.run.thing(), self.run.name, self.bake.folder
        done, failed = self.bake.done(), None
        try:
            failed = self.bake.result(self.names)
            for text in self.bake.warnings(self.names):
                self.say("WARNING", text)
            if thing and folder_of(thing) != folder.path and name != self.run.first_name:
                thing.drape.folder = "//drape_" + file_name(self.run.first_name)  # where Resume finds it
                folder.rename(name)
            if done and thing:
                cache.write(folder)
                attach(context, thing, folder.path, self.run.frame_start)
        except (Problem, OSError, RuntimeError) as problem:
            failed = failed or f"{name}: {problem}"
        try:
            self.bake.close()
        except OSError as problem:
            failed = failed or f"{name}: {problem}"
        self.say_aside(name, folder)
        if self.interrupted and not failed:
            failed = f"{name}: interrupted after {done} of {self.bake.frames} frames; Resume continues"
        if failed:
            self.say("ERROR", failed)
            return {"CANCELLED"}
        if not thing:
            self.say("WARNING", f"{name}: there is no such object any more; {done} of {self.bake.frames} frames of its bake are in {folder.path}")
        elif self.bake.cancelled:
            self.say("INFO", f"{name}: cancelled after {done} of {self.bake.frames} frames; Resume continues")
        else:
            self.say("INFO", f"{name}: {done} frames")
        return {"FINISHED"}

    def interrupt(self) -> None:
        """Ctrl-C in the terminal. It also reaches the program there, but not if only Blender is sent the signal."""
        self.interrupted = True
        if self.bake:
            self.bake.cancel()

    def execute(self, context):
        with program.interrupts(self.interrupt):
            try:
                self.start(context)
            except (Problem, OSError) as problem:
                self.say("ERROR", str(problem))
                return {"CANCELLED"}
            if self.interrupted:
                self.bake.cancel()
            try:
                self.bake.wait()
            except Problem:  # it could not start again
                pass
        return self.end(context)

    def invoke(self, context, _event):
        if bpy.app.background:
            return self.execute(context)
        try:
            self.start(context)
        except (Problem, OSError) as problem:
            self.say("ERROR", str(problem))
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
        if self.run not in running:  # another cloth has the folder
            context.window_manager.event_timer_remove(self.timer)
            return {"CANCELLED"}
        if self.run.thing() is None:
            self.bake.cancel()  # nobody could, as the panel is that of the object
        try:
            if self.bake.running():
                return {"PASS_THROUGH"}
        except Problem:  # it could not start again
            pass
        context.window_manager.event_timer_remove(self.timer)
        return self.end(context)

    def cancel(self, context):
        """Blender is being closed, or another file opened."""
        if self.run in running:
            running.remove(self.run)
        self.bake.kill()
        context.window_manager.event_timer_remove(self.timer)


class DRAPE_OT_bake(Baking, bpy.types.Operator):
    bl_idname = "drape.bake"
    bl_label = "Bake"
    bl_description = "Simulate the cloth over the frames of the scene, and play the result on the mesh"
    resume = False

    def prepare(self, context, thing, folder: Folder) -> None:
        for text in export.export(context, thing, folder):
            self.say("WARNING", text)


class DRAPE_OT_resume(Baking, bpy.types.Operator):
    bl_idname = "drape.resume"
    bl_label = "Resume"
    bl_description = "Continue a bake that was cancelled, with the scene as it was then; the result is that of a bake without interruption"
    resume = True

    def prepare(self, context, thing, folder: Folder) -> None:
        if not folder.taken:
            raise Problem(f"{thing.name}: there is no bake in {folder.path}")
        folder.take()


class DRAPE_OT_cancel(bpy.types.Operator):
    bl_idname = "drape.cancel"
    bl_label = "Cancel"
    bl_description = "Stop after the step in progress. The frames so far are kept, and Resume continues"

    @classmethod
    def poll(cls, context):
        return bake_of(context.object) is not None

    def execute(self, context):
        bake_of(context.object).bake.cancel()
        return {"FINISHED"}


class DRAPE_OT_clear(bpy.types.Operator):
    bl_idname = "drape.clear"
    bl_label = "Clear"
    bl_description = "Remove the modifier. The files of the bake stay in their folder"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        thing = context.object
        return thing is not None and export.modifier_of(thing) is not None and not bake_of(thing)

    def execute(self, context):
        context.object.modifiers.remove(export.modifier_of(context.object))
        return {"FINISHED"}


CLASSES: List[type] = [DRAPE_OT_bake, DRAPE_OT_resume, DRAPE_OT_cancel, DRAPE_OT_clear]
