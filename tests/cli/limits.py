#!/usr/bin/env python3
"""limits.py TOOL INPUTS LITTLE FEATURES [CAIRO]: checks the limits of memory and threads of commands.

Each command keeps its limit of memory, given or not, or ends with an error and without output. A mesh that
is shortened while it is read is an error. LITTLE is a library that is preloaded to simulate little memory or
missing file locks. CAIRO is used instead of libcairo.
"""
import errno
import fcntl
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import time

sys.dont_write_bytecode = True
HERE = os.path.dirname(os.path.abspath(__file__))
TOOL, INPUTS, LITTLE = map(os.path.abspath, sys.argv[1:4])
FEATURES = sys.argv[4].split(",")
CAIRO = os.path.abspath(sys.argv[5]) if len(sys.argv) > 5 else ""
failures = []


def check(good, what):
    print(("ok      " if good else "FAILED  ") + what, flush=True)
    if not good:
        failures.append(what)


def small_stacks():
    """Sets small stacks. Stacks of threads are added to a limit; without this, the test would need a large model."""
    resource.setrlimit(resource.RLIMIT_STACK, (160 << 10, 160 << 10))


def run(*words, free=None, given="", before=None, **more):
    """Returns the exit code, both outputs and the peak of resident bytes. Further arguments are environment variables."""
    environment = dict(os.environ, LC_ALL="C.UTF-8", **more)
    if free is not None:
        environment.update(LD_PRELOAD=LITTLE, EBPO_TEST_FREE=str(free))
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as messages, \
            tempfile.TemporaryFile("w+") as stdin:
        stdin.write(given)
        stdin.seek(0)
        process = subprocess.Popen([TOOL, *words], stdin=stdin, stdout=out, stderr=messages,
                                   env=environment, preexec_fn=before)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        messages.seek(0)
        return process.returncode, out.read(), messages.read(), usage.ru_maxrss * 1024


def slurp(path):
    with open(path, "rb") as f:
        return f.read()


def write_ball(path, rows):
    """Writes a closed sphere with approximately 4 rows^2 faces."""
    columns, points, faces = 2 * rows, ["0 0 -1"], []
    for i in range(1, rows):
        for k in range(columns):
            a, b = math.pi * i / rows, 2 * math.pi * k / columns
            points.append(f"{math.sin(a) * math.cos(b)} {math.sin(a) * math.sin(b)} {-math.cos(a)}")
    points.append("0 0 1")
    top = len(points) - 1
    for k in range(columns):
        after = (k + 1) % columns
        faces.append((0, 1 + after, 1 + k))
        faces.append((top, top - columns + k, top - columns + after))
        for i in range(rows - 2):
            a, b = 1 + i * columns, 1 + (i + 1) * columns
            faces += [(a + k, a + after, b + after), (a + k, b + after, b + k)]
    with open(path, "w", encoding="ascii") as f:
        f.write(f"ply\nformat ascii 1.0\nelement vertex {len(points)}\nproperty double x\n"
                f"property double y\nproperty double z\nelement face {len(faces)}\n"
                "property list uchar int vertex_indices\nend_header\n")
        f.writelines(p + "\n" for p in points)
        f.writelines("3 %d %d %d\n" % face for face in faces)


# Commands that keep their limits, and their outputs.
HOLDING = [(["measure", "b.ebpo.h5"], None), (["export", "--mesh", "b.ebpo.h5", "o.glb"], "o.glb")]
if "png" in FEATURES:
    HOLDING.append((["render", "--size", "640x480", "b.ebpo.h5", "o.png"], "o.png"))


