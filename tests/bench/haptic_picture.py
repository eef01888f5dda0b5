"""Remakes docs/pictures/haptic.png: haptic_picture.py EBPO BUNNY.ply PICTURE

PYTHONPATH must name the folder of the package ebpo. The device (orange, hidden inside) moves behind the surface of the
bunny's flank; its proxy (red) stays outside.
"""
import math
import subprocess
import sys
import tempfile
import time

import ebpo
import numpy as np


def tube(way, radius, colour):
    """Return vertices, faces and colours of a tube of six sides along points."""
    way = np.asarray(way)
    along = np.gradient(way, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1), 1e-30)[:, None]
    side = np.cross(along, [0.3, 0.9, 0.2])
    side /= np.maximum(np.linalg.norm(side, axis=1), 1e-30)[:, None]
    other = np.cross(along, side)
    n, around = len(way), 6
    points = np.concatenate([way + radius * (math.cos(a) * side + math.sin(a) * other)
                             for a in np.arange(around) * 2 * math.pi / around])
    faces = []
    for s in range(around):
        a, b = s * n, (s + 1) % around * n
        for i in range(n - 1):
            faces += [(a + i, a + i + 1, b + i), (b + i, a + i + 1, b + i + 1)]
    return points, np.array(faces), np.tile(np.array(colour, np.uint8), (len(points), 1))


def thin(way, step):
    out = [way[0]]
    for p in way[1:]:
        if np.linalg.norm(p - out[-1]) >= step:
            out.append(p)
    return out


def main(program, ply, picture):
    folder = tempfile.mkdtemp()
    subprocess.run([program, "convert", "-q", ply, folder + "/m.ebpo.h5"], check=True)
    model = ebpo.open(folder + "/m.ebpo.h5")
    mesh = model.mesh()
    low, high = np.min(mesh.vertices, axis=0), np.max(mesh.vertices, axis=0)
    middle, size = (low + high) / 2, high - low
    knots = np.array([[-0.2, -0.02, 0.9], [-0.15, -0.02, 0.2], [0.3, -0.02, 0.15], [0.35, -0.02, 0.9]])
    haptic = ebpo.Haptic(model, middle + size * knots[0], radius=0.004 * size[0])
    devices, proxies = [], []
    for i in range(3000):  # into the solid, along behind the surface in waves, out again
        leg, part = divmod(3 * i / 3000, 1)
        at = knots[int(leg)] * (1 - part) + knots[int(leg) + 1] * part
        at[1] += 0.12 * math.sin(6 * math.pi * part) if leg == 1 else 0
        at = middle + size * at
        for _ in range(200):
            result = haptic.step(at)
            if not result.flags & 6:  # neither EBPO_HAPTIC_WAITING nor EBPO_HAPTIC_PATH_UNFINISHED
                break
            time.sleep(0.001)
        devices.append(at)
        proxies.append(result.proxy)
    haptic.check()
    parts = [(np.asarray(mesh.vertices, float), np.asarray(mesh.faces),
              np.full((len(mesh.vertices), 3), 200, np.uint8)),
             tube(thin(devices, 0.01 * size[0]), 0.004 * size[0], (255, 150, 0)),
             tube(thin(proxies, 0.01 * size[0]), 0.006 * size[0], (200, 0, 30))]
    count = np.cumsum([0] + [len(p[0]) for p in parts])
    points = np.concatenate([p[0] for p in parts])
    faces = np.concatenate([p[1] + first for p, first in zip(parts, count)])
    colours = np.concatenate([p[2] for p in parts])
    with open(folder + "/all.ply", "w", encoding="ascii") as out:
        print(f"ply\nformat ascii 1.0\nelement vertex {len(points)}\nproperty float x\nproperty float y\n"
              "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
              f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header", file=out)
        for p, c in zip(points, colours):
            print(*(f"{x:.8g}" for x in p), *c, file=out)
        for f in faces:
            print(3, *f, file=out)
    subprocess.run([program, "render", "-q", "--size", "900x640", "--view", "20,20", folder + "/all.ply",
                    picture], check=True)


main(*sys.argv[1:])
