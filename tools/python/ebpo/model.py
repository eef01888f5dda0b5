"""Models: an open file and its queries."""
from __future__ import annotations

import collections
import contextlib
import ctypes
import threading
import time
from typing import TYPE_CHECKING, Any, Callable, Iterator, Literal, Mapping

import numpy as np

from . import _declared as c
from ._checked import doubles, index_of, integers, within
from ._library import Handle, Reporter, call, copied, lib, made, size_in_bytes
from .automatic import Automatic
from .errors import IOFailure, LimitError, NoMemory
from .forks import renew_after_fork
from .parts import (Attributes, Info, Level, Maps, Mass, Mesh, Subtree, Surface, observer_of, read_level, read_maps,
                    read_mesh, read_surface)
from .point_queries import PointQueries
from .queries import Rows
from .signatures import ArrayLike, Doubles, Path, Progress, Size, Source
from .sources import opened

if TYPE_CHECKING:
    import pyvista  # type: ignore[import-not-found, import-untyped, unused-ignore]
    import trimesh  # type: ignore[import-not-found, import-untyped, unused-ignore]
    from .adapters import TrimeshLike
    from .notebook import Viewer

# For each kind of query: the share of its time that partial loading costs
# (docs/measured/queries.md).
PARTS_SHARE = {"inside": 0.05, "distance": 0.65, "rays": 0.6, "box": 0.25}


