"""Contents of a file as arrays: facts, mesh, attributes, levels, subtrees."""
from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any, Iterator, NamedTuple

import numpy as np

from . import _declared as c
from ._checked import doubles, index_of, integers, members_of, within
from ._library import Handle, Struct, array, call, copied, lib, made, text
from .signatures import ArrayLike, Doubles, Int8s, Int32s, Int64s, Uint8s, Uint32s, Uint64s, Vertices


class Mesh(NamedTuple):
    """A triangle mesh.

    vertices: (v, 3) float32 or float64, the type of the source, in the model's unit.
    faces: (f, 3) uint32, vertex indices, counter-clockwise seen from outside.
    """

    vertices: Vertices
    faces: Uint32s


class Maps(NamedTuple):
    """Indices in the source, for each vertex and face of the file.

    vertex: (v,) uint32. face: (f,) uint32.

    Faces that fill holes have indices from `info.source_face_count` on.
    """

    vertex: Uint32s
    face: Uint32s


class Level(NamedTuple):
    """The envelopes of a level: closed convex polyhedra that contain the solid, as triangles.

    vertices: (v, 3) float64, in the model's unit; nodes share no vertices.
    faces: (f, 3) uint32.
    node: (f,) int64, the index of the face's node in the following arrays of n nodes.
    octcode: (n,) uint64.
    type: (n,) int8, a NodeType.
    winding: (n,) int32; of a black node: in its cell; of a leaf: at its lowest corner; else 0.
    volume: (n,) float64, the volume of each envelope, in the model's unit cubed.
    colour: (n, 3) uint8, sRGB, or None when the file has no colours of nodes.
    """

    vertices: Vertices
    faces: Uint32s
    node: Int64s
    octcode: Uint64s
    type: Int8s
    winding: Int32s
    volume: Doubles
    colour: Uint8s | None


class Surface(NamedTuple):
    """A mesh of the simplified surface, for pictures.

    vertices: (v, 3) float64, in the model's unit. faces: (f, 3) uint32. normals: (v, 3) float32.
    colours: (v, 3) uint8, sRGB, or None when the file has none.
    error: float, the greatest distance of a patch from the model, in the model's unit.
    pixels: float, the greatest error of a visible patch in the image; nan without an eye.
    patches: int, the number of patches. model_faces: int, the number of faces of the model among `faces`.
    """

    vertices: Doubles
    faces: Uint32s
    normals: Vertices
    colours: Uint8s | None
    error: float
    pixels: float
    patches: int
    model_faces: int


class Mass(NamedTuple):
    """Area, volume, centroid and inertia, in powers of the model's unit; inertia for density 1.

    area: float.
    volume: float, the volume of the points that are inside by the file's rule. nan: unknown, because
        components intersect or coincide, or the mesh is not a 2-manifold. 0 for a surface
        without the part `border`, as are all following members. A surface with this part is measured with its caps.
    centroid: (3,). inertia: (3, 3), about the centroid. When the volume is nan, the winding number is the
        density.
    volume_bounds: (2,), guaranteed bounds of the volume.
    integral: float, the integral of the winding number. It equals the volume when winding numbers are only
        0 and 1.
    integral_error: float, centroid_error: float, of a surface with its border: bounds of rounding errors.
    caps_integral: float, caps_centroid: float, greatest differences that other caps in the hulls of their loops
        could make to the integral and the centroid. inf: no bound.
    """

    area: float
    volume: float
    centroid: Doubles
    inertia: Doubles
    volume_bounds: tuple[float, float]
    integral: float
    integral_error: float
    centroid_error: float
    caps_integral: float
    caps_centroid: float


