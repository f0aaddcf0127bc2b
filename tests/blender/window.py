"""A bake in Blender's window, which goes on meanwhile: test_blender.py starts this on a display without a screen. Writes "good" into the file RESULT."""
import importlib
import os
import sys
import traceback

import bpy

FRAMES = 40


def check(says, good):
    assert good, says


def walk():
    """What a user does, and what must be seen; yields the seconds until the next step."""
    bpy.ops.preferences.addon_install(filepath=os.environ["ZIP"])
    bpy.ops.preferences.addon_enable(module="drape_cloth")
    operators = importlib.import_module("drape_cloth.operators")
    for area in bpy.context.window.screen.areas:  # drawing the scene in software takes seconds, the panels do not
        if area.type == "VIEW_3D":
            area.type = "TEXT_EDITOR"
    bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath("window.blend"))
    scene = bpy.context.scene
    scene.frame_end = FRAMES
    table = bpy.data.objects["Cube"]
    table.drape.role, table.drape.shape = "COLLIDER", "BOX"
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=14, y_subdivisions=14, size=3, location=(0, 0, 1.05))
    cloth = bpy.context.object
    cloth.drape.role = "CLOTH"
    for area in bpy.context.window.screen.areas:
        if area.type == "PROPERTIES":
            area.spaces.active.context = "PHYSICS"  # all panels are drawn
    yield 0.5
    check("a bake in a window does not wait", bpy.ops.drape.bake("INVOKE_DEFAULT") == {"RUNNING_MODAL"})
    bake = operators.bake_of(cloth).bake
    check("only Cancel can be pressed", bpy.ops.drape.cancel.poll() and not bpy.ops.drape.bake.poll() and not bpy.ops.drape.resume.poll())
    while bake.done() < 2:
        yield 0.1
    scene.frame_set(3)  # one may work on
    bpy.ops.drape.cancel()
    while operators.running:
        yield 0.1
    done = bake.done()
    check(f"{done} frames", 2 <= done < FRAMES and "Drape" in cloth.modifiers)
    check("the bake can be resumed", bpy.ops.drape.resume("INVOKE_DEFAULT") == {"RUNNING_MODAL"})
    while operators.running[0].bake.done() < done + 1:
        yield 0.1
    bpy.ops.ed.undo_push(message="before")
    cloth.name = "Renamed"
    bpy.ops.ed.undo_push(message="renamed")
    scene.frame_set(2)
    bpy.ops.ed.undo_push(message="moved")
    bpy.ops.ed.undo()  # makes new objects
    cloth, scene = bpy.data.objects["Renamed"], bpy.context.scene
    check("a renamed object can be cancelled, and not baked again", bpy.ops.drape.cancel.poll() and not bpy.ops.drape.bake.poll())
    bpy.ops.drape.cancel()
    while operators.running:
        yield 0.1
    check("its bake remains its own", operators.folder_of(cloth).endswith("/drape_Grid") and "drape_Grid" in cloth.modifiers["Drape"].filepath)
    for pause in 2, 0:  # with or without time in which the deletion is noticed
        bpy.ops.drape.bake("INVOKE_DEFAULT")
        bake = operators.bake_of(cloth).bake
        while bake.done() < 1:
            yield 0.1
        bpy.data.objects.remove(cloth)
        if pause:
            yield pause
            check("the bake of a deleted object is cancelled", not operators.running and bake.cancelled)
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=13, y_subdivisions=14, size=3, location=(0, 0, 1.05))
        cloth = bpy.context.object
        cloth.name, cloth.drape.role, cloth.drape.folder = "Renamed", "CLOTH", "//drape_Grid"
    bpy.ops.drape.bake("INVOKE_DEFAULT")
    check("one of the same name can be baked", len(operators.running) == 1 and not bake.running())
    bake = operators.bake_of(cloth).bake
    while bake.done() < 1:
        yield 0.1
    with open(os.environ["RESULT"], "w", encoding="utf-8") as file:
        file.write(f"good {bake._process.pid}")
    bpy.ops.wm.quit_blender()  # ends the program, too


def step():
    try:
        return next(steps)
    except StopIteration:
        return None
    except BaseException:  # pylint: disable=broad-except
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)


bpy.context.preferences.view.show_splash = False
steps = walk()
bpy.app.timers.register(step, first_interval=1)
