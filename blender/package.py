#!/usr/bin/env python3
"""package.py ZIP: packs the add-on as Blender installs it, a zip with the folder drape_cloth. The same sources give the same bytes."""
import os
import sys
import zipfile

HERE = os.path.dirname(os.path.abspath(__file__))

with zipfile.ZipFile(sys.argv[1], "w", zipfile.ZIP_DEFLATED) as made:
    for path, name in [(os.path.join(HERE, "..", "LICENSE"), "LICENSE")] + sorted(
            (os.path.join(HERE, "drape_cloth", name), name) for name in os.listdir(os.path.join(HERE, "drape_cloth")) if name.endswith(".py")):
        entry = zipfile.ZipInfo("drape_cloth/" + name)
        entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
        with open(path, "rb") as file:
            made.writestr(entry, file.read())
