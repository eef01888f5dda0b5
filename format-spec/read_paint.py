#!/usr/bin/env python3
"""A second reader of .paint.h5 files, laid out like paint.md: h5py and numpy only, none of the library's code.

    read_paint.py FILE [EXPECTED.json]
    read_paint.py --vectors FOLDER
    read_paint.py --bake FILE MODEL.ebpo.h5 [R G B]

Prints the file as JSON, or compares with what is expected; of a folder, passed/*.json, and that failed/* are refused.
--bake prints the colours of the model's vertices in the order of its file, a line "r g b" for each, over one colour
(230 230 230): sections 4 and 5, slow and plain.
"""
import json
import math
import pathlib
import sys

import h5py
import numpy as np

LAYER_TEXTS = {"title": 255, "author": 255, "date": 31, "description": 4095}
NOTE_TEXTS = {"title": 255, "author": 255, "date": 31, "body": 32767}
COUNTS = {"layer_count": 1024, "note_count": 4096, "stroke_count": 2 ** 20, "point_count": 2 ** 24}
STROKES = {"layer": ("<u4", 0), "kind": ("<u4", 0), "colour": ("|u1", 4), "radius": ("<u8", 0), "time": ("<u8", 0),
           "points": ("<u4", 0)}
POINTS = {"face": ("<u4", 0), "weights": ("<u4", 2), "place": ("<u8", 3), "size": ("<u2", 0), "pressure": ("<u2", 0),
          "time": ("<u4", 0)}


class Refused(Exception):
    pass


def must(holds, what):
    if not holds:
        raise Refused(what)


# 3 Objects

def text(group, name, most, required=True):
    if name not in group.attrs:
        must(not required, f"{group.name}: {name} is missing")
        return ""
    a = h5py.h5a.open(group.id, name.encode())
    kind = a.get_type()
    must(isinstance(kind, h5py.h5t.TypeStringID) and not kind.is_variable_str(), f"{name} is not text of fixed length")
    raw = np.zeros(a.shape, f"S{kind.get_size()}")
    a.read(raw, mtype=kind)
    must(raw.size == 1, f"{name} has several values")
    data = raw.ravel()[0].split(b"\0")[0]
    must(len(data) <= most, f"{group.name}: {name} is too long")
    try:
        value = data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise Refused(f"{name} is not UTF-8") from error
    must(not any(ord(c) < 0x20 or 0x7f <= ord(c) < 0xa0 for c in value), f"{name} has control characters")
    return value


def number(group, name, dtype, least, most, shape=()):
    must(name in group.attrs, f"{group.name}: {name} is missing")
    a = h5py.h5a.open(group.id, name.encode())
    count = int(np.prod(shape)) if shape else 1
    must(a.dtype == np.dtype(dtype) and int(np.prod(a.shape)) == count, f"{group.name}: {name} is of another type")
    value = np.zeros(a.shape, a.dtype)
    a.read(value)
    must(bool(np.all((value >= least) & (value <= most))), f"{group.name}: {name} is out of range")
    return value.ravel().tolist() if shape else value.ravel()[0].item()


def group_at(file, path):
    at = file
    for name in path.strip("/").split("/"):
        must(name in at and isinstance(at.get(name, getlink=True), h5py.HardLink), f"{path} is missing")
        at = at[name]
    must(isinstance(at, h5py.Group), f"{path} is no group")
    return at


def array(file, path, dtype, cols, rows):
    parent, name = path.rsplit("/", 1)
    group = group_at(file, parent)
    must(name in group and isinstance(group.get(name, getlink=True), h5py.HardLink), f"{path} is missing")
    a = group[name]
    must(isinstance(a, h5py.Dataset) and a.dtype == np.dtype(dtype), f"{path} is of another type")
    shape = (rows, cols) if cols else (rows,)
    must(a.shape == a.maxshape == shape, f"{path} has another shape")
    made = a.id.get_create_plist()
    must(a.chunks == shape, f"{path} is not one chunk")
    must(made.get_nfilters() == 1 and made.get_filter(0)[0] == h5py.h5z.FILTER_FLETCHER32, f"{path} has other filters")
    must(a.id.get_num_chunks() == 1 and a.id.get_chunk_info(0).filter_mask == 0, f"{path}: a chunk is missing")
    try:
        return a[...]
    except OSError as error:
        raise Refused(f"{path} is damaged") from error


def colour(rgba):
    return "#" + "".join(f"{v:02x}" for v in rgba)


