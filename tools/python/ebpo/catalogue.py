"""Catalogues: any number of models that are asked as one, or the parts of one that is too large for a file."""
from __future__ import annotations

import contextlib
import functools
import json
import math
import os
import pathlib
import re
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Iterator, NamedTuple

import numpy as np

from ._declared import Where
from .asking import Rows
from .boxes import SLACK, Boxes, Pairs, morton_order
from .errors import ArgumentError, FormatError, NotSolidError, VersionError
from .holding import Holding, ours
from .model import open as open_model

FORMAT, VERSION = "ebpo-catalogue", 1
STRETCH = 1 << 16  # points whose pairs with models are in memory at a time
DIRECTIONS = 64  # rays that are tried before a point is given up

NEAREST = np.dtype([("distance", "f8"), ("point", "f8", 3), ("normal", "f8", 3), ("face", "i8"), ("model", "i8")])
HIT = np.dtype([("t", "f8"), ("face", "i8"), ("side", "i4"), ("model", "i4")])
LOCATED = np.dtype([("where", "i1"), ("winding", "i4")])


class Entry(NamedTuple):
    """A model: `path` is asked for winding numbers. Of parts: `surface`, which distances and rays are asked
    of, has no caps; "": there are none, None: there is nothing else; `numbers`, a .npy, says which faces of
    the whole its faces are."""

    path: str
    content_sha256: str
    solid: bool
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    surface: str | None = ""
    surface_sha256: str = ""
    numbers: str = ""


