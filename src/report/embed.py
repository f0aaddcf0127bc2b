"""embed.py OUT.c PAGE.html STYLE.css SCRIPT.js...: a page with its style and scripts as two C arrays, split where its data go.

PAGE.html has the lines <!-- style -->, <!-- data --> and <!-- scripts -->.
"""
import sys


def read(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


def array(name, text):
    data = text.encode("utf-8")
    lines = [", ".join(str(byte) for byte in data[i:i + 24]) for i in range(0, len(data), 24)]
    return (f"const unsigned char {name}[] = {{\n" + ",\n".join(lines) + "};\n"
            f"const size_t {name}_size = sizeof {name};\n")


out, page, style, *scripts = sys.argv[1:]
head, tail = read(page).split("<!-- data -->\n")
assert head.count("<!-- style -->\n") == 1 and tail.count("<!-- scripts -->\n") == 1, page
head = head.replace("<!-- style -->\n", "<style>\n" + read(style) + "</style>\n")
tail = tail.replace("<!-- scripts -->\n", "<script>\n'use strict';\n" + "\n".join(map(read, scripts)) + "</script>\n")
with open(out, "w", encoding="ascii") as file:
    file.write('#include "report/page.h"\n\n' + array("drape_page_head", head) + array("drape_page_tail", tail))
