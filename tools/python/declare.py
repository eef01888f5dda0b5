#!/usr/bin/env python3
"""Translates the public headers to ctypes: declare.py INCLUDE_FOLDER [OUTPUT]

Writes the module ebpo/_declared.py: each struct, enumeration, constant, function and initial value
(EBPO_..._INIT) of lib/include/ebpo/*.h. So no declaration is written by hand. The program supports only the
C constructs of these headers, and stops at others. tests/python/test_declared.py compares sizes, offsets and
initial values with those of the C compiler.
"""
import pathlib
import re
import sys

HEAD = '''"""The C interface as ctypes, made from the public headers by tools/python/declare.py."""
# fmt: off
import enum
from ctypes import (CFUNCTYPE, c_bool, c_char, c_char_p, c_double, c_float, c_int, c_int16, c_int32,
                    c_int64, c_int8, c_size_t, c_uint, c_uint16, c_uint32, c_uint64, c_uint8, c_void_p,
                    sizeof)

from ._checked import Structure

INIT: dict = {}
FUNCTIONS: dict = {}
'''

SCALARS = {"bool": "c_bool", "int": "c_int", "unsigned": "c_uint", "size_t": "c_size_t", "char": "c_char",
           "double": "c_double", "float": "c_float"}
SCALARS.update({f"{u}int{bits}_t": f"c_{u}int{bits}" for u in ("", "u") for bits in (8, 16, 32, 64)})
LITERALS = {"true": True, "false": False, "NULL": None, "UINT64_MAX": 2**64 - 1, "UINT32_MAX": 2**32 - 1}


class Unknown(Exception):
    """Raised for C text that the translator does not support."""


def text_of(header, seen):
    """Return the text of a header, without comments, after the headers that it includes. Each header occurs once."""
    if header in seen:
        return ""
    seen.add(header)
    text = re.sub(r"/\*.*?\*/", " ", header.read_text(encoding="utf-8"), flags=re.S)
    text = text.replace("\\\n", " ")
    included = "".join(text_of(header.parent.parent / name, seen)
                       for name in re.findall(r"#include <(ebpo/\w+\.h)>", text))
    return included + text


def value_of(text, known):
    """Return the value of a C expression or initializer: a number, or a list of values."""
    python = re.sub(r"\b(?:UINT64_C|INT64_C)\((\w+)\)", r"\1", text)
    python = re.sub(r"\b(0[xX][0-9a-fA-F]+|\d+)[uUlL]+\b", r"\1", python)
    python = python.replace("~0u", "0xffffffff").replace("__builtin_inf()", "INFINITY")
    python = re.sub(r"~0\b", "0xffffffff", python)
    python = re.sub(r"EBPO_SIZED\((\w+)\)", r"{ sizeof(\1) }", python)
    python = re.sub(r"sizeof\((\w+)\)", r"sizeof('\1')", python)
    python = python.replace("{", "[").replace("}", "]")
    names = dict(known, **LITERALS, INFINITY=float("inf"), sizeof=lambda name: f"sizeof({name})")
    try:
        return eval(python, {"__builtins__": {}}, names)  # the text is from the project's headers
    except Exception as error:
        raise Unknown(f"{text.strip()}: {error}") from None


def written(value):
    """Return a value as Python text."""
    if isinstance(value, list):
        return "[" + ", ".join(map(written, value)) + "]"
    if isinstance(value, str):
        return value if value.startswith("sizeof(") else repr(value.encode())
    return repr(value).replace("inf", 'float("inf")') if isinstance(value, float) else repr(value)


