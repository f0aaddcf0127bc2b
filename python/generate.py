#!/usr/bin/env python3
"""generate.py BINDING CHECK HEADER...: writes the Python binding of public headers, and a C file that checks it.

BINDING declares every struct, enumerator, function type and function of the headers to ctypes, with their comments as documentation, so nothing
is repeated by hand. CHECK includes the headers and declares all of it once more, as it was understood here, with the sizes and offsets that
ctypes computed: it compiles if and only if both agree. Declarations that this script does not understand end it with a message.
"""
import ctypes
import importlib.util
import keyword
import os
import re
import sys

# C type, ctypes type, annotation in Python.
BASE = {"double": ("c_double", "float"), "float": ("c_float", "float"), "int": ("c_int", "int"), "unsigned": ("c_uint", "int"), "char": ("c_char", "str"),
        "int32_t": ("c_int32", "int"), "int64_t": ("c_int64", "int"), "uint8_t": ("c_uint8", "int"), "uint64_t": ("c_uint64", "int"),
        "size_t": ("c_size_t", "int"), "bool": ("c_bool", "bool"), "void": (None, "None")}


class Type:
    """A type: base, whether that is const, for each star whether the pointer is const, lengths of arrays, and for a function its parameters."""

    def __init__(self, base, const, stars=(), lengths=(), parameters=None, variadic=False):
        self.base, self.const, self.stars, self.lengths = base, const, tuple(stars), tuple(lengths)
        self.parameters, self.variadic = parameters, variadic

    def c(self, name=""):
        text = ("const " if self.const else "") + self.base + " " + "".join("*const " if const else "*" for const in self.stars)
        if self.parameters is None:
            return text + name + "".join(f"[{length}]" for length in self.lengths)
        arguments = [p.c(n) for n, p in self.parameters] + ["..."] * self.variadic
        return f"{text}(*{name})({', '.join(arguments) or 'void'})"


