#!/usr/bin/env python3
"""Compares pictures of the simplified surface and of envelopes with pictures of the model, for
docs/measured/coarse-levels.md.

    /usr/bin/python3 tests/bench/surface.py BUILD_DIR MESH... [--pixels 800]

Converts each mesh with the part surface. Draws the mesh, the levels of the surface and the levels of envelopes by
`ebpo render` from one viewpoint. Prints the SSIM of luminance over the pixels that show the model, and the size of
the file that `ebpo subset` writes for the level. Also prints the part's share of the file, and the processor time of
the conversion with and without the part.

The last table has the bytes of the surface / those of envelopes at equal SSIM: at levels of the surface, and at levels
of envelopes, where the bytes of the other way are interpolated between its levels. Levels whose SSIM the other way does
not reach have no share. If all envelopes have a greater SSIM, the coarsest count. "below": the coarsest level of the
surface / coarser envelopes, whose SSIM is lower.

Needs numpy.
"""
import argparse
import json
import os
import pathlib
import resource
import struct
import subprocess
import tempfile
import zlib

import numpy


GOAL = 0.4  # greatest share of the bytes of envelopes


def run(*words):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    text = subprocess.run([str(w) for w in words], check=True, capture_output=True, text=True).stdout
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return text, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def read_png(path):
    """Return the pixels of an RGB PNG without interlacing."""
    data, at, packed, shape = path.read_bytes(), 8, b"", (0, 0)
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + size]
        if kind == b"IHDR":
            shape = struct.unpack(">II", body[:8])[::-1]
        packed += body if kind == b"IDAT" else b""
        at += 12 + size
    rows = numpy.frombuffer(zlib.decompress(packed), numpy.uint8).reshape(shape[0], 3 * shape[1] + 1)
    out = numpy.zeros((shape[0] + 1, 3 * shape[1] + 3), numpy.int64)
    for y, row in enumerate(rows):
        line, above = out[y + 1], out[y]
        if row[0] == 0:
            line[3:] = row[1:]
        elif row[0] == 2:
            line[3:] = row[1:] + above[3:] & 255
        elif row[0] == 1:
            line[3:] = row[1:].reshape(-1, 3).cumsum(0, int).ravel() & 255
        else:
            made, over, kind = [0, 0, 0], above.tolist(), row[0]  # lists of Python are faster
            for x, value in enumerate(row[1:].tolist(), 3):
                a, b, c = made[x - 3], over[x], over[x - 3]
                if kind == 3:
                    guess = (a + b) // 2
                else:
                    of_a, of_b, of_c = abs(b - c), abs(a - c), abs(a + b - 2 * c)
                    guess = a if of_a <= of_b and of_a <= of_c else b if of_b <= of_c else c
                made.append(value + guess & 255)
            line[:] = made
    return out[1:, 3:].reshape(shape + (3,)).astype(float)


def luminance(pixels):
    s = pixels / 255
    linear = numpy.where(s <= .04045, s / 12.92, ((s + .055) / 1.055) ** 2.4)
    return linear @ [.2126, .7152, .0722]


def blurred(a):
    """Return the picture under a Gaussian of 11 pixels, sigma 1.5 (Wang and others 2004)."""
    w = numpy.exp(-numpy.arange(-5, 6) ** 2 / 4.5)
    w /= w.sum()
    for axis in (0, 1):
        size = a.shape[axis]
        p = numpy.moveaxis(numpy.pad(a, [(5, 5) if i == axis else (0, 0) for i in (0, 1)], mode="edge"), axis, 0)
        a = numpy.moveaxis(sum(w[i] * p[i:i + size] for i in range(11)), 0, axis)
    return a


def likeness(reference, picture):
    """Return the mean SSIM of sRGB luminance where one of the pictures shows the model. The other picture's light is
    scaled to the reference, as envelopes have another colour.
    """
    ground = reference[:, :1]
    where = (abs(reference - ground).max(-1) > 3) | (abs(picture - picture[:, :1]).max(-1) > 3)
    a, b = luminance(reference), luminance(picture)
    b = numpy.where(where, b * (a * b)[where].sum() / (b * b)[where].sum(), a)
    a, b = (255 * numpy.maximum(v, 0) ** (1 / 2.2) for v in (a, b))
    ma, mb = blurred(a), blurred(b)
    va, vb, ab = blurred(a * a) - ma * ma, blurred(b * b) - mb * mb, blurred(a * b) - ma * mb
    c1, c2 = (.01 * 255) ** 2, (.03 * 255) ** 2
    return (((2 * ma * mb + c1) * (2 * ab + c2)) / ((ma * ma + mb * mb + c1) * (va + vb + c2)))[where].mean()


