#!/usr/bin/env python3
"""The add-on, in Blender without a window: installed from its zip, it bakes small scenes. Output is TAP.

DRAPE_BUILD is the build folder, DRAPE_SOURCE the source folder. The tests themselves are in inside.py, which Blender runs. Without Blender they are
skipped, and say how to get it.
"""
import os
import shutil
import subprocess
import sys
import tempfile
import time

BUILD, SOURCE = os.path.abspath(os.environ["DRAPE_BUILD"]), os.path.abspath(os.environ["DRAPE_SOURCE"])
LIMIT = 600  # [s]


HERE = os.path.dirname(os.path.abspath(__file__))


def window(blender, folder, environment):
    """A bake in Blender's window: the reason why it was not tried, and what is wrong."""
    if not shutil.which("xvfb-run"):
        return "no Xvfb: apt-get install xvfb libgl1-mesa-dri", ""
    result = subprocess.run(["xvfb-run", "-a", "-s", "-screen 0 640x480x24", blender, "--factory-startup", "--window-geometry", "0", "0", "640", "480", "--python",
                             HERE + "/window.py"], cwd=folder, env={**environment, "LIBGL_ALWAYS_SOFTWARE": "1", "RESULT": folder + "/result"}, capture_output=True,
                            text=True, errors="replace", timeout=LIMIT, check=False)
    said = result.stdout + result.stderr
    if not os.path.exists(folder + "/result"):
        return ("no OpenGL 3.3: apt-get install libgl1-mesa-dri", "") if "OpenGL" in said else ("", said)
    with open(folder + "/result", encoding="utf-8") as file:
        pid = int(file.read().split()[1])
    end = time.monotonic() + 60
    while os.path.exists(f"/proc/{pid}/exe") and time.monotonic() < end:  # gone, or a process that has ended
        time.sleep(0.05)
    return "", said + "\nthe program still runs" if os.path.exists(f"/proc/{pid}/exe") else ""


def main():
    blender = shutil.which("blender")
    if not blender:
        print("1..0 # SKIP no Blender: apt-get install blender")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        # Blender's Python looks for its library beside the first python3 on the path, which may be a different version.
        environment = {**os.environ, "PATH": BUILD + ":/usr/bin:/bin:" + os.environ.get("PATH", ""), "BLENDER_USER_RESOURCES": folder + "/blender",
                       "TAP": folder + "/tap", "HOME": folder, "ZIP": BUILD + "/blender/drape_cloth.zip"}
        result = subprocess.run([blender, "--background", "--factory-startup", "--python", HERE + "/inside.py"],
                                cwd=folder, env=environment, capture_output=True, text=True, errors="replace", timeout=LIMIT, check=False)
        said = result.stdout + result.stderr
        if os.path.exists(environment["TAP"]):
            with open(environment["TAP"], encoding="utf-8") as file:
                tap = file.read()
        else:
            tap = "1..1\nnot ok 1 - Blender runs the tests\n"
        count = int(tap[3:].split()[0]) + 1
        skipped, wrong = window(blender, folder, environment)
        print(tap.replace(f"1..{count - 1}", f"1..{count}", 1), end="")
        print("not ok" if wrong else "ok", count, "- in a window a bake goes on in the background: progress, cancel, resume, and it ends with Blender", "# SKIP " + skipped if skipped else "")
        print("# " + (said + wrong).rstrip().replace("\n", "\n# "))
        return int(result.returncode != 0 or "\nnot ok" in tap or bool(wrong))


sys.exit(main())
