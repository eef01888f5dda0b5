"""A hand that touches a model: force, distance, and a way that goes through no face."""
from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

import numpy as np

from . import _declared as c
from ._checked import doubles
from ._library import Handle, call, lib, of_members

_STOPPED = 128 # EBPO_TOUCH_STOPPED


class Touched(NamedTuple):
    """What a tick tells of a ball or a tool; see ebpo/touch.h. face: -1 if none is near."""

    proxy: np.ndarray
    force: np.ndarray
    torque: np.ndarray
    turn: np.ndarray
    normal: np.ndarray
    depth: float
    face: int
    flags: int

    @property
    def stopped(self) -> bool:
        """No more faces will be loaded: `Touch.check` raises why."""
        return bool(self.flags & _STOPPED)


class Sensed(NamedTuple):
    """What a tick tells of a probe: the distance (NaN if only its bounds are known), from lo to hi."""

    distance: float
    lo: float
    hi: float
    normal: np.ndarray
    face: int
    where: int
    flags: int

    @property
    def stopped(self) -> bool:
        """No more faces will be loaded: `Touch.check` raises why."""
        return bool(self.flags & _STOPPED)


def _vector(values: Any, count: int) -> Any:
    got = doubles(values, "place")
    if got.shape != (count,):
        raise ValueError(f"expected {count} numbers, got an array of shape {got.shape}")
    return (ctypes.c_double * count)(*got)


def _number(face: int) -> int:
    return -1 if face == 2**64 - 1 else face


class Touch:
    """A hand at `place`: a ball of `radius`, or with `points` (n, 3) a tool, or with `probe` a point that
    nothing stops. Other options are those of ebpo_touch_options. One thread at a time.

    Loading goes on beside it; where `flags` has EBPO_TOUCH_WAITS (2), the hand is ahead of that; where
    a tick is `stopped`, no more will come.

    >>> hand = Touch(cube, [.5, .5, 2], radius=.1, stiffness=100, damping=0)
    >>> for step in range(200):
    ...     felt = hand.move([.5, .5, 2 - .006 * step])
    >>> hand.check()
    >>> bool(felt.proxy[2] > 1.0999), felt.stopped
    (True, False)
    """

    def __init__(self, model: Any, place: Any, *, points: Any = None, probe: bool = False, **options: Any) -> None:
        wanted = of_members(c.ebpo_touch_options, options, points=None, point_count=0, kind=0)
        if points is not None:
            rows = doubles(points, "points")
            if rows.ndim != 2 or rows.shape[1] != 3:
                raise ValueError("points: expected an array of shape (n, 3)")
            wanted.points, wanted.point_count, wanted.kind = rows.ctypes.data, len(rows), 2
        elif probe:
            wanted.kind = 1
        self._handle = Handle.made("ebpo_touch_new", model.model, ctypes.byref(wanted), _vector(place, 3),
                                   free="ebpo_touch_free", keep=(model.model,))

    def move(self, place: Any) -> Touched:
        """A tick of a ball."""
        r = c.ebpo_touch_result()
        lib.ebpo_touch_move(self._handle, _vector(place, 3), ctypes.byref(r))
        return Touched(np.array(r.proxy), np.array(r.force), np.zeros(3), np.array([0, 0, 0, 1.0]),
                       np.array(r.normal), r.depth, _number(r.face), r.flags)

    def turn(self, place: Any, quaternion: Any) -> Touched:
        """A tick of a tool; quaternions are x, y, z, w."""
        r = c.ebpo_touch_turned()
        lib.ebpo_touch_turn(self._handle, _vector(place, 3), _vector(quaternion, 4), ctypes.byref(r))
        return Touched(np.array(r.proxy), np.array(r.force), np.array(r.torque), np.array(r.turn),
                       np.array(r.normal), r.depth, _number(r.face), r.flags)

    def sense(self, place: Any) -> Sensed:
        """A tick of a probe."""
        r = c.ebpo_touch_sensed()
        lib.ebpo_touch_sense(self._handle, _vector(place, 3), ctypes.byref(r))
        return Sensed(r.distance, r.lo, r.hi, np.array(r.normal), _number(r.face), r.where, r.flags)

    def place(self, place: Any) -> None:
        """Lifts the hand and puts it elsewhere."""
        call("ebpo_touch_place", self._handle, _vector(place, 3))

    def check(self) -> None:
        """Raises what has kept faces from being loaded, if anything has."""
        call("ebpo_touch_check", self._handle)
