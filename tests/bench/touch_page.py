"""Plays hands on a large model and writes docs/measured/touch.md:

    touch_page.py EBPO MODEL.ebpo.h5 [SECONDS] >docs/measured/touch.md

SECONDS are those of the first row; the others take a tenth of it. As a user who may have SCHED_FIFO
(ulimit -r, or root) and lock memory. What else the machine does meanwhile is told by its load.
"""
import json
import math
import os
import subprocess
import sys
import tempfile


def load():
    return open("/proc/loadavg", encoding="ascii").read().split()[0]


def steal():
    """Ticks of the clock that went to other machines, and all."""
    numbers = [int(n) for n in open("/proc/stat", encoding="ascii").readline().split()[1:]]
    return numbers[7], sum(numbers)


def tool_of(path, radius):
    """10,000 points on a ball."""
    with open(path, "w", encoding="ascii") as out:
        for i in range(10000):
            z, a = 1 - (2 * i + 1) / 10000, 2.399963229728653 * i
            r = math.sqrt(1 - z * z)
            print(radius * r * math.cos(a), radius * r * math.sin(a), radius * z, file=out)


def us(x):
    return f"{1e6 * x:.3g}" if 1e6 * x < 1000 else f"{1e6 * x:.0f}"


def play(ebpo, model, words):
    before, begun = load(), steal()
    got = json.loads(subprocess.run([ebpo, "touch", "--json", *words, model], check=True, text=True,
                                    stdout=subprocess.PIPE).stdout)
    ended = steal()
    got["load"] = f"{before} to {load()}"
    got["steal"] = 100 * (ended[0] - begun[0]) / max(1, ended[1] - begun[1])
    return got


def sums_beside(folder, seconds):
    """A loop that does the same sums each tick, on whatever core is free: what the machine alone adds
    to as much work; a loop that does nothing is hardly ever met by that."""
    program = folder + "/tick_alone"
    subprocess.run(["cc", "-O2", os.path.join(os.path.dirname(os.path.abspath(__file__)), "tick_alone.c"),
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
        ("probe", ["--memory", "256M", "--sense", "--seconds", short]),
        ("tool of 10,000", ["--memory", "256M", "--tool", tool, "--faces", "262144", "--seconds", short]),
    ]
    program, beside = sums_beside(folder, long)
    rows = [(*runs[0], play(ebpo, model, runs[0][1]))]
    sums = beside.communicate()[0].strip()
    rows += [(name, words, play(ebpo, model, words)) for name, words in runs[1:]]
    print(f"""# How late a hand is

Made by `python3 tests/bench/touch_page.py EBPO {os.path.basename(model)} {seconds}` on {os.cpu_count()} cores.
The model has {info["faces"]:,} faces; 256 MiB are its budget, boxes of faces come beside. The hand is
that of `ebpo touch` itself: around the model in 8 seconds, and into the surface and out of it. Every
row is one run of `ebpo touch --json` with the options named. *Thread*: {rows[0][2]["scheduling"]};
the thread that loads runs as others do. *Load* is the machine's over a minute, before and after the
run, *stolen* what its host gave to other machines.

Times in us: from begin to end of a tick, and in processor time; *wake*: from when a tick was due until
it began, which is the machine's; *nothing* is the same of a loop that does nothing, played before, for
a tenth of the time.

| hand | options | ticks | over 1 ms | p50 | p99 | p99.9 | p99.99 | most | processor p99.9 | most | load | stolen % |
|---|---|---|---|---|---|---|---|---|---|---|---|---|""")
    for name, words, r in rows:
        t = r["touch"]
        shown = " ".join(os.path.basename(w) for w in words)
        print(f"| {name} | `{shown}` | {t['ticks']:,} | {t['over_ms']} | {us(t['p50'])} | {us(t['p99'])} | "
              f"{us(t['p99_9'])} | {us(t['p99_99'])} | {us(t['most'])} | {us(t['cpu_p99_9'])} | "
              f"{us(t['cpu_most'])} | {r['load']} | {r['steal']:.1f} |")
    print("""
| hand | late | wake p99.9 | most | of nothing: p99.9 | most | wake p99.9 | most | contact | waits | short """
          """| boxes | longest load, s | subtrees | model, MiB |
|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|""")
    for name, words, r in rows:
        t, n = r["touch"], r["nothing"]
        print(f"| {name}, {r['rate']:g} Hz | {t['late']} | {us(t['wake_p99_9'])} | {us(t['wake_most'])} | "
              f"{us(n['p99_9'])} | {us(n['most'])} | {us(n['wake_p99_9'])} | {us(n['wake_most'])} | "
              f"{r['contacts']:,} | {r['waits']:,} | {r['shorts']:,} | {r['loads']:,} | "
              f"{r['load_seconds_most']:.2f} | {r['subtrees_loaded']:,} | {r['model_bytes_most'] / 2**20:.0f} |")
    probe = rows[2][2]
    print(f"""
*Late*: not done when the next tick was due, whoever was the cause. *Waits*: the proxy stood at the
wall of what was loaded (of a probe: the distance was known by bounds alone); *short*: more was close
than a tick does, the next one went on. The probe's bounds were {probe["between_mean"]:.3g} apart on
average and {probe["between_most"]:.3g} at most, in the unit of the model, whose root cell is
{" x ".join(f"{s:.4g}" for s in info.get("box_size", []))}.

Beside the first row, the same sums in each tick at 1 kHz, and nothing of the library
(`tests/bench/tick_alone.c`, SCHED_FIFO): {sums}.""")
    os.remove(program)
    os.remove(tool)
    os.rmdir(folder)


main(*sys.argv[1:])
