#!/usr/bin/env python3
"""Programs that are killed at any moment: killed.py TOOL GENERATE FEATURES

convert, subset, repack, export and fetch are killed (SIGKILL) after times that are drawn between
none and somewhat more than a run takes. Afterwards the output is the old one or the new one, byte
for byte; beside it lies at most one temporary file of its own (and what fetch resumes from), and the
next run removes it. 200 kills for each command, fewer where EBPO_TEST_SCALE is less than 1. Then two writers of one
output, and two readers of one cache folder.
"""
import os
import random
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "kit"))
import ranges_server

KILLS, OLD = 200, b"what was there before\n"
LEFT = re.compile(r"\.OUT(\.[a-z0-9]+)?\.\d+-\d+\.tmp|OUT\.part(/.*)?")
COMMANDS = {
    "convert": ("", "convert -q model.ply OUT", ["OUT"]),
    "subset": ("", "subset -q --levels 0-4 model.ebpo.h5 OUT", ["OUT"]),
    "repack": ("", "repack -q model.ebpo.h5 OUT", ["OUT"]),
    "export": ("", "export -q --levels 0-4 model.ebpo.h5 OUT.vtkhdf", ["OUT.vtkhdf"]),
    "fetch": ("http", "fetch -q URL OUT", ["OUT"]),
}
failures = []


def check(good, what):
    if not good:
        failures.append(what)
        print(f"FAILED: {what}")


def read(path):
    with open(path, "rb") as f:
        return f.read()


def arguments(command, url):
    return [TOOL, *shlex.split(command.replace("URL", url))]


def run(command, folder):
    environment = dict(os.environ, TMPDIR=os.path.join(folder, "temporary"))
    return subprocess.Popen(command, cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def make_place(inputs, root):
    shutil.rmtree(root, ignore_errors=True)
    os.makedirs(os.path.join(root, "temporary"))
    for name in os.listdir(inputs):
        os.link(os.path.join(inputs, name), os.path.join(root, name))


def kill_often(name, command, outputs, inputs, root, draw):
    """Kills in one folder, so that what remains meets the next run; returns counts."""
    make_place(inputs, root)
    began = time.monotonic()
    check(run(command, root).wait(timeout=300) == 0, f"{name}: a run that nobody kills")
    length = time.monotonic() - began
    right = {out: read(os.path.join(root, out)) for out in outputs}
    inputs_there = set(os.listdir(inputs)) | {"temporary"}
    done = old = new = left = 0
    for _ in range(KILLS if SCALE >= 1 else max(4, round(KILLS * SCALE / 10))):
        for out in outputs:
            with open(os.path.join(root, out), "wb") as f:
                f.write(OLD)
        process = run(command, root)
        time.sleep(draw.uniform(0, 1.1 * length))
        process.kill()
        process.communicate(timeout=300)
        done += process.returncode == 0
        for out in outputs:
            content = read(os.path.join(root, out))
            old += content == OLD
            new += content == right[out]
            check(content in (OLD, right[out]), f"{name}: {out} is neither the old nor the new")
        others = set(os.listdir(root)) - inputs_there - set(outputs)
        left += bool(others)
        check(all(LEFT.fullmatch(o) for o in others) and
              len([o for o in others if o.endswith(".tmp")]) <= 1, f"{name}: left {others}")
        check(not os.listdir(os.path.join(root, "temporary")),
              f"{name}: temporary files have names: {os.listdir(os.path.join(root, 'temporary'))}")
    process = run(command, root)
    said = process.communicate(timeout=300)[1]
    check(process.returncode == 0, f"{name}: the run after the kills: {said}")
    for out in outputs:
        check(read(os.path.join(root, out)) == right[out], f"{name}: the run after: {out}")
    others = set(os.listdir(root)) - inputs_there - set(outputs)
    check(not others, f"{name}: the run after leaves {others}")
    print(f"{name}: {old} old, {new} new; {done} had ended; after {left} a temporary file was there")


def two_writers(inputs, root):
    """One output, written by two programs at a time: it is of one or the other."""
    make_place(inputs, root)
    for _ in range(20 if SCALE >= 1 else 2):
        both = [run(arguments(f"subset -q --levels 0-{n} model.ebpo.h5 OUT", ""), root)
                for n in (2, 4)]
        for process in both:
            said = process.communicate(timeout=300)[1]
            check(process.returncode == 0, f"two writers: {said}")
        good = subprocess.run([TOOL, "verify", "-q", "OUT"], cwd=root, capture_output=True)
        check(good.returncode == 0, f"two writers: {good.stderr}")
        check(not [n for n in os.listdir(root) if n.endswith(".tmp")], "two writers: files left")


def two_readers(inputs, root, url):
    """One cache folder, used by two programs at a time, one of which is killed now and then."""
    make_place(inputs, root)
    points = os.path.join(root, "points.txt")
    with open(points, "w", encoding="ascii") as f:
        f.writelines(f"{x / 10} 0.1 0.2\n" for x in range(-10, 11))
    right = subprocess.run([TOOL, "inside", "model.ebpo.h5", points], cwd=root, check=True,
                           capture_output=True).stdout
    command = [TOOL, "inside", "--http-cache", os.path.join(root, "cache"), url, points]
    for turn in range(20 if SCALE >= 1 else 2):
        both = [subprocess.Popen(command, cwd=root, stdout=subprocess.PIPE,
                                 stderr=subprocess.PIPE) for _ in range(2)]
        if turn % 2:
            time.sleep(0.01 * turn)
            both[0].kill()
        for n, process in enumerate(both):
            answers, said = process.communicate(timeout=300)
            if not (turn % 2 and n == 0):
                check(process.returncode == 0 and answers == right,
                      f"two readers: {process.returncode} {said}")


def main():
    features = sys.argv[3].split(",")
    draw = random.Random(1)
    with tempfile.TemporaryDirectory(dir=os.environ.get("TMPDIR", "/var/tmp")) as root:
        inputs = os.path.join(root, "inputs")
        os.makedirs(inputs)
        model, file = (os.path.join(inputs, n) for n in ("model.ply", "model.ebpo.h5"))
        subprocess.run([GENERATE, "--base", "torus", "--faces", "5000", model], check=True,
                       stdout=subprocess.DEVNULL)
        subprocess.run([TOOL, "convert", "-q", model, file], check=True)
        url = ranges_server.serve(read(file))
        for name, (need, command, outputs) in COMMANDS.items():
            if not need or need in features:
                kill_often(name, arguments(command, url), outputs, inputs,
                           os.path.join(root, name), draw)
        two_writers(inputs, os.path.join(root, "writers"))
        if "http" in features:
            two_readers(inputs, os.path.join(root, "readers"), url)
    print(f"{len(failures)} failed")
    return 1 if failures else 0


TOOL, GENERATE = (os.path.abspath(a) for a in sys.argv[1:3])
SCALE = float(os.environ.get("EBPO_TEST_SCALE", "1"))
if __name__ == "__main__":
    sys.exit(main())
