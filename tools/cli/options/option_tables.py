"""Reads NAME.options and shared.options, the source of parsing, --help, manuals and completions.

A file has records, separated by empty lines; a line that begins with # is a comment. A record has a
first line, lines that begin with two blanks (a word and its value; four blanks continue it), and
lines of mdoc for the man page:

    command NAME              once in a file NAME.options, with the lines
      operands A [B] C...     expected operands; those in brackets are optional
      summary TEXT            one line
      text TEXT               further text for --help
      values TYPE             C struct that options fill; default: `values`
      least N, most N         numbers of operands, if `operands` does not give them
      dash .io                meaning of "-" for each operand: see arg_spec
      writes h5 hdf5          allowed endings of the second operand
    option NAME [-LETTER] [VALUE]
      flag|int|real|text|list|word|set FIELD ...
                              for int and real: least and greatest value; for word and set: C array of
                              the words, and the words
      help TEXT               short text for --help
      of TYPE                 struct of FIELD, if it is the first member of the command's struct
      only WORD...            the first operands with which the option can be used; default: any
      key KEY                 in shared.options: name for `use`; default: NAME
    (mdoc)                    for the man page; default: the help
    use KEY...                shared options; mdoc is added after that of the last one
      of TYPE, only WORD...   as above
      in MEMBER.              prefix of their fields
      set NAME TEXT           replaces {NAME} in help and mdoc
    group KEY                 in shared.options: `use KEY` uses several options
      options KEY...
      page NAME               `ebpo help NAME` describes these options instead of --help
    (mdoc)                    text for all of them; the texts of the options are for the page NAME
    text KEY                  in shared.options: mdoc that replaces a line @KEY@
"""
import os
import re

KINDS = ("flag", "int", "real", "text", "list", "word", "set")
# The option that commands with an operand OUT accept in its place; kind "operand" is made here only.
OUTPUT = "output"


class Wrong(Exception):
    """An error in a table, with its position."""


class Option:
    """name, letter, value ('' for flags), kind, of, field, low, high, array, words, help, man, only: the
    words of the first operand with which the option can be used, and page: the page of `ebpo help` that
    describes the option, or '' for --help."""

    def __init__(self, **members):
        self.__dict__.update(members)

    def head(self):
        """'--memory SIZE' as --help and completions show it."""
        return f"--{self.name}" + (f" {self.value}" if self.value else "")


class Command:
    """A command: name, operands, least, most, summary, text, values, dash, writes, and `runs`: lists
    of options, with the common mdoc of a list, or None."""

    def __init__(self, **members):
        self.__dict__.update(members)

    def options(self):
        return [o for options, _ in self.runs for o in options]


def records(path):
    """Yields for each record: its position, the words of its first line, its lines as [(word, text)],
    and its lines of mdoc."""
    with open(path, encoding="utf-8") as file:
        lines = file.read().splitlines()
    at = 0
    while at < len(lines):
        if not lines[at] or lines[at].startswith("#"):
            at += 1
            continue
        start, head, facts, man = at, lines[at], [], []
        at += 1
        while at < len(lines) and lines[at]:
            line = lines[at]
            if line.startswith("    ") and facts:
                facts[-1] = (facts[-1][0], facts[-1][1] + " " + line.strip())
            elif line.startswith("  "):
                word, _, text = line.strip().partition(" ")
                facts.append((word, text.strip()))
            elif not line.startswith("#"):
                man.append(line)
            at += 1
        yield f"{path}:{start + 1}", head.split(), facts, man


def fact(where, facts, word, default=None):
    """Returns the text of the line `word`. Without a default, the line must exist."""
    found = [text for name, text in facts if name == word]
    if len(found) > 1 or (not found and default is None):
        raise Wrong(f"{where}: expected one line '{word}'")
    return found[0] if found else default


def short_help(only, text):
    return (", ".join(only) + ": " if only else "") + text


def read_option(where, head, facts, man):
    rest = head[2:]
    letter = rest.pop(0)[1] if rest and re.fullmatch(r"-[a-zA-Z]", rest[0]) else ""
    known = [(name, text) for name, text in facts if name in KINDS]
    if len(known) != 1:
        raise Wrong(f"{where}: expected one line of {', '.join(KINDS)}")
    kind, words = known[0][0], known[0][1].split()
    if (kind == "flag") != (not rest):
        raise Wrong(f"{where}: an option that is not a flag needs the name of its value")
    more = {"low": "0", "high": "0", "array": "", "words": []}
    if kind in ("int", "real"):
        more["low"], more["high"] = words[1:]
    elif kind in ("word", "set"):
        more["array"], more["words"] = words[1], words[2:]
    for name, _ in facts:
        if name not in KINDS + ("help", "key", "of", "only"):
            raise Wrong(f"{where}: '{name}' unknown line of an option")
    only = fact(where, facts, "only", "").split()
    short = short_help(only, fact(where, facts, "help"))
    return Option(where=where, name=head[1], letter=letter, value=" ".join(rest), kind=kind,
                  field=words[0], help=short, of=fact(where, facts, "of", ""), man=man, only=only, page="",
                  **more)


