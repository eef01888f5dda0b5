"""Sums the stacks of `perf script -F tid,ip,sym,dso` from standard input. tests/bench/profile.sh runs it.

    profile_stacks.py BUILD_DIR CONVERT.json

A stage is the function that ebpo_parallel_for calls in threads. In code that runs on one thread only, a stage is the
library function that the command called, with the function that this one called.
"""
import bisect
import collections
import json
import os
import re
import subprocess
import sys

BUILD, CONVERTED = sys.argv[1:3]
FRAME = re.compile(r"\s+([0-9a-f]+) (.*) \((.*)\)$")
TOP, TOP_OF_STAGE = 40, 15
OUTSIDE = "outside of the library"


class Symbols:
    """Functions of this project's binaries: name and source file by address.

    Names alone are ambiguous: many files have a function called `work`.
    """
    def __init__(self, path):
        found = {}
        for line in subprocess.run(["nm", "-l", "--defined-only", path], check=True,
                                   capture_output=True, text=True).stdout.splitlines():
            symbol, _, place = line.partition("\t")
            address, kind, name = symbol.split(" ", 2)
            if kind in "tT":
                source = re.search(r"((?:lib|tools)/[^:]*):\d+$", place)
                found[int(address, 16)] = (re.sub(r"\.(?:constprop|isra|part|cold|lto_priv).*", "",
                                                  name), source[1] if source else os.path.basename(path))
        self.addresses, self.functions = sorted(found), found

    def at(self, address):
        i = bisect.bisect_right(self.addresses, address) - 1
        return self.functions[self.addresses[i]] if i >= 0 else None


def stacks():
    """Yield stacks as lists of (function, file), the innermost function first."""
    own = {name: Symbols(f"{BUILD}/{path}") for name, path in [("libebpo.so", "lib/libebpo.so"),
                                                               ("ebpo", "tools/ebpo")]}
    stack = []
    for line in sys.stdin:
        found = FRAME.match(line)
        if found:
            base = re.sub(r"\.so\..*", ".so", os.path.basename(found[3]))
            known = own[base].at(int(found[1], 16)) if base in own else None
            stack.append(known or (found[2], "[kernel]" if base.startswith("[kernel")
                                   else f"[{base}]"))
        elif stack:
            yield stack
            stack = []
    if stack:
        yield stack


def is_threads(frame):
    return frame[1] == "lib/core/parallel.c"


def stage_of(stack):
    """Return the stage of a stack, and the part of the stack that belongs to the stage."""
    for i in range(1, len(stack)):
        if is_threads(stack[i]) and not is_threads(stack[i - 1]):
            return f"{stack[i - 1][0]} ({stack[i - 1][1]}), threads", stack[:i]
    ours = [f for f in reversed(stack) if f[1].startswith("lib/")]
    if not ours:
        return OUTSIDE, []
    return " > ".join(f[0]
                      for f in ours[:2]) + f" ({ours[min(1, len(ours) - 1)][1]}), one thread", stack


def table(title, counter, total, names, most):
    print(f"\n## {title}\n\n| % | {' | '.join(names)} |\n|{'---|' * (1 + len(names))}")
    for key, count in counter.most_common(most):
        cells = key if isinstance(key, tuple) else (key,)
        print(f"| {100 * count / total:.1f} | {' | '.join(cells)} |")


def main():
    by_file, by_function, inclusive, stages = (collections.Counter() for _ in range(4))
    within = collections.defaultdict(collections.Counter)
    total = 0
    for stack in stacks():
        total += 1
        by_file[stack[0][1]] += 1
        by_function[stack[0]] += 1
        stage, part = stage_of(stack)
        stages[stage] += 1
        inclusive.update({f for f in stack if f[1].startswith("lib/")})
        within[stage].update({f for f in part if f[1].startswith("lib/")})
    if not total:
        sys.exit("profile_stacks.py: no samples")
    with open(CONVERTED) as f:
        facts = json.load(f)
    print(f"# Time of the build by function\n\n{facts['source']['name']}, {facts['faces']:,} "
          f"faces, {facts['seconds']:.1f} s; {total:,} samples of processor time, of all threads. "
          f"Values are percent of the samples.")
    table("By stage", stages, total, ["stage"], 20)
    for stage in [name for name, _ in stages.most_common(4) if name != OUTSIDE]:
        table(f"Within {stage}: inclusive", within[stage], total,
              ["function", "file"], TOP_OF_STAGE)
    table("By source file: exclusive", by_file, total, ["file"], TOP)
    table("By function: exclusive", by_function, total, ["function", "file"], TOP)
    table("By function: inclusive", inclusive, total, ["function", "file"], TOP)
    print("\n## Wall-clock seconds, from convert\n\n| s | stage |\n|---|---|")
    for s in sorted(facts["stages"], key=lambda s: -s["seconds"])[:12]:
        print(f"| {s['seconds']:.2f} | {s['stage']} |")


main()
