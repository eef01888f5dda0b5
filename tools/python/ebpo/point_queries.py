"""Queries of points and boxes of a model."""
from __future__ import annotations

import ctypes
from typing import Any, Callable

import numpy as np

from . import _declared as c
from ._checked import doubles, nanoseconds
from ._library import Callback, call, copied, made
from .errors import ArgumentError
from .queries import Rows, share
from .ray_queries import RayQueries
from .results import Bounds, Located, Nearest
from .signatures import ArrayLike, Bools, Doubles, Int32s, Int64s, NanPolicy, Progress

INSIDE = np.dtype(c.ebpo_inside_result)
DISTANCE = np.dtype(c.ebpo_distance_result)
NEAR = np.dtype(c.ebpo_near_face)


class PointQueries(RayQueries):
    """The queries of a Model."""

    # ---- point in solid ----

    def _query(self, rows: Rows, function: str, options: Any, dtype: np.dtype[Any],
               put: Callable[[np.ndarray, int, int], None], threads: int | None, progress: Progress | None,
               stage: str) -> None:
        """Let the library function `function` process the rows; put(results, begin, end) stores the results."""
        def worker() -> Callable[[int, int], None]:
            results = np.empty(0, dtype)

            def work(begin: int, end: int) -> None:
                nonlocal results
                if len(results) < end - begin:
                    results = np.empty(end - begin, dtype)
                points, at = rows[begin:end], 0
                given, out = points.ctypes.data, results.ctypes.data
                while at < end - begin:
                    count = min(end - begin - at, self._automatic.piece())
                    try:
                        with self._context(count, rows.count, stage) as context:
                            call(function, context, given + at * points.strides[0], count, ctypes.byref(options),
                                 out + at * dtype.itemsize)
                    except ArgumentError:
                        rows.check(begin, end)
                        raise
                    at += count
                put(results[:end - begin], begin, end)

            return work

        share(rows.count, threads or self._threads, worker, progress, stage)
        if rows.count == 0:  # raises the errors of a query, such as NotSolidError
            with self._context() as context:
                call(function, context, None, 0, ctypes.byref(options), None)

    def locate(self, points: ArrayLike, *, level: int | None = None, deadline: float | None = None,
               nan: NanPolicy = "raise", threads: int | None = None, progress: Progress | None = None) -> Located:
        """Classify points as outside, inside or on a face.

        level: visit levels 0 to `level` only, and return what these levels prove.
        deadline: time limit in seconds for each point; then the result is what is proved so far.

        Returns
            where: (...) int8, Where.OUT, IN, ON or MAYBE;
            winding: (...) int32, the winding number. It is 0 on faces, and where an envelope decided because of
            a level or a deadline;
            doubt: (...) float64, the greatest possible distance to the surface where `where` is MAYBE; else 0.

        A point with NaN is MAYBE, and its doubt is NaN.

        Raises NotSolidError for a surface without the part `border`, and AbsentError when a subset lacks needed data.

        >>> cube.locate([[.5, .5, .5], [2, 0, 0], [1, .25, .5]]).where.tolist()
        [1, 0, 2]
        >>> cube.locate([.5, .5, .5]).winding
        1
        """
        rows = Rows(points, nan=nan)
        options = self._inside_options(level, deadline)
        out = Located(np.empty(rows.count, np.int8), np.empty(rows.count, np.int32), np.empty(rows.count))

        def put(results: np.ndarray, begin: int, end: int) -> None:
            array: Any
            for array, name in zip(out, Located._fields):
                array[begin:end] = results[name]

        self._query(rows, "ebpo_inside_many", options, INSIDE, put, threads, progress, "inside")
        return Located(rows.result(out.where, c.EBPO_MAYBE), rows.result(out.winding, 0),
                       rows.result(out.doubt, np.nan))

    @staticmethod
    def _inside_options(level: int | None, deadline: float | None) -> Any:
        options = made(c.ebpo_inside_options)
        if level is not None:
            options.level = level
        if deadline is not None:
            options.deadline_ns = nanoseconds(deadline)
        return options

    def inside(self, points: ArrayLike, *, boundary: bool = True, nan: NanPolicy = "raise",
               threads: int | None = None, progress: Progress | None = None) -> Bools:
        """Return True for points in the solid.

        boundary: the result for points on faces.

        Returns (...) bool. Raises the errors of `locate`.

        >>> cube.inside([[.5, .5, .5], [2, 0, 0], [1, .25, .5]])
        array([ True, False,  True])
        >>> bool(cube.inside([1, .25, .5], boundary=False))
        False
        """
        rows = Rows(points, nan=nan)
        out = np.empty(rows.count, bool)

        def put(results: np.ndarray, begin: int, end: int) -> None:
            if boundary:  # True for IN and ON
                np.not_equal(results["where"], c.EBPO_OUT, out=out[begin:end])
            else:
                np.equal(results["where"], c.EBPO_IN, out=out[begin:end])

        self._query(rows, "ebpo_inside_many", made(c.ebpo_inside_options), INSIDE, put, threads, progress, "inside")
        return rows.result(out, False)

    def winding(self, points: ArrayLike, *, nan: NanPolicy = "raise", threads: int | None = None,
                progress: Progress | None = None) -> Int32s:
        """Return winding numbers of points: (...) int32, 0 on faces. Raises the errors of `locate`.

        >>> cube.winding([[.5, .5, .5], [2, 0, 0]])
        array([1, 0], dtype=int32)
        """
        return self.locate(points, nan=nan, threads=threads, progress=progress).winding

    def winding_bounds(self, points: ArrayLike, *, width: float = 1e-9, nan: NanPolicy = "raise") -> Doubles:
        """Return bounds of the winding numbers of points: (..., 2), nan on faces.

        width: greatest difference of the bounds, as far as double precision allows it. Only surfaces
            have winding numbers that are not integers.

        Raises the errors of `locate`.

        >>> cube.winding_bounds([.5, .5, .5])
        array([1., 1.])
        """
        rows = Rows(points, nan=nan)
        out = np.empty((rows.count, 2))
        for begin in range(0, max(1, rows.count), 65536):
            block = rows[begin:begin + 65536]
            try:
                with self._context() as context:
                    call("ebpo_winding", context, block.ctypes.data, len(block), width, out[begin:].ctypes.data)
            except ArgumentError:
                rows.check(begin, begin + len(block))
                raise
        return rows.result(out, np.nan)

    # ---- distance ----

    def distance(self, points: ArrayLike, *, max_distance: float = float("inf"), signed: bool = True,
                 nan: NanPolicy = "raise", threads: int | None = None, progress: Progress | None = None) -> Nearest:
        """Return the distances of points to the model, and the nearest faces.

        max_distance: faces farther away are ignored.
        signed: distances are negative inside solids. False is faster.

        Returns
            distance: (...) float64, correctly rounded. inf: no face within max_distance, or (with a face) the
            distance is greater than every double;
            point: (..., 3) the nearest point, rounded; nan: none;
            normal: (..., 3) the face's unit normal; 0 for a face without area;
            face: (...) int64; of several faces at the same distance the first in the file; -1: none.

        Raises AbsentError when the file has no mesh, or a subset lacks the data that decides.

        >>> d, point, normal, face = cube.distance([[.5, .25, .5], [3, .25, .5]])
        >>> d
        array([-0.25,  2.  ])
        >>> point.tolist(), normal.tolist()
        ([[0.5, 0.0, 0.5], [1.0, 0.25, 0.5]], [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
        """
        rows = Rows(points, nan=nan)
        n = rows.count
        options = made(c.ebpo_distance_options, max_distance=max_distance, unsigned_distance=not signed)
        out = Nearest(np.empty(n), np.empty((n, 3)), np.empty((n, 3)), np.empty(n, np.int64))

        def put(results: np.ndarray, begin: int, end: int) -> None:
            for array, name in zip(out[:3], Nearest._fields):
                array[begin:end] = results[name]
            out.face[begin:end] = results["face"].view(np.int64)  # EBPO_NO_FACE is -1

        self._query(rows, "ebpo_distance_many", options, DISTANCE, put, threads, progress, "distance")
        missing = np.nan, np.nan, np.nan, -1
        return Nearest(*(rows.result(array, value) for array, value in zip(out, missing)))

    def distance_bounds(self, points: ArrayLike, *, level: int | None = None, deadline: float | None = None,
                        nan: NanPolicy = "raise", threads: int | None = None,
                        progress: Progress | None = None) -> Bounds:
        """Return guaranteed bounds of distances.

        level: visit levels 0 to `level` only.
        deadline: time limit in seconds for each point.

        Returns lo, hi: (...) float64, unsigned. They are equal where the distance is known.

        >>> lo, hi = cube.distance_bounds([3., .25, .5], level=1)
        >>> bool(lo <= 2 <= hi)
        True
        """
        rows = Rows(points, nan=nan)
        options = made(c.ebpo_distance_options)
        if level is not None:
            options.level = level
        if deadline is not None:
            options.deadline_ns = nanoseconds(deadline)
        out = Bounds(np.empty(rows.count), np.empty(rows.count))

        def put(results: np.ndarray, begin: int, end: int) -> None:
            out.lo[begin:end], out.hi[begin:end] = results["lo"], results["hi"]

        self._query(rows, "ebpo_distance_many", options, DISTANCE, put, threads, progress, "distance")
        return Bounds(*(rows.result(array, np.nan) for array in out))

    def near(self, point: ArrayLike, *, radius: float = float("inf"), count: int | None = None) -> Nearest:
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

    # ---- boxes ----

    @staticmethod
    def _box(low: ArrayLike, high: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        corners = doubles(low, "a corner"), doubles(high, "a corner")
        if corners[0].shape != (3,) or corners[1].shape != (3,):
            raise ValueError("a box has two corners of three numbers")
        return corners

    def faces_in_box(self, low: ArrayLike, high: ArrayLike) -> Int64s:
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

    def _triangles(self, low: ArrayLike, high: ArrayLike, take: Callable[[Any], None]) -> None:
        """Call take(triangles) with parts of the triangles of a box."""
        box = self._box(low, high)

        def give(_user: int, given: int) -> bool:
            take(c.ebpo_triangles.from_address(given))
            return True

        with self._context(1, 1, "box") as context, Callback(c.ebpo_triangles_fn, give) as giving:
            call("ebpo_triangles_in_box", context, box[0].ctypes.data, box[1].ctypes.data, giving, None)

    def triangles_in_box(self, low: ArrayLike, high: ArrayLike) -> tuple[Doubles, Int64s]:
        """Return the triangles of `faces_in_box` with their corners, within the memory budget.

        Returns
            corners: (k, 3, 3) float64, exactly the stored coordinates;
            faces: (k,) int64.

        The order is that of the file when the whole model is in memory, else subtree after subtree.

        >>> corners, faces = cube.triangles_in_box([0, 0, 0], [1, 1, 1])
        >>> corners.shape
        (12, 3, 3)
        """
        corners, faces = [np.empty((0, 3, 3))], [np.empty(0, np.int64)]

        def take(some: Any) -> None:
            corners.append(copied(some.corners, (some.count, 3, 3), np.float64))
            faces.append(copied(some.faces, (some.count,), np.int64))

        self._triangles(low, high, take)
        return np.concatenate(corners), np.concatenate(faces)
