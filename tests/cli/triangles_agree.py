"""triangles_agree.py OUT NAME=MODEL.ply...: a glTF, OBJ or STL file holds these triangles, in their
order, each coordinate the float32 nearest to that of the PLY (less the node's
translation), and no vertex of one has become another's."""
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
