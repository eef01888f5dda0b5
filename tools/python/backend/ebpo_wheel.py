"""Builds the wheel of the Python package: a backend of PEP 517 for pip and build.

    pip wheel tools/python --no-deps -w dist
    pip wheel tools/python --no-deps -w dist --config-settings setup-args=-Dhttp=enabled
    python3 tools/python/backend/ebpo_wheel.py BUILD_FOLDER DIST    # packs an existing build

It needs meson, ninja, a C compiler, binutils and patchelf, and downloads nothing. The library is built without
libhdf5, libcurl, assimp and qhull. The libraries that it still needs (zstd, zlib, GMP, nettle, jansson) and
their licences go into the wheel. These libraries get unique names, so that no other package's copy is used
instead. The wheel contains no code for one version of Python, so one wheel serves all versions. Its tag
states the required version of glibc. Equal inputs give equal bytes.

meson-python is not used, because it installs the whole project: also the command, the headers and the
manuals. Up to its version 0.12 it has no option for this.
"""
import base64
import hashlib
import os
import pathlib
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import zipfile

ROOT = pathlib.Path(__file__).resolve().parents[3]
SETUP = ["--buildtype=release", "-Dtests=disabled", "-Dhttp=disabled", "-Dassimp=disabled", "-Dqhull=disabled",
         "-Drender=disabled", "-Dcaptions=disabled", "-Dpython_dir=none",
         "-Dhdf5=disabled"]
# Libraries of every Linux with glibc (PEP 600).
SYSTEM = re.compile(r"^(ld-linux|libc|libm|libpthread|libdl|librt|libgcc_s|libstdc\+\+)[-.]")
DATE = (1980, 1, 1, 0, 0, 0)


def run(*command):
    done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, text=True)
    if done.returncode:
        sys.stderr.write(done.stdout)  # ninja prints the compiler's messages here
        sys.exit(f"ebpo_wheel.py: {' '.join(map(str, command))} failed; its messages are above")
    return done.stdout


def version():
    return re.search(r"version: '([^']+)'", (ROOT / "meson.build").read_text())[1]


def package_in(folder):
    return sorted(path for path in folder.iterdir() if path.suffix in (".py", ".typed"))


def build(folder, setup_args):
    """Build only the library and the package."""
    print(run("meson", "setup", folder, ROOT, *SETUP, *setup_args), flush=True)
    library = f"lib/libebpo.so.{version()}"
    modules = [f"tools/python/ebpo/{path.name}" for path in package_in(ROOT / "tools/python/ebpo")]
    run("ninja", "-C", folder, library, "tools/python/ebpo/_declared.py", *modules)


def needed(library, system):
    """Return the libraries that a library needs and the system may lack, with their paths."""
    where = dict(re.findall(r"^\s*(\S+) => (/\S+)", run("ldd", library), flags=re.M))
    names = [name for name in run("patchelf", "--print-needed", library).split() if not system.match(name)]
    return {name: pathlib.Path(where[name]) for name in names}


def bundle(library, folder, system):
    """Copy a library and all libraries that it needs to a folder, and make them find each other there."""
    names, waiting = {}, [(copied(library, folder / "libebpo.so.0"), needed(library, system))]
    while waiting:
        file, needs = waiting.pop()
        for name, path in needs.items():
            if name not in names:
                digest = hashlib.sha256(path.read_bytes()).hexdigest()[:8]
                names[name] = name.replace(".so", f"-{digest}.so", 1)
                copy = copied(path, folder / names[name])
                run("patchelf", "--set-soname", names[name], copy)
                waiting.append((copy, needed(path, system)))
            run("patchelf", "--replace-needed", name, names[name], file)
        run("patchelf", "--set-rpath", "$ORIGIN", file)
    return names


def copied(path, copy):
    """Copy a library without debug symbols. Runs before patchelf, because strip breaks patched files."""
    shutil.copy(path, copy)
    copy.chmod(0o755)
    run("strip", "--strip-unneeded", copy)
    return copy


