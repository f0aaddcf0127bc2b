#!/usr/bin/env python3
"""test_manual.py: checks the manual pages, which docs/make/manual.py makes from the program and the headers, against both, and with man and
mandoc. See tests/cli/program.py."""
import glob
import os
import re
import shutil
import subprocess
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "cli"))
from program import PROGRAM, SOURCES, Skip, equal, good, run_tests  # noqa: E402  pylint: disable=wrong-import-position

PAGES = os.path.join(os.path.dirname(PROGRAM), "docs", "make")


def pages():
    found = sorted(glob.glob(PAGES + "/*.[135]"))
    if not found:
        raise Skip("this build cannot run the program, and has no pages")
    return found


def words(name):
    """The text of a page, without roff requests and escapes."""
    with open(os.path.join(PAGES, name), encoding="utf-8") as file:
        return re.sub(r"\\f[BIR]|\\&", "", file.read()).replace("\\-", "-").replace("\\e", "\\")


def verbs():
    return [verb for verb in re.findall(r"^  (\w+) ", good("help"), re.M) if verb != "drape"]


def silent(*command):
    result = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env={**os.environ, "LC_ALL": "C.UTF-8"})
    equal((result.returncode, result.stderr), (0, ""), " ".join(command))


def test_pages():
    """there is a page of the program, of each verb, of scenes, of the library"""
    names = {os.path.basename(path) for path in pages()}
    equal(names, {"drape.1", "drape.3", "drape-scene.5"} | {f"drape-{verb}.1" for verb in verbs()})


def test_man():
    """man prints no warnings for any page"""
    if not shutil.which("man"):
        raise Skip("no man")
    for page in pages():
        silent("man", "--warnings", "-l", "-E", "UTF-8", "-Tutf8", page)


def test_mandoc():
    """mandoc prints no warnings for any page"""
    if not shutil.which("mandoc"):
        raise Skip("no mandoc")
    result = subprocess.run(["mandoc", "-Tlint", "-W", "warning", *pages()], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    equal((result.returncode, result.stdout), (0, ""))


def test_verbs():
    """the page of a verb has every option of its help, with the same text; that of the program every verb and exit code"""
    pages()
    overview = words("drape.1")
    for verb in verbs():
        options = re.findall(r"^  (--\S+(?: \S+)?) +(.*)$", good("help", verb), re.M)
        page = " ".join(words(f"drape-{verb}.1").split())
        assert f"drape-{verb}(1)" in overview and "--help" in [option for option, _ in options], verb  # only this line: the build has no drawing
        for option, text in options:
            assert f".TP {option} {text.replace('`', '')}" in page, (verb, option)
    for code, text in ("0", "done"), ("1", "failed"), ("2", "bad input"), ("130", "interrupted"):
        assert re.search(rf"\n\.TP\n{code}\n.*{text}", overview), code


def test_scene():
    """the page of scenes has every key, every entry and every parameter of the tables"""
    pages()
    page = words("drape-scene.5")
    shown = re.findall(r"^\| `([^|]*)` \|(?: `([^`]*)` \|)?", good("list", "--markdown"), re.M)
    assert len(shown) > 150, shown
    for first, second in shown:
        wanted = (second or first).replace("`", "")
        assert f"\n.TP\n{wanted}\n" in page, (first, second)


def test_library():
    """the page of the library has every public function and status"""
    pages()
    page, count = words("drape.3"), 0
    for name in "drape.h", "extend.h":
        with open(os.path.join(SOURCES, "include", "drape", name), encoding="utf-8") as file:
            text = re.sub(r"/\*.*?\*/", "", file.read(), flags=re.S)
        for wanted in re.findall(r"^DRAPE_API [^;(]*?\b(drape_\w+)\(", text, re.M) + re.findall(r"^    (DRAPE_(?:OK|RETRY\w+|E_\w+)) = ", text, re.M):
            assert re.search(rf"\b{wanted}\b", page), wanted
            count += 1
    assert count > 80, count


sys.exit(run_tests(globals()))
