"""Shows a model in a notebook: facts and a picture of the envelopes of a coarse level, or the web viewer."""
from __future__ import annotations

import base64
import contextlib
import html
import os
import pathlib
import shutil
import struct
import subprocess
import tempfile
import weakref
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

from ._checked import path, within
from .errors import Error, UnsupportedError
from .signatures import Path

if TYPE_CHECKING:
    from .model import Model

WIDTH, HEIGHT = 240, 180
FACES = 40000  # greatest number of triangles of a picture
NODES = 1500  # greatest number of nodes of a level that is drawn
LIGHT = np.array([-0.35, -0.5, 0.79])
COLOUR = np.array([122, 160, 196])


class Viewer:
    """The web viewer of a model, inline in notebooks. `Model.show` makes it.

    A process of `ebpo serve` serves the file to browsers of this machine. It ends with this object or with Python.

    address: the address of the viewer.
    """

    def __init__(self, source: Any, height: int, viewer: Path | None) -> None:
        self.height = within(height, 1, 100_000, "height")
        if not isinstance(source, (str, os.PathLike)) or "://" in os.fsdecode(source):
            raise ValueError("show() needs a model that was opened from a local path")
        folder = [] if viewer is None else [b"--viewer", path(viewer, "viewer")]
        with tempfile.TemporaryFile() as messages:
            self._process = subprocess.Popen([command(), b"serve", b"-q", b"--port", b"0", *folder, b"--", path(source)],
                                             stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=messages,
                                             start_new_session=True)  # an interrupt of a cell does not end it
            assert self._process.stdout
            self.address: str = self._process.stdout.readline().decode().strip()
            self._end = weakref.finalize(self, stop, self._process)
            if not self.address:
                self._process.wait()
                messages.seek(0)
                raise UnsupportedError(messages.read().decode("utf-8", "replace").strip() or "ebpo serve ended",
                                       "EBPO_E_UNSUPPORTED")

    def close(self) -> None:
        """End the server."""
        self._end()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<ebpo viewer at {self.address}>"

    def _repr_html_(self) -> str:
        return f"<iframe src='{self.address}' style='width: 100%; height: {self.height}px; border: 0'></iframe>"


def stop(process: subprocess.Popen[bytes]) -> None:
    """End a process. In a process that os.fork made, nothing ends, because the process is not its child."""
    process.terminate()
    process.wait()
    if process.stdout:
        process.stdout.close()


def command() -> str:
    """Return the path of the command `ebpo`: that of the wheel, of the build folder, of the prefix, or in PATH."""
    here = pathlib.Path(__file__).resolve().parent
    for name in ("bin/ebpo", "../../ebpo", "../../../../bin/ebpo"):
        if (here / name).is_file():
            return str(here / name)
    found = shutil.which("ebpo")
    if not found:
        raise UnsupportedError("the command ebpo, which serves the viewer, is not in PATH; install it",
                               "EBPO_E_UNSUPPORTED")
    return found


def html_of(model: Model) -> str:
    """Return facts of a model as HTML, and a picture if its file has envelopes."""
    info = model.info
    unit = info.unit or "units"
    size = " × ".join(f"{length:.4g}" for length in info.box[1] - info.box[0])
    rows = [("source", info.source), ("kind", "solid" if info.solid else "surface"), ("faces", f"{info.face_count:,}"),
            ("vertices", f"{info.vertex_count:,}"), ("root cell", f"{size} {unit}"), ("levels", f"{info.level_count}"),
            ("parts", ", ".join(sorted(info.parts))), ("format", info.format)]
    if info.crs:
        rows.append(("CRS", info.crs))
    cells = "".join(f"<tr><th style='text-align:left'>{name}</th><td style='text-align:left'>{html.escape(text)}</td></tr>"
                    for name, text in rows)
    image = ""
    if "planes" in info.parts:
        with contextlib.suppress(Error, ValueError):  # the facts are useful without a picture
            data = base64.b64encode(png_of(picture(model))).decode()
            image = f"<img alt='envelopes of a coarse level' src='data:image/png;base64,{data}'>"
    return f"<table><tr><td>{image}</td><td><table>{cells}</table></td></tr></table>"


def picture(model: Model) -> np.ndarray:
    """Return a picture (HEIGHT, WIDTH, 4) of the finest level that is quickly drawn, seen obliquely from above."""
    levels = [level for level, facts in enumerate(model.info.levels)
              if facts["gray_count"] + facts["leaf_count"] <= NODES]
    image = np.zeros((HEIGHT, WIDTH, 4), np.uint8)
    for level in reversed(levels or [0]):
        given = model.level(level)
        if 0 < len(given.faces) <= FACES:
            draw(image, given.vertices[given.faces])
            break
    return image


def draw(image: np.ndarray, corners: np.ndarray) -> None:
    """Draw triangles (n, 3, 3) with a depth buffer, in a parallel projection that fits the picture."""
    right = np.array([0.87, 0.5, 0.0])
    up = np.array([-0.25, 0.43, 0.87])
    view = np.stack([right, up, np.cross(right, up)])
    points = corners @ view.T
    flat = points[:, :, :2].reshape(-1, 2)
    low, high = flat.min(axis=0), flat.max(axis=0)
    scale = 0.94 * min(np.array([WIDTH, HEIGHT]) / np.maximum(high - low, 1e-300))
    x = (points[:, :, 0] - (low[0] + high[0]) / 2) * scale + WIDTH / 2
    y = HEIGHT / 2 - (points[:, :, 1] - (low[1] + high[1]) / 2) * scale
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals[normals @ view[2] < 0] *= -1  # faces behind narrow gaps between envelopes
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    shade = 0.35 + 0.65 * np.clip(normals @ (LIGHT / np.linalg.norm(LIGHT)), 0, 1)
    depth = np.full((HEIGHT, WIDTH), -np.inf)
    for i in range(len(corners)):
        draw_triangle(image, depth, x[i], y[i], points[i, :, 2], np.append(COLOUR * shade[i], 255))


def draw_triangle(image: np.ndarray, depth: np.ndarray, x: np.ndarray, y: np.ndarray, z: np.ndarray,
                  colour: np.ndarray) -> None:
    """Draw the pixels of a triangle whose centres are inside, and in front of what is drawn."""
    area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    if area == 0:
        return
    left, top = max(0, int(x.min())), max(0, int(y.min()))
    columns = np.arange(left, min(WIDTH, int(x.max()) + 1)) + 0.5
    rows = np.arange(top, min(HEIGHT, int(y.max()) + 1))[:, None] + 0.5
    second = ((columns - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (rows - y[0])) / area
    third = ((x[1] - x[0]) * (rows - y[0]) - (columns - x[0]) * (y[1] - y[0])) / area
    part = slice(top, top + len(rows)), slice(left, left + len(columns))
    here = z[0] + second * (z[1] - z[0]) + third * (z[2] - z[0])
    front = (second >= 0) & (third >= 0) & (second + third <= 1) & (here > depth[part])
    depth[part][front] = here[front]
    image[part][front] = colour


def png_of(image: np.ndarray) -> bytes:
    """Return an array (height, width, 4) of uint8 as a PNG file."""
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width, _ = image.shape
    lines = b"".join(b"\0" + line.tobytes() for line in image)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0))
            + chunk(b"IDAT", zlib.compress(lines, 9)) + chunk(b"IEND", b""))