def licences(names):
    """Yield (name, text) of the licence of each library in the wheel, from Debian's copyright files."""
    for name in names:
        printed = subprocess.run(["dpkg-query", "-S", f"*/{name}"], capture_output=True, text=True).stdout
        package = printed.partition(":")[0].strip()
        path = pathlib.Path("/usr/share/doc") / package / "copyright"
        if package and path.is_file():
            yield f"licenses/{package}.txt", path.read_bytes()


def glibc(file):
    """Return the versions of glibc that a library needs, from its table of needed versions."""
    printed = run("env", "LC_ALL=C", "readelf", "--wide", "--version-info", file).partition("Version needs section")[2]
    names = re.findall(r"Name: GLIBC_(\S+)", printed)
    relative = [(2, 36)] if "ABI_DT_RELR" in names else []  # packed relocations need glibc 2.36
    return relative + [tuple(map(int, name.split(".")[:2])) for name in names if name[0].isdigit()]


def tag(files):
    """Return py3-none-PLATFORM for the glibc that the libraries need, at least that of manylinux2014."""
    machine = sysconfig.get_platform().rpartition("-")[2].replace("-", "_")
    if platform.libc_ver()[0] != "glibc":
        return f"py3-none-linux_{machine}"
    versions = [(2, 17)] + [version for file in files for version in glibc(file)]
    return "py3-none-manylinux_%d_%d_%s" % (*max(versions), machine)


METADATA = """Metadata-Version: 2.1
Name: ebpo
Version: {version}
Summary: EBP-Octree in HDF5: exact queries on triangle meshes of any size
License: MIT
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


def pack(folder, dist, system=SYSTEM):
    """Pack a build folder into a wheel, without libraries whose names match `system`."""
    folder, dist = pathlib.Path(folder), pathlib.Path(dist)
    dist.mkdir(parents=True, exist_ok=True)
    about = f"ebpo-{version()}.dist-info"
    with tempfile.TemporaryDirectory() as name:
        libraries = pathlib.Path(name)
        names = bundle(folder / f"lib/libebpo.so.{version()}", libraries, system)
        files = sorted(libraries.iterdir())
        tagged = tag(files)
        modules = package_in(folder / "tools/python/ebpo")
        entries = [(f"ebpo/{path.name}", path.read_bytes(), path.parent == libraries) for path in [*modules, *files]]
    head = f"Wheel-Version: 1.0\nGenerator: ebpo_wheel {version()}\nRoot-Is-Purelib: false\nTag: {tagged}\n"
    for name, data in [("licenses/ebpo.txt", (ROOT / "LICENSE").read_bytes()), *sorted(set(licences(names))),
                       ("METADATA", metadata()), ("WHEEL", head.encode())]:
        entries.append((f"{about}/{name}", data, False))
    path = dist / f"ebpo-{version()}-{tagged}.whl"
    write(path, entries)
    return path.name


# ---- functions that pip calls ----


def setup_args(config_settings):
    given = (config_settings or {}).get("setup-args", [])
    return [given] if isinstance(given, str) else list(given)


def prepare_metadata_for_build_wheel(metadata_directory, config_settings=None):
    """Write the metadata, so that pip knows the name without building the library."""
    about = pathlib.Path(metadata_directory) / f"ebpo-{version()}.dist-info"
    about.mkdir()
    (about / "METADATA").write_bytes(metadata())
    return about.name


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    with tempfile.TemporaryDirectory(prefix="ebpo-wheel-") as folder:
        build(folder, setup_args(config_settings))
        return pack(folder, wheel_directory)


def build_sdist(sdist_directory, config_settings=None):
    raise SystemExit("ebpo_wheel.py: a source distribution is the whole project; make it with `meson dist`")


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    name = pack(sys.argv[1], sys.argv[2])
    print(f"{sys.argv[2]}/{name}: {os.path.getsize(pathlib.Path(sys.argv[2]) / name)} bytes")


if __name__ == "__main__":
    main()
