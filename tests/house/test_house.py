#!/usr/bin/env python3
"""test_house.py ROOT: rules of the source tree that no compiler checks. Output is TAP.

A check is a function of {path: text} that returns complaints. Each is also tried on tiny trees that break its rule, which it must report,
and on a sound one.
"""
import os
import re
import sys

ARROWS = re.compile(r"^([a-z]+) -> ([a-z ]+)$", re.M)
NUMBER = r"\(?(-?[0-9.]+(?:[eE][-+]?[0-9]+)?)\)?"
NAMED = re.compile(rf"^\s*#\s*define\s+([A-Z][A-Z0-9_]*)\s+{NUMBER}\s*$|^\s*([A-Z][A-Z0-9_]*)\s*=\s*{NUMBER}\s*,?\s*$")
REASON = re.compile(r"^\| (\w+) \| ([\w.]+) \| `(\w+)` \| `([^`]+)` \| \S.* \|$", re.M)
# folders of src that decide a motion: their numbers have a reason
NUMBERED = ("accuracy", "assemble", "colliders", "compile", "contact", "control", "geometry", "host", "integrators", "nonlinear", "realtime", "sim", "solvers", "terms", "untangle")


def files_of(root):
    """{path: text} of the project's files: these folders and the pages and build files at the top; no binary files."""
    kept = {}
    names = [os.path.join(root, name) for name in os.listdir(root) if re.search(r"\.md$|^meson|^LICENSE$|^\.clang-format$|^\.gitignore$", name)]
    for top in (".ci", "bench", "docs", "examples", "include", "src", "tests", "tools", "blender"):
        for folder, folders, inside in os.walk(os.path.join(root, top)):
            folders[:] = [name for name in folders if name != "__pycache__"]
            names += [os.path.join(folder, name) for name in inside]
    for name in names:
        with open(name, "rb") as file:
            data = file.read()
        if b"\0" not in data:
            kept[os.path.relpath(name, root)] = data.decode("utf-8", "replace")
    return kept


def sources(files, *tops):
    return {path: text for path, text in files.items() if path.split("/")[0] in tops and path.endswith((".c", ".h", ".c.in"))}


def folder_of(path):
    """src/mesh/mesh.c -> mesh; include/drape/drape.h -> drape; src/entries.c.in -> src"""
    return path.split("/")[-2]


def code_of(text):
    """The text without comments and strings, with the same line numbers."""
    def blank(match):
        return re.sub(r"[^\n]", " ", match.group())
    return re.sub(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'', blank, text, flags=re.S)


def line_of(text, position):
    return text.count("\n", 0, position) + 1


def below(files):
    """{folder: folders that it may include}, from the arrows in src/README.md."""
    direct = {upper: set(lower.split()) for upper, lower in ARROWS.findall(files.get("src/README.md", ""))}
    reach = {folder: set(lower) for folder, lower in direct.items()}
    for folder in set().union(*direct.values(), direct):
        reach.setdefault(folder, set())
    changed = True
    while changed:
        changed = False
        for lower in reach.values():
            more = set().union(*(reach[folder] for folder in lower)) - lower
            lower |= more
            changed = changed or bool(more)
    return reach


def includes_point_down(files):
    reach, complaints = below(files), []
    for folder, lower in reach.items():
        if folder in lower:
            complaints.append(f"src/README.md: the arrows lead from {folder} back to {folder}")
    for path, text in sources(files, "src", "include").items():
        folder = folder_of(path)
        if folder == "src":
            continue
        for match in re.finditer(r'^[ \t]*#[ \t]*include[ \t]+"([^"]+)"', text, re.M):
            name, place = match.group(1), f"{path}:{line_of(text, match.start())}"
            target = name.split("/")[0] if "/" in name else folder
            if folder == "drape":
                if target != "drape":
                    complaints.append(f"{place}: a public header includes {name}")
            elif "/" not in name or name.startswith("."):
                complaints.append(f'{place}: "{name}" does not say its folder, as in "{folder}/{os.path.basename(name)}"')
            elif target not in reach.get(folder, set()) | {folder, "drape"}:
                complaints.append(f"{place}: {folder} may not include {name}: no arrow in src/README.md leads there")
            elif (f"include/{name}" if target == "drape" else f"src/{name}") not in files:
                complaints.append(f"{place}: there is no {name}")
    return complaints


