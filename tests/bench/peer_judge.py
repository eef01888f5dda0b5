"""Counts wrong results by rational arithmetic over all faces; shares no code with any library that it judges.

Vertices and queries are doubles, which are rational numbers. numpy chooses the faces that can decide a result, with a
margin that is far above its rounding errors; Fractions decide.
"""
from fractions import Fraction

import numpy as np

MARGIN = 1e-9  # of the model's diagonal; rounding errors are below 1e-13


def exact(point):
    return tuple(map(Fraction, map(float, point)))


def sub(a, b):
    return tuple(x - y for x, y in zip(a, b))


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def sign(value):
    return (value > 0) - (value < 0)


def along(a, direction, t):
    return tuple(x + t * y for x, y in zip(a, direction))


def clamp(t):
    return min(max(t, Fraction(0)), Fraction(1))


def point_segment(p, a, b):
    """Return the squared distance of a point and a segment."""
    edge = sub(b, a)
    length = dot(edge, edge)
    offset = sub(p, along(a, edge, clamp(dot(sub(p, a), edge) / length) if length else 0))
    return dot(offset, offset)


def point_triangle(p, triangle):
    """Return the squared distance of a point and a triangle."""
    a, b, c = triangle
    normal = cross(sub(b, a), sub(c, a))
    size = dot(normal, normal)
    if size and all(dot(cross(sub(q, r), sub(p, r)), normal) >= 0 for r, q in ((a, b), (b, c), (c, a))):
        return dot(sub(p, a), normal) ** 2 / size
    return min(point_segment(p, *edge) for edge in ((a, b), (b, c), (c, a)))


def segment_segment(a, b, c, d):
    """Return the squared distance of two segments: of the lines where these are nearest within both, or of an end."""
    u, v, w = sub(b, a), sub(d, c), sub(a, c)
    uu, uv, vv, uw, vw = dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w)
    determinant = uu * vv - uv * uv
    found = [point_segment(a, c, d), point_segment(b, c, d), point_segment(c, a, b), point_segment(d, a, b)]
    if determinant:
        s, t = (uv * vw - vv * uw) / determinant, (uu * vw - uv * uw) / determinant
        if 0 <= s <= 1 and 0 <= t <= 1:
            offset = sub(along(a, u, s), along(c, v, t))
            found.append(dot(offset, offset))
    return min(found)


def edges(triangle):
    return [(triangle[k], triangle[(k + 1) % 3]) for k in range(3)]


def triangle_triangle(s, t):
    """Return the squared distance of two disjoint triangles."""
    return min([segment_segment(*e, *f) for e in edges(s) for f in edges(t)]
               + [point_triangle(p, t) for p in s] + [point_triangle(p, s) for p in t])


def volume(a, b, c, d):
    return sign(dot(sub(d, a), cross(sub(b, a), sub(c, a))))


