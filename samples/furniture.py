#!/usr/bin/env python3
"""furniture.py FOLDER: writes furniture as one model: furniture.obj with a name for each piece, and
furniture.ply without names. The lamp and the back of the chair intersect the table.

    python3 samples/furniture.py /tmp/furniture
    ebpo convert --split-groups /tmp/furniture/furniture.obj /tmp/furniture/pieces
    ebpo scene report --count /tmp/furniture/pieces/groups.scene.json

    ebpo convert --split-components /tmp/furniture/furniture.ply /tmp/furniture/bodies
    ebpo scene report --count /tmp/furniture/bodies/components.scene.json
"""
import itertools
import pathlib
import sys

# A piece is a list of boxes, each given by two opposite corners. Boxes of one piece do not intersect, so that each is a separate body.
PIECES = {
    "table/top": [((0, 0, 0.7), (1.6, 0.8, 0.74))],
    "table/legs": [((x, y, 0), (x + 0.05, y + 0.05, 0.69)) for x in (0.1, 1.45) for y in (0.1, 0.65)],
    "lamp": [((0.2, 0.2, 0.72), (0.4, 0.4, 1.1))],
    "chair seat": [((0.5, -0.3, 0.4), (0.9, 0.1, 0.45))],
    "chair back": [((0.5, -0.02, 0.46), (0.9, 0.02, 0.9))],
}
SIDES = ((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6))


def corners(low, high):
    """Returns the corners of a box. Corner i has the greater x, y or z when bit 0, 1 or 2 of i is set."""
    return [tuple((low, high)[bits[2 - k]][k] for k in range(3))
            for bits in itertools.product((0, 1), repeat=3)]


def main():
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    vertices, faces, obj = [], [], []
    for name, boxes in PIECES.items():
        obj.append(f"g {name}")
        for box in boxes:
            own = [[len(vertices) + i for i in side] for side in SIDES]
            vertices += corners(*box)
            obj += ["f " + " ".join(str(i + 1) for i in side) for side in own]
            faces += own
    points = [f"{x:g} {y:g} {z:g}" for x, y, z in vertices]
    lines = ["v " + p for p in points] + obj
    (folder / "furniture.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    header = ["ply", "format ascii 1.0", f"element vertex {len(points)}", "property float x",
              "property float y", "property float z", f"element face {len(faces)}",
              "property list uchar int vertex_indices", "end_header"]
    lines = header + points + ["4 " + " ".join(map(str, side)) for side in faces]
    (folder / "furniture.ply").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"{folder}: {len(PIECES)} pieces of {len(faces) // 6} boxes, {len(faces)} faces")


main()
