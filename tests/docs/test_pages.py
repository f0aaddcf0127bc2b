#!/usr/bin/env python3
"""test_pages.py: tries the pages README.md, CONTRIBUTING.md and docs/*.md. Every block of code is run, and every link has a target. See
tests/cli/program.py.

A block is fenced and names its language. `sh` runs in a folder with a scene (SCENE, scene.json), a finished run of it (RUN), the examples, and the
program on its path; a block finds the files that earlier blocks of its page left. `json` is a scene, or members of one. `c` is a program, or functions
and statements of one with a context ctx, a model and a sim. `python` runs. `text` is the output of a command. A comment before a block may say more:

    <!-- not run: WHY -->           the block cannot be run
    <!-- printed by: COMMAND -->    the text is exactly what this command prints
    <!-- lines of: WHAT -->          each line of the text, but for lines that begin with "...", is printed by the last block of `sh` before it, or, with
                                    "the program" as WHAT, by the C programs of the page
    <!-- from: FILE -->             the block is an excerpt of this file

With the argument --write a line of a text that is not printed is replaced in its page by the printed one that begins most like it.
"""
import functools
import glob
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "cli"))
from program import PROGRAM, SOURCES, Skip, drape, equal, good, read_json, run_tests, scene, text_of, write_json, write_text  # noqa: E402  pylint: disable=wrong-import-position

BUILD = os.path.dirname(PROGRAM)
PAGES = ["README.md", "CONTRIBUTING.md"] + sorted("docs/" + os.path.basename(path) for path in glob.glob(SOURCES + "/docs/*.md"))
WRITE = "--write" in sys.argv
LANGUAGES = ("sh", "json", "c", "python", "text")
FENCE = re.compile(r"^(?: *<!-- (?P<kind>[a-z ]+): (?P<said>[^\n]*?) -->\n)?(?P<indent> *)```(?P<language>\w*)\n(?P<text>.*?)^ *```$", re.S | re.M)
HEADS = {"scene": ("cloth",), "cloth": ("mesh", "material", "terms", "pins", "velocity")}

# Output of the C programs of a page that shows that they work.
PRINTS = {"docs/tutorial.md": ["the cloth presses on the ball with"], "docs/embedding.md": ["my scene:1:", "node 0 at"]}

# The scene of fragments: a sheet of 30 nodes in the wind, hung by two corners over a ball.
FRAME_SCENE = """{"drape": 1, "cloth": [{"mesh": {"grid": "square", "columns": 6, "rows": 5, "width": 0.5, "height": 0.4},
  "material": {"young_modulus": 1e4, "thickness": 1e-3, "density": 200}, "terms": ["stretch.edge", "bend.hinge", "drag.wind"],
  "pins": [{"corner": "top-left"}, {"corner": "top-right"}]}],
  "colliders": [{"type": "sphere", "center": [0.25, -0.5, -0.2], "radius": 0.2}], "duration": 1}"""
FRAME = """#include <drape/extend.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#define CHECK(call) do { if (call) { puts(drape_context_message(ctx)); return 1; } } while (0)
%s
int main(void)
{
    drape_context *ctx = NULL;
    drape_model *model = NULL;
    drape_sim *sim = NULL;
    if (drape_context_create(NULL, &ctx)) return 1;
    CHECK(drape_model_load(ctx, "scene.json", &model));
    CHECK(drape_sim_create(ctx, model, NULL, &sim));
    %s
    drape_sim_destroy(&sim), drape_model_destroy(&model), drape_context_destroy(&ctx);
    return 0;
}
"""


def read(page):
    return text_of(os.path.join(SOURCES, page))


class Block:
    def __init__(self, page, match):
        self.page, self.place = page, f"{page}:{read(page).count(chr(10), 0, match.end('indent')) + 1}"
        self.language, self.kind, self.said = match["language"], match["kind"], match["said"]
        self.text = re.sub(rf"^{match['indent']}", "", match["text"], flags=re.M)


