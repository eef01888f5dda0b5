#!/usr/bin/env python3
"""Tests memory, temporary files and output of `ebpo convert`: building.py TOOL GENERATE FAULTS [few]

The model does not fit into its budget. The tests check:
  - the bytes are the same for any number of threads and any budget;
  - the resident memory of the process never exceeds --memory;
  - a process that is interrupted at any stage, also by SIGKILL, leaves nothing in --temp-dir, and nothing
    beside OUT unless it is killed;
  - a full disk is an error that names the folder, and leaves nothing.
FAULTS is preloaded to simulate a full disk without root. few: uses a smaller model that does not fit either,
and fewer budgets, numbers of threads and times of interruption.
"""
import contextlib
import math
import os
import pty
import re
import resource
import select
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../cli"))
sys.dont_write_bytecode = True
from run import has_terminal

TOOL, GENERATE, FAULTS = (os.path.abspath(a) for a in sys.argv[1:4])
MIB = 1 << 20
FEW = "few" in sys.argv[4:]
FACES, FEWER_FACES = 1_600_000 if FEW else 3_000_000, 1_200_000  # no model fits into 128 MiB
SMALL = 128 * MIB  # the least budget
# Coarse envelopes: the number of planes does not matter here.
QUICK = ["--max-level", "6", "--epsilon", "1", "--leaf-faces", "64"]
failures = []


def check(good, what):
    print(("ok      " if good else "FAILED  ") + what, flush=True)
    if not good:
        failures.append(what)


class Place:
    """An empty folder for the output, and one for temporary files."""

    def __init__(self, root, name):
        self.out_dir, self.temp_dir = os.path.join(root, name,
                                                   "out"), os.path.join(root, name, "temp")
        os.makedirs(self.out_dir)
        os.makedirs(self.temp_dir)
        self.out = os.path.join(self.out_dir, "x.ebpo.h5")

    def left(self):
        return sorted(os.listdir(self.out_dir)) + sorted(os.listdir(self.temp_dir))

    def command(self, model, *more, options=QUICK):
        return [TOOL, "convert", *options, "--temp-dir", self.temp_dir, *more, model, self.out]


def write_ply(path, vertices, faces):
    with open(path, "wb") as f:
        f.write(b"ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty double "
                b"x\nproperty double y\nproperty double z\n"
                b"element face %d\nproperty list uchar int vertex_indices\nend_header\n" % (len(vertices), len(faces)))
        f.write(b"".join(struct.pack("<3d", *v) for v in vertices))
        f.write(b"".join(struct.pack("<B3i", 3, *t) for t in faces))


def write_fan(path, faces):
    """Write two cones over one circle, with half of the faces at each apex."""
    n = faces // 2
    ring = [(math.cos(2 * math.pi * i / n), math.sin(2 * math.pi * i / n), 0.001 * (i % 7))
            for i in range(n)]
    sides = [t for i in range(n) for t in ((i, (i + 1) % n, n), ((i + 1) % n, i, n + 1))]
    write_ply(path, ring + [(0, 0, 1), (0, 0, -1)], sides)


def write_box(path):
    """Write a box of twelve large faces."""
    corners = [(i & 1, 1.03 * (i >> 1 & 1), 0.97 * (i >> 2 & 1)) for i in range(8)]
    squares = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    write_ply(path, corners, [t for a, b, c, d in squares for t in ((a, b, c), (a, c, d))])


def default_signals():
    # nohup and background jobs pass on that these signals are ignored
    for number in signal.SIGINT, signal.SIGTERM, signal.SIGHUP:
        signal.signal(number, signal.SIG_DFL)


def limits(file_bytes=None):
    def apply():
        default_signals()
        if file_bytes:
            resource.setrlimit(resource.RLIMIT_FSIZE, (file_bytes, file_bytes))
    return apply


def uses_files(pid, folder):
    """Return True when the process has mapped files of this folder."""
    with contextlib.suppress(OSError):
        with open(f"/proc/{pid}/maps", encoding="utf-8", errors="replace") as maps:
            return any(folder in line for line in maps)
    return False


