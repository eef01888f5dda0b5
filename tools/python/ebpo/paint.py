"""Paint on a model: strokes, layers and notes in a separate file."""
from __future__ import annotations

import contextlib
import ctypes
import os
from typing import Any, Iterator, NamedTuple

import numpy as np

from . import _declared as c
from ._checked import doubles
from ._checked import path as path_in_c
from ._library import Callback, Handle, Reporter, call, copied, lib, made, text
from .model import Model
from .signatures import AnyArray, ArrayLike, Path, Progress, Rows

POINT = np.dtype(c.ebpo_paint_point)
FACE = np.dtype(c.ebpo_paint_face)
AREA = np.dtype(c.ebpo_paint_area)


class Stroke(NamedTuple):
    """A stroke.

    layer: the index of its layer.
    kind: a PaintKind.
    colour: 0xRRGGBBAA.
    radius: radius of points of full size, in the model's unit.
    time: milliseconds since 1970; 0: unknown.
    points: structured as ebpo_paint_point.
    """

    layer: int
    kind: c.PaintKind
    colour: int
    radius: float
    time: int
    points: Rows

    def __repr__(self) -> str:
        return (f"<ebpo.Stroke: {len(self.points)} points of radius {self.radius:g}, {self.kind.name.lower()}, layer "
                f"{self.layer}, colour {self.colour:#010x}>")


class Areas(NamedTuple):
    """Painted areas, in the model's unit squared. Each has lo, value and hi; the exact area is in [lo, hi].

    all: the area of all layers together, (). layers, strokes: structured arrays, one item each.
    """

    all: Rows
    layers: Rows
    strokes: Rows


