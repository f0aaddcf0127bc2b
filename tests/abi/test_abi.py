#!/usr/bin/env python3
"""test_abi.py: the library keeps the interface of the last release (tools/abi), and tools/abi detects breaks: it is tried on altered dumps, which
this library breaks or only extends. Output is TAP; skipped without libabigail."""
import os
import re
import subprocess
import sys
import tempfile

SOURCE, BUILD = os.environ["DRAPE_SOURCE"], os.environ["DRAPE_BUILD"]
LIBRARY = os.path.join(BUILD, "src", "libdrape.so.1")
DUMP = os.path.join("tests", "abi", "drape-1.abi")
with open(os.path.join(SOURCE, DUMP), encoding="utf-8") as file:
    LAST = file.read()


class Missing(Exception):
    """The last release has no such function or struct, so no altered dump can be made of it."""


def find(text, start):
    """The position in a dump at which a text starts."""
    if text not in LAST[start:]:
        raise Missing(f"{DUMP} has no {text}: if the library dropped or renamed it on purpose, run tools/abi --update and mend this test")
    return LAST.index(text, start)


def struct(name, change):
    """LAST with `change` applied to the lines of a struct."""
    start = find(f"<class-decl name='{name}'", 0)
    end = find("</class-decl>", start)
    return LAST[:start] + change(LAST[start:end]) + LAST[end:]


def shorter(text):
    """A struct without its last member, 64 bits smaller."""
    text = re.sub(r"size-in-bits='(\d+)'", lambda match: f"size-in-bits='{int(match[1]) - 64}'", text, count=1)
    return text[:text.rindex("<data-member")]


def without_function(name):
    find(f"<function-decl name='{name}'", 0)
    text = re.sub(rf" *<elf-symbol name='{name}'.*\n", "", LAST)
    return re.sub(rf" *<function-decl name='{name}'.*?</function-decl>\n", "", text, flags=re.S)


def renamed(name, other):
    find(f"<function-decl name='{name}'", 0)
    return LAST.replace(name, other)


def argument_of_another_type(name):
    """The second argument of a function has the type of the third."""
    start = find(f"<function-decl name='{name}'", 0)
    end = find("</function-decl>", start)
    kinds = re.findall(r"<parameter type-id='([^']+)'", LAST[start:end])
    return LAST[:start] + LAST[start:end].replace(f"'{kinds[1]}'", f"'{kinds[2]}'", 1) + LAST[end:]


def moved(text):
    """A struct whose second member is elsewhere."""
    return re.sub(r"layout-offset-in-bits='(32|64)'", "layout-offset-in-bits='128'", text, count=1)


CASES = [
    ("the_interface_is_that_of_the_last_release", 0, lambda: LAST),
    ("a_function_may_be_added", 0, lambda: without_function("drape_sim_cancel")),
    ("a_def_may_grow", 0, lambda: struct("drape_sim_def", shorter)),
    ("a_function_may_not_go", 1, lambda: renamed("drape_sim_cancel", "drape_sim_interrupt")),
    ("a_result_may_not_grow", 1, lambda: struct("drape_statistics", shorter)),
    ("a_member_may_not_move", 1, lambda: struct("drape_energy", moved)),
    ("a_member_of_a_view_may_not_move", 1, lambda: struct("drape_cloth_view", moved)),
    ("an_argument_may_not_change", 1, lambda: argument_of_another_type("drape_sim_set_drag_spring")),
]


def abi(*arguments):
    """The exit code of tools/abi, and what it said."""
    done = subprocess.run([os.path.join(SOURCE, "tools", "abi"), *arguments], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    return done.returncode, done.stdout


def main(folder):
    failed, last, now = 0, folder + "/last.abi", folder + "/now.abi"
    code, said = abi("--update", "--against", now, LIBRARY)
    if code == 77:
        print("1..0 # SKIP", said.strip())
        return 0
    print(f"1..{len(CASES)}")
    for number, (name, expected, make) in enumerate(CASES, 1):
        try:
            dump = make()
            with open(last, "w", encoding="utf-8") as copy:
                copy.write(dump)
            code, said = abi("--against", last, now) if os.path.exists(now) else (code, said)
        except Missing as missing:
            failed += 1
            print(f"# {missing}\nnot ok {number} - {name}")
            continue
        good = code == expected and (number == 1 or dump != LAST)
        failed += not good
        print("" if good else "".join(f"# {line}\n" for line in said.splitlines()), end="")
        print(f"{'ok' if good else 'not ok'} {number} - {name}")
    return failed > 0


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        sys.exit(main(temporary))
