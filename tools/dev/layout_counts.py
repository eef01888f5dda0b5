#!/usr/bin/env python3
"""Counts functions and files of lib, tools and tests, and lists those beyond the limits.

    tools/dev/layout_counts.py [--json] [FOLDER...]

Public headers (in folders named include) are not counted as files. A short .c file needs a reason.
The lines of a function are those from its name to its closing brace, with comments. ctags
(universal-ctags) finds the functions if it is installed. Otherwise they are found by the layout of
.clang-format: a brace in the first column opens and closes a function.
Exit code 1: a function or file is beyond a limit.
"""
import argparse
import json
import pathlib
import re
import shutil
import statistics
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
LONGEST_FUNCTION, LONGEST_FILE, SHORTEST_FILE = 60, 900, 60


def by_ctags(paths):
    """Yield (path, name, first line, lines) of each function, from ctags."""
    command = ["ctags", "--languages=C,C++", "--langmap=C:.c.h.inc,C++:.cpp.hpp", "--kinds-C=f",
               "--kinds-C++=f", "--fields=+ne", "--output-format=json", "-f", "-", "-L", "-"]
    out = subprocess.run(command, input="\n".join(map(str, paths)), capture_output=True, text=True,
                         check=True, cwd=ROOT).stdout
    for line in out.splitlines():
        tag = json.loads(line)
        if "end" in tag:
            yield pathlib.Path(tag["path"]), tag["name"], tag["line"], tag["end"] - tag["line"] + 1


def by_form(paths):
    """Yield the same from the layout of the source, without ctags."""
    for path in paths:
        head = begin = None
        for number, line in enumerate((ROOT / path).read_text().splitlines(), 1):
            if begin:
                if line.startswith("}"):
                    yield path, head[0], begin, number - begin + 1
                    begin = head = None
                continue
            one_line = re.match(r"\w.*?\b(\w+)\(.*\) \{.*\}$", line)
            opens = re.match(r"(?:\w.*?\b)?(\w+)\((?!\()", line)
            if one_line:
                yield path, one_line.group(1), number, 1
            elif opens and not line.endswith(";"):
                head = (opens.group(1), number)
            elif line == "{" and head:
                begin = head[1]
            elif not line or line.startswith(("#", "}")):
                head = None


def has_ctags():
    return shutil.which("ctags") and "Universal" in subprocess.run(
        ["ctags", "--version"], capture_output=True, text=True, check=False).stdout


def sizes(values):
    values = sorted(values) or [0]
    return {"count": len(values), "median": int(statistics.median(values)),
            "90%": values[int(0.9 * (len(values) - 1))], "largest": values[-1]}


def survey(folder):
    names = subprocess.run(["git", "ls-files", "--", folder], capture_output=True, text=True,
                           check=True, cwd=ROOT).stdout.split()
    paths = [pathlib.Path(n) for n in names if n.endswith((".c", ".h", ".inc", ".cpp", ".hpp"))]
    functions = list((by_ctags if has_ctags() else by_form)(paths))
    lines = {p: len((ROOT / p).read_text().splitlines()) for p in paths}
    public = [p for p in paths if "include" in p.parts]
    headers = [p for p in paths if p.suffix == ".h" and p not in public]
    return {
        "folder": folder,
        "functions": sizes(f[3] for f in functions),
        "files": sizes(n for p, n in lines.items() if p not in public),
        ".c files": sizes(n for p, n in lines.items() if p.suffix == ".c"),
        "headers": sizes(lines[p] for p in headers),
        "long_functions": [{"where": f"{p}:{at}", "name": n, "lines": length}
                           for p, n, at, length in functions if length > LONGEST_FUNCTION],
        "long_files": [{"where": str(p), "lines": n} for p, n in lines.items()
                       if n > LONGEST_FILE and p not in public],
        "short_files": [{"where": str(p), "lines": n} for p, n in lines.items()
                        if n < SHORTEST_FILE and p.suffix == ".c"],
    }


def table(found):
    print("| folder | what | count | median | 90 % | largest |\n|---|---|---|---|---|---|")
    for one in found:
        for what in ("functions", "files", ".c files", "headers"):
            s = one[what]
            print(f"| {one['folder']} | {what}, lines | {s['count']} | {s['median']} | "
                  f"{s['90%']} | {s['largest']} |")
    for what, limit in (("long_functions", f"functions of more than {LONGEST_FUNCTION} lines"),
                        ("long_files", f"files of more than {LONGEST_FILE} lines"),
                        ("short_files", f".c files of less than {SHORTEST_FILE} lines")):
        beyond = sorted((x for one in found for x in one[what]), key=lambda x: -x["lines"])
        print(f"\n{len(beyond)} {limit}")
        for x in beyond:
            print(f"  {x['lines']:5}  {x['where']}  {x.get('name', '')}".rstrip())


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="*", default=["lib", "tools", "tests"])
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    found = [survey(folder) for folder in options.folders]
    if options.json:
        print(json.dumps(found, indent=1))
    else:
        table(found)
    return 1 if any(one["long_functions"] or one["long_files"] for one in found) else 0


if __name__ == "__main__":
    sys.exit(main())
