#!/usr/bin/env python3
"""Tests failing system calls.

faults.py TOOL GENERATE FAULTS FEATURES [--foreign] [--table] [--every=N] [CASE...]

For each command and each kind of call, the n-th call fails once, or from then on (tests/support/faults.h).
Then the program must end by itself; its outputs must be complete and correct, or unchanged; no other file may
remain; and the message must state the error.

CASE: names of commands.py; default: all. EBPO_TEST_SCALE of at least 1: all calls fail in turn, or, with
--every, every N-th. Less than 1: this share of the kinds of each command, and one call of each kind.
--foreign: allocations by libhdf5 and other libraries fail instead of the project's own; they are counted
separately. --table prints counts in Markdown. FAULTS may name further preloaded libraries after a colon, such
as liblsan.so.0, which finds memory that is not freed at exit.
"""
import collections
import concurrent.futures
import errno
import os
import random
import re
import shlex
import shutil
import struct
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "support"))
import ranges_server
from commands import COMMANDS, is_new, make_inputs, old, put_old, read

# The errors of each kind. Interrupted and short calls are not failures: the command continues.
KINDS = {"malloc": ["ENOMEM"], "read": ["EIO", "EINTR"], "short-read": [""],
         "write": ["EIO", "ENOSPC", "EINTR"], "short-write": [""], "fsync": ["EIO"],
         "rename": ["EIO"], "truncate": ["EIO"], "close": ["EIO"], "mmap": ["ENOMEM"],
         "open": ["EMFILE"], "allocate": ["ENOSPC"], "thread": ["EAGAIN"]}
HARMLESS = ("EINTR", "")
SAID = {"ENOMEM": r"memory|Cannot allocate", "EAGAIN": r"temporarily unavailable|thread"}
LEAK = 23  # LeakSanitizer's exit code


class Place:
    """A folder with the inputs and the previous outputs, and a folder for temporary files."""

    def __init__(self, inputs, root, case, url):
        self.root, self.outputs = root, COMMANDS[case].outputs
        self.temporary = os.path.join(root, "temporary")
        self.command = [TOOL, *shlex.split(COMMANDS[case].text.replace("URL", url))]
        shutil.rmtree(root, ignore_errors=True)
        os.makedirs(self.temporary)
        for name in os.listdir(inputs):
            os.link(os.path.join(inputs, name), os.path.join(root, name))
        put_old(COMMANDS[case], root)

    def files(self):
        return {os.path.join(folder, name)[len(self.root) + 1:]
                for folder, _, names in os.walk(self.root) for name in names if name != "counts"}

    def content(self, name):
        return read(os.path.join(self.root, name))

    def run(self, fault, foreign=False):
        """Run the command. Return exit code, output, messages, number of calls of the kind, and of failed calls."""
        counts = os.path.join(self.root, "counts")
        environment = dict(os.environ, LC_ALL="C.UTF-8", TMPDIR=self.temporary, LD_PRELOAD=FAULTS,
                           EBPO_TEST_FAULT=fault, EBPO_TEST_FAULT_COUNT=counts,
                           ASAN_OPTIONS="verify_asan_link_order=0:allocator_may_return_null=1",
                           LSAN_OPTIONS=f"exitcode={LEAK}:suppressions={SUPPRESSIONS}")
        if foreign:
            environment["EBPO_TEST_FAULT_FOREIGN"] = "1"
        try:
            done = subprocess.run(self.command, cwd=self.root, env=environment, timeout=120,
                                  stdin=subprocess.DEVNULL, capture_output=True)
        except subprocess.TimeoutExpired:
            return "no end", b"", "", 0, 0
        with open(counts, "rb") as f:
            calls, failed = struct.unpack("QQ", f.read(16))
        return (done.returncode, done.stdout, done.stderr.decode("utf-8", "replace"), calls, failed)


class Case:
    """A command, and its results without faults."""

    def __init__(self, name, inputs, root, url):
        self.name, self.inputs, self.root, self.url = name, inputs, root, url
        self.command = COMMANDS[name]
        place = self.place("reference")
        code, self.printed, said, _, _ = place.run("read:0:5")
        if code != 0:
            sys.exit(f"{name}: {code}: {said}")
        self.files = place.files()
        self.right = {o: place.content(o) for o in place.outputs}
        self.before = self.place("before").files()

    def place(self, number):
        root = os.path.join(self.root, f"{self.name} {number}".replace(" ", "_"))
        return Place(self.inputs, root, self.name, self.url)

    def calls(self, kind, foreign):
        return self.place("count").run(f"{kind}:0:5", foreign)[3]

    def is_right(self, name, content):
        return is_new(self.command, name, content, self.right[name])

    def judge(self, place, kind, error, outcome):
        """Return what is wrong, or an empty text."""
        code, printed, said, _, failed = outcome
        wrong = [name for name in place.outputs if not self.is_right(name, place.content(name))]
        if code == 0:
            if wrong or (printed != self.printed and not self.command.times_printed):
                return f"success, with wrong {wrong or 'results'}"
            return "" if place.files() == self.files else f"success, left {place.files()}"
        if code != 1:
            return f"ended by {code}: {said[-300:]}"
        if error in HARMLESS:
            return f"did not continue: {said}"
        if not re.search(SAID.get(error) or os.strerror(getattr(errno, error)), said):
            return f"said: {said}"
        if place.outputs and not wrong and place.files() == self.files:
            return "" # a later call failed: syncing the folder, or examining the output
        if "of the two files, only" in said: # one of two outputs is written and cannot be undone
            return ""
        changed = [name for name in place.outputs if place.content(name) != old(self.command, name)]
        left = place.files() - self.before
        if self.name == "fetch": # the next fetch resumes from these files
            left = {name for name in left if not name.startswith("OUT.part/")}
        return f"changed {changed}, left {sorted(left)}: {said}" if changed or left else ""


