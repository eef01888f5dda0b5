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

# Number of rays of one library call. The library sorts the rays of a call.
RAYS = 1 << 18

INSIDE = np.dtype(c.ebpo_inside_result)
DISTANCE = np.dtype(c.ebpo_distance_result)
HIT = np.dtype(c.ebpo_ray_hit)
NEAR = np.dtype(c.ebpo_near_face)

# For each kind of query: the share of its time that partial loading costs
# (docs/measured/queries.md).
PARTS_SHARE = {"inside": 0.05, "distance": 0.65, "rays": 0.6, "box": 0.25}

Progress = Callable[[str, int, int], Any]


class Located(NamedTuple):
    """Results of `Model.locate`.

    where: int8, a Where.
    winding: int32, 0 on faces.
    doubt: float64, the greatest possible distance to the surface where `where` is MAYBE; else 0.
    """

    where: Any
    winding: Any
    doubt: Any


class Nearest(NamedTuple):
    """Results of `Model.distance`.

    distance: float64. point, normal: (.., 3) float64. face: int64.
    """

    distance: Any
    point: Any
    normal: Any
    face: Any


class Bounds(NamedTuple):
    """Bounds of distances.

    lo, hi: float64, unsigned. The distance is certainly in [lo, hi].
    """

    lo: Any
    hi: Any


class Hits(NamedTuple):
    """Results of `Model.ray`.

    t: float64. face: int64. side: int32.
    """

    t: Any
    face: Any
    side: Any


class AllHits(NamedTuple):
    """Results of `Model.ray_all`: k hits of n rays, ray after ray.

    t, face, side: (k,), as in `Hits`.
    ray: (k,) int64, the index of the hit's ray.
    begin: (n + 1,) int64, the index of each ray's first hit.
    """

    t: np.ndarray
    face: np.ndarray
    side: np.ndarray
    ray: np.ndarray
    begin: np.ndarray


def open(source: Any, *, memory: int | str | None = None, cut_level: int | None = None,
         prefetch: bool = False, threads: int | None = None,
         storage_options: dict | None = None, max_expansion: int | None = None,
         holes: bool = False, threshold: float = 0.5, **http: Any) -> Model:
    """Open a file. Reads only its header; other data is read when a query needs it.

    source: one of these:
        a path;
        a URL (http, https, or a scheme that fsspec supports);
        bytes, an mmap or an array of bytes, which are not copied;
        a file object with seek and read;
        an object with `size` and `read_range(offset, size)`, which several threads call at the same time.
        The source must exist as long as the model. Its methods must not open .ebpo.h5 files.
    memory: budget in bytes for data that the model keeps in memory: 500000000, "500M", "2GiB".
        None, local file: at most half of the free memory. The model first loads only the subtrees that
        queries need; it loads the whole model when that becomes cheaper. The command does the same.
        None, a source of more than 2 MiB elsewhere (a URL, an object with ranges, a file object that the
        system does not read): 256 MiB.
    cut_level: levels 0 to cut_level stay in memory. None: the budget determines it.
    prefetch: a background thread loads the subtrees around the last queries.
    threads: number of threads for queries and for reading. None: all cores.
    storage_options: options of fsspec for the URL.
    max_expansion: largest ratio of the decoded arrays to the file size. None: 256; 64 MiB are always
        allowed. A file beyond the limit is refused (LimitError): it may be made to exhaust memory.
    holes: a surface, such as a scan with holes, has an inside and signed distances, by its generalized
        winding number. The model has to fit into memory.
    threshold: the winding number above which a point of a surface is inside.
    http: members of ebpo_http_options in ebpo/http.h: headers={"Name": "value"}, user="name:password",
        cache_folder=..., retries=...

    Raises IOFailure, FormatError, VersionError.

    >>> with open("cube.ebpo.h5") as m:
    ...     m.info.face_count
    12
    """
    options = {"memory": memory, "cut_level": cut_level, "prefetch": prefetch, "threads": threads,
               "storage_options": storage_options, "max_expansion": max_expansion, "holes": holes,
               "threshold": threshold, **http}
    return Model(source, options)


