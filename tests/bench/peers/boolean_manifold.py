"""manifold3d as a peer: boolean_manifold.py A.ply B.ply OPERATOR POSE OUT.ply computes A | B, A & B or A - B of closed
meshes. POSE: the twelve numbers of B's matrix [R t], by rows. Needs manifold3d and numpy. Prints the number of faces.
"""
import sys

import manifold3d
import numpy


def read(path):
    data = open(path, "rb").read()
    body = data.index(b"end_header\n") + 11
    lines = [line.split() for line in data[:body].decode().split("\n")]
    count = {line[1]: int(line[2]) for line in lines if line[:1] == ["element"]}
    vertices = numpy.frombuffer(data, "<f4", 3 * count["vertex"], body).reshape(-1, 3)
    faces = numpy.frombuffer(data, [("n", "u1"), ("corner", "<u4", 3)], count["face"], body + vertices.nbytes)
    return manifold3d.Manifold(manifold3d.Mesh(vertices.copy(), faces["corner"].copy()))


def write(path, mesh):
    vertices, faces = mesh.vert_properties[:, :3], mesh.tri_verts
    rows = numpy.empty(len(faces), [("n", "u1"), ("corner", "<u4", 3)])
    rows["n"], rows["corner"] = 3, faces
    with open(path, "wb") as out:
        out.write(b"ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\n"
                  b"property float z\nelement face %d\nproperty list uchar uint vertex_indices\nend_header\n" %
                  (len(vertices), len(faces)))
        out.write(numpy.ascontiguousarray(vertices, "<f4").tobytes())
        out.write(rows.tobytes())


first, second, operator, pose, target = sys.argv[1:]
a, b = read(first), read(second)
b = b.transform(numpy.array([float(x) for x in pose.split()]).reshape(3, 4))
result = a + b if operator == "|" else a ^ b if operator == "&" else a - b
if result.status() != manifold3d.Error.NoError:
    sys.exit(str(result.status()))
write(target, result.to_mesh())
print(result.num_tri())
