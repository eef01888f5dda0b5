#!/usr/bin/env python3
"""Checks that the stages of `ebpo convert --json`, read from standard input, add up. Then prints the rows with
the stages of the thesis.
"""
import json
import sys

NAMES = ["leaf creation", "corner labels", "leaf planes", "tree paths", "leaf clipping",
         "storing and propagating", "total"]
ROWS = ["reading", "repairing", "ordering", "checking", "cutting", "corners", "cells", "choosing",
        "top", "envelopes", "joining", "numbering", "writing", "selecting"]


def main():
    facts = json.load(sys.stdin)
    stages, thesis = facts["stages"], facts["thesis_stages"]
    assert stages and all(s["seconds"] >= 0 and s["stage"] for s in stages), stages
    assert len({s["stage"] for s in stages}) == len(stages), "a stage is reported twice"
    assert {s["name"] for s in stages} <= set(ROWS), [s["name"] for s in stages]
    assert sum(s["seconds"] for s in stages) <= facts["seconds"], "stages take longer than all"
    assert ([t["name"] for t in thesis] == NAMES
            and [t["number"] for t in thesis] == [1, 2, 3, 4, 5, 6, 7])
    rows = {}
    for s in stages:
        assert set(s["thesis"]) <= set(range(1, 7)), s
        rows.setdefault(s["name"], s["thesis"])
        assert rows[s["name"]] == s["thesis"], "stages of one row differ"
    for t in thesis[:6]:
        assert t["in"] == [r for r in ROWS if t["number"] in rows.get(r, [])], t
    assert thesis[6]["in"] == [r for r in ROWS if rows.get(r)], thesis[6]
    assert abs(thesis[6]["seconds"] - sum(s["seconds"] for s in stages if s["thesis"])) < 1e-9
    print(" ".join(f"{name}[{','.join(map(str, numbers))}]" for name, numbers in rows.items()))


main()
