#!/usr/bin/env python3
"""Checks that the packages agree with the project: test_packages.py SOURCE_ROOT BUILD_ROOT MESON...

Debian: what is installed is in one package, and each line of a package's list takes something; the symbols
file has each public function. Conda's recipe, Homebrew's formula and debian/control have the version and the
libraries of meson.build.
"""
import collections
import fnmatch
import json
import pathlib
import re
import subprocess
import sys

root, build, meson = pathlib.Path(sys.argv[1]), sys.argv[2], sys.argv[3:]
packaging = root / "tools/packaging"
debian = packaging / "debian"
meson_build = (root / "meson.build").read_text()
version = re.search(r"^  version: '(.*)'", meson_build, re.M)[1]
major, minor = map(int, version.split(".")[:2])
problems = []

# What meson.build asks for, and its names in Debian, conda and Homebrew; None: not needed there.
LIBRARIES = {
    "threads": (None, None, None),
    "hdf5-serial": ("libhdf5-dev", "hdf5", "hdf5"),
    "hdf5": ("libhdf5-dev", "hdf5", "hdf5"),
    "libzstd": ("libzstd-dev", "zstd", "zstd"),
    "zlib": ("zlib1g-dev", "zlib", "zlib"),
    "gmp": ("libgmp-dev", "gmp", "gmp"),
    "nettle": ("nettle-dev", "nettle", "nettle"),
    "jansson": ("libjansson-dev", "jansson", "jansson"),
    "assimp": ("libassimp-dev", "assimp", "assimp"),
    "libcurl": ("libcurl4-openssl-dev", "libcurl", "curl"),
    "libpng": ("libpng-dev", "libpng", "libpng"),
    "cairo": ("libcairo2-dev", "cairo", "cairo"),
    "qhull_r": ("libqhull-dev", "qhull", "qhull"),
    "check": (None, None, None),  # tests are not built in packages
}
VIEWER = "usr/share/ebpo/viewer"
OPTIONAL = {"usr/lib/TRIPLET/libebpo.a",  # only with -Ddefault_library=both
            VIEWER}  # only if it was built before


def introspect(what):
    return json.loads(subprocess.run([*meson, "introspect", what, build], check=True, capture_output=True).stdout)


def below(path, folder):
    return path == folder or path.startswith(folder + "/")


def installed():
    """Paths as the Debian build has them: its own folders for libraries, the plugin and Python."""
    options = {option["name"]: option["value"] for option in introspect("--buildoptions")}
    prefix = options["prefix"].rstrip("/")
    libdir = options["libdir"]
    folders = [(options["plugin_dir"] or f"{libdir}/hdf5/plugin", "usr/lib/TRIPLET/hdf5/serial/plugins"),
               (options["python_dir"] or f"{libdir}/ebpo/python", "usr/lib/python3/dist-packages"),
               (libdir, "usr/lib/TRIPLET"), (options["includedir"], "usr/include"),
               (options["mandir"], "usr/share/man"), (options["datadir"], "usr/share"), (options["bindir"], "usr/bin")]
    for path in introspect("--installed").values():
        for folder, there in folders:
            folder = str(pathlib.PurePosixPath(prefix) / folder)
            if below(path, folder):
                yield there + path[len(folder):]
                break
        else:
            yield path


def lists():
    """(package, what a line of its list takes)."""
    for path in sorted(debian.glob("*.install")):
        for line in path.read_text().splitlines():
            yield path.stem, line.split()[0].replace("/*/", "/TRIPLET/", 1) if line.startswith("usr/lib/*") \
                else line.split()[0]


