"""Runs many queries on all cores: blocks of rows, one context for each thread."""
from __future__ import annotations

import ctypes
import itertools
import os
import threading
from typing import Any, Callable, Iterator

import numpy as np

from ._checked import doubles, integer_as
from .signatures import Bar, NanPolicy, Progress

# Rows of a block. Results of a block stay in the core's cache until they are stored. A block is
# long enough to make the cost of Python's global lock, which is taken after each block, negligible.
BLOCK = 1 << 15
SMALLEST = 64  # rows of the smallest block that is worth a thread
thread_count = integer_as(ctypes.c_uint)


CODES = "codes of the .ebpo.h5 format; Model.mesh() gives the vertices"


def holds_codes(values: Any) -> bool:
    """Return True for an array of an .ebpo.h5 file with a coding.

    Files of other formats may also have an attribute `coding`.
    """
    if "coding" not in getattr(values, "attrs", ()):
        return False
    root = getattr(getattr(values, "file", None), "attrs", None)  # the file of a dataset of h5py
    if root is None:
        return True
    name = root.get("format", "")
    return (name.decode("utf-8", "replace") if isinstance(name, bytes) else str(name)).startswith("EBP-Octree")


def cores() -> int:
    """Return the number of processors that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


class Rows:
    """Points, or other rows of three columns, as contiguous doubles block by block.

    Contiguous doubles are not copied. The input needs a shape and slices.

    shape: the shape of the input without its last axis.
    valid: the rows that contain no NaN; None: all. Only these rows are counted and accessible.
    """

    def __init__(self, values: Any, what: str = "points", nan: NanPolicy = "raise") -> None:
        if not hasattr(values, "shape") or not hasattr(values, "dtype"):
            values = np.asarray(values)
        shape = tuple(values.shape)
        if shape == (0,):
            values = np.zeros((0, 3))
        elif not shape or shape[-1] != 3:
            raise ValueError(f"{what} have the shape (..., 3), such as (n, 3), or (3,) for a single one, not {shape}")
        if nan not in ("raise", "propagate"):
            raise ValueError(f"nan is 'raise' or 'propagate', not {nan!r}")
        self.shape, self.single = tuple(values.shape)[:-1], shape == (3,)
        if np.dtype(values.dtype).kind not in "fiuO":
            raise TypeError(f"{what}: expected real numbers, got {values.dtype}")
        if holds_codes(values):
            raise TypeError(f"{what}: expected real numbers, got {CODES}")
        if len(self.shape) != 1:
            values = np.asanyarray(values).reshape(-1, 3)
        self.values, self.what, self.count = values, what, int(values.shape[0])
        self.valid: Any = None
        if nan == "propagate":
            begins = range(0, self.count, BLOCK)
            missing = [np.isnan(self[begin:min(self.count, begin + BLOCK)]).any(axis=1) for begin in begins]
            if any(some.any() for some in missing):
                self.select(~np.concatenate(missing))

    def select(self, valid: np.ndarray) -> None:
        """Restrict the rows to those where `valid` is True."""
        self.values = np.asanyarray(self.values)[valid]
        self.count, self.valid = len(self.values), valid

    def result(self, values: np.ndarray, missing: Any) -> Any:
        """Return results of the rows in the shape of the input. Rows that contain NaN have the result `missing`."""
        return shaped(values, self.shape, self.valid, missing)

    def __getitem__(self, part: slice) -> np.ndarray:
        return doubles(self.values[part], self.what)

    def check(self, begin: int, end: int) -> None:
        """Raise ArgumentError for the first row that is not finite, with its number among all rows.

        The library numbers the points of one block only.
        """
        bad = ~np.isfinite(self[begin:end]).all(axis=1)
        if bad.any():
            number = begin + int(bad.argmax())
            number = number if self.valid is None else int(np.flatnonzero(self.valid)[number])
            from .errors import ArgumentError
            raise ArgumentError(f"{self.what}: number {number} has a coordinate that is not a finite number",
                                "EBPO_E_ARGUMENT")


def shaped(values: np.ndarray, shape: tuple[int, ...], valid: np.ndarray | None, missing: Any) -> Any:
    """Return one result for each item of `shape`. A single result is a scalar, unless it has columns."""
    if valid is not None:
        every = np.full((len(valid), *values.shape[1:]), np.array(missing, values.dtype))
        every[valid] = values
        values = every
    return values[0] if shape == () else values.reshape(*shape, *values.shape[1:])


class StageProgress:
    """Progress over all threads. The thread that started the queries reports it."""

    def __init__(self, progress: Progress | None, stage: str, total: int) -> None:
        self.progress, self.stage, self.total = reporter(progress), stage, total

    def __call__(self, done: int) -> None:
        if self.progress is not None and self.progress(self.stage, done, self.total) is False:
            from .errors import Cancelled
            raise Cancelled(f"{self.stage} was stopped by the progress callback", "EBPO_E_CANCELLED")


def block_of(count: int, threads: int) -> int:
    """Return the block size: a few blocks for each thread, none larger than BLOCK."""
    return max(SMALLEST, min(BLOCK, -(-count // (8 * threads))))


def share(count: int, threads: int | None, worker: Callable[[], Any], progress: Progress | None = None,
          stage: str = "queries") -> None:
    """Process rows 0 to count - 1 block by block.

    worker() returns a function work(begin, end). Each thread has its own function; the calling thread is one of
    the threads. When several blocks fail, the exception of the first failed block is raised.
    """
    threads = thread_count(threads or (cores() if count > SMALLEST else 1), "threads")
    size = block_of(count, threads)
    report_total = StageProgress(progress, stage, count)
    if count <= size:
        if count:
            report_total(0)
            worker()(0, count)
            report_total(count)
        return
    blocks = -(-count // size)
    numbers: Iterator[int] = itertools.count()
    lock, finished = threading.Lock(), [0]
    failed: dict[int, Any] = {}

    def run(report: Callable[[int], None] | None) -> None:
        number = -1
        try:
            work = worker()
            while not failed:
                with lock:
                    number = next(numbers)
                if number >= blocks:
                    return
                begin = number * size
                end = min(count, begin + size)
                work(begin, end)
                with lock:
                    finished[0] += end - begin
                if report:
                    report(finished[0])
        except BaseException as error:
            failed[number] = error

    others = [threading.Thread(target=run, args=(None,), daemon=True) for _ in range(min(threads, blocks) - 1)]
    report_total(0)
    for thread in others:
        thread.start()
    run(report_total if progress else None)
    try:
        for thread in others:
            thread.join()
    except BaseException:  # the other threads stop after their current block
        failed[-1] = None
        raise
    if failed:
        raise failed[min(failed)]
    report_total(count)


def reporter(progress: Progress | None) -> Callable[[str, int, int], object] | None:
    """Return the progress callback of a callback or of a class of bars."""
    return bar(progress) if isinstance(progress, type) else progress


def bar(make: Callable[..., Bar]) -> Callable[[str, int, int], bool]:
    """Return a progress callback for bars like those of tqdm. `progress=tqdm.tqdm` does this by itself.

    make(total=, desc=) gives a bar with update(n) and close(); each stage has its own. For options of the bar:
    `progress=ebpo.bar(functools.partial(tqdm.tqdm, leave=False))`.

    >>> class Line:
    ...     def __init__(self, total, desc): print(desc, total)
    ...     def update(self, n): print("+", n)
    ...     def close(self): print("done")
    >>> report = bar(Line)
    >>> for done in (0, 3, 4):
    ...     _ = report("inside", done, 4)
    inside 4
    + 3
    + 1
    done
    """
    now: dict[str, Any] = {}

    def close() -> None:
        if now:
            now.pop("bar").close()
            now.clear()

    def report(stage: str, done: int, total: int) -> bool:
        if now and now["stage"] != stage:
            close()
        if not now:
            if total and done >= total:
                return True  # a later report after the bar is closed
            now.update(stage=stage, done=0, bar=make(total=total or None, desc=stage))
        if done > now["done"]:
            now["bar"].update(done - now["done"])
            now["done"] = done
        if total and done >= total:
            close()
        return True

    return report
