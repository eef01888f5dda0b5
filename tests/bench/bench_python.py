#!/usr/bin/env python3
"""Measures the overhead of Python: bench_python.py MODEL.ebpo.h5

    PYTHONPATH=build/tools/python tests/bench/bench_python.py bunny.ebpo.h5 [--points 1000000] [--threads N]
                                                               [--rounds 9]

Measures Model.inside, and ebpo_inside_many for the same points on as many threads. Each of these threads has a
context and a share of the points, and writes to an existing array. The two run in turns in one process; the ratio is
the median of the rounds. peers.py compares other packages.
"""
import argparse
import statistics
import threading
import time
import timeit

import numpy as np

import ebpo
from ebpo import _declared as c
from ebpo._library import Handle, call
from ebpo.queries import cores


def seconds(function, *arguments):
    began = time.perf_counter()
    result = function(*arguments)
    return time.perf_counter() - began, result


class Plain:
    """ebpo_inside_many on threads, as in a C program."""

    def __init__(self, model, points, threads):
        self.points, self.out = points, np.zeros(len(points), np.dtype(c.ebpo_inside_result))
        self.contexts = [Handle.made("ebpo_context_new", model.model, free="ebpo_context_free", keep=(model.model,))
                         for _ in range(threads)]

    def part(self, i):
        begin, end = (len(self.points) * k // len(self.contexts) for k in (i, i + 1))
        call("ebpo_inside_many", self.contexts[i], self.points[begin:].ctypes.data, end - begin,
             None, self.out[begin:].ctypes.data)

    def __call__(self):
        others = [threading.Thread(target=self.part, args=(i,)) for i in range(1, len(self.contexts))]
        for thread in others:
            thread.start()
        self.part(0)
        for thread in others:
            thread.join()
        return self.out["where"]


def cost(model, points, threads, rounds):
    plain, ratios = Plain(model, points, threads), []
    for number in range(rounds + 1):
        order = [("c", plain), ("python", lambda: model.inside(points, threads=threads))]
        times = {}
        for name, function in order[::1 if number % 2 else -1]:
            times[name], result = seconds(function)
        if number:  # the first round only warms up
            ratios.append(times["python"] / times["c"])
    assert np.array_equal(model.inside(points), plain.out["where"] != c.EBPO_OUT)
    print(f"Model.inside / ebpo_inside_many, {len(points)} points, {threads} threads: {statistics.median(ratios):.2f} "
          f"({min(ratios):.2f} to {max(ratios):.2f}, {rounds} rounds)")
    each = min(timeit.repeat(lambda: model.inside(points[0]), number=1000, repeat=5)) / 1000
    print(f"Model.inside, one point a call: {each * 1e6:.0f} microseconds")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model")
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--threads", type=int, default=cores())
    parser.add_argument("--rounds", type=int, default=9)
    options = parser.parse_args()
    model = ebpo.open(options.model)
    random = np.random.default_rng(1)
    vertices = model.mesh().vertices
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    points = random.uniform(low, high, (options.points, 3))
    cost(model, points, options.threads, options.rounds)


if __name__ == "__main__":
    main()
