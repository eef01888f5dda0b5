"""EBP-Octree in HDF5: .ebpo.h5 files and exact queries on them, with numpy arrays.

>>> import ebpo
>>> m = ebpo.open("cube.ebpo.h5")
>>> m.inside([[.5, .5, .5], [2, 0, 0]])
array([ True, False])

docs/guide/python.md describes the package; begin with `open` and `Model`.
"""
from __future__ import annotations

from ._declared import (ClashKind, NodeType, PaintKind, PairKind, Part, Relation, Rule, Where)
from ._library import lib as _lib
from .asynchronous import AsyncModel, open_async
from .queries import bar
from .boolean import boolean
from .catalogue import Catalogue
from .collide import Collider, pose
from .build import convert
from .errors import (AbsentError, ArgumentError, Cancelled, Error, ExistingFileError, FileAccessError, FolderError,
                     FormatError, IOFailure, LimitError, MissingFileError, NoMemory, NotSolidError, Pending,
                     UnsupportedError, VersionError)
from .model import Model, open
from .results import AllHits, Bounds, Hits, Located, Nearest
from .paint import Areas, Paint, Stroke
from .parts import Attributes, Info, Level, Maps, Mass, Mesh, Subtree, Surface, half_spaces
from .scene import Scene, open_scene
from .haptic import Haptic, HapticResult, ProbeResult

__version__: str = _lib.ebpo_version().decode()


def library() -> str:
    """Return the path or name of the shared library in use.

    The first of these is used: the value of the variable EBPO_LIBRARY, the library inside the package, the
    library in the installation prefix or build folder of the package, the library of the `ebpo` in PATH, the
    system's library.
    """
    return str(_lib.path)


__all__ = [
    "open", "Model", "open_async", "AsyncModel", "Info", "Located", "Nearest", "Bounds", "Hits", "AllHits", "Where",
    "Mesh", "Maps", "Level", "Subtree", "Surface", "Attributes", "Mass", "NodeType", "Part", "Rule", "half_spaces",
    "Catalogue", "Collider", "pose", "boolean", "Relation", "PairKind", "Scene", "open_scene", "ClashKind",
    "Haptic", "HapticResult", "ProbeResult", "Paint", "Stroke", "Areas", "PaintKind",
    "convert", "bar", "library",
    "Error", "ArgumentError", "IOFailure", "FormatError", "VersionError", "UnsupportedError", "NotSolidError",
    "LimitError", "Cancelled", "AbsentError", "NoMemory", "Pending", "MissingFileError", "FileAccessError",
    "FolderError", "ExistingFileError",
]
