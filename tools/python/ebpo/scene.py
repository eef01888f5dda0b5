"""Scenes: rigid instances of models, which may be animated."""
from __future__ import annotations

import ctypes
import threading
from typing import Any, Callable, Iterator

import numpy as np

from . import _declared as c
from ._checked import path as path_in_c
from ._library import Handle, Reporter, call, lib, made, size_in_bytes, text
from .collide import PAIR, Gathered, Pairs, matrix_of
from .forks import renew_after_fork
from .signatures import Doubles, Path, Progress, Rows, Size

CLASH = np.dtype(c.ebpo_scene_clash)
CLOSE = np.dtype(c.ebpo_scene_pair)


def open_scene(path: Path, *, memory: Size | None = None, allow_outside: bool = False, remote: bool = False,
               progress: Progress | None = None) -> Scene:
    """Open a scene file (format-spec/scene.md), and the headers of its models' files.

    memory: budget in bytes for all queried models together. None: no limit.
    allow_outside: files of the scene may be anywhere, not only in the scene's folder or below it.
    remote: the scene may name models on web servers.
    """
    def opened(report: Progress | None) -> Handle:
        options = made(c.ebpo_scene_options, allow_outside=allow_outside, remote=remote)
        handle = Handle.made("ebpo_scene_open", path_in_c(path), ctypes.byref(options), free="ebpo_scene_free")
        with Reporter(report) as reported:
            load = made(c.ebpo_load_options, memory=size_in_bytes(memory), progress=reported)
            call("ebpo_scene_load", handle, ctypes.byref(load))
        return handle

    return Scene(opened, progress)


class Scene:
    """An open scene. Made by `open_scene`. One thread queries at a time; other threads wait.

    In a process that os.fork made, the scene is opened again.

    models, instances: lists of names. The index of an instance is its index in the list.
    begin, end: the first time and the last time of all routes, in the scene's seconds.
    """

    def __init__(self, opened: Callable[[Progress | None], Handle], progress: Progress | None = None) -> None:
        self._opened, self._lock, self._closed = opened, threading.Lock(), False
        self._made: Handle | None = opened(progress)
        renew_after_fork(self)
        handle = self._made
        counts = made(c.ebpo_scene_counts)
        lib.ebpo_scene_get_counts(handle, ctypes.byref(counts))
        self.begin, self.end = counts.begin, counts.end
        self.models = list(self._names(c.ebpo_scene_model_facts, "ebpo_scene_get_model_facts", counts.models))
        self.instances = list(self._names(c.ebpo_scene_instance, "ebpo_scene_get_instance", counts.instances))

    def _renew(self) -> None:
        if self._made is not None:
            self._made.forget()
        self._made, self._lock = None, threading.Lock()

    @property
    def _handle(self) -> Handle:
        if self._closed:
            raise ValueError("the scene has been closed")
        if self._made is None:
            self._made = self._opened(None)
        return self._made

    def close(self) -> None:
        """Free the data of the scene and of its models. The end of the last reference also frees it."""
        with self._lock:
            self._made, self._closed = None, True

    def __enter__(self) -> Scene:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _names(self, kind: Any, function: str, count: int) -> Iterator[str]:
        for number in range(count):
            facts = made(kind)
            getattr(lib, function)(self._handle, number, ctypes.byref(facts))
            yield text(facts.name)

    def _number(self, instance: int | str) -> int:
        return self.instances.index(instance) if isinstance(instance, str) else instance

    def pose(self, instance: int | str, time: float = 0.0) -> Doubles:
        """Return the pose of an instance at a time: a (4, 4) matrix. instance: an index or a name."""
        out = c.ebpo_pose()
        with self._lock:
            call("ebpo_scene_pose", self._handle, self._number(instance), time, ctypes.byref(out))
        return matrix_of(out)

    def _posed(self, kind: Any, time: float | None) -> tuple[Handle, Any]:
        """Return the handle, and an array of structs `kind` with the model and the pose of each instance."""
        posed, model = (kind * len(self.instances))(), ctypes.c_void_p()
        with self._lock:
            handle = self._handle
            for number, one in enumerate(posed):
                facts = made(c.ebpo_scene_instance)
                lib.ebpo_scene_get_instance(handle, number, ctypes.byref(facts))
                call("ebpo_scene_model", handle, facts.model, ctypes.byref(model))
                call("ebpo_scene_pose", handle, number, self.begin if time is None else time, ctypes.byref(one.pose))
                one.model = model.value
        return handle, posed

    def box(self, begin: float | None = None, end: float | None = None) -> Doubles:
        """Return a box (2, 3) that contains all instances from time begin to time end. Default: all times."""
        out = np.empty((2, 3))
        with self._lock:
            call("ebpo_scene_box", self._handle, *self._times(begin, end), out.ctypes.data, out[1:].ctypes.data)
        return out

    def _times(self, begin: float | None, end: float | None) -> tuple[float, float]:
        return self.begin if begin is None else begin, self.end if end is None else end

    def pairs(self, begin: float | None = None, end: float | None = None) -> Rows:
        """Return the pairs whose boxes come closer than their clearance at any time from begin to end.

        Returns a structured array of a, b and clearance, ascending. All other tested pairs stay farther apart.
        """
        found = Gathered(c.ebpo_scene_pairs_fn, CLOSE)
        with self._lock, found as taking:
            call("ebpo_scene_pairs", self._handle, *self._times(begin, end), taking, None)
        return found.array

    def clashes(self, time: float = 0.0, *, count: bool = False, locations: bool = False, relate: bool = False,
             depth: float = 0.0, threads: int | None = None, progress: Progress | None = None) -> Rows:
        """Return pairs of instances that intersect at a time, or are closer than their clearance.

        count: count all pairs of intersecting faces, and intersection lines.
        locations: compute a common point and its box.
        relate: compute the relation of solids.
        depth: compute penetration depths with this tolerance, in the world's unit; implies `relate`. 0: none.

        Returns a structured array with the members of ebpo_scene_clash in ebpo/scene.h: a, b, kind (a
        ClashKind), relation (a Relation), face_a, face_b, distance, location ...
        """
        found = Gathered(c.ebpo_scene_clashes_fn, CLASH)
        with self._lock, Reporter(progress) as reported, found as taking:
            options = made(c.ebpo_scene_clash_options, progress=reported, threads=threads or 0, count=count,
                           locations=locations, relate=relate, depth=depth)
            call("ebpo_scene_find_clashes", self._handle, time, ctypes.byref(options), taking, None, None)
        return found.array

    def collide(self, a: int | str, b: int | str, time: float = 0.0, *, threads: int | None = None) -> Pairs:
        """Return every pair of faces of two instances that intersect at a time."""
        found = Gathered(c.ebpo_pairs_fn, PAIR)
        with self._lock, found as taking:
            call("ebpo_scene_collide", self._handle, self._number(a), self._number(b), time, threads or 0, taking, None)
        pairs = found.array
        return Pairs(pairs["face_a"].astype(np.int64), pairs["face_b"].astype(np.int64), pairs["kind"].copy())

    def __repr__(self) -> str:
        return f"<ebpo.Scene: {len(self.instances)} instances of {len(self.models)} models>"
