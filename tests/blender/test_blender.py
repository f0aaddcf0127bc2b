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

BUILD, SOURCE = os.path.abspath(os.environ["DRAPE_BUILD"]), os.path.abspath(os.environ["DRAPE_SOURCE"])
LIMIT = 600  # [s]


def main():
    blender = shutil.which("blender")
    if not blender:
        print("1..0 # SKIP no Blender: apt-get install blender")
        return 0
    with tempfile.TemporaryDirectory() as folder:
        # Blender's Python looks for its library beside the first python3 on the path, which may be a different version.
        environment = {**os.environ, "PATH": BUILD + ":/usr/bin:/bin:" + os.environ.get("PATH", ""), "BLENDER_USER_RESOURCES": folder + "/blender",
                       "TAP": folder + "/tap", "HOME": folder, "ZIP": BUILD + "/blender/drape_cloth.zip"}
        result = subprocess.run([blender, "--background", "--factory-startup", "--python", os.path.dirname(os.path.abspath(__file__)) + "/inside.py"],
                                cwd=folder, env=environment, capture_output=True, text=True, errors="replace", timeout=LIMIT, check=False)
        if not os.path.exists(environment["TAP"]):
            print("1..1\nnot ok 1 - Blender runs the tests\n# " + (result.stdout + result.stderr).replace("\n", "\n# "))
            return 1
        with open(environment["TAP"], encoding="utf-8") as file:
            said = file.read()
        print(said, end="")
        print("# " + (result.stdout + result.stderr).rstrip().replace("\n", "\n# "))
        return int(result.returncode != 0 or "\nnot ok" in said)


sys.exit(main())
