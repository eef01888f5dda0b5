#!/usr/bin/env python3
"""Compares the public interface with its stored description: test_abi.py CC... -- SOURCE_ROOT [--update]

What the headers declare is compiled into a library of empty functions, described by abidw and
compared by abidiff with tests/lint/libebpo.abi. The core alone must be the same without the extras'
functions and types: so it does not matter what the real library's
private structs are, or how it was compiled. test_exports.py sees to it that the real library
exports just these functions. Also: structs that begin with their size must not end in padding, or a
member that is appended would come to lie where older callers have garbage.
"""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

separator = sys.argv.index("--")
compiler, (root, *rest) = sys.argv[1:separator], sys.argv[separator + 1:]
root, update = pathlib.Path(root).resolve(), "--update" in rest
INCLUDE = root / "lib/include"
EVERY = sorted((INCLUDE / "ebpo").glob("*.h"))
CORE = [header for header in EVERY if header.name == "ebpo.h"
        or f"<ebpo/{header.name}>" in (INCLUDE / "ebpo/ebpo.h").read_text()]
BASELINE = root / "tests/lint/libebpo.abi"
SKIPPED = 77


def header_text(headers):
    """Headers without comments and preprocessor lines."""
    texts = [header.read_text() for header in headers]
    text = re.sub(r"/\*.*?\*/", " ", "\n".join(texts), flags=re.S)
    return re.sub(r"^#(.*\\\n)*.*$", "", text, flags=re.M)


def stub(headers):
    """A C file that defines every function, and names every type, so that all are described."""
    text = header_text(headers)
    lines = [f"#include <ebpo/{header.name}>" for header in headers]
    for declaration in re.findall(r"EBPO_API\b(.*?);", text, flags=re.S):
        declaration = re.sub(r"\bEBPO_MUST_USE\b|\bEBPO_PRINTF\([^)]*\)", "", declaration)
        lines.append(" ".join(declaration.split()) + " { __builtin_trap(); }")
    types = sorted(set(re.findall(r"^\}\s*(ebpo_\w+);", text, flags=re.M)))
    lines += [f"EBPO_API void type_{name}({name} *it); void type_{name}({name} *it) {{ (void)it; }}"
              for name in types]
    for name, body in re.findall(r"typedef struct (ebpo_\w+) \{(.*?)^\}", text, flags=re.S | re.M):
        if re.match(r"\s*size_t struct_size;", body):
            last = body.strip().split(";")[-2]
            member = re.search(r"\(\*(\w+)\)|(\w+)\s*(?:\[[^]]*\]\s*)*$", last)
            member = member.group(1) or member.group(2)
            lines.append(f"_Static_assert(offsetof({name}, {member}) + sizeof((({name} "
                         f"*)0)->{member}) == sizeof({name}), "
                         f'"{name} ends in padding: add a reserved member, or put a larger one '
                         f'last");')
    return "\n".join(lines) + "\n"


def describe(folder, headers, output):
    source, library = folder / "stub.c", folder / "libebpo.so.0"
    source.write_text(stub(headers))
    subprocess.run([*compiler, "-std=c11", "-g", "-O0", "-shared", "-fPIC", "-fvisibility=hidden",
                    f"-I{INCLUDE}",
                    "-Wl,-soname,libebpo.so.0", "-nostdlib", "-o", library, source.name],
                   cwd=folder, check=True)
    subprocess.run(["abidw", "--no-show-locs", "--no-corpus-path", "--no-comp-dir-path",
                    "--no-elf-needed", "--out-file", output,
                    library], check=True)


def same_interface(folder):
    """True when the headers are as the stored description says; --update stores them."""
    now = folder / "now.abi"
    describe(folder, EVERY, now)
    if update:
        shutil.copy(now, BASELINE)
        return True
    compared = subprocess.run(["abidiff", BASELINE, now], capture_output=True, text=True)
    print(compared.stdout + compared.stderr, end="")
    return compared.returncode == 0


def core_is_a_part(folder):
    """True when the core differs from the whole only by what the extras' headers declare."""
    every, core = folder / "every.abi", folder / "core.abi"
    describe(folder, EVERY, every)
    describe(folder, CORE, core)
    said = subprocess.run(["abidiff", every, core], capture_output=True, text=True).stdout
    extras = header_text([header for header in EVERY if header not in CORE])
    removed = set(re.findall(r"^  \[D\] '(?:function|method) [^']*?(\w+)\(", said, re.M))
    kept = [name for name in removed if not re.search(rf"\b{name.removeprefix('type_')}\b", extras)]
    if kept or not removed or not re.search(r"Functions changes summary: \d+ Removed, 0 Changed.*, 0 Added", said):
        print(f"the core's interface is not a part of the whole: {' '.join(kept)}\n{said}")
        return False
    return True


def main():
    if not shutil.which("abidw") or not shutil.which("abidiff"):
        print("abidw and abidiff are not installed (tools/install-deps.sh --tests)")
        return SKIPPED
    with tempfile.TemporaryDirectory() as name:
        try:
            same = [same_interface(pathlib.Path(name)), core_is_a_part(pathlib.Path(name))]
        except subprocess.CalledProcessError:
            return 1
    if all(same):
        return 0
    print("The public interface is not the one that is stored. Unless that is what you want, correct "
          "lib/include/ebpo. A member may be "
          "added at the end of a struct that begins with struct_size, a function or a constant "
          "may be added; all else breaks programs "
          "and needs a new major version. Then:\n\n    tests/lint/test_abi.py gcc -- . --update")
    return 1


sys.exit(main())
