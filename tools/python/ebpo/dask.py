"""Point sets of any size on Dask: its threads, or a cluster of dask.distributed.

    from dask.distributed import Client
    import ebpo.dask

    client = Client("scheduler:8786")
    P = ebpo.dask.points("points.npy")                   # or .h5, raw doubles, a dask or numpy array
    inside = ebpo.dask.inside("https://example.org/scan.ebpo.h5", P, memory="2G")
    ebpo.dask.to_file(inside, "inside.npy")              # continues if it was stopped before

Results are dask arrays, which are computed when they are needed. Each worker opens the model, or the models
of a catalogue that its points need, by path or URL, and keeps them open between tasks. Results are equal
byte for byte for any number of workers and any size of chunks. Dask is imported when it is needed.
"""
from __future__ import annotations

import contextlib
import json
import os
import pathlib
import shutil
from typing import TYPE_CHECKING, Any, Iterable, Literal, NamedTuple, Union

import numpy as np

from . import catalogue as cat
from ._checked import doubles
from .catalogue import Catalogue
from .errors import ArgumentError
from .open_models import process_models
from .point_files import HDF5, PointFile, h5py_of, load_npy, published, save_array, shape_of_npy
from .signatures import ArrayLike, HttpOptions, NanPolicy, Size

if TYPE_CHECKING:
    from dask.array import Array as DaskArray
    from distributed import Client
    PointSet = Union[DaskArray, str, "os.PathLike[str]", ArrayLike]
    Models = Union[Catalogue, str, "os.PathLike[str]", Iterable[Union[str, "os.PathLike[str]"]]]

Query = Literal["inside", "winding", "locate", "distance", "ray"]

CHUNK = 1 << 18  # points of one task
DTYPES = {"inside": np.dtype(bool), "winding": np.dtype("i4"), "locate": cat.LOCATED, "distance": cat.NEAREST,
          "ray": cat.HIT}


class Nearest(NamedTuple):
    """dask arrays of `Catalogue.distance`: distance (n,), point (n, 3), normal (n, 3), face (n,), model (n,)."""

    distance: DaskArray
    point: DaskArray
    normal: DaskArray
    face: DaskArray
    model: DaskArray


class Hits(NamedTuple):
    """dask arrays of `Catalogue.ray`: t, face, side, model, each (n,)."""

    t: DaskArray
    face: DaskArray
    side: DaskArray
    model: DaskArray


def catalogue(model: Models, http: HttpOptions | None = None) -> Catalogue:
    """Return a catalogue of a Catalogue, its path (.json), a path or URL of a model, or a list of paths and URLs."""
    if isinstance(model, Catalogue):
        return model
    if isinstance(model, (str, os.PathLike)):
        if os.fspath(model).endswith(".json"):
            return Catalogue.open(os.fspath(model), http=http)
        return Catalogue.of([model], http=http)
    if isinstance(model, (list, tuple)):
        return Catalogue.of(model, http=http)
    raise TypeError(f"{type(model).__name__}: expected a path, a URL, a list of paths and URLs, or a Catalogue")


def points(source: PointSet, dataset: str | None = None, *, chunk: int = CHUNK, columns: int = 3) -> DaskArray:
    """Return a dask array (n, columns) of the points in a file. Workers read `chunk` rows at a time.

    source: the path of a .npy, an HDF5 file (with h5py; `dataset`, or the only suitable one), or raw
        doubles. All workers must see the same file under this path. Or a dask array, or any input of
        numpy.asarray.
    """
    import dask.array as da
    from dask.base import tokenize
    if chunk < 1:
        raise ValueError(f"chunk={chunk}: give 1 point or more")
    if isinstance(source, da.Array):
        return source.rechunk({1: source.shape[1]}) if source.ndim == 2 else source
    if not isinstance(source, (str, os.PathLike)):
        values = np.asanyarray(source)  # a masked array stays one
        if values.ndim != 2 or values.shape[1] != columns:
            raise ValueError(f"points have the shape (n, {columns}), not {values.shape}")
        return da.from_array(values, chunks=(chunk, columns))
    file = PointFile.at(source, dataset, columns)
    name = "ebpo-points-" + tokenize(tuple(file), chunk)
    begins = range(0, max(1, file.count), chunk)
    graph = {(name, i, 0): (read_rows, tuple(file), begin, min(file.count, begin + chunk))
             for i, begin in enumerate(begins)}
    sizes = tuple(min(file.count, begin + chunk) - begin for begin in begins)
    return da.Array(graph, name, (sizes, (columns,)), np.float64)


def read_rows(file: tuple, begin: int, end: int) -> np.ndarray:
    return PointFile(*file).read(begin, end)


class Means:
    """Options that influence neither results nor the names of result arrays."""

    def __init__(self, memory: Any, threads: int) -> None:
        self.options = {"memory": memory, "threads": threads}

    def __dask_tokenize__(self) -> str:
        return "ebpo-means"