def layers(file, count):
    out = []
    for i in range(count):
        g = group_at(file, f"/layers/{i:04d}")
        layer = {name: text(g, name, most) for name, most in LAYER_TEXTS.items()}
        c = number(g, "colour", "<u8", 0, 2 ** 32 - 1)
        out.append({**layer, "colour": f"#{c:08x}", "opacity": number(g, "opacity", "<u8", 0, 255),
                    "visible": bool(number(g, "visible", "<u8", 0, 1))})
    return out


def notes(file, count, layer_count):
    out = []
    for i in range(count):
        g = group_at(file, f"/notes/{i:04d}")
        note = {name: text(g, name, most) for name, most in NOTE_TEXTS.items()}
        note["layer"] = number(g, "layer", "<u8", 0, layer_count - 1)
        note["face"] = number(g, "face", "<u8", 0, 2 ** 32 - 2)
        weights = number(g, "weights", "<f8", 0, 2 ** 30, (2,))
        must(all(w == int(w) for w in weights) and sum(weights) <= 2 ** 30, "weights of a note")
        note["weights"] = [int(w) for w in weights]
        note["place"] = number(g, "place", "<f8", -2.0 ** 200, 2.0 ** 200, (3,))
        out.append(note)
    return out


def strokes(file, root):
    n, m = root["stroke_count"], root["point_count"]
    s = {name: array(file, f"/strokes/{name}", dtype, cols, n) for name, (dtype, cols) in STROKES.items()} if n else {}
    p = {name: array(file, f"/points/{name}", dtype, cols, m) for name, (dtype, cols) in POINTS.items()} if m else {}
    must(n > 0 or m == 0, "points without strokes")
    if n:
        radius = s["radius"].view("<f8")
        must(bool(np.all(s["layer"] < root["layer_count"])), "a stroke's layer")
        must(bool(np.all(s["kind"] <= 1)) and not np.any(s["colour"][s["kind"] == 1]), "a stroke's kind or colour")
        must(bool(np.all((radius >= 2.0 ** -200) & (radius <= 2.0 ** 200))), "a stroke's radius")
        must(bool(np.all(s["time"] <= 2 ** 53)), "a stroke's time")
        must(bool(np.all(s["points"] > 0)) and int(s["points"].sum(dtype="u8")) == m, "a stroke's points")
        place = p["place"].view("<f8")
        must(bool(np.all(p["face"] < 2 ** 32 - 1)), "a point's face")
        must(bool(np.all(p["weights"].sum(axis=1, dtype="u8") <= 2 ** 30)), "a point's weights")
        must(bool(np.all(np.abs(place) <= 2.0 ** 200)), "a point's place")
        must(bool(np.all((p["size"] >= 1) & (p["size"] <= 2 ** 15))), "a point's size")
    out, at = [], 0
    for i in range(n):
        points = [{"face": int(p["face"][k]), "weights": p["weights"][k].tolist(), "place": place[k].tolist(),
                   "size": int(p["size"][k]), "pressure": int(p["pressure"][k]), "time": int(p["time"][k])}
                  for k in range(at, at + int(s["points"][i]))]
        out.append({"layer": int(s["layer"][i]), "kind": ["paints", "erases"][s["kind"][i]], "colour": colour(s["colour"][i].tolist()),
                    "radius": float(radius[i]), "time": int(s["time"][i]), "points": points})
        at += len(points)
    return out


def read(path):
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise Refused("no whole HDF5 file") from error
    with file:
        must(text(file, "format", 63) == "EBP-Octree paint 1", "no paint file")
        number(file, "format_version_major", "<i8", 1, 1)
        number(file, "format_version_minor", "<i8", 0, 2 ** 20)
        root = {"generator": text(file, "generator", 63), "model_sha256": text(file, "model_sha256", 64),
                "model_name": text(file, "model_name", 255, False), "unit": text(file, "unit", 31, False),
                "face_numbers": text(file, "face_numbers", 15)}
        must(len(root["model_sha256"]) == 64 and set(root["model_sha256"]) <= set("0123456789abcdef"), "model_sha256")
        must(root["face_numbers"] in ("source", "file"), "face_numbers")
        counts = {name: number(file, name, "<u8", 0, most) for name, most in COUNTS.items()}
        try:
            return {**root, "layers": layers(file, counts["layer_count"]),
                    "notes": notes(file, counts["note_count"], counts["layer_count"]), "strokes": strokes(file, counts)}
        except (KeyError, IndexError, ValueError, RuntimeError, OSError) as error:  # h5py, of damaged headers
            raise Refused(str(error)) from error


# 4 What is painted

def within(p, square, q):
    x, y, z = (q[i] - p[i] for i in range(3))
    return (x * x + y * y) + z * z <= square


