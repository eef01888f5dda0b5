#!/usr/bin/env python3
"""Compares pictures of coarse levels with pictures of the model, for docs/measured/coarse-levels.md.

    /usr/bin/python3 tests/bench/coarse_levels.py BUILD_DIR FILE.ebpo.h5 [--levels 3-7]
    [--directions 5]

Draws the model and its levels from up to 20 directions. Prints the SSIM and the difference of the pictures for each
method of shading: polygon normals; cell faces with the normals of the planes around them; normals that a file could
store; and pictures taken around the model (BP-Octree thesis, 4.4). No result depends on the machine.

Needs numpy, and ninja -C BUILD_DIR tests/bench/level_samples tests/bench/jpeg_pictures.
"""
import argparse
import pathlib
import subprocess
import tempfile
import zlib

import numpy

PIXELS = 320       # width and height of a picture; each pixel has 2 x 2 samples
LARGE, SMALL = 384, 192  # width and height of stored pictures
NONE = 0xffffffff
BACKGROUND = numpy.array([.80, .82, .85])
PLAIN = numpy.array([.66, .54, .40])
SURE = .25, .6     # from the viewer: lengths of a field between which its weight rises from 0 to 1
BUDGETS = [50, 100, 200, 500, 1000, 2000, 5000]  # KB


# --- directions ---

def unit(v):
    return v / numpy.maximum(numpy.linalg.norm(v, axis=-1, keepdims=True), 1e-30)


def cameras(directions):
    """Return the axes right, up and back of each camera."""
    out = []
    for back in directions:
        up = numpy.array([0, 1., 0]) if abs(back[1]) < .99 else numpy.array([0, 0, -1.])
        right = unit(numpy.cross(up, back))
        out.append(numpy.array([right, numpy.cross(back, right), back]))
    return out


def dodecahedron():
    """Return the 20 corners of a dodecahedron, turned away from the directions of stored pictures."""
    g = (1 + 5 ** .5) / 2
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    for a in (-1 / g, 1 / g):
        for b in (-g, g):
            corners += [(0, a, b), (a, b, 0), (b, 0, a)]
    turn = numpy.array([[.8, -.36, .48], [.6, .48, -.64], [0, .8, .6]])
    return unit(numpy.array(corners)) @ turn.T


def octahedron(halvings):
    """Return the corners of an octahedron after `halvings` subdivisions of its edges: 6, 18, 66, 258."""
    n = 2 ** halvings
    return unit(numpy.array(sorted(
        {(a * i, b * j, (n - a - b) * k) for a in range(n + 1) for b in range(n + 1 - a)
         for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)}), float))


# --- light, as tools/cli/render/raster.c without occlusion ---

LINEAR = numpy.array([s / 12.92 if s <= .04045 else ((s + .055) / 1.055) ** 2.4
                      for s in numpy.arange(256) / 255])


def srgb(v):
    return numpy.where(v <= .0031308, 12.92 * v,
                       1.055 * numpy.maximum(v, 1e-9) ** (1 / 2.4) - .055).clip(0, 1) * 255


def lit(n, colour):
    """Return the linear light of normals, which are in the camera's axes."""
    key, fill, half = ((n @ numpy.array(v)).clip(0)[:, None] for v in (
        (-.46, .62, .635), (.86, .10, .50), (-.254, .343, .904)))
    warm, cool = numpy.array([1, .97, .92]), numpy.array([.9, .95, 1])
    sky = (.5 + .5 * n[:, 1])[:, None]
    return colour * ((.07 + .22 * sky) * cool + .95 * key * warm + .16 * fill * cool) \
        + .12 * half ** 32


def halved(image):
    return (image[0::2, 0::2] + image[1::2, 0::2] + image[0::2, 1::2] + image[1::2, 1::2]) / 4


def picture(hit, light):
    image = numpy.empty(hit.shape + (3,))
    image[:] = BACKGROUND
    image[hit] = light
    return halved(image)


def covered(hit):
    return halved(hit[..., None].astype(float))[..., 0] > 0


# --- similarity: SSIM (Wang and others 2004), a Gaussian of 11 pixels, sigma 1.5 ---

def blurred(a):
    w = numpy.exp(-numpy.arange(-5, 6) ** 2 / 4.5)
    w /= w.sum()
    for axis in (0, 1):
        size = a.shape[axis]
        p = numpy.moveaxis(numpy.pad(a, [(5, 5) if i == axis else (0, 0) for i in (0, 1)],
                                     mode="edge"), axis, 0)
        a = numpy.moveaxis(sum(w[i] * p[i:i + size] for i in range(11)), 0, axis)
    return a


