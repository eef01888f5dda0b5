"""envelopes_hold.py OUT.xdmf|OUT.vtkhdf INFO.json NODES.json SOURCE.ply: compares the output of ebpo export,
read with h5py, with that of ebpo info and ebpo levels --nodes.

Every envelope is a closed polyhedron in its node's cell, with its stated volume. The nodes of a level cover
each position once, and their volumes add up to that of the level. The mesh is the source mesh, in the
order of source indices.
"""
import json
import math
import os
import sys
import xml.etree.ElementTree

import h5py
import numpy

import export_reads

GRAY, LEAF, BLACK = 3, 2, 1
TYPE_NAMES = ["white", "black", "leaf", "gray"]


def xdmf_blocks(path):
    """Returns name -> points, cells (polyhedra as lists of polygons, or triangles), data by name."""
    top = xml.etree.ElementTree.parse(path).getroot().find("Domain/Grid")
    assert top.get("GridType") == "Collection" and top.get("CollectionType") == "Spatial"
    used = set()

    def array(item):
        name, place = item.text.split(":")
        used.add((name, place))
        with h5py.File(os.path.join(os.path.dirname(path), name), "r") as f:
            values = f[place][...]
        assert list(values.shape) == [int(v) for v in item.get("Dimensions").split()], place
        assert (values.dtype.kind == {"Float": "f", "Int": "i"}[item.get("NumberType")]
                and values.itemsize == int(item.get("Precision")))
        return values

    blocks = {}
    for grid in top.findall("Grid"):
        topology = grid.find("Topology")
        cells = array(topology.find("DataItem"))
        if topology.get("TopologyType") == "Mixed":
            stream, cells = iter(cells.tolist()), []
            for kind in stream:
                assert kind == 16
                cells.append([[next(stream) for _ in range(next(stream))]
                              for _ in range(next(stream))])
        assert len(cells) == int(topology.get("NumberOfElements"))
        data = {a.get("Name"): array(a.find("DataItem")) for a in grid.findall("Attribute")}
        blocks[grid.get("Name")] = array(grid.find("Geometry/DataItem")), cells, data
    with h5py.File(path + ".h5", "r") as f:
        stored = []
        f.visititems(lambda name, item: stored.append("/" + name) if isinstance(item, h5py.Dataset)
                     else None)
    assert sorted(stored) == sorted(place for _, place in used)
    return blocks


def vtkhdf_blocks(path):
    """Returns the same value from the partitions. Polygons of one node become one cell."""
    blocks = {}
    with h5py.File(path, "r") as f:
        top = f["VTKHDF"]
        assert list(top.attrs["Version"]) == [1, 0] and top.attrs["Type"] == b"UnstructuredGrid"
        point = corner = cell = offset = 0
        for points, cells, corners in zip(top["NumberOfPoints"], top["NumberOfCells"],
                                          top["NumberOfConnectivityIds"]):
            offsets = top["Offsets"][offset:offset + cells + 1]
            ids = top["Connectivity"][corner:corner + corners]
            assert offsets[0] == 0 and offsets[-1] == corners
            polygons = [ids[a:b].tolist() for a, b in zip(offsets[:-1], offsets[1:])]
            data = {name: values[cell:cell + cells] for name, values in top["CellData"].items()}
            data["source_vertex"] = top["PointData/source_vertex"][point:point + points]
            types = top["Types"][cell:cell + cells]
            where = top["Points"][point:point + points]
            lod, = set(data["lod"].tolist())
            if lod < 0:
                assert (types == 5).all()
                blocks["mesh"] = where, numpy.array(polygons), data
            else:
                assert (types == 7).all() and (data["source_face"] == -1).all()
                first = numpy.flatnonzero(numpy.r_[True,
                                                   data["octcode"][1:] != data["octcode"][:-1]])
                whole = [polygons[a:b] for a, b in zip(first, [*first[1:], cells])]
                blocks[f"level_{lod:02d}"] = where, whole, {k: v[first] for k, v in data.items()
                                                            if k != "source_vertex"}
            point, corner, cell, offset = point + points, corner + corners, cell + cells, offset + cells + 1
        assert (point == len(top["Points"]) and cell == len(top["Types"])
                and corner == len(top["Connectivity"]) and offset == len(top["Offsets"]))
    return blocks


