#!/usr/bin/env python3
"""reading.py TOOL LIBRARY INPUTS VECTORS FEATURES: tests the library without libhdf5.

Runs the command with LIBRARY in place of the default library. Reading, verifying and queries give
the same results, without libhdf5 in the process. Commands that write HDF5 files fail with a message
and leave no file.
"""
import os
import subprocess
import sys
import tempfile

TOOL, LIBRARY, INPUTS, VECTORS = map(os.path.abspath, sys.argv[1:5])
FEATURES = sys.argv[5].split(",")
CANNOT = "was built without libhdf5"
READING = dict(os.environ, LC_ALL="C.UTF-8", LD_LIBRARY_PATH=os.path.dirname(LIBRARY))
# The build finds its own library without LD_LIBRARY_PATH; Meson may put the other library's folder
# first.
DEFAULT = {k: v for k, v in READING.items() if k != "LD_LIBRARY_PATH"}
failures = []


def check(good, what):
    print(("ok      " if good else "FAILED  ") + what, flush=True)
    if not good:
        failures.append(what)


def run(environment, *words, given=None):
    done = subprocess.run([TOOL, *words], env=environment, input=given or "", capture_output=True,
                          text=True, check=False)
    return done.returncode, done.stdout, done.stderr


def same(*words, given=None):
    """Check that both libraries give the same exit code and output."""
    reading, default = run(READING, *words, given=given), run(DEFAULT, *words, given=given)
    check(reading == default, f"{' '.join(words)}: as with libhdf5 ({reading[0]}, {default[0]}; "
          f"{reading[2].strip()[:200]})")
    return default


def slurp(path):
    with open(path, "rb") as f:
        return f.read()


def is_without():
    loaded = subprocess.run([TOOL], env=dict(READING, LD_TRACE_LOADED_OBJECTS="1"), check=True,
                            capture_output=True, text=True).stdout
    check(os.path.dirname(LIBRARY) in loaded, "the tested library is loaded")
    check("hdf5" not in loaded.replace(os.path.dirname(LIBRARY), ""), "libhdf5 is not loaded")


def vectors():
    points = "".join(f"{x} {y} {z}\n" for x in (-0.5, 0.1, 2) for y in (0, 0.7) for z in (0.2, 1.1))
    for kind in "passed", "failed":
        folder = os.path.join(VECTORS, kind)
        for name in sorted(os.listdir(folder)):
            if name.endswith(".ebpo.h5"):
                path = os.path.join(folder, name)
                code, _, said = run(READING, "verify", path)
                check(code == (0 if kind == "passed" else 1) and CANNOT not in said,
                      f"{kind}: {name} ({code})")
                if kind == "passed":
                    same("distance", path, given=points)


def writing(model):
    """Yield each command that would write HDF5, and its output."""
    for words in (["convert", "sphere.ply", "OUT"], ["subset", "--levels", "0-1", model, "OUT"],
                  ["repack", model, "OUT"], ["recover", "-o", "OUT", model],
                  ["export", "--levels", "0", "--format", "xdmf", model, "OUT.xdmf"],
                  ["export", "--levels", "0", "--format", "vtkhdf", model, "OUT.vtkhdf"],
                  ["info", "--compat", "quads.ply"]):
        out = next((w.replace("OUT", "out") for w in words if "OUT" in w), None)
        code, _, said = run(READING, *(w.replace("OUT", "out") for w in words))
        is_reported = CANNOT in said or words[0] == "info"
        check(code == 1 and is_reported, f"{words[0]} reports that it is unsupported ({code}: {said.strip()[:200]})")
        check(not out or not any(n.startswith(out) for n in os.listdir(".")), f"{words[0]}: no output")


def other_outputs(model):
    outputs = [["extract", "-q", "--mesh", model, "OUT.ply"],
               ["extract", "-q", "--level", "2", model, "OUT.ply"],
               ["export", "-q", "--mesh", model, "OUT.glb"]]
    if "png" in FEATURES:
        outputs.append(["render", "-q", "--size", "64x64", model, "OUT.png"])
    for words in outputs:
        for name, environment in ("reading", READING), ("default", DEFAULT):
            code, _, said = run(environment, *(w.replace("OUT", name) for w in words))
            check(code == 0, f"{words[0]} works with the {name} library ({said.strip()})")
        end = words[-1].replace("OUT", "")
        check(slurp("reading" + end) == slurp("default" + end), f"{words[0]}: the same bytes")


def main():
    is_without()
    vectors()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        subprocess.run([INPUTS, "."], check=True)
        check(run(DEFAULT, "convert", "-q", "torus.ply", "t.ebpo.h5")[0] == 0, "a model")
        other_outputs("t.ebpo.h5")
        writing("t.ebpo.h5")
        os.chdir("/")
    print(f"{len(failures)} failed")
    return 1 if failures else 0


sys.exit(main())
