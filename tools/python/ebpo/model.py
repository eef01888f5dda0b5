"""Models: an open file and its queries."""
from __future__ import annotations

import collections
import contextlib
import ctypes
import threading
import time
from typing import Any, Callable, Iterator, NamedTuple

import numpy as np

from . import _declared as c
from ._checked import doubles, index_of, integers, nanoseconds, within
from ._library import Callback, Handle, Reporter, call, copied, lib, made, size_in_bytes
from .queries import Rows, StageProgress, share
from .automatic import Automatic
from .errors import ArgumentError, LimitError, NoMemory
from .parts import Attributes, Info, Level, Maps, Mass, Mesh, Subtree, read_level, read_maps, read_mesh
from .sources import opened

# Rays that are asked about at a time: the library puts them in order by itself.
RAYS = 1 << 18

INSIDE = np.dtype(c.ebpo_inside_result)
DISTANCE = np.dtype(c.ebpo_distance_result)
HIT = np.dtype(c.ebpo_ray_hit)
NEAR = np.dtype(c.ebpo_near_face)

# The share of a query's time that parts cost (docs/measured/queries.md).
PARTS_SHARE = {"inside": 0.05, "distance": 0.65, "rays": 0.6, "box": 0.25}

Progress = Callable[[str, int, int], Any]


class Located(NamedTuple):
    """where: int8, a Where. winding: int32, 0 on faces. doubt: float64, see `Model.locate`."""

    where: Any
    winding: Any
    doubt: Any


class Nearest(NamedTuple):
    """distance: float64. point, normal: (.., 3) float64. face: int64. See `Model.distance`."""

    distance: Any
    point: Any
    normal: Any
    face: Any


class Bounds(NamedTuple):
    """lo, hi: float64; the distance is certainly within, unsigned."""

    lo: Any
    hi: Any


class Hits(NamedTuple):
    """t: float64. face: int64. side: int32. See `Model.ray`."""

    t: Any
    face: Any
    side: Any


class AllHits(NamedTuple):
    """t, face, side: of all hits, ray after ray. ray: int64, whose each is. begin: (n + 1,) int64."""

    t: np.ndarray
    face: np.ndarray
    side: np.ndarray
    ray: np.ndarray
    begin: np.ndarray


def open(source: Any, *, memory: int | str | None = None, cut_level: int | None = None,
         prefetch: bool = False, threads: int | None = None,
         storage_options: dict | None = None, max_expansion: int | None = None, **http: Any) -> Model:
    """Opens a file. Reads only its head; other data is read when it is needed.

    source: a path; a URL (http, https, or what fsspec knows); bytes, an mmap or an array of them, which
        are not copied; a file with seek and read; an object with `size` and `read_range(offset, size)`,
        which several threads call at once. It has to stay until the model is gone, and must itself not
        open .ebpo.h5 files while it is read.
    memory: bytes that questions may hold of the model: 500000000, "500M", "2GiB". None, as in the command: of
        a file on this machine at most half of what is free, and of that only the subtrees that questions
        come to, until all of the model at once is cheaper; of a file of more than 2 MiB that is elsewhere
        (a URL, an object with ranges, a file object that the system does not read) 256 MiB.
    cut_level: levels that stay in memory; None: by the budget.
    prefetch: subtrees around the last questions are loaded in the background.
    threads: so many work at questions and at reading. None: all cores.
    storage_options: fsspec's, of the URL.
    max_expansion: how often the file's bytes its decoded arrays may take. None: 256 times, and 64 MiB in
        any case; beyond that a file is refused (LimitError), as it may be made to exhaust memory.
    http: members of ebpo_http_options in ebpo/http.h: headers={"Name": "value"}, user="name:password",
        cache_folder=..., retries=...

    Raises IOFailure, FormatError, VersionError.

    >>> with open("cube.ebpo.h5") as m:
    ...     m.info.face_count
    12
    """
    options = {"memory": memory, "cut_level": cut_level, "prefetch": prefetch, "threads": threads,
               "storage_options": storage_options, "max_expansion": max_expansion, **http}
    return Model(source, options)


