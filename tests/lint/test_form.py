#!/usr/bin/env python3
"""Checks the form of handwritten sources: test_form.py SOURCE_ROOT

C has the lines of .clang-format (tools/dev/format.sh --check); here are lines that are too long,
files of one name, and names in C. Lines of tables and code in Markdown, links and long words cannot
be broken and are let off.
- A file-local function says what it does: `read_rows`, not `read`, a bare word that could stand in
  any file.
- What a header of lib declares has the library's prefix, as test_layers.py wants it of symbols.
"""
import collections
import pathlib
import re
import subprocess
import sys

COLUMNS = {".build": 100, ".py": 140, ".sh": 120, ".md": 120, ".txt": 120}
OTHERS = 199  # of C where it is a table, .tests, .js, .css, man pages, ...
MADE = re.compile(  # by programs
    r"^(docs/measured/|format-spec/vectors/|tests/fuzz/seeds/|tests/lint/flags/fp_golden\.txt$|tests/lint/libebpo\.abi$|"
    r".*package-lock\.json$|.*\.svg$|tests/lint/language_exceptions\.txt$)")
# Names that tell nothing without their folder, and need not; public headers are <ebpo/NAME.h>.
COMMON = {"meson.build", "README.md"}
APART = ("tests/fuzz/seeds/", "lib/include/")
# Vectors of numbers and their operations, which stand for operators: a prefix would hide the formulas. os_windows.h
# and the headers in lib/core/windows declare functions of POSIX.
POSIX = {"lib/core/os_windows.h", "lib/core/windows/poll.h", "lib/core/windows/sys/socket.h"}
UNPREFIXED = POSIX | {"lib/core/simd.h"}
NO_CODE = re.compile(  # comments, texts, preprocessor lines, attributes
    r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"|^[ \t]*#(?:[^\n]*\\\n)*[^\n]*|__attribute__\(\(.*?\)\)|'
    r"\bEBPO_PRINTF\([^)]*\)", re.S | re.M)


def tracked(root):
    try:
        names = subprocess.run(["git", "ls-files", "-z"], cwd=root, capture_output=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        print("skipped: this is no git repository")
        sys.exit(77)
    return [n for n in names.stdout.decode().split("\0") if n and (root / n).is_file()]


def text_of(path):
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        return ""


def can_be_broken(line, suffix, limit):
    if suffix == ".md" and line.startswith(("|", "![", "    ")):
        return False
    if "://" in line or (suffix == ".md" and re.search(r"\]\([^)]{30,}", line)):
        return False
    return max(map(len, line.split()), default=0) < limit - 20


def long_lines(root, names):
    for name in names:
        suffix = pathlib.Path(name).suffix
        limit = COLUMNS.get(suffix, OTHERS)
        if MADE.match(name):
            continue
        is_code = False
        for number, line in enumerate(text_of(root / name).splitlines(), 1):
            is_code ^= suffix == ".md" and line.startswith("```")
            if is_code:
                continue
            if len(line) > limit and can_be_broken(line, suffix, limit):
                yield f"{name}:{number}: {len(line)} columns, at most {limit}"


def equal_names(names):
    for folder in ("lib", "tests"):
        places = collections.defaultdict(list)
        for name in names:
            if name.startswith(folder + "/") and not name.startswith(APART):
                places[pathlib.PurePath(name).name].append(name)
        for base, found in places.items():
            if len(found) > 1 and base not in COMMON:
                yield f"equal names: {', '.join(found)}"


def c_code(text):
    """The code alone, in the lines where it was."""
    return NO_CODE.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)


def bare_functions(root, names):
    for name in names:
        if not name.startswith(("lib/", "tools/")) or not name.endswith((".c", ".h", ".inc", ".cpp")):
            continue
        code = c_code(text_of(root / name))
        for found in re.finditer(r"^static\b[^;={}()]*?[ *](\w+)\(", code, re.M):
            if found[1].isalpha() and name not in POSIX:
                yield (f"{name}:{code.count(chr(10), 0, found.start(1)) + 1}: the name of the function "
                       f"{found[1]} is a bare word; let it say what it does")


def declared_names(text):
    """Types, functions, constants and macros of a header."""
    code = c_code(text)
    yield from re.findall(r"\b(?:struct|enum|union)\s+(\w+)\s*[{;]", code)
    yield from re.findall(r"^\}\s*(\w+)\s*;", code, re.M)
    yield from re.findall(r"^typedef\s[^{};]*?\(\*(\w+)\)\(", code, re.M)
    yield from re.findall(r"^typedef\s[^{}();]*?\b(\w+)(?:\[.*?\])?;", code, re.M)
    yield from re.findall(r"^(?!typedef\b)[A-Za-z_][\w \t*\n]*?[ *](\w+)\(", code, re.M)
    for body in re.findall(r"\benum\s*\w*\s*\{(.*?)\}", code, re.S):
        yield from re.findall(r"(?:^|,)\s*([A-Za-z_]\w*)", re.sub(r"\([^()]*\)", "", body))
    yield from re.findall(r"^[ \t]*#[ \t]*define[ \t]+(\w+)", text, re.M)


def unprefixed_names(root, names):
    tables = [text_of(root / name) for name in names if name.startswith("lib/") and name.endswith(".inc")]
    undone = {macro for text in tables for macro in re.findall(r"^#undef (\w+)", text, re.M)}
    for name in names:
        if name.startswith("lib/") and name.endswith(".h") and name not in UNPREFIXED:
            for declared in sorted(set(declared_names(text_of(root / name))) - undone):
                if not declared.lower().startswith(("ebpo_", "_")):
                    yield f"{name}: {declared} lacks the prefix ebpo_"


def main():
    root = pathlib.Path(sys.argv[1])
    if not (root / ".git").exists():
        print("skipped: this is no git repository")
        return 77
    names = tracked(root)
    problems = [*long_lines(root, names), *equal_names(names), *bare_functions(root, names),
                *unprefixed_names(root, names)]
    print("\n".join(problems) or f"{len(names)} files are in form")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
