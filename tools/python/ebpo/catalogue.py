"""Catalogues: any number of models that are queried as one, or parts of a model that is too large for a file."""
from __future__ import annotations

import ctypes
import functools
import os
import pathlib
import re
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Callable, Iterator, NamedTuple

import numpy as np

from . import _declared as c
from ._checked import path as path_bytes
from ._checked import real
from ._library import Handle, Reporter, call, lib, made
from ._declared import Where
from .queries import Rows, thread_count
from .errors import ArgumentError, Error
from .open_models import CLOSE_FILE, OPEN_FILE, opened_by, opener, process_models, raised_by

BLOCK = 1 << 22  # rows whose answers are in memory twice; the library puts so many in order together
LONG = 1 << 14  # rows that may take longer than one waits
RULES = ("nonzero", "evenodd", "positive")

NEAREST = np.dtype([("distance", "f8"), ("point", "f8", 3), ("normal", "f8", 3), ("face", "i8"), ("model", "i8")])
HIT = np.dtype([("t", "f8"), ("face", "i8"), ("side", "i4"), ("model", "i4")])
LOCATED = np.dtype([("where", "i1"), ("winding", "i4")])


class Entry(NamedTuple):
    """A model: `path` is asked for winding numbers. Of parts: `surface`, which distances and rays are asked
    of, has no caps; "": there are none, None: there is nothing else; `numbers`, a .npy, says which faces of
    the whole its faces are."""

    path: str
    content_sha256: str
    solid: bool
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    surface: str | None = ""
    surface_sha256: str = ""
    numbers: str = ""


