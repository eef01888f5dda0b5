#!/usr/bin/env python3
"""The public headers, the shared library, and the documents tell the same: test_exports.py LIBEBPO
SOURCE_ROOT VERSION core|extras

The library exports exactly what the headers declare, those of the core alone or all; ebpo.h includes
every header of the core, and no other; each is installed; whatever name a header, a page or a sample
mentions is declared; each function says which threads may call it; each struct that begins with its
size has its macro; the version is the project's. What the library wants of every thread's stack
(thread-local storage) is little.
"""
import pathlib
import re
import subprocess
import sys

library, root, version, parts = sys.argv[1], pathlib.Path(sys.argv[2]), sys.argv[3], sys.argv[4]
build = (root / "lib/meson.build").read_text()
EXTRAS = set(re.findall(r"include/ebpo/(\w+\.h)", re.search(r"extra_headers = files\(.*?\)", build, re.S).group()))
headers = {path.name: path.read_text() for path in sorted((root / "lib/include/ebpo").glob("*.h"))}
problems = []


def code(text):
    """Without comments and preprocessor lines."""
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    return re.sub(r"^#(.*\\\n)*.*$", "", text, flags=re.M)


def declared_functions(there):
    names = set()
    for text in there:
        names |= set(re.findall(r"EBPO_API\b[^;]*?\b(ebpo_\w+)\s*\(", code(text)))
    return names


def exported_functions():
    output = subprocess.run(["nm", "-D", "--defined-only", library], check=True,
                            capture_output=True, text=True).stdout
    names = {line.split()[2] for line in output.splitlines() if len(line.split()) == 3}
    return {name for name in names if not name.startswith("_")}


def declared_names(functions):
    """Functions, types and constants."""
    names = set(functions)
    for text in headers.values():
        names |= set(re.findall(r"\b(?:struct|enum)\s+(ebpo_\w+)", code(text)))
        names |= set(re.findall(r"^\}\s*(ebpo_\w+);", code(text), flags=re.M))
        names |= set(re.findall(r"\(\*(ebpo_\w+)\)\(", code(text)))
        names |= set(re.findall(r"\b(EBPO_\w+)\b", code(text)))
        names |= set(re.findall(r"^#define\s+(EBPO_\w+)", text, flags=re.M))
    return names | {"ebpo_sized"}


def mentioned(text):
    """Names in a text; "ebpo_view_*" and "EBPO_..._INIT" stand for several."""
    return set(re.findall(r"\b((?:ebpo|EBPO)_[A-Za-z0-9]\w*)\b(?![*.\w])", text))


def threads_of(text):
    """(function, comment above it, which may be shared by declarations without an empty line
    between)."""
    comment = ""
    for block in re.split(r"\n\s*\n", text):
        comments = " ".join(re.findall(r"/\*.*?\*/", block, flags=re.S))
        for name in re.findall(r"EBPO_API\b[^;]*?\b(ebpo_\w+)\s*\(", code(block)):
            yield name, comments


def thread_local_bytes():
    output = subprocess.run(["readelf", "-lW", library], capture_output=True, text=True).stdout
    return sum(int(line.split()[5], 16) for line in output.splitlines() if line.split()[:1] == ["TLS"])


functions, exported = declared_functions(headers.values()), exported_functions()
if parts == "core":
    problems += [f"exported, but an extra: {name}" for name in sorted(
        exported & declared_functions(headers[name] for name in EXTRAS))]
    exported |= declared_functions(headers[name] for name in EXTRAS)
problems += [f"declared, not exported: {name}" for name in sorted(functions - exported)]
problems += [f"exported, not declared: {name}" for name in sorted(exported - functions)]
problems += [f"{name}: ebpo.h includes what belongs to the core, and no more" for name in headers
             if name != "ebpo.h" and (f"#include <ebpo/{name}>" in headers["ebpo.h"]) == (name in EXTRAS)]
if thread_local_bytes() > 256:
    problems.append(f"{thread_local_bytes()} bytes of thread-local storage, which come off every thread's stack")
problems += [f"not installed (lib/meson.build): {name}" for name in headers
             if f"'include/ebpo/{name}'" not in build]

names = declared_names(functions)
for path, text in headers.items():
    comments = " ".join(re.findall(r"/\*.*?\*/", text, flags=re.S))
    problems += [f"{path}: a comment mentions {name}, which no header declares"
                 for name in sorted(mentioned(comments) - names)]
    problems += [f"{path}: {name} does not say 'Threads: ...'" for name, comment in threads_of(text)
                 if "Threads:" not in comment]
    problems += [f"{path}:{n}: {len(line)} characters"
                 for n, line in enumerate(text.splitlines(), 1) if len(line) > 100]
    for name in re.findall(r"typedef struct (ebpo_\w+) \{\s*size_t struct_size;", text):
        if f"#define {name.upper()}_INIT" not in text:
            problems.append(f"{path}: {name} begins with its size, and there is no "
                            f"{name.upper()}_INIT")

for path in [root / "README.md", *(root / "docs/guide").glob("*.md"),
             *(root / "samples").glob("*.[ch]"), root / "samples/query.py"]:
    problems += [f"{path.relative_to(root)}: mentions {name}, which no header declares"
                 for name in sorted(mentioned(path.read_text()) - names) if name != "EBPO_LIBRARY"]

numbers = [re.search(rf"#define EBPO_VERSION_{part}\s+(\d+)", headers["base.h"]).group(1)
           for part in ("MAJOR", "MINOR", "PATCH")]
if ".".join(numbers) != version:
    problems.append(f"base.h says version {'.'.join(numbers)}, meson.build {version}")

print("\n".join(problems) or f"{len(exported)} public functions")
sys.exit(1 if problems else 0)
