#!/usr/bin/env python3
"""Runs command-line tests from data files.

run.py TOOL INPUTS FEATURES FILE.tests

Each line of FILE.tests, together with following lines that begin with blanks, is

    exit code | standard output | standard error | command

sh runs the command in a separate folder for each file. The folder contains the input meshes, and later lines
use the output of earlier ones. Outputs are regular expressions (searched, "." matches newlines). An empty
expression means no output, * means any output, and @NAME means the contents of the file NAME beside this
script.

"png:0" runs the line only when FEATURES (words separated by commas) contains png, "no-png:2" only when it does
not. Without the feature "extras", lines with commands of the extras are skipped. Lines that need a terminal are
skipped and counted when the system has no pseudo-terminal. Lines that begin with # are comments.

python3 within a line is the interpreter that runs this script. The build chose this interpreter for its
modules; the first one in PATH may lack them.
"""
import functools
import os
import pty
import re
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
# Commands that a build with -Dextras=disabled lacks.
EXTRAS = re.compile(r"\bebpo (?:help )?(?:boolean|collide|haptic|map|paint|scene)\b|--crossings|components_agree")

NEEDS_TERMINAL = re.compile(r"\bscript -|shows_progress\.py")


@functools.cache
def has_terminal():
    """Returns True when the system has pseudo-terminals; containers without /dev/pts have none."""
    try:
        for end in pty.openpty():
            os.close(end)
    except OSError:
        return False
    return True


def lacks_terminal(command):
    return bool(NEEDS_TERMINAL.search(command)) and not has_terminal()


def output_fits(expected, actual):
    if expected == "*":
        return True
    if expected == "":
        return actual == ""
    if expected.startswith("@"):
        with open(os.path.join(HERE, expected[1:]), encoding="utf-8") as f:
            return f.read() == actual
    return re.search(expected, actual, re.DOTALL | re.MULTILINE) is not None


def wanted(field, command, features):
    """Returns the expected exit code of a line, or None if the line is for another build."""
    condition, _, code = field.rpartition(":")
    if lacks_terminal(command):
        return None
    if "extras" not in features and condition != "no-extras" and EXTRAS.search(command):
        return None
    if condition.startswith("no-"):
        return None if condition[3:] in features else int(code)
    return int(code) if not condition or condition in features else None


def run_line(line, folder, environment, features):
    """Returns None if the line passed or was skipped, otherwise the problem."""
    fields = [f.strip() for f in line.split(" | ", 3)]
    if len(fields) != 4:
        return "is not: code | output | error | command"
    code, out, err, command = fields
    code = wanted(code, command, features)
    if code is None:
        return None
    done = subprocess.run(["sh", "-c", command], cwd=folder, env=environment,
                          stdin=subprocess.DEVNULL, timeout=300,
                          capture_output=True)
    stdout, stderr = (b.decode("utf-8", "replace") for b in (done.stdout, done.stderr))
    wrong = []
    if done.returncode != code:
        wrong.append(f"exit code {done.returncode}, not {code}")
    if not output_fits(out, stdout):
        wrong.append("standard output does not fit")
    if not output_fits(err, stderr):
        wrong.append("standard error does not fit")
    return "; ".join(wrong) + f"\n--- output\n{stdout}--- error\n{stderr}---" if wrong else None


def lines_of(path):
    """Yields (number, test) of each test in a file; a line that begins with blanks continues the previous one."""
    number, test = 0, ""
    with open(path, encoding="utf-8") as data:
        for at, line in enumerate(data, 1):
            line = line.rstrip("\n")
            if line.startswith(" "):
                test += " " + line.lstrip()
                continue
            if test and not test.startswith("#"):
                yield number, test
            number, test = at, line
    if test and not test.startswith("#"):
        yield number, test


def python_in(folder):
    """Writes a command python3 into a folder, which runs this interpreter."""
    command = os.path.join(folder, "python3")
    with open(command, "w", encoding="utf-8") as f:
        f.write(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    os.chmod(command, 0o755)


def main():
    tool, inputs, features, tests = sys.argv[1:]
    bad = lines = without = silent = 0
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as commands:
        python_in(commands)
        path = [commands, os.path.dirname(os.path.abspath(tool)), os.environ["PATH"]]
        environment = dict(os.environ, LC_ALL="C.UTF-8", PATH=":".join(path), TESTS=HERE,
                           INPUTS=os.path.abspath(inputs))
        subprocess.run([inputs, folder], check=True)
        for number, line in lines_of(tests):
            lines += 1
            silent += lacks_terminal(line)
            without += wanted(line.split(" | ", 1)[0].strip(), line, features.split(",")) is None
            wrong = run_line(line, folder, environment, features.split(","))
            if wrong:
                bad += 1
                print(f"{tests}:{number}: {line}\n{wrong}")
    print(f"{tests}: {lines} lines, {bad} failed, {without - silent} of other builds")
    if silent:
        print(f"skipped: {silent} lines, because there is no pseudo-terminal")
    return 1 if bad or not lines else 0


if __name__ == "__main__":
    sys.exit(main())
