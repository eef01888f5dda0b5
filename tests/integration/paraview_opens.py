"""paraview_opens.py FOLDER [PICTURE]: pvpython runs this script.

Checks that ParaView reads the files in FOLDER as the JSON beside each describes them, or that the picture shows an
object.
"""
import json
import math
import os
import sys

from paraview import servermanager
from paraview.simple import Xdmf3ReaderT, VTKHDFReader, OpenDataFile
from vtkmodules.vtkIOImage import vtkPNGReader

folder = sys.argv[1]
POLYHEDRON, POLYGON, TRIANGLE = 42, 7, 5
OF_NODES = {"octcode", "level", "type", "winding", "volume"}


def reported(name):
    with open(os.path.join(folder, name + ".json"), encoding="utf-8") as f:
        return json.load(f)["blocks"]


def fetched(reader):
    reader.UpdatePipeline()
    return servermanager.Fetch(reader)


def arrays(data):
    return {data.GetArrayName(i): data.GetArray(i) for i in range(data.GetNumberOfArrays())}


def cell_types(grid):
    return {grid.GetCellType(i) for i in range(grid.GetNumberOfCells())}


def check_xdmf():
    data = fetched(Xdmf3ReaderT(FileName=[os.path.join(folder, "model.xdmf")]))
    blocks = reported("xdmf")
    assert data.GetNumberOfBlocks() == len(blocks) >= 3
    for i, wanted in enumerate(blocks):
        grid, name = data.GetBlock(i), data.GetMetaData(i).Get(data.NAME())
        values = arrays(grid.GetCellData())
        assert grid.GetNumberOfPoints() == wanted["vertices"], name
        if wanted["block"] == "mesh":
            assert (name == "mesh" and cell_types(grid) == {TRIANGLE}
                    and grid.GetNumberOfCells() == wanted["triangles"])
            assert (set(values) == {"source_face"}
                    and set(arrays(grid.GetPointData())) == {"source_vertex"})
            continue
        assert (name == f"level_{wanted['level']:02d}" and cell_types(grid) == {POLYHEDRON}
                and grid.GetNumberOfCells() == wanted["envelopes"])
        assert set(values) == OF_NODES
        assert sum(grid.GetCell(k).GetNumberOfFaces()
                   for k in range(grid.GetNumberOfCells())) == wanted["polygons"]
        volume = sum(values["volume"].GetValue(k) for k in range(grid.GetNumberOfCells()))
        assert 0 < volume <= wanted["volume"] * (1 + 1e-9)
        low, size = grid.GetBounds()[::2], max(b - a
                                               for a, b in zip(grid.GetBounds()[::2],
                                                               grid.GetBounds()[1::2]))
        assert size > 0 and all(math.isfinite(v) for v in low)


def check_vtkhdf():
    grid = fetched(VTKHDFReader(FileName=[os.path.join(folder, "model.vtkhdf")]))
    blocks = reported("vtkhdf")
    values = arrays(grid.GetCellData())
    assert (grid.GetNumberOfPoints() == sum(b["vertices"] for b in blocks)
            and grid.GetNumberOfCells() == sum(b["polygons"] for b in blocks))
    assert (cell_types(grid) == {POLYGON, TRIANGLE}
            and set(values) == OF_NODES | {"lod", "source_face"})
    lods = [int(values["lod"].GetValue(i)) for i in range(grid.GetNumberOfCells())]
    for wanted in blocks:
        assert lods.count(wanted.get("level", -1)) == wanted["polygons"]


def check_glb():
    data = fetched(OpenDataFile(os.path.join(folder, "model.glb")))
    wanted, = reported("glb")
    assert (data.GetNumberOfCells() == wanted["triangles"]
            and data.GetNumberOfPoints() == wanted["vertices"])


def check_picture(name):
    reader = vtkPNGReader()
    reader.SetFileName(os.path.join(folder, name))
    reader.Update()
    image = reader.GetOutput()
    width, height = image.GetDimensions()[:2]
    for left in (0, width // 2):  # each half shows a large object with many shades
        seen = [tuple(image.GetScalarComponentAsFloat(x, y, 0, k) for k in range(3))
                for x in range(left, left + width // 2, 4) for y in range(0, height, 4)]
        shown = [c for c in seen if c != (255, 255, 255)]
        assert len(shown) > len(seen) / 10 and len(set(shown)) > 50, (len(shown), len(set(shown)))


if len(sys.argv) > 2:
    check_picture(sys.argv[2])
else:
    check_xdmf()
    check_vtkhdf()
    check_glb()
print("OK")
