#!/usr/bin/env python3
"""Runs a command with standard error on a terminal, and checks its progress line:
shows_progress.py [STAGE ...] -- ebpo NAME ARGUMENTS

Each STAGE must have been on the line. The line begins with the command's name and is cleared at the end.
"""
import os
import pty
import re
import subprocess
import sys

WIPE = "\r\x1b[K"


def on_terminal(command):
    """Returns the exit code and the output on the terminal."""
    mine, its = pty.openpty()
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=its,
                          env=dict(os.environ, TERM="vt100")) as running:
        os.close(its)
        seen = b""
        try:
            while more := os.read(mine, 1 << 16):
                seen += more
        except OSError:  # EIO: the other end has been closed
            pass
    os.close(mine)
    return running.returncode, seen.decode()


def main():
    at = sys.argv.index("--")
    stages, command = sys.argv[1:at], sys.argv[at + 1:]
    code, seen = on_terminal(command)
    lines = re.findall(re.escape(WIPE + command[1]) + r": ([^\r\n]*)", seen)
    for stage in stages or [""]:
        if not any(stage in line for line in lines):
            sys.exit(f"{command[1]}: no line with {stage!r}: {seen!r}")
    if code or not seen[seen.rindex(WIPE + command[1]) + 4:].count(WIPE):
        sys.exit(f"exit code {code}, or the line was not cleared: {seen!r}")


main()
