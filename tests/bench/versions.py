#!/usr/bin/env python3
"""Remakes docs/measured/versions.md: whether files of format 1.0 still open, and what a reader of 1.0 says of files of
1.1.

    tests/bench/versions.py OLD EBPO OLD_VECTORS MODELS_DIR > docs/measured/versions.md

OLD: the tool of format 1.0, OLD_VECTORS: format-spec/vectors of then; the page says how to make both. EBPO: this tool.
MODELS_DIR: a folder of PLY files with the names used below, and `wild`. Ends with 1 if files of 1.0 are not read as
the old tool reads them, or if the old tool takes a file of 1.1 for anything but what it is.
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


def answers(tool, file, points, folder):
    """What a tool makes of a file: answers bit for bit, and the mesh."""
    back = folder / "back.ply"
    solid = run(tool, "inside", "--raw", file, points, text=False)
    near = run(tool, "distance", "--raw", file, points, text=False)
    mesh = run(tool, "extract", "-q", "--mesh", file, back)
    return solid.stdout, near.stdout, back.read_bytes() if mesh.returncode == 0 else mesh.stderr


def old_files(folder):
    print("## Files of 1.0, made by the old tool, read by this one\n")
    head("model", "codec", "opens", "verify", "inside, distance and mesh as by the old tool")
    for name in PLAIN:
        for codec in ("zstd", "deflate", "none"):
            file, points = folder / "old.ebpo.h5", folder / "points.raw"
            run(OLD, "convert", "-q", "--codec", codec, MODELS / f"{name}.ply", file)
            run(OLD, "bench", "--count", 1000, "--save-points", points, file)
            opens = run(NEW, "info", file).returncode == 0
            same = answers(OLD, file, points, folder) == answers(NEW, file, points, folder)
            row(name, codec, expect(opens, name), expect(run(NEW, "verify", "-q", file).returncode == 0, name),
                expect(same, name))
    passed, failed = sorted(VECTORS.glob("passed/*.h5")), sorted(VECTORS.glob("failed/*.h5"))
    taken = [v.name for v in passed if run(NEW, "info", v).returncode == 0]
    refused = [v.name for v in failed if run(NEW, "verify", "-q", v).returncode != 0]
    print(f"\nOf the {len(passed)} passed vectors of then this tool opens {len(taken)}; of the {len(failed)} failed ones "
          f"it refuses {len(refused)}.")
    for name in {v.name for v in passed} - set(taken):
        expect(False, name)
        print(f"Not opened: {name}: {said(run(NEW, 'info', VECTORS / 'passed' / name))}")
    for name in sorted({v.name for v in failed} - set(refused)):
        print(f"Taken now: {name}")


def new_files(folder):
    print("\n## Files of 1.1, made by this tool, read by the old one\n")
    head("model", "written with", "opens", "verify", "inside and distance as by this tool", "says")
    whole, points = folder / "new.ebpo.h5", folder / "points.raw"
    for name in [*PLAIN, *(f"wild/{n}" for n in COLOURED)]:
        for options in ([], ["--face-coding", "gates"], ["--subtree-faces", "64"]):
            run(NEW, "convert", "-q", *options, MODELS / f"{name}.ply", whole)
            run(NEW, "bench", "--count", 1000, "--save-points", points, whole)
            done = run(OLD, "info", whole)
            opens, verified = done.returncode == 0, run(OLD, "verify", "-q", whole).returncode == 0
            same = opens and answers(OLD, whole, points, folder)[:2] == answers(NEW, whole, points, folder)[:2]
            refused = 'needs part "subtrees"' in done.stderr or 'needs part "gates"' in done.stderr
            expect(verified and same if opens else refused and not verified, f"{name} {options}")
            row(name.removeprefix("wild/"), " ".join(options) or "usual options", "yes" if opens else "no",
                "yes" if verified else "no", "yes" if same else "-", f"`{said(done)}`" if not opens else "")


def main():
    print("""# Versions of the format

Made by `tests/bench/versions.py OLD EBPO OLD_VECTORS MODELS_DIR > docs/measured/versions.md`; nothing here was typed in
by hand. OLD is the tool as it was before format 1.1, of the commit that describes subtrees and the last one that writes
1.0: `git worktree add old ef94608 && cd old && meson setup build && ninja -C build tools/ebpo`, and OLD_VECTORS is
`old/format-spec/vectors`.
""")
    with tempfile.TemporaryDirectory() as name:
        old_files(pathlib.Path(name))
        new_files(pathlib.Path(name))
    for line in wrong:
        print(line, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
