#!/usr/bin/env python3
"""header.py HEADER: prints a public header as doxygen reads it. In the header comments are plain, /* ... */; this script marks them for doxygen.

- A comment on separate lines documents the declaration below it, and further declarations that follow without a blank line or another comment.
- A comment behind a declaration documents that declaration.
- /* ---- Title ---- */ begins a group, and the text below the title describes the group. Other comments with a blank line below belong to
  their group.

Lines keep their numbers, so that messages of doxygen name the right ones. `sections` gives manual.py the same content, in pieces.
"""
import re
import sys

SECTION = re.compile(r"-{4,} *(.*?)[ \n]*-{4,}\s*(.*)", re.S)


class Piece:
    """A comment and the code between it and the next one. behind: the comment follows code on the same line."""

    def __init__(self, comment, code, behind, first):
        self.comment, self.code, self.behind, self.first = comment, code, behind, first


def words(comment):
    """The text of /* ... */, without its stars."""
    lines = [re.sub(r"^\s*\* ?", "", line) if n else line for n, line in enumerate(comment[2:-2].split("\n"))]
    return "\n".join(line.strip() if not line.startswith("    ") else line.rstrip() for line in lines).strip("\n ")


def pieces(text):
    """The pieces of a header, which begins with a comment."""
    found, place = [], 0
    for match in re.finditer(r"/\*.*?\*/", text, re.S):
        if found:
            found[-1].code = text[place:match.start()]
        before = text[text.rfind("\n", 0, match.start()) + 1:match.start()]
        found.append(Piece(match.group(), "", before.strip() != "", not found))
        place = match.end()
    found[-1].code = text[place:]
    return found


def section_of(comment):
    """(title, text) of a comment that begins a section; None for other comments."""
    match = SECTION.match(words(comment)) if comment else None
    return (match[1].strip(), match[2].strip()) if match else None


def safe(text):
    """Escapes characters that mean something to doxygen."""
    for letter, code in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("#", "\\#"), ("@", "\\@"), ("*", "\\*")):
        text = text.replace(letter, code)
    return text


def marked(comment, begin):
    """The comment with another beginning and the same lines."""
    first, *others = comment[2:-2].split("\n")
    lines = [safe(first)]
    for line in others:
        star = re.match(r"\s*\*? ?", line).end()
        lines.append(line[:star] + safe(line[star:]))
    return begin + "\n".join(lines) + "*/"


def is_above_code(piece):
    """Whether the comment documents the declaration on the next line."""
    return re.match(r"\n[ \t]*([^\s#}]|#define)", piece.code) is not None and not piece.code.lstrip().startswith("DRAPE_C_")


def repeated(piece):
    """The code of a piece, with its comment repeated before each further declaration that follows without a blank line, except one on the line of the
    next comment."""
    block, rest = re.match(r"\n(.*?)(\n\s*\n.*|\n[^\n]*\Z|\Z)", piece.code, re.S).groups()
    if block.startswith(("typedef struct", "typedef enum")):
        return piece.code
    again = f"/** {safe(re.sub(chr(10), ' ', words(piece.comment)))} */ "
    ends = r"(\n)(?=#define)" if block.startswith("#define") else r"(;\n *)(?=[^ }])"
    return "\n" + re.sub(ends, lambda end: end[1] + again, block) + rest


FIELDS = re.compile(r"( *)((?:const )?\w+(?: \w+)*) (\*?\w+(?:\[\w+\])?(?:, \*?\w+(?:\[\w+\])?)+);\s*$")


def each_field(code, comment):
    """`double a, b;` as `double a; double b;`, each with the comment that follows both; None for other code. Keeps the number of lines."""
    place = code.rfind("\n") + 1
    fields = FIELDS.match(code[place:])
    if not fields:
        return None
    said = marked(comment, "/** ").replace("\n", " ")
    return code[:place] + " ".join(f"{said} {fields[2]} {name};" for name in fields[3].split(", ")) + "\n" * comment.count("\n")


def for_doxygen(text, name):
    out, groups = [], 0
    for piece in pieces(text):
        code, section = piece.code, section_of(piece.comment)
        if piece.first:
            out.append(marked(piece.comment, "/** @file "))
        elif section:
            groups += 1
            out.append(f"/** {'@} */ /** ' if groups > 1 else ''}@defgroup {re.sub('[^a-z]', '_', name)}_{groups} {section[0]}\n"
                       + " ".join(safe(section[1]).split("\n")) + " @{ */" + "\n" * (piece.comment.count("\n") - 1))
            code = code if piece.comment.count("\n") else code[1:]
        elif piece.behind and each_field(out[-1], piece.comment):
            out[-1] = each_field(out[-1], piece.comment)
        elif piece.behind:
            out.append(marked(piece.comment, "/**< "))
        elif is_above_code(piece):
            out.append(marked(piece.comment, "/** "))
            code = repeated(piece)
        else:
            out.append(piece.comment)
        out.append(code)
    whole = "".join(out)
    end = whole.rfind("DRAPE_C_END") if groups else len(whole)
    return whole[:end] + ("/** @} */ " if groups else "") + whole[end:]


def sections(text):
    """The declarations of a header, for manual pages: [(title, text, [(comment, declaration)])]."""
    found = [("", "", [])]
    for piece in pieces(text):
        section = section_of(piece.comment)
        if section:
            found.append((*section, []))
        elif piece.comment and not piece.behind and not piece.first and is_above_code(piece):
            block = re.split(r"\n[ \t]*\n", re.sub(r"/\*.*", "", piece.code, flags=re.S).strip("\n"))[0]
            found[-1][2].append((words(piece.comment), block))
        elif piece.comment and not piece.behind and not piece.first and re.match(r"\n\s*\n", piece.code):
            found[-1][2].append((words(piece.comment), ""))
    return found


if __name__ == "__main__":
    with open(sys.argv[1], encoding="utf-8") as file:
        sys.stdout.write(for_doxygen(file.read(), sys.argv[1].rsplit("/", 1)[-1]))
