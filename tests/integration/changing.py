#!/usr/bin/env python3
"""Tests files that change while they are open: changing.py TOOL GENERATE FEATURES

First, queries are made one by one. Between them the file is replaced, shortened, extended, damaged, or
overwritten with another model, on disk and on a server. Then commands read a file that another program
replaces or overwrites all the time. Finally, two programs write one output. Each result must be that of the
file that was opened, or of one of the two files; otherwise there must be an error with a message.
EBPO_TEST_SCALE is the share of the trials.
"""
import os
import random
import shutil
import subprocess
import sys
import tempfile
import threading

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support"))
import ranges_server

POINTS = 60
TURNS = 60  # runs of each command while the file is written
failures, counts = [], {}


def check(good, what):
    if not good:
        failures.append(what)
        print(f"FAILED: {what}")
    return good


def read(path):
    with open(path, "rb") as f:
        return f.read()


def write(path, content):
    with open(path, "r+b" if os.path.exists(path) else "wb") as f:
        f.write(content)
        f.truncate(len(content))


def count(what, outcome):
    counts.setdefault(what, {}).setdefault(outcome, 0)
    counts[what][outcome] += 1


# --- single queries ---

def replaced(path, other):
    shutil.copy(other, path + ".new")
    os.replace(path + ".new", path)


def removed(path, other):
    os.unlink(path)


def written_over(path, other):
    write(path, read(other))


def written_over_in_part(path, other):
    content = bytearray(read(path))
    half = len(content) // 2
    content[half:] = read(other)[half:len(content)]
    write(path, bytes(content))


