"""Checks exports of simplified surfaces. Decodes KHR_mesh_quantization and EXT_meshopt_compression by the
specification, and shares no code with the writers.

    surface_export.py torus FACES OUT.ply [SHIFT [SCALE]]    writes a coloured torus with waves
    surface_export.py glb OUT.glb MODEL ERROR        the surface is within ERROR of the model, and the model of it
    surface_export.py tiles FOLDER MODEL             3D Tiles: errors, bounds, faces, references

Prints "fine: N triangles". Distances are those of `ebpo distance`, to the model and to the decoded surface, which is
converted for this purpose.
"""
import json
import math
import os
import random
import struct
import subprocess
import sys

POINTS = 2000 # for distances, in each direction
SLACK = 1 + 1e-6


# --- a model ---

def torus(faces, path, shift, scale):
    around = round(math.sqrt(faces))
    rings = faces // (2 * around)
    points = []
    for i in range(rings):
        for k in range(around):
            a, b = 2 * math.pi * i / rings, 2 * math.pi * k / around
            r = 1 + 0.05 * math.sin(9 * a) * math.cos(7 * b)
            out = 3 + r * math.cos(b)
            points.append((shift + out * math.cos(a), out * math.sin(a), 0.7 * r * math.sin(b)))
    triangles = []
    for i in range(rings):
        for k in range(around):
            a, b, c, d = (x % rings * around + y % around for x, y in ((i, k), (i + 1, k), (i + 1, k + 1), (i, k + 1)))
            triangles += [(a, b, c), (a, c, d)]
    columns = "".join(f"property float {c}\n" for c in "xyz") + "".join(f"property uchar {c}\n" for c in ("red", "green", "blue"))
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{columns}element face {len(triangles)}\n"
            "property list uchar int vertex_indices\nend_header\n")
    with open(path, "wb") as f:
        f.write(head.encode())
        for number, p in enumerate(points):
            f.write(struct.pack("<3f3B", *(scale * x for x in p), 200, number * 255 // len(points), 30))
        for t in triangles:
            f.write(struct.pack("<B3i", 3, *t))


# --- decoding: Khronos, EXT_meshopt_compression, appendix A ---

def unzigzag(v):
    return ~(v >> 1) if v & 1 else v >> 1


def decode_attributes(data, count, stride):
    assert data[0] == 0xa0
    most = min((8192 // stride) & ~15, 256)
    at, out = 1, bytearray(count * stride)
    last = list(data[len(data) - stride:])
    for first in range(0, count, most):
        n = min(most, count - first)
        groups = (n + 15) // 16
        for k in range(stride):
            heads = data[at:at + (groups + 3) // 4]
            at += len(heads)
            for g in range(groups):
                way = heads[g // 4] >> 2 * (g % 4) & 3
                deltas = [0] * 16
                if way == 3:
                    deltas = list(data[at:at + 16])
                    at += 16
                elif way:
                    bits = 2 * way
                    packed = data[at:at + 2 * bits]
                    at += 2 * bits
                    for i in range(16):
                        deltas[i] = packed[i * bits // 8] >> (8 - bits - i * bits % 8) & (1 << bits) - 1
                    for i in range(16):
                        if deltas[i] == (1 << bits) - 1:
                            deltas[i] = data[at]
                            at += 1
                for i in range(min(16, n - 16 * g)):
                    last[k] = (last[k] + unzigzag(deltas[i])) & 255
                    out[(first + 16 * g + i) * stride + k] = last[k]
    assert at + max(32, stride) == len(data), "bytes are left"
    return bytes(out)


def decode_triangles(data, count):
    assert data[0] == 0xe1 and data[-2:] == b"\0\0" and all(b >> 4 != 15 and b & 15 != 15 for b in data[-16:])
    codes, at, table = data[1:1 + count], 1 + count, data[-16:]
    edges, vertices, state = [], [], {"next": 0, "last": 0}
    out = []

    def number():
        nonlocal at
        v = shift = 0
        while True:
            byte = data[at]
            at += 1
            v |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                state["last"] += unzigzag(v)
                return state["last"] & 0xffffffff

    def fresh():
        state["next"] += 1
        return state["next"] - 1

    for code in codes:
        x, y = code >> 4, code & 15
        if x < 15:
            a, b = edges[-1 - x]
            if y == 0:
                c = fresh()
            elif y < 13:
                c = vertices[-1 - y]
            elif y < 15:
                state["last"] += 1 if y == 14 else -1
                c = state["last"]
            else:
                c = number()
            edges += [(c, b), (a, c)]
            if y == 0 or y >= 13:
                vertices.append(c)
        else:
            extra = table[y]
            if y >= 14:
                extra = data[at]
                at += 1
                if extra == 0:
                    state["next"] = 0
            a = fresh() if y < 15 else number()
            z, w = extra >> 4, extra & 15
            recent = list(vertices)
            b = fresh() if z == 0 else number() if z == 15 else recent[-z]
            c = fresh() if w == 0 else number() if w == 15 else recent[-w]
            edges += [(b, a), (c, b), (a, c)]
            vertices += [a] + [b] * (z in (0, 15)) + [c] * (w in (0, 15))
        out.append((a, b, c))
        del edges[:-16], vertices[:-16]
    assert at + 16 == len(data), "bytes are left"
    return out


def read_glb(path):
    """Returns positions and normals in the scene's coordinates, colours or None, and triangles."""
    with open(path, "rb") as f:
        data = f.read()
    magic, version, total, length, kind = struct.unpack_from("<4s4I", data)
    assert (magic, version, total, kind) == (b"glTF", 2, len(data), 0x4E4F534A) and length % 4 == 0
    text = json.loads(data[20:20 + length])
    size, kind = struct.unpack_from("<2I", data, 20 + length)
    binary = data[28 + length:]
    assert kind == 0x004E4942 and len(binary) == size == text["buffers"][0]["byteLength"] and size % 4 == 0
    assert set(text["extensionsRequired"]) == {"KHR_mesh_quantization", "EXT_meshopt_compression"}
    assert text["buffers"][1]["extensions"]["EXT_meshopt_compression"]["fallback"]
    bytes_of = {5120: 1, 5121: 1, 5123: 2, 5125: 4, 5126: 4}
    letter = {5120: "b", 5121: "B", 5123: "H", 5125: "I", 5126: "f"}

    def values(number):
        accessor = text["accessors"][number]
        view = text["bufferViews"][accessor["bufferView"]]
        packed = view["extensions"]["EXT_meshopt_compression"]
        code = binary[packed["byteOffset"]:packed["byteOffset"] + packed["byteLength"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        assert packed["byteOffset"] % 4 == 0 and view["byteOffset"] % 4 == 0
        assert view["byteLength"] == packed["count"] * packed["byteStride"] and packed["count"] == accessor["count"]
        assert view["byteOffset"] + view["byteLength"] <= text["buffers"][1]["byteLength"]
        if packed["mode"] == "TRIANGLES":
            assert view["target"] == 34963 and packed["byteStride"] == bytes_of[accessor["componentType"]]
            return decode_triangles(code, accessor["count"] // 3), accessor
        assert view["target"] == 34962 and view["byteStride"] == packed["byteStride"] and view["byteStride"] % 4 == 0
        plain = decode_attributes(code, packed["count"], packed["byteStride"])
        padding = packed["byteStride"] - width * bytes_of[accessor["componentType"]]
        form = f"<{width}{letter[accessor['componentType']]}{padding}x"
        return list(struct.iter_unpack(form, plain)), accessor

    node = text["nodes"][text["scenes"][0]["nodes"][0]]
    m = node["matrix"]
    primitive, = text["meshes"][node["mesh"]]["primitives"]
    stored, accessor = values(primitive["attributes"]["POSITION"])
    assert accessor["min"] == [min(p[k] for p in stored) for k in range(3)]
    assert accessor["max"] == [max(p[k] for p in stored) for k in range(3)]
    points = [tuple(sum(m[4 * j + k] * p[j] for j in range(3)) + m[12 + k] for k in range(3)) for p in stored]
    squares = [sum(m[4 * j + k] ** 2 for k in range(3)) for j in range(3)]
    normals = []
    for n in values(primitive["attributes"]["NORMAL"])[0]: # by the inverse transpose
        out = [sum(m[4 * j + k] / squares[j] * n[j] for j in range(3)) for k in range(3)]
        length = math.sqrt(sum(x * x for x in out))
        normals.append(tuple(x / length for x in out))
    colours = values(primitive["attributes"]["COLOR_0"])[0] if "COLOR_0" in primitive["attributes"] else None
    triangles, accessor = values(primitive["indices"])
    assert max(map(max, triangles)) == len(points) - 1 and len(normals) == len(points)
    assert accessor["componentType"] == (5123 if len(points) <= 65535 else 5125)
    return points, normals, colours, triangles


# --- distances ---

def distances(model, points):
    text = "".join(f"{p[0]!r} {p[1]!r} {p[2]!r}\n" for p in points)
    done = subprocess.run(["ebpo", "distance", "--unsigned", model], input=text, capture_output=True, text=True, check=True)
    return [float(line.split()[0]) for line in done.stdout.splitlines()]


def samples(points, triangles, dice):
    for _ in range(POINTS):
        a, b, c = (points[v] for v in dice.choice(triangles))
        u, v = sorted((dice.random(), dice.random()))
        yield tuple(u * p + (v - u) * q + (1 - v) * r for p, q, r in zip(a, b, c))


def converted(points, triangles, path):
    with open(path + ".obj", "w", encoding="ascii") as f:
        f.write("".join(f"v {p[0]!r} {p[1]!r} {p[2]!r}\n" for p in points))
        f.write("".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in triangles))
    subprocess.run(["ebpo", "convert", "-q", path + ".obj", path], capture_output=True, check=True)
    return path


def mesh_of(model):
    """Returns the points and triangles of a model of torus()."""
    subprocess.run(["ebpo", "extract", "-q", "--mesh", model, "mesh-of.ply"], check=True)
    with open("mesh-of.ply", "rb") as f:
        head, _, data = f.read().partition(b"end_header\n")
    count = {line.split()[1]: int(line.split()[2]) for line in head.decode().splitlines() if line.startswith("element")}
    faces = data[15 * count["vertex"]:]
    assert len(faces) == 13 * count["face"]
    return [v[:3] for v in struct.iter_unpack("<3f3B", data[:-len(faces)])], [f[1:] for f in struct.iter_unpack("<B3i", faces)]


def check_normals(points, normals, triangles):
    good = 0
    for t in triangles:
        a, b, c = (points[v] for v in t)
        u, v = [q - p for p, q in zip(a, b)], [q - p for p, q in zip(a, c)]
        face = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
        good += all(sum(x * y for x, y in zip(face, normals[i])) > 0 for i in t)
    assert good > 0.97 * len(triangles), (good, len(triangles))


def check_glb(path, model, error):
    dice = random.Random(1)
    points, normals, colours, triangles = read_glb(path)
    model_points, model_faces = mesh_of(model)
    check_normals(points, normals, triangles)
    assert max(distances(model, samples(points, triangles, dice))) <= error * SLACK
    surface = converted(points, triangles, "decoded.ebpo.h5")
    assert max(distances(surface, samples(model_points, model_faces, dice))) <= error * SLACK
    welded = [[points[v] for v in t] for t in triangles]  # vertices at creases are repeated
    edges = {e for a, b, c in welded for e in ((a, b), (b, c), (c, a))}
    assert len(edges) == 3 * len(triangles) and all((b, a) in edges for a, b in edges), "not closed"
    assert all(37100 < c[0] < 38600 and c[3] == 65535 for c in colours), colours[:3] # red is 200 in sRGB
    return len(triangles)


# --- tiles ---

def outside(box, point):
    centre, half = box[:3], (box[3], box[7], box[11])
    return any(abs(p - c) > h for p, c, h in zip(point, centre, half))


def check_tiles(folder, model):
    dice = random.Random(2)
    with open(os.path.join(folder, "tileset.json"), encoding="utf-8") as f:
        tileset = json.load(f)
    assert tileset["asset"]["version"] == "1.1" and tileset["root"]["refine"] == "REPLACE"
    origin = tileset["root"]["transform"][12:15]
    model_points, model_faces = mesh_of(model)
    wanted = sorted(tuple(sorted(model_points[v] for v in f)) for f in model_faces)
    named, found, far = {"tileset.json"}, [], [0.0, 0]

    def visit(tile, above, error, level):
        nonlocal far
        assert tile["geometricError"] <= error, "errors do not decrease"
        name = tile["content"]["uri"]
        assert name not in named
        named.add(name)
        points, normals, _, triangles = read_glb(os.path.join(folder, name))
        points = [(x, -z, y) for x, y, z in points] # readers turn y to z
        normals = [(x, -z, y) for x, y, z in normals]
        check_normals(points, normals, triangles)
        boxes = above + [tile["boundingVolume"]["box"]]
        assert not any(outside(box, p) for box in boxes for p in points)
        world = [tuple(a + b for a, b in zip(p, origin)) for p in points]
        if tile["geometricError"] > 0:
            reached = max(distances(model, list(samples(world, triangles, dice))[:300]))
            assert reached <= tile["geometricError"] * SLACK, (reached, tile["geometricError"])
            far = max(far, [reached / tile["geometricError"], level])
        children = tile.get("children", [])
        if not children:
            found.extend(tuple(sorted(world[v] for v in t)) for t in triangles)
        return len(triangles) + sum(visit(child, boxes, tile["geometricError"], level + 1) for child in children)

    count = visit(tileset["root"], [], tileset["geometricError"], 0)
    assert set(os.listdir(folder)) == named, "other files"
    assert far[0] > 0.2, "errors are far from the distances"
    if origin == [0, 0, 0]:
        assert sorted(found) == wanted, "the finest tiles have other faces"
    else:
        assert len(found) == len(wanted)
    return count


if sys.argv[1] == "torus":
    torus(int(sys.argv[2]), sys.argv[3], *(float(x) for x in (sys.argv[4:] + ["0", "1"][len(sys.argv) - 4:])))
elif sys.argv[1] == "glb":
    print(f"fine: {check_glb(sys.argv[2], sys.argv[3], float(sys.argv[4]))} triangles")
else:
    print(f"fine: {check_tiles(sys.argv[2], sys.argv[3])} triangles")