def segment_within(p, square, a, b):
    a, b = sorted((tuple(a), tuple(b)))
    e, d = [b[i] - a[i] for i in range(3)], [p[i] - a[i] for i in range(3)]
    ee, de = (e[0] * e[0] + e[1] * e[1]) + e[2] * e[2], (d[0] * e[0] + d[1] * e[1]) + d[2] * e[2]
    t = min(max(de / ee, 0.0), 1.0) if ee else 0.0
    return within(p, square, [a[i] + t * e[i] for i in range(3)])


def reach(point, radius, vertices, faces, by_corner):
    """Faces that hang together with the point's own: neighbour by neighbour."""
    p, r = point["place"], (radius * point["size"]) * 2.0 ** -15
    found, to_do = {point["row"]}, [point["row"]]
    while to_do:
        corners = [tuple(vertices[v]) for v in faces[to_do.pop()]]
        for i in range(3):
            a, b = corners[i], corners[(i + 1) % 3]
            joined = set(by_corner[a]) if within(p, r * r, a) else set()
            if segment_within(p, r * r, a, b):
                joined |= set(by_corner[a]) & set(by_corner[b])
            for face in joined - found:
                found.add(face)
                to_do.append(face)
    return found, p, r * r


def covered(stroke, vertices, faces, by_corner):
    out = set()
    for point in stroke["points"]:
        if point["row"] is None:
            continue
        found, p, square = reach(point, stroke["radius"], vertices, faces, by_corner)
        out |= {v for face in found for v in faces[face] if within(p, square, vertices[v])}
    return out


# 5 Colours

def bake(paint, vertices, faces, colours):
    by_corner = {}
    for number_of_face, face in enumerate(faces):
        for v in face:
            by_corner.setdefault(tuple(vertices[v]), []).append(number_of_face)
    for i, layer in enumerate(paint["layers"]):
        if not layer["visible"]:
            continue
        state = {}
        for stroke in (s for s in paint["strokes"] if s["layer"] == i):
            rgba = [int(stroke["colour"][k:k + 2], 16) for k in (1, 3, 5, 7)]
            s = rgba[3] / 255.0
            for v in covered(stroke, vertices, faces, by_corner):
                p, a = state.get(v, ([0.0, 0.0, 0.0], 0.0))
                state[v] = ([0.0] * 3, 0.0) if stroke["kind"] == "erases" else (
                    [p[k] * (1 - s) + rgba[k] * s for k in range(3)], a * (1 - s) + s)
        o = layer["opacity"] / 255.0
        for v, (p, a) in state.items():
            colours[v] = [colours[v][k] * (1 - a * o) + p[k] * o for k in range(3)]
    return [[math.floor(c + 0.5) for c in rgb] for rgb in colours]


def bake_file(path, model, base):
    import read_ebpo
    paint = read(path)
    with h5py.File(model, "r") as file:
        vertices = read_ebpo.vertices(file["/mesh/vertices"]).reshape(-1, 3).astype("f8").tolist()
        faces = read_ebpo.faces(file["/mesh/faces"]).reshape(-1, 3).tolist()
        if paint["face_numbers"] == "source":
            rows = {n: i for i, n in enumerate(read_ebpo.delta(file["/maps/face_source"]).tolist())}
        else:
            rows = {i: i for i in range(len(faces))}
    for stroke in paint["strokes"]:
        for point in stroke["points"]:
            point["row"] = rows.get(point["face"])
    for rgb in bake(paint, vertices, faces, [list(map(float, base)) for _ in vertices]):
        print(*rgb)


# 8 Vectors

def check_vectors(folder):
    wrong = passed = failed = 0
    for path in sorted(folder.glob("passed/*.paint.h5")):
        passed += 1
        expected = json.loads(path.with_name(path.name.replace(".paint.h5", ".json")).read_text())
        if read(path) != expected:
            wrong += 1
            print(f"{path}: differs")
    for path in sorted(folder.glob("failed/*.paint.h5")):
        failed += 1
        try:
            read(path)
        except Refused:
            continue
        wrong += 1
        print(f"{path}: was read")
    print(f"{passed} files read, {failed} refused" if not wrong else f"{wrong} wrong")
    return wrong or not passed or not failed


def main(args):
    if args[:1] == ["--vectors"]:
        return 1 if check_vectors(pathlib.Path(args[1])) else 0
    if args[:1] == ["--bake"]:
        return bake_file(args[1], args[2], [int(v) for v in args[3:6]] or [230, 230, 230])
    try:
        found = read(args[0])
    except Refused as why:
        print(f"{args[0]}: {why}", file=sys.stderr)
        return 1
    if len(args) == 1:
        print(json.dumps(found, indent=1, ensure_ascii=False))
        return 0
    same = found == json.loads(pathlib.Path(args[1]).read_text())
    print("as expected" if same else "differs")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
