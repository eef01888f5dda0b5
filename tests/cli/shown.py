#!/usr/bin/env python3
"""shown.py COMMANDS [--update]: which tests show what of each command.

COMMANDS is tools/cli/options. Lines of *.tests are sorted by what they run and expect into a table,
command by behaviour, which docs/develop/command-line.md has; a cell without a test is a failure, and
so is a page that is not this table (--update writes it).
"""
import os
import re
import sys

sys.dont_write_bytecode = True
HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
import run

PAGE = os.path.join(HERE, "../../docs/develop/command-line.md")
COLUMNS = ("people", "--json", "errors", "progress", "pipes")
# What has no cell, and why.
NONE = {
    "people": {}, "--json": {}, "errors": {}, "pipes": {},
    "progress": {command: "none: it takes no time or as much as was asked for, or its answers "
                 "are the progress" for command in ("info", "levels", "view", "bench", "touch")},
}
TEXT = """# What is shown of each command

Made by `python3 tests/cli/shown.py tools/cli/options --update` of the tests; the test `cli_shown` holds it
to them, and fails where a cell has none. A cell names the files with tests of it:

| column | a test |
|---|---|
| people | runs the command and compares the words that it prints |
| `--json` | compares its JSON, or holds it against the schema |
| errors | expects a message and an exit code other than 0 |
| progress | looks at the line on a terminal |
| pipes | output that cannot be written, or is read to a part only, or input from standard input |

"""


def tests():
    """(file, expected code, output, error, command line) of each line."""
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
    """The behaviours that a line shows of the command."""
    fails = code.rpartition(":")[2] != "0"
    mine = re.search(rf"ebpo {ran}\b[^|;&]*", command).group()
    if "--json" in mine and not fails and (out or name == "json.tests"):
        yield "--json"
    elif out not in ("", "*") and not fails:
        yield "people"
    if fails and error not in ("", "*"):
        yield "errors"
    if re.search(r"/dev/full|[|] head|whole_lines|asks_and_waits", command) or re.search(
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
                bad.append("docs/develop/command-line.md is of other tests; run with --update")
    print("\n".join(bad + [f"{len(commands) * len(COLUMNS)} cells, {len(bad)} wrong"]))
    return 1 if bad or len(commands) < 20 else 0


sys.exit(main())