def blocks(page):
    return [Block(page, match) for match in FENCE.finditer(read(page))]


# ---- Running the blocks


def done(command, place, **options):
    result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=300, check=False, **options)
    assert result.returncode == 0, f"{place}: exit {result.returncode}:\n{result.stdout}"
    return result.stdout


@functools.cache
def without_drawing():
    """Why this build or machine draws nothing, or ""."""
    tried = drape("render", "SCENE", "--size", "16x16", "--out", "tried.png")
    if tried.returncode != 2:
        os.remove("tried.png")
    return tried.stderr.strip() if tried.returncode == 2 else ""


def need_programs(text):
    """Skips a block that needs a program or a feature that this build or machine does not have."""
    verbs = good("help")
    for verb in re.findall(r"^drape (\w+)", text, re.M):
        if not re.search(rf"^  {verb} ", verbs, re.M):
            raise Skip(f"no {verb} in this build")
    if re.search(r"\.(mp4|webm|gif)\b", text) and not shutil.which("ffmpeg"):
        raise Skip("no ffmpeg")
    if re.search("drape render|--image", text) and without_drawing():
        raise Skip(without_drawing())


def run_sh(block):
    need_programs(block.text)
    return done(["bash", "-euo", "pipefail", "-c", block.text], block.place)


def run_json(block):
    text = block.text
    try:
        whole = json.loads(text)
    except ValueError:
        whole = {**scene(), **json.loads("{" + text + "}")}
        cloth = whole["cloth"][0]
        for key in HEADS["cloth"]:
            if key in whole:
                cloth[key] = whole.pop(key)
    write_json("block.json", whole)
    done([PROGRAM, "check", "block.json"], block.place)


def compiled(text, place):
    library = os.path.join(BUILD, "src", "libdrape.so")
    if not os.path.exists(library):
        raise Skip("no shared library in this build")
    write_text("block.c", text)
    done(["cc", "-Wall", "-Werror", "-I", SOURCES + "/include", "block.c", library, "-Wl,-rpath," + os.path.dirname(library), "-lm", "-o", "block"], place)
    return done(["./block"], place)


def run_c(page, found):
    """C programs unchanged; from fragments one program, with functions before main and statements inside it, in the order of the page, each in a scope."""
    output = "".join(compiled(block.text, block.place) for block in found if "int main(" in block.text)
    rest = [block for block in found if "int main(" not in block.text]
    if rest:
        functions = [block.text for block in rest if block.text.startswith("static ")]
        inside = ["{\n" + block.text + "}\n" for block in rest if not block.text.startswith("static ")]
        write_text("scene.json", FRAME_SCENE)
        output += compiled(FRAME % ("".join(functions), "".join(inside)), page)
    for words in PRINTS.get(page, []):
        assert words in output, f"{page}: its programs do not print {words!r}:\n{output}"
    return output


def run_text(block):
    assert block.kind == "printed by", f"{block.place}: a text says what it is: <!-- printed by: COMMAND --> or <!-- not run: WHY -->"
    command = block.said.split()
    assert command[0] == "drape", block.place
    found = good(*command[1:])
    if found != block.text and "tradeoff" not in good("help"):
        raise Skip("this build has fewer verbs")
    equal(block.text, found, block.place + ": " + block.said)


def check_lines(block, output):
    """Each line of the text is one of the output; --write replaces those that are not."""
    printed = output.splitlines()
    lines = block.text.splitlines()
    other = [line for line in lines if line not in printed and not line.startswith("...")]
    if WRITE and other:
        alike = {line: max(printed, key=lambda new: len(os.path.commonprefix([line, new]))) for line in other}  # pylint: disable=cell-var-from-loop
        text = "".join(alike.get(line, line) + "\n" for line in lines)
        with open(os.path.join(SOURCES, block.page), "r+", encoding="utf-8") as file:
            page = file.read().replace(f"```text\n{block.text}```", f"```text\n{text}```")
            file.seek(0), file.truncate(), file.write(page)
    elif other and "reproducible: yes" not in good("--version"):
        raise Skip("this build has other digits")
    else:
        assert not other, f"{block.place}: not printed: {other}; {__file__} PROGRAM SOURCES --write brings the page up to date\n{output}"


