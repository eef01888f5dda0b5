"""Meshes of unions, intersections and differences of models."""
from __future__ import annotations

import ctypes
import math
import re
from typing import TYPE_CHECKING, Any, NamedTuple, Sequence

import numpy as np

from . import _declared as c
from ._checked import doubles as to_doubles
from ._checked import path
from ._library import Handle, Reporter, Struct, call, made, size_in_bytes
from .collide import pose_of
from .parts import mesh_attributes, mesh_of
from .scene import Scene
from .signatures import ArrayLike, Path, Progress, Size, Uint32s, Vertices

if TYPE_CHECKING:
    from .collide import Pose
    from .model import Model

OPERATIONS = {"|": c.EBPO_BOOLEAN_UNION, "+": c.EBPO_BOOLEAN_UNION, "-": c.EBPO_BOOLEAN_DIFFERENCE,
              "^": c.EBPO_BOOLEAN_SYMMETRIC_DIFFERENCE, "&": c.EBPO_BOOLEAN_INTERSECTION,
              "*": c.EBPO_BOOLEAN_INTERSECTION}


class Result(NamedTuple):
    """The mesh of a result.

    vertices: (n, 3) float32 or float64. faces: (m, 3) uint32. displacement: greatest distance between a vertex
    and its exact position. volume: bounds of the volume before rounding, equal or neighbouring doubles; nan
    unless requested.
    attributes: arrays by "element:name", such as "face:operand", "vertex:red" or "removed:first"; empty unless
    requested.
    """

    vertices: Vertices
    faces: Uint32s
    displacement: float
    volume: tuple[float, float]
    attributes: dict[str, Any]


class Parser:
    """Reads an expression into nodes; ~ binds first, then & and *, other operators from left to right."""

    def __init__(self, text: str, operands: int) -> None:
        self.words, self.operands, self.text = re.findall(r"\S", text), operands, text
        self.nodes: list[Any] = []

    def peek(self) -> str:
        return self.words[0] if self.words else ""

    def add(self, operation: int, left: int, right: int = 0) -> int:
        self.nodes.append(c.ebpo_boolean_node(operation, left, right, 0))
        return len(self.nodes) - 1

    def operand(self) -> int:
        word = self.words.pop(0) if self.words else "the end"
        if word == "~":
            return self.add(c.EBPO_BOOLEAN_COMPLEMENT, self.operand())
        if word == "(":
            inner = self.chain("|+-^")
            if self.peek() != ")":
                raise ValueError(f"expression {self.text!r}: expected ')'")
            self.words.pop(0)
            return inner
        number = ord(word) - ord("A") if len(word) == 1 else -1
        if not 0 <= number < min(self.operands, 26):
            raise ValueError(f"expression {self.text!r}: expected a model or '(', found {word}")
        return self.add(c.EBPO_BOOLEAN_OPERAND, number)

    def chain(self, operators: str) -> int:
        def operand() -> int:
            return self.chain("&*") if "|" in operators else self.operand()
        left = operand()
        while self.peek() and self.peek() in operators:
            operation = OPERATIONS[self.words.pop(0)]
            left = self.add(operation, left, operand())
        return left

    def all(self) -> list:
        self.chain("|+-^")
        if self.words:
            raise ValueError(f"expression {self.text!r}: expected an operator or the end, found {self.words[0]}")
        return self.nodes


