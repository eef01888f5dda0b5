"""Makes small degenerate meshes, one kind of defect each, with their expected results.

awkward.py FOLDER [NAME...]: writes the named meshes, or all, as ASCII PLY with doubles. NAME.obj and
NAME.stl select these formats.

MESHES[name]() returns an `Awkward` with these members:
    vertices, faces
    volume            volume of the intended solid; None when it cannot be determined without guessing
    inside, outside   points with a known class for the intended solid (rule nonzero)
    fine              True when the mesh is the intended solid without repairs
    refused           True when the mesh is not a triangle mesh
"""
import math
import pathlib
import random
import sys


class Awkward:
    def __init__(self, vertices, faces, volume=None, inside=(), outside=(), fine=False, refused=False):
        self.vertices, self.faces, self.volume = vertices, faces, volume
        self.inside, self.outside, self.fine, self.refused = list(inside), list(outside), fine, refused

    def write(self, path):
        write = {".obj": self.obj, ".stl": self.stl}.get(pathlib.Path(path).suffix, self.ply)
        pathlib.Path(path).write_text("\n".join(write()) + "\n")

    def obj(self):
        return ([" ".join(["v", *(repr(float(x)) for x in v)]) for v in self.vertices]
                + [" ".join(["f", *(str(i + 1) for i in f)]) for f in self.faces])

    def stl(self):
        lines = ["solid it"]
        for f in self.faces:
            lines += ["facet normal 0 0 0", "outer loop"]
            lines += [" ".join(["vertex", *(repr(float(x)) for x in self.vertices[i])]) for i in f]
            lines += ["endloop", "endfacet"]
        return lines + ["endsolid it"]

    def ply(self):
        lines = ["ply", "format ascii 1.0", f"element vertex {len(self.vertices)}"]
        lines += [f"property double {axis}" for axis in "xyz"]
        lines += [f"element face {len(self.faces)}", "property list uchar int vertex_indices", "end_header"]
        lines += [" ".join(repr(float(x)) for x in v) for v in self.vertices]
        return lines + [" ".join(map(str, (len(f), *f))) for f in self.faces]


# ---- parts: (vertices, faces) ----

def box(low=(0, 0, 0), high=(1, 1, 1)):
    v = [(high[0] if i & 1 else low[0], high[1] if i & 2 else low[1], high[2] if i & 4 else low[2])
         for i in range(8)]
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return v, [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]


def sphere(n=12, radius=1.0, at=(0, 0, 0)):
    v = [(0, 0, radius), (0, 0, -radius)]
    for i in range(1, n):
        for j in range(2 * n):
            t, p = math.pi * i / n, math.pi * j / n
            v.append((radius * math.sin(t) * math.cos(p), radius * math.sin(t) * math.sin(p), radius * math.cos(t)))
    ring = lambda i, j: 2 + (i - 1) * 2 * n + j % (2 * n)
    f = []
    for j in range(2 * n):
        f += [(0, ring(1, j), ring(1, j + 1)), (1, ring(n - 1, j + 1), ring(n - 1, j))]
        for i in range(1, n - 1):
            a, b, c, d = ring(i, j), ring(i + 1, j), ring(i + 1, j + 1), ring(i, j + 1)
            f += [(a, b, c), (a, c, d)]
    return [tuple(x + o for x, o in zip(p, at)) for p in v], f


def tube(n=16, rows=4, radius=1.0, length=2.0):
    """Makes a cylinder without its ends."""
    v = [(radius * math.cos(2 * math.pi * j / n), radius * math.sin(2 * math.pi * j / n), length * i / rows)
         for i in range(rows + 1) for j in range(n)]
    at = lambda i, j: i * n + j % n
    return v, [f for i in range(rows) for j in range(n)
               for f in ((at(i, j), at(i, j + 1), at(i + 1, j + 1)), (at(i, j), at(i + 1, j + 1), at(i + 1, j)))]