def query_block(block: np.ndarray, what: str, models: Catalogue, means: Means, options: tuple,
                block_info: Any = None) -> np.ndarray:
    """Run the queries of one chunk, in a worker. block_info: Dask's description of the chunk's position."""
    block, query, rest = np.asanyarray(block), getattr(models, what), dict(options)
    rows = (block[:, :3], block[:, 3:]) if what == "ray" else (block,)
    try:
        return query(*rows, **rest, **means.options)
    except ArgumentError as error:
        begin = block_info[0]["array-location"][0][0] if block_info else np.nan
        if begin == begin:  # false for nan: Dask does not know the chunk's offset
            cat.numbered(error, int(begin))
        raise


def query(what: Query, model: Models, rows: PointSet, *, boundary: bool | None = None, signed: bool | None = None,
          max_distance: float | None = None, t_max: float | None = None, nan: NanPolicy | None = None,
          dataset: str | None = None, chunk: int = CHUNK, memory: Size | None = None, threads: int = 1,
          http: HttpOptions | None = None) -> DaskArray:
    """Return a dask array (n,) of results: bool, int32, or structured (`catalogue.LOCATED`, NEAREST, HIT).

    what: "inside", "winding", "locate", "distance" or "ray".
    model: a path or URL that each worker can open, a list of them, a Catalogue, or the path of one (.json).
    rows: input of `points`; for rays (n, 6), origins and directions.
    memory: budget in bytes for all models of a worker process, in this and later queries; initially 1 GiB.
    threads: number of threads for each chunk, in addition to the threads of Dask's workers.
    http: options for URLs, such as headers.
    boundary ... nan: arguments of the method of Catalogue. None: its default.

    Errors state the number of a point among all `rows`. When Dask does not know the sizes of chunks, the
    number is that within the chunk.
    """
    import dask.array as da
    if what not in DTYPES:
        raise ValueError(f"what={what!r}: only {', '.join(DTYPES)} can be queried")
    models = catalogue(model, http)
    options = {name: value for name, value in [("boundary", boundary), ("max_distance", max_distance), ("nan", nan),
                                               ("signed", signed), ("t_max", t_max)] if value is not None}
    given = points(rows, dataset, chunk=chunk, columns=6 if what == "ray" else 3)
    columns = 6 if what == "ray" else 3
    if given.ndim != 2 or given.shape[1] != columns:
        raise ValueError(f"{what} takes the shape (n, {columns}), not {given.shape}")
    return da.map_blocks(query_block, given, what, models, Means(memory, threads), tuple(options.items()),
                         dtype=DTYPES[what], drop_axis=1, name=f"ebpo-{what}", meta=np.zeros(0, DTYPES[what]))


def inside(model: Models, rows: PointSet, *, boundary: bool = True, nan: NanPolicy = "raise",
           dataset: str | None = None, chunk: int = CHUNK, memory: Size | None = None, threads: int = 1,
           http: HttpOptions | None = None) -> DaskArray:
    """Return True for points inside: a dask array (n,) of bool. Arguments are those of `query`."""
    return query("inside", model, rows, boundary=boundary, nan=nan, dataset=dataset, chunk=chunk, memory=memory,
                 threads=threads, http=http)


def winding(model: Models, rows: PointSet, *, nan: NanPolicy = "raise", dataset: str | None = None, chunk: int = CHUNK,
            memory: Size | None = None, threads: int = 1, http: HttpOptions | None = None) -> DaskArray:
    """Return winding numbers, summed over models: a dask array (n,) of int32. Arguments are those of `query`."""
    return query("winding", model, rows, nan=nan, dataset=dataset, chunk=chunk, memory=memory, threads=threads,
                 http=http)


def distance(model: Models, rows: PointSet, *, max_distance: float = float("inf"), signed: bool = True,
             nan: NanPolicy = "raise", dataset: str | None = None, chunk: int = CHUNK, memory: Size | None = None,
             threads: int = 1, http: HttpOptions | None = None) -> Nearest:
    """Return nearest faces. Arguments are those of `query`. For files use `query("distance", ...)`."""
    return Nearest(*members(query("distance", model, rows, max_distance=max_distance, signed=signed, nan=nan,
                                  dataset=dataset, chunk=chunk, memory=memory, threads=threads, http=http)))


def ray(model: Models, origins: DaskArray | ArrayLike, directions: DaskArray | ArrayLike, *,
        t_max: float = float("inf"), nan: NanPolicy = "raise", chunk: int = CHUNK, memory: Size | None = None,
        threads: int = 1, http: HttpOptions | None = None) -> Hits:
    """Return the first hits of rays. Arguments are those of `query`.

    origins: dask or numpy (n, 3). directions: the same, or (3,).
    """
    import dask.array as da
    o = points(origins, chunk=chunk)
    if isinstance(directions, da.Array) or np.ndim(directions) == 2:
        d = points(directions).rechunk((o.chunks[0], 3))
    else:
        d = da.broadcast_to(da.from_array(doubles(directions, "directions")), o.shape, chunks=o.chunks)
    rays = da.concatenate([o, d], axis=1).rechunk({1: 6})
    return Hits(*members(query("ray", model, rays, t_max=t_max, nan=nan, chunk=chunk, memory=memory, threads=threads,
                               http=http)))


