#!/usr/bin/env python3
"""test_python_refuses.py SOURCE: the specification's reader refuses frames that decode, and that the
specification does not want."""
import pathlib
import sys

source = pathlib.Path(sys.argv[1])
sys.path.insert(0, str(source / "format-spec"))
import read_ebpo

failed = source / "format-spec" / "vectors" / "failed"
for name, said in (("without_checksum", "without its checksum"),
                   ("with_unused_bit", "an unused bit"), ("repeats_once", "its byte once")):
    try:
        read_ebpo.read(str(failed / f"chunk_frame_{name}.ebpo.h5"))
        sys.exit(f"{name}: read")
    except AssertionError as error:
        if said not in str(error):
            sys.exit(f"{name}: {error}")