class Info:
    """The facts of a file. Their names are those of the members of `ebpo_info`, which ebpo/file.h describes.

    Texts are str, digests are hexadecimal, arrays are numpy arrays. These facts have another form:

    box: (2, 3) float64, lower and upper corner of the root cell.
    rule: a Rule.
    parts: a set of names, such as {"planes", "mesh"}.
    codec, selection: int.
    format: a text such as "1.1".
    levels: a structured array with one row for each level: gray_count, leaf_count, ... of ebpo_level_summary.
    source: the opened path, URL or object, as a text.
    """

    def __init__(self, struct: Any, source: str) -> None:
        self._facts: dict[str, Any] = {"source": source}
        for name, _ in struct._fields_:
            self._facts[name] = self._plain(getattr(struct, name), name)
        facts = self._facts
        facts["format"] = f"{struct.version_major}.{struct.version_minor}"
        facts["rule"] = c.Rule(struct.rule)
        facts["parts"] = {part.name.lower() for part in c.Part if struct.parts & part}
        facts["box"] = np.array([facts["box_origin"], facts["box_origin"] + facts["box_size"]])
        facts["levels"] = facts.pop("level")[:struct.level_count]

    @staticmethod
    def _plain(value: Any, name: str) -> Any:
        if isinstance(value, bytes):
            return text(value)
        if isinstance(value, ctypes.Array):
            if name.endswith("sha256") or name == "subset_of":
                return bytes(value).hex()
            return np.array(np.ctypeslib.as_array(value))
        if isinstance(value, ctypes.Structure):
            return {n: Info._plain(getattr(value, n), n) for n, _ in members_of(value)}
        return value

    def __getattr__(self, name: str) -> Any:
        try:
            return self.__dict__["_facts"][name]
        except KeyError:
            raise AttributeError(f"there is no fact {name!r}; dir(info) lists the facts") from None

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._facts]

    def __reduce__(self) -> Any:
        return _info_again, (self._facts,)

    def __repr__(self) -> str:
        kind = "solid" if self.solid else "surface"
        return f"<ebpo.Info of {self.source}: a {kind} of {self.face_count} faces, {self.level_count} levels>"


def _info_again(facts: dict) -> Info:
    info = Info.__new__(Info)
    info._facts = facts
    return info


def mesh_of(struct: Struct) -> Mesh:
    mesh = struct.c
    if mesh.xyz64:
        vertices = array(struct, mesh.xyz64, (mesh.vertex_count, 3), np.float64)
    else:
        vertices = array(struct, mesh.xyz32, (mesh.vertex_count, 3), np.float32)
    return Mesh(vertices, array(struct, mesh.faces, (mesh.face_count, 3), np.uint32))


def read_mesh(file: Handle, order: str, threads: int) -> Mesh:
    if order not in ("file", "source"):
        raise ValueError(f"order is 'file' or 'source', not {order!r}")
    options = made(c.ebpo_read_options, threads=threads)
    mesh = Struct(c.ebpo_mesh, "ebpo_mesh_free")
    if order == "file":
        call("ebpo_file_read_mesh", file, ctypes.byref(options), mesh)
    else:
        is_source = ctypes.c_bool()
        call("ebpo_file_read_source_mesh", file, ctypes.byref(options), mesh, ctypes.byref(is_source))
        if not is_source:
            raise LookupError("the file has no source indices, so the order of the source is unknown")
    return mesh_of(mesh)


def read_maps(file: Handle, info: Info, threads: int) -> Maps:
    options = made(c.ebpo_read_options, threads=threads)
    maps = Struct(c.ebpo_maps, "ebpo_maps_free")
    call("ebpo_file_read_maps", file, ctypes.byref(options), maps)
    return Maps(array(maps, maps.c.vertex_source, (info.vertex_count,), np.uint32),
                array(maps, maps.c.face_source, (info.face_count,), np.uint32))