class Catalogue:
    """Many models, asked as one. Made by `Catalogue.open` or `Catalogue.of`; pickles.

    A point is asked of the models whose boxes hold it. Winding numbers are summed up. A point is inside
    that is inside any model, or, of parts of one model, where the sum is inside by `rule`. Distances are
    those to the nearest model, of several the first; negative inside. Numbers of models are rows here.

    >>> two = Catalogue.of(["cube.ebpo.h5", "cube.ebpo.h5"])
    >>> two.winding([[.5, .5, .5], [2, 0, 0]])
    array([2, 0], dtype=int32)
    """

    def __init__(self, entries: list[Entry], *, parts: bool = False, rule: str = "nonzero", **options: Any) -> None:
        if not entries:
            raise ValueError("a catalogue has one model at least")
        if rule not in ("nonzero", "evenodd", "positive"):
            raise ValueError(f"rule is 'nonzero', 'evenodd' or 'positive', not {rule!r}")
        self.entries, self.parts, self.rule, self.options = list(entries), parts, rule, options

    # ---- files ----

    @classmethod
    def of(cls, paths: Any, *, parts: bool = False, rule: str = "nonzero", **options: Any) -> Catalogue:
        """Of paths and URLs, in this order; each is opened for its box and digest.

        options: of URLs, as `ebpo.open` takes them.
        """
        def entry(path: Any) -> Entry:
            name = absolute(os.fspath(path), os.getcwd())
            with open_model(name, **for_source(name, options)) as model:
                info = model.info
                return Entry(name, info.content_sha256, bool(info.solid),
                             tuple(np.minimum(info.box[0], info.report["min"]).tolist()),
                             tuple(np.maximum(info.box[1], info.report["max"]).tolist()))

        with ThreadPoolExecutor(8) as pool:
            return cls(list(pool.map(entry, paths)), parts=parts, rule=rule, **options)

    @classmethod
    def open(cls, path: Any, **options: Any) -> Catalogue:
        """Of what `ebpo catalogue` or `save` has written. FormatError, VersionError: it is not that."""
        path = pathlib.Path(path).absolute()
        try:
            told = json.loads(regular(path).read_bytes())
            if not isinstance(told, dict) or told.get("format") != FORMAT:
                raise ValueError(f'there is no "format": "{FORMAT}"')
            if told.get("version") != VERSION or told["version"] is True:
                raise VersionError(f"{path}: a catalogue of version {told.get('version')!r}; this package reads "
                                   f"{VERSION}", "EBPO_E_VERSION", str(path))
            entries = [read_entry(model, str(path.parent)) for model in told["models"]]
            return cls(entries, parts=flag(told.get("parts", False), "parts"), rule=told.get("rule", "nonzero"), **options)
        except VersionError:
            raise
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
            raise FormatError(f"{path}: not a catalogue: {type(error).__name__}: {error}", "EBPO_E_FORMAT",
                              str(path)) from None

    def save(self, path: Any) -> None:
        """As a file that `open` reads, whole or not at all. Paths in its folder and below become relative."""
        path = pathlib.Path(path).absolute()
        told: dict[str, Any] = {"format": FORMAT, "version": VERSION}
        if self.parts:
            told.update(parts=True, rule=self.rule)
        told["models"] = []
        for entry in self.entries:
            row = {"path": relative(entry.path, path.parent), "content_sha256": entry.content_sha256,
                   "solid": entry.solid, "box_min": list(entry.low), "box_max": list(entry.high)}
            row.update((name, relative(getattr(entry, name), path.parent)) for name in ("surface", "surface_sha256", "numbers")
                       if getattr(entry, name))
            if entry.surface is None:
                row["surface"] = None
            told["models"].append(row)
        from .stretches import published
        with published(path) as file:
            file.write(json.dumps(told, indent=1).encode() + b"\n")

    def __getstate__(self) -> dict:
        return {name: value for name, value in self.__dict__.items() if name not in ("boxes", "seen", "numbers", "looked_at")}

    def __dask_tokenize__(self) -> tuple:
        """What answers depend on: equal in every process."""
        return "ebpo-catalogue", repr(self.entries), self.parts, self.rule

    def __len__(self) -> int:
        return len(self.entries)

    def __repr__(self) -> str:
        return f"<ebpo.Catalogue of {len(self)} {'parts of a model' if self.parts else 'models'}>"

    @functools.cached_property
    def boxes(self) -> Boxes:
        return Boxes(*self._corners(), np.arange(len(self)))

    @functools.cached_property
    def seen(self) -> Boxes:
        """Of the models that rays and distances see."""
        seen = np.array([entry.surface is not None for entry in self.entries])
        if not seen.any():
            raise ValueError("the catalogue has caps alone, and no surface")
        return Boxes(*self._corners(), np.flatnonzero(seen))

    def _corners(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array([entry.low for entry in self.entries]), np.array([entry.high for entry in self.entries])

    @functools.cached_property
    def numbers(self) -> list:
        """Of each model an array of numbers in the whole, or None."""
        return [read_numbers(entry.numbers) if entry.numbers else None for entry in self.entries]

    @functools.cached_property
    def looked_at(self) -> set:
        """Which models have been found to be within their boxes."""
        return set()

    # ---- asking ----

    @contextlib.contextmanager
    def _model(self, number: int, held: Holding, surface: bool) -> Iterator[Any]:
        """surface: what rays and distances see. FormatError: it is not what the catalogue tells."""
        entry, surface = self.entries[number], bool(surface and self.entries[number].surface)
        path, digest = (entry.surface, entry.surface_sha256) if surface else (entry.path, entry.content_sha256)
        with held.model(path, digest, len(self), **for_source(path, self.options)) as model:
            if (number, surface) not in self.looked_at:
                self._look_at(number, surface, path, model.info)
                self.looked_at.add((number, surface))
            yield model

    def _look_at(self, number: int, surface: bool, path: str, info: Any) -> None:
        entry = self.entries[number]
        low, high = info.report["min"], info.report["max"]
        if not ((entry.low <= low) & (high <= entry.high)).all():
            raise FormatError(f"{path}: is not within the box that the catalogue tells; make the catalogue anew",
                              "EBPO_E_FORMAT", path)
        if (surface or not entry.surface) and entry.numbers and len(self.numbers[number]) != info.face_count:
            raise FormatError(f"{entry.numbers}: {len(self.numbers[number])} numbers of {info.face_count} faces",
                              "EBPO_E_FORMAT", entry.numbers)

    def _stretches(self, points: Any, held: Holding) -> tuple[Rows, np.ndarray, Iterator[np.ndarray]]:
        """Rows, all of them as doubles, and numbers of points by stretches of the Morton curve, which do not
        matter where there is one model and it is in memory as a whole."""
        rows = Rows(points)
        all_points = rows[0:rows.count]
        check_points(all_points)
        order = np.arange(rows.count)
        if not self._resident(held):
            order = morton_order(all_points, self.boxes.low.min(axis=0), self.boxes.high.max(axis=0))
        return rows, all_points, (order[at:at + STRETCH] for at in range(0, len(order), STRETCH))

    def _resident(self, held: Holding) -> bool:
        if len(self) > 1:
            return False
        with self._model(0, held, False) as model:
            return bool(model.stats["resident"])

    def locate(self, points: Any, *, memory: int | str | None = None, threads: int | None = None) -> np.ndarray:
        """Where points are: a structured array (n,), `where` as of `Model.locate`, `winding` the sum.

        Of parts, exactly what the whole would say, also on caps. Of others, `where` is IN where any says so,
        else ON where any does; a model adds 0 to the sum at points on its faces.

        memory: bytes that models of this process may take, from now on; at first 1 GiB.

        Raises NotSolidError if a model is a surface.
        """
        for entry in self.entries:
            if not entry.solid:
                raise NotSolidError(f"{entry.path} is a surface: there is no inside", "EBPO_E_NOT_SOLID", entry.path)
        held = ours(memory)
        rows, all_points, stretches = self._stretches(points, held)
        out = np.zeros(rows.count, LOCATED)
        for order in stretches:
            p = all_points[order]
            inner, on, winding = np.zeros(len(p), bool), np.zeros(len(p), bool), np.zeros(len(p), np.int64)
            for number, some in runs(self.boxes.containing(p)):
                with self._model(number, held, False) as model:
                    told = model.locate(p[some], threads=threads)
                inner[some] |= told.where == Where.IN
                on[some] |= told.where == Where.ON
                winding[some] += told.winding
            if self.parts:
                on, inner = self._of_whole(p, on, winding, held, threads)
            out["winding"][order] = winding
            out["where"][order] = np.where(inner, Where.IN, np.where(on, Where.ON, Where.OUT))
        return out[0] if rows.single else out

    def _of_whole(self, p: np.ndarray, on: np.ndarray, winding: np.ndarray, held: Holding, threads: int | None
                  ) -> tuple[np.ndarray, np.ndarray]:
        """Whether points are on the whole's faces, and inside. `on`: those on faces or caps of a part, of
        which `winding` does not hold yet."""
        doubtful = np.flatnonzero(on)
        real = np.zeros(len(p), bool)
        if len(doubtful):
            real[doubtful] = self._on_surface(p[doubtful], held)
            capped = doubtful[~real[doubtful]]
            winding[real] = 0
            winding[capped] = self._crossings(p[capped], held, threads)
        inner = {"nonzero": winding != 0, "evenodd": winding % 2 != 0, "positive": winding > 0}[self.rule]
        return real, inner & ~real

    def _on_surface(self, p: np.ndarray, held: Holding) -> np.ndarray:
        """Whether points are on real faces, exactly: the triangles that meet a box of one point."""
        found = np.zeros(len(p), bool)
        for number, some in runs(self.seen.containing(p)):
            with self._model(number, held, True) as model:
                for at in some[~found[some]]:
                    found[at] = len(model.faces_in_box(p[at], p[at])) > 0
        return found

    def _crossings(self, p: np.ndarray, held: Holding, threads: int | None) -> np.ndarray:
        """Winding numbers of points that are on no real face: what rays go out through less what they go in
        through. A ray that meets an edge or runs along a face tells nothing: another one is cast."""
        out, left = np.zeros(len(p), np.int64), np.arange(len(p))
        for direction in np.random.default_rng(20).uniform(-1, 1, (DIRECTIONS, 3)):
            if not len(left):
                break
            sum_, plain = np.zeros(len(left), np.int64), np.ones(len(left), bool)
            o, d = p[left], np.broadcast_to(direction, (len(left), 3))
            for number, some in runs(self.seen.on_rays(o, d)):
                with self._model(number, held, True) as model:
                    hits = model.ray_all(o[some], direction, threads=threads)
                np.subtract.at(sum_, some[hits.ray], hits.side)
                plain[some[hits.ray[hits.side == 0]]] = False
            out[left[plain]] = sum_[plain]
            left = left[~plain]
        if len(left):
            raise ArithmeticError(f"no ray from {p[left[0]].tolist()} tells its winding number")
        return out

    def inside(self, points: Any, *, boundary: bool = True, memory: int | str | None = None,
               threads: int | None = None) -> Any:
        """Whether points are inside: (n,) bool. boundary: points on faces are, too. Raises as `locate`."""
        where = self.locate(points, memory=memory, threads=threads)["where"]
        return where != Where.OUT if boundary else where == Where.IN

    def winding(self, points: Any, *, memory: int | str | None = None, threads: int | None = None) -> Any:
        """The sum of winding numbers: (n,) int32. Raises as `locate`."""
        return self.locate(points, memory=memory, threads=threads)["winding"].copy()

    def distance(self, points: Any, *, max_distance: float = float("inf"), signed: bool = True,
                 memory: int | str | None = None, threads: int | None = None) -> np.ndarray:
        """The nearest face of any model: a structured array (n,), `["distance"]` and so on.

        Its fields are those of `Model.distance`, and `model`, the number here.

        Negative inside (`inside`; not of catalogues in which there is a surface). Of models at the same
        rounded distance the first is taken.
        """
        if not max_distance >= 0:
            raise ArgumentError(f"maximum distance {max_distance}: give 0 or more", "EBPO_E_ARGUMENT")
        held = ours(memory)
        rows, all_points, stretches = self._stretches(points, held)
        out = np.zeros(rows.count, NEAREST)
        for order in stretches:
            out[order] = self._nearest(all_points[order], max_distance, held, threads)
        if signed and rows.count and all(entry.solid for entry in self.entries):
            inner = self.locate(all_points, memory=memory, threads=threads)["where"] == Where.IN
            out["distance"][inner & np.isfinite(out["distance"])] *= -1  # what is too far is inf
        return out[0] if rows.single else out

    def _nearest(self, p: np.ndarray, max_distance: float, held: Holding, threads: int | None) -> np.ndarray:
        best = np.zeros(len(p), NEAREST)
        best["distance"], best["point"], best["face"], best["model"] = np.inf, np.nan, -1, -1
        point, box, least = self.seen.nearest(p)
        begin = np.searchsorted(point, np.arange(len(p) + 1))
        turn = begin[:-1].copy()
        while True:  # each point asks its next box, as long as that may hold something nearer
            asks = np.flatnonzero(turn < begin[1:])
            limit = np.minimum(best["distance"][asks], max_distance)
            asks = asks[least[turn[asks]] * (1 - SLACK) <= limit]  # boxes behind it are farther still
            if not len(asks):
                return best
            for number, some in runs(by_model(asks, box[turn[asks]])):
                limit = min(float(best["distance"][some].max()) * (1 + SLACK), max_distance)
                with self._model(number, held, True) as model:
                    told = model.distance(p[some], max_distance=limit, signed=False, threads=threads)
                now = best["distance"][some]
                better = (told.face >= 0) & ((told.distance < now) |
                                             ((told.distance == now) & (number < best["model"][some])))
                rows = some[better]
                for name in ("distance", "point", "normal"):
                    best[name][rows] = getattr(told, name)[better]
                best["face"][rows] = self._faces(number, told.face[better])
                best["model"][rows] = number
            turn[asks] += 1

    def _faces(self, number: int, faces: np.ndarray) -> np.ndarray:
        numbers = self.numbers[number]
        if numbers is None:
            return faces
        found = numbers[faces]
        if len(found) and not 0 <= int(found.min()) <= int(found.max()) < 2**63:
            raise FormatError(f"{self.entries[number].numbers}: a number of a face is negative or beyond 2^63",
                              "EBPO_E_FORMAT", self.entries[number].numbers)
        return found

    def ray(self, origins: Any, directions: Any, *, t_max: float = float("inf"), memory: int | str | None = None,
            threads: int | None = None) -> np.ndarray:
        """The first face that each ray meets: a structured array (n,), the fields of `Model.ray`, and `model`."""
        held = ours(memory)
        o, d = Rows(origins, "origins"), Rows(directions, "directions")
        count = d.count if o.single else o.count
        if o.count != d.count and not (o.single or d.single):
            raise ValueError(f"{o.count} origins and {d.count} directions")
        o_rows = np.broadcast_to(o[0:o.count], (count, 3))
        d_rows = np.broadcast_to(d[0:d.count], (count, 3))
        check_rays(o_rows, d_rows, t_max)
        out = np.zeros(count, HIT)
        out["t"], out["face"], out["model"] = np.inf, -1, -1
        far = np.full(count, np.inf)  # of hits at a t beyond doubles (inf): t along the ray's longer direction
        for at in range(0, count, STRETCH):
            rays = slice(at, min(count, at + STRETCH))
            for number, some in runs(self.seen.on_rays(o_rows[rays], d_rows[rays])):
                with self._model(number, held, True) as model:
                    hits = model.ray(o_rows[rays][some], d_rows[rays][some], t_max=t_max, threads=threads)
                    beyond = np.flatnonzero((hits.face >= 0) & np.isinf(hits.t))
                    there = np.full(len(some), np.inf)
                    if len(beyond):
                        where = some[beyond]
                        there[beyond] = model.ray(o_rows[rays][where], longer(d_rows[rays][where]), threads=threads).t
                now = out[rays][some]  # models come in order: of equal ones the first stays
                nearer = (hits.face >= 0) & ((hits.t < now["t"]) | (now["face"] < 0) |
                                             (np.isinf(now["t"]) & (there < far[rays][some])))
                rows = at + some[nearer]
                far[rows] = there[nearer]
                out["t"][rows], out["side"][rows] = hits.t[nearer], hits.side[nearer]
                out["face"][rows], out["model"][rows] = self._faces(number, hits.face[nearer]), number
        return out[0] if o.single and d.single else out


def check_points(points: np.ndarray, first: int = 0) -> None:
    """As each model would, also of points in no box. first: the number of the first one."""
    finite = np.isfinite(points).all(axis=1)
    if not finite.all():
        raise ArgumentError(f"points: number {first + int(finite.argmin())} has a coordinate that is not a finite "
                            "number", "EBPO_E_ARGUMENT")


def check_rays(origins: np.ndarray, directions: np.ndarray, t_max: float, first: int = 0) -> None:
    """As each model would, also of rays that meet no box. first: the number of the first one."""
    finite = np.isfinite(origins).all(axis=1) & np.isfinite(directions).all(axis=1)
    for fine, what in ((finite, "has a coordinate that is not a finite number"),
                       (directions.any(axis=1), "needs a direction other than (0, 0, 0)"),
                       (np.broadcast_to(t_max >= 0, len(origins)), "needs a t_max of 0 or more")):
        if not fine.all():
            raise ArgumentError(f"ray {first + int(fine.argmin())} {what}", "EBPO_E_ARGUMENT")


def longer(directions: np.ndarray) -> np.ndarray:
    """Directions that are longer by a power of two, exactly, so that every hit's t is finite."""
    _, exponent = np.frexp(np.abs(directions).max(axis=1))
    return np.ldexp(directions, np.maximum(0, 3 - exponent)[:, None])  # coordinates are at most 2^1025 apart


def by_model(points: np.ndarray, models: np.ndarray) -> Pairs:
    order = np.lexsort((points, models))
    return points[order], models[order]


def runs(pairs: Pairs) -> Iterator[tuple[int, np.ndarray]]:
    """Each model with its points."""
    point, box = pairs
    begins = np.flatnonzero(np.diff(box, prepend=-1))
    for begin, end in zip(begins, [*begins[1:], len(box)]):
        yield int(box[begin]), point[begin:end]


def for_source(name: str, options: dict) -> dict:
    """Options for opening it: of URLs alone. Long work waits for servers that are away for some minutes."""
    if "://" not in name:
        return {}
    if name.startswith(("http://", "https://")) and "storage_options" not in options:
        return {"time_limit": 300.0, "retries": 60, **options}
    return options


def absolute(path: str, folder: str) -> str:
    return path if "://" in path else os.path.join(folder, path)


def relative(path: str, folder: pathlib.Path) -> str:
    return path[len(str(folder)) + 1:] if path.startswith(f"{folder}{os.sep}") else path


def read_entry(model: dict, folder: str) -> Entry:
    """ValueError, KeyError, TypeError, OverflowError: it is none."""
    if not isinstance(model, dict):
        raise TypeError("a model is an object")
    low, high = read_box(model)
    texts = {name: model.get(name) or "" for name in ("path", "content_sha256", "surface", "surface_sha256", "numbers")}
    for name, text in texts.items():
        if not isinstance(text, str):
            raise ValueError(f"{name} is no text")
        if "\0" in text:
            raise ValueError(f"{name} has a character that no path has")
        text.encode()  # not every text of JSON is one
    if not texts["path"]:
        raise ValueError("a model has no path")
    for name, of in (("content_sha256", "path"), ("surface_sha256", "surface")):
        if texts[of] and not re.fullmatch("[0-9a-f]{64}", texts[name]):
            raise ValueError(f"{name} is no digest, without which another file would be taken for the model")
    for name in ("path", "surface", "numbers"):
        texts[name] = texts[name] and absolute(texts[name], folder)
    return Entry(texts["path"], texts["content_sha256"], flag(model["solid"], "solid"), low, high,
                 texts["surface"] if model.get("surface", "") is not None else None, texts["surface_sha256"],
                 texts["numbers"])


def read_box(model: dict) -> list:
    corners = [[float(x) for x in model[name] if type(x) in (int, float)] for name in ("box_min", "box_max")]
    if not all(len(corner) == 3 and all(map(math.isfinite, corner)) for corner in corners):
        raise ValueError("a box has two corners of three numbers")
    if not all(low <= high for low, high in zip(*corners)):
        raise ValueError("box_min is above box_max")
    return list(map(tuple, corners))


def flag(value: Any, name: str) -> bool:
    if not isinstance(value, bool):
        raise ValueError(f"{name} is true or false, not {value!r}")
    return value


def regular(path: pathlib.Path) -> pathlib.Path:
    """Not a pipe, which might be waited for without end."""
    if path.exists() and not path.is_file():
        raise ValueError("is no file")
    return path


def read_numbers(path: str) -> np.ndarray:
    """FormatError: it is no array of integers."""
    from .stretches import load_npy
    try:
        numbers = load_npy(str(regular(pathlib.Path(path))))
    except (ValueError, OSError) as error:
        raise FormatError(f"{path}: cannot be read as a .npy: {error}", "EBPO_E_FORMAT", path) from None
    if numbers.ndim != 1 or numbers.dtype.kind not in "iu":
        raise FormatError(f"{path}: is no array of integers with one dimension", "EBPO_E_FORMAT", path)
    return numbers