def flat_crossing(a, b, triangle, normal):
    """Return if a segment in the plane of a triangle and the triangle have a common point."""
    axis = max(range(3), key=lambda k: abs(normal[k]))
    flat = [tuple(x for k, x in enumerate(p) if k != axis) for p in (a, b, *triangle)]

    def turn(p, q, r):
        return sign((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    def on(p, q, r):
        return turn(p, q, r) == 0 and all(min(x, y) <= z <= max(x, y) for x, y, z in zip(p, q, r))
    a, b, corners = flat[0], flat[1], flat[2:]
    if len({turn(p, q, a) for p, q in edges(corners)} - {0}) < 2:
        return True
    return any((turn(a, b, p) * turn(a, b, q) < 0 and turn(p, q, a) * turn(p, q, b) < 0)
               or on(p, q, a) or on(p, q, b) or on(a, b, p) or on(a, b, q) for p, q in edges(corners))


def segment_hits(a, b, triangle):
    """Return if a segment and a closed triangle have a common point."""
    normal = cross(sub(triangle[1], triangle[0]), sub(triangle[2], triangle[0]))
    if normal == (0, 0, 0):
        raise ValueError("a face has no area; the judge does not accept such models")
    sides = sign(dot(sub(a, triangle[0]), normal)), sign(dot(sub(b, triangle[0]), normal))
    if sides == (0, 0):
        return flat_crossing(a, b, triangle, normal)
    if sides[0] == sides[1]:
        return False
    return len({volume(a, b, p, q) for p, q in edges(triangle)} - {0}) < 2


def triangles_meet(s, t):
    return any(segment_hits(*e, t) for e in edges(s)) or any(segment_hits(*e, s) for e in edges(t))


class Judge:
    def __init__(self, vertices, faces):
        self.vertices, self.faces = vertices, faces
        self.diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
        self.corners = vertices[faces]
        self.low, self.high = self.corners.min(axis=1), self.corners.max(axis=1)
        self.centres = self.corners.mean(axis=1)
        self.radii = np.linalg.norm(self.corners - self.centres[:, None], axis=2).max(axis=1) + MARGIN * self.diagonal

    def triangle(self, face):
        return [exact(p) for p in self.corners[face]]

    # ---- points and rays ----

    def inside(self, points):
        """Return 1, 0, or -1 on the surface, by crossings along x; points on edges are moved by infinitesimals."""
        return np.array([self.inside_point(point) for point in points])

    def inside_point(self, point):
        may = ((self.low[:, 1:] <= point[1:]) & (point[1:] <= self.high[:, 1:])).all(axis=1)
        p, winding = exact(point), 0
        for face in np.flatnonzero(may & (self.high[:, 0] >= point[0])):
            a, b, c = self.triangle(face)
            sides = []
            for q, r in ((a, b), (b, c), (c, a)):
                y, z = r[1] - q[1], r[2] - q[2]
                sides.append(sign(y * (p[2] - q[2]) - z * (p[1] - q[1])) or sign(-z) or sign(y))
            if 0 in sides or len(set(sides)) > 1:
                continue
            normal = cross(sub(b, a), sub(c, a))
            before = sign(dot(sub(p, a), normal)) * sign(normal[0])
            if before == 0:
                return -1
            winding += sides[0] if before < 0 else 0
        return int(winding != 0)

    def nearest(self, points):
        """Return the squared distances as Fractions, and the set of nearest faces of each point."""
        return list(zip(*map(self.nearest_point, points)))

    def nearest_point(self, point):
        gap = np.maximum(np.maximum(self.low - point, point - self.high), 0)
        most = np.min(np.sum((self.vertices - point) ** 2, axis=1))
        may = np.flatnonzero(np.sum(gap * gap, axis=1) <= most * (1 + MARGIN))
        bound = distances_to_triangles(np.asarray(point), self.corners[may])
        slack = bound.min() * (1 + MARGIN) + MARGIN ** 1.5 * self.diagonal ** 2
        p = exact(point)
        found = {face: point_triangle(p, self.triangle(face)) for face in may[bound <= slack].tolist()}
        least = min(found.values())
        return least, {face for face, value in found.items() if value == least}

    def rays(self, origins, directions):
        """Return t of the first hit as a Fraction (None: no hit), and the set of its faces, for each ray."""
        return list(zip(*map(self.ray, origins, directions)))

    def ray(self, origin, direction):
        unit = direction / np.linalg.norm(direction)
        side = np.cross(unit, np.eye(3)[np.argmin(np.abs(unit))])
        side /= np.linalg.norm(side)
        flat = (self.vertices - origin) @ np.array([side, np.cross(unit, side)]).T
        corners, margin = flat[self.faces], MARGIN * self.diagonal
        may = ((corners.min(axis=1) <= margin) & (corners.max(axis=1) >= -margin)).all(axis=1)
        o, d, found = exact(origin), exact(direction), {}
        for face in np.flatnonzero(may).tolist():
            a, b, c = (sub(p, o) for p in self.triangle(face))
            turns = {sign(dot(d, cross(q, r))) for q, r in ((a, b), (b, c), (c, a))} - {0}
            normal = cross(sub(b, a), sub(c, a))
            if len(turns) == 1 and dot(normal, d):
                t = dot(normal, a) / dot(normal, d)
                if t >= 0:
                    found[face] = t
        least = min(found.values(), default=None)
        return least, {face for face, t in found.items() if t == least}

    # ---- two models ----

    def posed(self, matrix):
        """Return the second model's face corners as doubles, and a function that returns those of a face exactly."""
        corners = self.corners @ matrix[:3, :3].T + matrix[:3, 3]
        rows, shift = [exact(row) for row in matrix[:3, :3]], exact(matrix[:3, 3])

        def triangle(face):
            return [tuple(dot(row, p) + x for row, x in zip(rows, shift)) for p in self.triangle(face)]
        return corners, triangle

    def near_pairs(self, corners, distance):
        """Return pairs of faces whose bounding spheres are within a distance of each other."""
        from scipy.spatial import cKDTree
        centres = corners.mean(axis=1)
        reach = self.radii + self.radii.max() + distance  # a pose does not change the radii
        lists = cKDTree(self.centres).query_ball_point(centres, reach)
        b = np.repeat(np.arange(len(centres)), [len(each) for each in lists])
        a = np.concatenate([np.array(each, dtype=np.int64) for each in lists])
        close = np.linalg.norm(self.centres[a] - centres[b], axis=1) <= self.radii[a] + self.radii[b] + distance
        return a[close], b[close]

    def contact(self, matrices):
        return np.array([self.contact_pose(matrix) for matrix in matrices])

    def contact_pose(self, matrix):
        corners, posed = self.posed(matrix)
        a, b = self.near_pairs(corners, 0)
        s, t = self.corners[a], corners[b]
        margin = MARGIN * self.diagonal
        keep = ((s.min(axis=1) <= t.max(axis=1) + margin) & (t.min(axis=1) <= s.max(axis=1) + margin)).all(axis=1)
        for x, y in ((s, t), (t, s)):
            normal = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
            height = np.einsum("ikj,ij->ik", y - x[:, :1], normal)
            most = margin * np.linalg.norm(normal, axis=1)[:, None]
            keep &= ~((height > most).all(axis=1) | (height < -most).all(axis=1))
        return any(triangles_meet(self.triangle(i), posed(j)) for i, j in zip(a[keep], b[keep]))

    def gap(self, matrices):
        """Return the squared distances of two disjoint models as Fractions."""
        return [self.gap_pose(matrix) for matrix in matrices]

    def gap_pose(self, matrix):
        from scipy.spatial import cKDTree
        corners, posed = self.posed(matrix)
        moved = self.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        most = cKDTree(self.vertices).query(moved)[0].min()
        a, b = self.near_pairs(corners, most)
        bound = distances_of_triangles(self.corners[a], corners[b])
        keep = bound <= bound.min() * (1 + MARGIN) + MARGIN * self.diagonal
        return min(triangle_triangle(self.triangle(i), posed(j)) for i, j in zip(a[keep], b[keep]))


# ---- doubles that choose faces ----

def rows_dot(a, b):
    return np.einsum("...k,...k->...", a, b)


def share(a, b):
    return np.clip(np.divide(a, b, out=np.zeros_like(a), where=b > 0), 0, 1)


def distances_to_triangles(points, corners):
    """Return the squared distances of points and triangles, row by row."""
    a, b, c = (corners[:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    size = rows_dot(normal, normal)
    over, least = size > 0, np.full(len(corners), np.inf)
    for p, q in ((a, b), (b, c), (c, a)):
        edge, offset = q - p, points - p
        over &= rows_dot(np.cross(edge, offset), normal) >= 0
        offset = offset - edge * share(rows_dot(offset, edge), rows_dot(edge, edge))[:, None]
        least = np.minimum(least, rows_dot(offset, offset))
    height = rows_dot(points - a, normal) ** 2
    return np.where(over, np.minimum(least, np.divide(height, size, out=np.full(len(size), np.inf), where=size > 0)),
                    least)


def distances_of_triangles(s, t):
    """Return the distances of disjoint triangles, row by row."""
    least = np.full(len(s), np.inf)
    for x, y in ((s, t), (t, s)):
        for k in range(3):
            least = np.minimum(least, distances_to_triangles(x[:, k], y))
    for i in range(3):
        for j in range(3):
            a, u = s[:, i], s[:, (i + 1) % 3] - s[:, i]
            c, v = t[:, j], t[:, (j + 1) % 3] - t[:, j]
            w = a - c
            uu, uv, vv, uw, vw = rows_dot(u, u), rows_dot(u, v), rows_dot(v, v), rows_dot(u, w), rows_dot(v, w)
            size = uu * vv - uv * uv
            p, q = share(uv * vw - vv * uw, size), share(uu * vw - uv * uw, size)
            offset = a + u * p[:, None] - c - v * q[:, None]
            least = np.minimum(least, rows_dot(offset, offset))
    return np.sqrt(least)