class Reference:
    """A reference picture for comparisons: three channels of 0 to 255, and the mask of its object."""

    def __init__(self, image, inside):
        self.channels, self.inside = srgb(image), inside
        self.means = [blurred(self.channels[..., k]) for k in range(3)]
        self.squares = [blurred(self.channels[..., k] ** 2) for k in range(3)]

    def likeness(self, image, inside):
        """Return the mean SSIM of the channels, and the root mean square difference, where one of the two pictures
        shows the object.
        """
        where = self.inside | inside
        part = tuple(slice(max(0, at.min() - 5), at.max() + 6) for at in numpy.nonzero(where))
        where, other, mine = where[part], srgb(image[part]), self.channels[part]
        c1, c2, total = (.01 * 255) ** 2, (.03 * 255) ** 2, 0
        for k in range(3):
            a, b, ma, aa = mine[..., k], other[..., k], self.means[k][part], self.squares[k][part]
            mb = blurred(b)
            va, vb, ab = aa - ma * ma, blurred(b * b) - mb * mb, blurred(a * b) - ma * mb
            total += ((2 * ma * mb + c1) * (2 * ab + c2) /
                      ((ma * ma + mb * mb + c1) * (va + vb + c2)))[where].mean() / 3
        return total, ((mine - other)[where] ** 2).mean() ** .5


def check_likeness():
    """Check known values of the SSIM.

    Equal pictures have 1; constant pictures have (2ab + c1) / (a a + b b + c1); a picture and its negative around the same
    mean have nearly -1.
    """
    random = numpy.random.default_rng(1).random((64, 64, 3)) * .2 + .1
    all_of_it = numpy.ones((64, 64), bool)
    assert abs(Reference(random, all_of_it).likeness(random, all_of_it)[0] - 1) < 1e-12
    dark, bright = numpy.full((64, 64, 3), LINEAR[100]), numpy.full((64, 64, 3), LINEAR[150])
    known = (2 * 100 * 150 + 6.5025) / (100 ** 2 + 150 ** 2 + 6.5025)
    assert abs(Reference(dark, all_of_it).likeness(bright, all_of_it)[0] - known) < 1e-9
    checks = numpy.indices((64, 64)).sum(0) % 2
    one = LINEAR[numpy.where(checks, 90, 160)][..., None].repeat(3, 2)
    two = LINEAR[numpy.where(checks, 160, 90)][..., None].repeat(3, 2)
    assert Reference(one, all_of_it).likeness(two, all_of_it)[0] < -.9


# --- samples ---

class Shown:
    """The output of level_samples."""

    def __init__(self, bench, path, level, views, scale, samples, scratch):
        text = f"{len(views)}\n" + "\n".join(
            " ".join(repr(float(x)) for x in (*view.ravel(), *scale[0], scale[1])) for view in views)
        out = scratch / "samples.bin"
        subprocess.run([bench / "level_samples", path, str(level), str(samples), out], input=text,
                       text=True, check=True)
        with open(out, "rb") as f:
            head = [int(x) for x in numpy.fromfile(f, "u8", 8)]
            vertices, faces, nodes, polygons = head[:4]
            self.origin, self.size = numpy.fromfile(f, "f8", 6).reshape(2, 3)
            self.xyz = numpy.fromfile(f, "f4" if head[6] else "f8", 3 * vertices).reshape(-1, 3)
            self.faces = numpy.fromfile(f, "u4", 3 * faces).reshape(-1, 3)
            self.rgb = numpy.fromfile(f, "u1", 4 * vertices).reshape(-1, 4) if head[7] else None
            rows = numpy.fromfile(f, "u8", 3 * nodes).reshape(-1, 3).astype("i8")
            self.code, self.type, self.polygons = rows.T
            corners = numpy.fromfile(f, "u1", polygons).astype("i8")
            self.lent = numpy.fromfile(f, "f4", 3 * polygons).reshape(-1, 3).repeat(
                corners - 2, axis=0).astype("f8")
            self.face_node = numpy.repeat(numpy.arange(nodes), self.polygons).repeat(corners - 2)
            self.samples = numpy.memmap(
                out, [("z", "f4"), ("id", "u4"), ("share", "f4", 2)], "r", f.tell(),
                (len(views), samples, samples))
        out.unlink()

    def area(self, some=slice(None)):
        """Return the cross products of the triangles' sides."""
        a, b, c = (self.xyz[self.faces[some, k]].astype("f8") for k in range(3))
        return numpy.cross(b - a, c - a)

    def at(self, view):
        """Return the mask of the object in a view, the triangle of each sample, and its barycentric coordinates."""
        samples = self.samples[view]
        hit = samples["id"] != NONE
        share = samples["share"][hit].astype("f8")
        return hit, samples["id"][hit], numpy.column_stack([1 - share.sum(1), share])

    def between(self, values, which, share):
        return sum(share[:, k:k + 1] * values[self.faces[which, k]] for k in range(3))

    def colour(self, which, share):
        return PLAIN if self.rgb is None else self.between(LINEAR[self.rgb[:, :3]], which, share)