def run(command, folder, environment=None, file_bytes=None):
    """Run a command. Return exit code, messages, peak of resident bytes, and whether files were used."""
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(command, stdout=said, stderr=said, stdin=subprocess.DEVNULL,
                                   preexec_fn=limits(file_bytes),
                                   env=dict(os.environ, LC_ALL="C.UTF-8", **(environment or {})))
        filed = False
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                break
            filed = filed or uses_files(process.pid, folder)
            time.sleep(0.01)
        process.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        return process.returncode, said.read().decode("utf-8",
                                                      "replace"), usage.ru_maxrss * 1024, filed


def slurp(path):
    with open(path, "rb") as f:
        return f.read()


def same_bytes_and_bounded_memory(root, model):
    place = Place(root, "plain")
    code, said, free_peak, filed = run(place.command(model, "-q", "--memory", "16G", "--threads",
                                                     "1"), place.temp_dir)
    check(code == 0 and not said, f"a large budget: builds ({said.strip()})")
    if code:
        return
    check(not filed, "a large budget: without files")
    expected = slurp(place.out)
    budgets = (("16G", 3), ("192MiB", 2), ("128MiB", 1), ("128MiB", 2), ("128MiB", 3))
    for memory, threads in budgets[4:] if FEW else budgets:
        os.unlink(place.out)
        code, said, peak, filed = run(place.command(model, "-q", "--memory", memory, "--threads",
                                                    str(threads)), place.temp_dir)
        name = f"--memory {memory} --threads {threads}"
        check(code == 0 and not said, f"{name}: builds ({said.strip()})")
        check(code == 0 and slurp(place.out) == expected, f"{name}: the bytes are the same")
        check(place.left() == ["x.ebpo.h5"],
              f"{name}: leaves nothing but the output ({place.left()})")
        if memory != "16G":
            budget = int(memory[:-3]) * MIB
            check(filed, f"{name}: uses temporary files")
            check(peak <= budget, f"{name}: {peak / MIB:.0f} MiB resident at most")
            check(free_peak > budget,
                  f"{name}: without a budget {free_peak / MIB:.0f} MiB, so the budget is "
                  f"tested")
    os.unlink(place.out)
    code, said, peak, filed = run(place.command(model, "-q", "--memory", "128MiB", "--threads",
                                                "16"), place.temp_dir)
    check(code == 0 and slurp(place.out) == expected and peak <= SMALL,
          f"--memory 128MiB --threads 16: the same bytes, {peak / MIB:.0f} MiB resident at most")
    if not FEW:
        proving_and_extracting(place, model)


def proving_and_extracting(place, model):
    """Verify and extract a file with the memory with which it was built."""
    back = os.path.join(place.out_dir, "back.ply")
    little = ["--temp-dir", place.temp_dir, "--memory"]
    for what, command in (("verify --against", ["verify", place.out, "--against", model]),
                          ("check --weld --orient --fill-holes",
                           ["check", "--weld", "--orient", "--fill-holes", model])):
        _, _, free_peak, _ = run([TOOL, *command, "-q", *little, "16G"], place.temp_dir)
        code, said, peak, _ = run([TOOL, *command, "-q", *little, "128MiB"], place.temp_dir)
        check(code == 0 and peak <= SMALL,
              f"{what} --memory 128MiB: {peak / MIB:.0f} MiB resident at most ({said.strip()})")
        check(free_peak > SMALL,
              f"{what}: without a budget {free_peak / MIB:.0f} MiB, so the budget is "
              f"tested")
    code, _, peak, _ = run([TOOL, "extract", "--mesh", "-q", *little, "128MiB", place.out, back],
                           place.temp_dir)
    check(code == 0 and peak <= SMALL,
          f"extract --mesh --memory 128MiB: {peak / MIB:.0f} MiB resident at most")
    check(slurp(back) == slurp(model), "extract --mesh --memory 128MiB: the model, bit for bit")