def boolean(expression: str, models: Sequence[Model | Scene], *, poses: Sequence[Pose | ArrayLike | None] | None = None,
            time: float | None = None, box: ArrayLike | None = None, planes: ArrayLike | None = None,
            doubles: bool = False, volume: bool = False, origins: bool = False, attributes: bool = False,
            changed_only: bool = False, memory: Size | None = None, temp_dir: Path | None = None,
            threads: int | None = None, progress: Progress | None = None) -> Result:
    """Return the mesh of a Boolean expression of models at poses: closed, and cut exactly.

    expression: the models are A, B, ... in their order; | or + is the union, & or * the intersection, - the
        difference, ^ the symmetric difference, ~A the complement of A in the box.
    models: a scene stands for its instances, a letter for each.
    poses: a pose for each letter, as for `Collider`; None: as in the file of the model or of the scene.
    time: time of scenes in seconds. None: the first time of each scene.
    box: (2, 3), low and high corner of a box to which the result is cut.
    planes: (n, 4) or (4,), rows of a, b, c, d: the result is cut to the points with ax + by + cz <= d.
    doubles: True: float64 coordinates; False: float32 if all models have float32 and are near
        the origin (at most 1,024 times farther than they are long).
    volume: True: compute the volume.
    origins: True: "face:operand" is the index of the letter from which each face comes, and "face:operand_face"
        the index of its face in the source.
    attributes: True: attributes of the models' vertices and faces, interpolated at new vertices.
    changed_only: True: omit the faces of A that are faces of the result; "removed:first" and "removed:count" are
        the ranges of the other faces of A, as indices in its file.
    memory: budget in bytes for the process; the rest is stored in temporary files in temp_dir. None: no limit.
    temp_dir: folder for these files, and for the small files of box and planes.

    >>> matrix = [[1, 0, 0, .5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    >>> boolean("A - B", [cube, cube], poses=[None, matrix]).vertices.max(axis=0).tolist()
    [0.5, 1.0, 1.0]
    >>> boolean("A", [cube], planes=[0, 0, 1, .25], volume=True).volume
    (0.25, 0.25)
    """
    given = [operand for item in models for operand in operands_of(item, time)]
    poses = [None] * len(given) if poses is None else poses
    if len(poses) != len(given):
        raise ValueError(f"{len(given)} models, but {len(poses)} poses")
    if temp_dir is not None and memory is None and box is None and planes is None:
        raise ValueError("temp_dir needs memory, box or planes")
    folder = None if temp_dir is None else path(temp_dir, "temp_dir")
    nodes = Parser(expression, len(given)).all()
    handles = [handle for handle, _, _ in given]
    operands = (c.ebpo_boolean_operand * len(given))()
    for operand, (_, model, pose), where in zip(operands, given, poses):
        operand.model, operand.pose = model, pose if where is None else pose_of(where)
    options = made(c.ebpo_boolean_options, threads=threads or 0, temp_dir=folder)
    corners = None if box is None else numbers(box, "box", 6)
    rows = None if planes is None else numbers(planes, "planes", 4)
    if corners is not None:
        options.box = corners.ctypes.data
    if rows is not None:
        options.planes, options.plane_count = rows.ctypes.data, len(rows) // 4
    handle = Handle.made("ebpo_boolean_new", operands, len(given), (c.ebpo_boolean_node * len(nodes))(*nodes),
                         len(nodes), ctypes.byref(options), free="ebpo_boolean_free",
                         keep=handles)
    workspace = None
    if memory is not None:
        space = made(c.ebpo_workspace_options, memory=size_in_bytes(memory), temp_dir=folder)
        workspace = Handle.made("ebpo_workspace_new", ctypes.byref(space), free="ebpo_workspace_free")
    mesh, report = Struct(c.ebpo_mesh, "ebpo_mesh_free", workspace), made(c.ebpo_boolean_mesh_report)
    with Reporter(progress) as reported:
        how = made(c.ebpo_boolean_mesh_options, doubles=doubles, volume=volume, origins=origins, attributes=attributes,
                   changed_only=changed_only, progress=reported,
                   workspace=workspace.pointer if workspace else None)
        call("ebpo_boolean_mesh", handle, ctypes.byref(how), mesh, ctypes.byref(report))
    bounds = (report.volume.lo, report.volume.hi) if volume else (math.nan, math.nan)
    return Result(*mesh_of(mesh), report.displacement, bounds, mesh_attributes(mesh))


def operands_of(item: Model | Scene, time: float | None) -> list[tuple[Handle, int, c.ebpo_pose]]:
    """Return the owner, the address of the model and the pose of each operand that a model or a scene stands for."""
    if not isinstance(item, Scene):
        return [(item.model, item.model.pointer, pose_of(None))]
    operands, count = (c.ebpo_boolean_operand * len(item.instances))(), ctypes.c_uint32()
    with item._lock:
        handle = item._handle
        call("ebpo_boolean_get_operands", handle, item.begin if time is None else time, operands, len(operands),
             ctypes.byref(count))
    return [(handle, operand.model, operand.pose) for operand in operands]


def numbers(values: ArrayLike, name: str, width: int) -> np.ndarray:
    """Return the values as a flat array of rows of `width` doubles."""
    flat = to_doubles(values, name).ravel()
    if name == "box" and flat.size != width or flat.size % width:
        raise ValueError(f"{name}: expected {width} numbers{'' if name == 'box' else ' a row'}, not {flat.size}")
    return flat