def _again(source: Any, options: dict) -> Model:
    return open(source, **options)


class Model:
    """An open file. Made by `open`; pickled as what it was opened with.

    Any number of threads may ask it. Points are (n, 3), or (3,) for a single one, whose answer has one
    dimension less; doubles in rows one after the other are not copied, anything else is converted block
    by block: float32, integers, slices, memory maps, datasets of h5py. Numbers must be finite
    (ArgumentError). Lengths are in the model's unit (`info.unit`). Faces have the numbers of the source,
    or of the file where it has no maps (`info.parts`).

    Answers are exact for every double. Those of threads, budgets and ways of loading are the same.
    """

    def __init__(self, source: Any, options: dict) -> None:
        http = {name: value for name, value in options.items()
                if name not in ("memory", "cut_level", "prefetch", "threads", "storage_options",
                                 "max_expansion")}
        self._source, self._options = source, options
        self._threads = options["threads"] or 0
        self._model_options = made(c.ebpo_model_options, memory=size_in_bytes(options["memory"]),
                                   prefetch=options["prefetch"], threads=self._threads)
        if options["cut_level"] is not None:
            self._model_options.cut_level = options["cut_level"]
        self._file: Handle | None = opened(source, http, options["storage_options"],
                                            options.get("max_expansion") or 0)
        self._lock = threading.RLock()
        self._back = threading.Condition(self._lock)  # contexts are back, or the whole model is there
        self._bringing = False
        self._lent = [0, 0]  # contexts: of calls that may run functions of the caller; of questions, which do not
        self._made: Handle | None = None
        self._contexts: collections.deque[Handle] = collections.deque()
        self._samplers: dict[str, Handle] = {}
        name = source if isinstance(source, (str, bytes)) else getattr(source, "name", type(source).__name__)
        struct = c.ebpo_info.from_address(lib.ebpo_file_info(self._file))
        self._automatic = Automatic(self._file, self._model_options)
        #: The facts of the file.
        self.info: Info = Info(struct, name if isinstance(name, str) else type(source).__name__)

    # ---- the object itself ----

    @property
    def file(self) -> Handle:
        if self._file is None:
            raise ValueError("the model has been closed")
        return self._file

    def _new_model(self, options: Any) -> Handle:
        return Handle.made("ebpo_model_new", self.file, ctypes.byref(options), free="ebpo_model_free",
                           keep=(self.file,))

    def _current(self) -> Handle:
        """Returns the model that is queried, made when it is first needed."""
        with self._lock:
            if self._made is None:
                self._made = self._new_model(self._model_options)
            return self._made

    @property
    def model(self) -> Handle:
        """Returns the model for objects that keep it, such as a `Collider`: without a budget all of it, if that fits."""
        with self._lock:
            if self._automatic.waiting:
                self._bring_in_all()
                self._automatic.waiting = False  # parts stay where they are kept
            return self._current()

    def _bring_in_all(self) -> None:
        """Replaces the parts by the whole model, when no thread asks the parts: both may not fit into memory.

        While functions of a caller may run within a context it returns with the parts: such a function may
        itself wait for this thread, or be what asks here.
        """
        with self._lock:
            while self._bringing:
                self._back.wait()
            if not self._automatic.waiting or self._lent[0]:
                return
            self._bringing = True
            try:
                while self._lent[1]:
                    self._back.wait()
                self._automatic.waiting = False
                for context in self._contexts:  # now: variables of other threads may still name them
                    context.end_now()
                self._contexts.clear()
                if self._made is not None:
                    self._made.end_now()
                self._made = None
                with contextlib.suppress(LimitError, NoMemory):  # it takes more than estimated
                    self._made = self._new_model(self._automatic.whole())
            finally:
                self._bringing = False
                self._back.notify_all()

    @contextlib.contextmanager
    def _context(self, queries: int = 0, total: int = 0, kind: str = "") -> Iterator[Handle]:
        """A context of the model for one thread.

        queries: so many will be asked of `total` that are known to come, without functions of the caller;
        kind: of PARTS_SHARE.
        """
        began, querying = time.perf_counter(), queries > 0
        if querying and self._automatic.waiting:
            with self._lock:
                pays = self._automatic.waiting and self._automatic.pays(self._current(), total, PARTS_SHARE[kind])
            if pays:
                self._bring_in_all()
        with self._lock:
            while self._bringing:
                self._back.wait()
            model, waiting = self._current(), querying and self._automatic.waiting
            try:
                context = self._contexts.pop()
            except IndexError:
                context = Handle.made("ebpo_context_new", model, free="ebpo_context_free", keep=(model,))
            self._lent[querying] += 1
        try:
            yield context
        finally:
            if waiting:
                self._automatic.add(queries, time.perf_counter() - began)
            with self._lock:
                if self._made is model:
                    self._contexts.append(context)
                self._lent[querying] -= 1
                if self._bringing:
                    self._back.notify_all()

    def close(self) -> None:
        """Frees what the model holds; arrays that were given stay. The last reference does the same."""
        with self._lock:
            self._contexts.clear()
            self._samplers.clear()
            self._made = self._file = None

    def __enter__(self) -> Model:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def __reduce__(self) -> Any:
        return _again, (self._source, self._options)

    def __repr__(self) -> str:
        kind = "solid" if self.info.solid else "surface"
        return f"<ebpo.Model {self.info.source}: a {kind} of {self.info.face_count} faces>"

    @property
    def stats(self) -> dict[str, Any]:
        """What questions have cost so far: members of ebpo_model_stats in ebpo/query.h."""
        stats = made(c.ebpo_model_stats)
        with self._lock:  # the parts may be freed by another thread
            lib.ebpo_model_get_stats(self._current(), ctypes.byref(stats))
        return {name: getattr(stats, name) if not isinstance(getattr(stats, name), ctypes.Array)
                else list(getattr(stats, name)) for name, _ in stats._fields_[1:]}

    # ---- point in solid ----

    def _query(self, rows: Rows, function: str, options: Any, dtype: np.dtype, put: Callable, threads: int | None,
               progress: Progress | None, stage: str) -> None:
        """Has `function` answer rows, and put(results, begin, end) keep them."""
        entry = function

        @contextlib.contextmanager
        def worker() -> Iterator[Callable[[int, int], None]]:
            results = np.empty(0, dtype)

            def work(begin: int, end: int) -> None:
                nonlocal results
                if len(results) < end - begin:
                    results = np.empty(end - begin, dtype)
                points = rows[begin:end]
                at = 0
                while at < end - begin:
                    count = min(end - begin - at, self._automatic.piece())
                    try:
                        with self._context(count, rows.count, stage) as context:
                            call(entry, context, points[at:].ctypes.data, count, ctypes.byref(options),
                                 results[at:].ctypes.data)
                    except ArgumentError:
                        rows.check(begin, end)
                        raise
                    at += count
                put(results[:end - begin], begin, end)

            yield work

        share(rows.count, threads or self._threads, worker, progress, stage)
        if rows.count == 0:  # says what a question would, such as that the model is a surface
            with self._context() as context:
                call(entry, context, None, 0, ctypes.byref(options), None)

    def locate(self, points: Any, *, level: int | None = None, deadline: float | None = None,
               threads: int | None = None, progress: Progress | None = None) -> Located:
        """Classifies points as outside, inside or on a face.

        level: look at levels 0 to `level` only, and say what is certain by these.
        deadline: seconds for each point, after which what is certain is said.

        Returns where: (n,) int8, Where.OUT, IN, ON or MAYBE; winding: (n,) int32, the winding number, 0
        on faces, and where an envelope decided because of a level or a deadline; doubt: (n,) float64, of
        MAYBE: the surface is at most so far away, else 0.

        Raises NotSolidError for a surface, AbsentError where a subset does not hold what decides.

        >>> cube.locate([[.5, .5, .5], [2, 0, 0], [1, .25, .5]]).where.tolist()
        [1, 0, 2]
        >>> cube.locate([.5, .5, .5]).winding
        1
        """
        rows = Rows(points)
        options = self._inside_options(level, deadline)
        out = Located(np.empty(rows.count, np.int8), np.empty(rows.count, np.int32), np.empty(rows.count))

        def put(results: np.ndarray, begin: int, end: int) -> None:
            for array, name in zip(out, Located._fields):
                array[begin:end] = results[name]

        self._query(rows, "ebpo_inside_many", options, INSIDE, put, threads, progress, "inside")
        return Located(*(array[0] for array in out)) if rows.single else out

    @staticmethod
    def _inside_options(level: int | None, deadline: float | None) -> Any:
        options = made(c.ebpo_inside_options)
        if level is not None:
            options.level = level
        if deadline is not None:
            options.deadline_ns = nanoseconds(deadline)
        return options

    def inside(self, points: Any, *, boundary: bool = True, threads: int | None = None,
               progress: Progress | None = None) -> Any:
        """Returns True for points in the solid.

        boundary: points on faces are.

        Returns (n,) bool. Raises as `locate`.

        >>> cube.inside([[.5, .5, .5], [2, 0, 0], [1, .25, .5]])
        array([ True, False,  True])
        >>> bool(cube.inside([1, .25, .5], boundary=False))
        False
        """
        rows = Rows(points)
        out = np.empty(rows.count, bool)

        def put(results: np.ndarray, begin: int, end: int) -> None:
            if boundary:  # of OUT, IN and ON, all but the first
                np.not_equal(results["where"], c.EBPO_OUT, out=out[begin:end])
            else:
                np.equal(results["where"], c.EBPO_IN, out=out[begin:end])

        self._query(rows, "ebpo_inside_many", made(c.ebpo_inside_options), INSIDE, put, threads, progress, "inside")
        return out[0] if rows.single else out

    def winding(self, points: Any, *, threads: int | None = None, progress: Progress | None = None) -> Any:
        """Returns winding numbers of points: (n,) int32, 0 on faces. Raises as `locate`.

        >>> cube.winding([[.5, .5, .5], [2, 0, 0]])
        array([1, 0], dtype=int32)
        """
        return self.locate(points, threads=threads, progress=progress).winding

    # ---- distance ----

    def distance(self, points: Any, *, max_distance: float = float("inf"), signed: bool = True,
                 threads: int | None = None, progress: Progress | None = None) -> Nearest:
        """Returns the distance of points to the model, and the nearest faces.

        max_distance: faces farther away are ignored.
        signed: distances are negative inside solids; False is faster.

        Returns distance: (n,) float64, correctly rounded, inf: nothing within max_distance, or, where there is
        a face, farther than every double; point:
        (n, 3) the nearest one, rounded, nan: none; normal: (n, 3) the face's unit normal, 0 of a face
        without area; face: (n,) int64, of several at the same distance the first in the file, -1: none.

        Raises AbsentError where the file has no mesh, or a subset does not hold what decides.

        >>> d, point, normal, face = cube.distance([[.5, .25, .5], [3, .25, .5]])
        >>> d
        array([-0.25,  2.  ])
        >>> point.tolist(), normal.tolist()
        ([[0.5, 0.0, 0.5], [1.0, 0.25, 0.5]], [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
        """
        rows = Rows(points)
        n = rows.count
        options = made(c.ebpo_distance_options, max_distance=max_distance, unsigned_distance=not signed)
        out = Nearest(np.empty(n), np.empty((n, 3)), np.empty((n, 3)), np.empty(n, np.int64))

        def put(results: np.ndarray, begin: int, end: int) -> None:
            for array, name in zip(out[:3], Nearest._fields):
                array[begin:end] = results[name]
            out.face[begin:end] = results["face"].view(np.int64)  # EBPO_NO_FACE is -1

        self._query(rows, "ebpo_distance_many", options, DISTANCE, put, threads, progress, "distance")
        return Nearest(*(array[0] for array in out)) if rows.single else out

    def distance_bounds(self, points: Any, *, level: int | None = None, deadline: float | None = None,
                        threads: int | None = None, progress: Progress | None = None) -> Bounds:
        """Returns certain bounds of distances from levels 0 to `level`, or in `deadline` seconds for each point.

        Returns lo, hi: (n,) float64, unsigned; equal where the distance is known.

        >>> lo, hi = cube.distance_bounds([3., .25, .5], level=1)
        >>> bool(lo <= 2 <= hi)
        True
        """
        rows = Rows(points)
        options = made(c.ebpo_distance_options)
        if level is not None:
            options.level = level
        if deadline is not None:
            options.deadline_ns = nanoseconds(deadline)
        out = Bounds(np.empty(rows.count), np.empty(rows.count))

        def put(results: np.ndarray, begin: int, end: int) -> None:
            out.lo[begin:end], out.hi[begin:end] = results["lo"], results["hi"]

        self._query(rows, "ebpo_distance_many", options, DISTANCE, put, threads, progress, "distance")
        return Bounds(*(array[0] for array in out)) if rows.single else out

    def near(self, point: Any, *, radius: float = float("inf"), count: int | None = None) -> Nearest:
        """Returns the faces nearest to one point, by their exact unsigned distances.

        radius: at most so far away. count: at most so many; None: all.

        Returns arrays as `distance`, of k faces.

        >>> cube.near([.5, .5, 2], radius=1).distance
        array([1., 1.])
        """
        rows = Rows(point, "the point")
        if not rows.single:
            raise ValueError("near() takes one point of three numbers")
        options = made(c.ebpo_within_options, radius=radius, most=count or 0)
        if count == 0:
            return Nearest(np.empty(0), np.empty((0, 3)), np.empty((0, 3)), np.empty(0, np.int64))
        found = bytearray()

        def take(_user: int, face: int) -> bool:
            found.extend(ctypes.string_at(face, NEAR.itemsize))
            return True

        with self._context(1, 1, "distance") as context, Callback(c.ebpo_near_fn, take) as taking:
            call("ebpo_distance_within", context, rows[0:1].ctypes.data, ctypes.byref(options), taking, None)
        faces: Any = np.frombuffer(bytes(found), NEAR)
        return Nearest(faces["distance"].copy(), faces["point"].copy(), faces["normal"].copy(),
                       faces["face"].view(np.int64).copy())

    # ---- rays ----

    def _rays(self, origins: Any, directions: Any, t_max: Any) -> tuple[int, bool, Callable]:
        """Their number, whether it is a single one, and a function that gives rays begin to end - 1."""
        o, d = Rows(origins, "origins"), Rows(directions, "directions")
        count = max(o.count, d.count)
        if o.count != d.count and not (o.single or d.single):
            raise ValueError(f"{o.count} origins and {d.count} directions")
        limits = doubles(t_max, "t_max")
        if limits.ndim and limits.shape != (count,):
            raise ValueError(f"t_max is a number, or has the shape ({count},), not {limits.shape}")

        def rays(begin: int, end: int) -> np.ndarray:
            made = np.empty((end - begin, 7))
            made[:, 0:3] = o[0:1] if o.single else o[begin:end]
            made[:, 3:6] = d[0:1] if d.single else d[begin:end]
            made[:, 6] = limits[begin:end] if limits.ndim else limits
            return made

        return count, o.single and d.single, rays

    def _cast(self, function: str, rays: tuple, sides: str, threads: int | None, progress: Progress | None,
              outputs: Callable[[int, int], tuple], keep: Callable[..., None]) -> None:
        count, _, block = rays
        options = made(c.ebpo_ray_options, threads=threads or self._threads, sides=self._sides(sides))
        report = StageProgress(progress, "rays", count)
        begin = 0
        while begin < count:
            end = min(count, begin + RAYS, begin + self._automatic.piece())
            report(begin)
            given_rays = block(begin, end)
            if not np.isfinite(given_rays[:, :6]).all():
                bad = begin + int((~np.isfinite(given_rays[:, :6]).all(axis=1)).argmax())
                raise ArgumentError(f"ray {bad} has a coordinate that is not a finite number", "EBPO_E_ARGUMENT")
            out = outputs(begin, end)
            try:
                with self._context(end - begin, count, "rays") as context:
                    call(function, context, given_rays.ctypes.data, end - begin, ctypes.byref(options), *out)
                    keep(begin, end, *out)  # lists of hits are the context's
            except ArgumentError as error:
                if begin:
                    error.args = (f"of rays from {begin} on: {error}",)
                raise
            begin = end
        if count:
            report(count)
        else:
            self._current()  # says what a question would

    @staticmethod
    def _sides(sides: str) -> int:
        try:
            return {"both": c.EBPO_RAY_BOTH, "front": c.EBPO_RAY_FRONT, "back": c.EBPO_RAY_BACK}[sides]
        except KeyError:
            raise ValueError(f"sides is 'both', 'front' or 'back', not {sides!r}") from None

    def ray(self, origins: Any, directions: Any, *, t_max: Any = float("inf"), sides: str = "both",
            threads: int | None = None, progress: Progress | None = None) -> Hits:
        """Returns the first face that each ray origin + t direction intersects, with t from 0 to t_max.

        origins, directions: (n, 3); one of both may be (3,). Directions are of any length but 0.
        t_max: a number, or (n,).
        sides: "both"; "front": faces that are met against their normals; "back": along them.

        Returns t: (n,) float64, inf: nothing is met, or, where there is a face, t is greater than every double
        (a longer direction gives it a finite one); face: (n,) int64, -1: none; side: (n,) int32, 1: the
        ray goes in through the face's inner part, -1: out, 0: it meets an edge or a vertex, runs in the
        face's plane, or the face has no area.

        >>> cube.ray([.5, .25, 3], [0, 0, -1]).t
        2.0
        >>> cube.ray([[.5, .25, 3], [5, 5, 5]], [0, 0, -1.]).side
        array([1, 0], dtype=int32)
        """
        rays = self._rays(origins, directions, t_max)
        hits: Any = np.empty(rays[0], HIT)
        self._cast("ebpo_ray_first_many", rays, sides, threads, progress,
                   lambda begin, end: (hits[begin:].ctypes.data,), lambda *_: None)
        out = Hits(hits["t"].copy(), hits["face"].view(np.int64).copy(), hits["side"].copy())
        return Hits(*(array[0] for array in out)) if rays[1] else out

    def ray_any(self, origins: Any, directions: Any, *, t_max: Any = float("inf"), sides: str = "both",
                threads: int | None = None, progress: Progress | None = None) -> Any:
        """Returns True for rays that intersect any face, (n,) bool. Faster than `ray`.

        >>> cube.ray_any([[.5, .25, 3], [5, 5, 5]], [0, 0, -1.])
        array([ True, False])
        """
        rays = self._rays(origins, directions, t_max)
        out = np.empty(rays[0], bool)
        self._cast("ebpo_ray_any_many", rays, sides, threads, progress,
                   lambda begin, end: (out[begin:].ctypes.data,), lambda *_: None)
        return out[0] if rays[1] else out

    def ray_all(self, origins: Any, directions: Any, *, t_max: Any = float("inf"), sides: str = "both",
                threads: int | None = None, progress: Progress | None = None) -> AllHits:
        """Returns all faces that each ray intersects, by t, then in the order of the file.

        Returns t, face, side: (k,) as `ray`, ray after ray; ray: (k,) int64, the number of its ray;
        begin: (n + 1,) int64, hits begin[i] to begin[i + 1] - 1 are those of ray i.

        >>> cube.ray_all([.5, .25, 3], [0, 0, -1]).t
        array([2., 3.])
        """
        rays = self._rays(origins, directions, t_max)
        parts, begins = [], [np.zeros(1, np.int64)]

        def keep(begin: int, end: int, hits: Any, places: Any) -> None:
            first = copied(places._obj.value, (end - begin + 1,), np.int64)
            parts.append(copied(hits._obj.value, (int(first[-1]),), HIT))
            begins.append(first[1:] + begins[-1][-1])

        self._cast("ebpo_ray_all_many", rays, sides, threads, progress,
                   lambda *_: (ctypes.byref(ctypes.c_void_p()), ctypes.byref(ctypes.c_void_p())), keep)
        hits: Any
        hits, begin = np.concatenate(parts or [np.empty(0, HIT)]), np.concatenate(begins)
        return AllHits(hits["t"].copy(), hits["face"].view(np.int64).copy(), hits["side"].copy(),
                       np.repeat(np.arange(rays[0]), np.diff(begin)), begin)

    # ---- boxes ----

    @staticmethod
    def _box(low: Any, high: Any) -> tuple[np.ndarray, np.ndarray]:
        corners = doubles(low, "a corner"), doubles(high, "a corner")
        if corners[0].shape != (3,) or corners[1].shape != (3,):
            raise ValueError("a box has two corners of three numbers")
        return corners

    def faces_in_box(self, low: Any, high: Any) -> np.ndarray:
        """Returns the closed triangles that intersect the closed box from `low` to `high`, (3,) each.

        Returns (k,) int64, in the order of the file.

        >>> len(cube.faces_in_box([-1, -1, -1], [2, 2, .5]))
        10
        """
        corners = self._box(low, high)
        faces, count = ctypes.c_void_p(), ctypes.c_uint64()
        with self._context(1, 1, "box") as context:
            call("ebpo_faces_in_box", context, corners[0].ctypes.data, corners[1].ctypes.data,
                 ctypes.byref(faces), ctypes.byref(count))
            return copied(faces.value, (count.value,), np.int64)

    def triangles_in_box(self, low: Any, high: Any) -> tuple[np.ndarray, np.ndarray]:
        """Returns the triangles of `faces_in_box` with their corners, within the memory budget.

        Returns corners: (k, 3, 3) float64, what the file stores exactly, and faces: (k,) int64. Their
        order is that of the file if all of the model is in memory, else subtree by subtree.

        >>> corners, faces = cube.triangles_in_box([0, 0, 0], [1, 1, 1])
        >>> corners.shape
        (12, 3, 3)
        """
        box = self._box(low, high)
        corners, faces = [np.empty((0, 3, 3))], [np.empty(0, np.int64)]

        def take(_user: int, given: int) -> bool:
            some = c.ebpo_triangles.from_address(given)
            corners.append(copied(some.corners, (some.count, 3, 3), np.float64))
            faces.append(copied(some.faces, (some.count,), np.int64))
            return True

        with self._context(1, 1, "box") as context, Callback(c.ebpo_triangles_fn, take) as taking:
            call("ebpo_triangles_in_box", context, box[0].ctypes.data, box[1].ctypes.data, taking, None)
        return np.concatenate(corners), np.concatenate(faces)

    # ---- attributes, mass ----

    def sample(self, names: str, points: Any, faces: Any) -> np.ndarray:
        """Returns attributes at points on faces, such as results of `distance` and `ray`.

        names: separated by commas: "red,green,blue", "face:label". Of vertices they are weighed by where
            the point is on its face.
        points: (n, 3); faces: (n,) integers, -1 for none.

        Returns (n, columns) float64; nan for no face. It holds the attributes and the mesh until the
        model is closed. Raises AbsentError where there is no such attribute.
        """
        rows = Rows(points)
        numbers = integers(faces, np.int64, "faces").reshape(-1)
        if len(numbers) != rows.count:
            raise ValueError(f"{rows.count} points and {len(numbers)} faces")
        with self._lock:
            if names not in self._samplers:
                self._samplers[names] = Handle.made("ebpo_sampler_new", self.file, names, self._threads,
                                                    free="ebpo_sampler_free", keep=(self.file,))
            sampler = self._samplers[names]
        out = np.empty((rows.count, lib.ebpo_sampler_columns(sampler)))
        given = rows[0:rows.count].copy()
        given[numbers < 0] = 0  # of no face there is no point either
        call("ebpo_sample", sampler, given.ctypes.data, numbers.ctypes.data, rows.count, out.ctypes.data)
        return out[0] if rows.single else out

    def measure(self, *, threads: int | None = None) -> Mass:
        """Returns area, volume, centroid and inertia.

        >>> cube.measure().volume, cube.measure().area
        (1.0, 6.0)
        """
        mass = made(c.ebpo_mass)
        call("ebpo_measure", self.file, threads or self._threads, ctypes.byref(mass))
        return Mass(mass.area, mass.volume, np.array(mass.centroid), np.array(np.ctypeslib.as_array(mass.inertia)),
                    (mass.volume_lo, mass.volume_hi), mass.integral)

    # ---- parts ----

    def mesh(self, *, order: str = "file") -> Mesh:
        """Returns the whole mesh. order: "file", or "source" as in the PLY, bit for bit.

        Returns vertices and faces, which are the library's own arrays, read-only.

        >>> vertices, faces = cube.mesh()
        >>> vertices.shape, faces.shape
        ((8, 3), (12, 3))
        """
        return read_mesh(self.file, order, self._threads)

    def maps(self) -> Maps:
        """Returns the source indices of the file's vertices and faces. AbsentError: the file has none."""
        return read_maps(self.file, self.info, self._threads)

    @property
    def attributes(self) -> Attributes:
        """Returns the attributes of vertices and faces of the source."""
        return Attributes(self.file, self._threads)

    def level(self, level: int, *, cell_faces: bool = True, progress: Progress | None = None) -> Level:
        """Returns the envelopes of a level, 0 to info.level_count - 1, as triangles.

        cell_faces: with polygons on walls of cells, so that each envelope is closed.

        Of the level's gray nodes, and of the leaves and black nodes of this one and those above. What is
        guaranteed to hold the solid is the half-spaces; polygons are these, rounded.

        >>> cube.level(0).node.max()
        0
        """
        with Reporter(progress) as reported:
            return read_level(self.file, level, cell_faces, self._threads, reported)

    def octcode(self, point: Any, level: int) -> int:
        """Returns the octcode of the cell of a level that contains a point; 0: the point is not in the root cell.

        >>> cube.octcode([.1, .1, .1], 1)
        8
        """
        given = doubles(point, "the point")
        if given.shape != (3,):
            raise ValueError("octcode() takes one point of three numbers")
        level = within(index_of(level, "level"), 0, c.EBPO_LEVELS_MAX - 1, "level")
        return lib.ebpo_octcode_at(lib.ebpo_file_info(self.file), given.ctypes.data, level)

    def subtree(self, octcode: int = 1, *, levels: int | None = None, memory: int | str | None = None,
                or_leaf_above: bool = True) -> Subtree:
        """The subtree of a gray node or leaf; 1: the whole tree. About that is read which is given.

        levels: nodes of at most so many levels below, and no faces then.
        memory: bytes that it may take; LimitError names enough.
        or_leaf_above: where the tree ends above the octcode, take the leaf there.

        Raises ArgumentError where there is no such node, or a white or black one.

        >>> cube.subtree().faces.shape
        (12, 3)
        """
        return Subtree(self.file, octcode, levels, size_in_bytes(memory), or_leaf_above)

    # ---- other packages ----

    def as_trimesh(self) -> Any:
        """Returns an object with the queries of a trimesh.Trimesh: `contains`, `ray`, `nearest`, `bounds`."""
        from .adapters import TrimeshLike
        return TrimeshLike(self)

    def to_trimesh(self, **options: Any) -> Any:
        """Returns the mesh as an unprocessed trimesh.Trimesh, in the source's order if the file has maps."""
        from .adapters import to_trimesh
        return to_trimesh(self, **options)

    def to_pyvista(self, level: int | None = None) -> Any:
        """Returns the mesh, or the envelopes of a level with their nodes' data, as a pyvista.PolyData."""
        from .adapters import to_pyvista
        return to_pyvista(self, level)
