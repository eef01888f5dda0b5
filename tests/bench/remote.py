#!/usr/bin/env python3
"""Makes docs/measured/remote.md: requests, bytes, round trips and times of queries by URL.

    tests/bench/remote.py BUILD_DIR LARGE.ebpo.h5 SMALL.ebpo.h5 -o docs/measured/remote.md
        [--before BUILD_DIR LARGE.ebpo.h5 SMALL.ebpo.h5 [--ply SMALL.ply]] [--readers] [--json FILE [--only PATTERN]]

BUILD_DIR: a release build inside its checkout, whose viewer is measured, too. nginx serves the files; its log has the
requests. A proxy in front of nginx adds latency, and limits the rate for the viewer. The handwritten end of an
existing page is kept. --before also measures an older build with its files, and the new build with the old files;
with --ply, also the time to convert SMALL.ply. Only --json stores these results. --only repeats the measurements in
--json whose name matches. --readers compares with HDF5's ros3 driver and h5wasm.
Needs nginx, chromium and `sh tools/install-deps.sh --tests`; for --readers also python3-h5py and npm, which installs
h5wasm below BUILD_DIR.
"""
import argparse
import contextlib
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(1, str(HERE / "remote"))
# pylint: disable=wrong-import-position
import url_queries
import drivers
import measured
import remote_page
from query_page import handwritten, reflow
from served import Line, Server, free_port, wait_for

SINGLES, VIEWS, OPENINGS, PATH, EQUAL, ROUNDS = 11, 5, 5, 200000, 10000, 2
ROUND_TRIP, RATE = 0.1, 5e6 / 8
LATENCIES = [0, 50, 200]


class Measurements:
    """Measurements by name, "SIDE/ROW". Each is written to the disk when it is complete."""
    def __init__(self, options):
        self.path = options.json and pathlib.Path(options.json)
        self.only = re.compile(options.only) if options.only is not None else None
        self.found = (json.loads(self.path.read_text())
                      if self.path and self.path.exists() else {})

    def take(self, name, measure):
        if not (self.only.search(name) if self.only else name not in self.found):
            return
        print(name, file=sys.stderr, flush=True)
        self.found.setdefault("load", {})[name] = os.getloadavg()[0]
        try:
            self.found[name] = measure()
        except (subprocess.CalledProcessError, RuntimeError, measured.Failed) as error:
            said = (getattr(error, "stderr", None) or str(error)).strip()
            print(f"remote.py: {name}: {said}", file=sys.stderr)
            self.found.pop(name, None)
        if self.path:
            self.path.write_text(json.dumps(self.found, indent=1))


# --- the viewer ---

def view(side, large, work):
    """Measure the viewer's page over a slow line. The side's own samples/serve.sh serves it."""
    folder, log, port = work / "shown", work / "shown.log", free_port()
    folder.mkdir(exist_ok=True)
    shown = folder / side.link("large")
    shown.unlink(missing_ok=True)
    shown.symlink_to(side.files["large"].resolve())
    log.write_text("")
    script = side.root / "samples/serve.sh"
    install = ["--no-install"] if "--no-install" in script.read_text() else []
    serving = subprocess.Popen(["sh", script, *install, "--port", str(port), "--folder", folder,
                                "--log", log], stdout=subprocess.DEVNULL)
    try:
        wait_for(port)
        line = Line(port, ROUND_TRIP, RATE)
        eye, at = (",".join(map(repr, p)) for p in large.view(0))
        address = f"http://127.0.0.1:{line.port}/?file=models/{shown.name}"
        done = subprocess.run(["node", HERE / "remote/viewed.mjs", drivers.ROOT / "tools/web",
                               address, log, shown.name, eye, at, work / side.name], check=True,
                              capture_output=True, text=True)
        return json.loads(done.stdout)
    finally:
        shown.unlink()
        serving.terminate()
        serving.wait()


# --- building ---

def build_in_turns(sides, ply, work):
    """Return [CPU seconds of (before, after) of each round], in the order before, after, after, before."""
    out, rounds = work / "built.ebpo.h5", []
    for _ in range(ROUNDS):
        taken = [0, 0]
        for which in (0, 1, 1, 0):
            taken[which] += measured.run(sides[which].ebpo, "convert", "-q", "--memory", "4GiB",
                                         "--temp-dir", work, ply, out)["cpu"]
        rounds.append(taken)
    return rounds


# --- all measurements ---

