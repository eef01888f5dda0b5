#!/usr/bin/env python3
"""dask_faults.py EBPO MODEL [--rows N] [--seconds S] [--folder F]: fault injection for ebpo.dask.

Two worker processes with one thread each classify N uniform points (10^7) as inside or outside MODEL, into a .npy.
They do it once without a fault, and once with each fault, which begins when a tenth of the chunks is written (`away`:
at the start):

    away      the server of MODEL responds 503 to every request for S seconds (60)
    stopped   a worker gets SIGSTOP, and SIGCONT after S seconds
    slow      a worker runs a tenth of the time until the end (SIGSTOP and SIGCONT in turns)
    killed    a worker gets SIGKILL

For `away` the workers read the model by HTTP without a cache. Prints a line for each fault: seconds, seconds
of the fault, chunks that were ready at its start, and refused requests. Exit code 1: the results differ from
those of `ebpo inside`. Needs dask.distributed, and PYTHONPATH naming the package's folder.
"""
import argparse
import http.server
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

import dask
import distributed
import numpy as np

import ebpo
import ebpo.dask as ed

BLOCK = 1 << 20


class Server(http.server.ThreadingHTTPServer):
    """Serves ranges of a file; returns 503 until `until`."""
    daemon_threads, until, refused, responses, data = True, 0.0, 0, 0, b""


class Ranges(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def do_GET(self):
        away = time.monotonic() < self.server.until
        requested = re.match(r"bytes=(\d+)-(\d+)", self.headers["Range"] or "bytes=0-0")
        first, last = int(requested[1]), min(int(requested[2]), len(self.server.data) - 1)
        part = b"" if away else self.server.data[first:last + 1]
        self.server.refused += away
        self.server.responses += not away
        self.send_response(503 if away else 206)
        if not away:
            self.send_header("Content-Range", f"bytes {first}-{last}/{len(self.server.data)}")
            self.send_header("ETag", '"1"')
        self.send_header("Content-Length", str(len(part)))
        self.end_headers()
        self.wfile.write(part)

    def log_message(self, *_):
        pass


def make_points(path, rows, box):
    random = np.random.default_rng(30)
    with open(path, "wb") as file:
        for at in range(0, rows, BLOCK):
            random.uniform(box[0], box[1], (min(BLOCK, rows - at), 3)).tofile(file)


class Trouble:
    """The faults. Each method gets the workers or the server, and the seconds."""

    @staticmethod
    def calm(_server, _pids, _seconds, _done):
        pass

    @staticmethod
    def away(server, _pids, seconds, _done):
        server.until = time.monotonic() + seconds
        time.sleep(seconds)

    @staticmethod
    def stopped(_server, pids, seconds, _done):
        os.kill(pids[0], signal.SIGSTOP)
        time.sleep(seconds)
        os.kill(pids[0], signal.SIGCONT)

    @staticmethod
    def slow(_server, pids, _seconds, done):
        while not done.is_set():
            os.kill(pids[0], signal.SIGSTOP)
            done.wait(.45)
            os.kill(pids[0], signal.SIGCONT)
            done.wait(.05)

    @staticmethod
    def killed(_server, pids, _seconds, _done):
        os.kill(pids[0], signal.SIGKILL)


def run(name, args, server, model, points, expected):
    """Run one fault on a new cluster. Return True when the results are equal."""
    out = args.folder / f"{name}.npy"
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None,
                                  memory_limit=None) as cluster, distributed.Client(cluster) as client:
        pids = list(client.run(os.getpid).values())
        chunk = max(1, args.rows // 200)
        where = f"http://127.0.0.1:{server.server_port}/model.ebpo.h5" if name == "away" else str(model)
        query = ed.query("locate", where, points, chunk=chunk, memory="1G")
        done, failed = threading.Event(), []

        def write():
            try:
                ed.to_file(query, out)
            except Exception as error:  # reported below, like an error of another thread
                failed.append(error)
            done.set()

        begin, refused = time.monotonic(), server.refused
        writer = threading.Thread(target=write)
        writer.start()
        folder, of = pathlib.Path(f"{out}.parts"), query.numblocks[0]
        least = 0 if name == "away" else of / 10
        while (ready := len(list(folder.glob("0*.npy")))) < least and not done.is_set():
            time.sleep(.01)
        trouble = time.monotonic()
        getattr(Trouble, name)(server, pids, args.seconds, done)
        trouble = time.monotonic() - trouble
        writer.join()
        seconds = time.monotonic() - begin
    if failed:
        print(f"{name}: {failed[0]}")
        return False
    found = np.load(out)
    equal = found["where"].tobytes() == expected[:, 0].astype("i1").tobytes() and (
        found["winding"].tobytes() == expected[:, 1].tobytes())
    print(f"{name:8} {seconds:6.1f} s, fault for {trouble:5.1f} s from chunk {ready} of {of}; "
          f"{server.refused - refused} requests refused; {'equal' if equal else 'DIFFERENT RESULTS'}", flush=True)
    if name == "away" and server.refused == refused:
        print("away: no request reached the server during the fault")
        return False
    return equal


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("ebpo")
    parser.add_argument("model", type=pathlib.Path)
    parser.add_argument("--rows", type=int, default=10_000_000)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--folder", type=pathlib.Path)
    parser.add_argument("--only", nargs="*", default=["calm", "away", "stopped", "slow", "killed"])
    args = parser.parse_args()
    args.folder = pathlib.Path(tempfile.mkdtemp(prefix="faults-", dir=args.folder))
    dask.config.set({"distributed.worker.use-file-locking": False, "temporary-directory": str(args.folder)})
    server = Server(("127.0.0.1", 0), Ranges)
    server.data = args.model.read_bytes()
    threading.Thread(target=server.serve_forever, daemon=True).start()
    points = args.folder / "points.raw"
    try:
        with ebpo.open(args.model) as model:
            make_points(points, args.rows, model.info.box)
        raw = subprocess.run([args.ebpo, "inside", "--raw", args.model, points], check=True, capture_output=True)
        expected = np.frombuffer(raw.stdout, "<i4").reshape(-1, 2)
        equal = [run(name, args, server, args.model.absolute(), points, expected) for name in args.only]
    finally:
        shutil.rmtree(args.folder)
    return 0 if all(equal) else 1


if __name__ == "__main__":
    sys.exit(main())