def same_bytes_as_default(root, model):
    """Compare bytes with default envelopes."""
    place, seen = Place(root, "default"), []
    for memory, threads in (("16G", 1), ("128MiB", 3)):
        code, said, _, _ = run(place.command(model, "-q", "--memory", memory, "--threads",
                                             str(threads), options=[]), place.temp_dir)
        seen.append(slurp(place.out) if code == 0 else said)
    check(isinstance(seen[0], bytes) and seen[0] == seen[1],
          "default envelopes: the bytes are the same for 16G, 1 thread and 128MiB, 3 threads")


def run_until(command, stage, number):
    """Run a command on a terminal, and send a signal when the stage is shown.

    Return how the command ended, and whether the stage was seen.
    """
    pid, terminal = pty.fork()
    if pid == 0:
        default_signals()
        os.execv(command[0], command)
    text, seen = b"", False
    while True:
        if select.select([terminal], [], [], 60)[0]:
            try:
                read = os.read(terminal, 65536)
            except OSError:
                read = b""
            if not read:
                break
            text = text[-4096:] + read
        if not seen and re.search(rb"stage \d+ of \d+, " + stage.encode(), text):
            seen = True
            os.kill(pid, number)
    os.close(terminal)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), seen


def one_cell(root, model):
    """Test a cell that may not be divided: it is processed in memory and must fit into half of the budget."""
    place = Place(root, "one cell")
    code, said, _, _ = run(place.command(model, "-q", "--memory", "128MiB",
                                         options=["--max-level", "0"]), place.temp_dir)
    check(code == 1 and "a cell of level 0, the deepest allowed level, lists " in said
          and "allow more levels or more memory" in said and not place.left(),
          f"one cell: {said.strip()} ({code}, {place.left()})")


def unlike_scans(root):
    """Test models whose pieces are large for their number of faces, or have many faces in one cell."""
    place, model = Place(root, "unlike scans"), os.path.join(root, "unlike.ply")
    write_box(model)
    for threads in "1", "3":
        code, said, peak, _ = run(place.command(model, "-q", "--memory", "128MiB", "--threads",
                                                threads,
                                                options=["--leaf-faces", "0", "--max-level",
                                                         "9"]), place.temp_dir)
        check(code == 0 and peak <= SMALL,
              f"12 faces in 1.5 million leaves, {threads} threads: {peak / MIB:.0f} MiB resident "
              f"at most ({said.strip()})")
    write_fan(model, 1_000_000)
    for threads in "1", "3":
        code, said, peak, _ = run(place.command(model, "-q", "--memory", "192MiB", "--threads",
                                                threads, options=[]), place.temp_dir)
        check(code == 0 and peak <= 192 * MIB,
              f"half a million faces at a vertex, {threads} threads: {peak / MIB:.0f} MiB "
              f"resident at most ({said.strip()})")
    os.unlink(model)


def interrupted(root, model):
    cases = [(s, signal.SIGTERM) for s in ("reading", "ordering faces", "checking edges",
                                           "cutting into pieces", "top envelopes", "joining levels",
                                           "numbering vertices")]
    cases += [(s, signal.SIGINT) for s in ("ordering vertices", "envelopes",
                                           "writing")] + [("writing", signal.SIGTERM),
                                                          ("envelopes", signal.SIGHUP)]
    if not has_terminal():
        print("skipped: interruptions, as there is no pseudo-terminal to show the stages")
        return
    cases += [(s, signal.SIGKILL) for s in ("ordering faces", "envelopes", "writing")]
    if FEW:
        cases = [("ordering faces", signal.SIGTERM), ("envelopes", signal.SIGINT), ("envelopes", signal.SIGKILL)]
    for stage, number in cases:
        place = Place(root, f"{stage} {number}")
        code, seen = run_until(place.command(model, "--memory", "128MiB"), stage, number)
        name = f"{signal.Signals(number).name} while {stage}"
        check(seen and code == -number, f"{name}: ends by the signal ({code})")
        check(not os.listdir(place.temp_dir),
              f"{name}: leaves nothing in --temp-dir ({place.left()})")
        if number != signal.SIGKILL:
            check(not os.listdir(place.out_dir),
                  f"{name}: leaves nothing beside the output ({place.left()})")


