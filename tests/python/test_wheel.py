#!/usr/bin/env python3
"""Tests the wheel in an environment with numpy only: test_wheel.py SOURCE_ROOT BUILD EBPO EBPO_INPUTS

The wheel is packed from the library of this build. It contains only the libraries that the real wheel's library
needs; the other libraries are the system's. Exit code 77: pip, patchelf or binutils is missing.
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
import tempfile
import zipfile

source, build, command, inputs = map(os.path.abspath, sys.argv[1:5])
sys.path.insert(0, os.path.join(source, "tools/python/backend"))
sys.dont_write_bytecode = True
import ebpo_wheel  # noqa: E402

OTHERS = re.compile(r"^(?!lib(zstd|z|gmp|nettle|jansson)\.so)")

# Libraries of the system that manylinux allows, for C and C++.
ALLOWED = {"libc.so.6", "libm.so.6", "libpthread.so.0", "libdl.so.2", "librt.so.1", "libgcc_s.so.1", "libstdc++.so.6",
           "ld-linux-x86-64.so.2", "ld-linux-aarch64.so.1"}

QUERY = """
import ctypes, os, sys
import numpy as np, ebpo
here = os.path.dirname(ebpo.__file__)
assert here.startswith(sys.prefix) and os.path.dirname(ebpo.library()) == here, (here, ebpo.library())
m = ebpo.open("sphere.ebpo.h5")
P = np.random.default_rng(1).uniform(-1.2, 1.2, (100000, 3))
inside = m.inside(P)
assert 0 < inside.sum() < len(P)
assert (inside == (m.winding(P) != 0)).all() and (m.distance(P[:999]).distance < 0).tolist() == inside[:999].tolist()
mapped = open("/proc/self/maps").read()
scenes = hasattr(ctypes.CDLL(ebpo.library()), "ebpo_scene_new")
for name in ["zstd", "z", "gmp", "nettle"] + ["jansson"] * scenes:
    assert f"{here}/lib{name}-" in mapped, name
print("queried")
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
        assert {"ebpo/__init__.py", "ebpo/_declared.py", "ebpo/py.typed", "ebpo/libebpo.so.0"} <= set(names)
        licences = [name for name in names if "/licenses/" in name]
        assert len(licences) >= 1 + (len([n for n in names if ".so" in n]) - 1) * bool(shutil.which("dpkg-query"))


def check_platform(path, omitted):
    """Check that the tag names the newest required glibc, and that the wheel contains all other libraries."""
    with tempfile.TemporaryDirectory() as folder, zipfile.ZipFile(path) as archive:
        libraries = [name for name in archive.namelist() if ".so" in name]
        names = {os.path.basename(name) for name in libraries}
        newest = (2, 17)
        for name in libraries:
            printed = run("objdump", "-p", archive.extract(name, folder), env=dict(os.environ, LC_ALL="C"))
            needed = set(re.findall(r"^ +NEEDED +(\S+)", printed, re.M))
            others = needed - names - ALLOWED
            assert not [other for other in others if not omitted.match(other)], (name, others)
            assert re.findall(r"^ +R(?:UN)?PATH +(\S+)", printed, re.M) == ["$ORIGIN"], (name, "searches other folders")
            for version in re.findall(r"^ +0x\w+ 0x\w+ \d+ GLIBC_(\d+\.\d+)", printed, re.M):
                newest = max(newest, tuple(map(int, version.split("."))))
            if " GLIBC_ABI_DT_RELR" in printed:
                newest = max(newest, (2, 36))
        found = re.search(r"-manylinux_(\d+)_(\d+)_", os.path.basename(path))
        assert not found or tuple(map(int, found.groups())) == newest, (path, newest)


def main():
    pip = subprocess.run([sys.executable, "-m", "pip", "--version"], capture_output=True).returncode == 0
    if not pip or not all(map(shutil.which, ["patchelf", "readelf", "objdump"])):
        print("pip, patchelf or binutils is not installed (tools/install-deps.sh --tests)")
        return 77
    with tempfile.TemporaryDirectory() as name:
        os.chdir(name)
        wheel = ebpo_wheel.pack(build, "dist", OTHERS)
        assert re.fullmatch(r"ebpo-[0-9.]+-py3-none-(manylinux|linux)_\w+\.whl", wheel), wheel
        check_record(pathlib.Path("dist", wheel))
        check_platform(pathlib.Path("dist", wheel), OTHERS)
        first = pathlib.Path("dist", wheel).read_bytes()
        ebpo_wheel.pack(build, "again", OTHERS)
        assert pathlib.Path("again", wheel).read_bytes() == first, "equal inputs give equal bytes"
        run(sys.executable, "-m", "venv", "--without-pip", "--system-site-packages", "clean")
        python = pathlib.Path(name, "clean/bin/python")
        run(sys.executable, "-m", "pip", "--python", python, "install", "--no-index", "--no-deps", f"dist/{wheel}")
        run(inputs, ".")
        run(command, "convert", "-q", "sphere.ply", "sphere.ebpo.h5")
        nothing = {name: value for name, value in os.environ.items() if not name.startswith(("EBPO", "PYTHON", "LD_"))}
        print(run(python, "-c", QUERY, env=dict(nothing, PATH="/usr/bin:/bin")), end="")
        run(sys.executable, "-m", "pip", "--python", python, "uninstall", "-y", "ebpo")
        assert not list(pathlib.Path(name).glob("clean/lib/python*/site-packages/ebpo*")), "uninstall removes all files"
    return 0


sys.exit(main())