def torus(n=16, m=8, big=2.0, small=0.5):
    v = [((big + small * math.cos(2 * math.pi * j / m)) * math.cos(2 * math.pi * i / n),
          (big + small * math.cos(2 * math.pi * j / m)) * math.sin(2 * math.pi * i / n),
          small * math.sin(2 * math.pi * j / m)) for i in range(n) for j in range(m)]
    at = lambda i, j: i % n * m + j % m
    return v, [f for i in range(n) for j in range(m)
               for f in ((at(i, j), at(i + 1, j), at(i + 1, j + 1)), (at(i, j), at(i + 1, j + 1), at(i, j + 1)))]


def moebius(n=12):
    v = []
    for i in range(n):
        a = 2 * math.pi * i / n
        for s in (-0.3, 0.3):
            v.append(((2 + s * math.cos(a / 2)) * math.cos(a), (2 + s * math.cos(a / 2)) * math.sin(a), s * math.sin(a / 2)))
    f = []
    for i in range(n):
        a, b, c, d = 2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 3
        if i == n - 1:
            c, d = 1, 0
        f += [(a, c, b), (b, c, d)]
    return v, f


def volume_of(mesh):
    """Returns the volume: a sixth of the sum of determinants about the first vertex."""
    v, f = mesh
    o, total = v[0], 0.0
    for a, b, c in f:
        p, q, r = ([x - y for x, y in zip(v[i], o)] for i in (a, b, c))
        total += (p[0] * (q[1] * r[2] - q[2] * r[1]) + p[1] * (q[2] * r[0] - q[0] * r[2])
                  + p[2] * (q[0] * r[1] - q[1] * r[0]))
    return total / 6


# ---- changes of parts ----

def turned(mesh, which=lambda i: True):
    return mesh[0], [(f[0], f[2], f[1]) if which(i) else f for i, f in enumerate(mesh[1])]


def without(mesh, *gone):
    return mesh[0], [f for i, f in enumerate(mesh[1]) if i not in gone]


def unwelded(mesh):
    return [mesh[0][i] for f in mesh[1] for i in f], [(3 * i, 3 * i + 1, 3 * i + 2) for i in range(len(mesh[1]))]


def joined(*meshes):
    v, f = [], []
    for mesh in meshes:
        f += [tuple(i + len(v) for i in face) for face in mesh[1]]
        v += mesh[0]
    return v, f


def welded(mesh):
    first, number, v = {}, [], []
    for p in mesh[0]:
        if p not in first:
            first[p] = len(v)
            v.append(p)
        number.append(first[p])
    return v, [tuple(number[i] for i in f) for f in mesh[1]]


def more(mesh, vertices=(), faces=()):
    return mesh[0] + list(vertices), mesh[1] + list(faces)


def scaled(mesh, by, to=(0, 0, 0)):
    return [tuple(x * by + o for x, o in zip(p, to)) for p in mesh[0]], mesh[1]


def shuffled(mesh, seed=1):
    r = random.Random(seed)
    order = list(range(len(mesh[0])))
    r.shuffle(order)
    v = [None] * len(order)
    for i, o in enumerate(order):
        v[o] = mesh[0][i]
    f = [tuple(order[i] for i in face) for face in mesh[1]]
    r.shuffle(f)
    return v, f


MESHES = {}
MIDDLE, FAR = (0.5, 0.5, 0.5), (7.5, 0.4, 0.3)


def known(name, mesh, volume=None, inside=(), outside=(), **more_facts):
    MESHES[name] = lambda: Awkward(*mesh(), volume=volume, inside=inside, outside=outside, **more_facts)


def cube(name, mesh, fine=False):
    """Makes a mesh whose intended solid is the unit cube."""
    known(name, mesh, 1.0, [MIDDLE], [FAR], fine=fine)


def quarter(i):
    return i % 4 == 1


cube("cube", box, fine=True)
cube("cube_shuffled", lambda: shuffled(box()), fine=True)
cube("cube_minus_zero", lambda: ([tuple(-0.0 if x == 0 else x for x in p) for p in box()[0]], box()[1]), fine=True)
cube("unwelded", lambda: unwelded(box()))
cube("unwelded_zeros_of_two_signs",
     lambda: ([tuple(-0.0 if x == 0 and i % 2 else x for x in p) for i, p in enumerate(unwelded(box())[0])], unwelded(box())[1]))