def run_python(block):
    """With the package of the build folder."""
    library = BUILD + "/src/libdrape.so.1"
    if not os.path.exists(library):
        raise Skip("no shared library in this build")
    for module in ["numpy"] + ["matplotlib"] * ("drape.plot" in block.text):
        if subprocess.run([sys.executable, "-c", f"import {module}"], stderr=subprocess.DEVNULL, check=False).returncode:
            raise Skip(f"no {module}")
    environment = {**os.environ, "PYTHONPATH": BUILD + "/python", "DRAPE_LIBRARY": library, "DRAPE_PROGRAM": PROGRAM, "MPLBACKEND": "agg"}
    done([sys.executable, "-B", "-c", block.text], block.place, env=environment)


def stands_in(block):
    def lean(text):
        return " ".join(text.split())
    assert lean(block.text) in lean(read(block.said)), f"{block.place}: does not stand in {block.said}"


RUN = {"sh": run_sh, "json": run_json, "text": run_text, "python": run_python}


def prepare():
    """Prepares the folder in which the blocks of a page run."""
    for name in "SCENE", "scene.json":
        write_json(name, scene())
    good("run", "SCENE", "--out", "RUN")
    shutil.copytree(SOURCES + "/examples", "examples", ignore=shutil.ignore_patterns("__pycache__"))


def run_page(page):
    """Returns how many blocks were run, marked as not run, and skipped, with the reasons."""
    counts, reasons, programs, of_programs, printed = {"run": 0, "marked": 0, "skipped": 0}, [], [], [], None
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        prepare()
        for block in blocks(page):
            assert block.language in LANGUAGES, f"{block.place}: a block says its language, one of {LANGUAGES}"
            if block.kind == "not run":
                counts["marked"] += 1
                reasons.append(f"{block.place}: not run: {block.said}")
            elif block.kind == "from":
                stands_in(block)
                counts["run"] += 1
            elif block.language == "c":
                programs.append(block)
            elif block.kind == "lines of" and block.said == "the program":
                of_programs.append(block)
            else:
                counts["run"] += 1
                try:
                    if block.kind == "lines of":
                        if printed is None:
                            raise Skip("the block before it was skipped")
                        check_lines(block, printed)
                    else:
                        printed = None
                        printed = RUN[block.language](block)
                except Skip as reason:
                    counts["run"] -= 1
                    counts["skipped"] += 1
                    reasons.append(f"{block.place}: skipped: {reason}")
        prepare_again = {"scene.json": "SCENE"}
        for name, source in prepare_again.items():
            shutil.copy(source, name)
        try:
            output = run_c(page, programs)
            for block in of_programs:
                check_lines(block, output)
            counts["run"] += len(programs) + len(of_programs)
        except Skip as reason:
            counts["skipped"] += len(programs)
            reasons.append(f"{page}: programs skipped: {reason}")
        os.chdir("/")
    return counts, reasons


def test_the_net():
    """mistakes in a page are detected"""
    def tried(text):
        matches = [Block("README.md", match) for match in FENCE.finditer(text)]
        return [(block.language, block.kind, block.text) for block in matches]
    equal(tried("```sh\nfalse\n```\n"), [("sh", None, "false\n")])
    lines = next(Block("README.md", match) for match in FENCE.finditer("<!-- lines of: it -->\n```text\na 1\n...\n```\n"))
    check_lines(lines, "a 1\nb\n")
    equal(tried("<!-- not run: a -->\n   ```text\n   x\n   ```\n"), [("text", "not run", "x\n")])
    block = next(Block("README.md", match) for match in FENCE.finditer("```sh\nfalse\ntrue\n```\n"))
    for wrong in (lambda: check_lines(lines, "a 2\n"), lambda: run_sh(block), lambda: compiled("int main(void) { return 1; }\n", "x"), lambda: compiled("int main(void) { oops }\n", "x")):
        try:
            wrong()
        except (AssertionError, Skip):
            continue
        raise AssertionError("was taken")


