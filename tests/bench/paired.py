#!/usr/bin/env python3
"""Compares two builds: their times, their files and their results.

    tests/bench/paired.py BEFORE AFTER MODELS... [--rounds 7] [--json FILE]
    tests/bench/paired.py BEFORE AFTER MODELS... --same

BEFORE and AFTER are `ebpo` programs; MODELS are meshes or folders of meshes. A round runs each command in the order
before, after, after, before, so that other load of the machine affects both builds. A round gives one ratio
after/before. The table has the median ratio for each model, and the geometric mean for each command. Times are
processor times (user and system) of the command, with --wall wall-clock times.

--same measures no times. It converts each model with both builds and compares the files byte by byte, and the results
of `inside`, `distance` and `ray` for the same points.

Exit code 1: a difference, or with --limit R a geometric mean above R.
"""
import argparse
import filecmp
import json
import math
import os
import pathlib
import random
import statistics
import subprocess
import sys
import tempfile
import time

COMMANDS = ("convert", "verify", "inside", "distance")
SUFFIXES = (".ply", ".obj", ".stl", ".off")
CONVERT_EXIT_CODES = (0, 1)  # with code 1, both must refuse the model


def models_of(arguments):
    for path in map(pathlib.Path, arguments):
        if path.is_dir():
            yield from sorted(p for p in path.iterdir() if p.suffix in SUFFIXES)
        else:
            yield path


def seconds(arguments, wall):
    """Run a command without output. Return its seconds."""
    with open(os.devnull, "r+b") as nowhere:
        began = time.perf_counter()
        child = subprocess.Popen(arguments, stdin=nowhere, stdout=nowhere, stderr=nowhere)
        _, status, used = os.wait4(child.pid, 0)
        ended = time.perf_counter()
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        raise RuntimeError(f"{' '.join(map(str, arguments))}: exit code {child.returncode}")
    return ended - began if wall else used.ru_utime + used.ru_stime


def facts_of(ebpo, file):
    done = subprocess.run([ebpo, "info", "--json", file], check=True, capture_output=True)
    return json.loads(done.stdout)


