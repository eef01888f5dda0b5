#!/usr/bin/env python3
"""Compares the results of `ebpo paint` with the second reader (format-spec/read_paint.py):

paint_reads.py vectors             reads or refuses all files of format-spec/vectors/paint
paint_reads.py areas PAINT MODEL   compares each layer's area with points strewn over faces
paint_reads.py moved PAINT OUT     writes a paint with a point of stroke 1 beside its face, and correct checksums
paint_reads.py waits PAINT         checks that a change waits for another program's lock
paint_reads.py baked PAINT MODEL PLY [GLB]    MODEL: without custom filters (convert --codec deflate)

Baked colours are compared bit by bit with those that the reader finds by moving from face to face. All other
data of the PLY is compared with `ebpo extract --mesh`.
"""
import json
import pathlib
import struct
import subprocess
import sys

SPEC = pathlib.Path(__file__).resolve().parents[2] / "format-spec"
sys.path.insert(0, str(SPEC))
sys.dont_write_bytecode = True

DERIVED = ("stroke_count", "point_count", "note_count")


def without_counts(value):
    if isinstance(value, dict):
        return {k: without_counts(v) for k, v in value.items() if k not in DERIVED}
    return [without_counts(v) for v in value] if isinstance(value, list) else value


def vectors():
    folder, wrong = SPEC / "vectors" / "paint", []
    for path in sorted(folder.glob("passed/*.paint.h5")):
        done = subprocess.run(["ebpo", "paint", "--json", "--points", path], capture_output=True, text=True)
        reported = without_counts(json.loads(done.stdout or "{}"))
        expected = json.loads(path.with_name(path.name.replace(".paint.h5", ".json")).read_text())
        if {k: reported.get(k) for k in expected} != expected:
            wrong.append(f"{path.name} is reported differently {done.stderr}")
    for path in sorted(folder.glob("failed/*.paint.h5")):
        done = subprocess.run(["ebpo", "paint", path], capture_output=True, text=True)
        if done.returncode != 1 or done.stdout or path.name not in done.stderr:
            wrong.append(f"{path.name}: {done.returncode} {done.stderr}")
    return wrong


def ply(path):
    """Returns the vertices as a structured array, and the bytes after them."""
    import numpy as np
    head, body = pathlib.Path(path).read_bytes().split(b"end_header\n", 1)
    types = {"float": "<f4", "double": "<f8", "uchar": "u1", "ushort": "<u2", "short": "<i2", "char": "i1", "int": "<i4", "uint": "<u4"}
    fields, count, element = [], 0, ""
    for line in head.decode().splitlines():
        words = line.split()
        if words[0] == "element":
            element = words[1]
            count = int(words[2]) if element == "vertex" else count
        elif words[0] == "property" and element == "vertex":
            fields.append((words[2], types[words[1]]))
    rows = np.frombuffer(body, np.dtype(fields), count)
    return rows, body[rows.nbytes:]


