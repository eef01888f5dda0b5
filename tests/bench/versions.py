#!/usr/bin/env python3
"""Compares this tool with the tool of format 1.0: both read files of 1.0, and files of 1.1.

    tests/bench/versions.py OLD EBPO OLD_VECTORS MODELS_DIR

OLD: the tool of format 1.0, from the last commit that writes it: `git worktree add old ef94608 && cd old && meson setup
build && ninja -C build tools/ebpo`. OLD_VECTORS: its format-spec/vectors. EBPO: this tool. MODELS_DIR: a folder of PLY
files with the names used below, and `wild`. Prints two tables. Exit code 1: the two tools read a file of 1.0
differently, or the old tool accepts a file of 1.1 that it cannot read.
"""
import pathlib
import subprocess
import sys
import tempfile

OLD, NEW, VECTORS, MODELS = sys.argv[1], sys.argv[2], *map(pathlib.Path, sys.argv[3:5])
PLAIN = ["bunny_closed", "dragon100k", "igea", "cad_adis16480", "office_chair"]
COLOURED = ["cycloidal_le_vertex_and_face_colours", "dragon100k_le_normals_flags", "suzanne_ascii_quads_normals_uv",
            "tetra_ascii_double_normals_colours_edges"]
wrong = []


def run(*arguments, text=True):
    return subprocess.run([str(a) for a in arguments], capture_output=True, text=text, stdin=subprocess.DEVNULL)


def said(done):
    return done.stderr.strip().splitlines()[-1].split(": ", 2)[-1] if done.returncode else ""


def row(*cells):
    print("| " + " | ".join(str(c) for c in cells) + " |", flush=True)


def head(*cells):
    row(*cells)
    row(*["---"] * len(cells))


def expect(good, what):
    if not good:
        wrong.append(what)
    return "yes" if good else "**no**"


def results_of(tool, file, points, folder):
    """Returns the raw query results and the mesh that a tool reads from a file."""
    back = folder / "back.ply"
    solid = run(tool, "inside", "--raw", file, points, text=False)
    near = run(tool, "distance", "--raw", file, points, text=False)
    mesh = run(tool, "extract", "-q", "--mesh", file, back)
    return solid.stdout, near.stdout, back.read_bytes() if mesh.returncode == 0 else mesh.stderr


def old_files(folder):
    print("Files of format 1.0, written by the old tool and read by this tool\n")
    head("model", "codec", "opens", "verify", "inside, distance and mesh equal")
    for name in PLAIN:
        for codec in ("zstd", "deflate", "none"):
            file, points = folder / "old.ebpo.h5", folder / "points.raw"
            run(OLD, "convert", "-q", "--codec", codec, MODELS / f"{name}.ply", file)
            run(OLD, "bench", "--count", 1000, "--save-points", points, file)
            opens = run(NEW, "info", file).returncode == 0
            same = results_of(OLD, file, points, folder) == results_of(NEW, file, points, folder)
            row(name, codec, expect(opens, name), expect(run(NEW, "verify", "-q", file).returncode == 0, name),
                expect(same, name))
    passed, failed = sorted(VECTORS.glob("passed/*.h5")), sorted(VECTORS.glob("failed/*.h5"))
    taken = [v.name for v in passed if run(NEW, "info", v).returncode == 0]
    refused = [v.name for v in failed if run(NEW, "verify", "-q", v).returncode != 0]
    print(f"\nVectors of format 1.0: this tool opens {len(taken)} of {len(passed)} passed ones and refuses "
          f"{len(refused)} of {len(failed)} failed ones.")
    for name in {v.name for v in passed} - set(taken):
        expect(False, name)
        print(f"Not opened: {name}: {said(run(NEW, 'info', VECTORS / 'passed' / name))}")
    for name in sorted({v.name for v in failed} - set(refused)):
        print(f"Accepted: {name}")


def new_files(folder):
    print("\nFiles of format 1.1, written by this tool and read by the old tool\n")
    head("model", "options", "opens", "verify", "inside and distance equal", "message")
    whole, points = folder / "new.ebpo.h5", folder / "points.raw"
    for name in [*PLAIN, *(f"wild/{n}" for n in COLOURED)]:
        for options in ([], ["--face-coding", "gates"], ["--subtree-faces", "64"]):
            run(NEW, "convert", "-q", *options, MODELS / f"{name}.ply", whole)
            run(NEW, "bench", "--count", 1000, "--save-points", points, whole)
            done = run(OLD, "info", whole)
            opens, verified = done.returncode == 0, run(OLD, "verify", "-q", whole).returncode == 0
            same = opens and results_of(OLD, whole, points, folder)[:2] == results_of(NEW, whole, points, folder)[:2]
            refused = 'needs part "subtrees"' in done.stderr or 'needs part "gates"' in done.stderr
            expect(verified and same if opens else refused and not verified, f"{name} {options}")
            row(name.removeprefix("wild/"), " ".join(options) or "default", "yes" if opens else "no",
                "yes" if verified else "no", "yes" if same else "-", f"`{said(done)}`" if not opens else "")


def main():
    with tempfile.TemporaryDirectory() as name:
        old_files(pathlib.Path(name))
        new_files(pathlib.Path(name))
    for line in wrong:
        print(line, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
