"""colours_agree.py paint SOURCE.ply PAINTED.ply: writes a binary PLY with colours of vertices and faces.
colours_agree.py OUT SOURCE.ply: checks the colours in the output of ebpo export for the painted mesh.

XDMF and VTKHDF have bytes for vertices and faces (read with h5py), glTF has linear u16 and OBJ fractions
of 1 for vertices. Levels have colours of vertices. XDMF and VTKHDF vertices are found by source indices,
the others by their positions.
"""
import json
import os
import struct
import sys
import xml.etree.ElementTree

import export_reads


def vertex(i):
    return (37 * i % 256, i % 256, 255 - 5 * i % 256, 3 * i % 256)


def face(i):
    return (i % 256, 11 * i % 256, 83 * i % 256, 255)


def paint(source, out):
    points, faces = export_reads.ply(source)
    channels = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue", "alpha"))
    with open(out, "wb") as f:
        f.write((f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
                 f"property float x\nproperty float y\nproperty float z\n{channels}"
                 f"element face {len(faces)}\nproperty list uchar int vertex_indices\n{channels}"
                 "end_header\n").encode())
        for i, p in enumerate(points):
            f.write(struct.pack("<3f4B", *p, *vertex(i)))
        for i, corners in enumerate(faces):
            f.write(struct.pack("<B3i4B", 3, *corners, *face(i)))


def linear(c):
    c /= 255
    return round(65535 * (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055)**2.4))


def check_gltf(path, points):
    with open(path) as f:
        text = json.load(f)
    with open(os.path.join(os.path.dirname(path), text["buffers"][0]["uri"]), "rb") as f:
        binary = f.read()
    by_name = {m["name"]: m["primitives"][0] for m in text["meshes"]}
    for name, primitive in by_name.items():
        factor = text["materials"][primitive["material"]]["pbrMetallicRoughness"]
        assert "COLOR_0" in primitive["attributes"] and "baseColorFactor" not in factor, name
    accessor = text["accessors"][by_name["mesh"]["attributes"]["COLOR_0"]]
    assert (accessor["componentType"], accessor["type"], accessor["normalized"]) == (5123, "VEC4", True)
    view = text["bufferViews"][accessor["bufferView"]]
    assert accessor["count"] == len(points) and view["byteLength"] == 8 * len(points)
    assert view["byteOffset"] % 4 == 0
    found = struct.iter_unpack("<4H", binary[view["byteOffset"]:][:view["byteLength"]])
    for i, row in enumerate(found):
        *rgb, alpha = vertex(i)
        assert row == (*map(linear, rgb), 257 * alpha), (i, row, vertex(i))


def check_obj(path, points):
    at = {p: i for i, p in enumerate(points)}
    seen = set()
    with open(path, encoding="ascii") as f:
        for words in map(str.split, f):
            if words[:1] == ["v"] and len(words) == 7:
                xyz = struct.unpack("<3f", struct.pack("<3f", *map(float, words[1:4])))
                i = at[xyz]
                assert tuple(round(255 * float(c)) for c in words[4:]) == vertex(i)[:3], words
                seen.add(i)
    assert len(seen) == len(points), len(seen)


def check_numbers(numbers, rows, wanted, others):
    """Checks colours of rows. Rows of the mesh follow those of levels, whose polygons are white."""
    assert rows.shape == (others + len(numbers), 4) and rows.dtype == "uint8", rows.shape
    assert (rows[:others, 3] == 255).all()
    assert not others or (rows[:others] == 255).all() == (wanted is face)
    for number, row in zip(numbers, rows[others:]):
        assert tuple(row) == wanted(int(number)), (number, row)


def check_vtkhdf(path):
    import h5py
    with h5py.File(path, "r") as f:
        for group, source, wanted in (("PointData", "source_vertex", vertex),
                                      ("CellData", "source_face", face)):
            numbers = f["VTKHDF"][group][source][...]
            others = int((numbers < 0).sum())
            assert (numbers[:others] < 0).all()
            check_numbers(numbers[others:], f["VTKHDF"][group]["rgba"][...], wanted, others)


def check_xdmf(path):
    import h5py
    grids = xml.etree.ElementTree.parse(path).getroot().findall("Domain/Grid/Grid")
    for grid in grids:
        data = {(a.get("Name"), a.get("Center")): a for a in grid.findall("Attribute")}
        assert ("rgba", "Node") in data
        assert (("rgba", "Cell") in data) == (grid.get("Name") == "mesh")
    for centre, source, wanted in (("Node", "source_vertex", vertex), ("Cell", "source_face", face)):
        arrays = []
        for name in (source, "rgba"):
            item = data[name, centre].find("DataItem")
            heavy, place = item.text.split(":")
            with h5py.File(os.path.join(os.path.dirname(path), heavy), "r") as f:
                arrays.append(f[place][...])
        assert item.get("NumberType") == "UChar" and item.get("Precision") == "1"
        assert item.get("Dimensions") == f"{len(arrays[0])} 4"
        check_numbers(*arrays, wanted, 0)


if sys.argv[1] == "paint":
    paint(*sys.argv[2:])
    sys.exit()
ending = sys.argv[1].rsplit(".", 1)[1]
if ending in ("gltf", "obj"):
    {"gltf": check_gltf, "obj": check_obj}[ending](sys.argv[1], export_reads.ply(sys.argv[2])[0])
else:
    {"xdmf": check_xdmf, "vtkhdf": check_vtkhdf}[ending](sys.argv[1])
print("fine")
