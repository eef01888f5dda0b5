#!/usr/bin/env python3
"""same_results.py MODEL: results do not depend on threads, memory, or the form and timing of queries. They
equal those of one thread with everything in memory, bit by bit and in order.
"""
import json
import os
import random
import struct
import subprocess
import sys
import threading

MODEL = sys.argv[1]
COUNT = max(300, int(20000 * float(os.environ.get("EBPO_TEST_SCALE", "1"))))
PLAIN = ["--threads", "1", "--memory", "64G"]
NAMES = {"inside": "x y z", "distance": "x y z", "ray": "ox oy oz dx dy dz",
         "box": "x0 y0 z0 x1 y1 z1"}
dice = random.Random(7)
wrong = []


def run_query(command, options, data, pieces=None):
    process = subprocess.Popen(["ebpo", command, *options, MODEL], stdin=subprocess.PIPE,
                               stdout=subprocess.PIPE)

    def feed():
        at = 0
        while at < len(data):
            size = dice.choice(pieces) if pieces else len(data)
            process.stdin.write(data[at:at + size])
            process.stdin.flush()
            at += size
        process.stdin.close()
    feeder = threading.Thread(target=feed)
    feeder.start()
    out = process.stdout.read()
    feeder.join()
    if process.wait() != 0:
        wrong.append(f"{command} {options}: exit code {process.returncode}")
    return out


def rows_for(command):
    for _ in range(COUNT):
        p = [dice.uniform(-1.2, 1.2) for _ in range(3)]
        if command == "ray":
            yield p + [dice.gauss(0, 1) for _ in range(3)]
        elif command == "box":
            yield p + [x + abs(dice.gauss(0, 0.05)) for x in p]
        else:
            yield p


def as_number(x):
    return dice.choice([repr, float.hex, lambda v: f"{v:.20e}", lambda v: f"+{v!r}" if v > 0 else repr(v)])(x)


def as_text(rows):
    """Returns lines in several notations of the same numbers."""
    for row in rows:
        if dice.random() < 0.02:
            yield dice.choice(["", "# a comment", "   ", "\t# 1 2 3"]) + dice.choice(["\n", "\r\n"])
        yield (dice.choice([" ", ",", ", ", "\t", "  "]).join(map(as_number, row)) +
               dice.choice(["", " ", " # 7", "\r"]) + "\n")


def compare(what, expected, got):
    if expected != got:
        at = next((i for i, (a, b) in enumerate(zip(expected, got)) if a != b), "the end")
        wrong.append(f"{what}: {len(got)} bytes, not {len(expected)}; differs at {at}")


def header_and_rows(command, rows):
    """Returns columns in another order, with additional ones."""
    names = NAMES[command].split()
    order = names + ["note", "id"]
    dice.shuffle(order)
    lines = ["# made by a test\n", ",".join(f'"{n.upper()}"' for n in order) + "\r\n"]
    for number, row in enumerate(rows):
        cells = dict(zip(names, map(repr, row)), note='"a, b"', id=str(number))
        lines.append(",".join(cells[n] for n in order) + "\n")
    return "".join(lines).encode()


def as_npy(rows, kind):
    values = [x for row in rows for x in row]
    head = (f"{{'descr': '{kind}', 'fortran_order': False, 'shape': ({len(rows)}, "
            f"{len(rows[0])}), }}\n").encode()
    return (b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head +
            struct.pack(("<" if kind[0] == "<" else ">") + f"{len(values)}d", *values))


def check(command, options=()):
    options = list(options)
    rows = list(rows_for(command))
    raw = struct.pack(f"<{len(rows) * len(rows[0])}d", *(x for row in rows for x in row))
    text = "".join(as_text(rows)).encode()
    expected = run_query(command, PLAIN + options + ["--raw"], raw)
    for how in [], ["--threads", "5"], ["--threads", "3", "--cut-level", "1"], ["--cut-level", "2"]:
        compare(f"{command} {options} {how} raw", expected, run_query(command, how + options + ["--raw"], raw))
    compare(f"{command} {options} in pieces", expected,
            run_query(command, ["--raw"] + options, raw, [1, 23, 24, 1000, 65536]))
    for kind in "<f8", ">f8":
        compare(f"{command} {options} npy {kind}", expected,
                run_query(command, ["--raw"] + options, as_npy(rows, kind)))
    lines = run_query(command, PLAIN + options, text)
    compare(f"{command} {options} text", lines, run_query(command, ["--threads", "4"] + options, text))
    compare(f"{command} {options} text in pieces", lines,
            run_query(command, options, text, [3, 40, 4096, 100000]))
    compare(f"{command} {options} npy, text", lines, run_query(command, options, as_npy(rows, "<f8")))
    results = run_query(command, ["--header", "--csv"] + options, header_and_rows(command, rows))
    named, _, rest = results.partition(b"\n")
    if not named[:1].isalpha() or b"," not in named and options != ["--any"]:
        wrong.append(f"{command} {options}: no header: {named!r}")
    if command != "ray" or "--any" in options:
        compare(f"{command} {options} csv", lines, rest.replace(b",", b" "))
    return expected, lines, run_query(command, ["--json"] + options, text)


def bits(x):
    return struct.pack("<d", x)


expected, lines, objects = check("distance")
for i, (line, found) in enumerate(zip(lines.decode().splitlines(), map(json.loads, objects.splitlines()))):
    exact = expected[64 * i:64 * i + 56]
    if b"".join(map(bits, map(float, line.split()[:7]))) != exact or \
       b"".join(map(bits, [found["distance"], *found["point"], *found["normal"]])) != exact:
        wrong.append(f"distance {i}: {line} and {found} are not {struct.unpack('<7d', exact)}")
        break
if not len(expected) // 64 == len(lines.splitlines()) == len(objects.splitlines()) == COUNT:
    wrong.append("distance: the number of results differs from that of queries")
check("distance", ["--within", "0.05"])
check("distance", ["--nearest", "3"])
check("distance", ["--max-level", "2"])
check("inside")
check("inside", ["--max-level", "1"])
check("ray")
check("ray", ["--any"])
check("ray", ["--all"])
check("box")
print("\n".join(wrong[:10]) if wrong else "fine")