def measure_sides(take, sides, server, line, work):
    large = url_queries.Places(sides[0], "large", 100, work)
    small = url_queries.Places(sides[0], "small", 50, work)
    for name, row in url_queries.rows(large, small, work, SINGLES, VIEWS).items():
        for side in sides:
            take(f"{side.name}/{name}",
                 lambda s=side, r=row: {"what": r.what, "command": r.command,
                                        **url_queries.measure(server, line, s, r, work)})
    take(f"{sides[-1].name}/known", lambda: url_queries.known_in_advance(server, sides[-1], work))
    crowd = large.crowd("crowd.txt", EQUAL)
    near = Line(server.port, 0)
    take(f"{sides[-1].name}/same", lambda: url_queries.same_results(sides[-1], near, "large", crowd))
    for side in sides:
        take(f"{side.name}/size", lambda s=side: {which: f.stat().st_size
                                                  for which, f in s.files.items()})
        take(f"{side.name}/without gaps", lambda s=side: url_queries.without_gaps(s, work))
        take(f"{side.name}/local", lambda s=side: url_queries.local(s, s.files["large"], OPENINGS, PATH))
        take(f"{side.name}/viewer", lambda s=side: view(s, large, work))


def measure_drivers(take, side, server, work):
    readers = drivers.Readers(side.build, f"http://127.0.0.1:{server.port}", work)
    models = {side.link(which): side.files[which].stat().st_size for which in ("small", "large")}
    take("drivers/requests", lambda: drivers.requests_of(server, readers, models))
    take("drivers/latency", lambda: drivers.latency_of(server, readers, side.link("large"),
                                                       LATENCIES, 3))


def install_h5wasm(work):
    subprocess.run(["npm", "install", "--silent", "--no-audit", "--no-fund", "--prefix", work,
                    "h5wasm@0.8", "h5wasm-plugins"], check=True)


def links_of(sides, work):
    page = work / "bench.html"
    page.write_text("<!doctype html><title>bench</title>")
    links = {side.link(which): file for side in sides for which, file in side.files.items()}
    return {**links, "viewer": drivers.ROOT / "tools/web", "modules": work / "node_modules",
            "worker.js": HERE / "remote/worker.js", "bench.html": page}


def command_of(options):
    def names(paths):
        return [p.name for p in paths]
    command = ["tests/bench/remote.py", "BUILD_DIR", *names(options.files)]
    if options.before:
        command += ["--before", "BUILD_DIR_BEFORE", *names(options.before[1:])]
    if options.ply:
        command += ["--ply", options.ply.name]
    if options.readers:
        command.append("--readers")
    return shlex.join(command + ["-o", "docs/measured/remote.md"])


def parse():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("files", type=pathlib.Path, nargs=2)
    parser.add_argument("--before", type=pathlib.Path, nargs=3)
    parser.add_argument("--ply", type=pathlib.Path)
    parser.add_argument("--readers", action="store_true")
    parser.add_argument("--json")
    parser.add_argument("--only")
    parser.add_argument("-o", "--output", required=True)
    options = parser.parse_args()
    if options.ply and not options.before:
        parser.error("--ply needs --before, because it compares two builds")
    return options


def sides_of(options):
    new = options.build.resolve()
    sides = [url_queries.Side(remote_page.AFTER, new, *options.files)]
    if options.before:
        old, *files = options.before
        sides[:0] = [url_queries.Side(remote_page.BEFORE, old.resolve(), *files),
                     url_queries.Side(remote_page.MIXED, new, *files)]
    return sides


def main():
    options = parse()
    sides, results = sides_of(options), Measurements(options)
    work = sides[-1].build / "bench-remote"
    work.mkdir(exist_ok=True)
    nginx = re.search(r"nginx/\S+", subprocess.run(["nginx", "-v"], capture_output=True, text=True,
                                                   check=True).stderr)[0]
    if options.readers:
        install_h5wasm(work)
    with contextlib.closing(Server(work, drivers.ROOT / "samples/nginx-ebpo.conf",
                                   links_of(sides, work))) as server:
        line = Line(server.port, ROUND_TRIP)
        measure_sides(results.take, sides, server, line, work)
        if options.readers:
            measure_drivers(results.take, sides[-1], server, work)
    if options.ply:
        results.take("build", lambda: build_in_turns([sides[0], sides[-1]], options.ply, work))
    page = remote_page.made(results.found, command_of(options), nginx)
    pathlib.Path(options.output).write_text(reflow(page + handwritten(options.output)))


main()
