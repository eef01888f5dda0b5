#!/usr/bin/env python3
"""Prints the tables of docs/measured/view.md: tests/bench/view.py EBPO FILE.ebpo.h5 [MILLISECONDS]

The three views of a model are the whole model, an eighth of the angle, and ten times the distance. For each view the
script prints the bytes of the file until no visible node is larger than a number of pixels, compared with whole levels;
the size of the largest visible node after a number of bytes, by order; and the requests and waiting times with a local
server that waits MILLISECONDS (default 50) before each response. Bytes, nodes and pixels do not depend on the machine.
"""
import http.server
import json
import os
import re
import subprocess
import sys
import threading
import time

EBPO, FILE = sys.argv[1:3]
DELAY = float(sys.argv[3]) / 1000 if len(sys.argv) > 3 else 0.05
ORDERS = ["level", "distance", "pixels", "front-to-back"]


def run(*arguments):
    return json.loads(subprocess.run([EBPO, *arguments, "--json"], check=True, capture_output=True,
                                     text=True).stdout)


def row(*cells):
    print("| " + " | ".join(str(cell) for cell in cells) + " |")


def head(*cells):
    row(*cells)
    row(*["---"] * len(cells))


def views():
    info = run("info", FILE)
    middle = [o + s / 2 for o, s in zip(info["box_origin"], info["box_size"])]
    side = max(info["box_size"])

    def view(away, up, fov):
        eye = [middle[0], middle[1] + 0.25 * away * side, middle[2] + away * side]
        look = [middle[0], middle[1] + up * side, middle[2]]
        return ["--eye=" + ",".join(map(repr, eye)), "--look=" + ",".join(map(repr, look)), "--fov",
                str(fov), "--size", "1280x960"]

    return {"all of it": view(1.6, 0, 40), "an eighth of the angle": view(1.6, 0.25, 5),
            "ten times as far": view(16, 0, 40)}


def deepest(view, pixels):
    """Returns the deepest level that this view needs."""
    for level in range(1, 21):
        try:
            last = run("view", FILE, *view, "--seen-only", "--order", "level", "--max-level",
                       str(level))["last"]
        except subprocess.CalledProcessError:
            return level - 1
        if last["pixels"] <= pixels:
            return level
    return 20


class Slow(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True

    def do_GET(self):
        begin, last = map(int, re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers["Range"]).groups())
        size = os.path.getsize(FILE)
        last = min(last, size - 1)
        time.sleep(DELAY)
        with open(FILE, "rb") as f:
            f.seek(begin)
            body = f.read(last + 1 - begin)
        self.send_response(206)
        for name, value in (("Content-Range", f"bytes {begin}-{last}/{size}"),
                            ("Content-Length", len(body)), ("ETag", '"1"')):
            self.send_header(name, str(value))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_):
        pass


def main():
    print(f"{os.path.basename(FILE)}, {os.path.getsize(FILE):,} bytes, picture of 1280 x 960\n")
    head("view", "pixels", "nodes", "bytes", "whole levels", "nodes", "bytes", "`levels`")
    for name, view in views().items():
        for pixels in (16, 1):
            last = run("view", FILE, *view, "--seen-only", "--pixels", str(pixels))["last"]
            level = deepest(view, pixels)
            whole = run("view", FILE, "--max-level", str(level))["last"]
            levels = run("levels", FILE, "--max-level", str(level), "--stats")["traffic"]["bytes_read"]
            row(name, pixels, f"{last['nodes']:,}", f"{last['bytes_read']:,}", f"0 to {level}",
                f"{whole['nodes']:,}", f"{whole['bytes_read']:,}", f"{levels:,}")
    print("\nLargest visible node in pixels after a number of bytes, and the number of nodes:\n")
    head("view", "bytes", *ORDERS)
    for name, view in list(views().items())[:2]:
        for size in ("512KiB", "2MiB"):
            lasts = [run("view", FILE, *view, "--order", order, "--bytes", size)["last"]
                     for order in ORDERS]
            row(name, size, *(f"{last['pixels']:.3g} ({last['nodes']:,})" for last in lasts))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Slow)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    url = f"http://127.0.0.1:{server.server_address[1]}/{os.path.basename(FILE)}"
    print(f"\nA server that waits {DELAY * 1000:g} ms before each response, down to 4 pixels:\n")
    head("view", "order", "requests", "bytes", "s waited")
    for name, view in list(views().items())[:2]:
        for order in ORDERS:
            traffic = run("view", url, *view, "--seen-only", "--pixels", "4", "--order", order,
                          "--stats")["traffic"]
            row(name, order, traffic["requests"], f"{traffic['bytes']:,}",
                f"{traffic['seconds_waited']:.1f}")
    server.shutdown()


main()