def read_level(file: Handle, level: int, cell_faces: bool, threads: int, progress: Any) -> Level:
    options = made(c.ebpo_lod_options, cell_faces=cell_faces, threads=threads, progress=progress)
    mesh = Struct(c.ebpo_mesh, "ebpo_mesh_free")
    nodes = Struct(c.ebpo_lod_nodes, "ebpo_lod_nodes_free")
    call("ebpo_lod_level_nodes", file, level, ctypes.byref(options), mesh, nodes, None)
    vertices, faces = mesh_of(mesh)
    rows = copied(nodes.c.nodes, (nodes.c.node_count,), np.dtype(c.ebpo_lod_node))
    corners = array(nodes, nodes.c.corners, (nodes.c.polygon_count,), np.uint8)
    whose = np.repeat(np.arange(len(rows)), rows["polygon_count"])
    colour = None
    if rows["coloured"].any():
        colour = np.stack([rows["colour"] >> shift & 255 for shift in (0, 8, 16)], axis=1).astype(np.uint8)
    return Level(vertices, faces, np.repeat(whose, corners - 2), rows["octcode"].copy(),
                 rows["type"].astype(np.int8), rows["winding"].copy(), rows["volume"].copy(), colour)


def observer_of(eye: ArrayLike, direction: ArrayLike, up: ArrayLike, fov: float, size: tuple[int, int]) -> Any:
    given = {name: doubles(value, name) for name, value in (("eye", eye), ("direction", direction), ("up", up))}
    for name, value in given.items():
        if value.shape != (3,):
            raise ValueError(f"{name} must be three numbers")
    width, height = (within(index_of(n, "size"), 1, 2**31 - 1, "size") for n in size)
    return made(c.ebpo_observer, **{name: tuple(value) for name, value in given.items()}, fov=float(fov), width=width,
                height=height)


def read_surface(file: Handle, observer: Any, **members: Any) -> Surface:
    options = made(c.ebpo_view_options, planes=False, observer=ctypes.addressof(observer) if observer else None,
                   **members)
    stream = Handle.made("ebpo_view_stream_new", file, ctypes.byref(options), free="ebpo_view_stream_free", keep=(file,))
    mesh = Struct(c.ebpo_surface_mesh, "ebpo_surface_mesh_free")
    call("ebpo_view_stream_surface", stream, mesh)
    inner = mesh.c.mesh
    count = inner.vertex_count
    colours = array(mesh, mesh.c.colours.vertex, (count, 4), np.uint8)
    return Surface(array(mesh, inner.xyz64, (count, 3), np.float64),
                   array(mesh, inner.faces, (inner.face_count, 3), np.uint32), array(mesh, mesh.c.normals, (count, 3), np.float32),
                   None if colours is None else colours[:, :3], mesh.c.error, mesh.c.pixels, mesh.c.patches, mesh.c.faces)


TYPES = [np.int8, np.uint8, np.int16, np.uint16, np.int32, np.uint32, np.float32, np.float64]


def facts_of(facts: Any) -> dict[str, Any]:
    return {"element": text(facts.element), "names": text(facts.names).split(" "), "dtype": np.dtype(TYPES[facts.type]),
            "rows": facts.rows, "list": bool(facts.list), "range": tuple(facts.range) if facts.has_range else None}


def shaped(owner: Any, values: Any, about: dict[str, Any], column: int) -> Any:
    """Return a column of an array of attributes, or its rows if they are lists."""
    flat = array(owner, values.values, (values.count,), about["dtype"])
    if values.ends:
        ends = array(owner, values.ends, (about["rows"],), np.uint64)
        return np.split(flat, ends[:-1].astype(np.int64))
    if not about["rows"]:
        return flat
    rows = flat.reshape(about["rows"], -1)
    return rows[:, column] if not about["list"] and (len(about["names"]) > 1 or rows.shape[1] == 1) else rows


def mesh_attributes(mesh: Struct) -> dict[str, Any]:
    """Return the attributes of a mesh in memory, by "element:name"."""
    found: dict[str, Any] = {}
    number, facts, values = 0, made(c.ebpo_attribute_facts), c.ebpo_attribute_values()
    while lib.ebpo_mesh_attribute(mesh, number, ctypes.byref(facts), ctypes.byref(values)):
        about = facts_of(facts)
        for column, name in enumerate(about["names"]):
            found[f"{about['element']}:{name}"] = shaped(mesh, values, about, column)
        number += 1
    return found


