#!/usr/bin/env python3
"""fetch.py TOOL GENERATE: tests ebpo fetch with parts of a file, interruptions, and files that change.

EBPO_TEST_SCALE below 1: smaller models.
"""
import http.server
import json
import os
import re
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time

import same_ply

FACES, FEWER_FACES = (150000, 40000) if float(os.environ.get("EBPO_TEST_SCALE", "1")) < 1 else (250000, 40000)
failures = []


def expect(what, good, shown=""):
    if not good:
        failures.append(what)
        print(f"FAILED: {what} {shown}")


class Handler(http.server.BaseHTTPRequestHandler):
    """Serves one file by ranges. `left`: number of requests that are served before all others get 404;
    `nap`: seconds before each response."""
    protocol_version = "HTTP/1.1"
    data, etag, left, nap, sent, requests = b"", '"1"', 10 ** 9, 0, 0, 0
    damage = False  # True: a bit of the second response is changed
    lock = threading.Lock()

    def log_message(self, *arguments):
        pass

    def do_GET(self):
        site = type(self)
        with self.lock:
            site.requests += 1
            site.left -= 1
            refused = site.left < 0
        time.sleep(self.nap)
        found = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        begin, end = int(found[1]), min(int(found[2]) + 1, len(self.data))
        body = b"" if refused else self.data[begin:end]
        if site.damage and begin > 0 and body:
            site.damage, body = False, bytes([body[0] ^ 1]) + body[1:]
        self.send_response_only(404 if refused else 206)
        self.send_header("ETag", self.etag)
        self.send_header("Content-Length", str(len(body)))
        if not refused:
            self.send_header("Content-Range", f"bytes {begin}-{end - 1}/{len(self.data)}")
        try:
            self.end_headers()
            self.wfile.write(body)
        except ConnectionError: # an interrupted client
            return
        with self.lock:
            site.sent += len(body)

    @classmethod
    def reset(cls, left=10 ** 9, nap=0):
        cls.left, cls.nap, cls.sent, cls.requests = left, nap, 0, 0


def content(path):
    with open(path, "rb") as f:
        return f.read()


def run(*arguments):
    return subprocess.run(arguments, stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          timeout=300)


def blocks(part):
    total = 0
    for name in os.listdir(part) if os.path.isdir(part) else []:
        try:
            total += os.path.getsize(os.path.join(part, name)) - 56
        except FileNotFoundError:  # a temporary name that was removed meanwhile
            pass
    return total


def parts(tool, folder, path, url):
    out, near = os.path.join(folder, "o.ebpo.h5"), os.path.join(folder, "near.ebpo.h5")
    for options in ([], ["--levels", "0-3"], ["--profile", "lod"], ["--box", "0,0,0,0.4,0.4,0.4"],
                    ["--levels", "0-5", "--box", "0,0,-1,1,1,1", "--parts", "mesh,maps,envelopes"]):
        Handler.reset()
        done = run(tool, "fetch", *options, url, out)
        run(tool, "subset", "-q", *options, path, near)
        expect(f"fetch {options}", done.returncode == 0 and content(out) == content(near),
               done.stderr)
        expect(f"{options}: verify", run(tool, "verify", "-q", out).returncode == 0)
        expect(f"{options}: nothing remains",
               sorted(os.listdir(folder)) == sorted(["m.ply", "m.ebpo.h5", "other.ebpo.h5",
                                                     "o.ebpo.h5",
                                                     "near.ebpo.h5"]), os.listdir(folder))
        if options[:1] == ["--levels"] and len(options) == 2:
            expect("few bytes for few levels", Handler.sent < len(Handler.data) / 4,
                   f"{Handler.sent} of {len(Handler.data)}")
        if options[:1] == ["--box"]:
            expect("less than half for a small box", Handler.sent < len(Handler.data) / 2,
                   f"{Handler.sent} of {len(Handler.data)}")
        os.remove(out)
    Handler.reset()
    reported = json.loads(run(tool, "fetch", "--json", "--levels", "0-2", url, out).stdout)
    expect("json", reported["fetched_bytes"] == Handler.sent
           and reported["fetched_requests"] == Handler.requests and reported["subset"]["last_level"] == 2,
           reported.get("fetched_bytes"))
    os.remove(out)


