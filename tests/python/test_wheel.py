#!/usr/bin/env python3
"""Tests the wheel in an environment with numpy only: test_wheel.py SOURCE_ROOT BUILD EBPO_INPUTS

The wheel is packed from the programs of this build, whose libraries are the system's. check_wheel.py tests the real
wheel, which contains them. Exit code 77: pip or binutils is missing.
"""
import base64
import csv
import hashlib
import io
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile

source, build, inputs = map(os.path.abspath, sys.argv[1:4])
sys.path.insert(0, os.path.join(source, "tools/python/backend"))
sys.dont_write_bytecode = True
import ebpo_wheel  # noqa: E402

QUERY = """
import os, subprocess, sys
import numpy as np, ebpo
here = os.path.dirname(ebpo.__file__)
assert here.startswith(sys.prefix) and os.path.dirname(ebpo.library()) == os.path.join(here, "lib"), (here, ebpo.library())
m = ebpo.convert("sphere.ply", "sphere.ebpo.h5")
P = np.random.default_rng(1).uniform(-1.2, 1.2, (100000, 3))
inside = m.inside(P)
assert 0 < inside.sum() < len(P)
assert (inside == (m.winding(P) != 0)).all() and (m.distance(P[:999]).distance < 0).tolist() == inside[:999].tolist()
command = os.path.join(sys.prefix, "bin", "ebpo")
subprocess.run([command, "convert", "-q", "sphere.ply", "command.ebpo.h5"], check=True)
assert open("command.ebpo.h5", "rb").read() == open("sphere.ebpo.h5", "rb").read()
text = subprocess.run([command, "--version", "--verbose"], check=True, capture_output=True, text=True).stdout
assert f"library: {here}/lib/libebpo.so.0" in text and f"HDF5 plugin: {here}/lib/hdf5/plugin" in text, text
print("converted and queried")
"""
# `ebpo serve` of the wheel finds the viewer in the wheel.
SERVE = """
import os, subprocess, sys, urllib.request
server = subprocess.Popen([os.path.join(sys.prefix, "bin", "ebpo"), "serve", "-q", "--port", "0", "sphere.ebpo.h5"],
                          stdout=subprocess.PIPE, text=True)
page = urllib.request.urlopen(server.stdout.readline().strip()).read()
server.terminate()
assert server.wait() == 0 and b"<html" in page, page[:200]
print("served the viewer")
"""


def run(*words, **options):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, **options)
    if done.returncode:
        sys.exit(f"FAILED: {' '.join(map(str, words))}\n{done.stdout}{done.stderr}")
    return done.stdout


def check_record(path):
    """Check that RECORD lists every file with its digest and size, as pip requires."""
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        record = next(name for name in names if name.endswith("/RECORD"))
        rows = list(csv.reader(io.StringIO(archive.read(record).decode())))
        assert [row[0] for row in rows] == names, "RECORD lists the files of the wheel"
        for name, digest, size in rows:
            data = archive.read(name)
            expected = "sha256=" + base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            assert name == record or (digest, int(size)) == (expected, len(data)), name
        assert {"ebpo/__init__.py", "ebpo/_declared.py", "ebpo/py.typed", "ebpo/lib/libebpo.so.0", "ebpo/bin/ebpo",
                "ebpo/lib/hdf5/plugin/libebpo_h5zstd.so"} <= set(names), names
        assert any(name.endswith(".dist-info/licenses/ebpo.txt") for name in names)
        return names


def check_platform(path):
    """Check that the tag names the newest required glibc, and where programs search for libraries."""
    newest = (2, 17)
    with tempfile.TemporaryDirectory() as folder, zipfile.ZipFile(path) as archive:
        for name in ("ebpo/bin/ebpo", "ebpo/lib/libebpo.so.0", "ebpo/lib/hdf5/plugin/libebpo_h5zstd.so"):
            printed = run("objdump", "-p", archive.extract(name, folder), env=dict(os.environ, LC_ALL="C"))
            searched = re.findall(r"^ +R(?:UN)?PATH +(\S+)", printed, re.M)
            assert searched == (["$ORIGIN/../lib"] if "/bin/" in name else []), (name, searched)
            for found in re.findall(r"^ +0x\w+ 0x\w+ \d+ GLIBC_(\d+\.\d+)", printed, re.M):
                newest = max(newest, tuple(map(int, found.split("."))))
            if " GLIBC_ABI_DT_RELR" in printed:
                newest = max(newest, (2, 36))
    found = re.search(r"-manylinux_(\d+)_(\d+)_", os.path.basename(path))
    assert not found or tuple(map(int, found.groups())) == newest, (path, newest)