class Catalogue:
    """Many models, asked as one. Made by `Catalogue.open` or `Catalogue.of`; pickles.

    A point is asked of the models whose boxes hold it. Winding numbers are summed up. A point is inside
    that is inside any model, or, of parts of one model, where the sum is inside by `rule`. Distances are
    those to the nearest model, of several the first; negative inside. Numbers of models are rows here.

    >>> two = Catalogue.of(["cube.ebpo.h5", "cube.ebpo.h5"])
    >>> two.winding([[.5, .5, .5], [2, 0, 0]])
    array([2, 0], dtype=int32)
    """

    def __init__(self, entries: list[Entry], *, parts: bool = False, rule: str = "nonzero", **options: Any) -> None:
        if not entries:
            raise ValueError("a catalogue has one model at least")
        if rule not in RULES:
            raise ValueError(f"rule is 'nonzero', 'evenodd' or 'positive', not {rule!r}")
        self.entries, self.parts, self.rule, self.options = list(entries), parts, rule, options

    # ---- files ----

    @classmethod
    def of(cls, paths: Any, *, parts: bool = False, rule: str = "nonzero", **options: Any) -> Catalogue:
        """Of paths and URLs, in this order; each is opened for its box and digest.

        options: of URLs, as `ebpo.open` takes them.
        """
        def entry(path: Any) -> Entry:
            name = os.fspath(path)
            name = name if "://" in name else os.path.join(os.getcwd(), name)
            file, entry, kept = opened_by(name, options), c.ebpo_catalogue_entry(), path_bytes(name)
            lib.ebpo_catalogue_entry_of(file, kept, ctypes.byref(entry))  # whose path is that
            return entry_of(entry)

        with ThreadPoolExecutor(8) as pool:
            return cls(list(pool.map(entry, paths)), parts=parts, rule=rule, **options)

    @classmethod
    def open(cls, path: Any, **options: Any) -> Catalogue:
        """Of what `ebpo catalogue` or `save` has written. FormatError, VersionError: it is not that; IOFailure."""
        name = path_bytes(pathlib.Path(path).absolute())
        read = Handle.made("ebpo_catalogue_open", name, None, free="ebpo_catalogue_free")
        facts = made(c.ebpo_catalogue_facts)
        lib.ebpo_catalogue_get_facts(read, ctypes.byref(facts))
        entries = [entry_of(c.ebpo_catalogue_entry.from_address(lib.ebpo_catalogue_get_entry(read, i)))
                   for i in range(facts.count)]
        return cls(entries, parts=facts.parts, rule=RULES[facts.rule], **options)

    def save(self, path: Any) -> None:
        """As a file that `open` reads, whole or not at all. Paths in its folder and below become relative."""
        call("ebpo_catalogue_save", self._made, path_bytes(pathlib.Path(path).absolute()))

    @functools.cached_property
    def _made(self) -> Handle:
        """The catalogue of the library."""
        structs = (c.ebpo_catalogue_entry * len(self))()
        for struct, entry in zip(structs, self.entries):
            fill_entry(struct, entry)
        options = made(c.ebpo_catalogue_options, open_file=OPEN_FILE, close_file=CLOSE_FILE, user=opener(self.options),
                       rule=RULES.index(self.rule), parts=self.parts)
        return Handle.made("ebpo_catalogue_new", ctypes.addressof(structs), len(self), ctypes.byref(options),
                           free="ebpo_catalogue_free")

    def __getstate__(self) -> dict:
        return {name: value for name, value in self.__dict__.items() if name != "_made"}

    def __dask_tokenize__(self) -> tuple:
        """What answers depend on: equal in every process."""
        return "ebpo-catalogue", repr(self.entries), self.parts, self.rule

    def __len__(self) -> int:
        return len(self.entries)

    def __repr__(self) -> str:
        return f"<ebpo.Catalogue of {len(self)} {'parts of a model' if self.parts else 'models'}>"

    # ---- asking ----

    def _query(self, function: str, count: int, rows: Callable, result: Any, memory: int | str | None,
               threads: int | None, **options: Any) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
        """Has the library answer rows(begin, end), block by block: where they are, answers, numbers of models."""
        models, limit = process_models(memory).models, min(count, BLOCK)
        results, numbers = np.empty(limit, result), np.empty(limit, np.uint64)
        threads = thread_count(threads or 0, "threads")
        for begin in range(0, max(1, count), BLOCK):
            end = min(count, begin + BLOCK)
            given = rows(begin, end)
            out = (results.ctypes.data, numbers.ctypes.data)[:1 if function == "ebpo_catalogue_inside" else 2]

            def work(progress: Any) -> None:
                how = made(c.ebpo_catalogue_query_options, progress=progress, threads=threads, **options)
                call(function, self._made, models, given.ctypes.data, end - begin, ctypes.byref(how), *out)

            try:
                interruptible(work, end - begin)
            except Error as error:
                raise numbered(raised_by(error), begin) from None
            yield slice(begin, end), results[:end - begin], numbers[:end - begin]

    def locate(self, points: Any, *, memory: int | str | None = None, threads: int | None = None) -> np.ndarray:
        """Where points are: a structured array (n,), `where` as of `Model.locate`, `winding` the sum.

        Of parts, exactly what the whole would say, also on caps. Of others, `where` is IN where any says so,
        else ON where any does; a model adds 0 to the sum at points on its faces.

        memory: bytes that models of this process may take, from now on; at first 1 GiB.

        Raises NotSolidError if a model is a surface.
        """
        rows = Rows(points)
        out = np.empty(rows.count, LOCATED)
        for where, results, _ in self._query("ebpo_catalogue_inside", rows.count, lambda a, b: rows[a:b],
                                             c.ebpo_inside_result, memory, threads):
            for name in LOCATED.names or ():
                out[name][where] = results[name]
        return out[0] if rows.single else out

    def inside(self, points: Any, *, boundary: bool = True, memory: int | str | None = None,
               threads: int | None = None) -> Any:
        """Whether points are inside: (n,) bool. boundary: points on faces are, too. Raises as `locate`."""
        where = self.locate(points, memory=memory, threads=threads)["where"]
        return where != Where.OUT if boundary else where == Where.IN

    def winding(self, points: Any, *, memory: int | str | None = None, threads: int | None = None) -> Any:
        """The sum of winding numbers: (n,) int32. Raises as `locate`."""
        return self.locate(points, memory=memory, threads=threads)["winding"].copy()

    def _need_surface(self) -> None:
        if all(entry.surface is None for entry in self.entries):
            raise ValueError("the catalogue has caps alone, and no surface")

    def distance(self, points: Any, *, max_distance: float = float("inf"), signed: bool = True,
                 memory: int | str | None = None, threads: int | None = None) -> np.ndarray:
        """The nearest face of any model: a structured array (n,), `["distance"]` and so on.

        Its fields are those of `Model.distance`, and `model`, the number here.

        Negative inside (`inside`; not of catalogues in which there is a surface). Of models at the same
        rounded distance the first is taken.
        """
        self._need_surface()
        rows = Rows(points)
        out = np.empty(rows.count, NEAREST)
        for where, results, models in self._query("ebpo_catalogue_distance", rows.count, lambda a, b: rows[a:b],
                                                  c.ebpo_distance_result, memory, threads,
                                                  max_distance=max_distance, unsigned_distance=not signed):
            for name in ("distance", "point", "normal"):
                out[name][where] = results[name]
            out["face"][where], out["model"][where] = results["face"].view(np.int64), models.view(np.int64)
        return out[0] if rows.single else out

    def ray(self, origins: Any, directions: Any, *, t_max: float = float("inf"), memory: int | str | None = None,
            threads: int | None = None) -> np.ndarray:
        """The first face that each ray meets: a structured array (n,), the fields of `Model.ray`, and `model`."""
        self._need_surface()
        o, d = Rows(origins, "origins"), Rows(directions, "directions")
        count = d.count if o.single else o.count
        if o.count != d.count and not (o.single or d.single):
            raise ValueError(f"{o.count} origins and {d.count} directions")
        limit = real(t_max, "t_max")

        def rays(begin: int, end: int) -> np.ndarray:
            rows = np.empty((end - begin, 7))
            rows[:, 0:3] = o[0:1] if o.single else o[begin:end]
            rows[:, 3:6] = d[0:1] if d.single else d[begin:end]
            rows[:, 6] = limit
            return rows

        out = np.empty(count, HIT)
        for where, results, models in self._query("ebpo_catalogue_ray", count, rays, c.ebpo_ray_hit, memory, threads):
            for name in ("t", "side"):
                out[name][where] = results[name]
            out["face"][where], out["model"][where] = results["face"].view(np.int64), models.view(np.int64)
        return out[0] if o.single and d.single else out