def members(rows: Any) -> list:
    return [rows[name] if not rows.dtype[name].shape else
            rows.map_blocks(member, name, dtype=np.float64, new_axis=1, chunks=(rows.chunks[0], rows.dtype[name].shape),
                            meta=np.zeros((0, 3)))
            for name in rows.dtype.names]


def member(block: np.ndarray, name: str) -> np.ndarray:
    return np.ascontiguousarray(block[name])


def stats(client: Client | None = None) -> dict[str, Any]:
    """Return `open_models.OpenModels.stats` of this process, or a dict with those of each worker of the client."""
    return process_models().stats() if client is None else client.run(worker_stats)


def worker_stats() -> dict:
    return process_models().stats()


# ---- files of results ----

def to_file(results: DaskArray, path: str | os.PathLike[str], *, dataset: str = "results",
            scheduler: str | Client | None = None) -> None:
    """Compute a dask array into a file: .npy, HDF5 (.h5, with h5py), or, for another name, a folder.

    Workers write their chunks to the folder PATH.parts, which they must share with this process. Each chunk
    is a file that is replaced atomically. A call after an interruption reuses the chunks that exist; chunks
    of another query are refused (ValueError). At the end the chunks are joined into the file, which is
    replaced atomically, and the folder is removed. When PATH has none of these suffixes, PATH is the folder
    of the chunks 000000.npy and so on.

    results: one array, which may be structured, as `query` returns it.
    scheduler: as for dask.compute, such as "threads" or a Client.

    Raises FileExistsError when the file exists.
    """
    import dask
    path = pathlib.Path(path).absolute()
    is_file = path.suffix in (".npy", *HDF5)
    if path.suffix in HDF5:
        h5py_of(str(path))  # fails before the computation when h5py is missing
    if is_file and path.exists():
        raise FileExistsError(f"{path} already exists")
    folder = path.with_name(path.name + ".parts") if is_file else path
    results = results.rechunk({axis: -1 for axis in range(1, results.ndim)})  # chunks of whole rows
    begin_parts(folder, results)
    blocks = results.to_delayed().ravel()
    names = [folder / f"{i:06d}.npy" for i in range(len(blocks))]
    dask.compute(*[dask.delayed(save_part)(str(name), block) for name, block in zip(names, blocks)
                   if not name.exists()], scheduler=scheduler)
    missing = [name for name in names if not name.exists()]
    if missing:
        raise FileNotFoundError(f"{missing[0]}: not found, but workers wrote it; all workers must share the folder")
    check_parts(names, results)
    if is_file:
        join_parts(path, names, dataset)
        shutil.rmtree(folder)


def begin_parts(folder: pathlib.Path, results: DaskArray) -> None:
    query = {"query": results.name, "chunks": results.numblocks[0], "dtype": repr(results.dtype)}
    folder.mkdir(parents=True, exist_ok=True)
    stated = folder / "query.json"
    if not stated.exists():
        if any(name.name[0] != "." for name in folder.iterdir()) and not stated.exists():
            raise ValueError(f"{folder} is not empty and has no query.json; remove the folder, or use another name")
        with contextlib.suppress(FileExistsError), published(stated, new=True) as file:
            file.write(json.dumps(query).encode())
    if json.loads(stated.read_bytes()) != query:  # another process may have begun at the same time
        raise ValueError(f"{folder} holds results of another query, or of other chunks; remove the folder, or use "
                                          "another name")


def save_part(name: str, block: np.ndarray) -> None:
    save_array(name, block)


def check_parts(names: list, results: Any) -> None:
    """Raise ValueError when a chunk file is not part of these results. Unknown row counts are NaN."""
    for name, rows in zip(names, results.chunks[0]):
        try:
            part = load_npy(str(name))
        except ValueError as error:
            raise ValueError(f"{name}: not a chunk of results ({error}); remove the file to compute it again") from None
        if part.dtype != results.dtype or (rows == rows and len(part) != rows):
            raise ValueError(f"{name}: expected {rows} rows of {results.dtype}, got {len(part)} of {part.dtype}; "
                                              "remove the file to compute it again")


def join_parts(path: pathlib.Path, names: list, dataset: str) -> None:
    """Join complete chunks into the file. Opens one chunk at a time."""
    heads = [shape_of_npy(str(name)) for name in names]
    shape, dtype = (sum(rows for (rows, *_), _ in heads), *heads[0][0][1:]), heads[0][1]
    parts = (load_npy(str(name)) for name in names)
    if path.suffix == ".npy":
        with published(path) as file:
            np.lib.format.write_array_header_1_0(file, {"descr": np.lib.format.dtype_to_descr(dtype),
                                                        "fortran_order": False, "shape": shape})
            for part in parts:
                file.write(np.ascontiguousarray(part).data)
        return
    with published(path) as file, h5py_of(str(path)).File(file, "w") as out:
        made, at = out.create_dataset(dataset, shape, dtype), 0
        for part in parts:
            made[at:at + len(part)] = part
            at += len(part)
