"""ply_moves.py IN.ply OUT.ply SCALE X Y Z: scales a binary PLY, then moves it. Writes text with all digits of
the doubles.
"""
import sys

import export_reads

points, faces = export_reads.ply(sys.argv[1])
scale, *move = (float(v) for v in sys.argv[3:7])
with open(sys.argv[2], "w", encoding="ascii") as f:
    f.write(f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n"
            + "".join(f"property double {k}\n" for k in "xyz"))
    f.write(f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
    for p in points:
        f.write(" ".join(repr(float(v) * scale + m) for v, m in zip(p, move)) + "\n")
    for face in faces:
        f.write("3 {} {} {}\n".format(*face))
