"""Reads ranges of points from files, and writes files that are replaced atomically."""
from __future__ import annotations

import contextlib
import os
import pathlib
import uuid
from typing import Any, Iterator, NamedTuple

import numpy as np

from ._checked import doubles
from .queries import CODES, holds_codes
from .errors import FormatError, IOFailure

HDF5 = (".h5", ".hdf5", ".hdf", ".nc")


@contextlib.contextmanager
def published(path: Any, *, new: bool = False) -> Iterator[Any]:
    """Yield a file for writing; it replaces `path` after all its bytes are on the disk.

    new: raise FileExistsError when `path` exists by then. File systems without hard links cannot detect it.
    """
    path = pathlib.Path(path)
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex[:12]}")
    try:
        with open(temporary, "xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        if new and links(temporary, path):
            return
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def links(there: pathlib.Path, path: pathlib.Path) -> bool:
    """Make a hard link. Returns False when the file system has no hard links."""
    try:
        os.link(there, path)
    except FileExistsError:
        raise
    except OSError:
        return False
    return True


class PointFile(NamedTuple):
    """Points in a file. Ranges of rows are read when they are needed.

    dataset: the HDF5 dataset.
    count: the number of points.
    stamp: size and modification time of the file when it was examined.
    """

    path: str
    dataset: str
    count: int  # type: ignore[assignment]
    columns: int
    stamp: tuple[int, int]

    @classmethod
    def at(cls, path: Any, dataset: str | None = None, columns: int = 3) -> PointFile:
        """Examine a .npy, an HDF5 dataset, or raw doubles in this machine's byte order.

        Raises FormatError when the file has another number of columns, or contains no numbers.
        """
        dtype = np.dtype(np.float64)
        path = os.path.abspath(os.fspath(path))
        if is_hdf5(path, dataset):
            with opened_hdf5(path) as file:
                dataset = dataset or only_dataset(file, path, columns)
                if dataset not in file or not hasattr(file[dataset], "shape"):
                    raise FormatError(f"{path}: dataset {dataset} not found", "EBPO_E_FORMAT", path)
                shape, dtype = file[dataset].shape, file[dataset].dtype
                if holds_codes(file[dataset]):
                    raise FormatError(f"{path}: {dataset} contains {CODES}", "EBPO_E_FORMAT", path)
        elif path.endswith(".npy"):
            shape, dtype = shape_of_npy(path)
        else:
            size = os.path.getsize(path)
            if size % (8 * columns):
                raise FormatError(f"{path}: {size} bytes are not rows of {columns} doubles", "EBPO_E_FORMAT", path)
            shape = (size // (8 * columns), columns)
        if len(shape or ()) != 2 or shape[1] != columns:
            raise FormatError(f"{path}: points have the shape (n, {columns}), not {shape}", "EBPO_E_FORMAT", path)
        if dtype.kind not in "fiu":
            raise FormatError(f"{path}: points are real numbers, not {dtype}", "EBPO_E_FORMAT", path)
        return cls(path, dataset or "", int(shape[0]), columns, stamp_of(path))

    def read(self, begin: int, end: int) -> np.ndarray:
        """Read rows as doubles. Raises IOFailure when the file has changed since it was examined."""
        if stamp_of(self.path) != self.stamp:
            raise IOFailure(f"{self.path} has changed since the query; query again", "EBPO_E_IO", self.path)
        if self.dataset:
            with opened_hdf5(self.path) as file:
                return doubles(file[self.dataset][begin:end], self.path)
        if self.path.endswith(".npy"):
            return doubles(load_npy(self.path)[begin:end], self.path)
        rows = np.fromfile(self.path, np.float64, (end - begin) * self.columns, offset=begin * 8 * self.columns)
        return rows.reshape(-1, self.columns)


def load_npy(path: str) -> np.ndarray:
    """Open a .npy as a memory map. Raises FormatError when it is not a complete array of numbers."""
    try:
        with np.errstate(over="ignore"):
            values = np.load(path, mmap_mode="r", allow_pickle=False)
    except OSError:
        raise
    except Exception as error:  # numpy raises several types, for example for negative or overflowing shapes
        raise FormatError(f"{path}: not a complete .npy of numbers: {error}", "EBPO_E_FORMAT", path) from None
    if not isinstance(values, np.ndarray):
        raise FormatError(f"{path}: not a .npy, but an archive of several arrays", "EBPO_E_FORMAT", path)
    return values


def shape_of_npy(path: str) -> tuple[tuple[int, ...], np.dtype]:
    values = load_npy(path)
    return values.shape, values.dtype


def is_hdf5(path: str, dataset: str | None) -> bool:
    return dataset is not None or path.endswith(HDF5)


def h5py_of(path: str) -> Any:
    try:
        import h5py
    except ImportError:
        raise ImportError(f"{path}: reading HDF5 needs h5py, which is not installed") from None
    return h5py


def opened_hdf5(path: str) -> Any:
    """Open an HDF5 file for reading. Opens it without a lock when the file system has no locks.

    Raises IOFailure when another program has the file open for writing.
    """
    import errno
    h5py = h5py_of(path)
    try:
        return h5py.File(path, "r")
    except OSError as failure:
        if "unable to lock file" not in str(failure):
            raise
        if failure.errno in (errno.EAGAIN, errno.EACCES):
            raise IOFailure(f"{path} is open for writing in another program; close it there first", "EBPO_E_IO",
                            path) from None
        return h5py.File(path, "r", locking=False)


def only_dataset(file: Any, path: str, columns: int) -> str:
    found: list[str] = []

    def visit(name: str, item: Any) -> None:
        if len(getattr(item, "shape", None) or ()) == 2 and item.shape[1] == columns \
                and item.dtype.kind in "fiu" and not holds_codes(item):
            found.append(name)

    file.visititems(visit)
    if len(found) != 1:
        some = "; name one (dataset=): " + ", ".join(found[:4]) + ", ..." * (len(found) > 4) if found else ""
        raise FormatError(f"{path}: {len(found)} datasets have {columns} columns of numbers{some}", "EBPO_E_FORMAT",
                          path)
    return found[0]


def stamp_of(path: str) -> tuple[int, int]:
    stat = os.stat(path)
    return stat.st_size, stat.st_mtime_ns


def save_array(path: Any, values: np.ndarray) -> None:
    with published(path) as file:
        np.lib.format.write_array(file, np.ascontiguousarray(values), allow_pickle=False)
