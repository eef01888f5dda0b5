"""Catalogues: many models that are queried together, or the parts of a model that is too large for one file."""
from __future__ import annotations

import ctypes
import functools
import os
import pathlib
import re
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Callable, Iterable, Iterator, NamedTuple, Sequence

import numpy as np

from . import _declared as c
from ._checked import path as path_bytes
from ._library import Handle, Reporter, call, lib, made
from ._declared import Where
from .queries import Rows, thread_count
from .ray_queries import rays_of
from .signatures import ArrayLike, Bools, HttpOptions, Int32s, NanPolicy, RuleName, Size
from .signatures import Rows as Structured
from .errors import ArgumentError, Error
from .forks import renew_after_fork
from .open_models import CLOSE_FILE, OPEN_FILE, opened_by, opener, process_models, raised_by

BLOCK = 1 << 22  # rows of one library call, which sorts them; two copies of their results are in memory
LONG = 1 << 14  # calls of more rows run in a thread that an interrupt can stop
RULES: tuple[RuleName, ...] = ("nonzero", "evenodd", "positive")

NEAREST = np.dtype([("distance", "f8"), ("point", "f8", 3), ("normal", "f8", 3), ("face", "i8"), ("model", "i8")])
HIT = np.dtype([("t", "f8"), ("face", "i8"), ("side", "i4"), ("model", "i4")])
LOCATED = np.dtype([("where", "i1"), ("winding", "i4")])


class Entry(NamedTuple):
    """A model of a catalogue.

    path: the file for winding numbers.
    content_sha256: the content digest of `path`.
    solid: True for a solid, False for a surface.
    low, high: corners of the model's box.
    surface: for a part, the file without caps, for distances and rays. "": the part has no caps, `path`
        serves both. None: the part consists only of caps.
    surface_sha256: the content digest of `surface`.
    numbers: for a part, a .npy file with the index of each of its faces in the whole model.
    """

    path: str
    content_sha256: str
    solid: bool
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    surface: str | None = ""
    surface_sha256: str = ""
    numbers: str = ""