def test_blocks():
    """every block of code is run, or says why it is not"""
    os.mkdir("bin")  # pictures of the pages are small: most of the time of a page is that of drawing
    write_text("bin/drape", f"""#!/bin/bash
[ "$1" != render ] || [[ " $*" == *" --size"* ]] || set -- "$@" --size 160x90
[ "$1" != render ] || for one; do shift; [[ $one =~ ^[0-9]+x[0-9]+$ ]] && one=160x90; set -- "$@" "$one"; done
exec {PROGRAM} "$@"
""")
    os.chmod("bin/drape", 0o755)
    os.environ["PATH"] = os.path.abspath("bin") + os.pathsep + os.environ["PATH"]
    total, failed = {"run": 0, "marked": 0, "skipped": 0}, []
    for page in PAGES:
        try:
            counts, reasons = run_page(page)
        except (AssertionError, ValueError, subprocess.TimeoutExpired) as error:
            os.chdir("/")
            failed.append(f"{page}: {error}")
            continue
        for line in reasons:
            print("#", line)
        print(f"# {page}: {counts['run']} run, {counts['marked']} marked, {counts['skipped']} skipped", flush=True)
        total = {key: total[key] + counts[key] for key in total}
    print(f"# all pages: {total['run']} blocks run, {total['marked']} marked, {total['skipped']} skipped")
    assert not failed, "\n".join(failed)


def test_no_other_blocks():
    """no block is indented: it would be overlooked"""
    for page in PAGES:
        text = re.sub(FENCE, lambda match: "\n" * match[0].count("\n"), read(page))
        for number, line in enumerate(text.split("\n"), 1):
            before = text.split("\n")[number - 2] if number > 1 else ""
            assert not (line.startswith("    ") and not before.strip()), f"{page}:{number}: an indented block: {line}"
            assert "```" not in line, f"{page}:{number}: a fence without its other end"


# ---- Tables


def test_tables():
    """tables that the program prints, or that runs and results give, are up to date; a number that is not is found"""
    if "| `wireframe` |" not in good("list", "--markdown") or "tradeoff" not in good("help"):
        raise Skip("this build has fewer verbs or entries")
    def checked(sources):
        return subprocess.run([sys.executable, SOURCES + "/tools/tables", "--check", PROGRAM], stderr=subprocess.PIPE, text=True, check=False,
                              env={**os.environ, "DRAPE_SOURCE": sources}).stderr
    equal(checked(SOURCES), "")
    for name in "bench", "docs", "examples":
        os.symlink(os.path.join(SOURCES, name), name)
    write_text("README.md", re.sub(r"\| [0-9.]+ mm", "| 1 mm", read("README.md")))
    equal(checked(os.getcwd()), "tools/tables: README.md: out of date: run tools/tables\n")


# ---- Links


def slug(heading):
    """The anchors of headings, as GitHub makes them."""
    return re.sub(r" ", "-", re.sub(r"[^\w\- ]", "", re.sub(r"[`*]", "", heading).strip().lower()))


def anchors(path):
    with open(path, encoding="utf-8") as file:
        return {slug(heading) for heading in re.findall(r"^#+ (.*)$", file.read(), re.M)}


def dead_links(page, text):
    for target in re.findall(r"\]\(([^)\s]+)\)", re.sub(FENCE, "", text)):
        if re.match(r"https?:", target):
            continue
        path, _, anchor = target.partition("#")
        whole = os.path.normpath(os.path.join(SOURCES, os.path.dirname(page), path)) if path else os.path.join(SOURCES, page)
        if not os.path.exists(whole):
            yield f"{page}: {target}: there is no such file"
        elif anchor and anchor not in anchors(whole):
            yield f"{page}: {target}: there is no such heading"


