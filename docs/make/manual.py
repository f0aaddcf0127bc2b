#!/usr/bin/env python3
"""manual.py PROGRAM CHANGELOG HEADER... FOLDER: generates the manual pages of Drape from the output of the program and the public headers.

drape.1 and drape-VERB.1 come from `drape help`, drape-scene.5 from `drape list --markdown`, drape.3 from the comments of the headers, the date from
the CHANGELOG of the Debian package. This file itself describes no option, key or function.
"""
import os
import re
import subprocess
import sys

import header

PROGRAM = None
SEE = {"run": ["drape-scene(5)", "drape-render(1)", "drape-report(1)", "drape-compare(1)"], "compare": ["drape-run(1)", "drape-render(1)"], "list": ["drape-scene(5)"], "render": ["drape-view(1)"],
       "view": ["drape-render(1)"], "merge": ["drape-tradeoff(1)", "drape-stability(1)", "drape-converge(1)"]}


def output_of(*arguments):
    return subprocess.run([PROGRAM, *arguments], check=True, stdout=subprocess.PIPE, text=True).stdout


# ---- Roff


def plain(text):
    """Escapes text for roff: `code` in bold, options with real minuses."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    text = re.sub(r"`([^`\n]+)`", r"\\fB\1\\fR", text)
    return "\n".join("\\&" + line if line.startswith((".", "'")) else line for line in text.split("\n"))


def filled(text):
    """A paragraph, with one line for each sentence."""
    return plain(re.sub(r"(?<=[.:;]) (?=[A-Z`])", "\n", " ".join(text.split())))


def paragraphs(text):
    """Keeps indented lines and fills the others."""
    out = []
    for part in re.split(r"\n\s*\n", text.strip("\n")):
        lines = part.split("\n")
        while lines:
            kept = lines[0].startswith("  ")
            count = next((n for n, line in enumerate(lines) if line.startswith("  ") != kept), len(lines))
            block, lines = "\n".join(lines[:count]), lines[count:]
            out.append(".PP\n.nf\n" + plain(block) + "\n.fi" if kept else ".PP\n" + filled(block))
    return re.sub(r"^\.PP\n", "", "\n".join(out))


def item(term, text, more=""):
    return f".TP\n{term}\n{filled(text)}" + (f"\n.br\n{filled(more)}" if more else "")


def page(name, section, brief, *parts):
    """parts: (heading, roff)."""
    title = f'.TH {name.upper()} {section} "{DATE}" "{output_of("--version").splitlines()[0]}"'
    body = "".join(f".SH {heading}\n{text}\n" for heading, text in parts if text)
    return f"{title}\n.SH NAME\n{plain(name)} \\- {plain(brief)}\n{body}"


# ---- drape(1), drape-VERB(1)


def options(text):
    """The options in the help of a verb: [(--name, ARGUMENT, description)]."""
    return re.findall(r"^  (--[\w-]+)(?: (\S+))? +(.*)$", text, re.M)


def option_item(name, argument, text):
    return item(f"\\fB{plain(name)}\\fR" + (f" \\fI{plain(argument)}\\fR" if argument else ""), text)


def exit_status(overview):
    codes = re.search(r"^Exit codes: (.*)\.$", overview, re.M)[1]
    return "\n".join(item(f"\\fB{code}\\fR", text + ".") for code, text in re.findall(r"(\d+) (.*?)(?=, \d+ |$)", codes))


def see_also(names, own):
    return ",\n".join(f".BR {plain(name).replace('(', ' (')}" for name in names if name != own).replace(",\n", " ,\n")


def verbs(overview):
    return re.findall(r"^  (\w+) +(\S+(?: [A-Z]\S*)*) +(.*)$", overview, re.M)


def overview_page(overview):
    parts = [("SYNOPSIS", "\\fBdrape\\fR \\fIVERB\\fR [\\fIarguments\\fR]"),
             ("DESCRIPTION", filled("Drape simulates cloth: a triangle mesh whose stretching, bending, damping, drag and contact are residuals with exact "
                                    "derivatives, solved implicitly. A scene is a file, drape-scene(5); the library is drape(3).")),
             ("VERBS", "\n".join(item(f"\\fB{verb}\\fR \\fI{plain(operand)}\\fR", f"{what}; drape-{verb}(1)")
                                 for verb, operand, what in verbs(overview) if verb != "drape")),
             ("OPTIONS", "\n".join(item(f"\\fB{plain(name)}\\fR", what) for name, what in re.findall(r"^  drape (?:VERB )?(--\w+) +(.*)$", overview, re.M))),
             ("EXIT STATUS", exit_status(overview)),
             ("EXAMPLES", ".nf\n" + plain("drape run examples/scenes/hung_sheet.json --out hung\ndrape render hung --out hung.png\n"
                                         "drape run scene.json --integrator ida --set /integrator/rtol=1e-4\ndrape list terms") + "\n.fi"),
             ("SEE ALSO", see_also([f"drape-{verb}(1)" for verb, _, _ in verbs(overview) if verb != "drape"] + ["drape-scene(5)", "drape(3)"], ""))]
    return page("drape", 1, "cloth simulation", *parts)


def verb_page(overview, verb, brief):
    text = output_of("help", verb)
    usage, details = re.match(r"usage: (.*)\n\n(.*?)\n\n(?=  --)", text, re.S).groups()
    program, name, operand, rest = re.match(r"(drape) (\w+) (.*) (\[options\])$", usage).groups()
    return page(f"drape-{verb}", 1, brief,
                ("SYNOPSIS", f"\\fB{program} {name}\\fR \\fI{plain(operand)}\\fR {rest}"), ("DESCRIPTION", paragraphs(details)),
                ("OPTIONS", "\n".join(option_item(*option) for option in options(text))), ("EXIT STATUS", exit_status(overview)),
                ("SEE ALSO", see_also(["drape(1)"] + SEE.get(verb, ["drape-scene(5)"]), f"drape-{verb}(1)")))


# ---- drape-scene(5)


def cells(line):
    return [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


def rows_of(lines):
    """The tables of a part: [(cells of the head, [cells of a line])]."""
    found = []
    for line in lines:
        if line.startswith("|---"):
            continue
        if line.startswith("|") and (not found or found[-1] is None):
            found.append((cells(line), []))
        elif line.startswith("|"):
            found[-1][1].append(cells(line))
        elif found and found[-1] is not None:
            found.append(None)
    return [table for table in found if table]


def parameter(name, unit, default, takes, what):
    """A parameter of an entry, or a key of a scene."""
    usual = default if default == "required" else f"default {default}" if default else ""
    return item(name, what, f"{takes}{' ' + unit if unit else ''}{'; ' + usual if usual else ''}")


def keys(table):
    out, before = [], None
    for place, key, unit, default, takes, what in table[1]:
        if place != before:
            out.append(f".SS {plain(place.strip('`'))}" if place != "`/`" else ".SS at the top")
        before = place
        out.append(parameter(plain(key), unit, default, takes, what))
    return "\n".join(out)


def entries(lines, tables):
    """Each entry, with its parameters below it. One that is alone has a sentence instead of a table."""
    alone = [(*found.groups(), "") for found in (re.match(r"(`\w+`): (.*)\.$", line) for line in lines) if found]
    out = []
    for names, what, reference in alone or tables[0][1]:
        out.append(item(plain(names), what, f"Source: {reference}" if reference else ""))
        own = [line for table in tables[not alone:] for line in table[1] if set(names.split(", ")) & set(line[0].split(", "))]
        if own:
            out.append(".RS")
            for _, name_of, unit, default, takes, what_it_is in own:
                out.append(parameter(f"\\fI{plain(name_of.strip('`'))}\\fR", unit, default, takes, what_it_is))
            out.append(".RE")
    return "\n".join(out)


def scene_page():
    parts = []
    for part in re.split(r"^### ", output_of("list", "--markdown"), flags=re.M)[1:]:
        title, *lines = part.split("\n")
        tables = rows_of(lines)
        place = "".join(line for line in lines if line.startswith("Where: "))
        roff = keys(tables[0]) if tables[0][0][0] == "in" else (filled(place) + "\n" if place else "") + entries(lines, tables)
        parts.append((plain(title.upper()), roff))
    about = ("A scene is JSON, with comments. Units are SI, y is up. Forces are opt-in: a scene lists the ones it wants. Unknown keys are errors. "
             "`drape info` shows every value that is used, `drape list --schema` prints the JSON Schema. A scene of the CS184 cloth simulator is recognised "
             "by its form and runs unchanged.")
    example = ('{"drape": 1,\n "cloth": [{"mesh": {"grid": "equilateral", "edges": 22, "edge_length": 0.05},\n'
               '            "material": {"young_modulus": 1e6, "thickness": 1e-3, "density": 200},\n'
               '            "terms": ["stretch.edge", "bend.hinge"],\n            "pins": [{"corner": "top-left"}]}],\n "duration": 2}')
    return page("drape-scene", 5, "scenes of Drape, a cloth simulator", ("DESCRIPTION", filled(about)), ("EXAMPLE", ".nf\n" + plain(example) + "\n.fi"), *parts,
                ("SEE ALSO", see_also(["drape-run(1)", "drape-list(1)", "drape-info(1)", "drape(3)"], "")))


# ---- drape(3)


def declaration(code):
    code = re.sub(r"DRAPE_PRINTF\([^)]*\)|DRAPE_API ", "", code)
    return "\n".join(line.rstrip() for line in code.split("\n") if line.strip() and not line.startswith("#")).replace(" ;", ";")


def statuses(text):
    body = re.search(r"typedef enum drape_status \{(.*?)\} drape_status;", text, re.S)[1]
    return "\n".join(item(f"\\fB{name}\\fR ({plain(value)})", " ".join(what.split()) if what else "done")
                     for name, value, what in re.findall(r"(DRAPE_\w+) = (-?\d+),?(?:\s*/\* (.*?) \*/)?", body, re.S))


def functions(texts):
    out = []
    for text in texts:
        for title, about, blocks in header.sections(text):
            shown = [(words, declaration(code)) for words, code in blocks]
            shown = [(words, code) for words, code in shown if re.match(r"(?!typedef struct)\S[^{]*\(", code)]
            if not shown:
                continue
            out.append(f".SS {plain(title) if title else 'Experiments'}")
            out += [filled(about)] if about else []
            for number, (words, code) in enumerate(shown):
                out.append((".PP\n" if number or about else "") + ".nf\n\\fB" + plain(code).replace("\n", "\\fR\n\\fB") + "\\fR\n.fi\n.RS\n" + paragraphs(words) + "\n.RE")
    return "\n".join(out)


def library_page(headers):
    texts = []
    for path in headers:
        with open(path, encoding="utf-8") as file:
            texts.append(file.read())
    opening = header.words(re.match(r"/\*.*?\*/", texts[0], re.S)[0])
    about = opening.split(": ", 1)[1]
    return page("drape", 3, "library of cloth simulation",
                ("SYNOPSIS", ".nf\n\\fB#include <drape/drape.h>\n#include <drape/extend.h>\\fR\n.PP\n\\fBcc \\fIprogram.c\\fB $(pkg\\-config \\-\\-cflags "
                             "\\-\\-libs drape)\\fR\n.fi"),
                ("DESCRIPTION", paragraphs(about[0].upper() + about[1:])), ("STATUSES", statuses(texts[0])), ("FUNCTIONS", functions(texts)),
                ("SEE ALSO", see_also(["drape(1)", "drape-scene(5)"], "")))


def pages(headers):
    overview = output_of("help")
    yield "drape.1", overview_page(overview)
    for verb, _, brief in verbs(overview):
        if verb != "drape":
            yield f"drape-{verb}.1", verb_page(overview, verb, brief)
    yield "drape-scene.5", scene_page()
    yield "drape.3", library_page(headers)


def date(changelog):
    """The date of the newest entry: 2026-11-21."""
    with open(changelog, encoding="utf-8") as file:
        day, month, year = re.search(r"^ -- .*>  \w+, (\d+) (\w+) (\d+)", file.read(), re.M).groups()
    months = "Jan Feb Mar Apr May Jun Jul Aug Sep Oct Nov Dec".split()
    return f"{year}-{months.index(month) + 1:02}-{int(day):02}"


if __name__ == "__main__":
    PROGRAM, DATE = os.path.abspath(sys.argv[1]), date(sys.argv[2])
    for file_name, content in pages(sys.argv[3:-1]):
        with open(os.path.join(sys.argv[-1], file_name), "w", encoding="utf-8") as out_file:
            out_file.write(content)
