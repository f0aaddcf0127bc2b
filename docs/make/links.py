#!/usr/bin/env python3
"""links.py SOURCES DOCUMENTATION HEADERS: makes the links of installed pages hold. `meson install` runs it, with the folders of the installed pages and
headers relative to the prefix. A link to a header leads to the installed one; one to a file of the sources that is not installed becomes its text and
the name of the file, or that name alone if the text is a part of it.
"""
import os
import re
import sys

sys.dont_write_bytecode = True  # whoever installs may not write here
from page import CODE  # noqa: E402  pylint: disable=wrong-import-position

LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)#:\s]+)(#[^)]*)?\)")


class Page:
    """A page at `path`, which was in the folder `at` of the sources."""

    def __init__(self, path, at, headers):
        self.path, self.folder, self.at, self.headers = path, os.path.dirname(path), at, headers

    def held(self, link):
        text, target, heading = link[1], link[2], link[3] or ""
        if os.path.exists(os.path.join(self.folder, target)):
            return link[0]
        source = os.path.normpath(os.path.join(self.at, target)).replace(os.sep, "/")
        header = os.path.join(self.headers, os.path.relpath(source, "include/drape"))
        if source.startswith("include/drape/") and os.path.exists(header):
            return f"[{text}]({os.path.relpath(header, self.folder).replace(os.sep, '/')}{heading})"
        return f"`{source}` of the sources" if text in source else f"{text} (`{source}` of the sources)"

    def rewrite(self):
        with open(self.path, encoding="utf-8") as file:
            parts = CODE.split(file.read())
        # Code stays unchanged: a mark that no page contains replaces it, also inside the text of a link.
        text = "".join(part if n % 2 == 0 else f"\0{n // 2}\0" for n, part in enumerate(parts))
        text = re.sub("\0(\\d+)\0", lambda mark: parts[2 * int(mark[1]) + 1], LINK.sub(self.held, text))
        with open(self.path, "w", encoding="utf-8") as file:
            file.write(text)


def main(sources, documentation, headers):
    prefix = os.environ["MESON_INSTALL_DESTDIR_PREFIX"]
    documentation, headers = os.path.join(prefix, documentation), os.path.join(prefix, headers)
    for folder, _, names in os.walk(documentation):
        at = os.path.relpath(folder, documentation)
        for name in names:
            if name.endswith(".md") and os.path.exists(os.path.join(sources, at, name)):
                Page(os.path.join(folder, name), at, headers).rewrite()


if __name__ == "__main__":
    main(*sys.argv[1:])
