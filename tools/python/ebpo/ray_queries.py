"""Ray queries of a model."""
from __future__ import annotations

import contextlib
import ctypes
import dataclasses
from typing import Any, Callable

import numpy as np

from . import _declared as c
from ._checked import doubles
from ._library import Handle, call, copied, made
from .automatic import Automatic
from .errors import ArgumentError
from .queries import Rows, StageProgress, shaped
from .results import AllHits, Hits
from .signatures import ArrayLike, Bools, NanPolicy, Progress, Sides

# Number of rays of one library call. The library sorts the rays of a call.
RAYS = 1 << 18

HIT = np.dtype(c.ebpo_ray_hit)
SIDES = {"both": c.EBPO_RAY_BOTH, "front": c.EBPO_RAY_FRONT, "back": c.EBPO_RAY_BACK}


@dataclasses.dataclass
class Rays:
    """Rays of a call. shape: that of the results. valid: the rays without NaN; None: all."""

    count: int
    shape: tuple[int, ...]
    valid: Any
    block: Callable[[int, int], np.ndarray]

    def result(self, values: np.ndarray, missing: Any) -> Any:
        return shaped(values, self.shape, self.valid, missing)


def has_nan(values: Rows | np.ndarray) -> np.ndarray:
    """Return for each row whether it contains NaN."""
    rows = values[0:values.count] if isinstance(values, Rows) else values[:, None]
    return np.isnan(rows).any(axis=1)


def rays_of(origins: Any, directions: Any, t_max: Any, nan: NanPolicy) -> Rays:
    """Return the rays of origins and directions, of which one may be single."""
    o, d = Rows(origins, "origins"), Rows(directions, "directions")
    shape = d.shape if o.single else o.shape
    if o.shape != d.shape and not (o.single or d.single):
        raise ValueError(f"origins of the shape {(*o.shape, 3)} and directions of the shape {(*d.shape, 3)}")
    count, limits, valid = d.count if o.single else o.count, doubles(t_max, "t_max"), None
    if limits.ndim and limits.shape != shape:
        raise ValueError(f"t_max is a number, or has the shape {shape}, not {limits.shape}")
    limits = limits.ravel() if limits.ndim else limits
    if nan not in ("raise", "propagate"):
        raise ValueError(f"nan is 'raise' or 'propagate', not {nan!r}")
    if nan == "propagate":
        valid = ~(has_nan(o) | has_nan(d) | has_nan(np.atleast_1d(limits)) | np.zeros(count, bool))
        if valid.all():
            valid = None
        else:
            for rows in (o, d):
                if rows.count == count:
                    rows.select(valid)
            limits = limits[valid] if limits.ndim else limits
            count = int(valid.sum())

    def block(begin: int, end: int) -> np.ndarray:
        rays = np.empty((end - begin, 7))
        rays[:, 0:3] = o[0:1] if o.single else o[begin:end]
        rays[:, 3:6] = d[0:1] if d.single else d[begin:end]
        rays[:, 6] = limits[begin:end] if limits.ndim else limits
        return rays

    return Rays(count, shape, valid, block)