cube("inside_out", lambda: turned(box()))
cube("unwelded_inside_out", lambda: turned(unwelded(box())))
cube("one_face_turned", lambda: turned(box(), lambda i: i == 5))
cube("a_quarter_turned", lambda: turned(box(), quarter))
cube("unwelded_and_a_quarter_turned", lambda: turned(unwelded(box()), quarter))
cube("hole", lambda: without(box(), 4))
cube("hole_unwelded", lambda: without(unwelded(box()), 4))
cube("hole_turned", lambda: turned(without(box(), 4), quarter))
cube("hole_unwelded_turned", lambda: turned(without(unwelded(box()), 4), quarter))
cube("hole_inside_out", lambda: turned(without(box(), 4)))
cube("without_lid", lambda: without(box(), 2, 3))
cube("without_lid_unwelded", lambda: without(unwelded(box()), 2, 3))
cube("without_lid_and_floor", lambda: without(box(), 0, 1, 2, 3))
cube("one_repeated", lambda: more(box(), faces=[box()[1][3]]))
cube("one_repeated_rotated", lambda: more(box(), faces=[box()[1][3][1:] + box()[1][3][:1]]))
cube("one_repeated_thrice", lambda: more(box(), faces=[box()[1][3]] * 3))
cube("all_repeated_both_ways", lambda: joined_faces(box(), turned(box())))
cube("all_repeated_both_ways_unwelded", lambda: unwelded(joined_faces(box(), turned(box()))))
cube("repeated_hole", lambda: without(more(box(), faces=[box()[1][3], box()[1][8]]), 4))
cube("unreferenced", lambda: more(box(), vertices=[(5, 5, 5), (6, 6, 6)]), fine=True)
cube("degenerate_faces", lambda: more(box(), faces=[(0, 0, 1), (3, 3, 3)]), fine=True)
cube("unwelded_with_unreferenced", lambda: more(unwelded(box()), vertices=[(9, 9, 9)]))


def joined_faces(a, b):
    return a[0], a[1] + b[1]


def split_edge():
    """Makes a T-junction: one face at the edge 0-1 is cut at the middle of the edge, the other is not."""
    v, f = box()
    f = [g for g in f if g != (0, 1, 5)]
    return v + [(0.5, 0, 0)], f + [(0, 8, 5), (8, 1, 5)]


def split_side():
    """Cuts the diagonal of the bottom finely on one side only, which gives T-junctions along the diagonal."""
    v, f = box()
    f = [g for g in f if g != (0, 2, 3)]
    v = v + [(0.25, 0.25, 0), (0.5, 0.5, 0), (0.75, 0.75, 0)]
    return v, f + [(0, 2, 8), (8, 2, 9), (9, 2, 10), (10, 2, 3)]


cube("t_junction", split_edge)
cube("t_junctions", split_side)
cube("t_junction_unwelded", lambda: unwelded(split_edge()))
cube("collinear_face", lambda: more(split_edge(), faces=[(0, 1, 8)]), fine=True)
cube("fin_of_two_sides", lambda: more(box(), [(0.5, -1, 0.5)], [(0, 1, 8), (1, 0, 8)]), fine=True)
cube("fin_of_two_sides_unwelded", lambda: unwelded(more(box(), [(0.5, -1, 0.5)], [(0, 1, 8), (1, 0, 8)])))
known("fin", lambda: more(box(), [(0.5, -1, 0.5)], [(0, 1, 8)]))
known("inner_sheet", lambda: more(box(), [(0.3, 0.3, 0.3), (0.6, 0.3, 0.3), (0.3, 0.6, 0.3)], [(8, 9, 10)]))
known("inner_wall", lambda: more(box(), faces=[(0, 3, 7), (0, 7, 4)]))