class Headers:
    def __init__(self, text):
        self.lines, self.known, self.types, self.macros = [HEAD], {}, dict(SCALARS), []
        self.macros = re.findall(r"^#define (EBPO_\w+) +(.+)$", text, flags=re.M)
        text = re.sub(r"^#.*$", "", text, flags=re.M)
        text = re.sub(r'extern "C" \{|template <.*?^\}', "", text, flags=re.S | re.M)
        self.body = re.sub(r"\bEBPO_MUST_USE\b|\bEBPO_PRINTF\([^)]*\)", "", text)

    def declared(self):
        self.constants()
        opaque = re.findall(r"typedef struct (\w+) \1;", self.body)
        self.types.update({name: None for name in opaque})
        pattern = (r"typedef enum (?P<enum>\w+) \{(?P<members>.*?)\} \w+;|enum \{(?P<nameless>[^}]*)\};"
                   r"|typedef struct (?P<struct>\w+) \{(?P<fields>.*?)\} \w+;"
                   r"|typedef (?P<result>\w+) \(\*(?P<callback>\w+)\)\((?P<taken>.*?)\);"
                   r"|EBPO_API (?P<function>[^;]*?);")
        for found in re.finditer(pattern, self.body, flags=re.S):
            if found["enum"]:
                self.enumeration(found["enum"], found["members"])
            elif found["nameless"]:
                self.members_of(found["nameless"])
            elif found["struct"]:
                self.struct(found["struct"], found["fields"])
            elif found["callback"]:
                self.types[found["callback"]] = found["callback"]
                self.lines.append(f"{found['callback']} = "
                                  + self.pointer_to_function(found["result"], found["taken"]))
            else:
                self.function(" ".join(found["function"].split()))
        self.initial_values()
        return "\n".join(self.lines) + "\n"

    def constants(self):
        for name, text in self.macros:
            if not re.search(r"_INIT$", name) and re.fullmatch(r"-?\d+|UINT\d+_MAX", text.strip()):
                self.constant(name, value_of(text, self.known))

    def constant(self, name, value):
        self.known[name] = value
        self.lines.append(f"{name} = {value}")

    def members_of(self, text):
        value, members = -1, []
        for member in filter(None, map(str.strip, text.split(","))):
            name, _, stated = map(str.strip, member.partition("="))
            value = value_of(stated, self.known) if stated else value + 1
            self.constant(name, value)
            members.append((name, value))
        return members

    def enumeration(self, name, text):
        members = self.members_of(text)
        self.types[name] = "c_int"
        words = [member.split("_") for member, _ in members]
        shared = 0
        while len(words) > 1 and all(len(w) > shared + 1 and w[shared] == words[0][shared] for w in words):
            shared += 1
        own = name.upper().split("_")[1:]
        self.lines.append(f"\n\nclass {''.join(map(str.capitalize, name.split('_')[1:]))}(enum.IntEnum):")
        self.lines.append(f'    """{name} of the public headers, which say what its members mean."""')
        for (_, value), word in zip(members, words):
            word = word[shared or 1:]
            word = word[len(own):] if word[:len(own)] == own and len(word) > len(own) else word
            self.lines.append(f"    {'_'.join(word)} = {value}")
        self.lines.append("\n")

    def type_of(self, text, declarator, in_call):
        """Return the ctypes type of a member or an argument, and its name."""
        text = re.sub(r"\bstruct\b", "", text)
        name = re.search(r"\w+(?=\s*(?:\)|\[|$))", declarator)[0]
        sizes = re.findall(r"\[([^]]*)\]", declarator)
        base = text.replace("const", " ").split()
        if len(base) != 1:
            raise Unknown(f"{text} {declarator}")
        if "*" in declarator or (in_call and sizes):
            plain = base[0] == "char" and "const" in text and declarator.count("*") == 1
            return name, "c_char_p" if plain and not sizes else "c_void_p"
        if self.types.get(base[0]) is None:
            raise Unknown(f"the type of {text} {declarator}")
        kind = self.types[base[0]]
        for size in reversed(sizes):
            kind = f"({kind} * {value_of(size, self.known)})"
        return name, kind

    def pointer_to_function(self, result, arguments):
        kinds = [self.argument(a)[1] for a in arguments.split(",")]
        result = "None" if result == "void" else self.types[result]
        return f"CFUNCTYPE({', '.join([result, *kinds])})"

    def argument(self, text):
        words = re.fullmatch(r"\s*((?:const\s+)?(?:struct\s+)?\w+(?:\s+const)?)\s*(.*?)\s*", text, flags=re.S)
        return self.type_of(words[1], words[2], True)

    def struct(self, name, text):
        fields = []
        for member in filter(None, map(str.strip, text.split(";"))):
            function = re.fullmatch(r"(\w+) \(\*(\w+)\)\((.*)\)", " ".join(member.split()))
            if function:
                kind = self.pointer_to_function(function[1], function[3])
                fields.append(f'("{function[2]}", {kind})')
                continue
            words = re.match(r"((?:const\s+)?(?:struct\s+)?\w+)\s*(.*)", member, flags=re.S)
            for declarator in words[2].split(","):
                fields.append('("%s", %s)' % self.type_of(words[1], declarator.strip(), False))
        self.types[name] = name
        self.lines += [f"\n\nclass {name}(Structure):", "    _fields_ = [" + ",\n                ".join(fields)
                       + "]\n\n"]

    def function(self, text):
        found = re.fullmatch(r"(.*?)(\w+)\((.*)\)", text)
        result, arguments = found[1].strip(), found[3]
        taken = [] if arguments == "void" else [self.argument(a) for a in arguments.split(",")]
        names, kinds = [name for name, _ in taken], [kind for _, kind in taken]
        if result.endswith("*"):
            result = "c_char_p" if result == "const char *" else "c_void_p"
        else:
            result = "None" if result == "void" else self.types[result]
        reports_error = arguments.endswith("ebpo_error *error")
        self.lines.append(f'FUNCTIONS["{found[2]}"] = ({result}, [{", ".join(kinds)}], {names}, {reports_error})')

    def initial_values(self):
        for name, text in self.macros:
            if name.endswith("_INIT"):
                struct = name[:-len("_INIT")].lower()
                if struct not in self.types:
                    raise Unknown(f"{name}: there is no struct {struct}")
                self.known[name] = value_of(text, self.known)
                self.lines.append(f"INIT[{struct}] = {written(self.known[name])}")


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    include = pathlib.Path(sys.argv[1])
    try:
        seen: set = set()
        headers = [include / "ebpo" / "ebpo.h", *sorted((include / "ebpo").glob("*.h"))]
        text = Headers("".join(text_of(header, seen) for header in headers)).declared()
    except Unknown as error:
        sys.exit(f"declare.py: unsupported C: {error}")
    if len(sys.argv) == 3:
        pathlib.Path(sys.argv[2]).write_text(text, encoding="utf-8")
    else:
        sys.stdout.write(text)


if __name__ == "__main__":
    main()
