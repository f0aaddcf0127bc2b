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
with open(os.path.join(SOURCE, "tests", "abi", "drape-1.abi")) as file:
    LAST = file.read()


def struct(name, change):
    """LAST with `change` applied to the lines of a struct."""
    start = LAST.index(f"<class-decl name='{name}'")
    end = LAST.index("</class-decl>", start)
    return LAST[:start] + change(LAST[start:end]) + LAST[end:]


def shorter(text):
    """A struct without its last member, 64 bits smaller."""
    text = re.sub(r"size-in-bits='(\d+)'", lambda match: f"size-in-bits='{int(match[1]) - 64}'", text, count=1)
    return text[:text.rindex("<data-member")]


def without_function(name):
    text = re.sub(rf" *<elf-symbol name='{name}'.*\n", "", LAST)
    return re.sub(rf" *<function-decl name='{name}'.*?</function-decl>\n", "", text, flags=re.S)


def argument_of_another_type(text):
    """The argument `node` of drape_sim_set_drag_spring has another type."""
    start = text.index("<function-decl name='drape_sim_set_drag_spring'")
    end = text.index("</function-decl>", start)
    kinds = re.findall(r"<parameter type-id='([^']+)'", text[start:end])
    return text[:start] + text[start:end].replace(f"'{kinds[1]}'", f"'{kinds[2]}'", 1) + text[end:]


CASES = [
    ("the_interface_is_that_of_the_last_release", 0, LAST),
    ("a_function_may_be_added", 0, without_function("drape_sim_cancel")),
    ("a_def_may_grow", 0, struct("drape_sim_def", shorter)),
    ("a_function_may_not_go", 1, LAST.replace("drape_sim_cancel", "drape_sim_interrupt")),
    ("a_result_may_not_grow", 1, struct("drape_statistics", shorter)),
    ("a_member_may_not_move", 1, struct("drape_energy", lambda text: text.replace("layout-offset-in-bits='64'", "layout-offset-in-bits='128'"))),
    ("an_argument_may_not_change", 1, argument_of_another_type(LAST)),
]


def main():
    failed = 0
    print(f"1..{len(CASES)}")
    for number, (name, expected, dump) in enumerate(CASES, 1):
        with tempfile.NamedTemporaryFile("w", suffix=".abi") as file:
            file.write(dump)
            file.flush()
            done = subprocess.run([os.path.join(SOURCE, "tools", "abi"), "--against", file.name, LIBRARY], text=True,
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        if done.returncode == 77:
            print(f"ok {number} - {name} # SKIP {done.stdout.strip()}")
            continue
        good = done.returncode == expected and (number == 1 or dump != LAST)
        failed += not good
        print("" if good else "".join(f"# {line}\n" for line in done.stdout.splitlines()), end="")
        print(f"{'ok' if good else 'not ok'} {number} - {name}")
    return failed > 0


if __name__ == "__main__":
    sys.exit(main())
