#!/usr/bin/env python3
"""shown.py COMMANDS [--table]: checks that tests cover each behaviour of each command.

COMMANDS is tools/cli/options. The script fails for a command and a behaviour without a line in *.tests.
--table prints the files that test each behaviour:

  text      runs the command and compares its text
  --json    compares its JSON, or checks it against the schema
  errors    expects a message and an exit code other than 0
  progress  checks the progress line on a terminal
  pipes     output that cannot be written or is only partly read, or standard input
"""
import os
import re
import sys

sys.dont_write_bytecode = True
HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
import run

COLUMNS = ("text", "--json", "errors", "progress", "pipes")
# Commands without a progress line: short, of a given duration, or printing results continuously.
NO_PROGRESS = ("info", "levels", "view", "bench", "haptic", "serve")


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
    if c == "progress" and command in NO_PROGRESS:
        return "-"
    return ", ".join(sorted(cells[command, c]))


def main():
    commands = sorted(name[:-8] for name in os.listdir(sys.argv[1])
                      if name.endswith(".options") and name != "shared.options")
    cells = table(commands)
    if "--table" in sys.argv:
        print("\n".join(f"{command} {c}: {cell(cells, command, c)}" for command in commands for c in COLUMNS))
    bad = [f"{command}: no test of {c}" for command in commands for c in COLUMNS
           if not cell(cells, command, c)]
    print("\n".join(bad + [f"{len(commands) * len(COLUMNS)} cells, {len(bad)} wrong"]))
    return 1 if bad or len(commands) < 20 else 0


sys.exit(main())