class Paint:
    """Paint on a model. The model is never changed. Made by `Paint(model)`, or by `Paint.open` from a file.

    The rules are those of ebpo/paint.h. Several threads may read a Paint while no thread changes it.

    >>> paint = Paint(cube)
    >>> layer = paint.add_layer(title="Cracks", colour=0x3366ffff)
    >>> paint.draw(cube, [[.2, .5, 1, 1], [.8, .5, 1, 1]], layer=layer, radius=.1)["strokes"]
    1
    >>> area = paint.measure(cube).all
    >>> bool(area["lo"] <= .12 + .01 * np.pi <= area["hi"] * 1.1)
    True
    """

    def __init__(self, model: Model | None = None, *, _handle: Handle | None = None) -> None:
        if _handle is None:
            if model is None:
                raise TypeError("Paint() needs a model")
            _handle = Handle.made("ebpo_paint_new", model.file, free="ebpo_paint_free")
        self._held: Handle | None = _handle

    @property
    def _handle(self) -> Handle:
        if self._held is None:
            raise ValueError("the change of this paint ended with an exception; open it again")
        return self._held

    @classmethod
    def open(cls, source: Path | memoryview | AnyArray) -> Paint:
        """Open paint from a path, or from the bytes of a file. Raises FormatError, VersionError, IOFailure."""
        if isinstance(source, (str, os.PathLike)):
            return cls(_handle=Handle.made("ebpo_paint_open", path_in_c(source), free="ebpo_paint_free"))
        data = np.frombuffer(source, np.uint8)
        return cls(_handle=Handle.made("ebpo_paint_open_memory", data.ctypes.data, data.nbytes, None,
                                       free="ebpo_paint_free"))

    @classmethod
    @contextlib.contextmanager
    def change(cls, path: Path, model: Model | None = None, *, wait: float = 60) -> Iterator[Paint]:
        """Open a file for a change in a `with` statement; save it at the end, unless an exception was raised.

        Other `change` calls for the file, in any process or thread, wait up to `wait` seconds, then raise
        IOFailure. So changes follow each other and none is lost. See ebpo_paint_open_to_change.

        model: if the file does not exist, the paint is a new one for this model. Existing paint is checked as
            by `check` with points.

        >>> for title in "Cracks", "Repairs":
        ...     with Paint.change("cube.paint.h5", cube) as paint:
        ...         _ = paint.add_layer(title=title)
        >>> len(Paint.open("cube.paint.h5").layers)
        2
        """
        path = os.path.abspath(os.fsdecode(path))  # the working directory may change before the end
        paint = cls(_handle=Handle.made("ebpo_paint_open_to_change", path_in_c(path),
                                        None if model is None else model.file, wait, None, free="ebpo_paint_free"))
        try:
            if model is not None:
                paint.check(model, points=True)
            yield paint
        except BaseException:
            paint._handle._end()  # free it now, not together with the traceback: others wait
            paint._held = None
            raise
        paint.save(path)

    def save(self, path: Path) -> None:
        """Save the paint to a file, which is replaced atomically.

        Raises UnsupportedError when the library was built without libhdf5.

        Raises IOFailure when the file of this paint was changed by another program or Paint since it was read
        or saved here. Open it again and repeat the change, or save to another path.
        """
        call("ebpo_paint_save", self._handle, path_in_c(path))

    @property
    def info(self) -> dict[str, Any]:
        """The members of ebpo_paint_info: layer_count, stroke_count, note_count, point_count, model_sha256, ..."""
        return facts(self._got("ebpo_paint_get_info", c.ebpo_paint_info))

    def check(self, model: Model, *, points: bool = False) -> None:
        """Check that the paint belongs to a model. Raises ArgumentError otherwise.

        points: also check that all points and notes are on their faces. Raises FormatError otherwise.
        """
        call("ebpo_paint_check_model", self._handle, model.file)
        if points:
            with model._context() as context:
                call("ebpo_paint_check_points", self._handle, context, None)

    def _got(self, function: str, kind: Any, *number: int) -> Any:
        struct = made(kind)
        if getattr(lib, function)(self._handle, *number, ctypes.byref(struct)) != 0:
            raise IndexError(f"index {number[0]} is out of range")
        return struct

    # ---- layers, notes, strokes ----

    @property
    def layers(self) -> list[dict[str, Any]]:
        """The layers: title, author, date, description, colour (0xRRGGBBAA), opacity (0 to 255), visible (0, 1)."""
        return [facts(self._got("ebpo_paint_get_layer", c.ebpo_paint_layer, i)) for i in range(self.info["layer_count"])]

    def add_layer(self, *, title: str | None = None, author: str | None = None, date: str | None = None,
                  description: str | None = None, colour: int | None = None, opacity: int = 255,
                  visible: bool = True) -> int:
        """Add a layer above all others. Returns its index. The arguments are described by `layers`."""
        layer = made(c.ebpo_paint_layer, title=title, author=author, date=date, description=description,
                     opacity=opacity, visible=visible, **({} if colour is None else {"colour": colour}))
        number = ctypes.c_uint64()
        call("ebpo_paint_add_layer", self._handle, ctypes.byref(layer), ctypes.byref(number))
        return number.value

    def remove_layer(self, number: int) -> None:
        """Remove a layer with its strokes and notes."""
        call("ebpo_paint_remove_layer", self._handle, number)

    @property
    def notes(self) -> list[dict[str, Any]]:
        """The notes: title, author, date, body, layer, and `at`, structured as ebpo_paint_point."""
        return [facts(self._got("ebpo_paint_get_note", c.ebpo_paint_note, i)) for i in range(self.info["note_count"])]

    def add_note(self, model: Model, place: ArrayLike, *, layer: int = 0, title: str | None = None,
                 author: str | None = None, date: str | None = None, body: str | None = None) -> None:
        """Add a note at the point of the surface nearest to `place`, (3,)."""
        note = made(c.ebpo_paint_note, title=title, author=author, date=date, body=body, layer=layer)
        at = doubles(place, "a place")
        if at.shape != (3,):
            raise ValueError("place: expected three numbers")
        with model._context() as context:
            call("ebpo_paint_locate", self._handle, context, at.ctypes.data, ctypes.byref(note.at))
        call("ebpo_paint_add_note", self._handle, ctypes.byref(note))

    def remove_note(self, number: int) -> None:
        """Remove a note. The indices of later notes decrease by one."""
        call("ebpo_paint_remove_note", self._handle, number)

    @property
    def strokes(self) -> list[Stroke]:
        """The strokes in the order in which they were made."""
        out = []
        for i in range(self.info["stroke_count"]):
            s = self._got("ebpo_paint_get_stroke", c.ebpo_paint_stroke, i)
            out.append(Stroke(s.layer, c.PaintKind(s.kind), s.colour, s.radius, s.time,
                              copied(s.points, (s.point_count,), POINT)))
        return out

    def remove_stroke(self, number: int) -> None:
        """Remove a stroke. Removing the last stroke is an undo."""
        call("ebpo_paint_remove_stroke", self._handle, number)

    def draw(self, model: Model, input: ArrayLike, *, radius: float, layer: int = 0,
             kind: c.PaintKind = c.PaintKind.PAINTS, colour: int | None = None, spread: float = 0.0, density: int = 1,
             size_least: float | None = None, size_full: float | None = None, step: float = 0.0,
             within: float = float("inf"), seed: int | None = None, time: int = 0,
             progress: Progress | None = None) -> dict[str, int]:
        """Add strokes along the path of a haptic device.

        input: (n, 4), positions and pressures of 0 to 1, or (n, 5), with times in milliseconds.
        radius ... time: members of ebpo_paint_pen in ebpo/paint.h. None: the default there.

        Returns the members of ebpo_paint_drawn: strokes, points, steps, lifted, strayed.
        """
        rows = doubles(input, "input")
        if rows.ndim != 2 or rows.shape[1] not in (4, 5):
            raise ValueError(f"input has the shape (n, 4) or (n, 5), not {rows.shape}")
        stroke = np.zeros((len(rows), 5))
        stroke[:, :rows.shape[1]] = rows
        drawn = made(c.ebpo_paint_drawn)
        wished = {"colour": colour, "size_least": size_least, "size_full": size_full, "seed": seed}
        with Reporter(progress) as reported, model._context() as context:
            given = made(c.ebpo_paint_pen, radius=radius, layer=layer, kind=kind, spread=spread, density=density,
                         step=step, within=within, time=time, progress=reported,
                         **{name: value for name, value in wished.items() if value is not None})
            call("ebpo_paint_draw", self._handle, context, stroke.ctypes.data, len(stroke), ctypes.byref(given),
                 ctypes.byref(drawn))
        return facts(drawn)

    # ---- results ----

    def cover(self, model: Model, stroke: int) -> Rows:
        """Return the faces that a stroke covers, structured as ebpo_paint_face, in the order of the file."""
        found = bytearray()

        def take(_user: int, face: int) -> bool:
            found.extend(ctypes.string_at(face, FACE.itemsize))
            return True

        with model._context() as context, Callback(c.ebpo_paint_face_fn, take) as taking:
            call("ebpo_paint_cover", self._handle, context, stroke, taking, None, None)
        return np.frombuffer(bytes(found), FACE)

    def measure(self, model: Model, *, fineness: int = 256, progress: Progress | None = None) -> Areas:
        """Return the painted areas; see ebpo_paint_measure."""
        areas = made(c.ebpo_paint_areas)
        with Reporter(progress) as reported, model._context() as context:
            options = made(c.ebpo_paint_options, fineness=fineness, threads=model._threads, progress=reported)
            call("ebpo_paint_measure", self._handle, context, ctypes.byref(options), ctypes.byref(areas))
        info = self.info
        out = Areas(np.array(areas.all), copied(areas.layers, (info["layer_count"],), AREA),
                    copied(areas.strokes, (info["stroke_count"],), AREA))
        lib.ebpo_paint_areas_free(ctypes.byref(areas))
        return out


def facts(struct: Any) -> dict[str, Any]:
    out = {}
    for name, _ in struct._fields_:
        value = getattr(struct, name)
        if name not in ("struct_size", "reserved"):
            out[name] = text(value) if isinstance(value, bytes) else \
                np.array(value) if isinstance(value, ctypes.Structure) else value
    return out
