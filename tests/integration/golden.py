#!/usr/bin/env python3
"""Checks that the same input gives the same bytes, for any number of threads, in every run, and with every compiler
and its options.

    golden.py EBPO GENERATE EXPECTED [few] [--update]

EXPECTED contains a content digest for each input; other builds of the same sources must reach it too. Real models
are tested if $EBPO_MODELS names their folder; of these, `few` tests a solid and a surface that convert in seconds.
"""
import filecmp
import json
import os
import pathlib
import subprocess
import sys
import tempfile

EBPO, GENERATE, EXPECTED = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
GENERATED = {
    "torus": ["--base", "torus", "--faces", "30000", "--seed", "7"],
    "sphere": ["--base", "sphere", "--subdivide", "5", "--seed", "3"],
}
REAL = ["bunny_closed", "office_chair", "twin7081_left", "blade"]
VARIANTS = {"default": [], "leaf-planes": ["--profile", "full", "--leaf-faces", "8"],
            "fine": ["--leaf-faces", "0", "--rule", "positive"]}


def run(*arguments):
    return subprocess.run(arguments, check=True, capture_output=True, text=True).stdout


def inputs(folder):
    for name, options in GENERATED.items():
        path = f"{folder}/{name}.ply"
        run(GENERATE, *options, path)
        yield name, path
    models = os.environ.get("EBPO_MODELS")
    for name in REAL[:2 if "few" in sys.argv[4:] else None] if models else []:
        yield name, f"{models}/{name}.ply"


def main():
    found, problems = {}, []
    with tempfile.TemporaryDirectory() as folder:
        for name, path in inputs(folder):
            for variant, options in VARIANTS.items():
                outputs = [f"{folder}/{threads}.ebpo.h5" for threads in (1, 5)]
                for threads, output in zip((1, 5), outputs):
                    run(EBPO, "convert", "-q", "--threads", str(threads), *options, path, output)
                if (not all(filecmp.cmp(outputs[0], output, shallow=False)
                            for output in outputs[1:])):
                    problems.append(f"{name} {variant}: bytes depend on the number of threads")
                found[f"{name} {variant}"] = json.loads(run(EBPO, "info", "--json",
                                                            outputs[0]))["content_sha256"]
    expected = json.loads(EXPECTED.read_text()) if EXPECTED.exists() else {}
    if "--update" in sys.argv:
        EXPECTED.write_text(json.dumps(dict(sorted({**expected, **found}.items())), indent=1)
                            + "\n")
        expected = json.loads(EXPECTED.read_text())
    for key, digest in found.items():
        if expected.get(key) != digest:
            problems.append(f"{key}: content {digest}, expected {expected.get(key)}")
    print("\n".join(problems)
          or f"{len(found)} files have the expected content, for 1 and 5 threads")
    return 1 if problems else 0


sys.exit(main())
