"""Queries of two models: collision, distance and penetration."""
from __future__ import annotations

import ctypes
import math
import threading
from typing import TYPE_CHECKING, Any, NamedTuple, Union

import numpy as np

from . import _declared as c
from ._checked import doubles, nanoseconds
from ._library import Callback, Handle, Reporter, call, copied, made, size_in_bytes
from .forks import renew_after_fork
from .signatures import ArrayLike, Doubles, Int32s, Int64s, Progress, Size

if TYPE_CHECKING:
    from .model import Model
    Pose = Union[c.ebpo_pose, ArrayLike]

PAIR = np.dtype(c.ebpo_face_pair)
SEGMENT = np.dtype(c.ebpo_contact_segment)


class Pairs(NamedTuple):
    """Pairs of faces that intersect.

    face_a, face_b: (k,) int64, face indices of the sources. kind: (k,) int32, a PairKind.
    """

    face_a: Int64s
    face_b: Int64s
    kind: Int32s


class Contacts(NamedTuple):
    """Intersections of pairs of faces.

    points: (k, 2, 3) float64, both ends of each segment. face_a, face_b: (k,) int64.
    """

    points: Doubles
    face_a: Int64s
    face_b: Int64s


class Clearance(NamedTuple):
    """The distance of two models.

    lo, hi: guaranteed bounds of the distance; equal when it is known. face_a, face_b: the nearest faces, -1:
    not found. point_a, point_b: (3,) the nearest points.
    """

    lo: float
    hi: float
    face_a: int
    face_b: int
    point_a: Doubles
    point_b: Doubles


class Separation(NamedTuple):
    """The separation distance of two models.

    lo, hi: guaranteed bounds, in multiples of the direction's length; equal when the distance is known.
    face_a, face_b: the faces that separate last.
    """

    lo: float
    hi: float
    face_a: int
    face_b: int


def number(face: int) -> int:
    return -1 if face == c.EBPO_NO_FACE else face


def members_of_pose(value: c.ebpo_pose) -> Doubles:
    """Return the pose's memory as an array: 9 reals of the rotation, row by row, 3 of the translation, the scale."""
    return np.frombuffer(value, np.float64)


def pose(rotation: ArrayLike | None = None, translation: ArrayLike | None = None, scale: float = 1.0,
         quaternion: ArrayLike | None = None) -> c.ebpo_pose:
    """Return a pose of a model: x becomes rotation (scale x) + translation.

    rotation: (3, 3).
    quaternion: (4,) x, y, z, w of any length, instead of a rotation. The rotation has the same bits as in
        scenes.
    translation: (3,).

    Functions that take a pose accept this object, a (4, 4) matrix, or None for the pose in the file.

    >>> list(pose(translation=[1, 2, 3]).translation)
    [1.0, 2.0, 3.0]
    """
    made_pose = made(c.ebpo_pose, scale=scale)
    members = members_of_pose(made_pose)
    if rotation is not None and quaternion is not None:
        raise ValueError("a pose has a rotation or a quaternion, not both")
    if rotation is not None:
        members[:9] = doubles(rotation, "rotation").reshape(9)
    if translation is not None:
        members[9:12] = doubles(translation, "translation").reshape(3)
    if quaternion is not None:
        turn = doubles(quaternion, "quaternion").reshape(4)
        call("ebpo_pose_turn", ctypes.byref(made_pose), turn.ctypes.data)
    return made_pose


def pose_of(value: Any) -> Any:
    if value is None:
        return made(c.ebpo_pose)
    if isinstance(value, c.ebpo_pose):
        return value
    matrix = doubles(value, "a pose")
    if matrix.shape != (4, 4) or matrix[3].tolist() != [0, 0, 0, 1]:
        raise ValueError("a pose is what ebpo.pose gives, or a (4, 4) matrix whose last row is 0 0 0 1")
    column = matrix[:3, 0].copy()
    scale = math.sqrt(column.dot(column))
    scale = 1.0 if abs(scale - 1) < 2**-30 else scale
    if not scale > 0:
        raise ValueError("the matrix of a pose has no inverse")
    made_pose = c.ebpo_pose()
    members = members_of_pose(made_pose)
    members[:9], members[9:12], members[12] = (matrix[:3, :3] / scale).ravel(), matrix[:3, 3], scale
    return made_pose