class RayQueries:
    """The ray queries of a Model."""

    _automatic: Automatic
    _threads: int
    _context: Callable[..., contextlib.AbstractContextManager[Handle]]
    _current: Callable[[], Handle]

    def _cast(self, function: str, rays: Rays, sides: Sides, threads: int | None, progress: Progress | None,
              outputs: Callable[[int, int], tuple], keep: Callable[..., None]) -> None:
        if sides not in SIDES:
            raise ValueError(f"sides is 'both', 'front' or 'back', not {sides!r}")
        options = made(c.ebpo_ray_options, threads=threads or self._threads, sides=SIDES[sides])
        report, begin = StageProgress(progress, "rays", rays.count), 0
        while begin < rays.count:
            end = min(rays.count, begin + RAYS, begin + self._automatic.piece())
            report(begin)
            given = rays.block(begin, end)
            out = outputs(begin, end)
            try:
                with self._context(end - begin, rays.count, "rays") as context:
                    call(function, context, given.ctypes.data, end - begin, ctypes.byref(options), *out)
                    keep(begin, end, *out)  # the context owns the lists of hits
            except ArgumentError as error:
                finite = np.isfinite(given[:, :6]).all(axis=1)
                if not finite.all():
                    bad = begin + int(finite.argmin())
                    bad = bad if rays.valid is None else int(np.flatnonzero(rays.valid)[bad])
                    raise ArgumentError(f"ray {bad} has a coordinate that is not a finite number",
                                        "EBPO_E_ARGUMENT") from None
                if begin:
                    error.args = (f"of rays from {begin} on: {error}",)
                raise
            begin = end
        if rays.count:
            report(rays.count)
        else:
            self._current()  # raises the errors of a query

    def ray(self, origins: ArrayLike, directions: ArrayLike, *, t_max: ArrayLike = float("inf"),
            sides: Sides = "both", nan: NanPolicy = "raise", threads: int | None = None,
            progress: Progress | None = None) -> Hits:
        """Return the first face that each ray origin + t direction intersects, with t from 0 to t_max.

        origins, directions: (..., 3); one of the two may be (3,). Directions have any length except 0.
        t_max: a number, or (...).
        sides: "both"; "front": faces that the ray hits against their normals; "back": along their normals.
        nan: "propagate": a ray with NaN has t nan and no face.

        Returns
            t: (...) float64. inf: no hit, or (with a face) t is greater than every double; a longer direction
            then gives a finite t;
            face: (...) int64, -1: none;
            side: (...) int32, 1: the ray enters through the interior of the face; -1: the ray leaves; 0: the ray
            hits an edge or a vertex, runs in the face's plane, or the face has no area.

        >>> cube.ray([.5, .25, 3], [0, 0, -1]).t
        2.0
        >>> cube.ray([[.5, .25, 3], [5, 5, 5]], [0, 0, -1.]).side
        array([1, 0], dtype=int32)
        """
        rays = rays_of(origins, directions, t_max, nan)
        hits: Any = np.empty(rays.count, HIT)
        self._cast("ebpo_ray_first_many", rays, sides, threads, progress,
                   lambda begin, end: (hits[begin:].ctypes.data,), lambda *_: None)
        return Hits(rays.result(hits["t"].copy(), np.nan), rays.result(hits["face"].view(np.int64).copy(), -1),
                    rays.result(hits["side"].copy(), 0))

    def ray_any(self, origins: ArrayLike, directions: ArrayLike, *, t_max: ArrayLike = float("inf"),
                sides: Sides = "both", nan: NanPolicy = "raise", threads: int | None = None,
                progress: Progress | None = None) -> Bools:
        """Return True for rays that intersect any face, (...) bool. Faster than `ray`. Arguments are those of `ray`.

        >>> cube.ray_any([[.5, .25, 3], [5, 5, 5]], [0, 0, -1.])
        array([ True, False])
        """
        rays = rays_of(origins, directions, t_max, nan)
        out = np.empty(rays.count, bool)
        self._cast("ebpo_ray_any_many", rays, sides, threads, progress,
                   lambda begin, end: (out[begin:].ctypes.data,), lambda *_: None)
        return rays.result(out, False)

    def ray_all(self, origins: ArrayLike, directions: ArrayLike, *, t_max: ArrayLike = float("inf"),
                sides: Sides = "both", nan: NanPolicy = "raise", threads: int | None = None,
                progress: Progress | None = None) -> AllHits:
        """Return all faces that each ray intersects, sorted by t, then by their order in the file.

        Arguments are those of `ray`. n is the number of rays; a ray with NaN has no hits.

        Returns
            t, face, side: (k,) as in `ray`, ray after ray;
            ray: (k,) int64, the index of the ray;
            begin: (n + 1,) int64; ray i has the hits begin[i] to begin[i + 1] - 1.

        >>> cube.ray_all([.5, .25, 3], [0, 0, -1]).t
        array([2., 3.])
        """
        rays = rays_of(origins, directions, t_max, nan)
        parts: list[np.ndarray] = []
        counts = [np.zeros(0, np.int64)]

        def keep(begin: int, end: int, hits: Any, offsets: Any) -> None:
            first = copied(offsets._obj.value, (end - begin + 1,), np.int64)
            parts.append(copied(hits._obj.value, (int(first[-1]),), HIT))
            counts.append(np.diff(first))

        self._cast("ebpo_ray_all_many", rays, sides, threads, progress,
                   lambda *_: (ctypes.byref(ctypes.c_void_p()), ctypes.byref(ctypes.c_void_p())), keep)
        hits: Any = np.concatenate(parts or [np.empty(0, HIT)])
        every = np.atleast_1d(rays.result(np.concatenate(counts), 0)).ravel()
        return AllHits(hits["t"].copy(), hits["face"].view(np.int64).copy(), hits["side"].copy(),
                       np.repeat(np.arange(len(every)), every), np.concatenate([[0], np.cumsum(every)]))