class AttributeNameError(KeyError):
    """The file has no attribute of this name. The message lists the attributes."""

    def __str__(self) -> str:
        return str(self.args[0])


class Attributes(Mapping[str, Any]):
    """The attributes of the source: values of vertices, faces and other elements, except positions and corners.

    A mapping from "element:name", such as "vertex:red", to arrays. An array is read when it is accessed.
    It has a row for each vertex or face, in the order of the file (`Model.maps` has the source indices).
    A name without an element means the first attribute of that name, vertices first.
    Lists of equal length are an array with one row for each list. Lists of different lengths are a list of
    arrays.

    >>> sorted(cube.attributes)
    []
    """

    def __init__(self, file: Handle, threads: int) -> None:
        self._file, self._threads = file, threads
        self._columns: dict[str, tuple[int, int]] = {}
        number, facts = 0, made(c.ebpo_attribute_facts)
        while lib.ebpo_file_attribute(file, number, ctypes.byref(facts)):
            for column, name in enumerate(text(facts.names).split(" ")):
                self._columns.setdefault(f"{text(facts.element)}:{name}", (number, column))
            number += 1

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def _find(self, name: str) -> tuple[int, int]:
        found = [key for key in self._columns if key == name or key.partition(":")[2] == name]
        if not found:
            known = ", ".join(self._columns) or "none"
            raise AttributeNameError(f"the file has no attribute {name!r}; its attributes: {known}")
        found.sort(key=lambda key: (not key.startswith("vertex:"), not key.startswith("face:")))
        return self._columns[name if name in self._columns else found[0]]

    def __repr__(self) -> str:
        return f"<ebpo.Attributes: {', '.join(self._columns) or 'none'}>"

    def facts(self, name: str) -> dict[str, Any]:
        """Return element, names, type, row count and range of the array with an attribute. Reads no values."""
        facts = made(c.ebpo_attribute_facts)
        lib.ebpo_file_attribute(self._file, self._find(name)[0], ctypes.byref(facts))
        return facts_of(facts)

    def __getitem__(self, name: str) -> Any:
        number, column = self._find(name)
        about = self.facts(name)
        options = made(c.ebpo_read_options, threads=self._threads)
        values = Struct(c.ebpo_attribute_values, "ebpo_attribute_values_free")
        call("ebpo_file_read_attribute", self._file, number, ctypes.byref(options), values)
        return shaped(values, values.c, about, column)