def holding_is_limited():
    for words, out in HOLDING:
        command = words[0]
        code, _, messages, _ = run(command, "--memory", "1K", *words[1:], before=small_stacks)
        check(code == 1 and "1.00 kB is what --memory allows" in messages,
              f"{command} --memory 1K is refused ({code}: {messages.strip()})")
        check(not out or not os.path.exists(out), f"{command} leaves no output")
        code, _, messages, _ = run(*words, free=1000, before=small_stacks)
        check(code == 1 and "1.00 kB was free at the start" in messages,
              f"{command} with 1000 bytes free is refused ({code}: {messages.strip()})")
        for limit in ([], ["--memory", "1G"], ["--memory", "0"]):
            code, _, messages, _ = run(command, *limit, *words[1:])
            check(code == 0, f"{command} {' '.join(limit)} works ({code}: {messages.strip()})")
        code, _, messages, _ = run(command, "--memory", "much", *words[1:])
        check(code == 2 and "--memory: 'much' is not a size" in messages, f"{command} --memory much")


def soft_limits_are_kept():
    """A soft limit below the free memory is kept; it is read after the first result."""
    soft = 512 << 20
    process = subprocess.Popen(
        [TOOL, "distance", "--threads", "1", "b.ebpo.h5"], text=True, stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=dict(os.environ, LD_PRELOAD=LITTLE, EBPO_TEST_FREE=str(4 << 30)),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_DATA, (soft, resource.RLIM_INFINITY)))
    process.stdin.write("0 0 0\n")
    process.stdin.flush()
    result = process.stdout.readline()
    limit = resource.prlimit(process.pid, resource.RLIMIT_DATA)[0]
    process.communicate()
    check(result and limit == soft, f"a limit of {soft} bytes is kept: {limit}, {result!r}")


def little_data():
    """The process must not raise a limit of the caller, although it could."""
    resource.setrlimit(resource.RLIMIT_DATA, (100 << 20, resource.RLIM_INFINITY))


def caller_limits_are_kept():
    """A limit of the process is never exceeded."""
    if "png" not in FEATURES:
        return
    large = ["render", "-q", "--size", "4000x4000", "b.ebpo.h5", "large.png"]
    for limit in ([], ["--memory", "1G"], ["--memory", "0"]):
        code, _, messages, _ = run(*large, *limit, before=little_data)
        check(code == 1 and "not enough memory" in messages,
              f"the limit of the caller is kept with {limit} ({code}: {messages.strip()})")
    check(not os.path.exists("large.png"), "no output remains")


# The operation for which libcairo runs out of memory: EBPO_TEST_CAIRO of CAIRO.
UNDRAWN = {"nothing": "", "drawing": "out of memory for a picture's captions",
           "surface": "out of memory for a picture's captions"}


def captions_are_never_omitted():
    """When requested captions cannot be drawn, the result is an error, and no picture is written."""
    words = ["render", "--size", "64x64", "--levels", "0,1", "b.ebpo.h5", "captions.png"]
    for lacks, reported in UNDRAWN.items() if CAIRO else ():
        code, _, messages, _ = run(*words, LD_LIBRARY_PATH=os.path.dirname(CAIRO), EBPO_TEST_CAIRO=lacks)
        check(code == (1 if reported else 0) and reported in messages, f"lacks {lacks}: {code}, {messages.strip()}")
        check(os.path.exists("captions.png") == (not reported), f"lacks {lacks}: no output")
        if not reported:
            os.remove("captions.png")
    os.mkdir("damaged")
    with open("damaged/libcairo.so.2", "w", encoding="ascii") as f:
        f.write("no library")
    if CAIRO:
        code, _, messages, _ = run(*words, LD_LIBRARY_PATH=os.path.abspath("damaged"))
        check(code == 1 and "libcairo, which draws captions, cannot be loaded" in messages,
              f"a damaged libcairo: {code}, {messages.strip()}")
        check(not os.path.exists("captions.png"), "a damaged libcairo: no output")


