#!/usr/bin/env python3
"""The form of what is written by hand: test_form.py SOURCE_ROOT

C has the lines of .clang-format (tools/dev/format.sh --check); here are lines that are too long,
and files of one name. Lines of tables and code in Markdown, links and long words cannot be broken
and are let off.
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
    r".*package-lock\.json$|.*\.svg$)")
# Names that tell nothing without their folder, and need not; public headers are <ebpo/NAME.h>.
COMMON = {"meson.build", "README.md"}
APART = ("tests/fuzz/seeds/", "lib/include/")


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


def main():
    root = pathlib.Path(sys.argv[1])
    if not (root / ".git").exists():
        print("skipped: this is no git repository")
        return 77
    names = tracked(root)
    problems = [*long_lines(root, names), *equal_names(names)]
    print("\n".join(problems) or f"{len(names)} files are in form")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