def map_is_whole(files):
    reach = below(files)
    folders = {path.split("/")[1] for path in files if re.match(r"src/\w+/.*\.[ch]$", path)}
    return [f"src/README.md: no arrow names the folder {folder}" for folder in sorted(folders - set(reach))] + [
        f"src/README.md: there is no folder {folder}" for folder in sorted(set(reach) - folders)]


def all_is_built(files):
    """Each .c of src/ is named in the meson.build of its folder, each test in tests/meson.build."""
    complaints = []
    for path in files:
        folder, name = os.path.split(path)
        if not name.endswith(".c") or not re.match(r"src/\w+/|tests/(unit|entries|physics|faults|api)/test_", path):
            continue
        list_file = "tests/meson.build" if path.startswith("tests/") else f"{folder}/meson.build"
        if folder == "src/cli" and list_file not in files:
            list_file = "meson.build"
        words = re.findall(r"'([^'\n]*)'", files.get(list_file, ""))
        stem = name[:-2]
        if not any(word in (stem, name) or word.endswith("/" + name) or stem.endswith("_" + word) for word in words):
            complaints.append(f"{path}: is not named in {list_file}")
    return complaints


def library_is_silent(files):
    """The library never prints and never ends the process; the program may."""
    complaints = []
    for path, text in sources(files, "src").items():
        if path.startswith("src/cli/"):
            continue
        code = code_of(text)
        for match in re.finditer(r"\b(v?printf|puts|putchar|perror|exit|_exit|_Exit|abort)[ \t]*\(|\b(stdout|stderr)\b", code):
            complaints.append(f"{path}:{line_of(code, match.start())}: {match.group().rstrip('( ')}: the library does not print or exit")
    return complaints


