#!/usr/bin/env python3
"""Remakes docs/measured/remote.md: requests, bytes and times of reading by URL, beside HDF5's ros3 driver and h5wasm.

    tests/bench/remote.py BUILD_DIR MODEL.ebpo.h5... [--latency 0,50,200] [--rounds 3] -o
    docs/measured/remote.md

nginx serves the models; its log says what was asked for. For latencies a forwarder stands before it
that holds back everything by half the round trip, in both directions, and each new connection by a
whole one (the handshake). Needs nginx, chromium, python3-h5py, npm (h5wasm is installed below
BUILD_DIR) and `sh tools/install-deps.sh --tests`.
"""
import argparse
import asyncio
import json
import os
import pathlib
import re
import shlex
import shutil
import socket
import statistics
import subprocess
import sys
import threading
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


class Server:
    """nginx on the models and the page; lines of its log are (status, bytes, uri)."""
    def __init__(self, work, models, modules):
        self.work, self.port, self.log = work, free_port(), work / "access.log"
        shutil.rmtree(work / "www", ignore_errors=True)
        (work / "www").mkdir(parents=True)
        (work / "tmp").mkdir(exist_ok=True)
        self.log.write_text("")
        for model in models:
            (work / "www" / model.name).symlink_to(model.resolve())
        (work / "www/viewer").symlink_to(ROOT / "tools/viewer")
        (work / "www/modules").symlink_to(modules)
        (work / "www/worker.js").symlink_to(HERE / "remote/worker.js")
        (work / "www/bench.html").write_text("<!doctype html><title>bench</title>")
        temporary = " ".join(f"{kind}_temp_path {work}/tmp/{kind};"
                             for kind in ["client_body", "proxy", "fastcgi", "uwsgi", "scgi"])
        (work / "nginx.conf").write_text(f"""{"user root;" if os.getuid() == 0 else ""}
worker_processes 1; daemon off; pid {work}/pid; error_log {work}/error.log;
events {{ }}
http {{
    log_format short '$status $body_bytes_sent $request_method $uri'; access_log {self.log} short; {temporary}
    types {{ text/html html; text/javascript js mjs; application/wasm wasm; }}
    server {{ listen 127.0.0.1:{self.port}; root {work}/www; include {ROOT}/samples/nginx-ebpo.conf; }}
}}
""")
        self.process = subprocess.Popen(["nginx", "-e", str(work / "error.log"), "-p", str(work),
                                         "-c", str(work / "nginx.conf")])
        for _ in range(100):
            with socket.socket() as s:
                if s.connect_ex(("127.0.0.1", self.port)) == 0:
                    break
            time.sleep(0.1)

    def traffic(self, name):
        """Requests and bytes for a file since the last call; nginx writes a line when an answer is out."""
        time.sleep(0.3)
        lines = [line.split(" ", 3) for line in self.log.read_text().splitlines()]
        self.log.write_text("")
        lines = [line for line in lines if line[3].endswith(name)]
        return len(lines), sum(int(line[1]) for line in lines)

    def close(self):
        self.process.terminate()
        self.process.wait()


class Delay:
    """Forwards a port to another with a round trip of `seconds` on top."""
    def __init__(self, to, seconds):
        self.to, self.half, self.port = to, seconds / 2, free_port()
        self.loop = asyncio.new_event_loop()
        ready = threading.Event()
        threading.Thread(target=self.run, args=(ready,), daemon=True).start()
        ready.wait()

    def run(self, ready):
        asyncio.set_event_loop(self.loop)
        self.loop.run_until_complete(asyncio.start_server(self.connection, "127.0.0.1", self.port,
                                                          limit=1 << 20))
        ready.set()
        self.loop.run_forever()

    async def connection(self, reader, writer):
        await asyncio.sleep(2 * self.half)
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self.to, limit=1 << 20)
        await asyncio.gather(self.forward(reader, far_writer), self.forward(far_reader, writer),
                             return_exceptions=True)

    async def forward(self, reader, writer):
        """What came at t leaves at t + half, however much follows: a delay, not a limit on the rate."""
        queue = asyncio.Queue()

        async def take():
            while data := await reader.read(1 << 16):
                queue.put_nowait((self.loop.time() + self.half, data))
            queue.put_nowait((0, b""))

        async def give():
            while True:
                due, data = await queue.get()
                if not data:
                    writer.close()
                    return
                await asyncio.sleep(max(0, due - self.loop.time()))
                writer.write(data)
                await writer.drain()
        await asyncio.gather(take(), give())


