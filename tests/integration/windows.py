#!/usr/bin/env python3
"""Compares the command for Windows, run by wine, with the command of this system.

    windows.py EBPO GENERATE SOURCE FOLDER [MODELS]

tools/packaging/windows.sh builds the command in FOLDER; the test is skipped where mingw-w64 or wine is missing. Both
commands must write equal bytes of files and equal text, and end with equal exit codes: conversions, vectors, queries,
exports, pictures, paint, scenes, names that are not ASCII, and long paths. Then tests the servers of the command for
Windows.
"""
import json
import os
import pathlib
import random
import re
import shlex
import shutil
import struct
import subprocess
import sys
import urllib.request
import zipfile

EBPO, GENERATE, SOURCE, FOLDER = map(pathlib.Path, sys.argv[1:5])
MODELS = pathlib.Path(sys.argv[5]) if len(sys.argv) > 5 else None
SKIPPED = 77
WINE = shutil.which("wine64") or "/usr/lib/wine/wine64"
VECTORS = SOURCE / "format-spec/vectors"
TIMES = rb"(?:, in|;) [\d.]+ s|\"(?:ms|seconds)\": [\d.e-]+"
problems = []
count = 0


def missing():
    for name in ("x86_64-w64-mingw32-gcc-posix", "cmake", "meson", WINE):
        if not shutil.which(name):
            return name
    return None


def wine_environment():
    return dict(os.environ, WINEPREFIX=str(FOLDER / "wine"), WINEDEBUG="-all", TMPDIR=str(FOLDER))


def run(program, arguments, data=None):
    done = subprocess.run([*program, *map(str, arguments)], input=data, capture_output=True, env=wine_environment(),
                          timeout=1800, check=False)
    return done.returncode, done.stdout, done.stderr


def report(problem):
    problems.append(problem)
    print(problem, flush=True)


def compare(what, arguments, data=None, outputs=()):
    """Run both commands with the same arguments, in which OUT names the folder of the results. Ignore times."""
    global count
    count += 1
    results = []
    for name, program in (("linux", [EBPO]), ("windows", WINDOWS)):
        out = FOLDER / name
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir()
        code, text, errors = run(program, [str(word).replace("OUT", str(out)) for word in arguments], data)
        folders = rb"[A-Za-z]?:?" + re.escape(str(out).encode())
        neutral = [re.sub(TIMES, b"", re.sub(folders, b"OUT", stream)) for stream in (text, errors)]
        results.append((code, *neutral, *[(out / path).read_bytes() if (out / path).exists() else None
                                          for path in outputs]))
    for part, linux, windows in zip(("exit code", "output", "messages", *outputs), *results):
        if linux != windows:
            shown = [repr(value[:300]) if isinstance(value, bytes) else value for value in (linux, windows)]
            report(f"{what}: {part} differs: {shown[0]} and {shown[1]}")


def conversions():
    inputs = {}
    for name, options in {"torus": ["--base", "torus", "--faces", "8000", "--seed", "7"],
                          "sphere": ["--base", "sphere", "--subdivide", "4", "--seed", "3"]}.items():
        inputs[name] = FOLDER / f"{name}.ply"
        subprocess.run([GENERATE, *options, inputs[name]], check=True)
    variants = {"default": [], "full": ["--profile", "full"], "threads": ["--threads", "3"],
                "memory": ["--memory", "20M"], "deflate": ["--codec", "deflate"], "surface": ["--parts=+surface"]}
    for name, path in inputs.items():
        for variant, options in variants.items():
            compare(f"convert {name} {variant}", ["convert", "-q", *options, path, "OUT/a.ebpo.h5"],
                    outputs=["a.ebpo.h5"])
    for name in ("bunny_closed", "office_chair") if MODELS else ():
        inputs[name] = MODELS / f"{name}.ply"
        compare(f"convert {name}", ["convert", "-q", inputs[name], "OUT/a.ebpo.h5"], outputs=["a.ebpo.h5"])
    compare("convert from and to pipes", ["convert", "-q", "-", "-"], data=inputs["sphere"].read_bytes())
    return inputs


