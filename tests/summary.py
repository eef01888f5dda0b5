#!/usr/bin/env python3
"""Prints what a run of tests/run.sh consisted of: summary.py BUILD:BEGAN:ENDED...

For each build it prints the time that compiling and testing took; then the ten slowest tests, and the
tests that were skipped with the reason that they gave. BEGAN and ENDED are seconds since 1970; the rest
comes from Meson's log of each build.
"""
import json
import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent


def minutes(seconds):
    return f"{int(seconds) // 60}:{int(seconds) % 60:02}"


def tests_of(build):
    with open(ROOT / f"build-{build}/meson-logs/testlog.json", encoding="utf-8") as log:
        return [json.loads(line) for line in log]


def skips_of(test):
    """The reasons why a test, or parts of it, were skipped."""
    lines = ((test.get("stdout") or "") + (test.get("stderr") or "")).strip().splitlines()
    if test["result"] == "SKIP":
        return lines[-1:] or ["no reason given"]
    return [line for line in lines if line.startswith("skipped: ")]


def main():
    every, skipped, total = [], [], 0
    print("build      compile   test   tests")
    for part in sys.argv[1:]:
        build, began, ended = part.split(":")
        tests = tests_of(build)
        first = min((t["starttime"] for t in tests), default=int(ended))
        total += int(ended) - int(began)
        print(f"{build:10} {minutes(first - int(began)):>7} {minutes(int(ended) - first):>6} {len(tests):7}")
        every += [(t["duration"], build, t["name"]) for t in tests]
        skipped += [f"{build}: {t['name']}: {reason}" for t in tests for reason in skips_of(t)]
    print(f"all        {minutes(total):>14}\n\nthe ten slowest tests, in seconds")
    for seconds, build, name in sorted(every, reverse=True)[:10]:
        print(f"{seconds:6.0f} {build}: {name}")
    print(f"\nskipped: {len(skipped)}")
    for line in skipped:
        print("  " + line)


main()
