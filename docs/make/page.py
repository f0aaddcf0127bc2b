#!/usr/bin/env python3
"""page.py ROOT PAGE: prints a page as doxygen reads it. Links to pages, headings, headers and files of the tree become links within the site, which is
one folder with pictures in images/ and files of the tree in files/.
"""
import os
import re
import sys

PAGES = {"README.md": "readme", "CONTRIBUTING.md": "contributing", "CHANGELOG.md": "changelog", "src/README.md": "source"}
CODE = re.compile(r"(^ *```.*?^ *```$|`[^`\n]+`)", re.S | re.M)


def label(path):
    """The label of a page; None for other files."""
    if path in PAGES:
        return "page_" + PAGES[path]
    return "page_" + os.path.basename(path)[:-3] if re.fullmatch(r"docs/\w+\.md", path) else None


def slug(heading):
    return re.sub(r" ", "-", re.sub(r"[^\w\- ]", "", re.sub(r"[`*]", "", heading).strip().lower()))


def anchor(path, heading):
    return label(path) + "_" + re.sub(r"\W", "_", slug(heading))


def link(page, text, target):
    text = " ".join(text.split())  # doxygen does not end a list after a reference of two lines
    if re.match(r"https?:", target):
        return f"[{text}]({target})"
    path, _, heading = target.partition("#")
    path = os.path.normpath(os.path.join(os.path.dirname(page), path)) if path else page
    if re.fullmatch(r"include/drape/\w+\.h", path):
        return f"[{text}](@ref {os.path.basename(path)})"
    if label(path):
        return f"[{text}](@ref {anchor(path, heading) if heading else label(path)})"
    return f'<a href="files/{path}">{text}</a>'


def prose(page, text):
    text = re.sub(r"!\[([^\]]*)\]\(([^)]+)\)", lambda m: f'<img src="images/{os.path.basename(m[2])}" alt="{m[1]}"/>', text)
    return re.sub(r"(?<!!)\[([^\]]+)\]\(([^)\s]+)\)", lambda m: link(page, m[1], m[2]), text)


def headings(page, text):
    """Gives each heading a label, as doxygen does not have those of GitHub."""
    text = re.sub(r"^# (.*)$", lambda m: f"# {m[1]} {{#{label(page)}}}", text, count=1, flags=re.M)
    return re.sub(r"^(##+) (.*)$", lambda m: f"{m[1]} {m[2]} {{#{anchor(page, m[2])}}}", text, flags=re.M)


def for_doxygen(page, text):
    parts = CODE.split(re.sub(r"^ *<!--.*?-->\n", "", text, flags=re.S | re.M))
    # Code stays unchanged: a mark that no page contains replaces it, also inside the text of a link.
    kept = parts[1::2]
    marked = "".join(part if n % 2 == 0 else f"\0{n // 2}\0" for n, part in enumerate(parts))
    marked = prose(page, marked)
    return headings(page, re.sub("\0(\\d+)\0", lambda m: kept[int(m[1])], marked))


if __name__ == "__main__":
    root, path_of_page = sys.argv[1], os.path.relpath(os.path.abspath(sys.argv[2]), os.path.abspath(sys.argv[1]))
    with open(sys.argv[2], encoding="utf-8") as file:
        sys.stdout.write(for_doxygen(path_of_page, file.read()))