def check_lists():
    takers = collections.defaultdict(list)
    paths = sorted(set(installed()) - OPTIONAL)
    for package, pattern in lists():
        if not pattern.startswith("usr/"):  # of the sources
            if not list(root.glob(pattern)):
                problems.append(f"{package}.install: there is no {pattern}")
            continue
        taken = [path for path in paths if any(
            fnmatch.fnmatch(str(part), pattern) for part in (pathlib.PurePosixPath(path), *pathlib.PurePosixPath(path).parents))]
        if not taken:
            problems.append(f"{package}.install: {pattern} takes nothing that is installed")
        for path in taken:
            takers[path].append(package)
    for path in paths:
        if len(takers[path]) != 1:
            problems.append(f"{path}: installed, and in {' and '.join(takers[path]) or 'no package'} of "
                            "tools/packaging/debian/*.install")
    if f"dh_install -pebpo {VIEWER}" not in (debian / "rules").read_text():
        problems.append(f"debian/rules: does not install {VIEWER}, so dh_missing stops if the viewer was built")
    return len(paths)


def check_symbols():
    functions = set()
    for header in (root / "lib/include/ebpo").glob("*.h"):
        text = re.sub(r"/\*.*?\*/", "", header.read_text(), flags=re.S)
        functions |= set(re.findall(r"^EBPO_API\b[^;]*?\b(ebpo_\w+)\s*\(", text, flags=re.M))
    text = (debian / "libebpo0.symbols").read_text()
    symbols = set(re.findall(r"^ (\w+)@Base \d", text, flags=re.M))
    problems.extend(f"{name}: public; libebpo0.symbols lacks ' {name}@Base {version}'" for name in sorted(functions - symbols))
    problems.extend(f"{name}: in libebpo0.symbols, not declared" for name in sorted(symbols - functions))
    if not text.startswith(f"libebpo.so.{major} libebpo{major} "):
        problems.append(f"libebpo0.symbols: not of libebpo.so.{major}")
    return len(functions)


def check_versions(control, conda, brew):
    said = {
        "debian/changelog": re.match(r"ebpo-octree \((.*)-\w+\)", (debian / "changelog").read_text())[1],
        "conda/meta.yaml": re.search(r'^  version: "(.*)"', conda, re.M)[1],
        "homebrew/ebpo.rb": re.search(r'^  version "(.*)"', brew, re.M)[1],
    }
    problems.extend(f"{name}: {other}, but meson.build says {version}" for name, other in said.items() if other != version)
    # what tools/python/ebpo/_library.py takes
    limit = f"libebpo{major} (<< 0.{minor + 1}~)" if major == 0 else f"libebpo{major} (<< {major + 1}~)"
    if limit not in control:
        problems.append(f"debian/control: python3-ebpo does not depend on {limit}")


def check_libraries(control, conda, brew):
    dependencies = re.findall(r"dependency\('([\w-]+)'(?:, version: '>=([\d.]+)')?", meson_build)
    build_depends = control.split("Build-Depends:")[1].split("\n\n")[0]
    for name, least in dependencies:
        if name not in LIBRARIES:
            problems.append(f"meson.build: {name} has no names in test_packages.py")
            continue
        deb, of_conda, of_brew = LIBRARIES[name]
        for where, text, package, pattern in (
                ("debian/control", build_depends, deb, rf"\b{deb}( \(>= (?P<least>.*)\))?[,\n]"),
                ("conda/meta.yaml", conda, of_conda, rf"^    - {of_conda}( >=(?P<least>.*))?$"),
                ("homebrew/ebpo.rb", brew, of_brew, rf'^  depends_on "{of_brew}"(?P<least>)$')):
            found = re.search(pattern, text, re.M)
            if package and not found:
                problems.append(f"{where}: lacks {package}, as meson.build asks for {name}")
            elif package and least and "brew" not in where and found["least"] != least:
                problems.append(f"{where}: {package} is not >= {least}, as meson.build asks for")
    return len(dependencies)


texts = [(packaging / name).read_text() for name in ("debian/control", "conda/meta.yaml", "homebrew/ebpo.rb")]
counts = check_lists(), check_symbols(), check_libraries(*texts)
check_versions(*texts)
for problem in problems:
    print(problem)
print("%d files, %d functions, %d libraries; %d problems" % (*counts, len(problems)))
sys.exit(1 if problems or not all(counts) else 0)