def open(source: Source, *, memory: Size | None = None, cut_level: int | None = None,
         prefetch: bool = False, threads: int | None = None, max_expansion: int | None = None,
         storage_options: Mapping[str, Any] | None = None, headers: Mapping[str, str] | None = None,
         user: str | None = None, time_limit: float | None = None, connect_timeout: float | None = None,
         stall_timeout: float | None = None, retries: int | None = None, connections: int | None = None,
         whole_limit: Size | None = None, unversioned: bool | None = None, netrc: bool | None = None,
         ca_file: Path | None = None, proxy: str | None = None, user_agent: str | None = None,
         cache_folder: Path | None = None, cache_bytes: Size | None = None,
         cache_block: int | None = None, threshold: float = 0.5) -> Model:
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
    max_expansion: largest ratio of the decoded arrays to the file size. None: 256; 64 MiB are always
        allowed. A file beyond the limit is refused (LimitError): it may be made to exhaust memory.
    threshold: the generalized winding number above which a point of a surface, such as a scan with holes,
        is inside.
    storage_options: options of fsspec for the URL.
    headers: {"Name": "value"}, sent with every request. user: "name:password".
    time_limit ... cache_block: members of ebpo_http_options in ebpo/http.h. None: the default there.

    Raises IOFailure (a missing file: MissingFileError, a FileNotFoundError), FormatError, VersionError.

    >>> with open("cube.ebpo.h5") as m:
    ...     m.info.face_count
    12
    """
    http = {"headers": headers, "user": user, "time_limit": time_limit, "connect_timeout": connect_timeout,
            "stall_timeout": stall_timeout, "retries": retries, "connections": connections, "whole_limit": whole_limit,
            "unversioned": unversioned, "netrc": netrc, "ca_file": ca_file, "proxy": proxy, "user_agent": user_agent,
            "cache_folder": cache_folder, "cache_bytes": cache_bytes, "cache_block": cache_block}
    options = {"memory": memory, "cut_level": cut_level, "prefetch": prefetch, "threads": threads,
               "storage_options": storage_options, "max_expansion": max_expansion,
               "threshold": threshold}
    return Model(source, {**options, **{name: value for name, value in http.items() if value is not None}})


def _again(source: Any, options: dict[str, Any]) -> Model:
    return open(source, **options)


class Model(PointQueries):
    """An open file. `open` makes it. A pickle contains the arguments of `open`, not the data.

    Any number of threads may query a model at the same time. In a process that os.fork made, the model opens its
    source again; objects of this package that were made from the model are not usable there.

    Points have the shape (..., 3), such as (n, 3) or (height, width, 3). Results have the shape (...). The results of
    a single point (3,) are scalars of numpy. Contiguous rows of doubles are not copied. Other input is
    converted block by block: float32, integers, slices, memory maps, datasets of h5py.

    Coordinates must be finite (ArgumentError). With nan="propagate", points that contain NaN are not inside; they
    have no face (-1), the winding number 0, and NaN for all real numbers.

    Lengths are in the model's unit (`info.unit`). Face indices are those of the source, or those of the file
    when the file has no source indices (`info.parts`).

    Results are exact for every double. They do not depend on threads, budgets or the way of loading.
    """

    def __init__(self, source: Source, options: dict[str, Any]) -> None:
        http = {name: value for name, value in options.items()
                if name not in ("memory", "cut_level", "prefetch", "threads", "storage_options",
                                 "max_expansion", "threshold")}
        self._source, self._options = source, options
        self._threads = options["threads"] or 0
        self._model_options = made(c.ebpo_model_options, memory=size_in_bytes(options["memory"]),
                                   prefetch=options["prefetch"], threads=self._threads,
                                   threshold=options["threshold"])
        if options["cut_level"] is not None:
            self._model_options.cut_level = options["cut_level"]
        self._wished_options = bytes(self._model_options)
        self._open: Callable[[], Handle] = lambda: opened(source, http, options["storage_options"],
                                                          options.get("max_expansion") or 0)
        self._file: Handle | None = self._open()
        self._begin()
        self._bounds: Doubles | None = None
        self._mass: Mass | None = None
        name = source if isinstance(source, (str, bytes)) else getattr(source, "name", type(source).__name__)
        struct = c.ebpo_info.from_address(lib.ebpo_file_info(self._file))
        self._automatic = Automatic(self._file, self._model_options)
        #: The facts of the file.
        self.info: Info = Info(struct, name if isinstance(name, str) else type(source).__name__)
        renew_after_fork(self)

    def _begin(self) -> None:
        """Begin without a model and contexts of the library."""
        self._lock = threading.RLock()
        self._back = threading.Condition(self._lock)  # signals returned contexts and the end of _bring_in_all
        self._bringing = False
        # Contexts in use: [0] by calls that may run functions of the caller, [1] by queries, which do not.
        self._lent = [0, 0]
        self._made: Handle | None = None
        self._contexts: collections.deque[Handle] = collections.deque()
        self._samplers: dict[str, Handle] = {}
        self._forked = False  # True: the source is not open in this process yet

    def _renew(self) -> None:
        for handle in (self._made, self._file, *self._contexts, *self._samplers.values()):
            if handle is not None:
                handle.forget()
        closed, self._automatic.lock = self._file is None, threading.Lock()
        self._begin()
        self._forked = not closed

    # ---- the object itself ----

    @property
    def file(self) -> Handle:
        if self._forked:
            with self._lock:
                if self._forked:
                    self._open_again()
        if self._file is None:
            raise ValueError("the model has been closed")
        return self._file

    def _open_again(self) -> None:
        """Open the source in a process that os.fork made."""
        file = self._open()
        struct = c.ebpo_info.from_address(lib.ebpo_file_info(file))
        if bytes(struct.content_sha256).hex() != self.info.content_sha256:
            raise IOFailure(f"{self.info.source}: the file was replaced after the process was forked", "EBPO_E_IO",
                            self.info.source)
        self._model_options = c.ebpo_model_options.from_buffer_copy(self._wished_options)
        self._file, self._automatic, self._forked = file, Automatic(file, self._model_options), False

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
        """Replace the partially loaded model by the whole model when no query uses the old one.

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
            self._forked = False
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

    def _repr_html_(self) -> str:
        """Return facts and a picture for notebooks."""
        from .notebook import html_of
        return html_of(self)

    def show(self, *, height: int = 480, viewer: Path | None = None) -> Viewer:
        """Return the web viewer of the model, which a notebook shows inline. The model is that of a local path.

        height: height of the viewer in pixels.
        viewer: the folder of the viewer. None: the folder where it is installed.

        Raises UnsupportedError when the command `ebpo` or the viewer is missing.
        """
        from .notebook import Viewer
        return Viewer(self._source, height, viewer)

    @property
    def stats(self) -> dict[str, Any]:
        """Return the cost of all queries so far: the members of ebpo_model_stats in ebpo/query.h."""
        stats = made(c.ebpo_model_stats)
        with self._lock:  # another thread may replace the model
            lib.ebpo_model_get_stats(self._current(), ctypes.byref(stats))
        return {name: getattr(stats, name) if not isinstance(getattr(stats, name), ctypes.Array)
                else list(getattr(stats, name)) for name, _ in stats._fields_[1:]}

    # ---- attributes, mass ----

    @property
    def bounds(self) -> Doubles:
        """Return the bounding box of the faces: (2, 3) float64, the lowest and the highest coordinates.

        The first access reads all faces, within the memory budget. `info.box` is the root cell, which is known at
        once and contains the faces.

        >>> cube.bounds.tolist()
        [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]
        """
        if self._bounds is None:
            box = np.array([np.full(3, np.inf), np.full(3, -np.inf)])

            def take(some: Any) -> None:
                corners = copied(some.corners, (some.count * 3, 3), np.float64)
                np.minimum(box[0], corners.min(axis=0, initial=np.inf), out=box[0])
                np.maximum(box[1], corners.max(axis=0, initial=-np.inf), out=box[1])

            self._triangles(self.info.box[0], self.info.box[1], take)
            self._bounds = box
        return self._bounds.copy()

    @property
    def volume(self) -> float:
        """Return the volume in the model's unit cubed; nan: unknown. `measure` has bounds, area and inertia.

        >>> cube.volume
        1.0
        """
        if self._mass is None:
            self._mass = self.measure()
        return self._mass.volume

    def sample(self, names: str, points: ArrayLike, faces: ArrayLike) -> Doubles:
        """Return attributes at points on faces, such as results of `distance` and `ray`.

        names: attribute names separated by commas: "red,green,blue", "face:label". Values of vertices are
            interpolated at the point.
        points: (..., 3). faces: (...) integers, -1: no face.

        Returns (..., columns) float64; nan where there is no face. The model keeps the attributes and the mesh in
        memory until it is closed. Raises AbsentError when an attribute does not exist.
        """
        rows = Rows(points)
        numbers = integers(faces, np.int64, "faces")
        if numbers.shape != rows.shape:
            raise ValueError(f"points of the shape {(*rows.shape, 3)} and faces of the shape {numbers.shape}")
        numbers = numbers.reshape(-1)
        with self._lock:
            if names not in self._samplers:
                self._samplers[names] = Handle.made("ebpo_sampler_new", self.file, names, self._threads,
                                                    free="ebpo_sampler_free", keep=(self.file,))
            sampler = self._samplers[names]
        out = np.empty((rows.count, lib.ebpo_sampler_columns(sampler)))
        given = rows[0:rows.count].copy()
        given[numbers < 0] = 0  # a point without a face may be nan
        call("ebpo_sample", sampler, given.ctypes.data, numbers.ctypes.data, rows.count, out.ctypes.data)
        return rows.result(out, np.nan)

    def measure(self, *, threads: int | None = None) -> Mass:
        """Return area, volume, centroid and inertia.

        >>> cube.measure().volume, cube.measure().area
        (1.0, 6.0)
        """
        mass = made(c.ebpo_mass)
        call("ebpo_measure", self.file, threads or self._threads, ctypes.byref(mass))
        return Mass(mass.area, mass.volume, np.array(mass.centroid), np.array(np.ctypeslib.as_array(mass.inertia)),
                    (mass.volume_lo, mass.volume_hi), mass.integral, mass.integral_error, mass.centroid_error,
                    mass.caps_integral, mass.caps_centroid)

    # ---- parts ----

    def mesh(self, *, order: Literal["file", "source"] = "file") -> Mesh:
        """Return the whole mesh.

        order: "file"; "source": vertices and faces equal those of the PLY file bit for bit.

        Returns vertices and faces: read-only arrays in memory of the library.

        >>> vertices, faces = cube.mesh()
        >>> vertices.shape, faces.shape
        ((8, 3), (12, 3))
        """
        return read_mesh(self.file, order, self._threads)

    def maps(self) -> Maps:
        """Return the source indices of the file's vertices and faces. Raises AbsentError when the file has none."""
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

    def surface(self, *, eye: ArrayLike | None = None, pixels: float = 0, level: int | None = None,
                direction: ArrayLike = (0, 0, 0), up: ArrayLike = (0, 1, 0), fov: float = 45,
                size: tuple[int, int] = (1280, 720), bytes: Size | None = None, faces: bool = False) -> Surface:
        """Return a mesh of the simplified surface (the file's part `surface`), without cracks.

        eye, direction, up, fov, size: the observer, as in ebpo_observer (ebpo/view.h); fov in degrees, size in
            pixels. Without an eye, all patches are equally fine; without a direction, all are visible.
        pixels: the allowed error in the image. 0: the finest patches.
        level: the deepest level of patches. bytes: limit of bytes read from the file since it was opened.
        faces: read faces of the model where the finest patches are too coarse.

        Raises AbsentError if the file has no part `surface`.
        """
        observer = None if eye is None else observer_of(eye, direction, up, fov, size)
        if observer is None and pixels:
            raise ValueError("pixels needs an eye")
        return read_surface(self.file, observer, priority=c.EBPO_PRIORITY_LEVEL, pixels=float(pixels), faces=faces,
                            level=-1 if level is None else within(index_of(level, "level"), 0, c.EBPO_LEVELS_MAX - 1, "level"),
                            bytes=size_in_bytes(bytes))

    def octcode(self, point: ArrayLike, level: int) -> int:
        """Return the octcode of the cell of a level that contains a point. Returns 0 for a point outside the root cell.

        >>> cube.octcode([.1, .1, .1], 1)
        8
        """
        given = doubles(point, "the point")
        if given.shape != (3,):
            raise ValueError("octcode() takes one point of three numbers")
        level = within(index_of(level, "level"), 0, c.EBPO_LEVELS_MAX - 1, "level")
        return int(lib.ebpo_octcode_at(lib.ebpo_file_info(self.file), given.ctypes.data, level))

    def subtree(self, octcode: int = 1, *, levels: int | None = None, memory: Size | None = None,
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

    def as_trimesh(self) -> TrimeshLike:
        """Return an object with the queries of a trimesh.Trimesh: `contains`, `ray`, `nearest`, `bounds`."""
        from .adapters import TrimeshLike
        return TrimeshLike(self)

    def to_trimesh(self, *, process: bool = False) -> trimesh.Trimesh:
        """Return the mesh as a trimesh.Trimesh, in the source's order if the file has source indices.

        process: trimesh merges vertices and removes faces.
        """
        from .adapters import to_trimesh
        return to_trimesh(self, process)

    def to_pyvista(self, level: int | None = None) -> pyvista.PolyData:
        """Return the mesh, or the envelopes of a level with their nodes' data, as a pyvista.PolyData."""
        from .adapters import to_pyvista
        return to_pyvista(self, level)
