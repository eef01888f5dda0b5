"""Reads NAME.options and shared.options, of which everything that tells of options is made.

A file is records with an empty line between them; a line that begins with # is a comment. A record
is a line of what it is, lines that begin with two blanks (a word and what it says; four blanks
continue it), and lines of mdoc for the man page:

    command NAME              of a file NAME.options, once, with the lines
      operands A [B] C...     what is expected, in brackets what may be absent
      summary TEXT            one line
      text TEXT               more for --help
      values TYPE             the C struct that options fill; else `values`
      least N, most N         of operands, where that is not what `operands` says
      dash .io                what "-" is, for each operand: see arg_spec
      writes h5 hdf5          endings that fit the second operand
    option NAME [-LETTER] [VALUE]
      flag|int|real|text|list|word|set FIELD ...
                              for int and real the least and the greatest value; for word and set the
                              C array of the words and the words
      help TEXT               for --help, short
      of TYPE                 the struct of FIELD, where it is the first member of the command's
      key KEY                 in shared.options: its name for `use`; else NAME
    (mdoc)                    for the man page; without any the help is taken
    use KEY...                shared options; mdoc is put behind that of the last one
      of TYPE                 as above
      in MEMBER.              their fields are members of this one
      set NAME TEXT           in place of {NAME} in help and mdoc
    group KEY                 in shared.options: `use KEY` stands for several
      options KEY...
    (mdoc)                    once for all of them: their own is for the page that tells of the group
    text KEY                  in shared.options: mdoc; a line @KEY@ stands for it
"""
import os
import re

KINDS = ("flag", "int", "real", "text", "list", "word", "set")


class Wrong(Exception):
    """What is wrong in a table, and where."""


class Option:
    """name, letter, value ('' for flags), kind, of, field, low, high, array, words, help, man."""

    def __init__(self, **members):
        self.__dict__.update(members)

    def head(self):
        """'--memory SIZE' as --help and completions show it."""
        return f"--{self.name}" + (f" {self.value}" if self.value else "")


class Command:
    """A command: name, operands, least, most, summary, text, values, dash, writes, and `runs`: lists
    of options, with the mdoc that stands for all of a list, or None."""

    def __init__(self, **members):
        self.__dict__.update(members)

    def options(self):
        return [o for options, _ in self.runs for o in options]


def records(path):
    """(line, head, [(word, text)], [mdoc])"""
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


def fact(where, facts, word, usual=None):
    found = [text for name, text in facts if name == word]
    if len(found) > 1 or (not found and usual is None):
        raise Wrong(f"{where}: there is not one line '{word}'")
    return found[0] if found else usual


def read_option(where, head, facts, man):
    rest = head[2:]
    letter = rest.pop(0)[1] if rest and re.fullmatch(r"-[a-zA-Z]", rest[0]) else ""
    known = [(name, text) for name, text in facts if name in KINDS]
    if len(known) != 1:
        raise Wrong(f"{where}: an option has one line of {', '.join(KINDS)}")
    kind, words = known[0][0], known[0][1].split()
    if (kind == "flag") != (not rest):
        raise Wrong(f"{where}: all options but flags have a value, which --help shows")
    more = {"low": "0", "high": "0", "array": "", "words": []}
    if kind in ("int", "real"):
        more["low"], more["high"] = words[1:]
    elif kind in ("word", "set"):
        more["array"], more["words"] = words[1], words[2:]
    for name, _ in facts:
        if name not in KINDS + ("help", "key", "of"):
            raise Wrong(f"{where}: '{name}' is not known of options")
    return Option(where=where, name=head[1], letter=letter, value=" ".join(rest), kind=kind,
                  field=words[0], help=fact(where, facts, "help"), of=fact(where, facts, "of", ""), man=man,
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
                self.groups[head[1]] = (fact(where, facts, "options").split(), man)
            elif head[0] == "text":
                self.texts[head[1]] = man
            else:
                raise Wrong(f"{where}: '{head[0]}' is no record of this file")

    def mdoc(self, where, lines):
        out = []
        for line in lines:
            key = re.fullmatch(r"@([a-z-]+)@", line)
            if key and key[1] not in self.texts:
                raise Wrong(f"{where}: there is no text '{key[1]}'")
            out += self.texts[key[1]] if key else [line]
        return out

    def take(self, where, key, member, sets, of=""):
        if key not in self.options:
            raise Wrong(f"{where}: there is no shared option '{key}'")
        self.used.add(key)
        option = Option(**self.options[key].__dict__)
        option.of, option.field = of, member + option.field

        def filled(text):
            for name, value in sets:
                text = text.replace("{" + name + "}", value)
            if re.search(r"\{[a-z]+\}", text):
                raise Wrong(f"{where}: '{key}' needs a line 'set': {text}")
            return text
        option.help = filled(option.help)
        option.man = [filled(line) for line in self.mdoc(where, option.man)]
        return option

    def use(self, where, head, facts, man):
        """Runs of options, as Command has them."""
        member, of = fact(where, facts, "in", ""), fact(where, facts, "of", "")
        sets = [text.partition(" ")[::2] for name, text in facts if name == "set"]
        runs = []
        for key in head[1:]:
            if key in self.groups:
                keys, about = self.groups[key]
                runs.append(([self.take(where, k, member, sets, of) for k in keys], about))
            else:
                runs.append(([self.take(where, key, member, sets, of)], None))
        if man:
            runs[-1][0][-1].man += self.mdoc(where, man)
        return runs


def count_operands(where, facts):
    words = fact(where, facts, "operands").split()
    least = sum(not word.startswith("[") for word in words)
    most = "ARGS_OPERANDS_MAX" if words[-1].endswith("...") else str(len(words))
    return fact(where, facts, "least", str(least)), fact(where, facts, "most", most)


def read_command(folder, name, shared):
    path = os.path.join(folder, name + ".options")
    command = None
    for where, head, facts, man in records(path):
        if head[0] == "command":
            operands = fact(where, facts, "operands")
            least, most = count_operands(where, facts)
            command = Command(name=name, operands=operands, least=least, most=most, runs=[],
                              **{key: fact(where, facts, key, usual) for key, usual in
                                 (("summary", None), ("text", ""), ("values", "values"),
                                  ("dash", ""), ("writes", ""))})
        elif head[0] == "option":
            command.runs.append(([read_option(where, head, facts, shared.mdoc(where, man))], None))
        elif head[0] == "use":
            command.runs += shared.use(where, head, facts, man)
        else:
            raise Wrong(f"{where}: '{head[0]}' is no record of this file")
    seen = set()
    for option in command.options():
        for mark in [option.name] + [option.letter] * bool(option.letter):
            if mark in seen or mark in ("help", "h"):
                raise Wrong(f"{option.where}: '{mark}' is taken")
            seen.add(mark)
    return command


def read_all(folder, names):
    shared = Shared(os.path.join(folder, "shared.options"))
    commands = [read_command(folder, name, shared) for name in names]
    idle = set(shared.options) - shared.used
    if idle:
        raise Wrong(f"shared.options: nobody has {', '.join(sorted(idle))}")
    return shared, commands
