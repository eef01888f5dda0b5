#!/usr/bin/env python3
"""Compares ctypes declarations with the compiler: test_declared.py INCLUDE_FOLDER PACKAGE_FOLDER CC...

tools/python/declare.py makes the declarations from the public headers. A C program that includes the headers
prints sizes, offsets of members, constants, and each member of each initial value.
"""
import ctypes
import enum
import pathlib
import subprocess
import sys
import tempfile

include, package, compiler = sys.argv[1], sys.argv[2], sys.argv[3:]
sys.path.insert(0, package)
sys.dont_write_bytecode = True
from ebpo import _checked, _declared as declared, _library  # noqa: E402

structs = [kind for kind in vars(declared).values()
           if isinstance(kind, type) and issubclass(kind, _checked.Structure) and kind is not _checked.Structure]
constants = [name for name, value in vars(declared).items() if name.startswith("EBPO_") and isinstance(value, int)]


def printed_by_c():
    """Return the output of the C program."""
    lines = [f"#include <ebpo/{header.name}>" for header in sorted((pathlib.Path(include) / "ebpo").glob("*.h"))]
    lines += ["#include <stdio.h>",
              "static void print_bytes(const char *name, const void *data, size_t size) {",
              '    printf("%s ", name);',
              '    for (size_t i = 0; i < size; i++) printf("%02x", ((const unsigned char *)data)[i]);',
              '    puts("");', "}", "int main(void) {"]
    for kind in structs:
        name = kind.__name__
        lines.append(f'printf("size {name} %zu\\n", sizeof({name}));')
        if kind in declared.INIT:
            lines.append(f"static const {name} made_{name} = {name.upper()}_INIT;")
        for field, _ in kind._fields_:
            lines.append(f'printf("{name}.{field} %zu %zu\\n", offsetof({name}, {field}), '
                         f'sizeof((({name} *)0)->{field}));')
            if kind in declared.INIT:
                lines.append(f'print_bytes("init {name}.{field}", &made_{name}.{field}, sizeof(made_{name}.{field}));')
    for name in constants:
        lines.append(f'printf("{name} %lld\\n", (long long){name});')
    lines += ["return 0;", "}"]
    with tempfile.TemporaryDirectory() as folder:
        source, program = pathlib.Path(folder) / "printed.c", pathlib.Path(folder) / "printed"
        source.write_text("\n".join(lines) + "\n")
        subprocess.run([*compiler, f"-I{include}", source, "-o", program], check=True)
        return subprocess.run([program], check=True, capture_output=True, text=True).stdout.splitlines()


def printed_by_python():
    for kind in structs:
        name = kind.__name__
        yield f"size {name} {ctypes.sizeof(kind)}"
        made = bytes(_library.made(kind)) if kind in declared.INIT else b""
        for field, _ in kind._fields_:
            at = getattr(kind, field)
            yield f"{name}.{field} {at.offset} {at.size}"
            if made:
                yield f"init {name}.{field} {made[at.offset:at.offset + at.size].hex()}"
    for name in constants:
        yield f"{name} {ctypes.c_longlong(getattr(declared, name)).value}"


def main():
    c, python = printed_by_c(), list(printed_by_python())
    differ = [pair for pair in zip(c, python) if pair[0] != pair[1]]
    for here, there in differ[:20]:
        print(f"C: {here}   Python: {there}")
    if differ or len(c) != len(python):
        sys.exit("tools/python/declare.py does not support a header")
    enums = sum(isinstance(v, type) and issubclass(v, enum.IntEnum) and v is not enum.IntEnum
                for v in vars(declared).values())
    print(f"{len(structs)} structs, {len(constants)} constants, {len(declared.INIT)} initial values, "
          f"{enums} enumerations, {len(declared.FUNCTIONS)} functions are equal in C and Python")


main()
