#!/usr/bin/env python3
"""Checks that commands give the same results on URLs as on files: http_files.py SERVER TOOL GENERATE [POINTS]

Makes a model, serves it with SERVER (tests/support/faulty_server.py) with and without faults, and compares the output
of the commands byte by byte. POINTS is the number of query points (default 2000; the full test uses 100000).
"""
import json
import os
import re
import subprocess
import sys
import tempfile

failures = []


def run(tool, *arguments):
    return subprocess.run([tool, *arguments], stdin=subprocess.DEVNULL, capture_output=True,
                          timeout=600)


def expect(what, good, shown=""):
    if not good:
        failures.append(what)
        print(f"FAILED: {what} {shown}")


def equal(tool, what, path, url, *arguments):
    """Check that the output for a path and for a URL is the same, except for the name."""
    near, far = run(tool, arguments[0], path, *arguments[1:]), run(tool, arguments[0], url,
                                                                   *arguments[1:])
    expect(what, near.returncode == 0 and far.returncode == 0
           and near.stdout.replace(path.encode(), b"X") == far.stdout.replace(url.encode(), b"X"),
           far.stderr.decode())


def traffic(tool, *arguments):
    done = run(tool, *arguments, "--stats", "--json")
    return json.loads(done.stdout)["traffic"]