def places(calls, case, kind):
    """Return the numbers of the calls that will fail."""
    draw = random.Random(f"{case.name} {kind}")
    if SCALE < 1:
        return [draw.randint(1, calls)] if calls and draw.random() < max(SCALE, 0.2) else []
    step = max(EVERY, 20 if case.command.seconds else 1)
    return range(draw.randint(1, min(step, calls)), calls + 1, step) if calls else []


def attempt(case, kind, error, n, onward, foreign):
    place = case.place(f"{kind} {error} {n} {onward}")
    number = getattr(errno, error) if error else 0
    outcome = place.run(f"{kind}:{n}{'+' if onward else ''}:{number}", foreign)
    wrong = case.judge(place, kind, error, outcome)
    shutil.rmtree(place.root, ignore_errors=True)
    return (case.name, kind, error, n, onward, wrong, outcome)


def attempts(case, foreign):
    for kind, errors in KINDS.items():
        if foreign and kind != "malloc":
            continue
        for n in places(case.calls(kind, foreign), case, kind):
            for error in errors if SCALE >= 1 else errors[n % len(errors):][:1]:
                for onward in (False, True) if SCALE >= 1 else (n % 2 == 1,):
                    if not (onward and error == "EINTR"): # it would never end
                        yield (case, kind, error, n, onward, foreign)


def prepare(root):
    inputs = os.path.join(root, "inputs")
    with open(SUPPRESSIONS, "w", encoding="ascii") as f:
        f.write("leak:libhdf5\nleak:libcurl\nleak:libgnutls\nleak:libcrypto\n"
                "leak:libfontconfig\nleak:ld-linux\n") # ld-linux: tests/support/known_leaks.h
    return inputs, ranges_server.serve(make_inputs(TOOL, GENERATE, inputs, 600))


def print_table(results):
    tried, failed = collections.Counter(), collections.Counter()
    for name, kind, _, _, _, wrong, _ in results:
        tried[name, kind] += 1
        failed[name, kind] += bool(wrong)
    kinds = [k for k in KINDS if any(kind == k for _, kind in tried)]
    print("| command | " + " | ".join(kinds) + " |\n|---|" + "---:|" * len(kinds))
    for name in dict.fromkeys(name for name, _ in tried):
        cells = [f"{tried[name, k]}" + (f" ({failed[name, k]})" if failed[name, k] else "")
                 for k in kinds]
        print(f"| {name} | " + " | ".join(cells) + " |")


def main():
    options = [a for a in sys.argv[5:] if a.startswith("--")]
    wanted = [a for a in sys.argv[5:] if not a.startswith("--")]
    features, foreign = sys.argv[4].split(","), "--foreign" in options
    global EVERY, SUPPRESSIONS
    EVERY = max([int(o.partition("=")[2]) for o in options if o.startswith("--every=")] or [1])
    base = os.environ.get("EBPO_TEST_FOLDER", "/dev/shm" if os.access("/dev/shm", os.W_OK) else None)
    with tempfile.TemporaryDirectory(dir=base) as root:
        SUPPRESSIONS = os.path.join(root, "suppressions")
        inputs, url = prepare(root)
        names = [n for n, c in COMMANDS.items()
                 if (not c.need or c.need in features) and (not wanted or n in wanted)]
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            cases = pool.map(lambda name: Case(name, inputs, root, url), names)
            todo = [a for some in pool.map(lambda c: list(attempts(c, foreign)), cases)
                    for a in some]
            results = list(pool.map(lambda a: attempt(*a), todo))
    bad = [r for r in results if r[5]]
    crashed = [r for r in bad if r[6][0] not in (0, 1)]
    for name, kind, error, n, onward, wrong, _ in bad:
        print(f"{name}: {kind} {n}{'+' if onward else ''} {error}: {wrong}")
    if "--table" in options:
        print_table(results)
    print(f"{len(results)} faults, {sum(r[6][4] > 0 for r in results)} of them occurred; "
          f"{len(bad)} with wrong results, {len(crashed)} of these did not end by themselves")
    return 1 if bad and not foreign else 0


TOOL, GENERATE = (os.path.abspath(a) for a in sys.argv[1:3])
FAULTS = ":".join(map(os.path.abspath, sys.argv[3].split(":")))
SCALE, EVERY, SUPPRESSIONS = float(os.environ.get("EBPO_TEST_SCALE", "1")), 1, ""
if __name__ == "__main__":
    sys.exit(main())
