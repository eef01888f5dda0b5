#!/usr/bin/env python3
"""Results do not depend on the compiler and its flags: programs that are fp_hash_main.c with the
library's numeric sources, built with other flags each, print the same hashes.

    fp_flags.py GOLDEN [--update] PROGRAM...

GOLDEN holds what all builds on all machines must print. After a change that is meant to change the
contents of files (a selection of planes, an order) redo it with `--update`:

    tests/lint/flags/fp_flags.py tests/lint/flags/fp_golden.txt --update build/tests/lint/flags/fp_hash_default
"""
import os
import pathlib
import subprocess
import sys

golden, programs, update = pathlib.Path(sys.argv[1]), [a for a in sys.argv[2:]
                                                       if a != "--update"], "--update" in sys.argv
# The C library has variants of its functions for processors: without FMA and AVX2 they round
# otherwise, and nothing may rest on that.
LIBC = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable,-FMA4_Usable"}


def hashes(program, environment=None):
    out = subprocess.run([program], check=True, capture_output=True, text=True,
                         env={**os.environ, **(environment or {})}).stdout
    return {line[34:]: line[:33] for line in out.splitlines()}


runs = {program: hashes(program) for program in programs}
if len(programs) > 1:  # in the suite `full`
    runs[f"{programs[0]} with another libm"] = hashes(programs[0], LIBC)
if update:
    golden.write_text("".join(f"{value} {name}\n" for name, value in runs[programs[0]].items()))
expected = {line[34:]: line[:33] for line in golden.read_text().splitlines()}
problems = []
for program, found in runs.items():
    for name in sorted(expected.keys() | found.keys()):
        want, got = expected.get(name), found.get(name)
        if want == got:
            continue
        part = ("is not in the golden file" if not want else "is missing" if not got
                else "content differs" if want[:16] != got[:16] else "answers differ")
        problems.append(f"{program}: {name}: {part}: {got}, expected {want}")
print("\n".join(problems) or f"{len(expected)} cases have the expected hashes in {len(runs)} runs")
sys.exit(1 if problems else 0)
