#!/usr/bin/env python3
"""man.py TOOL PAGES COMMANDS: checks that the pages made by tools/cli/options match the tool.

COMMANDS is tools/cli/options; PAGES is the folder in which the build puts its output. --help, the manual and
the completion of bash have the same options, and options take the keywords that are completed. The manual has
the defaults that --help names. --help fits 80 columns. mandoc finds no error in the manual, and installed
shells find none in their completions.
"""
import os
import re
import shutil
import subprocess
import sys

sys.dont_write_bytecode = True


def help_of(tool, *arguments):
    return subprocess.run([tool, *arguments], check=True, capture_output=True, text=True).stdout


def options_in_help(text):
    return set(re.findall(r"^  (?:-\w, )?--([a-z][a-z-]*)", text, re.MULTILINE))


def items_in_page(text):
    """Returns the mdoc text of each option."""
    parts = re.split(r"^\.It ((?:Fl \w .*, )?Fl -[a-z-]+.*)$", text, flags=re.MULTILINE)
    return {re.search(r"Fl -([a-z-]+)", head)[1]: body for head, body in zip(parts[1::2],
                                                                              parts[2::2])}


def numbers(text):
    return set(re.findall(r"\d+(?:\.\d+)?", re.sub(r"(?<=\d),(?=\d{3}\b)", "", text)))


def lost_defaults(command):
    """Returns the defaults in --help that the manual does not have."""
    for option in command.options():
        reported = re.search(r"default:? (\d[\d.]*\d|\d)\b", option.help)
        if reported and option.man and reported[1] not in numbers("\n".join(option.man)):
            yield f"--{option.name}: the default {reported[1]} is not in the manual"


def other_words(tool, command):
    """Returns the options whose keywords differ from those of the tool."""
    for option in command.options():
        if not option.words:
            continue
        messages = subprocess.run([tool, command.name, f"--{option.name}", "?"], capture_output=True,
                              text=True).stderr
        known = re.search(r"is not one of: ([^;\n]*)", messages)
        if not known or known[1].split(", ") != option.words:
            yield f"--{option.name}: {option.words} in its table; {messages.strip()}"


def completed(script, *words):
    """Returns the completions that bash offers for the last word."""
    program = ('. "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _ebpo; '
               'printf "%s\\n" "${COMPREPLY[@]}"')
    done = subprocess.run(["bash", "-c", program, "bash", script, "ebpo", *words], check=True,
                          capture_output=True, text=True)
    return done.stdout.split()


def bash_offers(tool, script, commands):
    names = sorted([c.name for c in commands] + ["help", "--version", "--help"])
    if sorted(completed(script, "")) != names:
        yield f"ebpo: bash offers {completed(script, '')}"
    for command in commands:
        offered = completed(script, command.name, "--")
        reported = options_in_help(help_of(tool, command.name, "--help"))
        reported |= {o.name for o in command.options() if o.page}
        if sorted(offered) != sorted("--" + name for name in reported):
            yield f"{command.name}: bash offers {offered}"
        for option in command.options():
            if option.words:
                for words in ([f"--{option.name}", ""], [f"--{option.name}", "=", ""]):
                    if completed(script, command.name, *words) != option.words:
                        yield f"{command.name} --{option.name}: other words"


def check_remote(tool, page):
    """`ebpo help remote` and ebpo-remote(7) have the same options."""
    reported = help_of(tool, "help", "remote")
    if not reported or options_in_help(reported) != set(items_in_page(page)):
        yield f"remote: options of help and manual: {options_in_help(reported) ^ set(items_in_page(page))}"
    yield from (f"wider than 80 columns: {line}" for line in reported.splitlines()[1:] if len(line) > 80)


def check_command(tool, command, page):
    reported = help_of(tool, command.name, "--help")
    items = items_in_page(page)
    if options_in_help(reported) != set(items) or "help" not in items:
        yield f"options of --help and of the manual: {sorted(options_in_help(reported) ^ set(items))}"
    yield from (f"wider than 80 columns: {line}" for line in reported.splitlines()[1:]
                if len(line) > 80)
    if help_of(tool, "help", command.name) != reported:
        yield "'ebpo help' and '--help' differ"
    if f".Nd {command.summary}\n" not in page:
        yield "the summary is not the manual's"
    yield from lost_defaults(command)
    yield from other_words(tool, command)


def lint(program, arguments, files):
    """Returns the findings of a checker, if it is installed."""
    if shutil.which(program):
        for file in files:
            done = subprocess.run([program, *arguments, file], capture_output=True, text=True)
            if done.returncode or done.stdout:
                yield f"{file}: {done.stdout}{done.stderr}"


def main():
    tool, made, tables = sys.argv[1:]
    sys.path.insert(0, tables)
    import option_tables
    names = [c for c in re.findall(r"^  ([a-z]+) ", help_of(tool, "help"), re.MULTILINE)
             if c != "help"]
    wrong = []
    there = {f[:-8] for f in os.listdir(tables) if f.endswith(".options")} - {"shared"}
    without = {name for name in there - set(names) if "built without" in subprocess.run(
        [tool, name], capture_output=True, text=True).stderr}
    if there - without != set(names):
        wrong.append(f"commands without table, or tables without command: {(there - without) ^ set(names)}")
    _, commands = option_tables.read_all(tables, names)
    pages = ["ebpo.1", "ebpo-remote.7"]
    for command in commands:
        pages.append(f"ebpo-{command.name}.1")
        with open(os.path.join(made, pages[-1]), encoding="utf-8") as file:
            wrong += [f"{command.name}: {what}" for what in check_command(tool, command,
                                                                          file.read())]
    with open(os.path.join(made, "ebpo-remote.7"), encoding="utf-8") as file:
        wrong += check_remote(tool, file.read())
    wrong += lint("mandoc", ["-Tlint", "-Wwarning"], [os.path.join(made, p) for p in pages])
    if shutil.which("bash"):
        wrong += bash_offers(tool, os.path.join(made, "ebpo.bash"), commands)
    wrong += lint("zsh", ["-n"], [os.path.join(made, "_ebpo")])
    wrong += lint("fish", ["-n"], [os.path.join(made, "ebpo.fish")])
    print("\n".join(wrong + [f"{len(names)} commands, {len(wrong)} failed"]))
    return 1 if wrong or len(names) + len(without) < 20 else 0


if __name__ == "__main__":
    sys.exit(main())