def interruptible(work: Callable[[Any], None], rows: int) -> None:
    """Calls work(progress). In the main thread, where an interrupt comes, another thread does what takes long."""
    if rows < LONG or threading.current_thread() is not threading.main_thread():
        work(c.ebpo_progress())
        return
    stopped, ended, once, failed = threading.Event(), threading.Event(), threading.Lock(), []

    def body() -> None:
        if not once.acquire(blocking=False):  # an interrupt of start() may have it called again
            return
        try:
            work(progress)
        except BaseException as error:
            failed.append(error)
        finally:
            ended.set()

    # Not Thread.join: once interrupted, it takes a running thread for one that has ended, and the library
    # would go on in memory that is freed.
    interrupt = None
    with Reporter(lambda *_: not stopped.is_set()) as progress:
        while not ended.is_set():
            try:
                if not once.locked():
                    thread = threading.Thread(target=body, daemon=True)
                    thread.start()
                ended.wait()
            except KeyboardInterrupt as error:
                stopped.set()
                interrupt = error
    if interrupt:
        raise interrupt
    if failed:
        raise failed[0]


def numbered(error: BaseException, first: int) -> BaseException:
    """Of a block of rows: its message then has the number of a point or ray among all of them."""
    if first and isinstance(error, ArgumentError):
        error.args = (re.sub(r"^(point|ray) (\d+)", lambda found: f"{found[1]} {int(found[2]) + first}", str(error)),)
    return error


def entry_of(entry: Any) -> Entry:
    """Of an ebpo_catalogue_entry."""
    surface, numbers = os.fsdecode(entry.surface or b""), os.fsdecode(entry.numbers or b"")
    return Entry(os.fsdecode(entry.path), bytes(entry.digest).hex(), entry.solid, tuple(entry.min), tuple(entry.max),
                 None if entry.unseen else surface, bytes(entry.surface_digest).hex() if surface else "", numbers)


def fill_entry(struct: Any, entry: Entry) -> None:
    """The reverse; the struct has its texts for itself."""
    struct.path, struct.digest = path_bytes(entry.path), bytes.fromhex(entry.content_sha256)
    struct.solid, struct.min, struct.max, struct.unseen = entry.solid, entry.low, entry.high, entry.surface is None
    if entry.surface:
        struct.surface, struct.surface_digest = path_bytes(entry.surface), bytes.fromhex(entry.surface_sha256)
    if entry.numbers:
        struct.numbers = path_bytes(entry.numbers)
