"""Models for asyncio: no call waits for bytes in the event loop."""
from __future__ import annotations

import asyncio
import concurrent.futures
import ctypes
from typing import Any, Callable, TypeVar

import numpy as np

from . import _declared as c
from ._library import Handle, call, lib, made, size_in_bytes
from .errors import IOFailure, Pending
from .model import Model
from .parts import Level
from .point_queries import DISTANCE, INSIDE
from .queries import Rows
from .ray_queries import HIT, SIDES, rays_of
from .results import Hits, Nearest
from .signatures import ArrayLike, AsyncByteRanges, Bools, HttpOptions, NanPolicy, Sides, Size
from .sources import ByUrl, shown

RANGE = np.dtype(c.ebpo_range)
Result = TypeVar("Result")
MEMORY = 48 << 20  # bytes that were fetched and are not in use


class Arriving:
    """The bytes of a file that have been fetched, as a source for `Model`."""

    def __init__(self, size: int, name: str, memory: int) -> None:
        self.name = name
        self.handle = Handle.made("ebpo_async_new", size, shown(name), b"", memory, free="ebpo_async_free")

    def async_source(self) -> Any:
        source = made(c.ebpo_source)
        call("ebpo_async_source", self.handle, ctypes.byref(source))
        return source

    def needed(self) -> list[tuple[int, int]]:
        ranges, count = ctypes.c_void_p(), ctypes.c_size_t()
        call("ebpo_async_needed", self.handle, ctypes.byref(ranges), ctypes.byref(count))
        return np.frombuffer(ctypes.string_at(ranges, count.value * RANGE.itemsize), RANGE).tolist()

    def supply(self, offset: int, size: int, data: Any) -> None:
        given = np.frombuffer(data, np.uint8)
        if len(given) != size:
            raise IOFailure(f"{self.name}: fetch returned {len(given)} bytes instead of {size}", "EBPO_E_IO", self.name)
        call("ebpo_async_supply", self.handle, offset, size, given.ctypes.data, None)


