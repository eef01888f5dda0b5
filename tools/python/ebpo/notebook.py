"""Shows a model in a notebook: facts, and a picture of the envelopes of a coarse level."""
from __future__ import annotations

import base64
import contextlib
import html
import struct
import zlib
from typing import TYPE_CHECKING

import numpy as np

from .errors import Error

if TYPE_CHECKING:
    from .model import Model

WIDTH, HEIGHT = 240, 180
FACES = 40000  # greatest number of triangles of a picture
NODES = 1500  # greatest number of nodes of a level that is drawn
LIGHT = np.array([-0.35, -0.5, 0.79])
COLOUR = np.array([122, 160, 196])


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