def shortened(path, other):
    os.truncate(path, os.path.getsize(path) // 2)


def emptied(path, other):
    os.truncate(path, 0)


def grown(path, other):
    with open(path, "ab") as f:
        f.write(read(other))


def zeroed(path, other):
    size = os.path.getsize(path)
    with open(path, "r+b") as f:
        f.seek(size // 3)
        f.write(bytes(size - size // 3))


def flipped(path, other):
    content = bytearray(read(path))
    for at in range(len(content) // 4, len(content), 97):
        content[at] ^= 4
    write(path, bytes(content))


# The changes of the file. True: all queries must succeed nevertheless.
WAYS = {replaced: True, removed: True, grown: True, written_over: False,
        written_over_in_part: False, shortened: False, emptied: False, zeroed: False,
        flipped: False}


def queries(command, draw):
    width = {"inside": 3, "distance": 3, "ray": 6, "box": 6}[command]
    for _ in range(POINTS):
        row = [draw.uniform(-1.5, 1.5) for _ in range(width)]
        if command == "box": # small boxes
            row = row[:3] + [x + 0.2 for x in row[:3]]
        yield " ".join(map(repr, row)) + "\n"


def run_queries(command, path, sent, change):
    """Query a file. Return the results, the exit code and the messages. `change` is called after two queries."""
    how = ["--mode", "nodes"] if command == "inside" else []
    process = subprocess.Popen([TOOL, command, *how, "--cut-level", "1", "--memory", "3200KiB",
                                "--threads", "1", path], stdin=subprocess.PIPE, text=True,
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    results = []
    for n, query in enumerate(sent):
        if n == 2:
            change()
        try:
            process.stdin.write(query)
            process.stdin.flush()
        except BrokenPipeError:
            break
        results.append(process.stdout.readline())
        if not results[-1]:
            break
    rest, said = process.communicate(timeout=300)
    return [a for a in results if a] + rest.splitlines(True), process.returncode, said


def judge(what, right, outcome, must_go_on):
    results, code, said = outcome
    good = check(results == right[:len(results)], f"{what}: wrong results, {code}, {said}")
    if code == 0:
        good = check(len(results) == len(right), f"{what}: {len(results)} results, and success")
    else:
        good = check(code == 1 and said and not must_go_on, f"{what}: {code}: {said!r}") and good
    count(what.split(":")[0], "wrong" if not good else "all results" if code == 0 else "error")


def on_disk(root, a, b):
    draw = random.Random(2)
    for command in ("inside", "distance", "ray", "box"):
        sent = list(queries(command, draw))
        right = run_queries(command, a, sent, lambda: None)
        check(right[1] == 0 and len(right[0]) == POINTS, f"{command}: {right}")
        for change_file in WAYS:
            if SCALE < 1 and draw.random() > SCALE / 2:
                continue
            path = os.path.join(root, "open.ebpo.h5")
            shutil.copy(a, path)
            outcome = run_queries(command, path, sent, lambda w=change_file, p=path: w(p, b))
            judge(f"{change_file.__name__}: {command}", right[0], outcome, WAYS[change_file])


def on_a_server(a, b):
    """Change a file on a server, with another ETag or with the same one."""
    draw = random.Random(3)
    for command in ("inside", "distance", "ray"):
        sent = list(queries(command, draw))
        right = run_queries(command, a, sent, lambda: None)
        for tagged in (True, False):
            server = ranges_server.start(read(a))

            def change(server=server, tagged=tagged):
                server.data, server.etag = read(b), '"2"' if tagged else server.etag

            outcome = run_queries(command, ranges_server.url_of(server), sent, change)
            judge(f"server, {'another' if tagged else 'the same'} ETag: {command}", right[0],
                  outcome, False)
            server.shutdown()


# --- while another program writes ---

COMMANDS = {"inside": "inside {} points.txt", "verify": "verify -q {}",
            "extract": "extract -q --mesh {} OUT.ply", "subset": "subset -q --levels 0-3 {} OUT.h5",
            "export": "export -q --levels 0-3 {} OUT.glb", "repack": "repack -q {} OUT.h5",
            "levels": "info --json --arrays {}"}


def result(root, command, path):
    for name in os.listdir(root):
        if name.startswith("OUT"):
            os.unlink(os.path.join(root, name))
    done = subprocess.run([TOOL, *command.format(path).split()], cwd=root, timeout=300,
                          capture_output=True)
    written = [read(os.path.join(root, n)) for n in sorted(os.listdir(root)) if n.startswith("OUT")]
    return done.returncode, [done.stdout, *written], done.stderr


def serve_both(root, a, b, change, name, must_go_on):
    path = os.path.join(root, "model.ebpo.h5")
    size = max(map(os.path.getsize, (a, b)))
    for which in (a, b):  # of equal size: an overwritten file never ends with bytes of the other one
        os.truncate(which, size)
    shutil.copy(a, path)
    stop = threading.Event()

    def writer():
        turn = 0
        while not stop.is_set():
            turn += 1
            change(path, b if turn % 2 else a)
            stop.wait(0.002)

    rights = {}
    for which in (a, b):
        written_over(path, which)
        for command, text in COMMANDS.items():
            code, made, said = result(root, text, path)
            check(code == 0, f"{command} of {which}: {said}")
            rights.setdefault(command, []).append(made)
    thread = threading.Thread(target=writer)
    thread.start()
    for command, text in COMMANDS.items():
        if command == "levels" and not must_go_on:
            continue  # no checksum covers the whole header: docs/develop/threats.md
        for _ in range(max(1, round(TURNS * SCALE / 10)) if SCALE < 1 else TURNS):
            code, made, said = result(root, text, path)
            if code == 0:
                good = check(made in rights[command], f"{name}: {command}: neither of the two")
            else:
                good = check(code == 1 and said and len(made) == 1 and not must_go_on,
                             f"{name}: {command}: {code}: {said}, {len(made) - 1} files")
            count(name, "wrong" if not good else "one of the two" if code == 0 else "error")
    stop.set()
    thread.join()


def two_writers(root, a, b):
    """Write one output with two programs at a time. The output must be complete, whichever is the last."""
    for _ in range(TURNS if SCALE >= 1 else 3):
        both = [subprocess.Popen([TOOL, *text.format(which).split()], cwd=root,
                                 stderr=subprocess.PIPE)
                for which, text in ((a, "repack -q {} OUT.h5"), (b, "subset -q --levels 0-3 {} "
                                                                   "OUT.h5"))]
        for process in both:
            said = process.communicate(timeout=300)[1]
            check(process.returncode == 0, f"two writers: {said}")
        done = subprocess.run([TOOL, "verify", "-q", "OUT.h5"], cwd=root, capture_output=True)
        good = check(done.returncode == 0, f"two writers: {done.stderr}")
        count("two writers of one output", "one of the two" if good else "wrong")


def main():
    features = sys.argv[3].split(",")
    with tempfile.TemporaryDirectory(dir=os.environ.get("TMPDIR", "/var/tmp")) as root:
        a, b = (os.path.join(root, n) for n in ("a.ebpo.h5", "b.ebpo.h5"))
        for seed, path in (("1", a), ("2", b)):
            subprocess.run([GENERATE, "--base", "torus", "--faces", "40000", "--seed", seed,
                            path + ".ply"], check=True, stdout=subprocess.DEVNULL)
            subprocess.run([TOOL, "convert", "-q", "--subtree-faces", "64", path + ".ply", path],
                           check=True)
        with open(os.path.join(root, "points.txt"), "w", encoding="ascii") as f:
            f.writelines(queries("inside", random.Random(1)))
        on_disk(root, a, b)
        if "http" in features:
            on_a_server(a, b)
        serve_both(root, a, b, replaced, "while a program replaces", True)
        serve_both(root, a, b, written_over, "while a program overwrites", False)
        two_writers(root, a, b)
    for what, outcomes in counts.items():
        print(f"{what}: " + ", ".join(f"{n} {o}" for o, n in sorted(outcomes.items())))
    print(f"{len(failures)} failed")
    return 1 if failures else 0


TOOL, GENERATE = (os.path.abspath(a) for a in sys.argv[1:3])
SCALE = float(os.environ.get("EBPO_TEST_SCALE", "1"))
if __name__ == "__main__":
    sys.exit(main())