class AsyncModel:
    """An open file whose methods are coroutines. `open_async` makes it.

    Calls run in a thread, one at a time, and return when they need bytes; then all ranges that they need are
    fetched at the same time. Cancelling a coroutine ends its fetches.

    info: the facts of the file.
    """

    def __init__(self, arriving: Arriving, fetch: Callable, keep: object) -> None:
        self._arriving, self._fetch, self._keep = arriving, fetch, keep
        self._lock, self._pool = asyncio.Lock(), concurrent.futures.ThreadPoolExecutor(1)
        self._model: Any = None

    async def _repeat(self, function: Callable[[], Any], completed: Callable[[], int] = lambda: 0) -> Any:
        """Call `function` in the thread until its bytes have arrived. completed(): number of completed items."""
        async with self._lock:
            handle, loop, before = self._arriving.handle, asyncio.get_running_loop(), 0
            operation = lib.ebpo_async_begin(handle)
            try:
                while True:
                    repetition = lib.ebpo_async_begin(handle)
                    try:
                        return await loop.run_in_executor(self._pool, function)
                    except Pending:
                        ranges = self._arriving.needed()
                    finally:
                        if completed() > before:  # bytes that this repetition did not use need not stay
                            operation, repetition, before = repetition, operation, completed()
                        lib.ebpo_async_end(handle, repetition)
                    fetched = await self._fetch(ranges)
                    if len(fetched) != len(ranges):
                        raise IOFailure(f"{self._arriving.name}: fetch returned {len(fetched)} ranges instead of "
                                        f"{len(ranges)}", "EBPO_E_IO", self._arriving.name)
                    for (offset, size), data in zip(ranges, fetched):
                        self._arriving.supply(offset, size, data)
            finally:
                lib.ebpo_async_end(handle, operation)

    async def _open(self, options: dict) -> None:
        source: Any = self._arriving
        self._model = await self._repeat(lambda: Model(source, options))
        self.info = self._model.info

    async def run(self, function: Callable[[Model], Result]) -> Result:
        """Return function(model), for a function that uses any methods of `Model`.

        The function is called again, from its beginning, after bytes that it needs have been fetched.

        For example: await model.run(lambda m: m.subtree(9))
        """
        return await self._repeat(lambda: function(self._model))

    async def _batch(self, function: str, rows: np.ndarray, options: Any, dtype: np.dtype) -> np.ndarray:
        results, done = np.empty(len(rows), dtype), np.zeros(len(rows), bool)

        def work() -> None:  # keeps its arrays, because after a cancellation the thread still uses them
            options.done = done.ctypes.data
            with self._model._context() as context:
                call(function, context, rows.ctypes.data, len(rows), ctypes.byref(options), results.ctypes.data)

        await self._repeat(work, lambda: int(np.count_nonzero(done)))
        return results

    async def inside(self, points: ArrayLike, *, nan: NanPolicy = "raise") -> Bools:
        """Return True for points in the solid or on its faces, as `Model.inside` does."""
        rows = Rows(points, nan=nan)
        found = await self._batch("ebpo_inside_many", rows[0:rows.count], made(c.ebpo_inside_options), INSIDE)
        return rows.result(found["where"] != c.EBPO_OUT, False)

    async def distance(self, points: ArrayLike, *, max_distance: float = float("inf"), signed: bool = True,
                       nan: NanPolicy = "raise") -> Nearest:
        """Return the distances of points and the nearest faces, as `Model.distance` does."""
        rows = Rows(points, nan=nan)
        options = made(c.ebpo_distance_options, max_distance=max_distance, unsigned_distance=not signed)
        found = await self._batch("ebpo_distance_many", rows[0:rows.count], options, DISTANCE)
        distance, point, normal = (rows.result(found[name].copy(), np.nan) for name in Nearest._fields[:3])
        return Nearest(distance, point, normal, rows.result(found["face"].view(np.int64).copy(), -1))

    async def ray(self, origins: ArrayLike, directions: ArrayLike, *, t_max: ArrayLike = float("inf"),
                  sides: Sides = "both", nan: NanPolicy = "raise") -> Hits:
        """Return the first face that each ray intersects, as `Model.ray` does."""
        if sides not in SIDES:
            raise ValueError(f"sides is 'both', 'front' or 'back', not {sides!r}")
        rays = rays_of(origins, directions, t_max, nan)
        options = made(c.ebpo_ray_options, sides=SIDES[sides])
        found = await self._batch("ebpo_ray_first_many", rays.block(0, rays.count), options, HIT)
        return Hits(rays.result(found["t"].copy(), np.nan), rays.result(found["face"].view(np.int64).copy(), -1),
                    rays.result(found["side"].copy(), 0))

    async def level(self, number: int) -> Level:
        """Return a level, as `Model.level` does."""
        return await self.run(lambda model: model.level(number))

    def close(self) -> None:
        """Free the model's data. No coroutine of the model may be running."""
        if self._model is not None:
            self._model.close()
        self._pool.shutdown(wait=False)

    async def __aenter__(self) -> AsyncModel:
        return self

    async def __aexit__(self, *_: Any) -> None:
        self.close()


async def open_async(source: str | AsyncByteRanges, *, memory: Size | None = None, cut_level: int | None = None,
                     buffer: Size = MEMORY, http: HttpOptions | None = None) -> AsyncModel:
    """Open a file for asyncio. Reads only its header.

    source: a URL (http, https), or an object with `size` and a coroutine `fetch(ranges)`. `ranges` is a list of
        (offset, size); `fetch` returns a list of bytes in the same order. It should request all ranges at the
        same time, and raise an exception if the file has changed.
    memory, cut_level: as for `open`.
    buffer: number of fetched bytes that are kept for later calls.
    http: options for URLs, as for `open`: {"headers": {"Name": "value"}}.

    For example:

        model = await ebpo.open_async("https://example.org/model.ebpo.h5")
        await model.inside(points)
    """
    if isinstance(source, str):
        url = await asyncio.to_thread(ByUrl, source, dict(http or {}))

        async def fetch(ranges: list) -> list:
            return await asyncio.to_thread(url.fetch, ranges)

        size, name = url.size, source.partition("?")[0]
    elif http:
        raise TypeError("options for URLs need a URL")
    else:
        size, fetch, name = source.size, source.fetch, type(source).__name__
    model = AsyncModel(Arriving(size_in_bytes(size), name, size_in_bytes(buffer)), fetch, source)
    options = {"memory": memory, "cut_level": cut_level, "prefetch": False, "threads": None,
               "storage_options": None, "max_expansion": None, "threshold": 0.5}
    try:
        await model._open(options)
    except BaseException:
        model.close()
        raise
    return model
