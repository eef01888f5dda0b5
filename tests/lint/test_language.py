#!/usr/bin/env python3
"""Checks the language of documentation, help, messages and comments: test_language.py SOURCE_ROOT

- Words of the table WORDS are not used; `docs/develop/glossary.md` has the words to use.
- No comment begins with "Of" or "Whether".
- Identifiers do not contain the words NAMES.
- Pages are not longer than LENGTHS.
- Subjects of commits have at most 72 characters.
Exceptions are lines of language_exceptions.txt: `file: text of the line`.
"""
import pathlib
import re
import subprocess
import sys

WORDS = {
    r"told|tells|untold|telling": "reported, prints, returns; silent",
    r"mend|mends|mended|mending": "fix, repair",
    r"weakness(?:es)?": "vulnerability",
    r"strangers?(?:'s)?": "untrusted input; misbehaving server",
    r"house|desk|in hand": "layout; remove",
    r"room|rooms": "quota, reserve, space",
    r"spot|spots": "position",
    r"usual": "default",
    r"weather|while things fail": "fault injection",
    r"way out": "separation distance along a direction",
    r"what there is no|whatever that|of which each|of each which|which nobody": "(rewrite the sentence)",
    r"as in the source|of today": "original, current",
    r"by the clock": "wall-clock time",
}
NAMES = re.compile(r"(?:^|_)(?:told|mend|mended|stranger|strangers|usual|weather|twin)(?:_|$)", re.I)
# The most words of a page, by the beginning of its path; the first that matches counts.
LENGTHS = {"README.md": 700, "CONTRIBUTING.md": 1400, "docs/guide/": 1800, "docs/develop/collision.md": 5200,
           "docs/develop/": 4200, "docs/measured/": 3200, "docs/README.md": 700, "tools/": 600, "tests/": 600,
           "samples/": 600}
MOST_WORDS = 60000  # all pages
FIRST_COMMIT = "164634da07b9629ec919603a122ceffcd441adc9"  # commits after this one are checked
# The specification has rules of its own; changelogs name what was; the others are made by programs.
EXCLUDED = re.compile(r"format-spec/|CHANGELOG\.md$|tests/fuzz/(?:seeds|corpus|dict)/|tests/lint/(?:language_exceptions\.txt|"
                      r"test_language\.py|libebpo\.abi)$|.*(?:package-lock\.json|\.svg|\.png|\.pack)$|LICENSE")
C_TEXT = re.compile(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'', re.S)
PATTERN = re.compile(r"\b(?:" + "|".join(f"(?P<w{i}>{w})" for i, w in enumerate(WORDS)) + r")\b", re.I)
INSTEAD = list(WORDS.values())


def tracked(root):
    try:
        names = subprocess.run(["git", "ls-files", "-z"], cwd=root, capture_output=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        print("skipped: this is not a git repository")
        sys.exit(77)
    return [n for n in names.stdout.decode().split("\0") if n and (root / n).is_file()]


def is_c(name):
    return name.endswith((".c", ".h", ".inc", ".cpp", ".in")) and not name.endswith("cmake.in")


def prose(name, text):
    """Yields (offset, text) of what people read: all of a page, comments and strings of a source."""
    if is_c(name):
        for m in C_TEXT.finditer(text):
            if m[0][0] != "'" and "#include" not in text[text.rfind("\n", 0, m.start()) + 1:m.start()]:
                yield m.start(), m[0]
    elif name.endswith((".py", ".sh", ".js", ".mjs", ".build")):
        for m in re.finditer(r'"""(?:.*?)"""|(?:^|(?<=\s))(?:#|//) [^\n]*|/\*.*?\*/', text, re.S | re.M):
            yield m.start(), m[0]
    elif name.endswith(".md"):
        yield 0, re.sub(r"`[^`\n]*`|^    [^\n]*|^```.*?^```", lambda m: re.sub(r"[^\n]", " ", m[0]), text, flags=re.S | re.M)
    elif name.endswith((".options", ".1", ".7", ".html", ".css")):
        yield 0, text


def line_at(text, offset):
    begin = text.rfind("\n", 0, offset) + 1
    end = text.find("\n", offset)
    return text.count("\n", 0, offset) + 1, text[begin:end if end >= 0 else None].strip()


def words_in(name, text):
    for begin, part in prose(name, text):
        for m in PATTERN.finditer(part):
            instead = next(INSTEAD[i] for i in range(len(INSTEAD)) if m[f"w{i}"])
            yield begin + m.start(), f'"{m[0]}"; write: {instead}'
    if is_c(name):
        for m in re.finditer(r"(?:/\*+|//)\s*(Of|Whether)\b", text):
            yield m.start(), f'a comment begins with "{m[1]}"'
        code = C_TEXT.sub(lambda m: " " * len(m[0]), text)
        for m in re.finditer(r"[A-Za-z_]\w*", code):
            if NAMES.search(m[0]):
                yield m.start(), f"the name {m[0]}"


def length_of(name, text):
    for begin, most in LENGTHS.items():
        if name.startswith(begin):
            return None if len(text.split()) <= most else f"{name}: {len(text.split())} words, at most {most}"
    return None


def long_subjects(root):
    found = subprocess.run(["git", "log", "--no-merges", "--format=%h %s", f"{FIRST_COMMIT}..HEAD"], cwd=root,
                           capture_output=True, text=True, check=False)
    for line in found.stdout.splitlines():
        subject = line.split(" ", 1)[1]
        if len(subject) > 72:
            yield f"commit {line}: {len(subject)} characters, at most 72"


def main():
    root = pathlib.Path(sys.argv[1])
    exceptions = set((root / "tests/lint/language_exceptions.txt").read_text(encoding="utf-8").splitlines())
    used, wrong, words = set(), list(long_subjects(root)), 0
    for name in tracked(root):
        if EXCLUDED.match(name):
            continue
        try:
            text = (root / name).read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue
        if name.endswith(".md"):
            words += len(text.split())
            too_long = length_of(name, text)
            wrong += [too_long] if too_long else []
        for offset, what in words_in(name, text):
            number, line = line_at(text, offset)
            if f"{name}: {line}" in exceptions:
                used.add(f"{name}: {line}")
            else:
                wrong.append(f"{name}:{number}: {what}\n    {line}")
    if words > MOST_WORDS:
        wrong.append(f"{words} words of Markdown, at most {MOST_WORDS}")
    wrong += [f"language_exceptions.txt: not needed: {line}" for line in sorted(exceptions - used) if line]
    print("\n".join(wrong))
    print(f"language: {words} words of Markdown, {len(exceptions)} exceptions, {len(wrong)} violations")
    return bool(wrong)


sys.exit(main())
