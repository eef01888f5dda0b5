"""Meshes of unions, intersections and differences of models."""
from __future__ import annotations

import ctypes
import re
from typing import TYPE_CHECKING, NamedTuple, Sequence

from . import _declared as c
from ._library import Handle, Reporter, Struct, call, made
from .collide import pose_of
from .parts import mesh_of
from .signatures import ArrayLike, Progress, Uint32s, Vertices

if TYPE_CHECKING:
    from .collide import Pose
    from .model import Model

OPERATIONS = {"|": c.EBPO_BOOLEAN_UNION, "+": c.EBPO_BOOLEAN_UNION, "-": c.EBPO_BOOLEAN_DIFFERENCE,
              "^": c.EBPO_BOOLEAN_SYMMETRIC_DIFFERENCE, "&": c.EBPO_BOOLEAN_INTERSECTION,
              "*": c.EBPO_BOOLEAN_INTERSECTION}


class Result(NamedTuple):
    """The mesh of a result.

    vertices: (n, 3) float32 or float64. faces: (m, 3) uint32. displacement: greatest distance between a vertex
    and its exact position.
    """

    vertices: Vertices
    faces: Uint32s
    displacement: float


class Parser:
    """Reads an expression into nodes; & and * bind first, other operators from left to right."""

    def __init__(self, text: str, operands: int) -> None:
        self.words, self.operands, self.nodes = re.findall(r"\S", text), operands, []
        self.text = text

    def peek(self) -> str:
        return self.words[0] if self.words else ""

    def add(self, operation: int, left: int, right: int = 0) -> int:
        self.nodes.append(c.ebpo_boolean_node(operation, left, right, 0))
        return len(self.nodes) - 1

    def operand(self) -> int:
        word = self.words.pop(0) if self.words else "the end"
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


def boolean(expression: str, models: Sequence[Model], *, poses: Sequence[Pose | ArrayLike | None] | None = None,
            doubles: bool = False, threads: int | None = None, progress: Progress | None = None) -> Result:
    """Return the mesh of a Boolean expression of models at poses: closed, and cut exactly.

    expression: the models are A, B, ... in their order; | or + is the union, & or * the intersection, - the
        difference, ^ the symmetric difference.
    poses: a pose for each model, as for `Collider`; None: as in the files.
    doubles: True: float64 coordinates; False: float32 if all models have float32.

    >>> matrix = [[1, 0, 0, .5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    >>> boolean("A - B", [cube, cube], poses=[None, matrix]).vertices.max(axis=0).tolist()
    [0.5, 1.0, 1.0]
    """
    poses = [None] * len(models) if poses is None else poses
    if len(poses) != len(models):
        raise ValueError(f"{len(models)} models, but {len(poses)} poses")
    nodes = Parser(expression, len(models)).all()
    handles = [model.model for model in models]
    operands = (c.ebpo_boolean_operand * len(models))()
    for operand, given, where in zip(operands, handles, poses):
        operand.model, operand.pose = given.pointer, pose_of(where)
    options = made(c.ebpo_boolean_options, threads=threads or 0)
    handle = Handle.made("ebpo_boolean_new", operands, len(models), (c.ebpo_boolean_node * len(nodes))(*nodes),
                         len(nodes), ctypes.byref(options), free="ebpo_boolean_free",
                         keep=handles)
    mesh, report = Struct(c.ebpo_mesh, "ebpo_mesh_free"), made(c.ebpo_boolean_mesh_report)
    with Reporter(progress) as reported:
        how = made(c.ebpo_boolean_mesh_options, doubles=doubles, progress=reported)
        call("ebpo_boolean_mesh", handle, ctypes.byref(how), mesh, ctypes.byref(report))
    return Result(*mesh_of(mesh), report.displacement)
