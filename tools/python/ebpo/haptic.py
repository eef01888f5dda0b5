"""Haptics: force, distance, and a proxy whose path passes through no face."""
from __future__ import annotations

import ctypes
import os
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from . import _declared as c
from ._checked import doubles
from ._library import Handle, call, lib, made
from .forks import renew_after_fork
from .scene import Scene
from .signatures import ArrayLike, Doubles

if TYPE_CHECKING:
    from .model import Model

_STOPPED = c.EBPO_HAPTIC_STOPPED


class HapticResult(NamedTuple):
    """Result of a haptic step of a ball or a tool; see ebpo/haptic.h.

    face: -1: no face is near. instance: index of the instance of a scene that has the face, otherwise 0.
    """

    proxy: Doubles
    force: Doubles
    torque: Doubles
    turn: Doubles
    normal: Doubles
    depth: float
    face: int
    flags: int
    instance: int

    @property
    def stopped(self) -> bool:
        """True: loading of faces has failed; `Haptic.check` raises the error."""
        return bool(self.flags & _STOPPED)


class ProbeResult(NamedTuple):
    """Result of a haptic step of a probe.

    distance: NaN if only its bounds are known. lo, hi: guaranteed bounds of the distance. instance: as in HapticResult.
    """

    distance: float
    lo: float
    hi: float
    normal: Doubles
    face: int
    where: int
    flags: int
    instance: int

    @property
    def stopped(self) -> bool:
        """True: loading of faces has failed; `Haptic.check` raises the error."""
        return bool(self.flags & _STOPPED)


def _vector(values: Any, count: int) -> Any:
    got = doubles(values, "position")
    if got.shape != (count,):
        raise ValueError(f"expected {count} numbers, got an array of shape {got.shape}")
    return (ctypes.c_double * count)(*got)


def _number(face: int) -> int:
    return -1 if face == 2**64 - 1 else face


class Haptic:
    """A haptic object at `position`, for a model or all instances of a scene. One thread at a time.

    The object is a ball of `radius`; with `points` (n, 3) a tool; with `probe` a probe, which faces do not
    stop. time: time of a scene in seconds, whose poses do not change afterwards; None: its first time.
    ebpo_haptic_options in ebpo/haptic.h describes the other arguments.

    A separate thread loads faces. While a result has EBPO_HAPTIC_WAITING (2) in `flags`, the proxy waits
    for faces. If a result is `stopped`, no further faces will be loaded.

    >>> haptic = Haptic(cube, [.5, .5, 2], radius=.1, stiffness=100, damping=0)
    >>> for step in range(200):
    ...     result = haptic.step([.5, .5, 2 - .006 * step])
    >>> haptic.check()
    >>> bool(result.proxy[2] > 1.0999), result.stopped
    (True, False)
    """

    def __init__(self, model: Model | Scene, position: ArrayLike, *, time: float | None = None, radius: float = 0.0,
                 points: ArrayLike | None = None, probe: bool = False, skin: float = 0.0, search_radius: float = 0.0,
                 stiffness: float = 400.0, damping: float = 0.4, friction: float = 0.0, step_seconds: float = 0.001,
                 faces: int = 16384) -> None:
        self._process = os.getpid()
        wanted = made(c.ebpo_haptic_options, radius=radius, skin=skin, search_radius=search_radius, stiffness=stiffness,
                      damping=damping, friction=friction, step_seconds=step_seconds, faces=faces)
        if points is not None:
            rows = doubles(points, "points")
            if rows.ndim != 2 or rows.shape[1] != 3:
                raise ValueError("points: expected an array of shape (n, 3)")
            wanted.points, wanted.point_count, wanted.kind = rows.ctypes.data, len(rows), 2
        elif probe:
            wanted.kind = 1
        rest = ctypes.byref(wanted), _vector(position, 3)
        if isinstance(model, Scene):
            handle, instances = model._posed(c.ebpo_haptic_instance, time)
            self._made = Handle.made("ebpo_haptic_new_posed", instances, len(instances), *rest, free="ebpo_haptic_free",
                                     keep=(handle,))
        elif time is not None:
            raise ValueError("time belongs to a scene; a model has none")
        else:
            self._made = Handle.made("ebpo_haptic_new", model.model, *rest, free="ebpo_haptic_free", keep=(model.model,))
        renew_after_fork(self)

    def _renew(self) -> None:
        self._made.forget()

    @property
    def _handle(self) -> Handle:
        if self._process != os.getpid():
            raise RuntimeError("this Haptic was made before the process was forked; make a new one in this process")
        return self._made

    def step(self, device: ArrayLike) -> HapticResult:
        """Compute a haptic step of a ball with the device at a position (3,)."""
        r = c.ebpo_haptic_ball_result()
        lib.ebpo_haptic_step_ball(self._handle, _vector(device, 3), ctypes.byref(r))
        return HapticResult(np.array(r.proxy), np.array(r.force), np.zeros(3), np.array([0, 0, 0, 1.0]),
                            np.array(r.normal), r.depth, _number(r.face), r.flags, r.instance)

    def step_tool(self, position: ArrayLike, quaternion: ArrayLike) -> HapticResult:
        """Compute a haptic step of a tool at a pose. quaternion: x, y, z, w."""
        r = c.ebpo_haptic_tool_result()
        lib.ebpo_haptic_step_tool(self._handle, _vector(position, 3), _vector(quaternion, 4), ctypes.byref(r))
        return HapticResult(np.array(r.proxy), np.array(r.force), np.array(r.torque), np.array(r.turn),
                            np.array(r.normal), r.depth, _number(r.face), r.flags, r.instance)

    def step_probe(self, position: ArrayLike) -> ProbeResult:
        """Compute a haptic step of a probe at a position (3,)."""
        r = c.ebpo_haptic_probe_result()
        lib.ebpo_haptic_step_probe(self._handle, _vector(position, 3), ctypes.byref(r))
        return ProbeResult(r.distance, r.lo, r.hi, np.array(r.normal), _number(r.face), r.where, r.flags, r.instance)

    def reset(self, position: ArrayLike) -> None:
        """Move the device and the proxy to another position, without contact."""
        call("ebpo_haptic_reset", self._handle, _vector(position, 3))

    def check(self) -> None:
        """Raise the error that stopped loading of faces, if any."""
        call("ebpo_haptic_check", self._handle)