TWO = [(0.5, 0.5, 0.5), (1.5, 0.5, 0.5)]
second = lambda: box((1, 0, 0), (2, 1, 1))
known("two_cells", lambda: welded(joined(box(), second())), 2.0, TWO, [FAR], fine=True)
known("two_cells_unwelded", lambda: unwelded(joined(box(), second())), 2.0, TWO, [FAR])
known("two_cells_one_wall", lambda: without(welded(joined(box(), second())), 20, 21))
known("touch_at_an_edge", lambda: welded(joined(box(), box((1, 1, 0), (2, 2, 1)))), 2.0,
      [(0.5, 0.5, 0.5), (1.5, 1.5, 0.5)], [(0.5, 1.5, 0.5)], fine=True)
known("touch_at_a_vertex", lambda: welded(joined(box(), box((1, 1, 1), (2, 2, 2)))), 2.0,
      [(0.5, 0.5, 0.5), (1.5, 1.5, 1.5)], [(0.5, 1.5, 0.5)], fine=True)
at_edge, at_vertex = lambda: box((1, 1, 0), (2, 2, 1)), lambda: box((1, 1, 1), (2, 2, 2))
CORNERS = [(0.5, 0.5, 0.5), (1.5, 1.5, 0.5)]
known("two_at_edge", lambda: welded(joined(box(), turned(at_edge()))), 2.0, CORNERS, [(0.5, 1.5, 0.5)])
known("two_at_edge_most_turned", lambda: welded(joined(box(), turned(at_edge(), lambda i: i > 1))), 2.0, CORNERS, [(0.5, 1.5, 0.5)])
known("two_at_vertex", lambda: welded(joined(box(), turned(at_vertex()))), 2.0,
      [(0.5, 0.5, 0.5), (1.5, 1.5, 1.5)], [(0.5, 1.5, 0.5)])
known("two_at_face", lambda: welded(joined(box(), turned(second()))), 2.0, TWO, [FAR])
known("two_at_face_some_turned", lambda: turned(welded(joined(box(), second())), lambda i: i % 5 == 1), 2.0, TWO, [FAR])
known("four_around_an_edge", lambda: turned(welded(joined(box(), second(), at_edge(), box((0, 1, 0), (1, 2, 1)))),
      lambda i: i % 7 == 3), 4.0, TWO + CORNERS, [FAR])
cube("all_repeated", lambda: joined_faces(box(), box()))
known("twice_at_one_place", lambda: joined(box(), box()), 2.0, [MIDDLE], [FAR])
known("two_apart", lambda: joined(box(), box((3, 0, 0), (4, 1, 1))), 2.0,
      [(0.5, 0.5, 0.5), (3.5, 0.5, 0.5)], [(2, 0.5, 0.5)], fine=True)
known("two_apart_one_inside_out", lambda: joined(box(), turned(box((3, 0, 0), (5, 1, 1)))), 3.0,
      [(0.5, 0.5, 0.5), (3.5, 0.5, 0.5)], [(2, 0.5, 0.5)])
known("two_apart_one_open", lambda: joined(box(), without(box((3, 0, 0), (4, 1, 1)), 5)), 2.0,
      [(0.5, 0.5, 0.5), (3.5, 0.5, 0.5)], [(2, 0.5, 0.5)])

outer, inner = lambda: box((0, 0, 0), (4, 4, 4)), lambda: box((1, 1, 1), (3, 3, 3))
core = lambda: box((1.5, 1.5, 1.5), (2.5, 2.5, 2.5))
SHELL = [(0.5, 0.5, 0.5)]
known("cavity", lambda: joined(outer(), turned(inner())), 56.0, SHELL, [(2, 2, 2.1)], fine=True)
known("cavity_unwelded", lambda: unwelded(joined(outer(), turned(inner()))), 56.0, SHELL, [(2, 2, 2.1)])
known("cavity_inside_out", lambda: turned(joined(outer(), turned(inner()))), 56.0, SHELL, [(2, 2, 2.1)])
known("cavity_with_a_core", lambda: joined(outer(), turned(inner()), core()), 57.0, SHELL + [(2, 2, 2.1)],
      [(1.2, 2, 2)], fine=True)
