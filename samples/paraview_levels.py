"""Draws the output of `ebpo export FILE OUT.xdmf --levels A-B --mesh` with ParaView:

    xvfb-run -a pvpython samples/paraview_levels.py OUT.xdmf PICTURE.png [COARSE [FINE]]

The left picture shows half of the envelopes of level COARSE (default: 3) and half of the mesh that they
contain. The right picture shows the envelopes of level FINE (default: the last). Colours show the volumes
of the envelopes on a logarithmic scale."""
import os
import sys

from paraview.simple import (Clip, ColorBy, CreateLayout, CreateRenderView, ExtractBlock,
                             GetColorTransferFunction, SaveScreenshot, Show, Text,
                             Xdmf3ReaderT)

TALL = 560


def blocks(reader, *names):
    found = ExtractBlock(Input=reader, Selectors=["/Root/" + name for name in names])
    found.UpdatePipeline()
    return found


def grid_names(reader):
    hierarchy = reader.GetDataInformation().DataInformation.GetHierarchy()
    names = [hierarchy.GetNodeName(i) for i in range(40)]
    return [name for name in names if name and name != "Root"]


def show_envelopes(source, view, largest):
    display = Show(source, view)
    display.Representation = "Surface With Edges"
    display.EdgeColor = [0.16, 0.18, 0.24]
    ColorBy(display, ("CELLS", "volume"))
    colours = GetColorTransferFunction("volume")
    colours.ApplyPreset("Viridis (matplotlib)", True)
    colours.RescaleTransferFunction(largest / 4096, largest)
    colours.MapControlPointsToLogSpace()
    colours.UseLogScale = 1
    display.SetScalarBarVisibility(view, False)


def show_mesh(source, view):
    display = Show(source, view)
    ColorBy(display, None)
    display.AmbientColor = display.DiffuseColor = [0.85, 0.76, 0.64]
    display.Specular = 0.2


def half_of(source, middle, right):
    """Returns the whole cells of one side; no cell is cut."""
    half = Clip(Input=source, ClipType="Plane", Crinkleclip=1, Invert=0 if right else 1)
    half.ClipType.Origin, half.ClipType.Normal = [middle, 0, 0], [1, 0, 0]
    return half


def make_view(words):
    view = CreateRenderView(ViewSize=[TALL, TALL])
    view.UseColorPaletteForBackground = 0
    view.Background = [1, 1, 1]
    view.OrientationAxesVisibility = 0
    caption = Show(Text(Text=words), view)
    caption.WindowLocation = "Lower Center"
    caption.FontSize, caption.Color = 10, [0.2, 0.22, 0.26]
    return view


def look_at(view):
    view.CameraPosition, view.CameraFocalPoint, view.CameraViewUp = [0.5, 0.35,
                                                                     1], [0, 0, 0], [0, 1, 0]
    view.ResetCamera()
    view.CameraParallelProjection = 1
    view.CameraParallelScale *= 0.72


def main():
    # the reader needs an absolute path to find the HDF5 file
    path, picture = os.path.abspath(sys.argv[1]), sys.argv[2]
    reader = Xdmf3ReaderT(FileName=[path])
    reader.UpdatePipeline()
    levels = [int(name[6:]) for name in grid_names(reader) if name.startswith("level_")]
    coarse = int(sys.argv[3]) if len(sys.argv) > 3 else min(3, levels[-1])
    fine = int(sys.argv[4]) if len(sys.argv) > 4 else levels[-1]
    left = make_view(f"half of level {coarse}, half of the mesh")
    right = make_view(f"level {fine}")
    layout = CreateLayout("ebpo")
    layout.SplitHorizontal(0, 0.5)
    layout.AssignView(1, left)
    layout.AssignView(2, right)
    layout.SetSize(2 * TALL, TALL)
    mesh, envelopes = blocks(reader, "mesh"), blocks(reader, f"level_{coarse:02d}")
    bounds = mesh.GetDataInformation().GetBounds()
    middle = (bounds[0] + bounds[1]) / 2
    largest = envelopes.GetDataInformation().GetCellDataInformation().GetArrayInformation("volume").GetComponentRange(0)[1]
    show_mesh(half_of(mesh, middle, True), left)
    show_envelopes(half_of(envelopes, middle, False), left, largest)
    show_envelopes(blocks(reader, f"level_{fine:02d}"), right, largest)
    look_at(left)
    look_at(right)
    SaveScreenshot(picture, layout, ImageResolution=[2 * TALL, TALL], CompressionLevel=9)


main()
