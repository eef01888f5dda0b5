"""Readers of levels and whole files: the command, the npm package, and HDF5's own readers."""
import json
import os
import pathlib
import statistics
import subprocess
import time

from served import Line

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent.parent


class Readers:
    def __init__(self, build, site, work):
        self.tool, self.site = build / "tools/ebpo", site
        self.plugins = str(build / "lib/hdf5_write")
        self.point = work / "point"
        self.point.write_text("0 0 0\n")

    def ours(self, url, to):
        """Read with the library, through the command that reads the same data."""
        if to == "whole":
            command = [self.tool, "fetch", "-q", url, self.point.with_name("whole.ebpo.h5")]
        else:
            command = [self.tool, "levels", "--json", "--max-level", str(to), url]
        begin = time.perf_counter()
        text = subprocess.run(command, check=True, capture_output=True, text=True,
                              stdin=subprocess.DEVNULL).stdout
        ms = 1e3 * (time.perf_counter() - begin)
        return {"first": json.loads(text)["levels"][0]["ms"] if to != "whole" else None, "ms": ms}

    def ros3(self, url, to):
        environment = dict(os.environ, HDF5_PLUGIN_PATH=self.plugins)
        return json.loads(subprocess.run(["/usr/bin/python3", HERE / "ros3.py", url, str(to)],
                                         check=True, capture_output=True, text=True,
                                         env=environment).stdout)

    def browser(self, reader, url, to):
        done = subprocess.run(["node", HERE / "browser.mjs", ROOT / "tools/web", self.site,
                               reader, url, str(to)], check=True, capture_output=True, text=True)
        result = json.loads(done.stdout)
        if "failed" in result:
            raise RuntimeError(f"{reader}: {result['failed']}")
        return result

    def all(self):
        return {"ebpo (C)": self.ours, "HDF5 ros3": self.ros3,
                "npm package": lambda *a: self.browser("ours", *a),
                "h5wasm, lazy file": lambda *a: self.browser("h5wasm", *a)}


def requests_of(server, readers, models):
    """Return [file, its bytes, reader, requests and bytes of levels 0 to 4, of 0 to 5, of all].

    Only the command reads all of large files.
    """
    found = []
    for name, size in models.items():
        for reader, read in readers.all().items():
            row = [name, size, reader]
            for to in [4, 5, "whole"]:
                if to == "whole" and reader != "ebpo (C)" and size > 100e6:
                    row += [None, None]
                    continue
                server.traffic(name)
                read(f"http://127.0.0.1:{server.port}/{name}", to)
                row += server.traffic(name)
            found.append(row)
    return found


def latency_of(server, readers, name, latencies, rounds):
    """Return [round trip in ms, reader, ms until level 0 is decoded, ms until level 5 is decoded]."""
    found = []
    for latency in latencies:
        port = Line(server.port, latency / 1e3).port if latency else server.port
        for reader, read in readers.all().items():
            runs = [read(f"http://127.0.0.1:{port}/{name}", 5) for _ in range(rounds)]
            found.append([latency, reader, *(statistics.median(r[key] for r in runs)
                                             for key in ("first", "ms"))])
    return found
