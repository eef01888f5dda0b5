#!/usr/bin/env python3
"""Checks that every file that `convert`, `subset`, `repack`, `recover` and `fetch` write is valid, with each option that
changes a file.

written.py EBPO SERVER [PLY ...] [--few] [--generate EBPO-GENERATE]

SERVER is tests/support/faulty_server.py, or - to omit fetch. Each file must be opened by `ebpo info` without --compat
and verified by `ebpo verify`. Refused combinations are counted and printed. --few: tests every seventh combination,
others for each model. --generate: also tests a small model that this program makes.
"""
import argparse
import collections
import json
import os
import pathlib
import subprocess
import sys
import tempfile

CONVERT = """
--codec deflate
--codec none
--zstd-level 1
--zstd-level 19
--subtree-faces 64
--subtree-faces 512 --codec deflate
--subtree-faces 512 --codec none
--subtree-faces none
--max-level 0
--max-level 1
--max-level 5
--leaf-faces 0 --max-level 4
--leaf-faces 1 --max-level 6
--leaf-faces 500
--epsilon 0
--epsilon 0.05
--select kmedoids
--select kmedoids --normals angle --seed 7
--select offset --percent 10
--select random --seed 3 --percent 80
--select kmedoids --k-root 24
--select offset --k-root 1%
--profile full
--profile full --subtree-faces 64
--parts -envelopes
--parts -envelopes --subtree-faces 64
--parts -mesh
--parts envelopes,leaf-planes --codec none
--parts -maps
--parts -maps --face-coding gates
--parts -attributes
--parts -colours
--parts -attributes,-colours,-maps
--parts -attributes,-colours,-maps,-envelopes --codec deflate
--embed-textures
--profile full
--profile lod
--profile lod --subtree-faces 64
--profile collision
--profile collision --face-coding gates
--max-error 0.5
--max-error 0.01
--target-size 100K
--target-size 30K
--face-coding high-water
--face-coding gates
--face-coding gates --subtree-faces 64 --codec none
--weld
--drop-duplicates
--orient
--flip
--fill-holes
--repair
--rule evenodd
--rule positive
--unit mm --crs EPSG:25832 --date 2026-03-01
"""

# {box}: half of the model's box, from its lower corner
SUBSET = """
--levels 0-0
--levels 0-2
--levels 0-2 --parts mesh,envelopes
--levels 0-3 --codec deflate
--box {box}
--box {box} --levels 0-3
--box {box} --codec none
--parts mesh
--parts envelopes
--parts mesh,maps
--parts=-maps
--parts=-envelopes --face-coding gates
--profile full
--profile lod
--profile collision
--max-error 0.5
--target-size 100K
--codec deflate
--codec none
--subtree-faces 64
--face-coding gates
"""

REPACK = """
--codec zstd
--codec deflate --subtree-faces 64
--codec none --face-coding gates
"""


class Tried:
    def __init__(self, ebpo, few):
        self.ebpo, self.few = ebpo, few
        self.counts, self.wrong, self.refused = collections.Counter(), [], collections.Counter()
        self.number = 0

    def option_sets(self, text):
        """Return lists of options; of the long lists only some, others for each model."""
        for options in text.strip().split("\n"):
            self.number += 1
            if not self.few or self.number % 7 == 0:
                yield options

    def run(self, *words):
        return subprocess.run((self.ebpo,) + words, capture_output=True, text=True, check=False)

    def made(self, command, options, source, target):
        """Run a command and check its output. Return True when there is an output."""
        names = ("-o", target, source) if command == "recover" else (source, target)
        done = self.run(command, *options.split(), *names)
        what = f"{command} {options} {source}"
        if done.returncode != 0:
            self.refused[f"{command} {options}"] += 1
            if done.returncode != 1 or not done.stderr or os.path.exists(target):
                self.wrong.append(f"{what}: ends with {done.returncode}: {done.stderr}")
            return False
        self.counts[command] += 1
        self.inspect(what, target)
        return True

    def inspect(self, what, target):
        for command in ("info", "verify"):
            inspected = self.run(command, "-q" if command == "verify" else "--json", target)
            if inspected.returncode != 0:
                self.wrong.append(f"{what}: {command} ends with {inspected.returncode}: {inspected.stderr}")


def lower_half(facts):
    low, size = facts["box_origin"], facts["box_size"]
    return ",".join(str(x) for x in low + [x + s / 2 for x, s in zip(low, size)])


def copies(tried, path, server):
    """Check the outputs of subset, recover and fetch for a file with all parts."""
    box = lower_half(json.loads(tried.run("info", "--json", path).stdout))
    for options in tried.option_sets(SUBSET):
        if tried.made("subset", options.replace("{box}", box), path, "s.ebpo.h5"):
            if tried.made("repack", "--codec none --subtree-faces 64", "s.ebpo.h5", "t.ebpo.h5"):
                os.unlink("t.ebpo.h5")
            os.unlink("s.ebpo.h5")
    if not tried.few and tried.made("recover", "", path, "r.ebpo.h5"):
        os.unlink("r.ebpo.h5")
    if server:
        with subprocess.Popen([sys.executable, server, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                              text=True) as serving:
            port = serving.stdout.readline().strip()
            tried.made("fetch", "", f"http://127.0.0.1:{port}/good/f.ebpo.h5", "f.ebpo.h5")
            serving.stdin.close()


def model(tried, path, server):
    tried.made("convert", "", path, "default.ebpo.h5")
    tried.made("convert", "--subtree-faces 64 --profile full", path, "parts.ebpo.h5")
    for options in tried.option_sets(CONVERT):
        if not tried.made("convert", options, path, "c.ebpo.h5"):
            continue
        for again in tried.option_sets(REPACK):
            if tried.made("repack", again, "c.ebpo.h5", "p.ebpo.h5"):
                os.unlink("p.ebpo.h5")
        os.unlink("c.ebpo.h5")
    for name in ("default.ebpo.h5", "parts.ebpo.h5"):
        copies(tried, name, server)
        os.unlink(name)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("ebpo", type=os.path.abspath)
    parser.add_argument("server")
    parser.add_argument("model", type=os.path.abspath, nargs="*")
    parser.add_argument("--few", action="store_true")
    parser.add_argument("--generate", type=os.path.abspath)
    given = parser.parse_args()
    server = None if given.server == "-" else os.path.abspath(given.server)
    tried = Tried(given.ebpo, given.few)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        if given.generate:
            subprocess.run([given.generate, "--faces", "1200", "g.ply"], check=True, capture_output=True)
            given.model.append("g.ply")
        for path in given.model:
            model(tried, path, server)
        left = [p.name for p in pathlib.Path(".").iterdir() if p.name not in ("f.ebpo.h5", "g.ply")]
        os.chdir("/")
    if left:
        tried.wrong.append(f"left behind: {left}")
    for line in tried.wrong:
        print(line)
    for options, count in tried.refused.items():
        print(f"not made, {count} times: {options}")
    print(", ".join(f"{count} by {command}" for command, count in tried.counts.items()) +
          f"; {len(tried.wrong)} wrong")
    return 1 if tried.wrong or not tried.counts["subset"] else 0


raise SystemExit(main())