def refusals(tool, folder, path, url):
    """Outputs that cannot be written are reported before anything is fetched. Damaged data is not kept."""
    out = os.path.join(folder, "o.ebpo.h5")
    part = out + ".part"
    Handler.reset()
    done = run(tool, "fetch", url, folder)
    expect("a folder as OUT", done.returncode == 1 and "is a folder" in done.stderr
           and Handler.requests == 0, (done.stderr, Handler.requests))
    os.symlink(folder, part)
    done = run(tool, "fetch", url, out)
    expect("a link as OUT.part", done.returncode == 1 and "move it away" in done.stderr
           and Handler.requests == 0 and os.path.islink(part), (done.stderr, Handler.requests))
    os.remove(part)
    Handler.reset()
    Handler.damage = True
    done = run(tool, "fetch", url, out)
    expect("a damaged transfer", done.returncode == 1 and "start again" in done.stderr
           and not os.path.exists(part) and not os.path.exists(out), done.stderr)
    done = run(tool, "fetch", url, out)
    expect("and the next one", done.returncode == 0 and content(out) == content(path), done.stderr)
    os.remove(out)


def resume(tool, folder, path, url):
    out = os.path.join(folder, "o.ebpo.h5")
    part = out + ".part"
    Handler.reset()
    run(tool, "fetch", "-q", url, out)
    whole = Handler.sent
    os.remove(out)
    Handler.reset(left=3)
    done = run(tool, "fetch", "--http-connections", "1", url, out)
    held, first = blocks(part), Handler.sent
    expect("an interruption keeps received blocks",
           done.returncode == 1 and not os.path.exists(out) and held > len(Handler.data) / 8
           and held >= first - 131072 and "kept in " + part in done.stderr,
           (held, first, done.stderr))
    Handler.reset()
    done = run(tool, "fetch", url, out)
    expect("the next run continues from there", done.returncode == 0 and content(out) == content(path)
           and "resuming with" in done.stderr, done.stderr)
    expect("without fetching the blocks again", Handler.sent <= whole - held + 2 * 131072,
           f"{Handler.sent} of {whole}, {held} were received")
    expect("the folder is removed", not os.path.exists(part))
    print(f"whole {whole} bytes; interrupted after {first}, {held} kept; then {Handler.sent}")
    os.remove(out)
    # A block that was damaged on disk is fetched again.
    Handler.reset(left=3)
    run(tool, "fetch", "-q", "--http-connections", "1", url, out)
    victim = os.path.join(part, sorted(os.listdir(part))[0])
    with open(victim, "r+b") as f:
        f.seek(1000)
        f.write(b"damage")
    Handler.reset()
    done = run(tool, "fetch", "-q", url, out)
    expect("damaged blocks are fetched again",
           done.returncode == 0 and content(out) == content(path), done.stderr)
    os.remove(out)


def change(tool, folder, path, url):
    out, other = os.path.join(folder, "o.ebpo.h5"), os.path.join(folder, "other.ebpo.h5")
    Handler.reset(left=3)
    run(tool, "fetch", "-q", "--http-connections", "1", url, out)
    Handler.data, Handler.etag = content(other), '"2"'
    Handler.reset()
    done = run(tool, "fetch", url, out)
    expect("a changed file is fetched from the beginning",
           done.returncode == 0 and content(out) == content(other)
           and "has changed on the server" in done.stderr, done.stderr)
    expect("its folder is removed", not os.path.exists(out + ".part"))
    Handler.data, Handler.etag = content(path), '"1"'
    os.remove(out)
    # With --box, blocks have another size.
    Handler.reset(left=3)
    run(tool, "fetch", "-q", "--http-connections", "1", url, out)
    Handler.reset()
    done = run(tool, "fetch", "--box", "0,0,-1,2,2,1", url, out)
    expect("a run with --box explains why it does not resume",
           done.returncode == 0 and "run without --box" in done.stderr, done.stderr)
    os.remove(out)