class Header:
    """The declarations of headers, in order."""

    def __init__(self):
        self.macros, self.enums, self.structs, self.opaque, self.callbacks, self.functions, self.docs = {}, {}, {}, [], {}, {}, {}
        self.order = []  # names of structs and function types, as declared

    # ---- Reading ----

    def read(self, text):
        for name, value in re.findall(r"^#define (DRAPE_[A-Z_]+) +(\d+)\b", text, re.M):
            self.macros[name] = int(value)
        text = re.sub(r"^[ \t]*#(?:[^\n\\]|\\\n|\\.)*", "", text, flags=re.M)
        text = re.sub(r"\bDRAPE_API\b|\bDRAPE_C_(BEGIN|END)\b|\bDRAPE_PRINTF\([^)]*\)", "", text)
        comment, depth, code, place = "", 0, "", 0
        while place < len(text):
            match = re.compile(r"\s*/\*(.*?)\*/[ \t]*(\n[ \t]*\n)?", re.S).match(text, place)
            if match and not code.strip():
                comment = "" if match[2] else words(match[1])
                place = match.end()
                continue
            letter = text[place]
            if text.startswith("/*", place):
                end = text.index("*/", place) + 2
                code += text[place:end]
                place = end
                continue
            depth += (letter == "{") - (letter == "}")
            code += letter
            place += 1
            if letter == ";" and depth == 0:
                self.declaration(code, comment)
                code = ""
                if re.match(r"[^\n]*\n[ \t]*\n", text[place:]):
                    comment = ""

    def declaration(self, code, comment):
        bare = re.sub(r" +;", ";", " ".join(re.sub(r"/\*.*?\*/", " ", code, flags=re.S).split()))
        match = re.match(r"typedef struct (\w+) (\w+);$", bare)
        if match and match[1] == match[2]:
            self.opaque.append(match[1])
            self.docs[match[1]] = comment
            return
        match = re.match(r"typedef struct (\w+) ?\{(.*)\} (\w+);$", bare)
        if match and match[1] == match[3]:
            inner = code[code.index("{") + 1:code.rindex("}")]
            self.structs[match[1]] = [(name, kind, doc) for name, kind, doc in self.fields(inner)]
            self.order.append(match[1])
            self.docs[match[1]] = comment
            return
        match = re.match(r"(?:typedef )?enum ?(\w*) ?\{(.*)\} ?(\w*);$", bare)
        if match:
            inner = code[code.index("{") + 1:code.rindex("}")]
            self.enums[match[3] or f"_{len(self.enums)}"] = self.enumerators(inner)
            self.docs[match[3]] = comment
            return
        match = re.match(r"typedef (.*?)(\w+)\((.*)\);$", bare)
        if match:
            self.callbacks[match[2]] = self.function(match[1], match[3])
            self.order.append(match[2])
            self.docs[match[2]] = comment
            return
        match = re.match(r"(.*?)(\w+)\((.*)\);$", bare)
        if not match or "{" in bare:
            sys.exit(f"generate.py: a declaration that is not understood: {bare}")
        self.functions[match[2]] = self.function(match[1], match[3])
        self.docs[match[2]] = comment

    def function(self, result, parameters):
        kind = self.declarators(result + " x")[0][1]
        kind.parameters, kind.variadic = [], False
        for text in split(parameters):
            if text == "...":
                kind.variadic = True
            elif text != "void":
                name, parameter = self.declarators(text)[0]
                kind.parameters.append((name, parameter))
        return kind

    def declarators(self, text):
        """(name, type) of each of `const double *a, b[3]`, or of a pointer to a function."""
        text = " ".join(text.split())
        match = re.match(r"(.*?)\(\*(\w+)\)\((.*)\)$", text)
        if match:
            return [(match[2], self.function(match[1], match[3]))]
        match = re.match(r"(const )?((?:struct )?\w+) ?(.*)$", text)
        found = []
        for part in split(match[3]):
            shape = re.match(r"((?:\* ?(?:const )?)*)(\w+) ?((?:\[\w+\])*)$", part)
            if not shape:
                sys.exit(f"generate.py: a declarator that is not understood: {text}")
            stars = ["const" in star for star in re.findall(r"\* ?(?:const)?", shape[1])]
            lengths = [int(self.macros.get(n, n)) for n in re.findall(r"\[(\w+)\]", shape[3])]
            found.append((shape[2], Type(match[2], bool(match[1]), stars, lengths)))
        return found

    def fields(self, inner):
        """(name, type, comment) of each member. A comment on lines of its own is about the next member, one behind a member about that."""
        above, result = "", []
        for match in re.finditer(r"\s*(?:/\*(.*?)\*/|((?:[^;/]|/\*.*?\*/)*;)([ \t]*/\*(.*?)\*/)?)", inner, re.S):
            if match[1] is not None:
                above = words(match[1])
                continue
            code = re.sub(r"/\*.*?\*/", " ", match[2], flags=re.S).rstrip("; ")
            doc = words(match[4]) if match[3] else above
            result += [(name, kind, doc) for name, kind in self.declarators(code)]
            above = above if not match[3] and re.match(r"\n[ \t]*[^\s/]", inner[match.end():]) else ""
        return result

    def enumerators(self, inner):
        result, value = [], 0
        for match in re.finditer(r"(\w+)(?: *= *(-?\d+))?\s*,?\s*(?:/\*(.*?)\*/)?", inner, re.S):
            value = int(match[2]) if match[2] else value
            result.append((match[1], value, words(match[3] or "")))
            value += 1
        return result

    # ---- As Python ----

    def simple(self, base):
        return "c_int" if base in self.enums else BASE[base][0]

    def ctype(self, kind, field=False):
        """The type for ctypes. Pointers to numbers and handles are plain addresses; texts are bytes; pointers to structs have their type."""
        if kind.parameters is not None:
            arguments = [self.ctype(p) for _, p in kind.parameters]
            return f"CFUNCTYPE({', '.join([str(self.ctype(Type(kind.base, kind.const, kind.stars)))] + arguments)})"
        stars = len(kind.stars) + (len(kind.lengths) if not field else 0)
        if not stars:
            text = kind.base if kind.base in self.structs or kind.base in self.callbacks else self.simple(kind.base)
        elif kind.base in self.callbacks and stars == 1:
            text = kind.base
        elif kind.base in self.structs:
            text = kind.base if stars == 1 else f"POINTER({kind.base})"
            text = f"POINTER({text})"
        elif kind.base == "char" and kind.const:
            text = "c_char_p" if stars == 1 else "POINTER(c_char_p)"
        else:
            text = "c_void_p" if stars == 1 else "POINTER(c_void_p)"
        for length in kind.lengths if field else ():
            text += f" * {length}"
        return text

    def annotation(self, kind):
        if kind.base == "char":
            return "str"
        text = camel(kind.base) if kind.base in self.structs else "Status" if kind.base == "drape_status" else BASE.get(kind.base, (None, "int"))[1]
        return f"Tuple[{', '.join([text] * kind.lengths[0])}]" if kind.lengths else text

    def is_record(self, name):
        """Whether a struct is plain data that the library fills: numbers, texts, and structs of these."""
        return all(field != "struct_size" and kind.parameters is None and kind.base not in self.callbacks
                   and (not kind.stars or kind.base == "char" and len(kind.stars) == 1) and (kind.base not in self.structs or self.is_record(kind.base))
                   for field, kind, _ in self.structs[name])

    def python(self):
        out = ['"""Declarations of the public headers for ctypes. Generated by generate.py; do not edit."""',
               "from ctypes import (CFUNCTYPE, POINTER, Structure, c_bool, c_char, c_char_p, c_double, c_float, c_int, c_int32, c_int64, c_size_t, c_uint,",
               "                    c_uint8, c_uint64, c_void_p)", "from enum import IntEnum", "from typing import NamedTuple, Tuple", ""]
        out += [f"{name} = {value}" for name, value in self.macros.items()]
        for name, values in self.enums.items():
            if name.startswith("_"):
                out += [f"{key} = {value}" for key, value, _ in values]
                continue
            prefix = os.path.commonprefix([key for key, _, _ in values])
            prefix = prefix[:prefix.rfind("_") + 1] if name != "drape_status" else "DRAPE_"
            out += ["", "", f"class {camel(name)}(IntEnum):", f"    {self.docs[name]!r}"]
            out += [f"    {key[len(prefix):]} = {value}  # {' '.join(doc.split())}".rstrip("# ") for key, value, doc in values]
        for name in self.order:
            out += [""]
            if name in self.callbacks:
                out += [f"{name} = {self.ctype(self.callbacks[name])}"]
                continue
            out += ["", f"class {name}(Structure):", f"    {self.docs[name]!r}", "    _fields_ = ["]
            out += [f"        ({field!r}, {self.ctype(kind, True)})," for field, kind, _ in self.structs[name]] + ["    ]"]
            if self.is_record(name):
                out += ["", "", f"class {camel(name)}(NamedTuple):", f"    {self.docs[name]!r}"]
                ignore = {field: "  # type: ignore[assignment]" for field in ("count", "index")}  # tuples have methods of these names
                out += [f"    {python_name(field)}: {self.annotation(kind)}{ignore.get(field, '')}" for field, kind, _ in self.structs[name]]
                out += [""] + [f"{camel(name)}.{python_name(field)}.__doc__ = {' '.join(doc.split())!r}" for field, _, doc in self.structs[name] if doc]
        out += ["", "", "RECORDS = {"] + [f"    {name}: {camel(name)}," for name in self.order if name in self.structs and self.is_record(name)] + ["}"]
        out += ["", "# Name: (result, arguments).", "FUNCTIONS = {"]
        for name, kind in self.functions.items():
            arguments = "".join(f"{self.ctype(p)}, " for _, p in kind.parameters)
            out += [f"    {name!r}: ({self.ctype(Type(kind.base, kind.const, kind.stars))}, ({arguments})),"]
        out += ["}", "", "# The comments of the header.", "DOCS = {"]
        out += [f"    {name!r}: {text!r}," for name, text in self.docs.items() if text and name in self.functions] + ["}"]
        return "\n".join(out) + "\n"

    # ---- As C ----

    def check(self, module, headers):
        out = ["/* Compiles if and only if the binding agrees with the headers. Generated by generate.py; do not edit. */"]
        out += [f'#include "drape/{os.path.basename(header)}"' for header in headers]
        out += ["#include <limits.h>"]
        for base, (ctype, _) in BASE.items():
            if ctype:
                out += [f"_Static_assert(sizeof({base}) == {ctypes.sizeof(getattr(ctypes, ctype))}, \"{base}\");"]
        for name, values in self.enums.items():
            if not name.startswith("_"):
                out += [f'_Static_assert(sizeof({name}) == sizeof(int), "{name}");']
            out += [f'_Static_assert({key} == {value}, "{key}");' for key, value, _ in values]
            # A switch over all of them: -Wswitch names an enumerator that is missing here.
            if not name.startswith("_"):
                cases = " ".join(f"case {key}:" for key, _, _ in values)
                out += [f"int check_all_of_{name}({name} value);", f"int check_all_of_{name}({name} value)", "{", f"    switch (value) {{ {cases} return 1; }}", "    return 0;", "}"]
        for name, fields in self.structs.items():
            struct = getattr(module, name)
            out += [f'_Static_assert(sizeof({name}) == {ctypes.sizeof(struct)}, "{name}");']
            for field, kind, _ in fields:
                place = getattr(struct, field)
                out += [f'_Static_assert(offsetof({name}, {field}) == {place.offset}, "{name}.{field}");',
                        f'_Static_assert(sizeof((({name} *)0)->{field}) == {place.size}, "{name}.{field}");']
                if kind.lengths:  # the pointer to an array has the lengths in its type
                    out += [f"extern {Type(kind.base, kind.const, kind.stars).c()}(*check_{name}__{field}){''.join(f'[{n}]' for n in kind.lengths)};",
                            f"extern __typeof__(&(({name} *)0)->{field}) check_{name}__{field};"]
                else:
                    out += [f"extern {kind.c(f'check_{name}__{field}')};", f"extern __typeof__((({name} *)0)->{field}) check_{name}__{field};"]
        for name, kind in self.callbacks.items():
            out += [f"extern {kind.c(f'check_{name}')};", f"extern {name} *check_{name};"]
        for name, kind in self.functions.items():
            out += [f"extern {kind.c(f'check_{name}')};", f"extern __typeof__(&{name}) check_{name};"]
        return "\n".join(out) + "\n"


def words(comment):
    """The text of a comment, without its stars; nothing for the title of a section."""
    text = "\n".join(re.sub(r"^\s*\* ?", "", line) if n else line for n, line in enumerate(comment.split("\n"))).strip()
    return "" if text.startswith("----") else "\n".join(line.strip() for line in text.split("\n"))


def split(text):
    """Parts between commas that are outside of parentheses."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter in "([") - (letter in ")]")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts if part.strip()]


def camel(name):
    return "".join(word.capitalize() for word in name[len("drape_"):].split("_"))


def python_name(field):
    return field + "_" if keyword.iskeyword(field) else field


def main(binding, check, headers):
    header = Header()
    for path in headers:
        with open(path, encoding="utf-8") as file:
            header.read(file.read())
    with open(binding, "w", encoding="utf-8") as file:
        file.write(header.python())
    spec = importlib.util.spec_from_file_location("binding", binding)
    module = importlib.util.module_from_spec(spec)
    sys.dont_write_bytecode = True
    spec.loader.exec_module(module)
    with open(check, "w", encoding="utf-8") as file:
        file.write(header.check(module, headers))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3:])