def draw(ebpo, file, words, level, folder, pixels):
    """Return the pictures of a level and of the mesh, from one viewpoint, and the number of triangles."""
    out = folder / "picture.png"
    text, _ = run(ebpo, "render", "--json", "--no-colours", "--size", f"{2 * pixels}x{pixels}", "--levels",
                  f"{level},mesh", *words, file, out)
    both = read_png(out)[:pixels - 60]
    return both[:, :pixels], both[:, pixels:], json.loads(text)["drawn"][0]["faces"]


def bytes_at(levels, wanted):
    """Return the bytes at which a way has an SSIM, or None. levels: (bytes, SSIM), coarse to fine."""
    for (least, before), (size, found) in zip(levels, levels[1:]):
        if before <= wanted <= found:
            return least + (size - least) * (wanted - before) / ((found - before) or 1)
    return None


def shares(levels):
    """Return bytes of the surface / bytes of envelopes at the SSIM of levels of the surface, at that of envelopes, and
    at the SSIM of envelopes below that of the coarsest level of the surface, where its bytes are those of this level.
    """
    surface, envelopes = levels["surface"], levels["envelopes"]
    at_surface = [(size, envelopes[0][0] if found < envelopes[0][1] else bytes_at(envelopes, found))
                  for size, found in surface]
    at_envelopes = [(bytes_at(surface, found), size) for size, found in envelopes if found >= surface[0][1]]
    below = [(surface[0][0], size) for size, found in envelopes if found < surface[0][1]]
    return [[a / b for a, b in pairs if a and b] for pairs in (at_surface, at_envelopes, below)]


def print_shares(rows):
    """Print the rows of measure() as a table, the greatest share first."""
    def greatest(row):
        return max(row[4][0] + row[4][1], default=0)

    def text(values):
        return " ".join(f"{v:.2f}" for v in values)

    print("\n| model | faces | part, % of the file | time | at levels of the surface | at levels of envelopes | below "
          f"| greatest | {GOAL:.2f} |\n|---|---|---|---|---|---|---|---|---|")
    for row in sorted(rows, key=greatest, reverse=True):
        name, faces, part, time, both = row
        most = greatest(row)
        print(f"| {name} | {faces} | {100 * part:.1f} | {time:.2f} | {' | '.join(map(text, both))} | {most:.2f} | "
              f"{'met' if most <= GOAL else 'missed'} |")


def measure(ebpo, mesh, folder, pixels):
    """Print the levels of a mesh. Return its row of the last table, or None if it has no patches."""
    plain, file, part = folder / "plain.h5", folder / "model.h5", folder / "part.h5"
    _, without = run(ebpo, "convert", "-q", mesh, plain)
    _, build = run(ebpo, "convert", "-q", "--parts=+surface", mesh, file)
    info = json.loads(run(ebpo, "info", "--json", file)[0])
    if "surface" not in info["bytes"]:
        print(f"\n{mesh.stem} has no patches.", flush=True)
        return None
    stored = info["bytes"]["surface"]
    print(f"\n## {mesh.stem}, {info['faces']} faces\n\nThe part takes {stored} B, "
          f"{100 * stored / file.stat().st_size:.1f} % of the file; processor time {build / without:.2f} times that "
          "without the part.\n\n| what | bytes | triangles | SSIM |\n|---|---|---|---|")
    found = {}
    for what, words, levels in (("envelopes", [], range(3, len(info["levels"]))),
                                ("surface", ["--surface"], range(len(info["levels"])))):
        last, found[what] = 0, []
        for level in levels:
            run(ebpo, "subset", "-q", "--levels", f"0-{level}", "--parts", "surface" if words else "envelopes", file,
                part)
            picture, reference, faces = draw(ebpo, file, words, level, folder, pixels)
            if words and faces == last:
                break
            last = faces
            found[what].append((part.stat().st_size, likeness(reference, picture)))
            print(f"| {what}, levels 0 to {level} | {found[what][-1][0]} | {faces} | {found[what][-1][1]:.3f} |",
                  flush=True)
    return mesh.stem, info["faces"], stored / file.stat().st_size, build / without, shares(found)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("mesh", type=pathlib.Path, nargs="+")
    parser.add_argument("--pixels", type=int, default=800)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = [measure(given.build / "tools/ebpo", mesh, pathlib.Path(folder), given.pixels) for mesh in given.mesh]
    print_shares([row for row in rows if row])


if __name__ == "__main__":
    main()
