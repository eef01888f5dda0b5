#!/usr/bin/env python3
"""Remakes docs/measured/attributes.md.

Compares every PLY of a folder with its copies from a file, a subset and HTTP, and measures the size of attributes.

    tests/bench/attributes.py EBPO MODELS_DIR... > docs/measured/attributes.md

EBPO: the tool; MODELS_DIR: folders of PLY files. tests/cli/same_ply.py compares the files; it has a separate PLY
reader. Exit code 1: a file differs.
"""
import functools
import http.server
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import threading

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "cli"))
import same_ply  # noqa: E402
from query_page import reflow  # noqa: E402

EBPO, FOLDERS = sys.argv[1], sys.argv[2:]
WIDTHS = {"int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4, "float32": 4, "float64": 8}
wrong = []


class Ranges(http.server.SimpleHTTPRequestHandler):
    """Serves byte ranges of the files in a folder. `sent`: bytes of response bodies."""
    protocol_version = "HTTP/1.1"
    sent = 0

    def log_message(self, *arguments):
        pass

    def do_GET(self):
        data = pathlib.Path(self.translate_path(self.path)).read_bytes()
        begin, end = map(int, re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers["Range"]).groups())
        body = data[begin:end + 1]
        self.send_response_only(206)
        self.send_header("ETag", '"1"')
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Content-Range", f"bytes {begin}-{begin + len(body) - 1}/{len(data)}")
        self.end_headers()
        self.wfile.write(body)
        Ranges.sent += len(body)


def ebpo(*arguments):
    done = subprocess.run([EBPO, *map(str, arguments)], capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if done.returncode:
        raise RuntimeError(done.stderr.strip().splitlines()[-1])
    return done.stdout


def back(file, folder):
    ebpo("extract", "-q", "--mesh", file, folder / "back.ply")
    return same_ply.Ply(folder / "back.ply")


def verdict(name, what, compare, source, other):
    try:
        compare(source, other)
    except SystemExit as e:
        wrong.append(f"{name}, {what}: {e}")
        return "**differs**"
    return "same"


def half(info):
    """Return a box that contains half of the model along each axis."""
    low, size = info["box_origin"], info["box_size"]
    return ",".join(repr(v) for v in (*low, *(a + b / 2 for a, b in zip(low, size))))


def raw_bytes(info, file):
    """Returns the bytes of the values in a binary PLY."""
    total = 0
    for a in info.get("attributes", []):
        total += WIDTHS[a["type"]] * a["columns"] * a["rows"]
    return total


def check_model(path, folder, url):
    name = path.stem
    full, bare = folder / "m.ebpo.h5", folder / "bare.ebpo.h5"
    ebpo("convert", "-q", path, full)
    ebpo("convert", "-q", "--parts", "-attributes", path, bare)
    info, plain = (json.loads(ebpo("info", "--json", f)) for f in (full, bare))
    source = same_ply.Ply(path)
    whole = verdict(name, "whole", same_ply.compare, source, back(full, folder))
    box = "--box=" + half(info)
    ebpo("subset", "-q", box, full, folder / "part.ebpo.h5")
    empty = "mesh" not in json.loads(ebpo("info", "--json", folder / "part.ebpo.h5"))["parts"]
    part = "empty" if empty else verdict(name, "subset", same_ply.compare_subset, source,
                                         back(folder / "part.ebpo.h5", folder))
    ebpo("fetch", "-q", url + "/m.ebpo.h5", folder / "fetched.ebpo.h5")
    fetched = verdict(name, "fetch", same_ply.compare, source, back(folder / "fetched.ebpo.h5", folder))
    ebpo("fetch", "-q", box, url + "/m.ebpo.h5", folder / "far.ebpo.h5")
    far = "empty" if empty else verdict(name, "fetch of a box", same_ply.compare_subset, source,
                                        back(folder / "far.ebpo.h5", folder))
    kept = sorted({f"{a['element']}: {a['names']}" for a in info.get("attributes", [])})
    raw, more = raw_bytes(info, full), info["bytes"]["file"] - plain["bytes"]["file"]
    return (name, info["vertices"], info["faces"], "; ".join(kept) or "-", path.stat().st_size, plain["bytes"]["file"],
            info["bytes"]["file"], raw, more, f"{more / raw:.2f}" if raw else "-", whole, part, fetched, far)


HEAD = """# Attributes

- {equal} of {count} PLY models come back identical: elements, comments, properties, types and all values, in
  source order.
- The same holds for a subset of a box and for files fetched over HTTP.
- Attributes take {low:.2f} to {high:.2f} times the bytes that their values take in a binary PLY (models of
  more than 1000 faces). Models without attributes take at most {extra} bytes more.

Made by `tests/bench/attributes.py EBPO {names} > docs/measured/attributes.md`; the results do not depend on
the machine. `tests/cli/same_ply.py`, a separate PLY reader, compares each source with the mesh of four copies: the
whole file, a subset, the file by `ebpo fetch`, and the subset by `ebpo fetch`. The subset is one of the eight parts
of the box. Every vertex and face of the subset must be in the source, with its values and in the same order. Models
whose subset is empty: {empty}.
"""
MORE = """
*PLY*: bytes of the source. *file without*, *with*: bytes of the file without and with attributes.
*raw*: bytes of the values in a binary PLY. *more*: bytes that attributes add to the file: values,
description, source header and colours of envelopes.
"""


def write(names, rows):
    """Prints the page: the result, and a table of the models with attributes."""
    shares = [float(r[9]) for r in rows if r[7] and r[2] > 1000]
    equal = sum("**differs**" not in r for r in rows)
    print(reflow(HEAD.format(equal=equal, count=len(rows), low=min(shares), high=max(shares), names=names,
                      extra=max((r[8] for r in rows if not r[7]), default=0), empty=sum("empty" in r for r in rows))))
    for r in rows:
        if "**differs**" in r:
            print(f"- differs: {r[0]}, {dict(zip(('whole', 'subset', 'fetch', 'fetch, box'), r[10:]))}")
    print(reflow(MORE))
    cells = ("model", "vertices", "faces", "attributes", "PLY", "file without", "with", "raw", "more", "more / raw")
    print("| " + " | ".join(cells) + " |\n" + "|---" * len(cells) + "|")
    for r in rows:
        if r[7]:
            print("| " + " | ".join(map(str, r[:10])) + " |")


def main():
    names = " ".join(pathlib.Path(f).name for f in FOLDERS)
    refused, rows = [], []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Ranges, directory=name))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        for path in (p for f in FOLDERS for p in sorted(pathlib.Path(f).glob("*.ply"))):
            try:
                row = check_model(path, folder, f"http://127.0.0.1:{server.server_address[1]}")
            except RuntimeError as e:
                refused.append(f"{path.stem}: {str(e).replace(str(path), path.name)}")
                continue
            rows.append(row)
        server.shutdown()
    write(names, rows)
    for line in refused:
        print(f"\nRefused: `{line}`")
    for line in wrong:
        print(line, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