class Model:
    def __init__(self, bench, path, scratch, directions, deepest):
        self.bench, self.path, self.scratch = bench, path, scratch
        box = Shown(bench, path, "mesh", [], ([0, 0, 0], 1), 1, scratch)
        low, high = box.xyz.min(0).astype("f8"), box.xyz.max(0).astype("f8")
        self.scale = (low + high) / 2, numpy.linalg.norm(high - low) / 2
        self.origin, self.size = box.origin, box.size
        self.normal = numpy.concatenate([box.area(slice(i, i + 2 ** 20))
                                         for i in range(0, len(box.faces), 2 ** 20)])
        self.middle = sum(box.xyz[box.faces[:, k]] for k in range(3)) / 3
        self.cells, self.deepest, self.coloured = {}, deepest, box.rgb is not None
        self.views = cameras(dodecahedron()[::20 // directions])
        self.references = [Reference(picture(hit, light), covered(hit))
                           for hit, light, _ in self.shots(self.views, 2 * PIXELS)]

    def shots(self, views, samples):
        """Return mask, light and normals of the full model, for each view."""
        shown = Shown(self.bench, self.path, "mesh", views, self.scale, samples, self.scratch)
        out = []
        for i, view in enumerate(views):
            hit, which, share = shown.at(i)
            n = unit(self.normal[which]) @ view.T
            n *= numpy.where(n[:, 2:] < 0, -1, 1)  # back sides of surfaces
            out.append((hit, lit(n, shown.colour(which, share)), n @ view))
        return out

    def keys(self, level, cells):
        n = 1 << level
        return (cells[:, 0] * n + cells[:, 1]) * n + cells[:, 2]

    def of_cells(self, level):
        """Return the cells with faces: keys, sums of normals, and sums of the normals' lengths."""
        if level not in self.cells:
            if level < self.deepest:
                keys, sums = self.of_cells(level + 1)
                n = 2 << level
                at = numpy.stack([keys // (n * n), keys // n % n, keys % n], 1) >> 1
            else:
                n = 1 << level
                at = ((self.middle - self.origin) / self.size * n).astype("i8").clip(0, n - 1)
                sums = numpy.column_stack([self.normal, numpy.linalg.norm(self.normal, axis=1)])
            keys, inverse = numpy.unique(self.keys(level, at), return_inverse=True)
            self.cells[level] = keys, numpy.stack(
                [numpy.bincount(inverse, w) for w in sums.T], 1)
        return self.cells[level]


def octahedral(n):
    """Return normals as two bytes each, and the normals that these bytes encode."""
    n = n / numpy.maximum(numpy.abs(n).sum(1, keepdims=True), 1e-30)

    def fold(v, where):
        sign = numpy.where(v < 0, -1, 1)
        return numpy.where(where[:, None], (1 - numpy.abs(v[:, ::-1])) * sign, v)
    code = numpy.round(fold(n[:, :2], n[:, 2] < 0) * 127)
    z = 1 - numpy.abs(code / 127).sum(1)
    return code.astype("i1"), unit(numpy.column_stack([fold(code / 127, z < 0), z]))


class Level:
    """A level's envelopes with several kinds of normals."""

    def __init__(self, model, path, level):
        self.model, self.level = model, level
        self.shown = s = Shown(model.bench, path, level, model.views, model.scale, 2 * PIXELS,
                               model.scratch)
        self.depth = numpy.floor(numpy.log2(s.code) + 1e-9).astype("i8") // 3
        self.cell = numpy.zeros((len(s.code), 3), "i8")
        for bit in range(level + 1):
            octant = numpy.where(self.depth > bit, s.code >> 3 * bit & 7, 0)
            for k in range(3):
                self.cell[:, k] |= (octant >> k & 1) << bit
        self.step = model.size / (1 << self.depth)[:, None]
        self.low = model.origin + self.cell * self.step
        self.area = s.area()
        self.flat = unit(self.area)
        self.on_cell_face = self.cell_faces()
        corners = numpy.array([[c & 1, c >> 1 & 1, c >> 2] for c in range(8)])
        at = (self.cell[:, None] + corners) << (12 - self.depth)[:, None, None]
        _, self.corner = numpy.unique((at[..., 0] << 42) + (at[..., 1] << 21) + at[..., 2],
                                      return_inverse=True)
        self.corner = self.corner.reshape(-1, 8)

    def cell_faces(self):
        """Return which triangles are on cell faces that are not on the root cell's faces."""
        node, out = self.shown.face_node, numpy.zeros(len(self.area), bool)
        for axis in range(3):
            at, last = self.cell[node, axis], (1 << self.depth[node]) - 1
            place = (self.shown.xyz[self.shown.faces, axis] - self.low[node, axis, None]) / \
                self.step[node, axis, None]
            for end, outmost in ((0, at == 0), (1, at == last)):
                out |= (numpy.abs(place - end) < 1e-9).all(1) & ~outmost
        return out

    def own(self):
        """Return the sum of each node's planes, as in the viewer: a vector, and its length without cancellation."""
        some = ~self.on_cell_face
        return numpy.stack([numpy.bincount(self.shown.face_node[some], w[some], len(self.cell))
                            for w in (*self.area.T, numpy.linalg.norm(self.area, axis=1))], 1)

    def stored(self, leaves=False):
        """Return the same for the surface in each node, as a file could store it, and the bytes that zlib makes of it.

        Directions have two bytes, lengths 16 steps.
        leaves: leaves have their own normals; otherwise those of their parents.
        """
        out = numpy.zeros((len(self.cell), 4))
        code = []
        up = 0 if leaves else 1
        owner = numpy.where(self.shown.type == 3, self.depth, numpy.maximum(self.depth - up, 0))
        for level in range(self.level + 1):
            at = numpy.nonzero(owner == level)[0]
            keys, sums = self.model.of_cells(level)
            key = self.model.keys(level, self.cell[at] >> (self.depth[at] - level)[:, None])
            row = numpy.searchsorted(keys, key).clip(0, len(keys) - 1)
            mean = numpy.where((keys[row] == key)[:, None], sums[row], 0)
            length = numpy.linalg.norm(mean[:, :3], axis=1) / numpy.maximum(mean[:, 3], 1e-30)
            codes, n = octahedral(mean[:, :3])
            out[at] = numpy.column_stack(
                [n * (numpy.round(length * 15) / 15 * mean[:, 3])[:, None], mean[:, 3]])
            some = slice(None) if leaves else self.shown.type[at] == 3
            code.append(codes[some])
        code = numpy.concatenate(code)
        return out, len(zlib.compress(code[:, 0].tobytes() + code[:, 1].tobytes(), 6))

    def field(self, of_nodes):
        """Return the field at vertices, interpolated between means at the cells' corners."""
        s, sums = self.shown, numpy.zeros((self.corner.max() + 1, 4))
        for c in range(8):
            for k in range(4):
                sums[:, k] += numpy.bincount(self.corner[:, c], of_nodes[:, k], len(sums))
        sums = sums[:, :3] / numpy.maximum(sums[:, 3:], 1e-30)
        node = numpy.zeros(len(s.xyz), "i8")
        node[s.faces.ravel()] = s.face_node.repeat(3)
        place = (s.xyz - self.low[node]) / self.step[node]
        out = numpy.zeros((len(s.xyz), 3))
        for c in range(8):
            share = numpy.prod(numpy.where([c & 1, c >> 1 & 1, c >> 2], place, 1 - place), axis=1)
            out += share[:, None] * sums[self.corner[node, c]]
        return out

    def from_field(self, field, which, share):
        length = numpy.linalg.norm(field, axis=1, keepdims=True)
        weight = self.shown.between(((length - SURE[0]) / (SURE[1] - SURE[0])).clip(0, 1), which,
                                    share)
        return unit(self.flat[which] * (1 - weight) +
                    unit(self.shown.between(field, which, share)) * weight)


# --- pictures around the model ---

class Taken:
    """Pictures from the directions that a number of pictures needs, with light and normals."""

    def __init__(self, model, halvings):
        self.directions = {h: octahedron(h) for h in halvings}
        self.needed = {h: sorted({int(numpy.argmax(d @ view[2])) for view in model.views})
                       for h, d in self.directions.items()}
        views = [view for h in halvings for view in cameras(self.directions[h][self.needed[h]])]
        self.light, self.normals, self.seen = {}, {}, {}
        names = [(h, i) for h in halvings for i in self.needed[h]]
        for name, (hit, light, n) in zip(names, model.shots(views, 2 * LARGE)):
            image = numpy.zeros(hit.shape + (3,), "f4")
            image[hit] = n
            self.normals[name] = halved(image)
            self.light[name], self.seen[name] = picture(hit, light).astype("f4"), covered(hit)


class Pictures:
    def __init__(self, model, taken, halvings, pixels, quality=60, normals=False):
        self.directions, self.pixels, self.normals = taken.directions[halvings], pixels, normals
        self.name = f"{len(self.directions)} {'normals' if normals else 'pictures'} of {pixels}"
        needed = taken.needed[halvings]
        self.cameras = dict(zip(needed, cameras(self.directions[needed])))
        images = []
        for i in needed:
            image, seen = (taken.normals if normals else taken.light)[halvings, i], \
                taken.seen[halvings, i]
            if pixels < LARGE:
                image, seen = halved(image), halved(seen[..., None])[..., 0] > 0
            image = 127.5 + 127.5 * unit(image) if normals else srgb(image)
            images.append(self.grown(image, seen).round().clip(0, 255).astype("u1"))
        done = subprocess.run([model.bench / "jpeg_pictures", str(pixels), str(pixels), str(quality),
                               str(len(images))], input=b"".join(i.tobytes() for i in images),
                              capture_output=True, check=True)
        decoded = numpy.frombuffer(done.stdout, "u1").reshape(len(images), pixels, pixels, 3)
        self.image = dict(zip(needed, decoded.astype("f8")))
        self.one = int(done.stderr) / len(needed)  # bytes, the mean of the needed pictures
        self.bytes = self.one * len(self.directions)
        self.scale = model.scale

    def nearest(self, back):
        return int(numpy.argmax(self.directions @ back))

    @staticmethod
    def grown(image, seen):
        """Extend the object in a picture beyond its border, because coarser envelopes are larger than the object."""
        image, seen = image.copy(), seen.copy()
        for _ in range(16):
            total, count = numpy.zeros_like(image), numpy.zeros(seen.shape)
            for step in ((0, 1), (0, -1), (1, 0), (-1, 0)):
                there = numpy.roll(seen, step, (0, 1))
                total += numpy.roll(image, step, (0, 1)) * there[..., None]
                count += there
            new = ~seen & (count > 0)
            image[new] = total[new] / count[new][:, None]
            seen |= new
        return image

    def on(self, back, places):
        """Return the values of the nearest picture at positions, and the direction from which it was taken."""
        i = self.nearest(back)
        camera, image = self.cameras[i], self.image[i]
        at = (places - self.scale[0]) @ camera.T * (self.pixels / 2 / self.scale[1])
        u, v = self.pixels / 2 + at[:, 0] - .5, self.pixels / 2 - at[:, 1] - .5
        x, y = (numpy.floor(w).astype("i8").clip(0, self.pixels - 2) for w in (u, v))
        fx, fy = (u - x).clip(0, 1)[:, None], (v - y).clip(0, 1)[:, None]
        return ((image[y, x] * (1 - fx) + image[y, x + 1] * fx) * (1 - fy) +
                (image[y + 1, x] * (1 - fx) + image[y + 1, x + 1] * fx) * fy), camera[2]


# --- the comparison ---

def towards(n, view):
    n = n @ view.T
    n[:, 2] = n[:, 2].clip(0)
    return unit(n)


def compare_nodes(model, level, of_nodes):
    """Return mean SSIM and mean difference when node normals give the light."""
    field, values = level.field(of_nodes), []
    for i, view in enumerate(model.views):
        hit, which, share = level.shown.at(i)
        n = towards(level.from_field(field, which, share), view)
        values.append(model.references[i].likeness(
            picture(hit, lit(n, level.shown.colour(which, share))), covered(hit)))
    return numpy.mean(values, axis=0)


def compare(model, level, pictures, stored):
    """Return for each method of shading: bytes in addition to the level's, mean SSIM, mean difference."""
    s, found = level.shown, {}
    field, (of_nodes, node_bytes) = level.field(level.own()), stored
    node_field = level.field(of_nodes)
    for i, view in enumerate(model.views):
        hit, which, share = s.at(i)
        colour, flat, on_cell_face = s.colour(which, share), level.flat[which], level.on_cell_face[which][:, None]
        places = s.between(s.xyz, which, share)
        by_nodes, by_field = (level.from_field(f, which, share) for f in (node_field, field))

        def note(name, extra, light):
            values = model.references[i].likeness(picture(hit, light), covered(hit))
            found.setdefault(name, (extra, []))[1].append(values)
        for name, extra, n in (
                ("polygon normals", 0, flat), ("cell faces lit", 0, s.lent[which]),
                ("cell faces lit, planes half", 0,
                 numpy.where(on_cell_face, s.lent[which], unit(flat + by_field))),
                ("field", 0, by_field),
                ("node normals", node_bytes, by_nodes),
                ("cell faces by node normals", node_bytes, numpy.where(on_cell_face, by_nodes, flat))):
            note(name, extra, lit(towards(n, view), colour))
        for p in pictures:
            shown, taken = p.on(view[2], places)
            if p.normals:
                note(p.name + ", lit", p.bytes, lit(towards(unit(shown - 127.5), view), colour))
                continue
            light = LINEAR[shown.round().clip(0, 255).astype("i8")]
            note(p.name, p.bytes, light)
            if p.pixels > SMALL or len(p.directions) < 66:
                continue
            faces = (s.lent[which] @ taken > .3)[:, None]
            note(p.name + ", node normals where the surface faces away", p.bytes + node_bytes,
                 numpy.where(faces, light, lit(towards(by_nodes, view), colour)))
    return {name: (extra, *numpy.mean(values, axis=0)) for name, (extra, values) in found.items()}


def run(*arguments):
    subprocess.run([str(a) for a in arguments], check=True, stdout=subprocess.DEVNULL)


def budget_table(rows):
    """Print the best result of each method within each budget."""
    ways = {}
    for name, level, size, likeness in rows:
        ways.setdefault(name, []).append((size, likeness, level))
    print("\n| way |" + "".join(f" {b} KB |" for b in BUDGETS))
    print("|---|" + "---|" * len(BUDGETS))
    for name, points in ways.items():
        cells = []
        for budget in BUDGETS:
            fit = [(likeness, level) for size, likeness, level in points if size <= budget * 1000]
            cells.append(f" {max(fit)[0]:.3f} ({max(fit)[1]}) |" if fit else " |")
        print(f"| {name} |" + "".join(cells))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("file", type=pathlib.Path)
    parser.add_argument("--levels", default="3-6")
    parser.add_argument("--directions", type=int, default=20, choices=(1, 2, 4, 5, 10, 20))
    o = parser.parse_args()
    first, last = (int(x) for x in o.levels.split("-"))
    check_likeness()
    with tempfile.TemporaryDirectory() as folder:
        scratch, bench, ebpo = pathlib.Path(folder), o.build / "tests/bench", o.build / "tools/ebpo"
        model = Model(bench, o.file, scratch, o.directions, last)
        taken = Taken(model, (1, 2, 3))
        pictures = [Pictures(model, taken, *a) for a in (
            (1, SMALL), (2, SMALL), (3, SMALL), (3, LARGE))]
        if not model.coloured:
            pictures.append(Pictures(model, taken, 2, LARGE, 75, True))
        print(f"{o.file.name}: {o.file.stat().st_size} bytes", flush=True)
        for p in pictures:
            print(f"{p.name}: {p.bytes:.0f} bytes, one {p.one:.0f}")
        print("\n| level | way | bytes | SSIM | difference |\n|---|---|---|---|---|")
        rows = []
        for deepest in range(first, last + 1):
            path = scratch / "levels.ebpo.h5"
            run(ebpo, "subset", "-q", "--levels", f"0-{deepest}", o.file, path)
            size = path.stat().st_size
            level = Level(model, path, deepest)
            found = compare(model, level, pictures, level.stored())
            cut = scratch / "cut.ebpo.h5"
            run(bench / "level_samples", path, "--planes-to", deepest - 1, cut)
            level = Level(model, cut, deepest)
            stored = level.stored(leaves=True)
            found["planes of the level above, normals of all nodes"] = (
                cut.stat().st_size - size + stored[1],
                *compare_nodes(model, level, stored[0]))
            for name, (extra, likeness, difference) in found.items():
                print(f"| {deepest} | {name} | {size + extra:.0f} | {likeness:.4f} | "
                      f"{difference:.1f} |", flush=True)
                rows.append((name, deepest, size + extra, likeness))
    budget_table(rows)


main()