def glb_colours(path):
    import numpy as np
    data = pathlib.Path(path).read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    facts, bin_at = json.loads(data[20:20 + length]), 20 + length + 8
    accessor = facts["accessors"][facts["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]]
    at = bin_at + facts["bufferViews"][accessor["bufferView"]]["byteOffset"]
    return np.frombuffer(data, "<u2", 4 * accessor["count"], at).reshape(-1, 4)[:, :3]


def linear(c):
    c = c / 255.0
    return int(65535 * (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4) + 0.5)


def read_both(paint_path, model):
    """Returns the paint, with the rows of its points' faces, and the model's vertices, faces, vertex numbers."""
    import h5py
    import numpy as np
    import read_ebpo
    import read_paint
    paint = read_paint.read(paint_path)
    with h5py.File(model, "r") as file:
        faces = read_ebpo.faces(file["/mesh/faces"]).reshape(-1, 3).tolist()
        vertices = read_ebpo.vertices(file["/mesh/vertices"]).reshape(-1, 3).astype("f8").tolist()
        numbers = read_ebpo.delta(file["/maps/face_source"]).tolist() if "maps" in file else range(len(faces))
        source = read_ebpo.delta(file["/maps/vertex_source"]) if "maps" in file else np.arange(len(vertices))
    rows = {n: i for i, n in enumerate(numbers)}
    for stroke in paint["strokes"]:
        for point in stroke["points"]:
            point["row"] = rows.get(point["face"])
    return paint, vertices, faces, source


def middles(corners, n):
    """Returns the middles of the n^2 equal parts of a triangle."""
    a, b, c = corners
    for i in range(n):
        for k in range(2 * (n - i) - 1):
            u, v = ((i + 1 / 3, k // 2 + 1 / 3) if k % 2 == 0 else (i + 2 / 3, k // 2 + 2 / 3))
            yield [a[x] + (b[x] - a[x]) * u / n + (c[x] - a[x]) * v / n for x in range(3)]


def areas(paint_path, model, n=24):
    import numpy as np
    import read_paint
    done = subprocess.run(["ebpo", "paint", "--json", "--area", paint_path, model], capture_output=True, check=True)
    reported = json.loads(done.stdout)["areas"]
    paint, vertices, faces, _ = read_both(paint_path, model)
    by_corner = {}
    for i, face in enumerate(faces):
        for v in face:
            by_corner.setdefault(tuple(vertices[v]), []).append(i)
    reached, wrong = {}, []
    for i, stroke in enumerate(paint["strokes"]):
        for point in stroke["points"]:
            found, p, square = read_paint.reach(point, stroke["radius"], vertices, faces, by_corner)
            for face in found:
                reached.setdefault(face, {}).setdefault(stroke["layer"], []).append((i, p, square))
    sums = [0.0] * len(paint["layers"])
    for face, layers in reached.items():
        corners = [vertices[v] for v in faces[face]]
        part = float(np.linalg.norm(np.cross(np.subtract(corners[1], corners[0]), np.subtract(corners[2], corners[0])))) / 2 / n ** 2
        for q in middles(corners, n):
            for layer, balls in layers.items():
                last = max((i for i, p, square in balls if read_paint.within(p, square, q)), default=None)
                sums[layer] += part if last is not None and paint["strokes"][last]["kind"] == "paints" else 0
    for layer, (found, one) in enumerate(zip(sums, reported["layers"])):
        if abs(found - one["area"]) > 2e-3 * found or not one["lo"] <= one["area"] <= one["hi"] < 1.02 * one["lo"]:
            wrong.append(f"layer {layer}: {found}, reported {one}")
    return wrong


def baked(paint_path, model, out, glb=None):
    import numpy as np
    import read_paint
    subprocess.run(["ebpo", "extract", "-q", "--mesh", model, "own.ply"], check=True, stderr=subprocess.DEVNULL)
    own, own_rest = ply("own.ply")
    got, rest = ply(out)
    paint, vertices, faces, source = read_both(paint_path, model)
    place = np.argsort(np.argsort(source))
    names = ("red", "green", "blue")
    base = np.stack([own[n] for n in names], axis=1) if "red" in own.dtype.names else np.full((len(own), 3), 230)
    reference = np.array(read_paint.bake(paint, vertices, faces, base[place].astype("f8").tolist()))
    colours = np.stack([got[n] for n in names], axis=1).astype(int)
    wrong = []
    if (colours[place] != reference).any():
        wrong.append(f"{(colours[place] != reference).any(axis=1).sum()} vertices have other colours")
    if not (colours != base).any():
        wrong.append("nothing is painted")
    if rest != own_rest or any(got[n].tobytes() != own[n].tobytes() for n in own.dtype.names if n not in names):
        wrong.append("the mesh is another one")
    if glb:
        table = np.array([linear(c) for c in range(256)])
        if (glb_colours(glb) != table[colours]).any():
            wrong.append("the GLB has other colours")
    return wrong


def moved(paint_path, out):
    import h5py
    pathlib.Path(out).write_bytes(pathlib.Path(paint_path).read_bytes())
    with h5py.File(out, "r+") as file:
        places = file["/points/place"][:]
        places.view("<f8")[file["/strokes/points"][0], 0] += .25
        file["/points/place"][:] = places
    return []


def waits(paint_path):
    import fcntl
    name, wrong = pathlib.Path(f".{paint_path}.lock"), []
    with open(name, "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        change = subprocess.Popen(["ebpo", "paint", "-q", paint_path, "--layer", "0", "--title", "X"])
        try:
            wrong.append(f"it did not wait: {change.wait(0.5)}")
        except subprocess.TimeoutExpired:
            name.unlink()
    if change.wait(60) != 0 or name.exists():
        wrong.append(f"it has waited, and failed: {change.returncode}")
    return wrong


def main(words):
    wrong = {"vectors": vectors, "areas": areas, "baked": baked, "moved": moved, "waits": waits}[words[0]](*words[1:])
    print("\n".join(wrong) or "fine")


if __name__ == "__main__":
    main(sys.argv[1:])
