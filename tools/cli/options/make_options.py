#!/usr/bin/env python3
"""make_options.py tables|pages|completions OUT.DIR COMMAND...

Generates files from NAME.options and shared.options:

tables       COMMAND.inc, the C tables that cmd_COMMAND.c includes, for parsing and --help
pages        ../../man/*.1 and *.7 with their marks filled: @NAME@ @SYNOPSIS@ @OPTIONS@ @COMMANDS@
             @PAGES@, and @OPTIONS KEY@ for a shared group
completions  ebpo.bash, _ebpo (zsh), ebpo.fish
"""
import os
import re
import sys

sys.dont_write_bytecode = True # the sources may be read-only

import completions
import option_tables

HERE = os.path.dirname(os.path.abspath(__file__))
HELP = option_tables.Option(name="help", letter="h", value="", kind="flag", words=[],
                            help="print this help and exit",
                            man=["Print a summary of the options and exit."], page="")


def write(path, text):
    """Writes a file, unless it has this text already, so that its modification time stays."""
    if os.path.exists(path):
        with open(path, encoding="utf-8") as file:
            if file.read() == text:
                return
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


# --- C ---

def c_text(text):
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"' if text else "NULL"


# C type of the field of an option, by the kind of option
C_TYPES = {"flag": "bool", "int": "int64_t", "real": "double", "text": "const char *",
           "list": "arg_list", "word": "int", "set": "uint32_t"}


def c_option(command, o):
    letter = f"'{o.letter}'" if o.letter else "0"
    offset = o.field if o.kind == "operand" else f"offsetof({o.of or command.values}, {o.field})"
    return (f"    {{ {c_text(o.name)}, {letter}, ARG_{o.kind.upper()}, {offset},\n"
            f"      {c_text(o.value)}, {c_text(o.help)},\n"
            f"      {o.low}, {o.high}, {o.array or 'NULL'}, {c_text(o.page)},\n"
            f"      {c_text(' '.join(o.only))} }},")


def c_check(command, o):
    field = f"(({o.of or command.values} *)0)->{o.field}"
    return (f"_Static_assert(_Generic({field}, {C_TYPES[o.kind]} : 1, default : 0),\n"
            f"               \"--{o.name}: {o.field} is no {C_TYPES[o.kind]}\");")


def c_tables(command):
    rows = "\n".join(c_option(command, o) for o in command.options())
    checks = "\n".join(c_check(command, o) for o in command.options() if o.kind != "operand")
    return f"""/* Generated from tools/cli/options/{command.name}.options and shared.options; edit these. */
static const arg_option options[] = {{
{rows}
    {{ 0 }},
}};
{checks}

static const arg_spec spec = {{
    .command = {c_text(command.name)},
    .operands = {c_text(command.operands)},
    .least = {command.least},
    .most = {command.most},
    .summary = {c_text(command.summary)},
    .text = {c_text(command.text)},
    .options = options,
    .dash = {c_text(command.dash.replace(".", " "))},
    .writes = {c_text(command.writes)},
}};
"""


# --- man pages ---

def mdoc_quoted(text):
    return '"' + text.replace('"', "\\(dq") + '"' if " " in text else text


def mdoc_sentence(text):
    text = text.replace("\\", "\\e")
    return text[0].upper() + text[1:] + ("" if text.endswith(".") else ".")


def mdoc_item(o):
    value = f" Ar {mdoc_quoted(o.value)}" if o.value else ""
    short = f"Fl {o.letter} , " if o.letter else ""
    return f".It {short}Fl -{o.name}{value}"


def mdoc_options(runs):
    lines, after = [".Bl -tag -width Ds"], []
    for options, about in runs:
        if options[0].page:
            after += [".Pp", *about]
            continue
        for o in options:
            lines.append(mdoc_item(o))
            if about is None:
                lines += o.man or [mdoc_sentence(o.help)]
        lines += about or []
    return lines + [".El"] + after


def mdoc_operand(word):
    optional = word.startswith("[")
    word = word.strip("[]")
    more = " ..." if word.endswith("...") else ""
    name = word.removesuffix("...")
    text = f"Ar {name}{more}"
    return f".Op {text}" if optional else f".{text}"


def mdoc_synopsis(command):
    return [".Sh SYNOPSIS", f".Nm ebpo {command.name}", ".Op Ar options",
            *(mdoc_operand(word) for word in command.operands.split())]


def mdoc_list_of_commands(commands):
    lines = [".Bl -tag -width distance"]
    for command in commands:
        lines += [f".It Cm {command.name}", f"{command.summary}; see", f".Xr ebpo-{command.name} 1"]
    return lines + [".It Cm help", "prints the options of a command, as its", ".Fl -help", "does;",
                    "for", ".Cm remote", "prints the options for URLs",
                    ".El"]


def filled(line, name, shared, commands):
    """Returns the lines that replace a mark, or the line itself."""
    command = next((c for c in commands if f"ebpo-{c.name}.1" == name), None)
    if line == "@COMMANDS@":
        return mdoc_list_of_commands(commands)
    if line == "@PAGES@":
        return [f".Xr ebpo-{c} 1 ," for c in sorted(c.name for c in commands)]
    group = re.fullmatch(r"@OPTIONS ([a-z]+)@", line)
    if group:
        keys = shared.groups[group[1]][0]
        return mdoc_options([([shared.take(name, key, "", [])], None) for key in keys])
    if not command:
        return [line]
    return {"@NAME@": [".Sh NAME", f".Nm ebpo-{command.name}", f".Nd {command.summary}"],
            "@SYNOPSIS@": mdoc_synopsis(command),
            "@OPTIONS@": mdoc_options(command.runs + [([HELP], None)])}.get(line, [line])


def page(name, shared, commands):
    with open(os.path.join(HERE, "..", "..", "man", name), encoding="utf-8") as file:
        lines = [part for line in file.read().splitlines()
                 for part in filled(line, name, shared, commands)]
    # a page refers to itself by name only
    itself = f".Xr {name[:-2]} {name[-1]}"
    lines = [".Nm" + line[len(itself):] if line.startswith(itself) else line for line in lines]
    marks = [line for line in lines if re.fullmatch(r"@.*@", line)]
    if marks:
        raise option_tables.Wrong(f"tools/man/{name}: '{marks[0]}' is not a mark of this page")
    return "\n".join(lines) + "\n"


def main():
    what, out, *names = sys.argv[1:]
    shared, commands = option_tables.read_all(HERE, names)
    if what == "tables":
        for command in commands:
            write(os.path.join(out, command.name + ".inc"), c_tables(command))
    elif what == "pages":
        pages = ["ebpo.1", "ebpo-remote.7"] + [f"ebpo-{name}.1" for name in names]
        for name in pages:
            write(os.path.join(out, name), page(name, shared, commands))
    else:
        for name, text in completions.make(commands, HELP):
            write(os.path.join(out, name), text)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except option_tables.Wrong as wrong:
        sys.exit(f"make_options.py: {wrong}")