def main():
    faulty_server, tool, generate = sys.argv[1:4]
    points = sys.argv[4] if len(sys.argv) > 4 else "2000"
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "m.ebpo.h5")
        ply, points_file, rays = (os.path.join(folder, name) for name in ("m.ply", "points", "rays"))
        # enough faces for a table of subtrees (convert --subtree-faces)
        subprocess.run([generate, "--base", "torus", "--faces", "150000", ply],
                       check=True, capture_output=True)
        subprocess.run([tool, "convert", "-q", ply, path], check=True)
        subprocess.run([tool, "bench", "--count", points, "--save-points", points_file, path], check=True,
                       capture_output=True)
        subprocess.run([tool, "bench", "--query", "ray", "--count", "500", "--save-points", rays,
                        path], check=True, capture_output=True)
        server = subprocess.Popen([sys.executable, faulty_server, path],
                                  stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        try:
            check(tool, folder, path, ply, points_file, rays,
                  f"http://127.0.0.1:{int(server.stdout.readline())}")
        finally:
            server.stdin.close()
            server.wait(timeout=30)
    print(f"{len(failures)} failed")
    return 1 if failures else 0


def check(tool, folder, path, ply, points_file, rays, site):
    good = f"{site}/good/m.ebpo.h5"
    # All exact queries, with the whole model in memory and with subtrees on demand, from servers
    # with temporary faults.
    for url in (good, f"{site}/short-3/a", f"{site}/random-5-10/b", f"{site}/code_later-503-1-3/c",
                f"{site}/whole/d", f"{site}/several-0/e", f"{site}/several-4/f"):
        name = url.split("/")[3]
        more = ("--http-retries", "20") if "random" in name else ()
        equal(tool, f"inside {name}", path, url, "inside", points_file, "--raw", *more)
        equal(tool, f"distance {name}", path, url, "distance", points_file, "--raw", *more)
    for mode in ("--memory=12MiB", "--cut-level=3"):
        equal(tool, f"inside {mode}", path, good, "inside", points_file, "--raw", mode)
        equal(tool, f"distance {mode}", path, good, "distance", points_file, "--raw", mode)
    equal(tool, "inside nodes", path, good, "inside", points_file, "--raw", "--cut-level", "4", "--mode",
          "nodes")
    equal(tool, "rays", path, good, "ray", rays, "--raw")
    equal(tool, "measure", path, good, "measure")
    equal(tool, "info", path, good, "info")
    equal(tool, "info --json", path, good, "info", "--json")
    near, far = (json.loads(run(tool, "levels", source, "--json", "--nodes", "--max-level",
                                "3").stdout)["levels"] for source in (path, good))
    for level in near + far:
        del level["ms"]
    expect("levels", near == far)
    expect("verify", run(tool, "verify", good, "--against", ply).returncode == 0)
    for what in (("--mesh",), ("--level", "4")):
        outs = [os.path.join(folder, name) for name in ("near.ply", "far.ply")]
        done = [run(tool, "extract", source, out, *what).returncode
                for source, out in zip((path, good), outs)]
        expect(f"extract {what}", done == [0, 0] and open(outs[0],
                                                          "rb").read() == open(outs[1], "rb").read())

    for order in ("level", "distance", "pixels", "front-to-back"):
        seen = ("--eye", "5,4,3", "--look", "0,0,0", "--order", order)
        near, far = (json.loads(run(tool, "view", source, *seen, "--json", "--nodes", "--count",
                                    "20001").stdout)["nodes"] for source in (path, good))
        expect(f"view {order}", near == far and len(near) > 19990)
        t = traffic(tool, "view", good, *seen, "--bytes", "300K")
        expect(f"view {order} keeps its budget",
               t["bytes_read"] <= 300 << 10 and t["bytes"] <= (300 << 10) + (64 << 10), t)

    # Requests and bytes.
    size = os.path.getsize(path)
    t = traffic(tool, "levels", good, "--max-level", "4")
    expect("levels 0 to 4 take two requests and 150 kB",
           t["requests"] <= 2 and t["bytes"] <= 150000, t)
    t = traffic(tool, "levels", good)
    expect("no byte is sent twice", t["bytes"] <= size, t)
    t = traffic(tool, "bench", good, "--count", "10")
    expect("a whole file in few requests", t["bytes"] <= size
           and t["requests"] <= 3 + size // (1 << 20), t)
    expect("statistics of local files have reads and bytes",
           set(traffic(tool, "info", path)) == {"reads", "bytes_read"})

    # Fewer requests to a server that sends several ranges; at most two more to one that fails to.
    for query in ("inside", "distance"):
        said = [run(tool, query, f"{site}/{fault}/r", points_file, "--raw", "--memory=12MiB",
                    "--stats").stderr.decode()
                for fault in ("good", "several-0", "several-4")]
        alone, several, refused = (int(re.search(r"requests (\d+)", each)[1]) for each in said)
        expect(f"{query}: several ranges in one request", several < alone and refused <= alone + 2, said)

    # The cache folder.
    cache = os.path.join(folder, "cache")
    first = traffic(tool, "measure", good, "--http-cache", cache)
    again = traffic(tool, "measure", good, "--http-cache", cache)
    expect("the cache folder saves requests", first["requests"] > 1 and again["requests"] == 1
           and again["cache_bytes"] > 0, (first, again))

    # Errors print one line with exit code 1 or 2, and end in time.
    for url, code, words, more in ((f"{site}/code-404/x", 1, "404", ()),
                                   (f"{site}/code-503/x", 1, "503", ("--http-retries", "1")),
                                   (f"{site}/html/x", 1, "returned text/html, not a model", ()),
                                   (f"{site}/stall_head-9/x", 1, "s", ("--http-timeout", "1")),
                                   (f"{site}/change_etag/x", 1, "changed", ()),
                                   (good, 2, "--http-cache-size", ("--http-cache-size", "much")),
                                   (good, 2, "one line", ("--http-header", "nonsense")),
                                   (good, 2, "cache folder", ("--http-cache", "/proc/nowhere/at/all"))):
        done = run(tool, "measure", url, *more)
        said = done.stderr.decode()
        expect(f"error {url} {more}", done.returncode == code and words in said
               and said.count("\n") == 1 and not done.stdout, (done.returncode, said))
    done = run(tool, "info", good.replace("//", "//me:secret@") + "?key=secret", "--http-timeout",
               "2")
    expect("passwords are not shown", done.returncode == 0
           and b"secret" not in done.stdout + done.stderr, done)


sys.exit(main())