class Readers:
    def __init__(self, build, site, work):
        self.tool, self.site = build / "tools/ebpo", site
        self.plugins = str(build / "lib/h5")
        self.point = work / "point"
        self.point.write_text("0 0 0\n")

    def ours(self, url, to):
        """The library, by the command that reads the same."""
        if to == "whole":
            command = [self.tool, "distance", "--json", url, self.point]
        else:
            command = [self.tool, "levels", "--json", "--to", str(to), url]
        begin = time.perf_counter()
        text = subprocess.run(command, check=True, capture_output=True, text=True,
                              stdin=subprocess.DEVNULL).stdout
        ms = 1e3 * (time.perf_counter() - begin)
        return {"first": json.loads(text)["levels"][0]["ms"] if to != "whole" else None, "ms": ms}

    def ros3(self, url, to):
        environment = dict(os.environ, HDF5_PLUGIN_PATH=self.plugins)
        return json.loads(subprocess.run(["/usr/bin/python3", HERE / "remote/ros3.py", url,
                                          str(to)], check=True, capture_output=True, text=True, env=environment).stdout)

    def browser(self, reader, url, to):
        done = subprocess.run(["node", HERE / "remote/browser.mjs", ROOT / "tools/viewer",
                               self.site, reader, url,
                               str(to)], check=True, capture_output=True, text=True)
        answer = json.loads(done.stdout)
        if "failed" in answer:
            sys.exit(f"{reader}: {answer['failed']}")
        return answer

    def all(self):
        return {"ebpo (C)": self.ours, "HDF5 ros3": self.ros3,
                "viewer's reader": lambda *a: self.browser("ours", *a),
                "h5wasm, lazy file": lambda *a: self.browser("h5wasm", *a)}


def requests_table(page, server, readers, models):
    page += ["## Requests and bytes", "",
             "From nginx's log; of whole files in memory, in MB a request on average. *whole*: "
             "everything in memory by `ebpo distance`, all datasets by ros3 and h5wasm; the "
             "viewer's reader reads levels and mesh, no maps.", "",
             "| file | bytes | reader | levels 0 to 4: requests | bytes | levels 0 to 5: requests "
             "| bytes | whole: requests | bytes | MB a request |",
             "|---|---|---|---|---|---|---|---|---|---|"]
    for model in models:
        for name, read in readers.all().items():
            url, cells = f"http://127.0.0.1:{server.port}/{model.name}", []
            for to in [4, 5, "whole"]:
                if to == "whole" and name != "ebpo (C)" and model.stat().st_size > 100e6:
                    cells += ["-", "-", "-"]
                    continue
                server.traffic(model.name)
                read(url, to)
                count, size = server.traffic(model.name)
                cells += [f"{count:,}", f"{size:,}"] + ([f"{size / count / 1e6:.2f}"]
                                                        if to == "whole" else [])
            page.append(f"| {model.name} | {model.stat().st_size:,} | {name} | " + " | ".join(cells)
                        + " |")
    page.append("")


def latency_table(page, server, readers, model, latencies, rounds):
    page += ["## Time with latency", "",
             f"{model.name}, ms until level 0, and levels 0 to 5, are decoded (medians of "
             f"{rounds}). The C command's second figure includes the start of the process, the "
             f"others' do not include theirs, nor loading "
             "their code.", "", "| round trip, ms | reader | level 0 | levels 0 to 5 |",
             "|---|---|---|---|"]
    for latency in latencies:
        port = Delay(server.port, latency / 1e3).port if latency else server.port
        for name, read in readers.all().items():
            runs = [read(f"http://127.0.0.1:{port}/{model.name}", 5) for _ in range(rounds)]
            page.append(f"| {latency} | {name} | "
                        f"{statistics.median(r['first'] for r in runs):,.0f} | "
                        f"{statistics.median(r['ms'] for r in runs):,.0f} |")
    page.append("")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("models", type=pathlib.Path, nargs="+")
    parser.add_argument("--latency", default="0,50,200")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("-o", "--output", required=True)
    o = parser.parse_args()
    work = o.build.resolve() / "bench-remote"
    work.mkdir(exist_ok=True)
    subprocess.run(["npm", "install", "--silent", "--no-audit", "--no-fund", "--prefix", work,
                    "h5wasm@0.8", "h5wasm-plugins"], check=True)
    modules = work / "node_modules"
    version = json.loads((modules / "h5wasm/package.json").read_text())["version"]
    server = Server(work, o.models, modules)
    try:
        readers = Readers(o.build.resolve(), f"http://127.0.0.1:{server.port}", work)
        nginx = re.search(r"nginx/\S+", subprocess.run(["nginx", "-v"], capture_output=True,
                                                       text=True).stderr)[0]
        command = shlex.join(["tests/bench/remote.py",
                              "BUILD_DIR"] + [m.name
                                              for m in o.models] + ["--latency", o.latency,
                                                                    "--rounds", str(o.rounds), "-o",
                                                                    "docs/measured/remote.md"])
        page = ["# Files on web servers: measured", "",
                f"Made by `{command}`; {nginx}, h5wasm {version} with its zstd plugin, HDF5's "
                f"ros3 driver through Debian's h5py with our plugin, all on one machine.", ""]
        requests_table(page, server, readers, o.models)
        latency_table(page, server, readers, o.models[-1], [int(x) for x in o.latency.split(",")],
                      o.rounds)
        pathlib.Path(o.output).write_text("\n".join(page).rstrip() + "\n")
    finally:
        server.close()


main()
