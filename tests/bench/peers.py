#!/usr/bin/env python3
"""Remakes docs/measured/peers.md: queries of this library beside those of Python packages from PyPI, in one run.

    tests/bench/peers.py BUILD MODEL.ply... [--environment FOLDER] [--points 100000] [--judged 1000] [--poses 6]
                         [--rounds 3] -o docs/measured/peers.md

BUILD is a release build. FOLDER becomes a virtual environment with the packages (default: a temporary one). Packages
that PyPI does not have for this Python are named on the page. Open3D needs libusb-1.0-0 and libgl1. The other options
are those of peer_page.py, which runs in this environment.
"""
import argparse
import os
import pathlib
import subprocess
import sys
import tempfile

PACKAGES = ["numpy", "scipy", "coal", "embreex", "fcpw", "libigl", "manifold3d", "open3d", "python-fcl", "rtree", "trimesh"]


def prepare(folder):
    """Make a virtual environment with the packages. Return the names that cannot be installed."""
    python = folder / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    pip = [python, "-m", "pip", "install", "-q", "--only-binary=:all:", "--disable-pip-version-check"]
    return [name for name in PACKAGES if subprocess.run(pip + [name], check=False).returncode]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=lambda text: pathlib.Path(text).absolute())
    parser.add_argument("--environment", type=lambda text: pathlib.Path(text).absolute())
    options, others = parser.parse_known_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.environment or pathlib.Path(temporary)
        missing = [word for name in prepare(folder) for word in ("--missing", name)]
        page = pathlib.Path(__file__).with_name("peer_page.py")
        sys.exit(subprocess.run([folder / "bin" / "python", page, options.build, *others, *missing], check=False,
                                env=dict(os.environ, PYTHONPATH=str(options.build / "tools/python"),
                                         EBPO_LIBRARY=str(options.build / "lib/libebpo.so"))).returncode)


if __name__ == "__main__":
    main()