def files_with_names(root, model):
    """Interrupt while a temporary file has a name.

    If the system cannot make files without names, a file has a name for a short time.
    """
    strange = {"LD_PRELOAD": FAULTS, "EBPO_TEST_NAMED": "1"}
    place = Place(root, "named")
    code, said, _, filed = run(place.command(model, "-q", "--memory", "128MiB"), place.temp_dir,
                               strange)
    check(code == 0 and filed and place.left() == ["x.ebpo.h5"],
          f"without O_TMPFILE: builds, and leaves nothing but the output ({said.strip()} "
          f"{place.left()})")
    place = Place(root, "named and interrupted")
    process = subprocess.Popen(place.command(model, "-q"),
                               env=dict(os.environ, EBPO_TEST_PAUSE="1", **strange),
                               preexec_fn=limits())
    while process.poll() is None and not os.listdir(place.temp_dir):
        time.sleep(0.01)
    seen = os.listdir(place.temp_dir)
    process.send_signal(signal.SIGTERM)
    process.wait(timeout=60)
    check(seen and process.returncode == -signal.SIGTERM and not place.left(),
          f"without O_TMPFILE: a file with a name is removed when interrupted ({seen}, then "
          f"{place.left()})")


def full_disk(root, model):
    """Limits the disk space at each power of two of the file size, until the command succeeds."""
    n = failed = 0
    while n < 1 << 16:
        place = Place(root, f"full {n}")
        n = 2 * n if n else 1
        code, said, _, _ = run(place.command(model, "-q", "--memory", "128MiB"), place.temp_dir,
                               {"LD_PRELOAD": FAULTS, "EBPO_TEST_FAULT": f"allocate:{n}+:28"})
        if code == 0:
            break
        failed += 1
        good = (code == 1 and place.temp_dir in said and "No space left on device" in said
                and "another folder" in said and said.count("\n") == 1)
        check(good, f"disk full at file {n}: {said.strip()} ({code})")
        check(not place.left(), f"disk full at file {n}: leaves nothing ({place.left()})")
    check(failed > 3, f"disk full: tested {failed} sizes")
    place = Place(root, "limit")
    code, said, _, _ = run(place.command(model, "-q", "--memory", "128MiB"), place.temp_dir,
                           file_bytes=256 << 10)
    check(code == 1 and place.temp_dir in said and "File too large" in said and not place.left(),
          f"limit on the size of files: {said.strip()} ({code}, {place.left()})")


def really_full(root, model):
    """Use a file system of 20 MB, if the system permits mounting it."""
    place = Place(root, "really full")
    mount = ('mount -t tmpfs -o size=20M none "$1" 2>/dev/null || exit 77; temp=$1; shift; "$@"; '
             'code=$?; ls -A "$temp"; exit $code')
    for unshare in (["unshare", "-m"], ["unshare", "-r", "-m"]):
        if shutil.which("unshare"):
            code, said, _, _ = run([*unshare, "sh", "-c", mount, "sh", place.temp_dir,
                                    *place.command(model, "-q", "--memory",
                                                   "128MiB")], place.temp_dir)
            if code == 1 and "ebpo convert" in said or code not in (1, 77):
                check(code == 1 and place.temp_dir in said and "No space left on device" in said
                      and said.count("\n") == 1 and not place.left(),
                      f"a file system of 20 MB: {said.strip()} ({code}, {place.left()})")
                return
    print("skipped a file system of 20 MB: root or a user namespace is needed to mount it")


def generate(model, faces):
    subprocess.run([GENERATE, "--base", "torus", "--faces", str(faces), model], check=True,
                   stdout=subprocess.DEVNULL)


def main():
    with tempfile.TemporaryDirectory(dir=os.environ.get("TMPDIR", "/var/tmp")) as root:
        model = os.path.join(root, "model.ply")
        generate(model, FACES)
        same_bytes_and_bounded_memory(root, model)
        generate(model, FEWER_FACES)
        if not FEW:
            same_bytes_as_default(root, model)
            unlike_scans(root)
        one_cell(root, model)
        interrupted(root, model)
        files_with_names(root, model)
        full_disk(root, model)
        really_full(root, model)
    print(f"{len(failures)} failed")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
