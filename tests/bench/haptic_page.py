"""Measures haptic steps on a large model and prints docs/measured/haptic.md:

    haptic_page.py EBPO MODEL.ebpo.h5 [SECONDS] >docs/measured/haptic.md

The first row takes SECONDS, each other row a tenth of that. The user needs the right to SCHED_FIFO
(ulimit -r, or root) and to lock memory. The last two sections of the page are written by hand.
"""
import contextlib
import io
import json
import math
import os
import subprocess
import sys
import tempfile

from query_page import reflow


def load():
    return open("/proc/loadavg", encoding="ascii").read().split()[0]


def steal():
    """Return the clock ticks that the host gave to other machines, and all clock ticks."""
    numbers = [int(n) for n in open("/proc/stat", encoding="ascii").readline().split()[1:]]
    return numbers[7], sum(numbers)


def tool_of(path, radius):
    """Write 10,000 points on a sphere, as a tool."""
    with open(path, "w", encoding="ascii") as out:
        for i in range(10000):
            z, a = 1 - (2 * i + 1) / 10000, 2.399963229728653 * i
            r = math.sqrt(1 - z * z)
            print(radius * r * math.cos(a), radius * r * math.sin(a), radius * z, file=out)


def us(x):
    return f"{1e6 * x:.3g}" if 1e6 * x < 1000 else f"{1e6 * x:.0f}"


def play(ebpo, model, words):
    before, begun = load(), steal()
    got = json.loads(subprocess.run([ebpo, "haptic", "--json", *words, model], check=True, text=True,
                                    stdout=subprocess.PIPE).stdout)
    ended = steal()
    got["load"] = f"{before} to {load()}"
    got["steal"] = 100 * (ended[0] - begun[0]) / max(1, ended[1] - begun[1])
    return got


def sums_beside(folder, seconds):
    """Start a loop with the same arithmetic in each step, without the library.

    Its times show the delays of the machine.
    """
    program = folder + "/machine_delays"
    subprocess.run(["cc", "-O2", os.path.join(os.path.dirname(os.path.abspath(__file__)), "machine_delays.c"),
                    "-o", program, "-lm"], check=True)
    return program, subprocess.Popen([program, str(int(seconds))], text=True, stdout=subprocess.PIPE)


def main(ebpo, model, seconds="600"):
    info = json.loads(subprocess.run([ebpo, "info", "--json", model], check=True, text=True,
                                     stdout=subprocess.PIPE).stdout)
    least = min(info["box_size"]) if "box_size" in info else None
    long, short = float(seconds), str(float(seconds) / 10)
    folder = tempfile.mkdtemp()
    tool = folder + "/ball-10000.txt"
    tool_of(tool, 0.04 * (least or 500))
    runs = [
        ("ball", ["--memory", "256M", "--seconds", str(long)]),
        ("ball", ["--memory", "256M", "--rate", "5000", "--seconds", short]),
        ("probe", ["--memory", "256M", "--probe", "--seconds", short]),
        ("tool of 10,000 points", ["--memory", "256M", "--tool", tool, "--faces", "262144", "--seconds", short]),
    ]
    program, beside = sums_beside(folder, long)
    rows = [(*runs[0], play(ebpo, model, runs[0][1]))]
    sums = beside.communicate()[0].strip()
    rows += [(name, words, play(ebpo, model, words)) for name, words in runs[1:]]
    first, fast = rows[0][2]["haptic"], rows[1][2]["haptic"]
    met = {True: "met", False: "missed"}
    goals = [(first["over_ms"] == 0, f"no step of the ball over 1 ms at 1 kHz in {seconds} s",
              f"{first['over_ms']} of {first['steps']:,}"),
             (fast["p99_9"] < 200e-6, "p99.9 of the ball below 200 us at 5 kHz", f"{us(fast['p99_9'])} us")]
    print(f"""# Haptic steps

- With {info["faces"]:,} faces and a budget of 256 MiB, a step of the ball at 1 kHz takes {us(first["p50"])} us (median) and
  {us(first["p99_9"])} us (p99.9).
- A loop of the same arithmetic without the library shows the delays of the machine (`tests/bench/machine_delays.c`):
  {sums}

## Goals

| goal | measured | |
|---|---|---|""")
    for good, goal, value in sorted(goals):
        print(f"| {goal} | {value} | {met[good]} |")
    print(f"""
## Measurement

Made by `python3 tests/bench/haptic_page.py EBPO {os.path.basename(model)} {seconds}` on {os.cpu_count()} cores. Each row is one run of
`ebpo haptic --json`: the device circles the model in 8 seconds, into the surface and out. The haptic thread has
{rows[0][2]["scheduling"]}; the loading thread has the default priority. *stolen*: CPU
time that the host gave to other machines.

Times of a step are in us. They are wall-clock times unless named CPU.

| case | options | steps | over 1 ms | p50 | p99.9 | p99.99 | max | CPU p99.9 | stolen % |
|---|---|---|---|---|---|---|---|---|---|""")
    for name, words, r in rows:
        t = r["haptic"]
        shown = " ".join(os.path.basename(w) for w in words)
        print(f"| {name} | `{shown}` | {t['steps']:,} | {t['over_ms']} | {us(t['p50'])} | "
              f"{us(t['p99_9'])} | {us(t['p99_99'])} | {us(t['max'])} | {us(t['cpu_p99_9'])} | "
              f"{r['steal']:.1f} |")
    print("""
*late*: steps that end more than a period after they are due, for any cause. *wake*: delay of the start of a step,
which the machine causes; *idle wake*: the same for an empty loop. *waits*: steps in which the proxy waits at the
boundary of the loaded box (probe: only bounds of the distance are known). *short*: steps with more near faces than
one step handles; the next step continues.

| case | late | wake p99.9 | max | idle wake p99.9 | in contact | waits | short | longest load, s |
|---|---|---|---|---|---|---|---|---|""")
    for name, words, r in rows:
        t, n = r["haptic"], r["empty"]
        print(f"| {name}, {r['rate']:g} Hz | {t['missed']} | {us(t['wake_p99_9'])} | {us(t['wake_max'])} | "
              f"{us(n['wake_p99_9'])} | {r['contacts']:,} | {r['waiting']:,} | "
              f"{r['path_unfinished']:,} | {r['load_seconds_max']:.2f} |")
    probe = rows[2][2]
    print(f"""
The bounds of the probe differ by {probe["between_mean"]:.3g} on average and {probe["between_max"]:.3g} at most, in a root cell of
{" x ".join(f"{s:.4g}" for s in info.get("box_size", []))}.""")
    os.remove(program)
    os.remove(tool)
    os.rmdir(folder)


with contextlib.redirect_stdout(io.StringIO()) as output:
    main(*sys.argv[1:])
print(reflow(output.getvalue()), end="")
