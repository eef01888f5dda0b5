#!/usr/bin/env python3
"""shown.py COMMANDS [--update]: checks that tests cover each behaviour of each command.

COMMANDS is tools/cli/options. The script makes a table of the lines of *.tests, command by behaviour,
and compares it with docs/develop/command-line.md (--update writes the page). It fails for a cell
without a test and for an outdated page.
"""
import os
import re
import sys

sys.dont_write_bytecode = True
HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
import run

PAGE = os.path.join(HERE, "../../docs/develop/command-line.md")
COLUMNS = ("text", "--json", "errors", "progress", "pipes")
# Cells that need no test, with the reason.
NONE = {
    "text": {}, "--json": {}, "errors": {}, "pipes": {},
    "progress": {command: "no progress line: the command is short, has a given duration, or "
                 "prints results continuously" for command in ("info", "levels", "view", "bench", "haptic")},
}
TEXT = """# Test coverage of each command

This page lists the files of `tests/cli` that test each command. `python3 tests/cli/shown.py tools/cli/options
--update` generates it; the test `cli_shown` fails for an outdated page or an empty cell.

| column | a test |
|---|---|
| text | runs the command and compares its text |
| `--json` | compares its JSON, or checks it against the schema |
| errors | expects a message and an exit code other than 0 |
| progress | checks the progress line on a terminal |
| pipes | output that cannot be written or is only partly read, or standard input |

"""


def tests():
    """Yields (file, expected code, output, error, command line) of each line."""
    for name in sorted(os.listdir(HERE)):
        if not name.endswith(".tests"):
            continue
        for _, line in run.lines_of(os.path.join(HERE, name)):
            fields = [f.strip() for f in line.split(" | ", 1 if name == "json.tests" else 3)]
            if name == "json.tests" and len(fields) == 2:
                words = "words" if "| grep" in fields[1] else ""
                yield name, "0", words if fields[0].endswith("-") else "json", "", fields[1]
            elif len(fields) == 4:
                yield name, *fields


def column(name, code, out, error, command, ran):
    """Yields the behaviours that a line tests for the command."""
    fails = code.rpartition(":")[2] != "0"
    mine = re.search(rf"ebpo {ran}\b[^|;&]*", command).group()
    if "--json" in mine and not fails and (out or name == "json.tests"):
        yield "--json"
    elif out not in ("", "*") and not fails:
        yield "text"
    if fails and error not in ("", "*"):
        yield "errors"
    if re.search(r"/dev/full|[|] head|whole_lines|queries_and_waits", command) or re.search(
            rf"[|] *(?:timeout \d+ )?ebpo {ran}\b|ebpo {ran} [^|;&]* - |ebpo {ran} [^|;&]* -$|"
            rf"ebpo {ran} [^|;&]*<", command):
        yield "pipes"
    if "script -" in command or "interrupt.py" in command or "shows_progress.py" in command:
        yield "progress"


def table(commands):
    cells = {(command, c): set() for command in commands for c in COLUMNS}
    for test in tests():
        for ran in set(re.findall(r"\bebpo ([a-z]+)\b", test[4])) & set(commands):
            for c in column(*test, ran):
                cells[ran, c].add(test[0].removesuffix(".tests"))
    return cells


def cell(cells, command, c):
    if cells[command, c]:
        return ", ".join(sorted(cells[command, c]))
    return "" if command not in NONE[c] else "-"


def page(cells, commands):
    lines = ["| command | " + " | ".join(f"`{c}`" if c[0] == "-" else c for c in COLUMNS) + " |",
             "|---" * (len(COLUMNS) + 1) + "|"]
    lines += [f"| `{command}` | " + " | ".join(cell(cells, command, c) for c in COLUMNS) + " |"
              for command in commands]
    reasons = sorted({reason for by in NONE.values() for reason in by.values()})
    return TEXT + "\n".join(lines) + "\n\n" + "\n".join(f"\\- {reason}" for reason in reasons) + "\n"


def main():
    commands = sorted(name[:-8] for name in os.listdir(sys.argv[1])
                      if name.endswith(".options") and name != "shared.options")
    cells = table(commands)
    text = page(cells, commands)
    bad = [f"{command}: no test of {c}" for command in commands for c in COLUMNS
           if not cell(cells, command, c)]
    if "--update" in sys.argv:
        with open(PAGE, "w", encoding="utf-8") as file:
            file.write(text)
    else:
        with open(PAGE, encoding="utf-8") as file:
            if file.read() != text:
                bad.append("docs/develop/command-line.md is outdated; run with --update")
    print("\n".join(bad + [f"{len(commands) * len(COLUMNS)} cells, {len(bad)} wrong"]))
    return 1 if bad or len(commands) < 20 else 0


sys.exit(main())