def matrix_of(value: Any) -> np.ndarray:
    matrix, members = np.eye(4), members_of_pose(value)
    matrix[:3, :3] = members[:9].reshape(3, 3) * members[12]
    matrix[:3, 3] = members[9:12]
    return matrix


class Gathered(Callback):
    """A callback that collects the items it receives in an array."""

    def __init__(self, function: Any, dtype: np.dtype) -> None:
        super().__init__(function, self.keep)
        self.dtype, self.parts = dtype, [np.empty(0, dtype)]

    def keep(self, _user: int, items: int, count: int) -> bool:
        self.parts.append(copied(items, (count,), self.dtype))
        return True

    @property
    def array(self) -> np.ndarray:
        return np.concatenate(self.parts)


def _again(a: Model, b: Model, threads: int | None, memory: Size | None) -> Collider:
    return Collider(a, b, threads=threads, memory=memory)


class Collider:
    """Two models at poses, or one model twice. Decisions are exact for the posed coordinates.

    pose_a, pose_b: a result of `pose`, a (4, 4) matrix, or None for the pose in the file. Lengths are in the
    world's unit, which is the model's unit times the pose's scale.

    memory: bytes for pairs of faces that are not sorted yet.
    threads: number of threads for `pairs`; None: all cores.

    One thread queries at a time; other threads wait.

    >>> c = Collider(cube, cube)
    >>> c.relation(pose_b=pose(translation=[.5, 0, 0])).name
    'INTERSECTING'
    >>> c.distance(pose_b=pose(translation=[3, 0, 0])).hi
    2.0
    """

    def __init__(self, a: Model, b: Model, *, threads: int | None = None, memory: Size | None = None) -> None:
        self._arguments = a, b, threads, memory
        self._lock = threading.Lock()
        self._made: Handle | None = self._make()
        renew_after_fork(self)

    def _make(self) -> Handle:
        a, b, threads, memory = self._arguments
        options = made(c.ebpo_collider_options, threads=threads or 0, memory=size_in_bytes(memory))
        models = a.model, b.model
        return Handle.made("ebpo_collider_new", *models, ctypes.byref(options), free="ebpo_collider_free", keep=models)

    def _renew(self) -> None:
        if self._made is not None:
            self._made.forget()
        self._made, self._lock = None, threading.Lock()

    @property
    def _handle(self) -> Handle:
        if self._made is None:
            self._made = self._make()
        return self._made

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, self._arguments

    def _call(self, function: str, poses: tuple[Pose | None, Pose | None], *arguments: Any,
              deadline: float | None = None, progress: Progress | None = None) -> None:
        """Call a function of the library with the collider, its options and the arguments."""
        options = made(c.ebpo_collide_options)
        if poses[0] is not None:
            options.pose_a = pose_of(poses[0])
        if poses[1] is not None:
            options.pose_b = pose_of(poses[1])
        if deadline:
            options.deadline_ns = nanoseconds(deadline)
        with self._lock:
            if not progress:
                call(function, self._handle, ctypes.byref(options), *arguments)
                return
            with Reporter(progress) as options.progress:
                call(function, self._handle, ctypes.byref(options), *arguments)

    def first(self, pose_a: Pose | None = None, pose_b: Pose | None = None) -> tuple[int, int, c.PairKind] | None:
        """Return one pair of intersecting faces: face of a, face of b, kind.

        Returns None when no faces intersect. Even then, one solid may be inside the other.

        >>> Collider(cube, cube).first(pose_b=pose(translation=[3, 0, 0])) is None
        True
        """
        pair, found = c.ebpo_face_pair(), ctypes.c_int32()
        self._call("ebpo_collide_first", (pose_a, pose_b), ctypes.byref(pair), ctypes.byref(found))
        return (pair.face_a, pair.face_b, c.PairKind(pair.kind)) if found.value == 1 else None

    def relation(self, pose_a: Pose | None = None, pose_b: Pose | None = None, *, deadline: float | None = None) -> c.Relation:
        """Return the exact Relation of the models. deadline: time limit in seconds; then the result may be UNDECIDED."""
        result = c.ebpo_relation_result()
        self._call("ebpo_collide_relation", (pose_a, pose_b), ctypes.byref(result), deadline=deadline)
        return c.Relation(result.relation)

    def _pairs(self, function: str, poses: tuple[Pose | None, Pose | None], progress: Progress | None) -> Pairs:
        found = Gathered(c.ebpo_pairs_fn, PAIR)
        with found as taking:
            self._call(function, poses, taking, None, progress=progress)
        pairs = found.array
        return Pairs(pairs["face_a"].astype(np.int64), pairs["face_b"].astype(np.int64), pairs["kind"].copy())

    def pairs(self, pose_a: Pose | None = None, pose_b: Pose | None = None, *, progress: Progress | None = None) -> Pairs:
        """Return every pair of intersecting faces, once."""
        return self._pairs("ebpo_collide_all", (pose_a, pose_b), progress)

    def self_pairs(self, *, progress: Progress | None = None) -> Pairs:
        """Return the pairs of faces of one model that have common points besides a common corner or edge.

        The collider must consist of the same model twice.

        >>> len(Collider(cube, cube).self_pairs().kind)
        0
        """
        return self._pairs("ebpo_collide_self", (None, None), progress)

    def contacts(self, pose_a: Pose | None = None, pose_b: Pose | None = None, *, progress: Progress | None = None) -> Contacts:
        """Return the intersections: a segment for each pair of crossing faces."""
        found = Gathered(c.ebpo_segments_fn, SEGMENT)
        with found as taking:
            self._call("ebpo_collide_contacts", (pose_a, pose_b), taking, None, progress=progress)
        all_of_them = found.array
        return Contacts(all_of_them["point"].copy(), all_of_them["face_a"].astype(np.int64),
                        all_of_them["face_b"].astype(np.int64))

    def polylines(self, pose_a: Pose | None = None, pose_b: Pose | None = None) -> list[Doubles]:
        """Return the intersection lines: (k, 3) points each; in a closed line the last point equals the first.

        >>> len(Collider(cube, cube).polylines(pose_b=pose(translation=[.5, .25, .25])))
        1
        """
        lines = []

        def take(_user: int, line: int) -> bool:
            given = c.ebpo_polyline.from_address(line)
            lines.append(copied(given.points, (given.count, 3), np.float64))
            return True

        with Callback(c.ebpo_polylines_fn, take) as taking:
            self._call("ebpo_collide_polylines", (pose_a, pose_b), taking, None)
        return lines

    def distance(self, pose_a: Pose | None = None, pose_b: Pose | None = None, *, tolerance: float = 0.0,
                 deadline: float | None = None) -> Clearance:
        """Return the least distance between the faces: 0 if any faces intersect; not negative inside a solid.

        tolerance: greatest allowed difference hi - lo of the bounds.
        deadline: time limit in seconds; then the current bounds are returned.
        """
        clearance, out = made(c.ebpo_collide_distance_options, tolerance=tolerance), c.ebpo_collide_distance_result()
        self._call("ebpo_collide_distance", (pose_a, pose_b), ctypes.byref(clearance), ctypes.byref(out),
                   deadline=deadline)
        return Clearance(out.distance.lo, out.distance.hi, number(out.pair.face_a), number(out.pair.face_b),
                         np.array(out.point_a), np.array(out.point_b))

    def depth(self, tolerance: float, pose_a: Pose | None = None, pose_b: Pose | None = None
              ) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the depth of a's surface in b, and of b's surface in a: (lo, hi) each, at most `tolerance` apart.

        >>> (lo, hi), _ = Collider(cube, cube).depth(.01, pose_b=pose(translation=[.75, 0, 0]))
        >>> lo <= .25 <= hi
        True
        """
        a_in_b, b_in_a = c.ebpo_value_bounds(), c.ebpo_value_bounds()
        self._call("ebpo_collide_depth", (pose_a, pose_b), tolerance, ctypes.byref(a_in_b), ctypes.byref(b_in_a))
        return (a_in_b.lo, a_in_b.hi), (b_in_a.lo, b_in_a.hi)

    def separation(self, direction: ArrayLike, pose_a: Pose | None = None,
                   pose_b: Pose | None = None) -> Separation:
        """Return the separation distance of a from b along a direction, in multiples of the direction's length.

        >>> Collider(cube, cube).separation([1, 0, 0], pose_b=pose(translation=[-.25, 0, 0])).hi
        0.75
        """
        along, out = doubles(direction, "direction").reshape(3), c.ebpo_separation()
        self._call("ebpo_collide_separation", (pose_a, pose_b), along.ctypes.data, ctypes.byref(out))
        return Separation(out.t.lo, out.t.hi, number(out.pair.face_a), number(out.pair.face_b))
