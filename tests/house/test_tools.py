#!/usr/bin/env python3
"""test_tools.py ROOT: a tool that is called with an unknown value refuses it in one line that names it and what is allowed. Output is TAP."""
import os
import re
import subprocess
import sys

# A call and a pattern of what it says; the exit status is 2, or 1 of tools/test, which also counts a failure on stdout.
CALLS = {
    "press --methods be,x": r"tools/press: --methods: 'x' is none of be, bdf2, .*, ida",
    "press --kinds x": r"tools/press: --kinds: 'x' is none of tip, blade, .*",
    "press --drape /nowhere/drape": r"tools/press: --drape: there is no /nowhere/bench/press; .*",
    "kills --cases x": r"tools/kills: --cases: 'x' is none of .*",
    "hashes x": r"tools/hashes: unknown argument 'x'; there is --help",
    "test --x": r"tools/test: unknown option '--x'; there are --sanitize, .*",
    "install-deps --x": r"tools/install-deps: unknown option '--x'; there are --test, .*",
    "abi --x": r"tools/abi: unknown option '--x'; the options are --update, .*",
    "format --x": r"tools/format: unknown option '--x'; there is --check",
}


def main(root):
    print(f"1..{len(CALLS)}")
    failed = 0
    for number, (call, says) in enumerate(CALLS.items(), 1):
        tool, *arguments = call.split()
        result = subprocess.run([os.path.join(root, "tools", tool), *arguments], capture_output=True, text=True, timeout=60, check=False)
        good = result.returncode in (1, 2) and re.fullmatch(says + r"\n", result.stderr)
        print(f"{'ok' if good else 'not ok'} {number} - tools/{call}")
        if not good:
            print(f"# exit status {result.returncode}: " + result.stderr.rstrip().replace("\n", "\n# "))
        failed += not good
    return failed > 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
