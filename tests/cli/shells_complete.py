#!/usr/bin/env python3
"""Checks the completions with zsh and fish: shells_complete.py FOLDER

Each installed shell must complete some beginnings of a line. man.py tests bash. Exit code 77: neither shell
is installed.
"""
import pathlib
import pty
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time

sys.dont_write_bytecode = True
from run import has_terminal

folder = pathlib.Path(sys.argv[1]).resolve()
ASKED = {  # typed text: completions that must be offered
    "ebpo rep": ["repack", "report"],
    "ebpo convert --codec ": ["deflate", "none", "zstd"],
    "ebpo check --fin": ["--findings"],
    "ebpo inside --max-e": ["--max-expansion"],
}


def by_fish(line):
    script = f"source {folder}/ebpo.fish; complete -C {line!r}"
    return subprocess.run(["fish", "-N", "-c", script], capture_output=True, text=True, check=True).stdout


def by_zsh(line):
    """Returns the output of zsh on a terminal, where alone it completes, until all expected words have appeared."""
    with tempfile.TemporaryDirectory() as home:
        child, terminal = pty.fork()
        if child == 0:
            os.environ.update(HOME=home, TERM="dumb", COLUMNS="200", LINES="100")
            os.execvp("zsh", ["zsh", "-f", "-i"])
        shown = ""

        def see(words, seconds):
            nonlocal shown
            end = time.monotonic() + seconds
            while time.monotonic() < end and not all(w in shown for w in words):
                if select.select([terminal], [], [], 0.2)[0]:
                    shown += os.read(terminal, 65536).decode(errors="replace")

        os.write(terminal, f"fpath=({folder} $fpath); autoload -Uz compinit; compinit -u -d {home}/dump; "
                 "LISTMAX=1000; echo rea''dy\n".encode())
        see(["ready"], 60)
        shown = ""
        os.write(terminal, (line + "\t").encode())
        see(ASKED[line], 60)
        os.kill(child, 9)
        os.close(terminal)
        os.waitpid(child, 0)
    return shown


wrong, requested = 0, 0
for shell, complete in ("fish", by_fish), ("zsh", by_zsh):
    if not shutil.which(shell):
        print(f"{shell} is not installed")
        continue
    if shell == "zsh" and not has_terminal():
        print("skipped: zsh, because there is no pseudo-terminal")
        continue
    for line, words in ASKED.items():
        found, requested = complete(line), requested + 1
        missing = [word for word in words if word not in found]
        if missing:
            print(f"{shell}: after {line!r} there is no {', '.join(missing)}:\n{found}")
            wrong += 1
sys.exit(77 if not requested else wrong > 0)