class Catalogue:
    """Many models that are queried together. Made by `Catalogue.open` or `Catalogue.of`. Can be pickled.

    A query of a point uses the models whose boxes contain the point. Winding numbers are summed.
    A point is inside if it is inside any model. For parts of one model, `rule` is applied to the sum.
    Distances are those to the nearest model, or to the first of several at the same distance; they are
    negative inside. A model's index is its index in the catalogue. Any number of threads may query.

    >>> two = Catalogue.of(["cube.ebpo.h5", "cube.ebpo.h5"])
    >>> two.winding([[.5, .5, .5], [2, 0, 0]])
    array([2, 0], dtype=int32)
    """

    def __init__(self, entries: Sequence[Entry], *, parts: bool = False, rule: RuleName = "nonzero",
                 http: HttpOptions | None = None) -> None:
        if not entries:
            raise ValueError("a catalogue needs at least one model")
        if rule not in RULES:
            raise ValueError(f"rule is 'nonzero', 'evenodd' or 'positive', not {rule!r}")
        self.entries, self.parts, self.rule = list(entries), parts, rule
        self.options: dict[str, Any] = dict(http or {})
        renew_after_fork(self)

    # ---- files ----

    @classmethod
    def of(cls, paths: Iterable[str | os.PathLike[str]], *, parts: bool = False, rule: RuleName = "nonzero",
           http: HttpOptions | None = None) -> Catalogue:
        """Return a catalogue of paths and URLs, in this order. Opens each file for its box and digest.

        http: options for URLs, as for `ebpo.open`: {"headers": {"Name": "value"}}.
        """
        options: dict[str, Any] = dict(http or {})

        def entry(path: str | os.PathLike[str]) -> Entry:
            name = os.fspath(path)
            name = name if "://" in name else os.path.join(os.getcwd(), name)
            file, entry, kept = opened_by(name, options), c.ebpo_catalogue_entry(), path_bytes(name)
            lib.ebpo_catalogue_entry_of(file, kept, ctypes.byref(entry))  # the entry refers to the bytes of `kept`
            return entry_of(entry)

        with ThreadPoolExecutor(8) as pool:
            return cls(list(pool.map(entry, paths)), parts=parts, rule=rule, http=http)

    @classmethod
    def open(cls, path: str | os.PathLike[str], *, http: HttpOptions | None = None) -> Catalogue:
        """Open a file that `ebpo catalogue` or `save` has written. Raises FormatError, VersionError, IOFailure."""
        name = path_bytes(pathlib.Path(path).absolute())
        read = Handle.made("ebpo_catalogue_open", name, None, free="ebpo_catalogue_free")
        facts = made(c.ebpo_catalogue_facts)
        lib.ebpo_catalogue_get_facts(read, ctypes.byref(facts))
        entries = [entry_of(c.ebpo_catalogue_entry.from_address(lib.ebpo_catalogue_get_entry(read, i)))
                   for i in range(facts.count)]
        return cls(entries, parts=facts.parts, rule=RULES[facts.rule], http=http)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Save the catalogue as a file, which is replaced atomically. Paths in its folder and below become relative."""
        call("ebpo_catalogue_save", self._made, path_bytes(pathlib.Path(path).absolute()))

    @functools.cached_property
    def _made(self) -> Handle:
        """The handle of the catalogue in the library."""
        structs = (c.ebpo_catalogue_entry * len(self))()
        for struct, entry in zip(structs, self.entries):
            fill_entry(struct, entry)
        options = made(c.ebpo_catalogue_options, open_file=OPEN_FILE, close_file=CLOSE_FILE, user=opener(self.options),
                       rule=RULES.index(self.rule), parts=self.parts)
        return Handle.made("ebpo_catalogue_new", ctypes.addressof(structs), len(self), ctypes.byref(options),
                           free="ebpo_catalogue_free")

    def _renew(self) -> None:
        made = self.__dict__.pop("_made", None)
        if made is not None:
            made.forget()

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_made"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        renew_after_fork(self)

    def __dask_tokenize__(self) -> tuple:
        """Return the data that determine results, equal in every process."""
        return "ebpo-catalogue", repr(self.entries), self.parts, self.rule

    def __len__(self) -> int:
        return len(self.entries)

    def __repr__(self) -> str:
        return f"<ebpo.Catalogue of {len(self)} {'parts of a model' if self.parts else 'models'}>"

    # ---- queries ----

    def _query(self, function: str, count: int, rows: Callable[[int, int], np.ndarray], result: Any, memory: Size | None,
               threads: int | None, **options: Any) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
        """Run a library function on blocks rows(begin, end); yield each slice with results and model indices."""
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

    def locate(self, points: ArrayLike, *, nan: NanPolicy = "raise", memory: Size | None = None,
               threads: int | None = None) -> Structured:
        """Classify points. Returns a structured array (n,): `where` as in `Model.locate`, and `winding`, the sum.

        For parts, the result is exactly that of the whole model, also on caps. For other models, `where` is IN
        if the point is IN any model, else ON if it is ON any. A model adds 0 to the sum at points on its faces.

        memory: budget in bytes for the open models of this process, from now on; initially 1 GiB.

        Raises NotSolidError if a model is a surface.
        """
        rows = Rows(points, nan=nan)
        out = np.empty(rows.count, LOCATED)
        for where, results, _ in self._query("ebpo_catalogue_inside", rows.count, lambda a, b: rows[a:b],
                                             c.ebpo_inside_result, memory, threads):
            for name in LOCATED.names or ():
                out[name][where] = results[name]
        return rows.result(out, (Where.MAYBE, 0))

    def inside(self, points: ArrayLike, *, boundary: bool = True, nan: NanPolicy = "raise", memory: Size | None = None,
               threads: int | None = None) -> Bools:
        """Return True for points inside: (n,) bool. boundary: the result on faces. Raises the errors of `locate`."""
        where = self.locate(points, nan=nan, memory=memory, threads=threads)["where"]
        inside: Bools = (where == Where.IN) | ((where == Where.ON) & boundary)
        return inside

    def winding(self, points: ArrayLike, *, nan: NanPolicy = "raise", memory: Size | None = None,
                threads: int | None = None) -> Int32s:
        """Return the sums of winding numbers: (n,) int32. Raises the errors of `locate`."""
        winding: Int32s = self.locate(points, nan=nan, memory=memory, threads=threads)["winding"].copy()
        return winding

    def _need_surface(self) -> None:
        if all(entry.surface is None for entry in self.entries):
            raise ValueError("the catalogue contains only caps and no surface")

    def distance(self, points: ArrayLike, *, max_distance: float = float("inf"), signed: bool = True,
                 nan: NanPolicy = "raise", memory: Size | None = None, threads: int | None = None) -> Structured:
        """Return the nearest face of any model: a structured array (n,).

        Its fields are those of `Model.distance`, and `model`, the index of the model.

        Distances are negative at points that are `inside`, except when a model is a surface. Of several models
        at the same rounded distance the first is used.
        """
        self._need_surface()
        rows = Rows(points, nan=nan)
        out = np.empty(rows.count, NEAREST)
        for where, results, models in self._query("ebpo_catalogue_distance", rows.count, lambda a, b: rows[a:b],
                                                  c.ebpo_distance_result, memory, threads,
                                                  max_distance=max_distance, unsigned_distance=not signed):
            for name in ("distance", "point", "normal"):
                out[name][where] = results[name]
            out["face"][where], out["model"][where] = results["face"].view(np.int64), models.view(np.int64)
        return rows.result(out, (np.nan, np.nan, np.nan, -1, -1))

    def ray(self, origins: ArrayLike, directions: ArrayLike, *, t_max: ArrayLike = float("inf"),
            nan: NanPolicy = "raise", memory: Size | None = None, threads: int | None = None) -> Structured:
        """Return the first face that each ray hits: a structured array (...), the fields of `Model.ray`, and `model`."""
        self._need_surface()
        rays = rays_of(origins, directions, t_max, nan)
        out = np.empty(rays.count, HIT)
        for where, results, models in self._query("ebpo_catalogue_ray", rays.count, rays.block, c.ebpo_ray_hit, memory,
                                                  threads):
            for name in ("t", "side"):
                out[name][where] = results[name]
            out["face"][where], out["model"][where] = results["face"].view(np.int64), models.view(np.int64)
        return rays.result(out, (np.nan, -1, 0, -1))


def interruptible(work: Callable[[Any], None], rows: int) -> None:
    """Call work(progress). In the main thread, which runs signal handlers, another thread runs long work.

    An exception of a signal handler, such as KeyboardInterrupt, stops the work, and is raised after its end.
    """
    if rows < LONG or threading.current_thread() is not threading.main_thread():
        work(c.ebpo_progress())
        return
    stopped, ended, once = threading.Event(), threading.Event(), threading.Lock()
    failed: list[BaseException] = []

    def body() -> None:
        if not once.acquire(blocking=False):  # after an interrupt of start() the thread may be started twice
            return
        try:
            work(progress)
        except BaseException as error:
            failed.append(error)
        finally:
            ended.set()

    # Not Thread.join: an interrupted join treats a running thread as ended. The library would then
    # use memory that is freed.
    interrupt = None
    with Reporter(lambda *_: not stopped.is_set()) as progress:
        while not ended.is_set():
            try:
                if not once.locked():
                    try:
                        threading.Thread(target=body, daemon=True).start()
                    except RuntimeError:  # no further thread could be started
                        body()
                ended.wait()
            except BaseException as error:
                stopped.set()
                interrupt = error
    if interrupt:
        raise interrupt
    if failed:
        raise failed[0]


def numbered(error: BaseException, first: int) -> BaseException:
    """Return the error of a block with the number of the point or ray among all rows in its message."""
    if first and isinstance(error, ArgumentError):
        error.args = (re.sub(r"^(point|ray) (\d+)", lambda found: f"{found[1]} {int(found[2]) + first}", str(error)),)
    return error


def entry_of(entry: Any) -> Entry:
    """Return the Entry of an ebpo_catalogue_entry."""
    surface, numbers = os.fsdecode(entry.surface or b""), os.fsdecode(entry.numbers or b"")
    return Entry(os.fsdecode(entry.path), bytes(entry.digest).hex(), entry.solid, tuple(entry.min), tuple(entry.max),
                 None if entry.only_caps else surface, bytes(entry.surface_digest).hex() if surface else "", numbers)


def fill_entry(struct: Any, entry: Entry) -> None:
    """Set an ebpo_catalogue_entry from an Entry. The struct refers to new copies of the texts."""
    struct.path, struct.digest = path_bytes(entry.path), bytes.fromhex(entry.content_sha256)
    struct.solid, struct.min, struct.max, struct.only_caps = entry.solid, entry.low, entry.high, entry.surface is None
    if entry.surface:
        struct.surface, struct.surface_digest = path_bytes(entry.surface), bytes.fromhex(entry.surface_sha256)
    if entry.numbers:
        struct.numbers = path_bytes(entry.numbers)
