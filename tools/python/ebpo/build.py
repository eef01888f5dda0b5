"""Converts a mesh to a file. Needs a library with libhdf5."""
from __future__ import annotations

import ctypes
import os
import warnings
from typing import Any, Iterable

import numpy as np

from . import _declared as c
from ._checked import doubles, integers, path
from ._library import Handle, Reporter, Struct, call, lib, made, size_in_bytes
from .errors import ExistingFileError
from .model import Model
from .model import open as open_model
from .signatures import AnyMesh, CodecName, Path, Progress, RuleName, Size

# Units of length. Others are stored too, with a warning.
UNITS = {"m", "dm", "cm", "mm", "um", "\u00b5m", "nm", "km", "in", "inch", "ft", "foot", "yd", "mi", "metre", "meter",
         "centimetre", "centimeter", "millimetre", "millimeter", "kilometre", "kilometer", "micrometre", "micrometer",
         "US survey foot"}
PARTS = {"mesh": c.EBPO_PART_MESH, "maps": c.EBPO_PART_MAPS, "attributes": c.EBPO_PART_ATTRIBUTES,
         "envelopes": c.EBPO_PART_PLANES, "leaf-planes": c.EBPO_PART_LEAF_PLANES, "colours": c.EBPO_PART_COLOURS,
         "border": c.EBPO_PART_BORDER, "surface": c.EBPO_PART_SURFACE}
DEFAULT_PARTS = sum(PARTS.values()) & ~(c.EBPO_PART_LEAF_PLANES | c.EBPO_PART_SURFACE)
NEEDS = {"maps": "mesh", "attributes": "mesh", "border": "mesh", "surface": "mesh", "colours": "attributes"}
CODECS = {"zstd": c.EBPO_CODEC_ZSTD, "deflate": c.EBPO_CODEC_DEFLATE, "none": c.EBPO_CODEC_NONE}
RULES = {rule.name.lower(): int(rule) for rule in c.Rule}


def convert(mesh: AnyMesh, output: Path, *, overwrite: bool = False, parts: str | Iterable[str] | None = None,
            weld: bool = False, weld_distance: float | None = None, orient: bool = False, fill_holes: bool = False,
            flip: bool = False, drop_duplicates: bool = False, require_solid: bool = False,
            rule: RuleName = "nonzero", max_level: int | None = None, leaf_faces: int | None = None,
            epsilon: float | None = None, seed: int | None = None, unit: str | None = None, crs: str | None = None,
            date: str | None = None, codec: CodecName = "zstd", codec_level: int = 0, memory: Size | None = None,
            temp_dir: Path | None = None, threads: int | None = None, progress: Progress | None = None) -> Model:
    """Convert a mesh to an .ebpo.h5 file, which is written atomically, and open it.

    mesh: the path of a PLY, OBJ, STL or OFF; (vertices, faces); a mesh or scene of trimesh; a mesh of Open3D; or
        PolyData of PyVista. Vertices and faces are used. vertices: (v, 3); float32 is stored as float32, other types
        as float64.
        faces: (f, 3) integers.
    overwrite: replace an existing file. False: raise ExistingFileError, which is a FileExistsError.
    parts: as `ebpo convert --parts`: the parts to store, such as
        "mesh,maps,attributes,envelopes,leaf-planes,colours,border,surface", or parts to omit or to add with a sign
        before each, such as "-maps,+surface"; or a list of such names. None: all except leaf-planes and surface.
    weld, weld_distance, orient, fill_holes, flip, drop_duplicates: repair the mesh, as the command
        `ebpo convert` does with these options.
    rule: "nonzero", "evenodd" or "positive": the winding numbers that are inside.
    max_level, leaf_faces, epsilon, seed: as in ebpo_build_options, ebpo/build.h. None: the default of the command;
        files are then equal to those of the command byte for byte.
    unit, crs, date: recorded in the file, such as "mm", "EPSG:25832" and "2026-03-01".
    codec: "zstd", "deflate" or "none".
    memory: budget in bytes for the process; the rest is stored in temporary files in temp_dir. None: half
        of the machine's memory.

    Warns of data that is lost while reading, such as digits that a PLY's floats do not keep, and of an unknown unit.

    Raises NotSolidError with require_solid, UnsupportedError when the library was built without libhdf5,
    FormatError, IOFailure (a missing mesh: MissingFileError, which is a FileNotFoundError).

    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> m = convert((corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]), "corner.ebpo.h5")
    >>> m.info.solid, m.info.face_count
    (True, 4)
    """
    if date and not lib.ebpo_is_date(date):
        raise ValueError(f"date: {date!r} is not a valid date in ISO 8601, such as 2026-11-26")
    for what, given, known in (("rule", rule, RULES), ("codec", codec, CODECS)):
        if given not in known:
            raise ValueError(f"{what}: expected one of {', '.join(map(repr, known))}, not {given!r}")
    stored = parts_of(parts)
    call("ebpo_register_filters")  # fails before the work when the library has no libhdf5
    if not overwrite and os.path.lexists(output):
        name = os.fsdecode(output)
        raise ExistingFileError(f"{name}: the file exists; replace it with overwrite=True, or give another name",
                                "EBPO_E_IO", name)
    call("ebpo_check_output", path(output, "output"))
    space = made(c.ebpo_workspace_options, memory=size_in_bytes(memory),
                 temp_dir=None if temp_dir is None else path(temp_dir, "temp_dir"))
    workspace = Handle.made("ebpo_workspace_new", ctypes.byref(space), free="ebpo_workspace_free")
    with Reporter(progress) as reported:
        common = {"threads": threads or 0, "progress": reported}
        read = read_mesh(mesh, workspace, bool(stored & c.EBPO_PART_ATTRIBUTES), common)
        prepare = made(c.ebpo_prepare_options, weld=weld, orient=orient, fill_holes=fill_holes, flip=flip,
                       drop_duplicates=drop_duplicates, **given_of(weld_distance=weld_distance), **common)
        prepared = made(c.ebpo_prepared)
        call("ebpo_mesh_prepare", read, ctypes.byref(prepare), ctypes.byref(prepared))
        build = made(c.ebpo_build_options, parts=stored, rule=RULES[rule], require_solid=require_solid,
                     **given_of(max_level=max_level, leaf_faces=leaf_faces, epsilon=epsilon, seed=seed, unit=unit,
                                crs=crs, date=date), **common)
        tree = Struct(c.ebpo_tree, "ebpo_tree_free", workspace)
        call("ebpo_build", read, ctypes.byref(prepared.report), ctypes.byref(prepared.record),
             ctypes.byref(build), tree)
        write = made(c.ebpo_write_options, codec=CODECS[codec], codec_level=codec_level, **common)
        call("ebpo_tree_write", tree, path(output, "output"), ctypes.byref(write))
    if unit and unit not in UNITS:
        warnings.warn(f"unit: {unit!r} is not a known unit of length, such as 'mm'; it is stored as it is", stacklevel=2)
    return open_model(output)


