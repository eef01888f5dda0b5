#!/usr/bin/env python3
"""Tests programs that are killed at any time: killed.py TOOL GENERATE FEATURES [--kills=N] [NAME...]

Every writing command of commands.py is killed (SIGKILL) after random times, from zero to somewhat more than the
duration of a run. Then each output must be the old one or the new one, complete. Beside it there may be at most one
temporary file, and a lock file, or an incomplete folder. The next run removes them (fetch resumes from them). Each
command is killed 200 times, or N times; with EBPO_TEST_SCALE below 1 twice, and below 0.2 only every third command.
Then two programs write one output, and two programs use one cache folder.
"""
import collections
import glob
import os
import random
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support"))
import ranges_server
from commands import COMMANDS, OLD, is_new, make_inputs, old, put_old, read

KILLS = 200
LEFT = re.compile(r"\.OUT(\.[a-z0-9]+)*\.(\d+-\d+\.tmp|lock)|OUT\.part(/.*)?|"
                  r"(OUT|\.OUT\.new)\.part-[0-9a-f]{8}-\d+-\w+(\.old)?")
NAMED = re.compile(r"\.ebpo-crossings\.\d+-\d+\.tmp") # until libhdf5 has opened the file
failures = []


def check(good, what):
    if not good:
        failures.append(what)
        print(f"FAILED: {what}")


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


def state(name, out, content, right):
    """Return "old", "new" or "neither" for an output."""
    command = COMMANDS[name]
    if content == old(command, out):
        return "old"
    return "new" if is_new(command, out, content, right) else "neither"


def other_files(root, inputs, outputs):
    return (set(os.listdir(root)) - set(os.listdir(inputs)) - {"temporary"} -
            {out.partition("/")[0] for out in outputs})


def check_other_files(name, root, inputs):
    """Return whether files remain beside the output."""
    others = other_files(root, inputs, COMMANDS[name].outputs)
    check(all(LEFT.fullmatch(o) for o in others) and
          len([o for o in others if o.endswith(".tmp")]) <= len(COMMANDS[name].outputs),
          f"{name}: left {others}")
    temporary = os.listdir(os.path.join(root, "temporary"))
    check(all(NAMED.fullmatch(t) for t in temporary), f"{name}: temporary files: {temporary}")
    return bool(others or temporary)


def kill_once(name, command, root, wait):
    """Kill one run. Return True when it had ended before."""
    put_old(COMMANDS[name], root)
    process = run(command, root)
    time.sleep(wait)
    process.kill()
    process.communicate(timeout=300)
    return process.returncode == 0


def is_replaced_report(path):
    """Return True for the previous contents of a report's folder, between the exchange and the removal.

    No later run mistakes this folder for one of its own.
    """
    return os.path.isdir(path) and read(path).get("report.json") == OLD


def kill_often(name, url, inputs, root, draw, kills):
    """Kill runs in one folder, so that each run starts with the remains of the previous ones."""
    command, outputs = arguments(COMMANDS[name].text, url), COMMANDS[name].outputs
    make_place(inputs, root)
    put_old(COMMANDS[name], root)
    began = time.monotonic()
    check(run(command, root).wait(timeout=300) == 0, f"{name}: a run without a kill")
    length = time.monotonic() - began
    right = {out: read(os.path.join(root, out)) for out in outputs}
    counts, done, left, mixed = collections.Counter(), 0, 0, 0
    for _ in range(kills):
        wait = draw.uniform(0, 1.1 * length)
        ended = kill_once(name, command, root, wait)
        done += ended
        # the load of the machine changes the duration of runs
        length *= 0.95 if ended and wait < length else 1.1 if not ended and wait > 0.9 * length else 1
        states = [state(name, out, read(os.path.join(root, out)), right[out]) for out in outputs]
        check("neither" not in states, f"{name}: {outputs} are {states}")
        counts.update(states[:1])
        mixed += len(set(states)) > 1
        left += check_other_files(name, root, inputs)
    put_old(COMMANDS[name], root)
    process = run(command, root)
    said = process.communicate(timeout=300)[1]
    check(process.returncode == 0, f"{name}: the run after the kills: {said}")
    for out in outputs:
        check(state(name, out, read(os.path.join(root, out)), right[out]) == "new",
              f"{name}: the run after: {out}")
    others = {other for other in other_files(root, inputs, outputs)
              if not is_replaced_report(os.path.join(root, other))}
    others |= set(os.listdir(os.path.join(root, "temporary")))
    check(not others, f"{name}: the run after that leaves {others}")
    print(f"| {name} | {counts['old']} | {counts['new']} | {counts['neither']} | {mixed} | {done} |"
          f" {left} |", flush=True)
    shutil.rmtree(root)


