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
    check("a bake in a window does not wait", bpy.ops.drape.bake("INVOKE_DEFAULT") == {"RUNNING_MODAL"} and cloth.name in operators.running)
    bake = operators.running[cloth.name]
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
    while operators.running[cloth.name].done() < done + 1:
        yield 0.1
    cloth.name = "Renamed"  # its frames are kept, for there is no such object any more
    operators.running["Grid"].cancel()
    while operators.running:
        yield 0.1
    bpy.ops.drape.bake("INVOKE_DEFAULT")
    bake = operators.running["Renamed"]
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