known("cavity_with_a_hole", lambda: joined(without(outer(), 7), turned(inner())), 56.0, SHELL, [(2, 2, 2.1)])
known("box_in_box", lambda: joined(outer(), inner()), 72.0, SHELL + [(2, 2, 2.1)], [FAR], fine=True)
known("three_nested_outwards", lambda: joined(outer(), inner(), core()), 73.0, SHELL + [(2, 2, 2.1)], [FAR], fine=True)
known("crossing", lambda: joined(box(), box((0.5, 0.5, 0.5), (1.5, 1.5, 1.5))), 2.0,
      [(0.2, 0.2, 0.2), (0.7, 0.7, 0.7), (1.2, 1.2, 1.2)], [(1.2, 0.2, 0.2)], fine=True)
known("crossing_one_inside_out", lambda: joined(sphere(), turned(sphere(at=(1.1, 0.1, 0)))))
known("crossing_itself", lambda: torus(16, 8, 1.0, 1.5), volume_of(torus(16, 8, 1.0, 1.5)), [(1.7, 0, 0.1)], [(3, 0, 0)], fine=True)


BALL = volume_of(sphere())
known("ball", sphere, BALL, [(0, 0, 0.1)], [(2, 0, 0)], fine=True)
known("ball_unwelded", lambda: unwelded(sphere()), BALL, [(0, 0, 0.1)], [(2, 0, 0)])
known("ball_half_turned", lambda: turned(sphere(), lambda i: i % 2), BALL, [(0, 0, 0.1)], [(2, 0, 0)])
known("ball_turned_at_random", lambda: turned(sphere(), lambda i: i * 7919 % 13 < 6), BALL, [(0, 0, 0.1)], [(2, 0, 0)])
known("bowl", lambda: (sphere()[0], [f for f in sphere()[1] if all(sphere()[0][i][2] < 0.3 for i in f)]))
known("ring", torus, volume_of(torus()), [(2, 0, 0.1)], [(0, 0, 0)], fine=True)
known("ring_with_holes", lambda: without(torus(), *range(0, 240, 40)), volume_of(torus()), [(2, 0, 0.1)], [(0, 0, 0)])
known("tube", lambda: tube(), volume_of((lambda m: more(m, [(0, 0, 0), (0, 0, 2)],
      [(64 + 16 + 0, (j + 1) % 16, j) for j in range(16)] + [(81, 64 + j, 64 + (j + 1) % 16) for j in range(16)]))(tube())),
      [(0, 0, 1)], [(2, 0, 0)])
known("tube_unwelded", lambda: unwelded(tube()), volume_of((lambda m: more(m, [(0, 0, 0), (0, 0, 2)],
      [(80, (j + 1) % 16, j) for j in range(16)] + [(81, 64 + j, 64 + (j + 1) % 16) for j in range(16)]))(tube())),
      [(0, 0, 1)], [(2, 0, 0)])
known("noisy_soup", lambda: (lambda r, m: ([tuple(x + r.uniform(-0.003, 0.003) for x in p) for p in m[0]], m[1]))(
      random.Random(5), unwelded(box())))
known("tube_of_a_long_rim", lambda: tube(600, 1))
known("moebius", moebius)
known("moebius_unwelded", lambda: unwelded(moebius()))
known("projective_plane", lambda: ([(math.cos(i), math.sin(3 * i), i / 6) for i in range(6)],
      [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5), (0, 5, 1), (1, 2, 4), (2, 3, 5), (3, 4, 1), (4, 5, 2), (5, 1, 3)]))
known("sheet", lambda: ([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)]))
known("sheet_of_two_sides", lambda: ([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3), (0, 2, 1), (0, 3, 2)]))
known("sheet_folded", lambda: ([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3), (0, 1, 3)]))
known("one_face", lambda: ([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]))
known("one_face_both_ways", lambda: ([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 1)]))
known("one_face_without_area", lambda: ([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)]))
known("three_pages", lambda: ([(0, 0, 0), (0, 0, 1), (1, 0, 0), (-1, 1, 0), (-1, -1, 0)], [(0, 1, 2), (0, 1, 3), (0, 1, 4)]))
known("soup", lambda: (lambda r: ([(r.random(), r.random(), r.random()) for _ in range(60)],
      [tuple(r.sample(range(60), 3)) for _ in range(100)]))(random.Random(3)))
