#!/usr/bin/env python3
"""Flips single bits of a file; checks that `ebpo verify` names the damaged part and `ebpo recover` restores it.

damaged_parts.py EBPO FILE.ebpo.h5 [--count N] [--seed S]: four of five flips are in chunks, the others
anywhere. Prints how often which came of it; exit code 1 where verifying failed without the damaged array's
name, where a repaired file does not verify, or where it has another content and its maps were not lost.
"""
import argparse
import collections
import json
import os
import random
import subprocess
import tempfile

import h5py


def places_of(path):
    places = []

    def visit(name, item):
        if isinstance(item, h5py.Dataset) and item.chunks:
            for i in range(item.id.get_num_chunks()):
                chunk = item.id.get_chunk_info(i)
                places.append((chunk.byte_offset, chunk.byte_offset + chunk.size, "/" + name))

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return places


def run(*words):
    return subprocess.run(words, capture_output=True, text=True, check=False)


def content(ebpo, path):
    return json.loads(run(ebpo, "info", "--json", path).stdout)["content_sha256"]


def judge(ebpo, right, name, counts):
    """One damaged file, d.ebpo.h5; what is wrong with what was said and made."""
    wrong = []
    where = "array" if name else "head or unused"
    verified = run(ebpo, "verify", "d.ebpo.h5")
    named = bool(name) and name in verified.stderr
    counts[where, "verify", "not seen" if verified.returncode == 0 else "named" if named else "reported"] += 1
    if verified.returncode not in (0, 1) or (name and verified.returncode == 1 and not named):
        wrong.append(f"verify: {verified.returncode} {verified.stderr}")
    repaired = run(ebpo, "recover", "-o", "r.ebpo.h5", "d.ebpo.h5")
    if not os.path.exists("r.ebpo.h5"):
        counts[where, "repair", "refused"] += 1
        return wrong if repaired.returncode == 1 else wrong + [f"repair: {repaired.returncode}"]
    same = content(ebpo, "r.ebpo.h5") == right
    lost = "maps        lost" in repaired.stdout
    counts[where, "repair", "same content" if same else "maps lost" if lost else "another content"] += 1
    if run(ebpo, "verify", "-q", "r.ebpo.h5").returncode != 0 or not (same or lost):
        wrong.append(f"repair: {repaired.returncode} {repaired.stdout} {repaired.stderr}")
    os.unlink("r.ebpo.h5")
    return wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("ebpo", type=os.path.abspath)
    parser.add_argument("file", type=os.path.abspath)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    rng = random.Random(given.seed)
    with open(given.file, "rb") as file:
        good = file.read()
    places, right, bad = places_of(given.file), content(given.ebpo, given.file), 0
    counts = collections.Counter()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for _ in range(given.count):
            begin, end, _ = rng.choice(places) if rng.random() < .8 else (0, len(good), "")
            at = rng.randrange(begin, end)
            name = next((n for a, b, n in places if a <= at < b), None)
            damaged = bytearray(good)
            damaged[at] ^= 1 << rng.randrange(8)
            with open("d.ebpo.h5", "wb") as file:
                file.write(damaged)
            for what in judge(given.ebpo, right, name, counts):
                bad += 1
                print(f"byte {at} of {name}: {what}")
        os.chdir("/")
    for key, count in sorted(counts.items()):
        print(f"{count:6} {', '.join(key)}")
    return 1 if bad else 0


raise SystemExit(main())
