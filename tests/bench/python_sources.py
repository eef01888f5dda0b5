#!/usr/bin/env python3
"""Measures reads and memory of one Python query, by kind of source: python_sources.py MODEL.ebpo.h5

    PYTHONPATH=build/tools/python tests/bench/python_sources.py scan.ebpo.h5 [--latency 0.05] [--point X Y Z]

A web server in this process counts requests and bytes of bodies for `inside` and `distance` of one point. The sources
are a URL with the library's HTTP (libcurl), a URL with Python's HTTP, and fsspec, as a URL and as a file object, if
fsspec and aiohttp are installed. Opening is counted separately. Then the script measures the memory of a process that
opens the file by its path, with one point and without. Each row opens the file again.
"""
import argparse
import http.server
import pathlib
import re
import subprocess
import sys
import threading
import time

import ebpo
from ebpo import sources
from ebpo.errors import UnsupportedError

PEAK = r"""
import re, sys, ebpo
model = ebpo.open(sys.argv[1])
if len(sys.argv) > 2:
    model.inside([float(x) for x in sys.argv[2:]])
print(re.search(r"VmHWM:\s+(\d+)", open("/proc/self/status").read())[1])
"""


class Server(http.server.BaseHTTPRequestHandler):
    protocol_version, path_of_file, latency = "HTTP/1.1", pathlib.Path(), 0.0
    counts, lock = [0, 0], threading.Lock()

    def do_HEAD(self):
        self.do_GET()

    def do_GET(self):
        time.sleep(Server.latency)
        size = Server.path_of_file.stat().st_size
        requested = re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers["Range"] or "")
        first, last = (int(requested[1]), min(int(requested[2] or size), size - 1)) if requested else (0, size - 1)
        self.send_response(206 if requested else 200)
        if requested:
            self.send_header("Content-Range", f"bytes {first}-{last}/{size}")
        self.send_header("Content-Length", str(last + 1 - first))
        self.send_header("Accept-Ranges", "bytes")
        self.send_header("ETag", '"1"')
        self.end_headers()
        body = 0 if self.command == "HEAD" else last + 1 - first
        with Server.lock:
            Server.counts[0] += 1
            Server.counts[1] += body
        with open(Server.path_of_file, "rb") as file:
            file.seek(first)
            if body:
                self.wfile.write(file.read(body))

    def log_message(self, *_):
        pass


def fsspec_file(url):
    import aiohttp  # noqa: F401
    import fsspec
    return ebpo.open(fsspec.open(url).open())


def fsspec_url(url):
    import aiohttp  # noqa: F401
    return ebpo.open(url, storage_options={})


def counted(function):
    """Call a function. Return its result, and the requests, bytes and seconds of the call."""
    before, began = list(Server.counts), time.perf_counter()
    try:
        result = function()
    except (BrokenPipeError, ConnectionError) as error:
        result = error
    return result, [after - b for after, b in zip(Server.counts, before)] + [time.perf_counter() - began]


def row(name, open_it, query):
    model, opening = counted(open_it)
    _, querying = counted(lambda: query(model))
    print(f"| {name} | {opening[0]} | {opening[1]:,} | {querying[0]} | {querying[1]:,} | {querying[2]:.2f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=pathlib.Path)
    parser.add_argument("--latency", type=float, default=0.05, help="seconds before each response")
    parser.add_argument("--point", type=float, nargs=3, default=[0.3, 0.4, 0.5])
    options = parser.parse_args()
    Server.path_of_file, Server.latency = options.model.absolute(), options.latency
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Server)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    url, has_http = f"http://127.0.0.1:{server.server_port}/model", sources.has_http
    print(f"{options.model.stat().st_size:,} bytes, {options.latency:g} s before each response\n")
    print("| one point, by | requests to open | bytes | requests of the query | bytes | s |\n|---|---:|---:|---:|---:|---:|")
    for what, query in (("inside", lambda m: m.inside(options.point)), ("distance", lambda m: m.distance(options.point))):
        for name, open_it in (("URL, libcurl", lambda: ebpo.open(url)), ("URL, without libcurl", lambda: ebpo.open(url)),
                              ("fsspec, URL", lambda: fsspec_url(url)), ("fsspec, file object", lambda: fsspec_file(url))):
            sources.has_http = (lambda: False) if "without" in name else has_http
            try:
                row(f"{what}, {name}", open_it, query)
            except (ImportError, UnsupportedError) as error:
                print(f"| {what}, {name} | not available: {error} | | | | |")
    print("\n| process, path | peak of memory, KiB |\n|---|---:|")
    for name, point in (("opened", []), ("opened, one point", map(str, options.point))):
        done = subprocess.run([sys.executable, "-c", PEAK, options.model, *point], check=True, capture_output=True)
        print(f"| {name} | {int(done.stdout):,} |")


main()