def vectors():
    for path in sorted(VECTORS.glob("passed/*.ebpo.h5")):
        compare(f"verify {path.name}", ["verify", path])
        compare(f"info {path.name}", ["info", "--json", path])
        compare(f"mesh of {path.name}", ["extract", "--mesh", path, "OUT/a.ply"], outputs=["a.ply"])
    for path in sorted([*VECTORS.glob("failed/*.ebpo.h5"), *VECTORS.glob("former/*.ebpo.h5")]):
        compare(f"verify {path.parent.name}/{path.name}", ["verify", path])
    for path in sorted(VECTORS.glob("paint/*/*.paint.h5")):
        compare(f"paint {path.parent.name}/{path.name}", ["paint", "--json", "--strokes", "--points", path])


def queries(models):
    numbers = random.Random(42)
    for model in models:
        low, high = (-1.2, 1.2) if model.name.startswith(("torus", "sphere")) else (-0.1, 0.2)
        points = "".join("%.17g %.17g %.17g\n" % tuple(numbers.uniform(low, high) for _ in range(3))
                         for _ in range(2000)).encode()
        rays = "".join("%.17g %.17g %.17g %.17g %.17g %.17g\n" % tuple(numbers.uniform(low, high) for _ in range(6))
                       for _ in range(2000)).encode()
        for name, data in (("inside", points), ("distance", points), ("ray", rays), ("box", None)):
            if name == "box":
                data = b"".join(b"%s %s\n" % (line, line) for line in points.splitlines()[:50])
            compare(f"{name} {model.name}", [name, model], data)
            compare(f"{name} {model.name} in JSON", [name, "--json", model], data)
            compare(f"{name} {model.name} in little memory", [name, "--memory", "4M", model], data)
        compare(f"raw distances {model.name}", ["distance", "--raw", model],
                b"".join(struct.pack("<3d", *(numbers.uniform(low, high) for _ in range(3))) for _ in range(500)))
        compare(f"bounds at a level of {model.name}", ["distance", "--max-level", "3", model], points)
        compare(f"measure {model.name}", ["measure", model])
        compare(f"subset {model.name}", ["subset", "--levels", "0-3", model, "OUT/a.ebpo.h5"], outputs=["a.ebpo.h5"])
        compare(f"repack {model.name}", ["repack", "--codec", "deflate", model, "OUT/a.ebpo.h5"], outputs=["a.ebpo.h5"])
        compare(f"glTF {model.name}", ["export", "--level", "3", model, "OUT/a.glb"], outputs=["a.glb"])
    compare("collide", ["collide", *models[:2]])
    compare("collide in JSON", ["collide", "--json", "--distance", *models[:2]])
    compare("boolean", ["boolean", "A - B", *models[:2], "-o", "OUT/a.ply"], outputs=["a.ply"])


def other_commands(model, mesh):
    """Compare commands that examine, draw, paint and place a model."""
    for command in ("check", "check --crossings", "check --json"):
        compare(command, [*command.split(), mesh])
    for words, output in {"map -q --plane z=50% --size 60x40": "a.png", "map -q --grid 8,8,8": "a.nrrd",
                          "map -q --grid 8,8,9": "a.vtkhdf", "view --json --eye 5,4,3 --bytes 200K": "a.ply"}.items():
        compare(words, [*words.split(), "-o", f"OUT/{output}", model], outputs=[output])
    compare("envelopes", ["extract", "--level", "3", model, "OUT/a.ply"], outputs=["a.ply"])
    compare("picture", ["render", "--size", "320x200", "--edges", model, "OUT/a.png"], outputs=["a.png"])
    compare("brush", ["paint", "OUT/a.paint.h5", model, "--new-layer", "Risse", "--date", "2026-01-02", "--path", "-",
                      "--radius", "0.05"], b"1 0 0\n1 0.2 0.1 0.5\n1 0.4 0.1 1\n", outputs=["a.paint.h5"])
    scene = FOLDER / "a.scene.json"
    scene.write_text(json.dumps({"ebpo_scene": "1.0", "models": {"a": {"file": model.name}}, "instances": [
        {"name": "one", "model": "a"}, {"name": "two", "model": "a", "pose": {"translation": [0.5, 0.25, 0]}}]}))
    for words in ("info", "boxes", "pairs", "report --count --locations", "report --json --solids --depth 0.1"):
        compare(f"scene {words}", ["scene", *words.split(), scene])