known("soup_of_few_vertices", lambda: (lambda r: ([(r.random(), r.random(), r.random()) for _ in range(6)],
      [tuple(r.sample(range(6), 3)) for _ in range(100)]))(random.Random(4)))
known("rays_of_triangles", lambda: ([(0, 0, 0)] + [(math.cos(i), math.sin(i), i % 3) for i in range(40)],
      [(0, 1 + i, 2 + i) for i in range(0, 38, 2)]))
known("no_faces", lambda: ([(0, 0, 0), (1, 0, 0), (0, 1, 0)], []), refused=True)
known("empty", lambda: ([], []), refused=True)
known("vertex_missing", lambda: ([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 7)]), refused=True)
known("not_a_number", lambda: ([(0, 0, 0), (1, 0, 0), (0, math.nan, 0)], [(0, 1, 2)]), refused=True)
known("infinite", lambda: ([(0, 0, 0), (1, 0, 0), (0, math.inf, 0)], [(0, 1, 2)]), refused=True)

for power in (-30, -9, 9, 30, 100):
    by = 10.0 ** power
    known(f"cube_of_1e{power}", lambda by=by: scaled(box(), by), by ** 3, [(0.5 * by,) * 3], [(2 * by,) * 3], fine=True)
    known(f"unwelded_of_1e{power}", lambda by=by: unwelded(scaled(box(), by)), by ** 3, [(0.5 * by,) * 3], [(2 * by,) * 3])
known("cube_of_1e300", lambda: scaled(box(), 1e300), None, [(5e299,) * 3], [(-5e299,) * 3], fine=True)
known("cube_of_1e-300", lambda: scaled(box(), 1e-300), None, [(5e-301,) * 3], [(2e-300,) * 3], fine=True)
known("unwelded_of_1e-300", lambda: unwelded(scaled(box(), 1e-300)), None, [(5e-301,) * 3], [(2e-300,) * 3])
known("cube_of_denormals", lambda: scaled(box(), 5e-322))
known("far_away", lambda: scaled(box(), 1.0, (2.0 ** 40,) * 3), 1.0, [(2.0 ** 40 + 0.5,) * 3], [(0, 0, 0)], fine=True)
known("far_away_unwelded", lambda: unwelded(scaled(box(), 1.0, (2.0 ** 40,) * 3)), 1.0, [(2.0 ** 40 + 0.5,) * 3], [(0, 0, 0)])
known("flat", lambda: box((0, 0, 0), (1, 1, 1e-3)), 1e-3, [(0.5, 0.5, 5e-4)], [FAR], fine=True)
known("flat_as_paper", lambda: box((0, 0, 0), (1, 1, 1e-9)))

known("needle", lambda: box((0, 0, 0), (1e-3, 1e-3, 100)), 1e-4, [(5e-4, 5e-4, 50)], [FAR], fine=True)
known("gap_of_1e-7", lambda: joined(*[(lambda v, f: ([tuple(x + 1e-7 * i for x in p) for p in v], f))(
      [sphere()[0][k] for k in g], [(0, 1, 2)]) for i, g in enumerate(sphere()[1])]))


def tube_capped(n):
    """Makes a flat disc with long, thin faces."""
    v, f = tube(n, 1, 1.0, 0.1)
    v = v + [(0, 0, 0), (0, 0, 0.1)]
    return v, f + [(2 * n, (j + 1) % n, j) for j in range(n)] + [(2 * n + 1, n + j, n + (j + 1) % n) for j in range(n)]


known("slivers", lambda: tube_capped(2000), volume_of(tube_capped(2000)), [(0.3, 0.2, 0.05)], [FAR], fine=True)

if __name__ == "__main__":
    folder, names = pathlib.Path(sys.argv[1]), sys.argv[2:] or MESHES
    folder.mkdir(exist_ok=True)
    for name in names:
        kept = name if name.endswith((".obj", ".stl")) else name + ".ply"
        MESHES[kept[:-4]]().write(folder / kept)