def interrupt(tool, folder, path, url):
    out = os.path.join(folder, "o.ebpo.h5")
    part = out + ".part"
    Handler.reset(nap=0.3)
    child = subprocess.Popen([tool, "fetch", "--http-connections", "1", url, out],
                             stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    begun = time.monotonic()
    while blocks(part) < 100000 and time.monotonic() - begun < 60 and child.poll() is None:
        time.sleep(0.02)
    child.send_signal(signal.SIGINT)
    child.wait(timeout=60)
    held = blocks(part)
    expect("SIGINT keeps the blocks", child.returncode == -signal.SIGINT and held >= 90000
           and not os.path.exists(out), (child.returncode, held))
    Handler.reset()
    done = run(tool, "fetch", "-q", url, out)
    expect("the next run succeeds", done.returncode == 0 and content(out) == content(path),
           done.stderr)
    os.remove(out)


def colour(plain, path):
    """Writes the binary mesh again, with colours, a label for each face, lists, and a further element."""
    mesh = same_ply.Ply(plain)
    (kinds, vertices), (_, faces) = mesh.element("vertex"), mesh.element("face")
    scalar = {"f": "float", "d": "double"}[kinds[0][0][0]]
    lines = ["ply", "format binary_little_endian 1.0", "comment coloured", f"element vertex {len(vertices)}",
             *(f"property {scalar} {axis}" for axis in "xyz"), *(f"property uchar {c}" for c in ("red", "green", "blue")),
             f"element face {len(faces)}", "property list uchar int vertex_indices", "property short label",
             "property list uchar ushort tags", "element camera 2", "property double angle", "end_header", ""]
    with open(path, "wb") as out:
        out.write("\n".join(lines).encode())
        for i, row in enumerate(vertices):
            out.write(b"".join(row) + bytes((i * 7 & 255, i >> 3 & 255, 255 - (i & 255))))
        for i, row in enumerate(faces):
            tags = struct.pack(f"<{i % 3}H", *range(i & 65535, (i & 65535) + i % 3)) if i < 65000 else b""
            out.write(b"\3" + row[0] + struct.pack("<hB", i % 999 - 500, len(tags) // 2) + tags)
        out.write(struct.pack("<2d", 0.5, float("inf")))


def comes_back(tool, folder, ply, near, compare):
    """Returns True when the mesh extracted from a file equals the source."""
    back = os.path.join(folder, "back.ply")
    done = run(tool, "extract", "-q", "--mesh", near, back)
    try:
        compare(same_ply.Ply(ply), same_ply.Ply(back))
    except SystemExit as e:
        return False, e
    return done.returncode == 0 and run(tool, "verify", "-q", near).returncode == 0, done.stderr


def attributes(tool, plain, url):
    """Attributes are fetched with the requested parts, and only then."""
    with tempfile.TemporaryDirectory() as folder:
        ply, path, out = (os.path.join(folder, name) for name in ("c.ply", "c.ebpo.h5", "o.ebpo.h5"))
        colour(plain, ply)
        for layout in ("none", "64"):
            run(tool, "convert", "-q", "--subtree-faces", layout, ply, path)
            Handler.data, sent = content(path), {}
            Handler.etag = f'"{layout}"'
            for name, options, compare in (
                    ("all", [], same_ply.compare), ("box", ["--box=0,0,-1,2,2,1"], same_ply.compare_subset),
                    ("bare", ["--parts=-attributes"], None), ("none", ["--box=-.1,-.1,-.1,.1,.1,.1"], None)):
                Handler.reset()
                done = run(tool, "fetch", "-q", *options, url, out)
                sent[name] = Handler.sent
                expect(f"attributes, {layout}, {name}: fetch", done.returncode == 0, done.stderr)
                if compare:
                    expect(f"attributes, {layout}, {name}", *comes_back(tool, folder, ply, out, compare))
                else:
                    expect(f"attributes, {layout}, {name}: verify", run(tool, "verify", "-q", out).returncode == 0)
            reported = json.loads(run(tool, "info", "--json", path).stdout)
            stored = reported["bytes"]["attributes"]
            expect(f"attributes, {layout}: omitted attributes are not fetched",
                   stored > 10000 and sent["bare"] <= sent["all"] - stored // 2, (sent, stored))
            expect(f"attributes, {layout}: directly from the server", *comes_back(tool, folder, ply, url,
                                                                                 same_ply.compare))


def surface(tool, ply, url):
    """Patches of the simplified surface are fetched, kept, or reported as omitted. Coarse levels do not read the mesh."""
    with tempfile.TemporaryDirectory() as folder:
        path, out, near, mesh = (os.path.join(folder, name) for name in ("s.ebpo.h5", "o.ebpo.h5", "n.ebpo.h5", "m.ply"))
        run(tool, "convert", "-q", "--parts=+surface", ply, path)
        Handler.data, Handler.etag = content(path), '"surface"'
        for options, holds in (([], True), (["--levels", "0-2"], True), (["--box", "0,0,-1,2,2,1"], True),
                               (["--profile", "collision"], False)):
            Handler.reset()
            done = run(tool, "fetch", *options, url, out)
            run(tool, "subset", "-q", *options, path, near)
            found = json.loads(run(tool, "info", "--json", out).stdout)
            expect(f"surface, {options}", done.returncode == 0 and content(out) == content(near)
                   and ("surface" in found["parts"]) == holds, (done.stderr, found["parts"]))
            expect(f"surface, {options}: verify", run(tool, "verify", "-q", out).returncode == 0)
        done = run(tool, "subset", "--max-error", "0.05", path, near)
        expect("an omitted surface is reported", "without the simplified surface" in done.stdout, done.stdout)
        facts = json.loads(run(tool, "info", "--json", path).stdout)
        for level in ("2", "3"):
            Handler.reset()
            run(tool, "extract", "-q", "--level", level, url, mesh)
            remote = content(mesh)
            run(tool, "extract", "-q", "--level", level, path, mesh)
            expect(f"level {level} by its URL", remote == content(mesh) and Handler.sent < 0.3 * facts["bytes"]["file"],
                   (Handler.sent, facts["bytes"]))
        expect("levels by URL", run(tool, "levels", url).stdout.count("simplified surface") == 1)


def main():
    tool, generate = sys.argv[1:3]
    with tempfile.TemporaryDirectory() as folder:
        path, other, ply = (os.path.join(folder, name)
                            for name in ("m.ebpo.h5", "other.ebpo.h5", "m.ply"))
        subprocess.run([generate, "--base", "torus", "--faces", str(FACES), ply], check=True,
                       capture_output=True)
        subprocess.run([tool, "convert", "-q", "--codec", "none", "--profile", "full", ply, path],
                       check=True)
        subprocess.run([tool, "convert", "-q", "--leaf-faces", "40", ply, other], check=True)
        Handler.data = content(path)
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        server.handle_error = lambda *arguments: None  # interrupted clients
        threading.Thread(target=server.serve_forever, daemon=True).start()
        url = f"http://127.0.0.1:{server.server_address[1]}/m.ebpo.h5"
        parts(tool, folder, path, url)
        refusals(tool, folder, path, url)
        resume(tool, folder, path, url)
        change(tool, folder, path, url)
        interrupt(tool, folder, path, url)
        small = os.path.join(folder, "small.ply")
        subprocess.run([generate, "--base", "torus", "--faces", str(FEWER_FACES), small], check=True, capture_output=True)
        attributes(tool, small, url)
        surface(tool, ply, url)
        done = run(tool, "fetch", url + "/nothing", "/proc/nowhere/x.ebpo.h5")
        expect("no folder", done.returncode in (1, 2)
               and done.stderr.startswith("ebpo fetch: /proc/nowhere/x.ebpo.h5"), done.stderr)
        server.shutdown()
    print(f"{len(failures)} failed")
    return 1 if failures else 0


sys.exit(main())