class Subtree:
    """A subtree of the octree, as read-only arrays in memory of the library.

    The n nodes are sorted by level, then by octcode:

    level: the level of the root.
    level_first: (levels + 1,) the first node of each level.
    octcode: (n,) uint64.
    type: (n,) uint8, a NodeType.
    winding: (n,) int32, or None.
    children: (n,) uint32, the first of the eight children in octant order. NO_CHILDREN: the subtree has no
        children of the node.
    plane_first: (n + 1,) uint32, the index of each node's first plane in `planes`; None without planes.
    planes: uint32 plane codes (see `half_spaces`).
    above_first, above_planes: the same for the nodes above the root.

    Arrays of faces are None when the file has no mesh or `levels` was given:

    vertices: (v, 3) float32 or float64.
    faces: (f, 3) uint32, indices in `vertices`.
    shared_count: the number of shared faces, which are the first ones; other subtrees own them.
    file_faces: (f,) uint32, the index of each face in the file.
    source: (f,) uint32, the index of each face in the source, or None.
    list_first: (n + 1,) uint32, the index of each leaf's first face in `list`.
    """

    NO_CHILDREN = 2**32 - 1

    def __init__(self, file: Handle, octcode: int, levels: int | None, memory: int, or_leaf_above: bool) -> None:
        options = made(c.ebpo_subtree_options, memory=memory, or_leaf_above=or_leaf_above)
        if levels is not None:
            options.levels = levels
        self._handle = Handle.made("ebpo_subtree_open", file, octcode, ctypes.byref(options),
                                   free="ebpo_subtree_close")
        nodes = made(c.ebpo_subtree_nodes)
        lib.ebpo_subtree_get_nodes(self._handle, ctypes.byref(nodes))
        self._set_nodes(nodes)
        none: Any = None
        self.vertices = self.faces = self.file_faces = self.source = self.list_first = self.list = none
        self.shared_count = 0
        faces = made(c.ebpo_subtree_faces)
        from .errors import AbsentError
        try:
            call("ebpo_subtree_get_faces", self._handle, ctypes.byref(faces))
        except AbsentError:
            return
        self._set_faces(faces)

    def _array(self, address: int | None, shape: tuple, dtype: Any) -> Any:
        return array(self._handle, address, shape, dtype)

    def _set_nodes(self, nodes: Any) -> None:
        count = self.node_count = nodes.node_count
        self.level = nodes.level
        self.level_first = self._array(nodes.level_first, (nodes.level_count + 1,), np.uint64)
        self.octcode = self._array(nodes.octcodes, (count,), np.uint64)
        self.type = self._array(nodes.types, (count,), np.uint8)
        self.winding = self._array(nodes.windings, (count,), np.int32)
        self.children = self._array(nodes.children, (count,), np.uint32)
        none: Any = None
        self.planes = self.plane_first = self.above_first = self.above_planes = none
        if nodes.plane_first:
            self.plane_first = self._array(nodes.plane_first, (count + 1,), np.uint32)
            self.planes = self._array(nodes.planes, (int(self.plane_first[-1]),), np.uint32)
        if nodes.above_first:
            self.above_first = self._array(nodes.above_first, (self.level + 1,), np.uint32)
            self.above_planes = self._array(nodes.above_planes, (int(self.above_first[-1]),), np.uint32)
        self.nbytes = nodes.memory

    def _set_faces(self, faces: Any) -> None:
        dtype = np.float64 if faces.xyz64 else np.float32
        self.vertices = self._array(faces.xyz64 or faces.xyz32, (faces.vertex_count, 3), dtype)
        self.faces = self._array(faces.faces, (faces.face_count, 3), np.uint32)
        self.file_faces = self._array(faces.file_faces, (faces.face_count,), np.uint32)
        self.source = self._array(faces.source, (faces.face_count,), np.uint32)
        self.shared_count = faces.shared_count
        self.list_first = self._array(faces.list_first, (self.node_count + 1,), np.uint32)
        self.list = self._array(faces.list, (int(self.list_first[-1]),), np.uint32)

    def faces_of(self, node: int) -> Uint32s:
        """Return the faces of a leaf, as indices of rows of `faces`."""
        faces: Uint32s = self.list[self.list_first[node]:self.list_first[node + 1]]
        return faces

    def __repr__(self) -> str:
        return f"<ebpo.Subtree {int(self.octcode[0]):o}: {self.node_count} nodes>"


def half_spaces(codes: ArrayLike) -> tuple[Int32s, Int32s]:
    """Return the half-spaces of plane codes, in coordinates xi from 0 to 1 in the node's cell.

    codes: (k,) uint32.

    Returns n: (k, 3) int32, of 1-norm 511, and d: (k,) int32. The half-space is 4096 n . xi <= d.

    Raises ValueError for a code that is not a plane.

    >>> n, d = half_spaces([511 | 1022 << 10 | 1000 << 20])
    >>> n.tolist()
    [[0, 511, 0]]
    """
    codes = integers(codes, np.uint32, "codes").ravel()
    n, d = np.zeros((len(codes), 3), np.int32), np.zeros(len(codes), np.int32)
    for i, code in enumerate(codes.tolist()):
        if not lib.ebpo_plane_decode(code, n[i].ctypes.data, d[i:].ctypes.data):
            raise ValueError(f"{code:#x} is not the code of a plane")
    return n, d
