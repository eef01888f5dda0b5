"""Tables of the pages in docs/measured, and their figures."""


class Page:
    def __init__(self):
        self.lines = []

    def text(self, *lines):
        self.lines += list(lines) + [""]

    def table(self, head, rows):
        self.lines.append("| " + " | ".join(head) + " |")
        self.lines.append("|" + "---|" * len(head))
        self.lines += ["| " + " | ".join(str(c) for c in row) + " |" for row in rows] + [""]


def figure(value, digits=3):
    """About three digits; a dash where there is none."""
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