def _again(source: Any, options: dict) -> Model:
    return open(source, **options)


class Model:
    """An open file. `open` makes it. A pickle contains the arguments of `open`, not the data.

    Any number of threads may query a model at the same time.

    Points have the shape (n, 3), or (3,) for a single point, whose result has one dimension less.
    Contiguous rows of doubles are not copied. Other input is converted block by block: float32, integers,
    slices, memory maps, datasets of h5py. Coordinates must be finite (ArgumentError).

    Lengths are in the model's unit (`info.unit`). Face indices are those of the source, or those of the file
    when the file has no maps (`info.parts`).

    Results are exact for every double. They do not depend on threads, budgets or the way of loading.
    """

    def __init__(self, source: Any, options: dict) -> None:
        http = {name: value for name, value in options.items()
                if name not in ("memory", "cut_level", "prefetch", "threads", "storage_options",
                                 "max_expansion", "holes", "threshold")}
        self._source, self._options = source, options
        self._threads = options["threads"] or 0
        self._model_options = made(c.ebpo_model_options, memory=size_in_bytes(options["memory"]),
                                   prefetch=options["prefetch"], threads=self._threads,
                                   holes=options["holes"], threshold=options["threshold"])
        if options["cut_level"] is not None:
            self._model_options.cut_level = options["cut_level"]
        self._file: Handle | None = opened(source, http, options["storage_options"],
                                            options.get("max_expansion") or 0)
        self._lock = threading.RLock()
        self._back = threading.Condition(self._lock)  # signals returned contexts and the end of _bring_in_all
        self._bringing = False
        # Contexts in use: [0] by calls that may run functions of the caller, [1] by queries, which do not.
        self._lent = [0, 0]
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
        """Return the current model handle; make it at the first call."""
        with self._lock:
            if self._made is None:
                self._made = self._new_model(self._model_options)
            return self._made

    @property
    def model(self) -> Handle:
        """Return the handle for objects that keep it, such as a `Collider`.

        Without a budget, load the whole model first if it fits into memory.
        """
        with self._lock:
            if self._automatic.waiting:
                self._bring_in_all()
                self._automatic.waiting = False  # from now on the model stays partially loaded
            return self._current()

    def _bring_in_all(self) -> None:
        """Replace the partially loaded model by the whole model when no query uses the former.

        Memory may be too small for both at the same time. While functions of the caller may run in a
        context, the method returns without a change: such a function may wait for this thread, or may have
        called this method.
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
                for context in self._contexts:  # free now: variables of other threads may still refer to the contexts
                    context.end_now()
                self._contexts.clear()
                if self._made is not None:
                    self._made.end_now()
                self._made = None
                with contextlib.suppress(LimitError, NoMemory):  # the model needs more memory than estimated
                    self._made = self._new_model(self._automatic.whole())
            finally:
                self._bringing = False
                self._back.notify_all()

    @contextlib.contextmanager
    def _context(self, queries: int = 0, total: int = 0, kind: str = "") -> Iterator[Handle]:
        """Lend a context of the model to one thread.

        queries: number of queries that follow in this context, and that run no function of the caller.
        total: number of queries of the whole call.
        kind: a key of PARTS_SHARE.
        """
        began, has_queries = time.perf_counter(), queries > 0
        if has_queries and self._automatic.waiting:
            with self._lock:
                pays = self._automatic.waiting and self._automatic.pays(self._current(), total, PARTS_SHARE[kind])
            if pays:
                self._bring_in_all()
        with self._lock:
            while self._bringing:
                self._back.wait()
            model, waiting = self._current(), has_queries and self._automatic.waiting
            try:
                context = self._contexts.pop()
            except IndexError:
                context = Handle.made("ebpo_context_new", model, free="ebpo_context_free", keep=(model,))
            self._lent[has_queries] += 1
        try:
            yield context
        finally:
            if waiting:
                self._automatic.add(queries, time.perf_counter() - began)
            with self._lock:
                if self._made is model:
                    self._contexts.append(context)
                self._lent[has_queries] -= 1
                if self._bringing:
                    self._back.notify_all()

    def close(self) -> None:
        """Free the model's data. Returned arrays remain valid. The end of the last reference also frees it."""
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
        """Return the cost of all queries so far: the members of ebpo_model_stats in ebpo/query.h."""
        stats = made(c.ebpo_model_stats)
        with self._lock:  # another thread may replace the model
            lib.ebpo_model_get_stats(self._current(), ctypes.byref(stats))
        return {name: getattr(stats, name) if not isinstance(getattr(stats, name), ctypes.Array)
                else list(getattr(stats, name)) for name, _ in stats._fields_[1:]}

    # ---- point in solid ----

    def _query(self, rows: Rows, function: str, options: Any, dtype: np.dtype, put: Callable, threads: int | None,
               progress: Progress | None, stage: str) -> None:
        """Let the library function `function` process the rows; put(results, begin, end) stores the results."""
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
        if rows.count == 0:  # raises the errors of a query, such as NotSolidError
            with self._context() as context:
                call(entry, context, None, 0, ctypes.byref(options), None)

    def locate(self, points: Any, *, level: int | None = None, deadline: float | None = None,
               threads: int | None = None, progress: Progress | None = None) -> Located:
        """Classify points as outside, inside or on a face.

        level: visit levels 0 to `level` only, and return what these levels prove.
        deadline: time limit in seconds for each point; then the result is what is proved so far.

        Returns
            where: (n,) int8, Where.OUT, IN, ON or MAYBE;
            winding: (n,) int32, the winding number. It is 0 on faces, and where an envelope decided because of
            a level or a deadline;
            doubt: (n,) float64, the greatest possible distance to the surface where `where` is MAYBE; else 0.

        Raises NotSolidError for a surface, and AbsentError when a subset lacks the data that decides.

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
        """Return True for points in the solid.

        boundary: the result for points on faces.

        Returns (n,) bool. Raises the errors of `locate`.

        >>> cube.inside([[.5, .5, .5], [2, 0, 0], [1, .25, .5]])
        array([ True, False,  True])
        >>> bool(cube.inside([1, .25, .5], boundary=False))
        False
        """
        rows = Rows(points)
        out = np.empty(rows.count, bool)

        def put(results: np.ndarray, begin: int, end: int) -> None:
            if boundary:  # True for IN and ON
                np.not_equal(results["where"], c.EBPO_OUT, out=out[begin:end])
            else:
                np.equal(results["where"], c.EBPO_IN, out=out[begin:end])

        self._query(rows, "ebpo_inside_many", made(c.ebpo_inside_options), INSIDE, put, threads, progress, "inside")
        return out[0] if rows.single else out

    def winding(self, points: Any, *, threads: int | None = None, progress: Progress | None = None) -> Any:
        """Return winding numbers of points: (n,) int32, 0 on faces. Raises the errors of `locate`.

        >>> cube.winding([[.5, .5, .5], [2, 0, 0]])
        array([1, 0], dtype=int32)
        """
        return self.locate(points, threads=threads, progress=progress).winding

    def winding_bounds(self, points: Any, *, width: float = 1e-9) -> Any:
        """Return bounds of the winding numbers of points: (n, 2), nan on faces.

        width: greatest difference of the bounds, as far as double precision allows it. Only surfaces opened
            with `holes` have winding numbers that are not integers.

        Raises the errors of `locate`.

        >>> cube.winding_bounds([.5, .5, .5])
        array([1., 1.])
        """
        rows = Rows(points)
        out = np.empty((rows.count, 2))
        for begin in range(0, max(1, rows.count), 65536):
            block = rows[begin:begin + 65536]
            with self._context() as context:
                call("ebpo_winding", context, block.ctypes.data, len(block), width, out[begin:].ctypes.data)
        return out[0] if rows.single else out

    # ---- distance ----

    def distance(self, points: Any, *, max_distance: float = float("inf"), signed: bool = True,
                 threads: int | None = None, progress: Progress | None = None) -> Nearest:
        """Return the distances of points to the model, and the nearest faces.

        max_distance: faces farther away are ignored.
        signed: distances are negative inside solids. False is faster.

        Returns
            distance: (n,) float64, correctly rounded. inf: no face within max_distance, or (with a face) the
            distance is greater than every double;
            point: (n, 3) the nearest point, rounded; nan: none;
            normal: (n, 3) the face's unit normal; 0 for a face without area;
            face: (n,) int64; of several faces at the same distance the first in the file; -1: none.

        Raises AbsentError when the file has no mesh, or a subset lacks the data that decides.

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
        """Return guaranteed bounds of distances.

        level: visit levels 0 to `level` only.
        deadline: time limit in seconds for each point.

        Returns lo, hi: (n,) float64, unsigned. They are equal where the distance is known.

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
        """Return the faces nearest to one point, sorted by their exact unsigned distances.

        radius: greatest distance. count: greatest number of faces; None: no limit.

        Returns the arrays of `distance`, for k faces.

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
        """Return the number of rays, True for a single ray, and a function that returns rays begin to end - 1."""
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
                    keep(begin, end, *out)  # the context owns the lists of hits
            except ArgumentError as error:
                if begin:
                    error.args = (f"of rays from {begin} on: {error}",)
                raise
            begin = end
        if count:
            report(count)
        else:
            self._current()  # raises the errors of a query

    @staticmethod
    def _sides(sides: str) -> int:
        try:
            return {"both": c.EBPO_RAY_BOTH, "front": c.EBPO_RAY_FRONT, "back": c.EBPO_RAY_BACK}[sides]
        except KeyError:
            raise ValueError(f"sides is 'both', 'front' or 'back', not {sides!r}") from None

    def ray(self, origins: Any, directions: Any, *, t_max: Any = float("inf"), sides: str = "both",
            threads: int | None = None, progress: Progress | None = None) -> Hits:
        """Return the first face that each ray origin + t direction intersects, with t from 0 to t_max.

        origins, directions: (n, 3); one of the two may be (3,). Directions have any length except 0.
        t_max: a number, or (n,).
        sides: "both"; "front": faces that the ray hits against their normals; "back": along their normals.

        Returns
            t: (n,) float64. inf: no hit, or (with a face) t is greater than every double; a longer direction
            then gives a finite t;
            face: (n,) int64, -1: none;
            side: (n,) int32, 1: the ray enters through the interior of the face; -1: the ray leaves; 0: the ray
            hits an edge or a vertex, runs in the face's plane, or the face has no area.

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
        """Return True for rays that intersect any face, (n,) bool. Faster than `ray`.

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
        """Return all faces that each ray intersects, sorted by t, then by their order in the file.

        Returns
            t, face, side: (k,) as in `ray`, ray after ray;
            ray: (k,) int64, the index of the ray;
            begin: (n + 1,) int64; ray i has the hits begin[i] to begin[i + 1] - 1.

        >>> cube.ray_all([.5, .25, 3], [0, 0, -1]).t
        array([2., 3.])
        """
        rays = self._rays(origins, directions, t_max)
        parts, begins = [], [np.zeros(1, np.int64)]

        def keep(begin: int, end: int, hits: Any, offsets: Any) -> None:
            first = copied(offsets._obj.value, (end - begin + 1,), np.int64)
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
        """Return the closed triangles that intersect the closed box from `low` to `high`, (3,) each.

        Returns (k,) int64, face indices in the order of the file.

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
        """Return the triangles of `faces_in_box` with their corners, within the memory budget.

        Returns
            corners: (k, 3, 3) float64, exactly the stored coordinates;
            faces: (k,) int64.

        The order is that of the file when the whole model is in memory, else subtree after subtree.

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
        """Return attributes at points on faces, such as results of `distance` and `ray`.

        names: attribute names separated by commas: "red,green,blue", "face:label". Values of vertices are
            interpolated at the point.
        points: (n, 3). faces: (n,) integers, -1: no face.

        Returns (n, columns) float64; nan where there is no face. The model keeps the attributes and the mesh in
        memory until it is closed. Raises AbsentError when an attribute does not exist.
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
        given[numbers < 0] = 0  # a point without a face may be nan
        call("ebpo_sample", sampler, given.ctypes.data, numbers.ctypes.data, rows.count, out.ctypes.data)
        return out[0] if rows.single else out

    def measure(self, *, threads: int | None = None) -> Mass:
        """Return area, volume, centroid and inertia.

        >>> cube.measure().volume, cube.measure().area
        (1.0, 6.0)
        """
        mass = made(c.ebpo_mass)
        call("ebpo_measure", self.file, threads or self._threads, ctypes.byref(mass))
        return Mass(mass.area, mass.volume, np.array(mass.centroid), np.array(np.ctypeslib.as_array(mass.inertia)),
                    (mass.volume_lo, mass.volume_hi), mass.integral)

    # ---- parts ----

    def mesh(self, *, order: str = "file") -> Mesh:
        """Return the whole mesh.

        order: "file"; "source": vertices and faces equal those of the PLY file bit for bit.

        Returns vertices and faces: read-only arrays in memory of the library.

        >>> vertices, faces = cube.mesh()
        >>> vertices.shape, faces.shape
        ((8, 3), (12, 3))
        """
        return read_mesh(self.file, order, self._threads)

    def maps(self) -> Maps:
        """Return the source indices of the file's vertices and faces. Raises AbsentError when the file has no maps."""
        return read_maps(self.file, self.info, self._threads)

    @property
    def attributes(self) -> Attributes:
        """Return the attributes of vertices and faces of the source."""
        return Attributes(self.file, self._threads)

    def level(self, level: int, *, cell_faces: bool = True, progress: Progress | None = None) -> Level:
        """Return the envelopes of a level, 0 to info.level_count - 1, as triangles.

        cell_faces: include the polygons on cell faces, so that each envelope is closed.

        The envelopes are those of the level's gray nodes, and of the leaves and black nodes of this level and
        of the levels above. The half-spaces are guaranteed to contain the solid; the polygons are rounded.

        >>> cube.level(0).node.max()
        0
        """
        with Reporter(progress) as reported:
            return read_level(self.file, level, cell_faces, self._threads, reported)

    def octcode(self, point: Any, level: int) -> int:
        """Return the octcode of the cell of a level that contains a point. Returns 0 for a point outside the root cell.

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
        """Return the subtree of a gray node or leaf; octcode 1 is the whole tree.

        levels: include only this number of levels below the node, and no faces.
        memory: budget in bytes. The message of LimitError states a sufficient budget.
        or_leaf_above: when the tree ends above the octcode, return the leaf there.

        Raises ArgumentError when the node does not exist, or is white or black.

        >>> cube.subtree().faces.shape
        (12, 3)
        """
        return Subtree(self.file, octcode, levels, size_in_bytes(memory), or_leaf_above)

    # ---- other packages ----

    def as_trimesh(self) -> Any:
        """Return an object with the queries of a trimesh.Trimesh: `contains`, `ray`, `nearest`, `bounds`."""
        from .adapters import TrimeshLike
        return TrimeshLike(self)

    def to_trimesh(self, **options: Any) -> Any:
        """Return the mesh as an unprocessed trimesh.Trimesh, in the source's order if the file has maps."""
        from .adapters import to_trimesh
        return to_trimesh(self, **options)

    def to_pyvista(self, level: int | None = None) -> Any:
        """Return the mesh, or the envelopes of a level with their nodes' data, as a pyvista.PolyData."""
        from .adapters import to_pyvista
        return to_pyvista(self, level)
