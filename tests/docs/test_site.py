#!/usr/bin/env python3
"""test_site.py: the site that tools/site makes: doxygen prints no warnings, no link is dead, all pages and functions are there. See
tests/cli/program.py."""
import glob
import html
import os
import re
import shutil
import subprocess
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "cli"))
from program import SOURCES, Skip, run_tests, text_of, write_text  # noqa: E402  pylint: disable=wrong-import-position


def site(sources):
    """Makes the site in ./site. Returns the output."""
    if not shutil.which("doxygen"):
        raise Skip("no doxygen")
    return subprocess.run([sources + "/tools/site", os.path.abspath("site")], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)


def pages():
    found = {}
    for path in glob.glob("site/*.html"):
        with open(path, encoding="utf-8") as file:
            found[os.path.basename(path)] = file.read()
    return found


def dead_links(found):
    names = {name: set(re.findall(r'(?:id|name)="([^"]+)"', text)) for name, text in found.items()}
    for name, text in found.items():
        for target in re.findall(r'<(?:a|img)\b[^>]*?(?:href|src)="([^"]*)"', text):
            path, _, anchor = html.unescape(target).partition("#")
            if re.match(r"https?:|javascript:|mailto:", target) or target == "#":
                continue
            whole = path or name
            if not os.path.exists("site/" + whole):
                yield f"{name}: {target}: there is no such file"
            elif anchor and whole in names and anchor not in names[whole]:
                yield f"{name}: {target}: there is no such place"


def test_site():
    """everything is documented, every page, function and status is on the site, and no link is dead"""
    made = site(SOURCES)
    assert made.returncode == 0, made.stdout
    assert not re.search(r"warning|error", made.stdout), made.stdout
    found = pages()
    text = "".join(found.values())
    for page in glob.glob(SOURCES + "/docs/*.md"):
        with open(page, encoding="utf-8") as file:
            title = re.search(r"^# (.*)$", file.read(), re.M)[1]
        assert any(html.escape(title, quote=False).replace("'", "&#39;") in one or title in one for one in found.values()), page
    count = 0
    for name in "drape.h", "extend.h", "lab.h":
        with open(os.path.join(SOURCES, "include", "drape", name), encoding="utf-8") as file:
            header = re.sub(r"/\*.*?\*/", "", file.read(), flags=re.S)
        for wanted in re.findall(r"^DRAPE_API [^;(]*?\b(drape_\w+)\(", header, re.M) + re.findall(r"^typedef struct (\w+) \{", header, re.M):
            assert re.search(rf"\b{wanted}\b", text), wanted
            count += 1
    assert count > 100, count
    dead = list(dead_links(found))
    assert not dead, "\n".join(dead[:20])
    assert list(dead_links({"x.html": '<a class="a" href="no.html">'})) and "images/" in text and "files/" in text


def test_undocumented():
    """a function, a field or a constant without a comment is an error, and so is a reference to nothing"""
    if not shutil.which("doxygen"):
        raise Skip("no doxygen")
    breaks = {"include/drape/drape.h": ("DRAPE_C_END", "DRAPE_API void drape_undocumented(void);\n\nDRAPE_C_END", "drape_undocumented"),
              "include/drape/lab.h": ("typedef struct drape_lab_outcome {", "typedef struct drape_lab_outcome {\n    int bare;\n", "bare"),
              "docs/index.md": ("# Drape: the pages", "# Drape: the pages\n\n[nowhere](lab.md#nowhere)", "page_lab_nowhere")}
    for part in "docs/make", "include", "tools":
        shutil.copytree(os.path.join(SOURCES, part), os.path.join("copy", part), ignore=shutil.ignore_patterns("__pycache__"))
    for part in "docs/index.md", "docs/lab.md", "README.md", "CONTRIBUTING.md", "CHANGELOG.md", "meson.build":
        shutil.copy(os.path.join(SOURCES, part), os.path.join("copy", part))
    os.mkdir("copy/docs/images")
    for path, (place, instead, _) in breaks.items():
        text = text_of(os.path.join("copy", path))
        assert place in text, path
        write_text(os.path.join("copy", path), text.replace(place, instead, 1))
    made = site(os.path.abspath("copy"))
    assert made.returncode not in (0, 77), made.returncode
    for path, (_, _, word) in breaks.items():
        assert word in made.stdout, (path, made.stdout)


sys.exit(run_tests(globals()))
