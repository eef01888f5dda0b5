#!/usr/bin/env python3
"""Tests a wheel in new virtual environments: check_wheel.py BUILD WHEEL [PYTHON...]

BUILD is a build folder with the tests' programs. For each PYTHON (default: the running one), pip installs the wheel and
its peers from PyPI. Run it by hand; the test `python_wheel` needs no network. Peers that PyPI does not have for a
Python, or all when PyPI cannot be reached, are reported as skipped. EBPO_PEERS names other peers. A wheel for musl is
tested without Python: its command, run with Debian's package musl, must give the results of the build.
"""
import os
import pathlib
import subprocess
import sys
import tempfile
import zipfile

HERE = pathlib.Path(__file__).resolve().parent
PEERS = os.environ.get("EBPO_PEERS", "h5py hdf5plugin trimesh open3d pyvista tqdm mypy auditwheel abi3audit").split()
LIMIT = 5_000_000  # bytes of the wheel


def run(*words, **options):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, **options)
    return done.returncode, done.stdout + done.stderr


def check(label, *words, **options):
    code, text = run(*words, **options)
    lines = [line for line in text.splitlines() if line.strip()]
    print(f"  {'ok' if code == 0 else 'FAILED'}: {label}: {lines[-1] if lines else ''}", flush=True)
    if code:
        print(text)
    return code == 0


def check_file(wheel):
    """Check the size and the licences of a wheel, and that it names no folder of the machine that built it."""
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        named = [name for name in names if str(HERE.parents[1])[1:].encode() in archive.read(name)]
    wanted = {"ebpo", "gmp", "hdf5", "jansson", "libzstd", "nettle", "zlib"}
    found = {pathlib.PurePath(name).stem for name in names if "/licenses/" in name}
    size = os.path.getsize(wheel)
    print(f"{os.path.basename(wheel)}: {size} bytes, licences: {', '.join(sorted(found))}")
    if named:
        print(f"FAILED: the folder of the sources is named in {', '.join(named)}")
    return size <= LIMIT and wanted <= found and not named


def check_python(python, build, wheel):
    """Install the wheel for one Python and test it. Return True when nothing fails."""
    print(run(python, "--version")[1].strip(), flush=True)
    bin_ = pathlib.Path("venv/bin").absolute()
    nothing = {name: value for name, value in os.environ.items() if not name.startswith(("EBPO", "PYTHON", "LD_", "HDF5"))}
    env = dict(nothing, PATH=f"{bin_}:/usr/bin:/bin")
    good = check("environment", python, "-m", "venv", "venv")
    good &= check("installation", bin_ / "pip", "install", "-q", "--disable-pip-version-check", wheel, env=env)
    missing = [peer for peer in PEERS if run(bin_ / "pip", "install", "-q", "--only-binary=:all:",
                                             "--disable-pip-version-check", peer, env=env)[0]]
    if missing:
        print(f"  SKIPPED, not installable from PyPI: {', '.join(missing)}")
    good &= check("command", bin_ / "ebpo", "--version", env=env)
    inputs, generate = build / "tests/cli/cli_inputs", build / "samples/ebpo-generate"
    run(inputs, ".")
    for order in ("first", "last") if "h5py" in PEERS and "h5py" not in missing else ():
        good &= check(f"h5py, imported {order}", bin_ / "python", HERE / "wheel_with_h5py.py", order, "sphere.ply", env=env)
    for name in ("interface", "queries", "paint"):
        good &= check(name, bin_ / "python", HERE / f"test_package_{name}.py", bin_ / "ebpo", inputs, generate, env=env)
    if "auditwheel" in PEERS and "auditwheel" not in missing:
        good &= check("auditwheel", bin_ / "python", "-m", "auditwheel", "show", wheel, env=env)
        print("   ", " ".join(run(bin_ / "python", "-m", "auditwheel", "show", wheel, env=env)[1].split())[:400])
    if "abi3audit" in PEERS and "abi3audit" not in missing:
        print("    abi3audit:", " ".join(run(bin_ / "python", "-m", "abi3audit", wheel, env=env)[1].split())[-200:])
    return good


def check_musl(build, wheel):
    """Unpack a wheel for musl, and compare its command with that of the build. Return True when nothing fails."""
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall()
    command, reference = pathlib.Path("ebpo/bin/ebpo").absolute(), build / "tools/ebpo"
    command.chmod(0o755)
    good = check("command", command, "--version", "--verbose", env=dict(os.environ, LD_BIND_NOW="1"))
    run(build / "tests/cli/cli_inputs", ".")
    points = "".join(f"{i % 7 / 3 - 1} {i % 11 / 5 - 1} {i / 200 - 1}\n" for i in range(400))
    for name in ("sphere", "torus"):
        results = []
        for ebpo, output in ((reference, f"{name}.ebpo.h5"), (command, f"{name}.musl.ebpo.h5")):
            good &= check(f"conversion of {name}", ebpo, "convert", f"{name}.ply", output)
            results.append([pathlib.Path(output).read_bytes()] + [run(ebpo, query, "--json", f"{name}.ebpo.h5", input=points)
                                                                 for query in ("inside", "distance", "verify")])
        equal = results[0] == results[1] and all(code == 0 for code, *_ in results[0][1:])
        print(f"  {'ok' if equal else 'FAILED'}: file and results of {name} equal those of the build")
        good &= equal
    return good


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    build, wheel = (pathlib.Path(name).absolute() for name in sys.argv[1:3])
    good = check_file(wheel)
    musl = "-musllinux_" in wheel.name
    for python in ["musl"] if musl else sys.argv[3:] or [sys.executable]:
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            good &= check_musl(build, wheel) if musl else check_python(python, build, wheel)
            os.chdir("/")
    sys.exit(not good)


if __name__ == "__main__":
    main()