def cell_of(octcode, info):
    level = (octcode.bit_length() - 1) // 3
    at = [sum((octcode >> 3 * i + k & 1) << i for i in range(level)) for k in range(3)]
    low = [o + a * s / 2**level for o, a, s in zip(info["box_origin"], at, info["box_size"])]
    return level, numpy.array(low), numpy.array(info["box_size"]) / 2**level


def check_polyhedron(points, polygons):
    """Checks that the polyhedron is closed: each edge occurs once in each direction. Returns the volume."""
    edges = set()
    volume = 0.0
    middle = points[polygons[0][0]]
    for polygon in polygons:
        assert len(polygon) >= 3 and min(polygon) >= 0 and max(polygon) < len(points)
        for a, b in zip(polygon, polygon[1:] + polygon[:1]):
            assert (a, b) not in edges
            edges.add((a, b))
        p = points[polygon] - middle
        for b, c in zip(p[1:-1], p[2:]):
            volume += numpy.dot(p[0], numpy.cross(b, c)) / 6
    assert all((b, a) in edges for a, b in edges)
    return volume


def check_level(number, points, cells, data, info, nodes):
    levels = info["levels"]
    assert len(cells) == levels[number]["gray"] + sum(v["leaf"] + v["black"]
                                                      for v in levels[:number + 1])
    assert all(len(values) == len(cells) for values in data.values())
    codes = data["octcode"].tolist()
    all_codes = set(codes)
    assert (len(all_codes) == len(codes) and not any(code >> 3 * i in all_codes for code in codes
                                                     for i in range(1, number + 1)))
    used = 0
    for i, (code, polygons) in enumerate(zip(codes, cells)):
        level, low, size = cell_of(code, info)
        kind = data["type"][i]
        assert (level == data["level"][i] <= number and kind in (GRAY, LEAF, BLACK)
                and (kind != GRAY or level == number))
        assert (TYPE_NAMES[kind], data["winding"][i]) == nodes[code]
        corners = sorted({c for polygon in polygons for c in polygon})
        used += len(corners)
        assert ((points[corners] >= low - 1e-12 * size).all()
                and (points[corners] <= low + size * (1 + 1e-12)).all())
        volume = check_polyhedron(points, polygons)
        assert (math.isclose(volume, data["volume"][i], rel_tol=1e-6,
                             abs_tol=1e-9 * size.prod())), (code, volume, data["volume"][i])
    assert used == len(points)
    for kind, name in ((LEAF, "leaf"), (BLACK, "black")):
        for level in range(number + 1):
            assert ((data["type"] == kind) & (data["level"] == level)).sum() == levels[level][name]
    stated, derived = levels[number]["envelope_volume"], any(l["leaf"] and not l["leaf_planes"]
                                                             for l in levels[: number + 1])
    total = math.fsum(data["volume"])
    # derived planes cut off more than the volumes in the file
    assert math.isclose(total, stated, rel_tol=1e-9) or (derived and 0 < total < stated)


def check_mesh(points, cells, data, source):
    model, faces = export_reads.ply(source)
    vertex, face = data["source_vertex"], data["source_face"]
    assert (sorted(vertex.tolist()) == list(range(len(model)))
            and sorted(face.tolist()) == list(range(len(faces))))
    assert (numpy.array(model)[vertex] == points).all()
    for triangle, number in zip(vertex[cells].tolist(), face.tolist()):
        wanted = list(faces[number])
        assert any(triangle == wanted[k:] + wanted[:k] for k in range(3))


def main():
    path, about, reported, source = sys.argv[1:]
    with open(about, encoding="utf-8") as f:
        info = json.load(f)
    with open(reported, encoding="utf-8") as f:
        nodes = {n["octcode"]: (n["type"], n["winding"]) for level in json.load(f)["levels"]
                 for n in level["nodes"]}
    blocks = (xdmf_blocks if path.endswith(".xdmf") else vtkhdf_blocks)(path)
    assert (list(blocks) == [f"level_{i:02d}"
                             for i in range(len(info["levels"]))] + ["mesh"]), list(blocks)
    for name, (points, cells, data) in blocks.items():
        if name == "mesh":
            check_mesh(points, cells, data, source)
        else:
            check_level(int(name[6:]), points, cells, data, info, nodes)
    print("fine")


main()
