#!/usr/bin/env python3
"""man.py TOOL FOLDER: --help and the man page of each command name the same options, --help fits on
80 columns, and mandoc finds no error."""
import os
import re
import shutil
import subprocess
import sys


def help_of(tool, *arguments):
    return subprocess.run([tool, *arguments], check=True, capture_output=True, text=True).stdout


def options_in_help(text):
    return set(re.findall(r"^  (?:-\w, )?--([a-z][a-z-]*)", text, re.MULTILINE))


def options_in_page(text):
    items = "\n".join(line for line in text.splitlines() if line.startswith(".It Fl"))
    return set(re.findall(r"Fl -([a-z][a-z-]*)", items))


def main():
    tool, folder = sys.argv[1:]
    bad = 0
    commands = [c for c in re.findall(r"^  ([a-z]+) ", help_of(tool, "help"), re.MULTILINE)
                if c != "help"]
    pages = ["ebpo.1", "ebpo-remote.7"]
    for command in commands:
        page = f"ebpo-{command}.1"
        pages.append(page)
        with open(os.path.join(folder, page), encoding="utf-8") as f:
            in_page = options_in_page(f.read())
        in_help = options_in_help(help_of(tool, command, "--help"))
        if in_help != in_page or "help" not in in_help:
            bad += 1
            print(f"{page}: missing {sorted(in_help - in_page)}, too many "
                  f"{sorted(in_page - in_help)}")
        wide = [line for line in help_of(tool, command, "--help").splitlines()[1:]
                if len(line) > 80]
        if wide:
            bad += 1
            print(f"ebpo {command} --help: wider than 80 columns: {wide[0]}")
        if help_of(tool, "help", command) != help_of(tool, command, "--help"):
            bad += 1
            print(f"ebpo help {command} and ebpo {command} --help differ")
    if shutil.which("mandoc"):
        for page in pages:
            lint = subprocess.run(["mandoc", "-Tlint", "-Wwarning", os.path.join(folder, page)],
                                  capture_output=True, text=True)
            if lint.returncode or lint.stdout:
                bad += 1
                print(lint.stdout)
    print(f"{len(commands)} commands, {bad} failed")
    return 1 if bad or len(commands) < 6 else 0


sys.exit(main())