def models_are_held_in_parts():
    """Results are the same with the partly loaded model. When the least memory is more than half of the free memory, this is reported."""
    plan = json.loads(run("info", "--json", "--memory", "0", "b.ebpo.h5")[1])["memory"]
    whole, least = plan["whole"], plan["least"]
    requested = {"map": ["map", "--grid", "9,9,9", "-o", "OUT.nrrd", "b.ebpo.h5"],
             "collide": ["collide", "--all", "--pose-b", "1 0 0 0 0.01 0 0", "b.ebpo.h5", "b.ebpo.h5"],
             "haptic": ["haptic", "--seconds", "0.1", "b.ebpo.h5"]}
    for command, words in requested.items():
        right = None
        for free, noted in ((1 << 40, False), (whole + least, False), (least + least // 2, True)):
            out = f"{command}{free}.nrrd"
            code, reported, messages, _ = run(*(out if w == "OUT.nrrd" else w for w in words), free=free)
            check(code == 0, f"{command} with {free} bytes free works ({messages.strip()})")
            check(("note: needs at least" in messages) == noted,
                  f"{command} with {free} bytes free: the needed memory is reported ({messages.strip()})")
            result = slurp(out) if command == "map" else sorted(reported.splitlines())
            right = right or result
            check(command == "haptic" or result == right, f"{command} has the same results in parts")


def verify_keeps_its_budget():
    """Verifies eight million faces in one leaf, which once took 173 MB."""
    run("convert", "-q", "quads.ply", "one.ebpo.h5")
    subprocess.run([sys.executable, os.path.join(HERE, "bomb.py"), "one.ebpo.h5", "bomb.ebpo.h5",
                    "8000000"], check=True, stdout=subprocess.DEVNULL)
    code, _, messages, peak = run("verify", "--memory", "128M", "--max-expansion", "1000",
                              "bomb.ebpo.h5")
    check(code == 1 and "content" in messages, f"verify of many faces in one leaf ({messages.strip()})")
    check(peak <= 128e6, f"uses at most 128 MB: {peak / 1e6:.0f} MB")


def shortened_while_read():
    """Shortening a file at any time is an error that names the reason, or is too late to matter."""
    whole = slurp("b.ply")
    for i in range(6):
        with open("s.ply", "wb") as f:
            f.write(whole)
        process = subprocess.Popen([TOOL, "check", "-q", "s.ply"], stderr=subprocess.PIPE)
        time.sleep(0.006 * i)
        os.truncate("s.ply", 2000)
        messages = process.communicate()[1].decode()
        reported = "while it was read" in messages or "cut short" in messages or "the file ends" in messages
        check(process.returncode == 0 or (process.returncode == 1 and reported),
              f"check of a mesh that is shortened ({process.returncode}: {messages.strip()})")


PIPES = ["scene info pipe", "scene boxes names.json", "verify --against pipe b.ebpo.h5",
         "recover --source pipe -o x.ebpo.h5 b.ebpo.h5", "map --from pipe -o x.ply b.ebpo.h5",
         "map --plane z=0 -o x.nrrd pipe", "haptic pipe", "render pipe x.png", "report -o x pipe",
         "collide b.ebpo.h5 pipe", "collide pipe b.ebpo.h5", "boolean A|B b.ebpo.h5 pipe",
         "recover -o x.ebpo.h5 pipe", "bench pipe", "fetch pipe x.ebpo.h5", "distance pipe",
         "ray pipe", "box pipe", "scene info /dev/zero", "check /dev/zero", "haptic /dev/zero"]


def pipes_are_refused():
    """Refuses a pipe immediately, for every file argument. Nobody writes to this pipe."""
    os.mkfifo("pipe")
    with open("names.json", "w", encoding="ascii") as f:
        f.write('{"ebpo_scene": "1.0", "models": {"m": {"file": "pipe"}}, '
                '"instances": [{"name": "a", "model": "m"}]}')
    for words in PIPES:
        if words.startswith("render") and "png" not in FEATURES:
            continue
        if words.startswith(("scene", "map", "haptic", "collide", "boolean")) and "extras" not in FEATURES:
            continue
        try:
            done = subprocess.run([TOOL, *words.split()], stdin=subprocess.DEVNULL, text=True,
                                  capture_output=True, timeout=60, check=False)
        except subprocess.TimeoutExpired:
            check(False, f"{words} waits")
            continue
        reported = "is a pipe or device" in done.stderr or "not a regular file" in done.stderr
        check(done.returncode == 1 and reported, f"{words}: {done.returncode}, {done.stderr.strip()}")


def hdf5_without_locks():
    """Reading needs no lock. A lock held by another program is named."""
    subprocess.run([sys.executable, "-c", "import h5py; f = h5py.File('rows.h5', 'w'); f['p'] = [[.5, .5, .5]]; "
                    "f['of/rays'] = [[5, .5, .5, -1, 0, 0]]"], check=True)
    for number in (errno.EROFS, errno.ENOLCK, errno.EOPNOTSUPP, 524, errno.ENOSYS):
        for words in (("inside", "cube.ebpo.h5", "rows.h5:/p"), ("ray", "cube.ebpo.h5", "rows.h5:/of/rays")):
            code, out, messages, _ = run(*words, LD_PRELOAD=LITTLE, EBPO_TEST_LOCK=str(number))
            check(code == 0 and out and not messages, f"{words[0]} where locks fail with {number}: {messages}")
        code, _, messages, _ = run("inside", "cube.ebpo.h5", "rows.h5", LD_PRELOAD=LITTLE, EBPO_TEST_LOCK=str(number))
        check(code == 1 and "rows.h5:/p" in messages, f"datasets are named where locks fail with {number}: {messages}")
    with open("rows.h5", "rb") as writer:
        fcntl.flock(writer, fcntl.LOCK_EX)
        code, out, messages, _ = run("inside", "cube.ebpo.h5", "rows.h5:/p")
        check(code == 1 and not out and "rows.h5: is open for writing in another program" in messages, f"locked: {messages}")


def changed_while_open():
    """A replaced .ebpo.h5 file is still read as the old file; a shortened one is an error."""
    for how in "replaced", "shortened":
        run("repack", "-q", "--subtree-faces", "64", "b.ebpo.h5", "open.ebpo.h5")
        process = subprocess.Popen([TOOL, "inside", "--cut-level", "2", "open.ebpo.h5"],
                                   stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        process.stdin.write("0 0 0\n")
        process.stdin.flush()
        first = process.stdout.readline()
        if how == "replaced":
            run("repack", "-q", "cube.ebpo.h5", "new.ebpo.h5")
            os.replace("new.ebpo.h5", "open.ebpo.h5")
        else:
            os.truncate("open.ebpo.h5", 9000)
        rest, messages = process.communicate("".join(f"{s * 0.6} {t * 0.6} 0.52\n" for s in (-1, 1)
                                                 for t in (-1, 1)))
        check(first.startswith("IN"), f"{how}: the first result ({first.strip()}{messages})")
        if how == "replaced":
            check(process.returncode == 0 and rest.count("IN") == 4, f"replaced: {rest} {messages}")
        else:
            check(process.returncode == 1 and "became shorter" in messages, f"shortened: {rest} {messages}")


def main():
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        subprocess.run([INPUTS, "."], check=True)
        write_ball("b.ply", 100)
        run("convert", "-q", "b.ply", "b.ebpo.h5")
        run("convert", "-q", "quads.ply", "cube.ebpo.h5")
        holding_is_limited()
        soft_limits_are_kept()
        caller_limits_are_kept()
        captions_are_never_omitted()
        if "extras" in FEATURES:
            models_are_held_in_parts()
        if "h5py" in FEATURES:
            verify_keeps_its_budget()
            hdf5_without_locks()
        shortened_while_read()
        pipes_are_refused()
        changed_while_open()
        os.chdir("/")
    print(f"{len(failures)} failed")
    return 1 if failures else 0


sys.exit(main())