def check_sdist():
    """Check the source distribution: what pip needs is in it, and an unpacked one makes an equal one."""
    name = ebpo_wheel.build_sdist(".")
    with tarfile.open(name) as archive:
        names = {member.name.partition("/")[2]: member.mode for member in archive.getmembers()}
        archive.extractall("sdist", filter="data") if hasattr(tarfile, "data_filter") else archive.extractall("sdist")
    assert {"PKG-INFO", "pyproject.toml", "meson.build", "LICENSE", "docs/guide/python.md"} <= set(names), names
    assert names["tools/packaging/windows.sh"] == 0o755 and not any(name.startswith("tests/") for name in names)
    root = pathlib.Path("sdist", name.partition(".tar")[0])
    hook = "import sys; sys.path.insert(0, 'tools/python/backend'); import ebpo_wheel; ebpo_wheel.build_sdist('..')"
    assert (root / "pyproject.toml").read_text().count('"tools/python/backend"') == 1
    run(sys.executable, "-B", "-c", hook, cwd=root)
    assert pathlib.Path("sdist", name).read_bytes() == pathlib.Path(name).read_bytes()


def main():
    pip = subprocess.run([sys.executable, "-m", "pip", "--version"], capture_output=True).returncode == 0
    if not pip or not all(map(shutil.which, ["readelf", "objdump", "strip"])):
        print("pip or binutils is not installed (tools/install-deps.sh --tests)")
        return 77
    with tempfile.TemporaryDirectory() as name:
        os.chdir(name)
        wheel = ebpo_wheel.pack(build, "dist")
        assert re.fullmatch(r"ebpo-[0-9.]+-py3-none-(manylinux|linux)_\w+\.whl", wheel), wheel
        check_record(pathlib.Path("dist", wheel))
        check_platform(pathlib.Path("dist", wheel))
        first = pathlib.Path("dist", wheel).read_bytes()
        ebpo_wheel.pack(build, "again")
        assert pathlib.Path("again", wheel).read_bytes() == first, "equal inputs give equal bytes"
        check_sdist()
        run(sys.executable, "-m", "venv", "--without-pip", "--system-site-packages", "clean")
        python = pathlib.Path(name, "clean/bin/python")
        run(sys.executable, "-m", "pip", "--python", python, "install", "--no-index", "--no-deps", f"dist/{wheel}")
        run(inputs, ".")
        nothing = {name: value for name, value in os.environ.items() if not name.startswith(("EBPO", "PYTHON", "LD_"))}
        print(run(python, "-c", QUERY, env=dict(nothing, PATH="/usr/bin:/bin")), end="")
        if "ebpo/share/ebpo/viewer/index.html" in zipfile.ZipFile(pathlib.Path("dist", wheel)).namelist():
            print(run(python, "-c", SERVE, env=dict(nothing, PATH="/usr/bin:/bin")), end="")
        else:
            print("not tested: the viewer, because tools/web/dist was not built")
        if subprocess.run([python, "-c", "import h5py"]).returncode == 0:
            for order in ("first", "last"):
                print(run(python, os.path.join(source, "tests/python/wheel_with_h5py.py"), order, "sphere.ply",
                          env=nothing), end="")
        run(sys.executable, "-m", "pip", "--python", python, "uninstall", "-y", "ebpo")
        assert not list(pathlib.Path(name).glob("clean/lib/python*/site-packages/ebpo*")), "uninstall removes all files"
        assert not pathlib.Path(name, "clean/bin/ebpo").exists()
    return 0


sys.exit(main())