class Shared:
    """shared.options: options by their keys, groups, and texts of several pages."""

    def __init__(self, path):
        self.options, self.groups, self.texts, self.used = {}, {}, {}, set()
        for where, head, facts, man in records(path):
            if head[0] == "option":
                self.options[fact(where, facts, "key", head[1])] = read_option(where, head, facts,
                                                                               man)
            elif head[0] == "group":
                self.groups[head[1]] = (fact(where, facts, "options").split(), man,
                                        fact(where, facts, "page", ""))
            elif head[0] == "text":
                self.texts[head[1]] = man
            else:
                raise Wrong(f"{where}: '{head[0]}' unknown record")

    def mdoc(self, where, lines):
        out = []
        for line in lines:
            key = re.fullmatch(r"@([a-z-]+)@", line)
            if key and key[1] not in self.texts:
                raise Wrong(f"{where}: text '{key[1]}' not found")
            out += self.texts[key[1]] if key else [line]
        return out

    def take(self, where, key, member, sets, of="", page="", only=()):
        if key not in self.options:
            raise Wrong(f"{where}: shared option '{key}' not found")
        self.used.add(key)
        option = Option(**self.options[key].__dict__)
        option.of, option.field, option.page = of, member + option.field, page
        option.only = list(only)

        def filled(text):
            for name, value in sets:
                text = text.replace("{" + name + "}", value)
            if re.search(r"\{[a-z]+\}", text):
                raise Wrong(f"{where}: '{key}' needs a line 'set': {text}")
            return text
        option.help = short_help(option.only, filled(option.help))
        option.man = [filled(line) for line in self.mdoc(where, option.man)]
        return option

    def use(self, where, head, facts, man):
        """Returns the lists of options that a record `use` adds to Command.runs."""
        member, of = fact(where, facts, "in", ""), fact(where, facts, "of", "")
        only = fact(where, facts, "only", "").split()
        sets = [text.partition(" ")[::2] for name, text in facts if name == "set"]
        runs = []
        for key in head[1:]:
            if key in self.groups:
                keys, about, page = self.groups[key]
                runs.append(([self.take(where, k, member, sets, of, page, only) for k in keys], about))
            else:
                runs.append(([self.take(where, key, member, sets, of, only=only)], None))
        if man:
            runs[-1][0][-1].man += self.mdoc(where, man)
        return runs


def count_operands(where, facts):
    words = fact(where, facts, "operands").split()
    least = sum(not word.startswith("[") for word in words)
    most = "ARGS_OPERANDS_MAX" if words[-1].endswith("...") else str(len(words))
    return fact(where, facts, "least", str(least)), fact(where, facts, "most", most)


def add_output(command):
    """Adds the option --output, which may replace the operand OUT, if the command has no such option."""
    names = [word.strip("[]") for word in command.operands.split()]
    at = next((i for i, word in enumerate(names) if word.startswith("OUT")), None)
    if at is None or any(o.name == OUTPUT for o in command.options()):
        return
    option = Option(where=command.name, name=OUTPUT, letter="o", value=names[at], kind="operand",
                    field=str(at), of="", low="0", high="0", array="", words=[], only=[], page="",
                    help=f"the output, in place of the operand {names[at]}",
                    man=["The output, in place of the operand", f".Ar {names[at]} ."])
    command.runs.insert(0, ([option], None))


def read_command(folder, name, shared):
    path = os.path.join(folder, name + ".options")
    command = None
    for where, head, facts, man in records(path):
        if head[0] == "command":
            operands = fact(where, facts, "operands")
            least, most = count_operands(where, facts)
            command = Command(name=name, operands=operands, least=least, most=most, runs=[],
                              **{key: fact(where, facts, key, default) for key, default in
                                 (("summary", None), ("text", ""), ("values", "values"),
                                  ("dash", ""), ("writes", ""))})
        elif head[0] == "option":
            command.runs.append(([read_option(where, head, facts, shared.mdoc(where, man))], None))
        elif head[0] == "use":
            command.runs += shared.use(where, head, facts, man)
        else:
            raise Wrong(f"{where}: '{head[0]}' unknown record")
    add_output(command)
    seen = set()
    for option in command.options():
        for mark in [option.name] + [option.letter] * bool(option.letter):
            if mark in seen or mark in ("help", "h"):
                raise Wrong(f"{option.where}: '{mark}' is defined twice")
            seen.add(mark)
    if any(o.only for o in command.options()[64:]):
        raise Wrong(f"{path}: options with a line 'only' must be among the first 64")
    return command


def read_all(folder, names):
    shared = Shared(os.path.join(folder, "shared.options"))
    commands = [read_command(folder, name, shared) for name in names]
    idle = set(shared.options) - shared.used
    if idle:
        raise Wrong(f"shared.options: unused options: {', '.join(sorted(idle))}")
    return shared, commands
