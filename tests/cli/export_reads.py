"""Small readers of the formats that ebpo export writes, and of PLY: for tests. They share no code with the
writers.
"""
import json
import os
import struct


def ply(path):
    """Returns the points and triangles of a binary PLY."""
    with open(path, "rb") as f:
        data = f.read()
    at = data.index(b"end_header\n") + 11
    head = data[:at].decode().splitlines()
    count = {line.split()[1]: int(line.split()[2]) for line in head if line.startswith("element")}
    kind = "d" if "property double x" in head else "f"
    points = list(struct.iter_unpack("<3" + kind,
                                     data[at:at + count["vertex"] * 3 * struct.calcsize(kind)]))
    at += count["vertex"] * 3 * struct.calcsize(kind)
    faces = [f[1:] for f in struct.iter_unpack("<B3I", data[at:at + 13 * count["face"]])]
    assert len(data) == at + 13 * count["face"]
    return points, faces


def gltf(path):
    """Returns [(name, translation, points, triangles)] of a .gltf or .glb file."""
    with open(path, "rb") as f:
        data = f.read()
    if data[:4] == b"glTF":
        version, total, length, kind = struct.unpack_from("<4I", data, 4)
        assert version == 2 and total == len(data) and kind == 0x4E4F534A and length % 4 == 0
        text = json.loads(data[20:20 + length])
        size, kind = struct.unpack_from("<2I", data, 20 + length)
        assert kind == 0x004E4942 and 28 + length + size == total
        binary = data[28 + length:]
        assert "uri" not in text["buffers"][0]
    else:
        text = json.loads(data)
        with open(os.path.join(os.path.dirname(path), text["buffers"][0]["uri"]), "rb") as f:
            binary = f.read()
    assert text["asset"]["version"] == "2.0" and text["buffers"][0]["byteLength"] == len(binary)

    def values(number, kind, width, code):
        accessor = text["accessors"][number]
        view = text["bufferViews"][accessor["bufferView"]]
        assert (accessor["componentType"] == code and accessor["type"] == kind
                and view["byteOffset"] % 4 == 0)
        assert (view["byteLength"] == 4 * width * accessor["count"]
                and view["byteOffset"] + view["byteLength"] <= len(binary))
        form = "<" + str(width) + ("f" if code == 5126 else "I")
        return list(struct.iter_unpack(form,
                                       binary[view["byteOffset"]:view["byteOffset"] + view["byteLength"]])), accessor

    found = []
    for number in text["scenes"][text["scene"]]["nodes"]:
        node = text["nodes"][number]
        primitive, = text["meshes"][node["mesh"]]["primitives"]
        points, accessor = values(primitive["attributes"]["POSITION"], "VEC3", 3, 5126)
        assert accessor["min"] == [min(p[k] for p in points) for k in range(3)]
        assert accessor["max"] == [max(p[k] for p in points) for k in range(3)]
        corners = [c[0] for c in values(primitive["indices"], "SCALAR", 1, 5125)[0]]
        assert primitive["material"] < len(text["materials"]) and max(corners) < len(points)
        found.append((node["name"], node.get("translation", [0, 0, 0]), points,
                      list(zip(*[iter(corners)] * 3))))
    return found


def obj(path):
    """Returns [(name, [0, 0, 0], points, triangles)] of an OBJ file, one for each object or group."""
    points, found = [], []
    with open(path, encoding="ascii") as f:
        for line in f:
            words = line.split()
            if line.startswith("v "):
                points.append(tuple(struct.unpack("<f", struct.pack("<f", float(v)))[0]
                                    for v in words[1:]))
            elif line[:2] in ("o ", "g "):
                found.append((words[1], [0, 0, 0], points, []))
            elif line.startswith("f "):
                found[-1][3].append(tuple(int(w.split("/")[0]) - 1 for w in words[1:]))
    return [part for part in found if part[3]]


def stl(path):
    """Returns [("", [0, 0, 0], points, triangles)] of a binary STL."""
    with open(path, "rb") as f:
        data = f.read()
    count, = struct.unpack_from("<I", data, 80)
    assert len(data) == 84 + 50 * count
    points = [c for facet in struct.iter_unpack("<12fH", data[84:])
              for c in (facet[3:6], facet[6:9], facet[9:12])]
    return [("", [0, 0, 0], points, [(3 * i, 3 * i + 1, 3 * i + 2) for i in range(count)])]


def scene(path):
    ending = path.rsplit(".", 1)[1]
    return {"gltf": gltf, "glb": gltf, "obj": obj, "stl": stl}[ending](path)
