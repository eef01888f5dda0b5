"""boolean_attributes.py EBPO: attributes of a Boolean result are those of the models, also at new vertices. The
changes of a model, with the faces that stay, are the result.

A has a scalar and colours that are linear in the position, normals, and a label of each face. B has labels and
normals only, and is turned. The expected values are computed from the positions and origins in the result.
"""
import pathlib
import struct
import subprocess
import sys

CORNERS = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
SIDES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
FACES = [f for a, b, c, d in SIDES for f in ((a, b, c), (a, c, d))]
FORMATS = {"float": "f", "double": "d", "uchar": "B", "uint": "I", "int": "i", "short": "h"}


def scalar(p):
    return 2 * p[0] + 3 * p[1] + 5 * p[2] + 1


def write(name, properties, normal, values):
    lines = ["ply", "format ascii 1.0", "element vertex 8", *(f"property float {k}" for k in "xyz"),
             *(f"property float n{k}" for k in "xyz"), *properties, "element face 12",
             "property list uchar int vertex_indices", "property short label", "element note 1", "property int n",
             "end_header"]
    lines += [" ".join(map(str, (*p, *normal, *values(p)))) for p in CORNERS]
    lines += [" ".join(map(str, (3, *f, 100 + i))) for i, f in enumerate(FACES)] + ["7"]
    pathlib.Path(name).write_text("\n".join(lines) + "\n")


def read(name):
    """Return rows of each element of a binary PLY file, as dictionaries."""
    data = pathlib.Path(name).read_bytes()
    at = data.index(b"end_header\n") + 11
    elements = []
    for line in data[:at].decode().split("\n"):
        words = line.split()
        if words[:1] == ["element"]:
            elements.append((words[1], int(words[2]), []))
        elif words[:2] == ["property", "list"]:
            elements[-1][2].append(("corners", "B3I"))
        elif words[:1] == ["property"]:
            elements[-1][2].append((words[2], FORMATS[words[1]]))
    rows = {}
    for element, count, properties in elements:
        kind = struct.Struct("<" + "".join(code for _, code in properties))
        rows[element] = []
        for i in range(count):
            values, row = list(kind.unpack_from(data, at + i * kind.size)), {}
            for key, code in properties:
                if code == "B3I":
                    values.pop(0)
                    row[key] = [values.pop(0) for _ in range(3)]
                else:
                    row[key] = values.pop(0)
            rows[element].append(row)
        at += count * kind.size
    return rows


def check(right, what):
    if not right:
        print("wrong:", what)
        sys.exit(1)


def check_changes():
    """Test the ranges of removed faces. A, the sphere, has another order of faces in its file than in its source."""
    operands = ["A - B", "s.ebpo.h5", "s.ebpo.h5", "--pose", "B 0.5 0.25 0", "--double", "-o"]
    for out in ["result.ply"], ["changes.ply", "--changed-only"]:
        subprocess.run([ebpo, "boolean", *operands, *out], check=True, capture_output=True)
    subprocess.run([ebpo, "extract", "s.ebpo.h5", "base.ply", "--subtree", "1"], check=True, capture_output=True)
    base, changes, result, faces = read("base.ply"), read("changes.ply"), read("result.ply"), {}
    removed = {r["first"] + i for r in changes["removed"] for i in range(r["count"])}
    base["face"] = [f for i, f in enumerate(base["face"]) if i not in removed]
    check(0 < len(base["face"]) < len(result["face"]) and removed, "removed faces")
    for name, *meshes in ("result", result), ("changes", base, changes):
        corners = [[tuple(m["vertex"][i][k] for k in "xyz") for i in f["corners"]] for m in meshes for f in m["face"]]
        faces[name] = sorted(min(f[i:] + f[:i] for i in range(3)) for f in corners)
    check(faces["changes"] == faces["result"], "changes")


ebpo = sys.argv[1]
check_changes()
write("aa.ply", ["property double s", *(f"property uchar {c}" for c in ("red", "green", "blue"))], (0, 0, 1),
      lambda p: (scalar(p), *(255 * c for c in p)))
write("bb.ply", [], (1, 0, 0), lambda p: ())
for model in "aa", "bb":
    subprocess.run([ebpo, "convert", "-q", f"{model}.ply", f"{model}.ebpo.h5"], check=True)
for out in "attributes.ply", "attributes.ebpo.h5":
    done = subprocess.run([ebpo, "boolean", "A - B", "aa.ebpo.h5", "bb.ebpo.h5", "--pose", "B 0.75 0.25 0.4 0 0 1 1",
                           "-o", out], capture_output=True, text=True, check=True)
    check("not carried over: n of note of aa.ebpo.h5" in done.stderr, done.stderr)
subprocess.run([ebpo, "extract", "attributes.ebpo.h5", "back.ply", "--mesh"], check=True, capture_output=True)
for out in "attributes.ply", "back.ply":
    mesh, of_first = read(out), set()
    check({f["operand"] for f in mesh["face"]} == {0, 1}, "operands")
    for f in mesh["face"]:
        check(f["label"] == 100 + f["operand_face"], f)
        of_first |= set(f["corners"] if f["operand"] == 0 else [])
    check(len(mesh["vertex"]) > 8 and len(of_first) < len(mesh["vertex"]), "new vertices")
    for i, v in enumerate(mesh["vertex"]):
        p, first = (v["x"], v["y"], v["z"]), i in of_first
        check(abs(v["s"] - (scalar(p) if first else 0)) < 1e-5, v)
        check(all(abs(v[c] - (255 * x if first else 255)) <= 0.51 for c, x in zip(("red", "green", "blue"), p)), v)
        check(all(abs(v[c] - x) < 1e-6 for c, x in zip(("nx", "ny", "nz"), (0, 0, 1) if first else (0, -1, 0))), v)
print("good")