def given_of(**values: Any) -> dict[str, Any]:
    """Return the values that are not None."""
    return {name: value for name, value in values.items() if value is not None}


def parts_of(parts: str | Iterable[str] | None) -> int:
    """Return the bits of parts, which have the names of `ebpo convert --parts`. Raises ValueError for another list."""
    if parts is None:
        return DEFAULT_PARTS
    given = parts.split(",") if isinstance(parts, str) else list(parts)
    changes = {name[:1] in ("-", "+") for name in given} == {True}  # the parts of the default are changed
    names = {name for name, bit in PARTS.items() if changes and bit & DEFAULT_PARTS}
    for name in given:
        part = name[changes:]
        part = "envelopes" if part == "planes" else part  # the name in Info.parts
        if part not in PARTS:
            raise ValueError(f"parts: expected a list of {', '.join(PARTS)}, or of these names with a minus or plus "
                             f"sign before each, not {','.join(given)!r}")
        names = names - {part} if name.startswith("-") else names | {part}
    for name, needed in NEEDS.items():  # the order of NEEDS matters
        if name in names and needed not in names:
            if not changes or "+" + name in given:
                raise ValueError(f"parts: {name} needs {needed}; add it, not {','.join(given)!r}")
            names.remove(name)
    return sum(PARTS[name] for name in names)


def read_mesh(mesh: AnyMesh, workspace: Handle, attributes: bool, common: dict[str, Any]) -> Struct:
    """Return an ebpo_mesh of a file, or of arrays."""
    if isinstance(mesh, (str, bytes, os.PathLike)):
        options = made(c.ebpo_mesh_read_options, attributes=attributes, workspace=workspace.pointer, **common)
        read = Struct(c.ebpo_mesh, "ebpo_mesh_free", workspace)
        call("ebpo_mesh_read", path(mesh, "mesh"), ctypes.byref(options), read)
        ignored = lib.ebpo_mesh_ignored(read)
        if ignored:
            warnings.warn(f"{os.fsdecode(mesh)}: not read: {ignored.decode()}", stacklevel=3)
        return read
    from .adapters import arrays_of
    vertices, faces = arrays_of(mesh)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise ValueError(f"vertices are (v, 3) and faces (f, 3), not {vertices.shape} and {faces.shape}")
    faces = integers(faces, np.uint32, "faces")
    if faces.size and faces.max() >= len(vertices):
        raise ValueError("a face names a vertex that does not exist")
    single = vertices.dtype == np.float32 and not np.ma.is_masked(vertices)
    read = Struct(c.ebpo_mesh, "ebpo_mesh_free", workspace, vertex_count=len(vertices), face_count=len(faces))
    xyz = of_malloc(vertices if single else doubles(vertices, "vertices"))
    setattr(read.c, "xyz32" if single else "xyz64", xyz)
    read.c.faces = of_malloc(faces)
    read.c.workspace = workspace.pointer
    return read


def of_malloc(values: np.ndarray) -> int:
    """Return the address of a copy that free() frees."""
    values = np.ascontiguousarray(values)
    malloc = ctypes.CDLL(None).malloc
    malloc.restype, malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
    address = malloc(max(1, values.nbytes))
    if not address:
        raise MemoryError
    ctypes.memmove(address, values.ctypes.data, values.nbytes)
    return address