def messages_are_of_the_library(files):
    """What the library says names no option or verb of the program, which a host does not have; the program adds them."""
    complaints = []
    for path, text in sources(files, "src").items():
        if path.startswith(DRAWS_OR_PRINTS):
            continue
        for match in re.finditer(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"(?:\s*"(?:\\.|[^"\\\n])*")*', text, flags=re.S):
            said = re.sub(r'"\s*"', "", match.group())  # adjacent literals are one
            if said.startswith('"') and re.search(r"(?<![\w-])--[a-z]|\bdrape [a-z]+ |\bdrape (?:run|list|info|check|help)\b|command[ -]line", said):
                complaints.append(f"{path}:{line_of(text, match.start())}: {said[:60]}: of the program, not of the library")
    return complaints


# Functions of the C library that IEEE 754 does not define: each library has its own bits, and some choose by the processor. `pow` and `log` of a
# struct are no calls of them.
OF_THE_LIBRARY = re.compile(r"(?<![\w.>])(?:sin|cos|sincos|tan|asin|acos|atan|atan2|sinh|cosh|tanh|asinh|acosh|atanh|exp|exp2|exp10|expm1|log|log2"
                            r"|log10|log1p|pow|hypot|cbrt|erf|erfc|lgamma|tgamma|j0|j1|y0|y1|fma|rand|random|drand48)[fl]?[ \t]*\(")
DRAWS_OR_PRINTS = ("src/render/", "src/lab/", "src/cli/", "src/report/")


def states_are_reproducible(files):
    """What computes states calls base/elementary.h in place of the C library's functions."""
    complaints = []
    for path, text in sources(files, "src", "include").items():
        if path.startswith(DRAWS_OR_PRINTS):
            continue
        code = code_of(text)
        for match in OF_THE_LIBRARY.finditer(code):
            complaints.append(f"{path}:{line_of(code, match.start())}: {match.group().rstrip('( ')}: its bits depend on the processor: base/elementary.h")
    return complaints


def private_words(files):
    """The words that the table under "Words" in CONTRIBUTING.md forbids: those in backticks in its first column."""
    section = files.get("CONTRIBUTING.md", "").partition("\n### Words\n")[2].partition("\n#")[0]
    cells = [line.split("|")[1] for line in section.split("\n") if line.startswith("|")]
    return [word for cell in cells for word in re.findall("`([^`]+)`", cell)]


def words_are_standard(files):
    """Reports forbidden words. An identifier counts as the words that its underscores separate."""
    words = private_words(files)
    if not words:
        return ["CONTRIBUTING.md: there is no table under Words"]
    pattern = re.compile("(?<![a-z])(" + "|".join(re.escape(word) for word in words) + ")(?:e?s)?(?![a-z])", re.I)
    complaints = []
    for path, text in files.items():
        if path in ("CONTRIBUTING.md", "LICENSE") or path.startswith("tests/fuzz/corpus/") or path.endswith((".abi", ".csv", ".obj", ".ply", ".svg")):
            continue
        for match in pattern.finditer(text.replace("_", " ")):
            complaints.append(f'{path}:{line_of(text, match.start())}: "{match.group(1)}": CONTRIBUTING.md has the standard word')
    return complaints


def prose_of(page):
    """The lines of a page that can be wrapped, and "" for the others: blocks of code, comments, tables, and lines of one word, such as a link;
    what the program prints at its end is left out."""
    fenced = False
    for line in page.partition("<!-- drape list --markdown -->")[0].split("\n"):
        fenced ^= line.strip().startswith("```")
        whole = re.sub(r"`[^`]*`|!?\[[^\]]*\]\(\S*\)", "x", line.strip())
        yield "" if fenced or line.strip().startswith(("```", "<!--", "|")) or not re.search(r"\w\S* \S", whole) else line


def lines_are_short(files):
    """Lines have at most 110 columns: clang-format breaks code, but not comments and long strings, and nothing breaks pages.

    CHANGELOG.md has a line for each change.
    """
    lines = [(path, text.split("\n")) for path, text in sources(files, "src", "include", "tests", "bench", "examples").items()]
    lines += [(path, list(prose_of(text))) for path, text in files.items() if path.endswith(".md") and path != "CHANGELOG.md"]
    return [f"{path}:{number}: {len(line)} columns; at most 110" for path, text in lines for number, line in enumerate(text, 1) if len(line) > 110]


MEASURED = re.compile(r"\b(?:took|takes?|taking) (?:about |some |up to |at most )?[\d.]+ ?(?:us|ms|s|min|minutes|hours)\b(?! of the)|\bp(?:50|9[59]) [\d.]+"
                      r"|(?<![\w.-])[\d.]+ (?:times|of) the (?:CPU|time)\b|[\d.]+ (?:s|ms) of CPU|\bin [\d ]+ of [\d ]+ (?:runs|scenes)\b"
                      r"|[\d ]+ rejected (?:attempts|steps)\b")


def measurements_are_results(files):
    """README and docs have no measured times and counts: these are in bench/results with their date, or in what tools write and tests check."""
    return [f"{path}:{number}: {found.group()}: measurements belong into bench/results" for path, text in files.items()
            if re.match(r"README\.md$|docs/\w+\.md$", path) for number, line in enumerate(prose_of(text), 1) for found in MEASURED.finditer(line)]


def numbers_have_reasons(files):
    """Each fixed number with a name, other than 0 and 1, in the folders NUMBERED has a row with its value in bench/results/numbers.md, and each row
    has a number."""
    table = {row[:3]: row[3] for row in REASON.findall(files.get("bench/results/numbers.md", ""))}
    found = {}
    for path, text in sources(files, "src").items():
        matches = [NAMED.match(line) for line in code_of(text).split("\n")] if folder_of(path) in NUMBERED else []
        for match in filter(None, matches):
            name, value = match.group(1) or match.group(3), match.group(2) or match.group(4)
            if float(value) not in (0, 1):
                found[(folder_of(path), os.path.basename(path), name)] = value
    complaints = [f"src/{room}/{file}: {name} is {found[room, file, name]}; bench/results/numbers.md has {table.get((room, file, name), 'no row for it')}"
                  for room, file, name in found if table.get((room, file, name)) != found[room, file, name]]
    return complaints + [f"bench/results/numbers.md: src/{room}/{file} has no {name}" for room, file, name in table.keys() - found.keys()]


def one_place_for_cpp(files):
    complaints = []
    for path, text in sources(files, "src", "include").items():
        for match in re.finditer(r"__cplusplus|\bvisibility\b", text):
            if path != "include/drape/export.h":
                complaints.append(f"{path}:{line_of(text, match.start())}: {match.group()} belongs into include/drape/export.h")
    return complaints


def no_stray_blanks(files):
    complaints = []
    for path, text in files.items():
        if path.startswith(("docs/", "tests/bad/", "tests/fuzz/corpus/")) or path.endswith((".obj", ".ply", ".csv", ".svg")):
            continue
        for number, line in enumerate(text.split("\n"), 1):
            if "\t" in line:
                complaints.append(f"{path}:{number}: a tab")
            if line != line.rstrip():
                complaints.append(f"{path}:{number}: a blank at the end of the line")
        if text and not text.endswith("\n"):
            complaints.append(f"{path}: no newline at the end")
    return complaints


MAP = {"src/README.md": "sim -> mesh\nmesh -> base\n", "src/sim/a.h": "", "src/mesh/a.h": "", "src/base/a.h": ""}
BROKEN = {
    includes_point_down: [
        {**MAP, "src/mesh/b.c": '#include "sim/a.h"\n'},
        {**MAP, "src/mesh/b.c": '#include "a.h"\n'},
        {**MAP, "src/mesh/b.c": '#include "../base/a.h"\n'},
        {**MAP, "src/mesh/b.c": '#include "base/missing.h"\n'},
        {**MAP, "include/drape/drape.h": '#include "base/a.h"\n'},
        {**MAP, "src/README.md": "sim -> mesh\nmesh -> base\nbase -> sim\n"}],
    map_is_whole: [{**MAP, "src/other/a.c": ""}, {**MAP, "src/README.md": "sim -> mesh\nmesh -> base gone\n"}],
    all_is_built: [
        {"src/mesh/a.c": "", "src/mesh/meson.build": "sources = ['b.c']\n"},
        {"tests/unit/test_a.c": "", "tests/meson.build": "'b'\n"}],
    library_is_silent: [{"src/io/a.c": 'printf("x");\n'}, {"src/io/a.c": "fputs(x, stderr);\n"}, {"src/io/a.c": "abort ();\n"}],
    messages_are_of_the_library: [{"src/sim/a.c": 'fail("choose --dt");\n'}, {"src/base/a.c": 'x = "see `drape list terms`";\n'}],
    states_are_reproducible: [
        {"src/sim/a.c": "x = sin(y);\n"}, {"src/base/a.h": "return -pow (x, 2);\n"}, {"src/terms/a.c": "logf(x)\n"}, {"src/mesh/a.c": "2*atan2(y, x)\n"}],
    one_place_for_cpp: [{"src/io/a.h": "#ifdef __cplusplus\n"}, {"include/drape/drape.h": "visibility\n"}],
    words_are_standard: [
        {"CONTRIBUTING.md": "\n### Words\n| `gizmo` | device |\n", "src/a.h": "the\nGizmos of it"},
        {"CONTRIBUTING.md": "\n### Words\n| `gizmo` | device |\n", "src/a.c": "drape_gizmo_init();"},
        {"CONTRIBUTING.md": "\n### Words\n"}],
    numbers_have_reasons: [
        {"src/terms/a.c": "#define A 2\n"}, {"src/terms/a.c": "enum {\n    A = 2,\n};\n"}, {"src/terms/a.c": " # define A (1e-3) /* why */\n"},
        {"src/terms/a.c": "#define A 2\n", "bench/results/numbers.md": "| terms | a.c | `A` | `3` | size |\n"},
        {"src/terms/a.c": "#define A 2\n", "bench/results/numbers.md": "| terms | a.c | `A` | `2` |  |\n"},
        {"src/terms/a.c": "", "bench/results/numbers.md": "| terms | a.c | `A` | `2` | size |\n"}],
    lines_are_short: [
        {"src/io/a.c": "x" * 111 + "\n"}, {"docs/a.md": "word " * 23}, {"README.md": "```sh\n```\n- [a](b) " + "word " * 23},
        {"bench/results/a.md": "a [link of two words](" + "x" * 50 + ") " + "word " * 10}],
    measurements_are_results: [
        {"docs/a.md": "The run took 12 ms on it.\n"}, {"README.md": "p99 8 ms\n"}, {"docs/a.md": "a fifth, 0.2 of the time, in 3 of 72 scenes\n"}],
    no_stray_blanks: [{"a.c": "\tx\n"}, {"a.md": "x \n"}, {"tools/a": "x"}],
}
SOUND = {
    **MAP, "CONTRIBUTING.md": "\n### Words\n| `gizmo` | device |\n", "docs/a.md": f"agizmo is gizmotic\n| {'x ' * 60} |\n```sh\n{'x ' * 60}\n```\n- ![of two words]({'x' * 99})\n", "CHANGELOG.md": "x" + " x" * 60 + "\n",
    "src/sim/b.c": '#include "base/a.h"\n#include "sim/a.h"\n#include "drape/drape.h"\n/* printf(x) */ snprintf(x, "exit(1)");\n',
    "src/sim/c.c": "drape_sin_cos(x); log_of(x); a->log(x); b.pow(x); sqrt(x); /* sin(x) */ fmod(x, y);\n",
    "src/sim/meson.build": "sources = ['b.c', 'c.c', 'd.c']\nentries += {'r': ['halving']}\n", "src/sim/control_halving.c": "", "src/cli/main.c": "exit(1); sin(x); say(\"--dt\");\n",
    "src/sim/d.c": '/* drape list shows "--dt" */ i--; fail("drape_sim_advance: dt --");\n',
    "src/terms/a.c": "#define A 2 /* of them */\n#define B 1\n#define C (2 * D)\n", "src/terms/meson.build": "'a.c'\n", "src/io/e.c": "#define E 5\n", "src/io/meson.build": "'e.c'\n",
    "bench/results/numbers.md": "| terms | a.c | `A` | `2` | size: of them |\n",
    "src/cli/meson.build": "'main.c'\n", "src/README.md": "cli -> sim io\nio -> terms\nterms -> mesh\nsim -> mesh\nmesh -> base\n", "include/drape/drape.h": '#include "export.h"\n',
    "include/drape/export.h": "__cplusplus visibility\n", "tests/unit/test_a.c": "", "tests/meson.build": "'a'\n"}


def main(root):
    files = files_of(root)
    print(f"1..{len(BROKEN)}")
    failed = 0
    for number, (check, broken) in enumerate(BROKEN.items(), 1):
        complaints = check(files)
        complaints += [f"the check overlooks {tree}" for tree in broken if not check(tree)]
        complaints += [f"the check refuses what is sound: {complaint}" for complaint in check(SOUND)]
        for complaint in complaints:
            print(f"# {complaint}")
        print(f"{'not ok' if complaints else 'ok'} {number} - {check.__name__}")
        failed += bool(complaints)
    return failed > 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
