#!/usr/bin/env python3
"""Checks that sources that need IEEE arithmetic reject compilers and flags that violate it.

    test_strict_fp.py SOURCE_ROOT COMPILER [ARGUMENT...]

Each such source includes core/strict_fp.h before all else, and the compiler (its name and the
arguments for includes) stops there, with a message that says what to do, for each set of flags
below that it knows.
"""
import pathlib
import re
import subprocess
import sys
import tempfile

root, compiler = pathlib.Path(sys.argv[1]), sys.argv[2:]
# These move numbers, and compute none that decides anything.
MOVERS = {"core", "format", "hdf5_read", "hdf5_write", "io", "include"}
# Flags, and what the refusal must say. x87 registers keep 64 bits of mantissa; -mfpmath=both may
# keep them or not.
REFUSED = [
    (["-ffast-math"], "fast-math"),
    (["-Ofast"], "fast-math"),
    (["-funsafe-math-optimizations"], "unsafe-math"),
    (["-fassociative-math", "-fno-signed-zeros", "-fno-trapping-math"], "unsafe-math"),
    (["-freciprocal-math"], "unsafe-math"),
    (["-fno-signed-zeros"], "unsafe-math"),
    (["-ffinite-math-only"], "fast-math"),
    (["-mfpmath=387"], "-mfpmath=sse"),
    (["-mfpmath=387", "-fexcess-precision=standard"], "-mfpmath=sse"),
    (["-mfpmath=387", "-std=c11"], "-mfpmath=sse"),
    (["-mfpmath=both"], "-mfpmath=sse"),
    (["-m32", "-mno-sse"], "-mfpmath=sse"),
]
ACCEPTED = [["-O0"], ["-fno-math-errno"], ["-frounding-math"], ["-O3", "-march=native"],
            ["-O3", "-mfma", "-ffp-contract=fast"]]


def without_comments(text):
    return re.sub(r"/\*.*?\*/|//[^\n]*", "", text, flags=re.S)


def compiled(flags, source):
    return subprocess.run([*compiler, *flags, "-fsyntax-only", source], capture_output=True,
                          text=True)


problems, numeric = [], []
for path in sorted((root / "lib").rglob("*.c")):
    if path.relative_to(root / "lib").parts[0] in MOVERS:
        continue
    text = without_comments(path.read_text())
    if not re.search(r"\b(double|float)\b", text):
        continue
    numeric.append(path)
    first = re.search(r"#\s*include[^\n]*", text)
    if not first or "core/strict_fp.h" not in first.group(0):
        problems.append(f"{path.relative_to(root)}: computes with floating point but does not "
                        f"include core/strict_fp.h first")

said = []
with tempfile.TemporaryDirectory() as folder:
    known = pathlib.Path(folder, "known.c")
    known.write_text("int known;\n")
    source = pathlib.Path(folder, "refused.c")
    source.write_text('#include "core/strict_fp.h"\ndouble f(double x, double y);\ndouble '
                      'f(double x, double y)\n{\n    return x + y;\n}\n')
    for flags, message in REFUSED:
        if (compiled(flags, known).returncode != 0
            or "not supported" in compiled(flags, known).stderr
            or "unused" in compiled(flags, known).stderr):
            continue
        # What the flags do not change needs no refusal: clang ignores some of gcc's.
        macros = subprocess.run([*compiler, *flags, "-dM", "-E", known], capture_output=True,
                                text=True).stdout
        plain = subprocess.run([*compiler, "-dM", "-E", known], capture_output=True,
                               text=True).stdout
        if macros == plain:
            continue
        run = compiled(flags, source)
        if run.returncode == 0:
            problems.append(f"{' '.join(flags)}: compiles, but should be refused")
        elif message not in run.stderr:
            problems.append(f"{' '.join(flags)}: refused without saying {message}: {run.stderr}")
        else:
            said.append(" ".join(flags))
    for flags in ACCEPTED:
        if compiled(flags, known).returncode == 0 and compiled(flags, source).returncode != 0:
            problems.append(f"{' '.join(flags)}: refused, but should compile: "
                            f"{compiled(flags, source).stderr}")
if not said:
    problems.append("no flags were refused")
print("\n".join(problems)
      or f"{len(numeric)} sources insist on strict floating point; refused: {', '.join(said)}")
sys.exit(1 if problems else 0)
