"""coloured_cube.py faces|vertices TYPE [PREFIX] >OUT.ply: writes a cube whose colours have this PLY type.

Colours of faces: two triangles each; the front is red, the top green, other sides are blue. Colours of
vertices: red below, blue above, purple between.
"""
import sys

of, kind = sys.argv[1:3]
prefix = sys.argv[3] if len(sys.argv) > 3 else ""
full = {"uchar": 255, "ushort": 65535, "float": 1, "double": 1}[kind]
at = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
sides = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
faces = [f for a, b, c, d in sides for f in ((a, b, c), (a, c, d))]


def colour(r, g, b):
    return [r * full, g * full, b * full]


def face_colour(i):
    side = sides[i // 2]
    return colour(*((1, 0, 0) if all(at[v][2] for v in side) else
                    (0, 1, 0) if all(at[v][1] for v in side) else (0, 0, 1)))


properties = [f"property {kind} {prefix}{name}" for name in ("red", "green", "blue")]
print("ply", "format ascii 1.0", "element vertex 8", "property float x", "property float y",
      "property float z", *(properties if of == "vertices" else []), "element face 12",
      "property list uchar int vertex_indices", *(properties if of == "faces" else []),
      "end_header", sep="\n")
for p in at:
    print(*p, *(colour(1 - p[1], 0, p[1]) if of == "vertices" else []))
for i, f in enumerate(faces):
    print(3, *f, *(face_colour(i) if of == "faces" else []))
