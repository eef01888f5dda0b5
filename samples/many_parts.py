#!/usr/bin/env python3
"""many_parts.py FOLDER [PARTS]: writes a scene of PARTS parts (default: 10,000) and a tool that flies
through them. Needs ebpo in PATH. Equal arguments give equal scenes.

    python3 samples/many_parts.py /tmp/plant
    ebpo scene info /tmp/plant/plant.scene.json
    ebpo scene report --from 0 --to 10 --step 1 /tmp/plant/plant.scene.json

The parts are pipes along the three axes and blocks, on a grid. Each part has a small random offset, so
that some parts intersect their neighbours."""
import json
import math
import os
import subprocess
import sys


def ply(path, vertices, faces):
    with open(path, "w", encoding="ascii") as f:
        f.write(f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty float x\n"
                f"property float y\nproperty float z\nelement face {len(faces)}\n"
                "property list uchar int vertex_indices\nend_header\n")
        f.writelines("%.9g %.9g %.9g\n" % v for v in vertices)
        f.writelines(f"{len(c)} {' '.join(map(str, c))}\n" for c in faces)


def block(x, y, z):
    vertices = [((i & 1) * x - x / 2, (i >> 1 & 1) * y - y / 2, (i >> 2) * z - z / 2)
                for i in range(8)]
    return vertices, [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2),
                      (1, 3, 7, 5)]


def pipe(radius, length, sides=48, rings=24):
    """Returns a pipe along x that is closed at both ends."""
    vertices = [(length * (r / rings - 0.5), radius * math.cos(2 * math.pi * s / sides),
                 radius * math.sin(2 * math.pi * s / sides))
                for r in range(rings + 1) for s in range(sides)]
    faces = [(r * sides + s, r * sides + (s + 1) % sides, (r + 1) * sides + (s + 1) % sides,
              (r + 1) * sides + s) for r in range(rings) for s in range(sides)]
    for end, x in ((0, -length / 2), (rings, length / 2)):
        vertices.append((x, 0, 0))
        for s in range(sides):
            corner = (end * sides + s, end * sides + (s + 1) % sides)
            faces.append((len(vertices) - 1, *(corner[::-1] if end == 0 else corner)))
    return vertices, faces


def chance(state=1):
    """Yields pseudorandom numbers from -1 to 1, the same on every machine."""
    while True:
        state = (state * 6364136223846793005 + 1442695040888963407) % 2**64
        yield (state >> 11) / 2**52 - 1


def instances(count):
    numbers = chance()
    side = math.ceil(count ** (1 / 3))
    turns = [[0, 0, 0, 1], [0, 0, 1, 1], [0, 1, 0, 1]]
    for i in range(count):
        at = [i % side, i // side % side, i // side // side]
        kind = (at[0] + at[1] + at[2]) % 2
        pose = {"translation": [c + 0.06 * next(numbers) for c in at]}
        if kind:
            pose["quaternion"] = turns[i % 3]
        yield {"name": f"{'pipe' if kind else 'block'} {i}",
               "model": "pipe" if kind else "block", "layer": "plant", "fixed": i % 50 != 0,
               "pose": pose}


def scene(count):
    far = math.ceil(count ** (1 / 3)) + 1
    return {
        "ebpo_scene": "1.0", "title": f"{count} parts and a tool", "unit": "m",
        "models": {m: {"file": f"{m}.ebpo.h5"} for m in ("block", "pipe", "tool")},
        "layers": ["plant", "tools"],
        "routes": {"through": {"keys": [
            {"time": 0, "pose": {"translation": [-2, 0.5, 0.5]}},
            {"time": 5, "pose": {"translation": [far / 2, far / 2, 0.5],
                                 "quaternion": [0, 0, 1, 1]}},
            {"time": 10, "pose": {"translation": [far, far / 2, far / 2],
                                  "quaternion": [0, 1, 1, 1]}}]}},
        "instances": [*instances(count), {"name": "tool", "model": "tool", "layer": "tools",
                                          "route": "through"}],
        "cameras": [{"name": "door", "eye": [-far, -far, far], "target": [far / 2] * 3}],
        "clearance": [{"between": ["layer:plant", "tool"], "distance": 0.02}]}


def main():
    folder = sys.argv[1]
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 10000
    os.makedirs(folder, exist_ok=True)
    for name, shape in (("block", block(0.5, 0.5, 0.9)), ("pipe", pipe(0.12, 0.96)),
                        ("tool", pipe(0.3, 1.5, 96, 48))):
        mesh, out = (os.path.join(folder, name + end) for end in (".ply", ".ebpo.h5"))
        ply(mesh, *shape)
        try:
            subprocess.run(["ebpo", "convert", "--quiet", mesh, out], check=True)
        except FileNotFoundError:
            sys.exit("many_parts.py: ebpo is not in PATH; it is in tools/ of the build folder")
        except subprocess.CalledProcessError:
            sys.exit(1)
    with open(os.path.join(folder, "plant.scene.json"), "w", encoding="utf-8") as f:
        json.dump(scene(count), f, indent=1)
        f.write("\n")


main()
