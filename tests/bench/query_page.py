"""Tables and values of the pages in docs/measured."""
import pathlib
import textwrap

COLUMNS = 110
HANDWRITTEN = "<!-- Written by hand; the script keeps what follows. -->"


class Page:
    def __init__(self):
        self.lines = []

    def text(self, *lines):
        self.lines += list(lines) + [""]

    def table(self, head, rows):
        self.lines.append("| " + " | ".join(head) + " |")
        self.lines.append("|" + "---|" * len(head))
        self.lines += ["| " + " | ".join(str(c) for c in row) + " |" for row in rows] + [""]


def handwritten(path):
    """Returns the handwritten end of an existing page, or an empty string."""
    page = pathlib.Path(path)
    text = page.read_text(encoding="utf-8") if page.exists() else ""
    at = text.find(HANDWRITTEN)
    return "\n" + text[at:] if at >= 0 else ""


def reflow(text):
    """Breaks the paragraphs and list items of a Markdown text into lines of at most COLUMNS."""
    out, words = [], []

    def flush():
        if words:
            out.extend(textwrap.wrap(" ".join(words), COLUMNS, break_long_words=False, break_on_hyphens=False,
                                     subsequent_indent="  " if words[0].startswith("- ") else ""))
            words.clear()
    for line in text.split("\n"):
        if not line.strip() or line.startswith(("|", "#", "!", "<", "    ")):
            flush()
            out.append(line)
        else:
            if line.startswith("- "):
                flush()
            words.append(line.strip())
    flush()
    return "\n".join(out)


def figure(value, digits=3):
    """Formats a value with about three digits; a dash for a missing value."""
    if value is None:
        return "-"
    if isinstance(value, str):
        return value
    if value == 0 or abs(value) >= 100:
        return f"{value:,.0f}"
    return f"{value:.{digits}g}"


def us(nanoseconds):
    return figure(None if nanoseconds is None else nanoseconds / 1000)


def quotient(ours, theirs):
    return ours / theirs if ours is not None and theirs else None


def ratio(ours, theirs):
    return figure(quotient(ours, theirs), 2)