def write_queries(folder, facts, count):
    """Write points in and around the model, and rays between pairs of points. They are the same in each run."""
    dice, low, size = random.Random(1), facts["box_origin"], facts["box_size"]

    def point():
        return [o + s * (1.4 * dice.random() - 0.2) for o, s in zip(low, size)]

    def row(*points):
        return " ".join(repr(x) for p in points for x in p) + "\n"

    points, rays = folder / "points.txt", folder / "rays.txt"
    points.write_text("".join(row(point()) for _ in range(count)))
    with rays.open("w") as out:
        for _ in range(max(1, count // 10)):
            a, b = point(), point()
            out.write(row(a, [y - x for x, y in zip(a, b)]))
    return points, rays


def convert(ebpo, model, out):
    done = subprocess.run([ebpo, "convert", "-q", model, out], capture_output=True, check=False)
    return done.returncode, done.stderr


# --- comparison of files and results ---

def same(pair, model, folder, count):
    """Return the differences between the two builds for one model."""
    files = [folder / "before.ebpo.h5", folder / "after.ebpo.h5"]
    codes = [convert(e, model, f)[0] for e, f in zip(pair, files)]
    if codes[0] != codes[1] or codes[0] not in CONVERT_EXIT_CODES:
        return [f"exit codes of convert: {codes[0]} and {codes[1]}"]
    if codes[0] != 0:
        return []
    problems = [] if filecmp.cmp(*files, shallow=False) else ["the files differ"]
    points, rays = write_queries(folder, facts_of(pair[0], files[0]), count)
    for command, rows in (("inside", points), ("distance", points), ("ray", rays)):
        said = [subprocess.run([e, command, files[0], rows], capture_output=True, check=False)
                for e in pair]
        if said[0].returncode != said[1].returncode:
            problems.append(f"exit codes of {command}: {[s.returncode for s in said]}")
        elif said[0].stdout != said[1].stdout:
            problems.append(f"{command}: different results")
    return problems


def compare_all(options, models):
    wrong = 0
    for model in models:
        with tempfile.TemporaryDirectory() as folder:
            problems = same(options.pair, model, pathlib.Path(folder), options.count)
        print(f"{model.name}: {'; '.join(problems) or 'equal bytes and results'}", flush=True)
        wrong += len(problems)
    return 1 if wrong else 0


# --- times ---

def time_model(options, model, folder):
    """Return {command: [(before, after) of each round]} of one model."""
    file, out = folder / "model.ebpo.h5", folder / "out.ebpo.h5"
    code, said = convert(options.pair[0], model, file)
    if code != 0:
        print(f"{model.name}: omitted: {said.decode(errors='replace').strip()}", file=sys.stderr)
        return {}
    facts = facts_of(options.pair[0], file)
    points, _ = write_queries(folder, facts, options.count)
    arguments = {"convert": ["-q", model, out], "verify": [file], "inside": [file, points],
                 "distance": [file, points]}
    times = {}
    for command in options.commands:
        if command == "inside" and facts["kind"] != "solid":
            continue  # a surface has no interior
        rounds = []
        for turn in range(options.rounds + 1):
            taken = [[], []]
            for which in (0, 1, 1, 0):
                taken[which].append(seconds([options.pair[which], command, *arguments[command]],
                                            options.wall))
            if turn:  # the first turn only warms up
                rounds.append(tuple(map(sum, taken)))
        times[command] = rounds
    return times


def ratio(rounds):
    return statistics.median(after / before for before, after in rounds)


def spread(rounds):
    """Return the smallest and the largest ratio as a text."""
    ratios = [after / before for before, after in rounds]
    return f"{min(ratios):.2f} to {max(ratios):.2f}"


def show(times, commands):
    print("| model | command | before, s | after, s | after / before | of the rounds |\n"
          "|---|---|---|---|---|---|")
    for model, by_command in times.items():
        for command, rounds in by_command.items():
            before, after = (statistics.median(column) / 2 for column in zip(*rounds))
            print(f"| {model} | {command} | {before:.3f} | {after:.3f} | {ratio(rounds):.3f} | "
                  f"{spread(rounds)} |")
    means = {}
    for command in commands:
        logs = [math.log(ratio(t[command])) for t in times.values() if command in t]
        if logs:
            means[command] = math.exp(statistics.fmean(logs))
    print("\n| command | geometric mean of after / before | largest |\n|---|---|---|")
    for command, mean in means.items():
        largest = max(ratio(t[command]) for t in times.values() if command in t)
        print(f"| {command} | {mean:.3f} | {largest:.3f} |")
    return means


def time_all(options, models):
    times = {}
    for model in models:
        with tempfile.TemporaryDirectory() as folder:
            found = time_model(options, model, pathlib.Path(folder))
        if found:
            times[model.name] = found
    means = show(times, options.commands)
    if options.json:
        pathlib.Path(options.json).write_text(json.dumps({
            "before": options.pair[0], "after": options.pair[1], "rounds": options.rounds,
            "points": options.count, "clock": "wall" if options.wall else "processors",
            "seconds_of_two_runs": times, "geometric_means": means}, indent=1))
    return 1 if options.limit and any(m > options.limit for m in means.values()) else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("pair", nargs=2, metavar="EBPO")
    parser.add_argument("models", nargs="+")
    parser.add_argument("--same", action="store_true", help="compare bytes and results; measure no times")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--count", type=int, default=20000, help="number of query points")
    parser.add_argument("--commands", nargs="+", choices=COMMANDS, default=COMMANDS)
    parser.add_argument("--wall", action="store_true", help="measure wall-clock time")
    parser.add_argument("--limit", type=float, help="fail when a geometric mean is above this limit")
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    options.pair = [os.path.abspath(p) for p in options.pair]
    models = list(models_of(options.models))
    return compare_all(options, models) if options.same else time_all(options, models)


if __name__ == "__main__":
    sys.exit(main())