def names(mesh):
    for name in ("näh € 模型.ebpo.h5", "a" * 200 + ".ebpo.h5", "/".join(["b" * 100] * 6) + "/c.ebpo.h5"):
        place = FOLDER / "names" / name
        shutil.rmtree(FOLDER / "names", ignore_errors=True)
        place.parent.mkdir(parents=True)
        code, text, errors = run(WINDOWS, ["convert", "-q", mesh, place])
        if code or not place.exists() or list(place.parent.iterdir()) != [place]:
            report(f"convert to {name[:40]}: {code} {text} {errors}")
        else:
            compare(f"info of {name[:40]}", ["info", "--json", place])
    compare("a mesh that does not exist", ["convert", FOLDER / "none.ply", "OUT/a.ebpo.h5"])
    compare("a folder that does not exist", ["convert", "-q", mesh, "OUT/none/a.ebpo.h5"])


def servers(model):
    """Test the sockets: ranges that `ebpo serve` sends, and the haptic device udp:."""
    viewer, program, data = FOLDER / "viewer", FOLDER / "ebpo-wine", model.read_bytes()
    viewer.mkdir(exist_ok=True)
    (viewer / "index.html").write_text("the viewer")
    with subprocess.Popen([*WINDOWS, "serve", "--port", "0", "--viewer", viewer, model], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, text=True, env=wine_environment()) as server:
        address = server.stdout.readline().strip()
        try:
            for begin, end in ((0, len(data) - 1), (7, 7), (100, len(data) - 1)):
                asked = urllib.request.Request(f"{address}models/0/{model.name}", headers={"Range": f"bytes={begin}-{end}"})
                with urllib.request.urlopen(asked, timeout=60) as got:
                    if got.read() != data[begin:end + 1]:
                        report(f"serve: bytes {begin} to {end} differ")
            with urllib.request.urlopen(address, timeout=60) as got:
                if got.read() != b"the viewer":
                    report("serve: the first page differs")
        except (OSError, ValueError) as error:
            server.kill()
            report(f"serve: {address!r}, {error}, {server.stderr.read()}")
        server.kill()
    program.write_text(f'#!/bin/sh\nexec {shlex.join(map(str, WINDOWS))} "$@"\n')
    program.chmod(0o755)
    done = subprocess.run([sys.executable, SOURCE / "tests/integration/haptic_udp.py", program], capture_output=True,
                          text=True, env=wine_environment(), timeout=600, check=False)
    if done.returncode:
        report(f"haptic_udp.py: {done.stdout}{done.stderr}")


def compare_all():
    inputs = conversions()
    models = []
    for name, path in inputs.items():
        models.append(FOLDER / f"{name}.ebpo.h5")
        subprocess.run([EBPO, "convert", "-q", path, models[-1]], check=True)
    vectors()
    queries(models)
    other_commands(models[0], inputs["torus"])
    names(inputs["sphere"])
    servers(models[0])


def main():
    global WINDOWS
    absent = missing()
    if absent:
        print(f"skipped: {absent} is missing (apt install mingw-w64 wine64 cmake meson)")
        return SKIPPED
    FOLDER.mkdir(parents=True, exist_ok=True)
    subprocess.run(["sh", SOURCE / "tools/packaging/windows.sh", FOLDER], check=True, stdout=subprocess.DEVNULL)
    archive = max(FOLDER.glob("ebpo-*-windows-x86_64.zip"), key=os.path.getmtime)
    shutil.rmtree(FOLDER / "unpacked", ignore_errors=True)
    zipfile.ZipFile(archive).extractall(FOLDER / "unpacked")
    WINDOWS = [WINE, str(next(FOLDER.glob("unpacked/*/bin/ebpo.exe")))]
    # Wine's own processes are started first and stay until the end. They keep the pipes of the command that starts them
    # open, so that command gets no pipes.
    server = WINE.replace("wine64", "wineserver64")
    subprocess.run([server, "-p"], env=wine_environment(), check=False)
    subprocess.run([*WINDOWS, "--version"], env=wine_environment(), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL, timeout=600, check=True)
    try:
        compare_all()
    finally:
        subprocess.run([server, "-k"], env=wine_environment(), check=False)
    print(f"{count} comparisons, {len(problems)} differ")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