def test_links():
    """every link of README, CONTRIBUTING, docs, CHANGELOG and the map of the source has a target"""
    pages = PAGES + ["CHANGELOG.md", "src/README.md"]
    dead = [line for page in pages for line in dead_links(page, read(page))]
    assert not dead, "\n".join(dead)
    assert list(dead_links("README.md", "[x](docs/no.md) [y](docs/lab.md#no)")) != []
    count = sum(len(re.findall(r"\]\((?!http)", read(page))) for page in pages)
    assert count > 60, count


def test_paths():
    """source files that the pages name exist"""
    named = re.compile(r"`((?:src|tests|tools|examples|bench|docs|include)/[\w./*-]+)`")
    for page in PAGES + ["src/README.md"]:
        for path in named.findall(read(page)):
            if not re.fullmatch(r"docs/\w+", path):  # that is a test
                assert glob.glob(os.path.join(SOURCES, path)), f"{page}: `{path}` is not there"


def test_pages_are_found():
    """every page is linked from README or from the index"""
    text = read("README.md") + read("docs/index.md")
    for page in PAGES[2:]:
        name = os.path.basename(page)
        assert name == "index.md" or re.search(rf"\((docs/)?{re.escape(name)}[)#]", text), f"{page} is linked from nowhere"


def test_scene_page():
    """docs/reference.md has the tables of this build, which may have fewer entries"""
    found = read("docs/reference.md").splitlines()
    missing = [line for line in good("list", "--markdown").splitlines() if line not in found]
    assert not missing, missing


def test_statuses():
    """docs/output.md explains each status; no reason is reported that is not of the table"""
    page = read("docs/output.md")
    header = read("include/drape/drape.h")
    names = [name.lower() for name in re.findall(r"^    DRAPE_((?:OK|RETRY_\w+|E_\w+)) = ", header, re.M)]
    assert len(names) > 10, names
    missing = [name for name in names if f"`{name}`" not in page]
    assert not missing, missing
    for path in glob.glob(SOURCES + "/src/*/*.c"):
        with open(path, encoding="utf-8") as file:
            stray = re.findall(r'reason = [^;,]*"[a-z]|drape_fault \w+ = \{[^;]*?"[a-z]+_[a-z]+", "|\.reason = "[a-z]', file.read())
        assert not stray, f"{path}: {stray}: not of the table in src/base/reason.h"


def test_summary():
    """each key of a summary.json and each column of the tables of a run is explained in docs/output.md"""
    page = read("docs/output.md")
    with open(SOURCES + "/src/io/summary.c", encoding="utf-8") as file:
        wanted = set(re.findall(r'(?:\{|with\(\w+(?:\(\))?, )"([a-z_]\w*)"', file.read()))
    write_json("scene.json", scene())
    good("run", "scene.json", "--out", "out", "--realtime", "--integrator", "newton_k")
    summary = read_json("out/summary.json")
    for key, value in summary.items():
        wanted |= {key, *(value if isinstance(value, dict) else [])}
    for name in "steps.csv", "energy.csv":
        with open("out/" + name, encoding="ascii") as file:
            wanted |= set(file.readline().strip().split(","))
    assert len(wanted) > 60, wanted
    missing = sorted(key for key in wanted if f"`{key}`" not in page)
    assert not missing, missing


def test_citation():
    """CITATION.cff has the keys that its schema requires, and the version of the project"""
    text = read("CITATION.cff")
    for key in "cff-version", "message", "title", "authors":
        assert re.search(rf"^{key}:", text, re.M), key
    version = re.search(r"^project\('drape'.*? version: '([^']*)'", read("meson.build"), re.M)[1]
    equal(re.search(r"^version: (.*)$", text, re.M)[1], version)


sys.exit(run_tests(globals()))