def two_writers(inputs, root):
    """Write one output with two programs at a time. It must be that of one of them."""
    make_place(inputs, root)
    for _ in range(20 if SCALE >= 1 else 2):
        both = [run(arguments(f"subset -q --levels 0-{n} model.ebpo.h5 OUT", ""), root)
                for n in (2, 4)]
        for process in both:
            said = process.communicate(timeout=300)[1]
            check(process.returncode == 0, f"two writers: {said}")
        good = subprocess.run([TOOL, "verify", "-q", "OUT"], cwd=root, capture_output=True)
        check(good.returncode == 0, f"two writers: {good.stderr}")
        check(not [n for n in os.listdir(root) if n.endswith(".tmp")], "two writers: temporary files remain")


def stop_at_folder(command, root):
    """Return a stopped program with an incomplete folder, and this folder."""
    for _ in range(50):
        process, made = run(command, root), []
        while not made and process.poll() is None:
            made = glob.glob(os.path.join(root, "OUT.part-*", "*"))
        process.send_signal(signal.SIGSTOP)
        if process.poll() is None and made and os.path.exists(made[0]):
            return process, os.path.dirname(made[0])
        process.send_signal(signal.SIGCONT)
        process.communicate(timeout=300)
        shutil.rmtree(os.path.join(root, "OUT"), ignore_errors=True)
    sys.exit("no run could be stopped while it fills its folder")


def folders_in_use(inputs, root):
    """Check that an incomplete folder is removed after its program has ended, and no other folder."""
    make_place(inputs, root)
    command = arguments(COMMANDS["convert components"].text, "")
    process, folder = stop_at_folder(command, root)
    check(run(command, root).wait(timeout=300) == 0, "folders: while another program is stopped")
    check(os.listdir(folder), "folders: a folder in use is removed")
    like = [folder + "0", os.path.join(root, "OUT.part-abcdef")]
    for other in like: # folders with these names were not made by a program: their inodes differ
        shutil.copytree(folder, other)
    process.kill()
    process.communicate(timeout=300)
    shutil.rmtree(os.path.join(root, "OUT"))
    check(run(command, root).wait(timeout=300) == 0, "folders: after the kill")
    check(not os.path.exists(folder), "folders: the folder of a killed program remains")
    check(all(os.listdir(other) for other in like if os.path.exists(other)) and
          all(map(os.path.exists, like)), "folders: the user's own folders are removed")


def two_readers(inputs, root, url):
    """Use one cache folder with two programs at a time; one of them is killed repeatedly."""
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
            results, said = process.communicate(timeout=300)
            if not (turn % 2 and n == 0):
                check(process.returncode == 0 and results == right,
                      f"two readers: {process.returncode} {said}")


def main():
    features, wanted = sys.argv[3].split(","), [a for a in sys.argv[4:] if a[0] != "-"]
    kills = [int(a.partition("=")[2]) for a in sys.argv[4:] if a.startswith("--kills=")]
    kills = kills[0] if kills else KILLS if SCALE >= 1 else 2
    draw = random.Random(1)
    names = [n for n, c in COMMANDS.items() if c.outputs and (not c.need or c.need in features)]
    names = wanted or (names if SCALE >= 0.2 else names[::3])
    with tempfile.TemporaryDirectory(dir=os.environ.get("TMPDIR", "/var/tmp")) as root:
        inputs = os.path.join(root, "inputs")
        url = ranges_server.serve(make_inputs(TOOL, GENERATE, inputs, 5000))
        print("| command | old | new | neither | one of two new | ended before | files remain |\n"
              "|---|---:|---:|---:|---:|---:|---:|")
        for name in names:
            kill_often(name, url, inputs, os.path.join(root, "killed"), draw, kills)
        folders_in_use(inputs, os.path.join(root, "folders"))
        two_writers(inputs, os.path.join(root, "writers"))
        if "http" in features:
            two_readers(inputs, os.path.join(root, "readers"), url)
    print(f"{len(failures)} failed")
    return 1 if failures else 0


TOOL, GENERATE = (os.path.abspath(a) for a in sys.argv[1:3])
SCALE = float(os.environ.get("EBPO_TEST_SCALE", "1"))
if __name__ == "__main__":
    sys.exit(main())
