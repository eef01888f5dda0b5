"""Types of arguments and results, for the signatures of this package."""
from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Callable, Literal, Mapping, Protocol, TypedDict, Union

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    Bools = NDArray[np.bool_]
    Doubles = NDArray[np.float64]
    Int8s = NDArray[np.int8]
    Int32s = NDArray[np.int32]
    Int64s = NDArray[np.int64]
    Uint8s = NDArray[np.uint8]
    Uint32s = NDArray[np.uint32]
    Uint64s = NDArray[np.uint64]
    Vertices = NDArray[Union[np.float32, np.float64]]
    Rows = NDArray[np.void]  # structured arrays
    AnyArray = NDArray[Any]
else:  # numpy before 1.20 has no numpy.typing
    ArrayLike = Bools = Doubles = Int8s = Int32s = Int64s = Uint8s = Uint32s = Uint64s = Vertices = Rows = AnyArray = \
        np.ndarray

#: A file name.
Path = Union[str, bytes, "os.PathLike[str]", "os.PathLike[bytes]"]

#: A size in bytes: 500000000, "500M", "2GiB".
Size = Union[int, str]

#: What to do with points or rays that contain NaN: raise ArgumentError, or return results without a value.
NanPolicy = Literal["raise", "propagate"]

Sides = Literal["both", "front", "back"]
RuleName = Literal["nonzero", "evenodd", "positive"]
CodecName = Literal["zstd", "deflate", "none"]


class HttpOptions(TypedDict, total=False):
    """Options for URLs. `ebpo.open` describes them."""

    storage_options: Mapping[str, Any]
    max_expansion: int
    headers: Mapping[str, str]
    user: str
    time_limit: float
    connect_timeout: float
    stall_timeout: float
    retries: int
    connections: int
    whole_limit: Size
    unversioned: bool
    netrc: bool
    ca_file: Path
    proxy: str
    user_agent: str
    cache_folder: Path
    cache_bytes: Size
    cache_block: int


class Bar(Protocol):
    """A progress bar, such as one of tqdm."""

    def update(self, n: Any = ...) -> object: ...

    def close(self) -> object: ...


#: A function progress(stage, done, total), which returns False to stop the work, or a class of bars, such as
#: tqdm.tqdm.
Progress = Union[Callable[[str, int, int], object], "type[Bar]"]


class ByteRanges(Protocol):
    """A source of bytes. Several threads call read_range at the same time."""

    @property
    def size(self) -> int: ...

    def read_range(self, offset: int, size: int) -> bytes: ...


class AsyncByteRanges(Protocol):
    """A source of bytes for asyncio. fetch returns the bytes of each (offset, size)."""

    @property
    def size(self) -> int: ...

    async def fetch(self, ranges: list[tuple[int, int]]) -> list[bytes]: ...


class SeekableFile(Protocol):
    """A binary file object."""

    def seek(self, offset: int, whence: int = ...) -> int: ...

    def read(self, size: int = ...) -> bytes: ...


#: Sources of `ebpo.open`: a path or URL, bytes (also mmap and arrays), a file object, an object with ranges.
Source = Union[Path, bytes, bytearray, memoryview, "np.ndarray", SeekableFile, ByteRanges]


class VerticesAndFaces(Protocol):
    """A mesh such as trimesh.Trimesh."""

    @property
    def vertices(self) -> Any: ...

    @property
    def faces(self) -> Any: ...


class VerticesAndTriangles(Protocol):
    """A mesh such as open3d.geometry.TriangleMesh."""

    @property
    def vertices(self) -> Any: ...

    @property
    def triangles(self) -> Any: ...


class PolygonData(Protocol):
    """A mesh such as pyvista.PolyData."""

    @property
    def points(self) -> Any: ...

    @property
    def faces(self) -> Any: ...

    def triangulate(self) -> Any: ...


class VertexAndTriangle(Protocol):
    """A mesh such as open3d.t.geometry.TriangleMesh."""

    @property
    def vertex(self) -> Any: ...

    @property
    def triangle(self) -> Any: ...


class Geometries(Protocol):
    """A scene such as trimesh.Scene."""

    @property
    def geometry(self) -> Any: ...

    def to_mesh(self) -> Any: ...


#: Meshes of `ebpo.convert`: a path, (vertices, faces), or an object of trimesh, Open3D or PyVista.
AnyMesh = Union[Path, "tuple[ArrayLike, ArrayLike]", VerticesAndFaces, VerticesAndTriangles, PolygonData,
                VertexAndTriangle, Geometries]
