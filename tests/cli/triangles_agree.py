"""triangles_agree.py OUT NAME=MODEL.ply...: checks that a glTF, OBJ or STL file has the triangles of the PLY files,
in their order. Each coordinate is the float32 nearest to that of the PLY (minus the node's translation), and
different vertices stay different.
"""
import struct
import sys

import export_reads

found = export_reads.scene(sys.argv[1])
wanted = [argument.split("=") for argument in sys.argv[2:]]
assert len(found) == len(wanted), (len(found), len(wanted))
for (name, origin, points, triangles), (wanted_name, path) in zip(found, wanted):
    assert name in ("", wanted_name), (name, wanted_name)
    model, faces = export_reads.ply(path)
    assert len(faces) == len(triangles), (len(faces), len(triangles))
    for face, triangle in zip(faces, triangles):
        for here, there in zip(triangle, face):
            rounded = struct.unpack("<3f", struct.pack("<3f",
                                                       *(v - o
                                                         for v, o in zip(model[there], origin))))
            assert points[here] == rounded, (name, face, points[here], rounded)
print("fine")
